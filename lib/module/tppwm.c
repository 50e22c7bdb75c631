/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Three-phase PWM (tag 13). Registers: register map 3.7; points: hal-interface 2.10.
 *
 * Two things that the firmware does are kept from happening here (traces tppwm). A value below the dead time would
 * turn both switches of a leg on: values never go below it. Enabling while the fault input is active turns the outputs
 * on for a clock: after a fault the enable pin must go to 0 first.
 */
#include <math.h>

#include <hm2/module.h>

#include "bind.h"
#include "module_types.h"

enum { REG_VALUE, REG_ENABLE, REG_SETUP, REG_RATE };

#define PHASES       3u
#define PHASE_BITS   10u
#define VALUE_HALF   512.0
#define VALUE_SWING  511.0
#define ENABLED      0x1u
#define FAULT        0x2u
#define DEAD_MAX     511u
#define FAULT_HIGH   0x8000u
#define SAMPLE_SHIFT 16
#define SAMPLE_SPAN  1023.0
#define RATE_ONE     65536.0
#define RATE_MAX     65535u
#define CYCLE_COUNTS 2048.0

struct gen {
    hm2_float_t *value[PHASES];
    hm2_bit_t *enable, *fault;
    hm2_float_t *scale, *deadtime, *sample_time;
    hm2_bit_t *fault_invert;

    double for_deadtime, for_sample;
    bool for_invert;
    uint32_t dead, dead_before; /* register units; before: what the card may still have */
    bool asked, latched;        /* outputs asked for; a fault came since, and enable was not off yet */
};

struct tppwm {
    hm2_u32_t *frequency;
    uint32_t for_hz;
    bool looked;
    uint32_t rate;
    struct hm2_window values, states;
    struct hm2_section enables, setups, rates;
    struct gen gen[];
};

#define ROW(field, name, type, dir, init, unit, help) HM2_POINT(struct gen, field, name, type, dir, init, unit, help)

static const struct hm2_point global_points[] = {
    HM2_POINT(struct tppwm, frequency, "frequency", HM2_U32, HM2_PARAM_RW, 20000, "Hz", "of all generators"),
};

static const struct hm2_point points[] = {
    ROW(value[0], "A-value", HM2_FLOAT, HM2_PIN_IN, 0, "units", "phase A; value / scale from -1 to 1"),
    ROW(value[1], "B-value", HM2_FLOAT, HM2_PIN_IN, 0, "units", "phase B"),
    ROW(value[2], "C-value", HM2_FLOAT, HM2_PIN_IN, 0, "units", "phase C"),
    ROW(enable, "enable", HM2_BIT, HM2_PIN_IN, 0, "", "1: outputs on; after a fault it must be 0 once"),
    ROW(fault, "fault", HM2_BIT, HM2_PIN_OUT, 0, "", "1: the fault input turned the outputs off"),
    ROW(scale, "scale", HM2_FLOAT, HM2_PARAM_RW, 1, "units", "value at full modulation"),
    ROW(deadtime, "deadtime", HM2_FLOAT, HM2_PARAM_RW, 5000, "ns", "both switches of a leg are off for so long"),
    ROW(fault_invert, "fault-invert", HM2_BIT, HM2_PARAM_RW, 0, "", "1: a high input is a fault, 0: a low one"),
    ROW(sample_time, "sample-time", HM2_FLOAT, HM2_PARAM_RW, 0.5, "",
        "place of the sample output in the PWM cycle, 0 to 1"),
};

static const struct hm2_point_group groups[] = {
    HM2_GROUP("3pwmgen", global_points, NULL),
    HM2_GROUP("3pwmgen.##", points, NULL),
    {.prefix = NULL},
};

static const char *output_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"phase-A",          "phase-B",          "phase-C", "phase-A-inverted",
                                        "phase-B-inverted", "phase-C-inverted", "enable"};
    const unsigned number = pd->secondary_pin - (HM2_PIN_OUTPUT | 1u);
    return number < sizeof names / sizeof names[0] ? names[number] : NULL;
}

/* ---- parameters ----------------------------------------------------------------------------------------------------
 */

static double counts_per_ns(const struct hm2_module *const module)
{
    const struct tppwm *const ctx = module->context;
    return module->md->clock_hz * (double)ctx->rate / (2.0 * RATE_ONE * 1e9);
}

