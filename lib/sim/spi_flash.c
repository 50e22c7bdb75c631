/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Commands as in the M25P16 data sheet. The bytes change when an operation begins; until it ends the chip is busy. */
#include "spi_flash.h"

#include <limits.h>

#include <stdlib.h>
#include <string.h>

#include "prng.h"

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
#define STATUS_BUSY    0x01u
#define STATUS_ENABLED 0x02u
#define ERASED         0xFFu

int sim_spi_flash_new(struct sim_spi_flash *const flash, const uint8_t id, const uint32_t size)
{
    *flash = (struct sim_spi_flash){.id = id, .size = size, .busy_until_ns = INT64_MIN};
    flash->own = malloc(size);
    if (!flash->own)
        return HM2_ERR_NOMEM;
    flash->bytes = flash->own;
    memset(flash->bytes, ERASED, size);
    return 0;
}

void sim_spi_flash_release(struct sim_spi_flash *const flash)
{
    free(flash->own);
    flash->own = flash->bytes = NULL;
}

void sim_spi_flash_power_up(struct sim_spi_flash *const flash)
{
    flash->selected = flash->write_enabled = flash->dead = false;
    flash->busy_until_ns = INT64_MIN;
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

/* ---- what an operation does to the bytes --------------------------------------------------------------------------
 */

/* Bits of a byte that do not do what they should this time; each use counts. */
static uint8_t bad_bits(struct sim_spi_flash *const flash, const uint32_t address, const bool erasing)
{
    uint8_t mask = 0;
    for (unsigned i = 0; i < flash->faults.bad_count; i++) {
        struct sim_flash_bad *const bad = &flash->faults.bad[i];
        unsigned *const left = erasing ? &bad->erases : &bad->programs;
        if (bad->address != address || *left == 0)
            continue;
        mask |= bad->mask;
        if (*left != UINT_MAX)
            --*left;
    }
    return mask;
}

static bool cut_now(const struct sim_spi_flash *const flash)
{
    return flash->faults.cut_at == flash->counts.operations;
}

static uint8_t random_byte(struct sim_spi_flash *const flash)
{
    return (uint8_t)sim_prng_next(&flash->faults.seed);
}

static void program(struct sim_spi_flash *const flash)
{
    const uint32_t page = flash->address & (flash->size - 1) & ~(SIM_FLASH_PAGE_BYTES - 1);
    const unsigned count = flash->page_used < SIM_FLASH_PAGE_BYTES ? flash->page_used : SIM_FLASH_PAGE_BYTES;
    const unsigned first = flash->address + flash->page_used - count; /* of the bytes that count, the newest */
    const unsigned whole = cut_now(flash) ? flash->faults.cut_bytes : UINT_MAX;
    for (unsigned i = 0; i < count && i <= whole; i++) {
        const unsigned at = (first + i) % SIM_FLASH_PAGE_BYTES;
        uint8_t keep = flash->faults.bad_count > 0 ? bad_bits(flash, page + at, false) : 0;
        if (i == whole)
            keep |= random_byte(flash);
        flash->bytes[page + at] &= flash->page[at] | keep;
    }
}

/* Bits are set one after the other, in an order that nobody knows; some chips clear all of them first. */
static void half_erase(struct sim_spi_flash *const flash, uint8_t *const sector)
{
    const bool clears_first = random_byte(flash) & 1u;
    const unsigned part = flash->faults.cut_bytes & 0xFFu;
    const bool clearing = clears_first && part < 128;
    const unsigned share = clears_first ? part * 2 & 0xFFu : part; /* of 256: done of this half */
    for (uint32_t i = 0; i < SIM_FLASH_SECTOR_BYTES; i++) {
        uint8_t done = 0;
        for (unsigned bit = 0; bit < 8; bit++)
            done |= (uint8_t)((random_byte(flash) < share) << bit);
        if (clearing)
            sector[i] &= (uint8_t)~done;
        else
            sector[i] = clears_first ? done : sector[i] | done;
    }
}

static void erase(struct sim_spi_flash *const flash)
{
    const uint32_t at = flash->address & (flash->size - 1) & ~(SIM_FLASH_SECTOR_BYTES - 1);
    uint8_t *const sector = flash->bytes + at;
    flash->counts.sector0_erases += at == 0;
    flash->counts.last_erase = at;
    if (cut_now(flash)) {
        half_erase(flash, sector);
        return;
    }
    uint8_t kept[SIM_FLASH_BAD_BITS] = {0};
    for (unsigned i = 0; i < flash->faults.bad_count; i++)
        kept[i] = flash->bytes[flash->faults.bad[i].address & (flash->size - 1)];
    memset(sector, ERASED, SIM_FLASH_SECTOR_BYTES);
    for (unsigned i = 0; i < flash->faults.bad_count; i++) {
        const uint32_t address = flash->faults.bad[i].address & (flash->size - 1);
        if ((address & ~(SIM_FLASH_SECTOR_BYTES - 1)) == at)
            flash->bytes[address] = (uint8_t)(~bad_bits(flash, address, true) | kept[i]);
    }
}

static void operate(struct sim_spi_flash *const flash, const int64_t now_ns)
{
    const bool erasing = flash->command == SECTOR_ERASE;
    flash->write_enabled = false;
    flash->counts.operations++;
    if (erasing) {
        flash->counts.erases++;
        erase(flash);
    } else {
        flash->counts.programs++;
        program(flash);
    }
    flash->busy_until_ns = now_ns + (erasing ? flash->times.erase_ns : flash->times.program_ns);
    if (flash->faults.stuck_at == flash->counts.operations)
        flash->busy_until_ns = INT64_MAX;
    flash->dead = cut_now(flash);
}

/* ---- pins ---------------------------------------------------------------------------------------------------------
 */

void sim_spi_flash_deselect(struct sim_spi_flash *const flash, const int64_t now_ns)
{
    if (!flash->selected)
        return;
    flash->selected = false;
    if (flash->dead || now_ns < flash->busy_until_ns)
        return;
    if (flash->shifted == 1 && flash->command == WRITE_ENABLE)
        flash->write_enabled = true;
    if (flash->shifted == 1 && flash->command == WRITE_DISABLE)
        flash->write_enabled = false;
    if (!flash->write_enabled || flash->shifted < HEADER_BYTES)
        return;
    if ((flash->command == PAGE_PROGRAM && flash->page_used > 0) ||
        (flash->command == SECTOR_ERASE && flash->shifted == HEADER_BYTES))
        operate(flash, now_ns);
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

uint8_t sim_spi_flash_shift(struct sim_spi_flash *const flash, const uint8_t out, const int64_t now_ns)
{
    if (!flash->selected || flash->dead)
        return ERASED;
    const unsigned place = flash->shifted++;
    if (place == 0) {
        flash->command = out;
        return ERASED;
    }
    if (flash->command == READ_STATUS)
        return (flash->write_enabled ? STATUS_ENABLED : 0) | (now_ns < flash->busy_until_ns ? STATUS_BUSY : 0);
    if (place < HEADER_BYTES) {
        flash->address = flash->address << 8 | out;
        return ERASED;
    }
    return now_ns < flash->busy_until_ns ? ERASED : data_phase(flash, out);
}

uint32_t sim_spi_flash_read4(struct sim_spi_flash *const flash, const int64_t now_ns)
{
    if (flash->dead || now_ns < flash->busy_until_ns)
        return UINT32_MAX;
    uint32_t value = 0;
    for (unsigned i = 0; i < 4; i++)
        value |= (uint32_t)flash->bytes[flash->address++ & (flash->size - 1)] << (8 * i);
    return value;
}
