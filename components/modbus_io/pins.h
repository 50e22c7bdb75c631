/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The pins of a map, named as LinuxCNC's mb2hal names them, and the cycle that serves them. */
#ifndef MODBUS_IO_PINS_H
#define MODBUS_IO_PINS_H

#include <hm2/modbus.h>
#include <hm2/points.h>

#include "engine.h"

struct pins;

/* Create them. NULL with the reason in diag; the memory is the binder's. Map and engine must stay as long. */
struct pins *pins_new(struct hm2_binder *binder, const struct hm2_modbus_map *map, struct engine *engine,
                      struct hm2_diag *diag);
/* Hand pins to the engine and results to pins. Realtime safe. */
void pins_update(struct pins *pins, long period_ns);

#endif
