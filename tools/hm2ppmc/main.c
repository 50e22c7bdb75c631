/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2ppmc: look at Pico Systems PPMC boards on an EPP bus. */
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <hm2/ppmc.h>

#define NS_PER_MS    1000000L
#define MAX_PERIOD_S 10
#define EXIT_USAGE   2
#define REGISTERS    32u

struct request {
    const char *bus;
    bool reverse, verify;
    unsigned long period_ms, samples; /* samples: 0 = until a signal */
    int argc;
    char **argv; /* behind the command */
};

static volatile sig_atomic_t stopped;

static void stop(const int signal)
{
    (void)signal;
    stopped = 1;
}

static int complain(const struct hm2_diag *const diag)
{
    fputs(diag->text, stderr);
    return EXIT_FAILURE;
}

static int usage_error(const char *const what, const char *const found)
{
    fprintf(stderr, "hm2ppmc: %s%s%s; see --help\n", what, found ? " " : "", found ? found : "");
    return EXIT_USAGE;
}

static bool number(const char *const text, const unsigned long max, unsigned long *const value)
{
    char *end;
    if (*text < '0' || *text > '9')
        return false;
    *value = strtoul(text, &end, 0);
    return *end == '\0' && *value <= max;
}

/* ---- commands ---------------------------------------------------------------------------------------------------- */

static void print_board(const unsigned slot, const struct ppmc_board_info *const info)
{
    printf("slot %2u  address 0x%02X-0x%02X  ID 0x%02X  %s", slot, slot * 16, (slot + info->slots) * 16 - 1, info->id,
           info->name);
    if (info->encoders)
        printf(", %u encoders%s%s%s", info->encoders, info->index ? ", index" : "", info->filter ? ", filter rate" : "",
               info->timestamps ? ", timestamps" : "");
    putchar('\n');
}

static int scan(struct epp *const epp, const struct request *const request, struct hm2_diag *const diag)
{
    struct ppmc_board_info boards[PPMC_SLOTS];
    unsigned count = 0;
    (void)request;
    const int err = ppmc_scan(epp, boards, diag);
    for (unsigned slot = 0; slot < PPMC_SLOTS; slot++) {
        if (boards[slot].id == 0)
            continue;
        print_board(slot, &boards[slot]);
        count++;
    }
    if (err)
        return complain(diag);
    printf("%u board%s\n", count, count == 1 ? "" : "s");
    return count > 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}

static int identify(struct epp *const epp, const struct request *const request, struct hm2_diag *const diag)
{
    struct ppmc_board_info boards[PPMC_SLOTS];
    unsigned long slot;
    if (request->argc != 1 || !number(request->argv[0], PPMC_SLOTS - 1, &slot))
        return usage_error("identify needs a slot, 0 to 15", NULL);
    if (ppmc_scan(epp, boards, diag) == HM2_ERR_IO)
        return complain(diag);
    if (boards[slot].id == 0) {
        fprintf(stderr, "%sSlot %lu: no board answers.\n", diag->text, slot);
        return EXIT_FAILURE;
    }
    print_board((unsigned)slot, &boards[slot]);
    return EXIT_SUCCESS;
}

static int read_registers(struct epp *const epp, const struct request *const request, struct hm2_diag *const diag)
{
    unsigned long slot, offset = 0, count = 16;
    uint8_t bytes[REGISTERS];
    if (request->argc < 1 || request->argc > 3 || !number(request->argv[0], PPMC_SLOTS - 1, &slot) ||
        (request->argc > 1 && !number(request->argv[1], REGISTERS - 1, &offset)) ||
        (request->argc > 2 && !number(request->argv[2], REGISTERS, &count)))
        return usage_error("read needs a slot and, if you like, an offset and a count", NULL);
    if (request->argc == 2)
        count = 1;
    if (ppmc_read_registers(epp, (unsigned)slot, (unsigned)offset, bytes, (unsigned)count, diag))
        return complain(diag);
    for (unsigned long i = 0; i < count; i++)
        printf("0x%02lX %02X\n", offset + i, bytes[i]);
    return EXIT_SUCCESS;
}

