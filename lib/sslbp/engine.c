/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The cycle of a port. A command is written only when the last reply showed a clear command register; everything else
 * goes out with the ignore bit. A step is over when the register is clear again after its command has certainly
 * arrived: a lost write sends it once more.
 *
 * Failures are counted as LinuxCNC does (hal-interface 4.6), but per channel: a remote that fails is stopped alone,
 * and the port only when no remote is left or the port itself does not follow.
 */
#include <hm2/sslbp.h>

#define MS              INT64_C(1000000)
#define START_LIMIT_NS  (2100 * MS) /* hal-interface 4.6 */
#define STOP_LIMIT_NS   (51 * MS)
#define JOB_LIMIT_NS    (1014 * MS)
#define RESET_LIMIT_NS  (1007 * MS)
#define BACKOFF_MIN_NS  (100 * MS)
#define BACKOFF_MAX_NS  (10000 * MS)
#define SETTLED_NS      (10000 * MS) /* of running without a failure: the next restart is quick again */
#define PROOF_TRANSFERS 50u          /* good ones before a remote that was lost is trusted again */

#define LBP_WRITE       0x64u
#define LBP_NONVOLATILE 0xEC000000u

void sslbp_engine_init(struct sslbp_engine *const engine)
{
    *engine = (struct sslbp_engine){.backoff_ns = BACKOFF_MIN_NS, .age = SSLBP_AGE_KNOWN};
}

/* ---- steps --------------------------------------------------------------------------------------------------------
 */

struct step {
    enum sslbp_port_state state;
    uint32_t command;
    int64_t limit_ns;      /* for the command; 0 = the step has none of its own */
    bool of_channel;       /* the command is for the job's channel */
    enum sslbp_step again; /* where to go on when it is not known whether the command has arrived */
    /* The command was carried out. */
    void (*done)(struct sslbp_engine *engine, const struct sslbp_reply *reply);
    /* What the host wants may end the step. */
    void (*obey)(struct sslbp_engine *engine, const struct sslbp_wish *wish);
};

static const struct step steps[SSLBP_STEPS];

static void enter(struct sslbp_engine *const engine, const enum sslbp_step step, const int64_t now_ns)
{
    engine->step = step;
    engine->sent = false;
    engine->since_ns = now_ns;
    engine->left_ns = 0;
}

static void fail(struct sslbp_engine *const engine, const int64_t now_ns)
{
    enter(engine, SSLBP_STEP_FAILED, now_ns);
    engine->retry_ns = now_ns + engine->backoff_ns;
}

static void end_job(struct sslbp_engine *const engine, const bool good)
{
    engine->job_state = good ? SSLBP_JOB_DONE : SSLBP_JOB_FAILED;
}

void sslbp_engine_restart(struct sslbp_engine *const engine)
{
    if (engine->job_state == SSLBP_JOB_WAITS)
        end_job(engine, false);
    engine->exchanged = 0;
    engine->scanned = false;
    engine->fresh = false;
    enter(engine, SSLBP_STEP_OFF, engine->since_ns);
}

/* Behind the highest channel with a remote; those beyond are never started, lost or counted. */
static unsigned channel_end(const struct sslbp_engine *const engine)
{
    return engine->mask ? 32u - (unsigned)__builtin_clz(engine->mask) : 0;
}

static unsigned started(const struct sslbp_engine *const engine, const bool lost_too)
{
    unsigned mask = 0;
    for (unsigned i = 0, end = channel_end(engine); i < end; i++)
        if (engine->channel[i].started && (lost_too || !engine->channel[i].lost))
            mask |= 1u << i;
    return mask;
}

/* ---- failures -----------------------------------------------------------------------------------------------------
 */

static void fill(uint32_t *const bucket, const uint32_t by)
{
    *bucket = *bucket > UINT32_MAX - by ? UINT32_MAX : *bucket + by;
}

static void leak(uint32_t *const bucket, const uint32_t by)
{
    *bucket -= *bucket > by ? by : *bucket;
}

static void lose(struct sslbp_channel *const channel, const enum sslbp_event event)
{
    channel->lost = true;
    channel->good = 0;
    channel->event = event;
}

/* A remote whose watchdog has bitten answers and drives nothing until the next START (seed 003, "NORMAL START"). */
static bool has_bitten(const struct sslbp_engine *const engine, const struct sslbp_channel *const channel)
{
    return sslbp_status(channel->cs, engine->minor, true).remote & SSLBP_WATCHDOG;
}

