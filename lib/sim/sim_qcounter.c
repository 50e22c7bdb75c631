/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "sim_qcounter.h"

#include <string.h>

#define FILTER_SHORT 3u /* samples (3.5.3) */
#define FILTER_LONG  15u

/* ---- dividers -------------------------------------------------------------------------------------------------------
 */

static int64_t period_of(const uint32_t value, const uint32_t top_bit)
{
    return value & top_bit ? 1 : (int64_t)value + 2;
}

void sim_divider_start(struct sim_divider *const d, const int64_t clk, const uint32_t value, const uint32_t top_bit)
{
    d->next = clk + 1;
    d->period = period_of(value, top_bit);
}

int64_t sim_divider_tick(const struct sim_divider *const d, const int64_t clk)
{
    if (clk <= d->next)
        return d->next;
    const int64_t past = (clk - d->next) % d->period;
    return past ? clk + d->period - past : clk;
}

int64_t sim_divider_count(const struct sim_divider *const d, const int64_t from, const int64_t to)
{
    const int64_t first = sim_divider_tick(d, from);
    return first >= to ? 0 : (to - 1 - first) / d->period + 1;
}

void sim_divider_write(struct sim_divider *const d, const int64_t clk, const uint32_t value, const uint32_t top_bit)
{
    d->next = sim_divider_tick(d, clk + 1);
    d->period = period_of(value, top_bit);
}

void sim_timestamp_write(struct sim_timestamp *const ts, const int64_t clk, const uint16_t divisor)
{
    ts->base = sim_timestamp_at(ts, clk + 1);
    ts->since = clk + 1;
    ts->divisor = divisor;
    sim_divider_write(&ts->divider, clk, divisor, SIM_TSDIV_TOP_BIT);
}

uint16_t sim_timestamp_at(const struct sim_timestamp *const ts, const int64_t clk)
{
    return (uint16_t)(ts->base + (uint64_t)sim_divider_count(&ts->divider, ts->since, clk));
}

/* ---- one counter ----------------------------------------------------------------------------------------------------
 */

uint32_t sim_qcounter_data(const struct sim_qcounter *const q)
{
    return (uint32_t)q->stamp << 16 | q->count;
}

uint32_t sim_qcounter_control(const struct sim_qcounter *const q)
{
    return (uint32_t)q->latch << 16 | q->control | (uint32_t)q->first[SIM_QC_INDEX] << 2 |
           (uint32_t)q->first[SIM_QC_B] << 1 | (uint32_t)q->first[SIM_QC_A];
}

static uint8_t limit_of(const struct sim_qcounter *const q)
{
    return q->control & SIM_QC_FILTER ? FILTER_LONG : FILTER_SHORT;
}

/* Index after polarity and A/B gate: what its filter sees. The gate looks at A and B before their filters. */
static bool conditioned_index(const struct sim_qcounter *const q)
{
    const bool level = q->sampled[SIM_QC_INDEX] == ((q->control & SIM_QC_INDEX_POL) != 0);
    if (!(q->control & SIM_QC_AB_GATE))
        return level;
    const bool gate_level = (q->control & SIM_QC_AB_MASK_POL) != 0;
    return level && q->sampled[SIM_QC_A] == gate_level && q->sampled[SIM_QC_B] == gate_level;
}

static bool filter_input(const struct sim_qcounter *const q, const unsigned input)
{
    return input == SIM_QC_INDEX ? conditioned_index(q) : q->sampled[input];
}

static unsigned inputs_of(const struct sim_qc_type *const type)
{
    return type->probe ? SIM_QC_INPUTS : SIM_QC_PROBE;
}

/* Dead-ended up/down counters: the output changes a tick after its counter has reached an end. */
static void advance_filters(struct sim_qcounter *const q, const unsigned inputs)
{
    const uint8_t limit = limit_of(q);
    for (unsigned i = 0; i < inputs; i++) {
        const bool level = filter_input(q, i);
        const uint8_t old = q->filter[i];
        if (level && old < limit)
            q->filter[i]++;
        else if (!level && old > 0)
            q->filter[i]--;
        if (old >= limit)
            q->filtered[i] = true;
        else if (old == 0)
            q->filtered[i] = false;
    }
}

struct events {
    int step; /* +1, 0, -1 */
    bool both, index, probe;
};

static bool mask_open(const struct sim_qcounter *const q)
{
    return !(q->control & SIM_QC_USE_MASK) || q->mask == ((q->control & SIM_QC_MASK_POL) != 0);
}

