/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "module_rig.h"
#include "module_types.h"
#include "trace_file.h"
#include "watchdog.h"

#define TIMER  0x0C00
#define STATUS 0x0D00
#define RESET  0x0E00

#define CLOCK_HZ 100000000.0

/* A started rig with a watchdog and nothing else that has a state; *dog is its module. */
static struct module_rig *started(struct hm2_module **dog)
{
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    *dog = rig_add(rig, &hm2_watchdog_type);
    (void)rig_add(rig, &hm2_led_type);
    rig_start(rig);
    return rig;
}

/* The same after a few cycles. */
static struct module_rig *running(struct hm2_module **dog)
{
    struct module_rig *const rig = started(dog);
    rig_cycles(rig, 3);
    return rig;
}

/* The same, and then the dog has bitten and was seen. */
static struct module_rig *bitten(struct hm2_module **dog)
{
    struct module_rig *const rig = running(dog);
    rig_put(rig, STATUS, 1);
    rig_cycle(rig);
    return rig;
}

static void points_are_those_that_hal_files_know(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = started(&dog);
    const struct hm2_plain_object *const has_bit = rig_object(rig, "watchdog.has_bit");
    const struct hm2_plain_object *const timeout = rig_object(rig, "watchdog.timeout_ns");
    assert_non_null(has_bit);
    assert_non_null(timeout);
    assert_int_equal(has_bit->point->type, HM2_BIT);
    assert_int_equal(has_bit->point->dir, HM2_PIN_IO);
    assert_int_equal(timeout->point->type, HM2_U32);
    assert_int_equal(timeout->point->dir, HM2_PARAM_RW);
    assert_true(rig_get(rig, "watchdog.timeout_ns") == 5000000.0);
    rig_free(rig);
}

static void it_is_off_until_the_first_write_and_status_is_cleared_at_load(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    rig_put(rig, STATUS, 1);
    rig->written[STATUS / 4] = 0xFFFFFFFF;
    dog = rig_add(rig, &hm2_watchdog_type);
    rig_start(rig);
    assert_int_equal(rig_written(rig, TIMER), 0x80000000);
    assert_int_equal(rig_written(rig, STATUS), 0);
    assert_false(hm2_watchdog_bitten(dog));
    rig_put(rig, STATUS, 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, TIMER), 0x0007A11F);
    assert_true(rig_get(rig, "watchdog.has_bit") == 0.0);
    rig_free(rig);
}

static void every_write_pets(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = started(&dog);
    for (unsigned i = 0; i < 5; i++) {
        rig->written[RESET / 4] = 0;
        rig_cycle(rig);
        assert_int_equal(rig_written(rig, RESET), 0x5A000000);
    }
    assert_false(rig_wrote(rig, TIMER));
    rig_put(rig, STATUS, 1);
    rig_cycles(rig, 3);
    assert_true(rig_wrote(rig, RESET));
    rig_free(rig);
}

static void a_bite_is_latched_and_told_once(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = bitten(&dog);
    assert_true(rig_get(rig, "watchdog.has_bit") == 1.0);
    assert_true(hm2_watchdog_bitten(dog));
    rig_put(rig, STATUS, 0); /* whatever the card says later */
    rig_cycles(rig, 10);
    assert_true(rig_get(rig, "watchdog.has_bit") == 1.0);
    assert_int_equal(dog->noticed[HM2_NOTICE_WATCHDOG_BIT], 1);
    assert_false(rig_wrote(rig, STATUS));
    rig_free(rig);
}

static void clearing_has_bit_zeroes_the_status_and_sends_everything_again(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = bitten(&dog);
    rig_set(rig, "watchdog.has_bit", 0);
    assert_false(hm2_watchdog_bitten(dog)); /* so that the same write turns the outputs on rig */
    rig->written[STATUS / 4] = 0xFFFFFFFF;
    rig_write_out(rig);
    assert_int_equal(rig_written(rig, STATUS), 0);
    assert_true(rig_wrote(rig, TIMER));
    assert_int_equal(rig_written(rig, TIMER), 0x0007A11F);
    assert_true(rig_wrote(rig, 0x0200)); /* the LEDs stand for everything else */
    assert_true(rig_position(rig, STATUS) < rig_position(rig, 0x0200));
    rig_put(rig, STATUS, 0);
    rig_cycles(rig, 2);
    assert_true(rig_get(rig, "watchdog.has_bit") == 0.0);
    assert_int_equal(dog->noticed[HM2_NOTICE_WATCHDOG_BIT], 1);
    rig_free(rig);
}

