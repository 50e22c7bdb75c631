/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Functions of components, and which thread calls which of them in what order. */
#include "state.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* One of the objects that show a function's run time, named after it. A name that would be too long is left out. */
static bool time_name(char text[const HH_NAME_SIZE], const char *const name, const char *const suffix)
{
    const int length = snprintf(text, HH_NAME_SIZE, "%s.%s", name, suffix);
    return length > 0 && (size_t)length < HH_NAME_SIZE;
}

/* Room in HAL memory for the run times of one function. */
struct times {
    hal_s32_t *time;
    hal_s32_t tmax;
    hal_bit_t increased;
};

static int create_times(struct hh *const host, struct hh_funct *const funct, struct hm2_diag *const diag)
{
    struct times *const times = hal_malloc((long)sizeof *times);
    const char *const name = funct->names.name;
    const int id = funct->comp->id;
    char text[HH_NAME_SIZE];
    if (!times)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no HAL memory left for function '%s'", name);
    funct->time = &times->time;
    funct->tmax = &times->tmax;
    funct->tmax_increased = &times->increased;
    int err = 0;
    if (time_name(text, name, "time"))
        err = hh_pin_new(host, text, HAL_S32, HAL_OUT, HH_SLOT(&times->time), id, diag);
    else
        funct->time = NULL;
    if (!err && time_name(text, name, "tmax"))
        err = hh_param_new(host, text, HAL_S32, HAL_RW, &times->tmax, id, diag);
    if (!err && time_name(text, name, "tmax-increased"))
        err = hh_param_new(host, text, HAL_BIT, HAL_RO, &times->increased, id, diag);
    return err;
}

int hh_funct_export(struct hh *const host, const char *const name, void (*const code)(void *, long), void *const arg,
                    const bool uses_fp, const bool reentrant, const int comp_id, struct hm2_diag *const diag)
{
    int err = hh_check_name("function", name, diag);
    if (err)
        return err;
    if (!code)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "function '%s' has no code", name);
    if (hh_table_find(&host->functs, name))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "there is already a function '%s'", name);
    struct hh_comp *const comp = hh_comp_open(host, comp_id, name, diag);
    if (!comp)
        return HM2_ERR_INVALID;
    struct hh_funct *const funct = calloc(1, sizeof *funct);
    if (!funct)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for function '%s'", name);
    memcpy(funct->names.name, name, strlen(name) + 1);
    funct->comp = comp;
    funct->code = code;
    funct->arg = arg;
    funct->uses_fp = uses_fp;
    funct->reentrant = reentrant;
    err = create_times(host, funct, diag);
    if (!err)
        err = hh_table_add(&host->functs, funct);
    if (err)
        free(funct);
    return err;
}

/* ---- schedules -------------------------------------------------------------------------------------------------- */

static struct hh_schedule *schedule_new(const size_t count)
{
    /* NOLINTNEXTLINE(bugprone-sizeof-expression): a schedule holds pointers. */
    struct hh_schedule *const schedule = malloc(sizeof *schedule + count * sizeof(struct hh_funct *));
    if (schedule)
        schedule->count = count;
    return schedule;
}

/* Replace what the thread calls; afterwards nobody uses the old list any more, and it is freed. */
static int install(struct hh_thread *const thread, struct hh_schedule *const schedule, struct hm2_diag *const diag)
{
    struct hh_schedule *const old = atomic_exchange(&thread->schedule, schedule);
    const int err = hh_thread_quiesce(thread, diag);
    if (!err)
        free(old);
    return err;
}

int hh_schedule_clear(struct hh *const host, struct hh_thread *const thread, struct hm2_diag *const diag)
{
    (void)host;
    const struct hh_schedule *const old = atomic_load(&thread->schedule);
    for (size_t i = 0; old && i < old->count; i++)
        old->functs[i]->users--;
    return install(thread, NULL, diag);
}

/* Index in a list of count + 1 places for halcmd's position: 1 is the first, -1 the last. Negative = no such place. */
static long place(const long position, const long count)
{
    return position > 0 ? position - 1 : count + 1 + position;
}

