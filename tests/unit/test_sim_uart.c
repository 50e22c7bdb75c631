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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_uart_does_what_the_traces_show),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
