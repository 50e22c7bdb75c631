/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Three-phase PWM, tag 13, clocked by ClockHigh (register map 3.7, traces in folder tppwm). */
#include "high_clock.h"
#include "pwm_logic.h"
#include "sim_card.h"

#define INSTANCES_MAX 64u
#define PHASES        3u
#define COUNT_TOP     0x400u /* of the 11 bits of the reference: the triangle falls */
#define COUNT_LOW     0x3FFu
#define SUM_MASK      0x7FFu
#define DEAD_MASK     0x1FFu
#define FAULT_HIGH    0x8000u
#define ENABLED       0x1u
#define FAULT         0x2u
#define FILTER_EDGES  7u
#define SETTLING      4 /* edges after which a channel without a request is what its registers say */
#define PIN_A         0x81u
#define PIN_NA        0x84u
#define PIN_ENABLE    0x87u
#define PIN_FAULT     0x08u
#define CHANGES       4u

enum { PAGE_VALUE, PAGE_ENABLE, PAGE_SETUP, PAGE_RATE, PAGES };

/* A register that ClockHigh takes over, at the start of a PWM cycle or at once. */
struct load {
    uint32_t next, value;
    bool asked, first, second;
};

struct channel {
    struct load values, setup, enable;
    unsigned filter, triangle;
    bool old_top, upper[PHASES], lower[PHASES]; /* comparisons; lower: of the lower switch, 1 = off */
    bool fault_input;
    unsigned change_count;
    struct {
        int64_t edge;
        bool level;
    } changes[CHANGES];
};

struct tppwm {
    unsigned count;
    int64_t edges; /* of ClockHigh that have been made */
    struct pwm_reference reference;
    struct channel channels[INSTANCES_MAX];
};

/* ---- one edge ------------------------------------------------------------------------------------------------------
 */

static void ask(struct load *const l, const uint32_t value)
{
    l->next = value;
    l->asked = !l->second;
}

static bool idle(const struct load *const l)
{
    return !l->first && !l->second;
}

static void load_edge(struct load *const l, const bool at_cycle_start, const bool cycle_start)
{
    const struct load old = *l;
    const bool takes = old.first && old.second;
    if (takes)
        l->value = old.next;
    l->second = old.first;
    if (at_cycle_start)
        l->first = (old.asked && cycle_start) || (old.first && !takes);
    else
        l->first = old.asked;
    if (l->second)
        l->asked = false;
}

static bool is_fault(const struct channel *const c)
{
    return c->fault_input == ((c->setup.value & FAULT_HIGH) != 0);
}

static void take_input(struct channel *const c, const int64_t edge)
{
    while (c->change_count > 0 && c->changes[0].edge <= edge) {
        c->fault_input = c->changes[0].level;
        c->change_count--;
        for (unsigned i = 0; i < c->change_count; i++)
            c->changes[i] = c->changes[i + 1];
    }
}

static void channel_edge(struct channel *const c, const unsigned count, const int64_t edge)
{
    const bool top = count & COUNT_TOP, cycle_start = !top && c->old_top;
    const unsigned filter = c->filter, dead = c->setup.value & DEAD_MASK;
    const uint32_t values = c->values.value;
    take_input(c, edge);
    const bool fault = is_fault(c);
    for (unsigned phase = 0; phase < PHASES; phase++) {
        const unsigned value = values >> 10 * phase & COUNT_LOW;
        c->upper[phase] = c->triangle < ((value - dead) & SUM_MASK);
        c->lower[phase] = c->triangle < ((value + dead) & SUM_MASK);
    }
    if (fault && filter < FILTER_EDGES)
        c->filter++;
    else if (!fault && filter > 0)
        c->filter--;
    if (filter == FILTER_EDGES)
        c->enable.value = (c->enable.value & ~ENABLED) | FAULT;
    load_edge(&c->values, true, cycle_start);
    load_edge(&c->setup, true, cycle_start);
    load_edge(&c->enable, false, false);
    c->triangle = (top ? ~count : count) & COUNT_LOW;
    c->old_top = top;
}

static bool moves(const struct tppwm *const s)
{
    const struct pwm_rate *const r = &s->reference.pwm;
    return r->rate || r->request.asked || r->request.first || r->request.second;
}

/* Something will change a register of the channel. */
static bool busy(const struct tppwm *const s, const struct channel *const c)
{
    const bool waits = (c->values.asked || c->setup.asked) && moves(s);
    const bool settled = c->filter == (is_fault(c) ? FILTER_EDGES : 0);
    return waits || c->enable.asked || !idle(&c->values) || !idle(&c->setup) || !idle(&c->enable) || !settled ||
           c->change_count > 0;
}

