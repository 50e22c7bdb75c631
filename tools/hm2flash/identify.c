/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Who is there; everything about it with --verbose, in mesaflash's words (flash tool reference 1.4.1). */
#include <stdio.h>
#include <string.h>

#include <hm2/bytes.h>

#include "cli.h"

const char *jumper_text(const struct flash_card_info *const info)
{
    const bool efinix = info->board && info->board->family == FLASH_EFINIX;
    const char *const texts[] = {"fixed 192.168.1.121", "fixed from EEPROM", "from BOOTP",
                                 efinix ? "Force Fallback" : "Invalid"};
    return info->jumpers < 4 ? texts[info->jumpers] : "unknown";
}

static void print_mac(const struct cli *const cli, const char *const before)
{
    const uint8_t *const m = cli->info->mac;
    say(cli, "%smac address: %02X:%02X:%02X:%02X:%02X:%02X\n", before, m[0], m[1], m[2], m[3], m[4], m[5]);
}

static void print_size(const struct cli *const cli, const unsigned log2)
{
    if (log2 < 10)
        say(cli, "[size=%u]", 1u << log2);
    else if (log2 < 20)
        say(cli, "[size=%uK]", 1u << (log2 - 10));
    else if (log2 < 31)
        say(cli, "[size=%uM]", 1u << (log2 - 20));
    else
        say(cli, "[size=%08X]", log2 < 32 ? 1u << log2 : 0);
}

static void print_space(const struct cli *const cli, const unsigned number, const struct lbp16_info *const space)
{
    static const char *const widths[] = {"8", "16", "32", "64"};
    const char *const type = space->type == LBP16_TYPE_REGISTER ? "registers"
                             : space->type == LBP16_TYPE_MEMORY ? "memory"
                             : space->type == LBP16_TYPE_EEPROM ? "EEPROM"
                             : space->type == LBP16_TYPE_FLASH  ? "flash"
                                                                : "unknown";
    say(cli, "    %u: %s (%s, %s", number, space->name, type, space->writable ? "RW" : "RO");
    for (unsigned i = 0; i < 4; i++)
        if (space->access[i])
            say(cli, ", %s-bit)", widths[i]);
    say(cli, " ");
    print_size(cli, space->size_log2);
    if (space->type >= LBP16_TYPE_EEPROM)
        say(cli, ", page size: %u, erase size: %u", 1u << space->page_log2, 1u << space->erase_log2);
    say(cli, "\n");
}

static void print_board(const struct cli *const cli)
{
    const struct flash_card_info *const info = cli->info;
    const struct flash_board *const board = info->board;
    say(cli, "Communication:\n  transport layer: ethernet IPv4 UDP\n  ip address: %s\n", cli->address);
    print_mac(cli, "  ");
    say(cli, "  protocol: LBP16 version %u\n", info->lbp_version);
    say(cli, "Board info:\n");
    if (info->chip)
        say(cli, "  Flash size: %s (id: 0x%02X)\n", info->chip->name, info->chip->id);
    if (board) {
        say(cli, "  Connectors count: %u\n  Pins per connector: %u\n  Connectors names:", board->io_ports,
            board->port_width);
        for (unsigned i = 0; i < board->io_ports; i++)
            say(cli, " %s", board->connectors[i]);
        say(cli, "\n  FPGA type: %s\n  Number of leds: %u\n", board->part, board->leds);
    }
    say(cli, "Board firmware info:\n  memory spaces:\n");
    for (unsigned i = 0; i < 8; i++)
        if (info->space[i].cookie)
            print_space(cli, i, &info->space[i]);
}

static int print_live(struct cli *const cli)
{
    enum { TIMERS = 3, CONTROL = 13 };
    const struct flash_card_info *const info = cli->info;
    uint16_t t[TIMERS] = {0}, c[CONTROL] = {0};
    int err = 0;
    if (info->space[LBP16_SPACE_TIMER].cookie)
        err = flash_card_read16(cli->card, LBP16_SPACE_TIMER, 0, TIMERS, t, &cli->diag);
    if (err == 0)
        err = flash_card_read16(cli->card, LBP16_SPACE_CONTROL, 0, CONTROL, c, &cli->diag);
    if (err < 0)
        return report(cli, err);
    if (info->space[LBP16_SPACE_TIMER].cookie)
        say(cli, "  [space 4] timers:\n    uSTimeStampReg: 0x%04X\n    WaituSReg: 0x%04X\n    HM2Timeout: 0x%04X\n",
            t[0], t[1], t[2]);
    say(cli,
        "  [space 6] LBP16 control/status:\n    packets received: all %u, UDP %u, bad %u\n"
        "    packets sent: all %u, UDP %u, bad %u\n    parse errors: %u, mem errors %u, write errors %u\n"
        "    error flags: 0x%04X\n    debug LED ptr: 0x%04X\n    scratch: 0x%04X\n",
        c[4], c[5], c[6], c[7], c[8], c[9], c[1], c[2], c[3], c[0], c[11], c[12]);
    return DONE;
}

#define EEPROM_TEXT (5u * (LBP16_EEPROM_BYTES / 2u))

/* All its words, so that they can be put back by hand with elbpcom. */
static const char *eeprom_text(const struct flash_card_info *const info, char text[const EEPROM_TEXT])
{
    for (unsigned i = 0; i < LBP16_EEPROM_BYTES / 2; i++)
        snprintf(text + (size_t)5 * i, 6, i + 1 < LBP16_EEPROM_BYTES / 2 ? "%04X " : "%04X", info->eeprom[i]);
    return text;
}

