/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Comma-separated tables of the trace folders: one header row, then rows. Input is not trusted: every limit below is
 * checked, and an error names the line. Fields may be quoted ("a, b", "" inside is one quote); rows end in LF or
 * CR LF; empty lines are skipped.
 */
#ifndef SIM_REPLAY_CSV_H
#define SIM_REPLAY_CSV_H

#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

#define REPLAY_CSV_COLUMNS   24u
#define REPLAY_CSV_MAX_BYTES (64u << 20)

struct replay_csv {
    char *text;
    size_t len, pos;
    const char *file; /* for messages */
    unsigned line;    /* of the row read last, from 1 */
    unsigned next_line;
    unsigned columns;                       /* of the header */
    const char *header[REPLAY_CSV_COLUMNS]; /* column names */
    const char *field[REPLAY_CSV_COLUMNS];  /* fields of the row read last; "" for missing ones at its end */
};

/* Read the header row. text[0..len) is changed in place and must outlive the fields; text[len] must be writable. */
int HM2_MUST_CHECK replay_csv_open(struct replay_csv *csv, const char *file, char *text, size_t len,
                                   struct hm2_diag *diag);
/* Next row: 1, 0 at the end, or HM2_ERR_MALFORMED. */
int HM2_MUST_CHECK replay_csv_row(struct replay_csv *csv, struct hm2_diag *diag);
/* Number of the column with this name, or -1. */
int replay_csv_column(const struct replay_csv *csv, const char *name);
/* The same; a missing column is an error that names file and column. */
int HM2_MUST_CHECK replay_csv_need(const struct replay_csv *csv, const char *name, struct hm2_diag *diag);

/* Whole string as a number, no sign, no spaces: 0 or HM2_ERR_MALFORMED / HM2_ERR_RANGE. */
int HM2_MUST_CHECK replay_decimal(const char *text, int64_t max, int64_t *value);
/* A number at the start of a text: where it ends, or NULL when there is none up to max. */
const char *HM2_MUST_CHECK replay_take_number(const char *text, unsigned max, unsigned *number);
int HM2_MUST_CHECK replay_hex32(const char *text, uint32_t *value);

#endif
