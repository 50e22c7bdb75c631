/* SPDX-License-Identifier: GPL-2.0-or-later */
/* hm2lbp: parameters and firmware of smart-serial remotes. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include <hm2/board.h>
#include <hm2/lbp_remote.h>

#include "../common/json_string.h"
#include "../common/whole_file.h"
#include "options.h"

struct session {
    struct options options;
    struct hm2_diag diag;
    struct link *link;
    struct lbp_client client;
    struct hm2_board *board;
    struct sslbp_port port;
    bool port_open;
    bool setup_baud; /* through a card: the remote has its set-up jumper in place */
    struct lbp_port_channel channel;
    struct lbp_remote remote;
};

/* ---- contact ------------------------------------------------------------------------------------------------------
 */

static int connect_tty(struct session *const s)
{
    const struct options *const o = &s->options;
    int err = link_tty_open(&s->link, o->tty, o->baud, &s->diag);
    if (err)
        return err;
    lbp_client_init(&s->client, s->link, o->tty, o->baud, &s->diag);
    err = lbp_client_identify(&s->client, (uint8_t)o->mode, &s->remote.identity);
    s->remote.access = lbp_client_access(&s->client);
    s->remote.name = o->tty;
    return err;
}

static int open_card(struct session *const s)
{
    const struct link_udp_options udp = {.address = s->options.card};
    struct link *link = NULL;
    int err = link_udp_open(&link, &udp, &s->diag);
    if (err)
        return err;
    s->board = hm2_board_new();
    if (!s->board) {
        link_close(link);
        return hm2_diag_add(&s->diag, HM2_ERR_NOMEM, "no memory for a card");
    }
    err = hm2_board_identify(s->board, link, &s->diag);
    return err ? err : hm2_board_undriven(s->board, &s->diag);
}

static int nobody(struct session *const s)
{
    return hm2_diag_add(&s->diag, HM2_ERR_TIMEOUT, "%s: no remote answers at port %u, channel %u%s.", s->port.name,
                        s->options.port, s->options.channel,
                        s->setup_baud ? ", at the 115200 baud of its set-up jumper" : "");
}

/* A set-up START waits for ever on an empty channel (traces): a normal one, which gives up, tells who is there. */
static int look_for_remote(struct session *const s, const uint8_t modes[SSLBP_CHANNELS])
{
    unsigned failed = 0;
    uint32_t cs = 0;
    int err = sslbp_port_start(&s->port, 1u << s->options.channel, false, modes, &failed);
    if (!err && failed)
        err = sslbp_port_cs(&s->port, s->options.channel, &cs);
    if (!err && failed && sslbp_status(cs, s->port.minor, false).status & SSLBP_NO_REMOTE)
        return nobody(s);
    return err;
}

/* Nothing is known of a normal START at the jumper's baud rate, for which its time-outs are short. */
static int start_channel(struct session *const s)
{
    uint8_t modes[SSLBP_CHANNELS] = {0};
    unsigned failed = 0;
    modes[s->options.channel] = (uint8_t)s->options.mode;
    int err = s->setup_baud ? 0 : look_for_remote(s, modes);
    if (!err)
        err = sslbp_port_start(&s->port, 1u << s->options.channel, true, modes, &failed);
    if (!err && failed && s->setup_baud)
        return nobody(s);
    if (!err && failed)
        return hm2_diag_add(&s->diag, HM2_ERR_TIMEOUT,
                            "%s: the remote at port %u, channel %u does not enter set-up mode.", s->port.name,
                            s->options.port, s->options.channel);
    return err;
}

static int connect_card(struct session *const s)
{
    int err = open_card(s);
    if (!err)
        err = hm2_board_sserial_open(s->board, s->options.port, &s->port, &s->diag);
    s->port_open = !err;
    if (!err && s->setup_baud)
        err = sslbp_port_baud(&s->port, LBP_SETUP_BAUD);
    if (!err)
        err = start_channel(s);
    s->channel = (struct lbp_port_channel){&s->port, s->options.channel};
    if (!err)
        err = lbp_port_identify(&s->channel, &s->remote.identity);
    s->remote.access = lbp_port_access(&s->channel);
    s->remote.name = s->options.card;
    return err;
}

static void disconnect(struct session *const s)
{
    if (s->port_open)
        hm2_board_sserial_close(s->board, &s->port);
    if (s->board)
        hm2_board_free(s->board);
    link_close(s->link);
}

/* ---- printing -----------------------------------------------------------------------------------------------------
 */

static const char *access_text(const struct sslbp_field *const field)
{
    return field->direction == SSLBP_INPUT ? "read" : field->direction == SSLBP_OUTPUT ? "write" : "both";
}

