/* SPDX-License-Identifier: GPL-2.0-or-later */
/* By the kernel's calls alone, because the program that sorts the frames is 20 instructions long. */
#include "xdp.h"

#include <arpa/inet.h>
#include <errno.h>
#include <linux/bpf.h>
#include <linux/if_link.h>
#include <linux/if_xdp.h>
#include <net/ethernet.h>
#include <netinet/in.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#define FRAME_BYTES 2048u
#define FRAMES      64u /* a power of two, as rings want it */

/* Offsets in the frame: Ethernet, IPv4 without options, UDP. */
#define ETHER_TYPE 12
#define IP_PROTO   23
#define UDP_PORT   36
#define UDP_END    42

static int bpf(const enum bpf_cmd command, union bpf_attr *const attr)
{
    return (int)syscall(SYS_bpf, command, attr, sizeof *attr);
}

static int make_map(void)
{
    union bpf_attr attr = {
        .map_type = BPF_MAP_TYPE_XSKMAP, .key_size = sizeof(int), .value_size = sizeof(int), .max_entries = 1};
    return bpf(BPF_MAP_CREATE, &attr);
}

#define LOAD(size, to, from, offset)                                                            \
    {                                                                                           \
        .code = BPF_LDX | BPF_MEM | (size), .dst_reg = (to), .src_reg = (from), .off = (offset) \
    }
#define MOVE(to, from)                                                          \
    {                                                                           \
        .code = BPF_ALU64 | BPF_MOV | BPF_X, .dst_reg = (to), .src_reg = (from) \
    }
#define SET(to, value)                                                       \
    {                                                                        \
        .code = BPF_ALU64 | BPF_MOV | BPF_K, .dst_reg = (to), .imm = (value) \
    }
#define UNLESS_EQUAL(reg, value, skip)                                                     \
    {                                                                                      \
        .code = BPF_JMP | BPF_JNE | BPF_K, .dst_reg = (reg), .off = (skip), .imm = (value) \
    }

/* Datagrams for port go to the socket in the map, where there is one; all other frames pass. */
static int load_program(const int map, const uint16_t port)
{
    const struct bpf_insn program[] = {
        MOVE(6, 1),
        LOAD(BPF_W, 2, 1, offsetof(struct xdp_md, data)),
        LOAD(BPF_W, 3, 1, offsetof(struct xdp_md, data_end)),
        MOVE(4, 2),
        {.code = BPF_ALU64 | BPF_ADD | BPF_K, .dst_reg = 4, .imm = UDP_END},
        {.code = BPF_JMP | BPF_JGT | BPF_X, .dst_reg = 4, .src_reg = 3, .off = 12},
        LOAD(BPF_H, 4, 2, ETHER_TYPE),
        UNLESS_EQUAL(4, htons(ETHERTYPE_IP), 10),
        LOAD(BPF_B, 4, 2, IP_PROTO),
        UNLESS_EQUAL(4, IPPROTO_UDP, 8),
        LOAD(BPF_H, 4, 2, UDP_PORT),
        UNLESS_EQUAL(4, port, 6),
        {.code = BPF_LD | BPF_DW | BPF_IMM, .dst_reg = 1, .src_reg = BPF_PSEUDO_MAP_FD, .imm = map},
        {.code = 0}, /* second half of the one before */
        LOAD(BPF_W, 2, 6, offsetof(struct xdp_md, rx_queue_index)),
        SET(3, XDP_PASS),
        {.code = BPF_JMP | BPF_CALL, .imm = BPF_FUNC_redirect_map},
        {.code = BPF_JMP | BPF_EXIT},
        SET(0, XDP_PASS),
        {.code = BPF_JMP | BPF_EXIT},
    };
    union bpf_attr attr = {.prog_type = BPF_PROG_TYPE_XDP,
                           .insns = (uintptr_t)program,
                           .insn_cnt = sizeof program / sizeof program[0],
                           .license = (uintptr_t) "GPL"};
    return bpf(BPF_PROG_LOAD, &attr);
}

static int attach(const int program, const unsigned interface, const bool native)
{
    union bpf_attr attr = {.link_create = {.prog_fd = (unsigned)program,
                                           .target_ifindex = interface,
                                           .attach_type = BPF_XDP,
                                           .flags = native ? XDP_FLAGS_DRV_MODE : XDP_FLAGS_SKB_MODE}};
    return bpf(BPF_LINK_CREATE, &attr);
}

static int put_socket(const int map, const int fd)
{
    const int queue = 0;
    union bpf_attr attr = {.map_fd = (unsigned)map, .key = (uintptr_t)&queue, .value = (uintptr_t)&fd};
    return bpf(BPF_MAP_UPDATE_ELEM, &attr);
}

