/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A 7I77, a 7I76, a step generator and an encoder in pipelined cycles over real UDP, under hm2host and under LinuxCNC:
 * what goes to them and comes back is what plain cycles show, and when the card was away, or its replies were late, it
 * begins again by itself. The period is long, so that there is room in it on a busy machine; where there is none, plain
 * cycles go on and nothing can be compared.
 */
#include <check.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "linuxcnc_peer.h"
#include "simulator.h"
#include "suite.h"
#include "talk.h"

#define CARD       "hm2_7i96s.0"
#define STEPS      4u
#define BEGIN_MS   60000
#define AGAIN_MS   240000 /* a reply that was late in a plain cycle is remembered for some seconds */
#define LOOK_MS    50
#define LOOKS      1200u
#define TIMER_US   3000u /* cycles of a busy machine are not regular */
#define ROWS       60u
#define STEPS_A_S  1000.0
#define PATH_FILE  "pipelined-path.csv"
#define OUT        TEST_BUILD "/pipelined"
#define REMOTES    "--remote", "0:0=7i77", "--remote", "0:2=7i76", "--follow", "0:0"
#define BEGUN      "the cycle is pipelined now"
#define PLAIN      "plain cycles again"
#define LOST_STATE "the card has lost its state"

static struct simulator sim;
static struct talk hal;

/* ---- hosts --------------------------------------------------------------------------------------------------------
 */

struct host {
    const char *name, *folder, *ready;
    bool (*start)(void); /* false: skipped, which was said */
    void (*card_goes)(void);
    void (*card_comes)(void);
};

static bool start_hm2host(void)
{
    simulator_start(&sim, (const char *const[]){"--card", "7i96s_7i77d", REMOTES, NULL});
    talk_start(&hal, NULL);
    return true;
}

static void freeze(void)
{
    simulator_do(&sim, "freeze on");
}

static void thaw(void)
{
    simulator_do(&sim, "freeze off");
}

static bool start_linuxcnc(void)
{
    snprintf(sim.control, sizeof sim.control, "/tmp/check-sim-%d", (int)getpid());
    snprintf(sim.address[0], sizeof sim.address[0], "192.168.1.121");
    linuxcnc_tell("PEER_TIMEOUT", "600");
    return linuxcnc_talk(&hal, OUT, "7i96s_7i77d", (const char *const[]){"--control", sim.control, REMOTES, NULL});
}

static void unplug(void)
{
    talk_do(&hal, "loadusr -w $(PEER_ASK) unplug");
}

static void plug(void)
{
    talk_do(&hal, "loadusr -w $(PEER_ASK) plug");
}

static const struct host hosts[] = {
    {"hm2host", TEST_BUILD, "", start_hm2host, freeze, thaw},
    {"LinuxCNC", "$(PEER_OUT)", "loadusr -w $(PEER_ARRANGE)", start_linuxcnc, unplug, plug},
};
#define HOSTS ((int)(sizeof hosts / sizeof hosts[0]))

static bool run(const struct host *const host, const char *const config)
{
    if (!host->start())
        return false;
    talk_do(&hal,
            "loadrt hm2_lbp16 board_ip=%s debug=2 config=\"%snum_encoders=8 num_stepgens=1 "
            "sserial_port_0=302xxxxx\"",
            sim.address[0], config);
    talk_do(&hal, "loadrt recorder pins=3 depth=%u file=%s/" PATH_FILE, ROWS, host->folder);
    talk_do(&hal, "loadrt threads name1=servo period1=20000000\naddf " CARD ".read servo\naddf recorder.sample servo\n"
                  "addf " CARD ".write servo");
    talk_do(&hal, "setp " CARD ".packet-read-timeout 100000000\nsetp " CARD ".packet-error-limit 100000000");
    talk_do(&hal, "setp " CARD ".watchdog.timeout_ns 4000000000\nsetp " CARD ".sserial.port-0.fault-lim 100000\n"
                  "setp " CARD ".auto-rearm 1");
    talk_do(&hal, "setp " CARD ".7i77.0.0.watchdogtimeout 60000\nsetp " CARD ".7i77.0.1.watchdogtimeout 60000\n"
                  "setp " CARD ".7i76.0.2.watchdogtimeout 60000");
    talk_do(&hal, "setp " CARD ".7i77.0.1.analogena 1\nsetp " CARD ".7i76.0.2.spinena 1");
    talk_do(&hal, "setp " CARD ".stepgen.00.steplen 1000\nsetp " CARD ".stepgen.00.stepspace 1000\n"
                  "setp " CARD ".stepgen.00.maxvel 2000\nsetp " CARD ".stepgen.00.maxaccel 10000\n"
                  "setp " CARD ".stepgen.00.enable 1");
    talk_do(&hal, "%s\nstart", host->ready);
    talk_wait(&hal, CARD ".sserial.port-0.port_state", 3, 3);
    return true;
}

