/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Generations of the firmware: each version that a module's descriptor may have, on a simulated card that follows it,
 * drives and counts under the whole driver. What differs without a word in the descriptor (SSI, BISS, Fanuc) is in
 * test_absenc; serial ports of all generations are in test_serial, smart serial of both in test_sserial_sim.
 */
#include "unit.h"

#include <math.h>

#include "idrom_files.h"
#include "sim_bench.h"

#define TARGET      700.0
#define MOTOR_SPEED 20000 /* counts a second at full duty */

struct generation {
    const char *image; /* NULL: the card's own */
    uint8_t gtag, version;
    const char *has, *lacks; /* points that come and go with the version */
};

static struct sim_bench *open_bench(const struct generation *const g, const char *const profile)
{
    static struct hm2_image image;
    struct sim_card_options options = {.profile = profile, .seed = 1};
    if (g->image) {
        load_image(g->image, &image);
        set_image_version(&image, g->gtag, g->version);
        options.image = &image;
    }
    struct sim_bench *const bench = sim_bench_of(&options, "");
    if (g->has && !sim_bench_has(bench, g->has))
        fail_msg("version 0x%02X has no %s", g->version, g->has);
    if (g->lacks && sim_bench_has(bench, g->lacks))
        fail_msg("version 0x%02X has %s", g->version, g->lacks);
    return bench;
}

static void expect_near(const struct generation *const g, const struct sim_bench *const bench, const char *const name,
                        const double value, const double by)
{
    const double found = sim_bench_get(bench, name);
    if (fabs(found - value) > by)
        fail_msg("tag 0x%02X version 0x%02X: %s is %g instead of %g", g->gtag, g->version, name, found, value);
}

static void run(struct sim_bench *const bench, const unsigned cycles)
{
    for (unsigned i = 0; i < cycles; i++)
        sim_bench_cycle(bench);
}

/* A motor at half its speed backwards, for a second. */
static void turn_a_motor(const struct generation *const g, struct sim_bench *const bench, const char *const encoder)
{
    sim_bench_set(bench, "pwmgen.00.value", -0.5);
    sim_bench_set(bench, "pwmgen.00.enable", 1);
    run(bench, 1000);
    expect_near(g, bench, encoder, -MOTOR_SPEED / 2.0, MOTOR_SPEED * 0.01);
}

static void step_generators_encoders_and_pwm_generators_of_every_version_work(void **state)
{
    (void)state;
#define IMAGE TEST_DATA "/idrom/SVST8_4_72.hex"
    static const struct generation rows[] = {
        {NULL, HM2_GTAG_STEPGEN, 2, NULL, NULL}, /* with the newer address map */
        {IMAGE, HM2_GTAG_STEPGEN, 0, NULL, "stepgen.00.swap_step_dir"},
        {IMAGE, HM2_GTAG_STEPGEN, 1, NULL, "stepgen.00.swap_step_dir"},
        {IMAGE, HM2_GTAG_STEPGEN, 2, NULL, "stepgen.00.swap_step_dir"},
        {IMAGE, HM2_GTAG_STEPGEN, 0x42, "stepgen.00.swap_step_dir", "stepgen.00.position-latch"},
        {IMAGE, HM2_GTAG_STEPGEN, 0xC2, "stepgen.00.position-latch", NULL},
        {IMAGE, HM2_GTAG_ENCODER, 1, NULL, "encoder.00.probe-enable"},
        {IMAGE, HM2_GTAG_ENCODER, 2, NULL, "encoder.00.probe-enable"},
        {IMAGE, HM2_GTAG_ENCODER, 3, NULL, "encoder.00.probe-enable"},
        {IMAGE, HM2_GTAG_ENCODER, 0x83, "encoder.00.probe-enable", NULL},
        {IMAGE, HM2_GTAG_PWMGEN, 0, NULL, "pwmgen.00.dither"},
        {IMAGE, HM2_GTAG_PWMGEN, 1, "pwmgen.00.dither", NULL},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sim_bench *const bench = open_bench(&rows[i], rows[i].image ? "7i80hd-16" : "7i93");
        assert_int_equal(sim_card_follow(bench->card, 0, 0, 2, 1), 0);
        assert_int_equal(sim_card_motor(bench->card, 1, 0, MOTOR_SPEED), 0);
        sim_bench_set(bench, "stepgen.00.steplen", 2000);
        sim_bench_set(bench, "stepgen.00.stepspace", 2000);
        sim_bench_set(bench, "stepgen.00.maxaccel", 1e6);
        sim_bench_set(bench, "stepgen.00.position-cmd", TARGET);
        sim_bench_set(bench, "stepgen.00.enable", 1);
        turn_a_motor(&rows[i], bench, "encoder.01.count");
        expect_near(&rows[i], bench, "stepgen.00.position-fb", TARGET, 1.5);
        expect_near(&rows[i], bench, "encoder.00.count", 2 * TARGET, 3);
        expect_near(&rows[i], bench, "watchdog.has_bit", 0, 0);
        sim_bench_free(bench);
    }
#undef IMAGE
}

static void muxed_encoders_of_every_version_count(void **state)
{
    (void)state;
#define IMAGE TEST_DATA "/idrom/SV12IM_2X7I48_72.hex"
    static const struct generation rows[] = {
        {IMAGE, HM2_GTAG_MUXED_ENCODER, 2, NULL, "encoder.00.probe-enable"},
        {IMAGE, HM2_GTAG_MUXED_ENCODER, 3, NULL, "encoder.muxed-skew"},
        {IMAGE, HM2_GTAG_MUXED_ENCODER, 4, "encoder.muxed-skew", "encoder.00.probe-enable"},
        {IMAGE, HM2_GTAG_MUXED_ENCODER, 0x84, "encoder.00.probe-enable", NULL},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sim_bench *const bench = open_bench(&rows[i], "7i80hd-16");
        assert_int_equal(sim_card_motor(bench->card, 5, 0, MOTOR_SPEED), 0);
        turn_a_motor(&rows[i], bench, "encoder.05.count");
        sim_bench_free(bench);
    }
#undef IMAGE
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(step_generators_encoders_and_pwm_generators_of_every_version_work),
        cmocka_unit_test(muxed_encoders_of_every_version_count),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
