/* SPDX-License-Identifier: GPL-2.0-or-later */
/* An analog loop over a 7I65 at a buffered SPI port: DAC, an axis, ADC, and a controller in the cycle. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(an_analog_loop_closes_on_a_simulated_axis)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
