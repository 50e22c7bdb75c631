/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "high_clock.h"

#define PS_PER_S 1000000000000

__extension__ typedef __int128 wide;

int64_t sim_high_edges(const struct sim_card *const card, const int64_t clk, const bool with_same)
{
    const wide low_hz = sim_clock_low_hz(card), high_hz = sim_clock_high_hz(card);
    if (low_hz <= 0 || clk < 0)
        return 0;
    const wide twice = ((wide)2 * clk + 1) * high_hz - low_hz;
    if (twice < 0)
        return 0;
    return (int64_t)(with_same ? twice / (2 * low_hz) + 1 : (twice + 2 * low_hz - 1) / (2 * low_hz));
}

int64_t sim_high_edges_after(const struct sim_card *const card, const int64_t clk, const unsigned ps)
{
    int64_t edges = sim_high_edges(card, clk, true);
    unsigned at_ps = 0;
    while (sim_low_edge(card, edges, &at_ps) == clk && at_ps <= ps)
        edges++;
    return edges;
}

int64_t sim_low_edge(const struct sim_card *const card, const int64_t j, unsigned *const ps)
{
    const wide low_hz = sim_clock_low_hz(card), high_hz = sim_clock_high_hz(card);
    const wide twice = ((wide)2 * j + 1) * low_hz - high_hz;
    const wide k = twice >= 0 ? twice / (2 * high_hz) : -1;
    *ps = (unsigned)((((wide)2 * j + 1) * low_hz - ((wide)2 * k + 1) * high_hz) * PS_PER_S / (2 * low_hz * high_hz));
    return (int64_t)k;
}
