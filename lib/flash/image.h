/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Image files: what their two formats share. */
#ifndef FLASH_IMAGE_H
#define FLASH_IMAGE_H

#include <hm2/flash.h>

#define FLASH_ERASED     0xFFu
#define FLASH_HEAD_BYTES (2u * FLASH_PAGE_BYTES)

/* Bytes not yet read. Taking more than are left yields NULL and changes nothing. */
struct flash_stream {
    const uint8_t *data;
    size_t left;
};

static inline const uint8_t *flash_take(struct flash_stream *const stream, const size_t count)
{
    const uint8_t *const taken = stream->data;
    if (count > stream->left)
        return NULL;
    stream->data += count;
    stream->left -= count;
    return taken;
}

/* Copy a text that may lack its end; what cannot be printed becomes "?". */
void flash_copy_text(char *to, const uint8_t *from, size_t len);

int flash_xilinx_parse(const uint8_t *data, size_t len, struct flash_image *image, struct hm2_diag *diag);
int flash_efinix_parse(const uint8_t *data, size_t len, struct flash_image *image, struct hm2_diag *diag);

/*
 * The check sum of a Spartan-6 configuration: of each word that is written to a register. x^22 + x^15 + x^12 + x^7 + 1,
 * one step a word, and the word enters with the register's number in front. No document gives it; it was found from
 * files of Xilinx's own tool for five FPGAs (those of Debian's openfpgaloader) and fits both check sums of each.
 */
uint32_t flash_spartan6_crc(uint32_t crc, unsigned reg, unsigned word);

/* Where a bitstream begins: behind nothing but what its format puts in front of its sync word. */
bool flash_xilinx_sync(const uint8_t *data, size_t len, size_t *at);
bool flash_efinix_sync(const uint8_t *data, size_t len, size_t *at, bool *pointers);

#endif
