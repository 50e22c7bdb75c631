/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the serial modules have in common: the bit-rate generator, the wire to the world outside as bytes, and a
 * transmitter and a receiver that see each other's drive enable.
 */
#ifndef SIM_SERIAL_LINE_H
#define SIM_SERIAL_LINE_H

#include <string.h>

#include "bus_clock.h"
#include "sim_card.h"

/* ---- bit rate: a phase accumulator whose top bit is looked at one clock later ---------------------------------------
 */

struct baud {
    uint32_t rate, accum, top; /* top: its highest bit */
    bool before;               /* the top bit, one clock ago */
};

static inline bool baud_high(const struct baud *const b)
{
    return (b->accum & b->top) != 0;
}

static inline bool baud_rises(const struct baud *const b)
{
    return !b->before && baud_high(b);
}

static inline bool baud_falls(const struct baud *const b)
{
    return b->before && !baud_high(b);
}

static inline void baud_step(struct baud *const b, const bool up)
{
    b->accum = (up ? b->accum + b->rate : b->accum - b->rate) & (2u * b->top - 1u);
}

/* Edges in which the top bit stays what it was and is. */
int64_t baud_quiet(const struct baud *b, bool up);
void baud_skip(struct baud *b, bool up, int64_t edges);
/* Clocks of a bit, times 2^8. */
uint64_t baud_bit_clk8(const struct baud *b);

/* ---- bytes from outside ---------------------------------------------------------------------------------------------
 */

#define SERIAL_FEED_BYTES 4096u

/* A peer outside sends bytes at the port's own rate, one stop bit after another. */
struct serial_feed {
    bool attached, sending;
    uint8_t parity; /* 0 none, 1 even, 2 odd: as the receiver has it */
    uint8_t byte[SERIAL_FEED_BYTES];
    uint32_t head, tail;
    uint32_t frame;    /* bits still to send, next one lowest */
    unsigned bits;     /* how many */
    uint64_t until8;   /* clocks that the present bit still lasts, times 2^8 */
    uint64_t bit_clk8; /* clocks of a bit */
};

/* The level now; one edge; and how many edges it stays. rate: of the port. */
bool serial_feed_level(const struct serial_feed *feed);
void serial_feed_step(struct serial_feed *feed, const struct baud *rate, int64_t edges);
int64_t serial_feed_quiet(const struct serial_feed *feed);
size_t serial_feed_put(struct serial_feed *feed, const uint8_t *bytes, size_t len);

/* The state of a port is as it was: the edges to come change nothing either. Padding that differs by chance makes this
 * false, which only costs the time of making them. */
static inline bool serial_rests(const void *const before, const void *const now, const size_t size)
{
    return memcmp(before, now, size) == 0;
}

struct serial_tap {
    sim_serial_fn sent;
    void *context;
};

/* ---- transmitter and receiver of the same number --------------------------------------------------------------------
 */

/* The receiver is masked by what the transmitter drives, so the two go from one change of it to the next. */
struct serial_pair {
    uint8_t tx_gtag, rx_gtag;
    void (*tx_step)(struct sim_module *tx, int64_t clk);
    int64_t (*tx_event)(struct sim_module *tx);
    void (*rx_step)(struct sim_module *rx, int64_t clk);
    void (*couple)(const struct sim_module *tx, struct sim_module *rx); /* drive enables to masks */
};

void serial_pair_advance(const struct serial_pair *pair, struct sim_module *either, int64_t clk);

#endif
