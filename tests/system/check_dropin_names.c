/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Name for name: LinuxCNC's driver (hostmot2 and hm2_eth) and our component are loaded into LinuxCNC, one after the
 * other, with the same card and the same config= line; where a 7I65 hangs at the card, so are mesa_7i65 and hm2_7i65.
 * Every pin, parameter, function and alias of the former must exist in the latter, with the same type, direction and
 * value; what is different is listed, with its reason, in tests/data/dropin/differences.
 */
#include <check.h>
#include <errno.h>
#include <fnmatch.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "dropin_table.h"
#include "linuxcnc_peer.h"
#include "process.h"
#include "shared_memory.h"
#include "suite.h"

#define PEER_LIMIT_MS 300000 /* for all tries that linuxcnc-peer makes */

#define MAX_OBJECTS 2048u

struct load {
    const char *card, *name, *config;
    const char *options[4]; /* of hm2sim, up to NULL */
};

#define ABSOLUTE TEST_DATA "/firmware/absolute_48.hex"
#define SSERIALB TEST_DATA "/firmware/sserialb_51.hex"
#define DRIVES   TEST_DATA "/firmware/drives_29_48.hex"
#define INMUX    TEST_DATA "/firmware/inmux_48.hex"
#define LATCH    TEST_DATA "/firmware/latch_48.hex"

static const struct load loads[] = {
    {"7i96s", "default", "", {NULL}},
    {"7i96s", "no-sserial", "sserial_port_0=xxxxxxxx", {NULL}},
    {"7i96s", "raw", "enable_raw", {NULL}},
    {"7i96s", "fewer", "num_encoders=0 num_stepgens=2 num_pwmgens=0 enable_raw", {NULL}},
    {"7i96s", "no-io-modules", "num_leds=2 num_ssrs=0 num_inms=0 num_outms=0", {NULL}},
    {"7i96s",
     "nothing",
     "num_encoders=0 num_stepgens=0 num_pwmgens=0 num_leds=0 num_ssrs=0 num_inms=0 num_outms=0 num_dplls=0",
     {NULL}},
    {"7i96s", "one-pin-stepgens", "stepgen_width=1 num_leds=3", {NULL}},
    {"7i96s", "too-many-clamped", "num_leds=9 num_dplls=5", {NULL}},
    {"7i96s_7i77d", "7i77-mode-0", "sserial_port_0=00xxxxxx", {"--remote", "0:0=7i77"}},
    {"7i96s_7i77d", "7i77-mode-1", "sserial_port_0=10xxxxxx", {"--remote", "0:0=7i77"}},
    {"7i96s_7i77d", "7i77-mode-2", "sserial_port_0=20xxxxxx", {"--remote", "0:0=7i77"}},
    {"7i96s_7i77d", "7i77-mode-3", "sserial_port_0=30xxxxxx", {"--remote", "0:0=7i77"}},
    {"7i96s_7i77d", "7i76-mode-2", "sserial_port_0=2xxxxxxx", {"--remote", "0:0=7i76"}},
    {"7i96s_7i77d", "7i76-mode-0", "sserial_port_0=0xxxxxxx", {"--remote", "0:0=7i76"}},
    {"7i96s_7i77d", "7i84-mode-2", "sserial_port_0=2xxxxxxx", {"--remote", "0:0=7i84"}},
    {"7i96s_7i77d", "7i69-mode-0", "sserial_port_0=0xxxxxxx", {"--remote", "0:0=7i69"}},
    {"7i96s_7i77d", "7i69-mode-1", "sserial_port_0=1xxxxxxx", {"--remote", "0:0=7i69"}},
    {"7i96s_7i77d", "7i69-mode-3", "sserial_port_0=3xxxxxxx", {"--remote", "0:0=7i69"}},
    {"7i96s_7i77d", "7i69-mode-4", "sserial_port_0=4xxxxxxx", {"--remote", "0:0=7i69"}},
    {"7i96s_7i77d", "7i70-mode-1", "sserial_port_0=1xxxxxxx", {"--remote", "0:0=7i70"}},
    {"7i96s_7i77d", "7i70-mode-2", "sserial_port_0=2xxxxxxx", {"--remote", "0:0=7i70"}},
    {"7i96s_7i77d", "7i71-mode-1", "sserial_port_0=1xxxxxxx", {"--remote", "0:0=7i71"}},
    {"7i96s_7i77d", "7i72-mode-0", "sserial_port_0=0xxxxxxx", {"--remote", "0:0=7i72"}},
    {"7i96s_7i77d", "7i73-mode-2", "sserial_port_0=2xxxxxxx", {"--remote", "0:0=7i73"}},
    {"7i96s_7i77d", "sserialb", "sserial_port_0=30xxxxxx", {"--firmware", SSERIALB, "--remote", "0:0=7i77"}},
    {"7i93", "default", "", {NULL}},
    {"7i93", "typical", "num_encoders=3 num_pwmgens=3 num_stepgens=2 sserial_port_0=00000000", {NULL}},
    {"7i93", "no-dpll", "num_dplls=0 enable_raw", {NULL}},
    {"7i93", "encoders-only", "num_pwmgens=0 num_stepgens=0 num_leds=0", {NULL}},
    {"7i93", "wide-stepgens", "stepgen_width=6 firmware=ignored.bit", {NULL}},
    {"7i93_svst4_8", "default", "", {NULL}},
    {"7i93_svst8_8im2", "default", "", {NULL}},
    {"7i93_svst1_4_7i47s", "default", "", {NULL}},
    {"7i93_2x7i65", "default", "", {NULL}},
    {"7i93_2x7i65", "7i65", "", {"--7i65", "0"}},
    {"7i93_2x7i65", "second-7i65", "num_bspis=2", {"--7i65", "1"}},
    {"7i93_sv12im_2x7i48", "default", "", {NULL}},
    {"7i93_sv6_7i49", "default", "", {NULL}},
    {"7i93",
     "absolute",
     "ssi_chan_0=a%12ub%3fc%1b%2pd%12s ssi_chan_1=pos%25ge biss_chan_1=turns%12hturns%18l fanuc_chan_0=AA64",
     {"--firmware", ABSOLUTE}},
    {"7i93", "no-absolute", "", {"--firmware", ABSOLUTE}},
    {"7i93", "inmux", "", {"--firmware", INMUX}},
    {"7i93", "latch", "", {"--firmware", LATCH}},
    {"7i93", "latch-narrow", "stepgen_width=1", {"--firmware", LATCH}},
    {"7i93", "drives", "", {"--firmware", DRIVES}},
    {"7i93",
     "fewer-drives",
     "num_3pwmgens=1 num_rcpwmgens=1 num_oneshots=0 num_xy2mods=0 num_resolvers=4",
     {"--firmware", DRIVES}},
};
#define LOADS (sizeof loads / sizeof loads[0])

