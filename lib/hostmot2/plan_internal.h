/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Inside of the transfer plan: what plan_layout.c lays out and plan_cycle.c uses. */
#ifndef HM2_PLAN_INTERNAL_H
#define HM2_PLAN_INTERNAL_H

#include <hm2/plan.h>

/* Longer than any good reply, so that a longer one does not fit exactly. */
#define PLAN_REPLY_CAPACITY 1536u

/* Scratch registers of space 4 that hold our numbers, two words each. */
enum {
    PLAN_SCRATCH_REQUEST = LBP16_TIMER_SCRATCH,
    PLAN_SCRATCH_WRITE = LBP16_TIMER_SCRATCH + 4,
    PLAN_SCRATCH_SESSION = LBP16_TIMER_SCRATCH + 8,
    PLAN_SCRATCH_WORDS = 6,
};

/* What stands behind the windows in a reply. */
enum {
    PLAN_TRAILER_REQUEST = 0,
    PLAN_TRAILER_WRITE = 4,
    PLAN_TRAILER_SESSION = 8,
    PLAN_TRAILER_RX_UDP = 12,
    PLAN_TRAILER_BYTES = 14,
};

/* In front of it, when the plan reads queues: the count of replies. */
enum { PLAN_REPLIES_BYTES = 2 };

/* Commands of our own: word, address and data. */
enum {
    PLAN_COMMAND_BYTES = 4,         /* word and address of any command */
    PLAN_ADDRESS_BYTES = 2,         /* in front of the data of a write */
    PLAN_NUMBER_BYTES = 8,          /* write of one number */
    PLAN_SESSION_BYTES = 6 + 8,     /* HM2Timeout = 0, session number */
    PLAN_REQUEST_BYTES = 8 + 2 * 4, /* write of the sequence number and the two reads of the trailer */
    PLAN_BEFORE_BYTES = 4,          /* of a turn: read of the number of the write before */
    PLAN_WAIT_BYTES = 6 + 4 + 6,    /* HM2Timeout, the wait, HM2Timeout */
};

/* What a turn's reply has more than a plain one, behind the windows of rank ARRIVAL. */
enum { PLAN_EXTRA_BEFORE = 0, PLAN_EXTRA_WAITED = 4, PLAN_EXTRA_BYTES = 6 };

struct plan_window {
    struct hm2_window *window;
    uint16_t address, words;
    uint8_t rank;
    bool movable;
    bool queue;     /* all words at one address */
    uint16_t was;   /* place of its words before the plan was opened again, plus one; 0 = none */
    uint16_t aimed; /* and where its address pointed then */
};

struct plan_list {
    struct plan_window at[HM2_PLAN_MAX_WINDOWS];
    unsigned count, commands;
};

struct plan_section {
    struct hm2_section *section;
    uint32_t write_seq; /* of the last write that carried it */
    uint16_t at, len;   /* of the command in the set-up stream */
    uint8_t rank;
    bool on_demand;
};

/* State of a part of the set-up stream. A section that was never sent and is on demand is in none of them. */
enum plan_state { PLAN_DIRTY, PLAN_FLYING, PLAN_CLEAN, PLAN_STATES };

#define PLAN_SET_WORDS ((HM2_PLAN_MAX_SECTIONS + 63u) / 64u)

/* One bit a section, by its number. */
struct plan_set {
    uint64_t bits[PLAN_SET_WORDS];
};

struct hm2_plan {
    bool frozen;
    struct plan_list reads, writes;
    unsigned section_count;
    struct plan_section sections[HM2_PLAN_MAX_SECTIONS]; /* after freeze in the order of sending */
    struct plan_set in_state[PLAN_STATES];
    size_t setup_len;

    uint32_t request_seq;
    uint64_t requests;        /* sent so far */
    uint64_t requests_before; /* those that an earlier layout made */
    uint64_t turns;           /* those that were turns */
    uint64_t late_request;    /* what the last late reply answers; 0: nothing that can be read */
    uint64_t answered;        /* bit n: the n-th request before the last one got its answer */
    bool outstanding;
    uint32_t write_at_request; /* write_seq when the last request was made */
    size_t request_len, reply_len;
    size_t arrival_len, arrival_bytes; /* commands of rank ARRIVAL in the request, and their words in the reply */
    unsigned timer;                    /* of the turns; 0 = none */
    bool pipelines;                    /* turns are possible */
    bool repeatable;                   /* no read has to happen exactly once */

    uint32_t write_seq, section_write_seq; /* last write, last one with sections */
    uint32_t write_before;                 /* the write before the last turn */
    size_t fixed_len;
    uint32_t session, session_write_seq;
    enum plan_state session_state;
    struct hm2_plan_facts facts;

    /* Prepared parts of the write datagram. */
    uint8_t session_commands[PLAN_SESSION_BYTES];
    uint8_t number_command[PLAN_NUMBER_BYTES];

    uint8_t request[LBP16_MAX_REQUEST_BYTES];
    uint8_t reply[LBP16_MAX_REPLY_BYTES]; /* the last fresh one */
    uint8_t landing[PLAN_REPLY_CAPACITY];
    uint8_t write[LBP16_MAX_REQUEST_BYTES];
    uint8_t turn[LBP16_MAX_REQUEST_BYTES];
    uint8_t turn_before[PLAN_BEFORE_BYTES], turn_wait[PLAN_WAIT_BYTES];
    uint8_t setup[HM2_PLAN_SETUP_BYTES];
};

/* A new request: its number, and what is known of the ones before. */
void plan_begin_request(struct hm2_plan *plan);
/* The write of this cycle, of at most `most` bytes; returns its length. */
size_t plan_compose_write(struct hm2_plan *plan, size_t most);
/* len bytes in the landing: when they are the reply to a turn, give them the shape of a plain one and keep what it had
 * more. Returns the length that is left. */
size_t plan_unfold_turn(struct hm2_plan *plan, size_t len, bool *is_turn, uint8_t extra[PLAN_EXTRA_BYTES]);
/* Once the packets are laid out. */
void plan_prepare_turn(struct hm2_plan *plan);

/* What plan.h promises to those who provide the memory. */
_Static_assert(sizeof(struct hm2_plan) <= (size_t)24 << 10, "a plan is about 24 KiB");

#endif
