/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pipeline.h"

#include "../module/dpll.h"
#include "board_private.h"

/* Replies late or lost, each worth LATE_LEVEL, may not come more often than one in LATE_LEVEL for long. A pause of the
 * host, the network or the card of some 25 ms, in which each is late, is no reason for plain cycles: they lose more of
 * them. */
#define LATE_LEVEL  16u
#define LEVEL_LIMIT 512u

#define RTT_KNOWN       256u           /* replies */
#define RTT_ABOVE       32u            /* of 1024 may take longer than the bound */
#define DPLL_STARTS     110u           /* writes, in the first hundred of which the loop is held */
#define LOOK_EVERY      16u            /* cycles */
#define GUARD_PER_MILLE 50             /* of the period */
#define WORK_FORGETS    64             /* peaks lose this part of themselves in a cycle */
#define JITTER_NS       INT64_C(40000) /* a turn may be so late and finds transfers finished */

#define FIRST_PAUSE_NS   INT64_C(1000000000)
#define LONGEST_PAUSE_NS INT64_C(64000000000)
#define STEADY_NS        INT64_C(60000000000)

static uint32_t us_of(const int64_t ns)
{
    return ns < 0 ? 0 : ns / 1000 > UINT32_MAX ? UINT32_MAX : (uint32_t)(ns / 1000);
}

static int64_t timer_ns(struct hm2_board *const board)
{
    return hm2_dpll_timer_ns(hm2_board_module(board, HM2_GTAG_DPLL), board->pipeline.timer);
}

HM2_RARE static void tell(struct hm2_board *const board, const enum board_event_kind kind)
{
    const struct board_pipeline *const p = &board->pipeline;
    board_event(board, kind,
                &(struct board_event){.words = {
                                          [BOARD_PIPELINE_WORK_US] = us_of(p->work_ns),
                                          [BOARD_PIPELINE_WAIT_US] = us_of(p->timeout_ns),
                                          [BOARD_PIPELINE_RTT_US] = us_of(p->rtt_ns),
                                          [BOARD_PIPELINE_PERIOD_US] = us_of(board->period_ns),
                                          [BOARD_PIPELINE_LATE] = *p->points->late,
                                          [BOARD_PIPELINE_EARLY] = *p->points->early,
                                          [BOARD_PIPELINE_TIMER_US] = us_of(timer_ns(board)),
                                          [BOARD_PIPELINE_NEED_US] = us_of(p->need_ns),
                                      }});
}

void board_pipeline_stop(struct hm2_board *const board)
{
    struct board_pipeline *const p = &board->pipeline;
    if (p->timer == 0)
        return;
    p->runs = false;
    *p->points->active = false;
}

HM2_RARE static void fall_back(struct hm2_board *const board, const int64_t now_ns)
{
    struct board_pipeline *const p = &board->pipeline;
    if (p->pause_ns == 0 || now_ns - p->started_ns > STEADY_NS)
        p->pause_ns = FIRST_PAUSE_NS;
    p->plain_until_ns = now_ns + p->pause_ns;
    p->pause_ns = p->pause_ns < LONGEST_PAUSE_NS ? 2 * p->pause_ns : p->pause_ns;
    *p->points->falls = *p->points->falls + 1u;
    board_pipeline_stop(board);
    tell(board, BOARD_EVENT_PIPELINE_FALLS);
}

/* Room that is left in a period; negative = none. */
static int64_t compute_room_ns(struct hm2_board *const board)
{
    struct board_pipeline *const p = &board->pipeline;
    const int64_t wait_ns = timer_ns(board);
    /* Arrivals jitter around the loop's reference by half of the timer's offset before the card stops waiting. */
    p->timeout_ns = wait_ns + wait_ns / 2;
    p->rtt_ns = board_rtt_bound_ns(&board->rtt, RTT_ABOVE);
    const int64_t room_ns = board->period_ns - p->work_ns - p->timeout_ns - p->rtt_ns;
    *p->points->margin_us = (double)room_ns * 1e-3;
    const bool possible = wait_ns >= 1000 && p->timeout_ns <= board->period_ns / 2 && p->timeout_ns <= 65535000;
    return possible ? room_ns - board->period_ns / 1000 * GUARD_PER_MILLE : -1;
}

static bool may_run(struct hm2_board *const board, const int64_t now_ns)
{
    struct board_pipeline *const p = &board->pipeline;
    if (board->rtt.total < RTT_KNOWN || board->writes < DPLL_STARTS || now_ns < p->plain_until_ns)
        return false;
    if (board->cycles - p->looked < LOOK_EVERY)
        return false;
    p->looked = board->cycles;
    const bool room = compute_room_ns(board) >= 0, time = timer_ns(board) >= p->need_ns;
    if (!room || !time)
        tell(board, room ? BOARD_EVENT_PIPELINE_NO_TIME : BOARD_EVENT_PIPELINE_NO_ROOM);
    return room && time;
}

