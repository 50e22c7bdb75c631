/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Image files: headers as real ones have them (flash tool reference 3.10, 3.11), and a body of our own. */
#include <stdio.h>
#include <string.h>

#include <hm2/bytes.h>

#include "boot.h"
#include "card_state.h"
#include "lbp16_engine.h"
#include "prng.h"
#include "profiles.h"

#define PAGE             256u
#define EFINIX_HEADER    256u
#define EFINIX_USER      678650u
#define EFINIX_FALLBACK  680000u
#define XILINX_SLX9      340604u
#define XILINX_SLX16     464196u
#define XILINX_SLX25     801462u
#define COR1             0x3D00u
#define COR1_CRC_BYPASS  0x0010u
#define COR2             0x8DECu
#define COR2_RESET       0x8000u
#define ZERO_PAGES_OF_16 5u /* 13 to 45 % of a real image's pages are zero (3.12) */

/* Bytes with room checked once for all: what does not fit is dropped, and len goes on. */
struct writer {
    uint8_t *out;
    size_t len, capacity;
};

static void put(struct writer *const w, const void *const bytes, const size_t count)
{
    if (w->len + count <= w->capacity)
        memcpy(w->out + w->len, bytes, count);
    w->len += count;
}

static void put_be16(struct writer *const w, const unsigned value)
{
    const uint8_t bytes[2] = {(uint8_t)(value >> 8), (uint8_t)value};
    put(w, bytes, sizeof bytes);
}

static void put_be32(struct writer *const w, const uint32_t value)
{
    put_be16(w, value >> 16);
    put_be16(w, value & 0xFFFFu);
}

static const char *given(const char *const text, const char *const otherwise)
{
    return text ? text : otherwise;
}

/* ---- body -------------------------------------------------------------------------------------------------------- */

static void put_random(struct writer *const w, uint64_t random, const size_t count)
{
    static const uint8_t zeros[PAGE];
    uint8_t page[PAGE];
    for (size_t done = 0; done < count;) {
        const size_t piece = count - done < PAGE ? count - done : PAGE;
        const bool blank = sim_prng_below(&random, 16) < ZERO_PAGES_OF_16;
        for (size_t i = 0; i < PAGE && !blank; i += 8) {
            const uint64_t eight = sim_prng_next(&random);
            memcpy(page + i, &eight, 8);
        }
        put(w, blank ? zeros : page, piece);
        done += piece;
    }
}

static void put_body(struct writer *const w, const struct sim_flash_file *const file,
                     const struct sim_profile *const profile, const size_t count)
{
    char board[SIM_STAMP_BYTES - SIM_STAMP_BOARD_AT] = {0};
    const char *const name = given(file->board, profile->card_name);
    memcpy(board, name, strnlen(name, sizeof board));
    put(w, sim_stamp, sizeof sim_stamp);
    put(w, board, sizeof board);
    const size_t rest = count - SIM_STAMP_BYTES;
    const size_t late = file->late_bytes < rest ? file->late_bytes : rest;
    put_random(w, file->seed, rest - late);
    put_random(w, file->late_seed, late);
}

/* ---- Xilinx ------------------------------------------------------------------------------------------------------ */

static void put_text(struct writer *const w, const char key, const char *const text)
{
    put(w, &key, 1);
    put_be16(w, (unsigned)strlen(text) + 1);
    put(w, text, strlen(text) + 1);
}

enum { XILINX_BEFORE = 16 + 4 + 4 + 4 + 6 + 4 + 24 + 4 + 6 + 6, XILINX_BEHIND = 4 + 4 + 6 + 4 + 28 };

/* The sum so far of words written to a register, from a place in the file on. */
static uint32_t sum_words(const struct writer *const w, uint32_t crc, const unsigned reg, size_t at, const size_t end)
{
    for (; at + 2 <= end && end <= w->capacity; at += 2)
        crc = sim_spartan6_crc(crc, reg, (unsigned)w->out[at] << 8 | w->out[at + 1]);
    return crc;
}

/* A register of one word, or two, and what that does to the sum. */
static uint32_t put_register(struct writer *const w, const uint32_t crc, const unsigned reg, const unsigned words,
                             const uint32_t value)
{
    put_be16(w, 0x3000u | reg << 5 | words);
    const size_t at = w->len;
    if (words == 2)
        put_be32(w, value);
    else
        put_be16(w, value);
    return sum_words(w, crc, reg, at, w->len);
}

/* The registers GENERAL1 to 5 and MODE, or no-operations in their place. */
static uint32_t put_boot_registers(struct writer *const w, uint32_t crc, const bool multiboot)
{
    static const unsigned registers[] = {19, 20, 21, 22, 23, 24};
    for (size_t i = 0; i < sizeof registers / sizeof registers[0]; i++) {
        if (multiboot)
            crc = put_register(w, crc, registers[i], 1, 0);
        else
            put_be32(w, 0x20002000u);
    }
    return crc;
}

