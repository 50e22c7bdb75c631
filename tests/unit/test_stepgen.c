/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Step generators: motion, settings, latches, against a generator modelled here and the recorded firmware. */
#include <hm2/scurve.h>

#include <math.h>

#include "module_rig.h"
#include "module_types.h"
#include "stepgen.h"
#include "trace_file.h"
#include "unit.h"

#define CLOCK_HZ        100000000.0
#define CLOCKS_A_PERIOD 100000
#define GENERATORS      5u

#define assert_near(a, b, tolerance) assert_true(fabs((a) - (b)) <= (tolerance))

enum {
    RATE = 0x2000,
    ACCUMULATOR = 0x2100,
    MODE = 0x2200,
    DIRSETUP = 0x2300,
    DIRHOLD = 0x2400,
    STEPLEN = 0x2500,
    STEPSPACE = 0x2600,
    TABLE = 0x2700,
    TABLE_MAX = 0x2800,
    MASTER_DDS = 0x2900,
    TIMER = 0x2A00,
};

/* ---- bench ------------------------------------------------------------------------------------------------------- */

struct bench {
    struct module_rig *rig;
    struct hm2_module *module;
    int64_t accumulator[GENERATORS]; /* 32.32 steps, as in the FPGA but wider */
};

static const uint32_t latch_pins[] = {0x03000581, 0x03000582, 0x03000509, 0x0300050A};

static struct bench bench_open(const struct hm2_image *const image, const char *const config)
{
    struct bench bench = {.rig = rig_new(image, config)};
    bench.module = rig_add(bench.rig, &hm2_stepgen_type);
    rig_start(bench.rig);
    return bench;
}

static const struct hm2_image *image_of_version(const uint8_t version)
{
    const struct rig_md modules[] = {
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
        {HM2_GTAG_STEPGEN, version, 1, 1, 0x2000, 10, 0x00, 0x1FF},
    };
    return rig_image_with(modules, 2, latch_pins, 4);
}

/* One period of stepping at the rates that the card holds, then one cycle. */
static void run(struct bench *const bench)
{
    for (unsigned i = 0; i < bench->module->instances; i++) {
        bench->accumulator[i] += (int64_t)(int32_t)rig_written(bench->rig, (uint16_t)(RATE + 4 * i)) * CLOCKS_A_PERIOD;
        rig_put(bench->rig, (uint16_t)(ACCUMULATOR + 4 * i), (uint32_t)(bench->accumulator[i] >> 16));
    }
    rig_cycle(bench->rig);
}

static void run_many(struct bench *const bench, const unsigned cycles)
{
    for (unsigned i = 0; i < cycles; i++)
        run(bench);
}

static unsigned noticed(const struct bench *const bench, const enum hm2_notice notice)
{
    return bench->module->noticed[notice];
}

static double get(const struct bench *const bench, const char *const suffix)
{
    char name[64];
    (void)snprintf(name, sizeof name, "stepgen.00.%s", suffix);
    return rig_get(bench->rig, name);
}

static void set(const struct bench *const bench, const char *const suffix, const double value)
{
    char name[64];
    (void)snprintf(name, sizeof name, "stepgen.00.%s", suffix);
    rig_set(bench->rig, name, value);
}

static int32_t rate(const struct bench *const bench)
{
    return (int32_t)rig_written(bench->rig, RATE);
}

/* A generator that may do 100000 steps/s. */
static void set_fast(const struct bench *const bench)
{
    set(bench, "steplen", 5000);
    set(bench, "stepspace", 5000);
    set(bench, "dirsetup", 10000);
    set(bench, "dirhold", 10000);
}

/* ---- points and settings ------------------------------------------------------------------------------------------
 */

static void the_default_times_are_the_longest_and_the_generators_get_their_clock(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "");
    run(&bench);
    for (unsigned i = 0; i < GENERATORS; i++)
        for (unsigned reg = DIRSETUP; reg <= STEPSPACE; reg += 0x100)
            assert_int_equal(rig_written(bench.rig, (uint16_t)(reg + 4 * i)), 0x3FFF);
    assert_int_equal(rig_written(bench.rig, MASTER_DDS), 0xFFFFFFFF);
    assert_int_equal(rig_written(bench.rig, TIMER), 0);
    assert_int_equal(get(&bench, "steplen"), 163830);
    assert_int_equal(get(&bench, "dirhold"), 163830);
    assert_int_equal(get(&bench, "maxaccel"), 1);
    assert_int_equal(rig_get(bench.rig, "stepgen.timer-number"), -1);
    assert_false(rig_has(bench.rig, "stepgen.00.swap_step_dir"));
    assert_false(rig_has(bench.rig, "stepgen.00.index-enable"));
    rig_free(bench.rig);
}

