/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Packet UART, receiver (tag 1C): a frame ends with a gap (register map 3.13, Annex D). */
#include "sim_pktuart.h"

#define MODE_FALSE_START  (1u << 0)
#define MODE_OVERRUN      (1u << 1)
#define MODE_MASK         (1u << 2)
#define MODE_ENABLE       (1u << 3)
#define MODE_ERROR        (1u << 4)
#define MODE_PARITY       (1u << 5)
#define MODE_DRIVEN       (1u << 6)
#define MODE_ACTIVE       (1u << 7)
#define MODE_GAP(m)       ((m) >> 8 & 0xFFu)
#define MODE_READS        0xFF0Fu
#define FRAMES_SHIFT      16
#define MODE_DATA         (1u << 21)
#define FILTER_SHIFT      22
#define MODE_BAD_POP      (1u << 30)
#define ERRORS_SHIFT      14
#define ERROR_FALSE       1u
#define ERROR_STOP        2u
#define ERROR_PARITY      4u
#define DEFAULT_FILTER_HZ 5000000u
#define PIN_RX            0x01u

struct rx {
    struct srl_fifo counts; /* with the errors of their frames */
    struct baud baud;
    uint32_t mode, sreg, latch, count, errors;
    uint32_t filter, filter_count;
    uint8_t in, out;
    uint8_t left, byte, gap, pipe;
    bool go, gap_go, push_data, push_count, clear_errors, masked, error, bad_pop;
    bool line, filtered; /* of the input filter */
};

struct rx_port {
    const struct pkt_traits *traits;
    struct rx rx;
    bool input, rests;
    struct serial_feed feed;
    uint32_t buffer[PKT_BUFFER_WORDS];
};

struct receivers {
    unsigned count;
    struct rx_port port[PKT_INSTANCES_MAX];
};

static bool line(const struct rx_port *const p)
{
    return p->feed.attached ? serial_feed_level(&p->feed) : p->input;
}

static bool parity_used(const struct rx_port *const p)
{
    return p->traits->parity && p->rx.mode & PKT_PARITY;
}

/* The input, its filter and the pipe behind it show the same level, and stay so. */
static bool is_still(const struct rx_port *const p)
{
    const struct rx *const r = &p->rx;
    const bool level = line(p);
    if (r->pipe != (level ? 3u : 0u))
        return false;
    return !p->traits->filter ||
           (r->line == level && r->filtered == level && r->filter_count == (level ? r->filter : 0));
}

static int64_t quiet(const void *const instance)
{
    const struct rx_port *const p = instance;
    const struct rx *const r = &p->rx;
    const int64_t same = serial_feed_quiet(&p->feed);
    int64_t edges = 0;
    if (p->rests)
        edges = SIM_NEVER;
    else if ((r->go || (r->gap_go && line(p))) && !r->push_data && !r->push_count && !r->clear_errors && is_still(p))
        edges = baud_quiet(&r->baud, true);
    return same < edges ? same : edges;
}

static void skip(void *const instance, const int64_t edges)
{
    struct rx_port *const p = instance;
    if (!p->rests)
        baud_skip(&p->rx.baud, true, edges);
    if (p->feed.sending)
        serial_feed_step(&p->feed, &p->rx.baud, edges);
}

static void take_byte(struct rx_port *const p, const struct rx *const before, const bool stop)
{
    struct rx *const r = &p->rx;
    const unsigned shift = 8u * before->byte;
    r->go = false;
    r->count = before->gap_go ? (before->count + 1u) & PKT_COUNT_MASK : 1u;
    r->gap_go = true;
    r->gap = MODE_GAP(before->mode);
    if (!stop) {
        r->mode |= MODE_OVERRUN;
        r->errors |= ERROR_STOP;
    }
    if (parity_used(p)) {
        if (pkt_odd(before->sreg >> 2) != ((before->mode & PKT_ODD) != 0))
            r->errors |= ERROR_PARITY;
        if (before->errors & ERROR_PARITY) /* of a byte before this one */
            r->mode |= MODE_PARITY;
    }
    r->latch = (before->latch & ~(0xFFu << shift)) | (before->sreg >> 2 & 0xFFu) << shift;
    r->push_data = before->byte == 3u;
    r->byte = (before->byte + 1u) & 3u;
}