/* In the order of real files: the sum begins anew with a command, and is compared behind the frames and at the end. */
static void put_packets(struct writer *const w, const struct sim_flash_file *const file,
                        const struct sim_profile *const profile, const size_t frame_bytes)
{
    enum { REG_CRC = 0, REG_FRAME_ADDRESS = 1, REG_FRAMES = 3, REG_CMD = 5, REG_COR1 = 10, REG_COR2, REG_IDCODE = 14 };
    enum { CMD_WRITE = 1, CMD_START = 5, CMD_RESET_CRC = 7, CMD_DESYNC = 13 };
    static const uint8_t dummy[16] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF,
                                      0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};
    put(w, dummy, sizeof dummy);
    put_be32(w, file->faults & SIM_FILE_NO_SYNC ? 0xAA995567u : 0xAA995566u);
    (void)put_register(w, 0, REG_CMD, 1, CMD_RESET_CRC);
    uint32_t crc = put_register(w, 0, REG_COR1, 1, COR1 | (file->faults & SIM_FILE_NO_CRC ? COR1_CRC_BYPASS : 0));
    crc = put_register(w, crc, REG_COR2, 1, file->faults & SIM_FILE_NO_RESET_ON_ERROR ? COR2 & ~COR2_RESET : COR2);
    crc = put_register(w, crc, REG_IDCODE, 2, file->idcode ? file->idcode : profile->idcode);
    crc = put_boot_registers(w, crc, file->faults & SIM_FILE_MULTIBOOT);
    crc = put_register(w, crc, REG_CMD, 1, CMD_WRITE);
    crc = put_register(w, crc, REG_FRAME_ADDRESS, 2, 0);
    put_be16(w, 0x5000u | REG_FRAMES << 5);
    put_be32(w, (uint32_t)(frame_bytes / 2));
    const size_t frames = w->len;
    put_body(w, file, profile, frame_bytes);
    crc = sum_words(w, crc, REG_FRAMES, frames, w->len);
    put_be32(w, crc);
    crc = put_register(w, crc, REG_CMD, 1, CMD_START);
    (void)put_register(w, crc, REG_CRC, 2, crc);
    (void)put_register(w, 0, REG_CMD, 1, CMD_DESYNC);
    for (unsigned i = 0; i < 14; i++)
        put_be16(w, 0x2000);
}

static void put_xilinx(struct writer *const w, const struct sim_flash_file *const file,
                       const struct sim_profile *const profile)
{
    static const uint8_t head[] = {0x00, 0x09, 0x0F, 0xF0, 0x0F, 0xF0, 0x0F, 0xF0, 0x0F, 0xF0, 0x00, 0x00, 0x01};
    const size_t real = profile->idcode == SIM_IDCODE_SLX25   ? XILINX_SLX25
                        : profile->idcode == SIM_IDCODE_SLX16 ? XILINX_SLX16
                                                              : XILINX_SLX9;
    const size_t least = XILINX_BEFORE + SIM_STAMP_BYTES + XILINX_BEHIND;
    const size_t bytes = file->bytes > least ? file->bytes & ~(size_t)1 : file->bytes > 0 ? least : real;
    put(w, head, sizeof head);
    put_text(w, 'a', given(file->design, "TopEthernetHostMot2.ncd;UserID=0xFFFFFFFF"));
    put_text(w, 'b', given(file->part, profile->part));
    put_text(w, 'c', "2016/06/01");
    put_text(w, 'd', "17:37:31");
    put(w, "e", 1);
    put_be32(w, (uint32_t)bytes);
    put_packets(w, file, profile, bytes - XILINX_BEFORE - XILINX_BEHIND);
}

/* ---- Efinix ------------------------------------------------------------------------------------------------------ */

/* mesaflash misreads headers whose project line is longer than 78 characters. */
#define PROJECT "/home/builder/efinity/2021.2/project/"

static void put_efinix_header(struct writer *const w, const struct sim_flash_file *const file,
                              const struct sim_profile *const profile)
{
    char project[128], text[EFINIX_HEADER + 1];
    snprintf(project, sizeof project, PROJECT "%s", profile->name);
    const int len =
        snprintf(text, sizeof text,
                 "Version: 2021.2.323.4.6\nGenerated: Mon Jun  5 12:41:51 2023\n\nProject: %s\nFamily: "
                 "%s\nDevice: %s\nWidth: %s\nMode: %s\nPADDED_BITS: %s\n",
                 given(file->project, project), given(file->series, "Trion"), given(file->part, profile->part),
                 given(file->width, "1"), given(file->mode, "active"), given(file->padded_bits, "0"));
    const size_t used = len > 0 && (size_t)len < EFINIX_HEADER ? (size_t)len : EFINIX_HEADER;
    memset(text + used, '\n', sizeof text - used);
    put(w, text, EFINIX_HEADER);
}

