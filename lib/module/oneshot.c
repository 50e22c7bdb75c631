/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* OneShot (tag C7): two pulse generators an instance. Registers: register map 3.19; points: hal-interface 2.14. */
#include <math.h>

#include <hm2/module.h>

#include "bind.h"
#include "module_types.h"

enum { REG_WIDTH1, REG_WIDTH2, REG_FILTER1, REG_FILTER2, REG_RATE, REG_CONTROL, TIMES = 5 };

#define SHOTS       2u
#define WIDTH_MAX   0x7FFFFFFFu
#define FILTER_MAX  0xFFFFFFu
#define RATE_ONE    4294967296.0
#define SELECT_MAX  7u
#define TIMER_MAX   4
#define TIMER_SHIFT 12
#define SHOT_SHIFT  16u /* bits of the second are those of the first, so much higher */

/* Control register, first one-shot. */
#define ON_RISE     0x0008u
#define ON_FALL     0x0010u
#define RETRIGGER   0x0020u
#define ENABLE      0x0040u
#define RESET       0x0080u
#define OUT         0x0100u
#define EXT_TRIGGER 0x0200u
#define SW_TRIGGER  0x0400u

struct shot {
    hm2_float_t *width, *filter;
    hm2_u32_t *trigger_select;
    hm2_bit_t *on_rise, *on_fall, *retriggerable, *enable, *reset, *swtrigger;
    hm2_bit_t *exttrigger, *out;
};

struct oneshot {
    struct shot shot[SHOTS];
    hm2_float_t *rate;
    hm2_s32_t *timer;
    double seen[TIMES];
};

struct oneshots {
    struct hm2_window controls, states;
    struct hm2_section times[TIMES]; /* by register, a word each instance */
    struct oneshot oneshot[];
};

#define ROW(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct oneshot, field, name, type, dir, init, unit, help)
#define SHOT(n, i)                                                                                                    \
    ROW(shot[i].width, "width" n, HM2_FLOAT, HM2_PIN_IN, 1, "ms", "pulse length"),                                    \
        ROW(shot[i].filter, "filter" n, HM2_FLOAT, HM2_PIN_IN, 0.1, "ms", "external trigger must be steady so long"), \
        ROW(shot[i].trigger_select, "trigger_select" n, HM2_U32, HM2_PIN_IN, 0, "",                                   \
            "0 none, 1 swtrigger, 2 input, 3 DPLL timer, 4 rate, 5 end of pulse 1, 6 end of pulse 2"),                \
        ROW(shot[i].on_rise, "trigger_on_rise" n, HM2_BIT, HM2_PIN_IN, 0, "", "1: rising edges trigger"),             \
        ROW(shot[i].on_fall, "trigger_on_fall" n, HM2_BIT, HM2_PIN_IN, 0, "", "1: falling edges trigger"),            \
        ROW(shot[i].retriggerable, "retriggerable" n, HM2_BIT, HM2_PIN_IN, 0, "",                                     \
            "1: a trigger within the pulse begins it anew"),                                                          \
        ROW(shot[i].enable, "enable" n, HM2_BIT, HM2_PIN_IN, 0, "", "1: triggers are obeyed"),                        \
        ROW(shot[i].reset, "reset" n, HM2_BIT, HM2_PIN_IN, 0, "", "1: ends the pulse"),                               \
        ROW(shot[i].swtrigger, "swtrigger" n, HM2_BIT, HM2_PIN_IN, 0, "", "trigger by software"),                     \
        ROW(shot[i].exttrigger, "exttrigger" n, HM2_BIT, HM2_PIN_OUT, 0, "", "level of the trigger input"),           \
        ROW(shot[i].out, "out" n, HM2_BIT, HM2_PIN_OUT, 0, "", "level of the pulse output")

static const struct hm2_point points[] = {
    SHOT("1", 0),
    SHOT("2", 1),
    ROW(rate, "rate", HM2_FLOAT, HM2_PIN_IN, 1000, "Hz", "of the internal trigger source"),
    ROW(timer, "dpll_timer_number", HM2_S32, HM2_PIN_IN, 0, "", "timer of trigger source 3, 0 to 4"),
};

static const struct hm2_point_group groups[] = {
    HM2_GROUP("oneshot.##", points, NULL),
    {.prefix = NULL},
};

static const char *output_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"out1", "out2"};
    const unsigned number = pd->secondary_pin - (HM2_PIN_OUTPUT | 3u);
    return number < sizeof names / sizeof names[0] ? names[number] : NULL;
}

/* ---- times ---------------------------------------------------------------------------------------------------------
 */

/* What each register is computed from: its pin, register units in a unit of the pin, and the largest value. */
struct time {
    const char *name;
    hm2_float_t *pin;
    double units;
    uint32_t max;
};

static struct time time_of(const struct oneshot *const o, const unsigned reg, const uint32_t clock_hz)
{
    const double per_ms = clock_hz / 1000.0;
    switch (reg) {
    case REG_WIDTH1:
        return (struct time){"width1", o->shot[0].width, per_ms, WIDTH_MAX};
    case REG_WIDTH2:
        return (struct time){"width2", o->shot[1].width, per_ms, WIDTH_MAX};
    case REG_FILTER1:
        return (struct time){"filter1", o->shot[0].filter, per_ms, FILTER_MAX};
    case REG_FILTER2:
        return (struct time){"filter2", o->shot[1].filter, per_ms, FILTER_MAX};
    default:
        return (struct time){"rate", o->rate, RATE_ONE / clock_hz, UINT32_MAX};
    }
}

