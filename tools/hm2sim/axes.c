/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "axes.h"

#include <inttypes.h>
#include <stdio.h>

#include "sserial.h"

#define RESOLVER_AMPLITUDE 0.9 /* of the converter's range */

static int connect_encoders(const struct axes *const a, struct hm2_diag *const diag)
{
    const struct card_options *const o = a->options;
    for (unsigned i = 0; i < o->follower_count; i++) {
        const struct follower *const f = &o->followers[i];
        const int err = sim_card_follow(a->card, f->encoder, f->stepgen, f->num, f->den);
        if (err)
            return hm2_diag_add(diag, err, "--follow %u:%u: this card has no such encoder or step generator",
                                f->encoder, f->stepgen);
    }
    for (unsigned i = 0; i < o->motor_count; i++) {
        const struct motor *const m = &o->motors[i];
        const int err = sim_card_motor(a->card, m->encoder, m->pwmgen, m->counts_per_s);
        if (err)
            return hm2_diag_add(diag, err, "--motor %u:%u: this card has no such encoder or PWM generator", m->encoder,
                                m->pwmgen);
    }
    for (unsigned i = 0; i < o->servo_count; i++) {
        const struct servo *const s = &o->servos[i];
        const struct sim_drive drive = {s->port, s->channel, s->output, s->counts_per_s, s->time_constant_s};
        const int err = sim_card_drive_motor(a->card, s->encoder, &drive);
        if (err)
            return hm2_diag_add(diag, err,
                                "--servo %u:%u:%u:%s: this card has no such encoder, or no remote with such "
                                "a numeric output there",
                                s->encoder, s->port, s->channel, s->output);
    }
    for (unsigned i = 0; i < o->index_count; i++) {
        const int err = sim_card_index(a->card, o->indices[i].encoder, o->indices[i].counts);
        if (err)
            return hm2_diag_add(
                diag, err, "--index %u: this card has no such encoder with --follow, --motor, --servo or --7i65-motor",
                o->indices[i].encoder);
    }
    return 0;
}

static int connect_resolvers(const struct axes *const a, struct hm2_diag *const diag)
{
    for (unsigned i = 0; i < a->options->resolver_count; i++) {
        const struct resolver_option *const r = &a->options->resolvers[i];
        const struct sim_resolver resolver = {
            .amplitude = RESOLVER_AMPLITUDE, .turns = r->turns, .turns_per_s = r->turns_per_s, .pwmgen = r->pwmgen};
        const int err = sim_card_resolver(a->card, r->channel, &resolver);
        if (err)
            return hm2_diag_add(diag, err, "--resolver %u: this card has no such resolver channel or PWM generator",
                                r->channel);
    }
    return 0;
}

int axes_connect(struct axes *const axes, const struct card_options *const options, struct sim_card *const card,
                 struct hm2_diag *const diag)
{
    *axes = (struct axes){.options = options, .card = card};
    int err = connect_encoders(axes, diag);
    if (!err)
        err = connect_resolvers(axes, diag);
    if (err)
        return err;
    for (unsigned i = 0; i < options->switch_count; i++) {
        const struct position_switch *const s = &options->switches[i];
        const unsigned pins = sim_card_idrom(card)->pin_count;
        int64_t position;
        if (s->io >= pins)
            return hm2_diag_add(diag, HM2_ERR_RANGE, "--switch %u: this card has I/O 0 to %u", s->io, pins - 1);
        if (sim_card_turned(card, s->gtag, s->unit, &position))
            return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "--switch %u: this card has no %s %u", s->io,
                                s->gtag == HM2_GTAG_STEPGEN ? "step generator" : "encoder", s->unit);
    }
    return 0;
}

static enum sim_level level_of(const struct axes *const axes, const struct position_switch *const s)
{
    int64_t position = 0;
    (void)!sim_card_turned(axes->card, s->gtag, s->unit, &position); /* axes_connect() has tried */
    return position < s->position ? s->below : s->above;
}

/* Of several switches on one pad the strongest has its way: to 0, to 1, pulled up, open. */
static enum sim_level stronger(const enum sim_level one, const enum sim_level other)
{
    static const unsigned rank[] = {[SIM_LOW] = 0, [SIM_HIGH] = 1, [SIM_PULLUP] = 2, [SIM_FLOAT] = 3};
    return rank[one] <= rank[other] ? one : other;
}

void axes_run(struct axes *const axes)
{
    const struct card_options *const o = axes->options;
    for (unsigned i = 0; i < o->switch_count; i++) {
        enum sim_level level = SIM_FLOAT;
        for (unsigned k = 0; k < o->switch_count; k++)
            if (o->switches[k].io == o->switches[i].io)
                level = stronger(level, level_of(axes, &o->switches[k]));
        if (axes->pressed[i] && axes->levels[i] == level)
            continue;
        axes->pressed[i] = true;
        axes->levels[i] = level;
        (void)!sim_card_drive(axes->card, sim_card_clock(axes->card), o->switches[i].io, level);
    }
}

void axes_print(const struct axes *const axes, const char *const name)
{
    const struct card_options *const o = axes->options;
    const unsigned encoders = o->follower_count + o->motor_count + o->servo_count + o->servo_card_motor_count;
    int64_t position;
    for (unsigned unit = 0; encoders > 0 && sim_card_turned(axes->card, HM2_GTAG_ENCODER, unit, &position) == 0; unit++)
        printf("%s: encoder %u at %" PRId64 "\n", name, unit, position);
    for (unsigned i = 0; i < axes->options->resolver_count; i++) {
        const unsigned channel = axes->options->resolvers[i].channel;
        double turns;
        if (sim_card_resolver_turns(axes->card, channel, &turns) == 0)
            printf("%s: resolver %u at %.6f turns\n", name, channel, turns);
    }
}
