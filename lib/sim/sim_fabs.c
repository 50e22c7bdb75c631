/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* FanucAbs, tag 19: readers of Fanuc serial encoders (register map 3.9, traces in folder fabs). */
#include "absolute.h"
#include "sim_card.h"
#include "trigger.h"

#define CHANNELS_MAX   32u
#define TOP            0x80000u /* of the 20 bits that make the bit rate */
#define RATE_MASK      0xFFFFFu
#define WORD_BITS      76u
#define PSTART         0x0100u
#define TSTART         0x0200u
#define RECEIVING      0x0400u
#define BUSY           0x0800u
#define DAV            0x8000u
#define SETUP_2021     0x01000000u
#define SETUP_LATER    0x00000080u
#define CABLE_ERROR    0x80000000u
#define NOMINAL_HZ     1024000
#define REQUEST_PER_S  125000 /* 8 us */
#define NOMINAL_BIT_PS 976562
#define FILTER_MAX     15u
#define REQUEST_MASK   0x3FFu
#define PIN_REQUEST    0x81u
#define PIN_DATA       0x03u
#define PIN_DAV        0x84u
#define PIN_TEST_CLOCK 0x85u

enum { PAGE_DATA0, PAGE_DATA1, PAGE_DATA2, PAGE_CONTROL0, PAGE_CONTROL1, PAGE_GLOBAL, PAGES };

struct word {
    uint64_t low;
    uint16_t high; /* bits 75..64 */
};

struct channel {
    uint32_t rate, accum;
    uint16_t request_clk, request_left;
    uint8_t length, left, filter_clk, filter, pipe;
    bool pstart, setup, busy, receiving, done, old_done, dav, cable_error, old_top, request, data_read;
    bool line, sampled, filtered;
    struct word shift, latch;
    struct sim_trigger trigger;
    struct sim_abs_encoder encoder;
};

struct fabs {
    unsigned count;
    int64_t clk_ps;
    uint32_t setup_bit;
    struct channel channels[CHANNELS_MAX];
};

/* ---- one clock -----------------------------------------------------------------------------------------------------
 */

static void filter_edge(struct channel *const c, const bool line)
{
    const unsigned before = c->filter;
    c->pipe = (uint8_t)((c->pipe * 2u + (c->filtered ? 1u : 0u)) & 3u);
    if (before > c->filter_clk)
        c->filter = c->filter_clk;
    if (!c->sampled && before > 0)
        c->filter = (uint8_t)(before - 1u);
    else if (c->sampled && before != c->filter_clk)
        c->filter = (before + 1u) & FILTER_MAX;
    if (before == 0)
        c->filtered = false;
    if (before == c->filter_clk)
        c->filtered = true;
    c->sampled = line;
}

static void begin(struct channel *const c, const bool line_active)
{
    c->request_left = c->request_clk;
    c->left = c->length;
    c->accum = 0;
    c->shift = (struct word){0};
    c->busy = true;
    c->done = c->receiving = false;
    c->cable_error = line_active;
}

static void receive(struct channel *const c, const struct channel *const old)
{
    c->accum = (old->accum + old->rate) & RATE_MASK;
    if (!(old->accum & TOP) || old->old_top)
        return;
    const uint16_t bit = old->pipe & 2u ? 0 : 1; /* inverted on the line, least significant first */
    c->shift.low = old->shift.low >> 1 | (uint64_t)old->shift.high << 63;
    c->shift.high = (uint16_t)(old->shift.high >> 1 | bit << (WORD_BITS - 65u));
    if (old->left)
        c->left = (uint8_t)(old->left - 1u);
    else
        c->done = true;
}

