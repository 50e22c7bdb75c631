/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * How long replies take: a histogram of bounded size, eight steps an octave, that forgets slowly. Integers only; adding
 * and asking are realtime safe.
 */
#ifndef BOARD_RTT_H
#define BOARD_RTT_H

#include <stdint.h>

#define BOARD_RTT_STEPS 128u

struct board_rtt {
    uint32_t total;
    uint16_t count[BOARD_RTT_STEPS];
};

void board_rtt_add(struct board_rtt *rtt, int64_t ns);
/* A time that at most `above` of 1024 replies exceed; 0 when none is known. */
int64_t board_rtt_bound_ns(const struct board_rtt *rtt, uint32_t above);

#endif
