/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * SSerial and SSerialB, tags C1 and C6: the registers of the SSLBP firmware and how it takes commands (register
 * map 3.8; traces in folder sslbp, whose README outranks the manual). What goes on in the channels is in
 * sserial_channel.c.
 *
 * The firmware's loop makes its times vary by some ten clocks; here each kind of command has the shortest one that was
 * recorded. A reset by bit 14 is taken to initialise as power-up does, which nobody has recorded.
 */
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "sserial_state.h"

#define PAGE_USER0     3u
#define INSTANCE_SHIFT 6
#define CHANNEL_MASK   7u

/* Command register (seed 003, "COMMAND REGISTER"). */
#define COMMAND_BITS   0xFFFFu
#define COMMAND_IGNORE 0x80000000u
#define COMMAND_WRITE  0x8000u
#define COMMAND_RESET  0x4000u
#define COMMAND_LOCAL  0x2000u
#define COMMAND_DO_IT  0x10u /* high bytes */
#define COMMAND_STOP   0x08u
#define COMMAND_START  0x09u
#define COMMAND_SETUP  0x0Fu
#define STOP_ALL       0x0800u
#define LOCAL_ADDRESS  0x7FFu

/* Data register: what was done, or that nothing was. */
#define DATA_STOPPED   0xAAu
#define DATA_UNKNOWN   0xFFu
#define DATA_SWALLOWED 0xFCu

/* Clocks. */
#define DROP_CLK     2130
#define BOOT_CLK     8200
#define STOP_ALL_CLK 3090
#define STOP_CLK     290
#define LOCAL_CLK    90
#define OTHER_CLK    190

/* Local parameters (seed 003, "LOCAL PARAMETERS", and as recorded). */
enum {
    LOCAL_INTERFACE = 0,
    LOCAL_WIDTH,
    LOCAL_MAJOR,
    LOCAL_MINOR,
    LOCAL_CHANNEL_START,
    LOCAL_CHANNEL_STRIDE,
    LOCAL_PROCESSOR,
    LOCAL_CHANNELS,
    LOCAL_SUPPORTS,
    LOCAL_START_TIMEOUT = 0x63,
    LOCAL_CLOCK = 0x230,
    LOCAL_HARDWARE_CHANNELS = 0x234,
};

#define REVISION_SSERIAL  43u
#define REVISION_SSERIALB 45u /* SSerialB needs 45 or more (register map 3.8.7) */

/* ---- time ---------------------------------------------------------------------------------------------------------
 */

int64_t sserial_ns(const struct sim_module *const m, const int64_t clk)
{
    const int64_t hz = sim_clock_low_hz(m->card);
    return clk / hz * 1000000000 + clk % hz * 1000000000 / hz;
}

/* ---- initialising -------------------------------------------------------------------------------------------------
 */

static void put_local(struct sserial_port *const p, const unsigned address, const uint32_t value, const unsigned bytes)
{
    for (unsigned i = 0; i < bytes; i++)
        p->locals[(address + i) % SSERIAL_LOCALS] = (uint8_t)(value >> 8 * i);
}

static void fill_locals(const struct sim_module *const m, struct sserial_port *const p)
{
    const uint8_t first[] = {[LOCAL_INTERFACE] = 0x12,
                             [LOCAL_WIDTH] = 8,
                             [LOCAL_MAJOR] = 1,
                             [LOCAL_MINOR] = m->md.gtag == HM2_GTAG_SSERIALB ? REVISION_SSERIALB : REVISION_SSERIAL,
                             [LOCAL_CHANNEL_START] = SSERIAL_LOCAL_START,
                             [LOCAL_CHANNEL_STRIDE] = SSERIAL_LOCAL_STRIDE,
                             [LOCAL_PROCESSOR] = 0xD8,
                             [LOCAL_CHANNELS] = (uint8_t)p->channel_count,
                             [LOCAL_SUPPORTS] = '8',
                             'I',
                             '2',
                             '0'};
    memset(p->locals, 0, sizeof p->locals);
    memcpy(p->locals, first, sizeof first);
    p->locals[LOCAL_START_TIMEOUT] = 0xC8;
    put_local(p, LOCAL_CLOCK, sim_clock_low_hz(m->card), 4);
    p->locals[LOCAL_HARDWARE_CHANNELS] = (uint8_t)p->channel_count;
    for (unsigned c = 0; c < p->channel_count; c++) {
        put_local(p, sserial_local(c, SSERIAL_LOCAL_BAUD), SSERIAL_BAUD, 4);
        p->locals[sserial_local(c, SSERIAL_LOCAL_ERROR_LIMIT)] = SSERIAL_ERROR_LIMIT;
        p->locals[sserial_local(c, SSERIAL_LOCAL_TIMEOUT)] = SSERIAL_TIMEOUT_2US;
        p->locals[sserial_local(c, SSERIAL_LOCAL_CRC_CHECK)] = 1;
        p->locals[sserial_local(c, SSERIAL_LOCAL_GENERIC)] = 0xFF;
    }
}

