/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The step generator (register map 3.4; README and traces of tests/data/stepgen).
 *
 * How the closed form works. Between two "events" (a step, the end of a pulse, a change of the direction output) the
 * accumulator adds the rate at every tick until the next addition would make a step, and the timers count down: that
 * is quiet_edges() and leap(). In steady motion whole steps are skipped too: skip_steps() starts at an edge where
 * a step is about to be added and ends at a later such edge, where the state is known because both timers have run
 * out and only the accumulator and the table pointer remember how many steps lie between.
 */
#include "stepgen_logic.h"

#include <stddef.h>

#define ACCUM_MASK ((UINT64_C(1) << 48) - 1)
#define ONE_STEP   (UINT64_C(1) << 32)
#define TIMER_MASK 0x3FFFu /* the four timer registers have 14 bits */

/* ---- master DDS ---------------------------------------------------------------------------------------------------
 */

#define RATE_MASK ((UINT64_C(1) << 33) - 1)

static bool rate_msb(const uint64_t accum)
{
    return accum >> 32 & 1u;
}

void sim_rategen_load(struct sim_rategen *const g, const uint32_t rate)
{
    sim_rategen_run(g, 1);
    g->rate = rate;
    g->accum = 0;
}

void sim_rategen_run(struct sim_rategen *const g, const int64_t edges)
{
    if (edges <= 0)
        return;
    const uint64_t last = g->accum + (uint64_t)(edges - 1) * g->rate;
    const bool before = edges == 1 ? g->old_msb : rate_msb(last - g->rate);
    g->tick = before != rate_msb(last);
    g->old_msb = rate_msb(last);
    g->accum = (last + g->rate) & RATE_MASK;
}

int64_t sim_rategen_ticks(const struct sim_rategen *const g, const int64_t edges)
{
    int64_t ticks = 0;
    if (edges >= 1)
        ticks += g->tick;
    if (edges >= 2)
        ticks += g->old_msb != rate_msb(g->accum);
    if (edges >= 3) /* every carry out of the low 32 bits toggles the top bit */
        ticks += (int64_t)(((g->accum & UINT32_MAX) + (uint64_t)(edges - 2) * g->rate) >> 32);
    return ticks;
}

int64_t sim_rategen_edges_for(const struct sim_rategen *const g, int64_t tick)
{
    if (tick > SIM_STEPGEN_HORIZON)
        return INT64_MAX;
    if (g->tick && --tick == 0)
        return 1;
    if (g->old_msb != rate_msb(g->accum) && --tick == 0)
        return 2;
    if (g->rate == 0)
        return INT64_MAX;
    const uint64_t missing = ((uint64_t)tick << 32) - (g->accum & UINT32_MAX);
    return (int64_t)((missing + g->rate - 1) / g->rate) + 2;
}

/* True when the ticks from here on are those of an undisturbed DDS (a write to it may leave one or two out of step). */
static bool rategen_is_regular(const struct sim_rategen *const g)
{
    const uint64_t one = g->accum - g->rate;
    const uint64_t two = one - g->rate;
    return g->old_msb == rate_msb(one) && g->tick == (rate_msb(two) != rate_msb(one));
}

/* ---- one edge -----------------------------------------------------------------------------------------------------
 */

static bool msb(const struct sim_stepgen *const g)
{
    return g->accum >> 31 & 1u;
}

static bool wants_dir(const struct sim_stepgen *const g)
{
    return g->rate < 0; /* a rate of 0 counts as positive (trace zero_rate_dir) */
}

static uint64_t rate_size(const struct sim_stepgen *const g)
{
    return g->rate < 0 ? (uint64_t)(-(int64_t)g->rate) : (uint64_t)g->rate;
}

/* Distance run since the last step boundary, in the direction of motion: a step is added when it reaches 2^32. */
static uint64_t phase(const struct sim_stepgen *const g)
{
    const uint64_t low = g->accum & UINT32_MAX;
    return g->rate < 0 ? UINT32_MAX - low : low;
}

static bool dir_pending(const struct sim_stepgen *const g)
{
    return g->dir != wants_dir(g);
}

/* The step logic sees the boundary one edge after the addition that crossed it, or after a write to the accumulator
 * that looks the same (trace load_accum_glitch). */
static bool stepped(const struct sim_stepgen *const g)
{
    return msb(g) != g->old_msb && msb(g) == g->added_dir;
}

static bool step_may_be_added(const struct sim_stepgen *const g)
{
    const bool setting_up = !g->holding && g->dir_count > 0;
    return !dir_pending(g) && !setting_up && g->pulse_count == 0 && !g->old_pulse_wait;
}

