/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Turns of a pipelined cycle: write and request in one datagram, with a wait in the card between them
 * (docs/pipelined-cycle.md).
 *
 * The pieces are copied from the prepared request and the composed write, because modules aim some of the request's
 * commands anew in every cycle. The reply is brought into the shape of a plain one before anybody looks at it, so that
 * windows stand where they always do.
 */
#include <hm2/plan.h>

#include <string.h>

#include "plan_internal.h"

#define TIMERS 4u

int hm2_plan_pipeline(struct hm2_plan *const plan, const unsigned timer, struct hm2_diag *const diag)
{
    if (timer < 1 || timer > TIMERS)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "DPLL timer %u found, 1 to %u expected.", timer, TIMERS);
    plan->timer = timer;
    return 0;
}

bool hm2_plan_pipelines(const struct hm2_plan *const plan)
{
    return plan->pipelines;
}

/* Where a turn has no more room for the write. */
static size_t write_room(const struct hm2_plan *const plan)
{
    return sizeof plan->turn - plan->request_len - PLAN_BEFORE_BYTES - PLAN_WAIT_BYTES;
}

static bool fits(const struct hm2_plan *const plan)
{
    size_t longest = 0;
    for (unsigned i = 0; i < plan->section_count; i++)
        longest = plan->sections[i].len > longest ? plan->sections[i].len : longest;
    const size_t others = plan->request_len + PLAN_BEFORE_BYTES + PLAN_WAIT_BYTES;
    const size_t write = plan->fixed_len + PLAN_SESSION_BYTES + longest + PLAN_NUMBER_BYTES;
    return others + write <= sizeof plan->turn && plan->reply_len + PLAN_EXTRA_BYTES <= LBP16_MAX_REPLY_BYTES;
}

void plan_prepare_turn(struct hm2_plan *const plan)
{
    static const uint16_t no_wait = 0;
    plan->pipelines = plan->timer > 0 && fits(plan);
    if (!plan->pipelines)
        return;
    const uint16_t wait = (uint16_t)(LBP16_TIMER_WAIT_1 + 2u * (plan->timer - 1u));
    struct lbp16_builder builder;
    lbp16_builder_init(&builder, plan->turn_wait, sizeof plan->turn_wait);
    (void)lbp16_add_write16(&builder, LBP16_SPACE_TIMER, LBP16_TIMER_TIMEOUT_US, 1, &no_wait, NULL);
    (void)lbp16_add_read16(&builder, LBP16_SPACE_TIMER, wait, 1, NULL);
    (void)lbp16_add_write16(&builder, LBP16_SPACE_TIMER, LBP16_TIMER_TIMEOUT_US, 1, &no_wait, NULL);
    lbp16_builder_init(&builder, plan->turn_before, sizeof plan->turn_before);
    (void)lbp16_add_read16(&builder, LBP16_SPACE_TIMER, PLAN_SCRATCH_WRITE, 2, NULL);
}

static size_t append(struct hm2_plan *const plan, const size_t used, const uint8_t *const bytes, const size_t len)
{
    memcpy(plan->turn + used, bytes, len);
    return used + len;
}

const uint8_t *hm2_plan_turn(struct hm2_plan *const plan, const uint16_t timeout_us, size_t *const len)
{
    plan->write_before = plan->write_seq;
    plan->turns++;
    const size_t write_len = plan_compose_write(plan, write_room(plan));
    plan_begin_request(plan);
    hm2_put_le16(plan->turn_wait + PLAN_COMMAND_BYTES, timeout_us);
    const uint8_t *const arrival = plan->request + PLAN_NUMBER_BYTES;
    const uint8_t *const rest = arrival + plan->arrival_len;
    size_t used = append(plan, 0, arrival, plan->arrival_len);
    used = append(plan, used, plan->turn_before, PLAN_BEFORE_BYTES);
    used = append(plan, used, plan->write, write_len);
    used = append(plan, used, plan->turn_wait, PLAN_WAIT_BYTES);
    used = append(plan, used, plan->request, PLAN_NUMBER_BYTES);
    used = append(plan, used, rest, plan->request_len - PLAN_NUMBER_BYTES - plan->arrival_len);
    *len = used;
    return plan->turn;
}

size_t plan_unfold_turn(struct hm2_plan *const plan, const size_t len, bool *const is_turn,
                        uint8_t extra[PLAN_EXTRA_BYTES])
{
    *is_turn = plan->pipelines && len == plan->reply_len + PLAN_EXTRA_BYTES;
    if (!*is_turn)
        return len;
    uint8_t *const at = plan->landing + plan->arrival_bytes;
    memcpy(extra, at, PLAN_EXTRA_BYTES);
    memmove(at, at + PLAN_EXTRA_BYTES, plan->reply_len - plan->arrival_bytes);
    return plan->reply_len;
}
