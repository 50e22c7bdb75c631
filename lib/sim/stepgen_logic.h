/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * One step generator of the firmware and the common rate generator in front of it, at clock resolution, without a
 * card around them (register map 3.4 and the stepgen traces).
 *
 * sim_stepgen_edge() is the firmware's clock edge. sim_stepgen_run() gives the same state after n edges in closed
 * form: it costs a few steps of work per change of direction or register, not per clock and not per step.
 * Everything here is plain state: copy it to look ahead.
 */
#ifndef SIM_STEPGEN_LOGIC_H
#define SIM_STEPGEN_LOGIC_H

#include <stdbool.h>
#include <stdint.h>

/* No run is longer than this at once; keeps every product below 2^63. */
#define SIM_STEPGEN_HORIZON ((int64_t)1 << 30)

/* Master DDS: a 33-bit accumulator; one tick for every toggle of its top bit, two clocks later. */
struct sim_rategen {
    uint64_t accum;
    uint32_t rate;
    bool old_msb, tick; /* tick: the step generators add at the next edge */
};

void sim_rategen_load(struct sim_rategen *g, uint32_t rate); /* one edge, with the register written at it */
void sim_rategen_run(struct sim_rategen *g, int64_t edges);
/* Ticks that the next `edges` edges see. */
int64_t sim_rategen_ticks(const struct sim_rategen *g, int64_t edges);
/* Number of edges up to and including the one that sees tick number `tick` (1 = the next); INT64_MAX = beyond
 * the horizon. */
int64_t sim_rategen_edges_for(const struct sim_rategen *g, int64_t tick);

/* Registers of one step generator, in the order of their pages. */
enum sim_stepgen_reg {
    SIM_STEPGEN_RATE,
    SIM_STEPGEN_ACCUM,
    SIM_STEPGEN_MODE,
    SIM_STEPGEN_DIR_SETUP,
    SIM_STEPGEN_DIR_HOLD,
    SIM_STEPGEN_PULSE_ACTIVE,
    SIM_STEPGEN_PULSE_IDLE,
    SIM_STEPGEN_TABLE,
    SIM_STEPGEN_TABLE_MAX,
    SIM_STEPGEN_REGS
};

struct sim_stepgen_write {
    enum sim_stepgen_reg reg;
    uint32_t value;
};

struct sim_stepgen {
    uint64_t accum; /* 48 bits; 2^32 = one step */
    int64_t travel; /* the same position, carried on to 64 bits; writing the accumulator moves it by less than a step */
    int32_t rate;
    uint16_t dir_setup, dir_hold, pulse_active, pulse_idle;
    uint16_t pulse_count, dir_count; /* the two timers */
    uint8_t mode;
    bool holding;   /* dir_count is the hold time after a step, not the set-up time after a change of direction */
    bool old_msb;   /* bit 31 of the accumulator one edge ago */
    bool added_dir; /* direction of the last addition */
    bool dir, pulse;
    bool old_pulse_wait;
    /* The stretch that sim_stepgen_run() is in: edges to come that only add and count down, and additions among them
     * before the one that makes a step. 0 edges = not worked out; every single edge ends a stretch. */
    int64_t quiet, adds;
    uint8_t table[16]; /* shift register, newest entry first */
    uint8_t table_ptr, table_max;
};

/* One edge. tick: the rate generator's, before this edge. write: what the host writes at this edge, or NULL. */
void sim_stepgen_edge(struct sim_stepgen *g, bool tick, const struct sim_stepgen_write *write);
/* n edges without a write; rategen is that before the first of them and is not changed. */
void sim_stepgen_run(struct sim_stepgen *g, const struct sim_rategen *rategen, int64_t edges);
/* Number of edges from here after which no output has changed yet (a lower bound, at most the horizon). */
int64_t sim_stepgen_silent(const struct sim_stepgen *g, const struct sim_rategen *rategen);
/* Outputs, bit 0 = first pin. */
unsigned sim_stepgen_outputs(const struct sim_stepgen *g);

#endif
