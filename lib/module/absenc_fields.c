/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "absenc_fields.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bind.h"

#define PLACEHOLDER "NAME"

#define BIT(field, name, help)    HM2_POINT(struct hm2_absenc_bit, field, name, HM2_BIT, HM2_PIN_OUT, 0, "", help)
#define NUMBER(field, name, ...)  HM2_POINT(struct hm2_absenc_field, field, name, HM2_FLOAT, __VA_ARGS__)
#define ENCODER(field, name, ...) HM2_POINT(struct hm2_absenc_encoder, field, name, __VA_ARGS__)
#define COUNTS_PER_REV            256

const struct hm2_point hm2_absenc_boolean_rows[HM2_ABSENC_BOOLEAN_ROWS] = {
    BIT(level, PLACEHOLDER, "1 = any bit of the field is 1"),
    BIT(inverse, PLACEHOLDER "-not", "the opposite"),
};

const struct hm2_point hm2_absenc_bit_rows[HM2_ABSENC_BIT_ROWS] = {
    BIT(level, PLACEHOLDER "-##", "bit of the field"),
    BIT(inverse, PLACEHOLDER "-##-not", "the opposite"),
};

const struct hm2_point hm2_absenc_number_rows[HM2_ABSENC_NUMBER_ROWS] = {
    NUMBER(value, PLACEHOLDER, HM2_PIN_OUT, 0, "units", "the field as a number, scaled"),
    NUMBER(scalemax, PLACEHOLDER "-scalemax", HM2_PARAM_RW, 1, "units", "value at the end of the field's range"),
};

const struct hm2_point hm2_absenc_encoder_rows[HM2_ABSENC_ENCODER_ROWS] = {
    ENCODER(count, PLACEHOLDER ".count", HM2_S32, HM2_PIN_OUT, 0, "counts", "counts since reset or index"),
    ENCODER(rawcounts, PLACEHOLDER ".rawcounts", HM2_S32, HM2_PIN_OUT, 0, "counts", "counts of the encoder itself"),
    ENCODER(position, PLACEHOLDER ".position", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "count / scale"),
    ENCODER(index_enable, PLACEHOLDER ".index-enable", HM2_BIT, HM2_PIN_IO, 0, "",
            "1: zero the count at the next whole turn, then go to 0"),
    ENCODER(reset, PLACEHOLDER ".reset", HM2_BIT, HM2_PIN_IO, 0, "", "1: count and position are held at 0"),
    ENCODER(scale, PLACEHOLDER ".scale", HM2_FLOAT, HM2_PARAM_RW, 1, "counts/unit", "counts in a unit of position"),
    ENCODER(counts_per_rev, PLACEHOLDER ".counts-per-rev", HM2_U32, HM2_PARAM_RW, COUNTS_PER_REV, "counts",
            "distance of the turns that index-enable waits for"),
};

_Static_assert(HM2_ABSENC_BOOLEAN_ROWS == HM2_ABSENC_BIT_ROWS, "bind_bits() takes either");

/* ---- set-up --------------------------------------------------------------------------------------------------------
 */

struct place {
    const struct hm2_setup *setup;
    const char *prefix;
    const struct hm2_absenc_format *format;
};

/* Create rows with the field's name in the place of the placeholder, and index in that of "##". */
static int bind_rows(const struct place *const p, const struct hm2_point *const rows, const size_t count,
                     void *const base, const unsigned index)
{
    for (size_t i = 0; i < count; i++) {
        const char *const rest = rows[i].name + sizeof PLACEHOLDER - 1;
        const size_t plain = strcspn(rest, "#"), hashes = strspn(rest + plain, "#");
        char name[HM2_NAME_SIZE], number[8] = "";
        if (hashes)
            (void)snprintf(number, sizeof number, "%0*u", (int)hashes, index);
        const int len = snprintf(name, sizeof name, "%s.%.*s%.*s%s%s", p->prefix, (int)p->format->name_length,
                                 p->format->name, (int)plain, rest, number, rest + plain + hashes);
        if (len < 0 || (size_t)len >= sizeof name)
            return hm2_diag_add(p->setup->diag, HM2_ERR_NOSPACE, "the name %s... is longer than %u characters", name,
                                HM2_NAME_SIZE - 1);
        void *const slot = (unsigned char *)base + rows[i].offset;
        const int err = p->setup->binder->create(p->setup->binder, name, &rows[i], slot, p->setup->diag);
        if (err < 0)
            return err;
        void *value;
        memcpy(&value, slot, sizeof value);
        hm2_point_store(rows[i].type, value, rows[i].initial);
    }
    return 0;
}

