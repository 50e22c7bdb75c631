/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The components scurve and recorder in hm2host: parameters, targets and limits good and bad, and the file written. */
#include <check.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "process.h"
#include "suite.h"
#include "talk.h"

#define ROWS 20000

#define COUNT(array) ((int)(sizeof(array) / sizeof((array)[0])))

static struct talk hal;
static char record[64];

static void begin(void)
{
    snprintf(record, sizeof record, "/tmp/check-motion-%d.csv", (int)getpid());
    (void)unlink(record);
    talk_start(&hal, NULL);
}

static void end(void)
{
    talk_end(&hal);
    (void)unlink(record);
}

/* Axes that run, without a card. */
static void load_axes(const unsigned count)
{
    talk_do(&hal, "loadrt scurve count=%u\nloadrt threads name1=t period1=1000000\naddf scurve.update t\nstart", count);
}

static void expect_refusal(const char *const line, const char *const sentence)
{
    const char *const answer = talk_try(&hal, line);
    ck_assert_msg(strstr(answer, sentence) && strstr(answer, "refused to load"), "%s: %s", line, answer);
    ck_assert_str_eq(talk_try(&hal, "list pin"), "\n");
    ck_assert_str_eq(talk_try(&hal, "list funct"), "\n");
}

/* ---- the record ------------------------------------------------------------------------------------------------- */

static double values[ROWS][3]; /* time and two pins */
static unsigned row_count;

static void read_record(void)
{
    char line[256];
    FILE *const file = fopen(record, "r");
    ck_assert_msg(file != NULL, "no %s", record);
    ck_assert_ptr_nonnull(fgets(line, sizeof line, file));
    ck_assert_str_eq(line, "time_s,pin0,pin1\n");
    for (row_count = 0; fgets(line, sizeof line, file); row_count++) {
        double *const row = values[row_count];
        ck_assert_uint_lt(row_count, ROWS);
        ck_assert_int_eq(sscanf(line, "%lf,%lf,%lf", &row[0], &row[1], &row[2]), 3);
    }
    fclose(file);
}

/* ---- recorder --------------------------------------------------------------------------------------------------- */

START_TEST(bad_parameters_are_refused_and_leave_nothing)
{
    static const struct {
        const char *line, *sentence;
    } rows[] = {
        {"loadrt scurve count=0", "count=0: give 1 to 16 axes"},
        {"loadrt scurve count=17", "count=17: give 1 to 16 axes"},
        {"loadrt scurve count=-1", "count=-1: give 1 to 16 axes"},
        {"loadrt recorder pins=0 file=/tmp/x", "pins=0: give 1 to 32"},
        {"loadrt recorder pins=33 file=/tmp/x", "pins=33: give 1 to 32"},
        {"loadrt recorder depth=0 file=/tmp/x", "depth=0: give 1 to 10000000 cycles"},
        {"loadrt recorder depth=10000001 file=/tmp/x", "depth=10000001: give 1 to"},
        {"loadrt recorder", "say where to write: file=PATH"},
        {"loadrt recorder file=", "say where to write: file=PATH"},
        {"loadrt recorder file=/nonexistent/x.csv", "file /nonexistent/x.csv: cannot be created: No such file"},
        {"loadrt recorder file=/tmp", "file /tmp: cannot be created: Is a directory"},
    };
    begin();
    for (int i = 0; i < COUNT(rows); i++)
        expect_refusal(rows[i].line, rows[i].sentence);
    end();
}
END_TEST

START_TEST(a_full_recorder_stops_and_says_so)
{
    begin();
    talk_do(&hal,
            "loadrt recorder pins=2 depth=100 file=%s\nloadrt threads name1=t period1=1000000\n"
            "addf recorder.sample t\nsetp recorder.pin-00 1.5\nsetp recorder.pin-01 -1e300\nstart\nrun 0.05",
            record);
    ck_assert_double_eq(talk_value(&hal, "recorder.samples"), 0); /* not enabled */
    talk_do(&hal, "setp recorder.enable 1");
    talk_wait(&hal, "recorder.full", 1, 1);
    ck_assert_double_eq(talk_value(&hal, "recorder.samples"), 100);
    talk_do(&hal, "run 0.05\nunloadrt recorder");
    read_record();
    ck_assert_uint_eq(row_count, 100);
    for (unsigned i = 0; i < row_count; i++) {
        ck_assert_double_eq_tol(values[i][0], i * 0.001, 1e-9);
        ck_assert_double_eq(values[i][1], 1.5);
        ck_assert_double_eq(values[i][2], -1e300);
    }
    end();
}
END_TEST

