/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * scurve: jerk-limited moves from a target pin, for hosts that have no motion planner.
 *
 *     loadrt scurve count=3
 *
 * A new target is taken when the axis is at rest; a target that changes during a move is served after it. A target or
 * limit that allows no move (not a number, a limit of 0) leaves the axis where it is.
 */
#include <errno.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include <hm2/points.h>
#include <hm2/scurve.h>

#include "common/component.h"
#include "common/hal_binder.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("jerk-limited moves to a target");
MODULE_LICENSE("GPL");

#define MAX_AXES 16

static int count = 1;
RTAPI_MP_INT(count, "number of axes, 1..16");

struct axis {
    hm2_float_t *target, *position_out, *velocity, *maxvel, *maxaccel, *maxjerk;
    hm2_bit_t *enable, *moving, *refused;
    struct hm2_scurve move;
    /* What the pins show is not read back: a pin that is linked takes the value of its signal. */
    bool moves;
    double position;
    double start, goal;
    double elapsed_s;
};

static const struct hm2_point points[] = {
    HM2_POINT(struct axis, target, "target", HM2_FLOAT, HM2_PIN_IN, 0, "units", "where to go"),
    HM2_POINT(struct axis, enable, "enable", HM2_BIT, HM2_PIN_IN, 0, "", "new moves start only while 1"),
    HM2_POINT(struct axis, position_out, "position", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "commanded position"),
    HM2_POINT(struct axis, velocity, "velocity", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s", "commanded velocity"),
    HM2_POINT(struct axis, moving, "moving", HM2_BIT, HM2_PIN_OUT, 0, "", "a move is under way"),
    HM2_POINT(struct axis, refused, "refused", HM2_BIT, HM2_PIN_OUT, 0, "",
              "target or limits are not finite, or a limit is not above 0: the axis stays"),
    HM2_POINT(struct axis, maxvel, "maxvel", HM2_FLOAT, HM2_PARAM_RW, 10, "units/s", "velocity limit"),
    HM2_POINT(struct axis, maxaccel, "maxaccel", HM2_FLOAT, HM2_PARAM_RW, 100, "units/s^2", "acceleration limit"),
    HM2_POINT(struct axis, maxjerk, "maxjerk", HM2_FLOAT, HM2_PARAM_RW, 1000, "units/s^3", "jerk limit"),
};

static struct axis *axes;
static int component_id;

static void begin_move(struct axis *const axis)
{
    const double goal = *axis->target;
    const double distance = goal - axis->position;
    *axis->refused = false;
    if (!*axis->enable || distance == 0.0)
        return;
    if (hm2_scurve_plan(&axis->move, distance, *axis->maxvel, *axis->maxaccel, *axis->maxjerk) != HM2_OK) {
        *axis->refused = true;
        return;
    }
    axis->start = axis->position;
    axis->goal = goal;
    axis->elapsed_s = 0.0;
    axis->moves = true;
}

static void advance(struct axis *const axis, const double period_s)
{
    double position, velocity;
    axis->elapsed_s += period_s;
    hm2_scurve_at(&axis->move, axis->elapsed_s, &position, &velocity);
    *axis->velocity = velocity;
    axis->moves = axis->elapsed_s < axis->move.total_s;
    /* The sum may be off by its rounding, which would be a move of its own. */
    axis->position = axis->moves ? axis->start + position : axis->goal;
}

static void update(void *const unused, const long period)
{
    (void)unused;
    for (int i = 0; i < count; i++) {
        struct axis *const axis = &axes[i];
        if (!axis->moves)
            begin_move(axis);
        if (axis->moves)
            advance(axis, (double)period * 1e-9);
        *axis->position_out = axis->position;
        *axis->moving = axis->moves;
    }
}

static int create(void)
{
    struct hal_binder hal;
    struct hm2_diag diag = {0};

    hal_binder_init(&hal, component_id);
    axes = hal.binder.alloc(&hal.binder, (size_t)count * sizeof *axes);
    if (!axes)
        return -ENOMEM;
    for (int i = 0; i < count; i++) {
        char prefix[HM2_NAME_SIZE];
        rtapi_snprintf(prefix, sizeof prefix, "scurve.%d", i);
        if (hm2_bind_points(&hal.binder, points, sizeof points / sizeof points[0], &axes[i], prefix, 0, &diag) < 0) {
            rtapi_print_msg(RTAPI_MSG_ERR, "scurve: %s", diag.text);
            return -EINVAL;
        }
    }
    return hal_export_funct("scurve.update", update, NULL, 1, 0, component_id);
}

void rtapi_app_exit(void)
{
    hal_exit(component_id);
}

int rtapi_app_main(void)
{
    if (count < 1 || count > MAX_AXES) {
        rtapi_print_msg(RTAPI_MSG_ERR, "scurve: count=%d: give 1 to %d axes\n", count, MAX_AXES);
        return -EINVAL;
    }
    return component_load("scurve", &component_id, create, rtapi_app_exit);
}
