/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * PPMC boards as programs see them: hm2ppmcsim, hm2ppmc, and examples/ppmc-encoders.hal with ppmc_epp in hm2host and in
 * LinuxCNC. The simulator turns the encoders, says what is true, and injects faults.
 */
#include <check.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "linuxcnc_peer.h"
#include "process.h"
#include "simulator.h"
#include "suite.h"

#define READY_MS   20000
#define END_MS     20000
#define CANNOT_RUN 77
#define LOOKS      200u /* at a pin, until it shows what it must */
#define LOOK_US    100000

static struct process sim, host, tool;
static char path[64];

/* ---- programs -----------------------------------------------------------------------------------------------------
 */

static void start_sim(const char *const board)
{
    const char *const argv[] = {process_built("hm2ppmcsim"), "--socket", path, "--do", "board 2", "--do", board, "--do",
                                "index 4.3 4000 100 4",      NULL};
    snprintf(path, sizeof path, "/tmp/check-ppmc-%d", (int)getpid());
    process_start_listening(&sim, argv);
    if (!process_wait_line(&sim, "ready ", READY_MS, NULL))
        ck_abort_msg("hm2ppmcsim is not ready: %s", sim.text);
    ck_assert_int_eq(chmod(path, 0666), 0); /* LinuxCNC runs as another user */
}

static void stop_sim(void)
{
    ck_assert_int_eq(process_stop(&sim, SIGTERM, END_MS), 0);
    ck_assert_int_ne(access(path, F_OK), 0);
}

/* The line that answers a command. */
static const char *ask_sim(const char *const command)
{
    static char answer[512];
    const size_t from = sim.len;
    process_say(&sim, command);
    process_say(&sim, "\n");
    for (unsigned i = 0; i < LOOKS; i++) {
        (void)process_wait_line(&sim, "never printed", 10, NULL); /* reads what there is */
        const char *const end = strchr(sim.text + from, '\n');
        if (!end)
            continue;
        snprintf(answer, sizeof answer, "%.*s", (int)(end - (sim.text + from)), sim.text + from);
        return answer;
    }
    ck_abort_msg("hm2ppmcsim does not answer \"%s\": %s", command, sim.text);
    return answer;
}

static void tell_sim(const char *const command)
{
    ck_assert_str_eq(ask_sim(command), "ok");
}

static int64_t truth(const char *const axis, const char *const what)
{
    char command[32];
    long long value = 0;
    snprintf(command, sizeof command, "show %s", axis);
    const char *const at = strstr(ask_sim(command), what);
    if (!at || sscanf(at + strlen(what), " %lld", &value) != 1)
        ck_abort_msg("%s of %s is not told", what, axis);
    return value;
}

static int run_tool(const char *const *arguments)
{
    char bus[80];
    const char *argv[16] = {process_built("hm2ppmc"), "--bus", bus};
    unsigned n = 3;
    snprintf(bus, sizeof bus, "sim:%s", path);
    while (*arguments)
        argv[n++] = *arguments++;
    argv[n] = NULL;
    return process_run(&tool, argv, END_MS);
}

/* ---- hm2ppmc -------------------------------------------------------------------------------------------------------
 */

static const struct {
    const char *arguments[5];
    int status;
    const char *said;
} runs[] = {
    {{"scan"},
     0,
     "slot  2  address 0x20-0x3F  ID 0x14  PPMC encoder board, 4 encoders, index, filter rate, timestamps\n"},
    {{"scan"}, 0, "slot  4  address 0x40-0x4F  ID 0x21  PPMC DAC16 board\n2 boards\n"},
    {{"identify", "4"}, 0, "ID 0x21"},
    {{"identify", "7"}, 1, "Slot 7: no board answers."},
    {{"identify"}, 2, "identify needs a slot"},
    {{"identify", "16"}, 2, "identify needs a slot"},
    {{"read", "2", "15"}, 0, "0x0F 14\n"},
    {{"read", "2", "0", "3"}, 0, "0x00 00\n0x01 00\n0x02 00\n"},
    {{"read", "3", "17"}, 1, "registers of this one 0 to 15"},
    {{"read", "9"}, 1, "Slot 9, register 0: no answer in time."},
    {{"filter", "2", "2.5"}, 0, "slot 2: encoder filter rate 2.5 MHz\n"},
    {{"filter", "2", "3"}, 2, "rates are 1, 2.5, 5 and 10 MHz, not 3"},
    {{"filter", "4", "5"}, 1, "has no filter rate register"},
    {{"filter", "6", "5"}, 1, "Slot 6: no board answers."},
    {{"watch", "--count", "2", "--period", "1"}, 0, "io errors 0, bad data 0, retries "},
    {{"watch", "--period", "0"}, 2, "--period needs"},
    {{"turn"}, 2, "unknown command turn"},
};

