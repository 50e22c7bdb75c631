/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The adaptive deadline of plain cycles: a reply that is later than nearly all others were is taken for lost, so that a
 * loss costs little more than a round trip; and the second request, which makes it cost no cycle. packet-read-timeout
 * stays the last deadline. Realtime safe.
 */
#ifndef BOARD_ADAPTIVE_H
#define BOARD_ADAPTIVE_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/points.h>

struct hm2_board;

struct board_adaptive_points {
    hm2_float_t *deadline_us;
    hm2_u32_t *requests, *saved;
};

struct board_adaptive {
    bool on, asks_again;
    bool asked_again;  /* in this cycle */
    unsigned stretch;  /* doublings of the patience, after losses */
    unsigned calm;     /* good replies since the last loss */
    int64_t usual_ns;  /* twice what nearly all replies need */
    uint32_t computed; /* cycle in which it was */
    struct board_adaptive_points *points;
};

/* How long after the request to wait for its reply; when it will be asked for again, at most half of limit_ns. */
int64_t board_adaptive_patience_ns(struct hm2_board *board, int64_t limit_ns);
/* Send the outstanding request once more, when that is wanted and harmless. */
bool board_adaptive_ask_again(struct hm2_board *board);
/* A plain cycle had its reply, or not. */
void board_adaptive_received(struct hm2_board *board);
void board_adaptive_lost(struct hm2_board *board);

#endif
