/* SPDX-License-Identifier: GPL-2.0-or-later */
#undef _FORTIFY_SOURCE /* its inline functions would stand in for ours */
#include "watch.h"

#include <dlfcn.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static _Thread_local bool watched;
static _Thread_local unsigned long calls[WATCH_KINDS];
static _Thread_local const char *last_call[WATCH_KINDS];

void watch_begin(void)
{
    watched = true;
}

void watch_end(void)
{
    watched = false;
}

unsigned long watch_calls(const enum watch_kind kind)
{
    return calls[kind];
}

const char *watch_last(const enum watch_kind kind)
{
    return last_call[kind];
}

#if WATCH_WORKS

static void note(const enum watch_kind kind, const char *const name)
{
    if (!watched)
        return;
    calls[kind]++;
    last_call[kind] = name;
}

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *memory);

void *malloc(const size_t size)
{
    note(WATCH_ALLOCATION, "malloc");
    return __libc_malloc(size);
}

void *calloc(const size_t count, const size_t size)
{
    note(WATCH_ALLOCATION, "calloc");
    return __libc_calloc(count, size);
}

void *realloc(void *const memory, const size_t size)
{
    note(WATCH_ALLOCATION, "realloc");
    return __libc_realloc(memory, size);
}

void *aligned_alloc(const size_t alignment, const size_t size)
{
    note(WATCH_ALLOCATION, "aligned_alloc");
    return __libc_memalign(alignment, size);
}

void free(void *const memory)
{
    note(WATCH_ALLOCATION, "free");
    __libc_free(memory);
}

/* glibc's function of this name behind ours. */
static void find_next(const char *const name, void *const function, const size_t size)
{
    void *const next = dlsym(RTLD_NEXT, name);
    memcpy(function, &next, size);
}

#define FORWARD_LOCK(name, parameter)                     \
    int name(parameter);                                  \
    int name(parameter argument)                          \
    {                                                     \
        static int (*next)(parameter);                    \
        note(WATCH_LOCK, #name);                          \
        if (!next)                                        \
            find_next(#name, (void *)&next, sizeof next); \
        return next(argument);                            \
    }

FORWARD_LOCK(pthread_mutex_lock, pthread_mutex_t *)
FORWARD_LOCK(pthread_mutex_trylock, pthread_mutex_t *)
FORWARD_LOCK(pthread_rwlock_rdlock, pthread_rwlock_t *)
FORWARD_LOCK(pthread_rwlock_wrlock, pthread_rwlock_t *)
FORWARD_LOCK(pthread_spin_lock, pthread_spinlock_t *)
FORWARD_LOCK(pthread_cond_signal, pthread_cond_t *)
FORWARD_LOCK(pthread_cond_broadcast, pthread_cond_t *)
FORWARD_LOCK(sem_wait, sem_t *)
FORWARD_LOCK(sem_post, sem_t *)

static int format_to(char *const text, const size_t size, const char *const format, va_list args)
    __attribute__((format(printf, 3, 0)));
static int format_to(char *const text, const size_t size, const char *const format, va_list args)
{
    static int (*next)(char *, size_t, const char *, va_list);
    if (!next)
        find_next("vsnprintf", (void *)&next, sizeof next);
    return next(text, size, format, args);
}

int vsnprintf(char *const text, const size_t size, const char *const format, va_list args)
{
    note(WATCH_FORMATTING, "vsnprintf");
    return format_to(text, size, format, args);
}

int snprintf(char *const text, const size_t size, const char *const format, ...)
{
    va_list args;
    note(WATCH_FORMATTING, "snprintf");
    va_start(args, format);
    const int len = format_to(text, size, format, args);
    va_end(args);
    return len;
}

static int format_out(FILE *const file, const char *const format, va_list args) __attribute__((format(printf, 2, 0)));
static int format_out(FILE *const file, const char *const format, va_list args)
{
    static int (*next)(FILE *, const char *, va_list);
    if (!next)
        find_next("vfprintf", (void *)&next, sizeof next);
    return next(file, format, args);
}

int vfprintf(FILE *const file, const char *const format, va_list args)
{
    note(WATCH_FORMATTING, "vfprintf");
    return format_out(file, format, args);
}

int fprintf(FILE *const file, const char *const format, ...)
{
    va_list args;
    note(WATCH_FORMATTING, "fprintf");
    va_start(args, format);
    const int len = format_out(file, format, args);
    va_end(args);
    return len;
}

int printf(const char *const format, ...)
{
    va_list args;
    note(WATCH_FORMATTING, "printf");
    va_start(args, format);
    const int len = format_out(stdout, format, args);
    va_end(args);
    return len;
}

#endif
