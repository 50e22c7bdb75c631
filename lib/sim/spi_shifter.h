/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The shift register that the SPI modules have in common: one word out and in, MSB first, in any clock mode (traces
 * tests/data/bspi and tests/data/spi).
 */
#ifndef SIM_SPI_SHIFTER_H
#define SIM_SPI_SHIFTER_H

#include <stdbool.h>
#include <stdint.h>

struct spi_shifter {
    /* settings, of the owner */
    uint8_t bits;    /* minus one; from 32 on nothing is shifted */
    uint8_t divider; /* half a bit is divider + 1 clocks */
    bool cpol, cpha, sample_late, keep_frame;
    /* state */
    uint32_t word;
    uint8_t left;  /* bits minus one, six bits: the top one is set when they have run out */
    uint8_t ticks; /* clocks before the next edge of the bit clock */
    bool clock, busy, frame, first, latch;
    bool input; /* MISO */
};

void spi_shifter_start(struct spi_shifter *shifter, uint32_t word);
/* As the FIFO's clear does: the word is given up. */
void spi_shifter_abort(struct spi_shifter *shifter);
/* One edge while busy: true when the word is complete now. */
bool spi_shifter_edge(struct spi_shifter *shifter);

static inline bool spi_shifter_mosi(const struct spi_shifter *const shifter)
{
    return (shifter->word >> (shifter->bits & 31u) & 1u) != 0;
}

#endif
