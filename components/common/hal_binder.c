/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "common/hal_binder.h"

#include <errno.h>
#include <limits.h>
#include <string.h>

#include <hal.h>
#include <rtapi.h>

/* Values are written through the library's types: they must be HAL's (hm2/points.h). */
_Static_assert(sizeof(hm2_bit_t) == sizeof(hal_bit_t), "bit");
_Static_assert(sizeof(hm2_s32_t) == sizeof(hal_s32_t), "s32");
_Static_assert(sizeof(hm2_u32_t) == sizeof(hal_u32_t), "u32");
_Static_assert(sizeof(hm2_float_t) == sizeof(hal_float_t), "float");

static void *binder_alloc(struct hm2_binder *const binder, const size_t size)
{
    (void)binder;
    if (size == 0 || size > LONG_MAX)
        return NULL;
    void *const memory = hal_malloc((long)size);
    if (memory)
        memset(memory, 0, size);
    return memory;
}

static int create_pin(const char *const name, const enum hm2_point_type type, const hal_pin_dir_t dir, void *const slot,
                      const int comp_id)
{
    switch (type) {
    case HM2_BIT:
        return hal_pin_bit_new(name, dir, slot, comp_id);
    case HM2_S32:
        return hal_pin_s32_new(name, dir, slot, comp_id);
    case HM2_U32:
        return hal_pin_u32_new(name, dir, slot, comp_id);
    case HM2_FLOAT:
        return hal_pin_float_new(name, dir, slot, comp_id);
    }
    return -EINVAL;
}

static int create_param_at(const char *const name, const enum hm2_point_type type, const hal_param_dir_t dir,
                           void *const value, const int comp_id)
{
    switch (type) {
    case HM2_BIT:
        return hal_param_bit_new(name, dir, value, comp_id);
    case HM2_S32:
        return hal_param_s32_new(name, dir, value, comp_id);
    case HM2_U32:
        return hal_param_u32_new(name, dir, value, comp_id);
    case HM2_FLOAT:
        return hal_param_float_new(name, dir, value, comp_id);
    }
    return -EINVAL;
}

/* HAL wants a parameter's storage from its caller; the library wants a pointer to it in the slot. */
static int create_param(struct hm2_binder *const binder, const char *const name, const enum hm2_point_type type,
                        const hal_param_dir_t dir, void *const slot, const int comp_id)
{
    void *const value = binder_alloc(binder, sizeof(double));
    if (!value)
        return -ENOMEM;
    memcpy(slot, &value, sizeof value);
    return create_param_at(name, type, dir, value, comp_id);
}

static int binder_create(struct hm2_binder *const binder, const char *const full_name,
                         const struct hm2_point *const point, void *const slot, struct hm2_diag *const diag)
{
    const int comp_id = ((const struct hal_binder *)binder)->comp_id;
    if (strlen(full_name) > HAL_NAME_LEN)
        return hm2_diag_add(diag, HM2_ERR_HOST, "the name '%s' has %zu characters, HAL allows %d", full_name,
                            strlen(full_name), HAL_NAME_LEN);
    int status = -EINVAL;
    switch (point->dir) {
    case HM2_PIN_IN:
        status = create_pin(full_name, point->type, HAL_IN, slot, comp_id);
        break;
    case HM2_PIN_OUT:
        status = create_pin(full_name, point->type, HAL_OUT, slot, comp_id);
        break;
    case HM2_PIN_IO:
        status = create_pin(full_name, point->type, HAL_IO, slot, comp_id);
        break;
    case HM2_PARAM_RO:
        status = create_param(binder, full_name, point->type, HAL_RO, slot, comp_id);
        break;
    case HM2_PARAM_RW:
        status = create_param(binder, full_name, point->type, HAL_RW, slot, comp_id);
        break;
    }
    return status ? hm2_diag_add(diag, HM2_ERR_HOST, "HAL refused '%s' with error %d (%s)", full_name, status,
                                 strerror(status < 0 ? -status : status))
                  : 0;
}

static int binder_alias(struct hm2_binder *const binder, const char *const existing, const char *const alias)
{
    (void)binder;
    return hal_param_alias(existing, alias) ? HM2_ERR_HOST : 0;
}

void hal_binder_init(struct hal_binder *const hal, const int comp_id)
{
    hal->binder.alloc = binder_alloc;
    hal->binder.create = binder_create;
    hal->binder.alias = binder_alias;
    hal->comp_id = comp_id;
}
