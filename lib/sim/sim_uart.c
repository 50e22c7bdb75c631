/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * UART: transmitter (tag 09) and receiver (0A), eight data bits, no parity, one stop bit, with FIFOs of sixteen words
 * and sixteen bytes (register map 3.12; traces tests/data/uart).
 */
#include "serial_line.h"
#include "srl_fifo.h"

#define INSTANCES_MAX 16u
#define RATE_BITS     20u
#define RATE_MASK     ((1u << RATE_BITS) - 1u)
#define COUNT_MASK    0x1Fu
#define MODE_MASK     0xFFu
#define SIZE_SHIFT    32 /* of a word's number of bytes, minus one, in the FIFO */
#define FRAME_BITS    10u
#define SREG_BITS     11u

enum { PAGE_DATA, PAGE_COUNT, PAGE_RATE, PAGE_MODE, PAGES };

/* ---- transmitter --------------------------------------------------------------------------------------------------
 */

#define TX_DELAY  0xFu
#define TX_ERROR  (1u << 4)
#define TX_AUTO   (1u << 5)
#define TX_DRIVE  (1u << 6)
#define TX_BUSY   (1u << 7)
#define PIN_TX    0x81u
#define PIN_TXEN  0x82u /* low while driving */
#define PIN_NTXEN 0x83u

struct tx {
    struct srl_fifo fifo;
    struct baud baud;
    uint32_t mode, sreg;
    uint8_t left, byte, delay, sending;
    bool go, pop, error;
};

struct tx_port {
    struct tx tx;
    bool rests; /* the last edge changed nothing */
    struct serial_tap tap;
};

struct transmitters {
    unsigned count;
    struct tx_port port[INSTANCES_MAX];
};

static bool drives(const struct tx *const t)
{
    return t->mode & TX_AUTO ? t->go || t->pop || t->fifo.count > 0 : (t->mode & TX_DRIVE) != 0;
}

static int64_t tx_quiet(const void *const instance)
{
    const struct tx_port *const p = instance;
    if (p->rests)
        return SIM_NEVER;
    return p->tx.go && p->tx.delay == 0 && !p->tx.pop ? baud_quiet(&p->tx.baud, false) : 0;
}

static void tx_skip(void *const instance, const int64_t edges)
{
    struct tx_port *const p = instance;
    if (!p->rests)
        baud_skip(&p->tx.baud, false, edges);
}

/* The next byte of the word, or the end of the word. */
static void tx_load(struct tx *const t)
{
    const uint64_t word = srl_oldest(&t->fifo);
    t->left = FRAME_BITS;
    t->sreg = (t->sreg & 0x3FCu) | 1u | 1u << FRAME_BITS;
    if (t->byte <= word >> SIZE_SHIFT) {
        t->sending = (uint8_t)(word >> 8u * t->byte);
        t->sreg = (uint32_t)t->sending << 2 | 1u | 1u << FRAME_BITS;
        t->go = true;
        t->byte++;
    } else {
        t->pop = true;
        t->byte = 0;
    }
}

static void tx_edge(void *const instance)
{
    struct tx_port *const p = instance;
    struct tx *const t = &p->tx;
    const struct tx before = *t;
    const bool enabled = drives(&before);
    t->baud.before = baud_high(&before.baud);
    if (before.pop) {
        t->pop = false;
        (void)srl_drop(&t->fifo, 1);
    }
    if (before.go) {
        baud_step(&t->baud, false);
        if (baud_rises(&before.baud)) {
            t->sreg = before.sreg >> 1 | 1u << (SREG_BITS - 1u);
            t->left = (uint8_t)(before.left - 1u) & 0xFu;
            t->go = before.left != 0;
            if (!t->go && p->tap.sent)
                p->tap.sent(p->tap.context, before.sending);
        }
    } else {
        t->baud.accum = 0;
        if (before.fifo.count > 0 && !before.pop && enabled && before.delay == 0) {
            tx_load(t);
        } else {
            t->left = FRAME_BITS;
            t->sreg = (before.sreg & 0x3FCu) | 1u | 1u << FRAME_BITS;
        }
    }
    if (!enabled)
        t->delay = before.mode & TX_DELAY;
    else if (before.delay > 0)
        t->delay--;
    p->rests = memcmp(&before, t, sizeof before) == 0;
}

