/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the bench of the SPI recordings had at MISO: a wire from MOSI, an inverter, a wire that delays, or a slave that
 * sends a byte. The descriptions of the tests say which, one for each word that is sent.
 */
#include <stdlib.h>
#include <string.h>

#include "replay_trace.h"

#define SLAVE_BYTE 0x3Cu
#define DELAY_CLK  3 /* 35 ns at 100 MHz: an edge in the fourth clock from now sees the change */
#define HISTORY    4u

#define PIN_MISO 0x04u

enum { MOSI, SCLK, FRAME, PINS };

enum peer { WIRE, INVERTER, DELAYED, SLAVE };

/* run->state, zero at the start of a test */
enum { STATE_WORDS, STATE_BIT, STATE_HISTORY /* and the next three: clk << 1 | level, newest first */ };

static enum peer peer_of(const struct replay_test *const test, const uint64_t words)
{
    const char *const text = test->description;
    if (strstr(text, "35 ns later"))
        return words <= 1 ? DELAYED : words == 2 ? WIRE : SLAVE;
    if (words <= 1)
        return WIRE;
    return strstr(text, "not MOSI") ? INVERTER : strstr(text, "slave model answers") ? SLAVE : WIRE;
}

/* Level of MOSI as a delayed wire shows it before the tick of the bit clock after this one; nothing else looks at it.
 */
static bool delayed(const struct replay_run *const run, const int64_t clk)
{
    const char *const text = strstr(run->test->name, "div");
    const int64_t tick = clk + 1 + (text ? strtol(text + 3, NULL, 10) : 0);
    for (unsigned i = 0; i < HISTORY; i++)
        if ((int64_t)(run->state[STATE_HISTORY + i] >> 1) + DELAY_CLK < tick)
            return (run->state[STATE_HISTORY + i] & 1u) != 0;
    return false;
}

/* The byte's first bit comes with the frame (CPHA 0) or with the first leading edge (CPHA 1), the others with the
 * edges on which a master shifts. */
static bool slave(struct replay_run *const run, const unsigned pin)
{
    const enum sim_level *const now = run->bench_level;
    const bool other = strcmp(run->test->name, "mode_11") == 0; /* CPOL 1, CPHA 1 */
    const bool cpha = other || strstr(run->test->name, "cpha1");
    const bool leads = pin == SCLK && (now[SCLK] == SIM_HIGH) != other;
    const bool trails = pin == SCLK && (now[SCLK] == SIM_HIGH) == other;
    if (pin == FRAME && now[FRAME] == SIM_LOW)
        run->state[STATE_BIT] = cpha ? 0 : 1;
    else if (now[FRAME] == SIM_LOW && (cpha ? leads : trails))
        run->state[STATE_BIT]++;
    const uint64_t bit = run->state[STATE_BIT];
    return bit > 0 && bit <= 8 && (SLAVE_BYTE >> (8 - bit) & 1u);
}

static bool answer(struct replay_run *const run, const int64_t clk, const unsigned pin)
{
    const bool mosi = run->bench_level[MOSI] == SIM_HIGH;
    switch (peer_of(run->test, run->state[STATE_WORDS])) {
    case INVERTER:
        return !mosi;
    case DELAYED:
        return delayed(run, clk);
    case SLAVE:
        return slave(run, pin);
    case WIRE:
        break;
    }
    return mosi;
}

static void drive(struct replay_run *const run, const int64_t clk, const bool level)
{
    if (sim_card_drive_input(run->card, clk, run->kind->loop_gtag, 0, PIN_MISO, level ? SIM_HIGH : SIM_LOW))
        replay_differs(run, "clk %lld: the card has no MISO", (long long)clk);
}

void replay_spi_edge(struct replay_run *const run, const int64_t clk, const unsigned watch, const enum sim_level level)
{
    for (unsigned pin = 0; pin < PINS; pin++) {
        if (run->bench_watch[pin] != (int)watch)
            continue;
        run->bench_level[pin] = level;
        if (pin == MOSI) {
            memmove(&run->state[STATE_HISTORY + 1], &run->state[STATE_HISTORY], (HISTORY - 1) * sizeof run->state[0]);
            run->state[STATE_HISTORY] = (uint64_t)clk << 1 | (level == SIM_HIGH);
        }
        drive(run, clk, answer(run, clk, pin));
    }
}

int replay_spi_prepare(struct replay_run *const run)
{
    static const uint8_t codes[PINS] = {[MOSI] = 0x82, [SCLK] = 0x83, [FRAME] = 0x81};
    for (unsigned pin = 0; pin < PINS; pin++) {
        run->bench_watch[pin] = sim_card_watch_output(run->card, run->kind->loop_gtag, 0, codes[pin]);
        if (run->bench_watch[pin] < 0)
            return run->bench_watch[pin];
        run->bench_level[pin] = sim_card_watched(run->card, (unsigned)run->bench_watch[pin]);
    }
    drive(run, -1, false);
    return 0;
}

/* A word goes out: the bench has the wire of that word at MISO. */
int replay_spi_word(struct replay_run *const run, const struct replay_event *const event)
{
    if (event->kind != 'W' || (strncmp(event->name, "fifo", 4) != 0 && strcmp(event->name, "data") != 0))
        return 0;
    run->state[STATE_WORDS]++;
    sim_card_advance(run->card, replay_clk(run, event->at));
    drive(run, replay_clk(run, event->at) - 1, answer(run, replay_clk(run, event->at) - 1, PINS));
    return 0;
}
