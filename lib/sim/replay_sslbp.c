/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Folder sslbp: the remote at channel 0, what the notes between the events say was done to it, and when the command
 * register was still set. The recording has a poll of that register only where it changed.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "replay_trace.h"
#include "sserial.h"

#define DDR     0x1100u
#define ALTSRC  0x1200u
#define UNIT    0x345678u /* 12345678 without what the kind of remote adds */
#define PINS    72u
#define GROUP   24u /* pins of a connector */
#define SHIFT   2u  /* a port register is four bytes */
#define MARGIN  130 /* polls lie about 100 clocks apart, */
#define PORTION 20  /* those of long commands more: a twentieth of the time */

static bool has_remote(const struct replay_run *const run)
{
    return strstr(run->test->description, "remote on channel 0") != NULL;
}

/* The recorded bench had its remote at the module itself; here it is behind pins. */
static int route_pins(struct sim_card *const card)
{
    const struct hm2_idrom *const idrom = sim_card_idrom(card);
    for (unsigned port = 0; port < idrom->io_ports; port++) {
        uint32_t driven = 0;
        for (unsigned bit = 0; bit < idrom->port_width; bit++) {
            const struct hm2_pd *const pd = &idrom->pins[port * idrom->port_width + bit];
            if (pd->secondary_tag == HM2_GTAG_SSERIAL && (pd->secondary_pin & HM2_PIN_OUTPUT))
                driven |= UINT32_C(1) << bit;
        }
        sim_card_write(card, sim_card_clock(card), (uint16_t)(DDR + (port << SHIFT)), driven);
        sim_card_write(card, sim_card_clock(card), (uint16_t)(ALTSRC + (port << SHIFT)), driven);
    }
    return 0;
}

int replay_sslbp_prepare(struct replay_run *const run)
{
    struct hm2_diag diag = {0};
    return has_remote(run) ? sim_sserial_plug(run->card, 0, 0, "7i90", UNIT, &diag) : 0;
}

/* ---- notes --------------------------------------------------------------------------------------------------------
 */

/* "remote pins 0;5;24 pulled low from outside": a pin that is low reads as 1. */
static int pull_pins(struct replay_run *const run, const char *text)
{
    static const char *const groups[PINS / GROUP] = {"P1-In", "P2-In", "P3-In"};
    uint32_t low[PINS / GROUP] = {0};
    unsigned pin;
    for (const char *at = text; (at = replay_take_number(at, PINS - 1, &pin)); at++) {
        low[pin / GROUP] |= UINT32_C(1) << pin % GROUP;
        if (*at != ';')
            break;
    }
    struct remote *const remote = sim_sserial_remote(run->card, 0, 0);
    for (unsigned i = 0; i < PINS / GROUP && remote; i++)
        if (remote_set(remote, groups[i], low[i]))
            return HM2_ERR_NOTFOUND;
    return 0;
}

static int do_as_noted(struct replay_run *const run, const char *const note)
{
    static const char pins[] = "remote pins ";
    const char *const at = strstr(note, pins);
    if (at)
        return pull_pins(run, at + strlen(pins));
    if (strstr(note, "with line cut"))
        return sim_sserial_cable(run->card, 0, 0, SIM_CABLE_ONE_WAY);
    if (strcmp(note, "line repaired") == 0)
        return sim_sserial_cable(run->card, 0, 0, SIM_CABLE_IN);
    return 0;
}

/* Levels of the remote's pins, open drain with pull-ups: low where an output is on or the world pulls. */
static void compare_pins(struct replay_run *const run, const struct replay_event *const event)
{
    static const char *const groups[PINS / GROUP] = {"P1-In", "P2-In", "P3-In"};
    struct remote *const remote = sim_sserial_remote(run->card, 0, 0);
    for (unsigned i = 0; i < PINS && event->value[i]; i++) {
        double group = 0;
        if (!remote || remote_get(remote, groups[i / GROUP], &group))
            continue;
        const char level = (uint32_t)group >> i % GROUP & 1u ? '0' : 'H';
        if (level != event->value[i])
            replay_differs(run, "clk %lld: pin %u of the remote expected %c, got %c", (long long)event->at, i,
                           event->value[i], level);
    }
}

int replay_sslbp_event(struct replay_run *const run, const struct replay_event *const event)
{
    if (!run->state[0]) {
        run->state[0] = 1;
        return route_pins(run->card);
    }
    if (event->kind == 'J')
        compare_pins(run, event);
    return event->kind == '#' ? do_as_noted(run, event->value) : 0;
}

/* ---- polls that were not listed -----------------------------------------------------------------------------------
 */

/* When the register is found clear, it was still set not long before. */
int replay_sslbp_polls(const struct replay_trace *const trace, const struct replay_test *const test,
                       struct replay_event_list *const out)
{
    const struct replay_event *written = NULL;
    for (size_t i = test->first; i < test->first + test->count; i++) {
        const struct replay_event *const event = &trace->events[i];
        uint32_t value = 0;
        if (strcmp(event->name, "command") != 0 || replay_hex32(event->value, &value))
            continue;
        if (event->kind == 'W' && !(value >> 31))
            written = event;
        if (event->kind != 'R' || value != 0 || !written)
            continue;
        struct replay_event poll = *written;
        poll.kind = 'R';
        poll.at = event->at - (event->at - written->at) / PORTION - MARGIN;
        const int err = poll.at > written->at ? replay_event_add(out, &poll) : 0;
        if (err)
            return err;
        written = NULL;
    }
    return 0;
}
