/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "absolute.h"

#include <string.h>

#define BISS_ACKNOWLEDGE 2u /* rising edge at which the line goes low */
#define FANUC_BITS       76u

void sim_abs_power_up(struct sim_abs_encoder *const e, const bool idle_level)
{
    e->level = idle_level;
    e->busy = false;
    e->edges = e->first = e->count = 0;
}

void sim_abs_attach(struct sim_abs_encoder *const e, const struct sim_absolute *const spec, const bool idle_level,
                    const int64_t idle_ps, const int64_t bit_ps)
{
    const bool was = e->spec.bits > 0;
    e->spec = *spec;
    if (e->spec.idle_ps == 0)
        e->spec.idle_ps = idle_ps;
    if (e->spec.bit_ps == 0)
        e->spec.bit_ps = bit_ps;
    if (!was)
        sim_abs_power_up(e, idle_level);
}

/* A transfer begins. */
static void begin(struct sim_abs_encoder *const e)
{
    e->busy = true;
    e->edges = 0;
    memcpy(e->value, e->spec.value, sizeof e->value);
}

static bool value_bit(const struct sim_abs_encoder *const e, const unsigned bit)
{
    return bit < e->spec.bits && (e->value[bit / 32] >> bit % 32 & 1u);
}

static void change(struct sim_abs_encoder *const e, const int64_t at_ps, const bool level)
{
    if (e->count == SIM_ABS_CHANGES)
        return;
    const unsigned at = (e->first + e->count++) % SIM_ABS_CHANGES;
    e->changes[at].at_ps = at_ps;
    e->changes[at].level = level;
}

/* Most significant bit first; behind the last bit the line is low. */
static bool nth_bit(const struct sim_abs_encoder *const e, const unsigned n)
{
    return n < e->spec.bits && value_bit(e, e->spec.bits - 1u - n);
}

void sim_abs_ssi_clock(struct sim_abs_encoder *const e, const bool rising, const int64_t now_ps)
{
    if (e->spec.bits == 0)
        return;
    if (!e->busy) {
        if (rising)
            return;
        begin(e);
    }
    e->idle_at_ps = now_ps + e->spec.idle_ps;
    if (rising)
        change(e, now_ps + e->spec.delay_ps, nth_bit(e, e->edges++));
}

void sim_abs_biss_clock(struct sim_abs_encoder *const e, const bool rising, const int64_t now_ps)
{
    if (e->spec.bits == 0)
        return;
    if (!e->busy)
        begin(e);
    e->idle_at_ps = now_ps + e->spec.idle_ps + e->spec.delay_ps;
    if (!rising)
        return;
    const unsigned start = BISS_ACKNOWLEDGE + e->spec.processing + 1u;
    const unsigned edge = ++e->edges;
    if (edge == BISS_ACKNOWLEDGE)
        change(e, now_ps + e->spec.delay_ps, false);
    else if (edge == start)
        change(e, now_ps + e->spec.delay_ps, true);
    else if (edge > start) /* a low bit, then the data */
        change(e, now_ps + e->spec.delay_ps, edge > start + 1u && nth_bit(e, edge - start - 2u));
}

/* The answer is longer than the list of changes holds: its bits are computed when they are looked at. */
void sim_abs_fanuc_request(struct sim_abs_encoder *const e, const int64_t now_ps)
{
    if (e->spec.bits == 0 || e->busy)
        return;
    begin(e);
    e->idle_at_ps = now_ps + e->spec.delay_ps; /* here: when the start bit begins */
}

static bool fanuc_line(struct sim_abs_encoder *const e, const int64_t now_ps)
{
    const int64_t since_ps = now_ps - e->idle_at_ps;
    if (!e->busy || since_ps <= 0)
        return false;
    const int64_t n = (since_ps - 1) / e->spec.bit_ps; /* 0 = start bit */
    if (n <= (int64_t)FANUC_BITS)
        return n == 0 || !value_bit(e, (unsigned)n - 1u); /* least significant first, inverted */
    e->busy = false;
    return false;
}

bool sim_abs_line(struct sim_abs_encoder *const e, const int64_t now_ps)
{
    if (e->spec.bit_ps > 0)
        return fanuc_line(e, now_ps);
    while (e->count > 0 && e->changes[e->first].at_ps < now_ps) {
        e->level = e->changes[e->first].level;
        e->first = (e->first + 1u) % SIM_ABS_CHANGES;
        e->count--;
    }
    if (e->busy && e->count == 0 && e->idle_at_ps < now_ps) {
        e->busy = false;
        e->level = true;
    }
    return e->level;
}

bool sim_abs_moving(const struct sim_abs_encoder *const e)
{
    return e->spec.bits > 0 && e->busy;
}
