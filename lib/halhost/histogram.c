/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "histogram.h"

enum { LINEAR = 64, PER_OCTAVE = 32, FIRST_OCTAVE = 6, SUB_BITS = 5 };

static size_t bucket_of(const int64_t ns)
{
    if (ns < LINEAR)
        return ns < 0 ? 0 : (size_t)ns;
    const unsigned octave = 63u - (unsigned)__builtin_clzll((unsigned long long)ns);
    const size_t sub = (size_t)(ns >> (octave - SUB_BITS)) & (PER_OCTAVE - 1);
    const size_t bucket = LINEAR + (octave - FIRST_OCTAVE) * PER_OCTAVE + sub;
    return bucket < HISTOGRAM_BUCKETS ? bucket : HISTOGRAM_BUCKETS - 1;
}

int64_t histogram_low_ns(const size_t bucket)
{
    if (bucket < LINEAR)
        return (int64_t)bucket;
    const unsigned octave = FIRST_OCTAVE + (unsigned)((bucket - LINEAR) / PER_OCTAVE);
    const int64_t sub = (int64_t)((bucket - LINEAR) % PER_OCTAVE);
    return (PER_OCTAVE + sub) << (octave - SUB_BITS);
}

void histogram_clear(struct histogram *const histogram)
{
    for (size_t i = 0; i < HISTOGRAM_BUCKETS; i++)
        atomic_store_explicit(&histogram->counts[i], 0, memory_order_relaxed);
    atomic_store_explicit(&histogram->total, 0, memory_order_relaxed);
    atomic_store_explicit(&histogram->max_ns, 0, memory_order_relaxed);
}

/* One writer: load and store, without the cost of an atomic addition. */
static void increment(_Atomic uint64_t *const counter)
{
    atomic_store_explicit(counter, atomic_load_explicit(counter, memory_order_relaxed) + 1, memory_order_relaxed);
}

void histogram_add(struct histogram *const histogram, const int64_t ns)
{
    increment(&histogram->counts[bucket_of(ns)]);
    increment(&histogram->total);
    if (ns > atomic_load_explicit(&histogram->max_ns, memory_order_relaxed))
        atomic_store_explicit(&histogram->max_ns, ns, memory_order_relaxed);
}

uint64_t histogram_count(const struct histogram *const histogram, const size_t bucket)
{
    return bucket < HISTOGRAM_BUCKETS ? atomic_load_explicit(&histogram->counts[bucket], memory_order_relaxed) : 0;
}

uint64_t histogram_total(const struct histogram *const histogram)
{
    return atomic_load_explicit(&histogram->total, memory_order_relaxed);
}

int64_t histogram_max_ns(const struct histogram *const histogram)
{
    return atomic_load_explicit(&histogram->max_ns, memory_order_relaxed);
}

int64_t histogram_quantile_ns(const struct histogram *const histogram, const double share)
{
    const double wanted = share * (double)histogram_total(histogram);
    const int64_t max_ns = histogram_max_ns(histogram);
    uint64_t seen = 0;
    for (size_t i = 0; i < HISTOGRAM_BUCKETS; i++) {
        seen += histogram_count(histogram, i);
        if (seen > 0 && (double)seen >= wanted) {
            const int64_t high_ns = histogram_low_ns(i + 1) - 1;
            return high_ns < max_ns ? high_ns : max_ns;
        }
    }
    return max_ns;
}
