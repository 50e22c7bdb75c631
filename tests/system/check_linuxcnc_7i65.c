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

#include "linuxcnc_peer.h"
#include "process.h"
#include "suite.h"

#define LIMIT_MS 130000
#define ERROR    "0.01" /* 10 counts of 1000 a unit */

static struct process run;

static bool run_peer(const char **const line)
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
    linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    linuxcnc_tell("PEER_CARD", "hm2_7i93.0");
    linuxcnc_tell("PEER_CONFIG", "");
    linuxcnc_tell("PEER_ERROR", ERROR);
    return linuxcnc_run_to(&run, argv, LIMIT_MS, "reached: ", "the axes are not where they shall be", line);
}

START_TEST(two_loops_close_over_analog_outputs_and_multiplexed_encoders)
{
    const char *line;
    if (linuxcnc_loads_ours() && run_peer(&line))
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
    return run_suite(suite);
}
