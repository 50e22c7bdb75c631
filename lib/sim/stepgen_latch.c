/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "stepgen_latch.h"

#include <stddef.h>

static const struct sim_latch_kind kinds[] = {
    {.version = 0x03,
     .filter_max = 15,
     .latch_bit = {0x04, 0x10},
     .polarity_bit = {0x08, 0x20},
     .just_once_bit = 0x40,
     .pin = {0x01, 0x02},
     .position_bits = 16},
    {.version = 0xC2,
     .filter_max = 255,
     .latch_bit = {0x10, 0x40},
     .polarity_bit = {0x20, 0x80},
     .pin = {0x09, 0x0A},
     .position_bits = 24},
};

const struct sim_latch_kind *sim_latch_kind(const uint8_t version)
{
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (kinds[i].version == version)
            return &kinds[i];
    return NULL;
}

static bool at_limit(const struct sim_latch_filter *const f, const struct sim_latch_kind *const kind)
{
    return f->count == 0 || f->count == kind->filter_max;
}

void sim_latch_edge(struct sim_latch_filter *const f, const struct sim_latch_kind *const kind)
{
    f->seen = f->settled;
    if (at_limit(f, kind))
        f->settled = f->count != 0;
    if (f->level && f->count < kind->filter_max)
        f->count++;
    else if (!f->level && f->count > 0)
        f->count--;
}

int64_t sim_latch_quiet(const struct sim_latch_filter *const f, const struct sim_latch_kind *const kind)
{
    if (f->seen != f->settled || (at_limit(f, kind) && f->settled != (f->count != 0)))
        return 0;
    if (f->level == f->settled)
        return INT64_MAX;
    return f->level ? kind->filter_max - f->count : f->count;
}

void sim_latch_run_quiet(struct sim_latch_filter *const f, const struct sim_latch_kind *const kind, const int64_t edges)
{
    const int64_t room = f->level ? kind->filter_max - f->count : f->count;
    const uint8_t moved = (uint8_t)(edges < room ? edges : room);
    f->count = (uint8_t)(f->level ? f->count + moved : f->count - moved);
}

bool sim_latch_fires(const struct sim_latch_filter *const f, const struct sim_latch_kind *const kind,
                     const unsigned input, const uint8_t mode)
{
    const bool rising = mode & kind->polarity_bit[input];
    return f->settled != f->seen && f->settled == rising && (mode & kind->latch_bit[input]);
}
