/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * LinuxCNC, as Debian packages it, with the simulated card: its own drivers hostmot2 and hm2_eth, and our component
 * built against its headers. The same HAL file for both; only the lines that load the driver differ.
 */
#include <check.h>
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "linuxcnc_peer.h"
#include "simulator.h"
#include "suite.h"

#define PEER_LIMIT_MS 110000
#define MAX_SAMPLES   30000u
#define CATCH_UP      1000u /* cycles; the first command is a jump of speed */

/* What tests/system/hal/follow.hal commands: amplitude in units and frequency in Hz; both have 1000 steps a unit. */
static const struct {
    double amplitude, hz;
} sines[] = {{10, 0.5}, {2, 1}};
#define JOINTS         (sizeof sines / sizeof sines[0])
#define STEP           0.001
#define ENCODER_JOINT  0u
#define CYCLES_PER_S   1000.0
#define COUNTS_BETWEEN 64 /* step generator and encoder are read one after the other */

struct peer {
    const char *driver, *card, *config;
    unsigned samples;
};

static const struct peer originals[] = {
    {"hm2_eth", "7i96s", "num_stepgens=5 sserial_port_0=xxxxxxxx", 30000},
    {"hm2_eth", "7i93", "num_encoders=8 num_pwmgens=8 num_stepgens=4", 30000},
};

static const struct peer ours[] = {
    {"hm2_lbp16", "7i96s", "num_stepgens=5 sserial_port_0=xxxxxxxx", 10000},
    {"hm2_lbp16", "7i93", "num_encoders=8 num_pwmgens=8 num_stepgens=4", 10000},
};

static struct process run;
static char out[256];

/* ---- running ------------------------------------------------------------------------------------------------------
 */

static void start_peer(const struct peer *const peer)
{
    char text[64];
    snprintf(out, sizeof out, "%s/peer-%s-%s", TEST_BUILD, peer->driver, peer->card);
    ck_assert(mkdir(out, 0755) == 0 || errno == EEXIST);
    linuxcnc_tell("PEER_DRIVER", peer->driver);
    linuxcnc_tell("PEER_CONFIG", peer->config);
    snprintf(text, sizeof text, "hm2_%s.0", peer->card);
    linuxcnc_tell("PEER_CARD", text);
    snprintf(text, sizeof text, "%u", peer->samples);
    linuxcnc_tell("PEER_SAMPLES", text);
    snprintf(text, sizeof text, "%d", (int)getpid());
    linuxcnc_tell("PEER_MARK", text);
    if (peer->driver[4] == 'l')
        linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    const char *const argv[] = {TEST_SOURCE "/tests/system/linuxcnc-peer",  TEST_BUILD, out,   peer->card,
                                TEST_SOURCE "/tests/system/hal/follow.hal", "--follow", "0:0", NULL};
    process_start(&run, argv);
}

/* False when this machine cannot run it, which was said then. */
static bool run_peer(const struct peer *const peer)
{
    start_peer(peer);
    return linuxcnc_ends_well(&run, PEER_LIMIT_MS);
}

/* ---- what was recorded --------------------------------------------------------------------------------------------
 */

struct sample {
    double command[JOINTS], feedback[JOINTS], velocity;
    long counts, encoder;
    unsigned long errors;
};

static struct sample samples[MAX_SAMPLES];

static void load_samples(const unsigned wanted)
{
    char path[300], line[256];
    unsigned n = 0;
    snprintf(path, sizeof path, "%s/samples", out);
    FILE *const file = fopen(path, "r");
    ck_assert_msg(file, "%s: %s", path, strerror(errno));
    while (fgets(line, sizeof line, file)) {
        struct sample s;
        if (sscanf(line, "%lf %lf %lf %lf %lf %ld %ld %lu", &s.command[0], &s.feedback[0], &s.command[1],
                   &s.feedback[1], &s.velocity, &s.counts, &s.encoder, &s.errors) != 8)
            ck_abort_msg("%s:%u: %s", path, n + 1, line); /* "overrun": cycles are missing */
        ck_assert_uint_lt(n, MAX_SAMPLES);
        samples[n++] = s;
    }
    fclose(file);
    ck_assert_uint_eq(n, wanted);
}

