/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2host as a program: files good and bad, signals, the prompt, threads, and LinuxCNC's own components. */
#include <check.h>
#include <dirent.h>
#include <errno.h>
#include <poll.h>
#include <pty.h>
#include <sched.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <linux/capability.h>

#include "folder.h"
#include "process.h"
#include "suite.h"

#define LINUXCNC_MODULES "/usr/lib/linuxcnc/modules"
#define LINUXCNC_HEADERS "/usr/include/linuxcnc"

#define END_MS   20000
#define HANG_MS  40000
#define MAX_ARGS 24
#define SKIPPED  77

static struct process host, peer;
static char folder[FOLDER_PATH];

/* ---- files and runs --------------------------------------------------------------------------------------------- */

static void make_folder(void)
{
    folder_make(folder, "hm2host");
}

static void remove_folder(void)
{
    folder_remove(folder);
}

/* Path of a file in the test's folder; the last four stay valid. */
static const char *in_folder(const char *const name)
{
    static char paths[4][128];
    static unsigned next;
    char *const path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

static const char *write_file(const char *const name, const char *const text)
{
    const char *const path = in_folder(name);
    FILE *const file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    ck_assert_int_ge(fputs(text, file), 0);
    ck_assert_int_eq(fclose(file), 0);
    return path;
}

static const char *read_file(const char *const name)
{
    static char text[65536];
    FILE *const file = fopen(in_folder(name), "r");
    ck_assert_ptr_nonnull(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    return text;
}

static void start_host(const char *const *args)
{
    static char components[512];
    snprintf(components, sizeof components, "%s/test-components", TEST_BUILD);
    const char *argv[MAX_ARGS] = {process_built("hm2host"), "--components", components};
    unsigned n = 3;
    for (; args && *args; args++)
        argv[n++] = *args;
    argv[n] = NULL;
    process_start(&host, argv);
}

/* Run hm2host with these arguments (NULL-terminated); the output is in host.text. */
static int run_host(const char *const *const args)
{
    start_host(args);
    if (!process_wait_end(&host, HANG_MS))
        ck_abort_msg("hm2host does not end: %s", host.text);
    return host.status;
}

static int run_hal(const char *const text)
{
    const char *const args[] = {write_file("t.hal", text), NULL};
    return run_host(args);
}

static void expect_text(const char *const text)
{
    if (!strstr(host.text, text))
        ck_abort_msg("no '%s' in: %s", text, host.text);
}

/* ---- files ------------------------------------------------------------------------------------------------------ */

START_TEST(a_good_file_runs_to_its_end)
{
    ck_assert_int_eq(run_hal("loadrt threads name1=servo period1=1000000\n"
                             "loadrt hm2_points_test instances=2 labels=\"a b\",c numbers=1,0x10\n"
                             "addf points.0.update servo\n"
                             "net value points.0.float-out => points.1.float-in\n"
                             "points.0.float-in = 4\n"
                             "setp points.0.gain 0.25\n"
                             "start\nrun 0.2\nstop\n"
                             "gets value\ngetp points.0.bit-ro\necho done\n"),
                     0);
    expect_text("label 0 is 'a b', number 1\n");
    expect_text("label 1 is 'c', number 16\n");
    expect_text("\n1\nTRUE\ndone\n");
    expect_text("points_test: exit\n");
}
END_TEST

static const struct {
    const char *text, *message; /* message: what follows the path */
} bad_files[] = {
    {"bogus\n", ":1: unknown command 'bogus'\n"},
    {"# c\n\nsetp a\\\nb 1\n", ":3: there is no parameter or pin 'ab'\n"},
    {"loadrt nosuch\n", ":1: there is no component 'nosuch' (looked for nosuch.so in "},
    {"loadrt hm2_points_test nosuch=1\n", ":1: component 'hm2_points_test' has no parameter 'nosuch' (it has "},
    {"loadrt hm2_points_test instances=x\n", ":1: parameter 'instances': 'x' is not a whole number\n"},
    {"loadrt hm2_points_test labels=1,2,3,4\n", ":1: parameter 'labels' takes at most 3 values\n"},
    {"loadrt hm2_points_test fail_at=1\n", ":1: component 'hm2_points_test' refused to load: error -5"},
    {"loadrt hm2_points_test fail_at=2\n", ":1: component 'hm2_points_test' refused to load: error -5"},
    {"loadrt hm2_points_test fail_at=3\n", ":1: component 'hm2_points_test' did not call hal_ready\n"},
    {"loadrt hm2_points_test prefix=abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrst\n", ":1: component "},
    {"loadrt threads name1=a period1=5\n", ":1: component 'threads' refused to load"},
    {"loadrt hm2_points_test\nnet s points.0.bit-in points.0.s32-in\n",
     ":2: pin 'points.0.s32-in' is of type s32, signal 's' of type bit\n"},
    {"loadrt hm2_points_test\nsetp points.0.s32-rw 3000000000\n", ":2: value '3000000000' does not fit s32"},
    {"loadrt hm2_points_test\naddf points.0.update servo\n", ":2: there is no thread 'servo'\n"},
    {"echo \"open\nquit\n", ":1: a quoted text is not closed\n"},
    {"echo $HM2_NOT_SET\n", ":1: environment variable 'HM2_NOT_SET' is not set\n"},
    {"echo [A]B\n", ":1: INI variable '[A]B' is not set\n"},
    {"source /nonexistent.hal\n", ":1: cannot open '/nonexistent.hal': No such file or directory\n"},
    {"\x7f"
     "ELF\x01\x02\n",
     ":1: unknown command"},
};

START_TEST(a_bad_file_ends_with_its_place_and_the_reason)
{
    ck_assert_int_eq(run_hal(bad_files[_i].text), 1);
    char expected[512];
    snprintf(expected, sizeof expected, "%s%s", in_folder("t.hal"), bad_files[_i].message);
    expect_text(expected);
}
END_TEST

START_TEST(after_an_error_nothing_keeps_running)
{
    ck_assert_int_eq(run_hal("loadrt threads name1=t period1=1000000\nloadrt hm2_points_test\n"
                             "addf points.0.update t\nstart\nrun 0.05\nbogus\necho never\n"),
                     1);
    expect_text("t.hal:6: unknown command 'bogus'\n");
    expect_text("points_test: exit\n"); /* stopped and unloaded in order, not torn down */
    ck_assert_ptr_null(strstr(host.text, "never"));
}
END_TEST

START_TEST(errors_in_sourced_files_name_the_inner_file)
{
    write_file("inner.hal", "\nbogus\n");
    char outer[256];
    snprintf(outer, sizeof outer, "echo outer\nsource %s\n", in_folder("inner.hal"));
    ck_assert_int_eq(run_hal(outer), 1);
    char expected[256];
    snprintf(expected, sizeof expected, "outer\n%s:2: unknown command 'bogus'\n", in_folder("inner.hal"));
    ck_assert_str_eq(host.text, expected);
}
END_TEST

START_TEST(files_that_source_each_other_for_ever_are_refused)
{
    char text[256];
    snprintf(text, sizeof text, "source %s\n", in_folder("t.hal"));
    ck_assert_int_eq(run_hal(text), 1);
    expect_text("deep");
}
END_TEST

START_TEST(several_files_and_commands_run_in_their_order)
{
    const char *const a = write_file("a.hal", "echo a\n"), *const b = write_file("b.hal", "echo b [S]NAME $USER_X\n");
    const char *const args[] = {
        "-e",        "echo first",   a,    "--ini", write_file("x.ini", "[S]\nNAME = from ini\n"),
        "--execute", "echo between", "-f", b,       NULL};
    setenv("USER_X", "from environment", 1);
    ck_assert_int_eq(run_host(args), 0);
    ck_assert_str_eq(host.text, "first\na\nbetween\nb from ini from environment\n");
}
END_TEST

START_TEST(commands_come_from_standard_input_without_a_file)
{
    char command[512];
    snprintf(command, sizeof command, "printf 'echo one\\necho \\\\\\ntwo\\nbogus\\necho never\\n' | '%s'",
             process_built("hm2host"));
    const char *const argv[] = {"sh", "-c", command, NULL};
    ck_assert_int_eq(process_run(&host, argv, END_MS), 1);
    ck_assert_str_eq(host.text, "one\ntwo\n<stdin>:4: unknown command 'bogus'\n");
}
END_TEST

static const struct {
    const char *args[3], *text;
    int status;
} options[] = {
    {{"--help"}, "Usage: hm2host", 0},
    {{"--version"}, "hm2host ", 0},
    {{"--bogus"}, "--help lists the options", 2},
    {{"--cpu", "99999"}, "'99999' is not a processor", 2},
    {{"--cpu", "x"}, "'x' is not a processor", 2},
    {{"/nonexistent.hal"}, "cannot open '/nonexistent.hal'", 1},
    {{"--ini", "/nonexistent.ini"}, "cannot open '/nonexistent.ini'", 1},
    {{"--run", "x"}, "'x' is not a number of seconds", 1},
    {{"/tmp"}, "cannot read '/tmp'", 1},
};

START_TEST(options_do_what_the_help_says)
{
    ck_assert_int_eq(run_host(options[_i].args), options[_i].status);
    expect_text(options[_i].text);
}
END_TEST

/* ---- threads ---------------------------------------------------------------------------------------------------- */

START_TEST(threads_run_at_their_periods)
{
    const char *const args[] = {"--json",
                                "--run",
                                "1",
                                "-e",
                                "loadrt threads name1=fast period1=250000 name2=slow period2=1000000",
                                "-e",
                                "loadrt hm2_points_test instances=2",
                                "-e",
                                "addf points.0.update fast",
                                "-e",
                                "addf points.1.update slow",
                                "--histogram",
                                in_folder("h.csv"),
                                "--timing",
                                NULL};
    ck_assert_int_eq(run_host(args), 0);
    /* Periods that could not be kept are counted; together with the cycles they fill the second. */
    long fast = 0, slow = 0;
    for (int part = 0; part < 2; part++) {
        char name[32];
        long cycles, overruns, missed;
        snprintf(name, sizeof name, "\n%s", part ? "slow " : "fast ");
        const char *const at = strstr(host.text, name);
        ck_assert_ptr_nonnull(at);
        ck_assert_int_eq(sscanf(at + strlen(name), "%ld %ld %ld", &cycles, &overruns, &missed), 3);
        ck_assert_int_gt(cycles, 0);
        *(part ? &slow : &fast) = cycles + missed;
    }
    ck_assert_int_ge(slow, 990);
    ck_assert_int_ge(fast, 4 * slow - 40);
    /* The two end one after the other: the fast one may count while the slow one is waited for. */
    ck_assert_int_le(slow, fast / 4 + 10);
    ck_assert_ptr_nonnull(strstr(read_file("h.csv"), "thread,what,from_ns,to_ns,count\nfast,busy,"));
}
END_TEST

START_TEST(messages_of_threads_are_printed)
{
    ck_assert_int_eq(run_hal("loadrt threads name1=t period1=1000000\nloadrt hm2_points_test print_every=5\n"
                             "addf points.0.update t\nstart\nrun 0.1\nstop\n"),
                     0);
    expect_text("points_test: cycle 5\npoints_test: cycle 10\n");
}
END_TEST

/* Neither a capability nor a limit allows realtime priority to what is started from here. */
static void drop_realtime_rights(void)
{
    const struct rlimit none = {0, 0};
    (void)prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0);
    (void)setrlimit(RLIMIT_RTPRIO, &none);
}

START_TEST(missing_realtime_rights_are_told)
{
    drop_realtime_rights();
    const char *const text = "loadrt threads name1=t\nstart\nrun 0.01\n";
    ck_assert_int_eq(run_hal(text), 0);
    expect_text("no realtime rights");
    const char *const args[] = {"--no-realtime", in_folder("t.hal"), NULL};
    ck_assert_int_eq(run_host(args), 0);
    expect_text("without realtime priority, as asked");
}
END_TEST

/* The processor of the program's realtime threads: the only one that they may use, and the same for all. -1 = it has
 * none, and no thread is kept from a processor that the test may use. */
static int processor_of(const struct process *const program)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%ld/task", (long)program->pid);
    DIR *const threads = opendir(path);
    ck_assert_ptr_nonnull(threads);
    cpu_set_t own, set;
    ck_assert_int_eq(sched_getaffinity(0, sizeof own, &own), 0);
    int found = -1;
    for (const struct dirent *thread; (thread = readdir(threads));) {
        const pid_t id = (pid_t)strtol(thread->d_name, NULL, 10);
        if (id <= 0)
            continue;
        ck_assert_int_eq(sched_getaffinity(id, sizeof set, &set), 0);
        if (sched_getscheduler(id) != SCHED_FIFO) {
            ck_assert(CPU_EQUAL(&set, &own));
            continue;
        }
        ck_assert_int_eq(CPU_COUNT(&set), 1);
        ck_assert(found < 0 || CPU_ISSET((size_t)found, &set));
        for (found = 0; !CPU_ISSET((size_t)found, &set);)
            found++;
    }
    closedir(threads);
    return found;
}

