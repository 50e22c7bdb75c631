/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "common/messenger.h"

#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <string.h>
#include <time.h>

#include <rtapi.h>

#define STACK_BYTES (256 << 10)

static pthread_t messenger;
static bool runs;
static atomic_bool ends;
static void (*job)(void);
static long job_pause_ns;

static void *messenger_main(void *const unused)
{
    const struct timespec pause = {.tv_nsec = job_pause_ns};
    (void)unused;
    while (!atomic_load(&ends)) {
        job();
        nanosleep(&pause, NULL);
    }
    return NULL;
}

int messenger_create(pthread_t *const thread, void *(*const run)(void *), void *const argument)
{
    const struct sched_param normal = {.sched_priority = 0};
    pthread_attr_t attributes;
    sigset_t all, before;
    int result = pthread_attr_init(&attributes);
    if (result != 0)
        return result;
    (void)pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
    (void)pthread_attr_setschedpolicy(&attributes, SCHED_OTHER);
    (void)pthread_attr_setschedparam(&attributes, &normal);
    (void)pthread_attr_setstacksize(&attributes, (size_t)STACK_BYTES);
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    result = pthread_create(thread, &attributes, run, argument);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    (void)pthread_attr_destroy(&attributes);
    return result;
}

int messenger_start(const char *const component, void (*const work)(void), const long pause_ns)
{
    job = work;
    job_pause_ns = pause_ns;
    atomic_store(&ends, false);
    const int result = messenger_create(&messenger, messenger_main, NULL);
    if (result != 0) {
        rtapi_print_msg(RTAPI_MSG_ERR, "%s: no thread beside the cycle: %s\n", component, strerror(result));
        return -result;
    }
    runs = true;
    return 0;
}

void messenger_stop(void)
{
    if (!runs)
        return;
    atomic_store(&ends, true);
    pthread_join(messenger, NULL);
    runs = false;
}

int messenger_next_line(const char **const text, char line[const MESSENGER_LINE])
{
    const size_t len = strcspn(*text, "\n");
    if (**text == '\0')
        return 0;
    rtapi_snprintf(line, MESSENGER_LINE, "%.*s", (int)len, *text);
    *text += len + ((*text)[len] == '\n');
    return 1;
}

void messenger_print_diag(const char *const component, const char *const subject, const struct hm2_diag *const diag)
{
    const char *text = diag->text;
    char line[MESSENGER_LINE];
    while (messenger_next_line(&text, line))
        if (strncmp(line, "warning: ", 9) == 0)
            rtapi_print("%s: %s: %s\n", component, subject, line);
        else
            rtapi_print_msg(RTAPI_MSG_ERR, "%s: %s: %s\n", component, subject, line);
}
