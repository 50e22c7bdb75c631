/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The transfer plan: which registers travel in every cycle, at offsets fixed for good.
 *
 * At set-up every module adds the register windows it reads and writes each cycle and the sections it writes rarely.
 * hm2_plan_freeze() sorts and merges the windows into LBP16 commands once and lays out one request, one reply and
 * one write datagram. From then on a window *is* the bytes inside the packet: modules store words straight into the
 * outgoing packet and load them straight from the received one. Lengths never change, except that changed set-up
 * sections follow the fixed part of the write datagram in the very cycle in which one of their words changed.
 *
 * Proof of freshness: every request writes its sequence number to the card's scratch registers (space 4, 0x0010) and
 * reads it back, together with the sequence number of the last write (0x0014), a session number that a power cycle
 * erases (0x0018), and the card's count of received UDP packets (space 6, 0x000A).
 *
 * Set-up sections are resent until the card has confirmed the write that carried them.
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

#define HM2_PLAN_MAX_WINDOWS  128u
#define HM2_PLAN_MAX_SECTIONS 160u
#define HM2_PLAN_SETUP_BYTES  4096u

/* Order inside a packet; the FPGA processes a packet from front to back. Equal ranks: by address (windows) or in the
 * order of registration (sections). */
enum hm2_rank { HM2_RANK_FIRST = 0, HM2_RANK_EARLY = 1, HM2_RANK_NORMAL = 2, HM2_RANK_LATE = 3, HM2_RANK_LAST = 4 };

/* A run of 32-bit registers inside a cyclic packet. Lives in its module's memory and must not move. */
struct hm2_window {
    uint8_t *bytes;   /* word 0 inside the packet; valid after freeze */
    uint8_t *address; /* 16-bit address field of its command inside the request, for windows added with movable */
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
    HM2_REPLY_LATE,      /* answers a request that had been given up */
    HM2_REPLY_MALFORMED, /* wrong length or a sequence number never sent */
};

/* About 16 KiB; caller's memory. Zero it, then hm2_plan_init(). */
struct hm2_plan *hm2_plan_place(void *memory, size_t size);
HM2_API size_t hm2_plan_size(void);
HM2_API void hm2_plan_init(struct hm2_plan *plan, uint32_t session);

HM2_API int HM2_MUST_CHECK hm2_plan_add_read(struct hm2_plan *plan, struct hm2_window *window, enum hm2_rank rank,
                                             uint16_t address, unsigned words, struct hm2_diag *diag);
/* The same for one word whose address the module changes from cycle to cycle (never merged). */
HM2_API int HM2_MUST_CHECK hm2_plan_add_read_movable(struct hm2_plan *plan, struct hm2_window *window,
                                                     struct hm2_diag *diag);
HM2_API int HM2_MUST_CHECK hm2_plan_add_write(struct hm2_plan *plan, struct hm2_window *window, enum hm2_rank rank,
                                              uint16_t address, unsigned words, struct hm2_diag *diag);
HM2_API int HM2_MUST_CHECK hm2_plan_add_setup(struct hm2_plan *plan, struct hm2_section *section, enum hm2_rank rank,
                                              uint16_t address, unsigned words, unsigned flags, struct hm2_diag *diag);
/* Lay the packets out. HM2_ERR_NOSPACE, with the sizes in diag, when a datagram would become too long. */
HM2_API int HM2_MUST_CHECK hm2_plan_freeze(struct hm2_plan *plan, struct hm2_diag *diag);

/* Store a word; the section becomes dirty when the word differs from what it held. Works before freeze too only
 * after hm2_plan_add_setup() returned. */
HM2_API void hm2_section_set(struct hm2_section *section, unsigned word, uint32_t value);
HM2_API uint32_t hm2_section_get(const struct hm2_section *section, unsigned word);
HM2_API void hm2_section_touch(struct hm2_section *section);
/* Give the section another address (its words count as changed): for registers that a person chooses. */
HM2_API void hm2_section_move(struct hm2_section *section, uint16_t address);
/* True when the card has confirmed that it received the words as they stand. */
HM2_API bool hm2_section_confirmed(const struct hm2_section *section);
/* Everything again: the card lost its state or a person cleared a fault. */
HM2_API void hm2_plan_touch_all(struct hm2_plan *plan);

/* Request for this cycle (next sequence number). The pointer stays valid until the next call. */
HM2_API const uint8_t *hm2_plan_request(struct hm2_plan *plan, size_t *len);
/* Buffer to receive into: hm2_plan_reply_capacity() bytes, larger than a good reply so that a long one is noticed. */
HM2_API uint8_t *hm2_plan_reply_buffer(struct hm2_plan *plan);
HM2_API size_t hm2_plan_reply_capacity(const struct hm2_plan *plan);
HM2_API size_t hm2_plan_reply_bytes(const struct hm2_plan *plan);
/* Judge what was received. FRESH also settles the set-up sections: confirmed or dirty again. */
HM2_API enum hm2_reply hm2_plan_judge(struct hm2_plan *plan, size_t len);
/* The outstanding request is given up; a reply that still comes counts as LATE. */
HM2_API void hm2_plan_give_up(struct hm2_plan *plan);

/* Facts of the last FRESH reply. */
struct hm2_plan_facts {
    bool write_confirmed; /* the card has seen our last write (true when none was sent yet) */
    bool session_kept;    /* false: the card lost its scratch registers, i.e. its power or its firmware */
    uint16_t card_rx_udp; /* UDP packets the card has received, modulo 2^16 */
};
HM2_API struct hm2_plan_facts hm2_plan_facts(const struct hm2_plan *plan);

/* Write datagram for this cycle: fixed part, then dirty sections as far as they fit, then the sequence number. What
 * did not fit stays dirty for the next cycle. */
HM2_API const uint8_t *hm2_plan_write(struct hm2_plan *plan, size_t *len);
/* The write could not be sent: its sections are dirty again. */
HM2_API void hm2_plan_write_failed(struct hm2_plan *plan);

/* Sizes for listings and tests. */
struct hm2_plan_sizes {
    size_t request_bytes, reply_bytes, write_bytes, setup_bytes;
    unsigned read_commands, write_commands, sections;
};
HM2_API struct hm2_plan_sizes hm2_plan_sizes(const struct hm2_plan *plan);

#endif
