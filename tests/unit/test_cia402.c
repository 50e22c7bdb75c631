/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A CiA 402 drive and its CANopen node, in virtual time. */
#include "unit.h"

#include <math.h>

#include <hm2/cia402.h>
#include <hm2/nmt.h>

#define MS INT64_C(1000000)

/* ---- statusword ---------------------------------------------------------------------------------------------------
 */

/* The profile's table of states by bits 6, 5, 3, 2, 1, 0 of the statusword; x may be either. */
static const struct {
    const char *bits;
    enum hm2_cia402_state state;
} table[] = {
    {"0x0000", HM2_CIA402_NOT_READY},
    {"1x0000", HM2_CIA402_SWITCH_ON_DISABLED},
    {"010001", HM2_CIA402_READY_TO_SWITCH_ON},
    {"010011", HM2_CIA402_SWITCHED_ON},
    {"010111", HM2_CIA402_OPERATION_ENABLED},
    {"000111", HM2_CIA402_QUICK_STOP_ACTIVE},
    {"0x1111", HM2_CIA402_FAULT_REACTION_ACTIVE},
    {"0x1000", HM2_CIA402_FAULT},
};

static enum hm2_cia402_state by_table(const unsigned word)
{
    static const unsigned char bit[] = {6, 5, 3, 2, 1, 0};
    for (unsigned row = 0; row < sizeof table / sizeof table[0]; row++) {
        bool fits = true;
        for (unsigned i = 0; i < sizeof bit; i++)
            fits = fits && (table[row].bits[i] == 'x' || (table[row].bits[i] == '1') == ((word >> bit[i] & 1u) != 0));
        if (fits)
            return table[row].state;
    }
    return HM2_CIA402_UNKNOWN;
}

static void every_statusword_is_the_state_of_the_profiles_table(void **unused)
{
    (void)unused;
    for (unsigned word = 0; word <= 0xFFFFu; word++)
        if (hm2_cia402_state((uint16_t)word) != by_table(word))
            fail_msg("%#x is state %d, expected %d", word, hm2_cia402_state((uint16_t)word), by_table(word));
}

/* ---- a drive ------------------------------------------------------------------------------------------------------
 */

static struct hm2_cia402 drive;
static struct hm2_cia402_in in;
static struct hm2_cia402_out out;
static int64_t now_ns;

static int start(void **unused)
{
    (void)unused;
    drive = (struct hm2_cia402){0};
    in = (struct hm2_cia402_in){.online = true, .statusword = 0x0240, .mode = 8, .mode_shown = 8, .position = 5.0};
    now_ns = 1000 * MS;
    return 0;
}

static void step(void)
{
    hm2_cia402_step(&drive, &in, now_ns, &out);
    now_ns += MS;
}

static void answers(const uint16_t statusword, const uint16_t controlword)
{
    in.statusword = statusword;
    step();
    if (out.controlword != controlword)
        fail_msg("to %#x it says %#x, expected %#x", statusword, out.controlword, controlword);
}

static void enabled(void)
{
    step(); /* enable is 0 */
    in.enable = true;
    answers(0x0240, 0x06);
    answers(0x0221, 0x07);
    answers(0x0233, 0x0F);
    assert_false(out.enabled);
    answers(0x0237, 0x0F);
    assert_true(out.enabled);
    assert_false(out.fault);
}

static void it_goes_up_and_down_step_by_step(void **unused)
{
    (void)unused;
    answers(0x0240, 0x00);
    enabled();
    in.enable = false;
    answers(0x0237, 0x07);
    assert_false(out.enabled);
    answers(0x0233, 0x06);
    answers(0x0231, 0x06);
    assert_false(out.fault);
    answers(0x0000, 0x00);
    assert_int_equal(out.state, HM2_CIA402_NOT_READY);
}

static void targets_are_followed_only_while_enabled_and_in_their_mode(void **unused)
{
    (void)unused;
    in.position_command = 7.0;
    in.velocity_command = 3.0;
    enabled();
    assert_float_equal(out.position_target, 7.0, 0);
    assert_float_equal(out.velocity_target, 0.0, 0);
    in.position_command = NAN;
    step();
    assert_float_equal(out.position_target, 5.0, 0);
    in.position_command = 7.0;
    in.mode = 9;
    step(); /* the drive still shows 8 */
    assert_int_equal(out.mode, 9);
    assert_float_equal(out.position_target, 5.0, 0);
    assert_float_equal(out.velocity_target, 0.0, 0);
    in.mode_shown = 9;
    step();
    assert_float_equal(out.velocity_target, 3.0, 0);
    in.velocity_command = INFINITY;
    step();
    assert_float_equal(out.velocity_target, 0.0, 0);
    in.velocity_command = 3.0;
    in.mode = in.mode_shown = 3;
    step();
    assert_float_equal(out.velocity_target, 3.0, 0);
    in.enable = false;
    step();
    assert_float_equal(out.velocity_target, 0.0, 0);
}

