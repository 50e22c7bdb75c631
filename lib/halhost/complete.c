/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Completion: which names can stand at a place of a line. */
#include "commands.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

/* Where the last word begins, which argument it is (0 = the command itself), and the command. */
struct place {
    const char *word;
    size_t argument;
    const struct hal_command *command;
};

static const struct hal_command *command_at(size_t index)
{
    for (const struct hal_command *const *table = hal_command_tables; *table; table++) {
        for (const struct hal_command *command = *table; command->name; command++) {
            if (index-- == 0)
                return command;
        }
    }
    return NULL;
}

static struct place locate(const char *const line)
{
    struct place place = {.word = line};
    const char *at = line;
    const char *first = NULL;
    size_t first_length = 0;
    for (;;) {
        while (isspace((unsigned char)*at))
            at++;
        place.word = at;
        while (*at && !isspace((unsigned char)*at))
            at++;
        if (!*at)
            break;
        if (!first) {
            first = place.word;
            first_length = (size_t)(at - place.word);
        }
        const bool arrow = place.word[0] == '=' || place.word[0] == '<';
        place.argument += !arrow;
    }
    const struct hal_command *command;
    for (size_t i = 0; first && (command = command_at(i)); i++) {
        if (strlen(command->name) == first_length && strncmp(command->name, first, first_length) == 0)
            place.command = command;
    }
    return place;
}

/* ---- sources of names: index counts through the names, NULL ends --------------------------------------------- */

static const char *from_list(const struct hh_list *const list, const size_t index)
{
    return index < list->count ? hh_shown_name(list->items[index]) : NULL;
}

static const char *from_threads(const size_t index)
{
    const struct hh_list *const threads = &hh_host()->threads;
    return index < threads->count ? ((const struct hh_thread *)threads->items[index])->names.name : NULL;
}

static const char *from_modules(const size_t index)
{
    const struct hh_list *const modules = &hh_host()->modules;
    return index < modules->count ? hh_module_name(modules->items[index]) : NULL;
}

static const char *from_objects(const size_t index)
{
    const struct hh *const host = hh_host();
    const size_t pins = host->pins.shown.count;
    return index < pins ? from_list(&host->pins.shown, index) : from_list(&host->params.shown, index - pins);
}

/* The index-th word of a usage text: letters between brackets and bars. */
static const char *from_usage(const char *const usage, size_t index, char *const buffer, const size_t size)
{
    for (const char *at = usage; *at;) {
        const size_t length = strspn(at, "abcdefghijklmnopqrstuvwxyz0123456789");
        if (length > 0 && length < size && index-- == 0) {
            memcpy(buffer, at, length);
            buffer[length] = '\0';
            return buffer;
        }
        at += length + (at[length] != '\0');
    }
    return NULL;
}

static const char *candidate(const struct place *const place, const size_t index, char *const buffer, const size_t size)
{
    const struct hh *const host = hh_host();
    if (place->argument == 0) {
        const struct hal_command *const command = command_at(index);
        return command ? command->name : NULL;
    }
    const char *const kinds = place->command ? place->command->completes : "";
    const size_t count = strlen(kinds);
    if (count == 0)
        return NULL;
    switch (kinds[place->argument <= count ? place->argument - 1 : count - 1]) {
    case 'p':
        return from_list(&host->pins.shown, index);
    case 'P':
        return from_objects(index);
    case 's':
        return from_list(&host->signals.shown, index);
    case 'f':
        return from_list(&host->functs.shown, index);
    case 't':
        return from_threads(index);
    case 'c':
        return from_modules(index);
    case 'l':
        return hh_loadable(index, buffer, size);
    case 'h':
        return command_at(index) ? command_at(index)->name : NULL;
    case 'w':
        return from_usage(place->command->usage, index, buffer, size);
    default:
        return NULL;
    }
}

bool hal_session_complete(const struct hal_session *const session, const char *const line, size_t *const state,
                          char *const name, const size_t size)
{
    (void)session;
    const struct place place = locate(line);
    const size_t length = strlen(place.word);
    char buffer[HH_NAME_SIZE];
    const char *found;
    while ((found = candidate(&place, (*state)++, buffer, sizeof buffer))) {
        if (strncmp(found, place.word, length) == 0) {
            (void)snprintf(name, size, "%s", found);
            return true;
        }
    }
    return false;
}
