/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Simulated resolvers, the driver on them, and six position loops over a 7I49. */
#include "unit.h"

#include <math.h>

#include "sim_bench.h"
#include "sim_card.h"
#include "trace_folder.h"

#define CHANNELS 6u
#define PREFIX   "hm2_7i93.0."

static void every_recorded_test_is_matched(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("resolver");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 18);
}

/* ---- a card with a 7I49 --------------------------------------------------------------------------------------------
 */

static struct sim_bench *new_bench(void)
{
    return sim_bench_new("7i93_sv6_7i49", NULL, "");
}

static double get(const struct sim_bench *bench, const char *format, unsigned number)
{
    char name[96] = PREFIX;
    int err;
    (void)snprintf(name + strlen(name), sizeof name - strlen(name), format, number);
    const double value = hm2_plain_get(bench->plain, name, &err);
    if (err)
        fail_msg("no point %s", name);
    return value;
}

static void set(const struct sim_bench *bench, const char *format, unsigned number, double value)
{
    char name[96] = PREFIX;
    (void)snprintf(name + strlen(name), sizeof name - strlen(name), format, number);
    if (hm2_plain_set(bench->plain, name, value))
        fail_msg("no point %s", name);
}

static void run(struct sim_bench *bench, unsigned cycles)
{
    for (unsigned i = 0; i < cycles; i++)
        sim_bench_cycle(bench);
}

static void attach(struct sim_bench *bench, unsigned channel, const struct sim_resolver *resolver)
{
    assert_int_equal(sim_card_resolver(bench->card, channel, resolver), 0);
}

/* A motor that makes 20 turns a second at full output, and its amplifier. */
static void attach_motor(struct sim_bench *bench, unsigned channel, double turns)
{
    const struct sim_resolver motor = {.amplitude = 0.9, .turns = turns, .turns_per_s = 20, .pwmgen = channel};
    attach(bench, channel, &motor);
    set(bench, "pwmgen.%02u.scale", channel, 10);
    set(bench, "pwmgen.%02u.enable", channel, 1);
}

static double truth(struct sim_bench *bench, unsigned channel)
{
    double turns;
    assert_int_equal(sim_card_resolver_turns(bench->card, channel, &turns), 0);
    return turns;
}

static void assert_near(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance))
        fail_msg("%.9g is not within %g of %.9g", value, tolerance, expected);
}

static void angles_are_read_and_missing_resolvers_are_errors(void **state)
{
    (void)state;
    struct sim_bench *const bench = new_bench();
    attach(bench, 1, &(struct sim_resolver){.amplitude = 0.9, .turns = 0.3});
    attach(bench, 4, &(struct sim_resolver){.amplitude = 0.5, .turns = -0.2});
    run(bench, 40);
    assert_near(get(bench, "resolver.%02u.angle", 1), 0.3, 0.0002);
    assert_near(get(bench, "resolver.%02u.angle", 4), 0.8, 0.0002);
    for (unsigned i = 0; i < CHANNELS; i++)
        assert_true(get(bench, "resolver.%02u.error", i) == (i != 1 && i != 4));
    attach(bench, 1, &(struct sim_resolver){.amplitude = 0.03, .turns = 0.3});
    run(bench, 3);
    assert_true(get(bench, "resolver.%02u.error", 1) == 1);
    assert_true(get(bench, "resolver.%02u.velocity", 1) == 0);
    attach(bench, 1, &(struct sim_resolver){.amplitude = 0.9, .turns = 0.35});
    run(bench, 40);
    assert_true(get(bench, "resolver.%02u.error", 1) == 0);
    assert_near(get(bench, "resolver.%02u.angle", 1), 0.35, 0.0002);
    sim_bench_free(bench);
}

static void speed_is_the_same_at_every_excitation_frequency(void **state)
{
    (void)state;
    static const double khz[] = {-1, 2.5, 5, 10};
    struct sim_bench *const bench = new_bench();
    attach_motor(bench, 2, 0);
    run(bench, 40);
    set(bench, "pwmgen.%02u.value", 2, 4);
    for (size_t i = 0; i < sizeof khz / sizeof khz[0]; i++) {
        set(bench, "resolver.excitation-khz", 0, khz[i]);
        run(bench, 200);
        assert_near(get(bench, "resolver.%02u.velocity", 2), 8, 0.02);
        assert_near(get(bench, "resolver.%02u.velocity-rpm", 2), 480, 1.2);
        const double before = get(bench, "resolver.%02u.position", 2);
        run(bench, 500);
        assert_near(get(bench, "resolver.%02u.position", 2) - before, 4, 0.004);
    }
    sim_bench_free(bench);
}

static void an_index_is_found_at_the_whole_turn(void **state)
{
    (void)state;
    struct sim_bench *const bench = new_bench();
    attach_motor(bench, 0, 0.25);
    run(bench, 40);
    set(bench, "pwmgen.%02u.value", 0, -1);
    set(bench, "resolver.%02u.index-enable", 0, 1);
    run(bench, 100);
    assert_true(get(bench, "resolver.%02u.index-enable", 0) == 1);
    run(bench, 200);
    assert_true(get(bench, "resolver.%02u.index-enable", 0) == 0);
    set(bench, "pwmgen.%02u.value", 0, 0);
    run(bench, 40);
    assert_near(get(bench, "resolver.%02u.position", 0), truth(bench, 0), 0.0005);
    sim_bench_free(bench);
}

