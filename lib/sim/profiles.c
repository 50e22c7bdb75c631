/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The cards that can be simulated and their firmware, as module and pin tables (register map 5). */
#include "profiles.h"

#include <string.h>

enum { LOW = 1, HIGH = 2 }; /* clock tags (register map 1.4) */

#define ROWS(table) (sizeof(table) / sizeof(table)[0])

/* Register map 5.4: the shipping 7i96s_d. */
static const struct sim_module_row modules_7i96s[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 3, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_OUTM, 0x00, LOW, 1, 0xB000, 1, 0x00, 0x00000001},
    {HM2_GTAG_PWMGEN, 0x00, HIGH, 1, 0x4100, 5, 0x00, 0x00000003},
    {HM2_GTAG_STEPGEN, 0x02, LOW, 5, 0x2000, 10, 0x00, 0x000001FF},
    {HM2_GTAG_ENCODER, 0x02, LOW, 1, 0x3000, 5, 0x00, 0x00000003},
    {HM2_GTAG_SSERIAL, 0x00, LOW, 1, 0x5B00, 6, 0x10, 0x0000003C},
    {HM2_GTAG_SSR, 0x00, LOW, 1, 0x7D00, 2, 0x00, 0x00000003},
    {HM2_GTAG_INM, 0x00, LOW, 1, 0x8500, 5, 0x00, 0x0000001F},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_pin_row pins_7i96s[] = {
    {HM2_GTAG_INM, 0, 0x01},     {HM2_GTAG_INM, 0, 0x02},     {HM2_GTAG_INM, 0, 0x03},     {HM2_GTAG_INM, 0, 0x04},
    {HM2_GTAG_INM, 0, 0x05},     {HM2_GTAG_INM, 0, 0x06},     {HM2_GTAG_INM, 0, 0x07},     {HM2_GTAG_INM, 0, 0x08},
    {HM2_GTAG_INM, 0, 0x09},     {HM2_GTAG_INM, 0, 0x0A},     {HM2_GTAG_INM, 0, 0x0B},     {HM2_GTAG_SSR, 0, 0x81},
    {HM2_GTAG_SSR, 0, 0x82},     {HM2_GTAG_SSR, 0, 0x83},     {HM2_GTAG_SSR, 0, 0x84},     {HM2_GTAG_OUTM, 0, 0x85},
    {HM2_GTAG_OUTM, 0, 0x86},    {HM2_GTAG_STEPGEN, 0, 0x81}, {HM2_GTAG_STEPGEN, 0, 0x82}, {HM2_GTAG_STEPGEN, 1, 0x81},
    {HM2_GTAG_STEPGEN, 1, 0x82}, {HM2_GTAG_STEPGEN, 2, 0x81}, {HM2_GTAG_STEPGEN, 2, 0x82}, {HM2_GTAG_STEPGEN, 3, 0x81},
    {HM2_GTAG_STEPGEN, 3, 0x82}, {HM2_GTAG_STEPGEN, 4, 0x81}, {HM2_GTAG_STEPGEN, 4, 0x82}, {HM2_GTAG_ENCODER, 0, 0x01},
    {HM2_GTAG_ENCODER, 0, 0x02}, {HM2_GTAG_ENCODER, 0, 0x03}, {HM2_GTAG_SSERIAL, 0, 0x01}, {HM2_GTAG_SSERIAL, 0, 0x81},
    {HM2_GTAG_SSERIAL, 0, 0x91}, {HM2_GTAG_SSR, 0, 0xA0},
};

/* The spindle PWM leaves through a local pin behind the last I/O (register map 5.4, "Facts and gaps"). */
static const uint32_t local_pins_7i96s[] = {0x40000681};

static const struct sim_firmware firmware_7i96s = {
    .board_name = "MESA7I96",
    .fpga_size = 20,
    .fpga_pins = 256,
    .io_ports = 3,
    .port_width = 17,
    .clock_low_hz = 100000000,
    .clock_high_hz = 200000000,
    .modules = modules_7i96s,
    .module_count = ROWS(modules_7i96s),
    .pins = pins_7i96s,
    .pin_count = ROWS(pins_7i96s),
    .local_pins = local_pins_7i96s,
    .local_pin_count = ROWS(local_pins_7i96s),
};

