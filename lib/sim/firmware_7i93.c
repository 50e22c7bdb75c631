/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The 7I93's configurations of its manual (seed 001): module and pin lists of the public 72-pin files
 * of these names, cut at the 48 pins of the card, with the DPLL in front and the newer address map, as the firmware
 * that ships with a DPLL has (register map 5.1, 5.2). Functions of pins that were cut off have no connector.
 */
#include "profiles.h"

enum { LOW = 1, HIGH = 2 }; /* clock tags (register map 1.4) */

#define ROWS(table) (sizeof(table) / sizeof(table)[0])
#define FIRMWARE(configuration, pin_list)                                                                           \
    {                                                                                                               \
        .board_name = "MESA7I93", .fpga_size = 9, .fpga_pins = 144, .io_ports = 2, .port_width = 24,                \
        .clock_low_hz = 100000000, .clock_high_hz = 200000000, .modules = modules_##configuration,                  \
        .module_count = ROWS(modules_##configuration), .pins = pins_##pin_list, .pin_count = ROWS(pins_##pin_list), \
    }

/* Twelve pins of a servo connector: two axes, each with an encoder and a PWM generator. */
#define AXES(n, m)                                                                             \
    {HM2_GTAG_ENCODER, m, 0x02}, {HM2_GTAG_ENCODER, m, 0x01}, {HM2_GTAG_ENCODER, n, 0x02},     \
        {HM2_GTAG_ENCODER, n, 0x01}, {HM2_GTAG_ENCODER, m, 0x03}, {HM2_GTAG_ENCODER, n, 0x03}, \
        {HM2_GTAG_PWMGEN, m, 0x81}, {HM2_GTAG_PWMGEN, n, 0x81}, {HM2_GTAG_PWMGEN, m, 0x82},    \
        {HM2_GTAG_PWMGEN, n, 0x82}, {HM2_GTAG_PWMGEN, m, 0x83},                                \
    {                                                                                          \
        HM2_GTAG_PWMGEN, n, 0x83                                                               \
    }
#define STEPGEN(n)                                                                         \
    {HM2_GTAG_STEPGEN, n, 0x81}, {HM2_GTAG_STEPGEN, n, 0x82}, {HM2_GTAG_STEPGEN, n, 0x83}, \
        {HM2_GTAG_STEPGEN, n, 0x84}, {HM2_GTAG_STEPGEN, n, 0x85},                          \
    {                                                                                      \
        HM2_GTAG_STEPGEN, n, 0x86                                                          \
    }

/* Register map 5.2: SVST4_8. */
static const struct sim_module_row modules_svst4_8[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 2, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_ENCODER, 0x02, LOW, 4, 0x3000, 5, 0x00, 0x00000003},
    {HM2_GTAG_PWMGEN, 0x00, HIGH, 4, 0x4100, 5, 0x00, 0x00000003},
    {HM2_GTAG_STEPGEN, 0x02, LOW, 8, 0x2000, 10, 0x00, 0x000001FF},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_pin_row pins_svst4_8[] = {
    AXES(0, 1), AXES(2, 3), STEPGEN(0), STEPGEN(1), STEPGEN(2), STEPGEN(3),
};

const struct sim_firmware sim_firmware_7i93_svst4_8 = FIRMWARE(svst4_8, svst4_8);

/* Register map 5.2: SVST8_8IM2. */
static const struct sim_module_row modules_svst8_8im2[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 2, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_ENCODER, 0x02, LOW, 8, 0x3000, 5, 0x00, 0x00000003},
    {HM2_GTAG_PWMGEN, 0x00, HIGH, 8, 0x4100, 5, 0x00, 0x00000003},
    {HM2_GTAG_STEPGEN, 0x02, LOW, 8, 0x2000, 10, 0x00, 0x000001FF},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_pin_row pins_svst8_8im2[] = {AXES(0, 1), AXES(2, 3), AXES(4, 5), AXES(6, 7)};

const struct sim_firmware sim_firmware_7i93_svst8_8im2 = FIRMWARE(svst8_8im2, svst8_8im2);

/* Register map 5.2.1: SVST8_4IM2; its four step generators lie behind the cut. */
static const struct sim_module_row modules_svst8_4im2[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 2, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_ENCODER, 0x02, LOW, 8, 0x3000, 5, 0x00, 0x00000003},
    {HM2_GTAG_PWMGEN, 0x00, HIGH, 8, 0x4100, 5, 0x00, 0x00000003},
    {HM2_GTAG_STEPGEN, 0x02, LOW, 4, 0x2000, 10, 0x00, 0x000001FF},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

const struct sim_firmware sim_firmware_7i93_svst8_4im2 = FIRMWARE(svst8_4im2, svst8_8im2);

/* Register map 5.2: SVST1_4_7I47S. */
static const struct sim_module_row modules_svst1_4_7i47s[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 2, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_ENCODER, 0x02, LOW, 4, 0x3000, 5, 0x00, 0x00000003},
    {HM2_GTAG_PWMGEN, 0x00, HIGH, 1, 0x4100, 5, 0x00, 0x00000003},
    {HM2_GTAG_STEPGEN, 0x02, LOW, 4, 0x2000, 10, 0x00, 0x000001FF},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_pin_row pins_svst1_4_7i47s[] = {
    {HM2_GTAG_STEPGEN, 0, 0x81}, {HM2_GTAG_STEPGEN, 0, 0x82}, {HM2_GTAG_STEPGEN, 1, 0x81}, {HM2_GTAG_STEPGEN, 1, 0x82},
    {HM2_GTAG_ENCODER, 0, 0x01}, {HM2_GTAG_ENCODER, 2, 0x01}, {HM2_GTAG_ENCODER, 0, 0x02}, {HM2_GTAG_ENCODER, 2, 0x02},
    {HM2_GTAG_ENCODER, 0, 0x03}, {HM2_GTAG_ENCODER, 2, 0x03}, {HM2_GTAG_ENCODER, 1, 0x01}, {HM2_GTAG_ENCODER, 3, 0x01},
    {HM2_GTAG_ENCODER, 1, 0x02}, {HM2_GTAG_ENCODER, 3, 0x02}, {HM2_GTAG_ENCODER, 1, 0x03}, {HM2_GTAG_ENCODER, 3, 0x03},
    {HM2_GTAG_NONE, 0, 0x00},    {HM2_GTAG_PWMGEN, 0, 0x82},  {HM2_GTAG_PWMGEN, 0, 0x83},  {HM2_GTAG_PWMGEN, 0, 0x81},
    {HM2_GTAG_STEPGEN, 2, 0x81}, {HM2_GTAG_STEPGEN, 2, 0x82}, {HM2_GTAG_STEPGEN, 3, 0x81}, {HM2_GTAG_STEPGEN, 3, 0x82},
};

const struct sim_firmware sim_firmware_7i93_svst1_4_7i47s = FIRMWARE(svst1_4_7i47s, svst1_4_7i47s);

/* Register map 5.2: 2X7I65. */
static const struct sim_module_row modules_2x7i65[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 2, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_MUXED_ENCODER, 0x03, LOW, 16, 0x3600, 5, 0x00, 0x00000003},
    {HM2_GTAG_MUXED_ENCODER_SEL, 0x00, LOW, 1, 0x0000, 0, 0x00, 0x00000000},
    {HM2_GTAG_BSPI, 0x00, LOW, 2, 0x5500, 3, 0x11, 0x00000007},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_pin_row pins_2x7i65[] = {
    {HM2_GTAG_MUXED_ENCODER, 0, 0x01}, {HM2_GTAG_MUXED_ENCODER, 0, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 0, 0x03}, {HM2_GTAG_MUXED_ENCODER, 1, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 1, 0x02}, {HM2_GTAG_MUXED_ENCODER, 1, 0x03},
    {HM2_GTAG_MUXED_ENCODER, 2, 0x01}, {HM2_GTAG_MUXED_ENCODER, 2, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 2, 0x03}, {HM2_GTAG_MUXED_ENCODER, 3, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 3, 0x02}, {HM2_GTAG_MUXED_ENCODER, 3, 0x03},
    {HM2_GTAG_NONE, 0, 0x00},          {HM2_GTAG_MUXED_ENCODER_SEL, 0, 0x81},
    {HM2_GTAG_BSPI, 0, 0x81},          {HM2_GTAG_BSPI, 0, 0x82},
    {HM2_GTAG_BSPI, 0, 0x83},          {HM2_GTAG_BSPI, 0, 0x04},
    {HM2_GTAG_BSPI, 0, 0x87},          {HM2_GTAG_BSPI, 0, 0x86},
    {HM2_GTAG_BSPI, 0, 0x85},          {HM2_GTAG_NONE, 0, 0x00},
    {HM2_GTAG_NONE, 0, 0x00},          {HM2_GTAG_NONE, 0, 0x00},
    {HM2_GTAG_MUXED_ENCODER, 4, 0x01}, {HM2_GTAG_MUXED_ENCODER, 4, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 4, 0x03}, {HM2_GTAG_MUXED_ENCODER, 5, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 5, 0x02}, {HM2_GTAG_MUXED_ENCODER, 5, 0x03},
    {HM2_GTAG_MUXED_ENCODER, 6, 0x01}, {HM2_GTAG_MUXED_ENCODER, 6, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 6, 0x03}, {HM2_GTAG_MUXED_ENCODER, 7, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 7, 0x02}, {HM2_GTAG_MUXED_ENCODER, 7, 0x03},
    {HM2_GTAG_NONE, 0, 0x00},          {HM2_GTAG_MUXED_ENCODER_SEL, 8, 0x81},
    {HM2_GTAG_BSPI, 1, 0x81},          {HM2_GTAG_BSPI, 1, 0x82},
    {HM2_GTAG_BSPI, 1, 0x83},          {HM2_GTAG_BSPI, 1, 0x04},
    {HM2_GTAG_BSPI, 1, 0x87},          {HM2_GTAG_BSPI, 1, 0x86},
    {HM2_GTAG_BSPI, 1, 0x85},
};

const struct sim_firmware sim_firmware_7i93_2x7i65 = FIRMWARE(2x7i65, 2x7i65);

/* Register map 5.2: SV12IM_2X7I48. */
static const struct sim_module_row modules_sv12im_2x7i48[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 2, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_MUXED_ENCODER, 0x03, LOW, 12, 0x3600, 5, 0x00, 0x00000003},
    {HM2_GTAG_MUXED_ENCODER_SEL, 0x00, LOW, 1, 0x0000, 0, 0x00, 0x00000000},
    {HM2_GTAG_PWMGEN, 0x00, HIGH, 12, 0x4100, 5, 0x00, 0x00000003},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_pin_row pins_sv12im_2x7i48[] = {
    {HM2_GTAG_PWMGEN, 0, 0x83},
    {HM2_GTAG_MUXED_ENCODER, 0, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 0, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 0, 0x03},
    {HM2_GTAG_MUXED_ENCODER, 1, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 1, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 1, 0x03},
    {HM2_GTAG_MUXED_ENCODER, 2, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 2, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 2, 0x03},
    {HM2_GTAG_MUXED_ENCODER_SEL, 0, 0x81},
    {HM2_GTAG_PWMGEN, 0, 0x81},
    {HM2_GTAG_PWMGEN, 0, 0x82},
    {HM2_GTAG_PWMGEN, 1, 0x81},
    {HM2_GTAG_PWMGEN, 1, 0x82},
    {HM2_GTAG_PWMGEN, 2, 0x81},
    {HM2_GTAG_PWMGEN, 2, 0x82},
    {HM2_GTAG_PWMGEN, 3, 0x81},
    {HM2_GTAG_PWMGEN, 3, 0x82},
    {HM2_GTAG_PWMGEN, 4, 0x81},
    {HM2_GTAG_PWMGEN, 4, 0x82},
    {HM2_GTAG_PWMGEN, 5, 0x81},
    {HM2_GTAG_PWMGEN, 5, 0x82},
    {HM2_GTAG_PWMGEN, 0, 0x83},
    {HM2_GTAG_PWMGEN, 6, 0x83},
    {HM2_GTAG_MUXED_ENCODER, 3, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 3, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 3, 0x03},
    {HM2_GTAG_MUXED_ENCODER, 4, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 4, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 4, 0x03},
    {HM2_GTAG_MUXED_ENCODER, 5, 0x01},
    {HM2_GTAG_MUXED_ENCODER, 5, 0x02},
    {HM2_GTAG_MUXED_ENCODER, 5, 0x03},
    {HM2_GTAG_MUXED_ENCODER_SEL, 6, 0x81},
    {HM2_GTAG_PWMGEN, 6, 0x81},
    {HM2_GTAG_PWMGEN, 6, 0x82},
    {HM2_GTAG_PWMGEN, 7, 0x81},
    {HM2_GTAG_PWMGEN, 7, 0x82},
    {HM2_GTAG_PWMGEN, 8, 0x81},
    {HM2_GTAG_PWMGEN, 8, 0x82},
    {HM2_GTAG_PWMGEN, 9, 0x81},
    {HM2_GTAG_PWMGEN, 9, 0x82},
    {HM2_GTAG_PWMGEN, 10, 0x81},
    {HM2_GTAG_PWMGEN, 10, 0x82},
    {HM2_GTAG_PWMGEN, 11, 0x81},
    {HM2_GTAG_PWMGEN, 11, 0x82},
    {HM2_GTAG_PWMGEN, 6, 0x83},
};

const struct sim_firmware sim_firmware_7i93_sv12im_2x7i48 = FIRMWARE(sv12im_2x7i48, sv12im_2x7i48);

/* Register map 5.2: SV6_7I49. */
static const struct sim_module_row modules_sv6_7i49[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 2, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_RESOLVER, 0x00, LOW, 1, 0x3C00, 5, 0x00, 0x0000001F},
    {HM2_GTAG_PWMGEN, 0x00, HIGH, 6, 0x4100, 5, 0x00, 0x00000003},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_pin_row pins_sv6_7i49[] = {
    {HM2_GTAG_PWMGEN, 0, 0x83},   {HM2_GTAG_RESOLVER, 0, 0x81}, {HM2_GTAG_RESOLVER, 0, 0x09},
    {HM2_GTAG_RESOLVER, 0, 0x0A}, {HM2_GTAG_RESOLVER, 0, 0x86}, {HM2_GTAG_RESOLVER, 0, 0x85},
    {HM2_GTAG_RESOLVER, 0, 0x84}, {HM2_GTAG_RESOLVER, 0, 0x88}, {HM2_GTAG_RESOLVER, 0, 0x87},
    {HM2_GTAG_RESOLVER, 0, 0x83}, {HM2_GTAG_RESOLVER, 0, 0x82}, {HM2_GTAG_PWMGEN, 0, 0x81},
    {HM2_GTAG_PWMGEN, 0, 0x82},   {HM2_GTAG_PWMGEN, 1, 0x81},   {HM2_GTAG_PWMGEN, 1, 0x82},
    {HM2_GTAG_PWMGEN, 2, 0x81},   {HM2_GTAG_PWMGEN, 2, 0x82},   {HM2_GTAG_PWMGEN, 3, 0x81},
    {HM2_GTAG_PWMGEN, 3, 0x82},   {HM2_GTAG_PWMGEN, 4, 0x81},   {HM2_GTAG_PWMGEN, 4, 0x82},
    {HM2_GTAG_PWMGEN, 5, 0x81},   {HM2_GTAG_PWMGEN, 5, 0x82},   {HM2_GTAG_PWMGEN, 0, 0x83},
};

const struct sim_firmware sim_firmware_7i93_sv6_7i49 = FIRMWARE(sv6_7i49, sv6_7i49);
