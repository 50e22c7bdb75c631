/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The component modules as LinuxCNC gets them: where they are installed, what they show and call, that their sources
 * keep to what LinuxCNC 2.9 and master have in common (tests/data/linuxcnc/README.md), and that each of them loads into
 * the LinuxCNC of this machine as an ordinary user.
 */
#include <check.h>
#include <errno.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "linuxcnc_peer.h"
#include "process.h"
#include "suite.h"

#define RUN_LIMIT_MS  240000
#define LOAD_LIMIT_MS 100000
#define DATA          TEST_DATA "/linuxcnc"

/* How each module is loaded, and a function that it must offer then. */
static const struct component {
    const char *name, *arguments, *function;
} components[] = {
    {"can_cia402", "count=2", "cia402.update"},
    {"can_io", NULL, NULL},   /* needs a CAN bus */
    {"hm2_7i65", NULL, NULL}, /* needs a card with buffered SPI */
    {"hm2_lbp16", "board_ip=192.168.1.121", "hm2_7i96s.0.read"},
    {"modbus_io", NULL, NULL},         /* needs a file */
    {"hm2_pty", NULL, NULL},           /* needs a card with serial ports */
    {"ppmc_epp", NULL, "ppmc.0.read"}, /* check_ppmc loads it, with a bus */
    {"recorder", "pins=2 depth=100 file=$(PEER_OUT)/recorded", "recorder.sample"},
    {"scurve", "count=2", "scurve.update"},
};
#define COMPONENTS (sizeof components / sizeof components[0])

static struct process run;

/* ---- helpers ------------------------------------------------------------------------------------------------------
 */

/* What a shell command prints; its status is left in run.status. $BUILD, $SOURCE and $DATA are set. */
static const char *shell(const char *const command)
{
    const char *const argv[] = {"sh", "-c", command, NULL};
    ck_assert_int_eq(setenv("BUILD", TEST_BUILD, 1), 0);
    ck_assert_int_eq(setenv("SOURCE", TEST_SOURCE, 1), 0);
    ck_assert_int_eq(setenv("DATA", DATA, 1), 0);
    /* A make that runs this test has told its children how it was called; those below are on their own. */
    unsetenv("MAKEFLAGS");
    unsetenv("MAKELEVEL");
    process_run(&run, argv, RUN_LIMIT_MS);
    return run.text;
}

/* The command says what is wrong, or nothing. */
static void expect_silence(const char *const command)
{
    if (*shell(command) || run.status != 0)
        process_give_up(&run, command);
}

static bool can_build(void)
{
    if (process_find("halcompile"))
        return true;
    printf("SKIP: LinuxCNC's development files are not installed (linuxcnc-uspace-dev)\n");
    return false;
}

/* ---- where they go ------------------------------------------------------------------------------------------------
 */

START_TEST(what_is_built_is_what_there_are_sources_for_and_what_this_test_loads)
{
    glob_t found;
    if (!can_build())
        return;
    ck_assert_int_eq(glob(TEST_SOURCE "/components/*/main.c", 0, NULL, &found), 0);
    ck_assert_uint_eq(found.gl_pathc, COMPONENTS);
    globfree(&found);
    for (size_t i = 0; i < COMPONENTS; i++) {
        char path[512];
        snprintf(path, sizeof path, TEST_BUILD "/linuxcnc/%s.so", components[i].name);
        ck_assert_msg(access(path, R_OK) == 0, "%s: %s", path, strerror(errno));
    }
}
END_TEST

