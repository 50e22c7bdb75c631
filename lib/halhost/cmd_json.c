/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* `show` as JSON: one object with one array for each kind asked for. */
#include "commands.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

static void print_text(struct hal_session *const session, const char *const text)
{
    hal_print(session, "\"");
    for (const char *at = text; *at; at++) {
        const unsigned char c = (unsigned char)*at;
        if (c == '"' || c == '\\')
            hal_print(session, "\\%c", c);
        else if (c < 0x20)
            hal_print(session, "\\u%04x", c);
        else
            hal_print(session, "%c", c);
    }
    hal_print(session, "\"");
}

static void member(struct hal_session *const session, const char *const key, const char *const value)
{
    hal_print(session, ", \"%s\": ", key);
    if (value)
        print_text(session, value);
    else
        hal_print(session, "null");
}

static void value_member(struct hal_session *const session, const struct hh_value value)
{
    hal_print(session, ", \"value\": ");
    switch ((int)value.type) {
    case HAL_BIT:
        hal_print(session, "%s", value.b ? "true" : "false");
        break;
    case HAL_FLOAT:
        /* JSON has no NaN and no infinity. */
        if (isfinite(value.f))
            hal_print(session, "%.17g", value.f);
        else
            hal_print(session, "null");
        break;
    case HAL_S32:
        hal_print(session, "%" PRId32, value.s);
        break;
    default:
        hal_print(session, "%" PRIu32, value.u);
        break;
    }
}

/* Name and alias of an object, with the separator from the one before. */
static void begin(struct hal_session *const session, bool *const first, const char *const name, const char *const alias)
{
    hal_print(session, "%s\n    {\"name\": ", *first ? "" : ",");
    *first = false;
    print_text(session, name);
    if (alias && alias[0])
        member(session, "alias", alias);
}

static void end(struct hal_session *const session)
{
    hal_print(session, "}");
}

static void json_comps(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh *const host = hh_host();
    bool first = true;
    for (size_t i = 0; i < host->comps.count; i++) {
        const struct hh_comp *const comp = host->comps.items[i];
        if (!hal_filter_name(filter, comp->name, HAL_TYPE_UNSPECIFIED))
            continue;
        begin(session, &first, comp->name, NULL);
        hal_print(session, ", \"id\": %d, \"ready\": %s", comp->id, comp->ready ? "true" : "false");
        end(session);
    }
}

static void json_pins(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh_list *const pins = &hh_host()->pins.shown;
    bool first = true;
    for (size_t i = 0; i < pins->count; i++) {
        const struct hh_pin *const pin = pins->items[i];
        if (!hal_filter_name(filter, hh_shown_name(pin), pin->type))
            continue;
        begin(session, &first, pin->names.name, pin->names.alias);
        member(session, "owner", pin->comp->name);
        member(session, "type", hh_type_name(pin->type));
        member(session, "dir", pin->dir == HAL_IN ? "in" : pin->dir == HAL_OUT ? "out" : "io");
        value_member(session, hh_load(pin->type, hh_pin_value(pin)));
        member(session, "signal", pin->signal ? pin->signal->names.name : NULL);
        end(session);
    }
}

static void json_signals(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh *const host = hh_host();
    bool first = true;
    for (size_t i = 0; i < host->signals.shown.count; i++) {
        const struct hh_signal *const signal = host->signals.shown.items[i];
        if (!hal_filter_name(filter, signal->names.name, signal->type))
            continue;
        begin(session, &first, signal->names.name, NULL);
        member(session, "type", hh_type_name(signal->type));
        value_member(session, hh_load(signal->type, signal->value));
        hal_print(session, ", \"pins\": [");
        const char *separator = "";
        for (size_t p = 0; p < host->pins.shown.count; p++) {
            const struct hh_pin *const pin = host->pins.shown.items[p];
            if (pin->signal != signal)
                continue;
            hal_print(session, "%s", separator);
            print_text(session, hh_shown_name(pin));
            separator = ", ";
        }
        hal_print(session, "]");
        end(session);
    }
}

