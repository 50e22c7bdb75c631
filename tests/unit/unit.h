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

/* Folder of the test data, set by the Makefile. */
#ifndef TEST_DATA
#define TEST_DATA "tests/data"
#endif

#endif
