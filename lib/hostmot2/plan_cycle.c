/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The transfer plan in the cycle: requests and their replies, writes and their confirmation. Realtime. */
#include <hm2/plan.h>

#include <string.h>

#include "plan_internal.h"

static uint32_t next_seq(const uint32_t seq)
{
    return seq == UINT32_MAX ? 1 : seq + 1;
}

/* ---- set-up sections --------------------------------------------------------------------------------------------- */

static bool in_state(const struct hm2_plan *const plan, const unsigned number, const enum plan_state state)
{
    return (plan->in_state[state].bits[number / 64u] >> number % 64u & 1u) != 0;
}

static void move(struct hm2_plan *const plan, const unsigned number, const enum plan_state state)
{
    const uint64_t bit = UINT64_C(1) << number % 64u;
    for (unsigned s = 0; s < PLAN_STATES; s++)
        plan->in_state[s].bits[number / 64u] &= ~bit;
    plan->in_state[state].bits[number / 64u] |= bit;
}

static bool is_empty(const struct plan_set *const set)
{
    uint64_t any = 0;
    for (unsigned i = 0; i < PLAN_SET_WORDS; i++)
        any |= set->bits[i];
    return any == 0;
}

/* The card has other words than these now. On demand: not confirmed any longer, but nobody asked to send them either.
 */
static void changed(const struct hm2_section *const section)
{
    struct hm2_plan *const plan = section->plan;
    const unsigned number = section->number;
    if (!plan->sections[number].on_demand)
        move(plan, number, PLAN_DIRTY);
    else
        plan->in_state[PLAN_CLEAN].bits[number / 64u] &= ~(UINT64_C(1) << number % 64u);
}

void hm2_section_set(struct hm2_section *const section, const unsigned word, const uint32_t value)
{
    uint8_t *const at = section->bytes + 4u * word;
    if (hm2_get_le32(at) == value)
        return;
    hm2_put_le32(at, value);
    changed(section);
}

void hm2_section_move(struct hm2_section *const section, const uint16_t address)
{
    uint8_t *const field = section->bytes - PLAN_ADDRESS_BYTES;
    if (hm2_get_le16(field) == address)
        return;
    hm2_put_le16(field, address);
    changed(section);
}

uint32_t hm2_section_get(const struct hm2_section *const section, const unsigned word)
{
    return hm2_get_le32(section->bytes + 4u * word);
}

void hm2_section_touch(struct hm2_section *const section)
{
    move(section->plan, section->number, PLAN_DIRTY);
}

bool hm2_section_confirmed(const struct hm2_section *const section)
{
    return in_state(section->plan, section->number, PLAN_CLEAN);
}

bool hm2_plan_settled(const struct hm2_plan *const plan)
{
    return plan->session_state == PLAN_CLEAN && is_empty(&plan->in_state[PLAN_DIRTY]) &&
           is_empty(&plan->in_state[PLAN_FLYING]);
}

void hm2_plan_touch_all(struct hm2_plan *const plan)
{
    /* While the card still knows the session, its number stays a witness: a power loss right now must not be missed. */
    if (!plan->facts.session_kept) {
        plan->session_state = PLAN_DIRTY;
        plan->facts.session_kept = true;
    }
    for (unsigned i = 0; i < plan->section_count; i++)
        if (!plan->sections[i].on_demand)
            move(plan, i, PLAN_DIRTY);
}

/* ---- request and reply ------------------------------------------------------------------------------------------- */

void plan_begin_request(struct hm2_plan *const plan)
{
    plan->request_seq = next_seq(plan->request_seq);
    plan->requests++;
    plan->answered <<= 1;
    plan->outstanding = true;
    plan->write_at_request = plan->write_seq;
    hm2_put_le32(plan->request + PLAN_COMMAND_BYTES, plan->request_seq);
}

const uint8_t *hm2_plan_request(struct hm2_plan *const plan, size_t *const len)
{
    plan_begin_request(plan);
    *len = plan->request_len;
    return plan->request;
}

const uint8_t *hm2_plan_request_again(const struct hm2_plan *const plan, size_t *const len)
{
    *len = plan->request_len;
    return plan->repeatable && plan->outstanding ? plan->request : NULL;
}

uint8_t *hm2_plan_reply_buffer(struct hm2_plan *const plan)
{
    return plan->landing;
}

size_t hm2_plan_reply_capacity(const struct hm2_plan *const plan)
{
    return sizeof plan->landing;
}

size_t hm2_plan_reply_bytes(const struct hm2_plan *const plan)
{
    return plan->reply_len;
}

void hm2_plan_give_up(struct hm2_plan *const plan)
{
    plan->outstanding = false;
}

/* Requests made after the one with this number; no less than plan->requests when it was never made. */
static uint64_t requests_since(const struct hm2_plan *const plan, const uint32_t seq)
{
    if (seq == 0)
        return UINT64_MAX;
    const uint32_t distance = plan->request_seq - seq;
    return seq <= plan->request_seq ? distance : distance - 1u; /* the count skips 0 where it wraps */
}

