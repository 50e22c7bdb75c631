/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Turns of the transfer plan: write and request in one datagram. */
#include "unit.h"

#include <hm2/bytes.h>
#include <hm2/lbp16.h>
#include <hm2/plan.h>

#include "hex.h"

#define SESSION 0x5E55104Eu

struct fixture {
    struct hm2_plan *plan;
    struct hm2_window sync, counts, outputs;
    struct hm2_section mode;
};

static int set_up(void **state)
{
    struct fixture *const f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->plan = malloc(hm2_plan_size());
    assert_non_null(f->plan);
    hm2_plan_init(f->plan, SESSION);
    assert_int_equal(hm2_plan_add_read(f->plan, &f->counts, HM2_RANK_NORMAL, 0x3000, 1, NULL), 0);
    assert_int_equal(hm2_plan_add_read(f->plan, &f->sync, HM2_RANK_ARRIVAL, 0x7600, 1, NULL), 0);
    assert_int_equal(hm2_plan_add_write(f->plan, &f->outputs, HM2_RANK_NORMAL, 0x1000, 1, NULL), 0);
    assert_int_equal(hm2_plan_add_setup(f->plan, &f->mode, HM2_RANK_NORMAL, 0x2300, 1, 0, NULL), 0);
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *const f = *state;
    free(f->plan);
    free(f);
    return 0;
}

static void freeze(const struct fixture *const f)
{
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_plan_pipeline(f->plan, 2, &diag), 0);
    if (hm2_plan_freeze(f->plan, &diag) != 0)
        fail_msg("%s", diag.text);
    assert_true(hm2_plan_pipelines(f->plan));
}

static void turn(const struct fixture *const f)
{
    size_t len;
    assert_non_null(hm2_plan_turn(f->plan, 150, &len));
}

/* The card answers the n-th request; before and written are numbers of writes. */
static enum hm2_reply answer(const struct fixture *const f, const uint32_t request, const uint32_t before,
                             const uint32_t written, const uint32_t count)
{
    uint8_t *const reply = hm2_plan_reply_buffer(f->plan);
    hm2_put_le32(reply, 0xFFFFFF00);
    hm2_put_le32(reply + 4, before);
    hm2_put_le16(reply + 8, 97);
    hm2_put_le32(reply + 10, count);
    hm2_put_le32(reply + 14, request);
    hm2_put_le32(reply + 18, written);
    hm2_put_le32(reply + 22, SESSION);
    hm2_put_le16(reply + 26, 5);
    return hm2_plan_judge(f->plan, 28);
}

static void a_turn_is_laid_out_byte_for_byte(void **state)
{
    struct fixture *const f = *state;
    uint8_t golden[256];
    size_t len;
    freeze(f);
    hm2_window_set(&f->outputs, 0, 0x01020304);
    hm2_section_set(&f->mode, 0, 7);
    const uint8_t *const data = hm2_plan_turn(f->plan, 150, &len);
    assert_int_equal(len, hex_bytes("81420076 82511400 "
                                    "81C20010 04030201 81D10400 0000 82D11800 4E10555E 81C20023 07000000 "
                                    "82D11400 01000000 "
                                    "81D10400 9600 81510A00 81D10400 0000 "
                                    "82D11000 01000000 81420030 86511000 81590A00",
                                    golden, sizeof golden));
    assert_memory_equal(data, golden, len);
}

static void its_reply_confirms_the_write_and_reaches_the_windows(void **state)
{
    struct fixture *const f = *state;
    freeze(f);
    turn(f);
    assert_int_equal(answer(f, 1, 0, 1, 1234), HM2_REPLY_FRESH);
    assert_int_equal(hm2_window_get(&f->counts, 0), 1234);
    assert_int_equal(hm2_window_get(&f->sync, 0), 0xFFFFFF00);
    assert_true(hm2_plan_settled(f->plan));
    const struct hm2_plan_facts facts = hm2_plan_facts(f->plan);
    assert_true(facts.write_confirmed && facts.session_kept);
    assert_int_equal(facts.waited_us, 97);
}

static void what_is_not_the_reply_is_told_apart(void **state)
{
    struct fixture *const f = *state;
    freeze(f);
    turn(f);
    assert_int_equal(answer(f, 2, 0, 1, 0), HM2_REPLY_MALFORMED);
    assert_int_equal(answer(f, 1, 0, 1, 1), HM2_REPLY_FRESH);
    assert_int_equal(answer(f, 1, 0, 1, 2), HM2_REPLY_STALE);
    turn(f);
    hm2_plan_give_up(f->plan);
    turn(f);
    assert_int_equal(answer(f, 2, 1, 2, 3), HM2_REPLY_LATE);
    assert_int_equal(hm2_window_get(&f->counts, 0), 1);
    hm2_plan_swap_late(f->plan);
    assert_int_equal(hm2_window_get(&f->counts, 0), 3);
    hm2_plan_swap_late(f->plan);
    assert_int_equal(hm2_window_get(&f->counts, 0), 1);
    assert_int_equal(answer(f, 3, 2, 3, 4), HM2_REPLY_FRESH);
    assert_int_equal(hm2_window_get(&f->counts, 0), 4);
}

static void a_reply_tells_whether_the_write_before_it_was_the_last_one(void **state)
{
    struct fixture *const f = *state;
    size_t len;
    freeze(f);
    turn(f);
    turn(f);
    assert_int_equal(answer(f, 2, 1, 2, 0), HM2_REPLY_FRESH);
    assert_true(hm2_plan_facts(f->plan).before_kept);
    turn(f);
    turn(f);
    assert_int_equal(answer(f, 4, 2, 4, 0), HM2_REPLY_FRESH); /* the third was lost */
    assert_false(hm2_plan_facts(f->plan).before_kept);
    (void)hm2_plan_write(f->plan, &len);
    turn(f);
    assert_int_equal(answer(f, 5, 5, 6, 0), HM2_REPLY_FRESH); /* a plain write counts as well */
    assert_true(hm2_plan_facts(f->plan).before_kept);
}

