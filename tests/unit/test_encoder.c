/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Plain encoders: points, settings, counts, index handshake and quadrature errors. Velocity: test_encoder_velocity.c.
 */
#include <math.h>

#include "encoder.h"
#include "encoder_card.h"
#include "module_types.h"
#include "unit.h"

enum { COUNT = 0x3000, CONTROL = 0x3100, DIVISOR = 0x3200, STAMP = 0x3300, FILTER = 0x3400, TIMER = 0x3500 };

#define PERIOD_TICKS 2000 /* of 2 MHz in 1 ms */

static double get(const struct encoder_card *const card, const char *const suffix)
{
    char name[64];
    (void)snprintf(name, sizeof name, "encoder.00.%s", suffix);
    return rig_get(card->rig, name);
}

static void set(const struct encoder_card *const card, const char *const suffix, const double value)
{
    char name[64];
    (void)snprintf(name, sizeof name, "encoder.00.%s", suffix);
    rig_set(card->rig, name, value);
}

static unsigned noticed(const struct encoder_card *const card, const enum hm2_notice notice)
{
    return card->rig->noticed[0][notice];
}

static struct encoder_card open_7i96s(void)
{
    return encoder_card_open(rig_image_7i96s(), "", &hm2_encoder_type);
}

static void cycles(struct encoder_card *const card, const unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        encoder_card_move(card, PERIOD_TICKS, 0);
        encoder_card_cycle(card);
    }
}

static const struct hm2_image *image_of_version(const uint8_t version)
{
    const struct rig_md modules[] = {
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
        {HM2_GTAG_ENCODER, version, 1, 1, 0x3000, 5, 0x00, 3},
    };
    return rig_image_with(modules, 2, NULL, 0);
}

/* ---- points and settings ------------------------------------------------------------------------------------------
 */

static void the_defaults_are_those_of_the_interface(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 3);
    assert_int_equal(rig_written(card.rig, CONTROL), 0x0800);
    assert_int_equal(rig_written(card.rig, DIVISOR), 48);
    assert_int_equal(rig_written(card.rig, FILTER), 2);
    assert_int_equal(rig_written(card.rig, TIMER), 0);
    assert_int_equal(rig_get(card.rig, "encoder.sample-frequency"), 25000000);
    assert_int_equal(rig_get(card.rig, "encoder.timer-number"), -1);
    assert_false(rig_has(card.rig, "encoder.00.probe-enable"));
    assert_false(rig_has(card.rig, "encoder.muxed-skew"));
    assert_false(rig_wrote(card.rig, CONTROL));
    rig_free(card.rig);
}

static void an_encoder_has_seventeen_pins_and_seven_parameters(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    unsigned pins = 0, params = 0;
    for (size_t i = 0; i < hm2_plain_count(card.rig->plain); i++) {
        const enum hm2_point_dir dir = hm2_plain_at(card.rig->plain, i)->point->dir;
        *(dir == HM2_PARAM_RO || dir == HM2_PARAM_RW ? &params : &pins) += 1;
    }
    assert_int_equal(pins, 3 + 17); /* of which M alone has two */
    assert_int_equal(params, 7);
    for (unsigned io = 27; io < 30; io++) {
        assert_non_null(card.rig->pins[io].owner);
        assert_false(card.rig->pins[io].immediate);
    }
    rig_free(card.rig);
}

static void the_control_word_is_made_of_the_parameters(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint32_t bit;
    } bits[] = {
        {"index-invert", 0x0008}, {"index-mask", 0x0200}, {"index-mask-invert", 0x0100},
        {"counter-mode", 0x0400}, {"filter", 0x0800},
    };
    struct encoder_card card = open_7i96s();
    set(&card, "filter", 0);
    for (size_t i = 0; i < sizeof bits / sizeof bits[0]; i++) {
        set(&card, bits[i].name, 1);
        cycles(&card, ENCODER_LOOKS);
        assert_int_equal(rig_written(card.rig, CONTROL), bits[i].bit);
        set(&card, bits[i].name, 0);
    }
    rig_free(card.rig);
}