START_TEST(the_tool_says_what_is_there_and_what_is_wrong)
{
    start_sim("board 4 0x21");
    for (size_t i = 0; i < sizeof runs / sizeof runs[0]; i++) {
        const int status = run_tool(runs[i].arguments);
        if (status != runs[i].status || !strstr(tool.text, runs[i].said))
            ck_abort_msg("hm2ppmc %s: status %d: %.800s", runs[i].arguments[0], status, tool.text);
    }
    stop_sim();
}
END_TEST

START_TEST(watching_shows_live_counts_and_leaves_the_counters)
{
    static const char *const watch[] = {"watch", "--count", "3", "--period", "1", NULL};
    start_sim("board 4");
    tell_sim("rate 2.1 100000");
    usleep(50000);
    tell_sim("rate 2.1 0");
    for (unsigned i = 0; i < 2; i++) {
        char line[64];
        ck_assert_int_eq(run_tool(watch), 0);
        snprintf(line, sizeof line, "\n0\t%" PRId64 "\t0\t", truth("2.1", "counted"));
        ck_assert_msg(strstr(tool.text, line) != NULL, "no %s in %.500s", line, tool.text);
    }
    stop_sim();
}
END_TEST

START_TEST(a_bus_that_is_not_there_is_told)
{
    static const char *const scan[] = {"scan", NULL};
    snprintf(path, sizeof path, "/tmp/check-ppmc-none-%d", (int)getpid());
    ck_assert_int_eq(run_tool(scan), 1);
    ck_assert_ptr_nonnull(strstr(tool.text, "Start the simulated boards first"));
}
END_TEST

/* ---- the example in a host -----------------------------------------------------------------------------------------
 */

/* How many cycles of the boards at all rates are wanted, and from how many on the servo thread runs faster than the
 * example's. PPMC_CYCLES=1000000 takes four minutes in each host. */
#define SHORT_RUN 4000ul

static unsigned long wanted_cycles(void)
{
    const char *const asked = getenv("PPMC_CYCLES");
    const unsigned long cycles = asked ? strtoul(asked, NULL, 10) : 0;
    return cycles > SHORT_RUN ? cycles : SHORT_RUN;
}

/* All of the example up to its start, as commands of standard input. */
static void say_example(void)
{
    static const char period[] = "period1=1000000", fast[] = "period1=200000";
    char line[256];
    FILE *const file = fopen(TEST_SOURCE "/examples/ppmc-encoders.hal", "r");
    ck_assert_ptr_nonnull(file);
    while (fgets(line, sizeof line, file)) {
        char *const at = strstr(line, period);
        if (at && wanted_cycles() > SHORT_RUN)
            snprintf(at, sizeof line - (size_t)(at - line), "%s\n", fast);
        process_say(&host, line);
        if (strcmp(line, "start\n") == 0)
            break;
    }
    fclose(file);
}

/* A pin's value, or -1e9 when the host has not answered yet. */
static double look_at(const char *const pin)
{
    char command[96];
    const size_t from = host.len;
    double value = -1e9;
    snprintf(command, sizeof command, "getp %s\n", pin);
    process_say(&host, command);
    for (unsigned i = 0; i < LOOKS && !strchr(host.text + from, '\n') && !host.ended; i++)
        (void)process_wait_line(&host, "never printed", 20, NULL);
    const char *at = host.text + from;
    at += strncmp(at, "halcmd: ", 8) == 0 ? 8 : 0;
    if (strncmp(at, "TRUE", 4) == 0)
        return 1;
    if (strncmp(at, "FALSE", 5) == 0)
        return 0;
    (void)sscanf(at, "%lf", &value);
    return value;
}

