/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Components, functions, threads, time. */
#include "commands.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int run_loadrt(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    (void)session;
    return halhost_load(args[0], (const char *const *)args + 1, count - 1, diag);
}

static int run_unloadrt(struct hal_session *const session, char *const *const args, const size_t count,
                        struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    return strcmp(args[0], "all") == 0 ? halhost_unload_all(diag) : halhost_unload(args[0], diag);
}

/* Programs with pins of their own need HAL memory shared between processes, which only LinuxCNC has. */
static int run_loadusr(struct hal_session *const session, char *const *const args, const size_t count,
                       struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                        "loadusr %s: this host runs realtime components only; programs with HAL pins need LinuxCNC",
                        args[0]);
}

/* There are no user space components to wait for or to unload. */
static int run_nothing(struct hal_session *const session, char *const *const args, const size_t count,
                       struct hm2_diag *const diag)
{
    (void)session;
    (void)args;
    (void)count;
    (void)diag;
    return 0;
}

static int run_addf(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)session;
    long position = -1;
    if (count > 2) {
        char *end;
        errno = 0;
        position = strtol(args[2], &end, 10);
        if (end == args[2] || *end || errno || position < -100000 || position > 100000)
            return hm2_diag_add(diag, HM2_ERR_INVALID, "'%s' is not a position (1 = first, -1 = last)", args[2]);
    }
    return hh_funct_add(hh_host(), args[0], args[1], (int)position, diag);
}

static int run_delf(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    return hh_funct_delete(hh_host(), args[0], args[1], diag);
}

static int run_start(struct hal_session *const session, char *const *const args, const size_t count,
                     struct hm2_diag *const diag)
{
    (void)args;
    (void)count;
    return session->options.threads ? halhost_start(diag)
                                    : hm2_diag_add(diag, HM2_ERR_STATE, "threads are not available here");
}

static int run_stop(struct hal_session *const session, char *const *const args, const size_t count,
                    struct hm2_diag *const diag)
{
    (void)session;
    (void)args;
    (void)count;
    return hh_host()->lock & HAL_LOCK_RUN
               ? hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: threads are not stopped now")
               : halhost_stop(diag);
}

/* ---- run -------------------------------------------------------------------------------------------------------- */

/* A component may ask all threads to stop. */
static bool all_stopped(const struct hh *const host)
{
    for (size_t i = 0; i < host->threads.count; i++) {
        const struct hh_thread *const thread = host->threads.items[i];
        if (!atomic_load(&thread->stop))
            return false;
    }
    return true;
}

static int run_run(struct hal_session *const session, char *const *const args, const size_t count,
                   struct hm2_diag *const diag)
{
    (void)count;
    const struct hh *const host = hh_host();
    const double longest_s = 1e9;
    const int64_t slice_ns = 100000000;
    char *end;
    const double seconds = strtod(args[0], &end);
    if (end == args[0] || *end || !(seconds >= 0.0 && seconds <= longest_s))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "'%s' is not a number of seconds from 0 to 1e9", args[0]);
    if (!host->running)
        return hm2_diag_add(diag, HM2_ERR_STATE, "threads are not running: start them first");
    const int64_t end_ns = hh_now_ns() + (int64_t)(seconds * 1e9);
    for (int64_t now_ns = hh_now_ns(); now_ns < end_ns && !all_stopped(host) && session->options.wait;
         now_ns = hh_now_ns()) {
        const int64_t until_ns = end_ns - now_ns < slice_ns ? end_ns : now_ns + slice_ns;
        const enum hal_wait result = session->options.wait(session->options.context, until_ns);
        if (result == HAL_WAIT_TERMINATED)
            return hm2_diag_add(diag, HM2_ERR_STATE, "interrupted");
        if (result == HAL_WAIT_INTERRUPTED)
            break;
    }
    halhost_flush_messages();
    return 0;
}

/* ---- timing ----------------------------------------------------------------------------------------------------- */

struct kind {
    const char *name;
    const struct histogram *histogram;
};

enum { KINDS = 3 };

static void kinds_of(const struct hh_thread *const thread, struct kind kinds[const KINDS])
{
    kinds[0] = (struct kind){"busy", &thread->busy};
    kinds[1] = (struct kind){"latency", &thread->latency};
    kinds[2] = (struct kind){"interval", &thread->interval};
}

void hal_session_print_timing(struct hal_session *const session)
{
    const struct hh *const host = hh_host();
    hal_print(session, "Thread Timing (us):\n%-20s %10s %9s %9s  %-8s %10s %10s %10s\n", "Name", "Cycles", "Overruns",
              "Missed", "What", "Median", "99.9 %", "Max");
    for (size_t i = 0; host && i < host->threads.count; i++) {
        const struct hh_thread *const thread = host->threads.items[i];
        struct kind kinds[KINDS];
        kinds_of(thread, kinds);
        for (int k = 0; k < KINDS; k++) {
            const struct histogram *const histogram = kinds[k].histogram;
            if (k == 0)
                hal_print(session, "%-20s %10" PRIu64 " %9" PRIu64 " %9" PRIu64, thread->names.name,
                          atomic_load(&thread->cycles), atomic_load(&thread->overruns), atomic_load(&thread->missed));
            else
                hal_print(session, "%-20s %10s %9s %9s", "", "", "", "");
            hal_print(session, "  %-8s %10.1f %10.1f %10.1f\n", kinds[k].name,
                      (double)histogram_quantile_ns(histogram, 0.5) / 1e3,
                      (double)histogram_quantile_ns(histogram, 0.999) / 1e3, (double)histogram_max_ns(histogram) / 1e3);
        }
    }
    hal_print(session, "\n");
}

