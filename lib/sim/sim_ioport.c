/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* IOPort (register map 3.1, README of tests/data/ioport): what the card drives on its pads, and what it reads there. */
#include "sim_card.h"

#define PORTS_MAX 8u /* address bits 4..2 select the port (1.1) */

enum { REG_DATA, REG_DDR, REG_ALT_SOURCE, REG_OPEN_DRAIN, REG_INVERT, REGS };

struct ports {
    unsigned count, width;
    uint32_t mask; /* the bits that exist */
    uint32_t reg[PORTS_MAX][REGS];
};

static unsigned at_most(const uint32_t value, const unsigned limit)
{
    return value < limit ? (unsigned)value : limit;
}

static int init(struct sim_module *const m)
{
    struct ports *const s = m->state;
    const struct hm2_idrom *const idrom = sim_idrom(m->card);
    /* The header's count is what the firmware builds; a descriptor may say another (7I77E_51). */
    s->count = at_most(idrom->io_ports, PORTS_MAX);
    s->width = at_most(idrom->port_width, 32);
    s->mask = s->width < 32 ? (UINT32_C(1) << s->width) - 1 : UINT32_MAX;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct ports *const s = m->state;
    for (unsigned port = 0; port < PORTS_MAX; port++)
        for (unsigned reg = 0; reg < REGS; reg++)
            s->reg[port][reg] = 0;
}

static unsigned port_of(const unsigned low)
{
    return low / 4 % PORTS_MAX;
}

/* The data register reads the pads, not the latch; bits beyond the port are driven low. */
static uint32_t read_pads(struct sim_module *const m, const unsigned port, uint32_t *const undriven)
{
    const struct ports *const s = m->state;
    const uint32_t driven = s->reg[port][REG_DDR] | s->reg[port][REG_OPEN_DRAIN];
    uint32_t value = 0;
    for (unsigned bit = 0; bit < s->width; bit++) {
        const unsigned io = port * s->width + bit;
        const enum sim_level level = driven >> bit & 1u ? sim_pad_level(m->card, io) : sim_pad_outside(m->card, io);
        if (level == SIM_FLOAT)
            *undriven |= UINT32_C(1) << bit;
        else if (level != SIM_LOW)
            value |= UINT32_C(1) << bit;
    }
    return value;
}

static uint32_t read_reg(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct ports *const s = m->state;
    const unsigned port = port_of(low);
    if (port < s->count && page == REG_DATA)
        return read_pads(m, port, undriven);
    if (port < s->count && page == REG_DDR)
        return s->reg[port][REG_DDR];
    *undriven = UINT32_MAX; /* write-only, or no such port */
    return 0;
}

static void write_reg(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct ports *const s = m->state;
    const unsigned port = port_of(low);
    if (port >= s->count || page >= REGS || s->reg[port][page] == (value & s->mask))
        return;
    s->reg[port][page] = value & s->mask;
    sim_pads_changed(m->card);
}

/* What the card drives on a pad. Open drain wins over DDR; the inversion comes before both. */
static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t secondary_pin)
{
    const struct ports *const s = m->state;
    const unsigned bit = secondary_pin & 0x7Fu;
    if (unit >= s->count || bit >= s->width)
        return SIM_FLOAT;
    const uint32_t *const reg = s->reg[unit];
    const bool drain = reg[REG_OPEN_DRAIN] >> bit & 1u;
    if (!drain && !(reg[REG_DDR] >> bit & 1u))
        return SIM_FLOAT;
    const bool source = reg[REG_ALT_SOURCE] >> bit & 1u ? sim_alternate(m->card, unit * s->width + bit) == SIM_HIGH
                                                        : reg[REG_DATA] >> bit & 1u;
    const bool level = source != (reg[REG_INVERT] >> bit & 1u);
    if (drain)
        return level ? SIM_FLOAT : SIM_LOW;
    return level ? SIM_HIGH : SIM_LOW;
}

static void bite(struct sim_module *const m)
{
    struct ports *const s = m->state;
    for (unsigned port = 0; port < s->count; port++)
        s->reg[port][REG_DDR] = s->reg[port][REG_OPEN_DRAIN] = 0;
}

const struct sim_module_ops sim_ioport_ops = {
    .gtag = HM2_GTAG_IOPORT,
    .name = "IOPort",
    .pages = REGS,
    .state_size = sizeof(struct ports),
    .init = init,
    .power_up = power_up,
    .read = read_reg,
    .write = write_reg,
    .output = output,
    .bite = bite,
};