static void put_efinix(struct writer *const w, const struct sim_flash_file *const file,
                       const struct sim_profile *const profile)
{
    static const uint8_t sync[] = {0x16, 0x8A, 0x22, 0x36, 0xFF, 0xF2};
    static const uint8_t pointers[] = {0x0D, 0x30, 0x00, 0x0D, 0x30, 0x00, 0x08, 0x00};
    const bool fallback = file->area == SIM_AREA_FALLBACK;
    const size_t real = fallback ? EFINIX_FALLBACK : EFINIX_USER;
    const size_t least = EFINIX_HEADER + SIM_EFINIX_BODY_AT + SIM_STAMP_BYTES;
    const size_t bytes = file->bytes > least ? file->bytes : file->bytes > 0 ? least : real;
    const size_t padding = fallback && bytes == EFINIX_FALLBACK ? EFINIX_FALLBACK - EFINIX_USER : 0;
    const size_t body = bytes - padding - EFINIX_HEADER - SIM_EFINIX_BODY_AT;
    uint8_t head[SIM_EFINIX_BODY_AT] = {0};
    memcpy(head, sync, sizeof sync);
    head[0] ^= file->faults & SIM_FILE_NO_SYNC ? 1 : 0;
    if (fallback)
        memcpy(head + SIM_EFINIX_POINTER_AT, pointers, sizeof pointers);
    hm2_put_le32(head + SIM_EFINIX_LENGTH_AT, (uint32_t)body);
    const char *const part = given(file->part, profile->part);
    memcpy(head + SIM_EFINIX_PART_AT, part, strnlen(part, SIM_EFINIX_BODY_AT - SIM_EFINIX_PART_AT));
    put_efinix_header(w, file, profile);
    const size_t sync_at = w->len;
    put(w, head, sizeof head);
    put_body(w, file, profile, body);
    if (w->len <= w->capacity) {
        const uint32_t before = sim_check_sum(1, w->out + sync_at, SIM_EFINIX_CRC_AT);
        const uint8_t *const behind = w->out + sync_at + SIM_EFINIX_PART_AT;
        hm2_put_le32(w->out + sync_at + SIM_EFINIX_CRC_AT,
                     sim_check_sum(before, behind, w->len - sync_at - SIM_EFINIX_PART_AT));
    }
    static const uint8_t erased[4] = {0xFF, 0xFF, 0xFF, 0xFF};
    for (size_t i = 0; i < padding; i += sizeof erased)
        put(w, erased, padding - i < sizeof erased ? padding - i : sizeof erased);
}

/* ---- for callers ------------------------------------------------------------------------------------------------- */

size_t sim_flash_file(const struct sim_flash_file *const file, uint8_t *const out, const size_t capacity)
{
    const struct sim_profile *const profile = sim_profile_find(file->profile);
    struct writer w = {.out = out, .capacity = capacity};
    if (!profile)
        return 0;
    if (profile->efinix)
        put_efinix(&w, file, profile);
    else
        put_xilinx(&w, file, profile);
    return w.len <= capacity ? w.len : 0;
}

/* What goes into the flash: behind key e and its length, or behind the header's last line. */
static size_t payload_at(const bool efinix, const uint8_t *const bytes, const size_t len)
{
    if (!efinix) {
        size_t at = 13;
        for (unsigned i = 0; i < 4; i++)
            at += 3 + ((size_t)bytes[at + 1] << 8 | bytes[at + 2]);
        return at + 5;
    }
    size_t at = len < EFINIX_HEADER ? len : EFINIX_HEADER;
    while (at > 1 && bytes[at - 2] == '\n')
        at--;
    return at;
}

size_t sim_card_install(struct sim_card *const card, const struct sim_flash_file *const file)
{
    struct sim_spi_flash *const flash = &card->lbp16->flash;
    const bool efinix = card->profile->efinix;
    const uint32_t fallback = efinix ? 0 : SIM_FLASH_SECTOR_BYTES;
    const uint32_t at = file->area == SIM_AREA_USER ? flash->size / 2 : fallback;
    const size_t room = file->area == SIM_AREA_USER ? flash->size / 2 : flash->size / 2 - fallback;
    /* The file is made in its place, then its header goes. */
    uint8_t *const bytes = flash->bytes + at;
    const size_t len = sim_flash_file(file, bytes, room);
    if (len == 0)
        return 0;
    const size_t header = payload_at(efinix, bytes, len);
    memmove(bytes, bytes + header, len - header);
    memset(bytes + len - header, 0xFF, room - (len - header));
    return len - header;
}
