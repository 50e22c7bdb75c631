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
