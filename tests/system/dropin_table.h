/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The reviewed table of differences between LinuxCNC's driver and ours: tests/data/dropin/differences. A difference
 * that no row allows fails a test, and so does a row that allows nothing any more. What is compared at all is listed in
 * tests/data/dropin/modules; a row of which nothing is compared fails a test, too.
 * Rows: WHERE WHAT NAME LIMIT REASON, see the table itself.
 */
#ifndef TEST_DROPIN_TABLE_H
#define TEST_DROPIN_TABLE_H

#include <stdbool.h>
#include <stddef.h>

/* Read the table, or more of it, into memory that forked tests share. Call it before the tests run; a bad table ends
 * the program. The path is kept. */
void dropin_table_load(const char *path);

/* Limit of the first row for a difference, which is then in use; NULL when no row allows it. `where` is what the row's
 * first column is compared with ("names/7i96s/default"), `what` the kind, `name` the object without the card's
 * prefix. */
const char *dropin_table_allows(const char *where, const char *what, const char *name);

/* Print every row of a scope ("names", "loads", "run"), which is what its first column begins with, and that allowed
 * nothing since the table was loaded; returns how many these are. */
unsigned dropin_table_unused(const char *scope);

/* Whether a row of this scope (a shell pattern) and kind is about objects of a module ("encoder"). */
bool dropin_table_has(const char *scope, const char *what, const char *module);

/* For looking closer: DROPIN_ONLY=PATTERN in the environment runs only what matches it, a shell pattern for what
 * `where` is: DROPIN_ONLY='names/7i93/absolute', DROPIN_ONLY='*motion'. True for all when it is not set. */
bool dropin_table_wanted(const char *where);

/* What the names of a simulated card's objects begin with, "hm2_7i96s.0.". Those of 7I80DB and 7I80HD say no more than
 * 7i80 (hal-interface 1.3); behind an underscore is the firmware: "7i96s_7i77d". */
void dropin_prefix(const char *card, char *prefix, size_t size);

#endif