static void every_generator_has_fourteen_pins_and_twelve_parameters(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=2");
    unsigned pins = 0, params = 0;
    for (size_t i = 0; i < hm2_plain_count(bench.rig->plain); i++) {
        const enum hm2_point_dir dir = hm2_plain_at(bench.rig->plain, i)->point->dir;
        *(dir == HM2_PARAM_RO || dir == HM2_PARAM_RW ? &params : &pins) += 1;
    }
    assert_int_equal(pins, 1 + 2 * 14);
    assert_int_equal(params, 2 * 12);
    rig_free(bench.rig);
}

static void a_changed_parameter_is_seen_within_a_round_of_looks(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "");
    rig_set(bench.rig, "stepgen.04.steplen", 2000);
    run(&bench); /* the first cycle sees all */
    assert_int_equal(rig_written(bench.rig, STEPLEN + 16), 200);
    run_many(&bench, 7);
    for (unsigned i = 0; i < GENERATORS; i++) {
        char name[64];
        (void)snprintf(name, sizeof name, "stepgen.%02u.steplen", i);
        rig_set(bench.rig, name, 1000);
    }
    run_many(&bench, STEPGEN_LOOKS);
    for (unsigned i = 0; i < GENERATORS; i++)
        assert_int_equal(rig_written(bench.rig, (uint16_t)(STEPLEN + 4 * i)), 100);
    rig_free(bench.rig);
}

static void without_generators_in_use_there_is_nothing(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=0");
    run(&bench);
    assert_int_equal(hm2_plain_count(bench.rig->plain), 0);
    for (unsigned io = 0; io < bench.rig->idrom.pin_count; io++)
        assert_null(bench.rig->pins[io].owner);
    rig_free(bench.rig);
}

static void pins_up_to_the_width_are_claimed_and_driven_from_the_first_write_on(void **state)
{
    (void)state;
    struct bench bench = bench_open(image_of_version(0xC2), "");
    assert_ptr_equal(bench.rig->pins[0].owner, bench.module);
    assert_ptr_equal(bench.rig->pins[1].owner, bench.module);
    assert_false(bench.rig->pins[0].immediate);
    assert_ptr_equal(bench.rig->pins[2].owner, bench.module); /* index and probe, whatever the width */
    assert_ptr_equal(bench.rig->pins[3].owner, bench.module);
    rig_free(bench.rig);
    bench = bench_open(image_of_version(0xC2), "stepgen_width=1");
    assert_non_null(bench.rig->pins[0].owner);
    assert_null(bench.rig->pins[1].owner);
    rig_free(bench.rig);
}

static void outputs_are_named_as_in_aliases(void **state)
{
    (void)state;
    const char *(*const name)(const struct hm2_pd *) = hm2_stepgen_type.output_name;
    assert_string_equal(name(&(struct hm2_pd){.secondary_pin = 0x81}), "step");
    assert_string_equal(name(&(struct hm2_pd){.secondary_pin = 0x82}), "direction");
    assert_string_equal(name(&(struct hm2_pd){.secondary_pin = 0x83}), "table2");
    assert_string_equal(name(&(struct hm2_pd){.secondary_pin = 0x88}), "table7");
    assert_null(name(&(struct hm2_pd){.secondary_pin = 0x89}));
    assert_null(name(&(struct hm2_pd){.secondary_pin = 0x80}));
    assert_null(name(&(struct hm2_pd){.secondary_pin = 0x09}));
}

