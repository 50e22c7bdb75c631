/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* SSI (tag 08). Registers: register map 3.9; points: hal-interface 2.17. */
#include "absenc.h"
#include "bind.h"
#include "module_types.h"

enum { REG_DATA0, REG_DATA1, REG_CONTROL, REG_GLOBAL };

#define BITS_MAX     64u
#define PSTART       0x0100u
#define TSTART       0x0200u
#define TIMER_SHIFT  12
#define RATE_SHIFT   16
#define RATE_ONE     65536.0
#define RATE_MAX     0x8000u /* with more a transfer never ends (traces ssi) */
#define EXTRA_CLOCKS 2.0     /* the one that latches the value, and the start */
#define REST_NS      50000   /* monoflop of the encoder, 20 us in most */

static const struct hm2_point points[] = {HM2_ABSENC_ROWS(500)};

static const struct hm2_point_group groups[] = {
    HM2_GROUP("ssi.##", points, "ssi_chan_## in config"),
    HM2_ABSENC_FIELD_GROUPS("ssi.##"),
    {.prefix = NULL},
};

static int add_registers(struct hm2_absenc_channel *const channel, struct hm2_module *const module,
                         struct hm2_setup *const setup)
{
    int err = 0;
    for (unsigned i = 0; i < channel->words && !err; i++)
        err = hm2_plan_add_read(setup->plan, &channel->data[i], HM2_RANK_NORMAL,
                                hm2_md_address(module->md, REG_DATA0 + i, channel->number), 1, setup->diag);
    /* Descriptors say that there is one control register; there is one for each channel (register map 3.9). */
    const uint16_t control =
        (uint16_t)(hm2_md_address(module->md, REG_CONTROL, 0) + channel->number * module->md->instance_stride);
    return err ? err
               : hm2_plan_add_setup(setup->plan, &channel->control[0], HM2_RANK_NORMAL, control, 1, 0, setup->diag);
}

static void set_registers(struct hm2_absenc_channel *const channel, const struct hm2_module *const module)
{
    const uint32_t rate = hm2_absenc_rate(channel, module, RATE_ONE, RATE_MAX);
    const uint32_t timer = hm2_absenc_timer(channel, module);
    hm2_section_set(&channel->control[0], 0,
                    rate << RATE_SHIFT | timer << TIMER_SHIFT | (timer ? TSTART : PSTART) | channel->fields.bits);
    channel->transfer_ns = hm2_absenc_clocks_ns(channel, channel->fields.bits + EXTRA_CLOCKS) + REST_NS;
}

static const struct hm2_absenc_kind kind = {
    .max_bits = BITS_MAX,
    .busy_register = REG_GLOBAL,
    .controls = 1,
    .group = groups,
    .add_registers = add_registers,
    .set_registers = set_registers,
};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    return hm2_absenc_setup(module, setup_, &kind);
}

static const struct hm2_md_variant variants[] = {{0, 4, 4, 0x3}};

const struct hm2_module_type hm2_ssi_type = {
    .name = "ssi",
    .gtag = HM2_GTAG_SSI,
    .variants = variants,
    .variant_count = 1,
    .config_count = -1,
    .setup = setup,
    .start = hm2_absenc_start,
    .unpack = hm2_absenc_unpack,
    .pack = hm2_absenc_pack,
    .write_lost = hm2_absenc_write_lost,
    .output_name = hm2_absenc_output_name,
    .groups = groups,
};
