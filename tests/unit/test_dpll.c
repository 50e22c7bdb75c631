/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include <math.h>

#include "module_rig.h"
#include "module_types.h"
#include "trace_file.h"

#define BASE_RATE 0x7000
#define PHASE     0x7100
#define CONTROL0  0x7200
#define CONTROL1  0x7300
#define TIMERS12  0x7400
#define TIMERS34  0x7500
#define SYNC      0x7600

#define CLOCK_HZ 100e6

static struct module_rig *started(struct hm2_module **dpll)
{
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    struct hm2_module *const module = rig_add(rig, &hm2_dpll_type);
    if (dpll)
        *dpll = module;
    rig_put(rig, CONTROL1, 42);
    rig_start(rig);
    return rig;
}

static void points_have_their_documented_names_and_defaults(void **state)
{
    (void)state;
    struct module_rig *const rig = started(NULL);
    static const struct {
        const char *name;
        enum hm2_point_type type;
        enum hm2_point_dir dir;
        double initial;
    } rows[] = {
        {"dpll.01.timer-us", HM2_FLOAT, HM2_PIN_IN, 100},  {"dpll.02.timer-us", HM2_FLOAT, HM2_PIN_IN, 100},
        {"dpll.03.timer-us", HM2_FLOAT, HM2_PIN_IN, 100},  {"dpll.04.timer-us", HM2_FLOAT, HM2_PIN_IN, 100},
        {"dpll.base-freq-khz", HM2_FLOAT, HM2_PIN_IN, -1}, {"dpll.phase-error-us", HM2_FLOAT, HM2_PIN_OUT, 0},
        {"dpll.time-const", HM2_U32, HM2_PIN_IN, 2000},    {"dpll.plimit", HM2_U32, HM2_PIN_IN, 0x400000},
        {"dpll.ddsize", HM2_U32, HM2_PIN_OUT, 0},          {"dpll.prescale", HM2_U32, HM2_PIN_OUT, 1},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct hm2_plain_object *const object = rig_object(rig, rows[i].name);
        assert_non_null(object);
        assert_int_equal(object->point->type, rows[i].type);
        assert_int_equal(object->point->dir, rows[i].dir);
        assert_true(rig_get(rig, rows[i].name) == rows[i].initial);
    }
    assert_int_equal(hm2_plain_count(rig->plain), 10);
    rig_free(rig);
}

static void the_base_frequency_is_taken_from_the_period_at_the_first_write(void **state)
{
    (void)state;
    struct module_rig *const rig = started(NULL);
    rig_set_period(rig, 2000000);
    rig_cycle(rig);
    assert_true(rig_get(rig, "dpll.base-freq-khz") == 0.5);
    rig_set_period(rig, 1000000);
    rig_cycle(rig);
    assert_true(rig_get(rig, "dpll.base-freq-khz") == 0.5);
    rig_free(rig);
}

static void timer_offsets_are_encoded_as_the_manual_example(void **state)
{
    (void)state;
    struct module_rig *const rig = started(NULL);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, TIMERS12), 0xE667E667); /* the default, +100 us */
    assert_int_equal(rig_written(rig, TIMERS34), 0xE667E667);
    rig_set(rig, "dpll.01.timer-us", -100);
    rig_set(rig, "dpll.02.timer-us", -200);
    rig_set(rig, "dpll.03.timer-us", 0);
    rig_set(rig, "dpll.04.timer-us", -500);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, TIMERS12), 0x33331999);
    assert_int_equal(rig_written(rig, TIMERS34), 0x80000000);
    rig_free(rig);
}

static void offsets_that_are_no_numbers_are_reported_and_become_zero(void **state)
{
    (void)state;
    struct hm2_module *dpll;
    struct module_rig *const rig = started(&dpll);
    rig_set(rig, "dpll.01.timer-us", NAN);
    rig_set(rig, "dpll.02.timer-us", INFINITY);
    rig_set(rig, "dpll.03.timer-us", 1e300);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, TIMERS12), 0);
    assert_int_equal(rig_written(rig, TIMERS34) & 0xFFFF, 0); /* INT32_MIN */
    assert_int_equal(dpll->noticed[HM2_NOTICE_VALUE_INVALID], 2);
    rig_free(rig);
}

/* Period in clocks by the law that the traces show: base rate is added to 42 bits once per prescale clocks. */
static double period_clocks(const uint32_t base_rate, const uint32_t prescale)
{
    return 4398046511104.0 / base_rate * prescale;
}