/* A linked output pin takes the value that its signal has: nothing that the memory depends on may come from there. */
START_TEST(what_a_signal_says_does_not_lead_the_recorder_out_of_its_memory)
{
    begin();
    talk_do(&hal,
            "loadrt recorder pins=2 depth=50 file=%s\nloadrt threads name1=t period1=1000000\n"
            "addf recorder.sample t\nsetp recorder.enable 1\nstart\nrun 0.02\nstop\nnewsig s u32\n"
            "sets s 4000000000\nnet s recorder.samples\nunloadrt recorder",
            record);
    read_record();
    ck_assert_uint_le(row_count, 50);
    ck_assert_uint_ge(row_count, 1);
    end();
}
END_TEST

START_TEST(a_record_that_cannot_be_written_is_told)
{
    begin();
    talk_do(&hal, "loadrt recorder pins=2 depth=50 file=/dev/full");
    const char *const answer = talk_try(&hal, "unloadrt recorder");
    ck_assert_msg(strstr(answer, "file /dev/full: cannot be written: No space left") != NULL, "%s", answer);
    end();
}
END_TEST

/* ---- scurve ----------------------------------------------------------------------------------------------------- */

START_TEST(a_target_that_changes_during_a_move_is_served_after_it)
{
    begin();
    load_axes(1);
    talk_do(
        &hal,
        "loadrt recorder pins=2 depth=%d file=%s\naddf recorder.sample t\nnet p scurve.0.position => recorder.pin-00\n"
        "net v scurve.0.velocity => recorder.pin-01\nsetp recorder.enable 1\nsetp scurve.0.maxvel 20\n"
        "setp scurve.0.maxaccel 100\nsetp scurve.0.maxjerk 2000\nsetp scurve.0.target 10\nsetp scurve.0.enable 1",
        ROWS - 1, record);
    talk_wait(&hal, "scurve.0.position", 0.1, 9);
    talk_do(&hal, "setp scurve.0.target -5");
    talk_wait(&hal, "scurve.0.position", -5, -5);
    talk_wait(&hal, "scurve.0.moving", 0, 0); /* set in the same cycle, a moment later */
    ck_assert_double_eq(talk_value(&hal, "scurve.0.velocity"), 0);
    talk_do(&hal, "unloadrt recorder");
    read_record();
    double highest = 0;
    for (unsigned i = 1; i < row_count; i++) {
        const double dt = values[i][0] - values[i - 1][0];
        const double v = (values[i][1] - values[i - 1][1]) / dt;
        const double a = (values[i][2] - values[i - 1][2]) / dt;
        highest = fmax(highest, values[i][1]);
        ck_assert_double_le(fabs(v), 20 * 1.0001);
        ck_assert_double_le(fabs(a), 100 * 1.0001);
    }
    ck_assert_double_eq_tol(highest, 10, 1e-9);
    end();
}
END_TEST

static const struct {
    const char *name, *value, *good;
} impossible[] = {
    {"target", "nan", "3"},     {"target", "inf", "3"},   {"target", "-inf", "3"},
    {"maxvel", "nan", "10"},    {"maxvel", "0", "10"},    {"maxaccel", "-1", "100"},
    {"maxaccel", "inf", "100"}, {"maxjerk", "nan", "10"}, {"maxjerk", "0", "1000"},
};

START_TEST(impossible_targets_and_limits_leave_the_axis_where_it_is)
{
    const bool is_target = strcmp(impossible[_i].name, "target") == 0;
    begin();
    load_axes(2);
    talk_do(&hal, "setp scurve.0.enable 1\nsetp scurve.0.target 1");
    talk_wait(&hal, "scurve.0.position", 1, 1);
    talk_do(&hal, "setp scurve.0.%s %s", impossible[_i].name, impossible[_i].value);
    if (!is_target)
        talk_do(&hal, "setp scurve.0.target 3");
    talk_wait(&hal, "scurve.0.refused", 1, 1);
    talk_do(&hal, "run 0.05");
    ck_assert_double_eq(talk_value(&hal, "scurve.0.position"), 1);
    ck_assert_double_eq(talk_value(&hal, "scurve.0.velocity"), 0);
    ck_assert_double_eq(talk_value(&hal, "scurve.0.moving"), 0);
    ck_assert_double_eq(talk_value(&hal, "scurve.1.refused"), 0);
    talk_do(&hal, "setp scurve.0.%s %s", impossible[_i].name, impossible[_i].good);
    talk_wait(&hal, "scurve.0.position", 3, 3);
    ck_assert_double_eq(talk_value(&hal, "scurve.0.refused"), 0);
    end();
}
END_TEST

