/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* UDP to a card, and the count of those who are not the card. */
#include <hm2/link.h>

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <hm2/lbp16.h>

#include "clock.h"
#include "text.h"

#define NS_PER_MS INT64_C(1000000)

struct udp {
    struct link base;
    int fd;
    int watch_fd; /* of the strangers; -1 = they are not watched */
    int stop_fd;  /* tells the watcher to end */
    pthread_t watcher;
    int64_t busy_ns; /* receive so long without sleeping before waiting for an interrupt; INT64_MAX = never sleep */
};

static int64_t udp_now(struct link *const link)
{
    (void)link;
    return clock_now_ns();
}

/* Errors that say that some datagram met nobody, reported by ICMP or by the route: the datagram is lost, as others
 * are lost, and the card may be back in the next cycle. */
static bool is_nobody_there(const int error)
{
    return error == ECONNREFUSED || error == EHOSTUNREACH || error == ENETUNREACH || error == EHOSTDOWN ||
           error == ENETDOWN || error == ENOPROTOOPT;
}

static int udp_send(struct link *const link, const void *const data, const size_t len)
{
    struct udp *const udp = (struct udp *)link;
    if (len > LINK_MAX_DATAGRAM_BYTES)
        return HM2_ERR_NOSPACE;
    if (send(udp->fd, data, len, MSG_NOSIGNAL) >= 0) {
        link->counters.sent++;
        return 0;
    }
    link->counters.send_errors++;
    if (is_nobody_there(errno))
        return 0;
    return errno == EMSGSIZE ? HM2_ERR_NOSPACE : HM2_ERR_IO;
}

/* Wait until something can be received. False when the deadline is over; then nothing was waited for. */
static bool wait_until(struct udp *const udp, const int64_t deadline_ns)
{
    struct pollfd ready = {.fd = udp->fd, .events = POLLIN};
    for (;;) {
        const int64_t now_ns = udp_now(&udp->base);
        if (deadline_ns <= now_ns)
            return false;
        const struct timespec timeout = clock_span(deadline_ns - now_ns);
        const int result = ppoll(&ready, 1, &timeout, NULL);
        if (result > 0)
            return true;
        if (result == 0 || errno != EINTR)
            return false;
    }
}

/* When to stop receiving without sleeping. Each attempt drives the network card's queue itself (SO_BUSY_POLL); ppoll(2)
 * would do so only where the system-wide net.core.busy_poll is set. */
static int64_t busy_end(struct udp *const udp, const int64_t deadline_ns)
{
    if (udp->busy_ns == 0)
        return INT64_MIN;
    const int64_t now_ns = udp_now(&udp->base);
    return deadline_ns <= now_ns || deadline_ns - now_ns <= udp->busy_ns ? deadline_ns : now_ns + udp->busy_ns;
}

enum got { GOT_ONE, GOT_NOTHING, GOT_ERROR };

/* Take what has arrived. *result is for the caller after GOT_ONE, and an error of ours or 0 after GOT_ERROR. */
static inline enum got take(struct udp *const udp, void *const data, const size_t cap, int *const result)
{
    struct link_counters *const counters = &udp->base.counters;
    const ssize_t len = recv(udp->fd, data, cap, MSG_DONTWAIT | MSG_TRUNC);
    if (len >= 0) {
        counters->received++;
        *result = (size_t)len <= cap ? (int)len : HM2_ERR_NOSPACE;
        return GOT_ONE;
    }
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)
        return GOT_NOTHING; /* woken for nothing, e.g. by a datagram with a bad checksum */
    counters->receive_errors++;
    *result = is_nobody_there(errno) ? 0 : HM2_ERR_IO;
    return GOT_ERROR;
}

HM2_RARE static int receive(struct udp *const udp, void *const data, const size_t cap, const int64_t deadline_ns)
{
    /* An ICMP error takes the place of a datagram and may hide one behind it; a few of them are passed over even after
     * the deadline. */
    unsigned passes_after_deadline = 4;
    const int64_t busy_until_ns = busy_end(udp, deadline_ns);
    for (;;) {
        const bool in_time = (udp->busy_ns > 0 && udp_now(&udp->base) < busy_until_ns) || wait_until(udp, deadline_ns);
        int result = 0;
        const enum got got = take(udp, data, cap, &result);
        if (got == GOT_ONE || (got == GOT_ERROR && result < 0))
            return result;
        if (!in_time && (got == GOT_NOTHING || --passes_after_deadline == 0))
            return HM2_ERR_TIMEOUT;
    }
}

