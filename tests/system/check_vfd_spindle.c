/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * examples/vfd-spindle.hal as it is, in hm2host: a drive of pymodbus's at the RS-485 pins of a simulated 7I96S, from
 * the speed command to the speed.
 */
#include <check.h>
#include <glob.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "folder.h"
#include "serial_pair.h"
#include "simulator.h"
#include "suite.h"
#include "talk.h"

#define LIMIT_MS 30000

static struct simulator sim;
static struct process drive;
static struct talk hal;
static char folder[FOLDER_PATH], terminal[80];

static void set_up(void)
{
    char uart[128];
    folder_make(folder, "vfd");
    ck_assert_int_eq(chdir(folder), 0);
    ck_assert_int_eq(symlink(TEST_SOURCE "/examples", "examples"), 0);
    snprintf(terminal, sizeof terminal, "%s/vfd", folder);
    snprintf(uart, sizeof uart, "pktuart.0:%s", terminal);
    const char *const options[] = {"--card", "7i96s", "--firmware", TEST_DATA "/idrom_7i96s/7i96s_pktuart.hex",
                                   "--uart", uart,    "--realtime", NULL};
    simulator_start(&sim, options);
}

static void tear_down(void)
{
    if (drive.pid)
        (void)process_stop(&drive, SIGKILL, LIMIT_MS);
    simulator_stop(&sim);
    folder_remove(folder);
}

/* False when there is no pymodbus. */
static bool start_drive(void)
{
    const char *const argv[] = {"examples/vfd-simulator", terminal, "20", NULL};
    return process_started_or_skipped(&drive, argv, "starting", LIMIT_MS);
}

static void load_example(void)
{
    const char *const files[] = {"examples/vfd-spindle.hal", NULL};
    ck_assert_int_eq(setenv("CARD", sim.address[0], 1), 0);
    talk_start(&hal, files);
    talk_wait(&hal, "vfd.status.ready.bit", 1, 1);
}

START_TEST(a_speed_command_leads_to_the_speed_and_back_to_rest)
{
    if (!start_drive())
        return;
    load_example();
    ck_assert_double_eq(talk_value(&hal, "vfd.status.at-speed.bit"), 0);
    talk_do(&hal, "sets spindle-hz 40\nsets spindle-on 1");
    talk_wait(&hal, "vfd.output.hz.float", 0.01, 39.99);
    talk_wait(&hal, "vfd.status.at-speed.bit", 1, 1);
    talk_wait(&hal, "vfd.output.hz.float", 40, 40);
    talk_do(&hal, "sets spindle-hz 30\nsets spindle-reverse 1");
    talk_wait(&hal, "vfd.status.reversed.bit", 1, 1);
    talk_wait(&hal, "vfd.status.at-speed.bit", 1, 1);
    talk_wait(&hal, "vfd.output.hz.float", 30, 30);
    talk_do(&hal, "sets spindle-on 0");
    talk_wait(&hal, "vfd.output.hz.float", 0, 0);
    talk_wait(&hal, "vfd.status.running.bit", 0, 0);
    ck_assert_double_eq(talk_value(&hal, "vfd.status.at-speed.bit"), 0);
    talk_end(&hal);
}
END_TEST

START_TEST(a_drive_that_was_away_is_told_its_speed_again)
{
    if (!start_drive())
        return;
    load_example();
    talk_do(&hal, "sets spindle-hz 10\nsets spindle-on 1");
    talk_wait(&hal, "vfd.status.at-speed.bit", 1, 1);
    process_stop(&drive, SIGKILL, LIMIT_MS);
    talk_wait(&hal, "vfd.status.stale", 1, 1);
    ck_assert_double_eq(talk_value(&hal, "vfd.status.connected"), 0);
    ck_assert(start_drive()); /* it stands still and knows nothing */
    talk_wait(&hal, "vfd.status.stale", 0, 0);
    talk_wait(&hal, "vfd.output.hz.float", 10, 10);
    talk_wait(&hal, "vfd.status.at-speed.bit", 1, 1);
    talk_end(&hal);
}
END_TEST

static void write_text(const char *const name, const mode_t mode, const char *const format, ...)
    __attribute__((format(printf, 3, 4)));
static void write_text(const char *const name, const mode_t mode, const char *const format, ...)
{
    FILE *const file = fopen(name, "we");
    va_list arguments;
    ck_assert_ptr_nonnull(file);
    va_start(arguments, format);
    ck_assert_int_ge(vfprintf(file, format, arguments), 0);
    va_end(arguments);
    ck_assert_int_eq(fclose(file), 0);
    ck_assert_int_eq(chmod(name, mode), 0);
}

/* The simulated drive is the one that LinuxCNC's driver for the real one knows. */
START_TEST(linuxcncs_driver_runs_the_simulated_drive_to_its_speed)
{
    static struct process halrun;
    static struct serial_pair pair;
    const char *const argv[] = {TEST_SOURCE "/tests/system/halrun-user", "peer.hal", NULL};
    serial_pair_open(&pair);
    snprintf(terminal, sizeof terminal, "%s", pair.device);
    write_text("wait", 0755,
               "#!/bin/sh\nuntil [ \"$(halcmd getp wj200-vfd.0.is-at-speed)\" = TRUE ]; do sleep 0.1; done\n");
    write_text("peer.hal", 0644,
               "loadusr -W wj200_vfd --device %s\nsetp wj200-vfd.0.mbslaveaddr 1\n"
               "setp wj200-vfd.0.commanded-frequency 15\nsetp wj200-vfd.0.reverse 1\nsetp wj200-vfd.0.enable 1\n"
               "setp wj200-vfd.0.run 1\nloadusr -w %s/wait\ngetp wj200-vfd.0.is-running\n",
               pair.client, folder);
    if (start_drive()) {
        (void)process_run(&halrun, argv, LIMIT_MS * 2);
        if (halrun.status == 77)
            printf("%s", halrun.text);
        else if (!process_wait_line(&halrun, "TRUE", 0, NULL))
            ck_abort_msg("the drive does not reach its speed: %.2000s", halrun.text);
    }
    serial_pair_close(&pair);
}
END_TEST

START_TEST(the_maps_of_the_examples_are_good)
{
    static struct process check;
    glob_t maps;
    ck_assert_int_eq(glob("examples/*.ini", 0, NULL, &maps), 0);
    ck_assert_uint_ge(maps.gl_pathc, 2);
    for (size_t i = 0; i < maps.gl_pathc; i++) {
        const char *const argv[] = {process_built("hm2modbus"), "--check", maps.gl_pathv[i], NULL};
        ck_assert_int_eq(process_run(&check, argv, LIMIT_MS), 0);
        if (strstr(check.text, "no effect"))
            ck_abort_msg("%s", check.text);
    }
    globfree(&maps);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("Modbus spindle");
    TCase *const tests = tcase_create("spindle");
    tcase_set_timeout(tests, 120);
    tcase_add_checked_fixture(tests, set_up, tear_down);
    tcase_add_test(tests, a_speed_command_leads_to_the_speed_and_back_to_rest);
    tcase_add_test(tests, linuxcncs_driver_runs_the_simulated_drive_to_its_speed);
    tcase_add_test(tests, the_maps_of_the_examples_are_good);
    tcase_add_test(tests, a_drive_that_was_away_is_told_its_speed_again);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
