/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Which messages of a DBC file are ours. */
#include "can_private.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool hm2_can_sends(const struct hm2_dbc *const dbc, const struct hm2_dbc_message *const m, const int node)
{
    return node >= 0 && hm2_dbc_has(dbc, m->senders, (unsigned)node);
}

bool hm2_can_hears(const struct hm2_dbc *const dbc, const struct hm2_dbc_signal *const s, const int node)
{
    return node < 0 || hm2_dbc_has(dbc, s->receivers, (unsigned)node) ||
           hm2_dbc_has(dbc, s->receivers, HM2_DBC_ANYBODY);
}

/* A message without signals is for whoever looks at when it comes. */
static bool is_received(const struct hm2_dbc *const dbc, const struct hm2_dbc_message *const m, const int node)
{
    bool hears = m->signal_count == 0;
    for (uint32_t i = 0; i < m->signal_count; i++)
        hears = hears || hm2_can_hears(dbc, &dbc->signals[m->first_signal + i], node);
    return hears && !hm2_can_sends(dbc, m, node);
}

static bool is_whole(const double number)
{
    return fabs(number) <= 4294967296.0 && floor(number) >= number;
}

enum hm2_point_type hm2_can_type(const struct hm2_dbc_signal *const s, const bool floats)
{
    double low, high;
    const bool plain = s->scale >= 1.0 && s->scale <= 1.0 && s->offset >= 0.0 && s->offset <= 0.0;
    if (s->kind == HM2_DBC_UNSIGNED && s->bits == 1u && plain)
        return HM2_BIT;
    if (floats || s->kind == HM2_DBC_FLOAT32 || s->kind == HM2_DBC_FLOAT64 || !is_whole(s->scale) ||
        !is_whole(s->offset))
        return HM2_FLOAT;
    hm2_dbc_range(s, &low, &high);
    if (low >= 0.0 && high <= 4294967295.0)
        return HM2_U32;
    return low >= -2147483648.0 && high <= 2147483647.0 ? HM2_S32 : HM2_FLOAT;
}

static int by_key(const void *const a, const void *const b)
{
    const struct hm2_dbc_message *const m = ((const struct can_rx *)a)->base.message;
    const struct hm2_dbc_message *const n = ((const struct can_rx *)b)->base.message;
    const uint32_t left = can_key(m->id, m->extended), right = can_key(n->id, n->extended);
    return left < right ? -1 : left > right;
}

static unsigned depth_of(const struct hm2_dbc *const dbc, const struct hm2_dbc_signal *s)
{
    unsigned depth = 0;
    for (; s->multiplexor != HM2_DBC_NO_SIGNAL; depth++)
        s = &dbc->signals[s->multiplexor];
    return depth;
}

/* The pins of a message, multiplexors before what they select. */
static int choose_pins(const struct hm2_can *const can, struct can_message *const base,
                       const struct hm2_dbc_message *const m, const bool all)
{
    base->message = m;
    base->pins = calloc(m->signal_count + 1u, sizeof *base->pins);
    if (!base->pins)
        return HM2_ERR_NOMEM;
    for (unsigned depth = 0; depth <= HM2_DBC_MAX_MUX_DEPTH; depth++)
        for (uint32_t i = 0; i < m->signal_count; i++) {
            const struct hm2_dbc_signal *const s = &can->dbc->signals[m->first_signal + i];
            if (depth_of(can->dbc, s) != depth || !(all || hm2_can_hears(can->dbc, s, can->node)))
                continue;
            base->multiplexed = base->multiplexed || depth > 0u;
            base->pins[base->pin_count++].signal = s;
        }
    return 0;
}

