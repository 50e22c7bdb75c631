/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The pipelined cycle on a simulated 7I96S, in virtual time (docs/pipelined-cycle.md). */
#include "unit.h"

#include <math.h>

#include <hm2/board.h>
#include <hm2/sim.h>

#define PERIOD_NS 1000000
#define WORK_NS   100000 /* of the thread, between read and write */
#define PREFIX    "hm2_7i96s.0."
#define PIPELINED "pipelined=4 sserial_port_0=xxxxxxxx"

struct fixture {
    struct sim_card *card;
    struct sim_net *net;
    struct link *link;
    struct hm2_board *board;
    struct hm2_plain_binder *plain;
    struct hm2_diag diag;
    int64_t start_ns;         /* of the present period */
    int64_t period_ns;        /* by the clock of the network and the card; the thread believes in PERIOD_NS */
    int64_t read_ns, work_ns; /* what the last read took; what the thread takes */
    struct sim_faults reply_faults;
    bool spoil_reply;
};

static int set_up(void **state)
{
    struct fixture *const f = calloc(1, sizeof *f);
    assert_non_null(f);
    const struct sim_card_options options = {.profile = "7i96s", .seed = 1};
    if (sim_card_new(&f->card, &options, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
    assert_int_equal(sim_net_new(&f->net, f->card, NULL), 0);
    f->link = sim_net_link(f->net);
    f->board = hm2_board_new();
    f->plain = hm2_plain_binder_new();
    assert_non_null(f->board);
    assert_non_null(f->plain);
    f->period_ns = PERIOD_NS;
    f->work_ns = WORK_NS;
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *const f = *state;
    hm2_board_free(f->board);
    hm2_plain_binder_free(f->plain);
    sim_net_free(f->net);
    sim_card_free(f->card);
    free(f);
    return 0;
}

static double get(const struct fixture *const f, const char *const name)
{
    char full[128];
    int err;
    (void)snprintf(full, sizeof full, PREFIX "%s", name);
    const double value = hm2_plain_get(f->plain, full, &err);
    if (err)
        fail_msg("no point %s", full);
    return value;
}

static void set(const struct fixture *const f, const char *const name, const double value)
{
    char full[128];
    (void)snprintf(full, sizeof full, PREFIX "%s", name);
    assert_int_equal(hm2_plain_set(f->plain, full, value), 0);
}

static void load(struct fixture *const f, const char *const config)
{
    if (hm2_board_identify(f->board, f->link, &f->diag) != 0 ||
        hm2_board_setup(f->board, 0, hm2_plain_binder(f->plain), config, &f->diag) != 0 ||
        hm2_board_start(f->board, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
    f->start_ns = link_now_ns(f->link);
}

/* A thread that begins its cycle on time, or as soon as the one before has ended. */
static void cycle(struct fixture *const f)
{
    const int64_t begin_ns = link_now_ns(f->link);
    hm2_board_read(f->board, PERIOD_NS);
    f->read_ns = link_now_ns(f->link) - begin_ns;
    sim_net_sleep_until(f->net, link_now_ns(f->link) + f->work_ns);
    hm2_board_write(f->board, PERIOD_NS);
    f->start_ns += f->period_ns;
    sim_net_sleep_until(f->net, f->start_ns);
}

static void cycles(struct fixture *const f, const unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        cycle(f);
}

static void faults(const struct fixture *const f, const struct sim_faults *const faults)
{
    assert_int_equal(sim_net_set_faults(f->net, faults), 0);
}

static void no_faults(const struct fixture *const f)
{
    faults(f, &(struct sim_faults){.seed = 1});
}

/* The network spoils the reply to the next datagram, and that alone. */
static void spoil(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    struct fixture *const f = context;
    (void)data;
    (void)len;
    if (!done || !f->spoil_reply)
        return;
    faults(f, &f->reply_faults);
    f->spoil_reply = false;
}

static void spoil_next_reply(struct fixture *const f, const struct sim_faults *const how)
{
    f->reply_faults = *how;
    f->spoil_reply = true;
    sim_net_on_taken(f->net, spoil, f);
}

static bool message(const struct fixture *const f, const char *const words)
{
    char text[1024];
    bool error;
    while (hm2_board_next_message(f->board, text, sizeof text, &error) > 0)
        if (strstr(text, words))
            return true;
    return false;
}

static void load_and_lock(struct fixture *const f)
{
    load(f, PIPELINED);
    cycles(f, 400);
    assert_true(get(f, "pipeline.active") == 1);
}

/* ---- start-up and steady state ------------------------------------------------------------------------------------
 */

static void it_starts_by_itself_and_says_so(void **state)
{
    struct fixture *const f = *state;
    load(f, PIPELINED);
    cycles(f, 200);
    assert_true(get(f, "pipeline.active") == 0);
    cycles(f, 200);
    assert_true(get(f, "pipeline.active") == 1);
    assert_true(message(f, "is pipelined now"));
    assert_true(get(f, "packet-error-total") == 0);
}

static void a_read_waits_for_nothing_and_a_cycle_is_one_datagram_each_way(void **state)
{
    struct fixture *const f = *state;
    enum { CYCLES = 3000 };
    load_and_lock(f);
    const struct link_counters before = f->link->counters;
    for (unsigned i = 0; i < CYCLES; i++) {
        cycle(f);
        assert_int_equal(f->read_ns, 0);
    }
    assert_int_equal(f->link->counters.sent - before.sent, CYCLES);
    assert_int_equal(f->link->counters.received - before.received, CYCLES);
    assert_true(get(f, "packet-error-total") == 0);
    assert_true(get(f, "pipeline.late") == 0);
    assert_in_range((unsigned)get(f, "pipeline.wait-us"), 50, 100);
    /* Sampled so long behind the write as the timer says, and used at the end of the period. */
    assert_in_range((unsigned)get(f, "pipeline.data-age-us"), 700, 850);
    assert_in_range((unsigned)get(f, "pipeline.margin-us"), 500, 850);
}

static void without_the_key_nothing_changes(void **state)
{
    struct fixture *const f = *state;
    load(f, "sserial_port_0=xxxxxxxx");
    assert_null(hm2_plain_find(f->plain, PREFIX "pipeline.active"));
    cycles(f, 600);
    assert_int_not_equal(f->read_ns, 0);
}

static void it_is_refused_without_a_dpll(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(hm2_board_identify(f->board, f->link, &f->diag), 0);
    assert_int_equal(hm2_board_setup(f->board, 0, hm2_plain_binder(f->plain), "pipelined=1 num_dplls=0", &f->diag),
                     HM2_ERR_INVALID);
    assert_non_null(strstr(f->diag.text, "num_dplls=0"));
}

static void without_room_it_stays_plain_and_says_why(void **state)
{
    struct fixture *const f = *state;
    load(f, PIPELINED);
    f->work_ns = 750000;
    cycles(f, 1000);
    assert_true(get(f, "pipeline.active") == 0);
    assert_true(message(f, "has no room"));
    f->work_ns = WORK_NS;
    cycles(f, 500);
    assert_true(get(f, "pipeline.active") == 1);
}

static void a_timer_before_its_reference_is_no_timer_to_wait_for(void **state)
{
    struct fixture *const f = *state;
    load(f, PIPELINED);
    set(f, "dpll.04.timer-us", -50);
    cycles(f, 600);
    assert_true(get(f, "pipeline.active") == 0);
    assert_true(message(f, "has no room"));
}

/* ---- feedback that is one period old ------------------------------------------------------------------------------
 */

static void run_at(struct fixture *const f, const double steps_per_s)
{
    set(f, "stepgen.00.steplen", 1000);
    set(f, "stepgen.00.stepspace", 1000);
    set(f, "stepgen.00.maxaccel", 0);
    set(f, "stepgen.00.control-type", 1);
    set(f, "stepgen.00.velocity-cmd", steps_per_s);
    set(f, "stepgen.00.enable", 1);
}

/* The encoder shows where the axis was when the card read it, the step generator where it is. */
static void a_step_generator_shows_where_it_is_and_an_encoder_where_it_was(void **state)
{
    struct fixture *const f = *state;
    load_and_lock(f);
    assert_int_equal(sim_card_follow(f->card, 0, 0, 1, 1), 0);
    run_at(f, 10000);
    cycles(f, 1000);
    const double zero = get(f, "stepgen.00.counts") - get(f, "encoder.00.count");
    for (unsigned i = 0; i < 200; i++) {
        int64_t turned;
        assert_int_equal(sim_card_turned(f->card, HM2_GTAG_ENCODER, 0, &turned), 0);
        cycle(f);
        const double position = get(f, "stepgen.00.position-fb");
        const double seen = get(f, "encoder.00.count") + zero;
        assert_true(fabs(position - seen - get(f, "pipeline.data-age-us") * 0.01) < 2.0);
        assert_true(fabs(get(f, "encoder.00.velocity") - 10000) < 50);
    }
}

static void a_step_generator_arrives_where_it_is_sent(void **state)
{
    struct fixture *const f = *state;
    load_and_lock(f);
    set(f, "stepgen.00.position-scale", 1000);
    set(f, "stepgen.00.steplen", 1000);
    set(f, "stepgen.00.stepspace", 1000);
    set(f, "stepgen.00.maxaccel", 1000);
    set(f, "stepgen.00.maxvel", 50);
    set(f, "stepgen.00.enable", 1);
    double position = 0.0;
    for (unsigned i = 0; i < 3000; i++) {
        const double command = i < 2000 ? i * 0.01 : 20.0;
        set(f, "stepgen.00.position-cmd", command);
        cycle(f);
        position = get(f, "stepgen.00.position-fb");
        /* As in a plain cycle, it is behind by what it moves in about two periods, not by three. */
        if (i > 500 && i < 2000)
            assert_true(command - position > 0.0 && command - position < 0.021);
    }
    assert_true(fabs(position - 20.0) < 0.001);
}

static void an_index_is_found_once_at_its_place(void **state)
{
    struct fixture *const f = *state;
    load_and_lock(f);
    assert_int_equal(sim_card_follow(f->card, 0, 0, 1, 1), 0);
    assert_int_equal(sim_card_index(f->card, 0, 4000), 0);
    run_at(f, 10000);
    cycles(f, 100);
    for (unsigned turn = 0; turn < 3; turn++) {
        set(f, "encoder.00.index-enable", 1);
        cycle(f);
        unsigned waited = 0;
        while (get(f, "encoder.00.index-enable") == 1 && waited++ < 500)
            cycle(f);
        assert_in_range(waited, 100, 401);
        /* Fewer counts behind the index than two periods bring. */
        assert_true(get(f, "encoder.00.count") >= 0 && get(f, "encoder.00.count") < 20);
        cycles(f, 100);
    }
}

/* ---- faults -------------------------------------------------------------------------------------------------------
 */

static void one_is_lost(struct fixture *const f)
{
    no_faults(f);
    cycles(f, 1);
    no_faults(f);
    assert_true(get(f, "packet-error-total") == 1);
    assert_true(get(f, "packet-lost") == 1);
    assert_true(get(f, "pipeline.active") == 1);
    cycles(f, 20);
    assert_true(get(f, "packet-error-total") == 1);
    assert_true(get(f, "packet-error") == 0);
    assert_true(get(f, "watchdog.has_bit") == 0);
    assert_true(get(f, "pipeline.active") == 1);
    assert_int_equal(f->read_ns, 0);
}

static void a_lost_request_costs_one_cycle(void **state)
{
    struct fixture *const f = *state;
    load_and_lock(f);
    faults(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    cycle(f);
    one_is_lost(f);
}

static void a_lost_reply_costs_one_cycle(void **state)
{
    struct fixture *const f = *state;
    load_and_lock(f);
    spoil_next_reply(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    cycle(f);
    one_is_lost(f);
}

static void a_late_reply_is_waited_for_and_costs_none(void **state)
{
    struct fixture *const f = *state;
    load_and_lock(f);
    spoil_next_reply(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 900000, .delay_max_ns = 900000});
    cycle(f);
    no_faults(f);
    cycle(f);
    assert_in_range(f->read_ns, 50000, 400000);
    assert_true(get(f, "pipeline.margin-us") < -50);
    assert_true(get(f, "pipeline.late") == 1);
    cycles(f, 3);
    assert_int_equal(f->read_ns, 0);
    assert_true(get(f, "packet-error-total") == 0);
    assert_true(get(f, "pipeline.active") == 1);
}

static void a_late_request_does_not_wait_for_the_timer_of_the_next_period(void **state)
{
    struct fixture *const f = *state;
    load_and_lock(f);
    faults(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 300000, .delay_max_ns = 300000});
    cycle(f);
    no_faults(f);
    cycle(f);
    assert_true(get(f, "pipeline.wait-us") <= 151);
    cycles(f, 5);
    assert_true(get(f, "packet-error-total") == 0);
    assert_true(get(f, "pipeline.late") == 0);
}

static void a_repeated_reply_is_used_once(void **state)
{
    struct fixture *const f = *state;
    load_and_lock(f);
    faults(f, &(struct sim_faults){.seed = 1, .duplicate = 1.0});
    cycles(f, 50);
    no_faults(f);
    cycles(f, 5);
    assert_true(get(f, "packet-error-total") == 0);
    assert_true(get(f, "packet-stale") > 40);
    assert_true(get(f, "pipeline.active") == 1);
}

static void clocks_that_differ(struct fixture *const f, const int64_t by_ns)
{
    f->period_ns = PERIOD_NS + by_ns;
    load_and_lock(f);
    for (unsigned i = 0; i < 5000; i++) {
        cycle(f);
        assert_int_equal(f->read_ns, 0);
        assert_in_range((unsigned)get(f, "pipeline.wait-us"), 40, 110);
    }
    assert_true(get(f, "packet-error-total") == 0);
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
    struct fixture *const f = *state;
    load_and_lock(f);
    faults(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 350000, .delay_max_ns = 350000});
    f->work_ns = 250000;
    cycles(f, 12);
    assert_true(get(f, "pipeline.active") == 0);
    assert_true(get(f, "pipeline.falls") == 1);
    assert_true(message(f, "plain cycles again"));
    no_faults(f);
    f->work_ns = WORK_NS;
    cycles(f, 900);
    assert_true(get(f, "pipeline.active") == 0);
    cycles(f, 1500);
    assert_true(get(f, "pipeline.active") == 1);
    assert_true(message(f, "is pipelined now"));
}

static void a_held_up_thread_makes_the_watchdog_bite_and_a_lost_turn_does_not(void **state)
{
    struct fixture *const f = *state;
    enum { STEP_IO = 17 };
    load_and_lock(f);
    set(f, "watchdog.timeout_ns", 3000000); /* above two periods and the wait for the reply */
    cycles(f, 5);
    faults(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    cycle(f);
    no_faults(f);
    cycles(f, 5);
    assert_true(get(f, "watchdog.has_bit") == 0);
    f->start_ns += 10 * PERIOD_NS;
    sim_net_sleep_until(f->net, f->start_ns);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    cycles(f, 3);
    assert_true(get(f, "watchdog.has_bit") == 1);
    set(f, "watchdog.has_bit", 0);
    cycles(f, 20);
    assert_true(get(f, "watchdog.has_bit") == 0);
    assert_int_not_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    assert_true(get(f, "pipeline.active") == 1);
}

static void a_power_cycle_is_survived(void **state)
{
    struct fixture *const f = *state;
    load_and_lock(f);
    set(f, "auto-rearm", 1);
    sim_card_power_cycle(f->card);
    cycles(f, 3000);
    assert_true(get(f, "packet-error") == 0);
    assert_true(get(f, "position-lost") == 1);
    assert_true(get(f, "pipeline.active") == 1);
}

/* ---- the long tail ------------------------------------------------------------------------------------------------
 */

/* One datagram of a thousand takes 0.9 ms longer. */
static unsigned missed(struct fixture *const f, const char *const config)
{
    load(f, config);
    cycles(f, 400);
    faults(f, &(struct sim_faults){.seed = 7, .tail = 0.001, .tail_ns = 900000});
    cycles(f, 20000);
    return (unsigned)get(f, "packet-lost");
}

static void plain_cycles_miss_deadlines_on_a_network_with_a_long_tail(void **state)
{
    assert_in_range(missed(*state, "sserial_port_0=xxxxxxxx"), 10, 100);
}

static void pipelined_cycles_miss_none(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(missed(f, PIPELINED), 0);
    assert_true(get(f, "pipeline.late") > 5);
    assert_true(get(f, "packet-error-total") == 0);
    assert_true(get(f, "pipeline.active") == 1);
    assert_true(get(f, "pipeline.falls") == 0);
}

#define TEST(function) cmocka_unit_test_setup_teardown(function, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(it_starts_by_itself_and_says_so),
        TEST(a_read_waits_for_nothing_and_a_cycle_is_one_datagram_each_way),
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
