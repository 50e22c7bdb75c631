/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The newest of something from one thread to one other, without a lock or a wait on either side: three slots, of which
 * the writer has one, the reader has one, and the third, the newest complete one, is swapped by either.
 */
#ifndef MODBUS_IO_SLOTS_H
#define MODBUS_IO_SLOTS_H

#include <stdatomic.h>
#include <stdbool.h>

#define SLOTS_NEW 4u

struct slots {
    atomic_uint middle;   /* number of the slot between the two, and SLOTS_NEW when the reader has not had it */
    unsigned back, front; /* of the writer, of the reader */
};

static inline void slots_init(struct slots *const slots)
{
    slots->back = 0;
    atomic_init(&slots->middle, 1u);
    slots->front = 2;
}

/* What was written to slot `back` is for the reader now; `back` is another one, with something older in it. */
static inline void slots_publish(struct slots *const slots)
{
    slots->back = atomic_exchange_explicit(&slots->middle, slots->back | SLOTS_NEW, memory_order_acq_rel) & 3u;
}

/* Whether slot `front` holds something newer than before. */
static inline bool slots_take(struct slots *const slots)
{
    if (!(atomic_load_explicit(&slots->middle, memory_order_relaxed) & SLOTS_NEW))
        return false;
    slots->front = atomic_exchange_explicit(&slots->middle, slots->front, memory_order_acq_rel) & 3u;
    return true;
}

#endif
