/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "remote.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "remote_kind.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

#define RECORD_DATA      0xA0u /* seed 003, "PROCESS DATA DESCRIPTOR", "MODE DESCRIPTOR" */
#define RECORD_MODE      0xB0u
#define HARDWARE_MODE    0u
#define SOFTWARE_MODE    1u
#define DEFAULT_BAUD     9u /* 2.5 Mbaud (seed 003, "OPERATE MODE BAUD RATE") */
#define DEFAULT_WATCHDOG 50u
#define SOFTWARE_REV     14u /* as a listing of a real 7I76 has them (reference: flash tool, 1.4.5) */
#define HARDWARE_REV     1u
#define FIELD_V          24.0
#define FIELD_MIN_V      5.0 /* seed 003, "SPECIFICATIONS": field power 5 to 28 V; inputs stand 32 */
#define FIELD_MAX_V      32.0
#define NS_PER_MS        1000000
#define MAX_FIELDS       32u
#define SERIAL_BITS      24

struct remote {
    const struct remote_kind *kind;
    uint8_t memory[REMOTE_MEMORY];
    uint8_t nv[REMOTE_NV_BYTES];
    uint8_t nv_memory; /* that reads and writes mean; 0 = none */
    uint8_t mode, baud;
    uint8_t held;               /* faults of causes that last */
    uint64_t world[MAX_FIELDS]; /* what is outside of each input field */
    uint32_t shorted, tripped;  /* outputs */
    int64_t fed_ns;
};

static const struct remote_kind *const kinds[] = {&remote_7i77_field, &remote_7i77d_field, &remote_7i77_analog,
                                                  &remote_7i76,       &remote_7i84,        &remote_7i84d,
                                                  &remote_7i90};

static const char *const names[] = {"7i77-field", "7i77d-field", "7i77-analog", "7i76", "7i84", "7i84d", "7i90", NULL};

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

const char *const *remote_names(void)
{
    return names;
}

/* ---- memory -------------------------------------------------------------------------------------------------------
 */

static void put(uint8_t *const memory, const unsigned address, const uint64_t value, const unsigned bytes)
{
    for (unsigned i = 0; i < bytes && address + i < REMOTE_MEMORY; i++)
        memory[address + i] = (uint8_t)(value >> 8 * i);
}

static uint64_t get(const uint8_t *const memory, const unsigned address, const unsigned bytes)
{
    uint64_t value = 0;
    for (unsigned i = 0; i < bytes && address + i < REMOTE_MEMORY; i++)
        value |= (uint64_t)memory[address + i] << 8 * i;
    return value;
}

static unsigned bytes_of(const unsigned bits)
{
    return (bits + 7) / 8;
}

static uint64_t mask_of(const unsigned bits)
{
    return bits < 64 ? (1ULL << bits) - 1 : UINT64_MAX;
}

/* ---- fields -------------------------------------------------------------------------------------------------------
 */

/* The kind's own ones, then the shared parameters; NULL behind the last. */
static const struct remote_field *field_at(const struct remote_kind *const kind, const unsigned index)
{
    if (index < kind->field_count)
        return &kind->fields[index];
    const unsigned parameter = index - kind->field_count;
    return !kind->no_parameters && parameter < COUNT(parameters) ? &parameters[parameter] : NULL;
}

static const struct remote_field *find_field(const struct remote_kind *const kind, const char *const name,
                                             unsigned *const index)
{
    const struct remote_field *field;
    for (*index = 0; (field = field_at(kind, *index)); (*index)++)
        if (field->name[0] && strcasecmp(field->name, name) == 0)
            return field;
    return NULL;
}

static bool in_mode(const struct remote *const r, const struct remote_field *const field)
{
    return field->modes >> r->mode & 1u;
}

static bool to_host(const struct remote_field *const field)
{
    return field->direction != REMOTE_OUT;
}

static bool from_host(const struct remote_field *const field)
{
    return field->direction != REMOTE_IN;
}

/* ---- tables in memory ---------------------------------------------------------------------------------------------
 */

static unsigned put_string(uint8_t *const memory, const unsigned address, const char *const text)
{
    const unsigned len = (unsigned)strlen(text) + 1;
    for (unsigned i = 0; i < len; i++)
        put(memory, address + i, (uint8_t)text[i], 1);
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
        put(memory, at++, head[i], 1);
    put(memory, at, float_bits(field->min), 4);
    put(memory, at + 4, float_bits(field->max), 4);
    put(memory, at + 8, field->address, 2);
    put_string(memory, put_string(memory, at + 10, field->unit), field->name);
}

