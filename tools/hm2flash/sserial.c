/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Smart-serial ports and their remotes, in the words that pncconf reads (flash tool reference 1.4.5, 1.6). */
#include "cli.h"

/* Which half of a two-part device it is stands in the top byte of its unit number. */
static const char *part_of(const uint32_t unit)
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

static void print_port(const struct cli *const cli, const unsigned port, const struct flash_sserial *const s)
{
    say(cli, "SSLBP port %u:\n  SSLBP Version: %u.%u\n  SSLBP Channels: %u\n  SSLBP Baud Rate: %u\n", port, s->major,
        s->minor, s->channels, (unsigned)s->baud);
    if (cli->verbose)
        say(cli, "  interface type: %0x\n  interface width: %u\n  SSLBP Processor Type: %x\n", s->type, s->width,
            s->processor);
    for (unsigned i = 0; i < s->channels; i++)
        if (s->present[i])
            say(cli, "  sserial device at channel %u: %.4s%s (unit 0x%08X)\n", i, s->name[i], part_of(s->unit[i]),
                (unsigned)s->unit[i]);
}

static void json_port(const struct cli *const cli, const struct flash_sserial *const s)
{
    json_object(cli);
    json_number(cli, "channels", s->channels);
    json_number(cli, "baud", s->baud);
    json_array(cli, "remotes");
    for (unsigned i = 0; i < s->channels; i++)
        if (s->present[i]) {
            json_object(cli);
            json_number(cli, "channel", i);
            json_text(cli, "name", s->name[i]);
            json_number(cli, "unit", s->unit[i]);
            json_close(cli, '}');
        }
    json_close(cli, ']');
    json_close(cli, '}');
}

int do_sserial(struct cli *const cli, const char *const arg)
{
    struct flash_sserial port;
    int err = cli->any_traffic ? 0 : flash_card_quiet(cli->card, &cli->diag);
    (void)arg;
    if (err < 0)
        return report(cli, err);
    json_begin(cli);
    json_array(cli, "ports");
    for (unsigned i = 0; (err = flash_card_sserial(cli->card, i, &port, &cli->diag)) == 0; i++)
        if (cli->json)
            json_port(cli, &port);
        else
            print_port(cli, i, &port);
    json_close(cli, ']');
    json_end(cli);
    return err == HM2_ERR_NOTFOUND ? DONE : report(cli, err);
}
