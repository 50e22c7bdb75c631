/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* BISS, tag 18: readers of BiSS encoders, clocked by ClockHigh (register map 3.9, traces in folder biss). */
#include "absolute.h"
#include "high_clock.h"
#include "sim_card.h"
#include "trigger.h"

#define CHANNELS_MAX 32u
#define TOP          0x8000u
#define LENGTH_MASK  0x3FFu
#define FILTER_MASK  0x3Fu
#define PSTART       0x0100u /* as the later sources load them; those of 2021 have them crossed */
#define TSTART       0x0200u
#define RECEIVING    0x0400u
#define DAV          0x8000u
#define LIFO_WORDS   16u
#define WORD_BITS    32u
#define IDLE_PS      2000000
#define PIN_CLOCK    0x81u
#define PIN_DATA     0x03u
#define PIN_DAV      0x84u
#define CHANGES      4u

enum { PAGE_DATA, PAGE_CONTROL0, PAGE_CONTROL1, PAGE_GLOBAL, PAGES };

/* A request from the bus that two flip-flops bring to ClockHigh. */
struct request {
    bool asked, first, second;
};

struct channel {
    int64_t clk, edges; /* of ClockLow and ClockHigh that have been made */
    uint32_t control0;
    bool pstart, data_read, shown_dav;
    struct sim_trigger trigger;
    struct request start, pop;

    uint16_t send_accum, receive_accum, left;
    uint8_t pointer, level, pop_address, filter, pipe;
    bool sending, receiving, data, dav, old_send_top, old_receive_top, sampled, filtered;
    uint16_t lifo[WORD_BITS]; /* bit n of every word, the newest in bit 0 */

    bool line; /* as pads have it */
    unsigned change_count;
    struct {
        int64_t edge; /* first that sees it */
        bool level;
    } changes[CHANGES];
    struct sim_abs_encoder encoder;
};

struct biss {
    unsigned count;
    int64_t edge_ps;
    bool crossed;
    struct channel channels[CHANNELS_MAX];
};

/* Told of every edge that an output shows after it. */
struct observer {
    void (*edge)(const struct observer *o, const struct channel *before, const struct channel *after, int64_t clk,
                 unsigned ps);
    uint8_t pin;
    void (*report)(void *context, int64_t clk, unsigned ps, enum sim_level level);
    void *context;
};

/* ---- one edge of ClockHigh -----------------------------------------------------------------------------------------
 */

static uint16_t rate_of(const struct channel *const c)
{
    return (uint16_t)(c->control0 >> 16);
}

static uint8_t filter_length(const struct channel *const c)
{
    return c->control0 >> 10 & FILTER_MASK;
}

static bool top(const uint16_t accum)
{
    return accum & TOP;
}

static bool takes(const struct request *const r)
{
    return r->first && r->second;
}

static void request_edge(struct request *const r)
{
    const struct request old = *r;
    r->second = old.first;
    r->first = (old.first || old.asked) && !takes(&old);
    if (r->second)
        r->asked = false;
}

static void filter_edge(struct channel *const c, const bool line)
{
    const unsigned before = c->filter, length = filter_length(c);
    c->pipe = (uint8_t)((c->pipe * 2u + (c->filtered ? 1u : 0u)) & 7u);
    if (!c->sampled && before > 0)
        c->filter = (uint8_t)(before - 1u);
    else if (c->sampled && before != length)
        c->filter = (before + 1u) & FILTER_MASK;
    if (before == 0)
        c->filtered = false;
    if (before == length)
        c->filtered = true;
    c->sampled = line;
}

static void lifo_edge(struct channel *const c, const bool sampling)
{
    const bool push = sampling && c->data && c->pointer == 1, pop = takes(&c->pop);
    if (sampling && c->data)
        c->lifo[c->pointer] = (uint16_t)(c->lifo[c->pointer] * 2u + (c->pipe >> 2 & 1u));
    if (push && !pop && c->level < LIFO_WORDS)
        c->level++;
    if (pop && !push && c->level > 0) {
        c->level--;
        c->pop_address = (c->pop_address + 1u) % LIFO_WORDS;
    }
    if (takes(&c->start))
        c->level = c->pop_address = 0;
}

