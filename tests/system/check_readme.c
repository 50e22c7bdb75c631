/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The README's commands, taken from its text and carried out as they are printed there. Programs that use the usual
 * port and the addresses of the text get a network of their own.
 */
#include <arpa/inet.h>
#include <check.h>
#include <ctype.h>
#include <errno.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "folder.h"
#include "process.h"
#include "suite.h"

#define READY_MS   20000
#define END_MS     60000
#define BUILD_MS   600000
#define TRIES      3u
#define BLOCKS     16u
#define BLOCK_SIZE 4096u
#define STEP       (1.0 / 200.0) /* the example's position-scale is 200 */

static struct process card, host, builder;
static char folder[FOLDER_PATH];

/* ---- blocks of the text ----------------------------------------------------------------------------------------- */

static char blocks[BLOCKS][BLOCK_SIZE];
static unsigned block_count;

static bool is_blank(const char *const line)
{
    return line[strspn(line, " \n")] == '\0';
}

/* Lines indented by four are one block, with the empty lines between them. */
static void read_blocks(void)
{
    char line[512];
    bool inside = false;
    unsigned blank = 0;
    FILE *const file = fopen(TEST_SOURCE "/README.md", "r");
    ck_assert_ptr_nonnull(file);
    block_count = 0;
    while (fgets(line, sizeof line, file)) {
        const bool indented = strncmp(line, "    ", 4) == 0;
        if (is_blank(line)) {
            blank++;
            continue;
        }
        if (indented && !inside) {
            ck_assert_uint_lt(block_count, BLOCKS);
            blocks[block_count++][0] = '\0';
        }
        if (indented) {
            char *const block = blocks[block_count - 1];
            const size_t used = strlen(block);
            ck_assert_uint_lt(used + blank + strlen(line), BLOCK_SIZE);
            snprintf(block + used, BLOCK_SIZE - used, "%.*s%s", inside ? (int)blank : 0, "\n\n\n\n", line + 4);
        }
        inside = indented;
        blank = 0;
    }
    fclose(file);
}

/* The one block that has this text. */
static const char *block_with(const char *const text)
{
    const char *found = NULL;
    for (unsigned i = 0; i < block_count; i++) {
        if (!strstr(blocks[i], text))
            continue;
        ck_assert_msg(!found, "two blocks of the README have \"%s\"", text);
        found = blocks[i];
    }
    ck_assert_msg(found != NULL, "no block of the README has \"%s\"", text);
    return found;
}

/* ---- places ----------------------------------------------------------------------------------------------------- */

static void make_folder(void)
{
    char path[128];
    read_blocks();
    folder_make(folder, "readme");
    snprintf(path, sizeof path, "%s/build", folder);
    ck_assert_int_eq(symlink(TEST_BUILD, path), 0);
    ck_assert_int_eq(chdir(folder), 0);
}

static void remove_folder(void)
{
    ck_assert_int_eq(chdir("/"), 0);
    folder_remove(folder);
}

static int set_address(const int fd, const char *const name, const char *const address)
{
    struct ifreq request = {.ifr_flags = 0};
    struct sockaddr_in at = {.sin_family = AF_INET};
    snprintf(request.ifr_name, sizeof request.ifr_name, "%s", name);
    ck_assert_int_eq(inet_pton(AF_INET, address, &at.sin_addr), 1);
    memcpy(&request.ifr_addr, &at, sizeof at);
    return ioctl(fd, SIOCSIFADDR, &request);
}

/* A loopback of this test's own, with the address of the README's real card. False when that is not permitted. */
static bool enter_own_network(void)
{
    struct ifreq up = {.ifr_name = "lo"};
    if (unshare(CLONE_NEWNET) && unshare(CLONE_NEWUSER | CLONE_NEWNET)) {
        printf("SKIP: no network namespace for the README's addresses: %s\n", strerror(errno));
        return false;
    }
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ck_assert_int_eq(set_address(fd, "lo", "127.0.0.1"), 0);
    ck_assert_int_eq(ioctl(fd, SIOCGIFFLAGS, &up), 0);
    up.ifr_flags = (short)(up.ifr_flags | IFF_UP);
    ck_assert_int_eq(ioctl(fd, SIOCSIFFLAGS, &up), 0);
    ck_assert_int_eq(set_address(fd, "lo:1", "192.168.1.121"), 0);
    close(fd);
    return true;
}

/* A command line of the README, in a shell. */
static void start_line(struct process *const process, const char *const line, const char *const more)
{
    char command[1024];
    snprintf(command, sizeof command, "exec %.*s %s", (int)strcspn(line, "\n"), line, more);
    const char *const argv[] = {"sh", "-c", command, NULL};
    process_start(process, argv);
}

static void start_card(const char *const more)
{
    start_line(&card, block_with("build/hm2sim "), more);
    if (!process_wait_line(&card, "ready 7i96s@", READY_MS, NULL))
        ck_abort_msg("hm2sim: %s", card.text);
}

