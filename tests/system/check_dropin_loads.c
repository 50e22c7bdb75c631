/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Load line for load line: what LinuxCNC's driver (hostmot2 and hm2_eth) makes of a config= string, and what our
 * component makes of it, with the same simulated card and in virtual time (tests/system/dropin). Where the former
 * loads, the latter must, and with the same objects; where ours refuses, it says in a sentence which word it does not
 * like. What is different is listed, with its reason, in tests/data/dropin/differences.
 */
#include <check.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dropin/driver.h"
#include "dropin_table.h"
#include "process.h"
#include "shared_memory.h"
#include "suite.h"

#define MAX_POINTS 800u
#define MESSAGES   65536u

/* One word a line, where the reviewed table names it by its number: what follows the card in WHERE. */
struct line {
    const char *name, *card, *config;
    const char *firmware; /* NULL = the card's usual one */
};

#define UARTS    TEST_DATA "/firmware/uart_48.hex"
#define PKTUARTS TEST_DATA "/hm2_pty/PKTUART_0.hex"

static const struct line lines[] = {
/* every count: none, one, all, and more than any firmware has */
#define LINE(name, card, config) \
    {                            \
        name, card, config, NULL \
    }
#define COUNTS(key)                                                                                           \
    LINE(key "=0", "7i96s", key "=0"), LINE(key "=1", "7i96s", key "=1"), LINE(key "=-1", "7i93", key "=-1"), \
        LINE(key "=99", "7i93", key "=99")
    COUNTS("num_encoders"),
    COUNTS("num_resolvers"),
    COUNTS("num_pwmgens"),
    COUNTS("num_3pwmgens"),
    COUNTS("num_rcpwmgens"),
    COUNTS("num_stepgens"),
    COUNTS("num_inmuxs"),
    COUNTS("num_inms"),
    COUNTS("num_outms"),
    COUNTS("num_ssrs"),
    COUNTS("num_oneshots"),
    COUNTS("num_periodms"),
    COUNTS("num_xy2mods"),
    COUNTS("num_bspis"),
    COUNTS("num_uarts"),
    COUNTS("num_pktuarts"),
    COUNTS("num_leds"),
    COUNTS("num_dplls"),
    /* how numbers are read */
    LINE("hex", "7i93", "num_encoders=0x3"),
    LINE("octal", "7i93", "num_encoders=07 num_pwmgens=010"),
    LINE("plus", "7i93", "num_encoders=+2"),
    LINE("garbage-behind", "7i93", "num_encoders=2x"),
    LINE("no-number", "7i93", "num_encoders="),
    LINE("word-for-number", "7i93", "num_encoders=two"),
    LINE("negative", "7i93", "num_encoders=-2"),
    LINE("twice", "7i93", "num_encoders=2 num_encoders=4"),
    LINE("blanks", "7i93", "  num_encoders=2   num_stepgens=1  "),
    LINE("tab", "7i93", "num_encoders=2\tnum_stepgens=1"),
    LINE("upper-case", "7i93", "NUM_ENCODERS=2"),
    LINE("unknown", "7i96s", "num_wheels=2"),
    LINE("stray", "7i96s", "num_encoders"),
    /* step generators, raw access, firmware */
    LINE("width-0", "7i96s", "stepgen_width=0"),
    LINE("width-1", "7i96s", "stepgen_width=1"),
    LINE("width-2", "7i96s", "stepgen_width=2"),
    LINE("width-8", "7i96s", "stepgen_width=8"),
    LINE("width-9", "7i96s", "stepgen_width=9"),
    LINE("raw", "7i96s", "enable_raw"),
    LINE("raw-value", "7i96s", "enable_raw=1"),
    LINE("raw-twice", "7i96s", "enable_raw enable_raw"),
    LINE("firmware", "7i96s", "firmware=hm2/7i96s/7i96s_d.bit"),
    LINE("firmware-empty", "7i96s", "firmware="),
    LINE("adc", "7i96s", "enable_adc"),
    /* smart serial */
    LINE("sserial-all", "7i96s", "sserial_port_0=00000000"),
    LINE("sserial-one", "7i96s", "sserial_port_0=0"),
    LINE("sserial-mixed", "7i96s", "sserial_port_0=0x2xxxxx"),
    LINE("sserial-none", "7i96s", "sserial_port_0=xxxxxxxx"),
    LINE("sserial-second", "7i96s", "sserial_port_1=00"),
    LINE("sserial-second-none", "7i96s", "sserial_port_1=xxxxxxxx"),
    LINE("sserial-last", "7i96s", "sserial_port_3=0"),
    LINE("sserial-beyond", "7i96s", "sserial_port_4=0"),
    LINE("sserial-many", "7i96s", "sserial_port_0=000000000"),
    LINE("sserial-letters", "7i96s", "sserial_port_0=0y"),
    LINE("sserial-upper-case", "7i96s", "sserial_port_0=0XXXXXXX"),
    LINE("sserial-empty", "7i96s", "sserial_port_0="),
    LINE("sserial-no-port", "7i96s", "sserial_port_=0"),
    LINE("sserial-7i93", "7i93", "sserial_port_0=00000000"),
    /* absolute encoders, which no card here has */
    LINE("ssi", "7i96s", "ssi_chan_0=pad%1pposition%24g"),
    LINE("ssi-typed", "7i96s", "ssi_chan_0=position%24ge"),
    LINE("ssi-beyond", "7i96s", "ssi_chan_32=position%24ge"),
    LINE("ssi-bad", "7i96s", "ssi_chan_0=%%"),
    LINE("ssi-empty", "7i96s", "ssi_chan_0="),
    LINE("biss", "7i96s", "biss_chan_1=position%22e"),
    LINE("fanuc", "7i96s", "fanuc_chan_0=AA64"),
    /* a card with nothing but ports */
    LINE("ports", "7i80hd-16", ""),
    LINE("ports-raw", "7i80hd-16", "enable_raw num_leds=0 num_encoders=8"),
    /* serial ports, which have functions and hardly any points */
    {"uarts", "7i93", "", UARTS},
    {"no-uarts", "7i93", "num_uarts=0", UARTS},
    {"two-uarts", "7i93", "num_uarts=2", UARTS},
    {"99-uarts", "7i93", "num_uarts=99", UARTS},
    {"pktuarts", "7i80hd-16", "", PKTUARTS},
    {"no-pktuarts", "7i80hd-16", "num_pktuarts=0", PKTUARTS},
    {"one-pktuart", "7i80hd-16", "num_pktuarts=1", PKTUARTS},
    {"99-pktuarts", "7i80hd-16", "num_pktuarts=99", PKTUARTS},
    /* nothing */
    LINE("empty", "7i96s", ""),
    LINE("only-blanks", "7i96s", "   "),
};
#define LINES (sizeof lines / sizeof lines[0])

