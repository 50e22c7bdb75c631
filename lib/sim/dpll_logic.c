/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The DPLL (register map 3.15; traces of tests/data/hm2dpll).
 *
 * Closed form: while the correction stays, the accumulator adds the same number at every prescaled tick. A stretch
 * ends with the tick that updates the phase filter, unless that update changes nothing any more. Outputs are
 * bit 41 of the accumulator plus a constant, so the last edges of an output within a stretch come from a division.
 */
#include "dpll_logic.h"

#include <stddef.h>

#define ACCUM_BITS 42
#define ACCUM_ONE  (UINT64_C(1) << ACCUM_BITS)
#define ACCUM_MASK (ACCUM_ONE - 1)
#define ACCUM_HALF (ACCUM_ONE / 2)
#define PHASE_LOW  10 /* registers hold bits 41..10 */
#define TIMER_LOW  26 /* timers compare with bits 41..26 */

#define SYNC_FILTER_MAX 15
#define SEARCH_MAX      65536 /* stretches that sim_dpll_find_change() looks through */

static int32_t signed24(const uint32_t value)
{
    return (int32_t)((value & 0xFFFFFFu) ^ 0x800000u) - 0x800000;
}

/* Arithmetic shift, whatever the compiler does with >> of negative numbers. */
static int32_t shift_right(const int32_t value, const unsigned bits)
{
    return value < 0 ? -((-value - 1) >> bits) - 1 : value >> bits;
}

/* ---- outputs ------------------------------------------------------------------------------------------------------
 */

static bool top_bit(const uint64_t accum)
{
    return accum >> (ACCUM_BITS - 1) & 1u;
}

static uint64_t timer_phase(const struct sim_dpll *const d, const unsigned timer)
{
    return (d->accum + ((uint64_t)d->timer[timer] << TIMER_LOW)) & ACCUM_MASK;
}

/* The sum as the firmware makes it: of the upper 16 bits only, which is the same in bit 41. */
static bool timer_bit_now(const struct sim_dpll *const d, const unsigned timer)
{
    return top_bit(timer_phase(d, timer));
}

bool sim_dpll_output(const struct sim_dpll *const d, const unsigned output)
{
    return output == 0 ? !top_bit(d->accum) : output < SIM_DPLL_OUTPUTS && !d->timer_bit[output - 1];
}

static void note(int64_t list[2], const int64_t clk)
{
    if (clk == INT64_MIN || clk == list[0])
        return;
    list[1] = list[0];
    list[0] = clk;
}

/* ---- one edge -----------------------------------------------------------------------------------------------------
 */

void sim_dpll_power_up(struct sim_dpll *const d, const bool has_integral, const int64_t clk)
{
    *d = (struct sim_dpll){.has_integral = has_integral, .clk = clk};
    for (unsigned i = 0; i < SIM_DPLL_OUTPUTS; i++)
        d->history[i] = (struct sim_dpll_history){.rise = {INT64_MIN, INT64_MIN}, .fall = {INT64_MIN, INT64_MIN}};
}

static int32_t bounded_error(const struct sim_dpll *const d)
{
    const int32_t error = shift_right(d->phase_error, 8);
    const int32_t lowest = signed24(0u - (uint32_t)d->phase_limit);
    if (error > d->phase_limit)
        return d->phase_limit;
    return error < lowest ? lowest : error;
}

static int32_t next_filtered(const struct sim_dpll *const d)
{
    return signed24((uint32_t)(d->filtered + shift_right(d->bounded, 8) - shift_right(d->filtered, 8)));
}

/* The newer firmware has a limit for this sum, too, but in the same clock assigns the unlimited one after it. */
static int32_t next_integral(const struct sim_dpll *const d)
{
    return d->has_integral ? signed24((uint32_t)(d->integral + shift_right(d->bounded, 12))) : 0;
}

static int32_t next_correction(const struct sim_dpll *const d)
{
    return signed24((uint32_t)(d->filtered + shift_right(d->bounded, 4) + d->integral));
}

static int64_t increment(const struct sim_dpll *const d)
{
    return (int64_t)d->base_rate - d->correction;
}

