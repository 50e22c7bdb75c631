/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Pieces of which options and commands are made. Each read_...() takes what it knows from the front of a text and sets
 * *end behind it; false when that is not there, or out of range. */
#ifndef HM2SIM_WORDS_H
#define HM2SIM_WORDS_H

#include <stdbool.h>
#include <stdint.h>

bool read_unsigned(const char *text, unsigned long max, const char **end, unsigned long *value);
bool read_signed(const char *text, long max, const char **end, long *value);
bool read_real(const char *text, double min, double max, const char **end, double *value);
/* "NUM" or "NUM/DEN", NUM of either sign. */
bool read_ratio(const char *text, const char **end, int32_t *num, int32_t *den);
/* "stepgen.N" or "encoder.N" */
bool read_axis(const char *text, const char **end, uint8_t *gtag, unsigned *unit);

/* The same for texts with nothing behind. */
bool whole_unsigned(const char *text, unsigned long max, unsigned long *value);
bool whole_real(const char *text, double min, double max, double *value);

#endif
