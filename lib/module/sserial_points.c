/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Points of ports, and of remotes from what discovery found (hal-interface 2.19). The rows of a remote are made at
 * load, in memory of the binder: it keeps them as long as its objects.
 */
#include <stdio.h>
#include <string.h>

#include <hm2/lbp.h>

#include "bind.h"
#include "sserial.h"

/* ---- ports --------------------------------------------------------------------------------------------------------
 */

#define PORT(field, name, type, dir, init, unit, help) \
    HM2_POINT(struct sserial_points, field, name, type, dir, init, unit, help)

static const struct hm2_point debug_points[] = {
    PORT(debug, "debug", HM2_S32, HM2_PIN_OUT, 0, "ns", "time that the present command of the port may still take"),
};

static const struct hm2_point port_points[] = {
    PORT(run, "run", HM2_BIT, HM2_PIN_IN, 1, "", "0: stopped; from 1 to 0 and back starts anew"),
    PORT(port_state, "port_state", HM2_U32, HM2_PIN_OUT, 0, "",
         "0 idle, 2 starting, 3 running, 4 stopping, 5 waiting for the stop, 10 error"),
    PORT(port_state2, "port_state2", HM2_U32, HM2_PIN_OUT, 0, "", "1 while parameters are looked at, else 0"),
    PORT(port_state3, "port_state3", HM2_U32, HM2_PIN_OUT, 0, "", "step of writing a parameter, 0 = none"),
    PORT(fault_count, "fault-count", HM2_U32, HM2_PIN_OUT, 0, "", "failures, leaking; of the remote that has most"),
    PORT(fault_inc, "fault-inc", HM2_U32, HM2_PARAM_RW, 10, "", "added for a failure"),
    PORT(fault_dec, "fault-dec", HM2_U32, HM2_PARAM_RW, 1, "", "taken off in each cycle"),
    PORT(fault_lim, "fault-lim", HM2_U32, HM2_PARAM_RW, 200, "", "a remote with more is stopped"),
    PORT(fault, "fault", HM2_BIT, HM2_PIN_OUT, 0, "", "1: the port, or at least one remote of it, is stopped"),
    PORT(auto_restart, "auto-restart", HM2_BIT, HM2_PARAM_RW, 0, "", "1: start again without a change of run"),
    PORT(restarts, "restarts", HM2_U32, HM2_PIN_OUT, 0, "", "automatic restarts so far"),
    PORT(skipped, "doits-skipped", HM2_U32, HM2_PIN_OUT, 0, "cycles", "cycles in which no transfer could be ordered"),
    PORT(doit_us, "doit-us", HM2_FLOAT, HM2_PIN_OUT, 0, "us", "at most so long the last transfer took"),
};

#define REMOTE(field, name, type, help) HM2_POINT(struct sserial_remote, field, name, type, HM2_PIN_OUT, 0, "", help)

static const struct hm2_point remote_points[] = {
    REMOTE(fault, "link-fault", HM2_BIT,
           "1: the last reply of the card brought no new inputs of the remote, or it is stopped"),
    REMOTE(errors, "link-errors", HM2_U32, "failed transfers since load"),
    REMOTE(status, "link-status", HM2_U32, "CS register as read last (SSLBP manual)"),
};

enum { GROUP_DEBUG, GROUP_PORT, GROUP_REMOTE };

const struct hm2_point_group sserial_groups[] = {
    [GROUP_DEBUG] = HM2_GROUP("#", debug_points, "ports with at least one remote"),
    [GROUP_PORT] = HM2_GROUP("sserial.port-#", port_points, "ports with at least one remote"),
    [GROUP_REMOTE] = HM2_GROUP("CARD.#.#", remote_points, "every remote: name of its card, port, channel"),
    {.prefix = NULL},
};

int sserial_bind_port(const struct hm2_setup *const setup, struct sserial_port *const port)
{
    const int err = hm2_bind_group(setup, &sserial_groups[GROUP_DEBUG], &port->points, port->number);
    return err < 0 ? err : hm2_bind_group(setup, &sserial_groups[GROUP_PORT], &port->points, port->number);
}

/* ---- rows of a remote ---------------------------------------------------------------------------------------------
 */

enum initial { ZERO, MAX, MIN, FULL_TURN };

/* A point of a field: its name is the field's and the suffix. */
struct template
{
    const char *suffix;
    enum hm2_point_type type;
    enum hm2_point_dir dir;
    enum initial initial;
    const char *help;
    size_t offset; /* in the struct that the kind has */
};

#define LEVEL(field, suffix, dir, help)                                     \
    {                                                                       \
        suffix, HM2_BIT, dir, ZERO, help, offsetof(struct hm2_level, field) \
    }
