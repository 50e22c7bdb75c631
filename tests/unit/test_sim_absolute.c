/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Simulated readers of absolute encoders: SSI, BISS, FanucAbs. */
#include "unit.h"

#include "sim_card.h"
#include "trace_folder.h"

static void every_recorded_read_and_edge_is_matched(void **state)
{
    (void)state;
    static const struct {
        const char *folder;
        unsigned tests;
    } rows[] = {{"ssi", 35}, {"ssi_new", 19}, {"biss", 43}, {"fabs", 33}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct replay_totals totals = replay_data(rows[i].folder);
        assert_int_equal(totals.failed, 0);
        assert_int_equal(totals.passed, rows[i].tests);
    }
}

static struct sim_card *new_card(const char *firmware, enum sim_sources sources)
{
    struct hm2_image image;
    struct sim_card *card;
    assert_true(replay_firmware(firmware, &image));
    const struct sim_card_options options = {.profile = "7i93", .image = &image, .sources = sources};
    assert_int_equal(sim_card_new(&card, &options, NULL), 0);
    return card;
}

static void encoders_are_refused_where_there_is_no_channel(void **state)
{
    (void)state;
    struct sim_card *const card = new_card("SISS4_4_72", SIM_SOURCES_OF_MAP);
    const struct sim_absolute good = {.bits = 12}, too_long = {.bits = 129},
                              from_the_past = {.bits = 1, .delay_ps = -1};
    assert_int_equal(sim_card_absolute(card, HM2_GTAG_SSI, 3, &good), 0);
    assert_int_equal(sim_card_absolute(card, HM2_GTAG_SSI, 4, &good), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_absolute(card, HM2_GTAG_BISS, 0, &good), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_absolute(card, HM2_GTAG_LED, 0, &good), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_absolute(card, HM2_GTAG_SSI, 0, &too_long), HM2_ERR_RANGE);
    assert_int_equal(sim_card_absolute(card, HM2_GTAG_SSI, 0, &from_the_past), HM2_ERR_RANGE);
    sim_card_free(card);
}

/* A clock that nobody answers runs on: an hour of that must not be an hour's work. */
static void a_reader_without_an_encoder_costs_nearly_nothing(void **state)
{
    (void)state;
    const int64_t hour_clk = 360000000000;
    struct sim_card *card = new_card("BI1_72", SIM_SOURCES_OF_MAP);
    sim_card_write(card, 100, 0x4A00, 0x0CCD2412);
    sim_card_write(card, 200, 0x4900, 0);
    assert_int_equal(sim_card_read(card, hour_clk, 0x4C00, NULL), 1);
    sim_card_free(card);
    card = new_card("FA1_72", SIM_SOURCES_OF_MAP);
    assert_int_equal(sim_card_drive_input(card, 0, HM2_GTAG_FABS, 0, 0x03, SIM_LOW), 0);
    sim_card_write(card, 100, 0x1500, 0);
    assert_int_equal(sim_card_read(card, hour_clk, 0x1800, NULL), 0x0800);
    sim_card_free(card);
    card = new_card("SISS4_4_72", SIM_SOURCES_OF_MAP);
    sim_card_write(card, 100, 0x6A00, 0x10000000); /* a count of 0 never ends */
    sim_card_write(card, 200, 0x6800, 0);
    assert_int_equal(sim_card_read(card, hour_clk, 0x6A00, NULL), 0x10000800);
    sim_card_free(card);
}

static void the_start_masks_of_biss_are_crossed_in_the_sources_of_2021_only(void **state)
{
    (void)state;
    static const struct {
        enum sim_sources sources;
        uint32_t shown;
    } rows[] = {{SIM_SOURCES_OF_MAP, 0x200}, {SIM_SOURCES_2021, 0x200}, {SIM_SOURCES_LATER, 0x100}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sim_card *const card = new_card("BI1_72", rows[i].sources);
        sim_card_write(card, 100, 0x4B00, 0x100);
        assert_int_equal(sim_card_read(card, 103, 0x4B00, NULL) & 0x300, rows[i].shown);
        sim_card_free(card);
    }
}

