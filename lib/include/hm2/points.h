/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Points: what a device offers to its host, as constant tables.
 *
 * A module describes its pins and parameters with rows of struct hm2_point and keeps, in its own struct, one typed
 * pointer per row. A binder creates the objects in the host and fills the pointers, so values live in the host's
 * memory, nothing is copied, and no module contains a HAL call. The host may move a pin's pointer at any time
 * between two cycles (HAL does when a pin is linked): dereference it anew each time, never keep the target.
 *
 * The same rows feed `show`, man pages, JSON reports and name-for-name tests.
 */
#ifndef HM2_POINTS_H
#define HM2_POINTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

/* Same representation as HAL's hal_bit_t, hal_s32_t, hal_u32_t, hal_float_t. */
typedef volatile bool hm2_bit_t;
typedef volatile int32_t hm2_s32_t;
typedef volatile uint32_t hm2_u32_t;
typedef volatile double hm2_float_t __attribute__((aligned(8)));

enum hm2_point_type { HM2_BIT, HM2_S32, HM2_U32, HM2_FLOAT };
enum hm2_point_dir {
    HM2_PIN_IN,  /* pin, host to device */
    HM2_PIN_OUT, /* pin, device to host */
    HM2_PIN_IO,  /* pin, both write it */
    HM2_PARAM_RO,
    HM2_PARAM_RW,
};

struct hm2_point {
    const char
        *name; /* suffix below its prefix; "##" stands for an index of two digits, "###" for three, "#" for one */
    enum hm2_point_type type;
    enum hm2_point_dir dir;
    double initial;   /* value after creation; bits and integers are converted */
    const char *unit; /* "ns", "counts", "units/s", ...; "" = none */
    const char *help; /* one line */
    size_t offset;    /* of the typed pointer (hm2_float_t *, ...) in the module's struct */
};

/* One row whose pointer is member `field` of `struct_type`. */
#define HM2_POINT(struct_type, field, point_name, point_type, point_dir, init, unit_text, help_text)            \
    {                                                                                                           \
        .name = (point_name), .type = (point_type), .dir = (point_dir), .initial = (init), .unit = (unit_text), \
        .help = (help_text), .offset = offsetof(struct_type, field)                                             \
    }

#define HM2_NAME_SIZE 128u /* buffer for a full name; the host's own limit is lower and is checked by it */

/* Provided by the host. All calls happen at set-up, none in a cycle. */
struct hm2_binder {
    /* Zeroed memory that lives as long as the host's objects, for the structs that hold the pointers. NULL = none. */
    void *(*alloc)(struct hm2_binder *binder, size_t size);
    /* Create one object and store the pointer to its value at *slot (slot points at a typed pointer inside memory
     * from alloc, and that pointer is NULL: hosts take any other as one in use already). Returns 0 or HM2_ERR_HOST with
     * the reason in diag. */
    int (*create)(struct hm2_binder *binder, const char *full_name, const struct hm2_point *point, void *slot,
                  struct hm2_diag *diag);
    /* Give an existing parameter a second name. Failure is reported by the caller and otherwise ignored. */
    int (*alias)(struct hm2_binder *binder, const char *existing, const char *alias);
};

/* Store a number in a value of the point's type, as hm2/number.h converts (bit: true unless 0). Realtime safe. */
HM2_API void hm2_point_store(enum hm2_point_type type, void *value, double number);
/* The value as a double. Realtime safe. */
HM2_API double hm2_point_load(enum hm2_point_type type, const void *value);

/* Create every row of a table for the struct at base (which must lie in memory from the binder's alloc). Full name =
 * prefix "." name. index replaces every run of "#" in names, zero padded
 * to its length. Stores the initial values. Stops at the
 * first failure: HM2_ERR_NOSPACE for a full name of HM2_NAME_SIZE or more characters, else what the binder returned. */
HM2_API int HM2_MUST_CHECK hm2_bind_points(struct hm2_binder *binder, const struct hm2_point *points, size_t count,
                                           void *base, const char *prefix, unsigned index, struct hm2_diag *diag);

/* ---- plain binder: for tests and embedders without a HAL -------------------------------------------------------- */

struct hm2_plain_binder;

/* A binder that keeps the values in its own memory; they never move. Duplicate names and names of HM2_NAME_SIZE or more
 * characters are refused. An object has at most one alias. NULL when there is no memory. */
HM2_API struct hm2_plain_binder *hm2_plain_binder_new(void);
HM2_API void hm2_plain_binder_free(struct hm2_plain_binder *plain);
HM2_API struct hm2_binder *hm2_plain_binder(struct hm2_plain_binder *plain);

struct hm2_plain_object {
    const char *name;  /* full name */
    const char *alias; /* or NULL */
    const struct hm2_point *point;
    void *value; /* hm2_bit_t *, hm2_s32_t *, hm2_u32_t * or hm2_float_t * */
};

/* By full name or alias; NULL when there is none. */
HM2_API const struct hm2_plain_object *hm2_plain_find(const struct hm2_plain_binder *plain, const char *name);
HM2_API size_t hm2_plain_count(const struct hm2_plain_binder *plain);
HM2_API const struct hm2_plain_object *hm2_plain_at(const struct hm2_plain_binder *plain, size_t index);
/* Value as a double, whatever the type; 0 and HM2_ERR_NOTFOUND in *err (may be NULL) for an unknown name. */
HM2_API double hm2_plain_get(const struct hm2_plain_binder *plain, const char *name, int *err);
HM2_API int hm2_plain_set(struct hm2_plain_binder *plain, const char *name, double value);

#endif
