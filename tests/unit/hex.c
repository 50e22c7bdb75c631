/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "hex.h"

#include <ctype.h>

#include "unit.h"

size_t hex_bytes(const char *text, uint8_t *const data, const size_t capacity)
{
    size_t digits = 0;
    for (; *text; text++) {
        if (isspace((unsigned char)*text))
            continue;
        if (!isxdigit((unsigned char)*text) || digits / 2 >= capacity)
            fail_msg("bad or too long hexadecimal text at \"%s\"", text);
        const int digit = isdigit((unsigned char)*text) ? *text - '0' : tolower((unsigned char)*text) - 'a' + 10;
        data[digits / 2] = (uint8_t)(digits % 2 ? data[digits / 2] << 4 | digit : digit);
        digits++;
    }
    if (digits % 2)
        fail_msg("odd number of hexadecimal digits");
    return digits / 2;
}