START_TEST(what_turns_bad_during_a_move_does_not_disturb_it)
{
    begin();
    load_axes(1);
    talk_do(&hal, "setp scurve.0.enable 1\nsetp scurve.0.target 10");
    talk_wait(&hal, "scurve.0.position", 0.001, 9);
    talk_do(&hal, "setp scurve.0.maxvel nan\nsetp scurve.0.maxjerk 0\nsetp scurve.0.enable 0");
    talk_wait(&hal, "scurve.0.position", 10, 10);
    talk_do(&hal, "setp scurve.0.target nan\nrun 0.05");
    ck_assert_double_eq(talk_value(&hal, "scurve.0.position"), 10);
    end();
}
END_TEST

START_TEST(moves_start_only_while_enabled)
{
    begin();
    load_axes(16);
    talk_do(&hal, "setp scurve.15.target 0.5\nrun 0.1");
    ck_assert_double_eq(talk_value(&hal, "scurve.15.position"), 0);
    ck_assert_double_eq(talk_value(&hal, "scurve.15.moving"), 0);
    talk_do(&hal, "setp scurve.15.enable 1");
    talk_wait(&hal, "scurve.15.position", 0.5, 0.5);
    ck_assert_double_eq(talk_value(&hal, "scurve.14.position"), 0);
    end();
}
END_TEST

START_TEST(a_signal_does_not_move_the_axis)
{
    begin();
    load_axes(1);
    talk_do(&hal, "setp scurve.0.enable 1\nsetp scurve.0.target 2");
    talk_wait(&hal, "scurve.0.position", 2, 2);
    talk_do(&hal, "newsig p float\nsets p 77\nnet p scurve.0.position\nrun 0.1");
    ck_assert_double_eq(talk_value(&hal, "scurve.0.position"), 2);
    talk_do(&hal, "setp scurve.0.target 3\nrun 0.05");
    ck_assert_double_le(talk_value(&hal, "scurve.0.position"), 3);
    talk_wait(&hal, "scurve.0.position", 3, 3);
    end();
}
END_TEST

/* ---- unloading -------------------------------------------------------------------------------------------------- */

static const char *const orders[] = {
    "unloadrt scurve\nunloadrt recorder\nunloadrt threads",
    "unloadrt recorder\nunloadrt scurve\nunloadrt threads",
    "stop\nunloadrt recorder\nunloadrt scurve",
    "unloadrt all",
    "unloadrt recorder\nloadrt recorder pins=1 file=/dev/null\naddf recorder.sample t\nrun 0.05\nunloadrt scurve",
};

START_TEST(the_order_of_unloading_does_not_matter)
{
    begin();
    load_axes(3);
    talk_do(&hal,
            "loadrt recorder pins=2 file=%s\naddf recorder.sample t\nnet p scurve.2.position => recorder.pin-01\n"
            "setp scurve.2.enable 1\nsetp scurve.2.target 5\nsetp recorder.enable 1\nrun 0.1",
            record);
    talk_do(&hal, "%s", orders[_i]);
    talk_end(&hal);
    read_record();
    ck_assert_uint_gt(row_count, 10);
    ck_assert_double_gt(values[row_count - 1][2], 0);
    (void)unlink(record);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("motion");
    TCase *const tests = tcase_create("components");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, bad_parameters_are_refused_and_leave_nothing);
    tcase_add_test(tests, a_full_recorder_stops_and_says_so);
    tcase_add_test(tests, what_a_signal_says_does_not_lead_the_recorder_out_of_its_memory);
    tcase_add_test(tests, a_record_that_cannot_be_written_is_told);
    tcase_add_test(tests, a_target_that_changes_during_a_move_is_served_after_it);
    tcase_add_loop_test(tests, impossible_targets_and_limits_leave_the_axis_where_it_is, 0, COUNT(impossible));
    tcase_add_test(tests, what_turns_bad_during_a_move_does_not_disturb_it);
    tcase_add_test(tests, moves_start_only_while_enabled);
    tcase_add_test(tests, a_signal_does_not_move_the_axis);
    tcase_add_loop_test(tests, the_order_of_unloading_does_not_matter, 0, COUNT(orders));
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
