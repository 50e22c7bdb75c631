/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The transfer plan against golden bytes and against a card that keeps registers and scratch memory. */
#include "unit.h"

#include <hm2/bytes.h>
#include <hm2/lbp16.h>
#include <hm2/plan.h>

#include "hex.h"
#include "plan_internal.h" /* to begin close to the wrap of a 32-bit count */

#define SESSION 0x5E55104Eu

/* ---- a card: registers that keep what was written ---------------------------------------------------------------- */

struct card {
    uint8_t registers[0x10000];
    uint8_t timer[LBP16_TIMER_BYTES];
    uint16_t rx_udp;
    uint32_t fifo[64]; /* words written without increment */
    unsigned fifo_used;
};

static void card_write(struct card *const card, const struct lbp16_command *const command, const uint8_t *const payload)
{
    const size_t item = lbp16_item_bytes(command->size);
    for (unsigned i = 0; i < command->count; i++) {
        const size_t at = command->address + (command->increment ? i * item : 0);
        memcpy((command->space == LBP16_SPACE_HM2 ? card->registers : card->timer) + at, payload + i * item, item);
        if (!command->increment)
            card->fifo[card->fifo_used++] = hm2_get_le32(payload + i * item);
    }
}

static size_t card_read(const struct card *const card, const struct lbp16_command *const command, uint8_t *const reply)
{
    const size_t bytes = lbp16_data_bytes(command);
    if (command->space == LBP16_SPACE_CONTROL)
        hm2_put_le16(reply, card->rx_udp);
    else
        memcpy(reply, (command->space == LBP16_SPACE_HM2 ? card->registers : card->timer) + command->address, bytes);
    return bytes;
}

/* Carry a datagram out; every command must be whole and of a kind that the firmware takes. */
static size_t card_receive(struct card *const card, const uint8_t *const data, const size_t len, uint8_t *const reply)
{
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len, reply_len = 0;
    bool truncated;
    card->rx_udp++;
    assert_true(len <= LBP16_MAX_REQUEST_BYTES);
    lbp16_parser_init(&parser, data, len);
    for (;;) {
        const int result = lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated);
        assert_true(result >= 0);
        if (result == 0)
            return reply_len;
        assert_false(truncated);
        assert_int_equal(command.size, command.space == LBP16_SPACE_HM2 ? LBP16_SIZE_32 : LBP16_SIZE_16);
        if (command.write)
            card_write(card, &command, payload);
        else
            reply_len += card_read(card, &command, reply + reply_len);
    }
}

/* ---- a plan and its card ----------------------------------------------------------------------------------------- */

struct fixture {
    struct hm2_plan *plan;
    struct card card;
    struct hm2_diag diag;
    uint8_t kept[LBP16_MAX_REPLY_BYTES]; /* a reply that the network delivers later */
};

static int set_up(void **state)
{
    struct fixture *const fixture = calloc(1, sizeof *fixture);
    assert_non_null(fixture);
    fixture->plan = malloc(hm2_plan_size());
    assert_non_null(fixture->plan);
    memset(fixture->plan, 0xA5, hm2_plan_size());
    hm2_plan_init(fixture->plan, SESSION);
    *state = fixture;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *const fixture = *state;
    free(fixture->plan);
    free(fixture);
    return 0;
}

static void freeze(struct fixture *const fixture)
{
    if (hm2_plan_freeze(fixture->plan, &fixture->diag) != 0)
        fail_msg("%s", fixture->diag.text);
}

/* A request goes to the card; its reply is kept. */
static size_t request(struct fixture *const fixture)
{
    size_t len;
    const uint8_t *const data = hm2_plan_request(fixture->plan, &len);
    return card_receive(&fixture->card, data, len, fixture->kept);
}

static enum hm2_reply deliver(struct fixture *const fixture, const size_t len)
{
    assert_true(len <= hm2_plan_reply_capacity(fixture->plan));
    memcpy(hm2_plan_reply_buffer(fixture->plan), fixture->kept, len);
    return hm2_plan_judge(fixture->plan, len);
}

static void read_cycle(struct fixture *const fixture)
{
    assert_int_equal(deliver(fixture, request(fixture)), HM2_REPLY_FRESH);
}

/* Makes the write of this cycle; the network may lose it. Returns its length. */
static size_t write_cycle(struct fixture *const fixture, const bool arrives)
{
    size_t len;
    uint8_t none[4];
    const uint8_t *const data = hm2_plan_write(fixture->plan, &len);
    if (arrives)
        assert_int_equal(card_receive(&fixture->card, data, len, none), 0);
    return len;
}

static uint32_t card_word(const struct fixture *const fixture, const uint16_t address)
{
    return hm2_get_le32(fixture->card.registers + address);
}

#define QUIET_WRITE 8u /* the number alone */

/* ---- layout ------------------------------------------------------------------------------------------------------ */

