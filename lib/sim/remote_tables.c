/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Memory of a remote, its fields, and the tables of contents from which a host learns of them. */
#include <string.h>
#include <strings.h>

#include "remote_state.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

#define RECORD_DATA   0xA0u /* seed 003, "PROCESS DATA DESCRIPTOR", "MODE DESCRIPTOR" */
#define RECORD_MODE   0xB0u
#define HARDWARE_MODE 0u
#define SOFTWARE_MODE 1u

/* Parameters that the cards share (seed 003, "FIELD I/O PARAMETERS"); the names of most are in listings of real cards.
 * No float holds the maximum of 32 bits: this is the largest one below. */
static const struct remote_field parameters[] = {
    {"SwRevision", "None", 16, REMOTE_UNSIGNED, REMOTE_IN, 0, REMOTE_AT_SOFTWARE, 0, 65535},
    {"HwRevision", "None", 16, REMOTE_UNSIGNED, REMOTE_IN, 0, REMOTE_AT_HARDWARE, 0, 65535},
    {"NVBaudRate", "None", 8, REMOTE_NV_UNSIGNED, REMOTE_BOTH, 0, REMOTE_AT_NV_BAUD, 0, 11},
    {"NVUnitNumber", "None", 32, REMOTE_NV_UNSIGNED, REMOTE_BOTH, 0, REMOTE_AT_NV_UNIT_NUMBER, 0, 4294967040.0f},
    {"UnitNumber", "None", 32, REMOTE_UNSIGNED, REMOTE_BOTH, 0, REMOTE_AT_UNIT_NUMBER, 0, 4294967040.0f},
    {"NVWatchDogTimeout", "mS", 16, REMOTE_NV_UNSIGNED, REMOTE_BOTH, 0, REMOTE_AT_NV_WATCHDOG, 0, 65535},
    {"WatchDogTimeout", "mS", 16, REMOTE_UNSIGNED, REMOTE_BOTH, 0, REMOTE_AT_WATCHDOG, 0, 65535},
    {"Fault", "None", 8, REMOTE_UNSIGNED, REMOTE_BOTH, 0, REMOTE_AT_FAULT, 0, 255},
};

/* ---- memory -------------------------------------------------------------------------------------------------------
 */

void remote_store(uint8_t *const memory, const unsigned address, const uint64_t value, const unsigned bytes)
{
    for (unsigned i = 0; i < bytes && address + i < REMOTE_MEMORY; i++)
        memory[address + i] = (uint8_t)(value >> 8 * i);
}

uint64_t remote_load(const uint8_t *const memory, const unsigned address, const unsigned bytes)
{
    uint64_t value = 0;
    for (unsigned i = 0; i < bytes && address + i < REMOTE_MEMORY; i++)
        value |= (uint64_t)memory[address + i] << 8 * i;
    return value;
}

/* ---- fields -------------------------------------------------------------------------------------------------------
 */

const struct remote_field *remote_field_at(const struct remote_kind *const kind, const unsigned index)
{
    if (index < kind->field_count)
        return &kind->fields[index];
    const unsigned parameter = index - kind->field_count;
    return !kind->no_parameters && parameter < COUNT(parameters) ? &parameters[parameter] : NULL;
}

const struct remote_field *remote_find_field(const struct remote_kind *const kind, const char *const name,
                                             unsigned *const index)
{
    const struct remote_field *field;
    for (*index = 0; (field = remote_field_at(kind, *index)); (*index)++)
        if (field->name[0] && strcasecmp(field->name, name) == 0)
            return field;
    return NULL;
}

bool remote_to_host(const struct remote_field *const field)
{
    return field->direction != REMOTE_OUT;
}

bool remote_from_host(const struct remote_field *const field)
{
    return field->direction != REMOTE_IN;
}

/* ---- tables in memory ---------------------------------------------------------------------------------------------
 */

static unsigned put_string(uint8_t *const memory, const unsigned address, const char *const text)
{
    const unsigned len = (unsigned)strlen(text) + 1;
    for (unsigned i = 0; i < len; i++)
        remote_store(memory, address + i, (uint8_t)text[i], 1);
    return address + len;
}

static uint32_t float_bits(const float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static void put_field(uint8_t *const memory, unsigned at, const struct remote_field *const field)
{
    const uint8_t head[] = {RECORD_DATA, field->bits, field->type, field->direction};
    for (unsigned i = 0; i < sizeof head; i++)
        remote_store(memory, at++, head[i], 1);
    remote_store(memory, at, float_bits(field->min), 4);
    remote_store(memory, at + 4, float_bits(field->max), 4);
    remote_store(memory, at + 8, field->address, 2);
    put_string(memory, put_string(memory, at + 10, field->unit), field->name);
}

static void put_mode(uint8_t *const memory, const unsigned at, const unsigned type, const unsigned index,
                     const char *const name)
{
    remote_store(memory, at, RECORD_MODE | index << 8 | type << 16, 4);
    put_string(memory, at + 4, name);
}

static unsigned record_of(const struct remote_kind *const kind, const unsigned field)
{
    return kind->layout.records + field * kind->layout.record_step;
}

/* Record of a software mode; that of the hardware mode lies before the first. */
static unsigned mode_record(const struct remote_kind *const kind, const unsigned mode)
{
    return kind->layout.modes + (mode + 1) * kind->layout.mode_step;
}

static void put_ptoc(uint8_t *const memory, const struct remote_kind *const kind, const unsigned mode)
{
    unsigned at = kind->layout.ptoc + mode * kind->layout.ptoc_step;
    remote_store(memory, at, kind->layout.modes, 2);
    remote_store(memory, at + 2, mode_record(kind, mode), 2);
    at += 4;
    for (unsigned i = 0; i < kind->field_count; i++) {
        if (!(kind->fields[i].modes >> mode & 1u))
            continue;
        remote_store(memory, at, record_of(kind, i), 2);
        at += 2;
    }
}

/* Process data is in the global table as well (reference: HAL interface, 4.4). That it is the data which all modes
 * have, so that no mode makes process data of others look like parameters, is an assumption. */
static void put_gtoc(uint8_t *const memory, const struct remote_kind *const kind)
{
    if (kind->no_parameters)
        return;
    const unsigned all_modes = (1u << kind->mode_count) - 1u;
    unsigned at = kind->layout.gtoc;
    const struct remote_field *field;
    for (unsigned i = 0; (field = remote_field_at(kind, i)); i++) {
        if (field->modes != 0 && field->modes != all_modes)
            continue;
        remote_store(memory, at, record_of(kind, i), 2);
        at += 2;
    }
    remote_store(memory, at, kind->layout.modes, 2);
    for (unsigned mode = 0; mode < kind->mode_count; mode++)
        remote_store(memory, at += 2, mode_record(kind, mode), 2);
}

void remote_put_tables(struct remote *const r)
{
    const struct remote_kind *const kind = r->kind;
    const struct remote_field *field;
    put_mode(r->memory, kind->layout.modes, HARDWARE_MODE, 0, "standard");
    for (unsigned i = 0; i < kind->mode_count; i++) {
        put_mode(r->memory, mode_record(kind, i), SOFTWARE_MODE, i, kind->modes[i]);
        put_ptoc(r->memory, kind, i);
    }
    for (unsigned i = 0; (field = remote_field_at(kind, i)); i++)
        put_field(r->memory, record_of(kind, i), field);
    put_gtoc(r->memory, kind);
}
