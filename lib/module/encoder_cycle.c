/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Counts, positions and velocity of the encoders: the state machine of hal-interface 2.8.
 *
 * Time is the card's: its 16-bit time-stamp counter, extended to 64 bits. How often the counter went round between two
 * replies follows from the time between the requests, so a lost cycle or a slow thread does not spoil a velocity.
 */
#include "encoder.h"

#include <math.h>

#include <hm2/bytes.h>

#define STAMP_TURN   65536u
#define STAMP_OF(c)  ((uint16_t)((c) >> 16)) /* time stamp of the last count (register map 3.5) */
#define COUNT_OF(c)  ((uint16_t)(c))
#define YOUNGER_MAX  4096u /* ticks by which an edge may be younger than the stamp counter read before it */
#define TURNS_MAX    1e9
#define VEL_TIMEOUT  0.5 /* s, default of the parameter */
#define NS_TO_S      1e-9
#define S_PER_MINUTE 60.0

static void read_clock(struct encoder_module *const ctx, const struct hm2_cycle *const cycle)
{
    const uint16_t stamp = (uint16_t)hm2_window_get(&ctx->stamp_counter, 0);
    const uint16_t ticks = (uint16_t)(stamp - ctx->stamp);
    const double expected = (double)(cycle->now_ns - ctx->stamp_ns) * NS_TO_S;
    ctx->now_ticks += ticks;
    if (expected > ctx->tick_s * (0.5 * STAMP_TURN)) {
        const double turns = (expected / ctx->tick_s - ticks) * (1.0 / STAMP_TURN);
        if (turns > 0.5 && turns < TURNS_MAX)
            ctx->now_ticks += (uint64_t)(turns + 0.5) * STAMP_TURN;
    }
    ctx->stamp = stamp;
    ctx->stamp_ns = cycle->now_ns;
}

/* The stamp counter is read first, so an edge may be a little younger than it. */
static uint64_t edge_time(const struct encoder_module *const ctx, const uint32_t count)
{
    const uint16_t age = (uint16_t)(ctx->stamp - STAMP_OF(count));
    if (age >= STAMP_TURN - YOUNGER_MAX)
        return ctx->now_ticks + (STAMP_TURN - age);
    return ctx->now_ticks - age;
}

static double seconds(const struct encoder_module *const ctx, const uint64_t from, const uint64_t to)
{
    return (double)(int64_t)(to - from) * ctx->tick_s;
}

static void take_scale(struct encoder *const enc)
{
    double scale = *enc->scale;
    if (!isfinite(scale) || scale == 0.0 || !isfinite(1.0 / scale)) {
        hm2_notice_point(enc->module, HM2_NOTICE_VALUE_INVALID, "scale", enc->number, scale);
        *enc->scale = scale = 1.0;
    }
    enc->scale_seen = scale;
    enc->inverse_scale = 1.0 / scale;
}

static double usable_timeout(const struct encoder *const enc)
{
    const double timeout_s = *enc->vel_timeout;
    if (timeout_s == timeout_s)
        return timeout_s;
    hm2_notice_point(enc->module, HM2_NOTICE_VALUE_INVALID, "vel-timeout", enc->number, timeout_s);
    return *enc->vel_timeout = VEL_TIMEOUT;
}

/* No edge in this cycle: not faster than one count in the time since the last. */
static void coast(struct encoder *const enc, const struct encoder_module *const ctx)
{
    const double since_s = seconds(ctx, enc->edge_ticks, ctx->now_ticks);
    if (since_s >= usable_timeout(enc)) {
        enc->speed = 0.0;
        enc->motion = ENCODER_STOPPED;
        return;
    }
    if (fabs(enc->speed) * since_s > fabs(enc->inverse_scale))
        enc->speed = copysign(fabs(enc->inverse_scale) / since_s, enc->speed);
    *enc->position_interpolated = enc->position_now + since_s * enc->speed;
}

static void moved(struct encoder *const enc, const struct encoder_module *const ctx, const uint32_t count,
                  const int32_t counts)
{
    const uint64_t edge = edge_time(ctx, count);
    const double since_s = seconds(ctx, enc->edge_ticks, edge);
    /* One count back on the same edge is vibration or a reversal: the time between them tells no velocity. */
    const bool dithers = (counts == 1 && enc->edge_counts < 0) || (counts == -1 && enc->edge_counts > 0);
    if (dithers)
        enc->speed = 0.0;
    else if (since_s > 0.0)
        enc->speed = counts * enc->inverse_scale / since_s;
    enc->edge_ticks = edge;
    enc->edge_counts = counts;
}

static void estimate_speed(struct encoder *const enc, const struct encoder_module *const ctx, const uint32_t count,
                           const int32_t counts)
{
    *enc->position_interpolated = enc->position_now;
    if (!ctx->timebase_known) {
        enc->motion = ENCODER_STOPPED;
    } else if (enc->motion == ENCODER_STOPPED) {
        if (counts == 0 && !(enc->word & ENCODER_LATCHES))
            return;
        enc->edge_ticks = edge_time(ctx, count);
        if (counts == 0 && (int64_t)(ctx->now_ticks - enc->edge_ticks) < 0)
            enc->edge_ticks = ctx->now_ticks;
        enc->edge_counts = 0;
        enc->motion = ENCODER_MOVING;
    } else if (counts == 0) {
        coast(enc, ctx);
    } else {
        moved(enc, ctx, count, counts);
    }
}

