/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* OneShot, tag C7: two pulse generators an instance, started by a choice of triggers (register map 3.19). */
#include "dpll.h"
#include "sim_card.h"

#define INSTANCES_MAX 64u
#define SHOTS         2u
#define SHOT_SHIFT    16u /* the second's bits of the control register are those of the first, so much higher */
#define SELECT        0x7u
#define ON_RISE       0x08u
#define ON_FALL       0x10u
#define RETRIGGER     0x20u
#define ENABLE        0x40u
#define RESET         0x80u
#define OUT           0x100u
#define TRIGGER_INPUT 0x200u
#define SOFTWARE      0x400u
#define KEPT          0x04FFF4FFu
#define TIMER_SHIFT   12
#define TIMER_MASK    0x7u
#define TIMERS        5u
#define FILTER_MASK   0xFFFFFFu
#define TOP           0x80000000u /* of the accumulator that makes the internal rate */
#define PIN_TRIGGER   0x01u       /* and the next: inputs */
#define PIN_OUT       0x83u       /* and the next */

enum { PAGE_WIDTH, PAGE_FILTER = 2, PAGE_RATE = 4, PAGE_CONTROL, PAGES };
enum source { OFF, BY_SOFTWARE, BY_INPUT, BY_TIMER, BY_RATE, BY_FIRST, BY_SECOND };

struct shot {
    uint32_t width, filter, filter_count;
    int64_t left; /* of the pulse; below 0 it ends */
    bool line, input, trigger, before, runs;
};

struct oneshot {
    struct shot shot[SHOTS];
    uint32_t control, rate, accum;
};

struct oneshots {
    unsigned count;
    struct oneshot oneshot[INSTANCES_MAX];
};

static uint32_t bits_of(const struct oneshot *const o, const unsigned shot)
{
    return o->control >> SHOT_SHIFT * shot;
}

static unsigned timer_of(const struct oneshot *const o)
{
    const unsigned timer = o->control >> TIMER_SHIFT & TIMER_MASK;
    return timer < TIMERS ? timer : 0;
}

static bool is_off(const struct oneshot *const o, const unsigned shot)
{
    const uint32_t select = bits_of(o, shot) & SELECT;
    return select == OFF || select > BY_SECOND;
}

/* Level of what triggers a shot, before edge clk. */
static bool source(struct sim_card *const card, const struct oneshot *const o, const unsigned shot, const int64_t clk)
{
    switch (bits_of(o, shot) & SELECT) {
    case BY_SOFTWARE:
        return bits_of(o, shot) & SOFTWARE;
    case BY_INPUT:
        return o->shot[shot].input;
    case BY_TIMER:
        return sim_dpll_level(card, timer_of(o), clk);
    case BY_RATE:
        return o->accum & TOP;
    case BY_FIRST:
        return o->shot[0].runs;
    case BY_SECOND:
        return o->shot[1].runs;
    default:
        return o->shot[shot].trigger;
    }
}

/* ---- one edge ------------------------------------------------------------------------------------------------------
 */

static void filter_edge(struct shot *const s)
{
    const uint32_t count = s->filter_count;
    if (s->line && count < s->filter)
        s->filter_count++;
    if (!s->line && count > 0)
        s->filter_count--;
    if (count >= s->filter)
        s->input = true;
    if (count == 0)
        s->input = false;
}

static void pulse_edge(struct shot *const s, const struct shot *const old, const uint32_t bits, const bool off)
{
    const bool starts = (bits & ENABLE) && ((bits & ON_RISE && old->trigger && !old->before) ||
                                            (bits & ON_FALL && !old->trigger && old->before));
    if (off || bits & RESET || old->left < 0)
        s->runs = false;
    if (!old->runs)
        s->left = old->width;
    else if (old->left >= 0)
        s->left--;
    if (!starts || (old->runs && !(bits & RETRIGGER)))
        return;
    s->runs = true;
    if (bits & RETRIGGER)
        s->left = old->width;
}

static void edge(struct sim_card *const card, struct oneshot *const o, const int64_t clk)
{
    const struct oneshot old = *o;
    for (unsigned i = 0; i < SHOTS; i++) {
        struct shot *const s = &o->shot[i];
        s->before = old.shot[i].trigger;
        s->trigger = source(card, &old, i, clk);
        filter_edge(s);
        pulse_edge(s, &old.shot[i], bits_of(&old, i), is_off(&old, i));
    }
    o->accum += o->rate;
}

/* ---- edges at which only counters move -----------------------------------------------------------------------------
 */

static int64_t smaller(const int64_t a, const int64_t b)
{
    return a < b ? a : b;
}

/* Until the timer's next change is seen. */
static int64_t timer_rests(struct sim_card *const card, const unsigned timer, const bool level, const int64_t clk)
{
    const int64_t past =
        level ? sim_dpll_last_fall(card, timer, SIM_NEVER) : sim_dpll_last_rise(card, timer, SIM_NEVER);
    const int64_t change = past >= clk ? past : sim_dpll_next_change(card, timer, !level, clk);
    return change == SIM_NEVER ? SIM_NEVER : change + 1 - clk;
}

