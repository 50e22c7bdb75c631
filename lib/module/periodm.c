/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* PeriodM (tag C8): meters of period and duty cycle. Registers: register map 3.19; points: hal-interface 2.15. */
#include <math.h>

#include <hm2/module.h>

#include "bind.h"
#include "module_types.h"

enum { REG_MODE, REG_PERIOD, REG_WIDTH, REG_LIMIT };

#define INVERT        0x1u
#define VALID         0x2u
#define LEVEL         0x4u
#define AVERAGES_MAX  4095u
#define AVERAGE_SHIFT 4
#define FILTER_SHIFT  16
#define FILTER_MAX    0xFFFFu

struct meter {
    hm2_float_t *period_us, *width_us, *duty_cycle, *frequency;
    hm2_float_t *duty_scale, *duty_offset, *filter_us, *minimum_hz;
    hm2_u32_t *averages;
    hm2_bit_t *invert, *valid, *input_status;
    double for_filter, for_minimum;
    uint32_t for_averages;
    bool for_invert;
};

struct periodm {
    struct hm2_window modes, periods, widths;
    struct hm2_section mode, limits;
    struct meter meter[];
};

#define ROW(field, name, type, dir, init, unit, help) HM2_POINT(struct meter, field, name, type, dir, init, unit, help)

static const struct hm2_point points[] = {
    ROW(period_us, "period_us", HM2_FLOAT, HM2_PIN_OUT, 0, "us", "mean period"),
    ROW(width_us, "width_us", HM2_FLOAT, HM2_PIN_OUT, 0, "us", "mean pulse length"),
    ROW(duty_cycle, "duty_cycle", HM2_FLOAT, HM2_PIN_OUT, 0, "", "width / period, scaled"),
    ROW(frequency, "frequency", HM2_FLOAT, HM2_PIN_OUT, 0, "Hz", "mean frequency"),
    ROW(duty_scale, "duty_cycle_scale", HM2_FLOAT, HM2_PIN_IN, 100, "", "duty_cycle when always high"),
    ROW(duty_offset, "duty_cycle_offset", HM2_FLOAT, HM2_PIN_IN, 0, "", "added to duty_cycle"),
    ROW(filter_us, "filtertc_us", HM2_FLOAT, HM2_PIN_IN, 1, "us", "input must be steady for so long"),
    ROW(minimum_hz, "minimum_frequency", HM2_FLOAT, HM2_PIN_IN, 1, "Hz", "what is slower is not valid"),
    ROW(averages, "averages", HM2_U32, HM2_PIN_IO, 1, "", "periods that are averaged, 1 to 4095"),
    ROW(invert, "invert", HM2_BIT, HM2_PIN_IO, 0, "", "1: the low time is the width"),
    ROW(valid, "valid", HM2_BIT, HM2_PIN_OUT, 0, "", "1: the input is fast enough"),
    ROW(input_status, "input_status", HM2_BIT, HM2_PIN_OUT, 0, "", "level of the input"),
};

static const struct hm2_point_group groups[] = {
    HM2_GROUP("periodm.##", points, NULL),
    {.prefix = NULL},
};

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

static double finite_pin(hm2_float_t *const pin, const struct hm2_module *const module, const char *const name,
                         const unsigned number)
{
    const double value = *pin;
    if (isfinite(value))
        return value;
    hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, name, number, value);
    return 0.0;
}

/* What was measured belongs to the number of periods that the card was told before. */
static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct periodm *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; i < module->instances; i++) {
        const struct meter *const m = &ctx->meter[i];
        const uint32_t mode = hm2_window_get(&ctx->modes, i);
        const double averages = m->for_averages ? m->for_averages : 1;
        const double period = hm2_window_get(&ctx->periods, i), width = hm2_window_get(&ctx->widths, i);
        const double us = 1e6 / module->md->clock_hz / averages;
        *m->valid = mode & VALID;
        *m->input_status = mode & LEVEL;
        *m->period_us = period * us;
        *m->width_us = width * us;
        if (period <= 0.0)
            continue;
        *m->duty_cycle = width / period * finite_pin(m->duty_scale, module, "duty_cycle_scale", i) +
                         finite_pin(m->duty_offset, module, "duty_cycle_offset", i);
        *m->frequency = module->md->clock_hz / period * averages;
    }
}

static uint32_t filter_clocks(const struct meter *const m, const struct hm2_module *const module, const unsigned number)
{
    const double wanted = *m->filter_us, per_us = module->md->clock_hz / 1e6;
    if (wanted >= 0.0 && wanted * per_us < FILTER_MAX + 1.0)
        return hm2_trunc_u32(wanted * per_us);
    hm2_notice_point(module, isnan(wanted) ? HM2_NOTICE_VALUE_INVALID : HM2_NOTICE_VALUE_CLAMPED, "filtertc_us", number,
                     wanted);
    *m->filter_us = wanted > 0.0 ? FILTER_MAX / per_us : 0.0;
    return wanted > 0.0 ? FILTER_MAX : 0;
}

