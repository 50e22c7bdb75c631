/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Life of a board: made, started, stopped, freed. */
#include <stdlib.h>

#include "board_private.h"

#define START_ROUNDS   64u
#define START_TRY_NS   INT64_C(100000000)
#define START_NS       INT64_C(1000000000)
#define START_PERIOD   1000000 /* ns, until the cycle tells its own */
#define STOP_TRIES     3u
#define STOP_TRY_NS    INT64_C(20000000)
#define BITE_AT_ONCE   1u /* timer value (hal-interface 1.7) */
#define WATCHDOG_TIMER 0u /* register (register map 3.2) */

struct hm2_board *hm2_board_new(void)
{
    struct hm2_board *const board = calloc(1, sizeof *board + hm2_plan_size());
    if (board)
        board->plan = (void *)board->plan_memory;
    return board;
}

void hm2_board_free(struct hm2_board *const board)
{
    if (!board)
        return;
    link_close(board->link);
    free(board->flight);
    free(board);
}

const struct hm2_board_type *hm2_board_type(const struct hm2_board *const board)
{
    return &board->type;
}

const struct hm2_idrom *hm2_board_idrom(const struct hm2_board *const board)
{
    return &board->idrom;
}

const char *hm2_board_card_name(const struct hm2_board *const board)
{
    return board->card_name;
}

const char *hm2_board_prefix(const struct hm2_board *const board)
{
    return board->prefix;
}

/* ---- start --------------------------------------------------------------------------------------------------------
 */

void board_start_modules(struct hm2_board *const board)
{
    const struct hm2_cycle *const cycle = board_cycle(board, board->request_ns, false);
    for (unsigned i = 0; i < board->module_count; i++)
        if (board->modules[i].type->start)
            board->modules[i].type->start(&board->modules[i], cycle);
}

/* Ask and wait for the fresh reply. */
static int ask(struct hm2_board *const board)
{
    size_t len;
    const uint8_t *const request = hm2_plan_request(board->plan, &len);
    board->request_ns = link_now_ns(board->link);
    int err = link_send(board->link, request, len);
    for (unsigned i = 0; i < BOARD_MAX_DATAGRAMS && err != HM2_ERR_TIMEOUT; i++) {
        err = link_recv(board->link, hm2_plan_reply_buffer(board->plan), hm2_plan_reply_capacity(board->plan),
                        board->request_ns + START_TRY_NS);
        if (err >= 0 && hm2_plan_judge(board->plan, (size_t)err) == HM2_REPLY_FRESH)
            return 0;
    }
    hm2_plan_give_up(board->plan);
    return err < 0 ? err : HM2_ERR_MALFORMED;
}

/* One write, as set-up left it: no module has packed anything yet, so every value is at rest. */
static int write_and_ask(struct hm2_board *const board)
{
    size_t len;
    const uint8_t *const bytes = hm2_plan_write(board->plan, &len);
    const int err = link_send(board->link, bytes, len);
    if (err < 0) {
        hm2_plan_write_failed(board->plan);
        return err;
    }
    return ask(board);
}

/* Every register has reached the card, and a reply that is later than that is in the windows. */
static bool is_confirmed(const struct hm2_board *const board)
{
    const struct hm2_plan_facts facts = hm2_plan_facts(board->plan);
    return hm2_plan_settled(board->plan) && facts.write_confirmed && facts.session_kept;
}

int hm2_board_start(struct hm2_board *const board, struct hm2_diag *const diag)
{
    if (board->state != BOARD_SET_UP)
        return hm2_diag_add(diag, HM2_ERR_STATE, "a board is started once, after it has been set up");
    board->period_ns = START_PERIOD;
    const int64_t end_ns = link_now_ns(board->link) + START_NS;
    int err = HM2_ERR_TIMEOUT;
    bool confirmed = false;
    for (unsigned i = 0; i < START_ROUNDS && !confirmed && link_now_ns(board->link) < end_ns; i++) {
        err = write_and_ask(board);
        confirmed = err == 0 && is_confirmed(board);
    }
    if (!confirmed)
        return hm2_diag_add(diag, err < 0 ? err : HM2_ERR_TIMEOUT,
                            "%s: the card did not confirm its set-up within one second (%s); check the network between "
                            "this host and the card",
                            board->prefix, hm2_strerror(err < 0 ? err : HM2_ERR_TIMEOUT));
    board_start_modules(board);
    board->state = BOARD_RUNS;
    return 0;
}

/* ---- additions ----------------------------------------------------------------------------------------------------
 */

struct hm2_module *hm2_board_module(struct hm2_board *const board, const uint8_t gtag)
{
    for (unsigned i = 0; i < board->module_count; i++)
        if (board->modules[i].type->gtag == gtag)
            return &board->modules[i];
    return NULL;
}

void hm2_board_change_begin(struct hm2_board *const board)
{
    board->outstanding = false;
    board_pipeline_stop(board);
    hm2_plan_reopen(board->plan);
}

int hm2_board_change_end(struct hm2_board *const board, struct hm2_diag *const diag)
{
    const int err = hm2_plan_freeze(board->plan, diag);
    if (err < 0 && board->state == BOARD_RUNS)
        board->state = BOARD_STOPPED;
    if (board->pipeline.timer == 0)
        return err;
    board_pipeline_measure(board);
    if (err == 0 && !hm2_plan_pipelines(board->plan))
        board_pipeline_warn(board, diag);
    return err;
}

/* ---- stop ---------------------------------------------------------------------------------------------------------
 */

void hm2_board_stop(struct hm2_board *const board)
{
    if (board->state == BOARD_NEW)
        return;
    const struct hm2_md *const watchdog = hm2_idrom_find(&board->idrom, HM2_GTAG_WATCHDOG);
    const uint32_t bite = BITE_AT_ONCE;
    board->state = BOARD_STOPPED;
    /* When nobody answers, the card's watchdog bites by itself: no write pets it any more. */
    if (watchdog && !board->foreign) {
        const int err =
            board_poke(board, hm2_md_address(watchdog, WATCHDOG_TIMER, 0), 1, &bite, STOP_TRIES, STOP_TRY_NS);
        (void)err;
    }
}
