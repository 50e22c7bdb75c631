/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The ring of the flight recorder. The cycle's thread writes it; once it is frozen only the reader touches it. */
#ifndef BOARD_FLIGHT_H
#define BOARD_FLIGHT_H

#include <stdatomic.h>

#include <hm2/flight.h>
#include <hm2/points.h>

struct board_flight_points {
    hm2_bit_t *freeze;
    hm2_u32_t *freezes;
};

struct board_flight {
    struct board_flight_points *points;
    struct hm2_flight_cycle *now; /* the present cycle in the ring; NULL = none, or frozen */
    uint32_t begun;               /* cycles recorded so far, wraps with the ring's places */
    uint32_t kept;                /* places of the ring in use */
    uint32_t mask;                /* places - 1, a power of two less one */
    uint32_t left;                /* cycles until it freezes; 0 = nothing has happened */
    uint32_t bad_datagrams;       /* of the board in all, when the present cycle began */
    int64_t slow_ns;              /* 0 = no limit */
    int64_t last_start_ns;
    struct hm2_flight_head head;
    atomic_bool frozen;
    struct hm2_flight_cycle ring[];
};

/* Realtime safe, all of them. bad_datagrams: late, stale and malformed ones of the board so far. */
void board_flight_begin(struct board_flight *flight, int64_t start_ns, int64_t sent_ns, int64_t period_ns,
                        size_t request_bytes, uint32_t bad_datagrams);
void board_flight_decoded(struct board_flight *flight, int64_t received_ns, int64_t decoded_ns, size_t reply_bytes,
                          unsigned flags, uint32_t bad_datagrams);
void board_flight_written(struct board_flight *flight, int64_t write_ns, int64_t written_ns, size_t write_bytes);

#endif
