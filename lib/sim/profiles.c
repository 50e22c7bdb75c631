/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The cards that can be simulated and their firmware, as module and pin tables (register map 5). */
#include "profiles.h"

#include <stdio.h>
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

/* Firmware with nothing but ports, as pin package JUSTIO_72 of the recorded LBP16 exchanges, for each card. */
#define PLAIN_MODULES(ports)                                                  \
    {                                                                         \
        {HM2_GTAG_WATCHDOG, 0x00, LOW, 1, 0x0C00, 3, 0x00, 0x00000000},       \
            {HM2_GTAG_IOPORT, 0x00, LOW, ports, 0x1000, 5, 0x00, 0x0000001F}, \
            {HM2_GTAG_LED, 0x00, LOW, 1, 0x0200, 1, 0x00, 0x00000000},        \
    }

static const struct sim_module_row plain_2[] = PLAIN_MODULES(2);
static const struct sim_module_row plain_3[] = PLAIN_MODULES(3);
static const struct sim_module_row plain_4[] = PLAIN_MODULES(4);

/* FPGA of a card as the IDROM tells it. */
#define SIZE_SLX9  .fpga_size = 9, .fpga_pins = 144
#define SIZE_SLX16 .fpga_size = 16, .fpga_pins = 256
#define SIZE_SLX25 .fpga_size = 25, .fpga_pins = 256
#define SIZE_T20   .fpga_size = 20, .fpga_pins = 256

#define PLAIN(name, fpga, ports, width)                                                                           \
    {                                                                                                             \
        .board_name = (name), SIZE_##fpga, .io_ports = (ports), .port_width = (width), .clock_low_hz = 100000000, \
        .clock_high_hz = 200000000, .modules = plain_##ports, .module_count = ROWS(plain_##ports),                \
    }

static const struct sim_firmware plain_7i76e = PLAIN("MESA7I76", SLX16, 3, 17);
static const struct sim_firmware plain_7i76eu = PLAIN("MESA7I76", T20, 3, 17);
static const struct sim_firmware plain_7i80db_16 = PLAIN("MESA7I80", SLX16, 4, 17);
static const struct sim_firmware plain_7i80db_25 = PLAIN("MESA7I80", SLX25, 4, 17);
static const struct sim_firmware plain_7i80hd_16 = PLAIN("MESA7I80", SLX16, 3, 24);
static const struct sim_firmware plain_7i80hd_25 = PLAIN("MESA7I80", SLX25, 3, 24);
static const struct sim_firmware plain_7i80hdt = PLAIN("MESA7I80", T20, 3, 24);
static const struct sim_firmware plain_7i92 = PLAIN("MESA7I92", SLX9, 2, 17);
static const struct sim_firmware plain_7i92t = PLAIN("MESA7I92", T20, 2, 17);
static const struct sim_firmware plain_7i94 = PLAIN("MESA7I94", SLX9, 2, 21);
static const struct sim_firmware plain_7i94t = PLAIN("MESA7I94", T20, 2, 21);
static const struct sim_firmware plain_7i95 = PLAIN("MESA7I95", SLX9, 2, 29);
static const struct sim_firmware plain_7i95t = PLAIN("MESA7I95", T20, 2, 29);
static const struct sim_firmware plain_7i96 = PLAIN("MESA7I96", SLX9, 3, 17);
static const struct sim_firmware plain_7i97 = PLAIN("MESA7I97", SLX9, 3, 17);
static const struct sim_firmware plain_7i97t = PLAIN("MESA7I97", T20, 3, 17);
static const struct sim_firmware plain_7i98 = PLAIN("MESA7I98", SLX9, 3, 17);
static const struct sim_firmware plain_litehm2 = PLAIN("LITEHM2", SLX16, 3, 24);

/* FPGA of a card as image files name it, and as it names itself (Xilinx; flash tool reference 2.1). */
#define PART_SLX9  .part = "6slx9tqg144", .idcode = 0x04001093
#define PART_SLX16 .part = "6slx16ftg256", .idcode = SIM_IDCODE_SLX16
#define PART_SLX25 .part = "6slx25ftg256", .idcode = SIM_IDCODE_SLX25
#define PART_T20   .part = "T20F256", .efinix = true

