/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pktuart_crowd.h"

#include <string.h>

#define WORD_BYTES  4.0
#define FASTEST     1.0625 /* a peer's clock that is off by more is not understood */
#define NS_PER_S    1e9
#define WORDS_MAX   1e6  /* of a receiver that nobody has looked at for long */
#define BEGUN_WORDS 32.0 /* a frame that is seen first has had no more of them, for what can be known */
#define FRAME_WORDS (PKT_FRAME_MODULUS / 4.0)

void pkt_crowd_init(struct pkt_crowd *const crowd, const uint32_t baud, const bool parity)
{
    const double bits_a_word = WORD_BYTES * (parity ? 11.0 : 10.0); /* start and stop bits included */
    crowd->words_per_ns = baud * FASTEST / (bits_a_word * NS_PER_S);
    crowd->begun_ns = (int64_t)(BEGUN_WORDS / crowd->words_per_ns);
}

static void drop(struct pkt_crowd *const crowd, const unsigned frames)
{
    crowd->frames -= frames;
    memmove(crowd->ended_ns, crowd->ended_ns + frames, crowd->frames * sizeof crowd->ended_ns[0]);
}

/* With a lost reply went sizes: then the oldest are forgotten, which makes the others older than they are. */
static void see_frames(struct pkt_crowd *const crowd, const struct pkt_sight *const sight)
{
    if (sight->taken > 0 && sight->taken <= crowd->frames) {
        crowd->known_ns = crowd->ended_ns[sight->taken - 1u];
        drop(crowd, sight->taken);
    }
    if (crowd->frames > sight->frames)
        drop(crowd, crowd->frames - sight->frames);
    while (crowd->frames < sight->frames && crowd->frames < PKT_MODE_FRAMES)
        crowd->ended_ns[crowd->frames++] = crowd->before_ns;
    if (sight->still)
        crowd->known_ns = sight->sent_ns;
}

void pkt_crowd_see(struct pkt_crowd *const crowd, const struct pkt_sight *const sight)
{
    see_frames(crowd, sight);
    if (sight->cleared)
        crowd->known_ns = crowd->before_ns;
    const bool runs = !sight->still && !sight->cleared && sight->taken == 0 && sight->frames == 0;
    if (!runs)
        crowd->run_ns = sight->received_ns;
    else if (!crowd->runs && crowd->run_ns < sight->received_ns - crowd->begun_ns)
        crowd->run_ns = sight->received_ns - crowd->begun_ns;
    crowd->runs = runs;
    crowd->run_seen_ns = sight->sent_ns;
    crowd->before_ns = sight->sent_ns;
}

static double words_in(const struct pkt_crowd *const crowd, const int64_t ns)
{
    return ns > 0 ? (double)ns * crowd->words_per_ns : 0.0;
}

/* The last word of each frame, and of the one that is under way, need not be full. */
unsigned pkt_crowd_words(const struct pkt_crowd *const crowd, const int64_t now_ns)
{
    const double words = words_in(crowd, now_ns - crowd->known_ns);
    return (unsigned)(words < WORDS_MAX ? words : WORDS_MAX) + 1u + crowd->frames + 1u;
}

bool pkt_crowd_is_endless(const struct pkt_crowd *const crowd)
{
    return words_in(crowd, crowd->run_seen_ns - crowd->run_ns) > FRAME_WORDS * FASTEST;
}
