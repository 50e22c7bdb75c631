/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2flash: program, verify, back up and inspect Ethernet cards; takes mesaflash's command lines. */
#include <ctype.h>
#include <errno.h>
#include <getopt.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/wait.h>
#include <unistd.h>

#include "cli.h"
#include "names.h"

#define MAX_CARDS   64u
#define RATHER_LONG 254u

volatile sig_atomic_t interrupted;

/* ---- tables ---------------------------------------------------------------------------------------------------------
 */

/* In mesaflash's order: of several commands in a line the first of these is done. */
static const struct command {
    const char *name, *argument; /* NULL = takes none */
    int (*run)(struct cli *cli, const char *arg);
    bool needs_card;
    const char *help;
} commands[] = {
    {"info", "FILE", do_info, false, "print what an image file says of itself"},
    {"discover", NULL, do_discover, false, "find cards at --addr and on the local networks"},
    {"readhmid", NULL, do_readhmid, true, "print the HostMot2 configuration (PIN file); with --xml as XML"},
    {"print-pd", NULL, do_print_pd, true, "print pin descriptors"},
    {"print-lio", NULL, do_print_lio, true, "print local I/O descriptors"},
    {"report", "FILE", do_report, true, "write a page (HTML) about the card, with its connectors drawn"},
    {"sserial", NULL, do_sserial, true, "print smart-serial ports; resets them"},
    {"rpo", "REGISTER", do_rpo, true, "read a HostMot2 register"},
    {"wpo", "REGISTER=VALUE", do_wpo, true, "write a HostMot2 register"},
    {"set", "NAME=VALUE", do_set, true, "store ip=, netmask= or ledmode= in the card's EEPROM"},
    {"enable-all-mod", NULL, do_enable_all, true, "give every pin with a module output to its module"},
    {"safe-io", NULL, do_safe_io, true, "make every pin an input, as after power-on"},
    {"write", "FILE", do_write, true, "write an image to the user area, or with --fallback to the other"},
    {"verify", "FILE", do_verify, true, "compare the flash with an image, or with a whole dump"},
    {"backup-flash", "FILE", do_backup, true, "save the whole flash to a file, or to a folder"},
    {"restore-flash", "FILE", do_restore, true, "write a whole dump; FILE.sha256 must be there"},
    {"program", "FILE", do_program, true, "not possible with Ethernet cards"},
    {"reload", NULL, do_reload, true, "start the FPGA from its flash again; also after --write"},
    {"reset", NULL, do_reset, true, "restart the card's LBP16 firmware"},
};

#define COMMANDS (sizeof commands / sizeof commands[0])

enum option_code {
    OPT_COMMAND = 1000, /* + index */
    OPT_DBNAME = 2000,  /* + connector */
    OPT_DEVICE = 1,
    OPT_ADDR,
    OPT_IGNORED,
    OPT_FALLBACK,
    OPT_XML,
    OPT_VERBOSE,
    OPT_FIX,
    OPT_NO_VERIFY,
    OPT_SHA256,
    OPT_JSON,
    OPT_DRY_RUN,
    OPT_OVERRIDE,
    OPT_CONFIRM,
    OPT_YES,
    OPT_EXPECT_MAC,
    OPT_PAGES,
    OPT_BACKUP_TO,
    OPT_KNOWN,
    OPT_ANY_TRAFFIC,
    OPT_VERSION,
    OPT_HELP,
};