enum { NO_KIND = 0, PIN = 'p', PARAMETER = 'r', FUNCTION = 'f', ALIAS = 'a' };

struct object {
    char kind, name[64], type[8], direction[8], value[64];
};

struct listing {
    unsigned count;
    struct object objects[MAX_OBJECTS];
};

/* What the forked tests count together. */
struct shared {
    unsigned compared;
};

static struct shared *shared;
static struct process run;
static char prefix[32]; /* "hm2_7i96s.0." */
static const char servo_prefix[] = "mesa-7i65.";
static struct listing theirs, ours;

/* ---- loading ------------------------------------------------------------------------------------------------------
 */

static void write_file(const char *const folder, const char *const name, const char *const text)
{
    char path[320];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *const file = fopen(path, "w");
    ck_assert_msg(file, "%s: %s", path, strerror(errno));
    ck_assert_int_ge(fputs(text, file), 0);
    ck_assert_int_eq(fclose(file), 0);
}

/* False when this machine cannot run it, which was said then. The output is in run.text. */
static bool load(const struct load *const load, const char *const driver)
{
    const bool theirs_loads = strcmp(driver, "hm2_eth") == 0;
    char folder[256], hal[280], servo[128] = "", text[1024];
    snprintf(folder, sizeof folder, "%s/dropin-names-%s-%s-%s", TEST_BUILD, load->card, load->name, driver);
    ck_assert(mkdir(folder, 0755) == 0 || errno == EEXIST);
    if (load->options[0] && strcmp(load->options[0], "--7i65") == 0)
        snprintf(servo, sizeof servo, "loadrt %s_7i65 bspi_chans=%sbspi.%s\n", theirs_loads ? "mesa" : "hm2", prefix,
                 load->options[1]);
    snprintf(text, sizeof text,
             "%sloadrt %s board_ip=192.168.1.121 config=\"%s\"\n%s"
             "show pin %s %s\nshow param %s %s\nshow funct %s\nshow alias %s\n",
             theirs_loads ? "loadrt hostmot2\n" : "", driver, load->config, servo, prefix, servo_prefix, prefix,
             servo_prefix, prefix, prefix);
    write_file(folder, "load.hal", text);
    snprintf(hal, sizeof hal, "%s/load.hal", folder);
    linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    linuxcnc_tell("PEER_DRIVER", driver);
    const char *const argv[] = {TEST_SOURCE "/tests/system/linuxcnc-peer",
                                TEST_BUILD,
                                folder,
                                load->card,
                                hal,
                                load->options[0],
                                load->options[1],
                                load->options[2],
                                load->options[3],
                                NULL};
    const int status = process_run(&run, argv, PEER_LIMIT_MS);
    if (linuxcnc_skipped(&run))
        return false;
    if (status != 0) {
        printf("%s\n", run.text);
        fflush(stdout);
        ck_abort_msg("%s with %s: exit status %d", driver, load->config, status);
    }
    return true;
}

