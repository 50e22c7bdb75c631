/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Lines of HAL files and their words, by halcmd's rules: a backslash at the end of a line continues it; "#" outside
 * of quotes begins a comment; $NAME, $(NAME), [SECTION]NAME and [SECTION](NAME) are replaced, also inside quotes; then
 * the line is cut at blanks outside of quotes. Quotes stay part of a word.
 */
#ifndef HALHOST_TOKENS_H
#define HALHOST_TOKENS_H

#include <stddef.h>

#include <hm2/err.h>

#define HAL_LINE_MAX   8192u /* characters of a line with its continuations, before and after replacement */
#define HAL_TOKENS_MAX 256u
#define HAL_NAME_MAX   128u /* characters of a variable's or section's name */

struct hal_reader {
    const char *at, *end;
    unsigned line; /* of the last physical line read */
};

struct hal_line {
    char text[HAL_LINE_MAX + 1];
    unsigned number; /* of its first physical line, from 1 */
};

/* 1 = a line, 0 = end of the text, negative = error (line->number is valid). */
int hal_reader_next(struct hal_reader *reader, struct hal_line *line, struct hm2_diag *diag);

/* Values of variables; NULL results mean that there is no such variable. Either function may be NULL. */
struct hal_variables {
    const char *(*environment)(void *context, const char *name);
    const char *(*ini)(void *context, const char *section, const char *name);
    void *context;
};

struct hal_tokens {
    char text[HAL_LINE_MAX + 1];
    char *items[HAL_TOKENS_MAX];
    size_t count;
};

/* 0 (also for an empty line: count 0) or a negative error. */
int hal_tokens_parse(struct hal_tokens *tokens, const char *line, const struct hal_variables *variables,
                     struct hm2_diag *diag);

/* Take away the quotes around a whole word, in place. */
char *hal_unquote(char *word);

#endif
