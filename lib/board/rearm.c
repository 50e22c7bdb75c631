/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a bite leaves behind, and coming back from it without a person where auto-rearm asks for that.
 *
 * io_error, has_bit and packet-error-exceeded keep LinuxCNC's meaning: without auto-rearm they wait for a person. With
 * it, a board that gave up tries again after a pause, and has_bit is cleared when the card has answered every cycle for
 * a while: a card that comes and goes does not move its machine in between.
 */
#include "../module/watchdog.h"
#include "board_private.h"

#define TRY_AGAIN_NS INT64_C(100000000)
#define SETTLED_NS   INT64_C(500000000)

/* True when the condition has held for so long; called once in each cycle in which it holds. */
static bool has_waited(struct hm2_board *const board, const int64_t wanted_ns)
{
    board->rearm_ns += board->period_ns;
    if (board->rearm_ns < wanted_ns)
        return false;
    board->rearm_ns = 0;
    return true;
}

HM2_RARE void board_rearm_io(struct hm2_board *const board)
{
    const struct board_points *const p = board->points;
    /* What a person or a HAL file set, and a card with other firmware, is left alone. */
    if (*p->auto_rearm && *p->error_exceeded && !board->foreign && has_waited(board, TRY_AGAIN_NS))
        *p->io_error = false;
}

HM2_RARE void board_stay_bitten(struct hm2_board *const board, const bool bitten)
{
    const struct board_points *const p = board->points;
    if (bitten && !board->bitten) {
        *p->position_lost = true;
        board->rearm_ns = 0;
    }
    board->bitten = bitten;
    if (!bitten || !*p->auto_rearm || !has_waited(board, SETTLED_NS))
        return;
    hm2_watchdog_clear(board->watchdog);
    *p->rearms = *p->rearms + 1u;
}
