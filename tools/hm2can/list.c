/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "list.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "../common/json_string.h"

static const char *const type_names[] = {
    [HM2_BIT] = "bit", [HM2_S32] = "s32", [HM2_U32] = "u32", [HM2_FLOAT] = "float"};
static const char *const kind_names[] = {[HM2_DBC_UNSIGNED] = "unsigned",
                                         [HM2_DBC_SIGNED] = "signed",
                                         [HM2_DBC_FLOAT32] = "float32",
                                         [HM2_DBC_FLOAT64] = "float64"};

/* What becomes of a message: it is sent, received, or left alone. */
static const char *use_of(const struct listing *const l, const struct hm2_dbc_message *const m)
{
    bool hears = m->signal_count == 0;
    for (uint32_t i = 0; i < m->signal_count; i++)
        hears = hears || hm2_can_hears(l->dbc, &l->dbc->signals[m->first_signal + i], l->node);
    return hm2_can_sends(l->dbc, m, l->node) ? "sent" : hears ? "received" : "not used";
}

static const char *pin_of(const struct listing *const l, const struct hm2_dbc_message *const m,
                          const struct hm2_dbc_signal *const s)
{
    const bool used = hm2_can_sends(l->dbc, m, l->node) || hm2_can_hears(l->dbc, s, l->node);
    return used ? type_names[hm2_can_type(s, l->floats)] : "none";
}

void list_summary(const struct listing *const l)
{
    unsigned fd = 0;
    for (uint32_t i = 0; i < l->dbc->message_count; i++)
        fd += l->dbc->messages[i].fd;
    printf("%s: %u nodes, %u messages (%u of CAN FD), %u signals\n", l->file, l->dbc->node_count, l->dbc->message_count,
           fd, l->dbc->signal_count);
}

/* ---- text
 * ------------------------------------------------------------------------------------------------------------ */

static void text_signal(const struct listing *const l, const struct hm2_dbc_message *const m,
                        const struct hm2_dbc_signal *const s)
{
    double low, high;
    hm2_dbc_range(s, &low, &high);
    printf("  %-24s %-5s  %s %u|%u %s, %.10g to %.10g", s->name, pin_of(l, m, s), s->big_endian ? "Motorola" : "Intel",
           s->start, s->bits, kind_names[s->kind], s->min < s->max ? s->min : low, s->min < s->max ? s->max : high);
    if (s->unit[0])
        printf(" %s", s->unit);
    if (s->is_multiplexor)
        fputs(", multiplexor", stdout);
    if (s->multiplexor != HM2_DBC_NO_SIGNAL) {
        printf(", if %s is", l->dbc->signals[s->multiplexor].name);
        for (uint32_t i = 0; i < s->mux_count; i++) {
            const struct hm2_dbc_mux *const mux = &l->dbc->mux[s->first_mux + i];
            printf("%s %" PRIu64, i ? " or" : "", mux->first);
            if (mux->last != mux->first)
                printf(" to %" PRIu64, mux->last);
        }
    }
    putchar('\n');
    for (uint32_t i = 0; i < s->values; i++)
        printf("    %" PRId64 " = %s\n", l->dbc->values[s->first_value + i].raw,
               l->dbc->values[s->first_value + i].text);
}

static void text_message(const struct listing *const l, const struct hm2_dbc_message *const m)
{
    printf("%s 0x%0*X, %u bytes%s, %s", m->name, m->extended ? 8 : 3, m->id, m->bytes, m->fd ? " (CAN FD)" : "",
           use_of(l, m));
    if (m->cycle_ms)
        printf(", every %u ms", m->cycle_ms);
    puts(m->on_change ? ", on change" : "");
    for (uint32_t i = 0; i < m->signal_count; i++)
        text_signal(l, m, &l->dbc->signals[m->first_signal + i]);
}

