/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pwm_logic.h"

#include <stddef.h>

#define RATE_ONE     0x10000u /* the accumulator's top bit changes once per so much */
#define RATE_MASK    0x1FFFFu
#define COUNT_MASK   0x1FFFu /* reference counter, 13 bits (folder pwmgen) */
#define VALUE_MASK   0x0FFFu
#define VALUE_SHIFT  16
#define PDM_TOP      0x1000u
#define MODE_WIDTH   0x03u /* register map 3.6, mode register */
#define MODE_SYM     0x04u
#define MODE_OUTPUT  0x18u
#define MODE_SWAPPED 0x08u
#define MODE_UP_DOWN 0x10u
#define MODE_PDM     0x18u
#define MODE_DOUBLE  0x20u
#define MODE_MASK    0x3Fu
#define WIDTH_MIN    9u
#define SKIP_MAX     (1LL << 40) /* edges at once: rate * edges stays below 2^63 */

/* ---- requests
 * --------------------------------------------------------------------------------------------------------- */

static void ask(struct pwm_request *const r)
{
    r->asked = !r->second; /* held down as long as the second flip-flop is up */
}

static bool pending(const struct pwm_request *const r)
{
    return r->asked || r->first || r->second;
}

/* The register takes its value at this edge. */
static bool takes(const struct pwm_request *const r)
{
    return r->first && r->second;
}

static void request_edge(struct pwm_request *const r, const bool first)
{
    r->second = r->first;
    r->first = first;
    if (r->second)
        r->asked = false;
}

void pwm_rate_write(struct pwm_rate *const rate, const uint16_t value)
{
    rate->next_rate = value;
    ask(&rate->request);
}

void pwm_value_write(struct pwm_channel *const channel, const uint32_t value)
{
    channel->next_value = (uint16_t)(value >> VALUE_SHIFT & VALUE_MASK);
    channel->next_dir = value >> 31;
    ask(&channel->value_request);
}

void pwm_mode_write(struct pwm_channel *const channel, const uint32_t value)
{
    channel->next_mode = value & MODE_MASK;
    ask(&channel->mode_request);
}

/* ---- rate generators
 * ---------------------------------------------------------------------------------------------------- */

static bool top_bit(const struct pwm_rate *const r)
{
    return r->accumulator & RATE_ONE;
}

static bool rate_pulse(const struct pwm_rate *const r)
{
    return r->old_top != top_bit(r);
}

static void rate_edge(struct pwm_rate *const r)
{
    const uint32_t sum = (r->accumulator + r->rate) & RATE_MASK;
    r->old_top = top_bit(r);
    r->accumulator = sum;
    if (takes(&r->request))
        r->rate = r->next_rate;
    request_edge(&r->request, r->request.asked);
}

/* Changes of the top bit in n edges. */
static int64_t rate_changes(const struct pwm_rate *const r, const int64_t n)
{
    return n <= 0 ? 0 : ((int64_t)(r->accumulator & (RATE_ONE - 1)) + n * r->rate) >> 16;
}

/* Edges among the next n that see a pulse. */
static int64_t rate_pulses(const struct pwm_rate *const r, const int64_t n)
{
    return n <= 0 ? 0 : (rate_pulse(r) ? 1 : 0) + rate_changes(r, n - 1);
}

/* Number of the edge, from 1, that sees the d-th pulse. */
static int64_t rate_edge_of_pulse(const struct pwm_rate *const r, int64_t d)
{
    if (rate_pulse(r) && d-- == 1)
        return 1;
    if (r->rate == 0)
        return PWM_NEVER;
    const int64_t missing = d * (int64_t)RATE_ONE - (int64_t)(r->accumulator & (RATE_ONE - 1));
    return (missing + r->rate - 1) / r->rate + 1;
}

/* n >= 1 edges at once, without a request. */
static void rate_skip(struct pwm_rate *const r, const int64_t n)
{
    const uint32_t before = (uint32_t)((int64_t)r->accumulator + (n - 1) * r->rate) & RATE_MASK;
    r->old_top = before & RATE_ONE;
    r->accumulator = (before + r->rate) & RATE_MASK;
}

/* ---- reference
 * ------------------------------------------------------------------------------------------------------------ */

void pwm_reference_edge(struct pwm_reference *const ref)
{
    if (rate_pulse(&ref->pwm))
        ref->count = (ref->count + 1u) & COUNT_MASK;
    ref->pdm_pulse = rate_pulse(&ref->pdm);
    rate_edge(&ref->pwm);
    rate_edge(&ref->pdm);
}

static uint16_t count_after(const struct pwm_reference *const ref, const int64_t n)
{
    return (uint16_t)((uint64_t)ref->count + (uint64_t)rate_pulses(&ref->pwm, n)) & COUNT_MASK;
}