static int choose_messages(struct hm2_can *const can)
{
    const struct hm2_dbc *const dbc = can->dbc;
    int err = 0;
    can->rx = calloc(dbc->message_count + 1u, sizeof *can->rx);
    can->tx = calloc(dbc->message_count + 1u, sizeof *can->tx);
    if (!can->rx || !can->tx)
        return HM2_ERR_NOMEM;
    for (uint32_t i = 0; !err && i < dbc->message_count; i++) {
        const struct hm2_dbc_message *const m = &dbc->messages[i];
        if (hm2_can_sends(dbc, m, can->node))
            err = choose_pins(can, &can->tx[can->tx_count++].base, m, true);
        else if (is_received(dbc, m, can->node))
            err = choose_pins(can, &can->rx[can->rx_count++].base, m, false);
    }
    qsort(can->rx, can->rx_count, sizeof *can->rx, by_key);
    return err;
}

static int find_node(struct hm2_can *const can, struct hm2_diag *const diag)
{
    const char *const node = can->options.node;
    can->node = -1;
    if (!node || !node[0])
        return 0;
    can->node = hm2_dbc_node(can->dbc, node);
    if (can->node >= 0 && can->node < (int)HM2_DBC_ANYBODY)
        return 0;
    char names[512] = "";
    for (uint32_t i = 0; i < can->dbc->node_count && strlen(names) + strlen(can->dbc->nodes[i]) + 3u < sizeof names;
         i++)
        (void)snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", i ? ", " : "", can->dbc->nodes[i]);
    return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "the file has no node \"%s\"; it has: %s", node, names);
}

int hm2_can_new(const struct hm2_dbc *const dbc, const struct hm2_can_options *const options,
                struct hm2_can **const result, struct hm2_diag *const diag)
{
    struct hm2_can *const can = calloc(1, sizeof *can);
    *result = NULL;
    if (!can)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for the messages");
    can->dbc = dbc;
    can->options = *options;
    (void)snprintf(can->prefix, sizeof can->prefix, "%s", options->prefix);
    int err = find_node(can, diag);
    if (!err) {
        err = choose_messages(can);
        if (err)
            (void)hm2_diag_add(diag, err, "no memory for the messages");
        else if (can->rx_count + can->tx_count == 0)
            err = hm2_diag_add(diag, HM2_ERR_NOTFOUND, "the file has no message for the node \"%s\" or from it",
                               options->node ? options->node : "");
    }
    can->options.node = can->options.prefix = NULL; /* the caller's */
    if (err)
        hm2_can_free(can);
    else
        *result = can;
    return err;
}

static void close_bus(struct hm2_can_bus *const bus)
{
    if (bus)
        bus->ops->close(bus);
}

void hm2_can_free(struct hm2_can *const can)
{
    if (!can)
        return;
    for (unsigned i = 0; can->rx && i < can->rx_count; i++)
        free(can->rx[i].base.pins);
    for (unsigned i = 0; can->tx && i < can->tx_count; i++)
        free(can->tx[i].base.pins);
    free(can->rx);
    free(can->tx);
    close_bus(can->bus);
    close_bus(atomic_load(&can->next_bus));
    close_bus(atomic_load(&can->old_bus));
    free(can);
}

void hm2_can_replace_bus(struct hm2_can *const can, struct hm2_can_bus *const bus)
{
    close_bus(atomic_exchange(&can->next_bus, bus)); /* one that no cycle has taken */
}

void hm2_can_close_old(struct hm2_can *const can)
{
    close_bus(atomic_exchange(&can->old_bus, NULL));
}

unsigned hm2_can_filters(const struct hm2_can *const can, struct hm2_can_filter *const filters, const unsigned max)
{
    for (unsigned i = 0; i < can->rx_count && i < max; i++)
        filters[i] = (struct hm2_can_filter){can->rx[i].base.message->id, can->rx[i].base.message->extended};
    return can->rx_count;
}

bool hm2_can_needs_fd(const struct hm2_can *const can)
{
    bool fd = false;
    for (unsigned i = 0; i < can->rx_count; i++)
        fd = fd || can->rx[i].base.message->fd;
    for (unsigned i = 0; i < can->tx_count; i++)
        fd = fd || can->tx[i].base.message->fd;
    return fd;
}
