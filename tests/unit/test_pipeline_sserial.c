/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Smart serial in pipelined cycles: a 7I77 at a simulated 7I96S, in virtual time (docs/pipelined-cycle.md). */
#include "servo_rig.h"

#include <hm2/sslbp.h>

#include "remote_state.h"
#include "sserial.h"

#define FIELD_IO  0u
#define ANALOG    1u
#define INPUTS    32u
#define OUTPUTS   16u
#define PIPELINED "pipelined=4 sserial_port_0=00xxxxxx"

static int set_up(void **state)
{
    const int err = servo_set_up_card(state, &(struct sim_card_options){.profile = "7i96s_7i77d", .seed = 1});
    struct servo_rig *const f = *state;
    assert_int_equal(sim_sserial_plug(f->card, 0, FIELD_IO, "7i77", 0x123456, &f->diag), 0);
    return err;
}

static struct remote *remote(const struct servo_rig *const f, const unsigned channel)
{
    struct remote *const found = sim_sserial_remote(f->card, 0, channel);
    assert_non_null(found);
    return found;
}

static void load(struct servo_rig *const f)
{
    servo_load(f, PIPELINED);
    assert_string_equal(f->diag.text, "");
    servo_cycles(f, 450);
    assert_true(servo_get(f, "pipeline.active") == 1);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_RUNNING);
}

/* ---- numbers that go round ----------------------------------------------------------------------------------------
 */

/* Inputs and outputs of the field part carry the number of the cycle that set them. */
struct numbers {
    struct servo_rig *rig;
    hm2_bit_t *in[INPUTS], *out[OUTPUTS], *fault;
    struct remote *field;
    uint32_t number, shown;
};

static hm2_bit_t *bit_of(const struct servo_rig *const f, const char *const name)
{
    char full[64];
    (void)snprintf(full, sizeof full, PREFIX "7i77.0.0.%s", name);
    const struct hm2_plain_object *const object = hm2_plain_find(f->plain, full);
    if (!object)
        fail_msg("no point %s", full);
    return object->value;
}

static struct numbers numbers_of(struct servo_rig *const f)
{
    struct numbers n = {.rig = f, .fault = bit_of(f, "link-fault"), .field = remote(f, FIELD_IO)};
    char name[16];
    for (unsigned i = 0; i < INPUTS; i++) {
        (void)snprintf(name, sizeof name, "input-%02u", i);
        n.in[i] = bit_of(f, name);
    }
    for (unsigned i = 0; i < OUTPUTS; i++) {
        (void)snprintf(name, sizeof name, "output-%02u", i);
        n.out[i] = bit_of(f, name);
    }
    return n;
}

static uint32_t driven(const struct numbers *const n)
{
    double value;
    assert_int_equal(remote_get(n->field, "Output", &value), 0);
    return (uint32_t)value;
}

/* One cycle: the remote's inputs and the pins of its outputs become the number of the cycle, what is shown is read. */
static void go_on(struct numbers *const n)
{
    struct servo_rig *const f = n->rig;
    const int64_t begin_ns = link_now_ns(f->link);
    n->number++;
    hm2_board_read(f->board, PERIOD_NS);
    f->read_ns = link_now_ns(f->link) - begin_ns;
    n->shown = 0;
    for (unsigned i = 0; i < INPUTS; i++)
        n->shown |= (uint32_t)*n->in[i] << i;
    for (unsigned i = 0; i < OUTPUTS; i++)
        *n->out[i] = n->number >> i & 1u;
    assert_int_equal(remote_set(n->field, "Input", n->number), 0);
    sim_net_sleep_until(f->net, link_now_ns(f->link) + f->work_ns);
    hm2_board_write(f->board, PERIOD_NS);
    f->start_ns += PERIOD_NS;
    sim_net_sleep_until(f->net, f->start_ns);
    /* A transfer that nobody has looked at yet ends before the inputs change. */
    sim_card_advance(f->card, sim_card_clock_at(f->card, f->start_ns));
    n->field = remote(f, FIELD_IO);
}

