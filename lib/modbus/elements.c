/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "elements.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ITEM_SIZE 128u

/* The next item of a list with commas between; 0 at its end, -1 when it is too long. */
static int next_item(const char **const list, char item[ITEM_SIZE])
{
    if (!*list)
        return 0;
    const size_t length = strcspn(*list, ",");
    if (length >= ITEM_SIZE)
        return -1;
    memcpy(item, *list, length);
    item[length] = '\0';
    *list = (*list)[length] == ',' ? *list + length + 1 : NULL;
    return 1;
}

static unsigned count_items(const char *const list)
{
    unsigned items = 1;
    for (const char *c = list; *c; c++)
        items += *c == ',';
    return items;
}

/* "[*SCALE+OFFSET]", either part may be missing. */
static int read_scale(struct ini *const ini, const struct ini_entry *const entry, char *text,
                      struct hm2_modbus_element *const element)
{
    char *end = text;
    if (*end == '*')
        element->scale = strtod(end + 1, &end);
    if (*end == '+' || *end == '-')
        element->offset = strtod(end, &end);
    if (strcmp(end, "]") != 0 || end == text)
        return ini_problem(ini, HM2_ERR_MALFORMED, entry->line, "%s: '[%.40s' is not [*SCALE+OFFSET]", entry->name,
                           text);
    if (!isfinite(element->scale) || !isfinite(element->offset) || !(fabs(element->scale) > 1e-100))
        return ini_problem(ini, HM2_ERR_RANGE, entry->line, "%s: [%.40s: the scale must be finite and not 0",
                           entry->name, text);
    return 0;
}

static int read_name(struct ini *const ini, const struct ini_entry *const entry, char *const item,
                     struct hm2_modbus_element *const element)
{
    char *const bracket = strchr(item, '[');
    int err = 0;
    if (bracket) {
        *bracket = '\0';
        err = read_scale(ini, entry, bracket + 1, element);
    }
    const size_t length = strlen(item);
    if (length == 0 || length > HM2_MODBUS_NAME_SIZE - 16)
        return ini_problem(ini, HM2_ERR_RANGE, entry->line, "%s: the name '%.40s' has %zu characters, expected 1 to %u",
                           entry->name, item, length, HM2_MODBUS_NAME_SIZE - 16);
    if (strpbrk(item, " \t]"))
        return ini_problem(ini, HM2_ERR_MALFORMED, entry->line, "%s: the name '%.40s' has a blank or ] in it",
                           entry->name, item);
    memcpy(element->name, item, length + 1);
    return err;
}

static void read_names(struct ini *const ini, const struct ini_entry *const entry,
                       struct hm2_modbus_transaction *const tx)
{
    const char *list = entry->value;
    char item[ITEM_SIZE];
    for (unsigned i = 0; i < tx->element_count; i++) {
        if (next_item(&list, item) <= 0) {
            (void)ini_problem(ini, HM2_ERR_RANGE, entry->line, "%s: item %u is too long", entry->name, i + 1);
            return;
        }
        if (read_name(ini, entry, item, &tx->elements[i]))
            return;
        for (unsigned k = 0; k < i; k++)
            if (strcmp(tx->elements[k].name, tx->elements[i].name) == 0) {
                (void)ini_problem(ini, HM2_ERR_INVALID, entry->line, "%s: '%s' is there twice", entry->name,
                                  tx->elements[i].name);
                return;
            }
    }
}

static const struct {
    const char *name;
    enum hm2_modbus_type type;
    unsigned words;
} types[] = {
    {"u16", HM2_MODBUS_U16, 1}, {"s16", HM2_MODBUS_S16, 1}, {"u32", HM2_MODBUS_U32, 2},
    {"s32", HM2_MODBUS_S32, 2}, {"f32", HM2_MODBUS_F32, 2}, {"bits", HM2_MODBUS_BITS, 1},
};
#define TYPES (sizeof types / sizeof types[0])

static int read_type(struct ini *const ini, const struct ini_entry *const entry, const char *const item,
                     struct hm2_modbus_element *const element)
{
    for (size_t i = 0; i < TYPES; i++)
        if (strcmp(types[i].name, item) == 0) {
            element->type = types[i].type;
            return 0;
        }
    return ini_problem(ini, HM2_ERR_INVALID, entry->line, "%s: '%.40s' is none of u16, s16, u32, s32, f32, bits",
                       entry->name, item);
}

