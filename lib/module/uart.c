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

enum { REG_DATA, REG_COUNT, REG_RATE, REG_MODE };

#define RATE_BITS   20u
#define PORT_STRIDE 16u /* whatever the descriptor's stride says (tests/data/uart) */
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

/* What a request takes out of the receiver. */
struct asked {
    uint64_t request;
    unsigned popped; /* by `first` */
    bool fours;
};

#define UNANSWERED 4u

struct uart {
    struct hm2_serial port; /* first: a port is found through it */
    uint16_t tx[4], rx[4];
    struct hm2_section tx_rate, rx_rate, tx_mode, rx_mode, tx_clear, rx_clear, rx_again;
    struct queue out;
    struct hm2_window tail, first, in[POPS], rx_count[POPS + 1], rx_state, tx_count;
    bool awaiting, resend, again;
    unsigned sent_bytes, known, free_words;
    struct asked asked;                  /* in the last request */
    struct asked unanswered[UNANSWERED]; /* in those that were given up, oldest first; their replies may be late */
    unsigned unanswered_count;
};

struct uarts {
    struct uart *port;
};

static const struct hm2_md_variant variants[] = {{0, 4, 0x10, 0xF}, {0, 4, 0x40, 0xF}};
static const struct hm2_point_group groups[] = {{NULL, NULL, 0, NULL}};

/* ---- set-up ---------------------------------------------------------------------------------------------------------
 */

static int open_port(struct hm2_serial *const port, struct hm2_diag *const diag)
{
    struct uart *const u = (struct uart *)port;
    u->out.fifo = (uint16_t)(u->tx[REG_DATA] + 3u * SIZE_STRIDE);
    u->out.nowhere = HM2_PLAN_NOWHERE;
    int err = queue_add_writes(&u->out, port->plan, BLOCKS, diag);
    if (!err)
        err = hm2_plan_add_queue_write(port->plan, &u->tail, HM2_PLAN_NOWHERE, 1, diag);
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &u->first, u->rx[REG_RATE], 1, diag);
    for (unsigned i = 0; i <= POPS && !err; i++) {
        err = hm2_plan_add_queue_read(port->plan, &u->rx_count[i], u->rx[REG_COUNT], 1, diag);
        if (!err && i < POPS)
            err = hm2_plan_add_queue_read(port->plan, &u->in[i], u->rx[REG_RATE], 1, diag);
    }
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &u->rx_state, u->rx[REG_MODE], 1, diag);
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &u->tx_count, u->tx[REG_COUNT], 1, diag);
    const struct {
        struct hm2_section *section;
        uint16_t address;
        unsigned flags;
    } rows[] = {
        {&u->tx_rate, u->tx[REG_RATE], 0},
        {&u->rx_rate, u->rx[REG_RATE], 0},
        {&u->tx_mode, u->tx[REG_MODE], 0},
        {&u->rx_mode, u->rx[REG_MODE], 0},
        {&u->tx_clear, u->tx[REG_COUNT], 0},
        {&u->rx_clear, u->rx[REG_COUNT], 0},
        {&u->rx_again, u->rx[REG_COUNT], HM2_SECTION_ON_DEMAND},
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
    const uint32_t rate = serial_rate(port, s->baud, RATE_BITS);
    const uint32_t drive = s->drive == HM2_DRIVE_AUTO ? TX_AUTO : s->drive == HM2_DRIVE_ON ? TX_DRIVE : 0;
    hm2_section_set(&u->tx_rate, 0, rate);
    hm2_section_set(&u->rx_rate, 0, rate);
    hm2_section_set(&u->tx_mode, 0, drive | s->drive_delay_clk);
    hm2_section_set(&u->rx_mode, 0, s->mask ? RX_MASK : 0);
    hm2_section_touch(&u->tx_clear);
    hm2_section_touch(&u->rx_clear);
    u->known = u->free_words = u->unanswered_count = 0;
    u->asked = (struct asked){0};
    return 0;
}

