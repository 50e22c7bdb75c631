/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* From the bus to the pins. */
#include "can_private.h"

#include <string.h>

#include <hm2/number.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define S_PER_NS     1e-9

static struct can_rx *find_rx(const struct hm2_can *const can, const uint32_t key)
{
    unsigned low = 0, high = can->rx_count;
    while (low < high) {
        const unsigned middle = low + (high - low) / 2u;
        const struct hm2_dbc_message *const m = can->rx[middle].base.message;
        const uint32_t found = can_key(m->id, m->extended);
        if (found == key)
            return &can->rx[middle];
        if (found < key)
            low = middle + 1u;
        else
            high = middle;
    }
    return NULL;
}

static void apply(struct hm2_can *const can, struct can_rx *const rx)
{
    for (unsigned i = 0; i < rx->base.pin_count; i++) {
        const struct can_pin *const pin = &rx->base.pins[i];
        if (rx->base.multiplexed && !hm2_dbc_present(can->dbc, pin->signal, rx->data))
            continue;
        const double value = hm2_dbc_value(pin->signal, rx->data);
        if (value - value == 0.0) /* neither NaN nor infinite */
            hm2_point_store(pin->point.type, *pin->value, value);
        else
            ++*can->points->malformed;
    }
    rx->fresh = false;
}

static void take_data(struct hm2_can *const can, struct can_rx *const rx, const struct hm2_can_frame *const frame,
                      const int64_t now_ns)
{
    if (frame->bytes < rx->base.message->bytes) {
        ++*can->points->malformed;
        return;
    }
    memcpy(rx->data, frame->data, frame->bytes);
    if (rx->received && frame->stamp_ns && rx->stamp_ns)
        *rx->points->interval = (double)(frame->stamp_ns - rx->stamp_ns) * S_PER_NS;
    rx->stamp_ns = frame->stamp_ns;
    rx->at_ns = now_ns;
    rx->received = true;
    rx->fresh = true;
    rx->cut = false;
    ++*rx->points->count;
    *can->points->hardware_stamps = frame->hardware_stamp;
    if (rx->base.multiplexed) /* the next frame may bring other signals */
        apply(can, rx);
}

static void take_frame(struct hm2_can *const can, const struct hm2_can_frame *const frame, const int64_t now_ns)
{
    if (frame->error) {
        can_error_frame(can, frame);
        return;
    }
    ++*can->points->received;
    struct can_rx *const rx = find_rx(can, can_key(frame->id, frame->extended));
    if (rx && !frame->remote)
        take_data(can, rx, frame, now_ns);
}

static void take_frames(struct hm2_can *const can, const int64_t now_ns)
{
    for (unsigned taken = 0; taken < HM2_CAN_FRAMES_PER_CYCLE;) {
        const int count = can->bus->ops->receive(can->bus, can->frames, COUNT(can->frames));
        if (count != 0)
            can_set_down(can, count < 0);
        for (int i = 0; i < count; i++)
            take_frame(can, &can->frames[i], now_ns);
        if (count < (int)COUNT(can->frames))
            return;
        taken += (unsigned)count;
    }
    ++*can->points->full_cycles;
}

static void show_age(const struct hm2_can *const can, const struct can_rx *const rx, const int64_t now_ns)
{
    const int64_t age_ns = now_ns - (rx->received ? rx->at_ns : can->started_ns);
    const int64_t timeout_ns = *rx->points->timeout_ms * NS_PER_MS;
    *rx->points->age = (double)age_ns * S_PER_NS;
    *rx->points->timed_out = !rx->received || rx->cut || (timeout_ns != 0 && age_ns > timeout_ns);
}

/* ---- a bus that is lost, and comes back
 * --------------------------------------------------------------------------------- */

void can_lost(struct hm2_can *const can)
{
    for (unsigned i = 0; i < can->rx_count; i++)
        can->rx[i].cut = true;
    for (unsigned i = 0; i < can->tx_count; i++)
        can->tx[i].sent = false;
}

void can_set_down(struct hm2_can *const can, const bool down)
{
    if (down && !*can->points->down)
        can_lost(can);
    *can->points->down = down;
}

/* What was sent into a bus-off controller was lost, too. */
static void set_bus_off(struct hm2_can *const can, const bool bus_off)
{
    if (bus_off != *can->points->bus_off)
        can_lost(can);
    *can->points->bus_off = bus_off;
    if (!bus_off)
        *can->points->error_passive = *can->points->error_warning = false;
}

static void take_bus(struct hm2_can *const can)
{
    if (!atomic_load_explicit(&can->next_bus, memory_order_relaxed) || atomic_load(&can->old_bus))
        return;
    struct hm2_can_bus *const old = can->bus;
    can->bus = atomic_exchange(&can->next_bus, NULL);
    can->old_overruns += old->overruns;
    atomic_store(&can->old_bus, old);
    can_lost(can);
    *can->points->down = false;
}

void hm2_can_tell_bus_off(struct hm2_can *const can, const bool bus_off)
{
    atomic_store(&can->told, bus_off ? CAN_TOLD_BUS_OFF : CAN_TOLD_ON_BUS);
}

static void hear_state(struct hm2_can *const can)
{
    const int told = atomic_exchange(&can->told, CAN_TOLD_NOTHING);
    if (told != CAN_TOLD_NOTHING)
        set_bus_off(can, told == CAN_TOLD_BUS_OFF);
}

void hm2_can_read(struct hm2_can *const can, const int64_t now_ns)
{
    if (!can->started)
        can->started_ns = now_ns;
    can->started = true;
    take_bus(can);
    hear_state(can);
    take_frames(can, now_ns);
    for (unsigned i = 0; i < can->rx_count; i++) {
        if (can->rx[i].fresh)
            apply(can, &can->rx[i]);
        show_age(can, &can->rx[i], now_ns);
    }
    *can->points->overruns = can->old_overruns + can->bus->overruns;
}

/* ---- error frames (linux/can/error.h)
 * -------------------------------------------------------------------------------- */

#define ERROR_CONTROLLER 0x004u /* data[1] has the controller's state */
#define ERROR_BUS_OFF    0x040u
#define ERROR_RESTARTED  0x100u
#define ERROR_COUNTERS   0x200u /* data[6] and data[7] are the counters */
#define STATE_WARNING    0x0Cu  /* of receiving or sending */
#define STATE_PASSIVE    0x30u
#define STATE_ACTIVE     0x40u

void can_error_frame(struct hm2_can *const can, const struct hm2_can_frame *const frame)
{
    const struct can_bus_points *const p = can->points;
    ++*p->error_frames;
    if (frame->id & ERROR_CONTROLLER && frame->data[1] & (STATE_WARNING | STATE_PASSIVE | STATE_ACTIVE)) {
        *p->error_passive = (frame->data[1] & STATE_PASSIVE) != 0;
        *p->error_warning = (frame->data[1] & (STATE_WARNING | STATE_PASSIVE)) != 0;
    }
    if (frame->id & ERROR_COUNTERS) {
        *p->tx_error_counter = frame->data[6];
        *p->rx_error_counter = frame->data[7];
    }
    if (frame->id & ERROR_BUS_OFF)
        set_bus_off(can, true);
    if (frame->id & ERROR_RESTARTED)
        set_bus_off(can, false);
}
