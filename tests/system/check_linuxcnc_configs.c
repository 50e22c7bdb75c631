/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Whole configurations that others wrote, in LinuxCNC as Debian packages it, with our component and a simulated card:
 * emergency stop off, machine on, home, run a program, be where the program says. Nothing of them is changed but what
 * loads the driver, which program is the user interface, and one more HAL file.
 */
#include <check.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "linuxcnc_peer.h"
#include "process.h"
#include "suite.h"

#define LIMIT_MS        100000
#define JOINTS          3u
#define PARTS_OF_A_STEP 65536.0 /* position registers of step generators (register map 3.4) */

struct config {
    const char *name;              /* tests/system/linuxcnc/NAME.conf */
    const char *prefix;            /* of the card's pins */
    double end[JOINTS];            /* where the program ends */
    const char *feedback;          /* pin of a joint, behind the prefix; NULL when homing sets it apart from the axis */
    double accuracy;               /* of feedback and axes' position, in units */
    const char *registers[JOINTS]; /* where the card counts steps, or NULL: encoders turn with motors */
    double scale[JOINTS];          /* steps or counts a unit */
    /* Where the axis is in steps or counts from power-up when its position is 0, and how exactly homing finds that. */
    double zero[JOINTS], exactness[JOINTS];
};

/* What an axis moves at its latch velocity while 24 ms pass without a servo cycle. */
#define SAMPLE_LATE 200 /* 0.1 inch/s */
#define WIZARD_LATE 24  /* 1 mm/s, 1000 counts/mm */
#define STEPS_LATE  6   /* 1 mm/s, 200 steps/mm, and the filter of the input */

static const struct config configs[] = {
    {.name = "hm2-stepper",
     .prefix = "hm2_7i93.0",
     .end = {0.75, 0.3125, 0.5},
     .feedback = "stepgen.%02u.position-fb",
     .accuracy = 0.001,
     .registers = {"0x2100", "0x2104", "0x2108"},
     .scale = {1000, 1000, 1000},
     .exactness = {1, 1, 1}},
    {.name = "hm2-servo",
     .prefix = "hm2_7i93.0",
     .end = {0.75, 0.3125, 0.5},
     .accuracy = 0.0001,
     .scale = {81920, -81920, 81920},
     /* HOME_OFFSET is -2.9 at the switch, or at the index behind it. */
     .zero = {-41943 + 2.9 * 81920, 5 * 8192 - 2.9 * 81920, -41943 + 2.9 * 81920},
     .exactness = {SAMPLE_LATE, 3, SAMPLE_LATE}},
    {.name = "pncconf-7i96s",
     .prefix = "hm2_7i96s.0",
     .end = {12.5, 7.25, -3},
     .accuracy = 0.01,
     .registers = {"0x2100", "0x2104", "0x2108"},
     .scale = {200, 200, 200},
     .zero = {-200 + 2 * 200, -200 + 2 * 200, 200 - 2 * 200}, /* HOME_OFFSET is -2 mm, and 2 for Z, at the switch */
     .exactness = {STEPS_LATE, STEPS_LATE, STEPS_LATE}},
    {.name = "pncconf-7i93",
     .prefix = "hm2_7i93.0",
     .end = {12.5, 7.25, -3},
     .accuracy = 0.005,
     .scale = {1000, 1000, 1000},
     .zero = {-1000 + 2 * 1000, 0 + 2 * 1000, 1000 - 2 * 1000}, /* the index behind Y's switch is at 0 */
     .exactness = {WIZARD_LATE, 3, WIZARD_LATE}},
};

static struct process run;

/* False when this machine cannot run it, which was said then. */
static bool run_config(const struct config *const config)
{
    char out[256];
    snprintf(out, sizeof out, "%s/config-%s", TEST_BUILD, config->name);
    const char *const argv[] = {TEST_SOURCE "/tests/system/linuxcnc-config", TEST_BUILD, out, config->name, NULL};
    process_start(&run, argv);
    return linuxcnc_ends_well(&run, LIMIT_MS);
}

/* What follows `start` on its line. */
static const char *said(const char *const start)
{
    const char *line;
    if (!process_wait_line(&run, start, 0, &line))
        process_give_up(&run, start);
    return line + strlen(start);
}

static const char *pin(const struct config *const config, const char *const name)
{
    char start[128];
    snprintf(start, sizeof start, "operator: %s.%s ", config->prefix, name);
    return said(start);
}

/* ---- the configuration is the one that others wrote ---------------------------------------------------------------
 */

/* Beginnings of the lines that may differ, behind the name of their file. */
static const char *const allowed[] = {
    "< loadrt hostmot2", "< loadrt [HOSTMOT2](DRIVER) ", "< loadrt hm2_eth ",           "> loadrt hm2_lbp16 ",
    "< DISPLAY =",       "> DISPLAY = operator ",        "> HALFILE = no-realtime.hal", "< BOARD=",
    "> BOARD=",
};

static bool is_allowed(const char *const line)
{
    const char *const change = strstr(line, ": ");
    for (size_t i = 0; change && i < sizeof allowed / sizeof allowed[0]; i++)
        if (strncmp(change + 2, allowed[i], strlen(allowed[i])) == 0)
            return true;
    return false;
}

