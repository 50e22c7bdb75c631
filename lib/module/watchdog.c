/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Watchdog (register map 3.2, hal-interface 2.2). It runs from the first write on; every write pets it. A bite is
 * latched in has_bit until a person clears that pin; the next write then zeroes the status and sends every set-up
 * register again, because the bite cleared direction and open drain of all ports.
 *
 * Writing a value with bit 31 set to a running dog is itself a bite (register map 3.2), so the "disabled" value is
 * only ever written at load.
 */
#include "watchdog.h"

#include "bind.h"
#include "module_types.h"

enum { REG_TIMER, REG_STATUS, REG_RESET };

#define TIMER_DISABLED 0x80000000u
#define TIMER_MAX      0x7FFFFFFFu
#define STATUS_BITTEN  0x00000001u
#define PET            0x5A000000u
#define NS_PER_S       1000000000u

enum dog { DOG_WATCHES, DOG_HAS_BITTEN, DOG_IS_CLEARED };

struct watchdog {
    hm2_bit_t *has_bit;
    hm2_u32_t *timeout_ns;
    enum dog dog;          /* IS_CLEARED: status was zeroed, and the card has not confirmed it yet */
    bool enabled;          /* the timer register holds a time, no longer "disabled" */
    uint32_t timer_for_ns; /* timeout_ns that it was computed from */
    uint32_t clock_hz;
    struct hm2_window status, reset;
    struct hm2_section timer, status_zero;
    struct hm2_plan *plan;
};

static const struct hm2_point points[] = {
    HM2_POINT(struct watchdog, has_bit, "has_bit", HM2_BIT, HM2_PIN_IO, 0, "",
              "1 = the watchdog has bitten; set to 0 to recover"),
    HM2_POINT(struct watchdog, timeout_ns, "timeout_ns", HM2_U32, HM2_PARAM_RW, 5000000, "ns",
              "time without a write after which the card disables all outputs"),
};

static const struct hm2_point_group groups[] = {
    {"watchdog", points, sizeof points / sizeof points[0], NULL},
    {NULL, NULL, 0, NULL},
};

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    const struct hm2_md *const md = module->md;
    struct watchdog *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->clock_hz = md->clock_hz;
    ctx->plan = setup->plan;
    int err = hm2_bind_group(setup, &groups[0], ctx, 0);
    if (err == 0)
        err = hm2_plan_add_read(setup->plan, &ctx->status, HM2_RANK_NORMAL, hm2_md_address(md, REG_STATUS, 0), 1,
                                setup->diag);
    if (err == 0)
        err = hm2_plan_add_write(setup->plan, &ctx->reset, HM2_RANK_NORMAL, hm2_md_address(md, REG_RESET, 0), 1,
                                 setup->diag);
    if (err == 0)
        err = hm2_plan_add_setup(setup->plan, &ctx->timer, HM2_RANK_FIRST, hm2_md_address(md, REG_TIMER, 0), 1, 0,
                                 setup->diag);
    if (err == 0)
        err = hm2_plan_add_setup(setup->plan, &ctx->status_zero, HM2_RANK_FIRST, hm2_md_address(md, REG_STATUS, 0), 1,
                                 HM2_SECTION_ON_DEMAND, setup->diag);
    if (err == 0) {
        /* Old firmware says "bitten" right after power-up (tests/data/watchdog), and so does a dog that an earlier
         * program left behind: the first status that counts is one read after it was zeroed. */
        ctx->dog = DOG_IS_CLEARED;
        hm2_section_set(&ctx->timer, 0, TIMER_DISABLED);
        hm2_section_touch(&ctx->status_zero);
    }
    return err;
}

/* Until the card has taken the zero, its status still tells of the old bite. */
static bool tells_of_a_bite(const struct watchdog *const ctx)
{
    return (hm2_window_get(&ctx->status, 0) & STATUS_BITTEN) &&
           (ctx->dog == DOG_WATCHES || (ctx->dog == DOG_IS_CLEARED && hm2_section_confirmed(&ctx->status_zero)));
}

