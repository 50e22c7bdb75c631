/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Analog loops over a 7I65 at a buffered SPI port: DAC, an axis, its sensor at the ADC or a multiplexed encoder of the
 * 7I65, and a controller in the cycle. */
#include "unit.h"

#include <hm2/bspi.h>

#include "sim_bench.h"

enum { DAC = 1, ADC = 3, CPLD = 4, INPUTS = 8 };

struct chain {
    uint32_t *dac, *adc[INPUTS], *adc_in[INPUTS], *cpld, *cpld_in;
};

static void set_channel(struct sim_bench *bench, struct hm2_bspi *port, unsigned channel, unsigned bits, double mhz,
                        bool no_echo)
{
    const struct hm2_bspi_channel settings = {
        .chip_select = channel, .bits = bits, .mhz = mhz, .cpol = true, .no_echo = no_echo};
    assert_int_equal(hm2_bspi_set_channel(port, channel, &settings, &bench->diag), 0);
}

static void build_chain(struct sim_bench *bench, struct hm2_bspi *port, struct chain *chain)
{
    set_channel(bench, port, DAC, 24, 25.0, true);
    set_channel(bench, port, ADC, 16, 6.0, false);
    set_channel(bench, port, CPLD, 12, 6.0, false);
    hm2_board_change_begin(bench->board);
    assert_int_equal(hm2_bspi_add_frame(port, CPLD, &chain->cpld, &chain->cpld_in, &bench->diag), 0);
    for (unsigned i = 0; i < INPUTS; i++)
        assert_int_equal(hm2_bspi_add_frame(port, ADC, &chain->adc[i], &chain->adc_in[i], &bench->diag), 0);
    assert_int_equal(hm2_bspi_add_frame(port, DAC, &chain->dac, NULL, &bench->diag), 0);
    assert_int_equal(hm2_board_change_end(bench->board, &bench->diag), 0);
}

static void an_analog_loop_closes_on_a_simulated_axis(void **state)
{
    (void)state;
    struct sim_bench *const bench = sim_bench_new("7i80hd-16", "2X7I65_72", "num_bspis=1");
    struct hm2_bspi *const port = hm2_bspi_port(bench->board, 0);
    struct sim_7i65 *servo;
    struct chain chain;
    double position = -5.0;
    assert_int_equal(sim_7i65_new(&servo, bench->card, 0), 0);
    sim_7i65_set_inputs(servo, 0x5);
    build_chain(bench, port, &chain);
    *chain.cpld = 0xA02; /* enable 1 */
    *chain.adc[INPUTS - 1] = 0x9C18;
    *chain.dac = 0x10000F; /* power */
    for (unsigned i = 0; i < 5; i++)
        sim_bench_cycle(bench);
    for (unsigned i = 0; i < 2000; i++) {
        sim_7i65_set_input_volts(servo, 1, position);
        sim_bench_cycle(bench);
        const int32_t code = (int32_t)(*chain.adc_in[1] << 19) >> 19;
        const double output = (3.0 - code / 409.6) * 0.5;
        *chain.dac = 0x010000u | ((uint32_t)(int32_t)(output * 3276.8) & 0xFFFFu);
        position += sim_7i65_output_volts(servo, 1) * 0.02;
    }
    assert_int_equal(sim_7i65_enables(servo), 0x02);
    assert_int_equal(*chain.cpld_in & 0xF, 0x5);
    if (position < 2.99 || position > 3.01)
        fail_msg("the axis is at %g V, expected 3", position);
    assert_int_equal(hm2_bspi_short_cycles(port), 0);
    sim_7i65_free(servo);
    sim_bench_free(bench);
}

#define COUNTS_PER_S 100000 /* at 10 V */
#define POSITION     5000   /* counts that the loop is asked for */

static uint32_t dac_word(double output)
{
    output = output > 1.0 ? 1.0 : output < -1.0 ? -1.0 : output;
    return (uint32_t)(int32_t)(output * 32767.0) & 0xFFFFu; /* channel 0 */
}

