/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Checksum files: accepted when they begin with 64 hexadecimal digits and nothing that prolongs them. The same bytes as
 * a list of known images: a name that it gives is one that can be printed. */
#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/flash.h>

#define DIGITS (2u * FLASH_SHA256_BYTES)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void look_up(const char *const text, const size_t size)
{
    static const uint8_t hash[FLASH_SHA256_BYTES] = {0}; /* inputs can have it */
    struct hm2_diag diag = {0};
    char card[FLASH_TEXT_BYTES];
    const int found = flash_known_image(text, size, hash, card, &diag);
    if ((found < 0) != (diag.problems != 0) || found > 1)
        abort();
    if (found != 1)
        return;
    if (!memchr(card, '\0', sizeof card) || !card[0])
        abort();
    for (const char *c = card; *c; c++)
        if (*c < ' ' || *c > '~')
            abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    uint8_t hash[FLASH_SHA256_BYTES];
    struct hm2_diag diag = {0};
    char *const text = malloc(size + 1);
    if (!text)
        return 0;
    if (size > 0)
        memcpy(text, data, size);
    bool expected = size >= DIGITS;
    for (size_t i = 0; expected && i < DIGITS; i++)
        expected = isxdigit(data[i]);
    if (expected && size > DIGITS)
        expected = data[DIGITS] && strchr(" \t\r\n", data[DIGITS]);
    const int err = flash_side_file_parse(text, size, hash, &diag);
    look_up(text, size);
    free(text);
    if ((err == 0) != expected || (err == 0) != (diag.problems == 0))
        abort();
    return 0;
}
