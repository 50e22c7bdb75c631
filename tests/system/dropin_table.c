/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "dropin_table.h"

#include <errno.h>
#include <fnmatch.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "shared_memory.h"

#define MAX_ROWS 512u

struct row {
    const char *path;
    char where[64], what[16], name[64], limit[16];
    unsigned line, used;
};

struct table {
    unsigned count;
    struct row rows[MAX_ROWS];
};

static struct table *table;

static bool parse(const char *const line, struct row *const row)
{
    int reason = 0;
    return sscanf(line, "%63s %15s %63s %15s %n", row->where, row->what, row->name, row->limit, &reason) == 4 &&
           strlen(line + reason) > 10;
}

/* Before the tests: Check has no test to blame yet. */
static void give_up(const char *const path, const unsigned line, const char *const why)
{
    fprintf(stderr, "%s:%u: %s\n", path, line, why);
    exit(2);
}

void dropin_table_load(const char *const path)
{
    char line[512];
    if (!table)
        table = shared_memory(sizeof *table);
    FILE *const file = fopen(path, "r");
    if (!file) {
        give_up(path, 0, strerror(errno));
        return;
    }
    for (unsigned number = 1; fgets(line, sizeof line, file); number++) {
        if (line[0] == '#' || line[0] == '\n')
            continue;
        struct row *const row = &table->rows[table->count];
        if (table->count == MAX_ROWS || !parse(line, row))
            give_up(path, number, "expected WHERE WHAT NAME LIMIT REASON, and not too many rows");
        row->path = path;
        row->line = number;
        table->count++;
    }
    fclose(file);
}

const char *dropin_table_allows(const char *const where, const char *const what, const char *const name)
{
    for (unsigned i = 0; i < table->count; i++) {
        struct row *const row = &table->rows[i];
        if (strcmp(row->what, what) != 0 || fnmatch(row->where, where, 0) != 0 || fnmatch(row->name, name, 0) != 0)
            continue;
        row->used++;
        return row->limit;
    }
    return NULL;
}

static bool concerns(const struct row *const row, const char *const scope)
{
    char first[64];
    snprintf(first, sizeof first, "%.*s", (int)strcspn(row->where, "/"), row->where);
    return fnmatch(first, scope, 0) == 0;
}

unsigned dropin_table_unused(const char *const scope)
{
    unsigned unused = 0;
    for (unsigned i = 0; i < table->count; i++) {
        const struct row *const row = &table->rows[i];
        if (row->used > 0 || !concerns(row, scope))
            continue;
        printf("%s:%u: nothing like this any more: %s %s %s\n", row->path, row->line, row->where, row->what, row->name);
        unused++;
    }
    return unused;
}

bool dropin_table_has(const char *const scope, const char *const what, const char *const module)
{
    const size_t len = strlen(module);
    for (unsigned i = 0; i < table->count; i++) {
        const struct row *const row = &table->rows[i];
        if (concerns(row, scope) && strcmp(row->what, what) == 0 && strncmp(row->name, module, len) == 0 &&
            row->name[len] == '.')
            return true;
    }
    return false;
}

bool dropin_table_wanted(const char *const where)
{
    const char *const only = getenv("DROPIN_ONLY");
    return !only || fnmatch(only, where, 0) == 0;
}

void dropin_prefix(const char *const card, char *const prefix, const size_t size)
{
    const int stem = strncmp(card, "7i80", 4) == 0 ? 4 : (int)strcspn(card, "_");
    snprintf(prefix, size, "hm2_%.*s.0.", stem, card);
}
