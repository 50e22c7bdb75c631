/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Commands as in the M25P16 data sheet; program and erase end at once. */
#include "spi_flash.h"

#include <stdlib.h>
#include <string.h>

enum {
    PAGE_PROGRAM = 0x02,
    READ = 0x03,
    WRITE_DISABLE = 0x04,
    READ_STATUS = 0x05,
    WRITE_ENABLE = 0x06,
    SIGNATURE = 0xAB,
    SECTOR_ERASE = 0xD8
};

#define HEADER_BYTES   4u /* command and 24-bit address */
#define STATUS_ENABLED 0x02u
#define ERASED         0xFFu

int sim_spi_flash_new(struct sim_spi_flash *const flash, const uint8_t id, const uint32_t size)
{
    *flash = (struct sim_spi_flash){.id = id, .size = size};
    flash->bytes = malloc(size);
    if (!flash->bytes)
        return HM2_ERR_NOMEM;
    memset(flash->bytes, ERASED, size);
    return 0;
}

void sim_spi_flash_release(struct sim_spi_flash *const flash)
{
    free(flash->bytes);
    flash->bytes = NULL;
}

void sim_spi_flash_select(struct sim_spi_flash *const flash)
{
    if (flash->selected)
        return; /* no edge: whatever is under way goes on */
    flash->selected = true;
    flash->shifted = 0;
    flash->address = 0;
    flash->page_used = 0;
}

static void program(struct sim_spi_flash *const flash)
{
    const uint32_t page = flash->address & (flash->size - 1) & ~(SIM_FLASH_PAGE_BYTES - 1);
    const unsigned count = flash->page_used < SIM_FLASH_PAGE_BYTES ? flash->page_used : SIM_FLASH_PAGE_BYTES;
    const unsigned last = flash->address + flash->page_used; /* behind the newest byte; it wraps within the page */
    for (unsigned i = 1; i <= count; i++) {
        const unsigned at = (last - i) % SIM_FLASH_PAGE_BYTES;
        flash->bytes[page + at] &= flash->page[at];
    }
}

static void erase(struct sim_spi_flash *const flash)
{
    const uint32_t sector = flash->address & (flash->size - 1) & ~(SIM_FLASH_SECTOR_BYTES - 1);
    memset(flash->bytes + sector, ERASED, SIM_FLASH_SECTOR_BYTES);
}

void sim_spi_flash_deselect(struct sim_spi_flash *const flash)
{
    if (!flash->selected)
        return;
    flash->selected = false;
    if (flash->shifted == 1 && flash->command == WRITE_ENABLE)
        flash->write_enabled = true;
    if (flash->shifted == 1 && flash->command == WRITE_DISABLE)
        flash->write_enabled = false;
    if (!flash->write_enabled || flash->shifted < HEADER_BYTES)
        return;
    if (flash->command == PAGE_PROGRAM && flash->page_used > 0)
        program(flash);
    else if (flash->command == SECTOR_ERASE && flash->shifted == HEADER_BYTES)
        erase(flash);
    else
        return;
    flash->write_enabled = false;
}

static uint8_t data_phase(struct sim_spi_flash *const flash, const uint8_t out)
{
    switch (flash->command) {
    case READ:
        return flash->bytes[flash->address++ & (flash->size - 1)];
    case SIGNATURE:
        return flash->id;
    case PAGE_PROGRAM:
        flash->page[(flash->address + flash->page_used) % SIM_FLASH_PAGE_BYTES] = out;
        flash->page_used++;
        return ERASED;
    default:
        return ERASED;
    }
}

uint8_t sim_spi_flash_shift(struct sim_spi_flash *const flash, const uint8_t out)
{
    if (!flash->selected)
        return ERASED;
    const unsigned place = flash->shifted++;
    if (place == 0) {
        flash->command = out;
        return ERASED;
    }
    if (flash->command == READ_STATUS)
        return flash->write_enabled ? STATUS_ENABLED : 0;
    if (place < HEADER_BYTES) {
        flash->address = flash->address << 8 | out;
        return ERASED;
    }
    return data_phase(flash, out);
}