static uint32_t dead_of(const struct gen *const gen, const struct hm2_module *const module, const unsigned number)
{
    const double wanted_ns = *gen->deadtime, per_ns = counts_per_ns(module);
    if (wanted_ns >= 0.0 && wanted_ns * per_ns < DEAD_MAX + 1.0)
        return hm2_trunc_u32(wanted_ns * per_ns);
    hm2_notice_point(module, isnan(wanted_ns) ? HM2_NOTICE_VALUE_INVALID : HM2_NOTICE_VALUE_CLAMPED, "deadtime", number,
                     wanted_ns);
    /* A dead time that is no number is as long as it can be: short ones cost transistors. */
    const uint32_t dead = wanted_ns < 0.0 ? 0 : DEAD_MAX;
    *gen->deadtime = (dead + (dead ? 0.5 : 0.0)) / per_ns;
    return dead;
}

static double sample_of(const struct gen *const gen, const struct hm2_module *const module, const unsigned number)
{
    const double wanted = *gen->sample_time;
    if (wanted >= 0.0 && wanted <= 1.0)
        return wanted;
    hm2_notice_point(module, isnan(wanted) ? HM2_NOTICE_VALUE_INVALID : HM2_NOTICE_VALUE_CLAMPED, "sample-time", number,
                     wanted);
    return *gen->sample_time = wanted > 1.0 ? 1.0 : 0.0;
}

HM2_RARE static void take_setup(struct hm2_module *const module, const unsigned number)
{
    struct tppwm *const ctx = module->context;
    struct gen *const gen = &ctx->gen[number];
    const uint32_t dead = dead_of(gen, module, number);
    const uint32_t sample = hm2_trunc_u32(sample_of(gen, module, number) * SAMPLE_SPAN);
    gen->for_deadtime = *gen->deadtime;
    gen->for_sample = *gen->sample_time;
    gen->for_invert = *gen->fault_invert;
    gen->dead_before = gen->dead > gen->dead_before ? gen->dead : gen->dead_before;
    gen->dead = dead;
    hm2_section_set(&ctx->setups, number, sample << SAMPLE_SHIFT | (gen->for_invert ? FAULT_HIGH : 0) | dead);
}

HM2_RARE static void take_frequency(struct hm2_module *const module)
{
    struct tppwm *const ctx = module->context;
    const uint32_t wanted_hz = *ctx->frequency;
    const double per_hz = RATE_ONE * CYCLE_COUNTS / module->md->clock_hz;
    uint32_t rate = hm2_trunc_u32(wanted_hz * per_hz);
    if (rate < 1 || rate > RATE_MAX) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "frequency", HM2_NO_INSTANCE, wanted_hz);
        rate = rate < 1 ? 1 : RATE_MAX;
        *ctx->frequency = hm2_trunc_u32((rate + 0.5) / per_hz) ? hm2_trunc_u32((rate + 0.5) / per_hz) : 1;
    }
    ctx->for_hz = *ctx->frequency;
    ctx->rate = rate;
    ctx->looked = true;
    hm2_section_set(&ctx->rates, 0, rate);
    for (unsigned i = 0; i < module->instances; i++)
        take_setup(module, i); /* dead times count the same clock */
}

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct tppwm *const ctx = module->context;
    (void)cycle;
    const bool arrived = hm2_section_confirmed(&ctx->enables);
    for (unsigned i = 0; i < module->instances; i++) {
        struct gen *const gen = &ctx->gen[i];
        const bool fault = hm2_window_get(&ctx->states, i) & FAULT;
        gen->latched |= fault && gen->asked && arrived;
        *gen->fault = fault || gen->latched;
    }
}

static double scale_of(const struct gen *const gen, const struct hm2_module *const module, const unsigned number)
{
    const double scale = *gen->scale;
    if (isfinite(scale) && scale != 0.0)
        return scale;
    hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "scale", number, scale);
    return *gen->scale = 1.0;
}

