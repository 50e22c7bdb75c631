/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A 7I49 at a 7I93, in hm2host over UDP: resolvers are read, and a motor goes where a controller in this test wants. */
#include <check.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "simulator.h"
#include "suite.h"
#include "talk.h"

#define CARD    "hm2_7i93.0"
#define TARGET  2.5
#define NEAR    0.01
#define LOOKS   2000
#define LOOK_US 10000

static struct simulator sim;
static struct talk hal;

static void begin(void)
{
    simulator_start(&sim, (const char *const[]){"--card", "7i93_sv6_7i49", "--resolver", "0:0.25:3:1", "--resolver",
                                                "5:-0.4", NULL});
    talk_start(&hal, NULL);
    talk_do(&hal,
            "loadrt hm2_lbp16 board_ip=%s\nloadrt threads name1=servo period1=1000000\n"
            "addf " CARD ".read servo\naddf " CARD ".write servo\nsetp " CARD ".packet-read-timeout 20000000\n"
            "setp " CARD ".packet-error-limit 1000000\nsetp " CARD ".watchdog.timeout_ns 4000000000\nstart",
            sim.address[0]);
}

static void end(void)
{
    talk_end(&hal);
    simulator_stop(&sim);
}

START_TEST(resolvers_are_read_and_missing_ones_are_errors)
{
    begin();
    talk_wait(&hal, CARD ".resolver.05.error", 0, 0);
    talk_wait(&hal, CARD ".resolver.05.angle", 0.5995, 0.6005);
    talk_wait(&hal, CARD ".resolver.00.angle", 0.2495, 0.2505);
    talk_wait(&hal, CARD ".resolver.01.error", 1, 1);
    end();
}
END_TEST

/* The controller is slow on purpose: a second from look to look would still not make it swing. */
START_TEST(a_motor_goes_where_it_is_told_by_its_resolver)
{
    double at = 0;
    unsigned near = 0;
    begin();
    talk_wait(&hal, CARD ".resolver.00.angle", 0.2495, 0.2505);
    talk_do(&hal, "setp " CARD ".pwmgen.03.scale 1\nsetp " CARD ".pwmgen.03.enable 1");
    for (unsigned i = 0; i < LOOKS && near < 10; i++) {
        at = talk_value(&hal, CARD ".resolver.00.position");
        talk_do(&hal, "setp " CARD ".pwmgen.03.value %.6f", fmax(-0.8, fmin(0.8, 0.8 * (TARGET - at))));
        near = fabs(at - TARGET) < NEAR ? near + 1 : 0;
        usleep(LOOK_US);
    }
    ck_assert_msg(near == 10, "at %g instead of %g", at, TARGET);
    talk_do(&hal, "setp " CARD ".pwmgen.03.enable 0");
    talk_wait(&hal, CARD ".resolver.00.velocity", -0.001, 0.001);
    at = talk_value(&hal, CARD ".resolver.00.position");
    talk_end(&hal);
    ck_assert_int_eq(process_stop(&sim.process, SIGTERM, 10000), 0);
    const char *const told = strstr(sim.process.text, "resolver 0 at ");
    ck_assert_ptr_nonnull(told);
    ck_assert_double_eq_tol(strtod(told + strlen("resolver 0 at "), NULL), at, 0.001);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("resolver");
    TCase *const tests = tcase_create("7I49");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, resolvers_are_read_and_missing_ones_are_errors);
    tcase_add_test(tests, a_motor_goes_where_it_is_told_by_its_resolver);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
