/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The points of a bus, its messages and their signals. */
#include "can_private.h"

#include <stdio.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

static const struct hm2_point bus_points[] = {
    HM2_POINT(struct can_bus_points, received, "frames-received", HM2_U32, HM2_PIN_OUT, 0, "",
              "frames that the kernel's filters let through"),
    HM2_POINT(struct can_bus_points, sent, "frames-sent", HM2_U32, HM2_PIN_OUT, 0, "",
              "frames handed to the interface"),
    HM2_POINT(struct can_bus_points, malformed, "frames-malformed", HM2_U32, HM2_PIN_OUT, 0, "",
              "frames shorter than their message, and float signals that are no number"),
    HM2_POINT(struct can_bus_points, overruns, "frames-lost", HM2_U32, HM2_PIN_OUT, 0, "",
              "frames that the kernel dropped because the cycle did not take them in time"),
    HM2_POINT(struct can_bus_points, full_cycles, "full-cycles", HM2_U32, HM2_PIN_OUT, 0, "",
              "cycles that took as many frames as one may take"),
    HM2_POINT(struct can_bus_points, error_frames, "error-frames", HM2_U32, HM2_PIN_OUT, 0, "",
              "error frames of the interface"),
    HM2_POINT(struct can_bus_points, bus_off, "bus-off", HM2_BIT, HM2_PIN_OUT, 0, "",
              "the controller has left the bus; until it is restarted"),
    HM2_POINT(struct can_bus_points, error_passive, "error-passive", HM2_BIT, HM2_PIN_OUT, 0, "",
              "the controller has seen more than 127 errors"),
    HM2_POINT(struct can_bus_points, error_warning, "error-warning", HM2_BIT, HM2_PIN_OUT, 0, "",
              "the controller has seen more than 96 errors"),
    HM2_POINT(struct can_bus_points, tx_error_counter, "tx-error-counter", HM2_U32, HM2_PIN_OUT, 0, "",
              "the controller's counter of transmit errors, as the last error frame gave it"),
    HM2_POINT(struct can_bus_points, rx_error_counter, "rx-error-counter", HM2_U32, HM2_PIN_OUT, 0, "",
              "the same of receive errors"),
    HM2_POINT(struct can_bus_points, down, "interface-down", HM2_BIT, HM2_PIN_OUT, 0, "",
              "the last attempt to use the interface met one that is down"),
    HM2_POINT(struct can_bus_points, hardware_stamps, "hardware-stamps", HM2_BIT, HM2_PIN_OUT, 0, "",
              "the newest frame had a time stamp of the interface's own clock"),
};

static const struct hm2_point rx_points[] = {
    HM2_POINT(struct can_rx_points, count, "rx-count", HM2_U32, HM2_PIN_OUT, 0, "", "frames of this message"),
    HM2_POINT(struct can_rx_points, age, "rx-age", HM2_FLOAT, HM2_PIN_OUT, 0, "s",
              "since the cycle that took the newest frame; before the first, since the first cycle"),
    HM2_POINT(struct can_rx_points, interval, "rx-interval", HM2_FLOAT, HM2_PIN_OUT, 0, "s",
              "between the two newest frames, by their time stamps"),
    HM2_POINT(struct can_rx_points, timed_out, "rx-timed-out", HM2_BIT, HM2_PIN_OUT, 1, "",
              "no frame yet, or none for rx-timeout-ms: the signals have their last values"),
    HM2_POINT(struct can_rx_points, timeout_ms, "rx-timeout-ms", HM2_U32, HM2_PARAM_RW, 0, "ms",
              "0 = never; at first three times GenMsgCycleTime"),
    HM2_POINT(struct can_rx_points, request, "rx-request", HM2_BIT, HM2_PIN_IO, 0, "",
              "set: ask for the message with a remote frame; cleared when it was sent"),
    HM2_POINT(struct can_rx_points, request_period_ms, "rx-request-period-ms", HM2_U32, HM2_PARAM_RW, 0, "ms",
              "ask again and again, as CANopen's node guarding does; 0 = do not"),
};

static const struct hm2_point tx_points[] = {
    HM2_POINT(struct can_tx_points, count, "tx-count", HM2_U32, HM2_PIN_OUT, 0, "", "times that it was sent"),
    HM2_POINT(struct can_tx_points, errors, "tx-errors", HM2_U32, HM2_PIN_OUT, 0, "",
              "cycles in which it was due and the interface did not take it"),
    HM2_POINT(struct can_tx_points, enable, "tx-enable", HM2_BIT, HM2_PIN_IN, 1, "", "send it at all"),
    HM2_POINT(struct can_tx_points, trigger, "tx-trigger", HM2_BIT, HM2_PIN_IO, 0, "",
              "set: send it once; cleared when it was sent"),
    HM2_POINT(struct can_tx_points, period_ms, "tx-period-ms", HM2_U32, HM2_PARAM_RW, 0, "ms",
              "send it so often, 0 = do not; at first GenMsgCycleTime"),
    HM2_POINT(struct can_tx_points, every, "tx-every", HM2_U32, HM2_PARAM_RW, 0, "cycles",
              "send it in every cycle (1), every second one (2), ...; 0 = do not"),
    HM2_POINT(struct can_tx_points, on_change, "tx-on-change", HM2_BIT, HM2_PARAM_RW, 0, "",
              "send it when its bytes change; at first as GenMsgSendType says"),
    HM2_POINT(struct can_tx_points, inhibit_ms, "tx-inhibit-ms", HM2_U32, HM2_PARAM_RW, 0, "ms",
              "pause between two frames that changes or triggers ask for"),
};