/* ---- what halcmd shows --------------------------------------------------------------------------------------------
 */

/* The heading may stand behind the piece of a line that a driver was just printing. */
static bool is_heading(const char *const line, const char *const heading)
{
    const size_t len = strlen(line), wanted = strlen(heading);
    return len >= wanted && strcmp(line + len - wanted, heading) == 0;
}

/* The name without the card's prefix; NULL for what belongs to somebody else. */
static const char *name_in_table(const char *const name)
{
    if (strncmp(name, servo_prefix, strlen(servo_prefix)) == 0)
        return name;
    return strncmp(name, prefix, strlen(prefix)) == 0 ? name + strlen(prefix) : NULL;
}

/* One line of a listing, by its heading; false for what is no object. */
static bool parse(const char kind, const char *const line, struct object *const o)
{
    char name[64];
    bool parsed = false;
    *o = (struct object){.kind = kind};
    if (kind == FUNCTION)
        parsed = sscanf(line, "%*s %*s %*s %7s %*s %63s", o->type, name) == 2; /* type: uses floating point */
    else if (kind == ALIAS)
        parsed = sscanf(line, "%63s %63s", name, o->value) == 2; /* value: the original name */
    else if (kind != NO_KIND)
        parsed = sscanf(line, "%*s %7s %7s %63s %63s", o->type, o->direction, o->value, name) == 4;
    const char *const own = parsed ? name_in_table(name) : NULL;
    snprintf(o->name, sizeof o->name, "%s", own ? own : "");
    return own != NULL;
}

static void read_listing(struct listing *const listing)
{
    static const struct {
        const char *text;
        char kind;
    } headings[] = {{"Component Pins:", PIN},
                    {"Parameters:", PARAMETER},
                    {"Exported Functions:", FUNCTION},
                    {"Pin Aliases:", ALIAS},
                    {"Parameter Aliases:", ALIAS}};
    char kind = NO_KIND;
    listing->count = 0;
    for (char *line = strtok(run.text, "\n"); line; line = strtok(NULL, "\n")) {
        struct object object;
        for (size_t i = 0; i < sizeof headings / sizeof headings[0]; i++)
            if (is_heading(line, headings[i].text))
                kind = headings[i].kind;
        if (!parse(kind, line, &object))
            continue;
        ck_assert_uint_lt(listing->count, MAX_OBJECTS);
        listing->objects[listing->count++] = object;
    }
}

static const struct object *find(const struct listing *const listing, const struct object *const like)
{
    for (unsigned i = 0; i < listing->count; i++)
        if (listing->objects[i].kind == like->kind && strcmp(listing->objects[i].name, like->name) == 0)
            return &listing->objects[i];
    return NULL;
}

/* ---- comparing ----------------------------------------------------------------------------------------------------
 */

static char where[64];
static unsigned problems;

static void differs(const char *const what, const struct object *const object, const char *const their_value,
                    const char *const our_value)
{
    if (dropin_table_allows(where, what, object->name))
        return;
    printf("%s: %s %c %s: %s in LinuxCNC's driver, %s in ours\n", where, what, object->kind, object->name, their_value,
           our_value);
    problems++;
}

static void compare_text(const char *const what, const struct object *const object, const char *const their_text,
                         const char *const our_text)
{
    if (strcmp(their_text, our_text) != 0)
        differs(what, object, their_text, our_text);
}

