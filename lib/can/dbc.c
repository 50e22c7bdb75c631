/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A DBC file, statement by statement. */
#include "reader.h"

#include <stdlib.h>
#include <string.h>

static int take_nodes_of_file(struct dbc_reader *const r)
{
    const int err = dbc_take(r, DBC_PUNCT, ":");
    if (err)
        return err;
    while (r->lexer.kind == DBC_WORD && !r->lexer.first_in_line) {
        if (r->dbc->node_count >= HM2_DBC_MAX_NODES)
            return dbc_problem(r, HM2_ERR_NOSPACE, r->lexer.token_line, "more than %u nodes", HM2_DBC_MAX_NODES);
        (void)dbc_take_text(r, DBC_WORD, &r->dbc->nodes[r->dbc->node_count++]);
    }
    return 0;
}

static int skip_statement(struct dbc_reader *const r)
{
    while (r->lexer.kind != DBC_END && !dbc_at(r, ";"))
        dbc_lexer_next(&r->lexer);
    return dbc_take(r, DBC_PUNCT, ";");
}

static int skip_version(struct dbc_reader *const r)
{
    if (r->lexer.kind != DBC_STRING)
        return dbc_expected(r, "a text in quotes");
    dbc_lexer_next(&r->lexer);
    return 0;
}

/* The names of the keywords that follow are keywords themselves. */
static int skip_new_symbols(struct dbc_reader *const r)
{
    const int err = dbc_take(r, DBC_PUNCT, ":");
    while (r->lexer.kind == DBC_WORD && !dbc_lexer_is(&r->lexer, DBC_WORD, "BS_") &&
           !dbc_lexer_is(&r->lexer, DBC_WORD, "BU_"))
        dbc_lexer_next(&r->lexer);
    return err;
}

static int skip_bit_timing(struct dbc_reader *const r)
{
    const int err = dbc_take(r, DBC_PUNCT, ":");
    while (r->lexer.kind == DBC_NUMBER || dbc_at(r, ":") || dbc_at(r, ","))
        dbc_lexer_next(&r->lexer);
    return err;
}

static const struct statement {
    const char *keyword;
    int (*read)(struct dbc_reader *reader);
} statements[] = {
    {"VERSION", skip_version},
    {"NS_", skip_new_symbols},
    {"BS_", skip_bit_timing},
    {"BU_", take_nodes_of_file},
    {"BO_", dbc_message},
    {"SG_", dbc_signal},
    {"BO_TX_BU_", dbc_senders},
    {"SIG_VALTYPE_", dbc_value_type},
    {"SG_MUL_VAL_", dbc_mux_values},
    {"VAL_", dbc_values},
    {"BA_DEF_", dbc_attribute},
    {"BA_DEF_DEF_", dbc_attribute_default},
    {"BA_", dbc_attribute_value},
    {"VAL_TABLE_", skip_statement},
    {"EV_", skip_statement},
    {"ENVVAR_DATA_", skip_statement},
    {"EV_DATA_", skip_statement},
    {"SGTYPE_", skip_statement},
    {"SIG_TYPE_REF_", skip_statement},
    {"SIG_GROUP_", skip_statement},
    {"CM_", skip_statement},
    {"BA_DEF_REL_", skip_statement},
    {"BA_DEF_DEF_REL_", skip_statement},
    {"BA_REL_", skip_statement},
    {"BA_DEF_SGTYPE_", skip_statement},
    {"BA_SGTYPE_", skip_statement},
    {"CAT_DEF_", skip_statement},
    {"CAT_", skip_statement},
    {"FILTER", skip_statement},
};

static const struct statement *find_statement(const struct dbc_lexer *const l)
{
    for (size_t i = 0; i < sizeof statements / sizeof statements[0]; i++)
        if (dbc_lexer_is(l, DBC_WORD, statements[i].keyword))
            return &statements[i];
    return NULL;
}

/* After a problem the next line that begins with a keyword is a good place to go on. */
static void go_on(struct dbc_reader *const r)
{
    while (r->lexer.kind != DBC_END && !(r->lexer.first_in_line && find_statement(&r->lexer)))
        dbc_lexer_next(&r->lexer);
}

static void read_statements(struct dbc_reader *const r)
{
    while (r->lexer.kind != DBC_END) {
        const struct statement *const statement = find_statement(&r->lexer);
        if (dbc_at(r, ";")) { /* more of them than needed */
            dbc_lexer_next(&r->lexer);
            continue;
        }
        int err;
        if (statement) {
            dbc_lexer_next(&r->lexer);
            err = statement->read(r);
        } else {
            err = dbc_expected(r, "a keyword (BO_, SG_, VAL_, ...)");
            dbc_lexer_next(&r->lexer);
        }
        if (err == HM2_ERR_NOSPACE || err == HM2_ERR_NOMEM)
            return;
        if (err)
            go_on(r);
    }
}

void hm2_dbc_free(struct hm2_dbc *const dbc)
{
    if (!dbc)
        return;
    free(dbc->messages);
    free(dbc->signals);
    free(dbc->mux);
    free(dbc->values);
    free(dbc->sets);
    free(dbc->strings);
    free(dbc);
}

static int read_text(struct dbc_reader *const r, const char *const text, const size_t len)
{
    /* A name or text of n bytes takes n + 1; what stands between two of them in the file is at least a byte. */
    r->strings = malloc(len + 1u);
    r->dbc = calloc(1, sizeof *r->dbc);
    if (!r->strings || !r->dbc) {
        free(r->strings);
        free(r->dbc);
        r->dbc = NULL;
        return hm2_diag_add(r->diag, HM2_ERR_NOMEM, "%s: no memory for %zu bytes", r->file, len);
    }
    r->dbc->strings = r->strings;
    dbc_lexer_start(&r->lexer, text, len);
    read_statements(r);
    if (!r->err)
        dbc_check(r);
    return r->err;
}

int hm2_dbc_read(const char *const text, const size_t len, const char *const name, struct hm2_dbc **const dbc,
                 struct hm2_diag *const diag)
{
    *dbc = NULL;
    if (len > HM2_DBC_MAX_TEXT)
        return hm2_diag_add(diag, HM2_ERR_NOSPACE, "%s: %zu bytes are more than the %u that are read", name, len,
                            HM2_DBC_MAX_TEXT);
    struct dbc_reader *const reader = calloc(1, sizeof *reader);
    if (!reader)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "%s: no memory", name);
    reader->file = name;
    reader->diag = diag;
    const int err = read_text(reader, text, len);
    if (err)
        hm2_dbc_free(reader->dbc);
    else
        *dbc = reader->dbc;
    free(reader);
    return err;
}
