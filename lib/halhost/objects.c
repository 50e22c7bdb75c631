/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Pins, parameters and their aliases. */
#include "state.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static size_t size_of(const hal_type_t type)
{
    return type == HAL_BIT ? sizeof(bool) : type == HAL_FLOAT ? sizeof(double) : sizeof(int32_t);
}

static bool known_type(const hal_type_t type)
{
    return type == HAL_BIT || type == HAL_FLOAT || type == HAL_S32 || type == HAL_U32;
}

/* What pins and parameters check alike. The component, or NULL with the reason in diag. */
static struct hh_comp *check_new(const struct hh *const host, const struct hh_table *const table,
                                 const char *const what, const char *const name, const hal_type_t type,
                                 const int comp_id, struct hm2_diag *const diag)
{
    if (hh_check_name(what, name, diag))
        return NULL;
    if (!known_type(type))
        hm2_diag_add(diag, HM2_ERR_INVALID, "%s '%s': type %d is not bit, float, s32 or u32", what, name, (int)type);
    else if (hh_table_find(table, name))
        hm2_diag_add(diag, HM2_ERR_INVALID, "there is already a %s or alias '%s'", what, name);
    else
        return hh_comp_open(host, comp_id, name, diag);
    return NULL;
}

int hh_pin_new(struct hh *const host, const char *const name, const hal_type_t type, const hal_pin_dir_t dir,
               void **const slot, const int comp_id, struct hm2_diag *const diag)
{
    struct hh_comp *const comp = check_new(host, &host->pins, "pin", name, type, comp_id, diag);
    if (!comp)
        return HM2_ERR_INVALID;
    if (dir != HAL_IN && dir != HAL_OUT && dir != HAL_IO)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "pin '%s': direction %d is not IN, OUT or IO", name, (int)dir);
    if (!hh_in_memory(host, slot, sizeof *slot) || (uintptr_t)slot % sizeof *slot)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "pin '%s': its pointer is not in memory from hal_malloc", name);
    struct hh_pin *const pin = calloc(1, sizeof *pin);
    void *const own = pin ? hh_cell_new(host) : NULL;
    if (!own) {
        free(pin);
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no HAL memory left for pin '%s'", name);
    }
    memcpy(pin->names.name, name, strlen(name) + 1);
    pin->comp = comp;
    pin->type = type;
    pin->dir = dir;
    pin->slot = slot;
    pin->own = own;
    if (hh_table_add(&host->pins, pin)) {
        hh_cell_free(host, own);
        free(pin);
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for pin '%s'", name);
    }
    hh_point(slot, own);
    return 0;
}

int hh_param_new(struct hh *const host, const char *const name, const hal_type_t type, const hal_param_dir_t dir,
                 volatile void *const address, const int comp_id, struct hm2_diag *const diag)
{
    struct hh_comp *const comp = check_new(host, &host->params, "parameter", name, type, comp_id, diag);
    if (!comp)
        return HM2_ERR_INVALID;
    if (dir != HAL_RO && dir != HAL_RW)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "parameter '%s': direction %d is not RO or RW", name, (int)dir);
    const size_t size = size_of(type);
    if (!hh_in_memory(host, address, size) || (uintptr_t)address % size)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "parameter '%s': its value is not in memory from hal_malloc", name);
    struct hh_param *const param = calloc(1, sizeof *param);
    if (!param)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for parameter '%s'", name);
    memcpy(param->names.name, name, strlen(name) + 1);
    param->comp = comp;
    param->type = type;
    param->dir = dir;
    param->value = (char *)host->memory + ((uintptr_t)address - (uintptr_t)host->memory);
    if (hh_table_add(&host->params, param)) {
        free(param);
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for parameter '%s'", name);
    }
    return 0;
}

const volatile void *hh_pin_value(const struct hh_pin *const pin)
{
    return pin->signal ? pin->signal->value : pin->own;
}