static const struct sim_stepper tx_stepper = {tx_quiet, tx_skip, tx_edge};

static void tx_step(struct sim_module *const m, const int64_t clk)
{
    struct transmitters *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        sim_step_to(&tx_stepper, &s->port[i], m->clk, clk);
}

static int64_t tx_event(struct sim_module *const m)
{
    const struct transmitters *const s = m->state;
    int64_t first = SIM_NEVER;
    for (unsigned i = 0; i < s->count; i++) {
        const int64_t edges = tx_quiet(&s->port[i]);
        if (edges != SIM_NEVER && m->clk + edges < first)
            first = m->clk + edges;
    }
    return first;
}

/* ---- receiver ------------------------------------------------------------------------------------------------------
 */

#define RX_FALSE_START (1u << 0)
#define RX_OVERRUN     (1u << 1)
#define RX_MASK        (1u << 2)
#define RX_SETTINGS    0xFu
#define RX_EMPTY       (1u << 4)
#define RX_LOST        (1u << 5)
#define RX_DRIVEN      (1u << 6)
#define RX_DATA        (1u << 7)
#define PIN_RX         0x01u

struct rx {
    struct srl_fifo fifo;
    struct baud baud;
    uint32_t mode, sreg;
    uint8_t left, pipe;
    bool go, available, masked;
};

struct rx_port {
    struct rx rx;
    bool input, rests;
    struct serial_feed feed;
};

struct receivers {
    unsigned count;
    struct rx_port port[INSTANCES_MAX];
};

static bool line(const struct rx_port *const p)
{
    return p->feed.attached ? serial_feed_level(&p->feed) : p->input;
}

static int64_t rx_quiet(const void *const instance)
{
    const struct rx_port *const p = instance;
    const int64_t same = serial_feed_quiet(&p->feed);
    int64_t edges = 0;
    if (p->rests)
        edges = SIM_NEVER;
    else if (p->rx.go && !p->rx.available && p->rx.pipe == (line(p) ? 3u : 0u))
        edges = baud_quiet(&p->rx.baud, true);
    return same < edges ? same : edges;
}

static void rx_skip(void *const instance, const int64_t edges)
{
    struct rx_port *const p = instance;
    if (!p->rests)
        baud_skip(&p->rx.baud, true, edges);
    if (p->feed.sending)
        serial_feed_step(&p->feed, &p->rx.baud, edges);
}

static void rx_sample(struct rx *const r, const struct rx *const before)
{
    const uint32_t bit = before->pipe >> 1 & 1u;
    if (before->left == 0) {
        r->go = false;
        r->available = true;
        if (!bit)
            r->mode |= RX_OVERRUN;
    }
    if (before->left == 9 && bit) {
        r->go = false;
        r->mode |= RX_FALSE_START;
    }
    r->sreg = before->sreg >> 1 | bit << 9;
    r->left = (uint8_t)(before->left - 1u) & 0xFu;
}

static void rx_edge(void *const instance)
{
    struct rx_port *const p = instance;
    struct rx *const r = &p->rx;
    const struct rx before = *r;
    const bool level = line(p);
    r->pipe = (uint8_t)(((unsigned)before.pipe << 1 | level) & 3u);
    r->baud.before = baud_high(&before.baud);
    r->available = false;
    if (before.go) {
        baud_step(&r->baud, true);
        if (baud_rises(&before.baud))
            rx_sample(r, &before);
    } else {
        r->baud.accum = 0;
        r->left = 9;
        r->go = !level && !(before.masked && before.mode & RX_MASK);
    }
    if (before.available && !srl_push(&r->fifo, before.sreg >> 1 & 0xFFu))
        r->mode |= RX_LOST;
    serial_feed_step(&p->feed, &r->baud, 1);
    p->rests = memcmp(&before, r, sizeof before) == 0 && line(p) == level;
}

