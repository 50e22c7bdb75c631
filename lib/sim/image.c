/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a firmware image says, for the card that it configures. Unlike the driver's parser this one never refuses: a
 * card with a faulty image exists and answers, and its clients must find the fault.
 */
#include "card_state.h"

#include <string.h>

#define DEFAULT_CLOCK_LOW_HZ  100000000u
#define DEFAULT_CLOCK_HIGH_HZ 200000000u
#define MD_WORDS              3u

/* Header words (register map 1.3). */
enum {
    WORD_TYPE,
    WORD_OFFSET_MODULES,
    WORD_OFFSET_PINS,
    WORD_BOARD_NAME,
    WORD_FPGA_SIZE = 5,
    WORD_FPGA_PINS,
    WORD_IO_PORTS,
    WORD_IO_WIDTH,
    WORD_PORT_WIDTH,
    WORD_CLOCK_LOW,
    WORD_CLOCK_HIGH,
    WORD_INSTANCE_STRIDE,
    WORD_REGISTER_STRIDE = 14
};

static uint32_t clock_or(const uint32_t hz, const uint32_t fallback)
{
    return hz >= HM2_MIN_CLOCK_HZ ? hz : fallback;
}

static void read_header(const uint32_t *const rom, struct hm2_idrom *const idrom)
{
    idrom->type = rom[WORD_TYPE];
    idrom->offset_modules = rom[WORD_OFFSET_MODULES];
    idrom->offset_pins = rom[WORD_OFFSET_PINS];
    for (unsigned i = 0; i < 8; i++)
        idrom->board_name[i] = (char)(rom[WORD_BOARD_NAME + i / 4] >> (8 * (i % 4)) & 0x7Fu);
    idrom->fpga_size = rom[WORD_FPGA_SIZE];
    idrom->fpga_pins = rom[WORD_FPGA_PINS];
    idrom->io_ports = rom[WORD_IO_PORTS];
    idrom->io_width = rom[WORD_IO_WIDTH];
    idrom->port_width = rom[WORD_PORT_WIDTH];
    idrom->clock_low_hz = clock_or(rom[WORD_CLOCK_LOW], DEFAULT_CLOCK_LOW_HZ);
    idrom->clock_high_hz = clock_or(rom[WORD_CLOCK_HIGH], DEFAULT_CLOCK_HIGH_HZ);
    memcpy(idrom->instance_stride, rom + WORD_INSTANCE_STRIDE, sizeof idrom->instance_stride);
    memcpy(idrom->register_stride, rom + WORD_REGISTER_STRIDE, sizeof idrom->register_stride);
}

/* Module descriptor (register map 1.4). */
static struct hm2_md read_md(const struct hm2_idrom *const idrom, const uint32_t w[MD_WORDS])
{
    const uint8_t strides = (uint8_t)(w[1] >> 24);
    struct hm2_md md = {
        .gtag = (uint8_t)w[0],
        .version = (uint8_t)(w[0] >> 8),
        .clock_tag = (uint8_t)(w[0] >> 16),
        .instances = (uint8_t)(w[0] >> 24),
        .base = (uint16_t)w[1],
        .registers = (uint8_t)(w[1] >> 16),
        .register_stride_selector = strides & 15u,
        .instance_stride_selector = strides >> 4,
        .multiple = w[2],
    };
    md.clock_hz = md.clock_tag == 2 ? idrom->clock_high_hz : idrom->clock_low_hz;
    md.register_stride = idrom->register_stride[md.register_stride_selector & 1u];
    md.instance_stride = idrom->instance_stride[md.instance_stride_selector & 1u];
    return md;
}

void sim_image_read(const struct hm2_image *const image, struct hm2_idrom *const idrom)
{
    memset(idrom, 0, sizeof *idrom);
    read_header(image->rom, idrom);
    uint32_t word = idrom->offset_modules / 4;
    while (idrom->module_count < HM2_MAX_MODULES && word <= HM2_IDROM_WORDS - MD_WORDS) {
        const struct hm2_md md = read_md(idrom, image->rom + word);
        if (md.gtag == HM2_GTAG_NONE)
            break;
        idrom->modules[idrom->module_count++] = md;
        word += MD_WORDS;
    }
    word = idrom->offset_pins / 4;
    while (idrom->pin_count < HM2_MAX_PINS && idrom->pin_count < idrom->io_width && word < HM2_IDROM_WORDS) {
        const uint32_t pin = image->rom[word++];
        idrom->pins[idrom->pin_count++] = (struct hm2_pd){.secondary_pin = (uint8_t)pin,
                                                          .secondary_tag = (uint8_t)(pin >> 8),
                                                          .secondary_unit = (uint8_t)(pin >> 16),
                                                          .primary_tag = (uint8_t)(pin >> 24)};
    }
}