static void the_law_of_the_period_is_that_of_the_recorded_firmware(void **state)
{
    (void)state;
    static const struct {
        const char *test;
        uint32_t prescale;
    } rows[] = {{"free_pre1", 1}, {"free_pre2", 2}, {"free_pre8", 8}};
    struct trace_file trace = trace_load("hm2dpll");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        size_t at = 0;
        const struct trace_event *const rate = trace_find(&trace, &at, rows[i].test, 'W', "baserate");
        const struct trace_event *before = NULL, *reading;
        unsigned slopes = 0;
        assert_non_null(rate);
        const double expected = 4294967296.0 / period_clocks(rate->value, rows[i].prescale);
        while ((reading = trace_find(&trace, &at, rows[i].test, 'R', "phase"))) {
            if (before && before->value != 0) { /* the prescaler first runs out at clock 256 */
                const double slope = (double)(reading->value - before->value) / (double)(reading->clk - before->clk);
                /* readings fall between two steps of the prescaler */
                assert_true(fabs(slope - expected) <= expected * rows[i].prescale / 50.0);
                slopes++;
            }
            before = reading;
        }
        assert_true(slopes >= 2);
    }
    trace_free(&trace);
}

static void any_frequency_becomes_its_period(void **state)
{
    (void)state;
    static const double khz[] = {0.1, 0.5, 1, 2, 3.999, 4, 10, 25, 97};
    struct module_rig *const rig = started(NULL);
    for (size_t i = 0; i < sizeof khz / sizeof khz[0]; i++) {
        rig_set(rig, "dpll.base-freq-khz", khz[i]);
        rig_cycle(rig);
        const uint32_t prescale = rig_written(rig, CONTROL0) >> 24;
        assert_true(prescale >= 1);
        assert_true(rig_get(rig, "dpll.prescale") == prescale);
        const double period = period_clocks(rig_written(rig, BASE_RATE), prescale);
        const double wanted = CLOCK_HZ / (khz[i] * 1000.0);
        assert_true(fabs(period / wanted - 1.0) < 1e-6);
    }
    rig_free(rig);
}

static void one_kilohertz_gives_the_values_of_the_formula(void **state)
{
    (void)state;
    struct module_rig *const rig = started(NULL);
    rig_cycle(rig);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, CONTROL0), 24u << 24 | 0x400000);
    assert_int_equal(rig_written(rig, BASE_RATE), 1055531162); /* 1000 * 2^42 * 24 / 100e6 = 1055531162.66 */
    assert_int_equal(rig_written(rig, CONTROL1), 2000u << 16);
    rig_free(rig);
}

static void impossible_frequencies_leave_the_loop_at_the_period(void **state)
{
    (void)state;
    static const double khz[] = {0.0, NAN, INFINITY, 1e18};
    struct hm2_module *dpll;
    struct module_rig *const rig = started(&dpll);
    rig_cycle(rig);
    const uint32_t good = rig_written(rig, BASE_RATE);
    for (size_t i = 0; i < sizeof khz / sizeof khz[0]; i++) {
        rig_set(rig, "dpll.base-freq-khz", khz[i]);
        rig_cycle(rig);
        assert_int_equal(rig_written(rig, BASE_RATE), good);
        assert_int_equal(dpll->noticed[HM2_NOTICE_VALUE_INVALID], i + 1);
    }
    rig_free(rig);
}

static void extreme_frequencies_stay_inside_the_registers(void **state)
{
    (void)state;
    struct module_rig *const rig = started(NULL);
    rig_set(rig, "dpll.base-freq-khz", 1e-9);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, CONTROL0) >> 24, 255);
    rig_set(rig, "dpll.base-freq-khz", 1e9);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, CONTROL0) >> 24, 1);
    assert_int_equal(rig_written(rig, BASE_RATE), 0xFFFFFFFF);
    rig_free(rig);
}

static void limits_wider_than_their_fields_are_cut_and_told(void **state)
{
    (void)state;
    struct hm2_module *dpll;
    struct module_rig *const rig = started(&dpll);
    rig_set(rig, "dpll.plimit", 0x12345678);
    rig_set(rig, "dpll.time-const", 70000);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, CONTROL0) & 0xFFFFFF, 0xFFFFFF);
    assert_int_equal(rig_written(rig, CONTROL1), 0xFFFF0000);
    assert_int_equal(dpll->noticed[HM2_NOTICE_VALUE_CLAMPED], 2);
    rig_free(rig);
}