static const struct sim_stepper rx_stepper = {rx_quiet, rx_skip, rx_edge};

static void rx_step(struct sim_module *const m, const int64_t clk)
{
    struct receivers *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        sim_step_to(&rx_stepper, &s->port[i], m->clk, clk);
}

static void couple(const struct sim_module *const tx, struct sim_module *const rx)
{
    const struct transmitters *const from = tx->state;
    struct receivers *const to = rx->state;
    for (unsigned i = 0; i < to->count && i < from->count; i++) {
        const bool masked = drives(&from->port[i].tx);
        if (to->port[i].rx.masked != masked)
            to->port[i].rests = false;
        to->port[i].rx.masked = masked;
    }
}

static const struct serial_pair pair = {HM2_GTAG_UART_TX, HM2_GTAG_UART_RX, tx_step, tx_event, rx_step, couple};

static void advance(struct sim_module *const m, const int64_t clk)
{
    serial_pair_advance(&pair, m, clk);
}

/* ---- the modules ---------------------------------------------------------------------------------------------------
 */

static unsigned instances(const struct sim_module *const m)
{
    return m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
}

static int tx_init(struct sim_module *const m)
{
    struct transmitters *const s = m->state;
    s->count = instances(m);
    return 0;
}

static void tx_power_up(struct sim_module *const m)
{
    struct transmitters *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct tx_port *const p = &s->port[i];
        memset(&p->tx, 0, sizeof p->tx);
        p->tx.sreg = 1;
        p->tx.baud.top = 1u << (RATE_BITS - 1u);
        p->rests = false;
        srl_clear(&p->tx.fifo);
    }
}

static uint32_t tx_read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct transmitters *const s = m->state;
    const unsigned i = low / 16u;
    *undriven = UINT32_MAX;
    if (i >= s->count)
        return 0;
    const struct tx *const t = &s->port[i].tx;
    switch (page) {
    case PAGE_COUNT:
        *undriven = 0;
        return t->fifo.count;
    case PAGE_RATE:
        *undriven = ~RATE_MASK;
        return t->baud.rate;
    case PAGE_MODE:
        *undriven = ~MODE_MASK;
        return t->mode | (t->error ? TX_ERROR : 0) | (t->go || t->pop || t->fifo.count > 0 ? TX_BUSY : 0);
    default:
        return 0;
    }
}

static void tx_write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct transmitters *const s = m->state;
    const unsigned i = low / 16u;
    advance(m, m->clk + 1); /* the edge of the write is made with what was there before */
    if (i >= s->count)
        return;
    struct tx *const t = &s->port[i].tx;
    s->port[i].rests = false;
    if (page == PAGE_DATA) {
        if (!srl_push(&t->fifo, (uint64_t)(low / 4u % 4u) << SIZE_SHIFT | value))
            t->error = true;
    } else if (page == PAGE_COUNT) {
        srl_clear(&t->fifo);
        t->error = false;
    } else if (page == PAGE_RATE) {
        t->baud.rate = value & RATE_MASK;
    } else {
        t->mode = value & (TX_DELAY | TX_AUTO | TX_DRIVE);
    }
}

static enum sim_level tx_output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct transmitters *const s = m->state;
    if (unit >= s->count)
        return SIM_LOW;
    const struct tx *const t = &s->port[unit].tx;
    const bool level = pin == PIN_TX     ? (t->sreg & 1u) != 0
                       : pin == PIN_TXEN ? !drives(t)
                                         : pin == PIN_NTXEN && drives(t);
    return level ? SIM_HIGH : SIM_LOW;
}

static int rx_init(struct sim_module *const m)
{
    struct receivers *const s = m->state;
    s->count = instances(m);
    return 0;
}

