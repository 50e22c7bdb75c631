/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Registers, settings, and starting the card again (flash tool reference 1.4.10, 3.13 to 3.15, 3.19). */
#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"

#define NETMASK_FIRMWARE 16u
#define JUMPERS_EEPROM   1u
#define USUAL_MASK       0xFFFFFF00u
#define RETURN_NS        INT64_C(15000000000)
#define REGISTERS        0x10000u

/* ---- registers
 * ---------------------------------------------------------------------------------------------------------- */

/* 0x = hexadecimal, else decimal; all of it, up to `most`. */
static bool number(const char *const text, const unsigned long most, unsigned long *const value)
{
    const bool hex = strncmp(text, "0x", 2) == 0 || strncmp(text, "0X", 2) == 0;
    char *end;
    errno = 0;
    *value = strtoul(text, &end, hex ? 16 : 10);
    return errno == 0 && end != text && *end == '\0' && text[0] != '-' && text[0] != '+' && *value <= most;
}

int do_rpo(struct cli *const cli, const char *const arg)
{
    unsigned long address;
    uint32_t value = 0;
    if (!number(arg, REGISTERS - 4, &address) || address % 4)
        return complain(cli, USAGE, "--rpo %s: expected a register, 0x0000 to 0xFFFC, divisible by four", arg);
    const int err = flash_card_read_hm2(cli->card, (uint16_t)address, 1, &value, &cli->diag);
    if (err < 0)
        return report(cli, err);
    say(cli, "%08X\n", (unsigned)value);
    json_begin(cli);
    json_number(cli, "register", (double)address);
    json_number(cli, "value", value);
    json_end(cli);
    return DONE;
}

int do_wpo(struct cli *const cli, const char *const arg)
{
    unsigned long address, value;
    char name[32];
    const char *const equals = strchr(arg, '=');
    const size_t len = equals ? (size_t)(equals - arg) : 0;
    if (len == 0 || len >= sizeof name)
        return complain(cli, USAGE, "--wpo %s: expected REGISTER=VALUE", arg);
    memcpy(name, arg, len);
    name[len] = '\0';
    if (!number(name, REGISTERS - 4, &address) || address % 4 || !number(equals + 1, UINT32_MAX, &value))
        return complain(cli, USAGE, "--wpo %s: expected a register up to 0xFFFC and a value of 32 bits", arg);
    const uint32_t word = (uint32_t)value;
    const int err = flash_card_write_hm2(cli->card, (uint16_t)address, 1, &word, &cli->diag);
    if (err == 0)
        json_result(cli, "wpo");
    return report(cli, err);
}

/* ---- all pins at once
 * ---------------------------------------------------------------------------------------------------- */

enum { PORT_DDR = 1, PORT_ALTERNATE = 2 }; /* registers of the IOPort module */

static int set_ports(struct cli *const cli, const bool modules)
{
    struct hm2_idrom rom;
    struct hm2_diag ignored = {0};
    int err = hm2_idrom_parse(&cli->info->image, NULL, &rom, &ignored);
    const struct hm2_md *const ports = hm2_idrom_find(&rom, HM2_GTAG_IOPORT);
    if (err < 0 || !ports)
        return complain(cli, REFUSED, "the card's firmware has no I/O ports that could be set");
    for (unsigned port = 0; port < ports->instances && err == 0; port++) {
        const uint32_t alternate = modules ? UINT32_MAX : 0;
        uint32_t ddr = 0;
        for (unsigned pin = 0; modules && pin < rom.port_width && port * rom.port_width + pin < rom.pin_count; pin++)
            if (rom.pins[port * rom.port_width + pin].secondary_pin & HM2_PIN_OUTPUT)
                ddr |= 1u << pin % 32;
        err = flash_card_write_hm2(cli->card, hm2_md_address(ports, PORT_ALTERNATE, port), 1, &alternate, &cli->diag);
        if (err == 0)
            err = flash_card_write_hm2(cli->card, hm2_md_address(ports, PORT_DDR, port), 1, &ddr, &cli->diag);
    }
    if (err == 0)
        json_result(cli, modules ? "enable-all-mod" : "safe-io");
    return report(cli, err);
}

int do_enable_all(struct cli *const cli, const char *const arg)
{
    (void)arg;
    const int status = check_alone(cli);
    if (status != DONE)
        return status;
    (void)complain(cli, 0, "this switches on every output that a module has, whatever is connected to it");
    return confirmed(cli) ? set_ports(cli, true) : REFUSED;
}

