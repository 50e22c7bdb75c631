/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The cable of one of two smart-serial remotes is pulled under LinuxCNC: axes of the other go on, the loss is reported
 * within three cycles, and the remote comes back by a person's hand or by auto-restart (tests/system/hal/pull-remote).
 */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "linuxcnc_peer.h"
#include "process.h"
#include "suite.h"

#define LIMIT_MS 300000 /* half a minute, on a machine with nothing else to do */

static struct process run;

START_TEST(a_pulled_remote_stops_alone_is_reported_and_comes_back)
{
    static const char out[] = TEST_BUILD "/sserial-pulled";
    static const char *const argv[] = {TEST_SOURCE "/tests/system/linuxcnc-peer",
                                       TEST_BUILD,
                                       out,
                                       "7i96s_7i77d",
                                       TEST_SOURCE "/tests/system/hal/sserial-pulled.hal",
                                       "--remote",
                                       "0:0=7i77",
                                       "--remote",
                                       "0:2=7i77-analog",
                                       "--servo",
                                       "0:0:1:AnalogOut0:100000:20",
                                       "--servo",
                                       "1:0:1:AnalogOut1:100000:20",
                                       "--servo",
                                       "2:0:1:AnalogOut2:100000:20",
                                       "--servo",
                                       "3:0:2:AnalogOut0:100000:20",
                                       "--servo",
                                       "4:0:2:AnalogOut1:100000:20",
                                       "--servo",
                                       "5:0:2:AnalogOut2:100000:20",
                                       NULL};
    if (!linuxcnc_loads_ours())
        return;
    (void)mkdir(out, 0755);
    linuxcnc_tell("PEER_DRIVER", "hm2_lbp16");
    linuxcnc_tell("PEER_CONFIG", "num_encoders=8 num_stepgens=5 sserial_port_0=000xxxxx");
    linuxcnc_tell("PEER_CARD", "hm2_7i96s.0");
    linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    linuxcnc_tell("PEER_TIMEOUT", "280");
    (void)linuxcnc_run_to(&run, argv, LIMIT_MS, "ok all", "not what should happen to a pulled remote", NULL);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("sserial pulled");
    TCase *const tests = tcase_create("LinuxCNC");
    tcase_set_timeout(tests, 320);
    tcase_add_test(tests, a_pulled_remote_stops_alone_is_reported_and_comes_back);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
