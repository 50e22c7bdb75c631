/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Transfers that a DPLL timer starts, alike in SSI, BISS and FanucAbs (register map 3.9): a start one edge after the
 * selected output has risen. */
#ifndef SIM_TRIGGER_H
#define SIM_TRIGGER_H

#include "sim_card.h"

#define SIM_TRIGGER_STARTS 2u /* the DPLL remembers its last two rising edges */

struct sim_trigger {
    bool enabled;
    unsigned select; /* register field: 0 = reference, 1 to 4, above like 0 */
};

/* Edges at which transfers start in [from, to), in order of time; returns how many. */
unsigned sim_trigger_starts(struct sim_card *card, const struct sim_trigger *trigger, int64_t from, int64_t to,
                            int64_t starts[SIM_TRIGGER_STARTS]);
/* First such edge from clk on; SIM_NEVER without one in sight. */
int64_t sim_trigger_next(struct sim_card *card, const struct sim_trigger *trigger, int64_t clk);

#endif
