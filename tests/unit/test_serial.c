/* SPDX-License-Identifier: GPL-2.0-or-later */
/* UART and PktUART as byte streams, looped back on simulated cards, in virtual time. */
#include "unit.h"

#include "pktuart_crowd.h"
#include "serial_rig.h"

struct loop {
    const char *firmware;
    enum hm2_serial_kind kind;
    uint8_t gtag;
    uint32_t baud;
    enum hm2_parity parity;
    enum hm2_serial_drive drive;
    size_t bytes;
    unsigned burst, every; /* bytes that the world outside sends at once, every so many periods */
};

#define STALL_EVERY 50u /* cycles from one stall of the thread to the next */

static uint8_t pattern(const size_t n)
{
    return (uint8_t)(n * 31u + n / 251u);
}

static struct hm2_serial *open_port(struct sim_bench *bench, const struct loop *loop)
{
    const struct hm2_serial_settings settings = {
        .baud = loop->baud, .parity = loop->parity, .drive = loop->drive, .tx_gap_bits = 24, .rx_gap_bits = 14};
    return serial_rig_open(bench, loop->kind, &settings);
}

/* With HM2_SERIAL_BYTES in the environment as much as that goes round: 10000000 takes some minutes. */
static size_t bytes_of(const struct loop *loop)
{
    const char *const wanted = getenv("HM2_SERIAL_BYTES");
    return wanted ? strtoul(wanted, NULL, 10) : loop->bytes;
}

static void stall(struct sim_bench *bench, const unsigned periods)
{
    bench->now_ns += (int64_t)periods * BENCH_PERIOD_NS;
    sim_net_sleep_until(bench->net, bench->now_ns);
}

static size_t run_loop(const struct loop *loop, const size_t total, const unsigned stall_periods,
                       struct hm2_serial_counts *counts)
{
    struct sim_bench *const bench = sim_bench_new("7i80hd-16", loop->firmware, "");
    struct hm2_serial *const port = open_port(bench, loop);
    size_t put = 0, got = 0, idle = 0;
    serial_rig_echo(bench, loop->gtag);
    for (unsigned cycle = 1; got < total && idle < 200; cycle++) {
        uint8_t bytes[512];
        size_t n = 0;
        for (; n < sizeof bytes && put + n < total; n++)
            bytes[n] = pattern(put + n);
        put += hm2_serial_put(port, bytes, n);
        sim_bench_cycle(bench);
        if (cycle % STALL_EVERY == 0)
            stall(bench, stall_periods);
        n = hm2_serial_get(port, bytes, sizeof bytes);
        idle = n ? 0 : idle + 1;
        for (size_t i = 0; i < n; i++, got++)
            if (bytes[i] != pattern(got))
                fail_msg("byte %zu: got %02x, expected %02x", got, bytes[i], pattern(got));
    }
    *counts = hm2_serial_counts(port);
    sim_bench_free(bench);
    return got;
}

