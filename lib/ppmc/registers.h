/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Registers of a PPMC board, by offset from its base (seed 004, table of addresses). */
#ifndef PPMC_REGISTERS_H
#define PPMC_REGISTERS_H

#define PPMC_SLOT_ADDRESSES 16u /* base = address switches times this (seed 004, DIP switch) */

#define PPMC_R_COUNTS     0u  /* 24 bits an axis, two's complement, little end first */
#define PPMC_R_SENSE      12u /* bit of an axis: its index was seen; reading clears it */
#define PPMC_R_ID         15u
#define PPMC_R_TIMESTAMPS 16u /* 16 bits an axis, then the counter that they are taken from */
#define PPMC_COUNT_BYTES  3u
#define PPMC_HALF_ROUND   0x800000 /* counts, of 24 bits */
#define PPMC_COUNTS_BYTES 12u
#define PPMC_BLOCK_BYTES  16u /* counts, index sense, two unused, ID */
#define PPMC_STAMPS_BYTES 10u
#define PPMC_TIMEBASE_AT  8u /* within the timestamps */
#define PPMC_SENSE_UNUSED 0xF0u

#define PPMC_W_ASSEMBLY 0u
#define PPMC_W_CONTROL  3u
#define PPMC_W_TIMER    4u
#define PPMC_W_FILTER   5u
#define PPMC_W_PRESET   13u /* bit of an axis: its index loads the counter */

/* [7:4] load axis 3..0  W  counter := assembly register while 1; hold at least 2 us (seed 004, "Control Register
 * Bits"; ppmc.md section 2.3) */
#define PPMC_LOAD_ALL 0xF0u
/* [5] soft latch, [4] master  W  (seed 004, "Timer Register Bits"; ppmc.md section 2.4) */
#define PPMC_SOFT_LATCH 0x20u
#define PPMC_MASTER     0x10u

#endif
