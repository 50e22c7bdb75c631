/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * HM2DPLL: a clock in the card that follows the host's cycle, with four timers around it that start sampling
 * (register map 3.15, hal-interface 2.6, tests/data/hm2dpll). Reading the sync register is what it follows, so that
 * read comes first in the request.
 */
#include <math.h>

#include "bind.h"
#include "dpll.h"
#include "module_types.h"

enum { REG_BASE_RATE, REG_PHASE, REG_CONTROL0, REG_CONTROL1, REG_TIMERS12, REG_TIMERS34, REG_SYNC };

#define TIMERS          4u
#define DDS_BITS        42u       /* accumulator size of every known firmware (register map 3.15) */
#define PRESCALE_MAX    255u      /* control 0, bits 31..24 */
#define PLIMIT_MAX      0xFFFFFFu /* control 0, bits 23..0 */
#define TIME_CONST_MAX  0xFFFFu   /* control 1, bits 31..16 */
#define START_UP_WRITES 100u      /* writes during which the accumulator is held at 0 (hal-interface 2.6) */

struct timer {
    hm2_float_t *offset_us;
    double for_us; /* offset that the register was computed from */
};

struct dpll {
    hm2_float_t *base_freq_khz, *phase_error_us;
    hm2_u32_t *time_const, *plimit, *dds_size, *prescale;
    struct timer timer[TIMERS];
    double clock_hz;
    /* What the registers were computed from. */
    double for_khz;
    uint32_t for_dds_size, for_time_const, for_plimit;
    int64_t for_period_ns; /* 0 = never computed */
    struct hm2_window sync, control1_read;
    struct hm2_section base_rate, phase, control0, control1, timers12, timers34;
};

static const struct hm2_point timer_points[] = {
    HM2_POINT(struct timer, offset_us, "##.timer-us", HM2_FLOAT, HM2_PIN_IN, 100, "us",
              "offset of the timer from the read; negative = before it"),
};

static const struct hm2_point points[] = {
    HM2_POINT(struct dpll, base_freq_khz, "base-freq-khz", HM2_FLOAT, HM2_PIN_IN, -1, "kHz",
              "frequency of the loop; negative = set from the period at the first write"),
    HM2_POINT(struct dpll, phase_error_us, "phase-error-us", HM2_FLOAT, HM2_PIN_OUT, 0, "us",
              "how late the last read was, as the card saw it"),
    HM2_POINT(struct dpll, time_const, "time-const", HM2_U32, HM2_PIN_IN, 2000, "cycles",
              "time constant of the filter"),
    HM2_POINT(struct dpll, plimit, "plimit", HM2_U32, HM2_PIN_IN, 0x400000, "", "limit of the phase correction"),
    HM2_POINT(struct dpll, dds_size, "ddsize", HM2_U32, HM2_PIN_OUT, 0, "bits", "size of the phase accumulator"),
    HM2_POINT(struct dpll, prescale, "prescale", HM2_U32, HM2_PIN_OUT, 1, "", "clocks per step of the accumulator"),
};

enum { GROUP_TIMER, GROUP_DPLL };

static const struct hm2_point_group groups[] = {
    [GROUP_TIMER] = {"dpll", timer_points, sizeof timer_points / sizeof timer_points[0], "01 to 04"},
    [GROUP_DPLL] = {"dpll", points, sizeof points / sizeof points[0], NULL},
    {NULL, NULL, 0, NULL},
};

