/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Which image of a configuration flash the FPGA starts. */
#ifndef SIM_BOOT_H
#define SIM_BOOT_H

#include <hm2/sim_flash.h>

/* What simulated images say about themselves, in front of their body. */
#define SIM_STAMP_BYTES       32u
#define SIM_STAMP_BOARD_AT    16u
#define SIM_EFINIX_POINTER_AT 0x48u /* from the sync word: flash tool reference 3.11 */
#define SIM_EFINIX_LENGTH_AT  0x50u /* ours: bytes of the body, its check sum, the part */
#define SIM_EFINIX_CRC_AT     0x54u
#define SIM_EFINIX_PART_AT    0x58u
#define SIM_EFINIX_BODY_AT    0x60u

extern const uint8_t sim_stamp[SIM_STAMP_BOARD_AT];

struct sim_profile;

struct sim_boot_flash {
    const struct sim_profile *profile;
    const uint8_t *bytes;
    uint32_t size;
    bool trust;
};

/* Spartan-6 keeps these over a reload: where to load from, and where when that fails. */
struct sim_boot_registers {
    uint32_t start, golden;
};

/* Xilinx: load from registers->start. */
enum sim_boot sim_boot_xilinx(const struct sim_boot_flash *flash, struct sim_boot_registers *registers);
/* Efinix: the user image when it is wanted and good, else the fallback. */
enum sim_boot sim_boot_efinix(const struct sim_boot_flash *flash, bool want_user);

/* The check sum of a Spartan-6 configuration, a word further (see tests/unit/test_flash_image.c for where it is from).
 * Not the library's own: what the card does is computed independently. */
uint32_t sim_spartan6_crc(uint32_t crc, unsigned reg, unsigned word);

/* What stands in for the check sum of a Trion image, which nobody knows. Start with 1; previous results go on. */
uint32_t sim_check_sum(uint32_t sum, const uint8_t *bytes, size_t len);

/* The boot block of a chip, 64 bytes (flash tool reference 3.8). */
#define SIM_BOOT_BLOCK_BYTES 64u
void sim_boot_block(uint32_t flash_size, uint8_t block[SIM_BOOT_BLOCK_BYTES]);

#endif
