/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The bench of the resolver recordings: six resolvers that stand at angles of their own, a filter that shows the sign
 * of the excitation, and the counts of its pulses in excitation.csv.
 *
 * The simulated processor does what the recorded one does, but not instruction by instruction: positions, velocities
 * and times of the excitation are compared with the tolerances below, everything else exactly.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "replay_trace.h"

#define CHANNELS    6u
#define AMPLITUDE   0.9
#define LOST_AT     60024 /* test signal_lost: "at about clk 60000", "then 0.9 again" */
#define BACK_AT     84114
#define FILTER_CLK  300.0
#define SLOW_GAIN   1.103 /* the filter weakens an excitation of half the frequency less, by so much */
#define PIN_PLUS    0x82u
#define COMMAND     0x3A00u
#define COMMAND_CLK 12012 /* before the pulses of excitation.csv */
#define LAST_CLK    1000000
#define BLOCK_CLK   100
#define SETTLED_CLK 700000 /* the loops have come to rest */
#define SIGN_NEAR   40     /* clk */
#define BLOCK_NEAR  6      /* clk: one bit, and where the block cuts the bits at its ends */

static const char sign_name[] = "exc_sign";

/* run->state: which event of the test has the next change of sign. */
enum { STATE_AWAITED };

/* ---- registers -----------------------------------------------------------------------------------------------------
 */

/* How far positions and velocities may be off, in 2^-32 turn and that in an excitation period. */
static const struct {
    int64_t position, velocity;
} moving = {0x01400000, 0x00200000} /* 0.005 and 0.0005 turn */, settled = {0x00080000, 0x00010000}; /* 0.00012 */

bool replay_resolver_near(const struct replay_event *const event, const uint32_t expected, const uint32_t got)
{
    const int64_t away = llabs((int64_t)(int32_t)(got - expected));
    const bool rests = event->at > SETTLED_CLK;
    if (strncmp(event->name, "pos", 3) == 0)
        return away <= (rests ? settled.position : moving.position);
    if (strncmp(event->name, "vel", 3) == 0)
        return away <= (rests ? settled.velocity : moving.velocity);
    return away == 0;
}

static int attach(struct sim_card *const card, const double amplitude)
{
    static const unsigned angles[CHANNELS] = {0, 8192, 16384, 30000, 45000, 60000};
    int err = 0;
    for (unsigned i = 0; i < CHANNELS && !err; i++)
        err = sim_card_resolver(card, i, &(struct sim_resolver){.amplitude = amplitude, .turns = angles[i] / 65536.0});
    return err;
}

/* ---- sign of the excitation ----------------------------------------------------------------------------------------
 */

/* The next recorded change, or NULL. */
static const struct replay_event *awaited(const struct replay_run *const run)
{
    return run->state[STATE_AWAITED] < run->test->count
               ? &run->trace->events[run->test->first + run->state[STATE_AWAITED]]
               : NULL;
}

static void await_from(struct replay_run *const run, const uint64_t first)
{
    run->state[STATE_AWAITED] = first;
    for (const struct replay_event *event; (event = awaited(run)); run->state[STATE_AWAITED]++)
        if (event->kind == 'E' && strcmp(event->name, sign_name) == 0)
            return;
}

static void sign_changed(struct replay_run *const run, const int64_t clk, const bool positive)
{
    const struct replay_event *const event = awaited(run);
    if (!event)
        return;
    if (llabs(event->at - clk) > SIGN_NEAR || positive != (event->value[0] == '1'))
        replay_differs(run, "clk %lld: %s expected %s at %lld (line %u), got %d", (long long)clk, sign_name,
                       event->value, (long long)event->at, event->line, positive);
    await_from(run, run->state[STATE_AWAITED] + 1);
}

/* Two low-pass filters, one behind the other, in the time between two changes of the pulses. */
void replay_resolver_edge(struct replay_run *const run, const int64_t clk, const unsigned watch,
                          const enum sim_level level)
{
    struct replay_filter *const f = &run->filter;
    if ((int)watch != run->bench_watch[0])
        return;
    const bool before = f->second > 0;
    const double t = (double)(clk - f->clk) / FILTER_CLK, left = exp(-t);
    f->second = f->in + (f->second - f->in + (f->first - f->in) * t) * left;
    f->first = f->in + (f->first - f->in) * left;
    f->in = level == SIM_HIGH ? 1 : -1;
    f->clk = clk;
    if (before != (f->second > 0))
        sign_changed(run, clk, !before);
}

static int watch_excitation(struct replay_run *const run)
{
    run->filter = (struct replay_filter){.in = -1, .first = -1, .second = -1};
    run->bench_watch[0] = sim_card_watch_output(run->card, HM2_GTAG_RESOLVER, 0, PIN_PLUS);
    return run->bench_watch[0] < 0 ? run->bench_watch[0] : 0;
}

/* ---- the bench -----------------------------------------------------------------------------------------------------
 */

static double amplitude_of(const struct replay_test *const test)
{
    int64_t thousandths;
    if (strncmp(test->name, "amplitude_", 10) != 0 || replay_decimal(test->name + 10, 1000, &thousandths))
        return AMPLITUDE;
    return (double)thousandths / 1000;
}

