/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "trigger.h"

#define TIMER_MAX 4u

static unsigned timer_of(const struct sim_trigger *const trigger)
{
    return trigger->select <= TIMER_MAX ? trigger->select : 0;
}

/* What has happened is in the DPLL's memory; what is still to come follows from its state. */
unsigned sim_trigger_starts(struct sim_card *const card, const struct sim_trigger *const trigger, const int64_t from,
                            const int64_t to, int64_t starts[SIM_TRIGGER_STARTS])
{
    unsigned count = 0;
    if (!trigger->enabled || from >= to)
        return 0;
    const unsigned timer = timer_of(trigger);
    const int64_t now = sim_now(card), past = to - 1 < now ? to - 1 : now;
    const int64_t last = sim_dpll_last_rise(card, timer, past);
    const int64_t before = last == INT64_MIN ? last : sim_dpll_last_rise(card, timer, last);
    if (before != INT64_MIN && before + 1 >= from)
        starts[count++] = before + 1;
    if (last != INT64_MIN && last + 1 >= from)
        starts[count++] = last + 1;
    for (int64_t clk = now > from - 1 ? now : from - 1; count < SIM_TRIGGER_STARTS && clk < to - 1;) {
        const int64_t rise = sim_dpll_next_rise(card, timer, clk);
        if (rise >= to - 1)
            break;
        starts[count++] = rise + 1;
        clk = rise + 1;
    }
    return count;
}

int64_t sim_trigger_next(struct sim_card *const card, const struct sim_trigger *const trigger, const int64_t clk)
{
    if (!trigger->enabled)
        return SIM_NEVER;
    if (sim_dpll_last_rise(card, timer_of(trigger), clk) == clk - 1)
        return clk; /* of an edge that the DPLL has made already */
    const int64_t rise = sim_dpll_next_rise(card, timer_of(trigger), clk);
    return rise == SIM_NEVER ? SIM_NEVER : rise + 1;
}
