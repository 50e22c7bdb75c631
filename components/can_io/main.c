/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * can_io: the signals of a DBC file as HAL pins, over SocketCAN.
 *
 *     loadrt can_io interface=can0[,...] dbc=machine.dbc[,...] [node=HOST,...] [name=axes,...] [floats=1,...]
 *
 * The servo thread itself reads and writes the socket: without waiting, a bounded number of frames with few system
 * calls, all of which move frames. A thread in between would cost a hand-over and a wake-up in each direction, and SYNC
 * would no longer leave at a fixed place in the cycle. What can wait, or needs netlink, is done by a thread of normal
 * priority: state of the controller, restart after bus-off.
 */
#include <errno.h>
#include <net/if.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include <hm2/can.h>

#include "common/component.h"
#include "common/hal_binder.h"
#include "common/messenger.h"
#include "controller.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("signals of DBC files on SocketCAN");
MODULE_LICENSE("GPL");

#define MAX_BUSES     8
#define SUPERVISE_NS  50000000L
#define RESTART_PAUSE 20u /* of these: a second */
#define CLOSE_STEP_NS 1000000L
#define CLOSE_STEPS   2000u

static char *interface[MAX_BUSES];
RTAPI_MP_ARRAY_STRING(interface, MAX_BUSES, "network interface of each bus, such as can0");
static char *dbc[MAX_BUSES];
RTAPI_MP_ARRAY_STRING(dbc, MAX_BUSES, "DBC file of each bus");
static char *node[MAX_BUSES];
RTAPI_MP_ARRAY_STRING(node, MAX_BUSES, "the node of the file that we are; without it everything is received");
static char *name[MAX_BUSES];
RTAPI_MP_ARRAY_STRING(name, MAX_BUSES, "prefix of the pins (can.0, can.1, ...)");
static int floats[MAX_BUSES];
RTAPI_MP_ARRAY_INT(floats, MAX_BUSES, "1 = every pin that is not a bit is a float");

struct supervision {
    hm2_bit_t *link_up, *restart, *auto_restart;
    hm2_u32_t *state, *restarts, *restart_errors, *reopened;
};

static const struct hm2_point points[] = {
    HM2_POINT(struct supervision, link_up, "link-up", HM2_BIT, HM2_PIN_OUT, 0, "", "the interface is up"),
    HM2_POINT(struct supervision, state, "state", HM2_U32, HM2_PIN_OUT, CONTROLLER_UNKNOWN, "",
              "of the controller: 0 active, 1 warning, 2 passive, 3 bus-off, 4 stopped, 5 sleeping, 6 not known"),
    HM2_POINT(struct supervision, restart, "restart", HM2_BIT, HM2_PIN_IO, 0, "",
              "set: restart the controller after bus-off; cleared when that was tried"),
    HM2_POINT(struct supervision, auto_restart, "auto-restart", HM2_BIT, HM2_PARAM_RW, 0, "",
              "restart it whenever it is bus-off"),
    HM2_POINT(struct supervision, restarts, "restarts", HM2_U32, HM2_PIN_OUT, 0, "", "restarts that were done"),
    HM2_POINT(struct supervision, restart_errors, "restart-errors", HM2_U32, HM2_PIN_OUT, 0, "",
              "restarts that the kernel refused"),
    HM2_POINT(struct supervision, reopened, "reopened", HM2_U32, HM2_PIN_OUT, 0, "",
              "times that the interface was back after it had gone away, and is used again"),
};

struct bus {
    struct hm2_dbc *dbc;
    struct hm2_can *can;
    struct supervision *points;
    const char *interface;
    unsigned index;         /* of the interface that is used */
    unsigned refused_index; /* of one that could not be opened, which has been told */
    atomic_bool busy;       /* one of its functions runs */
    bool has_controller;
    bool was_off;   /* when its controller was asked last */
    unsigned pause; /* rounds until it may be restarted by itself again */
};

static int component_id;
static struct bus buses[MAX_BUSES];
static unsigned bus_count;
static struct hal_binder hal;
static atomic_bool closing; /* no function may touch a bus any more */

/* ---- functions of a bus ------------------------------------------------------------------------------------------ */

/* A host may unload the component while its functions are still in a thread (LinuxCNC's does): what is announced here
 * is waited for in close_functions(). */
