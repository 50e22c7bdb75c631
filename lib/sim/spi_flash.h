/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A serial NOR flash (M25P16 command set) seen from its pins: select, shift bytes, deselect. */
#ifndef SIM_SPI_FLASH_H
#define SIM_SPI_FLASH_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/err.h>

#define SIM_FLASH_PAGE_BYTES   256u
#define SIM_FLASH_SECTOR_BYTES 65536u

struct sim_spi_flash {
    uint8_t *bytes;
    uint32_t size; /* a power of two */
    uint8_t id;
    bool selected, write_enabled;
    uint8_t command;
    unsigned shifted; /* bytes since select */
    uint32_t address;
    unsigned page_used; /* bytes received for the page, may exceed it */
    uint8_t page[SIM_FLASH_PAGE_BYTES];
};

int HM2_MUST_CHECK sim_spi_flash_new(struct sim_spi_flash *flash, uint8_t id, uint32_t size);
void sim_spi_flash_release(struct sim_spi_flash *flash);
void sim_spi_flash_select(struct sim_spi_flash *flash);
void sim_spi_flash_deselect(struct sim_spi_flash *flash);
uint8_t sim_spi_flash_shift(struct sim_spi_flash *flash, uint8_t out);

#endif
