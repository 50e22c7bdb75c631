/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Channels of a smart-serial port: starting, exchanging process data, passing LBP commands on (traces in folder sslbp).
 */
#include <limits.h>
#include <string.h>

#include "sserial_state.h"

#define STATUS_STOPPED 0xC1u /* of a channel that is not started */
#define STATUS_FAILED  0xE1u
#define STATE_FAILED   0x01u
#define STATE_PROBING  0x02u
#define STATE_ASKED    0x04u
#define STATE_READY    0x3Bu
#define STATE_SETUP    0x40u
#define STATE_RUNNING  0x42u

#define SETUP_COMMAND 0x0Fu
#define SHORT_CLK     190 /* nothing to do */

/* A START: as recorded, with one remote; without, after as many attempts as make too many errors. */
#define START_CLK          146000
#define SETUP_CLK          205000
#define NO_REMOTE_FIRST    1500
#define NO_REMOTE_CLK      80600 /* of an attempt, and of the probe in it */
#define NO_REMOTE_PROBE    41900
#define NO_REMOTE_SETUP    260500 /* the same in setup mode */
#define NO_REMOTE_S_PROBE  143300
#define NO_REMOTE_ATTEMPTS (SSERIAL_ERROR_LIMIT + 1)

/* Messages: 10 bits of 2.5 Mbaud and a little, and what the processors on both sides need besides. */
#define BYTE_CLK       403
#define DO_IT_CLK      2424
#define DO_IT_BYTES    4    /* command and CRC, fault byte and CRC */
#define FIRST_MORE_CLK 9800 /* the exchange that keeps the remote alive ends first */
#define LBP_READ_CLK   4690
#define LBP_WRITE_CLK  10590

/* LBP (seed 003, "LBP DATA READ/WRITE COMMAND", "LOCAL LBP COMMANDS"; EC: register map 3.8.6). */
#define LBP_SHIFT     24
#define LBP_KIND      0xC0u
#define LBP_DATA      0x40u
#define LBP_WRITE     0x20u
#define LBP_SIZE      0x03u
#define LBP_NV_ACCESS 0xECu
#define LBP_STATUS    0xC1u
#define LBP_REFUSED   0x20u /* in it: invalid write */
#define LBP_COOKIE    0xDFu

/* ---- is anybody there? --------------------------------------------------------------------------------------------
 */

/* What is sent comes to the remote: it is plugged, at the same baud rate, and the pin is the port's. */
static bool heard(struct sim_module *const m, const struct sserial_port *const p, const unsigned channel)
{
    const struct sserial_channel *const c = &p->channels[channel];
    if (!c->remote || c->cable == SIM_CABLE_OUT)
        return false;
    uint32_t baud = 0;
    for (unsigned i = 4; i-- > 0;)
        baud = baud << 8 | p->locals[sserial_local(channel, SSERIAL_LOCAL_BAUD + i)];
    if (baud != remote_baud(c->remote))
        return false;
    return c->tx_io == UINT_MAX || sim_pad_carries_alternate(m->card, c->tx_io);
}

/* What it answers comes back. */
static bool answered(struct sim_module *const m, const struct sserial_channel *const c)
{
    const bool free = c->rx_io == UINT_MAX || sim_card_pad(m->card, c->rx_io) == SIM_FLOAT;
    return free && c->cable == SIM_CABLE_IN;
}

static void count_up(struct sserial_port *const p, const unsigned channel, const unsigned parameter)
{
    uint8_t *const counter = &p->locals[sserial_local(channel, parameter)];
    if (*counter < SSERIAL_ERROR_LIMIT)
        (*counter)++;
}

/* A message was not answered as it should have been. */
static void note_error(struct sserial_port *const p, const unsigned channel, const uint8_t error)
{
    struct sserial_channel *const c = &p->channels[channel];
    c->local |= error;
    c->status |= SSERIAL_STATUS_ERROR;
    if (error & SSERIAL_TIMEOUT)
        count_up(p, channel, SSERIAL_LOCAL_TIMEOUT_COUNT);
    if (error & SSERIAL_CRC)
        count_up(p, channel, SSERIAL_LOCAL_CRC_COUNT);
    if (c->errors == SSERIAL_ERROR_LIMIT)
        c->local |= SSERIAL_TOO_MANY;
    else
        c->errors++;
}