static const struct plain_option {
    const char *name, *argument;
    int code;
    const char *help;
} plain_options[] = {
    {"device", "NAME", OPT_DEVICE, "the card's name, or ETHER for any"},
    {"addr", "ADDRESS[,...]", OPT_ADDR, "IP address of the card, or of several"},
    {"fallback", NULL, OPT_FALLBACK, "use the fallback area"},
    {"fix-boot-block", NULL, OPT_FIX, "with --write: repair a missing boot block"},
    {"no-auto-verify", NULL, OPT_NO_VERIFY, "do not read back what is written"},
    {"sha256-check", NULL, OPT_SHA256, "refuse to write without FILE.sha256"},
    {"dry-run", NULL, OPT_DRY_RUN, "check everything, print the plan, change nothing"},
    {"override", "CARD", OPT_OVERRIDE, "write an image that does not say it is for this card"},
    {"confirm", "WHAT", OPT_CONFIRM, "fallback: write it; outputs: reload although outputs are on"},
    {"yes", NULL, OPT_YES, "do not ask whether outputs may let go: they may"},
    {"expect-mac", "MAC", OPT_EXPECT_MAC, "refuse another card than this"},
    {"backup-to", "FOLDER", OPT_BACKUP_TO, "save the flash there before it is written"},
    {"known", "FILE", OPT_KNOWN, "list of images: SHA-256 and the card each is for"},
    {"pages", "N", OPT_PAGES, "most pages in a datagram, 1 to 5"},
    {"any-traffic", NULL, OPT_ANY_TRAFFIC, "do not look for other programs on the card"},
    {"dbname1", "NAME", OPT_DBNAME + 0, "daughter board at a connector, for --readhmid; also"},
    {"dbname2", "NAME", OPT_DBNAME + 1, "for the second connector"},
    {"dbname3", "NAME", OPT_DBNAME + 2, "for the third"},
    {"dbname4", "NAME", OPT_DBNAME + 3, "for the fourth"},
    {"dbname5", "NAME", OPT_DBNAME + 4, "for the fifth"},
    {"dbname6", "NAME", OPT_DBNAME + 5, "for the sixth"},
    {"xml", NULL, OPT_XML, "--readhmid as XML"},
    {"json", NULL, OPT_JSON, "one JSON object a card, on a line"},
    {"verbose", NULL, OPT_VERBOSE, "more detail"},
    {"addr_hi", "VALUE", OPT_IGNORED, "of other cards than Ethernet: ignored, as are"},
    {"epp", NULL, OPT_IGNORED, "this"},
    {"usb", NULL, OPT_IGNORED, "this"},
    {"spi", NULL, OPT_IGNORED, "this"},
    {"serial", NULL, OPT_IGNORED, "this"},
    {"recover", NULL, OPT_IGNORED, "and this"},
    {"version", NULL, OPT_VERSION, "print the version"},
    {"help", NULL, OPT_HELP, "print this text"},
};

#define PLAIN (sizeof plain_options / sizeof plain_options[0])

static void print_option(const char *const name, const char *const argument, const char *const help)
{
    char text[64];
    snprintf(text, sizeof text, "--%s%s%s", name, argument ? " " : "", argument ? argument : "");
    printf("  %-26s %s\n", text, help);
}

static void print_help(void)
{
    printf("hm2flash: program, verify, back up and inspect Mesa Ethernet cards\n\n"
           "usage: hm2flash --device NAME --addr ADDRESS [OPTION...] [COMMAND]\n"
           "       hm2flash --info FILE\n"
           "       hm2flash --discover [--addr ADDRESS[/24],...]\n\n"
           "Without a command the card is identified. Commands:\n");
    for (size_t i = 0; i < COMMANDS; i++)
        print_option(commands[i].name, commands[i].argument, commands[i].help);
    printf("\nOptions:\n");
    for (size_t i = 0; i < PLAIN; i++)
        print_option(plain_options[i].name, plain_options[i].argument, plain_options[i].help);
    printf("\nExit status: 0 done, 1 failed, 2 wrong command line, 3 refused and nothing changed,\n"
           "4 card not found or lost.\n");
}

/* ---- what is printed ------------------------------------------------------------------------------------------------
 */

void say(const struct cli *const cli, const char *const format, ...)
{
    va_list args;
    if (cli->json)
        return;
    va_start(args, format);
    vprintf(format, args);
    va_end(args);
}

