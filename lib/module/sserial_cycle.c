/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Smart serial in the cycle: registers of the reply to the engine and to the pins, pins and the engine's orders to the
 * registers. The fixed list writes CS, interface and command registers in every cycle; what must not act has the
 * ignore bit (seed 003, "COMMAND REGISTER WRITE IGNORE").
 */
#include "sserial.h"

static struct sslbp_wish wish_of(const struct sserial_port *const port, const struct hm2_cycle *const cycle)
{
    const struct sserial_points *const p = &port->points;
    return (struct sslbp_wish){
        .run = *p->run,
        .hold = cycle->bitten,
        .restart = *p->auto_restart,
        .fault_inc = *p->fault_inc,
        .fault_dec = *p->fault_dec,
        .fault_lim = *p->fault_lim,
        .now_ns = cycle->now_ns,
    };
}

/* ---- replies ------------------------------------------------------------------------------------------------------
 */

static void take_inputs(const struct sserial_port *const port, const unsigned fresh)
{
    for (struct sserial_remote *remote = port->remotes, *const end = remote + port->remote_count; remote < end;
         remote++) {
        uint32_t words[SSLBP_USER_WORDS] = {0};
        if (!(fresh >> remote->channel & 1u))
            continue;
        for (unsigned i = 0; i < remote->in_words; i++)
            words[i] = hm2_window_get(&port->user[i], remote->channel - port->first);
        sserial_unpack(remote, words);
    }
}

static const char *const channel_names[SSLBP_CHANNELS] = {"channel-0", "channel-1", "channel-2", "channel-3",
                                                          "channel-4", "channel-5", "channel-6", "channel-7"};

static void tell_channel(const struct hm2_module *const module, const struct sserial_port *const port,
                         const unsigned number)
{
    static const enum hm2_notice notices[] = {
        [SSLBP_EVENT_LOST] = HM2_NOTICE_REMOTE_LOST,
        [SSLBP_EVENT_NOT_STARTED] = HM2_NOTICE_REMOTE_NOT_STARTED,
        [SSLBP_EVENT_OTHER] = HM2_NOTICE_REMOTE_OTHER,
        [SSLBP_EVENT_BACK] = HM2_NOTICE_REMOTE_BACK,
    };
    const struct sslbp_channel *const channel = &port->engine.channel[number];
    if (channel->event != SSLBP_EVENT_NONE)
        hm2_notice_point(module, notices[channel->event], channel_names[number], port->number, number);
    const uint8_t faults = sslbp_status(channel->cs, port->engine.minor, true).remote;
    if (faults && !channel->lost)
        hm2_notice_point(module, HM2_NOTICE_REMOTE_FAULT, channel_names[number], port->number, faults);
}

/* fresh: channels whose inputs this very reply brought. */
static void show_remotes(const struct hm2_module *const module, const struct sserial_port *const port,
                         const unsigned fresh)
{
    bool fault = sslbp_engine_state(&port->engine) == SSLBP_ERROR;
    for (const struct sserial_remote *remote = port->remotes, *const end = remote + port->remote_count; remote < end;
         remote++) {
        const struct sslbp_channel *const channel = &port->engine.channel[remote->channel];
        if (!port->engine.unfinished)
            *remote->fault = channel->failing || !(fresh >> remote->channel & 1u);
        *remote->errors = channel->errors;
        *remote->status = channel->cs;
        fault |= channel->lost;
        tell_channel(module, port, remote->channel);
    }
    *port->points.fault = fault;
}

