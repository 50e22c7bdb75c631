/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "module_rig.h"
#include "module_types.h"

#define DATA(unit) (uint16_t)(0xB000 + 4 * (unit))

static struct module_rig *started(const struct hm2_image *image, const char *config)
{
    struct module_rig *const rig = rig_new(image, config);
    (void)rig_add(rig, &hm2_outm_type);
    (void)rig_add(rig, &hm2_ioport_type);
    rig_start(rig);
    return rig;
}

static void a_7i96s_has_outputs_4_and_5(void **state)
{
    (void)state;
    struct module_rig *const rig = started(rig_image_7i96s(), "");
    static const struct {
        const char *name;
        bool exists;
    } rows[] = {
        {"outm.00.out-04", true},    {"outm.00.out-05", true},  {"outm.00.invert-04", true},
        {"outm.00.invert-05", true}, {"outm.00.out-00", false}, {"outm.00.out-06", false},
        {"outm.01.out-04", false},   {"gpio.015.out", false},   {"gpio.015.invert_output", true},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_int_equal(rig_has(rig, rows[i].name), rows[i].exists);
    rig_free(rig);
}

static void outputs_are_value_xor_inversion_in_every_cycle(void **state)
{
    (void)state;
    struct module_rig *const rig = started(rig_image_7i96s(), "");
    assert_int_equal(rig_written(rig, DATA(0)), 0);
    rig_set(rig, "outm.00.out-04", 1);
    rig_set(rig, "outm.00.invert-05", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 0x30);
    rig_set(rig, "outm.00.invert-04", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 0x20);
    rig_free(rig);
}

static void outputs_stay_off_from_a_bite_until_it_is_acknowledged(void **state)
{
    (void)state;
    struct module_rig *const rig = started(rig_image_7i96s(), "");
    rig_set(rig, "outm.00.out-04", 1);
    rig_set(rig, "outm.00.invert-05", 1);
    rig->cycle.bitten = true;
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 0);
    rig->cycle.bitten = false;
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 0x30);
    rig_free(rig);
}

static void instances_have_their_own_words_up_to_output_31(void **state)
{
    (void)state;
    static const struct rig_md modules[] = {
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
        {HM2_GTAG_OUTM, 0, 1, 2, 0xB000, 1, 0x00, 0x01},
    };
    static const uint32_t pins[] = {0x03002DA0, 0x03012D81, 0x03002D80, 0x03002D01, 0x03002DFF};
    struct module_rig *const rig = started(rig_image_with(modules, 2, pins, 5), "");
    rig_set(rig, "outm.00.out-31", 1);
    rig_set(rig, "outm.01.out-00", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 0x80000000);
    assert_int_equal(rig_written(rig, DATA(1)), 1);
    unsigned outputs = 0; /* codes without a meaning make none */
    for (size_t i = 0; i < hm2_plain_count(rig->plain); i++)
        outputs += strstr(hm2_plain_at(rig->plain, i)->name, ".outm.") != NULL;
    assert_int_equal(outputs, 4);
    rig_free(rig);
}

static void pins_are_gpio_when_no_outm_is_wanted(void **state)
{
    (void)state;
    struct module_rig *const rig = started(rig_image_7i96s(), "num_outms=0");
    assert_false(rig_has(rig, "outm.00.out-04"));
    assert_true(rig_has(rig, "gpio.015.out"));
    rig_cycle(rig);
    assert_false(rig_wrote(rig, DATA(0)));
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_7i96s_has_outputs_4_and_5),
        cmocka_unit_test(outputs_are_value_xor_inversion_in_every_cycle),
        cmocka_unit_test(outputs_stay_off_from_a_bite_until_it_is_acknowledged),
        cmocka_unit_test(instances_have_their_own_words_up_to_output_31),
        cmocka_unit_test(pins_are_gpio_when_no_outm_is_wanted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