#define OUT(field, suffix, dir, help)                                             \
    {                                                                             \
        suffix, HM2_BIT, dir, ZERO, help, offsetof(struct sserial_bit_out, field) \
    }
#define FIELD(field, suffix, type, dir, initial, help)                             \
    {                                                                              \
        suffix, type, dir, initial, help, offsetof(struct sserial_field, as.field) \
    }
#define NUMBER(field, suffix, dir, initial, help) FIELD(number.field, suffix, HM2_FLOAT, dir, initial, help)

static const struct template bit_in[] = {
    LEVEL(level, "-##", HM2_PIN_OUT, "input"),
    LEVEL(inverse, "-##-not", HM2_PIN_OUT, "its inverse"),
};
static const struct template bit_out[] = {
    OUT(bit, "-##", HM2_PIN_IN, "output"),
    OUT(invert, "-##-invert", HM2_PARAM_RW, "1: the output is inverted"),
};
static const struct template bit_both[] = {LEVEL(level, "-##", HM2_PIN_IO, "input and output")};
static const struct template boolean_in[] = {
    LEVEL(level, "", HM2_PIN_OUT, "input"),
    LEVEL(inverse, "-not", HM2_PIN_OUT, "its inverse"),
};
static const struct template boolean_out[] = {
    OUT(bit, "", HM2_PIN_IN, "output"),
    OUT(invert, "-invert", HM2_PARAM_RW, "1: the output is inverted"),
};
static const struct template boolean_both[] = {LEVEL(level, "", HM2_PIN_IO, "input and output")};
static const struct template number_in[] = {
    NUMBER(value, "", HM2_PIN_OUT, ZERO, "measured value"),
    NUMBER(scalemax, "-scalemax", HM2_PARAM_RW, MAX, "value at full scale"),
};
static const struct template number_out[] = {
    NUMBER(value, "", HM2_PIN_IN, ZERO, "value to set"),
    NUMBER(scalemax, "-scalemax", HM2_PARAM_RW, MAX, "value at full scale"),
    NUMBER(maxlim, "-maxlim", HM2_PARAM_RW, MAX, "largest value that is set"),
    NUMBER(minlim, "-minlim", HM2_PARAM_RW, MIN, "smallest value that is set"),
};
static const struct template number_both[] = {
    NUMBER(value, "", HM2_PIN_IO, ZERO, "value"),
    NUMBER(scalemax, "-scalemax", HM2_PARAM_RW, MAX, "value at full scale"),
    NUMBER(maxlim, "-maxlim", HM2_PARAM_RW, MAX, "largest value that is set"),
    NUMBER(minlim, "-minlim", HM2_PARAM_RW, MIN, "smallest value that is set"),
};
static const struct template float_in[] = {NUMBER(value, "", HM2_PIN_OUT, ZERO, "measured value")};
static const struct template float_out[] = {NUMBER(value, "", HM2_PIN_IN, ZERO, "value to set")};
static const struct template float_both[] = {NUMBER(value, "", HM2_PIN_IO, ZERO, "value")};
static const struct template stream_in[] = {FIELD(stream.value, "", HM2_U32, HM2_PIN_OUT, ZERO, "data as they come")};
static const struct template stream_out[] = {FIELD(stream.value, "", HM2_U32, HM2_PIN_IN, ZERO, "data to send")};
static const struct template stream_both[] = {FIELD(stream.value, "", HM2_U32, HM2_PIN_IO, ZERO, "data")};
static const struct template counter[] = {
    FIELD(counter.count, ".count", HM2_S32, HM2_PIN_OUT, ZERO, "counts since the last reset or index"),
    FIELD(counter.rawcounts, ".rawcounts", HM2_S32, HM2_PIN_OUT, ZERO, "counts since load"),
    FIELD(counter.position, ".position", HM2_FLOAT, HM2_PIN_OUT, ZERO, "count / scale"),
    FIELD(counter.index_enable, ".index-enable", HM2_BIT, HM2_PIN_IO, ZERO,
          "1: count becomes 0 at the next multiple of counts-per-rev, and this pin too"),
    FIELD(counter.reset, ".reset", HM2_BIT, HM2_PIN_IO, ZERO, "1: count is held at 0"),
    FIELD(counter.scale, ".scale", HM2_FLOAT, HM2_PARAM_RW, MAX, "counts per unit"),
    FIELD(counter.counts_per_rev, ".counts-per-rev", HM2_U32, HM2_PARAM_RW, FULL_TURN, "counts of a turn"),
};

#define ROWS(table)                             \
    {                                           \
        table, sizeof(table) / sizeof(table)[0] \
    }
enum storage { IN_FIELD, IN_LEVELS, IN_OUTS };

