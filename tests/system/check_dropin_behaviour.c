/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Cycle for cycle: LinuxCNC's driver (hostmot2 and hm2_eth, the modules that Debian packages) and our component run the
 * same script against the same simulated card, each in a process of its own, in virtual time (tests/system/dropin). In
 * every cycle every point that both have is compared, and every register as it was last written. What is different is
 * listed, with its limit and its reason, in tests/data/dropin/differences.
 */
#include <check.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dropin/scenario.h"
#include "dropin_table.h"
#include "shared_memory.h"
#include "suite.h"

#define MAX_POINTS 1000u
#define MAX_CYCLES 4000u
#define MAX_WRITES 1000000u
#define REGISTERS  0x4000u
#define MESSAGES   65536u

/* What one process tells the other. */
struct record {
    bool done;
    unsigned point_count, write_count;
    char names[MAX_POINTS][64];
    double values[MAX_CYCLES][MAX_POINTS];
    struct {
        unsigned cycle;
        uint16_t address;
        uint32_t value;
    } writes[MAX_WRITES];
    char messages[MESSAGES];
};

static struct record *theirs, *ours;
static unsigned *compared; /* scenarios, by all forked tests together */
static char where[64];

/* ---- running ------------------------------------------------------------------------------------------------------
 */

struct run {
    struct driver driver;
    struct record *record;
};

static void on_write(void *const context, const uint16_t address, const uint32_t value)
{
    const struct run *const run = context;
    struct record *const record = run->record;
    if (record->write_count == MAX_WRITES)
        ck_abort_msg("more than %u register writes", MAX_WRITES);
    record->writes[record->write_count].cycle = run->driver.cycle;
    record->writes[record->write_count].address = address;
    record->writes[record->write_count++].value = value;
}

static void record_points(const struct driver *const driver, struct record *const record, const unsigned cycle)
{
    for (size_t i = 0; i < driver->point_count; i++)
        record->values[cycle][i] = driver_value(&driver->points[i]);
}

static void run_driver(const struct scenario *const scenario, const enum driver_kind kind, struct record *const record)
{
    struct run run = {.driver = {.kind = kind, .messages = record->messages, .messages_size = MESSAGES},
                      .record = record};
    run.driver.paced = scenario->paced;
    run.driver.firmware = scenario->firmware;
    run.driver.sources = scenario->sources;
    run.driver.remote = scenario->remote;
    run.driver.has_7i65 = scenario->has_7i65;
    run.driver.on_write = on_write;
    run.driver.context = &run;
    if (!driver_load(&run.driver, scenario->card, scenario->config))
        ck_abort_msg("not loaded: %s", record->messages);
    ck_assert_uint_lt(run.driver.point_count, MAX_POINTS);
    record->point_count = (unsigned)run.driver.point_count;
    for (size_t i = 0; i < run.driver.point_count; i++)
        snprintf(record->names[i], sizeof record->names[i], "%s", run.driver.points[i].name);
    for (unsigned cycle = 0; cycle < scenario->cycles; cycle++) {
        scenario_cycle(scenario, &run.driver);
        record_points(&run.driver, record, cycle);
    }
    driver_unload(&run.driver);
    record->done = true;
}

/* The drivers keep state of their own: each gets a process. */
static struct record *record_of(const struct scenario *const scenario, const enum driver_kind kind)
{
    struct record *const record = shared_memory(sizeof *record);
    const pid_t child = fork();
    ck_assert_int_ge(child, 0);
    if (child == 0) {
        run_driver(scenario, kind, record);
        _exit(0);
    }
    int status = 0;
    ck_assert_int_eq(waitpid(child, &status, 0), child);
    if (!record->done) {
        printf("%s\n", record->messages);
        fflush(stdout);
        ck_abort_msg("%s: driver %d ended with status 0x%X", where, (int)kind, status);
    }
    return record;
}

/* ---- comparing ----------------------------------------------------------------------------------------------------
 */

