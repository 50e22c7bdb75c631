/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include <pthread.h>
#include <sched.h>

#include "board_private.h"

struct fixture {
    struct hm2_board *board;
    struct hm2_module module;
    uint32_t noticed[HM2_NOTICES];
};

static struct fixture *new_fixture(void)
{
    struct fixture *const f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->board = hm2_board_new();
    assert_non_null(f->board);
    f->module.board = f->board;
    f->module.noticed = f->noticed;
    return f;
}

static void without_a_board_a_notice_is_only_counted(void **state)
{
    (void)state;
    uint32_t noticed[HM2_NOTICES] = {0};
    struct hm2_module module = {.noticed = noticed};
    hm2_notice(&module, HM2_NOTICE_QUAD_ERROR, 3, 1.0);
    hm2_notice(&module, HM2_NOTICE_QUAD_ERROR, 3, 1.0);
    assert_int_equal(noticed[HM2_NOTICE_QUAD_ERROR], 2);
    module.noticed = NULL;
    hm2_notice(&module, HM2_NOTICE_QUAD_ERROR, 3, 1.0);
}

static void a_condition_is_reported_once_until_it_was_absent(void **state)
{
    (void)state;
    struct fixture *const f = new_fixture();
    struct board_event event;
    for (int i = 0; i < 5000; i++) {
        f->board->notices.now_ns += 1000000;
        hm2_notice(&f->module, HM2_NOTICE_VALUE_CLAMPED, 2, 0.5 + i);
    }
    assert_true(board_notices_pop(&f->board->notices, &event));
    assert_ptr_equal(event.module, &f->module);
    assert_int_equal(event.kind, HM2_NOTICE_VALUE_CLAMPED);
    assert_int_equal(event.instance, 2);
    assert_true(event.value == 0.5);
    assert_false(board_notices_pop(&f->board->notices, &event));

    f->board->notices.now_ns += NOTICE_ABSENT_NS + 1;
    hm2_notice(&f->module, HM2_NOTICE_VALUE_CLAMPED, 2, 9.0);
    assert_true(board_notices_pop(&f->board->notices, &event));
    assert_true(event.value == 9.0);
    assert_int_equal(f->noticed[HM2_NOTICE_VALUE_CLAMPED], 5001);
    hm2_board_free(f->board);
    free(f);
}

static void different_conditions_are_reported_each(void **state)
{
    (void)state;
    struct fixture *const f = new_fixture();
    struct hm2_module other = f->module;
    struct board_event event;
    hm2_notice(&f->module, HM2_NOTICE_VALUE_CLAMPED, 0, 0);
    hm2_notice(&f->module, HM2_NOTICE_VALUE_CLAMPED, 1, 0);
    hm2_notice(&f->module, HM2_NOTICE_VALUE_INVALID, 0, 0);
    hm2_notice(&other, HM2_NOTICE_VALUE_CLAMPED, 0, 0);
    hm2_notice_point(&f->module, HM2_NOTICE_VALUE_CLAMPED, "scale", 0, 0);
    unsigned count = 0;
    while (board_notices_pop(&f->board->notices, &event))
        count++;
    assert_int_equal(count, 5);
    hm2_board_free(f->board);
    free(f);
}

static void a_full_ring_counts_what_it_drops_and_keeps_the_oldest(void **state)
{
    (void)state;
    struct fixture *const f = new_fixture();
    struct board_event event = {.module = &f->module};
    atomic_store(&f->board->notices.produced, UINT32_MAX - 5); /* the positions wrap on the way */
    atomic_store(&f->board->notices.consumed, UINT32_MAX - 5);
    for (unsigned i = 0; i < NOTICE_RING_SIZE + 10; i++) {
        event.instance = i;
        assert_int_equal(board_notices_push(&f->board->notices, &event), i < NOTICE_RING_SIZE);
    }
    assert_int_equal(atomic_load(&f->board->notices.overflows), 10);
    for (unsigned i = 0; i < NOTICE_RING_SIZE; i++) {
        assert_true(board_notices_pop(&f->board->notices, &event));
        assert_int_equal(event.instance, i);
    }
    assert_false(board_notices_pop(&f->board->notices, &event));
    hm2_board_free(f->board);
    free(f);
}

#define EVENTS 200000u

static void *produce(void *const context)
{
    struct board_notices *const notices = context;
    for (unsigned i = 0; i < EVENTS; i++) {
        struct board_event event = {.instance = i, .value = i};
        for (unsigned word = 0; word < NOTICE_WORDS; word++)
            event.words[word] = i;
        while (!board_notices_push(notices, &event))
            (void)sched_yield();
    }
    return NULL;
}

static void events_pass_whole_and_in_order_between_threads(void **state)
{
    (void)state;
    struct fixture *const f = new_fixture();
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, produce, &f->board->notices), 0);
    struct board_event event;
    for (unsigned i = 0; i < EVENTS;) {
        if (!board_notices_pop(&f->board->notices, &event)) {
            (void)sched_yield();
            continue;
        }
        if (event.instance != i || event.value != i || event.words[0] != i || event.words[NOTICE_WORDS - 1] != i)
            fail_msg("event %u arrived as %u", i, event.instance);
        i++;
    }
    assert_int_equal(pthread_join(thread, NULL), 0);
    hm2_board_free(f->board);
    free(f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_a_board_a_notice_is_only_counted),
        cmocka_unit_test(a_condition_is_reported_once_until_it_was_absent),
        cmocka_unit_test(different_conditions_are_reported_each),
        cmocka_unit_test(events_pass_whole_and_in_order_between_threads),
        cmocka_unit_test(a_full_ring_counts_what_it_drops_and_keeps_the_oldest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
