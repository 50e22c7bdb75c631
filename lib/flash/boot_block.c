/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What stands at the beginning of an area: boot block (flash tool reference 3.8), image (3.10, 3.11) or nothing. */
#include <string.h>

#include <hm2/flash.h>

#include "image.h"

#define USER_BANK_AT 25u /* byte 2 of the user area's address */

static const uint8_t boot_block_16mb[FLASH_BOOT_BLOCK_BYTES] = {
    0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, /* */
    0xAA, 0x99, 0x55, 0x66,                                     /* sync */
    0x31, 0xE1, 0xFF, 0xFF,                                     /* CWDT: configuration watchdog */
    0x32, 0x61, 0x00, 0x00,                                     /* GENERAL1: user image, low half of its address */
    0x32, 0x81, 0x0B, 0x10,                                     /* GENERAL2: SPI read command, high byte */
    0x32, 0xA1, 0x00, 0x00,                                     /* GENERAL3 and 4: fallback image */
    0x32, 0xC1, 0x0B, 0x01,                                     /* */
    0x30, 0xA1, 0x00, 0x00,                                     /* CMD: null */
    0x33, 0x01, 0x21, 0x00,                                     /* MODE: from the bitstream, one bit wide */
    0x32, 0x01, 0x00, 0x1F,                                     /* HC_OPT */
    0x30, 0xA1, 0x00, 0x0E,                                     /* CMD: IPROG */
    0x20, 0x00, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00,
};

void flash_boot_block(const struct flash_chip *const chip, uint8_t block[const FLASH_BOOT_BLOCK_BYTES])
{
    memcpy(block, boot_block_16mb, FLASH_BOOT_BLOCK_BYTES);
    block[USER_BANK_AT] = (uint8_t)(chip->bytes / 2 >> 16);
}

static bool all_erased(const uint8_t *const bytes, const size_t len)
{
    for (size_t i = 0; i < len; i++)
        if (bytes[i] != FLASH_ERASED)
            return false;
    return true;
}

/* A cut-off erase or write of this block leaves some of its zeros as ones, and never a zero where it has a one. */
static bool only_zeros_missing(const uint8_t *const found, const uint8_t *const block)
{
    for (size_t i = 0; i < FLASH_BOOT_BLOCK_BYTES; i++)
        if ((found[i] & block[i]) != block[i])
            return false;
    return true;
}

static bool other_size(const struct flash_chip *const chip, const uint8_t *const page)
{
    uint8_t block[FLASH_BOOT_BLOCK_BYTES];
    const struct flash_chip *other;
    for (size_t i = 0; (other = flash_chip_at(i)) != NULL; i++) {
        flash_boot_block(other, block);
        if (other->bytes != chip->bytes && memcmp(page, block, sizeof block) == 0)
            return true;
    }
    return false;
}

enum flash_content flash_content_of(const struct flash_chip *const chip, const uint8_t page[const FLASH_HEAD_BYTES])
{
    uint8_t block[FLASH_BOOT_BLOCK_BYTES];
    size_t sync_at = 0;
    bool pointers = false;
    flash_boot_block(chip, block);
    if (all_erased(page, FLASH_HEAD_BYTES))
        return FLASH_BLANK;
    if (memcmp(page, block, sizeof block) == 0)
        return FLASH_BOOT_BLOCK;
    if (other_size(chip, page))
        return FLASH_BOOT_OTHER_SIZE;
    if (flash_efinix_sync(page, FLASH_HEAD_BYTES, &sync_at, &pointers))
        return pointers ? FLASH_EFINIX_FALLBACK : FLASH_EFINIX_IMAGE;
    if (flash_xilinx_sync(page, FLASH_HEAD_BYTES, &sync_at))
        return FLASH_XILINX_IMAGE;
    return only_zeros_missing(page, block) ? FLASH_BOOT_UNFINISHED : FLASH_UNKNOWN;
}

const char *flash_content_name(const enum flash_content content)
{
    static const char *const names[] = {
        [FLASH_BLANK] = "blank",
        [FLASH_BOOT_BLOCK] = "boot block",
        [FLASH_BOOT_OTHER_SIZE] = "boot block for a chip of another size",
        [FLASH_BOOT_UNFINISHED] = "unfinished boot block",
        [FLASH_XILINX_IMAGE] = "Xilinx image",
        [FLASH_EFINIX_IMAGE] = "Efinix user image",
        [FLASH_EFINIX_FALLBACK] = "Efinix fallback image",
        [FLASH_UNKNOWN] = "unknown data",
    };
    return names[content];
}
