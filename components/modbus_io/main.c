/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * modbus_io: coils and registers of Modbus devices as pins, from the files that LinuxCNC's mb2hal reads.
 *
 *     loadrt modbus_io config=spindle.ini,plc.ini
 *     addf mb2hal.update servo
 *
 * Each file is an instance with a function of its own. The cycle exchanges words with the threads that talk to the
 * devices, see engine.h.
 */
#include <errno.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include "common/component.h"
#include "common/hal_binder.h"
#include "modbus_io/instance.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("Modbus devices as pins");
MODULE_LICENSE("GPL");

#define MAX_INSTANCES 16

static char *config[MAX_INSTANCES];
RTAPI_MP_ARRAY_STRING(config, MAX_INSTANCES, "file of each instance");

static struct instance instances[MAX_INSTANCES];
static unsigned count;
static int component_id;
static struct hal_binder hal;

static void update(void *const argument, const long period_ns)
{
    pins_update(argument, period_ns);
}

static int export(const struct instance *const instance)
{
    char name[HAL_NAME_LEN + 1];
    rtapi_snprintf(name, sizeof name, "%s.update", instance->map->component);
    const int result = hal_export_funct(name, update, instance->pins, 1, 0, component_id);
    return result ? result : engine_start(instance->engine);
}

static int load(const char *const path)
{
    struct instance *const instance = &instances[count++];
    int result = instance_read(instance, path);
    if (!result)
        result = instance_make(instance, path, &hal.binder);
    return result ? result : export(instance);
}

void rtapi_app_exit(void)
{
    hal_exit(component_id);
    for (unsigned i = 0; i < count; i++)
        instance_free(&instances[i]);
    count = 0;
}

static int load_all(void)
{
    hal_binder_init(&hal, component_id);
    int result = config[0] && config[0][0] ? 0 : -EINVAL;
    if (result)
        rtapi_print_msg(RTAPI_MSG_ERR, "modbus_io: no file given: loadrt modbus_io config=FILE\n");
    for (unsigned i = 0; !result && i < MAX_INSTANCES && config[i] && config[i][0]; i++)
        result = load(config[i]);
    return result;
}

int rtapi_app_main(void)
{
    return component_load("modbus_io", &component_id, load_all, rtapi_app_exit);
}
