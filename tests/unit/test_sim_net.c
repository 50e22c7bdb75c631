/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The network between client and simulated card: what it counts is what happens, and it happens again. */
#include "unit.h"

#include <hm2/bytes.h>
#include <hm2/lbp16.h>
#include <hm2/sim.h>

#define MS 1000000

struct rig {
    struct sim_card *card;
    struct sim_net *net;
    struct link *link;
};

static struct rig rig_with(const struct sim_faults *const faults)
{
    const struct sim_card_options options = {.profile = "7i96s", .seed = 1};
    struct rig rig = {0};
    assert_int_equal(sim_card_new(&rig.card, &options, NULL), 0);
    assert_int_equal(sim_net_new(&rig.net, rig.card, faults), 0);
    rig.link = sim_net_link(rig.net);
    return rig;
}

static void drop(struct rig *const rig)
{
    sim_net_free(rig->net);
    sim_card_free(rig->card);
}

/* Write a number to a scratch register and read it back, in one datagram. */
static void send_number(const struct rig *const rig, const uint16_t number)
{
    uint8_t request[64];
    struct lbp16_builder b;
    lbp16_builder_init(&b, request, sizeof request);
    lbp16_add_write16(&b, LBP16_SPACE_TIMER, LBP16_TIMER_SCRATCH, 1, &number, NULL);
    lbp16_add_read16(&b, LBP16_SPACE_TIMER, LBP16_TIMER_SCRATCH, 1, NULL);
    assert_int_equal(b.error, 0);
    assert_int_equal(link_send(rig->link, request, b.used), 0);
}

/* Number of the reply, or the error of recv(); -100 - length for a cut reply. */
static int receive_number(const struct rig *const rig, const int64_t deadline_ns)
{
    uint8_t reply[64];
    const int len = link_recv(rig->link, reply, sizeof reply, deadline_ns);
    if (len < 0)
        return len;
    return len == 2 ? hm2_get_le16(reply) : -100 - len;
}

static void a_reply_comes_after_the_time_that_the_card_takes(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    send_number(&rig, 42);
    assert_int_equal(receive_number(&rig, 0), HM2_ERR_TIMEOUT); /* nothing is there yet */
    assert_int_equal(link_now_ns(rig.link), 0);
    assert_int_equal(receive_number(&rig, MS), 42);
    assert_in_range(link_now_ns(rig.link), 12000, 20000);
    assert_int_equal(receive_number(&rig, MS), HM2_ERR_TIMEOUT);
    assert_int_equal(link_now_ns(rig.link), MS);
    drop(&rig);
}

static void what_came_while_nobody_looked_is_queued(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    send_number(&rig, 1);
    send_number(&rig, 2);
    sim_net_sleep_until(rig.net, MS);
    assert_int_equal(receive_number(&rig, 0), 1);
    assert_int_equal(receive_number(&rig, 0), 2);
    assert_int_equal(receive_number(&rig, 0), HM2_ERR_TIMEOUT);
    assert_int_equal(link_now_ns(rig.link), MS);
    drop(&rig);
}

static void a_datagram_longer_than_the_buffer_is_consumed(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    uint8_t byte;
    send_number(&rig, 1);
    assert_int_equal(link_recv(rig.link, &byte, 1, MS), HM2_ERR_NOSPACE);
    assert_int_equal(receive_number(&rig, 2 * MS), HM2_ERR_TIMEOUT);
    drop(&rig);
}

static void a_datagram_that_no_frame_holds_is_refused(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    static uint8_t big[LINK_MAX_DATAGRAM_BYTES + 1];
    assert_int_equal(link_send(rig.link, big, sizeof big), HM2_ERR_NOSPACE);
    drop(&rig);
}

struct seen {
    unsigned in_order, late, repeated, cut, missing, strange;
    uint64_t fingerprint;
};

/* A client at 1 kHz that takes whatever comes within its cycle. */
static struct seen run_cycles(const struct rig *const rig, const unsigned cycles)
{
    struct seen seen = {.fingerprint = 1469598103934665603u};
    static uint8_t times_seen[65536];
    memset(times_seen, 0, sizeof times_seen);
    assert_true(cycles < sizeof times_seen);
    for (unsigned i = 1; i <= cycles; i++) {
        const int64_t deadline_ns = (int64_t)i * MS;
        bool answered = false;
        send_number(rig, (uint16_t)i);
        for (int got; (got = receive_number(rig, deadline_ns)) != HM2_ERR_TIMEOUT;) {
            seen.fingerprint = (seen.fingerprint ^ (uint64_t)(uint32_t)got) * 1099511628211u;
            if (got < 0)
                seen.cut++;
            else if (times_seen[got]++)
                seen.repeated++;
            else if ((unsigned)got == i)
                seen.in_order++, answered = true;
            else
                seen.late++;
        }
        seen.missing += !answered;
    }
    return seen;
}

