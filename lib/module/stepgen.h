/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the parts of the step generator driver share: stepgen.c (points, set-up, feedback), stepgen_motion.c (how fast
 * to step) and stepgen_settings.c (the rarely written registers). Private to lib/module.
 */
#ifndef HM2_MODULE_STEPGEN_H
#define HM2_MODULE_STEPGEN_H

#include <limits.h>

#include <hm2/module.h>

#include "timer.h"

/* Pulse times, in the order of their registers. */
enum stepgen_time { STEPGEN_DIRSETUP, STEPGEN_DIRHOLD, STEPGEN_STEPLEN, STEPGEN_STEPSPACE, STEPGEN_TIMES };

#define STEPGEN_LOOKS       16u      /* cycles of a round of looks, at least */
#define STEPGEN_LOOK_AT_ALL UINT_MAX /* instead of a number */

#define STEPGEN_TABLE_WORDS   4u  /* parameters table-data-0 .. 3, four entries each */
#define STEPGEN_TABLE_ENTRIES 16u /* depth of the shift register (register map 3.4) */

/* One generator: pointers to its points, and what is known about it. */
struct stepgen {
    hm2_float_t *position_cmd, *velocity_cmd, *velocity_fb, *position_fb;
    hm2_s32_t *counts;
    hm2_bit_t *enable, *control_type, *position_reset;
    hm2_float_t *dbg_pos_minus_prev_cmd, *dbg_ff_vel, *dbg_s_to_match, *dbg_vel_error, *dbg_err_at_match;
    hm2_s32_t *dbg_step_rate;
    hm2_float_t *position_scale, *maxvel, *maxaccel;
    hm2_u32_t *time_ns[STEPGEN_TIMES];
    hm2_u32_t *step_type;
    hm2_u32_t *table_data[STEPGEN_TABLE_WORDS];
    hm2_bit_t *swap_step_dir;    /* versions 0x42 and 0xC2, else NULL */
    hm2_float_t *position_latch; /* this and the next: version 0xC2, else NULL */
    hm2_bit_t *index_enable, *probe_enable, *index_invert, *probe_invert;

    const struct hm2_module *module;
    unsigned number; /* of this generator */

    /* feedback */
    uint32_t accumulator; /* as read last */
    int64_t subcounts;    /* 1/65536 step */
    double position;      /* units */

    /* motion; the first five are the parameters as seen last */
    double scale, maxvel_seen, maxaccel_seen;
    uint32_t time_seen[STEPGEN_TIMES];
    double accel, inverse_accel; /* units/s^2 and its reciprocal; 0, 0 = unlimited */
    double limit, headroom;      /* units/s; and a little above */
    double rate_per_velocity;    /* rate register per unit/s */
    double velocity;             /* commanded last, units/s */
    double old_cmd;              /* position command of the previous cycle */

    /* settings */
    struct hm2_section mode, table, table_max;
    uint32_t mode_word; /* as handed to the plan last */
    uint32_t spent;     /* latches in it that have fired: to be taken out before they may be armed again */
    uint32_t table_seen[STEPGEN_TABLE_WORDS];
    uint32_t type_seen;
    bool watched;      /* the mode depends on more than step_type: look at it in every cycle */
    bool table_loaded; /* the card was given this generator's table since it was powered */
};

struct stepgen_module {
    struct hm2_timer timer;
    bool has_swap, has_latch;
    bool started;
    unsigned look, looks; /* generator whose parameters are looked at next, and length of the round */
    unsigned watched;     /* generators that are to be looked at in every cycle */
    double clock_hz;
    double max_step_hz; /* half the clock: what the signed rate register can say */
    int64_t period_seen_ns;
    double inverse_period; /* 1/s */
    struct hm2_window rates, accumulators, latches;
    struct hm2_section times[STEPGEN_TIMES], master_dds;
    struct stepgen generator[]; /* module->instances */
};

/* ---- stepgen_motion.c: arithmetic and rates, realtime safe ----------------------------------------------------------
 */

/* Take position-scale, maxvel, maxaccel and the pulse times over as limits; unusable values are rewritten. */
void stepgen_take_limits(struct stepgen *gen);
/* The cycle's rates, and what has changed. */
void stepgen_pack(struct hm2_module *module, const struct hm2_cycle *cycle);

/* ---- stepgen_settings.c --------------------------------------------------------------------------------------------
 */

/* Register the sections of all generators, hold them at their power-up parameters. Set-up time only. */
int HM2_MUST_CHECK stepgen_add_settings(struct hm2_module *module, struct hm2_setup *setup);
/* Pulse time as clocks of the register, at most its 14 bits. */
uint32_t stepgen_clocks(uint32_t time_ns, uint32_t clock_hz);
/* Longest pulse time in ns; also the default (hal-interface 2.7). */
uint32_t stepgen_longest_ns(uint32_t clock_hz);
/* Take the parameters of a generator over and hand its registers to the plan. Realtime safe. */
void stepgen_take_settings(struct stepgen *gen);
/* The card lost its tables. */
void stepgen_forget_tables(struct stepgen_module *ctx, unsigned instances);
/* See whether an armed latch has fired; called with the accumulator's value of the same reply. Realtime safe. */
void stepgen_unpack_latch(struct stepgen *gen, uint32_t latch);

#endif
