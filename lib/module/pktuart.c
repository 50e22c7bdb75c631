/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * PktUART: bytes travel in frames. In each cycle up to four sizes of received frames are taken, and up to 63 words of
 * those whose size is known; up to 63 words are sent as one frame. Traps of the firmware (Annex D) and what is done
 * about them: the first count is lost without a clear, so a clear precedes every mode; with automatic drive enable the
 * last of several frames is stranded, so one is sent at a time; frames beyond the buffers are told by what is left
 * over, and the receiver is cleared.
 */
#include <string.h>

#include "module_types.h"
#include "serial.h"

enum { REG_DATA, REG_COUNT, REG_RATE, REG_MODE };

#define CLEAR          0x80010000u
#define BLOCKS         6u
#define WORDS          63u
#define COUNTS         4u
#define FRAMES         16u
#define BUFFER_WORDS   255u /* with one more bit 21 reads as if there were none */
#define QUEUED_FRAMES  12u
#define SIZE_MASK      0x3FFu
#define SIZE_ERRORS    (7u << 14)
#define MODE_FRAMES(m) ((m) >> 16 & 0x1Fu)
#define MODE_DATA      (1u << 21)
#define MODE_ACTIVE    (1u << 7)
#define MODE_ERROR     (1u << 4)
#define TX_DRIVE       (1u << 6)
#define TX_AUTO        (1u << 5)
#define RX_ENABLE      (1u << 3)
#define RX_MASK        (1u << 2)
#define PARITY         (1u << 17)
#define PARITY_ODD     (1u << 18)
#define GAP_SHIFT      8
#define FILTER_SHIFT   22
#define FILTER_MAX     0xFFu
#define MIN_GAP        11u /* below it each byte becomes a frame */
#define NARROW_BITS    20u
#define WIDE_BITS      24u
#define WIDE_PROBE     0x00A00000u

struct pktuart {
    struct hm2_serial port; /* first: a port is found through it */
    unsigned version, rate_bits;
    uint16_t tx[4], rx[4]; /* registers */

    struct hm2_section tx_rate, rx_rate, tx_mode, rx_mode, rx_clear;
    struct queue out, in;
    struct hm2_window out_count, in_count[COUNTS], tx_state, rx_state;

    bool awaiting; /* a write and a request with our words are on their way */
    bool resend;   /* the last write was lost: the same again */
    unsigned sent_bytes, sent_words;
    unsigned queued, queued_words; /* frames in the card, as far as known */
    uint8_t queue_words[FRAMES];
    uint32_t tx_mode_seen, rx_mode_seen;

    unsigned popped_words, popped_counts; /* asked for */
    uint64_t request;                     /* in this one */
    bool unanswered;                      /* which was given up: nothing more is asked for until its reply is late or
                                           * a later one shows that it is lost */
    unsigned sizes;                       /* frames whose size is known, oldest first */
    uint16_t size[FRAMES];
    bool clearing;
};

struct pktuarts {
    struct pktuart *port;
};

static const struct hm2_md_variant variants[] = {{0, 4, 4, 0xF}, {1, 4, 4, 0xF}, {2, 4, 4, 0xF}, {3, 4, 4, 0xF}};
static const struct hm2_point_group groups[] = {{NULL, NULL, 0, NULL}};

/* ---- set-up ---------------------------------------------------------------------------------------------------------
 */

