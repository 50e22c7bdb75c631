/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Which processor the realtime threads of the host are bound to. Decided when threads are started, from files of the
 * kernel; never in a cycle.
 *
 * Of the processors that the program may use, those that the kernel keeps free of other work (isolcpus=) come first;
 * among equals those with the fewest realtime threads of other programs that can run nowhere else, which a function
 * that hangs here would starve; among those the last, as in LinuxCNC.
 */
#ifndef HALHOST_PROCESSOR_H
#define HALHOST_PROCESSOR_H

#include <sched.h>
#include <stdbool.h>

struct hh_processors {
    cpu_set_t allowed;           /* where this program may run */
    cpu_set_t online;            /* those of the machine that run */
    cpu_set_t isolated;          /* of the machine, kept free of other work */
    unsigned bound[CPU_SETSIZE]; /* realtime threads of other programs that can run on this one only */
};

/* A list as the kernel prints it ("0-2,5\n"); what cannot be read is left out. */
void hh_processors_read(const char *list, cpu_set_t *set);

/* Whether the isolated processors, which the kernel keeps programs from, are to be asked for: nobody has confined this
 * program to others. */
bool hh_processors_unconfined(const struct hh_processors *processors);

/* The best of the allowed ones, -1 = there is none. */
int hh_processor_best(const struct hh_processors *processors);

/* Look at this machine and choose; -1 = the kernel does not tell. */
int hh_processor_choose(void);

#endif
