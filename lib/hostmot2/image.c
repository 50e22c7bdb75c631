/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Firmware dumps as text: "AAAA VVVVVVVV" in hex, one 32-bit word a line, "#" comments. */
#include <hm2/idrom.h>

#include <string.h>

#define DEFAULT_ROM_ADDRESS 0x0400u /* register map 1.2, for dumps that do not list 0x010C */
#define ROM_BYTES           (HM2_IDROM_WORDS * 4u)
#define ADDRESS_DIGITS      4u
#define VALUE_DIGITS        8u

struct reader {
    const char *text;
    size_t left;
    unsigned line;
};

static bool next_line(struct reader *const reader, const char **const line, size_t *const len)
{
    if (reader->left == 0)
        return false;
    const char *const end = memchr(reader->text, '\n', reader->left);
    const size_t used = end ? (size_t)(end - reader->text) + 1 : reader->left;
    *line = reader->text;
    *len = end ? used - 1 : used;
    reader->text += used;
    reader->left -= used;
    reader->line++;
    return true;
}

static bool blank(const char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

static void trim(const char **const line, size_t *const len)
{
    const char *const comment = memchr(*line, '#', *len);
    if (comment)
        *len = (size_t)(comment - *line);
    while (*len > 0 && blank((*line)[*len - 1]))
        --*len;
    while (*len > 0 && blank(**line)) {
        ++*line;
        --*len;
    }
}

/* Exactly 1..max hex digits from *text on; moves past them. */
static bool take_hex(const char **const text, size_t *const len, const unsigned max, uint32_t *const value)
{
    unsigned digits = 0;
    *value = 0;
    for (; *len > 0; digits++, ++*text, --*len) {
        const char c = **text;
        unsigned digit;
        if (c >= '0' && c <= '9')
            digit = (unsigned)(c - '0');
        else if (c >= 'a' && c <= 'f')
            digit = (unsigned)(c - 'a') + 10u;
        else if (c >= 'A' && c <= 'F')
            digit = (unsigned)(c - 'A') + 10u;
        else
            break;
        if (digits == max)
            return false;
        *value = *value << 4 | digit;
    }
    return digits > 0;
}

static bool split_line(const char *line, size_t len, uint32_t *const address, uint32_t *const value)
{
    if (!take_hex(&line, &len, ADDRESS_DIGITS, address) || len == 0 || !blank(*line))
        return false;
    trim(&line, &len);
    return take_hex(&line, &len, VALUE_DIGITS, value) && len == 0 && *address % 4u == 0;
}

/* Next word of the text: 1, 0 at the end, or an error with the line in diag. */
static int next_word(struct reader *const reader, uint32_t *const address, uint32_t *const value,
                     struct hm2_diag *const diag)
{
    const char *line;
    size_t len;
    while (next_line(reader, &line, &len)) {
        trim(&line, &len);
        if (len == 0)
            continue;
        if (split_line(line, len, address, value))
            return 1;
        return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                            "line %u: \"%.*s\" found, expected a word address (multiple of 4, up to 4 hex digits), a "
                            "blank and a value (up to 8 hex digits)",
                            reader->line, (int)(len < 40 ? len : 40), line);
    }
    return 0;
}

/* The ROM may stand anywhere: its place is needed before its words are. */
static int find_rom(struct reader reader, uint32_t *const rom_address, struct hm2_diag *const diag)
{
    uint32_t address = 0, value = 0;
    int more;
    *rom_address = DEFAULT_ROM_ADDRESS;
    while ((more = next_word(&reader, &address, &value, diag)) > 0)
        if (address == HM2_ADDR_IDROM_POINTER)
            *rom_address = value & 0xFFFFu;
    return more;
}

int hm2_image_from_text(const char *const text, const size_t len, struct hm2_image *const image,
                        struct hm2_diag *const diag)
{
    struct reader reader = {.text = text, .left = len};
    uint32_t rom_address, address = 0, value = 0;
    memset(image, 0, sizeof *image);
    int more = find_rom(reader, &rom_address, diag);
    if (more < 0)
        return more;
    while ((more = next_word(&reader, &address, &value, diag)) > 0) {
        if (address >= HM2_ADDR_COOKIE && address <= HM2_ADDR_IDROM_POINTER)
            image->id[(address - HM2_ADDR_COOKIE) / 4u] = value;
        else if (address >= rom_address && address - rom_address < ROM_BYTES)
            image->rom[(address - rom_address) / 4u] = value;
        else
            return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                                "line %u: address 0x%04X found, expected 0x0100 to 0x010C or a word of the ROM, which "
                                "starts at 0x%04X and has %u bytes",
                                reader.line, (unsigned)address, (unsigned)rom_address, ROM_BYTES);
    }
    return more;
}
