/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A simulated remote on a serial line: what its processor does with the bytes (seed 003, chapter "LBP";
 * tests/data/lbp).
 */
#ifndef SIM_REMOTE_LBP_H
#define SIM_REMOTE_LBP_H

#include <hm2/lbp.h>

#include "remote.h"

#define REMOTE_LOCALS 32u

struct remote_lbp {
    struct remote *remote; /* the caller's */
    uint32_t baud;
    struct lbp_parser parser;
    uint16_t pointer;
    uint8_t local[REMOTE_LOCALS]; /* read by C0 + n, written by E0 + n */
    uint64_t commands, bad;       /* counts */
};

void remote_lbp_init(struct remote_lbp *line, struct remote *remote, uint32_t baud);
/* A byte arrives. Returns the length of the answer, 0 = none (yet). */
size_t remote_lbp_take(struct remote_lbp *line, uint8_t byte, int64_t now_ns, uint8_t answer[LBP_MESSAGE_BYTES]);

#endif
