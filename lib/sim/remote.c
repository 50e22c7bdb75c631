/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A remote as its processor runs: life, commands, process data, watchdog. */
#include <stdlib.h>
#include <string.h>

#include "remote_state.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

#define DEFAULT_BAUD     9u /* 2.5 Mbaud (seed 003, "OPERATE MODE BAUD RATE") */
#define SETUP_BAUD       115200u
#define DEFAULT_WATCHDOG 50u
#define ERASED           0xFFu
#define SOFTWARE_REV     14u /* as a listing of a real 7I76 has them (reference: flash tool, 1.4.5) */
#define HARDWARE_REV     1u
#define FIELD_V          24.0
#define NS_PER_MS        1000000
#define SERIAL_BITS      24

static const struct remote_kind *const kinds[] = {
    &remote_7i77_field, &remote_7i77d_field, &remote_7i77_analog, &remote_7i76, &remote_7i84, &remote_7i84d,
    &remote_7i90,       &remote_7i69,        &remote_7i70,        &remote_7i71, &remote_7i72, &remote_7i73};

static const char *const names[] = {"7i77-field", "7i77d-field", "7i77-analog", "7i76", "7i84", "7i84d", "7i90",
                                    "7i69",       "7i70",        "7i71",        "7i72", "7i73", NULL};

const char *const *remote_names(void)
{
    return names;
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
    memset(r->flash.bytes, ERASED, sizeof r->flash.bytes);
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
    remote_put_tables(r);
    r->baud = r->nv[REMOTE_AT_NV_BAUD - REMOTE_AT_NV];
    remote_store(r->memory, REMOTE_AT_UNIT_NUMBER, get_nv(r, REMOTE_AT_NV_UNIT_NUMBER, 4), 4);
    remote_store(r->memory, REMOTE_AT_WATCHDOG, get_nv(r, REMOTE_AT_NV_WATCHDOG, 2), 2);
    r->memory[REMOTE_AT_SOFTWARE] = SOFTWARE_REV;
    r->memory[REMOTE_AT_HARDWARE] = HARDWARE_REV;
    r->memory[REMOTE_AT_FAULT] = REMOTE_FAULT_WATCHDOG | r->held;
    r->nv_memory = REMOTE_WORKING;
    r->mode = 0;
    r->tripped = 0;
    r->fed_ns = now_ns;
    remote_sample(r);
}

/* ---- what LBP commands ask ----------------------------------------------------------------------------------------
 */

static bool in_mode(const struct remote *const r, const struct remote_field *const field)
{
    return field->modes >> r->mode & 1u;
}

const char *remote_card_name(const struct remote *const r)
{
    return r->kind->card;
}

uint32_t remote_unit_number(const struct remote *const r)
{
    return (uint32_t)remote_load(r->memory, REMOTE_AT_UNIT_NUMBER, 4);
}

uint32_t remote_baud(const struct remote *const r)
{
    static const uint32_t rates[] = {9600,   19200,  38400,   57600,   115200,  230400,
                                     460800, 921600, 1250000, 2500000, 5000000, 10000000};
    return r->setup ? SETUP_BAUD : rates[r->baud < COUNT(rates) ? r->baud : DEFAULT_BAUD];
}

uint8_t remote_faults(const struct remote *const r)
{
    return r->memory[REMOTE_AT_FAULT];
}

void remote_add_fault(struct remote *const r, const uint8_t fault)
{
    r->memory[REMOTE_AT_FAULT] |= fault;
}

void remote_set_mode(struct remote *const r, const uint8_t mode)
{
    if (mode < r->kind->mode_count)
        r->mode = mode;
    else
        remote_add_fault(r, REMOTE_FAULT_ILLEGAL_MODE);
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
    return remote_bytes_of(bits);
}

unsigned remote_in_bytes(const struct remote *const r)
{
    return process_bytes(r, remote_to_host);
}

unsigned remote_out_bytes(const struct remote *const r)
{
    return process_bytes(r, remote_from_host);
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

void remote_set_jumper(struct remote *const r, const bool setup)
{
    r->setup = setup;
}

/* ---- inputs and outputs -------------------------------------------------------------------------------------------
 */

uint8_t remote_read(struct remote *const r, const uint16_t address)
{
    if (r->nv_memory == REMOTE_FLASH)
        return remote_flash_read(&r->flash, address);
    if (r->nv_memory) {
        const bool inside = address >= REMOTE_AT_NV && address < REMOTE_AT_NV + REMOTE_NV_BYTES;
        return inside ? r->nv[address - REMOTE_AT_NV] : 0;
    }
    return address < REMOTE_MEMORY ? r->memory[address] : 0;
}

bool remote_write(struct remote *const r, const uint16_t address, const uint8_t value)
{
    if (r->nv_memory == REMOTE_FLASH)
        return remote_flash_write(&r->flash, address, value);
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
    remote_look_for_shorts(r);
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
    remote_sample(r);
    memset(in, 0, remote_in_bytes(r));
    for (unsigned i = 0; i < r->kind->field_count; i++) {
        const struct remote_field *const field = &r->kind->fields[i];
        if (!in_mode(r, field) || !remote_to_host(field))
            continue;
        give_bits(in, at, field->bits, remote_load(r->memory, field->address, remote_bytes_of(field->bits)));
        at += field->bits;
    }
}

static void take_outputs(struct remote *const r, const uint8_t *const out)
{
    unsigned at = 0;
    for (unsigned i = 0; i < r->kind->field_count; i++) {
        const struct remote_field *const field = &r->kind->fields[i];
        if (!in_mode(r, field) || !remote_from_host(field))
            continue;
        remote_store(r->memory, field->address, take_bits(out, at, field->bits), remote_bytes_of(field->bits));
        at += field->bits;
    }
    remote_look_for_shorts(r);
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
    const int64_t ms = (int64_t)remote_load(r->memory, REMOTE_AT_WATCHDOG, 2);
    const bool bitten = remote_faults(r) & REMOTE_FAULT_WATCHDOG;
    return ms == 0 || bitten ? INT64_MAX : r->fed_ns + ms * NS_PER_MS;
}

void remote_advance(struct remote *const r, const int64_t now_ns)
{
    if (remote_bite_ns(r) <= now_ns)
        remote_add_fault(r, REMOTE_FAULT_WATCHDOG);
}

void remote_feed(struct remote *const r, const int64_t now_ns)
{
    r->fed_ns = now_ns;
}
