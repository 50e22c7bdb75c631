/* SPDX-License-Identifier: GPL-2.0-or-later */
/* scripts/demo as a person runs it, alone, twice at once and cut off; and the judgement of its report. */
#include <check.h>
#include <ctype.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "folder.h"
#include "process.h"
#include "suite.h"

#define DEMO_MS   180000
#define START_MS  120000
#define END_MS    30000
#define REPORT_MS 20000
#define TRIES     3u
#define DEMOS     2u
#define DEPTH     32u

#define COUNT(array) ((int)(sizeof(array) / sizeof((array)[0])))

static struct process demos[DEMOS], report;

/* ---- helpers ---------------------------------------------------------------------------------------------------- */

static const char *demo_script(void)
{
    return TEST_SOURCE "/scripts/demo";
}

/* What the demo starts belongs to this process when the demo has gone. */
static void adopt_orphans(void)
{
    ck_assert_int_eq(prctl(PR_SET_CHILD_SUBREAPER, 1UL, 0UL, 0UL, 0UL), 0);
    setenv("BUILDDIR", TEST_BUILD, 1);
    setenv("HOME", "/proc", 1); /* nobody can write there, root neither */
    unsetenv("MAKEFLAGS");
    unsetenv("MAKELEVEL");
    unsetenv("MFLAGS");
}

static void expect_no_process_left(void)
{
    for (unsigned ms = 0; ms < END_MS; ms += 10) {
        const pid_t left = waitpid(-1, NULL, WNOHANG);
        if (left < 0 && errno == ECHILD)
            return;
        usleep(10000);
    }
    ck_abort_msg("a process of the demo is still there");
}

static char *read_text(const char *const path)
{
    FILE *const file = fopen(path, "r");
    ck_assert_msg(file != NULL, "%s: %s", path, strerror(errno));
    static char text[4u << 20];
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    return text;
}

/* ---- XML -------------------------------------------------------------------------------------------------------- */

static size_t name_len(const char *const text)
{
    size_t len = 0;
    while (isalnum((unsigned char)text[len]) || text[len] == '-' || text[len] == ':')
        len++;
    return len;
}

/* Attributes up to the > of a tag; NULL when they are no XML. */
static const char *skip_attributes(const char *at)
{
    for (;;) {
        at += strspn(at, " \t\n");
        if (*at == '>' || (at[0] == '/' && at[1] == '>'))
            return at;
        const size_t len = name_len(at);
        if (len == 0 || at[len] != '=' || at[len + 1] != '"')
            return NULL;
        at += len + 2;
        at += strcspn(at, "\"<&");
        if (*at++ != '"')
            return NULL;
    }
}

/* One tag; opens and closes what it says. Returns its end, NULL when it is no XML. */
static const char *take_tag(const char *at, const char *open[const DEPTH], unsigned *const depth)
{
    const bool closes = at[1] == '/';
    const char *const name = at + 1 + closes;
    const size_t len = name_len(name);
    if (len == 0)
        return NULL;
    if (closes) {
        if (*depth == 0 || strncmp(open[--*depth], name, len) != 0 || name_len(open[*depth]) != len)
            return NULL;
        return name[len] == '>' ? name + len + 1 : NULL;
    }
    at = skip_attributes(name + len);
    if (!at)
        return NULL;
    if (*at == '/')
        return at + 2;
    if (*depth == DEPTH)
        return NULL;
    open[(*depth)++] = name;
    return at + 1;
}

static bool is_well_formed(const char *text)
{
    const char *open[DEPTH];
    unsigned depth = 0;
    text += strspn(text, " \n");
    if (*text != '<')
        return false;
    do {
        if (*text == '<')
            text = take_tag(text, open, &depth);
        else
            text = *text == '&' || *text == '>' ? NULL : text + 1;
    } while (text && *text && depth > 0);
    return text && depth == 0 && text[strspn(text, " \n")] == '\0';
}