static void edge(const struct fabs *const s, struct channel *const c, const int64_t clk, const bool start)
{
    const struct channel old = *c;
    const bool line = c->encoder.spec.bits ? sim_abs_line(&c->encoder, clk * s->clk_ps) : c->line;
    if (start)
        begin(c, old.filtered);
    c->request = old.request_left > 0;
    if (c->request && !start)
        c->request_left = (uint16_t)(old.request_left - 1u);
    if (old.busy && !old.done && old.filtered)
        c->receiving = true;
    if (old.receiving)
        receive(c, &old);
    if (old.done && !old.old_done) {
        c->receiving = c->busy = false;
        c->latch = old.shift;
        c->dav = !old.cable_error;
    }
    if (old.data_read)
        c->dav = c->data_read = false;
    c->old_top = old.accum & TOP;
    c->old_done = old.done;
    filter_edge(c, line);
    if (c->request && !old.request)
        sim_abs_fanuc_request(&c->encoder, clk * s->clk_ps);
}

static bool line_settled(const struct channel *const c)
{
    const bool line = c->line && !c->encoder.spec.bits, filtered = line || c->filter_clk == 0;
    return c->sampled == line && c->filter == (line ? c->filter_clk : 0) && c->filtered == filtered &&
           c->pipe == (filtered ? 3u : 0);
}

static bool quiet(const struct channel *const c)
{
    return !c->receiving && !(c->busy && !c->done && c->filtered) && !c->request && c->request_left == 0 &&
           !c->data_read && c->done == c->old_done && c->old_top == ((c->accum & TOP) != 0) &&
           !sim_abs_moving(&c->encoder) && line_settled(c);
}

static void run_channel(const struct fabs *const s, struct channel *const c, int64_t clk, const int64_t to)
{
    for (; clk < to && !quiet(c); clk++)
        edge(s, c, clk, false);
}

static void advance(struct sim_module *const m, const int64_t to)
{
    struct fabs *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct channel *const c = &s->channels[i];
        int64_t starts[SIM_TRIGGER_STARTS], clk = m->clk;
        const unsigned count = sim_trigger_starts(m->card, &c->trigger, clk, to, starts);
        for (unsigned n = 0; n < count; n++) {
            run_channel(s, c, clk, starts[n]);
            edge(s, c, starts[n], true);
            clk = starts[n] + 1;
        }
        run_channel(s, c, clk, to);
    }
}

/* ---- life ----------------------------------------------------------------------------------------------------------
 */

static int init(struct sim_module *const m)
{
    struct fabs *const s = m->state;
    const uint32_t low_hz = sim_clock_low_hz(m->card);
    if (low_hz == 0)
        return HM2_ERR_RANGE;
    s->count = m->md.instances < CHANNELS_MAX ? m->md.instances : CHANNELS_MAX;
    s->clk_ps = 1000000000000 / low_hz;
    s->setup_bit = sim_sources_are_later(m->card) ? SETUP_LATER : SETUP_2021;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct fabs *const s = m->state;
    const uint32_t low_hz = sim_clock_low_hz(m->card);
    for (unsigned i = 0; i < s->count; i++) {
        struct channel *const c = &s->channels[i];
        const struct sim_abs_encoder encoder = c->encoder;
        *c = (struct channel){.line = c->line,
                              .encoder = encoder,
                              .rate = (uint32_t)((((uint64_t)NOMINAL_HZ << 20) + low_hz / 2) / low_hz) & RATE_MASK,
                              .request_clk = (uint16_t)((low_hz / REQUEST_PER_S) & REQUEST_MASK),
                              .length = WORD_BITS,
                              .filter_clk = FILTER_MAX};
        sim_abs_power_up(&c->encoder, false);
    }
}

static int attach(struct sim_module *const m, const unsigned unit, const struct sim_absolute *const encoder)
{
    struct fabs *const s = m->state;
    if (unit >= s->count)
        return HM2_ERR_NOTFOUND;
    sim_abs_attach(&s->channels[unit].encoder, encoder, false, 0, NOMINAL_BIT_PS);
    return 0;
}

/* ---- registers -----------------------------------------------------------------------------------------------------
 */

static uint32_t control0(const struct channel *const c)
{
    return (c->dav ? DAV : 0) | c->trigger.select << 12 | (c->busy ? BUSY : 0) | (c->receiving ? RECEIVING : 0) |
           (c->trigger.enabled ? TSTART : 0) | (c->pstart ? PSTART : 0);
}