static void put_mode(uint8_t *const memory, const unsigned at, const unsigned type, const unsigned index,
                     const char *const name)
{
    put(memory, at, RECORD_MODE | index << 8 | type << 16, 4);
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
    put(memory, at, kind->layout.modes, 2);
    put(memory, at + 2, mode_record(kind, mode), 2);
    at += 4;
    for (unsigned i = 0; i < kind->field_count; i++) {
        if (!(kind->fields[i].modes >> mode & 1u))
            continue;
        put(memory, at, record_of(kind, i), 2);
        at += 2;
    }
}

/* Process data is in the global table as well (reference: HAL interface, 4.4). That it is the data of the first mode,
 * so that no mode makes process data of others look like parameters, is an assumption. */
static void put_gtoc(uint8_t *const memory, const struct remote_kind *const kind)
{
    if (kind->no_parameters)
        return;
    unsigned at = kind->layout.gtoc;
    const struct remote_field *field;
    for (unsigned i = 0; (field = field_at(kind, i)); i++) {
        if (field->modes != 0 && !(field->modes & 1u))
            continue;
        put(memory, at, record_of(kind, i), 2);
        at += 2;
    }
    put(memory, at, kind->layout.modes, 2);
    for (unsigned mode = 0; mode < kind->mode_count; mode++)
        put(memory, at += 2, mode_record(kind, mode), 2);
}

static void put_tables(struct remote *const r)
{
    const struct remote_kind *const kind = r->kind;
    const struct remote_field *field;
    put_mode(r->memory, kind->layout.modes, HARDWARE_MODE, 0, "standard");
    for (unsigned i = 0; i < kind->mode_count; i++) {
        put_mode(r->memory, mode_record(kind, i), SOFTWARE_MODE, i, kind->modes[i]);
        put_ptoc(r->memory, kind, i);
    }
    for (unsigned i = 0; (field = field_at(kind, i)); i++)
        put_field(r->memory, record_of(kind, i), field);
    put_gtoc(r->memory, kind);
}

/* ---- what fields are now -------------------------------------------------------------------------------------------
 */

uint8_t remote_faults(const struct remote *const r)
{
    return r->memory[REMOTE_AT_FAULT];
}

/* What an output field does, raw. */
static uint64_t applied(const struct remote *const r, const struct remote_field *const field)
{
    const uint64_t value = get(r->memory, field->address, bytes_of(field->bits)) & mask_of(field->bits);
    if (remote_faults(r))
        return 0;
    return field->address == REMOTE_AT_OUTPUTS && field->type == REMOTE_BITS ? value & ~(uint64_t)r->tripped : value;
}

/* Inputs as they are now. Pins with open drains: inputs and outputs are paired by their order. */
static void sample(struct remote *const r)
{
    const struct remote_kind *const kind = r->kind;
    const unsigned pairs = kind->field_count / 2;
    for (unsigned i = 0; i < kind->field_count; i++) {
        const struct remote_field *const field = &kind->fields[i];
        if (field->direction != REMOTE_IN)
            continue;
        const uint64_t driven = kind->loopback ? applied(r, &kind->fields[i + pairs]) : 0;
        put(r->memory, field->address, r->world[i] | driven, bytes_of(field->bits));
    }
}

/* ---- life ---------------------------------------------------------------------------------------------------------
 */

static const struct remote_kind *find_kind(const char *const name)
{
    for (size_t i = 0; i < COUNT(kinds); i++)
        if (strcmp(kinds[i]->name, name) == 0)
            return kinds[i];
    return NULL;
}

static void put_nv(struct remote *const r, const unsigned address, const uint32_t value, const unsigned bytes)
{
    for (unsigned i = 0; i < bytes; i++)
        r->nv[address - REMOTE_AT_NV + i] = (uint8_t)(value >> 8 * i);
}

static uint32_t get_nv(const struct remote *const r, const unsigned address, const unsigned bytes)
{
    uint32_t value = 0;
    for (unsigned i = 0; i < bytes; i++)
        value |= (uint32_t)r->nv[address - REMOTE_AT_NV + i] << 8 * i;
    return value;
}