static void run(struct bus *const b, void (*const cycle)(struct hm2_can *, int64_t))
{
    atomic_store(&b->busy, true);
    if (!atomic_load(&closing))
        cycle(b->can, rtapi_get_time());
    atomic_store_explicit(&b->busy, false, memory_order_release);
}

static void bus_read(void *const arg, const long period)
{
    (void)period;
    run(arg, hm2_can_read);
}

static void bus_write(void *const arg, const long period)
{
    (void)period;
    run(arg, hm2_can_write);
}

static void close_functions(void)
{
    const struct timespec step = {.tv_nsec = CLOSE_STEP_NS};
    atomic_store(&closing, true);
    for (unsigned i = 0, steps = 0; i < bus_count; i++)
        while (atomic_load(&buses[i].busy) && steps++ < CLOSE_STEPS)
            nanosleep(&step, NULL);
}

static int export_function(struct bus *const b, const char *const prefix, const char *const what,
                           void (*const function)(void *, long))
{
    char full[HAL_NAME_LEN + 1];
    rtapi_snprintf(full, sizeof full, "%s.%s", prefix, what);
    const int result = hal_export_funct(full, function, b, 1, 0, component_id);
    if (result < 0)
        rtapi_print_msg(RTAPI_MSG_ERR, "can_io: HAL did not take the function %s (%d)\n", full, result);
    return result;
}

/* ---- beside the cycle -------------------------------------------------------------------------------------------- */

static void ask_controller(struct bus *const b, const bool is_there)
{
    const enum controller_state state = is_there ? controller_state(b->interface) : CONTROLLER_UNKNOWN;
    const bool off = state == CONTROLLER_BUS_OFF;
    if (off != b->was_off)
        hm2_can_tell_bus_off(b->can, off);
    b->was_off = off;
    *b->points->state = state;
}

static bool must_restart(struct bus *const b)
{
    if (b->pause > 0)
        b->pause--;
    return *b->points->restart ||
           (*b->points->auto_restart && *b->points->state == CONTROLLER_BUS_OFF && b->pause == 0);
}

static void restart(struct bus *const b)
{
    b->pause = RESTART_PAUSE;
    if (controller_restart(b->interface) == 0)
        ++*b->points->restarts;
    else
        ++*b->points->restart_errors;
    *b->points->restart = false;
}

static int open_socket(struct bus *const b, struct hm2_can_bus **const socket, struct hm2_diag *const diag)
{
    struct hm2_can_filter *const filters = calloc(b->dbc->message_count, sizeof *filters);
    if (!filters)
        return HM2_ERR_NOMEM;
    const unsigned count = hm2_can_filters(b->can, filters, b->dbc->message_count);
    b->index = if_nametoindex(b->interface);
    const int err = hm2_can_open(b->interface, filters, count, hm2_can_needs_fd(b->can), socket, diag);
    free(filters);
    return err;
}

/* An interface that was unplugged and plugged in has a new index, and the socket is none of its own. Whether there is
 * one. */
static bool look_for_interface(struct bus *const b)
{
    const unsigned index = if_nametoindex(b->interface), before = b->index;
    struct hm2_can_bus *socket;
    struct hm2_diag diag;
    hm2_can_close_old(b->can);
    if (index == 0 || index == before)
        return index != 0;
    hm2_diag_clear(&diag);
    if (open_socket(b, &socket, &diag) == 0) {
        hm2_can_replace_bus(b->can, socket);
        b->has_controller = controller_state(b->interface) != CONTROLLER_UNKNOWN;
        ++*b->points->reopened;
        return true;
    }
    b->index = before; /* tried again: it may not be set up yet */
    if (index != b->refused_index)
        messenger_print_diag("can_io", b->interface, &diag);
    b->refused_index = index;
    return true;
}

static void supervise(void)
{
    for (unsigned i = 0; i < bus_count; i++) {
        struct bus *const b = &buses[i];
        const bool is_there = look_for_interface(b);
        *b->points->link_up = is_there && controller_link_up(b->interface);
        if (b->has_controller)
            ask_controller(b, is_there);
        if (must_restart(b))
            restart(b);
    }
}

/* ---- load -------------------------------------------------------------------------------------------------------- */

static int complain(const char *const subject, const struct hm2_diag *const diag, const int err)
{
    messenger_print_diag("can_io", subject, diag);
    if (err)
        rtapi_print_msg(RTAPI_MSG_ERR, "can_io: %s: not loaded: %s\n", subject, hm2_strerror(err));
    return err ? -EINVAL : 0;
}

