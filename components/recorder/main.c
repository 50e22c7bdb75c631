/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * recorder: keep the values of some pins of every cycle, and write them to a CSV file when it is unloaded.
 *
 *     loadrt recorder pins=6 depth=20000 file=/tmp/run.csv
 *
 * The memory is taken and the file is created at load, so that a run is not lost for want of either; when the memory
 * is full, recording stops and recorder.full turns 1.
 */
#include <errno.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include <hm2/points.h>

#include "common/hal_binder.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("records pins in every cycle to a CSV file");
MODULE_LICENSE("GPL");

#define MAX_PINS  32
#define MAX_DEPTH 10000000

static int pins = 1;
RTAPI_MP_INT(pins, "number of pins, 1..32");
static int depth = 20000;
RTAPI_MP_INT(depth, "cycles to keep, 1..10000000");
static char *file = 0;
RTAPI_MP_STRING(file, "CSV file to write when unloaded");

struct channel {
    hm2_float_t *value;
};

struct recorder {
    hm2_bit_t *enable, *full;
    hm2_u32_t *samples;
    struct channel channels[MAX_PINS];
};

static const struct hm2_point points[] = {
    HM2_POINT(struct recorder, enable, "enable", HM2_BIT, HM2_PIN_IN, 0, "", "record while 1"),
    HM2_POINT(struct recorder, full, "full", HM2_BIT, HM2_PIN_OUT, 0, "", "no room for another cycle"),
    HM2_POINT(struct recorder, samples, "samples", HM2_U32, HM2_PIN_OUT, 0, "cycles", "recorded so far"),
};

static const struct hm2_point channel_points[] = {
    HM2_POINT(struct channel, value, "pin-##", HM2_FLOAT, HM2_PIN_IN, 0, "", "recorded value"),
};

static struct recorder *recorder;
static double *rows; /* depth rows of time in seconds and one value a pin */
/* Not read back from its pin: a pin that is linked takes the value of its signal. */
static atomic_uint recorded;
static double time_s;
static FILE *out;
static int component_id;

static void sample(void *const unused, const long period)
{
    (void)unused;
    if (!*recorder->enable)
        return;
    const unsigned n = atomic_load_explicit(&recorded, memory_order_relaxed);
    *recorder->samples = n;
    *recorder->full = n >= (unsigned)depth;
    if (n >= (unsigned)depth)
        return;
    double *const row = rows + (size_t)n * (size_t)(pins + 1);
    row[0] = time_s;
    for (int i = 0; i < pins; i++)
        row[i + 1] = *recorder->channels[i].value;
    time_s += (double)period * 1e-9;
    *recorder->samples = n + 1;
    atomic_store_explicit(&recorded, n + 1, memory_order_release);
}

static void write_rows(void)
{
    const unsigned count = atomic_load_explicit(&recorded, memory_order_acquire);
    fputs("time_s", out);
    for (int i = 0; i < pins; i++)
        fprintf(out, ",pin%d", i);
    fputc('\n', out);
    for (unsigned n = 0; n < count; n++) {
        const double *const row = rows + (size_t)n * (size_t)(pins + 1);
        fprintf(out, "%.6f", row[0]);
        for (int i = 0; i < pins; i++)
            fprintf(out, ",%.9g", row[i + 1]);
        fputc('\n', out);
    }
}

static void save(void)
{
    errno = 0;
    write_rows();
    const bool failed = ferror(out) != 0;
    if (fclose(out) != 0 || failed)
        rtapi_print_msg(RTAPI_MSG_ERR, "recorder: file %s: cannot be written: %s\n", file, strerror(errno));
}

static int check_parameters(void)
{
    if (pins < 1 || pins > MAX_PINS) {
        rtapi_print_msg(RTAPI_MSG_ERR, "recorder: pins=%d: give 1 to %d\n", pins, MAX_PINS);
        return -EINVAL;
    }
    if (depth < 1 || depth > MAX_DEPTH) {
        rtapi_print_msg(RTAPI_MSG_ERR, "recorder: depth=%d: give 1 to %d cycles\n", depth, MAX_DEPTH);
        return -EINVAL;
    }
    if (!file || !file[0]) {
        rtapi_print_msg(RTAPI_MSG_ERR, "recorder: say where to write: file=PATH\n");
        return -EINVAL;
    }
    return 0;
}

static int open_file(void)
{
    out = fopen(file, "we");
    if (out)
        return 0;
    const int error = errno;
    rtapi_print_msg(RTAPI_MSG_ERR, "recorder: file %s: cannot be created: %s\n", file, strerror(error));
    return -error;
}

#define PAGE_DOUBLES 512u /* not more than a page holds anywhere */

/* Every page is written now, so that no cycle has to wait for one; volatile, or the compiler trusts calloc(). */
static int take_memory(void)
{
    const size_t row_bytes = (size_t)(pins + 1) * sizeof *rows;
    rows = calloc((size_t)depth, row_bytes);
    if (!rows) {
        rtapi_print_msg(RTAPI_MSG_ERR, "recorder: no memory for depth=%d cycles of %d bytes\n", depth, (int)row_bytes);
        return -ENOMEM;
    }
    volatile double *const touched = rows;
    for (size_t i = 0; i < (size_t)depth * (size_t)(pins + 1); i += PAGE_DOUBLES)
        touched[i] = 0.0;
    return 0;
}

static int create(void)
{
    struct hal_binder hal;
    struct hm2_diag diag = {0};

    hal_binder_init(&hal, component_id);
    recorder = hal.binder.alloc(&hal.binder, sizeof *recorder);
    if (!recorder) {
        rtapi_print_msg(RTAPI_MSG_ERR, "recorder: HAL has no memory left\n");
        return -ENOMEM;
    }
    int err = hm2_bind_points(&hal.binder, points, sizeof points / sizeof points[0], recorder, "recorder", 0, &diag);
    for (int i = 0; err == HM2_OK && i < pins; i++)
        err = hm2_bind_points(&hal.binder, channel_points, 1, &recorder->channels[i], "recorder", (unsigned)i, &diag);
    if (err != HM2_OK) {
        rtapi_print_msg(RTAPI_MSG_ERR, "recorder: %s", diag.text);
        return -EINVAL;
    }
    return hal_export_funct("recorder.sample", sample, NULL, 1, 0, component_id);
}

int rtapi_app_main(void)
{
    int result = check_parameters();
    if (result < 0)
        return result;
    component_id = hal_init("recorder");
    if (component_id < 0)
        return component_id;
    atomic_store(&recorded, 0);
    time_s = 0.0;
    result = take_memory();
    if (result == 0)
        result = create();
    if (result == 0)
        result = open_file();
    if (result == 0)
        result = hal_ready(component_id);
    if (result < 0) {
        hal_exit(component_id);
        if (out)
            (void)fclose(out);
        free(rows);
    }
    return result;
}

void rtapi_app_exit(void)
{
    hal_exit(component_id); /* first, so that no thread records any more */
    save();
    free(rows);
}
