/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * PktUART: bytes travel in frames. In each cycle up to seven sizes of received frames are taken, or up to 63 words of
 * those whose size is known; up to 63 words are sent as one frame. Traps of the firmware (Annex D) and what is done
 * about them: the first count is lost without a clear, so a clear precedes every mode; with automatic drive enable the
 * last of several frames is stranded, so one is sent at a time; frames beyond the buffers are told by what is left
 * over, and the receiver is cleared.
 */
#include <string.h>

#include "module_types.h"
#include "pktuart_rx.h"

#define CLEAR           0x80010000u
#define BLOCKS          6u
#define WORDS           63u
#define SMALL_WORDS     16u
#define FRAMES          16u
#define QUEUED_FRAMES   12u
#define MODE_FRAMES(m)  ((m) >> 16 & 0x1Fu)
#define MODE_ACTIVE     (1u << 7)
#define TX_DRIVE        (1u << 6)
#define TX_AUTO         (1u << 5)
#define RX_ENABLE       (1u << 3)
#define RX_MASK         (1u << 2)
#define PARITY          (1u << 17)
#define PARITY_ODD      (1u << 18)
#define GAP_SHIFT       8
#define FILTER_SHIFT    22
#define FILTER_MASK     0xFFu
#define RESET_FILTER_HZ 5e6
#define MIN_GAP         11u /* below it each byte becomes a frame */
#define NARROW_BITS     20u
#define WIDE_BITS       24u
#define WIDE_PROBE      0x00A00000u

struct pktuart {
    struct hm2_serial port; /* first: a port is found through it */
    unsigned version, rate_bits;
    struct hm2_section tx_rate, rx_rate, tx_mode, rx_mode, rx_clear;
    struct queue out;
    struct hm2_window out_count, tx_state;
    unsigned queued, queued_words; /* frames in the card, as far as known */
    uint8_t queue_words[FRAMES];
    uint32_t tx_mode_seen;
    struct pkt_rx rx;
};

static const struct hm2_md_variant variants[] = {{0, 4, 4, 0xF}, {1, 4, 4, 0xF}, {2, 4, 4, 0xF}, {3, 4, 4, 0xF}};
static const struct hm2_point_group groups[] = {{NULL, NULL, 0, NULL}};

/* ---- set-up ---------------------------------------------------------------------------------------------------------
 */

static int open_port(struct hm2_serial *const port, struct hm2_diag *const diag)
{
    struct pktuart *const p = (struct pktuart *)port;
    p->out.fifo = p->port.tx_reg[SERIAL_DATA];
    p->out.nowhere = HM2_PLAN_NOWHERE;
    int err = queue_add_writes(&p->out, port->plan, BLOCKS, diag);
    if (!err)
        err = hm2_plan_add_queue_write(port->plan, &p->out_count, HM2_PLAN_NOWHERE, 1, diag);
    if (!err)
        err = pkt_rx_add(&p->rx, port, diag);
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &p->tx_state, p->port.tx_reg[SERIAL_MODE], 2, diag);
    const struct {
        struct hm2_section *section;
        uint16_t address;
        unsigned words, flags;
    } rows[] = {
        {&p->tx_rate, p->port.tx_reg[SERIAL_RATE], 1, 0},
        {&p->rx_rate, p->port.rx_reg[SERIAL_RATE], 1, 0},
        {&p->tx_mode, p->port.tx_reg[SERIAL_MODE], 2, HM2_SECTION_FIFO},
        {&p->rx_mode, p->port.rx_reg[SERIAL_MODE], 2, HM2_SECTION_FIFO},
        {&p->rx_clear, p->port.rx_reg[SERIAL_MODE], 1, HM2_SECTION_ON_DEMAND},
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

/* Half a bit, as LinuxCNC's driver has it, and never 0, which makes the receiver see a low for ever. The filter counts
 * up to this while the line is high and must count down to see a start bit, from wherever it was before: after a change
 * to a shorter filter the first bytes would be spoilt. So speeds that vary have the filter of the firmware's reset. */
static uint32_t filter_clk(const struct pktuart *const p, const struct hm2_serial_settings *const s)
{
    const double most = p->rate_bits == WIDE_BITS ? 65535.0 : 255.0;
    double clocks = p->port.clock_hz / (2.0 * s->baud);
    if (s->speed_varies && clocks > p->port.clock_hz / RESET_FILTER_HZ)
        clocks = p->port.clock_hz / RESET_FILTER_HZ;
    return clocks < 1.0 ? 1u : clocks > most ? (uint32_t)most : (uint32_t)clocks;
}

static void set_rates(struct pktuart *const p, const struct hm2_serial_settings *const s)
{
    const uint32_t rate = serial_rate(&p->port, s->baud, p->rate_bits);
    const uint32_t high = p->rate_bits == WIDE_BITS ? filter_clk(p, s) >> 8 << 24 : 0;
    hm2_section_set(&p->tx_rate, 0, rate);
    hm2_section_set(&p->rx_rate, 0, rate | high);
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
                        (filter_clk(p, s) & FILTER_MASK) << FILTER_SHIFT);
    hm2_section_touch(&p->tx_mode);
    hm2_section_touch(&p->rx_mode);
    p->queued = p->queued_words = 0;
    pkt_crowd_init(&p->rx.crowd, s->baud);
    pkt_rx_forget(&p->rx, port);
    return 0;
}

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

