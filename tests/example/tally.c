/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Tally, tag E0: counters of rising edges, with an output that goes high at a limit. It does not exist; CONTRIBUTING.md
 * shows with it how a module is added. As lib/module/tally.c it would be this file, under the
 * LGPL.
 */
#include "tally.h"
#include "bind.h"

enum { REG_COUNT, REG_LIMIT };

struct tally {
    hm2_s32_t *count;
    hm2_u32_t *limit;
    uint32_t zero; /* value of the register where count is 0 */
};

struct tallies {
    struct hm2_window counts;
    struct hm2_section limits;
    struct tally tally[]; /* one an instance */
};

static const struct hm2_point points[] = {
    HM2_POINT(struct tally, count, "count", HM2_S32, HM2_PIN_OUT, 0, "edges", "rising edges since load"),
    HM2_POINT(struct tally, limit, "limit", HM2_U32, HM2_PIN_IN, 0, "edges", "register value that sets the output"),
};

static const struct hm2_point_group groups[] = {
    HM2_GROUP("tally.##", points, NULL),
    {NULL, NULL, 0, NULL},
};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    const struct hm2_md *const md = module->md;
    if (module->instances == 0)
        return 0;
    struct tallies *const ctx = hm2_setup_alloc(setup, sizeof *ctx + module->instances * sizeof ctx->tally[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL);
    for (unsigned i = 0; !err && i < module->instances; i++)
        err = hm2_bind_group(setup, &groups[0], &ctx->tally[i], i);
    if (!err)
        err = hm2_plan_add_read(setup->plan, &ctx->counts, HM2_RANK_NORMAL, hm2_md_address(md, REG_COUNT, 0),
                                module->instances, setup->diag);
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &ctx->limits, HM2_RANK_NORMAL, hm2_md_address(md, REG_LIMIT, 0),
                                 module->instances, 0, setup->diag);
    return err;
}

static void start(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct tallies *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; i < module->instances; i++)
        ctx->tally[i].zero = hm2_window_get(&ctx->counts, i) - (uint32_t)*ctx->tally[i].count;
}

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct tallies *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; i < module->instances; i++)
        *ctx->tally[i].count = (int32_t)(hm2_window_get(&ctx->counts, i) - ctx->tally[i].zero);
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct tallies *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; i < module->instances; i++)
        hm2_section_set(&ctx->limits, i, *ctx->tally[i].limit);
}

static const struct hm2_md_variant variants[] = {{.version = 0, .registers = 2, .instance_stride = 4, .multiple = 3}};

const struct hm2_module_type hm2_tally_type = {
    .name = "tally",
    .gtag = GTAG_TALLY,
    .variants = variants,
    .variant_count = 1,
    .config_count = -1,
    .setup = setup,
    .start = start,
    .unpack = unpack,
    .pack = pack,
    .groups = groups,
};
