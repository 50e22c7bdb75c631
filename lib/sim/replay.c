/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "replay_trace.h"

#include <stdlib.h>
#include <string.h>

static const struct replay_kind *find_kind(const char *const folder)
{
    for (unsigned i = 0; i < replay_kind_count; i++)
        if (strcmp(replay_kinds[i].folder, folder) == 0)
            return &replay_kinds[i];
    return NULL;
}

static int unknown_kind(const char *const folder, struct hm2_diag *const diag)
{
    char known[512] = "";
    size_t used = 0;
    for (unsigned i = 0; i < replay_kind_count; i++) {
        const size_t len = strlen(replay_kinds[i].folder);
        if (used + len + 2 >= sizeof(known))
            break;
        memcpy(known + used, replay_kinds[i].folder, len + 1);
        used += len;
        if (i + 1 < replay_kind_count) {
            known[used++] = ' ';
            known[used] = '\0';
        }
    }
    return hm2_diag_add(diag, HM2_ERR_NOTFOUND,
                        "\"%.80s\" is no kind of trace folder; the base name must be one of: %s.", folder, known);
}

bool replay_wanted(const struct replay_options *const options, const char *const test)
{
    return !options->only_test || strcmp(options->only_test, test) == 0;
}

void replay_report(const struct replay_options *const options, struct replay_totals *const totals,
                   const char *const test, const char *const difference)
{
    const bool passed = difference[0] == '\0';
    if (passed)
        totals->passed++;
    else
        totals->failed++;
    if (options->on_result)
        options->on_result(options->context, test, passed, difference);
}

/* A test whose recording lacks its inputs: play it with those that the rest of it tells. */
static int play_completed(struct replay_run *const run, struct hm2_diag *const diag)
{
    struct replay_event_list list = {0};
    struct replay_trace merged;
    int err = run->kind->make_inputs(run->trace, run->test, &list);
    if (!err)
        err = replay_trace_merge(&merged, run->trace, run->test, &list);
    if (err) {
        free(list.events);
        return hm2_diag_add(diag, err, "No memory for the inputs of test %s.", run->test->name);
    }
    const struct replay_test test = {
        .name = run->test->name, .description = run->test->description, .count = list.count};
    run->trace = &merged;
    run->test = &test;
    err = replay_play(run, diag);
    run->trace = NULL;
    run->test = NULL;
    free(list.events);
    return err;
}

/* From one possible start after the other until one matches; if none does, the difference is that from power-up. */
static int play_test(struct replay_run *const run, const struct replay_kind *const kind,
                     const struct replay_trace *const trace, const struct replay_test *const test,
                     struct hm2_diag *const diag)
{
    char first[REPLAY_TEXT] = "";
    for (unsigned start = 0; start == 0 || start < kind->starts; start++) {
        memset(run, 0, sizeof(*run));
        run->kind = kind;
        run->trace = trace;
        run->test = test;
        run->start = start;
        const int err = kind->make_inputs ? play_completed(run, diag) : replay_play(run, diag);
        if (err || !run->difference[0])
            return err;
        if (start == 0)
            memcpy(first, run->difference, sizeof first);
    }
    memcpy(run->difference, first, sizeof first);
    return 0;
}

static int play_trace(const struct replay_kind *const kind, const struct replay_trace *const trace,
                      const struct replay_options *const options, struct replay_totals *const totals,
                      struct hm2_diag *const diag)
{
    struct replay_run *const run = malloc(sizeof(*run));
    if (!run)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "No memory for a replay.");
    int err = 0;
    for (size_t i = 0; i < trace->test_count && !err; i++) {
        const struct replay_test *const test = &trace->tests[i];
        if (!replay_wanted(options, test->name))
            continue;
        err = play_test(run, kind, trace, test, diag);
        if (!err)
            replay_report(options, totals, test->name, run->difference);
    }
    free(run);
    return err;
}

static int load(const struct replay_files *const files, const char *const name, char **const text, size_t *const len,
                struct hm2_diag *const diag)
{
    const int err = files->load(files->context, name, text, len, diag);
    return err == HM2_ERR_NOTFOUND ? hm2_diag_add(diag, err, "There is no %s in the folder.", name) : err;
}

static int play_folder(const struct replay_kind *const kind, const struct replay_files *const files,
                       const struct replay_options *const options, struct replay_totals *const totals,
                       struct hm2_diag *const diag)
{
    char *tests = NULL, *events = NULL;
    size_t tests_len = 0, events_len = 0;
    struct replay_trace trace;
    int err = files->load(files->context, "scenarios.csv", &tests, &tests_len, diag);
    if (err == HM2_ERR_NOTFOUND)
        err = load(files, "tests.csv", &tests, &tests_len, diag);
    if (!err)
        err = load(files, "events.csv", &events, &events_len, diag);
    if (!err)
        err = replay_trace_parse(&trace, tests, tests_len, events, events_len, diag);
    if (!err) {
        err = play_trace(kind, &trace, options, totals, diag);
        replay_trace_free(&trace);
    }
    free(tests);
    free(events);
    return err;
}

int replay_folder(const char *const folder, const struct replay_files *const files,
                  const struct replay_options *const options, struct replay_totals *const totals,
                  struct hm2_diag *const diag)
{
    const struct replay_kind *const kind = find_kind(folder);
    if (!kind)
        return unknown_kind(folder, diag);
    const int err = kind->no_events ? 0 : play_folder(kind, files, options, totals, diag);
    if (err || !kind->extra)
        return err;
    return kind->extra(kind, files, options, totals, diag);
}
