/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * UART: FIFOs of sixteen words out and sixteen bytes in. A list of fixed length cannot ask before it pops. Up to three
 * bytes that the last reply showed are popped first; then four bytes at a time, which the port refuses when there are
 * fewer, and the number of bytes before and after tells which of the two it did, also when a byte came in between. So
 * a byte waits for at most one cycle, and sixteen are enough for 115200 baud at 1 kHz.
 */
#include <string.h>

#include "module_types.h"
#include "serial.h"

#define RATE_BITS   20u
#define UNIT_STRIDE 16u /* whatever the descriptor's stride says (tests/data/uart) */
#define SIZE_STRIDE 4u  /* data register + 4 (n - 1): n bytes */
#define BLOCKS      3u
#define WORDS       7u
#define FIFO_WORDS  16u
#define POPS        4u
#define POP_BYTES   4u
#define COUNT_MASK  0x1Fu
#define TX_AUTO     (1u << 5)
#define TX_DRIVE    (1u << 6)
#define RX_MASK     (1u << 2)
#define RX_ERRORS   3u
#define RX_LOST     (1u << 5)
#define POPPED_MOST (POP_BYTES - 1u + POPS * POP_BYTES)
#define NS_PER_S    1e9
#define BYTE_BITS   10.0   /* start and stop bit included */
#define FASTEST     1.0625 /* a peer's clock that is off by more is not understood */

/* What a request takes out of the receiver. */
struct asked {
    uint64_t request;
    unsigned popped; /* by `first` */
    bool fours;
};

#define UNANSWERED 16u

struct uart {
    struct hm2_serial port; /* first: a port is found through it */
    struct hm2_section tx_rate, rx_rate, tx_mode, rx_mode, tx_clear, rx_clear, rx_again;
    struct queue out;
    struct hm2_window tail, first, in[POPS], rx_count[POPS + 1], rx_state, tx_count;
    bool again;
    unsigned known, free_words;
    struct asked asked;                  /* in the last request */
    unsigned left, taken;                /* bytes: that it left in the card; that came since */
    unsigned gone;                       /* with requests since that will not be answered, at most */
    int64_t left_ns;                     /* not sooner */
    struct asked unanswered[UNANSWERED]; /* in those that were given up, oldest first; their replies may be late */
    unsigned unanswered_count;
};

static const struct hm2_md_variant variants[] = {{0, 4, 0x10, 0xF}, {0, 4, 0x40, 0xF}};
static const struct hm2_point_group groups[] = {{NULL, NULL, 0, NULL}};

/* ---- set-up ---------------------------------------------------------------------------------------------------------
 */

static int open_port(struct hm2_serial *const port, struct hm2_diag *const diag)
{
    struct uart *const u = (struct uart *)port;
    u->out.fifo = (uint16_t)(u->port.tx_reg[SERIAL_DATA] + 3u * SIZE_STRIDE);
    u->out.nowhere = HM2_PLAN_NOWHERE;
    int err = queue_add_writes(&u->out, port->plan, BLOCKS, diag);
    if (!err)
        err = hm2_plan_add_queue_write(port->plan, &u->tail, HM2_PLAN_NOWHERE, 1, diag);
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &u->first, u->port.rx_reg[SERIAL_RATE], 1, diag);
    for (unsigned i = 0; i <= POPS && !err; i++) {
        err = hm2_plan_add_queue_read(port->plan, &u->rx_count[i], u->port.rx_reg[SERIAL_COUNT], 1, diag);
        if (!err && i < POPS)
            err = hm2_plan_add_queue_read(port->plan, &u->in[i], u->port.rx_reg[SERIAL_RATE], 1, diag);
    }
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &u->rx_state, u->port.rx_reg[SERIAL_MODE], 1, diag);
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &u->tx_count, u->port.tx_reg[SERIAL_COUNT], 1, diag);
    const struct {
        struct hm2_section *section;
        uint16_t address;
        unsigned flags;
    } rows[] = {
        {&u->tx_rate, u->port.tx_reg[SERIAL_RATE], 0},
        {&u->rx_rate, u->port.rx_reg[SERIAL_RATE], 0},
        {&u->tx_mode, u->port.tx_reg[SERIAL_MODE], 0},
        {&u->rx_mode, u->port.rx_reg[SERIAL_MODE], 0},
        {&u->tx_clear, u->port.tx_reg[SERIAL_COUNT], 0},
        {&u->rx_clear, u->port.rx_reg[SERIAL_COUNT], 0},
        {&u->rx_again, u->port.rx_reg[SERIAL_COUNT], HM2_SECTION_ON_DEMAND},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0] && !err; i++)
        err = hm2_plan_add_setup(port->plan, rows[i].section, HM2_RANK_NORMAL, rows[i].address, 1, rows[i].flags, diag);
    return err;
}

