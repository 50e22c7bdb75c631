/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A 7I77 in pipelined cycles of hm2host over real UDP: what goes to it and comes back is what plain cycles show. The
 * period is long, so that there is room in it on a busy machine; where there is none, plain cycles go on and nothing
 * can be compared.
 */
#include <check.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "simulator.h"
#include "suite.h"
#include "talk.h"

#define CARD     "hm2_7i96s.0"
#define STEPS    6
#define BEGIN_MS 60000
#define LOOK_MS  50

/* What stood at both ends after a step. */
struct seen {
    double field_volts, count, input_2, input_31, output, analog;
};

static struct simulator sim;
static struct talk hal;

static double pin(const char *const name)
{
    char full[96];
    snprintf(full, sizeof full, CARD ".%s", name);
    return talk_value(&hal, full);
}

static void wait_for(const char *const name, const double low, const double high)
{
    char full[96];
    snprintf(full, sizeof full, CARD ".%s", name);
    talk_wait(&hal, full, low, high);
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

static void tell_remote(const char *const field, const unsigned value)
{
    char command[64];
    snprintf(command, sizeof command, "remote 0:0 set %s %u", field, value);
    simulator_do(&sim, command);
}

static void run(const char *const config)
{
    simulator_start(&sim, (const char *const[]){"--card", "7i96s_7i77d", "--remote", "0:0=7i77", NULL});
    talk_start(&hal, NULL);
    talk_do(&hal, "loadrt hm2_lbp16 board_ip=%s config=\"%ssserial_port_0=30xxxxxx\"", sim.address[0], config);
    talk_do(&hal, "loadrt threads name1=servo period1=20000000\naddf " CARD ".read servo\naddf " CARD ".write servo");
    talk_do(&hal, "setp " CARD ".packet-read-timeout 500000000\nsetp " CARD ".packet-error-limit 100000000");
    talk_do(&hal, "setp " CARD ".watchdog.timeout_ns 4000000000\nsetp " CARD ".sserial.port-0.fault-lim 100000");
    talk_do(&hal, "setp " CARD ".7i77.0.0.watchdogtimeout 60000\nsetp " CARD ".7i77.0.1.watchdogtimeout 60000");
    talk_do(&hal, "setp " CARD ".7i77.0.1.analogena 1\nstart");
    wait_for("sserial.port-0.port_state", 3, 3);
}

static bool is_pipelined_within(const int limit_ms)
{
    int ms = 0;
    while (pin("pipeline.active") == 0 && ms < limit_ms) {
        usleep(LOOK_MS * 1000);
        ms += LOOK_MS;
    }
    return ms < limit_ms;
}

/* The last thing that a step sets comes last, so the others are there when it is. */
static struct seen step(const unsigned i)
{
    const unsigned inputs = (i & 1u) << 2 | (i >> 1 & 1u) << 31, count = 10u * i; /* a counter of eight bits */
    talk_do(&hal, "setp " CARD ".7i77.0.0.output-03 %u\nsetp " CARD ".7i77.0.1.analogout2 %d", i & 1u, (int)i - 3);
    tell_remote("Input", inputs);
    tell_remote("Enc0", count);
    wait_for("7i77.0.0.enc0.rawcounts", count, count);
    wait_for("7i77.0.0.link-fault", 0, 0);
    struct seen seen = {.field_volts = pin("7i77.0.0.fieldvoltage"),
                        .count = pin("7i77.0.0.enc0.count"),
                        .input_2 = pin("7i77.0.0.input-02"),
                        .input_31 = pin("7i77.0.0.input-31")};
    for (unsigned looks = 0; looks < 600; looks++) {
        seen.output = remote("0:0 get Output");
        seen.analog = remote("0:1 get AnalogOut2");
        if (seen.output == (i & 1u ? 8 : 0) && fabs(seen.analog - ((int)i - 3)) < 0.01)
            break;
        usleep(LOOK_MS * 1000);
    }
    return seen;
}

static void walk(struct seen seen[STEPS])
{
    for (unsigned i = 0; i < STEPS; i++)
        seen[i] = step(i + 1);
    ck_assert(pin("sserial.port-0.restarts") == 0);
    ck_assert(pin("7i77.0.0.link-errors") == 0 && pin("7i77.0.1.link-errors") == 0);
    talk_end(&hal);
    simulator_stop(&sim);
}

START_TEST(a_7i77_shows_the_same_in_pipelined_and_in_plain_cycles)
{
    struct seen plain[STEPS], pipelined[STEPS];
    run("pipelined=4 ");
    ck_assert(pin("dpll.04.timer-us") > 150);
    if (!is_pipelined_within(BEGIN_MS)) {
        printf("SKIP: this machine answers too late for pipelined cycles of 20 ms\n");
        return;
    }
    walk(pipelined);
    run("");
    walk(plain);
    for (unsigned i = 0; i < STEPS; i++) {
        ck_assert(pipelined[i].count == 10.0 * (i + 1) && plain[i].count == pipelined[i].count);
        ck_assert(pipelined[i].field_volts > 0 && plain[i].field_volts == pipelined[i].field_volts);
        ck_assert(plain[i].input_2 == pipelined[i].input_2 && pipelined[i].input_2 == ((i + 1) & 1u));
        ck_assert(plain[i].input_31 == pipelined[i].input_31 && pipelined[i].input_31 == ((i + 1) >> 1 & 1u));
        ck_assert(plain[i].output == pipelined[i].output && pipelined[i].output == ((i + 1) & 1u ? 8 : 0));
        ck_assert(plain[i].analog == pipelined[i].analog && fabs(plain[i].analog - ((int)i - 2)) < 0.01);
    }
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("pipelined remote");
    TCase *const tests = tcase_create("hm2host");
    tcase_set_timeout(tests, 240);
    tcase_add_test(tests, a_7i77_shows_the_same_in_pipelined_and_in_plain_cycles);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