static void a_card_without_power_for_a_moment_starts_its_resolvers_again(void **state)
{
    (void)state;
    struct sim_bench *const bench = new_bench();
    uint32_t command;
    attach(bench, 3, &(struct sim_resolver){.amplitude = 0.9, .turns = 0.4});
    run(bench, 40);
    sim_card_power_cycle(bench->card);
    const int64_t clk = sim_card_clock(bench->card);
    assert_int_equal(sim_card_read(bench->card, clk + 1000, 0x3E00, NULL), 0);
    assert_int_equal(sim_card_read(bench->card, clk + 3000, 0x3E00, NULL), 0x3F);
    assert_int_equal(sim_card_read(bench->card, clk + 15000, 0x3E00, NULL), 0x37);
    sim_card_power_cycle(bench->card);
    sim_card_write(bench->card, clk + 15100, 0x3C00, 0x802); /* too early for its program: that takes its time */
    assert_int_equal(sim_card_read(bench->card, clk + 25000, 0x3E00, NULL), 0x3F);
    assert_int_equal(sim_card_read(bench->card, clk + 40000, 0x3E00, NULL), 0x37);
    sim_card_write(bench->card, clk + 45000, 0x3C00, 0x2000);
    command = sim_card_read(bench->card, clk + 60000, 0x3C00, NULL);
    assert_int_equal(command, 0x12);
    assert_near(sim_card_read(bench->card, clk + 4000000, 0x400C, NULL) / 4294967296.0, 0.4, 0.0002);
    sim_bench_free(bench);
}

/* ---- position loops ------------------------------------------------------------------------------------------------
 */

struct loop {
    double target, integral;
};

/* A controller of an axis: proportional and integral, volts for turns. */
static void control(struct sim_bench *bench, unsigned i, struct loop *loop)
{
    const double error = loop->target - get(bench, "resolver.%02u.position", i);
    const double volts = 15 * error + loop->integral;
    if (fabs(volts) < 10)
        loop->integral += 0.03 * error;
    set(bench, "pwmgen.%02u.value", i, fmax(-10, fmin(10, volts)));
}

static void six_position_loops_close_over_a_7i49(void **state)
{
    (void)state;
    static const double targets[CHANNELS] = {3, -2.5, 0.125, 10, -0.75, 1};
    struct sim_bench *const bench = new_bench();
    struct loop loops[CHANNELS];
    for (unsigned i = 0; i < CHANNELS; i++) {
        attach_motor(bench, i, 0.05 * i);
        loops[i] = (struct loop){.target = targets[i]};
    }
    run(bench, 60);
    for (unsigned cycle = 0; cycle < 5000; cycle++) {
        for (unsigned i = 0; i < CHANNELS; i++)
            control(bench, i, &loops[i]);
        run(bench, 1);
    }
    for (unsigned i = 0; i < CHANNELS; i++) {
        assert_near(get(bench, "resolver.%02u.position", i), targets[i], 0.0005);
        assert_near(truth(bench, i), targets[i], 0.001);
        assert_near(get(bench, "resolver.%02u.velocity", i), 0, 0.01);
    }
    sim_bench_free(bench);
}

/* ---- limits --------------------------------------------------------------------------------------------------------
 */

static void impossible_resolvers_are_refused(void **state)
{
    (void)state;
    struct sim_bench *const bench = new_bench();
    static const struct sim_resolver wrong[] = {
        {.amplitude = -0.1},
        {.amplitude = 1.1},
        {.amplitude = NAN},
        {.amplitude = 0.9, .turns = INFINITY},
        {.amplitude = 0.9, .turns = -2e6},
        {.amplitude = 0.9, .turns_per_s = NAN},
        {.amplitude = 0.9, .turns_per_s = 2e6},
    };
    const struct sim_resolver good = {.amplitude = 0.9}, driven = {.turns_per_s = 1, .pwmgen = 6};
    double turns;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        assert_int_equal(sim_card_resolver(bench->card, 0, &wrong[i]), HM2_ERR_RANGE);
    assert_int_equal(sim_card_resolver(bench->card, CHANNELS, &good), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_resolver(bench->card, 0, &driven), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_resolver_turns(bench->card, CHANNELS, &turns), HM2_ERR_NOTFOUND);
    sim_bench_free(bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_test_is_matched),
        cmocka_unit_test(angles_are_read_and_missing_resolvers_are_errors),
        cmocka_unit_test(speed_is_the_same_at_every_excitation_frequency),
        cmocka_unit_test(an_index_is_found_at_the_whole_turn),
        cmocka_unit_test(a_card_without_power_for_a_moment_starts_its_resolvers_again),
        cmocka_unit_test(six_position_loops_close_over_a_7i49),
        cmocka_unit_test(impossible_resolvers_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