/* ---- reply ----------------------------------------------------------------------------------------------------------
 */

static unsigned words_of(const unsigned bytes)
{
    return (bytes + 3u) / 4u;
}

static unsigned sent_words(const struct pktuart *const p)
{
    return words_of(p->port.sent_bytes);
}

static void queue_frame(struct pktuart *const p)
{
    if (p->port.sent_bytes == 0 || p->queued == FRAMES)
        return;
    p->queue_words[p->queued++] = (uint8_t)sent_words(p);
    p->queued_words += sent_words(p);
}

/* For a clock at its beginning a frame is neither queued nor under way: so the mode is read twice, or the buffer would
 * be taken to have room that it has not. */
static unsigned frames_in(const uint32_t mode)
{
    return MODE_FRAMES(mode) + ((mode & MODE_ACTIVE) != 0);
}

static void take_sent(struct pktuart *const p)
{
    const unsigned before = frames_in(hm2_window_get(&p->tx_state, 0));
    p->tx_mode_seen = hm2_window_get(&p->tx_state, 1);
    if (!p->port.resend)
        queue_frame(p);
    const unsigned now = frames_in(p->tx_mode_seen), there = before > now ? before : now;
    while (p->queued > there) {
        p->queued_words -= p->queue_words[0];
        memmove(p->queue_words, p->queue_words + 1, --p->queued);
    }
}

static void take(struct hm2_serial *const port)
{
    struct pktuart *const p = (struct pktuart *)port;
    take_sent(p);
    const enum pkt_rx_health health = pkt_rx_take(&p->rx, port);
    if (p->rx.clearing)
        p->rx.clearing = !hm2_section_confirmed(&p->rx_clear);
    if (health == PKT_RX_GOOD)
        return;
    port->counts.rx_overruns += health == PKT_RX_OVERRUN;
    pkt_rx_clear(&p->rx, port);
    hm2_section_touch(&p->rx_clear);
}

static void late(struct hm2_serial *const port, const uint64_t request)
{
    pkt_rx_late(&((struct pktuart *)port)->rx, port, request);
}

/* ---- write ----------------------------------------------------------------------------------------------------------
 */

static void miss(struct hm2_serial *const port)
{
    struct pktuart *const p = (struct pktuart *)port;
    queue_frame(p); /* it may be in the card */
    pkt_rx_miss(&p->rx);
}

static bool may_send(const struct pktuart *const p)
{
    if (!hm2_section_confirmed(&p->tx_mode) || !hm2_section_confirmed(&p->tx_rate))
        return false;
    if (p->queued + p->rx.crowd.frames >= FRAMES - 1u)
        return false;
    if (p->port.settings.drive == HM2_DRIVE_AUTO)
        return p->queued == 0 && !(p->tx_mode_seen & MODE_ACTIVE);
    return p->port.settings.drive == HM2_DRIVE_ON && p->queued < QUEUED_FRAMES;
}