static void add(struct sim_stepgen *const g, const uint64_t times)
{
    const uint64_t distance = (uint64_t)(int64_t)g->rate * times;
    g->accum = (g->accum + distance) & ACCUM_MASK;
    g->travel = (int64_t)((uint64_t)g->travel + distance);
    g->added_dir = wants_dir(g);
}

static void move_table_pointer(struct sim_stepgen *const g, const uint64_t steps)
{
    const unsigned length = g->table_max + 1u; /* the pointer is never beyond: writing the length clears it */
    const unsigned moved = (unsigned)(steps % length);
    g->table_ptr = (uint8_t)((g->table_ptr + (g->added_dir ? length - moved : moved)) % length);
}

static void load_accum(struct sim_stepgen *const g, const uint32_t value)
{
    /* Bits 47..16; the low 16 bits are those from before the edge (README of the traces). */
    g->accum = (uint64_t)value << 16 | (g->accum & 0xFFFFu);
    g->travel = (int64_t)(((uint64_t)g->travel & ~(uint64_t)UINT32_MAX) | (g->accum & UINT32_MAX));
}

static void push_table(struct sim_stepgen *const g, const uint32_t value)
{
    for (unsigned i = 15; i > 0; i--)
        g->table[i] = g->table[i - 1];
    g->table[0] = (uint8_t)value;
}

static void apply(struct sim_stepgen *const g, const struct sim_stepgen_write *const write)
{
    const uint32_t value = write->value;
    const uint16_t timer = (uint16_t)(value & TIMER_MASK);
    switch (write->reg) {
    case SIM_STEPGEN_RATE:
        g->rate = (int32_t)value;
        break;
    case SIM_STEPGEN_ACCUM:
        load_accum(g, value);
        break;
    case SIM_STEPGEN_MODE:
        g->mode = (uint8_t)value;
        break;
    case SIM_STEPGEN_DIR_SETUP:
        g->dir_setup = timer;
        break;
    case SIM_STEPGEN_DIR_HOLD:
        g->dir_hold = timer;
        break;
    case SIM_STEPGEN_PULSE_ACTIVE:
        g->pulse_active = timer;
        break;
    case SIM_STEPGEN_PULSE_IDLE:
        g->pulse_idle = timer;
        break;
    case SIM_STEPGEN_TABLE:
        push_table(g, value);
        break;
    case SIM_STEPGEN_TABLE_MAX:
        g->table_max = value & 15u;
        g->table_ptr = 0;
        break;
    case SIM_STEPGEN_REGS:
        break;
    }
}

/* Timers and outputs for one edge, all from the state before it. */
static void edge_of_outputs(struct sim_stepgen *const g)
{
    const struct sim_stepgen old = *g;
    const bool pulse_wait = old.pulse_count > 0;
    if (pulse_wait)
        g->pulse_count--;
    if (!pulse_wait && old.old_pulse_wait && old.pulse) {
        g->pulse_count = old.pulse_idle;
        g->pulse = false;
    }
    if (old.dir_count > 0)
        g->dir_count--;
    if (stepped(&old)) {
        g->pulse_count = old.pulse_active;
        g->pulse = true;
        g->dir_count = old.dir_hold;
        g->holding = true;
        move_table_pointer(g, 1);
    } else if (dir_pending(&old) && !(old.holding && old.dir_count > 0)) {
        g->dir_count = old.dir_setup;
        g->holding = false;
        g->dir = wants_dir(&old);
    }
    g->old_pulse_wait = pulse_wait;
    g->old_msb = msb(&old);
}

void sim_stepgen_edge(struct sim_stepgen *const g, const bool tick, const struct sim_stepgen_write *const write)
{
    g->quiet = 0;
    const bool would_step = phase(g) + rate_size(g) >= ONE_STEP;
    const bool adds = tick && (!would_step || step_may_be_added(g));
    edge_of_outputs(g);
    if (adds)
        add(g, 1);
    if (write)
        apply(g, write);
}

/* ---- outputs ------------------------------------------------------------------------------------------------------
 */

#define MODE_STEP_DIR   0u
#define MODE_UP_DOWN    1u
#define MODE_QUADRATURE 2u

unsigned sim_stepgen_outputs(const struct sim_stepgen *const g)
{
    const unsigned table = g->table[g->table_ptr];
    const unsigned quarter = (unsigned)(g->accum >> 30 & 3u);
    const unsigned pulse = g->pulse, dir = g->dir;
    unsigned low;
    switch (g->mode & 3u) {
    case MODE_STEP_DIR:
        low = pulse | dir << 1;
        break;
    case MODE_UP_DOWN:
        low = dir ? pulse << 1 : pulse;
        break;
    case MODE_QUADRATURE:
        low = quarter ^ quarter >> 1; /* Gray code */
        break;
    default:
        return table;
    }
    return (table & ~3u) | low; /* the other outputs show the table in every mode */
}

