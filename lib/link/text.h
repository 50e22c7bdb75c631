/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Reading line-oriented text that anybody may have written: bounded spans, no terminators needed, no copies. */
#ifndef LINK_TEXT_H
#define LINK_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct text_span {
    const char *at, *end;
};

struct text_reader {
    struct text_span left;
    unsigned line; /* number of the line last returned, from 1 */
};

/* Next line that has something on it, without its comment ("#" to the end); false at the end of the text. */
bool text_next_line(struct text_reader *reader, struct text_span *line);
/* Next word of a line, removed from it; false when there is none. */
bool text_next_word(struct text_span *line, struct text_span *word);
bool text_is(struct text_span word, const char *expected);
/* Unsigned decimal number of at most `max`. */
bool text_number(struct text_span word, uint64_t max, uint64_t *value);

enum text_hex { TEXT_HEX_OK, TEXT_HEX_DIGIT, TEXT_HEX_ODD, TEXT_HEX_LONG };
/* The rest of a line as bytes: pairs of hexadecimal digits, blanks anywhere, or "-" alone for no bytes at all. */
enum text_hex text_hex_bytes(struct text_span line, uint8_t *bytes, size_t capacity, size_t *len);
/* What to tell a person about it. */
const char *text_hex_reason(enum text_hex result);

#endif
