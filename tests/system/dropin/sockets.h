/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The C library's sockets and clocks, led to a simulated card in virtual time. A driver that was written for a network
 * (LinuxCNC's hm2_eth, or our component) runs in this process and cannot tell: socket(), connect(), send(), recv(),
 * ppoll(), clock_gettime() and relatives of the thread that called sockets_open() are answered here, those of every
 * other thread by the kernel. Nothing reaches the real network, and no program is started.
 *
 * Time stands still but in waits, and in loops that read a clock again and again: only so does a driver send at the
 * same time whatever it has done before.
 */
#ifndef TEST_DROPIN_SOCKETS_H
#define TEST_DROPIN_SOCKETS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/sim.h>

#define SOCKETS_CLOCK_NS    1000 /* what reading a clock costs */
#define SOCKETS_FREE_CLOCKS 16   /* in a row for nothing */

/* Called for every datagram to the card; false = it is lost on the way. */
typedef bool (*sockets_send_fn)(void *context, const uint8_t *data, size_t len);

/* From now on this thread's sockets lead to the card of this net, whatever address they connect to. */
void sockets_open(struct sim_net *net, sockets_send_fn fn, void *context);
/* Answer this thread's calls (true, as after opening), or leave them to the kernel. */
void sockets_engage(bool engaged);
int64_t sockets_now_ns(void);
void sockets_sleep_until(int64_t now_ns);

#endif