static void take_transfer(struct sslbp_engine *const engine, struct sslbp_channel *const channel, const bool failed,
                          const struct sslbp_wish *const wish)
{
    const bool bitten = has_bitten(engine, channel);
    channel->failing = failed || bitten;
    channel->errors += channel->failing;
    channel->good = failed && !bitten ? 0 : channel->good + (channel->good < UINT32_MAX);
    if (channel->lost)
        return;
    if (channel->failing)
        fill(&channel->bucket, wish->fault_inc);
    if (channel->bucket > wish->fault_lim)
        lose(channel, SSLBP_EVENT_LOST);
}

/* ---- replies ------------------------------------------------------------------------------------------------------
 */

static void take_cs(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    const unsigned mask = engine->mask;
    for (unsigned i = 0, end = channel_end(engine); i < end; i++)
        if (mask >> i & 1u)
            engine->channel[i].cs = reply->cs[i];
}

/* In step RUN with a clear register: the DOIT, when there was one, is over. */
static unsigned take_doit(struct sslbp_engine *const engine, const struct sslbp_reply *const reply,
                          const struct sslbp_wish *const wish)
{
    const unsigned exchanged = engine->exchanged;
    const unsigned failed = reply->data & exchanged;
    if (exchanged == 0)
        return 0;
    engine->exchanged = 0;
    engine->doit_ns = reply->now_ns - engine->sent_ns;
    take_cs(engine, reply);
    for (unsigned i = 0, end = channel_end(engine); i < end; i++)
        if (exchanged >> i & 1u)
            take_transfer(engine, &engine->channel[i], failed >> i & 1u, wish);
    return exchanged & ~failed & started(engine, false);
}

static bool is_same(const struct sslbp_identity *const a, const uint32_t user[3])
{
    return user[0] == a->unit && user[1] == a->name && user[2] == ((uint32_t)a->gtoc << 16 | a->ptoc);
}

static void take_start(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    const unsigned mask = engine->mask, failed = reply->data & mask;
    take_cs(engine, reply);
    for (unsigned i = 0, end = channel_end(engine); i < end; i++) {
        struct sslbp_channel *const channel = &engine->channel[i];
        if (!(mask >> i & 1u))
            continue;
        const bool same = is_same(&channel->identity, reply->user[i]);
        channel->started = !(failed >> i & 1u) && same;
        channel->failing = !channel->started;
        channel->bucket = channel->good = 0;
        channel->lost = false;
        if (!channel->started)
            lose(channel, failed >> i & 1u ? SSLBP_EVENT_NOT_STARTED : SSLBP_EVENT_OTHER);
    }
    engine->bucket = 0;
    if (started(engine, true))
        enter(engine, SSLBP_STEP_RUN, reply->now_ns);
    else
        fail(engine, reply->now_ns);
}

/* A step of a job is over, next is where a good one leads. */
static void take_job(struct sslbp_engine *const engine, const struct sslbp_reply *const reply,
                     const enum sslbp_step next)
{
    const bool failed = reply->data >> engine->job.channel & 1u;
    if (failed)
        end_job(engine, false);
    /* After a failed write the way to the non-volatile memory is closed all the same. */
    enter(engine, failed && next != SSLBP_STEP_JOB_CLOSE ? SSLBP_STEP_JOB_END : next, reply->now_ns);
}

static void job_halt_done(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    enter(engine, SSLBP_STEP_JOB_START, reply->now_ns);
}

static void job_start_done(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    take_job(engine, reply, engine->job.nonvolatile ? SSLBP_STEP_JOB_OPEN : SSLBP_STEP_JOB_WRITE);
}

static void job_open_done(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    take_job(engine, reply, SSLBP_STEP_JOB_WRITE);
}

static void job_write_done(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    take_job(engine, reply, engine->job.nonvolatile ? SSLBP_STEP_JOB_CLOSE : SSLBP_STEP_JOB_END);
}

static void job_close_done(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    take_job(engine, reply, SSLBP_STEP_JOB_END);
}

static void job_end_done(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    if (engine->job_state == SSLBP_JOB_WAITS)
        end_job(engine, true);
    enter(engine, SSLBP_STEP_SCAN, reply->now_ns);
}

static void release_done(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    enter(engine, SSLBP_STEP_HALT, reply->now_ns);
}

static void halt_done(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    enter(engine, engine->scanned ? SSLBP_STEP_START : SSLBP_STEP_SCAN, reply->now_ns);
}

static void stop_done(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    if (engine->after_stop_failed)
        fail(engine, reply->now_ns);
    else
        enter(engine, SSLBP_STEP_OFF, reply->now_ns);
}