static void unpack_port(const struct hm2_module *const module, struct sserial_port *const port,
                        const struct hm2_cycle *const cycle)
{
    uint32_t cs[SSLBP_CHANNELS] = {0}, user[SSLBP_CHANNELS][3] = {{0}};
    for (unsigned i = 0; i < port->channels; i++) {
        cs[port->first + i] = hm2_window_get(&port->cs, i);
        for (unsigned word = 0; word < 3; word++)
            user[port->first + i][word] = hm2_window_get(&port->user[word], i);
    }
    const struct sslbp_reply reply = {
        .command = hm2_window_get(&port->command, 0),
        .data = hm2_window_get(&port->data, 0),
        .cs = cs,
        .user = (const uint32_t(*)[3])user,
        .write_lost = port->write_lost,
        .early = cycle->turned,
        .in_order = cycle->before_kept,
        .now_ns = cycle->now_ns,
    };
    const struct sslbp_wish wish = wish_of(port, cycle);
    const bool started = port->engine.step == SSLBP_STEP_START;
    port->write_lost = false;
    const unsigned fresh = sslbp_engine_take(&port->engine, &reply, &wish);
    take_inputs(port, fresh);
    for (unsigned i = 0; started && i < port->remote_count; i++)
        sserial_start_counters(&port->remotes[i]);
    if (port->engine.step == SSLBP_STEP_RUN && !port->engine.clear && !port->engine.unfinished)
        hm2_notice(module, HM2_NOTICE_PORT_LATE, port->number, (double)(cycle->now_ns - port->engine.sent_ns) * 1e-3);
    show_remotes(module, port, fresh);
}

void sserial_unpack_all(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct sserial *const ctx = module->context;
    for (unsigned i = 0; i < ctx->port_count; i++)
        unpack_port(module, &ctx->ports[i], cycle);
}

int64_t sserial_turn_ns(const struct hm2_module *const module)
{
    const struct sserial *const ctx = module->context;
    int64_t longest = 0;
    for (unsigned i = 0; ctx && i < ctx->port_count; i++)
        longest = ctx->ports[i].doit_ns > longest ? ctx->ports[i].doit_ns : longest;
    return longest;
}

bool sserial_unfinished(const struct hm2_module *const module)
{
    const struct sserial *const ctx = module->context;
    for (unsigned i = 0; ctx && i < ctx->port_count; i++)
        if (ctx->ports[i].engine.unfinished)
            return true;
    return false;
}

void sserial_write_lost(struct hm2_module *const module)
{
    const struct sserial *const ctx = module->context;
    for (unsigned i = 0; ctx && i < ctx->port_count; i++)
        ctx->ports[i].write_lost = true;
}

void sserial_restart(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct sserial *const ctx = module->context;
    (void)cycle;
    for (unsigned i = 0; ctx && i < ctx->port_count; i++)
        sslbp_engine_restart(&ctx->ports[i].engine);
}

/* ---- parameters ---------------------------------------------------------------------------------------------------
 */

static bool is_job(const enum sslbp_step step)
{
    return step >= SSLBP_STEP_JOB_HALT && step <= SSLBP_STEP_JOB_END;
}

/* How the write of a parameter went. A failed one is tried again at the next start. */
static void end_write(const struct hm2_module *const module, struct sserial_port *const port)
{
    struct sslbp_engine *const engine = &port->engine;
    if (!port->writing || engine->job_state == SSLBP_JOB_WAITS)
        return;
    if (engine->job_state == SSLBP_JOB_DONE)
        port->writing->written = port->writing_value;
    else
        hm2_notice(module, HM2_NOTICE_PARAMETER_REFUSED, port->number, engine->job.channel);
    port->writing = NULL;
}

static void write_if_changed(struct sserial_port *const port, const struct sserial_remote *const remote,
                             struct sserial_global *const global)
{
    const uint64_t raw = sserial_global_raw(global);
    if (!global->writable || raw == global->written)
        return;
    const struct sslbp_job job = {
        .channel = (uint8_t)remote->channel,
        .bytes = global->bytes,
        .nonvolatile = global->nonvolatile,
        .address = global->address,
        .value = raw,
    };
    port->writing = global;
    port->writing_value = raw;
    sslbp_engine_job(&port->engine, &job);
}