static void sample(struct rx_port *const p, const struct rx *const before)
{
    struct rx *const r = &p->rx;
    const uint32_t bit = before->pipe >> 1 & 1u;
    const bool parity = parity_used(p);
    if (before->left == 0)
        take_byte(p, before, bit);
    if (before->left == (parity ? 10u : 9u) && bit) {
        r->go = false;
        r->mode |= MODE_FALSE_START;
        r->errors |= ERROR_FALSE;
    }
    r->sreg = before->sreg >> 1 | bit << (parity ? 10 : 9);
    r->left = (uint8_t)(before->left - 1u) & 0xFu;
}

static void end_frame(struct rx *const r, const struct rx *const before)
{
    r->gap = (uint8_t)(before->gap - 1u);
    if (before->gap != 1u)
        return;
    r->gap_go = false;
    r->push_count = r->clear_errors = true;
    if (before->byte != 0) {
        r->push_data = true;
        r->byte = 0;
    }
}

/* The level that the receiver sees, before this edge: through a counter of so many clocks, or at once. */
static bool filter(struct rx_port *const p, const struct rx *const before, const bool level)
{
    struct rx *const r = &p->rx;
    if (!p->traits->filter)
        return level;
    r->line = level;
    if (before->line && before->filter_count < before->filter)
        r->filter_count++;
    if (!before->line && before->filter_count != 0)
        r->filter_count--;
    if (before->filter_count >= before->filter)
        r->filtered = true;
    if (before->filter_count == 0)
        r->filtered = false;
    return before->filtered;
}

static void store(struct rx_port *const p, const struct rx *const before)
{
    struct rx *const r = &p->rx;
    if (before->push_data)
        p->buffer[r->in++] = before->latch;
    if (before->push_count && !srl_push(&r->counts, before->count | (uint64_t)before->errors << ERRORS_SHIFT))
        r->error = true;
}

static void edge(void *const instance)
{
    struct rx_port *const p = instance;
    struct rx *const r = &p->rx;
    const struct rx before = *r;
    const bool level = line(p);
    const bool seen = filter(p, &before, level);
    r->pipe = (uint8_t)(((unsigned)before.pipe << 1 | seen) & 3u);
    r->push_data = r->push_count = r->clear_errors = false;
    r->baud.before = baud_high(&before.baud);
    if (before.go || before.gap_go)
        baud_step(&r->baud, true);
    if (before.go && baud_rises(&before.baud))
        sample(p, &before);
    if (before.gap_go && baud_falls(&before.baud))
        end_frame(r, &before);
    if (before.clear_errors)
        r->errors = 0;
    if (!before.go) {
        r->left = parity_used(p) ? 10 : 9;
        if (!seen && !(before.masked && before.mode & MODE_MASK) && before.mode & MODE_ENABLE) {
            r->go = true;
            r->baud.accum = 0;
        }
    }
    store(p, &before);
    serial_feed_step(&p->feed, &r->baud, 1);
    p->rests = memcmp(&before, r, sizeof before) == 0 && line(p) == level;
}

static const struct sim_stepper stepper = {quiet, skip, edge};

void pkt_rx_step(struct sim_module *const m, const int64_t clk)
{
    struct receivers *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        sim_step_to(&stepper, &s->port[i], m->clk, clk);
}

void pkt_rx_mask(struct sim_module *const m, const unsigned unit, const bool masked)
{
    struct receivers *const s = m->state;
    if (s->port[unit].rx.masked == masked)
        return;
    s->port[unit].rx.masked = masked;
    s->port[unit].rests = false;
}

/* ---- the module ----------------------------------------------------------------------------------------------------
 */

static int init(struct sim_module *const m)
{
    struct receivers *const s = m->state;
    s->count = pkt_instances(m);
    for (unsigned i = 0; i < s->count; i++)
        s->port[i].traits = pkt_traits(m);
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct receivers *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct rx_port *const p = &s->port[i];
        memset(&p->rx, 0, sizeof p->rx);
        srl_clear(&p->rx.counts);
        p->rx.filter = (sim_clock_low_hz(m->card) + DEFAULT_FILTER_HZ / 2) / DEFAULT_FILTER_HZ;
        p->rx.baud.top = 1u << (p->traits->rate_bits - 1u);
        p->rests = false;
        memset(p->buffer, 0, sizeof p->buffer);
    }
}

