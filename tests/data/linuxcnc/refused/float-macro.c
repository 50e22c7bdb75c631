/* SPDX-License-Identifier: GPL-2.0-or-later */
/* In 2.9 hal_float_t is a macro, in master a type. */
#include <hal.h>
#include <rtapi_app.h>

#ifndef hal_float_t
#error "hal_float_t is no macro"
#endif

int rtapi_app_main(void)
{
    return 0;
}

void rtapi_app_exit(void)
{
}