static int status_of(const int err)
{
    switch (err) {
    case HM2_OK:
        return DONE;
    case HM2_ERR_TIMEOUT:
        return LOST;
    case HM2_ERR_IO:
    case HM2_ERR_NOMEM:
        return FAILED;
    case HM2_ERR_INVALID:
        return USAGE;
    default:
        return REFUSED;
    }
}

int report(struct cli *const cli, const int err)
{
    fflush(stdout);
    if (cli->diag.len > 0) {
        fprintf(stderr, "hm2flash: %s%s%s", cli->many ? cli->address : "", cli->many ? ": " : "", cli->diag.text);
        json_problem(cli->diag.text);
    }
    hm2_diag_clear(&cli->diag);
    return status_of(err);
}

int complain(const struct cli *const cli, const int status, const char *const format, ...)
{
    char text[1024];
    va_list args;
    fflush(stdout);
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    fprintf(stderr, "hm2flash: %s%s%s\n", cli->many ? cli->address : "", cli->many ? ": " : "", text);
    json_problem(text);
    return status;
}

const char *card_name(const struct cli *const cli)
{
    return cli->info->board ? cli->info->board->device : cli->info->card_name;
}

/* ---- finding the card -----------------------------------------------------------------------------------------------
 */

static bool any_device(const char *const device)
{
    return strncmp(device, "ETHER", 5) == 0 || strncmp(device, "AUTO", 4) == 0 || strncmp(device, "SPI", 3) == 0;
}

static int not_found(const struct cli *const cli)
{
    say(cli, "No %s board found\n", cli->device);
    return LOST;
}

static int unsupported(const struct cli *const cli)
{
    const struct flash_board *board;
    say(cli, "ERROR: Unsupported device %s\nSupported card names are:", cli->device);
    for (size_t i = 0; (board = flash_board_at(i)) != NULL; i++)
        say(cli, "%s%10s,", i % 6 ? "" : "\n", board->device);
    say(cli, "\n");
    (void)not_found(cli);
    return USAGE;
}

static int check_mac(struct cli *const cli)
{
    const uint8_t *const m = cli->info->mac;
    char text[32];
    snprintf(text, sizeof text, "%02x:%02x:%02x:%02x:%02x:%02x", m[0], m[1], m[2], m[3], m[4], m[5]);
    if (!cli->expect_mac || strcasecmp(cli->expect_mac, text) == 0)
        return DONE;
    return complain(cli, REFUSED, "the card at %s has the MAC address %s, not %s", cli->address, text, cli->expect_mac);
}

static int open_card(struct cli *const cli)
{
    if (!any_device(cli->device) && !flash_board_named(cli->device))
        return unsupported(cli);
    if (!cli->address) {
        say(cli, "You must supply an IP address for Ethernet cards\n");
        (void)not_found(cli);
        return complain(cli, USAGE, "give --addr ADDRESS; --discover lists the cards that answer");
    }
    const struct link_udp_options options = {.address = cli->address};
    int err = link_udp_open(&cli->link, &options, &cli->diag);
    if (err == 0)
        err = flash_card_new(&cli->card, cli->link, &cli->diag);
    if (err < 0) {
        (void)not_found(cli);
        const int status = report(cli, err);
        return status == LOST ? LOST : USAGE;
    }
    cli->info = flash_card_info(cli->card);
    if (!cli->info->board)
        complain(cli, 0,
                 "this program does not know the card \"%s\" (FPGA of %u thousand gates): it can be read, not written",
                 cli->info->card_name, (unsigned)cli->info->image.rom[5]);
    if (!any_device(cli->device) && strcmp(cli->device, card_name(cli)) != 0) {
        (void)not_found(cli);
        return complain(cli, REFUSED, "the card at %s is a %s, not a %s", cli->address, card_name(cli), cli->device);
    }
    return check_mac(cli);
}

static void close_card(struct cli *const cli)
{
    flash_card_free(cli->card);
    link_close(cli->link);
}

