/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Objects by name. Every object begins with its struct hh_named; a table keeps them sorted by the name shown. */
#ifndef HALHOST_TABLE_H
#define HALHOST_TABLE_H

#include <stdbool.h>
#include <stddef.h>

#define HH_NAME_LEN  47u /* hal-interface 5.2 */
#define HH_NAME_SIZE (HH_NAME_LEN + 1u)

struct hh_named {
    char name[HH_NAME_SIZE];
    char alias[HH_NAME_SIZE]; /* "" = none */
};

struct hh_list {
    void **items;
    size_t count, capacity;
};

struct hh_table {
    struct hh_list shown;   /* all, sorted by the name shown: the alias where there is one */
    struct hh_list aliased; /* those with an alias, sorted by their original name */
};

/* 0 or HM2_ERR_NOMEM. */
int hh_list_insert(struct hh_list *list, size_t at, void *item);
void hh_list_remove(struct hh_list *list, const void *item);
void hh_list_free(struct hh_list *list);

const char *hh_shown_name(const void *named);

void *hh_table_find(const struct hh_table *table, const char *name);
/* The caller has made sure that the names are free. 0 or HM2_ERR_NOMEM. */
int hh_table_add(struct hh_table *table, void *named);
void hh_table_remove(struct hh_table *table, void *named);
/* alias NULL removes it. 0 or HM2_ERR_NOMEM (then nothing has changed). */
int hh_table_alias(struct hh_table *table, void *named, const char *alias);
void hh_table_free(struct hh_table *table);

#endif