static void end(const struct host *const host)
{
    talk_end(&hal);
    if (host->start == start_hm2host)
        simulator_stop(&sim);
}

static double pin(const char *const name)
{
    char full[96];
    snprintf(full, sizeof full, CARD ".%s", name);
    return talk_value(&hal, full);
}

static double remote(const char *const what)
{
    double value = NAN;
    char command[64];
    snprintf(command, sizeof command, "remote %s", what);
    const char *const answer = simulator_ask(&sim, command);
    if (sscanf(answer, "%lf", &value) != 1)
        ck_abort_msg("%s: %s", command, answer);
    return value;
}

static void tell_remote(const char *const channel, const char *const field, const unsigned value)
{
    char command[64];
    snprintf(command, sizeof command, "remote %s set %s %u", channel, field, value);
    simulator_do(&sim, command);
}

static unsigned said(const char *const text)
{
    unsigned times = 0;
    for (const char *at = hal.host.text; (at = strstr(at, text)); at++)
        times++;
    return times;
}

/* Cycles that are pipelined for a moment only have been so, too: the message is looked for, not the pin. */
static bool is_said_within(const char *const text, const unsigned times, const int limit_ms)
{
    for (int ms = 0; ms < limit_ms; ms += LOOK_MS) {
        (void)talk_try(&hal, "");
        if (said(text) >= times)
            return true;
        usleep(LOOK_MS * 1000);
    }
    return false;
}

/* False when there is no room for it on this machine. */
static bool run_pipelined(const struct host *const host)
{
    if (!run(host, "pipelined=4 "))
        return false;
    ck_assert(pin("dpll.04.timer-us") > 150);
    talk_do(&hal, "setp " CARD ".dpll.04.timer-us %u", TIMER_US);
    if (is_said_within(BEGUN, 1, BEGIN_MS))
        return true;
    printf("SKIP: this machine answers too late for pipelined cycles of 20 ms\n");
    return false;
}

/* ---- steps, and what stands at both ends after each ---------------------------------------------------------------
 */

static double zero(const unsigned i)
{
    return 0 * i;
}

static double odd(const unsigned i)
{
    return i & 1u;
}

static double second_bit(const unsigned i)
{
    return i >> 1 & 1u;
}

static double output_3(const unsigned i)
{
    return i & 1u ? 8 : 0;
}

static double tens(const unsigned i)
{
    return 10.0 * i;
}

static double volts(const unsigned i)
{
    return (double)i - 3;
}

static double hundreds(const unsigned i)
{
    return 100.0 * i;
}

static const struct item {
    const char *name; /* of a pin, or of a remote's output; NULL in expected: anything above 0 */
    double (*expected)(unsigned step);
    double within;
} items[] = {
    {"7i77.0.0.link-fault", zero, 0},     {"7i77.0.0.enc0.count", tens, 0},   {"7i77.0.0.input-02", odd, 0},
    {"7i77.0.0.input-31", second_bit, 0}, {"7i77.0.0.fieldvoltage", NULL, 0}, {"7i76.0.2.link-fault", zero, 0},
    {"7i76.0.2.enc1.count", tens, 0},     {"7i76.0.2.input-02", odd, 0},      {"7i76.0.2.input-31", second_bit, 0},
    {"7i76.0.2.fieldvoltage", NULL, 0},   {"0:0 get Output", output_3, 0},    {"0:1 get AnalogOut2", volts, 0.01},
    {"0:2 get Output", output_3, 0},      {"0:2 get SpinOut", tens, 0.05},    {"stepgen.00.position-fb", hundreds, 1},
    {"encoder.00.count", hundreds, 1.5},
};
#define ITEMS (sizeof items / sizeof items[0])