/* At a terminal only, and not for one of several cards, which would all ask at the same time. */
static bool answered_yes(const struct cli *const cli)
{
    char answer[16];
    if (cli->many || cli->json || !isatty(STDIN_FILENO) || !isatty(STDERR_FILENO))
        return false;
    fprintf(stderr, "Is the machine safe, shall this go on? [y/N] ");
    return fgets(answer, sizeof answer, stdin) && (strcasecmp(answer, "y\n") == 0 || strcasecmp(answer, "yes\n") == 0);
}

bool confirmed(struct cli *const cli)
{
    cli->confirm_outputs = cli->confirm_outputs || answered_yes(cli);
    if (!cli->confirm_outputs)
        (void)complain(cli, 0, "nothing was changed. See that the machine is safe, then add --yes");
    return cli->confirm_outputs;
}

int check_alone(struct cli *const cli)
{
    return cli->any_traffic ? DONE : report(cli, flash_card_quiet(cli->card, &cli->diag));
}

int look_at_flash(struct cli *const cli, struct flash_survey *const survey)
{
    const int err = cli->any_traffic ? 0 : flash_card_quiet(cli->card, &cli->diag);
    return err < 0 ? err : flash_card_survey(cli->card, survey, &cli->diag);
}

int check_machine(struct cli *const cli, const char *const what)
{
    const int status = check_alone(cli);
    if (status != DONE)
        return status;
    const int outputs = flash_card_outputs(cli->card, &cli->diag);
    if (outputs < 0)
        return report(cli, outputs);
    if (outputs == 0)
        return DONE;
    (void)complain(cli, 0, "%u pins of the card are outputs. %s lets go of all of them, and they float high",
                   (unsigned)outputs, what);
    return confirmed(cli) ? DONE : REFUSED;
}

/* ---- one run --------------------------------------------------------------------------------------------------------
 */

struct request {
    const struct command *command; /* NULL = identify */
    const char *argument;
};

static int run_one(struct cli *const cli, const struct request *const request)
{
    const struct command *const command = request->command;
    int status = !command || command->needs_card ? open_card(cli) : DONE;
    if (status == DONE)
        status = command ? command->run(cli, request->argument) : do_identify(cli, NULL);
    if (status != DONE)
        json_failure(cli, status);
    close_card(cli);
    return fflush(stdout) == 0 ? status : FAILED;
}

/* What a child printed, each line with its card in front; JSON has that inside. */
static void relay(const int fd, const struct cli *const cli, const char *const address)
{
    FILE *const from = fdopen(fd, "r");
    char line[4096];
    while (from && fgets(line, sizeof line, from)) {
        if (cli->json)
            fputs(line, stdout);
        else if (line[0] != '\n')
            printf("%s: %s", address, line);
    }
    if (from)
        fclose(from);
    fflush(stdout);
}

/* Each card has a process of its own, so that none waits for another. */
static int run_many(struct cli *const cli, const struct request *const request, char *const addresses)
{
    struct {
        pid_t pid;
        int output;
        const char *address;
    } cards[MAX_CARDS];
    unsigned count = 0;
    int worst = DONE;
    char *rest = NULL;
    for (char *one = strtok_r(addresses, ",", &rest); one && count < MAX_CARDS; one = strtok_r(NULL, ",", &rest)) {
        int ends[2];
        if (pipe(ends) != 0)
            return complain(cli, FAILED, "pipe: %s", strerror(errno));
        fflush(stdout);
        const pid_t pid = fork();
        if (pid == 0) {
            dup2(ends[1], STDOUT_FILENO);
            close(ends[0]);
            close(ends[1]);
            cli->many = true;
            cli->address = one;
            exit(run_one(cli, request));
        }
        close(ends[1]);
        if (pid < 0)
            return complain(cli, FAILED, "fork: %s", strerror(errno));
        cards[count].pid = pid;
        cards[count].output = ends[0];
        cards[count++].address = one;
    }
    for (unsigned i = 0; i < count; i++) {
        int status = 0;
        relay(cards[i].output, cli, cards[i].address);
        (void)waitpid(cards[i].pid, &status, 0);
        const int code = WIFEXITED(status) ? WEXITSTATUS(status) : FAILED;
        worst = code > worst ? code : worst;
    }
    return worst;
}

