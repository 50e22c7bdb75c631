/* SPDX-License-Identifier: GPL-2.0-or-later */
/* can_io on a kernel with CAN (can-kernel), against python-can and can-utils. The cases are in can/guest and run in one
 * go, as a kernel has to boot for them; here is one test for each, which looks for its line. */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "process.h"
#include "suite.h"

#define LIMIT_S  "500"
#define LIMIT_MS 560000
#define SKIPPED  77

static const char *const cases[] = {
    "signals_go_both_ways",
    "can_utils_agree",
    "the_kernel_filters",
    "long_frames",
    "what_gets_old_is_told",
    "sync_leaves_behind_the_commands",
    "several_buses",
    "remote_frames_ask",
    "a_flood_leaves_the_newest_value",
    "a_full_bus_loses_nothing",
    "the_cable_is_pulled",
    "the_interface_is_replugged",
    "error_frames_are_understood",
    "a_controller_leaves_its_bus_and_is_restarted",
    "a_drive_is_started_and_enabled",
    "a_drive_follows_its_setpoints",
    "a_drives_fault_is_told_and_reset",
    "a_lost_heartbeat_is_told",
    "a_node_is_guarded",
    "linuxcnc_commands_a_drive",
    "bad_loads_are_explained",
};
#define CASES ((int)(sizeof cases / sizeof cases[0]))

static struct process guest;

static void run_guest(void)
{
    const char *const argv[] = {TEST_SOURCE "/tests/system/can-kernel", LIMIT_S, TEST_SOURCE "/tests/system/can/guest",
                                TEST_BUILD, NULL};
    (void)process_run(&guest, argv, LIMIT_MS);
    fputs(guest.text, stdout);
}

/* The line is "ok NAME (0.1 s)". */
START_TEST(on_a_kernel_with_can)
{
    char line[128];
    snprintf(line, sizeof line, "\nok %s (", cases[_i]);
    ck_assert_msg(strstr(guest.text, line) != NULL, "%s: status %d: %s", cases[_i], guest.status, guest.text);
}
END_TEST

/* Every case has its test here. */
START_TEST(no_case_is_forgotten)
{
    int lines = 0;
    for (const char *at = guest.text; (at = strstr(at, "\nok ")) != NULL; at++)
        lines++;
    ck_assert_int_eq(lines, CASES);
    ck_assert_ptr_null(strstr(guest.text, "\nnot ok "));
    ck_assert_int_eq(guest.status, 0);
}
END_TEST

int main(void)
{
    if (TEST_SANITIZED) {
        puts("SKIP: a sanitizer's memory does not fit into User Mode Linux\n100%: Checks: 1, Failures: 0, Errors: 0");
        return 0;
    }
    run_guest();
    if (guest.status == SKIPPED) {
        puts("100%: Checks: 1, Failures: 0, Errors: 0"); /* the reason has been printed */
        return 0;
    }
    Suite *const suite = suite_create("can_io");
    TCase *const tests = tcase_create("kernel");
    tcase_set_timeout(tests, 60);
    tcase_add_loop_test(tests, on_a_kernel_with_can, 0, CASES);
    tcase_add_test(tests, no_case_is_forgotten);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
