/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The HostMot2 configuration in mesaflash's formats, byte for byte: programs read them (flash tool reference 1.4.2 to
 * 1.4.4, 1.6). */
#include "names.h"

#include <stdio.h>

#include "cli.h"

#define DB25_WIDTH 17u
#define HZ_PER_MHZ 1e6
#define GLOBAL     0x80u

/* ---- shared
 * ----------------------------------------------------------------------------------------------------------- */

static struct hm2_idrom *idrom_of(struct cli *const cli)
{
    static struct hm2_idrom idrom;
    struct hm2_diag ignored = {0};
    /* An image with faults is printed as far as it could be decoded. */
    if (cli->info->cookie != HM2_COOKIE)
        say(cli, "ERROR: no HOSTMOT2 firmware found. %08X\n", (unsigned)cli->info->cookie);
    else if (hm2_idrom_parse(&cli->info->image, NULL, &idrom, &ignored) != 0 && ignored.len > 0)
        fprintf(stderr, "hm2flash: %s", ignored.text);
    return &idrom;
}

const struct hm2_terminals *terminals_of(const struct cli *const cli, const unsigned port, const char **const name)
{
    const struct flash_board *const board = cli->info->board;
    *name = port < CONNECTORS ? cli->dbnames[port] : NULL;
    if (!*name && board && port < 4)
        *name = board->terminals[port];
    return *name ? hm2_terminals_find(*name) : NULL;
}

const char *connector_of(const struct cli *const cli, const unsigned port)
{
    const struct flash_board *const board = cli->info->board;
    return board && port < board->io_ports ? board->connectors[port] : "P?";
}

static unsigned pin_number(const unsigned width, const unsigned pin, const unsigned io)
{
    if (width == DB25_WIDTH || width == 24)
        return hm2_connector_pin(width, pin);
    return width == 32 ? io : 0;
}

/* ---- text
 * ------------------------------------------------------------------------------------------------------------- */

static void print_header(const struct cli *const cli, const struct hm2_idrom *const rom)
{
    const uint32_t *const id = cli->info->image.id;
    char name[9] = "";
    for (unsigned i = 0; i < 8; i++)
        name[i] = (char)(id[1 + i / 4] >> 8 * (i % 4));
    printf("Configuration Name: %.8s\n\nGeneral configuration information:\n\n", name);
    printf("  BoardName : %.8s\n  FPGA Size: %u KGates\n  FPGA Pins: %u\n  Number of IO Ports: %u\n", rom->board_name,
           (unsigned)rom->fpga_size, (unsigned)rom->fpga_pins, (unsigned)rom->io_ports);
    printf("  Width of one I/O port: %u\n  Clock Low frequency: %.4f MHz\n  Clock High frequency: %.4f MHz\n",
           (unsigned)rom->port_width, rom->clock_low_hz / HZ_PER_MHZ, rom->clock_high_hz / HZ_PER_MHZ);
    printf("  IDROM Type: %u\n  Instance Stride 0: %u\n  Instance Stride 1: %u\n  Register Stride 0: %u\n"
           "  Register Stride 1: %u\n\n",
           (unsigned)rom->type, (unsigned)rom->instance_stride[0], (unsigned)rom->instance_stride[1],
           (unsigned)rom->register_stride[0], (unsigned)rom->register_stride[1]);
}

static void print_modules(const struct hm2_idrom *const rom)
{
    char buf[48];
    printf("Modules in configuration:\n\n");
    for (unsigned i = 0; i < rom->module_count; i++) {
        const struct hm2_md *const md = &rom->modules[i];
        const char *const name = tag_text(md->gtag, false, buf, sizeof buf);
        const uint32_t clock_hz = md->clock_tag == 1 ? rom->clock_low_hz : rom->clock_high_hz;
        printf("  Module: %s\n  There are %u of %s in configuration\n  Version: %u\n  Registers: %u\n"
               "  BaseAddress: %04X\n  ClockFrequency: %.3f MHz\n  Register Stride: %u bytes\n"
               "  Instance Stride: %u bytes\n\n",
               name, md->instances, name, md->version, md->registers, md->base, clock_hz / HZ_PER_MHZ,
               (unsigned)rom->register_stride[md->register_stride_selector ? 1 : 0],
               (unsigned)rom->instance_stride[md->instance_stride_selector ? 1 : 0]);
    }
}

