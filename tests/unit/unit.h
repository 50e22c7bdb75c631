/* SPDX-License-Identifier: GPL-2.0-or-later */
/* cmocka with the headers it wants first, and what most unit tests share. */
#ifndef UNIT_H
#define UNIT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* cmocka compares as an unsigned type, which a negative floating-point number cannot be converted to: by way of the
 * signed one it can, and all other values come to the same. */
#undef assert_int_equal
#define assert_int_equal(left, right) \
    _assert_int_equal((LargestIntegralType)(intmax_t)(left), (LargestIntegralType)(intmax_t)(right), __FILE__, __LINE__)

/* A failed assertion of cmocka does not return, which the static analyzer cannot know. */
#ifdef __clang_analyzer__
#undef assert_true
#undef assert_non_null
#undef assert_int_equal
#undef fail_msg
#define assert_true(condition)        ((condition) ? (void)0 : abort())
#define assert_non_null(pointer)      ((pointer) ? (void)0 : abort())
#define assert_int_equal(left, right) ((intmax_t)(left) == (intmax_t)(right) ? (void)0 : abort())
#define fail_msg(...)                 abort()
#endif

/* Folder of the test data, set by the Makefile. */
#ifndef TEST_DATA
#define TEST_DATA "tests/data"
#endif

#endif
