/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2doctor on states of computers that were kept, on round trips of known patterns, and on a simulated card. */
#include <check.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "folder.h"
#include "simulator.h"
#include "suite.h"

#define RUN_MS     30000
#define TUNED      TEST_DATA "/doctor/tuned"
#define DESKTOP    TEST_DATA "/doctor/desktop"
#define ROUNDS     2000
#define CANNOT_RUN 77

static struct process run;
static char folder[FOLDER_PATH];

static int doctor(const char *const *options)
{
    const char *argv[16] = {process_built("hm2doctor")};
    unsigned n = 1;
    while (*options && n < 15)
        argv[n++] = *options++;
    argv[n] = NULL;
    return process_run(&run, argv, RUN_MS);
}

#define DOCTOR(...) doctor((const char *const[]){__VA_ARGS__, NULL})

static void expect_line(const char *const grade, const char *const check, const char *const text)
{
    char start[32];
    const char *line;
    snprintf(start, sizeof start, "%-8s%-12s", grade, check);
    for (const char *at = run.text; (line = strstr(at, start)) != NULL; at = line + 1) {
        const char *const found = strstr(line, text);
        if (found && found < strchr(line, '\n'))
            return;
    }
    printf("%s\n", run.text);
    ck_abort_msg("no line \"%s ... %s\"", start, text);
}

/* ---- computers ----------------------------------------------------------------------------------------------------
 */

START_TEST(nothing_is_found_at_a_tuned_computer)
{
    ck_assert_int_eq(DOCTOR("--state", TUNED), 0);
    ck_assert_ptr_null(strstr(run.text, "advice"));
    ck_assert_ptr_null(strstr(run.text, "fault "));
    ck_assert_ptr_null(strstr(run.text, "unknown"));
    expect_line("ok", "route", "reached directly by enp2s0");
    expect_line("ok", "conflict", "one device has the address 192.168.1.121");
}
END_TEST

static const struct {
    const char *grade, *check, *text;
} of_desktop[] = {
    {"fault", "kernel", "apt-get install linux-image-rt-amd64"},
    {"advice", "throttling", "sysctl -w kernel.sched_rt_runtime_us=950000"},
    {"advice", "rtprio", "limit 0, needed 50"},
    {"advice", "memlock", "limit 8388608"},
    {"advice", "cpus", "isolcpus=3"},
    {"advice", "governor", "4 of 4 processors"},
    {"advice", "c-states", "C8 and needs 260 us"},
    {"fault", "link", "10 Mbit/s"},
    {"advice", "driver", "r8169"},
    {"advice", "coalescing", "ethtool -C enp3s0 rx-usecs 0 tx-usecs 0 adaptive-rx off"},
    {"advice", "eee", "ethtool --set-eee enp3s0 eee off"},
    {"advice", "offloads", "ethtool -K enp3s0 gro off"},
    {"advice", "offloads", "ethtool -K enp3s0 lro off"},
    {"advice", "queues", "ethtool -L enp3s0 combined 1"},
    {"advice", "sharing", "default route"},
    {"advice", "traffic", "340 packets pass enp3s0"},
    {"advice", "arp", "52:54:00:aa:bb:cc"},
    {"fault", "conflict",
     "2 devices have the address 192.168.1.121, among them 52:54:00:aa:bb:cc and 00:60:1b:16:01:02"},
    {"advice", "rp_filter", "net.ipv4.conf.enp3s0.rp_filter=2"},
    {"advice", "firewall", "27181"},
};

START_TEST(each_fault_of_a_desktop_computer_has_a_line_with_its_remedy)
{
    ck_assert_int_eq(DOCTOR("--state", DESKTOP), 1);
    for (size_t i = 0; i < sizeof of_desktop / sizeof of_desktop[0]; i++)
        expect_line(of_desktop[i].grade, of_desktop[i].check, of_desktop[i].text);
    ck_assert_ptr_nonnull(strstr(run.text, "interrupt 24"));
    ck_assert_ptr_null(strstr(run.text, "interrupt 25")); /* that of another network port, whose name is longer */
}
END_TEST

START_TEST(a_card_behind_a_gateway_and_one_without_a_way_are_told_apart)
{
    ck_assert_int_eq(DOCTOR("--state", DESKTOP, "--card", "10.10.10.10"), 1);
    expect_line("fault", "route", "through a gateway by enp3s0");
    ck_assert_int_eq(DOCTOR("--state", folder, "--card", "10.10.10.10"), 1);
    expect_line("fault", "route", "no way to 10.10.10.10");
}
END_TEST

