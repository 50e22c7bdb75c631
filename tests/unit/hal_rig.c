/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "hal_rig.h"

#include <pthread.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

struct probe_arguments probe_seen;
char probe_texts[3][64];
unsigned probe_mains, probe_exits;
struct probe *probes;
void (*probe_hook)(struct probe *probe, long period_ns);

static int probe_id;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static char messages[65536], copied[65536], output[65536];
static size_t messages_used, output_used;
static struct hal_session *session;
static struct hm2_diag diag;

/* ---- component probe -------------------------------------------------------------------------------------------- */

static void probe_funct(void *const arg, const long period_ns)
{
    struct probe *const probe = arg;
    *probe->count += 1;
    *probe->out = *probe->in;
    probe->seen = rtapi_task_self();
    if (probe_hook && probe == probes)
        probe_hook(probe, period_ns);
}

static int create_probe(struct probe *const probe, const int n)
{
    char name[HAL_NAME_LEN + 1];
    snprintf(name, sizeof name, "probe.%d", n);
    probe->gain = 2.5;
    return hal_pin_float_newf(HAL_IN, &probe->in, probe_id, "probe.%d.in", n) ||
           hal_pin_float_newf(HAL_OUT, &probe->out, probe_id, "probe.%d.out", n) ||
           hal_pin_bit_newf(HAL_IO, &probe->io, probe_id, "probe.%d.io", n) ||
           hal_pin_s32_newf(HAL_OUT, &probe->count, probe_id, "probe.%d.count", n) ||
           hal_pin_u32_newf(HAL_IN, &probe->word, probe_id, "probe.%d.word", n) ||
           hal_param_float_newf(HAL_RW, &probe->gain, probe_id, "probe.%d.gain", n) ||
           hal_param_s32_newf(HAL_RO, &probe->seen, probe_id, "probe.%d.seen", n) ||
           hal_export_funct(name, probe_funct, probe, 1, 0, probe_id);
}

static void keep_text(char to[const 64], const char *const from)
{
    snprintf(to, 64, "%s", from ? from : "(none)");
}

static int probe_main(void *const block)
{
    probe_mains++;
    memcpy(&probe_seen, block, sizeof probe_seen);
    keep_text(probe_texts[0], probe_seen.text);
    keep_text(probe_texts[1], probe_seen.texts[0]);
    keep_text(probe_texts[2], probe_seen.texts[1]);
    probe_id = hal_init("probe");
    if (probe_id < 0)
        return probe_id;
    probes = hal_malloc((long)(sizeof *probes * (size_t)(probe_seen.sets + 1)));
    if (!probes)
        return -ENOMEM;
    for (int n = 0; n < probe_seen.sets; n++) {
        if (create_probe(&probes[n], n))
            return -EINVAL;
    }
    if (probe_seen.fail)
        return probe_seen.fail;
    return probe_seen.not_ready ? 0 : hal_ready(probe_id);
}

char probe_order[16];

static void note_exit(const char which)
{
    const size_t len = strlen(probe_order);
    if (len + 1 < sizeof probe_order) {
        probe_order[len] = which;
        probe_order[len + 1] = '\0';
    }
}

static void probe_exit(void *const block)
{
    (void)block;
    probe_exits++;
    note_exit('p');
    hal_exit(probe_id);
}

/* A second component, to see in which order they go. */
static int tail_id;

static int tail_main(void *const block)
{
    (void)block;
    tail_id = hal_init("tail");
    return tail_id < 0 ? tail_id : hal_ready(tail_id);
}

static void tail_exit(void *const block)
{
    (void)block;
    note_exit('t');
    hal_exit(tail_id);
}

static const struct halhost_parameter parameters[] = {
    {"sets", 'i', offsetof(struct probe_arguments, sets), 0},
    {"fail", 'i', offsetof(struct probe_arguments, fail), 0},
    {"not_ready", 'i', offsetof(struct probe_arguments, not_ready), 0},
    {"numbers", 'i', offsetof(struct probe_arguments, numbers), 3},
    {"wide", 'l', offsetof(struct probe_arguments, wide), 0},
    {"text", 's', offsetof(struct probe_arguments, text), 0},
    {"texts", 's', offsetof(struct probe_arguments, texts), 2},
};

static const struct probe_arguments defaults = {.sets = 1};

static const struct halhost_builtin builtins[] = {
    {
        .name = "probe",
        .parameters = parameters,
        .parameter_count = sizeof parameters / sizeof parameters[0],
        .block_size = sizeof(struct probe_arguments),
        .defaults = &defaults,
        .main = probe_main,
        .exit = probe_exit,
    },
    {.name = "tail", .main = tail_main, .exit = tail_exit},
};

/* ---- rig -------------------------------------------------------------------------------------------------------- */

static void on_message(const void *const context, const enum halhost_stream stream, const char *const text)
{
    (void)context;
    (void)stream;
    pthread_mutex_lock(&lock);
    const int more = snprintf(messages + messages_used, sizeof messages - messages_used, "%s", text);
    if (more > 0 && messages_used + (size_t)more < sizeof messages)
        messages_used += (size_t)more;
    pthread_mutex_unlock(&lock);
}

const char *hal_rig_messages(void)
{
    halhost_flush_messages();
    pthread_mutex_lock(&lock);
    memcpy(copied, messages, sizeof copied);
    pthread_mutex_unlock(&lock);
    return copied;
}

static void on_output(void *const context, const char *const text, const size_t length)
{
    (void)context;
    if (length < sizeof output - output_used) {
        memcpy(output + output_used, text, length);
        output_used += length;
        output[output_used] = '\0';
    }
}

static enum hal_wait wait_until(void *const context, const int64_t until_ns)
{
    (void)context;
    const struct timespec until = {.tv_sec = (time_t)(until_ns / 1000000000), .tv_nsec = (long)(until_ns % 1000000000)};
    if (until_ns)
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
    return HAL_WAIT_REACHED;
}

int hal_rig_open(void **const state)
{
    (void)state;
    const struct halhost_options host = {
        .memory_bytes = 1 << 20,
        .message = on_message,
        .builtins = builtins,
        .builtin_count = sizeof builtins / sizeof builtins[0],
        .no_realtime = true,
        .cpu = HALHOST_CPU_DEFAULT,
    };
    const struct hal_session_options options = {.write = on_output, .wait = wait_until, .threads = true};
    messages[0] = output[0] = '\0';
    messages_used = output_used = 0;
    probe_mains = probe_exits = 0;
    probe_order[0] = '\0';
    probe_hook = NULL;
    hm2_diag_clear(&diag);
    session = hal_session_new(&options);
    return session ? halhost_open(&host, &diag) : -1;
}

int hal_rig_close(void **const state)
{
    (void)state;
    hal_session_free(session);
    hm2_diag_clear(&diag);
    const int err = halhost_close(&diag);
    if (err)
        fprintf(stderr, "%s", diag.text);
    return err;
}

struct hal_session *hal_rig_session(void)
{
    return session;
}

const char *hal_rig_run(const char *const commands)
{
    output[0] = '\0';
    output_used = 0;
    hm2_diag_clear(&diag);
    const int err = hal_session_run_text(session, "t.hal", commands, strlen(commands), &diag);
    return err && !diag.text[0] ? "error without a sentence" : diag.text;
}

const char *hal_rig_output(void)
{
    return output;
}