int remote_new(struct remote **const remote, const char *const name, const uint32_t serial, struct hm2_diag *const diag)
{
    const struct remote_kind *const kind = find_kind(name);
    *remote = NULL;
    if (!kind)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "no simulated remote is called \"%s\"", name);
    struct remote *const r = calloc(1, sizeof *r);
    if (!r)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for a simulated remote");
    r->kind = kind;
    put_nv(r, REMOTE_AT_NV_BAUD, DEFAULT_BAUD, 1);
    put_nv(r, REMOTE_AT_NV_UNIT_NUMBER, (uint32_t)kind->unit_class << SERIAL_BITS | (serial & 0xFFFFFFu), 4);
    put_nv(r, REMOTE_AT_NV_WATCHDOG, DEFAULT_WATCHDOG, 2);
    remote_power_up(r, 0);
    if (kind->field_power)
        (void)!remote_set(r, "FieldVoltage", FIELD_V);
    *remote = r;
    return 0;
}

void remote_free(struct remote *const r)
{
    free(r);
}

void remote_power_up(struct remote *const r, const int64_t now_ns)
{
    memset(r->memory, 0, sizeof r->memory);
    put_tables(r);
    r->baud = r->nv[REMOTE_AT_NV_BAUD - REMOTE_AT_NV];
    put(r->memory, REMOTE_AT_UNIT_NUMBER, get_nv(r, REMOTE_AT_NV_UNIT_NUMBER, 4), 4);
    put(r->memory, REMOTE_AT_WATCHDOG, get_nv(r, REMOTE_AT_NV_WATCHDOG, 2), 2);
    r->memory[REMOTE_AT_SOFTWARE] = SOFTWARE_REV;
    r->memory[REMOTE_AT_HARDWARE] = HARDWARE_REV;
    r->memory[REMOTE_AT_FAULT] = REMOTE_FAULT_WATCHDOG | r->held;
    r->nv_memory = 0;
    r->mode = 0;
    r->tripped = 0;
    r->fed_ns = now_ns;
    sample(r);
}

/* ---- what LBP commands ask ----------------------------------------------------------------------------------------
 */

const char *remote_card_name(const struct remote *const r)
{
    return r->kind->card;
}

uint32_t remote_unit_number(const struct remote *const r)
{
    return (uint32_t)get(r->memory, REMOTE_AT_UNIT_NUMBER, 4);
}

uint32_t remote_baud(const struct remote *const r)
{
    static const uint32_t rates[] = {9600,   19200,  38400,   57600,   115200,  230400,
                                     460800, 921600, 1250000, 2500000, 5000000, 10000000};
    return rates[r->baud < COUNT(rates) ? r->baud : DEFAULT_BAUD];
}

static void add_fault(struct remote *const r, const uint8_t fault)
{
    r->memory[REMOTE_AT_FAULT] |= fault;
}

void remote_set_mode(struct remote *const r, const uint8_t mode)
{
    if (mode < r->kind->mode_count)
        r->mode = mode;
    else
        add_fault(r, REMOTE_FAULT_ILLEGAL_MODE);
}

uint16_t remote_ptoc(const struct remote *const r)
{
    return (uint16_t)(r->kind->layout.ptoc + r->mode * r->kind->layout.ptoc_step);
}

uint16_t remote_gtoc(const struct remote *const r)
{
    return r->kind->layout.gtoc;
}

static unsigned process_bytes(const struct remote *const r, bool (*const wanted)(const struct remote_field *))
{
    unsigned bits = 0;
    for (unsigned i = 0; i < r->kind->field_count; i++)
        if (in_mode(r, &r->kind->fields[i]) && wanted(&r->kind->fields[i]))
            bits += r->kind->fields[i].bits;
    return bytes_of(bits);
}

unsigned remote_in_bytes(const struct remote *const r)
{
    return process_bytes(r, to_host);
}

unsigned remote_out_bytes(const struct remote *const r)
{
    return process_bytes(r, from_host);
}

void remote_clear_faults(struct remote *const r, const uint8_t mask)
{
    r->memory[REMOTE_AT_FAULT] = (uint8_t)((r->memory[REMOTE_AT_FAULT] & ~mask) | r->held);
    r->tripped = 0;
}

void remote_set_nv_access(struct remote *const r, const uint8_t memory)
{
    r->nv_memory = memory;
}

/* ---- inputs and outputs -------------------------------------------------------------------------------------------
 */

static const struct remote_field *field_outputs(const struct remote_kind *const kind, unsigned *const bits)
{
    unsigned index;
    const struct remote_field *const field = find_field(kind, "Output", &index);
    *bits = field ? field->bits : 0;
    return field;
}