/* The error that was ordered for the next message: its local fault bit, 0 = none. */
static uint8_t ordered_error(struct sserial_channel *const c, const uint8_t among)
{
    for (unsigned bit = 0; bit < SSERIAL_ERRORS; bit++) {
        if (!(among >> bit & 1u) || c->ordered[bit] == 0)
            continue;
        c->ordered[bit]--;
        return (uint8_t)(1u << bit);
    }
    return 0;
}

/* ---- stopping -----------------------------------------------------------------------------------------------------
 */

static void reset(struct sserial_channel *const c)
{
    c->link = SSERIAL_STOPPED;
    c->faults = c->state = c->local = 0;
    c->status = STATUS_STOPPED;
    c->errors = c->lbp_status = 0;
    c->stale = c->starting = false;
    memset(c->user_in, 0, sizeof c->user_in);
}

void sserial_channels_reset(struct sserial_port *const p)
{
    for (unsigned i = 0; i < SSERIAL_CHANNELS; i++) {
        reset(&p->channels[i]);
        p->channels[i].status = 0; /* not before the initialisation is done */
    }
}

void sserial_freshen(struct sserial_port *const p)
{
    for (unsigned i = 0; i < p->channel_count; i++)
        if (p->channels[i].stale)
            reset(&p->channels[i]);
}

void sserial_stop(struct sserial_port *const p, const unsigned mask)
{
    for (unsigned i = 0; i < p->channel_count; i++)
        if (mask >> i & 1u)
            reset(&p->channels[i]);
}

static void clear_counts(struct sserial_port *const p, const unsigned channel)
{
    p->locals[sserial_local(channel, SSERIAL_LOCAL_TIMEOUT_COUNT)] = 0;
    p->locals[sserial_local(channel, SSERIAL_LOCAL_CRC_COUNT)] = 0;
}

/* CS of a channel that ran or had failed to start still reads as before until the next command. */
void sserial_stop_all(struct sserial_port *const p)
{
    p->named = 0;
    for (unsigned i = 0; i < p->channel_count; i++) {
        struct sserial_channel *const c = &p->channels[i];
        const bool stays = c->link == SSERIAL_RUNNING || c->link == SSERIAL_FAILED;
        clear_counts(p, i);
        if (!stays) {
            reset(c);
            continue;
        }
        c->link = SSERIAL_STOPPED;
        c->stale = true;
        memset(c->user_in, 0, sizeof c->user_in);
    }
}

/* ---- starting -----------------------------------------------------------------------------------------------------
 */

/* States that a normal START passes through: clocks after the command, state, status. */
static const struct {
    int32_t clk;
    uint8_t state, status;
} steps[] = {
    {300, 0x02, 0xC1},    {43500, 0x05, 0xC1},  {46500, 0x06, 0xC1},  {55500, 0x08, 0xC1},  {64500, 0x09, 0xC1},
    {67500, 0x0A, 0xC1},  {70500, 0x0D, 0xC1},  {73500, 0x0F, 0xC1},  {79500, 0x11, 0xC1},  {82500, 0x13, 0xC1},
    {85500, 0x15, 0xC1},  {88500, 0x1B, 0xC1},  {100500, 0x1D, 0xC1}, {103500, 0x1E, 0x81}, {106500, 0x1F, 0x81},
    {115500, 0x21, 0x81}, {127500, 0x23, 0x81}, {130500, 0x25, 0x81}, {133500, 0x3B, 0x80},
};

static bool in_setup(const uint32_t command)
{
    return command >> 8 == SETUP_COMMAND;
}

static int64_t no_remote_clk(const bool setup)
{
    return NO_REMOTE_FIRST + (int64_t)NO_REMOTE_ATTEMPTS * (setup ? NO_REMOTE_SETUP : NO_REMOTE_CLK);
}

