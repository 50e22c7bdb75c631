/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Values that components and the host share.
 *
 * HAL's memory model is that of volatile variables of at most 64 bits: a component's function reads and writes pins
 * with plain accesses while another thread, or the program, does the same. Nothing in C makes that defined; every
 * HAL host relies on aligned accesses of this size being indivisible. The host's side of these accesses is gathered
 * here as relaxed atomics. ThreadSanitizer would report the component's plain access as the other half of a race, so
 * these few functions, and no others, are left out of its instrumentation.
 */
#include "state.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define HAL_MEMORY_MODEL __attribute__((no_sanitize("thread"), noinline))

HAL_MEMORY_MODEL static uint64_t load64(const volatile void *const address)
{
    return __atomic_load_n((const volatile uint64_t *)address, __ATOMIC_RELAXED);
}

HAL_MEMORY_MODEL static uint32_t load32(const volatile void *const address)
{
    return __atomic_load_n((const volatile uint32_t *)address, __ATOMIC_RELAXED);
}

HAL_MEMORY_MODEL static uint8_t load8(const volatile void *const address)
{
    return __atomic_load_n((const volatile uint8_t *)address, __ATOMIC_RELAXED);
}

HAL_MEMORY_MODEL static void store64(volatile void *const address, const uint64_t value)
{
    __atomic_store_n((volatile uint64_t *)address, value, __ATOMIC_RELAXED);
}

HAL_MEMORY_MODEL static void store32(volatile void *const address, const uint32_t value)
{
    __atomic_store_n((volatile uint32_t *)address, value, __ATOMIC_RELAXED);
}

HAL_MEMORY_MODEL static void store8(volatile void *const address, const uint8_t value)
{
    __atomic_store_n((volatile uint8_t *)address, value, __ATOMIC_RELAXED);
}

HAL_MEMORY_MODEL void hh_point(void **const slot, void *const target)
{
    __atomic_store_n(slot, target, __ATOMIC_RELEASE);
}

struct hh_value hh_load(const hal_type_t type, const volatile void *const address)
{
    struct hh_value value = {.type = type};
    if (type == HAL_BIT) {
        value.b = load8(address) != 0;
    } else if (type == HAL_FLOAT) {
        const uint64_t bits = load64(address);
        memcpy(&value.f, &bits, sizeof bits);
    } else {
        value.u = load32(address);
    }
    return value;
}

void hh_store(volatile void *const address, const struct hh_value value)
{
    if (value.type == HAL_BIT) {
        store8(address, value.b);
    } else if (value.type == HAL_FLOAT) {
        uint64_t bits;
        memcpy(&bits, &value.f, sizeof bits);
        store64(address, bits);
    } else {
        store32(address, value.u);
    }
}

/* ---- text ------------------------------------------------------------------------------------------------------- */

static const char *const type_names[] = {
    [HAL_BIT] = "bit", [HAL_FLOAT] = "float", [HAL_S32] = "s32", [HAL_U32] = "u32"};

enum { TYPES = sizeof type_names / sizeof type_names[0] };

const char *hh_type_name(const hal_type_t type)
{
    return (int)type > 0 && (int)type < TYPES ? type_names[type] : "?";
}

hal_type_t hh_type_from_name(const char *const name)
{
    for (int type = HAL_BIT; type < TYPES; type++) {
        if (strcasecmp(name, type_names[type]) == 0)
            return (hal_type_t)type;
    }
    return HAL_TYPE_UNSPECIFIED;
}

static int parse_integer(const hal_type_t type, const char *const text, struct hh_value *const value,
                         struct hm2_diag *const diag)
{
    char *end;
    errno = 0;
    const long long number = strtoll(text, &end, 0);
    if (end == text || *end || isspace((unsigned char)text[0]))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "value '%s' invalid for %s", text, hh_type_name(type));
    /* A negative number for a u32 means its two's complement, as with halcmd. */
    const long long high = type == HAL_U32 ? UINT32_MAX : INT32_MAX;
    if (errno || number < INT32_MIN || number > high)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "value '%s' does not fit %s (%" PRId32 " to %lld)", text,
                            hh_type_name(type), type == HAL_U32 ? 0 : INT32_MIN, high);
    value->u = (uint32_t)number;
    return 0;
}

int hh_parse(const hal_type_t type, const char *const text, struct hh_value *const value, struct hm2_diag *const diag)
{
    *value = (struct hh_value){.type = type};
    if (type == HAL_S32 || type == HAL_U32)
        return parse_integer(type, text, value, diag);
    if (type == HAL_BIT) {
        value->b = strcmp(text, "1") == 0 || strcasecmp(text, "TRUE") == 0;
        if (value->b || strcmp(text, "0") == 0 || strcasecmp(text, "FALSE") == 0)
            return 0;
    } else if (type == HAL_FLOAT) {
        char *end;
        value->f = strtod(text, &end);
        if (end != text && *end == '\0' && !isspace((unsigned char)text[0]))
            return 0;
    }
    return hm2_diag_add(diag, HM2_ERR_INVALID, "value '%s' invalid for %s", text, hh_type_name(type));
}

void hh_format_column(const struct hh_value value, char text[const HH_VALUE_TEXT])
{
    switch ((int)value.type) {
    case HAL_BIT:
        (void)snprintf(text, HH_VALUE_TEXT, "%12s", value.b ? "TRUE" : "FALSE");
        break;
    case HAL_FLOAT:
        (void)snprintf(text, HH_VALUE_TEXT, "%12.7g", value.f);
        break;
    case HAL_S32:
        (void)snprintf(text, HH_VALUE_TEXT, "%12" PRId32, value.s);
        break;
    default:
        (void)snprintf(text, HH_VALUE_TEXT, "  0x%08" PRIX32, value.u);
        break;
    }
}

void hh_format_plain(const struct hh_value value, char text[const HH_VALUE_TEXT])
{
    switch ((int)value.type) {
    case HAL_BIT:
        (void)snprintf(text, HH_VALUE_TEXT, "%s", value.b ? "TRUE" : "FALSE");
        break;
    case HAL_FLOAT:
        (void)snprintf(text, HH_VALUE_TEXT, "%.7g", value.f);
        break;
    case HAL_S32:
        (void)snprintf(text, HH_VALUE_TEXT, "%" PRId32, value.s);
        break;
    default:
        (void)snprintf(text, HH_VALUE_TEXT, "%" PRIu32, value.u);
        break;
    }
}
