/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* StepGen (register map 3.4): registers and time of the step generators behind one descriptor. */
#include "dpll.h"
#include "map.h"
#include "sim_card.h"
#include "stepgen_latch.h"
#include "stepgen_logic.h"

#include <stddef.h>

#define INSTANCES_MAX 64u /* address bits 7..2 select the instance (1.1) */
#define PAGES         11u /* registers 0..9, and 10 in the new map */

enum {
    REG_ACCUM = SIM_STEPGEN_ACCUM,
    REG_MODE = SIM_STEPGEN_MODE,
    REG_MASTER_DDS = SIM_STEPGEN_REGS, /* the first one that all instances share */
    REG_DPLL_SELECT
};

#define DPLL_SELECT_ENABLE 0x8000u /* [15] enable, [14:12] timer; the rest is not stored */
#define DPLL_SELECT_MASK   0xF000u

#define FIRST_OUTPUT 0x81u

#define MODE_BITS_PLAIN 0x3u
#define MODE_BIT_SWAP   0x4u /* versions 0x42 and 0xC2 swap the two outputs */

struct instance {
    struct sim_stepgen gen;
    uint32_t latched; /* new map: what register 1 reads */
    struct sim_latch_filter filter[SIM_LATCH_INPUTS];
    uint32_t index_position; /* what index or probe latched: bits 47..16 of the accumulator */
    /* The motor (sim_stepgen_motor()). */
    bool rests;
    int64_t rested_at; /* travel when it began to rest; */
    uint64_t left_out; /* whole steps * 2^32 that it has not made */
};

struct stepgens {
    struct sim_rategen rategen;
    bool has_dpll_select;
    uint8_t mode_bits;
    bool swaps_outputs;
    const struct sim_latch_kind *latch; /* NULL = no index and probe inputs */
    unsigned count;
    uint16_t dpll_select;
    /* The edge after a write to the select register compares the newly chosen timer with what the old one was. */
    int64_t switched_clk;
    bool switch_latches;
    unsigned io[INSTANCES_MAX]; /* of the first outputs; SIM_NO_PAD = on none */
    struct instance instances[INSTANCES_MAX];
};

static int init(struct sim_module *const m)
{
    struct stepgens *const s = m->state;
    const struct hm2_idrom *const idrom = sim_idrom(m->card);
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    s->has_dpll_select = sim_map_is_new(idrom) && hm2_idrom_find(idrom, HM2_GTAG_DPLL);
    s->latch = sim_latch_kind(m->md.version);
    for (unsigned i = 0; i < s->count; i++)
        s->io[i] = sim_pad_of(idrom, HM2_GTAG_STEPGEN, i, FIRST_OUTPUT);
    s->swaps_outputs = m->md.version == 0x42 || m->md.version == 0xC2;
    s->mode_bits = MODE_BITS_PLAIN;
    if (s->swaps_outputs)
        s->mode_bits |= MODE_BIT_SWAP;
    if (s->latch) /* all bits of the register, used or not (traces stepgen_v3) */
        s->mode_bits = m->md.version == 0x03 ? 0x7F : 0xFF;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct stepgens *const s = m->state;
    s->rategen = (struct sim_rategen){0};
    s->dpll_select = 0;
    s->switched_clk = INT64_MIN;
    for (unsigned i = 0; i < s->count; i++)
        s->instances[i] = (struct instance){0};
}

/* ---- time ---------------------------------------------------------------------------------------------------------
 */

static int64_t smaller(const int64_t a, const int64_t b)
{
    return a < b ? a : b;
}

static void run_generators(struct stepgens *const s, const int64_t edges)
{
    for (unsigned i = 0; i < s->count; i++)
        sim_stepgen_run(&s->instances[i].gen, &s->rategen, edges);
    for (int64_t done = 0; done < edges; done += SIM_STEPGEN_HORIZON)
        sim_rategen_run(&s->rategen, smaller(edges - done, SIM_STEPGEN_HORIZON));
}

/* Index and probe at one edge: copies the accumulator from before it. Returns the mode bits that clear themselves. */
static uint8_t edge_of_inputs(struct instance *const one, const struct sim_latch_kind *const kind)
{
    const uint8_t mode = one->gen.mode;
    const bool once = kind->just_once_bit == 0 || (mode & kind->just_once_bit);
    uint8_t clears = 0;
    for (unsigned input = 0; input < SIM_LATCH_INPUTS; input++) {
        if (sim_latch_fires(&one->filter[input], kind, input, mode)) {
            one->index_position = (uint32_t)(one->gen.accum >> 16);
            clears |= once ? kind->latch_bit[input] : 0;
        }
        sim_latch_edge(&one->filter[input], kind);
    }
    return clears;
}

