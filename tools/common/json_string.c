/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "json_string.h"

#include <stdbool.h>
#include <stddef.h>

#define LAST_BYTE 0xBFu

/* How a sequence of UTF-8 may begin (RFC 3629): the bounds of its second byte keep overlong forms, surrogates and what
 * is beyond Unicode out. */
static const struct lead {
    unsigned char first, last, second_least, second_most;
    size_t len;
} leads[] = {
    {0xC2, 0xDF, 0x80, LAST_BYTE, 2}, {0xE0, 0xE0, 0xA0, LAST_BYTE, 3}, {0xE1, 0xEC, 0x80, LAST_BYTE, 3},
    {0xED, 0xED, 0x80, 0x9F, 3},      {0xEE, 0xEF, 0x80, LAST_BYTE, 3}, {0xF0, 0xF0, 0x90, LAST_BYTE, 4},
    {0xF1, 0xF3, 0x80, LAST_BYTE, 4}, {0xF4, 0xF4, 0x80, 0x8F, 4},
};

/* Bytes of the sequence that stands there, 0 when none does. The text's end is no byte of a sequence. */
static size_t sequence(const unsigned char *const at)
{
    for (size_t i = 0; i < sizeof leads / sizeof leads[0]; i++) {
        const struct lead *const lead = &leads[i];
        if (at[0] < lead->first || at[0] > lead->last)
            continue;
        if (at[1] < lead->second_least || at[1] > lead->second_most)
            return 0;
        for (size_t k = 2; k < lead->len; k++)
            if (at[k] < 0x80u || at[k] > LAST_BYTE)
                return 0;
        return lead->len;
    }
    return 0;
}

void json_string(FILE *const out, const char *const text)
{
    (void)fputc('"', out);
    for (const unsigned char *at = (const unsigned char *)text; *at;) {
        const size_t len = sequence(at);
        if (len)
            (void)fwrite(at, 1, len, out);
        else if (*at < ' ' || *at > '~')
            (void)fprintf(out, "\\u%04x", *at);
        else
            (void)fprintf(out, *at == '"' || *at == '\\' ? "\\%c" : "%c", *at);
        at += len ? len : 1;
    }
    (void)fputc('"', out);
}
