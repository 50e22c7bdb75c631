/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "random.h"

uint64_t random_u64(struct random *const r)
{
    r->state += UINT64_C(0x9E3779B97F4A7C15);
    uint64_t z = r->state;
    z = (z ^ z >> 30) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ z >> 27) * UINT64_C(0x94D049BB133111EB);
    return z ^ z >> 31;
}

uint32_t random_below(struct random *const r, const uint32_t limit)
{
    return limit > 0 ? (uint32_t)((random_u64(r) >> 32) * limit >> 32) : 0;
}

uint32_t random_magnitude(struct random *const r)
{
    static const uint32_t corners[] = {0, 1, 0xFFFFFFFF, 0x80000000, 0x7FFFFFFF, 0x80000001, 0xFFFFFFFE, 0x40000000};
    if (random_below(r, 8) == 0)
        return corners[random_below(r, sizeof corners / sizeof *corners)];
    return (uint32_t)random_u64(r) >> random_below(r, 32);
}
