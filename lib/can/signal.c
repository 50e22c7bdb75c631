/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Signals in the bytes of a frame. */
#include <hm2/dbc.h>

#include <float.h>
#include <math.h>
#include <string.h>

#define MAX_FRAME_BITS (8u * HM2_CAN_MAX_BYTES)

/* The numbering in which a Motorola signal goes up without jumps: from a byte's most significant bit down, and on to
 * the next byte. */
static unsigned motorola_position(const unsigned start)
{
    return (start & ~7u) + 7u - (start & 7u);
}

unsigned hm2_dbc_signal_bytes(const struct hm2_dbc_signal *const s)
{
    const unsigned first = s->big_endian ? motorola_position(s->start) : s->start;
    return (first + s->bits - 1u) / 8u + 1u;
}

static unsigned least(const unsigned a, const unsigned b)
{
    return a < b ? a : b;
}

static uint64_t ones(const unsigned bits)
{
    return bits >= 64u ? UINT64_MAX : (UINT64_C(1) << bits) - 1u;
}

uint64_t hm2_dbc_raw(const struct hm2_dbc_signal *const s, const uint8_t *const data)
{
    uint64_t raw = 0;
    unsigned position = s->big_endian ? motorola_position(s->start) : s->start;
    for (unsigned done = 0; done < s->bits;) {
        const unsigned used = position % 8u, count = least(8u - used, s->bits - done);
        const unsigned shift = s->big_endian ? 8u - used - count : used;
        const uint64_t part = (uint64_t)data[position / 8u] >> shift & ones(count);
        raw = s->big_endian ? raw << count | part : raw | part << done;
        position += count;
        done += count;
    }
    return raw;
}

void hm2_dbc_put_raw(const struct hm2_dbc_signal *const s, uint8_t *const data, const uint64_t raw)
{
    unsigned position = s->big_endian ? motorola_position(s->start) : s->start;
    for (unsigned done = 0; done < s->bits;) {
        const unsigned used = position % 8u, count = least(8u - used, s->bits - done);
        const unsigned shift = s->big_endian ? 8u - used - count : used;
        const uint64_t part = raw >> (s->big_endian ? s->bits - done - count : done) & ones(count);
        uint8_t *const byte = &data[position / 8u];
        *byte = (uint8_t)((*byte & ~(ones(count) << shift)) | part << shift);
        position += count;
        done += count;
    }
}

static double number_of(const struct hm2_dbc_signal *const s, const uint64_t raw)
{
    float f;
    double d;
    const uint32_t low = (uint32_t)raw;
    switch (s->kind) {
    case HM2_DBC_FLOAT32:
        memcpy(&f, &low, sizeof f);
        return (double)f;
    case HM2_DBC_FLOAT64:
        memcpy(&d, &raw, sizeof d);
        return d;
    case HM2_DBC_SIGNED:
        return (double)((int64_t)(raw << (64u - s->bits)) >> (64u - s->bits));
    case HM2_DBC_UNSIGNED:
    default:
        return (double)raw;
    }
}

double hm2_dbc_value(const struct hm2_dbc_signal *const s, const uint8_t *const data)
{
    return number_of(s, hm2_dbc_raw(s, data)) * s->scale + s->offset;
}

static uint64_t integer_raw(const struct hm2_dbc_signal *const s, const double number)
{
    const double rounded = round(number);
    if (s->kind == HM2_DBC_UNSIGNED)
        return !(rounded > 0.0) ? 0 : rounded >= ldexp(1.0, s->bits) ? ones(s->bits) : (uint64_t)rounded;
    const double limit = ldexp(1.0, s->bits - 1);
    if (rounded >= limit)
        return ones(s->bits - 1u);
    return (rounded <= -limit ? UINT64_C(1) << (s->bits - 1u) : (uint64_t)(int64_t)rounded) & ones(s->bits);
}

static uint64_t float_raw(const struct hm2_dbc_signal *const s, const double number)
{
    uint64_t raw = 0;
    if (s->kind == HM2_DBC_FLOAT64) {
        memcpy(&raw, &number, sizeof raw);
        return raw;
    }
    const double bounded = number > (double)FLT_MAX    ? (double)FLT_MAX
                           : number < -(double)FLT_MAX ? -(double)FLT_MAX
                                                       : number;
    const float f = (float)bounded;
    uint32_t low;
    memcpy(&low, &f, sizeof low);
    return low;
}

bool hm2_dbc_put_value(const struct hm2_dbc_signal *const s, uint8_t *const data, const double value)
{
    if (isnan(value))
        return false;
    const bool limited = s->min < s->max;
    const double wanted = limited && value < s->min ? s->min : limited && value > s->max ? s->max : value;
    const double number = (wanted - s->offset) / s->scale;
    const bool is_float = s->kind == HM2_DBC_FLOAT32 || s->kind == HM2_DBC_FLOAT64;
    hm2_dbc_put_raw(s, data, is_float ? float_raw(s, number) : integer_raw(s, number));
    return true;
}

static bool is_selected(const struct hm2_dbc *const dbc, const struct hm2_dbc_signal *const s, const uint64_t raw)
{
    for (uint32_t i = 0; i < s->mux_count; i++)
        if (raw >= dbc->mux[s->first_mux + i].first && raw <= dbc->mux[s->first_mux + i].last)
            return true;
    return false;
}

bool hm2_dbc_present(const struct hm2_dbc *const dbc, const struct hm2_dbc_signal *s, const uint8_t *const data)
{
    for (unsigned depth = 0; s->multiplexor != HM2_DBC_NO_SIGNAL; depth++) {
        const struct hm2_dbc_signal *const above = &dbc->signals[s->multiplexor];
        if (depth >= HM2_DBC_MAX_MUX_DEPTH || !is_selected(dbc, s, hm2_dbc_raw(above, data)))
            return false;
        s = above;
    }
    return true;
}

void hm2_dbc_range(const struct hm2_dbc_signal *const s, double *const low, double *const high)
{
    double first = 0, last = ldexp(1.0, s->bits) - 1.0;
    if (s->kind == HM2_DBC_SIGNED) {
        first = -ldexp(1.0, s->bits - 1);
        last = -first - 1.0;
    } else if (s->kind != HM2_DBC_UNSIGNED) {
        last = s->kind == HM2_DBC_FLOAT32 ? (double)FLT_MAX : DBL_MAX;
        first = -last;
    }
    const double a = first * s->scale + s->offset, b = last * s->scale + s->offset;
    *low = a < b ? a : b;
    *high = a < b ? b : a;
}
