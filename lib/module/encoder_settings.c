/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The rarely written registers of the encoders: control words, time-stamp divisor, filter rate, sampling timer. */
#include "encoder.h"

enum { REG_CONTROL = 1, REG_DIVISOR = 2, REG_FILTER_RATE = 4, REG_TIMER = 5 };

#define STAMP_HZ       2000000u  /* normal and */
#define STAMP_HIRES_HZ 10000000u /* hires-timestamp (hal-interface 2.8) */
#define EVERY_CLOCK    0x8000u   /* divisor register, bit 15 (register map 3.5.2) */

#define FILTER_EVERY_CLOCK 0xFFFu /* bit 11 set (register map 3.5.3) */
#define FILTER_MAX         0x7FFu
#define SKEW_SHIFT         28
#define SKEW_MAX           15u
#define NS_PER_S           1000000000u

uint32_t encoder_filter_rate(const uint32_t clock_hz, const uint32_t wanted_hz, uint32_t *const actual_hz)
{
    const uint32_t divider = wanted_hz ? clock_hz / wanted_hz : UINT32_MAX;
    if (divider <= 1) {
        *actual_hz = clock_hz;
        return FILTER_EVERY_CLOCK;
    }
    const uint32_t rate = divider - 2 > FILTER_MAX ? FILTER_MAX : divider - 2;
    *actual_hz = clock_hz / (rate + 2);
    return rate;
}

uint32_t encoder_skew(const uint32_t clock_hz, const uint32_t wanted_ns, uint32_t *const actual_ns)
{
    uint64_t clocks = ((uint64_t)wanted_ns * clock_hz + NS_PER_S / 2) / NS_PER_S;
    if (clocks > SKEW_MAX)
        clocks = SKEW_MAX;
    *actual_ns = clock_hz ? (uint32_t)((clocks * NS_PER_S + clock_hz / 2) / clock_hz) : 0;
    return (uint32_t)clocks;
}

uint32_t encoder_divisor(const uint32_t clock_hz, const uint32_t tick_hz, double *const tick_s)
{
    const uint32_t divider = tick_hz ? clock_hz / tick_hz : 0;
    if (divider < 2) {
        *tick_s = 1.0 / (double)clock_hz;
        return EVERY_CLOCK;
    }
    const uint32_t divisor = divider - 2 < EVERY_CLOCK ? divider - 2 : EVERY_CLOCK - 1;
    *tick_s = (double)(divisor + 2) / (double)clock_hz;
    return divisor;
}

HM2_RARE static void pack_filter(struct encoder_module *const ctx, const struct hm2_module *const module)
{
    const uint32_t wanted_hz = *ctx->sample_frequency, wanted_ns = ctx->skew_ns ? *ctx->skew_ns : 0;
    if (wanted_hz == ctx->sample_frequency_seen && wanted_ns == ctx->skew_seen_ns)
        return;
    uint32_t word = encoder_filter_rate(ctx->clock_hz, wanted_hz, &ctx->sample_frequency_seen);
    if (wanted_hz == 0)
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, ctx->muxed ? "muxed-sample-frequency" : "sample-frequency",
                         HM2_NO_INSTANCE, 0.0);
    *ctx->sample_frequency = ctx->sample_frequency_seen;
    if (ctx->skew_ns) {
        word |= encoder_skew(ctx->clock_hz, wanted_ns, &ctx->skew_seen_ns) << SKEW_SHIFT;
        *ctx->skew_ns = ctx->skew_seen_ns;
    }
    hm2_section_set(&ctx->filter_rate, 0, word);
}

HM2_RARE static void pack_divisor(struct encoder_module *const ctx, const unsigned encoders)
{
    const bool hires = *ctx->hires_timestamp;
    ctx->hires_seen = hires;
    hm2_section_set(&ctx->divisor, 0, encoder_divisor(ctx->clock_hz, hires ? STAMP_HIRES_HZ : STAMP_HZ, &ctx->tick_s));
    /* Stamps of both tick lengths cannot be compared: velocities begin anew when the card counts with the new one. */
    ctx->timebase_known = false;
    for (unsigned i = 0; i < encoders; i++) {
        ctx->encoder[i].motion = ENCODER_STOPPED;
        ctx->encoder[i].still = false;
    }
}

static uint32_t quad_bits(struct encoder *const enc)
{
    if (!*enc->quad_error_enable)
        enc->quad = ENCODER_QUAD_OFF;
    else if (enc->quad == ENCODER_QUAD_OFF)
        enc->quad = ENCODER_QUAD_ONE;
    else if (enc->quad != ENCODER_QUAD_REPORT && hm2_section_confirmed(&enc->control))
        enc->quad = enc->quad == ENCODER_QUAD_ONE ? ENCODER_QUAD_ZERO : ENCODER_QUAD_REPORT;
    return enc->quad == ENCODER_QUAD_ONE ? ENCODER_QUAD_ERROR : 0;
}

static uint32_t when(const bool condition, const uint32_t bits)
{
    return condition ? bits : 0;
}

