/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The kinds of trace folders: what each one was recorded from and what the names in its events mean. A further kind
 * is one row here. Addresses are those of the old map (register map 2.2), which the recorded firmware has; each
 * folder's README gives them too.
 */
#include <stdio.h>
#include <string.h>

#include "replay_trace.h"

/* ---- encoder ------------------------------------------------------------------------------------------------------
 */

static const struct replay_register encoder_registers[] = {
    {"count", 0x3000, 4},     {"control", 0x3100, 4},    {"tsdiv", 0x3200, 0},
    {"timestamp", 0x3300, 0}, {"filterrate", 0x3400, 0}, {NULL, 0, 0},
};

static const struct replay_signal encoder_signals[] = {
    {"A", REPLAY_INPUT, HM2_GTAG_ENCODER, 0x01, 0},     {"B", REPLAY_INPUT, HM2_GTAG_ENCODER, 0x02, 0},
    {"index", REPLAY_INPUT, HM2_GTAG_ENCODER, 0x03, 0}, {"mask", REPLAY_INPUT, HM2_GTAG_ENCODER, 0x04, 0},
    {"probe", REPLAY_INPUT, HM2_GTAG_ENCODER, 0x05, 0}, {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- encoder_muxed ------------------------------------------------------------------------------------------------
 */

static const struct replay_register muxed_registers[] = {
    {"count", 0x3500, 4},     {"control", 0x3600, 4},    {"tsdiv", 0x3700, 0},
    {"timestamp", 0x3800, 0}, {"filterrate", 0x3900, 0}, {NULL, 0, 0},
};

/* Inputs are those of an encoder behind a multiplexer without delay, as the recording bench had it. */
static const struct replay_signal muxed_signals[] = {
    {"A", REPLAY_INPUT, HM2_GTAG_MUXED_ENCODER, 0x41, 0},
    {"B", REPLAY_INPUT, HM2_GTAG_MUXED_ENCODER, 0x42, 0},
    {"index", REPLAY_INPUT, HM2_GTAG_MUXED_ENCODER, 0x43, 0},
    {"mask", REPLAY_INPUT, HM2_GTAG_MUXED_ENCODER, 0x04, 0},
    {"select", REPLAY_OUTPUT, HM2_GTAG_MUXED_ENCODER_SEL, 0x81, 0},
    {"select1", REPLAY_OUTPUT, HM2_GTAG_MUXED_ENCODER_SEL, 0x82, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- pwmgen --------------------------------------------------------------------------------------------------------
 */

static const struct replay_register pwmgen_registers[] = {
    {"value", 0x4000, 4},   {"mode", 0x4100, 4},   {"pwmrate", 0x4200, 0},
    {"pdmrate", 0x4300, 0}, {"enable", 0x4400, 0}, {NULL, 0, 0},
};

static const struct replay_signal pwmgen_signals[] = {
    {"A", REPLAY_OUTPUT, HM2_GTAG_PWMGEN, 0x81, 0},
    {"B", REPLAY_OUTPUT, HM2_GTAG_PWMGEN, 0x82, 0},
    {"ena", REPLAY_OUTPUT, HM2_GTAG_PWMGEN, 0x83, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- stepgen -------------------------------------------------------------------------------------------------------
 */

static const struct replay_register stepgen_registers[] = {
    {"rate", 0x2000, 4},      {"accum", 0x2100, 4},   {"mode", 0x2200, 4},
    {"dirsetup", 0x2300, 4},  {"dirhold", 0x2400, 4}, {"steplen", 0x2500, 4},
    {"stepspace", 0x2600, 4}, {"table", 0x2700, 4},   {"tablemax", 0x2800, 4},
    {"basicrate", 0x2900, 0}, {NULL, 0, 0},
};

static const struct replay_signal stepgen_signals[] = {
    {"step", REPLAY_OUTPUT, HM2_GTAG_STEPGEN, 0x81, 0},
    {"dir", REPLAY_OUTPUT, HM2_GTAG_STEPGEN, 0x82, 0},
    {"out2", REPLAY_OUTPUT, HM2_GTAG_STEPGEN, 0x83, 0},
    {"out3", REPLAY_OUTPUT, HM2_GTAG_STEPGEN, 0x84, 0},
    {"out4", REPLAY_OUTPUT, HM2_GTAG_STEPGEN, 0x85, 0},
    {"out5", REPLAY_OUTPUT, HM2_GTAG_STEPGEN, 0x86, 0},
    {"index", REPLAY_INPUT, HM2_GTAG_STEPGEN, 0x01, 0},
    {"probe", REPLAY_INPUT, HM2_GTAG_STEPGEN, 0x02, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- watchdog, ioport ----------------------------------------------------------------------------------------------
 */

static const struct replay_register watchdog_registers[] = {
    {"steprate", 0x2000, 4},
    {"stepaccum", 0x2100, 4},
    {"stepbasicrate", 0x2900, 0},
    {NULL, 0, 0},
};

static const struct replay_vector pad_vectors[] = {
    {"pins", NULL, 48, false},
    {NULL, NULL, 0, false},
};

static const struct replay_signal led_outputs[] = {
    {"led0", REPLAY_OUTPUT, HM2_GTAG_LED, 0x81, 0},
    {"led1", REPLAY_OUTPUT, HM2_GTAG_LED, 0x81, 1},
    {"led2", REPLAY_OUTPUT, HM2_GTAG_LED, 0x81, 2},
    {"led3", REPLAY_OUTPUT, HM2_GTAG_LED, 0x81, 3},
};

#define IOPORT_PORTS 2 /* of SVST4_4_48 */
#define IOPORT_WIDTH 24u

/* A test whose description says that pins are driven from outside does not list how: what the port then reads on pins
 * that the card does not drive is what was there. The other tests have pull-ups. */
static int ioport_stimulus(struct replay_run *const run, const struct replay_event *const event)
{
    char value_text[16];
    uint32_t value = 0, floating = 0;
    int64_t port = 0;
    if (!strstr(run->test->description, "driven from outside") || event->kind != 'R' ||
        strncmp(event->name, "port", 4) != 0 || replay_decimal(event->name + 4, IOPORT_PORTS - 1, &port))
        return 0;
    const size_t len = strcspn(event->value, "/");
    snprintf(value_text, sizeof(value_text), "%.*s", (int)(len < 12 ? len : 12), event->value);
    if (replay_hex32(value_text, &value) || (event->value[len] && replay_hex32(event->value + len + 1, &floating)))
        return 0; /* the read will say so */
    const int64_t before = replay_clk(run, event->at) - 1;
    sim_card_advance(run->card, before);
    for (unsigned bit = 0; bit < IOPORT_WIDTH; bit++) {
        const unsigned io = (unsigned)port * IOPORT_WIDTH + bit;
        const enum sim_level level = floating >> bit & 1u ? SIM_FLOAT : value >> bit & 1u ? SIM_HIGH : SIM_LOW;
        if (sim_card_pad(run->card, io) == SIM_FLOAT && sim_card_drive(run->card, before, io, level))
            return HM2_ERR_STATE;
    }
    return 0;
}

static const struct replay_vector ioport_vectors[] = {
    {"pins", NULL, 48, false},
    {"leds", led_outputs, 4, false},
    {NULL, NULL, 0, false},
};

/* ---- hm2dpll -------------------------------------------------------------------------------------------------------
 */

static const struct replay_register hm2dpll_registers[] = {
    {"baserate", 0x7000, 0}, {"phase", 0x7100, 0},
    {"control0", 0x7200, 0}, {"control1", 0x7300, 0},
    {"sync", 0x7600, 0},     {"timers12", 0x7400, 0},
    {"timers34", 0x7500, 0}, {"irqstatus", 0x0A00, 0},
    {"irqclear", 0x0B00, 0}, {NULL, 0, 0},
};

/* Left to right as recorded: the reference first. (The folder's README says otherwise; in trace timers each output
 * changes when only the timer named here can.) */
static const struct replay_signal hm2dpll_rates[] = {
    {"ref", REPLAY_OUTPUT, HM2_GTAG_DPLL, 0x82, 0},    {"timer1", REPLAY_OUTPUT, HM2_GTAG_DPLL, 0x83, 0},
    {"timer2", REPLAY_OUTPUT, HM2_GTAG_DPLL, 0x84, 0}, {"timer3", REPLAY_OUTPUT, HM2_GTAG_DPLL, 0x85, 0},
    {"timer4", REPLAY_OUTPUT, HM2_GTAG_DPLL, 0x86, 0},
};

static const struct replay_signal hm2dpll_int[] = {
    {"int", REPLAY_OUTPUT, HM2_GTAG_IRQ, 0x81, 0},
};

static const struct replay_vector hm2dpll_vectors[] = {
    {"rates", hm2dpll_rates, 5, false},
    {"int", hm2dpll_int, 1, false},
    {NULL, NULL, 0, false},
};

/* ---- bspi, dbspi, spi ----------------------------------------------------------------------------------------------
 */

static const struct replay_register bspi_registers[] = {
    {"fifo", 0x5400, 4},
    {"descr", 0x5500, 0},
    {"count", 0x5600, 0},
    {NULL, 0, 0},
};

static const struct replay_signal bspi_signals[] = {
    {"frame", REPLAY_OUTPUT, HM2_GTAG_BSPI, 0x81, 0}, {"mosi", REPLAY_OUTPUT, HM2_GTAG_BSPI, 0x82, 0},
    {"sclk", REPLAY_OUTPUT, HM2_GTAG_BSPI, 0x83, 0},  {"miso", REPLAY_INPUT, HM2_GTAG_BSPI, 0x04, 0},
    {"cs0", REPLAY_OUTPUT, HM2_GTAG_BSPI, 0x85, 0},   {"cs1", REPLAY_OUTPUT, HM2_GTAG_BSPI, 0x86, 0},
    {"cs2", REPLAY_OUTPUT, HM2_GTAG_BSPI, 0x87, 0},   {NULL, REPLAY_PAD, 0, 0, 0},
};

static const struct replay_register dbspi_registers[] = {
    {"fifo0_1", 0x5740, 0}, {"count_1", 0x5904, 0}, {"fifo", 0x5700, 4},
    {"descr", 0x5800, 0},   {"count", 0x5900, 0},   {NULL, 0, 0},
};

static const struct replay_signal dbspi_signals[] = {
    {"mosi", REPLAY_OUTPUT, HM2_GTAG_DBSPI, 0x82, 0},
    {"sclk", REPLAY_OUTPUT, HM2_GTAG_DBSPI, 0x83, 0},
    {"miso", REPLAY_INPUT, HM2_GTAG_DBSPI, 0x04, 0},
    {"cs0", REPLAY_OUTPUT, HM2_GTAG_DBSPI, 0x85, 0},
    {"cs1", REPLAY_OUTPUT, HM2_GTAG_DBSPI, 0x86, 0},
    {"cs2", REPLAY_OUTPUT, HM2_GTAG_DBSPI, 0x87, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

static const struct replay_register spi_registers[] = {
    {"data", 0x5000, 4},
    {"mode", 0x5100, 4},
    {"rate", 0x5200, 4},
    {NULL, 0, 0},
};

static const struct replay_signal spi_signals[] = {
    {"frame", REPLAY_OUTPUT, HM2_GTAG_SPI, 0x81, 0},
    {"mosi", REPLAY_OUTPUT, HM2_GTAG_SPI, 0x82, 0},
    {"sclk", REPLAY_OUTPUT, HM2_GTAG_SPI, 0x83, 0},
    {"miso", REPLAY_INPUT, HM2_GTAG_SPI, 0x04, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- uart, pktuart -------------------------------------------------------------------------------------------------
 */

static const struct replay_register uart_registers[] = {
    {"txdata1", 0x6000, 0}, {"txdata2", 0x6004, 0}, {"txdata3", 0x6008, 0}, {"txdata4", 0x600C, 0},
    {"txcount", 0x6100, 0}, {"txrate", 0x6200, 0},  {"txmode", 0x6300, 0},  {"rxdata1", 0x6400, 0},
    {"rxdata2", 0x6404, 0}, {"rxdata3", 0x6408, 0}, {"rxdata4", 0x640C, 0}, {"rxcount", 0x6500, 0},
    {"rxrate", 0x6600, 0},  {"rxmode", 0x6700, 0},  {NULL, 0, 0},
};

static const struct replay_signal uart_signals[] = {
    {"tx", REPLAY_OUTPUT, HM2_GTAG_UART_TX, 0x81, 0},
    {"txen", REPLAY_OUTPUT, HM2_GTAG_UART_TX, 0x82, 0},
    {"rx", REPLAY_INPUT, HM2_GTAG_UART_RX, 0x01, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

static const struct replay_register pktuart_registers[] = {
    {"txdata", 0x6000, 4},  {"txcount", 0x6100, 4}, {"txrate", 0x6200, 4}, {"txmode", 0x6300, 4}, {"rxdata", 0x6400, 4},
    {"rxcount", 0x6500, 4}, {"rxrate", 0x6600, 4},  {"rxmode", 0x6700, 4}, {NULL, 0, 0},
};

static const struct replay_signal pktuart_signals[] = {
    {"tx", REPLAY_OUTPUT, HM2_GTAG_PKTUART_TX, 0x81, 0},
    {"txen", REPLAY_OUTPUT, HM2_GTAG_PKTUART_TX, 0x82, 0},
    {"rx", REPLAY_INPUT, HM2_GTAG_PKTUART_RX, 0x01, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- absolute encoders ---------------------------------------------------------------------------------------------
 */

#define DPLL_REGISTERS                                          \
    {"dpll_baserate", 0x7000, 0}, {"dpll_control0", 0x7200, 0}, \
    {                                                           \
        "dpll_timers12", 0x7400, 0                              \
    }

static const struct replay_register ssi_registers[] = {
    {"data0", 0x6800, 4},     {"data1", 0x6900, 4},  {"control", 0x6A00, 4}, {"data0_1", 0x6804, 0},
    {"control_1", 0x6A04, 0}, {"global", 0x6B00, 0}, DPLL_REGISTERS,         {NULL, 0, 0},
};

static const struct replay_signal ssi_signals[] = {
    {"clkout", REPLAY_OUTPUT, HM2_GTAG_SSI, 0x81, 0},
    {"clkout_1", REPLAY_OUTPUT, HM2_GTAG_SSI, 0x81, 1},
    {"clken", REPLAY_OUTPUT, HM2_GTAG_SSI, 0x82, 0},
    {"data", REPLAY_INPUT, HM2_GTAG_SSI, 0x03, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

static const struct replay_register biss_registers[] = {
    {"data", 0x4900, 4},   {"control0", 0x4A00, 4}, {"control1", 0x4B00, 4},
    {"global", 0x4C00, 0}, DPLL_REGISTERS,          {NULL, 0, 0},
};

static const struct replay_signal biss_signals[] = {
    {"clkout", REPLAY_OUTPUT, HM2_GTAG_BISS, 0x81, 0},
    {"clken", REPLAY_OUTPUT, HM2_GTAG_BISS, 0x82, 0},
    {"dav", REPLAY_OUTPUT, HM2_GTAG_BISS, 0x84, 0},
    {"data", REPLAY_INPUT, HM2_GTAG_BISS, 0x03, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

static const struct replay_register fabs_registers[] = {
    {"data0", 0x1500, 4},    {"data1", 0x1600, 4},  {"data2", 0x1700, 4}, {"control0", 0x1800, 4},
    {"control1", 0x1900, 4}, {"global", 0x1A00, 0}, DPLL_REGISTERS,       {NULL, 0, 0},
};

static const struct replay_signal fabs_signals[] = {
    {"request", REPLAY_OUTPUT, HM2_GTAG_FABS, 0x81, 0},
    {"rqen", REPLAY_OUTPUT, HM2_GTAG_FABS, 0x82, 0},
    {"data", REPLAY_INPUT, HM2_GTAG_FABS, 0x03, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- sslbp --------------------------------------------------------------------------------------------------------
 */

static const struct replay_register sslbp_registers[] = {
    {"command", 0x5A00, 0}, {"data", 0x5B00, 0},   {"cs", 0x5C00, 4}, {"user0_", 0x5D00, 4},
    {"user1_", 0x5E00, 4},  {"user2_", 0x5F00, 4}, {NULL, 0, 0},
};

/* ---- tppwm ---------------------------------------------------------------------------------------------------------
 */

static const struct replay_register tppwm_registers[] = {
    {"value", 0x4500, 4}, {"enable", 0x4600, 4}, {"setup", 0x4700, 4},
    {"rate", 0x4800, 0},  {"rate_1", 0x4804, 0}, {NULL, 0, 0},
};

static const struct replay_signal tppwm_signals[] = {
    {"A", REPLAY_OUTPUT, HM2_GTAG_TPPWM, 0x81, 0},
    {"B", REPLAY_OUTPUT, HM2_GTAG_TPPWM, 0x82, 0},
    {"C", REPLAY_OUTPUT, HM2_GTAG_TPPWM, 0x83, 0},
    {"NA", REPLAY_OUTPUT, HM2_GTAG_TPPWM, 0x84, 0},
    {"NB", REPLAY_OUTPUT, HM2_GTAG_TPPWM, 0x85, 0},
    {"NC", REPLAY_OUTPUT, HM2_GTAG_TPPWM, 0x86, 0},
    {"ena", REPLAY_OUTPUT, HM2_GTAG_TPPWM, 0x87, 0},
    {"fault", REPLAY_INPUT, HM2_GTAG_TPPWM, 0x08, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- wavegen -------------------------------------------------------------------------------------------------------
 */

static const struct replay_register wavegen_registers[] = {
    {"rate", 0x2A00, 4},     {"pdmrate", 0x2B00, 4},   {"length", 0x2C00, 4},
    {"tableptr", 0x2D00, 4}, {"tabledata", 0x2E00, 4}, {NULL, 0, 0},
};

static const struct replay_signal wavegen_signals[] = {
    {"pdma", REPLAY_OUTPUT, HM2_GTAG_WAVEGEN, 0x81, 0},
    {"pdmb", REPLAY_OUTPUT, HM2_GTAG_WAVEGEN, 0x82, 0},
    {"trig0", REPLAY_OUTPUT, HM2_GTAG_WAVEGEN, 0x83, 0},
    {"trig1", REPLAY_OUTPUT, HM2_GTAG_WAVEGEN, 0x84, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- resolver ------------------------------------------------------------------------------------------------------
 */

static const struct replay_register resolver_registers[] = {
    {"command", 0x3A00, 0}, {"data", 0x3B00, 0}, {"status", 0x3C00, 0},
    {"vel", 0x3D00, 4},     {"pos", 0x3E00, 4},  {NULL, 0, 0},
};

static const struct replay_signal resolver_signals[] = {
    {"pwren", REPLAY_OUTPUT, HM2_GTAG_RESOLVER, 0x81, 0},
    {NULL, REPLAY_PAD, 0, 0, 0},
};

/* ---- before a test
 * ---------------------------------------------------------------------------------------------------- */

/* The bench of the counter recordings held its inputs low; a pad left alone would be pulled up. */
static int inputs_low(struct replay_run *const run)
{
    for (const struct replay_signal *s = run->kind->signals; s->name; s++) {
        for (unsigned unit = 0; s->kind == REPLAY_INPUT && unit < 8; unit++) {
            const int err = sim_card_drive_input(run->card, -1, s->gtag, unit, s->secondary_pin, SIM_LOW);
            if (err)
                return err;
        }
    }
    return 0;
}

/* ---- the kinds -----------------------------------------------------------------------------------------------------
 */

const struct replay_kind replay_kinds[] = {
    {.folder = "stepgen",
     .firmware = "SVST4_4_48",
     .profile = "7i93",
     .registers = stepgen_registers,
     .signals = stepgen_signals},
    {.folder = "stepgen_v3",
     .firmware = "SVST8_4IM2SI_72",
     .profile = "7i93",
     .registers = stepgen_registers,
     .signals = stepgen_signals},
    {.folder = "encoder",
     .firmware = "SVST8_4IM2_72",
     .profile = "7i93",
     .registers = encoder_registers,
     .signals = encoder_signals,
     .prepare = inputs_low},
    {.folder = "encoder_muxed",
     .firmware = "SV6_7I48_48",
     .profile = "7i93",
     .registers = muxed_registers,
     .signals = muxed_signals,
     .prepare = inputs_low,
     .make_inputs = replay_muxed_inputs,
     .edges_end_early = true},
    {.folder = "pwmgen",
     .firmware = "SVST8_4IM2_72",
     .profile = "7i93",
     .registers = pwmgen_registers,
     .signals = pwmgen_signals,
     .extra = replay_pwm_measure},
    {.folder = "watchdog",
     .firmware = "SVST4_4_48",
     .profile = "7i93",
     .registers = watchdog_registers,
     .vectors = pad_vectors},
    {.folder = "ioport",
     .firmware = "SVST4_4_48",
     .profile = "7i93",
     .vectors = ioport_vectors,
     .before_event = ioport_stimulus,
     .extra = replay_pin_truth},
    {.folder = "hm2dpll",
     .firmware = "7I76E_51",
     .profile = "7i93",
     .registers = hm2dpll_registers,
     .vectors = hm2dpll_vectors},
    {.folder = "sslbp",
     .firmware = "7I76E_51",
     .profile = "7i93",
     .registers = sslbp_registers,
     .prepare = replay_sslbp_prepare,
     .before_event = replay_sslbp_event,
     .make_inputs = replay_sslbp_polls},
    {.folder = "bspi",
     .firmware = "2X7I65_72",
     .profile = "7i80hd-16",
     .registers = bspi_registers,
     .signals = bspi_signals,
     .prepare = replay_spi_prepare,
     .before_event = replay_spi_word,
     .on_edge = replay_spi_edge,
     .loop_gtag = HM2_GTAG_BSPI},
    {.folder = "dbspi",
     .firmware = "SVSPD6_2_48",
     .profile = "7i93",
     .registers = dbspi_registers,
     .signals = dbspi_signals,
     .prepare = replay_spi_prepare,
     .before_event = replay_spi_word,
     .on_edge = replay_spi_edge,
     .loop_gtag = HM2_GTAG_DBSPI},
    {.folder = "spi",
     .firmware = "SVSP4_6_7I46NA_48",
     .profile = "7i93",
     .registers = spi_registers,
     .signals = spi_signals,
     .prepare = replay_spi_prepare,
     .before_event = replay_spi_word,
     .on_edge = replay_spi_edge,
     .loop_gtag = HM2_GTAG_SPI},
    {.folder = "uart",
     .firmware = "SVUA8_8_72",
     .profile = "7i80hd-16",
     .registers = uart_registers,
     .signals = uart_signals,
     .prepare = replay_serial_prepare,
     .on_edge = replay_serial_edge,
     .loop_gtag = HM2_GTAG_UART_TX},
    {.folder = "pktuart",
     .firmware = "PKTUART_0",
     .profile = "7i80hd-16",
     .registers = pktuart_registers,
     .signals = pktuart_signals,
     .prepare = replay_serial_prepare,
     .on_edge = replay_serial_edge,
     .make_inputs = replay_serial_inputs,
     .loop_gtag = HM2_GTAG_PKTUART_TX},
    {.folder = "pktuart_new",
     .firmware = "PKTUART_1",
     .profile = "7i80hd-16",
     .registers = pktuart_registers,
     .signals = pktuart_signals,
     .prepare = replay_serial_prepare,
     .on_edge = replay_serial_edge,
     .make_inputs = replay_serial_inputs,
     .loop_gtag = HM2_GTAG_PKTUART_TX},
    {.folder = "ssi",
     .firmware = "SISS4_4_72",
     .timer_firmware = "SVSSSI6_4_4_72",
     .profile = "7i93",
     .registers = ssi_registers,
     .signals = ssi_signals,
     .prepare = replay_absolute_prepare,
     .before_event = replay_absolute_event},
    {.folder = "ssi_new",
     .firmware = "SISS4_4_72",
     .profile = "7i93",
     .sources = SIM_SOURCES_LATER,
     .registers = ssi_registers,
     .signals = ssi_signals,
     .prepare = replay_absolute_prepare,
     .before_event = replay_absolute_event},
    {.folder = "biss",
     .firmware = "BI1_72",
     .profile = "7i93",
     .registers = biss_registers,
     .signals = biss_signals,
     .prepare = replay_absolute_prepare,
     .before_event = replay_absolute_event},
    {.folder = "fabs",
     .firmware = "FA1_72",
     .profile = "7i93",
     .registers = fabs_registers,
     .signals = fabs_signals,
     .prepare = replay_absolute_prepare,
     .before_event = replay_absolute_event},
    {.folder = "tppwm",
     .firmware = "TPEN6_6_72",
     .profile = "7i93",
     .registers = tppwm_registers,
     .signals = tppwm_signals},
    {.folder = "wavegen",
     .firmware = "SVWG8_2IM2_72",
     .profile = "7i93",
     .registers = wavegen_registers,
     .signals = wavegen_signals,
     .starts = REPLAY_WAVEGEN_STARTS,
     .prepare = replay_wavegen_prepare},
    {.folder = "resolver",
     .firmware = "SVRM6_48",
     .profile = "7i93",
     .registers = resolver_registers,
     .signals = resolver_signals,
     .prepare = replay_resolver_prepare,
     .before_event = replay_resolver_event,
     .on_edge = replay_resolver_edge,
     .near = replay_resolver_near,
     .bench_output = "exc_sign",
     .extra = replay_resolver_excitation},
    {.folder = "idrom", .extra = replay_idrom, .no_events = true},
    {.folder = "tram", .firmware = "JUSTIO_72", .profile = "7i80hd-16", .extra = replay_tram, .no_events = true},
    {.folder = "lbp16", .firmware = "JUSTIO_72", .profile = "7i80hd-16", .extra = replay_lbp16, .no_events = true},
};

const unsigned replay_kind_count = sizeof(replay_kinds) / sizeof(replay_kinds[0]);
