/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* 7I76: field I/O and spindle. Modes and parameters as a listing of a real card prints them (reference: flash tool,
 * 1.4.5); names of fields are those that LinuxCNC's users have as pins. */
#include "remote_kind.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

enum { ALL_MODES = 0x7, ANALOG_MODES = 0x6, MPG_MODE = 0x4 };

static const struct remote_field fields[] = {
    {REMOTE_INPUTS(32, ALL_MODES)},
    {REMOTE_OUTPUTS(16, ALL_MODES)},
    {"SpinOut", "Percent", 12, REMOTE_UNSIGNED, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS + 2, 0, 100},
    {"SpinEna", "", 1, REMOTE_BOOLEAN, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS + 4, 0, 0},
    {"SpinDir", "", 1, REMOTE_BOOLEAN, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS + 5, 0, 0},
    {"", "", 2, REMOTE_PAD, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS + 6, 0, 0},
    {REMOTE_VOLTS("AnalogIn0", 4, ANALOG_MODES)},
    {REMOTE_VOLTS("AnalogIn1", 5, ANALOG_MODES)},
    {REMOTE_VOLTS("AnalogIn2", 6, ANALOG_MODES)},
    {REMOTE_VOLTS("AnalogIn3", 7, ANALOG_MODES)},
    {REMOTE_VOLTS("FieldVoltage", 8, ANALOG_MODES)},
    {REMOTE_COUNTER("Enc0", 9, MPG_MODE)},
    {REMOTE_COUNTER("Enc1", 10, MPG_MODE)},
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