static void the_probe_exists_where_the_firmware_has_one(void **state)
{
    (void)state;
    struct encoder_card card = encoder_card_open(image_of_version(0x83), "", &hm2_encoder_type);
    cycles(&card, 2);
    set(&card, "probe-invert", 1);
    set(&card, "probe-enable", 1);
    cycles(&card, 1);
    assert_int_equal(rig_written(card.rig, CONTROL), 0x3840);
    card.count = 100;
    card.control &= ~0x2000u;
    card.latch = 95;
    cycles(&card, 1);
    assert_true(get(&card, "probe-enable") == 0.0);
    assert_int_equal(get(&card, "rawlatch"), 95);
    assert_int_equal(get(&card, "count-latched"), 95);
    assert_int_equal(get(&card, "count"), 100);
    rig_free(card.rig);
}

static void an_index_search_goes_before_a_probe(void **state)
{
    (void)state;
    struct encoder_card card = encoder_card_open(image_of_version(0x83), "", &hm2_encoder_type);
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    set(&card, "probe-enable", 1);
    cycles(&card, 1);
    assert_int_equal(rig_written(card.rig, CONTROL), 0x0850);
    rig_free(card.rig);
}

static void sample_frequencies_are_rounded_to_what_is_possible(void **state)
{
    (void)state;
    static const struct {
        uint32_t wanted_hz, rate, actual_hz;
    } cases[] = {
        {25000000, 2, 25000000}, {100000000, 0xFFF, 100000000},  {60000000, 0xFFF, 100000000},
        {50000000, 0, 50000000}, {30000000, 1, 33333333},        {1000000, 98, 1000000},
        {1, 0x7FF, 48804},       {UINT32_MAX, 0xFFF, 100000000}, {0, 0x7FF, 48804},
    };
    struct encoder_card card = open_7i96s();
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rig_set(card.rig, "encoder.sample-frequency", cases[i].wanted_hz);
        cycles(&card, ENCODER_LOOKS);
        assert_int_equal(rig_written(card.rig, FILTER), cases[i].rate);
        assert_int_equal(rig_get(card.rig, "encoder.sample-frequency"), cases[i].actual_hz);
        cycles(&card, ENCODER_LOOKS);
        assert_int_equal(rig_written(card.rig, FILTER), cases[i].rate);
    }
    assert_int_equal(noticed(&card, HM2_NOTICE_VALUE_CLAMPED), 1);
    rig_free(card.rig);
}

static void divisors_follow_the_clock(void **state)
{
    (void)state;
    double tick_s;
    assert_int_equal(encoder_divisor(100000000, 2000000, &tick_s), 48);
    assert_true(tick_s == 50 / 1e8);
    assert_int_equal(encoder_divisor(100000000, 10000000, &tick_s), 8);
    assert_true(tick_s == 10 / 1e8);
    assert_int_equal(encoder_divisor(33333333, 2000000, &tick_s), 14);
    assert_int_equal(encoder_divisor(1000000, 10000000, &tick_s), 0x8000);
    assert_true(tick_s == 1e-6);
}

static void the_timer_is_used_when_the_card_has_its_register(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    rig_set(card.rig, "encoder.timer-number", 3);
    cycles(&card, 1);
    assert_int_equal(rig_written(card.rig, TIMER), 0xB000);
    rig_set(card.rig, "encoder.timer-number", 77);
    cycles(&card, 1);
    assert_int_equal(rig_written(card.rig, TIMER), 0x8000);
    assert_int_equal(rig_get(card.rig, "encoder.timer-number"), 0);
    rig_free(card.rig);
}

static void a_timer_number_without_a_register_does_nothing(void **state)
{
    (void)state;
    struct encoder_card card = {.rig = rig_new(rig_image_7i96s(), ""), .base = 0x3000};
    rig_put(card.rig, TIMER, 0xFFFFFFFF); /* nobody drives the bus */
    (void)rig_add(card.rig, &hm2_encoder_type);
    rig_start(card.rig);
    card.rig->written[TIMER / 4] = 0x5A5A5A5A;
    rig_set(card.rig, "encoder.timer-number", 1);
    cycles(&card, 3);
    assert_int_equal(rig_written(card.rig, TIMER), 0x5A5A5A5A);
    assert_int_equal(rig_get(card.rig, "encoder.timer-number"), 1);
    rig_free(card.rig);
}

