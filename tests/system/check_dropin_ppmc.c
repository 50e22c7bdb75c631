/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * LinuxCNC's hal_ppmc, as Debian packages it, and our ppmc_epp, each in a process of its own, at the same simulated
 * parallel port with the same boards, in virtual time. Every object of encoders that the former has must exist in the
 * latter with the same type, direction and value, and both must count alike.
 *
 * Both drive the port by the processor's in and out instructions, which a process without permission for the port may
 * not execute: the signal that it gets for them carries them out on the simulated port. The two calls that would get
 * the port from the kernel (rtapi_parport_get() there, ioperm(2) here) are answered by this program.
 */
#include <check.h>
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/io.h>
#include <sys/wait.h>
#include <ucontext.h>
#include <unistd.h>

#include <hm2/sim_ppmc.h>

#include "halhost.h"
#include "process.h"
#include "shared_memory.h"
#include "state.h"
#include "suite.h"

#define BASE       0x378u
#define THEIRS     "/usr/lib/linuxcnc/modules/hal_ppmc.so"
#define PERIOD_NS  1000000
#define CYCLES     1500u
#define ENCODERS   8u
#define MAX_POINTS 256u
#define TASK       1
/* Then an index of each encoder is armed. */
#define INDEX_AT 1000u

struct point {
    char name[64];
    int type, direction;
    double value;
};

struct sample {
    double count, delta, position, velocity;
};

struct record {
    bool loaded;
    unsigned point_count;
    struct point points[MAX_POINTS];
    struct sample samples[CYCLES][ENCODERS];
    unsigned announced[ENCODERS]; /* cycle in which index-enable became 0 */
    unsigned long accesses;       /* in and out instructions */
    char messages[8192];
};

static struct record *theirs, *ours;
static struct record *now;
static struct sim_ppmc *bus;

/* ---- the port -----------------------------------------------------------------------------------------------------
 */

#if defined __x86_64__

#define OPCODE_IN  0xECu /* in %dx, %al */
#define OPCODE_OUT 0xEEu /* out %al, %dx */

static void carry_out(const int signal_number, siginfo_t *const info, void *const context)
{
    greg_t *const registers = ((ucontext_t *)context)->uc_mcontext.gregs;
    const uint8_t *const code = (const uint8_t *)(uintptr_t)registers[REG_RIP];
    const unsigned offset = ((unsigned)registers[REG_RDX] & 0xFFFFu) - BASE;
    (void)info;
    if (*code == OPCODE_IN) {
        registers[REG_RAX] = (registers[REG_RAX] & ~(greg_t)0xFF) | sim_ppmc_port_in(bus, offset);
    } else if (*code == OPCODE_OUT) {
        sim_ppmc_port_out(bus, offset, (uint8_t)registers[REG_RAX]);
    } else {
        (void)signal(signal_number, SIG_DFL); /* an ordinary crash: it happens again at once */
        return;
    }
    registers[REG_RIP]++;
    now->accesses++;
}

static bool can_emulate(void)
{
    const struct sigaction action = {.sa_sigaction = carry_out, .sa_flags = SA_SIGINFO};
    return sigaction(SIGSEGV, &action, NULL) == 0;
}

#else
static bool can_emulate(void)
{
    return false;
}
#endif

/* In the place of the C library's and of LinuxCNC's. */
HM2_API int ioperm(const unsigned long from, const unsigned long count, const int on)
{
    (void)on;
    return from >= BASE && from + count <= BASE + 0x408u ? 0 : -1;
}

struct parport {
    unsigned short base, base_hi;
    int fd;
};

HM2_API int rtapi_parport_get(const char *module, struct parport *port, unsigned short base, unsigned short base_hi,
                              unsigned modes);
HM2_API void rtapi_parport_release(struct parport *port);

int rtapi_parport_get(const char *const module, struct parport *const port, const unsigned short base,
                      const unsigned short base_hi, const unsigned modes)
{
    (void)module;
    (void)modes;
    *port = (struct parport){base, base_hi ? base_hi : (unsigned short)(base + 0x400u), -1};
    return 0;
}

void rtapi_parport_release(struct parport *const port)
{
    (void)port;
}

/* ---- one driver ----------------------------------------------------------------------------------------------------
 */

static void keep_message(const void *const context, const enum halhost_stream stream, const char *const text)
{
    const size_t used = strlen(now->messages);
    (void)context;
    (void)stream;
    snprintf(now->messages + used, sizeof now->messages - used, "%s", text);
}

static double load_value(const hal_type_t type, const volatile void *const value)
{
    const struct hh_value v = hh_load(type, (volatile void *)(uintptr_t)value);
    if (type == HAL_FLOAT)
        return v.f;
    if (type == HAL_BIT)
        return v.b;
    return type == HAL_S32 ? (double)v.s : (double)v.u;
}

