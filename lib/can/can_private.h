/* SPDX-License-Identifier: LGPL-2.1-or-later */
#ifndef HM2_CAN_PRIVATE_H
#define HM2_CAN_PRIVATE_H

#include <stdatomic.h>

#include <hm2/can.h>

#define NS_PER_MS INT64_C(1000000)

/* A pin and the signal behind it. */
struct can_pin {
    const struct hm2_dbc_signal *signal;
    struct hm2_point point;
    void **value; /* in the host's memory */
};

/* What both kinds of messages have. */
struct can_message {
    const struct hm2_dbc_message *message;
    struct can_pin *pins;
    unsigned pin_count;
    bool multiplexed;
};

struct can_rx_points {
    hm2_u32_t *count, *timeout_ms, *request_period_ms;
    hm2_float_t *age, *interval;
    hm2_bit_t *timed_out, *request;
};

struct can_rx {
    struct can_message base;
    struct can_rx_points *points;
    int64_t at_ns, stamp_ns; /* of the newest frame */
    int64_t request_due_ns;
    bool received; /* ever */
    bool fresh;    /* data came in this cycle and is not applied yet */
    bool cut;      /* the bus was lost after the newest frame */
    uint8_t data[HM2_CAN_MAX_BYTES];
};

struct can_tx_points {
    hm2_u32_t *count, *errors, *period_ms, *inhibit_ms, *every;
    hm2_bit_t *enable, *trigger, *on_change;
};

struct can_tx {
    struct can_message base;
    struct can_tx_points *points;
    int64_t due_ns, sent_ns;
    uint32_t cycles; /* since it was sent for tx-every */
    bool runs;       /* the period has begun */
    bool pending;    /* due, and not sent yet */
    bool sent;       /* ever: data is what was sent last */
    uint8_t data[HM2_CAN_MAX_BYTES];
};

struct can_bus_points {
    hm2_u32_t *received, *sent, *malformed, *overruns, *error_frames, *full_cycles, *tx_error_counter,
        *rx_error_counter;
    hm2_bit_t *bus_off, *error_passive, *error_warning, *hardware_stamps, *down;
};

enum can_told { CAN_TOLD_NOTHING, CAN_TOLD_ON_BUS, CAN_TOLD_BUS_OFF };

struct hm2_can {
    const struct hm2_dbc *dbc;
    struct hm2_can_options options;
    int node;
    struct hm2_can_bus *bus;
    /* Handed over by another thread, and back to it. */
    _Atomic(struct hm2_can_bus *) next_bus, old_bus;
    uint32_t old_overruns; /* of the buses before */
    struct can_bus_points *points;
    struct can_rx *rx; /* in the order of their keys */
    unsigned rx_count;
    struct can_tx *tx; /* in the order of the file */
    unsigned tx_count;
    atomic_int told; /* enum can_told, of another thread */
    int64_t started_ns;
    bool started;
    struct hm2_can_frame frames[32];
    char prefix[HM2_NAME_SIZE];
};

/* One number for both kinds of identifiers. */
static inline uint32_t can_key(const uint32_t id, const bool extended)
{
    return id | (extended ? 0x80000000u : 0);
}

/* What was received counts as old, and what is sent on change as not sent. */
void can_lost(struct hm2_can *can);
void can_set_down(struct hm2_can *can, bool down);
void can_error_frame(struct hm2_can *can, const struct hm2_can_frame *frame);

#endif
