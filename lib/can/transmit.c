/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* From the pins to the bus. */
#include "can_private.h"

#include <string.h>

static bool hand_over(struct hm2_can *const can, const struct hm2_can_frame *const frame)
{
    const int err = can->bus->ops->send(can->bus, frame);
    if (err != HM2_ERR_NOSPACE)
        can_set_down(can, err != 0);
    if (!err)
        ++*can->points->sent;
    return !err;
}

/* ---- messages of ours
 * ------------------------------------------------------------------------------------------------ */

/* Bits of no signal are 0. A pin that is no number leaves its signal as it was sent last. */
static void encode(const struct hm2_can *const can, const struct can_tx *const tx, uint8_t data[HM2_CAN_MAX_BYTES])
{
    memset(data, 0, HM2_CAN_MAX_BYTES);
    for (unsigned i = 0; i < tx->base.pin_count; i++) {
        const struct can_pin *const pin = &tx->base.pins[i];
        if (tx->base.multiplexed && !hm2_dbc_present(can->dbc, pin->signal, data))
            continue;
        if (!hm2_dbc_put_value(pin->signal, data, hm2_point_load(pin->point.type, *pin->value)))
            hm2_dbc_put_raw(pin->signal, data, hm2_dbc_raw(pin->signal, tx->data));
    }
}

/* Behind by more than a period, as after a pause, it goes on from now. */
static bool period_is_over(struct can_tx *const tx, const int64_t now_ns)
{
    const int64_t period_ns = *tx->points->period_ms * NS_PER_MS;
    if (period_ns == 0) {
        tx->runs = false;
        return false;
    }
    if (tx->runs && now_ns < tx->due_ns)
        return false;
    tx->due_ns = tx->runs && now_ns - tx->due_ns < period_ns ? tx->due_ns + period_ns : now_ns + period_ns;
    tx->runs = true;
    return true;
}

static bool turn_has_come(struct can_tx *const tx)
{
    const uint32_t every = *tx->points->every;
    if (every == 0)
        return false;
    if (++tx->cycles < every)
        return false;
    tx->cycles = 0;
    return true;
}

/* Changes and triggers may have to wait for the pause; what is sent then is the newest. */
static bool is_asked_for(const struct can_tx *const tx, const uint8_t *const data, const int64_t now_ns)
{
    if (tx->sent && now_ns - tx->sent_ns < *tx->points->inhibit_ms * NS_PER_MS)
        return false;
    return *tx->points->trigger ||
           (*tx->points->on_change && (!tx->sent || memcmp(data, tx->data, tx->base.message->bytes) != 0));
}

static void send_message(struct hm2_can *const can, struct can_tx *const tx, const uint8_t *const data,
                         const int64_t now_ns)
{
    const struct hm2_dbc_message *const m = tx->base.message;
    struct hm2_can_frame frame = {.id = m->id, .extended = m->extended, .fd = m->fd, .bytes = m->bytes};
    memcpy(frame.data, data, HM2_CAN_MAX_BYTES);
    tx->pending = !hand_over(can, &frame);
    if (tx->pending) {
        ++*tx->points->errors;
        return;
    }
    memcpy(tx->data, data, HM2_CAN_MAX_BYTES);
    tx->sent = true;
    tx->sent_ns = now_ns;
    *tx->points->trigger = false;
    ++*tx->points->count;
}

static void write_message(struct hm2_can *const can, struct can_tx *const tx, const int64_t now_ns)
{
    uint8_t data[HM2_CAN_MAX_BYTES];
    if (!*tx->points->enable) {
        tx->pending = tx->runs = tx->sent = false;
        tx->cycles = 0;
        *tx->points->trigger = false;
        return;
    }
    const bool over = period_is_over(tx, now_ns), turn = turn_has_come(tx);
    if (!over && !turn && !tx->pending && !*tx->points->on_change && !*tx->points->trigger)
        return;
    encode(can, tx, data);
    if (over || turn || tx->pending || is_asked_for(tx, data, now_ns))
        send_message(can, tx, data, now_ns);
}

/* ---- asking for messages of others
 * ----------------------------------------------------------------------------------- */

static void request_message(struct hm2_can *const can, struct can_rx *const rx, const int64_t now_ns)
{
    const int64_t period_ns = *rx->points->request_period_ms * NS_PER_MS;
    const struct hm2_dbc_message *const m = rx->base.message;
    if (period_ns != 0 && now_ns >= rx->request_due_ns) {
        rx->request_due_ns =
            now_ns - rx->request_due_ns < period_ns ? rx->request_due_ns + period_ns : now_ns + period_ns;
        *rx->points->request = true;
    }
    if (!*rx->points->request || m->bytes > 8u)
        return;
    const struct hm2_can_frame frame = {.id = m->id, .extended = m->extended, .remote = true, .bytes = m->bytes};
    if (hand_over(can, &frame))
        *rx->points->request = false;
}

void hm2_can_write(struct hm2_can *const can, const int64_t now_ns)
{
    for (unsigned i = 0; i < can->tx_count; i++)
        write_message(can, &can->tx[i], now_ns);
    for (unsigned i = 0; i < can->rx_count; i++)
        request_message(can, &can->rx[i], now_ns);
}
