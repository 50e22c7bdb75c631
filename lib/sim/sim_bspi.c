/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * BSPI (tag 0E) and DBSPI (0F): SPI with a FIFO each way and sixteen descriptors of how a word is sent; the address
 * that a word is written to chooses one (register map 3.10; traces tests/data/bspi, tests/data/dbspi). With DBSPI the
 * chip selects are decoded and take the place of the frame.
 */
#include "bus_clock.h"
#include "sim_card.h"
#include "spi_shifter.h"
#include "srl_fifo.h"

#define INSTANCES_MAX 4u /* FIFOs lie 0x40 apart within a page */
#define CHANNELS      16u
#define TIMER_DONE    0x10u
#define TIMER_MASK    0x1Fu
#define PIN_FRAME     0x81u
#define PIN_MOSI      0x82u
#define PIN_SCLK      0x83u
#define PIN_MISO      0x04u
#define PIN_CS0       0x85u
#define SELECTS       12u
#define CHANNEL_SHIFT 32
#define SELECT_SHIFT  16

/* Descriptor. */
#define D_BITS       0x3Fu
#define D_CPOL       (1u << 6)
#define D_CPHA       (1u << 7)
#define D_LATE       (1u << 29)
#define D_KEEP_FRAME (1u << 30)
#define D_NO_ECHO    (1u << 31)

enum { PAGE_FIFO, PAGE_DESCRIPTORS, PAGE_COUNT, PAGES };

struct port {
    uint32_t descriptor[CHANNELS]; /* a shift register: the last one written is that of channel 0 */
    struct srl_fifo out, in;       /* words of out carry their channel */
    uint32_t mode;                 /* descriptor of the present word */
    uint8_t timer;                 /* frame delay: counts down to where bit 4 shows */
    bool starting, loading, popping, complete, pushing;
    struct spi_shifter shifter;
};

struct ports {
    unsigned count;
    uint32_t selects; /* mask of the chip select's number, which has as many bits as there are outputs (DBSPI) */
    struct port port[INSTANCES_MAX];
};

static void take_mode(struct port *const p, const uint32_t descriptor)
{
    p->mode = descriptor;
    p->shifter.bits = descriptor & D_BITS;
    p->shifter.divider = (uint8_t)(descriptor >> 8);
    p->shifter.cpol = (descriptor & D_CPOL) != 0;
    p->shifter.cpha = (descriptor & D_CPHA) != 0;
    p->shifter.sample_late = (descriptor & D_LATE) != 0;
    p->shifter.keep_frame = (descriptor & D_KEEP_FRAME) != 0;
}

static int64_t quiet(const void *const instance)
{
    const struct port *const p = instance;
    const bool waits = !(p->timer & TIMER_DONE);
    int64_t edges = SIM_NEVER;
    if (p->loading || p->popping || p->complete || p->pushing)
        return 0;
    if (waits)
        edges = p->timer + 1; /* from 0 on it shows */
    if (p->shifter.busy)
        return p->shifter.ticks < edges ? p->shifter.ticks : edges;
    if (waits)
        return edges;
    return p->starting || p->out.count > 0 ? 0 : SIM_NEVER;
}

static void skip(void *const instance, const int64_t edges)
{
    struct port *const p = instance;
    if (!(p->timer & TIMER_DONE))
        p->timer = (uint8_t)((p->timer - edges) & TIMER_MASK);
    if (p->shifter.busy)
        p->shifter.ticks = (uint8_t)(p->shifter.ticks - edges);
}

/* What one edge does, from the state before it. */
static void edge(void *const instance)
{
    struct port *const p = instance;
    const struct port before = *p;
    const bool done = (before.timer & TIMER_DONE) != 0;
    if (!before.starting && before.out.count > 0 && !before.popping && done && !before.shifter.busy &&
        !before.complete && !before.loading) {
        take_mode(p, p->descriptor[srl_oldest(&p->out) >> CHANNEL_SHIFT]);
        p->timer = (uint8_t)(p->mode >> 24 & TIMER_MASK);
        p->starting = true;
    }
    if (before.starting && done) {
        p->starting = false;
        p->loading = true;
    }
    p->complete = false;
    p->pushing = before.complete && !(before.mode & D_NO_ECHO);
    if (before.pushing)
        (void)srl_push(&p->in, before.shifter.word);
    if (before.popping)
        (void)srl_drop(&p->out, 1);
    p->popping = before.loading;
    if (!done)
        p->timer = (uint8_t)((before.timer - 1u) & TIMER_MASK);
    if (before.shifter.busy && spi_shifter_edge(&p->shifter)) {
        p->complete = true;
        p->timer = (uint8_t)(p->mode >> 24 & TIMER_MASK);
    }
    if (before.loading) {
        spi_shifter_start(&p->shifter, (uint32_t)srl_oldest(&p->out));
        p->loading = false;
    }
}