static void boot(struct sim_module *const m, struct sserial_port *const p, const int64_t clk)
{
    p->mode = SSERIAL_BOOTING;
    p->dropped = p->served = false;
    p->since = clk;
    p->done = clk + DROP_CLK;
    p->aside = SIM_NEVER;
    p->named = 0;
    fill_locals(m, p);
    sserial_channels_reset(p);
}

static void begin(struct sim_module *m, struct sserial_port *p, int64_t clk);

/* The first command is dropped while things are set up; one that comes after that waits for the end. A START then never
 * ends (lost_stop). */
static void boot_event(struct sim_module *const m, struct sserial_port *const p, const int64_t clk)
{
    p->data = DATA_STOPPED;
    if (!p->dropped) {
        p->dropped = true;
        p->command = 0;
        p->done = p->since + BOOT_CLK;
        return;
    }
    p->mode = SSERIAL_IDLE;
    if (p->command == STOP_ALL) {
        p->command = 0;
        for (unsigned c = 0; c < p->channel_count; c++)
            p->channels[c].stale = true;
        return;
    }
    sserial_stop(p, UINT_MAX);
    const uint32_t high = p->command >> 8;
    if (high == COMMAND_START || high == COMMAND_SETUP)
        p->mode = SSERIAL_DEAF;
    else if (p->command)
        begin(m, p, clk);
}

/* ---- carrying out -------------------------------------------------------------------------------------------------
 */

/* A command is accepted: how long it takes, and what the data register says then. */
static int64_t accept(struct sim_module *const m, struct sserial_port *const p)
{
    const uint32_t command = p->running;
    const unsigned mask = command & 0xFFu;
    const bool first = !p->served;
    p->served = true;
    p->result = DATA_UNKNOWN;
    if (command & COMMAND_LOCAL)
        return LOCAL_CLK;
    switch (command >> 8) {
    case COMMAND_STOP:
        p->result = mask ? 0 : DATA_STOPPED;
        return mask ? STOP_CLK : STOP_ALL_CLK;
    case COMMAND_START:
    case COMMAND_SETUP:
        return sserial_start(m, p, command);
    case COMMAND_DO_IT:
        if (first)
            p->result = (uint8_t)mask;
        return first ? OTHER_CLK : sserial_do_it(m, p, mask);
    default:
        return OTHER_CLK;
    }
}

/* Nothing above a DOIT is known to end (1100 was tried). */
static bool deafens(const uint32_t command)
{
    return !(command & COMMAND_LOCAL) && command >> 8 > COMMAND_DO_IT;
}

static void begin(struct sim_module *const m, struct sserial_port *const p, const int64_t clk)
{
    sserial_freshen(p);
    p->running = p->command;
    p->since = clk;
    if (deafens(p->running)) {
        p->mode = SSERIAL_DEAF;
        return;
    }
    p->mode = SSERIAL_BUSY;
    p->done = clk + accept(m, p);
}

static void do_local(struct sserial_port *const p)
{
    const unsigned address = p->running & LOCAL_ADDRESS;
    if (p->running & COMMAND_WRITE)
        p->locals[address] = p->data_out;
    else
        p->result = p->locals[address];
    if (p->running & COMMAND_WRITE)
        p->result = p->data; /* as it was */
}

