/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The hardware abstraction layer (HAL) as components see it, for building them without LinuxCNC.
 *
 * Names, types and constants are those of LinuxCNC 2.9 (see rtapi.h). All functions return 0 (or an id) or a negative
 * errno and may only be called outside of realtime threads.
 */
#ifndef HAL_H
#define HAL_H

#include <stdbool.h>

#include <rtapi.h>
#include <rtapi_bool.h>
#include <rtapi_errno.h>
#include <rtapi_stdint.h>

RTAPI_BEGIN_DECLS

#define HAL_NAME_LEN 47 /* characters of a pin, parameter, signal, function, thread or component name */

#define HAL_LOCK_NONE   0
#define HAL_LOCK_LOAD   1
#define HAL_LOCK_CONFIG 2
#define HAL_LOCK_PARAMS 4
#define HAL_LOCK_RUN    8
#define HAL_LOCK_TUNE   (HAL_LOCK_LOAD | HAL_LOCK_CONFIG)
#define HAL_LOCK_ALL    255

typedef enum {
    HAL_TYPE_UNSPECIFIED = -1,
    HAL_TYPE_UNINITIALIZED = 0,
    HAL_BIT = 1,
    HAL_FLOAT = 2,
    HAL_S32 = 3,
    HAL_U32 = 4,
    HAL_PORT = 5
} hal_type_t;

typedef enum { HAL_DIR_UNSPECIFIED = -1, HAL_IN = 16, HAL_OUT = 32, HAL_IO = HAL_IN | HAL_OUT } hal_pin_dir_t;

typedef enum { HAL_RO = 64, HAL_RW = HAL_RO | 128 } hal_param_dir_t;

typedef double real_t __attribute__((aligned(8)));
typedef rtapi_u64 ireal_t __attribute__((aligned(8)));

typedef volatile bool hal_bit_t;
typedef volatile rtapi_u32 hal_u32_t;
typedef volatile rtapi_s32 hal_s32_t;
typedef volatile int hal_port_t;
#define hal_float_t volatile real_t

typedef union {
    hal_bit_t b;
    hal_s32_t s;
    hal_u32_t u;
    hal_float_t f;
    hal_port_t p;
} hal_data_u;

/* ---- components ---- */

int hal_init(const char *name); /* component id > 0 */
int hal_exit(int comp_id);      /* removes its functions from threads, its pins and its parameters */
int hal_ready(int comp_id);     /* nothing can be created afterwards, until hal_set_unready() */
int hal_set_unready(int comp_id);
int hal_unready(int comp_id);
char *hal_comp_name(int comp_id); /* NULL = no such component */

/* Zeroed memory for pin pointers and parameters; never given back. NULL when there is none left. */
void *hal_malloc(long size);

/* Instance constructors are accepted and never called, as in LinuxCNC's user-space HAL. */
typedef int (*constructor)(char *prefix, char *argument);
int hal_set_constructor(int comp_id, constructor make);

/* ---- pins ----
 * pointer must lie in memory from hal_malloc(). The host stores the address of the value there, and stores a new one
 * whenever the pin is linked or unlinked: dereference it anew in every cycle. */

int hal_pin_bit_new(const char *name, hal_pin_dir_t dir, hal_bit_t **pointer, int comp_id);
int hal_pin_float_new(const char *name, hal_pin_dir_t dir, hal_float_t **pointer, int comp_id);
int hal_pin_u32_new(const char *name, hal_pin_dir_t dir, hal_u32_t **pointer, int comp_id);
int hal_pin_s32_new(const char *name, hal_pin_dir_t dir, hal_s32_t **pointer, int comp_id);

int hal_pin_bit_newf(hal_pin_dir_t dir, hal_bit_t **pointer, int comp_id, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
int hal_pin_float_newf(hal_pin_dir_t dir, hal_float_t **pointer, int comp_id, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
int hal_pin_u32_newf(hal_pin_dir_t dir, hal_u32_t **pointer, int comp_id, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
int hal_pin_s32_newf(hal_pin_dir_t dir, hal_s32_t **pointer, int comp_id, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

int hal_pin_new(const char *name, hal_type_t type, hal_pin_dir_t dir, void **pointer, int comp_id);
int hal_pin_alias(const char *name, const char *alias); /* NULL removes the alias */

/* ---- signals ---- */

int hal_signal_new(const char *name, hal_type_t type);
int hal_signal_delete(const char *name);
int hal_link(const char *pin, const char *signal);
int hal_unlink(const char *pin);

/* ---- parameters ----
 * The value lives at address, in memory from hal_malloc(). */

int hal_param_bit_new(const char *name, hal_param_dir_t dir, hal_bit_t *address, int comp_id);
int hal_param_float_new(const char *name, hal_param_dir_t dir, hal_float_t *address, int comp_id);
int hal_param_u32_new(const char *name, hal_param_dir_t dir, hal_u32_t *address, int comp_id);
int hal_param_s32_new(const char *name, hal_param_dir_t dir, hal_s32_t *address, int comp_id);

int hal_param_bit_newf(hal_param_dir_t dir, hal_bit_t *address, int comp_id, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
int hal_param_float_newf(hal_param_dir_t dir, hal_float_t *address, int comp_id, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
int hal_param_u32_newf(hal_param_dir_t dir, hal_u32_t *address, int comp_id, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
int hal_param_s32_newf(hal_param_dir_t dir, hal_s32_t *address, int comp_id, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

int hal_param_new(const char *name, hal_type_t type, hal_param_dir_t dir, void *address, int comp_id);
int hal_param_alias(const char *name, const char *alias);

int hal_param_bit_set(const char *name, int value);
int hal_param_float_set(const char *name, double value);
int hal_param_u32_set(const char *name, unsigned long value);
int hal_param_s32_set(const char *name, signed long value);
int hal_param_set(const char *name, hal_type_t type, void *value);

/* ---- values by name ---- */

int hal_get_pin_value_by_name(const char *name, hal_type_t *type, hal_data_u **data, bool *connected);
int hal_get_signal_value_by_name(const char *name, hal_type_t *type, hal_data_u **data, bool *has_writers);
int hal_get_param_value_by_name(const char *name, hal_type_t *type, hal_data_u **data);

/* ---- functions and threads ---- */

int hal_export_funct(const char *name, void (*funct)(void *arg, long period_ns), void *arg, int uses_fp, int reentrant,
                     int comp_id);
int hal_create_thread(const char *name, unsigned long period_ns, int uses_fp); /* fastest first */
int hal_thread_delete(const char *name);
int hal_add_funct_to_thread(const char *funct, const char *thread, int position); /* 1 = first, -1 = last */
int hal_del_funct_from_thread(const char *funct, const char *thread);
int hal_start_threads(void);
int hal_stop_threads(void); /* from a realtime thread: asks all threads to end after their present cycle */

int hal_set_lock(unsigned char lock);
unsigned char hal_get_lock(void);

RTAPI_END_DECLS

#endif
