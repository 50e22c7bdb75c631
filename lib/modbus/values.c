/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Numbers of pins and words of devices. */
#include <math.h>
#include <string.h>

#include <hm2/modbus.h>
#include <hm2/number.h>

bool hm2_modbus_writes(const enum hm2_modbus_function function)
{
    return function >= HM2_MODBUS_WRITE_SINGLE_COIL;
}

bool hm2_modbus_is_bits(const enum hm2_modbus_function function)
{
    return function == HM2_MODBUS_READ_COILS || function == HM2_MODBUS_READ_DISCRETE_INPUTS ||
           function == HM2_MODBUS_WRITE_SINGLE_COIL || function == HM2_MODBUS_WRITE_MULTIPLE_COILS;
}

static uint32_t long_at(const uint16_t *const words, const bool low_word_first)
{
    return low_word_first ? (uint32_t)words[1] << 16 | words[0] : (uint32_t)words[0] << 16 | words[1];
}

static void put_long(uint16_t *const words, const bool low_word_first, const uint32_t value)
{
    words[low_word_first ? 1 : 0] = (uint16_t)(value >> 16);
    words[low_word_first ? 0 : 1] = (uint16_t)value;
}

static double raw_number(const struct hm2_modbus_element *const element, const bool low_word_first,
                         const uint16_t *const words)
{
    const uint16_t *const at = words + element->word;
    float single;
    uint32_t bits;
    switch (element->type) {
    case HM2_MODBUS_S16:
        return (int16_t)at[0];
    case HM2_MODBUS_U32:
        return long_at(at, low_word_first);
    case HM2_MODBUS_S32:
        return (int32_t)long_at(at, low_word_first);
    case HM2_MODBUS_F32:
        bits = long_at(at, low_word_first);
        memcpy(&single, &bits, sizeof single);
        return (double)single;
    case HM2_MODBUS_COIL:
    case HM2_MODBUS_REGISTER:
    case HM2_MODBUS_U16:
    case HM2_MODBUS_BITS:
        break;
    }
    return at[0];
}

double hm2_modbus_decode(const struct hm2_modbus_element *const element, const bool low_word_first,
                         const uint16_t *const words)
{
    return raw_number(element, low_word_first, words) * element->scale + element->offset;
}

int32_t hm2_modbus_decode_int(const struct hm2_modbus_element *const element, const bool low_word_first,
                              const uint16_t *const words)
{
    return hm2_trunc_s32(raw_number(element, low_word_first, words));
}

static const struct {
    double min, max;
    bool is_long;
} limits[] = {
    [HM2_MODBUS_COIL] = {0.0, 1.0, false},
    [HM2_MODBUS_REGISTER] = {-32768.0, 65535.0, false},
    [HM2_MODBUS_U16] = {0.0, 65535.0, false},
    [HM2_MODBUS_S16] = {-32768.0, 32767.0, false},
    [HM2_MODBUS_U32] = {0.0, 4294967295.0, true},
    [HM2_MODBUS_S32] = {-2147483648.0, 2147483647.0, true},
    [HM2_MODBUS_F32] = {-3.4028234663852886e38, 3.4028234663852886e38, true},
    [HM2_MODBUS_BITS] = {0.0, 65535.0, false},
};

static double limit(const double value, const double min, const double max)
{
    if (isnan(value))
        return 0.0;
    return value < min ? min : value > max ? max : value;
}

/* One that scales nothing: mb2hal cuts fractions off. */
static bool is_plain(const struct hm2_modbus_element *const element)
{
    return element->type == HM2_MODBUS_REGISTER && fabs(element->scale - 1.0) <= 0.0 && fabs(element->offset) <= 0.0;
}

void hm2_modbus_encode(const struct hm2_modbus_element *const element, const bool low_word_first, const double number,
                       const int32_t whole, uint16_t *const words)
{
    const double min = limits[element->type].min, max = limits[element->type].max;
    uint16_t *const at = words + element->word;
    double raw = limit((number - element->offset) / element->scale, -1e300, 1e300);
    if (element->type == HM2_MODBUS_F32) {
        const float single = (float)limit(raw + whole, min, max);
        uint32_t bits;
        memcpy(&bits, &single, sizeof bits);
        put_long(at, low_word_first, bits);
        return;
    }
    raw = limit((is_plain(element) ? trunc(raw) : round(raw)) + whole, min, max);
    /* Two's complement of a negative number, by way of a type that holds all of them. */
    const uint32_t bits = (uint32_t)(int64_t)raw;
    if (limits[element->type].is_long)
        put_long(at, low_word_first, bits);
    else
        at[0] = (uint16_t)bits;
}
