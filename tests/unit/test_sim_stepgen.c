/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "firmware_card.h"
#include "idrom_files.h"
#include "random.h"
#include "sim_card.h"
#include "stepgen_latch.h"
#include "stepgen_logic.h"
#include "trace_folder.h"

static void every_recorded_read_and_edge_is_matched(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("stepgen");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 43);
    const struct replay_totals with_index = replay_data("stepgen_v3");
    assert_int_equal(with_index.failed, 0);
    assert_int_equal(with_index.passed, 15);
}

/* ---- closed form against clock by clock ---------------------------------------------------------------------------
 */

struct pair {
    struct sim_rategen fast_rate, slow_rate;
    struct sim_stepgen fast, slow;
};

static void assert_same(const struct pair *const p, const unsigned seed)
{
    if (p->fast.accum == p->slow.accum && p->fast.travel == p->slow.travel &&
        sim_stepgen_outputs(&p->fast) == sim_stepgen_outputs(&p->slow) && p->fast.table_ptr == p->slow.table_ptr &&
        p->fast_rate.accum == p->slow_rate.accum)
        return;
    fail_msg("seed %u: accum %012llX, clock by clock %012llX; outputs %02X, %02X; table %u, %u", seed,
             (unsigned long long)p->fast.accum, (unsigned long long)p->slow.accum, sim_stepgen_outputs(&p->fast),
             sim_stepgen_outputs(&p->slow), p->fast.table_ptr, p->slow.table_ptr);
}

static void run_both(struct pair *const p, const int64_t edges, const unsigned seed)
{
    sim_stepgen_run(&p->fast, &p->fast_rate, edges);
    sim_rategen_run(&p->fast_rate, edges);
    const int64_t silent = sim_stepgen_silent(&p->slow, &p->slow_rate);
    const unsigned outputs = sim_stepgen_outputs(&p->slow);
    for (int64_t i = 0; i < edges; i++) {
        sim_stepgen_edge(&p->slow, p->slow_rate.tick, NULL);
        sim_rategen_run(&p->slow_rate, 1);
        if (i < silent && sim_stepgen_outputs(&p->slow) != outputs)
            fail_msg("seed %u: an output changed at edge %lld, %lld were to be silent", seed, (long long)i,
                     (long long)silent);
    }
    assert_same(p, seed);
}

static void write_both(struct pair *const p, const enum sim_stepgen_reg reg, const uint32_t value)
{
    const struct sim_stepgen_write write = {.reg = reg, .value = value};
    sim_stepgen_edge(&p->fast, p->fast_rate.tick, &write);
    sim_stepgen_edge(&p->slow, p->slow_rate.tick, &write);
    sim_rategen_run(&p->fast_rate, 1);
    sim_rategen_run(&p->slow_rate, 1);
}

static void write_basic_rate_both(struct pair *const p, const uint32_t value)
{
    sim_stepgen_edge(&p->fast, p->fast_rate.tick, NULL);
    sim_stepgen_edge(&p->slow, p->slow_rate.tick, NULL);
    sim_rategen_load(&p->fast_rate, value);
    sim_rategen_load(&p->slow_rate, value);
}

static uint32_t random_rate(struct random *const r)
{
    const uint32_t size = random_below(r, 3) == 0 ? random_magnitude(r) : 0x7FFFFFFFu >> random_below(r, 14);
    return random_below(r, 2) ? size - random_below(r, 5) : 0u - size + random_below(r, 5);
}

static uint32_t random_value(struct random *const r, const enum sim_stepgen_reg reg)
{
    switch (reg) {
    case SIM_STEPGEN_RATE:
        return random_rate(r);
    case SIM_STEPGEN_DIR_SETUP:
    case SIM_STEPGEN_DIR_HOLD:
    case SIM_STEPGEN_PULSE_ACTIVE:
    case SIM_STEPGEN_PULSE_IDLE:
        return random_below(r, 4) ? random_below(r, 30) : (uint32_t)random_u64(r) >> random_below(r, 31);
    case SIM_STEPGEN_ACCUM:
    case SIM_STEPGEN_MODE:
    case SIM_STEPGEN_TABLE:
    case SIM_STEPGEN_TABLE_MAX:
    case SIM_STEPGEN_REGS:
        break;
    }
    return (uint32_t)random_u64(r);
}

