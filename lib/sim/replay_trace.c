/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "replay_trace.h"

#include <stdlib.h>
#include <string.h>

static const char event_kinds[] = "IWRENJ#";

/* Grow an array to hold one more element; NULL when the limit is reached or memory is out. */
static void *grow(void *array, const size_t count, const size_t limit, const size_t size)
{
    if (count >= limit)
        return NULL;
    if (count & (count - 1)) /* room up to the next power of two */
        return array;
    return realloc(array, (count ? count * 2 : 1) * size);
}

/* Some recordings call their tests scenarios. */
static int test_column(const struct replay_csv *const csv, struct hm2_diag *const diag)
{
    const int scenario = replay_csv_column(csv, "scenario");
    return scenario >= 0 ? scenario : replay_csv_need(csv, "test", diag);
}

static int parse_tests(struct replay_trace *const trace, char *const text, const size_t len,
                       struct hm2_diag *const diag)
{
    struct replay_csv csv;
    int err = replay_csv_open(&csv, "tests.csv", text, len, diag);
    if (err)
        return err;
    const int name = test_column(&csv, diag);
    const int description = replay_csv_column(&csv, "description");
    if (name < 0)
        return name;
    while ((err = replay_csv_row(&csv, diag)) > 0) {
        struct replay_test *const tests = grow(trace->tests, trace->test_count, REPLAY_MAX_TESTS, sizeof(*tests));
        if (!tests)
            return hm2_diag_add(diag, HM2_ERR_NOSPACE, "tests.csv line %u: more than %u tests.", csv.line,
                                REPLAY_MAX_TESTS);
        trace->tests = tests;
        tests[trace->test_count++] =
            (struct replay_test){.name = csv.field[name], .description = description < 0 ? "" : csv.field[description]};
    }
    return err;
}

struct event_columns {
    int test, at, kind, name, value;
};

static int find_columns(const struct replay_csv *const csv, struct replay_trace *const trace,
                        struct event_columns *const columns, struct hm2_diag *const diag)
{
    trace->in_ns = replay_csv_column(csv, "clk") < 0 && replay_csv_column(csv, "ns") >= 0;
    columns->test = test_column(csv, diag);
    columns->at = replay_csv_need(csv, trace->in_ns ? "ns" : "clk", diag);
    columns->kind = replay_csv_need(csv, "ev", diag);
    columns->name = replay_csv_need(csv, "name", diag);
    columns->value = replay_csv_need(csv, "value", diag);
    const bool all =
        columns->test >= 0 && columns->at >= 0 && columns->kind >= 0 && columns->name >= 0 && columns->value >= 0;
    return all ? 0 : HM2_ERR_MALFORMED;
}

static struct replay_test *find_test(const struct replay_trace *const trace, const char *const name)
{
    for (size_t i = 0; i < trace->test_count; i++)
        if (strcmp(trace->tests[i].name, name) == 0)
            return &trace->tests[i];
    return NULL;
}

static int parse_event(const struct replay_csv *const csv, const struct event_columns *const columns,
                       struct replay_event *const event, struct hm2_diag *const diag)
{
    event->line = csv->line;
    event->name = csv->field[columns->name];
    event->value = csv->field[columns->value];
    const char *const kind = csv->field[columns->kind];
    if (strlen(kind) != 1 || !strchr(event_kinds, kind[0]))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s line %u: event kind \"%.20s\" is none of %s.", csv->file,
                            csv->line, kind, event_kinds);
    event->kind = kind[0];
    if (replay_decimal(csv->field[columns->at], REPLAY_MAX_TIME, &event->at))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s line %u: time \"%.20s\" is not a number of 0..%d.", csv->file,
                            csv->line, csv->field[columns->at], REPLAY_MAX_TIME);
    return 0;
}

/* Add an event to its test. The events of a test must be in one piece and in order of time. */
static int place_event(struct replay_trace *const trace, struct replay_test **const current,
                       const struct replay_event *const event, const char *const test, struct hm2_diag *const diag)
{
    if (!*current || strcmp((*current)->name, test) != 0) {
        *current = find_test(trace, test);
        if (!*current)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: test \"%.60s\" is not in tests.csv.",
                                event->line, test);
        if ((*current)->count)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                                "events.csv line %u: the events of test \"%.60s\" are in two pieces.", event->line,
                                test);
        (*current)->first = trace->event_count - 1;
    } else if (event->at < event[-1].at) {
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "events.csv line %u: time goes back from %lld to %lld.",
                            event->line, (long long)event[-1].at, (long long)event->at);
    }
    (*current)->count++;
    return 0;
}

static int parse_events(struct replay_trace *const trace, char *const text, const size_t len,
                        struct hm2_diag *const diag)
{
    struct replay_csv csv;
    struct event_columns columns;
    int err = replay_csv_open(&csv, "events.csv", text, len, diag);
    if (!err)
        err = find_columns(&csv, trace, &columns, diag);
    if (err)
        return err;
    struct replay_test *current = NULL;
    while ((err = replay_csv_row(&csv, diag)) > 0) {
        struct replay_event *const events = grow(trace->events, trace->event_count, REPLAY_MAX_EVENTS, sizeof(*events));
        if (!events)
            return hm2_diag_add(diag, HM2_ERR_NOSPACE, "events.csv line %u: more than %u events.", csv.line,
                                REPLAY_MAX_EVENTS);
        trace->events = events;
        struct replay_event *const event = &events[trace->event_count++];
        err = parse_event(&csv, &columns, event, diag);
        if (!err)
            err = place_event(trace, &current, event, csv.field[columns.test], diag);
        if (err)
            return err;
    }
    return err;
}

