/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What is plugged into smart-serial ports, and what is done to it. */
#include <string.h>

#include "sserial_state.h"

#define COUNT(array) (sizeof(array) / sizeof(array)[0])

/* Daughter cards of more than one processor: these, channel by channel (register map 5.5). */
static const struct {
    const char *name;
    const char *remotes[2];
} cards[] = {
    {"7i77", {"7i77-field", "7i77-analog"}},
    {"7i77d", {"7i77d-field", "7i77-analog"}},
};

static const char *const card_names[] = {"7i69", "7i70",  "7i71", "7i72",  "7i73", "7i76",
                                         "7i77", "7i77d", "7i84", "7i84d", "7i90", NULL};

const char *const *sim_sserial_cards(void)
{
    return card_names;
}

struct sim_module *sserial_module(struct sim_card *const card, unsigned *const port)
{
    static const uint8_t tags[] = {HM2_GTAG_SSERIAL, HM2_GTAG_SSERIALB};
    for (size_t i = 0; i < COUNT(tags); i++) {
        struct sim_module *const m = sim_find(card, tags[i]);
        const struct sserial *const s = m ? m->state : NULL;
        if (s && *port < s->count)
            return m;
        *port -= s ? s->count : 0;
    }
    return NULL;
}

static struct sserial_channel *channel_of(struct sim_card *const card, unsigned port, const unsigned channel)
{
    struct sim_module *const m = sserial_module(card, &port);
    if (!m)
        return NULL;
    struct sserial_port *const p = &((struct sserial *)m->state)->ports[port];
    if (channel >= p->channel_count)
        return NULL;
    sserial_turn(m, m->clk); /* the caller may be about to change something */
    return &p->channels[channel];
}

static int plug_one(struct sim_card *const card, const unsigned port, const unsigned channel, const char *const name,
                    const uint32_t serial, struct hm2_diag *const diag)
{
    struct sserial_channel *const c = channel_of(card, port, channel);
    if (!c)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "this card's firmware has no smart-serial port %u channel %u", port,
                            channel);
    if (c->remote)
        return hm2_diag_add(diag, HM2_ERR_STATE, "smart-serial port %u channel %u has a remote already", port, channel);
    return remote_new(&c->remote, name, serial, diag);
}

int sim_sserial_plug(struct sim_card *const card, const unsigned port, const unsigned channel, const char *const name,
                     const uint32_t serial, struct hm2_diag *const diag)
{
    for (size_t i = 0; i < COUNT(cards); i++) {
        if (strcmp(cards[i].name, name) != 0)
            continue;
        int err = 0;
        for (unsigned k = 0; k < COUNT(cards[i].remotes) && !err; k++)
            err = plug_one(card, port, channel + k, cards[i].remotes[k], serial, diag);
        return err;
    }
    return plug_one(card, port, channel, name, serial, diag);
}

struct remote *sim_sserial_remote(struct sim_card *const card, const unsigned port, const unsigned channel)
{
    const struct sserial_channel *const c = channel_of(card, port, channel);
    return c ? c->remote : NULL;
}

static struct sserial_channel *plugged(struct sim_card *const card, const unsigned port, const unsigned channel)
{
    struct sserial_channel *const c = channel_of(card, port, channel);
    return c && c->remote ? c : NULL;
}

int sim_sserial_cable(struct sim_card *const card, const unsigned port, const unsigned channel,
                      const enum sim_cable cable)
{
    struct sserial_channel *const c = plugged(card, port, channel); /* advanced: kept alive until now */
    if (!c)
        return HM2_ERR_NOTFOUND;
    c->cable = cable;
    return 0;
}

int sim_sserial_power_cycle(struct sim_card *const card, const unsigned port, const unsigned channel)
{
    const struct sserial_channel *const c = plugged(card, port, channel);
    if (!c)
        return HM2_ERR_NOTFOUND;
    unsigned instance = port;
    const struct sim_module *const m = sserial_module(card, &instance);
    remote_power_up(c->remote, sserial_ns(m, m->clk));
    return 0;
}

int sim_sserial_error(struct sim_card *const card, const unsigned port, const unsigned channel, const char *const error,
                      const unsigned count)
{
    static const char *const names[SSERIAL_ERRORS] = {"crc", "cookie", "overrun", "timeout", "extra", "break"};
    struct sserial_channel *const c = plugged(card, port, channel);
    if (!c)
        return HM2_ERR_NOTFOUND;
    for (unsigned i = 0; i < SSERIAL_ERRORS; i++) {
        if (strcmp(names[i], error) != 0)
            continue;
        c->ordered[i] = count;
        return 0;
    }
    return HM2_ERR_INVALID;
}
