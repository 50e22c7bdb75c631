/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Two analog loops over a simulated 7I65 close under LinuxCNC (tests/system/hal/octal-pid.hal). LinuxCNC's own
 * mesa_7i65 is compared in virtual time (check_dropin_behaviour) and not here: it switches the converters on in its
 * first cycle only, which a machine without realtime loses now and then.
 */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "process.h"

#define LIMIT_MS   130000
#define CANNOT_RUN 77
#define ERROR      "0.01" /* 10 counts of 1000 a unit */

static struct process run;

static void set(const char *const name, const char *const value)
{
    ck_assert_int_eq(setenv(name, value, 1), 0);
}

static void run_peer(void)
{
    static const char out[] = TEST_BUILD "/linuxcnc-7i65";
    static const char *const argv[] = {TEST_SOURCE "/tests/system/linuxcnc-peer",
                                       TEST_BUILD,
                                       out,
                                       "7i93_2x7i65",
                                       TEST_SOURCE "/tests/system/hal/octal-pid.hal",
                                       "--7i65",
                                       "0",
                                       "--7i65-motor",
                                       "0:0:100000:20",
                                       "--7i65-motor",
                                       "7:7:100000:20",
                                       NULL};
    (void)mkdir(out, 0755);
    set("PEER_MODULES", TEST_BUILD "/linuxcnc");
    set("PEER_CARD", "hm2_7i93.0");
    set("PEER_CONFIG", "");
    set("PEER_ERROR", ERROR);
    process_run(&run, argv, LIMIT_MS);
}

START_TEST(two_loops_close_over_analog_outputs_and_multiplexed_encoders)
{
    const char *line;
    if (TEST_SANITIZED) {
        printf("SKIP: a component built with a sanitizer cannot be loaded into LinuxCNC, and makes the card late\n");
        return;
    }
    run_peer();
    if (run.status == CANNOT_RUN && process_wait_line(&run, "SKIP: ", 0, &line)) {
        printf("%.*s\n", (int)strcspn(line, "\n"), line);
        return;
    }
    if (run.status != 0 || !process_wait_line(&run, "reached: ", 0, &line)) {
        printf("%s\n", run.text);
        fflush(stdout);
        ck_abort_msg("the axes are not where they shall be, status %d", run.status);
    }
    printf("%.*s\n", (int)strcspn(line, "\n"), line);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("7I65 in LinuxCNC");
    TCase *const tests = tcase_create("LinuxCNC");
    tcase_set_timeout(tests, LIMIT_MS / 1000.0 + 20);
    tcase_add_test(tests, two_loops_close_over_analog_outputs_and_multiplexed_encoders);
    suite_add_tcase(suite, tests);
    SRunner *const runner = srunner_create(suite);
    srunner_run_all(runner, CK_ENV);
    const int failed = srunner_ntests_failed(runner);
    srunner_free(runner);
    return failed > 0;
}
