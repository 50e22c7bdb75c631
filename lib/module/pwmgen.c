/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* PWMGen (tag 06). Registers: register map 3.6; points: hal-interface 2.9. */
#include "pwmgen.h"

#include <math.h>

#include <hm2/module.h>

#include "bind.h"
#include "module_types.h"

enum { REG_VALUE = 0, REG_MODE = 1, REG_PWM_RATE = 2, REG_PDM_RATE = 3, REG_ENABLE = 4 };

#define VERSION_DITHER 1u
#define MAX_GENERATORS 32u /* bits of the enable register */

/* Mode register (register map 3.6). */
#define MODE_OUTPUT_SHIFT    3
#define MODE_DOUBLE_BUFFERED 0x20u /* a new value begins with a cycle; not for PDM */
#define MODE_DITHER          0x40u

#define VALUE_NEGATIVE 0x80000000u
#define RATE_MAX       65535u
#define FRACTION       65536u /* of the rate registers, and of the value register below bit 16 */

struct pwmgen {
    hm2_float_t *value, *scale;
    hm2_bit_t *enable, *offset_mode;
    hm2_bit_t *dither; /* version 1, else NULL */
    hm2_s32_t *output_type;

    double scale_seen, value_seen; /* that the register was computed from; NaN = compute it */
    bool at_rest;                  /* the register holds the value of a generator that is not enabled */
    int32_t type_seen;
    bool offset_seen, dither_seen;
    struct pwmgen_span span;
};

struct pwmgen_module {
    hm2_u32_t *pwm_frequency, *pdm_frequency;
    uint32_t pwm_seen_hz, pdm_seen_hz;
    unsigned bits;
    bool has_dither;
    uint32_t enables; /* as handed to the plan last */
    unsigned look;    /* generator whose parameters are looked at next; those of all with PWMGEN_LOOK_AT_ALL */
    unsigned looks;   /* length of the round */
    struct hm2_window values;
    struct hm2_section modes, enable, pwm_rate, pdm_rate;
    struct pwmgen generator[]; /* module->instances */
};

/* ---- arithmetic ----------------------------------------------------------------------------------------------------
 */

struct pwmgen_rate pwmgen_pwm_rate(const uint32_t clock_hz, const uint32_t wanted_hz)
{
    const uint32_t frequency_hz = wanted_hz ? wanted_hz : 1;
    /* The finest resolution whose counter is fast enough. */
    for (unsigned bits = PWMGEN_BITS_MAX; bits >= PWMGEN_BITS_MIN; bits--) {
        const uint64_t dds = ((uint64_t)frequency_hz * FRACTION << bits) / clock_hz;
        if (dds <= RATE_MAX)
            return (struct pwmgen_rate){frequency_hz, dds ? (uint32_t)dds : 1, bits, wanted_hz == 0};
    }
    const uint64_t fastest_hz = (uint64_t)clock_hz * RATE_MAX / ((uint64_t)FRACTION << PWMGEN_BITS_MIN);
    return (struct pwmgen_rate){(uint32_t)fastest_hz, RATE_MAX, PWMGEN_BITS_MIN, true};
}

struct pwmgen_rate pwmgen_pdm_rate(const uint32_t clock_hz, const uint32_t wanted_hz)
{
    const uint64_t dds = (uint64_t)wanted_hz * FRACTION / clock_hz;
    if (dds > RATE_MAX)
        return (struct pwmgen_rate){(uint32_t)((uint64_t)clock_hz * RATE_MAX / FRACTION), RATE_MAX, PWMGEN_BITS_MAX,
                                    true};
    if (dds == 0)
        return (struct pwmgen_rate){clock_hz / FRACTION + 1, 1, PWMGEN_BITS_MAX, true};
    return (struct pwmgen_rate){wanted_hz, (uint32_t)dds, PWMGEN_BITS_MAX, false};
}