static void print_json_field(const struct sslbp_field *const field, const char *const value)
{
    printf("{\"name\": ");
    json_string(stdout, field->name);
    printf(", \"value\": \"%s\", \"bits\": %u, \"access\": \"%s\", \"nonvolatile\": %s, \"min\": %.9g, \"max\": %.9g, "
           "\"unit\": ",
           value, field->bits, access_text(field), sslbp_is_nonvolatile(field) ? "true" : "false", field->min,
           field->max);
    json_string(stdout, field->unit);
    putchar('}');
}

static void print_field(const struct session *const s, const struct sslbp_field *const field, const uint64_t raw,
                        const bool hex)
{
    char value[LBP_VALUE_TEXT];
    lbp_value_text(field, raw, hex, value);
    if (!s->options.json) {
        puts(value);
        return;
    }
    print_json_field(field, value);
    putchar('\n');
}

/* ---- commands -----------------------------------------------------------------------------------------------------
 */

static bool wants_hex(const struct session *const s, const unsigned at)
{
    return s->options.hex || (s->options.count > at && strcasecmp(s->options.words[at], "H") == 0);
}

static void begin_list(const struct session *const s)
{
    const struct lbp_identity *const identity = &s->remote.identity;
    if (!s->options.json) {
        printf("%s, unit number 0x%08X\n", identity->name, (unsigned)identity->unit);
        return;
    }
    printf("{\"card\": ");
    json_string(stdout, identity->name);
    printf(", \"unit\": %u, \"parameters\": [", (unsigned)identity->unit);
}

static void list_field(const struct session *const s, const struct sslbp_field *const field, const uint64_t raw,
                       const bool first)
{
    char value[LBP_VALUE_TEXT];
    lbp_value_text(field, raw, s->options.hex, value);
    if (s->options.json) {
        fputs(first ? "\n  " : ",\n  ", stdout);
        print_json_field(field, value);
        return;
    }
    printf("%-24s %-5s %3u bits  %s%s%s%s\n", field->name, access_text(field), field->bits, value,
           field->unit[0] ? " " : "", field->unit, sslbp_is_nonvolatile(field) ? "  (non-volatile)" : "");
}

static int list(struct session *const s)
{
    const struct sslbp_field *field;
    bool first = true;
    begin_list(s);
    for (unsigned i = 0; (field = lbp_remote_field(&s->remote, i)); i++) {
        uint64_t raw = 0;
        if (field->name[0] == '\0' || field->bits > 64)
            continue;
        const int err = lbp_remote_get(&s->remote, field, &raw);
        if (err)
            return err;
        list_field(s, field, raw, first);
        first = false;
    }
    if (s->options.json)
        puts("\n]}");
    return 0;
}

static int read_one(struct session *const s)
{
    const struct sslbp_field *field;
    uint64_t raw = 0;
    int err = lbp_remote_find(&s->remote, s->options.words[1], &field);
    if (!err)
        err = lbp_remote_get(&s->remote, field, &raw);
    if (!err)
        print_field(s, field, raw, wants_hex(s, 2));
    return err;
}

/* Without --yes a person at a terminal is asked; nobody else can say yes. */
static int confirm(struct session *const s, const char *const warning)
{
    char answer[16] = "";
    if (s->options.yes)
        return 0;
    if (!isatty(STDIN_FILENO))
        return hm2_diag_add(&s->diag, HM2_ERR_STATE, "%s Nothing was done; --yes permits it.", warning);
    fprintf(stderr, "%s Go on? [y/N] ", warning);
    if (fgets(answer, sizeof answer, stdin) && (answer[0] == 'y' || answer[0] == 'Y'))
        return 0;
    return hm2_diag_add(&s->diag, HM2_ERR_STATE, "Nothing was done.");
}

static int write_one(struct session *const s)
{
    const char *const text = s->options.words[2];
    const bool hex = wants_hex(s, 3);
    const struct sslbp_field *field;
    char warning[256];
    uint64_t raw = 0;
    int err = lbp_remote_find(&s->remote, s->options.words[1], &field);
    if (!err)
        err = lbp_remote_parse(&s->remote, field, text, hex, &raw);
    if (err)
        return err;
    snprintf(warning, sizeof warning,
             "%s is non-volatile: the change is permanent, and works from the next power-up on.", field->name);
    if (sslbp_is_nonvolatile(field))
        err = confirm(s, warning);
    if (!err)
        err = lbp_remote_put(&s->remote, field, raw);
    if (!err)
        err = lbp_remote_get(&s->remote, field, &raw);
    if (!err)
        print_field(s, field, raw, hex);
    return err;
}

/* ---- firmware -----------------------------------------------------------------------------------------------------
 */

