/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * QCount (tag 04) and MuxedQCount (tag 0C): points and set-up. Both have the same registers and pins; they differ in
 * the sample clock and in the select pins (tag 0D) that switch the external multiplexer.
 */
#include "encoder.h"

#include "bind.h"
#include "module_types.h"

enum { REG_COUNT = 0, REG_CONTROL = 1, REG_STAMP_COUNTER = 3 };

#define VERSION_PROBE      0x80u /* 0x83 and 0x84 */
#define VERSION_MUXED_SKEW 4u    /* and 0x84 */
#define PIN_SELECT_FIRST   0x81u /* register map 4.1 */
#define ANY_UNIT           0x100u

#define ROW(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct encoder, field, name, type, dir, init, unit, help)
#define GLOBAL(field, name, type, init, unit, help) \
    HM2_POINT(struct encoder_module, field, name, type, HM2_PIN_IN, init, unit, help)

static const struct hm2_point plain_points[] = {
    GLOBAL(sample_frequency, "sample-frequency", HM2_U32, 25000000, "Hz", "clock of the input filters"),
};

static const struct hm2_point muxed_points[] = {
    GLOBAL(sample_frequency, "muxed-sample-frequency", HM2_U32, 8000000, "Hz", "clock of the multiplexer"),
};

static const struct hm2_point skew_points[] = {
    GLOBAL(skew_ns, "muxed-skew", HM2_U32, 0, "ns", "delay of the samples behind the select outputs"),
};

static const struct hm2_point timer_points[] = {
    GLOBAL(timer.number, "timer-number", HM2_S32, -1, "",
           "DPLL timer that samples the counts: 1 to 4, 0 reference, -1 none"),
};

static const struct hm2_point stamp_points[] = {
    GLOBAL(hires_timestamp, "hires-timestamp", HM2_BIT, 0, "", "time stamps of 0: 2 MHz, 1: 10 MHz"),
};

