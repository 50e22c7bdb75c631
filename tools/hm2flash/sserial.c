/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Smart-serial ports and their remotes, in the words that pncconf reads (flash tool reference 1.4.5, 1.6). */
#include <string.h>

#include "cli.h"

enum { SOFTWARE_MODE = 1 };

/* Which half of a two-part device it is stands in the top byte of its unit number. */
const char *sserial_part(const uint32_t unit)
{
    switch (unit >> 24) {
    case 0x10:
        return " GPIO+SPINDLE";
    case 0x11:
        return " ANALOG";
    case 0x12:
        return " GPIO";
    default:
        return "";
    }
}

/* ---- parameters in mesaflash's words ------------------------------------------------------------------------------
 */

static void print_baud(const struct cli *const cli, const uint64_t index)
{
    static const char *const rates[] = {"9600b",   "19200b",  "38400b", "57600b", "115200b", "230400b",
                                        "460800b", "921600b", "1.25Mb", "2.5Mb",  "5Mb",     "10Mb"};
    say(cli, "    NVBaudRate = %s\n", index < sizeof rates / sizeof rates[0] ? rates[index] : "?");
}

static void print_sw(const struct cli *const cli, const uint64_t value)
{
    say(cli, "    SwRevision = %u\n", (unsigned)value);
}

static void print_hw(const struct cli *const cli, const uint64_t value)
{
    say(cli, "    HwRevision = %u\n", (unsigned)value);
}

static void print_unit(const struct cli *const cli, const uint64_t value)
{
    say(cli, "    NVUnitNumber = 0x%08X\n", (unsigned)value);
}

static void print_watchdog(const struct cli *const cli, const uint64_t value)
{
    say(cli, "    NVWatchDogTimeout = %ums\n", (unsigned)value);
}

static const struct {
    const char *name;
    void (*print)(const struct cli *cli, uint64_t value);
} well_known[] = {{"SwRevision", print_sw},
                  {"HwRevision", print_hw},
                  {"NVBaudRate", print_baud},
                  {"NVUnitNumber", print_unit},
                  {"NVWatchDogTimeout", print_watchdog}};

static void print_other(const struct cli *const cli, const struct sslbp_field *const field, const uint64_t value)
{
    static const char *const types[] = {"PADDING",   "BITFIELD", "UNSIGNED", "SIGNED", "NV UNSIGNED",
                                        "NV SIGNED", "STREAM",   "BOOLEAN",  "ENCODER"};
    const bool number = field->type >= SSLBP_UNSIGNED && field->type <= SSLBP_NV_SIGNED;
    say(cli, "    %s", field->name);
    if (field->bits == 16)
        say(cli, " = %x", (unsigned)value);
    else if (field->bits == 32)
        say(cli, " = %08X", (unsigned)value);
    say(cli, " [%u bits %s %s | UNIT: %s", field->bits,
        field->type < sizeof types / sizeof types[0] ? types[field->type] : "?",
        field->direction == SSLBP_BOTH     ? "IO"
        : field->direction == SSLBP_OUTPUT ? "OUT"
                                           : "IN",
        field->unit);
    if (number)
        say(cli, " | RANGE: %.2f - %.2f", field->min, field->max);
    say(cli, " | ADDR: %04X]\n", field->address);
}

static void print_parameter(const struct cli *const cli, const struct sslbp_field *const field, const uint64_t value)
{
    for (size_t i = 0; i < sizeof well_known / sizeof well_known[0]; i++)
        if (strcmp(field->name, well_known[i].name) == 0) {
            well_known[i].print(cli, value);
            return;
        }
    if (cli->verbose && (sslbp_is_nonvolatile(field) || strcmp(field->unit, "None") == 0))
        print_other(cli, field, value);
}

static void print_remote(const struct cli *const cli, const struct flash_remote *const remote)
{
    say(cli, "  sserial device at channel %u: %.4s%s", remote->channel, remote->name, sserial_part(remote->unit));
    if (!cli->verbose)
        say(cli, " (unit 0x%08X)", (unsigned)remote->unit);
    say(cli, "\n");
    for (unsigned i = 0; i < remote->tables.global_count; i++)
        print_parameter(cli, &remote->tables.global[i], remote->values[i]);
    for (unsigned i = 0; i < remote->tables.mode_count; i++)
        if (remote->tables.mode[i].kind == SOFTWARE_MODE)
            say(cli, "    SOFTWARE MODE %s [index %02X]\n", remote->tables.mode[i].name, remote->tables.mode[i].index);
}

static void print_port(const struct cli *const cli, const unsigned number, const struct flash_sserial *const s)
{
    say(cli, "SSLBP port %u:\n  SSLBP Version: %u.%u\n  SSLBP Channels: %u\n  SSLBP Baud Rate: %u\n", number, s->major,
        s->minor, s->channels, (unsigned)s->baud);
    if (cli->verbose)
        say(cli,
            "  interface type: %0x\n  interface width: %u\n  SSLBP Channel Start: %u\n  SSLBP Channel Stride: %u\n"
            "  SSLBP Processor Type: %x\n  SSLBP Clock: %u MHz\n",
            s->type, s->width, s->first, s->stride, s->processor, (unsigned)(s->clock_hz / 1000000u));
}

/* ---- the command --------------------------------------------------------------------------------------------------
 */

static void json_port(const struct cli *const cli, const struct flash_sserial *const s)
{
    json_object(cli);
    json_number(cli, "channels", s->channels);
    json_number(cli, "baud", s->baud);
    json_array(cli, "remotes");
}

static void json_remote(const struct cli *const cli, const struct flash_remote *const remote)
{
    json_object(cli);
    json_number(cli, "channel", remote->channel);
    json_text(cli, "name", remote->name);
    json_number(cli, "unit", remote->unit);
    json_close(cli, '}');
}

struct listing {
    struct cli *cli;
    unsigned port;
    bool open; /* the port's JSON object */
};

static void list(void *const context, const struct flash_sserial *const port, const struct flash_remote *const remote)
{
    struct listing *const listing = context;
    if (!remote) {
        print_port(listing->cli, listing->port, port);
        json_port(listing->cli, port);
        listing->open = true;
        return;
    }
    print_remote(listing->cli, remote);
    json_remote(listing->cli, remote);
}

int do_sserial(struct cli *const cli, const char *const arg)
{
    struct listing listing = {.cli = cli};
    int err = cli->any_traffic ? 0 : flash_card_quiet(cli->card, &cli->diag);
    (void)arg;
    if (err < 0)
        return report(cli, err);
    json_begin(cli);
    json_array(cli, "ports");
    while ((err = flash_card_sserial(cli->card, listing.port, list, &listing, &cli->diag)) == 0) {
        json_close(cli, ']');
        json_close(cli, '}');
        listing.open = false;
        listing.port++;
    }
    if (listing.open) {
        json_close(cli, ']');
        json_close(cli, '}');
    }
    json_close(cli, ']');
    json_end(cli);
    return err == HM2_ERR_NOTFOUND ? DONE : report(cli, err);
}