int hh_alias(struct hh *const host, struct hh_table *const table, const char *const what, const char *const name,
             const char *const alias, struct hm2_diag *const diag)
{
    if (host->lock & HAL_LOCK_CONFIG)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no aliases now");
    if (alias) {
        const int err = hh_check_name("alias", alias, diag);
        if (err)
            return err;
        if (hh_table_find(table, alias))
            return hm2_diag_add(diag, HM2_ERR_INVALID, "there is already a %s or alias '%s'", what, alias);
    }
    struct hh_named *const named = hh_table_find(table, name);
    if (!named)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no %s '%s'", what, name);
    if (hh_table_alias(table, named, alias))
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for alias '%s'", alias);
    return 0;
}

void hh_objects_remove(struct hh *const host, const struct hh_comp *const comp)
{
    for (size_t i = host->pins.shown.count; i-- > 0;) {
        struct hh_pin *const pin = host->pins.shown.items[i];
        if (pin->comp != comp)
            continue;
        hh_pin_unlink(pin);
        hh_table_remove(&host->pins, pin);
        hh_cell_free(host, pin->own);
        free(pin);
    }
    for (size_t i = host->params.shown.count; i-- > 0;) {
        struct hh_param *const param = host->params.shown.items[i];
        if (param->comp == comp) {
            hh_table_remove(&host->params, param);
            free(param);
        }
    }
}

/* ---- the calls of components ------------------------------------------------------------------------------------ */

int hal_pin_new(const char *const name, const hal_type_t type, const hal_pin_dir_t dir, void **const pointer,
                const int comp_id)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_pin_new", &status);
    return host ? hh_report(hh_pin_new(host, name, type, dir, pointer, comp_id, &diag), &diag) : status;
}

static int param_new(const char *const name, const hal_type_t type, const hal_param_dir_t dir,
                     volatile void *const address, const int comp_id)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_param_new", &status);
    return host ? hh_report(hh_param_new(host, name, type, dir, address, comp_id, &diag), &diag) : status;
}

int hal_param_new(const char *const name, const hal_type_t type, const hal_param_dir_t dir, void *const address,
                  const int comp_id)
{
    return param_new(name, type, dir, address, comp_id);
}

/* A name that was cut fails the check of its length. */
static void format_name(char text[const HH_NAME_SIZE + 1], const char *const format, va_list args)
    __attribute__((format(printf, 2, 0)));
static void format_name(char text[const HH_NAME_SIZE + 1], const char *const format, va_list args)
{
    if (vsnprintf(text, HH_NAME_SIZE + 1, format, args) < 0)
        text[0] = '\0';
}

/* The typed calls differ in the type only. */
/* NOLINTBEGIN(bugprone-macro-parentheses): c_type is a type. */
#define TYPED_CALLS(suffix, c_type, hal_type)                                                              \
    int hal_pin_##suffix##_new(const char *const name, const hal_pin_dir_t dir, c_type **const pointer,    \
                               const int comp_id)                                                          \
    {                                                                                                      \
        return hal_pin_new(name, hal_type, dir, HH_SLOT(pointer), comp_id);                                \
    }                                                                                                      \
    int hal_pin_##suffix##_newf(const hal_pin_dir_t dir, c_type **const pointer, const int comp_id,        \
                                const char *const format, ...)                                             \
    {                                                                                                      \
        char name[HH_NAME_SIZE + 1];                                                                       \
        va_list args;                                                                                      \
        va_start(args, format);                                                                            \
        format_name(name, format, args);                                                                   \
        va_end(args);                                                                                      \
        return hal_pin_new(name, hal_type, dir, HH_SLOT(pointer), comp_id);                                \
    }                                                                                                      \
    int hal_param_##suffix##_new(const char *const name, const hal_param_dir_t dir, c_type *const address, \
                                 const int comp_id)                                                        \
    {                                                                                                      \
        return param_new(name, hal_type, dir, address, comp_id);                                           \
    }                                                                                                      \
    int hal_param_##suffix##_newf(const hal_param_dir_t dir, c_type *const address, const int comp_id,     \
                                  const char *const format, ...)                                           \
    {                                                                                                      \
        char name[HH_NAME_SIZE + 1];                                                                       \
        va_list args;                                                                                      \
        va_start(args, format);                                                                            \
        format_name(name, format, args);                                                                   \
        va_end(args);                                                                                      \
        return param_new(name, hal_type, dir, address, comp_id);                                           \
    }

