/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The cycle: one request, one reply, one write. A reply is judged before anything of it is decoded; a cycle without a
 * good reply changes no input. Nothing here allocates, locks or formats.
 */
#include "../module/watchdog.h"
#include "board_private.h"

#define DEFAULT_PERIOD_NS 1000000
/* A module that changes its set-up in every cycle must not hold the return of a card up for ever. */
#define MAX_RESTORE_WRITES 256u

static bool is_stopped(const struct hm2_board *const board)
{
    return board->state != BOARD_RUNS || *board->points->io_error;
}

static void count(hm2_u32_t *const pin)
{
    *pin = *pin + 1u;
}

const struct hm2_cycle *board_cycle(struct hm2_board *const board, const int64_t now_ns, const bool bitten)
{
    struct hm2_cycle *const cycle = &board->cycle;
    if (cycle->period_ns != board->period_ns) {
        cycle->period_ns = board->period_ns;
        cycle->period_s = (double)board->period_ns * 1e-9;
    }
    cycle->now_ns = now_ns;
    cycle->writes = board->writes;
    cycle->bitten = bitten;
    return cycle;
}

static void call_all(const struct board_calls *const calls, const struct hm2_cycle *const cycle)
{
    for (const struct board_call *call = calls->call, *const end = call + calls->count; call < end; call++)
        call->function(call->module, cycle);
}

/* ---- request ------------------------------------------------------------------------------------------------------
 */

static void send_request(struct hm2_board *const board)
{
    const bool identity = board->recovery == BOARD_ASKS_IDENTITY;
    size_t len = board->identity.builder.used;
    const uint8_t *const bytes = identity ? board_recovery_request(board) : hm2_plan_request(board->plan, &len);
    board->notices.now_ns = board->request_ns = link_now_ns(board->link);
    board->sent = link_send(board->link, bytes, len) == 0;
    board->outstanding = true;
}

void hm2_board_request(struct hm2_board *const board, const int64_t period_ns)
{
    if (is_stopped(board) || board->outstanding)
        return;
    /* A person has cleared io_error (hal-interface 3.5). */
    if (board_level_exceeded(board)) {
        *board->points->error_level = 0;
        /* While nothing was sent the card may have become another. */
        if (board->recovery == BOARD_RESTORES)
            board->recovery = BOARD_ASKS_IDENTITY;
    }
    board->period_ns = period_ns > 0 ? period_ns : DEFAULT_PERIOD_NS;
    send_request(board);
}

bool hm2_board_request_outstanding(const struct hm2_board *const board)
{
    return board->outstanding;
}

/* ---- reply --------------------------------------------------------------------------------------------------------
 */

/* One datagram in a normal cycle: true when it is the reply that is waited for. */
static bool judge(struct hm2_board *const board, const size_t len)
{
    switch (hm2_plan_judge(board->plan, len)) {
    case HM2_REPLY_FRESH:
        return true;
    case HM2_REPLY_STALE:
        count(board->points->stale);
        return false;
    case HM2_REPLY_LATE:
        count(board->points->late);
        return false;
    case HM2_REPLY_MALFORMED:
        break;
    }
    count(board->points->malformed);
    return false;
}

/* While the identity is asked for, anything else is an answer to an earlier question. */
static bool judge_identity(struct hm2_board *const board, const size_t len)
{
    const bool fresh = board_exchange_matches(&board->identity, len);
    if (!fresh)
        count(board->points->late);
    return fresh;
}

static bool receive(struct hm2_board *const board, int64_t clock_ns)
{
    const bool identity = board->recovery == BOARD_ASKS_IDENTITY;
    uint8_t *const buffer = identity ? board->identity.reply : hm2_plan_reply_buffer(board->plan);
    const size_t capacity = identity ? sizeof board->identity.reply : hm2_plan_reply_capacity(board->plan);
    const int64_t deadline_ns = board->request_ns + board_read_limit_ns(*board->points->read_timeout, board->period_ns);
    for (unsigned i = 0; i < BOARD_MAX_DATAGRAMS; i++, clock_ns = LINK_CLOCK_UNREAD) {
        const int len = link_recv_from(board->link, buffer, capacity, deadline_ns, clock_ns);
        if (len == HM2_ERR_TIMEOUT)
            return false;
        if (len == HM2_ERR_NOSPACE)
            count(board->points->malformed);
        else if (len >= 0 && (identity ? judge_identity(board, (size_t)len) : judge(board, (size_t)len)))
            return true;
    }
    return false;
}

