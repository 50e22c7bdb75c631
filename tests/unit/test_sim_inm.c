/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Simulated InM, InMux, SSR and OutM (register map 3.16 to 3.18). */
#include "unit.h"

#include "random.h"
#include "scan_logic.h"
#include "sim_card.h"

#define INM_CONTROL  0x8500
#define INM_SLOW     0x8600
#define INM_FILTERED 0x8700
#define INM_RAW      0x8800
#define INM_MPG      0x8900
#define INVERT       0x20u

static struct sim_card *new_7i96s(void)
{
    struct sim_card *card = NULL;
    const struct sim_card_options options = {.profile = "7i96s"};
    assert_int_equal(sim_card_new(&card, &options, NULL), 0);
    return card;
}

static void drive(struct sim_card *const card, const int64_t clk, const unsigned input, const bool level)
{
    assert_int_equal(sim_card_drive_input(card, clk, HM2_GTAG_INM, 0, (uint8_t)(input + 1), level ? SIM_HIGH : SIM_LOW),
                     0);
}

/* 20 kHz scans of 11 inputs at 100 MHz: 100e6 / (4 * 20000 * 11) - 1 = 112 (3.17). */
#define SCAN_20_KHZ (112u << 6)
#define SCAN_CLK    (113 * 4 * 11)

static uint32_t control(const uint32_t fast, const uint32_t slow)
{
    return SCAN_20_KHZ | fast << 16 | slow << 22 | INVERT;
}

static void the_scan_width_is_that_of_the_pins(void **state)
{
    (void)state;
    struct sim_card *const card = new_7i96s();
    assert_int_equal(sim_card_read(card, 10, INM_CONTROL, NULL), 10);
    sim_card_write(card, 20, INM_CONTROL, 0xFFFFFFFF);
    assert_true(sim_card_read(card, 30, INM_CONTROL, NULL) == 0xFFFFFFEA);
    sim_card_free(card);
}

static void field_inputs_arrive_inverted(void **state)
{
    (void)state;
    struct sim_card *const card = new_7i96s();
    for (unsigned i = 0; i < 11; i++)
        drive(card, 5, i, i != 3 && i != 10);
    sim_card_write(card, 10, INM_CONTROL, control(1, 1));
    assert_int_equal(sim_card_read(card, 10 + 5 * SCAN_CLK, INM_FILTERED, NULL), 1u << 3 | 1u << 10);
    assert_int_equal(sim_card_read(card, 11 + 5 * SCAN_CLK, INM_RAW, NULL), 1u << 3 | 1u << 10);
    sim_card_free(card);
}

/* Scans from the input's change to the filtered bit's: count of the filter, and one more because the stored bit
 * decides (3.17). */
static int64_t scans_until(struct sim_card *const card, const int64_t from, const uint32_t bit, const bool level)
{
    for (int64_t scan = 0; scan < 600; scan++)
        if (((sim_card_read(card, from + scan * SCAN_CLK, INM_FILTERED, NULL) & bit) != 0) == level)
            return scan;
    return -1;
}

static void an_input_changes_after_its_fast_or_slow_count(void **state)
{
    (void)state;
    struct sim_card *const card = new_7i96s();
    for (unsigned i = 0; i < 11; i++)
        drive(card, 5, i, true);
    sim_card_write(card, 10, INM_CONTROL, control(5, 500));
    sim_card_write(card, 20, INM_SLOW, 1u << 7);
    int64_t clk = 10 * SCAN_CLK;
    drive(card, clk, 2, false);
    drive(card, clk, 7, false);
    const int64_t fast = scans_until(card, clk, 1u << 2, true);
    assert_true(fast >= 6 && fast <= 7);
    const int64_t slow = fast + scans_until(card, clk + fast * SCAN_CLK, 1u << 7, true);
    assert_true(slow >= 501 && slow <= 502);
    clk += 600 * SCAN_CLK;
    drive(card, clk, 2, true);
    const int64_t back = scans_until(card, clk, 1u << 2, false);
    assert_true(back >= 6 && back <= 7);
    sim_card_free(card);
}

