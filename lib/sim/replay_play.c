/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One test of a trace folder, played on a fresh card. */
#include "replay_trace.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim_card.h"

#define PIECE_CLK 65536

__attribute__((format(printf, 2, 0))) static void keep(char difference[REPLAY_TEXT], const char *const format,
                                                       va_list args)
{
    (void)vsnprintf(difference, REPLAY_TEXT, format, args);
}

void replay_differs(struct replay_run *const run, const char *const format, ...)
{
    if (!run->difference[0]) {
        va_list args;
        va_start(args, format);
        keep(run->difference, format, args);
        va_end(args);
    }
}

static const char *time_name(const struct replay_run *const run)
{
    return run->trace->in_ns ? "ns" : "clk";
}

/* Edges of ClockLow lie in the middle of their period, counted from power-up: at 5 + 10 k ns at 100 MHz (pwmgen
 * README). The same holds for ClockHigh. */
int64_t replay_clk(const struct replay_run *const run, const int64_t at)
{
    if (!run->trace->in_ns)
        return at;
    return (int64_t)((double)at * (double)sim_clock_low_hz(run->card) / 1e9);
}

/* Time of the trace at which an edge shows: nanoseconds are printed rounded down. */
static int64_t trace_time(const struct replay_run *const run, const int64_t clk, const unsigned ps)
{
    if (!run->trace->in_ns)
        return clk;
    const double ns = ((double)clk + 0.5) * 1e9 / (double)sim_clock_low_hz(run->card) + ps / 1000.0;
    return (int64_t)(ns + 1e-6);
}

/* The part of a clock behind it; times in nanoseconds are whole. */
static unsigned trace_part(const struct replay_run *const run, const unsigned ps)
{
    const double clk_ps = 1e12 / (double)sim_clock_low_hz(run->card);
    return run->trace->in_ns ? 0 : (unsigned)(ps * REPLAY_PARTS / clk_ps + 0.5);
}

static unsigned part_ps(const struct replay_run *const run, const struct replay_event *const event)
{
    return (unsigned)(event->part * 1e12 / REPLAY_PARTS / (double)sim_clock_low_hz(run->card));
}

enum sim_level replay_level(const char c, bool *const valid)
{
    *valid = true;
    switch (c) {
    case '0':
        return SIM_LOW;
    case '1':
        return SIM_HIGH;
    case 'Z':
        return SIM_FLOAT;
    case 'H':
        return SIM_PULLUP;
    default:
        *valid = false;
        return SIM_FLOAT;
    }
}

static char level_char(const enum sim_level level)
{
    static const char chars[] = "01ZH";
    return chars[level & 3];
}

/* The card drives nothing: whether the recording shows that as Z or H depends on the resistor outside. */
static enum sim_level as_driven(const enum sim_level level)
{
    return level == SIM_PULLUP ? SIM_FLOAT : level;
}

static enum sim_level event_level(const struct replay_event *const event, bool *const valid)
{
    const enum sim_level level = replay_level(event->value[0], valid);
    if (event->value[0] && event->value[1])
        *valid = false;
    return level;
}

struct time_text {
    char text[32];
};

static struct time_text time_text(const int64_t at, const unsigned part)
{
    struct time_text t;
    if (part)
        (void)snprintf(t.text, sizeof t.text, "%lld.%02u", (long long)at, part);
    else
        (void)snprintf(t.text, sizeof t.text, "%lld", (long long)at);
    return t;
}

/* ---- edges --------------------------------------------------------------------------------------------------------
 */

/* The recording of a moment lists what a signal passed through within it; only what it ends with counts. */
static void settle_first_moment(struct replay_run *const run, struct replay_watch *const watch)
{
    if (watch->settled)
        return;
    watch->settled = true;
    if (watch->has_initial && watch->level != watch->initial)
        replay_differs(run, "%s %lld: %s expected %c, got %c", time_name(run), (long long)run->first_edge, watch->name,
                       level_char(watch->initial), level_char(watch->level));
}