/* Shorted outputs trip when they come on. */
static void look_for_shorts(struct remote *const r)
{
    unsigned bits;
    const struct remote_field *const field = field_outputs(r->kind, &bits);
    if (!field || r->shorted == 0)
        return;
    const uint32_t tripping = (uint32_t)applied(r, field) & r->shorted;
    r->tripped |= tripping;
    if (tripping)
        add_fault(r, REMOTE_FAULT_OVER_CURRENT);
}

uint8_t remote_read(struct remote *const r, const uint16_t address)
{
    if (r->nv_memory) {
        const bool inside = address >= REMOTE_AT_NV && address < REMOTE_AT_NV + REMOTE_NV_BYTES;
        return inside ? r->nv[address - REMOTE_AT_NV] : 0;
    }
    return address < REMOTE_MEMORY ? r->memory[address] : 0;
}

bool remote_write(struct remote *const r, const uint16_t address, const uint8_t value)
{
    if (r->nv_memory) {
        if (address < REMOTE_AT_NV || address >= REMOTE_AT_NV + REMOTE_NV_BYTES)
            return false;
        r->nv[address - REMOTE_AT_NV] = value;
        return true;
    }
    const bool revision = address >= REMOTE_AT_SOFTWARE && address < REMOTE_AT_HARDWARE + 2;
    if (address < REMOTE_AT_INPUTS || address >= REMOTE_AT_NV || revision)
        return false; /* tables are in program memory */
    r->memory[address] = value;
    if (address == REMOTE_AT_FAULT)
        remote_clear_faults(r, (uint8_t)~value);
    look_for_shorts(r);
    return true;
}

/* Bits of process data, least significant first (seed 003, "PROCESS DATA ELEMENT PACKING AND UNPACKING"). */
static uint64_t take_bits(const uint8_t *const data, const unsigned at, const unsigned bits)
{
    uint64_t value = 0;
    for (unsigned i = 0; i < bits; i++)
        value |= ((uint64_t)data[(at + i) / 8] >> (at + i) % 8 & 1u) << i;
    return value;
}

static void give_bits(uint8_t *const data, const unsigned at, const unsigned bits, const uint64_t value)
{
    for (unsigned i = 0; i < bits; i++)
        data[(at + i) / 8] = (uint8_t)(data[(at + i) / 8] | (value >> i & 1u) << (at + i) % 8);
}

static void give_inputs(struct remote *const r, uint8_t *const in)
{
    unsigned at = 0;
    sample(r);
    memset(in, 0, remote_in_bytes(r));
    for (unsigned i = 0; i < r->kind->field_count; i++) {
        const struct remote_field *const field = &r->kind->fields[i];
        if (!in_mode(r, field) || !to_host(field))
            continue;
        give_bits(in, at, field->bits, get(r->memory, field->address, bytes_of(field->bits)));
        at += field->bits;
    }
}

static void take_outputs(struct remote *const r, const uint8_t *const out)
{
    unsigned at = 0;
    for (unsigned i = 0; i < r->kind->field_count; i++) {
        const struct remote_field *const field = &r->kind->fields[i];
        if (!in_mode(r, field) || !from_host(field))
            continue;
        put(r->memory, field->address, take_bits(out, at, field->bits), bytes_of(field->bits));
        at += field->bits;
    }
    look_for_shorts(r);
}

void remote_exchange(struct remote *const r, const int64_t now_ns, const uint8_t *const out, uint8_t *const in)
{
    remote_advance(r, now_ns);
    remote_feed(r, now_ns);
    give_inputs(r, in + 1);
    take_outputs(r, out);
    in[0] = remote_faults(r);
}

/* ---- time ---------------------------------------------------------------------------------------------------------
 */

int64_t remote_bite_ns(const struct remote *const r)
{
    const int64_t ms = (int64_t)get(r->memory, REMOTE_AT_WATCHDOG, 2);
    const bool bitten = remote_faults(r) & REMOTE_FAULT_WATCHDOG;
    return ms == 0 || bitten ? INT64_MAX : r->fed_ns + ms * NS_PER_MS;
}

void remote_advance(struct remote *const r, const int64_t now_ns)
{
    if (remote_bite_ns(r) <= now_ns)
        add_fault(r, REMOTE_FAULT_WATCHDOG);
}

