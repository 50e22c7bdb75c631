/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Flash of a remote, for new firmware, as LinuxCNC's setsserial programs it: an offset, a page buffer at the lowest
 * addresses, and a byte that erases a block or writes the page. Block 0 holds the loader and is not erased or written.
 */
#include "remote_state.h"

/* Addresses while the flash is meant, and what is written to the last one. */
enum { FLASH_OFFSET = 0x8000, FLASH_BLOCK_LOG2 = 0x8004, FLASH_PAGE_LOG2 = 0x8005, FLASH_COMMIT = 0x8007 };
#define COMMIT_ERASE 0xFEu
#define COMMIT_WRITE 0xFDu
#define ERASED       0xFFu

static bool commit(struct remote_flash *const flash, const uint8_t how)
{
    const uint32_t block = 1u << REMOTE_BLOCK_LOG2, page = sizeof flash->page;
    const uint32_t unit = how == COMMIT_ERASE ? block : page;
    if ((how != COMMIT_ERASE && how != COMMIT_WRITE) || flash->offset % unit != 0 || flash->offset < block ||
        flash->offset >= REMOTE_FLASH_BYTES)
        return false;
    for (uint32_t i = 0; i < unit; i++)
        flash->bytes[flash->offset + i] =
            how == COMMIT_ERASE ? (uint8_t)ERASED : flash->bytes[flash->offset + i] & flash->page[i];
    return true;
}

bool remote_flash_write(struct remote_flash *const flash, const uint16_t address, const uint8_t value)
{
    if (address == FLASH_COMMIT)
        return commit(flash, value);
    if (address >= FLASH_OFFSET && address < FLASH_BLOCK_LOG2) {
        const unsigned shift = 8u * (address - FLASH_OFFSET);
        flash->offset = (flash->offset & ~(UINT32_C(0xFF) << shift)) | (uint32_t)value << shift;
        return true;
    }
    if (address >= sizeof flash->page)
        return false;
    flash->page[address] = value;
    return true;
}

uint8_t remote_flash_read(const struct remote_flash *const flash, const uint16_t address)
{
    if (address == FLASH_BLOCK_LOG2)
        return REMOTE_BLOCK_LOG2;
    if (address == FLASH_PAGE_LOG2)
        return REMOTE_PAGE_LOG2;
    return address < sizeof flash->page ? flash->page[address] : 0;
}
