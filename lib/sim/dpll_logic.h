/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The HM2DPLL of the firmware at clock resolution, without a card around it (register map 3.15, README of
 * tests/data/hm2dpll).
 *
 * sim_dpll_edge() is the firmware's clock edge. sim_dpll_run() gives the same state after n edges; its cost is one
 * step for every update of the phase filter that changes anything (2 a millisecond with a driver's settings), and
 * constant once the filter has settled.
 */
#ifndef SIM_DPLL_LOGIC_H
#define SIM_DPLL_LOGIC_H

#include <stdbool.h>
#include <stdint.h>

/* No run is longer than this at once; keeps every product below 2^63. */
#define SIM_DPLL_HORIZON ((int64_t)1 << 29)

enum { SIM_DPLL_TIMERS = 4, SIM_DPLL_OUTPUTS = 1 + SIM_DPLL_TIMERS }; /* output 0 is the reference */

enum sim_dpll_reg {
    SIM_DPLL_BASE_RATE,
    SIM_DPLL_PHASE,
    SIM_DPLL_CONTROL0,
    SIM_DPLL_CONTROL1,
    SIM_DPLL_TIMERS12,
    SIM_DPLL_TIMERS34,
    SIM_DPLL_SYNC,
    SIM_DPLL_REGS
};

/* The last two edges after which an output rose or fell; INT64_MIN = never so far. */
struct sim_dpll_history {
    int64_t rise[2], fall[2]; /* newest first */
};

struct sim_dpll {
    bool has_integral; /* the newer firmware adds an integral term */
    int64_t clk;       /* edges before this have been made */
    uint64_t accum;    /* 42 bits */
    uint32_t base_rate;
    uint8_t prescale, prescale_count;
    uint16_t filter_prescale, filter_count;
    int32_t phase_error;
    int32_t phase_limit, bounded, filtered, integral, correction; /* 24 bits, signed */
    uint16_t timer[SIM_DPLL_TIMERS];
    bool timer_bit[SIM_DPLL_TIMERS]; /* inverted at the outputs */
    bool sync_in, sync_in_seen;
    uint8_t sync_filter, filtered_sync; /* 4-bit counter; its last two verdicts */
    struct sim_dpll_history history[SIM_DPLL_OUTPUTS];
};

void sim_dpll_power_up(struct sim_dpll *d, bool has_integral, int64_t clk);
/* One edge. sync: register 6 is read or written at it. */
void sim_dpll_edge(struct sim_dpll *d, bool sync);
/* The edge at which a register is written. */
void sim_dpll_write_edge(struct sim_dpll *d, enum sim_dpll_reg reg, uint32_t value, bool sync);
void sim_dpll_run(struct sim_dpll *d, int64_t edges);
/* Level of an output after the edges so far. */
bool sim_dpll_output(const struct sim_dpll *d, unsigned output);
/* First edge from here on after which the output rises (or falls), if nobody writes; INT64_MAX = not within the
 * search, which ends after `edges` edges or when it has become too long. */
int64_t sim_dpll_find_change(const struct sim_dpll *d, unsigned output, bool rise, int64_t edges);

#endif
