/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* SSI, tag 08: clocked readers of absolute encoders (register map 3.9, traces in folders ssi and ssi_new). */
#include "absolute.h"
#include "sim_card.h"
#include "trigger.h"

#define CHANNELS_MAX 32u /* the busy register has a bit for each */
#define TOP          0x8000u
#define BITS_MASK    0x7Fu
#define PSTART       0x0100u
#define TSTART       0x0200u
#define BUSY         0x0800u
#define DAV          0x8000u
#define IDLE_PS      20000000
#define FILTER_HZ    5000000 /* later sources: the data line must be steady for 200 ns */
#define PIN_CLOCK    0x81u
#define PIN_DATA     0x03u
#define PIN_DAV      0x84u

enum { PAGE_DATA0, PAGE_DATA1, PAGE_CONTROL, PAGE_GLOBAL, PAGES };

struct channel {
    uint16_t rate, accum;
    uint8_t length, left;
    bool pstart, go, shifting, last, old_last, dav, old_top, data_read;
    uint64_t shift, latch;
    struct sim_trigger trigger;
    bool line; /* as pads have it */
    bool sampled, filtered;
    unsigned filter;
    struct sim_abs_encoder encoder;
};

struct ssi {
    unsigned count, filter_clk; /* 0 = no filter */
    int64_t clk_ps;
    struct channel channels[CHANNELS_MAX];
};

/* ---- one clock -----------------------------------------------------------------------------------------------------
 */

static void filter_edge(const struct ssi *const s, struct channel *const c, const bool line)
{
    const unsigned before = c->filter;
    if (c->sampled && before < s->filter_clk)
        c->filter++;
    else if (!c->sampled && before > 0)
        c->filter--;
    if (before >= s->filter_clk)
        c->filtered = true;
    if (before == 0)
        c->filtered = false;
    c->sampled = line;
}

static void edge(const struct ssi *const s, struct channel *const c, const int64_t clk, const bool start)
{
    const struct channel old = *c;
    const bool line = c->encoder.spec.bits ? sim_abs_line(&c->encoder, clk * s->clk_ps) : c->line;
    const bool top = old.accum & TOP;
    if (start) {
        c->left = c->length;
        c->go = true;
        c->shifting = c->last = false;
        c->shift = 0;
    }
    if (old.old_top && !top) {
        if (old.shifting) /* the first clock only makes the encoder latch */
            c->shift = old.shift << 1 | (s->filter_clk ? old.filtered : line);
        c->last = old.left == 1;
        if (old.left) {
            c->left = (uint8_t)(old.left - 1u);
            c->shifting = true;
        }
    }
    if (!old.last && old.old_last) {
        c->go = false;
        c->dav = true;
        c->latch = old.shift;
    }
    if (old.data_read)
        c->dav = c->data_read = false;
    c->old_last = old.last;
    c->old_top = top;
    c->accum = old.go ? (uint16_t)(old.accum + old.rate) : 0;
    if (s->filter_clk)
        filter_edge(s, c, line);
    if (top != ((c->accum & TOP) != 0))
        sim_abs_ssi_clock(&c->encoder, top, clk * s->clk_ps);
}

/* Nothing but the phase of the clock moves. A count of 0 is never reached. */
static bool quiet(const struct ssi *const s, const struct channel *const c)
{
    const bool endless = c->go && c->left == 0;
    if (c->last || c->old_last || c->data_read || sim_abs_moving(&c->encoder) || (c->go && c->rate && !endless))
        return false;
    if (endless && c->encoder.spec.bits)
        return false;
    if (!c->go && (c->accum || c->old_top))
        return false;
    const unsigned settled = c->line || c->encoder.spec.bits ? s->filter_clk : 0;
    return c->filter == settled && (!s->filter_clk || c->filtered == (settled > 0));
}

static void run_channel(const struct ssi *const s, struct channel *const c, int64_t clk, const int64_t to)
{
    for (; clk < to && !quiet(s, c); clk++)
        edge(s, c, clk, false);
    if (clk >= to || !c->go)
        return;
    c->old_top = (uint16_t)(c->accum + (uint64_t)(to - clk - 1) * c->rate) & TOP;
    c->accum = (uint16_t)(c->accum + (uint64_t)(to - clk) * c->rate);
}

/* Up to clk, with the starts by timers. */
static void run_timed(struct sim_module *const m, struct channel *const c, const int64_t to)
{
    const struct ssi *const s = m->state;
    int64_t starts[SIM_TRIGGER_STARTS], clk = m->clk;
    const unsigned count = sim_trigger_starts(m->card, &c->trigger, clk, to, starts);
    for (unsigned i = 0; i < count; i++) {
        run_channel(s, c, clk, starts[i]);
        edge(s, c, starts[i], true);
        clk = starts[i] + 1;
    }
    run_channel(s, c, clk, to);
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct ssi *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        run_timed(m, &s->channels[i], clk);
}

/* ---- life ----------------------------------------------------------------------------------------------------------
 */