/* Register map 5.5 A: the shipping 7i96s_7i77d, for a 7I77 on P1. I/O 28 is B, not a second A: the listing has a slip.
 */
static const struct sim_module_row modules_7i96s_7i77d[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 3, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_OUTM, 0x00, LOW, 1, 0xB000, 1, 0x00, 0x00000001},
    {HM2_GTAG_PWMGEN, 0x00, HIGH, 1, 0x4100, 5, 0x00, 0x00000003},
    {HM2_GTAG_STEPGEN, 0x02, LOW, 5, 0x2000, 10, 0x00, 0x000001FF},
    {HM2_GTAG_MUXED_ENCODER, 0x04, LOW, 8, 0x3600, 5, 0x00, 0x00000003},
    {HM2_GTAG_MUXED_ENCODER_SEL, 0x00, LOW, 1, 0x0000, 0, 0x00, 0x00000000},
    {HM2_GTAG_SSERIAL, 0x00, LOW, 1, 0x5B00, 6, 0x10, 0x0000003C},
    {HM2_GTAG_SSR, 0x00, LOW, 1, 0x7D00, 2, 0x00, 0x00000003},
    {HM2_GTAG_INM, 0x00, LOW, 1, 0x8500, 5, 0x00, 0x0000001F},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_pin_row pins_7i96s_7i77d[] = {
    {HM2_GTAG_INM, 0, 0x01},           {HM2_GTAG_INM, 0, 0x02},           {HM2_GTAG_INM, 0, 0x03},
    {HM2_GTAG_INM, 0, 0x04},           {HM2_GTAG_INM, 0, 0x05},           {HM2_GTAG_INM, 0, 0x06},
    {HM2_GTAG_INM, 0, 0x07},           {HM2_GTAG_INM, 0, 0x08},           {HM2_GTAG_INM, 0, 0x09},
    {HM2_GTAG_INM, 0, 0x0A},           {HM2_GTAG_INM, 0, 0x0B},           {HM2_GTAG_SSR, 0, 0x81},
    {HM2_GTAG_SSR, 0, 0x82},           {HM2_GTAG_SSR, 0, 0x83},           {HM2_GTAG_SSR, 0, 0x84},
    {HM2_GTAG_OUTM, 0, 0x85},          {HM2_GTAG_OUTM, 0, 0x86},          {HM2_GTAG_STEPGEN, 0, 0x81},
    {HM2_GTAG_STEPGEN, 0, 0x82},       {HM2_GTAG_STEPGEN, 1, 0x81},       {HM2_GTAG_STEPGEN, 1, 0x82},
    {HM2_GTAG_STEPGEN, 2, 0x81},       {HM2_GTAG_STEPGEN, 2, 0x82},       {HM2_GTAG_STEPGEN, 3, 0x81},
    {HM2_GTAG_STEPGEN, 3, 0x82},       {HM2_GTAG_STEPGEN, 4, 0x81},       {HM2_GTAG_STEPGEN, 4, 0x82},
    {HM2_GTAG_MUXED_ENCODER, 3, 0x01}, {HM2_GTAG_MUXED_ENCODER, 3, 0x02}, {HM2_GTAG_MUXED_ENCODER, 3, 0x03},
    {HM2_GTAG_SSERIAL, 0, 0x04},       {HM2_GTAG_SSERIAL, 0, 0x84},       {HM2_GTAG_SSERIAL, 0, 0x94},
    {HM2_GTAG_SSR, 0, 0xA0},           {HM2_GTAG_SSERIAL, 0, 0x93},       {HM2_GTAG_SSERIAL, 0, 0x83},
    {HM2_GTAG_SSERIAL, 0, 0x03},       {HM2_GTAG_SSERIAL, 0, 0x82},       {HM2_GTAG_SSERIAL, 0, 0x02},
    {HM2_GTAG_SSERIAL, 0, 0x81},       {HM2_GTAG_SSERIAL, 0, 0x01},       {HM2_GTAG_MUXED_ENCODER_SEL, 0, 0x81},
    {HM2_GTAG_MUXED_ENCODER, 0, 0x01}, {HM2_GTAG_MUXED_ENCODER, 0, 0x02}, {HM2_GTAG_MUXED_ENCODER, 0, 0x03},
    {HM2_GTAG_MUXED_ENCODER, 1, 0x01}, {HM2_GTAG_MUXED_ENCODER, 1, 0x02}, {HM2_GTAG_MUXED_ENCODER, 1, 0x03},
    {HM2_GTAG_MUXED_ENCODER, 2, 0x01}, {HM2_GTAG_MUXED_ENCODER, 2, 0x02}, {HM2_GTAG_MUXED_ENCODER, 2, 0x03},
};