static const struct sim_stepper stepper = {quiet, skip, edge};

static int init(struct sim_module *const m)
{
    struct ports *const s = m->state;
    const struct hm2_idrom *const idrom = sim_idrom(m->card);
    s->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    s->selects = 0;
    for (unsigned io = 0; io < idrom->pin_count; io++) {
        const struct hm2_pd *const pd = &idrom->pins[io];
        if (pd->secondary_tag == m->md.gtag && pd->secondary_pin >= PIN_CS0 && pd->secondary_pin < PIN_CS0 + SELECTS)
            s->selects |= (2u << (pd->secondary_pin - PIN_CS0)) - 1u;
    }
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct ports *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        const bool input = s->port[i].shifter.input;
        s->port[i] = (struct port){.shifter.input = input};
        srl_clear(&s->port[i].out);
        srl_clear(&s->port[i].in);
    }
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct ports *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        sim_step_to(&stepper, &s->port[i], m->clk, clk);
}

static unsigned instance_of(const unsigned page, const unsigned low)
{
    return page == PAGE_FIFO ? low / 0x40u : low / 4u % 16u;
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct ports *const s = m->state;
    const unsigned i = instance_of(page, low);
    *undriven = i < s->count && page != PAGE_DESCRIPTORS ? 0 : UINT32_MAX;
    if (*undriven)
        return 0;
    struct port *const p = &s->port[i];
    if (page == PAGE_COUNT)
        return p->in.count | (uint32_t)p->out.count << 8;
    const uint32_t word = (uint32_t)srl_oldest(&p->in);
    (void)srl_drop(&p->in, 1);
    return word;
}

static void clear(struct port *const p)
{
    srl_clear(&p->out);
    srl_clear(&p->in);
    spi_shifter_abort(&p->shifter);
    p->complete = p->loading = p->starting = p->pushing = false;
    p->timer &= TIMER_DONE - 1u;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct ports *const s = m->state;
    const unsigned i = instance_of(page, low);
    advance(m, m->clk + 1); /* the edge of the write is made with what was there before */
    m->clk++;
    if (i >= s->count)
        return;
    struct port *const p = &s->port[i];
    if (page == PAGE_FIFO) {
        (void)srl_push(&p->out, (uint64_t)(low / 4u % CHANNELS) << CHANNEL_SHIFT | value);
    } else if (page == PAGE_DESCRIPTORS) {
        memmove(p->descriptor + 1, p->descriptor, (CHANNELS - 1) * sizeof p->descriptor[0]);
        p->descriptor[0] = value;
    } else {
        clear(p);
    }
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct ports *const s = m->state;
    if (unit >= s->count)
        return SIM_LOW;
    const struct port *const p = &s->port[unit];
    bool level;
    switch (pin) {
    case PIN_FRAME:
        level = !p->shifter.frame;
        break;
    case PIN_MOSI:
        level = spi_shifter_mosi(&p->shifter);
        break;
    case PIN_SCLK:
        level = p->shifter.clock != p->shifter.cpol;
        break;
    default:
        if (pin < PIN_CS0 || pin >= PIN_CS0 + SELECTS)
            return SIM_LOW;
        if (m->md.gtag == HM2_GTAG_DBSPI)
            level = !p->shifter.frame || (p->mode >> SELECT_SHIFT & s->selects) != (unsigned)pin - PIN_CS0;
        else
            level = (p->mode >> SELECT_SHIFT >> (pin - PIN_CS0) & 1u) != 0;
    }
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
    for (unsigned i = 0; i < s->count; i++) {
        const int64_t edges = quiet(&s->port[i]);
        if (edges != SIM_NEVER && m->clk + edges < first)
            first = m->clk + edges;
    }
    return first;
}

#define BSPI_OPS(tag, text)                                                                                       \
    {                                                                                                             \
        .gtag = (tag), .name = (text), .pages = PAGES, .state_size = sizeof(struct ports), .init = init,          \
        .power_up = power_up, .advance = advance, .read = read, .write = write, .output = output, .input = input, \
        .next_event = next_event,                                                                                 \
    }

const struct sim_module_ops sim_bspi_ops = BSPI_OPS(HM2_GTAG_BSPI, "BSPI");
const struct sim_module_ops sim_dbspi_ops = BSPI_OPS(HM2_GTAG_DBSPI, "DBSPI");
