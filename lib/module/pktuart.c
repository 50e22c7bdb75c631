/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * PktUART: bytes travel in frames. In each cycle up to seven sizes of received frames are taken, or up to 63 words of
 * those whose size is known; up to 63 words are sent, as one frame or, of a longer one, as a part. Traps of the
 * firmware (Annex D) and what is done about them: the first count is lost without a clear, so a clear precedes every
 * mode; with automatic drive enable the last of several frames is stranded, so one is sent at a time; frames beyond the
 * buffers are told by what is left over, and the receiver is cleared.
 */
#include <string.h>

#include "module_types.h"
#include "pktuart_rx.h"

#define CLEAR           0x80010000u
#define BLOCKS          6u
#define WORDS           63u
#define WRITE_BYTES     (4u * WORDS)
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
#define MIN_GAP         11u  /* below it each byte becomes a frame */
#define GAP_MAX         256u /* which the register shows as 0 */
#define GAP_MASK        0xFFu
#define NARROW_BITS     20u
#define WIDE_BITS       24u
#define WIDE_PROBE      0x00A00000u

struct pktuart {
    struct hm2_serial port; /* first: a port is found through it */
    unsigned version, rate_bits;
    struct hm2_section tx_rate, rx_rate, tx_mode, rx_mode, rx_clear;
    struct queue out;
    struct hm2_window out_count, tx_state;
    unsigned frame_bytes, given_bytes; /* of the frame in the last write: all, and those in writes so far */
    unsigned queued, queued_words;     /* frames in the card, as far as known */
    uint8_t queue_words[FRAMES];
    unsigned seen; /* by the last reply */
    bool spoilt;   /* words of a frame that will not be sent may be in the card */
    bool turned;   /* the turn that was answered last had a part of a long frame */
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
    const unsigned tx_least = s->frames ? 1 : MIN_GAP;
    if (s->tx_gap_bits < tx_least || s->tx_gap_bits > GAP_MAX || s->rx_gap_bits < MIN_GAP || s->rx_gap_bits > GAP_MAX)
        return hm2_diag_add(diag, HM2_ERR_RANGE,
                            "gaps of %u (sender) and %u bits (receiver) found, %u and %u to %u expected: a receiver "
                            "with less makes a frame of each byte",
                            s->tx_gap_bits, s->rx_gap_bits, tx_least, MIN_GAP, GAP_MAX);
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
    hm2_section_set(&p->tx_mode, 1, parity | drive | s->drive_delay_clk | (s->tx_gap_bits & GAP_MASK) << GAP_SHIFT);
    hm2_section_set(&p->rx_mode, 0, CLEAR);
    hm2_section_set(&p->rx_mode, 1,
                    parity | (s->deaf ? 0 : RX_ENABLE) | (s->mask ? RX_MASK : 0) |
                        (s->rx_gap_bits & GAP_MASK) << GAP_SHIFT | (filter_clk(p, s) & FILTER_MASK) << FILTER_SHIFT);
    hm2_section_touch(&p->tx_mode);
    hm2_section_touch(&p->rx_mode);
    p->queued = p->queued_words = p->frame_bytes = 0;
    p->spoilt = p->turned = false;
    pkt_crowd_init(&p->rx.crowd, s->baud, s->parity != HM2_PARITY_NONE);
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

static void queue_frame(struct pktuart *const p)
{
    if (p->frame_bytes == 0 || p->given_bytes < p->frame_bytes)
        return;
    p->queue_words[p->queued++] = (uint8_t)words_of(p->frame_bytes);
    p->queued_words += words_of(p->frame_bytes);
    p->frame_bytes = 0;
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
    const unsigned now = frames_in(hm2_window_get(&p->tx_state, 1));
    if (!p->port.resend)
        queue_frame(p);
    p->seen = before > now ? before : now;
    while (p->queued > p->seen) {
        p->queued_words -= p->queue_words[0];
        memmove(p->queue_words, p->queue_words + 1, --p->queued);
    }
}

/* The frame that is handed over in parts is not sent. */
static void drop_parts(struct pktuart *const p, const unsigned counted)
{
    p->port.counts.tx_uncertain += p->frame_bytes - counted;
    ring_drop(&p->port.tx, p->frame_bytes - p->given_bytes);
    if (p->given_bytes < p->frame_bytes)
        frames_drop(&p->port.tx_frames);
    p->frame_bytes = 0;
}

/* A frame of one write that came twice is sent twice. With a part of a longer one whatever follows would be sent in its
 * place. */
HM2_RARE static void look_for_double_parts(struct pktuart *const p)
{
    const struct serial_passage *const passage = &p->port.passage;
    const bool now = p->frame_bytes > WRITE_BYTES;
    if ((passage->twice == 0 || !p->turned) && (passage->writes_twice == 0 || !now))
        return;
    if (now)
        drop_parts(p, 0);
    p->spoilt = true;
}

static void take(struct hm2_serial *const port)
{
    struct pktuart *const p = (struct pktuart *)port;
    if (port->passage.told)
        look_for_double_parts(p);
    p->turned = p->frame_bytes > WRITE_BYTES && port->turned_bytes > 0;
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

static bool late(struct hm2_serial *const port, const uint64_t request)
{
    return pkt_rx_late(&((struct pktuart *)port)->rx, port, request);
}

/* ---- write ----------------------------------------------------------------------------------------------------------
 */

static bool tx_set_up(const struct pktuart *const p)
{
    return hm2_section_confirmed(&p->tx_mode) && hm2_section_confirmed(&p->tx_rate);
}

/* A mode comes with a clear: of what the transmitter had nobody knows how much it has sent. */
static void forget_sent(struct pktuart *const p)
{
    if (p->frame_bytes > 0)
        drop_parts(p, 0);
    p->port.counts.tx_uncertain += 4u * p->queued_words;
    p->queued = p->queued_words = 0;
    p->spoilt = false;
}

/* A frame of one write is in the card, or is not. Of a longer one a part may be missing: it is given up, and the card
 * cleared of it, or what follows would be sent in its place. */
static bool miss(struct hm2_serial *const port, const bool hold)
{
    struct pktuart *const p = (struct pktuart *)port;
    const bool held = hold && p->frame_bytes <= WRITE_BYTES;
    if (p->frame_bytes > WRITE_BYTES) {
        drop_parts(p, port->sent_bytes);
        p->spoilt = true;
    } else if (!held) {
        queue_frame(p);
    }
    p->seen = FRAMES;
    pkt_rx_miss(&p->rx);
    return held;
}

/* When it has sent the frames before, and the spoilt one if that is whole after all. */
static void clear_spoilt(struct pktuart *const p)
{
    if (!p->spoilt || p->seen > 0)
        return;
    p->spoilt = false;
    hm2_section_touch(&p->tx_mode);
}

static bool may_send(const struct pktuart *const p)
{
    if (p->spoilt || p->queued + p->rx.crowd.frames >= FRAMES - 1u)
        return false;
    if (p->port.settings.drive == HM2_DRIVE_AUTO)
        return p->queued == 0 && p->seen == 0;
    return p->port.settings.drive == HM2_DRIVE_ON && p->queued < QUEUED_FRAMES;
}

/* What is sent may come back, at once or as an answer of the same length: the receiver has room for it all, however
 * late the next cycle is. */
static unsigned room_words(const struct pktuart *const p)
{
    const unsigned there = p->queued_words + pkt_rx_most_words(&p->rx, p->port.now_ns);
    return there < PKT_BUFFER_WORDS ? PKT_BUFFER_WORDS - there : 0;
}

/* Frames have few places, so a small room is not filled with a part of what waits. */
static unsigned next_of_stream(const struct pktuart *const p)
{
    const unsigned room = room_words(p), waiting = ring_used(&p->port.tx);
    if (room < SMALL_WORDS && room < words_of(waiting))
        return 0;
    const unsigned most = room < WORDS ? 4u * room : WRITE_BYTES;
    return waiting < most ? waiting : most;
}

/* One that is longer than the room will ever be is sent when nothing else is under way. */
static unsigned next_whole(const struct pktuart *const p)
{
    const unsigned bytes = frames_oldest(&p->port.tx_frames);
    const bool rests = p->queued == 0 && p->rx.frames == 0 && p->rx.still;
    return rests || words_of(bytes) <= room_words(p) ? bytes : 0;
}

/* The next bytes, of the frame under way or a new one. */
static unsigned fetch(struct pktuart *const p, uint8_t *const bytes)
{
    const bool framed = p->port.settings.frames;
    if (p->frame_bytes == 0) {
        p->given_bytes = 0;
        p->frame_bytes = !may_send(p) ? 0 : framed ? next_whole(p) : next_of_stream(p);
    }
    const unsigned left = p->frame_bytes - p->given_bytes, len = left < WRITE_BYTES ? left : WRITE_BYTES;
    (void)ring_get(&p->port.tx, bytes, len);
    p->given_bytes += len;
    if (framed && len > 0 && p->given_bytes == p->frame_bytes)
        frames_drop(&p->port.tx_frames);
    return len;
}

/* The count goes with the last part of a frame. */
static void aim(struct hm2_serial *const port, const unsigned bytes)
{
    struct pktuart *const p = (struct pktuart *)port;
    const bool ends = bytes > 0 && p->given_bytes == p->frame_bytes;
    queue_aim(&p->out, words_of(bytes));
    hm2_put_le16(p->out_count.address, ends ? port->tx_reg[SERIAL_COUNT] : HM2_PLAN_NOWHERE);
}

static void send_frame(struct hm2_serial *const port)
{
    struct pktuart *const p = (struct pktuart *)port;
    uint8_t bytes[WRITE_BYTES] = {0};
    clear_spoilt(p);
    const bool set_up = tx_set_up(p);
    if (!set_up)
        forget_sent(p);
    port->sent_bytes = set_up ? fetch(p, bytes) : 0;
    const unsigned words = words_of(port->sent_bytes);
    aim(port, port->sent_bytes);
    for (unsigned n = 0; n < words; n++) {
        const struct queue_place at = queue_place(&p->out, words, n);
        hm2_window_set(at.window, at.word, hm2_get_le32(bytes + 4u * n));
    }
    hm2_window_set(&p->out_count, 0, p->frame_bytes);
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
    .start = serial_start,
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
