/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Index and probe latch of a step generator: versions 3 (README of the stepgen_v3 traces) and 0xC2 (register map 3.4).
 * Each input goes through an up/down counter; when the counter ends at its other limit and the mode register asks for
 * that edge, the accumulator is copied.
 */
#ifndef SIM_STEPGEN_LATCH_H
#define SIM_STEPGEN_LATCH_H

#include <stdbool.h>
#include <stdint.h>

enum { SIM_LATCH_INDEX, SIM_LATCH_PROBE, SIM_LATCH_INPUTS };

struct sim_latch_kind {
    uint8_t version;
    uint8_t filter_max;
    uint8_t latch_bit[SIM_LATCH_INPUTS], polarity_bit[SIM_LATCH_INPUTS]; /* of the mode register */
    uint8_t just_once_bit;                                               /* 0 = always once */
    uint8_t pin[SIM_LATCH_INPUTS];
    uint8_t position_bits; /* upper bits of the accumulator that are kept, read in the upper bits of the register */
};

/* NULL for versions without latch. */
const struct sim_latch_kind *sim_latch_kind(uint8_t version);

struct sim_latch_filter {
    bool level;
    uint8_t count;
    bool settled, seen; /* verdict of the filter, now and one edge ago */
};

/* One edge. */
void sim_latch_edge(struct sim_latch_filter *f, const struct sim_latch_kind *kind);
/* Edges from here that do nothing but count; the input stays as it is. */
int64_t sim_latch_quiet(const struct sim_latch_filter *f, const struct sim_latch_kind *kind);
void sim_latch_run_quiet(struct sim_latch_filter *f, const struct sim_latch_kind *kind, int64_t edges);
/* True when the next edge copies the accumulator as `mode` asks. */
bool sim_latch_fires(const struct sim_latch_filter *f, const struct sim_latch_kind *kind, unsigned input, uint8_t mode);

#endif
