/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Image files as the vendors' tools make them, with a bitstream of noise (flash tool reference 3.10, 3.11). */
#ifndef FLASH_IMAGES_H
#define FLASH_IMAGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define FLASH_IMAGE_MOST 1048576u

struct xilinx_file {
    const char *design, *part; /* NULL = that of a 7I93 */
    uint32_t idcode;           /* 0 = SLX9 */
    size_t payload;            /* 0 = 340604 bytes */
    uint64_t seed;
    uint16_t cor1, cor2; /* 0 = 0x3D00, 0x8DEC */
    bool multiboot;      /* writes GENERAL1 and MODE */
    bool no_cor2;
};

struct efinix_file {
    const char *project, *part, *family, *mode; /* NULL = those of a 7I96S */
    size_t bytes;                               /* of the file; 0 = 678650, fallback images 680000 */
    uint64_t seed;
    bool fallback; /* with next-image pointers */
};

/* Length of the file written to `to`, which has room for FLASH_IMAGE_MOST bytes. */
size_t make_xilinx(const struct xilinx_file *file, uint8_t *to);
size_t make_efinix(const struct efinix_file *file, uint8_t *to);

#endif