static void receive_edge(struct channel *const c, const struct channel *const old)
{
    c->send_accum = (uint16_t)(old->send_accum + rate_of(old));
    if (!old->receiving)
        return;
    c->receive_accum = (uint16_t)(old->receive_accum + rate_of(old));
    if (!top(old->receive_accum) || old->old_receive_top)
        return;
    c->data = true; /* data begin one bit after the start bit */
    if (old->left == 0) {
        c->receiving = false;
        c->dav = true;
    } else if (old->data) {
        c->left = (old->left - 1u) & LENGTH_MASK;
        c->pointer = (old->pointer - 1u) % WORD_BITS;
    }
}

static bool line_of(const struct biss *const s, struct channel *const c)
{
    while (c->change_count > 0 && c->changes[0].edge <= c->edges) {
        c->line = c->changes[0].level;
        c->change_count--;
        for (unsigned i = 0; i < c->change_count; i++)
            c->changes[i] = c->changes[i + 1];
    }
    return c->encoder.spec.bits ? sim_abs_line(&c->encoder, c->edges * s->edge_ps) : c->line;
}

static void high_edge(const struct biss *const s, struct channel *const c)
{
    const bool line = line_of(s, c);
    const struct channel old = *c;
    lifo_edge(c, top(old.receive_accum) && !old.old_receive_top);
    filter_edge(c, line);
    if (old.sending)
        receive_edge(c, &old);
    else
        c->send_accum = c->receive_accum = 0;
    if (!old.receiving && !old.data && (old.pipe & 3u) == 1)
        c->receiving = true;
    if (!old.receiving && old.left == 0 && old.old_send_top && !top(old.send_accum))
        c->data = c->sending = false;
    c->old_send_top = top(old.send_accum);
    c->old_receive_top = top(old.receive_accum);
    if (old.pop.asked)
        c->dav = false;
    if (takes(&old.start)) {
        c->left = old.control0 & LENGTH_MASK;
        c->pointer = old.control0 % WORD_BITS;
        c->sending = true;
        c->receiving = c->data = false;
    }
    request_edge(&c->start);
    request_edge(&c->pop);
    if (top(c->send_accum) != top(old.send_accum))
        sim_abs_biss_clock(&c->encoder, top(old.send_accum), c->edges * s->edge_ps);
    c->edges++;
}

/* ---- both clocks ---------------------------------------------------------------------------------------------------
 */

static void ask(struct request *const r)
{
    r->asked = !r->second; /* held down as long as the second flip-flop is up */
}

static void low_edge(struct channel *const c, const bool start)
{
    c->shown_dav = c->dav;
    if (start)
        ask(&c->start);
    if (c->data_read)
        ask(&c->pop);
    c->data_read = false;
    c->clk++;
}

static bool idle(const struct request *const r)
{
    return !r->asked && !r->first && !r->second;
}

static bool line_settled(const struct channel *const c)
{
    const bool line = c->encoder.spec.bits ? c->encoder.level : c->line;
    const unsigned length = filter_length(c);
    const bool filtered = line || length == 0;
    return c->sampled == line && c->filter == (line ? length : 0) && c->filtered == filtered &&
           c->pipe == (filtered ? 7u : 0);
}

/* Only the clock runs, if that: an encoder that does not answer is clocked for ever. */
static bool quiet(const struct channel *const c)
{
    const bool waiting = c->sending && !c->receiving && c->left > 0 && c->encoder.spec.bits == 0;
    const bool resting =
        !c->sending && c->send_accum == 0 && c->receive_accum == 0 && !c->old_send_top && !c->old_receive_top;
    return (waiting || resting) && idle(&c->start) && idle(&c->pop) && !c->data_read && c->shown_dav == c->dav &&
           c->change_count == 0 && c->old_receive_top == top(c->receive_accum) && !sim_abs_moving(&c->encoder) &&
           line_settled(c);
}

