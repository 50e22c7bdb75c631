/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Whatever a card does must not depend on when it is looked at: two cards get the same accesses, one is advanced clock
 * by clock with every module looked at, the other only where something happens. */
#include "unit.h"

#include "firmware_card.h"
#include "random.h"
#include "sim_card.h"

#define EDGES_MAX 20000u

struct edges {
    unsigned count;
    struct {
        int64_t clk;
        unsigned watch;
        enum sim_level level;
    } edge[EDGES_MAX];
};

static void on_edge(void *const context, const int64_t clk, const unsigned ps, const unsigned watch,
                    const enum sim_level level)
{
    (void)ps;
    struct edges *const edges = context;
    assert_true(edges->count < EDGES_MAX);
    edges->edge[edges->count].clk = clk;
    edges->edge[edges->count].watch = watch;
    edges->edge[edges->count++].level = level;
}

static struct edges eager_edges, lazy_edges;

static struct sim_card *new_card(const char *const firmware, struct edges *const edges, const bool watched)
{
    struct sim_card *const card = firmware_card(firmware);
    edges->count = 0;
    if (!watched)
        return card;
    sim_card_on_edge(card, on_edge, edges);
    for (unsigned io = 0; io < sim_card_idrom(card)->pin_count; io++)
        if (sim_card_idrom(card)->pins[io].secondary_tag == HM2_GTAG_STEPGEN)
            assert_true(sim_card_watch_pad(card, io) >= 0);
    for (uint8_t pin = 0x82; sim_find(card, HM2_GTAG_DPLL) && pin <= 0x86; pin++)
        assert_true(sim_card_watch_output(card, HM2_GTAG_DPLL, 0, pin) >= 0);
    if (sim_find(card, HM2_GTAG_IRQ))
        assert_true(sim_card_watch_output(card, HM2_GTAG_IRQ, 0, 0x81) >= 0);
    return card;
}

static void look_at_everything(struct sim_card *const card)
{
    static const uint8_t tags[] = {HM2_GTAG_DPLL, HM2_GTAG_IRQ, HM2_GTAG_STEPGEN, HM2_GTAG_WATCHDOG};
    for (size_t i = 0; i < sizeof tags; i++)
        (void)sim_find(card, tags[i]);
}

static void advance_both(struct sim_card *const eager, struct sim_card *const lazy, const int64_t to)
{
    for (int64_t clk = sim_card_clock(eager) + 1; clk <= to; clk++) {
        sim_card_advance(eager, clk);
        look_at_everything(eager);
    }
    sim_card_advance(lazy, to);
}

static uint32_t small(struct random *const r)
{
    return random_below(r, 40);
}

static uint32_t fast_rate(struct random *const r)
{
    const uint32_t rate = 0x7FFFFFFFu >> random_below(r, 10);
    return random_below(r, 2) ? rate : 0u - rate;
}

static uint32_t any(struct random *const r)
{
    return (uint32_t)random_u64(r);
}

static uint32_t full(struct random *const r)
{
    return random_below(r, 4) ? 0xFFFFFFFFu : any(r);
}

static uint32_t control0(struct random *const r)
{
    return (1 + random_below(r, 12)) << 24 | 0x400000;
}

static uint32_t control1(struct random *const r)
{
    return (1 + random_below(r, 12)) << 16;
}

static uint32_t source(struct random *const r)
{
    return random_below(r, 5) << 2 | 2u | random_below(r, 2);
}

static uint32_t timer_select(struct random *const r)
{
    return random_below(r, 6) << 12 | (random_below(r, 3) ? 0x8000u : 0);
}

static uint32_t bite_time(struct random *const r)
{
    return random_below(r, 2) ? 0x80000000u : random_below(r, 900);
}

static const struct {
    uint16_t address, stride;
    uint32_t (*value)(struct random *r);
} registers[] = {
    {0x2000, 4, fast_rate},    {0x2100, 4, any},       {0x2200, 4, any},      {0x2300, 4, small}, {0x2400, 4, small},
    {0x2500, 4, small},        {0x2600, 4, small},     {0x2700, 4, any},      {0x2800, 4, any},   {0x2900, 0, full},
    {0x2A00, 0, timer_select}, {0x1000, 4, any},       {0x1100, 4, full},     {0x1200, 4, full},  {0x1300, 4, any},
    {0x1400, 4, any},          {0x0C00, 0, bite_time}, {0x0D00, 0, any},      {0x0E00, 0, any},   {0x7000, 0, full},
    {0x7100, 0, any},          {0x7200, 0, control0},  {0x7300, 0, control1}, {0x7400, 0, any},   {0x7500, 0, any},
    {0x7600, 0, any},          {0x0A00, 0, source},    {0x0B00, 0, any},
};

