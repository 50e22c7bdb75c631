/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2sim: simulated HostMot2 Ethernet cards on UDP. One loop serves all of them. */
#include <errno.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#include "control.h"
#include "options.h"
#include "serial.h"
#include "station.h"

#define NS_PER_S   1000000000
#define MAX_EVENTS 16

enum { EXIT_FAILED = 1, EXIT_USAGE = 2 };

/* What an epoll event is about: a station's number, one of these, or one of the last two and the number of a station
 * with an EPP bus or of a serial line. */
enum { SOURCE_SIGNAL = MAX_CARDS, SOURCE_TIMER, SOURCE_CONTROL, SOURCE_PPMC, SOURCE_SERIAL = SOURCE_PPMC + MAX_CARDS };

struct program {
    struct options options;
    unsigned count;
    struct station stations[MAX_CARDS];
    unsigned serial_count;
    struct serial serials[MAX_SERIALS];
    int epoll, signals, timer, control;
    struct timespec start;
    int64_t timer_ns; /* what the timer is set to */
    int64_t stats_due_ns;
    bool end;
};

static int64_t now_ns(const struct program *const p)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)(now.tv_sec - p->start.tv_sec) * NS_PER_S + (now.tv_nsec - p->start.tv_nsec);
}

/* ---- set-up -------------------------------------------------------------------------------------------------------
 */

static int watch(const struct program *const p, const int fd, const uint32_t source)
{
    struct epoll_event event = {.events = EPOLLIN, .data.u32 = source};
    return epoll_ctl(p->epoll, EPOLL_CTL_ADD, fd, &event);
}

static int open_loop(struct program *const p, struct hm2_diag *const diag)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    p->epoll = epoll_create1(EPOLL_CLOEXEC);
    p->timer = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
    p->signals = sigprocmask(SIG_BLOCK, &set, NULL) == 0 ? signalfd(-1, &set, SFD_CLOEXEC) : -1;
    if (p->epoll < 0 || p->timer < 0 || p->signals < 0 || watch(p, p->signals, SOURCE_SIGNAL) ||
        watch(p, p->timer, SOURCE_TIMER))
        return hm2_diag_add(diag, HM2_ERR_IO, "cannot set up the event loop: %s", strerror(errno));
    return 0;
}

static int open_stations(struct program *const p, struct hm2_diag *const diag)
{
    for (unsigned i = 0; i < p->options.card_count; i++) {
        p->count = i + 1;
        const int err = station_open(&p->stations[i], &p->options, &p->options.cards[i], p->options.seed + i, diag);
        if (err)
            return err;
        if (watch(p, p->stations[i].socket, i) ||
            (p->options.cards[i].ppmc && watch(p, sim_ppmc_server_fd(p->stations[i].ppmc.server), SOURCE_PPMC + i)))
            return hm2_diag_add(diag, HM2_ERR_IO, "cannot watch a socket: %s", strerror(errno));
    }
    return 0;
}

static int open_serials(struct program *const p, struct hm2_diag *const diag)
{
    for (unsigned i = 0; i < p->options.serial_count; i++) {
        p->serial_count = i + 1;
        const uint32_t number = (uint32_t)p->options.seed + i;
        const int err = serial_open(&p->serials[i], &p->options.serials[i], number, diag);
        if (err)
            return err;
        if (watch(p, p->serials[i].fd, SOURCE_SERIAL + i))
            return hm2_diag_add(diag, HM2_ERR_IO, "cannot watch a pseudo-terminal: %s", strerror(errno));
    }
    return 0;
}

static int open_control(struct program *const p, struct hm2_diag *const diag)
{
    if (!p->options.control)
        return 0;
    const int err = control_open(p->options.control, &p->control, diag);
    if (err)
        return err;
    return watch(p, p->control, SOURCE_CONTROL) ? hm2_diag_add(diag, HM2_ERR_IO, "cannot watch the control socket") : 0;
}

/* Says plainly what could not be had; the program works without, only later at times. */
static void go_realtime(const struct options *const o)
{
    const struct sched_param param = {.sched_priority = o->realtime_priority};
    if (mlockall(MCL_CURRENT | MCL_FUTURE))
        fprintf(stderr, "hm2sim: memory is not locked: %s\n", strerror(errno));
    if (sched_setscheduler(0, SCHED_FIFO, &param))
        fprintf(stderr,
                "hm2sim: runs without realtime priority: %s (needs root, CAP_SYS_NICE or an rtprio limit of %d)\n",
                strerror(errno), o->realtime_priority);
    (void)prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
}

static void print_ready(const struct program *const p)
{
    char name[STATION_NAME_SIZE];
    fputs("ready", stdout);
    for (unsigned i = 0; i < p->count; i++) {
        station_name(&p->stations[i], name);
        printf(" %s", name);
    }
    for (unsigned i = 0; i < p->serial_count; i++)
        printf(" %s@%s", p->options.serials[i].remote, p->options.serials[i].path);
    putchar('\n');
    fflush(stdout);
}

