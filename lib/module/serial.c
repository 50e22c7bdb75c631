/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "serial.h"

#include <string.h>

/* ---- rings ----------------------------------------------------------------------------------------------------------
 */

static size_t smaller(const size_t a, const size_t b)
{
    return a < b ? a : b;
}

size_t ring_put(struct ring *const ring, const uint8_t *const bytes, const size_t len)
{
    const unsigned head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    const size_t taken = smaller(len, RING_BYTES - ring_used(ring));
    for (size_t i = 0; i < taken; i++)
        ring->byte[(head + i) % RING_BYTES] = bytes[i];
    atomic_store_explicit(&ring->head, head + (unsigned)taken, memory_order_release);
    return taken;
}

size_t ring_get(struct ring *const ring, uint8_t *const bytes, const size_t size)
{
    const unsigned tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    const size_t given = smaller(size, ring_used(ring));
    for (size_t i = 0; i < given; i++)
        bytes[i] = ring->byte[(tail + i) % RING_BYTES];
    atomic_store_explicit(&ring->tail, tail + (unsigned)given, memory_order_release);
    return given;
}

void ring_drop(struct ring *const ring, const size_t len)
{
    const unsigned tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    atomic_store_explicit(&ring->tail, tail + (unsigned)smaller(len, ring_used(ring)), memory_order_release);
}

/* ---- queues ---------------------------------------------------------------------------------------------------------
 */

int queue_add_reads(struct queue *const queue, struct hm2_plan *const plan, const unsigned blocks,
                    struct hm2_diag *const diag)
{
    int err = 0;
    queue->blocks = blocks;
    for (unsigned i = 0; i < blocks && !err; i++)
        err = hm2_plan_add_queue_read(plan, &queue->block[i], queue->nowhere, 1u << i, diag);
    return err;
}

int queue_add_writes(struct queue *const queue, struct hm2_plan *const plan, const unsigned blocks,
                     struct hm2_diag *const diag)
{
    int err = 0;
    queue->blocks = blocks;
    for (unsigned i = 0; i < blocks && !err; i++)
        err = hm2_plan_add_queue_write(plan, &queue->block[i], queue->nowhere, 1u << i, diag);
    return err;
}

void queue_aim(struct queue *const queue, const unsigned words)
{
    for (unsigned i = 0; i < queue->blocks; i++)
        hm2_put_le16(queue->block[i].address, words >> i & 1u ? queue->fifo : queue->nowhere);
}

struct queue_place queue_place(struct queue *const queue, const unsigned words, unsigned n)
{
    unsigned i = 0;
    for (; i + 1u < queue->blocks; i++) {
        const unsigned size = words & 1u << i;
        if (n < size)
            break;
        n -= size;
    }
    return (struct queue_place){&queue->block[i], n};
}

/* ---- ports ----------------------------------------------------------------------------------------------------------
 */

struct hm2_serial *hm2_serial_port(struct hm2_board *const board, const enum hm2_serial_kind kind, const unsigned unit)
{
    const bool uart = kind == HM2_SERIAL_UART;
    const struct hm2_module *const module = hm2_board_module(board, uart ? HM2_GTAG_UART_TX : HM2_GTAG_PKTUART_TX);
    return module ? serial_port(module, unit) : NULL;
}

int hm2_serial_open(struct hm2_serial *const port, struct hm2_diag *const diag)
{
    const int err = port->open ? 0 : port->ops->open(port, diag);
    port->open = port->open || err == 0;
    return err;
}

int hm2_serial_set(struct hm2_serial *const port, const struct hm2_serial_settings *const settings,
                   struct hm2_diag *const diag)
{
    if (!port->open)
        return hm2_diag_add(diag, HM2_ERR_STATE, "a serial port is set after it has been opened");
    int err = serial_check(port, settings, diag);
    if (!err)
        err = port->ops->set(port, settings, diag);
    if (err)
        return err;
    if (settings->frames || port->settings.frames)
        serial_drop_frames(port);
    port->settings = *settings;
    /* The transmitter is cleared: of what was on its way nobody knows how much it has sent. */
    port->counts.tx_uncertain += port->sent_bytes;
    port->sent_bytes = 0;
    port->held = port->resend = false;
    return 0;
}

struct hm2_serial_settings hm2_serial_current(const struct hm2_serial *const port)
{
    return port->settings;
}

int serial_check(const struct hm2_serial *const port, const struct hm2_serial_settings *const settings,
                 struct hm2_diag *const diag)
{
    if (settings->baud == 0 || settings->baud > port->clock_hz / 4.0)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "%u baud found, 1 to %.0f expected", settings->baud,
                            port->clock_hz / 4.0);
    if (settings->drive_delay_clk > 15)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "a drive delay of %u clocks found, 0 to 15 expected",
                            settings->drive_delay_clk);
    return 0;
}

/* rate = baud * 2^bits / clock, rounded to the nearest: LinuxCNC's driver rounds down. */
uint32_t serial_rate(const struct hm2_serial *const port, const uint32_t baud, const unsigned bits)
{
    const double rate = (double)baud * (double)(1u << bits) / port->clock_hz + 0.5;
    return rate < 1.0 ? 1u : (uint32_t)rate;
}

