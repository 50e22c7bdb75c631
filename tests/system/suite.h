/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How a Check program of ours ends: its suite is run and told as Check's environment variables ask (CK_VERBOSITY,
 * CK_FORK, CK_RUN_CASE …).
 */
#ifndef TEST_SUITE_H
#define TEST_SUITE_H

#include <check.h>

/* Run all tests of a suite, which is freed. Returns what main() returns: 0, or 1 when a test failed. */
int run_suite(Suite *suite);

#endif