static void a_lost_recovery_is_repeated_and_not_taken_for_another_bite(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = bitten(&dog);
    rig_set(rig, "watchdog.has_bit", 0);
    rig->lose_writes = true;
    rig_write_out(rig);
    rig->lose_writes = false;
    rig_read(rig); /* the card never got it: status is still 1 */
    assert_true(rig_get(rig, "watchdog.has_bit") == 0.0);
    rig_write_out(rig);
    assert_true(rig_wrote(rig, STATUS));
    rig_put(rig, STATUS, 0);
    rig_cycles(rig, 2);
    assert_true(rig_get(rig, "watchdog.has_bit") == 0.0);
    assert_int_equal(dog->noticed[HM2_NOTICE_WATCHDOG_BIT], 1);
    rig_free(rig);
}

static void a_bite_right_after_recovery_is_a_new_one(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = bitten(&dog);
    rig_set(rig, "watchdog.has_bit", 0);
    rig_write_out(rig);
    rig_read(rig); /* the zero arrived, and the dog bit rig before the read */
    assert_true(rig_get(rig, "watchdog.has_bit") == 1.0);
    assert_int_equal(dog->noticed[HM2_NOTICE_WATCHDOG_BIT], 2);
    rig_free(rig);
}

static void setting_has_bit_by_hand_does_nothing(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = running(&dog);
    rig_set(rig, "watchdog.has_bit", 1);
    rig_cycle(rig);
    assert_false(hm2_watchdog_bitten(dog));
    rig_set(rig, "watchdog.has_bit", 0);
    rig_cycle(rig);
    assert_false(rig_wrote(rig, STATUS));
    rig_free(rig);
}

static void a_running_dog_is_never_written_a_value_that_bites(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = started(&dog);
    rig_cycle(rig);
    static const double timeouts_ns[] = {1, 9, 10, 20, 1e3, 1e6, 5e6, 4294967295.0, 0};
    for (size_t i = 0; i < sizeof timeouts_ns / sizeof timeouts_ns[0]; i++) {
        rig_set(rig, "watchdog.timeout_ns", timeouts_ns[i]);
        rig_cycle(rig);
        assert_true(rig_wrote(rig, TIMER) || timeouts_ns[i] < 20);
        assert_int_equal(rig_written(rig, TIMER) & 0x80000000, 0);
    }
    rig->cycle.writes = 0; /* the card came back from a power failure */
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, TIMER) & 0x80000000, 0);
    rig_free(rig);
}

static void a_new_time_out_is_sent_once(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = running(&dog);
    rig_set(rig, "watchdog.timeout_ns", 20000000);
    rig_cycle(rig);
    assert_true(rig_wrote(rig, TIMER));
    assert_int_equal(rig_written(rig, TIMER), 1999999);
    rig_cycle(rig);
    assert_false(rig_wrote(rig, TIMER));
    rig_free(rig);
}

static void a_time_out_beyond_31_bits_is_cut_and_shown(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    for (unsigned i = 0; i < rig->idrom.module_count; i++)
        if (rig->idrom.modules[i].gtag == HM2_GTAG_WATCHDOG)
            rig->idrom.modules[i].clock_hz = 1000000000;
    struct hm2_module *const dog = rig_add(rig, &hm2_watchdog_type);
    rig_start(rig);
    rig_set(rig, "watchdog.timeout_ns", 3000000000.0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, TIMER), 0x7FFFFFFF);
    assert_true(rig_get(rig, "watchdog.timeout_ns") == 2147483648.0);
    assert_int_equal(dog->noticed[HM2_NOTICE_VALUE_CLAMPED], 1);
    rig_cycle(rig);
    assert_int_equal(dog->noticed[HM2_NOTICE_VALUE_CLAMPED], 1);
    rig_free(rig);
}

