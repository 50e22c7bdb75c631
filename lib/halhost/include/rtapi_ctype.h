/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Character classes for HAL components: those of the C library. */
#ifndef RTAPI_CTYPE_H
#define RTAPI_CTYPE_H

#include <ctype.h>

#endif
