/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Multiplexed encoders: what differs from the plain ones, and the recorded firmware (tests/data/encoder_muxed). */
#include "encoder.h"
#include "module_rig.h"
#include "module_types.h"
#include "trace_file.h"
#include "unit.h"

enum { COUNT = 0x3600, CONTROL = 0x3700, DIVISOR = 0x3800, STAMP = 0x3900, FILTER = 0x3A00 };

static const uint32_t pins[] = {
    0x03000C01, 0x03000C02, 0x03000C03, 0x03010C01, 0x03010C02, 0x03010C03, 0x03060D81, 0x03800D82,
};

static struct module_rig *open_rig(const uint8_t version, const char *const config)
{
    const struct rig_md modules[] = {
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
        {HM2_GTAG_MUXED_ENCODER, version, 1, 4, COUNT, 5, 0x00, 3},
        {HM2_GTAG_MUXED_ENCODER_SEL, 0, 1, 1, 0x0000, 0, 0x00, 0},
    };
    struct module_rig *const rig = rig_new(rig_image_with(modules, 3, pins, 8), config);
    (void)rig_add(rig, &hm2_muxed_encoder_type);
    rig_start(rig);
    return rig;
}

static void the_names_are_those_of_encoders_with_two_rates_of_their_own(void **state)
{
    (void)state;
    struct module_rig *rig = open_rig(3, "");
    assert_string_equal(rig->modules[0].type->name, "encoder");
    assert_int_equal(rig_get(rig, "encoder.muxed-sample-frequency"), 8333333); /* 8 MHz is no divisor of the clock */
    assert_false(rig_has(rig, "encoder.sample-frequency"));
    assert_false(rig_has(rig, "encoder.muxed-skew"));
    assert_true(rig_has(rig, "encoder.03.position"));
    assert_false(rig_has(rig, "encoder.00.probe-enable"));
    assert_false(rig_has(rig, "encoder.timer-number"));
    assert_int_equal(rig_written(rig, FILTER), 10);
    assert_int_equal(rig_written(rig, DIVISOR), 48);
    rig_free(rig);
    rig = open_rig(0x84, "");
    assert_true(rig_has(rig, "encoder.muxed-skew"));
    assert_true(rig_has(rig, "encoder.03.probe-enable"));
    rig_free(rig);
}

static void a_unit_carries_two_encoders_and_the_select_pins_run_from_load_on(void **state)
{
    (void)state;
    struct module_rig *rig = open_rig(3, "num_encoders=3");
    for (unsigned io = 0; io < 8; io++) {
        assert_ptr_equal(rig->pins[io].owner, &rig->modules[0]);
        assert_int_equal(rig->pins[io].immediate, io >= 6);
    }
    rig_free(rig);
    rig = open_rig(3, "num_encoders=2");
    assert_non_null(rig->pins[2].owner);
    assert_null(rig->pins[3].owner);
    assert_non_null(rig->pins[6].owner);
    rig_free(rig);
}

static void select_outputs_have_names_and_inputs_have_none(void **state)
{
    (void)state;
    const char *(*const name)(const struct hm2_pd *) = hm2_muxed_encoder_type.output_name;
    assert_string_equal(name(&(struct hm2_pd){.secondary_tag = 0x0D, .secondary_pin = 0x81}), "sel0");
    assert_string_equal(name(&(struct hm2_pd){.secondary_tag = 0x0D, .secondary_pin = 0x82}), "sel1");
    assert_null(name(&(struct hm2_pd){.secondary_tag = 0x0D, .secondary_pin = 0x83}));
    assert_null(name(&(struct hm2_pd){.secondary_tag = 0x0C, .secondary_pin = 0x01}));
    assert_null(name(&(struct hm2_pd){.secondary_tag = 0x0C, .secondary_pin = 0x81}));
}

