/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "lexer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NUMBER_SIZE 64u

static bool is_digit(const char c)
{
    return c >= '0' && c <= '9';
}

/* No locale has a say in what a name is. */
static bool is_name(const char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || is_digit(c);
}

static void skip_blanks(struct dbc_lexer *const l)
{
    for (; l->at < l->end; l->at++) {
        if (*l->at == '\n') {
            l->line++;
            l->first_in_line = true;
        } else if (*l->at != ' ' && *l->at != '\t' && *l->at != '\r') {
            return;
        }
    }
}

static const char *skip_digits(const char *at, const char *const end)
{
    while (at < end && is_digit(*at))
        at++;
    return at;
}

/* A sign belongs to the number that it touches. */
static const char *end_of_number(const struct dbc_lexer *const l)
{
    const char *at = l->at;
    if (*at == '-' || *at == '+')
        at++;
    const char *const digits = at;
    at = skip_digits(at, l->end);
    if (at < l->end && *at == '.')
        at = skip_digits(at + 1, l->end);
    if (at == digits || (at == digits + 1 && *digits == '.'))
        return NULL;
    if (at < l->end && (*at == 'e' || *at == 'E')) {
        const char *exponent = at + 1;
        if (exponent < l->end && (*exponent == '-' || *exponent == '+'))
            exponent++;
        if (exponent < l->end && is_digit(*exponent))
            at = skip_digits(exponent, l->end);
    }
    return at;
}

static void take_string(struct dbc_lexer *const l)
{
    const char *at = ++l->start;
    for (; at < l->end && *at != '"'; at++) {
        if (*at == '\n')
            l->line++;
        if (*at == '\\' && at + 1 < l->end && at[1] == '"')
            at++;
    }
    l->kind = at < l->end ? DBC_STRING : DBC_BAD;
    l->len = (size_t)(at - l->start);
    l->at = at < l->end ? at + 1 : at;
}

static void take(struct dbc_lexer *const l, const enum dbc_token_kind kind, const char *const end)
{
    l->kind = kind;
    l->len = (size_t)(end - l->start);
    l->at = end;
}

void dbc_lexer_next(struct dbc_lexer *const l)
{
    l->first_in_line = false;
    skip_blanks(l);
    l->start = l->at;
    l->token_line = l->line;
    if (l->at >= l->end) {
        take(l, DBC_END, l->at);
    } else if (*l->at == '"') {
        take_string(l);
    } else if (is_name(*l->at) && !is_digit(*l->at)) {
        const char *at = l->at;
        while (at < l->end && is_name(*at))
            at++;
        take(l, DBC_WORD, at);
    } else {
        const char *const number = end_of_number(l);
        const bool known = strchr(":;,|@()[]+-", *l->at) && *l->at;
        take(l, number ? DBC_NUMBER : known ? DBC_PUNCT : DBC_BAD, number ? number : l->at + 1);
    }
}

void dbc_lexer_start(struct dbc_lexer *const l, const char *const text, const size_t len)
{
    *l = (struct dbc_lexer){.at = text, .end = text + len, .line = 1};
    dbc_lexer_next(l);
    l->first_in_line = true;
}

bool dbc_lexer_is(const struct dbc_lexer *const l, const enum dbc_token_kind kind, const char *const text)
{
    return l->kind == kind && l->len == strlen(text) && memcmp(l->start, text, l->len) == 0;
}

bool dbc_lexer_number(const struct dbc_lexer *const l, double *const value)
{
    char text[NUMBER_SIZE];
    if (l->kind != DBC_NUMBER || l->len >= sizeof text)
        return false;
    memcpy(text, l->start, l->len);
    text[l->len] = '\0';
    *value = strtod(text, NULL);
    return isfinite(*value) != 0;
}
