/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Histogram of durations with fixed buckets: one per nanosecond below 64 ns, then 32 per octave (about 3 % wide) up
 * to 68 s; longer ones count in the last. Nothing is allocated. One thread adds, any thread may read.
 */
#ifndef HALHOST_HISTOGRAM_H
#define HALHOST_HISTOGRAM_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#define HISTOGRAM_BUCKETS 1024u

struct histogram {
    _Atomic uint64_t counts[HISTOGRAM_BUCKETS];
    _Atomic uint64_t total;
    _Atomic int64_t max_ns;
};

void histogram_clear(struct histogram *histogram);
/* Realtime safe. Negative durations count as 0. */
void histogram_add(struct histogram *histogram, int64_t ns);

/* Bucket i holds durations from histogram_low_ns(i) to histogram_low_ns(i + 1) - 1. */
int64_t histogram_low_ns(size_t bucket);
uint64_t histogram_count(const struct histogram *histogram, size_t bucket);
uint64_t histogram_total(const struct histogram *histogram);
int64_t histogram_max_ns(const struct histogram *histogram);
/* Smallest duration that is not exceeded by this share (0..1) of all, to the bucket's width; 0 when empty. */
int64_t histogram_quantile_ns(const struct histogram *histogram, double share);

#endif
