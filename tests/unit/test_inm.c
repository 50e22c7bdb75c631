/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "module_rig.h"
#include "module_types.h"

#define CONTROL(unit)       (uint16_t)(0x8500 + 4 * (unit))
#define FILTER_SELECT(unit) (uint16_t)(0x8600 + 4 * (unit))
#define FILTERED(unit)      (uint16_t)(0x8700 + 4 * (unit))
#define RAW(unit)           (uint16_t)(0x8800 + 4 * (unit))
#define COUNTERS(unit)      (uint16_t)(0x8900 + 4 * (unit))

#define INMUX_CONTROL 0x8000

/* Cycles in which every input is shown and every parameter looked at, for any width. */
#define ALL_TURNS 32u

static struct module_rig *started(const uint32_t control, struct hm2_module **inm)
{
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    rig_put(rig, CONTROL(0), control);
    struct hm2_module *const module = rig_add(rig, &hm2_inm_type);
    if (inm)
        *inm = module;
    rig_start(rig);
    return rig;
}

static unsigned count_inputs(const struct module_rig *rig, const char *stem, const char *suffix)
{
    unsigned found = 0;
    for (unsigned i = 0; i < 40; i++) {
        char name[64];
        (void)snprintf(name, sizeof name, "%s%02u%s", stem, i, suffix);
        found += rig_has(rig, name);
    }
    return found;
}

static void inputs_are_those_of_the_scan_width_and_those_that_have_a_pin(void **state)
{
    (void)state;
    static const struct {
        uint32_t control;
        unsigned width, inputs;
    } rows[] = {{0, 1, 11}, {9, 10, 11}, {10, 11, 11}, {0xFFFFFFEA, 11, 11}, {15, 16, 16}, {31, 32, 32}};
    static const char *const suffixes[] = {"", "-not", "-slow"};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct module_rig *const rig = started(rows[i].control, NULL);
        assert_true(rig_get(rig, "inm.00.scan_width") == rows[i].width);
        for (size_t k = 0; k < 3; k++)
            assert_int_equal(count_inputs(rig, "inm.00.input-", suffixes[k]), rows[i].inputs);
        assert_int_equal(count_inputs(rig, "inm.00.raw-input-", ""), rows[i].inputs);
        assert_int_equal(count_inputs(rig, "inm.00.raw-input-", "-not"), rows[i].inputs);
        assert_int_equal(hm2_plain_count(rig->plain), 5 * rows[i].inputs + 12 + 4);
        rig_free(rig);
    }
}

static void the_control_word_is_that_of_the_reference(void **state)
{
    (void)state;
    struct module_rig *const rig = started(10, NULL);
    assert_int_equal(rig_written(rig, CONTROL(0)), 0x7D051C20); /* from load on */
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, CONTROL(0)), 0x7D051C20);
    rig_cycle(rig);
    assert_false(rig_wrote(rig, CONTROL(0)));
    rig_set(rig, "inm.00.scan_rate", 5000);
    rig_set(rig, "inm.00.fast_scans", 1);
    rig_set(rig, "inm.00.slow_scans", 1023);
    rig_cycles(rig, ALL_TURNS);
    assert_int_equal(rig_written(rig, CONTROL(0)), 1023u << 22 | 1u << 16 | 453u << 6 | 0x20);
    rig_free(rig);
}

static void parameters_are_brought_into_their_limits_and_rewritten(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        double wanted, shown;
    } rows[] = {
        {"inm.00.scan_rate", 1e6, 909090}, /* 10 MHz / 11 */
        {"inm.00.scan_rate", 0, 2219},     /* 100 MHz / (4 * 11 * 1024), rounded down */
        {"inm.00.scan_rate", 2218, 2219},  {"inm.00.scan_rate", 2219, 2219},
        {"inm.00.scan_rate", 2220, 2220},  {"inm.00.fast_scans", 0, 1},
        {"inm.00.fast_scans", 64, 63},     {"inm.00.slow_scans", 0, 1},
        {"inm.00.slow_scans", 1024, 1023}, {"inm.00.slow_scans", 4294967295.0, 1023},
    };
    struct hm2_module *inm;
    struct module_rig *const rig = started(10, &inm);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        rig_set(rig, rows[i].name, rows[i].wanted);
        rig_cycles(rig, ALL_TURNS);
        if (!(rig_get(rig, rows[i].name) >= rows[i].shown && rig_get(rig, rows[i].name) <= rows[i].shown))
            fail_msg("%s = %g became %g, expected %g", rows[i].name, rows[i].wanted, rig_get(rig, rows[i].name),
                     rows[i].shown);
        const uint32_t control = rig_written(rig, CONTROL(0));
        assert_int_equal(control & 0x3F, 0x20);
        assert_int_equal(control >> 16 & 63, (uint32_t)rig_get(rig, "inm.00.fast_scans"));
        assert_int_equal(control >> 22, (uint32_t)rig_get(rig, "inm.00.slow_scans"));
    }
    assert_int_equal(inm->noticed[HM2_NOTICE_VALUE_CLAMPED], 8);
    rig_free(rig);
}

