/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* 7I90 with the firmware for smart serial, byte by byte as the traces in folder sslbp show its memory: 72 open-drain
 * pins in three groups, and nothing else. */
#include "remote_kind.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

static const struct remote_field fields[] = {
    {"P1-In", "bit", 24, REMOTE_BITS, REMOTE_IN, 1, 0x600, 0, 0},
    {"P2-In", "bit", 24, REMOTE_BITS, REMOTE_IN, 1, 0x603, 0, 0},
    {"P3-In", "bit", 24, REMOTE_BITS, REMOTE_IN, 1, 0x606, 0, 0},
    {"P1-Out", "bit", 24, REMOTE_BITS, REMOTE_OUT, 1, 0x610, 0, 0},
    {"P2-Out", "bit", 24, REMOTE_BITS, REMOTE_OUT, 1, 0x613, 0, 0},
    {"P3-Out", "bit", 24, REMOTE_BITS, REMOTE_OUT, 1, 0x616, 0, 0},
};

static const char *const modes[] = {"standard"};

const struct remote_kind remote_7i90 = {
    .name = "7i90",
    .card = "7I90",
    .unit_class = 0x12,
    .loopback = true,
    .no_parameters = true,
    .fields = fields,
    .field_count = COUNT(fields),
    .modes = modes,
    .mode_count = COUNT(modes),
    .layout = {.ptoc = 0x200, .gtoc = 0x220, .modes = 0x280, .mode_step = 0x40, .records = 0x300, .record_step = 0x20},
};