/* The images carry nothing that tells what they are for but their names: 7I77.BIN is for a 7I77. */
static int check_name(struct session *const s, const char *const path)
{
    const char *const slash = strrchr(path, '/'), *const name = slash ? slash + 1 : path;
    const char *const card = s->remote.identity.name, *const suffix = strrchr(name, '.');
    if (s->options.any_image ||
        (strncasecmp(name, card, strlen(card)) == 0 && suffix && strcasecmp(suffix, ".BIN") == 0))
        return 0;
    return hm2_diag_add(
        &s->diag, HM2_ERR_MISMATCH,
        "%s: this remote is a %s, whose firmware is called %s....BIN. --any-image takes it all the same.", path, card,
        card);
}

static void show_progress(void *const context, const uint32_t done_bytes, const uint32_t all_bytes)
{
    (void)context;
    if (isatty(STDERR_FILENO))
        fprintf(stderr, "\r%u of %u bytes%s", (unsigned)done_bytes, (unsigned)all_bytes,
                done_bytes == all_bytes ? "\n" : "");
}

static int program(struct session *const s, const uint8_t *const image, const size_t len)
{
    struct lbp_flash flash;
    char warning[256];
    int err = lbp_remote_check_image(&s->remote, image, len, &flash);
    snprintf(warning, sizeof warning, "The firmware of this %s will be replaced.", s->remote.identity.name);
    if (!err)
        err = confirm(s, warning);
    if (!err)
        err = lbp_remote_update(&s->remote, &flash, image, len, show_progress, NULL);
    if (!err && s->options.json)
        printf("{\"bytes\": %zu, \"updated\": true}\n", len);
    else if (!err)
        printf("%zu bytes written. The new firmware runs from the next power-up on.\n", len);
    return err;
}

static int update(struct session *const s)
{
    const char *const path = s->options.words[1];
    int err = check_name(s, path);
    if (err)
        return err;
    size_t len;
    uint8_t *const image = whole_file(path, LBP_IMAGE_MAX, &len);
    if (!image && errno == EFBIG)
        return hm2_diag_add(&s->diag, HM2_ERR_MISMATCH, "%s is no firmware of a remote: expected up to %u bytes.", path,
                            (unsigned)LBP_IMAGE_MAX);
    if (!image)
        return hm2_diag_add(&s->diag, HM2_ERR_IO, "%s cannot be read: %s.", path, strerror(errno));
    err = program(s, image, len);
    free(image);
    return err;
}

/* ---- program ------------------------------------------------------------------------------------------------------
 */

static const struct command {
    const char *name;
    unsigned min, max; /* words */
    bool tables;
    int (*run)(struct session *session);
} commands[] = {
    {"list", 1, 1, true, list},
    {"read", 2, 3, true, read_one},
    {"write", 3, 4, true, write_one},
    {"update", 2, 2, false, update},
};

/* A third or fourth word can only be H. */
static const struct command *find_command(const struct options *const o)
{
    for (size_t i = 0; o->count > 0 && i < sizeof commands / sizeof commands[0]; i++) {
        const struct command *const c = &commands[i];
        if (strcmp(c->name, o->words[0]) != 0 || o->count < c->min || o->count > c->max)
            continue;
        return o->count > c->min && strcasecmp(o->words[c->min], "H") != 0 ? NULL : c;
    }
    return NULL;
}

static int exit_status(const int err)
{
    switch (err) {
    case 0:
        return 0;
    case HM2_ERR_TIMEOUT:
        return EXIT_NO_CONTACT;
    case HM2_ERR_INVALID:
    case HM2_ERR_RANGE:
    case HM2_ERR_NOTFOUND:
        return EXIT_USAGE;
    case HM2_ERR_STATE:
    case HM2_ERR_MISMATCH:
    case HM2_ERR_UNSUPPORTED:
        return EXIT_REFUSED;
    default:
        return EXIT_FAILED;
    }
}

int main(const int argc, char **const argv)
{
    static struct session s;
    switch (options_read(&s.options, argc, argv)) {
    case OPTIONS_EXIT_OK:
        return 0;
    case OPTIONS_EXIT_USAGE:
        return EXIT_USAGE;
    case OPTIONS_RUN:
        break;
    }
    const struct command *const command = find_command(&s.options);
    if (!command) {
        fputs("hm2lbp: expected list, read NAME [H], write NAME VALUE [H] or update FILE.BIN; see --help\n", stderr);
        return EXIT_USAGE;
    }
    s.remote.diag = &s.diag;
    s.setup_baud = command->run == update;
    int err = s.options.tty ? connect_tty(&s) : connect_card(&s);
    if (!err && command->tables)
        err = lbp_remote_discover(&s.remote);
    if (!err)
        err = command->run(&s);
    disconnect(&s);
    fflush(stdout);
    if (s.diag.len > 0)
        fprintf(stderr, "hm2lbp: %s", s.diag.text);
    return exit_status(err);
}