/* ---- quiet stretches ----------------------------------------------------------------------------------------------
 */

/* Additions that fit before the one that makes a step. */
static int64_t adds_before_step(const struct sim_stepgen *const g)
{
    const uint64_t size = rate_size(g);
    return size == 0 ? INT64_MAX : (int64_t)((UINT32_MAX - phase(g)) / size);
}

/* Edges for which a step would be held back if nothing else happens meanwhile. */
static int64_t held_edges(const struct sim_stepgen *const g)
{
    int64_t held = g->pulse_count > 0 ? g->pulse_count + 1 : g->old_pulse_wait;
    if ((!g->holding || dir_pending(g)) && g->dir_count > held)
        held = g->dir_count;
    return held;
}

/* Edges before the one that adds a step, with `adds` additions still to come before it. */
static int64_t edges_before_step(const struct sim_stepgen *const g, const struct sim_rategen *const rategen,
                                 const int64_t adds)
{
    if (adds >= SIM_STEPGEN_HORIZON)
        return SIM_STEPGEN_HORIZON;
    int64_t edges = sim_rategen_edges_for(rategen, adds + 1);
    const int64_t held = held_edges(g);
    if (edges <= held)
        edges = sim_rategen_edges_for(rategen, sim_rategen_ticks(rategen, held) + 1);
    return edges > SIM_STEPGEN_HORIZON ? SIM_STEPGEN_HORIZON : edges - 1;
}

static int64_t smaller(const int64_t a, const int64_t b)
{
    return a < b ? a : b;
}

/* Edges that only add and count down; 0 when the next one is an event. */
static int64_t quiet_edges(const struct sim_stepgen *const g, const struct sim_rategen *const rategen,
                           const int64_t adds)
{
    if (stepped(g))
        return 0;
    int64_t quiet = edges_before_step(g, rategen, adds);
    if (dir_pending(g))
        quiet = smaller(quiet, g->holding ? g->dir_count : 0);
    if (g->pulse && (g->pulse_count > 0 || g->old_pulse_wait))
        quiet = smaller(quiet, g->pulse_count);
    return quiet;
}

static void count_down(uint16_t *const count, const int64_t edges)
{
    *count = (uint16_t)(*count > edges ? *count - edges : 0);
}

/* Make `edges` >= 1 quiet edges of the stretch. */
static void leap(struct sim_stepgen *const g, const struct sim_rategen *const rategen, const int64_t edges)
{
    const int64_t before_last = smaller(sim_rategen_ticks(rategen, edges - 1), g->adds);
    const int64_t all = smaller(sim_rategen_ticks(rategen, edges), g->adds);
    g->quiet -= edges;
    g->adds -= all;
    if (before_last > 0)
        add(g, (uint64_t)before_last);
    g->old_msb = msb(g);
    if (all > before_last)
        add(g, (uint64_t)(all - before_last));
    g->old_pulse_wait = g->pulse_count >= edges;
    count_down(&g->pulse_count, edges);
    count_down(&g->dir_count, edges);
}

/* ---- whole steps --------------------------------------------------------------------------------------------------
 */

/* Fewest edges between the additions of two steps that the pulse timers allow (README of the traces, overspeed). */
static int64_t shortest_period(const struct sim_stepgen *const g)
{
    if (g->pulse_active == 0)
        return 1; /* the pulse timer never runs */
    return g->pulse_active + 3 + (g->pulse_idle > 0 ? g->pulse_idle + 1 : 0);
}

/* Distance in edges of ticks that come evenly, and for how many edges they do. 0 = they do not. */
static int64_t even_ticks(const struct sim_rategen *const rategen, int64_t *const edges)
{
    const uint64_t short_of_one = ONE_STEP - rategen->rate;
    *edges = SIM_STEPGEN_HORIZON;
    if (rategen->rate == 0)
        return 0;
    if (ONE_STEP % rategen->rate == 0)
        return (int64_t)(ONE_STEP / rategen->rate);
    if (rategen->old_msb == rate_msb(rategen->accum))
        return 0;
    *edges = smaller(*edges, (int64_t)((rategen->accum & UINT32_MAX) / short_of_one) + 2);
    return 1;
}

struct skipped {
    int64_t edges, steps;
    uint64_t adds;
};

