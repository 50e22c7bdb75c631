/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Ways to receive a reply, with nothing around them: a datagram goes out, its reply is awaited for at most a period.
 *
 *     bench_receive WAY ADDRESS PORT REQUEST_BYTES REPLY_BYTES CYCLES
 *
 * Prints the wall time and the processor time of sending and receiving; with 0 cycles, it is only seen whether the way
 * can be used here. WAY is one of the names in the table at the end. The peer is `bench_cycle serve`. The packet ways
 * receive from a ring that is shared with the kernel (AF_PACKET, TPACKET_V2), ahead of IP and UDP; they send through
 * the UDP socket, whose own copy of the reply a filter drops. The xdp ways do the same with a ring of AF_XDP (xdp.h),
 * filled before there is a socket buffer (native) or behind the network card's driver.
 */
#include <errno.h>
#include <ifaddrs.h>
#include <linux/filter.h>
#include <linux/if_packet.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <netinet/ip.h>
#include <netinet/udp.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "timing.h"
#include "xdp.h"

#define FRAME_BYTES 2048u
#define FRAMES      64u
#define BUSY_US     1000

static struct {
    int fd, packet_fd;
    struct sockaddr_in own;
    uint8_t *ring;
    unsigned next;
    struct xdp xdp;
    size_t reply;
} io;

static _Noreturn void fail(const char *const what)
{
    fprintf(stderr, "bench_receive: %s: %s\n", what, strerror(errno));
    exit(1);
}

static bool wait_for(const int fd, const int64_t deadline_ns)
{
    struct pollfd ready = {.fd = fd, .events = POLLIN};
    const int64_t left_ns = deadline_ns - now_ns();
    const struct timespec timeout = {.tv_nsec = left_ns > 0 ? left_ns : 0};
    return ppoll(&ready, 1, &timeout, NULL) > 0;
}

static bool take(const int flags)
{
    char buffer[FRAME_BYTES];
    return recv(io.fd, buffer, sizeof buffer, flags) == (ssize_t)io.reply;
}

/* ---- the ways --------------------------------------------------------------------------------------------------- */

static bool receive_wait(const int64_t deadline_ns)
{
    return wait_for(io.fd, deadline_ns) && take(MSG_DONTWAIT);
}

/* The time-out is the socket's, in the kernel's ticks: it cannot end at a deadline within a period. */
static void open_timeout(void)
{
    const struct timeval limit = {.tv_usec = PERIOD_NS / 1000};
    if (setsockopt(io.fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit) != 0)
        fail("SO_RCVTIMEO");
}

static bool receive_timeout(const int64_t deadline_ns)
{
    (void)deadline_ns;
    return take(0);
}

static bool receive_several(const int64_t deadline_ns)
{
    static char buffers[4][FRAME_BYTES];
    struct iovec parts[4];
    struct mmsghdr messages[4] = {{.msg_len = 0}};
    for (unsigned i = 0; i < 4; i++) {
        parts[i] = (struct iovec){buffers[i], FRAME_BYTES};
        messages[i].msg_hdr = (struct msghdr){.msg_iov = &parts[i], .msg_iovlen = 1};
    }
    return wait_for(io.fd, deadline_ns) && recvmmsg(io.fd, messages, 4, MSG_DONTWAIT, NULL) == 1 &&
           messages[0].msg_len == io.reply;
}

static bool receive_spin(const int64_t deadline_ns)
{
    bool got;
    do
        got = take(MSG_DONTWAIT);
    while (!got && now_ns() < deadline_ns);
    return got;
}

static void open_busy(void)
{
    const int busy_us = BUSY_US;
    if (setsockopt(io.fd, SOL_SOCKET, SO_BUSY_POLL, &busy_us, sizeof busy_us) != 0)
        fail("SO_BUSY_POLL");
}

/* One blocking receive: the kernel polls for BUSY_US and sleeps then. */
static void open_busy_sleep(void)
{
    open_busy();
    open_timeout();
}

