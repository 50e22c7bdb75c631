/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Values of parameters as people write them. */
#include <hm2/lbp_remote.h>

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXACT_FLOAT 16777216.0 /* limits are 32-bit floats, which hold whole numbers up to here */

static bool is_float(const struct sslbp_field *const field)
{
    return field->type == SSLBP_FLOAT || field->type == SSLBP_NV_FLOAT;
}

void lbp_value_text(const struct sslbp_field *const field, const uint64_t raw, const bool hex,
                    char text[const LBP_VALUE_TEXT])
{
    if (hex)
        (void)snprintf(text, LBP_VALUE_TEXT, "%0*llX", (int)(field->bits + 3u) / 4, (unsigned long long)raw);
    else if (is_float(field))
        (void)snprintf(text, LBP_VALUE_TEXT, "%.*g", field->bits > 32 ? 17 : 9, sslbp_from_float(raw, field->bits));
    else if (sslbp_is_signed(field))
        (void)snprintf(text, LBP_VALUE_TEXT, "%lld", (long long)sslbp_sign_extend(raw, field->bits));
    else
        (void)snprintf(text, LBP_VALUE_TEXT, "%llu", (unsigned long long)raw);
}

static int refuse(const struct lbp_remote *const remote, const struct sslbp_field *const field, const char *const text,
                  const int err, const char *const wanted)
{
    return hm2_diag_add(remote->diag, err, "%s: %s \"%.40s\": expected %s (%u bits).", remote->name, field->name, text,
                        wanted, field->bits);
}

static bool only_digits(const char *const text, const bool hex)
{
    return text[0] != '\0' && strspn(text, hex ? "0123456789abcdefABCDEF" : "0123456789") == strlen(text);
}

/* The limits of process data are those of the scaled value, and 0 to 1 stands for none. */
static bool has_limits(const struct lbp_remote *const remote, const struct sslbp_field *const field)
{
    const bool parameter =
        field >= remote->tables.global && field < remote->tables.global + remote->tables.global_count;
    const bool none = field->min == 0.0 && field->max == 1.0;
    return parameter && !none && field->max > field->min && fabs(field->max) < EXACT_FLOAT &&
           fabs(field->min) < EXACT_FLOAT;
}

static int check_limits(const struct lbp_remote *const remote, const struct sslbp_field *const field,
                        const char *const text, const double value)
{
    if (!has_limits(remote, field) || (value >= field->min && value <= field->max))
        return 0;
    return hm2_diag_add(remote->diag, HM2_ERR_RANGE, "%s: %s \"%.40s\": the remote gives %.9g to %.9g as its limits.",
                        remote->name, field->name, text, field->min, field->max);
}

static int parse_float(const struct lbp_remote *const remote, const struct sslbp_field *const field,
                       const char *const text, uint64_t *const raw)
{
    char *end;
    const double value = strtod(text, &end);
    if (end == text || *end != '\0' || !isfinite(value))
        return refuse(remote, field, text, HM2_ERR_INVALID, "a number");
    *raw = sslbp_to_float(value, field->bits);
    return check_limits(remote, field, text, value);
}

/* Of a signed field, a negative number. */
static int parse_negative(const struct lbp_remote *const remote, const struct sslbp_field *const field,
                          const char *const text, uint64_t *const raw)
{
    errno = 0;
    const long long value = strtoll(text, NULL, 10);
    const int64_t least = sslbp_sign_extend(UINT64_C(1) << (field->bits - 1u), field->bits);
    if (errno != 0 || value < least)
        return refuse(remote, field, text, HM2_ERR_RANGE, "a larger number");
    *raw = field->bits < 64 ? (uint64_t)value & ((UINT64_C(1) << field->bits) - 1u) : (uint64_t)value;
    return check_limits(remote, field, text, (double)value);
}

int lbp_remote_parse(const struct lbp_remote *const remote, const struct sslbp_field *const field,
                     const char *const text, const bool hex, uint64_t *const raw)
{
    *raw = 0;
    if (field->bits == 0 || field->bits > 64)
        return refuse(remote, field, text, HM2_ERR_UNSUPPORTED, "a field of 1 to 64 bits");
    if (!hex && is_float(field))
        return parse_float(remote, field, text, raw);
    if (!hex && sslbp_is_signed(field) && text[0] == '-' && only_digits(text + 1, false))
        return parse_negative(remote, field, text, raw);
    if (!only_digits(text, hex))
        return refuse(remote, field, text, HM2_ERR_INVALID, hex ? "hexadecimal digits" : "a decimal number");
    /* A hexadecimal number is the bits themselves. */
    const unsigned bits = sslbp_is_signed(field) && !hex ? field->bits - 1u : field->bits;
    errno = 0;
    *raw = strtoull(text, NULL, hex ? 16 : 10);
    if (errno != 0 || (bits < 64 && *raw >> bits != 0))
        return refuse(remote, field, text, HM2_ERR_RANGE, "a smaller number");
    return hex && (is_float(field) || sslbp_is_signed(field)) ? 0 : check_limits(remote, field, text, (double)*raw);
}