static void times_are_truncated_to_clocks_and_clamped_to_fourteen_bits(void **state)
{
    (void)state;
    assert_int_equal(stepgen_clocks(5000, 100000000), 500);
    assert_int_equal(stepgen_clocks(5009, 100000000), 500);
    assert_int_equal(stepgen_clocks(163840, 100000000), 0x3FFF);
    assert_int_equal(stepgen_clocks(UINT32_MAX, UINT32_MAX), 0x3FFF);
    assert_int_equal(stepgen_longest_ns(100000000), 163830);
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set(&bench, "steplen", 1e6);
    set(&bench, "dirsetup", 2000);
    run(&bench);
    assert_int_equal(rig_written(bench.rig, STEPLEN), 0x3FFF);
    assert_int_equal(get(&bench, "steplen"), 163830);
    assert_int_equal(rig_written(bench.rig, DIRSETUP), 200);
    assert_int_equal(noticed(&bench, HM2_NOTICE_VALUE_CLAMPED), 1);
    set(&bench, "steplen", 0); /* 0 in the register would never end a pulse */
    run(&bench);
    assert_int_equal(rig_written(bench.rig, STEPLEN), 1);
    rig_free(bench.rig);
}

static void a_timer_number_selects_a_timer_and_nonsense_the_reference(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    static const struct {
        double pin;
        uint32_t word;
    } cases[] = {{1, 0x9000}, {4, 0xC000}, {0, 0x8000}, {-1, 0}, {5, 0x8000}, {-2, 0x8000}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rig_set(bench.rig, "stepgen.timer-number", -1);
        run(&bench);
        rig_set(bench.rig, "stepgen.timer-number", cases[i].pin);
        run(&bench);
        assert_int_equal(rig_written(bench.rig, TIMER), cases[i].word);
    }
    assert_int_equal(rig_get(bench.rig, "stepgen.timer-number"), 0);
    rig_free(bench.rig);
}

static void the_timer_register_is_left_alone_where_another_module_lives(void **state)
{
    (void)state;
    /* The older address map: wave generators at 0x2A00. */
    static const struct rig_md modules[] = {
        {HM2_GTAG_DPLL, 0, 1, 1, 0x7000, 7, 0x00, 0},
        {HM2_GTAG_STEPGEN, 2, 1, 1, 0x2000, 10, 0x00, 0x1FF},
        {HM2_GTAG_WAVEGEN, 0, 2, 1, 0x2A00, 5, 0x00, 0x1F},
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
    };
    struct bench bench = bench_open(rig_image_with(modules, 4, NULL, 0), "");
    rig_set(bench.rig, "stepgen.timer-number", 2);
    bench.rig->written[TIMER / 4] = 0x12345678;
    run_many(&bench, 3);
    assert_int_equal(rig_written(bench.rig, TIMER), 0x12345678);
    rig_free(bench.rig);
}

static void swapping_exists_on_firmware_that_can(void **state)
{
    (void)state;
    struct bench bench = bench_open(image_of_version(0x42), "");
    assert_false(rig_has(bench.rig, "stepgen.timer-number"));
    assert_false(rig_has(bench.rig, "stepgen.00.index-enable"));
    set(&bench, "swap_step_dir", 1);
    set(&bench, "step_type", 2);
    run(&bench);
    assert_int_equal(rig_written(bench.rig, MODE), 6);
    rig_free(bench.rig);
}

/* ---- tables ------------------------------------------------------------------------------------------------------ */

static void a_table_is_pushed_last_entry_first_then_its_length_then_the_mode(void **state)
{
    (void)state;
    size_t at = 0;
    struct trace_file trace = trace_load("stepgen");
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set(&bench, "table-data-0", 0x01020408);
    set(&bench, "table-data-1", 0x3F);
    set(&bench, "step_type", 5);
    run(&bench);
    /* The recorded firmware was given the same table. */
    const struct trace_event *event;
    const int last = rig_position(bench.rig, TABLE);
    int push = last - 4;
    while ((event = trace_next(&trace, &at, "mode3_table")) != NULL) {
        if (trace_is(event, 'W', "table"))
            assert_int_equal(bench.rig->log[push++].value, event->value);
        if (trace_is(event, 'W', "tablemax"))
            assert_int_equal(rig_written(bench.rig, TABLE_MAX), event->value);
        if (trace_is(event, 'W', "mode"))
            assert_int_equal(rig_written(bench.rig, MODE), event->value);
    }
    assert_int_equal(push, last + 1);
    assert_int_equal(rig_position(bench.rig, TABLE_MAX), last + 1);
    assert_true(rig_position(bench.rig, MODE) > last + 1);
    trace_free(&trace);
    rig_free(bench.rig);
}

