/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2lbp with simulated remotes: on a pseudo-terminal and behind a simulated card. */
#include <arpa/inet.h>
#include <check.h>
#include <pty.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "process.h"
#include "simulator.h"
#include "suite.h"

#define END_MS      20000
#define MAX_ARGS    16
#define CARD_PORT   27181
#define NAMES       40
#define DRIVEN_RUNS 20u

static struct simulator sim;
static struct process tool;
static char tty[64];
static const char *way[5]; /* the options that lead to the remote */

static void simulate_tty(const char *const remote)
{
    static char spec[128];
    snprintf(tty, sizeof tty, "/tmp/check-tty-%d", (int)getpid());
    snprintf(spec, sizeof spec, "%s@%s", remote, tty);
    simulator_start(&sim, (const char *const[]){"--serial", spec, NULL});
    way[0] = "--tty";
    way[1] = tty;
    way[2] = NULL;
}

static void simulate_card(const char *const channel)
{
    simulator_start(&sim, (const char *const[]){"--card", "7i96s_7i77d", "--remote", "0:1=7i77d", NULL});
    way[0] = "--card";
    way[1] = sim.address[0];
    way[2] = "--channel";
    way[3] = channel;
    way[4] = NULL;
}

/* Run it with these words behind the way; its status. */
static int run(const char *const *words)
{
    const char *argv[MAX_ARGS] = {process_built("hm2lbp")};
    unsigned n = 1;
    for (const char *const *word = way; *word; word++)
        argv[n++] = *word;
    for (; *words; words++) {
        ck_assert_uint_lt(n + 1, MAX_ARGS);
        argv[n++] = *words;
    }
    return process_run(&tool, argv, END_MS);
}
#define RUN(...) run((const char *const[]){__VA_ARGS__, NULL})

static void expect(const int status, const int wanted, const char *const text)
{
    ck_assert_msg(status == wanted && strstr(tool.text, text), "%d, and %d with \"%s\" expected: %s", status, wanted,
                  text, tool.text);
}

static void expect_value(const char *const name, const char *const value)
{
    char line[64];
    expect(RUN("read", name), 0, "");
    snprintf(line, sizeof line, "%s\n", value);
    ck_assert_str_eq(tool.text, line);
}

/* ---- parameters ---------------------------------------------------------------------------------------------------
 */

struct parameter {
    char name[64], access[8], value[32];
};

static unsigned list(struct parameter *const parameters)
{
    unsigned count = 0;
    expect(RUN("list"), 0, "unit number 0x1");
    const char *line = strchr(tool.text, '\n');
    for (; line && line[1]; line = strchr(line + 1, '\n')) {
        struct parameter *const p = &parameters[count++];
        ck_assert_uint_lt(count, NAMES);
        ck_assert_msg(sscanf(line + 1, "%63s %7s %*u bits %31s", p->name, p->access, p->value) == 3, "%s", line);
    }
    return count;
}

/* Writes to each parameter another value than it has, which the program reads back, and reads it with a new run of the
 * program. A card's port turns outputs off whenever it starts. */
static void make_round_trips(const unsigned least, const bool outputs_last)
{
    static struct parameter parameters[NAMES];
    unsigned written = 0;
    const unsigned count = list(parameters);
    for (unsigned i = 0; i < count; i++) {
        const struct parameter *const p = &parameters[i];
        char value[32];
        if (strcmp(p->access, "read") == 0) {
            expect(RUN("--yes", "write", p->name, p->value), 3, "can only be read");
            continue;
        }
        if (strcmp(p->name, "fault") == 0)
            continue;
        snprintf(value, sizeof value, "%lu", strtoul(p->value, NULL, 10) ^ 1u);
        expect(RUN("--yes", "write", p->name, value), 0, value);
        written++;
        if (outputs_last || strcmp(p->access, "write") != 0)
            expect_value(p->name, value);
    }
    ck_assert_uint_ge(written, least);
}

START_TEST(every_parameter_makes_the_round_trip_over_a_serial_port)
{
    static const char *const remotes[] = {"7i77-field", "7i77-analog", "7i76", "7i84"};
    simulate_tty(remotes[_i]);
    expect(RUN("--yes", "write", "watchdogtime", "0"), 0, "0");
    make_round_trips(6, true);
    simulator_stop(&sim);
    ck_assert_msg(access(tty, F_OK) != 0, "%s is still there", tty);
}
END_TEST

START_TEST(every_parameter_makes_the_round_trip_through_a_card)
{
    static const char *const channels[] = {"1", "2"};
    simulate_card(channels[_i]);
    make_round_trips(6, false);
    simulator_stop(&sim);
}
END_TEST

