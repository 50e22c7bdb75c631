/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Buffered SPI on a simulated card with the firmware 2X7I65. */
#include "unit.h"

#include <hm2/bspi.h>

#include "sim_bench.h"

#define PIN_MOSI 0x82
#define PIN_MISO 0x04

static const struct hm2_bspi_channel bits16 = {.chip_select = 3, .bits = 16, .mhz = 6.0, .cpol = true};

static struct sim_bench *bench_of(void **state)
{
    return *state = sim_bench_new("7i80hd-16", "2X7I65_72", "");
}

static int tear_down(void **state)
{
    sim_bench_free(*state);
    return 0;
}

/* A wire from MOSI to MISO. */
struct loop {
    struct sim_card *card;
    int watch;
    uint32_t words;
};

static void on_edge(void *context, int64_t clk, unsigned ps, unsigned watch, enum sim_level level)
{
    const struct loop *const loop = context;
    (void)ps;
    if (loop->watch == (int)watch)
        assert_int_equal(sim_card_drive_input(loop->card, clk, HM2_GTAG_BSPI, 0, PIN_MISO, level), 0);
}

static void make_loop(struct sim_bench *bench, struct loop *loop)
{
    loop->card = bench->card;
    loop->watch = sim_card_watch_output(bench->card, HM2_GTAG_BSPI, 0, PIN_MOSI);
    assert_true(loop->watch >= 0);
    assert_int_equal(sim_card_drive_input(bench->card, -1, HM2_GTAG_BSPI, 0, PIN_MISO, SIM_LOW), 0);
    sim_card_on_edge(bench->card, on_edge, loop);
}

static void a_port_that_the_configuration_leaves_out_is_not_there(void **state)
{
    struct sim_bench *const bench = sim_bench_new("7i80hd-16", "2X7I65_72", "num_bspis=1");
    *state = bench;
    assert_non_null(hm2_bspi_port(bench->board, 0));
    assert_null(hm2_bspi_port(bench->board, 1));
}

/* LinuxCNC's driver makes them outputs while it loads, not with the first cycle: a daughter card never sees them float.
 */
static void outputs_have_names_and_are_driven_from_the_start(void **state)
{
    static const struct {
        unsigned io;
        const char *name;
    } rows[] = {{14, "nframe"}, {15, "out"}, {16, "clk"}, {18, "cs2"}, {19, "cs1"}, {20, "cs0"}};
    const struct sim_bench *const bench = bench_of(state);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char name[64];
        int err;
        (void)snprintf(name, sizeof name, "hm2_7i80.0.bspi.00.%s.invert_output", rows[i].name);
        (void)hm2_plain_get(bench->plain, name, &err);
        assert_int_equal(err, 0);
        assert_true(sim_card_pad(bench->card, rows[i].io) != SIM_FLOAT);
    }
}

static void impossible_settings_are_refused_with_a_reason(void **state)
{
    struct sim_bench *const bench = bench_of(state);
    struct hm2_bspi *const port = hm2_bspi_port(bench->board, 0);
    struct hm2_bspi_channel bad = bits16;
    bad.bits = 33;
    assert_int_equal(hm2_bspi_set_channel(port, 0, &bad, &bench->diag), HM2_ERR_RANGE);
    bad = bits16;
    bad.mhz = 0.0;
    assert_int_equal(hm2_bspi_set_channel(port, 0, &bad, &bench->diag), HM2_ERR_RANGE);
    assert_int_equal(hm2_bspi_set_channel(port, 16, &bits16, &bench->diag), HM2_ERR_RANGE);
    assert_false(hm2_bspi_channel_known(port, 0));
    assert_non_null(strstr(bench->diag.text, "1 to 32 bits"));
}

