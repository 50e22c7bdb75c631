/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Error numbers for HAL components: those of the C library. */
#ifndef RTAPI_ERRNO_H
#define RTAPI_ERRNO_H

#include <errno.h>

#endif