int replay_resolver_prepare(struct replay_run *const run)
{
    const int err = attach(run->card, amplitude_of(run->test));
    run->bench_watch[0] = -1;
    await_from(run, 0);
    return err || !awaited(run) ? err : watch_excitation(run);
}

int replay_resolver_event(struct replay_run *const run, const struct replay_event *const event)
{
    const struct replay_event *const sign = awaited(run);
    if (sign && sign->at + SIGN_NEAR < event->at)
        replay_differs(run, "clk %lld: %s expected %s (line %u), got no change up to %lld", (long long)sign->at,
                       sign_name, sign->value, sign->line, (long long)event->at);
    if (event->kind == 'W' && strcmp(event->value, "00000802") == 0)
        return attach(run->card, AMPLITUDE * SLOW_GAIN);
    if (strcmp(run->test->name, "signal_lost") != 0 || (event->at != LOST_AT && event->at != BACK_AT))
        return 0;
    return attach(run->card, event->at == BACK_AT ? AMPLITUDE : 0);
}

/* ---- excitation.csv ------------------------------------------------------------------------------------------------
 */

struct pulses {
    const struct replay_kind *kind;
    struct sim_card *card;
    int watch;
    uint32_t command;
    char name[32], difference[REPLAY_TEXT];
};

static int begin_command(struct pulses *const p, const uint32_t command, struct hm2_diag *const diag)
{
    struct hm2_image image;
    if (!replay_firmware(p->kind->firmware, &image))
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "No firmware image %s.", p->kind->firmware);
    const struct sim_card_options options = {.profile = p->kind->profile, .image = &image};
    const int err = sim_card_new(&p->card, &options, diag);
    if (err)
        return err;
    p->command = command;
    p->difference[0] = '\0';
    (void)snprintf(p->name, sizeof p->name, "excitation_%04X", (unsigned)command);
    if (command)
        sim_card_write(p->card, COMMAND_CLK, COMMAND, command);
    p->watch = sim_card_watch_output(p->card, HM2_GTAG_RESOLVER, 0, PIN_PLUS);
    return p->watch < 0 ? p->watch : 0;
}

static void end_command(struct pulses *const p, const struct replay_options *const options,
                        struct replay_totals *const totals)
{
    if (p->card && replay_wanted(options, p->name))
        replay_report(options, totals, p->name, p->difference);
    sim_card_free(p->card);
    p->card = NULL;
}

static void compare_block(struct pulses *const p, const int64_t clk, const int64_t expected)
{
    int64_t high = 0;
    for (int64_t i = 0; i < BLOCK_CLK; i++) {
        sim_card_advance(p->card, clk + i + 1);
        high += sim_card_watched(p->card, (unsigned)p->watch) == SIM_HIGH;
    }
    if (!p->difference[0] && llabs(high - expected) > BLOCK_NEAR)
        (void)snprintf(p->difference, sizeof p->difference, "clk %lld: expected %lld high clk, got %lld",
                       (long long)clk, (long long)expected, (long long)high);
}

static int play_block(struct pulses *const p, const struct replay_csv *const csv, const int columns[3],
                      const struct replay_options *const options, struct replay_totals *const totals,
                      struct hm2_diag *const diag)
{
    uint32_t command;
    int64_t clk, high;
    if (replay_hex32(csv->field[columns[0]], &command) || command > UINT16_MAX ||
        replay_decimal(csv->field[columns[1]], LAST_CLK, &clk) ||
        replay_decimal(csv->field[columns[2]], BLOCK_CLK, &high))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                            "%s line %u: expected a command, a clock up to %d and a count up to %d.", csv->file,
                            csv->line, LAST_CLK, BLOCK_CLK);
    int err = 0;
    if (!p->card || p->command != command) {
        end_command(p, options, totals);
        err = begin_command(p, command, diag);
    }
    if (!err && replay_wanted(options, p->name))
        compare_block(p, clk, high);
    return err;
}

int replay_resolver_excitation(const struct replay_kind *const kind, const struct replay_files *const files,
                               const struct replay_options *const options, struct replay_totals *const totals,
                               struct hm2_diag *const diag)
{
    static const char *const names[3] = {"command", "clk", "pdmp_high_clk_of_100"};
    char *text = NULL;
    size_t len = 0;
    struct replay_csv csv;
    struct pulses pulses = {.kind = kind};
    int columns[3];
    int err = files->load(files->context, "excitation.csv", &text, &len, diag);
    if (err)
        return err == HM2_ERR_NOTFOUND ? 0 : err;
    err = replay_csv_open(&csv, "excitation.csv", text, len, diag);
    for (unsigned i = 0; i < 3 && !err; i++) {
        columns[i] = replay_csv_need(&csv, names[i], diag);
        err = columns[i] < 0 ? columns[i] : 0;
    }
    int more = 0;
    while (!err && (more = replay_csv_row(&csv, diag)) > 0)
        err = play_block(&pulses, &csv, columns, options, totals, diag);
    end_command(&pulses, options, totals);
    free(text);
    return err ? err : more;
}