static void two_equal_changes_of_a_table_do_not_cancel(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set(&bench, "step_type", 8);
    run_many(&bench, 3);
    assert_false(rig_wrote(bench.rig, TABLE));
    set(&bench, "table-data-0", 0x11);
    set(&bench, "table-data-1", 0x11);
    run(&bench);
    assert_true(rig_wrote(bench.rig, TABLE));
    run_many(&bench, 2);
    assert_false(rig_wrote(bench.rig, TABLE));
    rig_free(bench.rig);
}

static void a_table_that_is_too_long_is_refused(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set(&bench, "step_type", 17);
    run(&bench);
    assert_int_equal(get(&bench, "step_type"), 0);
    assert_int_equal(rig_written(bench.rig, MODE), 0);
    assert_false(rig_wrote(bench.rig, TABLE));
    assert_int_equal(noticed(&bench, HM2_NOTICE_TABLE_TOO_LONG), 1);
    set(&bench, "step_type", 16);
    run(&bench);
    assert_int_equal(rig_written(bench.rig, MODE), 3);
    assert_int_equal(rig_written(bench.rig, TABLE_MAX), 15);
    rig_free(bench.rig);
}

static void mode_and_table_come_back_after_the_card_lost_its_power(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "");
    set(&bench, "table-data-0", 0x04030201);
    set(&bench, "step_type", 4);
    rig_set(bench.rig, "stepgen.03.step_type", 2);
    run_many(&bench, 3);
    memset(bench.rig->written, 0, sizeof bench.rig->written);
    hm2_plan_touch_all(bench.rig->plan);
    bench.module->type->start(bench.module, &bench.rig->cycle);
    run(&bench);
    assert_int_equal(rig_written(bench.rig, TABLE), 1);
    assert_int_equal(rig_written(bench.rig, TABLE_MAX), 3);
    assert_int_equal(rig_written(bench.rig, MODE), 3);
    assert_int_equal(rig_written(bench.rig, MODE + 12), 2);
    assert_int_equal(rig_written(bench.rig, STEPLEN), 0x3FFF);
    assert_int_equal(rig_written(bench.rig, MASTER_DDS), 0xFFFFFFFF);
    rig_free(bench.rig);
}

/* ---- feedback ---------------------------------------------------------------------------------------------------- */

static void the_position_starts_at_zero_and_survives_a_power_cycle(void **state)
{
    (void)state;
    struct bench bench = {.rig = rig_new(rig_image_7i96s(), "")};
    bench.module = rig_add(bench.rig, &hm2_stepgen_type);
    rig_put(bench.rig, ACCUMULATOR, 0x7FFF8000);
    rig_start(bench.rig);
    rig_cycle(bench.rig);
    assert_int_equal(get(&bench, "counts"), 0);
    rig_put(bench.rig, ACCUMULATOR, 0x80018000);
    set(&bench, "position-scale", 4);
    rig_cycle(bench.rig);
    assert_int_equal(get(&bench, "counts"), 2);
    assert_true(get(&bench, "position-fb") == 0.5);
    rig_put(bench.rig, ACCUMULATOR, 0);
    hm2_put_le32(((struct stepgen_module *)bench.module->context)->accumulators.bytes, 0); /* the board read again */
    bench.module->type->start(bench.module, &bench.rig->cycle);
    rig_cycle(bench.rig);
    assert_int_equal(get(&bench, "counts"), 2);
    rig_put(bench.rig, ACCUMULATOR, 0xFFFF0000);
    rig_cycle(bench.rig);
    assert_int_equal(get(&bench, "counts"), 1);
    rig_free(bench.rig);
}

static void a_million_wraps_in_both_directions_do_not_drift(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    struct stepgen_module *const ctx = bench.module->context;
    const uint32_t leap = 0x7FFFFFFF;
    const unsigned leaps = 2000001;
    uint32_t accumulator = 0;
    for (int direction = 1; direction >= -1; direction -= 2) {
        for (unsigned i = 0; i < leaps; i++) {
            accumulator += direction > 0 ? leap : 0u - leap;
            hm2_put_le32(ctx->accumulators.bytes, accumulator);
            bench.module->type->unpack(bench.module, &bench.rig->cycle);
        }
        const int64_t expected = direction > 0 ? (int64_t)leap * leaps : 0;
        assert_true(ctx->generator[0].subcounts == expected);
        assert_true(get(&bench, "position-fb") == (double)expected / 65536.0);
        assert_true(get(&bench, "counts") == (double)(int32_t)(uint32_t)(expected >> 16));
    }
    rig_free(bench.rig);
}

