/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What modules on the DPLL's timers ask it, beyond sim_card.h. Timer 0 is the reference, 1 to 4 are the timers. */
#ifndef SIM_DPLL_H
#define SIM_DPLL_H

#include "sim_card.h"

/* Level of an output before edge clk; clk is the card's present clk or at most two beside it. False without a DPLL. */
bool sim_dpll_level(struct sim_card *card, unsigned timer, int64_t clk);
/* Last falling edge before clk, as sim_dpll_last_rise(). Both know the last two edges of a kind only. */
int64_t sim_dpll_last_fall(struct sim_card *card, unsigned timer, int64_t clk);
/* First edge from clk on after which the output rises or falls, if nobody writes; SIM_NEVER when none is in sight. */
int64_t sim_dpll_next_change(struct sim_card *card, unsigned timer, bool rise, int64_t clk);

#endif
