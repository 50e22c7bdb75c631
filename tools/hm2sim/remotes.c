/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "remotes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sserial.h"

#define LABEL_STEP 0x100u /* from one card's label to the next */

int remotes_connect(struct sim_card *const card, const struct card_options *const options, const uint64_t seed,
                    struct hm2_diag *const diag)
{
    for (unsigned i = 0; i < options->remote_count; i++) {
        const struct remote_option *const o = &options->remotes[i];
        const uint32_t serial = (uint32_t)(seed + 1) * LABEL_STEP + i;
        const int err = sim_sserial_plug(card, o->port, o->channel, o->card, serial, diag);
        if (err)
            return err;
    }
    return 0;
}

/* ---- commands -----------------------------------------------------------------------------------------------------
 */

struct order {
    struct sim_card *card;
    unsigned port, channel;
    struct remote *remote;
    const char *const *arguments;
    char *reply;
    size_t size;
};

static bool number(const char *const text, double *const value)
{
    char *end;
    *value = strtod(text, &end); /* takes hexadecimal, too */
    return end != text && *end == '\0';
}

static bool whole(const char *const text, const double max, unsigned long *const value)
{
    double real;
    if (!number(text, &real) || !(real >= 0) || real > max)
        return false;
    *value = (unsigned long)real;
    return (double)*value == real;
}

static bool do_set(const struct order *const o)
{
    double value;
    return number(o->arguments[1], &value) && remote_set(o->remote, o->arguments[0], value) == 0;
}

static bool do_get(const struct order *const o)
{
    double value;
    if (remote_get(o->remote, o->arguments[0], &value))
        return false;
    snprintf(o->reply, o->size, "%.12g", value);
    return true;
}

static bool do_terminal(const struct order *const o)
{
    static const char *const levels[] = {[SIM_LOW] = "0", [SIM_HIGH] = "1", [SIM_FLOAT] = "z", [SIM_PULLUP] = "h"};
    unsigned long output;
    if (!whole(o->arguments[0], UINT8_MAX, &output))
        return false;
    snprintf(o->reply, o->size, "%s", levels[remote_terminal(o->remote, (unsigned)output)]);
    return true;
}

static bool do_pull(const struct order *const o)
{
    return sim_sserial_cable(o->card, o->port, o->channel, SIM_CABLE_OUT) == 0;
}

static bool do_plug(const struct order *const o)
{
    return sim_sserial_cable(o->card, o->port, o->channel, SIM_CABLE_IN) == 0;
}

static bool do_power_cycle(const struct order *const o)
{
    return sim_sserial_power_cycle(o->card, o->port, o->channel) == 0;
}

static bool do_error(const struct order *const o)
{
    unsigned long count;
    return whole(o->arguments[1], 1e9, &count) &&
           sim_sserial_error(o->card, o->port, o->channel, o->arguments[0], (unsigned)count) == 0;
}

static bool do_short(const struct order *const o)
{
    unsigned long outputs;
    if (!whole(o->arguments[0], UINT32_MAX, &outputs))
        return false;
    remote_short(o->remote, (uint32_t)outputs);
    return true;
}

static bool do_fault(const struct order *const o)
{
    unsigned long faults;
    if (!whole(o->arguments[0], UINT8_MAX, &faults))
        return false;
    remote_hold_faults(o->remote, (uint8_t)faults);
    return true;
}

static bool do_jumper(const struct order *const o)
{
    const bool setup = strcmp(o->arguments[0], "setup") == 0;
    remote_set_jumper(o->remote, setup);
    return setup || strcmp(o->arguments[0], "operate") == 0;
}

static const struct {
    const char *name;
    unsigned arguments;
    bool (*run)(const struct order *order);
} verbs[] = {
    {"set", 2, do_set},     {"get", 1, do_get},       {"terminal", 1, do_terminal},       {"pull", 0, do_pull},
    {"plug", 0, do_plug},   {"error", 2, do_error},   {"power-cycle", 0, do_power_cycle}, {"short", 1, do_short},
    {"fault", 1, do_fault}, {"jumper", 1, do_jumper},
};

/* "PORT:CHANNEL" */
static bool find_remote(struct order *const o, const char *const where)
{
    char *end;
    const unsigned long port = strtoul(where, &end, 10);
    if (end == where || *end != ':')
        return false;
    const char *const behind = end + 1;
    const unsigned long channel = strtoul(behind, &end, 10);
    if (end == behind || *end != '\0' || port > UINT8_MAX || channel > UINT8_MAX)
        return false;
    o->port = (unsigned)port;
    o->channel = (unsigned)channel;
    o->remote = sim_sserial_remote(o->card, o->port, o->channel);
    return o->remote != NULL;
}

void remotes_command(struct sim_card *const card, const char *const *const words, const unsigned count,
                     char *const reply, const size_t size)
{
    struct order o = {.card = card, .arguments = words + 2, .reply = reply, .size = size};
    if (count < 2 || !find_remote(&o, words[0])) {
        snprintf(reply, size, "error: remote PORT:CHANNEL of a remote that is there");
        return;
    }
    for (size_t i = 0; i < sizeof verbs / sizeof verbs[0]; i++) {
        if (strcmp(words[1], verbs[i].name) != 0 || count != 2 + verbs[i].arguments)
            continue;
        if (!verbs[i].run(&o))
            snprintf(reply, size, "error: %s: no such field, or not a value for it", words[1]);
        return;
    }
    snprintf(reply, size,
             "error: remote PORT:CHANNEL set FIELD VALUE, get FIELD, terminal OUTPUT, pull, plug, power-cycle, "
             "error crc|cookie|overrun|timeout|extra|break COUNT, short OUTPUTS, fault BITS, jumper setup|operate");
}
