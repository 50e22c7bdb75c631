/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "ppmc_axis.h"

#include <string.h>

#define NS_PER_S        INT64_C(1000000000)
#define NS_PER_US       1000
#define MAX_EDGES_PER_S 100000000
/* Longest stretch that is computed at once: its products stay below 2^63. */
#define STRETCH_NS NS_PER_S

void ppmc_axis_init(struct ppmc_axis *const axis)
{
    memset(axis, 0, sizeof *axis);
    axis->den = NS_PER_S;
    axis->direction = 1;
}

void ppmc_axis_reset(struct ppmc_axis *const axis)
{
    axis->counter = axis->holding = 0;
    axis->timestamp = 0;
    axis->sense = false;
    axis->accepted = axis->input;
}

/* ---- counting ---------------------------------------------------------------------------------------------------- */

static int64_t modulo(const int64_t value, const int64_t modulus)
{
    const int64_t rest = value % modulus;
    return rest < 0 ? rest + modulus : rest;
}

/* Counts until the next one with which Z rises; INT64_MAX without an index. */
static int64_t to_index(const struct ppmc_axis *const axis, const int direction)
{
    const int64_t counts = axis->index_counts;
    if (counts == 0)
        return INT64_MAX;
    const int64_t place = modulo(axis->truth.counted - axis->index_offset, counts);
    if (direction > 0)
        return counts - place;
    const int64_t back = modulo(place - (axis->index_width - 1), counts);
    return back == 0 ? counts : back;
}

static void index_rises(struct ppmc_axis *const axis, const struct ppmc_axis_setting *const setting)
{
    axis->sense = true;
    axis->truth.indices++;
    if (setting->preset) {
        axis->counter = setting->assembly;
        axis->truth.presets++;
        axis->truth.preset_at = axis->truth.counted;
    }
    if (setting->index_select)
        axis->holding = axis->counter;
}

/* So many counts in one direction, the last of them at last_ns. The filter clock that lets a count pass also loads a
 * preset, so the count with which Z rises is the one that reads as the preset value. */
static void count(struct ppmc_axis *const axis, const struct ppmc_axis_setting *const setting, const int direction,
                  int64_t counts, const int64_t last_ns)
{
    if (counts <= 0)
        return;
    axis->accepted = (unsigned)modulo((int64_t)axis->accepted + direction * counts, 4);
    axis->timestamp = (uint16_t)((last_ns - setting->timebase_ns) / NS_PER_US);
    while (counts > 0) {
        const int64_t index = to_index(axis, direction);
        const int64_t run = index < counts ? index : counts;
        axis->truth.counted += direction * run;
        axis->counter = (uint32_t)((int64_t)axis->counter + direction * run) & PPMC_COUNTER_MASK;
        if (run == index)
            index_rises(axis, setting);
        counts -= run;
    }
}

/* A state has lasted long enough to pass the filter. */
static void accept(struct ppmc_axis *const axis, const struct ppmc_axis_setting *const setting, const int64_t at_ns)
{
    const unsigned step = (axis->input - axis->accepted) & 3u;
    if (step == 1u)
        count(axis, setting, 1, 1, at_ns);
    else if (step == 3u)
        count(axis, setting, -1, 1, at_ns);
    else if (step == 2u)
        axis->truth.illegal++;
    axis->accepted = axis->input;
}

/* ---- inputs ------------------------------------------------------------------------------------------------------ */

/* Places 0, 1, 2, 3 are A and B = 00, 10, 11, 01. */
static unsigned place_of(const unsigned a, const unsigned b)
{
    return b ? 3u - a : a;
}

static unsigned seen(const struct ppmc_axis *const axis, const int64_t shaft)
{
    const unsigned place = (unsigned)modulo(shaft, 4);
    return axis->broken ? place_of(place == 1u || place == 2u, axis->stuck_b) : place;
}

static void settle(struct ppmc_axis *const axis, const struct ppmc_axis_setting *const setting, const int64_t until_ns)
{
    if (axis->input != axis->accepted && until_ns - axis->changed_ns >= setting->filter_ns)
        accept(axis, setting, axis->changed_ns + setting->filter_ns);
}

static void one_edge(struct ppmc_axis *const axis, const struct ppmc_axis_setting *const setting, const int direction,
                     const int64_t at_ns)
{
    settle(axis, setting, at_ns);
    axis->shaft += direction;
    const unsigned input = seen(axis, axis->shaft);
    if (input == axis->input)
        return;
    axis->input = input;
    axis->changed_ns = at_ns;
}

/* When an edge comes, in whole nanoseconds, and by how many parts of 1/num that is late. */
struct moment {
    int64_t ns, late;
};

/* The n-th edge from now, n from 1. */
static struct moment moment_of(const struct ppmc_axis *const axis, const int64_t n)
{
    const int64_t parts = n * axis->den - axis->phase, ns = (parts + axis->num - 1) / axis->num;
    return (struct moment){axis->now_ns + ns, ns * axis->num - parts};
}

