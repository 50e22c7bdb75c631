/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The pipelined cycle on a simulated 7I96S, in virtual time (docs/pipelined-cycle.md). */
#include "servo_rig.h"

#include <math.h>

#define PIPELINED "pipelined=4 sserial_port_0=xxxxxxxx"

static void load_and_lock(struct servo_rig *const f)
{
    servo_load(f, PIPELINED);
    servo_cycles(f, 400);
    assert_true(servo_get(f, "pipeline.active") == 1);
}

/* ---- start-up and steady state ------------------------------------------------------------------------------------
 */

static void it_starts_by_itself_and_says_so(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, PIPELINED);
    servo_cycles(f, 200);
    assert_true(servo_get(f, "pipeline.active") == 0);
    servo_cycles(f, 200);
    assert_true(servo_get(f, "pipeline.active") == 1);
    assert_true(servo_message(f, "is pipelined now"));
    assert_true(servo_get(f, "packet-error-total") == 0);
}

static void a_read_waits_for_nothing_and_a_cycle_is_one_datagram_each_way(void **state)
{
    struct servo_rig *const f = *state;
    enum { CYCLES = 3000 };
    load_and_lock(f);
    const struct link_counters before = f->link->counters;
    for (unsigned i = 0; i < CYCLES; i++) {
        servo_cycle(f);
        assert_int_equal(f->read_ns, 0);
    }
    assert_int_equal(f->link->counters.sent - before.sent, CYCLES);
    assert_int_equal(f->link->counters.received - before.received, CYCLES);
    assert_true(servo_get(f, "packet-error-total") == 0);
    assert_true(servo_get(f, "pipeline.late") == 0);
    assert_in_range((unsigned)servo_get(f, "pipeline.wait-us"), 50, 100);
    /* Sampled so long behind the write as the timer says, and used at the end of the period. */
    assert_in_range((unsigned)servo_get(f, "pipeline.data-age-us"), 700, 850);
    assert_in_range((unsigned)servo_get(f, "pipeline.margin-us"), 500, 850);
}

/* The write of the cycle in which turns begin comes later than those after it, by the round trip that its read waits.
 */
static void turns_find_the_timer_in_its_place_from_the_beginning(void **state)
{
    struct servo_rig *const f = *state;
    servo_faults(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 120000, .delay_max_ns = 120000});
    servo_load(f, PIPELINED);
    for (unsigned i = 0; i < 1000 && servo_get(f, "pipeline.active") == 0; i++)
        servo_cycle(f);
    servo_cycles(f, 3);
    for (unsigned i = 0; i < 400; i++) {
        servo_cycle(f);
        assert_in_range((unsigned)servo_get(f, "pipeline.wait-us"), 50, 110);
    }
    assert_true(servo_get(f, "pipeline.active") == 1);
}

static void without_the_key_nothing_changes(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, "sserial_port_0=xxxxxxxx");
    assert_null(hm2_plain_find(f->plain, PREFIX "pipeline.active"));
    servo_cycles(f, 600);
    assert_int_not_equal(f->read_ns, 0);
}

static void it_is_refused_without_a_dpll(void **state)
{
    struct servo_rig *const f = *state;
    assert_int_equal(hm2_board_identify(f->board, f->link, &f->diag), 0);
    assert_int_equal(hm2_board_setup(f->board, 0, hm2_plain_binder(f->plain), "pipelined=1 num_dplls=0", &f->diag),
                     HM2_ERR_INVALID);
    assert_non_null(strstr(f->diag.text, "num_dplls=0"));
}

static void without_room_it_stays_plain_and_says_why(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, PIPELINED);
    f->work_ns = 900000;
    servo_cycles(f, 1000);
    assert_true(servo_get(f, "pipeline.active") == 0);
    assert_true(servo_message(f, "has no room"));
    f->work_ns = WORK_NS;
    servo_cycles(f, 500);
    assert_true(servo_get(f, "pipeline.active") == 1);
}

