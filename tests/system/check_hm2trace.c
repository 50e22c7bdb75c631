/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The flight recorder from a lost cycle to its picture: hm2_lbp16 in hm2host, a simulated card, and hm2trace. */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "simulator.h"
#include "suite.h"
#include "talk.h"

#define RUN_MS 20000

static struct simulator sim;
static struct talk hal;
static struct process run;
static char folder[] = "/tmp/check-flight-XXXXXX";
static char file[64];

static int trace(const char *const option, const char *const value, const char *const path)
{
    const char *argv[6] = {process_built("hm2trace")};
    unsigned n = 1;
    if (option)
        argv[n++] = option;
    if (value)
        argv[n++] = value;
    argv[n++] = path;
    argv[n] = NULL;
    return process_run(&run, argv, RUN_MS);
}

static void lose_a_cycle(void)
{
    ck_assert_ptr_nonnull(mkdtemp(folder));
    simulator_start(&sim, NULL);
    talk_start(&hal, NULL);
    talk_do(&hal,
            "loadrt hm2_lbp16 board_ip=%s flight_folder=%s flight_cycles=128\n"
            "loadrt threads name1=servo period1=1000000\n"
            "addf hm2_7i96s.0.read servo\naddf hm2_7i96s.0.write servo\n"
            "setp hm2_7i96s.0.packet-read-timeout 20000000\nsetp hm2_7i96s.0.watchdog.timeout_ns 4000000000\n"
            "start\nrun 0.3",
            sim.address[0], folder);
    simulator_do(&sim, "freeze on");
    talk_wait(&hal, "hm2_7i96s.0.packet-lost", 1, 1e9);
    simulator_do(&sim, "freeze off");
    talk_do(&hal, "setp hm2_7i96s.0.io_error 0");
    talk_wait_text(&hal, "hm2trace shows them");
    talk_wait(&hal, "hm2_7i96s.0.flight.freezes", 1, 1e9);
    talk_end(&hal);
    simulator_stop(&sim);
    snprintf(file, sizeof file, "%s/hm2_7i96s.0-00.flight", folder);
}

START_TEST(a_lost_cycle_is_written_shown_and_drawn)
{
    char picture[64], events[64];
    lose_a_cycle();
    ck_assert_int_eq(trace(NULL, NULL, file), 0);
    ck_assert_ptr_nonnull(strstr(run.text, "hm2_7i96s.0: 128 cycles of 1000 us, stopped for a lost cycle (cycle "));
    ck_assert_ptr_nonnull(strstr(run.text, "\nreply\t"));
    ck_assert_int_eq(trace("--table", NULL, file), 0);
    ck_assert_ptr_nonnull(strstr(run.text, "\tlost*\n"));
    ck_assert_int_eq(trace("--json", NULL, file), 0);
    ck_assert_ptr_nonnull(strstr(run.text, "\"cause\": \"a lost cycle\""));
    snprintf(picture, sizeof picture, "%s/picture.svg", folder);
    ck_assert_int_eq(trace("--svg", picture, file), 0);
    snprintf(events, sizeof events, "%s/events.json", folder);
    ck_assert_int_eq(trace("--perfetto", events, file), 0);
    const char *const look[] = {"sh",
                                "-c",
                                "grep -c '#d33' \"$0\" && python3 -c 'import json, sys; "
                                "print(len(json.load(open(sys.argv[1]))[\"traceEvents\"]))' \"$1\" && "
                                "rm -r \"$2\"",
                                picture,
                                events,
                                folder,
                                NULL};
    ck_assert_msg(process_run(&run, look, RUN_MS) == 0, "%s", run.text);
    ck_assert_int_ge(strtol(strchr(run.text, '\n') + 1, NULL, 10), 128 * 4);
}
END_TEST

START_TEST(what_is_no_recording_is_refused)
{
    ck_assert_int_eq(trace(NULL, NULL, "/proc/version"), 1);
    ck_assert_ptr_nonnull(strstr(run.text, "/proc/version: line 1: "));
    ck_assert_int_eq(trace(NULL, NULL, "/nowhere"), 1);
    ck_assert_ptr_nonnull(strstr(run.text, "No such file"));
    ck_assert_int_eq(trace("--table", "--json", file), 2);
}
END_TEST

START_TEST(impossible_recorders_are_refused_at_load)
{
    simulator_start(&sim, NULL);
    talk_start(&hal, NULL);
    char line[256];
    snprintf(line, sizeof line, "loadrt hm2_lbp16 board_ip=%s flight_folder=/tmp flight_cycles=10", sim.address[0]);
    ck_assert_ptr_nonnull(strstr(talk_try(&hal, line), "expected 64 to 65536 cycles"));
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2trace");
    TCase *const tests = tcase_create("recorder");
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, a_lost_cycle_is_written_shown_and_drawn);
    tcase_add_test(tests, what_is_no_recording_is_refused);
    tcase_add_test(tests, impossible_recorders_are_refused_at_load);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