/* Every cycle has its round: the inputs are those of the transfer that the last write began, the outputs are out. */
static void rounds(struct numbers *const n, const unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        go_on(n);
        if (n->shown != n->number - 1u || *n->fault || driven(n) != (n->number & 0xFFFFu))
            fail_msg("cycle %u: %u shown, link-fault %d, %u driven", n->number, n->shown, *n->fault, driven(n));
    }
}

static void no_failures(const struct servo_rig *const f)
{
    assert_true(servo_get(f, "sserial.port-0.fault-count") == 0);
    assert_true(servo_get(f, "sserial.port-0.restarts") == 0);
    assert_true(servo_get(f, "7i77.0.0.link-errors") == 0 && servo_get(f, "7i77.0.1.link-errors") == 0);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_RUNNING);
}

/* ---- steady state -------------------------------------------------------------------------------------------------
 */

static void every_turn_has_its_round_and_a_read_waits_for_nothing(void **state)
{
    struct servo_rig *const f = *state;
    load(f);
    struct numbers n = numbers_of(f);
    go_on(&n);
    const double skipped = servo_get(f, "sserial.port-0.doits-skipped");
    const struct link_counters before = f->link->counters;
    rounds(&n, 2000);
    assert_int_equal(f->read_ns, 0);
    assert_int_equal(f->link->counters.sent - before.sent, 2000);
    assert_int_equal(f->link->counters.received - before.received, 2000);
    assert_true(servo_get(f, "sserial.port-0.doits-skipped") == skipped);
    assert_true(servo_get(f, "pipeline.early") == 0);
    assert_true(servo_get(f, "packet-error-total") == 0);
    assert_true(servo_get(f, "sserial.port-0.doit-us") < 300);
    no_failures(f);
}

/* What the plain cycle shows of the same inputs, cycle by cycle. */
static void a_turn_shows_what_a_plain_cycle_shows(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, "sserial_port_0=00xxxxxx");
    servo_cycles(f, 450);
    struct numbers n = numbers_of(f);
    go_on(&n);
    rounds(&n, 500);
    no_failures(f);
}

static void the_timer_is_set_to_what_transfers_need(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, PIPELINED);
    assert_in_range((unsigned)servo_get(f, "dpll.04.timer-us"), 180, 260);
    assert_in_range((unsigned)servo_get(f, "dpll.03.timer-us"), 100, 100);
    servo_set(f, "dpll.04.timer-us", 100);
    servo_cycles(f, 1000);
    assert_true(servo_get(f, "pipeline.active") == 0);
    assert_true(servo_message(f, "set dpll.04.timer-us to more"));
    servo_set(f, "dpll.04.timer-us", 230);
    servo_cycles(f, 300);
    assert_true(servo_get(f, "pipeline.active") == 1);
    no_failures(f);
}

/* ---- losses -------------------------------------------------------------------------------------------------------
 */

/* Rounds go on, and nothing was counted as a failure of smart serial. */
static void and_all_is_well(struct numbers *const n, const double lost)
{
    struct servo_rig *const f = n->rig;
    rounds(n, 30);
    assert_int_equal(f->read_ns, 0);
    no_failures(f);
    assert_true(servo_get(f, "pipeline.active") == 1);
    assert_true(servo_get(f, "packet-lost") == lost);
    assert_true(servo_get(f, "packet-error-total") == lost);
}

static struct numbers running(struct servo_rig *const f)
{
    load(f);
    struct numbers n = numbers_of(f);
    go_on(&n);
    rounds(&n, 10);
    return n;
}

