/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * InM, tag 23, and InMux, tag 1E: filtered inputs, each with a pin of its own or behind multiplexers (register map
 * 3.17). InM: pins 01..20 are inputs 0..31. InMux: pin 01 is the data, pins 81..85 the address; pins 40..5F are inputs
 * 0..31 behind a multiplexer without delay.
 */
#include "scan_logic.h"
#include "sim_card.h"

#define INSTANCES_MAX 64u
#define PAGES         5u
#define PIN_DATA      0x01u
#define PIN_ADDRESS   0x81u
#define ADDRESS_BITS  5u
#define OUTSIDE       0x40u

struct scanners {
    unsigned count;
    struct scanner scanners[INSTANCES_MAX];
};

/* The width is not in the descriptor: of InM the highest input pin tells it, of InMux the address pins. */
static unsigned width_of(const struct sim_module *const m, const unsigned unit)
{
    const struct hm2_idrom *const idrom = sim_idrom(m->card);
    const bool multiplexed = m->ops->gtag == HM2_GTAG_INMUX;
    unsigned width = 0;
    for (unsigned i = 0; i < idrom->pin_count; i++) {
        const struct hm2_pd *const pd = &idrom->pins[i];
        if (pd->secondary_tag != m->ops->gtag || pd->secondary_unit != unit)
            continue;
        const unsigned pin = pd->secondary_pin;
        unsigned seen = 0;
        if (!multiplexed && pin >= 1 && pin <= SCAN_INPUTS)
            seen = pin;
        else if (multiplexed && pin >= PIN_ADDRESS && pin < PIN_ADDRESS + ADDRESS_BITS)
            seen = 2u << (pin - PIN_ADDRESS);
        width = seen > width ? seen : width;
    }
    return width > 0 ? width : SCAN_INPUTS;
}

static int init(struct sim_module *const m)
{
    struct scanners *const s = m->state;
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    for (unsigned i = 0; i < s->count; i++) {
        s->scanners[i].width = width_of(m, i);
        s->scanners[i].multiplexed = m->ops->gtag == HM2_GTAG_INMUX;
    }
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct scanners *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        scan_power_up(&s->scanners[i], m->clk);
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct scanners *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        scan_advance(&s->scanners[i], clk);
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct scanners *const s = m->state;
    if (low / 4 < s->count)
        return scan_read(&s->scanners[low / 4], page, undriven);
    *undriven = UINT32_MAX;
    return 0;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct scanners *const s = m->state;
    if (low / 4 < s->count)
        scan_write(&s->scanners[low / 4], page, value);
}

static void set_input(struct scanner *const s, const unsigned input, const bool level)
{
    s->outside = (s->outside & ~(1u << input)) | (uint32_t)level << input;
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct scanners *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        if (i != unit && unit < HM2_UNIT_GLOBAL)
            continue;
        struct scanner *const scanner = &s->scanners[i];
        if (!scanner->multiplexed && pin >= 1 && pin <= SCAN_INPUTS)
            set_input(scanner, pin - 1u, level);
        else if (scanner->multiplexed && pin >= OUTSIDE && pin < OUTSIDE + SCAN_INPUTS)
            set_input(scanner, pin - OUTSIDE, level);
        else if (scanner->multiplexed && pin == PIN_DATA)
            scanner->outside = level ? UINT32_MAX : 0; /* no multiplexer: the pin is what it is at every address */
    }
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct scanners *const s = m->state;
    if (unit >= s->count || pin < PIN_ADDRESS || pin >= PIN_ADDRESS + ADDRESS_BITS)
        return SIM_LOW;
    return s->scanners[unit].address >> (pin - PIN_ADDRESS) & 1u ? SIM_HIGH : SIM_LOW;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct scanners *const s = m->state;
    int64_t first = SIM_NEVER;
    for (unsigned i = 0; i < s->count; i++) {
        const int64_t look = scan_next_look(&s->scanners[i]);
        first = look < first ? look : first;
    }
    return first;
}

const struct sim_module_ops sim_inm_ops = {
    .gtag = HM2_GTAG_INM,
    .name = "InM",
    .pages = PAGES,
    .state_size = sizeof(struct scanners),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .input = input,
};

const struct sim_module_ops sim_inmux_ops = {
    .gtag = HM2_GTAG_INMUX,
    .name = "InMux",
    .pages = PAGES,
    .state_size = sizeof(struct scanners),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .input = input,
    .next_event = next_event,
};