static void a_slow_rate_set_before_the_first_write_does_not_spill_into_the_filter(void **state)
{
    (void)state;
    struct module_rig *const rig = started(10, NULL);
    rig_set(rig, "inm.00.scan_rate", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, CONTROL(0)), 500u << 22 | 5u << 16 | 1023u << 6 | 0x20);
    rig_free(rig);
}

static void inputs_show_filtered_and_raw_levels_and_their_inverse(void **state)
{
    (void)state;
    struct module_rig *const rig = started(10, NULL);
    static const uint32_t words[][2] = {{0, 0}, {0x7FF, 0x7FF}, {0x555, 0x2AA}, {0xFFFFF800, 0x400}};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
        rig_put(rig, FILTERED(0), words[i][0]);
        rig_put(rig, RAW(0), words[i][1]);
        rig_cycles(rig, i == 0 ? ALL_TURNS : 1);
        for (unsigned input = 0; input < 11; input++) {
            char name[64];
            const double filtered = words[i][0] >> input & 1u, raw = words[i][1] >> input & 1u;
            (void)snprintf(name, sizeof name, "inm.00.input-%02u", input);
            assert_true(rig_get(rig, name) == filtered);
            (void)snprintf(name, sizeof name, "inm.00.input-%02u-not", input);
            assert_true(rig_get(rig, name) == 1.0 - filtered);
            (void)snprintf(name, sizeof name, "inm.00.raw-input-%02u", input);
            assert_true(rig_get(rig, name) == raw);
            (void)snprintf(name, sizeof name, "inm.00.raw-input-%02u-not", input);
            assert_true(rig_get(rig, name) == 1.0 - raw);
        }
    }
    rig_free(rig);
}

/* A host may link a pin at any time, to a signal that has another level. */
static void inputs_that_never_change_are_written_at_once_at_first_and_then_in_turns(void **state)
{
    (void)state;
    struct module_rig *const rig = started(10, NULL);
    rig_put(rig, FILTERED(0), 0x7FF);
    rig_put(rig, RAW(0), 0x7FF);
    rig_cycles(rig, 2);
    for (unsigned first = 0; first < 2; first++) {
        rig->cycle.writes = first == 0 ? 0 : rig->cycle.writes;
        for (unsigned input = 0; input < 22; input++) {
            char name[64];
            (void)snprintf(name, sizeof name, "inm.00.%sinput-%02u", input < 11 ? "" : "raw-", input % 11);
            rig_set(rig, name, 0);
        }
        rig_cycles(rig, first == 0 ? 1 : ALL_TURNS);
        for (unsigned input = 0; input < 22; input++) {
            char name[64];
            (void)snprintf(name, sizeof name, "inm.00.%sinput-%02u", input < 11 ? "" : "raw-", input % 11);
            if (rig_get(rig, name) != 1.0)
                fail_msg("round %u: %s was not written", first, name);
        }
    }
    rig_free(rig);
}

static void slow_inputs_are_selected_in_every_cycle(void **state)
{
    (void)state;
    struct module_rig *const rig = started(10, NULL);
    rig_set(rig, "inm.00.input-00-slow", 1);
    rig_set(rig, "inm.00.input-10-slow", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, FILTER_SELECT(0)), 0x401);
    rig_set(rig, "inm.00.input-00-slow", 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, FILTER_SELECT(0)), 0x400);
    rig_free(rig);
}

