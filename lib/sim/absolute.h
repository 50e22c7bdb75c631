/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Absolute encoders outside the card, as the benches of the recorded traces had them (READMEs of folders ssi, biss,
 * fabs). Times are picoseconds of the card's own time. A change is seen by the clock edges behind it, not by one at
 * the very same time.
 */
#ifndef SIM_ABSOLUTE_H
#define SIM_ABSOLUTE_H

#include <hm2/sim.h>

#define SIM_ABS_CHANGES 64u /* of a line on their way: 19 bit times of line delay are in the traces */

struct sim_abs_encoder {
    struct sim_absolute spec; /* bits 0: none, the line is what pads make it */
    bool level, busy;         /* of the line; busy: not back to idle */
    uint32_t value[4];        /* what it sends in this transfer: an encoder that moves does not change its mind */
    unsigned edges;           /* rising edges of the clock in this transfer */
    int64_t idle_at_ps;
    unsigned first, count;
    struct {
        int64_t at_ps;
        bool level;
    } changes[SIM_ABS_CHANGES];
};

/* idle_level: what the line rests at. idle_ps, bit_ps: for a spec that leaves them open. */
void sim_abs_attach(struct sim_abs_encoder *e, const struct sim_absolute *spec, bool idle_level, int64_t idle_ps,
                    int64_t bit_ps);
void sim_abs_power_up(struct sim_abs_encoder *e, bool idle_level);
/* The card's clock line changed at now. */
void sim_abs_ssi_clock(struct sim_abs_encoder *e, bool rising, int64_t now_ps);
void sim_abs_biss_clock(struct sim_abs_encoder *e, bool rising, int64_t now_ps);
/* A request began at now. */
void sim_abs_fanuc_request(struct sim_abs_encoder *e, int64_t now_ps);
/* What an edge at now sees on the line. */
bool sim_abs_line(struct sim_abs_encoder *e, int64_t now_ps);
/* The line will still change by itself. */
bool sim_abs_moving(const struct sim_abs_encoder *e);

#endif