static void a_time_out_below_one_and_a_half_periods_is_told_once_per_change(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = running(&dog);
    assert_int_equal(dog->noticed[HM2_NOTICE_TIMEOUT_SHORT], 0);
    rig_set(rig, "watchdog.timeout_ns", 1500000);
    rig_cycles(rig, 3);
    assert_int_equal(dog->noticed[HM2_NOTICE_TIMEOUT_SHORT], 0);
    rig_set(rig, "watchdog.timeout_ns", 1499999);
    rig_cycles(rig, 3);
    assert_int_equal(dog->noticed[HM2_NOTICE_TIMEOUT_SHORT], 1);
    rig_set(rig, "watchdog.timeout_ns", 1000000);
    rig_cycles(rig, 3);
    assert_int_equal(dog->noticed[HM2_NOTICE_TIMEOUT_SHORT], 2);
    rig_free(rig);
}

static void a_card_that_lost_its_power_counts_as_bitten(void **state)
{
    (void)state;
    struct hm2_module *dog;
    struct module_rig *const rig = running(&dog);
    hm2_watchdog_raise(dog);
    assert_true(hm2_watchdog_bitten(dog));
    rig_cycles(rig, 3);
    assert_true(rig_get(rig, "watchdog.has_bit") == 1.0);
    rig_set(rig, "watchdog.has_bit", 0);
    rig_cycle(rig);
    assert_true(rig_wrote(rig, STATUS));
    rig_cycle(rig);
    assert_true(rig_get(rig, "watchdog.has_bit") == 0.0);
    rig_free(rig);
}

static void without_a_watchdog_nothing_has_bitten(void **state)
{
    (void)state;
    assert_false(hm2_watchdog_bitten(NULL));
    hm2_watchdog_raise(NULL);
    assert_int_equal(hm2_watchdog_timer_address(NULL), 0);
    struct hm2_module *dog;
    struct module_rig *const rig = started(&dog);
    assert_int_equal(hm2_watchdog_timer_address(dog), TIMER);
    rig_free(rig);
}

/* The firmware's counter reaches -1 one clock after it read 0: from any reading the trace tells when the dog bites. Our
 * register for that time-out must be the one that was written. */
static void time_outs_are_those_of_the_recorded_firmware(void **state)
{
    (void)state;
    struct trace_file trace = trace_load("watchdog");
    size_t at = 0;
    const struct trace_event *const write = trace_find(&trace, &at, "bite100", 'W', "time");
    assert_non_null(write);
    const struct trace_event *reading, *last = NULL;
    while ((reading = trace_find(&trace, &at, "bite100", 'R', "time")) && !(reading->value & 0x80000000)) {
        const long clocks = reading->clk + (long)reading->value - write->clk;
        struct hm2_module *dog;
        struct module_rig *const rig = started(&dog);
        rig_set(rig, "watchdog.timeout_ns", (double)clocks * 1e9 / CLOCK_HZ);
        rig_cycle(rig);
        assert_int_equal(rig_written(rig, TIMER), write->value);
        rig_free(rig);
        last = reading;
    }
    assert_non_null(last);
    assert_non_null(reading);
    assert_true(reading->clk - last->clk <= (long)last->value + 4); /* it did bite when it should */
    trace_free(&trace);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_are_those_that_hal_files_know),
        cmocka_unit_test(it_is_off_until_the_first_write_and_status_is_cleared_at_load),
        cmocka_unit_test(every_write_pets),
        cmocka_unit_test(a_bite_is_latched_and_told_once),
        cmocka_unit_test(clearing_has_bit_zeroes_the_status_and_sends_everything_again),
        cmocka_unit_test(a_lost_recovery_is_repeated_and_not_taken_for_another_bite),
        cmocka_unit_test(a_bite_right_after_recovery_is_a_new_one),
        cmocka_unit_test(setting_has_bit_by_hand_does_nothing),
        cmocka_unit_test(a_running_dog_is_never_written_a_value_that_bites),
        cmocka_unit_test(a_new_time_out_is_sent_once),
        cmocka_unit_test(a_time_out_beyond_31_bits_is_cut_and_shown),
        cmocka_unit_test(a_time_out_below_one_and_a_half_periods_is_told_once_per_change),
        cmocka_unit_test(a_card_that_lost_its_power_counts_as_bitten),
        cmocka_unit_test(without_a_watchdog_nothing_has_bitten),
        cmocka_unit_test(time_outs_are_those_of_the_recorded_firmware),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