struct record {
    bool loaded;
    unsigned count;
    struct {
        char name[64];
        int type;
    } points[MAX_POINTS];
    char messages[MESSAGES];
};

static struct record *theirs, *ours;
static char where[64];
static unsigned problems;

static void load(const struct line *const line, const enum driver_kind kind, const char *const parameter,
                 struct record *const record)
{
    struct driver driver = {.kind = kind,
                            .parameter = parameter,
                            .firmware = line->firmware,
                            .messages = record->messages,
                            .messages_size = MESSAGES};
    record->loaded = driver_load(&driver, line->card, line->config);
    ck_assert_uint_lt(driver.point_count, MAX_POINTS);
    for (size_t i = 0; i < driver.point_count; i++) {
        snprintf(record->points[i].name, sizeof record->points[i].name, "%s", driver.points[i].name);
        record->points[i].type = driver.points[i].type;
    }
    record->count = (unsigned)driver.point_count;
}

/* A driver that does not survive a line has not loaded. The child is not told to unload: it ends. */
static void record(const struct line *const line, const enum driver_kind kind, const char *const parameter,
                   struct record *const record)
{
    int status = 0;
    memset(record, 0, sizeof *record);
    const pid_t child = fork();
    ck_assert_int_ge(child, 0);
    if (child == 0) {
        load(line, kind, parameter, record);
        _exit(0);
    }
    ck_assert_int_eq(waitpid(child, &status, 0), child);
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        record->loaded = false;
        snprintf(record->messages, MESSAGES, "(ended with status 0x%X)", (unsigned)status);
    }
}

