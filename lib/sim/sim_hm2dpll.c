/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* HM2DPLL (register map 3.15): registers, pins, and answers for the modules that hang on its timers. */
#include "dpll.h"
#include "dpll_logic.h"
#include "map.h"

#define ACCUM_SIZE 42u /* register 3 reports it in bits 7..0 */
#define PHASE_LOW  10  /* the accumulator's bits 41..10 fill a register */

#define PIN_SYNC_IN 0x01u
#define PIN_REF_OUT 0x82u /* then timers 1 to 4 */

/* No driver waits longer for a timer (LBP16 waits end after 65 ms): ten seconds at 100 MHz. */
#define LOOK_AHEAD_EDGES 1000000000

struct hm2dpll {
    struct sim_dpll d;
    bool sync_pending; /* register 6 was read: the next edge captures the phase */
};

static void power_up(struct sim_module *const m)
{
    struct hm2dpll *const s = m->state;
    sim_dpll_power_up(&s->d, sim_map_is_new(sim_idrom(m->card)), m->clk);
    s->sync_pending = false;
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct hm2dpll *const s = m->state;
    if (s->sync_pending && s->d.clk < clk) {
        s->sync_pending = false;
        sim_dpll_edge(&s->d, true);
    }
    sim_dpll_run(&s->d, clk - s->d.clk);
}

static uint32_t phase(const struct sim_dpll *const d)
{
    return (uint32_t)(d->accum >> PHASE_LOW);
}

static uint32_t read_reg(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct hm2dpll *const s = m->state;
    const struct sim_dpll *const d = &s->d;
    (void)low;
    switch (page) {
    case SIM_DPLL_BASE_RATE:
        return d->base_rate;
    case SIM_DPLL_PHASE:
        return phase(d);
    case SIM_DPLL_CONTROL0:
        return (uint32_t)d->prescale << 24 | ((uint32_t)d->correction & 0xFFFFFFu);
    case SIM_DPLL_CONTROL1:
        return (uint32_t)d->filter_prescale << 16 | ACCUM_SIZE;
    case SIM_DPLL_TIMERS12:
        return (uint32_t)d->timer[1] << 16 | d->timer[0];
    case SIM_DPLL_TIMERS34:
        return (uint32_t)d->timer[3] << 16 | d->timer[2];
    case SIM_DPLL_SYNC:
        s->sync_pending = true;
        return phase(d);
    default:
        *undriven = UINT32_MAX;
        return 0;
    }
}

static void write_reg(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct hm2dpll *const s = m->state;
    (void)low;
    const enum sim_dpll_reg reg = page < SIM_DPLL_REGS ? (enum sim_dpll_reg)page : SIM_DPLL_REGS;
    sim_dpll_write_edge(&s->d, reg, value, s->sync_pending);
    s->sync_pending = false;
    m->clk = s->d.clk;
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t secondary_pin)
{
    const struct hm2dpll *const s = m->state;
    (void)unit;
    if (secondary_pin < PIN_REF_OUT)
        return SIM_LOW;
    return sim_dpll_output(&s->d, secondary_pin - PIN_REF_OUT) ? SIM_HIGH : SIM_LOW;
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t secondary_pin, const bool level)
{
    struct hm2dpll *const s = m->state;
    (void)unit;
    if (secondary_pin == PIN_SYNC_IN)
        s->d.sync_in = level;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct hm2dpll *const s = m->state;
    int64_t event = m->clk + LOOK_AHEAD_EDGES;
    for (unsigned i = 0; i < SIM_DPLL_OUTPUTS; i++) {
        const bool level = sim_dpll_output(&s->d, i);
        const int64_t change = sim_dpll_find_change(&s->d, i, !level, event - m->clk);
        if (change < event)
            event = change;
    }
    return event;
}

const struct sim_module_ops sim_hm2dpll_ops = {
    .gtag = HM2_GTAG_DPLL,
    .name = "HM2DPLL",
    .pages = SIM_DPLL_REGS,
    .state_size = sizeof(struct hm2dpll),
    .power_up = power_up,
    .advance = advance,
    .read = read_reg,
    .write = write_reg,
    .output = output,
    .input = input,
    .next_event = next_event,
};

/* ---- answers for others -------------------------------------------------------------------------------------------
 */

static const struct sim_dpll *dpll_of(struct sim_card *const card, const unsigned timer)
{
    const struct sim_module *const m = timer < SIM_DPLL_OUTPUTS ? sim_find(card, HM2_GTAG_DPLL) : NULL;
    return m ? &((const struct hm2dpll *)m->state)->d : NULL;
}

static int64_t newest_before(const int64_t list[2], const int64_t clk)
{
    for (unsigned i = 0; i < 2; i++)
        if (list[i] < clk)
            return list[i];
    return INT64_MIN;
}

int64_t sim_dpll_last_rise(struct sim_card *const card, const unsigned timer, const int64_t clk)
{
    const struct sim_dpll *const d = dpll_of(card, timer);
    return d ? newest_before(d->history[timer].rise, clk) : INT64_MIN;
}

int64_t sim_dpll_last_fall(struct sim_card *const card, const unsigned timer, const int64_t clk)
{
    const struct sim_dpll *const d = dpll_of(card, timer);
    return d ? newest_before(d->history[timer].fall, clk) : INT64_MIN;
}

int64_t sim_dpll_next_change(struct sim_card *const card, const unsigned timer, const bool rise, const int64_t clk)
{
    const struct sim_dpll *const d = dpll_of(card, timer);
    if (!d)
        return SIM_NEVER;
    struct sim_dpll then = *d;
    if (then.clk < clk)
        sim_dpll_run(&then, clk - then.clk);
    return sim_dpll_find_change(&then, timer, rise, LOOK_AHEAD_EDGES);
}

int64_t sim_dpll_next_rise(struct sim_card *const card, const unsigned timer, const int64_t clk)
{
    return sim_dpll_next_change(card, timer, true, clk);
}

bool sim_dpll_level(struct sim_card *const card, const unsigned timer, const int64_t clk)
{
    const struct sim_dpll *const d = dpll_of(card, timer);
    if (!d)
        return false;
    struct sim_dpll then = *d;
    if (then.clk < clk)
        sim_dpll_run(&then, clk - then.clk);
    bool level = sim_dpll_output(&then, timer);
    for (int64_t edge = then.clk - 1; edge >= clk; edge--) /* back over what the latest edges changed */
        if (then.history[timer].rise[0] == edge || then.history[timer].fall[0] == edge ||
            then.history[timer].rise[1] == edge || then.history[timer].fall[1] == edge)
            level = !level;
    return level;
}
