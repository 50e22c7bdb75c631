/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * One encoder channel of a PPMC board: the shaft, its inputs A, B and Z, the digital filter and the counter
 * (ppmc.md section 11.3, rules 12, 14 and 15). Steady motion is computed, not stepped through, so a channel at the
 * limit of the filter costs no more than one at rest.
 */
#ifndef SIM_PPMC_AXIS_H
#define SIM_PPMC_AXIS_H

#include <hm2/sim_ppmc.h>

#define PPMC_COUNTER_MASK 0xFFFFFFu /* 24 bits (seed 004, axis read registers) */

/* What the board tells its channels about the present moment. */
struct ppmc_axis_setting {
    int64_t filter_ns;   /* a state must last so long to be seen */
    int64_t timebase_ns; /* when the timestamp counter was 0 */
    uint32_t assembly;   /* what an index presets the counter to */
    bool preset;         /* is it to? */
    bool index_select;   /* firmware 0x11: the holding register is latched by the index */
};

struct ppmc_axis {
    /* The shaft: an edge whenever `phase`, which grows by `num` a nanosecond, passes `den`. */
    int64_t now_ns;
    int64_t shaft, num, den, phase;
    int64_t gap_ns, gap_rest; /* from edge to edge: den / num and its remainder */
    int direction;
    sim_ppmc_position_fn position;
    void *context;
    /* Inputs, as places 0..3 in the sequence of the four states of A and B. */
    bool broken;        /* B is stuck at this level: */
    unsigned stuck_b;   /* 0 or 1 */
    unsigned input;     /* what the board's filter sees */
    int64_t changed_ns; /* since when */
    unsigned accepted;  /* the state that passed the filter last */
    /* Z, by counted edges. */
    uint32_t index_counts, index_offset, index_width;
    /* Counter and what belongs to it. */
    uint32_t counter, holding;
    uint16_t timestamp;
    bool sense;
    struct sim_ppmc_truth truth;
};

void ppmc_axis_init(struct ppmc_axis *axis);
/* Registers as after power-on; the shaft stays where it is. */
void ppmc_axis_reset(struct ppmc_axis *axis);
/* Time passes. The setting holds for all of it. */
void ppmc_axis_advance(struct ppmc_axis *axis, const struct ppmc_axis_setting *setting, int64_t to_ns);
void ppmc_axis_set_rate(struct ppmc_axis *axis, int32_t edges_per_s);
/* So many edges at the present moment. */
void ppmc_axis_jump(struct ppmc_axis *axis, const struct ppmc_axis_setting *setting, int edges);
void ppmc_axis_break_wire(struct ppmc_axis *axis, bool broken);

#endif