static void a_perfect_network_brings_every_reply_in_its_cycle(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    const struct seen seen = run_cycles(&rig, 5000);
    assert_int_equal(seen.in_order, 5000);
    assert_int_equal(seen.late + seen.repeated + seen.cut + seen.missing, 0);
    const struct sim_net_truth truth = sim_net_truth(rig.net);
    assert_int_equal(truth.sent[0], 5000);
    assert_int_equal(truth.sent[1], 5000);
    assert_int_equal(truth.delivered[0], 5000);
    assert_int_equal(truth.delivered[1], 5000);
    assert_int_equal(truth.reordered[0] + truth.reordered[1], 0);
    drop(&rig);
}

static void every_datagram_is_accounted_for(void **state)
{
    (void)state;
    const struct sim_faults faults = {.seed = 3,
                                      .loss = 0.05,
                                      .duplicate = 0.02,
                                      .reorder = 0.02,
                                      .truncate = 0.01,
                                      .foreign = 0.03,
                                      .delay_max_ns = 300000};
    struct rig rig = rig_with(&faults);
    const struct seen seen = run_cycles(&rig, 20000);
    sim_net_sleep_until(rig.net, INT64_C(30000) * MS);
    unsigned rest = 0;
    while (receive_number(&rig, 0) != HM2_ERR_TIMEOUT)
        rest++;
    const struct sim_net_truth t = sim_net_truth(rig.net);
    assert_int_equal(t.sent[0], 20000);
    assert_int_equal(t.overflow[0] + t.overflow[1], 0);
    for (unsigned d = 0; d < 2; d++)
        assert_int_equal(t.delivered[d], t.sent[d] - t.lost[d] + t.duplicated[d]);
    assert_int_equal(t.delivered[1], seen.in_order + seen.late + seen.repeated + seen.cut + rest);
    assert_int_equal(t.delivered[1], rig.link->counters.received);
    assert_int_equal(t.foreign[1], rig.link->counters.strangers);
    /* The rates are those asked for, within four standard deviations or so. */
    assert_in_range(t.lost[0], 850, 1150);
    assert_in_range(t.duplicated[0], 300, 500);
    assert_in_range(t.truncated[0], 140, 260);
    assert_in_range(t.foreign[0], 480, 720);
    assert_in_range(t.reordered[0], 250, 500);
    assert_true(seen.late > 0 && seen.repeated > 0 && seen.cut > 0 && seen.missing > 0);
    drop(&rig);
}

static void the_card_counts_what_reached_it(void **state)
{
    (void)state;
    const struct sim_faults faults = {.seed = 9, .loss = 0.1, .duplicate = 0.1, .foreign = 0.1};
    struct rig rig = rig_with(&faults);
    (void)run_cycles(&rig, 2000);
    const struct sim_faults none = {0};
    assert_int_equal(sim_net_set_faults(rig.net, &none), 0);
    uint8_t request[16], reply[16];
    struct lbp16_builder b;
    lbp16_builder_init(&b, request, sizeof request);
    lbp16_add_read16(&b, LBP16_SPACE_CONTROL, LBP16_CONTROL_RX_UDP, 1, NULL);
    assert_int_equal(link_send(rig.link, request, b.used), 0);
    assert_int_equal(link_recv(rig.link, reply, sizeof reply, link_now_ns(rig.link) + MS), 2);
    const struct sim_net_truth t = sim_net_truth(rig.net);
    assert_int_equal(hm2_get_le16(reply), t.delivered[0] + t.foreign[0] - 1); /* without the one that asks */
    drop(&rig);
}

