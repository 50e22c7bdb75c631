/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Frames through a PktUART of a simulated card, in virtual time: each arrives whole or not at all. */
#include "unit.h"

#include <hm2/bytes.h>

#include "serial_rig.h"

#define RX_BYTES 1024u

struct row {
    const char *firmware;
    uint32_t baud;
    enum hm2_parity parity;
    enum hm2_serial_drive drive;
};

static const struct row rows[] = {
    {"PKTUART_0", 115200, HM2_PARITY_NONE, HM2_DRIVE_AUTO},
    {"PKTUART_0", 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON},
    {"PKTUART_1", 115200, HM2_PARITY_ODD, HM2_DRIVE_ON},
    {"PKTUART_1", 1000000, HM2_PARITY_EVEN, HM2_DRIVE_AUTO},
};
#define ROWS (sizeof rows / sizeof rows[0])

/* Around what a word, a write and the card's buffer hold; and many in a row that are short. */
static const size_t sizes[] = {2, 3, 4, 5, 6, 7, 8, 9, 11, 60, 251, 252, 253, 256, 257, 504, 505, 756, 757, 800};
#define SIZES (sizeof sizes / sizeof sizes[0])

struct rig {
    struct sim_bench *bench;
    struct hm2_serial *port;
    unsigned cycle, sent, received, missing; /* frames */
    size_t missing_bytes;
};

static struct hm2_serial_settings settings_of(const struct row *row)
{
    return (struct hm2_serial_settings){.baud = row->baud,
                                        .parity = row->parity,
                                        .drive = row->drive,
                                        .frames = true,
                                        .tx_gap_bits = 40,
                                        .rx_gap_bits = 20};
}

static struct rig start(const struct row *row)
{
    const struct hm2_serial_settings settings = settings_of(row);
    struct rig rig = {.bench = sim_bench_new("7i80hd-16", row->firmware, "")};
    rig.port = serial_rig_open(rig.bench, HM2_SERIAL_PKTUART, &settings);
    for (unsigned i = 0; i < 5; i++)
        sim_bench_cycle(rig.bench);
    return rig;
}

static void fill(uint8_t *bytes, const unsigned number)
{
    const size_t len = sizes[number % SIZES];
    for (size_t i = 0; i < len; i++)
        bytes[i] = (uint8_t)(number * 7u + i * 31u + i / 251u);
    hm2_put_le16(bytes, (uint16_t)number);
}

static void send_up_to(struct rig *rig, const unsigned frames)
{
    uint8_t bytes[HM2_SERIAL_FRAME_BYTES];
    for (int err = 0; rig->sent < frames && err == 0;) {
        fill(bytes, rig->sent);
        err = hm2_serial_put_frame(rig->port, bytes, sizes[rig->sent % SIZES]);
        assert_true(err == 0 || err == HM2_ERR_NOSPACE);
        rig->sent += err == 0;
    }
}

static void skip_to(struct rig *rig, const unsigned number)
{
    for (; rig->received < number; rig->received++, rig->missing++)
        rig->missing_bytes += sizes[rig->received % SIZES];
}

/* What comes must be one that was sent, after those that came before. */
static bool receive(struct rig *rig)
{
    uint8_t bytes[RX_BYTES], expected[RX_BYTES];
    const size_t waits = hm2_serial_next_frame(rig->port), len = hm2_serial_get_frame(rig->port, bytes, sizeof bytes);
    assert_int_equal(waits, len);
    if (len == 0)
        return false;
    const unsigned number = hm2_get_le16(bytes);
    if (len < 2 || number < rig->received || number >= rig->sent || len != sizes[number % SIZES])
        fail_msg("%zu bytes that call themselves frame %u, after %u", len, number, rig->received);
    skip_to(rig, number);
    fill(expected, number);
    assert_memory_equal(bytes, expected, len);
    rig->received++;
    return true;
}

/* ---- calm ---------------------------------------------------------------------------------------------------------
 */

