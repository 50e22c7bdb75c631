/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "trace_folder.h"

static void buffered_spi_does_what_the_traces_show(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("bspi");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 36);
}

static void decoded_buffered_spi_does_what_the_traces_show(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("dbspi");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 3);
}

static void simple_spi_does_what_the_traces_show(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("spi");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(buffered_spi_does_what_the_traces_show),
        cmocka_unit_test(decoded_buffered_spi_does_what_the_traces_show),
        cmocka_unit_test(simple_spi_does_what_the_traces_show),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
