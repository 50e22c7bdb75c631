/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * can_cia402: drives of the CANopen profile CiA 402, between the words of their process data and pins for motion.
 *
 *     loadrt can_cia402 count=2
 *
 * It has no bus: can_io brings the words and takes them, as examples/cia402.hal shows. Of all drives together it is
 * also the NMT master that starts them, one command at a time, as they share one message.
 */
#include <errno.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include <hm2/cia402.h>
#include <hm2/nmt.h>
#include <hm2/points.h>

#include "common/component.h"
#include "common/hal_binder.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("state machine of CiA 402 drives");
MODULE_LICENSE("GPL");

#define MAX_DRIVES 16

static int count = 1;
RTAPI_MP_INT(count, "number of drives, 1..16");

struct drive {
    /* NMT */
    hm2_u32_t *node_id, *nmt_state, *heartbeats, *toggle_errors;
    hm2_bit_t *toggle, *node_lost, *guarding, *nmt_start, *online;
    /* from and to the drive */
    hm2_u32_t *statusword, *controlword;
    hm2_s32_t *mode_shown, *mode_sent;
    hm2_float_t *position_actual, *velocity_actual, *position_target, *velocity_target;
    hm2_bit_t *data_lost;
    /* from and to the machine */
    hm2_bit_t *enable, *quick_stop, *fault_reset, *home, *enabled, *fault, *homing, *homed, *home_error;
    hm2_s32_t *mode;
    hm2_u32_t *state;
    hm2_float_t *position_cmd, *velocity_cmd, *position_fb, *velocity_fb;
    struct hm2_nmt nmt;
    struct hm2_cia402 machine;
};

