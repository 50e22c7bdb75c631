/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The bench of the serial recordings: TX is wired to RX, unless the trace drives RX itself. */
#include <string.h>

#include "replay_trace.h"

#define PIN_TX 0x81u
#define PIN_RX 0x01u

static bool drives_rx(const struct replay_run *const run)
{
    const struct replay_event *const events = run->trace->events + run->test->first;
    for (size_t i = 0; i < run->test->count; i++)
        if (events[i].kind == 'I' && strcmp(events[i].name, "rx") == 0)
            return true;
    return false;
}

/* The receiver of a transmitter has the next tag. */
static void loop(struct replay_run *const run, const int64_t clk, const enum sim_level level)
{
    if (sim_card_drive_input(run->card, clk, (uint8_t)(run->kind->loop_gtag + 1u), 0, PIN_RX, level))
        replay_differs(run, "clk %lld: the card has no receiver", (long long)clk);
}

int replay_serial_prepare(struct replay_run *const run)
{
    run->bench_watch[0] = -1;
    loop(run, -1, SIM_HIGH);
    if (!drives_rx(run))
        run->bench_watch[0] = sim_card_watch_output(run->card, run->kind->loop_gtag, 0, PIN_TX);
    return 0;
}

void replay_serial_edge(struct replay_run *const run, const int64_t clk, const unsigned watch,
                        const enum sim_level level)
{
    if (run->bench_watch[0] == (int)watch)
        loop(run, clk, level);
}