/* Pins of 32 bits show the low half; the positions come from all 64 bits (hal-interface 6, row 10). */
static int32_t low_half(const int64_t counts)
{
    return (int32_t)(uint32_t)(uint64_t)counts;
}

static inline void show_positions(struct encoder *const enc)
{
    const int64_t raw = enc->raw, raw_latched = enc->latched, zero = enc->zero;
    const double scale = enc->scale_seen;
    enc->position_now = (double)(raw - zero) / scale;
    *enc->rawcounts = low_half(raw);
    *enc->rawlatch = low_half(raw_latched);
    *enc->count = low_half(raw - zero);
    *enc->count_latched = low_half(raw_latched - zero);
    *enc->position = enc->position_now;
    *enc->position_latched = (double)(raw_latched - zero) / scale;
}

static inline void show_inputs(struct encoder *const enc, const uint32_t control)
{
    *enc->input_a = control & ENCODER_A;
    *enc->input_b = control >> 1 & 1u;
    *enc->input_index = control >> 2 & 1u;
}

static inline void unpack_one(struct encoder *const enc, const struct encoder_module *const ctx, const uint32_t count,
                              const uint32_t control)
{
    if (!(*enc->scale == enc->scale_seen))
        take_scale(enc);
    const int32_t counts = hm2_delta16(COUNT_OF(count), COUNT_OF(enc->count_word));
    enc->count_word = count;
    enc->raw += counts;
    enc->seen = control;
    if (enc->word & ENCODER_LATCHES)
        encoder_check_latch(enc, control);
    /* An old write that the network delivered late or twice has undone a newer one: send it again. */
    if (((control ^ enc->word) & ENCODER_READBACK) && hm2_section_confirmed(&enc->control))
        hm2_section_touch(&enc->control);
    if (*enc->reset)
        enc->zero = enc->latched = enc->raw;
    show_positions(enc);
    show_inputs(enc, control);
    const bool error = enc->quad == ENCODER_QUAD_REPORT && (control & ENCODER_QUAD_ERROR);
    *enc->quad_error = error;
    if (error)
        hm2_notice(enc->module, HM2_NOTICE_QUAD_ERROR, enc->number, 0.0);
    estimate_speed(enc, ctx, count, counts);
    *enc->velocity = enc->speed;
    *enc->velocity_rpm = enc->speed * S_PER_MINUTE;
    enc->still = enc->motion == ENCODER_STOPPED && enc->quad == ENCODER_QUAD_OFF && !(enc->word & ENCODER_LATCHES) &&
                 !((control ^ enc->word) & ENCODER_READBACK);
}

/* Nothing that the pins show can have changed. */
static inline bool is_unchanged(const struct encoder *const enc, const uint32_t count, const uint32_t control)
{
    return enc->still && count == enc->count_word && control == enc->seen && !*enc->reset &&
           *enc->scale == enc->scale_seen;
}

void encoder_unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct encoder_module *const ctx = module->context;
    if (!ctx)
        return;
    read_clock(ctx, cycle);
    if (!ctx->timebase_known)
        ctx->timebase_known = hm2_section_confirmed(&ctx->divisor);
    const uint8_t *const counts = ctx->counts.bytes, *const controls = ctx->controls.bytes;
    /* Links of the HAL file that loaded us are new before the first write; others may come at any time. */
    const unsigned look = cycle->writes == 0 ? ENCODER_LOOK_AT_ALL : ctx->look;
    for (unsigned i = 0; i < module->instances; i++) {
        struct encoder *const enc = &ctx->encoder[i];
        const uint32_t count = hm2_get_le32(counts + 4u * i), control = hm2_get_le32(controls + 4u * i);
        if (i == look || look == ENCODER_LOOK_AT_ALL || !is_unchanged(enc, count, control))
            unpack_one(enc, ctx, count, control);
    }
}

/* At load the raw counts begin with the counter's value and the position with 0; after the card's power came back both
 * go on from where they were. */
void encoder_start(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct encoder_module *const ctx = module->context;
    if (!ctx)
        return;
    ctx->timebase_known = false;
    ctx->stamp = (uint16_t)hm2_window_get(&ctx->stamp_counter, 0);
    ctx->stamp_ns = cycle->now_ns;
    for (unsigned i = 0; i < module->instances; i++) {
        struct encoder *const enc = &ctx->encoder[i];
        enc->count_word = hm2_window_get(&ctx->counts, i);
        enc->still = false;
        enc->seen = hm2_window_get(&ctx->controls, i);
        enc->motion = ENCODER_STOPPED;
        enc->speed = 0.0;
        enc->quad = ENCODER_QUAD_OFF;
        encoder_forget_latch(enc);
        if (!ctx->started) {
            enc->raw = enc->zero = enc->latched = COUNT_OF(enc->count_word);
            show_positions(enc);
        }
        show_inputs(enc, enc->seen);
        *enc->velocity = *enc->velocity_rpm = 0.0;
    }
    ctx->look = ENCODER_LOOK_AT_ALL;
    ctx->started = true;
}