static int read_initial(struct ini *const ini, const struct ini_entry *const entry, const char *const item,
                        struct hm2_modbus_element *const element)
{
    return ini_number(ini, entry, item, -1e300, 1e300, false, &element->initial);
}

/* A list with one item for each element, or one for all. */
static void read_list(struct ini *const ini, const char *const section, const char *const key,
                      struct hm2_modbus_transaction *const tx, const bool allowed, const char *const where,
                      int (*const read)(struct ini *, const struct ini_entry *, const char *,
                                        struct hm2_modbus_element *))
{
    const struct ini_entry *const entry = ini_find(ini, section, key);
    if (!entry)
        return;
    const unsigned items = count_items(entry->value);
    const char *list = entry->value;
    char item[ITEM_SIZE] = "";
    if (!allowed) {
        (void)ini_problem(ini, HM2_ERR_INVALID, entry->line, "%s: only for %s", key, where);
        return;
    }
    if (items != 1 && items != tx->element_count) {
        (void)ini_problem(ini, HM2_ERR_INVALID, entry->line, "%s: has %u items for %u elements; give one each, or one",
                          key, items, tx->element_count);
        return;
    }
    for (unsigned i = 0; i < tx->element_count; i++) {
        if ((i == 0 || items > 1) && next_item(&list, item) <= 0) {
            (void)ini_problem(ini, HM2_ERR_RANGE, entry->line, "%s: item %u is too long", key, i + 1);
            return;
        }
        if (read(ini, entry, item, &tx->elements[i]))
            return;
    }
}

static void place(struct hm2_modbus_transaction *const tx)
{
    for (unsigned i = 0; i < tx->element_count; i++) {
        tx->elements[i].word = tx->words;
        unsigned words = 1;
        for (size_t k = 0; k < TYPES; k++)
            if (types[k].type == tx->elements[i].type)
                words = types[k].words;
        tx->words += words;
    }
}

static void check_bits_scale(struct ini *const ini, const char *const section,
                             const struct hm2_modbus_transaction *const tx)
{
    const struct ini_entry *const names = ini_find(ini, section, "PIN_NAMES");
    for (unsigned i = 0; names && i < tx->element_count; i++) {
        const struct hm2_modbus_element *const element = &tx->elements[i];
        const bool numeric = element->type != HM2_MODBUS_COIL && element->type != HM2_MODBUS_BITS;
        if (!numeric && (fabs(element->scale - 1.0) > 0.0 || fabs(element->offset) > 0.0)) {
            (void)ini_problem(ini, HM2_ERR_INVALID, names->line, "PIN_NAMES: %s is a bit and has no scale",
                              element->name);
            return;
        }
    }
}

void elements_read(struct ini *const ini, const char *const section, const unsigned count,
                   struct hm2_modbus_transaction *const tx)
{
    const struct ini_entry *const names = ini_find(ini, section, "PIN_NAMES");
    const bool coils = hm2_modbus_is_bits(tx->function);
    tx->element_count = names ? count_items(names->value) : count;
    if (names && count)
        hm2_diag_warn(ini->diag, "%s:%u: [%s] NELEMENTS does not count beside PIN_NAMES", ini->file_name, names->line,
                      section);
    if (tx->element_count == 0 || tx->element_count > HM2_MODBUS_MAX_COILS) {
        (void)ini_problem(ini, HM2_ERR_RANGE, names ? names->line : 0,
                          "[%s] has %u elements; give NELEMENTS or PIN_NAMES for 1 to %u", section, tx->element_count,
                          HM2_MODBUS_MAX_COILS);
        tx->element_count = 0;
        return;
    }
    tx->elements = calloc(tx->element_count, sizeof *tx->elements);
    if (!tx->elements) {
        tx->element_count = 0;
        (void)ini_problem(ini, HM2_ERR_NOMEM, 0, "no memory for %s", section);
        return;
    }
    for (unsigned i = 0; i < tx->element_count; i++) {
        struct hm2_modbus_element *const element = &tx->elements[i];
        element->type = coils ? HM2_MODBUS_COIL : HM2_MODBUS_REGISTER;
        element->scale = 1.0;
        (void)snprintf(element->name, sizeof element->name, "%02u", i);
    }
    if (names)
        read_names(ini, names, tx);
    read_list(ini, section, "ELEMENT_TYPES", tx, !coils, "registers", read_type);
    read_list(ini, section, "INITIAL", tx, hm2_modbus_writes(tx->function), "what is written", read_initial);
    check_bits_scale(ini, section, tx);
    place(tx);
}
