/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "tram.h"

#define TABLE        0x7800u
#define WINDOW       0x7C00u
#define WINDOW_BYTES 0x100u
#define STROBE       0x8000u /* of a word: this byte's access makes the 32-bit one */
#define ADDRESS      0x7FFFu
#define ACCESS_CLK   10 /* between two bytes; the traces do not depend on it */
#define BYTE_BITS    8u
#define LAST_LANE    3u

static uint32_t put_byte(const uint32_t word, const unsigned lane, const uint8_t byte)
{
    return (word & ~((uint32_t)0xFF << lane * BYTE_BITS)) | (uint32_t)byte << lane * BYTE_BITS;
}

/* The register bus has whole words. */
static uint16_t word_at(const uint16_t address)
{
    return (uint16_t)(address & ~LAST_LANE);
}

/* Where an access from the window on really goes. Behind the window the address stays, but the words still strobe. */
static uint16_t translate(const struct sim_tram *const tram, const uint16_t address, bool *const strobe)
{
    const uint16_t word = tram->word[(address - WINDOW) % SIM_TRAM_WORDS];
    *strobe = word & STROBE;
    return address < WINDOW + WINDOW_BYTES ? word & ADDRESS : address;
}

void sim_tram_write(struct sim_tram *const tram, const uint16_t address, const uint8_t byte)
{
    bool strobe = address % 4 == LAST_LANE;
    uint16_t to = address;
    /* A byte that is written to the table stores what the latch held before it. */
    if (address >= TABLE && address < WINDOW)
        tram->word[(address - TABLE) / 4] = (uint16_t)tram->write_latch;
    if (address >= WINDOW)
        to = translate(tram, address, &strobe);
    tram->write_latch = put_byte(tram->write_latch, to % 4, byte);
    tram->clk += ACCESS_CLK;
    if (strobe && (address < TABLE || address >= WINDOW))
        sim_card_write(tram->card, tram->clk, word_at(to), tram->write_latch);
}

static uint8_t read_table(const struct sim_tram *const tram, const uint16_t address, uint8_t *const undriven)
{
    const unsigned lane = address % 4;
    const uint32_t word = tram->word[(address - TABLE) / 4]; /* 16 bits: the upper two bytes are driven by nothing */
    *undriven = lane < 2 ? 0 : 0xFF;
    return (uint8_t)(word >> lane * BYTE_BITS);
}

uint8_t sim_tram_read(struct sim_tram *const tram, const uint16_t address, uint8_t *const undriven)
{
    bool strobe = address % 4 == 0;
    uint16_t from = address;
    tram->clk += ACCESS_CLK;
    if (address >= TABLE && address < WINDOW)
        return read_table(tram, address, undriven);
    if (address >= WINDOW)
        from = translate(tram, address, &strobe);
    if (strobe)
        tram->read_latch = sim_card_read(tram->card, tram->clk, word_at(from), &tram->undriven);
    *undriven = (uint8_t)(tram->undriven >> from % 4 * BYTE_BITS);
    return (uint8_t)(tram->read_latch >> from % 4 * BYTE_BITS);
}