static void position_reset_holds_the_position_at_zero(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    rig_put(bench.rig, ACCUMULATOR, 0x00050000);
    set(&bench, "position-reset", 1);
    rig_cycle(bench.rig);
    rig_put(bench.rig, ACCUMULATOR, 0x00070000);
    rig_cycle(bench.rig);
    assert_true(get(&bench, "position-fb") == 0.0);
    set(&bench, "position-reset", 0);
    rig_put(bench.rig, ACCUMULATOR, 0x00088000);
    rig_cycle(bench.rig);
    assert_true(get(&bench, "position-fb") == 1.5);
    assert_int_equal(get(&bench, "counts"), 1);
    rig_free(bench.rig);
}

/* ---- motion ------------------------------------------------------------------------------------------------------ */

static void a_disabled_generator_stands_still(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set(&bench, "position-cmd", 100);
    set(&bench, "velocity-cmd", 100);
    for (int mode = 0; mode < 2; mode++) {
        set(&bench, "control-type", mode);
        run_many(&bench, 5);
        assert_int_equal(rate(&bench), 0);
        assert_true(get(&bench, "velocity-fb") == 0.0);
    }
    /* A command that moved meanwhile is no velocity when it is enabled. */
    set(&bench, "control-type", 0);
    set(&bench, "position-cmd", 200);
    run(&bench);
    set(&bench, "enable", 1);
    run(&bench);
    assert_true(get(&bench, "dbg_ff_vel") == 0.0);
    rig_free(bench.rig);
}

static void velocity_mode_ramps_with_maxaccel_up_to_maxvel(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set_fast(&bench);
    set(&bench, "position-scale", 200);
    set(&bench, "maxvel", 50);
    set(&bench, "maxaccel", 1000);
    set(&bench, "control-type", 1);
    set(&bench, "enable", 1);
    set(&bench, "velocity-cmd", 80);
    for (unsigned i = 1; i <= 60; i++) {
        run(&bench);
        assert_near(get(&bench, "velocity-fb"), i < 50 ? i : 50, 1e-9);
    }
    assert_int_equal(rate(&bench), 429496); /* trunc(50 * 200 * 2^32 / 100 MHz) */
    assert_int_equal(get(&bench, "dbg_step_rate"), 429496);
    set(&bench, "velocity-cmd", -80);
    run(&bench);
    assert_near(get(&bench, "velocity-fb"), 49, 1e-9);
    run_many(&bench, 200);
    assert_int_equal(rate(&bench), -429496);
    set(&bench, "enable", 0);
    run(&bench);
    assert_int_equal(rate(&bench), 0);
    rig_free(bench.rig);
}

static void maxvel_is_clamped_to_what_the_pulse_times_allow(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set_fast(&bench);
    set(&bench, "position-scale", -200);
    set(&bench, "maxvel", 1e6);
    run(&bench);
    assert_near(get(&bench, "maxvel"), 500, 1e-9);
    assert_int_equal(noticed(&bench, HM2_NOTICE_VALUE_CLAMPED), 1);
    set(&bench, "maxvel", -30);
    set(&bench, "maxaccel", -7);
    run(&bench);
    assert_true(get(&bench, "maxvel") == 30.0);
    assert_true(get(&bench, "maxaccel") == 7.0);
    assert_int_equal(noticed(&bench, HM2_NOTICE_VALUE_CLAMPED), 3);
    rig_free(bench.rig);
}

/* Follow an S-curve; returns the largest distance, in steps, from where the command was a period before. */
static double follow(struct bench *const bench, const struct hm2_scurve *const move, const double from,
                     const double scale)
{
    double worst = 0.0, before = from;
    const unsigned cycles = (unsigned)ceil((move->total_s + 0.05) * 1e3);
    for (unsigned cycle = 0; cycle < cycles; cycle++) {
        double position, velocity;
        hm2_scurve_at(move, cycle * 1e-3, &position, &velocity);
        set(bench, "position-cmd", from + position);
        run(bench);
        worst = fmax(worst, fabs(get(bench, "position-fb") - before) * scale);
        before = from + position;
    }
    return worst;
}

