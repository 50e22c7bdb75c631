/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Watchdog (register map 3.2, README of tests/data/watchdog). */
#include "map.h"
#include "sim_card.h"

enum { REG_TIME, REG_STATUS, REG_COOKIE, REGS };

#define STOPPED     0x80000000u /* bit 31 of the counter: it stands still */
#define COOKIE      0x5Au       /* bits 31..24; the others are not looked at */
#define COOKIE_BITS 24

struct watchdog {
    uint32_t count, time;
    bool status;
    bool was_stopped; /* bit 31 of the counter, one edge ago */
    bool biting;      /* outputs go at the next edge */
};

static bool stopped(const struct watchdog *const s)
{
    return s->count & STOPPED;
}

/* Edges before the first one that is more than counting down; INT64_MAX = all of them. */
static int64_t quiet_edges(const struct watchdog *const s)
{
    if (s->biting || (stopped(s) && !s->was_stopped))
        return 0;
    return stopped(s) ? INT64_MAX : (int64_t)s->count + 1;
}

static void run_quiet(struct watchdog *const s, const int64_t edges)
{
    if (edges <= 0)
        return;
    const bool counting = !stopped(s);
    if (counting)
        s->count -= (uint32_t)edges; /* quiet_edges() ends with the edge that makes it 0xFFFFFFFF */
    s->was_stopped = !counting;
}

static void edge(struct sim_module *const m)
{
    struct watchdog *const s = m->state;
    const bool clears = s->biting;
    s->biting = stopped(s) && !s->was_stopped;
    s->was_stopped = stopped(s);
    if (s->biting)
        s->status = true;
    if (!stopped(s))
        s->count--;
    if (clears)
        sim_bite(m->card);
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct watchdog *const s = m->state;
    while (m->clk < clk) {
        const int64_t left = clk - m->clk;
        const int64_t quiet = quiet_edges(s);
        const int64_t edges = quiet < left ? quiet : left;
        if (edges > 0) {
            run_quiet(s, edges);
            m->clk += edges;
        } else {
            edge(m);
            m->clk++;
        }
    }
}

static int64_t next_event(struct sim_module *const m)
{
    const struct watchdog *const s = m->state;
    if (s->biting)
        return m->clk;
    if (stopped(s))
        return s->was_stopped ? SIM_NEVER : m->clk + 1;
    return m->clk + s->count + 2;
}

static uint32_t read_reg(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct watchdog *const s = m->state;
    (void)low;
    if (page == REG_TIME)
        return s->count;
    if (page == REG_STATUS)
        return s->status;
    *undriven = UINT32_MAX;
    return 0;
}

/* What is written counts from this edge on, but a bite at the same edge still sets the status. */
static void write_reg(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct watchdog *const s = m->state;
    (void)low;
    if (page == REG_STATUS)
        s->status = value & 1u;
    edge(m);
    if (page == REG_TIME)
        s->count = s->time = value;
    if (page == REG_COOKIE && value >> COOKIE_BITS == COOKIE)
        s->count = s->time;
    m->clk++;
}

static int init(struct sim_module *const m)
{
    sim_watch_module(m); /* its bite changes pads */
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct watchdog *const s = m->state;
    /* The edge detector of the older firmware starts at 0 and sees one bite at the first edge; the newer one does not.
     */
    *s = (struct watchdog){.count = STOPPED, .was_stopped = sim_map_is_new(sim_idrom(m->card))};
}

const struct sim_module_ops sim_watchdog_ops = {
    .gtag = HM2_GTAG_WATCHDOG,
    .name = "Watchdog",
    .pages = REGS,
    .state_size = sizeof(struct watchdog),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read_reg,
    .write = write_reg,
    .next_event = next_event,
};
