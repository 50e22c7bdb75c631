/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Fanuc absolute encoders (FanucAbs, tag 19). Registers: register map 3.9; points: hal-interface 2.17. */
#include "absenc.h"
#include "bind.h"
#include "module_types.h"

enum { REG_DATA0, REG_DATA1, REG_DATA2, REG_CONTROL0, REG_CONTROL1, REG_GLOBAL };

#define WORD_BITS   76u /* shorter words would come left-justified (traces fabs) */
#define PSTART      0x0100u
#define TSTART      0x0200u
#define TIMER_SHIFT 12
/* Enables writes of the two registers behind; bit 24 in the firmware of 2021, bit 7 in the register description. */
#define SETUP_ENABLE  0x01000080u
#define LENGTH_SHIFT  24
#define REQUEST_SHIFT 14
#define REQUEST_MAX   1023u
#define REQUEST_HZ    125000u /* one request lasts 8 us */
#define CABLE_ERROR   0x80000000u
#define RATE_ONE      1048576.0
#define RATE_MAX      0x80000u
#define FILTER_SHIFT  28
#define FILTER_MIN    1u /* 0 is a cable error for ever */
#define FILTER_MAX    15u
#define REST_NS       150000 /* encoders answer up to 100 us after the request */

/* Control sections, in the order in which the card gets them. */
enum { OPEN, RATE, LENGTHS, CLOSE, CONTROLS };

static const struct hm2_point points[] = {
    HM2_ABSENC_ROWS(1024),
    HM2_POINT(struct hm2_absenc_channel, filter, "filter", HM2_U32, HM2_PARAM_RW, 15, "clocks",
              "data line must be steady for so long, 1 to 15"),
};

static const struct hm2_point_group groups[] = {
    HM2_GROUP("fanuc.##", points, "fanuc_chan_## in config"),
    HM2_ABSENC_FIELD_GROUPS("fanuc.##"),
    {.prefix = NULL},
};

/* The third data word is always read: it has the sign of a bad cable. */
static int add_registers(struct hm2_absenc_channel *const channel, struct hm2_module *const module,
                         struct hm2_setup *const setup)
{
    static const unsigned controls[CONTROLS] = {
        [OPEN] = REG_CONTROL0, [RATE] = REG_CONTROL1, [LENGTHS] = REG_DATA2, [CLOSE] = REG_CONTROL0};
    int err = 0;
    channel->words = HM2_ABSENC_WORDS;
    for (unsigned i = 0; i < HM2_ABSENC_WORDS && !err; i++)
        err = hm2_plan_add_read(setup->plan, &channel->data[i], HM2_RANK_NORMAL,
                                hm2_md_address(module->md, REG_DATA0 + i, channel->number), 1, setup->diag);
    for (unsigned i = 0; i < CONTROLS && !err; i++)
        err = hm2_absenc_add_control(channel, module, setup, i, controls[i]);
    return err;
}

static uint32_t filter_of(const struct hm2_absenc_channel *const channel, const struct hm2_module *const module)
{
    const uint32_t filter = *channel->filter;
    if (filter >= FILTER_MIN && filter <= FILTER_MAX)
        return filter;
    hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "filter", channel->number, filter);
    return *channel->filter = filter < FILTER_MIN ? FILTER_MIN : FILTER_MAX;
}

static void set_registers(struct hm2_absenc_channel *const channel, const struct hm2_module *const module)
{
    const uint32_t rate = hm2_absenc_rate(channel, module, RATE_ONE, RATE_MAX);
    const uint32_t timer = hm2_absenc_timer(channel, module);
    const uint32_t request = module->md->clock_hz / REQUEST_HZ;
    hm2_section_set(&channel->control[OPEN], 0, SETUP_ENABLE);
    hm2_section_set(&channel->control[RATE], 0, filter_of(channel, module) << FILTER_SHIFT | rate);
    hm2_section_set(&channel->control[LENGTHS], 0,
                    WORD_BITS << LENGTH_SHIFT | (request < REQUEST_MAX ? request : REQUEST_MAX) << REQUEST_SHIFT);
    hm2_section_set(&channel->control[CLOSE], 0, timer << TIMER_SHIFT | (timer ? TSTART : PSTART));
    for (unsigned i = 0; i < CONTROLS; i++) /* all of them: what is changed lies between the two others */
        hm2_section_touch(&channel->control[i]);
    channel->transfer_ns = hm2_absenc_clocks_ns(channel, WORD_BITS + 1.0) + REST_NS;
}

static bool is_good(const struct hm2_absenc_channel *const channel)
{
    return !(hm2_window_get(&channel->data[2], 0) & CABLE_ERROR);
}

static const struct hm2_absenc_kind kind = {
    .max_bits = WORD_BITS,
    .busy_register = REG_GLOBAL,
    .controls = CONTROLS,
    .group = groups,
    .add_registers = add_registers,
    .set_registers = set_registers,
    .is_good = is_good,
};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    return hm2_absenc_setup(module, setup_, &kind);
}

static const struct hm2_md_variant variants[] = {{0, 3, 4, 0x1F}};

const struct hm2_module_type hm2_fanuc_type = {
    .name = "fanuc",
    .gtag = HM2_GTAG_FABS,
    .variants = variants,
    .variant_count = 1,
    .config_count = -1,
    .setup = setup,
    .start = hm2_absenc_start,
    .unpack = hm2_absenc_unpack,
    .pack = hm2_absenc_pack,
    .write_lost = hm2_absenc_write_lost,
    .groups = groups,
};
