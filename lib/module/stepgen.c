/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * StepGen (tag 05): points, set-up and feedback. Registers: register map 3.4; points: hal-interface 2.7.
 */
#include "stepgen.h"

#include <math.h>

#include "bind.h"
#include "module_types.h"

enum { REG_RATE = 0, REG_ACCUMULATOR = 1, REG_MODE = 2 };

#define VERSION_SWAP  0x42u /* outputs can be swapped */
#define VERSION_LATCH 0xC2u /* and index and probe latch the position */

/* Pin codes (register map 4.1). */
#define PIN_NUMBER(pd) ((pd)->secondary_pin & 0x7Fu)
#define PIN_STEP       1u
#define PIN_TABLE_LAST 8u

#define SUBCOUNTS_PER_STEP 65536.0

#define ROW(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct stepgen, field, name, type, dir, init, unit, help)

static const struct hm2_point global_points[] = {
    HM2_POINT(struct stepgen_module, timer.number, "timer-number", HM2_S32, HM2_PIN_IN, -1, "",
              "DPLL timer that samples the positions: 1 to 4, 0 the reference, -1 none"),
};

static const struct hm2_point points[] = {
    ROW(position_cmd, "position-cmd", HM2_FLOAT, HM2_PIN_IN, 0, "units", "position command"),
    ROW(velocity_cmd, "velocity-cmd", HM2_FLOAT, HM2_PIN_IN, 0, "units/s", "velocity command"),
    ROW(velocity_fb, "velocity-fb", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s", "velocity commanded last, not measured"),
    ROW(position_fb, "position-fb", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "position from the card, finer than a step"),
    ROW(counts, "counts", HM2_S32, HM2_PIN_OUT, 0, "steps", "position in whole steps"),
    ROW(enable, "enable", HM2_BIT, HM2_PIN_IN, 0, "", "0 stops the generator at once"),
    ROW(control_type, "control-type", HM2_BIT, HM2_PIN_IN, 0, "", "0 position mode, 1 velocity mode"),
    ROW(position_reset, "position-reset", HM2_BIT, HM2_PIN_IN, 0, "", "while 1 the position is held at 0"),
    ROW(dbg_pos_minus_prev_cmd, "dbg_pos_minus_prev_cmd", HM2_FLOAT, HM2_PIN_OUT, 0, "units",
        "feedback minus the previous command"),
    ROW(dbg_ff_vel, "dbg_ff_vel", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s", "velocity of the command"),
    ROW(dbg_s_to_match, "dbg_s_to_match", HM2_FLOAT, HM2_PIN_OUT, 0, "s",
        "time until the command's velocity is reached"),
    ROW(dbg_vel_error, "dbg_vel_error", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s",
        "velocity-fb minus the command's velocity"),
    ROW(dbg_err_at_match, "dbg_err_at_match", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "position error expected then"),
    ROW(dbg_step_rate, "dbg_step_rate", HM2_S32, HM2_PIN_OUT, 0, "", "value of the rate register"),
    ROW(position_scale, "position-scale", HM2_FLOAT, HM2_PARAM_RW, 1, "steps/unit", "its sign reverses the direction"),
    ROW(maxvel, "maxvel", HM2_FLOAT, HM2_PARAM_RW, 0, "units/s", "0 = as fast as the pulse times allow"),
    ROW(maxaccel, "maxaccel", HM2_FLOAT, HM2_PARAM_RW, 1, "units/s^2", "0 = not limited"),
    ROW(time_ns[STEPGEN_STEPLEN], "steplen", HM2_U32, HM2_PARAM_RW, 0, "ns", "length of a step pulse"),
    ROW(time_ns[STEPGEN_STEPSPACE], "stepspace", HM2_U32, HM2_PARAM_RW, 0, "ns", "shortest pause between pulses"),
    ROW(time_ns[STEPGEN_DIRSETUP], "dirsetup", HM2_U32, HM2_PARAM_RW, 0, "ns", "from a change of direction to a step"),
    ROW(time_ns[STEPGEN_DIRHOLD], "dirhold", HM2_U32, HM2_PARAM_RW, 0, "ns", "from a step to a change of direction"),
    ROW(step_type, "step_type", HM2_U32, HM2_PARAM_RW, 0, "",
        "0 step/dir, 1 up/down, 2 quadrature, 3 to 16 table of that length"),
    ROW(table_data[0], "table-data-0", HM2_U32, HM2_PARAM_RW, 0, "", "table entries 0 to 3, entry 0 in the low byte"),
    ROW(table_data[1], "table-data-1", HM2_U32, HM2_PARAM_RW, 0, "", "table entries 4 to 7"),
    ROW(table_data[2], "table-data-2", HM2_U32, HM2_PARAM_RW, 0, "", "table entries 8 to 11"),
    ROW(table_data[3], "table-data-3", HM2_U32, HM2_PARAM_RW, 0, "", "table entries 12 to 15"),
};

static const struct hm2_point swap_points[] = {
    ROW(swap_step_dir, "swap_step_dir", HM2_BIT, HM2_PARAM_RW, 0, "", "exchange the step and the direction output"),
};

static const struct hm2_point latch_points[] = {
    ROW(position_latch, "position-latch", HM2_FLOAT, HM2_PIN_OUT, 0, "units",
        "position at the last index or probe edge"),
    ROW(index_enable, "index-enable", HM2_BIT, HM2_PIN_IO, 0, "", "1: zero at the next index edge, which clears it"),
    ROW(probe_enable, "probe-enable", HM2_BIT, HM2_PIN_IO, 0, "", "1: latch at the next probe edge, which clears it"),
    ROW(index_invert, "index-invert", HM2_BIT, HM2_PIN_IN, 0, "", "1: the rising edge of the index, 0: the falling"),
    ROW(probe_invert, "probe-invert", HM2_BIT, HM2_PIN_IN, 0, "", "1: the rising edge of the probe, 0: the falling"),
};

enum { GROUP_GLOBAL, GROUP_ALWAYS, GROUP_SWAP, GROUP_LATCH };

static const struct hm2_point_group groups[] = {
    [GROUP_GLOBAL] = HM2_GROUP("stepgen", global_points, "the firmware has a DPLL"),
    [GROUP_ALWAYS] = HM2_GROUP("stepgen.##", points, NULL),
    [GROUP_SWAP] = HM2_GROUP("stepgen.##", swap_points, "module version 0x42 or 0xC2"),
    [GROUP_LATCH] = HM2_GROUP("stepgen.##", latch_points, "module version 0xC2"),
    {.prefix = NULL},
};

/* Outputs beyond stepgen_width stay GPIO (hal-interface 2.0); the index and probe inputs belong to the generator
 * whatever the width is, as with LinuxCNC's driver. */
static bool within_width(const struct hm2_pd *const pd, const struct hm2_setup *const setup)
{
    return !(pd->secondary_pin & HM2_PIN_OUTPUT) || PIN_NUMBER(pd) <= setup->config->stepgen_width;
}

static const char *output_name(const struct hm2_pd *const pd)
{
    static const char *const names[] = {"step",   "direction", "table2", "table3",
                                        "table4", "table5",    "table6", "table7"};
    const unsigned number = PIN_NUMBER(pd);
    if (!(pd->secondary_pin & HM2_PIN_OUTPUT) || number < PIN_STEP || number > PIN_TABLE_LAST)
        return NULL;
    return names[number - PIN_STEP];
}

static int bind_generator(const struct hm2_module *const module, const struct hm2_setup *const setup,
                          const unsigned number)
{
    const struct stepgen_module *const ctx = module->context;
    struct stepgen *const gen = &((struct stepgen_module *)module->context)->generator[number];
    int err = hm2_bind_group(setup, &groups[GROUP_ALWAYS], gen, number);
    if (!err && ctx->has_swap)
        err = hm2_bind_group(setup, &groups[GROUP_SWAP], gen, number);
    if (!err && ctx->has_latch)
        err = hm2_bind_group(setup, &groups[GROUP_LATCH], gen, number);
    if (err)
        return err;
    for (unsigned t = 0; t < STEPGEN_TIMES; t++)
        *gen->time_ns[t] = stepgen_longest_ns(module->md->clock_hz);
    gen->module = module;
    gen->number = number;
    /* Nothing equals a NaN: the first cycle takes the parameters over. */
    gen->maxvel_seen = NAN;
    gen->scale = 1.0;
    return 0;
}

static int add_registers(struct hm2_module *const module, struct hm2_setup *const setup)
{
    struct stepgen_module *const ctx = module->context;
    const struct hm2_md *const md = module->md;
    const unsigned words = module->instances;
    int err = hm2_plan_add_write(setup->plan, &ctx->rates, HM2_RANK_NORMAL, hm2_md_address(md, REG_RATE, 0), words,
                                 setup->diag);
    if (!err)
        err = hm2_plan_add_read(setup->plan, &ctx->accumulators, HM2_RANK_NORMAL,
                                hm2_md_address(md, REG_ACCUMULATOR, 0), words, setup->diag);
    if (!err && ctx->has_latch)
        err = hm2_plan_add_read(setup->plan, &ctx->latches, HM2_RANK_NORMAL, hm2_md_address(md, REG_MODE, 0), words,
                                setup->diag);
    return err ? err : stepgen_add_settings(module, setup);
}

static int setup(struct hm2_module *const module, struct hm2_setup *const setup_)
{
    const struct hm2_md *const md = module->md;
    if (module->instances == 0)
        return 0;
    if (md->version < 2)
        hm2_diag_warn(setup_->diag, "StepGen version %u is old firmware; version 2 or later is better tested",
                      md->version);
    struct stepgen_module *const ctx =
        hm2_setup_alloc(setup_, sizeof *ctx + module->instances * sizeof ctx->generator[0]);
    if (!ctx)
        return HM2_ERR_NOMEM;
    module->context = ctx;
    ctx->has_latch = md->version == VERSION_LATCH;
    ctx->has_swap = ctx->has_latch || md->version == VERSION_SWAP;
    ctx->clock_hz = (double)md->clock_hz;
    ctx->max_step_hz = 0.5 * ctx->clock_hz;
    ctx->looks = module->instances > STEPGEN_LOOKS ? module->instances : STEPGEN_LOOKS;

    int err = hm2_claim_pins(module, setup_, HM2_GTAG_NONE, module->instances, false, within_width);
    if (!err && setup_->has_dpll)
        err = hm2_bind_group(setup_, &groups[GROUP_GLOBAL], ctx, 0);
    for (unsigned i = 0; !err && i < module->instances; i++)
        err = bind_generator(module, setup_, i);
    return err ? err : add_registers(module, setup_);
}

/* At load the present position is 0; after the card's power came back the position goes on from where it was. */
static void start(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    (void)cycle;
    struct stepgen_module *const ctx = module->context;
    if (!ctx)
        return;
    for (unsigned i = 0; i < module->instances; i++) {
        struct stepgen *const gen = &ctx->generator[i];
        gen->accumulator = hm2_window_get(&ctx->accumulators, i);
        gen->velocity = 0.0;
        gen->old_cmd = hm2_finite_or(*gen->position_cmd, gen->old_cmd);
        *gen->velocity_fb = 0.0;
        /* An armed latch is gone with the power: what the card reads now is no event. */
        if (ctx->has_latch)
            hm2_section_touch(&gen->mode);
    }
    if (ctx->started)
        stepgen_forget_tables(ctx, module->instances);
    ctx->look = STEPGEN_LOOK_AT_ALL;
    ctx->started = true;
}

/* The card steps at the rate that it was given, so that where a generator is by now follows from where it was when the
 * registers were read. */
static void carry_forward(struct stepgen_module *const ctx, const unsigned instances, const double age_s)
{
    for (struct stepgen *gen = ctx->generator, *const end = gen + instances; gen < end; gen++) {
        gen->position += gen->velocity * age_s;
        *gen->position_fb = gen->position;
    }
}

/* A generator goes on while the outputs are off: steps that it counts then reach no motor. Without this the axis, told
 * that it is there, would go back over them. The rate is that of one write but for the first period. */
HM2_RARE static void leave_undriven(struct stepgen_module *const ctx, const unsigned instances, const double undriven)
{
    for (struct stepgen *gen = ctx->generator, *const end = gen + instances; gen < end; gen++) {
        const double moved = hm2_delta32(hm2_window_get(&ctx->accumulators, gen->number), gen->accumulator);
        gen->accumulator += (uint32_t)hm2_trunc_s32(moved * undriven);
    }
}

static inline void unpack_all(struct stepgen_module *const ctx, const unsigned instances, const bool has_latch)
{
    const uint8_t *accumulators = ctx->accumulators.bytes;
    for (struct stepgen *gen = ctx->generator, *const end = gen + instances; gen < end; gen++, accumulators += 4) {
        if (!(*gen->position_scale == gen->scale))
            stepgen_take_limits(gen); /* they are in units of the scale */
        const uint32_t accumulator = hm2_get_le32(accumulators);
        const int64_t moved = hm2_delta32(accumulator, gen->accumulator);
        gen->subcounts = (int64_t)((uint64_t)gen->subcounts + (uint64_t)moved);
        gen->accumulator = accumulator;
        if (has_latch)
            stepgen_unpack_latch(gen, hm2_window_get(&ctx->latches, gen->number));
        if (*gen->position_reset)
            gen->subcounts = 0;
        gen->position = (double)gen->subcounts * (1.0 / SUBCOUNTS_PER_STEP) / gen->scale;
        *gen->counts = (int32_t)(uint32_t)((uint64_t)gen->subcounts >> 16);
        *gen->position_fb = gen->position;
    }
}

static void unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct stepgen_module *const ctx = module->context;
    if (!ctx)
        return;
    if (cycle->undriven > 0.0)
        leave_undriven(ctx, module->instances, cycle->undriven);
    if (ctx->has_latch)
        unpack_all(ctx, module->instances, true);
    else
        unpack_all(ctx, module->instances, false);
    if (cycle->age_s > 0.0)
        carry_forward(ctx, module->instances, cycle->age_s);
}

static const struct hm2_md_variant variants[] = {
    {0, 10, 4, 0x1FF},
    {1, 10, 4, 0x1FF},
    {2, 10, 4, 0x1FF},
    {VERSION_SWAP, 10, 4, 0x1FF},
    {VERSION_LATCH, 10, 4, 0x1FF},
};

const struct hm2_module_type hm2_stepgen_type = {
    .name = "stepgen",
    .gtag = HM2_GTAG_STEPGEN,
    .variants = variants,
    .variant_count = sizeof variants / sizeof variants[0],
    .config_count = HM2_CFG_STEPGENS,
    .setup = setup,
    .start = start,
    .unpack = unpack,
    .pack = stepgen_pack,
    .output_name = output_name,
    .groups = groups,
};
