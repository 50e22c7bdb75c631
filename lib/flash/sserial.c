/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Who is at the smart-serial ports (flash tool reference 3.18). The pins are given to the ports for as long as it
 * takes, everything else is left as it is.
 */
#include <hm2/lbp.h>

#include "card.h"

enum { PORT_DDR = 1, PORT_ALTERNATE = 2 };

#define LOCAL_FACTS 8u
#define LOCAL_CLOCK 0x230u
#define BAUD_OFFSET 42u
#define WIDEST      64u
#define MOST_PORTS  8u

static int bus_read(void *const access, const uint16_t address, const unsigned words, uint32_t *const values)
{
    struct hm2_diag ignored = {0};
    return flash_card_read_hm2(access, address, words, values, &ignored);
}

static int bus_write(void *const access, const uint16_t address, const unsigned words, const uint32_t *const values)
{
    struct hm2_diag ignored = {0};
    return flash_card_write_hm2(access, address, words, values, &ignored);
}

static int64_t bus_now_ns(void *const access)
{
    const struct flash_card *const card = access;
    return link_now_ns(card->port.link);
}

static int local_word(const struct sslbp_port *const port, const unsigned at, uint32_t *const value)
{
    int err = 0;
    *value = 0;
    for (unsigned i = 0; i < 4 && err == 0; i++) {
        uint8_t byte = 0;
        err = sslbp_local_read(port, (uint16_t)(at + i), &byte);
        *value |= (uint32_t)byte << 8 * i;
    }
    return err;
}

static int describe_port(const struct sslbp_port *const port, struct flash_sserial *const out)
{
    uint8_t *const facts[LOCAL_FACTS] = {&out->type,  &out->width,  &out->major,     &out->minor,
                                         &out->first, &out->stride, &out->processor, &out->channels};
    int err = 0;
    for (unsigned i = 0; i < LOCAL_FACTS && err == 0; i++)
        err = sslbp_local_read(port, (uint16_t)i, facts[i]);
    if (err == 0)
        err = local_word(port, out->first + BAUD_OFFSET, &out->baud);
    return err == 0 ? local_word(port, LOCAL_CLOCK, &out->clock_hz) : err;
}

/* ---- remotes ---------------------------------------------------------------------------------------------------- */

static int read_value(const struct sslbp_port *const port, struct flash_remote *const remote, const unsigned index)
{
    const struct sslbp_field *const field = &remote->tables.global[index];
    const bool guarded = sslbp_is_nonvolatile(field);
    int err = 0;
    if (field->bits == 0 || field->bits > WIDEST)
        return 0;
    if (guarded)
        err = sslbp_select_memory(port, remote->channel, LBP_MEMORY_EEPROM);
    if (err == 0)
        err =
            sslbp_remote_read(port, remote->channel, field->address, sslbp_field_bytes(field), &remote->values[index]);
    remote->known[index] = err == 0;
    const int closed = guarded ? sslbp_select_memory(port, remote->channel, LBP_MEMORY_WORKING) : 0;
    return err < 0 ? err : closed;
}

static int describe_remote(const struct sslbp_port *const port, struct flash_remote *const remote)
{
    const uint8_t modes[SSLBP_CHANNELS] = {0};
    struct sslbp_identity identity = {0};
    unsigned failed = 0;
    int err = sslbp_port_start(port, 1u << remote->channel, true, modes, &failed);
    if (err == 0 && failed)
        err = hm2_diag_add(port->diag, HM2_ERR_IO, "%s, channel %u: the remote does not enter set-up mode", port->name,
                           remote->channel);
    if (err == 0)
        err = sslbp_identify(port, remote->channel, &identity);
    if (err < 0)
        return err;
    remote->unit = identity.unit;
    for (unsigned i = 0; i < 4; i++) {
        const char c = (char)(identity.name >> 8 * i);
        remote->name[i] = c;
        if (c && (c < ' ' || c > '~'))
            remote->name[i] = '?';
    }
    err = sslbp_list(port, remote->channel, &identity, remote->name, &remote->tables);
    for (unsigned i = 0; i < remote->tables.global_count && err == 0; i++)
        err = read_value(port, remote, i);
    return err;
}

/* A set-up START waits for ever on an empty channel (traces): a normal one, which gives up, tells who is there. */
static int ask_remotes(const struct sslbp_port *const port, const struct flash_sserial *const facts,
                       const flash_sserial_fn each, void *const context)
{
    const uint8_t modes[SSLBP_CHANNELS] = {0};
    const unsigned all = (1u << port->channels) - 1u;
    unsigned failed = 0;
    int err = sslbp_port_start(port, all, false, modes, &failed);
    for (unsigned channel = 0; channel < port->channels && err == 0; channel++) {
        if (failed >> channel & 1u)
            continue;
        struct flash_remote remote = {.channel = channel};
        err = describe_remote(port, &remote);
        if (err == 0)
            each(context, facts, &remote);
    }
    return err;
}