START_TEST(the_examples_of_the_manual_work)
{
    simulate_tty("7i77-field");
    setenv("BAUDRATE", "115200", 1);
    setenv("BAUDRATEMUL", "1", 1);
    setenv("PROTOCOL", "LBP", 1);
    setenv("INTERFACE", "OSDEVICE", 1);
    expect(RUN("--yes", "write", "NVWATCHDOGTIME", "100"), 0, "100\n");
    expect(RUN("read", "FAULT", "H"), 0, "01\n"); /* the watchdog's, as after every power-up */
    expect(RUN("write", "WATCHDOGTIME", "0"), 0, "0\n");
    expect(RUN("write", "OUTPUT", "AAAA", "H"), 0, "AAAA\n");
    expect_value("output", "43690");
    expect(RUN("--json", "read", "output"), 0, "{\"name\": \"output\", \"value\": \"43690\", \"bits\": 16, ");
    expect(RUN("--json", "list"), 0, "{\"card\": \"7I77\", ");
    simulator_stop(&sim);
}
END_TEST

START_TEST(modes_of_a_remote_have_their_own_process_data)
{
    simulate_card("1");
    expect(RUN("read", "enc0"), 2, "no parameter \"enc0\"");
    expect(RUN("--mode", "3", "read", "enc0"), 0, "0\n");
    simulator_stop(&sim);
}
END_TEST

/* ---- permanent changes --------------------------------------------------------------------------------------------
 */

START_TEST(a_permanent_change_needs_a_yes)
{
    simulate_tty("7i77-field");
    expect(RUN("write", "nvbaudrate", "4"), 3, "--yes permits it");
    expect_value("nvbaudrate", "9");
    static const char *const answers[] = {"n\n", "y\n"}, *const kept[] = {"9", "4"};
    for (unsigned i = 0; i < 2; i++) {
        char shown[512];
        int terminal, status;
        const char *const program = process_built("hm2lbp");
        const pid_t pid = forkpty(&terminal, NULL, NULL, NULL);
        ck_assert_int_ge(pid, 0);
        if (pid == 0) {
            execl(program, program, "--tty", tty, "write", "nvbaudrate", "4", (char *)NULL);
            _exit(127);
        }
        ck_assert_int_eq(write(terminal, answers[i], 2), 2);
        while (read(terminal, shown, sizeof shown) > 0)
            continue;
        ck_assert_int_eq(waitpid(pid, &status, 0), pid);
        ck_assert_int_eq(WEXITSTATUS(status), i == 0 ? 3 : 0);
        close(terminal);
        expect_value("nvbaudrate", kept[i]);
    }
    simulator_stop(&sim);
}
END_TEST

static const char *make_file(const char *const name, const size_t len, const int fill)
{
    static char path[128];
    char folder[] = "/tmp/check-hm2lbp-XXXXXX";
    ck_assert_ptr_nonnull(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *const file = fopen(path, "wb");
    ck_assert_ptr_nonnull(file);
    for (size_t i = 0; i < len; i++)
        fputc(fill, file);
    fclose(file);
    return path;
}

static void remove_file(const char *const path)
{
    char folder[128];
    unlink(path);
    snprintf(folder, sizeof folder, "%s", path);
    *strrchr(folder, '/') = '\0';
    rmdir(folder);
}

static const struct {
    const char *name;
    size_t len;
    int fill, status;
    const char *option, *says;
} images[] = {
    {"7I77.BIN", 4000, 0x5A, 0, "--yes", "4000 bytes written"},
    {"7i77v14.bin", 4000, 0x5A, 0, "--yes", "4000 bytes written"},
    {"7I77.BIN", 4000, 0x5A, 3, "--json", "--yes permits it"},
    {"7I76.BIN", 4000, 0x5A, 3, "--yes", "this remote is a 7I77"},
    {"7I77.BIT", 4000, 0x5A, 3, "--yes", "this remote is a 7I77"},
    {"7I77.BIN", 4000, 0, 3, "--yes", "nothing to write"},
    {"7I77.BIN", 512, 0x5A, 3, "--yes", "nothing to write"},
    {"7I77.BIN", 2000000, 0x5A, 3, "--yes", "expected up to 1048576"},
};

/* Each image over a serial line, and through a card. */
START_TEST(firmware_is_updated_and_wrong_images_are_refused)
{
    const unsigned i = (unsigned)_i / 2;
    if (_i % 2 == 0)
        simulate_tty("7i77-field");
    else
        simulate_card("1");
    if (_i % 2)
        simulator_do(&sim, "remote 0:1 jumper setup");
    const char *const path = make_file(images[i].name, images[i].len, images[i].fill);
    const int status = RUN(images[i].option, "update", path);
    remove_file(path);
    expect(status, images[i].status, images[i].says);
    simulator_stop(&sim);
}
END_TEST

/* ---- refusals -----------------------------------------------------------------------------------------------------
 */

START_TEST(firmware_needs_the_jumper_through_a_card_too)
{
    simulate_card("1");
    expect(RUN("--yes", "update", "7I77.BIN"), 4, "at the 115200 baud of its set-up jumper");
    simulator_do(&sim, "remote 0:1 jumper setup");
    expect(RUN("list"), 4, "no remote answers at port 0, channel 1");
    simulator_do(&sim, "remote 0:1 jumper operate");
    expect(RUN("list"), 0, "unit number 0x1");
    simulator_stop(&sim);
}
END_TEST

START_TEST(who_does_not_answer_is_told_from_what_is_wrong)
{
    simulate_card("3");
    expect(RUN("list"), 4, "no remote answers at port 0, channel 3");
    way[3] = "1";
    expect(RUN("--port", "3", "list"), 2, "this firmware has 1 of them");
    simulator_do(&sim, "freeze on");
    expect(RUN("list"), 4, "requests");
    simulator_stop(&sim);
}
END_TEST

/* What a driver does to a card, faster. */
static pid_t drive(const char *const address)
{
    const pid_t pid = fork();
    ck_assert_int_ge(pid, 0);
    if (pid > 0)
        return pid;
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(CARD_PORT)};
    (void)inet_pton(AF_INET, address, &to.sin_addr);
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    for (;;) {
        (void)!sendto(fd, "\x01\x42\x00\x01", 4, 0, (const struct sockaddr *)&to, sizeof to);
        nanosleep(&(struct timespec){.tv_nsec = 200000}, NULL);
    }
}

