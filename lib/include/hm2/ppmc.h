/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Pico Systems PPMC boards on an EPP bus: what is there, and the encoder counters of them as points.
 *
 * Sources: seed 004 (the vendor's register page of firmware 0x14) and ppmc.md. The names of the points are those of
 * LinuxCNC's hal_ppmc; those that it does not have are fault, timeouts, io-errors, bad-data, retries, and
 * board.SS.{online,failures,position-lost}.
 *
 * A period's data of a board is used whole or not at all. It is used when every cycle was answered, the counts read the
 * same twice, the module ID came along, the index sense register has no impossible bits, and no count moved further
 * than the filter lets through in the time that passed. Otherwise all points of the board keep their values (delta is
 * 0), the failure is counted, and the next good period catches up by modular difference.
 *
 * ppmc_read() and ppmc_write() are realtime safe (no allocation, lock or formatting, no system call but those of the
 * bus) and must be called from one thread. ppmc_next_message() may be called from one other.
 */
#ifndef HM2_PPMC_H
#define HM2_PPMC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/epp.h>
#include <hm2/module.h>
#include <hm2/points.h>

#define PPMC_SLOTS 16u
#define PPMC_AXES  4u

/* Encoder filter rates, as register 5 has them (seed 004, "Encoder Filter Rate Select"). */
enum ppmc_filter { PPMC_1_MHZ, PPMC_2_5_MHZ, PPMC_5_MHZ, PPMC_10_MHZ, PPMC_FILTERS, PPMC_FILTER_KEEP };

/* A board that a scan found. */
struct ppmc_board_info {
    uint8_t id;       /* byte of register 15; 0 = nothing answers here */
    const char *name; /* "encoder board", ... */
    uint8_t slots;    /* 1 or 2 */
    uint8_t encoders; /* 4 or 0 */
    bool index;       /* has an index preset register */
    bool filter;      /* has a filter rate register */
    bool timestamps;
};

/* Look at all sixteen slots. A slot that answers with what no board has (an unknown ID, an ID that changes, a board of
 * two slots at an odd address) is HM2_ERR_MISMATCH, with the slot and the byte in diag; the other slots are filled in
 * all the same. HM2_ERR_IO when the bus cannot be used. Not realtime safe. */
HM2_API int HM2_MUST_CHECK ppmc_scan(struct epp *epp, struct ppmc_board_info boards[PPMC_SLOTS], struct hm2_diag *diag);
/* What an ID byte stands for; false when it is unknown. */
HM2_API bool ppmc_identify(uint8_t id, struct ppmc_board_info *info);
/* Write the filter rate register of the board in a slot: HM2_ERR_NOTFOUND, HM2_ERR_UNSUPPORTED. Not realtime safe. */
HM2_API int HM2_MUST_CHECK ppmc_set_filter(struct epp *epp, unsigned slot, enum ppmc_filter filter,
                                           struct hm2_diag *diag);
/* Read registers of a slot as they are, from an offset (0..15, or 31 for a board of two slots) on; reading the index
 * sense register clears it, and counts are those of the last latch pulse. Not realtime safe. */
HM2_API int HM2_MUST_CHECK ppmc_read_registers(struct epp *epp, unsigned slot, unsigned offset, uint8_t *bytes,
                                               unsigned count, struct hm2_diag *diag);
/* In MHz, for people. */
HM2_API double ppmc_filter_mhz(enum ppmc_filter filter);

struct ppmc_options {
    unsigned bus;                        /* number in the names: ppmc.BUS.encoder.NN.count */
    enum ppmc_filter filter[PPMC_SLOTS]; /* PPMC_FILTER_KEEP = as the board has it */
    uint16_t timestamps;                 /* bit of a slot: velocities by the board's timestamps */
    uint16_t expected;                   /* bit of a slot: a board with encoders must be there, at least; 0 = any */
    bool verify;                         /* read everything twice */
    bool keep_counts;                    /* the counters go on from where they are */
};

/* No filter set, counts set to 0, no timestamps, everything read twice, bus 0. */
HM2_API struct ppmc_options ppmc_default_options(void);

struct ppmc; /* the boards of a bus */

/* NULL when there is no memory. */
HM2_API struct ppmc *ppmc_new(void);
HM2_API void ppmc_free(struct ppmc *ppmc); /* closes the bus, too */

/* Scan, create the points, set the boards up: counts 0, no index armed, filter rates as asked. Takes over `epp` in any
 * case. Boards without encoders are left alone, with a warning in diag. HM2_ERR_NOTFOUND when there are no encoders,
 * HM2_ERR_UNSUPPORTED for an option that its board cannot do, HM2_ERR_MISMATCH as ppmc_scan() or when an expected board
 * is missing. Not realtime safe. */
HM2_API int HM2_MUST_CHECK ppmc_setup(struct ppmc *ppmc, struct epp *epp, struct hm2_binder *binder,
                                      const struct ppmc_options *options, struct hm2_diag *diag);
HM2_API const struct ppmc_board_info *ppmc_boards(const struct ppmc *ppmc); /* PPMC_SLOTS of them */

/* Latch the counts of all boards, read and decode them. */
HM2_API void ppmc_read(struct ppmc *ppmc, long period_ns);
/* Arm and disarm indices. */
HM2_API void ppmc_write(struct ppmc *ppmc, long period_ns);
/* Disarm everything; the cycle must be over. */
HM2_API void ppmc_stop(struct ppmc *ppmc);

/* Next thing that a person should know, as a sentence: 1, or 0 when there is none. */
HM2_API int ppmc_next_message(struct ppmc *ppmc, char *text, size_t size, bool *error);

/* The tables of points; ended by a group without points. */
HM2_API const struct hm2_point_group *ppmc_point_groups(void);

#endif
