/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Compile-only model of LinuxCNC master's rtapi_app.h: both entry points are required. See ../README.md. */
#ifndef MODEL_RTAPI_APP_H
#define MODEL_RTAPI_APP_H

#include <rtapi.h>

int rtapi_app_main(void);
void rtapi_app_exit(void);

EXPORT_SYMBOL(rtapi_app_main);
EXPORT_SYMBOL(rtapi_app_exit);

#endif