/* A command that is not carried out in time. */
static void check_time(struct sslbp_engine *const engine, const int64_t now_ns)
{
    engine->left_ns = steps[engine->step].limit_ns - (now_ns - engine->sent_ns);
    if (engine->left_ns > 0)
        return;
    if (engine->job_state == SSLBP_JOB_WAITS)
        end_job(engine, false);
    fail(engine, now_ns);
}

/* Did the card carry out the write with our last command, and nothing behind it? A plain reply says so of the last
 * write only: when a reply was lost in between, a clear register may mean that the command never arrived. An early one
 * tells of the write before too. When an older write has come in front of our last one, it may have begun a transfer,
 * during which the port takes no command: what the registers show is then the end of that one. */
static bool is_certain(const struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    if (engine->age == SSLBP_AGE_LAST)
        return !reply->write_lost && (!reply->early || reply->in_order);
    if (engine->age == SSLBP_AGE_SECOND && reply->in_order)
        return true;
    return engine->age == SSLBP_AGE_KNOWN || !engine->clear;
}

HM2_RARE static void take_uncertain(struct sslbp_engine *const engine, const struct sslbp_reply *const reply)
{
    engine->exchanged = 0;
    if (engine->sent)
        enter(engine, steps[engine->step].again, reply->now_ns);
}

unsigned sslbp_engine_take(struct sslbp_engine *const engine, const struct sslbp_reply *const reply,
                           const struct sslbp_wish *const wish)
{
    engine->fresh = true;
    engine->clear = (reply->command & 0xFFFFu) == 0;
    for (unsigned i = 0, end = channel_end(engine); i < end; i++)
        engine->channel[i].event = SSLBP_EVENT_NONE;
    const bool certain = is_certain(engine, reply);
    engine->unfinished =
        reply->early && engine->age == SSLBP_AGE_LAST && engine->step == SSLBP_STEP_RUN && !engine->clear;
    engine->age = SSLBP_AGE_KNOWN;
    if (!certain)
        take_uncertain(engine, reply);
    else if (engine->step == SSLBP_STEP_RUN && engine->clear)
        return take_doit(engine, reply, wish);
    else if (engine->step == SSLBP_STEP_RUN)
        fill(&engine->bucket, engine->unfinished ? 0 : wish->fault_inc); /* the cycle is too short, or the port hangs */
    else if (engine->sent && engine->step == SSLBP_STEP_RESET)
        enter(engine, SSLBP_STEP_RELEASE, reply->now_ns);
    else if (engine->sent && engine->clear)
        steps[engine->step].done(engine, reply);
    else if (engine->sent)
        check_time(engine, reply->now_ns);
    return 0;
}

/* ---- orders -------------------------------------------------------------------------------------------------------
 */

static void begin_start(struct sslbp_engine *const engine, const int64_t now_ns)
{
    /* A register that never becomes clear takes nothing but a reset of the port's processor. */
    enter(engine, engine->clear ? SSLBP_STEP_HALT : SSLBP_STEP_RESET, now_ns);
    engine->scanned = false;
}

static void stop(struct sslbp_engine *const engine, const bool failed, const int64_t now_ns)
{
    engine->exchanged = 0;
    engine->after_stop_failed = failed;
    enter(engine, SSLBP_STEP_STOP, now_ns);
}

static void restart_soon(struct sslbp_engine *const engine, const int64_t now_ns)
{
    engine->restarts++;
    engine->backoff_ns = 2 * engine->backoff_ns > BACKOFF_MAX_NS ? BACKOFF_MAX_NS : 2 * engine->backoff_ns;
    begin_start(engine, now_ns);
}

/* Remotes that answer again: without a fault they go on at once; one whose watchdog has bitten needs a START, which
 * concerns all remotes of the port, at the earliest when the back-off has passed. */
static void bring_back(struct sslbp_engine *const engine, const struct sslbp_wish *const wish)
{
    for (unsigned i = 0, end = channel_end(engine); i < end; i++) {
        struct sslbp_channel *const channel = &engine->channel[i];
        if (!channel->lost || !channel->started || channel->good < PROOF_TRANSFERS)
            continue;
        if (has_bitten(engine, channel)) {
            if (wish->now_ns - engine->since_ns < engine->backoff_ns)
                continue;
            restart_soon(engine, wish->now_ns);
            return;
        }
        channel->lost = false;
        channel->bucket = 0;
        channel->event = SSLBP_EVENT_BACK;
    }
}

static bool any_lost(const struct sslbp_engine *const engine)
{
    for (unsigned i = 0, end = channel_end(engine); i < end; i++)
        if (engine->channel[i].lost && engine->channel[i].started)
            return true;
    return false;
}