void remote_feed(struct remote *const r, const int64_t now_ns)
{
    r->fed_ns = now_ns;
}

/* ---- the world outside --------------------------------------------------------------------------------------------
 */

static double most_of(const struct remote_field *const field)
{
    return field->type == REMOTE_SIGNED ? (double)(mask_of(field->bits) >> 1) : (double)mask_of(field->bits);
}

static bool is_number(const struct remote_field *const field)
{
    return field->type == REMOTE_UNSIGNED || field->type == REMOTE_SIGNED;
}

static void watch_field_power(struct remote *const r, const double volts)
{
    r->held = (uint8_t)(r->held & ~(REMOTE_FAULT_UNDER_VOLTAGE | REMOTE_FAULT_OVER_VOLTAGE));
    if (volts < FIELD_MIN_V)
        r->held |= REMOTE_FAULT_UNDER_VOLTAGE;
    if (volts > FIELD_MAX_V)
        r->held |= REMOTE_FAULT_OVER_VOLTAGE;
    add_fault(r, r->held);
}

int remote_set(struct remote *const r, const char *const name, const double value)
{
    unsigned index;
    const struct remote_field *const field = find_field(r->kind, name, &index);
    if (!field || !to_host(field) || field->modes == 0)
        return HM2_ERR_NOTFOUND;
    const double raw = is_number(field) ? round(value / (double)field->max * most_of(field)) : value;
    const double least = field->type == REMOTE_SIGNED ? -most_of(field) : 0;
    const bool counts = field->type == REMOTE_ENCODER; /* go round */
    if (!isfinite(raw) || (!counts && (raw < least || raw > most_of(field))) || fabs(raw) > 1e15)
        return HM2_ERR_RANGE;
    r->world[index] = (uint64_t)(int64_t)raw & mask_of(field->bits);
    sample(r);
    if (r->kind->field_power && strcasecmp(field->name, "FieldVoltage") == 0)
        watch_field_power(r, value);
    return 0;
}

static double scaled(const struct remote_field *const field, const uint64_t raw)
{
    if (field->type == REMOTE_SIGNED) {
        const uint64_t sign = 1ULL << (field->bits - 1);
        const double number = (double)((int64_t)(raw ^ sign) - (int64_t)sign);
        return fmax(number, -most_of(field)) / most_of(field) * (double)field->max;
    }
    return is_number(field) ? (double)raw / most_of(field) * (double)field->max : (double)raw;
}

int remote_get(struct remote *const r, const char *const name, double *const value)
{
    unsigned index;
    const struct remote_field *const field = find_field(r->kind, name, &index);
    if (!field || field->modes == 0)
        return HM2_ERR_NOTFOUND;
    sample(r);
    const uint64_t raw = from_host(field) ? applied(r, field) : get(r->memory, field->address, bytes_of(field->bits));
    *value = scaled(field, raw);
    return 0;
}

static bool enabled(const struct remote *const r, const struct remote_field *const output)
{
    unsigned index;
    for (unsigned i = 0; i < r->kind->enable_count; i++)
        if (strcmp(r->kind->enables[i].output, output->name) == 0)
            return applied(r, find_field(r->kind, r->kind->enables[i].enable, &index)) != 0;
    return true;
}

int remote_speed(const struct remote *const r, const char *const output, double *const speed)
{
    unsigned index;
    const struct remote_field *const field = find_field(r->kind, output, &index);
    if (!field || !is_number(field) || !from_host(field) || field->modes == 0)
        return HM2_ERR_NOTFOUND;
    *speed = enabled(r, field) ? scaled(field, applied(r, field)) / (double)field->max : 0;
    return 0;
}

enum sim_level remote_terminal(struct remote *const r, const unsigned output)
{
    unsigned bits;
    const struct remote_field *const field = field_outputs(r->kind, &bits);
    if (!field || output >= bits || !(applied(r, field) >> output & 1u))
        return SIM_FLOAT;
    return r->kind->sinking ? SIM_LOW : SIM_HIGH;
}

void remote_short(struct remote *const r, const uint32_t outputs)
{
    r->shorted = outputs;
    look_for_shorts(r);
}

void remote_hold_faults(struct remote *const r, const uint8_t faults)
{
    const uint8_t power = REMOTE_FAULT_UNDER_VOLTAGE | REMOTE_FAULT_OVER_VOLTAGE;
    r->held = (uint8_t)((r->held & power) | (faults & ~power));
    add_fault(r, r->held);
}