static void start_channel(struct sim_module *const m, struct sserial_port *const p, const unsigned i)
{
    struct sserial_channel *const c = &p->channels[i];
    reset(c);
    clear_counts(p, i);
    c->link = SSERIAL_FAILED;
    if (!heard(m, p, i) || !answered(m, c))
        return;
    const uint8_t error = ordered_error(c, SSERIAL_COOKIE);
    if (error)
        c->local |= error;
    else
        c->link = in_setup(p->running) ? SSERIAL_SETUP : SSERIAL_READY;
}

int64_t sserial_start(struct sim_module *const m, struct sserial_port *const p, const uint32_t command)
{
    const bool setup = in_setup(command);
    int64_t longest = SHORT_CLK;
    p->named = command & 0xFFu;
    p->result = (uint8_t)(p->named >> p->channel_count << p->channel_count); /* channels that the firmware lacks */
    for (unsigned i = 0; i < p->channel_count; i++) {
        struct sserial_channel *const c = &p->channels[i];
        if (!(p->named >> i & 1u) || (c->link != SSERIAL_STOPPED && c->link != SSERIAL_FAILED))
            continue; /* one that is started stays as it is */
        start_channel(m, p, i);
        c->starting = true;
        const int64_t good = setup ? SETUP_CLK : START_CLK;
        const int64_t takes = c->link == SSERIAL_FAILED ? no_remote_clk(setup) : good;
        longest = takes > longest ? takes : longest;
    }
    return longest;
}

/* Name, number and tables of the remote where process data will come later. */
static void introduce(struct sserial_channel *const c)
{
    const char *const name = remote_card_name(c->remote);
    c->user_in[0] = remote_unit_number(c->remote);
    c->user_in[1] = 0;
    for (unsigned i = 4; i-- > 0;)
        c->user_in[1] = c->user_in[1] << 8 | (uint8_t)name[i];
    c->user_in[2] = (uint32_t)remote_gtoc(c->remote) << 16 | remote_ptoc(c->remote);
}

static void show_faults(struct sserial_channel *const c, const uint8_t faults)
{
    c->faults = faults;
    if (faults) {
        c->local |= SSERIAL_REMOTE_FAULT;
        c->status |= SSERIAL_STATUS_REMOTE_FAULT;
    } else {
        c->status &= (uint8_t)~SSERIAL_STATUS_REMOTE_FAULT;
    }
}

static void fail(struct sserial_port *const p, const unsigned i, const bool last)
{
    struct sserial_channel *const c = &p->channels[i];
    c->status = STATUS_FAILED;
    c->local |= SSERIAL_TOO_MANY;
    if (!(c->local & SSERIAL_COOKIE)) {
        c->local |= SSERIAL_TIMEOUT;
        p->locals[sserial_local(i, SSERIAL_LOCAL_TIMEOUT_COUNT)] = SSERIAL_ERROR_LIMIT;
    }
    c->state = last ? STATE_PROBING : STATE_FAILED;
    c->errors = SSERIAL_ERROR_LIMIT;
    p->result |= (uint8_t)(1u << i);
}

/* Faults cleared, outputs off (seed 003, "NORMAL START"). */
static void enter_operation(struct sim_module *const m, struct sserial_port *const p, const unsigned i,
                            const int64_t clk)
{
    struct sserial_channel *const c = &p->channels[i];
    const uint8_t off[REMOTE_MAX_BYTES] = {0};
    uint8_t in[REMOTE_MAX_BYTES + 1];
    remote_clear_faults(c->remote, UINT8_MAX);
    remote_set_mode(c->remote, (uint8_t)(c->cs_out >> LBP_SHIFT));
    remote_exchange(c->remote, sserial_ns(m, clk), off, in);
    c->state = STATE_READY;
    show_faults(c, remote_faults(c->remote));
    p->locals[sserial_local(i, SSERIAL_LOCAL_IN_BYTES)] = (uint8_t)(remote_in_bytes(c->remote) + 1);
    p->locals[sserial_local(i, SSERIAL_LOCAL_OUT_BYTES)] = (uint8_t)remote_out_bytes(c->remote);
    p->locals[sserial_local(i, SSERIAL_LOCAL_MEASURED)] = 0x37;
    if (remote_faults(c->remote)) {
        c->link = SSERIAL_FAILED;
        p->result |= (uint8_t)(1u << i);
    }
}

