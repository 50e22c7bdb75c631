/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * IRQLogic (register map 2.2; README of tests/data/hm2dpll): a flag that one of the DPLL's outputs sets.
 *
 * The level of the chosen output goes through two flip-flops; the flag is set at the edge that sees the wanted change
 * between them. The older firmware waits for a falling edge, the newer one for a rising one. Source 0 is the
 * reference, 1 to 4 are the timers (trace irq).
 */
#include <stddef.h>

#include "dpll.h"
#include "map.h"

enum { REG_DIVIDER, REG_STATUS, REG_CLEAR, REGS };

#define STATUS_FLAG    0x01u
#define STATUS_MASK    0x02u
#define STATUS_BITS    0x1Fu
#define SOURCE_SHIFT   2
#define SEEN_FALL      0x2u /* older level 1, newer 0 */
#define SEEN_RISE      0x1u
#define PIN_INT        0x81u
#define EDGES_TO_STATE 2 /* from the edge after which the source changed to the one that sets the flag */

struct irq {
    bool on_rise;
    uint8_t status;
    uint8_t seen; /* the two flip-flops, bit 0 the newer */
    bool level;   /* of the source, before the next edge */
};

static unsigned source(const struct irq *const s)
{
    return s->status >> SOURCE_SHIFT;
}

static uint8_t wanted(const struct irq *const s)
{
    return s->on_rise ? SEEN_RISE : SEEN_FALL;
}

static bool level_at(const struct sim_module *const m, const int64_t clk)
{
    return sim_dpll_level(m->card, source(m->state), clk);
}

static void power_up(struct sim_module *const m)
{
    struct irq *const s = m->state;
    /* Every output of the DPLL powers up high. */
    *s = (struct irq){.on_rise = sim_map_is_new(sim_idrom(m->card)),
                      .level = hm2_idrom_find(sim_idrom(m->card), HM2_GTAG_DPLL) != NULL};
}

/* One edge, but for the level before the next one. */
static void edge(struct irq *const s)
{
    if (s->seen == wanted(s))
        s->status |= STATUS_FLAG;
    s->seen = (uint8_t)((s->seen & 1u) << 1 | (s->level ? 1u : 0u));
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct irq *const s = m->state;
    const int64_t from = m->clk;
    edge(s);
    if (clk - from >= 2) {
        edge(s); /* what had not come through both flip-flops yet; the level of this edge is corrected below */
        const int64_t before = clk - EDGES_TO_STATE;
        const int64_t change = s->on_rise ? sim_dpll_last_rise(m->card, source(s), before)
                                          : sim_dpll_last_fall(m->card, source(s), before);
        if (change >= from)
            s->status |= STATUS_FLAG;
        s->seen = (uint8_t)((level_at(m, clk - 2) ? 2u : 0u) | (level_at(m, clk - 1) ? 1u : 0u));
    }
    s->level = level_at(m, clk);
}

static uint32_t read_reg(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct irq *const s = m->state;
    (void)low;
    if (page == REG_STATUS)
        return s->status;
    *undriven = UINT32_MAX;
    return 0;
}

/* A change seen at the same edge wins over a written flag, and the clearing register over both. */
static void write_reg(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct irq *const s = m->state;
    (void)low;
    if (page == REG_STATUS)
        s->status = (uint8_t)(value & STATUS_BITS);
    edge(s);
    if (page == REG_CLEAR)
        s->status &= (uint8_t)~STATUS_FLAG;
    m->clk++;
    s->level = level_at(m, m->clk);
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t secondary_pin)
{
    const struct irq *const s = m->state;
    const bool asserted = (s->status & STATUS_FLAG) && (s->status & STATUS_MASK);
    (void)unit;
    return secondary_pin == PIN_INT && asserted ? SIM_LOW : SIM_HIGH;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct irq *const s = m->state;
    if (s->status & STATUS_FLAG)
        return SIM_NEVER;
    const uint8_t next_seen = (uint8_t)((s->seen & 1u) << 1 | (s->level ? 1u : 0u));
    if (s->seen == wanted(s) || next_seen == wanted(s))
        return m->clk;
    const int64_t change = sim_dpll_next_change(m->card, source(s), s->on_rise, m->clk);
    return change < SIM_NEVER - EDGES_TO_STATE ? change + EDGES_TO_STATE : SIM_NEVER;
}

const struct sim_module_ops sim_irq_ops = {
    .gtag = HM2_GTAG_IRQ,
    .name = "IRQLogic",
    .pages = REGS,
    .state_size = sizeof(struct irq),
    .power_up = power_up,
    .advance = advance,
    .read = read_reg,
    .write = write_reg,
    .output = output,
    .next_event = next_event,
};
