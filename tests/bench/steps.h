/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * User instructions of a driver's realtime functions, counted by stepping through a thread of another process: exact,
 * and without the kernel's share. x86-64.
 */
#ifndef BENCH_STEPS_H
#define BENCH_STEPS_H

#include <stdint.h>
#include <sys/types.h>

/* Where the driver's two functions begin. */
struct step_code {
    uintptr_t read, write;
};

struct step_counts {
    long long read, write;
    int cycles;
};

/* Stop a thread of which nobody knows the state. 0 or -1. */
int steps_stop(pid_t thread);
/* The thread of a process that next comes to this instruction; it stands there. -1: none does. */
pid_t steps_find(pid_t process, uintptr_t code);
/* Step a stopped thread through whole cycles. 0 or -1. */
int steps_count(pid_t thread, struct step_code code, int cycles, struct step_counts *counts);
/* read_instructions=N, write_instructions=N, cycle_instructions=N: of one cycle. */
void steps_print(const struct step_counts *counts);

#endif
