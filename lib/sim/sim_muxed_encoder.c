/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Multiplexed encoders, tags 0C and 0D: two counters share their pins, and a select output tells the multiplexer
 * outside whose signals are wanted (register map 3.5.4, traces in folder encoder_muxed).
 *
 * Input pins 1..6 are the shared pins, unit = pair. Pins 0x41..0x43 are A, B and index of one encoder (unit =
 * encoder) as behind a multiplexer without delay: the pair's pin shows the encoder that is selected.
 */
#include "sim_qcounter.h"

#include <stdlib.h>

#define PIN_A      0x01u /* secondary pins (register map 4.1) */
#define PIN_INDEX  0x03u
#define PIN_MASK   0x04u
#define PIN_PROBE  0x05u
#define PIN_SHARED 0x06u
#define PIN_SELECT 0x81u /* of tag 0D: MuxSel0; 0x82 is MuxSel1 */
#define OUTSIDE    0x40u

#define RATE_TOP_BIT    0x800u
#define RATE_MASK       0xFFFu
#define DEFAULT_RATE_HZ 8000000u /* select rate after configuration: round(clock / 8 MHz) - 2 (3.5.3) */
#define DESKEW_SHIFT    28
#define SHARED_INPUTS   3u  /* A, B, index */
#define PIPELINE_EDGES  20  /* the longest way of a select change through the delays below */
#define SKIP_EDGES      100 /* shorter quiet times are not worth a jump */

struct pair {
    bool pin[SHARED_INPUTS];
    bool outside[2][SHARED_INPUTS]; /* the two encoders behind a multiplexer */
    bool multiplexer;               /* somebody drives them */
};

struct muxed {
    struct sim_qc_bank bank; /* first: the followers reach it through sim_module.state */
    struct sim_divider rate;
    unsigned deskew;
    int64_t rate_clk; /* rate and deskew were written at this edge */
    struct pair *pairs;
    /* The select counter and its way to the pin and to the latches: each is a clock behind the one before. */
    uint8_t select, select_1, select_out;
    uint32_t delay; /* bit 0 of the select counter, newest in bit 0 */
    bool sample_1;  /* the delayed select bit, a clock ago */
    bool filter_tick;
};

static uint32_t default_rate(const struct sim_module *const m)
{
    const uint32_t divider = (sim_clock_low_hz(m->card) + DEFAULT_RATE_HZ / 2) / DEFAULT_RATE_HZ;
    return divider > 2 ? divider - 2 : 0;
}

static int init(struct sim_module *const m)
{
    struct muxed *const x = m->state;
    const int err = sim_qc_bank_init(m, &x->bank);
    if (err)
        return err;
    x->bank.type.probe = (m->md.version & 0x80u) != 0; /* 3.5.8 */
    x->pairs = calloc(x->bank.count / 2 + 1, sizeof(*x->pairs));
    return x->pairs ? 0 : HM2_ERR_NOMEM;
}

static void release(struct sim_module *const m)
{
    struct muxed *const x = m->state;
    sim_qc_bank_release(&x->bank);
    free(x->pairs);
}

static void power_up(struct sim_module *const m)
{
    struct muxed *const x = m->state;
    sim_qc_bank_power_up(m, &x->bank);
    sim_divider_start(&x->rate, m->clk, default_rate(m), RATE_TOP_BIT);
    x->deskew = 0;
    x->rate_clk = m->clk - PIPELINE_EDGES;
    x->select = x->select_1 = x->select_out = 0;
    x->delay = 0;
    x->sample_1 = x->filter_tick = false;
}

/* What a pair's pin shows while the select output is at `select`. */
static bool pair_level(const struct pair *const pair, const unsigned select, const unsigned input)
{
    return pair->multiplexer ? pair->outside[select & 1u][input] : pair->pin[input];
}

static void latch_inputs(struct muxed *const x, const unsigned odd)
{
    for (unsigned i = odd; i < x->bank.count; i += 2)
        for (unsigned input = 0; input < SHARED_INPUTS; input++)
            x->bank.counters[i].pin[input] = pair_level(&x->pairs[i / 2], x->select_out, input);
}

