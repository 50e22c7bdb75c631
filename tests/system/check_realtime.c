/* SPDX-License-Identifier: GPL-2.0-or-later */
/* scripts/realtime-evidence where it cannot run. With a virtual machine it takes minutes and a download, so that is
 * for people to start. */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "process.h"
#include "suite.h"

#define RUN_MS 60000
#define SKIP   77
#define USAGE  2

static const char script[] = TEST_SOURCE "/scripts/realtime-evidence";
static struct process process;

static int run(const char *const first, const char *const second)
{
    const char *const argv[] = {script, first, second, NULL};
    return process_run(&process, argv, RUN_MS);
}

START_TEST(help_names_the_options)
{
    static const char *const options[] = {"--seconds", "--build", "--out", "--load", "--no-load", "--emulate"};
    ck_assert_int_eq(run("--help", NULL), 0);
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++)
        ck_assert_msg(strstr(process.text, options[i]) != NULL, "no %s in: %s", options[i], process.text);
    ck_assert_int_eq(run("--nonsense", NULL), USAGE);
    ck_assert_ptr_nonnull(strstr(process.text, "--seconds"));
}
END_TEST

START_TEST(a_duration_that_is_no_number_is_refused)
{
    static const char *const wrong[] = {"", "x", "-1", "1.5", "10000", "0", "00"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        ck_assert_int_eq(run("--seconds", wrong[i]), 1);
        ck_assert_msg(strstr(process.text, "1 to 9999 expected") != NULL, "%s: %s", wrong[i], process.text);
    }
}
END_TEST

/* A PATH with what the script needs to find that out, and no more. */
START_TEST(without_qemu_it_is_skipped_with_the_reason)
{
    static const char *const tools[] = {"dirname", "realpath"};
    char folder[] = "/tmp/check_realtime.XXXXXX", links[2][64];
    ck_assert_ptr_nonnull(mkdtemp(folder));
    for (size_t i = 0; i < 2; i++) {
        snprintf(links[i], sizeof links[i], "%s/%s", folder, tools[i]);
        ck_assert_int_eq(symlink(process_find(tools[i]), links[i]), 0);
    }
    ck_assert_int_eq(setenv("PATH", folder, 1), 0);
    const int status = run(NULL, NULL);
    for (size_t i = 0; i < 2; i++)
        unlink(links[i]);
    rmdir(folder);
    ck_assert_int_eq(status, SKIP);
    ck_assert_msg(strncmp(process.text, "SKIP: qemu-system-x86_64 is not installed", 40) == 0, "%s", process.text);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("realtime evidence");
    TCase *const tests = tcase_create("where it cannot run");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, help_names_the_options);
    tcase_add_test(tests, a_duration_that_is_no_number_is_refused);
    tcase_add_test(tests, without_qemu_it_is_skipped_with_the_reason);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