static void leak_all(struct sslbp_engine *const engine, const uint32_t by)
{
    leak(&engine->bucket, by);
    for (unsigned i = 0, end = channel_end(engine); i < end; i++)
        leak(&engine->channel[i].bucket, by);
}

static void run(struct sslbp_engine *const engine, const struct sslbp_wish *const wish,
                struct sslbp_orders *const orders)
{
    if (engine->bucket > wish->fault_lim || (!started(engine, false) && !wish->restart)) {
        stop(engine, true, wish->now_ns);
        return;
    }
    leak_all(engine, wish->fault_dec);
    if (any_lost(engine) && wish->restart)
        bring_back(engine, wish);
    else if (!any_lost(engine) && wish->now_ns - engine->since_ns > SETTLED_NS)
        engine->backoff_ns = BACKOFF_MIN_NS;
    if (engine->step != SSLBP_STEP_RUN)
        return;
    const unsigned driven = started(engine, false);
    orders->silent = (uint8_t)(engine->mask & ~driven);
    if (!engine->fresh || !engine->clear) {
        engine->skipped++;
        return;
    }
    engine->exchanged = (uint8_t)started(engine, wish->restart);
    engine->sent_ns = wish->now_ns;
    orders->outputs = (uint8_t)driven;
    orders->command = SSLBP_DOIT | engine->exchanged;
}

static void order_job(const struct sslbp_engine *const engine, struct sslbp_orders *const orders)
{
    const struct sslbp_job *const job = &engine->job;
    if (engine->step != SSLBP_STEP_JOB_OPEN && engine->step != SSLBP_STEP_JOB_WRITE &&
        engine->step != SSLBP_STEP_JOB_CLOSE)
        return;
    const bool write = engine->step == SSLBP_STEP_JOB_WRITE;
    const uint32_t size = job->bytes == 8 ? 3 : job->bytes == 4 ? 2 : job->bytes == 2 ? 1 : 0;
    orders->job = true;
    orders->job_channel = job->channel;
    orders->job_cs = write ? (LBP_WRITE | size) << 24 | job->address : LBP_NONVOLATILE;
    orders->job_value = write ? job->value : engine->step == SSLBP_STEP_JOB_OPEN;
}

/* The command of the present step, once the register is free for it. */
static void order_command(struct sslbp_engine *const engine, const int64_t now_ns, struct sslbp_orders *const orders)
{
    const bool reset = engine->step == SSLBP_STEP_RESET || engine->step == SSLBP_STEP_RELEASE;
    orders->silent = engine->mask;
    order_job(engine, orders);
    if (engine->sent || !engine->fresh)
        return;
    if (!engine->clear && !reset) {
        if (now_ns - engine->since_ns > START_LIMIT_NS)
            fail(engine, now_ns);
        return;
    }
    const unsigned channels = engine->step == SSLBP_STEP_START ? engine->mask
                              : steps[engine->step].of_channel ? 1u << engine->job.channel
                                                               : 0;
    orders->command = steps[engine->step].command | channels;
    engine->sent = true;
    engine->sent_ns = now_ns;
}

static void off_obeys(struct sslbp_engine *const engine, const struct sslbp_wish *const wish)
{
    if (wish->run && engine->fresh)
        begin_start(engine, wish->now_ns);
}

static void run_obeys(struct sslbp_engine *const engine, const struct sslbp_wish *const wish)
{
    if (!wish->run)
        stop(engine, false, wish->now_ns);
}

static void scan_obeys(struct sslbp_engine *const engine, const struct sslbp_wish *const wish)
{
    if (!wish->run)
        enter(engine, SSLBP_STEP_OFF, wish->now_ns);
    else if (engine->scanned)
        enter(engine, SSLBP_STEP_START, wish->now_ns);
}

static void failed_obeys(struct sslbp_engine *const engine, const struct sslbp_wish *const wish)
{
    if (!wish->run)
        enter(engine, SSLBP_STEP_OFF, wish->now_ns);
    else if (wish->restart && engine->fresh && wish->now_ns >= engine->retry_ns)
        restart_soon(engine, wish->now_ns);
}

