/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Conversions between the doubles that pins hold and the integers that registers hold. C leaves the conversion of an
 * out-of-range double undefined; these are defined for every value, NaN and infinities included. Realtime safe.
 */
#ifndef HM2_NUMBER_H
#define HM2_NUMBER_H

#include <stdbool.h>
#include <stdint.h>

/* Truncate toward zero into 32 bits; NaN becomes 0, values outside saturate. */
static inline int32_t hm2_trunc_s32(const double value)
{
    if (!(value > -2147483648.0))
        return value <= -2147483648.0 ? INT32_MIN : 0;
    return value >= 2147483647.0 ? INT32_MAX : (int32_t)value;
}

static inline uint32_t hm2_trunc_u32(const double value)
{
    if (!(value > 0.0))
        return 0;
    return value >= 4294967295.0 ? UINT32_MAX : (uint32_t)value;
}

/* Finite, or fallback: what a pin may hold is anybody's guess. */
static inline double hm2_finite_or(const double value, const double fallback)
{
    return value - value == 0.0 ? value : fallback;
}

#endif