static void random_write(struct pair *const p, struct random *const r)
{
    const uint32_t basic = random_below(r, 2) ? 0xFFFFFFFFu : random_below(r, 2) ? 0x80000000u : random_magnitude(r);
    if (random_below(r, 10) == 0)
        write_basic_rate_both(p, basic);
    else if (random_below(r, 2))
        write_both(p, SIM_STEPGEN_RATE, random_rate(r));
    else {
        const enum sim_stepgen_reg reg = (enum sim_stepgen_reg)random_below(r, SIM_STEPGEN_REGS);
        write_both(p, reg, random_value(r, reg));
    }
}

static void any_run_in_closed_form_equals_the_same_run_clock_by_clock(void **state)
{
    (void)state;
    for (unsigned seed = 0; seed < 4000; seed++) {
        struct random r = {seed};
        struct pair p = {0};
        write_basic_rate_both(&p, random_below(&r, 4) ? 0xFFFFFFFFu : random_magnitude(&r));
        for (enum sim_stepgen_reg reg = SIM_STEPGEN_RATE; reg < SIM_STEPGEN_REGS; reg++)
            write_both(&p, reg, random_value(&r, reg));
        for (unsigned i = 0; i < 12; i++) {
            run_both(&p, 1 + random_below(&r, 1u << random_below(&r, 12)), seed);
            random_write(&p, &r);
        }
    }
}

/* The DDS leaves out one tick in 2^32 - rate; start just before such a place, at full speed and held by the timers. */
static void a_tick_that_the_master_dds_leaves_out_is_left_out_in_closed_form_too(void **state)
{
    (void)state;
    for (unsigned seed = 0; seed < 300; seed++) {
        struct random r = {seed};
        struct pair p = {.slow_rate = {.accum = random_below(&r, 3000),
                                       .rate = 0xFFFFFFFFu - random_below(&r, 3),
                                       .old_msb = true,
                                       .tick = true}};
        p.fast_rate = p.slow_rate;
        write_both(&p, SIM_STEPGEN_PULSE_ACTIVE, random_below(&r, 5));
        write_both(&p, SIM_STEPGEN_PULSE_IDLE, random_below(&r, 5));
        write_both(&p, SIM_STEPGEN_RATE, random_rate(&r));
        run_both(&p, 2000 + random_below(&r, 3000), seed);
        run_both(&p, 1 + random_below(&r, 30), seed);
    }
}

/* ---- cost ---------------------------------------------------------------------------------------------------------
 */

/* A second of ten million steps; clock by clock this loop would take minutes. */
static void a_second_at_ten_million_steps_costs_nearly_nothing(void **state)
{
    (void)state;
    struct pair p = {0};
    write_basic_rate_both(&p, 0xFFFFFFFFu);
    write_both(&p, SIM_STEPGEN_PULSE_ACTIVE, 3);
    write_both(&p, SIM_STEPGEN_PULSE_IDLE, 2);
    write_both(&p, SIM_STEPGEN_RATE, 0x19999999); /* 0.1 steps a clock; the timers allow a step in 9 clocks */
    const uint64_t before = p.fast.accum;
    for (int second = 0; second < 100; second++) {
        sim_stepgen_run(&p.fast, &p.fast_rate, 100000000);
        sim_rategen_run(&p.fast_rate, 100000000);
    }
    assert_true(p.fast.accum != before);
    assert_true(p.fast.travel >> 32 > 999999800 && p.fast.travel >> 32 < 1000000000);
}

