/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The bench of the serial recordings: TX is wired to RX, unless something drives RX from outside. Of some tests the
 * recording does not list what that was, but the descriptions tell, and it began three clocks after a bus access that
 * is followed by a long time without one.
 */
#include <stdlib.h>
#include <string.h>

#include "replay_trace.h"

#define PIN_TX 0x81u
#define PIN_RX 0x01u

#define GAP_CLK   3
#define FALSE_CLK 5   /* a false start whose length the description does not give */
#define PAUSE_CLK 600 /* behind a frame */
#define GAPS      3u

/* What came in each such time, step by step: bHH = a byte, l = a low pulse, i = idle time, both as long as the
 * description says, p = a pause. */
static const struct {
    const char *prefix;
    const char *steps[GAPS];
} benches[] = {
    {"rx_split_", {"b55 i bAA", "", ""}}, {"rx_clear_flags", {"l", "b41", "b42"}},
    {"rx_filter_", {"", "b55", ""}},      {"rx_clear_waiting", {"b41 p b42", "b43", ""}},
    {"rx_low_", {"b55", "l", ""}},        {"rx_false_start_", {"l", "b41", ""}},
};

struct bench {
    const struct replay_test *test;
    struct replay_event_list *out;
    int64_t at;
    long bit_clk;
};

static const char *const *steps_of(const struct replay_trace *const trace, const struct replay_test *const test)
{
    for (size_t i = 0; i < test->count; i++)
        if (trace->events[test->first + i].kind == 'I')
            return NULL;
    for (size_t i = 0; i < sizeof benches / sizeof benches[0]; i++)
        if (strncmp(test->name, benches[i].prefix, strlen(benches[i].prefix)) == 0)
            return benches[i].steps;
    return NULL;
}

static int level(const struct bench *const bench, const bool high)
{
    const struct replay_event event = {.at = bench->at, .name = "rx", .value = high ? "1" : "0", .kind = 'I'};
    return replay_event_add(bench->out, &event);
}

/* A number behind these words of the description. */
static long number_after(const struct replay_test *const test, const char *const words, const long otherwise)
{
    const char *const found = strstr(test->description, words);
    const long number = found ? strtol(found + strlen(words), NULL, 10) : otherwise;
    return number < 0 || number > REPLAY_MAX_TIME ? 0 : number;
}

static int send_byte(struct bench *const bench, const unsigned long byte)
{
    const unsigned long frame = byte << 1 | 1u << 9;
    int err = 0;
    for (unsigned bit = 0; bit < 10 && !err; bit++, bench->at += bench->bit_clk)
        err = level(bench, (frame >> bit & 1u) != 0);
    return err;
}

static int play_steps(struct bench *const bench, const char *step)
{
    int err = 0;
    for (; *step && !err; step += strcspn(step, " "), step += strspn(step, " ")) {
        if (*step == 'b') {
            err = send_byte(bench, strtoul(step + 1, NULL, 16));
        } else if (*step == 'l') {
            err = level(bench, false);
            bench->at += number_after(bench->test, "low pulse of ", FALSE_CLK);
            err = err ? err : level(bench, true);
        } else {
            bench->at += *step == 'i' ? number_after(bench->test, "idle time ", 0) : PAUSE_CLK;
        }
    }
    return err;
}

static long bit_length(const struct replay_event *const event)
{
    uint32_t rate = 0;
    return strcmp(event->name, "rxrate") == 0 && !replay_hex32(event->value, &rate) && rate > 0
               ? (long)(((1u << 20) + rate / 2) / rate)
               : 0;
}

int replay_serial_inputs(const struct replay_trace *const trace, const struct replay_test *const test,
                         struct replay_event_list *const out)
{
    const char *const *const steps = steps_of(trace, test);
    struct bench bench = {.test = test, .out = out, .bit_clk = 1};
    unsigned gap = 0;
    for (size_t i = 0; steps && i + 1 < test->count && gap < GAPS; i++) {
        const struct replay_event *const event = &trace->events[test->first + i];
        const long bit_clk = event->kind == 'W' ? bit_length(event) : 0;
        bench.bit_clk = bit_clk ? bit_clk : bench.bit_clk;
        if (event[1].at - event->at <= GAP_CLK)
            continue;
        bench.at = event->at + GAP_CLK;
        const int err = play_steps(&bench, steps[gap++]);
        if (err)
            return err;
    }
    return 0;
}

static bool drives_rx(const struct replay_run *const run)
{
    const struct replay_event *const events = run->trace->events + run->test->first;
    for (size_t i = 0; i < run->test->count; i++)
        if (events[i].kind == 'I' && strcmp(events[i].name, "rx") == 0)
            return true;
    return false;
}

/* The receiver of a transmitter has the next tag. */
static void loop(struct replay_run *const run, const int64_t clk, const enum sim_level level)
{
    if (sim_card_drive_input(run->card, clk, (uint8_t)(run->kind->loop_gtag + 1u), 0, PIN_RX, level))
        replay_differs(run, "clk %lld: the card has no receiver", (long long)clk);
}

int replay_serial_prepare(struct replay_run *const run)
{
    run->bench_watch[0] = -1;
    loop(run, -1, SIM_HIGH);
    if (!drives_rx(run))
        run->bench_watch[0] = sim_card_watch_output(run->card, run->kind->loop_gtag, 0, PIN_TX);
    return 0;
}

void replay_serial_edge(struct replay_run *const run, const int64_t clk, const unsigned watch,
                        const enum sim_level level)
{
    if (run->bench_watch[0] == (int)watch)
        loop(run, clk, level);
}