static void a_turn_counts_as_a_request(void **state)
{
    struct fixture *const f = *state;
    size_t len;
    freeze(f);
    turn(f);
    const struct hm2_plan_tally one = hm2_plan_tally(f->plan);
    turn(f);
    const struct hm2_plan_tally two = hm2_plan_tally(f->plan);
    assert_int_equal((uint16_t)(one.requests - two.requests), 1);
    assert_int_equal(one.writes, two.writes);
    (void)hm2_plan_write(f->plan, &len);
    (void)hm2_plan_request(f->plan, &len);
    const struct hm2_plan_tally three = hm2_plan_tally(f->plan);
    assert_int_equal((uint16_t)(two.requests - three.requests), 1);
    assert_int_equal((uint16_t)(two.writes - three.writes), 1);
}

static void sections_of_a_lost_turn_are_sent_again(void **state)
{
    struct fixture *const f = *state;
    freeze(f);
    turn(f);
    assert_int_equal(answer(f, 1, 0, 1, 0), HM2_REPLY_FRESH);
    hm2_section_set(&f->mode, 0, 9);
    turn(f);
    hm2_plan_give_up(f->plan);
    turn(f);
    assert_int_equal(answer(f, 3, 1, 3, 0), HM2_REPLY_FRESH);
    assert_false(hm2_section_confirmed(&f->mode));
    turn(f);
    assert_int_equal(answer(f, 4, 3, 4, 0), HM2_REPLY_FRESH);
    assert_true(hm2_section_confirmed(&f->mode));
}

/* The second turn was on its way longer than the third: what the third brought is undone. */
static void an_older_turn_that_arrives_between_two_newer_ones_is_noticed(void **state)
{
    struct fixture *const f = *state;
    freeze(f);
    turn(f);
    assert_int_equal(answer(f, 1, 0, 1, 0), HM2_REPLY_FRESH);
    hm2_section_set(&f->mode, 0, 8);
    turn(f);
    hm2_plan_give_up(f->plan);
    hm2_section_set(&f->mode, 0, 9);
    turn(f);
    assert_int_equal(answer(f, 3, 1, 3, 0), HM2_REPLY_FRESH);
    assert_true(hm2_section_confirmed(&f->mode));
    turn(f);
    assert_int_equal(answer(f, 4, 2, 4, 0), HM2_REPLY_FRESH);
    assert_false(hm2_section_confirmed(&f->mode));
}

static void plain_requests_and_turns_follow_each_other(void **state)
{
    struct fixture *const f = *state;
    size_t len;
    freeze(f);
    turn(f);
    assert_int_equal(answer(f, 1, 0, 1, 11), HM2_REPLY_FRESH);
    (void)hm2_plan_request(f->plan, &len);
    uint8_t *const reply = hm2_plan_reply_buffer(f->plan);
    hm2_put_le32(reply, 0);
    hm2_put_le32(reply + 4, 22);
    hm2_put_le32(reply + 8, 2);
    hm2_put_le32(reply + 12, 1);
    hm2_put_le32(reply + 16, SESSION);
    assert_int_equal(hm2_plan_judge(f->plan, 22), HM2_REPLY_FRESH);
    assert_int_equal(hm2_window_get(&f->counts, 0), 22);
    assert_int_equal(hm2_plan_facts(f->plan).waited_us, 0);
    turn(f);
    assert_int_equal(answer(f, 3, 1, 2, 33), HM2_REPLY_FRESH);
}

static void too_much_in_one_datagram_rules_turns_out(void **state)
{
    struct fixture *const f = *state;
    struct hm2_window wide[3];
    struct hm2_diag diag = {0};
    freeze(f);
    hm2_plan_reopen(f->plan);
    for (unsigned i = 0; i < 3; i++)
        assert_int_equal(
            hm2_plan_add_write(f->plan, &wide[i], HM2_RANK_NORMAL, (uint16_t)(0x4000 + 508 * i), 114, NULL), 0);
    assert_int_equal(hm2_plan_freeze(f->plan, &diag), 0);
    assert_true(hm2_plan_pipelines(f->plan));
    hm2_plan_reopen(f->plan);
    struct hm2_window more;
    assert_int_equal(hm2_plan_add_write(f->plan, &more, HM2_RANK_NORMAL, 0x6000, 5, NULL), 0);
    assert_int_equal(hm2_plan_freeze(f->plan, &diag), 0);
    assert_false(hm2_plan_pipelines(f->plan));

    hm2_plan_init(f->plan, SESSION);
    assert_int_equal(hm2_plan_pipeline(f->plan, 5, &diag), HM2_ERR_RANGE);
}

#define TEST(function) cmocka_unit_test_setup_teardown(function, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_turn_is_laid_out_byte_for_byte),
        TEST(its_reply_confirms_the_write_and_reaches_the_windows),
        TEST(what_is_not_the_reply_is_told_apart),
        TEST(a_reply_tells_whether_the_write_before_it_was_the_last_one),
        TEST(a_turn_counts_as_a_request),
        TEST(sections_of_a_lost_turn_are_sent_again),
        TEST(an_older_turn_that_arrives_between_two_newer_ones_is_noticed),
        TEST(plain_requests_and_turns_follow_each_other),
        TEST(too_much_in_one_datagram_rules_turns_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
