/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "options.h"

#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/lbp.h>
#include <hm2/sslbp.h>

#define MAX_BAUD 10000000u
#define MAX_PORT 7u

static const char usage[] =
    "Usage: hm2lbp --tty DEVICE | --card ADDRESS [OPTION...] COMMAND\n"
    "Parameters and firmware of Mesa's smart-serial remotes, as RPD, WPD and UFLBP do it.\n"
    "\n"
    "  list                      every parameter with its value\n"
    "  read NAME [H]             a value, decimal or with H hexadecimal\n"
    "  write NAME VALUE [H]      change it\n"
    "  update FILE.BIN           new firmware; the remote needs its set-up jumper\n"
    "NAME may be the beginning of a name; case does not matter.\n"
    "\n"
    "  --tty DEVICE     serial port to a remote in set-up mode\n"
    "  --baud RATE      of it (BAUDRATE times BAUDRATEMUL, or 115200)\n"
    "  --card ADDRESS[:PORT]  Ethernet card with the remote at a smart-serial port\n"
    "  --port N         smart-serial port of the card (0)\n"
    "  --channel N      channel of the port (0)\n"
    "  --mode N         software mode of the remote (0)\n"
    "  --hex            as H\n"
    "  --json           print one object\n"
    "  --yes            do not ask before permanent changes\n"
    "  --any-image      update although the file is named for another card\n"
    "  --help, --version\n"
    "\n"
    "Exit status: 0; 1 = failed, 2 = wrong command line, 3 = refused, 4 = no remote or no card answers.\n";

static int complain(const char *const what, const char *const value, const char *const wanted)
{
    fprintf(stderr, "hm2lbp: %s \"%s\": expected %s\n", what, value, wanted);
    return HM2_ERR_INVALID;
}

static int read_number(const char *const what, const char *const text, const unsigned long max,
                       unsigned long *const value)
{
    char wanted[64], *end;
    errno = 0;
    *value = strtoul(text, &end, 10);
    if (*text >= '0' && *text <= '9' && *end == '\0' && errno == 0 && *value <= max)
        return 0;
    snprintf(wanted, sizeof wanted, "a number from 0 to %lu", max);
    return complain(what, text, wanted);
}

/* The variables that RPD, WPD and UFLBP want (seed 003, "RPD, WPD, AND UFLBP"); none must be set. */
static int read_environment(struct options *const options)
{
    static const char *const fixed[][2] = {{"PROTOCOL", "LBP"}, {"INTERFACE", "OSDEVICE"}};
    const char *const rate = getenv("BAUDRATE"), *const multiplier = getenv("BAUDRATEMUL");
    unsigned long baud = LBP_SETUP_BAUD, times = 1;
    for (size_t i = 0; i < sizeof fixed / sizeof fixed[0]; i++) {
        const char *const value = getenv(fixed[i][0]);
        if (options->tty && value && strcmp(value, fixed[i][1]) != 0)
            return complain(fixed[i][0], value, fixed[i][1]);
    }
    if ((rate && read_number("BAUDRATE", rate, MAX_BAUD, &baud)) ||
        (multiplier && read_number("BAUDRATEMUL", multiplier, MAX_BAUD / 9600u, &times)))
        return HM2_ERR_INVALID;
    if (options->baud == 0)
        options->baud = (uint32_t)(baud * times <= MAX_BAUD ? baud * times : MAX_BAUD);
    return 0;
}

enum {
    OPT_TTY = 256,
    OPT_BAUD,
    OPT_CARD,
    OPT_PORT,
    OPT_CHANNEL,
    OPT_MODE,
    OPT_HEX,
    OPT_JSON,
    OPT_YES,
    OPT_ANY_IMAGE,
    OPT_HELP,
    OPT_VERSION
};

static const struct option long_options[] = {{"tty", required_argument, NULL, OPT_TTY},
                                             {"baud", required_argument, NULL, OPT_BAUD},
                                             {"card", required_argument, NULL, OPT_CARD},
                                             {"port", required_argument, NULL, OPT_PORT},
                                             {"channel", required_argument, NULL, OPT_CHANNEL},
                                             {"mode", required_argument, NULL, OPT_MODE},
                                             {"hex", no_argument, NULL, OPT_HEX},
                                             {"json", no_argument, NULL, OPT_JSON},
                                             {"yes", no_argument, NULL, OPT_YES},
                                             {"any-image", no_argument, NULL, OPT_ANY_IMAGE},
                                             {"help", no_argument, NULL, OPT_HELP},
                                             {"version", no_argument, NULL, OPT_VERSION},
                                             {NULL, 0, NULL, 0}};

static int take(struct options *const options, const int option, const char *const value)
{
    unsigned long number = 0;
    int err = 0;
    switch (option) {
    case OPT_TTY:
        options->tty = value;
        break;
    case OPT_CARD:
        options->card = value;
        break;
    case OPT_BAUD:
        err = read_number("--baud", value, MAX_BAUD, &number);
        options->baud = (uint32_t)number;
        break;
    case OPT_PORT:
        err = read_number("--port", value, MAX_PORT, &number);
        options->port = (unsigned)number;
        break;
    case OPT_CHANNEL:
        err = read_number("--channel", value, SSLBP_CHANNELS - 1, &number);
        options->channel = (unsigned)number;
        break;
    case OPT_MODE:
        err = read_number("--mode", value, UINT8_MAX, &number);
        options->mode = (unsigned)number;
        break;
    case OPT_HEX:
        options->hex = true;
        break;
    case OPT_JSON:
        options->json = true;
        break;
    case OPT_YES:
        options->yes = true;
        break;
    case OPT_ANY_IMAGE:
        options->any_image = true;
        break;
    default:
        return HM2_ERR_INVALID; /* getopt has complained */
    }
    return err;
}

enum options_result options_read(struct options *const options, const int argc, char **const argv)
{
    int option;
    *options = (struct options){.tty = NULL};
    while ((option = getopt_long(argc, argv, "", long_options, NULL)) != -1) {
        if (option == OPT_HELP) {
            fputs(usage, stdout);
            return OPTIONS_EXIT_OK;
        }
        if (option == OPT_VERSION) {
            puts("hm2lbp " HM2_VERSION);
            return OPTIONS_EXIT_OK;
        }
        if (take(options, option, optarg))
            return OPTIONS_EXIT_USAGE;
    }
    options->words = (const char *const *)(argv + optind);
    options->count = (unsigned)(argc - optind);
    if (!options->tty == !options->card) {
        fputs("hm2lbp: either --tty or --card must be given; see --help\n", stderr);
        return OPTIONS_EXIT_USAGE;
    }
    return read_environment(options) ? OPTIONS_EXIT_USAGE : OPTIONS_RUN;
}