static void frames_come_back_whole_and_one_by_one(void **state)
{
    const unsigned frames = 2 * SIZES;
    (void)state;
    for (size_t i = 0; i < ROWS; i++) {
        struct rig rig = start(&rows[i]);
        serial_rig_echo(rig.bench, HM2_GTAG_PKTUART_TX);
        for (unsigned idle = 0; rig.received < frames && idle < 200; idle++) {
            send_up_to(&rig, frames);
            sim_bench_cycle(rig.bench);
            while (receive(&rig))
                idle = 0;
        }
        if (rig.received < frames || rig.missing || hm2_serial_lost(rig.port))
            fail_msg("row %zu: %u of %u frames, %u missing", i, rig.received, frames, rig.missing);
        sim_bench_free(rig.bench);
    }
}

static void the_longest_frames_go_out(void **state)
{
    uint8_t bytes[HM2_SERIAL_FRAME_BYTES];
    (void)state;
    for (size_t i = 0; i < sizeof bytes; i++)
        bytes[i] = (uint8_t)(i * 31u + i / 251u);
    for (size_t i = 0; i < ROWS; i++) {
        struct serial_ear ear = {0};
        struct rig rig = start(&rows[i]);
        serial_rig_listen(rig.bench, &ear);
        for (unsigned n = 0; n < 3; n++)
            assert_int_equal(hm2_serial_put_frame(rig.port, bytes, sizeof bytes), 0);
        for (unsigned n = 0; n < 400 && ear.heard < 3 * sizeof bytes; n++)
            sim_bench_cycle(rig.bench);
        assert_int_equal(ear.heard, 3 * sizeof bytes);
        for (size_t n = 0; n < 3; n++)
            assert_memory_equal(ear.byte + n * sizeof bytes, bytes, sizeof bytes);
        sim_bench_free(rig.bench);
    }
}

static void more_than_the_caller_has_room_for_is_cut(void **state)
{
    static const uint8_t bytes[] = "twelve bytes";
    uint8_t got[RX_BYTES];
    (void)state;
    struct rig rig = start(&rows[1]);
    serial_rig_echo(rig.bench, HM2_GTAG_PKTUART_TX);
    for (unsigned i = 0; i < 2; i++)
        assert_int_equal(hm2_serial_put_frame(rig.port, bytes, 12), 0);
    for (unsigned i = 0; i < 20; i++)
        sim_bench_cycle(rig.bench);
    assert_int_equal(hm2_serial_get_frame(rig.port, got, 6), 6);
    assert_memory_equal(got, "twelve", 6);
    assert_int_equal(hm2_serial_get_frame(rig.port, got, sizeof got), 12);
    assert_memory_equal(got, bytes, 12);
    assert_int_equal(hm2_serial_get_frame(rig.port, got, sizeof got), 0);
    sim_bench_free(rig.bench);
}

static void what_a_port_of_frames_does_not_take_is_refused(void **state)
{
    static const uint8_t bytes[HM2_SERIAL_FRAME_BYTES + 1];
    uint8_t got[4];
    struct hm2_serial_settings settings = settings_of(&rows[0]);
    (void)state;
    struct rig rig = start(&rows[0]);
    assert_int_equal(hm2_serial_put_frame(rig.port, bytes, 0), HM2_ERR_RANGE);
    assert_int_equal(hm2_serial_put_frame(rig.port, bytes, sizeof bytes), HM2_ERR_RANGE);
    assert_int_equal(hm2_serial_put(rig.port, bytes, 1), 0);
    assert_int_equal(hm2_serial_get(rig.port, got, 1), 0);
    for (unsigned i = 0; i < 8; i++)
        assert_int_equal(hm2_serial_put_frame(rig.port, bytes, HM2_SERIAL_FRAME_BYTES), 0);
    assert_int_equal(hm2_serial_put_frame(rig.port, bytes, HM2_SERIAL_FRAME_BYTES), HM2_ERR_NOSPACE);
    settings.tx_gap_bits = 0;
    assert_int_equal(hm2_serial_set(rig.port, &settings, &rig.bench->diag), HM2_ERR_RANGE);
    settings.tx_gap_bits = 1;
    assert_int_equal(hm2_serial_set(rig.port, &settings, &rig.bench->diag), 0); /* what waits is dropped */
    assert_int_equal(hm2_serial_current(rig.port).tx_gap_bits, 1);
    for (unsigned i = 0; i < 256; i++)
        assert_int_equal(hm2_serial_put_frame(rig.port, bytes, 1), 0);
    assert_int_equal(hm2_serial_put_frame(rig.port, bytes, 1), HM2_ERR_NOSPACE);
    settings.frames = false;
    settings.tx_gap_bits = 40;
    assert_int_equal(hm2_serial_set(rig.port, &settings, &rig.bench->diag), 0);
    assert_int_equal(hm2_serial_put_frame(rig.port, bytes, 1), HM2_ERR_STATE);
    assert_int_equal(hm2_serial_waiting(rig.port), 0);
    sim_bench_free(rig.bench);
}

