/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inputs of multiplexed encoder traces. The recordings list what the bus and the select pin did, but not what the
 * bench did to the encoders; it stands in the description of a test ("20 edges on each encoder, 30 clk per edge"), or
 * it is what the next reads show: so many counts, the last of them at the time of the time stamp, the index at such a
 * level. From that, input events are made. A test that has input events of its own is left as it is.
 *
 * Made inputs cannot prove everything: where a test gives no rate of edges, that the counter counts is presumed, but
 * when the last count came, what was latched and what the registers show is not.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "replay_trace.h"
#include "sim_qcounter.h"

#define ENCODERS       8u
#define GAP_CLK        40 /* longer than this between two accesses: the bench did something */
#define EDGE_CLK       150
#define MAX_DESCRIBED  9999u
#define INDEX_LEAD_CLK 203 /* the bench read this long after it had set the index */
#define POWER_UP_TICK  13  /* select period after configuration at 100 MHz (README) */
#define FILTER_TICKS   4   /* latch, three samples, output (register map 3.5.3) */
#define LONG_TICKS     16

enum { INPUT_A, INPUT_B, INPUT_INDEX };

static const char *const input_names[3][ENCODERS] = {
    {"A0", "A1", "A2", "A3", "A4", "A5", "A6", "A7"},
    {"B0", "B1", "B2", "B3", "B4", "B5", "B6", "B7"},
    {"index0", "index1", "index2", "index3", "index4", "index5", "index6", "index7"},
};

struct maker {
    const struct replay_event *events; /* of the test */
    size_t count;
    struct replay_event_list *out;
    uint16_t position[ENCODERS]; /* as the inputs are */
    uint32_t data[ENCODERS];     /* count register as read last; 0 in its lower half after a write */
    uint16_t latched[ENCODERS];
    bool index[ENCODERS];
    uint16_t control[ENCODERS];
    int64_t tick; /* select period */
    struct sim_timestamp stamps;
    int err;
};

static void make(struct maker *const m, const int64_t at, const unsigned input, const unsigned encoder,
                 const bool level)
{
    const struct replay_event event = {
        .at = at, .kind = 'I', .name = input_names[input][encoder], .value = level ? "1" : "0"};
    if (!m->err)
        m->err = replay_event_add(m->out, &event);
}

/* One quadrature edge: A leads when counting up. */
static void make_edge(struct maker *const m, const unsigned encoder, const int64_t at, const bool up)
{
    const uint16_t from = m->position[encoder];
    const uint16_t to = (uint16_t)(up ? from + 1u : from - 1u);
    const bool a = ((to + 1u) & 2u) != 0, b = (to & 2u) != 0;
    if (a != (((from + 1u) & 2u) != 0))
        make(m, at, INPUT_A, encoder, a);
    else
        make(m, at, INPUT_B, encoder, b);
    m->position[encoder] = to;
}

/* ---- by description -------------------------------------------------------------------------------------------------
 */

/* "N edges on each encoder, M clk per edge" */
static bool described(const struct replay_test *const test, unsigned *const edges, unsigned *const clk_per_edge)
{
    static const char middle[] = " edges on each encoder, ", end[] = " clk per edge";
    const char *text = replay_take_number(test->description, MAX_DESCRIBED, edges);
    if (!text || strncmp(text, middle, strlen(middle)) != 0)
        return false;
    text = replay_take_number(text + strlen(middle), MAX_DESCRIBED, clk_per_edge);
    return text && strncmp(text, end, strlen(end)) == 0;
}

static bool is_access(const struct replay_event *const event)
{
    return event->kind == 'R' || event->kind == 'W';
}

/* Next gap between accesses from event *i on: times of the accesses before and after it; *i gets the latter. */
static bool next_gap(const struct maker *const m, size_t *const i, int64_t *const from, int64_t *const to)
{
    int64_t last = INT64_MAX;
    for (size_t e = *i; e < m->count; e++) {
        if (!is_access(&m->events[e]))
            continue;
        if (last != INT64_MAX && m->events[e].at - last > GAP_CLK) {
            *from = last;
            *to = m->events[e].at;
            *i = e;
            return true;
        }
        last = m->events[e].at;
    }
    return false;
}