static int start_threads(struct process *const program, const char *const cpu)
{
    const char *const hal = write_file("threads.hal", "loadrt threads name1=a period1=10000000 name2=b "
                                                      "period2=20000000 name3=c period3=40000000\n"
                                                      "start\necho running\nrun 1000\n");
    const char *const argv[] = {process_built("hm2host"), hal, cpu ? "--cpu" : NULL, cpu, NULL};
    process_start(program, argv);
    ck_assert_msg(process_wait_line(program, "running", END_MS, NULL), "%s", program->text);
    return processor_of(program);
}

/* Two processors, or the only one, on which nothing depends on how many a machine has. */
static int take_two_processors(void)
{
    cpu_set_t own, two;
    CPU_ZERO(&two);
    ck_assert_int_eq(sched_getaffinity(0, sizeof own, &own), 0);
    for (size_t cpu = 0; cpu < CPU_SETSIZE && CPU_COUNT(&two) < 2; cpu++) {
        if (CPU_ISSET(cpu, &own))
            CPU_SET(cpu, &two);
    }
    ck_assert_int_eq(sched_setaffinity(0, sizeof two, &two), 0);
    return CPU_COUNT(&two);
}

static bool has_isolated_processors(void)
{
    FILE *const list = fopen("/sys/devices/system/cpu/isolated", "r");
    const int first = list ? fgetc(list) : EOF;
    if (list)
        fclose(list);
    return first >= '0' && first <= '9';
}

