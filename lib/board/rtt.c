/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "rtt.h"

#define FINEST_BITS 7u    /* steps of 128 ns at the short end */
#define OCTAVE_BITS 3u    /* eight steps in each octave */
#define REMEMBERED  8192u /* then old ones count half */

static unsigned log2_of(const uint32_t value)
{
    return 31u - (unsigned)__builtin_clz(value);
}

static unsigned step_of(const int64_t ns)
{
    const uint64_t units = ns > 0 ? (uint64_t)ns >> FINEST_BITS : 0;
    if (units < 1u << OCTAVE_BITS)
        return (unsigned)units;
    if (units > UINT32_MAX)
        return BOARD_RTT_STEPS - 1u;
    const unsigned octave = log2_of((uint32_t)units) - OCTAVE_BITS;
    const unsigned step = (octave << OCTAVE_BITS) + (unsigned)(units >> octave);
    return step < BOARD_RTT_STEPS ? step : BOARD_RTT_STEPS - 1u;
}

/* Where a step ends. */
static int64_t end_ns(const unsigned step)
{
    const unsigned octave = step >> OCTAVE_BITS > 1u ? (step >> OCTAVE_BITS) - 1u : 0;
    return (int64_t)(step - (octave << OCTAVE_BITS) + 1u) << octave << FINEST_BITS;
}

static void forget_half(struct board_rtt *const rtt)
{
    rtt->total = 0;
    for (unsigned i = 0; i < BOARD_RTT_STEPS; i++)
        rtt->total += rtt->count[i] /= 2u;
}

void board_rtt_add(struct board_rtt *const rtt, const int64_t ns)
{
    rtt->count[step_of(ns)]++;
    if (++rtt->total >= REMEMBERED)
        forget_half(rtt);
}

int64_t board_rtt_bound_ns(const struct board_rtt *const rtt, const uint32_t above)
{
    const uint32_t allowed = (uint32_t)((uint64_t)rtt->total * above / 1024u);
    uint32_t seen = 0;
    for (unsigned i = BOARD_RTT_STEPS; i-- > 0;) {
        seen += rtt->count[i];
        if (seen > allowed)
            return end_ns(i);
    }
    return 0;
}
