/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * SplitMix64 (Steele, Lea, Flood: "Fast splittable pseudorandom number generators", 2014): a counter in steps of the
 * golden ratio, put through an invertible mix of shifts and odd multiplications. Every seed gives a full period of
 * 2^64; equal seeds give equal sequences on every machine.
 */
#ifndef SIM_PRNG_H
#define SIM_PRNG_H

#include <stdint.h>

static inline uint64_t sim_prng_next(uint64_t *const state)
{
    *state += 0x9E3779B97F4A7C15u;
    uint64_t z = *state;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return z ^ z >> 31;
}

/* 0 <= result < 1, in steps of 2^-53. */
static inline double sim_prng_unit(uint64_t *const state)
{
    return (double)(sim_prng_next(state) >> 11) * 0x1.0p-53;
}

/* 0 <= result < bound; bound > 0. The bias of the remainder is below bound / 2^64. */
static inline uint64_t sim_prng_below(uint64_t *const state, const uint64_t bound)
{
    return sim_prng_next(state) % bound;
}

#endif
