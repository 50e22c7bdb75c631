/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A serial NOR flash (M25P16 command set) seen from its pins: select, shift bytes, deselect. Time is the caller's. */
#ifndef SIM_SPI_FLASH_H
#define SIM_SPI_FLASH_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/err.h>
#include <hm2/sim_flash.h>

#define SIM_FLASH_PAGE_BYTES   256u
#define SIM_FLASH_SECTOR_BYTES 65536u

struct sim_spi_flash {
    uint8_t *bytes;
    uint8_t *own;  /* what is to be freed; NULL = the caller's memory */
    uint32_t size; /* a power of two */
    uint8_t id;
    bool selected, write_enabled;
    uint8_t command;
    unsigned shifted; /* bytes since select */
    uint32_t address;
    unsigned page_used; /* bytes received for the page, may exceed it */
    uint8_t page[SIM_FLASH_PAGE_BYTES];

    struct sim_flash_times times;
    struct sim_flash_faults faults;
    struct sim_flash_counts counts;
    int64_t busy_until_ns; /* INT64_MAX = it never ends */
    bool dead;             /* the power went during an operation */
};

int HM2_MUST_CHECK sim_spi_flash_new(struct sim_spi_flash *flash, uint8_t id, uint32_t size);
void sim_spi_flash_release(struct sim_spi_flash *flash);
/* The power comes back. */
void sim_spi_flash_power_up(struct sim_spi_flash *flash);
void sim_spi_flash_select(struct sim_spi_flash *flash);
/* Programs and erases begin here. */
void sim_spi_flash_deselect(struct sim_spi_flash *flash, int64_t now_ns);
uint8_t sim_spi_flash_shift(struct sim_spi_flash *flash, uint8_t out, int64_t now_ns);
/* Four bytes of a READ that has its address, least significant first. */
uint32_t sim_spi_flash_read4(struct sim_spi_flash *flash, int64_t now_ns);

#endif