static bool is_as_expected(const struct item *const item, const unsigned i, const double value)
{
    return item->expected ? fabs(value - item->expected(i)) <= item->within : value > 0;
}

static double await(const struct item *const item, const unsigned i)
{
    double value = NAN;
    for (unsigned looks = 0; looks < LOOKS; looks++) {
        value = strchr(item->name, ' ') ? remote(item->name) : pin(item->name);
        if (is_as_expected(item, i, value))
            return value;
        usleep(LOOK_MS * 1000);
    }
    ck_abort_msg("step %u: %s stays at %g", i, item->name, value);
    return value;
}

static void step(const unsigned i, double seen[const ITEMS])
{
    const unsigned inputs = (i & 1u) << 2 | (i >> 1 & 1u) << 31;
    talk_do(&hal, "setp " CARD ".7i77.0.0.output-03 %u\nsetp " CARD ".7i77.0.1.analogout2 %d", i & 1u, (int)i - 3);
    talk_do(&hal, "setp " CARD ".7i76.0.2.output-03 %u\nsetp " CARD ".7i76.0.2.spinout %u", i & 1u, 10 * i);
    talk_do(&hal, "setp " CARD ".stepgen.00.position-cmd %u", 100 * i);
    tell_remote("0:0", "Input", inputs);
    tell_remote("0:0", "Enc0", 10 * i); /* a counter of eight bits */
    tell_remote("0:2", "Input", inputs);
    tell_remote("0:2", "Enc1", 10 * i);
    for (unsigned k = 0; k < ITEMS; k++)
        seen[k] = await(&items[k], i);
}

static void walk(double seen[const STEPS][ITEMS])
{
    for (unsigned i = 0; i < STEPS; i++)
        step(i + 1, seen[i]);
    ck_assert(pin("sserial.port-0.restarts") == 0);
    ck_assert(pin("7i77.0.0.link-errors") == 0 && pin("7i77.0.1.link-errors") == 0);
    ck_assert(pin("7i76.0.2.link-errors") == 0);
}

/* ---- on the way ---------------------------------------------------------------------------------------------------
 */

static void record_motion(void)
{
    talk_do(&hal, "net fb " CARD ".stepgen.00.position-fb => recorder.pin-00\n"
                  "net encoder " CARD ".encoder.00.position => recorder.pin-01\n"
                  "net age " CARD ".pipeline.data-age-us => recorder.pin-02");
    talk_do(&hal,
            "setp " CARD ".stepgen.00.control-type 1\nsetp " CARD ".stepgen.00.velocity-cmd %g\n"
            "setp recorder.enable 1",
            STEPS_A_S);
    talk_wait(&hal, "recorder.full", 1, 1);
    talk_do(&hal, "stop\nunloadrt recorder");
}

