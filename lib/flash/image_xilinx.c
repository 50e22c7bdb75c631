/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Xilinx .bit files, and the Spartan-6 packets in them (flash tool reference 3.10). */
#include <string.h>

#include "image.h"

#define DUMMY_BYTES 16u

static const uint8_t magic[] = {0x00, 0x09, 0x0F, 0xF0, 0x0F, 0xF0, 0x0F, 0xF0, 0x0F, 0xF0, 0x00, 0x00, 0x01};
static const uint8_t sync_word[4] = {0xAA, 0x99, 0x55, 0x66};

/* A packet header: type, what to do, register, number of words that follow (in type 2 they have a word of their own).
 */
enum { TYPE_SHIFT = 13, OP_SHIFT = 11, OP_MASK = 3, REGISTER_SHIFT = 5, REGISTER_MASK = 0x3F, COUNT_MASK = 0x1F };
enum { TYPE_1 = 1, OP_NOP = 0, OP_WRITE = 2 };
enum {
    REG_CRC = 0,
    REG_FRAMES = 3,
    REG_CMD = 5,
    REG_COR1 = 10,
    REG_COR2 = 11,
    REG_IDCODE = 14,
    REG_GENERAL1 = 19,
    REG_GENERAL5 = 23,
    REG_MODE = 24
};
enum { CMD_RESET_CRC = 7, CMD_DESYNC = 13 };
#define FRAMES_HEADER       (0x5000u | REG_FRAMES << 5) /* type 2: the number of words has two words of its own */
#define COR2_RESET_ON_ERROR 0x8000u
#define COR1_CRC_BYPASS     0x0010u

static unsigned get_be16(const uint8_t *const p)
{
    return (unsigned)p[0] << 8 | p[1];
}

bool flash_xilinx_sync(const uint8_t *const data, const size_t len, size_t *const at)
{
    size_t i = 0;
    while (i < len && data[i] == FLASH_ERASED)
        i++;
    if (i < DUMMY_BYTES || len - i < sizeof sync_word || memcmp(data + i, sync_word, sizeof sync_word) != 0)
        return false;
    *at = i;
    return true;
}

/* One text of the header: key, length, bytes. */
static int take_text(struct flash_stream *const stream, const char key, char *const to, struct hm2_diag *const diag)
{
    const uint8_t *const head = flash_take(stream, 3);
    const uint8_t *const text = head && head[0] == (uint8_t)key ? flash_take(stream, get_be16(head + 1)) : NULL;
    if (!text)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                            "Invalid bitfile header: field '%c' is missing or longer than the file", key);
    flash_copy_text(to, text, get_be16(head + 1));
    return 0;
}

static int take_payload(struct flash_stream *const stream, struct flash_image *const image, struct hm2_diag *const diag)
{
    const uint8_t *const head = flash_take(stream, 5);
    if (!head || head[0] != 'e')
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "Invalid bitfile header: field 'e' (the data) is missing");
    const size_t len = (size_t)get_be16(head + 1) << 16 | get_be16(head + 3);
    if (len != stream->left)
        return hm2_diag_add(
            diag, HM2_ERR_MALFORMED,
            "the header announces %zu bytes of data and the file has %zu: it is cut off or damaged; load "
            "it again",
            len, stream->left);
    image->payload = stream->data;
    image->payload_bytes = len;
    return 0;
}

uint32_t flash_spartan6_crc(const uint32_t crc, const unsigned reg, const unsigned word)
{
    const uint32_t taps = crc >> 21 & 1u ? 0x009081u : 0;
    return ((crc << 1 & 0x3FFFFFu) ^ taps ^ ((uint32_t)reg << 16 | word)) & 0x3FFFFFu;
}

struct scan {
    struct flash_stream stream;
    struct flash_image *image;
    uint32_t crc;
    bool has_cor2, frames, checked, ended;
};

static void take_register(struct scan *const scan, const unsigned reg, const unsigned value)
{
    struct flash_image *const image = scan->image;
    if ((reg >= REG_GENERAL1 && reg <= REG_GENERAL5) || reg == REG_MODE)
        image->hazards |= FLASH_HAZARD_MULTIBOOT;
    if (reg == REG_COR1 && (value & COR1_CRC_BYPASS))
        image->hazards |= FLASH_HAZARD_NO_CRC;
    if (reg == REG_COR2) {
        scan->has_cor2 = true;
        if (!(value & COR2_RESET_ON_ERROR))
            image->hazards |= FLASH_HAZARD_NO_RESET;
    }
}

