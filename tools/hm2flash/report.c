/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A card on one page: an HTML file that needs nothing beside itself. */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "cli.h"
#include "names.h"
#include "report_draw.h"

static const char style[] =
    "body{font:14px/1.4 sans-serif;margin:2em auto;max-width:72em;padding:0 1em;color:#222;background:#fff}"
    "h1{margin-bottom:0}h2{margin-top:2em;border-bottom:1px solid #ccc}table{border-collapse:collapse}"
    "td,th{padding:.15em .8em;border:1px solid #ddd;text-align:left}th{background:#f4f4f4}"
    ".n{text-align:right}.warn{color:#a00;font-weight:bold}svg{max-width:100%;height:auto}"
    "svg text{font:11px sans-serif;text-anchor:middle}.gnd{fill:#ddd}.gpio{fill:#fff}.out{fill:#fc8}.in{fill:#8cf}"
    "circle,rect.pin{stroke:#555}.shell{fill:#f8f8f8;stroke:#888}.key span{padding:0 .6em;border:1px solid #555;"
    "margin-right:.4em}";

static void row(FILE *const out, const char *const name, const char *const format, ...)
    __attribute__((format(printf, 3, 4)));

static void row(FILE *const out, const char *const name, const char *const format, ...)
{
    char text[256];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    fprintf(out, "<tr><th>%s</th><td>", name);
    html_text(out, text);
    fputs("</td></tr>\n", out);
}

static void put_card(FILE *const out, const struct cli *const cli)
{
    const struct flash_card_info *const info = cli->info;
    static const char *const jumpers[] = {"fixed 192.168.1.121", "fixed from EEPROM", "from BOOTP"};
    const bool efinix = info->board && info->board->family == FLASH_EFINIX;
    const char *const last = efinix ? "Force Fallback" : "Invalid";
    const uint8_t *const m = info->mac, *const ip = info->ip, *const mask = info->netmask;
    fputs("<h2>Card</h2>\n<table id=\"card\">\n", out);
    row(out, "Name", "%s", info->card_name);
    row(out, "Address", "%s", cli->address);
    row(out, "FPGA", "%s", info->board ? info->board->part : "unknown");
    row(out, "Firmware", "%u, LBP16 version %u", info->firmware, info->lbp_version);
    row(out, "Address jumpers", "%u: %s", info->jumpers, info->jumpers < 3 ? jumpers[info->jumpers] : last);
    fputs("</table>\n<h2>Settings EEPROM</h2>\n<table id=\"eeprom\">\n", out);
    row(out, "MAC address", "%02X:%02X:%02X:%02X:%02X:%02X", m[0], m[1], m[2], m[3], m[4], m[5]);
    row(out, "IP address", "%u.%u.%u.%u", ip[0], ip[1], ip[2], ip[3]);
    row(out, "Netmask", "%u.%u.%u.%u", mask[0], mask[1], mask[2], mask[3]);
    row(out, "LEDs", "%s", info->eeprom[LBP16_EEPROM_LED_MODE / 2] & 1 ? "eth debug" : "Hostmot2");
    fputs("</table>\n", out);
}

static int put_flash(FILE *const out, struct cli *const cli)
{
    const struct flash_card_info *const info = cli->info;
    struct flash_survey survey;
    fputs("<h2>Configuration flash</h2>\n<table id=\"flash\">\n", out);
    row(out, "Chip", "%s (id: 0x%02X)", info->chip ? info->chip->name : "unknown", (unsigned)info->flash_id & 0xFFu);
    if (!info->chip || !info->board) {
        fputs("</table>\n", out);
        return 0;
    }
    const int err = look_at_flash(cli, &survey);
    if (err == HM2_ERR_STATE) {
        hm2_diag_clear(&cli->diag);
        row(out, "Contents", "%s", IN_USE);
        fputs("</table>\n", out);
        return 0;
    }
    if (err < 0)
        return err;
    const struct flash_range user = flash_area_range(info->board->family, info->chip, FLASH_USER);
    const struct flash_range fallback = flash_area_range(info->board->family, info->chip, FLASH_FALLBACK);
    if (info->board->family == FLASH_XILINX)
        row(out, "Sector 0", "%s", flash_content_name(survey.sector0));
    row(out, "Fallback area", "from 0x%06X: %s", (unsigned)fallback.start, flash_content_name(survey.fallback));
    row(out, "User area", "from 0x%06X: %s", (unsigned)user.start, flash_content_name(survey.user));
    fputs("</table>\n", out);
    return 0;
}

static void put_modules(FILE *const out, const struct hm2_idrom *const rom)
{
    char name[48];
    fprintf(out,
            "<h2>Configuration</h2>\n<p>%u I/O pins on %u connectors, clocks %.1f and %.1f MHz.</p>\n"
            "<table id=\"modules\"><tr><th>Module</th><th>Instances</th><th>Version</th><th>Address</th>"
            "<th>Clock</th></tr>\n",
            rom->pin_count, (unsigned)rom->io_ports, rom->clock_low_hz / 1e6, rom->clock_high_hz / 1e6);
    for (unsigned i = 0; i < rom->module_count; i++) {
        const struct hm2_md *const md = &rom->modules[i];
        const double hz = md->clock_tag == 1 ? rom->clock_low_hz : rom->clock_high_hz;
        fputs("<tr><td>", out);
        html_text(out, tag_text(md->gtag, false, name, sizeof name));
        fprintf(out, "</td><td class=\"n\">%u</td><td class=\"n\">%u</td><td>0x%04X</td><td>%.1f MHz</td></tr>\n",
                md->instances, md->version, md->base, hz / 1e6);
    }
    fputs("</table>\n", out);
}