static int open_port(struct hm2_serial *const port, struct hm2_diag *const diag)
{
    struct pktuart *const p = (struct pktuart *)port;
    p->in.fifo = p->rx[REG_DATA];
    p->in.nowhere = p->rx[REG_RATE]; /* to read it does nothing */
    p->out.fifo = p->tx[REG_DATA];
    p->out.nowhere = HM2_PLAN_NOWHERE;
    int err = queue_add_writes(&p->out, port->plan, BLOCKS, diag);
    if (!err)
        err = hm2_plan_add_queue_write(port->plan, &p->out_count, HM2_PLAN_NOWHERE, 1, diag);
    if (!err)
        err = queue_add_reads(&p->in, port->plan, BLOCKS, diag);
    for (unsigned i = 0; i < COUNTS && !err; i++)
        err = hm2_plan_add_queue_read(port->plan, &p->in_count[i], p->rx[REG_RATE], 1, diag);
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &p->rx_state, p->rx[REG_MODE], 1, diag);
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &p->tx_state, p->tx[REG_MODE], 1, diag);
    const struct {
        struct hm2_section *section;
        uint16_t address;
        unsigned words, flags;
    } rows[] = {
        {&p->tx_rate, p->tx[REG_RATE], 1, 0},
        {&p->rx_rate, p->rx[REG_RATE], 1, 0},
        {&p->tx_mode, p->tx[REG_MODE], 2, HM2_SECTION_FIFO},
        {&p->rx_mode, p->rx[REG_MODE], 2, HM2_SECTION_FIFO},
        {&p->rx_clear, p->rx[REG_MODE], 1, HM2_SECTION_ON_DEMAND},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0] && !err; i++)
        err = hm2_plan_add_setup(port->plan, rows[i].section, HM2_RANK_NORMAL, rows[i].address, rows[i].words,
                                 rows[i].flags, diag);
    if (!err)
        hm2_section_set(&p->rx_clear, 0, CLEAR);
    return err;
}

static int refuse(const struct pktuart *const p, const struct hm2_serial_settings *const s, struct hm2_diag *const diag)
{
    if (s->parity != HM2_PARITY_NONE && p->version == 0)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "this PktUART (version 0) has no parity");
    if (s->tx_gap_bits < MIN_GAP || s->tx_gap_bits > 255 || s->rx_gap_bits < MIN_GAP || s->rx_gap_bits > 255)
        return hm2_diag_add(diag, HM2_ERR_RANGE,
                            "gaps of %u (sender) and %u bits (receiver) found, %u to 255 expected: with less each byte "
                            "becomes a frame",
                            s->tx_gap_bits, s->rx_gap_bits, MIN_GAP);
    if (p->version == 0 && s->drive == HM2_DRIVE_AUTO && s->drive_delay_clk > 1)
        return hm2_diag_add(diag, HM2_ERR_RANGE,
                            "this PktUART (version 0) sends nothing with automatic drive enable and a delay above 1");
    return 0;
}

static void set_rates(struct pktuart *const p, const struct hm2_serial_settings *const s)
{
    const uint32_t rate = serial_rate(&p->port, s->baud, p->rate_bits);
    /* The filter is half a bit, as LinuxCNC's driver has it, and never 0, which makes the receiver see a low for ever.
     */
    const double filter = p->port.clock_hz / (2.0 * s->baud);
    const uint32_t wide = filter > 65535.0 ? 65535u : (uint32_t)filter;
    hm2_section_set(&p->tx_rate, 0, rate);
    hm2_section_set(&p->rx_rate, 0, p->rate_bits == WIDE_BITS ? rate | wide >> 8 << 24 : rate);
}

static uint32_t filter_of(const struct pktuart *const p, const uint32_t baud)
{
    const double clocks = p->port.clock_hz / (2.0 * baud);
    const uint32_t filter = clocks > 65535.0 ? 65535u : (uint32_t)clocks;
    if (p->rate_bits == WIDE_BITS)
        return filter & FILTER_MAX;
    return filter > FILTER_MAX ? FILTER_MAX : filter ? filter : 1u;
}

