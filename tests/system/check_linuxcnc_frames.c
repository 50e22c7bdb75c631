/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A component that was made with halcompile and LinuxCNC's own header (tests/system/hal/frames_test.comp) sends and
 * receives frames through hm2_lbp16, under LinuxCNC.
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
#define OUT      TEST_BUILD "/linuxcnc-frames"
#define BUILD_THEM                                                                                                \
    "cd " OUT " && rm -rf modules && mkdir modules && cp " TEST_SOURCE "/tests/system/hal/frames_test.comp . && " \
    "halcompile --compile frames_test.comp && cp " TEST_BUILD "/linuxcnc/*.so frames_test.so modules"

static struct process run;

static void build_modules(void)
{
    static const char *const argv[] = {"sh", "-c", BUILD_THEM, NULL};
    (void)mkdir(OUT, 0755);
    /* halcompile has a make of its own. */
    unsetenv("MAKEFLAGS");
    unsetenv("MAKELEVEL");
    process_run(&run, argv, LIMIT_MS);
    if (run.status != 0)
        process_give_up(&run, "halcompile does not make the component");
}

START_TEST(a_component_made_for_linuxcncs_driver_sends_and_receives_frames)
{
    static const char *const argv[] = {TEST_SOURCE "/tests/system/linuxcnc-peer",
                                       TEST_BUILD,
                                       OUT,
                                       "7i80hd-16",
                                       TEST_SOURCE "/tests/system/hal/frames.hal",
                                       "--firmware",
                                       TEST_DATA "/hm2_pty/PKTUART_1.hex",
                                       "--uart",
                                       "pktuart.0:loop",
                                       NULL};
    const char *line;
    if (!linuxcnc_loads_ours())
        return;
    build_modules();
    linuxcnc_tell("PEER_MODULES", OUT "/modules");
    if (linuxcnc_run_to(&run, argv, LIMIT_MS, "ok frames: ", "frames are missing or wrong", &line))
        printf("%.*s\n", (int)strcspn(line, "\n"), line);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("frames in LinuxCNC");
    TCase *const tests = tcase_create("LinuxCNC");
    tcase_set_timeout(tests, 2 * LIMIT_MS / 1000.0);
    tcase_add_test(tests, a_component_made_for_linuxcncs_driver_sends_and_receives_frames);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