static void the_same_seed_gives_the_same_faults(void **state)
{
    (void)state;
    struct seen seen[3];
    struct sim_net_truth truth[3];
    for (unsigned i = 0; i < 3; i++) {
        const struct sim_faults faults = {.seed = i < 2 ? 77 : 78,
                                          .loss = 0.1,
                                          .duplicate = 0.1,
                                          .reorder = 0.1,
                                          .truncate = 0.1,
                                          .foreign = 0.1,
                                          .delay_max_ns = 900000};
        struct rig rig = rig_with(&faults);
        seen[i] = run_cycles(&rig, 3000);
        truth[i] = sim_net_truth(rig.net);
        drop(&rig);
    }
    assert_memory_equal(&truth[0], &truth[1], sizeof truth[0]);
    assert_true(seen[0].fingerprint == seen[1].fingerprint);
    assert_memory_not_equal(&truth[0], &truth[2], sizeof truth[0]);
}

static void a_frozen_card_says_nothing_and_goes_on_after(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    sim_net_freeze(rig.net, true);
    assert_int_equal(run_cycles(&rig, 10).missing, 10);
    sim_net_freeze(rig.net, false);
    assert_int_equal(sim_net_truth(rig.net).unheard, 10);
    send_number(&rig, 7);
    assert_int_equal(receive_number(&rig, 20 * MS), 7);
    drop(&rig);
}

/* Writes a wait of so many microseconds, and reads a word. */
static int64_t time_of_wait(const struct rig *const rig, const uint8_t us)
{
    struct link *const link = sim_net_link(rig->net);
    const uint8_t request[] = {0x01, 0xD1, 0x02, 0x00, us, 0x00, 0x01, 0x51, 0x10, 0x00};
    uint8_t reply[16];
    const int64_t begin_ns = link_now_ns(link);
    assert_int_equal(link_send(link, request, sizeof request), 0);
    assert_int_equal(link_recv(link, reply, sizeof reply, begin_ns + MS), 2);
    return link_now_ns(link) - begin_ns;
}

static void an_instant_network_still_waits_as_long_as_it_is_asked_to(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    sim_net_set_instant(rig.net, true);
    assert_int_equal(time_of_wait(&rig, 0), 0);
    assert_in_range(time_of_wait(&rig, 100), 99000, 100000);
    assert_in_range(time_of_wait(&rig, 250), 249000, 250000);
    assert_int_equal(time_of_wait(&rig, 0), 0);
    drop(&rig);
}

static void a_power_cycle_costs_a_second(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    send_number(&rig, 7);
    assert_int_equal(receive_number(&rig, MS), 7);
    sim_card_power_cycle(rig.card);
    send_number(&rig, 8);
    assert_int_equal(receive_number(&rig, INT64_C(500) * MS), HM2_ERR_TIMEOUT);
    sim_net_sleep_until(rig.net, INT64_C(1100) * MS);
    send_number(&rig, 9);
    assert_int_equal(receive_number(&rig, INT64_C(1200) * MS), 9);
    drop(&rig);
}

static void a_card_that_was_idle_starts_as_slowly(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    sim_net_sleep_until(rig.net, INT64_C(10000) * MS);
    sim_card_power_cycle(rig.card);
    send_number(&rig, 8);
    assert_int_equal(receive_number(&rig, INT64_C(10900) * MS), HM2_ERR_TIMEOUT);
    sim_net_sleep_until(rig.net, INT64_C(11100) * MS);
    send_number(&rig, 9);
    assert_int_equal(receive_number(&rig, INT64_C(11200) * MS), 9);
    drop(&rig);
}

/* ---- patterns of delays -------------------------------------------------------------------------------------------
 */

/* Time from the request to the reply, on a line that was at rest for pause_ns. */
static int64_t round_trip_ns(const struct rig *const rig, const int64_t pause_ns, const uint16_t number)
{
    sim_net_sleep_until(rig->net, link_now_ns(rig->link) + pause_ns);
    const int64_t start_ns = link_now_ns(rig->link);
    send_number(rig, number);
    assert_int_equal(receive_number(rig, start_ns + 100 * MS), number);
    return link_now_ns(rig->link) - start_ns;
}

static void a_long_tail_is_as_rare_and_as_late_as_given(void **state)
{
    (void)state;
    struct rig rig = rig_with(&(struct sim_faults){.seed = 5, .tail = 0.01, .tail_ns = 900000});
    unsigned late = 0;
    for (uint16_t i = 1; i <= 10000; i++) {
        const int64_t ns = round_trip_ns(&rig, MS, i);
        assert_in_range(ns % 900000, 12000, 20000);
        late += ns > 900000;
    }
    assert_in_range(late, 150, 250); /* of two datagrams one in a hundred */
    drop(&rig);
}