struct pwmgen_span pwmgen_span(const unsigned bits, const bool dither, const bool offset_mode)
{
    /* The largest value that still pulses, so that a change of direction is never hidden by a constant level. */
    const double below_full = dither ? 1.0 + 1.0 / 16.0 : 1.0;
    const double half = (double)(1u << (bits - 1));
    if (offset_mode)
        return (struct pwmgen_span){(half - below_full) * FRACTION, half * FRACTION, true};
    return (struct pwmgen_span){(2.0 * half - below_full) * FRACTION, 0.0, false};
}

uint32_t pwmgen_value(const struct pwmgen_span *const span, const double duty)
{
    const double magnitude = span->offset ? duty : fabs(duty);
    const uint32_t value = (uint32_t)(int32_t)(magnitude * span->gain + span->middle);
    return duty < 0.0 ? value | VALUE_NEGATIVE : value;
}

/* ---- points --------------------------------------------------------------------------------------------------------
 */

#define ROW(field, name, type, dir, init, unit, help) HM2_POINT(struct pwmgen, field, name, type, dir, init, unit, help)
#define GLOBAL(field, name, init, help) \
    HM2_POINT(struct pwmgen_module, field, name, HM2_U32, HM2_PARAM_RW, init, "Hz", help)

static const struct hm2_point global_points[] = {
    GLOBAL(pwm_frequency, "pwm_frequency", 20000, "of all outputs of type 1, 2 and 4"),
    GLOBAL(pdm_frequency, "pdm_frequency", 20000, "bit clock of all outputs of type 3"),
};

static const struct hm2_point points[] = {
    ROW(value, "value", HM2_FLOAT, HM2_PIN_IN, 0, "units", "command; value / scale is the duty cycle"),
    ROW(enable, "enable", HM2_BIT, HM2_PIN_IN, 0, "", "0: value 0, and the enable output is off"),
    ROW(scale, "scale", HM2_FLOAT, HM2_PARAM_RW, 1, "units", "value at full duty cycle"),
    ROW(output_type, "output-type", HM2_S32, HM2_PARAM_RW, 1, "",
        "1 PWM and direction, 2 up and down, 3 PDM and direction, 4 direction and PWM"),
    ROW(offset_mode, "offset-mode", HM2_BIT, HM2_PARAM_RW, 0, "", "1: half duty cycle is zero"),
};

static const struct hm2_point dither_points[] = {
    ROW(dither, "dither", HM2_BIT, HM2_PARAM_RW, 0, "", "spread the fraction of the value over 16 cycles"),
};

enum { GROUP_GLOBAL, GROUP_ALWAYS, GROUP_DITHER };

static const struct hm2_point_group groups[] = {
    [GROUP_GLOBAL] = HM2_GROUP("pwmgen", global_points, NULL),
    [GROUP_ALWAYS] = HM2_GROUP("pwmgen.##", points, NULL),
    [GROUP_DITHER] = HM2_GROUP("pwmgen.##", dither_points, "module version 1"),
    {.prefix = NULL},
};

static const char *output_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"out0", "out1", "enable"};
    const unsigned number = pd->secondary_pin - (HM2_PIN_OUTPUT | 1u);
    return number < sizeof names / sizeof names[0] ? names[number] : NULL;
}

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

/* What the mode register calls the output types 1 to 4 (register map 3.6). */
static uint32_t output_bits(const int32_t type)
{
    static const uint8_t bits[] = {[PWMGEN_PWM_DIR] = 0, [PWMGEN_UP_DOWN] = 2, [PWMGEN_PDM] = 3, [PWMGEN_DIR_PWM] = 1};
    return (uint32_t)bits[type] << MODE_OUTPUT_SHIFT;
}

