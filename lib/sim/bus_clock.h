/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Models that are told edge by edge what their logic does, and how many of the next edges do nothing but count: those
 * are taken in one step. Every function of such a model works on one instance.
 */
#ifndef SIM_BUS_CLOCK_H
#define SIM_BUS_CLOCK_H

#include <stdint.h>

#include "sim_card.h"

struct sim_stepper {
    int64_t (*quiet)(const void *instance);      /* edges from now on that only count; SIM_NEVER: until it is asked */
    void (*skip)(void *instance, int64_t edges); /* at most quiet() of them */
    void (*edge)(void *instance);                /* one edge of ClockLow */
};

/* Edges [from, to) of one instance. */
static inline void sim_step_to(const struct sim_stepper *const stepper, void *const instance, int64_t from,
                               const int64_t to)
{
    while (from < to) {
        const int64_t quiet = stepper->quiet(instance);
        if (quiet == 0) {
            stepper->edge(instance);
            from++;
        } else {
            const int64_t edges = quiet < to - from ? quiet : to - from;
            stepper->skip(instance, edges);
            from += edges;
        }
    }
}

#endif