static int set_port(struct hm2_serial *const port, const struct hm2_serial_settings *const s,
                    struct hm2_diag *const diag)
{
    struct pktuart *const p = (struct pktuart *)port;
    const int err = refuse(p, s, diag);
    if (err)
        return err;
    const uint32_t parity = s->parity == HM2_PARITY_NONE  ? 0
                            : s->parity == HM2_PARITY_ODD ? PARITY | PARITY_ODD
                                                          : PARITY;
    const uint32_t drive = s->drive == HM2_DRIVE_AUTO ? TX_AUTO : s->drive == HM2_DRIVE_ON ? TX_DRIVE : 0;
    set_rates(p, s);
    hm2_section_set(&p->tx_mode, 0, CLEAR);
    hm2_section_set(&p->tx_mode, 1, parity | drive | s->drive_delay_clk | s->tx_gap_bits << GAP_SHIFT);
    hm2_section_set(&p->rx_mode, 0, CLEAR);
    hm2_section_set(&p->rx_mode, 1,
                    parity | RX_ENABLE | (s->mask ? RX_MASK : 0) | s->rx_gap_bits << GAP_SHIFT |
                        filter_of(p, s->baud) << FILTER_SHIFT);
    hm2_section_touch(&p->tx_mode);
    hm2_section_touch(&p->rx_mode);
    p->queued = p->queued_words = p->sizes = 0;
    p->popped_words = p->popped_counts = 0;
    p->unanswered = false;
    return 0;
}

static const struct serial_ops ops = {open_port, set_port};

/* Firmware sources differ in the width of the rate register whatever the version says (Annex D). */
static int probe_rate(struct hm2_setup *const setup, const uint16_t address, unsigned *const bits)
{
    const uint32_t probe = WIDE_PROBE, zero = 0;
    uint32_t shown = 0;
    int err = setup->poke(setup, address, 1, &probe);
    if (!err)
        err = setup->peek(setup, address, 1, &shown);
    if (!err)
        err = setup->poke(setup, address, 1, &zero);
    *bits = (shown & 0xF00000u) == WIDE_PROBE ? WIDE_BITS : NARROW_BITS;
    return err;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    const struct hm2_md *const rx = hm2_idrom_find(setup->idrom, HM2_GTAG_PKTUART_RX);
    if (module->instances == 0)
        return 0;
    if (!rx || rx->instances < module->instances)
        return hm2_diag_add(setup->diag, HM2_ERR_MISMATCH,
                            "%s: the firmware has %u PktUART transmitters and %u receivers", setup->prefix,
                            module->md->instances, rx ? rx->instances : 0);
    struct pktuarts *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    if (!ctx)
        return HM2_ERR_NOMEM;
    ctx->port = hm2_setup_alloc(setup, module->instances * sizeof *ctx->port);
    if (!ctx->port)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    unsigned bits = NARROW_BITS;
    int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL);
    if (!err)
        err = hm2_claim_pins(module, setup, HM2_GTAG_PKTUART_RX, module->instances, false, NULL);
    if (!err)
        err = probe_rate(setup, hm2_md_address(module->md, REG_RATE, 0), &bits);
    for (unsigned unit = 0; unit < module->instances; unit++) {
        struct pktuart *const p = &ctx->port[unit];
        p->port.ops = &ops;
        p->port.plan = setup->plan;
        p->port.clock_hz = module->md->clock_hz;
        p->version = module->md->version;
        p->rate_bits = bits;
        for (unsigned i = 0; i < 4; i++) {
            p->tx[i] = hm2_md_address(module->md, i, unit);
            p->rx[i] = hm2_md_address(rx, i, unit);
        }
    }
    return err;
}

struct hm2_serial *pktuart_port(const struct hm2_module *const module, const unsigned unit)
{
    const struct pktuarts *const ctx = module->context;
    return &ctx->port[unit].port;
}

/* ---- reply ----------------------------------------------------------------------------------------------------------
 */

/* Sizes and data no longer belong together, or something was lost: begin anew. */
static void start_over(struct pktuart *const p)
{
    p->sizes = p->popped_words = p->popped_counts = 0;
    p->unanswered = false;
    p->clearing = true;
    hm2_section_touch(&p->rx_clear);
}

static void take_words(struct pktuart *const p)
{
    for (unsigned n = 0; n < p->popped_words && p->sizes > 0; n++) {
        const struct queue_place at = queue_place(&p->in, p->popped_words, n);
        uint8_t bytes[4];
        hm2_put_le32(bytes, hm2_window_get(at.window, at.word));
        const unsigned len = p->size[0] < 4u ? p->size[0] : 4u;
        p->port.counts.rx_bytes += (uint32_t)ring_put(&p->port.rx, bytes, len);
        p->size[0] = (uint16_t)(p->size[0] - len);
        if (p->size[0] == 0)
            memmove(p->size, p->size + 1, --p->sizes * sizeof p->size[0]);
    }
    p->popped_words = 0;
}

