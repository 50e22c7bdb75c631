/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "scan_logic.h"

#include <string.h>

#define MAX_BIT(control)    ((control)&0x1Fu) /* register map 3.17, register 0 */
#define INVERTED(control)   ((control) >> 5 & 1u)
#define DIVISOR(control)    ((control) >> 6 & 0x3FFu)
#define FAST_COUNT(control) ((control) >> 16 & 0x3Fu)
#define SLOW_COUNT(control) ((control) >> 22 & 0x3FFu)
#define MAX_BIT_MASK        0x1Fu
#define PRESCALE            4
#define GLITCH_TOP          7u
#define GLITCH_EDGES        (GLITCH_TOP + 3) /* until its filter shows a new level */

enum { PAGE_CONTROL, PAGE_SLOW, PAGE_FILTERED, PAGE_RAW, PAGE_MPG };

static uint32_t width_mask(const struct scanner *const s)
{
    return s->width >= 32 ? UINT32_MAX : (1u << s->width) - 1;
}

/* Levels as the scanner takes them. Shipping firmware sees field inputs inverted at its pins, and the driver sets the
 * invert bit for that (3.17). */
static uint32_t levels(const struct scanner *const s)
{
    return INVERTED(s->control) ? ~s->outside : s->outside;
}

static bool level_at(const struct scanner *const s, const unsigned input)
{
    return levels(s) >> input & 1u;
}

void scan_power_up(struct scanner *const s, const int64_t clk)
{
    const struct scanner old = *s;
    memset(s, 0, sizeof(*s));
    s->width = old.width;
    s->multiplexed = old.multiplexed;
    s->outside = old.outside;
    s->control = s->width - 1;
    s->start = clk;
    s->clk = clk;
}

/* ---- time
 * ---------------------------------------------------------------------------------------------------------------- */

static int64_t next_tick(const struct scanner *const s)
{
    const int64_t past = (s->clk - s->start) % PRESCALE;
    return past ? s->clk + PRESCALE - past : s->clk;
}

int64_t scan_next_look(const struct scanner *const s)
{
    return next_tick(s) + (int64_t)s->ticks_left * PRESCALE;
}

static int64_t look_period(const struct scanner *const s)
{
    return ((int64_t)DIVISOR(s->control) + 1) * PRESCALE;
}

/* ---- MPG counters
 * ---------------------------------------------------------------------------------------------------------- */

/* +1, 0, -1: times one counts both edges of A while B is high; times four counts every edge (3.17). */
static int mpg_step(const unsigned old, const unsigned now, const bool times_four)
{
    const bool a = now & 1u, b = now & 2u;
    const bool a_changed = (old ^ now) & 1u, b_changed = (old ^ now) & 2u;
    if (!times_four)
        return a_changed && b ? (a ? 1 : -1) : 0;
    int step = 0;
    if (a_changed)
        step += a == b ? 1 : -1;
    if (b_changed)
        step += a != b ? 1 : -1;
    return step;
}

static void mpg_edge(struct scanner *const s)
{
    const uint8_t now = (uint8_t)s->filtered;
    if (now == s->mpg_seen)
        return;
    for (unsigned i = 0; i < SCAN_MPGS; i++) {
        const int step =
            mpg_step((unsigned)s->mpg_seen >> 2 * i & 3u, (unsigned)now >> 2 * i & 3u, (unsigned)s->mpg_mode >> i & 1u);
        s->mpg[i] = (uint8_t)(s->mpg[i] + (unsigned)step);
    }
    s->mpg_seen = now;
}

/* ---- one look
 * --------------------------------------------------------------------------------------------------------------- */

static void filter(struct scanner *const s, const unsigned i)
{
    const uint16_t old = s->counts[i];
    const uint32_t bit = 1u << i;
    if (!(s->raw & bit)) {
        if (old > 0)
            s->counts[i]--;
        else
            s->filtered &= ~bit;
        return;
    }
    const bool slow = s->slow & bit;
    const uint32_t limit = slow ? SLOW_COUNT(s->control) : FAST_COUNT(s->control);
    if (old < limit)
        s->counts[i]++;
    else if (!slow || old == limit) /* the slow count is compared for equality (3.17) */
        s->filtered |= bit;
}

static void look(struct scanner *const s)
{
    const unsigned i = s->index;
    if (i < s->width) {
        filter(s, i); /* decides by the bit that the last look stored */
        const bool level = s->multiplexed ? s->sampled : level_at(s, i);
        s->raw = (s->raw & ~(1u << i)) | (uint32_t)level << i;
    }
    s->sampled = s->data;
    s->index = s->address;
    s->address = s->address ? (uint8_t)(s->address - 1u) : (uint8_t)MAX_BIT(s->control);
    s->ticks_left = (uint16_t)DIVISOR(s->control);
}

/* The glitch filter of InMux: an up/down counter to 7 on every clock. */
static void glitch_edge(struct scanner *const s, const bool level)
{
    const uint8_t old = s->glitch;
    if (s->data_late && old < GLITCH_TOP)
        s->glitch++;
    else if (!s->data_late && old > 0)
        s->glitch--;
    if (old == 0)
        s->data = false;
    else if (old == GLITCH_TOP)
        s->data = true;
    s->data_late = level;
}

static void glitch_run(struct scanner *const s, const int64_t edges)
{
    const bool level = level_at(s, s->address);
    for (int64_t i = 0; i < edges && i < (int64_t)GLITCH_EDGES + 1; i++)
        glitch_edge(s, level);
}

