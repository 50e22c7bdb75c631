/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "spi_shifter.h"

#define LEFT_BITS 0x3Fu
#define RUN_OUT   0x20u

void spi_shifter_start(struct spi_shifter *const s, const uint32_t word)
{
    s->word = word;
    s->left = s->bits;
    s->ticks = s->divider;
    s->busy = s->frame = s->first = true;
    s->clock = false;
}

void spi_shifter_abort(struct spi_shifter *const s)
{
    s->busy = s->frame = s->clock = false;
}

static void shift(struct spi_shifter *const s)
{
    s->word = s->word << 1 | (s->sample_late ? s->input : s->latch);
}

/* The clock was low: the leading edge of a bit, or the end. */
static bool lead(struct spi_shifter *const s)
{
    const bool end = (s->left & RUN_OUT) != 0;
    if (s->cpha && !s->first)
        shift(s);
    s->first = false;
    if (!end) {
        s->clock = true;
        return false;
    }
    s->busy = false;
    if (!s->keep_frame)
        s->frame = false;
    return true;
}

static void trail(struct spi_shifter *const s)
{
    s->clock = false;
    s->left = (uint8_t)(s->left - 1u) & LEFT_BITS;
    if (!s->cpha)
        shift(s);
}

bool spi_shifter_edge(struct spi_shifter *const s)
{
    bool complete = false;
    if (s->ticks > 0) {
        s->ticks--;
        return false;
    }
    s->ticks = s->divider;
    if (s->clock)
        trail(s);
    else
        complete = lead(s);
    s->latch = s->input; /* what was there at the edge before counts when it is shifted in */
    return complete;
}
