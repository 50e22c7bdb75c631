/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "processor.h"

#include <ctype.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { LIST_BYTES = 4096, PATH_BYTES = 64 };

void hh_processors_read(const char *const list, cpu_set_t *const set)
{
    CPU_ZERO(set);
    const char *at = list;
    while (isdigit((unsigned char)*at)) {
        char *end;
        const unsigned long first = strtoul(at, &end, 10);
        const unsigned long last = *end == '-' ? strtoul(end + 1, &end, 10) : first;
        for (unsigned long cpu = first; cpu <= last && cpu < CPU_SETSIZE; cpu++)
            CPU_SET(cpu, set);
        at = *end == ',' ? end + 1 : end;
    }
}

/* ---- choosing --------------------------------------------------------------------------------------------------- */

bool hh_processors_unconfined(const struct hh_processors *const p)
{
    cpu_set_t together, common;
    CPU_OR(&together, &p->allowed, &p->isolated);
    CPU_AND(&common, &p->allowed, &p->isolated);
    return CPU_COUNT(&common) == 0 && CPU_EQUAL(&together, &p->online);
}

static bool better(const struct hh_processors *const p, const size_t cpu, const size_t than)
{
    const bool isolated = CPU_ISSET(cpu, &p->isolated) != 0, than_isolated = CPU_ISSET(than, &p->isolated) != 0;
    return isolated != than_isolated ? isolated : p->bound[cpu] <= p->bound[than];
}

int hh_processor_best(const struct hh_processors *const p)
{
    int best = -1;
    for (int cpu = 0; cpu < CPU_SETSIZE; cpu++) {
        if (CPU_ISSET((size_t)cpu, &p->allowed) && (best < 0 || better(p, (size_t)cpu, (size_t)best)))
            best = cpu;
    }
    return best;
}

/* ---- what the kernel tells -------------------------------------------------------------------------------------- */

/* The beginning of a file; empty when it cannot be read. */
static void read_text(const char *const path, char *const text, const size_t size)
{
    FILE *const file = fopen(path, "r");
    const size_t length = file ? fread(text, 1, size - 1, file) : 0;
    text[length] = '\0';
    if (file)
        (void)fclose(file);
}

static void read_list(const char *const path, cpu_set_t *const set)
{
    char text[LIST_BYTES];
    read_text(path, text, sizeof text);
    hh_processors_read(text, set);
}

/* The processor that a thread is bound to when it has realtime priority, else -1. */
static int bound_to(const pid_t thread)
{
    cpu_set_t set;
    const int policy = sched_getscheduler(thread) & ~SCHED_RESET_ON_FORK;
    if ((policy != SCHED_FIFO && policy != SCHED_RR) || sched_getaffinity(thread, sizeof set, &set) ||
        CPU_COUNT(&set) != 1)
        return -1;
    int cpu = 0;
    while (!CPU_ISSET((size_t)cpu, &set))
        cpu++;
    return cpu;
}

/* Call for each entry of a folder that is a number. */
static void for_each_number(const char *const path, void (*const call)(long number, unsigned *bound),
                            unsigned *const bound)
{
    DIR *const folder = opendir(path);
    for (const struct dirent *entry; folder && (entry = readdir(folder));) {
        char *end;
        const long number = strtol(entry->d_name, &end, 10);
        if (number > 0 && *end == '\0')
            call(number, bound);
    }
    if (folder)
        (void)closedir(folder);
}

static void count_thread(const long thread, unsigned *const bound)
{
    const int cpu = bound_to((pid_t)thread);
    if (cpu >= 0)
        bound[cpu]++;
}

/* The kernel has realtime threads on each processor, which soon give way again; they have no command line. The
 * program's own may still be on their way out. */
static void count_program(const long pid, unsigned *const bound)
{
    char path[PATH_BYTES], command[2];
    (void)snprintf(path, sizeof path, "/proc/%ld/cmdline", pid);
    read_text(path, command, sizeof command);
    if (command[0] == '\0' || pid == (long)getpid())
        return;
    (void)snprintf(path, sizeof path, "/proc/%ld/task", pid);
    for_each_number(path, count_thread, bound);
}

/* Isolated processors are those that a program gets only when it asks for them; which of them it may have, the answer
 * tells. */
static void ask_for_isolated(struct hh_processors *const p)
{
    cpu_set_t wanted;
    const cpu_set_t before = p->allowed;
    CPU_OR(&wanted, &p->allowed, &p->isolated);
    if (sched_setaffinity(0, sizeof wanted, &wanted) == 0 && sched_getaffinity(0, sizeof wanted, &wanted) == 0)
        p->allowed = wanted;
    (void)sched_setaffinity(0, sizeof before, &before);
}

int hh_processor_choose(void)
{
    struct hh_processors p = {0};
    if (sched_getaffinity(0, sizeof p.allowed, &p.allowed))
        return -1;
    read_list("/sys/devices/system/cpu/online", &p.online);
    read_list("/sys/devices/system/cpu/isolated", &p.isolated);
    if (CPU_COUNT(&p.isolated) > 0 && hh_processors_unconfined(&p))
        ask_for_isolated(&p);
    for_each_number("/proc", count_program, p.bound);
    return hh_processor_best(&p);
}
