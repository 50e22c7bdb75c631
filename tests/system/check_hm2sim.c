/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2sim as a program: options, cards on real UDP, faults and commands, and Debian's mesaflash as its client. */
#include <arpa/inet.h>
#include <check.h>
#include <errno.h>
#include <glob.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "process.h"
#include "suite.h"

#define READY_MS    10000
#define END_MS      5000
#define REPLY_MS    2000
#define SILENCE_MS  150
#define MESA_MS     20000
#define MESA_TRIES  5
#define MAX_ARGS    24
#define CYCLES      2000
#define CYCLE_NS    1000000
#define FLEET       8
#define US_PER_S    1e6
#define MAX_PAYLOAD 64
#define MAX_IMAGES  32 /* cards in one process */

static struct process sim, client;
static char address[16];

/* Start hm2sim on an address of this test's own and wait for its ready line. */
static void start_sim(const char *const *args)
{
    const char *argv[MAX_ARGS] = {process_built("hm2sim"), "--bind", address};
    unsigned n = 3;
    test_address(0, address);
    for (; args && *args; args++)
        argv[n++] = *args;
    argv[n] = NULL;
    process_start(&sim, argv);
    if (!process_wait_line(&sim, "ready ", READY_MS, NULL))
        ck_abort_msg("hm2sim is not ready: %s", sim.text);
}

static void stop_sim(void)
{
    ck_assert_int_eq(process_stop(&sim, SIGTERM, END_MS), 0);
}

/* ---- a client -----------------------------------------------------------------------------------------------------
 */

static int open_client(void)
{
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ck_assert_int_ge(fd, 0);
    return fd;
}

static struct sockaddr_in card_at(const char *const text)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons(27181)};
    ck_assert_int_eq(inet_pton(AF_INET, text, &at.sin_addr), 1);
    return at;
}

static size_t from_hex(const char *text, uint8_t bytes[const MAX_PAYLOAD])
{
    size_t len = 0;
    unsigned byte;
    int used;
    while (sscanf(text, " %2x%n", &byte, &used) == 1) {
        ck_assert_uint_lt(len, MAX_PAYLOAD);
        bytes[len++] = (uint8_t)byte;
        text += used;
    }
    return len;
}

static void send_hex(const int fd, const char *const to, const char *const hex)
{
    uint8_t bytes[MAX_PAYLOAD];
    const struct sockaddr_in at = card_at(to);
    const size_t len = from_hex(hex, bytes);
    ck_assert_int_eq(sendto(fd, bytes, len, 0, (const struct sockaddr *)&at, sizeof at), (ssize_t)len);
}

/* Length of the next datagram, -1 when none came in time. */
static ssize_t receive(const int fd, uint8_t bytes[const MAX_PAYLOAD], const int limit_ms, unsigned *const port)
{
    struct pollfd p = {.fd = fd, .events = POLLIN};
    struct sockaddr_in from = {0};
    socklen_t from_len = sizeof from;
    if (poll(&p, 1, limit_ms) <= 0)
        return -1;
    const ssize_t len = recvfrom(fd, bytes, MAX_PAYLOAD, 0, (struct sockaddr *)&from, &from_len);
    if (port)
        *port = ntohs(from.sin_port);
    return len;
}

/* Request and reply as hex; "" = no reply. */
static void exchange_with(const char *const to, const char *const request, const char *const expected)
{
    uint8_t want[MAX_PAYLOAD], got[MAX_PAYLOAD] = {0};
    const int fd = open_client();
    const size_t want_len = from_hex(expected, want);
    send_hex(fd, to, request);
    const ssize_t len = receive(fd, got, want_len > 0 ? REPLY_MS : SILENCE_MS, NULL);
    close(fd);
    if (len != (want_len > 0 ? (ssize_t)want_len : -1))
        ck_abort_msg("%s: reply of %zd bytes instead of %zu", request, len, want_len);
    if (want_len > 0)
        ck_assert_mem_eq(got, want, want_len);
}

static void exchange(const char *const request, const char *const expected)
{
    exchange_with(address, request, expected);
}