HM2_RARE static void bite(struct watchdog *const ctx)
{
    ctx->dog = DOG_HAS_BITTEN;
    *ctx->has_bit = true;
}

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct watchdog *const ctx = module->context;
    (void)cycle;
    if (ctx->dog == DOG_HAS_BITTEN)
        return;
    if (tells_of_a_bite(ctx)) {
        bite(ctx);
        hm2_notice(module, HM2_NOTICE_WATCHDOG_BIT, 0, 0.0);
    } else if (ctx->dog == DOG_IS_CLEARED && hm2_section_confirmed(&ctx->status_zero)) {
        ctx->dog = DOG_WATCHES;
    }
}

/* N for a time-out of (N + 1) clocks (register map 3.2). */
HM2_RARE static void set_timer(const struct hm2_module *const module, const struct hm2_cycle *const cycle,
                               const uint32_t timeout_ns)
{
    struct watchdog *const ctx = module->context;
    const uint64_t clocks = (uint64_t)timeout_ns * ctx->clock_hz / NS_PER_S;
    ctx->enabled = true;
    ctx->timer_for_ns = timeout_ns;
    if (clocks > (uint64_t)TIMER_MAX + 1u) {
        /* Only a clock above 500 MHz gets here, so the longest time fits 32 bits. */
        ctx->timer_for_ns = (uint32_t)(((uint64_t)TIMER_MAX + 1u) * NS_PER_S / ctx->clock_hz);
        *ctx->timeout_ns = ctx->timer_for_ns;
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "timeout_ns", HM2_NO_INSTANCE, timeout_ns);
    }
    const uint64_t value = clocks == 0 ? 0 : clocks - 1;
    hm2_section_set(&ctx->timer, 0, value > TIMER_MAX ? TIMER_MAX : (uint32_t)value);
    if (2.0 * ctx->timer_for_ns < 3.0 * (double)cycle->period_ns)
        hm2_notice_point(module, HM2_NOTICE_TIMEOUT_SHORT, "timeout_ns", HM2_NO_INSTANCE, ctx->timer_for_ns);
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct watchdog *const ctx = module->context;
    const uint32_t timeout_ns = *ctx->timeout_ns;
    if (!ctx->enabled || timeout_ns != ctx->timer_for_ns)
        set_timer(module, cycle, timeout_ns);
    if (ctx->dog == DOG_HAS_BITTEN && !*ctx->has_bit) {
        ctx->dog = DOG_IS_CLEARED;
        hm2_section_touch(&ctx->status_zero);
        hm2_plan_touch_all(ctx->plan);
    }
    hm2_window_set(&ctx->reset, 0, PET);
}

bool hm2_watchdog_bitten(const struct hm2_module *const module)
{
    const struct watchdog *const ctx = module ? module->context : NULL;
    return ctx && ctx->dog == DOG_HAS_BITTEN && *ctx->has_bit;
}

bool hm2_watchdog_bites(const struct hm2_module *const module)
{
    return module && module->context && tells_of_a_bite(module->context);
}

int64_t hm2_watchdog_timeout_ns(const struct hm2_module *const module)
{
    const struct watchdog *const ctx = module ? module->context : NULL;
    return ctx ? ctx->timer_for_ns : 0;
}

void hm2_watchdog_raise(struct hm2_module *const module)
{
    if (module && module->context)
        bite(module->context);
}

void hm2_watchdog_clear(struct hm2_module *const module)
{
    const struct watchdog *const ctx = module ? module->context : NULL;
    if (ctx)
        *ctx->has_bit = false;
}

uint16_t hm2_watchdog_timer_address(const struct hm2_module *const module)
{
    return module ? hm2_md_address(module->md, REG_TIMER, 0) : 0;
}

static const struct hm2_md_variant variants[] = {{.version = 0, .registers = 3, .instance_stride = 4, .multiple = 0}};

const struct hm2_module_type hm2_watchdog_type = {
    .name = "watchdog",
    .gtag = HM2_GTAG_WATCHDOG,
    .variants = variants,
    .variant_count = 1,
    .config_count = -1,
    .setup = setup,
    .unpack = unpack,
    .pack = pack,
    .groups = groups,
};
