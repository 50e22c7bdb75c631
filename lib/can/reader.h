/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the statements of a DBC file share while it is read. */
#ifndef HM2_CAN_READER_H
#define HM2_CAN_READER_H

#include <hm2/dbc.h>

#include "lexer.h"

#define DBC_ATTRIBUTES 4u /* that mean something here: attributes.c */
#define DBC_ENUM_TEXTS 64u

/* A piece of the file. */
struct dbc_text {
    const char *start;
    size_t len;
};

struct dbc_attribute_values {
    struct dbc_text texts[DBC_ENUM_TEXTS]; /* of an enumeration */
    unsigned count;
};

struct dbc_reader {
    struct dbc_lexer lexer;
    const char *file;
    struct hm2_diag *diag;
    struct hm2_dbc *dbc;
    char *strings; /* names and texts; as much room as the file has, which all of them together cannot exceed */
    size_t strings_used;
    int err; /* of the first problem */
    unsigned problems;
    uint32_t message_room, signal_room, mux_room, value_room, set_room;
    bool homeless; /* signals that follow belong to the message without a home */
    uint32_t last; /* message that was looked up last */
    struct dbc_attribute_values attributes[DBC_ATTRIBUTES];
    struct hm2_dbc_message message_defaults;
    double signal_default;
};

/* A problem at a line; returns err. */
int dbc_problem(struct dbc_reader *reader, int err, unsigned line, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
/* The next token is not what it should be. */
int dbc_expected(struct dbc_reader *reader, const char *what);

/* Take a token. All return 0, or an error that has been reported. */
int dbc_take(struct dbc_reader *reader, enum dbc_token_kind kind, const char *text);
int dbc_take_number(struct dbc_reader *reader, double *value);
/* An integer between limits. */
int dbc_take_integer(struct dbc_reader *reader, const char *what, double low, double high, double *value);
/* A word or a string, kept for the life of the dbc. */
int dbc_take_text(struct dbc_reader *reader, enum dbc_token_kind kind, const char **text);
/* A word, not kept. */
int dbc_take_word(struct dbc_reader *reader, struct dbc_text *word);
bool dbc_at(const struct dbc_reader *reader, const char *punctuation);

/* One more element in an array of struct hm2_dbc; the array may move. */
int dbc_grow(struct dbc_reader *reader, void *array, size_t size, uint32_t used, uint32_t *room, uint32_t limit,
             const char *what);
int dbc_add_set(struct dbc_reader *reader, uint32_t *set);
/* Nodes, separated by commas or blanks, up to the end of the line. */
int dbc_take_nodes(struct dbc_reader *reader, uint32_t set);

/* Message of an identifier as the file has it, with bit 31; NULL when there is none. */
struct hm2_dbc_message *dbc_find_message(struct dbc_reader *reader, double file_id);
/* Index of a signal of the message, HM2_DBC_NO_SIGNAL when there is none. */
uint32_t dbc_find_signal(const struct dbc_reader *reader, const struct hm2_dbc_message *message, struct dbc_text name);

#define DBC_HOMELESS_ID 3221225472.0 /* 0xC0000000, VECTOR__INDEPENDENT_SIG_MSG */

/* ---- statements, after their keyword --------------------------------------------------------------------------------
 */

int dbc_message(struct dbc_reader *reader);           /* BO_ */
int dbc_signal(struct dbc_reader *reader);            /* SG_ */
int dbc_senders(struct dbc_reader *reader);           /* BO_TX_BU_ */
int dbc_value_type(struct dbc_reader *reader);        /* SIG_VALTYPE_ */
int dbc_mux_values(struct dbc_reader *reader);        /* SG_MUL_VAL_ */
int dbc_values(struct dbc_reader *reader);            /* VAL_ */
int dbc_attribute(struct dbc_reader *reader);         /* BA_DEF_ */
int dbc_attribute_default(struct dbc_reader *reader); /* BA_DEF_DEF_ */
int dbc_attribute_value(struct dbc_reader *reader);   /* BA_ */

/* The whole once it is read: signals within their messages, multiplexors. */
void dbc_check(struct dbc_reader *reader);

#endif
