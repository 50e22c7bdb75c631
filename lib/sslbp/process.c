/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Process data: fields lie one behind the other in the interface registers, from bit 0 of register 0 on, in the order
 * of the PTOC (seed 003, "PROCESS DATA ELEMENT PACKING AND UNPACKING"). Arithmetic of hal-interface 2.19.
 */
#include <string.h>

#include <hm2/number.h>
#include <hm2/sslbp.h>

#define WORD_BITS     32u
#define SIGNED_SCALE  2147483647.0
#define TWO_TO_THE_63 9223372036854775808.0
#define TWO_TO_THE_64 18446744073709551616.0

static uint64_t mask_of(const unsigned bits)
{
    return bits >= 64u ? UINT64_MAX : (UINT64_C(1) << bits) - 1u;
}

uint64_t sslbp_get_bits(const uint32_t *const words, const unsigned at, const unsigned bits)
{
    uint64_t value = 0;
    for (unsigned done = 0; done < bits;) {
        const unsigned from = (at + done) % WORD_BITS;
        value |= (uint64_t)(words[(at + done) / WORD_BITS] >> from) << done;
        done += WORD_BITS - from;
    }
    return value & mask_of(bits);
}

void sslbp_put_bits(uint32_t *const words, const unsigned at, const unsigned bits, const uint64_t value)
{
    for (unsigned done = 0; done < bits;) {
        const unsigned from = (at + done) % WORD_BITS;
        const unsigned here = WORD_BITS - from < bits - done ? WORD_BITS - from : bits - done;
        uint32_t *const word = &words[(at + done) / WORD_BITS];
        const uint32_t mask = (uint32_t)mask_of(here) << from;
        *word = (*word & ~mask) | ((uint32_t)(value >> done) << from & mask);
        done += here;
    }
}

int64_t sslbp_sign_extend(const uint64_t raw, const unsigned bits)
{
    const uint64_t sign = UINT64_C(1) << (bits - 1u);
    return (int64_t)(((raw & mask_of(bits)) ^ sign) - sign);
}

double sslbp_from_unsigned(const uint64_t raw, const unsigned bits, const double full_scale)
{
    return (double)raw * full_scale / (double)mask_of(bits);
}

/* Up to 32 bits the field is moved to the top of a word whose largest value is full scale, as LinuxCNC does. */
double sslbp_from_signed(const uint64_t raw, const unsigned bits, const double full_scale)
{
    const int64_t value = sslbp_sign_extend(raw, bits);
    if (bits > WORD_BITS)
        return (double)value / (double)mask_of(bits - 1u) * full_scale;
    return (double)(value * (INT64_C(1) << (WORD_BITS - bits))) / SIGNED_SCALE * full_scale;
}

static double ratio(const double value, const double full_scale)
{
    const double part = value / full_scale;
    return part - part == 0.0 ? part : 0.0;
}

uint64_t sslbp_to_unsigned(const double value, const unsigned bits, const double full_scale)
{
    const double raw = ratio(value, full_scale) * (double)mask_of(bits);
    if (!(raw > 0.0))
        return 0;
    return raw >= TWO_TO_THE_64 || (uint64_t)raw > mask_of(bits) ? mask_of(bits) : (uint64_t)raw;
}

static int64_t trunc_s64(const double value)
{
    if (value >= TWO_TO_THE_63)
        return INT64_MAX;
    return value <= -TWO_TO_THE_63 ? INT64_MIN : (int64_t)value;
}

static int64_t clamp_signed(const int64_t value, const unsigned bits)
{
    const int64_t top = (int64_t)mask_of(bits - 1u);
    return value > top ? top : value < -top - 1 ? -top - 1 : value;
}

uint64_t sslbp_to_signed(const double value, const unsigned bits, const double full_scale)
{
    const double part = ratio(value, full_scale);
    const int64_t raw = bits > WORD_BITS ? clamp_signed(trunc_s64(part * (double)mask_of(bits - 1u)), bits)
                                         : hm2_trunc_s32(part * SIGNED_SCALE) >> (WORD_BITS - bits);
    return (uint64_t)raw & mask_of(bits);
}

double sslbp_from_float(const uint64_t raw, const unsigned bits)
{
    if (bits == 64u) {
        double value;
        memcpy(&value, &raw, sizeof value);
        return value;
    }
    const uint32_t word = (uint32_t)raw;
    float value;
    memcpy(&value, &word, sizeof value);
    return (double)value;
}

uint64_t sslbp_to_float(const double value, const unsigned bits)
{
    if (bits == 64u) {
        uint64_t raw;
        memcpy(&raw, &value, sizeof raw);
        return raw;
    }
    /* The conversion of what a float cannot hold is undefined. */
    const double limit = 3.4028234663852886e38;
    const float single = (float)(value > limit ? limit : value < -limit ? -limit : value);
    uint32_t word;
    memcpy(&word, &single, sizeof word);
    return word;
}