static const struct serial_ops ops = {open_port, set_port};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    const struct hm2_md *const rx = hm2_idrom_find(setup->idrom, HM2_GTAG_UART_RX);
    if (module->instances == 0)
        return 0;
    if (!rx || rx->instances < module->instances)
        return hm2_diag_add(setup->diag, HM2_ERR_MISMATCH, "%s: the firmware has %u UART transmitters and %u receivers",
                            setup->prefix, module->md->instances, rx ? rx->instances : 0);
    struct uarts *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    if (!ctx)
        return HM2_ERR_NOMEM;
    ctx->port = hm2_setup_alloc(setup, module->instances * sizeof *ctx->port);
    if (!ctx->port)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    for (unsigned unit = 0; unit < module->instances; unit++) {
        struct uart *const u = &ctx->port[unit];
        u->port.ops = &ops;
        u->port.plan = setup->plan;
        u->port.clock_hz = module->md->clock_hz;
        for (unsigned i = 0; i < 4; i++) {
            u->tx[i] = (uint16_t)(hm2_md_address(module->md, i, 0) + PORT_STRIDE * unit);
            u->rx[i] = (uint16_t)(hm2_md_address(rx, i, 0) + PORT_STRIDE * unit);
        }
    }
    const int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL);
    return err ? err : hm2_claim_pins(module, setup, HM2_GTAG_UART_RX, module->instances, false, NULL);
}

struct hm2_serial *uart_port(const struct hm2_module *const module, const unsigned unit)
{
    const struct uarts *const ctx = module->context;
    return &ctx->port[unit].port;
}

/* ---- reply ----------------------------------------------------------------------------------------------------------
 */

static void take(struct uart *const u, const struct hm2_window *const window, const unsigned len)
{
    uint8_t bytes[4];
    hm2_put_le32(bytes, hm2_window_get(window, 0));
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
        u->port.counts.rx_uncertain += u->unanswered[i].popped + (u->unanswered[i].fours ? POPS * POP_BYTES : 0);
    u->unanswered_count -= n;
    memmove(u->unanswered, u->unanswered + n, u->unanswered_count * sizeof u->unanswered[0]);
}

static void take_received(struct uart *const u)
{
    drop_unanswered(u, u->unanswered_count); /* a later reply is here already */
    take_bytes(u, u->asked);
    u->asked = (struct asked){0};
    const uint32_t state = hm2_window_get(&u->rx_state, 0);
    u->known = count_at(u, POPS);
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

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct uarts *const ctx = module->context;
    (void)cycle;
    for (struct uart *u = ctx->port, *const end = u + module->instances; u < end; u++) {
        if (!u->port.open || !u->awaiting)
            continue;
        u->awaiting = false;
        if (!u->resend) {
            u->port.counts.tx_bytes += u->sent_bytes;
            u->sent_bytes = 0;
        }
        const uint32_t words = hm2_window_get(&u->tx_count, 0) & COUNT_MASK;
        u->free_words = words < FIFO_WORDS ? FIFO_WORDS - words : 0;
        take_received(u);
    }
}

static void take_late(struct uart *const u, const uint64_t request)
{
    unsigned i = 0;
    if (u->asked.request == request) { /* given up, but no write was made since */
        drop_unanswered(u, u->unanswered_count);
        take_bytes(u, u->asked);
        u->asked = (struct asked){0};
        return;
    }
    while (i < u->unanswered_count && u->unanswered[i].request != request)
        i++;
    if (i == u->unanswered_count)
        return;
    drop_unanswered(u, i);
    take_bytes(u, u->unanswered[0]);
    u->unanswered[0] = (struct asked){0};
    drop_unanswered(u, 1);
}

static void late(struct hm2_module *const module, const uint64_t request)
{
    const struct uarts *const ctx = module->context;
    for (unsigned unit = 0; ctx && unit < module->instances; unit++)
        if (ctx->port[unit].port.open)
            take_late(&ctx->port[unit], request);
}

