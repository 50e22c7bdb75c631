/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Serial ports of a simulated card as terminals: what a program writes comes back over the wire, or is counted. */
#include <check.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "simulator.h"
#include "talk.h"

#define BYTES   2000u
#define WAIT_MS 20000

static struct simulator sim;
static struct talk hal;
static char terminal[64];

static void start(void)
{
    static const char *const options[] = {"--card", "7i80hd-16",   "--firmware", TEST_DATA "/idrom/SVUA8_8_72.hex",
                                          "--uart", "uart.0:loop", NULL};
    snprintf(terminal, sizeof terminal, "/tmp/check-pty-%d", (int)getpid());
    simulator_start(&sim, options);
    talk_start(&hal, NULL);
    talk_do(&hal,
            "loadrt hm2_lbp16 board_ip=%s\nloadrt hm2_pty ports=hm2_7i80.0.uart.0 links=%s baud=57600\n"
            "loadrt threads name1=servo period1=1000000\naddf hm2_7i80.0.read servo\naddf hm2_7i80.0.write servo\n"
            "setp hm2_7i80.0.packet-read-timeout 20000000\nsetp hm2_7i80.0.packet-error-limit 1000000\n"
            "setp hm2_7i80.0.watchdog.timeout_ns 4000000000\nstart\nrun 0.3",
            sim.address[0], terminal);
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

/* Write and read until everything is back, or nothing has come for a while. */
static size_t round_trip(const int fd, const uint8_t *const bytes, uint8_t *const back)
{
    size_t written = 0, got = 0;
    for (unsigned idle_ms = 0; got < BYTES && idle_ms < WAIT_MS / 4;) {
        struct pollfd ready = {.fd = fd, .events = (short)(written < BYTES ? POLLIN | POLLOUT : POLLIN)};
        ck_assert_int_ge(poll(&ready, 1, 100), 0);
        const ssize_t out = written < BYTES ? write(fd, bytes + written, BYTES - written) : 0;
        const ssize_t in = read(fd, back + got, BYTES - got);
        written += out > 0 ? (size_t)out : 0;
        got += in > 0 ? (size_t)in : 0;
        idle_ms = in > 0 ? 0 : idle_ms + 100;
    }
    ck_assert_uint_eq(written, BYTES);
    return got;
}

START_TEST(what_is_written_to_the_terminal_comes_back_or_is_counted)
{
    uint8_t bytes[BYTES], back[BYTES];
    for (unsigned i = 0; i < BYTES; i++)
        bytes[i] = (uint8_t)(i * 7u);
    start();
    const int fd = open_terminal();
    const size_t got = round_trip(fd, bytes, back);
    /* A machine that holds the thread up loses bytes, which a UART with 16 words cannot keep. */
    const double lost = count("rx-overruns") + count("rx-uncertain") + count("tx-uncertain") + count("rx-errors");
    printf("%zu of %u bytes came back; losses counted: %.0f\n", got, BYTES, lost);
    if (lost == 0) {
        ck_assert_uint_eq(got, BYTES);
        ck_assert_mem_eq(back, bytes, BYTES);
    }
    ck_assert_uint_gt(got, 0);
    ck_assert_double_eq(count("rx-bytes"), (double)got);
    close(fd);
    talk_end(&hal);
    ck_assert_int_ne(access(terminal, F_OK), 0);
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
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, what_is_written_to_the_terminal_comes_back_or_is_counted);
    tcase_add_test(tests, a_port_that_is_not_there_is_refused);
    suite_add_tcase(suite, tests);
    SRunner *const runner = srunner_create(suite);
    srunner_run_all(runner, CK_ENV);
    const int failed = srunner_ntests_failed(runner);
    srunner_free(runner);
    return failed > 0;
}
