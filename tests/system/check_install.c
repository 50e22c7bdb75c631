/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * From the source archive to an installed tree and back to nothing: the archive builds where there is no git, in a
 * folder of its own; what is installed does not need that folder; uninstalling leaves no file.
 */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "folder.h"
#include "process.h"
#include "suite.h"

#define BUILD_MS 600000
#define USE_MS   60000

/* With: src the unpacked archive, out the build, usr the installation, work for the tests. */
static char folder[FOLDER_PATH];
static struct process shell;

/* Run a script in the folder. */
static void run(const char *const script, const int limit_ms)
{
    static char whole[4096];
    const int len = snprintf(
        whole, sizeof whole,
        "unset MAKEFLAGS MAKELEVEL MFLAGS BUILDDIR SANITIZE CFLAGS LDFLAGS PKG_CONFIG_SYSROOT_DIR\n"
        "cd '%s'; here=$PWD\n"
        "export PKG_CONFIG_PATH=$here/usr/lib/pkgconfig\n"
        "make() { command make -s -j2 -C \"$here/src\" BUILDDIR=\"$here/out\" prefix=\"$here/usr\" \"$@\"; }\n%s",
        folder, script);
    ck_assert_uint_lt((size_t)len, sizeof whole);
    const char *const argv[] = {"sh", "-ec", whole, NULL};
    if (process_run(&shell, argv, limit_ms) != 0)
        ck_abort_msg("%s\nended with %d: %s", script, shell.status, shell.text);
}

/* Once, before the tests: build from the archive, install, and throw sources and build away. */
static void install_from_archive(void)
{
    folder_make(folder, "install");
    run("mkdir src out work\n"
        "if git -C '" TEST_SOURCE "' rev-parse 2>/dev/null; then\n"
        "    command make -s -C '" TEST_SOURCE "' dist BUILDDIR=$here/out\n"
        "    tar -xzf out/libhm2-*.tar.gz --strip-components=1 -C src\n"
        "    rm -r out\n"
        "else\n" /* this is the unpacked archive */
        "    cp -R '" TEST_SOURCE "'/[A-Za-z]* src\n"
        "    rm -rf src/build* src/config.mk\n"
        "fi\n"
        "find src | sort >work/sources\n"
        "make all\n"
        "make install\n"
        "find src | sort | diff work/sources -\n", /* nothing was written there */
        BUILD_MS);
}

static void remove_folder(void)
{
    folder_remove(folder);
}

/* Nothing may come from the sources or the build any more. */
#define HIDE "mv out src work/; trap 'cd $here; mv work/out work/src .' EXIT\n"

#define PROGRAM                                         \
    "cat >work/program.c <<'EOF'\n"                     \
    "#include <hm2/board.h>\n"                          \
    "#include <stdio.h>\n"                              \
    "int main(void)\n"                                  \
    "{\n"                                               \
    "    struct hm2_board *board = hm2_board_new();\n"  \
    "    puts(hm2_board_type_find(\"7I96S\")->stem);\n" \
    "    hm2_board_free(board);\n"                      \
    "    return !board;\n"                              \
    "}\n"                                               \
    "EOF\n"

START_TEST(a_program_builds_and_runs_with_the_shared_library)
{
    run(PROGRAM "cc -Wall -Werror work/program.c $(pkg-config --cflags --libs libhm2) -o work/shared\n"
                "readelf -d work/shared | grep -q 'NEEDED.*libhm2.so.0'\n" HIDE
                "LD_LIBRARY_PATH=usr/lib work/shared | grep -x '7i96s'\n",
        USE_MS);
}
END_TEST

START_TEST(a_program_builds_and_runs_with_the_static_library)
{
    run(PROGRAM "mkdir -p work/so; mv usr/lib/libhm2.so* work/so/; trap 'mv work/so/* usr/lib/' EXIT\n"
                "cc -Wall -Werror work/program.c $(pkg-config --cflags --libs --static libhm2) -o work/static\n"
                "work/static | grep -x '7i96s'\n",
        USE_MS);
}
END_TEST

START_TEST(the_package_file_tells_the_version_of_the_programs)
{
    run("[ \"$(pkg-config --modversion libhm2)\" = \"$(sed -n 's/^VERSION := //p' src/Makefile)\" ]\n"
        "usr/bin/hm2sim --version | grep -F \"$(pkg-config --modversion libhm2)\"\n",
        USE_MS);
}
END_TEST

