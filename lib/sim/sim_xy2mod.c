/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* XY2Mod, tag 2B: the registers of galvanometer interfaces (register map 3.20). The frames themselves, and what the
 * DPLL's timers delay, are not simulated: values written act and are read at once. */
#include "sim_card.h"

#define INSTANCES_MAX 64u
#define AXES          2u
#define VELOCITY_CLK  256
#define ACCEL_CLK     4096
#define POSITION_MAX  2147418112
#define VELOCITY_MAX  1073741823
#define OVERFLOW_POS  0x040u /* Y is one bit higher */
#define OVERFLOW_VEL  0x100u
#define OVERFLOWS     0x3C0u
#define MODE_MASK     0x3C3Fu
#define TIMER_MASK    0xF000u

enum {
    PAGE_ACC = 0,
    PAGE_VEL = 2,
    PAGE_POS = 4,
    PAGE_MODE = 6,
    PAGE_COMMAND,
    PAGE_STATUS,
    PAGE_READ_TIMER,
    PAGES = 11
};

struct galvo {
    int32_t acceleration[AXES], velocity[AXES], position[AXES];
    uint32_t mode, command;
};

struct xy2mod {
    unsigned count;
    uint32_t timers[2];
    struct galvo galvos[INSTANCES_MAX];
};

/* So many additions of step; those that would leave the range are not made. */
static int32_t add(const int32_t value, const int32_t step, const int64_t times, const int64_t limit,
                   bool *const overflow)
{
    if (step == 0 || times == 0)
        return value;
    const int64_t room = step > 0 ? (limit - value) / step : (-limit - value) / step;
    *overflow = times > room;
    return (int32_t)(value + step * (times < room ? times : room < 0 ? 0 : room));
}

static void move(struct galvo *const g, const unsigned a, const int64_t times)
{
    bool overflow = false;
    g->position[a] = add(g->position[a], g->velocity[a], times, POSITION_MAX, &overflow);
    g->mode |= overflow ? OVERFLOW_POS << a : 0;
}

static void accelerate(struct galvo *const g, const unsigned a, const int64_t times)
{
    bool overflow = false;
    g->velocity[a] = add(g->velocity[a], g->acceleration[a], times, VELOCITY_MAX, &overflow);
    g->mode |= overflow ? OVERFLOW_VEL << a : 0;
}

/* From one addition of the acceleration to the next; without one, everything at once. */
static void run(struct galvo *const g, const unsigned a, int64_t clk, const int64_t to)
{
    while (clk < to) {
        const int64_t next = clk / ACCEL_CLK * ACCEL_CLK + ACCEL_CLK;
        const int64_t end = g->acceleration[a] && next < to ? next : to;
        move(g, a, end / VELOCITY_CLK - clk / VELOCITY_CLK);
        if (g->acceleration[a])
            accelerate(g, a, end / ACCEL_CLK - clk / ACCEL_CLK);
        clk = end;
    }
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct xy2mod *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        for (unsigned a = 0; a < AXES; a++)
            run(&s->galvos[i], a, m->clk, clk);
}

static int init(struct sim_module *const m)
{
    struct xy2mod *const s = m->state;
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct xy2mod *const s = m->state;
    s->timers[0] = s->timers[1] = 0;
    for (unsigned i = 0; i < s->count; i++)
        s->galvos[i] = (struct galvo){0};
}

static int32_t *value_at(struct galvo *const g, const unsigned page)
{
    const unsigned a = page % AXES;
    return page < PAGE_VEL ? &g->acceleration[a] : page < PAGE_POS ? &g->velocity[a] : &g->position[a];
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct xy2mod *const s = m->state;
    if (page >= PAGE_READ_TIMER && page < PAGES)
        return s->timers[page - PAGE_READ_TIMER];
    if (low / 4 >= s->count || page >= PAGES) {
        *undriven = UINT32_MAX;
        return 0;
    }
    struct galvo *const g = &s->galvos[low / 4];
    if (page < PAGE_MODE)
        return (uint32_t)*value_at(g, page);
    return page == PAGE_MODE ? g->mode : page == PAGE_COMMAND ? g->command : 0;
}

static int32_t clamped(const int32_t value, const int32_t limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct xy2mod *const s = m->state;
    if (page >= PAGE_READ_TIMER && page < PAGES)
        s->timers[page - PAGE_READ_TIMER] = value & TIMER_MASK;
    if (low / 4 >= s->count || page >= PAGE_STATUS)
        return;
    struct galvo *const g = &s->galvos[low / 4];
    if (page < PAGE_POS)
        *value_at(g, page) = (int32_t)value;
    else if (page < PAGE_MODE)
        *value_at(g, page) = clamped((int32_t)value, POSITION_MAX);
    else if (page == PAGE_MODE) /* ones clear the overflow flags */
        g->mode = (value & MODE_MASK) | (g->mode & OVERFLOWS & ~value);
    else
        g->command = value;
}

const struct sim_module_ops sim_xy2mod_ops = {
    .gtag = HM2_GTAG_XY2MOD,
    .name = "XY2Mod",
    .pages = PAGES,
    .state_size = sizeof(struct xy2mod),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
};