static void a_loop_brings_every_byte_back(void **state)
{
    static const struct loop rows[] = {
        {"SVUA8_8_72", HM2_SERIAL_UART, HM2_GTAG_UART_TX, 115200, HM2_PARITY_NONE, HM2_DRIVE_AUTO, 6000, 0, 1},
        {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 115200, HM2_PARITY_NONE, HM2_DRIVE_AUTO, 6000, 0, 1},
        {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 30000, 0, 1},
        {"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 115200, HM2_PARITY_ODD, HM2_DRIVE_AUTO, 6000, 0, 1},
        {"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_EVEN, HM2_DRIVE_ON, 30000, 0, 1},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct hm2_serial_counts counts;
        const size_t total = bytes_of(&rows[i]), got = run_loop(&rows[i], total, 0, &counts);
        if (got != total || counts.rx_errors || counts.rx_overruns || counts.rx_uncertain)
            fail_msg("row %zu: %zu of %zu bytes, errors %u, overruns %u, uncertain %u, sent %u", i, got, total,
                     counts.rx_errors, counts.rx_overruns, counts.rx_uncertain, counts.tx_bytes);
    }
}

/* What the card still sends while the thread stalls comes back into its receiver, which tells nobody when it is full:
 * no more is sent than it can keep. */
static void a_thread_that_stalls_costs_a_loop_nothing(void **state)
{
    static const struct {
        struct loop loop;
        unsigned periods;
    } rows[] = {
        {{"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 20000, 0, 1},
         5},
        {{"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 20000, 0, 1},
         40},
        {{"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 20000, 0, 1},
         11},
        {{"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 115200, HM2_PARITY_NONE, HM2_DRIVE_ON, 5000, 0, 1},
         200},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct hm2_serial_counts counts;
        const size_t total = rows[i].loop.bytes, got = run_loop(&rows[i].loop, total, rows[i].periods, &counts);
        if (got != total || counts.rx_errors || counts.rx_overruns)
            fail_msg("row %zu: %zu of %zu bytes, errors %u, overruns %u, uncertain %u, sent %u", i, got, total,
                     counts.rx_errors, counts.rx_overruns, counts.rx_uncertain, counts.tx_bytes);
    }
}

static void settings_that_the_firmware_cannot_keep_are_refused(void **state)
{
    static const struct loop old = {
        "PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 9600, HM2_PARITY_NONE, HM2_DRIVE_AUTO, 0, 0, 1};
    (void)state;
    struct sim_bench *const bench = sim_bench_new("7i80hd-16", old.firmware, "");
    struct hm2_serial *const port = open_port(bench, &old);
    struct hm2_serial_settings s = {.baud = 9600, .tx_gap_bits = 24, .rx_gap_bits = 14, .parity = HM2_PARITY_ODD};
    assert_int_equal(hm2_serial_set(port, &s, &bench->diag), HM2_ERR_RANGE);
    s.parity = HM2_PARITY_NONE;
    s.drive_delay_clk = 2;
    assert_int_equal(hm2_serial_set(port, &s, &bench->diag), HM2_ERR_RANGE);
    s.drive_delay_clk = 0;
    s.rx_gap_bits = 10;
    assert_int_equal(hm2_serial_set(port, &s, &bench->diag), HM2_ERR_RANGE);
    s.rx_gap_bits = 14;
    s.baud = 0;
    assert_int_equal(hm2_serial_set(port, &s, &bench->diag), HM2_ERR_RANGE);
    s.baud = 9600;
    assert_int_equal(hm2_serial_set(port, &s, &bench->diag), 0);
    sim_bench_free(bench);
}

static void outputs_have_the_second_names_of_linuxcnc(void **state)
{
    static const char *const firmware[] = {"SVUA8_8_72", "PKTUART_0"};
    static const char *const names[] = {"uart.00.tx", "uart.00.tx-drv-en"};
    (void)state;
    for (size_t i = 0; i < sizeof firmware / sizeof firmware[0]; i++) {
        struct sim_bench *const bench = sim_bench_new("7i80hd-16", firmware[i], "");
        for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
            char name[64];
            int err;
            (void)snprintf(name, sizeof name, "hm2_7i80.0.%s.invert_output", names[k]);
            (void)hm2_plain_get(bench->plain, name, &err);
            if (err)
                fail_msg("%s: there is no %s", firmware[i], name);
        }
        sim_bench_free(bench);
    }
}

static void a_full_ring_takes_no_more(void **state)
{
    static const struct loop off = {
        "PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 9600, HM2_PARITY_NONE, HM2_DRIVE_OFF, 0, 0, 1};
    (void)state;
    static const uint8_t bytes[1000];
    struct sim_bench *const bench = sim_bench_new("7i80hd-16", off.firmware, "");
    struct hm2_serial *const port = open_port(bench, &off);
    size_t taken = 0;
    for (unsigned i = 0; i < 20; i++)
        taken += hm2_serial_put(port, bytes, sizeof bytes);
    assert_int_equal(taken, 8192);
    sim_bench_cycle(bench);
    assert_int_equal(hm2_serial_waiting(port), 8192);
    sim_bench_free(bench);
}

/* ---- replies that are late or lost ------------------------------------------------------------------------------- */

struct weather {
    struct sim_bench *bench;
    const struct loop *loop;
    unsigned cycle;
    bool calm, loses, loses_requests;
    unsigned stall_periods;
    size_t put;
};

/* Every fifth reply comes a period late, sometimes two in a row; one in a hundred never does. */
static void blow(void *context, const uint8_t *data, size_t len, bool done)
{
    const struct weather *const w = context;
    struct sim_faults faults = {.seed = 1};
    (void)data;
    (void)len;
    if (done)
        return;
    if (w->loses && w->cycle % 100 == 50)
        faults.loss = 1.0;
    else if (w->cycle % 5 == 2 || w->cycle % 25 == 8)
        faults.delay_min_ns = faults.delay_max_ns = BENCH_PERIOD_NS;
    assert_int_equal(sim_net_set_faults(w->bench->net, &faults), 0);
}

/* The world outside sends numbered bytes, now soon and now late in a period: it has a clock of its own. */
static bool send_burst(struct weather *w)
{
    const struct loop *const loop = w->loop;
    bool sent = false;
    sim_net_sleep_until(w->bench->net, w->bench->now_ns + w->cycle * 137u % 500u * 1000);
    const unsigned burst = w->cycle % loop->every == 0 ? loop->burst : 0;
    for (unsigned i = 0; i < burst && w->put < loop->bytes; i++, w->put++, sent = true) {
        const uint8_t byte = (uint8_t)w->put;
        assert_int_equal(sim_card_serial_put(w->bench->card, loop->gtag, 0, &byte, 1), 1);
    }
    return sent;
}

static void end_period(struct weather *w)
{
    w->bench->now_ns += BENCH_PERIOD_NS;
    sim_net_sleep_until(w->bench->net, w->bench->now_ns);
}

/* The thread is kept from its work, the world outside goes on. */
static bool stand_still(struct weather *w)
{
    bool sent = false;
    for (unsigned i = 0; i < w->stall_periods; i++) {
        w->cycle++;
        sent = send_burst(w) || sent;
        end_period(w);
    }
    return sent;
}

static bool cycle_in(struct weather *w)
{
    static const struct sim_faults calm = {.seed = 1}, gale = {.seed = 1, .loss = 1.0};
    struct sim_bench *const bench = w->bench;
    w->cycle++;
    if (w->loses_requests && w->cycle % 100 == 50)
        assert_int_equal(sim_net_set_faults(bench->net, &gale), 0);
    hm2_board_read(bench->board, BENCH_PERIOD_NS);
    assert_int_equal(sim_net_set_faults(bench->net, &calm), 0);
    hm2_board_write(bench->board, BENCH_PERIOD_NS);
    bool sent = send_burst(w);
    end_period(w);
    if (w->cycle % 100 == 0)
        sent = stand_still(w) || sent;
    assert_int_equal(sim_net_set_faults(bench->net, &calm), 0);
    return sent;
}

static void ignore(void *context, uint8_t byte)
{
    (void)context;
    (void)byte;
}

struct outcome {
    size_t got, end; /* bytes; place behind the last of them in what was sent, as far as 256 numbers tell */
    unsigned jumps;  /* where a byte is not followed by the next one */
    uint64_t lost_requests, lost_replies;
    struct hm2_serial_counts counts;
};

static struct outcome receive_in(const struct loop *loop, const struct weather *weather)
{
    struct sim_bench *const bench = sim_bench_new("7i80hd-16", loop->firmware, "");
    struct hm2_serial *const port = open_port(bench, loop);
    struct weather w = *weather;
    w.bench = bench;
    w.loop = loop;
    assert_int_equal(sim_card_serial(bench->card, loop->gtag, 0, ignore, NULL), 0);
    struct outcome out = {0};
    for (unsigned i = 0; i < 20; i++)
        sim_bench_cycle(bench);
    if (!w.calm)
        sim_net_on_taken(bench->net, blow, &w);
    for (unsigned idle = 0; idle < 150; idle++) {
        uint8_t bytes[512];
        if (cycle_in(&w))
            idle = 0;
        for (size_t n; (n = hm2_serial_get(port, bytes, sizeof bytes)) > 0; out.got += n)
            for (size_t i = 0; i < n; i++) {
                const uint8_t ahead = (uint8_t)(bytes[i] - (uint8_t)out.end);
                out.jumps += ahead != 0;
                out.end += ahead + 1u; /* repeated or out of order: the end goes beyond what was sent */
            }
    }
    out.counts = hm2_serial_counts(port);
    out.lost_requests = sim_net_truth(bench->net).lost[0];
    out.lost_replies = sim_net_truth(bench->net).lost[1];
    sim_bench_free(bench);
    return out;
}

static const struct loop stormy[] = {
    {"SVUA8_8_72", HM2_SERIAL_UART, HM2_GTAG_UART_TX, 115200, HM2_PARITY_NONE, HM2_DRIVE_AUTO, 6000, 8, 1},
    {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 115200, HM2_PARITY_NONE, HM2_DRIVE_AUTO, 6000, 8, 1},
    {"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_EVEN, HM2_DRIVE_ON, 6000, 8, 1},
    {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 60000, 77, 1},
    {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 60000, 150, 7},
    {"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 115200, HM2_PARITY_NONE, HM2_DRIVE_ON, 9000, 29, 9},
};

static void late_replies_cost_no_byte(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof stormy / sizeof stormy[0]; i++) {
        const struct outcome out = receive_in(&stormy[i], &(struct weather){0});
        if (out.got != stormy[i].bytes || out.end != stormy[i].bytes || out.counts.rx_uncertain ||
            out.counts.rx_overruns)
            fail_msg("row %zu: %zu bytes, end %zu, uncertain %u, overruns %u", i, out.got, out.end,
                     out.counts.rx_uncertain, out.counts.rx_overruns);
    }
}

static void lost_replies_are_counted_and_what_arrives_is_in_order(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof stormy / sizeof stormy[0]; i++) {
        const struct outcome out = receive_in(&stormy[i], &(struct weather){.loses = true});
        const size_t missing = stormy[i].bytes - out.got;
        if (out.lost_replies == 0 || missing == 0 || out.end > stormy[i].bytes || out.jumps > out.lost_replies ||
            missing > out.counts.rx_uncertain || out.counts.rx_overruns > 0)
            fail_msg("row %zu: %zu bytes, end %zu, jumps %u, uncertain %u, overruns %u, replies lost %u", i, out.got,
                     out.end, out.jumps, out.counts.rx_uncertain, out.counts.rx_overruns, (unsigned)out.lost_replies);
        /* When the line rests between messages the count is exact, but for the end of a frame of unknown length. */
        if (stormy[i].every > 1 && out.counts.rx_uncertain - missing > 3u * out.lost_replies)
            fail_msg("row %zu: %zu bytes are missing, %u counted, %u replies lost", i, missing, out.counts.rx_uncertain,
                     (unsigned)out.lost_replies);
    }
}

/* Sizes or words that were not given are still there. */
static void a_lost_request_costs_a_packet_uart_that_rests_nothing(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof stormy / sizeof stormy[0]; i++) {
        if (stormy[i].every == 1)
            continue;
        const struct outcome out = receive_in(&stormy[i], &(struct weather){.loses_requests = true});
        if (out.lost_requests == 0 || out.got != stormy[i].bytes || out.jumps || out.counts.rx_uncertain ||
            out.counts.rx_overruns)
            fail_msg("row %zu: %zu bytes, jumps %u, uncertain %u, overruns %u, requests lost %u", i, out.got, out.jumps,
                     out.counts.rx_uncertain, out.counts.rx_overruns, (unsigned)out.lost_requests);
    }
}

struct ear {
    size_t put, heard, wrong;
};

static void hear(void *context, uint8_t byte)
{
    struct ear *const ear = context;
    ear->wrong += byte != pattern(ear->heard++);
}

static void deafen(void *context, const uint8_t *data, size_t len, bool done)
{
    static const struct sim_faults gale = {.seed = 1, .loss = 1.0};
    const struct weather *const w = context;
    (void)data;
    (void)len;
    if (!done && w->loses)
        assert_int_equal(sim_net_set_faults(w->bench->net, &gale), 0);
}

/* The writes arrive, but no reply tells: no more is sent than the card's transmitter can keep, and nothing of it is
 * overwritten. */
static void a_packet_uart_that_hears_no_replies_spoils_nothing_that_it_sends(void **state)
{
    static const struct sim_faults calm = {.seed = 1};
    static const struct loop loop = {
        "PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 0, 3000, 1};
    (void)state;
    struct sim_bench *const bench = sim_bench_new("7i80hd-16", loop.firmware, "");
    struct hm2_serial *const port = open_port(bench, &loop);
    struct weather w = {.bench = bench};
    struct ear ear = {0};
    assert_int_equal(sim_card_serial(bench->card, loop.gtag, 0, hear, &ear), 0);
    sim_net_on_taken(bench->net, deafen, &w);
    sim_bench_set(bench, "packet-error-limit", 1e6);
    for (w.cycle = 1; w.cycle < 459; w.cycle++) {
        w.loses = w.cycle % 80 >= 60;
        for (unsigned i = 0; w.cycle % 80 == 60 && i < loop.burst; i++, ear.put++) {
            const uint8_t byte = pattern(ear.put);
            assert_int_equal(hm2_serial_put(port, &byte, 1), 1);
        }
        assert_int_equal(sim_net_set_faults(bench->net, &calm), 0);
        hm2_board_read(bench->board, BENCH_PERIOD_NS);
        assert_int_equal(sim_net_set_faults(bench->net, &calm), 0);
        hm2_board_write(bench->board, BENCH_PERIOD_NS);
        stall(bench, 1);
    }
    assert_true(sim_net_truth(bench->net).lost[1] > 90);
    assert_int_equal(ear.heard, ear.put);
    assert_int_equal(ear.wrong, 0);
    assert_true(hm2_serial_counts(port).tx_uncertain > 0);
    sim_bench_free(bench);
}

/* ---- more than the card can keep --------------------------------------------------------------------------------- */

/* A frame of more than 1023 bytes has a size that is too small, and words that do not read are overwritten: the
 * firmware tells neither. */
static void what_the_card_cannot_keep_is_counted_and_nothing_wrong_arrives(void **state)
{
    static const struct {
        struct loop loop;
        unsigned stall_periods;
    } rows[] = {
        {{"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 30000, 77, 1},
         12},
        {{"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 30000, 77, 1},
         40},
        {{"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 9000, 3000, 80},
         0},
        {{"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 4400, 1100, 40},
         0},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct outcome out =
            receive_in(&rows[i].loop, &(struct weather){.calm = true, .stall_periods = rows[i].stall_periods});
        const size_t missing = rows[i].loop.bytes - out.got;
        if (missing == 0 || out.end > rows[i].loop.bytes || out.jumps > out.counts.rx_overruns ||
            missing > out.counts.rx_uncertain || out.counts.rx_overruns == 0)
            fail_msg("row %zu: %zu bytes, end %zu, jumps %u, uncertain %u, overruns %u", i, out.got, out.end, out.jumps,
                     out.counts.rx_uncertain, out.counts.rx_overruns);
    }
}

/* The same stalls with short messages, as from a device that is asked: all there. */
static void a_thread_that_stalls_costs_short_messages_nothing(void **state)
{
    static const struct loop rows[] = {
        {"PKTUART_0", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 1000000, HM2_PARITY_NONE, HM2_DRIVE_ON, 3000, 100, 12},
        {"PKTUART_1", HM2_SERIAL_PKTUART, HM2_GTAG_PKTUART_TX, 115200, HM2_PARITY_NONE, HM2_DRIVE_ON, 3000, 60, 12},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct outcome out = receive_in(&rows[i], &(struct weather){.calm = true, .stall_periods = 40});
        if (out.got != rows[i].bytes || out.jumps || out.counts.rx_overruns)
            fail_msg("row %zu: %zu bytes, jumps %u, uncertain %u, overruns %u", i, out.got, out.jumps,
                     out.counts.rx_uncertain, out.counts.rx_overruns);
    }
}

/* The frame that it shows may have begun just before the card answered. */
static void a_reply_that_took_long_makes_no_frame_endless(void **state)
{
    static const struct {
        int64_t sent_us, received_us;
        bool still, endless;
    } rows[] = {{0, 100, true, false},
                {1000, 45000, false, false},
                {45050, 45100, false, false},
                {50000, 50100, false, false},
                {58000, 58100, false, true}};
    struct pkt_crowd crowd = {0};
    (void)state;
    pkt_crowd_init(&crowd, 1000000, false);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct pkt_sight sight = {
            .sent_ns = rows[i].sent_us * 1000, .received_ns = rows[i].received_us * 1000, .still = rows[i].still};
        pkt_crowd_see(&crowd, &sight);
        if (pkt_crowd_is_endless(&crowd) != rows[i].endless)
            fail_msg("row %zu: %s", i, rows[i].endless ? "not endless" : "endless");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_loop_brings_every_byte_back),
        cmocka_unit_test(settings_that_the_firmware_cannot_keep_are_refused),
        cmocka_unit_test(outputs_have_the_second_names_of_linuxcnc),
        cmocka_unit_test(a_full_ring_takes_no_more),
        cmocka_unit_test(a_thread_that_stalls_costs_a_loop_nothing),
        cmocka_unit_test(a_reply_that_took_long_makes_no_frame_endless),
        cmocka_unit_test(what_the_card_cannot_keep_is_counted_and_nothing_wrong_arrives),
        cmocka_unit_test(a_thread_that_stalls_costs_short_messages_nothing),
        cmocka_unit_test(late_replies_cost_no_byte),
        cmocka_unit_test(a_packet_uart_that_hears_no_replies_spoils_nothing_that_it_sends),
        cmocka_unit_test(a_lost_request_costs_a_packet_uart_that_rests_nothing),
        cmocka_unit_test(lost_replies_are_counted_and_what_arrives_is_in_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