static void a_small_plan_is_laid_out_byte_for_byte(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_plan *const plan = fixture->plan;
    struct hm2_window counts, stamp, ports, latch, raw, rates, outputs, reset;
    struct hm2_section mode;
    uint8_t golden[256];
    size_t len;
    assert_int_equal(hm2_plan_add_read(plan, &counts, HM2_RANK_NORMAL, 0x3000, 2, NULL), 0);
    assert_int_equal(hm2_plan_add_read(plan, &stamp, HM2_RANK_EARLY, 0x3200, 1, NULL), 0);
    assert_int_equal(hm2_plan_add_read_movable(plan, &raw, NULL), 0);
    assert_int_equal(hm2_plan_add_read(plan, &ports, HM2_RANK_NORMAL, 0x1000, 3, NULL), 0);
    assert_int_equal(hm2_plan_add_read(plan, &latch, HM2_RANK_NORMAL, 0x3008, 1, NULL), 0); /* adjacent to counts */
    assert_int_equal(hm2_plan_add_write(plan, &rates, HM2_RANK_NORMAL, 0x2000, 2, NULL), 0);
    assert_int_equal(hm2_plan_add_write(plan, &reset, HM2_RANK_LAST, 0x2008, 1, NULL), 0); /* adjacent, other rank */
    assert_int_equal(hm2_plan_add_write(plan, &outputs, HM2_RANK_NORMAL, 0x1000, 1, NULL), 0);
    assert_int_equal(hm2_plan_add_setup(plan, &mode, HM2_RANK_NORMAL, 0x2300, 1, 0, NULL), 0);
    freeze(fixture);

    const uint8_t *data = hm2_plan_request(plan, &len);
    assert_int_equal(len, hex_bytes("82D11000 01000000 81420032 83420010 83420030 81420000 86511000 81590A00", golden,
                                    sizeof golden));
    assert_memory_equal(data, golden, len);
    assert_int_equal(hm2_plan_reply_bytes(plan), 4 * 8 + 14);

    hm2_window_set(&outputs, 0, 0x01020304);
    hm2_window_set(&rates, 1, 0xAABBCCDD);
    hm2_window_set(&reset, 0, 0x5A000000);
    hm2_section_set(&mode, 0, 7);
    data = hm2_plan_write(plan, &len);
    assert_int_equal(len, hex_bytes("81C20010 04030201 82C20020 00000000 DDCCBBAA 81C20820 0000005A"
                                    "81D10400 0000 82D11800 4E10555E 81C20023 07000000 82D11400 01000000",
                                    golden, sizeof golden));
    assert_memory_equal(data, golden, len);

    const struct hm2_plan_sizes sizes = hm2_plan_sizes(plan);
    assert_int_equal(sizes.request_bytes, 32);
    assert_int_equal(sizes.reply_bytes, 46);
    assert_int_equal(sizes.write_bytes, 28 + 8);
    assert_int_equal(sizes.setup_bytes, 8);
    assert_int_equal(sizes.read_commands, 4);
    assert_int_equal(sizes.write_commands, 3);
    assert_int_equal(sizes.sections, 1);
}

static void windows_show_the_registers_that_they_were_added_for(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_plan *const plan = fixture->plan;
    static const struct {
        enum hm2_rank rank;
        uint16_t address;
        unsigned words;
    } rows[] = {{HM2_RANK_LATE, 0x3000, 5},   {HM2_RANK_NORMAL, 0x5010, 2},  {HM2_RANK_NORMAL, 0x5000, 4},
                {HM2_RANK_FIRST, 0x5018, 1},  {HM2_RANK_NORMAL, 0x501C, 1},  {HM2_RANK_NORMAL, 0x5000, 2},
                {HM2_RANK_NORMAL, 0xFFFC, 1}, {HM2_RANK_NORMAL, 0x6000, 127}};
    enum { ROWS = sizeof rows / sizeof rows[0] };
    struct hm2_window windows[ROWS], raw;
    assert_int_equal(hm2_plan_add_read_movable(plan, &raw, NULL), 0);
    for (unsigned i = 0; i < ROWS; i++) {
        assert_int_equal(hm2_plan_add_read(plan, &windows[i], rows[i].rank, rows[i].address, rows[i].words, NULL), 0);
        assert_null(windows[i].bytes);
    }
    for (unsigned i = 0; i < 0x10000; i += 4)
        hm2_put_le32(fixture->card.registers + i, 0xC0DE0000u + i);
    freeze(fixture);
    hm2_put_le16(raw.address, 0x1234);
    read_cycle(fixture);
    for (unsigned i = 0; i < ROWS; i++)
        for (unsigned word = 0; word < rows[i].words; word++)
            assert_int_equal(hm2_window_get(&windows[i], word), 0xC0DE0000u + rows[i].address + 4 * word);
    assert_int_equal(hm2_window_get(&raw, 0), 0xC0DE1234u);
}

static void windows_merge_only_up_to_127_words(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_plan *const plan = fixture->plan;
    struct hm2_window windows[3];
    assert_int_equal(hm2_plan_add_write(plan, &windows[0], HM2_RANK_NORMAL, 0x1000, 100, NULL), 0);
    assert_int_equal(hm2_plan_add_write(plan, &windows[1], HM2_RANK_NORMAL, 0x1000 + 400, 27, NULL), 0);
    assert_int_equal(hm2_plan_add_write(plan, &windows[2], HM2_RANK_NORMAL, 0x1000 + 508, 1, NULL), 0);
    freeze(fixture);
    assert_int_equal(hm2_plan_sizes(plan).write_commands, 2);
    assert_ptr_equal(windows[1].bytes, windows[0].bytes + 400);
    assert_ptr_equal(windows[2].bytes, windows[1].bytes + 108 + 4);
    hm2_window_set(&windows[0], 99, 1);
    hm2_window_set(&windows[1], 26, 2);
    hm2_window_set(&windows[2], 0, 3);
    (void)write_cycle(fixture, true);
    assert_int_equal(card_word(fixture, 0x1000 + 396), 1);
    assert_int_equal(card_word(fixture, 0x1000 + 504), 2);
    assert_int_equal(card_word(fixture, 0x1000 + 508), 3);
}