static void check_only_the_load_lines_differ(void)
{
    static const char start[] = "changed: ";
    unsigned loads = 0;
    for (const char *line = run.text; strncmp(line, start, strlen(start)) == 0; line = strchr(line, '\n') + 1) {
        const char *const rest = line + strlen(start);
        if (!is_allowed(rest))
            ck_abort_msg("more than the load line was changed: %.*s", (int)strcspn(rest, "\n"), rest);
        const char *const load = strstr(rest, "> loadrt hm2_lbp16 ");
        loads += load && load < strchr(rest, '\n');
    }
    ck_assert_uint_eq(loads, 1);
}

/* ---- and it works -------------------------------------------------------------------------------------------------
 */

static void check_position(const struct config *const config, const char *const start, const double accuracy)
{
    double at[JOINTS];
    if (sscanf(said(start), "%lf %lf %lf", &at[0], &at[1], &at[2]) != 3)
        process_give_up(&run, start);
    for (unsigned i = 0; i < JOINTS; i++)
        if (fabs(at[i] - config->end[i]) > accuracy)
            ck_abort_msg("%sjoint %u: %.6f, not %.6f", start, i, at[i], config->end[i]);
}

static void check_feedback(const struct config *const config)
{
    static const char number[] = "%02u";
    const char *const hole = config->feedback ? strstr(config->feedback, number) : NULL;
    char name[64];
    for (unsigned i = 0; hole && i < JOINTS; i++) {
        snprintf(name, sizeof name, "%.*s%02u%s", (int)(hole - config->feedback), config->feedback, i,
                 hole + strlen(number));
        const double at = strtod(pin(config, name), NULL);
        if (fabs(at - config->end[i]) > config->accuracy)
            ck_abort_msg("%s is %.6f, not %.6f", name, at, config->end[i]);
    }
}

/* What the card counted, seen by mesaflash. */
static void check_steps(const struct config *const config)
{
    for (unsigned i = 0; i < JOINTS && config->registers[i]; i++) {
        char start[64];
        snprintf(start, sizeof start, "register %s ", config->registers[i]);
        const double steps = (int32_t)(uint32_t)strtoul(said(start), NULL, 16) / PARTS_OF_A_STEP;
        const double expected = config->zero[i] + config->end[i] * config->scale[i];
        if (fabs(steps - expected) > config->exactness[i])
            ck_abort_msg("step generator %u made %.3f steps, not %.3f", i, steps, expected);
    }
}

/* Where the motors really are: homing found its switches and the index, and motion went from there. */
static void check_motors(const struct config *const config)
{
    for (unsigned i = 0; i < JOINTS && !config->registers[0]; i++) {
        char place[64];
        snprintf(place, sizeof place, ": encoder %u at ", i);
        const char *const at = strstr(run.text, place);
        if (!at)
            process_give_up(&run, place);
        const double counts = strtod(at + strlen(place), NULL);
        const double expected = config->zero[i] + config->end[i] * config->scale[i];
        if (fabs(counts - expected) > config->exactness[i])
            ck_abort_msg("motor %u is at %.0f, not %.0f counts", i, counts, expected);
    }
}

/* A reply that is late on a busy machine is no fault of the card or the driver; a lost card, or many of them, would be.
 */
#define LATE_CYCLES 50

static void check_card_was_there(const struct config *const config)
{
    static const char *const few[] = {"packet-error-total", "packet-lost", "write-lost"};
    static const struct {
        const char *name, *value;
    } untouched[] = {{"packet-malformed", "0"},
                     {"packet-error-exceeded", "FALSE"},
                     {"io_error", "FALSE"},
                     {"watchdog.has_bit", "FALSE"}};
    for (size_t i = 0; i < sizeof few / sizeof few[0]; i++) {
        const unsigned long number = strtoul(pin(config, few[i]), NULL, 0);
        if (number > LATE_CYCLES)
            ck_abort_msg("%s is %lu", few[i], number);
    }
    for (size_t i = 0; i < sizeof untouched / sizeof untouched[0]; i++) {
        const char *const value = pin(config, untouched[i].name);
        const size_t len = strcspn(value, "\n");
        if (len != strlen(untouched[i].value) || strncmp(value, untouched[i].value, len) != 0)
            ck_abort_msg("%s is %.*s", untouched[i].name, (int)len, value);
    }
}

START_TEST(a_configuration_of_others_homes_and_ends_where_its_program_says)
{
    const struct config *const config = &configs[_i];
    if (!linuxcnc_loads_ours())
        return;
    if (!run_config(config))
        return;
    check_only_the_load_lines_differ();
    (void)said("operator: homed 3 joints");
    check_position(config, "operator: commanded ", 1e-6);
    check_position(config, "operator: actual ", config->accuracy);
    check_feedback(config);
    check_steps(config);
    check_motors(config);
    check_card_was_there(config);
    (void)said("operator: done");
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("linuxcnc configurations");
    TCase *const tests = tcase_create("configurations");
    tcase_set_timeout(tests, 120);
    tcase_add_loop_test(tests, a_configuration_of_others_homes_and_ends_where_its_program_says, 0,
                        (int)(sizeof configs / sizeof configs[0]));
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