static void after_a_fault_enable_must_fall_and_rise(void **unused)
{
    (void)unused;
    enabled();
    answers(0x021F, 0x00);
    assert_true(out.fault);
    answers(0x0218, 0x00);
    assert_int_equal(out.state, HM2_CIA402_FAULT);
    in.reset = true;
    answers(0x0218, 0x80);
    in.reset = false;
    answers(0x0218, 0x80); /* held until the drive has seen it */
    answers(0x0250, 0x00);
    assert_true(out.fault);
    in.enable = false;
    answers(0x0250, 0x00);
    assert_false(out.fault);
    in.enable = true;
    answers(0x0250, 0x06);
}

static void a_reset_that_does_not_help_ends_and_can_be_repeated(void **unused)
{
    (void)unused;
    in.reset = true;
    answers(0x0218, 0x80);
    now_ns += HM2_CIA402_RESET_NS;
    answers(0x0218, 0x00); /* the level alone does nothing */
    in.reset = false;
    answers(0x0218, 0x00);
    in.reset = true;
    answers(0x0218, 0x80);
    in.reset = false;
    answers(0x0240, 0x00);
    answers(0x0218, 0x00); /* a new fault is not reset by an old edge */
}

static void a_drive_that_leaves_is_not_enabled_again_by_itself(void **unused)
{
    (void)unused;
    static const uint16_t leaves[] = {0x0240, 0x0231, 0x0233, 0x0217, 0x0000};
    for (unsigned i = 0; i < sizeof leaves / sizeof leaves[0]; i++) {
        (void)start(NULL);
        enabled();
        in.statusword = leaves[i];
        step();
        assert_true(out.fault);
        assert_int_not_equal(out.controlword, 0x0F);
        in.statusword = 0x0237;
        step();
        assert_false(out.enabled);
        assert_int_equal(out.controlword, 0x07);
    }
}

static void a_lost_drive_is_stopped_and_then_commanded_off(void **unused)
{
    (void)unused;
    in.position_command = 7.0;
    enabled();
    in.online = false;
    answers(0x0237, 0x02);
    assert_false(out.enabled);
    assert_true(out.fault);
    assert_int_equal(out.state, HM2_CIA402_UNKNOWN);
    assert_float_equal(out.position_target, 5.0, 0);
    in.enable = false;
    answers(0x0237, 0x00);
    in.online = true;
    answers(0x0240, 0x00);
    enabled();
}

static void enabling_what_is_not_there_is_a_fault(void **unused)
{
    (void)unused;
    in.online = false;
    in.enable = true;
    step();
    assert_true(out.fault);
    in.online = true;
    answers(0x0240, 0x00);
    assert_true(out.fault);
}

static void a_quick_stop_is_held_and_ends_disabled(void **unused)
{
    (void)unused;
    enabled();
    in.quick_stop = true;
    answers(0x0237, 0x02);
    assert_false(out.enabled);
    answers(0x0217, 0x02);
    in.quick_stop = false;
    answers(0x0217, 0x02);
    assert_true(out.fault);
    in.enable = false;
    answers(0x0217, 0x00);
    assert_false(out.fault);
    in.enable = true; /* before the drive has left the state */
    answers(0x0217, 0x00);
    answers(0x0240, 0x06);
}

static void a_drive_that_stops_by_itself_may_do_so(void **unused)
{
    (void)unused;
    enabled();
    answers(0x0217, 0x02);
    assert_true(out.fault);
    answers(0x0217, 0x02);
    in.enable = false;
    answers(0x0217, 0x00);
}

static void homing_counts_when_the_drive_has_moved(void **unused)
{
    (void)unused;
    enabled();
    in.home = true;
    answers(0x1637, 0x0F); /* "attained" of earlier, and still the other mode */
    assert_int_equal(out.mode, 6);
    in.mode_shown = 6;
    answers(0x1637, 0x1F);
    assert_true(out.homing);
    assert_false(out.homed);
    answers(0x0237, 0x1F);
    answers(0x1237, 0x1F);
    assert_true(out.homing);
    answers(0x1637, 0x1F);
    assert_true(out.homed);
    assert_false(out.homing);
    in.home = false;
    in.position_command = 7.0;
    answers(0x1637, 0x0F);
    assert_true(out.homed);
    assert_float_equal(out.position_target, 5.0, 0);
    in.mode_shown = 8;
    step();
    assert_float_equal(out.position_target, 7.0, 0);
    in.online = false;
    step();
    assert_false(out.homed);
}

