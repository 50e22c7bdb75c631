/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * How fast a step generator is to step: the velocity and position modes of hal-interface 2.7, with its verdicts (8.2).
 * The cycle's part of it stands in one file, so that it becomes one function.
 */
#include "stepgen.h"

#include <float.h>
#include <math.h>

#define SMALLEST_SCALE 1e-6 /* steps per unit; below it hal-interface 2.7 takes 1 */
#define TWO_TO_32      4294967296.0
#define HEADROOM       1.001 /* a command this much faster than the limit is told to a person */

static double report(const struct stepgen *const gen, const enum hm2_notice notice, const char *const point,
                     const double found, const double used)
{
    hm2_notice_point(gen->module, notice, point, gen->number, found);
    return used;
}

static void take_scale(struct stepgen *const gen)
{
    double scale = *gen->position_scale;
    if (!isfinite(scale))
        scale = report(gen, HM2_NOTICE_VALUE_INVALID, "position-scale", scale, 1.0);
    else if (fabs(scale) < SMALLEST_SCALE)
        scale = report(gen, HM2_NOTICE_VALUE_CLAMPED, "position-scale", scale, signbit(scale) ? -1.0 : 1.0);
    *gen->position_scale = scale;
    gen->scale = scale;
}

/* A limit that must be finite and not negative; 0 = none. */
static double usable_limit(const struct stepgen *const gen, const char *const point, const double value,
                           const double fallback)
{
    if (!isfinite(value))
        return report(gen, HM2_NOTICE_VALUE_INVALID, point, value, fallback);
    return value < 0.0 ? report(gen, HM2_NOTICE_VALUE_CLAMPED, point, value, -value) : value;
}

void stepgen_take_limits(struct stepgen *const gen)
{
    const struct stepgen_module *const ctx = gen->module->context;
    if (!(*gen->position_scale == gen->scale))
        take_scale(gen);

    const uint32_t len_ns = *gen->time_ns[STEPGEN_STEPLEN], space_ns = *gen->time_ns[STEPGEN_STEPSPACE];
    const double pulse_ns = (double)len_ns + (double)space_ns;
    const double step_hz = pulse_ns > 0.0 ? fmin(1e9 / pulse_ns, ctx->max_step_hz) : ctx->max_step_hz;
    const double fastest = step_hz / fabs(gen->scale);
    double maxvel = usable_limit(gen, "maxvel", *gen->maxvel, 0.0);
    if (maxvel > fastest)
        maxvel = report(gen, HM2_NOTICE_VALUE_CLAMPED, "maxvel", maxvel, fastest);
    /* Not a number is no reason to accelerate without limit: the default is the safe side. */
    const double accel = usable_limit(gen, "maxaccel", *gen->maxaccel, 1.0);

    *gen->maxvel = maxvel;
    *gen->maxaccel = accel;
    gen->maxvel_seen = maxvel;
    gen->maxaccel_seen = accel;
    gen->limit = maxvel > 0.0 ? maxvel : fastest;
    gen->headroom = gen->limit * HEADROOM;
    gen->accel = accel;
    gen->inverse_accel = accel > 0.0 ? 1.0 / accel : 0.0;
    gen->rate_per_velocity = gen->scale * (TWO_TO_32 / ctx->clock_hz);
}

static double clamp(const double value, const double low, const double high)
{
    return value < low ? low : value > high ? high : value;
}

/* A command pin as a number, or what to use instead of NaN and infinities. */
static double usable_command(const struct stepgen *const gen, const char *const point, const double command,
                             const double fallback)
{
    if (fabs(command) <= DBL_MAX)
        return command;
    return report(gen, HM2_NOTICE_VALUE_INVALID, point, command, fallback);
}

/* Acceleration that brings the velocity to the command's, and the time it needs. Without a limit the original
 * algorithm takes one period, in the direction that its sign rule gives: kept, because it makes the motion. */
static double acceleration_to_match(const struct stepgen *const gen, const double velocity_error, const double period_s,
                                    double *const match_s)
{
    if (velocity_error == 0.0) {
        *match_s = 0.0;
        return 0.0;
    }
    if (gen->accel > 0.0) {
        *match_s = fabs(velocity_error) * gen->inverse_accel;
        return velocity_error > 0.0 ? -gen->accel : gen->accel;
    }
    const double acceleration = -(fabs(velocity_error) / period_s);
    *match_s = -velocity_error / acceleration;
    return acceleration;
}

