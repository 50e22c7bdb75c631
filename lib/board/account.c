/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Error accounting of a cycle (hal-interface 3.4, 3.5). */
#include <hm2/number.h>

#include "board_private.h"

#define DEFAULT_PERCENT 80
#define MIN_LIMIT_NS    100000

int64_t board_read_limit_ns(const int32_t setting, const int64_t period_ns)
{
    int64_t limit = setting <= 0 ? DEFAULT_PERCENT : setting;
    if (limit < 100)
        limit = period_ns / 100 * limit + period_ns % 100 * limit / 100;
    return limit < MIN_LIMIT_NS ? MIN_LIMIT_NS : limit;
}

static int32_t at_least_one(const int32_t value)
{
    return value < 1 ? 1 : value;
}

static struct board_event counters(const struct hm2_board *const board)
{
    const struct board_points *const p = board->points;
    return (struct board_event){
        .words = {*p->error_total, *p->lost, *p->late, *p->stale, *p->malformed, *p->write_lost,
                  (uint32_t)board->link->counters.send_errors},
    };
}

void board_cycle_failed(struct hm2_board *const board, const bool raise_level)
{
    const struct board_points *const p = board->points;
    *p->error = true;
    *p->error_total = *p->error_total + 1u;
    board->rearm_ns = 0;
    if (!raise_level)
        return;
    const int32_t limit = at_least_one(*p->error_limit);
    const int64_t level = (int64_t)*p->error_level + at_least_one(*p->error_increment);
    const struct board_event facts = counters(board);
    *p->error_level = level < limit ? (int32_t)level : limit;
    if (level < limit) {
        board_event(board, BOARD_EVENT_PACKET_ERROR, &facts);
        return;
    }
    *p->io_error = true;
    *p->error_exceeded = true;
    board_event(board, BOARD_EVENT_EXCEEDED, &facts);
}

void board_cycle_good(struct hm2_board *const board)
{
    const struct board_points *const p = board->points;
    const int64_t level = (int64_t)*p->error_level - at_least_one(*p->error_decrement);
    *p->error = false;
    *p->error_exceeded = false;
    *p->error_level = level > 0 ? (int32_t)level : 0;
}
