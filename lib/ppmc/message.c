/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What happened to boards, as sentences for people. The cycle only counts; this compares with what was told. */
#include <stdio.h>

#include "ppmc_private.h"

static const struct {
    const char *text;
    bool error;
} texts[] = {
    {"gives no usable data: its outputs keep their values; check power and cable (pins timeouts, io-errors, bad-data)",
     true},
    {"is back, its settings were written again", false},
    {"its counters may have been reset, or gone round unseen: home its axes, then set position-lost to 0", true},
};

static bool is_new(_Atomic uint32_t *const happened, uint32_t *const told)
{
    const uint32_t now = atomic_load_explicit(happened, memory_order_relaxed);
    if (now == *told)
        return false;
    *told = now;
    return true;
}

static int news(struct ppmc_board *const board)
{
    if (is_new(&board->outages, &board->outages_told))
        return 0;
    if (is_new(&board->returns, &board->returns_told))
        return 1;
    return is_new(&board->losses, &board->losses_told) ? 2 : -1;
}

int ppmc_next_message(struct ppmc *const ppmc, char *const text, const size_t size, bool *const error)
{
    for (unsigned i = 0; i < ppmc->board_count; i++) {
        struct ppmc_board *const board = &ppmc->boards[i];
        const int which = news(board);
        if (which < 0)
            continue;
        (void)snprintf(text, size, "ppmc.%u: the %s in slot %u %s", ppmc->bus, board->info.name, board->slot,
                       texts[which].text);
        *error = texts[which].error;
        return 1;
    }
    return 0;
}