int do_safe_io(struct cli *const cli, const char *const arg)
{
    (void)arg;
    const int status = check_alone(cli);
    return status != DONE ? status : set_ports(cli, false);
}

/* ---- settings in the EEPROM
 * ----------------------------------------------------------------------------------------------- */

static bool parse_ip(const char *const text, uint8_t ip[const 4])
{
    struct in_addr address;
    if (inet_pton(AF_INET, text, &address) != 1)
        return false;
    memcpy(ip, &address, 4);
    return true;
}

static uint32_t number_of(const uint8_t ip[const 4])
{
    return (uint32_t)ip[0] << 24 | (uint32_t)ip[1] << 16 | (uint32_t)ip[2] << 8 | ip[3];
}

/* Ones, then zeros, and both. */
static bool is_mask(const uint32_t mask)
{
    return mask != 0 && mask != UINT32_MAX && (~mask & (~mask + 1)) == 0;
}

/* Can a card in a network of this mask have the address: neither the network's own nor its broadcast (H14)? */
static bool is_host(const uint8_t ip[const 4], const uint32_t mask)
{
    const uint32_t host = number_of(ip) & ~mask;
    return ip[0] != 0 && ip[0] < 224 && host != 0 && host != ~mask;
}

/* The card's own mask, or the usual one when its firmware or its EEPROM has none. */
static uint32_t mask_of(const struct flash_card_info *const info)
{
    const uint32_t mask = number_of(info->netmask);
    return info->firmware >= NETMASK_FIRMWARE && is_mask(mask) ? mask : USUAL_MASK;
}

/* The low word comes first, and of each word the low byte. */
static int store_address(struct cli *const cli, const uint16_t at, const uint8_t ip[const 4])
{
    const uint16_t words[2] = {(uint16_t)(ip[2] << 8 | ip[3]), (uint16_t)(ip[0] << 8 | ip[1])};
    return report(cli, flash_card_write_eeprom(cli->card, at, 2, words, &cli->diag));
}

/* H14: whether the stored address will count, and the way back from one that nobody reaches. */
static void tell_jumpers(const struct cli *const cli)
{
    if (cli->info->jumpers != JUMPERS_EEPROM)
        (void)complain(cli, 0,
                       "warning: the card does not take its address from the EEPROM; its jumpers must be down/up for "
                       "that");
    (void)complain(cli, 0, "address by the jumpers as they are now: %s (%u)", jumper_text(cli->info),
                   cli->info->jumpers);
    (void)complain(cli, 0,
                   "--reset or power-on makes it count. Should nobody reach the card then: both address jumpers down, "
                   "power on, and it is at 192.168.1.121");
}

static int set_ip(struct cli *const cli, const char *const value)
{
    uint8_t ip[4];
    if (!parse_ip(value, ip)) {
        say(cli, "Error: invalid format of IP address\n");
        return complain(cli, USAGE, "--set ip=%s: expected an address like 192.168.1.121", value);
    }
    if (!is_host(ip, mask_of(cli->info)))
        return complain(cli, REFUSED,
                        "%s is no address that a card with the network mask %08X can have (network, broadcast or "
                        "multicast)",
                        value, (unsigned)mask_of(cli->info));
    const int status = store_address(cli, LBP16_EEPROM_IP, ip);
    if (status == DONE) {
        say(cli, "Board IP updated successfully.\n");
        tell_jumpers(cli);
    }
    return status;
}

static int set_netmask(struct cli *const cli, const char *const value)
{
    uint8_t m[4];
    if (!parse_ip(value, m))
        return complain(cli, USAGE, "--set netmask=%s: expected a mask like 255.255.255.0", value);
    if (!is_mask(number_of(m)))
        return complain(cli, REFUSED, "%s is no network mask: ones, then zeros, and both", value);
    if (cli->info->firmware < NETMASK_FIRMWARE)
        return complain(cli, REFUSED, "the card's firmware is %u; a mask needs %u", cli->info->firmware,
                        NETMASK_FIRMWARE);
    if (!is_host(cli->info->ip, number_of(m)))
        return complain(cli, REFUSED,
                        "with the mask %s the address in the EEPROM, %u.%u.%u.%u, would be that of a network "
                        "or a broadcast: set another address first",
                        value, cli->info->ip[0], cli->info->ip[1], cli->info->ip[2], cli->info->ip[3]);
    const int status = store_address(cli, LBP16_EEPROM_NETMASK, m);
    if (status == DONE)
        say(cli, "Board netmask updated successfully.\n");
    return status;
}