static int bind_bits(const struct place *const p, struct hm2_absenc_field *const field)
{
    const bool boolean = field->type == HM2_ABSENC_BOOLEAN;
    const unsigned count = boolean ? 1 : field->length;
    const struct hm2_point *const rows = boolean ? hm2_absenc_boolean_rows : hm2_absenc_bit_rows;
    field->bits = hm2_setup_alloc(p->setup, count * sizeof field->bits[0]);
    int err = field->bits ? 0 : HM2_ERR_NOMEM;
    for (unsigned i = 0; i < count && !err; i++)
        err = bind_rows(p, rows, HM2_ABSENC_BIT_ROWS, &field->bits[i], i);
    return err;
}

static int bind_field(const struct place *const p, struct hm2_absenc_field *const field)
{
    switch (field->type) {
    case HM2_ABSENC_BOOLEAN:
    case HM2_ABSENC_BITS_FIELD:
        return bind_bits(p, field);
    case HM2_ABSENC_UNSIGNED:
    case HM2_ABSENC_SIGNED:
        return bind_rows(p, hm2_absenc_number_rows, HM2_ABSENC_NUMBER_ROWS, field, 0);
    case HM2_ABSENC_ENCODER:
    case HM2_ABSENC_HIGH:
        return bind_rows(p, hm2_absenc_encoder_rows, HM2_ABSENC_ENCODER_ROWS, &field->encoder, 0);
    case HM2_ABSENC_PAD:
    case HM2_ABSENC_LOW:
    default:
        return 0;
    }
}

/* An encoder in two parts: the low part of the same name, else any. */
static void join_parts(struct hm2_absenc_fields *const fields)
{
    const struct hm2_absenc_field *low = NULL;
    for (unsigned i = 0; i < fields->count; i++)
        if (fields->field[i].type == HM2_ABSENC_LOW)
            low = &fields->field[i];
    for (unsigned i = 0; low && i < fields->count; i++) {
        if (fields->field[i].type != HM2_ABSENC_HIGH)
            continue;
        fields->field[i].low_first = low->first;
        fields->field[i].low_length = low->length;
    }
}

int hm2_absenc_fields_bind(struct hm2_absenc_fields *const fields, const struct hm2_setup *const setup,
                           const char *const format, const char *const prefix)
{
    struct hm2_absenc_format parsed;
    const char *text = format;
    while (hm2_absenc_take_field(&text, &parsed))
        fields->count++;
    fields->field = hm2_setup_alloc(setup, fields->count * sizeof fields->field[0]);
    if (!fields->field)
        return HM2_ERR_NOMEM;
    text = format;
    int err = 0;
    for (unsigned i = 0; i < fields->count && !err && hm2_absenc_take_field(&text, &parsed); i++) {
        struct hm2_absenc_field *const field = &fields->field[i];
        field->type = parsed.type;
        field->first = fields->bits;
        field->length = parsed.length;
        field->gray = parsed.gray;
        field->no_wrap = parsed.no_wrap;
        fields->bits += parsed.length;
        const struct place place = {setup, prefix, &parsed};
        err = bind_field(&place, field);
    }
    join_parts(fields);
    return err;
}

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

/* Up to 32 bits from bit `first` on. */
static uint32_t take_bits(const uint32_t words[HM2_ABSENC_WORDS], const unsigned first, const unsigned length)
{
    const unsigned word = first / 32;
    uint64_t both = words[word];
    if (word + 1 < HM2_ABSENC_WORDS)
        both |= (uint64_t)words[word + 1] << 32;
    return (uint32_t)(both >> first % 32 & (UINT64_MAX >> (64u - length)));
}

static uint64_t gray_to_binary(uint64_t value)
{
    for (unsigned shift = 1; shift < 64; shift *= 2)
        value ^= value >> shift;
    return value;
}

static int64_t sign_extended(const uint64_t value, const unsigned length)
{
    const uint64_t sign = (uint64_t)1 << (length - 1), mask = UINT64_MAX >> (64u - length);
    return (int64_t)(((value & mask) ^ sign) - sign);
}

static void show_encoder(struct hm2_absenc_encoder *const e, const struct hm2_module *const module,
                         const unsigned instance)
{
    double scale = *e->scale;
    if (!isfinite(scale) || scale == 0.0) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "scale", instance, scale);
        *e->scale = scale = 1.0;
    }
    const int64_t count = (int64_t)((uint64_t)e->turned - (uint64_t)e->zero);
    *e->rawcounts = (int32_t)(uint32_t)(uint64_t)e->turned;
    *e->count = (int32_t)(uint32_t)(uint64_t)count;
    *e->position = (double)count / scale;
}

