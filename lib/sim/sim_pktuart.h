/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What transmitter and receiver of the packet UART share. */
#ifndef SIM_PKTUART_H
#define SIM_PKTUART_H

#include "serial_line.h"
#include "srl_fifo.h"

#define PKT_INSTANCES_MAX 16u
#define PKT_BUFFER_WORDS  256u
#define PKT_COUNT_MASK    0x3FFu
#define PKT_NO_LOAD       (1u << 31)
#define PKT_CLEAR         (1u << 16)
#define PKT_PARITY        (1u << 17)
#define PKT_ODD           (1u << 18)
#define PKT_MODE_BITS     0x7FFFFu

enum { PKT_PAGE_DATA, PKT_PAGE_COUNT, PKT_PAGE_RATE, PKT_PAGE_MODE, PKT_PAGES };

/* Generations of the firmware, by the version in the module's descriptor: 0 is the source of tests/data/pktuart, 1 that
 * of tests/data/pktuart_new; 2 and later have wider registers (register map 3.13). */
struct pkt_traits {
    unsigned rate_bits;
    bool parity, filter, waits_with_count; /* a count stays in the FIFO until the drive is enabled */
    bool wide_filter, guards_pops;         /* filter of 16 bits; a pop of no data is refused and noted */
    bool drives_gap;                       /* automatic drive enable lasts through the gap between frames */
};

const struct pkt_traits *pkt_traits(const struct sim_module *m);
unsigned pkt_instances(const struct sim_module *m);
bool pkt_odd(uint32_t byte);

void pkt_tx_step(struct sim_module *m, int64_t clk);
int64_t pkt_tx_event(struct sim_module *m);
bool pkt_tx_drives(const struct sim_module *m, unsigned unit);
void pkt_rx_step(struct sim_module *m, int64_t clk);
void pkt_rx_mask(struct sim_module *m, unsigned unit, bool masked);
void pkt_advance(struct sim_module *m, int64_t clk);

#endif