START_TEST(the_xml_check_tells_good_from_bad)
{
    static const char *const good[] = {"<a/>", "<a><b c=\"d\"/>text</a>\n", "<a><b></b><b> </b></a>"};
    static const char *const bad[] = {"",          "<a>",      "<a></b>",      "<a><b></a></b>", "<a b=c/>",
                                      "<a b=\"/>", "<a/><b/>", "<a>1 & 2</a>", "<a>1 < 2</a>",   "text"};
    for (int i = 0; i < COUNT(good); i++)
        ck_assert_msg(is_well_formed(good[i]), "%s", good[i]);
    for (int i = 0; i < COUNT(bad); i++)
        ck_assert_msg(!is_well_formed(bad[i]), "%s", bad[i]);
}
END_TEST

static unsigned count_of(const char *text, const char *const what)
{
    unsigned count = 0;
    for (; (text = strstr(text, what)); text += strlen(what))
        count++;
    return count;
}

static void expect_picture(const char *const path)
{
    const char *const svg = read_text(path);
    ck_assert_msg(is_well_formed(svg), "%s is not well-formed", path);
    ck_assert_uint_eq(count_of(svg, "<svg "), 1);
    ck_assert_uint_eq(count_of(svg, "class=\"cmd\""), 3);
    ck_assert_uint_eq(count_of(svg, "class=\"fb\""), 3);
    for (unsigned joint = 0; joint < 3; joint++) {
        char text[16];
        snprintf(text, sizeof text, ">joint %u,", joint);
        ck_assert_uint_eq(count_of(svg, text), 1);
    }
    ck_assert_uint_ge(count_of(svg, "class=\"bar\""), 1);
    ck_assert(!strstr(svg, "nan") && !strstr(svg, "inf"));
}

/* ---- the demo --------------------------------------------------------------------------------------------------- */

/* On a machine that holds a process up for longer than the reply may take a packet is late, which the demo rightly
 * calls a failure. */
static bool was_held_up(const struct process *const demo)
{
    return demo->status == 1 && strstr(demo->text, "demo: FAILED") && !strstr(demo->text, "NOT ARRIVED");
}

static void expect_table(const struct process *const demo)
{
    static const char *const lines[] = {"\njoint       went to    commanded     fed back    largest error",
                                        "\n0          150.0000       0.0000 ",
                                        "\n1         -100.0000       0.0000 ",
                                        "\n2           40.0000       0.0000 ",
                                        "failed cycles 0, replies lost 0, writes lost 0\n",
                                        "\ncycle time (from one cycle to the next): median ",
                                        "\nAll joints arrived within one step; no packet was lost.\n",
                                        "/demo/demo.svg\n"};
    for (int i = 0; i < COUNT(lines); i++)
        ck_assert_msg(strstr(demo->text, lines[i]) != NULL, "no \"%s\" in: %s", lines[i], demo->text);
    ck_assert_ptr_null(strstr(demo->text, "NOT ARRIVED"));
}

static bool run_two_demos(void)
{
    const char *const argv[] = {demo_script(), NULL};
    bool held_up = false;
    for (unsigned i = 0; i < DEMOS; i++)
        process_start(&demos[i], argv);
    for (unsigned i = 0; i < DEMOS; i++) {
        if (!process_wait_end(&demos[i], DEMO_MS))
            ck_abort_msg("the demo does not end: %s", demos[i].text);
        held_up = held_up || was_held_up(&demos[i]);
    }
    return !held_up;
}

START_TEST(two_demos_at_once_move_their_joints_and_draw_them)
{
    adopt_orphans();
    (void)unlink(TEST_BUILD "/demo/demo.svg");
    for (unsigned i = 0; i < TRIES && !run_two_demos(); i++)
        continue;
    for (unsigned i = 0; i < DEMOS; i++) {
        ck_assert_msg(demos[i].status == 0, "status %d: %s", demos[i].status, demos[i].text);
        expect_table(&demos[i]);
    }
    expect_picture(TEST_BUILD "/demo/demo.svg");
    expect_no_process_left();
}
END_TEST

static const int signals[] = {SIGTERM, SIGINT, SIGHUP, SIGKILL};

