/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Messages. Outside of realtime threads they are delivered at once. In realtime threads the text goes into a bounded
 * queue without locks, from which a helper thread delivers it; when the queue is full the message is dropped and
 * counted, and the count is reported.
 *
 * The queue is the bounded one for many producers in which every slot carries a sequence number: equal to the
 * position when it is free, to the position + 1 when it holds a message. The consumer side is serialised by a mutex
 * that realtime threads never touch.
 */
#include "state.h"

#include <semaphore.h>
#include <stdio.h>
#include <stdlib.h>

enum {
    SLOTS = 128, /* a power of two */
    TEXT_BYTES = 1024,
    PUSH_TRIES = 64, /* against other realtime threads that push at the same moment */
};

struct slot {
    _Atomic uint32_t sequence;
    enum halhost_stream stream;
    char text[TEXT_BYTES];
};

struct hh_messages {
    const struct halhost_options *options;
    struct slot slots[SLOTS];
    _Atomic uint32_t head; /* next position to fill */
    uint32_t tail;         /* next position to deliver; under the mutex */
    _Atomic uint32_t dropped;
    pthread_mutex_t delivering;
    sem_t wake;
    atomic_bool stop;
    pthread_t helper;
    atomic_int level;
    _Atomic(rtapi_msg_handler_t) handler;
};

static void deliver(const struct halhost_options *const options, const enum halhost_stream stream,
                    const char *const text)
{
    if (options->message)
        options->message(options->context, stream, text);
}

/* ---- queue ------------------------------------------------------------------------------------------------------ */

static struct slot *claim(struct hh_messages *const messages, uint32_t *const position)
{
    *position = atomic_load_explicit(&messages->head, memory_order_relaxed);
    for (int i = 0; i < PUSH_TRIES; i++) {
        struct slot *const slot = &messages->slots[*position % SLOTS];
        const uint32_t sequence = atomic_load_explicit(&slot->sequence, memory_order_acquire);
        if (sequence == *position) {
            if (atomic_compare_exchange_weak_explicit(&messages->head, position, *position + 1, memory_order_relaxed,
                                                      memory_order_relaxed))
                return slot;
        } else if (sequence + SLOTS == *position + 1) {
            return NULL; /* still holds the message of the round before: full */
        } else {
            *position = atomic_load_explicit(&messages->head, memory_order_relaxed);
        }
    }
    return NULL;
}

static void push(struct hh_messages *const messages, const enum halhost_stream stream, const char *const format,
                 va_list args) __attribute__((format(printf, 3, 0)));
static void push(struct hh_messages *const messages, const enum halhost_stream stream, const char *const format,
                 va_list args)
{
    uint32_t position;
    struct slot *const slot = claim(messages, &position);
    if (slot) {
        slot->stream = stream;
        if (vsnprintf(slot->text, sizeof slot->text, format, args) < 0)
            slot->text[0] = '\0';
        atomic_store_explicit(&slot->sequence, position + 1, memory_order_release);
    } else {
        atomic_fetch_add_explicit(&messages->dropped, 1, memory_order_relaxed);
    }
    (void)sem_post(&messages->wake);
}

void hh_messages_drain(struct hh_messages *const messages)
{
    (void)pthread_mutex_lock(&messages->delivering);
    for (;;) {
        struct slot *const slot = &messages->slots[messages->tail % SLOTS];
        if (atomic_load_explicit(&slot->sequence, memory_order_acquire) != messages->tail + 1)
            break;
        deliver(messages->options, slot->stream, slot->text);
        atomic_store_explicit(&slot->sequence, messages->tail + SLOTS, memory_order_release);
        messages->tail++;
    }
    const uint32_t dropped = atomic_exchange_explicit(&messages->dropped, 0, memory_order_relaxed);
    if (dropped) {
        char text[80];
        (void)snprintf(text, sizeof text, "%u messages of realtime threads were dropped\n", dropped);
        deliver(messages->options, HALHOST_STDERR, text);
    }
    (void)pthread_mutex_unlock(&messages->delivering);
}

