/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* 7I84 and 7I84D: field I/O alone, 32 inputs and 16 outputs. */
#include "remote_kind.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

enum { ALL_MODES = 0x7, ANALOG_MODES = 0x6, MPG_MODE = 0x4 };

static const struct remote_field fields[] = {
    {REMOTE_INPUTS(32, ALL_MODES)},
    {REMOTE_OUTPUTS(16, ALL_MODES)},
    {REMOTE_VOLTS("AnalogIn0", 4, ANALOG_MODES)},
    {REMOTE_VOLTS("AnalogIn1", 5, ANALOG_MODES)},
    {REMOTE_VOLTS("AnalogIn2", 6, ANALOG_MODES)},
    {REMOTE_VOLTS("AnalogIn3", 7, ANALOG_MODES)},
    {REMOTE_VOLTS("FieldVoltage", 8, ANALOG_MODES)},
    {REMOTE_COUNTER("Enc0", 9, MPG_MODE)},
    {REMOTE_COUNTER("Enc1", 10, MPG_MODE)},
};

static const char *const modes[] = {"IO_Only", "IO_Ana", "IO_Enc_Ana_FV"};

/* The D sinks where the other sources. */
#define FIELD_IO(title, sinks)                                                                        \
    {                                                                                                 \
        .name = (title), .card = "7I84", .unit_class = 0x13, .sinking = (sinks), .field_power = true, \
        .fields = fields, .field_count = COUNT(fields), .modes = modes, .mode_count = COUNT(modes),   \
        .layout = REMOTE_LAYOUT,                                                                      \
    }

const struct remote_kind remote_7i84 = FIELD_IO("7i84", false);
const struct remote_kind remote_7i84d = FIELD_IO("7i84d", true);
