/* SPDX-License-Identifier: GPL-2.0-or-later */
/* docs/flash-hazards.md and docs/module-hazards.md name a test for every hazard: each of them exists, and its program
 * runs it. */
#include <check.h>
#include <stdio.h>
#include <string.h>

#include "suite.h"

#define FILE_BYTES 100000u

/* Their rows are numbered. */
static const struct {
    const char *path;
    char letter;
    unsigned hazards;
} pages[] = {{"docs/flash-hazards.md", 'H', 20}, {"docs/module-hazards.md", 'M', 18}};
#define PAGES (sizeof pages / sizeof pages[0])

static char page[FILE_BYTES], source[FILE_BYTES];

static void load(char *const text, const char *const path)
{
    char whole[512];
    snprintf(whole, sizeof whole, "%s/%s", TEST_SOURCE, path);
    FILE *const file = fopen(whole, "r");
    ck_assert_msg(file != NULL, "there is no %s", path);
    const size_t len = fread(text, 1, FILE_BYTES - 1, file);
    ck_assert_int_eq(fclose(file), 0);
    ck_assert_uint_lt(len, FILE_BYTES - 1);
    text[len] = '\0';
}

/* The file that a short name stands for: "- write: `tests/unit/test_flash_write.c`". */
static void load_source(const char *const name, const size_t len)
{
    char entry[64], path[128];
    snprintf(entry, sizeof entry, "\n- %.*s: `", (int)len, name);
    const char *const at = strstr(page, entry);
    ck_assert_msg(at != NULL, "no file has the short name \"%.*s\"", (int)len, name);
    const char *const start = at + strlen(entry);
    snprintf(path, sizeof path, "%.*s", (int)strcspn(start, "`"), start);
    load(source, path);
}

static unsigned times(const char *text, const char *const name, const size_t len)
{
    unsigned found = 0;
    for (; (text = strstr(text, name)) != NULL; text += len) {
        const char before = text[-1], behind = text[len];
        found += strchr("( ,", before) != NULL && strchr(",)(", behind) != NULL;
    }
    return found;
}

/* Defined, and listed in main(). */
static void expect_test(const char *const name, const size_t len)
{
    char text[128];
    ck_assert_uint_lt(len, sizeof text);
    snprintf(text, sizeof text, "%.*s", (int)len, name);
    const char *const list = strstr(source, "int main(void)");
    ck_assert_ptr_nonnull(list);
    ck_assert_msg(times(source, text, len) >= 2, "there is no test %s", text);
    ck_assert_msg(times(list, text, len) >= 1, "the test %s is not run", text);
}

/* "short: test; short: test" in the last column of a row. */
static unsigned check_row(const char *row)
{
    const char *const end = strchr(row, '\n');
    unsigned tests = 0;
    ck_assert_ptr_nonnull(end);
    const char *cell = end - 2;
    while (cell > row && *cell != '|')
        cell--;
    while (cell + 3 < end) {
        cell += strspn(cell, "|; ");
        const size_t file = strcspn(cell, ":");
        const char *const test = cell + file + 2;
        const size_t len = strcspn(test, "; |");
        load_source(cell, file);
        expect_test(test, len);
        tests++;
        cell = test + len + strspn(test + len, " ");
    }
    return tests;
}

START_TEST(every_hazard_has_a_test)
{
    const char letter = pages[_i].letter;
    load(page, pages[_i].path);
    for (unsigned i = 1; i <= pages[_i].hazards; i++) {
        char start[16];
        snprintf(start, sizeof start, "\n| %c%u ", letter, i);
        const char *const row = strstr(page, start);
        ck_assert_msg(row != NULL, "%c%u has no row", letter, i);
        ck_assert_uint_ge(check_row(row + 1), 1);
    }
}
END_TEST

START_TEST(everything_else_has_a_test)
{
    unsigned rows = 0;
    load(page, pages[0].path);
    const char *row = strstr(page, "| what | tests |");
    ck_assert_ptr_nonnull(row);
    row = strchr(strchr(row, '\n') + 1, '\n');
    for (; row[1] == '|'; row = strchr(row + 1, '\n'), rows++)
        ck_assert_uint_ge(check_row(row + 1), 1);
    ck_assert_uint_ge(rows, 10);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hazards");
    TCase *const tests = tcase_create("table");
    tcase_add_loop_test(tests, every_hazard_has_a_test, 0, (int)PAGES);
    tcase_add_test(tests, everything_else_has_a_test);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
