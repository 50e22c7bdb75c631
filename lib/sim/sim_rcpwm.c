/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* RCPWM, tag 2C: pulses for RC servos (register map 3.20). Frames of all servos begin together; a width or a frame rate
 * acts at once. */
#include "sim_card.h"

#define INSTANCES_MAX 64u
#define WIDTH_MASK    0x1FFFFu
#define NO_PULSE      0x10000u
#define STEP_CLK      16
#define PIN_PULSE     0x81u
#define DEFAULT_HZ    50u

enum { PAGE_WIDTH, PAGE_RATE, PAGES };

struct rcpwm {
    unsigned count;
    uint32_t divisor;
    int64_t frame_clk; /* first edge of the present frame */
    uint32_t widths[INSTANCES_MAX];
};

static int64_t frame_length(const struct rcpwm *const s)
{
    return (int64_t)s->divisor + 2;
}

static int init(struct sim_module *const m)
{
    struct rcpwm *const s = m->state;
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct rcpwm *const s = m->state;
    s->divisor = sim_clock_low_hz(m->card) / DEFAULT_HZ - 2u;
    s->frame_clk = m->clk;
    for (unsigned i = 0; i < s->count; i++)
        s->widths[i] = 0;
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct rcpwm *const s = m->state;
    s->frame_clk += (clk - s->frame_clk) / frame_length(s) * frame_length(s);
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct rcpwm *const s = m->state;
    if (page == PAGE_RATE)
        s->divisor = value & INT32_MAX;
    else if (page == PAGE_WIDTH && low / 4 < s->count)
        s->widths[low / 4] = value & WIDTH_MASK;
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    (void)m;
    (void)page;
    (void)low;
    *undriven = UINT32_MAX;
    return 0;
}

static int64_t pulse_clk(const struct rcpwm *const s, const unsigned unit)
{
    return s->widths[unit] & NO_PULSE ? 0 : ((int64_t)s->widths[unit] + 1) * STEP_CLK;
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct rcpwm *const s = m->state;
    return unit < s->count && pin == PIN_PULSE && m->clk - s->frame_clk < pulse_clk(s, unit) ? SIM_HIGH : SIM_LOW;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct rcpwm *const s = m->state;
    int64_t event = s->frame_clk + frame_length(s) - 1;
    for (unsigned i = 0; i < s->count; i++) {
        const int64_t end = s->frame_clk + pulse_clk(s, i) - 1;
        if (end >= m->clk && end < event)
            event = end;
    }
    return event > m->clk ? event : m->clk;
}

const struct sim_module_ops sim_rcpwm_ops = {
    .gtag = HM2_GTAG_RCPWM,
    .name = "RCPWM",
    .pages = PAGES,
    .state_size = sizeof(struct rcpwm),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .next_event = next_event,
};