/* The prescaled tick. All of it from the state before the edge. */
static void tick(struct sim_dpll *const d, const struct sim_dpll *const old)
{
    d->prescale_count = old->prescale;
    d->accum = (old->accum + (uint64_t)increment(old)) & ACCUM_MASK;
    d->bounded = bounded_error(old);
    if (old->filter_count == 1) {
        d->filter_count = old->filter_prescale;
        d->filtered = next_filtered(old);
        d->integral = next_integral(old);
    } else {
        d->filter_count--;
    }
}

static void edge_of_sync_pin(struct sim_dpll *const d, const struct sim_dpll *const old)
{
    d->sync_in_seen = old->sync_in;
    if (old->sync_in_seen && old->sync_filter < SYNC_FILTER_MAX)
        d->sync_filter++;
    if (!old->sync_in_seen && old->sync_filter > 0)
        d->sync_filter--;
    if (old->sync_filter == SYNC_FILTER_MAX || old->sync_filter == 0)
        d->filtered_sync = (uint8_t)((old->filtered_sync & 1u) << 1 | (old->sync_filter != 0 ? 1u : 0u));
}

static void apply(struct sim_dpll *const d, const enum sim_dpll_reg reg, const uint32_t value)
{
    switch (reg) {
    case SIM_DPLL_BASE_RATE:
        d->base_rate = value;
        break;
    case SIM_DPLL_PHASE:
        d->accum = (uint64_t)value << PHASE_LOW | (d->accum & ((1u << PHASE_LOW) - 1));
        break;
    case SIM_DPLL_CONTROL0:
        d->phase_limit = signed24(value);
        d->prescale = (uint8_t)(value >> 24);
        d->filtered = d->integral = d->phase_error = 0;
        break;
    case SIM_DPLL_CONTROL1:
        d->filter_prescale = (uint16_t)(value >> 16);
        break;
    case SIM_DPLL_TIMERS12:
        d->timer[0] = (uint16_t)value;
        d->timer[1] = (uint16_t)(value >> 16);
        break;
    case SIM_DPLL_TIMERS34:
        d->timer[2] = (uint16_t)value;
        d->timer[3] = (uint16_t)(value >> 16);
        break;
    case SIM_DPLL_SYNC:
    case SIM_DPLL_REGS:
        break;
    }
}

static void note_changes(struct sim_dpll *const d, const struct sim_dpll *const old)
{
    for (unsigned i = 0; i < SIM_DPLL_OUTPUTS; i++) {
        const bool level = sim_dpll_output(d, i);
        if (level != sim_dpll_output(old, i))
            note(level ? d->history[i].rise : d->history[i].fall, old->clk);
    }
}

void sim_dpll_write_edge(struct sim_dpll *const d, const enum sim_dpll_reg reg, const uint32_t value, const bool sync)
{
    const struct sim_dpll old = *d;
    edge_of_sync_pin(d, &old);
    if (old.prescale_count == 1)
        tick(d, &old);
    else
        d->prescale_count--;
    d->correction = next_correction(&old);
    if (sync || reg == SIM_DPLL_SYNC || old.filtered_sync == 1)
        d->phase_error = (int32_t)(uint32_t)(old.accum >> PHASE_LOW);
    for (unsigned i = 0; i < SIM_DPLL_TIMERS; i++)
        d->timer_bit[i] = timer_bit_now(&old, i);
    apply(d, reg, value);
    d->clk++;
    note_changes(d, &old);
}

void sim_dpll_edge(struct sim_dpll *const d, const bool sync)
{
    sim_dpll_write_edge(d, SIM_DPLL_REGS, 0, sync);
}

/* ---- stretches of equal ticks -------------------------------------------------------------------------------------
 */

/* Ticks of a stretch: the first one `first` edges from here (0 = the next edge), then one every `period`. */
struct ticks {
    int64_t first, period, per_edges; /* per_edges: ticks within the stretch */
};