/* ---- command line ---------------------------------------------------------------------------------------------------
 */

static void upper(char *const to, const size_t size, const char *const from)
{
    size_t i = 0;
    for (; from[i] && i + 1 < size; i++)
        to[i] = (char)toupper((unsigned char)from[i]);
    to[i] = '\0';
}

static int take_dbname(struct cli *const cli, const unsigned connector, const char *const name)
{
    const struct hm2_terminals *table = hm2_terminals_find(name);
    if (table) {
        cli->dbnames[connector] = table->name; /* in capitals, however it was given */
        return DONE;
    }
    printf("--dbname%u %s not recognized\nValid daughterboard names are:\n", connector + 1, name);
    for (size_t i = 0; (table = hm2_terminals_at(i)) != NULL; i++)
        printf("%10s,%s", table->name, i % 6 == 5 ? "\n" : "");
    printf("\n");
    return USAGE;
}

static int take_confirm(struct cli *const cli, const char *const what)
{
    if (strcmp(what, "fallback") == 0)
        cli->confirm_fallback = true;
    else if (strcmp(what, "outputs") == 0)
        cli->confirm_outputs = true;
    else
        return complain(cli, USAGE, "--confirm %s: expected \"fallback\" or \"outputs\"", what);
    return DONE;
}

static int take_pages(struct cli *const cli, const char *const text)
{
    if (text[0] < '1' || text[0] > '5' || text[1])
        return complain(cli, USAGE, "--pages %s: expected 1 to 5", text);
    cli->pages = (unsigned)(text[0] - '0');
    return DONE;
}

static int take_option(struct cli *const cli, const int code, const char *const arg)
{
    const struct {
        int code;
        bool *flag;
    } flags[] = {{OPT_FALLBACK, &cli->fallback},   {OPT_XML, &cli->xml},
                 {OPT_VERBOSE, &cli->verbose},     {OPT_FIX, &cli->fix_boot_block},
                 {OPT_NO_VERIFY, &cli->no_verify}, {OPT_SHA256, &cli->sha256_check},
                 {OPT_JSON, &cli->json},           {OPT_DRY_RUN, &cli->dry_run},
                 {OPT_YES, &cli->confirm_outputs}, {OPT_ANY_TRAFFIC, &cli->any_traffic}};
    const struct {
        int code;
        const char **text;
    } texts[] = {{OPT_OVERRIDE, &cli->override},
                 {OPT_EXPECT_MAC, &cli->expect_mac},
                 {OPT_BACKUP_TO, &cli->backup_to},
                 {OPT_KNOWN, &cli->known}};
    for (size_t i = 0; i < sizeof flags / sizeof flags[0]; i++)
        if (code == flags[i].code)
            *flags[i].flag = true;
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        if (code == texts[i].code)
            *texts[i].text = arg;
    if (code == OPT_CONFIRM)
        return take_confirm(cli, arg);
    if (code == OPT_PAGES)
        return take_pages(cli, arg);
    if (code >= OPT_DBNAME)
        return take_dbname(cli, (unsigned)(code - OPT_DBNAME), arg);
    return DONE;
}

static void make_options(struct option options[const COMMANDS + PLAIN + 1])
{
    for (size_t i = 0; i < COMMANDS; i++)
        options[i] = (struct option){commands[i].name, commands[i].argument ? required_argument : no_argument, NULL,
                                     OPT_COMMAND + (int)i};
    for (size_t i = 0; i < PLAIN; i++)
        options[COMMANDS + i] =
            (struct option){plain_options[i].name, plain_options[i].argument ? required_argument : no_argument, NULL,
                            plain_options[i].code};
    options[COMMANDS + PLAIN] = (struct option){0};
}

