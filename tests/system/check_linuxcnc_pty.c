/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2_pty under LinuxCNC: a serial program sets its speed and gets back what it writes (tests/system/hal/echo-pty). */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "linuxcnc_peer.h"
#include "process.h"
#include "suite.h"

#define LIMIT_MS 130000

static struct process run;

START_TEST(a_terminal_of_the_card_echoes)
{
    static const char out[] = TEST_BUILD "/linuxcnc-pty";
    const char *const argv[] = {TEST_SOURCE "/tests/system/linuxcnc-peer",
                                TEST_BUILD,
                                out,
                                "7i80hd-16",
                                TEST_SOURCE "/tests/system/hal/pty.hal",
                                "--firmware",
                                TEST_DATA "/hm2_pty/PKTUART_0.hex",
                                "--uart",
                                "pktuart.0:loop",
                                NULL};
    const char *line;
    if (!linuxcnc_loads_ours())
        return;
    (void)mkdir(out, 0755);
    linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    if (linuxcnc_run_to(&run, argv, LIMIT_MS, "ok echo: ", "no echo", &line))
        printf("%.*s\n", (int)strcspn(line, "\n"), line);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2_pty in LinuxCNC");
    TCase *const tests = tcase_create("LinuxCNC");
    tcase_set_timeout(tests, 140);
    tcase_add_test(tests, a_terminal_of_the_card_echoes);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
