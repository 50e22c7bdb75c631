/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Register events of the recorded firmware traces (tests/data/NAME/events.csv). */
#ifndef TRACE_FILE_H
#define TRACE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct trace_event {
    char test[40];
    long clk;  /* index of the rising ClockLow edge */
    char kind; /* W, R, E, I, N */
    char name[24];
    char text[64];  /* value as written */
    uint32_t value; /* the same as hexadecimal number, without a mask */
};

struct trace_file {
    struct trace_event *events;
    size_t count;
};

/* Fails the running test when the file is missing or empty. */
struct trace_file trace_load(const char *folder);
void trace_free(struct trace_file *trace);
/* First event of a test with this kind and name, from index on; NULL when there is none. */
const struct trace_event *trace_find(const struct trace_file *trace, size_t *index, const char *test, char kind,
                                     const char *name);
/* Next event of a test (NULL: of any) from index on; NULL at the end. */
const struct trace_event *trace_next(const struct trace_file *trace, size_t *index, const char *test);
bool trace_is(const struct trace_event *event, char kind, const char *name);

#endif