static void reference_skip(struct pwm_reference *const ref, const int64_t n)
{
    ref->count = count_after(ref, n);
    ref->pdm_pulse = rate_pulses(&ref->pdm, n) != rate_pulses(&ref->pdm, n - 1);
    rate_skip(&ref->pwm, n);
    rate_skip(&ref->pdm, n);
}

/* ---- a channel
 * ------------------------------------------------------------------------------------------------------------- */

/* Counts of half a triangle or of a whole sawtooth. */
static uint32_t span(const struct pwm_channel *const c)
{
    return 1u << (WIDTH_MIN + (c->mode & MODE_WIDTH));
}

static bool toggle(const struct pwm_channel *const c, const uint16_t count)
{
    return count & span(c);
}

static uint16_t ramp_of(const struct pwm_channel *const c, const uint16_t count)
{
    return (uint16_t)((c->mode & MODE_SYM) && toggle(c, count) ? ~count : count) & VALUE_MASK;
}

static bool below_value(const struct pwm_channel *const c, const uint16_t ramp)
{
    return (ramp & (span(c) - 1)) < c->value;
}

/* A double-buffered value is taken at the start of a cycle: with a triangle when the toggle bit falls, with a sawtooth
 * whenever it changes. */
static bool cycle_starts(const struct pwm_channel *const c, const uint16_t count)
{
    const bool now = toggle(c, count);
    return c->mode & MODE_SYM ? !now && c->old_toggle : now != c->old_toggle;
}

static void value_edge(struct pwm_channel *const c, const bool cycle_start)
{
    const bool take = takes(&c->value_request);
    const bool follow = c->value_request.asked && (cycle_start || !(c->mode & MODE_DOUBLE));
    const bool first = follow || (c->value_request.first && !take);
    if (take) {
        c->value = c->next_value;
        c->dir = c->next_dir;
    }
    request_edge(&c->value_request, first);
}

void pwm_channel_edge(struct pwm_channel *const c, const struct pwm_reference *const ref)
{
    const bool pwm = below_value(c, c->ramp);
    const uint16_t ramp = ramp_of(c, ref->count);
    const bool old_toggle = toggle(c, ref->count);
    const bool cycle_start = cycle_starts(c, ref->count);
    const bool take_mode = takes(&c->mode_request);
    if (ref->pdm_pulse)
        c->pdm = (uint16_t)((c->pdm & VALUE_MASK) + c->value);
    value_edge(c, cycle_start);
    request_edge(&c->mode_request, c->mode_request.asked);
    if (take_mode)
        c->mode = c->next_mode;
    c->pwm = pwm;
    c->ramp = ramp;
    c->old_toggle = old_toggle;
}

bool pwm_output(const struct pwm_channel *const c, const enum pwm_pin pin)
{
    const bool on_a = pin == PWM_PIN_A;
    switch (c->mode & MODE_OUTPUT) {
    case MODE_SWAPPED:
        return on_a ? c->dir : c->pwm;
    case MODE_UP_DOWN:
        return on_a == c->dir && c->pwm;
    case MODE_PDM:
        return on_a ? c->pdm & PDM_TOP : c->dir;
    default:
        return on_a ? c->pwm : c->dir;
    }
}

/* Adds of the PDM accumulator in n edges: one edge after a pulse of its rate. */
static int64_t pdm_adds(const struct pwm_reference *const ref, const int64_t n)
{
    return n <= 0 ? 0 : (ref->pdm_pulse ? 1 : 0) + rate_pulses(&ref->pdm, n - 1);
}

/* n >= 2 edges at once, while no register changes. ref is still as before them. */
static void channel_skip(struct pwm_channel *const c, const struct pwm_reference *const ref, const int64_t n)
{
    const int64_t adds = pdm_adds(ref, n);
    if (adds > 0)
        c->pdm = (uint16_t)(((c->pdm + (uint64_t)(adds - 1) * c->value) & VALUE_MASK) + c->value);
    c->pwm = below_value(c, ramp_of(c, count_after(ref, n - 2)));
    const uint16_t count = count_after(ref, n - 1);
    c->ramp = ramp_of(c, count);
    c->old_toggle = toggle(c, count);
}

/* ---- skipping
 * ---------------------------------------------------------------------------------------------------------------- */

/* Edges until the one that makes the reference count reach the start of the next cycle. */
static int64_t edges_to_cycle(const struct pwm_channel *const c, const struct pwm_reference *const ref)
{
    const uint32_t cycle = c->mode & MODE_SYM ? 2 * span(c) : span(c);
    return rate_edge_of_pulse(&ref->pwm, (int64_t)(cycle - (ref->count & (cycle - 1))));
}