static void expect_near(const char *const pin, const double wanted, const double tolerance)
{
    double found = 0;
    for (unsigned i = 0; i < LOOKS; i++) {
        found = look_at(pin);
        if (fabs(found - wanted) <= tolerance)
            return;
        usleep(LOOK_US);
    }
    printf("%s\n", host.text);
    ck_abort_msg("%s is %g, wanted %g", pin, found, wanted);
}

static void expect_pin(const char *const pin, const double wanted)
{
    expect_near(pin, wanted, 0);
}

#define BOARDS 2u

/* Latch pulses of both boards, one a cycle each. */
static unsigned long cycles_so_far(void)
{
    unsigned long latches = 0;
    (void)sscanf(ask_sim("stats"), "cycles %*u unanswered %*u latches %lu", &latches);
    return latches / BOARDS;
}

static void wait_for_cycles(const unsigned long count)
{
    const unsigned long end = cycles_so_far() + count;
    unsigned long now = 0, before = 0;
    for (unsigned idle = 0; now < end && idle < LOOKS; idle++) {
        usleep(count > SHORT_RUN ? 10 * LOOK_US : LOOK_US);
        now = cycles_so_far();
        if (now > before)
            idle = 0;
        before = now;
    }
    if (now < end) {
        printf("%s\n", host.text);
        ck_abort_msg("the example does not run: %lu cycles", now);
    }
}

/* A machine that stands still for a second while encoders turn at the filter's limit, or whose clock jumps, lets a
 * counter of 24 bits go round. The component says so; from then on its counts are right but for whole rounds. */
static bool went_round;

static void look_for_rounds(void)
{
    if (look_at("ppmc.0.board.02.position-lost") == 0 && look_at("ppmc.0.board.04.position-lost") == 0)
        return;
    went_round = true;
    printf("this machine stood still for so long that counters may have gone round\n");
    process_say(&host, "setp ppmc.0.board.02.position-lost 0\nsetp ppmc.0.board.04.position-lost 0\n");
}

static void expect_count(const unsigned encoder, const int64_t wanted)
{
    char pin[64];
    int32_t off = 1;
    snprintf(pin, sizeof pin, "ppmc.0.encoder.%02u.count", encoder);
    for (unsigned i = 0; i < LOOKS && off != 0; i++) {
        if (i > 0)
            usleep(LOOK_US);
        off = (int32_t)((uint32_t)(int64_t)look_at(pin) - (uint32_t)wanted);
        if (went_round)
            off &= 0xFFFFFF;
    }
    if (off == 0)
        return;
    printf("%s\n", host.text);
    ck_abort_msg("%s is %d away from %" PRId64, pin, off, wanted);
}

static void compare_all(void)
{
    static const char *const axes[] = {"2.0", "2.1", "2.2", "2.3", "4.0", "4.1", "4.2"};
    for (unsigned i = 0; i < 7; i++)
        expect_count(i, truth(axes[i], "counted"));
    expect_count(7, truth("4.3", "counted") - truth("4.3", "preset-at"));
}

/* Edges a second of encoders 0 to 6 in each part of a run, up to the limit of the filter; encoder 7 meets its index a
 * few times a second. */
static const struct {
    int rates[7], with_index;
} phases[] = {
    {{9000000, -500000, 1000, -33, 123456, 0, 7}, -20000},
    {{10000000, -10000000, 9999999, -2500000, 5000000, 1, -1}, 20000},
    {{0, 37, -999999, 10000000, -10000000, 1000000, -12345}, -30000},
    {{-10000000, 10000000, -10000000, 10000000, -10000000, 10000000, -10000000}, 25000},
};
#define PHASES (sizeof phases / sizeof phases[0])

static void turn(const unsigned encoder, const int rate)
{
    char command[64];
    snprintf(command, sizeof command, "rate %u.%u %d", encoder < 4 ? 2u : 4u, encoder % 4, rate);
    tell_sim(command);
}

static void turn_all(const unsigned phase, const bool on)
{
    for (unsigned i = 0; i < 7; i++)
        turn(i, on ? phases[phase].rates[i] : 0);
    turn(7, on ? phases[phase].with_index : 0);
}

