/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Simulated PWM generators against the recorded firmware, and skipped edges against edges made singly. */
#include "unit.h"

#include "firmware_card.h"
#include "pwm_logic.h"
#include "random.h"
#include "sim_card.h"
#include "trace_folder.h"

#define FIRMWARE "SVST8_4IM2_72"

static void the_recorded_generators_are_matched_at_every_edge_of_the_high_clock(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("pwmgen");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 109);
}

/* ---- skipped against single edges
 * --------------------------------------------------------------------------------------- */

static uint16_t any_rate(struct random *const r)
{
    static const uint16_t rates[] = {0, 1, 0x1234, 0x8000, 0xC000, 0xFFFE, 0xFFFF};
    return random_below(r, 3) ? rates[random_below(r, sizeof(rates) / sizeof(rates[0]))]
                              : (uint16_t)random_below(r, 0x10000);
}

static uint32_t any_value(struct random *const r)
{
    static const uint32_t values[] = {0, 1, 2, 0x1FF, 0x200, 0x7FF, 0x800, 0xFFE, 0xFFF};
    const uint32_t value =
        random_below(r, 3) ? values[random_below(r, sizeof(values) / sizeof(values[0]))] : random_below(r, 0x1000);
    return value << 16 | (random_below(r, 2) ? 0x80000000u : 0) | random_below(r, 0x10000);
}

static void write_any(struct random *const r, struct pwm_reference refs[2], struct pwm_channel channels[2])
{
    const unsigned what = random_below(r, 8);
    const uint32_t value = any_value(r), mode = random_below(r, 64);
    const uint16_t rate = any_rate(r);
    for (unsigned i = 0; i < 2; i++) {
        if (what < 4)
            pwm_value_write(&channels[i], value);
        else if (what < 6)
            pwm_mode_write(&channels[i], mode);
        else
            pwm_rate_write(what == 6 ? &refs[i].pwm : &refs[i].pdm, rate);
    }
}

static void skipped_edges_leave_the_same_state(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 400; seed++) {
        struct random r = {seed};
        struct pwm_reference refs[2] = {0};
        struct pwm_channel channels[2] = {0};
        for (unsigned op = 0; op < 40; op++) {
            write_any(&r, refs, channels);
            const int64_t n = random_below(&r, random_below(&r, 3) ? 12 : 9000);
            for (int64_t i = 0; i < n; i++) {
                pwm_channel_edge(&channels[0], &refs[0]);
                pwm_reference_edge(&refs[0]);
            }
            struct pwm_reference shared = refs[1];
            pwm_run(&shared, NULL, n);
            pwm_run(&refs[1], &channels[1], n);
            assert_memory_equal(&channels[0], &channels[1], sizeof(channels[0]));
            assert_memory_equal(&refs[0], &refs[1], sizeof(refs[0]));
            assert_memory_equal(&shared, &refs[1], sizeof(shared));
        }
    }
}

static void every_change_of_an_output_is_found(void **state)
{
    (void)state;
    unsigned changes = 0;
    for (uint64_t seed = 1; seed <= 300; seed++) {
        struct random r = {seed};
        struct pwm_reference refs[2] = {0};
        struct pwm_channel channels[2] = {0};
        for (unsigned op = 0; op < 30; op++) {
            write_any(&r, refs, channels);
            const enum pwm_pin pin = random_below(&r, 2) ? PWM_PIN_A : PWM_PIN_B;
            const int64_t n = random_below(&r, random_below(&r, 3) ? 12 : 9000);
            for (int64_t done = 0; done < n;) {
                const bool before = pwm_output(&channels[1], pin);
                const int64_t made = pwm_run_to_change(&refs[1], &channels[1], pin, n - done);
                assert_true(made >= 1 && made <= n - done);
                for (int64_t i = 0; i < made; i++) {
                    assert_int_equal(pwm_output(&channels[0], pin), before);
                    pwm_channel_edge(&channels[0], &refs[0]);
                    pwm_reference_edge(&refs[0]);
                }
                done += made;
                assert_int_equal(pwm_output(&channels[0], pin), pwm_output(&channels[1], pin));
                assert_memory_equal(&channels[0], &channels[1], sizeof(channels[0]));
                assert_true(done == n || pwm_output(&channels[1], pin) != before);
                changes += pwm_output(&channels[1], pin) != before;
            }
        }
    }
    assert_true(changes > 10000);
}

static void a_steady_stretch_ends_with_the_edge_that_changes_the_command(void **state)
{
    (void)state;
    unsigned changes = 0;
    for (uint64_t seed = 1; seed <= 200; seed++) {
        struct random r = {seed};
        struct pwm_reference refs[2] = {0};
        struct pwm_channel channels[2] = {0};
        for (unsigned op = 0; op < 30; op++) {
            write_any(&r, refs, channels);
            const int64_t n = random_below(&r, random_below(&r, 3) ? 12 : 9000);
            for (int64_t done = 0; done < n;) {
                const int32_t before = pwm_duty(&channels[0]);
                const int64_t made = pwm_run_steady(&refs[1], &channels[1], n - done);
                assert_true(made >= 1 && made <= n - done);
                for (int64_t i = 0; i < made; i++) {
                    assert_int_equal(pwm_duty(&channels[0]), before);
                    pwm_channel_edge(&channels[0], &refs[0]);
                    pwm_reference_edge(&refs[0]);
                }
                done += made;
                assert_memory_equal(&channels[0], &channels[1], sizeof(channels[0]));
                changes += pwm_duty(&channels[1]) != before;
            }
        }
    }
    assert_true(changes > 1000);
}

