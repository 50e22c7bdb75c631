/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Messages and signals of a DBC file. */
#include "reader.h"

#include <string.h>

#define MAX_FILE_ID 4294967295.0
#define EXTENDED    2147483648.0 /* bit 31 */

static int refuse_message(struct dbc_reader *const r, const double id, const unsigned line)
{
    const double plain = id >= EXTENDED ? id - EXTENDED : id;
    if (plain > (id >= EXTENDED ? (double)0x1FFFFFFF : (double)0x7FF))
        return dbc_problem(r, HM2_ERR_RANGE, line,
                           "%.0f is no identifier: 0 to 2047, or 2147483648 + (0 to 536870911) for an extended one",
                           id);
    const struct hm2_dbc_message *const other = dbc_find_message(r, id);
    if (other)
        return dbc_problem(r, HM2_ERR_INVALID, line, "the identifier %.0f is that of %s in line %u, too", id,
                           other->name, other->line);
    return 0;
}

/* BO_ id name: bytes sender */
int dbc_message(struct dbc_reader *const r)
{
    struct hm2_dbc *const dbc = r->dbc;
    const unsigned line = r->lexer.token_line;
    struct hm2_dbc_message m = r->message_defaults;
    struct dbc_text sender;
    double id, bytes;
    int err = dbc_take_integer(r, "an identifier", 0, MAX_FILE_ID, &id);
    r->homeless = !err && id >= DBC_HOMELESS_ID && id <= DBC_HOMELESS_ID;
    err = err ? err : dbc_take_text(r, DBC_WORD, &m.name);
    err = err ? err : dbc_take(r, DBC_PUNCT, ":");
    err = err ? err : dbc_take_integer(r, "a length", 0, r->homeless ? 1e9 : HM2_CAN_MAX_BYTES, &bytes);
    if (err || r->homeless)
        return err ? err : dbc_take_word(r, &sender);
    m.line = line;
    m.extended = id >= EXTENDED;
    m.bytes = (uint8_t)bytes;
    m.first_signal = dbc->signal_count;
    err = refuse_message(r, id, line);
    m.id = err ? 0 : (uint32_t)(m.extended ? id - EXTENDED : id);
    err = err ? err : dbc_add_set(r, &m.senders);
    err = err ? err : dbc_take_nodes(r, m.senders);
    err = err ? err
              : dbc_grow(r, &dbc->messages, sizeof m, dbc->message_count, &r->message_room, HM2_DBC_MAX_MESSAGES,
                         "messages");
    if (!err)
        dbc->messages[dbc->message_count++] = m;
    return err;
}

/* BO_TX_BU_ id : node, node; */
int dbc_senders(struct dbc_reader *const r)
{
    const unsigned line = r->lexer.token_line;
    double id;
    int err = dbc_take_integer(r, "an identifier", 0, MAX_FILE_ID, &id);
    err = err ? err : dbc_take(r, DBC_PUNCT, ":");
    if (err)
        return err;
    const struct hm2_dbc_message *const m = dbc_find_message(r, id);
    if (!m)
        return dbc_problem(r, HM2_ERR_INVALID, line, "no message has the identifier %.0f", id);
    err = dbc_take_nodes(r, m->senders);
    return err ? err : dbc_take(r, DBC_PUNCT, ";");
}

static int add_mux(struct dbc_reader *const r, struct hm2_dbc_signal *const s, const double first, const double last)
{
    struct hm2_dbc *const dbc = r->dbc;
    const int err = dbc_grow(r, &dbc->mux, sizeof dbc->mux[0], dbc->mux_count, &r->mux_room, HM2_DBC_MAX_MUX,
                             "values of multiplexors");
    if (err)
        return err;
    if (s->mux_count == 0)
        s->first_mux = dbc->mux_count;
    dbc->mux[dbc->mux_count++] = (struct hm2_dbc_mux){(uint64_t)first, (uint64_t)last};
    s->mux_count++;
    return 0;
}

/* "M", "m3" or "m3M" before the colon. */
static int take_multiplexing(struct dbc_reader *const r, struct hm2_dbc_signal *const s)
{
    const unsigned line = r->lexer.token_line;
    struct dbc_text word;
    double value = 0;
    size_t i = 1;
    s->multiplexor = HM2_DBC_NO_SIGNAL;
    if (r->lexer.kind != DBC_WORD)
        return 0;
    (void)dbc_take_word(r, &word);
    for (; i < word.len && i < 12u && word.start[i] >= '0' && word.start[i] <= '9'; i++)
        value = value * 10.0 + (double)(word.start[i] - '0');
    const bool shared = i + 1u == word.len && word.start[i] == 'M';
    s->is_multiplexor = shared || (word.len == 1u && word.start[0] == 'M');
    if (word.len == 1u && word.start[0] == 'M')
        return 0;
    if (word.start[0] != 'm' || i == 1u || (i != word.len && !shared))
        return dbc_problem(r, HM2_ERR_MALFORMED, line,
                           "expected M, m and a number, or nothing before \":\", found \"%.*s\"",
                           (int)(word.len < 40u ? word.len : 40u), word.start);
    return add_mux(r, s, value, value);
}

