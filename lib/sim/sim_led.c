/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* LED (register map 3.3): one write-only register for the lamps of the card, on every address of its page. */
#include "sim_card.h"

#define LEDS 4u /* every card simulated here has four */

struct leds {
    uint32_t value;
};

static void power_up(struct sim_module *const m)
{
    ((struct leds *)m->state)->value = 0;
}

static uint32_t read_reg(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    (void)m;
    (void)page;
    (void)low;
    *undriven = UINT32_MAX;
    return 0;
}

static void write_reg(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    (void)page;
    (void)low;
    ((struct leds *)m->state)->value = value;
}

/* Unit = lamp. Left-justified in the register, bit 31 is the last lamp; a lit one pulls its output low. */
static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t secondary_pin)
{
    (void)secondary_pin;
    const struct leds *const s = m->state;
    if (unit >= LEDS)
        return SIM_HIGH;
    return s->value >> (32 - LEDS + unit) & 1u ? SIM_LOW : SIM_HIGH;
}

const struct sim_module_ops sim_led_ops = {
    .gtag = HM2_GTAG_LED,
    .name = "LED",
    .pages = 1,
    .state_size = sizeof(struct leds),
    .power_up = power_up,
    .read = read_reg,
    .write = write_reg,
    .output = output,
};
