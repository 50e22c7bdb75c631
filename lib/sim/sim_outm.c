/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* OutM, tag 2D: plain outputs that the watchdog clears (register map 3.18). */
#include "sim_card.h"

#define INSTANCES_MAX 16u /* address bits 5..2 select the instance (1.1) */
#define PIN_FIRST     0x81u
#define PIN_LAST      0xA0u

struct outputs {
    unsigned count;
    uint32_t data[INSTANCES_MAX];
};

static int init(struct sim_module *const m)
{
    struct outputs *const o = m->state;
    o->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    return 0;
}

static void clear(struct sim_module *const m)
{
    struct outputs *const o = m->state;
    for (unsigned i = 0; i < INSTANCES_MAX; i++)
        o->data[i] = 0;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct outputs *const o = m->state;
    const unsigned i = low / 4 % INSTANCES_MAX;
    if (page == 0 && i < o->count)
        o->data[i] = value;
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct outputs *const o = m->state;
    if (unit >= o->count || pin < PIN_FIRST || pin > PIN_LAST)
        return SIM_LOW;
    return o->data[unit] >> (pin - PIN_FIRST) & 1u ? SIM_HIGH : SIM_LOW;
}

const struct sim_module_ops sim_outm_ops = {
    .gtag = HM2_GTAG_OUTM,
    .name = "OutM",
    .pages = 1,
    .state_size = sizeof(struct outputs),
    .init = init,
    .power_up = clear,
    .write = write,
    .output = output,
    .bite = clear,
};
