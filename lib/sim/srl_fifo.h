/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The sixteen-word FIFO that many modules are built from: a shift register that every push moves, and an address that
 * follows the oldest word. A push into a full one drops the oldest word; an empty one still shows an old word.
 */
#ifndef SIM_SRL_FIFO_H
#define SIM_SRL_FIFO_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define SRL_WORDS 16u

struct srl_fifo {
    uint64_t word[SRL_WORDS]; /* newest first */
    uint8_t at;               /* of the oldest word; 15 = none */
    uint8_t count;
};

static inline void srl_clear(struct srl_fifo *const fifo)
{
    fifo->at = SRL_WORDS - 1;
    fifo->count = 0;
}

/* False when it was full. */
static inline bool srl_push(struct srl_fifo *const fifo, const uint64_t word)
{
    memmove(fifo->word + 1, fifo->word, (SRL_WORDS - 1) * sizeof fifo->word[0]);
    fifo->word[0] = word;
    if (fifo->count == SRL_WORDS)
        return false;
    fifo->count++;
    fifo->at = (fifo->at + 1u) % SRL_WORDS;
    return true;
}

static inline uint64_t srl_oldest(const struct srl_fifo *const fifo)
{
    return fifo->word[fifo->at];
}

/* False when there were fewer. */
static inline bool srl_drop(struct srl_fifo *const fifo, const unsigned words)
{
    if (fifo->count < words)
        return false;
    fifo->count = (uint8_t)(fifo->count - words);
    fifo->at = (uint8_t)((fifo->at + SRL_WORDS - words) % SRL_WORDS);
    return true;
}

#endif