static void an_accumulator_size_that_cannot_be_is_taken_as_the_known_one(void **state)
{
    (void)state;
    static const uint32_t sizes[] = {0, 1, 31, 63, 255};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        struct module_rig *const rig = started(NULL);
        rig_put(rig, CONTROL1, sizes[i] | 0x07D00000);
        rig_cycle(rig);
        assert_true(rig_get(rig, "dpll.ddsize") == sizes[i]);
        assert_int_equal(rig_written(rig, BASE_RATE), 1055531162);
        rig_free(rig);
    }
}

static void the_phase_error_is_signed_and_in_microseconds(void **state)
{
    (void)state;
    struct module_rig *const rig = started(NULL);
    static const struct {
        uint32_t phase;
        double us;
    } rows[] = {{0, 0}, {0x40000000, 250}, {0xC0000000, -250}, {0x80000000, -500}, {1, 1000.0 / 4294967296.0}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        rig_put(rig, SYNC, rows[i].phase);
        rig_read(rig);
        assert_true(fabs(rig_get(rig, "dpll.phase-error-us") - rows[i].us) < 1e-9);
    }
    rig_free(rig);
}

static void the_accumulator_is_held_for_a_hundred_writes_after_every_start(void **state)
{
    (void)state;
    struct module_rig *const rig = started(NULL);
    for (unsigned restart = 0; restart < 2; restart++) {
        rig->cycle.writes = 0;
        for (unsigned i = 0; i < 100; i++) {
            rig_cycle(rig);
            assert_true(rig_wrote(rig, PHASE));
            assert_true(rig_wrote(rig, CONTROL0));
            assert_int_equal(rig_written(rig, PHASE), 0);
        }
        rig_cycle(rig);
        assert_false(rig_wrote(rig, PHASE));
        assert_false(rig_wrote(rig, CONTROL0));
    }
    rig_free(rig);
}

static void set_up_is_sent_again_when_the_card_lost_it(void **state)
{
    (void)state;
    struct module_rig *const rig = started(NULL);
    rig_cycles(rig, 200);
    hm2_plan_touch_all(rig->plan);
    rig_cycle(rig);
    static const uint16_t registers[] = {BASE_RATE, CONTROL0, CONTROL1, TIMERS12, TIMERS34};
    for (size_t i = 0; i < sizeof registers / sizeof registers[0]; i++)
        assert_true(rig_wrote(rig, registers[i]));
    assert_false(rig_wrote(rig, PHASE));
    rig_free(rig);
}

static void the_sync_read_is_the_first_of_the_request(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    (void)rig_add(rig, &hm2_watchdog_type);
    (void)rig_add(rig, &hm2_dpll_type);
    (void)rig_add(rig, &hm2_ioport_type);
    rig_start(rig);
    size_t len;
    const uint8_t *const request = hm2_plan_request(rig->plan, &len);
    size_t at = 0;
    while (at + 4 <= len && (hm2_get_le16(request + at) & 0xFF80) != 0x4280)
        at += 4u + (request[at + 1] & 0x80 ? 2u * (request[at] & 0x7Fu) : 0);
    assert_true(at + 4 <= len);
    assert_int_equal(hm2_get_le16(request + at + 2), SYNC);
    rig_free(rig);
}

static void no_dpll_is_used_when_none_is_wanted(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "num_dplls=0");
    (void)rig_add(rig, &hm2_dpll_type);
    rig_start(rig);
    rig_cycles(rig, 2);
    assert_int_equal(hm2_plain_count(rig->plain), 0);
    assert_false(rig_wrote(rig, BASE_RATE));
    rig_free(rig);
}

/* Clock at which an output of the sampled vector is first seen risen, from clock `from` on. */
static long rise(const struct trace_file *trace, const unsigned output, const long from)
{
    const struct trace_event *event, *before = NULL;
    size_t at = 0;
    while ((event = trace_find(trace, &at, "timers", 'N', "rates"))) {
        if (before && event->clk > from && before->text[output] == '0' && event->text[output] == '1')
            return event->clk;
        before = event;
    }
    fail_msg("output %u does not rise after clock %ld", output, from);
    return 0;
}

/* Trace "timers": period 4096 clocks, sampled every 60 clocks. The vector is the reference and then timers 1 to 4: only
 * so do the rises fit the registers, T / 65536 periods before the reference. A timer that shall fire as early as the
 * trace shows must get the register value that was written there. */