void list_text(const struct listing *const l)
{
    list_summary(l);
    fputs("Nodes:", stdout);
    for (uint32_t i = 0; i < l->dbc->node_count; i++)
        printf(" %s", l->dbc->nodes[i]);
    putchar('\n');
    for (uint32_t i = 0; i < l->dbc->message_count; i++)
        text_message(l, &l->dbc->messages[i]);
}

/* ---- JSON
 * ------------------------------------------------------------------------------------------------------------ */

static void json_member(const char *const name, const char *const text)
{
    printf(", \"%s\": ", name);
    json_string(stdout, text);
}

static void json_multiplexing(const struct listing *const l, const struct hm2_dbc_signal *const s)
{
    if (s->multiplexor == HM2_DBC_NO_SIGNAL)
        return;
    json_member("multiplexed_by", l->dbc->signals[s->multiplexor].name);
    fputs(", \"multiplexor_values\": [", stdout);
    for (uint32_t i = 0; i < s->mux_count; i++)
        printf("%s[%" PRIu64 ", %" PRIu64 "]", i ? ", " : "", l->dbc->mux[s->first_mux + i].first,
               l->dbc->mux[s->first_mux + i].last);
    putchar(']');
}

static void json_signal(const struct listing *const l, const struct hm2_dbc_message *const m,
                        const struct hm2_dbc_signal *const s)
{
    fputs("{\"name\": ", stdout);
    json_string(stdout, s->name);
    json_member("pin", pin_of(l, m, s));
    json_member("byte_order", s->big_endian ? "motorola" : "intel");
    json_member("kind", kind_names[s->kind]);
    json_member("unit", s->unit);
    printf(", \"start\": %u, \"bits\": %u, \"scale\": %.17g, \"offset\": %.17g, \"min\": %.17g, \"max\": %.17g",
           s->start, s->bits, s->scale, s->offset, s->min, s->max);
    printf(", \"multiplexor\": %s", s->is_multiplexor ? "true" : "false");
    json_multiplexing(l, s);
    fputs(", \"values\": {", stdout);
    for (uint32_t i = 0; i < s->values; i++) {
        printf("%s\"%" PRId64 "\": ", i ? ", " : "", l->dbc->values[s->first_value + i].raw);
        json_string(stdout, l->dbc->values[s->first_value + i].text);
    }
    fputs("}}", stdout);
}

static void json_message(const struct listing *const l, const struct hm2_dbc_message *const m)
{
    fputs("{\"name\": ", stdout);
    json_string(stdout, m->name);
    json_member("use", use_of(l, m));
    printf(", \"id\": %u, \"extended\": %s, \"fd\": %s, \"bytes\": %u, \"cycle_ms\": %u, \"on_change\": %s, "
           "\"signals\": [",
           m->id, m->extended ? "true" : "false", m->fd ? "true" : "false", m->bytes, m->cycle_ms,
           m->on_change ? "true" : "false");
    for (uint32_t i = 0; i < m->signal_count; i++) {
        fputs(i ? ",\n    " : "\n    ", stdout);
        json_signal(l, m, &l->dbc->signals[m->first_signal + i]);
    }
    fputs("]}", stdout);
}

void list_json(const struct listing *const l)
{
    fputs("{\"file\": ", stdout);
    json_string(stdout, l->file);
    printf(", \"good\": %s", l->dbc ? "true" : "false");
    json_member("sentences", l->diag->text);
    fputs(", \"nodes\": [", stdout);
    for (uint32_t i = 0; l->dbc && i < l->dbc->node_count; i++) {
        fputs(i ? ", " : "", stdout);
        json_string(stdout, l->dbc->nodes[i]);
    }
    fputs("], \"messages\": [", stdout);
    for (uint32_t i = 0; l->dbc && i < l->dbc->message_count; i++) {
        fputs(i ? ",\n  " : "\n  ", stdout);
        json_message(l, &l->dbc->messages[i]);
    }
    puts("]}");
}