static void compare_edge(struct replay_run *const run, struct replay_watch *const watch, const int64_t at,
                         const unsigned part, const enum sim_level level)
{
    const struct replay_event *const events = run->trace->events;
    if (watch->next >= watch->edge_count) {
        if (!run->kind->edges_end_early)
            replay_differs(run, "%s %lld: %s expected no further edge, got %c", time_name(run), (long long)at,
                           watch->name, level_char(level));
        return;
    }
    const struct replay_event *const event = &events[watch->edges[watch->next++]];
    bool valid = false;
    const enum sim_level expected = as_driven(event_level(event, &valid));
    if (at != event->at || part != event->part || level != expected)
        replay_differs(run, "%s %s: %s expected %c at %s (line %u), got %c", time_name(run), time_text(at, part).text,
                       watch->name, level_char(expected), time_text(event->at, event->part).text, event->line,
                       level_char(level));
}

static void on_edge(void *const context, const int64_t clk, const unsigned ps, const unsigned number,
                    const enum sim_level level)
{
    struct replay_run *const run = context;
    if (++run->edges_seen > REPLAY_MAX_EVENTS)
        replay_differs(run, "clk %lld: more than %u edges", (long long)clk, REPLAY_MAX_EVENTS);
    if (run->kind->on_edge)
        run->kind->on_edge(run, clk, number, level);
    for (unsigned i = 0; i < run->watch_count; i++) {
        struct replay_watch *const watch = &run->watches[i];
        if (watch->number != (int)number)
            continue;
        const int64_t at = trace_time(run, clk, ps);
        if (at > run->first_edge || (at == run->first_edge && ps > 0)) {
            settle_first_moment(run, watch);
            compare_edge(run, watch, at, trace_part(run, ps), as_driven(level));
        }
        watch->level = as_driven(level);
    }
}

static void compare_missing(struct replay_run *const run)
{
    const int64_t end = run->trace->events[run->test->first + run->test->count - 1].at;
    for (unsigned i = 0; i < run->watch_count; i++) {
        struct replay_watch *const watch = &run->watches[i];
        settle_first_moment(run, watch);
        if (watch->next >= watch->edge_count)
            continue;
        const struct replay_event *const event = &run->trace->events[watch->edges[watch->next]];
        replay_differs(run, "%s %lld: %s expected %s (line %u), got no edge up to %lld", time_name(run),
                       (long long)event->at, watch->name, event->value, event->line, (long long)end);
    }
}

static struct replay_watch *watch_named(struct replay_run *const run, const char *const name)
{
    for (unsigned i = 0; i < run->watch_count; i++)
        if (strcmp(run->watches[i].name, name) == 0)
            return &run->watches[i];
    return NULL;
}

static int start_watch(struct replay_run *const run, const struct replay_event *const event,
                       struct hm2_diag *const diag)
{
    unsigned number = 0;
    const struct replay_signal *const signal = replay_find_signal(run->kind, event->name, true, &number);
    if (!signal)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: %s is no output of folder kind %s.",
                            event->line, event->name, run->kind->folder);
    if (run->watch_count >= REPLAY_MAX_WATCHES)
        return hm2_diag_add(diag, HM2_ERR_NOSPACE, "events.csv line %u: more than %u outputs.", event->line,
                            REPLAY_MAX_WATCHES);
    const int watch = signal->kind == REPLAY_PAD
                          ? sim_card_watch_pad(run->card, number)
                          : sim_card_watch_output(run->card, signal->gtag, number, signal->secondary_pin);
    if (watch < 0)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: the card has no output %s (%s).", event->line,
                            event->name, hm2_strerror(watch));
    run->watches[run->watch_count++] = (struct replay_watch){
        .name = event->name, .number = watch, .level = as_driven(sim_card_watched(run->card, (unsigned)watch))};
    return 0;
}

static bool is_of_bench(const struct replay_run *const run, const struct replay_event *const event)
{
    return run->kind->bench_output && strcmp(run->kind->bench_output, event->name) == 0;
}

