/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Arithmetic of the PWM generators, apart from the module so that it can be tested alone. Private to lib/module. */
#ifndef HM2_MODULE_PWMGEN_H
#define HM2_MODULE_PWMGEN_H

#include <limits.h>
#include <stdbool.h>
#include <stdint.h>

/* Parameter output-type (hal-interface 2.9). */
enum pwmgen_type { PWMGEN_PWM_DIR = 1, PWMGEN_UP_DOWN = 2, PWMGEN_PDM = 3, PWMGEN_DIR_PWM = 4 };

#define PWMGEN_LOOKS       16u      /* cycles of a round of looks at parameters, at least */
#define PWMGEN_LOOK_AT_ALL UINT_MAX /* instead of a generator's number */

#define PWMGEN_BITS_MIN 9u
#define PWMGEN_BITS_MAX 12u

struct pwmgen_rate {
    uint32_t frequency_hz; /* as wanted, or the nearest that is possible */
    uint32_t dds;          /* rate register */
    unsigned bits;         /* 9 to 12; 12 for PDM */
    bool clamped;
};

/* Rate register and width for a frequency; clock_hz > 0. Plain arithmetic. */
struct pwmgen_rate pwmgen_pwm_rate(uint32_t clock_hz, uint32_t wanted_hz);
struct pwmgen_rate pwmgen_pdm_rate(uint32_t clock_hz, uint32_t wanted_hz);

/* How a duty of -1 to 1 becomes a value register. */
struct pwmgen_span {
    double gain, middle; /* register = gain * duty + middle */
    bool offset;
};
struct pwmgen_span pwmgen_span(unsigned bits, bool dither, bool offset_mode);
uint32_t pwmgen_value(const struct pwmgen_span *span, double duty);

#endif
