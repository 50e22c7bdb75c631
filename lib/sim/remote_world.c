/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the world does to a remote, and what its outputs do to the world. */
#include <math.h>
#include <string.h>
#include <strings.h>

#include "remote_state.h"

#define FIELD_MIN_V 5.0 /* seed 003, "SPECIFICATIONS": field power 5 to 28 V; inputs stand 32 */
#define FIELD_MAX_V 32.0

/* ---- what fields are now -------------------------------------------------------------------------------------------
 */

/* What an output field does, raw. */
uint64_t remote_applied(const struct remote *const r, const struct remote_field *const field)
{
    const uint64_t value =
        remote_load(r->memory, field->address, remote_bytes_of(field->bits)) & remote_mask_of(field->bits);
    if (remote_faults(r))
        return 0;
    return field->address == REMOTE_AT_OUTPUTS && field->type == REMOTE_BITS ? value & ~(uint64_t)r->tripped : value;
}

/* Inputs as they are now. Pins with open drains: inputs and outputs are paired by their order. A field at the address
 * of the one before it is a narrower view of the same input. */
void remote_sample(struct remote *const r)
{
    const struct remote_kind *const kind = r->kind;
    const unsigned pairs = kind->field_count / 2;
    for (unsigned i = 0; i < kind->field_count; i++) {
        const struct remote_field *const field = &kind->fields[i];
        if (field->direction != REMOTE_IN || (i > 0 && field->address == kind->fields[i - 1].address))
            continue;
        const uint64_t driven = kind->loopback ? remote_applied(r, &kind->fields[i + pairs]) : 0;
        remote_store(r->memory, field->address, r->world[i] | driven, remote_bytes_of(field->bits));
    }
}

static const struct remote_field *field_outputs(const struct remote_kind *const kind, unsigned *const bits)
{
    unsigned index;
    const struct remote_field *const field = remote_find_field(kind, "Output", &index);
    *bits = field ? field->bits : 0;
    return field;
}

/* Shorted outputs trip when they come on. */
void remote_look_for_shorts(struct remote *const r)
{
    unsigned bits;
    const struct remote_field *const field = field_outputs(r->kind, &bits);
    if (!field || r->shorted == 0)
        return;
    const uint32_t tripping = (uint32_t)remote_applied(r, field) & r->shorted;
    r->tripped |= tripping;
    if (tripping)
        remote_add_fault(r, REMOTE_FAULT_OVER_CURRENT);
}

/* ---- the world outside --------------------------------------------------------------------------------------------
 */

static double most_of(const struct remote_field *const field)
{
    return field->type == REMOTE_SIGNED ? (double)(remote_mask_of(field->bits) >> 1)
                                        : (double)remote_mask_of(field->bits);
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
    remote_add_fault(r, r->held);
}

int remote_set(struct remote *const r, const char *const name, const double value)
{
    unsigned index;
    const struct remote_field *const field = remote_find_field(r->kind, name, &index);
    if (!field || !remote_to_host(field) || field->modes == 0)
        return HM2_ERR_NOTFOUND;
    const double raw = is_number(field) ? round(value / (double)field->max * most_of(field)) : value;
    const double least = field->type == REMOTE_SIGNED ? -most_of(field) : 0;
    const bool counts = field->type == REMOTE_ENCODER; /* go round */
    if (!isfinite(raw) || (!counts && (raw < least || raw > most_of(field))) || fabs(raw) > 1e15)
        return HM2_ERR_RANGE;
    r->world[index] = (uint64_t)(int64_t)raw & remote_mask_of(field->bits);
    remote_sample(r);
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
    const struct remote_field *const field = remote_find_field(r->kind, name, &index);
    if (!field || field->modes == 0)
        return HM2_ERR_NOTFOUND;
    remote_sample(r);
    const uint64_t raw = remote_from_host(field) ? remote_applied(r, field)
                                                 : remote_load(r->memory, field->address, remote_bytes_of(field->bits));
    *value = scaled(field, raw);
    return 0;
}

static bool enabled(const struct remote *const r, const struct remote_field *const output)
{
    unsigned index;
    for (unsigned i = 0; i < r->kind->enable_count; i++)
        if (strcmp(r->kind->enables[i].output, output->name) == 0)
            return remote_applied(r, remote_find_field(r->kind, r->kind->enables[i].enable, &index)) != 0;
    return true;
}

int remote_speed(const struct remote *const r, const char *const output, double *const speed)
{
    unsigned index;
    const struct remote_field *const field = remote_find_field(r->kind, output, &index);
    if (!field || !is_number(field) || !remote_from_host(field) || field->modes == 0)
        return HM2_ERR_NOTFOUND;
    *speed = enabled(r, field) ? scaled(field, remote_applied(r, field)) / (double)field->max : 0;
    return 0;
}

enum sim_level remote_terminal(struct remote *const r, const unsigned output)
{
    unsigned bits;
    const struct remote_field *const field = field_outputs(r->kind, &bits);
    if (!field || output >= bits || !(remote_applied(r, field) >> output & 1u))
        return SIM_FLOAT;
    return r->kind->sinking ? SIM_LOW : SIM_HIGH;
}

void remote_short(struct remote *const r, const uint32_t outputs)
{
    r->shorted = outputs;
    remote_look_for_shorts(r);
}

void remote_hold_faults(struct remote *const r, const uint8_t faults)
{
    const uint8_t power = REMOTE_FAULT_UNDER_VOLTAGE | REMOTE_FAULT_OVER_VOLTAGE;
    r->held = (uint8_t)((r->held & power) | (faults & ~power));
    remote_add_fault(r, r->held);
}