static void add_point(const char *const name, const hal_type_t type, const int direction, const double value)
{
    ck_assert_uint_lt(now->point_count, MAX_POINTS);
    struct point *const point = &now->points[now->point_count++];
    snprintf(point->name, sizeof point->name, "%s", name);
    point->type = (int)type;
    point->direction = direction;
    point->value = value;
}

static void collect(void)
{
    const struct hh *const host = hh_host();
    for (size_t i = 0; i < host->pins.shown.count; i++) {
        const struct hh_pin *const pin = host->pins.shown.items[i];
        add_point(hh_shown_name(&pin->names), pin->type, (int)pin->dir, load_value(pin->type, hh_pin_value(pin)));
    }
    for (size_t i = 0; i < host->params.shown.count; i++) {
        const struct hh_param *const param = host->params.shown.items[i];
        add_point(hh_shown_name(&param->names), param->type, (int)param->dir, load_value(param->type, param->value));
    }
}

static volatile void *value_of(const unsigned encoder, const char *const what)
{
    char name[64];
    snprintf(name, sizeof name, "ppmc.0.encoder.%02u.%s", encoder, what);
    const struct hh_list *const pins = &hh_host()->pins.shown;
    for (size_t i = 0; i < pins->count; i++) {
        const struct hh_pin *const pin = pins->items[i];
        if (strcmp(hh_shown_name(&pin->names), name) == 0)
            return (volatile void *)(uintptr_t)hh_pin_value(pin);
    }
    ck_abort_msg("no pin %s", name);
    return NULL;
}

static void call(const char *const name)
{
    const struct hh_funct *const funct = hh_table_find(&hh_host()->functs, name);
    if (!funct)
        ck_abort_msg("no function %s", name);
    hh_task_enter(TASK);
    funct->code(funct->arg, PERIOD_NS);
    hh_task_enter(-EINVAL);
}

static void take_sample(const unsigned cycle)
{
    for (unsigned i = 0; i < ENCODERS; i++) {
        struct sample *const s = &now->samples[cycle][i];
        s->count = load_value(HAL_S32, value_of(i, "count"));
        s->delta = load_value(HAL_S32, value_of(i, "delta"));
        s->position = load_value(HAL_FLOAT, value_of(i, "position"));
        s->velocity = load_value(HAL_FLOAT, value_of(i, "velocity"));
        if (cycle > INDEX_AT && now->announced[i] == 0 && load_value(HAL_BIT, value_of(i, "index-enable")) == 0)
            now->announced[i] = cycle;
    }
}

/* Steady speeds, one of them through the ends of 24 bits, and an index of each. */
static const int32_t rates[ENCODERS] = {0, 1, 1000, -777, 25000, 900000, -333333, -999000};

static void run_cycles(void)
{
    int64_t at_ns = 100 * (int64_t)PERIOD_NS;
    for (unsigned i = 0; i < ENCODERS; i++) {
        sim_ppmc_set_time(bus, at_ns - PERIOD_NS);
        sim_ppmc_set_rate(bus, i < 4 ? 2 : 4, i % 4, rates[i]);
        sim_ppmc_set_index(bus, i < 4 ? 2 : 4, i % 4, 40000, 20000, 2);
    }
    for (unsigned n = 0; n < CYCLES; n++, at_ns += PERIOD_NS) {
        sim_ppmc_set_time(bus, at_ns);
        call("ppmc.0.read");
        take_sample(n);
        if (n == INDEX_AT)
            for (unsigned i = 0; i < ENCODERS; i++)
                hh_store((void *)(uintptr_t)value_of(i, "index-enable"), (struct hh_value){.type = HAL_BIT, .b = true});
        call("ppmc.0.write");
    }
}

static void run_driver(const char *const folder, const char *const module, struct record *const record)
{
    const char *const arguments[] = {"port_addr=0x378", "enc_clock=0x102,0x504", "timestamp=0x04"};
    const char *const folders[] = {folder, NULL};
    const struct halhost_options options = {.message = keep_message, .folders = folders, .no_realtime = true};
    struct hm2_diag diag = {0};
    now = record;
    bus = sim_ppmc_new(NULL);
    ck_assert(sim_ppmc_add(bus, 2, 0x14) == 0 && sim_ppmc_add(bus, 4, 0x14) == 0);
    ck_assert_int_eq(halhost_open(&options, &diag), 0);
    record->loaded = halhost_load(module, arguments, 3, &diag) == 0;
    halhost_flush_messages();
    if (!record->loaded)
        ck_abort_msg("%s: %s%s", module, diag.text, record->messages);
    for (unsigned i = 0; i < 2; i++) { /* hal_ppmc's scales are 0 at first, and its first velocities not numbers */
        call("ppmc.0.read");
        call("ppmc.0.write");
    }
    collect();
    run_cycles();
    (void)halhost_close(&diag);
    sim_ppmc_free(bus);
}

