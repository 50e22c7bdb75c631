/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Realtime threads. POSIX threads exist from start to stop; the loop sleeps to absolute times, calls the functions
 * of its schedule and counts. It takes no lock, allocates nothing and formats nothing.
 *
 * A cycle that ends after the next one should have begun is an overrun. The next cycle then begins at once; whole
 * periods that have passed are left out and counted as missed, so cycles never run in a burst and keep their phase.
 */
#include "processor.h"
#include "state.h"

#include <errno.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

enum {
    NS_PER_S = 1000000000,
    STACK_BYTES = 1 << 20,
    TOP_PRIORITY = 90, /* below the kernel's own threads; each slower thread gets one less, as in LinuxCNC */
    MIN_PERIOD_NS = 1000,
    SLICE_NS = 100000000, /* a sleeping thread looks at the stop flag this often */
    STOP_NS_LIMIT_S = 5,  /* a function that takes longer is taken to hang */
    QUIESCE_STEP_NS = 20000,
    START_LEAD_NS = 1000000, /* from the last thread's creation to time zero: for each to see it */
};

int64_t hh_now_ns(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * NS_PER_S + now.tv_nsec;
}

static struct timespec to_timespec(const int64_t ns)
{
    return (struct timespec){.tv_sec = (time_t)(ns / NS_PER_S), .tv_nsec = (long)(ns % NS_PER_S)};
}

/* ---- the loop --------------------------------------------------------------------------------------------------- */

static void count(_Atomic uint64_t *const counter, const uint64_t more)
{
    /* Only this thread writes it. */
    atomic_store_explicit(counter, atomic_load_explicit(counter, memory_order_relaxed) + more, memory_order_relaxed);
}

static void set_s32(volatile void *const address, const int64_t value)
{
    hh_store(address, (struct hh_value){.type = HAL_S32, .s = value > INT32_MAX ? INT32_MAX : (int32_t)value});
}

/* Returns false when the thread shall end. */
static bool sleep_until(const struct hh_thread *const thread, const int64_t due_ns)
{
    int64_t now_ns = due_ns - SLICE_NS;
    if (thread->period_ns > SLICE_NS)
        now_ns = hh_now_ns();
    while (!atomic_load_explicit(&thread->stop, memory_order_acquire)) {
        const bool last = due_ns - now_ns <= SLICE_NS;
        const struct timespec until = to_timespec(last ? due_ns : now_ns + SLICE_NS);
        if (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) != 0)
            continue;
        if (last)
            return !atomic_load_explicit(&thread->stop, memory_order_acquire);
        now_ns += SLICE_NS;
    }
    return false;
}

static int64_t call(struct hh_thread *const thread, struct hh_funct *const funct, const int64_t begin_ns)
{
    atomic_store_explicit(&thread->current, funct, memory_order_relaxed);
    funct->code(funct->arg, thread->period_ns);
    const int64_t end_ns = hh_now_ns();
    const int64_t taken_ns = end_ns - begin_ns;
    if (funct->time)
        set_s32(*funct->time, taken_ns);
    const bool increased = taken_ns > hh_load(HAL_S32, funct->tmax).s;
    if (increased)
        set_s32(funct->tmax, taken_ns);
    hh_store(funct->tmax_increased, (struct hh_value){.type = HAL_BIT, .b = increased});
    return end_ns;
}

static int64_t run_cycle(struct hh_thread *const thread, const int64_t begin_ns)
{
    const uint64_t epoch = atomic_load_explicit(&thread->epoch, memory_order_relaxed);
    /* Sequentially consistent, like the exchange and the look at the epoch on the other side: either the new schedule
     * is seen here or the running cycle is seen there. */
    atomic_store(&thread->epoch, epoch + 1);
    const struct hh_schedule *const schedule = atomic_load(&thread->schedule);
    int64_t now_ns = begin_ns;
    for (size_t i = 0; schedule && i < schedule->count; i++)
        now_ns = call(thread, schedule->functs[i], now_ns);
    atomic_store_explicit(&thread->current, NULL, memory_order_relaxed);
    atomic_store_explicit(&thread->epoch, epoch + 2, memory_order_release);
    return now_ns;
}

static void record(struct hh_thread *const thread, const int64_t latency_ns, const int64_t busy_ns)
{
    count(&thread->cycles, 1);
    histogram_add(&thread->latency, latency_ns);
    histogram_add(&thread->busy, busy_ns);
    set_s32(*thread->time, busy_ns);
    if (busy_ns > hh_load(HAL_S32, thread->tmax).s)
        set_s32(thread->tmax, busy_ns);
}

static void nap(void)
{
    const struct timespec step = {.tv_nsec = QUIESCE_STEP_NS};
    (void)clock_nanosleep(CLOCK_MONOTONIC, 0, &step, NULL);
}