static void print_pin(const struct hm2_idrom *const rom, const struct hm2_terminals *const terminals,
                      const unsigned pin, const unsigned io)
{
    const struct hm2_pd *const pd = &rom->pins[io];
    char buf[48];
    if (terminals)
        printf("%-18s", pin < terminals->count ? terminals->terminals[pin] : "");
    else
        printf("%2u                ", pin_number(rom->port_width, pin, io));
    printf("    %3u   %-8s", io, tag_text(pd->primary_tag, false, buf, sizeof buf));
    if (pd->secondary_tag == HM2_GTAG_NONE) {
        printf("     %-15s\n", "None");
        return;
    }
    printf("     %-15s", tag_text(pd->secondary_tag, false, buf, sizeof buf));
    if (pd->secondary_unit & GLOBAL)
        printf(" Global    ");
    else
        printf(" %2u        ", pd->secondary_unit);
    printf("%-12s    %s\n", pin_text(pd, false, buf, sizeof buf),
           pd->secondary_pin & HM2_PIN_OUTPUT ? "(Out)" : "(In)");
}

static void print_text(const struct cli *const cli, const struct hm2_idrom *const rom)
{
    print_header(cli, rom);
    print_modules(rom);
    printf("Configuration pin-out:\n");
    for (unsigned port = 0; port < rom->io_ports; port++) {
        const char *name;
        const struct hm2_terminals *const terminals = terminals_of(cli, port, &name);
        printf("\nIO Connections for %s%s%s\n", connector_of(cli, port), name ? " -> " : "", name ? name : "");
        printf("%s                  I/O   Pri. func    Sec. func        Chan     Sec. Pin func   Sec. Pin Dir\n\n",
               rom->port_width == DB25_WIDTH && !name ? "DB25 pin#" : "Pin#");
        for (unsigned pin = 0; pin < rom->port_width && port * rom->port_width + pin < rom->pin_count; pin++)
            print_pin(rom, terminals, pin, port * rom->port_width + pin);
    }
    printf("\n");
}

/* ---- XML
 * -------------------------------------------------------------------------------------------------------------- */

static void print_xml_pin(const struct cli *const cli, const struct hm2_idrom *const rom,
                          const struct hm2_terminals *const terminals, const unsigned port, const unsigned pin)
{
    const unsigned io = port * rom->port_width + pin;
    const struct hm2_pd *const pd = &rom->pins[io];
    const bool none = pd->secondary_tag == HM2_GTAG_NONE;
    char tag[48], function[48];
    printf("        <pin>\n            <connector>%s</connector>\n", connector_of(cli, port));
    printf("            <secondarymodulename>%s</secondarymodulename>\n",
           none ? "None" : tag_text(pd->secondary_tag, true, tag, sizeof tag));
    printf("            <secondaryfunctionname>%s%s</secondaryfunctionname>\n",
           none ? "" : pin_text(pd, true, function, sizeof function),
           none                                 ? ""
           : pd->secondary_pin & HM2_PIN_OUTPUT ? " (Out)"
                                                : " (In)");
    if (terminals)
        printf("            <secondaryinstance>%-18s</secondaryinstance>\n",
               pin < terminals->count ? terminals->terminals[pin] : "");
    else
        printf("            <secondaryinstance>%2u</secondaryinstance>\n", pin_number(rom->port_width, pin, io));
    printf("        </pin>\n");
}

static void print_xml(const struct cli *const cli, const struct hm2_idrom *const rom)
{
    const char *name;
    char buf[48];
    printf("<?xml version=\"1.0\"?>\n<hostmot2>\n    <boardname>%.8s</boardname>\n    <ioports>%u</ioports>\n"
           "    <iowidth>%u</iowidth>\n    <portwidth>%u</portwidth>\n    <clocklow>%8u</clocklow>\n"
           "    <clockhigh>%8u</clockhigh>\n    <modules>\n",
           rom->board_name, (unsigned)rom->io_ports, (unsigned)(rom->io_ports * rom->port_width),
           (unsigned)rom->port_width, (unsigned)rom->clock_low_hz, (unsigned)rom->clock_high_hz);
    for (unsigned i = 0; i < rom->module_count; i++)
        printf("        <module>\n            <tagname>%s</tagname>\n            <numinstances>%2u</numinstances>\n"
               "        </module>\n",
               tag_text(rom->modules[i].gtag, true, buf, sizeof buf), rom->modules[i].instances);
    printf("    </modules>\n    <pins>\n");
    for (unsigned port = 0; port < rom->io_ports; port++) {
        const struct hm2_terminals *const terminals = terminals_of(cli, port, &name);
        for (unsigned pin = 0; pin < rom->port_width && port * rom->port_width + pin < rom->pin_count; pin++)
            print_xml_pin(cli, rom, terminals, port, pin);
    }
    printf("    </pins>\n</hostmot2>\n");
}