static unsigned problems;

/* What a limit of the table means: "any", or an amount, or a share as "N%", and then "/N": but for N cycles. */
struct limit {
    bool any;
    double amount, share;
    unsigned cycles;
};

static struct limit parse_limit(const char *const text)
{
    struct limit limit = {.any = strcmp(text, "any") == 0};
    char *end;
    if (limit.any)
        return limit;
    limit.amount = strtod(text, &end);
    if (*end == '%') {
        limit.share = limit.amount / 100;
        limit.amount = 0;
        end++;
    }
    if (*end == '/')
        limit.cycles = (unsigned)strtoul(end + 1, &end, 10);
    ck_assert_msg(end > text && *end == '\0', "no limit: %s", text);
    return limit;
}

static bool within(const double a, const double b, const struct limit *const limit)
{
    const double difference = fabs(a - b);
    if (!isfinite(a) || !isfinite(b))
        return isnan(a) ? isnan(b) : a == b;
    return difference <= limit->amount || difference <= limit->share * fmax(fabs(a), fabs(b));
}

/* For looking closer. DROPIN_ONLY='*NAME' runs one script; DROPIN_MESSAGES=1 prints what the drivers said.
 * DROPIN_SHOW=NAME prints a point, or a register as 0x4100, in every cycle in which it differs. */
static void show(const char *const name, const unsigned cycle, const double a, const double b)
{
    const char *const wanted = getenv("DROPIN_SHOW");
    if (wanted && strcmp(wanted, name) == 0)
        printf("%s: %s: cycle %u: %.17g there, %.17g here\n", where, name, cycle, a, b);
}

/* How two columns differ. */
struct difference {
    unsigned cycles, first;
    double most, there, here;
};

/* Cycles in which column i of theirs and column j of ours differ by more than the limit's amount. */
static struct difference compare_columns(const struct scenario *const scenario, const unsigned i, const unsigned j,
                                         const struct limit *const limit)
{
    struct difference d = {.cycles = 0};
    for (unsigned cycle = 0; cycle < scenario->cycles; cycle++) {
        const double a = theirs->values[cycle][i], b = ours->values[cycle][j];
        if (!scenario_compares(scenario, cycle) || within(a, b, limit))
            continue;
        if (d.cycles++ == 0) {
            d.first = cycle;
            d.there = a;
            d.here = b;
        }
        d.most = fmax(d.most, fabs(a - b));
        show(theirs->names[i], cycle, a, b);
    }
    return d;
}

static void compare_point(const struct scenario *const scenario, const unsigned i, const unsigned j)
{
    const char *const name = theirs->names[i];
    const struct limit exact = {.share = 1e-12};
    (void)dropin_table_allows(where, "compared", name);
    struct difference d = compare_columns(scenario, i, j, &exact);
    if (d.cycles == 0)
        return;
    const char *const allowed = dropin_table_allows(where, "value", name);
    if (allowed) {
        const struct limit limit = parse_limit(allowed);
        d = compare_columns(scenario, i, j, &limit);
        if (limit.any || d.cycles <= limit.cycles)
            return;
    }
    printf("%s: %s: cycle %u: %.17g there, %.17g here; %u cycles differ, by %g at most (limit %s)\n", where, name,
           d.first, d.there, d.here, d.cycles, d.most, allowed ? allowed : "none");
    problems++;
}

static unsigned compare_points(const struct scenario *const scenario)
{
    unsigned both = 0;
    for (unsigned i = 0; i < theirs->point_count; i++)
        for (unsigned j = 0; j < ours->point_count; j++)
            if (strcmp(theirs->names[i], ours->names[j]) == 0) {
                compare_point(scenario, i, j);
                both++;
            }
    return both;
}

/* ---- registers ----------------------------------------------------------------------------------------------------
 */

/* Registers as they were last written. */
struct bank {
    const struct record *record;
    unsigned next; /* in the record */
    bool written[REGISTERS];
    uint32_t value[REGISTERS];
};

