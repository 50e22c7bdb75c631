/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "replay_csv.h"

#include <string.h>

static int bad(const struct replay_csv *const csv, struct hm2_diag *const diag, const char *const what)
{
    return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s line %u: %s.", csv->file, csv->line, what);
}

/* Cut one quoted field out of the text, in place. On return *in is behind the closing quote. */
static int unquote(const struct replay_csv *const csv, char **const in, const char *const end, struct hm2_diag *diag)
{
    char *out = *in;
    char *p = *in + 1;
    for (;;) {
        if (p >= end || *p == '\n')
            return bad(csv, diag, "a quote is not closed on its line");
        if (*p == '"') {
            if (p + 1 >= end || p[1] != '"')
                break;
            p++;
        }
        *out++ = *p++;
    }
    *out = '\0';
    *in = p + 1;
    if (*in < end && **in != ',' && **in != '\n' && **in != '\r')
        return bad(csv, diag, "text follows a closing quote");
    return 0;
}

static char *plain_field(char *p, const char *const end)
{
    while (p < end && *p != ',' && *p != '\n' && *p != '\r')
        p++;
    return p;
}

/* One row into field[]; *count gets the number of fields. */
static int split_row(struct replay_csv *const csv, unsigned *const count, struct hm2_diag *const diag)
{
    char *p = csv->text + csv->pos;
    const char *const end = csv->text + csv->len;
    *count = 0;
    for (;;) {
        if (*count >= REPLAY_CSV_COLUMNS)
            return bad(csv, diag, "too many columns");
        csv->field[(*count)++] = p;
        if (p < end && *p == '"') {
            const int err = unquote(csv, &p, end, diag);
            if (err)
                return err;
        } else {
            p = plain_field(p, end);
        }
        char delimiter = '\n';
        if (p < end) {
            delimiter = *p;
            *p++ = '\0';
        }
        if (delimiter == '\r' && p < end && *p++ != '\n')
            return bad(csv, diag, "a carriage return is not followed by a line feed");
        if (delimiter != ',')
            break;
    }
    csv->pos = (size_t)(p - csv->text);
    return 0;
}

static void skip_empty_lines(struct replay_csv *const csv)
{
    while (csv->pos < csv->len && (csv->text[csv->pos] == '\n' || csv->text[csv->pos] == '\r')) {
        if (csv->text[csv->pos] == '\n')
            csv->next_line++;
        csv->pos++;
    }
}

int replay_csv_row(struct replay_csv *const csv, struct hm2_diag *const diag)
{
    skip_empty_lines(csv);
    if (csv->pos >= csv->len)
        return 0;
    csv->line = csv->next_line++;
    unsigned count = 0;
    const int err = split_row(csv, &count, diag);
    if (err)
        return err;
    if (csv->columns && count > csv->columns)
        return bad(csv, diag, "more fields than the header has columns");
    for (unsigned i = count; i < REPLAY_CSV_COLUMNS; i++)
        csv->field[i] = "";
    if (!csv->columns)
        csv->columns = count;
    return 1;
}

int replay_csv_open(struct replay_csv *const csv, const char *const file, char *const text, const size_t len,
                    struct hm2_diag *const diag)
{
    memset(csv, 0, sizeof(*csv));
    csv->file = file;
    csv->text = text;
    csv->len = len;
    csv->next_line = 1;
    if (len > REPLAY_CSV_MAX_BYTES)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "%s has %zu bytes; at most %u are read.", file, len,
                            REPLAY_CSV_MAX_BYTES);
    if (len && memchr(text, '\0', len))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s contains a zero byte; it is not a text table.", file);
    text[len] = '\0';
    const int got = replay_csv_row(csv, diag);
    if (got < 0)
        return got;
    if (got == 0)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s is empty; a header row is expected.", file);
    memcpy(csv->header, csv->field, sizeof(csv->header));
    return 0;
}

int replay_csv_column(const struct replay_csv *const csv, const char *const name)
{
    for (unsigned i = 0; i < csv->columns; i++)
        if (strcmp(csv->header[i], name) == 0)
            return (int)i;
    return -1;
}

int replay_csv_need(const struct replay_csv *const csv, const char *const name, struct hm2_diag *const diag)
{
    const int column = replay_csv_column(csv, name);
    if (column < 0)
        return hm2_diag_add(diag, HM2_ERR_MALFORMED, "%s line 1: no column \"%s\".", csv->file, name);
    return column;
}

int replay_decimal(const char *text, const int64_t max, int64_t *const value)
{
    int64_t sum = 0;
    if (!*text)
        return HM2_ERR_MALFORMED;
    for (; *text; text++) {
        if (*text < '0' || *text > '9')
            return HM2_ERR_MALFORMED;
        const int digit = *text - '0';
        if (sum > (max - digit) / 10)
            return HM2_ERR_RANGE;
        sum = sum * 10 + digit;
    }
    *value = sum;
    return 0;
}

const char *replay_take_number(const char *const text, const unsigned max, unsigned *const number)
{
    char digits[12];
    int64_t value = 0;
    const size_t len = strspn(text, "0123456789");
    if (len == 0 || len >= sizeof(digits))
        return NULL;
    memcpy(digits, text, len);
    digits[len] = '\0';
    if (replay_decimal(digits, max, &value))
        return NULL;
    *number = (unsigned)value;
    return text + len;
}

static int hex_digit(const char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    if (c >= 'a' && c <= 'f')
        return c - 'a' + 10;
    if (c >= 'A' && c <= 'F')
        return c - 'A' + 10;
    return -1;
}

int replay_hex32(const char *const text, uint32_t *const value)
{
    uint32_t sum = 0;
    const size_t len = strlen(text);
    if (len == 0)
        return HM2_ERR_MALFORMED;
    for (size_t i = 0; i < len; i++) {
        const int digit = hex_digit(text[i]);
        if (digit < 0)
            return HM2_ERR_MALFORMED;
        if (sum >> 28)
            return HM2_ERR_RANGE;
        sum = sum << 4 | (uint32_t)digit;
    }
    *value = sum;
    return 0;
}
