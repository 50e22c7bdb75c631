/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2doctor: looks at this computer and the way to the card, and says what to change. */
#include <arpa/inet.h>
#include <errno.h>
#include <getopt.h>
#include <stdlib.h>
#include <string.h>

#include "../common/json_string.h"
#include "command.h"
#include "doctor.h"

enum { EXIT_FOUND = 1, EXIT_USAGE = 2, EXIT_FILE = 3 };
enum {
    OPT_CARD = 256,
    OPT_INTERFACE,
    OPT_PERIOD,
    OPT_SECONDS,
    OPT_REPLY,
    OPT_STATE,
    OPT_ROUNDS,
    OPT_SAVE,
    OPT_HISTOGRAM,
    OPT_JSON,
    OPT_APPLY,
    OPT_VERSION
};

#define DEFAULT_CARD    "192.168.1.121"
#define DEFAULT_REPLY   160 /* what a 7I96S with its usual modules answers in a cycle, about */
#define MAX_PERIOD_US   100000
#define MIN_PERIOD_US   50
#define MAX_SECONDS     3600
#define MAX_REPLY_BYTES 1440

static const struct option long_options[] = {
    {"card", required_argument, NULL, OPT_CARD},
    {"interface", required_argument, NULL, OPT_INTERFACE},
    {"period", required_argument, NULL, OPT_PERIOD},
    {"seconds", required_argument, NULL, OPT_SECONDS},
    {"reply-bytes", required_argument, NULL, OPT_REPLY},
    {"state", required_argument, NULL, OPT_STATE},
    {"rounds", required_argument, NULL, OPT_ROUNDS},
    {"save", required_argument, NULL, OPT_SAVE},
    {"histogram", required_argument, NULL, OPT_HISTOGRAM},
    {"json", no_argument, NULL, OPT_JSON},
    {"apply", no_argument, NULL, OPT_APPLY},
    {"help", no_argument, NULL, 'h'},
    {"version", no_argument, NULL, OPT_VERSION},
    {NULL, 0, NULL, 0},
};

static const char help[] =
    "Usage: hm2doctor [OPTION]...\n"
    "Look at this computer and the way to a card, and say what costs cycles and what to do about it.\n"
    "Nothing is changed without --apply.\n"
    "  --card ADDRESS[:PORT]  the card (" DEFAULT_CARD ")\n"
    "  --interface NAME       the network port with its cable (from the routes)\n"
    "  --period MICROSECONDS  the servo period (1000)\n"
    "  --seconds N            measure so long; 0 = do not speak to the card (5)\n"
    "  --reply-bytes N        length of the replies measured (160)\n"
    "  --histogram FILE       draw the round trips as SVG\n"
    "  --json                 print one object\n"
    "  --apply                run the remedies that take effect at once and end with a restart\n"
    "  --save FOLDER          keep what was looked at and measured\n"
    "  --state FOLDER         look at what was kept, not at this computer\n"
    "  --rounds FILE          judge round trips from a file (FOLDER/rounds)\n"
    "  -h, --help, --version\n"
    "Exit status: 0 = nothing to do, 1 = something was found, 2 = wrong command line, 3 = a file could not be used.\n";

struct request {
    const char *card, *interface, *state, *rounds, *save, *histogram;
    long period_us, seconds, reply_bytes;
    bool json, apply;
};

/* ---- the command line ---------------------------------------------------------------------------------------------
 */

static bool number(const char *const option, const char *const text, const long min, const long max, long *const value)
{
    char *end;
    errno = 0;
    *value = strtol(text, &end, 10);
    if (end != text && *end == '\0' && errno == 0 && *value >= min && *value <= max)
        return true;
    fprintf(stderr, "hm2doctor: --%s \"%s\": expected a number from %ld to %ld\n", option, text, min, max);
    return false;
}