static void impossible_registers_are_refused_with_their_address(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_plan *const plan = fixture->plan;
    static const struct {
        uint16_t address;
        unsigned words;
    } bad[] = {{0x1000, 0}, {0x1000, 128}, {0x1000, 65537}, {0x1002, 1}, {0xFFFC, 2}, {0x1000, UINT32_MAX}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct hm2_window window;
        struct hm2_section section;
        char where[16];
        (void)snprintf(where, sizeof where, "0x%04X", bad[i].address);
        hm2_diag_clear(&fixture->diag);
        assert_int_equal(
            hm2_plan_add_read(plan, &window, HM2_RANK_NORMAL, bad[i].address, bad[i].words, &fixture->diag),
            HM2_ERR_RANGE);
        assert_int_equal(
            hm2_plan_add_write(plan, &window, HM2_RANK_NORMAL, bad[i].address, bad[i].words, &fixture->diag),
            HM2_ERR_RANGE);
        assert_int_equal(
            hm2_plan_add_setup(plan, &section, HM2_RANK_NORMAL, bad[i].address, bad[i].words, 0, &fixture->diag),
            HM2_ERR_RANGE);
        assert_int_equal(fixture->diag.problems, 3);
        assert_non_null(strstr(fixture->diag.text, where));
    }
    freeze(fixture);
    assert_int_equal(hm2_plan_sizes(plan).reply_bytes, 14);
}

static void nothing_can_be_added_after_freeze(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_window window;
    struct hm2_section section;
    freeze(fixture);
    assert_int_equal(hm2_plan_add_read(fixture->plan, &window, HM2_RANK_NORMAL, 0x1000, 1, &fixture->diag),
                     HM2_ERR_STATE);
    assert_int_equal(hm2_plan_add_read_movable(fixture->plan, &window, &fixture->diag), HM2_ERR_STATE);
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x1000, 1, 0, &fixture->diag),
                     HM2_ERR_STATE);
    assert_int_equal(hm2_plan_freeze(fixture->plan, &fixture->diag), HM2_ERR_STATE);
    assert_int_equal(fixture->diag.problems, 4);
}

static void a_cycle_that_fits_no_datagram_is_refused_with_its_sizes(void **state)
{
    struct fixture *const fixture = *state;
    static struct hm2_window windows[4];
    for (unsigned i = 0; i < 3; i++)
        assert_int_equal(
            hm2_plan_add_read(fixture->plan, &windows[i], HM2_RANK_NORMAL, (uint16_t)(0x1000 * i), 122, NULL), 0);
    assert_int_equal(hm2_plan_freeze(fixture->plan, &fixture->diag), HM2_ERR_NOSPACE);
    assert_non_null(strstr(fixture->diag.text, "read 1478 bytes with a request of 28 bytes"));
    hm2_plan_init(fixture->plan, SESSION);
    hm2_diag_clear(&fixture->diag);
    for (unsigned i = 0; i < 3; i++) /* 1458 + 14 = 1472 bytes fit */
        assert_int_equal(hm2_plan_add_read(fixture->plan, &windows[i], HM2_RANK_NORMAL, (uint16_t)(0x1000 * i),
                                           i < 2 ? 121 : 122, NULL),
                         0);
    freeze(fixture);
    assert_int_equal(hm2_plan_reply_bytes(fixture->plan), 1470);
    read_cycle(fixture);
}

/* Two windows of 127 words and one of `words`, 12 bytes of commands with them, and one section. */
static int freeze_large_write(struct fixture *const fixture, const unsigned words, const unsigned section_words)
{
    static struct hm2_window windows[3];
    static struct hm2_section section;
    hm2_plan_init(fixture->plan, SESSION);
    hm2_diag_clear(&fixture->diag);
    for (unsigned i = 0; i < 3; i++)
        assert_int_equal(hm2_plan_add_write(fixture->plan, &windows[i], HM2_RANK_NORMAL, (uint16_t)(0x1000 * i),
                                            i < 2 ? 127 : words, NULL),
                         0);
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x4000, section_words, 0, NULL), 0);
    return hm2_plan_freeze(fixture->plan, &fixture->diag);
}

static void a_write_that_leaves_no_room_for_the_longest_set_up_is_refused(void **state)
{
    struct fixture *const fixture = *state;
    assert_int_equal(freeze_large_write(fixture, 105, 3), 0); /* 1448 + 16 + 8 = 1472 */
    assert_int_equal(write_cycle(fixture, true), 1448 + 14 + 8);
    assert_int_equal(write_cycle(fixture, true), 1472);
    assert_int_equal(freeze_large_write(fixture, 105, 4), HM2_ERR_NOSPACE);
    assert_non_null(strstr(fixture->diag.text, "write 1476 bytes, of which 20 must stay free"));
    assert_int_equal(freeze_large_write(fixture, 106, 1), HM2_ERR_NOSPACE); /* the session needs 14 bytes */
    assert_non_null(strstr(fixture->diag.text, "write 1474 bytes, of which 14 must stay free"));
}