static void edge(struct scanner *const s)
{
    const bool tick = (s->clk - s->start) % PRESCALE == 0;
    const bool level = level_at(s, s->address);
    mpg_edge(s);
    if (tick && s->ticks_left > 0)
        s->ticks_left--;
    else if (tick)
        look(s);
    if (s->multiplexed)
        glitch_edge(s, level);
    s->clk++;
}

/* Edges without a look. */
static void pass(struct scanner *const s, const int64_t clk)
{
    if (clk <= s->clk)
        return;
    mpg_edge(s);
    const int64_t first = next_tick(s);
    if (first < clk)
        s->ticks_left = (uint16_t)(s->ticks_left - ((clk - 1 - first) / PRESCALE + 1));
    if (s->multiplexed)
        glitch_run(s, clk - s->clk);
    s->clk = clk;
}

/* ---- quiet time
 * -------------------------------------------------------------------------------------------------------------- */

static bool input_settled(const struct scanner *const s, const unsigned i)
{
    const bool level = level_at(s, i);
    const bool filtered = s->filtered >> i & 1u;
    if (level != ((s->raw >> i & 1u) != 0))
        return false;
    if (!level)
        return s->counts[i] == 0 && !filtered;
    const bool slow = s->slow >> i & 1u;
    const uint32_t limit = slow ? SLOW_COUNT(s->control) : FAST_COUNT(s->control);
    return s->counts[i] >= limit && (filtered || (slow && s->counts[i] > limit));
}

/* All inputs of the multiplexer have one level, which is through the glitch filter. */
static bool data_is_constant(const struct scanner *const s)
{
    const uint32_t seen = levels(s) & width_mask(s);
    const bool level = seen != 0;
    return (!level || seen == width_mask(s)) && s->data_late == level && s->data == level && s->sampled == level &&
           s->glitch == (level ? GLITCH_TOP : 0);
}

/* What each look takes is the level of its input: the data is through the glitch filter before the look, or it is
 * always the same. */
static bool data_is_in_time(const struct scanner *const s)
{
    const bool slow = look_period(s) > (int64_t)GLITCH_EDGES + 1;
    return (slow && s->sampled == level_at(s, s->index) && s->data == level_at(s, s->address)) || data_is_constant(s);
}

/* Looks change nothing any more. */
static bool settled(const struct scanner *const s)
{
    if (s->multiplexed && !data_is_in_time(s))
        return false;
    for (unsigned i = 0; i < s->width; i++)
        if (!input_settled(s, i))
            return false;
    return s->mpg_seen == (uint8_t)s->filtered;
}

/* Leave out n looks that change nothing but what is next. The scanner stands at a look. */
static void skip_looks(struct scanner *const s, const int64_t n)
{
    const unsigned cycle = MAX_BIT(s->control) + 1u;
    const unsigned steps = (unsigned)((n - 1) % cycle);
    s->index = (uint8_t)((s->address + cycle - steps) % cycle);
    s->address = (uint8_t)((s->index + cycle - 1) % cycle);
    s->clk += (n - 1) * look_period(s) + 1;
    s->ticks_left = (uint16_t)DIVISOR(s->control);
    if (!s->multiplexed)
        return;
    s->data = s->sampled = s->data_late = level_at(s, s->index);
    s->glitch = s->data ? GLITCH_TOP : 0;
}

void scan_advance(struct scanner *const s, const int64_t clk)
{
    unsigned before_check = 0;
    while (s->clk < clk) {
        const int64_t at = scan_next_look(s);
        if (at >= clk) {
            pass(s, clk);
            return;
        }
        pass(s, at);
        const int64_t looks = (clk - 1 - at) / look_period(s) + 1;
        if (before_check > 0 || looks <= (int64_t)s->width) {
            before_check -= before_check > 0;
            edge(s);
            continue;
        }
        before_check = s->width; /* it costs as much as some looks, so it is made once a round */
        if (settled(s))
            skip_looks(s, looks);
        else
            edge(s);
    }
}

/* ---- registers
 * ------------------------------------------------------------------------------------------------------------------ */

void scan_write(struct scanner *const s, const unsigned page, const uint32_t value)
{
    edge(s);
    if (page == PAGE_CONTROL)
        s->control = (value & ~MAX_BIT_MASK) | (s->control & MAX_BIT_MASK);
    else if (page == PAGE_SLOW)
        s->slow = value & width_mask(s);
    else if (page == PAGE_MPG)
        s->mpg_mode = (uint8_t)((value & 1u) | (value >> 7 & 2u) | (value >> 14 & 4u) | (value >> 21 & 8u));
}

static unsigned mpgs(const struct scanner *const s)
{
    return s->multiplexed || s->width / 2 > SCAN_MPGS ? SCAN_MPGS : s->width / 2;
}

uint32_t scan_read(const struct scanner *const s, const unsigned page, uint32_t *const undriven)
{
    *undriven = 0;
    switch (page) {
    case PAGE_CONTROL:
        return s->control;
    case PAGE_SLOW:
        return s->slow;
    case PAGE_FILTERED:
        return s->filtered;
    case PAGE_RAW:
        return s->raw;
    case PAGE_MPG:
        *undriven = mpgs(s) >= SCAN_MPGS ? 0 : UINT32_MAX << 8 * mpgs(s);
        return (uint32_t)s->mpg[3] << 24 | (uint32_t)s->mpg[2] << 16 | (uint32_t)s->mpg[1] << 8 | s->mpg[0];
    default:
        *undriven = UINT32_MAX;
        return 0;
    }
}