/* A section's write is proven when the reply shows its number; it is lost, or must be taken as lost, when the reply
 * shows another one although the request was made later than the write. */
static void settle_sections(struct hm2_plan *const plan, const uint32_t shown)
{
    for (unsigned i = 0; i < plan->section_count; i++) {
        const struct plan_section *const entry = &plan->sections[i];
        const bool flying = in_state(plan, i, PLAN_FLYING);
        const bool lost = flying && hm2_delta32(entry->write_seq, plan->write_at_request) <= 0;
        /* An older write came after it and may have undone it. */
        const bool undone =
            in_state(plan, i, PLAN_CLEAN) && !entry->on_demand && hm2_delta32(entry->write_seq, shown) > 0;
        if (flying && entry->write_seq == shown)
            move(plan, i, PLAN_CLEAN);
        else if (lost || undone)
            move(plan, i, PLAN_DIRTY);
    }
}

static void settle_session(struct hm2_plan *const plan, const uint32_t shown)
{
    if (plan->session_state == PLAN_FLYING && shown == plan->session)
        plan->session_state = PLAN_CLEAN;
    else if (plan->session_state == PLAN_FLYING && hm2_delta32(plan->session_write_seq, plan->write_at_request) <= 0)
        plan->session_state = PLAN_DIRTY;
    else if (plan->session_state == PLAN_CLEAN && shown != plan->session)
        plan->facts.session_kept = false;
}

/* An older write was carried out after the ones that brought these. A turn's own number hides that, so it also reads
 * the number that it found. */
HM2_RARE static void resend_undone(struct hm2_plan *const plan, const uint32_t found)
{
    for (unsigned i = 0; i < plan->section_count; i++) {
        const struct plan_section *const entry = &plan->sections[i];
        if (in_state(plan, i, PLAN_CLEAN) && !entry->on_demand && hm2_delta32(entry->write_seq, found) > 0)
            move(plan, i, PLAN_DIRTY);
    }
}

static void take_extra(struct hm2_plan *const plan, const uint8_t extra[const PLAN_EXTRA_BYTES])
{
    const uint32_t found = hm2_get_le32(extra + PLAN_EXTRA_BEFORE);
    plan->facts.before_kept = found == plan->write_before;
    if (hm2_delta32(plan->section_write_seq, found) > 0)
        resend_undone(plan, found);
    plan->facts.waited_us = hm2_get_le16(extra + PLAN_EXTRA_WAITED);
}

static const uint8_t *trailer_of(const struct hm2_plan *const plan, const uint8_t *const reply)
{
    return reply + plan->reply_len - PLAN_TRAILER_BYTES;
}

static void accept(struct hm2_plan *const plan)
{
    memcpy(plan->reply, plan->landing, plan->reply_len);
    const uint8_t *const trailer = trailer_of(plan, plan->reply);
    const uint32_t write_shown = hm2_get_le32(trailer + PLAN_TRAILER_WRITE);
    plan->outstanding = false;
    plan->facts.write_confirmed =
        plan->write_at_request == 0 || write_shown == plan->write_at_request || write_shown == plan->write_seq;
    plan->facts.card_rx_udp = hm2_get_le16(trailer + PLAN_TRAILER_RX_UDP);
    if (!is_empty(&plan->in_state[PLAN_FLYING]) || hm2_delta32(plan->section_write_seq, write_shown) > 0)
        settle_sections(plan, write_shown);
    settle_session(plan, hm2_get_le32(trailer + PLAN_TRAILER_SESSION));
}

/* By how many packets the card had received more when it made this reply than when it made the last fresh one: two that
 * have overtaken each other are told by that, and a second one to the same request. */
static int16_t packets_since(const struct hm2_plan *const plan)
{
    return hm2_delta16(hm2_get_le16(trailer_of(plan, plan->landing) + PLAN_TRAILER_RX_UDP),
                       hm2_get_le16(trailer_of(plan, plan->reply) + PLAN_TRAILER_RX_UDP));
}

/* Does it answer the same request as the last fresh one? */
static bool answers_again(const struct hm2_plan *const plan)
{
    return hm2_get_le32(trailer_of(plan, plan->landing) + PLAN_TRAILER_REQUEST) ==
           hm2_get_le32(trailer_of(plan, plan->reply) + PLAN_TRAILER_REQUEST);
}

/* Its number, when it is remembered and was made in the present layout. */
static uint64_t readable_request(const struct hm2_plan *const plan, const uint64_t age)
{
    const uint64_t number = plan->requests - age;
    return age < 64 && number > plan->requests_before ? number : 0;
}