static void skip(const struct sim_module *const m, struct channel *const c, const int64_t clk)
{
    const int64_t edges = sim_high_edges(m->card, clk, false), n = edges - c->edges;
    if (c->sending && n > 0) {
        c->old_send_top = top((uint16_t)(c->send_accum + (uint64_t)(n - 1) * rate_of(c)));
        c->send_accum = (uint16_t)(c->send_accum + (uint64_t)n * rate_of(c));
    }
    c->edges = edges > c->edges ? edges : c->edges;
    c->clk = clk;
}

static void run_high(const struct sim_module *const m, struct channel *const c, const struct observer *const o)
{
    for (const int64_t end = sim_high_edges(m->card, c->clk, false); c->edges < end;) {
        if (!o) {
            high_edge(m->state, c);
            continue;
        }
        const struct channel before = *c;
        unsigned ps = 0;
        const int64_t clk = sim_low_edge(m->card, c->edges, &ps);
        high_edge(m->state, c);
        o->edge(o, &before, c, clk, ps);
    }
}

static void run(const struct sim_module *const m, struct channel *const c, const int64_t to,
                const struct observer *const o)
{
    int64_t starts[SIM_TRIGGER_STARTS];
    const unsigned count = sim_trigger_starts(m->card, &c->trigger, c->clk, to, starts);
    for (unsigned next = 0;;) {
        run_high(m, c, o);
        if (c->clk >= to)
            return;
        const bool start = next < count && starts[next] == c->clk;
        if (!o && !start && quiet(c)) {
            skip(m, c, next < count ? starts[next] : to);
            continue;
        }
        next += start;
        const struct channel before = *c;
        low_edge(c, start);
        if (o)
            o->edge(o, &before, c, c->clk - 1, 0);
    }
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct biss *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        run(m, &s->channels[i], clk, NULL);
}

/* ---- life ----------------------------------------------------------------------------------------------------------
 */

static int init(struct sim_module *const m)
{
    struct biss *const s = m->state;
    const uint32_t high_hz = sim_clock_high_hz(m->card);
    if (high_hz == 0 || sim_clock_low_hz(m->card) == 0)
        return HM2_ERR_RANGE;
    s->count = m->md.instances < CHANNELS_MAX ? m->md.instances : CHANNELS_MAX;
    s->edge_ps = 1000000000000 / high_hz;
    s->crossed = !sim_sources_are_later(m->card);
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct biss *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct channel *const c = &s->channels[i];
        const struct sim_abs_encoder encoder = c->encoder;
        *c = (struct channel){.clk = m->clk,
                              .edges = sim_high_edges(m->card, m->clk, false),
                              .pop_address = LIFO_WORDS - 1u,
                              .line = c->line,
                              .encoder = encoder};
        sim_abs_power_up(&c->encoder, true);
    }
}

static int attach(struct sim_module *const m, const unsigned unit, const struct sim_absolute *const encoder)
{
    struct biss *const s = m->state;
    if (unit >= s->count)
        return HM2_ERR_NOTFOUND;
    sim_abs_attach(&s->channels[unit].encoder, encoder, true, IDLE_PS, 0);
    s->channels[unit].encoder.spec.bit_ps = 0;
    return 0;
}

/* ---- registers -----------------------------------------------------------------------------------------------------
 */