START_TEST(an_address_that_this_computer_has_itself_is_a_conflict)
{
    ck_assert_int_eq(DOCTOR("--state", DESKTOP, "--card", "192.168.1.10"), 1);
    expect_line("fault", "conflict", "192.168.1.10 is an address of this computer, too");
    ck_assert_int_eq(DOCTOR("--state", DESKTOP, "--card", "192.168.1.255"), 1); /* there as broadcast, not as address */
    expect_line("unknown", "conflict", "shown to root only");
}
END_TEST

START_TEST(devices_at_the_cards_address_and_packets_on_its_line_are_counted)
{
    const char *const argv[] = {TEST_SOURCE "/tests/system/conflict-peer", TEST_BUILD, NULL};
    if (process_run(&run, argv, 2 * RUN_MS) == CANNOT_RUN) {
        printf("%s", run.text);
        return;
    }
    if (!strstr(run.text, "quiet: ok host is quiet") || !strstr(run.text, "loud: advice") ||
        !strstr(run.text, "packets pass host in a second") || !strstr(run.text, "alone: ok one device has") ||
        !strstr(run.text, "two: fault 2 devices have the address") ||
        !strstr(run.text, "own: fault 192.168.1.1 is an address of this computer"))
        ck_abort_msg("%s", run.text);
}
END_TEST

START_TEST(what_was_kept_is_judged_as_what_was_seen)
{
    static char seen[sizeof run.text];
    char kept[64];
    snprintf(kept, sizeof kept, "%s/kept", folder);
    ck_assert_int_eq(mkdir(kept, 0755), 0);
    ck_assert_int_eq(DOCTOR("--state", DESKTOP, "--save", kept), 1);
    snprintf(seen, sizeof seen, "%s", run.text);
    ck_assert_int_eq(DOCTOR("--state", kept), 1);
    ck_assert_str_eq(run.text, seen);
}
END_TEST

START_TEST(wrong_command_lines_are_refused)
{
    ck_assert_int_eq(DOCTOR("--period", "0"), 2);
    ck_assert_int_eq(DOCTOR("--card", "nowhere"), 2);
    ck_assert_int_eq(DOCTOR("--interface", "eth0;reboot"), 2);
    ck_assert_int_eq(DOCTOR("--apply", "--state", TUNED), 2);
    ck_assert_int_eq(DOCTOR("more"), 2);
    ck_assert_int_eq(DOCTOR("--rounds", "/nonexistent", "--state", TUNED), 3);
}
END_TEST

/* ---- round trips --------------------------------------------------------------------------------------------------
 */

struct pattern {
    int base_us, burst_us, spacing_us; /* usual values */
    int late_us, late_every;           /* each so-many-th is so late; 0 = none */
    const char *name;                  /* of the pattern; NULL = none is named */
};

static const struct pattern patterns[] = {
    {60, 58, 50, 0, 0, NULL},
    {130, 128, 1, 0, 0, "(coalescing)"},
    {110, 60, 50, 0, 0, "sleeps in between"},
    {60, 58, 50, 700, 50, "other packets are in the way"},
    {60, 58, 50, 150, 50, NULL}, /* late, and harmless */
};

static void write_rounds(const char *const path, const struct pattern *const pattern)
{
    FILE *const file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    for (int i = 0; i < ROUNDS; i++) {
        const bool late = pattern->late_every && i % pattern->late_every == 0;
        fprintf(file, "paced %d\n", (late ? pattern->late_us : pattern->base_us) * 1000 + i % 7 * 500);
        fprintf(file, "burst %d\nspacing %d\n", pattern->burst_us * 1000 + i % 5 * 500, pattern->spacing_us * 1000);
    }
    ck_assert_int_eq(fclose(file), 0);
}

START_TEST(each_pattern_of_delays_is_named)
{
    const struct pattern *const pattern = &patterns[_i];
    char path[64];
    snprintf(path, sizeof path, "%s/rounds", folder);
    write_rounds(path, pattern);
    ck_assert_int_eq(DOCTOR("--state", TUNED, "--rounds", path), pattern->name ? 1 : 0);
    if (pattern->name)
        expect_line("advice", "pattern", pattern->name);
    unsigned named = 0;
    for (const char *at = run.text; (at = strstr(at, "pattern ")) != NULL; at++)
        named++;
    ck_assert_uint_eq(named, pattern->name != NULL);
}
END_TEST

