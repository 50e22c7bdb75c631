/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "state.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

enum { MEMORY_DEFAULT = 8 << 20, CELL_BYTES = 8, MEMORY_ALIGNMENT = 16 };

static struct hh *the_host;

struct hh *hh_host(void)
{
    return the_host;
}

/* Negative errno for a component, which knows no enum hm2_err. */
static int to_errno(const int err)
{
    switch (err) {
    case 0:
        return 0;
    case HM2_ERR_NOMEM:
        return -ENOMEM;
    case HM2_ERR_STATE:
        return -EPERM;
    case HM2_ERR_NOTFOUND:
        return -ENOENT;
    case HM2_ERR_TIMEOUT:
        return -ETIMEDOUT;
    default:
        return -EINVAL;
    }
}

int hh_report(const int err, const struct hm2_diag *const diag)
{
    if (err)
        rtapi_print_msg(RTAPI_MSG_ERR, "HAL: ERROR: %s", diag->text);
    return to_errno(err);
}

struct hh *hh_enter(const char *const call, int *const status)
{
    struct hh *const host = the_host;
    if (host && rtapi_task_self() < 0)
        return host;
    if (host)
        rtapi_print_msg(RTAPI_MSG_ERR, "HAL: ERROR: %s called from a realtime thread\n", call);
    *status = host ? -EPERM : -EINVAL;
    return NULL;
}

/* ---- memory ----------------------------------------------------------------------------------------------------- */

static void *allocate(struct hh *const host, const size_t size)
{
    const size_t alignment = size <= CELL_BYTES ? CELL_BYTES : MEMORY_ALIGNMENT;
    const size_t start = (host->memory_used + alignment - 1) & ~(alignment - 1);
    if (size > host->options.memory_bytes || start > host->options.memory_bytes - size)
        return NULL;
    host->memory_used = start + size;
    return host->memory + start;
}

void *hal_malloc(const long size)
{
    int status;
    struct hh *const host = hh_enter("hal_malloc", &status);
    void *const memory = host && size > 0 ? allocate(host, (size_t)size) : NULL;
    if (host && !memory)
        rtapi_print_msg(RTAPI_MSG_ERR, "HAL: ERROR: no %ld bytes of HAL memory left (%zu of %zu are used)\n", size,
                        host->memory_used, host->options.memory_bytes);
    return memory;
}

void *hh_cell_new(struct hh *const host)
{
    if (host->free_cells.count == 0)
        return allocate(host, CELL_BYTES);
    void *const cell = host->free_cells.items[--host->free_cells.count];
    hh_store(cell, (struct hh_value){.type = HAL_FLOAT});
    return cell;
}

void hh_cell_free(struct hh *const host, void *const cell)
{
    if (!cell)
        return;
    /* A cycle that runs now may still hold its address. */
    int err = 0;
    for (size_t i = 0; i < host->threads.count && !err; i++)
        err = hh_thread_quiesce(host->threads.items[i], NULL);
    /* A cell that cannot go into the list stays unused; nothing else is lost. */
    if (!err)
        (void)hh_list_insert(&host->free_cells, host->free_cells.count, cell);
}

bool hh_in_memory(const struct hh *const host, const volatile void *const address, const size_t size)
{
    const uintptr_t at = (uintptr_t)address, base = (uintptr_t)host->memory;
    return at >= base && at - base <= host->memory_used && host->memory_used - (at - base) >= size;
}

/* ---- components ------------------------------------------------------------------------------------------------- */

int hh_check_name(const char *const what, const char *const name, struct hm2_diag *const diag)
{
    const size_t length = name ? strnlen(name, HH_NAME_LEN + 1) : 0;
    if (length == 0)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "a %s needs a name", what);
    if (length > HH_NAME_LEN)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "%s name '%s' is longer than %u characters", what, name,
                            HH_NAME_LEN);
    for (size_t i = 0; i < length; i++) {
        if ((unsigned char)name[i] <= ' ' || name[i] == 0x7f)
            return hm2_diag_add(diag, HM2_ERR_INVALID, "%s name '%s' contains a blank or control character", what,
                                name);
    }
    return 0;
}

struct hh_comp *hh_comp_find(const struct hh *const host, const int id)
{
    for (size_t i = 0; i < host->comps.count; i++) {
        struct hh_comp *const comp = host->comps.items[i];
        if (comp->id == id)
            return comp;
    }
    return NULL;
}

struct hh_comp *hh_comp_by_name(const struct hh *const host, const char *const name)
{
    for (size_t i = 0; i < host->comps.count; i++) {
        struct hh_comp *const comp = host->comps.items[i];
        if (strcmp(comp->name, name) == 0)
            return comp;
    }
    return NULL;
}

struct hh_comp *hh_comp_open(const struct hh *const host, const int id, const char *const what,
                             struct hm2_diag *const diag)
{
    struct hh_comp *const comp = hh_comp_find(host, id);
    if (!comp)
        hm2_diag_add(diag, HM2_ERR_INVALID, "%s: there is no component with id %d", what, id);
    else if (comp->ready)
        hm2_diag_add(diag, HM2_ERR_INVALID, "%s: component '%s' is already ready", what, comp->name);
    return comp && !comp->ready ? comp : NULL;
}

static int comp_new(struct hh *const host, const char *const name, struct hm2_diag *const diag)
{
    const int err = hh_check_name("component", name, diag);
    if (err)
        return err;
    if (hh_comp_by_name(host, name))
        return hm2_diag_add(diag, HM2_ERR_INVALID, "there is already a component '%s'", name);
    struct hh_comp *const comp = calloc(1, sizeof *comp);
    if (!comp || hh_list_insert(&host->comps, host->comps.count, comp)) {
        free(comp);
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for component '%s'", name);
    }
    memcpy(comp->name, name, strlen(name) + 1);
    comp->module = host->loading;
    comp->id = ++host->last_id;
    return comp->id;
}