static void a_timer_before_its_reference_is_no_timer_to_wait_for(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, PIPELINED);
    servo_set(f, "dpll.04.timer-us", -50);
    servo_cycles(f, 600);
    assert_true(servo_get(f, "pipeline.active") == 0);
    assert_true(servo_message(f, "has no room"));
}

/* ---- feedback that is one period old ------------------------------------------------------------------------------
 */

static void run_at(struct servo_rig *const f, const double steps_per_s)
{
    servo_set(f, "stepgen.00.steplen", 1000);
    servo_set(f, "stepgen.00.stepspace", 1000);
    servo_set(f, "stepgen.00.maxaccel", 0);
    servo_set(f, "stepgen.00.control-type", 1);
    servo_set(f, "stepgen.00.velocity-cmd", steps_per_s);
    servo_set(f, "stepgen.00.enable", 1);
}

/* The encoder shows where the axis was when the card read it, the step generator where it is. */
static void a_step_generator_shows_where_it_is_and_an_encoder_where_it_was(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    assert_int_equal(sim_card_follow(f->card, 0, 0, 1, 1), 0);
    run_at(f, 10000);
    servo_cycles(f, 1000);
    const double zero = servo_get(f, "stepgen.00.counts") - servo_get(f, "encoder.00.count");
    for (unsigned i = 0; i < 200; i++) {
        int64_t turned;
        assert_int_equal(sim_card_turned(f->card, HM2_GTAG_ENCODER, 0, &turned), 0);
        servo_cycle(f);
        const double position = servo_get(f, "stepgen.00.position-fb");
        const double seen = servo_get(f, "encoder.00.count") + zero;
        assert_true(fabs(position - seen - servo_get(f, "pipeline.data-age-us") * 0.01) < 2.0);
        assert_true(fabs(servo_get(f, "encoder.00.velocity") - 10000) < 50);
    }
}

static void a_step_generator_arrives_where_it_is_sent(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    servo_set(f, "stepgen.00.position-scale", 1000);
    servo_set(f, "stepgen.00.steplen", 1000);
    servo_set(f, "stepgen.00.stepspace", 1000);
    servo_set(f, "stepgen.00.maxaccel", 1000);
    servo_set(f, "stepgen.00.maxvel", 50);
    servo_set(f, "stepgen.00.enable", 1);
    double position = 0.0;
    for (unsigned i = 0; i < 3000; i++) {
        const double command = i < 2000 ? i * 0.01 : 20.0;
        servo_set(f, "stepgen.00.position-cmd", command);
        servo_cycle(f);
        position = servo_get(f, "stepgen.00.position-fb");
        /* As in a plain cycle, it is behind by what it moves in about two periods, not by three. */
        if (i > 500 && i < 2000)
            assert_true(command - position > 0.0 && command - position < 0.021);
    }
    assert_true(fabs(position - 20.0) < 0.001);
}

static void an_index_is_found_once_at_its_place(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    assert_int_equal(sim_card_follow(f->card, 0, 0, 1, 1), 0);
    assert_int_equal(sim_card_index(f->card, 0, 4000), 0);
    run_at(f, 10000);
    servo_cycles(f, 100);
    for (unsigned turn = 0; turn < 3; turn++) {
        servo_set(f, "encoder.00.index-enable", 1);
        servo_cycle(f);
        unsigned waited = 0;
        while (servo_get(f, "encoder.00.index-enable") == 1 && waited++ < 500)
            servo_cycle(f);
        assert_in_range(waited, 100, 401);
        /* Fewer counts behind the index than two periods bring. */
        assert_true(servo_get(f, "encoder.00.count") >= 0 && servo_get(f, "encoder.00.count") < 20);
        servo_cycles(f, 100);
    }
}

/* ---- faults -------------------------------------------------------------------------------------------------------
 */