static struct ticks ticks_in(const struct sim_dpll *const d, const int64_t edges)
{
    struct ticks t = {.first = (uint8_t)(d->prescale_count - 1), .period = d->prescale ? d->prescale : 256};
    t.per_edges = edges > t.first ? (edges - t.first - 1) / t.period + 1 : 0;
    return t;
}

/* Ticks up to and including the one that updates the filter. */
static int64_t ticks_to_filter(const struct sim_dpll *const d)
{
    return d->filter_count ? d->filter_count : 65536;
}

static bool sync_pin_is_settled(const struct sim_dpll *const d)
{
    return d->sync_in_seen == d->sync_in && d->sync_filter == (d->sync_in ? SYNC_FILTER_MAX : 0) &&
           d->filtered_sync == (d->sync_in ? 3 : 0);
}

static bool filter_is_settled(const struct sim_dpll *const d)
{
    return next_filtered(d) == d->filtered && next_integral(d) == d->integral;
}

/* Edges in which ticks do nothing but add the same number; 0 = the next one does more. */
static int64_t equal_edges(const struct sim_dpll *const d)
{
    if (!sync_pin_is_settled(d) || d->bounded != bounded_error(d) || d->correction != next_correction(d))
        return 0;
    if (filter_is_settled(d))
        return SIM_DPLL_HORIZON;
    const struct ticks t = ticks_in(d, 0);
    const int64_t edges = t.first + (ticks_to_filter(d) - 1) * t.period;
    return edges < SIM_DPLL_HORIZON ? edges : SIM_DPLL_HORIZON;
}

/* A walk from x in equal steps: how often and when it passes from the top of the 42 bits to 0 or, with negative
 * steps, from half way up to just below. Either is the moment when bit 41 falls. */
struct walk {
    uint64_t start, step; /* towards ACCUM_ONE */
};

static struct walk walk_of(const uint64_t x, const int64_t step, const bool bit_falls)
{
    const uint64_t from = bit_falls == (step > 0) ? x : (x + ACCUM_HALF) & ACCUM_MASK;
    if (step > 0)
        return (struct walk){.start = from, .step = (uint64_t)step};
    return (struct walk){.start = ACCUM_MASK - from, .step = (uint64_t)-step};
}

/* Number of the step (1 = first) that passes for the n-th time. */
static int64_t step_of_pass(const struct walk *const w, const uint64_t n)
{
    return (int64_t)(((n << ACCUM_BITS) - w->start + w->step - 1) / w->step);
}

/* Number of the last step that passes among the first `steps`; 0 = none. */
static int64_t last_pass(const struct walk *const w, const int64_t steps)
{
    const uint64_t passes = (w->start + w->step * (uint64_t)steps) >> ACCUM_BITS;
    return w->step > 0 && passes > 0 ? step_of_pass(w, passes) : 0;
}

/* The last two changes of one kind (bit falls = output rises) by ticks of a stretch. delay: edges from the tick to the
 * output. */
static void note_stretch(int64_t list[2], const struct walk *const w, const struct ticks *const t, const int64_t steps,
                         const int64_t first_edge)
{
    const int64_t last = last_pass(w, steps);
    const int64_t before = last > 1 ? last_pass(w, last - 1) : 0;
    if (before > 0)
        note(list, first_edge + t->first + (before - 1) * t->period);
    if (last > 0)
        note(list, first_edge + t->first + (last - 1) * t->period);
}

static void note_output(struct sim_dpll_history *const history, const uint64_t x, const int64_t step,
                        const struct ticks *const t, const int64_t steps, const int64_t first_edge)
{
    const struct walk rising = walk_of(x, step, true), falling = walk_of(x, step, false);
    note_stretch(history->rise, &rising, t, steps, first_edge);
    note_stretch(history->fall, &falling, t, steps, first_edge);
}

/* A timer's output follows one edge behind, and first has to catch up with what happened before the stretch. */
static void note_timer(struct sim_dpll *const d, const unsigned timer, const struct ticks *const t, const int64_t edges)
{
    struct sim_dpll_history *const history = &d->history[1 + timer];
    const bool bit = timer_bit_now(d, timer);
    if (bit != d->timer_bit[timer])
        note(bit ? history->fall : history->rise, d->clk);
    const struct ticks seen = ticks_in(d, edges - 1);
    note_output(history, timer_phase(d, timer), increment(d), t, seen.per_edges, d->clk + 1);
}