/* One parameter a cycle while the port is idle (hal-interface 4.7). */
static void scan(const struct hm2_module *const module, struct sserial_port *const port)
{
    end_write(module, port);
    if (port->engine.step != SSLBP_STEP_SCAN) {
        if (!is_job(port->engine.step))
            port->scan_remote = port->scan_global = 0;
        return;
    }
    while (port->scan_remote < port->remote_count &&
           port->scan_global >= port->remotes[port->scan_remote].global_count) {
        port->scan_remote++;
        port->scan_global = 0;
    }
    if (port->scan_remote == port->remote_count) {
        sslbp_engine_scanned(&port->engine);
        return;
    }
    const struct sserial_remote *const remote = &port->remotes[port->scan_remote];
    write_if_changed(port, remote, &remote->globals[port->scan_global++]);
}

/* ---- orders -------------------------------------------------------------------------------------------------------
 */

static void put_job(struct sserial_port *const port, const struct sslbp_orders *const orders)
{
    const unsigned at = (unsigned)orders->job_channel - port->first;
    hm2_window_set(&port->cs_out, at, orders->job_cs);
    hm2_window_set(&port->user_out[0], at, (uint32_t)orders->job_value);
    hm2_window_set(&port->user_out[1], at, (uint32_t)(orders->job_value >> 32));
}

/* Words of a remote stay as they are while a transfer may still take them. */
static void put_outputs(const struct hm2_module *const module, struct sserial_port *const port,
                        const struct sslbp_orders *const orders)
{
    for (struct sserial_remote *remote = port->remotes, *const end = remote + port->remote_count; remote < end;
         remote++) {
        const bool silent = orders->silent >> remote->channel & 1u;
        const unsigned at = remote->channel - port->first;
        if (silent)
            for (unsigned i = 0; i < SSLBP_USER_WORDS; i++)
                remote->out[i] = 0;
        else if (orders->outputs >> remote->channel & 1u)
            sserial_pack(module, port->number, remote);
        hm2_window_set(&port->cs_out, at, (uint32_t)port->engine.channel[remote->channel].mode << 24);
        for (unsigned i = 0; i < port->write_words; i++)
            hm2_window_set(&port->user_out[i], at, remote->out[i]);
    }
}

static void show_port(const struct hm2_module *const module, const struct sserial_port *const port)
{
    const struct sslbp_engine *const engine = &port->engine;
    const struct sserial_points *const p = &port->points;
    *p->debug = (int32_t)(engine->left_ns > INT32_MAX ? INT32_MAX : engine->left_ns);
    *p->port_state = (uint32_t)sslbp_engine_state(engine);
    *p->port_state2 = engine->step == SSLBP_STEP_SCAN || is_job(engine->step);
    *p->port_state3 = is_job(engine->step) ? (uint32_t)(engine->step - SSLBP_STEP_JOB_HALT) : 0;
    *p->fault_count = sslbp_engine_faults(engine);
    *p->skipped = engine->skipped;
    *p->restarts = engine->restarts;
    *p->doit_us = (double)engine->doit_ns * 1e-3;
    if (engine->step == SSLBP_STEP_FAILED)
        hm2_notice(module, HM2_NOTICE_PORT_STOPPED, port->number, engine->restarts);
}

static void pack_port(const struct hm2_module *const module, struct sserial_port *const port,
                      const struct hm2_cycle *const cycle)
{
    const struct sslbp_wish wish = wish_of(port, cycle);
    scan(module, port);
    const struct sslbp_orders orders = sslbp_engine_next(&port->engine, &wish);
    put_outputs(module, port, &orders);
    if (orders.job)
        put_job(port, &orders);
    hm2_window_set(&port->command_out, 0, orders.command);
    show_port(module, port);
}

void sserial_pack_all(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    const struct sserial *const ctx = module->context;
    for (unsigned i = 0; i < ctx->port_count; i++)
        pack_port(module, &ctx->ports[i], cycle);
}