static int64_t rate_rests(const struct oneshot *const o)
{
    const uint32_t room = TOP - (o->accum & ~TOP);
    return o->rate ? ((int64_t)room + o->rate - 1) / o->rate : SIM_NEVER;
}

static int64_t filter_rests(const struct shot *const s)
{
    const bool full = s->filter_count >= s->filter, empty = s->filter_count == 0;
    if (empty ? s->input : full && !s->input)
        return 0;
    if (s->line)
        return full ? SIM_NEVER : s->filter - s->filter_count;
    return empty ? SIM_NEVER : s->filter_count;
}

/* Some edges from clk on make nothing but counts; 0 = the next one may do more. */
static int64_t rests(struct sim_card *const card, const struct oneshot *const o, const int64_t clk)
{
    int64_t edges = SIM_NEVER;
    for (unsigned i = 0; i < SHOTS; i++) {
        const struct shot *const s = &o->shot[i];
        const uint32_t bits = bits_of(o, i);
        const bool level = source(card, o, i, clk);
        if (s->trigger != s->before || s->trigger != level || (!s->runs && s->left != s->width) ||
            (s->runs && (s->left < 0 || bits & RESET || is_off(o, i))))
            return 0;
        edges = smaller(edges, filter_rests(s));
        if (s->runs)
            edges = smaller(edges, s->left + 1);
        if ((bits & SELECT) == BY_RATE)
            edges = smaller(edges, rate_rests(o));
        if ((bits & SELECT) == BY_TIMER)
            edges = smaller(edges, timer_rests(card, timer_of(o), level, clk));
    }
    return edges;
}

static void count(struct oneshot *const o, const int64_t edges)
{
    for (unsigned i = 0; i < SHOTS; i++) {
        struct shot *const s = &o->shot[i];
        if (s->runs)
            s->left -= edges;
        if (s->line && s->filter_count < s->filter)
            s->filter_count += (uint32_t)edges;
        else if (!s->line && s->filter_count > 0)
            s->filter_count -= (uint32_t)edges;
    }
    o->accum += (uint32_t)((uint64_t)o->rate * (uint64_t)edges);
}

static void run(struct sim_card *const card, struct oneshot *const o, int64_t clk, const int64_t to)
{
    while (clk < to) {
        const int64_t edges = smaller(rests(card, o, clk), to - clk);
        if (edges > 0)
            count(o, edges);
        else
            edge(card, o, clk);
        clk += edges > 0 ? edges : 1;
    }
}

/* ---- the module ----------------------------------------------------------------------------------------------------
 */

static int init(struct sim_module *const m)
{
    struct oneshots *const s = m->state;
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct oneshots *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        s->oneshot[i] = (struct oneshot){.accum = 0};
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct oneshots *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        run(m->card, &s->oneshot[i], m->clk, clk);
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct oneshots *const s = m->state;
    if (low / 4 >= s->count || page != PAGE_CONTROL) {
        *undriven = UINT32_MAX;
        return 0;
    }
    const struct oneshot *const o = &s->oneshot[low / 4];
    uint32_t value = o->control & KEPT;
    for (unsigned i = 0; i < SHOTS; i++)
        value |= ((o->shot[i].runs ? OUT : 0) | (o->shot[i].input ? TRIGGER_INPUT : 0)) << SHOT_SHIFT * i;
    return value;
}

static void set(struct sim_module *const m, struct oneshot *const o, const unsigned page, const uint32_t value)
{
    if (page == PAGE_CONTROL)
        o->control = value;
    else if (page == PAGE_RATE)
        o->rate = value;
    else if (page >= PAGE_FILTER)
        o->shot[page - PAGE_FILTER].filter = value & FILTER_MASK;
    else
        o->shot[page - PAGE_WIDTH].width = value;
    for (unsigned i = 0; i < SHOTS; i++)
        if ((bits_of(o, i) & SELECT) == BY_TIMER)
            sim_watch_module(m); /* the DPLL remembers few changes of its timers */
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct oneshots *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        edge(m->card, &s->oneshot[i], m->clk);
    m->clk++;
    if (low / 4 < s->count && page < PAGES)
        set(m, &s->oneshot[low / 4], page, value);
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct oneshots *const s = m->state;
    const unsigned shot = pin - PIN_OUT;
    return unit < s->count && shot < SHOTS && s->oneshot[unit].shot[shot].runs ? SIM_HIGH : SIM_LOW;
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct oneshots *const s = m->state;
    const unsigned shot = pin - PIN_TRIGGER;
    if (unit < s->count && shot < SHOTS)
        s->oneshot[unit].shot[shot].line = level;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct oneshots *const s = m->state;
    int64_t edges = SIM_NEVER;
    for (unsigned i = 0; i < s->count; i++)
        edges = smaller(edges, rests(m->card, &s->oneshot[i], m->clk));
    return edges == SIM_NEVER ? SIM_NEVER : m->clk + edges;
}

const struct sim_module_ops sim_oneshot_ops = {
    .gtag = HM2_GTAG_ONESHOT,
    .name = "OneShot",
    .pages = PAGES,
    .state_size = sizeof(struct oneshots),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .input = input,
    .next_event = next_event,
};