/* Two words that the FPGA compares with its own sum. Without check sum the tool writes something else there. */
static void compare_crc(struct scan *const scan, const uint8_t *const data)
{
    const uint32_t value = (uint32_t)get_be16(data) << 16 | get_be16(data + 2);
    scan->checked = true;
    if (value != scan->crc && !(scan->image->hazards & FLASH_HAZARD_NO_CRC))
        scan->image->hazards |= FLASH_HAZARD_DAMAGED;
}

/* Words written to one register; false when the file has fewer. */
static bool take_words(struct scan *const scan, const unsigned reg, const size_t words)
{
    const uint8_t *const data = words <= scan->stream.left / 2 ? flash_take(&scan->stream, 2 * words) : NULL;
    if (!data)
        return false;
    if (words == 2 && reg == REG_CRC) {
        compare_crc(scan, data);
        return true;
    }
    if (words > 0)
        take_register(scan, reg, get_be16(data));
    if (words == 2 && reg == REG_IDCODE)
        scan->image->idcode = (uint32_t)get_be16(data) << 16 | get_be16(data + 2);
    for (size_t i = 0; i < words; i++)
        scan->crc = flash_spartan6_crc(scan->crc, reg, get_be16(data + 2 * i));
    if (words == 1 && reg == REG_CMD && get_be16(data) == CMD_RESET_CRC)
        scan->crc = 0;
    scan->ended = scan->ended || (words == 1 && reg == REG_CMD && get_be16(data) == CMD_DESYNC);
    return true;
}

/* Frame data, and the check sum right behind them. */
static bool take_frames(struct scan *const scan)
{
    const uint8_t *const count = flash_take(&scan->stream, 4);
    if (!count || !take_words(scan, REG_FRAMES, (size_t)get_be16(count) << 16 | get_be16(count + 2)))
        return false;
    const uint8_t *const sum = flash_take(&scan->stream, 4);
    scan->frames = true;
    if (sum)
        compare_crc(scan, sum);
    return sum != NULL;
}

/* One packet; false at the end, or where what follows is no packet. */
static bool take_packet(struct scan *const scan)
{
    const uint8_t *const word = flash_take(&scan->stream, 2);
    if (!word || scan->ended)
        return false;
    const unsigned header = get_be16(word), type = header >> TYPE_SHIFT, op = header >> OP_SHIFT & OP_MASK;
    const unsigned reg = header >> REGISTER_SHIFT & REGISTER_MASK;
    bool whole = true;
    if (header == FRAMES_HEADER)
        whole = take_frames(scan);
    else if (type == TYPE_1 && op == OP_WRITE)
        whole = take_words(scan, reg, header & COUNT_MASK);
    else if (type != TYPE_1 || op != OP_NOP)
        return false;
    if (!whole)
        scan->image->hazards |= FLASH_HAZARD_DAMAGED;
    return whole;
}

/* Walk over the packets; each takes two bytes at least. */
static void scan_packets(struct flash_image *const image)
{
    const size_t start = image->sync_at + sizeof sync_word;
    struct scan scan = {.stream = {image->payload + start, image->payload_bytes - start}, .image = image};
    while (take_packet(&scan))
        ;
    if (!scan.ended || !scan.frames)
        image->hazards |= FLASH_HAZARD_DAMAGED;
    if (!scan.checked)
        image->hazards |= FLASH_HAZARD_NO_CRC;
    if (!scan.has_cor2)
        image->hazards |= FLASH_HAZARD_NO_RESET;
    if (image->idcode == 0)
        image->hazards |= FLASH_HAZARD_NO_IDCODE;
}

int flash_xilinx_parse(const uint8_t *const data, const size_t len, struct flash_image *const image,
                       struct hm2_diag *const diag)
{
    struct flash_stream stream = {data, len};
    image->family = FLASH_XILINX;
    const uint8_t *const head = flash_take(&stream, sizeof magic);
    if (!head || memcmp(head, magic, sizeof magic) != 0)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                            "Invalid bitfile header! The file is neither a Xilinx .bit nor an Efinix .bin");
    const struct {
        char key, *field;
    } texts[] = {{'a', image->design}, {'b', image->part}, {'c', image->date}, {'d', image->time}};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        if (take_text(&stream, texts[i].key, texts[i].field, diag) != 0)
            return HM2_ERR_MALFORMED;
    const int err = take_payload(&stream, image, diag);
    if (err < 0)
        return err;
    if (!flash_xilinx_sync(image->payload, image->payload_bytes, &image->sync_at))
        return hm2_diag_add(
            diag, HM2_ERR_MALFORMED,
            "the data do not begin with 16 bytes FF and the sync word AA995566: the file is damaged, or "
            "no Spartan-6 bitstream");
    scan_packets(image);
    return 0;
}