static void one_is_lost(struct servo_rig *const f)
{
    servo_no_faults(f);
    servo_cycles(f, 1);
    servo_no_faults(f);
    assert_true(servo_get(f, "packet-error-total") == 1);
    assert_true(servo_get(f, "packet-lost") == 1);
    assert_true(servo_get(f, "pipeline.active") == 1);
    servo_cycles(f, 20);
    assert_true(servo_get(f, "packet-error-total") == 1);
    assert_true(servo_get(f, "packet-error") == 0);
    assert_true(servo_get(f, "watchdog.has_bit") == 0);
    assert_true(servo_get(f, "pipeline.active") == 1);
    assert_int_equal(f->read_ns, 0);
}

static void a_lost_request_costs_one_cycle(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    servo_faults(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    servo_cycle(f);
    one_is_lost(f);
}

static void a_lost_reply_costs_one_cycle(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    servo_spoil_next_reply(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    servo_cycle(f);
    one_is_lost(f);
}

static void a_late_reply_is_waited_for_and_costs_none(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    servo_spoil_next_reply(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 900000, .delay_max_ns = 900000});
    servo_cycle(f);
    servo_no_faults(f);
    servo_cycle(f);
    assert_in_range(f->read_ns, 50000, 400000);
    assert_true(servo_get(f, "pipeline.margin-us") < -50);
    assert_true(servo_get(f, "pipeline.late") == 1);
    servo_cycles(f, 3);
    assert_int_equal(f->read_ns, 0);
    assert_true(servo_get(f, "packet-error-total") == 0);
    assert_true(servo_get(f, "pipeline.active") == 1);
}

static void a_late_request_does_not_wait_for_the_timer_of_the_next_period(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    servo_faults(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 300000, .delay_max_ns = 300000});
    servo_cycle(f);
    servo_no_faults(f);
    servo_cycle(f);
    assert_true(servo_get(f, "pipeline.wait-us") <= 151);
    servo_cycles(f, 5);
    assert_true(servo_get(f, "packet-error-total") == 0);
    assert_true(servo_get(f, "pipeline.late") == 0);
}

static void a_repeated_reply_is_used_once(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    servo_faults(f, &(struct sim_faults){.seed = 1, .duplicate = 1.0});
    servo_cycles(f, 50);
    servo_no_faults(f);
    servo_cycles(f, 5);
    assert_true(servo_get(f, "packet-error-total") == 0);
    assert_true(servo_get(f, "packet-stale") > 40);
    assert_true(servo_get(f, "pipeline.active") == 1);
}

static void clocks_that_differ(struct servo_rig *const f, const int64_t by_ns)
{
    f->period_ns = PERIOD_NS + by_ns;
    load_and_lock(f);
    for (unsigned i = 0; i < 5000; i++) {
        servo_cycle(f);
        assert_int_equal(f->read_ns, 0);
        assert_in_range((unsigned)servo_get(f, "pipeline.wait-us"), 40, 110);
    }
    assert_true(servo_get(f, "packet-error-total") == 0);
}

static void a_card_whose_clock_is_100_ppm_slow_is_followed(void **state)
{
    clocks_that_differ(*state, -100);
}

static void a_card_whose_clock_is_100_ppm_fast_is_followed(void **state)
{
    clocks_that_differ(*state, 100);
}

static void without_margin_it_falls_back_says_so_and_returns(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    servo_faults(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 350000, .delay_max_ns = 350000});
    f->work_ns = 250000;
    servo_cycles(f, 40);
    assert_true(servo_get(f, "pipeline.active") == 0);
    assert_true(servo_get(f, "pipeline.falls") == 1);
    assert_true(servo_message(f, "plain cycles again"));
    servo_no_faults(f);
    f->work_ns = WORK_NS;
    servo_cycles(f, 900);
    assert_true(servo_get(f, "pipeline.active") == 0);
    servo_cycles(f, 1500);
    assert_true(servo_get(f, "pipeline.active") == 1);
    assert_true(servo_message(f, "is pipelined now"));
}

