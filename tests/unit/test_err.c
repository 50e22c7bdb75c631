/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include <hm2/bytes.h>
#include <hm2/err.h>

static void every_error_has_a_name(void **state)
{
    (void)state;
    for (int err = 0; err >= HM2_ERR_HOST; err--)
        assert_string_not_equal(hm2_strerror(err), "unknown error");
    assert_string_equal(hm2_strerror(1), "unknown error");
    assert_string_equal(hm2_strerror(-1000), "unknown error");
}

static void diag_collects_sentences_and_ends_each_with_a_newline(void **state)
{
    (void)state;
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_diag_add(&diag, HM2_ERR_RANGE, "count %d", 128), HM2_ERR_RANGE);
    hm2_diag_warn(&diag, "slow\n");
    assert_string_equal(diag.text, "count 128\nwarning: slow\n");
    assert_int_equal(diag.problems, 1);
    assert_int_equal(diag.warnings, 1);
}

static void diag_marks_what_did_not_fit_and_keeps_counting(void **state)
{
    (void)state;
    struct hm2_diag diag = {0};
    for (int i = 0; i < 1000; i++)
        (void)hm2_diag_add(&diag, HM2_ERR_INVALID, "sentence number %d of many", i);
    assert_int_equal(diag.problems, 1000);
    assert_true(diag.dropped > 0);
    assert_true(diag.len < HM2_DIAG_SIZE);
    assert_string_equal(diag.text + diag.len - 4, "...\n");
}

static void counter_differences_are_exact_across_the_wrap(void **state)
{
    (void)state;
    assert_int_equal(hm2_delta32(2u, 0xFFFFFFFEu), 4);
    assert_int_equal(hm2_delta32(0xFFFFFFFEu, 2u), -4);
    assert_int_equal(hm2_delta16(0x0001u, 0xFFFFu), 2);
    assert_int_equal(hm2_delta16(0x8000u, 0x7FFFu), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_error_has_a_name),
        cmocka_unit_test(diag_collects_sentences_and_ends_each_with_a_newline),
        cmocka_unit_test(diag_marks_what_did_not_fit_and_keeps_counting),
        cmocka_unit_test(counter_differences_are_exact_across_the_wrap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
