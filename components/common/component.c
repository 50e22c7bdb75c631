/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "component.h"

#include <rtapi.h>

#include <hal.h>

int component_load(const char *const name, int *const id, int (*const load)(void), void (*const unload)(void))
{
    *id = hal_init(name);
    if (*id < 0)
        return *id;
    int result = load();
    if (result == 0)
        result = hal_ready(*id);
    if (result < 0)
        unload();
    return result;
}