HM2_RARE static void take_mode(struct pwmgen *const gen, const struct hm2_module *const module, const unsigned number)
{
    struct pwmgen_module *const ctx = module->context;
    int32_t type = *gen->output_type;
    if (type < PWMGEN_PWM_DIR || type > PWMGEN_DIR_PWM) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "output-type", number, type);
        *gen->output_type = type = PWMGEN_PWM_DIR;
    }
    gen->type_seen = type;
    gen->offset_seen = *gen->offset_mode;
    gen->dither_seen = gen->dither && *gen->dither;
    const bool pdm = type == PWMGEN_PDM;
    gen->value_seen = NAN;
    gen->at_rest = false;
    gen->span = pwmgen_span(pdm ? PWMGEN_BITS_MAX : ctx->bits, gen->dither_seen, gen->offset_seen);
    uint32_t mode = ctx->bits - PWMGEN_BITS_MIN;
    mode |= output_bits(type);
    mode |= pdm ? 0 : MODE_DOUBLE_BUFFERED;
    mode |= gen->dither_seen ? MODE_DITHER : 0;
    hm2_section_set(&ctx->modes, number, mode);
}

static bool mode_changed(const struct pwmgen *const gen)
{
    return *gen->output_type != gen->type_seen || *gen->offset_mode != gen->offset_seen ||
           (gen->dither && *gen->dither != gen->dither_seen);
}

static void take_frequencies(struct hm2_module *const module)
{
    struct pwmgen_module *const ctx = module->context;
    const struct pwmgen_rate pwm = pwmgen_pwm_rate(module->md->clock_hz, *ctx->pwm_frequency);
    const struct pwmgen_rate pdm = pwmgen_pdm_rate(module->md->clock_hz, *ctx->pdm_frequency);
    if (pwm.clamped)
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "pwm_frequency", HM2_NO_INSTANCE, *ctx->pwm_frequency);
    if (pdm.clamped)
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "pdm_frequency", HM2_NO_INSTANCE, *ctx->pdm_frequency);
    *ctx->pwm_frequency = ctx->pwm_seen_hz = pwm.frequency_hz;
    *ctx->pdm_frequency = ctx->pdm_seen_hz = pdm.frequency_hz;
    hm2_section_set(&ctx->pwm_rate, 0, pwm.dds);
    hm2_section_set(&ctx->pdm_rate, 0, pdm.dds);
    if (pwm.bits == ctx->bits)
        return;
    ctx->bits = pwm.bits;
    for (unsigned i = 0; i < module->instances; i++)
        take_mode(&ctx->generator[i], module, i);
}

HM2_RARE static void look_at_all(struct hm2_module *const module, const bool at_generators)
{
    struct pwmgen_module *const ctx = module->context;
    if (*ctx->pwm_frequency != ctx->pwm_seen_hz || *ctx->pdm_frequency != ctx->pdm_seen_hz)
        take_frequencies(module);
    for (unsigned i = 0; at_generators && i < module->instances; i++)
        if (mode_changed(&ctx->generator[i]))
            take_mode(&ctx->generator[i], module, i);
}

/* Parameters cannot be linked to signals, only a person sets them: those of at most one generator are looked at in a
 * cycle. */
static void look_at_parameters(struct hm2_module *const module)
{
    struct pwmgen_module *const ctx = module->context;
    const unsigned look = ctx->look;
    ctx->look = look + 1 < ctx->looks ? look + 1 : 0;
    if (look < module->instances && mode_changed(&ctx->generator[look]))
        take_mode(&ctx->generator[look], module, look);
    if (look == 0 || look == PWMGEN_LOOK_AT_ALL)
        look_at_all(module, look == PWMGEN_LOOK_AT_ALL);
}