static void the_setup_bit_of_fanuc_is_24_in_the_sources_of_2021_and_7_in_later_ones(void **state)
{
    (void)state;
    for (unsigned later = 0; later < 2; later++) {
        struct sim_card *const card = new_card("FA1_72", later ? SIM_SOURCES_LATER : SIM_SOURCES_2021);
        sim_card_write(card, 100, 0x1800, later ? 0x01000000 : 0x80);
        sim_card_write(card, 103, 0x1900, 0x50012345);
        assert_int_equal(sim_card_read(card, 106, 0x1900, NULL), 0xF00029F1);
        sim_card_write(card, 109, 0x1800, later ? 0x80 : 0x01000000);
        sim_card_write(card, 112, 0x1900, 0x50012345);
        assert_int_equal(sim_card_read(card, 115, 0x1900, NULL), 0x50012345);
        sim_card_free(card);
    }
}

static void a_power_cycle_forgets_data_and_keeps_the_encoder(void **state)
{
    (void)state;
    struct sim_card *const card = new_card("SISS4_4_72", SIM_SOURCES_OF_MAP);
    const struct sim_absolute encoder = {.bits = 16, .value = {0xBEEF}, .delay_ps = 50000};
    assert_int_equal(sim_card_absolute(card, HM2_GTAG_SSI, 0, &encoder), 0);
    for (unsigned round = 0; round < 2; round++) {
        const int64_t clk = sim_card_clock(card);
        assert_int_equal(sim_card_read(card, clk, 0x6800, NULL), 0);
        sim_card_write(card, clk + 1, 0x6A00, 0x028F0010);
        sim_card_write(card, clk + 2, 0x6800, 0);
        assert_int_equal(sim_card_read(card, clk + 5000, 0x6800, NULL), 0xBEEF);
        sim_card_power_cycle(card);
    }
    sim_card_free(card);
}

/* A real one latches its position at the first edge. */
static void an_encoder_that_moves_during_a_transfer_sends_where_it_was_at_the_start(void **state)
{
    (void)state;
    static const struct {
        const char *firmware;
        uint8_t gtag;
        uint16_t start, control, data;
        uint32_t set, mask;
    } rows[] = {
        {"SISS4_4_72", HM2_GTAG_SSI, 0x6800, 0x6A00, 0x6800, 0x028F0010, 0xFFFF},
        {"BI1_72", HM2_GTAG_BISS, 0x4900, 0x4A00, 0x4900, 0x0CCD2410, 0xFFFF},
        {"FA1_72", HM2_GTAG_FABS, 0x1500, 0x1800, 0x1500, 0, 0xFFFF},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sim_card *const card = new_card(rows[i].firmware, SIM_SOURCES_OF_MAP);
        struct sim_absolute encoder = {
            .bits = rows[i].gtag == HM2_GTAG_FABS ? 76 : 16, .value = {0x5A5A}, .delay_ps = 50000};
        assert_int_equal(sim_card_absolute(card, rows[i].gtag, 0, &encoder), 0);
        sim_card_write(card, 2000, rows[i].control, rows[i].set);
        sim_card_write(card, 2100, rows[i].start, 0);
        for (int64_t clk = 2200; clk < 2800; clk += 100) {
            encoder.value[0] ^= 0xFFFF;
            sim_card_advance(card, clk);
            assert_int_equal(sim_card_absolute(card, rows[i].gtag, 0, &encoder), 0);
        }
        assert_int_equal(sim_card_read(card, 100000, rows[i].data, NULL) & rows[i].mask, 0x5A5A);
        sim_card_free(card);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_read_and_edge_is_matched),
        cmocka_unit_test(encoders_are_refused_where_there_is_no_channel),
        cmocka_unit_test(a_reader_without_an_encoder_costs_nearly_nothing),
        cmocka_unit_test(the_start_masks_of_biss_are_crossed_in_the_sources_of_2021_only),
        cmocka_unit_test(the_setup_bit_of_fanuc_is_24_in_the_sources_of_2021_and_7_in_later_ones),
        cmocka_unit_test(a_power_cycle_forgets_data_and_keeps_the_encoder),
        cmocka_unit_test(an_encoder_that_moves_during_a_transfer_sends_where_it_was_at_the_start),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
