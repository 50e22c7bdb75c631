/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Raw access to registers (hal-interface 2.4), only with enable_raw: one register is read in every cycle, one is
 * written on a strobe. The module has no descriptor in the firmware.
 */
#include "bind.h"
#include "module_types.h"

#define ADDRESS_MASK 0xFFFCu /* registers are 32-bit words in 64 KiB (register map 1.1) */

struct raw {
    hm2_u32_t *read_address, *read_data, *write_address, *write_data;
    hm2_bit_t *write_strobe, *dump_state;
    bool underway; /* a write was sent, and the card has not confirmed it yet */
    struct hm2_window read;
    struct hm2_section write;
};

static const struct hm2_point points[] = {
    HM2_POINT(struct raw, read_address, "read_address", HM2_U32, HM2_PIN_IN, 0, "",
              "register to read, from the next cycle on"),
    HM2_POINT(struct raw, read_data, "read_data", HM2_U32, HM2_PIN_OUT, 0, "", "what it holds"),
    HM2_POINT(struct raw, write_address, "write_address", HM2_U32, HM2_PIN_IN, 0, "", "register to write"),
    HM2_POINT(struct raw, write_data, "write_data", HM2_U32, HM2_PIN_IN, 0, "", "value to write"),
    HM2_POINT(struct raw, write_strobe, "write_strobe", HM2_BIT, HM2_PIN_IN, 0, "", "1 = write once; goes back to 0"),
    HM2_POINT(struct raw, dump_state, "dump_state", HM2_BIT, HM2_PIN_IO, 0, "",
              "1 = print all modules; goes back to 0"),
};

static const struct hm2_point_group groups[] = {
    {"raw", points, sizeof points / sizeof points[0], "enable_raw"},
    {NULL, NULL, 0, NULL},
};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    if (!setup->config->enable_raw)
        return 0;
    struct raw *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    int err = hm2_bind_group(setup, &groups[0], ctx, 0);
    if (err == 0)
        err = hm2_plan_add_read_movable(setup->plan, &ctx->read, setup->diag);
    if (err == 0)
        err = hm2_plan_add_setup(setup->plan, &ctx->write, HM2_RANK_LAST, 0, 1, HM2_SECTION_ON_DEMAND, setup->diag);
    return err;
}

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct raw *const ctx = module->context;
    (void)cycle;
    if (ctx)
        *ctx->read_data = hm2_window_get(&ctx->read, 0);
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct raw *const ctx = module->context;
    (void)cycle;
    if (!ctx)
        return;
    hm2_put_le16(ctx->read.address, (uint16_t)(*ctx->read_address & ADDRESS_MASK));
    /* A write that was lost is sent again by the plan; a strobe that comes meanwhile waits for it. */
    ctx->underway = ctx->underway && !hm2_section_confirmed(&ctx->write);
    if (*ctx->write_strobe && !ctx->underway) {
        hm2_section_move(&ctx->write, (uint16_t)(*ctx->write_address & ADDRESS_MASK));
        hm2_section_set(&ctx->write, 0, *ctx->write_data);
        hm2_section_touch(&ctx->write);
        ctx->underway = true;
        *ctx->write_strobe = false;
    }
    if (*ctx->dump_state) {
        *ctx->dump_state = false;
        hm2_notice(module, HM2_NOTICE_DUMP_STATE, 0, 0.0);
    }
}

const struct hm2_module_type hm2_raw_type = {
    .name = "raw",
    .gtag = HM2_GTAG_NONE,
    .config_count = -1,
    .setup = setup,
    .unpack = unpack,
    .pack = pack,
    .groups = groups,
};
