/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Host side of a card on an EPP bus: bytes, the latches that make words of them, and the address translation RAM
 * (traces tram). Ethernet cards have none; their firmware's descriptor of it (tag 0B) describes nothing.
 */
#ifndef SIM_TRAM_H
#define SIM_TRAM_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/sim.h>

#define SIM_TRAM_WORDS 256u

struct sim_tram {
    struct sim_card *card;
    int64_t clk; /* of the next access */
    uint16_t word[SIM_TRAM_WORDS];
    uint32_t write_latch, read_latch;
    uint32_t undriven; /* bits of the read latch that nothing drove */
};

/* All zeros but card and clk is the state after power-up. Addresses are of 15 bits. */
void sim_tram_write(struct sim_tram *tram, uint16_t address, uint8_t byte);
/* undriven gets 1 for each bit that nothing drives. */
uint8_t sim_tram_read(struct sim_tram *tram, uint16_t address, uint8_t *undriven);

#endif
