/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* InMux: inputs behind external multiplexers (register map 3.17, hal-interface 2.13). */
#include "module_types.h"
#include "scanned.h"

#define MAX_BITS_PER_S 5000000u /* half of InM's: the multiplexers need time to settle (hal-interface 2.13) */

static const struct hm2_point_group groups[] = HM2_SCANNED_GROUPS("inmux.##", "inputs below scan_width");

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    return hm2_scanned_setup(module, setup, HM2_SCANNED_BY_WIDTH, MAX_BITS_PER_S);
}

const struct hm2_module_type hm2_inmux_type = {
    .name = "inmux",
    .gtag = HM2_GTAG_INMUX,
    .config_count = HM2_CFG_INMUXS,
    .setup = setup,
    .start = hm2_scanned_start,
    .unpack = hm2_scanned_unpack,
    .pack = hm2_scanned_pack,
    .groups = groups,
};