static void a_long_rest_is_skipped_as_many_short_ones(void **state)
{
    (void)state;
    struct pwm_reference refs[2] = {0};
    struct pwm_channel channels[2] = {0};
    for (unsigned i = 0; i < 2; i++) {
        pwm_rate_write(&refs[i].pwm, 0xFFFF);
        pwm_rate_write(&refs[i].pdm, 0xABCD);
        pwm_value_write(&channels[i], 0x03210000);
        pwm_mode_write(&channels[i], 0x07);
    }
    const int64_t long_rest = 3LL << 40; /* a quarter of an hour at 200 MHz, and more than is skipped at once */
    pwm_run(&refs[0], &channels[0], long_rest);
    for (int64_t done = 0; done < long_rest; done += 1LL << 30)
        pwm_run(&refs[1], &channels[1], 1LL << 30);
    assert_memory_equal(&channels[0], &channels[1], sizeof(channels[0]));
    assert_memory_equal(&refs[0], &refs[1], sizeof(refs[0]));
}

/* ---- behind the card
 * ---------------------------------------------------------------------------------------------------- */

struct seen {
    unsigned edges;
    int64_t last_clk;
    unsigned last_ps;
};

static void on_edge(void *const context, const int64_t clk, const unsigned ps, const unsigned watch,
                    const enum sim_level level)
{
    struct seen *const seen = context;
    (void)watch;
    (void)level;
    assert_true(clk > seen->last_clk || (clk == seen->last_clk && ps > seen->last_ps));
    seen->edges++;
    seen->last_clk = clk;
    seen->last_ps = ps;
}

static void start(struct sim_card *const card)
{
    sim_card_write(card, 12, 0x4200, 0xFFFF);
    sim_card_write(card, 15, 0x4104, 0x03);
    sim_card_write(card, 18, 0x4004, 0x02000000);
}

static void what_is_watched_does_not_depend_on_when_the_card_is_asked(void **state)
{
    (void)state;
    struct seen seen[2] = {0};
    for (unsigned i = 0; i < 2; i++) {
        struct sim_card *const card = firmware_card(FIRMWARE);
        assert_int_equal(sim_card_watch_output(card, HM2_GTAG_PWMGEN, 1, 0x81), 0);
        sim_card_on_edge(card, on_edge, &seen[i]);
        start(card);
        struct random r = {i + 1};
        for (int64_t clk = 30; clk < 300000; clk += i ? 1 + random_below(&r, 3000) : 300000)
            sim_card_advance(card, clk);
        sim_card_advance(card, 300000);
        sim_card_free(card);
    }
    assert_int_equal(seen[0].edges, seen[1].edges);
    assert_int_equal(seen[0].last_clk, seen[1].last_clk);
    assert_int_equal(seen[0].last_ps, seen[1].last_ps);
    assert_true(seen[0].edges > 200);
}

static void an_output_that_nobody_watches_is_right_when_looked_at(void **state)
{
    (void)state;
    struct sim_card *const watched = firmware_card(FIRMWARE), *const alone = firmware_card(FIRMWARE);
    const int watch = sim_card_watch_output(watched, HM2_GTAG_PWMGEN, 1, 0x81);
    assert_true(watch >= 0);
    start(watched);
    start(alone);
    struct random r = {5};
    unsigned high = 0;
    for (int64_t clk = 30; clk < 100000; clk += 1 + random_below(&r, 100)) {
        sim_card_advance(watched, clk);
        sim_card_advance(alone, clk);
        const struct sim_module *const m = sim_find(alone, HM2_GTAG_PWMGEN);
        assert_non_null(m);
        const enum sim_level level = m->ops->output(sim_find(alone, HM2_GTAG_PWMGEN), 1, 0x81);
        assert_int_equal(level, sim_card_watched(watched, (unsigned)watch));
        high += level == SIM_HIGH;
    }
    assert_true(high > 100);
    sim_card_free(watched);
    sim_card_free(alone);
}

static void the_enable_register_is_as_wide_as_there_are_channels(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card(FIRMWARE);
    sim_card_write(card, 10, 0x4400, UINT32_MAX);
    uint32_t undriven = 1;
    assert_int_equal(sim_card_read(card, 20, 0x4400, &undriven), 0xFF);
    assert_int_equal(undriven, 0);
    sim_card_read(card, 21, 0x4000, &undriven);
    assert_true(undriven == UINT32_MAX);
    sim_card_free(card);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_recorded_generators_are_matched_at_every_edge_of_the_high_clock),
        cmocka_unit_test(skipped_edges_leave_the_same_state),
        cmocka_unit_test(every_change_of_an_output_is_found),
        cmocka_unit_test(a_steady_stretch_ends_with_the_edge_that_changes_the_command),
        cmocka_unit_test(a_long_rest_is_skipped_as_many_short_ones),
        cmocka_unit_test(what_is_watched_does_not_depend_on_when_the_card_is_asked),
        cmocka_unit_test(an_output_that_nobody_watches_is_right_when_looked_at),
        cmocka_unit_test(the_enable_register_is_as_wide_as_there_are_channels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
