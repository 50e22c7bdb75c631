/* SPDX-License-Identifier: GPL-2.0-or-later */
/* elbpcom: the console of the cards' manuals. A line of hexadecimal LBP16 is one datagram; the reply is printed. */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <hm2/lbp16.h>
#include <hm2/link.h>

#define DEFAULT_ADDRESS   "192.168.1.121" /* of the manuals (seed 000, "ELBPCOM"), as the time is */
#define DEFAULT_TIMEOUT_S 0.2
#define MAX_TIMEOUT_S     3600.0
#define NS_PER_S          1e9
#define MAX_STALE         4096u

enum { EXIT_NO_ANSWER = 1, EXIT_USAGE = 2, EXIT_LINK = 3 };

struct console {
    const char *address;
    double timeout_s;
    bool prompts; /* a person types */
    struct link *link;
};

/* ---- hexadecimal --------------------------------------------------------------------------------------------------
 */

static int digit(const char c)
{
    static const char digits[] = "0123456789abcdef";
    const char *const at = c ? strchr(digits, c >= 'A' && c <= 'F' ? c - 'A' + 'a' : c) : NULL;
    return at ? (int)(at - digits) : -1;
}

/* Up to the end or a comment; blanks may stand anywhere. NULL = good, else what is wrong. */
static const char *read_hex(const char *text, uint8_t data[LBP16_MAX_REQUEST_BYTES], size_t *const len)
{
    int high = -1;
    *len = 0;
    for (; *text && !strchr(";#\n", *text); text++) {
        if (strchr(" \t\r", *text))
            continue;
        const int value = digit(*text);
        if (value < 0)
            return "expected hexadecimal digits";
        if (high < 0) {
            high = value;
            continue;
        }
        if (*len == LBP16_MAX_REQUEST_BYTES)
            return "longer than a datagram to a card can be, 1472 bytes";
        data[(*len)++] = (uint8_t)(high << 4 | value);
        high = -1;
    }
    return high < 0 ? NULL : "an odd number of hexadecimal digits";
}

/* ---- exchange -----------------------------------------------------------------------------------------------------
 */

/* What the card will answer: the data of all reads before something that it cannot parse. */
static size_t expected_bytes(const uint8_t *const data, const size_t len)
{
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len, bytes = 0;
    bool truncated;
    lbp16_parser_init(&parser, data, len);
    while (lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated) == 1)
        if (!command.write)
            bytes += lbp16_data_bytes(&command);
    return bytes;
}

static void drop_late_replies(struct link *const link)
{
    uint8_t reply[LBP16_MAX_REPLY_BYTES];
    for (unsigned i = 0; i < MAX_STALE; i++)
        if (link_recv(link, reply, sizeof reply, 0) == HM2_ERR_TIMEOUT)
            return;
}

static void print_reply(const struct console *const console, const uint8_t *const reply, const int len)
{
    fputs(console->prompts ? "> " : "", stdout);
    for (int i = 0; i < len; i++)
        printf("%02x", reply[i]);
    putchar('\n');
}

static int exchange(const struct console *const console, const uint8_t *const data, const size_t len)
{
    uint8_t reply[LBP16_MAX_REPLY_BYTES];
    drop_late_replies(console->link);
    const int err = link_send(console->link, data, len);
    if (err) {
        fprintf(stderr, "elbpcom: the datagram cannot be sent to %s: %s\n", console->address, hm2_strerror(err));
        return EXIT_LINK;
    }
    if (expected_bytes(data, len) == 0)
        return 0; /* nothing but writes: the card does not answer */
    const int64_t deadline_ns = link_now_ns(console->link) + (int64_t)(console->timeout_s * NS_PER_S);
    const int got = link_recv(console->link, reply, sizeof reply, deadline_ns);
    if (got < 0) {
        puts("No answer");
        return EXIT_NO_ANSWER;
    }
    print_reply(console, reply, got);
    return 0;
}