static uint32_t averages_of(const struct meter *const m, const struct hm2_module *const module, const unsigned number)
{
    const uint32_t wanted = *m->averages;
    const uint32_t possible = wanted < 1 ? 1 : wanted > AVERAGES_MAX ? AVERAGES_MAX : wanted;
    if (possible != wanted)
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "averages", number, wanted);
    return *m->averages = possible;
}

static uint32_t limit_of(const struct meter *const m, const struct hm2_module *const module, const unsigned number)
{
    const double minimum_hz = *m->minimum_hz;
    const double clocks = module->md->clock_hz / minimum_hz * *m->averages;
    if (minimum_hz > 0.0 && clocks <= (double)UINT32_MAX)
        return hm2_trunc_u32(clocks);
    hm2_notice_point(module, isnan(minimum_hz) ? HM2_NOTICE_VALUE_INVALID : HM2_NOTICE_VALUE_CLAMPED,
                     "minimum_frequency", number, minimum_hz);
    *m->minimum_hz = module->md->clock_hz * (double)*m->averages / (double)UINT32_MAX;
    return UINT32_MAX;
}

HM2_RARE static void take_settings(const struct hm2_module *const module, const unsigned number)
{
    struct periodm *const ctx = module->context;
    struct meter *const m = &ctx->meter[number];
    const uint32_t filter = filter_clocks(m, module, number), averages = averages_of(m, module, number);
    hm2_section_set(&ctx->mode, number,
                    filter << FILTER_SHIFT | (averages - 1u) << AVERAGE_SHIFT | (*m->invert ? INVERT : 0));
    hm2_section_set(&ctx->limits, number, limit_of(m, module, number));
    m->for_filter = *m->filter_us;
    m->for_minimum = *m->minimum_hz;
    m->for_averages = averages;
    m->for_invert = *m->invert;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct periodm *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; i < module->instances; i++) {
        const struct meter *const m = &ctx->meter[i];
        if (!(*m->filter_us == m->for_filter) || !(*m->minimum_hz == m->for_minimum) ||
            *m->averages != m->for_averages || *m->invert != m->for_invert)
            take_settings(module, i);
    }
}

/* ---- set-up --------------------------------------------------------------------------------------------------------
 */

/* Reading the mode latches period and width (register map 3.19): it comes first. */
static int add_registers(struct periodm *const ctx, const struct hm2_module *const module,
                         struct hm2_setup *const setup)
{
    const struct hm2_md *const md = module->md;
    const unsigned n = module->instances;
    const uint16_t mode = hm2_md_address(md, REG_MODE, 0);
    int err = hm2_plan_add_read(setup->plan, &ctx->modes, HM2_RANK_EARLY, mode, n, setup->diag);
    if (!err)
        err = hm2_plan_add_read(setup->plan, &ctx->periods, HM2_RANK_NORMAL, hm2_md_address(md, REG_PERIOD, 0), n,
                                setup->diag);
    if (!err)
        err = hm2_plan_add_read(setup->plan, &ctx->widths, HM2_RANK_NORMAL, hm2_md_address(md, REG_WIDTH, 0), n,
                                setup->diag);
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &ctx->mode, HM2_RANK_NORMAL, mode, n, 0, setup->diag);
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &ctx->limits, HM2_RANK_NORMAL, hm2_md_address(md, REG_LIMIT, 0), n, 0,
                                 setup->diag);
    return err;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    if (module->instances == 0)
        return 0;
    if (hm2_check_page(module, setup_, "period meters"))
        return HM2_ERR_MISMATCH;
    struct periodm *const ctx = hm2_setup_alloc(setup_, sizeof *ctx + module->instances * sizeof ctx->meter[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    int err = hm2_claim_pins(module, setup_, HM2_GTAG_NONE, module->instances, false, NULL);
    for (unsigned i = 0; !err && i < module->instances; i++)
        err = hm2_bind_group(setup_, &groups[0], &ctx->meter[i], i);
    return err ? err : add_registers(ctx, module, setup_);
}

static const struct hm2_md_variant variants[] = {{0, 4, 4, 0xF}};

const struct hm2_module_type hm2_periodm_type = {
    .name = "periodm",
    .gtag = HM2_GTAG_PERIODM,
    .variants = variants,
    .variant_count = 1,
    .config_count = HM2_CFG_PERIODMS,
    .setup = setup,
    .unpack = unpack,
    .pack = pack,
    .groups = groups,
};
