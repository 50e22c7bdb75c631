/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Pulses for RC servos (RCPWM, tag 2C). Registers: register map 3.20; points: hal-interface 2.11. */
#include <math.h>

#include <hm2/module.h>

#include "bind.h"
#include "module_types.h"

enum { REG_WIDTH, REG_RATE };

#define WIDTH_MAX   65535u
#define NO_PULSE    0x10000u
#define CLOCKS_STEP 16.0 /* of the clock in a step of the width register */
#define RATE_MIN_HZ 0.01
#define RATE_MAX_HZ 1000.0
#define DIVISOR_MAX 0x7FFFFFFFu

struct servo {
    hm2_float_t *width, *scale, *offset;
};

struct rcpwm {
    hm2_float_t *rate;
    double for_hz;
    struct hm2_window widths;
    struct hm2_section divisor;
    struct servo servo[];
};

static const struct hm2_point global_points[] = {
    HM2_POINT(struct rcpwm, rate, "rate", HM2_FLOAT, HM2_PIN_IN, 50, "Hz", "pulses of all servos, 0.01 to 1000"),
};

static const struct hm2_point points[] = {
    HM2_POINT(struct servo, width, "width", HM2_FLOAT, HM2_PIN_IN, 0, "units",
              "pulse length is width / scale + offset; none at 0"),
    HM2_POINT(struct servo, scale, "scale", HM2_FLOAT, HM2_PIN_IN, 1, "units/ms", "units in a millisecond"),
    HM2_POINT(struct servo, offset, "offset", HM2_FLOAT, HM2_PIN_IN, 0, "ms", "added to the pulse length"),
};

static const struct hm2_point_group groups[] = {
    HM2_GROUP("rcpwmgen", global_points, NULL),
    HM2_GROUP("rcpwmgen.##", points, NULL),
    {.prefix = NULL},
};

HM2_RARE static void take_rate(const struct hm2_module *const module)
{
    struct rcpwm *const ctx = module->context;
    const double wanted_hz = *ctx->rate;
    double hz = isnan(wanted_hz) ? RATE_MIN_HZ : wanted_hz;
    hz = hz < RATE_MIN_HZ ? RATE_MIN_HZ : hz > RATE_MAX_HZ ? RATE_MAX_HZ : hz;
    if (hz != wanted_hz) {
        hm2_notice_point(module, isnan(wanted_hz) ? HM2_NOTICE_VALUE_INVALID : HM2_NOTICE_VALUE_CLAMPED, "rate",
                         HM2_NO_INSTANCE, wanted_hz);
        *ctx->rate = hz;
    }
    ctx->for_hz = hz;
    const uint32_t divisor = hm2_trunc_u32(module->md->clock_hz / hz - 2.0);
    hm2_section_set(&ctx->divisor, 0, divisor < DIVISOR_MAX ? divisor : DIVISOR_MAX);
}

static double scale_of(const struct servo *const servo, const struct hm2_module *const module, const unsigned number)
{
    const double scale = *servo->scale;
    if (isfinite(scale) && scale != 0.0)
        return scale;
    hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "scale", number, scale);
    return *servo->scale = 1.0;
}

/* One step for the shortest pulse, so the register holds one less; nothing at all for less than that. The pin stays as
 * it is: a width that only the offset or the scale makes impossible is right again with them. */
static uint32_t width_of(const struct servo *const servo, const struct hm2_module *const module, const unsigned number)
{
    const double scale = scale_of(servo, module, number);
    const double ms = *servo->width / scale + *servo->offset;
    if (!isfinite(ms)) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "width", number, *servo->width);
        return NO_PULSE;
    }
    if (ms < 0.0) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "width", number, *servo->width);
        return NO_PULSE;
    }
    const double steps = ms * module->md->clock_hz / (CLOCKS_STEP * 1000.0);
    if (steps < 1.0)
        return NO_PULSE;
    const uint32_t width = hm2_trunc_u32(steps - 1.0);
    if (width <= WIDTH_MAX)
        return width;
    hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "width", number, *servo->width);
    return WIDTH_MAX;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct rcpwm *const ctx = module->context;
    (void)cycle;
    if (!(*ctx->rate == ctx->for_hz))
        take_rate(module);
    for (unsigned i = 0; i < module->instances; i++)
        hm2_window_set(&ctx->widths, i, width_of(&ctx->servo[i], module, i));
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    if (module->instances == 0)
        return 0;
    if (hm2_check_page(module, setup_, "RC servo outputs"))
        return HM2_ERR_MISMATCH;
    struct rcpwm *const ctx = hm2_setup_alloc(setup_, sizeof *ctx + module->instances * sizeof ctx->servo[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->for_hz = NAN;
    int err = hm2_claim_pins(module, setup_, HM2_GTAG_NONE, module->instances, false, NULL);
    if (!err)
        err = hm2_bind_group(setup_, &groups[0], ctx, 0);
    for (unsigned i = 0; !err && i < module->instances; i++)
        err = hm2_bind_group(setup_, &groups[1], &ctx->servo[i], i);
    if (!err)
        err = hm2_plan_add_write(setup_->plan, &ctx->widths, HM2_RANK_NORMAL, hm2_md_address(module->md, REG_WIDTH, 0),
                                 module->instances, setup_->diag);
    return err ? err
               : hm2_plan_add_setup(setup_->plan, &ctx->divisor, HM2_RANK_NORMAL,
                                    hm2_md_address(module->md, REG_RATE, 0), 1, 0, setup_->diag);
}

const struct hm2_module_type hm2_rcpwmgen_type = {
    .name = "rcpwmgen",
    .gtag = HM2_GTAG_RCPWM,
    .config_count = HM2_CFG_RCPWMGENS,
    .setup = setup,
    .pack = pack,
    .groups = groups,
};
