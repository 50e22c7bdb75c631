/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A simulated remote on a serial line: what its processor does with the bytes (seed 003, chapter "LBP";
 * tests/data/lbp).
 *
 * Flash, for new firmware, as LinuxCNC's setsserial programs it: an offset, a page buffer at the lowest addresses, and
 * a byte that erases a block or writes the page. Block 0 holds the loader and is not erased or written.
 */
#ifndef SIM_REMOTE_LBP_H
#define SIM_REMOTE_LBP_H

#include <hm2/lbp.h>

#include "remote.h"

#define REMOTE_FLASH_BYTES 0x8000u
#define REMOTE_PAGE_LOG2   6u
#define REMOTE_BLOCK_LOG2  9u
#define REMOTE_LOCALS      32u

struct remote_flash {
    uint8_t bytes[REMOTE_FLASH_BYTES], page[1u << REMOTE_PAGE_LOG2];
    uint32_t offset;
};

struct remote_lbp {
    struct remote *remote; /* the caller's */
    uint32_t baud;
    struct lbp_parser parser;
    uint16_t pointer;
    uint8_t memory;               /* enum lbp_memory */
    uint8_t local[REMOTE_LOCALS]; /* read by C0 + n, written by E0 + n */
    struct remote_flash flash;
    uint64_t commands, bad; /* counts */
};

void remote_lbp_init(struct remote_lbp *line, struct remote *remote, uint32_t baud);
/* A byte arrives. Returns the length of the answer, 0 = none (yet). */
size_t remote_lbp_take(struct remote_lbp *line, uint8_t byte, int64_t now_ns, uint8_t answer[LBP_MESSAGE_BYTES]);

#endif
