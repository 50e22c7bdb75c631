/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The parts of RTAPI that have no state of their own, and memory shared between modules. */
#include "state.h"

#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <rtapi_firmware.h>
#include <rtapi_string.h>

/* Number of the realtime thread that runs, or -EINVAL: a property of the thread, which no argument can carry. */
static _Thread_local int task = -EINVAL;

int rtapi_task_self(void)
{
    return task;
}

void hh_task_enter(const int id)
{
    task = id;
}

/* Components have no module ids of their own here: hal_init() is all they need. */
int rtapi_init(const char *const name)
{
    (void)name;
    struct hh *const host = hh_host();
    return host ? ++host->last_id : -EINVAL;
}

int rtapi_exit(const int module_id)
{
    return module_id > 0 ? 0 : -EINVAL;
}

int rtapi_vsnprintf(char *const text, const unsigned long size, const char *const format, va_list args)
{
    return vsnprintf(text, size, format, args);
}

int rtapi_snprintf(char *const text, const unsigned long size, const char *const format, ...)
{
    va_list args;
    va_start(args, format);
    const int length = vsnprintf(text, size, format, args);
    va_end(args);
    return length;
}

long simple_strtol(const char *const text, char **const end, const int base)
{
    return strtol(text, end, base);
}

/* ---- time ------------------------------------------------------------------------------------------------------- */

long long rtapi_get_time(void)
{
    return hh_now_ns();
}

long long rtapi_get_clocks(void)
{
#if defined(__x86_64__) || defined(__i386__)
    return (long long)__builtin_ia32_rdtsc();
#else
    return hh_now_ns();
#endif
}

/* hal-interface 5.3: at most 10 us are honoured. */
long rtapi_delay_max(void)
{
    return 10000;
}

void rtapi_delay(const long ns)
{
    const int64_t end_ns = hh_now_ns() + (ns < rtapi_delay_max() ? ns : rtapi_delay_max());
    while (hh_now_ns() < end_ns) {
    }
}

long rtapi_clock_set_period(const long ns)
{
    const struct hh *const host = hh_host();
    if (!host || ns != 0)
        return -EINVAL;
    return host->threads.count ? ((const struct hh_thread *)host->threads.items[0])->period_ns : 0;
}

int rtapi_is_kernelspace(void)
{
    return 0;
}

int rtapi_is_realtime(void)
{
    const struct hh *const host = hh_host();
    for (size_t i = 0; host && i < host->threads.count; i++) {
        if (((const struct hh_thread *)host->threads.items[i])->realtime)
            return 1;
    }
    return 0;
}

/* ---- text ------------------------------------------------------------------------------------------------------- */

char **rtapi_argv_split(const rtapi_gfp_t flags, const char *const text, int *const argc)
{
    (void)flags;
    static const char blanks[] = " \t\r\n\v\f";
    size_t words = 0;
    for (const char *at = text + strspn(text, blanks); *at; at += strspn(at, blanks)) {
        at += strcspn(at, blanks);
        words++;
    }
    /* One block: the pointers, then a copy of the text that is cut in place. */
    const size_t pointers = (words + 1) * sizeof(char *), length = strlen(text) + 1;
    char **const argv = malloc(pointers + length);
    if (!argv)
        return NULL;
    char *at = memcpy((char *)argv + pointers, text, length);
    for (size_t i = 0; i < words; i++) {
        at += strspn(at, blanks);
        argv[i] = at;
        at += strcspn(at, blanks);
        if (*at)
            *at++ = '\0';
    }
    argv[words] = NULL;
    if (argc)
        *argc = (int)words;
    return argv;
}

void rtapi_argv_free(char **const argv)
{
    free(argv);
}

/* ---- memory shared between modules ------------------------------------------------------------------------------ */

struct hh_share {
    int id, key;
    unsigned users;
    unsigned long size;
    void *memory;
};

static struct hh_share *share_find(const struct hh *const host, const int number, const bool by_key)
{
    for (size_t i = 0; host && i < host->shares.count; i++) {
        struct hh_share *const share = host->shares.items[i];
        if ((by_key ? share->key : share->id) == number)
            return share;
    }
    return NULL;
}

static void share_free(struct hh_share *const share)
{
    free(share->memory);
    free(share);
}

int rtapi_shmem_new(const int key, const int module_id, const unsigned long size)
{
    (void)module_id;
    struct hh *const host = hh_host();
    struct hh_share *share = share_find(host, key, true);
    if (!host || size == 0 || (share && share->size < size))
        return -EINVAL;
    if (share) {
        share->users++;
        return share->id;
    }
    share = calloc(1, sizeof *share);
    if (!share)
        return -ENOMEM;
    *share = (struct hh_share){.id = ++host->last_id, .key = key, .users = 1, .size = size, .memory = calloc(1, size)};
    if (!share->memory || hh_list_insert(&host->shares, host->shares.count, share)) {
        share_free(share);
        return -ENOMEM;
    }
    return share->id;
}

int rtapi_shmem_getptr(const int id, void **const pointer)
{
    const struct hh_share *const share = share_find(hh_host(), id, false);
    if (!share)
        return -EINVAL;
    *pointer = share->memory;
    return 0;
}

int rtapi_shmem_delete(const int id, const int module_id)
{
    (void)module_id;
    struct hh *const host = hh_host();
    struct hh_share *const share = share_find(host, id, false);
    if (!share)
        return -EINVAL;
    if (--share->users == 0) {
        hh_list_remove(&host->shares, share);
        share_free(share);
    }
    return 0;
}

void hh_shares_free(struct hh *const host)
{
    for (size_t i = 0; i < host->shares.count; i++)
        share_free(host->shares.items[i]);
    hh_list_free(&host->shares);
}

/* ---- privileged actions and firmware ---------------------------------------------------------------------------- */

int rtapi_spawn_as_root(pid_t *const pid, const char *const path, const posix_spawn_file_actions_t *const actions,
                        const posix_spawnattr_t *const attributes, char *const argv[], char *const envp[])
{
    return posix_spawn(pid, path, actions, attributes, argv, envp);
}

int rtapi_spawnp_as_root(pid_t *const pid, const char *const file, const posix_spawn_file_actions_t *const actions,
                         const posix_spawnattr_t *const attributes, char *const argv[], char *const envp[])
{
    return posix_spawnp(pid, file, actions, attributes, argv, envp);
}

int rtapi_open_as_root(const char *const path, const int mode)
{
    return open(path, mode | O_CLOEXEC);
}

int rtapi_request_firmware(const struct rtapi_firmware **const firmware, const char *const name,
                           struct rtapi_device *const device)
{
    (void)name;
    (void)device;
    *firmware = NULL;
    return -ENOENT;
}

void rtapi_release_firmware(const struct rtapi_firmware *const firmware)
{
    (void)firmware;
}