static void greet(struct sim_module *const m, struct sserial_port *const p, const unsigned i, const int64_t clk)
{
    struct sserial_channel *const c = &p->channels[i];
    c->status = 0;
    c->state = STATE_SETUP;
    remote_feed(c->remote, sserial_ns(m, clk));
    remote_set_nv_access(c->remote, 0);
    if (c->link == SSERIAL_SETUP)
        remote_set_mode(c->remote, (uint8_t)(c->cs_out >> LBP_SHIFT));
    else
        enter_operation(m, p, i, clk);
    introduce(c);
}

void sserial_start_done(struct sim_module *const m, struct sserial_port *const p, const int64_t clk)
{
    unsigned failed = 0, last = 0;
    for (unsigned i = 0; i < p->channel_count; i++) {
        if (!p->channels[i].starting || p->channels[i].link != SSERIAL_FAILED)
            continue;
        failed++;
        last = i;
    }
    for (unsigned i = 0; i < p->channel_count; i++) {
        struct sserial_channel *const c = &p->channels[i];
        if (c->starting && c->link == SSERIAL_FAILED)
            fail(p, i, failed > 1 && i == last);
        else if (c->starting)
            greet(m, p, i, clk);
        c->starting = false;
    }
}

static uint32_t cs_word(const struct sserial_channel *const c)
{
    return (uint32_t)c->faults << 24 | (uint32_t)c->state << 16 | (uint32_t)c->status << 8 | c->local;
}

/* Attempts on a line without a remote. */
static uint32_t cs_probing(const struct sserial_channel *const c, const int64_t passed, const bool setup)
{
    const int64_t period = setup ? NO_REMOTE_SETUP : NO_REMOTE_CLK;
    const int64_t probe = setup ? NO_REMOTE_S_PROBE : NO_REMOTE_PROBE;
    const int64_t since = passed - NO_REMOTE_FIRST;
    struct sserial_channel shown = *c;
    shown.state = since % period < probe ? STATE_PROBING : STATE_ASKED;
    if (since >= period) {
        shown.status |= SSERIAL_STATUS_ERROR;
        shown.local |= shown.local & SSERIAL_COOKIE ? 0 : SSERIAL_TIMEOUT;
    }
    return cs_word(&shown);
}

uint32_t sserial_cs(const struct sserial_port *const p, const unsigned channel, const int64_t clk)
{
    const struct sserial_channel *const c = &p->channels[channel];
    if (!c->starting)
        return cs_word(c);
    const int64_t passed = clk - p->since;
    if (c->link == SSERIAL_FAILED)
        return cs_probing(c, passed, in_setup(p->running));
    struct sserial_channel shown = *c;
    for (size_t i = 0; i < sizeof steps / sizeof steps[0] && steps[i].clk <= passed; i++) {
        if (in_setup(p->running) && i > 0)
            break; /* its states were not recorded */
        shown.state = steps[i].state;
        shown.status = steps[i].status;
    }
    return cs_word(&shown);
}

/* ---- process data -------------------------------------------------------------------------------------------------
 */

static int64_t exchange_clk(const struct sserial_channel *const c)
{
    const unsigned bytes = remote_in_bytes(c->remote) + remote_out_bytes(c->remote) + DO_IT_BYTES;
    return DO_IT_CLK + (int64_t)bytes * BYTE_CLK + (c->link == SSERIAL_READY ? FIRST_MORE_CLK : 0);
}

/* The remote takes its outputs and answers. */
static void exchange(const struct sserial_channel *const c, const unsigned users, const int64_t now_ns,
                     uint8_t *const in)
{
    uint8_t out[REMOTE_MAX_BYTES] = {0};
    for (unsigned i = 0; i < users * 4; i++)
        out[i] = (uint8_t)(c->user_out[i / 4] >> 8 * (i % 4));
    remote_exchange(c->remote, now_ns, out, in);
}

