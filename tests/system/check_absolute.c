/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Absolute encoders of hm2sim, as the component hm2_lbp16 shows them in hm2host. */
#include <check.h>
#include <stdio.h>
#include <string.h>

#include "simulator.h"
#include "suite.h"
#include "talk.h"

#define IMAGE      TEST_DATA "/firmware/absolute_48.hex"
#define BOARD      "hm2_7i93.0."
#define MAX_LOADED 16

static struct simulator sim;
static struct talk hal;

/* A 7I93 with readers of all three kinds and these encoders; cycles run. */
static void run_with(const char *const *const encoders, const char *const config)
{
    const char *options[MAX_LOADED] = {"--card", "7i93", "--firmware", IMAGE};
    for (unsigned i = 0; encoders[i]; i++)
        options[4 + i] = encoders[i];
    simulator_start(&sim, options);
    talk_start(&hal, NULL);
    talk_do(&hal,
            "loadrt hm2_lbp16 board_ip=%s config=\"%s\"\nloadrt threads name1=servo period1=1000000\n"
            "addf hm2_7i93.0.read servo\naddf hm2_7i93.0.write servo\nsetp hm2_7i93.0.packet-read-timeout 100000000\n"
            "setp hm2_7i93.0.watchdog.timeout_ns 4000000000\nstart",
            sim.address[0], config);
}

static void end(void)
{
    talk_end(&hal);
    simulator_stop(&sim);
}

START_TEST(fields_of_all_three_kinds_are_on_pins)
{
    run_with(
        (const char *const[]){"--absolute", "ssi.0:bits=25,value=1000000,position=0:24g,start=123456", "--absolute",
                              "biss.1:bits=40,value=C100000000,position=0:32,start=-5,delay=900,processing=12",
                              "--absolute", "fanuc.0:bits=76,value=20,position=18:16,turns=36:16,start=65539", NULL},
        "ssi_chan_0=shaft%24gefault%1b biss_chan_1=shaft%32ecrc%6uwarning%1berror%1b fanuc_chan_0=AA64");
    talk_wait(&hal, BOARD "ssi.00.shaft.rawcounts", 123456, 123456);
    talk_wait(&hal, BOARD "ssi.00.fault", 1, 1);
    talk_wait(&hal, BOARD "biss.01.shaft.rawcounts", -5, -5);
    talk_wait(&hal, BOARD "biss.01.error", 1, 1);
    talk_wait(&hal, BOARD "biss.01.warning", 1, 1);
    talk_wait(&hal, BOARD "fanuc.00.encoder.rawcounts", 65539, 65539);
    talk_wait(&hal, BOARD "fanuc.00.batt_fail", 1, 1);
    talk_wait(&hal, BOARD "fanuc.00.data-invalid", 0, 0);
    end();
}
END_TEST

START_TEST(an_encoder_is_changed_and_taken_away_by_command)
{
    run_with((const char *const[]){"--absolute", "fanuc.1:bits=76,position=18:16", NULL}, "fanuc_chan_1=AA64");
    talk_wait(&hal, BOARD "fanuc.01.data-invalid", 0, 0);
    simulator_do(&sim, "absolute fanuc.1 bits=76,value=20,position=18:16,start=77");
    talk_wait(&hal, BOARD "fanuc.01.encoder.rawcounts", 77, 77);
    talk_wait(&hal, BOARD "fanuc.01.batt_fail", 1, 1);
    simulator_do(&sim, "absolute fanuc.1 none");
    talk_wait(&hal, BOARD "fanuc.01.data-invalid", 1, 1);
    simulator_do(&sim, "absolute fanuc.1 bits=76,position=18:16,start=78");
    talk_wait(&hal, BOARD "fanuc.01.encoder.rawcounts", 78, 78);
    ck_assert_ptr_nonnull(strstr(simulator_ask(&sim, "absolute fanuc.1 bits=0"), "error: "));
    ck_assert_ptr_nonnull(strstr(simulator_ask(&sim, "absolute fanuc.2 bits=1"), "no such reader (fanuc 2)"));
    end();
}
END_TEST

START_TEST(an_encoder_turns_by_itself)
{
    run_with((const char *const[]){"--absolute", "ssi.1:bits=16,position=0:16,speed=-40000", NULL},
             "ssi_chan_1=shaft%16e");
    talk_wait(&hal, BOARD "ssi.01.shaft.rawcounts", -1e9, -70000); /* through the end of its range */
    end();
}
END_TEST

/* A step generator turns it, and the driver of that knows where it is. */
START_TEST(an_encoder_turns_with_a_step_generator)
{
    simulator_start(&sim, (const char *const[]){"--card", "7i93", "--name", "7I92", "--firmware",
                                                TEST_DATA "/idrom/7I76x2_ssi_34.hex", "--absolute",
                                                "ssi.0:bits=24,position=0:24,with=stepgen.1:-3/2", NULL});
    talk_start(&hal, NULL);
    talk_do(&hal,
            "loadrt hm2_lbp16 board_ip=%s config=\"ssi_chan_0=shaft%%24e\"\n"
            "loadrt threads name1=servo period1=1000000",
            sim.address[0]);
    talk_do(&hal, "addf hm2_7i92.0.read servo\naddf hm2_7i92.0.write servo\n"
                  "setp hm2_7i92.0.packet-read-timeout 100000000\nsetp hm2_7i92.0.watchdog.timeout_ns 4000000000\n"
                  "setp hm2_7i92.0.stepgen.01.steplen 2000\nsetp hm2_7i92.0.stepgen.01.stepspace 2000\n"
                  "setp hm2_7i92.0.stepgen.01.position-scale 1\nsetp hm2_7i92.0.stepgen.01.maxaccel 1e6\n"
                  "setp hm2_7i92.0.stepgen.01.position-cmd 20000\nsetp hm2_7i92.0.stepgen.01.enable 1\nstart");
    talk_wait(&hal, "hm2_7i92.0.stepgen.01.position-fb", 19999.4, 20000.6);
    talk_wait(&hal, "hm2_7i92.0.ssi.00.shaft.rawcounts", -30003, -29998);
    end();
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("absolute");
    TCase *const tests = tcase_create("absolute");
    tcase_set_timeout(tests, 120);
    tcase_add_loop_test(tests, fields_of_all_three_kinds_are_on_pins, 0, 2);
    tcase_add_test(tests, an_encoder_is_changed_and_taken_away_by_command);
    tcase_add_test(tests, an_encoder_turns_by_itself);
    tcase_add_test(tests, an_encoder_turns_with_a_step_generator);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