static void two_writes_of_one_register_are_refused_unless_ranks_order_them(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_window windows[3];
    assert_int_equal(hm2_plan_add_write(fixture->plan, &windows[0], HM2_RANK_FIRST, 0x1000, 4, NULL), 0);
    assert_int_equal(hm2_plan_add_write(fixture->plan, &windows[1], HM2_RANK_LAST, 0x100C, 1, NULL), 0);
    freeze(fixture);
    hm2_plan_init(fixture->plan, SESSION);
    assert_int_equal(hm2_plan_add_write(fixture->plan, &windows[0], HM2_RANK_LAST, 0x1000, 4, NULL), 0);
    assert_int_equal(hm2_plan_add_write(fixture->plan, &windows[1], HM2_RANK_LAST, 0x100C, 1, NULL), 0);
    assert_int_equal(hm2_plan_freeze(fixture->plan, &fixture->diag), HM2_ERR_MISMATCH);
    assert_non_null(strstr(fixture->diag.text, "0x100C"));
}

static void a_full_plan_says_what_it_holds(void **state)
{
    struct fixture *const fixture = *state;
    static struct hm2_window windows[HM2_PLAN_MAX_WINDOWS + 1];
    static struct hm2_section sections[HM2_PLAN_MAX_SECTIONS + 1];
    int err = 0;
    unsigned added = 0;
    while (!err)
        err = hm2_plan_add_read(fixture->plan, &windows[added], HM2_RANK_NORMAL, 0x1000, 1, &fixture->diag), added++;
    assert_int_equal(err, HM2_ERR_NOSPACE);
    assert_int_equal(added, HM2_PLAN_MAX_WINDOWS + 1);
    assert_non_null(strstr(fixture->diag.text, "more than 128 register windows"));
    hm2_diag_clear(&fixture->diag);
    for (err = 0, added = 0; !err; added++)
        err = hm2_plan_add_setup(fixture->plan, &sections[added], HM2_RANK_NORMAL, 0x1000, 1, 0, &fixture->diag);
    assert_int_equal(err, HM2_ERR_NOSPACE);
    assert_int_equal(added, HM2_PLAN_MAX_SECTIONS + 1);
    assert_non_null(strstr(fixture->diag.text, "it has 160 and 1280"));
    hm2_plan_init(fixture->plan, SESSION);
    hm2_diag_clear(&fixture->diag);
    for (err = 0, added = 0; !err; added++)
        err = hm2_plan_add_setup(fixture->plan, &sections[added], HM2_RANK_NORMAL, 0x1000, 127, 0, &fixture->diag);
    assert_int_equal(err, HM2_ERR_NOSPACE);
    assert_int_equal(added, 13); /* 12 * 512 = 6144 */
    assert_non_null(strstr(fixture->diag.text, "it has 12 and 6144"));
}

/* ---- replies ----------------------------------------------------------------------------------------------------- */

static void a_duplicate_is_stale_and_does_not_reach_the_windows(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_window window;
    assert_int_equal(hm2_plan_add_read(fixture->plan, &window, HM2_RANK_NORMAL, 0x1000, 1, NULL), 0);
    freeze(fixture);
    hm2_put_le32(fixture->card.registers + 0x1000, 11);
    const size_t len = request(fixture);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_FRESH);
    fixture->kept[0] = 99;
    assert_int_equal(deliver(fixture, len), HM2_REPLY_STALE);
    assert_int_equal(hm2_window_get(&window, 0), 11);
    size_t unused;
    (void)hm2_plan_request(fixture->plan, &unused);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_STALE); /* also while the next one is awaited */
    assert_int_equal(hm2_window_get(&window, 0), 11);
}

/* The count of packets is the last word of the reply: a card that carries a request out twice tells two of them. */
static void a_second_answer_to_the_last_request_is_told_from_a_copy_of_the_first(void **state)
{
    struct fixture *const fixture = *state;
    size_t unused;
    freeze(fixture);
    const size_t len = request(fixture);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_FRESH);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_STALE);
    assert_int_equal(hm2_plan_late_request(fixture->plan), 0);
    fixture->kept[len - 2]++;
    assert_int_equal(deliver(fixture, len), HM2_REPLY_STALE);
    assert_int_equal(hm2_plan_late_request(fixture->plan), 1);
    (void)hm2_plan_request(fixture->plan, &unused);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_STALE);
    assert_int_equal(hm2_plan_late_request(fixture->plan), 1);
    read_cycle(fixture);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_STALE); /* of an older one nobody knows */
}

/* The last word of the reply, and of a plan with queues one in front of the numbers. */
static void datagrams_before_the_last_request_are_counted_on_both_sides(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_window window;
    assert_int_equal(hm2_plan_add_queue_read(fixture->plan, &window, 0x1000, 1, NULL), 0);
    freeze(fixture);
    (void)write_cycle(fixture, true);
    read_cycle(fixture);
    (void)write_cycle(fixture, false);
    const size_t len = request(fixture);
    fixture->kept[len - 16] = 7;
    fixture->kept[len - 15] = 1;
    assert_int_equal(deliver(fixture, len), HM2_REPLY_FRESH);
    const struct hm2_plan_tally tally = hm2_plan_tally(fixture->plan);
    const uint16_t came = hm2_plan_facts(fixture->plan).card_rx_udp;
    assert_int_equal(tally.answered, 0x107);
    assert_int_equal(tally.requests, 0x107 - 1);
    assert_int_equal(tally.writes, (uint16_t)(came - 0x107 - 2));
}

