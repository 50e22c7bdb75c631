/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What the benches have in common: clocks, a processor of their own, medians. */
#ifndef BENCH_TIMING_H
#define BENCH_TIMING_H

#include <netinet/in.h>
#include <stdint.h>

#define PERIOD_NS  1000000L
#define WARM_UP    600 /* cycles: until pipelined ones have begun */
#define CLIENT_CPU 1
#define SERVER_CPU 0

int64_t now_ns(void);
/* Processor time of the calling thread, user and kernel. */
int64_t thread_ns(void);
void sleep_until(int64_t when_ns);
/* As a servo thread would run; measurements on a machine that does not permit it are still ratios. */
void take_processor(int cpu);
/* NAME_median_ns= and NAME_p99_ns=; sorts ns. */
void print_times(const char *name, int64_t *ns, int count);
struct sockaddr_in address_of(const char *address, const char *port);

#endif
