/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * HAL files: every byte string is executed as one on a fresh host, with a component that is part of the program, no
 * files, no modules and no running threads. Afterwards the host must come down with nothing left.
 */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define RTAPI 1
#include <hal.h>
#include <rtapi.h>

#include "halhost.h"
#include "session.h"

struct arguments {
    int count;
    int numbers[3];
    char *text;
};

static const struct arguments defaults = {.count = 1};

static const struct halhost_parameter parameters[] = {
    {"count", 'i', offsetof(struct arguments, count), 0},
    {"numbers", 'i', offsetof(struct arguments, numbers), 3},
    {"text", 's', offsetof(struct arguments, text), 0},
};

struct gate {
    hal_bit_t *in, *out;
    hal_float_t *level;
    hal_s32_t gain;
    hal_u32_t *mask;
};

static int comp_id;

static void update(void *const arg, const long period_ns)
{
    (void)arg;
    (void)period_ns;
    abort(); /* no thread ever runs here */
}

static int gate_main(void *const block)
{
    const struct arguments *const arguments = block;
    comp_id = hal_init("gate");
    if (comp_id < 0)
        return comp_id;
    int status = 0;
    for (int i = 0; i < arguments->count && i < 8 && status == 0; i++) {
        char name[HAL_NAME_LEN + 1];
        struct gate *const gate = hal_malloc(sizeof *gate);
        if (!gate)
            return -ENOMEM;
        (void)rtapi_snprintf(name, sizeof name, "gate.%d", i);
        status =
            hal_pin_bit_newf(HAL_IN, &gate->in, comp_id, "g.%d.in", i) ||
            hal_pin_bit_newf(HAL_OUT, &gate->out, comp_id, "%s.%d.out", arguments->text ? arguments->text : "g", i) ||
            hal_pin_float_newf(HAL_IO, &gate->level, comp_id, "g.%d.level", i) ||
            hal_pin_u32_newf(HAL_IN, &gate->mask, comp_id, "g.%d.mask", i) ||
            hal_param_s32_newf(HAL_RW, &gate->gain, comp_id, "g.%d.gain", i) ||
            hal_export_funct(name, update, gate, i & 1, i & 2, comp_id);
    }
    return status ? -EINVAL : hal_ready(comp_id);
}

static void gate_exit(void *const block)
{
    (void)block;
    (void)hal_exit(comp_id);
}

static const struct halhost_builtin builtins[] = {{
    .name = "gate",
    .parameters = parameters,
    .parameter_count = sizeof parameters / sizeof parameters[0],
    .block_size = sizeof(struct arguments),
    .defaults = &defaults,
    .main = gate_main,
    .exit = gate_exit,
}};

static size_t printed;

static void on_write(void *const context, const char *const text, const size_t length)
{
    (void)context;
    if (memchr(text, '\0', length))
        abort();
    printed += length;
}

static const char *environment(void *const context, const char *const name)
{
    (void)context;
    return strcmp(name, "E") == 0 ? "g.0.in \"two words" : NULL;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    const struct halhost_options host = {
        .memory_bytes = 65536,
        .builtins = builtins,
        .builtin_count = 1,
        .no_realtime = true,
        .cpu = HALHOST_CPU_ANY,
    };
    static struct hm2_diag diag;
    hm2_diag_clear(&diag);
    if (size == 0 || halhost_open(&host, &diag))
        return 0;
    const struct hal_session_options options = {
        .write = on_write, .environment = environment, .json = data[0] == '{', /* both forms of show are wanted */
    };
    struct hal_session *const session = hal_session_new(&options);
    if (session) {
        const int err = hal_session_run_text(session, "fuzz.hal", (const char *)data + (data[0] == '{'),
                                             size - (data[0] == '{'), &diag);
        if (err && diag.problems == 0)
            abort(); /* an error without a sentence */
        char name[64];
        size_t at = 0;
        while (hal_session_complete(session, "setp g", &at, name, sizeof name)) {
        }
        hal_session_free(session);
    }
    if (halhost_close(&diag))
        abort();
    return 0;
}
