/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Pictures: an SVG, and events for Chrome's trace viewer and Perfetto. */
#include "trace.h"

#include <inttypes.h>

#define WIDTH  1200.0
#define HEIGHT 360.0
#define MARGIN 50.0
#define US     1e-3

/* ---- SVG ----------------------------------------------------------------------------------------------------------
 */

struct scale {
    double x, y; /* pixels a cycle, pixels a ns */
    int64_t top_ns;
};

static int64_t longest(const struct trace *const trace)
{
    int64_t top = trace->head.period_ns > 0 ? trace->head.period_ns : 1;
    for (size_t i = 0; i < trace->count; i++) {
        const int64_t ns = trace_part_ns(trace, i, PART_TOTAL);
        top = ns > top ? ns : top;
    }
    return top;
}

/* From the bottom, so that bars of one cycle stand in front of one another, the longest behind. */
static void bar(FILE *const out, const struct scale *const scale, const size_t cycle, const uint32_t ns,
                const char *const colour)
{
    const double height = (double)ns * scale->y;
    if (ns > 0)
        fprintf(out, "<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\" fill=\"%s\"/>\n",
                MARGIN + (double)cycle * scale->x, MARGIN + HEIGHT - height, scale->x < 1 ? 1 : scale->x, height,
                colour);
}

static void line(FILE *const out, const struct scale *const scale, const int64_t ns, const char *const text)
{
    const double y = MARGIN + HEIGHT - (double)ns * scale->y;
    fprintf(out,
            "<line x1=\"%.0f\" y1=\"%.2f\" x2=\"%.0f\" y2=\"%.2f\" stroke=\"#888\" stroke-dasharray=\"4 3\"/>\n"
            "<text x=\"%.0f\" y=\"%.2f\">%.0f us%s</text>\n",
            MARGIN, y, MARGIN + WIDTH, y, MARGIN + 4, y - 3, (double)ns * US, text);
}

void print_svg(FILE *const out, const struct trace *const trace)
{
    struct scale scale = {.top_ns = longest(trace)};
    scale.x = WIDTH / (double)(trace->count > 0 ? trace->count : 1);
    scale.y = HEIGHT / (double)scale.top_ns;
    fprintf(out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" font-family=\"sans-serif\" "
            "font-size=\"12\">\n<title>Times of %zu cycles</title>\n<rect width=\"100%%\" height=\"100%%\" "
            "fill=\"white\"/>\n",
            WIDTH + 2 * MARGIN, HEIGHT + 2 * MARGIN, trace->count);
    for (size_t i = 0; i < trace->count; i++) {
        const struct hm2_flight_cycle *const c = &trace->cycles[i];
        bar(out, &scale, i, c->written_ns, "#c5cdd8");
        bar(out, &scale, i, c->decoded_ns, c->flags & HM2_FLIGHT_LOST ? "#d33" : "#7d9cc4");
        bar(out, &scale, i, c->received_ns, "#2f5d9b");
    }
    line(out, &scale, trace->head.period_ns, " (period)");
    line(out, &scale, scale.top_ns / 2, "");
    fprintf(out,
            "<text x=\"%.0f\" y=\"20\">dark: until the reply was here, blue: until pins were up to date, grey: until "
            "the write was sent, red: no reply</text>\n"
            "<text x=\"%.0f\" y=\"%.0f\">cycle %" PRIu32 "</text>\n"
            "<text x=\"%.0f\" y=\"%.0f\" text-anchor=\"end\">%" PRIu32 "</text>\n</svg>\n",
            MARGIN, MARGIN, HEIGHT + MARGIN + 20, trace->count > 0 ? trace->cycles[0].number : 0, MARGIN + WIDTH,
            HEIGHT + MARGIN + 20, trace->count > 0 ? trace->cycles[trace->count - 1].number : 0);
}

/* ---- trace events -------------------------------------------------------------------------------------------------
 */

static void event(FILE *const out, const char *const name, const int64_t start_ns, const uint32_t from_ns,
                  const int64_t length_ns, const uint32_t cycle)
{
    if (length_ns < 0)
        return;
    fprintf(out,
            ",\n{\"name\":\"%s\",\"ph\":\"X\",\"pid\":1,\"tid\":1,\"ts\":%.3f,\"dur\":%.3f,\"args\":{\"cycle\":%" PRIu32
            "}}",
            name, (double)(start_ns + from_ns) * US, (double)length_ns * US, cycle);
}

void print_perfetto(FILE *const out, const struct trace *const trace)
{
    fprintf(out, "{\"displayTimeUnit\":\"ns\",\"traceEvents\":[\n"
                 "{\"name\":\"process_name\",\"ph\":\"M\",\"pid\":1,\"args\":{\"name\":\"hm2_lbp16\"}}");
    const int64_t origin_ns = trace->count > 0 ? trace->cycles[0].start_ns : 0;
    for (size_t i = 0; i < trace->count; i++) {
        const struct hm2_flight_cycle *const c = &trace->cycles[i];
        const int64_t start_ns = c->start_ns - origin_ns;
        event(out, c->flags & HM2_FLIGHT_LOST ? "cycle, lost" : "cycle", start_ns, 0,
              trace_part_ns(trace, i, PART_TOTAL), c->number);
        event(out, "send", start_ns, 0, trace_part_ns(trace, i, PART_SEND), c->number);
        event(out, "reply", start_ns, c->sent_ns, trace_part_ns(trace, i, PART_REPLY), c->number);
        event(out, "decode", start_ns, c->received_ns, trace_part_ns(trace, i, PART_DECODE), c->number);
        event(out, "write", start_ns, c->write_ns, trace_part_ns(trace, i, PART_WRITE), c->number);
    }
    fprintf(out, "\n]}\n");
}
