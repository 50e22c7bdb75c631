/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Showing many levels and gathering many bits cheaply. Private to lib/module. */
#ifndef HM2_MODULE_LEVELS_H
#define HM2_MODULE_LEVELS_H

#include <stdint.h>

#include <hm2/points.h>

/* Two pins for one level. */
struct hm2_level {
    hm2_bit_t *level, *inverse;
};

/* Write the pins of those bits of word that are set in which; levels[0] belongs to bit 0. */
static inline void hm2_show_levels(const struct hm2_level *const levels, const uint32_t word, uint32_t which)
{
    for (; which; which &= which - 1) {
        const unsigned bit = (unsigned)__builtin_ctz(which);
        const bool level = word >> bit & 1u;
        *levels[bit].level = level;
        *levels[bit].inverse = !level;
    }
}

/*
 * Taking turns. A pin is written when its level changed, and otherwise once in a few cycles: a host may link a pin to a
 * signal at any time, and the signal shall soon show the level even if that never changes.
 */
#define HM2_TURN_BITS       2u
#define HM2_TURN_MASK(turn) ((uint32_t)((((uint64_t)1 << HM2_TURN_BITS) - 1u) << HM2_TURN_BITS * (turn)))

/* Turns that a word of this width (up to 32 bits) needs. */
static inline unsigned hm2_turns(const unsigned width)
{
    return (width + HM2_TURN_BITS - 1u) / HM2_TURN_BITS;
}

/* One pin that the host writes. */
struct hm2_bit_in {
    hm2_bit_t *bit;
};

#define HM2_GATHER 4u /* pins are gathered in groups of so many */

/* Values of up to 32 pins as a word, pins[0] in bit 0. count is a multiple of HM2_GATHER; pins that do not exist point
 * at a constant 0. */
static inline uint32_t hm2_gather(const struct hm2_bit_in *const pins, const unsigned count)
{
    uint32_t word = 0;
    for (const struct hm2_bit_in *at = pins + count; at > pins; at -= HM2_GATHER) {
        const unsigned high = (unsigned)*at[-1].bit << 1 | *at[-2].bit, low = (unsigned)*at[-3].bit << 1 | *at[-4].bit;
        word = word << HM2_GATHER | high << 2 | low;
    }
    return word;
}

#endif