/* One edge of everything. */
static void edge(struct muxed *const x, const int64_t clk, const unsigned target,
                 const struct sim_qc_access *const access)
{
    const bool tick = sim_divider_tick(&x->rate, clk) == clk;
    const uint16_t stamp = sim_timestamp_at(&x->bank.stamps, clk);
    const bool filters = x->bank.type.filter_halved ? x->filter_tick : tick;
    for (unsigned i = 0; i < x->bank.count; i++)
        sim_qcounter_edge(&x->bank.counters[i], &x->bank.type, clk, filters, stamp, i == target ? access : NULL);
    const bool sample = x->delay >> x->deskew & 1u;
    if (sample && !x->sample_1)
        latch_inputs(x, 0);
    x->filter_tick = !sample && x->sample_1;
    if (x->filter_tick)
        latch_inputs(x, 1);
    x->sample_1 = sample;
    x->select_out = x->select_1;
    x->select_1 = x->select;
    x->delay = x->delay << 1 | (x->select & 1u);
    if (tick)
        x->select = (x->select + 1u) & 3u;
}

/* A select change is on its way through the delays. */
static bool selecting(const struct muxed *const x)
{
    const uint32_t history = x->delay & 0xFFFFu;
    return x->select_1 != x->select || x->select_out != x->select_1 || x->filter_tick ||
           history != ((x->select & 1u) ? 0xFFFFu : 0) || x->sample_1 != (x->select & 1u);
}

static bool counters_busy(const struct muxed *const x)
{
    for (unsigned i = 0; i < x->bank.count; i++)
        if (sim_qcounter_busy(&x->bank.counters[i], &x->bank.type))
            return true;
    return false;
}

/* What the select output shows when the latches of one half take their inputs: without deskew its own half, with it the
 * select may have moved on. */
static unsigned select_at_latch(const struct muxed *const x, const unsigned half)
{
    const int64_t moved = x->deskew ? (x->deskew - 1) / x->rate.period + 1 : 0;
    return (unsigned)((half + moved) & 1);
}

/* Nothing but the select counter will move: every counter has what its pins show and its filters are through. */
static bool settled(const struct muxed *const x)
{
    for (unsigned i = 0; i < x->bank.count; i++) {
        const struct sim_qcounter *const q = &x->bank.counters[i];
        const unsigned select = select_at_latch(x, i & 1u);
        for (unsigned input = 0; input < SHARED_INPUTS; input++)
            if (q->pin[input] != pair_level(&x->pairs[i / 2], select, input))
                return false;
        if (sim_qcounter_busy(q, &x->bank.type) || !sim_qcounter_settled(q, &x->bank.type))
            return false;
    }
    return true;
}

/* Leave out quiet edges: up to `to` less what the delays need to hold again what they would hold. */
static int64_t skip_quiet(struct muxed *const x, const int64_t from, const int64_t to)
{
    if (to - from < SKIP_EDGES || from - x->rate_clk < PIPELINE_EDGES || !settled(x))
        return from;
    const int64_t clk = to - PIPELINE_EDGES;
    x->select = (uint8_t)((x->select + (uint64_t)sim_divider_count(&x->rate, from, clk)) & 3u);
    x->select_1 = x->select_out = x->select;
    x->sample_1 = x->select & 1u;
    x->delay = x->sample_1 ? UINT32_MAX : 0;
    x->filter_tick = false;
    return clk;
}