static const struct hm2_point_group groups[] = {
    {.prefix = "", .points = bus_points, .count = COUNT(bus_points)},
    {.prefix = "MESSAGE",
     .points = rx_points,
     .count = COUNT(rx_points),
     .condition = "for messages that are received"},
    {.prefix = "MESSAGE", .points = tx_points, .count = COUNT(tx_points), .condition = "for messages that are sent"},
    {0},
};

const struct hm2_point_group *hm2_can_point_groups(void)
{
    return groups;
}

static int name_message(const struct hm2_can *const can, const struct hm2_dbc_message *const m,
                        char name[HM2_NAME_SIZE], struct hm2_diag *const diag)
{
    const int len = snprintf(name, HM2_NAME_SIZE, "%s.%s", can->prefix, m->name);
    if (len < 0 || (size_t)len >= HM2_NAME_SIZE)
        return hm2_diag_add(diag, HM2_ERR_NOSPACE, "the name %s.%.100s... is too long", can->prefix, m->name);
    return 0;
}

static int bind_signals(const struct hm2_can *const can, struct can_message *const base, const char *const prefix,
                        const enum hm2_point_dir dir, struct hm2_binder *const binder, struct hm2_diag *const diag)
{
    if (base->pin_count == 0)
        return 0;
    void **const slots = binder->alloc(binder, base->pin_count * sizeof *slots);
    if (!slots)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: no memory for %u pins", prefix, base->pin_count);
    for (unsigned i = 0; i < base->pin_count; i++) {
        struct can_pin *const pin = &base->pins[i];
        const struct hm2_dbc_signal *const s = pin->signal;
        pin->value = &slots[i];
        pin->point = (struct hm2_point){.name = s->name,
                                        .type = hm2_can_type(s, can->options.floats),
                                        .dir = dir,
                                        .initial = s->start_value,
                                        .unit = s->unit,
                                        .help = "signal"};
        const int err = hm2_bind_points(binder, &pin->point, 1, pin->value, prefix, 0, diag);
        if (err)
            return err;
    }
    return 0;
}

static int bind_rx(struct hm2_can *const can, struct can_rx *const rx, struct hm2_binder *const binder,
                   struct hm2_diag *const diag)
{
    char name[HM2_NAME_SIZE];
    const uint32_t cycle_ms = rx->base.message->cycle_ms;
    int err = name_message(can, rx->base.message, name, diag);
    if (err)
        return err;
    rx->points = binder->alloc(binder, sizeof *rx->points);
    if (!rx->points)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: no memory for its pins", name);
    err = hm2_bind_points(binder, rx_points, COUNT(rx_points), rx->points, name, 0, diag);
    if (err)
        return err;
    *rx->points->timeout_ms = cycle_ms <= UINT32_MAX / 3u ? 3u * cycle_ms : UINT32_MAX;
    return bind_signals(can, &rx->base, name, HM2_PIN_OUT, binder, diag);
}

static int bind_tx(struct hm2_can *const can, struct can_tx *const tx, struct hm2_binder *const binder,
                   struct hm2_diag *const diag)
{
    char name[HM2_NAME_SIZE];
    int err = name_message(can, tx->base.message, name, diag);
    if (err)
        return err;
    tx->points = binder->alloc(binder, sizeof *tx->points);
    if (!tx->points)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: no memory for its pins", name);
    err = hm2_bind_points(binder, tx_points, COUNT(tx_points), tx->points, name, 0, diag);
    if (err)
        return err;
    *tx->points->period_ms = tx->base.message->cycle_ms;
    *tx->points->on_change = tx->base.message->on_change;
    return bind_signals(can, &tx->base, name, HM2_PIN_IN, binder, diag);
}

int hm2_can_setup(struct hm2_can *const can, struct hm2_can_bus *const bus, struct hm2_binder *const binder,
                  struct hm2_diag *const diag)
{
    can->bus = bus;
    can->points = binder->alloc(binder, sizeof *can->points);
    if (!can->points)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: no memory for its pins", can->prefix);
    int err = hm2_bind_points(binder, bus_points, COUNT(bus_points), can->points, can->prefix, 0, diag);
    for (unsigned i = 0; !err && i < can->rx_count; i++)
        err = bind_rx(can, &can->rx[i], binder, diag);
    for (unsigned i = 0; !err && i < can->tx_count; i++)
        err = bind_tx(can, &can->tx[i], binder, diag);
    return err;
}