/* When the first cycle is due: not before all threads exist, because a locked stack takes milliseconds to make. 0 when
 * the thread shall end before. */
static int64_t await_first(const struct hh_thread *const thread)
{
    int64_t first_ns = 0;
    while (!first_ns && !atomic_load_explicit(&thread->stop, memory_order_acquire)) {
        first_ns = atomic_load_explicit(&thread->first_ns, memory_order_acquire);
        if (!first_ns)
            nap();
    }
    return first_ns;
}

static void *thread_main(void *const argument)
{
    struct hh_thread *const thread = argument;
    hh_task_enter(thread->id);
    int64_t due_ns = await_first(thread), last_ns = 0;
    while (sleep_until(thread, due_ns)) {
        const int64_t begin_ns = hh_now_ns();
        const int64_t end_ns = run_cycle(thread, begin_ns);
        record(thread, begin_ns - due_ns, end_ns - begin_ns);
        if (last_ns)
            histogram_add(&thread->interval, begin_ns - last_ns);
        last_ns = begin_ns;
        due_ns += thread->period_ns;
        if (end_ns > due_ns) {
            const int64_t passed = (end_ns - due_ns) / thread->period_ns; /* period_ns > 0: checked at creation */
            count(&thread->overruns, 1);
            count(&thread->missed, (uint64_t)passed);
            due_ns += passed * thread->period_ns;
        }
    }
    return NULL;
}

int hh_thread_quiesce(const struct hh_thread *const thread, struct hm2_diag *const diag)
{
    if (!thread->created)
        return 0;
    const uint64_t epoch = atomic_load(&thread->epoch);
    const int64_t limit_ns = hh_now_ns() + (int64_t)STOP_NS_LIMIT_S * NS_PER_S;
    while (epoch % 2 && atomic_load(&thread->epoch) == epoch) {
        if (hh_now_ns() > limit_ns)
            return hm2_diag_add(diag, HM2_ERR_TIMEOUT, "thread '%s' has not ended its cycle for %d s",
                                thread->names.name, STOP_NS_LIMIT_S);
        nap();
    }
    return 0;
}

/* ---- start and stop --------------------------------------------------------------------------------------------- */

/* The processor that threads are bound to, or -1. One for all: HAL functions of a slow thread expect to be interrupted
 * by those of a fast one, not to run beside them. */
static int choose_cpu(const struct halhost_options *const options)
{
    if (options->cpu >= 0)
        return options->cpu;
    return options->cpu == HALHOST_CPU_ANY || options->no_realtime ? -1 : hh_processor_choose();
}

static int create(struct hh *const host, struct hh_thread *const thread, const bool realtime)
{
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes))
        return ENOMEM;
    (void)pthread_attr_setstacksize(&attributes, STACK_BYTES);
    if (realtime) {
        const int priority = TOP_PRIORITY - thread->priority;
        const struct sched_param param = {.sched_priority = priority > 1 ? priority : 1};
        (void)pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
        (void)pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
        (void)pthread_attr_setschedparam(&attributes, &param);
    }
    /* Without realtime priority it would wait for whatever runs there: only where that was asked for. */
    if (host->cpu >= 0 && host->cpu < CPU_SETSIZE && (realtime || host->options.cpu >= 0)) {
        cpu_set_t set;
        CPU_ZERO(&set);
        CPU_SET((size_t)host->cpu, &set);
        (void)pthread_attr_setaffinity_np(&attributes, sizeof set, &set);
    }
    /* Signals are for the program's thread. */
    sigset_t all, before;
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    const int error = pthread_create(&thread->thread, &attributes, thread_main, thread);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    (void)pthread_attr_destroy(&attributes);
    thread->realtime = realtime && error == 0;
    return error;
}

static void lock_memory(struct hh *const host)
{
    if (host->options.no_realtime || host->memory_locked)
        return;
    host->memory_locked = true;
    if (mlockall(MCL_CURRENT | MCL_FUTURE))
        hh_say(host, "warning: cannot lock memory (%s): page faults may delay threads; raise the memlock limit\n",
               strerror(errno));
}

static void warn_realtime(struct hh *const host, const int error)
{
    if (host->realtime_warned)
        return;
    host->realtime_warned = true;
    if (host->options.no_realtime)
        hh_say(host, "threads run without realtime priority, as asked: their timing is not guaranteed\n");
    else
        hh_say(host,
               "warning: no realtime rights (%s): threads run with normal priority, their timing is not guaranteed; "
               "allow it with CAP_SYS_NICE or an rtprio limit\n",
               strerror(error));
}