static const struct hm2_point points[] = {
    HM2_POINT(struct drive, node_id, "node-id", HM2_U32, HM2_PARAM_RW, 0, "", "1 to 127; 0 starts nothing"),
    HM2_POINT(struct drive, nmt_start, "nmt-start", HM2_BIT, HM2_PARAM_RW, 1, "", "start the node when it has booted"),
    HM2_POINT(struct drive, guarding, "guarding", HM2_BIT, HM2_PARAM_RW, 0, "",
              "the node is guarded, and its toggle bit checked, instead of sending heartbeats"),
    HM2_POINT(struct drive, nmt_state, "nmt-state", HM2_U32, HM2_PIN_IN, 0, "", "as the newest heartbeat tells it"),
    HM2_POINT(struct drive, toggle, "toggle", HM2_BIT, HM2_PIN_IN, 0, "", "toggle bit of the newest guarding response"),
    HM2_POINT(struct drive, heartbeats, "heartbeats", HM2_U32, HM2_PIN_IN, 0, "", "number of them, or of responses"),
    HM2_POINT(struct drive, node_lost, "node-lost", HM2_BIT, HM2_PIN_IN, 0, "", "no heartbeat in time"),
    HM2_POINT(struct drive, data_lost, "data-lost", HM2_BIT, HM2_PIN_IN, 0, "", "no process data in time"),
    HM2_POINT(struct drive, statusword, "statusword", HM2_U32, HM2_PIN_IN, 0, "", "object 6041h"),
    HM2_POINT(struct drive, mode_shown, "opmode-display", HM2_S32, HM2_PIN_IN, 0, "", "object 6061h"),
    HM2_POINT(struct drive, position_actual, "actual-position", HM2_FLOAT, HM2_PIN_IN, 0, "units", "object 6064h"),
    HM2_POINT(struct drive, velocity_actual, "actual-velocity", HM2_FLOAT, HM2_PIN_IN, 0, "units/s", "object 606Ch"),
    HM2_POINT(struct drive, controlword, "controlword", HM2_U32, HM2_PIN_OUT, 0, "", "object 6040h"),
    HM2_POINT(struct drive, mode_sent, "opmode", HM2_S32, HM2_PIN_OUT, 0, "", "object 6060h"),
    HM2_POINT(struct drive, position_target, "target-position", HM2_FLOAT, HM2_PIN_OUT, 0, "units", "object 607Ah"),
    HM2_POINT(struct drive, velocity_target, "target-velocity", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s", "object 60FFh"),
    HM2_POINT(struct drive, enable, "enable", HM2_BIT, HM2_PIN_IN, 0, "", "a rising edge switches on, 0 off"),
    HM2_POINT(struct drive, quick_stop, "quick-stop", HM2_BIT, HM2_PIN_IN, 0, "", "stop along the drive's own ramp"),
    HM2_POINT(struct drive, fault_reset, "fault-reset", HM2_BIT, HM2_PIN_IN, 0, "", "a rising edge resets a fault"),
    HM2_POINT(struct drive, home, "home", HM2_BIT, HM2_PIN_IN, 0, "",
              "while 1: homing mode, by the drive's own method"),
    HM2_POINT(struct drive, mode, "mode", HM2_S32, HM2_PIN_IN, HM2_CIA402_CYCLIC_POSITION, "",
              "8 cyclic position, 9 cyclic velocity, 3 profile velocity"),
    HM2_POINT(struct drive, position_cmd, "position-cmd", HM2_FLOAT, HM2_PIN_IN, 0, "units", "in mode 8"),
    HM2_POINT(struct drive, velocity_cmd, "velocity-cmd", HM2_FLOAT, HM2_PIN_IN, 0, "units/s", "in modes 9 and 3"),
    HM2_POINT(struct drive, position_fb, "position-fb", HM2_FLOAT, HM2_PIN_OUT, 0, "units",
              "the actual position; the last one while not online"),
    HM2_POINT(struct drive, velocity_fb, "velocity-fb", HM2_FLOAT, HM2_PIN_OUT, 0, "units/s",
              "the actual velocity; 0 while not online"),
    HM2_POINT(struct drive, online, "online", HM2_BIT, HM2_PIN_OUT, 0, "",
              "node and process data come in time, and the node is operational"),
    HM2_POINT(struct drive, enabled, "enabled", HM2_BIT, HM2_PIN_OUT, 0, "", "operation enabled, as asked for"),
    HM2_POINT(struct drive, fault, "fault", HM2_BIT, HM2_PIN_OUT, 0, "",
              "of the drive; or it left what enable asks for, which must fall and rise again"),
    HM2_POINT(struct drive, state, "state", HM2_U32, HM2_PIN_OUT, HM2_CIA402_UNKNOWN, "",
              "0 not ready, 1 switch on disabled, 2 ready to switch on, 3 switched on, 4 operation enabled, 5 quick "
              "stop, 6 fault reaction, 7 fault, 8 not known"),
    HM2_POINT(struct drive, homing, "homing", HM2_BIT, HM2_PIN_OUT, 0, "", "the drive is on its way home"),
    HM2_POINT(struct drive, homed, "homed", HM2_BIT, HM2_PIN_OUT, 0, "", "it got there, and was online since"),
    HM2_POINT(struct drive, home_error, "home-error", HM2_BIT, HM2_PIN_OUT, 0, "", "it says that homing failed"),
    HM2_POINT(struct drive, toggle_errors, "toggle-errors", HM2_U32, HM2_PIN_OUT, 0, "",
              "guarding responses with the toggle bit of the one before"),
};

/* The message of the NMT master. */
struct master {
    hm2_u32_t *command, *node;
    hm2_bit_t *send;
};

static const struct hm2_point master_points[] = {
    HM2_POINT(struct master, command, "nmt-command", HM2_U32, HM2_PIN_OUT, 0, "", "first byte of the message"),
    HM2_POINT(struct master, node, "nmt-node", HM2_U32, HM2_PIN_OUT, 0, "", "second byte"),
    HM2_POINT(struct master, send, "nmt-send", HM2_BIT, HM2_PIN_IO, 0, "",
              "set when it is to be sent, for tx-trigger of the message, which clears it"),
};

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

static struct drive *drives;
static struct master *master;
static int component_id;
static int64_t now_ns;

/* ---- cycle ------------------------------------------------------------------------------------------------------- */

/* Whether the drive's node is operational. */
static bool look_after_node(struct drive *const d)
{
    const struct hm2_nmt_in in = {.lost = *d->node_lost,
                                  .guarding = *d->guarding,
                                  .toggle = *d->toggle,
                                  .state = (uint8_t)(*d->nmt_state & 0x7Fu),
                                  .count = *d->heartbeats};
    const bool operational = hm2_nmt_look(&d->nmt, &in);
    *d->toggle_errors = d->nmt.toggle_errors;
    if (*d->nmt_start && *d->node_id != 0 && !*master->send && hm2_nmt_must_start(&d->nmt, &in, now_ns)) {
        *master->command = HM2_NMT_START;
        *master->node = *d->node_id;
        *master->send = true;
        hm2_nmt_started(&d->nmt, now_ns);
    }
    return operational;
}

static void show(const struct drive *const d, const struct hm2_cia402_out *const out)
{
    *d->controlword = out->controlword;
    *d->mode_sent = out->mode;
    *d->position_target = out->position_target;
    *d->velocity_target = out->velocity_target;
    *d->state = (uint32_t)out->state;
    *d->enabled = out->enabled;
    *d->fault = out->fault;
    *d->homing = out->homing;
    *d->homed = out->homed;
    *d->home_error = out->homing_error;
}

static void update_drive(struct drive *const d)
{
    const bool online = look_after_node(d) && !*d->data_lost;
    const struct hm2_cia402_in in = {.online = online,
                                     .enable = *d->enable,
                                     .quick_stop = *d->quick_stop,
                                     .reset = *d->fault_reset,
                                     .home = *d->home,
                                     .statusword = (uint16_t)*d->statusword,
                                     .mode = *d->mode,
                                     .mode_shown = *d->mode_shown,
                                     .position = *d->position_actual,
                                     .position_command = *d->position_cmd,
                                     .velocity_command = *d->velocity_cmd};
    struct hm2_cia402_out out;
    hm2_cia402_step(&d->machine, &in, now_ns, &out);
    show(d, &out);
    *d->online = online;
    if (online)
        *d->position_fb = *d->position_actual;
    *d->velocity_fb = online ? *d->velocity_actual : 0.0;
}

static void update(void *const unused, const long period)
{
    (void)unused;
    now_ns += period;
    for (int i = 0; i < count; i++)
        update_drive(&drives[i]);
}

/* ---- load -------------------------------------------------------------------------------------------------------- */

static int bind_all(struct hm2_binder *const binder, struct hm2_diag *const diag)
{
    master = binder->alloc(binder, sizeof *master);
    drives = binder->alloc(binder, (size_t)count * sizeof *drives);
    if (!master || !drives)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for %d drives", count);
    int err = hm2_bind_points(binder, master_points, COUNT(master_points), master, "cia402", 0, diag);
    for (int i = 0; !err && i < count; i++) {
        char prefix[HM2_NAME_SIZE];
        rtapi_snprintf(prefix, sizeof prefix, "cia402.%d", i);
        err = hm2_bind_points(binder, points, COUNT(points), &drives[i], prefix, 0, diag);
    }
    return err;
}

static int create(void)
{
    struct hal_binder hal;
    struct hm2_diag diag = {0};

    hal_binder_init(&hal, component_id);
    if (bind_all(&hal.binder, &diag)) {
        rtapi_print_msg(RTAPI_MSG_ERR, "can_cia402: %s", diag.text);
        return -EINVAL;
    }
    return hal_export_funct("cia402.update", update, NULL, 1, 0, component_id);
}

void rtapi_app_exit(void)
{
    hal_exit(component_id);
}

int rtapi_app_main(void)
{
    if (count < 1 || count > MAX_DRIVES) {
        rtapi_print_msg(RTAPI_MSG_ERR, "can_cia402: count=%d: give 1 to %d drives\n", count, MAX_DRIVES);
        return -EINVAL;
    }
    return component_load("can_cia402", &component_id, create, rtapi_app_exit);
}