static void add_ticks(struct sim_dpll *const d, const int64_t count)
{
    d->accum = (d->accum + (uint64_t)increment(d) * (uint64_t)count) & ACCUM_MASK;
}

static void count_ticks(struct sim_dpll *const d, const struct ticks *const t, const int64_t edges)
{
    if (t->per_edges == 0) {
        d->prescale_count = (uint8_t)(d->prescale_count - edges);
        return;
    }
    const int64_t since = edges - t->first - 1 - (t->per_edges - 1) * t->period;
    d->prescale_count = (uint8_t)(d->prescale - since);
    const int64_t to_filter = ticks_to_filter(d);
    if (t->per_edges < to_filter) {
        d->filter_count = (uint16_t)(to_filter - t->per_edges);
        return;
    }
    const int64_t period = d->filter_prescale ? d->filter_prescale : 65536;
    d->filter_count = (uint16_t)(period - (t->per_edges - to_filter) % period);
}

/* Make `edges` >= 1 equal edges. */
static void leap(struct sim_dpll *const d, const int64_t edges)
{
    const struct ticks t = ticks_in(d, edges);
    const struct ticks before_last = ticks_in(d, edges - 1);
    note_output(&d->history[0], d->accum, increment(d), &t, t.per_edges, d->clk);
    for (unsigned i = 0; i < SIM_DPLL_TIMERS; i++)
        note_timer(d, i, &t, edges);
    add_ticks(d, before_last.per_edges);
    for (unsigned i = 0; i < SIM_DPLL_TIMERS; i++)
        d->timer_bit[i] = timer_bit_now(d, i);
    add_ticks(d, t.per_edges - before_last.per_edges);
    count_ticks(d, &t, edges);
    d->clk += edges;
}

void sim_dpll_run(struct sim_dpll *const d, const int64_t edges)
{
    const int64_t end = d->clk + edges;
    while (d->clk < end) {
        const int64_t left = end - d->clk;
        const int64_t equal = equal_edges(d);
        if (equal > 0)
            leap(d, equal < left ? equal : left);
        else
            sim_dpll_edge(d, false);
    }
}

/* ---- looking ahead ------------------------------------------------------------------------------------------------
 */

/* First change of the kind within the next `edges` equal ones, INT64_MAX = none. */
static int64_t change_in_stretch(const struct sim_dpll *const d, const unsigned output, const bool rise,
                                 const int64_t edges)
{
    const unsigned timer = output - 1;
    const bool level = sim_dpll_output(d, output);
    if (output > 0 && level != rise && timer_bit_now(d, timer) != d->timer_bit[timer])
        return d->clk;
    const uint64_t x = output == 0 ? d->accum : timer_phase(d, timer);
    const struct walk w = walk_of(x, increment(d), rise);
    if (w.step == 0)
        return INT64_MAX;
    const struct ticks t = ticks_in(d, edges);
    const int64_t step = step_of_pass(&w, 1);
    return step <= t.per_edges ? d->clk + t.first + (step - 1) * t.period + (output > 0) : INT64_MAX;
}

int64_t sim_dpll_find_change(const struct sim_dpll *const d, const unsigned output, const bool rise,
                             const int64_t edges)
{
    struct sim_dpll copy = *d;
    const int64_t end = d->clk + edges;
    for (int stretch = 0; stretch < SEARCH_MAX && copy.clk < end; stretch++) {
        const int64_t equal = equal_edges(&copy);
        if (equal > 0) {
            const int64_t change = change_in_stretch(&copy, output, rise, equal);
            if (change != INT64_MAX)
                return change < end ? change : INT64_MAX;
            leap(&copy, equal);
        } else {
            const bool before = sim_dpll_output(&copy, output);
            sim_dpll_edge(&copy, false);
            if (before != rise && sim_dpll_output(&copy, output) == rise)
                return copy.clk - 1;
        }
    }
    return INT64_MAX;
}
