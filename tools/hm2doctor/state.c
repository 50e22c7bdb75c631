/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Facts by path: from this computer, or from a folder that was saved. */
#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "doctor.h"
#include "live.h"

#define PATH_BYTES 512u
#define ASKED      "doctor/"

static bool read_file(const char *const path, char *const text, const size_t cap)
{
    FILE *const file = fopen(path, "r");
    if (!file)
        return false;
    const size_t len = fread(text, 1, cap - 1, file);
    const bool good = !ferror(file);
    text[len] = '\0';
    fclose(file);
    return good;
}

static bool make_folders(char *const path)
{
    for (char *at = strchr(path + 1, '/'); at; at = strchr(at + 1, '/')) {
        *at = '\0';
        const bool made = mkdir(path, 0755) == 0 || errno == EEXIST;
        *at = '/';
        if (!made)
            return false;
    }
    return true;
}

static void save(struct state *const state, const char *const path, const char *const text)
{
    char full[2 * PATH_BYTES];
    const int len = snprintf(full, sizeof full, "%s/%s", state->save, path);
    FILE *const file = len > 0 && (size_t)len < sizeof full && make_folders(full) ? fopen(full, "w") : NULL;
    const bool written = file && fprintf(file, "%s\n", text) >= 0;
    if (!file || fclose(file) != 0 || !written)
        state->save_failed = true;
}

static bool get(struct state *const state, char *const text, const size_t cap, const char *const path)
{
    char full[2 * PATH_BYTES];
    if (!state->folder && strncmp(path, ASKED, strlen(ASKED)) == 0)
        return live_ask(path + strlen(ASKED), text, cap);
    const int len = snprintf(full, sizeof full, "%s/%s", state->folder ? state->folder : "", path);
    return len > 0 && (size_t)len < sizeof full && read_file(full, text, cap);
}

static bool get_text(struct state *const state, char *const text, const size_t cap, const char *const format,
                     va_list values)
{
    char path[PATH_BYTES];
    const int len = vsnprintf(path, sizeof path, format, values);
    if (len <= 0 || (size_t)len >= sizeof path || !get(state, text, cap, path))
        return false;
    for (size_t end = strlen(text); end > 0 && isspace((unsigned char)text[end - 1]); end--)
        text[end - 1] = '\0';
    if (state->save)
        save(state, path, text);
    return true;
}

bool state_text(struct state *const state, char *const text, const size_t cap, const char *const path, ...)
{
    va_list values;
    va_start(values, path);
    const bool found = get_text(state, text, cap, path, values);
    va_end(values);
    return found;
}

bool state_number(struct state *const state, long long *const number, const char *const path, ...)
{
    char text[64], *end = text;
    va_list values;
    va_start(values, path);
    const bool found = get_text(state, text, sizeof text, path, values);
    va_end(values);
    if (found)
        *number = strtoll(text, &end, 10);
    return found && end != text;
}

/* Behind the name at the beginning of a line, or NULL. */
static const char *behind(const char *const text, const char *const name)
{
    const size_t len = strlen(name);
    for (const char *at = text; at; at = strchr(at, '\n')) {
        at += *at == '\n';
        if (strncmp(at, name, len) == 0 && isspace((unsigned char)at[len]))
            return at + len + strspn(at + len, " \t");
    }
    return NULL;
}

bool text_named_word(const char *const text, const char *const name, char *const word, const size_t cap)
{
    const char *const at = behind(text, name);
    const size_t len = at ? strcspn(at, " \t\n") : 0;
    if (len == 0 || len >= cap)
        return false;
    memcpy(word, at, len);
    word[len] = '\0';
    return true;
}

bool text_named_number(const char *const text, const char *const name, long long *const number)
{
    char word[24], *end;
    if (!text_named_word(text, name, word, sizeof word))
        return false;
    errno = 0;
    *number = strtoll(word, &end, 10);
    return *end == '\0' && errno == 0;
}
