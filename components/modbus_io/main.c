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
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include "common/hal_binder.h"
#include "common/messenger.h"
#include "modbus_io/engine.h"
#include "modbus_io/pins.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("Modbus devices as pins");
MODULE_LICENSE("GPL");

#define MAX_INSTANCES 16

static char *config[MAX_INSTANCES];
RTAPI_MP_ARRAY_STRING(config, MAX_INSTANCES, "file of each instance");

static struct instance {
    struct hm2_modbus_map *map;
    struct engine *engine;
    struct pins *pins;
} instances[MAX_INSTANCES];
static unsigned count;
static int component_id;
static struct hal_binder hal;

static void update(void *const argument, const long period_ns)
{
    pins_update(argument, period_ns);
}

static char *read_file(const char *const path, size_t *const length)
{
    FILE *const file = fopen(path, "re");
    char *text = file ? malloc(HM2_MODBUS_FILE_BYTES + 1u) : NULL;
    if (text)
        *length = fread(text, 1, HM2_MODBUS_FILE_BYTES + 1u, file);
    if (!text || ferror(file)) {
        rtapi_print_msg(RTAPI_MSG_ERR, "modbus_io: %s: cannot be read: %s\n", path, strerror(errno));
        free(text);
        text = NULL;
    }
    if (file)
        (void)fclose(file);
    return text;
}

static int read_map(struct instance *const instance, const char *const path, struct hm2_diag *const diag)
{
    size_t length;
    char *const text = read_file(path, &length);
    if (!text)
        return -EINVAL;
    const int err = hm2_modbus_parse(text, length, path, &instance->map, diag);
    free(text);
    return err ? -EINVAL : 0;
}

static int make(struct instance *const instance, struct hm2_diag *const diag)
{
    char name[HAL_NAME_LEN + 1];
    instance->engine = engine_new(instance->map);
    if (!instance->engine) {
        (void)hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory, or a setting that the serial port cannot have");
        return -ENOMEM;
    }
    instance->pins = pins_new(&hal.binder, instance->map, instance->engine, diag);
    if (!instance->pins)
        return -EINVAL;
    rtapi_snprintf(name, sizeof name, "%s.update", instance->map->component);
    const int result = hal_export_funct(name, update, instance->pins, 1, 0, component_id);
    return result ? result : engine_start(instance->engine);
}

static int load(const char *const path)
{
    struct instance *const instance = &instances[count++];
    struct hm2_diag diag;
    *instance = (struct instance){0};
    hm2_diag_clear(&diag);
    int result = read_map(instance, path, &diag);
    if (!result)
        result = make(instance, &diag);
    messenger_print_diag("modbus_io", path, &diag);
    return result;
}

static void unload(void)
{
    hal_exit(component_id); /* first, so that no cycle uses what is freed */
    for (unsigned i = 0; i < count; i++) {
        engine_free(instances[i].engine);
        hm2_modbus_free(instances[i].map);
    }
    count = 0;
}

int rtapi_app_main(void)
{
    component_id = hal_init("modbus_io");
    if (component_id < 0)
        return component_id;
    hal_binder_init(&hal, component_id);
    int result = config[0] && config[0][0] ? 0 : -EINVAL;
    if (result)
        rtapi_print_msg(RTAPI_MSG_ERR, "modbus_io: no file given: loadrt modbus_io config=FILE\n");
    for (unsigned i = 0; !result && i < MAX_INSTANCES && config[i] && config[i][0]; i++)
        result = load(config[i]);
    if (!result)
        result = hal_ready(component_id);
    if (result < 0)
        unload();
    return result;
}

void rtapi_app_exit(void)
{
    unload();
}
