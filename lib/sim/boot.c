/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Loading an image as the FPGA does: Spartan-6 packets (flash tool reference 3.8, 3.10, 3.13), Trion by its sync word.
 * Trion's check sum is the simulation's own, of header and body.
 */
#include "boot.h"

#include <string.h>

#include <hm2/bytes.h>

#include "profiles.h"

#define MOST_JUMPS 3u
#define LINE_FEEDS 256u

const uint8_t sim_stamp[SIM_STAMP_BOARD_AT] = "libhm2 simulated";

/* ---- check sum ----------------------------------------------------------------------------------------------------
 */

/* Four bytes at a time; each step can be undone, so that no change of one word goes unseen. */
uint32_t sim_check_sum(uint32_t sum, const uint8_t *const bytes, const size_t len)
{
    size_t i = 0;
    for (; i + 4 <= len; i += 4) {
        sum = (sum ^ hm2_get_le32(bytes + i)) * 0x9E3779B1u;
        sum ^= sum >> 15;
    }
    for (; i < len; i++) {
        sum = (sum ^ bytes[i]) * 0x9E3779B1u;
        sum ^= sum >> 15;
    }
    return sum;
}

uint32_t sim_spartan6_crc(uint32_t crc, const unsigned reg, const unsigned word)
{
    enum { BITS = 22, TAPS = 1 << 15 | 1 << 12 | 1 << 7 | 1 };
    crc <<= 1;
    if (crc >> BITS)
        crc ^= 1u << BITS | TAPS;
    return crc ^ (reg << 16 | word);
}

void sim_boot_block(const uint32_t flash_size, uint8_t block[const SIM_BOOT_BLOCK_BYTES])
{
    static const uint8_t of_16_mbit[SIM_BOOT_BLOCK_BYTES] = {
        0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xAA, 0x99, 0x55, 0x66, 0x31, 0xE1,
        0xFF, 0xFF, 0x32, 0x61, 0x00, 0x00, 0x32, 0x81, 0x0B, 0x10, 0x32, 0xA1, 0x00, 0x00, 0x32, 0xC1,
        0x0B, 0x01, 0x30, 0xA1, 0x00, 0x00, 0x33, 0x01, 0x21, 0x00, 0x32, 0x01, 0x00, 0x1F, 0x30, 0xA1,
        0x00, 0x0E, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00, 0x20, 0x00,
    };
    enum { USER_BANK_AT = 25 };
    memcpy(block, of_16_mbit, sizeof of_16_mbit);
    block[USER_BANK_AT] = (uint8_t)(flash_size / 2 >> 16);
}

/* A good image of ours says what card it was made for. */
static bool for_this_board(const struct sim_boot_flash *const flash, const uint8_t *const stamp)
{
    const char *const name = flash->profile->card_name;
    if (memcmp(stamp, sim_stamp, sizeof sim_stamp) != 0)
        return flash->trust; /* a real one */
    return strncmp((const char *)stamp + SIM_STAMP_BOARD_AT, name, SIM_STAMP_BYTES - SIM_STAMP_BOARD_AT) == 0;
}

/* The stamp is that of an image whose check sum is right; NULL = an image that is trusted without. */
static enum sim_boot started(const struct sim_boot_flash *const flash, const uint32_t address,
                             const uint8_t *const stamp)
{
    if (stamp && !for_this_board(flash, stamp))
        return SIM_BOOT_OTHER_BOARD;
    return address >= flash->size / 2 ? SIM_BOOT_USER : SIM_BOOT_FALLBACK;
}

/* ---- Spartan-6 ----------------------------------------------------------------------------------------------------
 */

enum { REG_CRC = 0, REG_FRAMES = 3, REG_CMD = 5, REG_IDCODE = 14, REG_GENERAL1 = 19, REG_GENERAL4 = 22 };
enum { CMD_RESET_CRC = 7, CMD_DESYNC = 13, CMD_IPROG = 14 };
enum { TYPE_1_NOP = 1, TYPE_1_WRITE = 1, TYPE_2 = 2, FRAMES_HEADER = 0x5000 | REG_FRAMES << 5 };

/* The watchdog lets 65535 clocks pass until the sync word, one bit each. */
#define SYNC_WITHIN_BYTES 8191u

struct loading {
    const struct sim_boot_flash *flash;
    uint32_t start, at, crc;
    uint16_t general[4];
    const uint8_t *frames;
    uint32_t frame_bytes;
    bool right_fpga, checked, proven;
};

static bool word(struct loading *const l, unsigned *const value)
{
    if (l->at + 2 > l->flash->size)
        return false;
    *value = (unsigned)l->flash->bytes[l->at] << 8 | l->flash->bytes[l->at + 1];
    l->at += 2;
    return true;
}

static bool find_sync(struct loading *const l)
{
    static const uint8_t sync[] = {0xAA, 0x99, 0x55, 0x66};
    for (uint32_t i = 0; i < SYNC_WITHIN_BYTES && l->start + i + sizeof sync <= l->flash->size; i++) {
        if (memcmp(l->flash->bytes + l->start + i, sync, sizeof sync) != 0)
            continue;
        l->at = l->start + i + (uint32_t)sizeof sync;
        return true;
    }
    return false;
}

/* Two words that must be the sum of what was written so far. */
static bool check_crc(struct loading *const l, const uint32_t value)
{
    l->checked = true;
    l->proven = value == l->crc;
    return l->proven || l->flash->trust;
}