static const struct hm2_point points[] = {
    ROW(rawcounts, "rawcounts", HM2_S32, HM2_PIN_OUT, 0, "counts", "counts since load, never reset"),
    ROW(rawlatch, "rawlatch", HM2_S32, HM2_PIN_OUT, 0, "counts", "rawcounts at the last index, probe or reset"),
    ROW(count, "count", HM2_S32, HM2_PIN_OUT, 0, "counts", "counts since index or reset"),
    ROW(count_latched, "count-latched", HM2_S32, HM2_PIN_OUT, 0, "counts", "count at the last index, probe or reset"),
    ROW(position, "position", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "count / scale"),
    ROW(position_interpolated, "position-interpolated", HM2_FLOAT, HM2_PIN_OUT, 0, "units",
        "position, extrapolated between edges"),
    ROW(position_latched, "position-latched", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "count-latched / scale"),
    ROW(velocity, "velocity", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s", "from the time stamps of the edges"),
    ROW(velocity_rpm, "velocity-rpm", HM2_FLOAT, HM2_PIN_OUT, 0, "units/min", "60 times velocity"),
    ROW(reset, "reset", HM2_BIT, HM2_PIN_IN, 0, "", "while 1 the position is held at 0"),
    ROW(index_enable, "index-enable", HM2_BIT, HM2_PIN_IO, 0, "", "1: zero at the next index edge, which clears it"),
    ROW(no_clear_on_index, "no_clear_on_index", HM2_BIT, HM2_PIN_IN, 0, "", "1: the index latches without zeroing"),
    ROW(quad_error, "quad-error", HM2_BIT, HM2_PIN_OUT, 0, "", "A and B changed together"),
    ROW(quad_error_enable, "quad-error-enable", HM2_BIT, HM2_PIN_IN, 0, "",
        "report errors; its rising edge clears old ones"),
    ROW(input_a, "input-a", HM2_BIT, HM2_PIN_OUT, 0, "", "filtered level"),
    ROW(input_b, "input-b", HM2_BIT, HM2_PIN_OUT, 0, "", "filtered level"),
    ROW(input_index, "input-index", HM2_BIT, HM2_PIN_OUT, 0, "", "filtered level, after index-invert"),
    ROW(scale, "scale", HM2_FLOAT, HM2_PARAM_RW, 1, "counts/unit", "0 is replaced by 1"),
    ROW(index_invert, "index-invert", HM2_BIT, HM2_PARAM_RW, 0, "", "1: the rising edge of the index, 0: the falling"),
    ROW(index_mask, "index-mask", HM2_BIT, HM2_PARAM_RW, 0, "", "index counts only while the mask input is active"),
    ROW(index_mask_invert, "index-mask-invert", HM2_BIT, HM2_PARAM_RW, 0, "", "1: the mask input is active high"),
    ROW(counter_mode, "counter-mode", HM2_BIT, HM2_PARAM_RW, 0, "", "0 quadrature, 1 A counts and B is the direction"),
    ROW(filter, "filter", HM2_BIT, HM2_PARAM_RW, 1, "", "an input changes after 1: 15 samples, 0: 3 samples"),
    ROW(vel_timeout, "vel-timeout", HM2_FLOAT, HM2_PARAM_RW, 0.5, "s", "time without an edge that means standstill"),
};

static const struct hm2_point probe_points[] = {
    ROW(probe_enable, "probe-enable", HM2_BIT, HM2_PIN_IN, 0, "", "1: latch at the next probe edge, which clears it"),
    ROW(probe_invert, "probe-invert", HM2_BIT, HM2_PIN_IN, 0, "", "1: the rising edge of the probe, 0: the falling"),
};

enum { GROUP_CLOCK, GROUP_STAMP, GROUP_TIMER, GROUP_ALWAYS, GROUP_PROBE, GROUP_SKEW };

#define COMMON_GROUPS                                                              \
    [GROUP_STAMP] = HM2_GROUP("encoder", stamp_points, NULL),                      \
    [GROUP_TIMER] = HM2_GROUP("encoder", timer_points, "the firmware has a DPLL"), \
    [GROUP_ALWAYS] = HM2_GROUP("encoder.##", points, NULL),                        \
    [GROUP_PROBE] = HM2_GROUP("encoder.##", probe_points, "module version 0x83 or 0x84")

static const struct hm2_point_group plain_groups[] = {
    [GROUP_CLOCK] = HM2_GROUP("encoder", plain_points, NULL),
    COMMON_GROUPS,
    {.prefix = NULL},
};

static const struct hm2_point_group muxed_groups[] = {
    [GROUP_CLOCK] = HM2_GROUP("encoder", muxed_points, NULL),
    COMMON_GROUPS,
    [GROUP_SKEW] = HM2_GROUP("encoder", skew_points, "module version 4 or 0x84"),
    {.prefix = NULL},
};

static int claim(const struct hm2_module *const module, struct hm2_setup *const setup, const bool muxed)
{
    if (!muxed)
        return hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL);
    /* Unit u carries encoders 2u and 2u + 1 (register map 3.5.4). The select outputs serve all of them, whatever unit
     * their descriptors name: firmware numbers them in several ways. They must run from load on. */
    const int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, (module->instances + 1) / 2, false, NULL);
    return err ? err : hm2_claim_pins(module, setup, HM2_GTAG_MUXED_ENCODER_SEL, ANY_UNIT, true, NULL);
}

static int bind(const struct hm2_module *const module, const struct hm2_setup *const setup)
{
    struct encoder_module *const ctx = module->context;
    const struct hm2_point_group *const groups = module->type->groups;
    int err = hm2_bind_group(setup, &groups[GROUP_CLOCK], ctx, 0);
    if (!err && ctx->muxed && (module->md->version & ~VERSION_PROBE) >= VERSION_MUXED_SKEW)
        err = hm2_bind_group(setup, &groups[GROUP_SKEW], ctx, 0);
    if (!err && setup->has_dpll)
        err = hm2_bind_group(setup, &groups[GROUP_TIMER], ctx, 0);
    if (!err)
        err = hm2_bind_group(setup, &groups[GROUP_STAMP], ctx, 0);
    for (unsigned i = 0; !err && i < module->instances; i++) {
        ctx->encoder[i].module = module;
        ctx->encoder[i].number = i;
        ctx->encoder[i].scale_seen = ctx->encoder[i].inverse_scale = 1.0;
        err = hm2_bind_group(setup, &groups[GROUP_ALWAYS], &ctx->encoder[i], i);
        if (!err && ctx->has_probe)
            err = hm2_bind_group(setup, &groups[GROUP_PROBE], &ctx->encoder[i], i);
    }
    return err;
}