/* The multiple of per_turn that lies between two readings, if one does. */
static bool passed_turn(const int64_t from, const int64_t to, const int64_t per_turn, int64_t *const turn)
{
    const int64_t low = from < to ? from : to, high = from < to ? to : from;
    const int64_t at = low >= 0 ? low / per_turn : -((-(low + 1)) / per_turn) - 1; /* rounded down */
    *turn = (at + 1) * per_turn;
    return low != high && *turn <= high;
}

static void take_reading(struct hm2_absenc_field *const field, const uint64_t reading, const unsigned length)
{
    struct hm2_absenc_encoder *const e = &field->encoder;
    const int64_t before = e->turned;
    if (!e->known || field->no_wrap)
        e->turned = sign_extended(reading, length);
    else
        e->turned = (int64_t)((uint64_t)e->turned + (uint64_t)sign_extended(reading - e->last, length));
    int64_t turn;
    const uint32_t per_turn = *e->counts_per_rev;
    if (e->known && *e->index_enable && per_turn && passed_turn(before, e->turned, per_turn, &turn)) {
        e->zero = turn;
        *e->index_enable = false;
    }
    e->last = reading;
    e->known = true;
}

static void show_bits(const struct hm2_absenc_field *const field, const uint32_t value)
{
    const bool boolean = field->type == HM2_ABSENC_BOOLEAN;
    for (unsigned i = 0; i < (boolean ? 1 : field->length); i++) {
        const bool level = boolean ? value != 0 : value >> i & 1u;
        *field->bits[i].level = level;
        *field->bits[i].inverse = !level;
    }
}

static double finite_scale(const struct hm2_absenc_field *const field, const struct hm2_module *const module,
                           const unsigned instance)
{
    const double scale = *field->scalemax;
    if (isfinite(scale))
        return scale;
    hm2_notice_point(module, HM2_NOTICE_VALUE_INVALID, "scalemax", instance, scale);
    *field->scalemax = 1.0;
    return 1.0;
}

static void show_field(struct hm2_absenc_field *const field, const struct hm2_module *const module,
                       const unsigned instance, const uint32_t words[HM2_ABSENC_WORDS])
{
    const unsigned length = field->length;
    uint64_t value = take_bits(words, field->first, length);
    unsigned whole = length;
    if (field->type == HM2_ABSENC_HIGH && field->low_length) {
        value = value << field->low_length | take_bits(words, field->low_first, field->low_length);
        whole += field->low_length;
    }
    if (field->gray)
        value = gray_to_binary(value);
    switch (field->type) {
    case HM2_ABSENC_BOOLEAN:
    case HM2_ABSENC_BITS_FIELD:
        show_bits(field, (uint32_t)value);
        break;
    case HM2_ABSENC_UNSIGNED:
        *field->value = (double)value * finite_scale(field, module, instance) / (double)(UINT32_MAX >> (32u - length));
        break;
    case HM2_ABSENC_SIGNED:
        *field->value =
            (double)(int32_t)((uint32_t)value << (32u - length)) / 2147483647.0 * finite_scale(field, module, instance);
        break;
    case HM2_ABSENC_ENCODER:
    case HM2_ABSENC_HIGH:
        take_reading(field, value, whole);
        break;
    case HM2_ABSENC_PAD:
    case HM2_ABSENC_LOW:
    default:
        break;
    }
}

void hm2_absenc_fields_show(struct hm2_absenc_fields *const fields, const struct hm2_module *const module,
                            const unsigned instance, const uint32_t words[HM2_ABSENC_WORDS])
{
    for (unsigned i = 0; i < fields->count; i++)
        show_field(&fields->field[i], module, instance, words);
}

void hm2_absenc_fields_follow(struct hm2_absenc_fields *const fields, const struct hm2_module *const module,
                              const unsigned instance)
{
    for (unsigned i = 0; i < fields->count; i++) {
        struct hm2_absenc_field *const field = &fields->field[i];
        if (field->type != HM2_ABSENC_ENCODER && field->type != HM2_ABSENC_HIGH)
            continue;
        if (*field->encoder.reset)
            field->encoder.zero = field->encoder.turned;
        if (field->encoder.known)
            show_encoder(&field->encoder, module, instance);
    }
}
