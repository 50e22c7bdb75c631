/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Three-phase PWM: the simulated module against its traces, and the driver. */
#include "unit.h"

#include <math.h>

#include "module_rig.h"
#include "module_types.h"
#include "sim_card.h"
#include "trace_folder.h"

enum { VALUE = 0x4500, ENABLE = 0x4600, SETUP = 0x4700, RATE = 0x4800 };

/* ---- the simulated module -----------------------------------------------------------------------------------------
 */

static void every_recorded_read_and_edge_is_matched(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("tppwm");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 10);
}

struct watched {
    int64_t rise, fall, period, high; /* in edges of ClockHigh */
    unsigned rises;
};

static void note_edge(void *context, int64_t clk, unsigned ps, unsigned watch, enum sim_level level)
{
    struct watched *const w = (struct watched *)context + watch;
    const int64_t at = 2 * clk + (ps > 5000);
    if (level == SIM_HIGH) {
        w->period = at - w->rise;
        w->rise = at;
        w->rises++;
    } else {
        w->high = at - w->rise;
        w->fall = at;
    }
}

static void check_output(const struct watched *w, enum sim_level level, const char *expected, const char *period,
                         const char *high, const char *row)
{
    bool fits;
    if (strncmp(expected, "const", 5) == 0)
        fits = w->rises == 0 && level == (expected[5] == '1' ? SIM_HIGH : SIM_LOW);
    else
        fits = w->rises > 2 && w->period == atol(period) && w->high == atol(high);
    if (!fits)
        fail_msg("%s: %u rises, period %lld, high %lld", row, w->rises, (long long)w->period, (long long)w->high);
}

static void measure(const struct hm2_image *image, const char *row)
{
    char text[200], *field[9] = {0}, *at = text;
    (void)snprintf(text, sizeof text, "%s", row);
    for (unsigned i = 0; i < 9; i++) {
        field[i] = at;
        at += strcspn(at, ",\n");
        if (*at)
            *at++ = '\0';
    }
    struct sim_card *card;
    struct watched w[2] = {{0}};
    const struct sim_card_options options = {.profile = "7i93", .image = image};
    assert_int_equal(sim_card_new(&card, &options, NULL), 0);
    assert_int_equal(sim_card_drive_input(card, 0, HM2_GTAG_TPPWM, 0, 0x08, SIM_HIGH), 0);
    sim_card_write(card, 10, RATE, 0xFFFF);
    sim_card_write(card, 20, SETUP, (uint32_t)atol(field[0]));
    sim_card_write(card, 30, VALUE, (uint32_t)atol(field[1]));
    sim_card_write(card, 40, ENABLE, 1);
    sim_card_advance(card, 4000);
    assert_int_equal(sim_card_watch_output(card, HM2_GTAG_TPPWM, 0, 0x81), 0);
    assert_int_equal(sim_card_watch_output(card, HM2_GTAG_TPPWM, 0, 0x84), 1);
    sim_card_on_edge(card, note_edge, w);
    sim_card_advance(card, 4000 + 5 * 1024);
    check_output(&w[0], sim_card_watched(card, 0), field[2], field[3], field[4], row);
    check_output(&w[1], sim_card_watched(card, 1), field[5], field[6], field[7], row);
    sim_card_free(card);
}

static void every_measured_dead_time_is_matched(void **state)
{
    (void)state;
    struct hm2_image image;
    char row[200];
    unsigned rows = 0;
    assert_true(replay_firmware("TPEN6_6_72", &image));
    FILE *const file = fopen(TEST_DATA "/tppwm/measure.csv", "r");
    assert_non_null(file);
    assert_non_null(fgets(row, sizeof row, file));
    for (; fgets(row, sizeof row, file); rows++)
        measure(&image, row);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(rows, 62);
}

/* ---- the driver ---------------------------------------------------------------------------------------------------
 */

static struct module_rig *started(const char *config)
{
    struct hm2_image image;
    assert_true(replay_firmware("TPEN6_6_72", &image));
    struct module_rig *const rig = rig_new(&image, config);
    (void)rig_add(rig, &hm2_tppwm_type);
    rig_start(rig);
    return rig;
}

static uint32_t word(uint32_t a, uint32_t b, uint32_t c)
{
    return a | b << 10 | c << 20;
}

static void defaults_are_those_of_linuxcnc(void **state)
{
    (void)state;
    struct module_rig *const rig = started("num_3pwmgens=2");
    assert_true(rig_has(rig, "3pwmgen.01.C-value") && !rig_has(rig, "3pwmgen.02.C-value"));
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, RATE), 13421);
    assert_int_equal(rig_written(rig, SETUP), 511u << 16 | 102);
    assert_int_equal(rig_written(rig, SETUP + 4), 511u << 16 | 102);
    assert_int_equal(rig_written(rig, VALUE), word(512, 512, 512));
    assert_int_equal(rig_written(rig, ENABLE), 0);
    rig_free(rig);
}

static void values_follow_the_formula_and_stay_in_range(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_set(rig, "3pwmgen.00.deadtime", 0);
    rig_cycles(rig, 3);
    rig_set(rig, "3pwmgen.00.scale", 10);
    rig_set(rig, "3pwmgen.00.A-value", 5);
    rig_set(rig, "3pwmgen.00.B-value", -100);
    rig_set(rig, "3pwmgen.00.C-value", 100);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), word(767, 1, 1023));
    rig_set(rig, "3pwmgen.00.A-value", NAN);
    rig_set(rig, "3pwmgen.00.scale", 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), word(512, 1, 1023));
    assert_true(rig_get(rig, "3pwmgen.00.scale") == 1);
    rig_free(rig);
}

