/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Mathematics for HAL components: the C library's, and pi for strict C11 compilers that leave it out. */
#ifndef RTAPI_MATH_H
#define RTAPI_MATH_H

#include <float.h>
#include <math.h>

#include <rtapi.h>
#include <rtapi_byteorder.h>

#ifndef M_PI
#define M_PI 3.14159265358979323846264338327950288
#endif
#ifndef M_PIl
#define M_PIl 3.14159265358979323846264338327950288L
#endif
#ifndef M_PI_2l
#define M_PI_2l 1.57079632679489661923132169163975144L
#endif

#endif