int hh_funct_add(struct hh *const host, const char *const funct_name, const char *const thread_name, const int position,
                 struct hm2_diag *const diag)
{
    if (host->lock & HAL_LOCK_CONFIG)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no functions are added now");
    struct hh_funct *const funct = hh_table_find(&host->functs, funct_name);
    struct hh_thread *const thread = hh_thread_find(host, thread_name);
    if (!funct)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no function '%s'", funct_name);
    if (!thread)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no thread '%s'", thread_name);
    if (funct->users > 0 && !funct->reentrant)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "function '%s' is in a thread already and may be in one only",
                            funct_name);
    if (funct->uses_fp && !thread->uses_fp)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "function '%s' uses floating point, thread '%s' was made without",
                            funct_name, thread_name);
    const struct hh_schedule *const old = atomic_load(&thread->schedule);
    const size_t count = old ? old->count : 0;
    const long at = place(position, (long)count);
    if (position == 0 || at < 0 || at > (long)count)
        return hm2_diag_add(diag, HM2_ERR_RANGE,
                            "position %d: thread '%s' has %zu functions, positions are 1 to %zu and -1 to -%zu",
                            position, thread_name, count, count + 1, count + 1);
    struct hh_schedule *const schedule = schedule_new(count + 1);
    if (!schedule)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory to add function '%s'", funct_name);
    for (size_t i = 0, from = 0; i < count + 1; i++)
        schedule->functs[i] = i == (size_t)at ? funct : old->functs[from++];
    funct->users++;
    return install(thread, schedule, diag);
}

/* Take every call of funct out of the thread. Returns 0 or the error; *found tells whether there was one. */
static int remove_calls(struct hh_thread *const thread, struct hh_funct *const funct, bool *const found,
                        struct hm2_diag *const diag)
{
    const struct hh_schedule *const old = atomic_load(&thread->schedule);
    size_t calls = 0;
    for (size_t i = 0; old && i < old->count; i++)
        calls += old->functs[i] == funct;
    *found = calls > 0;
    if (calls == 0)
        return 0;
    struct hh_schedule *const schedule = schedule_new(old->count - calls);
    if (!schedule)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory to remove function '%s'", funct->names.name);
    for (size_t i = 0, to = 0; i < old->count; i++) {
        if (old->functs[i] != funct)
            schedule->functs[to++] = old->functs[i];
    }
    funct->users -= (unsigned)calls;
    return install(thread, schedule, diag);
}

int hh_funct_delete(struct hh *const host, const char *const funct_name, const char *const thread_name,
                    struct hm2_diag *const diag)
{
    if (host->lock & HAL_LOCK_CONFIG)
        return hm2_diag_add(diag, HM2_ERR_STATE, "HAL is locked: no functions are removed now");
    struct hh_funct *const funct = hh_table_find(&host->functs, funct_name);
    struct hh_thread *const thread = hh_thread_find(host, thread_name);
    if (!funct)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no function '%s'", funct_name);
    if (!thread)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "there is no thread '%s'", thread_name);
    bool found;
    const int err = remove_calls(thread, funct, &found, diag);
    if (!err && !found)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "function '%s' is not in thread '%s'", funct_name, thread_name);
    return err;
}

int hh_functs_remove(struct hh *const host, const struct hh_comp *const comp, struct hm2_diag *const diag)
{
    for (size_t i = host->functs.shown.count; i-- > 0;) {
        struct hh_funct *const funct = host->functs.shown.items[i];
        if (funct->comp != comp)
            continue;
        for (size_t t = 0; t < host->threads.count; t++) {
            bool found;
            const int err = remove_calls(host->threads.items[t], funct, &found, diag);
            if (err)
                return err;
        }
        hh_table_remove(&host->functs, funct);
        free(funct);
    }
    return 0;
}

/* ---- the calls of components ------------------------------------------------------------------------------------ */

int hal_export_funct(const char *const name, void (*const funct)(void *, long), void *const arg, const int uses_fp,
                     const int reentrant, const int comp_id)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_export_funct", &status);
    return host
               ? hh_report(hh_funct_export(host, name, funct, arg, uses_fp != 0, reentrant != 0, comp_id, &diag), &diag)
               : status;
}

int hal_add_funct_to_thread(const char *const funct, const char *const thread, const int position)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_add_funct_to_thread", &status);
    return host ? hh_report(hh_funct_add(host, funct, thread, position, &diag), &diag) : status;
}

int hal_del_funct_from_thread(const char *const funct, const char *const thread)
{
    int status;
    struct hm2_diag diag = {0};
    struct hh *const host = hh_enter("hal_del_funct_from_thread", &status);
    return host ? hh_report(hh_funct_delete(host, funct, thread, &diag), &diag) : status;
}