static int compare(const void *const a, const void *const b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The encoder shows where the axis was when the card read it, the step generator where it was when the pins changed:
 * in pipelined cycles that is nearly a period apart. How long depends on this machine, and the pin tells it; a read
 * that had to wait tells the time of the reply instead, so not every row fits. */
static void check_motion(const struct host *const host)
{
    double off[ROWS] = {0}, age_us[ROWS] = {0}, fb, encoder, s;
    unsigned n = 0;
    char line[256];
    const char *const path = host->start == start_hm2host ? TEST_BUILD "/" PATH_FILE : OUT "/" PATH_FILE;
    FILE *const file = fopen(path, "r");
    ck_assert_msg(file && fgets(line, sizeof line, file), "%s", path);
    while (n < ROWS && fgets(line, sizeof line, file)) {
        ck_assert_int_eq(sscanf(line, "%lf,%lf,%lf,%lf", &s, &fb, &encoder, &age_us[n]), 4);
        off[n] = fabs(fb - encoder - STEPS_A_S * age_us[n] * 1e-6);
        n++;
    }
    fclose(file);
    ck_assert_uint_eq(n, ROWS);
    qsort(off, n, sizeof off[0], compare);
    qsort(age_us, n, sizeof age_us[0], compare);
    printf("%s: inputs are %.0f us old; step generator and encoder differ from that by %.2f steps (medians)\n",
           host->name, age_us[n / 2], off[n / 2]);
    ck_assert_double_lt(off[n / 2], 2);
}

START_TEST(remotes_and_axes_show_the_same_in_pipelined_and_in_plain_cycles)
{
    static double plain[STEPS][ITEMS], pipelined[STEPS][ITEMS];
    const struct host *const host = &hosts[_i];
    if (!run_pipelined(host))
        return;
    walk(pipelined);
    record_motion();
    end(host);
    check_motion(host);
    ck_assert(run(host, ""));
    walk(plain);
    end(host);
    for (unsigned i = 0; i < STEPS; i++)
        for (unsigned k = 0; k < ITEMS; k++)
            if (fabs(plain[i][k] - pipelined[i][k]) > 2 * items[k].within)
                ck_abort_msg("step %u: %s is %g in plain cycles, %g in pipelined ones", i + 1, items[k].name,
                             plain[i][k], pipelined[i][k]);
}
END_TEST

/* ---- and when the card was away -----------------------------------------------------------------------------------
 */

static void expect_said(const char *const text, const unsigned times)
{
    if (!is_said_within(text, times, AGAIN_MS))
        ck_abort_msg("\"%s\" was not said %u times: %.3000s", text, times, hal.host.text);
}

static void await_active(const double wanted)
{
    for (int ms = 0; pin("pipeline.active") != wanted; ms += LOOK_MS) {
        if (ms >= AGAIN_MS)
            ck_abort_msg("pipeline.active does not become %g", wanted);
        usleep(LOOK_MS * 1000);
    }
}

static void lose_for_a_moment(const struct host *const host)
{
    const double falls = pin("pipeline.falls"), errors = pin("packet-error-total");
    await_active(1);
    const unsigned begun = said(BEGUN);
    host->card_goes();
    await_active(0);
    host->card_comes();
    expect_said(BEGUN, begun + 1);
    ck_assert_double_gt(pin("pipeline.falls"), falls);
    ck_assert_double_gt(pin("packet-error-total"), errors);
}

static void be_late(void)
{
    const double falls = pin("pipeline.falls"), late = pin("pipeline.late");
    await_active(1);
    const unsigned begun = said(BEGUN);
    simulator_do(&sim, "faults delay=20000");
    await_active(0);
    simulator_do(&sim, "faults none");
    expect_said(BEGUN, begun + 1);
    ck_assert_double_gt(pin("pipeline.falls"), falls);
    ck_assert_double_gt(pin("pipeline.late"), late);
}

static void lose_power(void)
{
    const unsigned lost = said(LOST_STATE), begun = said(BEGUN);
    simulator_do(&sim, "power-cycle");
    expect_said(LOST_STATE, lost + 1);
    expect_said(BEGUN, begun + 1);
}

static void check_all_is_well(const unsigned i)
{
    double seen[ITEMS];
    talk_wait(&hal, CARD ".io_error", 0, 0);
    talk_wait(&hal, CARD ".watchdog.has_bit", 0, 0);
    talk_wait(&hal, CARD ".packet-error", 0, 0);
    step(i, seen);
}

START_TEST(pipelining_begins_again_by_itself_when_the_card_is_back)
{
    const struct host *const host = &hosts[_i];
    if (!run_pipelined(host))
        return;
    check_all_is_well(1);
    lose_for_a_moment(host);
    check_all_is_well(2);
    be_late();
    check_all_is_well(3);
    lose_power();
    check_all_is_well(4);
    expect_said(PLAIN, (unsigned)pin("pipeline.falls"));
    end(host);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("pipelined remote");
    TCase *const tests = tcase_create("hosts");
    tcase_set_timeout(tests, 900);
    tcase_add_loop_test(tests, remotes_and_axes_show_the_same_in_pipelined_and_in_plain_cycles, 0, HOSTS);
    tcase_add_loop_test(tests, pipelining_begins_again_by_itself_when_the_card_is_back, 0, HOSTS);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