START_TEST(every_public_header_compiles_by_itself)
{
    run("for header in usr/include/hm2/*.h; do\n"
        "    echo \"#include <hm2/${header##*/}>\" >work/header.c\n"
        "    cc -std=c11 -Wall -Wextra -Wpedantic -Werror $(pkg-config --cflags libhm2) -fsyntax-only work/header.c\n"
        "done\n",
        USE_MS);
}
END_TEST

START_TEST(the_installed_host_finds_the_installed_components)
{
    run(HIDE "usr/bin/hm2host -e 'loadrt scurve' -e 'list comp' | grep -wF scurve\n", USE_MS);
}
END_TEST

START_TEST(the_installed_host_runs_a_card_of_the_installed_simulator)
{
    run("usr/bin/hm2sim --card 7i96s --port 0 >work/sim.log &\n"
        "sim=$!; trap 'kill $sim' EXIT\n"
        "for i in 1 2 3 4 5 6 7 8 9 10; do card=$(sed -n 's/^ready 7i96s@//p' work/sim.log); [ -z \"$card\" ] || "
        "break; "
        "sleep 0.5; done\n"
        "usr/bin/hm2host -e \"loadrt hm2_lbp16 board_ip=$card\" -e 'list funct' | grep -F hm2_7i96s.0.read\n",
        USE_MS);
}
END_TEST

START_TEST(a_staged_installation_has_the_same_files_and_no_trace_of_the_stage)
{
    run("make install DESTDIR=$here/work/stage\n"
        "(cd usr && find . ! -type d | sort) >work/direct\n"
        "(cd work/stage$here/usr && find . ! -type d | sort) | diff work/direct -\n"
        "diff usr/lib/pkgconfig/libhm2.pc work/stage$here/usr/lib/pkgconfig/libhm2.pc\n"
        "if grep -rlF work/stage work/stage; then exit 1; fi\n",
        USE_MS);
}
END_TEST

START_TEST(configure_says_where_the_installation_goes)
{
    if (!process_find("autoconf")) {
        printf("SKIP: autoconf is not installed\n");
        return;
    }
    run("cp -R src work/conf; cd work/conf; autoconf; ./configure -q --prefix=/opt/x --libdir=/opt/x/lib64\n"
        "command make -s BUILDDIR=$here/work/conf-out $here/work/conf-out/libhm2.pc\n"
        "grep -x 'libdir=/opt/x/lib64' $here/work/conf-out/libhm2.pc\n"
        "[ \"$(PKG_CONFIG_PATH=$here/work/conf-out pkg-config --variable=prefix libhm2)\" = /opt/x ]\n",
        USE_MS);
}
END_TEST

START_TEST(uninstalling_leaves_no_file)
{
    run("cp -R usr work/kept; echo other >usr/lib/other; make uninstall\n"
        "[ \"$(find usr ! -type d)\" = usr/lib/other ]\n"
        "rm -r usr; mv work/kept usr\n",
        USE_MS);
}
END_TEST

int main(void)
{
    if (TEST_SANITIZED) {
        printf("SKIP: what is installed is built without the sanitizer, so it would test nothing\n");
        return 0;
    }
    Suite *const suite = suite_create("install");
    TCase *const tests = tcase_create("installed tree");
    tcase_set_timeout(tests, 2.0 * USE_MS / 1000.0);
    tcase_add_unchecked_fixture(tests, install_from_archive, remove_folder);
    tcase_add_test(tests, a_program_builds_and_runs_with_the_shared_library);
    tcase_add_test(tests, a_program_builds_and_runs_with_the_static_library);
    tcase_add_test(tests, the_package_file_tells_the_version_of_the_programs);
    tcase_add_test(tests, every_public_header_compiles_by_itself);
    tcase_add_test(tests, the_installed_host_finds_the_installed_components);
    tcase_add_test(tests, the_installed_host_runs_a_card_of_the_installed_simulator);
    tcase_add_test(tests, a_staged_installation_has_the_same_files_and_no_trace_of_the_stage);
    tcase_add_test(tests, configure_says_where_the_installation_goes);
    tcase_add_test(tests, uninstalling_leaves_no_file);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