/* Where the MAC address starts, and firmware version: of the manual, and of the recorded card. */
#define ORIGIN_MANUAL   .eeprom_mac_word = 1, .firmware_version = 17
#define ORIGIN_RECORDED .eeprom_mac_word = 0, .firmware_version = 15

#define CARDS(CARD)                                                                   \
    CARD("7i96s", "7I96S", T20, MANUAL, firmware_7i96s)                               \
    CARD("7i96s_7i77d", "7I96S", T20, MANUAL, firmware_7i96s_7i77d)                   \
    CARD("7i93", "7I93", SLX9, MANUAL, sim_firmware_7i93_svst8_4im2)                  \
    CARD("7i93_svst4_8", "7I93", SLX9, MANUAL, sim_firmware_7i93_svst4_8)             \
    CARD("7i93_svst8_8im2", "7I93", SLX9, MANUAL, sim_firmware_7i93_svst8_8im2)       \
    CARD("7i93_svst1_4_7i47s", "7I93", SLX9, MANUAL, sim_firmware_7i93_svst1_4_7i47s) \
    CARD("7i93_2x7i65", "7I93", SLX9, MANUAL, sim_firmware_7i93_2x7i65)               \
    CARD("7i93_sv12im_2x7i48", "7I93", SLX9, MANUAL, sim_firmware_7i93_sv12im_2x7i48) \
    CARD("7i93_sv6_7i49", "7I93", SLX9, MANUAL, sim_firmware_7i93_sv6_7i49)           \
    CARD("7i76e", "7I76E-16", SLX16, MANUAL, plain_7i76e)                             \
    CARD("7i76eu", "7I76EU", T20, MANUAL, plain_7i76eu)                               \
    CARD("7i80db-16", "7I80DB-16", SLX16, MANUAL, plain_7i80db_16)                    \
    CARD("7i80db-25", "7I80DB-25", SLX25, MANUAL, plain_7i80db_25)                    \
    CARD("7i80hd-16", "7I80HD-16", SLX16, RECORDED, plain_7i80hd_16)                  \
    CARD("7i80hd-25", "7I80HD-25", SLX25, MANUAL, plain_7i80hd_25)                    \
    CARD("7i80hdt", "7I80HDT", T20, MANUAL, plain_7i80hdt)                            \
    CARD("7i92", "7I92", SLX9, MANUAL, plain_7i92)                                    \
    CARD("7i92t", "7I92T", T20, MANUAL, plain_7i92t)                                  \
    CARD("7i94", "7I94", SLX9, MANUAL, plain_7i94)                                    \
    CARD("7i94t", "7I94T", T20, MANUAL, plain_7i94t)                                  \
    CARD("7i95", "7I95", SLX9, MANUAL, plain_7i95)                                    \
    CARD("7i95t", "7I95T", T20, MANUAL, plain_7i95t)                                  \
    CARD("7i96", "7I96", SLX9, MANUAL, plain_7i96)                                    \
    CARD("7i97", "7I97", SLX9, MANUAL, plain_7i97)                                    \
    CARD("7i97t", "7I97T", T20, MANUAL, plain_7i97t)                                  \
    CARD("7i98", "7I98", SLX9, MANUAL, plain_7i98)                                    \
    CARD("litehm2", "litehm2", SLX16, MANUAL, plain_litehm2)

/* Addresses: jumpers down/down are 192.168.1.121, the EEPROM ships with 10.10.10.10 (seed 000, "IP ADDRESS"). */
#define PROFILE(id, card, fpga, origin, image) \
    {.name = (id),                             \
     .card_name = (card),                      \
     .lbp_version = 3,                         \
     .ip = {192, 168, 1, 121},                 \
     .eeprom_ip = {10, 10, 10, 10},            \
     .flash_id = 0x14,                         \
     PART_##fpga,                              \
     ORIGIN_##origin,                          \
     .firmware = &(image)},
#define NAME(id, ...) (id),

static const struct sim_profile profiles[] = {CARDS(PROFILE)};
static const char *const names[] = {CARDS(NAME) NULL};

const char *const *sim_profiles(void)
{
    return names;
}

void sim_profile_list(char *const text, const size_t size)
{
    size_t used = 0;
    for (const char *const *name = names; *name && used < size; name++)
        used += (size_t)snprintf(text + used, size - used, "%s%s", used ? " " : "", *name);
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