static void run(struct muxed *const x, const int64_t from, const int64_t to)
{
    int64_t clk = skip_quiet(x, from, to);
    unsigned until_look = SKIP_EDGES;
    while (clk < to) {
        if (!selecting(x) && !counters_busy(x)) {
            const int64_t tick = sim_divider_tick(&x->rate, clk);
            clk = tick < to ? tick : to;
            if (clk == to)
                return;
        }
        edge(x, clk++, UINT32_MAX, NULL);
        if (--until_look == 0) {
            clk = skip_quiet(x, clk, to);
            until_look = SKIP_EDGES;
        }
    }
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct muxed *const x = m->state;
    int64_t from = m->clk;
    sim_qc_bank_follow(m, &x->bank, clk); /* first: the edges below make what the bus sees */
    const int64_t sample = sim_qc_bank_sample_edge(m, &x->bank, clk);
    if (sample >= from) {
        run(x, from, sample);
        sim_qc_bank_sample(&x->bank, sample);
        from = sample;
    }
    run(x, from, clk);
    m->clk = clk;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct muxed *const x = m->state;
    return sim_qc_bank_next_sample(m, &x->bank);
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct muxed *const x = m->state;
    return sim_qc_bank_read(m, &x->bank, page, low, undriven);
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct muxed *const x = m->state;
    const int64_t clk = m->clk;
    const struct sim_qc_access access = {
        .clear = page == SIM_QC_PAGE_COUNT, .load = page == SIM_QC_PAGE_CONTROL, .value = (uint16_t)value};
    if (sim_qc_bank_sample_edge(m, &x->bank, clk + 1) == clk)
        sim_qc_bank_sample(&x->bank, clk);
    edge(x, clk, low / 4, &access);
    sim_qc_bank_write(&x->bank, clk, page, value);
    if (page == SIM_QC_PAGE_RATE) {
        sim_divider_write(&x->rate, clk, value & RATE_MASK, RATE_TOP_BIT);
        x->deskew = value >> DESKEW_SHIFT;
        x->rate_clk = clk;
    }
    m->clk = clk + 1;
}

static void shared_input(struct muxed *const x, const unsigned unit, const uint8_t pin, const bool level)
{
    const bool outside = pin & OUTSIDE;
    const unsigned input = (pin & ~OUTSIDE) == PIN_SHARED ? SIM_QC_INDEX : (pin & ~OUTSIDE) - PIN_A;
    const unsigned pair = outside ? unit / 2 : unit;
    for (unsigned p = 0; p <= x->bank.count / 2; p++) {
        if (p != pair && unit < HM2_UNIT_GLOBAL)
            continue;
        if (outside) {
            x->pairs[p].outside[unit & 1u][input] = level;
            x->pairs[p].multiplexer = true;
        } else {
            x->pairs[p].pin[input] = level;
            x->pairs[p].multiplexer = false;
        }
    }
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct muxed *const x = m->state;
    const unsigned code = pin & ~OUTSIDE;
    if ((code >= PIN_A && code <= PIN_INDEX) || code == PIN_SHARED) {
        shared_input(x, unit, pin, level);
        return;
    }
    /* Masks are not multiplexed: one per encoder. There is one probe for all (3.5.4). */
    for (unsigned i = 0; i < x->bank.count; i++) {
        if (code == PIN_PROBE)
            x->bank.counters[i].pin[SIM_QC_PROBE] = level;
        else if (code == PIN_MASK && (i == unit || unit >= HM2_UNIT_GLOBAL))
            x->bank.counters[i].mask = level;
    }
}

const struct sim_module_ops sim_muxed_encoder_ops = {
    .gtag = HM2_GTAG_MUXED_ENCODER,
    .name = "MuxedEncoder",
    .pages = SIM_QC_PAGES,
    .state_size = sizeof(struct muxed),
    .init = init,
    .release = release,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .input = input,
    .next_event = next_event,
};

/* ---- the select output, a module of its own without registers -------------------------------------------------------
 */

static enum sim_level select_output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    (void)unit;
    struct sim_module *const counters = sim_find(m->card, HM2_GTAG_MUXED_ENCODER);
    if (!counters || pin < PIN_SELECT || pin > PIN_SELECT + 1u)
        return SIM_LOW;
    const struct muxed *const x = counters->state;
    return x->select_out >> (pin - PIN_SELECT) & 1u ? SIM_HIGH : SIM_LOW;
}

static int64_t select_next_event(struct sim_module *const m)
{
    const struct sim_module *const counters = sim_find(m->card, HM2_GTAG_MUXED_ENCODER);
    if (!counters)
        return SIM_NEVER;
    const struct muxed *const x = counters->state;
    if (x->select_out != x->select_1)
        return counters->clk;
    if (x->select_1 != x->select)
        return counters->clk + 1;
    return sim_divider_tick(&x->rate, counters->clk) + 2; /* select, its delay, the pin */
}

const struct sim_module_ops sim_muxed_select_ops = {
    .gtag = HM2_GTAG_MUXED_ENCODER_SEL,
    .name = "MuxedEncoderSelect",
    .output = select_output,
    .next_event = select_next_event,
};