static int set_led_mode(struct cli *const cli, const char *const value)
{
    if ((value[0] != '0' && value[0] != '1') || value[1])
        return complain(cli, USAGE, "--set ledmode=%s: expected 0 (LEDs of HostMot2) or 1 (received packets)", value);
    const uint16_t word = (uint16_t)(value[0] - '0');
    const int status = report(cli, flash_card_write_eeprom(cli->card, LBP16_EEPROM_LED_MODE, 1, &word, &cli->diag));
    if (status == DONE)
        say(cli, "Board LED mode updated successfully.\n");
    return status;
}

int do_set(struct cli *const cli, const char *const arg)
{
    static const struct {
        const char *name;
        int (*set)(struct cli *cli, const char *value);
    } settings[] = {{"ip=", set_ip}, {"netmask=", set_netmask}, {"ledmode=", set_led_mode}};
    for (size_t i = 0; i < sizeof settings / sizeof settings[0]; i++) {
        const size_t len = strlen(settings[i].name);
        if (strncmp(arg, settings[i].name, len) != 0)
            continue;
        int status = check_alone(cli);
        if (status == DONE)
            status = settings[i].set(cli, arg + len);
        if (status == DONE) {
            say(cli, "You must power cycle board to load updated eeprom settings.\n");
            json_result(cli, "set");
        }
        return status;
    }
    say(cli, "Error: Unknown set command syntax, see --help for examples\n");
    return complain(cli, USAGE, "--set %s: expected ip=, netmask= or ledmode=", arg);
}

/* ---- starting again
 * -------------------------------------------------------------------------------------------------------- */

/* A card whose jumpers are both up was made to start its fallback image (Efinix). Otherwise what was asked for runs
 * when its area holds an image that could. */
static const char *running(const struct cli *const cli, const struct flash_survey *const survey)
{
    enum { BOTH_UP = 3 };
    const bool efinix = cli->info->board && cli->info->board->family == FLASH_EFINIX;
    const enum flash_content user = survey->user;
    if (efinix && cli->info->jumpers == BOTH_UP)
        return "fallback image (both address jumpers are up)";
    if (cli->fallback)
        return "fallback image";
    return user == FLASH_XILINX_IMAGE || user == FLASH_EFINIX_IMAGE ? "user image"
                                                                    : "fallback image (the user area holds none)";
}

int await_card(struct cli *const cli, const char *const what)
{
    struct flash_survey survey = {0};
    const double start_s = seconds_now();
    int err = flash_card_await(cli->card, RETURN_NS, &cli->diag);
    if (err == 0 && cli->info->board && cli->info->chip)
        err = flash_card_survey(cli->card, &survey, &cli->diag);
    if (err < 0)
        return report(cli, err);
    char name[9] = "";
    for (unsigned i = 0; i < 8; i++)
        name[i] = (char)(cli->info->image.rom[3 + i / 4] >> 8 * (i % 4));
    const char *const image = running(cli, &survey);
    if (!cli->json)
        (void)complain(cli, 0, "the %s is back after %.1f s: firmware %u, %s, %s", card_name(cli),
                       seconds_now() - start_s, cli->info->firmware, name, image);
    json_begin(cli);
    json_text(cli, "action", what);
    json_bool(cli, "done", true);
    json_number(cli, "seconds", seconds_now() - start_s);
    json_number(cli, "firmware", cli->info->firmware);
    json_text(cli, "running", image);
    json_end(cli);
    return DONE;
}

int do_reload(struct cli *const cli, const char *const arg)
{
    (void)arg;
    const int status = check_machine(cli, "Reloading");
    if (status != DONE)
        return status;
    const int err = flash_card_reload(cli->card, cli->fallback ? FLASH_FALLBACK : FLASH_USER, &cli->diag);
    return err < 0 ? report(cli, err) : await_card(cli, "reload");
}

int do_reset(struct cli *const cli, const char *const arg)
{
    (void)arg;
    const int status = check_alone(cli);
    if (status != DONE)
        return status;
    const int err = flash_card_reset(cli->card, &cli->diag);
    return err < 0 ? report(cli, err) : await_card(cli, "reset");
}