static void probing_for_the_timer_spares_the_counts_of_another_module(void **state)
{
    (void)state;
    /* The older map: muxed encoders count at 0x3500. */
    static const struct rig_md modules[] = {
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
        {HM2_GTAG_DPLL, 0, 1, 1, 0x7000, 7, 0x00, 0},
        {HM2_GTAG_ENCODER, 2, 1, 1, 0x3000, 5, 0x00, 3},
        {HM2_GTAG_RESOLVER, 0, 1, 1, 0x3500, 5, 0x00, 0x1F},
    };
    struct module_rig *const rig = rig_new(rig_image_with(modules, 4, NULL, 0), "");
    rig->written[TIMER / 4] = 0x77777777;
    (void)rig_add(rig, &hm2_encoder_type);
    rig_start(rig);
    rig_set(rig, "encoder.timer-number", 1);
    rig_cycles(rig, 3);
    assert_int_equal(rig_written(rig, TIMER), 0x77777777);
    rig_free(rig);
}

/* ---- counts ------------------------------------------------------------------------------------------------------ */

/* A host may link a pin at any time, to a signal that has another value. */
static void pins_of_an_encoder_that_stands_still_are_written_at_once_at_first_and_then_in_turns(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    card.count = 1234;
    cycles(&card, 3000); /* beyond vel-timeout */
    assert_int_equal(get(&card, "rawcounts"), 1234);
    const uint32_t writes = card.rig->cycle.writes;
    for (unsigned first = 0; first < 2; first++) {
        card.rig->cycle.writes = first == 0 ? 0 : writes;
        set(&card, "rawcounts", 0);
        set(&card, "velocity", 7);
        cycles(&card, first == 0 ? 1 : ENCODER_LOOKS);
        assert_int_equal(get(&card, "rawcounts"), 1234);
        assert_true(get(&card, "velocity") == 0.0);
    }
    rig_free(card.rig);
}

static void pins_act_on_an_encoder_that_stands_still(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    card.count = 1234;
    cycles(&card, 3000);
    set(&card, "reset", 1);
    cycles(&card, 1);
    assert_int_equal(get(&card, "count"), 0);
    set(&card, "reset", 0);
    card.count++;
    cycles(&card, 1);
    assert_int_equal(get(&card, "count"), 1);
    cycles(&card, 3000);
    set(&card, "scale", 4);
    cycles(&card, 1);
    assert_true(get(&card, "position") == 0.25);
    card.control |= 0x7; /* levels alone */
    cycles(&card, 1);
    assert_true(get(&card, "input-a") == 1.0 && get(&card, "input-b") == 1.0 && get(&card, "input-index") == 1.0);
    rig_free(card.rig);
}

static void counting_starts_at_the_counters_value(void **state)
{
    (void)state;
    struct encoder_card card = {.rig = rig_new(rig_image_7i96s(), ""), .base = 0x3000, .count = 0xFFFE};
    (void)rig_add(card.rig, &hm2_encoder_type);
    encoder_card_show(&card);
    rig_start(card.rig);
    assert_int_equal(get(&card, "rawcounts"), 0xFFFE);
    assert_int_equal(get(&card, "count"), 0);
    encoder_card_move(&card, 100, 5);
    encoder_card_cycle(&card);
    assert_int_equal(get(&card, "rawcounts"), 0x10003);
    assert_int_equal(get(&card, "count"), 5);
    rig_free(card.rig);
}

/* As in LinuxCNC, where HAL files and screens see the levels before any thread runs. */
static void the_levels_of_the_inputs_show_from_load_on(void **state)
{
    (void)state;
    struct encoder_card card = {.rig = rig_new(rig_image_7i96s(), ""), .base = 0x3000};
    (void)rig_add(card.rig, &hm2_encoder_type);
    rig_put(card.rig, CONTROL, 0x5);
    rig_start(card.rig);
    assert_int_equal(get(&card, "input-a"), 1);
    assert_int_equal(get(&card, "input-b"), 0);
    assert_int_equal(get(&card, "input-index"), 1);
    rig_free(card.rig);
}

