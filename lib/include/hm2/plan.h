/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The transfer plan: which registers travel in every cycle, at offsets fixed for good.
 *
 * At set-up every module adds the register windows it reads and writes each cycle and the sections it writes rarely.
 * hm2_plan_freeze() sorts and merges the windows into LBP16 commands once and lays out one request, one reply and
 * one write datagram. From then on a window *is* the bytes inside the packet: modules store words straight into the
 * outgoing packet and load them straight from the last fresh reply. Lengths never change, except that changed set-up
 * sections follow the fixed part of the write datagram in the very cycle in which one of their words changed.
 *
 *   request:  request sequence number -> space 4 0x0010, reads of the windows, one read of space 4 0x0010..0x001B,
 *             one read of space 6 0x000A
 *   reply:    windows, request sequence number, number of the last write, session number, UDP packets received
 *   write:    windows, [session number -> space 4 0x0018], changed sections, write sequence number -> space 4 0x0014
 *
 * Proof of freshness: the card brings back the sequence number of this very request, together with the number of the
 * last write that it carried out to the end, a session number that a power cycle erases, and its count of received
 * UDP packets. Sequence numbers count from 1, skip 0 and wrap. Numbers are 32 bits in two 16-bit scratch registers
 * (seed 000, "MEMORY SPACE 4 LAYOUT": 0x0010..0x001E for any use).
 *
 * The session number belongs to the set-up stream: it is sent ahead of the sections in the first write, and again
 * by hm2_plan_touch_all() when a card had lost it, until a reply shows it. With it goes HM2Timeout = 0 (space 4,
 * 0x0004): every write of a scratch register waits for DPLL timer 4 until that time-out (recorded exchanges,
 * tests/data/lbp16/README.md), and nothing here waits inside the card.
 *
 * Set-up sections are resent until the card has confirmed the write that carried them: a section may therefore arrive
 * more than once, never not at all. When the card carries an older write out after a newer one (the network changed
 * their order), all sections that the newer one had brought are sent again.
 *
 * Pipelined (docs/pipelined-cycle.md), write and request travel as one datagram, in which the card waits for a timer of
 * its DPLL before it reads:
 *
 *   turn:     reads of rank ARRIVAL, read of space 4 0x0014, the write as above, HM2Timeout = t, read of the wait
 *             register, HM2Timeout = 0, the rest of the request
 *   reply:    windows of rank ARRIVAL, number of the write before this one, microseconds waited, the rest of the reply
 *
 * After freeze, all functions are realtime safe. One thread at a time.
 */
#ifndef HM2_PLAN_H
#define HM2_PLAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/bytes.h>
#include <hm2/err.h>
#include <hm2/lbp16.h>

#define HM2_PLAN_MAX_WINDOWS  128u /* in each direction */
#define HM2_PLAN_MAX_SECTIONS 160u
#define HM2_PLAN_SETUP_BYTES  6144u

/* Order inside a packet; the FPGA processes a packet from front to back. Equal ranks: by address (windows) or in the
 * order of registration (sections). Only windows of one rank and with adjacent addresses share a command. */
enum hm2_rank {
    HM2_RANK_ARRIVAL, /* reads: the moment counts at which the datagram reaches the card; see hm2_plan_turn() */
    HM2_RANK_FIRST,
    HM2_RANK_EARLY,
    HM2_RANK_NORMAL,
    HM2_RANK_LATE,
    HM2_RANK_LAST
};

/* A run of 32-bit registers inside a cyclic packet. Lives in its module's memory and must not move. */
struct hm2_window {
    uint8_t *bytes;   /* word 0 inside the packet; valid after freeze */
    uint8_t *address; /* 16-bit address field of its command, for queues and windows added with movable */
    uint16_t words;
};

static inline uint32_t hm2_window_get(const struct hm2_window *const window, const unsigned word)
{
    return hm2_get_le32(window->bytes + 4u * word);
}

static inline void hm2_window_set(struct hm2_window *const window, const unsigned word, const uint32_t value)
{
    hm2_put_le32(window->bytes + 4u * word, value);
}

struct hm2_plan;

/* One set-up command: rarely written registers. Lives in its module's memory and must not move. */
struct hm2_section {
    struct hm2_plan *plan;
    uint8_t *bytes; /* word 0 inside the prepared command */
    uint16_t words;
    uint16_t number; /* in the plan */
};

enum hm2_section_flags {
    HM2_SECTION_FIFO = 1,      /* all words go to the same address (no increment) */
    HM2_SECTION_ON_DEMAND = 2, /* sent only after hm2_section_touch(), never by hm2_plan_touch_all() */
};

/* What became of a received datagram. */
enum hm2_reply {
    HM2_REPLY_FRESH,     /* answers the outstanding request: decode it */
    HM2_REPLY_STALE,     /* answers a request that was answered already (a duplicate) */
    HM2_REPLY_LATE,      /* answers a request that had been given up, for the first time */
    HM2_REPLY_MALFORMED, /* wrong length or a sequence number never sent */
};