static void a_saturated_second_keeps_the_period_of_the_timers(void **state)
{
    (void)state;
    struct pair p = {0};
    write_basic_rate_both(&p, 0xFFFFFFFFu);
    write_both(&p, SIM_STEPGEN_PULSE_ACTIVE, 5);
    write_both(&p, SIM_STEPGEN_PULSE_IDLE, 10);
    write_both(&p, SIM_STEPGEN_RATE, 0x7FFFFFFF);
    for (int second = 0; second < 100; second++) {
        sim_stepgen_run(&p.fast, &p.fast_rate, 100000000);
        sim_rategen_run(&p.fast_rate, 100000000);
    }
    const int64_t steps = p.fast.travel >> 32;
    assert_true(steps >= 10000000000 / 19 - 30 && steps <= 10000000000 / 19 + 1);
}

/* ---- new map: positions latched by a DPLL timer -------------------------------------------------------------------
 */

#define RATE        0x2000
#define ACCUM       0x2100
#define MODE        0x2200
#define MASTER_DDS  0x2900
#define DPLL_SELECT 0x2A00

static void start_motion_and_timers(struct sim_card *const card)
{
    sim_card_write(card, 10, MASTER_DDS, 0xFFFFFFFF);
    sim_card_write(card, 11, RATE, 0x00123456);
    sim_card_write(card, 12, RATE + 4, 0xFF876543);
    sim_card_write(card, 13, 0x7200, 1u << 24);
    sim_card_write(card, 14, 0x7400, 0x40008000); /* timers a quarter and half a period early */
    sim_card_write(card, 15, 0x7500, 0xC0000100);
    sim_card_write(card, 300, 0x7000, 0xFFFFFFFF); /* period 1024 clocks */
}

static bool timer_level(struct sim_card *const card, const uint32_t select)
{
    const unsigned timer = select >> 12 & 7u;
    struct sim_module *const dpll = sim_find(card, HM2_GTAG_DPLL);
    return dpll->ops->output(dpll, 0, (uint8_t)(0x82 + (timer <= 4 ? timer : 0))) == SIM_HIGH;
}

/* The firmware keeps the read-back in a register of its own: each clock while the select is off, else at the edge that
 * sees the selected timer high and saw it (or the timer selected before) low one edge earlier. */
static void a_latched_position_is_that_of_the_edge_after_the_timer_rose(void **state)
{
    (void)state;
    struct random r = {1};
    struct sim_card *const card = firmware_card(NULL);
    start_motion_and_timers(card);
    uint32_t select = 0, latched[2] = {0};
    bool was_high = timer_level(card, select);
    unsigned held = 0;
    for (int64_t clk = sim_card_clock(card); clk < 60000; clk++) {
        const bool high = timer_level(card, select);
        const bool sample = (high && !was_high) || !(select & 0x8000);
        for (unsigned i = 0; i < 2 && sample; i++)
            latched[i] = (uint32_t)(sim_stepgen_position(card, i) >> 16);
        held += !sample;
        was_high = high;
        if (random_below(&r, 400) == 0) {
            select = (random_below(&r, 8) << 12) | (random_below(&r, 4) ? 0x8000u : 0);
            sim_card_write(card, clk, DPLL_SELECT, select | 0xFFFF0FFF);
        } else {
            sim_card_advance(card, clk + 1);
        }
        if (random_below(&r, 3))
            continue;
        assert_int_equal(sim_card_read(card, clk + 1, ACCUM, NULL), latched[0]);
        assert_int_equal(sim_card_read(card, clk + 1, ACCUM + 4, NULL), latched[1]);
        assert_int_equal(sim_card_read(card, clk + 1, DPLL_SELECT, NULL), select);
    }
    assert_true(held > 10000);
    sim_card_free(card);
}