static int64_t quiet_inputs(const struct stepgens *const s, int64_t edges)
{
    for (unsigned i = 0; i < s->count; i++)
        for (unsigned input = 0; input < SIM_LATCH_INPUTS; input++)
            edges = smaller(edges, sim_latch_quiet(&s->instances[i].filter[input], s->latch));
    return edges;
}

static void run(struct stepgens *const s, int64_t edges)
{
    while (s->latch && edges > 0) {
        const int64_t quiet = quiet_inputs(s, edges);
        for (unsigned i = 0; i < s->count; i++)
            for (unsigned input = 0; input < SIM_LATCH_INPUTS; input++)
                sim_latch_run_quiet(&s->instances[i].filter[input], s->latch, quiet);
        run_generators(s, quiet);
        edges -= quiet;
        if (edges == 0)
            return;
        for (unsigned i = 0; i < s->count; i++)
            s->instances[i].gen.mode &= (uint8_t)~edge_of_inputs(&s->instances[i], s->latch);
        run_generators(s, 1);
        edges--;
    }
    run_generators(s, edges);
}

/* What register 1 reads is a register of its own, loaded at an edge with the accumulator from before that edge. */
static void latch(struct stepgens *const s)
{
    for (unsigned i = 0; i < s->count; i++)
        s->instances[i].latched = (uint32_t)(s->instances[i].gen.accum >> 16);
}

static unsigned selected_timer(const struct stepgens *const s)
{
    const unsigned timer = s->dpll_select >> 12 & 7u;
    return timer <= 4 ? timer : 0;
}

/* The edge in [from, to) that is the last to load the read-back, -1 = none. */
static int64_t last_latch(struct sim_module *const m, const int64_t from, const int64_t to)
{
    const struct stepgens *const s = m->state;
    if (!(s->dpll_select & DPLL_SELECT_ENABLE))
        return to - 1;
    /* The edge after the one that made the timer rise. */
    const int64_t rise = sim_dpll_last_rise(m->card, selected_timer(s), to - 1);
    const int64_t first = from == s->switched_clk ? from + 1 : from;
    if (rise >= first - 1)
        return rise + 1;
    return first > from && s->switch_latches ? from : -1;
}

static void select_timer(struct sim_module *const m, const uint32_t value)
{
    struct stepgens *const s = m->state;
    const bool was_high = sim_dpll_level(m->card, selected_timer(s), m->clk - 1);
    s->dpll_select = value & DPLL_SELECT_MASK;
    s->switched_clk = m->clk;
    s->switch_latches = !was_high && sim_dpll_level(m->card, selected_timer(s), m->clk);
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct stepgens *const s = m->state;
    int64_t from = m->clk;
    const int64_t at = s->has_dpll_select ? last_latch(m, from, clk) : -1;
    if (at >= from) {
        run(s, at - from);
        latch(s);
        from = at;
    }
    run(s, clk - from);
}

static int64_t next_event(struct sim_module *const m)
{
    const struct stepgens *const s = m->state;
    int64_t silent = SIM_STEPGEN_HORIZON;
    for (unsigned i = 0; i < s->count; i++)
        silent = smaller(silent, sim_stepgen_silent(&s->instances[i].gen, &s->rategen));
    return m->clk + silent;
}

/* ---- registers ----------------------------------------------------------------------------------------------------
 */

/* Mode bits at the bottom, the latched position at the top; what is between is not driven. */
static uint32_t read_mode(const struct stepgens *const s, const struct instance *const one, uint32_t *const undriven)
{
    const uint32_t position_mask = ~(UINT32_MAX >> s->latch->position_bits);
    *undriven = ~(position_mask | s->mode_bits);
    return (one->index_position & position_mask) | one->gen.mode;
}

static uint32_t read_reg(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct stepgens *const s = m->state;
    const unsigned i = low / 4;
    if (page == REG_MASTER_DDS)
        return s->rategen.rate;
    if (page == REG_DPLL_SELECT && s->has_dpll_select)
        return s->dpll_select;
    if (page == REG_ACCUM && i < s->count)
        return s->has_dpll_select ? s->instances[i].latched : (uint32_t)(s->instances[i].gen.accum >> 16);
    if (page == REG_MODE && i < s->count && s->latch)
        return read_mode(s, &s->instances[i], undriven);
    *undriven = UINT32_MAX; /* all others are write-only (trace readback) */
    return 0;
}