static void take_sizes(struct pktuart *const p)
{
    for (unsigned i = 0; i < p->popped_counts; i++) {
        const uint32_t count = hm2_window_get(&p->in_count[i], 0);
        if (count & SIZE_ERRORS)
            p->port.counts.rx_errors++;
        if ((count & SIZE_MASK) != 0)
            p->size[p->sizes++] = (uint16_t)(count & SIZE_MASK);
    }
    p->popped_counts = 0;
}

/* A later reply has come before the one with what was asked for: that is lost, and with it the frames it belongs to. */
static void lose_frames(struct pktuart *const p)
{
    for (unsigned i = 0; i < p->sizes; i++)
        p->port.counts.rx_uncertain += p->size[i];
    p->port.counts.rx_errors += p->sizes + p->popped_counts;
    start_over(p);
}

static void take_received(struct pktuart *const p)
{
    if (p->unanswered)
        lose_frames(p);
    p->rx_mode_seen = hm2_window_get(&p->rx_state, 0);
    if (p->clearing) {
        p->clearing = !hm2_section_confirmed(&p->rx_clear);
        return;
    }
    take_words(p);
    take_sizes(p);
    const bool idle = !(p->rx_mode_seen & MODE_ACTIVE) && MODE_FRAMES(p->rx_mode_seen) == 0;
    const bool left_over = idle && p->sizes == 0 && (p->rx_mode_seen & MODE_DATA);
    if (p->rx_mode_seen & MODE_ERROR || left_over) {
        p->port.counts.rx_overruns++;
        start_over(p);
    }
}

static void take_sent(struct pktuart *const p)
{
    p->tx_mode_seen = hm2_window_get(&p->tx_state, 0);
    if (!p->resend && p->sent_words > 0) {
        p->port.counts.tx_bytes += p->sent_bytes;
        p->queue_words[p->queued++] = (uint8_t)p->sent_words;
        p->queued_words += p->sent_words;
        p->sent_words = 0;
    }
    const unsigned there = MODE_FRAMES(p->tx_mode_seen) + ((p->tx_mode_seen & MODE_ACTIVE) != 0);
    while (p->queued > there) {
        p->queued_words -= p->queue_words[0];
        memmove(p->queue_words, p->queue_words + 1, --p->queued);
    }
}

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct pktuarts *const ctx = module->context;
    (void)cycle;
    for (struct pktuart *p = ctx->port, *const end = p + module->instances; p < end; p++) {
        if (!p->port.open || !p->awaiting)
            continue;
        p->awaiting = false;
        take_sent(p);
        take_received(p);
    }
}

static void late(struct hm2_module *const module, const uint64_t request)
{
    const struct pktuarts *const ctx = module->context;
    for (unsigned unit = 0; ctx && unit < module->instances; unit++) {
        struct pktuart *const p = &ctx->port[unit];
        if (!p->port.open || p->clearing || p->request != request)
            continue;
        p->rx_mode_seen = hm2_window_get(&p->rx_state, 0);
        take_words(p);
        take_sizes(p);
        p->unanswered = false;
    }
}

static void write_lost(struct hm2_module *const module)
{
    const struct pktuarts *const ctx = module->context;
    for (unsigned unit = 0; ctx && unit < module->instances; unit++)
        ctx->port[unit].resend = ctx->port[unit].sent_words > 0;
}

/* ---- write ----------------------------------------------------------------------------------------------------------
 */

/* No fresh reply since the last write: what was asked for may still come, and nobody knows what the card sent. */
static void miss(struct pktuart *const p)
{
    p->unanswered = p->popped_words > 0 || p->popped_counts > 0;
    p->port.counts.tx_uncertain += p->sent_words > 0 ? p->sent_bytes : 0;
    p->sent_words = 0;
    p->resend = false;
}