static void a_held_up_thread_makes_the_watchdog_bite_and_a_lost_turn_does_not(void **state)
{
    struct servo_rig *const f = *state;
    enum { STEP_IO = 17 };
    load_and_lock(f);
    servo_set(f, "watchdog.timeout_ns", 3000000); /* above two periods and the wait for the reply */
    servo_cycles(f, 5);
    servo_faults(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    servo_cycle(f);
    servo_no_faults(f);
    servo_cycles(f, 5);
    assert_true(servo_get(f, "watchdog.has_bit") == 0);
    f->start_ns += 10 * PERIOD_NS;
    sim_net_sleep_until(f->net, f->start_ns);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    servo_cycles(f, 3);
    assert_true(servo_get(f, "watchdog.has_bit") == 1);
    servo_set(f, "watchdog.has_bit", 0);
    servo_cycles(f, 20);
    assert_true(servo_get(f, "watchdog.has_bit") == 0);
    assert_int_not_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    assert_true(servo_get(f, "pipeline.active") == 1);
}

static void a_power_cycle_is_survived(void **state)
{
    struct servo_rig *const f = *state;
    load_and_lock(f);
    servo_set(f, "auto-rearm", 1);
    sim_card_power_cycle(f->card);
    servo_cycles(f, 3000);
    assert_true(servo_get(f, "packet-error") == 0);
    assert_true(servo_get(f, "position-lost") == 1);
    assert_true(servo_get(f, "pipeline.active") == 1);
}

/* ---- the long tail ------------------------------------------------------------------------------------------------
 */

/* One datagram of a thousand takes 0.9 ms longer. What is printed is for tests/bench/run. */
static unsigned missed(struct servo_rig *const f, const char *const config)
{
    servo_load(f, config);
    servo_cycles(f, 400);
    servo_faults(f, &(struct sim_faults){.seed = 7, .tail = 0.001, .tail_ns = 900000});
    servo_cycles(f, 20000);
    const unsigned lost = (unsigned)servo_get(f, "packet-lost");
    print_message("missed %u of 20000 with \"%s\"\n", lost, config);
    return lost;
}

static void plain_cycles_miss_deadlines_on_a_network_with_a_long_tail(void **state)
{
    assert_in_range(missed(*state, "sserial_port_0=xxxxxxxx"), 10, 100);
}

static void pipelined_cycles_miss_none(void **state)
{
    struct servo_rig *const f = *state;
    assert_int_equal(missed(f, PIPELINED), 0);
    assert_true(servo_get(f, "pipeline.late") > 5);
    assert_true(servo_get(f, "packet-error-total") == 0);
    assert_true(servo_get(f, "pipeline.active") == 1);
    assert_true(servo_get(f, "pipeline.falls") == 0);
}

#define TEST(function) cmocka_unit_test_setup_teardown(function, servo_set_up, servo_tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(it_starts_by_itself_and_says_so),
        TEST(a_read_waits_for_nothing_and_a_cycle_is_one_datagram_each_way),
        TEST(turns_find_the_timer_in_its_place_from_the_beginning),
        TEST(without_the_key_nothing_changes),
        TEST(it_is_refused_without_a_dpll),
        TEST(without_room_it_stays_plain_and_says_why),
        TEST(a_timer_before_its_reference_is_no_timer_to_wait_for),
        TEST(a_step_generator_shows_where_it_is_and_an_encoder_where_it_was),
        TEST(a_step_generator_arrives_where_it_is_sent),
        TEST(an_index_is_found_once_at_its_place),
        TEST(a_lost_request_costs_one_cycle),
        TEST(a_lost_reply_costs_one_cycle),
        TEST(a_late_reply_is_waited_for_and_costs_none),
        TEST(a_late_request_does_not_wait_for_the_timer_of_the_next_period),
        TEST(a_repeated_reply_is_used_once),
        TEST(a_card_whose_clock_is_100_ppm_slow_is_followed),
        TEST(a_card_whose_clock_is_100_ppm_fast_is_followed),
        TEST(without_margin_it_falls_back_says_so_and_returns),
        TEST(a_held_up_thread_makes_the_watchdog_bite_and_a_lost_turn_does_not),
        TEST(a_power_cycle_is_survived),
        TEST(plain_cycles_miss_deadlines_on_a_network_with_a_long_tail),
        TEST(pipelined_cycles_miss_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
