/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The name is free in 2.9 and taken in master. */
#include <hal.h>
#include <rtapi_app.h>

typedef volatile bool hal_bool_t;
static hal_bool_t *pin;

int rtapi_app_main(void)
{
    return pin != NULL;
}

void rtapi_app_exit(void)
{
}
