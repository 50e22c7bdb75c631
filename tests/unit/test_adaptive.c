/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The adaptive deadline and the second request, in virtual time. */
#include "servo_rig.h"

static const struct sim_faults loss = {.seed = 1, .loss = 1.0};

static void load_and_learn(struct servo_rig *const f, const char *const config)
{
    servo_load(f, config);
    servo_cycles(f, 500);
    assert_true(servo_get(f, "packet-error-total") == 0);
}

static void lose_a_reply(struct servo_rig *const f)
{
    servo_spoil_next_reply(f, &loss);
    servo_cycle(f);
    servo_no_faults(f);
}

static void a_loss_costs_two_round_trips_instead_of_most_of_a_period(void **state)
{
    struct servo_rig *const f = *state;
    load_and_learn(f, "adaptive_timeout");
    const double rtt_us = servo_get(f, "rtt-us");
    const double deadline_us = servo_get(f, "adaptive.deadline-us");
    assert_true(deadline_us > 2 * rtt_us && deadline_us < 2.5 * rtt_us + 25);
    lose_a_reply(f);
    assert_in_range(f->read_ns, (int64_t)(deadline_us * 1e3) - 1000, (int64_t)(deadline_us * 1e3) + 1000);
    assert_true(servo_get(f, "packet-lost") == 1);
    servo_cycles(f, 20);
    assert_true(servo_get(f, "packet-lost") == 1);
    assert_true(servo_get(f, "adaptive.requests") == 0);
}

static void until_enough_is_known_the_deadline_is_that_of_the_parameter(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, "adaptive_timeout");
    servo_cycles(f, 100);
    assert_true(servo_get(f, "adaptive.deadline-us") == 800);
    lose_a_reply(f);
    assert_int_equal(f->read_ns, 800000);
}

static void a_network_that_becomes_slower_is_followed(void **state)
{
    struct servo_rig *const f = *state;
    load_and_learn(f, "adaptive_timeout");
    servo_faults(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 250000, .delay_max_ns = 250000});
    servo_cycles(f, 1000);
    const double lost = servo_get(f, "packet-lost");
    assert_in_range((unsigned)lost, 1, 5);
    assert_true(servo_get(f, "io_error") == 0);
    servo_cycles(f, 5000);
    assert_true(servo_get(f, "packet-lost") == lost);
    servo_no_faults(f);
    servo_cycles(f, 60000);
    assert_true(servo_get(f, "adaptive.deadline-us") < 400);
}

static void the_parameter_stays_the_last_deadline(void **state)
{
    struct servo_rig *const f = *state;
    load_and_learn(f, "second_request");
    servo_faults(f, &loss);
    for (unsigned i = 0; i < 4; i++) {
        servo_cycle(f);
        assert_true(f->read_ns <= 800000);
    }
    assert_true(servo_get(f, "adaptive.deadline-us") <= 800);
}

static void with_a_second_request_a_lost_reply_costs_no_cycle(void **state)
{
    struct servo_rig *const f = *state;
    load_and_learn(f, "second_request");
    servo_faults(f, &(struct sim_faults){.seed = 3, .loss = 0.01});
    for (unsigned i = 0; i < 1000 && servo_get(f, "adaptive.requests") == 0; i++)
        servo_cycle(f);
    assert_in_range(f->read_ns, 50000, 300000);
    assert_true(servo_get(f, "packet-error-total") == 0);
    assert_true(servo_get(f, "adaptive.requests") == 1);
    assert_true(servo_get(f, "adaptive.saved") == 1);
    assert_true(servo_get(f, "data-age") == 0);
}

static void a_reply_that_was_only_late_is_used_and_the_other_dropped(void **state)
{
    struct servo_rig *const f = *state;
    load_and_learn(f, "second_request");
    servo_spoil_next_reply(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 100000, .delay_max_ns = 100000});
    servo_cycle(f);
    servo_no_faults(f);
    servo_cycles(f, 3);
    assert_true(servo_get(f, "packet-error-total") == 0);
    assert_true(servo_get(f, "adaptive.requests") == 1);
    assert_true(servo_get(f, "packet-stale") == 1);
}

static void what_goes_away_by_being_read_is_not_read_twice(void **state)
{
    struct servo_rig *const f = *state;
    load_and_learn(f, "second_request enable_raw");
    lose_a_reply(f);
    assert_true(servo_get(f, "adaptive.requests") == 0);
    assert_true(servo_get(f, "packet-lost") == 1);
}

static unsigned failed_cycles(struct servo_rig *const f, const char *const config)
{
    load_and_learn(f, config);
    servo_set(f, "packet-error-limit", 1000000);
    servo_faults(f, &(struct sim_faults){.seed = 3, .loss = 0.005});
    servo_cycles(f, 10000);
    return (unsigned)servo_get(f, "packet-lost");
}

static void one_loss_in_a_hundred_fails_as_many_plain_cycles(void **state)
{
    assert_in_range(failed_cycles(*state, NULL), 70, 130);
}

static void with_second_requests_hardly_any(void **state)
{
    struct servo_rig *const f = *state;
    assert_in_range(failed_cycles(f, "second_request"), 0, 5);
    assert_true(servo_get(f, "adaptive.saved") > 70);
}

#define TEST(function) cmocka_unit_test_setup_teardown(function, servo_set_up, servo_tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_loss_costs_two_round_trips_instead_of_most_of_a_period),
        TEST(until_enough_is_known_the_deadline_is_that_of_the_parameter),
        TEST(a_network_that_becomes_slower_is_followed),
        TEST(the_parameter_stays_the_last_deadline),
        TEST(with_a_second_request_a_lost_reply_costs_no_cycle),
        TEST(a_reply_that_was_only_late_is_used_and_the_other_dropped),
        TEST(what_goes_away_by_being_read_is_not_read_twice),
        TEST(one_loss_in_a_hundred_fails_as_many_plain_cycles),
        TEST(with_second_requests_hardly_any),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
