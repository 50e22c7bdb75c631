/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * 7I77 and 7I77D: a processor for the field I/O (32 inputs, 16 outputs, four of the inputs measured, field voltage, two
 * MPG counters; seed 003, "SOFTWARE PROCESS DATA MODES") and one for six analog outputs and their enables.
 * Names of fields and modes are those that LinuxCNC's users have as pins; the manual does not print them.
 */
#include "remote_kind.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

enum { ALL_MODES = 0xF, ANALOG_MODES = 0xE, VOLTAGE_MODES = 0xC, MPG_MODE = 0x8 };

static const struct remote_field field_fields[] = {
    {REMOTE_INPUTS(32, ALL_MODES)},
    {REMOTE_OUTPUTS(16, ALL_MODES)},
    {REMOTE_VOLTS("AnalogIn0", 4, ANALOG_MODES)},
    {REMOTE_VOLTS("AnalogIn1", 5, ANALOG_MODES)},
    {REMOTE_VOLTS("AnalogIn2", 6, ANALOG_MODES)},
    {REMOTE_VOLTS("AnalogIn3", 7, ANALOG_MODES)},
    {REMOTE_VOLTS("FieldVoltage", 8, VOLTAGE_MODES)},
    {REMOTE_COUNTER("Enc0", 9, MPG_MODE)},
    {REMOTE_COUNTER("Enc1", 10, MPG_MODE)},
};

static const char *const field_modes[] = {"IO_Only", "IO_Ana", "IO_Ana_FV", "IO_Enc_Ana_FV"};

/* The D sinks where the other sources. */
#define FIELD_IO(title, sinks)                                                                        \
    {                                                                                                 \
        .name = (title), .card = "7I77", .unit_class = 0x12, .sinking = (sinks), .field_power = true, \
        .fields = field_fields, .field_count = COUNT(field_fields), .modes = field_modes,             \
        .mode_count = COUNT(field_modes), .layout = REMOTE_LAYOUT,                                    \
    }

const struct remote_kind remote_7i77_field = FIELD_IO("7i77-field", false);
const struct remote_kind remote_7i77d_field = FIELD_IO("7i77d-field", true);

/* 13 bits each (seed 003, "ANALOG OUTPUTS": resolution), which is also what three registers have room for. */
#define ANALOG_OUT(name, number)                                                                   \
    {                                                                                              \
        name, "Volts", 13, REMOTE_SIGNED, REMOTE_OUT, 1, REMOTE_AT_OUTPUTS + 2 * (number), -10, 10 \
    }

static const struct remote_field analog_fields[] = {
    ANALOG_OUT("AnalogOut0", 0),
    ANALOG_OUT("AnalogOut1", 1),
    ANALOG_OUT("AnalogOut2", 2),
    ANALOG_OUT("AnalogOut3", 3),
    ANALOG_OUT("AnalogOut4", 4),
    ANALOG_OUT("AnalogOut5", 5),
    {"AnalogEna", "", 1, REMOTE_BOOLEAN, REMOTE_OUT, 1, REMOTE_AT_OUTPUTS + 12, 0, 0},
    {"SpinEna", "", 1, REMOTE_BOOLEAN, REMOTE_OUT, 1, REMOTE_AT_OUTPUTS + 13, 0, 0},
};

/* Five enables are switched in common, the sixth by itself (seed 003, "SERVO ENABLE OUTPUTS"). */
static const struct remote_enable enables[] = {
    {"AnalogOut0", "AnalogEna"}, {"AnalogOut1", "AnalogEna"}, {"AnalogOut2", "AnalogEna"},
    {"AnalogOut3", "AnalogEna"}, {"AnalogOut4", "AnalogEna"}, {"AnalogOut5", "SpinEna"},
};

static const char *const analog_modes[] = {"Analog"};

const struct remote_kind remote_7i77_analog = {
    .name = "7i77-analog",
    .card = "7I77",
    .unit_class = 0x11,
    .fields = analog_fields,
    .field_count = COUNT(analog_fields),
    .modes = analog_modes,
    .mode_count = COUNT(analog_modes),
    .enables = enables,
    .enable_count = COUNT(enables),
    .layout = REMOTE_LAYOUT,
};
