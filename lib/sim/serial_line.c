/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "serial_line.h"

#define BITS_PLAIN 10u /* start, eight of data, stop */

int64_t baud_quiet(const struct baud *const b, const bool up)
{
    const uint32_t low = b->accum & (b->top - 1u);
    if (b->before != baud_high(b))
        return 0;
    if (b->rate == 0)
        return SIM_NEVER;
    return (up ? b->top - 1u - low : low) / b->rate;
}

void baud_skip(struct baud *const b, const bool up, const int64_t edges)
{
    const uint32_t way = (uint32_t)((uint64_t)edges * b->rate);
    b->accum = (up ? b->accum + way : b->accum - way) & (2u * b->top - 1u);
}

uint64_t baud_bit_clk8(const struct baud *const b)
{
    return b->rate ? ((uint64_t)b->top << 9) / b->rate : 0;
}

/* ---- bytes from outside ------------------------------------------------------------------------------------------ */

bool serial_feed_level(const struct serial_feed *const feed)
{
    return !feed->sending || (feed->frame & 1u);
}

static unsigned ones(uint32_t byte)
{
    unsigned count = 0;
    for (; byte; byte >>= 1)
        count += byte & 1u;
    return count;
}

static void load(struct serial_feed *const feed, const struct baud *const rate)
{
    feed->bit_clk8 = baud_bit_clk8(rate);
    feed->sending = feed->head != feed->tail && feed->bit_clk8 > 0;
    if (!feed->sending)
        return;
    const uint32_t byte = feed->byte[feed->tail++ % SERIAL_FEED_BYTES];
    feed->bits = BITS_PLAIN;
    feed->frame = byte << 1 | 1u << 9;
    if (feed->parity) {
        const uint32_t odd = (ones(byte) + (feed->parity == 2)) & 1u;
        feed->frame = byte << 1 | odd << 9 | 1u << 10;
        feed->bits++;
    }
    feed->until8 += feed->bit_clk8;
}

int64_t serial_feed_quiet(const struct serial_feed *const feed)
{
    if (!feed->attached)
        return SIM_NEVER;
    if (!feed->sending)
        return feed->head == feed->tail ? SIM_NEVER : 0;
    return feed->until8 > 256u ? (int64_t)((feed->until8 - 1u) / 256u) : 0;
}

void serial_feed_step(struct serial_feed *const feed, const struct baud *const rate, const int64_t edges)
{
    if (!feed->attached)
        return;
    if (!feed->sending) {
        feed->until8 = 0;
        load(feed, rate);
        return;
    }
    const uint64_t way8 = (uint64_t)edges * 256u;
    if (feed->until8 > way8) {
        feed->until8 -= way8;
        return;
    }
    const uint64_t over8 = way8 - feed->until8;
    feed->frame >>= 1;
    feed->until8 = 0;
    if (--feed->bits == 0)
        load(feed, rate);
    else
        feed->until8 = feed->bit_clk8;
    feed->until8 = feed->until8 > over8 ? feed->until8 - over8 : 1;
}

size_t serial_feed_put(struct serial_feed *const feed, const uint8_t *const bytes, const size_t len)
{
    size_t taken = 0;
    while (taken < len && feed->head - feed->tail < SERIAL_FEED_BYTES)
        feed->byte[feed->head++ % SERIAL_FEED_BYTES] = bytes[taken++];
    return taken;
}

/* ---- transmitter and receiver ------------------------------------------------------------------------------------ */

void serial_pair_advance(const struct serial_pair *const pair, struct sim_module *const either, const int64_t clk)
{
    struct sim_module *const tx = sim_module_of(either->card, pair->tx_gtag);
    struct sim_module *const rx = sim_module_of(either->card, pair->rx_gtag);
    if (tx)
        tx->advancing = true;
    if (rx)
        rx->advancing = true;
    while ((tx && tx->clk < clk) || (rx && rx->clk < clk)) {
        int64_t to = clk;
        const int64_t event = tx && rx ? pair->tx_event(tx) : SIM_NEVER;
        if (event < clk - 1)
            to = event + 1;
        if (rx && rx->clk < to)
            pair->rx_step(rx, to);
        if (tx && tx->clk < to)
            pair->tx_step(tx, to);
        if (rx && rx->clk < to)
            rx->clk = to;
        if (tx && tx->clk < to)
            tx->clk = to;
        if (tx && rx)
            pair->couple(tx, rx);
    }
    if (tx)
        tx->advancing = false;
    if (rx)
        rx->advancing = false;
}