static void in_child(const char *const folder, const char *const module, struct record *const record)
{
    int status;
    fflush(stdout);
    const pid_t child = fork();
    ck_assert_int_ge(child, 0);
    if (child == 0) {
        run_driver(folder, module, record);
        _exit(0);
    }
    ck_assert_int_eq(waitpid(child, &status, 0), child);
    if (!record->loaded || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
        ck_abort_msg("%s ended with 0x%X: %.2000s", module, (unsigned)status, record->messages);
}

static bool prepare(void)
{
    if (access(THEIRS, R_OK) != 0)
        printf("SKIP: LinuxCNC's hal_ppmc is not installed (linuxcnc-uspace)\n");
    else if (!can_emulate())
        printf("SKIP: in and out instructions can be carried out on x86-64 only\n");
    else if (TEST_SANITIZED)
        printf("SKIP: a sanitizer takes the signal that this test needs\n");
    else
        return true;
    return false;
}

static const struct point *find(const struct record *const record, const char *const name)
{
    for (unsigned i = 0; i < record->point_count; i++)
        if (strcmp(record->points[i].name, name) == 0)
            return &record->points[i];
    return NULL;
}

/* What the host adds to each function is not the driver's. */
static bool is_of_function(const char *const name)
{
    return strncmp(name, "ppmc.0.read.", 12) == 0 || strncmp(name, "ppmc.0.write.", 13) == 0;
}

static unsigned compare_points(unsigned *const compared)
{
    unsigned problems = 0;
    for (unsigned i = 0; i < theirs->point_count; i++) {
        const struct point *const a = &theirs->points[i], *const b = find(ours, a->name);
        if (is_of_function(a->name))
            continue;
        (*compared)++;
        if (b && a->type == b->type && a->direction == b->direction && a->value == b->value)
            continue;
        printf("%s: type %d, direction %d, value %g there; %s%d, %d, %g here\n", a->name, a->type, a->direction,
               a->value, b ? "" : "missing: ", b ? b->type : 0, b ? b->direction : 0, b ? b->value : 0.0);
        problems++;
    }
    return problems;
}

static bool near(const double a, const double b, const double tolerance)
{
    return fabs(a - b) <= tolerance;
}

/* Everything, in all cycles but those around an index, where hal_ppmc shows a jump of delta and velocity, and but the
 * velocities of the second board, which both take from timestamps, in ways of their own. */
static unsigned compare_samples(unsigned *const compared)
{
    unsigned problems = 0;
    for (unsigned n = 2; n < CYCLES; n++)
        for (unsigned i = 0; i < ENCODERS; i++) {
            const struct sample *const a = &theirs->samples[n][i], *const b = &ours->samples[n][i];
            if (n > INDEX_AT && n < INDEX_AT + 100u)
                continue;
            (*compared)++;
            if (a->count == b->count && a->delta == b->delta && near(a->position, b->position, 0) &&
                (i >= 4 || near(a->velocity, b->velocity, 1e-6)))
                continue;
            if (problems++ < 10)
                printf("cycle %u, encoder %u: count %.0f %.0f, delta %.0f %.0f, position %.1f %.1f, velocity %g %g\n",
                       n, i, a->count, b->count, a->delta, b->delta, a->position, b->position, a->velocity,
                       b->velocity);
        }
    return problems;
}

START_TEST(every_encoder_object_of_hal_ppmc_exists_and_counts_alike)
{
    unsigned points = 0, samples = 0;
    if (!prepare())
        return;
    in_child("/usr/lib/linuxcnc/modules", "hal_ppmc", theirs);
    in_child(TEST_BUILD "/components", "ppmc_epp", ours);
    const unsigned different = compare_points(&points), wrong = compare_samples(&samples);
    printf("%u pins and parameters of hal_ppmc compared, %u of ours are new; %u samples of counts compared; "
           "%lu and %lu port accesses\n",
           points, ours->point_count - points, samples, theirs->accesses, ours->accesses);
    fflush(stdout);
    ck_assert_uint_gt(points, 8 * 6);
    ck_assert_uint_eq(different, 0);
    ck_assert_uint_eq(wrong, 0);
    for (unsigned i = 0; i < ENCODERS; i++)
        ck_assert_uint_eq(ours->announced[i] > 0, theirs->announced[i] > 0);
}
END_TEST

int main(void)
{
    theirs = shared_memory(sizeof *theirs);
    ours = shared_memory(sizeof *ours);
    Suite *const suite = suite_create("dropin ppmc");
    TCase *const tests = tcase_create("ppmc");
    tcase_set_timeout(tests, 60);
    tcase_add_test(tests, every_encoder_object_of_hal_ppmc_exists_and_counts_alike);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