static void homing_that_fails_is_told(void **unused)
{
    (void)unused;
    enabled();
    in.home = true;
    in.mode_shown = 6;
    answers(0x0237, 0x1F);
    answers(0x2637, 0x1F);
    assert_true(out.homing_error);
    assert_false(out.homing);
    assert_false(out.homed);
}

/* ---- its node -----------------------------------------------------------------------------------------------------
 */

static void a_node_is_started_when_it_has_booted(void **unused)
{
    (void)unused;
    struct hm2_nmt node = {0};
    struct hm2_nmt_in hears = {.lost = true};
    assert_false(hm2_nmt_look(&node, &hears));
    assert_false(hm2_nmt_must_start(&node, &hears, 0));
    hears = (struct hm2_nmt_in){.state = HM2_NMT_BOOT_UP, .count = 1};
    assert_false(hm2_nmt_look(&node, &hears));
    assert_true(hm2_nmt_must_start(&node, &hears, 0));
    hm2_nmt_started(&node, 0);
    hears.state = HM2_NMT_PRE_OPERATIONAL;
    assert_false(hm2_nmt_must_start(&node, &hears, HM2_NMT_RETRY_NS - 1));
    assert_true(hm2_nmt_must_start(&node, &hears, HM2_NMT_RETRY_NS));
    hears.state = HM2_NMT_OPERATIONAL;
    assert_true(hm2_nmt_look(&node, &hears));
    assert_false(hm2_nmt_must_start(&node, &hears, 10 * HM2_NMT_RETRY_NS));
    hears.lost = true;
    assert_false(hm2_nmt_look(&node, &hears));
    hears = (struct hm2_nmt_in){.state = HM2_NMT_STOPPED};
    assert_false(hm2_nmt_must_start(&node, &hears, 10 * HM2_NMT_RETRY_NS));
}

static void guarding_responses_must_alternate(void **unused)
{
    (void)unused;
    static const struct {
        uint32_t count;
        bool toggle;
        uint32_t errors;
    } rows[] = {{0, false, 0}, {1, false, 0}, {1, false, 0}, {2, true, 0},
                {3, true, 1},  {4, false, 1}, {6, false, 1}, {7, false, 2}};
    struct hm2_nmt node = {0};
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct hm2_nmt_in hears = {
            .state = HM2_NMT_OPERATIONAL, .guarding = true, .count = rows[i].count, .toggle = rows[i].toggle};
        assert_true(hm2_nmt_look(&node, &hears));
        if (node.toggle_errors != rows[i].errors)
            fail_msg("row %u: %u errors, expected %u", i, node.toggle_errors, rows[i].errors);
    }
}

static void heartbeats_have_no_toggle_bit(void **unused)
{
    (void)unused;
    struct hm2_nmt node = {0};
    struct hm2_nmt_in hears = {.state = HM2_NMT_OPERATIONAL};
    for (; hears.count < 5; hears.count++)
        (void)hm2_nmt_look(&node, &hears);
    hears.guarding = true; /* the first response may have it as the last heartbeat had */
    (void)hm2_nmt_look(&node, &hears);
    hears.count++;
    (void)hm2_nmt_look(&node, &hears);
    assert_int_equal(node.toggle_errors, 1); /* two responses alike */
}

#define WITH_DRIVE(test) cmocka_unit_test_setup(test, start)

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_statusword_is_the_state_of_the_profiles_table),
        WITH_DRIVE(it_goes_up_and_down_step_by_step),
        WITH_DRIVE(targets_are_followed_only_while_enabled_and_in_their_mode),
        WITH_DRIVE(after_a_fault_enable_must_fall_and_rise),
        WITH_DRIVE(a_reset_that_does_not_help_ends_and_can_be_repeated),
        WITH_DRIVE(a_drive_that_leaves_is_not_enabled_again_by_itself),
        WITH_DRIVE(a_lost_drive_is_stopped_and_then_commanded_off),
        WITH_DRIVE(enabling_what_is_not_there_is_a_fault),
        WITH_DRIVE(a_quick_stop_is_held_and_ends_disabled),
        WITH_DRIVE(a_drive_that_stops_by_itself_may_do_so),
        WITH_DRIVE(homing_counts_when_the_drive_has_moved),
        WITH_DRIVE(homing_that_fails_is_told),
        cmocka_unit_test(a_node_is_started_when_it_has_booted),
        cmocka_unit_test(guarding_responses_must_alternate),
        cmocka_unit_test(heartbeats_have_no_toggle_bit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