static void position_mode_follows_an_s_curve_within_one_step(void **state)
{
    (void)state;
    static const double scales[] = {200, -200, 4000, 1};
    for (size_t i = 0; i < sizeof scales / sizeof scales[0]; i++) {
        struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
        struct hm2_scurve there, back;
        const double scale = fabs(scales[i]);
        assert_int_equal(hm2_scurve_plan(&there, 20000 / scale, 20000 / scale, 100000 / scale, 2e6 / scale), 0);
        assert_int_equal(hm2_scurve_plan(&back, -30000 / scale, 20000 / scale, 100000 / scale, 2e6 / scale), 0);
        set_fast(&bench);
        set(&bench, "position-scale", scales[i]);
        set(&bench, "maxvel", 25000 / scale);
        set(&bench, "maxaccel", 125000 / scale);
        run(&bench);
        set(&bench, "enable", 1);
        assert_true(follow(&bench, &there, 0, scale) < 1.0);
        assert_true(fabs(get(&bench, "position-fb") * scale - 20000) < 0.01);
        assert_true(follow(&bench, &back, 20000 / scale, scale) < 1.0);
        assert_true(fabs(get(&bench, "position-fb") * scale + 10000) < 0.01);
        assert_int_equal(noticed(&bench, HM2_NOTICE_HEADROOM), 0);
        rig_free(bench.rig);
    }
}

static void a_lost_cycle_is_made_good(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set_fast(&bench);
    set(&bench, "position-scale", 200);
    set(&bench, "maxaccel", 1000);
    set(&bench, "enable", 1);
    double command = 0.0;
    for (unsigned i = 0; i < 200; i++) {
        set(&bench, "position-cmd", command += 0.02);
        bench.rig->lose_writes = i % 20 == 7;
        run(&bench);
    }
    assert_true(fabs(get(&bench, "position-fb") - (command - 0.02)) < 0.005);
    rig_free(bench.rig);
}

/* The formulas of hal-interface 2.7, written down once more. */
static double model_velocity(const double fb, const double cmd, const double old, const double v0, const double a,
                             const double period_s)
{
    const double ff = (cmd - old) / period_s, verr = v0 - ff;
    double am = verr == 0 ? 0 : a > 0 ? (verr > 0 ? -a : a) : -fabs(verr) / period_s;
    const double s = am == 0 ? 0 : -verr / am;
    const double e = fb + (ff + v0) / 2 * (s + period_s) - (cmd + ff * s);
    if (s < period_s) {
        const double v = ff - 0.5 * e / period_s;
        return a > 0 ? fmax(v0 - a * period_s, fmin(v0 + a * period_s, v)) : v;
    }
    const double dp = -2 * am * period_s * s;
    if (fabs(e + 2 * dp) < fabs(e))
        am = -am;
    return v0 + am * period_s;
}

static void position_mode_is_the_documented_algorithm(void **state)
{
    (void)state;
    static const double accelerations[] = {1000, 20, 0};
    for (size_t k = 0; k < sizeof accelerations / sizeof accelerations[0]; k++) {
        struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
        set_fast(&bench);
        set(&bench, "position-scale", 1000);
        set(&bench, "maxaccel", accelerations[k]);
        run(&bench);
        set(&bench, "enable", 1);
        double old = 0.0, command = 0.0;
        for (unsigned i = 0; i < 2000; i++) {
            command = sin(i * 0.011) * 2.0 + (i > 1000 ? 0.5 : 0.0);
            const double v0 = get(&bench, "velocity-fb");
            set(&bench, "position-cmd", command);
            run(&bench);
            const double wanted = model_velocity(get(&bench, "position-fb"), command, old, v0, accelerations[k], 1e-3);
            assert_near(get(&bench, "velocity-fb"), fmax(-100, fmin(100, wanted)), 1e-6);
            assert_near(get(&bench, "dbg_ff_vel"), (command - old) * 1e3, 1e-6);
            assert_near(get(&bench, "dbg_vel_error"), v0 - (command - old) * 1e3, 1e-6);
            assert_true(get(&bench, "dbg_s_to_match") >= 0.0);
            assert_near(get(&bench, "dbg_pos_minus_prev_cmd"), get(&bench, "position-fb") - old, 1e-9);
            old = command;
        }
        rig_free(bench.rig);
    }
}

