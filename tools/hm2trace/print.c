/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Tables and statistics, for people and for scripts. */
#include "../common/json_string.h"
#include "trace.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdlib.h>

#define US 1e-3

static void print_us(FILE *const out, const int64_t ns)
{
    if (ns < 0)
        fprintf(out, "\t-");
    else
        fprintf(out, "\t%.1f", (double)ns * US);
}

void print_table(FILE *const out, const struct trace *const trace)
{
    fprintf(out, "cycle\tstart_us");
    for (unsigned part = 0; part < TRACE_PARTS; part++)
        fprintf(out, "\t%s_us", trace_part_names[part]);
    fprintf(out, "\trequest\treply\twrite\tbad\tflag\n");
    for (size_t i = 0; i < trace->count; i++) {
        const struct hm2_flight_cycle *const c = &trace->cycles[i];
        fprintf(out, "%" PRIu32 "\t%.1f", c->number, (double)(c->start_ns - trace->cycles[0].start_ns) * US);
        for (unsigned part = 0; part < TRACE_PARTS; part++)
            print_us(out, trace_part_ns(trace, i, (enum trace_part)part));
        fprintf(out, "\t%u\t%u\t%u\t%u\t%s%s\n", c->request_bytes, c->reply_bytes, c->write_bytes, c->bad_datagrams,
                trace_flags(c), c->number == trace->head.cause_cycle ? "*" : "");
    }
}

/* ---- statistics ---------------------------------------------------------------------------------------------------
 */

struct statistics {
    size_t count;
    int64_t median, most, nearly_all, max; /* 50 %, 99 %, 99.9 %, 100 % are not longer */
};

static int compare(const void *const a, const void *const b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static int64_t quantile(const int64_t *const sorted, const size_t count, const size_t per_mille)
{
    const size_t rank = (count * per_mille + 999) / 1000;
    return sorted[rank == 0 ? 0 : rank - 1];
}

static struct statistics judge(const struct trace *const trace, const enum trace_part part, int64_t *const scratch)
{
    struct statistics s = {0};
    for (size_t i = 0; i < trace->count; i++) {
        const int64_t ns = trace_part_ns(trace, i, part);
        if (ns >= 0)
            scratch[s.count++] = ns;
    }
    if (s.count == 0)
        return s;
    qsort(scratch, s.count, sizeof *scratch, compare);
    s.median = quantile(scratch, s.count, 500);
    s.most = quantile(scratch, s.count, 990);
    s.nearly_all = quantile(scratch, s.count, 999);
    s.max = scratch[s.count - 1];
    return s;
}

static size_t lost(const struct trace *const trace)
{
    size_t count = 0;
    for (size_t i = 0; i < trace->count; i++)
        count += (trace->cycles[i].flags & HM2_FLIGHT_LOST) != 0;
    return count;
}

static int with_statistics(FILE *const out, const struct trace *const trace,
                           void (*const print)(FILE *out, const char *name, const struct statistics *s, bool first))
{
    int64_t *const scratch = malloc((trace->count + 1) * sizeof *scratch);
    if (!scratch)
        return -1;
    for (unsigned part = 0; part < TRACE_PARTS; part++) {
        const struct statistics s = judge(trace, (enum trace_part)part, scratch);
        print(out, trace_part_names[part], &s, part == 0);
    }
    free(scratch);
    return 0;
}

static void summary_row(FILE *const out, const char *const name, const struct statistics *const s, const bool first)
{
    if (first)
        fprintf(out, "part\tcycles\tmedian_us\t99%%_us\t99.9%%_us\tmax_us\n");
    fprintf(out, "%s\t%zu\t%.1f\t%.1f\t%.1f\t%.1f\n", name, s->count, (double)s->median * US, (double)s->most * US,
            (double)s->nearly_all * US, (double)s->max * US);
}

int print_summary(FILE *const out, const struct trace *const trace)
{
    fprintf(out, "%s: %zu cycles of %.0f us, stopped for %s (cycle %" PRIu32 "), %zu lost\n", trace->head.card,
            trace->count, (double)trace->head.period_ns * US, hm2_flight_cause_name(trace->head.cause),
            trace->head.cause_cycle, lost(trace));
    return with_statistics(out, trace, summary_row);
}

static void json_part(FILE *const out, const char *const name, const struct statistics *const s, const bool first)
{
    fprintf(out,
            "%s\n    \"%s\": {\"cycles\": %zu, \"median_ns\": %" PRId64 ", \"p99_ns\": %" PRId64
            ", \"p999_ns\": %" PRId64 ", \"max_ns\": %" PRId64 "}",
            first ? "" : ",", name, s->count, s->median, s->most, s->nearly_all, s->max);
}

int print_json(FILE *const out, const struct trace *const trace)
{
    fprintf(out, "{\n  \"card\": ");
    json_string(out, trace->head.card);
    fprintf(out,
            ",\n  \"period_ns\": %" PRId64 ",\n  \"cause\": \"%s\",\n  \"cause_cycle\": %" PRIu32
            ",\n  \"cycles\": %zu,\n  \"lost\": %zu,\n  \"parts\": {",
            trace->head.period_ns, hm2_flight_cause_name(trace->head.cause), trace->head.cause_cycle, trace->count,
            lost(trace));
    const int err = with_statistics(out, trace, json_part);
    fprintf(out, "\n  }\n}\n");
    return err;
}
