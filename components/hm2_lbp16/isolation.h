/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Keep other programs off the cards' networks: what they send there can delay a cycle, and an ARP question in the
 * middle of one costs it. Done once at load and undone at unload; nothing of it is realtime.
 *
 * An interface is closed only when it serves the cards alone (hal-interface 6, row 23a): never the loopback interface,
 * and without being told to, not one that has further IPv4 addresses or the default route. On a closed interface only
 * UDP to the cards' ports goes out; ICMP is dropped and the rest rejected (hal-interface 3.7).
 */
#ifndef ISOLATION_H
#define ISOLATION_H

#include <net/if_arp.h>

#include <hm2/err.h>

#define ISOLATION_CARDS 16u

enum isolation_mode {
    ISOLATION_AUTO,   /* interfaces that serve the cards alone */
    ISOLATION_NONE,   /* no rules; hardware addresses are pinned all the same */
    ISOLATION_FORCED, /* interfaces that serve others, too */
};

struct nft_ctx;

struct isolation {
    struct nft_ctx *rules; /* the kernel removes them when this is closed, or when the process ends however it ends */
    unsigned pinned_count;
    struct arpreq pinned[ISOLATION_CARDS];
};

/* Close the interfaces of count (at most ISOLATION_CARDS) cards, given as "192.168.1.121" or with ":port", that have
 * just answered. What could not be done is a warning in diag that says why and what to do: the cards work without. */
void isolation_begin(struct isolation *isolation, const char *const *addresses, unsigned count,
                     enum isolation_mode mode, struct hm2_diag *diag);
void isolation_end(struct isolation *isolation);

#endif