TYPED_CALLS(bit, hal_bit_t, HAL_BIT)
TYPED_CALLS(float, hal_float_t, HAL_FLOAT)
TYPED_CALLS(u32, hal_u32_t, HAL_U32)
TYPED_CALLS(s32, hal_s32_t, HAL_S32)
/* NOLINTEND(bugprone-macro-parentheses) */

int hal_pin_alias(const char *const name, const char *const alias)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_pin_alias", &status);
    return host ? hh_report(hh_alias(host, &host->pins, "pin", name, alias, &diag), &diag) : status;
}

int hal_param_alias(const char *const name, const char *const alias)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_param_alias", &status);
    return host ? hh_report(hh_alias(host, &host->params, "parameter", name, alias, &diag), &diag) : status;
}

static int param_set(const char *const name, const struct hh_value value)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_param_set", &status);
    if (!host)
        return status;
    const struct hh_param *const param = hh_table_find(&host->params, name);
    int err = 0;
    if (!param)
        err = hm2_diag_add(&diag, HM2_ERR_INVALID, "there is no parameter '%s'", name);
    else if (param->type != value.type)
        err = hm2_diag_add(&diag, HM2_ERR_INVALID, "parameter '%s' is of type %s, not %s", name,
                           hh_type_name(param->type), hh_type_name(value.type));
    else if (param->dir == HAL_RO || host->lock & HAL_LOCK_PARAMS)
        err = hm2_diag_add(&diag, HM2_ERR_STATE, "parameter '%s' is not writable", name);
    else
        hh_store(param->value, value);
    return hh_report(err, &diag);
}

int hal_param_bit_set(const char *const name, const int value)
{
    return param_set(name, (struct hh_value){.type = HAL_BIT, .b = value != 0});
}

int hal_param_float_set(const char *const name, const double value)
{
    return param_set(name, (struct hh_value){.type = HAL_FLOAT, .f = value});
}

int hal_param_u32_set(const char *const name, const unsigned long value)
{
    return param_set(name, (struct hh_value){.type = HAL_U32, .u = (uint32_t)value});
}

int hal_param_s32_set(const char *const name, const signed long value)
{
    return param_set(name, (struct hh_value){.type = HAL_S32, .s = (int32_t)value});
}

int hal_param_set(const char *const name, const hal_type_t type, void *const value)
{
    return known_type(type) && value ? param_set(name, hh_load(type, value)) : -EINVAL;
}

/* These three return -1 for an unknown name, as in LinuxCNC. */
static hal_data_u *data_at(const volatile void *const value)
{
    struct hh *const host = hh_host();
    return (hal_data_u *)(void *)(host->memory + ((uintptr_t)value - (uintptr_t)host->memory));
}

int hal_get_pin_value_by_name(const char *const name, hal_type_t *const type, hal_data_u **const data,
                              bool *const connected)
{
    const struct hh *const host = hh_host();
    const struct hh_pin *const pin = host ? hh_table_find(&host->pins, name) : NULL;
    if (!pin)
        return -1;
    *type = pin->type;
    *data = data_at(hh_pin_value(pin));
    if (connected)
        *connected = pin->signal != NULL;
    return 0;
}

int hal_get_signal_value_by_name(const char *const name, hal_type_t *const type, hal_data_u **const data,
                                 bool *const has_writers)
{
    const struct hh *const host = hh_host();
    const struct hh_signal *const signal = host ? hh_table_find(&host->signals, name) : NULL;
    if (!signal)
        return -1;
    *type = signal->type;
    *data = data_at(signal->value);
    if (has_writers)
        *has_writers = signal->writers > 0;
    return 0;
}

int hal_get_param_value_by_name(const char *const name, hal_type_t *const type, hal_data_u **const data)
{
    const struct hh *const host = hh_host();
    const struct hh_param *const param = host ? hh_table_find(&host->params, name) : NULL;
    if (!param)
        return -1;
    *type = param->type;
    *data = data_at(param->value);
    return 0;
}