static struct events find_events(const struct sim_qcounter *const q)
{
    const bool a = q->first[SIM_QC_A], b = q->first[SIM_QC_B];
    const bool a_changed = a != q->second[SIM_QC_A], b_changed = b != q->second[SIM_QC_B];
    const bool probe = q->first[SIM_QC_PROBE];
    struct events events = {
        .index = q->first[SIM_QC_INDEX] && !q->second[SIM_QC_INDEX] && mask_open(q),
        .probe = probe != q->second[SIM_QC_PROBE] && probe == ((q->control & SIM_QC_PROBE_POL) != 0),
    };
    if (q->control & SIM_QC_UP_DOWN) {
        if (a && a_changed)
            events.step = q->second[SIM_QC_B] ? 1 : -1;
    } else if (a_changed && b_changed) {
        events.both = true;
    } else if (a_changed) {
        events.step = a != b ? 1 : -1;
    } else if (b_changed) {
        events.step = a == b ? 1 : -1;
    }
    return events;
}

static void shift_inputs(struct sim_qcounter *const q, const bool tick, const unsigned inputs)
{
    bool was_filtered[SIM_QC_INPUTS];
    memcpy(was_filtered, q->filtered, sizeof(was_filtered));
    if (tick)
        advance_filters(q, inputs);
    memcpy(q->second, q->first, sizeof(q->second));
    memcpy(q->first, was_filtered, sizeof(q->first));
    memcpy(q->sampled, q->pin, sizeof(q->sampled));
}

/* Latch and clear at an index or probe edge, with JustOnce each enable falls by its own event. A write to the count
 * register is such a clear, too. */
static void latch_and_clear(struct sim_qcounter *const q, const struct events *const events, const bool clear)
{
    const bool once = q->control & SIM_QC_JUST_ONCE;
    const bool latch_index = events->index && (q->control & SIM_QC_LATCH);
    const bool latch_probe = events->probe && (q->control & SIM_QC_LATCH_ON_PROBE);
    if (latch_index || latch_probe)
        q->latch = q->count;
    uint32_t fallen = 0;
    if (once && latch_index)
        fallen |= SIM_QC_LATCH;
    if (once && latch_probe)
        fallen |= SIM_QC_LATCH_ON_PROBE;
    if (once && clear)
        fallen |= SIM_QC_CLEAR;
    q->control &= (uint16_t)~fallen;
}

void sim_qcounter_index(struct sim_qcounter *const q)
{
    const struct events events = {.index = mask_open(q)};
    const bool clear = events.index && (q->control & SIM_QC_CLEAR);
    latch_and_clear(q, &events, clear);
    if (clear)
        q->count = 0;
}

static void load_control(struct sim_qcounter *const q, const struct sim_qc_type *const type, const uint16_t value)
{
    const uint16_t kept = type->probe ? 0x7FF8 : 0x4FF8;
    const bool error =
        type->error_by_one ? (q->control & SIM_QC_ERROR) && !(value & SIM_QC_ERROR) : (value & SIM_QC_ERROR) != 0;
    q->control = (uint16_t)((value & kept) | (error ? SIM_QC_ERROR : 0));
}

void sim_qcounter_edge(struct sim_qcounter *const q, const struct sim_qc_type *const type, const int64_t clk,
                       const bool tick, const uint16_t stamp, const struct sim_qc_access *const access)
{
    q->at_rest = false;
    q->before_data = sim_qcounter_data(q);
    q->before_control = sim_qcounter_control(q);
    q->last_edge = clk;

    const struct events events = find_events(q);
    const bool clear = (access && access->clear) || (events.index && (q->control & SIM_QC_CLEAR));
    const bool clear_now = type->probe ? clear : q->clearing;
    shift_inputs(q, tick, inputs_of(type)); /* looks at control before it changes */
    latch_and_clear(q, &events, clear);
    if (events.both)
        q->control |= SIM_QC_ERROR;
    if (events.step && !q->clearing) {
        q->stamp = stamp;
        q->count = (uint16_t)(q->count + (unsigned)events.step);
    }
    if (clear_now)
        q->count = 0;
    q->clearing = !type->probe && clear;
    if (access && access->load)
        load_control(q, type, access->value);
}

bool sim_qcounter_busy(const struct sim_qcounter *const q, const struct sim_qc_type *const type)
{
    for (unsigned i = 0; i < inputs_of(type); i++)
        if (q->sampled[i] != q->pin[i] || q->first[i] != q->filtered[i] || q->second[i] != q->first[i])
            return true;
    return q->clearing;
}

bool sim_qcounter_settled(const struct sim_qcounter *const q, const struct sim_qc_type *const type)
{
    const uint8_t limit = limit_of(q);
    for (unsigned i = 0; i < inputs_of(type); i++) {
        const bool level = filter_input(q, i);
        if (q->filtered[i] != level || (level ? q->filter[i] < limit : q->filter[i] > 0))
            return false;
    }
    return true;
}