/* Ahead of IP and UDP, a reply has their headers in front of it. */
static bool is_reply(const size_t frame_len)
{
    return frame_len >= sizeof(struct ether_header) + sizeof(struct iphdr) + sizeof(struct udphdr) + io.reply;
}

static void open_packet(void)
{
    const struct tpacket_req ring = {
        .tp_block_size = FRAME_BYTES * FRAMES, .tp_block_nr = 1, .tp_frame_size = FRAME_BYTES, .tp_frame_nr = FRAMES};
    const int version = TPACKET_V2;
    /* IPv4 without options, UDP, for our port */
    struct sock_filter ours[] = {
        BPF_STMT(BPF_LD | BPF_B | BPF_ABS, 23), BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, IPPROTO_UDP, 0, 3),
        BPF_STMT(BPF_LD | BPF_H | BPF_ABS, 36), BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ntohs(io.own.sin_port), 0, 1),
        BPF_STMT(BPF_RET | BPF_K, FRAME_BYTES), BPF_STMT(BPF_RET | BPF_K, 0),
    };
    struct sock_filter none[] = {BPF_STMT(BPF_RET | BPF_K, 0)};
    const struct sock_fprog ours_program = {.len = sizeof ours / sizeof ours[0], .filter = ours};
    const struct sock_fprog none_program = {.len = 1, .filter = none};
    io.packet_fd = socket(AF_PACKET, SOCK_RAW, htons(ETH_P_IP));
    if (io.packet_fd < 0 ||
        setsockopt(io.packet_fd, SOL_SOCKET, SO_ATTACH_FILTER, &ours_program, sizeof ours_program) != 0 ||
        setsockopt(io.packet_fd, SOL_PACKET, PACKET_VERSION, &version, sizeof version) != 0 ||
        setsockopt(io.packet_fd, SOL_PACKET, PACKET_RX_RING, &ring, sizeof ring) != 0 ||
        setsockopt(io.fd, SOL_SOCKET, SO_ATTACH_FILTER, &none_program, sizeof none_program) != 0)
        fail("AF_PACKET");
    io.ring = mmap(NULL, (size_t)FRAME_BYTES * FRAMES, PROT_READ | PROT_WRITE, MAP_SHARED, io.packet_fd, 0);
    if (io.ring == MAP_FAILED)
        fail("AF_PACKET ring");
}

/* True when a frame with a reply's length was there; it goes back to the kernel. */
static bool take_frame(void)
{
    struct tpacket2_hdr *const head = (struct tpacket2_hdr *)(void *)(io.ring + (size_t)io.next * FRAME_BYTES);
    if (!(__atomic_load_n(&head->tp_status, __ATOMIC_ACQUIRE) & TP_STATUS_USER))
        return false;
    const size_t len = head->tp_len;
    io.next = (io.next + 1) % FRAMES;
    __atomic_store_n(&head->tp_status, TP_STATUS_KERNEL, __ATOMIC_RELEASE);
    return is_reply(len);
}

static bool receive_packet_wait(const int64_t deadline_ns)
{
    return take_frame() || (wait_for(io.packet_fd, deadline_ns) && take_frame());
}

static bool receive_packet_spin(const int64_t deadline_ns)
{
    bool got;
    do
        got = take_frame();
    while (!got && now_ns() < deadline_ns);
    return got;
}

static unsigned own_interface(void)
{
    struct ifaddrs *all, *at;
    unsigned number = 0;
    if (getifaddrs(&all) != 0)
        fail("getifaddrs");
    for (at = all; at && number == 0; at = at->ifa_next) {
        const struct sockaddr_in *const in = (const struct sockaddr_in *)(const void *)at->ifa_addr;
        if (in && in->sin_family == AF_INET && in->sin_addr.s_addr == io.own.sin_addr.s_addr)
            number = if_nametoindex(at->ifa_name);
    }
    freeifaddrs(all);
    return number;
}