START_TEST(a_card_that_is_driven_is_left_alone)
{
    simulate_card("1");
    const pid_t driver = drive(sim.address[0]);
    int status = RUN("list");
    for (unsigned i = 1; i < DRIVEN_RUNS && status == 0; i++) /* the machine may let the driver sleep for a while */
        status = RUN("list");
    kill(driver, SIGKILL);
    (void)waitpid(driver, NULL, 0);
    expect(status, 3, "Another program talks to this card");
    expect(RUN("read", "fault"), 0, "");
    simulator_stop(&sim);
}
END_TEST

static const struct {
    const char *words[5];
    const char *says;
} mistakes[] = {
    {{"lust"}, "expected list"},
    {{"read"}, "expected list"},
    {{"read", "fault", "B"}, "expected list"},
    {{"write", "nvbaudrate", "12"}, "limits"},
    {{"write", "output", "AAAAAAAAAAAA", "H"}, "16 bits"},
    {{"write", "output", "x"}, "decimal"},
    {{"read", "nv"}, "beginning of several"},
    {{"--baud", "fast", "list"}, "--baud \"fast\""},
    {{"--baud", "1250000", "list"}, "Baud rate 1250000"},
    {{"--card", "127.0.0.1", "list"}, "either --tty or --card"},
    {{"--channel", "8", "list"}, "0 to 7"},
};

START_TEST(mistakes_are_told)
{
    simulate_tty("7i77-field");
    expect(run(mistakes[_i].words), 2, mistakes[_i].says);
    simulator_stop(&sim);
}
END_TEST

START_TEST(another_protocol_in_the_environment_is_refused)
{
    simulate_tty("7i77-field");
    setenv("PROTOCOL", "MODBUS", 1);
    expect(RUN("list"), 2, "PROTOCOL \"MODBUS\"");
    simulator_stop(&sim);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2lbp");
    TCase *const tests = tcase_create("program");
    tcase_set_timeout(tests, 60);
    tcase_add_loop_test(tests, every_parameter_makes_the_round_trip_over_a_serial_port, 0, 4);
    tcase_add_loop_test(tests, every_parameter_makes_the_round_trip_through_a_card, 0, 2);
    tcase_add_test(tests, the_examples_of_the_manual_work);
    tcase_add_test(tests, modes_of_a_remote_have_their_own_process_data);
    tcase_add_test(tests, a_permanent_change_needs_a_yes);
    tcase_add_loop_test(tests, firmware_is_updated_and_wrong_images_are_refused, 0,
                        2 * (int)(sizeof images / sizeof images[0]));
    tcase_add_test(tests, firmware_needs_the_jumper_through_a_card_too);
    tcase_add_test(tests, who_does_not_answer_is_told_from_what_is_wrong);
    tcase_add_test(tests, a_card_that_is_driven_is_left_alone);
    tcase_add_loop_test(tests, mistakes_are_told, 0, (int)(sizeof mistakes / sizeof mistakes[0]));
    tcase_add_test(tests, another_protocol_in_the_environment_is_refused);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