static uint32_t read_register(const unsigned at)
{
    char request[16];
    uint8_t reply[MAX_PAYLOAD] = {0};
    const int fd = open_client();
    snprintf(request, sizeof request, "0142%02X%02X", at & 0xFFu, at >> 8);
    send_hex(fd, address, request);
    ck_assert_int_eq(receive(fd, reply, REPLY_MS, NULL), 4);
    close(fd);
    return (uint32_t)reply[0] | (uint32_t)reply[1] << 8 | (uint32_t)reply[2] << 16 | (uint32_t)reply[3] << 24;
}

/* ---- control ------------------------------------------------------------------------------------------------------
 */

static char control_path[64], control_own[64];

static void name_control(void)
{
    snprintf(control_path, sizeof control_path, "/tmp/check-hm2sim-%d", (int)getpid());
    snprintf(control_own, sizeof control_own, "/tmp/check-hm2sim-%d-client", (int)getpid());
}

/* Send a command, expect this reply. */
static void command(const char *const text, const char *const expected)
{
    struct sockaddr_un own = {.sun_family = AF_UNIX}, to = {.sun_family = AF_UNIX};
    char reply[4096];
    snprintf(own.sun_path, sizeof own.sun_path, "%s", control_own);
    snprintf(to.sun_path, sizeof to.sun_path, "%s", control_path);
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ck_assert_int_eq(bind(fd, (const struct sockaddr *)&own, sizeof own), 0);
    ck_assert_int_ge(sendto(fd, text, strlen(text), 0, (const struct sockaddr *)&to, sizeof to), 0);
    struct pollfd p = {.fd = fd, .events = POLLIN};
    ck_assert_int_eq(poll(&p, 1, REPLY_MS), 1);
    const ssize_t len = recv(fd, reply, sizeof reply - 1, 0);
    close(fd);
    unlink(control_own);
    ck_assert_int_ge(len, 0);
    reply[len] = '\0';
    if (strncmp(reply, expected, strlen(expected)) != 0)
        ck_abort_msg("%s: \"%s\" instead of \"%s\"", text, reply, expected);
}

/* ---- start, end, options ------------------------------------------------------------------------------------------
 */

START_TEST(it_says_when_it_is_ready_and_ends_cleanly_at_either_signal)
{
    static const int signals[] = {SIGTERM, SIGINT};
    for (size_t i = 0; i < sizeof signals / sizeof signals[0]; i++) {
        char expected[64];
        start_sim(NULL);
        snprintf(expected, sizeof expected, "ready 7i96s@%s:27181\n", address);
        ck_assert_str_eq(sim.text, expected);
        exchange("01420001", "FECAAA55");
        ck_assert_int_eq(process_stop(&sim, signals[i], END_MS), 0);
        ck_assert_ptr_nonnull(strstr(sim.text, "requests 1 replies 1 send-errors 0\n"));
    }
}
END_TEST

START_TEST(help_and_version_are_printed)
{
    const char *const help[] = {process_built("hm2sim"), "--help", NULL};
    const char *const version[] = {process_built("hm2sim"), "--version", NULL};
    ck_assert_int_eq(process_run(&sim, help, END_MS), 0);
    ck_assert_ptr_nonnull(strstr(sim.text, "--card TYPE"));
    ck_assert_ptr_nonnull(strstr(sim.text, "7i93"));
    ck_assert_int_eq(process_run(&sim, version, END_MS), 0);
    ck_assert_int_eq(strncmp(sim.text, "hm2sim ", 7), 0);
}
END_TEST