START_TEST(a_demo_that_is_cut_off_leaves_no_process_behind)
{
    const char *const argv[] = {demo_script(), NULL};
    adopt_orphans();
    process_start(&demos[0], argv);
    if (!process_wait_line(&demos[0], "Simulated 7I96S at ", START_MS, NULL))
        ck_abort_msg("the demo does not start: %s", demos[0].text);
    usleep(500000); /* the joints are moving */
    ck_assert_int_eq(process_stop(&demos[0], signals[_i], END_MS), 128 + signals[_i]);
    expect_no_process_left();
    ck_assert_ptr_null(strstr(demos[0].text, "picture"));
}
END_TEST

/* ---- the report ------------------------------------------------------------------------------------------------- */

#define ROWS 101

static char folder[FOLDER_PATH];

struct rows {
    double cmd[ROWS][3], fb[ROWS][3];
};

static FILE *create(const char *const name)
{
    char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *const file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    return file;
}

/* A run in which everything is right: to the far end, there for a while, and back. */
static void good_rows(struct rows *const rows)
{
    static const double far[3] = {150, -100, 40};
    for (int i = 0; i < ROWS; i++)
        for (int j = 0; j < 3; j++) {
            const double share = i < 40 ? i / 40.0 : i < 60 ? 1.0 : (100 - i) / 40.0;
            rows->cmd[i][j] = rows->fb[i][j] = far[j] * share;
        }
}

static void write_run(const struct rows *const rows, const char *const extra)
{
    FILE *const file = create("run.csv");
    fprintf(file, "time_s,pin0,pin1,pin2,pin3,pin4,pin5\n");
    for (int i = 0; i < ROWS; i++) {
        fprintf(file, "%.6f", i * 0.001);
        for (int j = 0; j < 3; j++)
            fprintf(file, ",%.9g,%.9g", rows->cmd[i][j], rows->fb[i][j]);
        fputc('\n', file);
    }
    fputs(extra, file);
    ck_assert_int_eq(fclose(file), 0);
}

static void write_text(const char *const name, const char *const text)
{
    FILE *const file = create(name);
    fputs(text, file);
    ck_assert_int_eq(fclose(file), 0);
}

static int run_report(void)
{
    static const char *const names[] = {"run.csv", "cycle.csv", "host.log", "sim.log", "demo.svg"};
    static char paths[COUNT(names)][128];
    const char *argv[COUNT(names) + 2] = {TEST_SOURCE "/scripts/demo-report"};
    for (int i = 0; i < COUNT(names); i++) {
        snprintf(paths[i], sizeof paths[i], "%s/%s", folder, names[i]);
        argv[i + 1] = paths[i];
    }
    return process_run(&report, argv, REPORT_MS);
}

static void make_good_folder(void)
{
    static struct rows rows;
    folder_make(folder, "demo");
    good_rows(&rows);
    write_run(&rows, "");
    write_text("cycle.csv", "thread,what,from_ns,to_ns,count\nservo,busy,100000,110000,101\n"
                            "servo,interval,990000,1000000,60\nservo,interval,1000000,1010000,41\n");
    write_text("host.log", "0\n0\n0\n");
    write_text("sim.log", "ready 7i96s@127.0.0.1:4711\n7i96s@127.0.0.1:4711: requests 202 replies 101\n");
}

static void remove_folder(void)
{
    folder_remove(folder);
}

START_TEST(a_good_run_is_reported_and_drawn)
{
    char path[128];
    ck_assert_msg(run_report() == 0, "%s", report.text);
    ck_assert_ptr_nonnull(strstr(report.text, "packets 202, cycles 101, failed cycles 0"));
    snprintf(path, sizeof path, "%s/demo.svg", folder);
    expect_picture(path);
}
END_TEST

/* One step is 1/200, 1/200 and 1/1600 of a unit. */
static const struct {
    int joint, row;
    double cmd, fb; /* added */
    bool good;
} doctored[] = {
    {0, 100, 0, 0.0049, true},  {0, 100, 0, 0.0051, false},  {1, 100, 0, -0.0051, false},
    {2, 100, 0, 0.00062, true}, {2, 100, 0, 0.00063, false}, {0, 100, 0.006, 0.006, false},
    {1, 60, 0, 0.0051, false},  {1, 50, 0, 0.1, true},       {0, 20, 0, 5, true},
};