static void a_lost_request_is_a_round_that_never_was(void **state)
{
    struct servo_rig *const f = *state;
    struct numbers n = running(f);
    servo_faults(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    go_on(&n);
    servo_no_faults(f);
    const uint32_t last = n.shown;
    go_on(&n); /* no reply */
    assert_int_equal(n.shown, last);
    assert_false(*n.fault);
    go_on(&n); /* a reply from behind it, which brings nothing new, and says so */
    assert_int_equal(n.shown, last);
    assert_true(*n.fault);
    and_all_is_well(&n, 1);
}

static void the_round_of_a_lost_reply_is_shown_one_cycle_later(void **state)
{
    struct servo_rig *const f = *state;
    struct numbers n = running(f);
    servo_spoil_next_reply(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    go_on(&n);
    const uint32_t round = n.number, last = n.shown;
    servo_no_faults(f);
    assert_int_equal(driven(&n), round);
    go_on(&n);
    assert_int_equal(n.shown, last);
    go_on(&n);
    assert_int_equal(n.shown, round);
    assert_false(*n.fault);
    and_all_is_well(&n, 1);
}

static void after_two_lost_replies_nobody_knows_and_nothing_is_shown(void **state)
{
    struct servo_rig *const f = *state;
    struct numbers n = running(f);
    servo_spoil_next_reply(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    go_on(&n);
    const uint32_t last = n.shown;
    servo_no_faults(f);
    servo_spoil_next_reply(f, &(struct sim_faults){.seed = 1, .loss = 1.0});
    go_on(&n);
    servo_no_faults(f);
    go_on(&n);
    go_on(&n);
    assert_int_equal(n.shown, last);
    assert_true(*n.fault);
    and_all_is_well(&n, 2);
}

static void a_late_reply_costs_no_round(void **state)
{
    struct servo_rig *const f = *state;
    struct numbers n = running(f);
    servo_spoil_next_reply(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 900000, .delay_max_ns = 900000});
    rounds(&n, 1);
    servo_no_faults(f);
    rounds(&n, 1);
    assert_true(f->read_ns > 0);
    and_all_is_well(&n, 0);
}

static void the_reply_that_comes_after_it_was_given_up_changes_nothing(void **state)
{
    struct servo_rig *const f = *state;
    struct numbers n = running(f);
    servo_spoil_next_reply(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 1750000, .delay_max_ns = 1750000});
    go_on(&n);
    const uint32_t round = n.number;
    servo_no_faults(f);
    go_on(&n);
    assert_int_equal(n.shown, round - 1u);
    go_on(&n);
    assert_int_equal(n.shown, round);
    assert_true(servo_get(f, "packet-late") == 1);
    and_all_is_well(&n, 1);
}

static void repeated_requests_and_replies_cost_no_round(void **state)
{
    struct servo_rig *const f = *state;
    struct numbers n = running(f);
    servo_faults(f, &(struct sim_faults){.seed = 1, .duplicate = 1.0});
    rounds(&n, 50);
    assert_true(servo_get(f, "packet-stale") > 40);
    servo_no_faults(f);
    and_all_is_well(&n, 0);
}

/* The edge comes when the turn has only just begun its transfers. */
static void a_transfer_that_is_not_over_is_awaited_and_is_no_failure(void **state)
{
    struct servo_rig *const f = *state;
    struct numbers n = running(f);
    servo_faults(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 140000, .delay_max_ns = 140000});
    go_on(&n);
    const uint32_t round = n.number, last = n.shown;
    servo_no_faults(f);
    go_on(&n);
    assert_in_range((unsigned)servo_get(f, "pipeline.wait-us"), 1, 110);
    assert_true(servo_get(f, "pipeline.early") == 1);
    assert_int_equal(n.shown, last);
    assert_false(*n.fault);
    go_on(&n);
    assert_int_equal(n.shown, round);
    assert_false(*n.fault);
    and_all_is_well(&n, 0);
}

/* ---- to plain cycles and back -------------------------------------------------------------------------------------
 */

static void without_margin_plain_cycles_go_on_where_turns_have_ended(void **state)
{
    struct servo_rig *const f = *state;
    struct numbers n = running(f);
    servo_faults(f, &(struct sim_faults){.seed = 1, .delay_min_ns = 300000, .delay_max_ns = 300000});
    f->work_ns = 250000;
    for (unsigned i = 0; i < 100 && servo_get(f, "pipeline.active") == 1; i++)
        go_on(&n);
    assert_true(servo_get(f, "pipeline.falls") == 1);
    assert_true(servo_message(f, "plain cycles again"));
    servo_no_faults(f);
    f->work_ns = WORK_NS;
    for (unsigned i = 0; i < 3; i++)
        go_on(&n);
    rounds(&n, 900);
    assert_true(servo_get(f, "pipeline.active") == 0);
    rounds(&n, 2000);
    assert_true(servo_get(f, "pipeline.active") == 1);
    no_failures(f);
}

static struct servo_rig *anew(void **const state)
{
    assert_int_equal(servo_tear_down(state), 0);
    assert_int_equal(set_up(state), 0);
    return *state;
}

