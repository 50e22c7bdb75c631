/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* BISS (tag 18). Registers: register map 3.9; points: hal-interface 2.17. */
#include "absenc.h"
#include "bind.h"
#include "module_types.h"

enum { REG_DATA, REG_CONTROL0, REG_CONTROL1, REG_GLOBAL };

#define TIMER_SHIFT  12
#define RATE_SHIFT   16
#define FILTER_SHIFT 10
#define FILTER_MAX   63u
#define RATE_ONE     65536.0
#define RATE_MAX     0x8000u
/* The two start masks; firmware of 2021 has them the other way round than later ones (traces biss). A channel on a
 * timer sets both: nothing here ever writes the register of the global start. */
#define START_MASKS  0x0300u
#define EXTRA_CLOCKS 48.0 /* acknowledge, start and processing time, of which 40 are in the traces */
#define REST_NS      50000

static const struct hm2_point points[] = {HM2_ABSENC_ROWS(500)};

static const struct hm2_point_group groups[] = {
    HM2_GROUP("biss.##", points, "biss_chan_## in config"),
    HM2_ABSENC_FIELD_GROUPS("biss.##"),
    {.prefix = NULL},
};

/* Each read of the one data register takes a word from the stack, the last bits first. Ranks keep them apart. */
static int add_registers(struct hm2_absenc_channel *const channel, struct hm2_module *const module,
                         struct hm2_setup *const setup)
{
    static const enum hm2_rank ranks[HM2_ABSENC_WORDS] = {HM2_RANK_EARLY, HM2_RANK_NORMAL, HM2_RANK_LATE};
    int err = 0;
    for (unsigned i = 0; i < channel->words && i < HM2_ABSENC_WORDS && !err; i++)
        err = hm2_plan_add_read(setup->plan, &channel->data[i], ranks[i],
                                hm2_md_address(module->md, REG_DATA, channel->number), 1, setup->diag);
    if (!err)
        err = hm2_absenc_add_control(channel, module, setup, 0, REG_CONTROL0);
    return err ? err : hm2_absenc_add_control(channel, module, setup, 1, REG_CONTROL1);
}

static void set_registers(struct hm2_absenc_channel *const channel, const struct hm2_module *const module)
{
    const uint32_t rate = hm2_absenc_rate(channel, module, RATE_ONE, RATE_MAX);
    const uint32_t timer = hm2_absenc_timer(channel, module);
    const uint32_t half_bit = RATE_MAX / rate; /* at least 1: without a filter no transfer ever completes */
    const uint32_t filter = half_bit < FILTER_MAX ? half_bit : FILTER_MAX;
    hm2_section_set(&channel->control[0], 0, rate << RATE_SHIFT | filter << FILTER_SHIFT | channel->fields.bits);
    hm2_section_set(&channel->control[1], 0, timer ? timer << TIMER_SHIFT | START_MASKS : 0);
    channel->transfer_ns = hm2_absenc_clocks_ns(channel, channel->fields.bits + EXTRA_CLOCKS) + REST_NS;
}

static const struct hm2_absenc_kind kind = {
    .max_bits = HM2_ABSENC_BITS,
    .busy_register = REG_GLOBAL,
    .controls = 2,
    .group = groups,
    .add_registers = add_registers,
    .set_registers = set_registers,
};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    return hm2_absenc_setup(module, setup_, &kind);
}

static const struct hm2_md_variant variants[] = {{0, 4, 4, 0x7}};

const struct hm2_module_type hm2_biss_type = {
    .name = "biss",
    .gtag = HM2_GTAG_BISS,
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