static int compare(const void *const a, const void *const b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

struct spread {
    double median, most, max; /* most: 95 % are below */
};

/* How far the feedback is from the command of `lag` cycles ago. */
static struct spread distance(const unsigned joint, const unsigned count, const unsigned lag)
{
    static double d[MAX_SAMPLES];
    unsigned n = 0;
    for (unsigned i = CATCH_UP; i < count; i++)
        d[n++] = fabs(samples[i].feedback[joint] - samples[i - lag].command[joint]);
    qsort(d, n, sizeof d[0], compare);
    return (struct spread){d[n / 2], d[n * 95 / 100], d[n - 1]};
}

/* What read() sees was commanded by the write of the cycle before: exactly one period of lag. Apart from that the
 * axis is where the thread's lateness lets it be: speed times time. How late that is on a busy machine is no fault
 * here, so only most cycles have a limit. */
static void check_follows(const unsigned joint, const unsigned count)
{
    const double pi = acos(-1);
    const double travel = 2 * pi * sines[joint].hz * sines[joint].amplitude / CYCLES_PER_S; /* a cycle, at most */
    const struct spread none = distance(joint, count, 0), one = distance(joint, count, 1),
                        two = distance(joint, count, 2);
    double low = 0, high = 0;
    for (unsigned i = 0; i < count; i++) {
        low = fmin(low, samples[i].feedback[joint]);
        high = fmax(high, samples[i].feedback[joint]);
    }
    printf(
        "joint %u: median %.2g, 95 %% below %.2g, at most %.2g units from the command of one cycle ago (%.2g units a "
        "cycle)\n",
        joint, one.median, one.most, one.max, travel);
    ck_assert_double_gt(high, 0.99 * sines[joint].amplitude);
    ck_assert_double_lt(low, -0.99 * sines[joint].amplitude);
    ck_assert_double_lt(one.median, STEP + 0.2 * travel);
    ck_assert_double_lt(one.most, two.most);
    ck_assert_double_lt(2 * one.median, none.median);
    ck_assert_double_lt(2 * one.median, two.median);
}

static void check_samples(const unsigned count)
{
    load_samples(count);
    for (unsigned i = 0; i < count; i++) {
        const struct sample *const s = &samples[i];
        if (s->errors != 0)
            ck_abort_msg("packet error in cycle %u", i);
        if (labs(s->counts - s->encoder) > COUNTS_BETWEEN)
            ck_abort_msg("cycle %u: %ld steps, but the encoder saw %ld", i, s->counts, s->encoder);
    }
    for (unsigned joint = 0; joint < JOINTS; joint++)
        check_follows(joint, count);
}

/* Value of a pin or parameter in the listing at the end. */
static const char *shown(const char *const card, const char *const name)
{
    static char value[2][64];
    static unsigned turn;
    char full[128];
    const size_t len = (size_t)snprintf(full, sizeof full, " hm2_%s.0.%s", card, name);
    const char *at = run.text;
    turn = !turn;
    while ((at = strstr(at, full)) && at[len] != '\n' && at[len] != ' ')
        at++;
    if (!at)
        process_give_up(&run, full);
    while (at > run.text && at[-1] == ' ')
        at--;
    const char *const end = at;
    while (at > run.text && at[-1] != ' ')
        at--;
    snprintf(value[turn], sizeof value[turn], "%.*s", (int)(end - at), at);
    return value[turn];
}

/* Both came to rest at zero, and the card counted what the driver counted: all, but for one that the generator has just
 * counted and not yet made, or the other way round, when it rests at the edge of a count. */
static void check_rest(const char *const card)
{
    const double made = strtod(shown(card, "encoder.00.rawcounts"), NULL),
                 counted = strtod(shown(card, "stepgen.00.counts"), NULL);
    ck_assert_double_lt(fabs(strtod(shown(card, "stepgen.00.position-fb"), NULL)), STEP);
    ck_assert_double_lt(fabs(strtod(shown(card, "stepgen.01.position-fb"), NULL)), STEP);
    ck_assert_double_le(fabs(made - counted), 1.0);
    ck_assert_str_eq(shown(card, "packet-error-total"), "0x00000000");
    ck_assert_str_eq(shown(card, "packet-error"), "FALSE");
    ck_assert_str_eq(shown(card, "io_error"), "FALSE");
    ck_assert_str_eq(shown(card, "watchdog.has_bit"), "FALSE");
}

/* One request and one write in every cycle, and no other packet once the thread runs; each request was answered. */
static void check_card_side(const unsigned cycles)
{
    const char *const report = strstr(run.text, ": requests ");
    unsigned long requests = 0, replies = 0;
    ck_assert(report && sscanf(report, ": requests %lu replies %lu send-errors 0", &requests, &replies) == 2);
    ck_assert_uint_ge(replies, cycles);
    ck_assert_uint_ge(requests, 2ul * cycles);
}

static void check_run(const struct peer *const peer)
{
    check_samples(peer->samples);
    check_rest(peer->card);
    check_card_side(peer->samples);
}

START_TEST(linuxcncs_own_driver_runs_30_s_without_a_packet_error_and_its_stepgens_follow)
{
    if (simulator_suits_linuxcnc() && run_peer(&originals[_i]))
        check_run(&originals[_i]);
}
END_TEST

START_TEST(our_component_runs_in_linuxcnc_with_the_same_hal_file)
{
    const struct peer *const peer = &ours[_i];
    if (!linuxcnc_loads_ours())
        return;
    if (!run_peer(peer))
        return;
    check_run(peer);
    ck_assert_str_eq(shown(peer->card, "packet-lost"), "0x00000000");
    ck_assert_str_eq(shown(peer->card, "packet-late"), "0x00000000");
    ck_assert_str_eq(shown(peer->card, "packet-stale"), "0x00000000");
    ck_assert_str_eq(shown(peer->card, "packet-malformed"), "0x00000000");
    ck_assert_str_eq(shown(peer->card, "write-lost"), "0x00000000");
    if (strstr(run.text, "ERROR"))
        process_give_up(&run, "LinuxCNC complains");
}
END_TEST

/* ---- left-overs ---------------------------------------------------------------------------------------------------
 */

static const char *state_of_machine(void)
{
    static struct process list;
    static const char *const argv[] = {"sh", "-c",
                                       "cut -d: -f1 /proc/net/dev; cat /proc/sysvipc/shm | cut -c1-40; cat "
                                       "/proc/mounts; ls /run/netns /var/run/netns 2>&1",
                                       NULL};
    ck_assert_int_eq(process_run(&list, argv, 5000) & 0xFD, 0); /* 2: no such folder */
    return list.text;
}

static unsigned processes_with_mark(void)
{
    static struct process list;
    char command[256];
    snprintf(command, sizeof command, "grep -lz '^PEER_MARK=%d$' /proc/[0-9]*/environ 2>/dev/null | wc -l",
             (int)getpid());
    unsetenv("PEER_MARK");
    const char *const argv[] = {"sh", "-c", command, NULL};
    ck_assert_int_eq(process_run(&list, argv, 5000), 0);
    return (unsigned)strtoul(list.text, NULL, 10);
}

START_TEST(a_run_that_is_killed_leaves_nothing_behind)
{
    static char before[PROCESS_OUTPUT_BYTES];
    const struct timespec pause = {.tv_nsec = 100000000};
    snprintf(before, sizeof before, "%s", state_of_machine());
    start_peer(&originals[0]);
    if (!process_wait_line(&run, "Note: ", 20000, NULL)) {
        ck_assert(strncmp(run.text, "SKIP: ", 6) == 0);
        printf("%.*s\n", (int)strcspn(run.text, "\n"), run.text);
        return;
    }
    ck_assert_uint_gt(processes_with_mark(), 3);
    process_stop(&run, SIGKILL, 1000);
    for (unsigned i = 0; i < 50 && processes_with_mark() > 0; i++)
        nanosleep(&pause, NULL);
    ck_assert_uint_eq(processes_with_mark(), 0);
    ck_assert_str_eq(state_of_machine(), before);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("linuxcnc");
    TCase *const tests = tcase_create("peer");
    tcase_set_timeout(tests, 120);
    tcase_add_loop_test(tests, linuxcncs_own_driver_runs_30_s_without_a_packet_error_and_its_stepgens_follow, 0,
                        (int)(sizeof originals / sizeof originals[0]));
    tcase_add_loop_test(tests, our_component_runs_in_linuxcnc_with_the_same_hal_file, 0,
                        (int)(sizeof ours / sizeof ours[0]));
    tcase_add_test(tests, a_run_that_is_killed_leaves_nothing_behind);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
