/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The realtime interface (RTAPI) that HAL components use, for building them without LinuxCNC.
 *
 * Names, types and constants are those of LinuxCNC 2.9, so one source builds against either set of headers and the
 * module loads into either host. This is an independent description of that interface; it must never be installed
 * where LinuxCNC's own header is expected.
 *
 * Unless a comment says "realtime", a function may only be called from rtapi_app_main() and rtapi_app_exit().
 * Errors are negative errno values.
 */
#ifndef RTAPI_H
#define RTAPI_H

#if defined(RTAPI) == defined(ULAPI)
#error "define exactly one of RTAPI (realtime component) and ULAPI (program)"
#endif

#include <spawn.h>
#include <stdarg.h>
#include <stddef.h>

/* The host is a program that shows these calls, and nothing else of it, to the modules it loads. */
#ifdef __cplusplus
#define RTAPI_BEGIN_DECLS                              \
    _Pragma("GCC visibility push(default)") extern "C" \
    {
#define RTAPI_END_DECLS \
    }                   \
    _Pragma("GCC visibility pop")
#else
#define RTAPI_BEGIN_DECLS _Pragma("GCC visibility push(default)")
#define RTAPI_END_DECLS   _Pragma("GCC visibility pop")
#endif

#define RTAPI_NAME_LEN 31

RTAPI_BEGIN_DECLS

/* ---- modules ---- */

int rtapi_init(const char *name); /* module id > 0; hal_init() does this for a HAL component */
int rtapi_exit(int module_id);

/* ---- text; realtime ---- */

int rtapi_snprintf(char *text, unsigned long size, const char *format, ...) __attribute__((format(printf, 3, 4)));
int rtapi_vsnprintf(char *text, unsigned long size, const char *format, va_list args)
    __attribute__((format(printf, 3, 0)));

typedef enum {
    RTAPI_MSG_NONE = 0,
    RTAPI_MSG_ERR = 1,
    RTAPI_MSG_WARN = 2,
    RTAPI_MSG_INFO = 3,
    RTAPI_MSG_DBG = 4,
    RTAPI_MSG_ALL = 5
} msg_level_t;

/* From a realtime thread the text (at most 1 KiB) goes through a queue to a helper thread; a full queue drops it and
 * counts. rtapi_print() always prints, rtapi_print_msg() up to the level set (ERR at first). */
void rtapi_print(const char *format, ...) __attribute__((format(printf, 1, 2)));
void rtapi_print_msg(msg_level_t level, const char *format, ...) __attribute__((format(printf, 2, 3)));
int rtapi_set_msg_level(int level);
int rtapi_get_msg_level(void);

typedef void (*rtapi_msg_handler_t)(msg_level_t level, const char *format, va_list args);
void rtapi_set_msg_handler(rtapi_msg_handler_t handler); /* NULL = the host's own */
rtapi_msg_handler_t rtapi_get_msg_handler(void);

/* Like strtol(). */
long simple_strtol(const char *text, char **end, int base);

/* ---- time; realtime ---- */

long long rtapi_get_time(void);       /* monotonic ns */
long long rtapi_get_clocks(void);     /* processor clocks; absent in LinuxCNC master: do not use in new components */
void rtapi_delay(long ns);            /* busy wait, at most rtapi_delay_max() */
long rtapi_delay_max(void);           /* ns */
long rtapi_clock_set_period(long ns); /* with 0: period of the fastest thread in ns, 0 when there is none yet */

/* ---- tasks ---- */

/* Number of the calling realtime thread, >= 0, or -EINVAL outside of realtime threads. */
int rtapi_task_self(void);

int rtapi_is_kernelspace(void); /* always 0 */
int rtapi_is_realtime(void);    /* 1 when threads may have realtime priority */

/* ---- memory shared between modules ---- */

int rtapi_shmem_new(int key, int module_id, unsigned long size); /* id > 0; the same key gives the same memory */
int rtapi_shmem_delete(int id, int module_id);
int rtapi_shmem_getptr(int id, void **pointer);

/* ---- privileged actions: with the rights this process happens to have ---- */

int rtapi_spawn_as_root(pid_t *pid, const char *path, const posix_spawn_file_actions_t *actions,
                        const posix_spawnattr_t *attributes, char *const argv[], char *const envp[]);
int rtapi_spawnp_as_root(pid_t *pid, const char *file, const posix_spawn_file_actions_t *actions,
                         const posix_spawnattr_t *attributes, char *const argv[], char *const envp[]);
int rtapi_open_as_root(const char *path, int mode);

/* ---- module parameters and exported names (hal-interface 5.5) ---- */

/* Each exported name leaves a string in the module, from which the list of its visible symbols is made when it is
 * linked. */
#define EXPORT_SYMBOL(name)              \
    extern char rtapi_exported_##name[]; \
    __attribute__((section(".rtapi_export"), used)) char rtapi_exported_##name[] = #name
#define EXPORT_SYMBOL_GPL(name) EXPORT_SYMBOL(name)

/* One variable that the loader finds by its name. */
#define RTAPI_INFO(type, name, value) \
    extern type rtapi_info_##name;    \
    type rtapi_info_##name = value;   \
    EXPORT_SYMBOL(rtapi_info_##name)

#define RTAPI_INFO_TEXT(name, text) RTAPI_INFO(const char *, name, text)

#define MODULE_LICENSE(text)          RTAPI_INFO_TEXT(license, text)
#define MODULE_AUTHOR(text)           RTAPI_INFO_TEXT(author, text)
#define MODULE_DESCRIPTION(text)      RTAPI_INFO_TEXT(description, text)
#define MODULE_SUPPORTED_DEVICE(text) RTAPI_INFO_TEXT(supported_device, text)

#define RTAPI_PARAMETER(name, code, address, text) \
    RTAPI_INFO_TEXT(type_##name, code);            \
    RTAPI_INFO(void *, address_##name, address);   \
    RTAPI_INFO_TEXT(description_##name, text)

#define RTAPI_MP_INT(name, text)    RTAPI_PARAMETER(name, "i", &name, text)
#define RTAPI_MP_LONG(name, text)   RTAPI_PARAMETER(name, "l", &name, text)
#define RTAPI_MP_STRING(name, text) RTAPI_PARAMETER(name, "s", &name, text)

#define RTAPI_MP_ARRAY(code, name, count, text) \
    RTAPI_INFO(int, size_##name, count);        \
    RTAPI_PARAMETER(name, code, name, text)

#define RTAPI_MP_ARRAY_INT(name, count, text)    RTAPI_MP_ARRAY("i", name, count, text)
#define RTAPI_MP_ARRAY_LONG(name, count, text)   RTAPI_MP_ARRAY("l", name, count, text)
#define RTAPI_MP_ARRAY_STRING(name, count, text) RTAPI_MP_ARRAY("s", name, count, text)

RTAPI_END_DECLS

#endif
