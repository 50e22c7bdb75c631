/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Load time: who is behind a port (hal-interface 4.3, seed 003 "DISCOVERY SEQUENCE").
 *
 * A START in normal mode comes first: it gives up on an empty channel after some milliseconds and clears faults, while
 * a START in set-up mode waits for it (traces). The channels that answered are then discovered in set-up mode.
 */
#include <stdio.h>
#include <stdlib.h>

#include "sserial.h"

#define BAUD_FLASH 115200 /* remotes with their set-up jumper: for programming, no points are made */

static bool is_wanted(const struct hm2_setup *const setup, const unsigned port, const unsigned channel)
{
    return port < HM2_CFG_SSERIAL_PORTS && channel < setup->config->sserial_named[port] &&
           setup->config->sserial_mode[port][channel] != 'x';
}

unsigned sserial_mode(const struct hm2_setup *const setup, const unsigned port, const unsigned channel)
{
    const char mode = port < HM2_CFG_SSERIAL_PORTS ? setup->config->sserial_mode[port][channel] : '0';
    return mode >= '0' && mode <= '9' ? (unsigned)(mode - '0') : 0;
}

/* A remote that the configuration names is missing. A digit other than 0 can only be meant for a remote that is there;
 * 0 also stands in configurations for channels that may be empty, as LinuxCNC accepts them. */
static int tell_missing(const struct hm2_setup *const setup, const struct sslbp_port *const access, const unsigned port,
                        const unsigned channel, const char *const why)
{
    uint32_t cs = 0;
    char seen[192] = "";
    if (!is_wanted(setup, port, channel))
        return 0;
    if (sslbp_port_cs(access, channel, &cs) == 0) {
        const struct sslbp_status status = sslbp_status(cs, access->minor, false);
        (void)sslbp_status_text(&status, seen, sizeof seen);
    }
    const unsigned mode = sserial_mode(setup, port, channel);
    static const char format[] = "%s, channel %u: config sserial_port_%u expects a remote in mode %u, %s (%s; CS "
                                 "register 0x%08X); check its power, cable and jumpers, or give the channel an x%s";
    if (mode == 0) {
        hm2_diag_warn(setup->diag, format, access->name, channel, port, mode, why, seen, (unsigned)cs,
                      ". Its pins are GPIO");
        return 0;
    }
    return hm2_diag_add(setup->diag, HM2_ERR_NOTFOUND, format, access->name, channel, port, mode, why, seen,
                        (unsigned)cs, "");
}

static int tell_all_missing(const struct hm2_setup *const setup, const struct sslbp_port *const access,
                            const unsigned port, const unsigned channels, const char *const why)
{
    int err = 0;
    for (unsigned channel = 0; channel < SSLBP_CHANNELS; channel++) {
        const int bad = channels >> channel & 1u ? tell_missing(setup, access, port, channel, why) : 0;
        err = bad < 0 ? bad : err;
    }
    return err;
}

/* Channels that did not start because nobody is there; a remote with a fault that cannot be cleared is one. */
static int find_absent(const struct sslbp_port *const access, const unsigned failed, unsigned *const absent)
{
    *absent = 0;
    for (unsigned channel = 0; channel < SSLBP_CHANNELS; channel++) {
        uint32_t cs = 0;
        const int err = failed >> channel & 1u ? sslbp_port_cs(access, channel, &cs) : 0;
        if (err < 0)
            return err;
        if ((failed >> channel & 1u) && (sslbp_status(cs, access->minor, false).status & SSLBP_NO_REMOTE))
            *absent |= 1u << channel;
    }
    return 0;
}

static void name_remote(const struct hm2_setup *const setup, const unsigned port, const unsigned channel,
                        const struct sslbp_identity *const identity, char prefix[HM2_NAME_SIZE])
{
    char card[5];
    sslbp_card_name(identity, card);
    if (setup->config->use_serial_numbers)
        (void)snprintf(prefix, HM2_NAME_SIZE, "hm2_%s.%04x", card, (unsigned)(identity->unit & 0xFFFFu));
    else
        (void)snprintf(prefix, HM2_NAME_SIZE, "%s.%s.%u.%u", setup->prefix, card, port, channel);
}

