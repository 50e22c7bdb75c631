/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What kinds of remotes are made of: constant tables, one file remote_*.c each, in which a kind is one row. */
#ifndef SIM_REMOTE_KIND_H
#define SIM_REMOTE_KIND_H

#include "remote.h"

/* Data types and directions (seed 003, "DATA_TYPE", "DATA_DIRECTION"; register map 3.8.6 for encoders). */
enum remote_type {
    REMOTE_PAD = 0x00,
    REMOTE_BITS = 0x01,
    REMOTE_UNSIGNED = 0x02,
    REMOTE_SIGNED = 0x03,
    REMOTE_NV_UNSIGNED = 0x04,
    REMOTE_NV_SIGNED = 0x05,
    REMOTE_STREAM = 0x06,
    REMOTE_BOOLEAN = 0x07,
    REMOTE_ENCODER = 0x08,
};

enum remote_direction { REMOTE_IN = 0x00, REMOTE_BOTH = 0x40, REMOTE_OUT = 0x80 };

/* Addresses that mean something to the processor, the same in all kinds. */
enum remote_address {
    REMOTE_AT_INPUTS = 0x600,
    REMOTE_AT_OUTPUTS = 0x640,
    REMOTE_AT_UNIT_NUMBER = 0x680,
    REMOTE_AT_WATCHDOG = 0x684, /* milliseconds, 0 = none */
    REMOTE_AT_FAULT = 0x686,
    REMOTE_AT_SOFTWARE = 0x688, /* revisions */
    REMOTE_AT_HARDWARE = 0x68A,
    REMOTE_AT_NV = 0x6C0, /* from here on: EEPROM */
    REMOTE_AT_NV_BAUD = 0x6C0,
    REMOTE_AT_NV_UNIT_NUMBER = 0x6C4,
    REMOTE_AT_NV_WATCHDOG = 0x6C8,
    REMOTE_AT_NV_OWN = 0x6D0, /* what only some kinds have */
    REMOTE_NV_BYTES = 0x20,
};

struct remote_field {
    const char *name, *unit;
    uint8_t bits, type, direction;
    uint8_t modes; /* bit n: process data of software mode n; 0: a parameter */
    uint16_t address;
    float min, max;
};

/* Rows that many tables have: digital inputs and outputs, an analog input, an MPG counter; `at` bytes behind the first
 * input. Analog inputs and field voltage have the full scale of seed 003, "ANALOG INPUTS". */
#define REMOTE_FULL_SCALE_V          36.3f
#define REMOTE_INPUTS(count, modes)  "Input", "", count, REMOTE_BITS, REMOTE_IN, modes, REMOTE_AT_INPUTS, 0, 0
#define REMOTE_OUTPUTS(count, modes) "Output", "", count, REMOTE_BITS, REMOTE_OUT, modes, REMOTE_AT_OUTPUTS, 0, 0
#define REMOTE_VOLTS(name, at, modes) \
    name, "Volts", 8, REMOTE_UNSIGNED, REMOTE_IN, modes, REMOTE_AT_INPUTS + (at), 0, REMOTE_FULL_SCALE_V
#define REMOTE_COUNTER(name, at, modes) name, "", 8, REMOTE_ENCODER, REMOTE_IN, modes, REMOTE_AT_INPUTS + (at), 0, 0

/* A drive takes its speed from one output and its enable from another. */
struct remote_enable {
    const char *output, *enable;
};

/* Where the tables lie. */
struct remote_layout {
    uint16_t ptoc, ptoc_step; /* from mode to mode */
    uint16_t gtoc;
    uint16_t modes, mode_step; /* records: the hardware mode, then the software modes */
    uint16_t records, record_step;
};

struct remote_kind {
    const char *name; /* for remote_new() */
    char card[5];
    uint8_t unit_class; /* top byte of the unit number */
    bool sinking;       /* field outputs to ground, not to field power */
    bool field_power;   /* has a FieldVoltage that it watches */
    bool loopback;      /* open-drain pins: what is driven low reads as active, too */
    bool no_parameters; /* none of those that the others share (remote.c), and the GTOC is empty */
    const struct remote_field *fields;
    unsigned field_count;
    const char *const *modes; /* software modes; there is one hardware mode */
    unsigned mode_count;
    const struct remote_enable *enables;
    unsigned enable_count;
    struct remote_layout layout;
};

/* Layout of most of them; four modes at most. */
#define REMOTE_LAYOUT                                                                                         \
    {                                                                                                         \
        .ptoc = 0x100, .ptoc_step = 0x40, .gtoc = 0x200, .modes = 0x280, .mode_step = 0x40, .records = 0x800, \
        .record_step = 0x40                                                                                   \
    }

extern const struct remote_kind remote_7i77_field, remote_7i77d_field, remote_7i77_analog, remote_7i76, remote_7i84,
    remote_7i84d, remote_7i90, remote_7i69, remote_7i70, remote_7i71, remote_7i72, remote_7i73;

#endif
