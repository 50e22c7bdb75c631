/* SPDX-License-Identifier: GPL-2.0-or-later */
/* 2.9 has this call, master has not. */
#include <hal.h>
#include <rtapi_app.h>

int rtapi_app_main(void)
{
    return rtapi_get_clocks() > 0;
}

void rtapi_app_exit(void)
{
}
