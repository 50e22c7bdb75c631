/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Atomic operations for HAL components: those of C11. */
#ifndef RTAPI_ATOMIC_H
#define RTAPI_ATOMIC_H

#include <stdatomic.h>

#endif
