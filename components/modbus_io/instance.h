/* SPDX-License-Identifier: GPL-2.0-or-later */
/* One map with its threads and its pins, the same in a realtime component and in a program. Messages go to RTAPI. */
#ifndef MODBUS_IO_INSTANCE_H
#define MODBUS_IO_INSTANCE_H

#include <hm2/modbus.h>
#include <hm2/points.h>

#include "engine.h"
#include "pins.h"

struct instance {
    struct hm2_modbus_map *map;
    struct engine *engine;
    struct pins *pins;
};

/* Read the file: then the name of its component is known. 0 or a negative errno, with instance_free() due either way.
 */
int instance_read(struct instance *instance, const char *path);
/* Create threads, which engine_start() lets run, and pins. 0 or a negative errno. */
int instance_make(struct instance *instance, const char *path, struct hm2_binder *binder);
/* After hal_exit(), so that no cycle uses what is freed. */
void instance_free(struct instance *instance);

#endif
