/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Plain outputs (register map 3.18, hal-interface 2.12): one word per instance, written in every cycle. */
#include "bind.h"
#include "module_types.h"
#include "outputs.h"

#define REG_DATA    0u
#define LAST_OUTPUT 31u

struct outm {
    struct hm2_window data;
    struct hm2_outputs outputs;
};

static const struct hm2_point_group groups[] = {
    {"outm.##", hm2_output_points, HM2_OUTPUT_ROWS, "outputs that the firmware describes"},
    {NULL, NULL, 0, NULL},
};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    if (module->instances == 0)
        return 0;
    struct outm *const outms = hm2_setup_alloc(setup, module->instances * sizeof *outms);
    if (!outms)
        return HM2_ERR_NOMEM;
    module->context = outms;
    int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL);
    for (unsigned unit = 0; err == 0 && unit < module->instances; unit++) {
        err = hm2_outputs_bind(&outms[unit].outputs, module, setup, &groups[0], unit, LAST_OUTPUT);
        if (err == 0)
            err = hm2_plan_add_write(setup->plan, &outms[unit].data, HM2_RANK_NORMAL,
                                     hm2_md_address(module->md, REG_DATA, unit), 1, setup->diag);
    }
    return err;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct outm *const outms = module->context;
    /* A bite clears the register (register map 3.2); it stays so until the bite is acknowledged. */
    for (struct outm *outm = outms, *const end = outms + module->instances; outm < end; outm++)
        hm2_window_set(&outm->data, 0, cycle->bitten ? 0 : hm2_outputs_word(&outm->outputs));
}

const struct hm2_module_type hm2_outm_type = {
    .name = "outm",
    .gtag = HM2_GTAG_OUTM,
    .config_count = HM2_CFG_OUTMS,
    .setup = setup,
    .pack = pack,
    .groups = groups,
};