static uint32_t mode_of(const struct rx_port *const p)
{
    const struct rx *const r = &p->rx;
    uint32_t mode = r->mode & MODE_READS;
    if (r->error)
        mode |= MODE_ERROR;
    if (p->traits->parity)
        mode |= r->mode & MODE_PARITY;
    if (r->masked)
        mode |= MODE_DRIVEN;
    if (r->go || r->gap_go || r->counts.count > 0)
        mode |= MODE_ACTIVE;
    if (r->in != r->out)
        mode |= MODE_DATA;
    if (p->traits->filter)
        mode |= (r->filter & 0xFFu) << FILTER_SHIFT;
    if (r->bad_pop)
        mode |= MODE_BAD_POP;
    return mode | (uint32_t)r->counts.count << FRAMES_SHIFT;
}

static uint32_t pop_data(struct rx_port *const p)
{
    struct rx *const r = &p->rx;
    const uint32_t word = p->buffer[r->out];
    if (p->traits->guards_pops && r->in == r->out)
        r->bad_pop = true;
    else
        r->out++;
    return word;
}

static uint32_t pop_count(struct rx *const r)
{
    const uint32_t count = (uint32_t)srl_oldest(&r->counts);
    if (!srl_drop(&r->counts, 1))
        r->error = true;
    return count;
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct receivers *const s = m->state;
    const unsigned i = low / 4u;
    *undriven = UINT32_MAX;
    if (i >= s->count)
        return 0;
    struct rx_port *const p = &s->port[i];
    *undriven = 0;
    switch (page) {
    case PKT_PAGE_DATA:
        p->rests = false;
        return pop_data(p);
    case PKT_PAGE_COUNT:
        p->rests = false;
        return pop_count(&p->rx);
    case PKT_PAGE_RATE:
        *undriven = p->traits->wide_filter ? 0 : ~(2u * p->rx.baud.top - 1u);
        return p->rx.baud.rate | (p->traits->wide_filter ? p->rx.filter >> 8 << 24 : 0);
    default:
        *undriven = p->traits->parity ? 0 : MODE_PARITY;
        return mode_of(p);
    }
}

static void clear(struct rx *const r)
{
    srl_clear(&r->counts);
    r->in = r->out = 0;
    r->go = r->gap_go = r->error = r->bad_pop = false;
    r->gap = 1;
    r->byte = 0;
}

static void write_mode(struct rx_port *const p, const uint32_t value)
{
    struct rx *const r = &p->rx;
    if (!(value & PKT_NO_LOAD)) {
        r->mode = value & PKT_MODE_BITS & ~PKT_CLEAR;
        if (p->traits->filter)
            r->filter = (r->filter & 0xFF00u) | (value >> FILTER_SHIFT & 0xFFu);
    }
    if (value & PKT_CLEAR)
        clear(r);
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct receivers *const s = m->state;
    const unsigned i = low / 4u;
    pkt_advance(m, m->clk + 1); /* the edge of the write is made with what was there before */
    if (i >= s->count)
        return;
    struct rx_port *const p = &s->port[i];
    p->rests = false;
    if (page == PKT_PAGE_RATE) {
        p->rx.baud.rate = value & (2u * p->rx.baud.top - 1u);
        if (p->traits->wide_filter)
            p->rx.filter = (p->rx.filter & 0xFFu) | value >> 24 << 8;
    } else if (page == PKT_PAGE_MODE) {
        write_mode(p, value);
    }
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct receivers *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        if (pin != PIN_RX || (i != unit && unit != HM2_UNIT_GLOBAL))
            continue;
        s->port[i].input = level;
        s->port[i].rests = false;
    }
}

static struct serial_feed *feed_of(struct sim_module *const m, const unsigned unit)
{
    struct receivers *const s = m->state;
    if (unit >= s->count)
        return NULL;
    struct rx_port *const p = &s->port[unit];
    p->rests = false;
    p->feed.parity = !parity_used(p) ? 0 : p->rx.mode & PKT_ODD ? 2 : 1;
    return &p->feed;
}

const struct sim_module_ops sim_pktuart_rx_ops = {
    .gtag = HM2_GTAG_PKTUART_RX,
    .name = "PktUART receiver",
    .pages = PKT_PAGES,
    .state_size = sizeof(struct receivers),
    .init = init,
    .power_up = power_up,
    .advance = pkt_advance,
    .read = read,
    .write = write,
    .input = input,
    .serial_feed = feed_of,
};