static int run_timing(struct hal_session *const session, char *const *const args, const size_t count,
                      struct hm2_diag *const diag)
{
    const struct hh *const host = hh_host();
    if (count == 0) {
        hal_session_print_timing(session);
        return 0;
    }
    if (strcmp(args[0], "reset") != 0)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "timing takes nothing or 'reset', not '%s'", args[0]);
    for (size_t i = 0; i < host->threads.count; i++) {
        struct hh_thread *const thread = host->threads.items[i];
        histogram_clear(&thread->busy);
        histogram_clear(&thread->latency);
        histogram_clear(&thread->interval);
        atomic_store(&thread->cycles, 0);
        atomic_store(&thread->overruns, 0);
        atomic_store(&thread->missed, 0);
        hh_store(thread->tmax, (struct hh_value){.type = HAL_S32});
    }
    return 0;
}

static void print_histograms(struct hal_session *const session, const struct hh_thread *const thread)
{
    struct kind kinds[KINDS];
    kinds_of(thread, kinds);
    for (int k = 0; k < KINDS; k++) {
        for (size_t i = 0; i < HISTOGRAM_BUCKETS; i++) {
            const uint64_t cycles = histogram_count(kinds[k].histogram, i);
            if (cycles)
                hal_print(session, "%s,%s,%" PRId64 ",%" PRId64 ",%" PRIu64 "\n", thread->names.name, kinds[k].name,
                          histogram_low_ns(i), histogram_low_ns(i + 1), cycles);
        }
    }
}

static int run_histogram(struct hal_session *const session, char *const *const args, const size_t count,
                         struct hm2_diag *const diag)
{
    const struct hh *const host = hh_host();
    const struct hh_thread *const thread = hh_thread_find(host, args[0]);
    if (!thread && strcmp(args[0], "all") != 0)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no thread '%s'", args[0]);
    const int err = count > 1 ? hal_open_output(session, args[1], diag) : 0;
    if (err)
        return err;
    hal_print(session, "thread,what,from_ns,to_ns,count\n");
    for (size_t i = 0; i < host->threads.count; i++) {
        if (!thread || thread == host->threads.items[i])
            print_histograms(session, host->threads.items[i]);
    }
    return count > 1 ? hal_close_output(session, args[1], diag) : 0;
}

static int run_debug(struct hal_session *const session, char *const *const args, const size_t count,
                     struct hm2_diag *const diag)
{
    (void)session;
    (void)count;
    char *end;
    const long level = strtol(args[0], &end, 0);
    if (end == args[0] || *end || level < RTAPI_MSG_NONE || level > RTAPI_MSG_ALL || rtapi_set_msg_level((int)level))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "'%s' is not a message level from 0 to 5", args[0]);
    return 0;
}

const struct hal_command hal_run_commands[] = {
    {"loadrt", 1, HAL_ANY, run_loadrt, "COMPONENT [NAME=VALUE...]", "load a realtime component", "l-", true},
    {"unloadrt", 1, 1, run_unloadrt, "COMPONENT|all", "unload a realtime component", "c", false},
    {"unload", 1, 1, run_unloadrt, "COMPONENT|all", "unload a component", "c", false},
    {"loadusr", 1, HAL_ANY, run_loadusr, "COMMAND...", "refused: user space components need LinuxCNC", "-", false},
    {"unloadusr", 1, 1, run_nothing, "COMPONENT|all", "does nothing: there are no user space components", "-", false},
    {"waitusr", 1, 2, run_nothing, "COMPONENT", "does nothing: there are no user space components", "-", false},
    {"addf", 2, 3, run_addf, "FUNCTION THREAD [POSITION]",
     "let a thread call a function; position 1 is the first, -1 the last", "ft-", false},
    {"delf", 2, 2, run_delf, "FUNCTION THREAD", "take a function out of a thread", "ft", false},
    {"start", 0, 0, run_start, "", "start the threads", "", false},
    {"stop", 0, 0, run_stop, "", "stop the threads", "", false},
    {"run", 1, 1, run_run, "SECONDS", "let the threads run for a time; SIGINT ends it early", "-", false},
    {"timing", 0, 1, run_timing, "[reset]", "print cycle counts and run times of the threads, or begin anew", "w",
     false},
    {"histogram", 1, 2, run_histogram, "THREAD|all [FILE]", "write the histograms of a thread as CSV", "t-", false},
    {"debug", 1, 1, run_debug, "LEVEL", "set the level of messages, 0 to 5", "-", false},
    {NULL, 0, 0, NULL, NULL, NULL, NULL, false},
};