static int set_filter(struct epp *const epp, const struct request *const request, struct hm2_diag *const diag)
{
    static const char *const names[PPMC_FILTERS] = {"1", "2.5", "5", "10"};
    unsigned long slot;
    unsigned filter = 0;
    if (request->argc != 2 || !number(request->argv[0], PPMC_SLOTS - 1, &slot))
        return usage_error("filter needs a slot and a rate: 1, 2.5, 5 or 10", NULL);
    while (filter < PPMC_FILTERS && strcmp(names[filter], request->argv[1]) != 0)
        filter++;
    if (filter == PPMC_FILTERS)
        return usage_error("rates are 1, 2.5, 5 and 10 MHz, not", request->argv[1]);
    if (ppmc_set_filter(epp, (unsigned)slot, (enum ppmc_filter)filter, diag))
        return complain(diag);
    printf("slot %lu: encoder filter rate %s MHz\n", slot, names[filter]);
    return EXIT_SUCCESS;
}

static double get(const struct hm2_plain_binder *const plain, const char *const name, const unsigned encoder)
{
    char full[64];
    snprintf(full, sizeof full, "ppmc.0.encoder.%02u.%s", encoder, name);
    return hm2_plain_get(plain, full, NULL);
}

static void print_sample(const struct hm2_plain_binder *const plain, const unsigned encoders)
{
    for (unsigned i = 0; i < encoders; i++)
        printf("%s%.0f%s", i ? "\t" : "", get(plain, "count", i), get(plain, "index", i) != 0 ? "z" : "");
    printf("\t%s\n", hm2_plain_get(plain, "ppmc.0.fault", NULL) != 0 ? "fault" : "ok");
    fflush(stdout);
}

static void watch_boards(struct ppmc *const ppmc, const struct hm2_plain_binder *const plain,
                         const struct request *const request)
{
    const long period_ns = (long)request->period_ms * NS_PER_MS;
    const struct timespec pause = {period_ns / 1000000000L, period_ns % 1000000000L};
    unsigned encoders = 0;
    for (unsigned slot = 0; slot < PPMC_SLOTS; slot++)
        for (unsigned axis = 0; axis < ppmc_boards(ppmc)[slot].encoders; axis++)
            printf("%s%u.%u", encoders++ ? "\t" : "", slot, axis);
    puts("\tbus");
    for (unsigned long n = 0; !stopped && (request->samples == 0 || n < request->samples); n++) {
        if (n > 0)
            nanosleep(&pause, NULL);
        ppmc_read(ppmc, period_ns);
        print_sample(plain, encoders);
    }
    printf("timeouts %.0f, io errors %.0f, bad data %.0f, retries %.0f\n",
           hm2_plain_get(plain, "ppmc.0.timeouts", NULL), hm2_plain_get(plain, "ppmc.0.io-errors", NULL),
           hm2_plain_get(plain, "ppmc.0.bad-data", NULL), hm2_plain_get(plain, "ppmc.0.retries", NULL));
}

/* The counters are left as they are. */
static int watch(struct epp *const epp, const struct request *const request, struct hm2_diag *const diag)
{
    struct ppmc_options options = ppmc_default_options();
    struct hm2_plain_binder *const plain = hm2_plain_binder_new();
    struct ppmc *const ppmc = ppmc_new();
    int status = EXIT_FAILURE;
    options.keep_counts = true;
    options.verify = request->verify;
    if (request->argc != 0)
        status = usage_error("watch has no arguments, but got", request->argv[0]);
    else if (!plain || !ppmc)
        fputs("hm2ppmc: out of memory\n", stderr);
    else if (ppmc_setup(ppmc, epp, hm2_plain_binder(plain), &options, diag) != 0)
        status = complain(diag);
    else {
        watch_boards(ppmc, plain, request);
        ppmc_stop(ppmc);
        status = EXIT_SUCCESS;
    }
    ppmc_free(ppmc);
    hm2_plain_binder_free(plain);
    return status;
}

