/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Cards with 48 bits: 7I69 (both ways), 7I70 (isolated inputs), 7I71 (sourcing outputs) and 7I72 (sinking outputs).
 * Modes and pins are those of sserial(9), and of HAL files for the 7I72; names of modes, widths of analog values and
 * counters, and the top bytes of the unit numbers are taken to be like those of the 7I77.
 */
#include "remote_kind.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define BITS         48u

/* ---- 7I69 ---------------------------------------------------------------------------------------------------------
 */

enum { BOTH_WAYS = 0x11, ALL_IN = 0x13, ALL_OUT = 0x15, HALVES = 0x08, MPG_MODE = 0x10 };

static const struct remote_field fields_7i69[] = {
    {REMOTE_INPUTS(BITS, ALL_IN)},
    {REMOTE_INPUTS(BITS / 2, HALVES)},
    {REMOTE_OUTPUTS(BITS, ALL_OUT)},
    {"Output", "", BITS / 2, REMOTE_BITS, REMOTE_OUT, HALVES, REMOTE_AT_OUTPUTS + BITS / 16, 0, 0},
    {REMOTE_COUNTER("Enc0", 6, MPG_MODE)},
    {REMOTE_COUNTER("Enc1", 7, MPG_MODE)},
    {REMOTE_COUNTER("Enc2", 8, MPG_MODE)},
    {REMOTE_COUNTER("Enc3", 9, MPG_MODE)},
};

static const char *const modes_7i69[] = {"IO", "Input", "Output", "IO_24_24", "IO_Enc"};

const struct remote_kind remote_7i69 = {
    .name = "7i69",
    .card = "7I69",
    .unit_class = 0x14,
    .fields = fields_7i69,
    .field_count = COUNT(fields_7i69),
    .modes = modes_7i69,
    .mode_count = COUNT(modes_7i69),
    .layout = {.ptoc = 0x100,
               .ptoc_step = 0x20, /* five modes */
               .gtoc = 0x200,
               .modes = 0x280,
               .mode_step = 0x40,
               .records = 0x800,
               .record_step = 0x40},
};

/* ---- 7I70 ---------------------------------------------------------------------------------------------------------
 */

enum { ALL_MODES_7I70 = 0x7, ANALOG_MODE = 0x2, VOLTAGE_MODE_7I70 = 0x4 };

static const struct remote_field fields_7i70[] = {
    {REMOTE_INPUTS(BITS, ALL_MODES_7I70)},
    {REMOTE_VOLTS("AnalogIn0", 6, ANALOG_MODE)},
    {REMOTE_VOLTS("AnalogIn1", 7, ANALOG_MODE)},
    {REMOTE_VOLTS("AnalogIn2", 8, ANALOG_MODE)},
    {REMOTE_VOLTS("AnalogIn3", 9, ANALOG_MODE)},
    {REMOTE_VOLTS("AnalogIn4", 10, ANALOG_MODE)},
    {REMOTE_VOLTS("AnalogIn5", 11, ANALOG_MODE)}, /* that makes 96 bits: */
    {REMOTE_VOLTS("FieldVoltage", 12, VOLTAGE_MODE_7I70)},
};

static const char *const modes_7i70[] = {"Input", "Input_Ana", "Input_FV"};

const struct remote_kind remote_7i70 = {
    .name = "7i70",
    .card = "7I70",
    .unit_class = 0x15,
    .field_power = true,
    .fields = fields_7i70,
    .field_count = COUNT(fields_7i70),
    .modes = modes_7i70,
    .mode_count = COUNT(modes_7i70),
    .layout = REMOTE_LAYOUT,
};

/* ---- 7I71 and 7I72 ------------------------------------------------------------------------------------------------
 */

enum { ALL_MODES_7I71 = 0x3, VOLTAGE_MODE_7I71 = 0x2 };

static const struct remote_field fields_7i71[] = {
    {REMOTE_OUTPUTS(BITS, ALL_MODES_7I71)},
    {REMOTE_VOLTS("FieldVoltage", 0, VOLTAGE_MODE_7I71)},
};

static const char *const modes_7i71[] = {"Output", "Output_FV"};

const struct remote_kind remote_7i71 = {
    .name = "7i71",
    .card = "7I71",
    .unit_class = 0x16,
    .field_power = true,
    .fields = fields_7i71,
    .field_count = COUNT(fields_7i71),
    .modes = modes_7i71,
    .mode_count = COUNT(modes_7i71),
    .layout = REMOTE_LAYOUT,
};

static const struct remote_field fields_7i72[] = {{REMOTE_OUTPUTS(BITS, 1)}};

const struct remote_kind remote_7i72 = {
    .name = "7i72",
    .card = "7I72",
    .unit_class = 0x17,
    .sinking = true,
    .fields = fields_7i72,
    .field_count = COUNT(fields_7i72),
    .modes = modes_7i71,
    .mode_count = 1,
    .layout = REMOTE_LAYOUT,
};
