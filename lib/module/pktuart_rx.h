/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The receiver of a PktUART: frames out of the card, also around a reply that got lost. */
#ifndef HM2_MODULE_PKTUART_RX_H
#define HM2_MODULE_PKTUART_RX_H

#include "pktuart_crowd.h"
#include "serial.h"

#define PKT_RX_FRAMES     64u
#define PKT_RX_HOLD_WORDS 512u

/*
 * A reply with sizes or words of frames was lost, or the request for it: which words belong to which frame is not known
 * until the line rests and everything that the card had is here. Then what is missing follows from the difference, as a
 * request asks for sizes or for words, never both.
 */
struct pkt_hunt {
    bool on;
    unsigned losses, lost_sizes, lost_words; /* replies; what they were to bring */
    unsigned known_words, known_bytes;       /* of frames whose size is known */
    unsigned taken_words;
    int surplus;      /* the card has had at least so many words more than known ones, or less when negative */
    unsigned lost_at; /* words of the frames in front of those with the lost sizes */
    unsigned vain;    /* replies in a row from which nothing new was learnt */
    unsigned held;
    uint32_t hold[PKT_RX_HOLD_WORDS];
};

/* More words than the buffer holds can have come. Those at hand are held, and no more asked for, until the sizes show
 * how many there were. */
struct pkt_doubt {
    bool on;
    unsigned awaited;    /* sizes that decide */
    unsigned most_bytes; /* that came with frames of unknown size */
    unsigned known_bytes;
};

struct pkt_rx {
    struct queue data, counts;
    struct hm2_window state;
    uint32_t mode; /* as seen last */
    bool still;    /* no frame was under way then */
    bool clearing;
    bool skips; /* the oldest frame is the first after a clear: its beginning may be missing */
    unsigned asked_words, asked_counts;
    unsigned popped_words, popped_counts; /* by the request that was answered last */
    uint64_t popped_request;              /* that one, and */
    uint64_t unheard_request;             /* one that had not come when a later one was answered */
    uint64_t request;                     /* in which they were asked for */
    int64_t request_ns;
    bool unanswered; /* it was given up: nothing more is asked for until its reply is late or a later one shows that it
                      * is lost */
    bool words_next;
    unsigned first, frames; /* whose size is known, oldest first; a ring */
    uint16_t size[PKT_RX_FRAMES];
    bool bad[PKT_RX_FRAMES]; /* received with an error */
    unsigned kept;           /* bytes of the oldest that the port has already */
    bool spoilt;             /* some are missing */
    struct pkt_hunt hunt;
    struct pkt_crowd crowd;
    struct pkt_doubt doubt;
};

int pkt_rx_add(struct pkt_rx *rx, const struct hm2_serial *port, struct hm2_diag *diag);
/* The card's buffers are cleared: what was known to be there is lost. */
void pkt_rx_forget(struct pkt_rx *rx, struct hm2_serial *port);
void pkt_rx_miss(struct pkt_rx *rx);
/* Clear them in the midst of traffic. What they hold, and the frame that is cut, are counted as the most that they can
 * be. */
void pkt_rx_clear(struct pkt_rx *rx, struct hm2_serial *port);
enum pkt_rx_health { PKT_RX_GOOD, PKT_RX_LOST, PKT_RX_OVERRUN };
/* A reply. Unless it is good the receiver must be cleared: sizes and words do not belong together for certain. */
enum pkt_rx_health pkt_rx_take(struct pkt_rx *rx, struct hm2_serial *port);
/* False when something was taken that nobody counts on. */
bool pkt_rx_late(struct pkt_rx *rx, struct hm2_serial *port, uint64_t request);
/* Words that the card's buffer may hold now, at most. */
unsigned pkt_rx_most_words(const struct pkt_rx *rx, int64_t now_ns);
void pkt_rx_ask(struct pkt_rx *rx, const struct hm2_serial *port, bool ready);

#endif