static void a_uart_has_no_frames(void **state)
{
    struct hm2_serial_settings settings = {.baud = 9600};
    (void)state;
    struct sim_bench *const bench = sim_bench_new("7i80hd-16", "SVUA8_8_72", "");
    struct hm2_serial *const port = serial_rig_open(bench, HM2_SERIAL_UART, &settings);
    settings.frames = true;
    assert_int_equal(hm2_serial_set(port, &settings, &bench->diag), HM2_ERR_RANGE);
    sim_bench_free(bench);
}

/* ---- from outside --------------------------------------------------------------------------------------------------
 */

static void a_deaf_port_hears_nothing(void **state)
{
    struct hm2_serial_settings settings = settings_of(&rows[1]);
    struct serial_ear ear = {0};
    (void)state;
    struct rig rig = start(&rows[1]);
    serial_rig_listen(rig.bench, &ear);
    for (unsigned deaf = 0; deaf < 2; deaf++) {
        settings.deaf = deaf > 0;
        assert_int_equal(hm2_serial_set(rig.port, &settings, &rig.bench->diag), 0);
        for (unsigned i = 0; i < 20; i++) {
            if (i == 5)
                serial_rig_say(rig.bench, "hello", 5);
            sim_bench_cycle(rig.bench);
        }
        assert_int_equal(hm2_serial_next_frame(rig.port), deaf ? 0 : 5);
    }
    assert_false(hm2_serial_lost(rig.port));
    sim_bench_free(rig.bench);
}

/* A byte with parity takes longer: so does a frame whose size can still be told. */
static void a_long_frame_with_parity_is_not_taken_for_an_endless_one(void **state)
{
    static const uint8_t bytes[960];
    struct serial_ear ear = {0};
    (void)state;
    struct rig rig = start(&rows[2]);
    serial_rig_listen(rig.bench, &ear);
    serial_rig_say(rig.bench, bytes, sizeof bytes);
    for (unsigned i = 0; i < 120; i++)
        sim_bench_cycle(rig.bench);
    assert_int_equal(hm2_serial_next_frame(rig.port), sizeof bytes);
    assert_false(hm2_serial_lost(rig.port));
    sim_bench_free(rig.bench);
}

/* The peer begins with even parity, and the port is set to odd meanwhile. */
static void a_frame_with_an_error_is_not_given_but_told(void **state)
{
    uint8_t got[RX_BYTES];
    struct row row = rows[3];
    struct serial_ear ear = {0};
    (void)state;
    row.baud = 9600;
    struct hm2_serial_settings settings = settings_of(&row);
    struct rig rig = start(&row);
    serial_rig_listen(rig.bench, &ear);
    serial_rig_say(rig.bench, "twelve bytes", 12);
    settings.parity = HM2_PARITY_ODD;
    assert_int_equal(hm2_serial_set(rig.port, &settings, &rig.bench->diag), 0);
    for (unsigned i = 0; i < 60; i++) {
        if (i == 40)
            serial_rig_say(rig.bench, "good", 4);
        sim_bench_cycle(rig.bench);
    }
    assert_true(hm2_serial_lost(rig.port));
    assert_false(hm2_serial_lost(rig.port));
    assert_int_equal(hm2_serial_get_frame(rig.port, got, sizeof got), 4);
    assert_memory_equal(got, "good", 4);
    assert_int_equal(hm2_serial_next_frame(rig.port), 0);
    const struct hm2_serial_counts counts = hm2_serial_counts(rig.port);
    assert_true(counts.rx_errors > 0 && counts.rx_uncertain > 0);
    assert_int_equal(counts.rx_bytes, 4);
    sim_bench_free(rig.bench);
}

