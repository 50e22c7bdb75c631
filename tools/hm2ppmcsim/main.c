/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2ppmcsim: simulated PPMC boards behind a local socket. One loop serves clients, standard input and signals. */
#include <errno.h>
#include <getopt.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <time.h>
#include <unistd.h>

#include "commands.h"

#define NS_PER_S   1000000000
#define EXIT_USAGE 2

enum { SOURCE_SIGNAL, SOURCE_INPUT, SOURCE_CLIENTS, SOURCES };

struct program {
    struct sim_ppmc *bus;
    struct sim_ppmc_server *server;
    struct timespec start;
    struct pollfd sources[SOURCES];
    char line[256]; /* of standard input so far */
    size_t line_len;
};

static void tell_time(const struct program *const p)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    sim_ppmc_set_time(p->bus, (int64_t)(now.tv_sec - p->start.tv_sec) * NS_PER_S + (now.tv_nsec - p->start.tv_nsec));
}

/* ---- sources of events ------------------------------------------------------------------------------------------- */

static void run_line(struct program *const p)
{
    char answer[512];
    p->line[p->line_len] = '\0';
    p->line_len = 0;
    tell_time(p);
    (void)command_run(p->bus, p->line, answer, sizeof answer);
    puts(answer);
    fflush(stdout);
}

static void take_input(struct program *const p)
{
    char text[256];
    const ssize_t len = read(STDIN_FILENO, text, sizeof text);
    if (len <= 0)
        p->sources[SOURCE_INPUT].fd = -1; /* no more commands: the boards stay */
    for (ssize_t i = 0; i < len; i++)
        if (text[i] == '\n')
            run_line(p);
        else if (p->line_len + 1 < sizeof p->line)
            p->line[p->line_len++] = text[i];
}

static int run(struct program *const p)
{
    for (;;) {
        if (poll(p->sources, SOURCES, -1) < 0 && errno != EINTR) {
            fprintf(stderr, "hm2ppmcsim: waiting failed: %s\n", strerror(errno));
            return EXIT_FAILURE;
        }
        if (p->sources[SOURCE_SIGNAL].revents)
            return EXIT_SUCCESS;
        if (p->sources[SOURCE_INPUT].revents)
            take_input(p);
        if (p->sources[SOURCE_CLIENTS].revents) {
            tell_time(p);
            sim_ppmc_server_run(p->server, p->bus);
        }
    }
}

/* ---- set-up ------------------------------------------------------------------------------------------------------ */

static bool prepare(struct program *const p, const char *const path)
{
    struct hm2_diag diag = {0};
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    if (sim_ppmc_server_open(&p->server, path, &diag) != 0) {
        fprintf(stderr, "hm2ppmcsim: --socket: %s", diag.text);
        return false;
    }
    const int signals = sigprocmask(SIG_BLOCK, &set, NULL) == 0 ? signalfd(-1, &set, SFD_CLOEXEC) : -1;
    p->sources[SOURCE_SIGNAL] = (struct pollfd){.fd = signals, .events = POLLIN};
    p->sources[SOURCE_INPUT] = (struct pollfd){.fd = STDIN_FILENO, .events = POLLIN};
    p->sources[SOURCE_CLIENTS] = (struct pollfd){.fd = sim_ppmc_server_fd(p->server), .events = POLLIN};
    clock_gettime(CLOCK_MONOTONIC, &p->start);
    return signals >= 0;
}

static const char usage[] =
    "Usage: hm2ppmcsim --socket PATH [options]\n"
    "Simulated Pico Systems PPMC boards on an EPP bus, for hm2ppmc(1) and ppmc_epp(9) as sim:PATH.\n"
    "\n"
    "  -s, --socket PATH      local socket that clients connect to\n"
    "  -d, --do COMMAND       carry out a command of standard input first; any number of times\n"
    "  --cycle-ns N           time of a bus cycle (default 1000)\n"
    "  --timestamps-live      timestamps are not latched with the counts\n"
    "  --seed N               of faults (default 0)\n"
    "  -h, --help             this text\n"
    "  -V, --version          version\n"
    "\n"
    "Commands, one a line: board SLOT [ID], rate SLOT.AXIS EDGES_PER_SECOND, jump SLOT.AXIS EDGES,\n"
    "index SLOT.AXIS COUNTS [OFFSET [WIDTH]], wire SLOT.AXIS on|off, power SLOT on|off, cable on|off,\n"
    "reset, faults EVERY [KIND...], show SLOT.AXIS, stats. Without a board command there is one\n"
    "encoder board (ID 0x14) in slot 2.\n";

struct arguments {
    const char *path;
    struct sim_ppmc_options bus;
    const char *commands[64];
    unsigned command_count;
};

/* -1 = go on, else the exit status. */
static int read_arguments(struct arguments *const a, const int argc, char **const argv)
{
    static const struct option options[] = {
        {"socket", required_argument, NULL, 's'},   {"do", required_argument, NULL, 'd'},
        {"cycle-ns", required_argument, NULL, 'c'}, {"timestamps-live", no_argument, NULL, 'l'},
        {"seed", required_argument, NULL, 'e'},     {"help", no_argument, NULL, 'h'},
        {"version", no_argument, NULL, 'V'},        {NULL, 0, NULL, 0}};
    int option;
    while ((option = getopt_long(argc, argv, "s:d:hV", options, NULL)) != -1) {
        if (option == 's')
            a->path = optarg;
        else if (option == 'd' && a->command_count < sizeof a->commands / sizeof a->commands[0])
            a->commands[a->command_count++] = optarg;
        else if (option == 'c')
            a->bus.cycle_ns = strtol(optarg, NULL, 10);
        else if (option == 'l')
            a->bus.timestamps_live = true;
        else if (option == 'e')
            a->bus.seed = strtoull(optarg, NULL, 10);
        else if (option == 'h' || option == 'V') {
            fputs(option == 'h' ? usage : "hm2ppmcsim " HM2_VERSION "\n", stdout);
            return EXIT_SUCCESS;
        } else
            return EXIT_USAGE;
    }
    if (a->path && optind == argc)
        return -1;
    fputs("hm2ppmcsim: --socket PATH is needed, and nothing but options; see --help\n", stderr);
    return EXIT_USAGE;
}

static bool make_boards(struct sim_ppmc *const bus, const struct arguments *const a)
{
    bool boards = false;
    for (unsigned i = 0; i < a->command_count; i++)
        boards = boards || strncmp(a->commands[i], "board ", 6) == 0;
    if (!boards && sim_ppmc_add(bus, 2, 0x14) != 0)
        return false;
    for (unsigned i = 0; i < a->command_count; i++) {
        char answer[512];
        if (command_run(bus, a->commands[i], answer, sizeof answer))
            continue;
        fprintf(stderr, "hm2ppmcsim: \"%s\": %s\n", a->commands[i], answer);
        return false;
    }
    return true;
}

int main(const int argc, char **const argv)
{
    static struct program p;
    struct arguments arguments = {0};
    int status = read_arguments(&arguments, argc, argv);
    if (status >= 0)
        return status;
    status = EXIT_FAILURE;
    p.bus = sim_ppmc_new(&arguments.bus);
    if (p.bus && make_boards(p.bus, &arguments) && prepare(&p, arguments.path)) {
        printf("ready %s\n", arguments.path);
        fflush(stdout);
        status = run(&p);
    }
    sim_ppmc_server_close(p.server);
    sim_ppmc_free(p.bus);
    return status;
}
