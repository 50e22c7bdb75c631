/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * SSR, tag C3: solid-state relays behind transformers. An output is on while it toggles against the reference, and off
 * while it goes with it (register map 3.16).
 */
#include "sim_card.h"
#include "sim_qcounter.h"

#define INSTANCES_MAX 16u /* address bits 5..2 select the instance (1.1) */
#define PIN_FIRST     0x81u
#define PIN_LAST      0xA0u /* the reference: index 31 */
#define RATE_MASK     0xFFFu
#define RATE_TOP_BIT  0x800u
#define RATE_ENABLE   0x1000u
#define RATE_BITS     0x1FFFu
#define DEFAULT_HZ    1000000u /* after configuration (3.16) */

enum { PAGE_DATA, PAGE_RATE, PAGES };

struct relay {
    uint32_t data, rate;
    struct sim_divider divider;
    bool drive; /* as it was before edge since */
    int64_t since;
};

struct relays {
    unsigned count;
    struct relay relays[INSTANCES_MAX];
};

static int init(struct sim_module *const m)
{
    struct relays *const s = m->state;
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct relays *const s = m->state;
    const uint32_t divider = sim_clock_low_hz(m->card) / (2 * DEFAULT_HZ);
    for (unsigned i = 0; i < s->count; i++) {
        s->relays[i] = (struct relay){.rate = divider > 2 ? (divider - 2) & RATE_MASK : 0, .since = m->clk};
        sim_divider_start(&s->relays[i].divider, m->clk, s->relays[i].rate, RATE_TOP_BIT);
    }
}

/* The drive bit before edge clk: it turns at every tick while it is enabled. */
static bool drive_at(const struct relay *const r, const int64_t clk)
{
    if (!(r->rate & RATE_ENABLE))
        return r->drive && clk <= r->since;
    return r->drive != ((sim_divider_count(&r->divider, r->since, clk) & 1) != 0);
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct relays *const s = m->state;
    const unsigned i = low / 4 % INSTANCES_MAX;
    *undriven = i < s->count ? 0 : UINT32_MAX;
    if (i >= s->count)
        return 0;
    return page == PAGE_DATA ? s->relays[i].data : s->relays[i].rate;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct relays *const s = m->state;
    const unsigned i = low / 4 % INSTANCES_MAX;
    if (i >= s->count)
        return;
    struct relay *const r = &s->relays[i];
    if (page == PAGE_DATA) {
        r->data = value;
        return;
    }
    r->drive = drive_at(r, m->clk + 1); /* the edge of the write is made with the old setting */
    r->since = m->clk + 1;
    r->rate = value & RATE_BITS;
    sim_divider_write(&r->divider, m->clk, value & RATE_MASK, RATE_TOP_BIT);
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct relays *const s = m->state;
    if (unit >= s->count || pin < PIN_FIRST || pin > PIN_LAST)
        return SIM_LOW;
    const struct relay *const r = &s->relays[unit];
    const bool on = pin != PIN_LAST && (r->data >> (pin - PIN_FIRST) & 1u);
    return drive_at(r, m->clk) != on ? SIM_HIGH : SIM_LOW;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct relays *const s = m->state;
    int64_t first = SIM_NEVER;
    for (unsigned i = 0; i < s->count; i++) {
        const struct relay *const r = &s->relays[i];
        int64_t event = SIM_NEVER;
        if (r->rate & RATE_ENABLE)
            event = sim_divider_tick(&r->divider, m->clk);
        else if (r->drive && m->clk <= r->since)
            event = m->clk;
        first = event < first ? event : first;
    }
    return first;
}

const struct sim_module_ops sim_ssr_ops = {
    .gtag = HM2_GTAG_SSR,
    .name = "SSR",
    .pages = PAGES,
    .state_size = sizeof(struct relays),
    .init = init,
    .power_up = power_up,
    .read = read,
    .write = write,
    .output = output,
    .next_event = next_event,
};