static const char *const bad_options[][3] = {
    {"--card", "7i99", "expected TYPE"},
    {"--card", "7i96s@nowhere", "IPv4 address"},
    {"--card", "7i96s@127.0.0.1:70000", "port number"},
    {"--bind", "127.0.0", "IPv4 address"},
    {"--port", "x", "port number"},
    {"--seed", "-1", "a number"},
    {"--faults", "loss=2", "loss, dup"},
    {"--faults", "loss=0.1,", "loss, dup"},
    {"--faults", "speed=1", "loss, dup"},
    {"--faults", "delay=30-20", "loss, dup"},
    {"--faults", "loss=nan", "loss, dup"},
    {"--faults", "tail=0.1", "tail = 0..1:US"},
    {"--faults", "tail=0.1:2e6", "tail = 0..1:US"},
    {"--faults", "coalesce=-1", "coalesce = US"},
    {"--faults", "busy=10:20", "busy = US:US"},
    {"--faults", "sleep=10", "sleep = US:US"},
    {"--wire", "1", "FROM:TO"},
    {"--wire", "1:999999999999999999999", "FROM:TO"},
    {"--follow", "0:0:1/0", "ENCODER:STEPGEN"},
    {"--follow", "a", "ENCODER:STEPGEN"},
    {"--motor", "0:0", "ENCODER:PWMGEN:COUNTS"},
    {"--motor", "0:0:99999999999", "ENCODER:PWMGEN:COUNTS"},
    {"--resolver", "0", "CHANNEL:TURNS"},
    {"--resolver", "0:nan", "CHANNEL:TURNS"},
    {"--resolver", "0:0.5:1", "CHANNEL:TURNS:PWMGEN:SPEED"},
    {"--resolver", "0:0.5:1:1e7", "CHANNEL:TURNS:PWMGEN:SPEED"},
    {"--index", "0:0", "ENCODER:COUNTS"},
    {"--switch", "3:pwmgen.0:1:01", "IO:AXIS:POSITION:LEVELS"},
    {"--switch", "3:stepgen.0:1:0", "IO:AXIS:POSITION:LEVELS"},
    {"--drive", "3:2", "IO:LEVELS"},
    {"--drive", "3:01", "IO:LEVELS"},
    {"--mac", "00:11:22", "six bytes"},
    {"--run", "0", "seconds"},
    {"--realtime=100", NULL, "priority"},
    {"--remote", "0=7i77", "PORT:CHANNEL=CARD"},
    {"--remote", "0:0=7i99", "PORT:CHANNEL=CARD"},
    {"--servo", "0:0:1:AnalogOut0", "ENCODER:PORT:CHANNEL:OUTPUT:COUNTS"},
    {"--servo", "0:0:1::100", "ENCODER:PORT:CHANNEL:OUTPUT:COUNTS"},
    {"--servo", "0:0:1:AnalogOut0:100:-1", "ENCODER:PORT:CHANNEL:OUTPUT:COUNTS"},
    {"--7i65-motor", "0:0", "ENCODER:OUTPUT:COUNTS"},
    {"--7i65-motor", "0:0:100:-1", "ENCODER:OUTPUT:COUNTS"},
    {"--sources", "2022", "2021 or later"},
    {"--absolute", "ssi.0", "expected ssi.N"},
    {"--absolute", "ssi.0:value=1", "bits=1..128"},
    {"--absolute", "ssi.0:bits=129", "bits=1..128"},
    {"--absolute", "ssi.0:bits=8,position=1:8", "AT:WIDTH"},
    {"--absolute", "ssi.0:bits=8,speed=1", "AT:WIDTH"},
    {"--absolute", "ssi.0:bits=8,value=,", "value=HEX"},
    {"--absolute", "biss.0:bits=8,", "expected ssi.N"},
    {"--nonsense", NULL, "--nonsense"},
    {"stray", NULL, "not an option"},
};

START_TEST(a_bad_option_is_refused_with_a_sentence)
{
    const char *const argv[] = {process_built("hm2sim"), bad_options[_i][0], bad_options[_i][1], NULL};
    ck_assert_int_eq(process_run(&sim, argv, END_MS), 2);
    if (!strstr(sim.text, bad_options[_i][2]))
        ck_abort_msg("%s %s: %s", argv[1], argv[2] ? argv[2] : "", sim.text);
}
END_TEST

