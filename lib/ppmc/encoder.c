/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One axis: from 24-bit readings to position and velocity (ppmc.md sections 6.2 to 6.5). */
#include <hm2/number.h>

#include "ppmc_private.h"

#define COUNTER_MASK 0xFFFFFFu
#define COUNTER_SIGN 0x800000u
#define MIN_SCALE    1e-20
#define US_PER_S     1e6
/* So long after its last count a shaft stands: as long as a 16-bit timestamp lasts. */
#define STANDSTILL_US 65500
/* From so many counts in a period on, one more or less matters little, and a velocity needs no timestamp. */
#define MANY_COUNTS 16

static uint32_t get_raw(const uint8_t *const bytes)
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16;
}

static int32_t sign_extend(const uint32_t raw)
{
    return (int32_t)((raw & COUNTER_MASK) ^ COUNTER_SIGN) - (int32_t)COUNTER_SIGN;
}

static int32_t magnitude(const int32_t value)
{
    return value < 0 ? -value : value; /* of 24 bits */
}

/* It went on as it went before, and where that led is not near 0: nothing has preset it. */
static bool went_on(const struct ppmc_encoder *const encoder, const struct ppmc_judgement *const judgement)
{
    const int32_t pace = magnitude(encoder->last_delta);
    return magnitude(judgement->moved - encoder->last_delta) <= 4 + pace / 4 &&
           magnitude(judgement->value) > 4 + 2 * pace;
}

struct ppmc_judgement ppmc_judge(const struct ppmc_encoder *const encoder, const uint8_t *const bytes, const bool sense,
                                 const int64_t most)
{
    const uint32_t raw = get_raw(bytes);
    struct ppmc_judgement judgement = {.raw = raw, .value = sign_extend(raw), .moved = sign_extend(raw - encoder->raw)};
    const bool far = magnitude(judgement.moved) > most;
    /* Preset to 0, it cannot have gone further since. That the index was seen is no proof: it may have been in the
     * moment before it was armed. Nor is it one that it was not seen, when the byte that told it was lost on the way.
     */
    judgement.index =
        encoder->may_preset && (sense || far) && magnitude(judgement.value) <= most && !went_on(encoder, &judgement);
    judgement.impossible = encoder->known && far && !judgement.index;
    return judgement;
}

void ppmc_encoder_rebase(struct ppmc_encoder *const encoder, const uint8_t *const bytes)
{
    encoder->raw = get_raw(bytes);
    encoder->last_delta = 0;
    encoder->speed = 0.0;
    encoder->stamp.valid = false;
    encoder->may_preset = encoder->armed;
}

/* ---- velocity ---------------------------------------------------------------------------------------------------- */

static double by_period(const struct ppmc_encoder *const encoder, const struct ppmc_time *const time)
{
    return time->period_s > 0.0 ? (double)encoder->last_delta / time->period_s : 0.0;
}

static bool turns_round(struct ppmc_encoder *const encoder)
{
    const int direction = encoder->last_delta < 0 ? -1 : 1, before = encoder->direction;
    encoder->direction = direction;
    return direction == -before;
}

/* Counts came: how many since the last one that has a time, in how long. */
static void speed_of_counts(struct ppmc_encoder *const encoder, const struct ppmc_time *const time)
{
    const struct ppmc_stamp before = encoder->stamp;
    const bool many = magnitude(encoder->last_delta) >= MANY_COUNTS, turned = turns_round(encoder);
    if (!time->stamped) {
        if (many || !before.valid)
            encoder->speed = by_period(encoder, time);
        return; /* the next count that has a time tells of this one, too */
    }
    encoder->stamp = (struct ppmc_stamp){true, encoder->total, time->count_us};
    if (before.valid && turned)
        encoder->speed = 0.0; /* to and fro over an edge is no motion */
    else if (before.valid && time->count_us > before.at_us)
        encoder->speed = (double)(encoder->total - before.total) * US_PER_S / (double)(time->count_us - before.at_us);
    else
        encoder->speed = by_period(encoder, time);
}

/* No count came: it is slower than one count in the time since the last. */
static void speed_of_silence(struct ppmc_encoder *const encoder, const struct ppmc_time *const time)
{
    const int64_t age_us = time->clock_us - encoder->stamp.at_us;
    if (!encoder->stamp.valid || age_us >= STANDSTILL_US) {
        encoder->stamp.valid = false;
        encoder->speed = 0.0;
        return;
    }
    const double limit = US_PER_S / (double)(age_us > 0 ? age_us : 1);
    if (encoder->speed > limit)
        encoder->speed = limit;
    else if (encoder->speed < -limit)
        encoder->speed = -limit;
}

static void take_speed(struct ppmc_encoder *const encoder, const struct ppmc_time *const time, const bool uses_stamps)
{
    if (!uses_stamps)
        encoder->speed = by_period(encoder, time);
    else if (encoder->last_delta != 0)
        speed_of_counts(encoder, time);
    else
        speed_of_silence(encoder, time);
}

/* ---- a good reading ---------------------------------------------------------------------------------------------- */

void ppmc_encoder_take(struct ppmc_encoder *const encoder, const struct ppmc_judgement *const judgement,
                       const bool sense, const struct ppmc_time *const time)
{
    encoder->raw = judgement->raw;
    if (judgement->index || !encoder->known) {
        /* How far it moved before the index nobody knows: the speed stays, the counts are those since the index. */
        encoder->total = encoder->last_delta = judgement->value;
        encoder->stamp.valid = false;
    } else {
        encoder->total += judgement->moved;
        encoder->last_delta = judgement->moved;
        take_speed(encoder, time, time->clock_us >= 0);
    }
    if (judgement->index)
        *encoder->index_enable = false;
    encoder->known = true;
    encoder->may_preset = encoder->armed;
    *encoder->index = sense;
}

static double usable_scale(struct ppmc_encoder *const encoder)
{
    const double scale = *encoder->scale;
    const double good = hm2_finite_or(scale, 1.0);
    const double usable = good >= MIN_SCALE || good <= -MIN_SCALE ? good : good < 0.0 ? -1.0 : 1.0;
    if (usable != scale)
        *encoder->scale = usable;
    return usable;
}

void ppmc_encoder_show(struct ppmc_encoder *const encoder, const bool good, const bool online)
{
    const double scale = usable_scale(encoder);
    *encoder->count = (int32_t)(uint32_t)(uint64_t)encoder->total;
    *encoder->delta = good ? encoder->last_delta : 0;
    *encoder->position = (double)encoder->total / scale;
    *encoder->velocity = online ? encoder->speed / scale : 0.0;
    if (!good)
        *encoder->index = false;
}
