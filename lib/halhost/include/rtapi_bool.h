/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The boolean type for HAL components. */
#ifndef RTAPI_BOOL_H
#define RTAPI_BOOL_H

#include <stdbool.h>

#endif
