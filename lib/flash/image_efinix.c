/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Efinix .bin files (flash tool reference 3.11): lines of text "Key: value", line feeds up to byte 256, then the
 * bitstream. The flash gets everything behind the line PADDED_BITS, so the line feeds too.
 */
#include <string.h>

#include "image.h"

#define SYNC_AT       256u
#define POINTERS_AT   0x48u /* behind the sync word: where the fallback image says the next ones are */
#define POINTER_BYTES 8u

static const uint8_t sync_word[4] = {0x16, 0x8A, 0x22, 0x36};
static const char last_key[] = "PADDED_BITS";

bool flash_efinix_sync(const uint8_t *const data, const size_t len, size_t *const at, bool *const pointers)
{
    size_t i = 0;
    while (i < len && data[i] == '\n')
        i++;
    if (len - i < POINTERS_AT + POINTER_BYTES || memcmp(data + i, sync_word, sizeof sync_word) != 0)
        return false;
    *at = i;
    *pointers = false;
    for (size_t j = 0; j < POINTER_BYTES; j++)
        *pointers = *pointers || data[i + POINTERS_AT + j] != 0;
    return true;
}

struct line {
    const uint8_t *key, *value;
    size_t key_len, value_len;
};

/* Next line of the header; false when it has no end before the bitstream. */
static bool next_line(struct flash_stream *const stream, struct line *const line)
{
    const uint8_t *const end = memchr(stream->data, '\n', stream->left);
    if (!end)
        return false;
    const size_t len = (size_t)(end - stream->data);
    const uint8_t *const text = flash_take(stream, len + 1);
    const uint8_t *const colon = memchr(text, ':', len);
    *line = (struct line){.key = text, .key_len = colon ? (size_t)(colon - text) : 0};
    if (!colon)
        return true;
    line->value = colon + 1;
    line->value_len = len - line->key_len - 1;
    while (line->value_len > 0 && line->value[0] == ' ') {
        line->value++;
        line->value_len--;
    }
    if (line->value_len > 0 && line->value[line->value_len - 1] == '\r')
        line->value_len--;
    return true;
}

/* The end of a long path tells more than its beginning. */
static void copy_tail(char *const to, const struct line *const line)
{
    const size_t room = FLASH_TEXT_BYTES - 1;
    const size_t skip = line->value_len > room ? line->value_len - room : 0;
    flash_copy_text(to, line->value + skip, line->value_len - skip);
}

static void take_line(struct flash_image *const image, const struct line *const line)
{
    const struct {
        const char *key;
        char *field;
    } fields[] = {
        {"Version", image->compiler}, {"Generated", image->generated}, {"Project", image->project},
        {"Family", image->series},    {"Device", image->part},         {"Width", image->width},
        {"Mode", image->mode},        {last_key, image->padded_bits},
    };
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++)
        if (line->key_len == strlen(fields[i].key) && memcmp(line->key, fields[i].key, line->key_len) == 0)
            copy_tail(fields[i].field, line);
}

/* What every image that starts from flash has. */
static int check_fields(const struct flash_image *const image, struct hm2_diag *const diag)
{
    const struct {
        const char *name, *found, *expected;
    } rows[] = {{"Family", image->series, "Trion"},
                {"Mode", image->mode, "active"},
                {"Width", image->width, "1"},
                {last_key, image->padded_bits, "0"}};
    int err = 0;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        if (strcmp(rows[i].found, rows[i].expected) != 0)
            err = hm2_diag_add(diag, HM2_ERR_MALFORMED,
                               "%s is \"%s\", expected \"%s\": the card could not start this "
                               "image from its flash",
                               rows[i].name, rows[i].found, rows[i].expected);
    if (image->part[0] == '\0')
        err = hm2_diag_add(diag, HM2_ERR_MALFORMED,
                           "the header has no line \"Device:\", so nothing says what FPGA the "
                           "image is for");
    return err;
}

int flash_efinix_parse(const uint8_t *const data, const size_t len, struct flash_image *const image,
                       struct hm2_diag *const diag)
{
    struct flash_stream stream = {data, len < SYNC_AT ? len : SYNC_AT};
    struct line line = {0};
    image->family = FLASH_EFINIX;
    do {
        if (!next_line(&stream, &line))
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "the Efinix header has no line %s within its first %u bytes",
                                last_key, SYNC_AT);
        take_line(image, &line);
    } while (image->padded_bits[0] == '\0');
    const size_t header = (size_t)(stream.data - data);
    image->payload = data + header;
    image->payload_bytes = len - header;
    if (!flash_efinix_sync(image->payload, image->payload_bytes, &image->sync_at, &image->pointers) ||
        header + image->sync_at != SYNC_AT)
        return hm2_diag_add(
            diag, HM2_ERR_MALFORMED,
            "no sync word 168A2236 at byte %u, which only line feeds may precede: the file is cut off or "
            "damaged; load it again",
            SYNC_AT);
    return check_fields(image, diag);
}
