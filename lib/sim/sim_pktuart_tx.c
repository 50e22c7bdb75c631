/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Packet UART, transmitter (tag 1B): frames of up to 1023 bytes with gaps between them (register map 3.13, Annex D). */
#include "sim_pktuart.h"

#define MODE_DELAY   0xFu
#define MODE_ERROR   (1u << 4)
#define MODE_AUTO    (1u << 5)
#define MODE_DRIVE   (1u << 6)
#define MODE_ACTIVE  (1u << 7)
#define MODE_GAP(m)  ((m) >> 8 & 0xFFu)
#define MODE_READS   0xFF6Fu
#define FRAMES_SHIFT 16
#define MODE_DATA    (1u << 21)
#define SREG_TOP     (1u << 11)
#define SREG_IDLE    1u
#define DATA_SHIFT   2
#define PARITY_SHIFT 10
#define LEFT_PLAIN   10u
#define LEFT_PARITY  11u
#define PIN_TX       0x81u
#define PIN_TXEN     0x82u /* low while driving */
#define PIN_NTXEN    0x83u

struct tx {
    struct srl_fifo counts;
    struct baud baud;
    uint32_t mode, sreg, count; /* count: bytes of the frame that are not yet started */
    uint32_t word;              /* what the buffer shows: one clock behind its address */
    uint8_t in, out;            /* words of the buffer */
    uint8_t left, byte, delay, gap, sending;
    bool go, gap_go, in_frame, pop_count, pop_data, error;
};

struct tx_port {
    const struct pkt_traits *traits;
    struct tx tx;
    bool rests; /* the last edge changed nothing */
    struct serial_tap tap;
    uint32_t buffer[PKT_BUFFER_WORDS];
};

struct transmitters {
    unsigned count;
    struct tx_port port[PKT_INSTANCES_MAX];
};

static bool drives(const struct tx *const t, const struct pkt_traits *const traits)
{
    if (t->mode & MODE_AUTO)
        return t->go || (t->gap_go && traits->drives_gap) || t->in_frame || t->counts.count > 0;
    return (t->mode & MODE_DRIVE) != 0;
}

static int64_t quiet(const void *const instance)
{
    const struct tx_port *const p = instance;
    const struct tx *const t = &p->tx;
    if (p->rests)
        return SIM_NEVER;
    const bool counts_only =
        (t->go || t->gap_go) && !t->pop_count && !t->pop_data && t->delay == 0 && t->word == p->buffer[t->out];
    /* Without drive the delay is loaded again and again. */
    return counts_only && drives(t, p->traits) ? baud_quiet(&t->baud, false) : 0;
}

static void skip(void *const instance, const int64_t edges)
{
    struct tx_port *const p = instance;
    if (!p->rests)
        baud_skip(&p->tx.baud, false, edges);
}

static void shift(struct tx_port *const p, const struct tx *const before)
{
    struct tx *const t = &p->tx;
    t->sreg = before->sreg >> 1 | SREG_TOP;
    t->left = (uint8_t)(before->left - 1u) & 0xFu;
    if (before->left != 0)
        return;
    t->go = false;
    if (p->tap.sent)
        p->tap.sent(p->tap.context, before->sending);
}

static void start_byte(struct tx_port *const p, const struct tx *const before)
{
    struct tx *const t = &p->tx;
    const bool parity = p->traits->parity && before->mode & PKT_PARITY;
    t->sending = (uint8_t)(before->word >> 8u * before->byte);
    const bool tenth = !parity || pkt_odd(t->sending) != ((before->mode & PKT_ODD) != 0);
    t->sreg = (uint32_t)t->sending << DATA_SHIFT | (uint32_t)tenth << PARITY_SHIFT | SREG_TOP | SREG_IDLE;
    t->go = t->in_frame = true;
    t->byte = (before->byte + 1u) & 3u;
    t->count = (before->count - 1u) & PKT_COUNT_MASK;
    t->pop_data = before->byte == 3u;
}

static void next_frame(struct tx *const t, const struct tx *const before)
{
    if (before->counts.count > 0) {
        t->count = (uint32_t)srl_oldest(&before->counts);
        t->pop_count = true;
    }
    if (!before->in_frame)
        return;
    if (before->byte != 0) { /* the rest of the last word is not sent */
        t->byte = 0;
        t->pop_data = true;
    }
    t->gap_go = true;
    t->gap = MODE_GAP(before->mode);
    t->in_frame = false;
}

/* Neither a byte nor a gap is under way. */
static void prepare(struct tx_port *const p, const struct tx *const before, const bool held)
{
    struct tx *const t = &p->tx;
    if (held && (p->traits->waits_with_count))
        return;
    t->sreg = (before->sreg & ~2u) | SREG_IDLE | SREG_TOP;
    t->left = p->traits->parity && before->mode & PKT_PARITY ? LEFT_PARITY : LEFT_PLAIN;
    if (before->count != 0 && !held)
        start_byte(p, before);
    else if (before->count == 0 || !p->traits->waits_with_count)
        next_frame(t, before);
}

