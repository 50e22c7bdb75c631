/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The two entry points of every component. Include this in exactly one source file of a component. */
#ifndef RTAPI_APP_H
#define RTAPI_APP_H

#include <rtapi.h>

/* 0, or a negative errno: the component is then unloaded without a call of rtapi_app_exit(). */
int rtapi_app_main(void);
void rtapi_app_exit(void);

EXPORT_SYMBOL(rtapi_app_main);
EXPORT_SYMBOL(rtapi_app_exit);

#endif
