/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "board_private.h"

bool board_notices_push(struct board_notices *const notices, const struct board_event *const event)
{
    const uint32_t produced = atomic_load_explicit(&notices->produced, memory_order_relaxed);
    /* acquire: the consumer has finished reading the entry that is overwritten here */
    const uint32_t consumed = atomic_load_explicit(&notices->consumed, memory_order_acquire);
    if (produced - consumed >= NOTICE_RING_SIZE) {
        atomic_fetch_add_explicit(&notices->overflows, 1, memory_order_relaxed);
        return false;
    }
    notices->ring[produced % NOTICE_RING_SIZE] = *event;
    atomic_store_explicit(&notices->produced, produced + 1, memory_order_release);
    return true;
}

bool board_notices_pop(struct board_notices *const notices, struct board_event *const event)
{
    const uint32_t consumed = atomic_load_explicit(&notices->consumed, memory_order_relaxed);
    if (atomic_load_explicit(&notices->produced, memory_order_acquire) == consumed)
        return false;
    *event = notices->ring[consumed % NOTICE_RING_SIZE];
    atomic_store_explicit(&notices->consumed, consumed + 1, memory_order_release);
    return true;
}

static unsigned hash(const struct hm2_module *const module, const int kind, const char *const point,
                     const unsigned instance)
{
    const uintptr_t mixed =
        ((uintptr_t)module >> 4) + (uintptr_t)point + (uintptr_t)(unsigned)kind * 7u + (uintptr_t)instance * 31u;
    return (unsigned)(mixed % (NOTICE_ACTIVE_SIZE / NOTICE_ACTIVE_WAYS)) * NOTICE_ACTIVE_WAYS;
}

bool board_notices_is_new(struct board_notices *const notices, const struct hm2_module *const module, const int kind,
                          const char *const point, const unsigned instance)
{
    struct notice_active *const set = notices->active + hash(module, kind, point, instance);
    struct notice_active *place = set;
    for (unsigned i = 0; i < NOTICE_ACTIVE_WAYS; i++) {
        if (set[i].module == module && set[i].kind == kind && set[i].point == point && set[i].instance == instance) {
            const bool absent = notices->now_ns - set[i].last_ns > NOTICE_ABSENT_NS;
            set[i].last_ns = notices->now_ns;
            return absent;
        }
        if (place->module && (!set[i].module || set[i].last_ns < place->last_ns))
            place = set + i;
    }
    *place = (struct notice_active){module, kind, point, instance, notices->now_ns};
    return true;
}

static uint32_t microseconds(const int64_t ns)
{
    return ns < 0 ? 0 : ns / 1000 > UINT32_MAX ? UINT32_MAX : (uint32_t)(ns / 1000);
}

void hm2_notice(const struct hm2_module *const module, const enum hm2_notice notice, const unsigned instance,
                const double value)
{
    hm2_notice_point(module, notice, NULL, instance, value);
}

void hm2_notice_point(const struct hm2_module *const module, const enum hm2_notice notice, const char *const point,
                      const unsigned instance, const double value)
{
    if (module->noticed)
        module->noticed[notice]++;
    if (!module->board)
        return;
    struct hm2_board *const board = module->board;
    if (!board_notices_is_new(&board->notices, module, (int)notice, point, instance))
        return;
    struct board_event event = {
        .module = module, .kind = (int)notice, .point = point, .instance = instance, .value = value};
    if (notice == HM2_NOTICE_WATCHDOG_BIT) {
        event.words[BOARD_BITE_REASON] = board_bite_reason(board);
        event.words[BOARD_BITE_GAP_US] = microseconds(board_write_gap_ns(board));
        event.words[BOARD_BITE_PERIOD_US] = microseconds(board->period_ns);
    }
    (void)board_notices_push(&board->notices, &event);
}

void board_event(struct hm2_board *const board, const enum board_event_kind kind, const struct board_event *const facts)
{
    struct board_notices *const notices = &board->notices;
    const bool known = board->event_seen[kind] && notices->now_ns - board->event_ns[kind] <= NOTICE_ABSENT_NS;
    board->event_seen[kind] = true;
    board->event_ns[kind] = notices->now_ns;
    if (known)
        return;
    struct board_event event = *facts;
    event.module = NULL;
    event.kind = (int)kind;
    (void)board_notices_push(notices, &event);
}
