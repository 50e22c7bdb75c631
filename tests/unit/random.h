/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Repeatable random numbers for property tests (splitmix64). */
#ifndef TEST_RANDOM_H
#define TEST_RANDOM_H

#include <stdint.h>

struct random {
    uint64_t state;
};

uint64_t random_u64(struct random *r);
/* 0..limit-1; limit > 0 */
uint32_t random_below(struct random *r, uint32_t limit);
/* A 32-bit value of random magnitude: small, large and extreme ones are equally likely. */
uint32_t random_magnitude(struct random *r);

#endif
