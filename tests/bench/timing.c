/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "timing.h"

#include <arpa/inet.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

static int64_t clock_ns(const clockid_t clock)
{
    struct timespec ts;
    clock_gettime(clock, &ts);
    return (int64_t)ts.tv_sec * 1000000000 + ts.tv_nsec;
}

int64_t now_ns(void)
{
    return clock_ns(CLOCK_MONOTONIC);
}

int64_t thread_ns(void)
{
    return clock_ns(CLOCK_THREAD_CPUTIME_ID);
}

void sleep_until(const int64_t when_ns)
{
    const struct timespec ts = {.tv_sec = when_ns / 1000000000, .tv_nsec = when_ns % 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &ts, NULL);
}

void take_processor(const int cpu)
{
    const struct sched_param fifo = {.sched_priority = 50};
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET((size_t)cpu, &set);
    (void)sched_setaffinity(0, sizeof set, &set);
    (void)sched_setscheduler(0, SCHED_FIFO, &fifo);
    (void)mlockall(MCL_CURRENT | MCL_FUTURE);
}

static int compare(const void *const a, const void *const b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

void print_times(const char *const name, int64_t *const ns, const int count)
{
    qsort(ns, (size_t)count, sizeof *ns, compare);
    printf("%s_median_ns=%lld\n%s_p99_ns=%lld\n", name, (long long)ns[count / 2], name,
           (long long)ns[(int)(count * 0.99)]);
}

struct sockaddr_in address_of(const char *const address, const char *const port)
{
    struct sockaddr_in in = {.sin_family = AF_INET, .sin_port = htons((uint16_t)strtoul(port, NULL, 10))};
    if (inet_pton(AF_INET, address, &in.sin_addr) != 1) {
        fprintf(stderr, "bench: %s is no IPv4 address\n", address);
        exit(2);
    }
    return in;
}
