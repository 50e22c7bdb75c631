/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Integer limits for HAL components: those of the C library. */
#ifndef RTAPI_LIMITS_H
#define RTAPI_LIMITS_H

#include <limits.h>

#endif
