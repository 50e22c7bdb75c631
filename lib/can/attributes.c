/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The attributes of messages and signals that say how a message is sent. */
#include "reader.h"

#include <string.h>

/* One attribute: what its value does to a message, or to a signal. text is the value's name in an enumeration, or the
 * value itself. */
static void set_format(struct hm2_dbc_message *const m, const double number, const struct dbc_text text)
{
    (void)number;
    static const char fd[] = "_FD";
    m->fd = text.len > 3u && memcmp(text.start + text.len - 3u, fd, 3u) == 0;
}

static void set_cycle_time(struct hm2_dbc_message *const m, const double number, const struct dbc_text text)
{
    (void)text;
    m->cycle_ms = number > 0.0 && number <= 4294967295.0 ? (uint32_t)number : 0;
}

static char lower(const char c)
{
    return c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : c;
}

static bool begins(const struct dbc_text text, const char *const start)
{
    const size_t len = strlen(start);
    if (text.len < len)
        return false;
    for (size_t i = 0; i < len; i++)
        if (lower(text.start[i]) != start[i])
            return false;
    return true;
}

static void set_send_type(struct hm2_dbc_message *const m, const double number, const struct dbc_text text)
{
    (void)number;
    m->on_change = begins(text, "onchange") || begins(text, "onwrite") || begins(text, "spontan");
}

static const struct attribute {
    const char *name;
    void (*set)(struct hm2_dbc_message *message, double number, struct dbc_text text); /* NULL: of signals */
} attributes[DBC_ATTRIBUTES] = {
    {"VFrameFormat", set_format},
    {"GenMsgCycleTime", set_cycle_time},
    {"GenMsgSendType", set_send_type},
    {"GenSigStartValue", NULL},
};

/* Index of the attribute whose name in quotes comes next; DBC_ATTRIBUTES for one that means nothing here. */
static int take_attribute(struct dbc_reader *const r, unsigned *const index)
{
    if (r->lexer.kind != DBC_STRING)
        return dbc_expected(r, "the name of an attribute in quotes");
    for (*index = 0; *index < DBC_ATTRIBUTES; ++*index)
        if (dbc_lexer_is(&r->lexer, DBC_STRING, attributes[*index].name))
            break;
    dbc_lexer_next(&r->lexer);
    return 0;
}

static int skip_rest(struct dbc_reader *const r)
{
    while (r->lexer.kind != DBC_END && !dbc_at(r, ";"))
        dbc_lexer_next(&r->lexer);
    return dbc_take(r, DBC_PUNCT, ";");
}

/* BA_DEF_ [object] "name" type ...; of which the names of an enumeration are kept. */
int dbc_attribute(struct dbc_reader *const r)
{
    unsigned index = DBC_ATTRIBUTES;
    if (r->lexer.kind == DBC_WORD)
        dbc_lexer_next(&r->lexer);
    const int err = take_attribute(r, &index);
    if (err || index >= DBC_ATTRIBUTES || !dbc_lexer_is(&r->lexer, DBC_WORD, "ENUM"))
        return err ? err : skip_rest(r);
    struct dbc_attribute_values *const values = &r->attributes[index];
    values->count = 0;
    dbc_lexer_next(&r->lexer);
    while (r->lexer.kind == DBC_STRING && values->count < DBC_ENUM_TEXTS) {
        values->texts[values->count++] = (struct dbc_text){r->lexer.start, r->lexer.len};
        dbc_lexer_next(&r->lexer);
        if (dbc_at(r, ","))
            dbc_lexer_next(&r->lexer);
    }
    return skip_rest(r);
}

/* A number or a text; of an enumeration the text that belongs to the number. */
static int take_value(struct dbc_reader *const r, const unsigned index, double *const number,
                      struct dbc_text *const text)
{
    const struct dbc_attribute_values *const values = &r->attributes[index];
    *number = 0;
    *text = (struct dbc_text){"", 0};
    if (r->lexer.kind == DBC_STRING) {
        *text = (struct dbc_text){r->lexer.start, r->lexer.len};
        dbc_lexer_next(&r->lexer);
        return dbc_take(r, DBC_PUNCT, ";");
    }
    const int err = dbc_take_number(r, number);
    if (!err && *number >= 0.0 && *number < (double)values->count)
        *text = values->texts[(unsigned)*number];
    return err ? err : dbc_take(r, DBC_PUNCT, ";");
}

/* BA_DEF_DEF_ "name" value; for messages that come later as well as for those that were there. */
int dbc_attribute_default(struct dbc_reader *const r)
{
    unsigned index = DBC_ATTRIBUTES;
    struct dbc_text text = {"", 0};
    double number = 0;
    int err = take_attribute(r, &index);
    if (err || index >= DBC_ATTRIBUTES)
        return err ? err : skip_rest(r);
    err = take_value(r, index, &number, &text);
    if (err)
        return err;
    if (!attributes[index].set) {
        r->signal_default = number;
        for (uint32_t i = 0; i < r->dbc->signal_count; i++)
            r->dbc->signals[i].start_value = number;
        return 0;
    }
    attributes[index].set(&r->message_defaults, number, text);
    for (uint32_t i = 0; i < r->dbc->message_count; i++)
        attributes[index].set(&r->dbc->messages[i], number, text);
    return 0;
}

/* BA_ "name" BO_ id value; or BA_ "name" SG_ id signal value; */
int dbc_attribute_value(struct dbc_reader *const r)
{
    unsigned index = DBC_ATTRIBUTES;
    struct dbc_text text = {"", 0}, name = {"", 0};
    double id = 0, number = 0;
    int err = take_attribute(r, &index);
    if (err || index >= DBC_ATTRIBUTES)
        return err ? err : skip_rest(r);
    const unsigned line = r->lexer.token_line;
    const bool of_signal = !attributes[index].set;
    err = dbc_take(r, DBC_WORD, of_signal ? "SG_" : "BO_");
    err = err ? err : dbc_take_integer(r, "an identifier", 0, 4294967295.0, &id);
    err = err || !of_signal ? err : dbc_take_word(r, &name);
    err = err ? err : take_value(r, index, &number, &text);
    if (err || (id >= DBC_HOMELESS_ID && id <= DBC_HOMELESS_ID))
        return err;
    struct hm2_dbc_message *const m = dbc_find_message(r, id);
    const uint32_t signal = m && of_signal ? dbc_find_signal(r, m, name) : HM2_DBC_NO_SIGNAL;
    if (!m || (of_signal && signal == HM2_DBC_NO_SIGNAL))
        return dbc_problem(r, HM2_ERR_INVALID, line, "no message%s of the identifier %.0f has the attribute's name",
                           of_signal ? " or signal" : "", id);
    if (of_signal)
        r->dbc->signals[signal].start_value = number;
    else
        attributes[index].set(m, number, text);
    return 0;
}