int hal_init(const char *const name)
{
    int status;
    struct hh *const host = hh_enter("hal_init", &status);
    if (!host)
        return status;
    struct hm2_diag diag = {0};
    const int id = comp_new(host, name, &diag);
    return id > 0 ? id : hh_report(id, &diag);
}

int hh_comp_remove(struct hh *const host, struct hh_comp *const comp, struct hm2_diag *const diag)
{
    int err = hh_functs_remove(host, comp, diag);
    if (!err)
        err = hh_threads_remove(host, comp, diag);
    if (err)
        return err;
    hh_objects_remove(host, comp);
    hh_list_remove(&host->comps, comp);
    free(comp);
    return 0;
}

int hal_exit(const int comp_id)
{
    int status;
    struct hh *const host = hh_enter("hal_exit", &status);
    if (!host)
        return status;
    struct hm2_diag diag = {0};
    struct hh_comp *const comp = hh_comp_find(host, comp_id);
    if (!comp)
        return hh_report(hm2_diag_add(&diag, HM2_ERR_INVALID, "hal_exit: there is no component with id %d", comp_id),
                         &diag);
    return hh_report(hh_comp_remove(host, comp, &diag), &diag);
}

static int set_ready(const char *const call, const int comp_id, const bool ready)
{
    int status;
    struct hh *const host = hh_enter(call, &status);
    if (!host)
        return status;
    struct hm2_diag diag = {0};
    struct hh_comp *const comp = hh_comp_find(host, comp_id);
    if (!comp)
        return hh_report(hm2_diag_add(&diag, HM2_ERR_INVALID, "%s: there is no component with id %d", call, comp_id),
                         &diag);
    if (ready && comp->ready)
        return hh_report(hm2_diag_add(&diag, HM2_ERR_INVALID, "component '%s' is already ready", comp->name), &diag);
    comp->ready = ready;
    return 0;
}

int hal_ready(const int comp_id)
{
    return set_ready("hal_ready", comp_id, true);
}

int hal_set_unready(const int comp_id)
{
    return set_ready("hal_set_unready", comp_id, false);
}

int hal_unready(const int comp_id)
{
    return set_ready("hal_unready", comp_id, false);
}

char *hal_comp_name(const int comp_id)
{
    struct hh *const host = hh_host();
    struct hh_comp *const comp = host ? hh_comp_find(host, comp_id) : NULL;
    return comp ? comp->name : NULL;
}

int hal_set_constructor(const int comp_id, const constructor make)
{
    (void)make;
    struct hh *const host = hh_host();
    return host && hh_comp_find(host, comp_id) ? 0 : -EINVAL;
}

int hal_set_lock(const unsigned char lock)
{
    struct hh *const host = hh_host();
    if (!host)
        return -EINVAL;
    host->lock = lock;
    return 0;
}

unsigned char hal_get_lock(void)
{
    const struct hh *const host = hh_host();
    return host ? host->lock : HAL_LOCK_NONE;
}

/* ---- life ------------------------------------------------------------------------------------------------------- */

int halhost_open(const struct halhost_options *const options, struct hm2_diag *const diag)
{
    if (the_host)
        return hm2_diag_add(diag, HM2_ERR_STATE, "this process already has a HAL host");
    struct hh *const host = calloc(1, sizeof *host);
    if (!host)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for the HAL host");
    host->options = *options;
    if (host->options.memory_bytes == 0)
        host->options.memory_bytes = MEMORY_DEFAULT;
    host->memory = mmap(NULL, host->options.memory_bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    host->messages = host->memory != MAP_FAILED ? hh_messages_start(&host->options) : NULL;
    if (!host->messages) {
        if (host->memory != MAP_FAILED)
            (void)munmap(host->memory, host->options.memory_bytes);
        free(host);
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory or thread for the HAL host");
    }
    the_host = host;
    return 0;
}

static void free_items(struct hh_list *const list)
{
    for (size_t i = 0; i < list->count; i++)
        free(list->items[i]);
    hh_list_free(list);
}

int halhost_close(struct hm2_diag *const diag)
{
    struct hh *const host = the_host;
    if (!host)
        return 0;
    int err = hh_threads_stop(host, diag);
    if (!err)
        err = halhost_unload_all(diag);
    if (err) {
        hh_messages_drain(host->messages);
        return err;
    }
    /* What remains was created without a module. */
    while (host->comps.count > 0) {
        err = hh_comp_remove(host, host->comps.items[host->comps.count - 1], diag);
        if (err)
            return err;
    }
    hh_messages_stop(host->messages);
    free_items(&host->signals.shown);
    hh_table_free(&host->signals);
    hh_table_free(&host->pins);
    hh_table_free(&host->params);
    hh_table_free(&host->functs);
    hh_list_free(&host->comps);
    hh_list_free(&host->threads);
    hh_list_free(&host->modules);
    hh_list_free(&host->free_cells);
    hh_shares_free(host);
    (void)munmap(host->memory, host->options.memory_bytes);
    the_host = NULL;
    free(host);
    return 0;
}

bool halhost_running(void)
{
    return the_host && the_host->running;
}

int halhost_start(struct hm2_diag *const diag)
{
    return the_host ? hh_threads_start(the_host, diag) : hm2_diag_add(diag, HM2_ERR_STATE, "there is no HAL host");
}

int halhost_stop(struct hm2_diag *const diag)
{
    return the_host ? hh_threads_stop(the_host, diag) : 0;
}

void halhost_flush_messages(void)
{
    if (the_host)
        hh_messages_drain(the_host->messages);
}