static const struct kind {
    uint8_t type;
    bool each_bit; /* a set of points for each bit */
    struct rows {
        const struct template *rows;
        size_t count;
    } direction[3]; /* input, both, output */
    enum storage storage[3];
} kinds[] = {
    {SSLBP_BITS, true, {ROWS(bit_in), ROWS(bit_both), ROWS(bit_out)}, {IN_LEVELS, IN_LEVELS, IN_OUTS}},
    {SSLBP_BOOLEAN, false, {ROWS(boolean_in), ROWS(boolean_both), ROWS(boolean_out)}, {IN_LEVELS, IN_LEVELS, IN_OUTS}},
    {SSLBP_UNSIGNED, false, {ROWS(number_in), ROWS(number_both), ROWS(number_out)}, {IN_FIELD}},
    {SSLBP_SIGNED, false, {ROWS(number_in), ROWS(number_both), ROWS(number_out)}, {IN_FIELD}},
    {SSLBP_STREAM, false, {ROWS(stream_in), ROWS(stream_both), ROWS(stream_out)}, {IN_FIELD}},
    {SSLBP_FLOAT, false, {ROWS(float_in), ROWS(float_both), ROWS(float_out)}, {IN_FIELD}},
    {SSLBP_ENCODER, false, {ROWS(counter)}, {IN_FIELD}},
    {SSLBP_ENCODER_H, false, {ROWS(counter)}, {IN_FIELD}},
};

struct making {
    const struct hm2_setup *setup;
    const char *prefix;
    struct sserial_remote *remote;
    const struct sslbp_field *source;
};

static double initial_value(const struct sslbp_field *const source, const enum initial initial)
{
    const double values[] = {[ZERO] = 0.0, [MAX] = source->max, [MIN] = source->min, [FULL_TURN] = 256.0};
    return values[initial];
}

/* One row, with its texts in the binder's memory. */
static int make_row(const struct making *const making, struct hm2_point *const row, const struct template *const from)
{
    const struct sslbp_field *const source = making->source;
    const size_t name_size = strlen(source->name) + strlen(from->suffix) + 1, unit_size = strlen(source->unit) + 1;
    char *const text = hm2_setup_alloc(making->setup, name_size + unit_size);
    if (!text)
        return HM2_ERR_NOMEM;
    (void)snprintf(text, name_size, "%s%s", source->name, from->suffix);
    memcpy(text + name_size, source->unit, unit_size);
    *row = (struct hm2_point){
        .name = text,
        .type = from->type,
        .dir = from->dir,
        .initial = initial_value(source, from->initial),
        .unit = from->type == HM2_FLOAT ? text + name_size : "",
        .help = from->help,
        .offset = from->offset,
    };
    return 0;
}

/* The points of a field, one set for each of count structs of size bytes from base on. */
static int make_points(const struct making *const making, const struct rows *const rows, void *const base,
                       const size_t size, const unsigned count)
{
    struct hm2_point *const points = hm2_setup_alloc(making->setup, rows->count * sizeof *points);
    int err = points ? 0 : HM2_ERR_NOMEM;
    for (size_t i = 0; err == 0 && i < rows->count; i++)
        err = make_row(making, &points[i], &rows->rows[i]);
    for (unsigned i = 0; err == 0 && i < count; i++)
        err = hm2_bind_points(making->setup->binder, points, rows->count, (char *)base + i * size, making->prefix, i,
                              making->setup->diag);
    return err;
}

static int make_levels(const struct making *const making, const struct rows *const rows,
                       struct sserial_field *const field, const unsigned count)
{
    struct hm2_level *const levels = hm2_setup_alloc(making->setup, count * sizeof *levels);
    if (!levels)
        return HM2_ERR_NOMEM;
    field->as.bit.in = levels;
    const int err = make_points(making, rows, levels, sizeof *levels, count);
    for (unsigned i = 0; i < count; i++)
        if (!levels[i].inverse)
            levels[i].inverse = &making->remote->nothing;
    return err;
}

static int make_outs(const struct making *const making, const struct rows *const rows,
                     struct sserial_field *const field, const unsigned count)
{
    struct sserial_bit_out *const outs = hm2_setup_alloc(making->setup, count * sizeof *outs);
    if (!outs)
        return HM2_ERR_NOMEM;
    field->as.bit.out = outs;
    return make_points(making, rows, outs, sizeof *outs, count);
}

