/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Step generators, encoders and PWM on the simulated card: what one commands, the other measures. */
#include <hm2/sim.h>

#include <math.h>

#include "module_rig.h"
#include "module_types.h"
#include "sim_card.h"
#include "unit.h"

#define CLOCK_NS 10

/* Inputs of encoder 0 (register map 4.1). */
enum { PIN_A = 0x01, PIN_B = 0x02, PIN_INDEX = 0x03 };
/* Output of step generator 0, and what makes it reach a pad. */
enum { PIN_STEP = 0x81, REG_DDR = 0x1100, REG_SOURCE = 0x1200 };

struct bench {
    struct module_rig *rig;
    struct sim_card *card;
    int quadrature; /* place of the encoder's disc */
};

static struct bench bench_open(const char *const profile)
{
    struct bench bench = {0};
    struct hm2_diag diag = {0};
    const struct hm2_image *const image = strcmp(profile, "7i93") == 0 ? rig_image_7i93() : rig_image_7i96s();
    const struct sim_card_options options = {.profile = profile, .image = image, .seed = 1};
    if (sim_card_new(&bench.card, &options, &diag) != 0)
        fail_msg("%s", diag.text);
    bench.rig = rig_new(image, "");
    bench.rig->card = bench.card;
    (void)rig_add(bench.rig, &hm2_encoder_type);
    (void)rig_add(bench.rig, &hm2_pwmgen_type);
    (void)rig_add(bench.rig, &hm2_stepgen_type);
    rig_start(bench.rig);
    rig_cycles(bench.rig, 3);
    return bench;
}

static void bench_close(struct bench *const bench)
{
    rig_free(bench->rig);
    sim_card_free(bench->card);
}

static void set_up_generator(const struct bench *const bench)
{
    struct module_rig *const rig = bench->rig;
    rig_set(rig, "stepgen.00.steplen", 1000);
    rig_set(rig, "stepgen.00.stepspace", 1000);
    rig_set(rig, "stepgen.00.position-scale", 1000);
    rig_set(rig, "stepgen.00.maxaccel", 5000);
    rig_cycles(rig, 6);
    rig_set(rig, "stepgen.00.enable", 1);
}

static void drive(const struct bench *const bench, const uint8_t pin, const bool level)
{
    assert_int_equal(
        sim_card_drive_input(bench->card, bench->rig->clk, HM2_GTAG_ENCODER, 0, pin, level ? SIM_HIGH : SIM_LOW), 0);
}

/* One edge of the disc, well inside a period. */
static void turn(struct bench *const bench, const int direction)
{
    bench->quadrature += direction;
    const int place = bench->quadrature & 3;
    drive(bench, PIN_A, place == 1 || place == 2);
    drive(bench, PIN_B, place >= 2);
    bench->rig->clk += 2000;
    bench->rig->cycle.now_ns += 2000 * CLOCK_NS;
}

/* The board does that, which is not here: the steps reach their pad. */
static void drive_step_pad(const struct bench *const bench)
{
    const struct hm2_idrom *const idrom = sim_card_idrom(bench->card);
    const unsigned io = sim_pad_of(idrom, HM2_GTAG_STEPGEN, 0, PIN_STEP);
    const uint16_t port = (uint16_t)(4 * (io / idrom->port_width));
    sim_card_write(bench->card, sim_card_clock(bench->card), (uint16_t)(REG_DDR + port), 1u << io % idrom->port_width);
    sim_card_write(bench->card, sim_card_clock(bench->card), (uint16_t)(REG_SOURCE + port),
                   1u << io % idrom->port_width);
}

static void an_encoder_on_the_motor_measures_what_was_commanded(void **state)
{
    (void)state;
    struct bench bench = bench_open("7i96s");
    struct module_rig *const rig = bench.rig;
    assert_int_equal(sim_card_follow(bench.card, 0, 0, 4, 1), 0);
    drive_step_pad(&bench);
    rig_set(rig, "encoder.00.scale", 4000);
    set_up_generator(&bench);
    double command = 0.0;
    for (unsigned i = 0; i < 3000; i++) {
        /* 20 units/s forth, a stop, and 8 units/s back */
        command += i < 1000 ? 0.02 : i < 1500 ? 0.0 : -0.008;
        rig_set(rig, "stepgen.00.position-cmd", command);
        rig_cycle(rig);
        const double by_steps = rig_get(rig, "stepgen.00.position-fb");
        const double by_counts = rig_get(rig, "encoder.00.position");
        assert_true(fabs(by_steps - by_counts) < 0.001 + 20e-6); /* one step, and what passes during a packet */
        const double velocity = rig_get(rig, "encoder.00.velocity");
        if (i == 900)
            assert_true(fabs(velocity - 20.0) < 0.05);
        if (i == 2900)
            assert_true(fabs(velocity + 8.0) < 0.05);
    }
    assert_true(fabs(rig_get(rig, "stepgen.00.position-fb") - (20.0 - 12.0)) < 0.01);
    bench_close(&bench);
}