/* One encoder after the other, each in the next gap. */
static void make_described(struct maker *const m, const unsigned edges, const unsigned clk_per_edge)
{
    size_t i = 0;
    int64_t from = 0, to = 0;
    for (unsigned encoder = 0; encoder < ENCODERS && next_gap(m, &i, &from, &to); encoder++)
        for (unsigned n = 0; n < edges; n++)
            make_edge(m, encoder, from + (int64_t)n * clk_per_edge, true);
}

/* ---- by what is read
 * ------------------------------------------------------------------------------------------------- */

static bool numbered(const struct replay_event *const event, const char *const name, unsigned *const number)
{
    const size_t len = strlen(name);
    int64_t value = 0;
    if (strncmp(event->name, name, len) != 0 || replay_decimal(event->name + len, ENCODERS - 1, &value))
        return false;
    *number = (unsigned)value;
    return true;
}

static bool hex_before_slash(const char *const text, uint32_t *const value)
{
    char part[16];
    snprintf(part, sizeof(part), "%.*s", (int)strcspn(text, "/"), text);
    return replay_hex32(part, value) == 0;
}

/* The reads that follow a gap. */
struct seen {
    bool has_data, has_control;
    uint32_t data, control;
};

static int64_t filter_ticks(const struct maker *const m, const unsigned encoder)
{
    return (m->control[encoder] & SIM_QC_FILTER) ? LONG_TICKS : FILTER_TICKS;
}

/* When the counter must have counted to show this stamp at `to`: in the middle of the stamp's tick. */
static int64_t stamped_clk(const struct maker *const m, const uint16_t stamp, const int64_t to)
{
    const int64_t period = m->stamps.divider.period;
    const uint16_t ticks_ago = (uint16_t)(sim_timestamp_at(&m->stamps, to) - stamp);
    const int64_t next_tick = sim_divider_tick(&m->stamps.divider, to);
    return next_tick - ticks_ago * period - (period - 1) / 2;
}

/* Edges that end such that the last one is counted at the time of the stamp. */
static void make_edges(struct maker *const m, const unsigned encoder, const int delta, const int64_t from,
                       const int64_t to)
{
    const int edges = delta < 0 ? -delta : delta;
    const int64_t counted = stamped_clk(m, (uint16_t)(m->data[encoder] >> 16), to);
    const int64_t last = counted - (filter_ticks(m, encoder) + 1) * m->tick;
    const int64_t room = edges > 1 ? (last - from) / (edges - 1) : EDGE_CLK;
    if (room < 1)
        return; /* so many edges do not fit: the count will differ */
    const int64_t step = room < EDGE_CLK ? room : EDGE_CLK;
    for (int n = 0; n < edges; n++)
        make_edge(m, encoder, last - (edges - 1 - n) * step, delta > 0);
}

/* Counts that an index cleared in the same gap: what was latched tells how many, or the levels of A and B, modulo 4. */
static int cleared_counts(const struct maker *const m, const unsigned encoder, const struct seen *const seen,
                          const uint16_t before)
{
    if (m->control[encoder] & SIM_QC_LATCH)
        return (int16_t)((seen->control >> 16) - before);
    const unsigned a = seen->control & 1u, b = seen->control >> 1 & 1u;
    const unsigned phase = b ? 3u - a : a;
    return (int)((phase - m->position[encoder]) & 3u);
}

static void make_counts(struct maker *const m, const unsigned encoder, const struct seen *const seen,
                        const bool index_edge, const int64_t from, const int64_t to)
{
    const uint32_t old = m->data[encoder];
    m->data[encoder] = seen->data;
    if (seen->data >> 16 == old >> 16)
        return; /* nothing was counted: the count was cleared, at most */
    int delta = (int16_t)((seen->data & 0xFFFFu) - (old & 0xFFFFu));
    if (index_edge && (m->control[encoder] & SIM_QC_CLEAR) && (seen->data & 0xFFFFu) == 0)
        delta = cleared_counts(m, encoder, seen, (uint16_t)old);
    make_edges(m, encoder, delta, from, to);
}

/* The index is at another level than before, or there was a pulse of it that latched something. Gated by A and B it
 * cannot be told. Returns whether there was an edge that latches and clears. */
