/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* DBC files: taking tokens, and keeping what was read. */
#include "reader.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int dbc_problem(struct dbc_reader *const r, const int err, const unsigned line, const char *const format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    (void)hm2_diag_add(r->diag, err, "%s:%u: %s", r->file, line, text);
    r->problems++;
    if (r->err == 0)
        r->err = err;
    return err;
}

int dbc_expected(struct dbc_reader *const r, const char *const what)
{
    const struct dbc_lexer *const l = &r->lexer;
    if (l->kind == DBC_END)
        return dbc_problem(r, HM2_ERR_MALFORMED, l->token_line, "expected %s, found the end of the file", what);
    return dbc_problem(r, HM2_ERR_MALFORMED, l->token_line, "expected %s, found \"%.*s\"%s", what,
                       (int)(l->len < 40u ? l->len : 40u), l->start,
                       l->kind == DBC_BAD && l->len > 1u ? ", a text without an end" : "");
}

bool dbc_at(const struct dbc_reader *const r, const char *const punctuation)
{
    return dbc_lexer_is(&r->lexer, DBC_PUNCT, punctuation);
}

int dbc_take(struct dbc_reader *const r, const enum dbc_token_kind kind, const char *const text)
{
    if (!dbc_lexer_is(&r->lexer, kind, text)) {
        char what[40];
        (void)snprintf(what, sizeof what, "\"%s\"", text);
        return dbc_expected(r, what);
    }
    dbc_lexer_next(&r->lexer);
    return 0;
}

int dbc_take_number(struct dbc_reader *const r, double *const value)
{
    if (!dbc_lexer_number(&r->lexer, value))
        return dbc_expected(r, "a number");
    dbc_lexer_next(&r->lexer);
    return 0;
}

int dbc_take_integer(struct dbc_reader *const r, const char *const what, const double low, const double high,
                     double *const value)
{
    const unsigned line = r->lexer.token_line;
    const int err = dbc_take_number(r, value);
    if (err)
        return err;
    if (*value < low || *value > high || floor(*value) < *value)
        return dbc_problem(r, HM2_ERR_RANGE, line, "%s is %.15g, expected a whole number from %.15g to %.15g", what,
                           *value, low, high);
    return 0;
}

int dbc_take_word(struct dbc_reader *const r, struct dbc_text *const word)
{
    if (r->lexer.kind != DBC_WORD)
        return dbc_expected(r, "a name");
    *word = (struct dbc_text){r->lexer.start, r->lexer.len};
    dbc_lexer_next(&r->lexer);
    return 0;
}

int dbc_take_text(struct dbc_reader *const r, const enum dbc_token_kind kind, const char **const text)
{
    if (r->lexer.kind != kind)
        return dbc_expected(r, kind == DBC_STRING ? "a text in quotes" : "a name");
    char *const place = r->strings + r->strings_used;
    memcpy(place, r->lexer.start, r->lexer.len);
    place[r->lexer.len] = '\0';
    r->strings_used += r->lexer.len + 1u;
    *text = place;
    dbc_lexer_next(&r->lexer);
    return 0;
}

int dbc_grow(struct dbc_reader *const r, void *const array, const size_t size, const uint32_t used,
             uint32_t *const room, const uint32_t limit, const char *const what)
{
    void *old, *bigger;
    if (used >= limit)
        return dbc_problem(r, HM2_ERR_NOSPACE, r->lexer.token_line, "more than %u %s", limit, what);
    if (used < *room)
        return 0;
    const uint32_t wanted = *room ? *room * 2u : 16u;
    memcpy(&old, array, sizeof old);
    bigger = realloc(old, wanted * size);
    if (!bigger)
        return dbc_problem(r, HM2_ERR_NOMEM, r->lexer.token_line, "no memory for %u %s", wanted, what);
    memcpy(array, &bigger, sizeof bigger);
    *room = wanted;
    return 0; /* cppcheck-suppress memleak ; the array has it */
}

int dbc_add_set(struct dbc_reader *const r, uint32_t *const set)
{
    struct hm2_dbc *const dbc = r->dbc;
    const int err = dbc_grow(r, &dbc->sets, sizeof dbc->sets[0], dbc->set_count, &r->set_room,
                             HM2_DBC_MAX_MESSAGES + HM2_DBC_MAX_SIGNALS, "sets of nodes");
    if (err)
        return err;
    memset(dbc->sets[dbc->set_count], 0, sizeof dbc->sets[0]);
    *set = dbc->set_count++;
    return 0;
}

static int node_index(const struct hm2_dbc *const dbc, const char *const name, const size_t len)
{
    static const char anybody[] = "Vector__XXX";
    if (len == sizeof anybody - 1u && memcmp(name, anybody, len) == 0)
        return (int)HM2_DBC_ANYBODY;
    for (uint32_t i = 0; i < dbc->node_count; i++)
        if (strlen(dbc->nodes[i]) == len && memcmp(dbc->nodes[i], name, len) == 0)
            return (int)i;
    return HM2_ERR_NOTFOUND;
}

int hm2_dbc_node(const struct hm2_dbc *const dbc, const char *const name)
{
    return node_index(dbc, name, strlen(name));
}

bool hm2_dbc_has(const struct hm2_dbc *const dbc, const uint32_t set, const unsigned node)
{
    return node <= HM2_DBC_ANYBODY && (dbc->sets[set][node / 32u] >> node % 32u & 1u) != 0;
}

int dbc_take_nodes(struct dbc_reader *const r, const uint32_t set)
{
    struct dbc_text word;
    while (r->lexer.kind == DBC_WORD && !r->lexer.first_in_line) {
        const unsigned line = r->lexer.token_line;
        (void)dbc_take_word(r, &word);
        const int node = node_index(r->dbc, word.start, word.len);
        if (node < 0)
            return dbc_problem(r, HM2_ERR_INVALID, line, "no node is named %.*s in BU_", (int)word.len, word.start);
        r->dbc->sets[set][node / 32] |= 1u << node % 32;
        if (dbc_at(r, ","))
            dbc_lexer_next(&r->lexer);
    }
    return 0;
}

static bool has_id(const struct hm2_dbc_message *const m, const double file_id)
{
    return (double)m->id + (m->extended ? 2147483648.0 : 0.0) == file_id;
}

struct hm2_dbc_message *dbc_find_message(struct dbc_reader *const r, const double file_id)
{
    struct hm2_dbc *const dbc = r->dbc;
    if (r->last < dbc->message_count && has_id(&dbc->messages[r->last], file_id))
        return &dbc->messages[r->last];
    for (r->last = 0; r->last < dbc->message_count; r->last++)
        if (has_id(&dbc->messages[r->last], file_id))
            return &dbc->messages[r->last];
    return NULL;
}

uint32_t dbc_find_signal(const struct dbc_reader *const r, const struct hm2_dbc_message *const m,
                         const struct dbc_text name)
{
    for (uint32_t i = m->first_signal; i < m->first_signal + m->signal_count; i++)
        if (strlen(r->dbc->signals[i].name) == name.len && memcmp(r->dbc->signals[i].name, name.start, name.len) == 0)
            return i;
    return HM2_DBC_NO_SIGNAL;
}