size_t hm2_serial_put(struct hm2_serial *const port, const uint8_t *const bytes, const size_t len)
{
    return port->settings.frames ? 0 : ring_put(&port->tx, bytes, len);
}

size_t hm2_serial_get(struct hm2_serial *const port, uint8_t *const bytes, const size_t size)
{
    return port->settings.frames ? 0 : ring_get(&port->rx, bytes, size);
}

size_t hm2_serial_waiting(const struct hm2_serial *const port)
{
    return ring_used(&port->tx);
}

struct hm2_serial_counts hm2_serial_counts(const struct hm2_serial *const port)
{
    uint32_t values[SERIAL_COUNTS] = {0};
    struct hm2_serial_counts counts;
    for (size_t i = 0; i < SERIAL_COUNTS; i++)
        values[i] = atomic_load_explicit(&port->shown[i], memory_order_relaxed);
    memcpy(&counts, values, sizeof counts);
    return counts;
}

static void show_counts(struct hm2_serial *const port)
{
    uint32_t values[SERIAL_COUNTS];
    memcpy(values, &port->counts, sizeof values);
    for (size_t i = 0; i < SERIAL_COUNTS; i++)
        atomic_store_explicit(&port->shown[i], values[i], memory_order_relaxed);
}

/* ---- the ports of a module ------------------------------------------------------------------------------------------
 */

struct ports {
    bool tallied;
    struct hm2_plan_tally tally;   /* as of the last good reply */
    struct serial_passage passage; /* up to it, when it is told */
    struct hm2_serial *port[];
};

static void locate(struct hm2_serial *const port, const struct hm2_md *const tx, const struct hm2_md *const rx,
                   const unsigned unit, const unsigned unit_stride)
{
    for (unsigned i = 0; i < SERIAL_REGISTERS; i++) {
        const unsigned there = unit_stride ? 0 : unit, beyond = unit_stride * unit;
        port->tx_reg[i] = (uint16_t)(hm2_md_address(tx, i, there) + beyond);
        port->rx_reg[i] = (uint16_t)(hm2_md_address(rx, i, there) + beyond);
    }
}

int serial_setup(struct hm2_module *const module, struct hm2_setup *const setup, const struct serial_kind *const kind)
{
    const struct hm2_md *const rx = hm2_idrom_find(setup->idrom, kind->rx_gtag);
    if (!rx || rx->instances < module->instances)
        return hm2_diag_add(setup->diag, HM2_ERR_MISMATCH, "%s: the firmware has %u %s transmitters and %u receivers",
                            setup->prefix, module->md->instances, kind->title, rx ? rx->instances : 0);
    struct ports *const ports = hm2_setup_alloc(setup, sizeof *ports + module->instances * sizeof(struct hm2_serial *));
    if (!ports)
        return HM2_ERR_NOMEM;
    for (unsigned unit = 0; unit < module->instances; unit++) {
        struct hm2_serial *const port = ports->port[unit] = hm2_setup_alloc(setup, kind->size);
        if (!port)
            return HM2_ERR_NOMEM;
        port->ops = kind->ops;
        port->plan = setup->plan;
        port->clock_hz = module->md->clock_hz;
        locate(port, module->md, rx, unit, kind->unit_stride);
    }
    module->context = ports;
    const int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL);
    return err ? err : hm2_claim_pins(module, setup, kind->rx_gtag, module->instances, false, NULL);
}

int serial_setup_receiver(struct hm2_module *const module, struct hm2_setup *const setup)
{
    (void)module;
    (void)setup;
    return 0;
}

const char *serial_output_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"tx", "tx-drv-en"};
    const unsigned number = pd->secondary_pin - (HM2_PIN_OUTPUT | 1u);
    return number < sizeof names / sizeof names[0] ? names[number] : NULL;
}

struct hm2_serial *serial_port(const struct hm2_module *const module, const unsigned unit)
{
    const struct ports *const ports = module->context;
    return ports && unit < module->instances ? ports->port[unit] : NULL;
}

static struct hm2_serial *open_port(const struct hm2_module *const module, const unsigned unit)
{
    struct hm2_serial *const port = serial_port(module, unit);
    return port && port->open ? port : NULL;
}

/* The card may have another count now. */
void serial_start(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct ports *const ports = module->context;
    (void)cycle;
    if (ports)
        ports->tallied = false;
}

static unsigned risen(const uint16_t now, const uint16_t before)
{
    return hm2_delta16(now, before) > 0 ? (unsigned)hm2_delta16(now, before) : 0;
}

/* The request before was answered: a card that has not counted that tells nothing. When it has sent no other reply, no
 * other request has come. */
HM2_RARE static struct serial_passage compare(const struct hm2_plan_tally *const now,
                                              const struct hm2_plan_tally *const before)
{
    const uint16_t answered = (uint16_t)(now->answered - before->answered);
    if (answered == 0)
        return (struct serial_passage){0};
    return (struct serial_passage){.told = true,
                                   .twice = risen(now->requests, before->requests),
                                   .writes_twice = risen(now->writes, before->writes),
                                   .unheard = answered == 1u};
}

