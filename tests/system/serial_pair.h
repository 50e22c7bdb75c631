/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A serial line of two pseudo-terminals: a client opens one end, a device the other, and a process between them carries
 * the bytes, and spoils the device's answers on request. Failures of the harness itself end the test through Check.
 */
#ifndef TEST_SERIAL_PAIR_H
#define TEST_SERIAL_PAIR_H

#include <stdatomic.h>
#include <sys/types.h>

enum wire_fault {
    WIRE_CLEAN,
    WIRE_SPOILT,     /* the last byte of an answer is another one */
    WIRE_CUT,        /* the last byte of an answer is missing */
    WIRE_OTHER_UNIT, /* an answer comes from another unit, with the right checksum */
    WIRE_HELD,       /* an answer is kept until the fault is another one; the next request takes its place */
    WIRE_OPEN,       /* requests do not arrive */
};

/* Shared with the process. */
struct wire {
    atomic_int fault;
    atomic_uint requests, answers; /* that came to the line */
    atomic_uint kept;              /* 1 while an answer is kept */
    atomic_uint late;              /* answers that were kept and passed on before another request came */
};

struct serial_pair {
    char client[64], device[64]; /* paths */
    struct wire *wire;
    pid_t process;
    int fds[4];
};

/* Whoever wants may open both ends. */
void serial_pair_open(struct serial_pair *pair);
void serial_pair_close(struct serial_pair *pair);

#endif