static void play(struct bank *const bank, const unsigned cycle)
{
    const struct record *const record = bank->record;
    for (; bank->next < record->write_count && record->writes[bank->next].cycle <= cycle; bank->next++) {
        const unsigned at = record->writes[bank->next].address / 4u;
        bank->written[at] = true;
        bank->value[at] = record->writes[bank->next].value;
    }
}

static double value_of(const struct bank *const bank, const unsigned at)
{
    return bank->written[at] ? (double)bank->value[at] : -1.0;
}

/* Cycles after which register `at` was written last with values that differ by more than the limit's amount. */
static void compare_register(const struct bank banks[2], const unsigned at, const unsigned cycle,
                             const struct limit *const limit, struct difference *const d)
{
    char name[16];
    const double a = value_of(&banks[0], at), b = value_of(&banks[1], at);
    if (within(a, b, limit))
        return;
    if (d->cycles++ == 0) {
        d->first = cycle;
        d->there = a;
        d->here = b;
    }
    d->most = fmax(d->most, fabs(a - b));
    snprintf(name, sizeof name, "0x%04X", 4 * at);
    show(name, cycle, a, b);
}

/* What the table says about a register: the limit is NULL where it says nothing, which was not asked for before. */
struct allowance {
    bool asked;
    const char *text;
    struct limit limit;
};

static void ask_table(struct allowance *const allowance, const unsigned at)
{
    char name[16];
    snprintf(name, sizeof name, "0x%04X", 4 * at);
    allowance->asked = true;
    allowance->text = dropin_table_allows(where, "register", name);
    if (allowance->text)
        allowance->limit = parse_limit(allowance->text);
}

/* After every cycle each register must have been written last with the same value; never written is a value, too. */
static unsigned compare_registers(const struct scenario *const scenario)
{
    static struct bank banks[2];
    static struct difference differences[REGISTERS];
    static struct allowance allowances[REGISTERS];
    unsigned both = 0;
    banks[0].record = theirs;
    banks[1].record = ours;
    for (unsigned cycle = 0; cycle < scenario->cycles; cycle++) {
        play(&banks[0], cycle);
        play(&banks[1], cycle);
        if (!scenario_compares(scenario, cycle))
            continue;
        for (unsigned at = 0; at < REGISTERS; at++) {
            if (banks[0].written[at] == banks[1].written[at] && banks[0].value[at] == banks[1].value[at])
                continue;
            if (!allowances[at].asked)
                ask_table(&allowances[at], at);
            compare_register(banks, at, cycle, &allowances[at].limit, &differences[at]);
        }
    }
    for (unsigned at = 0; at < REGISTERS; at++) {
        const struct difference *const d = &differences[at];
        both += banks[0].written[at] && banks[1].written[at];
        if (d->cycles <= allowances[at].limit.cycles || allowances[at].limit.any)
            continue;
        printf("%s: register 0x%04X: cycle %u: 0x%08llX there, 0x%08llX here (all ones: never written); %u cycles "
               "differ, by 0x%llX at most (limit %s)\n",
               where, 4 * at, d->first, (long long)d->there, (long long)d->here, d->cycles, (long long)d->most,
               allowances[at].text ? allowances[at].text : "none");
        problems++;
    }
    return both;
}

static double highest(const struct record *const record, const unsigned cycles, const char *const name)
{
    double most = -INFINITY;
    for (unsigned i = 0; i < record->point_count; i++)
        for (unsigned cycle = 0; strcmp(record->names[i], name) == 0 && cycle < cycles; cycle++)
            most = fmax(most, record->values[cycle][i]);
    return most;
}

static void check_milestones(const struct scenario *const scenario)
{
    for (unsigned i = 0; i < MAX_MILESTONES && scenario->reached[i].point; i++) {
        const char *const point = scenario->reached[i].point;
        const double there = highest(theirs, scenario->cycles, point), here = highest(ours, scenario->cycles, point);
        if (there >= scenario->reached[i].value && here >= scenario->reached[i].value)
            continue;
        printf("%s: %s shall reach %g, but is %g at most there and %g here\n", where, point, scenario->reached[i].value,
               there, here);
        problems++;
    }
}

