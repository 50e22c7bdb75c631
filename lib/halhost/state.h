/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The host's own data. Only files of this folder include it, and tests that look inside. */
#ifndef HALHOST_STATE_H
#define HALHOST_STATE_H

#ifndef RTAPI
#define RTAPI 1
#endif
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>

#include <hal.h>
#include <rtapi.h>

#include "halhost.h"
#include "histogram.h"
#include "table.h"

_Static_assert(HH_NAME_LEN == HAL_NAME_LEN, "names of the tables and of the HAL have the same limit");

/* A component's pin pointer (hal_bit_t *, hal_s32_t *, ...) as the host sees it: all have one representation. */
#define HH_SLOT(pointer) ((void **)(uintptr_t)(pointer))

struct hh_module;

struct hh_comp {
    int id;
    char name[HH_NAME_SIZE];
    bool ready;
    struct hh_module *module; /* whose main created it, or NULL */
};

struct hh_signal {
    struct hh_named names; /* without alias */
    hal_type_t type;
    void *value; /* cell in HAL memory */
    unsigned readers, writers, bidirs;
};

struct hh_pin {
    struct hh_named names;
    struct hh_comp *comp;
    hal_type_t type;
    hal_pin_dir_t dir;
    void **slot; /* the component's pointer, in HAL memory */
    void *own;   /* cell for the value while the pin is not linked */
    struct hh_signal *signal;
};

struct hh_param {
    struct hh_named names;
    struct hh_comp *comp;
    hal_type_t type;
    hal_param_dir_t dir;
    void *value;
};

struct hh_funct {
    struct hh_named names; /* without alias */
    struct hh_comp *comp;
    void (*code)(void *arg, long period_ns);
    void *arg;
    bool uses_fp, reentrant;
    unsigned users; /* threads that call it */
    /* Run times in ns, as in LinuxCNC master; created in HAL memory. */
    hal_s32_t **time;
    hal_s32_t *tmax;
    hal_bit_t *tmax_increased;
};

/* What a thread calls in a cycle. Never changed once a thread can see it: changes install a new one. */
struct hh_schedule {
    size_t count;
    struct hh_funct *functs[];
};

struct hh_thread {
    struct hh_named names; /* without alias */
    int id;                /* what rtapi_task_self() returns in it */
    struct hh_comp *comp;  /* "__NAME", owner of its time pin */
    long period_ns;
    bool uses_fp;
    int priority;  /* 0 = fastest */
    bool created;  /* the POSIX thread exists */
    bool realtime; /* it has realtime priority */
    pthread_t thread;
    _Atomic int64_t first_ns; /* 0 until all threads exist */
    hal_s32_t **time;
    hal_s32_t *tmax;
    _Atomic(struct hh_schedule *) schedule;
    /* Odd while a cycle runs: who wants to free a schedule waits until the cycle that may use it has ended. */
    _Atomic uint64_t epoch;
    atomic_bool stop;
    _Atomic(struct hh_funct *) current; /* function being called, for reports about a thread that hangs */
    _Atomic uint64_t cycles, overruns, missed;
    struct histogram latency, busy, interval;
};

/* Messages on their way from realtime threads to the helper thread. */
struct hh_messages;

struct hh_share;

struct hh {
    struct halhost_options options;
    char *memory;
    size_t memory_used;
    struct hh_list free_cells; /* value cells of deleted signals and pins */
    struct hh_list comps;      /* in the order of creation */
    struct hh_table pins, params, signals, functs;
    struct hh_list threads; /* in the order of creation: fastest first */
    struct hh_list modules; /* in the order of loading */
    struct hh_list shares;  /* rtapi_shmem_new() */
    struct hh_module *loading;
    int last_id, last_task;
    unsigned char lock;
    bool running; /* threads were started */
    int cpu;      /* that they are bound to when they have realtime priority, or -1 */
    bool realtime_warned, memory_locked;
    struct hh_messages *messages;
};

/* The host, or NULL. HAL's calls have no context argument: this is the only mutable static of the folder apart from
 * the thread-local task number. */
struct hh *hh_host(void);

/* ---- state.c ---- */

/* Print the diagnosis as "HAL: ERROR: ..." and turn the error into a negative errno. */
int hh_report(int err, const struct hm2_diag *diag);
/* The host for a call that changes something, NULL (and *status a negative errno) when there is none or when the call
 * comes from a realtime thread. */
struct hh *hh_enter(const char *call, int *status);
/* A zeroed cell for one value. NULL = no memory. */
void *hh_cell_new(struct hh *host);
void hh_cell_free(struct hh *host, void *cell);
bool hh_in_memory(const struct hh *host, const volatile void *address, size_t size);
struct hh_comp *hh_comp_find(const struct hh *host, int id);
struct hh_comp *hh_comp_by_name(const struct hh *host, const char *name);
/* The component if something may be created for it now. */
struct hh_comp *hh_comp_open(const struct hh *host, int id, const char *what, struct hm2_diag *diag);
int hh_comp_remove(struct hh *host, struct hh_comp *comp, struct hm2_diag *diag);
/* Check a new name: length, characters. */
int hh_check_name(const char *what, const char *name, struct hm2_diag *diag);