static void counts_survive_a_power_cycle(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    struct hm2_module *const module = &card.rig->modules[0];
    encoder_card_move(&card, 100, 1234);
    encoder_card_cycle(&card);
    hm2_put_le32(((struct encoder_module *)module->context)->counts.bytes, 0); /* the board read again */
    module->type->start(module, &card.rig->cycle);
    card.count = 0;
    encoder_card_cycle(&card);
    assert_int_equal(get(&card, "count"), 1234);
    encoder_card_move(&card, 100, -4);
    encoder_card_cycle(&card);
    assert_int_equal(get(&card, "count"), 1230);
    assert_true(get(&card, "position") == 1230.0);
    rig_free(card.rig);
}

static void positions_go_on_where_the_32_bit_pins_wrap(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    set(&card, "scale", -2);
    const int64_t turns = 70000;
    for (int64_t i = 0; i < turns; i++) {
        encoder_card_move(&card, PERIOD_TICKS, 32767);
        encoder_card_cycle(&card);
    }
    const int64_t total = turns * 32767;
    assert_true(total > INT32_MAX);
    assert_true(get(&card, "position") == (double)total / -2.0);
    assert_true(get(&card, "rawcounts") == (double)(int32_t)(uint32_t)total);
    for (int64_t i = 0; i < turns; i++) {
        encoder_card_move(&card, PERIOD_TICKS, -32768);
        encoder_card_cycle(&card);
    }
    assert_true(get(&card, "position") == (double)-turns / -2.0);
    rig_free(card.rig);
}

static void reset_holds_the_position_at_zero(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    encoder_card_move(&card, 100, 10);
    set(&card, "reset", 1);
    encoder_card_cycle(&card);
    assert_int_equal(get(&card, "count"), 0);
    assert_int_equal(get(&card, "rawcounts"), 10);
    assert_int_equal(get(&card, "rawlatch"), 10);
    set(&card, "reset", 0);
    encoder_card_move(&card, 100, 3);
    encoder_card_cycle(&card);
    assert_int_equal(get(&card, "count"), 3);
    rig_free(card.rig);
}

static void an_impossible_scale_is_replaced(void **state)
{
    (void)state;
    static const double evil[] = {0.0, -0.0, NAN, INFINITY, -INFINITY, 4.9e-324};
    struct encoder_card card = open_7i96s();
    for (size_t i = 0; i < sizeof evil / sizeof evil[0]; i++) {
        set(&card, "scale", evil[i]);
        set(&card, "vel-timeout", evil[i]);
        encoder_card_move(&card, 1000, 1);
        encoder_card_cycle(&card);
        assert_true(get(&card, "scale") == 1.0);
        assert_true(isfinite(get(&card, "position")) && isfinite(get(&card, "velocity")));
        set(&card, "scale", 2);
        encoder_card_cycle(&card);
    }
    assert_int_equal(noticed(&card, HM2_NOTICE_VALUE_INVALID), 7); /* scales, and one time-out that is no number */
    rig_free(card.rig);
}

static void levels_are_shown(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    card.control |= 0x5;
    cycles(&card, 1);
    assert_true(get(&card, "input-a") == 1.0);
    assert_true(get(&card, "input-b") == 0.0);
    assert_true(get(&card, "input-index") == 1.0);
    rig_free(card.rig);
}

/* ---- index ------------------------------------------------------------------------------------------------------- */

static void an_index_zeroes_the_position_where_it_was(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    cycles(&card, 1);
    assert_int_equal(card.control, 0x0850);
    encoder_card_move(&card, 1000, 40);
    encoder_card_index(&card);
    encoder_card_move(&card, 1000, 2);
    encoder_card_cycle(&card);
    assert_true(get(&card, "index-enable") == 0.0);
    assert_int_equal(get(&card, "count"), 2);
    assert_int_equal(get(&card, "rawlatch"), 40);
    assert_int_equal(get(&card, "count-latched"), 0);
    assert_int_equal(card.control, 0x0800);
    rig_free(card.rig);
}

static void an_index_that_must_not_clear_only_latches(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    set(&card, "no_clear_on_index", 1);
    cycles(&card, 1);
    encoder_card_move(&card, 1000, -40);
    encoder_card_index(&card);
    encoder_card_move(&card, 1000, -2);
    encoder_card_cycle(&card);
    assert_true(get(&card, "index-enable") == 0.0);
    assert_int_equal(get(&card, "count"), -42);
    assert_int_equal(get(&card, "count-latched"), -40);
    rig_free(card.rig);
}

