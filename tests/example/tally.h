/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What a real module has in hm2/idrom.h, lib/module/module_types.h and lib/sim/models.c. */
#ifndef EXAMPLE_TALLY_H
#define EXAMPLE_TALLY_H

#include <hm2/module.h>

#define GTAG_TALLY 0xE0u

extern const struct hm2_module_type hm2_tally_type;

#endif
