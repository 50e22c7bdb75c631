/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "module_rig.h"
#include "module_types.h"

#define DATA(unit) (uint16_t)(0x7D00 + 4 * (unit))
#define RATE(unit) (uint16_t)(0x7E00 + 4 * (unit))

static const struct rig_md two_units[] = {
    {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
    {HM2_GTAG_SSR, 0, 1, 2, 0x7D00, 2, 0x00, 0x03},
};
/* unit 0: outputs 2 and 30; unit 1: output 0, twice, and the references of both */
static const uint32_t two_units_pins[] = {0x0300C383, 0x0300C39F, 0x0301C381, 0x0301C381, 0x0300C3A0, 0x0301C3A0};

static struct module_rig *started(const struct hm2_image *image, const char *config, struct hm2_module **ssr)
{
    struct module_rig *const rig = rig_new(image, config);
    struct hm2_module *const module = rig_add(rig, &hm2_ssr_type);
    if (ssr)
        *ssr = module;
    (void)rig_add(rig, &hm2_ioport_type);
    rig_start(rig);
    return rig;
}

static void a_7i96s_has_outputs_0_to_3_and_no_pin_for_the_reference(void **state)
{
    (void)state;
    struct module_rig *const rig = started(rig_image_7i96s(), "", NULL);
    for (unsigned i = 0; i < 32; i++) {
        char name[32];
        (void)snprintf(name, sizeof name, "ssr.00.out-%02u", i);
        assert_int_equal(rig_has(rig, name), i < 4);
        (void)snprintf(name, sizeof name, "ssr.00.invert-%02u", i);
        assert_int_equal(rig_has(rig, name), i < 4);
    }
    assert_true(rig_get(rig, "ssr.00.rate") == 1000000.0);
    assert_true(rig_has(rig, "gpio.033.invert_output"));
    assert_false(rig_has(rig, "gpio.033.out"));
    rig_free(rig);
}

static void both_registers_are_zero_until_the_first_write(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    rig->written[DATA(0) / 4] = rig->written[RATE(0) / 4] = 0xFFFFFFFF;
    (void)rig_add(rig, &hm2_ssr_type);
    rig_start(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 0);
    assert_int_equal(rig_written(rig, RATE(0)), 0);
    rig_free(rig);
}

static void the_default_rate_is_0x1030_and_is_written_after_the_ports(void **state)
{
    (void)state;
    struct module_rig *const rig = started(rig_image_7i96s(), "", NULL);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, RATE(0)), 0x1030);
    assert_true(rig_position(rig, RATE(0)) > rig_position(rig, 0x1104));
    assert_true(rig_wrote(rig, 0x1104));
    rig_cycle(rig);
    assert_false(rig_wrote(rig, RATE(0)));
    rig_free(rig);
}

static void outputs_are_value_xor_inversion_in_every_cycle(void **state)
{
    (void)state;
    struct module_rig *const rig = started(rig_image_7i96s(), "", NULL);
    rig_set(rig, "ssr.00.out-00", 1);
    rig_set(rig, "ssr.00.out-03", 1);
    rig_set(rig, "ssr.00.invert-03", 1);
    rig_set(rig, "ssr.00.invert-01", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 0x3);
    rig_set(rig, "ssr.00.out-00", 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 0x2);
    rig_free(rig);
}

static void rates_follow_the_formula_within_their_limits(void **state)
{
    (void)state;
    static const struct {
        double wanted;
        uint32_t value;
    } rows[] = {
        {0, 0},
        {25000, 0x1000 | 1998},
        {24999, 0x1000 | 1998},
        {1, 0x1000 | 1998},
        {100000, 0x1000 | 498},
        {25000000, 0x1000},
        {25000001, 0x1000},
        {4294967295.0, 0x1000},
    };
    struct hm2_module *ssr;
    struct module_rig *const rig = started(rig_image_7i96s(), "", &ssr);
    rig_cycle(rig);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        rig_set(rig, "ssr.00.rate", rows[i].wanted);
        rig_cycles(rig, 2);
        assert_int_equal(rig_written(rig, RATE(0)), rows[i].value);
        assert_true(rig_get(rig, "ssr.00.rate") == rows[i].wanted); /* pins are not rewritten */
    }
    assert_int_equal(ssr->noticed[HM2_NOTICE_VALUE_CLAMPED], 4);
    rig_free(rig);
}

static void every_instance_has_its_own_address_and_outputs(void **state)
{
    (void)state;
    struct module_rig *const rig = started(rig_image_with(two_units, 2, two_units_pins, 6), "", NULL);
    assert_true(rig_has(rig, "ssr.00.out-02"));
    assert_true(rig_has(rig, "ssr.00.out-30"));
    assert_false(rig_has(rig, "ssr.00.out-00"));
    assert_false(rig_has(rig, "ssr.00.out-31"));
    assert_true(rig_has(rig, "ssr.01.out-00"));
    assert_false(rig_has(rig, "ssr.01.out-02"));
    rig_cycle(rig);
    rig_set(rig, "ssr.01.rate", 100000);
    rig_set(rig, "ssr.00.out-30", 1);
    rig_set(rig, "ssr.01.out-00", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, RATE(0)), 0x1030);
    assert_int_equal(rig_written(rig, RATE(1)), 0x1000 | 498);
    assert_int_equal(rig_written(rig, DATA(0)), 1u << 30);
    assert_int_equal(rig_written(rig, DATA(1)), 1);
    rig_free(rig);
}

static void a_slow_divisor_stays_below_the_carry(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    for (unsigned i = 0; i < rig->idrom.module_count; i++)
        rig->idrom.modules[i].clock_hz = 200000000;
    (void)rig_add(rig, &hm2_ssr_type);
    rig_start(rig);
    rig_set(rig, "ssr.00.rate", 25000);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, RATE(0)), 0x17FF);
    rig_free(rig);
}

static void pins_of_unused_instances_stay_gpio(void **state)
{
    (void)state;
    struct module_rig *const rig = started(rig_image_with(two_units, 2, two_units_pins, 6), "num_ssrs=1", NULL);
    assert_false(rig_has(rig, "ssr.01.rate"));
    assert_true(rig_has(rig, "gpio.002.out"));
    assert_false(rig_has(rig, "gpio.000.out"));
    rig_free(rig);
    struct module_rig *const none = started(rig_image_7i96s(), "num_ssrs=0", NULL);
    assert_false(rig_has(none, "ssr.00.rate"));
    assert_true(rig_has(none, "gpio.033.out"));
    rig_cycles(none, 2);
    rig_free(none);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_7i96s_has_outputs_0_to_3_and_no_pin_for_the_reference),
        cmocka_unit_test(both_registers_are_zero_until_the_first_write),
        cmocka_unit_test(the_default_rate_is_0x1030_and_is_written_after_the_ports),
        cmocka_unit_test(outputs_are_value_xor_inversion_in_every_cycle),
        cmocka_unit_test(rates_follow_the_formula_within_their_limits),
        cmocka_unit_test(every_instance_has_its_own_address_and_outputs),
        cmocka_unit_test(a_slow_divisor_stays_below_the_carry),
        cmocka_unit_test(pins_of_unused_instances_stay_gpio),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
