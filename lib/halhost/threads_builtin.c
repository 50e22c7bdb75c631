/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * `loadrt threads name1=... period1=... [fp1=...] ...` as in LinuxCNC: up to three threads, fastest first; the first
 * is called "thread1" and has 1 ms when nothing is said. A thread without a period, which LinuxCNC leaves out without
 * a word, is an error here.
 */
#include "state.h"

#include <errno.h>

enum { THREADS = 3 };

struct arguments {
    char *name[THREADS];
    long period[THREADS];
    int fp[THREADS];
};

#define ROWS(number, index)                                                   \
    {"name" number, 's', offsetof(struct arguments, name[index]), 0},         \
        {"period" number, 'l', offsetof(struct arguments, period[index]), 0}, \
    {                                                                         \
        "fp" number, 'i', offsetof(struct arguments, fp[index]), 0            \
    }

static const struct halhost_parameter parameters[] = {ROWS("1", 0), ROWS("2", 1), ROWS("3", 2)};

static char default_name[] = "thread1";
static const struct arguments defaults = {.name = {default_name}, .period = {1000000}, .fp = {1, 1, 1}};

static int create(struct hh *const host, const struct arguments *const arguments, const int i,
                  struct hm2_diag *const diag)
{
    if (!arguments->name[i])
        return 0;
    if (arguments->period[i] <= 0)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "thread '%s' needs a period%d in ns", arguments->name[i], i + 1);
    return hh_thread_new(host, arguments->name[i], (unsigned long)arguments->period[i], arguments->fp[i] != 0, diag);
}

static int threads_main(void *const block)
{
    struct hh *const host = hh_host();
    struct hm2_diag diag = {0};
    const int id = hal_init(hh_threads_builtin.name);
    if (id < 0)
        return id;
    int err = 0;
    for (int i = 0; i < THREADS && !err; i++)
        err = create(host, block, i, &diag);
    return err ? hh_report(err, &diag) : hal_ready(id);
}

const struct halhost_builtin hh_threads_builtin = {
    .name = "threads",
    .parameters = parameters,
    .parameter_count = sizeof parameters / sizeof parameters[0],
    .block_size = sizeof(struct arguments),
    .defaults = &defaults,
    .main = threads_main,
};
