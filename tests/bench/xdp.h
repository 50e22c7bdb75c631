/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A receive ring of AF_XDP: frames for one UDP port of ours, as the network interface's driver hands them over. */
#ifndef BENCH_XDP_H
#define BENCH_XDP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct xdp {
    int fd;
    uint8_t *frames;
    uint32_t *consumer, *producer; /* of the ring of received frames */
    const struct xdp_desc *received;
    uint32_t *fill_producer;
    uint64_t *fill;
};

/*
 * interface: by number; its first queue. port: of the UDP datagrams to take, network order; everything else goes on as
 * before. native: within the driver, before there is a socket buffer; else in the kernel's general place, behind the
 * driver. The frame is copied in both. NULL, or the call that failed, with errno. What was made ends with the process.
 */
const char *xdp_open(struct xdp *xdp, unsigned interface, uint16_t port, bool native);

/* The length of the frame that was taken, whose place goes back to the kernel; 0 when none is there. */
size_t xdp_take(struct xdp *xdp);

#endif
