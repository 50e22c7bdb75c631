/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From the cycle to people: a ring of fixed entries with one producer (the thread that runs the cycle) and one
 * consumer (whoever asks for messages). Neither side waits for the other; what does not fit is counted.
 */
#ifndef NOTICE_H
#define NOTICE_H

#include <stdatomic.h>

#include <hm2/module.h>

#define NOTICE_RING_SIZE   64u /* a power of two: the ring's positions run freely and wrap */
#define NOTICE_ACTIVE_SIZE 64u /* conditions remembered as present, a power of two */
#define NOTICE_ACTIVE_WAYS 4u  /* places in which one condition may stand */
#define NOTICE_WORDS       8u
/* A condition that was absent for this long is reported anew when it comes back. */
#define NOTICE_ABSENT_NS 1000000000

struct board_event {
    const struct hm2_module *module; /* NULL: an event of the board itself */
    int kind;                        /* enum hm2_notice, or enum board_event_kind when module is NULL */
    const char *point;               /* that it is about, or NULL */
    unsigned instance;
    double value;
    uint32_t words[NOTICE_WORDS]; /* facts that belong to the kind */
};

struct notice_active {
    const struct hm2_module *module; /* NULL = free */
    int kind;
    const char *point; /* by address: every place of the code names its own constant */
    unsigned instance;
    int64_t last_ns;
};

struct board_notices {
    struct board_event ring[NOTICE_RING_SIZE];
    _Atomic uint32_t produced, consumed; /* free-running positions */
    _Atomic uint32_t overflows;          /* events that found the ring full */
    /* Below: the cycle's thread alone. */
    struct notice_active active[NOTICE_ACTIVE_SIZE];
    int64_t now_ns; /* time of the present cycle, set by the board */
};

/* Producer: store an event. False, and counted, when the ring is full. Realtime safe. */
bool board_notices_push(struct board_notices *notices, const struct board_event *event);
/* Consumer: take the oldest event. */
bool board_notices_pop(struct board_notices *notices, struct board_event *event);
/* Producer: is this condition new at notices->now_ns? Remembers it as present either way. */
bool board_notices_is_new(struct board_notices *notices, const struct hm2_module *module, int kind, const char *point,
                          unsigned instance);

#endif