static void position_mode_takes_over_from_velocity_mode_without_a_jump(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set_fast(&bench);
    set(&bench, "position-scale", 1000);
    set(&bench, "maxaccel", 1000);
    set(&bench, "control-type", 1);
    set(&bench, "velocity-cmd", 10);
    set(&bench, "enable", 1);
    double command = 0.0;
    for (unsigned i = 0; i < 1000; i++) {
        run(&bench);
        command = get(&bench, "position-fb");
        set(&bench, "position-cmd", command);
    }
    run(&bench);
    set(&bench, "control-type", 0);
    for (unsigned i = 0; i < 50; i++) {
        set(&bench, "position-cmd", command += 0.01);
        run(&bench);
        assert_near(get(&bench, "dbg_ff_vel"), 10, 1);
        assert_near(get(&bench, "velocity-fb"), 10, 10);
    }
    rig_free(bench.rig);
}

static void a_command_beyond_the_limit_is_reported(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set_fast(&bench);
    set(&bench, "maxvel", 1000);
    set(&bench, "enable", 1);
    run(&bench);
    assert_int_equal(noticed(&bench, HM2_NOTICE_HEADROOM), 0);
    set(&bench, "position-cmd", 2);
    run(&bench);
    assert_int_equal(noticed(&bench, HM2_NOTICE_HEADROOM), 1);
    rig_free(bench.rig);
}

static void a_bite_stops_the_generators_and_they_start_from_rest(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set_fast(&bench);
    set(&bench, "maxaccel", 1000);
    set(&bench, "control-type", 1);
    set(&bench, "velocity-cmd", 1000);
    set(&bench, "enable", 1);
    run_many(&bench, 100);
    assert_true(rate(&bench) > 0);
    bench.rig->cycle.bitten = true;
    run(&bench);
    assert_int_equal(rate(&bench), 0);
    assert_true(get(&bench, "velocity-fb") == 0.0);
    bench.rig->cycle.bitten = false;
    run(&bench);
    assert_near(get(&bench, "velocity-fb"), 1.0, 1e-9);
    rig_free(bench.rig);
}

static void steps_that_reached_no_motor_are_not_counted(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    run(&bench);
    bench.accumulator[0] = 100 * (INT64_C(1) << 32);
    run(&bench);
    assert_true(get(&bench, "position-fb") == 100.0);
    bench.accumulator[0] = 200 * (INT64_C(1) << 32);
    bench.rig->cycle.undriven = 0.75; /* bitten meanwhile */
    run(&bench);
    assert_true(get(&bench, "position-fb") == 125.0);
    bench.accumulator[0] = -300 * (INT64_C(1) << 32);
    bench.rig->cycle.undriven = 1.0;
    run(&bench);
    assert_true(get(&bench, "position-fb") == 125.0);
    bench.accumulator[0] = -290 * (INT64_C(1) << 32);
    bench.rig->cycle.undriven = 0.0;
    run(&bench);
    assert_true(get(&bench, "position-fb") == 135.0);
    rig_free(bench.rig);
}

