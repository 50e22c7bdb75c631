/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A file of the flight recorder in memory, and the ways of showing it. */
#ifndef TRACE_H
#define TRACE_H

#include <stdio.h>

#include <hm2/flight.h>

struct trace {
    struct hm2_flight_head head;
    struct hm2_flight_cycle *cycles;
    size_t count;
};

/* Parts of a cycle; a cycle without one of them does not count in its statistics. */
enum trace_part {
    PART_LATE,   /* start behind the start of the cycle before, less the period; early ones count as 0 */
    PART_SEND,   /* start to request sent */
    PART_REPLY,  /* request sent to reply received */
    PART_DECODE, /* reply received to pins up to date */
    PART_WRITE,  /* write function */
    PART_TOTAL,  /* start to the end of whatever came last */
    TRACE_PARTS
};

extern const char *const trace_part_names[TRACE_PARTS];

/* ns of a part of cycle `index`, or -1 when it has none. */
int64_t trace_part_ns(const struct trace *trace, size_t index, enum trace_part part);
const char *trace_flags(const struct hm2_flight_cycle *cycle); /* "lost", "slow", ... or "" */

void print_table(FILE *out, const struct trace *trace);
/* Median, 99 %, 99.9 % and largest of every part. Zero, or -1 without memory. */
int print_summary(FILE *out, const struct trace *trace);
int print_json(FILE *out, const struct trace *trace);
void print_svg(FILE *out, const struct trace *trace);
/* Chrome's trace event format, which Perfetto reads too. */
void print_perfetto(FILE *out, const struct trace *trace);

#endif
