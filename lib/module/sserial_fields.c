/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Process data to pins and back, field by field (hal-interface 2.19). */
#include <math.h>

#include <hm2/number.h>

#include "sserial.h"

/* ---- inputs -------------------------------------------------------------------------------------------------------
 */

/* The host writes pins of both directions, too, so those are written in every cycle. */
static void take_bits(struct sserial_field *const field, const uint32_t *const words)
{
    const bool all = field->as.bit.turn == 0 || field->direction != SSLBP_INPUT;
    const uint32_t turn = all ? UINT32_MAX : field->as.bit.turn;
    field->as.bit.turn = field->as.bit.turn == 0 ? HM2_FIRST_TURN : hm2_next_turn(field->as.bit.turn);
    for (unsigned done = 0; done < field->bits; done += 32u) {
        const unsigned count = field->bits - done < 32u ? field->bits - done : 32u;
        const uint32_t word = (uint32_t)sslbp_get_bits(words, field->in_at + done, count);
        uint32_t *const shown = &field->as.bit.shown[done / 32u];
        const uint32_t which = (word ^ *shown) | turn;
        *shown = word;
        hm2_show_levels(field->as.bit.in + done, word, count < 32u ? which & ((1u << count) - 1u) : which);
    }
}

static void take_boolean(struct sserial_field *const field, const uint32_t *const words)
{
    hm2_show_levels(field->as.bit.in, sslbp_get_bits(words, field->in_at, field->bits) != 0, 1);
}

static void take_unsigned(struct sserial_field *const field, const uint32_t *const words)
{
    *field->as.number.value = sslbp_from_unsigned(sslbp_get_bits(words, field->in_at, field->bits), field->bits,
                                                  hm2_finite_or(*field->as.number.scalemax, 0.0));
}

static void take_signed(struct sserial_field *const field, const uint32_t *const words)
{
    *field->as.number.value = sslbp_from_signed(sslbp_get_bits(words, field->in_at, field->bits), field->bits,
                                                hm2_finite_or(*field->as.number.scalemax, 0.0));
}

/* A remote that sends a NaN gives no new value. */
static void take_float(struct sserial_field *const field, const uint32_t *const words)
{
    const double value = sslbp_from_float(sslbp_get_bits(words, field->in_at, field->bits), field->bits);
    *field->as.number.value = hm2_finite_or(value, *field->as.number.value);
}

static void take_stream(struct sserial_field *const field, const uint32_t *const words)
{
    *field->as.stream.value = (uint32_t)sslbp_get_bits(words, field->in_at, field->bits);
}

/* Accumulate, wrap-around included; counts are reported against an offset that reset and index set. The index is one
 * of software: the next multiple of counts-per-rev that is crossed. */
static void take_counter(struct sserial_field *const field, const uint32_t *const words)
{
    const unsigned low = field->as.counter.low_bits, bits = field->bits + low;
    uint64_t raw = sslbp_get_bits(words, field->in_at, field->bits) << low;
    if (low)
        raw |= sslbp_get_bits(words, field->as.counter.low_at, low);
    if (!field->as.counter.known)
        field->as.counter.raw_before = raw;
    const int64_t before = field->as.counter.accumulated;
    const int64_t step = sslbp_sign_extend(raw - field->as.counter.raw_before, bits);
    const int64_t now = (int64_t)((uint64_t)before + (uint64_t)step);
    field->as.counter.known = true;
    field->as.counter.raw_before = raw;
    field->as.counter.accumulated = now;
    if (*field->as.counter.reset)
        field->as.counter.offset = now;
    const int64_t rev = *field->as.counter.counts_per_rev;
    if (*field->as.counter.index_enable && rev > 0) {
        const int64_t a = before / rev - (before % rev < 0), b = now / rev - (now % rev < 0);
        if (a != b) {
            field->as.counter.offset = (a < b ? b : a) * rev;
            *field->as.counter.index_enable = false;
        }
    }
    const int64_t count = (int64_t)((uint64_t)now - (uint64_t)field->as.counter.offset);
    double scale = *field->as.counter.scale;
    if (!isfinite(scale) || scale == 0.0)
        *field->as.counter.scale = scale = 1.0;
    *field->as.counter.rawcounts = (int32_t)(uint32_t)(uint64_t)now;
    *field->as.counter.count = (int32_t)(uint32_t)(uint64_t)count;
    *field->as.counter.position = (double)count / scale;
}

void sserial_unpack(struct sserial_remote *const remote, const uint32_t *const words)
{
    static void (*const take[])(struct sserial_field * field, const uint32_t *words) = {
        [SSLBP_BITS] = take_bits,       [SSLBP_BOOLEAN] = take_boolean,   [SSLBP_UNSIGNED] = take_unsigned,
        [SSLBP_SIGNED] = take_signed,   [SSLBP_STREAM] = take_stream,     [SSLBP_FLOAT] = take_float,
        [SSLBP_ENCODER] = take_counter, [SSLBP_ENCODER_H] = take_counter, [SSLBP_ENCODER_L] = NULL,
    };
    for (struct sserial_field *field = remote->fields, *const end = field + remote->field_count; field < end; field++)
        if (field->direction != SSLBP_OUTPUT && take[field->type])
            take[field->type](field, words);
}

