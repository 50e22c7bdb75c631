/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The histogram of round-trip times. */
#include "unit.h"

#include "../../lib/board/rtt.h"

static void bounds_are_at_most_an_eighth_above_the_times(void **state)
{
    (void)state;
    for (int64_t ns = 1000; ns < 20000000; ns += ns / 7) {
        struct board_rtt rtt = {0};
        board_rtt_add(&rtt, ns);
        const int64_t bound = board_rtt_bound_ns(&rtt, 0);
        assert_true(bound > ns);
        assert_true(bound <= ns + ns / 8 + 128);
    }
}

static void a_share_of_the_longest_is_left_out(void **state)
{
    (void)state;
    struct board_rtt rtt = {0};
    for (unsigned i = 0; i < 1016; i++)
        board_rtt_add(&rtt, 50000);
    for (unsigned i = 0; i < 8; i++)
        board_rtt_add(&rtt, 900000);
    assert_in_range(board_rtt_bound_ns(&rtt, 8), 50000, 57000);
    assert_in_range(board_rtt_bound_ns(&rtt, 7), 900000, 1100000);
}

static void what_was_long_ago_is_forgotten(void **state)
{
    (void)state;
    struct board_rtt rtt = {0};
    for (unsigned i = 0; i < 1000; i++)
        board_rtt_add(&rtt, 900000);
    for (unsigned i = 0; i < 100000; i++)
        board_rtt_add(&rtt, 50000);
    assert_in_range(board_rtt_bound_ns(&rtt, 0), 50000, 57000);
}

static void any_time_has_its_place(void **state)
{
    (void)state;
    static const int64_t times[] = {INT64_MIN, -1, 0, 1, 127, 128, INT64_C(1) << 40, INT64_MAX};
    struct board_rtt rtt = {0};
    assert_int_equal(board_rtt_bound_ns(&rtt, 0), 0);
    for (size_t i = 0; i < sizeof times / sizeof times[0]; i++)
        board_rtt_add(&rtt, times[i]);
    assert_int_equal(rtt.total, sizeof times / sizeof times[0]);
    assert_true(board_rtt_bound_ns(&rtt, 0) > 10000000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bounds_are_at_most_an_eighth_above_the_times),
        cmocka_unit_test(a_share_of_the_longest_is_left_out),
        cmocka_unit_test(what_was_long_ago_is_forgotten),
        cmocka_unit_test(any_time_has_its_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