/* A cycle whose datagram to the card, or from it, is lost; and so are those after it until something else is said. */
static void lose_one(struct numbers *const n, const bool reply)
{
    const struct sim_faults loss = {.seed = 1, .loss = 1.0};
    if (reply)
        servo_spoil_next_reply(n->rig, &loss);
    else
        servo_faults(n->rig, &loss);
    go_on(n);
}

static const struct sim_faults all_late = {.seed = 1, .delay_min_ns = 300000, .delay_max_ns = 300000};

static void delay_all(struct servo_rig *const f)
{
    servo_faults(f, &all_late);
    f->work_ns = 250000;
}

static unsigned cycles_to_the_last_turn(struct numbers *const n)
{
    unsigned cycles = 0;
    delay_all(n->rig);
    for (; cycles < 100 && servo_get(n->rig, "pipeline.active") == 1; cycles++)
        go_on(n);
    return cycles;
}

/* Before, at and behind the cycle in which turns end, the datagram to the card or from it. */
static void where_turns_end_losses_cost_no_more_than_elsewhere(void **state)
{
    struct numbers n = running(*state);
    const unsigned last = cycles_to_the_last_turn(&n);
    assert_in_range(last, 20, 50);
    for (unsigned i = 0; i < 8; i++) {
        struct servo_rig *const f = anew(state);
        n = running(f);
        delay_all(f);
        for (unsigned before = 0; before < last - 2u + i / 2u; before++)
            go_on(&n);
        lose_one(&n, i % 2 != 0);
        (void)cycles_to_the_last_turn(&n);
        assert_true(servo_get(f, "pipeline.active") == 0);
        servo_no_faults(f);
        f->work_ns = WORK_NS;
        for (unsigned more = 0; more < 3; more++)
            go_on(&n);
        rounds(&n, 1200);
        assert_true(servo_get(f, "pipeline.active") == 1);
        no_failures(f);
    }
}

static unsigned cycles_to_the_first_turn(struct servo_rig *const f)
{
    unsigned cycles = 0;
    servo_load(f, PIPELINED);
    while (servo_get(f, "pipeline.active") == 0 && cycles++ < 1000)
        servo_cycle(f);
    return cycles;
}

/* The last plain cycles, the first turn and those behind it, the datagram to the card or from it. */
static void where_turns_begin_too(void **state)
{
    const unsigned first = cycles_to_the_first_turn(*state);
    for (unsigned i = 0; i < 8; i++) {
        struct servo_rig *const f = anew(state);
        servo_load(f, PIPELINED);
        servo_cycles(f, first - 2u + i / 2u);
        struct numbers n = numbers_of(f);
        lose_one(&n, i % 2 != 0);
        servo_no_faults(f);
        for (unsigned more = 0; more < 3; more++)
            go_on(&n);
        rounds(&n, 300);
        assert_true(servo_get(f, "pipeline.active") == 1);
        no_failures(f);
    }
}

/* ---- whatever else ports do ---------------------------------------------------------------------------------------
 */

static void a_pulled_cable_stops_its_remote_alone_and_it_comes_back(void **state)
{
    struct servo_rig *const f = *state;
    load(f);
    servo_set(f, "sserial.port-0.auto-restart", 1);
    assert_int_equal(sim_sserial_cable(f->card, 0, ANALOG, SIM_CABLE_OUT), 0);
    servo_cycles(f, 4);
    assert_true(servo_get(f, "7i77.0.1.link-fault") == 1);
    assert_true(servo_get(f, "7i77.0.0.link-fault") == 0);
    servo_cycles(f, 100);
    assert_true(servo_message(f, "channel 1"));
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_RUNNING);
    assert_int_equal(sim_sserial_cable(f->card, 0, ANALOG, SIM_CABLE_IN), 0);
    servo_cycles(f, 3000);
    assert_true(servo_get(f, "7i77.0.1.link-fault") == 0);
    assert_true(servo_get(f, "pipeline.active") == 1);
    assert_true(servo_get(f, "packet-error-total") == 0);
}