static void *helper_main(void *const argument)
{
    struct hh_messages *const messages = argument;
    while (!atomic_load(&messages->stop)) {
        if (sem_wait(&messages->wake) == 0)
            hh_messages_drain(messages);
    }
    return NULL;
}

struct hh_messages *hh_messages_start(const struct halhost_options *const options)
{
    struct hh_messages *const messages = calloc(1, sizeof *messages);
    if (!messages)
        return NULL;
    messages->options = options;
    for (uint32_t i = 0; i < SLOTS; i++)
        atomic_store_explicit(&messages->slots[i].sequence, i, memory_order_relaxed);
    atomic_store(&messages->level, RTAPI_MSG_ERR);
    (void)pthread_mutex_init(&messages->delivering, NULL);
    (void)sem_init(&messages->wake, 0, 0);
    sigset_t all, before;
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    const int error = pthread_create(&messages->helper, NULL, helper_main, messages);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (error) {
        free(messages);
        return NULL;
    }
    return messages;
}

void hh_messages_stop(struct hh_messages *const messages)
{
    atomic_store(&messages->stop, true);
    (void)sem_post(&messages->wake);
    (void)pthread_join(messages->helper, NULL);
    hh_messages_drain(messages);
    (void)sem_destroy(&messages->wake);
    (void)pthread_mutex_destroy(&messages->delivering);
    free(messages);
}

void hh_say(const struct hh *const host, const char *const format, ...)
{
    char text[TEXT_BYTES];
    va_list args;
    va_start(args, format);
    const int length = vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (length >= 0)
        deliver(&host->options, HALHOST_STDERR, text);
}

/* ---- the calls of components ------------------------------------------------------------------------------------ */

static void default_handler(msg_level_t level, const char *format, va_list args) __attribute__((format(printf, 2, 0)));
static void default_handler(const msg_level_t level, const char *const format, va_list args)
{
    const struct hh *const host = hh_host();
    struct hh_messages *const messages = host ? host->messages : NULL;
    if (!messages)
        return;
    const enum halhost_stream stream = level == RTAPI_MSG_ALL ? HALHOST_STDOUT : HALHOST_STDERR;
    if (rtapi_task_self() >= 0) {
        push(messages, stream, format, args);
        return;
    }
    char text[HM2_DIAG_SIZE];
    if (vsnprintf(text, sizeof text, format, args) >= 0) {
        hh_messages_drain(messages); /* keep the order */
        deliver(messages->options, stream, text);
    }
}

static void handle(msg_level_t level, const char *format, va_list args) __attribute__((format(printf, 2, 0)));
static void handle(const msg_level_t level, const char *const format, va_list args)
{
    const struct hh *const host = hh_host();
    const rtapi_msg_handler_t handler = host ? atomic_load(&host->messages->handler) : NULL;
    if (handler)
        handler(level, format, args);
    else
        default_handler(level, format, args);
}

void rtapi_print(const char *const format, ...)
{
    va_list args;
    va_start(args, format);
    handle(RTAPI_MSG_ALL, format, args);
    va_end(args);
}

void rtapi_print_msg(const msg_level_t level, const char *const format, ...)
{
    if ((int)level > rtapi_get_msg_level())
        return;
    va_list args;
    va_start(args, format);
    handle(level, format, args);
    va_end(args);
}

int rtapi_set_msg_level(const int level)
{
    const struct hh *const host = hh_host();
    if (!host || level < RTAPI_MSG_NONE || level > RTAPI_MSG_ALL)
        return -EINVAL;
    atomic_store(&host->messages->level, level);
    return 0;
}

int rtapi_get_msg_level(void)
{
    const struct hh *const host = hh_host();
    return host ? atomic_load_explicit(&host->messages->level, memory_order_relaxed) : RTAPI_MSG_NONE;
}

void rtapi_set_msg_handler(const rtapi_msg_handler_t handler)
{
    const struct hh *const host = hh_host();
    if (host)
        atomic_store(&host->messages->handler, handler);
}

rtapi_msg_handler_t rtapi_get_msg_handler(void)
{
    const struct hh *const host = hh_host();
    const rtapi_msg_handler_t handler = host ? atomic_load(&host->messages->handler) : NULL;
    return handler ? handler : default_handler;
}