static void differs(const char *const what, const char *const name, const char *const text)
{
    if (dropin_table_allows(where, what, name))
        return;
    printf("%s: %s %s%s%s\n", where, what, name, text[0] ? ": " : "", text);
    problems++;
}

static const char *find(const struct record *const in, const char *const name, const int type)
{
    for (unsigned i = 0; i < in->count; i++)
        if (strcmp(in->points[i].name, name) == 0)
            return in->points[i].type == type ? "" : "type";
    return NULL;
}

static void compare_points(void)
{
    for (unsigned i = 0; i < theirs->count; i++) {
        const char *const found = find(ours, theirs->points[i].name, theirs->points[i].type);
        if (!found)
            differs("missing", theirs->points[i].name, "");
        else if (found[0])
            differs("type", theirs->points[i].name, "");
        else
            (void)dropin_table_allows(where, "compared", theirs->points[i].name);
    }
    for (unsigned i = 0; i < ours->count; i++)
        if (!find(theirs, ours->points[i].name, ours->points[i].type))
            differs("new", ours->points[i].name, "");
}

/* The word that is refused, by a line of ours that says something. */
static void check_sentence(const struct line *const line)
{
    char word[64];
    snprintf(word, sizeof word, "%.*s", (int)strcspn(line->config, "= \t"), line->config);
    for (const char *text = ours->messages; *text; text += strcspn(text, "\n") + 1) {
        const char *const at = strstr(text, word);
        const size_t length = strcspn(text, "\n");
        if (strncmp(text, "hm2_lbp16: ", 11) == 0 && at && at < text + length && length > 60)
            return;
        if (text[length] == '\0')
            break;
    }
    printf("%s: refused without a sentence about %s:\n%s\n", where, word, ours->messages);
    problems++;
}

START_TEST(a_load_line_does_what_it_does_with_linuxcncs_driver)
{
    if (!driver_available(DRIVER_LINUXCNC)) {
        printf("SKIP: LinuxCNC's hm2_eth is not installed (linuxcnc-uspace)\n");
        return;
    }
    for (size_t i = 0; i < LINES; i++) {
        const struct line *const line = &lines[i];
        snprintf(where, sizeof where, "loads/%s/%s", line->card, line->name);
        record(line, DRIVER_LINUXCNC, NULL, theirs);
        record(line, DRIVER_OURS, NULL, ours);
        if (theirs->loaded && !ours->loaded)
            differs("refused", "line", ours->messages);
        if (!theirs->loaded && ours->loaded)
            differs("accepted", "line", theirs->messages);
        if (!ours->loaded)
            check_sentence(line);
        if (theirs->loaded && ours->loaded)
            compare_points();
    }
    fflush(stdout);
    ck_assert_uint_eq(problems, 0);
    ck_assert_uint_eq(dropin_table_unused("loads"), 0);
}
END_TEST

/* ---- module parameters --------------------------------------------------------------------------------------------
 */

/* What of a component's parameters its file tells: "rtapi_info_type_debug" and so on (hal-interface 5.5). */
static void list_symbols(struct process *const nm, const char *const file)
{
    const char *const argv[] = {"nm", "-D", "--defined-only", file, NULL};
    ck_assert_int_eq(process_run(nm, argv, 5000), 0);
}

static bool has_symbol(const struct process *const nm, const char *const symbol)
{
    const size_t length = strlen(symbol);
    for (const char *at = nm->text; (at = strstr(at, symbol)); at += length)
        if (at[-1] == ' ' && at[length] == '\n')
            return true;
    return false;
}