static void a_reply_to_a_request_given_up_is_late_once(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_window window;
    assert_int_equal(hm2_plan_add_read(fixture->plan, &window, HM2_RANK_NORMAL, 0x1000, 1, NULL), 0);
    freeze(fixture);
    read_cycle(fixture);
    const size_t len = request(fixture);
    hm2_plan_give_up(fixture->plan);
    fixture->kept[0] = 77;
    assert_int_equal(deliver(fixture, len), HM2_REPLY_LATE);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_STALE);
    assert_int_equal(hm2_window_get(&window, 0), 0);
    (void)request(fixture); /* not given up, but followed by another request: given up all the same */
    uint8_t second[64];
    memcpy(second, fixture->kept, len);
    read_cycle(fixture);
    memcpy(fixture->kept, second, len);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_LATE);
    read_cycle(fixture);
}

static void what_was_never_asked_for_is_malformed(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_window window;
    assert_int_equal(hm2_plan_add_read(fixture->plan, &window, HM2_RANK_NORMAL, 0x1000, 4, NULL), 0);
    freeze(fixture);
    assert_int_equal(deliver(fixture, hm2_plan_reply_bytes(fixture->plan)), HM2_REPLY_MALFORMED); /* nothing asked */
    const size_t len = request(fixture);
    for (size_t wrong = 0; wrong <= hm2_plan_reply_capacity(fixture->plan); wrong++) {
        if (wrong == len)
            continue;
        if (wrong < sizeof fixture->kept)
            assert_int_equal(deliver(fixture, wrong), HM2_REPLY_MALFORMED);
        else
            assert_int_equal(hm2_plan_judge(fixture->plan, wrong), HM2_REPLY_MALFORMED);
    }
    static const uint32_t never_sent[] = {0, 2, 3, 0x7FFFFFFF, 0x80000001, UINT32_MAX};
    for (size_t i = 0; i < sizeof never_sent / sizeof never_sent[0]; i++) {
        hm2_put_le32(fixture->kept + 16, never_sent[i]);
        assert_int_equal(deliver(fixture, len), HM2_REPLY_MALFORMED);
    }
    hm2_put_le32(fixture->kept + 16, 1);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_FRESH); /* none of that used the request up */
}

static void a_long_silence_makes_late_replies_and_no_fresh_ones(void **state)
{
    struct fixture *const fixture = *state;
    size_t unused;
    freeze(fixture);
    const size_t len = request(fixture);
    for (unsigned i = 0; i < 200; i++)
        (void)hm2_plan_request(fixture->plan, &unused);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_LATE);
    read_cycle(fixture);
    assert_int_equal(hm2_plan_facts(fixture->plan).card_rx_udp, 2);
}

static void numbers_wrap_past_zero(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section section;
    size_t unused;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x2000, 1, 0, NULL), 0);
    freeze(fixture);
    fixture->plan->request_seq = fixture->plan->write_seq = UINT32_MAX - 2;
    for (unsigned i = 0; i < 6; i++) {
        hm2_section_set(&section, 0, i + 1);
        (void)write_cycle(fixture, true);
        read_cycle(fixture);
        assert_true(hm2_section_confirmed(&section));
        assert_int_not_equal(hm2_get_le32(fixture->card.timer + PLAN_SCRATCH_REQUEST), 0);
        assert_int_not_equal(hm2_get_le32(fixture->card.timer + PLAN_SCRATCH_WRITE), 0);
    }
    assert_int_equal(fixture->plan->request_seq, 4);

    hm2_plan_init(fixture->plan, SESSION);
    freeze(fixture);
    fixture->plan->request_seq = UINT32_MAX - 1;
    const size_t len = request(fixture); /* the first one ever: number 0xFFFFFFFF */
    (void)hm2_plan_request(fixture->plan, &unused);
    assert_int_equal(fixture->plan->request_seq, 1);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_LATE);
    hm2_put_le32(fixture->kept, UINT32_MAX - 1);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_MALFORMED);
}

/* ---- set-up sections --------------------------------------------------------------------------------------------- */

static void a_section_travels_until_a_reply_shows_its_write(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section section;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x2000, 2, 0, NULL), 0);
    hm2_section_set(&section, 1, 42); /* works before freeze */
    freeze(fixture);
    assert_false(hm2_section_confirmed(&section));
    assert_int_equal(write_cycle(fixture, false), QUIET_WRITE + 14 + 12); /* lost */
    assert_int_equal(write_cycle(fixture, false), QUIET_WRITE);           /* not known yet */
    read_cycle(fixture);
    assert_false(hm2_plan_facts(fixture->plan).write_confirmed);
    assert_false(hm2_section_confirmed(&section));
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 14 + 12);
    read_cycle(fixture);
    assert_true(hm2_plan_facts(fixture->plan).write_confirmed);
    assert_true(hm2_section_confirmed(&section));
    assert_int_equal(card_word(fixture, 0x2004), 42);
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE);
    hm2_section_set(&section, 1, 42); /* no change, no traffic */
    assert_true(hm2_section_confirmed(&section));
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE);
    hm2_section_set(&section, 0, 1);
    assert_int_equal(hm2_section_get(&section, 0), 1);
    assert_false(hm2_section_confirmed(&section));
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 12);
    read_cycle(fixture);
    assert_true(hm2_section_confirmed(&section));
    assert_int_equal(card_word(fixture, 0x2000), 1);
}

static void a_word_changed_in_flight_is_not_confirmed_by_the_old_write(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section section;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x2000, 1, 0, NULL), 0);
    freeze(fixture);
    hm2_section_set(&section, 0, 1);
    (void)write_cycle(fixture, true);
    hm2_section_set(&section, 0, 2);
    read_cycle(fixture);
    assert_false(hm2_section_confirmed(&section));
    (void)write_cycle(fixture, true);
    read_cycle(fixture);
    assert_true(hm2_section_confirmed(&section));
    assert_int_equal(card_word(fixture, 0x2000), 2);
}

