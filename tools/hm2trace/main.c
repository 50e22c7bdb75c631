/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2trace: what the flight recorder of hm2_lbp16 wrote down about the last cycles. */
#include <errno.h>
#include <getopt.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "../common/whole_file.h"
#include "trace.h"

enum { EXIT_FILE = 1, EXIT_USAGE = 2 };

#define MAX_FILE_BYTES (64u << 20)
#define MIN_LINE_BYTES 24u /* twelve numbers of one digit, with what separates them */

enum { OPT_SVG = 256, OPT_PERFETTO, OPT_JSON, OPT_TABLE, OPT_VERSION };

static const struct option long_options[] = {
    {"help", no_argument, NULL, 'h'},
    {"json", no_argument, NULL, OPT_JSON},
    {"svg", required_argument, NULL, OPT_SVG},
    {"perfetto", required_argument, NULL, OPT_PERFETTO},
    {"table", no_argument, NULL, OPT_TABLE},
    {"version", no_argument, NULL, OPT_VERSION},
    {NULL, 0, NULL, 0},
};

static const char help[] = "Usage: hm2trace [OPTION]... FILE\n"
                           "Show a file of the flight recorder of hm2_lbp16: how long the parts of its cycles took.\n"
                           "  --table           every cycle, with tabs between the columns\n"
                           "  --json            the summary as JSON\n"
                           "  --svg FILE        draw the cycles\n"
                           "  --perfetto FILE   events for Perfetto and Chrome's trace viewer\n"
                           "  -h, --help        this text\n"
                           "  --version         the version\n";

static void take(void *const context, const struct hm2_flight_cycle *const cycle)
{
    struct trace *const trace = context;
    trace->cycles[trace->count++] = *cycle;
}

static bool read_trace(const char *const path, struct trace *const trace)
{
    size_t len = 0;
    struct hm2_diag diag = {0};
    char *const text = whole_file(path, MAX_FILE_BYTES, &len);
    if (!text)
        fprintf(stderr, "hm2trace: %s: %s\n", path, strerror(errno));
    trace->cycles = text ? malloc((len / MIN_LINE_BYTES + 1) * sizeof *trace->cycles) : NULL;
    const int err = trace->cycles ? hm2_flight_parse(text, len, &trace->head, take, trace, &diag) : HM2_ERR_NOMEM;
    if (text && err < 0)
        fprintf(stderr, "hm2trace: %s: %s", path, trace->cycles ? diag.text : "no memory\n");
    free(text);
    return err == 0;
}

static bool draw(const char *const path, const struct trace *const trace,
                 void (*const print)(FILE *out, const struct trace *trace))
{
    FILE *const out = path ? fopen(path, "w") : NULL;
    if (!path)
        return true;
    if (out)
        print(out, trace);
    if (!out || fclose(out) != 0) {
        fprintf(stderr, "hm2trace: %s cannot be written: %s\n", path, strerror(errno));
        return false;
    }
    return true;
}

struct request {
    const char *svg, *perfetto;
    bool table, json;
};

static int show(const char *const path, const struct request *const request)
{
    struct trace trace = {.count = 0};
    bool good = read_trace(path, &trace);
    if (good && request->table)
        print_table(stdout, &trace);
    else if (good)
        good = (request->json ? print_json : print_summary)(stdout, &trace) == 0;
    good = good && draw(request->svg, &trace, print_svg) && draw(request->perfetto, &trace, print_perfetto);
    free(trace.cycles);
    return good && fflush(stdout) == 0 ? 0 : EXIT_FILE;
}

int main(const int argc, char *const argv[])
{
    struct request request = {.svg = NULL};
    int option;
    while ((option = getopt_long(argc, argv, "h", long_options, NULL)) != -1) {
        switch (option) {
        case 'h':
            fputs(help, stdout);
            return 0;
        case OPT_VERSION:
            puts("hm2trace " HM2_VERSION);
            return 0;
        case OPT_TABLE:
            request.table = true;
            break;
        case OPT_JSON:
            request.json = true;
            break;
        case OPT_SVG:
            request.svg = optarg;
            break;
        case OPT_PERFETTO:
            request.perfetto = optarg;
            break;
        default:
            return EXIT_USAGE;
        }
    }
    if (optind + 1 != argc || (request.table && request.json)) {
        fprintf(stderr, "hm2trace: one FILE expected, and not both --table and --json; hm2trace --help explains\n");
        return EXIT_USAGE;
    }
    return show(argv[optind], &request);
}
