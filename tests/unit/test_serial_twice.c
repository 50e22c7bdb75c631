/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Serial ports where the network delivers datagrams twice, or the lost ones are known, in plain and pipelined cycles,
 * in virtual time. Nothing may vanish or double that no counter tells. */
#include "unit.h"

#include "serial_rig.h"

struct row {
    const char *firmware;
    enum hm2_serial_kind kind;
    uint8_t gtag;
    uint32_t baud;
    enum hm2_serial_drive drive;
    size_t bytes;
    unsigned burst, every; /* bytes that the world outside sends at once, every so many periods */
};

static const struct row rows[] = {
    {"SVUA8_8_72", HM2_SERIAL_UART, HM2_GTAG_UART_TX, 115200, HM2_DRIVE_AUTO, 3000, 8, 1},
    {"SVUA8_8_72", HM2_SERIAL_UART, HM2_GTAG_UART_TX, 9600, HM2_DRIVE_AUTO, 1000, 1, 2},
    {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 115200, HM2_DRIVE_AUTO, 6000, 29, 9},
    {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_DRIVE_ON, 12000, 77, 3},
    {"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_DRIVE_ON, 12000, 77, 3},
};

#define ROWS        (sizeof rows / sizeof rows[0])
#define FAULT_EVERY 29u /* cycles */
#define QUIET       60u /* periods without a byte end a test */
#define HEARD_MAX   65536u

enum fault { CALM, TWICE, LOST, STRANGER, OVERTAKEN };

/* What happens every FAULT_EVERY cycles, to a request or to a write; a turn is both. */
struct weather {
    enum fault fault;
    bool write, replies; /* replies: those, not what is sent */
};

struct line {
    const struct row *row;
    struct weather weather;
    struct sim_bench *bench;
    struct hm2_serial *port;
    unsigned cycle;
    size_t put, heard, got, end; /* end: place behind the last byte that came, as far as 256 numbers tell */
    unsigned jumps;
    uint8_t *sounds;
};

static void hear(void *const context, const uint8_t byte)
{
    struct line *const l = context;
    assert_true(l->heard < HEARD_MAX);
    l->sounds[l->heard++] = byte;
}

static struct sim_faults faults_of(const enum fault fault)
{
    return (struct sim_faults){.seed = 1,
                               .loss = fault == LOST ? 1.0 : 0.0,
                               .duplicate = fault == TWICE ? 1.0 : 0.0,
                               .foreign = fault == STRANGER ? 1.0 : 0.0,
                               .reorder = fault == OVERTAKEN ? 1.0 : 0.0};
}

static void set_faults(const struct line *const l, const enum fault fault)
{
    const struct sim_faults faults = faults_of(fault);
    assert_int_equal(sim_net_set_faults(l->bench->net, &faults), 0);
}

static bool strikes(const struct line *const l)
{
    return l->cycle % FAULT_EVERY == FAULT_EVERY - 1u;
}

/* Faults of what is sent are not those of replies. */
static void taken(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    const struct line *const l = context;
    (void)data;
    (void)len;
    if (!done)
        set_faults(l, strikes(l) && l->weather.replies ? l->weather.fault : CALM);
}

static struct line open_line(const struct row *const row, const struct weather weather, const bool pipelined)
{
    struct line l = {.row = row, .weather = weather};
    const struct hm2_serial_settings settings = {
        .baud = row->baud, .drive = row->drive, .tx_gap_bits = 24, .rx_gap_bits = 14};
    l.bench = pipelined ? serial_rig_pipelined(row->firmware) : sim_bench_new("7i80hd-16", row->firmware, "");
    l.port = serial_rig_open(l.bench, row->kind, &settings);
    l.sounds = malloc(HEARD_MAX);
    assert_non_null(l.sounds);
    if (pipelined)
        serial_rig_start_turns(l.bench);
    else
        for (unsigned i = 0; i < 20; i++)
            sim_bench_cycle(l.bench);
    return l;
}

static void attach(struct line *const l)
{
    assert_int_equal(sim_card_serial(l->bench->card, l->row->gtag, 0, hear, l), 0);
    sim_net_on_taken(l->bench->net, taken, l);
}

static void close_line(struct line *const l)
{
    sim_bench_free(l->bench);
    free(l->sounds);
}

static void note_received(struct line *const l)
{
    uint8_t bytes[512];
    for (size_t n; (n = hm2_serial_get(l->port, bytes, sizeof bytes)) > 0; l->got += n)
        for (size_t i = 0; i < n; i++) {
            const uint8_t ahead = (uint8_t)(bytes[i] - (uint8_t)l->end);
            l->jumps += ahead != 0;
            l->end += ahead + 1u; /* repeated or out of order: the end goes beyond what was sent */
        }
}

static void cycle(struct line *const l)
{
    struct sim_bench *const bench = l->bench;
    const bool strike = strikes(l) && !l->weather.replies;
    l->cycle++;
    set_faults(l, strike && !l->weather.write ? l->weather.fault : CALM);
    hm2_board_read(bench->board, BENCH_PERIOD_NS);
    set_faults(l, strike && l->weather.write ? l->weather.fault : CALM);
    hm2_board_write(bench->board, BENCH_PERIOD_NS);
    bench->now_ns += BENCH_PERIOD_NS;
    sim_net_sleep_until(bench->net, bench->now_ns);
    note_received(l);
}

/* The world outside sends numbered bytes. */
static void receive_all(struct line *const l)
{
    attach(l);
    for (unsigned idle = 0; idle < QUIET; idle++) {
        for (unsigned i = 0; l->cycle % l->row->every == 0 && i < l->row->burst && l->put < l->row->bytes; i++) {
            const uint8_t byte = (uint8_t)l->put++;
            assert_int_equal(sim_card_serial_put(l->bench->card, l->row->gtag, 0, &byte, 1), 1);
            idle = 0;
        }
        cycle(l);
    }
}

static void send_all(struct line *const l)
{
    attach(l);
    for (unsigned idle = 0; idle < QUIET; idle++) {
        const size_t heard = l->heard;
        uint8_t bytes[256];
        size_t n = 0;
        for (; n < sizeof bytes && l->put + n < l->row->bytes; n++)
            bytes[n] = (uint8_t)(l->put + n);
        l->put += hm2_serial_put(l->port, bytes, n);
        cycle(l);
        idle = l->heard > heard ? 0 : idle;
    }
}

typedef void (*run_fn)(struct line *line);
typedef void (*check_fn)(const struct line *line, const struct hm2_serial_counts *counts);

static void each(const struct weather weather, const bool pipelined, const run_fn run, const check_fn check)
{
    for (size_t i = 0; i < ROWS; i++) {
        struct line l = open_line(&rows[i], weather, pipelined);
        run(&l);
        const struct hm2_serial_counts counts = hm2_serial_counts(l.port);
        const struct sim_net_truth truth = sim_net_truth(l.bench->net);
        const unsigned d = weather.replies;
        assert_true(truth.duplicated[d] + truth.lost[d] + truth.foreign[d] + truth.reordered[d] > 2);
        assert_true(l.put == l.row->bytes);
        check(&l, &counts);
        close_line(&l);
    }
}

static void fail_with(const struct line *const l, const struct hm2_serial_counts *const counts)
{
    fail_msg("%s, %u baud: %zu bytes, %zu came, end %zu, %zu heard; uncertain rx %u, tx %u, overruns %u",
             l->row->firmware, l->row->baud, l->put, l->got, l->end, l->heard, counts->rx_uncertain,
             counts->tx_uncertain, counts->rx_overruns);
}

/* In order, and what is missing is counted; bytes that a UART has no room for are counted as overruns. */
static void missing_is_counted(const struct line *const l, const struct hm2_serial_counts *const counts)
{
    if (l->end > l->put || l->got > l->put || l->put - l->got > counts->rx_uncertain)
        fail_with(l, counts);
}

static void doubled_is_counted(const struct line *const l, const struct hm2_serial_counts *const counts)
{
    if (l->heard < l->put || l->heard - l->put > counts->tx_uncertain || counts->tx_uncertain == 0)
        fail_with(l, counts);
}

static void all_came(const struct line *const l, const struct hm2_serial_counts *const counts)
{
    if (l->got != l->put || l->jumps > 0 || counts->rx_uncertain > 0)
        fail_with(l, counts);
}

static void nothing_is_missing(const struct line *const l, const struct hm2_serial_counts *const counts)
{
    if ((l->got != l->put && l->heard != l->put) || l->jumps > 0)
        fail_with(l, counts);
}

static void all_was_heard(const struct line *const l, const struct hm2_serial_counts *const counts)
{
    if (l->heard != l->put || counts->tx_uncertain > 0 || counts->tx_bytes != l->put)
        fail_with(l, counts);
}

static void what_a_request_that_comes_twice_takes_along_is_counted(void **state)
{
    (void)state;
    each((struct weather){.fault = TWICE}, false, receive_all, missing_is_counted);
}

static void what_a_turn_that_comes_twice_takes_along_is_counted(void **state)
{
    (void)state;
    each((struct weather){.fault = TWICE, .write = true}, true, receive_all, missing_is_counted);
}

static void what_a_write_that_comes_twice_sends_again_is_counted(void **state)
{
    (void)state;
    each((struct weather){.fault = TWICE, .write = true}, false, send_all, doubled_is_counted);
}

static void what_a_turn_that_comes_twice_sends_again_is_counted(void **state)
{
    (void)state;
    each((struct weather){.fault = TWICE, .write = true}, true, send_all, doubled_is_counted);
}

/* It was given up, and takes bytes when nobody reckons with that any more; or it had taken them long before. */
static void what_a_request_or_reply_that_is_overtaken_takes_along_is_counted(void **state)
{
    (void)state;
    each((struct weather){.fault = OVERTAKEN}, false, receive_all, missing_is_counted);
    each((struct weather){.fault = OVERTAKEN, .write = true}, true, receive_all, missing_is_counted);
    for (unsigned pipelined = 0; pipelined < 2; pipelined++)
        each((struct weather){.fault = OVERTAKEN, .replies = true}, pipelined, receive_all, missing_is_counted);
}

static void replies_that_come_twice_cost_nothing(void **state)
{
    (void)state;
    for (unsigned pipelined = 0; pipelined < 2; pipelined++) {
        each((struct weather){.fault = TWICE, .replies = true}, pipelined, receive_all, all_came);
        each((struct weather){.fault = TWICE, .replies = true}, pipelined, send_all, all_was_heard);
    }
}

/* A UART has no room for what comes in two periods. */
static void nothing_is_uncertain(const struct line *const l, const struct hm2_serial_counts *const counts)
{
    const bool full = l->row->burst * 3u > 16u && l->row->kind == HM2_SERIAL_UART;
    if (counts->rx_uncertain > 0 || l->end != l->put || (l->got != l->put && !full))
        fail_with(l, counts);
}

static void a_write_that_is_carried_out_twice_takes_nothing_and_a_request_sends_nothing(void **state)
{
    (void)state;
    each((struct weather){.fault = TWICE, .write = true}, false, receive_all, all_came);
    each((struct weather){.fault = TWICE}, false, send_all, all_was_heard);
}

/* Somebody who reads the card's registers. */
static void a_stranger_costs_nothing(void **state)
{
    (void)state;
    each((struct weather){.fault = STRANGER}, false, send_all, all_was_heard);
    each((struct weather){.fault = STRANGER, .write = true}, true, receive_all, nothing_is_missing);
    each((struct weather){.fault = STRANGER, .write = true}, true, send_all, nothing_is_missing);
}

static void a_request_that_is_lost_makes_nothing_uncertain(void **state)
{
    (void)state;
    each((struct weather){.fault = LOST}, false, receive_all, nothing_is_uncertain);
}

static void a_turn_that_is_lost_makes_nothing_uncertain(void **state)
{
    (void)state;
    each((struct weather){.fault = LOST, .write = true}, true, receive_all, nothing_is_uncertain);
    each((struct weather){.fault = LOST, .write = true}, true, send_all, all_was_heard);
}

/* ---- frames that are handed over in parts ------------------------------------------------------------------------
 */

#define LONG_FRAME 600u
#define FRAMES     60u

/* All bytes of a frame are its number. */
static void send_frames(struct line *const l)
{
    attach(l);
    for (unsigned idle = 0; idle < QUIET; idle++) {
        const size_t heard = l->heard;
        uint8_t bytes[LONG_FRAME];
        memset(bytes, (int)(l->put / LONG_FRAME), sizeof bytes);
        if (l->put < FRAMES * LONG_FRAME && hm2_serial_put_frame(l->port, bytes, sizeof bytes) == 0)
            l->put += sizeof bytes;
        cycle(l);
        idle = l->heard > heard ? 0 : idle;
    }
}

static unsigned frames_not_whole(const struct line *const l)
{
    unsigned bytes[FRAMES] = {0}, wrong = 0;
    for (size_t i = 0; i < l->heard; i++)
        if (l->sounds[i] < FRAMES)
            bytes[l->sounds[i]]++;
    for (unsigned i = 0; i < FRAMES; i++)
        wrong += bytes[i] != LONG_FRAME;
    return wrong;
}

static void a_part_of_a_frame_that_comes_twice_spoils_no_other_frame(void **state)
{
    const struct hm2_serial_settings settings = {
        .baud = 1000000, .drive = HM2_DRIVE_ON, .frames = true, .tx_gap_bits = 24, .rx_gap_bits = 14};
    (void)state;
    for (unsigned pipelined = 0; pipelined < 2; pipelined++) {
        struct line l = open_line(&rows[ROWS - 1u], (struct weather){.fault = TWICE, .write = true}, pipelined);
        assert_int_equal(hm2_serial_set(l.port, &settings, &l.bench->diag), 0);
        send_frames(&l);
        const unsigned wrong = frames_not_whole(&l), strikes = l.cycle / FAULT_EVERY;
        const uint32_t uncertain = hm2_serial_counts(l.port).tx_uncertain;
        if (l.put != FRAMES * LONG_FRAME || wrong > strikes || uncertain < wrong * LONG_FRAME)
            fail_msg("%zu bytes, %u frames not whole, %u strikes, uncertain %u", l.put, wrong, strikes, uncertain);
        close_line(&l);
    }
}

/* At 9600 baud two periods bring less than three bytes. */
static void no_more_is_uncertain_than_the_line_can_have_brought(void **state)
{
    const struct row *const slow = &rows[1];
    (void)state;
    for (unsigned pipelined = 0; pipelined < 2; pipelined++) {
        struct line l = open_line(slow, (struct weather){.fault = LOST, .replies = true}, pipelined);
        receive_all(&l);
        const struct hm2_serial_counts counts = hm2_serial_counts(l.port);
        const uint64_t lost = sim_net_truth(l.bench->net).lost[1];
        assert_true(slow->baud == 9600 && lost > 2);
        missing_is_counted(&l, &counts);
        if (counts.rx_uncertain > 3u * lost)
            fail_with(&l, &counts);
        close_line(&l);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_a_request_that_comes_twice_takes_along_is_counted),
        cmocka_unit_test(what_a_turn_that_comes_twice_takes_along_is_counted),
        cmocka_unit_test(what_a_write_that_comes_twice_sends_again_is_counted),
        cmocka_unit_test(what_a_turn_that_comes_twice_sends_again_is_counted),
        cmocka_unit_test(a_part_of_a_frame_that_comes_twice_spoils_no_other_frame),
        cmocka_unit_test(what_a_request_or_reply_that_is_overtaken_takes_along_is_counted),
        cmocka_unit_test(no_more_is_uncertain_than_the_line_can_have_brought),
        cmocka_unit_test(replies_that_come_twice_cost_nothing),
        cmocka_unit_test(a_write_that_is_carried_out_twice_takes_nothing_and_a_request_sends_nothing),
        cmocka_unit_test(a_stranger_costs_nothing),
        cmocka_unit_test(a_request_that_is_lost_makes_nothing_uncertain),
        cmocka_unit_test(a_turn_that_is_lost_makes_nothing_uncertain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