/* The bench with a motor at output 0 and its encoder; powered, and enabled when wanted. */
static struct sim_bench *with_motor(struct sim_7i65 **servo, struct chain *chain, double time_constant_s, bool enabled)
{
    struct sim_bench *const bench = sim_bench_new("7i80hd-16", "2X7I65_72", "num_bspis=1");
    assert_int_equal(sim_7i65_new(servo, bench->card, 0), 0);
    assert_int_equal(sim_7i65_motor(*servo, 0, 3, COUNTS_PER_S, time_constant_s), 0);
    build_chain(bench, hm2_bspi_port(bench->board, 0), chain);
    *chain->cpld = enabled ? 0xA01 : 0xA00;
    *chain->dac = 0x10000F; /* power */
    for (unsigned i = 0; i < 5; i++)
        sim_bench_cycle(bench);
    return bench;
}

static void free_bench(struct sim_bench *bench, struct sim_7i65 *servo)
{
    sim_7i65_free(servo);
    sim_bench_free(bench);
}

static int64_t turned(const struct sim_bench *bench)
{
    int64_t position = 0;
    assert_int_equal(sim_card_turned(bench->card, HM2_GTAG_ENCODER, 3, &position), 0);
    return position;
}

static int32_t count_of(const struct sim_bench *bench)
{
    int err;
    const double count = hm2_plain_get(bench->plain, "hm2_7i80.0.encoder.03.count", &err);
    assert_int_equal(err, 0);
    return (int32_t)count;
}

static void a_loop_closes_over_an_analog_output_and_a_multiplexed_encoder(void **state)
{
    (void)state;
    struct sim_7i65 *servo;
    struct chain chain;
    struct sim_bench *const bench = with_motor(&servo, &chain, 0.01, true);
    for (unsigned i = 0; i < 1000; i++) {
        sim_bench_cycle(bench);
        *chain.dac = dac_word((POSITION - count_of(bench)) * 25.0 / COUNTS_PER_S);
    }
    /* One step of the DAC is 3 counts a second: it stands still within one count. */
    if (llabs(turned(bench) - POSITION) > 1 || count_of(bench) != (int32_t)turned(bench))
        fail_msg("at %lld, counted %d, expected %d", (long long)turned(bench), (int)count_of(bench), POSITION);
    free_bench(bench, servo);
}

static void a_motor_that_is_not_enabled_stands(void **state)
{
    (void)state;
    struct sim_7i65 *servo;
    struct chain chain;
    struct sim_bench *const bench = with_motor(&servo, &chain, 0, false);
    *chain.dac = dac_word(1.0);
    for (unsigned i = 0; i < 100; i++)
        sim_bench_cycle(bench);
    assert_true(sim_7i65_output_volts(servo, 0) > 9.9);
    assert_int_equal(turned(bench), 0);
    *chain.cpld = 0xA01;
    for (unsigned i = 0; i < 101; i++)
        sim_bench_cycle(bench);
    assert_true(llabs(turned(bench) - COUNTS_PER_S / 10) < COUNTS_PER_S / 500);
    const int64_t there = turned(bench);
    *chain.dac = dac_word(-1.0);
    for (unsigned i = 0; i < 101; i++)
        sim_bench_cycle(bench);
    assert_true(llabs(turned(bench) - there + COUNTS_PER_S / 10) < COUNTS_PER_S / 500);
    free_bench(bench, servo);
}

static void a_motor_needs_a_channel_an_encoder_and_a_possible_time(void **state)
{
    (void)state;
    struct sim_7i65 *servo;
    struct chain chain;
    struct sim_bench *const bench = with_motor(&servo, &chain, 0, false);
    assert_int_equal(sim_7i65_motor(servo, 0, 4, 1, 0), HM2_ERR_NOTFOUND); /* has one */
    assert_int_equal(sim_7i65_motor(servo, SIM_7I65_CHANNELS, 4, 1, 0), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_7i65_motor(servo, 1, 99, 1, 0), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_7i65_motor(servo, 1, 4, 1, -1), HM2_ERR_RANGE);
    assert_int_equal(sim_7i65_motor(servo, 1, 4, 1, 1e9), HM2_ERR_RANGE);
    assert_int_equal(sim_7i65_motor(servo, 1, 4, 1, 0), 0);
    free_bench(bench, servo);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_analog_loop_closes_on_a_simulated_axis),
        cmocka_unit_test(a_loop_closes_over_an_analog_output_and_a_multiplexed_encoder),
        cmocka_unit_test(a_motor_that_is_not_enabled_stands),
        cmocka_unit_test(a_motor_needs_a_channel_an_encoder_and_a_possible_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