static int set_port(struct hm2_serial *const port, const struct hm2_serial_settings *const s,
                    struct hm2_diag *const diag)
{
    struct uart *const u = (struct uart *)port;
    if (s->parity != HM2_PARITY_NONE)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "a UART has no parity (a PktUART from version 1 on has)");
    if (s->frames || s->deaf)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "a UART has no frames and cannot be deaf (a PktUART has and can)");
    const uint32_t rate = serial_rate(port, s->baud, RATE_BITS);
    const uint32_t drive = s->drive == HM2_DRIVE_AUTO ? TX_AUTO : s->drive == HM2_DRIVE_ON ? TX_DRIVE : 0;
    hm2_section_set(&u->tx_rate, 0, rate);
    hm2_section_set(&u->rx_rate, 0, rate);
    hm2_section_set(&u->tx_mode, 0, drive | s->drive_delay_clk);
    hm2_section_set(&u->rx_mode, 0, s->mask ? RX_MASK : 0);
    hm2_section_touch(&u->tx_clear);
    hm2_section_touch(&u->rx_clear);
    u->known = u->free_words = u->unanswered_count = u->left = u->taken = u->gone = 0;
    u->asked = (struct asked){0};
    return 0;
}

/* ---- reply ----------------------------------------------------------------------------------------------------------
 */

static void take(struct uart *const u, const struct hm2_window *const window, const unsigned len)
{
    uint8_t bytes[4];
    hm2_put_le32(bytes, hm2_window_get(window, 0));
    u->taken += len;
    u->port.counts.rx_bytes += (uint32_t)ring_put(&u->port.rx, bytes, len);
}

static unsigned count_at(const struct uart *const u, const unsigned i)
{
    return hm2_window_get(&u->rx_count[i], 0) & COUNT_MASK;
}

static void take_bytes(struct uart *const u, const struct asked asked)
{
    take(u, &u->first, asked.popped);
    for (unsigned i = 0; asked.fours && i < POPS; i++)
        if (count_at(u, i + 1) < count_at(u, i))
            take(u, &u->in[i], POP_BYTES);
}

/* The oldest of the unanswered will not be answered any more. */
static void drop_unanswered(struct uart *const u, const unsigned n)
{
    for (unsigned i = 0; i < n; i++)
        u->gone += u->unanswered[i].popped + (u->unanswered[i].fours ? POPS * POP_BYTES : 0);
    u->unanswered_count -= n;
    memmove(u->unanswered, u->unanswered + n, u->unanswered_count * sizeof u->unanswered[0]);
}

/* What the card had since the last good reply, at most, less what is accounted for. */
static unsigned missing_most(const struct uart *const u)
{
    const double ns = (double)(u->port.now_ns - u->left_ns);
    const double came = ns > 0.0 ? ns / NS_PER_S * FASTEST * u->port.settings.baud / BYTE_BITS : 0.0;
    const double most = u->left + came + 1.0 - u->taken - count_at(u, POPS);
    return most <= 0.0 ? 0 : most < UINT16_MAX ? (unsigned)most : UINT16_MAX;
}

/* Bytes that went to requests without a reply, as far as these came, or to some that came twice. doubted: of this
 * reply, which nobody could expect to be there. */
HM2_RARE static void count_missing(struct uart *const u, const unsigned doubted)
{
    const struct serial_passage *const passage = &u->port.passage;
    const unsigned bound = missing_most(u), gone = passage->unheard ? 0 : u->gone;
    const unsigned most = gone + passage->twice * POPPED_MOST + doubted;
    u->port.counts.rx_uncertain += most < bound ? most : bound;
}

static void take_asked(struct uart *const u)
{
    const bool told = u->port.passage.told;
    const unsigned doubted = told && u->port.passage.stray ? u->asked.popped : 0;
    if (u->unanswered_count > 0)
        drop_unanswered(u, u->unanswered_count); /* a later reply is here already */
    u->asked.popped -= doubted;
    take_bytes(u, u->asked);
    if (told || u->gone > 0)
        count_missing(u, doubted);
    u->asked = (struct asked){0};
    u->known = u->left = count_at(u, POPS);
    u->left_ns = u->port.sent_ns;
    u->gone = u->taken = 0;
}

static void take_received(struct hm2_serial *const port)
{
    struct uart *const u = (struct uart *)port;
    const uint32_t words = hm2_window_get(&u->tx_count, 0) & COUNT_MASK;
    u->free_words = words < FIFO_WORDS ? FIFO_WORDS - words : 0;
    take_asked(u);
    const uint32_t state = hm2_window_get(&u->rx_state, 0);
    u->again = u->again && !hm2_section_confirmed(&u->rx_again);
    if (state & RX_ERRORS) {
        u->port.counts.rx_errors++;
        hm2_section_touch(&u->rx_mode); /* clears the flags */
    }
    if (state & RX_LOST && !u->again) {
        u->port.counts.rx_overruns++;
        u->again = true;
        hm2_section_touch(&u->rx_again);
    }
}