static void finish(struct sim_module *const m, struct sserial_port *const p, const int64_t clk)
{
    const unsigned mask = p->running & 0xFFu;
    if (p->running & COMMAND_LOCAL)
        do_local(p);
    else if (p->running == STOP_ALL)
        sserial_stop_all(p);
    else if (p->running >> 8 == COMMAND_STOP)
        sserial_stop(p, mask);
    else if (p->running >> 8 == COMMAND_START || p->running >> 8 == COMMAND_SETUP)
        sserial_start_done(m, p, clk);
    else if (p->running >> 8 == COMMAND_DO_IT)
        sserial_do_it_done(m, p, clk);
    p->data = p->result;
    /* A command that was written meanwhile is lost, but for STOP ALL, which stays and is not served either. */
    const bool stays = p->command == STOP_ALL && p->running != STOP_ALL;
    p->mode = stays ? SSERIAL_SWALLOW : SSERIAL_IDLE;
    if (!stays)
        p->command = 0;
}

/* A STOP of channels that came in between is cleared, and was not done. */
static void finish_aside(struct sserial_port *const p)
{
    p->aside = SIM_NEVER;
    p->data = DATA_SWALLOWED;
    p->command = 0;
    if (p->mode == SSERIAL_DEAF || p->mode == SSERIAL_SWALLOW)
        p->mode = SSERIAL_IDLE;
}

static int64_t first_of(const int64_t a, const int64_t b)
{
    return a < b ? a : b;
}

static bool counting(const struct sserial_port *const p)
{
    return p->mode == SSERIAL_BOOTING || p->mode == SSERIAL_BUSY;
}

static void advance_port(struct sim_module *const m, struct sserial_port *const p, const int64_t to)
{
    for (;;) {
        const int64_t done = counting(p) ? p->done : SIM_NEVER;
        const int64_t bite = sserial_next_bite(m, p);
        const int64_t next = first_of(first_of(done, p->aside), bite);
        sserial_keep_alive(m, p, next < to ? next : to);
        if (next >= to)
            return;
        sserial_turn(m, next);
        if (next == bite)
            sserial_bite(m, p, next);
        else if (next == p->aside)
            finish_aside(p);
        else if (p->mode == SSERIAL_BOOTING)
            boot_event(m, p, next);
        else
            finish(m, p, next);
    }
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    const struct sserial *const s = m->state;
    for (unsigned i = 0; i < s->count; i++)
        advance_port(m, &s->ports[i], clk);
}

/* ---- registers ----------------------------------------------------------------------------------------------------
 */

static struct sserial_port *port_of(const struct sim_module *const m, const unsigned low)
{
    const struct sserial *const s = m->state;
    const unsigned i = low >> INSTANCE_SHIFT;
    return i < s->count ? &s->ports[i] : NULL;
}

/* Only the first of a port's addresses is command or data. */
static bool is_first(const unsigned low)
{
    return (low & ((1u << INSTANCE_SHIFT) - 1)) == 0;
}

static uint32_t read_reg(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct sserial_port *const p = port_of(m, low);
    const unsigned channel = low / 4 & CHANNEL_MASK;
    *undriven = 0;
    if (p && page == 0 && is_first(low))
        return p->command;
    if (p && page == 1 && is_first(low))
        return p->data;
    if (p && page == 2)
        return sserial_cs(p, channel, m->clk);
    if (p && page >= PAGE_USER0 && page - PAGE_USER0 < p->users)
        return p->channels[channel].user_in[page - PAGE_USER0];
    *undriven = UINT32_MAX;
    return 0;
}

/* A command at the wrong time that is cleared nevertheless, without having been done. */
static bool is_swallowed(const struct sserial_port *const p)
{
    const bool stops_channels = p->command >> 8 == COMMAND_STOP && p->command != STOP_ALL;
    const bool doing_it = p->mode == SSERIAL_BUSY && p->running >> 8 == COMMAND_DO_IT;
    if (p->mode == SSERIAL_SWALLOW)
        return p->command != STOP_ALL;
    return stops_channels && (p->mode == SSERIAL_DEAF || doing_it);
}

static void write_command(struct sim_module *const m, struct sserial_port *const p, const uint32_t value)
{
    if (value & COMMAND_IGNORE)
        return;
    p->command = value & COMMAND_BITS;
    if (p->command & COMMAND_RESET)
        p->mode = SSERIAL_HELD;
    else if (p->mode == SSERIAL_HELD)
        boot(m, p, m->clk);
    else if (p->mode == SSERIAL_IDLE && p->command)
        begin(m, p, m->clk);
    else if (is_swallowed(p))
        p->aside = m->clk + OTHER_CLK;
}