static int init(struct sim_module *const m)
{
    struct ssi *const s = m->state;
    const uint32_t low_hz = sim_clock_low_hz(m->card);
    if (low_hz == 0)
        return HM2_ERR_RANGE;
    s->count = m->md.instances < CHANNELS_MAX ? m->md.instances : CHANNELS_MAX;
    s->clk_ps = 1000000000000 / low_hz;
    s->filter_clk = sim_sources_are_later(m->card) ? (low_hz + FILTER_HZ / 2) / FILTER_HZ : 0;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct ssi *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct channel *const c = &s->channels[i];
        const struct sim_abs_encoder encoder = c->encoder;
        *c = (struct channel){.line = c->line, .encoder = encoder};
        sim_abs_power_up(&c->encoder, true);
    }
}

static int attach(struct sim_module *const m, const unsigned unit, const struct sim_absolute *const encoder)
{
    struct ssi *const s = m->state;
    if (unit >= s->count)
        return HM2_ERR_NOTFOUND;
    sim_abs_attach(&s->channels[unit].encoder, encoder, true, IDLE_PS, 0);
    s->channels[unit].encoder.spec.bit_ps = 0;
    return 0;
}

/* ---- registers -----------------------------------------------------------------------------------------------------
 */

static uint32_t control(const struct channel *const c)
{
    return (uint32_t)c->rate << 16 | (c->dav ? DAV : 0) | c->trigger.select << 12 | (c->go ? BUSY : 0) |
           (c->trigger.enabled ? TSTART : 0) | (c->pstart ? PSTART : 0) | c->length;
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct ssi *const s = m->state;
    struct channel *const c = &s->channels[low / 4 < s->count ? low / 4 : 0];
    if (page == PAGE_GLOBAL) {
        uint32_t busy = 0;
        for (unsigned i = 0; i < s->count; i++)
            busy |= (uint32_t)(s->channels[i].go || !s->channels[i].dav) << i;
        return busy;
    }
    if (low / 4 >= s->count || page > PAGE_GLOBAL) {
        *undriven = UINT32_MAX;
        return 0;
    }
    if (page == PAGE_CONTROL)
        return control(c);
    c->data_read |= page == PAGE_DATA0;
    return (uint32_t)(page == PAGE_DATA0 ? c->latch : c->latch >> 32);
}

static void write_control(struct channel *const c, const uint32_t value)
{
    c->length = value & BITS_MASK;
    c->pstart = value & PSTART;
    c->trigger = (struct sim_trigger){.enabled = value & TSTART, .select = value >> 12 & 7u};
    c->rate = (uint16_t)(value >> 16);
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct ssi *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct channel *const c = &s->channels[i];
        int64_t timed[SIM_TRIGGER_STARTS];
        const bool start = (page == PAGE_DATA0 && low / 4 == i) || (page == PAGE_GLOBAL && c->pstart) ||
                           sim_trigger_starts(m->card, &c->trigger, m->clk, m->clk + 1, timed) > 0;
        edge(s, c, m->clk, start);
        if (page == PAGE_CONTROL && low / 4 == i)
            write_control(c, value);
    }
    m->clk++;
}

/* ---- pins ----------------------------------------------------------------------------------------------------------
 */

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct ssi *const s = m->state;
    if (unit >= s->count)
        return SIM_LOW;
    const struct channel *const c = &s->channels[unit];
    if (pin == PIN_CLOCK)
        return c->accum & TOP ? SIM_LOW : SIM_HIGH;
    return pin == PIN_DAV && c->dav ? SIM_HIGH : SIM_LOW;
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct ssi *const s = m->state;
    if (pin == PIN_DATA && unit < s->count)
        s->channels[unit].line = level;
}

/* Clocks until the top bit of the accumulator may change. */
static int64_t clocks_to_change(const struct channel *const c)
{
    if (c->data_read)
        return 0;
    if (!c->go)
        return c->accum & TOP || c->last || c->old_last ? 0 : SIM_NEVER;
    if (c->rate == 0)
        return SIM_NEVER;
    return c->rate >= TOP || c->last || c->old_last ? 0 : (TOP - (c->accum & (TOP - 1u)) - 1) / c->rate;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct ssi *const s = m->state;
    int64_t event = SIM_NEVER;
    for (unsigned i = 0; i < s->count; i++) {
        const struct channel *const c = &s->channels[i];
        const int64_t clocks = clocks_to_change(c), timed = sim_trigger_next(m->card, &c->trigger, m->clk);
        if (clocks != SIM_NEVER && m->clk + clocks < event)
            event = m->clk + clocks;
        if (timed < event)
            event = timed;
    }
    return event;
}

const struct sim_module_ops sim_ssi_ops = {
    .gtag = HM2_GTAG_SSI,
    .name = "SSI",
    .pages = PAGES,
    .state_size = sizeof(struct ssi),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .input = input,
    .absolute = attach,
    .next_event = next_event,
};