static void the_skew_is_rounded_to_clocks_beside_the_rate(void **state)
{
    (void)state;
    static const struct {
        uint32_t wanted_ns, field, actual_ns;
    } cases[] = {{50, 5, 50}, {54, 5, 50}, {55, 6, 60}, {4, 0, 0}, {150, 15, 150}, {1000000, 15, 150}, {0, 0, 0}};
    struct module_rig *const rig = open_rig(4, "");
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rig_set(rig, "encoder.muxed-skew", cases[i].wanted_ns);
        rig_cycles(rig, ENCODER_LOOKS);
        assert_int_equal(rig_written(rig, FILTER), 10 | cases[i].field << 28);
        assert_int_equal(rig_get(rig, "encoder.muxed-skew"), cases[i].actual_ns);
    }
    rig_free(rig);
}

static void the_power_up_rate_of_the_firmware_is_a_rate_we_can_set(void **state)
{
    (void)state;
    /* README of the traces: the select pin changes every filterrate + 2 clocks, 11 at power-up. */
    uint32_t actual_hz;
    assert_int_equal(encoder_filter_rate(100000000, 7692308, &actual_hz), 10);
    assert_int_equal(encoder_filter_rate(100000000, 7692307, &actual_hz), 11);
    assert_int_equal(actual_hz, 100000000 / 13);
}

static void encoders_do_not_disturb_each_others_latches(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(3, "");
    for (uint16_t i = 0; i < 4; i++)
        rig_put(rig, (uint16_t)(CONTROL + 4 * i), 0x0800);
    rig_cycles(rig, 2);
    rig_set(rig, "encoder.01.index-enable", 1);
    rig_cycle(rig);
    assert_true(rig_wrote(rig, CONTROL + 4));
    rig_put(rig, CONTROL + 4, 0x0850);
    rig_cycle(rig);
    rig_set(rig, "encoder.02.index-invert", 1);
    bool written = false;
    for (unsigned i = 0; i < ENCODER_LOOKS; i++) { /* parameters are looked at in turns */
        rig_cycle(rig);
        written = written || rig_wrote(rig, CONTROL + 8);
        assert_false(rig_wrote(rig, CONTROL + 4)); /* a second write could arm a latch that has just fired */
    }
    assert_true(written);
    rig_free(rig);
}

/* Recorded registers are of two encoders; the trace calls them 0 and 1. */
static void recorded_counts_are_shown(void **state)
{
    (void)state;
    static const struct {
        const char *test;
        int counts[2][3]; /* after each pair of reads */
        unsigned pairs;
    } cases[] = {
        /* from the notes and descriptions: 5 up on 0, then 3 down on 1, then 6 up on both */
        {"basic", {{0, 5, 5}, {0, 0, -3}}, 3},
        {"speed30", {{20, 20}, {0, 20}}, 2},
        {"speed80", {{20, 20}, {0, 20}}, 2},
        {"speed20", {{0, 0}, {0, 0}}, 2},
    };
    struct trace_file trace = trace_load("encoder_muxed");
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        struct module_rig *const rig = open_rig(3, "num_encoders=2");
        size_t at0 = 0, at1 = 0;
        for (unsigned pair = 0; pair < cases[c].pairs; pair++) {
            const struct trace_event *const count0 = trace_find(&trace, &at0, cases[c].test, 'R', "count0");
            const struct trace_event *const count1 = trace_find(&trace, &at1, cases[c].test, 'R', "count1");
            assert_true(count0 && count1);
            rig_put(rig, COUNT, count0 ? count0->value : 0);
            rig_put(rig, COUNT + 4, count1 ? count1->value : 0);
            rig_cycle(rig);
            assert_int_equal(rig_get(rig, "encoder.00.count"), cases[c].counts[0][pair]);
            assert_int_equal(rig_get(rig, "encoder.01.count"), cases[c].counts[1][pair]);
        }
        rig_free(rig);
    }
    trace_free(&trace);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_names_are_those_of_encoders_with_two_rates_of_their_own),
        cmocka_unit_test(a_unit_carries_two_encoders_and_the_select_pins_run_from_load_on),
        cmocka_unit_test(select_outputs_have_names_and_inputs_have_none),
        cmocka_unit_test(the_skew_is_rounded_to_clocks_beside_the_rate),
        cmocka_unit_test(the_power_up_rate_of_the_firmware_is_a_rate_we_can_set),
        cmocka_unit_test(encoders_do_not_disturb_each_others_latches),
        cmocka_unit_test(recorded_counts_are_shown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
