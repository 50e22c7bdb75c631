/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The programmer while the power goes in the midst of page programs and erases, and while the network loses, repeats,
 * delays and cuts datagrams, with images that differ in two sectors. By default the power is cut in each erase, in the
 * first and last operations, and in a part of the page programs between. FLASH_TORTURE=N makes N times as many runs;
 * from 51 on the power is cut in every page program.
 */
#include <inttypes.h>
#include <limits.h>

#include "flash_torture.h"
#include "unit.h"

#define LATE_BYTES 60000u /* so many bytes at the end of an image differ, and its beginning with them */
#define CUTS       12u    /* of each scenario, at least */
#define END_CUTS   4u     /* that many of the first operations, and of the last */
#define LOSSY_RUNS 30u    /* so many meet every pair of strengths that more would: see lose() */

static const struct scenario {
    const char *name;
    struct torture_setup setup;
} scenarios[] = {
    {"write", {TORTURE_WRITE, "7i93", LATE_BYTES, 0, 0}},
    {"write", {TORTURE_WRITE, "7i96s", LATE_BYTES, 0, 0}},
    {"fallback write", {TORTURE_WRITE_FALLBACK, "7i93", LATE_BYTES, 0, 0}},
    {"fallback write", {TORTURE_WRITE_FALLBACK, "7i96s", LATE_BYTES, 0, 0}},
    {"restore", {TORTURE_RESTORE, "7i93", LATE_BYTES, 0, 0}},
    {"restore", {TORTURE_RESTORE, "7i96s", LATE_BYTES, 0, 0}},
};

/* The same command again, on a card that is well. */
static void second_run(struct torture *const t, const char *const what, const uint64_t number)
{
    torture_power_up(t);
    torture_check_starts(t, what, number);
    if (torture_run(t) != 0)
        fail_msg("%s, %s %" PRIu64 ", second run: %s", t->setup.profile, what, number, t->diag.text);
    torture_check_wanted(t, what, number);
}

static bool erases(const struct torture *const t, const uint64_t operation)
{
    for (unsigned i = 0; i < t->erase_count; i++)
        if (t->erase[i].operation == operation)
            return true;
    return false;
}

static void cut_one(struct torture *const t, const char *const name, const uint64_t at)
{
    torture_reset(t);
    const struct sim_flash_faults faults = {.cut_at = at, .cut_bytes = (unsigned)(at * 37 % 257), .seed = at};
    sim_card_flash_faults(t->sim, &faults);
    if (torture_run(t) == 0)
        fail_msg("%s, %s: cut %" PRIu64 " went unnoticed", t->setup.profile, name, at);
    second_run(t, name, at);
}

static void cut_all(const struct scenario *const scenario)
{
    struct torture *const t = torture_new(&scenario->setup);
    const uint64_t cuts_wanted = (uint64_t)CUTS * torture_factor();
    const uint64_t step = t->operations <= cuts_wanted ? 1 : t->operations / cuts_wanted;
    uint64_t cuts = 0;
    for (uint64_t at = 1; at <= t->operations; at++)
        if (at <= END_CUTS || at + END_CUTS > t->operations || at % step == 0 || erases(t, at)) {
            cut_one(t, scenario->name, at);
            cuts++;
        }
    printf("%s, %s: %" PRIu64 " power cuts in %" PRIu64 " operations, %u of them erases, seed = operation\n",
           t->setup.profile, scenario->name, cuts, t->operations, t->erase_count);
    torture_free(t);
}

static void the_power_may_go_at_any_moment(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof scenarios / sizeof scenarios[0]; i++)
        cut_all(&scenarios[i]);
}

static void lose(const struct scenario *const scenario)
{
    struct torture *const t = torture_new(&scenario->setup);
    const unsigned runs = LOSSY_RUNS * torture_factor();
    unsigned failed = 0;
    for (unsigned seed = 1; seed <= runs; seed++) {
        torture_reset(t);
        const double p = seed % 10 * 0.01;
        const struct sim_faults faults = {.seed = seed,
                                          .loss = p,
                                          .duplicate = p / 2,
                                          .reorder = seed % 3 * 0.01,
                                          .truncate = seed % 4 * 0.005,
                                          .delay_max_ns = seed % 5 * 1000000};
        assert_int_equal(sim_net_set_faults(t->net, &faults), 0);
        const int err = torture_run(t);
        if (err == 0)
            torture_check_wanted(t, scenario->name, seed);
        else
            second_run(t, scenario->name, seed);
        failed += err != 0;
    }
    printf("%s, %s: %u lossy runs, seeds 1 to %u; %u of them did not come to the end at once\n", t->setup.profile,
           scenario->name, runs, runs, failed);
    torture_free(t);
}

static void the_network_may_be_bad(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof scenarios / sizeof scenarios[0]; i++)
        lose(&scenarios[i]);
}

static void bits_that_fail_now_and_then_are_written_again(void **state)
{
    (void)state;
    struct torture *const t = torture_new(&scenarios[0].setup);
    for (unsigned i = 0; i < 8; i++) {
        torture_reset(t);
        const uint32_t at = (uint32_t)t->size / 2 + (uint32_t)t->image.payload_bytes - 500 * i - 50;
        const struct sim_flash_faults faults = {.bad_count = 1, .bad = {{at, 0xFF, i % 2, (i + 1) % 2}}};
        sim_card_flash_faults(t->sim, &faults);
        if (torture_run(t) != 0)
            fail_msg("bit %u: %s", i, t->diag.text);
        torture_check_wanted(t, "bad bit", i);
    }
    torture_free(t);
}

static void bits_that_always_fail_end_the_run_and_the_fallback_starts(void **state)
{
    (void)state;
    struct torture *const t = torture_new(&scenarios[1].setup);
    torture_reset(t);
    uint32_t at = (uint32_t)t->size / 2 + (uint32_t)t->image.payload_bytes - 2000;
    while (t->wanted[at] == 0xFF || t->before[at] == t->wanted[at])
        at++;
    const struct sim_flash_faults faults = {.bad_count = 1, .bad = {{at, 0xFF, UINT_MAX, 0}}};
    sim_card_flash_faults(t->sim, &faults);
    assert_int_equal(torture_run(t), HM2_ERR_IO);
    assert_int_equal(sim_card_would_boot(t->sim), SIM_BOOT_FALLBACK);
    second_run(t, "worn", 0);
    torture_free(t);
}

static void a_chip_that_never_ends_is_reported_in_time(void **state)
{
    (void)state;
    struct torture *const t = torture_new(&scenarios[0].setup);
    torture_reset(t);
    const struct sim_flash_faults faults = {.stuck_at = 3};
    sim_card_flash_faults(t->sim, &faults);
    const int64_t before_ns = link_now_ns(sim_net_link(t->net));
    assert_int_equal(torture_run(t), HM2_ERR_TIMEOUT);
    const int64_t took_s = (link_now_ns(sim_net_link(t->net)) - before_ns) / 1000000000;
    assert_in_range(took_s, 0, 60);
    second_run(t, "stuck", 3);
    torture_free(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_power_may_go_at_any_moment),
        cmocka_unit_test(the_network_may_be_bad),
        cmocka_unit_test(bits_that_fail_now_and_then_are_written_again),
        cmocka_unit_test(bits_that_always_fail_end_the_run_and_the_fallback_starts),
        cmocka_unit_test(a_chip_that_never_ends_is_reported_in_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
