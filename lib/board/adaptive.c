/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "adaptive.h"

#include "board_private.h"

#define REPLIES_KNOWN 256u
#define ABOVE         1u /* of 1024 replies may need more than half of the patience */
#define GRACE_NS      20000
#define COMPUTE_EVERY 64u /* cycles */
#define CALM          64u /* good replies, after which patience becomes half as long */
#define CLOSE         8u  /* losses with fewer good replies between them do not look like chance */
#define MAX_STRETCH   10u

static void compute(struct hm2_board *const board)
{
    struct board_adaptive *const a = &board->adaptive;
    a->usual_ns = board->rtt.total < REPLIES_KNOWN ? 0 : 2 * board_rtt_bound_ns(&board->rtt, ABOVE) + GRACE_NS;
    a->computed = board->cycles;
}

int64_t board_adaptive_patience_ns(struct hm2_board *const board, const int64_t limit_ns)
{
    struct board_adaptive *const a = &board->adaptive;
    a->asked_again = false;
    if (a->usual_ns == 0 || board->cycles - a->computed >= COMPUTE_EVERY)
        compute(board);
    const int64_t patience_ns = a->usual_ns << a->stretch;
    const int64_t most_ns = a->asks_again ? limit_ns / 2 : limit_ns; /* there is time for the second reply */
    const int64_t used_ns = a->usual_ns > 0 && patience_ns < most_ns ? patience_ns : most_ns;
    *a->points->deadline_us = (double)used_ns * 1e-3;
    return used_ns;
}

bool board_adaptive_ask_again(struct hm2_board *const board)
{
    struct board_adaptive *const a = &board->adaptive;
    size_t len;
    const uint8_t *const bytes = a->asks_again ? hm2_plan_request_again(board->plan, &len) : NULL;
    if (!bytes || link_send(board->link, bytes, len) < 0)
        return false;
    a->asked_again = true;
    *a->points->requests = *a->points->requests + 1u;
    return true;
}

void board_adaptive_received(struct hm2_board *const board)
{
    struct board_adaptive *const a = &board->adaptive;
    /* Which of two requests was answered is not known, and so neither is the time. */
    if (a->asked_again) {
        *a->points->saved = *a->points->saved + 1u;
        board_adaptive_lost(board);
        return;
    }
    a->calm++;
    if (a->calm % CALM == 0 && a->stretch > 0)
        a->stretch--;
}

/* When it is not chance the network has become slower: only who waits longer finds that out. */
void board_adaptive_lost(struct hm2_board *const board)
{
    struct board_adaptive *const a = &board->adaptive;
    a->stretch += a->calm < CLOSE && a->stretch < MAX_STRETCH;
    a->calm = 0;
}
