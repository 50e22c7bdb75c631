/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Every module type of this library. The order is that of the work inside a cycle (hal-interface 3.8): the watchdog
 * tells first whether the card still drives its outputs, then come ports and counters, and the DPLL last.
 */
#include "module_types.h"

const struct hm2_module_type *const hm2_module_types[] = {
    &hm2_encoder_type, &hm2_muxed_encoder_type, &hm2_pwmgen_type, &hm2_stepgen_type, NULL,
};
