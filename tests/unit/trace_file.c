/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "trace_file.h"

#include "idrom_files.h"
#include "unit.h"

struct trace_file trace_load(const char *const folder)
{
    char path[512];
    size_t len;
    (void)snprintf(path, sizeof path, "%s/%s/events.csv", TEST_DATA, folder);
    char *const text = load_text(path, &len);
    struct trace_file trace = {0};
    size_t lines = 0;
    for (const char *at = text; *at; at++)
        lines += *at == '\n';
    trace.events = calloc(lines + 1, sizeof *trace.events);
    assert_non_null(trace.events);
    for (char *rest = text, *line; (line = strsep(&rest, "\n"));) {
        struct trace_event *const event = &trace.events[trace.count];
        if (sscanf(line, "%39[^,],%ld,%c,%23[^,],%63s", event->test, &event->clk, &event->kind, event->name,
                   event->text) != 5)
            continue; /* the header */
        event->value = (uint32_t)strtoul(event->text, NULL, 16);
        trace.count++;
    }
    free(text);
    assert_true(trace.count > 0);
    return trace;
}

void trace_free(struct trace_file *const trace)
{
    free(trace->events);
    *trace = (struct trace_file){0};
}

const struct trace_event *trace_next(const struct trace_file *const trace, size_t *const index, const char *const test)
{
    while (*index < trace->count) {
        const struct trace_event *const event = &trace->events[(*index)++];
        if (!test || strcmp(event->test, test) == 0)
            return event;
    }
    return NULL;
}

bool trace_is(const struct trace_event *const event, const char kind, const char *const name)
{
    return event->kind == kind && strcmp(event->name, name) == 0;
}

const struct trace_event *trace_find(const struct trace_file *const trace, size_t *const index, const char *const test,
                                     const char kind, const char *const name)
{
    const struct trace_event *event;
    while ((event = trace_next(trace, index, test)) != NULL)
        if (trace_is(event, kind, name))
            return event;
    return NULL;
}