START_TEST(installing_puts_every_module_where_linuxcnc_loads_from_and_uninstalling_takes_it_away)
{
    if (!can_build())
        return;
    /* siggen.so is one of LinuxCNC's own: its folder is the right one. */
    expect_silence("set -e; root=$(mktemp -d); trap 'rm -r $root' EXIT\n"
                   "folder=$($SOURCE/scripts/linuxcnc-dev modules); test -r $folder/siggen.so\n"
                   "make -s -C $SOURCE BUILDDIR=$BUILD DESTDIR=$root install-linuxcnc >$root/log\n"
                   "for module in $BUILD/linuxcnc/*.so; do cmp $module $root$folder/${module##*/}; done\n"
                   "find $root$folder -type f ! -perm 644\n"
                   "make -s -C $SOURCE BUILDDIR=$BUILD DESTDIR=$root uninstall-linuxcnc\n"
                   "find $root$folder -type f");
}
END_TEST

/* A tree that runs in place and an installed one: both folders are in the same Makefile.modinc. */
START_TEST(of_the_folders_that_makefile_modinc_sets_the_one_that_counts_is_taken)
{
    expect_silence(
        "set -e; work=$(mktemp -d); trap 'rm -r $work' EXIT; mkdir $work/include; touch $work/include/hal.h\n"
        "printf '#!/bin/sh\\necho %s/$1.inc\\n' $work >$work/halcompile; chmod +x $work/halcompile\n"
        "for in_place in yes no; do\n"
        "cat >$work/--print-modinc.inc <<END\n"
        "RUN_IN_PLACE=$in_place\n"
        "ifeq (\\$(RUN_IN_PLACE),yes)\n"
        "EXTRA_CFLAGS := -O9 -DRTAPI -Irelative -I$work/include\n"
        "RTLIBDIR := /in/place\n"
        "else\n"
        "EXTRA_CFLAGS := -DRTAPI -I/nowhere\n"
        "RTLIBDIR := /in/stalled\n"
        "endif\n"
        "END\n"
        "ask() { HALCOMPILE=$work/halcompile $SOURCE/scripts/linuxcnc-dev $1 2>&1 || :; }\n"
        "ask modules; ask flags | grep -v 'linuxcnc-uspace-dev\\|source tree'; done >$work/answers\n"
        "cat >$work/expected <<END\n"
        "/in/place\n"
        "-DRTAPI -isystem $work/include\n"
        "/in/stalled\n"
        "LinuxCNC's development files are missing: no folder that $work/--print-modinc.inc names has hal.h\n"
        "END\n"
        "diff $work/expected $work/answers");
}
END_TEST

START_TEST(no_module_has_the_name_of_one_of_linuxcncs_own)
{
    if (!process_find("dpkg") || !process_find("halrun")) {
        printf("SKIP: LinuxCNC is not installed from a package\n");
        return;
    }
    expect_silence("test -n \"$(dpkg -L linuxcnc-uspace | grep /siggen.so)\" || echo 'no list of files'\n"
                   "for module in $BUILD/linuxcnc/*.so; do\n"
                   "dpkg -L linuxcnc-uspace | grep \"/modules/${module##*/}$\" || :; done");
}
END_TEST

START_TEST(without_linuxcncs_development_files_the_build_says_which_package_has_them)
{
    const char *const text =
        shell("make -s -C $SOURCE BUILDDIR=$BUILD/no-linuxcnc HALCOMPILE=no-such-halcompile install-linuxcnc 2>&1");
    ck_assert_int_ne(run.status, 0);
    if (!strstr(text, "linuxcnc-uspace-dev") || !strstr(text, "no-such-halcompile"))
        process_give_up(&run, "no package name");
    ck_assert_int_ne(access(TEST_BUILD "/no-linuxcnc/linuxcnc", F_OK), 0);
}
END_TEST

/* ---- what they show and call --------------------------------------------------------------------------------------
 */

/* The driver of the cards offers what LinuxCNC's hostmot2 offers to other components, and what hm2_pty needs. */
START_TEST(a_module_shows_its_entry_points_and_module_information_and_nothing_else)
{
    if (!can_build())
        return;
    expect_silence("for module in $BUILD/linuxcnc/*.so; do\n"
                   "nm -D --defined-only $module | sed 's/.* //' >$BUILD/shown\n"
                   "for name in rtapi_app_main rtapi_app_exit rtapi_info_license; do\n"
                   "grep -qx $name $BUILD/shown || echo $module: no $name; done\n"
                   "grep -vxE 'rtapi_app_(main|exit)|rtapi_info_[a-z0-9_]+' $BUILD/shown |\n"
                   "case $module in */hm2_lbp16.so) diff - $DATA/own-calls.txt ;;\n"
                   "*) sed \"s|^|$module |\" ;; esac\n"
                   "done");
}
END_TEST