static void hand_wheels_count_from_zero_across_the_wrap_of_eight_bits(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    rig_put(rig, CONTROL(0), 10);
    (void)rig_add(rig, &hm2_inm_type);
    rig_put(rig, COUNTERS(0), 0x80FE0010);
    rig_start(rig);
    rig_cycle(rig);
    assert_true(rig_get(rig, "inm.00.enc0-count") == 0.0);
    rig_put(rig, COUNTERS(0), 0x7F04FF13);
    rig_cycle(rig);
    assert_true(rig_get(rig, "inm.00.enc0-count") == 3.0);
    assert_true(rig_get(rig, "inm.00.enc1-count") == -1.0);
    assert_true(rig_get(rig, "inm.00.enc2-count") == 6.0);
    assert_true(rig_get(rig, "inm.00.enc3-count") == -1.0);
    rig_set(rig, "inm.00.enc0-reset", 1);
    rig_put(rig, COUNTERS(0), 0x7F04FF20);
    rig_cycle(rig);
    assert_true(rig_get(rig, "inm.00.enc0-count") == 0.0);
    rig_set(rig, "inm.00.enc0-reset", 0);
    rig_put(rig, COUNTERS(0), 0x7F04FF22);
    rig_cycle(rig);
    assert_true(rig_get(rig, "inm.00.enc0-count") == 2.0);
    rig_free(rig);
}

static void what_the_counters_do_while_the_filters_settle_after_load_is_not_counted(void **state)
{
    (void)state;
    struct module_rig *const rig = started(10, NULL);
    rig_put(rig, COUNTERS(0), 0x01FF01);
    rig_cycle(rig);
    assert_true(rig_get(rig, "inm.00.enc0-count") == 0.0);
    assert_true(rig_get(rig, "inm.00.enc1-count") == 0.0);
    rig_put(rig, COUNTERS(0), 0x01FF02);
    rig_cycle(rig);
    assert_true(rig_get(rig, "inm.00.enc0-count") == 1.0);
    assert_true(rig_get(rig, "inm.00.enc1-count") == 0.0);
    rig_free(rig);
}

static void counts_survive_a_card_that_comes_back_with_its_counters_at_zero(void **state)
{
    (void)state;
    struct module_rig *const rig = started(10, NULL);
    rig_cycle(rig);
    rig_put(rig, COUNTERS(0), 0x64);
    rig_cycle(rig);
    assert_true(rig_get(rig, "inm.00.enc0-count") == 100.0);
    rig_put(rig, COUNTERS(0), 0);
    rig_read(rig); /* not yet told: the count follows the counter down */
    rig_put(rig, COUNTERS(0), 5);
    rig->modules[0].type->start(&rig->modules[0], &rig->cycle);
    const double kept = rig_get(rig, "inm.00.enc0-count");
    rig_read(rig);
    assert_true(rig_get(rig, "inm.00.enc0-count") == kept + 5.0);
    rig_free(rig);
}

static void counting_modes_are_one_bit_per_byte(void **state)
{
    (void)state;
    struct module_rig *const rig = started(10, NULL);
    static const struct {
        const char *name;
        uint32_t word;
    } rows[] = {{"inm.00.enc0_4xmode", 0x00000001},
                {"inm.00.enc1_4xmode", 0x00000101},
                {"inm.00.enc2_4xmode", 0x00010101},
                {"inm.00.enc3_4xmode", 0x01010101}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        rig_set(rig, rows[i].name, 1);
        rig_cycles(rig, ALL_TURNS);
        assert_int_equal(rig_written(rig, COUNTERS(0)), rows[i].word);
    }
    rig_cycle(rig);
    assert_false(rig_wrote(rig, COUNTERS(0)));
    rig_free(rig);
}

static void a_card_that_does_not_answer_fails_the_load_with_a_reason(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    rig->peek_error = HM2_ERR_TIMEOUT;
    assert_int_equal(rig_try_add(rig, &hm2_inm_type), HM2_ERR_TIMEOUT);
    assert_non_null(strstr(rig->diag.text, "control register of inm.00"));
    rig_free(rig);
}

