/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What hm2doctor measures and says of networks with known delays, in virtual time. */
#include "unit.h"

#include <hm2/sim.h>

#include "../../tools/hm2doctor/doctor.h"

#define PERIOD_US   1000
#define REPLY_BYTES 200
#define SECONDS     5

static void sleep_until(void *const context, const int64_t ns)
{
    sim_net_sleep_until(context, ns);
}

static void measure(const struct sim_faults *const faults, struct rounds *const rounds)
{
    const struct sim_card_options options = {.profile = "7i96s", .seed = 1};
    const struct measuring what = {.period_us = PERIOD_US, .seconds = SECONDS, .reply_bytes = REPLY_BYTES};
    struct sim_card *card;
    struct sim_net *net;
    assert_int_equal(sim_card_new(&card, &options, NULL), 0);
    assert_int_equal(sim_net_new(&net, card, faults), 0);
    assert_int_equal(rounds_measure_by(sim_net_link(net), &(struct waiting){sleep_until, net}, &what, rounds, NULL), 0);
    sim_net_free(net);
    sim_card_free(card);
}

static unsigned patterns_in(const struct findings *const findings, const char *const words)
{
    unsigned count = 0;
    for (unsigned i = 0; i < findings->count; i++)
        count += strcmp(findings->list[i].check, "pattern") == 0 && (!words || strstr(findings->list[i].what, words));
    return count;
}

static void each_network_is_named_and_no_other(void **state)
{
    (void)state;
    static const struct sim_faults networks[] = {
        {.seed = 1},
        {.seed = 1, .delay_max_ns = 20000}, /* scatter of a common computer */
        {.seed = 1, .coalesce_ns = 100000},
        {.seed = 1, .coalesce_ns = 250000},
        {.seed = 1, .delay_max_ns = 5000, .sleep_ns = 200000, .wake_ns = 30000},
        {.seed = 1, .sleep_ns = 200000, .wake_ns = 500000},
        {.seed = 1, .delay_max_ns = 5000, .busy_every_ns = 10000000, .busy_ns = 600000},
        {.seed = 1, .tail = 0.001, .tail_ns = 900000},
        {.seed = 1, .delay_max_ns = 5000, .busy_every_ns = 1000000000, .busy_ns = 900000}, /* too rare to count */
    };
    static const char *const named[] = {
        NULL, NULL, "coalescing", "coalescing", "sleeps", "sleeps", "other packets", "other packets", NULL};
    for (size_t i = 0; i < sizeof networks / sizeof networks[0]; i++) {
        struct rounds rounds = {0};
        struct findings findings = {.count = 0};
        struct patient patient = {.period_us = PERIOD_US, .findings = &findings};
        measure(&networks[i], &rounds);
        assert_int_equal(rounds.lost, 0);
        assert_int_equal(rounds.paced, SECONDS * 1000000 / PERIOD_US);
        rounds_sort(&rounds);
        check_rounds(&patient, &rounds);
        rounds_free(&rounds);
        if (patterns_in(&findings, NULL) != (named[i] != NULL) || (named[i] && patterns_in(&findings, named[i]) != 1))
            fail_msg("network %zu, %s: %u patterns, the last finding is \"%s\"", i, named[i] ? named[i] : "none",
                     patterns_in(&findings, NULL), findings.list[findings.count - 1].what);
    }
}

static void lost_replies_are_counted_and_judged(void **state)
{
    (void)state;
    struct rounds rounds = {0};
    struct findings findings = {.count = 0};
    struct patient patient = {.period_us = PERIOD_US, .findings = &findings};
    measure(&(struct sim_faults){.seed = 3, .loss = 0.01}, &rounds);
    assert_in_range(rounds.lost, 60, 140);
    rounds_sort(&rounds);
    check_rounds(&patient, &rounds);
    rounds_free(&rounds);
    assert_string_equal(findings.list[0].check, "losses");
    assert_int_equal(findings.list[0].grade, GRADE_FAULT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_network_is_named_and_no_other),
        cmocka_unit_test(lost_replies_are_counted_and_judged),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
