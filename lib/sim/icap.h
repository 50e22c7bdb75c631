/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The register through which a packet makes the FPGA load itself again (flash tool reference 3.13). */
#ifndef SIM_ICAP_H
#define SIM_ICAP_H

#include <stdbool.h>
#include <stdint.h>

struct sim_icap {
    bool reload;    /* asked for */
    uint32_t start; /* Xilinx: the address to load from */
    unsigned image; /* Efinix: its number, 0 = fallback, 1 = user */

    unsigned sync_step;
    bool synced, in_register;
    unsigned reg;
    uint16_t general[2];
};

void sim_icap_write(struct sim_icap *icap, bool efinix, uint16_t word);

#endif