static int start_one(struct hh *const host, struct hh_thread *const thread, struct hm2_diag *const diag)
{
    atomic_store(&thread->first_ns, 0);
    atomic_store(&thread->stop, false);
    int error = host->options.no_realtime ? EPERM : create(host, thread, true);
    if (error == EPERM) {
        warn_realtime(host, error);
        error = create(host, thread, false);
    }
    thread->created = error == 0;
    return error
               ? hm2_diag_add(diag, HM2_ERR_NOMEM, "cannot start thread '%s': %s", thread->names.name, strerror(error))
               : 0;
}

static void let_go(struct hh_thread *const thread, const int64_t zero_ns)
{
    atomic_store_explicit(&thread->first_ns, zero_ns + thread->period_ns, memory_order_release);
}

int hh_threads_start(struct hh *const host, struct hm2_diag *const diag)
{
    if (host->lock & HAL_LOCK_RUN)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: threads are not started now");
    /* Threads that a component has asked to stop are still to be collected. */
    for (size_t i = 0; i < host->threads.count; i++) {
        const struct hh_thread *const thread = host->threads.items[i];
        if (thread->created && atomic_load(&thread->stop))
            host->running = hh_threads_stop(host, diag) != 0;
    }
    if (host->running)
        return 0;
    lock_memory(host);
    host->cpu = choose_cpu(&host->options);
    host->running = true;
    for (size_t i = 0; i < host->threads.count; i++) {
        const int err = start_one(host, host->threads.items[i], diag);
        if (err) {
            (void)hh_threads_stop(host, diag);
            return err;
        }
    }
    const int64_t zero_ns = hh_now_ns() + START_LEAD_NS;
    for (size_t i = 0; i < host->threads.count; i++)
        let_go(host->threads.items[i], zero_ns);
    return 0;
}

void hh_threads_ask_to_stop(struct hh *const host)
{
    for (size_t i = 0; i < host->threads.count; i++) {
        struct hh_thread *const thread = host->threads.items[i];
        atomic_store_explicit(&thread->stop, true, memory_order_release);
    }
}

/* Tried again and again: of the joins with a time limit one measures it by the time of day, which may be set meanwhile,
 * and the other is unknown to thread sanitizers. */
static int join(struct hh_thread *const thread, struct hm2_diag *const diag)
{
    if (!thread->created)
        return 0;
    const int64_t limit_ns = hh_now_ns() + (int64_t)STOP_NS_LIMIT_S * NS_PER_S;
    while (pthread_tryjoin_np(thread->thread, NULL)) {
        if (hh_now_ns() <= limit_ns) {
            nap();
            continue;
        }
        const struct hh_funct *const funct = atomic_load(&thread->current);
        return hm2_diag_add(diag, HM2_ERR_TIMEOUT, "thread '%s' does not stop: function '%s' has not returned for %d s",
                            thread->names.name, funct ? funct->names.name : "?", STOP_NS_LIMIT_S);
    }
    thread->created = false;
    return 0;
}

int hh_threads_stop(struct hh *const host, struct hm2_diag *const diag)
{
    hh_threads_ask_to_stop(host);
    int err = 0;
    for (size_t i = 0; i < host->threads.count; i++) {
        const int failed = join(host->threads.items[i], diag);
        err = err ? err : failed;
    }
    host->running = err != 0;
    hh_messages_drain(host->messages);
    return err;
}

/* ---- creation --------------------------------------------------------------------------------------------------- */

struct hh_thread *hh_thread_find(const struct hh *const host, const char *const name)
{
    for (size_t i = 0; i < host->threads.count; i++) {
        struct hh_thread *const thread = host->threads.items[i];
        if (strcmp(thread->names.name, name) == 0)
            return thread;
    }
    return NULL;
}

struct times {
    hal_s32_t *time;
    hal_s32_t tmax;
};

/* The component "__NAME" that owns the thread's time pin, as in LinuxCNC. */
static int create_comp(struct hh *const host, struct hh_thread *const thread, struct hm2_diag *const diag)
{
    char name[HH_NAME_SIZE + 8];
    if (rtapi_snprintf(name, sizeof name, "__%s", thread->names.name) < 0)
        return HM2_ERR_INVALID;
    struct times *const times = hal_malloc((long)sizeof *times);
    const int id = times ? hal_init(name) : 0;
    if (id <= 0)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "cannot create component '%s' for the thread", name);
    thread->comp = hh_comp_find(host, id);
    thread->time = &times->time;
    thread->tmax = &times->tmax;
    (void)rtapi_snprintf(name, sizeof name, "%s.time", thread->names.name);
    int err = hh_pin_new(host, name, HAL_S32, HAL_OUT, HH_SLOT(&times->time), id, diag);
    (void)rtapi_snprintf(name, sizeof name, "%s.tmax", thread->names.name);
    if (!err)
        err = hh_param_new(host, name, HAL_S32, HAL_RW, &times->tmax, id, diag);
    if (!err)
        err = hal_ready(id) ? HM2_ERR_HOST : 0;
    if (err)
        (void)hh_comp_remove(host, thread->comp, NULL);
    return err;
}