static void a_port_that_coalesces_tells_of_several_replies_at_once(void **state)
{
    (void)state;
    struct rig rig = rig_with(&(struct sim_faults){.coalesce_ns = 200000});
    for (unsigned i = 0; i < 3; i++) {
        sim_net_sleep_until(rig.net, (int64_t)i * 80000);
        send_number(&rig, (uint16_t)i);
    }
    assert_int_equal(receive_number(&rig, MS), 0);
    const int64_t told_ns = link_now_ns(rig.link);
    assert_in_range(told_ns, 212000, 220000);
    for (int i = 1; i < 3; i++)
        assert_int_equal(receive_number(&rig, told_ns), i);
    send_number(&rig, 3); /* starts the timer anew */
    assert_int_equal(receive_number(&rig, MS), 3);
    assert_in_range(link_now_ns(rig.link) - told_ns, 212000, 220000);
    drop(&rig);
}

static void a_line_that_slept_is_late_once(void **state)
{
    (void)state;
    struct rig rig = rig_with(&(struct sim_faults){.sleep_ns = 100000, .wake_ns = 30000});
    for (uint16_t i = 0; i < 100; i++) {
        const int64_t rested_ns = round_trip_ns(&rig, MS, i), awake_ns = round_trip_ns(&rig, 50000, i);
        assert_in_range(awake_ns, 12000, 20000);
        assert_int_equal(rested_ns, awake_ns + 30000);
    }
    drop(&rig);
}

static void a_busy_neighbour_has_the_line_once_in_each_turn(void **state)
{
    (void)state;
    const struct sim_faults faults = {.seed = 9, .busy_every_ns = 10 * MS, .busy_ns = 500000};
    struct rig rig = rig_with(&faults), again = rig_with(&faults);
    unsigned waits = 0;
    int64_t longest_ns = 0;
    for (uint16_t i = 1; i <= 10000; i++) {
        const int64_t ns = round_trip_ns(&rig, 83000, i);
        assert_int_equal(round_trip_ns(&again, 83000, i), ns);
        assert_in_range(ns, 12000, 520000);
        waits += ns > 20000;
        longest_ns = ns > longest_ns ? ns : longest_ns;
    }
    /* 10000 trips in about 1.03 s, which are 103 turns */
    assert_in_range(waits, 95, 110);
    assert_true(longest_ns > 400000);
    drop(&rig);
    drop(&again);
}

static void faults_out_of_range_are_refused(void **state)
{
    (void)state;
    struct rig rig = rig_with(NULL);
    const struct sim_faults bad[] = {
        {.loss = 1.01},       {.duplicate = -0.1},
        {.reorder = 2},       {.tail = 2},
        {.tail_ns = -1},      {.truncate = -1},
        {.foreign = 1e300},   {.delay_min_ns = 5, .delay_max_ns = 4},
        {.delay_min_ns = -1}, {.delay_max_ns = INT64_MAX},
        {.coalesce_ns = -1},  {.sleep_ns = 2000000000},
        {.wake_ns = -1},      {.busy_every_ns = 5, .busy_ns = 6},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(sim_net_set_faults(rig.net, &bad[i]), HM2_ERR_RANGE);
    drop(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_reply_comes_after_the_time_that_the_card_takes),
        cmocka_unit_test(what_came_while_nobody_looked_is_queued),
        cmocka_unit_test(a_datagram_longer_than_the_buffer_is_consumed),
        cmocka_unit_test(a_datagram_that_no_frame_holds_is_refused),
        cmocka_unit_test(a_perfect_network_brings_every_reply_in_its_cycle),
        cmocka_unit_test(every_datagram_is_accounted_for),
        cmocka_unit_test(the_card_counts_what_reached_it),
        cmocka_unit_test(the_same_seed_gives_the_same_faults),
        cmocka_unit_test(a_frozen_card_says_nothing_and_goes_on_after),
        cmocka_unit_test(an_instant_network_still_waits_as_long_as_it_is_asked_to),
        cmocka_unit_test(a_power_cycle_costs_a_second),
        cmocka_unit_test(a_card_that_was_idle_starts_as_slowly),
        cmocka_unit_test(a_long_tail_is_as_rare_and_as_late_as_given),
        cmocka_unit_test(a_port_that_coalesces_tells_of_several_replies_at_once),
        cmocka_unit_test(a_line_that_slept_is_late_once),
        cmocka_unit_test(a_busy_neighbour_has_the_line_once_in_each_turn),
        cmocka_unit_test(faults_out_of_range_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