static bool take_late(struct hm2_serial *const port, const uint64_t request)
{
    struct uart *const u = (struct uart *)port;
    unsigned i = 0;
    if (u->asked.request == request) { /* given up, but no write was made since */
        drop_unanswered(u, u->unanswered_count);
        take_bytes(u, u->asked);
        u->asked = (struct asked){0};
        return true;
    }
    while (i < u->unanswered_count && u->unanswered[i].request != request)
        i++;
    if (i == u->unanswered_count)
        return false;
    drop_unanswered(u, i);
    take_bytes(u, u->unanswered[0]);
    u->unanswered[0] = (struct asked){0};
    drop_unanswered(u, 1);
    return true;
}

/* ---- write ----------------------------------------------------------------------------------------------------------
 */

static bool miss(struct hm2_serial *const port, const bool hold)
{
    struct uart *const u = (struct uart *)port;
    if (u->asked.request != 0) {
        if (u->unanswered_count == UNANSWERED)
            drop_unanswered(u, 1);
        u->unanswered[u->unanswered_count++] = u->asked;
    }
    u->asked = (struct asked){0};
    u->known = u->free_words = 0;
    return hold;
}

static void aim(struct hm2_serial *const port, const unsigned bytes)
{
    struct uart *const u = (struct uart *)port;
    const unsigned rest = bytes % 4u;
    const unsigned tail = rest ? u->port.tx_reg[SERIAL_DATA] + SIZE_STRIDE * (rest - 1u) : HM2_PLAN_NOWHERE;
    queue_aim(&u->out, bytes / 4u);
    hm2_put_le16(u->tail.address, (uint16_t)tail);
}

static void send_bytes(struct hm2_serial *const port)
{
    struct uart *const u = (struct uart *)port;
    uint8_t bytes[4u * WORDS + 4u] = {0};
    const bool ready =
        hm2_section_confirmed(&u->tx_rate) && hm2_section_confirmed(&u->tx_mode) && hm2_section_confirmed(&u->tx_clear);
    const unsigned words = u->free_words < WORDS ? u->free_words : WORDS;
    port->sent_bytes = ready ? (unsigned)ring_get(&u->port.tx, bytes, (size_t)4u * words) : 0;
    const unsigned whole = port->sent_bytes / 4u;
    aim(port, port->sent_bytes);
    for (unsigned n = 0; n < whole; n++) {
        const struct queue_place at = queue_place(&u->out, whole, n);
        hm2_window_set(at.window, at.word, hm2_get_le32(bytes + 4u * n));
    }
    hm2_window_set(&u->tail, 0, hm2_get_le32(bytes + 4u * whole));
}

static void ask_received(struct hm2_serial *const port)
{
    struct uart *const u = (struct uart *)port;
    const bool ready = !u->again && hm2_section_confirmed(&u->rx_rate) && hm2_section_confirmed(&u->rx_clear);
    const unsigned most = (POPS + 1u) * POP_BYTES * (u->unanswered_count + 1u);
    const bool room = RING_BYTES - ring_used(&u->port.rx) >= most;
    const unsigned odd = u->known < POP_BYTES ? u->known : POP_BYTES - 1u;
    const unsigned popped = ready && room ? odd : 0;
    u->asked = (struct asked){hm2_plan_requests(u->port.plan) + 1u, popped, ready && room};
    const unsigned address =
        popped ? u->port.rx_reg[SERIAL_DATA] + SIZE_STRIDE * (popped - 1u) : u->port.rx_reg[SERIAL_RATE];
    hm2_put_le16(u->first.address, (uint16_t)address);
    const unsigned four = u->port.rx_reg[SERIAL_DATA] + SIZE_STRIDE * (POP_BYTES - 1u);
    for (unsigned i = 0; i < POPS; i++)
        hm2_put_le16(u->in[i].address, u->asked.fours ? (uint16_t)four : u->port.rx_reg[SERIAL_RATE]);
}

static const struct serial_ops ops = {.open = open_port,
                                      .set = set_port,
                                      .take = take_received,
                                      .late = take_late,
                                      .miss = miss,
                                      .send = send_bytes,
                                      .aim = aim,
                                      .ask = ask_received};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    static const struct serial_kind kind = {.title = "UART",
                                            .rx_gtag = HM2_GTAG_UART_RX,
                                            .size = sizeof(struct uart),
                                            .unit_stride = UNIT_STRIDE,
                                            .ops = &ops};
    return module->instances > 0 ? serial_setup(module, setup, &kind) : 0;
}

const struct hm2_module_type hm2_uart_type = {
    .name = "uart",
    .gtag = HM2_GTAG_UART_TX,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_UARTS,
    .setup = setup,
    .start = serial_start,
    .unpack = serial_unpack,
    .pack = serial_pack,
    .write_lost = serial_write_lost,
    .late = serial_late,
    .output_name = serial_output_name,
    .groups = groups,
};

const struct hm2_module_type hm2_uart_rx_type = {
    .name = "uart_rx",
    .gtag = HM2_GTAG_UART_RX,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_UARTS,
    .setup = serial_setup_receiver,
    .groups = groups,
};