enum hm2_reply hm2_plan_judge(struct hm2_plan *const plan, const size_t len)
{
    bool is_turn = false;
    uint8_t extra[PLAN_EXTRA_BYTES];
    if ((plan->pipelines ? plan_unfold_turn(plan, len, &is_turn, extra) : len) != plan->reply_len)
        return HM2_REPLY_MALFORMED;
    const uint8_t *const trailer = trailer_of(plan, plan->landing);
    const uint64_t age = requests_since(plan, hm2_get_le32(trailer + PLAN_TRAILER_REQUEST));
    if (age >= plan->requests)
        return HM2_REPLY_MALFORMED;
    /* 64 requests are remembered. A reply to an older one counts as late: so old a duplicate is as good as that. */
    const uint64_t bit = age < 64 ? UINT64_C(1) << age : 0;
    if ((plan->answered & bit) != 0) {
        plan->late_request = answers_again(plan) && packets_since(plan) > 0 ? readable_request(plan, age) : 0;
        return HM2_REPLY_STALE;
    }
    plan->answered |= bit;
    if (age > 0 || !plan->outstanding) {
        plan->late_request = packets_since(plan) >= 0 ? readable_request(plan, age) : 0;
        return HM2_REPLY_LATE;
    }
    if (is_turn) {
        take_extra(plan, extra);
    } else {
        plan->facts.waited_us = 0;
        plan->facts.before_kept = false;
    }
    accept(plan);
    return HM2_REPLY_FRESH;
}

uint64_t hm2_plan_requests(const struct hm2_plan *const plan)
{
    return plan->requests;
}

struct hm2_plan_tally hm2_plan_tally(const struct hm2_plan *const plan)
{
    const uint8_t *const trailer = trailer_of(plan, plan->reply);
    const uint16_t came = hm2_get_le16(trailer + PLAN_TRAILER_RX_UDP),
                   answered = hm2_get_le16(trailer - PLAN_REPLIES_BYTES);
    return (struct hm2_plan_tally){
        .requests = (uint16_t)(answered - plan->requests + 1u),
        .writes = (uint16_t)(came - answered - plan->write_at_request + plan->turns),
        .answered = answered,
    };
}

uint64_t hm2_plan_late_request(const struct hm2_plan *const plan)
{
    return plan->late_request;
}

void hm2_plan_swap_late(struct hm2_plan *const plan)
{
    uint8_t fresh[sizeof plan->reply];
    memcpy(fresh, plan->reply, plan->reply_len);
    memcpy(plan->reply, plan->landing, plan->reply_len);
    memcpy(plan->landing, fresh, plan->reply_len);
}

struct hm2_plan_facts hm2_plan_facts(const struct hm2_plan *const plan)
{
    return plan->facts;
}

/* ---- write ------------------------------------------------------------------------------------------------------- */

/* Append dirty sections in order, up to `end`; the first that does not fit ends it, so that order is kept. */
static size_t add_sections(struct hm2_plan *const plan, size_t used, const size_t end)
{
    for (unsigned i = 0; i < plan->section_count; i++) {
        struct plan_section *const entry = &plan->sections[i];
        if (!in_state(plan, i, PLAN_DIRTY))
            continue;
        if (used + entry->len > end)
            break;
        memcpy(plan->write + used, plan->setup + entry->at, entry->len);
        used += entry->len;
        entry->write_seq = plan->section_write_seq = plan->write_seq;
        move(plan, i, PLAN_FLYING);
    }
    return used;
}

static inline size_t compose(struct hm2_plan *const plan, const size_t most)
{
    size_t used = plan->fixed_len;
    plan->write_seq = next_seq(plan->write_seq);
    if (plan->session_state == PLAN_DIRTY) {
        memcpy(plan->write + used, plan->session_commands, PLAN_SESSION_BYTES);
        used += PLAN_SESSION_BYTES;
        plan->session_state = PLAN_FLYING;
        plan->session_write_seq = plan->write_seq;
    }
    if (!is_empty(&plan->in_state[PLAN_DIRTY]))
        used = add_sections(plan, used, most - PLAN_NUMBER_BYTES);
    hm2_put_le32(plan->number_command + PLAN_COMMAND_BYTES, plan->write_seq);
    memcpy(plan->write + used, plan->number_command, PLAN_NUMBER_BYTES);
    return used + PLAN_NUMBER_BYTES;
}

size_t plan_compose_write(struct hm2_plan *const plan, const size_t most)
{
    return compose(plan, most);
}

const uint8_t *hm2_plan_write(struct hm2_plan *const plan, size_t *const len)
{
    *len = compose(plan, sizeof plan->write);
    return plan->write;
}

void hm2_plan_write_failed(struct hm2_plan *const plan)
{
    for (unsigned i = 0; i < plan->section_count; i++)
        if (in_state(plan, i, PLAN_FLYING) && plan->sections[i].write_seq == plan->write_seq)
            move(plan, i, PLAN_DIRTY);
    if (plan->session_state == PLAN_FLYING && plan->session_write_seq == plan->write_seq)
        plan->session_state = PLAN_DIRTY;
}
