/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * 7I73: a control panel with MPGs, keypad, analog inputs and a display. Modes, pins and parameters are those of
 * sserial(9); what it has without a table here (widths, order, ranges, names of modes, the top byte of its unit number)
 * is assumed, for an 8 x 8 keypad, which leaves 8 inputs and 6 outputs.
 */
#include "remote_kind.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

enum { ALL_MODES = 0x7, ANALOG_MODES = 0x6, DISPLAY_MODE = 0x4 };

#define FRACTION(name, at) name, "", 8, REMOTE_UNSIGNED, REMOTE_IN, ANALOG_MODES, REMOTE_AT_INPUTS + (at), 0, 1
#define SETTING(name, at)  name, "None", 8, REMOTE_NV_UNSIGNED, REMOTE_BOTH, 0, REMOTE_AT_NV_OWN + (at), 0, UINT8_MAX

static const struct remote_field fields[] = {
    {REMOTE_INPUTS(8, ALL_MODES)},
    {REMOTE_OUTPUTS(6, ALL_MODES)},
    {"", "", 2, REMOTE_PAD, REMOTE_OUT, ALL_MODES, REMOTE_AT_OUTPUTS + 1, 0, 0},
    {"KeyCode", "", 8, REMOTE_STREAM, REMOTE_IN, ALL_MODES, REMOTE_AT_INPUTS + 1, 0, 0},
    {REMOTE_COUNTER("Enc0", 2, ALL_MODES)},
    {REMOTE_COUNTER("Enc1", 3, ALL_MODES)},
    {REMOTE_COUNTER("Enc2", 4, ALL_MODES)},
    {REMOTE_COUNTER("Enc3", 5, ALL_MODES)},
    {FRACTION("AnalogIn0", 6)},
    {FRACTION("AnalogIn1", 7)},
    {FRACTION("AnalogIn2", 8)},
    {FRACTION("AnalogIn3", 9)},
    {"Display", "", 8, REMOTE_STREAM, REMOTE_OUT, ANALOG_MODES, REMOTE_AT_OUTPUTS + 2, 0, 0},
    {"Display32", "", 32, REMOTE_STREAM, REMOTE_OUT, DISPLAY_MODE, REMOTE_AT_OUTPUTS + 4, 0, 0},
    {SETTING("NVAnalogFilter", 0)},
    {SETTING("NVContrast", 1)},
    {SETTING("NVDispMode", 2)},
    {SETTING("NVEncMode0", 3)},
    {SETTING("NVEncMode1", 4)},
    {SETTING("NVEncMode2", 5)},
    {SETTING("NVEncMode3", 6)},
    {SETTING("NVKeyTimer", 7)},
};

static const char *const modes[] = {"IO_Enc", "IO_Enc_Ana", "IO_Enc_Ana_FD"};

const struct remote_kind remote_7i73 = {
    .name = "7i73",
    .card = "7I73",
    .unit_class = 0x18,
    .fields = fields,
    .field_count = COUNT(fields),
    .modes = modes,
    .mode_count = COUNT(modes),
    .layout = REMOTE_LAYOUT,
};