START_TEST(a_module_calls_only_what_2_9_and_master_have)
{
    if (TEST_SANITIZED) {
        printf("SKIP: a sanitizer adds calls of its own\n");
        return;
    }
    if (!can_build())
        return;
    expect_silence("for module in $BUILD/linuxcnc/*.so; do\n"
                   "nm -D --undefined-only $module | sed 's/.* //' >$BUILD/called\n"
                   "grep -qx hal_init $BUILD/called || echo $module: no hal_init\n"
                   "grep -vE '@|^(__gmon_start__|_ITM_.*|__cxa_finalize)$' $BUILD/called |\n"
                   "grep -vxFf $DATA/common-calls.txt | grep -vxFf $DATA/own-calls.txt | grep -vxFf "
                   "$DATA/library-calls.txt | sed \"s|^|$module |\"\n"
                   "done");
}
END_TEST

START_TEST(the_installed_linuxcnc_has_every_call_of_the_list)
{
    if (!can_build())
        return;
    expect_silence("{ nm -D --defined-only $($SOURCE/scripts/linuxcnc-dev modules)/hal_lib.so;\n"
                   "nm -D --defined-only $(command -v rtapi_app); } | sed 's/.* //' >$BUILD/offered\n"
                   "grep -vxFf $BUILD/offered $DATA/common-calls.txt || :");
}
END_TEST

/* ---- one source ---------------------------------------------------------------------------------------------------
 */

/* Sets $master and $installed to commands that compile $1 to $BUILD/both.o with these headers. -pedantic and the like
 * are not for LinuxCNC's headers; those of master complain with -Wall -Wextra about modules. */
#define COMPILERS                                                                                          \
    "compile() { source=$1; shift; ${CC:-cc} -std=c11 -D_GNU_SOURCE -O1 -Wall -Wextra -Werror \"$@\" \\\n" \
    "-I$SOURCE/lib/include -I$SOURCE/components -c -o $BUILD/both.o $source 2>&1; }\n"                     \
    "master() { compile $1 -isystem $DATA/master -DRTAPI -D__MODULE__; }\n"                                \
    "installed() { compile $1 $($SOURCE/scripts/linuxcnc-dev flags); }\n"

START_TEST(the_sources_compile_with_master_s_differences_and_call_the_same)
{
    if (!can_build())
        return;
    expect_silence(COMPILERS "for source in $SOURCE/components/*/*.c; do\n"
                             "master $source && nm -u $BUILD/both.o >$BUILD/both-master\n"
                             "installed $source && nm -u $BUILD/both.o >$BUILD/both-installed\n"
                             "diff $BUILD/both-master $BUILD/both-installed\n"
                             "done");
}
END_TEST

/* Each of these is fine with 2.9, so only master's difference can be what is refused. */
START_TEST(what_only_2_9_allows_is_refused)
{
    if (!can_build())
        return;
    expect_silence(COMPILERS "for source in $DATA/refused/*.c; do\n"
                             "installed $source || echo $source: refused by 2.9\n"
                             "master $source >$BUILD/refused && echo $source: accepted\n"
                             "grep -q 'refused/.*error' $BUILD/refused || echo $source: not judged\n"
                             "done");
}
END_TEST

/* ---- LinuxCNC -----------------------------------------------------------------------------------------------------
 */

/* A HAL file that loads every module and runs it for a moment, shows what came of it, unloads them, and loads and
 * unloads them again. */