struct parsed {
    const char *arguments[COMMANDS];
    bool given[COMMANDS];
    char *addresses;
    bool help, version;
};

static int once(const struct cli *const cli, const bool before, const char *const name)
{
    return before ? complain(cli, USAGE, "Error: multiple --%s options", name) : DONE;
}

static int take_command(const struct cli *const cli, struct parsed *const parsed, const size_t index,
                        const char *const arg)
{
    if (arg && parsed->given[index])
        return once(cli, true, commands[index].name);
    if (arg && strlen(arg) > RATHER_LONG)
        return complain(cli, USAGE, "--%s argument too long (max %u)", commands[index].name, RATHER_LONG);
    parsed->given[index] = true;
    parsed->arguments[index] = arg;
    return DONE;
}

static int parse(struct cli *const cli, const int argc, char **const argv, struct parsed *const parsed)
{
    struct option options[COMMANDS + PLAIN + 1];
    int code, status = DONE;
    make_options(options);
    while (status == DONE && (code = getopt_long_only(argc, argv, "", options, NULL)) != -1) {
        if (code == '?')
            return USAGE;
        if (code == OPT_HELP)
            parsed->help = true;
        else if (code == OPT_VERSION)
            parsed->version = true;
        else if (code == OPT_DEVICE) {
            status = once(cli, cli->device[0] != '\0', "device");
            upper(cli->device, sizeof cli->device, optarg);
        } else if (code == OPT_ADDR) {
            status = once(cli, parsed->addresses != NULL, "addr");
            parsed->addresses = optarg;
        } else if (code >= OPT_COMMAND && code < OPT_COMMAND + (int)COMMANDS) {
            status = take_command(cli, parsed, (size_t)(code - OPT_COMMAND), optarg);
        } else {
            status = take_option(cli, code, optarg);
        }
    }
    if (status == DONE && optind < argc)
        return complain(cli, USAGE, "unexpected argument '%s'; see --help", argv[optind]);
    return status;
}

static struct request choose(const struct parsed *const parsed, struct cli *const cli)
{
    struct request request = {NULL, NULL};
    for (size_t i = COMMANDS; i-- > 0;)
        if (parsed->given[i]) {
            cli->reload = cli->reload || commands[i].run == do_reload;
            request = (struct request){&commands[i], parsed->arguments[i]};
        }
    return request;
}

static void print_version(const char *const program)
{
    const char *const slash = strrchr(program, '/');
    if (strcmp(slash ? slash + 1 : program, "mesaflash") == 0)
        puts("Mesaflash version 3.5.16 (hm2flash " HM2_VERSION ")");
    else
        puts("hm2flash " HM2_VERSION);
}

static void on_signal(const int number)
{
    (void)number;
    interrupted = 1;
}

int main(const int argc, char **const argv)
{
    static struct cli cli;
    struct parsed parsed = {0};
    const struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESTART};
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    const int status = parse(&cli, argc, argv, &parsed);
    if (status != DONE)
        return status;
    if (parsed.help || parsed.version || argc == 1) {
        if (parsed.help)
            print_help();
        else
            print_version(argv[0]);
        if (argc == 1)
            puts("Programs and inspects Mesa Ethernet cards. Try --help.");
        return DONE;
    }
    const struct request request = choose(&parsed, &cli);
    cli.address = parsed.addresses;
    const bool needs_card = !request.command || request.command->needs_card;
    if (needs_card && cli.device[0] == '\0') {
        if (!parsed.addresses) {
            puts("No action requested. Please specify at least --device or --info.");
            return USAGE;
        }
        snprintf(cli.device, sizeof cli.device, "ETHER");
    }
    if (needs_card && parsed.addresses && strchr(parsed.addresses, ','))
        return run_many(&cli, &request, parsed.addresses);
    return run_one(&cli, &request);
}