static void show_inputs(struct sserial_channel *const c, const unsigned users, const uint8_t *const in)
{
    const unsigned in_bytes = remote_in_bytes(c->remote);
    for (unsigned i = 0; i < users; i++)
        c->user_in[i] = 0;
    for (unsigned i = 0; i < in_bytes && i < users * 4; i++)
        c->user_in[i / 4] |= (uint32_t)in[1 + i] << 8 * (i % 4);
    show_faults(c, in[0]);
}

/* ---- LBP commands in setup mode -----------------------------------------------------------------------------------
 */

static unsigned lbp_size(const uint32_t command)
{
    return 1u << (command & LBP_SIZE);
}

static bool is_data(const uint32_t command)
{
    return (command & LBP_KIND) == LBP_DATA;
}

static int64_t lbp_clk(const uint32_t cs)
{
    static const int32_t more[] = {0, 300, 1100, 2900}; /* for 2, 4 and 8 bytes */
    const uint32_t command = cs >> LBP_SHIFT;
    if (command == 0)
        return SHORT_CLK;
    const bool writes = command & LBP_WRITE;
    return (writes ? LBP_WRITE_CLK : LBP_READ_CLK) + (is_data(command) ? more[command & LBP_SIZE] : 0);
}

static void lbp_read(struct sserial_channel *const c, const uint16_t address, const unsigned size)
{
    for (unsigned i = 0; i < (size + 3) / 4; i++)
        c->user_in[i] = 0;
    for (unsigned i = 0; i < size; i++)
        c->user_in[i / 4] |= (uint32_t)remote_read(c->remote, (uint16_t)(address + i)) << 8 * (i % 4);
}

static void lbp_write(struct sserial_channel *const c, const uint16_t address, const unsigned size)
{
    for (unsigned i = 0; i < size; i++)
        if (!remote_write(c->remote, (uint16_t)(address + i), (uint8_t)(c->user_out[i / 4] >> 8 * (i % 4))))
            c->lbp_status |= LBP_REFUSED;
}

/* False: there is no such command. */
static bool pass_on(struct sserial_channel *const c)
{
    const uint32_t command = c->cs_out >> LBP_SHIFT;
    const uint16_t address = (uint16_t)c->cs_out;
    if (command == LBP_NV_ACCESS)
        remote_set_nv_access(c->remote, (uint8_t)c->user_out[0]);
    else if (is_data(command) && (command & LBP_WRITE))
        lbp_write(c, address, lbp_size(command));
    else if (is_data(command))
        lbp_read(c, address, lbp_size(command));
    else if (command == LBP_STATUS)
        c->user_in[0] = c->lbp_status;
    else if (command == LBP_COOKIE)
        c->user_in[0] = REMOTE_COOKIE;
    else
        return false;
    return true;
}

/* ---- DOIT ---------------------------------------------------------------------------------------------------------
 */

static bool takes_part(const struct sserial_channel *const c)
{
    return c->link == SSERIAL_READY || c->link == SSERIAL_RUNNING || c->link == SSERIAL_SETUP;
}

/* Decided now, reported when the message has ended: c->pending. Ordered errors hit what comes back: the remote has done
 * what it was told. */
static int64_t send(struct sim_module *const m, struct sserial_port *const p, const unsigned i)
{
    struct sserial_channel *const c = &p->channels[i];
    const uint8_t errors = (uint8_t)~SSERIAL_COOKIE;
    if (c->link == SSERIAL_SETUP && c->cs_out >> LBP_SHIFT == 0) {
        c->pending = 0;
        c->reached = true; /* nothing is sent */
        return SHORT_CLK;
    }
    c->reached = heard(m, p, i);
    c->pending = c->reached && answered(m, c) ? ordered_error(c, errors) : SSERIAL_TIMEOUT;
    if (c->pending & SSERIAL_TIMEOUT)
        return (int64_t)p->locals[sserial_local(i, SSERIAL_LOCAL_TIMEOUT)] * 200 - 10;
    return c->link == SSERIAL_SETUP ? lbp_clk(c->cs_out) : exchange_clk(c);
}

