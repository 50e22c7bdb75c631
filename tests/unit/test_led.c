/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "module_rig.h"
#include "module_types.h"

#define LEDS 0x0200

static struct module_rig *started(const char *config)
{
    struct module_rig *const rig = rig_new(rig_image_7i96s(), config);
    (void)rig_add(rig, &hm2_led_type);
    rig_start(rig);
    return rig;
}

static void leds_are_counted_from_one_and_lie_at_the_top_of_the_word(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    assert_false(rig_has(rig, "led.CR00"));
    assert_false(rig_has(rig, "led.CR05"));
    static const struct {
        const char *name;
        uint32_t word;
    } rows[] = {{"led.CR01", 0x80000000}, {"led.CR02", 0x40000000}, {"led.CR03", 0x20000000}, {"led.CR04", 0x10000000}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(rig_object(rig, rows[i].name)->point->dir, HM2_PIN_IN);
        rig_set(rig, rows[i].name, 1);
        rig_cycle(rig);
        assert_int_equal(rig_written(rig, LEDS), rows[i].word);
        rig_set(rig, rows[i].name, 0);
    }
    rig_free(rig);
}

static void the_first_write_goes_out_even_when_all_are_dark(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_cycle(rig); /* whatever load time sent is confirmed by now */
    rig_cycle(rig);
    assert_false(rig_wrote(rig, LEDS));
    rig->cycle.writes = 0;
    rig_cycle(rig);
    assert_true(rig_wrote(rig, LEDS));
    rig_cycle(rig);
    assert_false(rig_wrote(rig, LEDS));
    rig_free(rig);
}

static void fewer_leds_can_be_asked_for(void **state)
{
    (void)state;
    struct module_rig *const two = started("num_leds=2");
    assert_true(rig_has(two, "led.CR02"));
    assert_false(rig_has(two, "led.CR03"));
    assert_int_equal(two->diag.warnings, 0);
    rig_free(two);
    struct module_rig *const none = started("num_leds=0");
    assert_int_equal(hm2_plain_count(none->plain), 0);
    rig_free(none);
}

static void more_leds_than_the_board_has_are_a_warning(void **state)
{
    (void)state;
    struct module_rig *const rig = started("num_leds=9");
    assert_true(rig_has(rig, "led.CR04"));
    assert_false(rig_has(rig, "led.CR05"));
    assert_int_equal(rig->diag.warnings, 1);
    assert_non_null(strstr(rig->diag.text, "num_leds=9, but hm2_rig.0 has 4 user LEDs"));
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(leds_are_counted_from_one_and_lie_at_the_top_of_the_word),
        cmocka_unit_test(the_first_write_goes_out_even_when_all_are_dark),
        cmocka_unit_test(fewer_leds_can_be_asked_for),
        cmocka_unit_test(more_leds_than_the_board_has_are_a_warning),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