static void json_params(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh_list *const params = &hh_host()->params.shown;
    bool first = true;
    for (size_t i = 0; i < params->count; i++) {
        const struct hh_param *const param = params->items[i];
        if (!hal_filter_name(filter, hh_shown_name(param), param->type))
            continue;
        begin(session, &first, param->names.name, param->names.alias);
        member(session, "owner", param->comp->name);
        member(session, "type", hh_type_name(param->type));
        member(session, "dir", param->dir == HAL_RO ? "ro" : "rw");
        value_member(session, hh_load(param->type, param->value));
        end(session);
    }
}

static void json_functs(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh_list *const functs = &hh_host()->functs.shown;
    bool first = true;
    for (size_t i = 0; i < functs->count; i++) {
        const struct hh_funct *const funct = functs->items[i];
        if (!hal_filter_name(filter, funct->names.name, HAL_TYPE_UNSPECIFIED))
            continue;
        begin(session, &first, funct->names.name, NULL);
        member(session, "owner", funct->comp->name);
        hal_print(session, ", \"users\": %u", funct->users);
        end(session);
    }
}

static void json_histogram(struct hal_session *const session, const char *const name,
                           const struct histogram *const histogram)
{
    hal_print(session, ", \"%s\": {\"median_ns\": %" PRId64 ", \"p999_ns\": %" PRId64 ", \"max_ns\": %" PRId64 "}",
              name, histogram_quantile_ns(histogram, 0.5), histogram_quantile_ns(histogram, 0.999),
              histogram_max_ns(histogram));
}

static void json_threads(struct hal_session *const session, const struct hal_filter *const filter)
{
    const struct hh *const host = hh_host();
    bool first = true;
    for (size_t i = 0; i < host->threads.count; i++) {
        const struct hh_thread *const thread = host->threads.items[i];
        const struct hh_schedule *const schedule = atomic_load(&thread->schedule);
        if (!hal_filter_name(filter, thread->names.name, HAL_TYPE_UNSPECIFIED))
            continue;
        begin(session, &first, thread->names.name, NULL);
        hal_print(session, ", \"period_ns\": %ld, \"realtime\": %s, \"cycles\": %" PRIu64, thread->period_ns,
                  thread->realtime ? "true" : "false", atomic_load(&thread->cycles));
        hal_print(session, ", \"overruns\": %" PRIu64 ", \"missed\": %" PRIu64, atomic_load(&thread->overruns),
                  atomic_load(&thread->missed));
        json_histogram(session, "busy", &thread->busy);
        json_histogram(session, "latency", &thread->latency);
        json_histogram(session, "interval", &thread->interval);
        hal_print(session, ", \"functions\": [");
        for (size_t f = 0; schedule && f < schedule->count; f++) {
            hal_print(session, "%s", f ? ", " : "");
            print_text(session, schedule->functs[f]->names.name);
        }
        hal_print(session, "]");
        end(session);
    }
}

void hal_show_json(struct hal_session *const session, const unsigned kinds, const struct hal_filter *const filter)
{
    static const struct {
        unsigned kinds;
        const char *key;
        void (*show)(struct hal_session *session, const struct hal_filter *filter);
    } parts[] = {
        {HAL_KIND_COMP, "components", json_comps},  {HAL_KIND_PIN | HAL_KIND_PIN_ALIAS, "pins", json_pins},
        {HAL_KIND_SIG, "signals", json_signals},    {HAL_KIND_PARAM | HAL_KIND_PARAM_ALIAS, "parameters", json_params},
        {HAL_KIND_FUNCT, "functions", json_functs}, {HAL_KIND_THREAD, "threads", json_threads},
    };
    const char *separator = "{";
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++) {
        if (!(kinds & parts[i].kinds))
            continue;
        hal_print(session, "%s\n  \"%s\": [", separator, parts[i].key);
        parts[i].show(session, filter);
        hal_print(session, "\n  ]");
        separator = ",";
    }
    hal_print(session, "\n}\n");
}