int64_t sserial_do_it(struct sim_module *const m, struct sserial_port *const p, const unsigned mask)
{
    int64_t longest = SHORT_CLK;
    p->result = (uint8_t)(p->named ? mask & ~p->named : 0);
    for (unsigned i = 0; i < p->channel_count; i++) {
        if (!(mask >> i & 1u) || !takes_part(&p->channels[i]))
            continue;
        const int64_t takes = send(m, p, i);
        longest = takes > longest ? takes : longest;
    }
    return longest;
}

/* True: the host has what it wanted. */
static bool receive(struct sim_module *const m, struct sserial_port *const p, const unsigned i, const int64_t clk)
{
    struct sserial_channel *const c = &p->channels[i];
    uint8_t in[REMOTE_MAX_BYTES + 1] = {0};
    if (c->reached && c->link != SSERIAL_SETUP)
        exchange(c, p->users, sserial_ns(m, clk), in);
    else if (c->reached)
        remote_feed(c->remote, sserial_ns(m, clk));
    if (c->pending) {
        note_error(p, i, c->pending);
        return false;
    }
    if (c->link == SSERIAL_SETUP)
        return pass_on(c);
    show_inputs(c, p->users, in);
    return c->faults == 0;
}

void sserial_do_it_done(struct sim_module *const m, struct sserial_port *const p, const int64_t clk)
{
    const unsigned mask = p->running & 0xFFu;
    for (unsigned i = 0; i < p->channel_count; i++) {
        struct sserial_channel *const c = &p->channels[i];
        if (!(mask >> i & 1u) || !takes_part(c))
            continue;
        if (!receive(m, p, i, clk))
            p->result |= (uint8_t)(1u << i);
        if (c->link == SSERIAL_READY)
            c->link = SSERIAL_RUNNING;
        if (c->link == SSERIAL_RUNNING)
            c->state = STATE_RUNNING;
    }
}

/* ---- watchdogs of the remotes -------------------------------------------------------------------------------------
 */

/* The first edge of ClockLow that is not before this time. */
static int64_t clk_of(const struct sim_module *const m, const int64_t ns)
{
    const int64_t hz = sim_clock_low_hz(m->card);
    const int64_t part = ns % 1000000000 * hz;
    return ns / 1000000000 * hz + part / 1000000000 + (part % 1000000000 > 0);
}

/* After a START the firmware sends zeros to the remote until the first DOIT comes (seed 003, "NORMAL START"). */
static bool kept_alive(const struct sserial_channel *const c)
{
    return c->link == SSERIAL_READY && !c->starting && c->cable != SIM_CABLE_OUT;
}

void sserial_keep_alive(const struct sim_module *const m, struct sserial_port *const p, const int64_t clk)
{
    for (unsigned i = 0; i < p->channel_count; i++)
        if (kept_alive(&p->channels[i]))
            remote_feed(p->channels[i].remote, sserial_ns(m, clk));
}

int64_t sserial_next_bite(const struct sim_module *const m, const struct sserial_port *const p)
{
    int64_t first = SIM_NEVER;
    for (unsigned i = 0; i < p->channel_count; i++) {
        const struct sserial_channel *const c = &p->channels[i];
        const int64_t bite_ns = c->remote && !kept_alive(c) ? remote_bite_ns(c->remote) : INT64_MAX;
        if (bite_ns == INT64_MAX)
            continue;
        const int64_t bite = clk_of(m, bite_ns);
        first = bite < first ? bite : first;
    }
    return first;
}

void sserial_bite(struct sim_module *const m, struct sserial_port *const p, const int64_t clk)
{
    for (unsigned i = 0; i < p->channel_count; i++)
        if (p->channels[i].remote && !kept_alive(&p->channels[i]))
            remote_advance(p->channels[i].remote, sserial_ns(m, clk));
}