/* A parameter and the size of an array have symbols of their own. */
START_TEST(every_module_parameter_of_linuxcncs_driver_is_one_of_ours)
{
    static struct process nm[2];
    unsigned count = 0;
    if (!driver_available(DRIVER_LINUXCNC)) {
        printf("SKIP: LinuxCNC's hm2_eth is not installed (linuxcnc-uspace)\n");
        return;
    }
    list_symbols(&nm[0], driver_files(DRIVER_OURS)[0]);
    for (const char *const *file = driver_files(DRIVER_LINUXCNC); *file; file++) {
        list_symbols(&nm[1], *file);
        for (const char *at = nm[1].text; (at = strstr(at, " rtapi_info_"));) {
            char symbol[64];
            at++;
            snprintf(symbol, sizeof symbol, "%.*s", (int)strcspn(at, "\n"), at);
            if (strncmp(symbol, "rtapi_info_type_", 16) != 0 && strncmp(symbol, "rtapi_info_size_", 16) != 0)
                continue;
            ck_assert_msg(has_symbol(&nm[0], symbol), "no %s", symbol);
            count++;
        }
    }
    ck_assert_uint_gt(count, 9); /* six of hostmot2, three of hm2_eth, two of them arrays */
}
END_TEST

static const struct {
    const char *parameter, *sentence; /* NULL: nothing is said about it */
} parameters[] = {
    {"debug=1", "payload of a cycle: request "},
    {"debug=2", "payload of a cycle: request "},
    {"debug_idrom=1", "payload of a cycle: request "},
    {"debug_module_descriptors=1", "payload of a cycle: request "},
    {"debug_pin_descriptors=1", "IO Pin 017 (TB1-2,3): StepGen #0, pin Step"},
    {"debug_modules=1", "payload of a cycle: request "},
    {"debug=0", NULL},
    {"board_rtnet=posix", NULL},
    {"board_rtnet=evl", "warning: board_rtnet=evl has no effect: "},
    {"firewall=auto", NULL},
    {"firewall=none", NULL},
    {"firewall=nft", NULL},
    {"firewall=iptables", NULL},
    {"use_serial_numbers=0", NULL},
    {"use_serial_numbers=1", NULL},
    {"sserial_baudrate=-1", NULL},
    {"sserial_baudrate=115200", NULL},
};
#define PARAMETERS (sizeof parameters / sizeof parameters[0])

START_TEST(a_module_parameter_is_used_or_told_to_have_no_effect)
{
    static const struct line line = LINE("", "7i96s", "");
    const char *const parameter = parameters[_i].parameter, *const sentence = parameters[_i].sentence;
    char name[32];
    snprintf(name, sizeof name, "%.*s", (int)strcspn(parameter, "="), parameter);
    record(&line, DRIVER_OURS, parameter, ours);
    ck_assert_msg(ours->loaded, "%s: %s", parameter, ours->messages);
    if (sentence)
        ck_assert_msg(strstr(ours->messages, sentence), "%s: %s", parameter, ours->messages);
    else
        ck_assert_msg(!strstr(ours->messages, name), "%s: %s", parameter, ours->messages);
}
END_TEST

int main(void)
{
    dropin_table_load(TEST_DATA "/dropin/differences");
    dropin_table_load(TEST_DATA "/dropin/modules");
    theirs = shared_memory(sizeof *theirs);
    ours = shared_memory(sizeof *ours);
    Suite *const suite = suite_create("dropin loads");
    TCase *const tests = tcase_create("loads");
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, a_load_line_does_what_it_does_with_linuxcncs_driver);
    tcase_add_test(tests, every_module_parameter_of_linuxcncs_driver_is_one_of_ours);
    tcase_add_loop_test(tests, a_module_parameter_is_used_or_told_to_have_no_effect, 0, (int)PARAMETERS);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