/* One watch per name, then the list of its edges: all lists lie one behind the other in edge_indices. */
static int find_watches(struct replay_run *const run, struct hm2_diag *const diag)
{
    const struct replay_event *const events = run->trace->events;
    const size_t end = run->test->first + run->test->count;
    run->first_edge = INT64_MAX;
    for (size_t i = run->test->first; i < end; i++) {
        if (events[i].kind != 'E' || is_of_bench(run, &events[i]))
            continue;
        bool valid = false;
        (void)event_level(&events[i], &valid);
        if (!valid)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: level \"%.20s\" is none of 0 1 Z H.",
                                events[i].line, events[i].value);
        if (run->first_edge == INT64_MAX)
            run->first_edge = events[i].at;
        const int err = watch_named(run, events[i].name) ? 0 : start_watch(run, &events[i], diag);
        if (err)
            return err;
    }
    size_t used = 0;
    for (unsigned w = 0; w < run->watch_count; w++) {
        struct replay_watch *const watch = &run->watches[w];
        watch->edges = run->edge_indices + used;
        for (size_t i = run->test->first; i < end; i++) {
            if (events[i].kind != 'E' || strcmp(events[i].name, watch->name) != 0)
                continue;
            bool valid = false;
            const enum sim_level level = as_driven(event_level(&events[i], &valid));
            if (events[i].at == run->first_edge && events[i].part == 0) {
                watch->initial = level;
                watch->has_initial = true;
            } else {
                run->edge_indices[used++] = i;
                watch->edge_count++;
            }
        }
    }
    return 0;
}

/* ---- registers, inputs, vectors ---------------------------------------------------------------------------------- */

static int play_register(struct replay_run *const run, const struct replay_event *const event,
                         struct hm2_diag *const diag)
{
    uint16_t address = 0;
    if (!replay_find_register(run->kind, event->name, &address))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: %.40s is no register of folder kind %s.",
                            event->line, event->name, run->kind->folder);
    char text[24];
    snprintf(text, sizeof(text), "%.20s", event->value);
    char *const slash = strchr(text, '/');
    uint32_t value = 0, mask = 0;
    if (slash)
        *slash = '\0';
    if (replay_hex32(text, &value) || (slash && (event->kind == 'W' || replay_hex32(slash + 1, &mask))))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: value \"%.20s\" is not a 32-bit hex number.",
                            event->line, event->value);
    const int64_t clk = replay_clk(run, event->at);
    if (event->kind == 'W') {
        sim_card_write(run->card, clk, address, value);
        return 0;
    }
    uint32_t undriven = 0;
    const uint32_t got = sim_card_read(run->card, clk, address, &undriven) & ~undriven;
    const bool same = run->kind->near ? run->kind->near(event, value, got) : got == value;
    if (!same || undriven != mask)
        replay_differs(run, "%s %lld: %s expected %s (line %u), got %08X/%08X", time_name(run), (long long)event->at,
                       event->name, event->value, event->line, (unsigned)got, (unsigned)undriven);
    return 0;
}

static int play_input(struct replay_run *const run, const struct replay_event *const event, struct hm2_diag *const diag)
{
    unsigned number = 0;
    const struct replay_signal *const signal = replay_find_signal(run->kind, event->name, false, &number);
    bool valid = false;
    const enum sim_level level = event_level(event, &valid);
    if (!signal || !valid)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: %.40s = %.20s is no input of folder kind %s.",
                            event->line, event->name, event->value, run->kind->folder);
    const int64_t clk = replay_clk(run, event->at);
    const int err = signal->kind == REPLAY_PAD ? sim_card_drive(run->card, clk, number, level)
                                               : sim_drive_input_at(run->card, clk, part_ps(run, event), signal->gtag,
                                                                    number, signal->secondary_pin, level);
    return err ? hm2_diag_add(diag, err, "events.csv line %u: the card has no input %.40s.", event->line, event->name)
               : 0;
}

static const struct replay_vector *find_vector(const struct replay_run *const run, const char *const name,
                                               const size_t len)
{
    const struct replay_vector *vector = run->kind->vectors;
    for (; vector && vector->name; vector++)
        if (strlen(vector->name) == len && strncmp(vector->name, name, len) == 0)
            return vector;
    return NULL;
}