static void the_select_register_is_not_there_without_a_dpll(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card("SVST4_4_48");
    uint32_t undriven = 0;
    sim_card_read(card, 10, DPLL_SELECT, &undriven);
    assert_int_equal(undriven, 0xFFFFFFFF);
    sim_card_read(card, 10, ACCUM + 16, &undriven); /* a fifth generator */
    assert_int_equal(undriven, 0xFFFFFFFF);
    sim_card_free(card);
}

/* ---- index and probe ----------------------------------------------------------------------------------------------
 */

static void a_filter_run_in_closed_form_equals_the_same_run_clock_by_clock(void **state)
{
    (void)state;
    static const uint8_t versions[] = {0x03, 0xC2};
    for (unsigned seed = 0; seed < 400; seed++) {
        struct random r = {seed};
        const struct sim_latch_kind *const kind = sim_latch_kind(versions[seed & 1]);
        struct sim_latch_filter fast = {0}, slow = {0};
        for (unsigned i = 0; i < 40; i++) {
            fast.level = slow.level = random_below(&r, 2);
            int64_t edges = 1 + random_below(&r, random_below(&r, 2) ? 300 : 20);
            for (int64_t k = 0; k < edges; k++)
                sim_latch_edge(&slow, kind);
            while (edges > 0) {
                const int64_t quiet = sim_latch_quiet(&fast, kind) < edges ? sim_latch_quiet(&fast, kind) : edges;
                sim_latch_run_quiet(&fast, kind, quiet);
                edges -= quiet;
                if (edges-- > 0)
                    sim_latch_edge(&fast, kind);
            }
            assert_memory_equal(&fast, &slow, sizeof fast);
        }
    }
}

#define INDEX_PIN 0x09
#define PROBE_PIN 0x0A

/* The 7I96S's firmware as it would be with index inputs: version 0xC2 of the step generator. */
static struct sim_card *new_c2(void)
{
    struct hm2_image image;
    load_image(IDROM_7I96S, &image);
    for (unsigned i = 0; i < HM2_IDROM_WORDS; i++)
        if (image.rom[i] == 0x05010205)
            image.rom[i] = 0x0501C205;
    const struct sim_card_options options = {.profile = "7i96s", .image = &image};
    struct sim_card *card = NULL;
    struct hm2_diag diag = {0};
    assert_int_equal(sim_card_new(&card, &options, &diag), 0);
    sim_card_write(card, 10, MASTER_DDS, 0xFFFFFFFF);
    sim_card_write(card, 11, RATE, 0x01000000);
    return card;
}

static void version_c2_latches_the_position_once_at_a_filtered_rising_index(void **state)
{
    (void)state;
    struct sim_card *const card = new_c2();
    uint32_t undriven = 0;
    sim_card_write(card, 600, MODE, 0x30); /* latch on index, rising */
    assert_int_equal(sim_card_drive_input(card, 1000, HM2_GTAG_STEPGEN, 0, INDEX_PIN, SIM_HIGH), 0);
    assert_int_equal(sim_card_drive_input(card, 1200, HM2_GTAG_STEPGEN, 0, INDEX_PIN, SIM_LOW), 0); /* too short */
    assert_int_equal(sim_card_read(card, 2000, MODE, &undriven), 0x00000030);
    assert_int_equal(undriven, 0);
    assert_int_equal(sim_card_drive_input(card, 3000, HM2_GTAG_STEPGEN, 0, INDEX_PIN, SIM_HIGH), 0);
    /* Edges 3001 to 3255 count to 255; 3256 settles, 3257 latches what the edges before it made. */
    sim_card_advance(card, 3257);
    const uint32_t at_latch = (uint32_t)(sim_stepgen_position(card, 0) >> 16);
    assert_int_equal(sim_card_read(card, 3257, MODE, NULL), 0x00000030);
    assert_int_equal(sim_card_read(card, 3258, MODE, NULL), (at_latch & 0xFFFFFF00) | 0x20);
    assert_int_equal(sim_card_read(card, 9000, MODE, NULL), (at_latch & 0xFFFFFF00) | 0x20);
    sim_card_free(card);
}