static void a_reply_made_before_the_write_says_nothing_about_it(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section section;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x2000, 1, 0, NULL), 0);
    freeze(fixture);
    const size_t len = request(fixture); /* request goes out, then the write, then the reply comes */
    (void)write_cycle(fixture, true);
    assert_int_equal(deliver(fixture, len), HM2_REPLY_FRESH);
    assert_true(hm2_plan_facts(fixture->plan).write_confirmed); /* none had been sent when it was asked for */
    assert_false(hm2_section_confirmed(&section));
    read_cycle(fixture);
    assert_true(hm2_section_confirmed(&section));
}

static void a_lost_reply_leaves_a_section_in_flight_and_the_next_one_decides(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section section;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x2000, 1, 0, NULL), 0);
    freeze(fixture);
    (void)write_cycle(fixture, true);
    (void)request(fixture); /* its reply is lost */
    hm2_plan_give_up(fixture->plan);
    assert_false(hm2_section_confirmed(&section));
    read_cycle(fixture); /* no write in between: still shows the one that carried it */
    assert_true(hm2_section_confirmed(&section));
}

static void a_write_that_could_not_be_sent_is_repeated_at_once(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section section;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x2000, 1, 0, NULL), 0);
    freeze(fixture);
    assert_int_equal(write_cycle(fixture, false), QUIET_WRITE + 14 + 8);
    hm2_plan_write_failed(fixture->plan);
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 14 + 8);
    read_cycle(fixture);
    assert_true(hm2_section_confirmed(&section));
}

static void an_older_write_that_arrives_later_brings_the_newer_sections_again(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section section, pushed;
    uint8_t older[LBP16_MAX_REQUEST_BYTES], none[4];
    size_t len;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x2000, 1, 0, NULL), 0);
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &pushed, HM2_RANK_LATE, 0x2004, 1,
                                        HM2_SECTION_FIFO | HM2_SECTION_ON_DEMAND, NULL),
                     0);
    freeze(fixture);
    hm2_section_set(&section, 0, 1);
    const uint8_t *const data = hm2_plan_write(fixture->plan, &len);
    memcpy(older, data, len);
    hm2_section_set(&section, 0, 2);
    hm2_section_touch(&pushed);
    (void)write_cycle(fixture, true);
    read_cycle(fixture);
    assert_true(hm2_section_confirmed(&section));
    assert_true(hm2_section_confirmed(&pushed));
    (void)card_receive(&fixture->card, older, len, none);
    assert_int_equal(card_word(fixture, 0x2000), 1); /* undone */
    read_cycle(fixture);
    assert_false(hm2_plan_facts(fixture->plan).write_confirmed);
    assert_false(hm2_section_confirmed(&section));
    assert_true(hm2_section_confirmed(&pushed)); /* what was asked for once is done once */
    (void)write_cycle(fixture, true);
    read_cycle(fixture);
    assert_true(hm2_section_confirmed(&section));
    assert_int_equal(card_word(fixture, 0x2000), 2);
    assert_int_equal(fixture->card.fifo_used, 1);
}

static void sections_travel_by_rank_and_split_over_writes_in_order(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section late[3], early[3];
    uint32_t seen = 0;
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(
            hm2_plan_add_setup(fixture->plan, &late[i], HM2_RANK_LATE, (uint16_t)(0x4000 + 0x400 * i), 120, 0, NULL),
            0);
        assert_int_equal(
            hm2_plan_add_setup(fixture->plan, &early[i], HM2_RANK_EARLY, (uint16_t)(0x5000 + 0x400 * i), 120, 0, NULL),
            0);
        hm2_section_set(&late[i], 119, 40 + i);
        hm2_section_set(&early[i], 119, 50 + i);
    }
    freeze(fixture);
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(hm2_section_get(&late[i], 119), 40 + i);
        assert_int_equal(hm2_section_get(&early[i], 119), 50 + i);
    }
    for (unsigned cycle = 0; cycle < 3; cycle++) {
        const size_t len = write_cycle(fixture, true);
        assert_true(len <= LBP16_MAX_REQUEST_BYTES);
        static const size_t setup_bytes[] = {14 + 2 * 484, 3 * 484, 484};
        assert_int_equal(len, QUIET_WRITE + setup_bytes[cycle]);
        read_cycle(fixture);
        seen = 0;
        for (unsigned i = 0; i < 3; i++)
            seen |= (uint32_t)hm2_section_confirmed(&early[i]) << i | (uint32_t)hm2_section_confirmed(&late[i])
                                                                          << (3 + i);
        static const uint32_t expected[] = {0x03, 0x1F, 0x3F};
        assert_int_equal(seen, expected[cycle]);
    }
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(card_word(fixture, (uint16_t)(0x4000 + 0x400 * i + 476)), 40 + i);
        assert_int_equal(card_word(fixture, (uint16_t)(0x5000 + 0x400 * i + 476)), 50 + i);
    }
}

