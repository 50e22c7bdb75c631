/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Which generation of the firmware an IDROM comes from. */
#ifndef SIM_MAP_H
#define SIM_MAP_H

#include <hm2/idrom.h>

/*
 * True when the image is of the newer firmware, with the new address map (register map 0.1 and 2.2). Neither version
 * numbers nor register counts tell; the base address of a module that was moved does, and so does a module that the
 * older firmware did not have. An image without any of them counts as old.
 *
 * What hangs on it here: DPLL select registers, read-back of positions one clock late, the details of the DPLL's
 * filter, the edge of the interrupt source, and Status of the watchdog right after configuration.
 */
bool sim_map_is_new(const struct hm2_idrom *idrom);

#endif