/* The edge at which something is written; every generator makes it, one perhaps with a new register value. */
static void edge(struct sim_module *const m, const unsigned chosen, const struct sim_stepgen_write *const write)
{
    struct stepgens *const s = m->state;
    if (s->has_dpll_select && last_latch(m, m->clk, m->clk + 1) == m->clk)
        latch(s);
    for (unsigned i = 0; i < s->count; i++) {
        struct instance *const one = &s->instances[i];
        const uint8_t clears = s->latch ? edge_of_inputs(one, s->latch) : 0;
        sim_stepgen_edge(&one->gen, s->rategen.tick, i == chosen ? write : NULL);
        one->gen.mode &= (uint8_t)~clears;
    }
    m->clk++;
}

static void write_reg(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct stepgens *const s = m->state;
    struct sim_stepgen_write write = {.reg = SIM_STEPGEN_REGS, .value = value};
    if (page < SIM_STEPGEN_REGS)
        write.reg = (enum sim_stepgen_reg)page;
    if (write.reg == SIM_STEPGEN_MODE)
        write.value &= s->mode_bits;
    edge(m, low / 4, &write);
    if (page == REG_MASTER_DDS)
        sim_rategen_load(&s->rategen, value);
    else
        sim_rategen_run(&s->rategen, 1);
    if (page == REG_DPLL_SELECT && s->has_dpll_select)
        select_timer(m, value);
}

/* ---- inputs and outputs
 * ------------------------------------------------------------------------------------------------------
 */

/* An index belongs to its generator; there is one probe for all. */
static void input(struct sim_module *const m, const unsigned unit, const uint8_t secondary_pin, const bool level)
{
    struct stepgens *const s = m->state;
    for (unsigned i = 0; s->latch && i < s->count; i++) {
        struct instance *const one = &s->instances[i];
        if (secondary_pin == s->latch->pin[SIM_LATCH_PROBE])
            one->filter[SIM_LATCH_PROBE].level = level;
        if (secondary_pin == s->latch->pin[SIM_LATCH_INDEX] && (i == unit || (unit & HM2_UNIT_GLOBAL)))
            one->filter[SIM_LATCH_INDEX].level = level;
    }
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t secondary_pin)
{
    const struct stepgens *const s = m->state;
    const unsigned number = (secondary_pin & 0x7Fu) - 1; /* 0x81 = step or table bit 0, 0x82 = dir or bit 1, ... */
    if (unit >= s->count || number >= 8)
        return SIM_LOW;
    const struct sim_stepgen *const gen = &s->instances[unit].gen;
    unsigned outputs = sim_stepgen_outputs(gen);
    if (s->swaps_outputs && (gen->mode & MODE_BIT_SWAP))
        outputs = (outputs & ~3u) | (outputs & 1u) << 1 | (outputs >> 1 & 1u);
    return outputs >> number & 1u ? SIM_HIGH : SIM_LOW;
}

/* ---- position
 * ------------------------------------------------------------------------------------------------------
 */

static uint64_t whole_steps(const int64_t travel)
{
    return (uint64_t)travel & ~(uint64_t)UINT32_MAX;
}

static void ports_changed(struct sim_module *const m)
{
    struct stepgens *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct instance *const one = &s->instances[i];
        const bool rests = s->io[i] != SIM_NO_PAD && !sim_pad_carries_alternate(m->card, s->io[i]);
        if (rests && !one->rests)
            one->rested_at = one->gen.travel;
        if (!rests && one->rests)
            one->left_out += whole_steps(one->gen.travel) - whole_steps(one->rested_at);
        one->rests = rests;
    }
}

static const struct instance *instance_of(struct sim_card *const card, const unsigned stepgen)
{
    const struct sim_module *const m = sim_find(card, HM2_GTAG_STEPGEN);
    const struct stepgens *const s = m ? m->state : NULL;
    return s && stepgen < s->count ? &s->instances[stepgen] : NULL;
}

int64_t sim_stepgen_position(struct sim_card *const card, const unsigned stepgen)
{
    const struct instance *const one = instance_of(card, stepgen);
    return one ? one->gen.travel : 0;
}

int64_t sim_stepgen_motor(struct sim_card *const card, const unsigned stepgen)
{
    const struct instance *const one = instance_of(card, stepgen);
    return one ? (int64_t)((uint64_t)(one->rests ? one->rested_at : one->gen.travel) - one->left_out) : 0;
}

const struct sim_module_ops sim_stepgen_ops = {
    .gtag = HM2_GTAG_STEPGEN,
    .name = "StepGen",
    .pages = PAGES,
    .state_size = sizeof(struct stepgens),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read_reg,
    .write = write_reg,
    .output = output,
    .input = input,
    .next_event = next_event,
    .ports_changed = ports_changed,
};
