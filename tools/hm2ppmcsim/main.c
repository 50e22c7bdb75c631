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
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "commands.h"

#define NS_PER_S    1000000000
#define MAX_CLIENTS 8u
#define EXIT_USAGE  2

enum { SOURCE_SIGNAL, SOURCE_INPUT, SOURCE_LISTENER, SOURCE_CLIENTS };

struct program {
    struct sim_ppmc *bus;
    const char *path;
    struct timespec start;
    struct pollfd sources[SOURCE_CLIENTS + MAX_CLIENTS];
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

static void accept_client(struct program *const p)
{
    const int fd = accept4(p->sources[SOURCE_LISTENER].fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    for (unsigned i = 0; fd >= 0 && i < MAX_CLIENTS; i++)
        if (p->sources[SOURCE_CLIENTS + i].fd < 0) {
            p->sources[SOURCE_CLIENTS + i].fd = fd;
            return;
        }
    if (fd >= 0)
        close(fd);
}

static void serve(struct program *const p, struct pollfd *const client)
{
    uint8_t request[EPP_WIRE_MAX_BYTES], reply[EPP_WIRE_MAX_BYTES];
    const ssize_t len = recv(client->fd, request, sizeof request, MSG_TRUNC);
    if (len < 0 && (errno == EAGAIN || errno == EINTR))
        return;
    tell_time(p);
    const bool fits = len > 0 && (size_t)len <= sizeof request;
    const size_t answer = fits ? sim_ppmc_serve(p->bus, request, (size_t)len, reply) : 0;
    if (answer > 0 && send(client->fd, reply, answer, MSG_NOSIGNAL) == (ssize_t)answer)
        return;
    close(client->fd);
    client->fd = -1;
}

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
        if (poll(p->sources, SOURCE_CLIENTS + MAX_CLIENTS, -1) < 0 && errno != EINTR) {
            fprintf(stderr, "hm2ppmcsim: waiting failed: %s\n", strerror(errno));
            return EXIT_FAILURE;
        }
        if (p->sources[SOURCE_SIGNAL].revents)
            return EXIT_SUCCESS;
        if (p->sources[SOURCE_INPUT].revents)
            take_input(p);
        if (p->sources[SOURCE_LISTENER].revents)
            accept_client(p);
        for (unsigned i = 0; i < MAX_CLIENTS; i++)
            if (p->sources[SOURCE_CLIENTS + i].fd >= 0 && p->sources[SOURCE_CLIENTS + i].revents)
                serve(p, &p->sources[SOURCE_CLIENTS + i]);
    }
}

/* ---- set-up ------------------------------------------------------------------------------------------------------ */

static bool listen_at(struct program *const p)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(p->path) >= sizeof address.sun_path) {
        fprintf(stderr, "hm2ppmcsim: --socket: at most %zu characters\n", sizeof address.sun_path - 1);
        return false;
    }
    memcpy(address.sun_path, p->path, strlen(p->path) + 1);
    const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    p->sources[SOURCE_LISTENER].fd = fd;
    /* One that nobody listens at any more was left by a program that was killed. */
    if (fd >= 0 && connect(fd, (const struct sockaddr *)&address, sizeof address) != 0 && errno == ECONNREFUSED)
        unlink(p->path);
    if (fd < 0 || bind(fd, (const struct sockaddr *)&address, sizeof address) != 0 || listen(fd, MAX_CLIENTS) != 0) {
        fprintf(stderr, "hm2ppmcsim: %s: %s\n", p->path, strerror(errno));
        p->path = NULL; /* not ours to remove */
        return false;
    }
    return true;
}

static bool prepare(struct program *const p)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    for (unsigned i = 0; i < SOURCE_CLIENTS + MAX_CLIENTS; i++)
        p->sources[i] = (struct pollfd){.fd = -1, .events = POLLIN};
    p->sources[SOURCE_INPUT].fd = STDIN_FILENO;
    p->sources[SOURCE_SIGNAL].fd = sigprocmask(SIG_BLOCK, &set, NULL) == 0 ? signalfd(-1, &set, SFD_CLOEXEC) : -1;
    clock_gettime(CLOCK_MONOTONIC, &p->start);
    return p->sources[SOURCE_SIGNAL].fd >= 0 && listen_at(p);
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
    p.path = arguments.path;
    p.bus = sim_ppmc_new(&arguments.bus);
    if (p.bus && make_boards(p.bus, &arguments) && prepare(&p)) {
        printf("ready %s\n", p.path);
        fflush(stdout);
        status = run(&p);
        unlink(p.path);
    }
    sim_ppmc_free(p.bus);
    return status;
}