static int add_registers(struct dpll *const ctx, const struct hm2_md *const md, const struct hm2_setup *const setup)
{
    const struct {
        struct hm2_section *section;
        unsigned reg, flags;
    } sections[] = {
        {&ctx->base_rate, REG_BASE_RATE, 0}, {&ctx->phase, REG_PHASE, HM2_SECTION_ON_DEMAND},
        {&ctx->control0, REG_CONTROL0, 0},   {&ctx->control1, REG_CONTROL1, 0},
        {&ctx->timers12, REG_TIMERS12, 0},   {&ctx->timers34, REG_TIMERS34, 0},
    };
    int err =
        hm2_plan_add_read(setup->plan, &ctx->sync, HM2_RANK_ARRIVAL, hm2_md_address(md, REG_SYNC, 0), 1, setup->diag);
    if (err == 0)
        err = hm2_plan_add_read(setup->plan, &ctx->control1_read, HM2_RANK_NORMAL, hm2_md_address(md, REG_CONTROL1, 0),
                                1, setup->diag);
    for (size_t i = 0; err == 0 && i < sizeof sections / sizeof sections[0]; i++)
        err = hm2_plan_add_setup(setup->plan, sections[i].section, HM2_RANK_NORMAL,
                                 hm2_md_address(md, sections[i].reg, 0), 1, sections[i].flags, setup->diag);
    return err;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    if (module->instances == 0)
        return 0;
    struct dpll *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->clock_hz = module->md->clock_hz;
    int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL);
    for (unsigned i = 0; err == 0 && i < TIMERS; i++)
        err = hm2_bind_group(setup, &groups[GROUP_TIMER], &ctx->timer[i], i + 1);
    if (err == 0)
        err = hm2_bind_group(setup, &groups[GROUP_DPLL], ctx, 0);
    return err == 0 ? add_registers(ctx, module->md, setup) : err;
}

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct dpll *const ctx = module->context;
    if (!ctx)
        return;
    /* The register is the phase in 2^-32 periods, signed, positive when the read came late (register map 3.15). */
    const int32_t phase = (int32_t)hm2_window_get(&ctx->sync, 0);
    *ctx->phase_error_us = phase * ((double)cycle->period_ns / 4294967296000.0);
    *ctx->dds_size = hm2_window_get(&ctx->control1_read, 0) & 0xFFu;
}

/* A limit of a register that a pin exceeds. */
static uint32_t limited(const struct hm2_module *const module, const uint32_t value, const uint32_t limit)
{
    if (value <= limit)
        return value;
    hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "plimit", HM2_NO_INSTANCE, value);
    return limit;
}

static double loop_khz(const struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct dpll *const ctx = module->context;
    const double from_period = 1e6 / (double)cycle->period_ns;
    if (*ctx->base_freq_khz < 0.0)
        *ctx->base_freq_khz = from_period;
    const double khz = *ctx->base_freq_khz;
    if (khz > 0.0 && khz <= 1e9)
        return khz;
    hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "base-freq-khz", HM2_NO_INSTANCE, khz);
    return from_period;
}

/* False for a NaN: what cannot be used is kept as NaN, and so reported in every cycle. */
static bool same(const double a, const double b)
{
    return a == b;
}

/* In the same way what exceeds its limit is kept as something else. */
static uint32_t seen(const uint32_t value, const uint32_t limit)
{
    return value <= limit ? value : ~value;
}

/* The accumulator of dds_size bits gains base_rate every prescale clocks and overflows once a period. */
static void set_rate(const struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct dpll *const ctx = module->context;
    const double khz = loop_khz(module, cycle);
    ctx->for_khz = same(*ctx->base_freq_khz, khz) ? khz : NAN;
    ctx->for_dds_size = *ctx->dds_size;
    const uint32_t plimit = *ctx->plimit;
    ctx->for_plimit = seen(plimit, PLIMIT_MAX);
    const uint32_t bits = ctx->for_dds_size >= 32u && ctx->for_dds_size <= 62u ? ctx->for_dds_size : DDS_BITS;
    const double span = (double)((uint64_t)1 << bits);
    const uint32_t wanted = hm2_trunc_u32(1073741824.0 * ctx->clock_hz / (span * khz * 1000.0));
    const uint32_t prescale = wanted < 1 ? 1 : wanted > PRESCALE_MAX ? PRESCALE_MAX : wanted;
    *ctx->prescale = prescale;
    hm2_section_set(&ctx->base_rate, 0, hm2_trunc_u32(khz * 1000.0 * span * prescale / ctx->clock_hz));
    hm2_section_set(&ctx->control0, 0, prescale << 24 | limited(module, plimit, PLIMIT_MAX));
}