static void run_stops_and_starts_the_port_and_parameters_are_written(void **state)
{
    struct servo_rig *const f = *state;
    load(f);
    servo_set(f, "sserial.port-0.run", 0);
    servo_cycles(f, 5);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_IDLE);
    servo_set(f, "7i77.0.0.nvwatchdogtimeout", 70);
    servo_set(f, "sserial.port-0.run", 1);
    servo_cycles(f, 60);
    no_failures(f);
    assert_true(servo_get(f, "pipeline.active") == 1);
    struct remote *const r = remote(f, FIELD_IO);
    unsigned found = 0;
    remote_set_nv_access(r, 1);
    for (unsigned at = REMOTE_AT_NV; at < REMOTE_AT_NV + REMOTE_NV_BYTES; at++)
        found += remote_read(r, (uint16_t)at) == 70;
    remote_set_nv_access(r, 0);
    assert_int_equal(found, 1);
}

static void a_restarted_card_starts_its_remotes_again(void **state)
{
    struct servo_rig *const f = *state;
    load(f);
    servo_set(f, "auto-rearm", 1);
    sim_card_power_cycle(f->card);
    servo_cycles(f, 3000);
    no_failures(f);
    assert_true(servo_get(f, "pipeline.active") == 1);
    struct numbers n = numbers_of(f);
    go_on(&n);
    rounds(&n, 20);
}

/* ---- a long run ---------------------------------------------------------------------------------------------------
 */

/* Whatever the network does: what is shown was there, is never older than what was shown before, and is of this round
 * unless pins or counters say otherwise. */
static void whatever_the_network_does_nothing_old_is_shown_as_new(void **state)
{
    struct servo_rig *const f = *state;
    load(f);
    struct numbers n = numbers_of(f);
    const hm2_u32_t *const age = hm2_plain_find(f->plain, PREFIX "data-age")->value;
    servo_set(f, "packet-error-limit", 1000000);
    servo_set(f, "watchdog.timeout_ns", 50000000);
    go_on(&n);
    rounds(&n, 10);
    servo_faults(f, &(struct sim_faults){.seed = 3,
                                         .loss = 0.003,
                                         .duplicate = 0.01,
                                         .reorder = 0.001,
                                         .tail = 0.003,
                                         .tail_ns = 900000,
                                         .delay_max_ns = 20000});
    unsigned fresh = 0, turns = 0;
    uint32_t shown = n.shown;
    for (unsigned i = 0; i < 15000; i++) {
        go_on(&n);
        turns += servo_get(f, "pipeline.active") == 1;
        const bool told = *n.fault || *age > 0;
        if (told ? n.shown != shown : n.shown + 3u < n.number || n.shown >= n.number || n.shown < shown)
            fail_msg("cycle %u: %u shown after %u, link-fault %d, age %u", n.number, n.shown, shown, *n.fault, *age);
        fresh += n.shown == n.number - 1u;
        shown = n.shown;
    }
    assert_true(fresh > 14000 && turns > 4000);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_RUNNING);
    assert_true(servo_get(f, "sserial.port-0.restarts") == 0);
    assert_true(servo_get(f, "packet-lost") > 50 && servo_get(f, "packet-late") > 0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, servo_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(every_turn_has_its_round_and_a_read_waits_for_nothing),
        TEST(a_turn_shows_what_a_plain_cycle_shows),
        TEST(the_timer_is_set_to_what_transfers_need),
        TEST(a_lost_request_is_a_round_that_never_was),
        TEST(the_round_of_a_lost_reply_is_shown_one_cycle_later),
        TEST(after_two_lost_replies_nobody_knows_and_nothing_is_shown),
        TEST(a_late_reply_costs_no_round),
        TEST(the_reply_that_comes_after_it_was_given_up_changes_nothing),
        TEST(repeated_requests_and_replies_cost_no_round),
        TEST(a_transfer_that_is_not_over_is_awaited_and_is_no_failure),
        TEST(without_margin_plain_cycles_go_on_where_turns_have_ended),
        TEST(where_turns_end_losses_cost_no_more_than_elsewhere),
        TEST(where_turns_begin_too),
        TEST(a_pulled_cable_stops_its_remote_alone_and_it_comes_back),
        TEST(run_stops_and_starts_the_port_and_parameters_are_written),
        TEST(a_restarted_card_starts_its_remotes_again),
        TEST(whatever_the_network_does_nothing_old_is_shown_as_new),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