static double follow(struct stepgen *const gen, const double command, const double period_s, const double per_second)
{
    const double before = gen->velocity;
    const double feed_forward = (command - gen->old_cmd) * per_second;
    const double velocity_error = before - feed_forward;
    double match_s;
    double acceleration = acceleration_to_match(gen, velocity_error, period_s, &match_s);
    const double position_then = gen->position + 0.5 * (feed_forward + before) * (match_s + period_s);
    const double command_then = command + feed_forward * match_s;
    const double error_then = position_then - command_then;

    *gen->dbg_pos_minus_prev_cmd = gen->position - gen->old_cmd;
    *gen->dbg_ff_vel = feed_forward;
    *gen->dbg_vel_error = velocity_error;
    *gen->dbg_s_to_match = fabs(match_s); /* never negative: verdict of hal-interface 8.2 */
    *gen->dbg_err_at_match = error_then;
    gen->old_cmd = command;
    if (fabs(feed_forward) > gen->headroom)
        hm2_notice(gen->module, HM2_NOTICE_HEADROOM, gen->number, feed_forward);

    if (match_s < period_s) {
        const double velocity = feed_forward - 0.5 * error_then * per_second;
        const double step = gen->accel * period_s;
        return gen->accel > 0.0 ? clamp(velocity, before - step, before + step) : velocity;
    }
    /* Would ramping the other way for one period bring us nearer? */
    const double change = -2.0 * acceleration * period_s * match_s;
    if (fabs(error_then + 2.0 * change) < fabs(error_then))
        acceleration = -acceleration;
    return before + acceleration * period_s;
}

static double next_velocity(struct stepgen *const gen, const double period_s, const double per_second)
{
    double velocity;
    if (*gen->control_type) {
        velocity = usable_command(gen, "velocity-cmd", *gen->velocity_cmd, 0.0);
        if (gen->accel > 0.0) {
            const double step = gen->accel * period_s;
            velocity = clamp(velocity, gen->velocity - step, gen->velocity + step);
        }
        gen->old_cmd = hm2_finite_or(*gen->position_cmd, gen->old_cmd);
    } else {
        const double command = usable_command(gen, "position-cmd", *gen->position_cmd, gen->old_cmd);
        velocity = follow(gen, command, period_s, per_second);
    }
    if (fabs(velocity) <= gen->limit)
        return velocity;
    /* Commands beyond what a double can subtract end as NaN: stand still rather than guess. */
    return velocity > 0.0 ? gen->limit : velocity < 0.0 ? -gen->limit : 0.0;
}

/* Is a parameter not as it was seen last? Written so that a NaN counts as changed. Parameters cannot be linked to
 * signals, only a person sets them: those of at most one generator are looked at in a cycle. */
static bool changed(const struct stepgen *const gen)
{
    const uint32_t words = (*gen->time_ns[STEPGEN_DIRSETUP] ^ gen->time_seen[STEPGEN_DIRSETUP]) |
                           (*gen->time_ns[STEPGEN_DIRHOLD] ^ gen->time_seen[STEPGEN_DIRHOLD]) |
                           (*gen->time_ns[STEPGEN_STEPLEN] ^ gen->time_seen[STEPGEN_STEPLEN]) |
                           (*gen->time_ns[STEPGEN_STEPSPACE] ^ gen->time_seen[STEPGEN_STEPSPACE]) |
                           (*gen->step_type ^ gen->type_seen);
    return words != 0 || !(*gen->maxvel == gen->maxvel_seen) || !(*gen->maxaccel == gen->maxaccel_seen);
}

/* Look at all generators: after load and after the card came back, or because the modes of some depend on more than
 * parameters. */
HM2_RARE static void look_at_all(struct hm2_module *const module, const bool look_for_changes)
{
    struct stepgen_module *const ctx = module->context;
    for (struct stepgen *gen = ctx->generator, *const end = gen + module->instances; gen < end; gen++)
        if (gen->watched || (look_for_changes && changed(gen)))
            stepgen_take_settings(gen);
}

static void look_at_parameters(struct hm2_module *const module)
{
    struct stepgen_module *const ctx = module->context;
    const unsigned look = ctx->look;
    if (look < module->instances && changed(&ctx->generator[look]))
        stepgen_take_settings(&ctx->generator[look]);
    if (ctx->watched > 0 || look == STEPGEN_LOOK_AT_ALL)
        look_at_all(module, look == STEPGEN_LOOK_AT_ALL);
    ctx->look = look + 1 < ctx->looks ? look + 1 : 0;
}

void stepgen_pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct stepgen_module *const ctx = module->context;
    if (!ctx)
        return;
    if (cycle->period_ns != ctx->period_seen_ns) {
        ctx->period_seen_ns = cycle->period_ns;
        ctx->inverse_period = 1.0 / cycle->period_s;
    }
    hm2_timer_pack(&ctx->timer, module);
    look_at_parameters(module);
    /* A bite switches the outputs off but not the generators: without the pulses the position they count would be
     * wrong (hal-interface 6, row 5a). */
    const bool may_move = !cycle->bitten;
    const double period_s = cycle->period_s, per_second = ctx->inverse_period;
    uint8_t *register_ = ctx->rates.bytes;
    for (struct stepgen *gen = ctx->generator, *const end = gen + module->instances; gen < end; gen++, register_ += 4) {
        int32_t rate = 0;
        if (*gen->enable && may_move) {
            gen->velocity = next_velocity(gen, period_s, per_second);
            rate = hm2_trunc_s32(gen->velocity * gen->rate_per_velocity);
        } else {
            gen->velocity = 0.0;
            gen->old_cmd = hm2_finite_or(*gen->position_cmd, gen->old_cmd);
        }
        *gen->velocity_fb = gen->velocity;
        *gen->dbg_step_rate = rate;
        hm2_put_le32(register_, (uint32_t)rate);
    }
}
