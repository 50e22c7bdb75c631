/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "linuxcnc_peer.h"

#include <check.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define CANNOT_RUN 77
#define MAX_ARGS   32
#define START_MS   60000

bool linuxcnc_loads_ours(void)
{
    if (TEST_SANITIZED)
        printf("SKIP: a component built with a sanitizer cannot be loaded into LinuxCNC\n");
    else if (access(TEST_BUILD "/linuxcnc/hm2_lbp16.so", R_OK) != 0)
        printf("SKIP: LinuxCNC's headers are not installed (linuxcnc-uspace-dev)\n");
    else
        return true;
    return false;
}

void linuxcnc_tell(const char *const name, const char *const value)
{
    ck_assert_int_eq(setenv(name, value, 1), 0);
}

bool linuxcnc_skipped(struct process *const run)
{
    const char *skip;
    if (!run->ended || run->status != CANNOT_RUN || !process_wait_line(run, "SKIP: ", 0, &skip))
        return false;
    printf("%.*s\n", (int)strcspn(skip, "\n"), skip);
    return true;
}

bool linuxcnc_ends_well(struct process *const run, const int limit_ms)
{
    if (!process_wait_end(run, limit_ms)) {
        process_stop(run, SIGKILL, 0);
        process_give_up(run, "no end in time");
    }
    if (linuxcnc_skipped(run))
        return false;
    if (run->status != 0)
        process_give_up(run, "an exit status that is not 0");
    return true;
}

bool linuxcnc_run_to(struct process *const run, const char *const *const argv, const int limit_ms,
                     const char *const start, const char *const what, const char **const line)
{
    process_run(run, argv, limit_ms);
    if (linuxcnc_skipped(run))
        return false;
    if (run->status != 0 || !process_wait_line(run, start, 0, line))
        process_give_up(run, what);
    return true;
}

bool linuxcnc_talk(struct talk *const talk, const char *const out, const char *const card, const char *const *options)
{
    const char *argv[MAX_ARGS] = {TEST_SOURCE "/tests/system/linuxcnc-peer", TEST_BUILD, out, card, "-"};
    unsigned n = 5;
    if (!linuxcnc_loads_ours())
        return false;
    (void)mkdir(out, 0755);
    linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    for (; *options; options++) {
        ck_assert_uint_lt(n + 1, MAX_ARGS);
        argv[n++] = *options;
    }
    talk_start_host(talk, argv);
    talk_say(talk, "print");
    if (process_wait_line(&talk->host, "<stdin>:1: ", START_MS, NULL))
        return true;
    (void)process_wait_end(&talk->host, START_MS);
    if (!linuxcnc_skipped(&talk->host))
        ck_abort_msg("LinuxCNC does not listen: %.4000s", talk->host.text);
    return false;
}