static const struct rig_md several[] = {
    {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
    {HM2_GTAG_INM, 0, 1, 2, 0x8500, 5, 0x00, 0x1F},
    {HM2_GTAG_INMUX, 0, 1, 1, 0x8000, 5, 0x00, 0x1F},
};
/* inm.00 input 20, inm.01 input 0, inmux data and address, a code without a meaning */
static const uint32_t several_pins[] = {0x03002315, 0x03012301, 0x03001E01, 0x03001E81, 0x03002321};

static void instances_have_their_own_registers(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_with(several, 3, several_pins, 5), "");
    rig_put(rig, CONTROL(0), 3);
    rig_put(rig, CONTROL(1), 7);
    (void)rig_add(rig, &hm2_inm_type);
    rig_start(rig);
    assert_true(rig_get(rig, "inm.00.scan_width") == 4.0);
    assert_true(rig_get(rig, "inm.01.scan_width") == 8.0);
    assert_true(rig_has(rig, "inm.00.input-20"));
    assert_false(rig_has(rig, "inm.00.input-04"));
    assert_false(rig_has(rig, "inm.01.input-08"));
    rig_put(rig, FILTERED(1), 0x80);
    rig_set(rig, "inm.01.input-07-slow", 1);
    rig_cycle(rig);
    assert_true(rig_get(rig, "inm.01.input-07") == 1.0);
    assert_int_equal(rig_written(rig, FILTER_SELECT(0)), 0);
    assert_int_equal(rig_written(rig, FILTER_SELECT(1)), 0x80);
    assert_int_equal(rig_written(rig, CONTROL(0)) >> 6 & 1023, 100000000 / (4 * 4 * 20000) - 1);
    assert_int_equal(rig_written(rig, CONTROL(1)) >> 6 & 1023, 100000000 / (4 * 8 * 20000) - 1);
    rig_free(rig);
}

static void inmux_has_the_inputs_of_its_width_and_half_the_rate(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_with(several, 3, several_pins, 5), "");
    rig_put(rig, INMUX_CONTROL, 15);
    (void)rig_add(rig, &hm2_inmux_type);
    rig_start(rig);
    assert_int_equal(count_inputs(rig, "inmux.00.input-", ""), 16);
    assert_true(rig_has(rig, "inmux.00.enc3-count"));
    rig_set(rig, "inmux.00.scan_rate", 1e9);
    rig_cycle(rig);
    assert_true(rig_get(rig, "inmux.00.scan_rate") == 5e6 / 16);
    assert_ptr_equal(rig->pins[2].owner, &rig->modules[0]);
    assert_true(rig->pins[3].immediate);
    rig_free(rig);
}

static void several_instances_with_a_strange_layout_are_refused(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_with(several, 3, several_pins, 5), "");
    for (unsigned i = 0; i < rig->idrom.module_count; i++)
        if (rig->idrom.modules[i].gtag == HM2_GTAG_INM)
            rig->idrom.modules[i].instance_stride = 64;
    assert_int_equal(rig_try_add(rig, &hm2_inm_type), HM2_ERR_UNSUPPORTED);
    assert_non_null(strstr(rig->diag.text, "found stride 64"));
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(inputs_are_those_of_the_scan_width_and_those_that_have_a_pin),
        cmocka_unit_test(the_control_word_is_that_of_the_reference),
        cmocka_unit_test(parameters_are_brought_into_their_limits_and_rewritten),
        cmocka_unit_test(a_slow_rate_set_before_the_first_write_does_not_spill_into_the_filter),
        cmocka_unit_test(inputs_show_filtered_and_raw_levels_and_their_inverse),
        cmocka_unit_test(inputs_that_never_change_are_written_at_once_at_first_and_then_in_turns),
        cmocka_unit_test(slow_inputs_are_selected_in_every_cycle),
        cmocka_unit_test(hand_wheels_count_from_zero_across_the_wrap_of_eight_bits),
        cmocka_unit_test(what_the_counters_do_while_the_filters_settle_after_load_is_not_counted),
        cmocka_unit_test(counts_survive_a_card_that_comes_back_with_its_counters_at_zero),
        cmocka_unit_test(counting_modes_are_one_bit_per_byte),
        cmocka_unit_test(a_card_that_does_not_answer_fails_the_load_with_a_reason),
        cmocka_unit_test(instances_have_their_own_registers),
        cmocka_unit_test(inmux_has_the_inputs_of_its_width_and_half_the_rate),
        cmocka_unit_test(several_instances_with_a_strange_layout_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