static uint32_t control_word(struct encoder *const enc, const bool has_probe)
{
    const uint32_t polarity = when(*enc->index_invert, ENCODER_INDEX_HIGH);
    uint32_t word = polarity | encoder_arm(enc, polarity, has_probe) | quad_bits(enc);
    word |= when(*enc->index_mask, ENCODER_MASK_USE);
    word |= when(*enc->index_mask_invert, ENCODER_MASK_HIGH);
    word |= when(*enc->counter_mode, ENCODER_UP_DOWN);
    word |= when(*enc->filter, ENCODER_FILTER);
    if (has_probe)
        word |= when(*enc->probe_invert, ENCODER_PROBE_HIGH);
    return word;
}

HM2_RARE static void pack_control(struct encoder *const enc, const bool has_probe)
{
    const uint32_t word = control_word(enc, has_probe);
    enc->still = enc->still && word == enc->word && enc->quad == ENCODER_QUAD_OFF;
    enc->busy = (word & (ENCODER_LATCHES | ENCODER_QUAD_ERROR)) != 0 || enc->quad != ENCODER_QUAD_OFF;
    if (word != enc->word) {
        enc->word = word;
        hm2_section_set(&enc->control, 0, word);
    }
}

/* Does a pin want something of the control word, or did one? Parameters cannot be linked to signals, only a person sets
 * them: at most one encoder's are looked at in a cycle. */
static inline bool is_busy(const struct encoder *const enc, const bool has_probe)
{
    return enc->busy || *enc->index_enable || *enc->quad_error_enable || (has_probe && *enc->probe_enable);
}

static inline void pack_all(struct encoder_module *const ctx, const unsigned instances, const bool has_probe)
{
    const unsigned look = ctx->look;
    for (unsigned i = 0; i < instances; i++)
        if (is_busy(&ctx->encoder[i], has_probe) || i == look || look == ENCODER_LOOK_AT_ALL)
            pack_control(&ctx->encoder[i], has_probe);
}

void encoder_pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    (void)cycle;
    struct encoder_module *const ctx = module->context;
    if (!ctx)
        return;
    if (*ctx->hires_timestamp != ctx->hires_seen)
        pack_divisor(ctx, module->instances);
    if (ctx->look == 0 || ctx->look == ENCODER_LOOK_AT_ALL)
        pack_filter(ctx, module);
    hm2_timer_pack(&ctx->timer, module);
    if (ctx->has_probe)
        pack_all(ctx, module->instances, true);
    else
        pack_all(ctx, module->instances, false);
    ctx->look = ctx->look + 1 < ctx->looks ? ctx->look + 1 : 0;
}

static int add_word(struct hm2_setup *const setup, struct hm2_section *const section, const struct hm2_md *const md,
                    const unsigned reg, const unsigned instance)
{
    return hm2_plan_add_setup(setup->plan, section, HM2_RANK_NORMAL, hm2_md_address(md, reg, instance), 1, 0,
                              setup->diag);
}

/* Does the card have the select register of the sampling timer? Newer firmware reads back the 0 that was written, a
 * bus that nobody drives may read all ones (register map 3.5.6). */
static int add_timer(struct hm2_module *const module, struct hm2_setup *const setup)
{
    struct encoder_module *const ctx = module->context;
    const uint16_t address = hm2_md_address(module->md, REG_TIMER, 0);
    uint32_t value = 0;
    if (!ctx->timer.number || !hm2_timer_page_free(setup->idrom, module->md, REG_TIMER))
        return 0;
    int err = setup->poke(setup, address, 1, &value);
    if (!err)
        err = setup->peek(setup, address, 1, &value);
    if (err < 0)
        return hm2_diag_add(setup->diag, err, "the timer register of %s at 0x%04X cannot be read: %s",
                            module->type->name, address, hm2_strerror(err));
    if (value != 0)
        return 0;
    return hm2_timer_add(&ctx->timer, module, setup, REG_TIMER);
}

int encoder_add_settings(struct hm2_module *const module, struct hm2_setup *const setup)
{
    struct encoder_module *const ctx = module->context;
    int err = add_word(setup, &ctx->divisor, module->md, REG_DIVISOR, 0);
    if (!err)
        err = add_word(setup, &ctx->filter_rate, module->md, REG_FILTER_RATE, 0);
    if (!err)
        err = add_timer(module, setup);
    /* One section each: a word that is sent for one encoder must not arm the latch of another anew. */
    for (unsigned i = 0; !err && i < module->instances; i++)
        err = add_word(setup, &ctx->encoder[i].control, module->md, REG_CONTROL, i);
    if (err)
        return err;
    pack_divisor(ctx, module->instances);
    pack_filter(ctx, module);
    for (unsigned i = 0; i < module->instances; i++) {
        ctx->encoder[i].word = ENCODER_FILTER; /* the default of the points */
        hm2_section_set(&ctx->encoder[i].control, 0, ENCODER_FILTER);
    }
    return 0;
}