static void write_lost(struct hm2_module *const module)
{
    const struct uarts *const ctx = module->context;
    for (unsigned unit = 0; ctx && unit < module->instances; unit++)
        ctx->port[unit].resend = ctx->port[unit].sent_bytes > 0;
}

/* ---- write ----------------------------------------------------------------------------------------------------------
 */

static void miss(struct uart *const u)
{
    if (u->asked.fours) {
        if (u->unanswered_count == UNANSWERED)
            drop_unanswered(u, 1);
        u->unanswered[u->unanswered_count++] = u->asked;
    }
    u->asked = (struct asked){0};
    u->port.counts.tx_uncertain += u->sent_bytes;
    u->known = u->sent_bytes = u->free_words = 0;
    u->resend = false;
}

static void send_bytes(struct uart *const u)
{
    uint8_t bytes[4u * WORDS + 4u] = {0};
    const bool ready =
        hm2_section_confirmed(&u->tx_rate) && hm2_section_confirmed(&u->tx_mode) && hm2_section_confirmed(&u->tx_clear);
    const unsigned words = u->free_words < WORDS ? u->free_words : WORDS;
    u->sent_bytes = ready ? (unsigned)ring_get(&u->port.tx, bytes, (size_t)4u * words) : 0;
    const unsigned whole = u->sent_bytes / 4u, rest = u->sent_bytes % 4u;
    queue_aim(&u->out, whole);
    for (unsigned n = 0; n < whole; n++) {
        const struct queue_place at = queue_place(&u->out, whole, n);
        hm2_window_set(at.window, at.word, hm2_get_le32(bytes + 4u * n));
    }
    const unsigned tail = rest ? u->tx[REG_DATA] + SIZE_STRIDE * (rest - 1u) : HM2_PLAN_NOWHERE;
    hm2_put_le16(u->tail.address, (uint16_t)tail);
    hm2_window_set(&u->tail, 0, hm2_get_le32(bytes + 4u * whole));
}

static void ask_received(struct uart *const u)
{
    const bool ready = !u->again && hm2_section_confirmed(&u->rx_rate) && hm2_section_confirmed(&u->rx_clear);
    const unsigned most = (POPS + 1u) * POP_BYTES * (u->unanswered_count + 1u);
    const bool room = RING_BYTES - ring_used(&u->port.rx) >= most;
    const unsigned odd = u->known < POP_BYTES ? u->known : POP_BYTES - 1u;
    const unsigned popped = ready && room ? odd : 0;
    u->asked = (struct asked){hm2_plan_requests(u->port.plan) + 1u, popped, ready && room};
    const unsigned address = popped ? u->rx[REG_DATA] + SIZE_STRIDE * (popped - 1u) : u->rx[REG_RATE];
    hm2_put_le16(u->first.address, (uint16_t)address);
    const unsigned four = u->rx[REG_DATA] + SIZE_STRIDE * (POP_BYTES - 1u);
    for (unsigned i = 0; i < POPS; i++)
        hm2_put_le16(u->in[i].address, u->asked.fours ? (uint16_t)four : u->rx[REG_RATE]);
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct uarts *const ctx = module->context;
    (void)cycle;
    for (struct uart *u = ctx->port, *const end = u + module->instances; u < end; u++) {
        if (!u->port.open)
            continue;
        if (u->awaiting)
            miss(u);
        if (!u->resend)
            send_bytes(u);
        u->resend = false;
        ask_received(u);
        u->awaiting = true;
    }
}

const struct hm2_module_type hm2_uart_type = {
    .name = "uart",
    .gtag = HM2_GTAG_UART_TX,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_UARTS,
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

const struct hm2_module_type hm2_uart_rx_type = {
    .name = "uart_rx",
    .gtag = HM2_GTAG_UART_RX,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_UARTS,
    .setup = setup_receiver,
    .groups = groups,
};