static void run_phase(const unsigned phase, const unsigned long cycles)
{
    const int64_t presets = truth("4.3", "presets");
    process_say(&host, "setp ppmc.0.encoder.07.index-enable 1\n");
    expect_pin("ppmc.0.encoder.07.index-enable", 1);
    turn_all(phase, true);
    wait_for_cycles(cycles);
    expect_pin("ppmc.0.encoder.07.index-enable", 0);
    turn_all(phase, false);
    ck_assert_int_gt(truth("4.3", "presets"), presets);
    look_for_rounds();
    compare_all();
}

static void run_example(void)
{
    wait_for_cycles(1000);
    expect_pin("ppmc.0.encoder.07.index-enable", 1);
    const unsigned long start = cycles_so_far();
    for (unsigned i = 0; i < PHASES; i++)
        run_phase(i, wanted_cycles() / PHASES);
    if (!went_round)
        expect_near("ppmc.0.encoder.00.position", (double)truth("2.0", "counted") / 1000,
                    fabs((double)truth("2.0", "counted")) * 1e-8); /* of six digits */
    if (wanted_cycles() > SHORT_RUN)
        printf("%lu cycles, encoder 0 at %" PRId64 ", no difference%s; timeouts %g, bad data %g\n",
               cycles_so_far() - start, truth("2.0", "counted"), went_round ? " but whole rounds" : "",
               look_at("ppmc.0.timeouts"), look_at("ppmc.0.bad-data"));
    tell_sim("faults 1000 timeout zeros ones residue");
    turn_all(0, true);
    wait_for_cycles(2000);
    turn_all(0, false);
    tell_sim("faults 0");
    look_for_rounds();
    compare_all();
    expect_pin("ppmc.0.fault", 0);
    ck_assert(look_at("ppmc.0.timeouts") > 0 && look_at("ppmc.0.bad-data") > 0);
    tell_sim("cable off");
    expect_pin("ppmc.0.board.04.online", 0);
    tell_sim("cable on");
    expect_pin("ppmc.0.board.04.online", 1);
    compare_all();
}

START_TEST(the_example_counts_exactly_in_hm2host)
{
    const char *const argv[] = {process_built("hm2host"), NULL};
    start_sim("board 4");
    ck_assert_int_eq(setenv("PPMC", path, 1), 0);
    process_start_listening(&host, argv);
    say_example();
    run_example();
    process_hush(&host);
    ck_assert_msg(process_wait_end(&host, END_MS) && host.status == 0, "hm2host: %s", host.text);
    stop_sim();
}
END_TEST

START_TEST(the_example_counts_exactly_in_linuxcnc)
{
    const char *const argv[] = {TEST_SOURCE "/tests/system/halrun-user", "-", NULL};
    const char *skip;
    char seconds[32];
    if (!linuxcnc_loads_ours())
        return;
    start_sim("board 4");
    ck_assert_int_eq(setenv("PPMC", path, 1), 0);
    linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    snprintf(seconds, sizeof seconds, "%lu", 100 + wanted_cycles() / 1000);
    linuxcnc_tell("PEER_SECONDS", seconds);
    process_start_listening(&host, argv);
    say_example();
    if (process_wait_line(&host, "SKIP: ", 2000, &skip)) {
        printf("%s\n", skip);
        stop_sim();
        return;
    }
    run_example();
    process_hush(&host);
    ck_assert_msg(process_wait_end(&host, END_MS), "halrun: %s", host.text);
    stop_sim();
}
END_TEST

/* ---- boards whose shafts turn with the step generators of a card ---------------------------------------------------
 */

#define STEPGENS 5u

static void say(const char *const format, ...)
{
    char line[160];
    va_list args;
    va_start(args, format);
    vsnprintf(line, sizeof line, format, args);
    va_end(args);
    process_say(&host, line);
}

