/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "text.h"

#include <string.h>

static bool is_blank(const char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

static void trim(struct text_span *const span)
{
    while (span->at < span->end && is_blank(*span->at))
        span->at++;
    while (span->end > span->at && is_blank(span->end[-1]))
        span->end--;
}

static const char *find(const struct text_span span, const char c)
{
    const char *const found = span.at < span.end ? memchr(span.at, c, (size_t)(span.end - span.at)) : NULL;
    return found ? found : span.end;
}

bool text_next_line(struct text_reader *const reader, struct text_span *const line)
{
    while (reader->left.at < reader->left.end) {
        const char *const end = find(reader->left, '\n');
        *line = (struct text_span){reader->left.at, end};
        reader->left.at = end < reader->left.end ? end + 1 : end;
        reader->line++;
        line->end = find(*line, '#');
        trim(line);
        if (line->at < line->end)
            return true;
    }
    return false;
}

bool text_next_word(struct text_span *const line, struct text_span *const word)
{
    trim(line);
    *word = (struct text_span){line->at, line->at};
    while (word->end < line->end && !is_blank(*word->end))
        word->end++;
    line->at = word->end;
    return word->at < word->end;
}

bool text_is(const struct text_span word, const char *const expected)
{
    const size_t len = strlen(expected);
    return (size_t)(word.end - word.at) == len && memcmp(word.at, expected, len) == 0;
}

bool text_number(const struct text_span word, const uint64_t max, uint64_t *const value)
{
    uint64_t number = 0;
    if (word.at == word.end)
        return false;
    for (const char *p = word.at; p < word.end; p++) {
        if (*p < '0' || *p > '9')
            return false;
        const uint64_t digit = (uint64_t)(*p - '0');
        if (digit > max || number > (max - digit) / 10u)
            return false;
        number = number * 10u + digit;
    }
    *value = number;
    return true;
}

static int hex_digit(const char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    if (c >= 'a' && c <= 'f')
        return c - 'a' + 10;
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

enum text_hex text_hex_bytes(struct text_span line, uint8_t *const bytes, const size_t capacity, size_t *const len)
{
    size_t digits = 0;
    *len = 0;
    trim(&line);
    if (text_is(line, "-"))
        return TEXT_HEX_OK;
    for (const char *p = line.at; p < line.end; p++) {
        if (is_blank(*p))
            continue;
        const int digit = hex_digit(*p);
        if (digit < 0)
            return TEXT_HEX_DIGIT;
        if (digits / 2 >= capacity)
            return TEXT_HEX_LONG;
        bytes[digits / 2] = (uint8_t)(digits % 2 ? bytes[digits / 2] << 4 | digit : digit);
        digits++;
    }
    *len = digits / 2;
    if (digits == 0)
        return TEXT_HEX_DIGIT;
    return digits % 2 ? TEXT_HEX_ODD : TEXT_HEX_OK;
}

const char *text_hex_reason(const enum text_hex result)
{
    static const char *const reasons[] = {
        [TEXT_HEX_OK] = "well formed",
        [TEXT_HEX_DIGIT] = "hexadecimal digits expected (\"-\" for an empty datagram)",
        [TEXT_HEX_ODD] = "odd number of hexadecimal digits",
        [TEXT_HEX_LONG] = "longer than a datagram can be here (2048 bytes)",
    };
    return reasons[result];
}