static void a_lost_arming_write_is_no_index(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    card.latch = 0x1234;
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    card.rig->lose_writes = true;
    cycles(&card, 3);
    assert_true(get(&card, "index-enable") == 1.0);
    card.rig->lose_writes = false;
    cycles(&card, 2);
    assert_true(get(&card, "index-enable") == 1.0);
    assert_int_equal(card.control, 0x0850); /* sent again until it arrived */
    encoder_card_index(&card);
    cycles(&card, 1);
    assert_true(get(&card, "index-enable") == 0.0);
    rig_free(card.rig);
}

static void a_new_search_right_after_an_index_finds_the_next_one(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    cycles(&card, 1);
    encoder_card_move(&card, 1000, 7);
    encoder_card_index(&card);
    encoder_card_show(&card);
    rig_read(card.rig);
    assert_true(get(&card, "index-enable") == 0.0);
    set(&card, "index-enable", 1); /* before the driver could write */
    rig_write_out(card.rig);
    encoder_card_take(&card);
    for (unsigned i = 0; i < 5; i++) {
        encoder_card_move(&card, 1000, 1);
        encoder_card_cycle(&card);
        assert_true(get(&card, "index-enable") == 1.0);
        assert_int_equal(get(&card, "count"), i + 1);
    }
    encoder_card_index(&card);
    cycles(&card, 1);
    assert_true(get(&card, "index-enable") == 0.0);
    assert_int_equal(get(&card, "count"), 0);
    rig_free(card.rig);
}

static void an_index_just_before_the_word_is_written_again_is_not_missed(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    cycles(&card, 3);
    /* The card has been read; now the index comes, and then a write that arms again because a parameter changed. */
    encoder_card_show(&card);
    rig_read(card.rig);
    encoder_card_move(&card, 100, 9);
    encoder_card_index(&card);
    set(&card, "filter", 0);
    rig_write_out(card.rig);
    encoder_card_take(&card);
    assert_int_equal(card.control, 0x0050);
    cycles(&card, 1);
    assert_true(get(&card, "index-enable") == 0.0);
    assert_int_equal(get(&card, "rawlatch"), 9);
    assert_int_equal(card.control, 0x0000);
    rig_free(card.rig);
}

static void a_polarity_is_in_place_before_the_latch_is_armed(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    set(&card, "index-invert", 1);
    cycles(&card, 1);
    assert_int_equal(card.control, 0x0808);
    cycles(&card, 1);
    assert_int_equal(card.control, 0x0858);
    rig_free(card.rig);
}

static void a_search_that_is_given_up_changes_nothing(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    cycles(&card, 2);
    set(&card, "index-enable", 0);
    cycles(&card, 2);
    encoder_card_move(&card, 100, 5);
    encoder_card_index(&card);
    cycles(&card, 2);
    assert_int_equal(get(&card, "count"), 5);
    assert_int_equal(get(&card, "rawlatch"), 0);
    rig_free(card.rig);
}

static void a_power_cycle_during_a_search_is_no_index(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    struct hm2_module *const module = &card.rig->modules[0];
    card.latch = 99;
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    cycles(&card, 2);
    card.control = card.latch = 0;
    encoder_card_show(&card);
    hm2_plan_touch_all(card.rig->plan);
    module->type->start(module, &card.rig->cycle);
    cycles(&card, 4);
    assert_true(get(&card, "index-enable") == 1.0);
    assert_int_equal(card.control, 0x0850);
    encoder_card_move(&card, 100, 5);
    encoder_card_index(&card);
    cycles(&card, 1);
    assert_true(get(&card, "index-enable") == 0.0);
    assert_int_equal(get(&card, "count"), 0);
    rig_free(card.rig);
}

static void a_word_that_an_old_write_undid_is_sent_again(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 3);
    card.control = 0x0400;
    cycles(&card, 2);
    assert_int_equal(card.control, 0x0800);
    cycles(&card, 1);
    assert_false(rig_wrote(card.rig, CONTROL));
    rig_free(card.rig);
}

