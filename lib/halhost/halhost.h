/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A small HAL/RTAPI host: the calls of LinuxCNC's HAL for components in this process, threads that run their
 * functions, and what a program needs to drive and inspect them.
 *
 * HAL's calls have no context argument, so there is one host per process: halhost_open() creates it and
 * halhost_close() takes it down. Apart from the messages (see halhost_options) and what rtapi.h marks "realtime",
 * everything is called from one thread, the one that opened the host.
 */
#ifndef HALHOST_H
#define HALHOST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

/* One parameter of a component that is part of the program. */
struct halhost_parameter {
    const char *name;
    char type;     /* 'i' int, 'l' long, 's' char * (as in rtapi_info_type_*) */
    size_t offset; /* of the variable (of element 0 of an array) in the parameter block */
    int elements;  /* of an array; 0 = a single value */
};

/* A component that is part of the program instead of a file. */
struct halhost_builtin {
    const char *name;
    const struct halhost_parameter *parameters;
    size_t parameter_count;
    size_t block_size;        /* of the parameter block */
    const void *defaults;     /* initial content of the block */
    int (*main)(void *block); /* like rtapi_app_main() */
    void (*exit)(void *block);
};

enum halhost_stream { HALHOST_STDOUT, HALHOST_STDERR };

struct halhost_options {
    size_t memory_bytes; /* for hal_malloc(), 0 = 8 MiB */
    /* Text printed by components and by the host; a call is one message. It is called from the program's thread and
     * from a helper thread, never from a realtime thread. NULL = messages are dropped. */
    void (*message)(const void *context, enum halhost_stream stream, const char *text);
    const void *context;
    const struct halhost_builtin *builtins; /* besides "threads", which is always there */
    size_t builtin_count;
    const char *const *folders; /* where components are looked for, first match wins; NULL-terminated or NULL */
    int cpu; /* threads run there; HALHOST_CPU_DEFAULT: the best (processor.h), when they have realtime rights */
    bool no_realtime; /* do not even ask for realtime priority and locked memory */
};

#define HALHOST_CPU_DEFAULT (-1)
#define HALHOST_CPU_ANY     (-2)

int HM2_MUST_CHECK halhost_open(const struct halhost_options *options, struct hm2_diag *diag);

/* Stop threads, unload components in reverse order, free everything. HM2_ERR_TIMEOUT: a thread does not come back
 * from a component's function; nothing was unloaded, and the process must end without returning to the components. */
int halhost_close(struct hm2_diag *diag);

/* Load a component with its "name=value" arguments. On failure nothing of it remains. */
int HM2_MUST_CHECK halhost_load(const char *name, const char *const *arguments, size_t count, struct hm2_diag *diag);
int HM2_MUST_CHECK halhost_unload(const char *name, struct hm2_diag *diag);
int HM2_MUST_CHECK halhost_unload_all(struct hm2_diag *diag);

int HM2_MUST_CHECK halhost_start(struct hm2_diag *diag);
/* Returns when no component function runs any more; HM2_ERR_TIMEOUT after five seconds in one. */
int halhost_stop(struct hm2_diag *diag);
bool halhost_running(void);

/* Deliver queued messages now. */
void halhost_flush_messages(void);

#endif