/* ---- JSON
 * ------------------------------------------------------------------------------------------------------------- */

static void print_json_pin(const struct cli *const cli, const struct hm2_idrom *const rom, const unsigned io)
{
    const struct hm2_pd *const pd = &rom->pins[io];
    const unsigned port = io / rom->port_width, pin = io % rom->port_width;
    const char *name;
    const struct hm2_terminals *const terminals = terminals_of(cli, port, &name);
    char buf[48];
    json_object(cli);
    json_number(cli, "io", io);
    json_text(cli, "connector", connector_of(cli, port));
    if (terminals && pin < terminals->count)
        json_text(cli, "terminal", terminals->terminals[pin]);
    else
        json_number(cli, "pin", pin_number(rom->port_width, pin, io));
    if (pd->secondary_tag != HM2_GTAG_NONE) {
        json_text(cli, "module", tag_text(pd->secondary_tag, false, buf, sizeof buf));
        json_text(cli, "function", pin_text(pd, false, buf, sizeof buf));
        if (!(pd->secondary_unit & GLOBAL))
            json_number(cli, "channel", pd->secondary_unit);
        json_bool(cli, "output", pd->secondary_pin & HM2_PIN_OUTPUT);
    }
    json_close(cli, '}');
}

static void print_json(const struct cli *const cli, const struct hm2_idrom *const rom)
{
    char buf[48];
    json_begin(cli);
    json_text(cli, "board_name", rom->board_name);
    json_number(cli, "clock_low_hz", rom->clock_low_hz);
    json_number(cli, "clock_high_hz", rom->clock_high_hz);
    json_array(cli, "modules");
    for (unsigned i = 0; i < rom->module_count; i++) {
        const struct hm2_md *const md = &rom->modules[i];
        json_object(cli);
        json_text(cli, "name", tag_text(md->gtag, false, buf, sizeof buf));
        json_number(cli, "tag", md->gtag);
        json_number(cli, "version", md->version);
        json_number(cli, "instances", md->instances);
        json_number(cli, "base", md->base);
        json_close(cli, '}');
    }
    json_close(cli, ']');
    json_array(cli, "pins");
    for (unsigned io = 0; io < rom->pin_count; io++)
        print_json_pin(cli, rom, io);
    json_close(cli, ']');
    json_end(cli);
}

int do_readhmid(struct cli *const cli, const char *const arg)
{
    const struct hm2_idrom *const rom = idrom_of(cli);
    (void)arg;
    if (cli->json)
        print_json(cli, rom);
    else
        (cli->xml ? print_xml : print_text)(cli, rom);
    return cli->info->cookie == HM2_COOKIE ? DONE : FAILED;
}

/* ---- descriptors
 * ------------------------------------------------------------------------------------------------------ */

static void print_descriptor(const unsigned number, const struct hm2_pd *const pd)
{
    char buf[48];
    printf("    pin %u:\n        Primary Tag: 0x%02X (%s)\n", number, pd->primary_tag,
           tag_text(pd->primary_tag, false, buf, sizeof buf));
    if (pd->secondary_tag == HM2_GTAG_NONE)
        return;
    printf("        Secondary Tag: 0x%02X (%s)\n", pd->secondary_tag,
           tag_text(pd->secondary_tag, false, buf, sizeof buf));
    printf("        Secondary Unit: 0x%02X\n        Secondary Pin: 0x%02X (%s, %s)\n", pd->secondary_unit,
           pd->secondary_pin, pin_text(pd, false, buf, sizeof buf),
           pd->secondary_pin & HM2_PIN_OUTPUT ? "Output" : "Input");
}

int do_print_pd(struct cli *const cli, const char *const arg)
{
    const struct hm2_idrom *const rom = idrom_of(cli);
    (void)arg;
    printf("%u HM2 Pin Descriptors:\n", rom->pin_count);
    for (unsigned i = 0; i < rom->pin_count; i++)
        print_descriptor(i, &rom->pins[i]);
    return cli->info->cookie == HM2_COOKIE ? DONE : FAILED;
}

int do_print_lio(struct cli *const cli, const char *const arg)
{
    (void)arg;
    printf("%u HM2 Local Pin Descriptors:\n", cli->info->local_pin_count);
    for (unsigned i = 0; i < cli->info->local_pin_count; i++) {
        const uint32_t word = cli->info->local_pins[i];
        const struct hm2_pd pd = {(uint8_t)word, (uint8_t)(word >> 8), (uint8_t)(word >> 16), (uint8_t)(word >> 24)};
        print_descriptor(i, &pd);
    }
    return DONE;
}
