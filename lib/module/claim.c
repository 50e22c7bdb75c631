/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <hm2/module.h>

int hm2_claim_pin(const struct hm2_module *const module, const struct hm2_setup *const setup, const unsigned io,
                  const bool immediate)
{
    struct hm2_pin *const pin = &setup->pins[io];
    if (pin->owner)
        return hm2_diag_add(setup->diag, HM2_ERR_MISMATCH,
                            "I/O %u is claimed by %s and by %s; the firmware's module list names the function twice",
                            io, pin->owner->type->name, module->type->name);
    pin->owner = module;
    pin->immediate = immediate;
    return 0;
}

int hm2_claim_pins(const struct hm2_module *const module, struct hm2_setup *const setup, uint8_t gtag,
                   const unsigned units, const bool immediate,
                   bool (*const filter)(const struct hm2_pd *pd, const struct hm2_setup *setup))
{
    int err = 0;
    if (gtag == HM2_GTAG_NONE)
        gtag = module->md->gtag;
    for (unsigned io = 0; io < setup->idrom->pin_count; io++) {
        const struct hm2_pin *const pin = &setup->pins[io];
        /* Global pins belong to every instance, so one instance in use is enough (register map 1.5). */
        const bool ours = pin->pd.secondary_unit & HM2_UNIT_GLOBAL ? units > 0 : pin->pd.secondary_unit < units;
        if (pin->pd.secondary_tag != gtag || !ours || (filter && !filter(&pin->pd, setup)))
            continue;
        const int bad = hm2_claim_pin(module, setup, io, immediate);
        err = bad < 0 ? bad : err;
    }
    return err;
}