static void say_steps(const char *const address)
{
    say("loadrt hm2_lbp16 board_ip=%s config=num_stepgens=5\n", address);
    say("loadrt ppmc_epp bus=sim:%s enc_clock=0xA00,0xA02 expect=0x00,0x02\n", path);
    say("loadrt threads name1=servo period1=1000000\n");
    say("addf hm2_7i96s.0.read servo\naddf ppmc.0.read servo\n");
    say("addf hm2_7i96s.0.write servo\naddf ppmc.0.write servo\n");
    say("setp hm2_7i96s.0.packet-read-timeout 100000000\nsetp hm2_7i96s.0.watchdog.timeout_ns 4000000000\n");
    for (unsigned i = 0; i < STEPGENS; i++) {
        say("setp hm2_7i96s.0.stepgen.%02u.steplen 1000\nsetp hm2_7i96s.0.stepgen.%02u.stepspace 1000\n", i, i);
        say("setp hm2_7i96s.0.stepgen.%02u.maxaccel 0\nsetp hm2_7i96s.0.stepgen.%02u.maxvel 0\n", i, i);
        say("setp hm2_7i96s.0.stepgen.%02u.control-type 1\nsetp hm2_7i96s.0.stepgen.%02u.enable 1\n", i, i);
    }
    say("start\n");
}

static double pin_of(const char *const format, const unsigned number)
{
    char pin[64];
    snprintf(pin, sizeof pin, format, number);
    return look_at(pin);
}

/* At rest, which is soon, the encoders have counted the steps that the card says it has made. */
static void compare_steps(void)
{
    for (unsigned i = 0; i < STEPGENS; i++) {
        double steps = 0, count = 1;
        for (unsigned looks = 0; looks < LOOKS && count != steps; looks++) {
            usleep(LOOK_US);
            steps = pin_of("hm2_7i96s.0.stepgen.%02u.counts", i);
            count = pin_of("ppmc.0.encoder.%02u.count", i);
        }
        if (count != steps)
            ck_abort_msg("stepgen %u made %g steps, the encoder counted %g", i, steps, count);
    }
}

START_TEST(encoders_count_the_steps_of_a_simulated_card)
{
    static const double speeds[][STEPGENS] = {{400000, -123456, 1000, -33.5, 77777}, {-250000, 499000, -999, 0, 1}};
    static struct simulator card;
    const char *const argv[] = {process_built("hm2host"), NULL};
    snprintf(path, sizeof path, "/tmp/check-ppmc-%d", (int)getpid());
    simulator_start(&card, (const char *const[]){"--ppmc", path, NULL});
    process_start_listening(&host, argv);
    say_steps(card.address[0]);
    for (unsigned n = 0; n < 2; n++) {
        const double before = pin_of("ppmc.0.encoder.%02u.count", 1);
        for (unsigned i = 0; i < STEPGENS; i++)
            say("setp hm2_7i96s.0.stepgen.%02u.velocity-cmd %.1f\n", i, speeds[n][i]);
        for (unsigned i = 0; i < LOOKS && fabs(pin_of("ppmc.0.encoder.%02u.count", 1) - before) < 100000; i++)
            usleep(LOOK_US);
        for (unsigned i = 0; i < STEPGENS; i++)
            say("setp hm2_7i96s.0.stepgen.%02u.velocity-cmd 0\n", i);
        compare_steps();
        ck_assert(fabs(pin_of("ppmc.0.encoder.%02u.count", 1) - before) >= 100000);
    }
    process_hush(&host);
    ck_assert_msg(process_wait_end(&host, END_MS) && host.status == 0, "hm2host: %s", host.text);
    simulator_stop(&card);
    for (unsigned i = 0; i < STEPGENS; i++) {
        long long counted, edges, illegal;
        char start[64];
        const char *line;
        snprintf(start, sizeof start, "7i96s@%s:27181: ppmc %u.%u counted ", card.address[0], i / 4 * 2, i % 4);
        ck_assert_msg(process_wait_line(&card.process, start, 0, &line), "no %s in %s", start, card.process.text);
        ck_assert_int_eq(sscanf(line + strlen(start), "%lld of %lld edges, illegal %lld", &counted, &edges, &illegal),
                         3);
        ck_assert_int_eq(counted, edges);
        ck_assert_int_eq(illegal, 0);
    }
    ck_assert_int_ne(access(path, F_OK), 0);
}
END_TEST

/* ---- the cyclic path -----------------------------------------------------------------------------------------------
 */