/* The whole file, NUL terminated, or one byte more than may be read; NULL with a message. */
static char *read_file(const char *const path, size_t *const len)
{
    FILE *const file = fopen(path, "rbe");
    if (!file) {
        rtapi_print_msg(RTAPI_MSG_ERR, "can_io: cannot open %s: %s\n", path, strerror(errno));
        return NULL;
    }
    char *const text = malloc(HM2_DBC_MAX_TEXT + 1u);
    *len = text ? fread(text, 1, HM2_DBC_MAX_TEXT + 1u, file) : 0;
    const bool failed = ferror(file) != 0;
    (void)fclose(file);
    if (text && !failed)
        return text;
    rtapi_print_msg(RTAPI_MSG_ERR, "can_io: cannot read %s: %s\n", path, failed ? "input/output error" : "no memory");
    free(text);
    return NULL;
}

static int read_dbc(struct bus *const b, const char *const path)
{
    struct hm2_diag diag;
    size_t len;
    hm2_diag_clear(&diag);
    char *const text = read_file(path, &len);
    if (!text)
        return -ENOENT;
    const int err = hm2_dbc_read(text, len, path, &b->dbc, &diag);
    free(text);
    return complain(b->interface, &diag, err);
}

static int connect_bus(struct bus *const b, const struct hm2_can_options *const options, struct hm2_diag *const diag)
{
    struct hm2_can_bus *socket;
    int err = hm2_can_new(b->dbc, options, &b->can, diag);
    err = err ? err : open_socket(b, &socket, diag);
    return err ? err : hm2_can_setup(b->can, socket, &hal.binder, diag);
}

static int bind_supervision(struct bus *const b, const char *const prefix, struct hm2_diag *const diag)
{
    b->points = hal.binder.alloc(&hal.binder, sizeof *b->points);
    if (!b->points)
        return HM2_ERR_NOMEM;
    return hm2_bind_points(&hal.binder, points, sizeof points / sizeof points[0], b->points, prefix, 0, diag);
}

static int load_bus(const unsigned number)
{
    struct bus *const b = &buses[number];
    struct hm2_can_options options = {.node = node[number], .floats = floats[number] != 0};
    struct hm2_diag diag;
    char prefix[HAL_NAME_LEN + 1];
    *b = (struct bus){.interface = interface[number]};
    bus_count = number + 1u;
    if (!dbc[number] || !dbc[number][0]) {
        rtapi_print_msg(RTAPI_MSG_ERR, "can_io: %s: no file given: dbc=FILE%s\n", b->interface,
                        number ? ", one for each interface" : "");
        return -EINVAL;
    }
    rtapi_snprintf(prefix, sizeof prefix, "can.%u", number);
    if (name[number] && name[number][0])
        rtapi_snprintf(prefix, sizeof prefix, "%s", name[number]);
    options.prefix = prefix;
    int result = read_dbc(b, dbc[number]);
    if (result)
        return result;
    hm2_diag_clear(&diag);
    int err = connect_bus(b, &options, &diag);
    err = err ? err : bind_supervision(b, prefix, &diag);
    result = complain(b->interface, &diag, err);
    if (result)
        return result;
    b->has_controller = controller_state(b->interface) != CONTROLLER_UNKNOWN;
    result = export_function(b, prefix, "read", bus_read);
    return result < 0 ? result : export_function(b, prefix, "write", bus_write);
}

static int load_buses(void)
{
    int result = 0;
    if (!interface[0] || !interface[0][0]) {
        rtapi_print_msg(RTAPI_MSG_ERR, "can_io: no interface given: loadrt can_io interface=can0 dbc=FILE node=NAME\n");
        return -EINVAL;
    }
    for (unsigned i = 0; result == 0 && i < MAX_BUSES && interface[i] && interface[i][0]; i++)
        result = load_bus(i);
    return result;
}

void rtapi_app_exit(void)
{
    close_functions();
    messenger_stop();
    hal_exit(component_id);
    for (unsigned i = 0; i < bus_count; i++) {
        hm2_can_free(buses[i].can);
        hm2_dbc_free(buses[i].dbc);
    }
    bus_count = 0;
}

static int load(void)
{
    hal_binder_init(&hal, component_id);
    atomic_store(&closing, false);
    const int result = load_buses();
    return result ? result : messenger_start("can_io", supervise, SUPERVISE_NS);
}

int rtapi_app_main(void)
{
    return component_load("can_io", &component_id, load, rtapi_app_exit);
}