/* One line, or one argument. Nothing is sent for an empty one. */
static int take(const struct console *const console, const char *const text, const char *const where)
{
    uint8_t data[LBP16_MAX_REQUEST_BYTES];
    size_t len;
    const char *const wrong = read_hex(text, data, &len);
    if (wrong) {
        fprintf(stderr, "elbpcom: %s \"%.*s\": %s, e.g. 01420001\n", where, (int)strcspn(text, "\n"), text, wrong);
        return EXIT_USAGE;
    }
    const int status = len > 0 ? exchange(console, data, len) : 0;
    fflush(stdout);
    return status;
}

/* ---- lines --------------------------------------------------------------------------------------------------------
 */

/* A person may go on after a mistake; a script must not, later lines may rely on what failed. */
static int converse(const struct console *const console)
{
    char *line = NULL;
    size_t size = 0;
    int status = 0;
    unsigned number = 0;
    while (status == 0 || console->prompts) {
        char where[32];
        if (console->prompts) {
            putchar('>');
            fflush(stdout);
        }
        if (getline(&line, &size, stdin) < 0)
            break;
        snprintf(where, sizeof where, "line %u", ++number);
        status = take(console, line, where);
    }
    free(line);
    if (console->prompts)
        putchar('\n');
    return console->prompts ? 0 : status;
}

static int run(struct console *const console, char **arguments)
{
    struct hm2_diag diag = {.len = 0};
    const struct link_udp_options options = {.address = console->address};
    if (link_udp_open(&console->link, &options, &diag)) {
        fprintf(stderr, "elbpcom: %s", diag.text);
        return EXIT_LINK;
    }
    int status = 0;
    if (!*arguments)
        status = converse(console);
    for (; *arguments && status == 0; arguments++)
        status = take(console, *arguments, "argument");
    link_close(console->link);
    return status;
}

/* ---- options ------------------------------------------------------------------------------------------------------
 */

static const char usage[] =
    "Usage: elbpcom [OPTION...] [HEX...]\n"
    "Send hexadecimal LBP16 to a Mesa Ethernet card and print its replies. Every HEX, or every\n"
    "line of standard input, is one datagram; what follows ; or # is a comment.\n"
    "\n"
    "  --ip ADDRESS[:PORT]  of the card (192.168.1.121)\n"
    "  --timeout SECONDS    wait so long for a reply (0.2; an erase needs 2)\n"
    "  --help, --version\n"
    "\n"
    "Exit status: 0, 1 = no answer, 2 = not hexadecimal, or wrong options, 3 = nothing can be sent.\n"
    "The card does what is sent: writes to its EEPROM and flash are as permanent as ever.\n";

static bool read_timeout(const char *const text, double *const seconds)
{
    char *end;
    errno = 0;
    *seconds = strtod(text, &end);
    return end != text && *end == '\0' && errno == 0 && isfinite(*seconds) && *seconds >= 0 &&
           *seconds <= MAX_TIMEOUT_S;
}

int main(const int argc, char **const argv)
{
    static const struct option options[] = {{"ip", required_argument, NULL, 'i'},
                                            {"timeout", required_argument, NULL, 't'},
                                            {"help", no_argument, NULL, 'h'},
                                            {"version", no_argument, NULL, 'V'},
                                            {NULL, 0, NULL, 0}};
    struct console console = {.address = DEFAULT_ADDRESS, .timeout_s = DEFAULT_TIMEOUT_S};
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        switch (option) {
        case 'i':
            console.address = optarg;
            break;
        case 't':
            if (read_timeout(optarg, &console.timeout_s))
                break;
            fprintf(stderr, "elbpcom: --timeout \"%s\": expected seconds, 0 to 3600\n", optarg);
            return EXIT_USAGE;
        case 'h':
            fputs(usage, stdout);
            return 0;
        case 'V':
            puts("elbpcom " HM2_VERSION);
            return 0;
        default:
            return EXIT_USAGE;
        }
    }
    console.prompts = isatty(STDIN_FILENO);
    return run(&console, argv + optind);
}
