/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "pins.h"

#include <stdio.h>
#include <string.h>

#include <hm2/number.h>

union pin {
    hm2_bit_t *bit;
    hm2_s32_t *whole;
    hm2_float_t *number;
};

struct transaction {
    hm2_u32_t *errors_in_row, *errors;
    hm2_bit_t *connected, *stale, *enable;
    hm2_float_t *age;
    union pin *pins; /* of all elements, one after the other */
    uint32_t goods;
    double age_s;
};

struct pins {
    const struct hm2_modbus_map *map;
    struct engine *engine;
    struct transaction transactions[];
};

/* Of each transaction; the names that mb2hal does not have must be known to the parser, see check_names() there. */
static const struct hm2_point points[] = {
    HM2_POINT(struct transaction, errors_in_row, "num_errors", HM2_U32, HM2_PIN_OUT, 0, "", "failures in a row"),
    HM2_POINT(struct transaction, errors, "errors", HM2_U32, HM2_PIN_OUT, 0, "", "failures"),
    HM2_POINT(struct transaction, connected, "connected", HM2_BIT, HM2_PIN_OUT, 0, "", "the device answers"),
    HM2_POINT(struct transaction, stale, "stale", HM2_BIT, HM2_PIN_OUT, 1, "", "the last try was no good"),
    HM2_POINT(struct transaction, age, "age", HM2_FLOAT, HM2_PIN_OUT, 0, "s", "time since the last good try"),
};
static const struct hm2_point enable_point =
    HM2_POINT(struct transaction, enable, "enable", HM2_BIT, HM2_PIN_IN, 0, "", "run the transaction");

/* ---- creation ----------------------------------------------------------------------------------------------------*/

/* How the pins of an element are called behind its name. */
struct suffix {
    const char *text;
    enum hm2_point_type type;
    double initial;
};

#define BITS_PER_WORD 16u

/* Suffixes of an element's pins, but for single bits; returns how many. */
static unsigned suffixes(const struct hm2_modbus_map *const map, const bool writes, const bool coil,
                         struct suffix list[2])
{
    const bool bare = map->short_names && (coil || writes);
    list[0] = (struct suffix){bare ? "" : coil ? ".bit" : ".float", coil ? HM2_BIT : HM2_FLOAT, 0};
    list[1] = (struct suffix){coil ? ".bit-inv" : ".int", coil ? HM2_BIT : HM2_S32, coil};
    return bare || (coil && writes) ? 1 : 2;
}

static unsigned pins_of(const struct hm2_modbus_map *const map, const struct hm2_modbus_transaction *const tx,
                        const struct hm2_modbus_element *const element)
{
    struct suffix list[2];
    if (element->type == HM2_MODBUS_BITS)
        return BITS_PER_WORD;
    return suffixes(map, hm2_modbus_writes(tx->function), element->type == HM2_MODBUS_COIL, list);
}

struct maker {
    struct hm2_binder *binder;
    const struct hm2_modbus_map *map;
    const struct hm2_modbus_transaction *tx;
    struct hm2_diag *diag;
};

static void store(const union pin *const pin, const enum hm2_point_type type, const double number)
{
    if (type == HM2_BIT)
        *pin->bit = number < 0.0 || number > 0.0;
    else if (type == HM2_S32)
        *pin->whole = hm2_trunc_s32(number);
    else
        *pin->number = number;
}

/* Of elements that are read and written; binders may keep them, and get the whole name besides. */
#define ELEMENT_POINT(point_type, point_dir)                                         \
    {                                                                                \
        .name = "", .type = (point_type), .dir = (point_dir), .unit = "", .help = "" \
    }