static uint32_t channel_register(struct channel *const c, const unsigned page)
{
    switch (page) {
    case PAGE_DATA0:
        c->data_read = true;
        return (uint32_t)c->latch.low;
    case PAGE_DATA1:
        return (uint32_t)(c->latch.low >> 32);
    case PAGE_DATA2:
        return (c->cable_error ? CABLE_ERROR : 0) | (uint32_t)c->length << 24 | (uint32_t)c->request_clk << 14 |
               c->latch.high;
    case PAGE_CONTROL0:
        return control0(c);
    default:
        return (uint32_t)c->filter_clk << 28 | c->rate;
    }
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct fabs *const s = m->state;
    if (page == PAGE_GLOBAL) {
        uint32_t busy = 0;
        for (unsigned i = 0; i < s->count; i++)
            busy |= (uint32_t)(s->channels[i].busy || !s->channels[i].dav) << i;
        return busy;
    }
    if (low / 4 >= s->count || page > PAGE_GLOBAL) {
        *undriven = UINT32_MAX;
        return 0;
    }
    return channel_register(&s->channels[low / 4], page);
}

static void load(const struct fabs *const s, struct channel *const c, const unsigned page, const uint32_t value)
{
    if (page == PAGE_CONTROL0) {
        c->setup = value & s->setup_bit;
        c->pstart = value & PSTART;
        c->trigger = (struct sim_trigger){.enabled = value & TSTART, .select = value >> 12 & 7u};
    } else if (page == PAGE_CONTROL1 && c->setup) {
        c->rate = value & RATE_MASK;
        c->filter_clk = (uint8_t)(value >> 28);
    } else if (page == PAGE_DATA2 && c->setup) {
        c->request_clk = value >> 14 & REQUEST_MASK;
        c->length = value >> 24 & 0x7Fu;
    }
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct fabs *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct channel *const c = &s->channels[i];
        int64_t timed[SIM_TRIGGER_STARTS];
        const bool start = (page == PAGE_DATA0 && low / 4 == i) || (page == PAGE_GLOBAL && c->pstart) ||
                           sim_trigger_starts(m->card, &c->trigger, m->clk, m->clk + 1, timed) > 0;
        edge(s, c, m->clk, start);
        if (low / 4 == i)
            load(s, c, page, value);
    }
    m->clk++;
}

/* ---- pins ----------------------------------------------------------------------------------------------------------
 */

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct fabs *const s = m->state;
    if (unit >= s->count)
        return SIM_LOW;
    const struct channel *const c = &s->channels[unit];
    const bool high = pin == PIN_REQUEST      ? !c->request
                      : pin == PIN_DAV        ? c->dav
                      : pin == PIN_TEST_CLOCK ? (c->accum & TOP) != 0
                                              : false;
    return high ? SIM_HIGH : SIM_LOW;
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct fabs *const s = m->state;
    if (pin == PIN_DATA && unit < s->count)
        s->channels[unit].line = level;
}

/* The outputs of a channel that receives move nearly always; of one that asks, when the request ends. */
static int64_t channel_event(const struct channel *const c, const int64_t clk)
{
    if (c->receiving || c->data_read || c->done != c->old_done || c->request != (c->request_left > 0))
        return clk;
    if (c->request)
        return clk + (c->busy && c->filtered && !c->done ? 0 : 1);
    return quiet(c) ? SIM_NEVER : clk;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct fabs *const s = m->state;
    int64_t event = SIM_NEVER;
    for (unsigned i = 0; i < s->count; i++) {
        const int64_t own = channel_event(&s->channels[i], m->clk);
        const int64_t timed = sim_trigger_next(m->card, &s->channels[i].trigger, m->clk);
        event = own < event ? own : event;
        event = timed < event ? timed : event;
    }
    return event;
}

const struct sim_module_ops sim_fabs_ops = {
    .gtag = HM2_GTAG_FABS,
    .name = "FanucAbs",
    .pages = PAGES,
    .state_size = sizeof(struct fabs),
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