/* What nearly every cycle is: the caller has just read the clock, and one datagram comes before the deadline. */
static int udp_recv(struct link *const link, void *const data, const size_t cap, const int64_t deadline_ns,
                    const int64_t clock_ns)
{
    struct udp *const udp = (struct udp *)link;
    if (clock_ns == LINK_CLOCK_UNREAD || deadline_ns <= clock_ns || udp->busy_ns > 0)
        return receive(udp, data, cap, deadline_ns);
    struct pollfd ready = {.fd = udp->fd, .events = POLLIN};
    const struct timespec timeout = clock_span(deadline_ns - clock_ns);
    int result = 0;
    if (ppoll(&ready, 1, &timeout, NULL) > 0) {
        const enum got got = take(udp, data, cap, &result);
        if (got == GOT_ONE || (got == GOT_ERROR && result < 0))
            return result;
    }
    return receive(udp, data, cap, deadline_ns);
}

/* ---- strangers --------------------------------------------------------------------------------------------------- */

/* Receives what arrives at our port and is not from the card, and counts it. At most 64 datagrams a millisecond, so
 * that a flood costs no more than that; the kernel drops the rest. */
static void *watch(void *const context)
{
    struct udp *const udp = context;
    struct pollfd events[] = {{.fd = udp->stop_fd, .events = POLLIN}, {.fd = udp->watch_fd, .events = POLLIN}};
    while (events[0].revents == 0) {
        unsigned counted = 0;
        char byte;
        if (poll(events, 2, -1) < 0)
            continue; /* EINTR: this thread blocks all signals, but a debugger's stop counts as one */
        while (counted < 64 && recv(udp->watch_fd, &byte, sizeof byte, MSG_DONTWAIT) >= 0)
            counted++;
        (void)__atomic_fetch_add(&udp->base.counters.strangers, counted, __ATOMIC_RELAXED);
        (void)poll(events, 1, 1);
    }
    return NULL;
}

/* A thread of normal priority, whatever the caller has, with a small stack (hosts lock their memory) and no signals. */
static int start_watcher(struct udp *const udp)
{
    pthread_attr_t attributes;
    sigset_t all, before;
    if (pthread_attr_init(&attributes) != 0)
        return HM2_ERR_NOMEM;
    const struct sched_param normal = {.sched_priority = 0};
    (void)pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    (void)pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
    (void)pthread_attr_setschedparam(&attributes, &normal);
    (void)pthread_attr_setstacksize(&attributes, (size_t)256 << 10);
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    const int error = pthread_create(&udp->watcher, &attributes, watch, udp);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    (void)pthread_attr_destroy(&attributes);
    return error ? HM2_ERR_NOMEM : 0;
}

static int watch_strangers(struct udp *const udp, struct hm2_diag *const diag)
{
    struct sockaddr_in local;
    socklen_t len = sizeof local;
    const int one = 1;
    /* Only now: while the port was being chosen, the socket must not have shared it with another link's. */
    const bool shared = setsockopt(udp->fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one) == 0 &&
                        getsockname(udp->fd, (struct sockaddr *)&local, &len) == 0;
    udp->watch_fd = shared ? socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0) : -1;
    if (udp->watch_fd < 0 || setsockopt(udp->watch_fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one) != 0 ||
        bind(udp->watch_fd, (const struct sockaddr *)&local, sizeof local) != 0)
        return hm2_diag_add(diag, HM2_ERR_IO, "Datagrams of strangers cannot be watched: %s.", strerror(errno));
    udp->stop_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (udp->stop_fd < 0 || start_watcher(udp) != 0) {
        if (udp->stop_fd >= 0)
            (void)close(udp->stop_fd);
        udp->stop_fd = -1;
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "Datagrams of strangers cannot be watched: no thread for it.");
    }
    return 0;
}

/* ---- open and close ---------------------------------------------------------------------------------------------- */

static void udp_close(struct link *const link)
{
    struct udp *const udp = (struct udp *)link;
    if (udp->stop_fd >= 0) {
        const uint64_t one = 1;
        while (write(udp->stop_fd, &one, sizeof one) < 0 && errno == EINTR)
            continue;
        (void)pthread_join(udp->watcher, NULL);
        (void)close(udp->stop_fd);
    }
    if (udp->watch_fd >= 0)
        (void)close(udp->watch_fd);
    if (udp->fd >= 0)
        (void)close(udp->fd);
    free(udp);
}

static const struct link_ops udp_ops = {
    .send = udp_send,
    .recv = udp_recv,
    .now_ns = udp_now,
    .close = udp_close,
};

static const char *find_end(const struct text_span span, const char c)
{
    const char *p = span.at;
    while (p < span.end && *p != c)
        p++;
    return p;
}

