/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Queues in pipelined cycles, in virtual time: UART, PktUART and buffered SPI, with turns and replies that are lost
 * (docs/pipelined-cycle.md). */
#include "unit.h"

#include <hm2/bspi.h>

#include "serial_rig.h"

/* ---- serial ports ------------------------------------------------------------------------------------------------
 */

struct row {
    const char *firmware;
    enum hm2_serial_kind kind;
    uint8_t gtag;
    uint32_t baud;
    enum hm2_serial_drive drive;
    size_t bytes;
};

static const struct row rows[] = {
    {"SVUA8_8_72", HM2_SERIAL_UART, HM2_GTAG_UART_TX, 115200, HM2_DRIVE_AUTO, 6000},
    {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 115200, HM2_DRIVE_AUTO, 6000},
    {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_DRIVE_ON, 30000},
    {"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_DRIVE_ON, 30000},
};

#define ROWS (sizeof rows / sizeof rows[0])

static uint8_t pattern(const size_t n)
{
    return (uint8_t)(n * 31u + n / 251u);
}

struct line {
    const struct row *row;
    struct sim_bench *bench;
    struct hm2_serial *port;
    unsigned cycle;
    bool loses_turns, loses_replies;
    size_t put, heard, sent, got; /* bytes given to the port, come to the world outside, sent by it, come to the host */
    unsigned wrong;               /* bytes that were not the next */
};

static void hear(void *const context, const uint8_t byte)
{
    struct line *const l = context;
    l->wrong += byte != pattern(l->heard);
    l->heard++;
}

static void spoil(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    const struct line *const l = context;
    (void)data;
    (void)len;
    if (!done && l->loses_replies && l->cycle % 100 == 50)
        assert_int_equal(sim_net_set_faults(l->bench->net, &(struct sim_faults){.seed = 1, .loss = 1.0}), 0);
}

static void open_line(struct line *const l)
{
    const struct hm2_serial_settings settings = {
        .baud = l->row->baud, .drive = l->row->drive, .tx_gap_bits = 24, .rx_gap_bits = 14};
    l->bench = serial_rig_pipelined(l->row->firmware);
    l->port = hm2_serial_port(l->bench->board, l->row->kind, 0);
    assert_non_null(l->port);
    hm2_board_change_begin(l->bench->board);
    assert_int_equal(hm2_serial_open(l->port, &l->bench->diag), 0);
    assert_int_equal(hm2_board_change_end(l->bench->board, &l->bench->diag), 0);
    assert_int_equal(hm2_serial_set(l->port, &settings, &l->bench->diag), 0);
    assert_int_equal(sim_card_serial(l->bench->card, l->row->gtag, 0, hear, l), 0);
    serial_rig_start_turns(l->bench);
    sim_net_on_taken(l->bench->net, spoil, l);
}

static void go_on(struct line *const l)
{
    static const struct sim_faults calm = {.seed = 1}, gale = {.seed = 1, .loss = 1.0};
    struct sim_bench *const bench = l->bench;
    uint8_t bytes[512];
    size_t n = 0;
    for (; n < sizeof bytes && l->put + n < l->row->bytes; n++)
        bytes[n] = pattern(l->put + n);
    l->put += hm2_serial_put(l->port, bytes, n);
    l->cycle++;
    hm2_board_read(bench->board, BENCH_PERIOD_NS);
    if (l->loses_turns && l->cycle % 100 == 0)
        assert_int_equal(sim_net_set_faults(bench->net, &gale), 0);
    hm2_board_write(bench->board, BENCH_PERIOD_NS);
    bench->now_ns += BENCH_PERIOD_NS;
    sim_net_sleep_until(bench->net, bench->now_ns);
    assert_int_equal(sim_net_set_faults(bench->net, &calm), 0);
    while ((n = hm2_serial_get(l->port, bytes, sizeof bytes)) > 0)
        for (size_t i = 0; i < n; i++, l->got++)
            l->wrong += bytes[i] != pattern(l->got);
}

static void send_all(struct line *const l)
{
    for (unsigned i = 0; i < 6000 && l->heard < l->row->bytes; i++)
        go_on(l);
    for (unsigned i = 0; i < 10; i++)
        go_on(l);
    const struct hm2_serial_counts counts = hm2_serial_counts(l->port);
    if (l->heard != l->row->bytes || l->wrong || counts.tx_bytes != l->row->bytes || counts.tx_uncertain)
        fail_msg("%s: %zu bytes came, %u wrong; counted %u, uncertain %u", l->row->firmware, l->heard, l->wrong,
                 counts.tx_bytes, counts.tx_uncertain);
    assert_true(sim_bench_get(l->bench, "pipeline.active") == 1);
    assert_true(sim_bench_get(l->bench, "pipeline.falls") == 0);
}

static void every_byte_is_sent_once(void **state)
{
    (void)state;
    for (size_t i = 0; i < ROWS; i++) {
        struct line l = {.row = &rows[i]};
        open_line(&l);
        send_all(&l);
        assert_true(sim_bench_get(l.bench, "packet-error-total") == 0);
        sim_bench_free(l.bench);
    }
}

/* Of a lost turn nothing has come to the card, of a lost reply everything: the next turn tells which it was. */
static void whether_turns_or_replies_are_lost_every_byte_is_sent_once(void **state)
{
    (void)state;
    for (size_t i = 0; i < ROWS; i++) {
        struct line l = {.row = &rows[i], .loses_turns = true, .loses_replies = true};
        open_line(&l);
        send_all(&l);
        const struct sim_net_truth truth = sim_net_truth(l.bench->net);
        assert_true(truth.lost[0] > 2 && truth.lost[1] > 2);
        sim_bench_free(l.bench);
    }
}

static void receive_all(struct line *const l, const size_t burst, const unsigned every)
{
    for (unsigned idle = 0; idle < 100; idle++) {
        for (size_t i = 0; i < burst && l->cycle % every == 0 && l->sent < l->row->bytes; i++, l->sent++, idle = 0) {
            const uint8_t byte = pattern(l->sent);
            assert_int_equal(sim_card_serial_put(l->bench->card, l->row->gtag, 0, &byte, 1), 1);
        }
        l->put = l->row->bytes; /* nothing to send */
        go_on(l);
    }
}

static void every_byte_is_received_once_and_a_lost_turn_takes_none(void **state)
{
    (void)state;
    for (unsigned lossy = 0; lossy < 2; lossy++)
        for (size_t i = 0; i < ROWS; i++) {
            struct line l = {.row = &rows[i], .loses_turns = lossy};
            open_line(&l);
            receive_all(&l, l.row->kind == HM2_SERIAL_UART ? 5 : 77, l.row->baud > 115200 ? 7 : 20);
            const struct hm2_serial_counts counts = hm2_serial_counts(l.port);
            if (l.got != l.row->bytes || l.wrong || counts.rx_overruns || counts.rx_errors)
                fail_msg("%s: %zu of %zu bytes, %u wrong, overruns %u", l.row->firmware, l.got, l.row->bytes, l.wrong,
                         counts.rx_overruns);
            assert_true(sim_bench_get(l.bench, "pipeline.active") == 1);
            assert_true(!lossy == (sim_net_truth(l.bench->net).lost[0] == 0));
            sim_bench_free(l.bench);
        }
}

/* What a lost reply has taken along is counted, as in plain cycles. */
static void what_a_lost_reply_takes_along_is_counted(void **state)
{
    (void)state;
    for (size_t i = 0; i < ROWS; i++) {
        struct line l = {.row = &rows[i], .loses_replies = true};
        open_line(&l);
        receive_all(&l, l.row->kind == HM2_SERIAL_UART ? 5 : 77, l.row->baud > 115200 ? 7 : 20);
        const size_t missing = l.row->bytes - l.got;
        assert_true(l.got < l.row->bytes || l.wrong == 0);
        assert_true(sim_net_truth(l.bench->net).lost[1] > 2);
        assert_true(missing <= hm2_serial_counts(l.port).rx_uncertain);
        assert_true(hm2_serial_counts(l.port).rx_overruns == 0);
        sim_bench_free(l.bench);
    }
}

/* ---- buffered SPI ------------------------------------------------------------------------------------------------
 */

#define PIN_MOSI 0x82
#define PIN_MISO 0x04

struct wire {
    struct sim_card *card;
    int watch;
};

static void follow(void *const context, const int64_t clk, const unsigned ps, const unsigned watch,
                   const enum sim_level level)
{
    const struct wire *const wire = context;
    (void)ps;
    if (wire->watch == (int)watch)
        assert_int_equal(sim_card_drive_input(wire->card, clk, HM2_GTAG_BSPI, 0, PIN_MISO, level), 0);
}

static void open_wire(struct sim_bench *const bench, struct wire *const wire, uint32_t *out[2], uint32_t *in[2])
{
    static const struct hm2_bspi_channel bits16 = {.chip_select = 3, .bits = 16, .mhz = 6.0, .cpol = true};
    struct hm2_bspi *const port = hm2_bspi_port(bench->board, 0);
    wire->card = bench->card;
    wire->watch = sim_card_watch_output(bench->card, HM2_GTAG_BSPI, 0, PIN_MOSI);
    assert_true(wire->watch >= 0);
    assert_int_equal(sim_card_drive_input(bench->card, -1, HM2_GTAG_BSPI, 0, PIN_MISO, SIM_LOW), 0);
    sim_card_on_edge(bench->card, follow, wire);
    assert_int_equal(hm2_bspi_set_channel(port, 3, &bits16, &bench->diag), 0);
    hm2_board_change_begin(bench->board);
    for (unsigned i = 0; i < 2; i++)
        assert_int_equal(hm2_bspi_add_frame(port, 3, &out[i], &in[i], &bench->diag), 0);
    assert_int_equal(hm2_board_change_end(bench->board, &bench->diag), 0);
}

static void echoes_are_those_of_the_turn_that_sent_the_frames(void **state)
{
    (void)state;
    struct sim_bench *const bench = serial_rig_pipelined("2X7I65_72");
    struct wire wire;
    uint32_t *out[2], *in[2], shown = 0;
    open_wire(bench, &wire, out, in);
    serial_rig_start_turns(bench);
    hm2_board_read(bench->board, BENCH_PERIOD_NS);
    for (uint32_t n = 1; n < 500; n++) {
        const bool lost = n % 100 == 50;
        *out[0] = n;
        *out[1] = n + 1000u;
        hm2_board_write(bench->board, BENCH_PERIOD_NS);
        if (lost)
            assert_int_equal(sim_net_set_faults(bench->net, &(struct sim_faults){.seed = 1, .loss = 1.0}), 0);
        bench->now_ns += BENCH_PERIOD_NS;
        sim_net_sleep_until(bench->net, bench->now_ns);
        assert_int_equal(sim_net_set_faults(bench->net, &(struct sim_faults){.seed = 1}), 0);
        hm2_board_read(bench->board, BENCH_PERIOD_NS);
        shown = lost ? shown : n;
        if ((*in[0] & 0xFFFFu) != shown || (*in[1] & 0xFFFFu) != shown + 1000u)
            fail_msg("cycle %u: %u and %u came back", n, *in[0], *in[1]);
    }
    assert_true(hm2_bspi_short_cycles(hm2_bspi_port(bench->board, 0)) == 0);
    assert_true(sim_bench_get(bench, "pipeline.active") == 1);
    assert_true(sim_bench_get(bench, "packet-lost") == 5);
    sim_bench_free(bench);
}

/* Eight long slow frames: the timer fires in their middle. */
static void a_timer_that_is_shorter_than_the_frames_keeps_cycles_plain(void **state)
{
    static const struct hm2_bspi_channel slow = {.chip_select = 3, .bits = 32, .mhz = 1.0};
    (void)state;
    struct sim_bench *const bench = serial_rig_pipelined("2X7I65_72");
    struct hm2_bspi *const port = hm2_bspi_port(bench->board, 0);
    uint32_t *out, *in;
    assert_int_equal(hm2_bspi_set_channel(port, 3, &slow, &bench->diag), 0);
    hm2_board_change_begin(bench->board);
    for (unsigned i = 0; i < 8; i++)
        assert_int_equal(hm2_bspi_add_frame(port, 3, &out, &in, &bench->diag), 0);
    assert_int_equal(hm2_board_change_end(bench->board, &bench->diag), 0);
    for (unsigned i = 0; i < SERIAL_RIG_TO_TURNS; i++)
        sim_bench_cycle(bench);
    assert_true(sim_bench_get(bench, "pipeline.active") == 0);
    sim_bench_set(bench, "dpll.04.timer-us", 310);
    for (unsigned i = 0; i < 100; i++)
        sim_bench_cycle(bench);
    assert_true(sim_bench_get(bench, "pipeline.active") == 1);
    sim_bench_free(bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_byte_is_sent_once),
        cmocka_unit_test(whether_turns_or_replies_are_lost_every_byte_is_sent_once),
        cmocka_unit_test(every_byte_is_received_once_and_a_lost_turn_takes_none),
        cmocka_unit_test(what_a_lost_reply_takes_along_is_counted),
        cmocka_unit_test(echoes_are_those_of_the_turn_that_sent_the_frames),
        cmocka_unit_test(a_timer_that_is_shorter_than_the_frames_keeps_cycles_plain),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
