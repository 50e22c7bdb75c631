/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "words.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/idrom.h>

bool read_unsigned(const char *const text, const unsigned long max, const char **const end, unsigned long *const value)
{
    if (*text < '0' || *text > '9')
        return false;
    char *stop;
    errno = 0;
    *value = strtoul(text, &stop, 10);
    *end = stop;
    return errno == 0 && *value <= max;
}

bool whole_unsigned(const char *const text, const unsigned long max, unsigned long *const value)
{
    const char *end;
    return read_unsigned(text, max, &end, value) && *end == '\0';
}

bool read_signed(const char *const text, const long max, const char **const end, long *const value)
{
    unsigned long size;
    const bool negative = *text == '-';
    if (!read_unsigned(text + negative, (unsigned long)max, end, &size))
        return false;
    *value = negative ? -(long)size : (long)size;
    return true;
}

bool read_real(const char *const text, const double min, const double max, const char **const end, double *const value)
{
    char *stop;
    *value = strtod(text, &stop);
    *end = stop;
    return stop != text && isfinite(*value) && *value >= min && *value <= max;
}

bool whole_real(const char *const text, const double min, const double max, double *const value)
{
    const char *end;
    return read_real(text, min, max, &end, value) && *end == '\0';
}

bool read_ratio(const char *const text, const char **const end, int32_t *const num, int32_t *const den)
{
    long above;
    unsigned long below = 1;
    if (!read_signed(text, INT32_MAX, end, &above))
        return false;
    if (**end == '/' && (!read_unsigned(*end + 1, INT32_MAX, end, &below) || below == 0))
        return false;
    *num = (int32_t)above;
    *den = (int32_t)below;
    return true;
}

bool read_axis(const char *const text, const char **const end, uint8_t *const gtag, unsigned *const unit)
{
    static const struct {
        const char *name;
        uint8_t gtag;
    } kinds[] = {{"stepgen.", HM2_GTAG_STEPGEN}, {"encoder.", HM2_GTAG_ENCODER}};
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        const size_t len = strlen(kinds[i].name);
        unsigned long number;
        if (strncmp(text, kinds[i].name, len) != 0 || !read_unsigned(text + len, UINT8_MAX, end, &number))
            continue;
        *gtag = kinds[i].gtag;
        *unit = (unsigned)number;
        return true;
    }
    return false;
}
