/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The tokens of a DBC file. */
#ifndef HM2_CAN_LEXER_H
#define HM2_CAN_LEXER_H

#include <stdbool.h>
#include <stddef.h>

enum dbc_token_kind { DBC_END, DBC_WORD, DBC_NUMBER, DBC_STRING, DBC_PUNCT, DBC_BAD };

struct dbc_lexer {
    const char *at, *end; /* of the text that follows the token */
    unsigned line;        /* where at is */
    /* The token that comes next. Of a string what stands between its quotes. */
    enum dbc_token_kind kind;
    const char *start;
    size_t len;
    unsigned token_line;
    bool first_in_line;
};

void dbc_lexer_start(struct dbc_lexer *lexer, const char *text, size_t len);
/* Go to the next token. */
void dbc_lexer_next(struct dbc_lexer *lexer);
bool dbc_lexer_is(const struct dbc_lexer *lexer, enum dbc_token_kind kind, const char *text);
/* Of a number token that is not longer than a number ever is; false otherwise, and for what is not finite. */
bool dbc_lexer_number(const struct dbc_lexer *lexer, double *value);

#endif
