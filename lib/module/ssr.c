/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Transformer-coupled outputs, "solid state relays" (register map 3.16, hal-interface 2.12). An output is on while it
 * toggles against the common AC reference, so the reference must be driven before the square wave starts: the rate is
 * written after the ports.
 */
#include "bind.h"
#include "module_types.h"
#include "outputs.h"

enum { REG_DATA, REG_RATE };

#define RATE_MIN_HZ 25000u
#define RATE_MAX_HZ 25000000u
#define RATE_ENABLE 0x1000u
#define DIVISOR_MAX 0x7FFu /* from 0x800 on the carry is always set (register map 3.16) */
#define LAST_OUTPUT 30u    /* 31 is the AC reference */

struct ssr {
    hm2_u32_t *rate;
    uint32_t register_for_hz; /* rate that the register was computed from */
    struct hm2_window data;
    struct hm2_section rate_section;
    struct hm2_outputs outputs;
};

struct ssrs {
    uint32_t clock_hz;
    struct ssr *ssr;
};

static const struct hm2_point points[] = {
    HM2_POINT(struct ssr, rate, "rate", HM2_U32, HM2_PIN_IN, 1000000, "Hz",
              "frequency of the AC drive, 25 kHz to 25 MHz; 0 = off"),
};

enum { GROUP_SSR, GROUP_OUTPUTS };

static const struct hm2_point_group groups[] = {
    [GROUP_SSR] = {"ssr.##", points, sizeof points / sizeof points[0], NULL},
    [GROUP_OUTPUTS] = {"ssr.##", hm2_output_points, HM2_OUTPUT_ROWS, "outputs that the firmware describes"},
    {NULL, NULL, 0, NULL},
};

static int setup_instance(struct ssr *const ssr, const struct hm2_module *const module,
                          const struct hm2_setup *const setup, const unsigned unit)
{
    int err = hm2_bind_group(setup, &groups[GROUP_SSR], ssr, unit);
    if (err == 0)
        err = hm2_outputs_bind(&ssr->outputs, module, setup, &groups[GROUP_OUTPUTS], unit, LAST_OUTPUT);
    if (err == 0)
        err = hm2_plan_add_write(setup->plan, &ssr->data, HM2_RANK_NORMAL, hm2_md_address(module->md, REG_DATA, unit),
                                 1, setup->diag);
    if (err == 0)
        err = hm2_plan_add_setup(setup->plan, &ssr->rate_section, HM2_RANK_LATE,
                                 hm2_md_address(module->md, REG_RATE, unit), 1, 0, setup->diag);
    return err;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    if (module->instances == 0)
        return 0;
    struct ssrs *const ctx = hm2_setup_alloc(setup, sizeof *ctx);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->clock_hz = module->md->clock_hz;
    ctx->ssr = hm2_setup_alloc(setup, module->instances * sizeof *ctx->ssr);
    if (!ctx->ssr)
        return HM2_ERR_NOMEM;
    int err = hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL);
    for (unsigned unit = 0; err == 0 && unit < module->instances; unit++)
        err = setup_instance(&ctx->ssr[unit], module, setup, unit);
    return err;
}

/* f = clock / (2 * (divisor + 2)) (register map 3.16). */
static uint32_t rate_value(const uint32_t clock_hz, const uint32_t rate_hz)
{
    if (rate_hz == 0)
        return 0;
    const uint32_t half_period = clock_hz / (2u * rate_hz);
    const uint32_t divisor = half_period < 2u ? 0 : half_period - 2u;
    return RATE_ENABLE | (divisor > DIVISOR_MAX ? DIVISOR_MAX : divisor);
}

static void set_rate(const struct hm2_module *const module, struct ssr *const ssr, const uint32_t wanted_hz)
{
    const struct ssrs *const ctx = module->context;
    uint32_t rate_hz = wanted_hz;
    if (rate_hz != 0 && rate_hz < RATE_MIN_HZ)
        rate_hz = RATE_MIN_HZ;
    if (rate_hz > RATE_MAX_HZ)
        rate_hz = RATE_MAX_HZ;
    /* The pin stays as it is, as with LinuxCNC's driver: it may show a signal that others read. */
    if (rate_hz != wanted_hz)
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "rate", (unsigned)(ssr - ctx->ssr), wanted_hz);
    ssr->register_for_hz = wanted_hz;
    hm2_section_set(&ssr->rate_section, 0, rate_value(ctx->clock_hz, rate_hz));
}

HM2_RARE static void set_rates(const struct hm2_module *const module, const bool first)
{
    const struct ssrs *const ctx = module->context;
    for (struct ssr *ssr = ctx->ssr, *const end = ssr + module->instances; ssr < end; ssr++) {
        const uint32_t rate_hz = *ssr->rate;
        if (first || rate_hz != ssr->register_for_hz)
            set_rate(module, ssr, rate_hz);
    }
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct ssrs *const ctx = module->context;
    uint32_t changed = cycle->writes == 0;
    for (struct ssr *ssr = ctx->ssr, *const end = ssr + module->instances; ssr < end; ssr++) {
        hm2_window_set(&ssr->data, 0, hm2_outputs_word(&ssr->outputs));
        changed |= *ssr->rate ^ ssr->register_for_hz;
    }
    if (changed)
        set_rates(module, cycle->writes == 0);
}

const struct hm2_module_type hm2_ssr_type = {
    .name = "ssr",
    .gtag = HM2_GTAG_SSR,
    .config_count = HM2_CFG_SSRS,
    .setup = setup,
    .pack = pack,
    .groups = groups,
};
