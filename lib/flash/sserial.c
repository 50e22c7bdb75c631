/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Who is at the smart-serial ports: set-up through the command and data registers (flash tool reference 3.18). The pins
 * are given to the ports for as long as it takes, everything else is left as it is.
 */
#include "card.h"

enum { REG_COMMAND, REG_DATA, REG_CHANNEL_STATUS, REG_INTERFACE_0, REG_INTERFACE_1 };
enum { PORT_DDR = 1, PORT_ALTERNATE = 2 };
enum { LOCAL_TYPE, LOCAL_WIDTH, LOCAL_MAJOR, LOCAL_MINOR, LOCAL_START, LOCAL_STRIDE, LOCAL_PROCESSOR, LOCAL_CHANNELS };

#define COMMAND_RESET 0x4800u
#define COMMAND_STOP  0x0800u
#define COMMAND_SETUP 0x0F00u
#define COMMAND_LOCAL 0x2000u
#define BAUD_OFFSET   42u
#define PORT_BYTES    0x40u
#define CHANNEL_BYTES 4u
#define DONE_NS       INT64_C(300000000)
#define POLL_NS       INT64_C(1000000)
#define MOST_PORTS    8u

struct port {
    struct flash_card *card;
    uint16_t base;
};

static uint16_t address(const struct port *const port, const unsigned reg, const unsigned channel)
{
    return (uint16_t)(port->base + 0x100u * reg + CHANNEL_BYTES * channel);
}

static int command(const struct port *const port, const uint32_t word, struct hm2_diag *const diag)
{
    struct link *const link = port->card->port.link;
    const int64_t end_ns = link_now_ns(link) + DONE_NS;
    uint32_t left = 1;
    int err = flash_card_write_hm2(port->card, address(port, REG_COMMAND, 0), 1, &word, diag);
    while (err == 0) {
        err = flash_card_read_hm2(port->card, address(port, REG_COMMAND, 0), 1, &left, diag);
        if (err < 0 || left == 0)
            return err;
        if (link_now_ns(link) > end_ns)
            return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                                "the smart-serial port at 0x%04X does not carry out command 0x%04X", port->base,
                                (unsigned)word);
        flash_port_wait(&port->card->port, POLL_NS);
    }
    return err;
}

static int local(const struct port *const port, const unsigned at, uint8_t *const value, struct hm2_diag *const diag)
{
    uint32_t word = 0;
    int err = command(port, COMMAND_LOCAL + at, diag);
    if (err == 0)
        err = flash_card_read_hm2(port->card, address(port, REG_DATA, 0), 1, &word, diag);
    *value = (uint8_t)word;
    return err;
}

static int describe_port(const struct port *const port, struct flash_sserial *const out, struct hm2_diag *const diag)
{
    uint8_t bytes[LOCAL_CHANNELS + 1] = {0};
    int err = command(port, COMMAND_RESET, diag);
    if (err == 0)
        err = command(port, COMMAND_STOP, diag);
    for (unsigned i = 0; i <= LOCAL_CHANNELS && err == 0; i++)
        err = local(port, i, &bytes[i], diag);
    out->type = bytes[LOCAL_TYPE];
    out->width = bytes[LOCAL_WIDTH];
    out->major = bytes[LOCAL_MAJOR];
    out->minor = bytes[LOCAL_MINOR];
    out->processor = bytes[LOCAL_PROCESSOR];
    out->channels = bytes[LOCAL_CHANNELS] < FLASH_SSERIAL_CHANNELS ? bytes[LOCAL_CHANNELS] : FLASH_SSERIAL_CHANNELS;
    for (unsigned i = 0; i < 4 && err == 0; i++) {
        uint8_t byte;
        err = local(port, bytes[LOCAL_START] + BAUD_OFFSET + i, &byte, diag);
        out->baud |= err == 0 ? (uint32_t)byte << 8 * i : 0;
    }
    return err;
}

static int describe_remote(const struct port *const port, const unsigned channel, struct flash_sserial *const out,
                           struct hm2_diag *const diag)
{
    const uint32_t normal = 0;
    uint32_t failed = 1, words[2] = {0, 0};
    int err = flash_card_write_hm2(port->card, address(port, REG_CHANNEL_STATUS, channel), 1, &normal, diag);
    if (err == 0)
        err = command(port, COMMAND_SETUP | 1u << channel, diag);
    if (err == 0)
        err = flash_card_read_hm2(port->card, address(port, REG_DATA, 0), 1, &failed, diag);
    if (err < 0 || failed)
        return err;
    for (unsigned i = 0; i < 2 && err == 0; i++)
        err = flash_card_read_hm2(port->card, address(port, REG_INTERFACE_0 + i, channel), 1, &words[i], diag);
    out->present[channel] = err == 0;
    out->unit[channel] = words[0];
    for (unsigned i = 0; i < 4; i++) {
        const char c = (char)(words[1] >> 8 * i);
        out->name[channel][i] = c;
        if (c && (c < ' ' || c > '~'))
            out->name[channel][i] = '?';
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

int flash_card_sserial(struct flash_card *const card, const unsigned index, struct flash_sserial *const out,
                       struct hm2_diag *const diag)
{
    struct hm2_idrom rom;
    struct hm2_diag ignored = {0};
    struct pins pins = {0};
    *out = (struct flash_sserial){0};
    if (card->info.cookie != HM2_COOKIE || hm2_idrom_parse(&card->info.image, NULL, &rom, &ignored) != 0)
        return HM2_ERR_NOTFOUND;
    const struct hm2_md *md = hm2_idrom_find(&rom, HM2_GTAG_SSERIAL);
    if (!md)
        md = hm2_idrom_find(&rom, HM2_GTAG_SSERIALB);
    if (!md || index >= md->instances)
        return HM2_ERR_NOTFOUND;
    const struct port port = {card, (uint16_t)(md->base + PORT_BYTES * index)};
    int err = lend_pins(card, &rom, md->gtag, &pins, diag);
    if (err == 0)
        err = describe_port(&port, out, diag);
    for (unsigned i = 0; i < out->channels && err == 0; i++)
        err = describe_remote(&port, i, out, diag);
    const int back = return_pins(card, &pins, diag);
    return err < 0 ? err : back;
}