static void edge(struct tppwm *const s)
{
    const unsigned count = s->reference.count & (COUNT_TOP | COUNT_LOW);
    for (unsigned i = 0; i < s->count; i++)
        channel_edge(&s->channels[i], count, s->edges);
    pwm_reference_edge(&s->reference);
    s->edges++;
}

static bool all_settled(const struct tppwm *const s)
{
    for (unsigned i = 0; i < s->count; i++)
        if (busy(s, &s->channels[i]))
            return false;
    return true;
}

static void run_to(struct tppwm *const s, const int64_t end)
{
    while (s->edges < end) {
        const int64_t left = end - s->edges;
        if (left > SETTLING && all_settled(s)) {
            pwm_run(&s->reference, NULL, left - SETTLING);
            s->edges += left - SETTLING;
            for (unsigned i = 0; i < s->count; i++) /* nobody sees a start of a cycle that is not one */
                s->channels[i].old_top = s->reference.count & COUNT_TOP;
        }
        edge(s);
    }
}

/* ---- the module ----------------------------------------------------------------------------------------------------
 */

static int init(struct sim_module *const m)
{
    struct tppwm *const s = m->state;
    if (sim_clock_low_hz(m->card) == 0 || sim_clock_high_hz(m->card) == 0)
        return HM2_ERR_RANGE;
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct tppwm *const s = m->state;
    s->edges = sim_high_edges(m->card, m->clk, false);
    s->reference = (struct pwm_reference){0};
    for (unsigned i = 0; i < s->count; i++)
        s->channels[i] = (struct channel){.fault_input = s->channels[i].fault_input};
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    run_to(m->state, sim_high_edges(m->card, clk, false));
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct tppwm *const s = m->state;
    const bool there = page == PAGE_ENABLE && low / 4 < s->count;
    *undriven = there ? ~(ENABLED | FAULT) : UINT32_MAX;
    return there ? s->channels[low / 4].enable.value : 0;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct tppwm *const s = m->state;
    const unsigned i = low / 4;
    run_to(s, sim_high_edges(m->card, m->clk, true));
    if (page == PAGE_RATE)
        pwm_rate_write(&s->reference.pwm, (uint16_t)value);
    else if (i >= s->count)
        return;
    else if (page == PAGE_VALUE)
        ask(&s->channels[i].values, value);
    else if (page == PAGE_SETUP)
        ask(&s->channels[i].setup, value);
    else if (page == PAGE_ENABLE)
        ask(&s->channels[i].enable, value & (ENABLED | FAULT));
}

static bool level_of(const struct channel *const c, const uint8_t pin)
{
    const bool enabled = c->enable.value & ENABLED;
    if (pin == PIN_ENABLE)
        return !enabled;
    if (pin >= PIN_A && pin < PIN_A + PHASES)
        return enabled && c->upper[pin - PIN_A];
    return pin >= PIN_NA && pin < PIN_NA + PHASES && enabled && !c->lower[pin - PIN_NA];
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct tppwm *const s = m->state;
    return unit < s->count && level_of(&s->channels[unit], pin) ? SIM_HIGH : SIM_LOW;
}

static void trace(struct sim_module *const m, const unsigned unit, const uint8_t pin, const int64_t from,
                  const int64_t to, void (*const report)(void *context, int64_t clk, unsigned ps, enum sim_level level),
                  void *const context)
{
    const struct tppwm *const s = m->state;
    (void)from;
    if (unit >= s->count)
        return;
    struct pwm_reference reference = s->reference;
    struct channel c = s->channels[unit];
    const int64_t end = sim_high_edges(m->card, to, false);
    for (int64_t j = s->edges; j < end; j++) {
        const bool before = level_of(&c, pin);
        channel_edge(&c, reference.count & (COUNT_TOP | COUNT_LOW), j);
        pwm_reference_edge(&reference);
        const bool after = level_of(&c, pin);
        unsigned ps = 0;
        const int64_t clk = before != after ? sim_low_edge(m->card, j, &ps) : 0;
        if (before != after)
            report(context, clk, ps, after ? SIM_HIGH : SIM_LOW);
    }
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct tppwm *const s = m->state;
    if (pin == PIN_FAULT && unit < s->count)
        s->channels[unit].fault_input = level;
}

static void input_at(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level,
                     const int64_t clk, const unsigned ps)
{
    struct tppwm *const s = m->state;
    if (pin != PIN_FAULT || unit >= s->count || s->channels[unit].change_count == CHANGES)
        return;
    struct channel *const c = &s->channels[unit];
    c->changes[c->change_count].edge = sim_high_edges_after(m->card, clk, ps);
    c->changes[c->change_count++].level = level;
}

const struct sim_module_ops sim_tppwm_ops = {
    .gtag = HM2_GTAG_TPPWM,
    .name = "three-phase PWM",
    .pages = PAGES,
    .state_size = sizeof(struct tppwm),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .trace = trace,
    .input = input,
    .input_at = input_at,
};