static bool make_index(struct maker *const m, const unsigned encoder, const uint32_t control, const int64_t from,
                       const int64_t to)
{
    const bool polarity = control & SIM_QC_INDEX_POL, conditioned = control >> 2 & 1u;
    const bool level = conditioned == polarity;
    const bool latched = control >> 16 != m->latched[encoder];
    const int64_t pulse = (filter_ticks(m, encoder) + 4) * m->tick; /* long enough for the filter */
    const int64_t before = pulse > INDEX_LEAD_CLK ? pulse : INDEX_LEAD_CLK;
    m->latched[encoder] = (uint16_t)(control >> 16);
    if (control & SIM_QC_AB_GATE)
        return false;
    if (level != m->index[encoder]) {
        make(m, level && to - before > from ? to - before : from, INPUT_INDEX, encoder, level);
        m->index[encoder] = level;
        return level == polarity;
    }
    if (!latched)
        return false;
    const int64_t start = to - 2 * pulse > from ? to - 2 * pulse : from;
    make(m, start, INPUT_INDEX, encoder, !level);
    make(m, start + pulse, INPUT_INDEX, encoder, level);
    return true;
}

/* What happened in a gap: the reads that follow it tell. */
static void explain_gap(struct maker *const m, const size_t first, const int64_t from, const int64_t to)
{
    struct seen seen[ENCODERS] = {0};
    for (size_t i = first; i < m->count && m->events[i].at - to < GAP_CLK; i++) {
        const struct replay_event *const event = &m->events[i];
        uint32_t value = 0;
        unsigned encoder = 0;
        if (event->kind != 'R' || !hex_before_slash(event->value, &value))
            continue;
        if (numbered(event, "count", &encoder) && !seen[encoder].has_data) {
            seen[encoder].has_data = true;
            seen[encoder].data = value;
        } else if (numbered(event, "control", &encoder) && !seen[encoder].has_control) {
            seen[encoder].has_control = true;
            seen[encoder].control = value;
        }
    }
    for (unsigned encoder = 0; encoder < ENCODERS; encoder++) {
        bool index_edge = false;
        if (seen[encoder].has_control)
            index_edge = make_index(m, encoder, seen[encoder].control, from, to);
        if (seen[encoder].has_data)
            make_counts(m, encoder, &seen[encoder], index_edge, from, to);
    }
}

/* What the writes of an access group change in what is to be expected. */
static void follow_writes(struct maker *const m, const size_t from, const size_t to)
{
    for (size_t i = from; i < to; i++) {
        const struct replay_event *const event = &m->events[i];
        uint32_t value = 0;
        unsigned encoder = 0;
        if (event->kind != 'W' || !hex_before_slash(event->value, &value))
            continue;
        if (strcmp(event->name, "filterrate") == 0)
            m->tick = value & 0x800u ? 1 : (value & 0xFFFu) + 2;
        else if (strcmp(event->name, "tsdiv") == 0)
            sim_timestamp_write(&m->stamps, event->at, (uint16_t)value);
        else if (numbered(event, "count", &encoder))
            m->data[encoder] &= 0xFFFF0000u;
        else if (numbered(event, "control", &encoder))
            m->control[encoder] = (uint16_t)value;
    }
}

static void make_from_reads(struct maker *const m)
{
    size_t i = 0;
    int64_t from = 0, to = 0;
    for (size_t done = 0; next_gap(m, &i, &from, &to); done = i) {
        follow_writes(m, done, i);
        explain_gap(m, i, from, to);
    }
}

static bool has_inputs(const struct maker *const m)
{
    for (size_t i = 0; i < m->count; i++)
        if (m->events[i].kind == 'I')
            return true;
    return false;
}

int replay_muxed_inputs(const struct replay_trace *const trace, const struct replay_test *const test,
                        struct replay_event_list *const out)
{
    if (test->count == 0)
        return 0;
    struct maker m = {.events = trace->events + test->first, .count = test->count, .out = out, .tick = POWER_UP_TICK};
    sim_divider_start(&m.stamps.divider, 0, 0, SIM_TSDIV_TOP_BIT);
    unsigned edges = 0, clk_per_edge = 0;
    if (has_inputs(&m))
        return 0;
    if (described(test, &edges, &clk_per_edge))
        make_described(&m, edges, clk_per_edge);
    else
        make_from_reads(&m);
    return m.err;
}