static void print_stats(struct program *const p)
{
    for (unsigned i = 0; i < p->count; i++)
        station_print_stats(&p->stations[i]);
    fflush(stdout);
}

/* ---- the loop -----------------------------------------------------------------------------------------------------
 */

static int64_t earlier(const int64_t a, const int64_t b)
{
    return a < b ? a : b;
}

static void set_timer(struct program *const p)
{
    int64_t next_ns = earlier(p->options.run_ns > 0 ? p->options.run_ns : INT64_MAX, p->stats_due_ns);
    for (unsigned i = 0; i < p->count; i++)
        next_ns = earlier(next_ns, station_next_ns(&p->stations[i]));
    if (next_ns == p->timer_ns)
        return;
    p->timer_ns = next_ns;
    struct itimerspec when = {.it_value = {0, 0}};
    if (next_ns < INT64_MAX) {
        const int64_t ns = p->start.tv_nsec + (next_ns > 0 ? next_ns : 1);
        when.it_value.tv_sec = p->start.tv_sec + ns / NS_PER_S;
        when.it_value.tv_nsec = ns % NS_PER_S;
    }
    (void)timerfd_settime(p->timer, TFD_TIMER_ABSTIME, &when, NULL);
}

static void on_timer(struct program *const p)
{
    uint64_t expirations;
    (void)!read(p->timer, &expirations, sizeof expirations);
    const int64_t now = now_ns(p);
    p->timer_ns = -1; /* it has gone off: whatever comes next must be set */
    for (unsigned i = 0; i < p->count; i++)
        if (station_next_ns(&p->stations[i]) <= now)
            station_run(&p->stations[i], now);
    if (p->stats_due_ns <= now) {
        p->stats_due_ns += p->options.stats_ns;
        if (!p->options.quiet)
            print_stats(p);
    }
    p->end = p->end || (p->options.run_ns > 0 && now >= p->options.run_ns);
}

static void on_event(struct program *const p, const uint32_t source)
{
    switch (source) {
    case SOURCE_SIGNAL:
        p->end = true;
        break;
    case SOURCE_TIMER:
        on_timer(p);
        break;
    case SOURCE_CONTROL:
        p->end = control_receive(p->control, p->stations, p->count, now_ns(p)) || p->end;
        break;
    default:
        if (source < SOURCE_SIGNAL)
            station_receive(&p->stations[source], now_ns(p));
        else if (source < SOURCE_SERIAL)
            station_receive_ppmc(&p->stations[source - SOURCE_PPMC], now_ns(p));
        else
            serial_receive(&p->serials[source - SOURCE_SERIAL], now_ns(p));
        break;
    }
}

static int run(struct program *const p)
{
    struct epoll_event events[MAX_EVENTS];
    while (!p->end) {
        set_timer(p);
        const int count = epoll_wait(p->epoll, events, MAX_EVENTS, -1);
        if (count < 0 && errno != EINTR) {
            fprintf(stderr, "hm2sim: waiting for packets failed: %s\n", strerror(errno));
            return EXIT_FAILED;
        }
        for (int i = 0; i < count; i++)
            on_event(p, events[i].data.u32);
    }
    if (!p->options.quiet)
        print_stats(p);
    return 0;
}

static void close_all(struct program *const p)
{
    for (unsigned i = 0; i < p->count; i++)
        station_close(&p->stations[i]);
    for (unsigned i = 0; i < p->serial_count; i++)
        serial_close(&p->serials[i]);
    if (p->control >= 0) {
        close(p->control);
        unlink(p->options.control);
    }
    close(p->epoll);
    close(p->timer);
    close(p->signals);
}

int main(const int argc, char **const argv)
{
    static struct program p;
    struct hm2_diag diag = {0};
    switch (options_read(&p.options, argc, argv)) {
    case OPTIONS_EXIT_OK:
        return 0;
    case OPTIONS_EXIT_USAGE:
        return EXIT_USAGE;
    case OPTIONS_RUN:
        break;
    }
    p.control = -1;
    p.timer_ns = -1;
    p.stats_due_ns = p.options.stats_ns > 0 ? p.options.stats_ns : INT64_MAX;
    clock_gettime(CLOCK_MONOTONIC, &p.start);
    int err = open_loop(&p, &diag);
    if (!err)
        err = open_stations(&p, &diag);
    if (!err)
        err = open_serials(&p, &diag);
    if (!err)
        err = open_control(&p, &diag);
    int status = EXIT_FAILED;
    if (err) {
        fprintf(stderr, "hm2sim: %s", diag.text);
    } else {
        if (p.options.realtime)
            go_realtime(&p.options);
        print_ready(&p);
        status = run(&p);
    }
    close_all(&p);
    return status;
}