/* An advance in 1/65536 periods (register map 3.15); through a signed type, the usual offset is negative. */
static uint32_t timer_value(const struct hm2_module *const module, const unsigned number, const double per_us)
{
    struct dpll *const ctx = module->context;
    const double offset_us = *ctx->timer[number].offset_us;
    ctx->timer[number].for_us = isfinite(offset_us) ? offset_us : NAN;
    if (!isfinite(offset_us)) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "timer-us", number + 1, offset_us);
        return 0;
    }
    return (uint32_t)hm2_trunc_s32(-offset_us * per_us) & 0xFFFFu;
}

HM2_RARE static void set_registers(const struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct dpll *const ctx = module->context;
    const double per_us = 65536e3 / (double)cycle->period_ns;
    uint32_t value[TIMERS];
    set_rate(module, cycle);
    ctx->for_period_ns = cycle->period_ns;
    const uint32_t time_const = *ctx->time_const;
    ctx->for_time_const = seen(time_const, TIME_CONST_MAX);
    hm2_section_set(&ctx->control1, 0, limited(module, time_const, TIME_CONST_MAX) << 16);
    for (unsigned i = 0; i < TIMERS; i++)
        value[i] = timer_value(module, i, per_us);
    hm2_section_set(&ctx->timers12, 0, value[1] << 16 | value[0]);
    hm2_section_set(&ctx->timers34, 0, value[3] << 16 | value[2]);
}

HM2_RARE static void hold_at_zero(struct dpll *const ctx)
{
    hm2_section_touch(&ctx->phase);
    hm2_section_touch(&ctx->control0); /* writing it clears the filtered phase error (tests/data/hm2dpll) */
}

int64_t hm2_dpll_timer_ns(const struct hm2_module *const module, const unsigned timer)
{
    const struct dpll *const ctx = module ? module->context : NULL;
    const double offset_us = ctx ? *ctx->timer[timer - 1].offset_us : 0.0;
    return isfinite(offset_us) && fabs(offset_us) < 1e9 ? (int64_t)(offset_us * 1e3) : 0;
}

void hm2_dpll_offer_timer_ns(const struct hm2_module *const module, const unsigned timer, const int64_t ns)
{
    const struct dpll *const ctx = module ? module->context : NULL;
    if (ctx && hm2_dpll_timer_ns(module, timer) < ns)
        *ctx->timer[timer - 1].offset_us = (double)ns * 1e-3;
}

void hm2_dpll_align(struct hm2_module *const module)
{
    if (module && module->context)
        hold_at_zero(module->context);
}

static bool is_unchanged(const struct dpll *const ctx, const struct hm2_cycle *const cycle)
{
    const uint32_t words = (*ctx->plimit ^ ctx->for_plimit) | (*ctx->time_const ^ ctx->for_time_const) |
                           (*ctx->dds_size ^ ctx->for_dds_size);
    if (words != 0 || cycle->period_ns != ctx->for_period_ns || !same(*ctx->base_freq_khz, ctx->for_khz))
        return false;
    for (const struct timer *timer = ctx->timer; timer < ctx->timer + TIMERS; timer++)
        if (!same(*timer->offset_us, timer->for_us))
            return false;
    return true;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct dpll *const ctx = module->context;
    if (!ctx)
        return;
    if (!is_unchanged(ctx, cycle))
        set_registers(module, cycle);
    if (cycle->writes < START_UP_WRITES)
        hold_at_zero(ctx);
}

static const struct hm2_md_variant variants[] = {{.version = 0, .registers = 7, .instance_stride = 4, .multiple = 0}};

const struct hm2_module_type hm2_dpll_type = {
    .name = "dpll",
    .gtag = HM2_GTAG_DPLL,
    .variants = variants,
    .variant_count = 1,
    .config_count = HM2_CFG_DPLLS,
    .clamp_count = true,
    .setup = setup,
    .unpack = unpack,
    .pack = pack,
    .groups = groups,
};