static void write_hal_file(const char *const path)
{
    FILE *const file = fopen(path, "w");
    ck_assert_msg(file, "%s: %s", path, strerror(errno));
    fputs("loadrt threads name1=servo period1=1000000\n", file);
    for (unsigned turn = 0; turn < 2; turn++) {
        for (size_t i = 0; i < COMPONENTS; i++)
            if (components[i].arguments)
                fprintf(file, "loadrt %s %s\nshow comp %s\nshow funct %s\naddf %s servo\n", components[i].name,
                        components[i].arguments, components[i].name, components[i].function, components[i].function);
        fputs("start\nloadusr -w sleep 0.3\nstop\n", file);
        for (size_t i = 0; i < COMPONENTS; i++)
            if (components[i].arguments)
                fprintf(file, "unloadrt %s\n", components[i].name);
    }
    fputs("loadusr -w echo all unloaded\nshow comp\n", file);
    ck_assert_int_eq(fclose(file), 0);
}

static unsigned count(const char *text, const char *const word)
{
    unsigned n = 0;
    while ((text = strstr(text, word))) {
        n++;
        text += strlen(word);
    }
    return n;
}

static void check_loads(void)
{
    const char *const after = strstr(run.text, "all unloaded");
    if (!after || strstr(run.text, "ERROR") || strstr(run.text, "rror:"))
        process_give_up(&run, "LinuxCNC complains");
    for (size_t i = 0; i < COMPONENTS; i++) {
        /* Twice shown with "ready" behind its name; the function follows. */
        if (components[i].arguments && count(run.text, components[i].function) < 2)
            process_give_up(&run, components[i].function);
        /* A line of the list; messages of the loads may come late. */
        char line[64];
        snprintf(line, sizeof line, " RT    %s ", components[i].name);
        if (strstr(after, line))
            process_give_up(&run, "a component that was unloaded is still there");
    }
    ck_assert_int_eq(access(TEST_BUILD "/linuxcnc-load/recorded", R_OK), 0); /* written when it is unloaded */
}

START_TEST(every_module_loads_into_linuxcnc_as_an_ordinary_user_and_unloads_and_loads_again)
{
    static const char out[] = TEST_BUILD "/linuxcnc-load", hal[] = TEST_BUILD "/linuxcnc-load/hal/load.hal";
    const char *const argv[] = {TEST_SOURCE "/tests/system/linuxcnc-peer", TEST_BUILD, out, "7i96s", hal, NULL};
    if (!linuxcnc_loads_ours())
        return;
    expect_silence("rm -rf $BUILD/linuxcnc-load; mkdir -p $BUILD/linuxcnc-load/hal");
    write_hal_file(hal);
    linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    process_start(&run, argv);
    if (linuxcnc_ends_well(&run, LOAD_LIMIT_MS))
        check_loads();
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("linuxcnc_modules");
    TCase *const tests = tcase_create("modules");
    tcase_set_timeout(tests, 270);
    tcase_add_test(tests, what_is_built_is_what_there_are_sources_for_and_what_this_test_loads);
    tcase_add_test(tests, installing_puts_every_module_where_linuxcnc_loads_from_and_uninstalling_takes_it_away);
    tcase_add_test(tests, of_the_folders_that_makefile_modinc_sets_the_one_that_counts_is_taken);
    tcase_add_test(tests, no_module_has_the_name_of_one_of_linuxcncs_own);
    tcase_add_test(tests, without_linuxcncs_development_files_the_build_says_which_package_has_them);
    tcase_add_test(tests, a_module_shows_its_entry_points_and_module_information_and_nothing_else);
    tcase_add_test(tests, a_module_calls_only_what_2_9_and_master_have);
    tcase_add_test(tests, the_installed_linuxcnc_has_every_call_of_the_list);
    tcase_add_test(tests, the_sources_compile_with_master_s_differences_and_call_the_same);
    tcase_add_test(tests, what_only_2_9_allows_is_refused);
    tcase_add_test(tests, every_module_loads_into_linuxcnc_as_an_ordinary_user_and_unloads_and_loads_again);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