static void a_section_on_demand_waits_for_its_touch(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section demand, plain;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &demand, HM2_RANK_FIRST, 0x2000, 1, HM2_SECTION_ON_DEMAND, NULL),
                     0);
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &plain, HM2_RANK_LAST, 0x3000, 1, 0, NULL), 0);
    freeze(fixture);
    hm2_section_set(&demand, 0, 5);
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 14 + 8); /* session and plain only */
    read_cycle(fixture);
    assert_int_equal(card_word(fixture, 0x2000), 0);
    assert_false(hm2_section_confirmed(&demand));
    hm2_plan_touch_all(fixture->plan);
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 8);
    hm2_section_touch(&demand);
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 8);
    read_cycle(fixture);
    assert_int_equal(card_word(fixture, 0x2000), 5);
    assert_true(hm2_section_confirmed(&demand));
    hm2_section_set(&demand, 0, 6); /* the card has 5: no longer confirmed, not sent either */
    assert_false(hm2_section_confirmed(&demand));
    hm2_section_touch(&demand);
    hm2_section_touch(&demand);
    (void)write_cycle(fixture, true);
    read_cycle(fixture);
    assert_int_equal(card_word(fixture, 0x2000), 6);
}

static void a_fifo_section_writes_all_words_to_one_address(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section fifo;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &fifo, HM2_RANK_NORMAL, 0x2000, 4,
                                        HM2_SECTION_FIFO | HM2_SECTION_ON_DEMAND, NULL),
                     0);
    freeze(fixture);
    for (unsigned i = 0; i < 4; i++)
        hm2_section_set(&fifo, i, 10 + i);
    hm2_section_touch(&fifo);
    (void)write_cycle(fixture, true);
    assert_int_equal(fixture->card.fifo_used, 4);
    for (unsigned i = 0; i < 4; i++)
        assert_int_equal(fixture->card.fifo[i], 10 + i);
    assert_int_equal(card_word(fixture, 0x2000), 13);
    assert_int_equal(card_word(fixture, 0x2004), 0);
}

static void a_section_can_move_to_another_address(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section plain, demand;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &plain, HM2_RANK_NORMAL, 0x2000, 1, 0, NULL), 0);
    assert_int_equal(
        hm2_plan_add_setup(fixture->plan, &demand, HM2_RANK_NORMAL, 0x2000, 1, HM2_SECTION_ON_DEMAND, NULL), 0);
    freeze(fixture);
    hm2_section_set(&plain, 0, 3);
    hm2_section_set(&demand, 0, 4);
    hm2_section_touch(&demand);
    (void)write_cycle(fixture, true);
    read_cycle(fixture);
    hm2_section_move(&plain, 0x2000); /* no change */
    assert_true(hm2_section_confirmed(&plain));
    hm2_section_move(&plain, 0x3000);
    hm2_section_move(&demand, 0x4000);
    assert_false(hm2_section_confirmed(&plain));
    assert_false(hm2_section_confirmed(&demand));
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 8);
    assert_int_equal(card_word(fixture, 0x3000), 3);
    assert_int_equal(card_word(fixture, 0x4000), 0);
    hm2_section_touch(&demand);
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 8);
    assert_int_equal(card_word(fixture, 0x4000), 4);
}

/* ---- session ----------------------------------------------------------------------------------------------------- */

static void the_session_is_sent_until_shown_and_again_when_the_card_lost_it(void **state)
{
    struct fixture *const fixture = *state;
    freeze(fixture);
    fixture->card.timer[LBP16_TIMER_TIMEOUT_US] = 200; /* left by somebody else */
    assert_true(hm2_plan_facts(fixture->plan).session_kept);
    assert_int_equal(write_cycle(fixture, false), QUIET_WRITE + 14);
    read_cycle(fixture);
    assert_true(hm2_plan_facts(fixture->plan).session_kept); /* it was never there: not lost */
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 14);
    read_cycle(fixture);
    assert_int_equal(hm2_get_le32(fixture->card.timer + 0x18), SESSION);
    assert_int_equal(hm2_get_le16(fixture->card.timer + LBP16_TIMER_TIMEOUT_US), 0);
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE);
    /* A card that still has it keeps it as the witness of its power. */
    hm2_plan_touch_all(fixture->plan);
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE);
    memset(&fixture->card, 0, sizeof fixture->card);
    read_cycle(fixture);
    assert_false(hm2_plan_facts(fixture->plan).session_kept);
    hm2_plan_touch_all(fixture->plan);
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 14);
}

static void a_card_that_lost_its_power_is_noticed_and_set_up_again(void **state)
{
    struct fixture *const fixture = *state;
    struct hm2_section section;
    assert_int_equal(hm2_plan_add_setup(fixture->plan, &section, HM2_RANK_NORMAL, 0x2000, 1, 0, NULL), 0);
    freeze(fixture);
    hm2_section_set(&section, 0, 9);
    (void)write_cycle(fixture, true);
    read_cycle(fixture);
    assert_true(hm2_section_confirmed(&section));
    memset(&fixture->card, 0, sizeof fixture->card);
    read_cycle(fixture);
    assert_false(hm2_plan_facts(fixture->plan).session_kept);
    assert_false(hm2_plan_facts(fixture->plan).write_confirmed);
    read_cycle(fixture);
    assert_false(hm2_plan_facts(fixture->plan).session_kept); /* until somebody acts on it */
    hm2_plan_touch_all(fixture->plan);
    assert_true(hm2_plan_facts(fixture->plan).session_kept);
    assert_false(hm2_section_confirmed(&section));
    assert_int_equal(write_cycle(fixture, true), QUIET_WRITE + 14 + 8);
    read_cycle(fixture);
    assert_true(hm2_plan_facts(fixture->plan).session_kept);
    assert_true(hm2_plan_facts(fixture->plan).write_confirmed);
    assert_true(hm2_section_confirmed(&section));
    assert_int_equal(card_word(fixture, 0x2000), 9);
    memset(&fixture->card, 0, sizeof fixture->card); /* and once more */
    read_cycle(fixture);
    assert_false(hm2_plan_facts(fixture->plan).session_kept);
}

