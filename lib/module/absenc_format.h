/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Format strings of absolute encoders, "name%<length><modifiers><type>..." (hal-interface 2.17). */
#ifndef HM2_MODULE_ABSENC_FORMAT_H
#define HM2_MODULE_ABSENC_FORMAT_H

#include <stdbool.h>
#include <stddef.h>

#define HM2_ABSENC_BITS       96u /* of all fields */
#define HM2_ABSENC_FIELD_BITS 32u
#define HM2_ABSENC_AA64       "AA64" /* built-in format of Fanuc's encoders of that name */

enum hm2_absenc_type {
    HM2_ABSENC_PAD,
    HM2_ABSENC_BOOLEAN,
    HM2_ABSENC_UNSIGNED,
    HM2_ABSENC_SIGNED,
    HM2_ABSENC_BITS_FIELD,
    HM2_ABSENC_ENCODER,
    HM2_ABSENC_HIGH, /* turns of an encoder whose position within the turn is the low field */
    HM2_ABSENC_LOW,
};

struct hm2_absenc_format {
    const char *name; /* in the format string, not terminated */
    size_t name_length;
    enum hm2_absenc_type type;
    unsigned length; /* 1 to 32 bits */
    bool gray, no_wrap;
};

/* Take the field at *text and move behind it; false when none stands there. */
bool hm2_absenc_take_field(const char **text, struct hm2_absenc_format *field);
/* Bits of all fields; 0 for a text that is no format, or one with more than HM2_ABSENC_BITS. */
unsigned hm2_absenc_format_bits(const char *text);
/* What a format in the configuration stands for: itself, or the built-in one. */
const char *hm2_absenc_expand(const char *format);

#endif