static void a_pulse_shorter_than_the_count_is_removed(void **state)
{
    (void)state;
    struct sim_card *const card = new_7i96s();
    for (unsigned i = 0; i < 11; i++)
        drive(card, 5, i, true);
    sim_card_write(card, 10, INM_CONTROL, control(5, 500));
    int64_t clk = 20 * SCAN_CLK;
    for (unsigned n = 0; n < 20; n++, clk += 20 * SCAN_CLK) {
        drive(card, clk, 0, false);
        drive(card, clk + 3 * SCAN_CLK, 0, true);
        for (unsigned scan = 0; scan < 20; scan++)
            assert_int_equal(sim_card_read(card, clk + scan * SCAN_CLK + SCAN_CLK / 2, INM_FILTERED, NULL) & 1u, 0);
    }
    sim_card_free(card);
}

static int mpg_after(const uint32_t mode, const int turns)
{
    struct sim_card *const card = new_7i96s();
    for (unsigned i = 0; i < 11; i++)
        drive(card, 5, i, true);
    sim_card_write(card, 10, INM_CONTROL, control(1, 1));
    sim_card_write(card, 12, INM_MPG, mode);
    int64_t clk = 20 * SCAN_CLK;
    unsigned phase = 0;
    for (int n = 0; n < abs(turns) * 4; n++, clk += 5 * SCAN_CLK) {
        phase += turns > 0 ? 1u : 3u;
        drive(card, clk, 2, !((phase + 1) & 2u)); /* inputs 2 and 3 are MPG 1; the field is inverted */
        drive(card, clk, 3, !(phase & 2u));
    }
    const uint32_t counts = sim_card_read(card, clk, INM_MPG, NULL);
    assert_int_equal(counts & 0xFFFF00FFu, 0);
    sim_card_free(card);
    return (int8_t)(counts >> 8);
}

static void an_mpg_counts_once_or_four_times_a_turn(void **state)
{
    (void)state;
    assert_int_equal(abs(mpg_after(0x0000, 3)), 3);
    assert_int_equal(abs(mpg_after(0x0100, 3)), 12);
    assert_int_equal(mpg_after(0x0000, 3), -mpg_after(0x0000, -3));
    assert_int_equal(mpg_after(0x0100, 3), -mpg_after(0x0100, -3));
    assert_true((mpg_after(0x0000, 3) > 0) == (mpg_after(0x0100, 3) > 0));
}

/* ---- skipped against counted time
 * --------------------------------------------------------------------------------------- */

static void check_skips(const uint64_t seed, const bool multiplexed)
{
    struct random r = {seed};
    struct scanner s[2] = {{.width = 1 + random_below(&r, 32), .multiplexed = multiplexed}};
    s[1] = s[0];
    scan_power_up(&s[0], 3);
    scan_power_up(&s[1], 3);
    for (unsigned op = 0; op < 25; op++) {
        const int64_t clk = s[0].clk + random_below(&r, random_below(&r, 2) ? 30 : 6000);
        while (s[0].clk < clk)
            scan_advance(&s[0], s[0].clk + 1);
        scan_advance(&s[1], clk);
        assert_memory_equal(&s[0], &s[1], sizeof(s[0]));
        const uint32_t value = (uint32_t)random_u64(&r), what = random_below(&r, 6);
        const uint32_t pace = random_below(&r, 4) ? random_below(&r, 6) : random_below(&r, 60);
        const uint32_t counts = random_below(&r, 4) << 16 | random_below(&r, 8) << 22;
        for (unsigned i = 0; i < 2; i++) {
            if (what < 3)
                s[i].outside ^= 1u << (value & 31u);
            else if (what == 3)
                scan_write(&s[i], 0, (value & 0x20u) | pace << 6 | counts);
            else
                scan_write(&s[i], what == 4 ? 1 : 4, value);
        }
    }
}

static void looks_that_change_nothing_are_skipped_without_a_trace(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 150; seed++) {
        check_skips(seed, false);
        check_skips(seed, true);
    }
}

/* ---- InMux
 * ---------------------------------------------------------------------------------------------------------------- */

static void inputs_behind_a_multiplexer_arrive_at_their_address(void **state)
{
    (void)state;
    struct scanner s = {.width = 16, .multiplexed = true, .outside = 0xA53C};
    scan_power_up(&s, 0);
    scan_write(&s, 0, 20u << 6 | 2u << 16);
    scan_advance(&s, 100000);
    assert_int_equal(s.filtered, 0xA53C);
    s.outside ^= 0x0100;
    scan_advance(&s, 200000);
    assert_int_equal(s.filtered, 0xA43C);
    scan_write(&s, 0, 20u << 6 | 2u << 16 | INVERT);
    scan_advance(&s, 300000);
    assert_int_equal(s.filtered, 0x5BC3);
}

