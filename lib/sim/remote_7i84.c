/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* 7I84 and 7I84D: field I/O alone, 32 inputs and 16 outputs. */
#include "remote_kind.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define FULL_SCALE_V 36.3f

enum { ALL_MODES = 0x7, ANALOG_MODES = 0x6, MPG_MODE = 0x4 };

static const struct remote_field fields[] = {
    {"Input", "", 32, REMOTE_BITS, REMOTE_IN, ALL_MODES, REMOTE_AT_INPUTS, 0, 0},
    {"Output", "", 16, REMOTE_BITS, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS, 0, 0},
    {"AnalogIn0", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 4, 0, FULL_SCALE_V},
    {"AnalogIn1", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 5, 0, FULL_SCALE_V},
    {"AnalogIn2", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 6, 0, FULL_SCALE_V},
    {"AnalogIn3", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 7, 0, FULL_SCALE_V},
    {"FieldVoltage", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 8, 0, FULL_SCALE_V},
    {"Enc0", "", 8, REMOTE_ENCODER, REMOTE_IN, MPG_MODE, REMOTE_AT_INPUTS + 9, 0, 0},
    {"Enc1", "", 8, REMOTE_ENCODER, REMOTE_IN, MPG_MODE, REMOTE_AT_INPUTS + 10, 0, 0},
};

static const char *const modes[] = {"IO_Only", "IO_Ana", "IO_Enc_Ana_FV"};

const struct remote_kind remote_7i84 = {
    .name = "7i84",
    .card = "7I84",
    .unit_class = 0x13,
    .field_power = true,
    .fields = fields,
    .field_count = COUNT(fields),
    .modes = modes,
    .mode_count = COUNT(modes),
    .layout = REMOTE_LAYOUT,
};

const struct remote_kind remote_7i84d = {
    .name = "7i84d",
    .card = "7I84",
    .unit_class = 0x13,
    .sinking = true,
    .field_power = true,
    .fields = fields,
    .field_count = COUNT(fields),
    .modes = modes,
    .mode_count = COUNT(modes),
    .layout = REMOTE_LAYOUT,
};