/* Each of one byte, so that places run out and not bytes. */
static void frames_that_nobody_takes_stay_and_what_the_card_loses_is_counted(void **state)
{
    const unsigned frames = 400;
    uint8_t got;
    struct serial_ear ear = {0};
    (void)state;
    struct rig rig = start(&rows[1]);
    serial_rig_listen(rig.bench, &ear);
    for (unsigned i = 0; i < frames; i++) {
        const uint8_t byte = (uint8_t)(i % 250u);
        serial_rig_say(rig.bench, &byte, 1);
        sim_bench_cycle(rig.bench);
    }
    unsigned given = 0;
    for (unsigned i = 0; i < 40; i++) {
        for (; hm2_serial_next_frame(rig.port) > 0; given++) {
            assert_int_equal(hm2_serial_get_frame(rig.port, &got, 1), 1);
            if (given < 250)
                assert_int_equal(got, given);
        }
        sim_bench_cycle(rig.bench);
    }
    const struct hm2_serial_counts counts = hm2_serial_counts(rig.port);
    assert_true(given >= 250 && given < frames);
    assert_true(given + counts.rx_uncertain >= frames);
    assert_true(counts.rx_overruns > 0);
    sim_bench_free(rig.bench);
}

/* ---- replies, requests and writes that get lost --------------------------------------------------------------------
 */

enum storm { LOSE_REPLIES, LOSE_REQUESTS, LOSE_WRITES, DELAY_REPLIES, STORMS };

struct weather {
    const struct rig *rig;
    enum storm storm;
};

static const struct sim_faults calm = {.seed = 1}, gale = {.seed = 1, .loss = 1.0};

static void set_faults(const struct rig *rig, const struct sim_faults *faults)
{
    assert_int_equal(sim_net_set_faults(rig->bench->net, faults), 0);
}

static bool blows(const struct rig *rig)
{
    return rig->cycle % 101u == 7u;
}

static void blow(void *context, const uint8_t *data, size_t len, bool done)
{
    const struct weather *const w = context;
    const struct sim_faults late = {.seed = 1, .delay_min_ns = BENCH_PERIOD_NS, .delay_max_ns = BENCH_PERIOD_NS};
    (void)data;
    (void)len;
    if (done || !blows(w->rig))
        return;
    if (w->storm == LOSE_REPLIES)
        set_faults(w->rig, &gale);
    if (w->storm == DELAY_REPLIES)
        set_faults(w->rig, &late);
}

static void cycle_in(struct rig *rig, const enum storm storm)
{
    struct sim_bench *const bench = rig->bench;
    rig->cycle++;
    set_faults(rig, blows(rig) && storm == LOSE_REQUESTS ? &gale : &calm);
    hm2_board_read(bench->board, BENCH_PERIOD_NS);
    set_faults(rig, blows(rig) && storm == LOSE_WRITES ? &gale : &calm);
    hm2_board_write(bench->board, BENCH_PERIOD_NS);
    set_faults(rig, &calm);
    bench->now_ns += BENCH_PERIOD_NS;
    sim_net_sleep_until(bench->net, bench->now_ns);
}

static void run_in(struct rig *rig, const enum storm storm, const unsigned frames)
{
    struct weather weather = {rig, storm};
    sim_bench_set(rig->bench, "packet-error-limit", 1e6);
    serial_rig_echo(rig->bench, HM2_GTAG_PKTUART_TX);
    sim_net_on_taken(rig->bench->net, blow, &weather);
    for (unsigned idle = 0; rig->received < frames && idle < 200; idle++) {
        send_up_to(rig, frames);
        cycle_in(rig, storm);
        while (receive(rig))
            idle = 0;
    }
    skip_to(rig, frames);
    sim_net_on_taken(rig->bench->net, NULL, NULL);
}