static const struct sim_firmware firmware_7i96s_7i77d = {
    .board_name = "MESA7I96",
    .fpga_size = 20,
    .fpga_pins = 256,
    .io_ports = 3,
    .port_width = 17,
    .clock_low_hz = 100000000,
    .clock_high_hz = 200000000,
    .modules = modules_7i96s_7i77d,
    .module_count = ROWS(modules_7i96s_7i77d),
    .pins = pins_7i96s_7i77d,
    .pin_count = ROWS(pins_7i96s_7i77d),
    .local_pins = local_pins_7i96s,
    .local_pin_count = ROWS(local_pins_7i96s),
};

/* Register map 5.1 and 5.2.1: SVST8_4IM2 with the new address map and the DPLL in front, cut at 48 pins. */
static const struct sim_module_row modules_7i93[] = {
    {HM2_GTAG_DPLL, 0x00, LOW, 1, 0x7000, 7, 0x00, 0x00000000},
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 2, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_ENCODER, 0x02, LOW, 8, 0x3000, 5, 0x00, 0x00000003},
    {HM2_GTAG_PWMGEN, 0x00, HIGH, 8, 0x4100, 5, 0x00, 0x00000003},
    {HM2_GTAG_STEPGEN, 0x02, LOW, 4, 0x2000, 10, 0x00, 0x000001FF},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_pin_row pins_7i93[] = {
    {HM2_GTAG_ENCODER, 1, 0x02}, {HM2_GTAG_ENCODER, 1, 0x01}, {HM2_GTAG_ENCODER, 0, 0x02}, {HM2_GTAG_ENCODER, 0, 0x01},
    {HM2_GTAG_ENCODER, 1, 0x03}, {HM2_GTAG_ENCODER, 0, 0x03}, {HM2_GTAG_PWMGEN, 1, 0x81},  {HM2_GTAG_PWMGEN, 0, 0x81},
    {HM2_GTAG_PWMGEN, 1, 0x82},  {HM2_GTAG_PWMGEN, 0, 0x82},  {HM2_GTAG_PWMGEN, 1, 0x83},  {HM2_GTAG_PWMGEN, 0, 0x83},
    {HM2_GTAG_ENCODER, 3, 0x02}, {HM2_GTAG_ENCODER, 3, 0x01}, {HM2_GTAG_ENCODER, 2, 0x02}, {HM2_GTAG_ENCODER, 2, 0x01},
    {HM2_GTAG_ENCODER, 3, 0x03}, {HM2_GTAG_ENCODER, 2, 0x03}, {HM2_GTAG_PWMGEN, 3, 0x81},  {HM2_GTAG_PWMGEN, 2, 0x81},
    {HM2_GTAG_PWMGEN, 3, 0x82},  {HM2_GTAG_PWMGEN, 2, 0x82},  {HM2_GTAG_PWMGEN, 3, 0x83},  {HM2_GTAG_PWMGEN, 2, 0x83},
    {HM2_GTAG_ENCODER, 5, 0x02}, {HM2_GTAG_ENCODER, 5, 0x01}, {HM2_GTAG_ENCODER, 4, 0x02}, {HM2_GTAG_ENCODER, 4, 0x01},
    {HM2_GTAG_ENCODER, 5, 0x03}, {HM2_GTAG_ENCODER, 4, 0x03}, {HM2_GTAG_PWMGEN, 5, 0x81},  {HM2_GTAG_PWMGEN, 4, 0x81},
    {HM2_GTAG_PWMGEN, 5, 0x82},  {HM2_GTAG_PWMGEN, 4, 0x82},  {HM2_GTAG_PWMGEN, 5, 0x83},  {HM2_GTAG_PWMGEN, 4, 0x83},
    {HM2_GTAG_ENCODER, 7, 0x02}, {HM2_GTAG_ENCODER, 7, 0x01}, {HM2_GTAG_ENCODER, 6, 0x02}, {HM2_GTAG_ENCODER, 6, 0x01},
    {HM2_GTAG_ENCODER, 7, 0x03}, {HM2_GTAG_ENCODER, 6, 0x03}, {HM2_GTAG_PWMGEN, 7, 0x81},  {HM2_GTAG_PWMGEN, 6, 0x81},
    {HM2_GTAG_PWMGEN, 7, 0x82},  {HM2_GTAG_PWMGEN, 6, 0x82},  {HM2_GTAG_PWMGEN, 7, 0x83},  {HM2_GTAG_PWMGEN, 6, 0x83},
};

