/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Simple SPI, tag 07: a word written is sent at once (register map 3.11; traces tests/data/spi). */
#include "bus_clock.h"
#include "sim_card.h"
#include "spi_shifter.h"

#define INSTANCES_MAX 16u
#define MODE_BITS     0x1FFu
#define MODE_DONE     (1u << 31)
#define RATE_BITS     0xFFu
#define PIN_FRAME     0x81u
#define PIN_MOSI      0x82u
#define PIN_SCLK      0x83u
#define PIN_MISO      0x04u

enum { PAGE_DATA, PAGE_MODE, PAGE_RATE, PAGES };

struct port {
    uint32_t mode;
    bool done;
    struct spi_shifter shifter;
};

struct ports {
    unsigned count;
    struct port port[INSTANCES_MAX];
};

static int64_t quiet(const void *const instance)
{
    const struct port *const p = instance;
    return p->shifter.busy ? p->shifter.ticks : SIM_NEVER;
}

static void skip(void *const instance, const int64_t edges)
{
    struct port *const p = instance;
    if (p->shifter.busy)
        p->shifter.ticks = (uint8_t)(p->shifter.ticks - edges);
}

static void edge(void *const instance)
{
    struct port *const p = instance;
    if (spi_shifter_edge(&p->shifter))
        p->done = true;
}

static const struct sim_stepper stepper = {quiet, skip, edge};

static int init(struct sim_module *const m)
{
    struct ports *const s = m->state;
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct ports *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        s->port[i] = (struct port){.shifter.input = s->port[i].shifter.input};
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct ports *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        sim_step_to(&stepper, &s->port[i], m->clk, clk);
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct ports *const s = m->state;
    const unsigned i = low / 4u % INSTANCES_MAX;
    *undriven = UINT32_MAX;
    if (i >= s->count)
        return 0;
    const struct port *const p = &s->port[i];
    if (page == PAGE_DATA) {
        *undriven = 0;
        return p->shifter.word;
    }
    if (page == PAGE_MODE) {
        *undriven = ~(MODE_BITS | MODE_DONE);
        return p->mode | (p->done ? MODE_DONE : 0);
    }
    *undriven = ~RATE_BITS;
    return p->shifter.divider;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct ports *const s = m->state;
    const unsigned i = low / 4u % INSTANCES_MAX;
    advance(m, m->clk + 1); /* the edge of the write is made with what was there before */
    m->clk++;
    if (i >= s->count)
        return;
    struct port *const p = &s->port[i];
    if (page == PAGE_DATA) {
        p->done = false;
        spi_shifter_start(&p->shifter, value);
    } else if (page == PAGE_MODE) {
        p->mode = value & MODE_BITS;
        p->shifter.bits = value & 0x3Fu;
        p->shifter.cpol = (value & 1u << 6) != 0;
        p->shifter.cpha = (value & 1u << 7) != 0;
        p->shifter.keep_frame = (value & 1u << 8) != 0;
    } else {
        p->shifter.divider = (uint8_t)(value & RATE_BITS);
    }
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct ports *const s = m->state;
    if (unit >= s->count)
        return SIM_LOW;
    const struct spi_shifter *const shifter = &s->port[unit].shifter;
    const bool level = pin == PIN_FRAME  ? !shifter->frame
                       : pin == PIN_MOSI ? spi_shifter_mosi(shifter)
                                         : pin == PIN_SCLK && shifter->clock != shifter->cpol;
    return level ? SIM_HIGH : SIM_LOW;
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct ports *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        if (pin == PIN_MISO && (i == unit || unit == HM2_UNIT_GLOBAL))
            s->port[i].shifter.input = level;
}

static int64_t next_event(struct sim_module *const m)
{
    const struct ports *const s = m->state;
    int64_t first = SIM_NEVER;
    for (unsigned i = 0; i < s->count; i++)
        if (s->port[i].shifter.busy && m->clk + s->port[i].shifter.ticks < first)
            first = m->clk + s->port[i].shifter.ticks;
    return first;
}

const struct sim_module_ops sim_spi_ops = {
    .gtag = HM2_GTAG_SPI,
    .name = "SPI",
    .pages = PAGES,
    .state_size = sizeof(struct ports),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .input = input,
    .next_event = next_event,
};