static void rx_power_up(struct sim_module *const m)
{
    struct receivers *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct rx_port *const p = &s->port[i];
        memset(&p->rx, 0, sizeof p->rx);
        p->rx.pipe = 3;
        p->input = true;
        p->rx.baud.top = 1u << (RATE_BITS - 1u);
        p->rests = false;
        srl_clear(&p->rx.fifo);
    }
}

/* Four bytes from the oldest on, whether there or not; the address says how many are taken. */
static uint32_t rx_pop(struct rx *const r, const unsigned bytes)
{
    uint32_t word = 0;
    for (unsigned i = 0; i < 4; i++)
        word |= (uint32_t)(r->fifo.word[(r->fifo.at + SRL_WORDS - i) % SRL_WORDS] & 0xFFu) << 8u * i;
    if (!srl_drop(&r->fifo, bytes))
        r->mode |= RX_EMPTY;
    return word;
}

static uint32_t rx_read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct receivers *const s = m->state;
    const unsigned i = low / 16u;
    *undriven = UINT32_MAX;
    if (i >= s->count)
        return 0;
    struct rx *const r = &s->port[i].rx;
    switch (page) {
    case PAGE_DATA:
        *undriven = 0;
        s->port[i].rests = false;
        return rx_pop(r, low / 4u % 4u + 1u);
    case PAGE_COUNT:
        *undriven = ~COUNT_MASK;
        return r->fifo.count;
    case PAGE_RATE:
        *undriven = ~RATE_MASK;
        return r->baud.rate;
    default:
        *undriven = ~MODE_MASK;
        return r->mode | (r->masked ? RX_DRIVEN : 0) | (r->fifo.count > 0 ? RX_DATA : 0);
    }
}

static void rx_write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct receivers *const s = m->state;
    const unsigned i = low / 16u;
    advance(m, m->clk + 1); /* the edge of the write is made with what was there before */
    if (i >= s->count)
        return;
    struct rx *const r = &s->port[i].rx;
    s->port[i].rests = false;
    if (page == PAGE_COUNT) {
        srl_clear(&r->fifo);
        r->mode &= ~(RX_EMPTY | RX_LOST);
    } else if (page == PAGE_RATE) {
        r->baud.rate = value & RATE_MASK;
    } else if (page == PAGE_MODE) {
        r->mode = (r->mode & ~RX_SETTINGS) | (value & RX_SETTINGS);
    }
}

static void rx_input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct receivers *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        if (pin != PIN_RX || (i != unit && unit != HM2_UNIT_GLOBAL))
            continue;
        s->port[i].input = level;
        s->port[i].rests = false;
    }
}

static void tx_attach(struct sim_module *const m, const unsigned unit, const sim_serial_fn sent, void *const context)
{
    struct transmitters *const s = m->state;
    s->port[unit].tap = (struct serial_tap){sent, context};
}

static struct serial_feed *rx_feed(struct sim_module *const m, const unsigned unit)
{
    struct receivers *const s = m->state;
    s->port[unit].rests = false;
    return unit < s->count ? &s->port[unit].feed : NULL;
}

const struct sim_module_ops sim_uart_tx_ops = {
    .gtag = HM2_GTAG_UART_TX,
    .name = "UART transmitter",
    .pages = PAGES,
    .state_size = sizeof(struct transmitters),
    .init = tx_init,
    .power_up = tx_power_up,
    .advance = advance,
    .read = tx_read,
    .write = tx_write,
    .output = tx_output,
    .next_event = tx_event,
    .serial_attach = tx_attach,
};

const struct sim_module_ops sim_uart_rx_ops = {
    .gtag = HM2_GTAG_UART_RX,
    .name = "UART receiver",
    .pages = PAGES,
    .state_size = sizeof(struct receivers),
    .init = rx_init,
    .power_up = rx_power_up,
    .advance = advance,
    .read = rx_read,
    .write = rx_write,
    .input = rx_input,
    .serial_feed = rx_feed,
};
