/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "steps.h"

#include <dirent.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/ptrace.h>
#include <sys/user.h>
#include <sys/wait.h>

#define BREAKPOINT 0xCCul /* int3 */
#define PATIENCE   1000   /* stops of threads, until the wanted one comes */

int steps_stop(const pid_t thread)
{
    int status;
    if (ptrace(PTRACE_SEIZE, thread, NULL, NULL) != 0 || ptrace(PTRACE_INTERRUPT, thread, NULL, NULL) != 0)
        return -1;
    return waitpid(thread, &status, __WALL) == thread ? 0 : -1;
}

/* ---- breakpoint -------------------------------------------------------------------------------------------------- */

/* The last one for which that returned 0, or -1. */
static pid_t for_each_thread(const pid_t process, int (*const act)(pid_t thread))
{
    char path[64];
    pid_t last = -1;
    (void)snprintf(path, sizeof path, "/proc/%d/task", (int)process);
    DIR *const folder = opendir(path);
    for (const struct dirent *entry; folder && (entry = readdir(folder));) {
        const pid_t thread = (pid_t)strtol(entry->d_name, NULL, 10);
        if (thread > 0 && act(thread) == 0)
            last = thread;
    }
    if (folder)
        (void)closedir(folder);
    return last;
}

static int go_on(const pid_t thread)
{
    return (int)ptrace(PTRACE_CONT, thread, NULL, NULL);
}

static bool stands_behind(const pid_t thread, const uintptr_t code)
{
    struct user_regs_struct regs;
    return ptrace(PTRACE_GETREGS, thread, NULL, &regs) == 0 && regs.rip == code + 1;
}

/* The thread that has run into the breakpoint; others that stop meanwhile go on. */
static pid_t wait_for_it(const uintptr_t code)
{
    for (unsigned i = 0; i < PATIENCE; i++) {
        int status;
        const pid_t thread = waitpid(-1, &status, __WALL);
        if (thread < 0)
            return -1;
        if (!WIFSTOPPED(status))
            continue;
        const bool trapped = status >> 8 == SIGTRAP;
        if (trapped && stands_behind(thread, code))
            return thread;
        (void)ptrace(PTRACE_CONT, thread, NULL, trapped || status >> 16 != 0 ? 0 : WSTOPSIG(status));
    }
    return -1;
}

pid_t steps_find(const pid_t process, const uintptr_t code)
{
    struct user_regs_struct regs;
    const pid_t any = for_each_thread(process, steps_stop);
    if (any < 0)
        return -1;
    void *const at = (void *)code; // NOLINT(performance-no-int-to-ptr): an address in another process
    const unsigned long before = (unsigned long)ptrace(PTRACE_PEEKTEXT, any, at, NULL);
    if (ptrace(PTRACE_POKETEXT, any, at, (before & ~0xFFul) | BREAKPOINT) != 0)
        return -1;
    (void)for_each_thread(process, go_on);
    const pid_t thread = wait_for_it(code);
    if (thread < 0 || ptrace(PTRACE_POKETEXT, thread, at, before) != 0 ||
        ptrace(PTRACE_GETREGS, thread, NULL, &regs) != 0)
        return -1;
    regs.rip = code;
    return ptrace(PTRACE_SETREGS, thread, NULL, &regs) == 0 ? thread : -1;
}

/* ---- steps ------------------------------------------------------------------------------------------------------- */

/* What is executed from the first instruction of a function of the driver's until its return is the driver's; system
 * calls are one instruction. The first cycle is one that begins here. */
int steps_count(const pid_t thread, const struct step_code code, const int cycles, struct step_counts *const counts)
{
    struct user_regs_struct regs;
    long long *inside = NULL;
    unsigned long stack = 0;
    int status, signal = 0;

    while (counts->cycles < cycles) {
        if (ptrace(PTRACE_SINGLESTEP, thread, NULL, signal) != 0 || waitpid(thread, &status, __WALL) != thread)
            return -1;
        if (!WIFSTOPPED(status)) {
            fprintf(stderr, "the driver ended with status 0x%X after %d cycles\n", (unsigned)status, counts->cycles);
            return -1;
        }
        signal = WSTOPSIG(status) == SIGTRAP ? 0 : WSTOPSIG(status);
        if (ptrace(PTRACE_GETREGS, thread, NULL, &regs) != 0)
            return -1;
        if (inside && regs.rsp > stack) {
            counts->cycles += inside == &counts->write;
            inside = NULL;
        } else if (!inside && (regs.rip == code.read || (regs.rip == code.write && counts->read > 0))) {
            inside = regs.rip == code.read ? &counts->read : &counts->write;
            stack = regs.rsp;
        }
        if (inside)
            ++*inside;
    }
    return 0;
}

void steps_print(const struct step_counts *const counts)
{
    printf("read_instructions=%lld\nwrite_instructions=%lld\ncycle_instructions=%lld\n", counts->read / counts->cycles,
           counts->write / counts->cycles, (counts->read + counts->write) / counts->cycles);
}
