/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* 7I76: field I/O and spindle. Modes and parameters as a listing of a real card prints them (reference: flash tool,
 * 1.4.5); names of fields are those that LinuxCNC's users have as pins. */
#include "remote_kind.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define FULL_SCALE_V 36.3f

enum { ALL_MODES = 0x7, ANALOG_MODES = 0x6, MPG_MODE = 0x4 };

static const struct remote_field fields[] = {
    {"Input", "", 32, REMOTE_BITS, REMOTE_IN, ALL_MODES, REMOTE_AT_INPUTS, 0, 0},
    {"Output", "", 16, REMOTE_BITS, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS, 0, 0},
    {"SpinOut", "Percent", 12, REMOTE_UNSIGNED, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS + 2, 0, 100},
    {"SpinEna", "", 1, REMOTE_BOOLEAN, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS + 4, 0, 0},
    {"SpinDir", "", 1, REMOTE_BOOLEAN, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS + 5, 0, 0},
    {"", "", 2, REMOTE_PAD, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS + 6, 0, 0},
    {"AnalogIn0", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 4, 0, FULL_SCALE_V},
    {"AnalogIn1", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 5, 0, FULL_SCALE_V},
    {"AnalogIn2", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 6, 0, FULL_SCALE_V},
    {"AnalogIn3", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 7, 0, FULL_SCALE_V},
    {"FieldVoltage", "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + 8, 0, FULL_SCALE_V},
    {"Enc0", "", 8, REMOTE_ENCODER, REMOTE_IN, MPG_MODE, REMOTE_AT_INPUTS + 9, 0, 0},
    {"Enc1", "", 8, REMOTE_ENCODER, REMOTE_IN, MPG_MODE, REMOTE_AT_INPUTS + 10, 0, 0},
};

static const struct remote_enable enables[] = {{"SpinOut", "SpinEna"}};

static const char *const modes[] = {"IO_Spin", "IO_Ana_Spin", "IO_Enc_Ana_Spin_FV"};

const struct remote_kind remote_7i76 = {
    .name = "7i76",
    .card = "7I76",
    .unit_class = 0x10,
    .field_power = true,
    .fields = fields,
    .field_count = COUNT(fields),
    .modes = modes,
    .mode_count = COUNT(modes),
    .enables = enables,
    .enable_count = COUNT(enables),
    .layout = REMOTE_LAYOUT,
};
