/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * How much the receiver of a PktUART can hold at most.
 *
 * Its firmware tells nobody when the buffer runs over: words that were not read are overwritten, and sizes and words
 * add up as ever. A size counts to 1023 and then from 0 again, unnoticed as well. So the driver goes by the time since
 * the last frame of known size: more than the line can bring in it cannot be there.
 */
#ifndef HM2_MODULE_PKTUART_CROWD_H
#define HM2_MODULE_PKTUART_CROWD_H

#include <stdbool.h>
#include <stdint.h>

#define PKT_BUFFER_WORDS  255u /* with one more bit 21 of the mode reads as if there were none */
#define PKT_MODE_FRAMES   31u  /* most that the mode can show */
#define PKT_FRAME_MODULUS 1024u

/* What a reply tells. */
struct pkt_sight {
    int64_t sent_ns, received_ns;
    unsigned taken, frames; /* sizes that came with it; frames whose sizes are still in the card */
    bool still;             /* the line rests, and all sizes have been taken */
    bool cleared;           /* since the request before, or not yet */
};

struct pkt_crowd {
    double words_per_ns;               /* that the line can bring, but for the ends of frames */
    int64_t known_ns;                  /* what came before belongs to frames of known size */
    int64_t before_ns;                 /* the request before */
    int64_t ended_ns[PKT_MODE_FRAMES]; /* frames of unknown size ended then or later, oldest first */
    unsigned frames;
    int64_t begun_ns; /* how long a frame that is seen first has been under way, at most that is counted */
    bool runs;
    int64_t run_ns, run_seen_ns; /* one frame was under way from then to then, at least */
};

void pkt_crowd_init(struct pkt_crowd *crowd, uint32_t baud, bool parity);
void pkt_crowd_see(struct pkt_crowd *crowd, const struct pkt_sight *sight);
/* Words of unknown frames that can be in the card at a time, and bytes that those had. */
unsigned pkt_crowd_words(const struct pkt_crowd *crowd, int64_t now_ns);
/* A frame is longer than its size can tell. */
bool pkt_crowd_is_endless(const struct pkt_crowd *crowd);

#endif