#define REGISTERS (sizeof registers / sizeof *registers)

static void write_both(struct sim_card *const eager, struct sim_card *const lazy, struct random *const r,
                       const size_t reg)
{
    const uint16_t address = (uint16_t)(registers[reg].address + registers[reg].stride * random_below(r, 3));
    const uint32_t value = registers[reg].value(r);
    const int64_t clk = sim_card_clock(eager);
    sim_card_write(eager, clk, address, value);
    look_at_everything(eager);
    sim_card_write(lazy, clk, address, value);
}

static void read_both(struct sim_card *const eager, struct sim_card *const lazy, struct random *const r,
                      const unsigned seed)
{
    const size_t reg = random_below(r, REGISTERS);
    const uint16_t address = (uint16_t)(registers[reg].address + registers[reg].stride * random_below(r, 3));
    const int64_t clk = sim_card_clock(eager);
    uint32_t floats = 0, lazy_floats = 0;
    const uint32_t a = sim_card_read(eager, clk, address, &floats);
    const uint32_t b = sim_card_read(lazy, clk, address, &lazy_floats);
    if (a != b || floats != lazy_floats)
        fail_msg("seed %u: %04X at clk %lld reads %08X, when advanced at once %08X", seed, address, (long long)clk, a,
                 b);
}

static void compare_edges(const unsigned seed)
{
    for (unsigned i = 0; i < eager_edges.count && i < lazy_edges.count; i++)
        if (eager_edges.edge[i].clk != lazy_edges.edge[i].clk ||
            eager_edges.edge[i].watch != lazy_edges.edge[i].watch ||
            eager_edges.edge[i].level != lazy_edges.edge[i].level)
            fail_msg("seed %u: edge %u: watch %u at clk %lld, when advanced at once watch %u at %lld", seed, i,
                     eager_edges.edge[i].watch, (long long)eager_edges.edge[i].clk, lazy_edges.edge[i].watch,
                     (long long)lazy_edges.edge[i].clk);
    assert_int_equal(eager_edges.count, lazy_edges.count);
}

static void play(const char *const firmware, const unsigned seed)
{
    struct random r = {seed};
    const bool watched = seed % 3 == 0;
    struct sim_card *const eager = new_card(firmware, &eager_edges, watched);
    struct sim_card *const lazy = new_card(firmware, &lazy_edges, watched);
    for (size_t reg = 0; reg < REGISTERS; reg++)
        write_both(eager, lazy, &r, reg);
    for (unsigned i = 0; i < 40; i++) {
        advance_both(eager, lazy, sim_card_clock(eager) + random_below(&r, 1u << random_below(&r, 9)));
        for (unsigned reads = random_below(&r, 4); reads > 0; reads--)
            read_both(eager, lazy, &r, seed);
        write_both(eager, lazy, &r, random_below(&r, REGISTERS));
    }
    compare_edges(seed);
    sim_card_free(eager);
    sim_card_free(lazy);
}

static void an_old_stepper_card_does_the_same_at_every_pace(void **state)
{
    (void)state;
    for (unsigned seed = 0; seed < 400; seed++)
        play("SVST4_4_48", seed);
}

static void an_old_card_with_dpll_and_interrupt_does_the_same_at_every_pace(void **state)
{
    (void)state;
    for (unsigned seed = 0; seed < 400; seed++)
        play("7I76E_51", seed);
}

static void a_new_card_with_latched_positions_does_the_same_at_every_pace(void **state)
{
    (void)state;
    for (unsigned seed = 0; seed < 400; seed++)
        play(NULL, seed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_old_stepper_card_does_the_same_at_every_pace),
        cmocka_unit_test(an_old_card_with_dpll_and_interrupt_does_the_same_at_every_pace),
        cmocka_unit_test(a_new_card_with_latched_positions_does_the_same_at_every_pace),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