/* The cycle stands in files of its own, which call nothing but memory functions, each other, and the bus by pointer. */
START_TEST(the_cycle_calls_nothing_that_allocates_locks_or_formats)
{
    static const char command[] =
        "cd " TEST_BUILD "/obj/lib/ppmc && nm -u cycle.o encoder.o restore.o | "
        "grep -vE '^$|:$| (memcmp|memcpy|memset|ppmc_[a-z_]*|_GLOBAL_OFFSET_TABLE_)$'; "
        "cd ../link && nm -u epp_port.o | "
        "grep -vE '^$|:$| (calloc|free|ioperm|strerror|__errno_location|hm2_diag_add|epp_monotonic_ns|"
        "_GLOBAL_OFFSET_TABLE_)$'";
    const char *const argv[] = {"sh", "-c", command, NULL};
    if (TEST_SANITIZED) {
        printf("SKIP: a sanitizer adds calls of its own\n");
        return;
    }
    (void)process_run(&tool, argv, END_MS);
    ck_assert_str_eq(tool.text, "");
}
END_TEST

/* The servo thread is the one that sends. strace(1) writes "PID call(...". */
START_TEST(the_servo_thread_makes_no_system_call_but_those_of_the_bus_and_its_sleep)
{
    char trace[96], command[1024];
    if (!process_find("strace") || TEST_SANITIZED) {
        printf("SKIP: strace is not installed, or a sanitizer makes calls of its own\n");
        return;
    }
    start_sim("board 4");
    ck_assert_int_eq(setenv("PPMC", path, 1), 0);
    snprintf(trace, sizeof trace, "%s.trace", path);
    snprintf(
        command, sizeof command,
        "strace -f -o %s %s %s/examples/ppmc-encoders.hal >/dev/null 2>&1 || { head -n 1 %s; exit 77; }\n"
        "servo=$(grep -m 400 -oE '^[0-9]+ +sendto' %s | tail -n 1 | cut -d' ' -f1)\n"
        "grep \"^$servo \" %s | grep -A100000 -m 1 sendto | grep -oE '^[0-9]+ +[a-z_0-9]+\\(' | sed 's/.* //' | sort | "
        "uniq -c",
        trace, process_built("hm2host"), TEST_SOURCE, trace, trace, trace);
    const char *const argv[] = {"sh", "-c", command, NULL};
    const int status = process_run(&tool, argv, 60000);
    unlink(trace);
    stop_sim();
    if (status == CANNOT_RUN) {
        printf("SKIP: strace cannot trace here: %s\n", tool.text);
        return;
    }
    unsigned sends = 0, kinds = 0;
    for (char *line = strtok(tool.text, "\n"); line; line = strtok(NULL, "\n")) {
        unsigned count;
        char name[32];
        ck_assert_int_eq(sscanf(line, "%u %31s", &count, name), 2);
        const bool once = strcmp(name, "exit(") == 0 || strcmp(name, "madvise(") == 0 ||
                          strcmp(name, "rt_sigprocmask(") == 0 || strcmp(name, "munmap(") == 0;
        const bool bus = strcmp(name, "sendto(") == 0 || strcmp(name, "ppoll(") == 0 || strcmp(name, "recvfrom(") == 0;
        if (!bus && strcmp(name, "clock_nanosleep(") != 0 && !(once && count <= 4))
            ck_abort_msg("the servo thread calls %s %u times", name, count);
        sends = strcmp(name, "sendto(") == 0 ? count : sends;
        kinds++;
    }
    ck_assert_uint_gt(sends, 300);
    ck_assert_uint_ge(kinds, 4);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("PPMC");
    TCase *const tests = tcase_create("programs");
    tcase_set_timeout(tests, 120 + (double)wanted_cycles() / 1000);
    tcase_add_test(tests, the_tool_says_what_is_there_and_what_is_wrong);
    tcase_add_test(tests, watching_shows_live_counts_and_leaves_the_counters);
    tcase_add_test(tests, a_bus_that_is_not_there_is_told);
    tcase_add_test(tests, the_example_counts_exactly_in_hm2host);
    tcase_add_test(tests, the_example_counts_exactly_in_linuxcnc);
    tcase_add_test(tests, the_cycle_calls_nothing_that_allocates_locks_or_formats);
    tcase_add_test(tests, the_servo_thread_makes_no_system_call_but_those_of_the_bus_and_its_sleep);
    suite_add_tcase(suite, tests);
    TCase *const steps = tcase_create("steps");
    tcase_set_timeout(steps, 120);
    tcase_add_test(steps, encoders_count_the_steps_of_a_simulated_card);
    suite_add_tcase(suite, steps);
    return run_suite(suite);
}