/* About 24 KiB of the caller's memory: hm2_plan_size() bytes, aligned as malloc() does it. hm2_plan_init() makes an
 * empty plan of whatever they hold. session is a number that earlier programs are not likely to have used (time,
 * random); 0 and 0xFFFFFFFF, which a card without memory of us might show, are replaced. */
HM2_API size_t hm2_plan_size(void);
HM2_API void hm2_plan_init(struct hm2_plan *plan, uint32_t session);

/* Add 1..127 registers, read or written in every cycle. HM2_ERR_RANGE for an impossible address or number,
 * HM2_ERR_NOSPACE when the plan is full, HM2_ERR_STATE after freeze; diag says which. window->bytes is NULL until
 * freeze. Reads may overlap. */
HM2_API int HM2_MUST_CHECK hm2_plan_add_read(struct hm2_plan *plan, struct hm2_window *window, enum hm2_rank rank,
                                             uint16_t address, unsigned words, struct hm2_diag *diag);
/* The same for one word whose address the module changes from cycle to cycle (never merged, behind all other reads).
 * The address is 0 at first and goes to window->address with hm2_put_le16(). */
HM2_API int HM2_MUST_CHECK hm2_plan_add_read_movable(struct hm2_plan *plan, struct hm2_window *window,
                                                     struct hm2_diag *diag);
HM2_API int HM2_MUST_CHECK hm2_plan_add_write(struct hm2_plan *plan, struct hm2_window *window, enum hm2_rank rank,
                                              uint16_t address, unsigned words, struct hm2_diag *diag);
/* The same for words that all go to one register, or come from one, in order: FIFOs. Queues are never merged, come
 * behind everything else and keep the order in which they were added, so a packet carries out what was arranged. The
 * address may change from cycle to cycle, which makes a fixed list skip: reads of a register without side effects, and
 * writes to HM2_PLAN_NOWHERE, do nothing. */
#define HM2_PLAN_NOWHERE 0x0100u /* the cookie is read-only (register map 1.2) */
HM2_API int HM2_MUST_CHECK hm2_plan_add_queue_read(struct hm2_plan *plan, struct hm2_window *window, uint16_t address,
                                                   unsigned words, struct hm2_diag *diag);
HM2_API int HM2_MUST_CHECK hm2_plan_add_queue_write(struct hm2_plan *plan, struct hm2_window *window, uint16_t address,
                                                    unsigned words, struct hm2_diag *diag);
/* Add 1..127 set-up registers (flags: enum hm2_section_flags). They are zero, and will be sent so when nothing else is
 * stored before the first write, unless HM2_SECTION_ON_DEMAND. */
HM2_API int HM2_MUST_CHECK hm2_plan_add_setup(struct hm2_plan *plan, struct hm2_section *section, enum hm2_rank rank,
                                              uint16_t address, unsigned words, unsigned flags, struct hm2_diag *diag);
/* Lay the packets out. HM2_ERR_NOSPACE, with the sizes in diag, when a datagram would become too long;
 * HM2_ERR_MISMATCH when two windows write the same register with the same rank. */
HM2_API int HM2_MUST_CHECK hm2_plan_freeze(struct hm2_plan *plan, struct hm2_diag *diag);

/* Before freeze: turns will be made, which wait for DPLL timer 1..4. HM2_ERR_RANGE for another timer. */
HM2_API int HM2_MUST_CHECK hm2_plan_pipeline(struct hm2_plan *plan, unsigned timer, struct hm2_diag *diag);
/* After freeze: turns were asked for and are possible. They are not when write and request do not fit into one
 * datagram, or when there are queues to be read: their words answer writes that need more time than the card waits. */
HM2_API bool hm2_plan_pipelines(const struct hm2_plan *plan);

/* After freeze: windows and sections can be added once more, then freeze again. Nothing may use the plan in between; a
 * request that is outstanding is given up. Words in windows and what is known of the sections stay. When the second
 * freeze fails, no cycle can be run any more. */
HM2_API void hm2_plan_reopen(struct hm2_plan *plan);

/* Store a word; a section that is not on demand becomes dirty when the word differs from what it held. From
 * hm2_plan_add_setup() on, also before freeze. word < section->words. */
HM2_API void hm2_section_set(struct hm2_section *section, unsigned word, uint32_t value);
HM2_API uint32_t hm2_section_get(const struct hm2_section *section, unsigned word);
/* Send it with the next write, changed or not. */
HM2_API void hm2_section_touch(struct hm2_section *section);
/* Give the section another address (its words count as changed): for registers that a person chooses. The card
 * ignores the lowest two bits. */
HM2_API void hm2_section_move(struct hm2_section *section, uint16_t address);
/* True when the card has confirmed that it received the words as they stand. */
HM2_API bool hm2_section_confirmed(const struct hm2_section *section);
/* True when the card has confirmed every section as it stands, and its session number: nothing is on its way. */
HM2_API bool hm2_plan_settled(const struct hm2_plan *plan);
/* Everything again: the card lost its state (then the session number too) or a person cleared a fault. Sections on
 * demand are left as they are. */