static uint32_t values_word(const struct gen *const gen, const struct hm2_module *const module, const unsigned number)
{
    static const char *const names[PHASES] = {"A-value", "B-value", "C-value"};
    const double scale = scale_of(gen, module, number);
    const uint32_t floor = gen->dead > gen->dead_before ? gen->dead : gen->dead_before;
    uint32_t word = 0;
    for (unsigned phase = 0; phase < PHASES; phase++) {
        double part = *gen->value[phase] / scale;
        if (!isfinite(part)) {
            hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, names[phase], number, *gen->value[phase]);
            part = 0.0;
        }
        part = part > 1.0 ? 1.0 : part < -1.0 ? -1.0 : part;
        const uint32_t value = (uint32_t)(part * VALUE_SWING + VALUE_HALF);
        word |= (value < floor ? floor : value) << phase * PHASE_BITS;
    }
    return word;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct tppwm *const ctx = module->context;
    (void)cycle;
    if (!ctx->looked || *ctx->frequency != ctx->for_hz)
        take_frequency(module);
    /* Enabled before the polarity has arrived, an input that is not used would be a fault. */
    const bool settled = hm2_section_confirmed(&ctx->setups) && hm2_section_confirmed(&ctx->rates);
    for (unsigned i = 0; i < module->instances; i++) {
        struct gen *const gen = &ctx->gen[i];
        if (settled)
            gen->dead_before = gen->dead;
        if (*gen->deadtime != gen->for_deadtime || *gen->sample_time != gen->for_sample ||
            *gen->fault_invert != gen->for_invert)
            take_setup(module, i);
        hm2_window_set(&ctx->values, i, values_word(gen, module, i));
        const bool wanted = *gen->enable;
        gen->latched &= wanted;
        gen->asked = wanted && !gen->latched && (settled || gen->asked);
        hm2_section_set(&ctx->enables, i, gen->asked ? ENABLED : 0);
    }
}

/* ---- set-up --------------------------------------------------------------------------------------------------------
 */

static int add_registers(struct tppwm *const ctx, const struct hm2_module *const module, struct hm2_setup *const setup)
{
    const struct hm2_md *const md = module->md;
    const unsigned n = module->instances;
    int err = hm2_plan_add_write(setup->plan, &ctx->values, HM2_RANK_NORMAL, hm2_md_address(md, REG_VALUE, 0), n,
                                 setup->diag);
    if (!err)
        err = hm2_plan_add_read(setup->plan, &ctx->states, HM2_RANK_NORMAL, hm2_md_address(md, REG_ENABLE, 0), n,
                                setup->diag);
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &ctx->rates, HM2_RANK_NORMAL, hm2_md_address(md, REG_RATE, 0), 1, 0,
                                 setup->diag);
    /* One for each instance, whatever the descriptor says (register map 3.7). */
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &ctx->setups, HM2_RANK_NORMAL, hm2_md_address(md, REG_SETUP, 0), n, 0,
                                 setup->diag);
    if (!err)
        err = hm2_plan_add_setup(setup->plan, &ctx->enables, HM2_RANK_LATE, hm2_md_address(md, REG_ENABLE, 0), n, 0,
                                 setup->diag);
    return err;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    if (module->instances == 0)
        return 0;
    if (hm2_check_page(module, setup_, "three-phase PWM generators"))
        return HM2_ERR_MISMATCH;
    struct tppwm *const ctx = hm2_setup_alloc(setup_, sizeof *ctx + module->instances * sizeof ctx->gen[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    int err = hm2_claim_pins(module, setup_, HM2_GTAG_NONE, module->instances, false, NULL);
    if (!err)
        err = hm2_bind_group(setup_, &groups[0], ctx, 0);
    for (unsigned i = 0; !err && i < module->instances; i++)
        err = hm2_bind_group(setup_, &groups[1], &ctx->gen[i], i);
    return err ? err : add_registers(ctx, module, setup_);
}

static const struct hm2_md_variant variants[] = {{0, 4, 4, 0x3}};

const struct hm2_module_type hm2_tppwm_type = {
    .name = "3pwmgen",
    .gtag = HM2_GTAG_TPPWM,
    .variants = variants,
    .variant_count = 1,
    .config_count = HM2_CFG_3PWMGENS,
    .setup = setup,
    .unpack = unpack,
    .pack = pack,
    .output_name = output_name,
    .groups = groups,
};