static void one_probe_latches_every_generator_that_is_armed(void **state)
{
    (void)state;
    struct sim_card *const card = new_c2();
    sim_card_write(card, 12, RATE + 4, 0x02000000);
    assert_int_equal(sim_card_drive_input(card, 20, HM2_GTAG_STEPGEN, 0, PROBE_PIN, SIM_HIGH), 0);
    sim_card_write(card, 900, MODE, 0x40); /* falling */
    sim_card_write(card, 901, MODE + 4, 0x40);
    assert_int_equal(sim_card_drive_input(card, 1000, HM2_GTAG_STEPGEN, 0, PROBE_PIN, SIM_LOW), 0);
    sim_card_advance(card, 1257);
    const uint32_t first = (uint32_t)(sim_stepgen_position(card, 0) >> 16) & 0xFFFFFF00;
    const uint32_t second = (uint32_t)(sim_stepgen_position(card, 1) >> 16) & 0xFFFFFF00;
    assert_int_equal(sim_card_read(card, 5000, MODE, NULL), first);
    assert_int_equal(sim_card_read(card, 5001, MODE + 4, NULL), second);
    assert_int_equal(sim_card_read(card, 5002, MODE + 8, NULL), 0);
    sim_card_free(card);
}

static void version_c2_swaps_the_outputs(void **state)
{
    (void)state;
    struct sim_card *const card = new_c2();
    sim_card_write(card, 20, RATE, 0xFFFFFFFF); /* backwards, too slow to make a step here */
    sim_card_advance(card, 30);
    struct sim_module *const m = sim_find(card, HM2_GTAG_STEPGEN);
    assert_int_equal(m->ops->output(m, 0, 0x82), SIM_HIGH);
    sim_card_write(card, 40, MODE, 0x04);
    assert_int_equal(m->ops->output(m, 0, 0x82), SIM_LOW);
    assert_int_equal(m->ops->output(m, 0, 0x81), SIM_HIGH);
    sim_card_free(card);
}

/* ---- 64-bit position for followers --------------------------------------------------------------------------------
 */

static void the_followers_position_goes_on_where_the_register_wraps(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card(NULL);
    sim_card_write(card, 10, MASTER_DDS, 0xFFFFFFFF);
    sim_card_write(card, 11, RATE, 0x40000000);
    sim_card_advance(card, 400011);
    assert_true(sim_stepgen_position(card, 0) >> 32 > 99990 && sim_stepgen_position(card, 0) >> 32 <= 100000);
    sim_card_write(card, 400012, ACCUM, 0);
    assert_true(sim_stepgen_position(card, 0) >> 32 > 99990); /* the register jumps, the machine does not */
    assert_int_equal(sim_stepgen_position(card, 7), 0);       /* there is no such generator */
    sim_card_free(card);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_read_and_edge_is_matched),
        cmocka_unit_test(any_run_in_closed_form_equals_the_same_run_clock_by_clock),
        cmocka_unit_test(a_tick_that_the_master_dds_leaves_out_is_left_out_in_closed_form_too),
        cmocka_unit_test(a_second_at_ten_million_steps_costs_nearly_nothing),
        cmocka_unit_test(a_saturated_second_keeps_the_period_of_the_timers),
        cmocka_unit_test(a_latched_position_is_that_of_the_edge_after_the_timer_rose),
        cmocka_unit_test(the_select_register_is_not_there_without_a_dpll),
        cmocka_unit_test(a_filter_run_in_closed_form_equals_the_same_run_clock_by_clock),
        cmocka_unit_test(version_c2_latches_the_position_once_at_a_filtered_rising_index),
        cmocka_unit_test(one_probe_latches_every_generator_that_is_armed),
        cmocka_unit_test(version_c2_swaps_the_outputs),
        cmocka_unit_test(the_followers_position_goes_on_where_the_register_wraps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