/* start|bits@order sign */
static int take_place(struct dbc_reader *const r, struct hm2_dbc_signal *const s)
{
    double start = 0, bits = 0, order = 0;
    int err = dbc_take_integer(r, "a start bit", 0, 8.0 * HM2_CAN_MAX_BYTES - 1.0, &start);
    err = err ? err : dbc_take(r, DBC_PUNCT, "|");
    err = err ? err : dbc_take_integer(r, "a number of bits", 1, 64, &bits);
    err = err ? err : dbc_take(r, DBC_PUNCT, "@");
    err = err ? err : dbc_take_integer(r, "a byte order", 0, 1, &order);
    if (err)
        return err;
    s->start = (uint16_t)start;
    s->bits = (uint16_t)bits;
    s->big_endian = order < 1.0;
    s->kind = dbc_at(r, "-") ? HM2_DBC_SIGNED : HM2_DBC_UNSIGNED;
    return dbc_at(r, "-") ? dbc_take(r, DBC_PUNCT, "-") : dbc_take(r, DBC_PUNCT, "+");
}

static int take_pair(struct dbc_reader *const r, const char *const marks, double *const first, double *const second)
{
    const char open[] = {marks[0], '\0'}, middle[] = {marks[1], '\0'}, close[] = {marks[2], '\0'};
    int err = dbc_take(r, DBC_PUNCT, open);
    err = err ? err : dbc_take_number(r, first);
    err = err ? err : dbc_take(r, DBC_PUNCT, middle);
    err = err ? err : dbc_take_number(r, second);
    return err ? err : dbc_take(r, DBC_PUNCT, close);
}

static int take_meaning(struct dbc_reader *const r, struct hm2_dbc_signal *const s)
{
    int err = take_pair(r, "(,)", &s->scale, &s->offset);
    err = err ? err : take_pair(r, "[|]", &s->min, &s->max);
    err = err ? err : dbc_take_text(r, DBC_STRING, &s->unit);
    if (!err && s->scale >= 0.0 && s->scale <= 0.0)
        err = dbc_problem(r, HM2_ERR_RANGE, s->line, "the scale of %s is 0, expected anything else", s->name);
    err = err ? err : dbc_add_set(r, &s->receivers);
    return err ? err : dbc_take_nodes(r, s->receivers);
}

static int add_signal(struct dbc_reader *const r, const struct hm2_dbc_signal *const s)
{
    struct hm2_dbc *const dbc = r->dbc;
    struct hm2_dbc_message *const m = &dbc->messages[dbc->message_count - 1u];
    const uint32_t other = dbc_find_signal(r, m, (struct dbc_text){s->name, strlen(s->name)});
    if (other != HM2_DBC_NO_SIGNAL)
        return dbc_problem(r, HM2_ERR_INVALID, s->line, "%s has a signal %s in line %u already", m->name, s->name,
                           dbc->signals[other].line);
    if (m->signal_count >= HM2_DBC_MAX_PER_MESSAGE)
        return dbc_problem(r, HM2_ERR_NOSPACE, s->line, "%s has more than %u signals", m->name,
                           HM2_DBC_MAX_PER_MESSAGE);
    const int err =
        dbc_grow(r, &dbc->signals, sizeof *s, dbc->signal_count, &r->signal_room, HM2_DBC_MAX_SIGNALS, "signals");
    if (err)
        return err;
    dbc->signals[dbc->signal_count++] = *s;
    m->signal_count++;
    return 0;
}

/* SG_ name [multiplexing] : place (scale,offset) [min|max] "unit" receivers */
int dbc_signal(struct dbc_reader *const r)
{
    struct hm2_dbc_signal s = {.line = r->lexer.token_line, .start_value = r->signal_default};
    if (r->dbc->message_count == 0 && !r->homeless)
        return dbc_problem(r, HM2_ERR_MALFORMED, s.line, "SG_ before the first message (BO_)");
    int err = dbc_take_text(r, DBC_WORD, &s.name);
    err = err ? err : take_multiplexing(r, &s);
    err = err ? err : dbc_take(r, DBC_PUNCT, ":");
    err = err ? err : take_place(r, &s);
    err = err ? err : take_meaning(r, &s);
    return err || r->homeless ? err : add_signal(r, &s);
}

/* "identifier signal" of a message; *signal is HM2_DBC_NO_SIGNAL when it has no home. */
static int take_signal(struct dbc_reader *const r, const struct hm2_dbc_message **const m, uint32_t *const signal)
{
    const unsigned line = r->lexer.token_line;
    struct dbc_text name;
    double id;
    *signal = HM2_DBC_NO_SIGNAL;
    int err = dbc_take_integer(r, "an identifier", 0, MAX_FILE_ID, &id);
    err = err ? err : dbc_take_word(r, &name);
    if (err || (id >= DBC_HOMELESS_ID && id <= DBC_HOMELESS_ID))
        return err;
    *m = dbc_find_message(r, id);
    if (!*m)
        return dbc_problem(r, HM2_ERR_INVALID, line, "no message has the identifier %.0f", id);
    *signal = dbc_find_signal(r, *m, name);
    if (*signal == HM2_DBC_NO_SIGNAL)
        return dbc_problem(r, HM2_ERR_INVALID, line, "the message %s has no signal %.*s", (*m)->name,
                           (int)(name.len < 128u ? name.len : 128u), name.start);
    return 0;
}