START_TEST(a_file_that_is_no_measurement_is_refused_with_its_line)
{
    char path[64];
    snprintf(path, sizeof path, "%s/rounds", folder);
    FILE *const file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    fputs("paced 1000\npaced -5\n", file);
    ck_assert_int_eq(fclose(file), 0);
    ck_assert_int_eq(DOCTOR("--state", TUNED, "--rounds", path), 3);
    ck_assert_ptr_nonnull(strstr(run.text, "rounds:2: expected"));
}
END_TEST

START_TEST(a_simulated_card_is_measured_kept_and_drawn)
{
    static struct simulator sim;
    char picture[64], rounds[64];
    struct stat status;
    snprintf(picture, sizeof picture, "%s/picture.svg", folder);
    snprintf(rounds, sizeof rounds, "%s/rounds", folder);
    simulator_start(&sim, NULL);
    const int result =
        DOCTOR("--card", sim.address[0], "--seconds", "1", "--save", folder, "--histogram", picture, "--json");
    ck_assert_int_le(result, 1);
    ck_assert_ptr_nonnull(strstr(run.text, "\"round_trip_us\":{\"count\":"));
    ck_assert_int_eq(stat(picture, &status), 0);
    ck_assert_int_eq(stat(rounds, &status), 0);
    ck_assert_int_gt(status.st_size, 10000); /* nearly a thousand round trips, and the others */
    simulator_stop(&sim);
}
END_TEST

/* Delays that a busy machine does not hide; what else it adds is its own affair. (test_doctor has exact ones.) */
static const struct {
    const char *faults, *name;
} networks[] = {
    {"coalesce=4000", "(coalescing)"},
    {"sleep=500:5000", "sleeps in between"},
    {"busy=20000:8000", "other packets are in the way"},
};

START_TEST(the_pattern_of_a_simulated_network_is_named)
{
    static struct simulator sim;
    simulator_start(&sim, (const char *const[]){"--faults", networks[_i].faults, NULL});
    ck_assert_int_eq(DOCTOR("--card", sim.address[0], "--seconds", "1"), 1);
    expect_line("advice", "pattern", networks[_i].name);
    simulator_stop(&sim);
}
END_TEST

START_TEST(a_card_that_does_not_answer_is_a_fault)
{
    ck_assert_int_eq(DOCTOR("--card", "127.66.66.66", "--seconds", "1", "--period", "100000"), 1);
    expect_line("fault", "round-trip", "does not answer");
}
END_TEST

static void make_folder(void)
{
    folder_make(folder, "doctor");
}

static void remove_folder(void)
{
    folder_remove(folder);
}

int main(void)
{
    Suite *const suite = suite_create("hm2doctor");
    TCase *const tests = tcase_create("doctor");
    tcase_set_timeout(tests, 90);
    tcase_add_checked_fixture(tests, make_folder, remove_folder);
    tcase_add_test(tests, nothing_is_found_at_a_tuned_computer);
    tcase_add_test(tests, each_fault_of_a_desktop_computer_has_a_line_with_its_remedy);
    tcase_add_test(tests, a_card_behind_a_gateway_and_one_without_a_way_are_told_apart);
    tcase_add_test(tests, an_address_that_this_computer_has_itself_is_a_conflict);
    tcase_add_test(tests, devices_at_the_cards_address_and_packets_on_its_line_are_counted);
    tcase_add_test(tests, what_was_kept_is_judged_as_what_was_seen);
    tcase_add_test(tests, wrong_command_lines_are_refused);
    tcase_add_loop_test(tests, each_pattern_of_delays_is_named, 0, (int)(sizeof patterns / sizeof patterns[0]));
    tcase_add_test(tests, a_file_that_is_no_measurement_is_refused_with_its_line);
    tcase_add_test(tests, a_simulated_card_is_measured_kept_and_drawn);
    tcase_add_loop_test(tests, the_pattern_of_a_simulated_network_is_named, 0,
                        (int)(sizeof networks / sizeof networks[0]));
    tcase_add_test(tests, a_card_that_does_not_answer_is_a_fault);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
