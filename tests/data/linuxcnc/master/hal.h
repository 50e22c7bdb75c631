/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Compile-only model of LinuxCNC master's hal.h: the calls that 2.9 has, too, with master's types. See ../README.md. */
#ifndef MODEL_HAL_H
#define MODEL_HAL_H

#include <stdbool.h>

#include <rtapi.h>

#define HAL_NAME_LEN 55

typedef enum {
    HAL_TYPE_UNSPECIFIED = -1,
    HAL_TYPE_UNINITIALIZED = 0,
    HAL_BIT = 1,
    HAL_FLOAT = 2,
    HAL_S32 = 3,
    HAL_U32 = 4,
    HAL_PORT = 5,
    HAL_S64 = 6,
    HAL_U64 = 7
} hal_type_t;
#define HAL_BOOL HAL_BIT
#define HAL_REAL HAL_FLOAT
#define HAL_SINT HAL_S64
#define HAL_UINT HAL_U64

/* HAL_WO = 128 is only the other half of HAL_RW. */
typedef enum {
    HAL_DIR_UNSPECIFIED = -1,
    HAL_IN = 16,
    HAL_OUT = 32,
    HAL_IO = 48,
    HAL_RO = 64,
    HAL_WO = 128,
    HAL_RW = 192
} hal_pdir_t;
typedef hal_pdir_t hal_pin_dir_t, hal_param_dir_t;

typedef double real_t __attribute__((aligned(8)));
typedef volatile bool hal_bit_t;
typedef volatile int hal_s32_t;
typedef volatile unsigned hal_u32_t;
typedef volatile real_t hal_float_t;

/* Names that master took for the handles of its new calls; what they point at is its own affair. */
typedef struct model_bool *hal_bool_t;
typedef struct model_sint *hal_sint_t;
typedef struct model_uint *hal_uint_t;
typedef struct model_real *hal_real_t;

int hal_init(const char *name);
int hal_ready(int comp_id);
int hal_exit(int comp_id);
void *hal_malloc(long size);
int hal_export_funct(const char *name, void (*funct)(void *arg, long period), void *arg, int uses_fp, int reentrant,
                     int comp_id);
int hal_pin_alias(const char *pin, const char *alias);
int hal_param_alias(const char *param, const char *alias);

#define MODEL_FORMAT __attribute__((format(printf, 4, 5)))
#define MODEL_CALLS(kind)                                                                                           \
    int hal_pin_##kind##_new(const char *name, hal_pin_dir_t dir, hal_##kind##_t **pointer, int comp_id);           \
    int hal_param_##kind##_new(const char *name, hal_param_dir_t dir, hal_##kind##_t *address, int comp_id);        \
    int hal_pin_##kind##_newf(hal_pin_dir_t dir, hal_##kind##_t **pointer, int comp_id, const char *format, ...)    \
        MODEL_FORMAT;                                                                                               \
    int hal_param_##kind##_newf(hal_param_dir_t dir, hal_##kind##_t *address, int comp_id, const char *format, ...) \
        MODEL_FORMAT
MODEL_CALLS(bit);
MODEL_CALLS(float);
MODEL_CALLS(s32);
MODEL_CALLS(u32);

#endif
