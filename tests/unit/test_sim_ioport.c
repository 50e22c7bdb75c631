/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "firmware_card.h"
#include "idrom_files.h"
#include "random.h"
#include "sim_card.h"
#include "trace_folder.h"

#define PORT(n)  (uint16_t)(0x1000 + 4 * (n))
#define DDR(n)   (uint16_t)(0x1100 + 4 * (n))
#define ALT(n)   (uint16_t)(0x1200 + 4 * (n))
#define DRAIN(n) (uint16_t)(0x1300 + 4 * (n))
#define INV(n)   (uint16_t)(0x1400 + 4 * (n))
#define LED      0x0200

#define STEPGEN_MODE  0x2200
#define STEPGEN_TABLE 0x2700
#define STEPGEN_PAD   24 /* first output of step generator 0 in SVST4_4_48 */

/* ---- traces -------------------------------------------------------------------------------------------------------
 */

static void every_recorded_read_is_matched(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("ioport");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 5 + 64); /* tests and rows of the truth table */
}

/* One row of truth.csv: alternate data, alternate source, invert, open drain, DDR, output register -> pad, read bit. */
static void check_truth(struct sim_card *const card, const int64_t clk, const char *const row)
{
    static const uint16_t address[] = {0, ALT(1), INV(1), DRAIN(1), DDR(1), PORT(1)};
    sim_card_write(card, clk, STEPGEN_TABLE, row[0] == '1');
    for (unsigned i = 1; i < 6; i++)
        sim_card_write(card, clk + i, address[i], row[2 * i] == '1');
    const enum sim_level pad = sim_card_pad(card, STEPGEN_PAD);
    const uint32_t bit = sim_card_read(card, clk + 10, PORT(1), NULL) & 1u;
    const char shown = pad == SIM_LOW ? '0' : pad == SIM_HIGH ? '1' : 'H';
    if (shown != row[12] || bit != (row[14] == '1'))
        fail_msg("%.15s: pad %c, bit %u", row, shown, bit);
}

static void the_recorded_truth_table_of_a_pad_is_matched(void **state)
{
    (void)state;
    size_t len = 0;
    char *const text = load_text(TEST_DATA "/ioport/truth.csv", &len);
    struct sim_card *const card = firmware_card("SVST4_4_48");
    sim_card_write(card, 0, STEPGEN_MODE, 3);
    unsigned rows = 0;
    for (const char *row = strchr(text, '\n'); row && row[1]; row = strchr(row + 1, '\n'))
        check_truth(card, 20 + 20 * rows++, row + 1);
    assert_int_equal(rows, 64);
    sim_card_free(card);
    free(text);
}

/* ---- rules --------------------------------------------------------------------------------------------------------
 */

static void a_port_of_17_bits_ignores_and_reads_as_zero_what_lies_beyond(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card(NULL);
    uint32_t undriven = 0;
    sim_card_write(card, 0, DDR(2), 0xFFFFFFFF);
    assert_int_equal(sim_card_read(card, 1, DDR(2), &undriven), 0x0001FFFF);
    assert_int_equal(undriven, 0);
    assert_int_equal(sim_card_read(card, 2, PORT(1), &undriven), 0x0001FFFF);
    assert_int_equal(undriven, 0);
    sim_card_read(card, 3, PORT(3), &undriven);
    assert_int_equal(undriven, 0xFFFFFFFF);
    assert_int_equal(sim_card_pad(card, 34), SIM_LOW);
    assert_int_equal(sim_card_pad(card, 33), SIM_FLOAT);
    sim_card_free(card);
}

static void addresses_repeat_within_the_page(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card("SVST4_4_48");
    sim_card_write(card, 0, (uint16_t)(DDR(1) + 0x40), 0x123456); /* bits 4..2 select the port */
    assert_int_equal(sim_card_read(card, 1, DDR(1), NULL), 0x123456);
    assert_int_equal(sim_card_read(card, 1, (uint16_t)(DDR(1) + 0xE0), NULL), 0x123456);
    sim_card_free(card);
}

static void a_floating_pad_reads_as_not_driven(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card("SVST4_4_48");
    uint32_t undriven = 0;
    assert_int_equal(sim_card_drive(card, 5, 3, SIM_FLOAT), 0);
    assert_int_equal(sim_card_drive(card, 5, 4, SIM_LOW), 0);
    const uint32_t value = sim_card_read(card, 10, PORT(0), &undriven);
    assert_int_equal(undriven, 0x000008);
    assert_int_equal(value & ~undriven, 0xFFFFE7);
    sim_card_free(card);
}

static void leds_are_the_top_bits_and_lit_when_low(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card("SVST4_4_48");
    struct sim_module *const led = sim_find(card, HM2_GTAG_LED);
    assert_non_null(led);
    sim_card_write(card, 5, LED + 0x10, 0xA0000000); /* the whole page is one register */
    for (unsigned i = 0; i < 4; i++)
        assert_int_equal(led->ops->output(led, i, 0x81), i & 1 ? SIM_LOW : SIM_HIGH);
    uint32_t undriven = 0;
    sim_card_read(card, 6, LED, &undriven);
    assert_int_equal(undriven, 0xFFFFFFFF);
    sim_card_free(card);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_read_is_matched),
        cmocka_unit_test(the_recorded_truth_table_of_a_pad_is_matched),
        cmocka_unit_test(a_port_of_17_bits_ignores_and_reads_as_zero_what_lies_beyond),
        cmocka_unit_test(addresses_repeat_within_the_page),
        cmocka_unit_test(a_floating_pad_reads_as_not_driven),
        cmocka_unit_test(leds_are_the_top_bits_and_lit_when_low),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
