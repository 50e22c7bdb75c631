/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* ClockHigh beside ClockLow, the clock of the bus. Edges of both lie in the middle of their periods, counted from
 * power-up (README of folder pwmgen). */
#ifndef SIM_HIGH_CLOCK_H
#define SIM_HIGH_CLOCK_H

#include "sim_card.h"

/* Edges of ClockHigh before edge clk of ClockLow; with_same: one at the very same time included. */
int64_t sim_high_edges(const struct sim_card *card, int64_t clk, bool with_same);
/* The same for a time ps after edge clk, edges at that very time included. */
int64_t sim_high_edges_after(const struct sim_card *card, int64_t clk, unsigned ps);
/* Edge of ClockLow before edge j (from 0) of ClockHigh, and the time between. */
int64_t sim_low_edge(const struct sim_card *card, int64_t j, unsigned *ps);

#endif