/* The edge behind one, and the one before it, without a division. */
static struct moment later(const struct ppmc_axis *const axis, const struct moment edge)
{
    const struct moment next = {edge.ns + axis->gap_ns, edge.late - axis->gap_rest};
    return next.late < 0 ? (struct moment){next.ns + 1, next.late + axis->num} : next;
}

static struct moment earlier(const struct ppmc_axis *const axis, const struct moment edge)
{
    const struct moment last = {edge.ns - axis->gap_ns, edge.late + axis->gap_rest};
    return last.late >= axis->num ? (struct moment){last.ns - 1, last.late - axis->num} : last;
}

/* So many evenly spaced edges, at least one. When their distance is the filter's time or more, each but the last is a
 * count, and the last waits to be one; when it is less, none of them but the last can ever be. */
static void edges(struct ppmc_axis *const axis, const struct ppmc_axis_setting *const setting, const int64_t n)
{
    const bool slow = axis->num * setting->filter_ns <= axis->den;
    struct moment edge = moment_of(axis, 1);
    int64_t done = 0;
    for (; done < n && (axis->broken || done < 2); done++) {
        one_edge(axis, setting, axis->direction, edge.ns);
        edge = later(axis, edge);
    }
    if (done == n)
        return;
    /* Two edges ago the filter saw an ordinary state; from here on all is alike. */
    const struct moment last = moment_of(axis, n);
    if (slow) {
        settle(axis, setting, edge.ns);
        count(axis, setting, axis->direction, n - done - 1, earlier(axis, last).ns + setting->filter_ns);
    }
    axis->shaft += axis->direction * (n - done);
    axis->input = seen(axis, axis->shaft);
    axis->changed_ns = last.ns;
}

/* Edges come `num` times in `den` nanoseconds. */
static void set_pace(struct ppmc_axis *const axis, const int64_t num, const int64_t den)
{
    axis->num = num;
    axis->den = den;
    axis->gap_ns = num > 0 ? den / num : 0;
    axis->gap_rest = num > 0 ? den % num : 0;
}

/* ---- time -------------------------------------------------------------------------------------------------------- */

/* The shaft is to be at a place at the end of a stretch of time: as many edges, evenly spaced. */
static void aim(struct ppmc_axis *const axis, const int64_t to_ns)
{
    const int64_t way = axis->position(axis->context, to_ns) - axis->shaft;
    const int64_t most = (to_ns - axis->now_ns) / 10; /* as for a steady rate: 1e8 a second */
    const int64_t edges_now = way < 0 ? -way : way;
    axis->direction = way < 0 ? -1 : 1;
    set_pace(axis, edges_now < most ? edges_now : most, to_ns - axis->now_ns);
    axis->phase = 0;
}

static void stretch(struct ppmc_axis *const axis, const struct ppmc_axis_setting *const setting, const int64_t to_ns)
{
    if (axis->position)
        aim(axis, to_ns);
    if (axis->num > 0) {
        const int64_t phase = axis->phase + axis->num * (to_ns - axis->now_ns);
        const int64_t passed = phase < axis->den ? 0 : phase / axis->den;
        if (passed > 0)
            edges(axis, setting, passed);
        axis->phase = phase - passed * axis->den;
    }
    axis->now_ns = to_ns;
    settle(axis, setting, to_ns);
}

void ppmc_axis_advance(struct ppmc_axis *const axis, const struct ppmc_axis_setting *const setting, const int64_t to_ns)
{
    while (axis->now_ns < to_ns) {
        const int64_t left_ns = to_ns - axis->now_ns;
        stretch(axis, setting, left_ns < STRETCH_NS ? to_ns : axis->now_ns + STRETCH_NS);
    }
}

void ppmc_axis_set_rate(struct ppmc_axis *const axis, const int32_t edges_per_s)
{
    const int64_t rate = edges_per_s < 0 ? -(int64_t)edges_per_s : edges_per_s;
    const int direction = edges_per_s < 0 ? -1 : 1;
    /* Turning round, the way back to the last edge is as long as the way from it was. */
    if (axis->den != NS_PER_S || axis->position)
        axis->phase = 0;
    else if (direction != axis->direction)
        axis->phase = axis->phase == 0 ? 0 : NS_PER_S - axis->phase;
    axis->position = NULL;
    set_pace(axis, rate < MAX_EDGES_PER_S ? rate : MAX_EDGES_PER_S, NS_PER_S);
    axis->direction = direction;
}

void ppmc_axis_jump(struct ppmc_axis *const axis, const struct ppmc_axis_setting *const setting, const int edges_now)
{
    settle(axis, setting, axis->now_ns);
    axis->shaft += edges_now;
    const unsigned input = seen(axis, axis->shaft);
    if (input != axis->input) {
        axis->input = input;
        axis->changed_ns = axis->now_ns;
    }
}

void ppmc_axis_break_wire(struct ppmc_axis *const axis, const bool broken)
{
    const unsigned place = (unsigned)modulo(axis->shaft, 4);
    axis->stuck_b = place >= 2u;
    axis->broken = broken;
    axis->input = seen(axis, axis->shaft);
    axis->changed_ns = axis->now_ns;
}