static void edge(void *const instance)
{
    struct tx_port *const p = instance;
    struct tx *const t = &p->tx;
    const struct tx before = *t;
    const bool enabled = drives(&before, p->traits);
    t->pop_count = t->pop_data = false;
    t->baud.before = baud_high(&before.baud);
    if (before.go || before.gap_go)
        baud_step(&t->baud, false);
    else
        t->baud.accum = 0;
    if (before.go && !before.gap_go && baud_rises(&before.baud))
        shift(p, &before);
    if (before.gap_go && baud_falls(&before.baud)) {
        t->gap = (uint8_t)(before.gap - 1u);
        t->gap_go = before.gap != 1u;
    }
    if (!before.go && !before.gap_go)
        prepare(p, &before, !enabled || before.delay > 0);
    t->word = p->buffer[before.out];
    if (before.pop_data)
        t->out++;
    if (before.pop_count)
        (void)srl_drop(&t->counts, 1);
    if (!enabled)
        t->delay = before.mode & MODE_DELAY;
    else if (before.delay > 0)
        t->delay--;
    p->rests = serial_rests(&before, t, sizeof before);
}

static const struct sim_stepper stepper = {quiet, skip, edge};

void pkt_tx_step(struct sim_module *const m, const int64_t clk)
{
    struct transmitters *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        sim_step_to(&stepper, &s->port[i], m->clk, clk);
}

int64_t pkt_tx_event(struct sim_module *const m)
{
    const struct transmitters *const s = m->state;
    int64_t first = SIM_NEVER;
    for (unsigned i = 0; i < s->count; i++) {
        const int64_t edges = quiet(&s->port[i]);
        if (edges != SIM_NEVER && m->clk + edges < first)
            first = m->clk + edges;
    }
    return first;
}

bool pkt_tx_drives(const struct sim_module *const m, const unsigned unit)
{
    const struct transmitters *const s = m->state;
    return drives(&s->port[unit].tx, s->port[unit].traits);
}

/* ---- the module ----------------------------------------------------------------------------------------------------
 */

static int init(struct sim_module *const m)
{
    struct transmitters *const s = m->state;
    s->count = pkt_instances(m);
    for (unsigned i = 0; i < s->count; i++)
        s->port[i].traits = pkt_traits(m);
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct transmitters *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct tx_port *const p = &s->port[i];
        memset(&p->tx, 0, sizeof p->tx);
        p->tx.sreg = SREG_TOP | (SREG_TOP - 1u);
        p->tx.baud.top = 1u << (p->traits->rate_bits - 1u);
        p->rests = false;
        memset(p->buffer, 0, sizeof p->buffer);
        /* Without a clear the FIFO's address is one off: the first count is lost (trace tx_no_clear). */
    }
}

static uint32_t mode_of(const struct tx *const t)
{
    uint32_t mode = t->mode & MODE_READS;
    if (t->error)
        mode |= MODE_ERROR;
    if (t->go || t->gap_go || t->counts.count > 0 || t->in_frame)
        mode |= MODE_ACTIVE;
    if (t->in != t->out)
        mode |= MODE_DATA;
    return mode | (uint32_t)t->counts.count << FRAMES_SHIFT;
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct transmitters *const s = m->state;
    const unsigned i = low / 4u;
    *undriven = UINT32_MAX;
    if (i >= s->count || page == PKT_PAGE_DATA)
        return 0;
    const struct tx *const t = &s->port[i].tx;
    *undriven = page == PKT_PAGE_RATE ? ~(2u * t->baud.top - 1u) : 0;
    return page == PKT_PAGE_COUNT ? t->count : page == PKT_PAGE_RATE ? t->baud.rate : mode_of(t);
}

static void clear(struct tx *const t)
{
    srl_clear(&t->counts);
    t->in = t->out = 0;
    t->count = 0;
    t->byte = 0;
    t->go = t->gap_go = t->in_frame = t->error = false;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct transmitters *const s = m->state;
    const unsigned i = low / 4u;
    pkt_advance(m, m->clk + 1); /* the edge of the write is made with what was there before */
    if (i >= s->count)
        return;
    struct tx_port *const p = &s->port[i];
    struct tx *const t = &p->tx;
    p->rests = false;
    if (page == PKT_PAGE_DATA) {
        p->buffer[t->in++] = value;
    } else if (page == PKT_PAGE_COUNT) {
        if (!srl_push(&t->counts, value & PKT_COUNT_MASK))
            t->error = true;
    } else if (page == PKT_PAGE_RATE) {
        t->baud.rate = value & (2u * t->baud.top - 1u);
    } else {
        if (!(value & PKT_NO_LOAD))
            t->mode = value & PKT_MODE_BITS;
        if (value & PKT_CLEAR)
            clear(t);
    }
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct transmitters *const s = m->state;
    if (unit >= s->count)
        return SIM_LOW;
    const struct tx_port *const p = &s->port[unit];
    const bool driven = drives(&p->tx, p->traits);
    const bool level = pin == PIN_TX ? (p->tx.sreg & 1u) != 0 : pin == PIN_TXEN ? !driven : pin == PIN_NTXEN && driven;
    return level ? SIM_HIGH : SIM_LOW;
}

static void attach(struct sim_module *const m, const unsigned unit, const sim_serial_fn sent, void *const context)
{
    struct transmitters *const s = m->state;
    s->port[unit].tap = (struct serial_tap){sent, context};
}

const struct sim_module_ops sim_pktuart_tx_ops = {
    .gtag = HM2_GTAG_PKTUART_TX,
    .name = "PktUART transmitter",
    .pages = PKT_PAGES,
    .state_size = sizeof(struct transmitters),
    .init = init,
    .power_up = power_up,
    .advance = pkt_advance,
    .read = read,
    .write = write,
    .output = output,
    .next_event = pkt_tx_event,
    .serial_attach = attach,
};