/* Values that depend on the moment at which they are looked at. */
static bool rests(const char *const name)
{
    static const struct {
        const char *where, *name;
    } restless[] = {
        /* the select lines of multiplexed encoders */
        {"names/7i96s_7i77d/*", "gpio.041.in*"},
        {"names/7i93/inmux", "gpio.00[1-4].in*"}, /* the address of multiplexed inputs */
        {"names/7i93_2x7i65/*", "gpio.0[13][37].in*"},
        {"names/7i93_sv12im_2x7i48/*", "gpio.0[13][04].in*"},
        /* the excitation of resolvers, a pulse density */
        {"names/7i93/*drives", "gpio.03[01].in*"},
        {"names/7i93_sv6_7i49/*", "gpio.009.in*"},
        {"names/7i93_sv6_7i49/*", "gpio.010.in*"},
        /* a remote's watchdog bites, or not yet, while it is asked */
        {"names/7i96s_7i77d/*", "7i??.0.?.fault"},
    };
    for (size_t i = 0; i < sizeof restless / sizeof restless[0]; i++)
        if (fnmatch(restless[i].where, where, 0) == 0 && fnmatch(restless[i].name, name, 0) == 0)
            return false;
    return true;
}

static void compare(void)
{
    for (unsigned i = 0; i < theirs.count; i++) {
        const struct object *const a = &theirs.objects[i], *const b = find(&ours, a);
        if (!b) {
            differs(a->kind == ALIAS ? "alias-missing" : "missing", a, "there", "missing");
            continue;
        }
        (void)dropin_table_allows(where, "compared", a->name);
        compare_text("type", a, a->type, b->type);
        compare_text("direction", a, a->direction, b->direction);
        if (rests(a->name))
            compare_text("value", a, a->value, b->value);
    }
    for (unsigned i = 0; i < ours.count; i++) {
        const struct object *const b = &ours.objects[i];
        if (!find(&theirs, b))
            differs(b->kind == ALIAS ? "alias-new" : "new", b, "missing", "there");
    }
}

static unsigned count(const struct listing *const listing, const char kind)
{
    unsigned n = 0;
    for (unsigned i = 0; i < listing->count; i++)
        n += listing->objects[i].kind == kind;
    return n;
}

START_TEST(every_object_of_linuxcncs_driver_exists_in_ours_with_type_direction_and_default)
{
    const struct load *const l = &loads[_i];
    snprintf(where, sizeof where, "names/%s/%s", l->card, l->name);
    if (!dropin_table_wanted(where))
        return;
    dropin_prefix(l->card, prefix, sizeof prefix);
    if (!linuxcnc_loads_ours() || !load(l, "hm2_eth"))
        return;
    read_listing(&theirs);
    if (!load(l, "hm2_lbp16"))
        return;
    read_listing(&ours);
    compare();
    printf("%s: %u pins, %u parameters, %u functions, %u aliases there; %u, %u, %u, %u here\n", where,
           count(&theirs, PIN), count(&theirs, PARAMETER), count(&theirs, FUNCTION), count(&theirs, ALIAS),
           count(&ours, PIN), count(&ours, PARAMETER), count(&ours, FUNCTION), count(&ours, ALIAS));
    fflush(stdout);
    /* At least inputs of all pins, the packet errors and the functions: an empty listing proves nothing. */
    ck_assert_uint_gt(count(&theirs, PIN), 100);
    ck_assert_uint_eq(count(&theirs, FUNCTION), 3);
    ck_assert_uint_eq(problems, 0);
    shared->compared++;
}
END_TEST

START_TEST(no_row_of_the_table_is_stale)
{
    if (shared->compared < LOADS) {
        printf("SKIP: only %u of %u loads were compared\n", shared->compared, (unsigned)LOADS);
        return;
    }
    ck_assert_uint_eq(dropin_table_unused("names"), 0);
}
END_TEST

int main(void)
{
    dropin_table_load(TEST_DATA "/dropin/differences");
    dropin_table_load(TEST_DATA "/dropin/modules");
    shared = shared_memory(sizeof *shared);
    Suite *const suite = suite_create("dropin names");
    TCase *const tests = tcase_create("names");
    tcase_set_timeout(tests, PEER_LIMIT_MS / 1000.0 + 60.0);
    tcase_add_loop_test(tests, every_object_of_linuxcncs_driver_exists_in_ours_with_type_direction_and_default, 0,
                        (int)LOADS);
    tcase_add_test(tests, no_row_of_the_table_is_stale);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