static void open_xdp_way(const bool native)
{
    const char *const failed = xdp_open(&io.xdp, own_interface(), io.own.sin_port, native);
    if (failed)
        fail(failed);
}

static void open_xdp(void)
{
    open_xdp_way(false);
}

static void open_xdp_native(void)
{
    open_xdp_way(true);
}

static bool take_xdp(void)
{
    return is_reply(xdp_take(&io.xdp));
}

static bool receive_xdp_wait(const int64_t deadline_ns)
{
    return take_xdp() || (wait_for(io.xdp.fd, deadline_ns) && take_xdp());
}

static bool receive_xdp_spin(const int64_t deadline_ns)
{
    bool got;
    do
        got = take_xdp();
    while (!got && now_ns() < deadline_ns);
    return got;
}

static const struct way {
    const char *name;
    void (*open)(void);
    bool (*receive)(int64_t deadline_ns);
} ways[] = {
    {"wait", NULL, receive_wait},
    {"timeout", open_timeout, receive_timeout},
    {"recvmmsg", NULL, receive_several},
    {"busy", open_busy_sleep, receive_timeout},
    {"spin", NULL, receive_spin},
    {"packet-wait", open_packet, receive_packet_wait},
    {"packet-spin", open_packet, receive_packet_spin},
    {"xdp-wait", open_xdp, receive_xdp_wait},
    {"xdp-spin", open_xdp, receive_xdp_spin},
    {"xdp-native-wait", open_xdp_native, receive_xdp_wait},
    {"xdp-native-spin", open_xdp_native, receive_xdp_spin},
};

/* ---- measurement ------------------------------------------------------------------------------------------------- */

static void connect_to(const struct sockaddr_in *const peer)
{
    socklen_t size = sizeof io.own;
    io.fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (io.fd < 0 || connect(io.fd, (const struct sockaddr *)peer, sizeof *peer) != 0 ||
        getsockname(io.fd, (struct sockaddr *)&io.own, &size) != 0)
        fail("socket");
}

static int measure(const struct way *const way, const size_t request, const int cycles)
{
    static const char data[FRAME_BYTES];
    int64_t *const wall = calloc((size_t)cycles, sizeof *wall);
    int64_t *const thread = calloc((size_t)cycles, sizeof *thread);
    int lost = 0;
    if (!wall || !thread)
        fail("memory");
    take_processor(CLIENT_CPU);
    int64_t next = now_ns();
    for (int i = -WARM_UP; i < cycles; i++) {
        sleep_until(next += PERIOD_NS);
        const int64_t thread_begin = thread_ns(), begin = now_ns();
        if (send(io.fd, data, request, 0) < 0)
            fail("send");
        lost += !way->receive(begin + PERIOD_NS / 10 * 8);
        const int64_t end = now_ns();
        if (i >= 0) {
            wall[i] = end - begin;
            thread[i] = thread_ns() - thread_begin;
        }
    }
    print_times("wall", wall, cycles);
    print_times("thread", thread, cycles);
    free(wall);
    free(thread);
    if (lost > cycles / 20)
        fprintf(stderr, "bench_receive: %d of %d replies lost, so this is no measurement\n", lost, cycles);
    return lost > cycles / 20;
}

int main(const int argc, char **const argv)
{
    for (size_t i = 0; argc == 7 && i < sizeof ways / sizeof ways[0]; i++) {
        if (strcmp(argv[1], ways[i].name) != 0)
            continue;
        const struct sockaddr_in peer = address_of(argv[2], argv[3]);
        io.reply = strtoul(argv[5], NULL, 10);
        connect_to(&peer);
        if (ways[i].open)
            ways[i].open();
        const int cycles = (int)strtol(argv[6], NULL, 10);
        return cycles > 0 ? measure(&ways[i], strtoul(argv[4], NULL, 10), cycles) : 0;
    }
    fprintf(stderr, "bench_receive: see the comment at the top of bench_receive.c, or run `make bench`\n");
    return 2;
}
