/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2can: what it says of good files and of bad ones. */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "process.h"
#include "suite.h"

#define END_MS 20000
#define GOLDEN TEST_DATA "/can/golden.dbc"

static struct process program;

static int run(const char *const option, const char *const value, const char *const file)
{
    const char *const argv[] = {process_built("hm2can"), option, value ? value : file, value ? file : NULL, NULL};
    return process_run(&program, argv, END_MS);
}

static void expect(const char *const text)
{
    ck_assert_msg(strstr(program.text, text) != NULL, "expected \"%s\" in: %s", text, program.text);
}

START_TEST(a_good_file_is_counted)
{
    ck_assert_int_eq(run("--check", NULL, GOLDEN), 0);
    ck_assert_str_eq(program.text, GOLDEN ": 3 nodes, 8 messages (2 of CAN FD), 24 signals\n");
}
END_TEST

START_TEST(messages_signals_and_pins_are_listed)
{
    ck_assert_int_eq(run("--node", "HOST", GOLDEN), 0);
    expect("Intel 0x100, 8 bytes, sent, on change\n");
    expect("Motorola 0x101, 8 bytes, received, every 20 ms\n");
    expect("Wide 0x18FEF100, 8 bytes, received\n");
    expect("  u1                       bit    Intel 0|1 unsigned, 0 to 1\n    1 = on\n    0 = off\n");
    expect("  m12                      float  Motorola 10|12 unsigned, -1947.5 to 100 V\n");
    expect(", if inner is 3 or 7 to 9\n");
    ck_assert_int_eq(run("--node", "PANEL", GOLDEN), 0);
    expect("Motorola 0x101, 8 bytes, not used, every 20 ms\n");
}
END_TEST

/* A reader of somebody else. */
START_TEST(json_is_json)
{
    char command[1024];
    snprintf(command, sizeof command,
             "'%s' --json --node HOST --floats " GOLDEN " | python3 -c \"import json, sys\n"
             "d = json.load(sys.stdin)\n"
             "m = {m['name']: m for m in d['messages']}\n"
             "s = {s['name']: s for s in m['Nested']['signals']}\n"
             "assert d['good'] and d['nodes'] == ['HOST', 'DRIVE', 'PANEL']\n"
             "assert s['deep']['multiplexed_by'] == 'inner' and s['deep']['multiplexor_values'] == [[3, 3], [7, 9]]\n"
             "assert m['Intel']['signals'][1]['values'] == {'-1': 'minus one', '3': 'three'}\n"
             "assert s['other']['pin'] == 'float' and m['Long']['fd']\n"
             "print('read')\"",
             process_built("hm2can"));
    const char *const argv[] = {"/bin/sh", "-c", command, NULL};
    ck_assert_int_eq(process_run(&program, argv, END_MS), 0);
    ck_assert_str_eq(program.text, "read\n");
}
END_TEST

START_TEST(what_is_wrong_is_told_with_its_line)
{
    char path[64];
    snprintf(path, sizeof path, "/tmp/check-hm2can-%d.dbc", (int)getpid());
    FILE *const file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    fputs("BU_: A\nBO_ 5 M: 8 A\n SG_ s : 60|8@1+ (1,0) [0|0] \"\" A\n", file);
    fclose(file);
    const int status = run("--check", NULL, path), json = run("--json", NULL, path);
    ck_assert_ptr_nonnull(strstr(program.text, "\"good\": false"));
    (void)run("--check", NULL, path);
    unlink(path);
    ck_assert_int_eq(status, 1);
    ck_assert_int_eq(json, 1);
    expect(".dbc:3: M.s (start 60, 8 bits, Intel) reaches into byte 9, and M has 8\n");
    ck_assert_int_eq(run("--check", NULL, "/nowhere.dbc"), 1);
    expect("hm2can: cannot read /nowhere.dbc: No such file or directory\n");
    ck_assert_int_eq(run("--node", "NOBODY", GOLDEN), 1);
    expect("there is no node \"NOBODY\"");
    ck_assert_int_eq(run("--check", NULL, NULL), 2);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2can");
    TCase *const tests = tcase_create("files");
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, a_good_file_is_counted);
    tcase_add_test(tests, messages_signals_and_pins_are_listed);
    tcase_add_test(tests, json_is_json);
    tcase_add_test(tests, what_is_wrong_is_told_with_its_line);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