static void an_old_arming_write_that_comes_late_is_no_index(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    card.rig->lose_writes = true;
    cycles(&card, 1);
    card.control = 0x0840; /* of an earlier search, whose event was reported then */
    cycles(&card, 1);
    assert_true(get(&card, "index-enable") == 1.0);
    card.rig->lose_writes = false;
    cycles(&card, 3);
    assert_true(get(&card, "index-enable") == 1.0);
    assert_int_equal(card.control, 0x0850);
    rig_free(card.rig);
}

static void a_search_is_armed_only_after_the_card_was_seen_disarmed(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    cycles(&card, 2);
    set(&card, "index-enable", 1);
    cycles(&card, 1);
    encoder_card_index(&card);
    card.rig->lose_writes = true; /* the word that disarms */
    cycles(&card, 1);
    assert_true(get(&card, "index-enable") == 0.0);
    set(&card, "index-enable", 1);
    card.rig->lose_writes = false;
    cycles(&card, 1);
    assert_int_equal(card.control, 0x0800);
    cycles(&card, 1);
    assert_int_equal(card.control, 0x0850);
    /* Given up and begun again without a reply between. */
    set(&card, "index-enable", 0);
    rig_write_out(card.rig);
    encoder_card_take(&card);
    set(&card, "index-enable", 1);
    rig_write_out(card.rig);
    encoder_card_take(&card);
    assert_int_equal(card.control, 0x0800);
    cycles(&card, 1);
    assert_int_equal(card.control, 0x0850);
    rig_free(card.rig);
}

static void the_first_cycle_takes_the_parameters_of_all_encoders(void **state)
{
    (void)state;
    struct encoder_card card = encoder_card_open(rig_image_7i93(), "", &hm2_encoder_type);
    rig_set(card.rig, "encoder.06.counter-mode", 1);
    cycles(&card, 1);
    assert_int_equal(rig_written(card.rig, CONTROL + 24), 0x0C00);
    rig_set(card.rig, "encoder.06.counter-mode", 0);
    cycles(&card, 8);
    assert_int_equal(rig_written(card.rig, CONTROL + 24), 0x0800);
    rig_free(card.rig);
}

/* Losses in both directions, index pulses and searches at random: whatever the driver calls an index was one, after
 * the search began and not a pulse earlier than the last. */
static void no_false_index_with_losses(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s();
    uint32_t seed = 1;
    unsigned found = 0;
    int64_t last_index = -1, search_began = 0;
    bool searching = false;
    cycles(&card, 2);
    for (unsigned i = 0; i < 200000; i++) {
        seed = seed * 1664525u + 1013904223u;
        const uint32_t dice = seed >> 8;
        encoder_card_move(&card, PERIOD_TICKS, 1 + (int)(dice % 3));
        if (dice % 37 == 0 && (card.control & 0x10)) {
            last_index = card.count;
            encoder_card_index(&card);
        }
        if (dice % 11 == 0) { /* the reply is lost: no unpack */
            rig_write_out(card.rig);
            encoder_card_take(&card);
            continue;
        }
        card.rig->lose_writes = dice % 7 == 0;
        encoder_card_cycle(&card);
        if (card.rig->lose_writes)
            card.rig->logged = 0;
        if (searching && get(&card, "index-enable") == 0.0) {
            searching = false;
            found++;
            assert_true(last_index >= search_began);
            assert_int_equal(get(&card, "rawlatch"), last_index);
            assert_int_equal(get(&card, "count"), card.count - last_index);
        } else if (!searching && dice % 5 == 0) {
            set(&card, "index-enable", 1);
            search_began = card.count;
            searching = true;
        }
    }
    assert_true(found > 1000);
    rig_free(card.rig);
}

/* ---- quadrature errors ------------------------------------------------------------------------------------------- */