/* In the order stamp counter, counts, control words (hal-interface 2.8): an edge is at most the time of one packet
 * younger than the clock it is compared with, and a latch that has fired is seen with a count that is hardly older. */
static int add_reads(struct hm2_module *const module, struct hm2_setup *const setup)
{
    struct encoder_module *const ctx = module->context;
    const struct hm2_md *const md = module->md;
    int err = hm2_plan_add_read(setup->plan, &ctx->stamp_counter, HM2_RANK_EARLY,
                                hm2_md_address(md, REG_STAMP_COUNTER, 0), 1, setup->diag);
    if (!err)
        err = hm2_plan_add_read(setup->plan, &ctx->counts, HM2_RANK_NORMAL, hm2_md_address(md, REG_COUNT, 0),
                                module->instances, setup->diag);
    if (!err)
        err = hm2_plan_add_read(setup->plan, &ctx->controls, HM2_RANK_LATE, hm2_md_address(md, REG_CONTROL, 0),
                                module->instances, setup->diag);
    return err;
}

static int setup_any(struct hm2_module *const module, struct hm2_setup *const setup, const bool muxed)
{
    const struct hm2_md *const md = module->md;
    if (module->instances == 0)
        return 0;
    const unsigned good = muxed ? 3 : 2;
    if (md->version < good)
        hm2_diag_warn(setup->diag, "%s version %u is old firmware with a faulty %s; version %u or later is good",
                      hm2_tag_name(md->gtag), md->version, muxed ? "velocity" : "index", good);
    struct encoder_module *const ctx = hm2_setup_alloc(setup, sizeof *ctx + module->instances * sizeof ctx->encoder[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->muxed = muxed;
    ctx->has_probe = md->version & VERSION_PROBE;
    ctx->clock_hz = md->clock_hz;
    ctx->looks = module->instances > ENCODER_LOOKS ? module->instances : ENCODER_LOOKS;
    int err = claim(module, setup, muxed);
    if (!err)
        err = bind(module, setup);
    if (!err)
        err = add_reads(module, setup);
    return err ? err : encoder_add_settings(module, setup);
}

static int setup_plain(struct hm2_module *const module, struct hm2_setup *const setup)
{
    return setup_any(module, setup, false);
}

static int setup_muxed(struct hm2_module *const module, struct hm2_setup *const setup)
{
    return setup_any(module, setup, true);
}

static const char *select_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"sel0", "sel1"};
    const unsigned number = pd->secondary_pin - PIN_SELECT_FIRST;
    return pd->secondary_tag == HM2_GTAG_MUXED_ENCODER_SEL && number < 2 ? names[number] : NULL;
}

static const struct hm2_md_variant plain_variants[] = {{1, 5, 4, 3}, {2, 5, 4, 3}, {3, 5, 4, 3}, {0x83, 5, 4, 3}};
static const struct hm2_md_variant muxed_variants[] = {{2, 5, 4, 3}, {3, 5, 4, 3}, {4, 5, 4, 3}, {0x84, 5, 4, 3}};

const struct hm2_module_type hm2_encoder_type = {
    .name = "encoder",
    .gtag = HM2_GTAG_ENCODER,
    .variants = plain_variants,
    .variant_count = sizeof plain_variants / sizeof plain_variants[0],
    .config_count = HM2_CFG_ENCODERS,
    .setup = setup_plain,
    .start = encoder_start,
    .unpack = encoder_unpack,
    .pack = encoder_pack,
    .groups = plain_groups,
};

const struct hm2_module_type hm2_muxed_encoder_type = {
    .name = "encoder",
    .gtag = HM2_GTAG_MUXED_ENCODER,
    .variants = muxed_variants,
    .variant_count = sizeof muxed_variants / sizeof muxed_variants[0],
    .config_count = HM2_CFG_ENCODERS,
    .setup = setup_muxed,
    .start = encoder_start,
    .unpack = encoder_unpack,
    .pack = encoder_pack,
    .output_name = select_name,
    .groups = muxed_groups,
};