static int bind_field(const struct making *const making, struct sserial_field *const field)
{
    const unsigned direction = field->direction / 0x40u;
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        const struct kind *const kind = &kinds[i];
        if (kind->type != field->type)
            continue;
        const struct rows *const rows = &kind->direction[direction];
        const unsigned count = kind->each_bit ? field->bits : 1;
        if (kind->storage[direction] == IN_LEVELS)
            return make_levels(making, rows, field, count);
        if (kind->storage[direction] == IN_OUTS)
            return make_outs(making, rows, field, count);
        return make_points(making, rows, field, sizeof *field, 1);
    }
    return 0; /* padding, and lower parts of counters */
}

static int bind_fields(const struct making *const making_, const struct sslbp_tables *const tables)
{
    struct sserial_remote *const remote = making_->remote;
    struct making making = *making_;
    const struct sserial_field *low = NULL;
    unsigned in_at = 0, out_at = 0;
    int err = 0;
    for (unsigned i = 0; err == 0 && i < tables->process_count; i++) {
        struct sserial_field *const field = &remote->fields[i];
        making.source = &tables->process[i];
        field->type = making.source->type;
        field->bits = making.source->bits;
        field->direction = making.source->direction;
        field->in_at = (uint16_t)in_at;
        field->out_at = (uint16_t)out_at;
        in_at += field->direction == SSLBP_OUTPUT ? 0 : field->bits;
        out_at += field->direction == SSLBP_INPUT ? 0 : field->bits;
        if (field->type == SSLBP_ENCODER_H && low) {
            field->as.counter.low_bits = low->bits;
            field->as.counter.low_at = low->in_at;
        }
        low = field->type == SSLBP_ENCODER_L ? field : NULL;
        err = bind_field(&making, field);
    }
    return err;
}

/* ---- parameters ---------------------------------------------------------------------------------------------------
 */

static int read_global(const struct sslbp_port *const access, const unsigned channel,
                       const struct sserial_global *const global, uint64_t *const raw)
{
    int err = global->nonvolatile ? sslbp_select_memory(access, channel, LBP_MEMORY_EEPROM) : 0;
    if (err == 0)
        err = sslbp_remote_read(access, channel, global->address, global->bytes, raw);
    if (err == 0 && global->nonvolatile)
        err = sslbp_select_memory(access, channel, LBP_MEMORY_WORKING);
    return err;
}

static enum hm2_point_type global_type(const struct sslbp_field *const source)
{
    if (source->type == SSLBP_FLOAT || source->type == SSLBP_NV_FLOAT)
        return HM2_FLOAT;
    return sslbp_is_signed(source) ? HM2_S32 : HM2_U32;
}

static int bind_global(const struct making *const making, const struct sslbp_port *const access,
                       struct sserial_global *const global)
{
    const struct sslbp_field *const source = making->source;
    *global = (struct sserial_global){
        .address = source->address,
        .type = source->type,
        .bits = source->bits,
        .bytes = (uint8_t)sslbp_field_bytes(source),
        .writable = source->direction != SSLBP_INPUT,
        .nonvolatile = sslbp_is_nonvolatile(source),
    };
    const struct template template = {
        "",   global_type(source),       global->writable ? HM2_PARAM_RW : HM2_PARAM_RO,
        ZERO, "parameter of the remote", offsetof(struct sserial_global, value),
    };
    const struct rows rows = {&template, 1};
    uint64_t raw = 0;
    int err = make_points(making, &rows, global, sizeof *global, 1);
    if (err == 0)
        err = read_global(access, making->remote->channel, global, &raw);
    if (err == 0) {
        sserial_global_show(global, raw);
        global->written = sserial_global_raw(global);
    }
    return err;
}

int sserial_bind_remote(const struct hm2_setup *const setup, const struct sslbp_port *const access,
                        struct sserial_remote *const remote, const char *const prefix,
                        const struct sslbp_tables *const tables)
{
    struct making making = {setup, prefix, remote, NULL};
    remote->field_count = tables->process_count;
    remote->global_count = tables->global_count;
    remote->in_words = (tables->in_bits + 31u) / 32u;
    remote->out_words = (tables->out_bits + 31u) / 32u;
    remote->fields = hm2_setup_alloc(setup, (remote->field_count + 1u) * sizeof *remote->fields);
    remote->globals = hm2_setup_alloc(setup, (remote->global_count + 1u) * sizeof *remote->globals);
    if (!remote->fields || !remote->globals)
        return HM2_ERR_NOMEM;
    int err = bind_fields(&making, tables);
    for (unsigned i = 0; err == 0 && i < remote->global_count; i++) {
        making.source = &tables->global[i];
        err = bind_global(&making, access, &remote->globals[i]);
    }
    const struct hm2_point_group *const group = &sserial_groups[GROUP_REMOTE];
    return err < 0 ? err : hm2_bind_points(setup->binder, group->points, group->count, remote, prefix, 0, setup->diag);
}