static void old_quadrature_errors_are_not_reported(void **state)
{
    (void)state;
    for (int generation = 0; generation < 2; generation++) {
        struct encoder_card card = open_7i96s();
        card.new_quad_error = generation == 1;
        encoder_card_quad_error(&card);
        cycles(&card, 3);
        assert_true(get(&card, "quad-error") == 0.0);
        set(&card, "quad-error-enable", 1);
        cycles(&card, 6);
        assert_true(get(&card, "quad-error") == 0.0);
        assert_int_equal(card.control & 0x8000, 0);
        encoder_card_quad_error(&card);
        cycles(&card, 1);
        assert_true(get(&card, "quad-error") == 1.0);
        assert_int_equal(noticed(&card, HM2_NOTICE_QUAD_ERROR), 1);
        cycles(&card, 2);
        assert_true(get(&card, "quad-error") == 1.0);
        set(&card, "quad-error-enable", 0);
        cycles(&card, 2);
        assert_true(get(&card, "quad-error") == 0.0);
        set(&card, "quad-error-enable", 1);
        cycles(&card, 6);
        assert_true(get(&card, "quad-error") == 0.0);
        rig_free(card.rig);
    }
}

static void clearing_old_errors_survives_lost_writes(void **state)
{
    (void)state;
    struct encoder_card card = open_7i96s(); /* where writing bit 15 as 1 sets it */
    cycles(&card, 2);
    set(&card, "quad-error-enable", 1);
    cycles(&card, 1);
    assert_int_equal(card.control & 0x8000, 0x8000);
    card.rig->lose_writes = true;
    cycles(&card, 4);
    assert_true(get(&card, "quad-error") == 0.0);
    card.rig->lose_writes = false;
    cycles(&card, 4);
    assert_int_equal(card.control & 0x8000, 0);
    assert_int_equal(noticed(&card, HM2_NOTICE_QUAD_ERROR), 0);
    rig_free(card.rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_defaults_are_those_of_the_interface),
        cmocka_unit_test(an_encoder_has_seventeen_pins_and_seven_parameters),
        cmocka_unit_test(the_control_word_is_made_of_the_parameters),
        cmocka_unit_test(the_probe_exists_where_the_firmware_has_one),
        cmocka_unit_test(an_index_search_goes_before_a_probe),
        cmocka_unit_test(sample_frequencies_are_rounded_to_what_is_possible),
        cmocka_unit_test(divisors_follow_the_clock),
        cmocka_unit_test(the_timer_is_used_when_the_card_has_its_register),
        cmocka_unit_test(a_timer_number_without_a_register_does_nothing),
        cmocka_unit_test(probing_for_the_timer_spares_the_counts_of_another_module),
        cmocka_unit_test(pins_of_an_encoder_that_stands_still_are_written_at_once_at_first_and_then_in_turns),
        cmocka_unit_test(pins_act_on_an_encoder_that_stands_still),
        cmocka_unit_test(counting_starts_at_the_counters_value),
        cmocka_unit_test(the_levels_of_the_inputs_show_from_load_on),
        cmocka_unit_test(counts_survive_a_power_cycle),
        cmocka_unit_test(positions_go_on_where_the_32_bit_pins_wrap),
        cmocka_unit_test(reset_holds_the_position_at_zero),
        cmocka_unit_test(an_impossible_scale_is_replaced),
        cmocka_unit_test(levels_are_shown),
        cmocka_unit_test(an_index_zeroes_the_position_where_it_was),
        cmocka_unit_test(an_index_that_must_not_clear_only_latches),
        cmocka_unit_test(a_lost_arming_write_is_no_index),
        cmocka_unit_test(a_new_search_right_after_an_index_finds_the_next_one),
        cmocka_unit_test(an_index_just_before_the_word_is_written_again_is_not_missed),
        cmocka_unit_test(a_polarity_is_in_place_before_the_latch_is_armed),
        cmocka_unit_test(a_search_that_is_given_up_changes_nothing),
        cmocka_unit_test(a_power_cycle_during_a_search_is_no_index),
        cmocka_unit_test(a_word_that_an_old_write_undid_is_sent_again),
        cmocka_unit_test(no_false_index_with_losses),
        cmocka_unit_test(old_quadrature_errors_are_not_reported),
        cmocka_unit_test(an_old_arming_write_that_comes_late_is_no_index),
        cmocka_unit_test(a_search_is_armed_only_after_the_card_was_seen_disarmed),
        cmocka_unit_test(the_first_cycle_takes_the_parameters_of_all_encoders),
        cmocka_unit_test(clearing_old_errors_survives_lost_writes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
