/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Cable out, interface down, power gone, under LinuxCNC: the card comes back without a restart, by a person's hand or
 * by auto-rearm. LOST_CARD_SECONDS="1 10 60" sets for how long each time.
 */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "linuxcnc_peer.h"
#include "process.h"
#include "suite.h"

#define LIMIT_MS 1200000

static struct process run;

START_TEST(a_lost_card_comes_back_without_a_restart)
{
    static const char out[] = TEST_BUILD "/lost-card";
    const char *const seconds = getenv("LOST_CARD_SECONDS");
    const char *const argv[] = {TEST_SOURCE "/tests/system/linuxcnc-peer", TEST_BUILD, out,   "7i96s",
                                TEST_SOURCE "/tests/system/hal/lost.hal",  "--follow", "0:0", NULL};
    if (!linuxcnc_loads_ours())
        return;
    (void)mkdir(out, 0755);
    linuxcnc_tell("PEER_DRIVER", "hm2_lbp16");
    linuxcnc_tell("PEER_CONFIG", "num_stepgens=5");
    linuxcnc_tell("PEER_CARD", "hm2_7i96s.0");
    linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    linuxcnc_tell("PEER_TIMEOUT", "1100");
    linuxcnc_tell("LOSE_SECONDS", seconds ? seconds : "1");
    (void)linuxcnc_run_to(&run, argv, LIMIT_MS, "ok all", "the card did not come back as it should", NULL);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("lost card");
    TCase *const tests = tcase_create("LinuxCNC");
    tcase_set_timeout(tests, 1250);
    tcase_add_test(tests, a_lost_card_comes_back_without_a_restart);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