/* The firmware would turn both switches of a leg on (measure.csv, dead time 50, values 0 to 49). */
static void a_value_never_goes_below_the_dead_time(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_set(rig, "3pwmgen.00.A-value", -1);
    rig_cycles(rig, 3);
    assert_int_equal(rig_written(rig, VALUE), word(102, 512, 512));
    rig_set(rig, "3pwmgen.00.deadtime", 10000);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE) & 1023, 204);
    assert_true(rig_position(rig, VALUE) < rig_position(rig, SETUP));
    rig_set(rig, "3pwmgen.00.deadtime", 1000);
    rig_cycle(rig); /* the card may still have the long one */
    assert_int_equal(rig_written(rig, SETUP) & 511, 20);
    assert_int_equal(rig_written(rig, VALUE) & 1023, 204);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE) & 1023, 20);
    rig_free(rig);
}

static void impossible_parameters_are_rewritten(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    static const struct {
        double deadtime;
        uint32_t dead;
    } rows[] = {{1e9, 511}, {-1, 0}, {NAN, 511}, {INFINITY, 511}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        rig_set(rig, "3pwmgen.00.deadtime", rows[i].deadtime);
        rig_cycles(rig, 2);
        assert_int_equal(rig_written(rig, SETUP) & 511, rows[i].dead);
        assert_true(isfinite(rig_get(rig, "3pwmgen.00.deadtime")));
    }
    rig_set(rig, "3pwmgen.00.sample-time", 1.5);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, SETUP) >> 16, 1023);
    rig_set(rig, "3pwmgen.frequency", 4000000000.0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, RATE), 65535);
    rig_set(rig, "3pwmgen.frequency", 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, RATE), 1);
    assert_true(rig_get(rig, "3pwmgen.frequency") >= 1);
    rig_free(rig);
}

static void a_fault_keeps_the_outputs_off_until_enable_was_off(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_set(rig, "3pwmgen.00.enable", 1);
    rig_put(rig, ENABLE, 2); /* as it is after power-up with an open input: not a fault of ours */
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, ENABLE), 0); /* the polarity has not arrived yet */
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, ENABLE), 1);
    rig_put(rig, ENABLE, 1);
    rig_cycle(rig);
    assert_true(rig_get(rig, "3pwmgen.00.fault") == 0);
    rig_put(rig, ENABLE, 2);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, ENABLE), 0);
    rig_put(rig, ENABLE, 0);
    rig_cycles(rig, 3);
    assert_int_equal(rig_written(rig, ENABLE), 0);
    assert_true(rig_get(rig, "3pwmgen.00.fault") == 1);
    rig_set(rig, "3pwmgen.00.enable", 0);
    rig_cycle(rig);
    rig_set(rig, "3pwmgen.00.enable", 1);
    rig_cycle(rig);
    assert_true(rig_get(rig, "3pwmgen.00.fault") == 0);
    assert_int_equal(rig_written(rig, ENABLE), 1);
    rig_free(rig);
}

static void a_simulated_card_runs_trips_and_runs_again(void **state)
{
    (void)state;
    struct hm2_image image;
    assert_true(replay_firmware("TPEN6_6_72", &image));
    struct module_rig *const rig = rig_new(&image, "num_3pwmgens=1");
    const struct sim_card_options options = {.profile = "7i93", .image = &image};
    assert_int_equal(sim_card_new(&rig->card, &options, NULL), 0);
    (void)rig_add(rig, &hm2_tppwm_type);
    rig_start(rig);
    rig_set(rig, "3pwmgen.00.enable", 1);
    rig_cycles(rig, 5);
    assert_true(rig_get(rig, "3pwmgen.00.fault") == 0);
    assert_int_equal(sim_card_read(rig->card, rig->clk, ENABLE, NULL) & 3, 1);
    assert_int_equal(sim_card_drive_input(rig->card, rig->clk + 10, HM2_GTAG_TPPWM, 0, 0x08, SIM_LOW), 0);
    rig_cycles(rig, 2);
    assert_true(rig_get(rig, "3pwmgen.00.fault") == 1);
    assert_int_equal(sim_card_drive_input(rig->card, rig->clk + 10, HM2_GTAG_TPPWM, 0, 0x08, SIM_HIGH), 0);
    rig_cycles(rig, 3);
    assert_int_equal(sim_card_read(rig->card, rig->clk, ENABLE, NULL) & 1, 0);
    rig_set(rig, "3pwmgen.00.enable", 0);
    rig_cycle(rig);
    rig_set(rig, "3pwmgen.00.enable", 1);
    rig_cycles(rig, 2);
    assert_true(rig_get(rig, "3pwmgen.00.fault") == 0);
    assert_int_equal(sim_card_read(rig->card, rig->clk, ENABLE, NULL) & 3, 1);
    sim_card_free(rig->card);
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_read_and_edge_is_matched),
        cmocka_unit_test(every_measured_dead_time_is_matched),
        cmocka_unit_test(defaults_are_those_of_linuxcnc),
        cmocka_unit_test(values_follow_the_formula_and_stay_in_range),
        cmocka_unit_test(a_value_never_goes_below_the_dead_time),
        cmocka_unit_test(impossible_parameters_are_rewritten),
        cmocka_unit_test(a_fault_keeps_the_outputs_off_until_enable_was_off),
        cmocka_unit_test(a_simulated_card_runs_trips_and_runs_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
