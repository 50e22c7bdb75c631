/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "tokens.h"

#include <ctype.h>
#include <stdbool.h>
#include <string.h>

/* ---- lines ------------------------------------------------------------------------------------------------------ */

/* Append the next physical line. 1 = it ends in a backslash, 0 = the line is complete, negative = error. */
static int append_physical(struct hal_reader *const reader, struct hal_line *const line, size_t *const used,
                           struct hm2_diag *const diag)
{
    const size_t left = (size_t)(reader->end - reader->at);
    const char *const newline = memchr(reader->at, '\n', left);
    size_t length = newline ? (size_t)(newline - reader->at) : left;
    const char *const start = reader->at;
    reader->at += length + (newline ? 1 : 0);
    reader->line++;
    if (length > 0 && start[length - 1] == '\r')
        length--;
    const bool continues = length > 0 && start[length - 1] == '\\';
    length -= continues;
    if (memchr(start, '\0', length))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "the line contains a NUL character; is this a text file?");
    if (length > HAL_LINE_MAX - *used)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "the line is longer than %u characters", HAL_LINE_MAX);
    if (length > 0)
        memcpy(line->text + *used, start, length);
    *used += length;
    return continues && newline;
}

int hal_reader_next(struct hal_reader *const reader, struct hal_line *const line, struct hm2_diag *const diag)
{
    if (reader->at >= reader->end)
        return 0;
    size_t used = 0;
    int more = 1;
    line->number = reader->line + 1;
    while (more > 0 && reader->at < reader->end)
        more = append_physical(reader, line, &used, diag);
    line->text[used] = '\0';
    return more < 0 ? more : 1;
}

/* ---- replacement ------------------------------------------------------------------------------------------------ */

struct output {
    char *text;
    size_t used;
};

static int put(struct output *const output, const char *const text, const size_t length, struct hm2_diag *const diag)
{
    if (length > HAL_LINE_MAX - output->used)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "after replacing variables the line is longer than %u characters",
                            HAL_LINE_MAX);
    memcpy(output->text + output->used, text, length);
    output->used += length;
    return 0;
}

static bool in_name(const char c)
{
    return isalnum((unsigned char)c) || c == '_' || c == '-';
}

static int copy_name(char name[const HAL_NAME_MAX + 1], const char *const from, const size_t length,
                     struct hm2_diag *const diag)
{
    if (length == 0)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "a variable has no name");
    if (length > HAL_NAME_MAX)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "a variable's name is longer than %u characters", HAL_NAME_MAX);
    memcpy(name, from, length);
    name[length] = '\0';
    return 0;
}

/* NAME or (NAME); moves *at behind it. */
static int read_name(const char **const at, char name[const HAL_NAME_MAX + 1], struct hm2_diag *const diag)
{
    const char *start = *at;
    if (*start == '(') {
        const char *const close = strchr(++start, ')');
        if (!close)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "a variable's name has no closing parenthesis");
        *at = close + 1;
        return copy_name(name, start, (size_t)(close - start), diag);
    }
    while (in_name(**at))
        (*at)++;
    return copy_name(name, start, (size_t)(*at - start), diag);
}

static int replace_environment(const char **const at, const struct hal_variables *const variables,
                               struct output *const output, struct hm2_diag *const diag)
{
    char name[HAL_NAME_MAX + 1];
    (*at)++;
    const int err = read_name(at, name, diag);
    if (err)
        return err;
    const char *const value = variables->environment ? variables->environment(variables->context, name) : NULL;
    if (!value)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "environment variable '%s' is not set", name);
    return put(output, value, strlen(value), diag);
}

static int replace_ini(const char **const at, const struct hal_variables *const variables, struct output *const output,
                       struct hm2_diag *const diag)
{
    char section[HAL_NAME_MAX + 1], name[HAL_NAME_MAX + 1];
    const char *const start = *at + 1, *const close = strchr(start, ']');
    if (!close)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "an INI variable's section has no closing bracket");
    *at = close + 1;
    int err = copy_name(section, start, (size_t)(close - start), diag);
    if (!err)
        err = read_name(at, name, diag);
    if (err)
        return err;
    const char *const value = variables->ini ? variables->ini(variables->context, section, name) : NULL;
    if (!value)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "INI variable '[%s]%s' is not set", section, name);
    return put(output, value, strlen(value), diag);
}

/* Quote state after a character: 0, ' or ". */
static char quote_after(const char quote, const char c)
{
    if (quote)
        return c == quote ? '\0' : quote;
    return c == '"' || c == '\'' ? c : '\0';
}

static int replace(const char *const line, const struct hal_variables *const variables, struct output *const output,
                   struct hm2_diag *const diag)
{
    char quote = '\0';
    int err = 0;
    for (const char *at = line; *at && !err;) {
        if (*at == '#' && !quote)
            break;
        if (*at == '$') {
            err = replace_environment(&at, variables, output, diag);
        } else if (*at == '[') {
            err = replace_ini(&at, variables, output, diag);
        } else {
            quote = quote_after(quote, *at);
            err = put(output, at++, 1, diag);
        }
    }
    output->text[output->used] = '\0';
    return err;
}

/* ---- words ------------------------------------------------------------------------------------------------------ */

int hal_tokens_parse(struct hal_tokens *const tokens, const char *const line,
                     const struct hal_variables *const variables, struct hm2_diag *const diag)
{
    struct output output = {.text = tokens->text};
    tokens->count = 0;
    const int err = replace(line, variables, &output, diag);
    if (err)
        return err;
    for (char *at = tokens->text;;) {
        while (isspace((unsigned char)*at))
            at++;
        if (!*at)
            return 0;
        if (tokens->count == HAL_TOKENS_MAX)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "the line has more than %u words", HAL_TOKENS_MAX);
        tokens->items[tokens->count++] = at;
        char quote = '\0';
        for (; *at && (quote || !isspace((unsigned char)*at)); at++)
            quote = quote_after(quote, *at);
        if (quote)
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "a quoted text is not closed");
        if (*at)
            *at++ = '\0';
    }
}

char *hal_unquote(char *const word)
{
    const size_t length = strlen(word);
    if (length < 2 || (word[0] != '"' && word[0] != '\'') || word[length - 1] != word[0])
        return word;
    word[length - 1] = '\0';
    return word + 1;
}
