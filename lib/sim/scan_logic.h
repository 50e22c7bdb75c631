/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The input scanner that InM and InMux have in common (register map 3.17): one input after the other is sampled,
 * filtered by an up/down counter of its own, and the first eight feed four MPG counters.
 *
 * Every fourth edge of ClockLow is a tick of the prescaler, the first one right after configuration; every
 * divisor + 1 ticks one input is looked at, from MaxBit down to 0. Quiet time is skipped, not counted.
 */
#ifndef SIM_SCAN_LOGIC_H
#define SIM_SCAN_LOGIC_H

#include <stdbool.h>
#include <stdint.h>

#define SCAN_INPUTS 32u
#define SCAN_MPGS   4u

struct scanner {
    unsigned width;   /* inputs */
    bool multiplexed; /* InMux: one data pin, sampled behind a glitch filter */
    uint32_t outside; /* levels of the inputs, before the inversion */
    uint32_t control; /* register 0 */
    uint32_t slow;    /* register 1: inputs that use the slow count */
    uint32_t raw, filtered;
    uint16_t counts[SCAN_INPUTS];
    uint8_t mpg[SCAN_MPGS], mpg_mode, mpg_seen;

    int64_t start;          /* edge of the first prescaler tick */
    int64_t clk;            /* edges before this have been made */
    uint16_t ticks_left;    /* prescaler ticks to let pass before the next look */
    uint8_t address, index; /* of the next input, and of the one that is looked at */
    bool data_late;         /* InMux: the data pin a clock ago, */
    uint8_t glitch;         /* its filter, */
    bool data, sampled;     /* what the filter shows, and what the last look took */
};

void scan_power_up(struct scanner *s, int64_t clk);
void scan_advance(struct scanner *s, int64_t clk);
/* Make edge s->clk with a register write in it. page: 0 control, 1 filter select, 4 MPG modes. */
void scan_write(struct scanner *s, unsigned page, uint32_t value);
uint32_t scan_read(const struct scanner *s, unsigned page, uint32_t *undriven);
/* First edge at or after s->clk at which the scanner looks at an input. */
int64_t scan_next_look(const struct scanner *s);

#endif