/* With so many that programs of others on the machine make no difference. */
START_TEST(threads_keep_away_from_those_of_other_hosts)
{
    static struct process others[4];
    if (has_isolated_processors()) {
        printf("SKIP: this machine has isolated processors, which threads prefer\n");
        return;
    }
    if (_i == 1)
        drop_realtime_rights();
    const int processors = take_two_processors();
    const int alone = start_threads(&host, NULL);
    process_stop(&host, SIGTERM, END_MS);
    char cpu[16];
    snprintf(cpu, sizeof cpu, "%d", alone);
    for (int i = 0; i < 4 && alone >= 0; i++)
        ck_assert_int_eq(start_threads(&others[i], cpu), alone);
    const int beside = start_threads(&host, NULL);
    if (alone < 0)
        ck_assert_int_eq(beside, -1);
    else if (processors == 1)
        ck_assert_int_eq(beside, alone);
    else
        ck_assert_int_ne(beside, alone);
    process_stop(&host, SIGTERM, END_MS);
    for (int i = 0; i < 4 && alone >= 0; i++)
        process_stop(&others[i], SIGTERM, END_MS);
}
END_TEST

START_TEST(a_function_that_hangs_ends_the_program_with_its_name)
{
    ck_assert_int_eq(run_hal("loadrt threads name1=t\nloadrt hm2_points_test delay_ns=100000000000\n"
                             "addf points.0.update t\nstart\nrun 0.1\nstop\n"),
                     3);
    expect_text("thread 't' does not stop: function 'points.0.update' has not returned");
}
END_TEST

