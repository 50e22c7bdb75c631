/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Private memory of a component, for set-up and clean-up only. Pins and parameters need hal_malloc() instead. */
#ifndef RTAPI_SLAB_H
#define RTAPI_SLAB_H

#include <stdlib.h>

#include <rtapi_gfp.h>

#define rtapi_kmalloc(size, flags)           malloc((size))
#define rtapi_kzalloc(size, flags)           calloc(1, (size))
#define rtapi_krealloc(pointer, size, flags) realloc((pointer), (size))
#define rtapi_kfree(pointer)                 free((pointer))

#endif
