/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "ini.h"

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int ini_problem(struct ini *const ini, const int err, const unsigned line, const char *const format, ...)
{
    char sentence[400];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(sentence, sizeof sentence, format, arguments);
    va_end(arguments);
    if (!ini->err)
        ini->err = err;
    if (line)
        return hm2_diag_add(ini->diag, err, "%s:%u: %s", ini->file_name, line, sentence);
    return hm2_diag_add(ini->diag, err, "%s: %s", ini->file_name, sentence);
}

static char *trim(char *text)
{
    while (isspace((unsigned char)*text))
        text++;
    size_t length = strlen(text);
    while (length > 0 && isspace((unsigned char)text[length - 1]))
        text[--length] = '\0';
    return text;
}

/* There are no more entries than lines. */
static size_t count_lines(const char *const text)
{
    size_t lines = 1;
    for (const char *c = text; *c; c++)
        lines += *c == '\n';
    return lines;
}

static void parse_line(struct ini *const ini, char *const line, const char **const section, const unsigned number)
{
    char *const text = trim(line);
    if (*text == '\0' || *text == '#' || *text == ';')
        return;
    if (*text == '[') {
        char *const close = strchr(text, ']');
        if (!close) {
            (void)ini_problem(ini, HM2_ERR_MALFORMED, number, "a section name has no ']'");
            return;
        }
        *close = '\0';
        *section = trim(text + 1);
        return;
    }
    char *const equals = strchr(text, '=');
    if (!equals) {
        (void)ini_problem(ini, HM2_ERR_MALFORMED, number, "'%.40s' is neither [SECTION] nor NAME=VALUE", text);
        return;
    }
    *equals = '\0';
    ini->entries[ini->count++] = (struct ini_entry){*section, trim(text), trim(equals + 1), number, false};
}

int ini_parse(struct ini *const ini, const char *const text, const size_t length, const char *const file_name,
              struct hm2_diag *const diag)
{
    *ini = (struct ini){.file_name = file_name, .diag = diag};
    if (memchr(text, '\0', length))
        return ini_problem(ini, HM2_ERR_MALFORMED, 0, "is not a text file: it has a byte 0 in it");
    ini->text = strndup(text, length);
    ini->entries = ini->text ? calloc(count_lines(ini->text), sizeof *ini->entries) : NULL;
    if (!ini->entries)
        return ini_problem(ini, HM2_ERR_NOMEM, 0, "no memory to read it");
    const char *section = "";
    unsigned number = 0;
    for (char *line = ini->text, *next; line; line = next) {
        next = strchr(line, '\n');
        if (next)
            *next++ = '\0';
        parse_line(ini, line, &section, ++number);
    }
    return ini->err;
}

void ini_free(struct ini *const ini)
{
    free(ini->entries);
    free(ini->text);
}

const struct ini_entry *ini_find(struct ini *const ini, const char *const section, const char *const name)
{
    for (size_t i = 0; i < ini->count; i++) {
        struct ini_entry *const entry = &ini->entries[i];
        if (strcmp(entry->name, name) == 0 && strcmp(entry->section, section) == 0) {
            entry->used = true;
            return entry;
        }
    }
    return NULL;
}

bool ini_has_section(const struct ini *const ini, const char *const section)
{
    for (size_t i = 0; i < ini->count; i++)
        if (strcmp(ini->entries[i].section, section) == 0)
            return true;
    return false;
}

void ini_warn_unused(const struct ini *const ini)
{
    for (size_t i = 0; i < ini->count; i++)
        if (!ini->entries[i].used)
            hm2_diag_warn(ini->diag, "%s:%u: [%.40s] %.40s has no effect: unknown there, given before, or not counted",
                          ini->file_name, ini->entries[i].line, ini->entries[i].section, ini->entries[i].name);
}

int ini_number(struct ini *const ini, const struct ini_entry *const entry, const char *const text, const double min,
               const double max, const bool integer, double *const value)
{
    char *end;
    const double number = strtod(text, &end);
    const bool is_hex = strchr(text, 'x') || strchr(text, 'X');
    if (end == text || *end != '\0' || !isfinite(number) || (integer && (is_hex || floor(number) < number)))
        return ini_problem(ini, HM2_ERR_MALFORMED, entry->line, "%s: '%.40s' is not a %s", entry->name, text,
                           integer ? "whole decimal number" : "number");
    if (number < min || number > max)
        return ini_problem(ini, HM2_ERR_RANGE, entry->line, "%s: %.40s is outside of %.10g to %.10g", entry->name, text,
                           min, max);
    *value = number;
    return 0;
}