void sserial_start_counters(struct sserial_remote *const remote)
{
    for (struct sserial_field *field = remote->fields, *const end = field + remote->field_count; field < end; field++)
        if (field->type == SSLBP_ENCODER || field->type == SSLBP_ENCODER_H)
            field->as.counter.known = false;
}

/* ---- outputs ------------------------------------------------------------------------------------------------------
 */

struct place {
    const struct hm2_module *module;
    unsigned port;
};

/* A pin of both directions is in the list of inputs alone: a host knows one pointer of it. */
static bool level(const struct sserial_field *const field, const unsigned bit)
{
    if (!field->as.bit.out)
        return *field->as.bit.in[bit].level;
    const struct sserial_bit_out *const out = &field->as.bit.out[bit];
    return *out->bit != *out->invert;
}

static void put_bits(const struct sserial_field *const field, uint32_t *const words, const struct place *const place)
{
    (void)place;
    for (unsigned done = 0; done < field->bits; done += 32u) {
        const unsigned count = field->bits - done < 32u ? field->bits - done : 32u;
        uint32_t word = 0;
        for (unsigned i = count; i-- > 0;)
            word = word << 1 | level(field, done + i);
        sslbp_put_bits(words, field->out_at + done, count, word);
    }
}

static double limited(const struct sserial_field *const field, const struct place *const place)
{
    const double value = *field->as.number.value;
    if (!isfinite(value)) {
        hm2_notice_point(place->module, HM2_NOTICE_VALUE_INVALID, "output of a remote", place->port, value);
        return 0.0;
    }
    const double min = *field->as.number.minlim, max = *field->as.number.maxlim;
    const double below = value > max ? max : value;
    return below < min ? min : below; /* where the limits cross, the lower one counts, as with LinuxCNC's driver */
}

static void put_boolean(const struct sserial_field *const field, uint32_t *const words, const struct place *const place)
{
    (void)place;
    sslbp_put_bits(words, field->out_at, field->bits, level(field, 0) ? UINT64_MAX : 0);
}

static void put_unsigned(const struct sserial_field *const field, uint32_t *const words,
                         const struct place *const place)
{
    const uint64_t raw = sslbp_to_unsigned(limited(field, place), field->bits, *field->as.number.scalemax);
    sslbp_put_bits(words, field->out_at, field->bits, raw);
}

static void put_signed(const struct sserial_field *const field, uint32_t *const words, const struct place *const place)
{
    const uint64_t raw = sslbp_to_signed(limited(field, place), field->bits, *field->as.number.scalemax);
    sslbp_put_bits(words, field->out_at, field->bits, raw);
}

static void put_float(const struct sserial_field *const field, uint32_t *const words, const struct place *const place)
{
    (void)place;
    sslbp_put_bits(words, field->out_at, field->bits,
                   sslbp_to_float(hm2_finite_or(*field->as.number.value, 0.0), field->bits));
}

static void put_stream(const struct sserial_field *const field, uint32_t *const words, const struct place *const place)
{
    (void)place;
    sslbp_put_bits(words, field->out_at, field->bits, *field->as.stream.value);
}

void sserial_pack(const struct hm2_module *const module, const unsigned port, struct sserial_remote *const remote)
{
    static void (*const put[])(const struct sserial_field *field, uint32_t *words, const struct place *place) = {
        [SSLBP_BITS] = put_bits,     [SSLBP_BOOLEAN] = put_boolean, [SSLBP_UNSIGNED] = put_unsigned,
        [SSLBP_SIGNED] = put_signed, [SSLBP_STREAM] = put_stream,   [SSLBP_FLOAT] = put_float,
    };
    const struct place place = {module, port};
    for (unsigned i = 0; i < SSLBP_USER_WORDS; i++)
        remote->out[i] = 0;
    /* Discovery lets nothing but these types, and padding, be outputs. */
    for (const struct sserial_field *field = remote->fields, *const end = field + remote->field_count; field < end;
         field++)
        if (field->direction != SSLBP_INPUT && put[field->type])
            put[field->type](field, remote->out, &place);
}

/* ---- parameters ---------------------------------------------------------------------------------------------------
 */

static uint64_t low_bits(const uint64_t value, const unsigned bits)
{
    return bits >= 64u ? value : value & ((UINT64_C(1) << bits) - 1u);
}

static bool is_float(const struct sserial_global *const global)
{
    return global->type == SSLBP_FLOAT || global->type == SSLBP_NV_FLOAT;
}

static bool is_signed(const struct sserial_global *const global)
{
    return global->type == SSLBP_SIGNED || global->type == SSLBP_NV_SIGNED;
}

uint64_t sserial_global_raw(const struct sserial_global *const global)
{
    if (is_float(global))
        return sslbp_to_float(*global->value.f, global->bits);
    return low_bits(is_signed(global) ? (uint64_t)(int64_t)*global->value.s : *global->value.u, global->bits);
}

void sserial_global_show(const struct sserial_global *const global, const uint64_t raw)
{
    if (is_float(global))
        *global->value.f = hm2_finite_or(sslbp_from_float(raw, global->bits), 0.0);
    else if (is_signed(global))
        *global->value.s = (int32_t)sslbp_sign_extend(raw, global->bits);
    else
        *global->value.u = (uint32_t)low_bits(raw, global->bits);
}