static void print_eeprom(const struct cli *const cli)
{
    enum { ROW = 40 }; /* eight words */
    char words[EEPROM_TEXT];
    eeprom_text(cli->info, words);
    for (unsigned at = 0; at < EEPROM_TEXT; at += ROW)
        say(cli, "  EEPROM 0x%02X: %.39s\n", at / ROW * 16, words + at);
}

static int print_contents(struct cli *const cli)
{
    struct flash_survey survey;
    if (!cli->info->board || !cli->info->chip)
        return DONE;
    const int err = look_at_flash(cli, &survey);
    if (err == HM2_ERR_STATE) {
        hm2_diag_clear(&cli->diag);
        say(cli, "  flash: " IN_USE "\n");
        return DONE;
    }
    if (err < 0)
        return report(cli, err);
    say(cli, "  flash: sector 0: %s, fallback area: %s, user area: %s\n", flash_content_name(survey.sector0),
        flash_content_name(survey.fallback), flash_content_name(survey.user));
    return DONE;
}

static int print_details(struct cli *const cli)
{
    const struct flash_card_info *const info = cli->info;
    char name[17] = "";
    print_board(cli);
    say(cli, "  [space 0] HostMot2\n  [space 2] Ethernet eeprom:\n");
    print_mac(cli, "    ");
    for (unsigned i = 0; i < 8; i++)
        hm2_put_le16((uint8_t *)name + (size_t)2 * i, info->eeprom[LBP16_EEPROM_NAME / 2 + i]);
    say(cli, "    ip address: %u.%u.%u.%u\n    board name: %.16s\n    user leds: %s\n", info->ip[0], info->ip[1],
        info->ip[2], info->ip[3], name, info->eeprom[LBP16_EEPROM_LED_MODE / 2] & 1 ? "eth debug" : "Hostmot2");
    if (info->chip)
        say(cli, "  [space 3] FPGA flash eeprom:\n    flash size: %s (id: 0x%02X)\n", info->chip->name, info->chip->id);
    const int status = print_live(cli);
    say(cli,
        "  [space 7] LBP16 info:\n    board name: %s\n    LBP16 protocol version %u\n    board firmware version %u\n"
        "    IP address jumpers at boot: %s\n",
        info->card_name, info->lbp_version, info->firmware, jumper_text(info));
    say(cli, "  EEPROM netmask: %u.%u.%u.%u\n", info->netmask[0], info->netmask[1], info->netmask[2], info->netmask[3]);
    print_eeprom(cli);
    return status == DONE ? print_contents(cli) : status;
}

static int json_contents(struct cli *const cli)
{
    struct flash_survey survey;
    const int err = look_at_flash(cli, &survey);
    json_bool(cli, "in_use", err == HM2_ERR_STATE);
    if (err == HM2_ERR_STATE) {
        hm2_diag_clear(&cli->diag);
        return DONE;
    }
    if (err < 0)
        return report(cli, err);
    json_text(cli, "sector_0", flash_content_name(survey.sector0));
    json_text(cli, "fallback_area", flash_content_name(survey.fallback));
    json_text(cli, "user_area", flash_content_name(survey.user));
    return DONE;
}

static int print_json(struct cli *const cli)
{
    const struct flash_card_info *const info = cli->info;
    char text[64];
    json_begin(cli);
    json_text(cli, "name", info->card_name);
    json_bool(cli, "known", info->board != NULL);
    if (info->board)
        json_text(cli, "fpga", info->board->part);
    snprintf(text, sizeof text, "%02X:%02X:%02X:%02X:%02X:%02X", info->mac[0], info->mac[1], info->mac[2], info->mac[3],
             info->mac[4], info->mac[5]);
    json_text(cli, "mac", text);
    snprintf(text, sizeof text, "%u.%u.%u.%u", info->ip[0], info->ip[1], info->ip[2], info->ip[3]);
    json_text(cli, "eeprom_ip", text);
    snprintf(text, sizeof text, "%u.%u.%u.%u", info->netmask[0], info->netmask[1], info->netmask[2], info->netmask[3]);
    json_text(cli, "eeprom_netmask", text);
    const unsigned led_mode = info->eeprom[LBP16_EEPROM_LED_MODE / 2];
    json_number(cli, "led_mode", led_mode);
    char words[EEPROM_TEXT];
    json_text(cli, "eeprom", eeprom_text(info, words));
    json_number(cli, "lbp16", info->lbp_version);
    json_number(cli, "firmware", info->firmware);
    json_text(cli, "jumpers", jumper_text(info));
    json_number(cli, "flash_id", info->flash_id & 0xFFu);
    json_number(cli, "flash_bytes", info->chip ? info->chip->bytes : 0);
    const int status = info->board && info->chip ? json_contents(cli) : DONE;
    json_end(cli);
    return status;
}

int do_identify(struct cli *const cli, const char *const arg)
{
    (void)arg;
    if (cli->json)
        return print_json(cli);
    say(cli, "\nETH device %s at ip=%.*s\n", card_name(cli), (int)strcspn(cli->address, ":"), cli->address);
    return cli->verbose ? print_details(cli) : DONE;
}