/* What is sent may come back, at once or as an answer of the same length: the receiver has room for it all, however
 * late the next cycle is. Frames have few places, so a small room is not filled with a part of what waits. */
static unsigned words_to_send(const struct pktuart *const p)
{
    const unsigned there = p->queued_words + pkt_rx_most_words(&p->rx, p->port.now_ns);
    const unsigned free_words = there < PKT_BUFFER_WORDS ? PKT_BUFFER_WORDS - there : 0;
    const unsigned waiting_words = (ring_used(&p->port.tx) + 3u) / 4u;
    if (free_words < SMALL_WORDS && free_words < waiting_words)
        return 0;
    return free_words < WORDS ? free_words : WORDS;
}

static void aim(struct hm2_serial *const port, const unsigned bytes)
{
    struct pktuart *const p = (struct pktuart *)port;
    queue_aim(&p->out, words_of(bytes));
    hm2_put_le16(p->out_count.address, bytes ? port->tx_reg[SERIAL_COUNT] : HM2_PLAN_NOWHERE);
}

static void send_frame(struct hm2_serial *const port)
{
    struct pktuart *const p = (struct pktuart *)port;
    uint8_t bytes[4u * WORDS] = {0};
    const unsigned most = words_to_send(p);
    port->sent_bytes = may_send(p) ? (unsigned)ring_get(&port->tx, bytes, (size_t)4u * most) : 0;
    const unsigned words = sent_words(p);
    aim(port, port->sent_bytes);
    for (unsigned n = 0; n < words; n++) {
        const struct queue_place at = queue_place(&p->out, words, n);
        hm2_window_set(at.window, at.word, hm2_get_le32(bytes + 4u * n));
    }
    hm2_window_set(&p->out_count, 0, port->sent_bytes);
}

static void ask(struct hm2_serial *const port)
{
    struct pktuart *const p = (struct pktuart *)port;
    const bool set_up = hm2_section_confirmed(&p->rx_mode) && hm2_section_confirmed(&p->rx_rate);
    if (!set_up)
        pkt_rx_forget(&p->rx, port); /* a mode comes with a clear */
    pkt_rx_ask(&p->rx, port, set_up && !p->rx.clearing);
}

static const struct serial_ops ops = {.open = open_port,
                                      .set = set_port,
                                      .take = take,
                                      .late = late,
                                      .miss = miss,
                                      .send = send_frame,
                                      .aim = aim,
                                      .ask = ask};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    static const struct serial_kind kind = {
        .title = "PktUART", .rx_gtag = HM2_GTAG_PKTUART_RX, .size = sizeof(struct pktuart), .ops = &ops};
    if (module->instances == 0)
        return 0;
    unsigned bits = NARROW_BITS;
    int err = serial_setup(module, setup, &kind);
    if (!err)
        err = probe_rate(setup, hm2_md_address(module->md, SERIAL_RATE, 0), &bits);
    for (unsigned unit = 0; unit < module->instances && !err; unit++) {
        struct pktuart *const p = (struct pktuart *)serial_port(module, unit);
        p->version = module->md->version;
        p->rate_bits = bits;
    }
    return err;
}

const struct hm2_module_type hm2_pktuart_type = {
    .name = "pktuart",
    .gtag = HM2_GTAG_PKTUART_TX,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_PKTUARTS,
    .setup = setup,
    .unpack = serial_unpack,
    .pack = serial_pack,
    .write_lost = serial_write_lost,
    .late = serial_late,
    .output_name = serial_output_name,
    .output_stem = "uart", /* of both kinds */
    .groups = groups,
};

const struct hm2_module_type hm2_pktuart_rx_type = {
    .name = "pktuart_rx",
    .gtag = HM2_GTAG_PKTUART_RX,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_PKTUARTS,
    .setup = serial_setup_receiver,
    .groups = groups,
};
