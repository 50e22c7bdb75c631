/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "trace_folder.h"

static void the_uart_does_what_the_traces_show(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("uart");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 6);
}

static void the_packet_uart_of_both_sources_does_what_the_traces_show(void **state)
{
    (void)state;
    const struct replay_totals older = replay_data("pktuart");
    assert_int_equal(older.failed, 0);
    assert_int_equal(older.passed, 52);
    const struct replay_totals newer = replay_data("pktuart_new");
    assert_int_equal(newer.failed, 0);
    assert_int_equal(newer.passed, 39);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_uart_does_what_the_traces_show),
        cmocka_unit_test(the_packet_uart_of_both_sources_does_what_the_traces_show),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
