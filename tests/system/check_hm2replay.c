/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2replay as a program: what it prints and how it exits. */
#include <check.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "folder.h"
#include "process.h"
#include "replay_trace.h"
#include "suite.h"

#define END_MS 60000

static struct process replay;
static char folder[FOLDER_PATH];

static int run(const char *const a, const char *const b, const char *const c)
{
    const char *argv[5] = {process_built("hm2replay")};
    unsigned n = 1;
    const char *const args[] = {a, b, c};
    for (unsigned i = 0; i < 3; i++)
        if (args[i])
            argv[n++] = args[i];
    return process_run(&replay, argv, END_MS);
}

static void printed(const char *const text)
{
    ck_assert_msg(strstr(replay.text, text), "\"%s\" is not in:\n%s", text, replay.text);
}

static void make_folder(void)
{
    folder_make(folder, "hm2replay");
}

static void remove_folder(void)
{
    folder_remove(folder);
}

/* A trace folder of this kind with one test. */
static const char *trace(const char *const kind, const char *const events)
{
    static char path[128];
    char file[192];
    snprintf(path, sizeof path, "%s/%s", folder, kind);
    ck_assert_int_eq(mkdir(path, 0755), 0);
    static const char *const names[] = {"tests.csv", "events.csv"};
    const char *const texts[] = {"test,description\nonly,\n", events};
    for (unsigned i = 0; i < 2; i++) {
        snprintf(file, sizeof file, "%s/%s", path, names[i]);
        FILE *const stream = fopen(file, "w");
        ck_assert_ptr_nonnull(stream);
        ck_assert_int_ge(fputs(texts[i], stream), 0);
        ck_assert_int_eq(fclose(stream), 0);
    }
    return path;
}

START_TEST(every_recorded_folder_passes)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", TEST_DATA, replay_kinds[_i].folder);
    ck_assert_msg(run(path, NULL, NULL) == 0, "%s", replay.text);
    printed(" passed, 0 failed\n");
    ck_assert(!strstr(replay.text, "not ok"));
}
END_TEST

START_TEST(a_difference_is_printed_and_makes_the_exit_status)
{
    const char *const path = trace("encoder", "test,clk,ev,name,value\nonly,30,R,count,00000001\n");
    ck_assert_int_eq(run(path, NULL, NULL), 1);
    printed("/encoder/only: clk 30: count expected 00000001 (line 2), got 00000000/00000000\n");
    printed("0 passed, 1 failed\n");
    ck_assert_int_eq(run("--json", path, NULL), 1);
    printed("\"test\": \"only\", \"passed\": false, \"difference\": \"clk 30: count expected 00000001");
    printed("\"passed\": 0,\n  \"failed\": 1\n}\n");
}
END_TEST

START_TEST(json_takes_any_name_of_a_folder)
{
    static const char odd[] = "\xC3\xA4 \xE2\x82\xAC\"\\\x01\xFF\xED\xA0\x80\xC3";
    char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, odd);
    ck_assert_int_eq(mkdir(path, 0755), 0);
    snprintf(path, sizeof path, "%s/encoder", odd);
    ck_assert_int_eq(run("--json", trace(path, "test,clk,ev,name,value\nonly,30,R,count,00000001\n"), NULL), 1);
    printed("/\xC3\xA4 \xE2\x82\xAC\\\"\\\\\\u0001\\u00ff\\u00ed\\u00a0\\u0080\\u00c3/encoder\", \"test\"");
}
END_TEST

START_TEST(a_folder_of_no_kind_is_named_with_the_known_ones)
{
    ck_assert_int_eq(run(trace("nosuch", "test,clk,ev,name,value\n"), NULL, NULL), 3);
    printed("\"nosuch\" is no kind of trace folder; the base name must be one of: stepgen");
}
END_TEST

START_TEST(a_broken_table_is_refused_with_its_line)
{
    const char *const path = trace("stepgen", "test,clk,ev,name,value\nonly,30,R,nothing,0\n");
    ck_assert_int_eq(run(path, NULL, NULL), 3);
    printed("events.csv line 2: nothing is no register of folder kind stepgen.");
}
END_TEST

START_TEST(one_test_can_be_chosen)
{
    ck_assert_int_eq(run("--test", "quaderror", TEST_DATA "/encoder"), 0);
    printed("1 passed, 0 failed\n");
    ck_assert_int_eq(run("--test", "nosuchtest", TEST_DATA "/encoder"), 2);
    ck_assert_int_eq(run(NULL, NULL, NULL), 2);
    printed("usage: hm2replay");
    ck_assert_int_eq(run("--help", NULL, NULL), 0);
    printed("usage: hm2replay");
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2replay");
    TCase *const tests = tcase_create("hm2replay");
    tcase_set_timeout(tests, 2.0 * END_MS / 1000.0);
    tcase_add_checked_fixture(tests, make_folder, remove_folder);
    tcase_add_loop_test(tests, every_recorded_folder_passes, 0, (int)replay_kind_count);
    tcase_add_test(tests, a_difference_is_printed_and_makes_the_exit_status);
    tcase_add_test(tests, json_takes_any_name_of_a_folder);
    tcase_add_test(tests, a_folder_of_no_kind_is_named_with_the_known_ones);
    tcase_add_test(tests, a_broken_table_is_refused_with_its_line);
    tcase_add_test(tests, one_test_can_be_chosen);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