HM2_API void hm2_plan_touch_all(struct hm2_plan *plan);

/* Request for this cycle (next sequence number). The pointer stays valid until the next call. A request that is still
 * outstanding is given up. */
HM2_API const uint8_t *hm2_plan_request(struct hm2_plan *plan, size_t *len);
/* The request that is outstanding, to be sent once more: whichever reply comes first is FRESH, the other STALE. NULL
 * when the plan reads what goes away by being read, or may: queues, and registers that are chosen in the cycle. */
HM2_API const uint8_t *hm2_plan_request_again(const struct hm2_plan *plan, size_t *len);
/* Buffer to receive into: hm2_plan_reply_capacity() bytes, larger than a good reply so that a long one is noticed. */
HM2_API uint8_t *hm2_plan_reply_buffer(struct hm2_plan *plan);
HM2_API size_t hm2_plan_reply_capacity(const struct hm2_plan *plan);
HM2_API size_t hm2_plan_reply_bytes(const struct hm2_plan *plan);
/* Judge the len bytes in the buffer. Only a FRESH reply reaches the windows, which keep the last one through whatever
 * else arrives; it also settles the set-up sections: confirmed or dirty again. A datagram that did not fit into the
 * buffer may be judged with any len above hm2_plan_reply_bytes(). */
HM2_API enum hm2_reply hm2_plan_judge(struct hm2_plan *plan, size_t len);
/* Requests made so far: the next one is one more. For modules whose reads take something away (FIFOs) and must know a
 * late reply as the answer to theirs. */
HM2_API uint64_t hm2_plan_requests(const struct hm2_plan *plan);
/* Before the request that was answered last: what more had come to the card than was made, modulo 2^16. From one reply
 * to the next this rises by what came twice or from somebody else, and falls by what was lost. Turns are requests;
 * those that are made again are not counted. For plans that read queues, and right after FRESH. */
struct hm2_plan_tally {
    uint16_t requests, writes;
    uint16_t answered; /* replies that the card had sent */
};
HM2_API struct hm2_plan_tally hm2_plan_tally(const struct hm2_plan *plan);
/* Right after hm2_plan_judge() said LATE: the number of the request it answers. 0 when its words cannot be used,
 * because it is too old (64 requests), was made before hm2_plan_reopen(), or the card had made it before the last FRESH
 * one. The same after it said STALE, when the card has carried the request out once more; 0 when only its reply came
 * twice. */
HM2_API uint64_t hm2_plan_late_request(const struct hm2_plan *plan);
/* Then: the read windows show the late reply until the next call, which brings the last fresh one back. */
HM2_API void hm2_plan_swap_late(struct hm2_plan *plan);
/* The outstanding request is given up; a reply that still comes counts as LATE. */
HM2_API void hm2_plan_give_up(struct hm2_plan *plan);

/* Facts of the last FRESH reply; true, true, 0 before the first. */
struct hm2_plan_facts {
    bool write_confirmed; /* the card had carried out our last write when it read (true when none was sent yet) */
    bool session_kept;    /* false: the card lost its scratch registers, i.e. its power or its firmware. False from
                           * then on, until hm2_plan_touch_all() */
    uint16_t card_rx_udp; /* UDP packets the card has received, modulo 2^16 */
    uint16_t waited_us;   /* how long the card has waited for its timer; 0 for the reply to a plain request */
    bool before_kept;     /* the reply to a turn: when it came, our write before it was the last one carried out. False:
                           * that one was lost, or an older one has overtaken it; also for the reply to a plain request */
};
HM2_API struct hm2_plan_facts hm2_plan_facts(const struct hm2_plan *plan);

/* Write datagram for this cycle: fixed part, then the dirty part of the set-up stream as far as it fits, then the
 * sequence number. What did not fit stays dirty for the next cycle, in order. The pointer stays valid until the next
 * call. */
HM2_API const uint8_t *hm2_plan_write(struct hm2_plan *plan, size_t *len);
/* hm2_plan_write() and hm2_plan_request() in one datagram, when hm2_plan_pipelines(). The card carries the write out,
 * waits for the rising edge of its timer, at most timeout_us, and answers. A fresh reply therefore confirms the write.
 * The pointer stays valid until the next call. */
HM2_API const uint8_t *hm2_plan_turn(struct hm2_plan *plan, uint16_t timeout_us, size_t *len);
/* The write could not be sent: its sections are dirty again. */
HM2_API void hm2_plan_write_failed(struct hm2_plan *plan);

/* Sizes for listings and tests. Commands and bytes of the set-up stream are those of the sections; write_bytes is the
 * write datagram of a cycle without changes. */
struct hm2_plan_sizes {
    size_t request_bytes, reply_bytes, write_bytes, setup_bytes;
    unsigned read_commands, write_commands, sections;
};
HM2_API struct hm2_plan_sizes hm2_plan_sizes(const struct hm2_plan *plan);

#endif
