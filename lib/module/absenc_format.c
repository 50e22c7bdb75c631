/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "absenc_format.h"

#include <string.h>

/* The 76 bits of an Aa64 encoder (register map 3.9). */
#define AA64_FIELDS "%5pbatt_fail%1b%2ppos_invalid%1b%9pencoder%16l%2pencoder%16h%2pcomm%10u%7pcrc%5u"

static const struct {
    char letter;
    enum hm2_absenc_type type;
} types[] = {
    {'p', HM2_ABSENC_PAD},        {'b', HM2_ABSENC_BOOLEAN}, {'u', HM2_ABSENC_UNSIGNED}, {'s', HM2_ABSENC_SIGNED},
    {'f', HM2_ABSENC_BITS_FIELD}, {'e', HM2_ABSENC_ENCODER}, {'h', HM2_ABSENC_HIGH},     {'l', HM2_ABSENC_LOW},
};

static char lower(const char c)
{
    return c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : c;
}

static bool take_length(const char **const text, unsigned *const length)
{
    const char *at = *text;
    *length = 0;
    for (; *at >= '0' && *at <= '9'; at++) {
        *length = *length * 10u + (unsigned)(*at - '0');
        if (*length > HM2_ABSENC_FIELD_BITS)
            return false;
    }
    *text = at;
    return *length > 0;
}

bool hm2_absenc_take_field(const char **const text, struct hm2_absenc_format *const field)
{
    const char *at = strchr(*text, '%');
    if (!at)
        return false;
    *field = (struct hm2_absenc_format){.name = *text, .name_length = (size_t)(at - *text)};
    at++;
    if (!take_length(&at, &field->length))
        return false;
    for (; lower(*at) == 'g' || lower(*at) == 'm'; at++) {
        field->gray |= lower(*at) == 'g';
        field->no_wrap |= lower(*at) == 'm';
    }
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++) {
        if (lower(*at) != types[i].letter)
            continue;
        field->type = types[i].type;
        *text = at + 1;
        return true;
    }
    return false;
}

unsigned hm2_absenc_format_bits(const char *text)
{
    struct hm2_absenc_format field;
    unsigned bits = 0;
    do {
        if (!hm2_absenc_take_field(&text, &field))
            return 0;
        bits += field.length;
    } while (*text);
    return bits <= HM2_ABSENC_BITS ? bits : 0;
}

const char *hm2_absenc_expand(const char *const format)
{
    return strcmp(format, HM2_ABSENC_AA64) == 0 ? AA64_FIELDS : format;
}