static void frames_come_back_in_order_and_on_their_own_channel(void **state)
{
    struct sim_bench *const bench = bench_of(state);
    struct hm2_bspi *const port = hm2_bspi_port(bench->board, 0);
    struct hm2_bspi_channel silent = bits16;
    struct loop loop;
    uint32_t *out[3], *in[3];
    silent.no_echo = true;
    make_loop(bench, &loop);
    assert_int_equal(hm2_bspi_set_channel(port, 3, &bits16, &bench->diag), 0);
    assert_int_equal(hm2_bspi_set_channel(port, 1, &silent, &bench->diag), 0);
    hm2_board_change_begin(bench->board);
    for (unsigned i = 0; i < 3; i++)
        assert_int_equal(hm2_bspi_add_frame(port, i == 1 ? 1 : 3, &out[i], &in[i], &bench->diag), 0);
    assert_int_equal(hm2_board_change_end(bench->board, &bench->diag), 0);
    assert_null(in[1]);
    *out[0] = 0x1234;
    *out[1] = 0x7777;
    *out[2] = 0x5678;
    for (unsigned i = 0; i < 5; i++)
        sim_bench_cycle(bench);
    assert_int_equal(*in[0] & 0xFFFF, 0x1234);
    assert_int_equal(*in[2] & 0xFFFF, 0x5678);
    *out[2] = 0xABCD;
    sim_bench_cycle(bench);
    sim_bench_cycle(bench);
    assert_int_equal(*in[2] & 0xFFFF, 0xABCD);
    assert_int_equal(hm2_bspi_short_cycles(port), 0);
}

static void lost_packets_never_shift_the_words(void **state)
{
    struct sim_bench *const bench = bench_of(state);
    struct hm2_bspi *const port = hm2_bspi_port(bench->board, 0);
    const struct sim_faults faults = {.seed = 3, .loss = 0.3};
    struct loop loop;
    uint32_t *out[9], *in[9];
    make_loop(bench, &loop);
    assert_int_equal(hm2_bspi_set_channel(port, 3, &bits16, &bench->diag), 0);
    hm2_board_change_begin(bench->board);
    for (unsigned i = 0; i < 9; i++) {
        assert_int_equal(hm2_bspi_add_frame(port, 3, &out[i], &in[i], &bench->diag), 0);
        *out[i] = 0x1000 + i;
        *in[i] = 0x1000 + i;
    }
    assert_int_equal(hm2_board_change_end(bench->board, &bench->diag), 0);
    assert_int_equal(hm2_plain_set(bench->plain, "hm2_7i80.0.packet-error-limit", 1000000), 0);
    assert_int_equal(sim_net_set_faults(bench->net, &faults), 0);
    for (unsigned cycle = 0; cycle < 300; cycle++) {
        sim_bench_cycle(bench);
        for (unsigned i = 0; i < 9; i++)
            assert_int_equal(*in[i] & 0xFFFF, 0x1000 + i);
    }
}

static void words_sent_once_follow_the_frames_and_are_limited(void **state)
{
    struct sim_bench *const bench = bench_of(state);
    struct hm2_bspi *const port = hm2_bspi_port(bench->board, 0);
    assert_int_equal(hm2_bspi_set_channel(port, 3, &bits16, &bench->diag), 0);
    unsigned taken = 0;
    while (hm2_bspi_send(port, 3, 0x55))
        taken++;
    assert_int_equal(taken, 16);
    for (unsigned i = 0; i < 40; i++)
        sim_bench_cycle(bench);
    assert_int_equal(sim_card_read(bench->card, sim_card_clock(bench->card), 0x5600, NULL) & 0x1F, 16);
    assert_true(hm2_bspi_send(port, 3, 0x55));
}

static unsigned calls;

static int count_call(void *context)
{
    (void)context;
    calls++;
    return 0;
}

static void registered_functions_are_called_once_a_cycle(void **state)
{
    struct sim_bench *const bench = bench_of(state);
    struct hm2_bspi *const port = hm2_bspi_port(bench->board, 0);
    calls = 0;
    hm2_bspi_on_read(port, count_call, port);
    hm2_bspi_on_write(port, count_call, port);
    for (unsigned i = 0; i < 5; i++)
        sim_bench_cycle(bench);
    assert_int_equal(calls, 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(a_port_that_the_configuration_leaves_out_is_not_there, tear_down),
        cmocka_unit_test_teardown(outputs_have_names_and_are_driven_from_the_start, tear_down),
        cmocka_unit_test_teardown(impossible_settings_are_refused_with_a_reason, tear_down),
        cmocka_unit_test_teardown(frames_come_back_in_order_and_on_their_own_channel, tear_down),
        cmocka_unit_test_teardown(lost_packets_never_shift_the_words, tear_down),
        cmocka_unit_test_teardown(words_sent_once_follow_the_frames_and_are_limited, tear_down),
        cmocka_unit_test_teardown(registered_functions_are_called_once_a_cycle, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
