/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A component made of library points, for tests of the binder and of hosts: one point of every type and direction, a
 * function that moves values from inputs to outputs, and parameters of every kind.
 */
#include <string.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>
#include <rtapi_string.h>

#include "common/hal_binder.h"

MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("one HAL object of every type and direction");

static int instances = 1;
RTAPI_MP_INT(instances, "number of sets of objects");
static long delay_ns = 0;
RTAPI_MP_LONG(delay_ns, "time that the function wastes in every cycle");
static char *prefix = NULL;
RTAPI_MP_STRING(prefix, "beginning of all names");
#define LABELS 3
static char *labels[LABELS] = {NULL};
RTAPI_MP_ARRAY_STRING(labels, LABELS, "texts, printed at load");
static int numbers[LABELS] = {0};
RTAPI_MP_ARRAY_INT(numbers, LABELS, "numbers, printed at load");
static int fail_at = 0;
RTAPI_MP_INT(fail_at, "fail: 1 = before any object, 2 = after all objects, 3 = never become ready");
static int print_every = 0;
RTAPI_MP_INT(print_every, "print a message in every n-th cycle");

struct set {
    hm2_bit_t *bit_in, *bit_out, *bit_io, *bit_rw, *bit_ro;
    hm2_s32_t *s32_in, *s32_out, *s32_rw, *cycles;
    hm2_u32_t *u32_in, *u32_out, *u32_rw;
    hm2_float_t *float_in, *float_out, *float_rw;
};

#define ROW(field, name, type, dir, initial) HM2_POINT(struct set, field, name, type, dir, initial, "", "test")

static const struct hm2_point points[] = {
    ROW(bit_in, "bit-in", HM2_BIT, HM2_PIN_IN, 0),           ROW(bit_out, "bit-out", HM2_BIT, HM2_PIN_OUT, 0),
    ROW(bit_io, "bit-io", HM2_BIT, HM2_PIN_IO, 1),           ROW(bit_rw, "bit-rw", HM2_BIT, HM2_PARAM_RW, 1),
    ROW(bit_ro, "bit-ro", HM2_BIT, HM2_PARAM_RO, 0),         ROW(s32_in, "s32-in", HM2_S32, HM2_PIN_IN, -5),
    ROW(s32_out, "s32-out", HM2_S32, HM2_PIN_OUT, 0),        ROW(s32_rw, "s32-rw", HM2_S32, HM2_PARAM_RW, -7),
    ROW(cycles, "cycles", HM2_S32, HM2_PIN_OUT, 0),          ROW(u32_in, "u32-in", HM2_U32, HM2_PIN_IN, 3000000000.0),
    ROW(u32_out, "u32-out", HM2_U32, HM2_PIN_OUT, 0),        ROW(u32_rw, "u32-rw", HM2_U32, HM2_PARAM_RW, 8),
    ROW(float_in, "float-in", HM2_FLOAT, HM2_PIN_IN, 0.5),   ROW(float_out, "float-out", HM2_FLOAT, HM2_PIN_OUT, 0),
    ROW(float_rw, "float-rw", HM2_FLOAT, HM2_PARAM_RW, 2.0),
};

static int comp_id;

static void update(void *const arg, const long period_ns)
{
    struct set *const set = arg;
    (void)period_ns;
    *set->bit_out = *set->bit_in;
    *set->bit_ro = rtapi_task_self() >= 0;
    *set->s32_out = *set->s32_in;
    *set->u32_out = *set->u32_in;
    *set->float_out = *set->float_in * *set->float_rw;
    *set->cycles += 1;
    const long long end_ns = rtapi_get_time() + delay_ns;
    while (rtapi_get_time() < end_ns) {
    }
    if (print_every > 0 && *set->cycles % print_every == 0)
        rtapi_print_msg(RTAPI_MSG_ERR, "points_test: cycle %d\n", *set->cycles);
}

static int create_set(struct hal_binder *const hal, const unsigned index)
{
    char name[HAL_NAME_LEN + 1];
    struct hm2_diag diag;
    memset(&diag, 0, sizeof diag);
    struct set *const set = hal->binder.alloc(&hal->binder, sizeof *set);
    if (!set)
        return -ENOMEM;
    rtapi_snprintf(name, sizeof name, "%s.%u", prefix ? prefix : "points", index);
    if (hm2_bind_points(&hal->binder, points, sizeof points / sizeof points[0], set, name, index, &diag)) {
        rtapi_print_msg(RTAPI_MSG_ERR, "points_test: %s", diag.text);
        return -EINVAL;
    }
    char existing[HAL_NAME_LEN + 1], alias[HAL_NAME_LEN + 1];
    rtapi_snprintf(existing, sizeof existing, "%s.float-rw", name);
    rtapi_snprintf(alias, sizeof alias, "%s.gain", name);
    if (hal->binder.alias(&hal->binder, existing, alias))
        return -EINVAL;
    rtapi_snprintf(name, sizeof name, "%s.%u.update", prefix ? prefix : "points", index);
    return hal_export_funct(name, update, set, 1, 0, comp_id);
}

static int setup(void)
{
    struct hal_binder hal;
    hal_binder_init(&hal, comp_id);
    for (int i = 0; i < LABELS; i++) {
        if (labels[i])
            rtapi_print("points_test: label %d is '%s', number %d\n", i, labels[i], numbers[i]);
    }
    int status = fail_at == 1 ? -EIO : 0;
    for (int i = 0; i < instances && status == 0; i++)
        status = create_set(&hal, (unsigned)i);
    if (status == 0 && fail_at == 2)
        status = -EIO;
    return status || fail_at == 3 ? status : hal_ready(comp_id);
}

int rtapi_app_main(void)
{
    comp_id = hal_init("hm2_points_test");
    if (comp_id < 0)
        return comp_id;
    const int status = setup();
    if (status < 0)
        hal_exit(comp_id);
    return status;
}

void rtapi_app_exit(void)
{
    rtapi_print("points_test: exit\n");
    hal_exit(comp_id);
}