static void timers_fire_as_early_as_the_recorded_firmware_does(void **state)
{
    (void)state;
    static const struct {
        unsigned output;
        const char *pin, *name;
        uint16_t address;
        unsigned shift;
    } timers[] = {
        {1, "dpll.01.timer-us", "timers12", TIMERS12, 0},
        {2, "dpll.02.timer-us", "timers12", TIMERS12, 16},
        {3, "dpll.03.timer-us", "timers34", TIMERS34, 0},
    };
    const double period_us = 40.96, two_samples_us = 1.2;
    struct trace_file trace = trace_load("hm2dpll");
    struct module_rig *const rig = started(NULL);
    const long reference = rise(&trace, 0, 0);
    rig_set_period(rig, 40960);
    for (size_t i = 0; i < sizeof timers / sizeof timers[0]; i++) {
        size_t at = 0;
        const struct trace_event *const write = trace_find(&trace, &at, "timers", 'W', timers[i].name);
        assert_non_null(write);
        const double early_us = (double)(reference - rise(&trace, timers[i].output, 0)) / 100.0;
        assert_true(early_us > 0 && early_us < period_us);
        rig_set(rig, timers[i].pin, -early_us);
        rig_cycle(rig);
        const uint32_t ours = rig_written(rig, timers[i].address) >> timers[i].shift & 0xFFFF;
        const uint32_t theirs = write->value >> timers[i].shift & 0xFFFF;
        if (fabs((double)ours - (double)theirs) / 65536.0 * period_us > two_samples_us)
            fail_msg("%s: fires %g us early, register 0x%04X, ours 0x%04X", timers[i].pin, early_us, theirs, ours);
    }
    rig_free(rig);
    trace_free(&trace);
}

/* Largest phase error in the last 5 s of 20 s on a simulated card, with a host whose clock is off by 100 ppm. */
static double settled_error_us(const double plimit)
{
    struct sim_card *card;
    struct hm2_diag diag = {0};
    const struct sim_card_options options = {.profile = "7i96s", .seed = 1};
    assert_int_equal(sim_card_new(&card, &options, &diag), 0);
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    rig->card = card;
    (void)rig_add(rig, &hm2_dpll_type);
    rig_set(rig, "dpll.plimit", plimit);
    rig_start(rig);
    double worst_us = 0;
    for (unsigned i = 0; i < 20000; i++) {
        rig_cycle(rig);
        rig->clk += 10; /* of 100000 clocks in a millisecond */
        const double error_us = fabs(rig_get(rig, "dpll.phase-error-us"));
        if (i > 15000 && error_us > worst_us)
            worst_us = error_us;
    }
    assert_true(rig_get(rig, "dpll.ddsize") == 42.0);
    rig_free(rig);
    sim_card_free(card);
    return worst_us;
}

/* The simulation is written from the firmware's behaviour alone: with our set-up it must follow us, and without the
 * means to correct its phase it must not. */
static void the_simulated_card_follows_a_host_whose_clock_is_off_by_100_ppm(void **state)
{
    (void)state;
    const double followed_us = settled_error_us(0x400000), free_us = settled_error_us(0);
    if (followed_us > 1.0 || free_us < 100.0)
        fail_msg("phase error %g us when following, %g us when not", followed_us, free_us);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_have_their_documented_names_and_defaults),
        cmocka_unit_test(the_base_frequency_is_taken_from_the_period_at_the_first_write),
        cmocka_unit_test(timer_offsets_are_encoded_as_the_manual_example),
        cmocka_unit_test(offsets_that_are_no_numbers_are_reported_and_become_zero),
        cmocka_unit_test(the_law_of_the_period_is_that_of_the_recorded_firmware),
        cmocka_unit_test(any_frequency_becomes_its_period),
        cmocka_unit_test(one_kilohertz_gives_the_values_of_the_formula),
        cmocka_unit_test(impossible_frequencies_leave_the_loop_at_the_period),
        cmocka_unit_test(extreme_frequencies_stay_inside_the_registers),
        cmocka_unit_test(limits_wider_than_their_fields_are_cut_and_told),
        cmocka_unit_test(an_accumulator_size_that_cannot_be_is_taken_as_the_known_one),
        cmocka_unit_test(the_phase_error_is_signed_and_in_microseconds),
        cmocka_unit_test(the_accumulator_is_held_for_a_hundred_writes_after_every_start),
        cmocka_unit_test(set_up_is_sent_again_when_the_card_lost_it),
        cmocka_unit_test(the_sync_read_is_the_first_of_the_request),
        cmocka_unit_test(no_dpll_is_used_when_none_is_wanted),
        cmocka_unit_test(timers_fire_as_early_as_the_recorded_firmware_does),
        cmocka_unit_test(the_simulated_card_follows_a_host_whose_clock_is_off_by_100_ppm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