static bool option(const int fd, const int name, const void *const value, const socklen_t size)
{
    return setsockopt(fd, SOL_XDP, name, value, size) == 0;
}

/* Memory for the frames, and the rings: received ones, free ones, and one for sent ones that must be there. */
static const char *make_rings(struct xdp *const xdp)
{
    const int count = FRAMES;
    struct xdp_mmap_offsets at;
    socklen_t size = sizeof at;
    xdp->frames = mmap(NULL, (size_t)FRAME_BYTES * FRAMES, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (xdp->frames == MAP_FAILED)
        return "mmap of the frames";
    const struct xdp_umem_reg memory = {
        .addr = (uintptr_t)xdp->frames, .len = (size_t)FRAME_BYTES * FRAMES, .chunk_size = FRAME_BYTES};
    if (!option(xdp->fd, XDP_UMEM_REG, &memory, sizeof memory))
        return "XDP_UMEM_REG";
    if (!option(xdp->fd, XDP_UMEM_FILL_RING, &count, sizeof count) ||
        !option(xdp->fd, XDP_UMEM_COMPLETION_RING, &count, sizeof count) ||
        !option(xdp->fd, XDP_RX_RING, &count, sizeof count) ||
        getsockopt(xdp->fd, SOL_XDP, XDP_MMAP_OFFSETS, &at, &size) != 0)
        return "the rings' options";
    uint8_t *const rx = mmap(NULL, at.rx.desc + FRAMES * sizeof(struct xdp_desc), PROT_READ | PROT_WRITE,
                             MAP_SHARED | MAP_POPULATE, xdp->fd, XDP_PGOFF_RX_RING);
    uint8_t *const fill = mmap(NULL, at.fr.desc + FRAMES * sizeof(uint64_t), PROT_READ | PROT_WRITE,
                               MAP_SHARED | MAP_POPULATE, xdp->fd, (off_t)XDP_UMEM_PGOFF_FILL_RING);
    if (rx == MAP_FAILED || fill == MAP_FAILED)
        return "mmap of the rings";
    xdp->consumer = (uint32_t *)(void *)(rx + at.rx.consumer);
    xdp->producer = (uint32_t *)(void *)(rx + at.rx.producer);
    xdp->received = (const struct xdp_desc *)(void *)(rx + at.rx.desc);
    xdp->fill_producer = (uint32_t *)(void *)(fill + at.fr.producer);
    xdp->fill = (uint64_t *)(void *)(fill + at.fr.desc);
    return NULL;
}

/* Only one side writes fill_producer, so it can be read as any other variable. */
static void give(struct xdp *const xdp, const uint64_t frame)
{
    xdp->fill[*xdp->fill_producer % FRAMES] = frame;
    __atomic_store_n(xdp->fill_producer, *xdp->fill_producer + 1, __ATOMIC_RELEASE);
}

/* The kernel gives the queue back some time after the process before has ended. */
static bool take_queue(const int fd, const unsigned interface)
{
    const struct sockaddr_xdp own = {.sxdp_family = AF_XDP, .sxdp_flags = XDP_COPY, .sxdp_ifindex = interface};
    int failed;
    for (int try = 0; try < 100; try++) {
        failed = bind(fd, (const struct sockaddr *)&own, sizeof own);
        if (failed == 0 || errno != EBUSY)
            break;
        usleep(50000);
    }
    return failed == 0;
}

const char *xdp_open(struct xdp *const xdp, const unsigned interface, const uint16_t port, const bool native)
{
    const char *failed;
    xdp->fd = socket(AF_XDP, SOCK_RAW, 0);
    if (xdp->fd < 0)
        return "socket(AF_XDP)";
    if ((failed = make_rings(xdp)))
        return failed;
    for (uint64_t i = 0; i < FRAMES; i++)
        give(xdp, i * FRAME_BYTES);
    if (!take_queue(xdp->fd, interface))
        return "bind(AF_XDP)";
    const int map = make_map();
    const int program = map < 0 ? -1 : load_program(map, port);
    if (program < 0 || put_socket(map, xdp->fd) != 0)
        return map < 0 ? "BPF_MAP_CREATE" : program < 0 ? "BPF_PROG_LOAD" : "BPF_MAP_UPDATE_ELEM";
    return attach(program, interface, native) < 0 ? "BPF_LINK_CREATE" : NULL;
}

size_t xdp_take(struct xdp *const xdp)
{
    const uint32_t at = *xdp->consumer;
    if (__atomic_load_n(xdp->producer, __ATOMIC_ACQUIRE) == at)
        return 0;
    const struct xdp_desc frame = xdp->received[at % FRAMES];
    __atomic_store_n(xdp->consumer, at + 1, __ATOMIC_RELEASE);
    give(xdp, frame.addr - frame.addr % FRAME_BYTES);
    return frame.len;
}