static const struct {
    const char *name;
    int (*run)(struct epp *epp, const struct request *request, struct hm2_diag *diag);
    bool takes_bus; /* and closes it */
} commands[] = {
    {"scan", scan, false},         {"identify", identify, false}, {"read", read_registers, false},
    {"filter", set_filter, false}, {"watch", watch, true},
};

/* ---- command line ------------------------------------------------------------------------------------------------ */

static const char usage[] =
    "Usage: hm2ppmc [options] COMMAND [arguments]\n"
    "Look at Pico Systems PPMC boards on an EPP parallel port.\n"
    "\n"
    "  scan                         list the boards at all sixteen addresses\n"
    "  identify SLOT                what is at one address (slot = address switches, 0 to 15)\n"
    "  read SLOT [OFFSET [COUNT]]   registers as they are; reading 0x0C clears the index bits\n"
    "  filter SLOT MHZ              set the encoder filter rate: 1, 2.5, 5 or 10\n"
    "  watch                        counts of all encoders, live; z = index seen\n"
    "\n"
    "  -b, --bus NAME    /dev/parportN (default /dev/parport0), port:0xBASE[:0xECRBASE], sim:SOCKET\n"
    "  -d, --epp-dir     command the direction of the data lines before reads\n"
    "  -p, --period MS   watch: time between two lines, 1 to 10000 (default 200)\n"
    "  -n, --count N     watch: so many lines (default: until interrupted)\n"
    "  --no-verify       watch: read counts only once\n"
    "  -h, --help        this text\n"
    "  -V, --version     version\n";

static int run_command(struct request *const request, const char *const name)
{
    struct hm2_diag diag = {0};
    struct epp *epp;
    size_t i = 0;
    while (i < sizeof commands / sizeof commands[0] && strcmp(commands[i].name, name) != 0)
        i++;
    if (i == sizeof commands / sizeof commands[0])
        return usage_error("unknown command", name);
    if (epp_open(&epp, request->bus, request->reverse, &diag) != 0)
        return complain(&diag);
    const int status = commands[i].run(epp, request, &diag);
    if (!commands[i].takes_bus)
        epp_close(epp);
    return status;
}

int main(const int argc, char **const argv)
{
    static const struct option options[] = {
        {"bus", required_argument, NULL, 'b'},    {"epp-dir", no_argument, NULL, 'd'},
        {"period", required_argument, NULL, 'p'}, {"count", required_argument, NULL, 'n'},
        {"no-verify", no_argument, NULL, 'v'},    {"help", no_argument, NULL, 'h'},
        {"version", no_argument, NULL, 'V'},      {NULL, 0, NULL, 0}};
    struct request request = {.bus = "/dev/parport0", .verify = true, .period_ms = 200};
    int option;
    while ((option = getopt_long(argc, argv, "b:dp:n:hV", options, NULL)) != -1)
        switch (option) {
        case 'b':
            request.bus = optarg;
            break;
        case 'd':
            request.reverse = true;
            break;
        case 'p':
            if (!number(optarg, MAX_PERIOD_S * 1000UL, &request.period_ms) || request.period_ms == 0)
                return usage_error("--period needs 1 to 10000 ms, not", optarg);
            break;
        case 'n':
            if (!number(optarg, 1000000000UL, &request.samples))
                return usage_error("--count needs a number, not", optarg);
            break;
        case 'v':
            request.verify = false;
            break;
        case 'h':
            fputs(usage, stdout);
            return EXIT_SUCCESS;
        case 'V':
            puts("hm2ppmc " HM2_VERSION);
            return EXIT_SUCCESS;
        default:
            return EXIT_USAGE;
        }
    if (optind == argc)
        return usage_error("a command is needed", NULL);
    (void)signal(SIGINT, stop);
    (void)signal(SIGTERM, stop);
    request.argc = argc - optind - 1;
    request.argv = argv + optind + 1;
    const int status = run_command(&request, argv[optind]);
    return fflush(stdout) == 0 ? status : EXIT_FAILURE;
}