/* It becomes part of paths and of commands. */
static bool good_interface(const char *const name)
{
    static const char allowed[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
    const size_t len = strlen(name);
    return len > 0 && len < INTERFACE_BYTES && name[0] != '.' && name[0] != '-' && strspn(name, allowed) == len;
}

static bool take(struct request *const request, const int option)
{
    switch (option) {
    case OPT_CARD:
        request->card = optarg;
        return true;
    case OPT_INTERFACE:
        request->interface = optarg;
        if (!good_interface(optarg))
            fprintf(stderr,
                    "hm2doctor: --interface \"%s\": expected the name of a network port, as \"ip link\" lists it\n",
                    optarg);
        return good_interface(optarg);
    case OPT_PERIOD:
        return number("period", optarg, MIN_PERIOD_US, MAX_PERIOD_US, &request->period_us);
    case OPT_SECONDS:
        return number("seconds", optarg, 0, MAX_SECONDS, &request->seconds);
    case OPT_REPLY:
        return number("reply-bytes", optarg, 4, MAX_REPLY_BYTES, &request->reply_bytes);
    case OPT_STATE:
        request->state = optarg;
        return true;
    case OPT_ROUNDS:
        request->rounds = optarg;
        return true;
    case OPT_SAVE:
        request->save = optarg;
        return true;
    case OPT_HISTOGRAM:
        request->histogram = optarg;
        return true;
    case OPT_JSON:
        request->json = true;
        return true;
    case OPT_APPLY:
        request->apply = true;
        return true;
    default:
        return false;
    }
}

static bool card_address(const char *const text, uint32_t *const address)
{
    char host[INET_ADDRSTRLEN];
    struct in_addr parsed;
    const size_t len = strcspn(text, ":");
    if (len < sizeof host) {
        memcpy(host, text, len);
        host[len] = '\0';
    }
    if (len >= sizeof host || inet_pton(AF_INET, host, &parsed) != 1) {
        fprintf(stderr, "hm2doctor: --card \"%s\": expected an IPv4 address such as " DEFAULT_CARD "\n", text);
        return false;
    }
    *address = ntohl(parsed.s_addr);
    return true;
}

static bool sensible(const struct request *const request)
{
    if (!request->apply || !request->state)
        return true;
    fprintf(stderr, "hm2doctor: --apply changes this computer, --state looks at another; give one of them\n");
    return false;
}

/* ---- results ------------------------------------------------------------------------------------------------------
 */

static const char *const grade_names[] = {"ok", "unknown", "advice", "fault"};

static void print_json(const struct findings *const findings, const struct rounds *const rounds)
{
    printf("{\"findings\":[");
    for (unsigned i = 0; i < findings->count; i++) {
        const struct finding *const f = &findings->list[i];
        printf("%s\n{\"check\":\"%s\",\"grade\":\"%s\",\"what\":", i ? "," : "", f->check, grade_names[f->grade]);
        json_string(stdout, f->what);
        printf(",\"remedy\":");
        json_string(stdout, f->remedy);
        printf(",\"at_once\":%s}", f->at_once ? "true" : "false");
    }
    printf("]");
    if (rounds->paced > 0)
        printf(
            ",\n\"round_trip_us\":{\"count\":%zu,\"lost\":%zu,\"p50\":%.1f,\"p99\":%.1f,\"p99_9\":%.1f,\"max\":%.1f}",
            rounds->paced, rounds->lost, (double)rounds_percentile(rounds->paced_ns, rounds->paced, 50) / 1e3,
            (double)rounds_percentile(rounds->paced_ns, rounds->paced, 99) / 1e3,
            (double)rounds_percentile(rounds->paced_ns, rounds->paced, 99.9) / 1e3,
            (double)rounds->paced_ns[rounds->paced - 1] / 1e3);
    printf("}\n");
}

static void print_lines(const struct findings *const findings)
{
    for (unsigned i = 0; i < findings->count; i++) {
        const struct finding *const f = &findings->list[i];
        printf("%-8s%-12s%s", grade_names[f->grade], f->check, f->what);
        printf(f->remedy[0] ? ": %s\n" : "\n", f->remedy);
    }
}

static unsigned to_do(const struct findings *const findings)
{
    unsigned count = 0;
    for (unsigned i = 0; i < findings->count; i++)
        count += findings->list[i].grade >= GRADE_ADVICE;
    return count;
}

/* False when one failed. */
static bool apply(const struct findings *const findings)
{
    bool good = true;
    for (unsigned i = 0; i < findings->count; i++) {
        const struct finding *const f = &findings->list[i];
        if (f->grade < GRADE_ADVICE || !f->at_once)
            continue;
        fprintf(stderr, "hm2doctor: %s\n", f->remedy);
        const int status = command_run(f->remedy, NULL, 0);
        if (status != 0)
            fprintf(stderr, "hm2doctor: that failed (status %d); it needs root\n", status);
        good = good && status == 0;
    }
    return good;
}

/* ---- the visit ----------------------------------------------------------------------------------------------------
 */

static bool get_rounds(const struct request *const request, struct rounds *const rounds)
{
    struct hm2_diag diag = {0};
    int err = 0;
    if (request->rounds)
        err = rounds_read(request->rounds, rounds, &diag);
    else if (!request->state && request->seconds > 0)
        err = rounds_measure(&(struct measuring){.card = request->card,
                                                 .period_us = request->period_us,
                                                 .seconds = request->seconds,
                                                 .reply_bytes = (unsigned)request->reply_bytes},
                             rounds, &diag);
    if (err)
        fprintf(stderr, "hm2doctor: %s", diag.text);
    return err == 0;
}

static bool draw(const char *const path, const struct rounds *const rounds, const long period_us)
{
    FILE *const out = fopen(path, "w");
    if (out)
        draw_rounds(out, rounds, period_us);
    if (out && fclose(out) == 0)
        return true;
    fprintf(stderr, "hm2doctor: %s cannot be written: %s\n", path, strerror(errno));
    return false;
}

static bool keep(const struct request *const request, const struct state *const state,
                 const struct rounds *const rounds)
{
    char path[4096];
    bool good = !state->save_failed;
    if (request->save && rounds->paced + rounds->lost > 0) {
        const int len = snprintf(path, sizeof path, "%s/rounds", request->save);
        good = good && len > 0 && (size_t)len < sizeof path && rounds_write(path, rounds);
    }
    if (!good)
        fprintf(stderr, "hm2doctor: not all could be kept in %s\n", request->save);
    return good;
}

static int visit(const struct request *const request)
{
    static struct findings findings;
    struct state state = {.folder = request->state, .save = request->save};
    struct patient patient = {.state = &state, .period_us = request->period_us, .findings = &findings};
    struct rounds rounds = {.paced = 0};
    if (!card_address(request->card, &patient.card))
        return EXIT_USAGE;
    look_at_routes(&patient);
    if (request->interface)
        snprintf(patient.interface, sizeof patient.interface, "%s", request->interface);
    else if (find_interface(&patient) && !good_interface(patient.interface))
        patient.interface[0] = '\0';
    check_computer(&patient);
    check_interface(&patient);
    check_way(&patient);
    bool good = get_rounds(request, &rounds) && keep(request, &state, &rounds);
    const bool measured = request->rounds || (!request->state && request->seconds > 0);
    if (good && measured) {
        rounds_sort(&rounds);
        check_rounds(&patient, &rounds);
        good = !request->histogram || draw(request->histogram, &rounds, request->period_us);
    }
    if (request->json)
        print_json(&findings, &rounds);
    else
        print_lines(&findings);
    if (good && request->apply)
        good = apply(&findings);
    rounds_free(&rounds);
    if (!good || fflush(stdout) != 0)
        return EXIT_FILE;
    return to_do(&findings) > 0 ? EXIT_FOUND : 0;
}

int main(const int argc, char *const argv[])
{
    struct request request = {.card = DEFAULT_CARD, .period_us = 1000, .seconds = 5, .reply_bytes = DEFAULT_REPLY};
    int option;
    while ((option = getopt_long(argc, argv, "h", long_options, NULL)) != -1) {
        if (option == 'h') {
            fputs(help, stdout);
            return 0;
        }
        if (option == OPT_VERSION) {
            puts("hm2doctor " HM2_VERSION);
            return 0;
        }
        if (!take(&request, option))
            return EXIT_USAGE;
    }
    if (optind != argc) {
        fprintf(stderr, "hm2doctor: \"%s\": no argument expected; hm2doctor --help explains\n", argv[optind]);
        return EXIT_USAGE;
    }
    return sensible(&request) ? visit(&request) : EXIT_USAGE;
}