static double duty(struct pwmgen *const gen, const struct hm2_module *const module, const unsigned number)
{
    if (!(*gen->scale == gen->scale_seen)) {
        double scale = *gen->scale;
        if (!isfinite(scale) || scale == 0.0) {
            hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "scale", number, scale);
            *gen->scale = scale = 1.0;
        }
        gen->scale_seen = scale;
    }
    const double value = *gen->value;
    gen->value_seen = isfinite(value) ? value : NAN; /* what is unusable is reported in every cycle */
    /* A true division: the register truncates, and the product with a reciprocal misses full scale by one step. */
    const double wanted = value / gen->scale_seen;
    if (!isfinite(value)) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "value", number, value);
        return 0.0;
    }
    return wanted > 1.0 ? 1.0 : wanted < -1.0 ? -1.0 : wanted;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    (void)cycle;
    struct pwmgen_module *const ctx = module->context;
    if (!ctx)
        return;
    look_at_parameters(module);
    uint32_t enables = 0;
    for (unsigned i = 0; i < module->instances; i++) {
        struct pwmgen *const gen = &ctx->generator[i];
        const bool enabled = *gen->enable;
        enables |= (uint32_t)enabled << i;
        if (enabled ? *gen->value == gen->value_seen && *gen->scale == gen->scale_seen && !gen->at_rest : gen->at_rest)
            continue;
        gen->at_rest = !enabled;
        hm2_window_set(&ctx->values, i, pwmgen_value(&gen->span, enabled ? duty(gen, module, i) : 0.0));
    }
    if (enables != ctx->enables) {
        ctx->enables = enables;
        hm2_section_set(&ctx->enable, 0, enables);
    }
}

/* ---- set-up --------------------------------------------------------------------------------------------------------
 */

static int add_registers(struct hm2_module *const module, struct hm2_setup *const setup)
{
    struct pwmgen_module *const ctx = module->context;
    const struct {
        struct hm2_section *section;
        unsigned reg, words;
    } sections[] = {
        {&ctx->modes, REG_MODE, module->instances},
        {&ctx->enable, REG_ENABLE, 1},
        {&ctx->pwm_rate, REG_PWM_RATE, 1},
        {&ctx->pdm_rate, REG_PDM_RATE, 1},
    };
    int err = hm2_plan_add_write(setup->plan, &ctx->values, HM2_RANK_NORMAL, hm2_md_address(module->md, REG_VALUE, 0),
                                 module->instances, setup->diag);
    for (size_t s = 0; !err && s < sizeof sections / sizeof sections[0]; s++)
        err = hm2_plan_add_setup(setup->plan, sections[s].section, HM2_RANK_NORMAL,
                                 hm2_md_address(module->md, sections[s].reg, 0), sections[s].words, 0, setup->diag);
    if (!err)
        take_frequencies(module);
    return err;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    if (module->instances == 0)
        return 0;
    if (module->instances > MAX_GENERATORS) {
        hm2_diag_warn(setup_->diag, "%s: the firmware has %u PWM generators; using %u, which its enable register holds",
                      setup_->prefix, module->instances, MAX_GENERATORS);
        module->instances = MAX_GENERATORS;
    }
    struct pwmgen_module *const ctx =
        hm2_setup_alloc(setup_, sizeof *ctx + module->instances * sizeof ctx->generator[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->look = PWMGEN_LOOK_AT_ALL;
    ctx->looks = module->instances > PWMGEN_LOOKS ? module->instances : PWMGEN_LOOKS;
    ctx->has_dither = module->md->version == VERSION_DITHER;
    int err = hm2_claim_pins(module, setup_, HM2_GTAG_NONE, module->instances, false, NULL);
    if (!err)
        err = hm2_bind_group(setup_, &groups[GROUP_GLOBAL], ctx, 0);
    for (unsigned i = 0; !err && i < module->instances; i++) {
        ctx->generator[i].scale_seen = 1.0;
        err = hm2_bind_group(setup_, &groups[GROUP_ALWAYS], &ctx->generator[i], i);
        if (!err && ctx->has_dither)
            err = hm2_bind_group(setup_, &groups[GROUP_DITHER], &ctx->generator[i], i);
    }
    return err ? err : add_registers(module, setup_);
}

static const struct hm2_md_variant variants[] = {{0, 5, 4, 3}, {VERSION_DITHER, 5, 4, 3}};

const struct hm2_module_type hm2_pwmgen_type = {
    .name = "pwmgen",
    .gtag = HM2_GTAG_PWMGEN,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_PWMGENS,
    .setup = setup,
    .pack = pack,
    .output_name = output_name,
    .groups = groups,
};
