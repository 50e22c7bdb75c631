/* SPDX-License-Identifier: LGPL-2.1-or-later */
#ifndef SIM_PPMC_BUS_H
#define SIM_PPMC_BUS_H

#include "ppmc_board.h"

/* Planned faults of single cycles. */
struct ppmc_planned {
    uint64_t from, to; /* cycles, `to` excluded */
    enum sim_ppmc_fault fault;
};

#define PPMC_MAX_PLANNED 32u

struct sim_ppmc {
    struct sim_ppmc_options options;
    struct sim_ppmc_stats stats;
    int64_t now_ns;
    struct ppmc_board boards[SIM_PPMC_SLOTS]; /* by their slot */
    struct ppmc_board *at[SIM_PPMC_SLOTS];    /* that answers at each slot, or NULL */
    bool powered;                             /* at least one */
    uint8_t address, residue;
    bool pulses; /* masters give latch pulses by themselves */
    bool line;   /* of the latch pulse, which all boards share (ppmc.md section 2.4) */
    bool unplugged;
    /* The port in front (ppmc.md section 3.3). */
    bool timeout;
    uint8_t control, ecr;
    /* Faults. */
    uint64_t random;
    uint32_t fault_every;
    unsigned fault_mask;
    unsigned planned_count;
    struct ppmc_planned planned[PPMC_MAX_PLANNED];
};

#endif