START_TEST(what_the_card_does_not_have_is_refused)
{
    static const char *const bad[][3] = {
        {"--wire", "0:60", "no such pin"},
        {"--drive", "60:1", "I/O 0 to 50"},
        {"--follow", "9:0", "no such encoder"},
        {"--follow", "0:9", "no such encoder"},
        {"--motor", "0:9:1", "no such encoder"},
        {"--resolver", "0:0", "no such resolver channel"},
        {"--index", "0:100", "no such encoder"},
        {"--switch", "60:stepgen.0:1:01", "I/O 0 to 50"},
        {"--switch", "1:stepgen.9:1:01", "no step generator 9"},
        {"--switch", "1:encoder.9:1:01", "no encoder 9"},
        {"--remote", "0:0=7i77", "no smart-serial port 0 channel 1"},
        {"--remote", "1:0=7i76", "no smart-serial port 1 channel 0"},
        {"--servo", "0:0:0:SpinOut:100", "no remote with such a numeric output"},
        {"--7i65-motor", "0:0:100", "no --7i65 with such an output"},
        {"--absolute", "ssi.0:bits=8", "no such reader (ssi 0)"},
        {"--absolute", "ssi.0:bits=8,position=0:8,with=stepgen.9", "no step generator 9"},
        {"--ppmc", "/nonexistent/socket", "No such file"},
        {"--firmware", "/nonexistent.hex", "/nonexistent.hex"},
        {"--name", "seventeen letters", "a card's name of 1 to 16 characters"},
        {"--bind", "192.0.2.1", "cannot listen"},
        {"--control", "/nonexistent/socket", "control socket"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        const char *const argv[] = {process_built("hm2sim"), "--port", "0", bad[i][0], bad[i][1], NULL};
        ck_assert_int_eq(process_run(&sim, argv, END_MS), 1);
        if (!strstr(sim.text, bad[i][2]))
            ck_abort_msg("%s %s: %s", bad[i][0], bad[i][1], sim.text);
    }
}
END_TEST

START_TEST(two_cards_at_one_address_are_refused)
{
    const char *const argv[] = {process_built("hm2sim"), "--card", "7i96s", "--card", "7i93", NULL};
    ck_assert_int_eq(process_run(&sim, argv, END_MS), 2);
    ck_assert_ptr_nonnull(strstr(sim.text, "same address"));
}
END_TEST

START_TEST(it_ends_by_itself_after_the_time_given)
{
    const char *const argv[] = {process_built("hm2sim"), "--port", "0", "--run", "0.2", "--quiet", NULL};
    ck_assert_int_eq(process_run(&sim, argv, END_MS), 0);
    const char *const line_end = strchr(sim.text, '\n');
    ck_assert(line_end && line_end[1] == '\0' && strncmp(sim.text, "ready ", 6) == 0);
}
END_TEST

START_TEST(several_cards_live_in_one_process)
{
    char second[16], spec[48];
    test_address(1, second);
    snprintf(spec, sizeof spec, "7i93@%s", second);
    start_sim((const char *const[]){"--card", "7i96s", "--mac", "00:60:1B:01:02:03", "--card", spec, NULL});
    exchange("885D0000", "37493936530000000000000000000000");
    exchange_with(second, "885D0000", "37493933000000000000000000000000");
    exchange("83490200", "0302 011B 6000");
    /* what one card is told the other does not know */
    exchange("01D91800 3412 01591800", "3412");
    exchange_with(second, "01591800", "0000");
    stop_sim();
}
END_TEST

START_TEST(another_firmware_can_be_loaded)
{
    start_sim((const char *const[]){"--card", "7i93", "--firmware", TEST_DATA "/idrom/SVST4_6NA_48.hex", NULL});
    ck_assert_uint_eq(read_register(0x0400), 3);
    ck_assert_uint_eq(read_register(0x0100), 0x55AACAFE);
    stop_sim();
}
END_TEST

/* So many cards in one process, each with the next image. */
static void run_images(char *const *const paths, const size_t count)
{
    static const char ready[] = "ready 7i93@";
    const char *argv[4 * MAX_IMAGES + 8] = {process_built("hm2sim"), "--bind", address, "--port", "0"};
    const char *line;
    unsigned n = 5, cards = 0;
    for (size_t i = 0; i < count; i++) {
        const char *const more[] = {"--card", "7i93", "--firmware", paths[i]};
        memcpy(argv + n, more, sizeof more);
        n += 4;
    }
    argv[n] = NULL;
    process_start(&sim, argv);
    if (!process_wait_line(&sim, ready, READY_MS, &line))
        ck_abort_msg("hm2sim is not ready: %s", sim.text);
    for (; *line && *line != '\n'; line++)
        cards += *line == '@';
    ck_assert_uint_eq(cards, count);
    stop_sim();
}

START_TEST(every_image_that_was_dumped_makes_a_card)
{
    glob_t images;
    test_address(0, address);
    ck_assert_int_eq(glob(TEST_DATA "/idrom/*.hex", 0, NULL, &images), 0);
    ck_assert_uint_eq(images.gl_pathc, 218);
    for (size_t i = 0; i < images.gl_pathc; i += MAX_IMAGES)
        run_images(images.gl_pathv + i, images.gl_pathc - i < MAX_IMAGES ? images.gl_pathc - i : MAX_IMAGES);
    globfree(&images);
}
END_TEST

START_TEST(a_card_may_report_another_name)
{
    start_sim((const char *const[]){"--card", "7i93", "--name", "litehm2", NULL});
    exchange("885D0000", "6C697465686D32000000000000000000");
    stop_sim();
}
END_TEST

/* ---- faults and commands ------------------------------------------------------------------------------------------
 */

START_TEST(faults_come_and_go_by_command)
{
    name_control();
    start_sim((const char *const[]){"--control", control_path, "--faults", "loss=1", NULL});
    exchange("01420001", "");
    command("faults none", "ok");
    exchange("01420001", "FECAAA55");
    command("freeze on", "ok");
    exchange("01420001", "");
    command("card 0 freeze off", "ok");
    exchange("01420001", "FECAAA55");
    command("faults loss=7", "error: ");
    command("card 1 freeze on", "error: no such card");
    command("explode", "error: commands are");
    command("freeze on\nfreeze off\n", "ok");
    command("freeze off\ncard 1 freeze on\nquit", "error: no such card");
    command("", "error: commands are");
    command("stats", "7i96s@");
    command("quit", "ok");
    ck_assert(process_wait_end(&sim, END_MS));
    ck_assert_int_eq(process_stop(&sim, SIGTERM, END_MS), 0);
    ck_assert_int_ne(access(control_path, F_OK), 0);
}
END_TEST

START_TEST(a_power_cycle_makes_the_card_forget_and_come_back)
{
    name_control();
    start_sim((const char *const[]){"--control", control_path, NULL});
    exchange("01D91800 3412 01591800", "3412");
    command("power-cycle", "ok");
    exchange("01591800", "");
    sleep(1);
    exchange("01591800", "0000");
    stop_sim();
}
END_TEST

START_TEST(a_stranger_sends_from_another_port)
{
    uint8_t got[MAX_PAYLOAD];
    unsigned strangers = 0, replies = 0, port;
    start_sim((const char *const[]){"--faults", "foreign=1", NULL});
    const int fd = open_client();
    send_hex(fd, address, "01420001");
    while (replies + strangers < 2 && receive(fd, got, REPLY_MS, &port) > 0) {
        replies += port == 27181;
        strangers += port != 27181;
    }
    close(fd);
    ck_assert_uint_eq(replies, 1);
    ck_assert_uint_eq(strangers, 1);
    stop_sim();
}
END_TEST

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

START_TEST(a_packet_that_waits_is_answered_after_its_wait)
{
    start_sim(NULL);
    const double start = seconds();
    exchange("01D10200 C8AF 01420001", "FECAAA55"); /* 45 ms */
    ck_assert_double_ge(seconds() - start, 0.044);
    stop_sim();
}
END_TEST

START_TEST(pads_are_driven_by_option_and_command)
{
    name_control();
    start_sim((const char *const[]){"--control", control_path, "--drive", "40:0", "--drive", "41:01:20", NULL});
    bool low = false, high = false;
    for (unsigned i = 0; i < 200 && !(low && high); i++) {
        const uint32_t port = read_register(0x1008); /* I/O 34 to 50 */
        ck_assert_uint_eq(port >> (40 - 34) & 1u, 0);
        low = low || !(port >> (41 - 34) & 1u);
        high = high || (port >> (41 - 34) & 1u);
        usleep(5000);
    }
    ck_assert(low && high);
    ck_assert_uint_eq(read_register(0x1008) >> (42 - 34) & 1u, 1);
    command("drive 42 0", "ok");
    ck_assert_uint_eq(read_register(0x1008) >> (42 - 34) & 1u, 0);
    command("pad 42", "z");
    exchange("01C20811 00010000", ""); /* I/O 42 becomes an output, low */
    command("pad 42", "0");
    command("drive 42 x", "error: ");
    command("drive 51 1", "error: ");
    stop_sim();
}
END_TEST

START_TEST(remotes_are_told_and_asked_by_command)
{
    static const struct {
        const char *command, *answer;
    } talk[] = {
        {"remote 0:0 get FieldVoltage", "24.0576"},
        {"remote 0:0 set input 0x80000001", "ok"},
        {"remote 0:0 get Input", "2147483649"},
        {"remote 0:0 get Output", "0"},
        {"remote 0:0 terminal 3", "z"},
        {"remote 0:0 error crc 2", "ok"},
        {"remote 0:0 short 0x8", "ok"},
        {"remote 0:0 fault 4", "ok"},
        {"remote 0:0 pull", "ok"},
        {"remote 0:0 plug", "ok"},
        {"remote 0:0 power-cycle", "ok"},
        {"remote 0:0 set Input 1 2", "error: remote PORT:CHANNEL set"},
        {"remote 0:0 set Input -1", "error: set"},
        {"remote 0:0 get Outputs", "error: get"},
        {"remote 0:0 error boredom 1", "error: error"},
        {"remote 0:1 pull", "error: remote PORT:CHANNEL of a remote that is there"},
        {"remote 0 pull", "error: remote PORT:CHANNEL of a remote that is there"},
        {"remote", "error: remote PORT:CHANNEL of a remote that is there"},
    };
    name_control();
    start_sim((const char *const[]){"--control", control_path, "--remote", "0:0=7i76", NULL});
    for (size_t i = 0; i < sizeof talk / sizeof talk[0]; i++)
        command(talk[i].command, talk[i].answer);
    stop_sim();
}
END_TEST

/* Step generator 0 has I/O 17 for its steps, some 610 of them a second. */
#define STEPS "01C20411 01000000 01C20412 01000000 01C20029 FFFFFFFF 01C20020 66660000"

START_TEST(wires_and_followers_close_the_loop)
{
    start_sim((const char *const[]){"--wire", "34:40", "--follow", "0:0:4/1", NULL});
    exchange("01C20811 01000000", ""); /* I/O 34 is an output, low */
    ck_assert_uint_eq(read_register(0x1008) >> (40 - 34) & 1u, 0);
    exchange("01C20810 01000000", "");
    ck_assert_uint_eq(read_register(0x1008) >> (40 - 34) & 1u, 1);
    exchange(STEPS, "");
    const uint16_t before = (uint16_t)read_register(0x3000);
    usleep(100000);
    const uint16_t moved = (uint16_t)(read_register(0x3000) - before);
    ck_assert_uint_ge(moved, 4 * 50);
    stop_sim();
}
END_TEST

static bool pad_becomes(const unsigned io, const unsigned level)
{
    for (unsigned i = 0; i < 4000; i++) { /* densely: there is no quiet moment between packets */
        if ((read_register(0x1000 + 4 * (io / 17)) >> (io % 17) & 1u) == level)
            return true;
        usleep(500);
    }
    return false;
}

START_TEST(an_axis_presses_its_switches)
{
    start_sim((const char *const[]){"--follow", "0:0", "--switch", "0:stepgen.0:100:01", "--switch",
                                    "0:encoder.0:300:h0", "--switch", "40:encoder.0:-50:0h", NULL});
    ck_assert(pad_becomes(0, 0) && pad_becomes(40, 1));
    exchange(STEPS, "");
    ck_assert(pad_becomes(0, 1)); /* from 100 on */
    ck_assert(pad_becomes(0, 0)); /* and 0 is stronger, from 300 on */
    ck_assert(pad_becomes(40, 1));
    exchange("01C20020 9A99FFFF", ""); /* and back */
    ck_assert(pad_becomes(0, 1));
    ck_assert(pad_becomes(0, 0));
    ck_assert(pad_becomes(40, 0)); /* below -50 */
    ck_assert_int_eq(process_stop(&sim, SIGTERM, END_MS), 0);
    const char *const position = strstr(sim.text, ": encoder 0 at -");
    ck_assert(position && strtol(strchr(position, '-'), NULL, 10) <= -50);
}
END_TEST

/* ---- load ---------------------------------------------------------------------------------------------------------
 */

static void cycle_all(const int fds[const FLEET], char addresses[const FLEET][16])
{
    uint8_t reply[MAX_PAYLOAD];
    for (unsigned i = 0; i < FLEET; i++) /* scratch write, IDROM words, DPLL and port, scratch back */
        send_hex(fds[i], addresses[i], "82D11000 01000200 88420004 01420076 03420010 82511000");
    for (unsigned i = 0; i < FLEET; i++)
        ck_assert_int_eq(receive(fds[i], reply, REPLY_MS, NULL), 32 + 4 + 12 + 4);
    for (unsigned i = 0; i < FLEET; i++) /* a cycle's write packet */
        send_hex(fds[i], addresses[i], "01C2000E 0000005A 85C20020 00000000 00000000 00000000 00000000 00000000");
}

START_TEST(eight_cards_at_1_khz_take_at_most_half_a_core)
{
    if (TEST_SANITIZED) {
        printf("SKIP: a sanitizer takes most of the time that would be measured\n");
        return;
    }
    char addresses[FLEET][16], specs[FLEET][48];
    const char *args[2 * FLEET + 1] = {NULL};
    int fds[FLEET];
    for (unsigned i = 0; i < FLEET; i++) {
        test_address(i + 1, addresses[i]);
        snprintf(specs[i], sizeof specs[i], "7i96s@%s", addresses[i]);
        args[2 * i] = "--card";
        args[2 * i + 1] = specs[i];
        fds[i] = open_client();
    }
    start_sim(args);
    struct timespec due;
    clock_gettime(CLOCK_MONOTONIC, &due);
    const double start = seconds();
    for (unsigned i = 0; i < CYCLES; i++) {
        cycle_all(fds, addresses);
        due.tv_nsec += CYCLE_NS;
        due.tv_sec += due.tv_nsec / 1000000000;
        due.tv_nsec %= 1000000000;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
    }
    const double wall = seconds() - start;
    for (unsigned i = 0; i < FLEET; i++)
        close(fds[i]);
    stop_sim();
    const double cpu = (double)(sim.usage.ru_utime.tv_sec + sim.usage.ru_stime.tv_sec) +
                       (double)(sim.usage.ru_utime.tv_usec + sim.usage.ru_stime.tv_usec) / US_PER_S;
    const double per_cycle_us = cpu / CYCLES * US_PER_S;
    printf("eight cards: %.0f us of processor time a cycle (%d cycles in %.2f s)\n", per_cycle_us, CYCLES, wall);
    /* Judged by cycle, not by wall time: a loaded machine runs fewer cycles a second. */
    ck_assert_double_le(per_cycle_us, 500.0);
}
END_TEST

/* ---- mesaflash ----------------------------------------------------------------------------------------------------
 */

/* It waits 2 ms for a card's first answer, once: on a busy machine that can be too short, so a few tries are granted
 * for that, and for nothing else. */
static void mesaflash(const char *const device, const char *const option, const char *const value)
{
    const char *const argv[] = {"mesaflash", "--device", device, "--addr", address, option, value, NULL};
    for (unsigned try = 0; try < MESA_TRIES; try++) {
        const int status = process_run(&client, argv, MESA_MS);
        if (status == 0 && !strstr(client.text, "No "))
            return;
        usleep(100000);
    }
    ck_abort_msg("mesaflash %s %s: status %d: %s", option, value ? value : "", client.status, client.text);
}

static void expect_lines(const char *const *lines)
{
    for (; *lines; lines++)
        if (!strstr(client.text, *lines))
            ck_abort_msg("\"%s\" is not in: %s", *lines, client.text);
}

static void try_mesaflash(const char *const device, const char *const *const hmid, const char *const *const pd,
                          const char *const width)
{
    if (!process_find("mesaflash")) {
        printf("SKIP: mesaflash is not installed\n");
        return;
    }
    start_sim((const char *const[]){"--realtime", "--card", device, NULL});
    mesaflash(device, "--readhmid", NULL);
    expect_lines(hmid);
    mesaflash(device, "--print-pd", NULL);
    expect_lines(pd);
    mesaflash(device, "--rpo", "0x0100");
    expect_lines((const char *const[]){"55AACAFE", NULL});
    mesaflash(device, "--wpo", "0x1100=0x5");
    mesaflash(device, "--rpo", "0x1100");
    expect_lines((const char *const[]){"00000005", NULL});
    mesaflash(device, "--rpo", "0x0428");
    expect_lines((const char *const[]){"05F5E100", NULL});
    mesaflash(device, "--rpo", "0x0424");
    expect_lines((const char *const[]){width, NULL});
    stop_sim();
}

START_TEST(mesaflash_reads_and_writes_a_7i96s)
{
    static const char *const hmid[] = {"BoardName : MESA7I96",
                                       "Number of IO Ports: 3",
                                       "Module: StepGen\n  There are 5",
                                       "Module: SSR",
                                       "TB1-2,3",
                                       "Step/Table1",
                                       "Input10",
                                       NULL};
    static const char *const pd[] = {"51 HM2 Pin Descriptors", "Secondary Tag: 0x23 (InM)",
                                     "Secondary Pin: 0xA0 (AC Ref", NULL};
    try_mesaflash("7i96s", hmid, pd, "00000011");
}
END_TEST

START_TEST(mesaflash_reads_and_writes_a_7i93)
{
    static const char *const hmid[] = {"BoardName : MESA7I93",
                                       "Number of IO Ports: 2",
                                       "Module: QCount\n  There are 8",
                                       "Quad-IDX",
                                       "/Enable",
                                       "BaseAddress: 4100",
                                       NULL};
    static const char *const pd[] = {"48 HM2 Pin Descriptors", "Secondary Tag: 0x04 (QCount)", NULL};
    try_mesaflash("7i93", hmid, pd, "00000018");
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2sim");
    TCase *const tests = tcase_create("program");
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, it_says_when_it_is_ready_and_ends_cleanly_at_either_signal);
    tcase_add_test(tests, help_and_version_are_printed);
    tcase_add_loop_test(tests, a_bad_option_is_refused_with_a_sentence, 0,
                        (int)(sizeof bad_options / sizeof bad_options[0]));
    tcase_add_test(tests, what_the_card_does_not_have_is_refused);
    tcase_add_test(tests, two_cards_at_one_address_are_refused);
    tcase_add_test(tests, it_ends_by_itself_after_the_time_given);
    tcase_add_test(tests, several_cards_live_in_one_process);
    tcase_add_test(tests, another_firmware_can_be_loaded);
    tcase_add_test(tests, every_image_that_was_dumped_makes_a_card);
    tcase_add_test(tests, a_card_may_report_another_name);
    tcase_add_test(tests, faults_come_and_go_by_command);
    tcase_add_test(tests, a_power_cycle_makes_the_card_forget_and_come_back);
    tcase_add_test(tests, a_stranger_sends_from_another_port);
    tcase_add_test(tests, a_packet_that_waits_is_answered_after_its_wait);
    tcase_add_test(tests, pads_are_driven_by_option_and_command);
    tcase_add_test(tests, remotes_are_told_and_asked_by_command);
    tcase_add_test(tests, wires_and_followers_close_the_loop);
    tcase_add_test(tests, an_axis_presses_its_switches);
    tcase_add_test(tests, eight_cards_at_1_khz_take_at_most_half_a_core);
    tcase_add_test(tests, mesaflash_reads_and_writes_a_7i96s);
    tcase_add_test(tests, mesaflash_reads_and_writes_a_7i93);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
