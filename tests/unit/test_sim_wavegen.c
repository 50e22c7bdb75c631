/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Simulated waveform generators. */
#include "unit.h"

#include "firmware_card.h"
#include "sim_card.h"
#include "trace_folder.h"

#define FIRMWARE "SVWG8_2IM2_72"

static void every_recorded_read_and_edge_is_matched(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("wavegen");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 11);
}

struct pulses {
    int64_t rise, period; /* in edges of ClockHigh */
    unsigned rises;
};

static void note_edge(void *context, int64_t clk, unsigned ps, unsigned watch, enum sim_level level)
{
    struct pulses *const p = context;
    (void)watch;
    if (level != SIM_HIGH)
        return;
    const int64_t at = 2 * clk + (ps > 5000);
    p->period = at - p->rise;
    p->rise = at;
    p->rises++;
}

/* A quarter of the pulses, for the dividers of the recorded tests: the distances recorded there. */
static void pulses_of_a_constant_value_have_the_recorded_distance(void **state)
{
    (void)state;
    static const struct {
        uint32_t divider;
        int64_t period;
    } rows[] = {{0x80, 4}, {0x00, 8}, {0x01, 12}, {0x7F, 4 * 129}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sim_card *const card = firmware_card(FIRMWARE);
        struct pulses p = {0};
        sim_card_write(card, 12, 0x2B00, rows[i].divider);
        sim_card_write(card, 18, 0x2D00, 0);
        sim_card_write(card, 21, 0x2E00, 0x400);
        assert_int_equal(sim_card_watch_output(card, HM2_GTAG_WAVEGEN, 0, 0x81), 0);
        sim_card_on_edge(card, note_edge, &p);
        sim_card_advance(card, 2000);
        assert_true(p.rises >= 3);
        assert_int_equal(p.period, rows[i].period);
        sim_card_free(card);
    }
}

static void a_generator_at_rest_costs_nearly_nothing(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card(FIRMWARE);
    uint32_t undriven = 0;
    sim_card_write(card, 12, 0x2B00, 0x7F);
    (void)sim_card_read(card, 360000000000, 0x2A00, &undriven);
    assert_int_equal(undriven, UINT32_MAX);
    sim_card_free(card);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_read_and_edge_is_matched),
        cmocka_unit_test(pulses_of_a_constant_value_have_the_recorded_distance),
        cmocka_unit_test(a_generator_at_rest_costs_nearly_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
