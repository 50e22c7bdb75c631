/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Serial ports of a simulated card as terminals: what a program writes comes back over the wire, or is counted. */
#include <check.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "simulator.h"
#include "suite.h"
#include "talk.h"

/* How much goes round; with HM2_PTY_BYTES in the environment so much instead, which takes a minute for each 600 kB at
 * 115200 baud: 10000000 is what the component is judged by. */
#define LONG_LIMIT_S 3000
#define SILENCE_MS   5000

static struct simulator sim;
static struct talk hal;
static char terminal[64];

static const struct line {
    const char *name, *firmware, *port, *options;
    size_t bytes;
    bool fast; /* the card must not be late by a few milliseconds */
} lines[] = {
    {"UART, 57600", "idrom/SVUA8_8_72", "uart.0", "baud=57600", 2000, false},
    {"packet UART, 115200", "hm2_pty/PKTUART_0", "pktuart.0", "baud=115200 drive=on", 8000, false},
    {"packet UART, 1 Mbaud", "hm2_pty/PKTUART_1", "pktuart.0", "baud=1000000 drive=on", 60000, true},
};
#define LINES (int)(sizeof lines / sizeof lines[0])

static void start(const struct line *const line)
{
    char firmware[256], loop[32];
    snprintf(firmware, sizeof firmware, TEST_DATA "/%s.hex", line->firmware);
    snprintf(loop, sizeof loop, "%s:loop", line->port);
    const char *const options[] = {"--card", "7i80hd-16", "--firmware", firmware, "--uart", loop, "--realtime", NULL};
    snprintf(terminal, sizeof terminal, "/tmp/check-pty-%d", (int)getpid());
    simulator_start(&sim, options);
    talk_start(&hal, NULL);
    talk_do(&hal,
            "loadrt hm2_lbp16 board_ip=%s\nloadrt hm2_pty ports=hm2_7i80.0.%s links=%s %s\n"
            "loadrt threads name1=servo period1=1000000\naddf hm2_7i80.0.read servo\naddf hm2_7i80.0.write servo\n"
            "setp hm2_7i80.0.packet-read-timeout 500000000\nsetp hm2_7i80.0.packet-error-limit 1000000\n"
            "setp hm2_7i80.0.watchdog.timeout_ns 4000000000\nstart\nrun 0.3",
            sim.address[0], line->port, terminal, line->options);
}

static int open_terminal(void)
{
    struct termios settings;
    const int fd = open(terminal, O_RDWR | O_NOCTTY | O_NONBLOCK);
    ck_assert_int_ge(fd, 0);
    ck_assert_int_eq(tcgetattr(fd, &settings), 0);
    cfmakeraw(&settings);
    ck_assert_int_eq(tcsetattr(fd, TCSANOW, &settings), 0);
    return fd;
}

static double count(const char *const name)
{
    char pin[64];
    snprintf(pin, sizeof pin, "hm2-pty.0.%s", name);
    return talk_value(&hal, pin);
}

static size_t bytes_of(const struct line *const line)
{
    const char *const wanted = getenv("HM2_PTY_BYTES");
    return wanted ? strtoul(wanted, NULL, 10) : line->bytes;
}

/* With a period that no buffer has. */
static uint8_t pattern(const size_t n)
{
    return (uint8_t)(n * 31u + n / 251u);
}

struct trip {
    size_t bytes, written, got, wrong; /* wrong: bytes that are not what was written at their place */
};

static size_t put_some(const int fd, const struct trip *const trip)
{
    uint8_t bytes[512];
    size_t n = 0;
    for (; n < sizeof bytes && trip->written + n < trip->bytes; n++)
        bytes[n] = pattern(trip->written + n);
    const ssize_t out = n > 0 ? write(fd, bytes, n) : 0;
    return out > 0 ? (size_t)out : 0;
}

static size_t get_some(const int fd, struct trip *const trip)
{
    uint8_t bytes[512];
    const ssize_t in = read(fd, bytes, sizeof bytes);
    for (ssize_t i = 0; i < in; i++)
        trip->wrong += bytes[i] != pattern(trip->got + (size_t)i);
    return in > 0 ? (size_t)in : 0;
}

/* Write and read until everything is back, or nothing has come for a while. */
static struct trip round_trip(const int fd, const size_t bytes)
{
    struct trip trip = {.bytes = bytes};
    for (unsigned idle_ms = 0; trip.got < bytes && idle_ms < SILENCE_MS;) {
        const short events = (short)(trip.written < bytes ? POLLIN | POLLOUT : POLLIN);
        struct pollfd ready = {.fd = fd, .events = events};
        ck_assert_int_ge(poll(&ready, 1, 100), 0);
        const size_t out = put_some(fd, &trip), in = get_some(fd, &trip);
        trip.written += out;
        trip.got += in;
        idle_ms = in > 0 ? 0 : ready.revents ? idle_ms : idle_ms + 100;
    }
    return trip;
}

