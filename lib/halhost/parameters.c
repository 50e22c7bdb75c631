/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "parameters.h"

#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int hh_parameters_add(struct hh_parameters *const parameters, const char *const name, const char type,
                      void *const address, const int elements, struct hm2_diag *const diag)
{
    if (strlen(name) >= HH_PARAMETER_NAME_SIZE || (type != 'i' && type != 'l' && type != 's') || elements < 0)
        return hm2_diag_add(diag, HM2_ERR_HOST, "parameter '%s' of the component has an impossible description", name);
    if (parameters->count == HH_PARAMETERS_MAX)
        return hm2_diag_add(diag, HM2_ERR_NOSPACE, "the component has more than %u parameters", HH_PARAMETERS_MAX);
    struct hh_parameter *const items = realloc(parameters->items, (parameters->count + 1) * sizeof *parameters->items);
    if (!items)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for parameter '%s'", name);
    parameters->items = items;
    struct hh_parameter *const item = &items[parameters->count++];
    *item = (struct hh_parameter){.type = type, .address = address, .elements = elements};
    memcpy(item->name, name, strlen(name) + 1);
    return 0;
}

static int refuse_unknown(const struct hh_parameters *const parameters, const char *const component,
                          const char *const argument, struct hm2_diag *const diag)
{
    char known[1024] = "";
    size_t used = 0;
    for (size_t i = 0; i < parameters->count; i++) {
        const int more =
            snprintf(known + used, sizeof known - used, "%s%s", used ? ", " : "", parameters->items[i].name);
        if (more < 0 || used + (size_t)more >= sizeof known)
            break;
        used += (size_t)more;
    }
    return hm2_diag_add(diag, HM2_ERR_INVALID, "component '%s' has no parameter '%.*s' (it has %s)", component,
                        (int)strcspn(argument, "="), argument, used ? known : "none");
}

/* Copy without double quotes, and without single ones around the whole. */
static char *unquoted(const char *const text)
{
    const size_t length = strlen(text);
    const bool single = length >= 2 && text[0] == '\'' && text[length - 1] == '\'';
    char *const copy = malloc(length + 1);
    if (!copy)
        return NULL;
    char *to = copy;
    for (size_t i = single; i < length - single; i++) {
        if (text[i] != '"')
            *to++ = text[i];
    }
    *to = '\0';
    return copy;
}

static int store_text(struct hh_parameters *const parameters, char **const address, const char *const value)
{
    void **const texts = realloc(parameters->texts, (parameters->text_count + 1) * sizeof *texts);
    if (!texts)
        return HM2_ERR_NOMEM;
    parameters->texts = texts;
    char *const copy = strdup(value);
    if (!copy)
        return HM2_ERR_NOMEM;
    texts[parameters->text_count++] = copy;
    *address = copy;
    return 0;
}

static int store(struct hh_parameters *const parameters, const struct hh_parameter *const item, const size_t index,
                 const char *const value, struct hm2_diag *const diag)
{
    if (item->type == 's')
        return store_text(parameters, (char **)item->address + index, value)
                   ? hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for parameter '%s'", item->name)
                   : 0;
    char *end;
    errno = 0;
    const long number = strtol(value, &end, 0);
    while (isspace((unsigned char)*end))
        end++;
    if (end == value || *end)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "parameter '%s': '%s' is not a whole number", item->name, value);
    if (errno || (item->type == 'i' && (number < INT_MIN || number > INT_MAX)))
        return hm2_diag_add(diag, HM2_ERR_RANGE, "parameter '%s': '%s' is too large", item->name, value);
    if (item->type == 'i')
        ((int *)item->address)[index] = (int)number;
    else
        ((long *)item->address)[index] = number;
    return 0;
}

static int store_array(struct hh_parameters *const parameters, const struct hh_parameter *const item, char *const value,
                       struct hm2_diag *const diag)
{
    char *at = value;
    for (size_t index = 0; at; index++) {
        if (index >= (size_t)item->elements)
            return hm2_diag_add(diag, HM2_ERR_RANGE, "parameter '%s' takes at most %d values", item->name,
                                item->elements);
        char *const comma = strchr(at, ',');
        if (comma)
            *comma = '\0';
        const int err = store(parameters, item, index, at, diag);
        if (err)
            return err;
        at = comma ? comma + 1 : NULL;
    }
    return 0;
}

int hh_parameters_set(struct hh_parameters *const parameters, const char *const component, const char *const argument,
                      struct hm2_diag *const diag)
{
    const size_t length = strcspn(argument, "=");
    if (argument[length] != '=')
        return hm2_diag_add(diag, HM2_ERR_INVALID, "component '%s': argument '%s' is not of the form name=value",
                            component, argument);
    const struct hh_parameter *item = NULL;
    for (size_t i = 0; i < parameters->count && !item; i++) {
        const char *const name = parameters->items[i].name;
        if (strlen(name) == length && strncmp(name, argument, length) == 0)
            item = &parameters->items[i];
    }
    if (!item)
        return refuse_unknown(parameters, component, argument, diag);
    char *const value = unquoted(argument + length + 1);
    if (!value)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for parameter '%s'", item->name);
    const int err =
        item->elements ? store_array(parameters, item, value, diag) : store(parameters, item, 0, value, diag);
    free(value);
    return err;
}

void hh_parameters_free(struct hh_parameters *const parameters)
{
    for (size_t i = 0; i < parameters->text_count; i++)
        free(parameters->texts[i]);
    free(parameters->texts);
    free(parameters->items);
    *parameters = (struct hh_parameters){0};
}