static enum sim_level vector_element(const struct replay_run *const run, const struct replay_vector *const vector,
                                     const unsigned i)
{
    if (!vector->elements)
        return sim_card_pad(run->card, i);
    unsigned at = i;
    for (const struct replay_vector *v = run->kind->vectors; v != vector; v++)
        at += v->elements ? v->count : 0;
    return sim_card_watched(run->card, (unsigned)run->vector_watches[at]);
}

/* Outputs in vectors are watched from the start: a module's output has no other way to be seen. */
static int watch_vectors(struct replay_run *const run, struct hm2_diag *const diag)
{
    unsigned used = 0;
    for (const struct replay_vector *v = run->kind->vectors; v && v->name; v++) {
        for (unsigned i = 0; v->elements && i < v->count; i++) {
            if (used >= REPLAY_MAX_WATCHES)
                return HM2_ERR_NOSPACE;
            const struct replay_signal *const signal = &v->elements[i];
            const int watch = sim_card_watch_output(run->card, signal->gtag, signal->first, signal->secondary_pin);
            if (watch < 0)
                return hm2_diag_add(diag, watch, "The card has no output %s for vector %s.", signal->name, v->name);
            run->vector_watches[used++] = watch;
        }
    }
    return 0;
}

static bool has_vectors(const struct replay_run *const run)
{
    const size_t end = run->test->first + run->test->count;
    for (size_t i = run->test->first; i < end; i++)
        if (run->trace->events[i].kind == 'N')
            return true;
    return false;
}

/* Compare the levels in text with a vector's elements. */
static int compare_vector(struct replay_run *const run, const struct replay_event *const event,
                          const struct replay_vector *const vector, const char *const text, const size_t len,
                          struct hm2_diag *const diag)
{
    if (len == 0 || len > vector->count)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: %s has 1 to %u levels, not %zu.", event->line,
                            vector->name, vector->count, len);
    for (unsigned i = 0; i < len; i++) {
        bool valid = false;
        const enum sim_level expected = as_driven(replay_level(text[i], &valid));
        if (!valid)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: level '%c' is none of 0 1 Z H.",
                                event->line, text[i]);
        const enum sim_level got = as_driven(vector_element(run, vector, i));
        if (got != expected)
            replay_differs(run, "%s %lld: %s[%u] expected %c (line %u), got %c", time_name(run), (long long)event->at,
                           vector->name, i, text[i], event->line, level_char(got));
    }
    return 0;
}

/* "LEVELS", or "LEVELS OTHER=LEVELS ...": the first belongs to the event's name. */
static int play_vector(struct replay_run *const run, const struct replay_event *const event,
                       struct hm2_diag *const diag)
{
    const char *name = event->name;
    size_t name_len = strlen(name);
    const char *text = event->value;
    bool first = true;
    while (*text) {
        size_t len = strcspn(text, " ");
        const char *levels = text;
        const char *const equals = memchr(text, '=', len);
        if (!first && equals) {
            name = text;
            name_len = (size_t)(equals - text);
            levels = equals + 1;
        }
        const struct replay_vector *const vector = find_vector(run, name, name_len);
        if (!vector || (!first && !equals))
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: no vector %.*s in folder kind %s.",
                                event->line, (int)(name_len < 40 ? name_len : 40), name, run->kind->folder);
        if (first) /* the others of the line are of the same moment */
            sim_card_advance(run->card, replay_clk(run, event->at) + (vector->before_edge ? 0 : 1));
        const int err = compare_vector(run, event, vector, levels, len - (size_t)(levels - text), diag);
        if (err)
            return err;
        first = false;
        text += len;
        text += strspn(text, " ");
    }
    return 0;
}

/* An I event is something that the bench did to an input, or a vector that it looked at. */
static int play_observation(struct replay_run *const run, const struct replay_event *const event,
                            struct hm2_diag *const diag)
{
    return find_vector(run, event->name, strlen(event->name)) ? play_vector(run, event, diag)
                                                              : play_input(run, event, diag);
}

/* ---- the test ------------------------------------------------------------------------------------------------------
 */

/* Order within one clock: reads see what was before the edge, writes act at it, inputs change and vectors are looked
 * at after it. */
