/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Fields in the data word of an absolute encoder, and their pins (hal-interface 2.17, 2.19). Private to lib/module. */
#ifndef HM2_MODULE_ABSENC_FIELDS_H
#define HM2_MODULE_ABSENC_FIELDS_H

#include <hm2/module.h>

#include "absenc_format.h"

#define HM2_ABSENC_WORDS 3u

struct hm2_absenc_encoder {
    hm2_s32_t *count, *rawcounts;
    hm2_float_t *position;
    hm2_bit_t *index_enable, *reset;
    hm2_float_t *scale;
    hm2_u32_t *counts_per_rev;
    bool known;           /* a reading came already */
    uint64_t last;        /* reading before */
    int64_t turned, zero; /* since the encoder's own zero; where the count is zero */
};

struct hm2_absenc_bit {
    hm2_bit_t *level, *inverse;
};

struct hm2_absenc_field {
    enum hm2_absenc_type type;
    unsigned first, length;         /* bits */
    unsigned low_first, low_length; /* HM2_ABSENC_HIGH: of the other part, 0 when there is none */
    bool gray, no_wrap;
    hm2_float_t *value, *scalemax;
    struct hm2_absenc_encoder encoder;
    struct hm2_absenc_bit *bits; /* of booleans and bit fields */
};

struct hm2_absenc_fields {
    unsigned count, bits;
    struct hm2_absenc_field *field;
};

/* Rows of documentation, one set per kind of field; the "NAME" in them is the field's. */
enum { HM2_ABSENC_GROUPS = 4 };
#define HM2_ABSENC_FIELD_GROUPS(prefix_)                                                                       \
    {prefix_, hm2_absenc_boolean_rows, HM2_ABSENC_BOOLEAN_ROWS, "for each boolean field (b)"},                 \
        {prefix_, hm2_absenc_bit_rows, HM2_ABSENC_BIT_ROWS, "for each bit of a bit field (f)"},                \
        {prefix_, hm2_absenc_number_rows, HM2_ABSENC_NUMBER_ROWS, "for each unsigned or signed field (u, s)"}, \
    {                                                                                                          \
        prefix_, hm2_absenc_encoder_rows, HM2_ABSENC_ENCODER_ROWS, "for each encoder field (e, or h with l)"   \
    }
#define HM2_ABSENC_BOOLEAN_ROWS 2u
#define HM2_ABSENC_BIT_ROWS     2u
#define HM2_ABSENC_NUMBER_ROWS  2u
#define HM2_ABSENC_ENCODER_ROWS 7u
extern const struct hm2_point hm2_absenc_boolean_rows[HM2_ABSENC_BOOLEAN_ROWS];
extern const struct hm2_point hm2_absenc_bit_rows[HM2_ABSENC_BIT_ROWS];
extern const struct hm2_point hm2_absenc_number_rows[HM2_ABSENC_NUMBER_ROWS];
extern const struct hm2_point hm2_absenc_encoder_rows[HM2_ABSENC_ENCODER_ROWS];

/* Make the fields of a good format and their pins below prefix ("hm2_7i93.0.ssi.00"). */
int HM2_MUST_CHECK hm2_absenc_fields_bind(struct hm2_absenc_fields *fields, const struct hm2_setup *setup,
                                          const char *format, const char *prefix);
/* Show a data word, bit 0 first. instance is the channel, for notices. Realtime safe. */
void hm2_absenc_fields_show(struct hm2_absenc_fields *fields, const struct hm2_module *module, unsigned instance,
                            const uint32_t words[HM2_ABSENC_WORDS]);
/* Pins that follow others in every cycle: the zero of encoders. Realtime safe. */
void hm2_absenc_fields_follow(struct hm2_absenc_fields *fields, const struct hm2_module *module, unsigned instance);

#endif
