/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Tally, tag E0, of the simulated card; see tally.c. Written from the firmware, not from the driver. */
#include "sim_card.h"
#include "tally.h"

#define INSTANCES   64u
#define PIN_INPUT   0x01u
#define PIN_REACHED 0x81u

enum { PAGE_COUNT, PAGE_LIMIT, PAGES };

struct tallies {
    struct {
        uint32_t count, limit;
        bool level;
    } tally[INSTANCES];
};

static void power_up(struct sim_module *const m)
{
    struct tallies *const s = m->state;
    *s = (struct tallies){0};
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct tallies *const s = m->state;
    if (page == PAGE_COUNT && low / 4 < m->md.instances)
        return s->tally[low / 4].count;
    *undriven = UINT32_MAX;
    return 0;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct tallies *const s = m->state;
    if (page == PAGE_LIMIT)
        s->tally[low / 4].limit = value; /* low is below 0x100 */
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct tallies *const s = m->state;
    if (pin != PIN_INPUT || unit >= INSTANCES)
        return;
    s->tally[unit].count += level && !s->tally[unit].level;
    s->tally[unit].level = level;
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct tallies *const s = m->state;
    const bool high = pin == PIN_REACHED && unit < INSTANCES && s->tally[unit].count >= s->tally[unit].limit;
    return high ? SIM_HIGH : SIM_LOW;
}

const struct sim_module_ops sim_tally_ops = {
    .gtag = GTAG_TALLY,
    .name = "Tally",
    .pages = PAGES,
    .state_size = sizeof(struct tallies),
    .power_up = power_up,
    .read = read,
    .write = write,
    .input = input,
    .output = output,
};