static bool may_send(const struct pktuart *const p)
{
    if (!hm2_section_confirmed(&p->tx_mode) || !hm2_section_confirmed(&p->tx_rate))
        return false;
    if (p->port.settings.drive == HM2_DRIVE_AUTO)
        return p->queued == 0 && !(p->tx_mode_seen & MODE_ACTIVE);
    return p->port.settings.drive == HM2_DRIVE_ON && p->queued < QUEUED_FRAMES;
}

static void send_frame(struct pktuart *const p)
{
    uint8_t bytes[4u * WORDS] = {0};
    const unsigned free_words = BUFFER_WORDS - p->queued_words;
    const unsigned words = free_words < WORDS ? free_words : WORDS;
    p->sent_bytes = may_send(p) ? (unsigned)ring_get(&p->port.tx, bytes, (size_t)4u * words) : 0;
    p->sent_words = (p->sent_bytes + 3u) / 4u;
    queue_aim(&p->out, p->sent_words);
    for (unsigned n = 0; n < p->sent_words; n++) {
        const struct queue_place at = queue_place(&p->out, p->sent_words, n);
        hm2_window_set(at.window, at.word, hm2_get_le32(bytes + 4u * n));
    }
    hm2_put_le16(p->out_count.address, p->sent_bytes ? p->tx[REG_COUNT] : HM2_PLAN_NOWHERE);
    hm2_window_set(&p->out_count, 0, p->sent_bytes);
}

static unsigned known_words(const struct pktuart *const p)
{
    unsigned words = 0;
    for (unsigned i = 0; i < p->sizes; i++)
        words += (p->size[i] + 3u) / 4u;
    return words;
}

static void ask_received(struct pktuart *const p)
{
    if (p->unanswered) {
        queue_aim(&p->in, 0);
        for (unsigned i = 0; i < COUNTS; i++)
            hm2_put_le16(p->in_count[i].address, p->rx[REG_RATE]);
        return;
    }
    const bool ready = !p->clearing && hm2_section_confirmed(&p->rx_mode) && hm2_section_confirmed(&p->rx_rate);
    const unsigned room = (RING_BYTES - ring_used(&p->port.rx)) / 4u, known = known_words(p);
    const unsigned words = known < WORDS ? known : WORDS;
    p->popped_words = !ready ? 0 : words < room ? words : room;
    p->request = hm2_plan_requests(p->port.plan) + 1u;
    queue_aim(&p->in, p->popped_words);
    const unsigned there = ready ? MODE_FRAMES(p->rx_mode_seen) : 0;
    const unsigned places = FRAMES - p->sizes;
    p->popped_counts = there < COUNTS ? there : COUNTS;
    p->popped_counts = p->popped_counts < places ? p->popped_counts : places;
    for (unsigned i = 0; i < COUNTS; i++)
        hm2_put_le16(p->in_count[i].address, i < p->popped_counts ? p->rx[REG_COUNT] : p->rx[REG_RATE]);
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct pktuarts *const ctx = module->context;
    (void)cycle;
    for (struct pktuart *p = ctx->port, *const end = p + module->instances; p < end; p++) {
        if (!p->port.open)
            continue;
        if (p->awaiting)
            miss(p);
        if (!p->resend)
            send_frame(p);
        p->resend = false;
        ask_received(p);
        p->awaiting = true;
    }
}

const struct hm2_module_type hm2_pktuart_type = {
    .name = "pktuart",
    .gtag = HM2_GTAG_PKTUART_TX,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_PKTUARTS,
    .setup = setup,
    .unpack = unpack,
    .pack = pack,
    .write_lost = write_lost,
    .late = late,
    .groups = groups,
};

/* The receiver belongs to the transmitter of its number, which sets both up. */
static int setup_receiver(struct hm2_module *const module, struct hm2_setup *const setup)
{
    (void)module;
    (void)setup;
    return 0;
}

const struct hm2_module_type hm2_pktuart_rx_type = {
    .name = "pktuart_rx",
    .gtag = HM2_GTAG_PKTUART_RX,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_PKTUARTS,
    .setup = setup_receiver,
    .groups = groups,
};