static const struct sim_firmware firmware_7i93 = {
    .board_name = "MESA7I93",
    .fpga_size = 9,
    .fpga_pins = 144,
    .io_ports = 2,
    .port_width = 24,
    .clock_low_hz = 100000000,
    .clock_high_hz = 200000000,
    .modules = modules_7i93,
    .module_count = ROWS(modules_7i93),
    .pins = pins_7i93,
    .pin_count = ROWS(pins_7i93),
};

/* The card and firmware of the recorded LBP16 exchanges: pin package JUSTIO_72 on a 7I80HD-16. */
static const struct sim_module_row modules_7i80hd[] = {
    {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},
    {HM2_GTAG_IOPORT, 0x00, LOW, 3, 0x1000, 5, 0x00, 0x0000001F},
    {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},
};

static const struct sim_firmware firmware_7i80hd = {
    .board_name = "MESA7I80",
    .fpga_size = 16,
    .fpga_pins = 256,
    .io_ports = 3,
    .port_width = 24,
    .clock_low_hz = 100000000,
    .clock_high_hz = 200000000,
    .modules = modules_7i80hd,
    .module_count = ROWS(modules_7i80hd),
};

/* A 7I76E with nothing but its I/O: what real firmware has besides comes with hm2sim's --firmware. */
static const struct sim_firmware firmware_7i76e = {
    .board_name = "MESA7I76",
    .fpga_size = 16,
    .fpga_pins = 256,
    .io_ports = 3,
    .port_width = 17,
    .clock_low_hz = 100000000,
    .clock_high_hz = 200000000,
    .modules = modules_7i80hd,
    .module_count = ROWS(modules_7i80hd),
};

