/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A CANopen node as its NMT master sees it (CiA 301, "network management", "heartbeat", "node guarding"): whether it
 * is operational, and when it must be started. The frames themselves come and go elsewhere.
 *
 * Pure logic on the caller's memory, realtime safe.
 */
#ifndef HM2_NMT_H
#define HM2_NMT_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/err.h>

enum hm2_nmt_state { /* as heartbeats and guarding responses carry it */
                     HM2_NMT_BOOT_UP = 0,
                     HM2_NMT_STOPPED = 4,
                     HM2_NMT_OPERATIONAL = 5,
                     HM2_NMT_PRE_OPERATIONAL = 127
};

#define HM2_NMT_START    1u
#define HM2_NMT_RETRY_NS INT64_C(500000000) /* between two commands to start a node that is not operational yet */

struct hm2_nmt_in {
    bool lost;      /* no heartbeat or response in time */
    bool guarding;  /* they are responses to guarding, whose toggle bit must alternate */
    bool toggle;    /* of the newest */
    uint8_t state;  /* of the newest */
    uint32_t count; /* how many there were */
};

/* One node; zero it at first. */
struct hm2_nmt {
    bool guarded; /* count and toggle are of a response to guarding */
    bool toggle;
    uint32_t count;
    uint32_t toggle_errors; /* responses with the toggle bit of the one before */
    bool started;           /* ever */
    int64_t started_ns;
};

/* Look at what came. Whether the node is there and operational. */
HM2_API bool hm2_nmt_look(struct hm2_nmt *node, const struct hm2_nmt_in *in);

/* Whether the node waits for the command to start now: it has booted (boot-up, pre-operational) and was not told in the
 * last HM2_NMT_RETRY_NS. A node that somebody stopped is left so. Whoever sends it tells by hm2_nmt_started(). */
HM2_API bool hm2_nmt_must_start(const struct hm2_nmt *node, const struct hm2_nmt_in *in, int64_t now_ns);
HM2_API void hm2_nmt_started(struct hm2_nmt *node, int64_t now_ns);

#endif