static inline void look_back(struct ports *const ports, const struct hm2_plan *const plan)
{
    const struct hm2_plan_tally now = hm2_plan_tally(plan), before = ports->tally;
    const bool differs = now.requests != before.requests || now.writes != before.writes;
    ports->passage.told = differs && ports->tallied;
    if (ports->passage.told)
        ports->passage = compare(&now, &before);
    ports->tally = now;
    ports->tallied = true;
}

/* Whoever sees a stray request knows that one more came, also when another was lost. */
HM2_RARE static void see_passage(struct hm2_serial *const port, const struct serial_passage *const passage)
{
    port->passage = passage->told ? *passage : (struct serial_passage){.told = port->stray};
    port->passage.stray = port->stray;
    if (port->stray && port->passage.twice == 0)
        port->passage.twice = 1;
    port->stray = false;
}

/* What a write handed to the card may have come to it twice: that of a turn before the last reply, that of a plain
 * cycle behind it. */
HM2_RARE static void count_twice(struct hm2_serial *const port, const bool in_this_turn)
{
    if (port->passage.twice > 0)
        port->counts.tx_uncertain += port->turned_bytes;
    if (port->passage.writes_twice > 0 && !in_this_turn)
        port->counts.tx_uncertain += port->sent_bytes;
}

static inline void look_for_doubles(struct hm2_serial *const port, const struct serial_passage *const passage,
                                    const bool turned)
{
    const bool in_this_turn = turned && !port->held;
    if (passage->told || port->passage.told || port->stray) {
        see_passage(port, passage);
        count_twice(port, in_this_turn);
    }
    port->turned_bytes = in_this_turn ? port->sent_bytes : 0;
}

/* The reply to the turn behind one that had none: are the bytes of that one in the card? This one had no bytes. */
HM2_RARE static void take_held(struct hm2_serial *const port, const struct hm2_cycle *const cycle)
{
    const unsigned bytes = port->sent_bytes;
    port->held = false;
    port->sent_bytes = 0;
    port->resend = cycle->turned && !cycle->before_kept;
    port->ops->take(port);
    if (port->resend)
        port->turned_bytes = port->sent_bytes = bytes; /* that turn may still come */
    else if (cycle->turned)
        port->counts.tx_bytes += bytes;
    else
        port->counts.tx_uncertain += bytes;
}

static void take(struct hm2_serial *const port)
{
    if (!port->resend)
        port->counts.tx_bytes += port->sent_bytes;
    port->ops->take(port);
    if (!port->resend)
        port->sent_bytes = 0;
}

void serial_unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct ports *const ports = module->context;
    bool looked = false;
    for (unsigned unit = 0; unit < module->instances; unit++) {
        struct hm2_serial *const port = open_port(module, unit);
        if (!port || !port->awaiting)
            continue;
        if (!looked)
            look_back(ports, port->plan);
        looked = true;
        port->awaiting = false;
        port->sent_ns = cycle->now_ns;
        port->now_ns = cycle->received_ns;
        look_for_doubles(port, &ports->passage, cycle->turned);
        if (port->held)
            take_held(port, cycle);
        else
            take(port);
        show_counts(port);
    }
}

void serial_late(struct hm2_module *const module, const uint64_t request, const int64_t now_ns)
{
    for (unsigned unit = 0; unit < module->instances; unit++) {
        struct hm2_serial *const port = open_port(module, unit);
        if (!port)
            continue;
        port->now_ns = now_ns;
        port->stray = !port->ops->late(port, request) || port->stray;
        show_counts(port);
    }
}

void serial_write_lost(struct hm2_module *const module)
{
    for (unsigned unit = 0; unit < module->instances; unit++) {
        struct hm2_serial *const port = open_port(module, unit);
        if (port)
            port->resend = port->sent_bytes > 0;
    }
}

/* Nobody knows what the card sent; of a turn the next reply tells it, when that comes. */
static void miss(struct hm2_serial *const port, const bool turned)
{
    port->resend = false;
    port->held = port->ops->miss(port, turned && !port->held && port->sent_bytes > 0);
    if (port->held)
        return;
    port->counts.tx_uncertain += port->sent_bytes;
    port->sent_bytes = 0;
}

/* The words of the last write stay in it for the case that they have to be sent again. */
static void send(struct hm2_serial *const port)
{
    if (port->held)
        port->ops->aim(port, 0);
    else if (port->resend)
        port->ops->aim(port, port->sent_bytes);
    else
        port->ops->send(port);
    port->resend = false;
}

void serial_pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    for (unsigned unit = 0; unit < module->instances; unit++) {
        struct hm2_serial *const port = open_port(module, unit);
        if (!port)
            continue;
        port->now_ns = cycle->now_ns;
        if (port->awaiting)
            miss(port, cycle->turned);
        send(port);
        port->ops->ask(port);
        port->awaiting = true;
        show_counts(port);
    }
}