static int discover_one(const struct hm2_setup *const setup, const struct sslbp_port *const access, const unsigned port,
                        const unsigned channel, struct sserial_found *const found)
{
    struct sslbp_identity *const identity = &found->identity[channel];
    int err = sslbp_identify(access, channel, identity);
    if (err < 0)
        return hm2_diag_add(setup->diag, err, "%s, channel %u: its interface registers cannot be read (%s)",
                            access->name, channel, hm2_strerror(err));
    if (identity->ptoc == 0)
        return tell_missing(setup, access, port, channel, "the remote that answers has no table of its process data");
    name_remote(setup, port, channel, identity, found->prefix[channel]);
    found->tables[channel] = calloc(1, sizeof *found->tables[channel]);
    if (!found->tables[channel])
        return hm2_diag_add(setup->diag, HM2_ERR_NOMEM, "%s: no memory for the tables of a remote", access->name);
    err = sslbp_discover(access, channel, identity, found->prefix[channel], found->tables[channel]);
    if (err == 0)
        found->mask |= 1u << channel;
    return err;
}

static int discover(const struct hm2_setup *const setup, const struct sslbp_port *const access, const unsigned port,
                    const unsigned there, const uint8_t *const modes, struct sserial_found *const found)
{
    unsigned failed = 0;
    int err = sslbp_port_start(access, there, true, modes, &failed);
    if (err == 0 && failed)
        err = tell_all_missing(setup, access, port, failed, "a remote answers and does not enter set-up mode");
    for (unsigned channel = 0; err == 0 && channel < SSLBP_CHANNELS; channel++)
        if ((there & ~failed) >> channel & 1u)
            err = discover_one(setup, access, port, channel, found);
    return err;
}

/* A port that does not speak SSLBP is left alone, and its pins are GPIO. */
static int open_port(const struct hm2_setup *const setup, const unsigned port, struct sslbp_port *const access)
{
    struct hm2_diag diag = {0};
    access->diag = &diag;
    const int err = sslbp_port_open(access);
    access->diag = setup->diag;
    const bool wanted = port < HM2_CFG_SSERIAL_PORTS && setup->config->sserial_port_used[port];
    if (err < 0 && wanted)
        hm2_diag_warn(setup->diag, "%s", diag.text);
    return err;
}

int sserial_find(const struct hm2_module *const module, struct hm2_setup *const setup, const unsigned port,
                 unsigned channels, struct sslbp_port *const access, struct sserial_found *const found)
{
    uint8_t modes[SSLBP_CHANNELS];
    unsigned failed = 0, absent = 0;
    access->diag = setup->diag;
    sslbp_port_place(access, module->md, port);
    for (unsigned channel = 0; channel < SSLBP_CHANNELS; channel++)
        modes[channel] = (uint8_t)sserial_mode(setup, port, channel);
    int err = open_port(setup, port, access);
    if (err < 0)
        return err == HM2_ERR_MISMATCH || err == HM2_ERR_TIMEOUT ? 0 : err;
    const unsigned beyond = channels & ~((1u << access->channels) - 1u);
    channels &= ~beyond;
    err = tell_all_missing(setup, access, port, beyond, "which is beyond the channels of the port's firmware");
    if (err == 0 && setup->config->sserial_baudrate > 0)
        err = sslbp_port_baud(access, (uint32_t)setup->config->sserial_baudrate);
    if (err == 0)
        err = sslbp_port_start(access, channels, false, modes, &failed);
    if (err == 0)
        err = find_absent(access, failed, &absent);
    if (err == 0)
        err = tell_all_missing(setup, access, port, absent, "none found");
    const unsigned there = channels & ~absent;
    if (err == 0 && there && setup->config->sserial_baudrate != BAUD_FLASH)
        err = discover(setup, access, port, there, modes, found);
    return err;
}

void sserial_forget(struct sserial_found *const found)
{
    for (unsigned channel = 0; channel < SSLBP_CHANNELS; channel++)
        free(found->tables[channel]);
}