START_TEST(a_joint_that_does_not_arrive_within_one_step_fails_the_demo)
{
    static struct rows rows;
    good_rows(&rows);
    const int row = doctored[_i].row, joint = doctored[_i].joint;
    rows.cmd[row][joint] += doctored[_i].cmd;
    rows.fb[row][joint] += doctored[_i].fb;
    write_run(&rows, "");
    ck_assert_int_eq(run_report() == 0, doctored[_i].good);
    ck_assert_int_eq(strstr(report.text, "NOT ARRIVED") == NULL, doctored[_i].good);
}
END_TEST

START_TEST(a_joint_that_never_moved_fails_the_demo)
{
    static struct rows rows;
    good_rows(&rows);
    for (int i = 0; i < ROWS; i++)
        rows.cmd[i][2] = rows.fb[i][2] = 0;
    write_run(&rows, "");
    ck_assert_int_eq(run_report(), 1);
    ck_assert_ptr_nonnull(strstr(report.text, "NOT ARRIVED"));
}
END_TEST

static const struct {
    const char *file, *text, *message;
} damaged[] = {
    {"host.log", "1\n0\n0\n", "demo: FAILED"},
    {"host.log", "0\n1\n0\n", "demo: FAILED"},
    {"host.log", "0\n0\n1\n", "demo: FAILED"},
    {"host.log", "0\n0\n", "no complete record"},
    {"host.log", "", "no complete record"},
    {"run.csv", "time_s,pin0,pin1,pin2,pin3,pin4,pin5\n", "no complete record"},
    {"run.csv", "", "demo: "},
    {"run.csv", "time_s,pin0,pin1,pin2,pin3,pin4,pin5\n0,150,150,1,1,1,1\n1,0,nan,0,0,0,0\n", "\"nan\""},
    {"run.csv", "time_s,pin0,pin1,pin2,pin3,pin4,pin5\n0,150,150,1,1,1,1\n1,0,0,0,0,0\n", "where a number is expected"},
    {"cycle.csv", "thread,what,from_ns,to_ns,count\n", "no complete record"},
    {"sim.log", "ready 7i96s@127.0.0.1:4711\n", "no complete record"},
};

START_TEST(lost_packets_and_damaged_files_fail_the_demo)
{
    write_text(damaged[_i].file, damaged[_i].text);
    ck_assert_int_ne(run_report(), 0);
    ck_assert_msg(strstr(report.text, damaged[_i].message) != NULL, "%s", report.text);
}
END_TEST

START_TEST(a_missing_file_fails_the_demo)
{
    static const char *const names[] = {"run.csv", "cycle.csv", "host.log", "sim.log"};
    char path[128];
    snprintf(path, sizeof path, "%s/%s", folder, names[_i]);
    ck_assert_int_eq(unlink(path), 0);
    ck_assert_int_ne(run_report(), 0);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("demo");
    TCase *const runs = tcase_create("runs");
    tcase_set_timeout(runs, 600);
    tcase_add_test(runs, two_demos_at_once_move_their_joints_and_draw_them);
    tcase_add_loop_test(runs, a_demo_that_is_cut_off_leaves_no_process_behind, 0, COUNT(signals));
    suite_add_tcase(suite, runs);
    TCase *const reports = tcase_create("report");
    tcase_set_timeout(reports, 60);
    tcase_add_checked_fixture(reports, make_good_folder, remove_folder);
    tcase_add_test(reports, the_xml_check_tells_good_from_bad);
    tcase_add_test(reports, a_good_run_is_reported_and_drawn);
    tcase_add_loop_test(reports, a_joint_that_does_not_arrive_within_one_step_fails_the_demo, 0, COUNT(doctored));
    tcase_add_test(reports, a_joint_that_never_moved_fails_the_demo);
    tcase_add_loop_test(reports, lost_packets_and_damaged_files_fail_the_demo, 0, COUNT(damaged));
    tcase_add_loop_test(reports, a_missing_file_fails_the_demo, 0, 4);
    suite_add_tcase(suite, reports);
    return run_suite(suite);
}
