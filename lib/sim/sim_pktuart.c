/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "sim_pktuart.h"

static const struct pkt_traits generations[] = {
    {.rate_bits = 20, .drives_gap = true},
    {.rate_bits = 20, .parity = true, .filter = true, .waits_with_count = true, .drives_gap = true},
    {.rate_bits = 24,
     .parity = true,
     .filter = true,
     .waits_with_count = true,
     .wide_filter = true,
     .guards_pops = true},
};

#define GENERATIONS (sizeof generations / sizeof generations[0])

const struct pkt_traits *pkt_traits(const struct sim_module *const m)
{
    return &generations[m->md.version < GENERATIONS ? m->md.version : GENERATIONS - 1u];
}

unsigned pkt_instances(const struct sim_module *const m)
{
    return m->md.instances < PKT_INSTANCES_MAX ? m->md.instances : PKT_INSTANCES_MAX;
}

bool pkt_odd(uint32_t byte)
{
    bool odd = false;
    for (; byte; byte >>= 1)
        odd ^= byte & 1u;
    return odd;
}

static void couple(const struct sim_module *const tx, struct sim_module *const rx)
{
    for (unsigned i = 0; i < pkt_instances(tx) && i < pkt_instances(rx); i++)
        pkt_rx_mask(rx, i, pkt_tx_drives(tx, i));
}

static const struct serial_pair pair = {HM2_GTAG_PKTUART_TX, HM2_GTAG_PKTUART_RX, pkt_tx_step,
                                        pkt_tx_event,        pkt_rx_step,         couple};

void pkt_advance(struct sim_module *const m, const int64_t clk)
{
    serial_pair_advance(&pair, m, clk);
}
