/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "sockets.h"

#include <arpa/inet.h>
#include <errno.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define NS_PER_S           INT64_C(1000000000)
#define HOST_IP            "192.168.1.1"
#define CARD_IP            "192.168.1.121"
#define CARD_PORT          27181
#define HOST_PORT          40000
#define RECEIVE_TIMEOUT_NS 10000 /* of a blocking recv(): what hm2_eth asks for */

/* The modules that are loaded find these names here, before those of the C library. */
#pragma GCC visibility push(default)

static _Thread_local bool engaged;
static struct {
    struct sim_net *net;
    struct link *link;
    sockets_send_fn fn;
    void *context;
    int64_t spent_ns;     /* by reading clocks, not yet known to the net */
    unsigned clock_calls; /* since the last call that does something */
    int card_fd;          /* the socket that was connected first, -1 = none */
    int pending_len;      /* of a datagram that a wait has brought, -1 = none */
    uint8_t pending[LINK_MAX_DATAGRAM_BYTES];
} shim = {.card_fd = -1, .pending_len = -1};

/* ---- time ---------------------------------------------------------------------------------------------------------
 */

static void settle(void)
{
    const int64_t now_ns = link_now_ns(shim.link) + shim.spent_ns;
    shim.spent_ns = 0;
    shim.clock_calls = 0;
    sim_net_sleep_until(shim.net, now_ns);
}

void sockets_open(struct sim_net *const net, const sockets_send_fn fn, void *const context)
{
    shim.net = net;
    shim.link = sim_net_link(net);
    shim.fn = fn;
    shim.context = context;
    shim.spent_ns = 0;
    engaged = true;
}

void sockets_engage(const bool wanted)
{
    engaged = wanted;
}

int64_t sockets_now_ns(void)
{
    return link_now_ns(shim.link) + shim.spent_ns;
}

void sockets_sleep_until(const int64_t now_ns)
{
    settle();
    sim_net_sleep_until(shim.net, now_ns);
}

static void sleep_for(const struct timespec *const time)
{
    sockets_sleep_until(sockets_now_ns() + time->tv_sec * NS_PER_S + time->tv_nsec);
}

int clock_gettime(const clockid_t clock, struct timespec *const now)
{
    if (!engaged)
        return (int)syscall(SYS_clock_gettime, clock, now);
    if (++shim.clock_calls > SOCKETS_FREE_CLOCKS)
        shim.spent_ns += SOCKETS_CLOCK_NS;
    const int64_t now_ns = sockets_now_ns();
    *now = (struct timespec){.tv_sec = (time_t)(now_ns / NS_PER_S), .tv_nsec = (long)(now_ns % NS_PER_S)};
    return 0;
}

int nanosleep(const struct timespec *const time, struct timespec *const left)
{
    if (!engaged)
        return (int)syscall(SYS_nanosleep, time, left);
    sleep_for(time);
    return 0;
}

/* ---- datagrams ----------------------------------------------------------------------------------------------------
 */

static bool is_card(const int fd)
{
    return engaged && fd >= 0 && fd == shim.card_fd;
}

int connect(const int fd, __CONST_SOCKADDR_ARG address, const socklen_t len)
{
    if (!engaged)
        return (int)syscall(SYS_connect, fd, address.__sockaddr__, len);
    if (shim.card_fd < 0)
        shim.card_fd = fd; /* others only ask for the way to the card */
    return 0;
}

int bind(const int fd, __CONST_SOCKADDR_ARG address, const socklen_t len)
{
    return engaged ? 0 : (int)syscall(SYS_bind, fd, address.__sockaddr__, len);
}

int close(const int fd)
{
    if (is_card(fd))
        shim.card_fd = -1;
    return (int)syscall(SYS_close, fd);
}

int shutdown(const int fd, const int how)
{
    return is_card(fd) ? 0 : (int)syscall(SYS_shutdown, fd, how);
}

ssize_t send(const int fd, const void *const data, const size_t len, const int flags)
{
    if (!is_card(fd))
        return syscall(SYS_sendto, fd, data, len, flags, NULL, 0);
    settle();
    if (shim.fn(shim.context, data, len) && link_send(shim.link, data, len) != 0) {
        errno = EMSGSIZE;
        return -1;
    }
    return (ssize_t)len;
}

/* What a wait has brought already comes first. */
static int take(uint8_t *const data, const size_t capacity, const int64_t wait_ns)
{
    int len = shim.pending_len;
    if (len >= 0) {
        memcpy(data, shim.pending, (size_t)len);
        shim.pending_len = -1;
        shim.clock_calls = 0;
        return len;
    }
    settle();
    len = link_recv(shim.link, data, capacity, link_now_ns(shim.link) + wait_ns);
    return len;
}