HM2_RARE static void align(struct hm2_board *const board)
{
    hm2_dpll_align(hm2_board_module(board, HM2_GTAG_DPLL));
}

HM2_RARE static void begin(struct hm2_board *const board, const int64_t now_ns)
{
    struct board_pipeline *const p = &board->pipeline;
    p->runs = true;
    p->level = 0;
    p->started_ns = now_ns;
    *p->points->active = true;
    p->settled = false;
    align(board);
    tell(board, BOARD_EVENT_PIPELINE_RUNS);
}

/* The first turn came behind a read that waited for its reply, all others come sooner: the loop is aligned once more.
 */
HM2_RARE static void settle(struct hm2_board *const board)
{
    align(board);
    board->pipeline.settled = true;
}

static void note_work(struct hm2_board *const board, const int64_t now_ns)
{
    struct board_pipeline *const p = &board->pipeline;
    /* Waiting for a reply is no work, and without a reply nobody knows how much of the time was. */
    if (board->received_ns == 0)
        return;
    const int64_t work_ns = now_ns - board->received_ns;
    const int64_t before_ns = p->work_ns - p->work_ns / WORK_FORGETS;
    p->work_ns = work_ns > before_ns ? work_ns : before_ns;
}

bool board_pipeline_turns(struct hm2_board *const board, const int64_t now_ns)
{
    struct board_pipeline *const p = &board->pipeline;
    if (board->outstanding || board->cycles == 0 || board->recovery != BOARD_NORMAL ||
        !hm2_plan_pipelines(board->plan)) {
        board_pipeline_stop(board);
        return false;
    }
    note_work(board, now_ns);
    if (p->runs && p->level >= LEVEL_LIMIT)
        fall_back(board, now_ns);
    else if (!p->runs && may_run(board, now_ns))
        begin(board, now_ns);
    else if (p->runs && !p->settled)
        settle(board);
    return p->runs;
}

uint16_t board_pipeline_timeout_us(const struct hm2_board *const board)
{
    return (uint16_t)(board->pipeline.timeout_ns / 1000);
}

int64_t board_pipeline_sample_ns(const struct hm2_board *const board)
{
    return board->request_ns + hm2_plan_facts(board->plan).waited_us * INT64_C(1000);
}

void board_pipeline_measure(struct hm2_board *const board)
{
    struct board_pipeline *const p = &board->pipeline;
    p->need_ns = 0;
    for (unsigned i = 0; i < board->module_count; i++) {
        const struct hm2_module *const module = &board->modules[i];
        const int64_t ns = module->type->turn_ns ? module->type->turn_ns(module) : 0;
        p->need_ns = ns > p->need_ns ? ns : p->need_ns;
    }
}

void board_pipeline_setup(struct hm2_board *const board)
{
    const struct board_pipeline *const p = &board->pipeline;
    board_pipeline_measure(board);
    if (p->need_ns > 0)
        hm2_dpll_offer_timer_ns(hm2_board_module(board, HM2_GTAG_DPLL), p->timer, p->need_ns + JITTER_NS);
}

void board_pipeline_warn(const struct hm2_board *const board, struct hm2_diag *const diag)
{
    hm2_diag_warn(diag,
                  "%s: config pipelined=%u has no effect: what a cycle writes and what it asks for do not fit into one "
                  "datagram; use fewer module instances",
                  board->prefix, board->pipeline.timer);
}

void board_pipeline_unpacked(struct hm2_board *const board)
{
    bool unfinished = false;
    for (unsigned i = 0; i < board->module_count; i++)
        if (board->modules[i].type->unfinished)
            unfinished |= board->modules[i].type->unfinished(&board->modules[i]);
    if (!unfinished)
        return;
    board->pipeline.level += LATE_LEVEL;
    *board->pipeline.points->early = *board->pipeline.points->early + 1u;
}

void board_pipeline_lost(struct hm2_board *const board)
{
    board->pipeline.level += LATE_LEVEL;
    board->cycle.turned = true;
}

void board_pipeline_received(struct hm2_board *const board, const bool on_time)
{
    struct board_pipeline *const p = &board->pipeline;
    board->cycle.turned = p->turned;
    board->cycle.before_kept = hm2_plan_facts(board->plan).before_kept;
    if (!p->turned) {
        *p->points->data_age_us = (double)(board->received_ns - board->request_ns) * 1e-3;
        return;
    }
    const uint16_t waited_us = hm2_plan_facts(board->plan).waited_us;
    const int64_t sample_ns = board_pipeline_sample_ns(board);
    *p->points->wait_us = waited_us;
    *p->points->data_age_us = (double)(board->received_ns - sample_ns) * 1e-3;
    if (on_time) {
        p->level -= p->level > 0;
        *p->points->margin_us = (double)(board->read_ns - sample_ns - p->rtt_ns) * 1e-3;
        return;
    }
    p->level += LATE_LEVEL;
    *p->points->late = *p->points->late + 1u;
    *p->points->margin_us = (double)(board->read_ns - board->received_ns) * 1e-3;
}