/* Returns how often something was lost, as counted: replies, or what a card's buffer could not keep. A thread that was
 * late leaves bytes uncertain, but costs a packet UART none in a loop. */
static double tell(const struct line *const line, const struct trip *const trip)
{
    static const char *const losses[] = {"rx-errors", "rx-overruns", "tx-uncertain"};
    const double replies = talk_value(&hal, "hm2_7i80.0.packet-lost");
    double lost = replies;
    printf("%s: %zu of %zu bytes came back, %zu not in their place", line->name, trip->got, trip->bytes, trip->wrong);
    for (size_t i = 0; i < sizeof losses / sizeof losses[0]; i++) {
        lost += count(losses[i]);
        printf(", %s %.0f", losses[i], count(losses[i]));
    }
    printf(", rx-uncertain %.0f, replies lost %.0f\n", count("rx-uncertain"), replies);
    return lost;
}

START_TEST(what_is_written_to_the_terminal_comes_back_or_is_counted)
{
    const struct line *const line = &lines[_i];
    if (TEST_SANITIZED && line->fast) {
        printf("SKIP: a sanitizer makes the simulated card slower than its line\n");
        return;
    }
    start(line);
    const int fd = open_terminal();
    const struct trip trip = round_trip(fd, bytes_of(line));
    ck_assert_uint_eq(trip.written, trip.bytes);
    const double lost = tell(line, &trip);
    if (lost == 0) {
        ck_assert_uint_eq(trip.got, trip.bytes);
        ck_assert_uint_eq(trip.wrong, 0);
    }
    ck_assert_double_eq(count("rx-bytes"), (double)trip.got);
    close(fd);
    talk_end(&hal);
    ck_assert_int_ne(access(terminal, F_OK), 0);
    simulator_stop(&sim);
}
END_TEST

static void set_speed(const int fd, const speed_t speed)
{
    struct termios settings;
    ck_assert_int_eq(tcgetattr(fd, &settings), 0);
    ck_assert_int_eq(cfsetspeed(&settings, speed), 0);
    ck_assert_int_eq(tcsetattr(fd, TCSANOW, &settings), 0);
}

/* Register map 3.13: rate = baud * 2^20 / clock. */
static uint32_t rate_register(void)
{
    return simulator_read(&sim, 0, 0x6200) & 0xFFFFFu;
}

static uint32_t rate_of(const double baud)
{
    return (uint32_t)(baud * 1048576.0 / 1e8 + 0.5);
}

START_TEST(the_port_follows_the_speed_that_a_program_sets)
{
    static const struct line line = {"following", "hm2_pty/PKTUART_1", "pktuart.0", "baud=9600 drive=on follow=1", 0,
                                     false};
    start(&line);
    const int fd = open_terminal();
    struct termios settings;
    ck_assert_int_eq(tcgetattr(fd, &settings), 0);
    ck_assert_uint_eq(cfgetospeed(&settings), B9600);
    ck_assert_uint_eq(rate_register(), rate_of(9600));
    set_speed(fd, B1000000);
    talk_wait(&hal, "hm2-pty.0.baud", 1000000, 1000000);
    talk_do(&hal, "run 0.1");
    ck_assert_uint_eq(rate_register(), rate_of(1000000));
    const struct trip trip = round_trip(fd, 100);
    const double lost = tell(&line, &trip);
    ck_assert_uint_gt(trip.got, 0);
    if (lost == 0)
        ck_assert_uint_eq(trip.got, 100);
    close(fd);
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(a_port_that_is_not_there_is_refused)
{
    simulator_start(&sim, NULL);
    talk_start(&hal, NULL);
    talk_do(&hal, "loadrt hm2_lbp16 board_ip=%s", sim.address[0]);
    ck_assert_ptr_nonnull(strstr(talk_try(&hal, "loadrt hm2_pty ports=hm2_7i96s.0.uart.0"), "hm2_7i96s.0.uart.0"));
    ck_assert_ptr_nonnull(strstr(talk_try(&hal, "loadrt hm2_pty"), "no port given"));
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2_pty");
    TCase *const tests = tcase_create("terminals");
    for (int i = 0; i < LINES; i++) { /* CK_RUN_CASE picks one */
        TCase *const one = tcase_create(lines[i].name);
        tcase_set_timeout(one, getenv("HM2_PTY_BYTES") ? LONG_LIMIT_S : 60);
        tcase_add_loop_test(one, what_is_written_to_the_terminal_comes_back_or_is_counted, i, i + 1);
        suite_add_tcase(suite, one);
    }
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, the_port_follows_the_speed_that_a_program_sets);
    tcase_add_test(tests, a_port_that_is_not_there_is_refused);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