static void write_reg(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct sserial_port *const p = port_of(m, low);
    const unsigned channel = low / 4 & CHANNEL_MASK;
    if (!p)
        return;
    if (page == 0 && is_first(low))
        write_command(m, p, value);
    else if (page == 1 && is_first(low))
        p->data_out = (uint8_t)value;
    else if (page == 2)
        p->channels[channel].cs_out = value;
    else if (page >= PAGE_USER0 && page - PAGE_USER0 < p->users)
        p->channels[channel].user_out[page - PAGE_USER0] = value;
}

/* ---- life ---------------------------------------------------------------------------------------------------------
 */

#define PIN_RX 0x00u /* secondary pins, + channel + 1 (register map 4.1) */
#define PIN_TX 0x80u
#define PIN_EN 0x90u
#define PIN_OF 0xF0u

static void find_pins(const struct sim_module *const m, struct sserial *const s)
{
    const struct hm2_idrom *const idrom = sim_idrom(m->card);
    for (unsigned io = 0; io < idrom->pin_count; io++) {
        const struct hm2_pd *const pd = &idrom->pins[io];
        const unsigned channel = (pd->secondary_pin & 0xFu) - 1;
        if (pd->secondary_tag != m->md.gtag || pd->secondary_unit >= s->count || channel >= SSERIAL_CHANNELS)
            continue;
        struct sserial_port *const p = &s->ports[pd->secondary_unit];
        if (channel >= p->channel_count)
            p->channel_count = channel + 1;
        if ((pd->secondary_pin & PIN_OF) == PIN_TX)
            p->channels[channel].tx_io = io;
        if ((pd->secondary_pin & PIN_OF) == PIN_RX)
            p->channels[channel].rx_io = io;
    }
}

static int init(struct sim_module *const m)
{
    struct sserial *const s = m->state;
    s->count = m->md.instances < SSERIAL_MAX_PORTS ? m->md.instances : SSERIAL_MAX_PORTS;
    s->ports = calloc(s->count ? s->count : 1, sizeof *s->ports);
    if (!s->ports)
        return HM2_ERR_NOMEM;
    for (unsigned i = 0; i < s->count; i++) {
        s->ports[i].users = m->md.gtag == HM2_GTAG_SSERIALB ? SSERIAL_USERS : 3;
        for (unsigned c = 0; c < SSERIAL_CHANNELS; c++)
            s->ports[i].channels[c].tx_io = s->ports[i].channels[c].rx_io = UINT_MAX;
    }
    find_pins(m, s);
    return 0;
}

static void release(struct sim_module *const m)
{
    struct sserial *const s = m->state;
    for (unsigned i = 0; s->ports && i < s->count; i++)
        for (unsigned c = 0; c < SSERIAL_CHANNELS; c++)
            remote_free(s->ports[i].channels[c].remote);
    free(s->ports);
}

static void power_up(struct sim_module *const m)
{
    const struct sserial *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct sserial_port *const p = &s->ports[i];
        p->command = 0;
        p->data = p->data_out = 0;
        for (unsigned c = 0; c < SSERIAL_CHANNELS; c++) {
            p->channels[c].cs_out = 0;
            memset(p->channels[c].user_out, 0, sizeof p->channels[c].user_out);
        }
        boot(m, p, m->clk);
    }
}

/* Lines at rest: what passes over them takes no time of its own here. */
static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t secondary_pin)
{
    (void)m;
    (void)unit;
    return (secondary_pin & PIN_OF) == PIN_TX ? SIM_HIGH : SIM_LOW;
}

#define SSERIAL_OPS(tag, title, registers)                                                                        \
    {                                                                                                             \
        .gtag = (tag), .name = (title), .pages = (registers), .state_size = sizeof(struct sserial), .init = init, \
        .release = release, .power_up = power_up, .advance = advance, .read = read_reg, .write = write_reg,       \
        .output = output,                                                                                         \
    }

const struct sim_module_ops sim_sserial_ops = SSERIAL_OPS(HM2_GTAG_SSERIAL, "SSerial", PAGE_USER0 + 3);
const struct sim_module_ops sim_sserialb_ops = SSERIAL_OPS(HM2_GTAG_SSERIALB, "SSerialB", PAGE_USER0 + SSERIAL_USERS);
