/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Which kind of file is it? */
#include <string.h>

#include "image.h"

#define FILLER_DISTANCE 8192u /* mesaflash reads files in pieces of this size into one buffer (3.7) */
#define MIN_FILE_BYTES  14u

static const char efinix_magic[] = "Version";

void flash_copy_text(char *const to, const uint8_t *const from, const size_t len)
{
    const size_t room = FLASH_TEXT_BYTES - 1;
    size_t count = 0;
    for (; count < len && count < room && from[count]; count++)
        to[count] = (char)(from[count] < ' ' || from[count] > '~' ? '?' : from[count]);
    to[count] = '\0';
}

static int hex_digit(const char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    if (c >= 'a' && c <= 'f')
        return c - 'a' + 10;
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

static bool looks_like_hex(const uint8_t *const data)
{
    for (unsigned i = 0; i < 2; i++)
        if (hex_digit((char)data[i]) < 0)
            return false;
    return data[2] == '\n' || data[2] == '\r';
}

int flash_image_parse(const uint8_t *const data, const size_t len, struct flash_image *const image,
                      struct hm2_diag *const diag)
{
    memset(image, 0, sizeof *image);
    if (len < MIN_FILE_BYTES)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                            "the file ends after %zu bytes; an image has a header of at least %u", len, MIN_FILE_BYTES);
    if (memcmp(data, efinix_magic, sizeof efinix_magic - 1) == 0)
        return flash_efinix_parse(data, len, image, diag);
    if (memcmp(data, "\xFF\xFF\xFF\xFF", 4) == 0)
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                            "the file is a raw .bin without a header, which does not say what FPGA it is for; take the "
                            ".bit file of the same build");
    if (looks_like_hex(data))
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                            "the file is a .hex file (for JTAG loaders); take the .bin file of the same build");
    return flash_xilinx_parse(data, len, image, diag);
}

uint8_t flash_image_byte(const struct flash_image *const image, const size_t offset)
{
    if (offset < image->payload_bytes)
        return image->payload[offset];
    if (offset >= FILLER_DISTANCE && offset - FILLER_DISTANCE < image->payload_bytes)
        return image->payload[offset - FILLER_DISTANCE];
    return FLASH_ERASED;
}

int flash_side_file_parse(const char *const text, const size_t len, uint8_t hash[const FLASH_SHA256_BYTES],
                          struct hm2_diag *const diag)
{
    const size_t digits = (size_t)2 * FLASH_SHA256_BYTES;
    if (len < digits)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "the checksum file has %zu bytes, a SHA-256 has %zu digits", len,
                            digits);
    for (size_t i = 0; i < FLASH_SHA256_BYTES; i++) {
        const int high = hex_digit(text[2 * i]), low = hex_digit(text[2 * i + 1]);
        if (high < 0 || low < 0)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                                "character %zu of the checksum file is no hexadecimal digit; expected a SHA-256 of %zu "
                                "digits at its beginning",
                                2 * i + (high < 0 ? 1u : 2u), digits);
        hash[i] = (uint8_t)(high << 4 | low);
    }
    if (len > digits && text[digits] != ' ' && text[digits] != '\t' && text[digits] != '\n' && text[digits] != '\r')
        return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                            "the checksum file goes on after %zu digits without a blank: no SHA-256", digits);
    return 0;
}

static bool is_blank(const char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

/* One line: 1 when its hash is the wanted one. */
static int known_line(const char *line, size_t len, const uint8_t hash[const FLASH_SHA256_BYTES],
                      char card[const FLASH_TEXT_BYTES], struct hm2_diag *const diag)
{
    const size_t digits = (size_t)2 * FLASH_SHA256_BYTES;
    uint8_t found[FLASH_SHA256_BYTES];
    while (len > 0 && is_blank(line[len - 1]))
        len--;
    if (len == 0 || line[0] == '#')
        return 0;
    const int err = flash_side_file_parse(line, len, found, diag);
    if (err < 0)
        return err;
    for (line += digits, len -= digits; len > 0 && is_blank(line[0]); len--)
        line++;
    if (len == 0)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "no card stands behind the SHA-256");
    for (size_t i = 0; i < len; i++)
        if (line[i] < ' ' || line[i] > '~')
            return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                                "the card behind the SHA-256 has characters no card's name has");
    if (memcmp(found, hash, sizeof found) != 0)
        return 0;
    flash_copy_text(card, (const uint8_t *)line, len);
    return 1;
}

int flash_known_image(const char *const text, const size_t len, const uint8_t hash[const FLASH_SHA256_BYTES],
                      char card[const FLASH_TEXT_BYTES], struct hm2_diag *const diag)
{
    struct flash_stream stream = {(const uint8_t *)text, len};
    int result = 0;
    for (unsigned number = 1; result == 0 && stream.left > 0; number++) {
        const uint8_t *const end = memchr(stream.data, '\n', stream.left);
        const size_t bytes = end ? (size_t)(end - stream.data) : stream.left;
        result = known_line((const char *)stream.data, bytes, hash, card, diag);
        if (result < 0)
            (void)hm2_diag_add(diag, result, "that is line %u of the list of known images", number);
        (void)flash_take(&stream, end ? bytes + 1 : bytes);
    }
    return result;
}
