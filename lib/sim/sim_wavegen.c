/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* WaveGen, tag 14: a table played as pulse density, clocked by ClockHigh (register map 3.21, traces in folder
 * wavegen). No register can be read. */
#include "high_clock.h"
#include "sim_card.h"

#define INSTANCES_MAX 8u
#define TABLE_WORDS   1024u
#define TOP           0x100000000 /* of the 33 bits that step through the table */
#define RATE_MASK     0x1FFFFFFFF
#define DENSITY_TOP   0x1000u
#define DENSITY_MASK  0x0FFFu
#define DIVIDER_TOP   0x80u /* of the 8 bits that divide the clock of the pulses */
#define TRIGGER_SHIFT 12
#define PIN_A         0x81u
#define PIN_B         0x82u
#define PIN_TRIGGER0  0x83u
#define TRIGGERS      4u

enum { PAGE_RATE, PAGE_DIVIDER, PAGE_LENGTH, PAGE_POINTER, PAGE_DATA, PAGES };

/* A register that two flip-flops bring to ClockHigh. */
struct load {
    uint32_t next, value;
    bool asked, first, second;
};

struct channel {
    struct load rate, divider, length, data;
    uint64_t accum;
    uint16_t address; /* that the host writes to */
    uint16_t at, accum_density;
    uint16_t word; /* of the table, one edge late */
    uint8_t count, triggers;
    bool old_top, store, storing;
    uint16_t table[TABLE_WORDS];
};

struct wavegen {
    unsigned count;
    int64_t edges; /* of ClockHigh that have been made */
    struct channel channels[INSTANCES_MAX];
};

static void ask(struct load *const l, const uint32_t value)
{
    l->next = value;
    l->asked = !l->second;
}

/* Returns whether the value was taken over at this edge. */
static bool load_edge(struct load *const l)
{
    const bool takes = l->first && l->second;
    if (takes)
        l->value = l->next;
    l->second = l->first;
    l->first = l->asked;
    if (l->second)
        l->asked = false;
    return takes;
}

static bool idle(const struct load *const l)
{
    return !l->asked && !l->first && !l->second;
}

static void edge(struct channel *const c)
{
    const bool top = c->accum & TOP;
    if (c->count & DIVIDER_TOP) {
        c->accum_density = (uint16_t)((c->accum_density & DENSITY_MASK) + (c->word & DENSITY_MASK));
        c->count = (uint8_t)c->divider.value;
    } else {
        c->count--;
    }
    c->triggers = (uint8_t)(c->word >> TRIGGER_SHIFT);
    if (c->storing)
        c->table[c->address] = (uint16_t)c->data.value;
    c->word = c->table[c->at];
    if (top != c->old_top)
        c->at = c->at >= c->length.value ? 0 : c->at + 1u;
    c->old_top = top;
    c->accum = (c->accum + c->rate.value) & RATE_MASK;
    c->storing = c->store;
    c->store = load_edge(&c->data);
    (void)load_edge(&c->rate);
    (void)load_edge(&c->divider);
    (void)load_edge(&c->length);
}

/* Nothing but the divider moves. */
static bool quiet(const struct channel *const c)
{
    return c->rate.value == 0 && (c->word & DENSITY_MASK) == 0 && c->word == c->table[c->at] &&
           c->triggers == c->word >> TRIGGER_SHIFT && !c->store && !c->storing &&
           c->old_top == ((c->accum & TOP) != 0) && idle(&c->rate) && idle(&c->divider) && idle(&c->length) &&
           idle(&c->data);
}

static void run(struct channel *const c, int64_t edges)
{
    const int64_t cycle = c->divider.value & DIVIDER_TOP ? 1 : (int64_t)c->divider.value + 2;
    for (; edges > 0; edges--) {
        if (edges >= 2 * cycle && c->count == (uint8_t)c->divider.value && quiet(c))
            edges = edges % cycle + cycle;
        edge(c);
    }
}

static void run_to(struct wavegen *const s, const int64_t end)
{
    for (unsigned i = 0; i < s->count && end > s->edges; i++)
        run(&s->channels[i], end - s->edges);
    s->edges = end > s->edges ? end : s->edges;
}

static int init(struct sim_module *const m)
{
    struct wavegen *const s = m->state;
    if (sim_clock_low_hz(m->card) == 0 || sim_clock_high_hz(m->card) == 0)
        return HM2_ERR_RANGE;
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct wavegen *const s = m->state;
    s->edges = sim_high_edges(m->card, m->clk, false);
    for (unsigned i = 0; i < s->count; i++)
        s->channels[i] = (struct channel){0};
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    run_to(m->state, sim_high_edges(m->card, clk, false));
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    (void)m;
    (void)page;
    (void)low;
    *undriven = UINT32_MAX;
    return 0;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct wavegen *const s = m->state;
    run_to(s, sim_high_edges(m->card, m->clk, true));
    if (low / 4 >= s->count)
        return;
    struct channel *const c = &s->channels[low / 4];
    if (page == PAGE_RATE)
        ask(&c->rate, value);
    else if (page == PAGE_DIVIDER)
        ask(&c->divider, value & 0xFFu);
    else if (page == PAGE_LENGTH)
        ask(&c->length, value & (TABLE_WORDS - 1u));
    else if (page == PAGE_POINTER)
        c->address = value & (TABLE_WORDS - 1u);
    else if (page == PAGE_DATA)
        ask(&c->data, value & 0xFFFFu);
}

static bool level_of(const struct channel *const c, const uint8_t pin)
{
    const bool density = c->accum_density & DENSITY_TOP;
    if (pin == PIN_A || pin == PIN_B)
        return density == (pin == PIN_A);
    return pin >= PIN_TRIGGER0 && pin < PIN_TRIGGER0 + TRIGGERS && (c->triggers >> (pin - PIN_TRIGGER0) & 1u);
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct wavegen *const s = m->state;
    return unit < s->count && level_of(&s->channels[unit], pin) ? SIM_HIGH : SIM_LOW;
}

static void trace(struct sim_module *const m, const unsigned unit, const uint8_t pin, const int64_t from,
                  const int64_t to, void (*const report)(void *context, int64_t clk, unsigned ps, enum sim_level level),
                  void *const context)
{
    const struct wavegen *const s = m->state;
    (void)from;
    if (unit >= s->count)
        return;
    struct channel c = s->channels[unit];
    const int64_t end = sim_high_edges(m->card, to, false);
    for (int64_t j = s->edges; j < end; j++) {
        const bool before = level_of(&c, pin);
        edge(&c);
        unsigned ps = 0;
        if (level_of(&c, pin) == before)
            continue;
        const int64_t clk = sim_low_edge(m->card, j, &ps);
        report(context, clk, ps, before ? SIM_LOW : SIM_HIGH);
    }
}

void sim_wavegen_start(struct sim_card *const card, const unsigned wavegen, const uint16_t value,
                       const uint16_t density, const uint8_t edges)
{
    struct sim_module *const m = sim_find(card, HM2_GTAG_WAVEGEN);
    struct wavegen *const s = m ? m->state : NULL;
    if (!s || wavegen >= s->count)
        return;
    struct channel *const c = &s->channels[wavegen];
    for (unsigned i = 0; i < TABLE_WORDS; i++)
        c->table[i] = value;
    c->word = value;
    c->accum_density = density & DENSITY_MASK;
    c->count = edges;
}

const struct sim_module_ops sim_wavegen_ops = {
    .gtag = HM2_GTAG_WAVEGEN,
    .name = "WaveGen",
    .pages = PAGES,
    .state_size = sizeof(struct wavegen),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .trace = trace,
};