/* ---- the worked example ----------------------------------------------------------------------------------------- */

static void write_file(const char *const name, const char *const text)
{
    FILE *const file = fopen(name, "w");
    ck_assert_ptr_nonnull(file);
    ck_assert_int_ge(fputs(text, file), 0);
    ck_assert_int_eq(fclose(file), 0);
}

/* The number that it prints; messages are no numbers. */
static bool run_example(double *const printed)
{
    bool found = false;
    start_line(&host, block_with("build/hm2host "), "");
    if (!process_wait_end(&host, END_MS))
        ck_abort_msg("hm2host does not end: %s", host.text);
    for (const char *line = host.text; *line; line += strcspn(line, "\n"), line += *line == '\n') {
        char *end;
        const double number = strtod(line, &end);
        if (end == line || *end != '\n')
            continue;
        ck_assert_msg(!found, "two numbers: %s", host.text);
        *printed = number;
        found = true;
    }
    return found && host.status == 0;
}

START_TEST(the_worked_example_moves_the_axis_to_10)
{
    double printed = 0;
    bool good = false;
    if (!enter_own_network())
        return;
    start_card("");
    write_file("axis.hal", block_with("loadrt scurve"));
    /* On a busy machine the card, which runs here as printed, without realtime, may be too late for the cycle. */
    for (unsigned i = 0; i < TRIES && !good; i++)
        good = run_example(&printed) && printed >= 10 - STEP && printed <= 10 + STEP;
    ck_assert_msg(good, "status %d: %s", host.status, host.text);
    ck_assert_int_eq(process_stop(&card, SIGTERM, END_MS), 0);
}
END_TEST

START_TEST(the_new_loadrt_line_loads_a_card_and_keeps_the_old_ones_parameters)
{
    char line[512], plus[512] = "", minus[512] = "";
    if (!enter_own_network())
        return;
    start_card("--bind 192.168.1.121");
    for (const char *at = block_with("-loadrt hostmot2"); *at; at += strcspn(at, "\n"), at += *at == '\n') {
        snprintf(line, sizeof line, "%.*s", (int)strcspn(at, "\n"), at);
        memcpy(*line == '+' ? plus : minus, line, sizeof line);
    }
    const char *const parameters = strstr(plus, " board_ip=");
    ck_assert(parameters && strstr(minus, "hm2_eth") && strstr(minus, parameters));
    const char *const argv[] = {"build/hm2host", "-e", plus + 1, "-e", "list funct", NULL};
    ck_assert_msg(process_run(&host, argv, END_MS) == 0, "%s", host.text);
    ck_assert_ptr_nonnull(strstr(host.text, "hm2_7i96s.0.write"));
    ck_assert_int_eq(process_stop(&card, SIGTERM, END_MS), 0);
}
END_TEST

/* ---- the two commands ------------------------------------------------------------------------------------------- */

/* A script of the text is there and can be executed. */
static void expect_script(const char *const line)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%.*s", TEST_SOURCE, (int)strcspn(line, " \n"), line);
    ck_assert_msg(access(path, X_OK) == 0, "%s", path);
}

/* The demo is run by its own test, and scripts/test is what runs this one: here it is only known that they exist. */
START_TEST(the_two_commands_are_there)
{
    unsigned commands = 0;
    for (const char *at = block_with("scripts/demo"); *at; at += strcspn(at, "\n"), at += *at == '\n') {
        expect_script(at);
        commands++;
    }
    ck_assert_uint_eq(commands, 2);
}
END_TEST

/* ---- building --------------------------------------------------------------------------------------------------- */

/* Run a command line of the README whose make builds in, and installs below, this test's folder and nowhere else. */
static void build(const char *const command)
{
    char script[2048];
    snprintf(script, sizeof script,
             "unset MAKEFLAGS MAKELEVEL MFLAGS BUILDDIR SANITIZE CFLAGS\n"
             "make() { command make -s -j2 -C '%s' \"$@\" BUILDDIR='%s/own' DESTDIR='%s/package'; }\n%s",
             TEST_SOURCE, folder, folder, command);
    const char *const argv[] = {"sh", "-c", script, NULL};
    if (process_run(&builder, argv, BUILD_MS) == 0)
        return;
    printf("%s\n", builder.text); /* Check's own messages are short */
    ck_abort_msg("%s: status %d", command, builder.status);
}

/* The targets that the text names are in the list that was printed. */
static void expect_targets(void)
{
    static const char start[] = "everything else: ";
    const char *at = strstr(block_with("make help"), start);
    ck_assert_ptr_nonnull(at);
    for (at += strlen(start); *at && *at != '\n'; at += strspn(at, " ")) {
        char target[64];
        const size_t len = strcspn(at, " \n");
        snprintf(target, sizeof target, "\n  %.*s ", (int)len, at);
        ck_assert_msg(strstr(builder.text, target) != NULL, "make help has no%s: %s", target, builder.text);
        at += len;
    }
}