/* ---- SSR and OutM
 * ----------------------------------------------------------------------------------------------------------- */

struct toggles {
    int64_t clk[2][100];
    enum sim_level level[2][100];
    unsigned count[2];
};

static void on_edge(void *const context, const int64_t clk, const unsigned ps, const unsigned watch,
                    const enum sim_level level)
{
    struct toggles *const t = context;
    (void)ps;
    assert_true(watch < 2 && t->count[watch] < 100);
    t->clk[watch][t->count[watch]] = clk;
    t->level[watch][t->count[watch]++] = level;
}

static void a_relay_is_on_while_it_toggles_against_the_reference(void **state)
{
    (void)state;
    struct sim_card *const card = new_7i96s();
    struct toggles t = {0};
    assert_int_equal(sim_card_watch_output(card, HM2_GTAG_SSR, 0, 0x82), 0);
    assert_int_equal(sim_card_watch_output(card, HM2_GTAG_SSR, 0, 0xA0), 1);
    sim_card_on_edge(card, on_edge, &t);
    assert_int_equal(sim_card_read(card, 10, 0x7E00, NULL), 48); /* 1 MHz, not enabled */
    sim_card_advance(card, 1000);
    assert_int_equal(t.count[0] + t.count[1], 0);
    sim_card_write(card, 1000, 0x7E00, 0x1030);
    sim_card_advance(card, 1500);
    assert_int_equal(t.count[1], 10); /* 50 clocks a half period */
    assert_int_equal(t.clk[1][9] - t.clk[1][0], 450);
    for (unsigned i = 0; i < 10; i++)
        assert_true(t.clk[0][i] == t.clk[1][i] && t.level[0][i] == t.level[1][i]);
    sim_card_write(card, 1506, 0x7D00, 1u << 1);
    sim_card_advance(card, 2000);
    assert_true(t.count[0] == t.count[1] + 1); /* one edge of its own at the write */
    for (unsigned i = 12; i < t.count[0]; i++)
        assert_true(t.clk[0][i] == t.clk[1][i - 1] && t.level[0][i] != t.level[1][i - 1]);
    sim_card_write(card, 2001, 0x7E00, 0);
    const unsigned before = t.count[1];
    sim_card_advance(card, 5000);
    assert_true(t.count[1] <= before + 1);
    assert_int_equal(sim_card_watched(card, 1), SIM_LOW);
    sim_card_free(card);
}

static void the_watchdog_clears_plain_outputs(void **state)
{
    (void)state;
    struct sim_card *const card = new_7i96s();
    const int watch = sim_card_watch_output(card, HM2_GTAG_OUTM, 0, 0x85);
    assert_int_equal(watch, 0);
    uint32_t undriven = 0;
    sim_card_read(card, 10, 0xB000, &undriven);
    assert_true(undriven == UINT32_MAX);
    sim_card_write(card, 20, 0x0D00, 0);
    sim_card_write(card, 30, 0x0C00, 1000);
    sim_card_write(card, 40, 0xB000, 0x10);
    sim_card_advance(card, 100);
    assert_int_equal(sim_card_watched(card, 0), SIM_HIGH);
    sim_card_advance(card, 2000);
    assert_int_equal(sim_card_watched(card, 0), SIM_LOW);
    sim_card_write(card, 2010, 0xB000, 0x10);
    sim_card_advance(card, 2020);
    assert_int_equal(sim_card_watched(card, 0), SIM_HIGH);
    sim_card_free(card);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_scan_width_is_that_of_the_pins),
        cmocka_unit_test(field_inputs_arrive_inverted),
        cmocka_unit_test(an_input_changes_after_its_fast_or_slow_count),
        cmocka_unit_test(a_pulse_shorter_than_the_count_is_removed),
        cmocka_unit_test(an_mpg_counts_once_or_four_times_a_turn),
        cmocka_unit_test(looks_that_change_nothing_are_skipped_without_a_trace),
        cmocka_unit_test(inputs_behind_a_multiplexer_arrive_at_their_address),
        cmocka_unit_test(a_relay_is_on_while_it_toggles_against_the_reference),
        cmocka_unit_test(the_watchdog_clears_plain_outputs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