static const struct step steps[SSLBP_STEPS] = {
    [SSLBP_STEP_OFF] = {.state = SSLBP_IDLE, .obey = off_obeys},
    [SSLBP_STEP_SCAN] = {.state = SSLBP_IDLE, .obey = scan_obeys},
    [SSLBP_STEP_RUN] = {.state = SSLBP_RUNNING, .obey = run_obeys},
    [SSLBP_STEP_FAILED] = {.state = SSLBP_ERROR, .obey = failed_obeys},
    [SSLBP_STEP_RESET] = {SSLBP_STARTING, SSLBP_RESET, RESET_LIMIT_NS, false, SSLBP_STEP_RESET, NULL, NULL},
    [SSLBP_STEP_RELEASE] = {SSLBP_STARTING, SSLBP_RELEASE, RESET_LIMIT_NS, false, SSLBP_STEP_RESET, release_done, NULL},
    [SSLBP_STEP_HALT] = {SSLBP_STARTING, SSLBP_STOP, STOP_LIMIT_NS, false, SSLBP_STEP_HALT, halt_done, NULL},
    [SSLBP_STEP_START] = {SSLBP_STARTING, SSLBP_START, START_LIMIT_NS, false, SSLBP_STEP_HALT, take_start, NULL},
    [SSLBP_STEP_STOP] = {SSLBP_STOPPING, SSLBP_STOP, STOP_LIMIT_NS, false, SSLBP_STEP_STOP, stop_done, NULL},
    [SSLBP_STEP_JOB_HALT] = {SSLBP_IDLE, SSLBP_STOP, STOP_LIMIT_NS, false, SSLBP_STEP_JOB_HALT, job_halt_done, NULL},
    [SSLBP_STEP_JOB_START] = {SSLBP_IDLE, SSLBP_START_SETUP, START_LIMIT_NS, true, SSLBP_STEP_JOB_HALT, job_start_done,
                              NULL},
    [SSLBP_STEP_JOB_OPEN] = {SSLBP_IDLE, SSLBP_DOIT, JOB_LIMIT_NS, true, SSLBP_STEP_JOB_HALT, job_open_done, NULL},
    [SSLBP_STEP_JOB_WRITE] = {SSLBP_IDLE, SSLBP_DOIT, JOB_LIMIT_NS, true, SSLBP_STEP_JOB_HALT, job_write_done, NULL},
    [SSLBP_STEP_JOB_CLOSE] = {SSLBP_IDLE, SSLBP_DOIT, JOB_LIMIT_NS, true, SSLBP_STEP_JOB_HALT, job_close_done, NULL},
    [SSLBP_STEP_JOB_END] = {SSLBP_IDLE, SSLBP_STOP, STOP_LIMIT_NS, false, SSLBP_STEP_JOB_END, job_end_done, NULL},
};

struct sslbp_orders sslbp_engine_next(struct sslbp_engine *const engine, const struct sslbp_wish *const wish)
{
    struct sslbp_orders orders = {.command = SSLBP_IGNORE};
    if (wish->hold) {
        if (!engine->held)
            sslbp_engine_restart(engine);
    } else if (steps[engine->step].obey) {
        steps[engine->step].obey(engine, wish);
    }
    engine->held = wish->hold;
    if (engine->step == SSLBP_STEP_RUN)
        run(engine, wish, &orders);
    /* Also when running has just ended. */
    if (engine->step != SSLBP_STEP_RUN) {
        orders.silent = engine->mask;
        orders.outputs = 0;
        if (!wish->hold && steps[engine->step].limit_ns)
            order_command(engine, wish->now_ns, &orders);
    }
    engine->fresh = false;
    engine->age = !(orders.command & SSLBP_IGNORE)  ? SSLBP_AGE_LAST
                  : engine->age == SSLBP_AGE_LAST   ? SSLBP_AGE_SECOND
                  : engine->age == SSLBP_AGE_SECOND ? SSLBP_AGE_UNKNOWN
                                                    : engine->age;
    return orders;
}

void sslbp_engine_job(struct sslbp_engine *const engine, const struct sslbp_job *const job)
{
    engine->job = *job;
    engine->job_state = SSLBP_JOB_WAITS;
    enter(engine, SSLBP_STEP_JOB_HALT, engine->since_ns);
}

void sslbp_engine_scanned(struct sslbp_engine *const engine)
{
    engine->scanned = true;
}

enum sslbp_port_state sslbp_engine_state(const struct sslbp_engine *const engine)
{
    if (engine->step == SSLBP_STEP_STOP && engine->after_stop_failed)
        return SSLBP_ERROR;
    if (engine->step == SSLBP_STEP_STOP && engine->sent)
        return SSLBP_WAITS_FOR_STOP;
    return steps[engine->step].state;
}

uint32_t sslbp_engine_faults(const struct sslbp_engine *const engine)
{
    uint32_t most = engine->bucket;
    for (unsigned i = 0, end = channel_end(engine); i < end; i++)
        if (engine->channel[i].bucket > most)
            most = engine->channel[i].bucket;
    return most;
}