/* Threads are created fastest first; the others get the nearest multiple of the fastest one's period. */
static int choose_period(const struct hh *const host, struct hh_thread *const thread, const unsigned long period_ns,
                         struct hm2_diag *const diag)
{
    if (period_ns < MIN_PERIOD_NS || period_ns > INT32_MAX)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "thread '%s': a period of %lu ns is not within %d to %d ns",
                            thread->names.name, period_ns, MIN_PERIOD_NS, INT32_MAX);
    thread->period_ns = (long)period_ns;
    if (host->threads.count == 0)
        return 0;
    const long base_ns = ((const struct hh_thread *)host->threads.items[0])->period_ns;
    if (thread->period_ns < base_ns)
        return hm2_diag_add(diag, HM2_ERR_RANGE,
                            "thread '%s': its period %ld ns is shorter than the first thread's %ld ns; the fastest "
                            "thread must come first",
                            thread->names.name, thread->period_ns, base_ns);
    thread->period_ns = (long)(((int64_t)thread->period_ns + base_ns / 2) / base_ns * base_ns); /* base_ns > 0 */
    return 0;
}

int hh_thread_new(struct hh *const host, const char *const name, const unsigned long period_ns, const bool uses_fp,
                  struct hm2_diag *const diag)
{
    if (host->lock & HAL_LOCK_CONFIG)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no new threads now");
    int err = hh_check_name("thread", name, diag);
    if (err)
        return err;
    if (strlen(name) + strlen(".time") > HH_NAME_LEN)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "thread name '%s' is too long for its pin '.time'", name);
    if (hh_thread_find(host, name))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "there is already a thread '%s'", name);
    struct hh_thread *const thread = calloc(1, sizeof *thread);
    if (!thread)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for thread '%s'", name);
    memcpy(thread->names.name, name, strlen(name) + 1);
    thread->uses_fp = uses_fp;
    thread->id = host->last_task++;
    thread->priority = (int)host->threads.count;
    err = choose_period(host, thread, period_ns, diag);
    if (!err)
        err = create_comp(host, thread, diag);
    if (!err && hh_list_insert(&host->threads, host->threads.count, thread)) {
        (void)hh_comp_remove(host, thread->comp, NULL);
        err = hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for thread '%s'", name);
    }
    if (err) {
        free(thread);
        return err;
    }
    if (!host->running)
        return 0;
    err = start_one(host, thread, diag);
    if (!err)
        let_go(thread, hh_now_ns());
    return err;
}

int hh_thread_delete(struct hh *const host, struct hh_thread *const thread, struct hm2_diag *const diag)
{
    atomic_store(&thread->stop, true);
    int err = join(thread, diag);
    if (!err)
        err = hh_schedule_clear(host, thread, diag);
    if (err)
        return err;
    struct hh_comp *const comp = thread->comp;
    thread->comp = NULL;
    hh_list_remove(&host->threads, thread);
    free(thread);
    return comp ? hh_comp_remove(host, comp, diag) : 0;
}

int hh_threads_remove(struct hh *const host, const struct hh_comp *const comp, struct hm2_diag *const diag)
{
    for (size_t i = host->threads.count; i-- > 0;) {
        struct hh_thread *const thread = host->threads.items[i];
        if (thread->comp != comp)
            continue;
        int err = hh_threads_stop(host, diag);
        thread->comp = NULL; /* the caller removes it */
        if (!err)
            err = hh_thread_delete(host, thread, diag);
        if (err)
            return err;
    }
    return 0;
}

/* ---- the calls of components ------------------------------------------------------------------------------------ */

int hal_create_thread(const char *const name, const unsigned long period_ns, const int uses_fp)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_create_thread", &status);
    if (!host)
        return status;
    const int err = hh_thread_new(host, name, period_ns, uses_fp != 0, &diag);
    return err ? hh_report(err, &diag) : (int)host->threads.count;
}

int hal_thread_delete(const char *const name)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_thread_delete", &status);
    if (!host)
        return status;
    struct hh_thread *const thread = hh_thread_find(host, name);
    return hh_report(thread ? hh_thread_delete(host, thread, &diag)
                            : hm2_diag_add(&diag, HM2_ERR_INVALID, "there is no thread '%s'", name),
                     &diag);
}

int hal_start_threads(void)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_start_threads", &status);
    return host ? hh_report(hh_threads_start(host, &diag), &diag) : status;
}

int hal_stop_threads(void)
{
    struct hh *const host = hh_host();
    if (!host)
        return -EINVAL;
    if (rtapi_task_self() >= 0) {
        hh_threads_ask_to_stop(host);
        return 0;
    }
    struct hm2_diag diag = {0};
    return hh_report(hh_threads_stop(host, &diag), &diag);
}