/* Addresses: jumpers down/down are 192.168.1.121, the EEPROM ships with 10.10.10.10 (seed 000, "IP ADDRESS"). */
static const struct sim_profile profiles[] = {
    {
        .name = "7i96s",
        .card_name = "7I96S",
        .efinix = true,
        .lbp_version = 3,
        .firmware_version = 17,
        .ip = {192, 168, 1, 121},
        .eeprom_ip = {10, 10, 10, 10},
        .eeprom_mac_word = 1,
        .flash_id = 0x14,
        .part = "T20F256",
        .firmware = &firmware_7i96s,
    },
    {
        .name = "7i96s_7i77d",
        .card_name = "7I96S",
        .efinix = true,
        .lbp_version = 3,
        .firmware_version = 17,
        .ip = {192, 168, 1, 121},
        .eeprom_ip = {10, 10, 10, 10},
        .eeprom_mac_word = 1,
        .flash_id = 0x14,
        .part = "T20F256",
        .firmware = &firmware_7i96s_7i77d,
    },
    {
        .name = "7i93",
        .card_name = "7I93",
        .lbp_version = 3,
        .firmware_version = 17,
        .ip = {192, 168, 1, 121},
        .eeprom_ip = {10, 10, 10, 10},
        .eeprom_mac_word = 1,
        .flash_id = 0x14,
        .part = "6slx9tqg144",
        .idcode = 0x04001093,
        .firmware = &firmware_7i93,
    },
    {
        .name = "7i80hd-16",
        .card_name = "7I80HD-16",
        .eeprom_mac_word = 0,
        .lbp_version = 3,
        .firmware_version = 15,
        .ip = {192, 168, 1, 121},
        .eeprom_ip = {10, 10, 10, 10},
        .flash_id = 0x14,
        .part = "6slx16ftg256",
        .idcode = 0x04002093,
        .firmware = &firmware_7i80hd,
    },
    {
        .name = "7i76e",
        .card_name = "7I76E-16",
        .lbp_version = 3,
        .firmware_version = 16,
        .ip = {192, 168, 1, 121},
        .eeprom_ip = {10, 10, 10, 10},
        .eeprom_mac_word = 1,
        .flash_id = 0x14,
        .part = "6slx16ftg256",
        .idcode = 0x04002093,
        .firmware = &firmware_7i76e,
    },
};

static const char *const names[] = {"7i96s", "7i96s_7i77d", "7i93", "7i80hd-16", "7i76e", NULL};

const char *const *sim_profiles(void)
{
    return names;
}

const char *sim_profile_list(void)
{
    return "7i96s, 7i96s_7i77d, 7i93, 7i80hd-16, 7i76e";
}

const struct sim_profile *sim_profile_find(const char *const name)
{
    for (size_t i = 0; name && i < ROWS(profiles); i++)
        if (strcmp(profiles[i].name, name) == 0)
            return &profiles[i];
    return NULL;
}

static uint32_t four_characters(const char *const text)
{
    uint32_t word = 0;
    for (unsigned i = 4; i-- > 0;)
        word = word << 8 | (uint8_t)text[i];
    return word;
}

void sim_profile_image(const struct sim_profile *const profile, struct hm2_image *const image)
{
    enum { OFFSET_MODULES = 64, OFFSET_PINS = 448 }; /* type 3 (register map 1.3) */
    const struct sim_firmware *const fw = profile->firmware;
    *image = (struct hm2_image){
        .id = {HM2_COOKIE, four_characters("HOST"), four_characters("MOT2"), 0x400},
        .rom = {3, OFFSET_MODULES, OFFSET_PINS, four_characters(fw->board_name), four_characters(fw->board_name + 4),
                fw->fpga_size, fw->fpga_pins, fw->io_ports, fw->io_ports * fw->port_width, fw->port_width,
                fw->clock_low_hz, fw->clock_high_hz, 4, 64, 256, 256},
    };
    uint32_t *word = image->rom + OFFSET_MODULES / 4;
    for (unsigned i = 0; i < fw->module_count; i++) {
        const struct sim_module_row *const m = &fw->modules[i];
        *word++ = m->gtag | (uint32_t)m->version << 8 | (uint32_t)m->clock_tag << 16 | (uint32_t)m->instances << 24;
        *word++ = m->base | (uint32_t)m->registers << 16 | (uint32_t)m->strides << 24;
        *word++ = m->multiple;
    }
    word = image->rom + OFFSET_PINS / 4;
    for (unsigned i = 0; i < fw->io_ports * fw->port_width; i++) {
        const struct sim_pin_row none = {HM2_GTAG_NONE, 0, 0};
        const struct sim_pin_row *const pin = i < fw->pin_count ? &fw->pins[i] : &none;
        *word++ =
            (uint32_t)HM2_GTAG_IOPORT << 24 | (uint32_t)pin->unit << 16 | (uint32_t)pin->tag << 8 | (uint32_t)pin->pin;
    }
    for (unsigned i = 0; i < fw->local_pin_count; i++)
        *word++ = fw->local_pins[i];
}