HM2_RARE static void take_time(const struct hm2_module *const module, const unsigned number, const unsigned reg)
{
    struct oneshots *const ctx = module->context;
    struct oneshot *const o = &ctx->oneshot[number];
    const struct time time = time_of(o, reg, module->md->clock_hz);
    const double wanted = *time.pin, most = time.max / time.units;
    const double possible = !(wanted > 0.0) ? 0.0 : wanted > most ? most : wanted;
    if (possible != wanted) {
        hm2_notice_point(module, isnan(wanted) ? HM2_NOTICE_VALUE_INVALID : HM2_NOTICE_VALUE_CLAMPED, time.name, number,
                         wanted);
        *time.pin = possible;
    }
    o->seen[reg] = possible;
    const uint32_t value = hm2_trunc_u32(possible * time.units);
    hm2_section_set(&ctx->times[reg], number, value < time.max ? value : time.max);
}

static void look_at_times(const struct hm2_module *const module, const unsigned number)
{
    const struct oneshots *const ctx = module->context;
    const struct oneshot *const o = &ctx->oneshot[number];
    const double now[TIMES] = {*o->shot[0].width, *o->shot[1].width, *o->shot[0].filter, *o->shot[1].filter, *o->rate};
    for (unsigned reg = 0; reg < TIMES; reg++)
        if (!(now[reg] == o->seen[reg]))
            take_time(module, number, reg);
}

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct oneshots *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; i < module->instances; i++) {
        const uint32_t state = hm2_window_get(&ctx->states, i);
        for (unsigned s = 0; s < SHOTS; s++) {
            *ctx->oneshot[i].shot[s].out = state >> s * SHOT_SHIFT & OUT;
            *ctx->oneshot[i].shot[s].exttrigger = state >> s * SHOT_SHIFT & EXT_TRIGGER;
        }
    }
}

static uint32_t shot_bits(const struct shot *const s, const struct hm2_module *const module, const unsigned number,
                          const char *const name)
{
    if (*s->trigger_select > SELECT_MAX) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, name, number, *s->trigger_select);
        *s->trigger_select = 0;
    }
    return *s->trigger_select | (*s->on_rise ? ON_RISE : 0) | (*s->on_fall ? ON_FALL : 0) |
           (*s->retriggerable ? RETRIGGER : 0) | (*s->enable ? ENABLE : 0) | (*s->reset ? RESET : 0) |
           (*s->swtrigger ? SW_TRIGGER : 0);
}

static uint32_t timer_bits(const struct oneshot *const o, const struct hm2_module *const module, const unsigned number)
{
    if (*o->timer < 0 || *o->timer > TIMER_MAX) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, "dpll_timer_number", number, *o->timer);
        *o->timer = 0;
    }
    return (uint32_t)*o->timer << TIMER_SHIFT;
}

static void pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct oneshots *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; i < module->instances; i++) {
        const struct oneshot *const o = &ctx->oneshot[i];
        look_at_times(module, i);
        hm2_window_set(&ctx->controls, i,
                       shot_bits(&o->shot[0], module, i, "trigger_select1") | timer_bits(o, module, i) |
                           shot_bits(&o->shot[1], module, i, "trigger_select2") << SHOT_SHIFT);
    }
}

/* ---- set-up --------------------------------------------------------------------------------------------------------
 */

static int add_registers(struct oneshots *const ctx, const struct hm2_module *const module,
                         struct hm2_setup *const setup)
{
    const unsigned n = module->instances;
    const uint16_t control = hm2_md_address(module->md, REG_CONTROL, 0);
    int err = hm2_plan_add_read(setup->plan, &ctx->states, HM2_RANK_NORMAL, control, n, setup->diag);
    if (!err)
        err = hm2_plan_add_write(setup->plan, &ctx->controls, HM2_RANK_NORMAL, control, n, setup->diag);
    for (unsigned reg = 0; reg < TIMES && !err; reg++)
        err = hm2_plan_add_setup(setup->plan, &ctx->times[reg], HM2_RANK_NORMAL, hm2_md_address(module->md, reg, 0), n,
                                 0, setup->diag);
    return err;
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    if (module->instances == 0)
        return 0;
    if (hm2_check_page(module, setup_, "one-shots"))
        return HM2_ERR_MISMATCH;
    struct oneshots *const ctx = hm2_setup_alloc(setup_, sizeof *ctx + module->instances * sizeof ctx->oneshot[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    int err = hm2_claim_pins(module, setup_, HM2_GTAG_NONE, module->instances, false, NULL);
    for (unsigned i = 0; !err && i < module->instances; i++) {
        for (unsigned reg = 0; reg < TIMES; reg++)
            ctx->oneshot[i].seen[reg] = NAN;
        err = hm2_bind_group(setup_, &groups[0], &ctx->oneshot[i], i);
    }
    return err ? err : add_registers(ctx, module, setup_);
}

static const struct hm2_md_variant variants[] = {{0, 6, 4, 0x3F}};

const struct hm2_module_type hm2_oneshot_type = {
    .name = "oneshot",
    .gtag = HM2_GTAG_ONESHOT,
    .variants = variants,
    .variant_count = 1,
    .config_count = HM2_CFG_ONESHOTS,
    .setup = setup,
    .unpack = unpack,
    .pack = pack,
    .output_name = output_name,
    .groups = groups,
};