static const struct hm2_point element_points[][2] = {
    [HM2_BIT] = {ELEMENT_POINT(HM2_BIT, HM2_PIN_OUT), ELEMENT_POINT(HM2_BIT, HM2_PIN_IN)},
    [HM2_S32] = {ELEMENT_POINT(HM2_S32, HM2_PIN_OUT), ELEMENT_POINT(HM2_S32, HM2_PIN_IN)},
    [HM2_FLOAT] = {ELEMENT_POINT(HM2_FLOAT, HM2_PIN_OUT), ELEMENT_POINT(HM2_FLOAT, HM2_PIN_IN)},
};

static int create_pin(const struct maker *const maker, const struct hm2_modbus_element *const element,
                      const char *const suffix, const enum hm2_point_type type, const double initial,
                      union pin *const pin)
{
    const struct hm2_point *const point = &element_points[type][hm2_modbus_writes(maker->tx->function)];
    char name[HM2_NAME_SIZE * 2];
    (void)snprintf(name, sizeof name, "%s.%s.%s%s", maker->map->component, maker->tx->name, element->name, suffix);
    const int err = maker->binder->create(maker->binder, name, point, pin, maker->diag);
    if (!err)
        store(pin, type, initial);
    return err;
}

static int create_element(const struct maker *const maker, const struct hm2_modbus_element *const element,
                          union pin *const pins)
{
    struct suffix list[2];
    const bool writes = hm2_modbus_writes(maker->tx->function), coil = element->type == HM2_MODBUS_COIL;
    int err = 0;
    if (element->type == HM2_MODBUS_BITS) {
        for (unsigned i = 0; !err && i < BITS_PER_WORD; i++) {
            char suffix[16];
            (void)snprintf(suffix, sizeof suffix, ".bit-%02u", i);
            err = create_pin(maker, element, suffix, HM2_BIT, hm2_trunc_u32(element->initial) >> i & 1u, &pins[i]);
        }
        return err;
    }
    const unsigned count = suffixes(maker->map, writes, coil, list);
    for (unsigned i = 0; !err && i < count; i++)
        err = create_pin(maker, element, list[i].text, list[i].type,
                         writes && i == 0 ? element->initial : list[i].initial, &pins[i]);
    return err;
}

static int create_transaction(const struct maker *const maker, struct transaction *const tx)
{
    char prefix[HM2_NAME_SIZE];
    unsigned count = 0;
    (void)snprintf(prefix, sizeof prefix, "%s.%s", maker->map->component, maker->tx->name);
    int err = hm2_bind_points(maker->binder, points, sizeof points / sizeof points[0], tx, prefix, 0, maker->diag);
    if (!err && maker->tx->enable_pin)
        err = hm2_bind_points(maker->binder, &enable_point, 1, tx, prefix, 0, maker->diag);
    for (unsigned i = 0; i < maker->tx->element_count; i++)
        count += pins_of(maker->map, maker->tx, &maker->tx->elements[i]);
    tx->pins = err ? NULL : maker->binder->alloc(maker->binder, count * sizeof *tx->pins);
    if (!err && !tx->pins)
        err = hm2_diag_add(maker->diag, HM2_ERR_NOMEM, "HAL has no memory for the pins of %s", prefix);
    union pin *next = tx->pins;
    for (unsigned i = 0; !err && i < maker->tx->element_count; i++) {
        err = create_element(maker, &maker->tx->elements[i], next);
        next += pins_of(maker->map, maker->tx, &maker->tx->elements[i]);
    }
    return err;
}

struct pins *pins_new(struct hm2_binder *const binder, const struct hm2_modbus_map *const map,
                      struct engine *const engine, struct hm2_diag *const diag)
{
    struct pins *const pins =
        binder->alloc(binder, sizeof *pins + map->transaction_count * sizeof pins->transactions[0]);
    if (!pins) {
        (void)hm2_diag_add(diag, HM2_ERR_NOMEM, "HAL has no memory left");
        return NULL;
    }
    pins->map = map;
    pins->engine = engine;
    for (unsigned i = 0; i < map->transaction_count; i++)
        if (create_transaction(&(const struct maker){binder, map, &map->transactions[i], diag}, &pins->transactions[i]))
            return NULL;
    return pins;
}