/* Steps that the timers never hold back. */
static struct skipped skip_free(const struct sim_stepgen *const g, const struct sim_rategen *const rategen,
                                const int64_t edges)
{
    const uint64_t size = rate_size(g);
    const uint64_t ticks = (uint64_t)sim_rategen_ticks(rategen, edges);
    const uint64_t steps = (phase(g) + size * ticks) >> 32;
    if (steps < 2)
        return (struct skipped){0};
    const uint64_t tick = ((steps << 32) - phase(g) + size - 1) / size; /* the one that adds the last of them */
    return (struct skipped){
        .edges = sim_rategen_edges_for(rategen, (int64_t)tick) - 1, .steps = (int64_t)steps - 1, .adds = tick - 1};
}

/* Steps that the timers always hold back: they come in equal distances. */
static struct skipped skip_held(const struct sim_stepgen *const g, const struct sim_rategen *const rategen,
                                const int64_t edges)
{
    const uint64_t size = rate_size(g);
    int64_t even;
    const int64_t distance = even_ticks(rategen, &even);
    if (distance == 0)
        return (struct skipped){0};
    const int64_t ticks = (shortest_period(g) + distance - 1) / distance;
    if ((uint64_t)ticks * size < ONE_STEP)
        return (struct skipped){0};
    const int64_t period = ticks * distance;
    const int64_t steps = (smaller(edges, even) - 1) / period;
    if (steps < 1)
        return (struct skipped){0};
    const uint64_t room = (((uint64_t)steps + 1) << 32) - 1 - phase(g);
    return (struct skipped){.edges = steps * period, .steps = steps, .adds = room / size};
}

/* The next edge adds a step: go on to the last such edge among the next `edges`. Returns the edges skipped. */
static int64_t skip_steps(struct sim_stepgen *const g, const struct sim_rategen *const rategen, const int64_t edges)
{
    if (!rategen_is_regular(rategen) || !rategen->tick || !step_may_be_added(g) || stepped(g))
        return 0;
    const uint64_t ticks_per_step = ONE_STEP / rate_size(g);
    if (ticks_per_step > (uint64_t)SIM_STEPGEN_HORIZON)
        return 0;
    const uint64_t edges_per_step = (ticks_per_step << 32) / (rategen->rate > 0 ? rategen->rate : 1);
    const struct skipped skipped =
        (int64_t)edges_per_step >= shortest_period(g) ? skip_free(g, rategen, edges) : skip_held(g, rategen, edges);
    if (skipped.steps == 0)
        return 0;
    add(g, skipped.adds);
    move_table_pointer(g, (uint64_t)skipped.steps);
    g->old_msb = msb(g);
    g->pulse = g->pulse_active == 0;
    g->holding = true;
    g->dir_count = 0; /* loaded anew by the step at hand before anything can depend on it */
    return skipped.edges;
}

static int64_t run_some(struct sim_stepgen *const g, const struct sim_rategen *const rategen, const int64_t edges)
{
    if (g->quiet == 0) {
        g->adds = adds_before_step(g);
        g->quiet = quiet_edges(g, rategen, g->adds);
    }
    if (g->quiet > 0) {
        const int64_t done = smaller(g->quiet, edges);
        leap(g, rategen, done);
        return done;
    }
    if (g->adds == 0) {
        const int64_t done = skip_steps(g, rategen, edges);
        if (done > 0)
            return done;
    }
    sim_stepgen_edge(g, rategen->tick, NULL);
    return 1;
}

void sim_stepgen_run(struct sim_stepgen *const g, const struct sim_rategen *const rategen, int64_t edges)
{
    struct sim_rategen now = *rategen;
    while (edges > 0) {
        const int64_t done = run_some(g, &now, smaller(edges, SIM_STEPGEN_HORIZON));
        sim_rategen_run(&now, done);
        edges -= done;
    }
}

/* Edges before the one that changes bits 31..30 without making a step. */
static int64_t edges_before_quarter(const struct sim_stepgen *const g, const struct sim_rategen *const rategen)
{
    const uint64_t quarter = ONE_STEP / 4;
    const uint64_t size = rate_size(g);
    if (size == 0)
        return SIM_STEPGEN_HORIZON;
    const uint64_t adds = (quarter - phase(g) % quarter + size - 1) / size;
    return smaller(sim_rategen_edges_for(rategen, (int64_t)adds), SIM_STEPGEN_HORIZON) - 1;
}

int64_t sim_stepgen_silent(const struct sim_stepgen *const g, const struct sim_rategen *const rategen)
{
    const int64_t quiet = quiet_edges(g, rategen, adds_before_step(g));
    if ((g->mode & 3u) != MODE_QUADRATURE)
        return quiet;
    return smaller(quiet, edges_before_quarter(g, rategen));
}