static void put_connectors(FILE *const out, const struct cli *const cli, const struct hm2_idrom *const rom)
{
    fputs("<h2>Connectors</h2>\n<p class=\"key\"><span style=\"background:#fc8\">module output</span>"
          "<span style=\"background:#8cf\">module input</span><span>I/O only</span>"
          "<span style=\"background:#ddd\">ground or power</span></p>\n",
          out);
    for (unsigned port = 0; port < rom->io_ports; port++) {
        struct connector connector = {.rom = rom, .port = port, .name = connector_of(cli, port)};
        connector.terminals = terminals_of(cli, port, &connector.daughter);
        draw_connector(out, &connector);
    }
}

struct remotes {
    FILE *out;
    unsigned port, count;
};

static void put_remote(void *const context, const struct flash_sserial *const port,
                       const struct flash_remote *const remote)
{
    struct remotes *const remotes = context;
    (void)port;
    if (!remote)
        return;
    if (remotes->count++ == 0)
        fputs("<table id=\"remote-list\"><tr><th>Port</th><th>Channel</th><th>Remote</th><th>Unit</th><th>Modes</th>"
              "</tr>\n",
              remotes->out);
    fprintf(remotes->out, "<tr><td class=\"n\">%u</td><td class=\"n\">%u</td><td>", remotes->port, remote->channel);
    html_text(remotes->out, remote->name);
    html_text(remotes->out, sserial_part(remote->unit));
    fprintf(remotes->out, "</td><td>0x%08X</td><td>", (unsigned)remote->unit);
    for (unsigned i = 0; i < remote->tables.mode_count; i++) {
        fprintf(remotes->out, "%s%u: ", i ? ", " : "", remote->tables.mode[i].index);
        html_text(remotes->out, remote->tables.mode[i].name);
    }
    fputs("</td></tr>\n", remotes->out);
}

/* Remotes are reset to be asked, so only on a card that nobody drives. What is wrong with them belongs on the page. */
static void ask_remotes(FILE *const out, struct cli *const cli)
{
    struct remotes remotes = {.out = out};
    int err = cli->any_traffic ? 0 : flash_card_quiet(cli->card, &cli->diag);
    for (; err == 0; remotes.port += err == 0)
        err = flash_card_sserial(cli->card, remotes.port, put_remote, &remotes, &cli->diag);
    fputs(remotes.count > 0 ? "</table>\n" : "", out);
    if (err != HM2_ERR_NOTFOUND) {
        fputs("<p class=\"warn\">Not all remotes could be asked: ", out);
        html_text(out, cli->diag.text);
        fputs("</p>\n", out);
    } else if (remotes.count == 0) {
        fputs("<p>None answers.</p>\n", out);
    }
    hm2_diag_clear(&cli->diag);
}

static void put_remotes(FILE *const out, struct cli *const cli, const struct hm2_idrom *const rom)
{
    unsigned channels = 0;
    for (unsigned io = 0; io < rom->pin_count; io++) {
        const struct hm2_pd *const pd = &rom->pins[io];
        channels += (pd->secondary_tag == HM2_GTAG_SSERIAL || pd->secondary_tag == HM2_GTAG_SSERIALB) &&
                    pd->secondary_pin >> 4 == 0;
    }
    fprintf(out, "<h2>Smart-serial remotes</h2>\n<p id=\"remotes\">%u channel%s on the connectors.</p>\n", channels,
            channels == 1 ? "" : "s");
    if (channels > 0)
        ask_remotes(out, cli);
}

static int put_page(FILE *const out, struct cli *const cli)
{
    static struct hm2_idrom rom;
    struct hm2_diag faults = {0};
    char when[32] = "";
    const time_t now = time(NULL);
    struct tm tm;
    if (localtime_r(&now, &tm))
        strftime(when, sizeof when, "%Y-%m-%d %H:%M", &tm);
    fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<title>", out);
    html_text(out, card_name(cli));
    fprintf(out, "</title>\n<style>%s</style></head><body>\n<h1>", style);
    html_text(out, card_name(cli));
    fprintf(out, "</h1>\n<p>Read by hm2flash %s, %s</p>\n", HM2_VERSION, when);
    put_card(out, cli);
    const int err = put_flash(out, cli);
    if (err < 0)
        return err;
    const bool has_rom = cli->info->cookie == HM2_COOKIE;
    if (has_rom)
        (void)!hm2_idrom_parse(&cli->info->image, NULL, &rom, &faults);
    if (!has_rom || faults.len > 0) {
        fputs("<p class=\"warn\" id=\"faults\">", out);
        html_text(out, has_rom ? faults.text : "no HostMot2 firmware found");
        fputs("</p>\n", out);
    }
    put_modules(out, &rom);
    put_connectors(out, cli, &rom);
    put_remotes(out, cli, &rom);
    fputs("</body></html>\n", out);
    return 0;
}

/* Whole or not at all. */
int do_report(struct cli *const cli, const char *const arg)
{
    char name[4096];
    const int len = snprintf(name, sizeof name, "%s.%ld", arg, (long)getpid());
    if (len < 0 || (size_t)len >= sizeof name)
        return complain(cli, USAGE, "--report argument too long");
    FILE *const out = fopen(name, "wx");
    if (!out)
        return complain(cli, FAILED, "Can't create file '%s': %s", arg, strerror(errno));
    const int err = put_page(out, cli);
    const bool written = !ferror(out);
    if (fclose(out) == 0 && written && err == 0 && rename(name, arg) == 0) {
        say(cli, "Report '%s' created successfully.\n", arg);
        json_result(cli, "report");
        return DONE;
    }
    const int failed = errno;
    unlink(name);
    return err < 0 ? report(cli, err) : complain(cli, FAILED, "Can't create file '%s': %s", arg, strerror(failed));
}