int replay_trace_parse(struct replay_trace *const trace, char *const tests, const size_t tests_len, char *const events,
                       const size_t events_len, struct hm2_diag *const diag)
{
    memset(trace, 0, sizeof(*trace));
    int err = parse_tests(trace, tests, tests_len, diag);
    if (!err)
        err = parse_events(trace, events, events_len, diag);
    if (err)
        replay_trace_free(trace);
    return err;
}

void replay_trace_free(struct replay_trace *const trace)
{
    free(trace->tests);
    free(trace->events);
    memset(trace, 0, sizeof(*trace));
}

int replay_event_add(struct replay_event_list *const list, const struct replay_event *const event)
{
    struct replay_event *const events = grow(list->events, list->count, REPLAY_MAX_EVENTS, sizeof(*events));
    if (!events)
        return HM2_ERR_NOMEM;
    list->events = events;
    events[list->count++] = *event;
    return 0;
}

static int by_time(const void *const a, const void *const b)
{
    const struct replay_event *const x = a, *const y = b;
    if (x->at != y->at)
        return x->at < y->at ? -1 : 1;
    return (x->line > y->line) - (x->line < y->line);
}

int replay_trace_merge(struct replay_trace *const merged, const struct replay_trace *const trace,
                       const struct replay_test *const test, struct replay_event_list *const list)
{
    for (size_t i = 0; i < test->count; i++) {
        const int err = replay_event_add(list, &trace->events[test->first + i]);
        if (err)
            return err;
    }
    if (list->count > 0) /* an empty list has no memory, and qsort() wants some */
        qsort(list->events, list->count, sizeof(*list->events), by_time);
    *merged = (struct replay_trace){.in_ns = trace->in_ns, .events = list->events, .event_count = list->count};
    return 0;
}

/* ---- meaning of names ------------------------------------------------------------------------------------------- */

/* Registers that every HostMot2 firmware of the old map has (register map 1.2, 2.2, 3.1 to 3.3), under the names that
 * the traces use; a folder's own names come first. */
static const struct replay_register common_registers[] = {
    {"time", 0x0C00, 0},      {"status", 0x0D00, 0}, {"cookie", 0x0E00, 0},
    {"port", 0x1000, 4},      {"ddr", 0x1100, 4},    {"altsrc", 0x1200, 4},
    {"opendrain", 0x1300, 4}, {"invert", 0x1400, 4}, {"led", 0x0200, 0},
    {"idromwen", 0x0800, 0},  {"idrom", 0x0400, 4},  {"irqstatus", 0x0A00, 0},
    {"irqclear", 0x0B00, 0},  {NULL, 0, 0},
};

static const struct replay_signal common_signals[] = {
    {"pin", REPLAY_PAD, 0, 0, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* Number behind a name: true when text is name followed by nothing (*numbered false) or by a decimal number. */
static bool name_and_number(const char *const text, const char *const name, bool *const numbered,
                            unsigned *const number)
{
    const size_t len = strlen(name);
    if (strncmp(text, name, len) != 0)
        return false;
    *numbered = text[len] != '\0';
    *number = 0;
    if (!*numbered)
        return true;
    int64_t value = 0;
    if (replay_decimal(text + len, 255, &value))
        return false;
    *number = (unsigned)value;
    return true;
}

static bool search_registers(const struct replay_register *row, const char *const name, uint16_t *const address)
{
    for (; row && row->name; row++) {
        bool numbered = false;
        unsigned number = 0;
        if (!name_and_number(name, row->name, &numbered, &number) || (numbered && !row->stride))
            continue;
        *address = (uint16_t)(row->address + number * row->stride);
        return true;
    }
    return false;
}

bool replay_find_register(const struct replay_kind *const kind, const char *const name, uint16_t *const address)
{
    uint32_t value = 0;
    if (name[0] == '0' && name[1] == 'x' && !replay_hex32(name + 2, &value) && value <= UINT16_MAX) {
        *address = (uint16_t)value;
        return true;
    }
    return search_registers(kind->registers, name, address) || search_registers(common_registers, name, address);
}

static const struct replay_signal *search_signals(const struct replay_signal *row, const char *const name,
                                                  const bool driven_by_card, unsigned *const number)
{
    for (; row && row->name; row++) {
        bool numbered = false;
        if (row->kind == (driven_by_card ? REPLAY_INPUT : REPLAY_OUTPUT) ||
            !name_and_number(name, row->name, &numbered, number))
            continue;
        if (!numbered)
            *number = row->first;
        return row;
    }
    return NULL;
}

const struct replay_signal *replay_find_signal(const struct replay_kind *const kind, const char *const name,
                                               const bool driven_by_card, unsigned *const number)
{
    const struct replay_signal *const own = search_signals(kind->signals, name, driven_by_card, number);
    return own ? own : search_signals(common_signals, name, driven_by_card, number);
}
