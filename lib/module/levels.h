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
        const unsigned bit = (unsigned)__builtin_ctz(which), level = word >> bit & 1u;
        const struct hm2_level *const pins = &levels[bit];
        *pins->level = (bool)level;
        *pins->inverse = (bool)(level ^ 1u);
    }
}

/*
 * Taking turns. A pin is written when its level changed, in every cycle before the first write, when the links of a HAL
 * file are new, and otherwise once in 32 cycles: a host may link a pin to a signal at any time, and the signal shall
 * soon show the level even if that never changes. A turn is one bit of a word, the first is bit 0.
 */
#define HM2_FIRST_TURN 1u
#define HM2_TURNS      32u

static inline uint32_t hm2_next_turn(const uint32_t turn)
{
    return turn << 1 | turn >> (HM2_TURNS - 1u);
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
        word = 2u * word + *at[-1].bit;
        word = 2u * word + *at[-2].bit;
        word = 2u * word + *at[-3].bit;
        word = 2u * word + *at[-4].bit;
    }
    return word;
}

#endif