static ssize_t receive(void *const data, const size_t capacity, const int flags)
{
    uint8_t whole[LINK_MAX_DATAGRAM_BYTES];
    const int len = take(whole, sizeof whole, flags & MSG_DONTWAIT ? 0 : RECEIVE_TIMEOUT_NS);
    if (len < 0) {
        errno = EAGAIN;
        return -1;
    }
    const size_t kept = (size_t)len < capacity ? (size_t)len : capacity;
    memcpy(data, whole, kept);
    return flags & MSG_TRUNC ? len : (ssize_t)kept;
}

ssize_t recv(const int fd, void *const data, const size_t capacity, const int flags)
{
    return is_card(fd) ? receive(data, capacity, flags) : syscall(SYS_recvfrom, fd, data, capacity, flags, NULL, NULL);
}

/* The C library declares the first argument as written only, which it is not. */
int answer_ppoll(struct pollfd *fds, nfds_t count, const struct timespec *timeout,
                 const sigset_t *mask) __asm__("ppoll");

int answer_ppoll(struct pollfd *const fds, const nfds_t count, const struct timespec *const timeout,
                 const sigset_t *const mask)
{
    if (count != 1 || !is_card(fds->fd) || !timeout)
        return (int)syscall(SYS_ppoll, fds, count, timeout, mask, _NSIG / 8);
    if (shim.pending_len < 0)
        shim.pending_len = take(shim.pending, sizeof shim.pending, timeout->tv_sec * NS_PER_S + timeout->tv_nsec);
    fds->revents = shim.pending_len < 0 ? 0 : POLLIN;
    return shim.pending_len < 0 ? 0 : 1;
}

/* ---- what a driver asks about its network -------------------------------------------------------------------------
 */

static int name_of(const char *const ip, const uint16_t port, struct sockaddr *const address, socklen_t *const len)
{
    const struct sockaddr_in in = {.sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = inet_addr(ip)};
    memcpy(address, &in, *len < sizeof in ? *len : sizeof in);
    *len = sizeof in;
    return 0;
}

int getsockname(const int fd, __SOCKADDR_ARG address, socklen_t *const len)
{
    return engaged ? name_of(HOST_IP, HOST_PORT, address.__sockaddr__, len)
                   : (int)syscall(SYS_getsockname, fd, address.__sockaddr__, len);
}

int getpeername(const int fd, __SOCKADDR_ARG address, socklen_t *const len)
{
    return engaged ? name_of(CARD_IP, CARD_PORT, address.__sockaddr__, len)
                   : (int)syscall(SYS_getpeername, fd, address.__sockaddr__, len);
}

/* One interface, with the address that getsockname() tells; one that no driver closes to others. */
int getifaddrs(struct ifaddrs **const list)
{
    static char name[] = "hm2sim";
    static struct sockaddr_in address;
    static struct ifaddrs one = {
        .ifa_name = name, .ifa_flags = IFF_UP | IFF_LOOPBACK, .ifa_addr = (struct sockaddr *)&address};
    address = (struct sockaddr_in){.sin_family = AF_INET, .sin_addr.s_addr = inet_addr(HOST_IP)};
    *list = &one;
    return 0;
}

void freeifaddrs(struct ifaddrs *const list)
{
    (void)list;
}

/* Fixed entries of the ARP table, which hm2_eth makes. */
int ioctl(const int fd, const unsigned long request, ...)
{
    va_list args;
    va_start(args, request);
    void *const argument = va_arg(args, void *);
    va_end(args);
    return is_card(fd) ? 0 : (int)syscall(SYS_ioctl, fd, request, argument);
}

/* No program is started: the firewall's tools have done what they were asked for, it seems. */
#define NO_PROCESS 0x7FFFFFFE

int posix_spawn(pid_t *const pid, const char *const path, const posix_spawn_file_actions_t *const actions,
                const posix_spawnattr_t *const attributes, char *const argv[], char *const envp[])
{
    (void)path, (void)actions, (void)attributes, (void)argv, (void)envp;
    *pid = NO_PROCESS;
    return 0;
}

pid_t waitpid(const pid_t pid, int *const status, const int options)
{
    if (pid != NO_PROCESS)
        return (pid_t)syscall(SYS_wait4, pid, status, options, NULL);
    *status = 0;
    return pid;
}

#pragma GCC visibility pop