START_TEST(an_interrupt_ends_run_and_the_file_goes_on)
{
    const char *const args[] = {write_file("t.hal", "loadrt threads name1=t period1=1000000\n"
                                                    "loadrt hm2_points_test print_every=500\n"
                                                    "addf points.0.update t\nstart\nrun 1000\necho on\n"),
                                NULL};
    start_host(args);
    /* By then `run` has begun: an interruption between two commands would end the file. */
    ck_assert(process_wait_line(&host, "points_test: cycle 500", END_MS, NULL));
    ck_assert_int_eq(process_stop(&host, SIGINT, END_MS), 0);
    expect_text("\non\n");
}
END_TEST

START_TEST(termination_unloads_everything)
{
    const char *const args[] = {write_file("t.hal", "loadrt threads name1=t\nloadrt hm2_points_test\naddf "
                                                    "points.0.update t\nstart\necho running\nrun 1000\necho never\n"),
                                NULL};
    start_host(args);
    ck_assert(process_wait_line(&host, "running", END_MS, NULL));
    ck_assert_int_eq(process_stop(&host, SIGTERM, END_MS), 128 + SIGTERM);
    expect_text("t.hal:6: interrupted\n");
    expect_text("points_test: exit\n");
    ck_assert_ptr_null(strstr(host.text, "never"));
}
END_TEST

/* After the first sleep, a thread that calls a function every millisecond does nothing else but sleep (and ask for the
 * time, where that is a system call): no lock, no memory, no output. */
START_TEST(the_thread_loop_makes_no_system_call_but_to_sleep)
{
    if (!process_find("strace")) {
        printf("SKIP: strace is not installed\n");
        return;
    }
    char components[512], command[1024];
    snprintf(components, sizeof components, "%s/test-components", TEST_BUILD);
    snprintf(command, sizeof command,
             "ASAN_OPTIONS=detect_leaks=0 strace -f -qq -o '%s' '%s' --components '%s' --run 0.5 -e 'loadrt threads "
             "name1=t' "
             "-e 'loadrt hm2_points_test' -e 'addf points.0.update t'",
             in_folder("trace"), process_built("hm2host"), components);
    const char *const argv[] = {"sh", "-c", command, NULL};
    if (process_run(&host, argv, HANG_MS) != 0 && strstr(host.text, "ptrace")) {
        printf("SKIP: strace may not trace here: %.80s\n", host.text);
        return;
    }
    ck_assert_msg(host.status == 0, "%s", host.text);
    /* Of the thread's own lines: from its first absolute sleep to its last. The program's thread sleeps in slices of
     * 100 ms, so the thread is the one with the most sleeps. */
    snprintf(command, sizeof command,
             "cd '%s' && t=$(grep clock_nanosleep trace | cut -d' ' -f1 | sort | uniq -c | sort -rn | "
             "awk 'NR == 1 { print $2 }') && grep \"^$t \" trace | sed 's/^[0-9]* *//' | "
             "awk '/clock_nanosleep/ { n++; printf \"%%s\", between; between = \"\"; next } "
             "n && !/^clock_gettime/ { between = between $0 \"\\n\" } "
             "END { print \"sleeps\", (n > 100) ? \"many\" : n }'",
             folder);
    ck_assert_int_eq(process_run(&host, argv, END_MS), 0);
    ck_assert_str_eq(host.text, "sleeps many\n");
}
END_TEST