static uint32_t lifo_word(const struct channel *const c)
{
    uint32_t word = 0;
    for (unsigned bit = 0; bit < WORD_BITS; bit++)
        word |= (uint32_t)(c->lifo[bit] >> c->pop_address & 1u) << bit;
    return word;
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct biss *const s = m->state;
    if (page == PAGE_GLOBAL) {
        uint32_t busy = 0;
        for (unsigned i = 0; i < s->count; i++)
            busy |= (uint32_t)(s->channels[i].sending || !s->channels[i].shown_dav) << i;
        return busy;
    }
    if (low / 4 >= s->count || page > PAGE_GLOBAL) {
        *undriven = UINT32_MAX;
        return 0;
    }
    struct channel *const c = &s->channels[low / 4];
    if (page == PAGE_CONTROL0)
        return c->control0;
    if (page == PAGE_CONTROL1)
        return (c->shown_dav ? DAV : 0) | c->trigger.select << 12 | (c->receiving ? RECEIVING : 0) |
               (c->trigger.enabled ? TSTART : 0) | (c->pstart ? PSTART : 0) | c->level;
    c->data_read = true;
    return lifo_word(c);
}

static void load(const struct biss *const s, struct channel *const c, const unsigned page, const uint32_t value)
{
    if (page == PAGE_CONTROL0)
        c->control0 = value;
    if (page != PAGE_CONTROL1)
        return;
    c->pstart = value & (s->crossed ? TSTART : PSTART);
    c->trigger = (struct sim_trigger){.enabled = value & (s->crossed ? PSTART : TSTART), .select = value >> 12 & 7u};
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct biss *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct channel *const c = &s->channels[i];
        int64_t timed[SIM_TRIGGER_STARTS];
        const bool start = (page == PAGE_DATA && low / 4 == i) || (page == PAGE_GLOBAL && c->pstart) ||
                           sim_trigger_starts(m->card, &c->trigger, m->clk, m->clk + 1, timed) > 0;
        low_edge(c, start);
        if (low / 4 == i)
            load(s, c, page, value);
    }
}

/* ---- pins ----------------------------------------------------------------------------------------------------------
 */

static enum sim_level channel_output(const struct channel *const c, const uint8_t pin)
{
    const bool high = pin == PIN_CLOCK ? !top(c->send_accum) : pin == PIN_DAV && c->shown_dav;
    return high ? SIM_HIGH : SIM_LOW;
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct biss *const s = m->state;
    return unit < s->count ? channel_output(&s->channels[unit], pin) : SIM_LOW;
}

static void report_change(const struct observer *const o, const struct channel *const before,
                          const struct channel *const after, const int64_t clk, const unsigned ps)
{
    const enum sim_level level = channel_output(after, o->pin);
    if (level != channel_output(before, o->pin))
        o->report(o->context, clk, ps, level);
}

static void trace(struct sim_module *const m, const unsigned unit, const uint8_t pin, const int64_t from,
                  const int64_t to, void (*const report)(void *context, int64_t clk, unsigned ps, enum sim_level level),
                  void *const context)
{
    const struct biss *const s = m->state;
    (void)from;
    if (unit >= s->count)
        return;
    const struct observer observer = {.edge = report_change, .pin = pin, .report = report, .context = context};
    struct channel copy = s->channels[unit];
    run(m, &copy, to, &observer);
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct biss *const s = m->state;
    if (pin == PIN_DATA && unit < s->count)
        s->channels[unit].line = level;
}

static void input_at(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level,
                     const int64_t clk, const unsigned ps)
{
    struct biss *const s = m->state;
    if (pin != PIN_DATA || unit >= s->count)
        return;
    struct channel *const c = &s->channels[unit];
    if (c->change_count == CHANGES)
        return;
    c->changes[c->change_count].edge = sim_high_edges_after(m->card, clk, ps);
    c->changes[c->change_count++].level = level;
}

const struct sim_module_ops sim_biss_ops = {
    .gtag = HM2_GTAG_BISS,
    .name = "BISS",
    .pages = PAGES,
    .state_size = sizeof(struct biss),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .trace = trace,
    .input = input,
    .input_at = input_at,
    .absolute = attach,
};
