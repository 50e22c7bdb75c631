/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A malloc, locks and a printf family of the test's own, which count what a thread calls while it is watched. They
 * stand in for the C library's in the whole program, but not where a sanitizer brings its own allocator.
 */
#ifndef TEST_WATCH_H
#define TEST_WATCH_H

#include <stdbool.h>

#include "../process.h"

#if !TEST_SANITIZED && defined __GLIBC__
#define WATCH_WORKS 1
#else
#define WATCH_WORKS 0
#endif

enum watch_kind { WATCH_ALLOCATION, WATCH_LOCK, WATCH_FORMATTING, WATCH_KINDS };

/* Of the calling thread, as are the counts. */
void watch_begin(void);
void watch_end(void);
unsigned long watch_calls(enum watch_kind kind);
/* Name of the last function called; NULL when there was none. */
const char *watch_last(enum watch_kind kind);

#endif