/* Edges during which no register changes. */
static int64_t registers_rest(const struct pwm_reference *const ref, const struct pwm_channel *const c)
{
    if (pending(&ref->pwm.request) || pending(&ref->pdm.request))
        return 0;
    if (!c)
        return PWM_NEVER;
    const struct pwm_request *const r = &c->value_request;
    if (pending(&c->mode_request) || r->first || r->second)
        return 0;
    if (!r->asked)
        return PWM_NEVER;
    if (!(c->mode & MODE_DOUBLE) || cycle_starts(c, ref->count))
        return 0;
    return edges_to_cycle(c, ref);
}

static void skip_or_step(struct pwm_reference *const ref, struct pwm_channel *const c, const int64_t n)
{
    if (n >= 2) {
        if (c)
            channel_skip(c, ref, n);
        reference_skip(ref, n);
    } else {
        if (c)
            pwm_channel_edge(c, ref);
        pwm_reference_edge(ref);
    }
}

static int64_t least(const int64_t a, const int64_t b)
{
    return a < b ? a : b;
}

static int64_t at_least_one(const int64_t n)
{
    return n > 1 ? n : 1;
}

void pwm_run(struct pwm_reference *const ref, struct pwm_channel *const c, const int64_t n)
{
    for (int64_t done = 0; done < n;) {
        const int64_t now = at_least_one(least(least(registers_rest(ref, c), SKIP_MAX), n - done));
        skip_or_step(ref, c, now);
        done += now;
    }
}

int64_t pwm_run_steady(struct pwm_reference *const ref, struct pwm_channel *const c, const int64_t n)
{
    const struct pwm_channel before = *c;
    int64_t done = 0;
    while (done < n && c->value == before.value && c->dir == before.dir && c->mode == before.mode) {
        const int64_t now = at_least_one(least(least(registers_rest(ref, c), SKIP_MAX), n - done));
        skip_or_step(ref, c, now);
        done += now;
    }
    return done;
}

int32_t pwm_duty(const struct pwm_channel *const c)
{
    const uint32_t full = (c->mode & MODE_OUTPUT) == MODE_PDM ? PDM_TOP : span(c);
    const int32_t on = c->value < full ? (int32_t)(c->value * (PDM_TOP / full)) : (int32_t)PDM_TOP;
    return c->dir ? -on : on;
}

/* Edges before the comparator's input can change its result; 0 when a result is still on its way to the output. */
static int64_t pwm_rests(const struct pwm_channel *const c, const struct pwm_reference *const ref)
{
    const bool now = below_value(c, ramp_of(c, ref->count));
    if (c->pwm != now || below_value(c, c->ramp) != now)
        return 0;
    const uint32_t size = span(c);
    if (c->value == 0 || c->value >= size)
        return PWM_NEVER;
    const bool sym = c->mode & MODE_SYM;
    const uint32_t cycle = sym ? 2 * size : size;
    const uint32_t at = ref->count & (cycle - 1);
    const uint32_t rise = sym ? cycle - c->value : cycle; /* high from the rise through 0 to value - 1 */
    const uint32_t next = at < c->value ? c->value : at < rise ? rise : cycle + c->value;
    return rate_edge_of_pulse(&ref->pwm, (int64_t)(next - at)) - 1;
}

/* Edges before the PDM bit can change. */
static int64_t pdm_rests(const struct pwm_channel *const c, const struct pwm_reference *const ref)
{
    const uint32_t low = c->pdm & VALUE_MASK;
    const bool top = c->pdm & PDM_TOP;
    if (c->value == 0 && !top)
        return PWM_NEVER;
    const uint32_t short_of = PDM_TOP - c->value; /* 1..4096 */
    int64_t adds = top ? low / short_of + 1 : (PDM_TOP - low + c->value - 1) / c->value;
    if (ref->pdm_pulse && adds-- == 1)
        return 0;
    const int64_t edge = rate_edge_of_pulse(&ref->pdm, adds);
    return edge == PWM_NEVER ? PWM_NEVER : edge; /* the add comes one edge after the pulse */
}

int64_t pwm_run_to_change(struct pwm_reference *const ref, struct pwm_channel *const c, const enum pwm_pin pin,
                          const int64_t n)
{
    const bool before = pwm_output(c, pin);
    int64_t done = 0;
    while (done < n && pwm_output(c, pin) == before) {
        const bool pdm = (c->mode & MODE_OUTPUT) == MODE_PDM;
        const int64_t output = pdm ? pdm_rests(c, ref) : pwm_rests(c, ref);
        const int64_t quiet = least(least(registers_rest(ref, c), output), SKIP_MAX);
        const int64_t now = least(at_least_one(quiet), n - done);
        skip_or_step(ref, c, now);
        done += now;
    }
    return done;
}