START_TEST(json_is_json)
{
    if (!process_find("python3")) {
        printf("SKIP: python3 is not there to read JSON\n");
        return;
    }
    char command[1024];
    snprintf(command, sizeof command,
             "'%s' --json --components '%s/test-components' -e 'loadrt threads name1=t' -e 'loadrt hm2_points_test' "
             "-e 'addf points.0.update t' -e 'setp points.0.float-in nan' -e 'net s points.0.bit-in' -e show | "
             "python3 -c 'import json, sys; d = json.load(sys.stdin); "
             "print(sorted(d), [p[\"signal\"] for p in d[\"pins\"] if p[\"name\"] == \"points.0.bit-in\"], "
             "d[\"threads\"][0][\"functions\"])'",
             process_built("hm2host"), TEST_BUILD);
    const char *const argv[] = {"sh", "-c", command, NULL};
    ck_assert_int_eq(process_run(&host, argv, END_MS), 0);
    expect_text("['components', 'functions', 'parameters', 'pins', 'signals', 'threads'] ['s'] ['points.0.update']");
}
END_TEST

/* Every option and every command is in the manual page. */
START_TEST(the_manual_page_knows_every_option_and_command)
{
    static char page[65536];
    char path[512], wanted[80];
    snprintf(path, sizeof path, "%s/man/hm2host.1", TEST_SOURCE);
    FILE *const file = fopen(path, "r");
    ck_assert_ptr_nonnull(file);
    page[fread(page, 1, sizeof page - 1, file)] = '\0';
    fclose(file);
    const char *const help[] = {"--help", NULL}, *const commands[] = {"-e", "help", NULL};
    unsigned options_seen = 0, commands_seen = 0;
    ck_assert_int_eq(run_host(help), 0);
    for (const char *at = host.text; (at = strstr(at, "--")); at += 2) {
        if (at[-1] != ' ' || (at[2] < 'a' || at[2] > 'z'))
            continue;
        snprintf(wanted, sizeof wanted, "Fl Fl %.*s", (int)strcspn(at + 2, " "), at + 2);
        ck_assert_msg(strstr(page, wanted) != NULL, "no '%s' in the manual page", wanted);
        options_seen++;
    }
    ck_assert_int_eq(run_host(commands), 0);
    for (char *line = strtok(host.text, "\n"); line; line = strtok(NULL, "\n"), commands_seen++) {
        snprintf(wanted, sizeof wanted, "Ic %.*s", (int)strcspn(line + 2, " "), line + 2);
        ck_assert_msg(strstr(page, wanted) != NULL, "no '%s' in the manual page", wanted);
    }
    ck_assert_uint_ge(options_seen, 13);
    ck_assert_uint_ge(commands_seen, 40);
}
END_TEST

/* ---- prompt ----------------------------------------------------------------------------------------------------- */

static int terminal;
static char screen[65536];
static size_t screen_used;

/* Read until the text has appeared behind `from`; returns where it ends. */
static size_t wait_screen(const size_t from, const char *const text)
{
    struct pollfd input = {.fd = terminal, .events = POLLIN};
    for (;;) {
        const char *const at = strstr(screen + from, text);
        if (at)
            return (size_t)(at - screen) + strlen(text);
        const ssize_t got =
            poll(&input, 1, END_MS) > 0 ? read(terminal, screen + screen_used, sizeof screen - 1 - screen_used) : 0;
        if (got <= 0)
            ck_abort_msg("'%s' did not appear: %s", text, screen + from);
        screen_used += (size_t)got;
        screen[screen_used] = '\0';
    }
}

static void type(const char *const keys)
{
    ck_assert_int_eq(write(terminal, keys, strlen(keys)), (ssize_t)strlen(keys));
}

