/* SPDX-License-Identifier: GPL-2.0-or-later */
/* How a component comes up. */
#ifndef COMPONENT_H
#define COMPONENT_H

/* What rtapi_app_main() does and returns: announce the component to HAL, load() it, which finds its number in *id, and
 * tell HAL that it is ready. When a step fails, unload() takes everything back, hal_exit() included, and the result is
 * a negative errno. */
int component_load(const char *name, int *id, int (*load)(void), void (*unload)(void));

#endif