static void hostile_pins_never_leave_the_limits(void **state)
{
    (void)state;
    static const double evil[] = {NAN,  INFINITY, -INFINITY, 1e308, -1e308, 1e-308, 0.0, -0.0,
                                  1e18, -1e18,    4.9e-324,  1.0,   -1.0,   1e-7,   2.5};
    static const char *const names[] = {"position-cmd", "velocity-cmd", "position-scale", "maxvel", "maxaccel"};
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    uint32_t seed = 12345;
    set(&bench, "enable", 1);
    for (unsigned i = 0; i < 20000; i++) {
        seed = seed * 1664525u + 1013904223u;
        set(&bench, names[(seed >> 8) % 5], evil[(seed >> 16) % 15]);
        set(&bench, names[(seed >> 4) % 5], evil[(seed >> 20) % 15]);
        set(&bench, "control-type", seed >> 31);
        set(&bench, "steplen", seed % 7 ? 5000 : 0);
        set(&bench, "stepspace", seed % 11 ? 5000 : 0);
        run(&bench);
        const double scale = get(&bench, "position-scale"), velocity = get(&bench, "velocity-fb");
        assert_true(isfinite(velocity) && isfinite(scale) && fabs(scale) >= 1e-6);
        assert_true(isfinite(get(&bench, "position-fb")));
        assert_true(fabs(velocity * scale) <= CLOCK_HZ / 2 * 1.000001);
        if (i % 5 != 0)
            continue;
        run_many(&bench, STEPGEN_LOOKS);
        assert_true(isfinite(get(&bench, "maxvel")) && get(&bench, "maxvel") >= 0.0);
        assert_true(isfinite(get(&bench, "maxaccel")) && get(&bench, "maxaccel") >= 0.0);
    }
    set(&bench, "position-scale", -1e-9);
    run(&bench);
    assert_true(get(&bench, "position-scale") == -1.0);
    set(&bench, "position-scale", NAN);
    run(&bench);
    assert_true(get(&bench, "position-scale") == 1.0);
    rig_free(bench.rig);
}

static void a_command_that_is_no_number_holds_the_position(void **state)
{
    (void)state;
    struct bench bench = bench_open(rig_image_7i96s(), "num_stepgens=1");
    set_fast(&bench);
    set(&bench, "position-scale", 100);
    set(&bench, "maxaccel", 1000);
    set(&bench, "enable", 1);
    double command = 0.0;
    for (unsigned i = 0; i < 100; i++) {
        set(&bench, "position-cmd", command += 0.01);
        run(&bench);
    }
    set(&bench, "position-cmd", NAN);
    run_many(&bench, 100);
    assert_true(fabs(get(&bench, "position-fb") - command) < 0.01);
    assert_int_equal(noticed(&bench, HM2_NOTICE_VALUE_INVALID), 100);
    rig_free(bench.rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_default_times_are_the_longest_and_the_generators_get_their_clock),
        cmocka_unit_test(every_generator_has_fourteen_pins_and_twelve_parameters),
        cmocka_unit_test(a_changed_parameter_is_seen_within_a_round_of_looks),
        cmocka_unit_test(without_generators_in_use_there_is_nothing),
        cmocka_unit_test(pins_up_to_the_width_are_claimed_and_driven_from_the_first_write_on),
        cmocka_unit_test(outputs_are_named_as_in_aliases),
        cmocka_unit_test(times_are_truncated_to_clocks_and_clamped_to_fourteen_bits),
        cmocka_unit_test(a_timer_number_selects_a_timer_and_nonsense_the_reference),
        cmocka_unit_test(the_timer_register_is_left_alone_where_another_module_lives),
        cmocka_unit_test(swapping_exists_on_firmware_that_can),
        cmocka_unit_test(a_table_is_pushed_last_entry_first_then_its_length_then_the_mode),
        cmocka_unit_test(two_equal_changes_of_a_table_do_not_cancel),
        cmocka_unit_test(a_table_that_is_too_long_is_refused),
        cmocka_unit_test(mode_and_table_come_back_after_the_card_lost_its_power),
        cmocka_unit_test(the_position_starts_at_zero_and_survives_a_power_cycle),
        cmocka_unit_test(a_million_wraps_in_both_directions_do_not_drift),
        cmocka_unit_test(position_reset_holds_the_position_at_zero),
        cmocka_unit_test(a_disabled_generator_stands_still),
        cmocka_unit_test(velocity_mode_ramps_with_maxaccel_up_to_maxvel),
        cmocka_unit_test(maxvel_is_clamped_to_what_the_pulse_times_allow),
        cmocka_unit_test(position_mode_follows_an_s_curve_within_one_step),
        cmocka_unit_test(a_lost_cycle_is_made_good),
        cmocka_unit_test(position_mode_is_the_documented_algorithm),
        cmocka_unit_test(a_command_beyond_the_limit_is_reported),
        cmocka_unit_test(a_bite_stops_the_generators_and_they_start_from_rest),
        cmocka_unit_test(steps_that_reached_no_motor_are_not_counted),
        cmocka_unit_test(hostile_pins_never_leave_the_limits),
        cmocka_unit_test(a_command_that_is_no_number_holds_the_position),
        cmocka_unit_test(position_mode_takes_over_from_velocity_mode_without_a_jump),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