START_TEST(the_same_script_gives_the_same_feedback_and_the_same_registers)
{
    const struct scenario *const scenario = &scenarios[_i];
    snprintf(where, sizeof where, "run/%s/%s", scenario->card, scenario->name);
    if (!dropin_table_wanted(where))
        return;
    if (!driver_available(DRIVER_LINUXCNC)) {
        printf("SKIP: LinuxCNC's hm2_eth is not installed (linuxcnc-uspace)\n");
        return;
    }
    theirs = record_of(scenario, DRIVER_LINUXCNC);
    ours = record_of(scenario, DRIVER_OURS);
    const unsigned both = compare_points(scenario);
    check_milestones(scenario);
    const unsigned registers = compare_registers(scenario);
    printf("%s: %u cycles, %u points, %u registers; %u register writes there, %u here\n", where, scenario->cycles, both,
           registers, theirs->write_count, ours->write_count);
    if (getenv("DROPIN_MESSAGES"))
        printf("--- there\n%s--- here\n%s", theirs->messages, ours->messages);
    fflush(stdout);
    ck_assert_uint_eq(problems, 0);
    ++*compared;
}
END_TEST

/* What LinuxCNC's driver makes names of: "%s.encoder.%02d.count" stands in its file. */
START_TEST(every_module_of_linuxcncs_driver_is_compared_or_it_is_explained_why_not)
{
    static char file[4u << 20];
    const char *const path = driver_files(DRIVER_LINUXCNC)[1];
    unsigned modules = 0, missing = 0;
    if (!driver_available(DRIVER_LINUXCNC)) {
        printf("SKIP: LinuxCNC's hm2_eth is not installed (linuxcnc-uspace)\n");
        return;
    }
    FILE *const f = fopen(path, "rb");
    ck_assert_msg(f, "%s: %s", path, strerror(errno));
    const size_t len = fread(file, 1, sizeof file, f);
    fclose(f);
    ck_assert_uint_lt(len, sizeof file);
    for (const char *at = file; (at = memmem(at, len - (size_t)(at - file), "%s.", 3)); at += 3) {
        char module[16];
        if (sscanf(at, "%%s.%15[a-z0-9].", module) != 1 || at[3 + strlen(module)] != '.')
            continue;
        modules++;
        const bool explained = dropin_table_has("none", "explained", module);
        if (explained || (dropin_table_has("names", "compared", module) && dropin_table_has("run", "compared", module)))
            continue;
        printf("%s: no row for names and behaviour of %s\n", path, module);
        missing++;
    }
    ck_assert_uint_gt(modules, 200); /* as many names; 24 modules */
    ck_assert_uint_eq(missing, 0);
}
END_TEST

START_TEST(no_row_of_the_table_is_stale)
{
    if (*compared < scenario_count) {
        printf("SKIP: only %u of %zu scripts were compared\n", *compared, scenario_count);
        return;
    }
    ck_assert_uint_eq(dropin_table_unused("run"), 0);
}
END_TEST

int main(void)
{
    dropin_table_load(TEST_DATA "/dropin/differences");
    dropin_table_load(TEST_DATA "/dropin/modules");
    compared = shared_memory(sizeof *compared);
    Suite *const suite = suite_create("dropin behaviour");
    TCase *const tests = tcase_create("behaviour");
    tcase_set_timeout(tests, 120);
    tcase_add_loop_test(tests, the_same_script_gives_the_same_feedback_and_the_same_registers, 0, (int)scenario_count);
    tcase_add_test(tests, every_module_of_linuxcncs_driver_is_compared_or_it_is_explained_why_not);
    tcase_add_test(tests, no_row_of_the_table_is_stale);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
