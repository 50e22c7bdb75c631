/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "inifile.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

struct entry {
    const char *section, *name, *value;
};

struct inifile {
    char *text;
    struct entry *entries;
    size_t count, capacity;
};

static char *trim(char *text)
{
    while (isspace((unsigned char)*text))
        text++;
    size_t length = strlen(text);
    while (length > 0 && isspace((unsigned char)text[length - 1]))
        text[--length] = '\0';
    return text;
}

static int add(struct inifile *const ini, const struct entry entry)
{
    if (ini->count == ini->capacity) {
        const size_t capacity = ini->capacity ? 2 * ini->capacity : 64;
        struct entry *const entries = realloc(ini->entries, capacity * sizeof *entries);
        if (!entries)
            return HM2_ERR_NOMEM;
        ini->entries = entries;
        ini->capacity = capacity;
    }
    ini->entries[ini->count++] = entry;
    return 0;
}

static int parse_line(struct inifile *const ini, char *const line, const char **const section,
                      const char *const file_name, const unsigned number, struct hm2_diag *const diag)
{
    char *const text = trim(line);
    if (*text == '\0' || *text == '#' || *text == ';')
        return 0;
    if (*text == '[') {
        char *const close = strchr(text, ']');
        if (!close)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s:%u: a section name has no ']'", file_name, number);
        *close = '\0';
        *section = trim(text + 1);
        return 0;
    }
    char *const equals = strchr(text, '=');
    if (!equals)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s:%u: '%.40s' is neither [SECTION] nor NAME = value", file_name,
                            number, text);
    *equals = '\0';
    const struct entry entry = {*section, trim(text), trim(equals + 1)};
    return add(ini, entry) ? hm2_diag_add(diag, HM2_ERR_NOMEM, "%s:%u: no memory", file_name, number) : 0;
}

struct inifile *inifile_parse(const char *const text, const size_t length, const char *const name,
                              struct hm2_diag *const diag)
{
    struct inifile *const ini = calloc(1, sizeof *ini);
    char *const copy = ini ? strndup(text, length) : NULL;
    if (!copy) {
        free(ini);
        hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: no memory", name);
        return NULL;
    }
    ini->text = copy;
    const char *section = "";
    unsigned number = 0;
    for (char *line = copy, *next; line; line = next) {
        next = strchr(line, '\n');
        if (next)
            *next++ = '\0';
        if (parse_line(ini, line, &section, name, ++number, diag)) {
            inifile_free(ini);
            return NULL;
        }
    }
    return ini;
}

const char *inifile_get(const struct inifile *const ini, const char *const section, const char *const name)
{
    for (size_t i = 0; i < ini->count; i++) {
        const struct entry *const entry = &ini->entries[i];
        if (strcmp(entry->section, section) == 0 && strcmp(entry->name, name) == 0)
            return entry->value;
    }
    return NULL;
}

void inifile_free(struct inifile *const ini)
{
    if (ini) {
        free(ini->entries);
        free(ini->text);
        free(ini);
    }
}
