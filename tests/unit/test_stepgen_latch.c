/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Step generators with index and probe inputs (version 0xC2): latching the position, without false events. */
#include "module_rig.h"
#include "module_types.h"
#include "unit.h"

enum { ACCUMULATOR = 0x2100, MODE = 0x2200 };

static struct module_rig *open_rig(void)
{
    static const struct rig_md modules[] = {
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
        {HM2_GTAG_STEPGEN, 0xC2, 1, 1, 0x2000, 10, 0x00, 0x1FF},
    };
    struct module_rig *const rig = rig_new(rig_image_with(modules, 2, NULL, 0), "");
    (void)rig_add(rig, &hm2_stepgen_type);
    rig_start(rig);
    return rig;
}

/* The latch register: what was written, but for latch bits that have fired, and the latched position. */
static void put_mode(struct module_rig *const rig, const uint32_t fired, const uint32_t position)
{
    rig_put(rig, MODE, (rig_written(rig, MODE) & 0xFFu & ~fired) | (position & 0xFFFFFF00u));
}

static void an_index_zeroes_the_position_where_it_was(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig();
    rig_set(rig, "stepgen.00.position-scale", 2);
    rig_set(rig, "stepgen.00.index-invert", 1);
    rig_cycle(rig);
    rig_set(rig, "stepgen.00.index-enable", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, MODE), 0x30);
    put_mode(rig, 0, 0);
    rig_put(rig, ACCUMULATOR, 0x00040000);
    rig_cycle(rig);
    assert_true(rig_get(rig, "stepgen.00.index-enable") == 1.0);
    put_mode(rig, 0x10, 0x00058000);
    rig_put(rig, ACCUMULATOR, 0x00060000);
    rig_cycle(rig);
    assert_true(rig_get(rig, "stepgen.00.index-enable") == 0.0);
    assert_true(rig_get(rig, "stepgen.00.position-latch") == 2.75);
    assert_true(rig_get(rig, "stepgen.00.position-fb") == 0.25);
    assert_int_equal(rig_written(rig, MODE), 0x20);
    rig_free(rig);
}

static void a_probe_latches_without_zeroing(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig();
    rig_cycle(rig);
    rig_set(rig, "stepgen.00.probe-enable", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, MODE), 0x40);
    put_mode(rig, 0x40, 0x00018000);
    rig_put(rig, ACCUMULATOR, 0x00020000);
    rig_cycle(rig);
    assert_true(rig_get(rig, "stepgen.00.probe-enable") == 0.0);
    assert_true(rig_get(rig, "stepgen.00.position-latch") == 1.5);
    assert_true(rig_get(rig, "stepgen.00.position-fb") == 2.0);
    rig_free(rig);
}

static void a_lost_arming_write_is_no_index(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig();
    rig_cycle(rig);
    rig_set(rig, "stepgen.00.index-enable", 1);
    rig->lose_writes = true;
    for (unsigned i = 0; i < 3; i++) {
        rig_cycle(rig);
        put_mode(rig, 0, 0x00070000);
        assert_int_equal(rig_written(rig, MODE), 0);
    }
    assert_true(rig_get(rig, "stepgen.00.index-enable") == 1.0);
    rig->lose_writes = false;
    rig_cycle(rig); /* still unconfirmed: what is read now was read before this write */
    assert_true(rig_get(rig, "stepgen.00.index-enable") == 1.0);
    assert_int_equal(rig_written(rig, MODE), 0x10);
    put_mode(rig, 0x10, 0x00070000);
    rig_cycle(rig);
    assert_true(rig_get(rig, "stepgen.00.index-enable") == 0.0);
    rig_free(rig);
}

static void a_new_search_right_after_an_index_is_armed_anew(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig();
    rig_cycle(rig);
    rig_set(rig, "stepgen.00.index-enable", 1);
    rig_cycle(rig);
    put_mode(rig, 0x10, 0);
    rig_read(rig);
    assert_true(rig_get(rig, "stepgen.00.index-enable") == 0.0);
    rig_set(rig, "stepgen.00.index-enable", 1); /* before the next write */
    rig_write_out(rig);
    bool armed = false;
    for (unsigned i = 0; i < 4; i++) {
        if (rig_wrote(rig, MODE))
            armed = rig_written(rig, MODE) & 0x10;
        put_mode(rig, armed ? 0 : 0x10, 0); /* what has fired stays so until it is written */
        rig_cycle(rig);
        assert_true(rig_get(rig, "stepgen.00.index-enable") == 1.0);
    }
    assert_true(armed);
    rig_free(rig);
}

static void a_search_is_armed_only_after_the_word_without_it_is_confirmed(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig();
    rig_cycle(rig);
    rig_set(rig, "stepgen.00.index-enable", 1);
    rig_cycle(rig);
    put_mode(rig, 0x10, 0);
    rig->lose_writes = true;
    rig_cycle(rig);
    assert_true(rig_get(rig, "stepgen.00.index-enable") == 0.0);
    rig_set(rig, "stepgen.00.index-enable", 1);
    rig->lose_writes = false;
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, MODE), 0);
    put_mode(rig, 0, 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, MODE), 0x10);
    assert_true(rig_get(rig, "stepgen.00.index-enable") == 1.0);
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_index_zeroes_the_position_where_it_was),
        cmocka_unit_test(a_probe_latches_without_zeroing),
        cmocka_unit_test(a_lost_arming_write_is_no_index),
        cmocka_unit_test(a_new_search_right_after_an_index_is_armed_anew),
        cmocka_unit_test(a_search_is_armed_only_after_the_word_without_it_is_confirmed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