static void session_numbers_that_an_empty_card_may_show_are_not_used(void **state)
{
    struct fixture *const fixture = *state;
    static const uint32_t poor[] = {0, UINT32_MAX};
    for (unsigned i = 0; i < 2; i++) {
        hm2_plan_init(fixture->plan, poor[i]);
        freeze(fixture);
        (void)write_cycle(fixture, true);
        const uint32_t session = hm2_get_le32(fixture->card.timer + 0x18);
        assert_int_not_equal(session, 0);
        assert_int_not_equal(session, UINT32_MAX);
    }
}

/* ---- everything at once ------------------------------------------------------------------------------------------ */

static uint32_t random_word(uint32_t *const seed)
{
    *seed ^= *seed << 13;
    *seed ^= *seed >> 17;
    *seed ^= *seed << 5;
    return *seed;
}

static void under_loss_duplication_and_power_cuts_the_card_ends_up_with_what_was_set(void **state)
{
    struct fixture *const fixture = *state;
    enum { SECTIONS = 40 };
    static struct hm2_section sections[SECTIONS];
    struct hm2_window window;
    uint32_t seed = 0x1234567;
    assert_int_equal(hm2_plan_add_read(fixture->plan, &window, HM2_RANK_NORMAL, 0x1000, 1, NULL), 0);
    for (unsigned i = 0; i < SECTIONS; i++)
        assert_int_equal(hm2_plan_add_setup(fixture->plan, &sections[i], (enum hm2_rank)(i % 5),
                                            (uint16_t)(0x2000 + 0x100 * i), 20, 0, NULL),
                         0);
    freeze(fixture);
    for (unsigned cycle = 0; cycle < 100000; cycle++) {
        const bool calm = cycle % 1000 >= 900; /* the network behaves, nothing changes: all must settle */
        hm2_put_le32(fixture->card.registers + 0x1000, cycle);
        if (!calm && random_word(&seed) % 2000 == 0)
            memset(&fixture->card, 0, sizeof fixture->card);
        bool fresh = false;
        if (calm || random_word(&seed) % 10 > 0) {
            const size_t len = request(fixture);
            if (calm || random_word(&seed) % 10 > 0) {
                fresh = deliver(fixture, len) == HM2_REPLY_FRESH;
                assert_true(fresh);
            }
        }
        if (fresh && !hm2_plan_facts(fixture->plan).session_kept)
            hm2_plan_touch_all(fixture->plan);
        if (!calm && random_word(&seed) % 4 == 0)
            hm2_section_set(&sections[random_word(&seed) % SECTIONS], random_word(&seed) % 20, random_word(&seed));
        (void)write_cycle(fixture, calm || random_word(&seed) % 10 > 0);
        for (unsigned i = 0; cycle % 1000 == 999 && i < SECTIONS; i++) {
            assert_true(hm2_section_confirmed(&sections[i]));
            for (unsigned word = 0; word < 20; word++)
                if (card_word(fixture, (uint16_t)(0x2000 + 0x100 * i + 4 * word)) !=
                    hm2_section_get(&sections[i], word))
                    fail_msg("cycle %u: section %u word %u differs", cycle, i, word);
        }
    }
}

#define CASE(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        CASE(a_small_plan_is_laid_out_byte_for_byte),
        CASE(windows_show_the_registers_that_they_were_added_for),
        CASE(windows_merge_only_up_to_127_words),
        CASE(impossible_registers_are_refused_with_their_address),
        CASE(nothing_can_be_added_after_freeze),
        CASE(a_cycle_that_fits_no_datagram_is_refused_with_its_sizes),
        CASE(a_write_that_leaves_no_room_for_the_longest_set_up_is_refused),
        CASE(two_writes_of_one_register_are_refused_unless_ranks_order_them),
        CASE(a_full_plan_says_what_it_holds),
        CASE(a_duplicate_is_stale_and_does_not_reach_the_windows),
        CASE(a_second_answer_to_the_last_request_is_told_from_a_copy_of_the_first),
        CASE(datagrams_before_the_last_request_are_counted_on_both_sides),
        CASE(a_reply_to_a_request_given_up_is_late_once),
        CASE(what_was_never_asked_for_is_malformed),
        CASE(a_long_silence_makes_late_replies_and_no_fresh_ones),
        CASE(numbers_wrap_past_zero),
        CASE(a_section_travels_until_a_reply_shows_its_write),
        CASE(a_word_changed_in_flight_is_not_confirmed_by_the_old_write),
        CASE(a_reply_made_before_the_write_says_nothing_about_it),
        CASE(a_lost_reply_leaves_a_section_in_flight_and_the_next_one_decides),
        CASE(a_write_that_could_not_be_sent_is_repeated_at_once),
        CASE(an_older_write_that_arrives_later_brings_the_newer_sections_again),
        CASE(sections_travel_by_rank_and_split_over_writes_in_order),
        CASE(a_section_on_demand_waits_for_its_touch),
        CASE(a_fifo_section_writes_all_words_to_one_address),
        CASE(a_section_can_move_to_another_address),
        CASE(the_session_is_sent_until_shown_and_again_when_the_card_lost_it),
        CASE(a_card_that_lost_its_power_is_noticed_and_set_up_again),
        CASE(session_numbers_that_an_empty_card_may_show_are_not_used),
        CASE(under_loss_duplication_and_power_cuts_the_card_ends_up_with_what_was_set),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