static unsigned phase_of(const struct replay_run *const run, const struct replay_event *const event)
{
    switch (event->kind) {
    case 'R':
        return 0;
    case 'W':
        return 1;
    case 'I':
        return find_vector(run, event->name, strlen(event->name)) ? 3 : 2;
    case 'N': {
        const struct replay_vector *const vector = find_vector(run, event->name, strlen(event->name));
        return vector && vector->before_edge ? 0 : 3;
    }
    default:
        return 4;
    }
}

/* In pieces, so that a test that has failed does not run to its end. */
static void advance(struct replay_run *const run, const int64_t clk)
{
    for (int64_t now = sim_card_clock(run->card); now < clk && !run->difference[0]; now = sim_card_clock(run->card))
        sim_card_advance(run->card, now + PIECE_CLK < clk ? now + PIECE_CLK : clk);
}

static int play_event(struct replay_run *const run, const struct replay_event *const event, struct hm2_diag *const diag)
{
    const int err = run->kind->before_event ? run->kind->before_event(run, event) : 0;
    if (err)
        return hm2_diag_add(diag, err, "events.csv line %u: the stimulus before it cannot be applied.", event->line);
    switch (event->kind) {
    case 'R':
    case 'W':
        return play_register(run, event, diag);
    case 'I':
        return play_observation(run, event, diag);
    case 'N':
        return play_vector(run, event, diag);
    default:
        return 0;
    }
}

static int play_moment(struct replay_run *const run, const size_t first, const size_t end, struct hm2_diag *const diag)
{
    for (unsigned phase = 0; phase <= 4; phase++) {
        for (size_t i = first; i < end; i++) {
            const struct replay_event *const event = &run->trace->events[i];
            const int err = phase_of(run, event) == phase ? play_event(run, event, diag) : 0;
            if (err)
                return err;
        }
    }
    return 0;
}

static int play_events(struct replay_run *const run, struct hm2_diag *const diag)
{
    const struct replay_event *const events = run->trace->events;
    const size_t end = run->test->first + run->test->count;
    for (size_t i = run->test->first; i < end;) {
        advance(run, replay_clk(run, events[i].at) - 1);
        if (run->difference[0])
            return 0;
        size_t next = i + 1;
        while (next < end && events[next].at == events[i].at && events[next].part == events[i].part)
            next++;
        const int err = play_moment(run, i, next, diag);
        if (err)
            return err;
        i = next;
    }
    return 0;
}

static int new_card(struct replay_run *const run, struct hm2_diag *const diag)
{
    struct hm2_image image;
    const bool timer = run->kind->timer_firmware && strncmp(run->test->name, "timer_", 6) == 0;
    const char *const firmware = timer ? run->kind->timer_firmware : run->kind->firmware;
    if (!replay_firmware(firmware, &image))
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "No firmware image %s.", firmware);
    const struct sim_card_options options = {
        .profile = run->kind->profile, .image = &image, .sources = run->kind->sources};
    return sim_card_new(&run->card, &options, diag);
}

int replay_play(struct replay_run *const run, struct hm2_diag *const diag)
{
    if (run->test->count == 0) {
        replay_differs(run, "events.csv has no events of this test");
        return 0;
    }
    int err = new_card(run, diag);
    if (err)
        return err;
    run->edge_indices = malloc(run->test->count * sizeof(*run->edge_indices));
    err = run->edge_indices ? find_watches(run, diag) : HM2_ERR_NOMEM;
    if (!err && has_vectors(run))
        err = watch_vectors(run, diag);
    sim_card_on_edge(run->card, on_edge, run);
    if (!err && run->kind->prepare)
        err = run->kind->prepare(run);
    if (!err)
        err = play_events(run, diag);
    if (!err) {
        const struct replay_event *const last = &run->trace->events[run->test->first + run->test->count - 1];
        sim_card_advance(run->card, replay_clk(run, last->at) + 1);
        compare_missing(run);
    }
    free(run->edge_indices);
    run->edge_indices = NULL;
    sim_card_free(run->card);
    run->card = NULL;
    return err;
}