static void what_gets_lost_costs_whole_frames_and_is_counted(void **state)
{
    static const char *const names[STORMS] = {"replies lost", "requests lost", "writes lost", "replies late"};
    const unsigned frames = 2 * SIZES;
    (void)state;
    for (size_t i = 0; i < ROWS; i++)
        for (enum storm storm = 0; storm < STORMS; storm++) {
            struct rig rig = start(&rows[i]);
            run_in(&rig, storm, frames);
            const struct hm2_serial_counts counts = hm2_serial_counts(rig.port);
            const struct sim_net_truth truth = sim_net_truth(rig.bench->net);
            const bool costs = storm == LOSE_REPLIES || storm == LOSE_REQUESTS;
            if (rig.missing_bytes > counts.rx_uncertain + counts.tx_uncertain ||
                rig.missing > (costs ? frames / 2 : 0) ||
                (storm != DELAY_REPLIES && truth.lost[0] + truth.lost[1] == 0))
                fail_msg("row %zu, %s: %u of %u frames missing, %zu bytes; uncertain rx %u, tx %u", i, names[storm],
                         rig.missing, frames, rig.missing_bytes, counts.rx_uncertain, counts.tx_uncertain);
            sim_bench_free(rig.bench);
        }
}

/* The reply that gets lost is that to the second part of three, while the frame before is still being sent. */
static void a_frame_of_which_a_part_may_be_missing_is_not_sent_and_cuts_no_other(void **state)
{
    static const struct row slow = {"PKTUART_1", 9600, HM2_PARITY_NONE, HM2_DRIVE_ON};
    static const size_t lens[] = {100, 700, 10};
    uint8_t bytes[HM2_SERIAL_FRAME_BYTES];
    (void)state;
    for (size_t i = 0; i < sizeof bytes; i++)
        bytes[i] = (uint8_t)i;
    struct rig rig = start(&slow);
    struct weather weather = {&rig, LOSE_REPLIES};
    struct serial_ear ear = {0};
    serial_rig_listen(rig.bench, &ear);
    sim_net_on_taken(rig.bench->net, blow, &weather);
    for (size_t i = 0; i < 3; i++)
        assert_int_equal(hm2_serial_put_frame(rig.port, i < 2 ? bytes : bytes + lens[0], lens[i]), 0);
    rig.cycle = 3;
    for (unsigned i = 0; i < 90; i++)
        cycle_in(&rig, LOSE_REPLIES);
    assert_int_equal(sim_net_truth(rig.bench->net).lost[1], 1);
    for (unsigned i = 0; i < 90; i++)
        sim_bench_cycle(rig.bench);
    assert_int_equal(ear.heard, lens[0] + lens[2]);
    assert_memory_equal(ear.byte, bytes, ear.heard);
    assert_int_equal(hm2_serial_counts(rig.port).tx_uncertain, lens[1]);
    sim_bench_free(rig.bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_come_back_whole_and_one_by_one),
        cmocka_unit_test(the_longest_frames_go_out),
        cmocka_unit_test(more_than_the_caller_has_room_for_is_cut),
        cmocka_unit_test(what_a_port_of_frames_does_not_take_is_refused),
        cmocka_unit_test(a_uart_has_no_frames),
        cmocka_unit_test(a_deaf_port_hears_nothing),
        cmocka_unit_test(a_long_frame_with_parity_is_not_taken_for_an_endless_one),
        cmocka_unit_test(a_frame_with_an_error_is_not_given_but_told),
        cmocka_unit_test(frames_that_nobody_takes_stay_and_what_the_card_loses_is_counted),
        cmocka_unit_test(a_frame_of_which_a_part_may_be_missing_is_not_sent_and_cuts_no_other),
        cmocka_unit_test(what_gets_lost_costs_whole_frames_and_is_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
