/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A link above another one that does something to exactly one datagram, which is chosen by its number. */
#ifndef UNRULY_LINK_H
#define UNRULY_LINK_H

#include <hm2/link.h>

enum unruly {
    UNRULY_LOST,
    UNRULY_TWICE,
    UNRULY_SWAPPED,   /* comes behind the next one of its direction */
    UNRULY_LATE,      /* comes 20 ms after the client has given it up and sent again (or sent something else) */
    UNRULY_VERY_LATE, /* 1 s after */
    UNRULY_GONE,      /* it and all that follow are lost */
    UNRULY_KINDS
};

struct unruly_fault {
    enum unruly what;
    bool reply;  /* to a reply, not to a request */
    uint64_t at; /* its number, from 1 on; 0 = never */
};

struct unruly_link {
    struct link link; /* first */
    struct link *below;
    struct unruly_fault fault;
    uint64_t seen[2]; /* requests and replies, of this fault */
    bool holds;
    int64_t due_ns; /* of what is held; INT64_MAX = not known yet */
    size_t held_len;
    uint8_t held[LINK_MAX_DATAGRAM_BYTES];
};

void unruly_link_init(struct unruly_link *unruly, struct link *below);
/* From now on; counts anew. */
void unruly_link_set(struct unruly_link *unruly, const struct unruly_fault *fault);
/* A request that is held goes on, a reply is dropped, and nothing more is done to any datagram. */
void unruly_link_release(struct unruly_link *unruly);
const char *unruly_name(enum unruly what);

#endif