/* SIG_VALTYPE_ id signal : type; */
int dbc_value_type(struct dbc_reader *const r)
{
    static const struct {
        enum hm2_dbc_kind kind;
        unsigned bits;
    } types[] = {{HM2_DBC_SIGNED, 0}, {HM2_DBC_FLOAT32, 32}, {HM2_DBC_FLOAT64, 64}};
    const struct hm2_dbc_message *m = NULL;
    const unsigned line = r->lexer.token_line;
    uint32_t index;
    double type = 0;
    int err = take_signal(r, &m, &index);
    if (!err && dbc_at(r, ":"))
        dbc_lexer_next(&r->lexer);
    err = err ? err : dbc_take_integer(r, "a type (0 integer, 1 float, 2 double)", 0, 2, &type);
    err = err ? err : dbc_take(r, DBC_PUNCT, ";");
    if (err || index == HM2_DBC_NO_SIGNAL || type < 1.0)
        return err;
    struct hm2_dbc_signal *const s = &r->dbc->signals[index];
    s->kind = types[(unsigned)type].kind;
    if (s->bits != types[(unsigned)type].bits)
        return dbc_problem(r, HM2_ERR_RANGE, line, "%s.%s has %u bits, a float of type %.0f has %u", m->name, s->name,
                           s->bits, type, types[(unsigned)type].bits);
    return 0;
}

/* "first-last", whose minus sign touches a number. */
static int take_mux_range(struct dbc_reader *const r, struct hm2_dbc_signal *const s)
{
    const unsigned line = r->lexer.token_line;
    double first = 0, last = 0;
    int err = dbc_take_integer(r, "a value of a multiplexor", 0, 4294967295.0, &first);
    if (!err && dbc_at(r, "-"))
        dbc_lexer_next(&r->lexer);
    err = err ? err : dbc_take_integer(r, "a value of a multiplexor", -4294967295.0, 4294967295.0, &last);
    last = last < 0.0 ? -last : last;
    if (!err && last < first)
        err = dbc_problem(r, HM2_ERR_RANGE, line, "%.0f-%.0f is no range", first, last);
    return err ? err : add_mux(r, s, first, last);
}

/* SG_MUL_VAL_ id signal multiplexor range, range; */
int dbc_mux_values(struct dbc_reader *const r)
{
    const struct hm2_dbc_message *m = NULL;
    const unsigned line = r->lexer.token_line;
    struct dbc_text name = {"", 0};
    uint32_t index;
    int err = take_signal(r, &m, &index);
    err = err ? err : dbc_take_word(r, &name);
    if (err || index == HM2_DBC_NO_SIGNAL)
        return err;
    struct hm2_dbc_signal *const s = &r->dbc->signals[index];
    s->multiplexor = dbc_find_signal(r, m, name);
    if (s->multiplexor == HM2_DBC_NO_SIGNAL)
        return dbc_problem(r, HM2_ERR_INVALID, line, "the message %s has no signal %.*s", m->name,
                           (int)(name.len < 128u ? name.len : 128u), name.start);
    s->mux_count = 0;
    for (;;) {
        err = take_mux_range(r, s);
        if (err || !dbc_at(r, ","))
            return err ? err : dbc_take(r, DBC_PUNCT, ";");
        dbc_lexer_next(&r->lexer);
    }
}

/* VAL_ id signal number "text" number "text" ...; or VAL_ environment-variable ...; */
int dbc_values(struct dbc_reader *const r)
{
    struct hm2_dbc *const dbc = r->dbc;
    const struct hm2_dbc_message *m = NULL;
    uint32_t index = HM2_DBC_NO_SIGNAL;
    double raw = 0;
    int err = 0;
    if (r->lexer.kind == DBC_WORD)
        dbc_lexer_next(&r->lexer);
    else
        err = take_signal(r, &m, &index);
    const uint32_t first = dbc->value_count;
    while (!err && r->lexer.kind == DBC_NUMBER) {
        struct hm2_dbc_value value = {0};
        err = dbc_take_integer(r, "a value", -9007199254740992.0, 9007199254740992.0, &raw);
        value.raw = err ? 0 : (int64_t)raw;
        err = err ? err : dbc_take_text(r, DBC_STRING, &value.text);
        err = err ? err
                  : dbc_grow(r, &dbc->values, sizeof value, dbc->value_count, &r->value_room, HM2_DBC_MAX_VALUES,
                             "values with a name");
        if (!err)
            dbc->values[dbc->value_count++] = value;
    }
    if (!err && index != HM2_DBC_NO_SIGNAL) {
        dbc->signals[index].first_value = first;
        dbc->signals[index].values = dbc->value_count - first;
    }
    return err ? err : dbc_take(r, DBC_PUNCT, ";");
}