static void velocity_mode_makes_the_steps_it_reports(void **state)
{
    (void)state;
    struct bench bench = bench_open("7i93");
    struct module_rig *const rig = bench.rig;
    set_up_generator(&bench);
    rig_set(rig, "stepgen.00.control-type", 1);
    rig_set(rig, "stepgen.00.velocity-cmd", -123.456);
    rig_cycles(rig, 100);
    const double from = rig_get(rig, "stepgen.00.position-fb");
    rig_cycles(rig, 1000);
    /* The rate register is exact to clock / 2^32 steps/s. */
    assert_true(fabs(rig_get(rig, "stepgen.00.position-fb") - from + 123.456) < 1e-4);
    assert_true(fabs(rig_get(rig, "stepgen.00.velocity-fb") + 123.456) < 1e-9);
    bench_close(&bench);
}

static void an_index_is_found_at_its_place_and_once(void **state)
{
    (void)state;
    struct bench bench = bench_open("7i96s");
    struct module_rig *const rig = bench.rig;
    drive(&bench, PIN_A, false);
    drive(&bench, PIN_B, false);
    drive(&bench, PIN_INDEX, false);
    rig_set(rig, "encoder.00.index-invert", 1);
    rig_cycles(rig, 3);
    for (int revolution = 0; revolution < 3; revolution++) {
        rig_set(rig, "encoder.00.index-enable", 1);
        rig_cycle(rig);
        for (int edge = 0; edge < 40; edge++) {
            turn(&bench, 1);
            if (edge == 20) {
                drive(&bench, PIN_INDEX, true);
                rig->clk += 2000;
                drive(&bench, PIN_INDEX, false);
                rig->clk += 2000;
            }
            if (edge % 5 == 4)
                rig_cycle(rig);
            assert_int_equal(rig_get(rig, "encoder.00.index-enable"), edge < 24);
        }
        assert_int_equal(rig_get(rig, "encoder.00.count"), 19); /* the index came after the 21st of 40 */
        rig_cycle(rig);
    }
    bench_close(&bench);
}

static void an_impossible_transition_is_reported_from_the_enable_on(void **state)
{
    (void)state;
    struct bench bench = bench_open("7i96s");
    struct module_rig *const rig = bench.rig;
    for (int round = 0; round < 2; round++) {
        for (int both = 0; both < 2; both++) { /* A and B change together */
            drive(&bench, PIN_A, both);
            drive(&bench, PIN_B, both);
            rig_cycles(rig, 2);
        }
        assert_int_equal(rig_get(rig, "encoder.00.quad-error"), round);
        rig_set(rig, "encoder.00.quad-error-enable", 1);
        rig_cycles(rig, 4);
        assert_int_equal(rig_get(rig, "encoder.00.quad-error"), round);
    }
    rig_set(rig, "encoder.00.quad-error-enable", 0);
    rig_cycles(rig, 2);
    rig_set(rig, "encoder.00.quad-error-enable", 1);
    rig_cycles(rig, 4);
    assert_int_equal(rig_get(rig, "encoder.00.quad-error"), 0);
    bench_close(&bench);
}

static void everything_works_again_after_a_power_cycle(void **state)
{
    (void)state;
    struct bench bench = bench_open("7i96s");
    struct module_rig *const rig = bench.rig;
    set_up_generator(&bench);
    rig_set(rig, "stepgen.00.control-type", 1);
    rig_set(rig, "stepgen.00.velocity-cmd", 50);
    rig_cycles(rig, 200);
    const double before = rig_get(rig, "stepgen.00.position-fb");
    sim_card_power_cycle(bench.card);
    assert_int_equal(sim_card_read(bench.card, rig->clk, 0x2900, NULL), 0);
    /* As a board does: everything again, read once, start. */
    hm2_plan_touch_all(rig->plan);
    rig_write_out(rig);
    rig_read(rig);
    for (unsigned i = 0; i < rig->count; i++)
        if (rig->modules[i].type->start)
            rig->modules[i].type->start(&rig->modules[i], &rig->cycle);
    rig_cycles(rig, 1000);
    const double moved = rig_get(rig, "stepgen.00.position-fb") - before;
    assert_true(sim_card_read(bench.card, rig->clk, 0x2900, NULL) == 0xFFFFFFFF);
    assert_true(fabs(rig_get(rig, "stepgen.00.velocity-fb") - 50) < 1e-9);
    assert_true(fabs(moved - 50) < 10); /* from rest again */
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_encoder_on_the_motor_measures_what_was_commanded),
        cmocka_unit_test(velocity_mode_makes_the_steps_it_reports),
        cmocka_unit_test(an_index_is_found_at_its_place_and_once),
        cmocka_unit_test(an_impossible_transition_is_reported_from_the_enable_on),
        cmocka_unit_test(everything_works_again_after_a_power_cycle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