/* ---- pins ------------------------------------------------------------------------------------------------------- */

struct pins {
    unsigned ports;
    uint16_t ddr_at[MOST_PORTS], alternate_at[MOST_PORTS];
    uint32_t ddr[MOST_PORTS], alternate[MOST_PORTS];
};

static void wanted_pins(const struct hm2_idrom *const rom, const uint8_t tag, const unsigned port, uint32_t *const ddr,
                        uint32_t *const alternate)
{
    for (unsigned pin = 0; pin < rom->port_width && port * rom->port_width + pin < rom->pin_count; pin++) {
        const struct hm2_pd *const pd = &rom->pins[port * rom->port_width + pin];
        if (pd->secondary_tag != tag)
            continue;
        *alternate |= 1u << pin % 32;
        if (pd->secondary_pin & HM2_PIN_OUTPUT)
            *ddr |= 1u << pin % 32;
    }
}

static int lend_pins(struct flash_card *const card, const struct hm2_idrom *const rom, const uint8_t tag,
                     struct pins *const pins, struct hm2_diag *const diag)
{
    const struct hm2_md *const md = hm2_idrom_find(rom, HM2_GTAG_IOPORT);
    int err = 0;
    for (unsigned i = 0; md && i < md->instances && i < MOST_PORTS && err == 0; i++) {
        pins->ddr_at[i] = hm2_md_address(md, PORT_DDR, i);
        pins->alternate_at[i] = hm2_md_address(md, PORT_ALTERNATE, i);
        err = flash_card_read_hm2(card, pins->ddr_at[i], 1, &pins->ddr[i], diag);
        if (err == 0)
            err = flash_card_read_hm2(card, pins->alternate_at[i], 1, &pins->alternate[i], diag);
        uint32_t ddr = pins->ddr[i], alternate = pins->alternate[i];
        wanted_pins(rom, tag, i, &ddr, &alternate);
        pins->ports = err == 0 ? i + 1 : pins->ports;
        if (err == 0)
            err = flash_card_write_hm2(card, pins->alternate_at[i], 1, &alternate, diag);
        if (err == 0)
            err = flash_card_write_hm2(card, pins->ddr_at[i], 1, &ddr, diag);
    }
    return err;
}

static int return_pins(struct flash_card *const card, const struct pins *const pins, struct hm2_diag *const diag)
{
    int err = 0;
    for (unsigned i = 0; i < pins->ports && err == 0; i++) {
        err = flash_card_write_hm2(card, pins->ddr_at[i], 1, &pins->ddr[i], diag);
        if (err == 0)
            err = flash_card_write_hm2(card, pins->alternate_at[i], 1, &pins->alternate[i], diag);
    }
    return err;
}

static int ask(struct sslbp_port *const port, const flash_sserial_fn each, void *const context)
{
    struct flash_sserial facts = {0};
    int err = sslbp_port_open(port);
    if (err < 0)
        return err;
    err = describe_port(port, &facts);
    if (err == 0) {
        each(context, &facts, NULL);
        err = ask_remotes(port, &facts, each, context);
    } else {
        err = hm2_diag_add(port->diag, err, "%s: its local parameters cannot be read", port->name);
    }
    const int stopped = sslbp_port_stop(port);
    return err < 0 ? err : stopped;
}

int flash_card_sserial(struct flash_card *const card, const unsigned index, const flash_sserial_fn each,
                       void *const context, struct hm2_diag *const diag)
{
    struct hm2_idrom rom;
    struct hm2_diag ignored = {0};
    struct pins pins = {0};
    if (card->info.cookie != HM2_COOKIE || hm2_idrom_parse(&card->info.image, NULL, &rom, &ignored) != 0)
        return HM2_ERR_NOTFOUND;
    const struct hm2_md *md = hm2_idrom_find(&rom, HM2_GTAG_SSERIAL);
    if (!md)
        md = hm2_idrom_find(&rom, HM2_GTAG_SSERIALB);
    if (!md || index >= md->instances)
        return HM2_ERR_NOTFOUND;
    struct sslbp_port port = {
        .bus = {card, bus_read, bus_write, bus_now_ns}, .name = "the card's smart-serial port", .diag = diag};
    sslbp_port_place(&port, md, index);
    int err = lend_pins(card, &rom, md->gtag, &pins, diag);
    if (err == 0)
        err = ask(&port, each, context);
    const int back = return_pins(card, &pins, diag);
    return err < 0 ? err : back;
}