static void measure_round_trip(struct hm2_board *const board)
{
    const struct board_points *const p = board->points;
    const double us = (double)(link_now_ns(board->link) - board->request_ns) * 1e-3;
    *p->rtt_us = us;
    if (*p->rtt_reset || !board->rtt_known) {
        *p->rtt_reset = false;
        board->rtt_known = true;
        *p->rtt_min_us = *p->rtt_max_us = us;
        return;
    }
    if (us < *p->rtt_min_us)
        *p->rtt_min_us = us;
    if (us > *p->rtt_max_us)
        *p->rtt_max_us = us;
}

static void note_loss(struct hm2_board *const board)
{
    board->lossy = true;
    board->last_loss_cycle = board->cycles;
}

static void unpack_all(struct hm2_board *const board)
{
    call_all(&board->unpacks, board_cycle(board, board->request_ns, hm2_watchdog_bitten(board->watchdog)));
    *board->points->data_age = 0;
}

static void tell_write_lost(struct hm2_board *const board)
{
    count(board->points->write_lost);
    note_loss(board);
    for (unsigned i = 0; i < board->module_count; i++)
        if (board->modules[i].type->write_lost)
            board->modules[i].type->write_lost(&board->modules[i]);
}

/* The reply is fresh: what does it tell about our last write and about the card's life? */
static void use_reply(struct hm2_board *const board)
{
    const struct hm2_plan_facts facts = hm2_plan_facts(board->plan);
    if (!facts.session_kept) {
        board_recovery_begin(board);
        board_cycle_failed(board, false);
        return;
    }
    if (!facts.write_confirmed)
        tell_write_lost(board);
    if (board->recovery == BOARD_RESTORES) {
        if (facts.write_confirmed && (hm2_plan_settled(board->plan) || board->writes >= MAX_RESTORE_WRITES))
            board_recovery_end(board);
        board_cycle_failed(board, !facts.write_confirmed);
        return;
    }
    unpack_all(board);
    board->write_gap_ns = 0;
    /* As in LinuxCNC: the inputs are good and are used, but the cycle counts as failed. */
    if (facts.write_confirmed)
        board_cycle_good(board);
    else
        board_cycle_failed(board, true);
}

static void give_up(struct hm2_board *const board)
{
    if (board->recovery != BOARD_ASKS_IDENTITY)
        hm2_plan_give_up(board->plan);
    board->outstanding = false;
}

void hm2_board_read(struct hm2_board *const board, const int64_t period_ns)
{
    if (is_stopped(board)) {
        if (board->outstanding)
            give_up(board);
        return;
    }
    int64_t clock_ns = LINK_CLOCK_UNREAD;
    if (!board->outstanding) {
        hm2_board_request(board, period_ns);
        clock_ns = board->request_ns;
    }
    const struct board_points *const p = board->points;
    board->cycles++;
    count(p->data_age);
    *p->strangers = (uint32_t)__atomic_load_n(&board->link->counters.strangers, __ATOMIC_RELAXED);
    if (!board->sent || !receive(board, clock_ns)) {
        give_up(board);
        count(p->lost);
        note_loss(board);
        board_cycle_failed(board, true);
        return;
    }
    board->outstanding = false;
    measure_round_trip(board);
    if (board->recovery == BOARD_ASKS_IDENTITY) {
        board_recovery_identified(board);
        board_cycle_failed(board, false);
    } else {
        use_reply(board);
    }
}

/* ---- write --------------------------------------------------------------------------------------------------------
 */

void hm2_board_write(struct hm2_board *const board, const int64_t period_ns)
{
    if (is_stopped(board) || board->recovery == BOARD_ASKS_IDENTITY)
        return;
    const int64_t now_ns = link_now_ns(board->link);
    const bool restores = board->recovery == BOARD_RESTORES;
    board->period_ns = period_ns > 0 ? period_ns : DEFAULT_PERIOD_NS;
    board->notices.now_ns = now_ns;
    /* A card that comes back drives nothing until a person has seen it. */
    call_all(&board->packs, board_cycle(board, now_ns, restores || hm2_watchdog_bitten(board->watchdog)));
    size_t len;
    const uint8_t *const bytes = hm2_plan_write(board->plan, &len);
    if (board->writes > 0 && now_ns - board->write_ns > board->write_gap_ns)
        board->write_gap_ns = now_ns - board->write_ns;
    board->write_ns = now_ns;
    board->writes++;
    if (link_send(board->link, bytes, len) < 0) {
        hm2_plan_write_failed(board->plan);
        note_loss(board);
    }
}