/* ---- the cycle ---------------------------------------------------------------------------------------------------*/

static void put(const struct hm2_modbus_map *const map, const struct hm2_modbus_transaction *const tx,
                const struct hm2_modbus_element *const element, const union pin *const pins, uint16_t *const words)
{
    if (element->type == HM2_MODBUS_COIL) {
        words[element->word] = *pins[0].bit;
    } else if (element->type == HM2_MODBUS_BITS) {
        unsigned word = 0;
        for (unsigned i = 0; i < BITS_PER_WORD; i++)
            word |= (unsigned)*pins[i].bit << i;
        words[element->word] = (uint16_t)word;
    } else {
        hm2_modbus_encode(element, tx->low_word_first, *pins[0].number, map->short_names ? 0 : *pins[1].whole, words);
    }
}

static void show(const struct hm2_modbus_map *const map, const struct hm2_modbus_transaction *const tx,
                 const struct hm2_modbus_element *const element, const union pin *const pins,
                 const uint16_t *const words)
{
    if (element->type == HM2_MODBUS_COIL) {
        const bool bit = words[element->word] != 0;
        *pins[0].bit = bit;
        if (!map->short_names)
            *pins[1].bit = !bit;
    } else if (element->type == HM2_MODBUS_BITS) {
        for (unsigned i = 0; i < BITS_PER_WORD; i++)
            *pins[i].bit = words[element->word] >> i & 1u;
    } else {
        *pins[0].number = hm2_modbus_decode(element, tx->low_word_first, words);
        *pins[1].whole = hm2_modbus_decode_int(element, tx->low_word_first, words);
    }
}

static void send_all(const struct pins *const pins, const unsigned index)
{
    const struct hm2_modbus_transaction *const map = &pins->map->transactions[index];
    uint16_t *const words = engine_order(pins->engine, index);
    const union pin *next = pins->transactions[index].pins;
    for (unsigned i = 0; i < map->element_count; i++) {
        put(pins->map, map, &map->elements[i], next, words);
        next += pins_of(pins->map, map, &map->elements[i]);
    }
    engine_send(pins->engine, index);
}

static void show_all(const struct pins *const pins, const unsigned index, const uint16_t *const words)
{
    const struct hm2_modbus_transaction *const map = &pins->map->transactions[index];
    const union pin *next = pins->transactions[index].pins;
    for (unsigned i = 0; i < map->element_count; i++) {
        show(pins->map, map, &map->elements[i], next, words);
        next += pins_of(pins->map, map, &map->elements[i]);
    }
}

static void take_result(struct pins *const pins, const unsigned index, const struct engine_result *const result)
{
    const struct engine_state *const state = &result->state;
    struct transaction *const tx = &pins->transactions[index];
    *tx->errors_in_row = state->errors_in_row;
    *tx->errors = state->errors;
    *tx->connected = state->connected;
    if (state->goods == tx->goods)
        return;
    tx->goods = state->goods;
    tx->age_s = 0.0;
    if (!hm2_modbus_writes(pins->map->transactions[index].function))
        show_all(pins, index, result->words);
}

void pins_update(struct pins *const pins, const long period_ns)
{
    for (unsigned i = 0; i < pins->map->transaction_count; i++) {
        struct transaction *const tx = &pins->transactions[i];
        const bool enabled = !tx->enable || *tx->enable;
        bool fresh;
        engine_enable(pins->engine, i, enabled);
        if (hm2_modbus_writes(pins->map->transactions[i].function))
            send_all(pins, i);
        const struct engine_result *const result = engine_result(pins->engine, i, &fresh);
        tx->age_s += (double)period_ns * 1e-9;
        if (fresh)
            take_result(pins, i, result);
        *tx->age = tx->age_s;
        *tx->stale = !enabled || !result->state.good;
    }
}