static void expect_package(void)
{
    static const char *const files[] = {"bin/hm2host",
                                        "bin/hm2sim",
                                        "lib/libhm2.a",
                                        "lib/hm2/components/hm2_lbp16.so",
                                        "include/hm2/board.h",
                                        "share/man/man9/hm2_lbp16.9",
                                        "share/man/man1/hm2sim.1"};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        char path[256];
        snprintf(path, sizeof path, "package/usr/%s", files[i]);
        ck_assert_msg(access(path, R_OK) == 0, "%s was not installed", path);
    }
}

static void expect_linuxcnc_package(void)
{
    const char *const argv[] = {"sh", "-c", "find package -path '*linuxcnc*' -name hm2_lbp16.so | grep .", NULL};
    ck_assert_msg(process_run(&builder, argv, END_MS) == 0,
                  "the component for LinuxCNC was not installed below DESTDIR");
}

/* The include line and the command in its comment, on a program that calls the library. */
static void compile_against_the_package(void)
{
    char source[512], command[512], script[1024];
    const char *const line = block_with("#include <hm2/board.h>");
    const char *const start = strstr(line, "/* "), *const end = strstr(line, " */");
    ck_assert(start && end);
    snprintf(source, sizeof source,
             "%sint main(void) { struct hm2_board *board = hm2_board_new(); hm2_board_free(board); return !board; }\n",
             line);
    write_file("program.c", source);
    snprintf(command, sizeof command, "%.*s", (int)(end - start) - 3, start + 3);
    snprintf(script, sizeof script,
             "export PKG_CONFIG_PATH='%s/package/usr/lib/pkgconfig' PKG_CONFIG_SYSROOT_DIR='%s/package'; %s && "
             "LD_LIBRARY_PATH='%s/package/usr/lib' ./a.out",
             folder, folder, command, folder);
    const char *const argv[] = {"sh", "-ec", script, NULL};
    ck_assert_msg(process_run(&builder, argv, END_MS) == 0, "%s: %s", command, builder.text);
}

static bool can_be_run(const char *const line)
{
    if (strncmp(line, "scripts/", strlen("scripts/")) == 0) {
        expect_script(line); /* installs packages of its own: not for a test among others */
        return false;
    }
    if (strstr(line, "linuxcnc") && access("/usr/include/linuxcnc/hal.h", R_OK)) {
        printf("SKIP: LinuxCNC's headers (linuxcnc-uspace-dev) are not installed\n");
        return false;
    }
    return true;
}

/* What a command must have done or said. */
static const struct {
    const char *command;
    void (*expect)(void);
} results[] = {
    {"make help ", expect_targets},
    {"make install ", expect_package},
    {"make install-linuxcnc ", expect_linuxcnc_package},
};

START_TEST(the_commands_for_building_build_and_install)
{
    const char *const lines = block_with("make help");
    char line[256];
    unsigned found = 0;
    for (const char *at = lines; *at; at += strcspn(at, "\n"), at += *at == '\n') {
        snprintf(line, sizeof line, "%.*s", (int)strcspn(at, "\n"), at);
        if (!can_be_run(line))
            continue;
        build(line);
        for (size_t i = 0; i < sizeof results / sizeof results[0]; i++) {
            if (strncmp(line, results[i].command, strlen(results[i].command)) != 0)
                continue;
            results[i].expect();
            found++;
        }
    }
    ck_assert_uint_ge(found, 2);
    compile_against_the_package();
}
END_TEST

START_TEST(autoconf_makes_a_configure_that_writes_config_mk)
{
    if (!process_find("autoconf")) {
        printf("SKIP: autoconf is not installed\n");
        return;
    }
    const char *const argv[] = {
        "sh", "-ec", "cp '" TEST_SOURCE "/configure.ac' . && autoconf && ./configure --srcdir='" TEST_SOURCE "'", NULL};
    ck_assert_msg(process_run(&builder, argv, BUILD_MS) == 0, "%s", builder.text);
    ck_assert_int_eq(access("config.mk", R_OK), 0);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("readme");
    TCase *const tests = tcase_create("commands");
    tcase_set_timeout(tests, 900);
    tcase_add_checked_fixture(tests, make_folder, remove_folder);
    tcase_add_test(tests, the_worked_example_moves_the_axis_to_10);
    tcase_add_test(tests, the_new_loadrt_line_loads_a_card_and_keeps_the_old_ones_parameters);
    tcase_add_test(tests, the_two_commands_are_there);
    tcase_add_test(tests, the_commands_for_building_build_and_install);
    tcase_add_test(tests, autoconf_makes_a_configure_that_writes_config_mk);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
