/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Xilinx .bit files, and the Spartan-6 packets in them up to the frame data (flash tool reference 3.10). */
#include <string.h>

#include "image.h"

#define DUMMY_BYTES 16u

static const uint8_t magic[] = {0x00, 0x09, 0x0F, 0xF0, 0x0F, 0xF0, 0x0F, 0xF0, 0x0F, 0xF0, 0x00, 0x00, 0x01};
static const uint8_t sync_word[4] = {0xAA, 0x99, 0x55, 0x66};

/* Type 1 packet headers that write one register, of one or two words. */
enum {
    TYPE_1_WRITE = 0x3000,
    TYPE_2_WRITE = 0x5000,
    TYPE_MASK = 0xF800,
    REGISTER_SHIFT = 5,
    REGISTER_MASK = 0x3F,
    COUNT_MASK = 0x1F
};
enum {
    REG_CMD = 5,
    REG_COR1 = 10,
    REG_COR2 = 11,
    REG_IDCODE = 14,
    REG_GENERAL1 = 19,
    REG_GENERAL5 = 23,
    REG_MODE = 24
};
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

static void take_register(struct flash_image *const image, const unsigned reg, const unsigned value,
                          bool *const has_cor2)
{
    if ((reg >= REG_GENERAL1 && reg <= REG_GENERAL5) || reg == REG_MODE)
        image->hazards |= FLASH_HAZARD_MULTIBOOT;
    if (reg == REG_COR1 && (value & COR1_CRC_BYPASS))
        image->hazards |= FLASH_HAZARD_NO_CRC;
    if (reg == REG_COR2) {
        *has_cor2 = true;
        if (!(value & COR2_RESET_ON_ERROR))
            image->hazards |= FLASH_HAZARD_NO_RESET;
    }
}

/* Walk over the packets in front of the frame data. The walk is bounded by the payload, each step takes two bytes. */
static void scan_packets(struct flash_image *const image)
{
    const size_t start = image->sync_at + sizeof sync_word;
    struct flash_stream stream = {image->payload + start, image->payload_bytes - start};
    const uint8_t *word;
    bool has_cor2 = false;
    while ((word = flash_take(&stream, 2)) != NULL) {
        const unsigned header = get_be16(word), type = header & TYPE_MASK;
        if (type == TYPE_2_WRITE)
            break; /* frame data */
        if (type != TYPE_1_WRITE)
            continue;
        const unsigned reg = header >> REGISTER_SHIFT & REGISTER_MASK, words = header & COUNT_MASK;
        const uint8_t *const data = flash_take(&stream, 2 * (size_t)words);
        if (!data)
            break;
        if (words > 0)
            take_register(image, reg, get_be16(data), &has_cor2);
        if (reg == REG_IDCODE && words == 2)
            image->idcode = (uint32_t)get_be16(data) << 16 | get_be16(data + 2);
    }
    if (!has_cor2)
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