/* A register of so many words is written; false = the FPGA gives up. */
static bool write_register(struct loading *const l, const unsigned reg, const unsigned count)
{
    uint32_t value = 0, crc = l->crc;
    for (unsigned i = 0; i < count; i++) {
        unsigned next;
        if (!word(l, &next))
            return false;
        value = value << 16 | next;
        crc = sim_spartan6_crc(crc, reg, next);
        if (i == 0 && reg >= REG_GENERAL1 && reg <= REG_GENERAL4)
            l->general[reg - REG_GENERAL1] = (uint16_t)next;
    }
    if (reg == REG_CRC)
        return check_crc(l, value);
    l->crc = reg == REG_CMD && value == CMD_RESET_CRC ? 0 : crc;
    if (reg == REG_IDCODE) {
        l->right_fpga = value == l->flash->profile->idcode;
        return l->right_fpga;
    }
    return true;
}

/* Frames, and their check sum behind them. */
static bool take_frames(struct loading *const l)
{
    unsigned high, low, next;
    if (!word(l, &high) || !word(l, &low))
        return false;
    const uint32_t bytes = ((uint32_t)high << 16 | low) * 2u;
    if (high >= 0x80u || bytes > l->flash->size - l->at)
        return false;
    l->frames = l->flash->bytes + l->at;
    l->frame_bytes = bytes;
    for (uint32_t i = 0; i < bytes / 2 && word(l, &next); i++)
        l->crc = sim_spartan6_crc(l->crc, REG_FRAMES, next);
    return word(l, &high) && word(l, &low) && check_crc(l, (uint32_t)high << 16 | low);
}

enum outcome { FAILED, JUMP, LOADED };

static enum outcome run_packets(struct loading *const l)
{
    unsigned header;
    while (word(l, &header)) {
        const unsigned type = header >> 13, op = header >> 11 & 3u, reg = header >> 5 & 0x3Fu, count = header & 0x1Fu;
        if (type == TYPE_2) {
            if (header != FRAMES_HEADER || !take_frames(l))
                return FAILED;
            continue;
        }
        if (type != TYPE_1_NOP)
            return FAILED;
        if (op == 0)
            continue;
        if (reg == REG_CMD && count == 1 && l->at + 2 <= l->flash->size) {
            const unsigned command = l->flash->bytes[l->at + 1];
            if (command == CMD_IPROG)
                return JUMP;
            if (command == CMD_DESYNC)
                return l->frames && l->right_fpga && (l->checked || l->flash->trust) ? LOADED : FAILED;
        }
        if (!write_register(l, reg, count))
            return FAILED;
    }
    return FAILED;
}

static enum outcome load(struct loading *const l, const uint32_t address)
{
    *l = (struct loading){
        .flash = l->flash, .start = address, .general = {l->general[0], l->general[1], l->general[2], l->general[3]}};
    return find_sync(l) ? run_packets(l) : FAILED;
}

static uint32_t address_of(const uint16_t low, const uint16_t high, const uint32_t size)
{
    return ((uint32_t)(high & 0xFFu) << 16 | low) & (size - 1);
}

enum sim_boot sim_boot_xilinx(const struct sim_boot_flash *const flash, struct sim_boot_registers *const registers)
{
    struct loading l = {.flash = flash};
    l.general[2] = (uint16_t)registers->golden;
    l.general[3] = (uint16_t)(registers->golden >> 16);
    uint32_t address = registers->start & (flash->size - 1);
    bool fell_back = false;
    for (unsigned i = 0; i <= MOST_JUMPS; i++) {
        const enum outcome outcome = load(&l, address);
        registers->golden = address_of(l.general[2], l.general[3], flash->size);
        if (outcome == LOADED)
            return started(flash, address, l.proven && l.frame_bytes >= SIM_STAMP_BYTES ? l.frames : NULL);
        if (outcome == JUMP) {
            address = address_of(l.general[0], l.general[1], flash->size);
            continue;
        }
        if (fell_back)
            break;
        fell_back = true;
        address = registers->golden;
    }
    return SIM_BOOT_NOTHING;
}

/* ---- Trion --------------------------------------------------------------------------------------------------------
 */

static enum sim_boot start_trion(const struct sim_boot_flash *const flash, const uint32_t address)
{
    static const uint8_t sync[] = {0x16, 0x8A, 0x22, 0x36};
    const uint8_t *image = flash->bytes + address;
    const uint32_t room = flash->size / 2;
    uint32_t skip = 0;
    while (skip < LINE_FEEDS && image[skip] == '\n')
        skip++;
    image += skip;
    if (memcmp(image, sync, sizeof sync) != 0)
        return SIM_BOOT_NOTHING;
    const uint32_t body_bytes = hm2_get_le32(image + SIM_EFINIX_LENGTH_AT);
    const bool complete = body_bytes >= SIM_STAMP_BYTES && body_bytes <= room - skip - SIM_EFINIX_BODY_AT;
    const bool proven =
        complete && hm2_get_le32(image + SIM_EFINIX_CRC_AT) ==
                        sim_check_sum(sim_check_sum(1, image, SIM_EFINIX_CRC_AT), image + SIM_EFINIX_PART_AT,
                                      body_bytes + SIM_EFINIX_BODY_AT - SIM_EFINIX_PART_AT);
    if (!proven)
        return flash->trust ? started(flash, address, NULL) : SIM_BOOT_NOTHING;
    if (strncmp((const char *)image + SIM_EFINIX_PART_AT, flash->profile->part,
                SIM_EFINIX_BODY_AT - SIM_EFINIX_PART_AT) != 0)
        return SIM_BOOT_NOTHING;
    return started(flash, address, image + SIM_EFINIX_BODY_AT);
}

enum sim_boot sim_boot_efinix(const struct sim_boot_flash *const flash, const bool want_user)
{
    const enum sim_boot user = want_user ? start_trion(flash, flash->size / 2) : SIM_BOOT_NOTHING;
    return user != SIM_BOOT_NOTHING ? user : start_trion(flash, 0);
}