/* One number of an address: decimal, no leading zero (inet_aton(3) would read it as octal). */
static bool address_number(const struct text_span digits, const uint64_t max, uint64_t *const value)
{
    const bool leading_zero = digits.end - digits.at > 1 && *digits.at == '0';
    return !leading_zero && text_number(digits, max, value);
}

static int refuse_address(struct hm2_diag *const diag, const char *const text, const char *const reason)
{
    return hm2_diag_add(diag, HM2_ERR_INVALID,
                        "Card address \"%.64s\": %s; write A.B.C.D or A.B.C.D:PORT, for example 192.168.1.121.", text,
                        reason);
}

static int parse_address(const char *const text, struct sockaddr_in *const address, struct hm2_diag *const diag)
{
    struct text_span left = {text, text + strlen(text)};
    uint32_t ip = 0;
    uint64_t number = 0, port = LBP16_UDP_PORT;
    for (unsigned i = 0; i < 4; i++) {
        const char *const end = find_end(left, i < 3 ? '.' : ':');
        if (i < 3 && end == left.end)
            return refuse_address(diag, text, "four numbers with dots between them are needed");
        if (!address_number((struct text_span){left.at, end}, 255, &number))
            return refuse_address(diag, text, "each number must be 0 to 255, without leading zeros");
        ip = ip << 8 | (uint32_t)number;
        left.at = i < 3 ? end + 1 : end;
    }
    const bool has_port = left.at < left.end;
    if (has_port && !(address_number((struct text_span){left.at + 1, left.end}, 65535, &port) && port > 0))
        return refuse_address(diag, text, "the port must be 1 to 65535");
    if (ip == 0 || ip >> 28 >= 0xEu)
        return refuse_address(diag, text, "this is the address of a group or of nobody, not of a card");
    *address =
        (struct sockaddr_in){.sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(ip)};
    return 0;
}

/* connect() gives the socket its port first and its peer an instant later: what came in between is a stranger's. */
static void drop_early_arrivals(struct udp *const udp)
{
    char byte;
    for (unsigned i = 0; i < 1024 && recv(udp->fd, &byte, sizeof byte, MSG_DONTWAIT) >= 0; i++)
        udp->base.counters.strangers++;
}

static void poll_busily(struct udp *const udp, const struct link_udp_options *const options,
                        struct hm2_diag *const diag)
{
    const int busy_us = options->busy_poll_us < 1000000u ? (int)options->busy_poll_us : 1000000;
    udp->busy_ns = options->spin ? INT64_MAX : busy_us * INT64_C(1000);
    if (busy_us > 0 && setsockopt(udp->fd, SOL_SOCKET, SO_BUSY_POLL, &busy_us, sizeof busy_us) != 0)
        hm2_diag_warn(diag,
                      "Busy polling of %d us was refused: %s. Packets are polled for, but the network card is not.",
                      busy_us, strerror(errno));
}

static int connect_to(struct udp *const udp, const struct link_udp_options *const options, struct hm2_diag *const diag)
{
    struct sockaddr_in address;
    const int err = parse_address(options->address ? options->address : "", &address, diag);
    if (err)
        return err;
    udp->fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (udp->fd < 0)
        return hm2_diag_add(diag, HM2_ERR_IO, "No UDP socket: %s.", strerror(errno));
    /* The cards do not put fragments together (seed 000, "HOST COMMUNICATION"); a too small MTU shall be an error. */
    const int no_fragments = IP_PMTUDISC_DO;
    (void)setsockopt(udp->fd, IPPROTO_IP, IP_MTU_DISCOVER, &no_fragments, sizeof no_fragments);
    if (connect(udp->fd, (const struct sockaddr *)&address, sizeof address) != 0)
        return hm2_diag_add(diag, HM2_ERR_IO,
                            "Card address %s: %s. Check that an interface of this computer is up in the same network.",
                            options->address, strerror(errno));
    drop_early_arrivals(udp);
    poll_busily(udp, options, diag);
    return 0;
}

int link_udp_open(struct link **const link, const struct link_udp_options *const options, struct hm2_diag *const diag)
{
    struct udp *const udp = calloc(1, sizeof *udp);
    if (!udp)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "No memory for a UDP link.");
    udp->base.ops = &udp_ops;
    udp->fd = udp->watch_fd = udp->stop_fd = -1;
    int err = connect_to(udp, options, diag);
    if (!err && options->watch_strangers)
        err = watch_strangers(udp, diag);
    if (err) {
        udp_close(&udp->base);
        return err;
    }
    *link = &udp->base;
    return 0;
}
