/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The cycle: one request, one reply, one write. A reply is judged before anything of it is decoded; a cycle without a
 * good reply changes no input. Nothing here allocates, locks or formats.
 */
#include "../module/watchdog.h"
#include "board_private.h"

#define DEFAULT_PERIOD_NS 1000000
#define LONG_AGO          INT64_MIN /* a deadline that is over: take what is queued already */
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

struct hm2_cycle *board_cycle(struct hm2_board *const board, const int64_t now_ns, const bool bitten)
{
    struct hm2_cycle *const cycle = &board->cycle;
    if (cycle->period_ns != board->period_ns) {
        cycle->period_ns = board->period_ns;
        cycle->period_s = (double)board->period_ns * 1e-9;
    }
    cycle->now_ns = now_ns;
    cycle->age_s = 0.0;
    cycle->undriven = 0.0;
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

static bool level_exceeded(const struct hm2_board *const board)
{
    const int32_t level = *board->points->error_level;
    return level > 0 && level >= *board->points->error_limit;
}

/* A person has cleared io_error (hal-interface 3.5). */
HM2_RARE static void start_again(struct hm2_board *const board)
{
    *board->points->error_level = 0;
    /* While nothing was sent the card may have become another. */
    if (board->recovery == BOARD_RESTORES)
        board->recovery = BOARD_ASKS_IDENTITY;
}

static uint32_t bad_datagrams(const struct hm2_board *const board)
{
    const struct board_points *const p = board->points;
    return *p->late + *p->stale + *p->malformed;
}

HM2_RARE static void record_request(struct hm2_board *const board, const size_t len)
{
    board_flight_begin(board->flight, board->request_ns, link_now_ns(board->link), board->period_ns, len,
                       bad_datagrams(board));
}

HM2_RARE static void record_read(struct hm2_board *const board)
{
    const unsigned lost = board->received_ns == 0 ? HM2_FLIGHT_LOST : 0;
    const unsigned failed = *board->points->error ? HM2_FLIGHT_FAILED : 0;
    const unsigned write_lost = lost || hm2_plan_facts(board->plan).write_confirmed ? 0 : HM2_FLIGHT_WRITE_LOST;
    board_flight_decoded(board->flight, board->received_ns, link_now_ns(board->link), hm2_plan_reply_bytes(board->plan),
                         lost | failed | write_lost, bad_datagrams(board));
}

static inline void send_request(struct hm2_board *const board, const int64_t period_ns)
{
    if (level_exceeded(board))
        start_again(board);
    const bool identity = board->recovery == BOARD_ASKS_IDENTITY;
    size_t len = board->identity.builder.used;
    const uint8_t *const bytes = identity ? board_recovery_request(board) : hm2_plan_request(board->plan, &len);
    board->period_ns = period_ns > 0 ? period_ns : DEFAULT_PERIOD_NS;
    board->notices.now_ns = board->read_ns = board->request_ns = link_now_ns(board->link);
    board->pipeline.turned = false;
    board->sent = link_send(board->link, bytes, len) == 0;
    board->outstanding = true;
    if (board->flight)
        record_request(board, len);
}

void hm2_board_request(struct hm2_board *const board, const int64_t period_ns)
{
    if (!is_stopped(board) && !board->outstanding)
        send_request(board, period_ns);
}

bool hm2_board_request_outstanding(const struct hm2_board *const board)
{
    return board->outstanding;
}

/* ---- reply --------------------------------------------------------------------------------------------------------
 */

/* What FIFOs gave comes only once: also of a reply that is not waited for. */
HM2_RARE static void take_late(struct hm2_board *const board)
{
    const uint64_t request = hm2_plan_late_request(board->plan);
    if (request == 0)
        return;
    const int64_t now_ns = link_now_ns(board->link);
    hm2_plan_swap_late(board->plan);
    for (unsigned i = 0; i < board->module_count; i++)
        if (board->modules[i].type->late)
            board->modules[i].type->late(&board->modules[i], request, now_ns);
    hm2_plan_swap_late(board->plan);
}

/* One datagram in a normal cycle: true when it is the reply that is waited for. */
static bool judge(struct hm2_board *const board, const size_t len)
{
    switch (hm2_plan_judge(board->plan, len)) {
    case HM2_REPLY_FRESH:
        return true;
    case HM2_REPLY_STALE:
        count(board->points->stale);
        take_late(board);
        return false;
    case HM2_REPLY_LATE:
        count(board->points->late);
        take_late(board);
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

HM2_RARE static void take_read_limit(struct hm2_board *const board, const int32_t setting)
{
    board->limit_for_setting = setting;
    board->limit_for_period_ns = board->period_ns;
    board->read_limit_ns = board_read_limit_ns(setting, board->period_ns);
}

static int64_t deadline_ns(struct hm2_board *const board)
{
    const int32_t setting = *board->points->read_timeout;
    if (setting != board->limit_for_setting || board->period_ns != board->limit_for_period_ns)
        take_read_limit(board, setting);
    return board->read_ns + board->read_limit_ns;
}

/* Wait for the reply that judge_() takes. clock_ns: see link.h. */
static inline bool receive(struct hm2_board *const board, const struct board_buffer into, const int64_t end_ns,
                           int64_t clock_ns, bool (*const judge_)(struct hm2_board *board, size_t len))
{
    for (unsigned i = 0; i < BOARD_MAX_DATAGRAMS; i++, clock_ns = LINK_CLOCK_UNREAD) {
        const int len = link_recv_from(board->link, into.bytes, into.size, end_ns, clock_ns);
        if (len >= 0) {
            if (judge_(board, (size_t)len))
                return true;
        } else if (len == HM2_ERR_TIMEOUT) {
            return false;
        } else if (len == HM2_ERR_NOSPACE) {
            count(board->points->malformed);
        }
    }
    return false;
}

/* A reply that is later than usual is taken for lost, and asked for once more where that is wanted. */
static bool receive_adaptively(struct hm2_board *const board, const int64_t end_ns, const int64_t clock_ns)
{
    const int64_t patience_ns = board_adaptive_patience_ns(board, end_ns - board->request_ns);
    const int64_t first_ns = board->request_ns + patience_ns;
    if (receive(board, board->reply, first_ns, clock_ns, judge))
        return true;
    if (first_ns >= end_ns || !board_adaptive_ask_again(board))
        return false;
    const int64_t second_ns = first_ns + patience_ns;
    return receive(board, board->reply, second_ns < end_ns ? second_ns : end_ns, LINK_CLOCK_UNREAD, judge);
}

static inline bool receive_reply(struct hm2_board *const board, const int64_t clock_ns)
{
    const int64_t end_ns = deadline_ns(board);
    return board->adaptive.on ? receive_adaptively(board, end_ns, clock_ns)
                              : receive(board, board->reply, end_ns, clock_ns, judge);
}

/* The reply to a turn should have been here for long: then it is taken without asking the clock or waiting. */
static bool receive_turn(struct hm2_board *const board, bool *const on_time)
{
    *on_time = receive(board, board->reply, LONG_AGO, LINK_CLOCK_UNREAD, judge);
    return *on_time || receive(board, board->reply, deadline_ns(board), LINK_CLOCK_UNREAD, judge);
}

static void measure_round_trip(struct hm2_board *const board)
{
    const struct board_points *const p = board->points;
    const double us = (double)(board->received_ns - board->request_ns) * 1e-3;
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

static void date_back(const struct hm2_board *const board, struct hm2_cycle *const cycle)
{
    cycle->now_ns = board_pipeline_sample_ns(board);
    const int64_t age_ns = board->read_ns - cycle->now_ns;
    cycle->age_s = age_ns > 0 ? (double)age_ns * 1e-9 : 0.0;
}

/* When the card bit follows from the write behind the last unpack. That later ones were in time for it is not known;
 * when packets are lost, most are not. */
HM2_RARE static double undriven_since_bite(const struct hm2_board *const board, const int64_t now_ns)
{
    const int64_t pet_ns = board->petted ? board->pet_ns : board->unpacked_ns;
    const double bitten_ns = (double)(now_ns - pet_ns - hm2_watchdog_timeout_ns(board->watchdog)),
                 all_ns = (double)(now_ns - board->unpacked_ns);
    return bitten_ns <= 0.0 || all_ns <= 0.0 ? 0.0 : bitten_ns < all_ns ? bitten_ns / all_ns : 1.0;
}

static void unpack_all(struct hm2_board *const board)
{
    const bool bitten = hm2_watchdog_bitten(board->watchdog); /* as the cycle before has found */
    struct hm2_cycle *const cycle = board_cycle(board, board->request_ns, bitten);
    cycle->received_ns = board->received_ns;
    if (board->pipeline.turned)
        date_back(board, cycle);
    if (bitten)
        cycle->undriven = 1.0;
    else if (hm2_watchdog_bites(board->watchdog))
        cycle->undriven = undriven_since_bite(board, cycle->now_ns);
    call_all(&board->unpacks, cycle);
    if (board->pipeline.turned)
        board_pipeline_unpacked(board);
    board->unpacked_ns = cycle->now_ns;
    board->petted = false;
    *board->points->data_age = 0;
    if (bitten || board->bitten)
        board_stay_bitten(board, bitten);
}

HM2_RARE static void tell_write_lost(struct hm2_board *const board)
{
    count(board->points->write_lost);
    note_loss(board);
    for (unsigned i = 0; i < board->module_count; i++)
        if (board->modules[i].type->write_lost)
            board->modules[i].type->write_lost(&board->modules[i]);
}

HM2_RARE static void restore(struct hm2_board *const board, const bool write_confirmed)
{
    if (write_confirmed && (hm2_plan_settled(board->plan) || board->writes >= MAX_RESTORE_WRITES))
        board_recovery_end(board);
    board_cycle_failed(board, !write_confirmed);
}

HM2_RARE static void lose_session(struct hm2_board *const board)
{
    board_recovery_begin(board);
    board_cycle_failed(board, false);
}

/* The reply is fresh: what does it tell about our last write and about the card's life? */
static void use_reply(struct hm2_board *const board)
{
    const struct hm2_plan_facts facts = hm2_plan_facts(board->plan);
    if (!facts.session_kept) {
        lose_session(board);
        return;
    }
    if (!facts.write_confirmed)
        tell_write_lost(board);
    if (board->recovery == BOARD_RESTORES) {
        restore(board, facts.write_confirmed);
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

HM2_RARE static void lose_reply(struct hm2_board *const board)
{
    give_up(board);
    count(board->points->lost);
    note_loss(board);
    board_cycle_failed(board, true);
}

HM2_RARE static void read_identity(struct hm2_board *const board)
{
    const struct board_buffer into = {board->identity.reply, sizeof board->identity.reply};
    if (!board->sent || !receive(board, into, deadline_ns(board), LINK_CLOCK_UNREAD, judge_identity)) {
        lose_reply(board);
        return;
    }
    board->outstanding = false;
    board->received_ns = link_now_ns(board->link);
    measure_round_trip(board);
    board_recovery_identified(board);
    board_cycle_failed(board, false);
}

/* A turn was sent in the period before; for the recorder, its cycle begins here. */
static void begin_turned_read(struct hm2_board *const board, const int64_t period_ns)
{
    board->period_ns = period_ns > 0 ? period_ns : DEFAULT_PERIOD_NS;
    board->notices.now_ns = board->read_ns = link_now_ns(board->link);
    if (board->flight)
        board_flight_begin(board->flight, board->read_ns, board->read_ns, board->period_ns, 0, bad_datagrams(board));
}

static void take_reply(struct hm2_board *const board, const bool on_time)
{
    board->outstanding = false;
    board->received_ns = link_now_ns(board->link);
    if (board->pipeline.timer > 0)
        board_pipeline_received(board, on_time);
}

static void note_plain_reply(struct hm2_board *const board)
{
    if (board->adaptive.on)
        board_adaptive_received(board);
    if (!board->adaptive.asked_again)
        board_rtt_add(&board->rtt, board->received_ns - board->request_ns);
}

static void read_plain(struct hm2_board *const board, const int64_t clock_ns)
{
    if (!board->sent || !receive_reply(board, clock_ns)) {
        if (board->adaptive.on)
            board_adaptive_lost(board);
        lose_reply(board);
        return;
    }
    take_reply(board, true);
    if (board->adaptive.on || board->pipeline.timer > 0)
        note_plain_reply(board);
    measure_round_trip(board);
    use_reply(board);
}

static void finish_turn(struct hm2_board *const board)
{
    bool on_time;
    if (!receive_turn(board, &on_time)) {
        board_pipeline_lost(board);
        lose_reply(board);
        return;
    }
    take_reply(board, on_time);
    use_reply(board);
}

void hm2_board_read(struct hm2_board *const board, const int64_t period_ns)
{
    if (is_stopped(board)) {
        if (board->outstanding)
            give_up(board);
        board_pipeline_stop(board);
        if (board->state == BOARD_RUNS)
            board_rearm_io(board);
        return;
    }
    int64_t clock_ns = LINK_CLOCK_UNREAD;
    if (!board->outstanding) {
        send_request(board, period_ns);
        clock_ns = board->request_ns;
    } else if (board->pipeline.turned) {
        begin_turned_read(board, period_ns);
    }
    board->cycles++;
    board->received_ns = 0;
    count(board->points->data_age);
    *board->points->strangers = (uint32_t)link_strangers(board->link);
    if (board->recovery == BOARD_ASKS_IDENTITY) {
        read_identity(board);
    } else if (board->pipeline.turned) {
        finish_turn(board);
    } else {
        read_plain(board, clock_ns);
    }
    if (board->flight)
        record_read(board);
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
    const bool turns = board->pipeline.timer > 0 && board_pipeline_turns(board, now_ns);
    const uint8_t *const bytes =
        turns ? hm2_plan_turn(board->plan, board_pipeline_timeout_us(board), &len) : hm2_plan_write(board->plan, &len);
    if (board->writes > 0 && now_ns - board->write_ns > board->write_gap_ns)
        board->write_gap_ns = now_ns - board->write_ns;
    board->write_ns = now_ns;
    board->pet_ns = board->petted ? board->pet_ns : now_ns;
    board->petted = true;
    board->writes++;
    if (link_send(board->link, bytes, len) < 0) {
        hm2_plan_write_failed(board->plan);
        if (turns)
            hm2_plan_give_up(board->plan);
        note_loss(board);
    } else if (turns) {
        board->outstanding = board->pipeline.turned = true;
        board->request_ns = now_ns;
    }
    if (board->flight)
        board_flight_written(board->flight, now_ns, link_now_ns(board->link), len);
}
