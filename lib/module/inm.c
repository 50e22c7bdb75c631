/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* InM: field inputs wired to the FPGA one by one, scanned and filtered (register map 3.17, hal-interface 2.13). */
#include "module_types.h"
#include "scanned.h"

#define MAX_BITS_PER_S 10000000u

static const struct hm2_point_group groups[] =
    HM2_SCANNED_GROUPS("inm.##", "inputs below scan_width or named by the firmware");

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    return hm2_scanned_setup(module, setup, HM2_SCANNED_BY_WIDTH_AND_PIN, MAX_BITS_PER_S);
}

const struct hm2_module_type hm2_inm_type = {
    .name = "inm",
    .gtag = HM2_GTAG_INM,
    .config_count = HM2_CFG_INMS,
    .setup = setup,
    .start = hm2_scanned_start,
    .unpack = hm2_scanned_unpack,
    .pack = hm2_scanned_pack,
    .groups = groups,
};