/* ---- values.c: the only accesses to what components also touch ---- */

struct hh_value {
    hal_type_t type;
    union {
        bool b;
        int32_t s;
        uint32_t u;
        double f;
    };
};

struct hh_value hh_load(hal_type_t type, const volatile void *address);
void hh_store(volatile void *address, struct hh_value value);
void hh_point(void **slot, void *target); /* rewrite a component's pin pointer */
const char *hh_type_name(hal_type_t type);
hal_type_t hh_type_from_name(const char *name); /* HAL_TYPE_UNSPECIFIED = unknown */
int hh_parse(hal_type_t type, const char *text, struct hh_value *value, struct hm2_diag *diag);
#define HH_VALUE_TEXT 32u
/* As halcmd prints it: padded to twelve characters and u32 in hexadecimal, or bare and decimal. */
void hh_format_column(struct hh_value value, char text[HH_VALUE_TEXT]);
void hh_format_plain(struct hh_value value, char text[HH_VALUE_TEXT]);

/* ---- objects.c ---- */

int hh_pin_new(struct hh *host, const char *name, hal_type_t type, hal_pin_dir_t dir, void **slot, int comp_id,
               struct hm2_diag *diag);
int hh_param_new(struct hh *host, const char *name, hal_type_t type, hal_param_dir_t dir, volatile void *address,
                 int comp_id, struct hm2_diag *diag);
int hh_alias(struct hh *host, struct hh_table *table, const char *what, const char *name, const char *alias,
             struct hm2_diag *diag);
void hh_objects_remove(struct hh *host, const struct hh_comp *comp);
const volatile void *hh_pin_value(const struct hh_pin *pin);

/* ---- signals.c ---- */

int hh_signal_new(struct hh *host, const char *name, hal_type_t type, struct hm2_diag *diag);
int hh_signal_delete(struct hh *host, const char *name, struct hm2_diag *diag);
int hh_link(struct hh *host, const char *pin, const char *signal, struct hm2_diag *diag);
int hh_can_link(const struct hh_pin *pin, const struct hh_signal *signal, struct hm2_diag *diag);
int hh_unlink(struct hh *host, const char *pin, struct hm2_diag *diag);
void hh_pin_unlink(struct hh_pin *pin);

/* ---- functs.c ---- */

int hh_funct_export(struct hh *host, const char *name, void (*code)(void *, long), void *arg, bool uses_fp,
                    bool reentrant, int comp_id, struct hm2_diag *diag);
int hh_funct_add(struct hh *host, const char *funct, const char *thread, int position, struct hm2_diag *diag);
int hh_funct_delete(struct hh *host, const char *funct, const char *thread, struct hm2_diag *diag);
/* Take a component's functions out of all threads and forget them. */
int hh_functs_remove(struct hh *host, const struct hh_comp *comp, struct hm2_diag *diag);
int hh_schedule_clear(struct hh *host, struct hh_thread *thread, struct hm2_diag *diag);

/* ---- threads.c ---- */

struct hh_thread *hh_thread_find(const struct hh *host, const char *name);
int hh_thread_new(struct hh *host, const char *name, unsigned long period_ns, bool uses_fp, struct hm2_diag *diag);
/* The thread that belongs to this component, if any. Stops all threads, as in LinuxCNC. */
int hh_threads_remove(struct hh *host, const struct hh_comp *comp, struct hm2_diag *diag);
int hh_thread_delete(struct hh *host, struct hh_thread *thread, struct hm2_diag *diag);
int hh_threads_start(struct hh *host, struct hm2_diag *diag);
int hh_threads_stop(struct hh *host, struct hm2_diag *diag);
void hh_threads_ask_to_stop(struct hh *host);
/* Wait until the cycle that runs now, if any, has ended. */
int hh_thread_quiesce(const struct hh_thread *thread, struct hm2_diag *diag);
int64_t hh_now_ns(void);

/* ---- rtapi.c ---- */

void hh_task_enter(int id);
void hh_shares_free(struct hh *host);

/* ---- messages.c ---- */

struct hh_messages *hh_messages_start(const struct halhost_options *options);
void hh_messages_stop(struct hh_messages *messages);
void hh_messages_drain(struct hh_messages *messages);
/* From the program's thread. */
void hh_say(const struct hh *host, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* ---- loader.c ---- */

extern const struct halhost_builtin hh_threads_builtin;
/* The index-th component that could be loaded, in name when it is a file's; NULL = no more. */
const char *hh_loadable(size_t index, char *name, size_t size);
const char *hh_module_name(const struct hh_module *module);
const char *hh_module_arguments(const struct hh_module *module);

#endif
