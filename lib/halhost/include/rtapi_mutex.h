/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * One-bit mutual exclusion between set-up code and realtime code. Realtime code may only try and give; getting waits
 * and is for set-up code.
 */
#ifndef RTAPI_MUTEX_H
#define RTAPI_MUTEX_H

#include <sched.h>

typedef unsigned long rtapi_mutex_t;

/* Returns 0 when the mutex was free and now belongs to the caller. */
static inline int rtapi_mutex_try(rtapi_mutex_t *mutex)
{
    return (int)(__atomic_fetch_or(mutex, 1ul, __ATOMIC_ACQUIRE) & 1ul);
}

static inline void rtapi_mutex_give(rtapi_mutex_t *mutex)
{
    (void)__atomic_fetch_and(mutex, ~1ul, __ATOMIC_RELEASE);
}

static inline void rtapi_mutex_get(rtapi_mutex_t *mutex)
{
    while (rtapi_mutex_try(mutex))
        (void)sched_yield();
}

#endif
