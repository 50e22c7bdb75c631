/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "module_rig.h"
#include "module_types.h"

static struct module_rig *started(const char *config)
{
    struct module_rig *const rig = rig_new(rig_image_7i96s(), config);
    (void)rig_add(rig, &hm2_watchdog_type);
    (void)rig_add(rig, &hm2_raw_type);
    rig_start(rig);
    return rig;
}

static void raw_pins_exist_only_on_request(void **state)
{
    (void)state;
    struct module_rig *const without = started("");
    assert_false(rig_has(without, "raw.read_address"));
    rig_cycles(without, 2);
    rig_free(without);
    struct module_rig *const with = started("enable_raw");
    static const struct {
        const char *name;
        enum hm2_point_type type;
        enum hm2_point_dir dir;
    } rows[] = {
        {"raw.read_address", HM2_U32, HM2_PIN_IN},  {"raw.read_data", HM2_U32, HM2_PIN_OUT},
        {"raw.write_address", HM2_U32, HM2_PIN_IN}, {"raw.write_data", HM2_U32, HM2_PIN_IN},
        {"raw.write_strobe", HM2_BIT, HM2_PIN_IN},  {"raw.dump_state", HM2_BIT, HM2_PIN_IO},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct hm2_plain_object *const object = rig_object(with, rows[i].name);
        assert_non_null(object);
        assert_int_equal(object->point->type, rows[i].type);
        assert_int_equal(object->point->dir, rows[i].dir);
    }
    assert_int_equal(hm2_plain_count(with->plain), 2 + 6);
    rig_free(with);
}

static void any_register_can_be_read_in_every_cycle(void **state)
{
    (void)state;
    struct module_rig *const rig = started("enable_raw");
    rig_put(rig, 0x0100, HM2_COOKIE);
    rig_put(rig, 0xB700, 17);
    rig_set(rig, "raw.read_address", 0x0100);
    rig_cycles(rig, 2);
    assert_int_equal((uint32_t)rig_get(rig, "raw.read_data"), HM2_COOKIE);
    rig_set(rig, "raw.read_address", 0x1234B702); /* the lower 16 bits, as a word */
    rig_cycles(rig, 2);
    assert_true(rig_get(rig, "raw.read_data") == 17.0);
    rig_put(rig, 0xB700, 18);
    rig_cycle(rig);
    assert_true(rig_get(rig, "raw.read_data") == 18.0);
    rig_free(rig);
}

static void a_strobe_writes_once_and_goes_back(void **state)
{
    (void)state;
    struct module_rig *const rig = started("enable_raw");
    rig_cycles(rig, 2);
    rig_set(rig, "raw.write_address", 0x2900);
    rig_set(rig, "raw.write_data", 0xDEADBEEF);
    rig_cycle(rig);
    assert_false(rig_wrote(rig, 0x2900));
    rig_set(rig, "raw.write_strobe", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0x2900), 0xDEADBEEF);
    assert_true(rig_get(rig, "raw.write_strobe") == 0.0);
    assert_int_equal(rig_position(rig, 0x2900), (int)rig->logged - 1);
    rig_cycle(rig);
    assert_false(rig_wrote(rig, 0x2900));
    rig_set(rig, "raw.write_strobe", 1); /* the same value again is written again */
    rig_cycle(rig);
    assert_true(rig_wrote(rig, 0x2900));
    rig_free(rig);
}

static void a_lost_write_is_sent_again_and_the_next_strobe_waits_for_it(void **state)
{
    (void)state;
    struct module_rig *const rig = started("enable_raw");
    rig_cycles(rig, 2);
    rig_set(rig, "raw.write_address", 0x2900);
    rig_set(rig, "raw.write_data", 1);
    rig_set(rig, "raw.write_strobe", 1);
    rig->lose_writes = true;
    rig_cycle(rig);
    rig->lose_writes = false;
    rig_set(rig, "raw.write_address", 0x2A00);
    rig_set(rig, "raw.write_data", 2);
    rig_set(rig, "raw.write_strobe", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0x2900), 1);
    assert_false(rig_wrote(rig, 0x2A00));
    assert_true(rig_get(rig, "raw.write_strobe") == 1.0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0x2A00), 2);
    assert_false(rig_wrote(rig, 0x2900));
    rig_free(rig);
}

static void everything_again_does_not_repeat_a_raw_write(void **state)
{
    (void)state;
    struct module_rig *const rig = started("enable_raw");
    rig_set(rig, "raw.write_address", 0x2900);
    rig_set(rig, "raw.write_strobe", 1);
    rig_cycles(rig, 3);
    hm2_plan_touch_all(rig->plan);
    rig_cycle(rig);
    assert_true(rig_wrote(rig, 0x0C00));
    assert_false(rig_wrote(rig, 0x2900));
    rig_free(rig);
}

static void a_dump_is_asked_for_once(void **state)
{
    (void)state;
    struct module_rig *const rig = started("enable_raw");
    rig_set(rig, "raw.dump_state", 1);
    rig_cycles(rig, 3);
    assert_true(rig_get(rig, "raw.dump_state") == 0.0);
    assert_int_equal(rig->noticed[1][HM2_NOTICE_DUMP_STATE], 1);
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(raw_pins_exist_only_on_request),
        cmocka_unit_test(any_register_can_be_read_in_every_cycle),
        cmocka_unit_test(a_strobe_writes_once_and_goes_back),
        cmocka_unit_test(a_lost_write_is_sent_again_and_the_next_strobe_waits_for_it),
        cmocka_unit_test(everything_again_does_not_repeat_a_raw_write),
        cmocka_unit_test(a_dump_is_asked_for_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