START_TEST(the_prompt_completes_and_remembers)
{
    char components[512];
    snprintf(components, sizeof components, "%s/test-components", TEST_BUILD);
    const char *const program = process_built("hm2host");
    /* libedit never frees the names that EL_ADDFN gave it; a leak-checking build is told so. */
    char leaks[160];
    snprintf(leaks, sizeof leaks, "print_suppressions=0:suppressions=%s", write_file("leaks", "leak:wcsdup\n"));
    const pid_t pid = forkpty(&terminal, NULL, NULL, NULL);
    ck_assert_int_ge(pid, 0);
    if (pid == 0) {
        setenv("TERM", "vt100", 1);
        setenv("HOME", folder, 1);
        setenv("LSAN_OPTIONS", leaks, 1);
        execl(program, program, "--components", components, (char *)NULL);
        _exit(127);
    }
    size_t at = wait_screen(0, "hm2host: ");
    type("loadrt hm2_po\t\n"); /* completed to hm2_points_test */
    at = wait_screen(at, "hm2host: ");
    type("setp points.0.s32-i\t 42\n");
    at = wait_screen(at, "hm2host: ");
    type("getp points.0.s32-in\n");
    at = wait_screen(at, "\n42\r\n");
    at = wait_screen(at, "hm2host: ");
    type("bogus\n"); /* an error does not end the prompt */
    at = wait_screen(at, "<stdin>:4: unknown command 'bogus'");
    at = wait_screen(at, "hm2host: ");
    type("\x10\x10\n"); /* Control-P twice: the line before the last again */
    at = wait_screen(at, "\n42\r\n");
    at = wait_screen(at, "hm2host: ");
    type("quit\n");
    wait_screen(at, "points_test: exit");
    int status;
    ck_assert_int_eq(waitpid(pid, &status, 0), pid);
    ck_assert(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    close(terminal);
}
END_TEST

/* ---- LinuxCNC --------------------------------------------------------------------------------------------------- */

static bool have_linuxcnc(void)
{
    if (access(LINUXCNC_MODULES "/siggen.so", R_OK) == 0)
        return true;
    printf("SKIP: LinuxCNC's components are not installed in %s\n", LINUXCNC_MODULES);
    return false;
}

static const char *const linuxcnc_components[] = {
    "siggen",
    "pid",
    "limit1",
    "limit2",
    "limit3",
    "sum2",
    "mult2",
    "mux2",
    "mux4",
    "mux8",
    "mux16",
    "scale",
    "and2",
    "or2",
    "xor2",
    "not",
    "toggle",
    "ddt",
    "integ",
    "lowpass",
    "near",
    "comp",
    "select8",
    "conv_bit_float",
    "conv_bit_s32",
    "conv_bit_u32",
    "conv_float_s32",
    "conv_float_u32",
    "conv_s32_bit",
    "conv_s32_float",
    "conv_s32_u32",
    "conv_u32_bit",
    "conv_u32_float",
    "conv_u32_s32",
    "abs",
    "offset",
    "invert",
    "hypot",
    "minmax",
    "deadzone",
    "edge",
    "oneshot",
    "timedelay",
    "debounce",
    "flipflop",
    "counter",
    "encoder",
    "stepgen",
    "pwmgen",
    "estop_latch",
    "watchdog",
    "charge_pump",
    "bldc",
    "sim_encoder",
    "simple_tp",
    "lut5",
};

START_TEST(components_of_linuxcnc_load_run_and_unload)
{
    if (!have_linuxcnc())
        return;
    static const struct {
        const char *name, *arguments;
    } needs[] = {{"stepgen", "step_type=0"}, {"encoder", "num_chan=1"},    {"pwmgen", "output_type=0"},
                 {"bldc", "cfg=q"},          {"watchdog", "num_inputs=1"}, {"debounce", "cfg=2"}};
    const char *const name = linuxcnc_components[_i];
    const char *arguments = "";
    for (size_t i = 0; i < sizeof needs / sizeof needs[0]; i++) {
        if (strcmp(needs[i].name, name) == 0)
            arguments = needs[i].arguments;
    }
    char text[1024], add[2048] = "";
    snprintf(text, sizeof text, "loadrt threads name1=t period1=1000000\nloadrt %s %s\nlist funct\n", name, arguments);
    ck_assert_int_eq(run_hal(text), 0);
    /* Second run: every function in the thread. */
    size_t used = 0;
    for (char *word = strtok(host.text, " \n"); word; word = strtok(NULL, " \n"))
        used += (size_t)snprintf(add + used, sizeof add - used, "addf %s t\n", word);
    strncat(text, add, sizeof text - strlen(text) - 1);
    strncat(text, "start\nrun 0.05\nstop\nshow all\nunloadrt all\nlist pin\necho end\n",
            sizeof text - strlen(text) - 1);
    ck_assert_int_eq(run_hal(text), 0);
    expect_text("\n\nend\n");
}
END_TEST

/* Two modules, one of which calls the other's functions. Also without an address the driver makes firewall rules, and
 * leaves them behind: it gets a network of its own for them. */
START_TEST(the_mesa_driver_of_linuxcnc_loads_and_unloads)
{
    if (!have_linuxcnc())
        return;
    if (unshare(CLONE_NEWNET)) {
        printf("SKIP: no network namespace for the firewall rules of hm2_eth: %s\n", strerror(errno));
        return;
    }
    ck_assert_int_eq(run_hal("loadrt hostmot2\nloadrt hm2_eth\nlist comp\n"), 0);
    expect_text("\nhm2_eth hostmot2 \n");
    expect_text("hm2: unloading");
}
END_TEST

START_TEST(a_sine_of_siggen_goes_through_a_limit)
{
    if (!have_linuxcnc())
        return;
    ck_assert_int_eq(run_hal("loadrt threads name1=t period1=1000000\nloadrt siggen\nloadrt limit1\nloadrt minmax\n"
                             "addf siggen.0.update t\naddf limit1.0 t\naddf minmax.0 t\n"
                             "net a siggen.0.sine => limit1.0.in\nnet b limit1.0.out => minmax.0.in\n"
                             "setp siggen.0.frequency 20\nsetp siggen.0.amplitude 3\nsetp limit1.0.max 2\n"
                             "setp limit1.0.min -1\nstart\nrun 0.5\nstop\ngetp minmax.0.max\ngetp minmax.0.min\n"),
                     0);
    expect_text("2\n-1\n");
}
END_TEST

/* Both hosts' tables for one file, made comparable: what differs by nature is taken out. */
static void normalise(char *const text)
{
    char *to = text;
    for (char *line = text, *next; line && *line; line = next) {
        next = strchr(line, '\n');
        if (next)
            *next++ = '\0';
        const char *from = line;
        int id = 0, used = 0;
        char type[8];
        if (strstr(line, "  User  ") || strncmp(line, "Note: ", 6) == 0)
            continue;
        /* Owner numbers count differently, addresses are addresses. */
        if (sscanf(line, " %5d  %*12[0-9a-f]  %*12[0-9a-f]%n", &id, &used) == 1 && used > 30)
            from = line + 34;
        else if (sscanf(line, "%6d  %7[a-zRT0-9]%n", &id, type, &used) == 2 && used > 8)
            from = line + 6;
        const size_t length = strlen(from);
        memmove(to, from, length);
        to += length;
        *to++ = '\n';
    }
    *to = '\0';
}

/* Name the first line that differs: the whole texts are too long for a message. */
static void expect_same_lines(const char *ours, const char *theirs)
{
    for (unsigned line = 1; *ours || *theirs; line++) {
        const size_t our_length = strcspn(ours, "\n"), their_length = strcspn(theirs, "\n");
        if (our_length != their_length || strncmp(ours, theirs, our_length) != 0)
            ck_abort_msg("line %u: '%.*s' here, '%.*s' there", line, (int)our_length, ours, (int)their_length, theirs);
        ours += our_length + (ours[our_length] == '\n');
        theirs += their_length + (theirs[their_length] == '\n');
    }
}

START_TEST(show_and_save_print_what_halcmd_prints)
{
    static const char text[] = "loadrt threads name1=fast period1=250000 name2=servo period2=1000000\n"
                               "loadrt siggen num_chan=2\nloadrt and2\nloadrt pid num_chan=3\nloadrt scale count=2\n"
                               "addf siggen.0.update servo\naddf and2.0 fast\naddf pid.0.do-pid-calcs servo\n"
                               "newsig foo float\nnewsig un bit\n"
                               "net sine siggen.0.sine => pid.0.command scale.0.in\nnet sq <= siggen.0.square\n"
                               "net cl siggen.0.clock and2.0.in0\nnet both pid.0.tune-start <=> pid.2.tune-start "
                               "pid.1.tune-start => and2.0.in1\n"
                               "setp siggen.0.amplitude 2.5\nsetp siggen.1.frequency 0.1\nsetp pid.0.Pgain 1e-12\n"
                               "setp pid.0.Igain 1e20\nsetp pid.0.Dgain -123.456789\n"
                               "alias pin siggen.1.sine longer-name\nalias param siggen.0.update.tmax pp\n"
                               "setp pp 77\nsets foo 3.25\nshow all\nshow pin siggen.0.* pid.0.c*\nshow sig foo\n"
                               "show alias\nlist pin siggen*\nlist sig\nlist funct\nlist thread\nlist param\n"
                               "status lock\nsave\nsave allu\nsave sig\nsave sigu\nsave link\nsave linka\nsave net\n"
                               "save neta\nsave netl\nsave netla\nsave param\nsave thread\nsave alias\n"
                               "save unconnectedinpins\ngetp siggen.0.amplitude\ngets foo\nptype pid.0.bias\n"
                               "stype foo\ngetp pid.0.tune-cycles\n";
    char script[512];
    snprintf(script, sizeof script, "%s/tests/system/halrun-user", TEST_SOURCE);
    const char *const argv[] = {script, write_file("t.hal", text), NULL};
    const int status = process_run(&peer, argv, 90000);
    if (status == SKIPPED) {
        printf("%s", peer.text);
        return;
    }
    ck_assert_msg(status == 0, "halrun: %s", peer.text);
    ck_assert_int_eq(run_hal(text), 0);
    normalise(peer.text);
    normalise(host.text);
    expect_same_lines(host.text, peer.text);
}
END_TEST

/* The binder and a component, compiled against LinuxCNC's headers, load here just the same. */
START_TEST(a_component_built_with_linuxcncs_headers_loads)
{
    if (access(LINUXCNC_HEADERS "/hal.h", R_OK) || !process_find("cc")) {
        printf("SKIP: LinuxCNC's headers (linuxcnc-uspace-dev) or a C compiler are not installed\n");
        return;
    }
    char command[2048];
    snprintf(command, sizeof command,
             "cd '%s' && cc -std=gnu11 -O2 -Wall -Wextra -Werror -DRTAPI -D_GNU_SOURCE -D__MODULE__ -DSIM -fPIC "
             "-I" LINUXCNC_HEADERS " -Ilib/include -Icomponents -shared -o '%s' tests/components/hm2_points_test.c "
             "components/common/hal_binder.c lib/core/*.c -lm",
             TEST_SOURCE, in_folder("hm2_points_test.so"));
    const char *const argv[] = {"sh", "-c", command, NULL};
    ck_assert_msg(process_run(&peer, argv, 120000) == 0, "cc: %s", peer.text);
    const char *const direct[] = {process_built("hm2host"),          "--components", folder,       "-e",
                                  "loadrt hm2_points_test labels=x", "-e",           "list funct", NULL};
    ck_assert_int_eq(process_run(&host, direct, END_MS), 0);
    expect_text("label 0 is 'x', number 0\npoints.0.update \n");
}
END_TEST

#define COUNT(array) ((int)(sizeof(array) / sizeof((array)[0])))

int main(void)
{
    Suite *const suite = suite_create("hm2host");
    TCase *const tests = tcase_create("program");
    tcase_set_timeout(tests, 120);
    tcase_add_checked_fixture(tests, make_folder, remove_folder);
    tcase_add_test(tests, a_good_file_runs_to_its_end);
    tcase_add_loop_test(tests, a_bad_file_ends_with_its_place_and_the_reason, 0, COUNT(bad_files));
    tcase_add_test(tests, after_an_error_nothing_keeps_running);
    tcase_add_test(tests, errors_in_sourced_files_name_the_inner_file);
    tcase_add_test(tests, files_that_source_each_other_for_ever_are_refused);
    tcase_add_test(tests, several_files_and_commands_run_in_their_order);
    tcase_add_test(tests, commands_come_from_standard_input_without_a_file);
    tcase_add_loop_test(tests, options_do_what_the_help_says, 0, COUNT(options));
    tcase_add_test(tests, threads_run_at_their_periods);
    tcase_add_test(tests, messages_of_threads_are_printed);
    tcase_add_test(tests, missing_realtime_rights_are_told);
    tcase_add_loop_test(tests, threads_keep_away_from_those_of_other_hosts, 0, 2);
    tcase_add_test(tests, a_function_that_hangs_ends_the_program_with_its_name);
    tcase_add_test(tests, an_interrupt_ends_run_and_the_file_goes_on);
    tcase_add_test(tests, termination_unloads_everything);
    tcase_add_test(tests, the_thread_loop_makes_no_system_call_but_to_sleep);
    tcase_add_test(tests, json_is_json);
    tcase_add_test(tests, the_manual_page_knows_every_option_and_command);
    tcase_add_test(tests, the_prompt_completes_and_remembers);
    tcase_add_loop_test(tests, components_of_linuxcnc_load_run_and_unload, 0, COUNT(linuxcnc_components));
    tcase_add_test(tests, the_mesa_driver_of_linuxcnc_loads_and_unloads);
    tcase_add_test(tests, a_sine_of_siggen_goes_through_a_limit);
    tcase_add_test(tests, show_and_save_print_what_halcmd_prints);
    tcase_add_test(tests, a_component_built_with_linuxcncs_headers_loads);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
