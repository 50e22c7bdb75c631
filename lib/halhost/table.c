/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "table.h"

#include <stdlib.h>
#include <string.h>

#include <hm2/err.h>

int hh_list_insert(struct hh_list *const list, const size_t at, void *const item)
{
    if (list->count == list->capacity) {
        const size_t capacity = list->capacity ? 2 * list->capacity : 16;
        void **const items = realloc(list->items, capacity * sizeof *items);
        if (!items)
            return HM2_ERR_NOMEM;
        list->items = items;
        list->capacity = capacity;
    }
    memmove(list->items + at + 1, list->items + at, (list->count - at) * sizeof *list->items);
    list->items[at] = item;
    list->count++;
    return 0;
}

void hh_list_remove(struct hh_list *const list, const void *const item)
{
    for (size_t i = 0; i < list->count; i++) {
        if (list->items[i] == item) {
            list->count--;
            memmove(list->items + i, list->items + i + 1, (list->count - i) * sizeof *list->items);
            return;
        }
    }
}

void hh_list_free(struct hh_list *const list)
{
    free(list->items);
    *list = (struct hh_list){0};
}

static const char *original_name(const void *const named)
{
    return ((const struct hh_named *)named)->name;
}

const char *hh_shown_name(const void *const named)
{
    const struct hh_named *const names = named;
    return names->alias[0] ? names->alias : names->name;
}

/* First position whose key is not below name. */
static size_t lower_bound(const struct hh_list *const list, const char *(*const key)(const void *),
                          const char *const name)
{
    size_t low = 0, high = list->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (strcmp(key(list->items[middle]), name) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static void *find(const struct hh_list *const list, const char *(*const key)(const void *), const char *const name)
{
    const size_t at = lower_bound(list, key, name);
    return at < list->count && strcmp(key(list->items[at]), name) == 0 ? list->items[at] : NULL;
}

void *hh_table_find(const struct hh_table *const table, const char *const name)
{
    void *const shown = find(&table->shown, hh_shown_name, name);
    return shown ? shown : find(&table->aliased, original_name, name);
}

int hh_table_add(struct hh_table *const table, void *const named)
{
    return hh_list_insert(&table->shown, lower_bound(&table->shown, hh_shown_name, hh_shown_name(named)), named);
}

void hh_table_remove(struct hh_table *const table, void *const named)
{
    hh_list_remove(&table->shown, named);
    hh_list_remove(&table->aliased, named);
}

int hh_table_alias(struct hh_table *const table, void *const named, const char *const alias)
{
    struct hh_named *const names = named;
    const bool had_alias = names->alias[0] != '\0';
    if (alias && !had_alias &&
        hh_list_insert(&table->aliased, lower_bound(&table->aliased, original_name, names->name), named))
        return HM2_ERR_NOMEM;
    if (!alias)
        hh_list_remove(&table->aliased, named);
    hh_list_remove(&table->shown, named);
    const size_t length = alias ? strnlen(alias, HH_NAME_LEN) : 0;
    if (length > 0)
        memcpy(names->alias, alias, length);
    names->alias[length] = '\0';
    /* Cannot fail: the place that was freed above is still there. */
    return hh_table_add(table, named);
}

void hh_table_free(struct hh_table *const table)
{
    hh_list_free(&table->shown);
    hh_list_free(&table->aliased);
}
