/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "options.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <getopt.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/lbp16.h>

#include "faults.h"
#include "sserial.h"
#include "words.h"

#define NS_PER_S              1e9
#define NS_PER_MS             1e6
#define MAX_SECONDS           1e6
#define DEFAULT_PRIORITY      50
#define ADDRESS_CHARACTERS    32
#define MAX_PATTERN_PERIOD_MS 1e6
#define MAX_TIME_CONSTANT_MS  1e5
#define MS_PER_S              1e3

/* ---- single options -----------------------------------------------------------------------------------------------
 */

/* The options of a card stand behind its --card; those before the first one hold for every card. */
struct reading {
    struct options *options;
    struct card_options shared;
    struct card_options *card; /* that the next option is for */
    struct in_addr bind;
    uint16_t port;
    bool own_address[MAX_CARDS];
    struct hm2_diag diag;
};

static int refuse(struct reading *const r, const char *const option, const char *const value, const char *const wanted)
{
    return hm2_diag_add(&r->diag, HM2_ERR_INVALID, "%s \"%s\": expected %s", option, value, wanted);
}

static int set_address(struct reading *const r, const char *const value)
{
    if (inet_pton(AF_INET, value, &r->bind) != 1)
        return refuse(r, "--bind", value, "an IPv4 address such as 127.0.0.1");
    return 0;
}

static int set_port(struct reading *const r, const char *const value)
{
    unsigned long port;
    if (!whole_unsigned(value, UINT16_MAX, &port))
        return refuse(r, "--port", value, "a port number, 0 to 65535 (0 = any free one)");
    r->port = (uint16_t)port;
    return 0;
}

static bool known_type(const char *const name, const size_t len, const char **const type)
{
    for (const char *const *known = sim_profiles(); *known; known++) {
        if (strncmp(*known, name, len) == 0 && (*known)[len] == '\0') {
            *type = *known;
            return true;
        }
    }
    return false;
}

/* TYPE[@ADDRESS[:PORT]] */
static int add_card(struct reading *const r, const char *const value)
{
    struct options *const o = r->options;
    const size_t type_len = strcspn(value, "@");
    if (o->card_count == MAX_CARDS)
        return refuse(r, "--card", value, "at most 32 cards");
    struct card_options card = r->shared;
    if (!known_type(value, type_len, &card.type))
        return refuse(r, "--card", value, "TYPE[@ADDRESS[:PORT]] with a type that hm2sim --help lists");
    if (value[type_len] == '@') {
        char address[ADDRESS_CHARACTERS];
        const char *const start = value + type_len + 1;
        const size_t address_len = strcspn(start, ":");
        unsigned long port = LBP16_UDP_PORT;
        if (address_len >= sizeof address)
            return refuse(r, "--card", value, "an IPv4 address behind the @");
        memcpy(address, start, address_len);
        address[address_len] = '\0';
        if (inet_pton(AF_INET, address, &card.address) != 1)
            return refuse(r, "--card", value, "an IPv4 address behind the @");
        if (start[address_len] == ':' && !whole_unsigned(start + address_len + 1, UINT16_MAX, &port))
            return refuse(r, "--card", value, "a port number behind the colon");
        card.port = (uint16_t)port;
        r->own_address[o->card_count] = true;
    }
    r->card = &o->cards[o->card_count++];
    *r->card = card;
    return 0;
}

static const char *find_name(const char *const *names, const char *const name)
{
    for (; *names; names++)
        if (strcmp(*names, name) == 0)
            return *names;
    return NULL;
}

/* REMOTE@PATH */
static int add_serial(struct reading *const r, const char *const value)
{
    struct options *const o = r->options;
    char name[ADDRESS_CHARACTERS];
    const size_t len = strcspn(value, "@");
    if (o->serial_count == MAX_SERIALS)
        return refuse(r, "--serial", value, "at most 8 remotes");
    memcpy(name, value, len < sizeof name ? len : 0);
    name[len < sizeof name ? len : 0] = '\0';
    const char *const remote = find_name(remote_names(), name);
    if (!remote || value[len] != '@' || value[len + 1] == '\0')
        return refuse(r, "--serial", value, "REMOTE@PATH with a remote that hm2sim --help lists");
    o->serials[o->serial_count++] = (struct serial_option){remote, value + len + 1};
    return 0;
}

static bool read_mac(const char *text, uint8_t mac[const 6])
{
    for (unsigned i = 0; i < 6; i++) {
        char *end;
        if (!isxdigit((unsigned char)*text))
            return false;
        const unsigned long byte = strtoul(text, &end, 16);
        if (byte > UINT8_MAX || end - text > 2 || *end != (i < 5 ? ':' : '\0'))
            return false;
        mac[i] = (uint8_t)byte;
        text = end + 1;
    }
    return true;
}

static int set_mac(struct reading *const r, const char *const value)
{
    return read_mac(value, r->card->mac) ? 0 : refuse(r, "--mac", value, "six bytes such as 00:60:1b:12:34:56");
}

static int add_wire(struct reading *const r, const char *const value)
{
    unsigned long from, to;
    const char *end;
    if (!read_unsigned(value, HM2_MAX_PINS, &end, &from) || *end != ':' || !whole_unsigned(end + 1, HM2_MAX_PINS, &to))
        return refuse(r, "--wire", value, "FROM:TO, two I/O numbers");
    if (r->card->wire_count == MAX_WIRES)
        return refuse(r, "--wire", value, "at most 32 wires a card");
    r->card->wires[r->card->wire_count++] = (struct wire){(unsigned)from, (unsigned)to};
    return 0;
}

static int add_follower(struct reading *const r, const char *const value)
{
    static const char wanted[] = "ENCODER:STEPGEN or ENCODER:STEPGEN:NUM/DEN";
    unsigned long encoder, stepgen;
    const char *end;
    struct follower f = {.num = 1, .den = 1};
    if (!read_unsigned(value, UINT8_MAX, &end, &encoder) || *end != ':' ||
        !read_unsigned(end + 1, UINT8_MAX, &end, &stepgen))
        return refuse(r, "--follow", value, wanted);
    if (*end != '\0' && (*end != ':' || !read_ratio(end + 1, &end, &f.num, &f.den) || *end != '\0'))
        return refuse(r, "--follow", value, wanted);
    if (r->card->follower_count == MAX_WIRES)
        return refuse(r, "--follow", value, "at most 32 followers a card");
    f.encoder = (unsigned)encoder;
    f.stepgen = (unsigned)stepgen;
    r->card->followers[r->card->follower_count++] = f;
    return 0;
}

bool options_level(const char letter, enum sim_level *const level)
{
    static const char letters[] = "01zh";
    static const enum sim_level levels[] = {SIM_LOW, SIM_HIGH, SIM_FLOAT, SIM_PULLUP};
    const char *const at = letter ? strchr(letters, letter) : NULL;
    if (!at)
        return false;
    *level = levels[at - letters];
    return true;
}

/* ENCODER:PWMGEN:COUNTS */
static int add_motor(struct reading *const r, const char *const value)
{
    unsigned long encoder, pwmgen;
    long counts;
    const char *at;
    if (!read_unsigned(value, UINT8_MAX, &at, &encoder) || *at != ':' ||
        !read_unsigned(at + 1, UINT8_MAX, &at, &pwmgen) || *at != ':' ||
        !read_signed(at + 1, INT32_MAX, &at, &counts) || *at != '\0')
        return refuse(r, "--motor", value, "ENCODER:PWMGEN:COUNTS, counts a second at full duty");
    if (r->card->motor_count == MAX_WIRES)
        return refuse(r, "--motor", value, "at most 32 motors a card");
    r->card->motors[r->card->motor_count++] = (struct motor){(unsigned)encoder, (unsigned)pwmgen, (int32_t)counts};
    return 0;
}

/* CHANNEL:TURNS[:PWMGEN:SPEED] */
static int add_resolver(struct reading *const r, const char *const value)
{
    static const char wanted[] = "CHANNEL:TURNS or CHANNEL:TURNS:PWMGEN:SPEED, turns a second at full duty";
    struct resolver_option new = {.turns_per_s = 0};
    unsigned long channel, pwmgen = 0;
    const char *at;
    if (!read_unsigned(value, UINT8_MAX, &at, &channel) || *at != ':' ||
        !read_real(at + 1, -SIM_RESOLVER_TURNS, SIM_RESOLVER_TURNS, &at, &new.turns))
        return refuse(r, "--resolver", value, wanted);
    if (*at != '\0' && (*at != ':' || !read_unsigned(at + 1, UINT8_MAX, &at, &pwmgen) || *at != ':' ||
                        !whole_real(at + 1, -SIM_RESOLVER_TURNS, SIM_RESOLVER_TURNS, &new.turns_per_s)))
        return refuse(r, "--resolver", value, wanted);
    if (r->card->resolver_count == MAX_WIRES)
        return refuse(r, "--resolver", value, "at most 32 resolvers a card");
    new.channel = (unsigned)channel;
    new.pwmgen = (unsigned)pwmgen;
    r->card->resolvers[r->card->resolver_count++] = new;
    return 0;
}

/* uart.N:TARGET or pktuart.N:TARGET */
static int add_uart(struct reading *const r, const char *const value)
{
    const bool pkt = strncmp(value, "pktuart.", 8) == 0;
    unsigned long unit;
    const char *at;
    if ((!pkt && strncmp(value, "uart.", 5) != 0) || !read_unsigned(value + (pkt ? 8 : 5), UINT8_MAX, &at, &unit) ||
        *at != ':' || at[1] == '\0' || strlen(at + 1) >= UART_PATH)
        return refuse(r, "--uart", value, "uart.N:TARGET or pktuart.N:TARGET, TARGET loop or a path");
    if (r->card->uart_count == MAX_UARTS)
        return refuse(r, "--uart", value, "at most 16 serial ports a card");
    r->card->uarts[r->card->uart_count++] = (struct uart_option){
        .gtag = pkt ? HM2_GTAG_PKTUART_TX : HM2_GTAG_UART_TX, .unit = (unsigned)unit, .target = at + 1};
    return 0;
}

static int set_servo_card(struct reading *const r, const char *const value)
{
    unsigned long port;
    if (!whole_unsigned(value, UINT8_MAX, &port))
        return refuse(r, "--7i65", value, "the number of a buffered SPI port");
    r->card->has_servo_card = true;
    r->card->servo_port = (unsigned)port;
    return 0;
}

/* ENCODER:OUTPUT:COUNTS[:MS] */
static int add_servo_card_motor(struct reading *const r, const char *const value)
{
    unsigned long encoder, channel;
    long counts;
    double ms = 0;
    const char *at;
    if (!read_unsigned(value, UINT8_MAX, &at, &encoder) || *at != ':' ||
        !read_unsigned(at + 1, UINT8_MAX, &at, &channel) || *at != ':' ||
        !read_signed(at + 1, INT32_MAX, &at, &counts) || (*at != ':' && *at != '\0') ||
        (*at == ':' && !whole_real(at + 1, 0, MAX_TIME_CONSTANT_MS, &ms)))
        return refuse(r, "--7i65-motor", value, "ENCODER:OUTPUT:COUNTS[:MILLISECONDS], such as 0:0:100000:20");
    if (r->card->servo_card_motor_count == MAX_WIRES)
        return refuse(r, "--7i65-motor", value, "at most 32 motors a card");
    r->card->servo_card_motors[r->card->servo_card_motor_count++] =
        (struct servo_card_motor){(unsigned)encoder, (unsigned)channel, (int32_t)counts, ms / MS_PER_S};
    return 0;
}

/* READER:KEY=VALUE,... */
static int add_absolute(struct reading *const r, const char *const value)
{
    if (r->card->absolute_count == MAX_ABSOLUTES)
        return refuse(r, "--absolute", value, "at most 32 absolute encoders a card");
    return absolute_option(value, &r->card->absolutes[r->card->absolute_count++], &r->diag);
}

/* ENCODER:COUNTS */
static int add_index(struct reading *const r, const char *const value)
{
    unsigned long encoder, counts;
    const char *at;
    if (!read_unsigned(value, UINT8_MAX, &at, &encoder) || *at != ':' || !whole_unsigned(at + 1, INT32_MAX, &counts) ||
        counts == 0)
        return refuse(r, "--index", value, "ENCODER:COUNTS, from one index to the next");
    if (r->card->index_count == MAX_WIRES)
        return refuse(r, "--index", value, "at most 32 encoders with an index a card");
    r->card->indices[r->card->index_count++] = (struct encoder_index){(unsigned)encoder, (uint32_t)counts};
    return 0;
}

/* IO:AXIS:POSITION:LEVELS */
static int add_switch(struct reading *const r, const char *const value)
{
    struct position_switch s;
    unsigned long io;
    long position;
    const char *at;
    if (!read_unsigned(value, HM2_MAX_PINS, &at, &io) || *at != ':' || !read_axis(at + 1, &at, &s.gtag, &s.unit) ||
        *at != ':' || !read_signed(at + 1, INT32_MAX, &at, &position) || *at != ':' || strlen(at + 1) != 2 ||
        !options_level(at[1], &s.below) || !options_level(at[2], &s.above))
        return refuse(r, "--switch", value,
                      "IO:AXIS:POSITION:LEVELS, an axis such as stepgen.0 or encoder.0, and two of the levels 0, 1, z, "
                      "h: below the position, and from there on");
    if (r->card->switch_count == MAX_WIRES)
        return refuse(r, "--switch", value, "at most 32 switches a card");
    s.io = (unsigned)io;
    s.position = position;
    r->card->switches[r->card->switch_count++] = s;
    return 0;
}

/* IO:LEVELS[:MS] */
static int add_pattern(struct reading *const r, const char *const value)
{
    static const char wanted[] = "IO:LEVELS[:MILLISECONDS], levels being 0, 1, z, h";
    unsigned long io;
    const char *at;
    struct pattern p = {.step_ns = 0};
    if (r->card->pattern_count == MAX_PATTERNS)
        return refuse(r, "--drive", value, "at most 32 driven pads a card");
    if (!read_unsigned(value, HM2_MAX_PINS, &at, &io) || *at != ':')
        return refuse(r, "--drive", value, wanted);
    p.io = (unsigned)io;
    for (at++; *at && *at != ':'; at++)
        if (p.count == PATTERN_BITS || !options_level(*at, &p.levels[p.count++]))
            return refuse(r, "--drive", value, wanted);
    double ms = 0;
    if (*at == ':' && !whole_real(at + 1, 0.1, MAX_PATTERN_PERIOD_MS, &ms))
        return refuse(r, "--drive", value, "0.1 to 1e6 milliseconds for each level");
    if (p.count == 0 || (p.count > 1 && ms <= 0))
        return refuse(r, "--drive", value, wanted);
    p.step_ns = (int64_t)(ms * NS_PER_MS);
    r->card->patterns[r->card->pattern_count++] = p;
    return 0;
}

/* PORT:CHANNEL=CARD */
static int add_remote(struct reading *const r, const char *const value)
{
    static const char wanted[] = "PORT:CHANNEL=CARD, such as 0:0=7i77, with a card that hm2sim --help lists";
    unsigned long port, channel;
    const char *at;
    if (!read_unsigned(value, UINT8_MAX, &at, &port) || *at != ':' ||
        !read_unsigned(at + 1, UINT8_MAX, &at, &channel) || *at != '=')
        return refuse(r, "--remote", value, wanted);
    const char *card = find_name(sim_sserial_cards(), at + 1);
    if (!card)
        card = find_name(remote_names(), at + 1);
    if (!card)
        return refuse(r, "--remote", value, wanted);
    if (r->card->remote_count == MAX_REMOTES)
        return refuse(r, "--remote", value, "at most 32 remotes a card");
    r->card->remotes[r->card->remote_count++] = (struct remote_option){(unsigned)port, (unsigned)channel, card};
    return 0;
}

/* ENCODER:PORT:CHANNEL:OUTPUT:COUNTS[:MS] */
static int add_servo(struct reading *const r, const char *const value)
{
    static const char wanted[] =
        "ENCODER:PORT:CHANNEL:OUTPUT:COUNTS[:MILLISECONDS], such as 0:0:1:AnalogOut0:100000:20";
    struct servo s = {.time_constant_s = 0};
    unsigned long encoder, port, channel;
    long counts;
    double ms = 0;
    const char *at;
    if (!read_unsigned(value, UINT8_MAX, &at, &encoder) || *at != ':' ||
        !read_unsigned(at + 1, UINT8_MAX, &at, &port) || *at != ':' ||
        !read_unsigned(at + 1, UINT8_MAX, &at, &channel) || *at != ':')
        return refuse(r, "--servo", value, wanted);
    const size_t len = strcspn(++at, ":");
    if (len == 0 || len >= sizeof s.output || at[len] != ':')
        return refuse(r, "--servo", value, wanted);
    memcpy(s.output, at, len);
    if (!read_signed(at + len + 1, INT32_MAX, &at, &counts) || (*at != ':' && *at != '\0') ||
        (*at == ':' && !whole_real(at + 1, 0, MAX_TIME_CONSTANT_MS, &ms)))
        return refuse(r, "--servo", value, wanted);
    if (r->card->servo_count == MAX_WIRES)
        return refuse(r, "--servo", value, "at most 32 servos a card");
    s.encoder = (unsigned)encoder;
    s.port = (unsigned)port;
    s.channel = (unsigned)channel;
    s.counts_per_s = (int32_t)counts;
    s.time_constant_s = ms / MS_PER_S;
    r->card->servos[r->card->servo_count++] = s;
    return 0;
}

/* ---- the command line ---------------------------------------------------------------------------------------------
 */

enum {
    OPT_CARD = 256,
    OPT_BIND,
    OPT_PORT,
    OPT_SEED,
    OPT_FIRMWARE,
    OPT_NAME,
    OPT_SOURCES,
    OPT_FAULTS,
    OPT_WIRE,
    OPT_FOLLOW,
    OPT_MOTOR,
    OPT_RESOLVER,
    OPT_INDEX,
    OPT_ABSOLUTE,
    OPT_UART,
    OPT_SERVO_CARD,
    OPT_SERVO_CARD_MOTOR,
    OPT_PPMC,
    OPT_SWITCH,
    OPT_DRIVE,
    OPT_REMOTE,
    OPT_SERVO,
    OPT_MAC,
    OPT_FLASH,
    OPT_FLASH_CHIP,
    OPT_FLASH_TIMES,
    OPT_FLASH_FAULTS,
    OPT_JUMPERS,
    OPT_LATENCY,
    OPT_REALTIME,
    OPT_RUN,
    OPT_STATS,
    OPT_CONTROL,
    OPT_SERIAL,
    OPT_QUIET,
    OPT_HELP,
    OPT_VERSION
};

static const struct option long_options[] = {
    {"card", required_argument, NULL, OPT_CARD},
    {"bind", required_argument, NULL, OPT_BIND},
    {"port", required_argument, NULL, OPT_PORT},
    {"seed", required_argument, NULL, OPT_SEED},
    {"firmware", required_argument, NULL, OPT_FIRMWARE},
    {"sources", required_argument, NULL, OPT_SOURCES},
    {"name", required_argument, NULL, OPT_NAME},
    {"faults", required_argument, NULL, OPT_FAULTS},
    {"wire", required_argument, NULL, OPT_WIRE},
    {"follow", required_argument, NULL, OPT_FOLLOW},
    {"motor", required_argument, NULL, OPT_MOTOR},
    {"resolver", required_argument, NULL, OPT_RESOLVER},
    {"index", required_argument, NULL, OPT_INDEX},
    {"absolute", required_argument, NULL, OPT_ABSOLUTE},
    {"uart", required_argument, NULL, OPT_UART},
    {"7i65", required_argument, NULL, OPT_SERVO_CARD},
    {"7i65-motor", required_argument, NULL, OPT_SERVO_CARD_MOTOR},
    {"ppmc", required_argument, NULL, OPT_PPMC},
    {"switch", required_argument, NULL, OPT_SWITCH},
    {"drive", required_argument, NULL, OPT_DRIVE},
    {"remote", required_argument, NULL, OPT_REMOTE},
    {"servo", required_argument, NULL, OPT_SERVO},
    {"mac", required_argument, NULL, OPT_MAC},
    {"flash", required_argument, NULL, OPT_FLASH},
    {"flash-chip", required_argument, NULL, OPT_FLASH_CHIP},
    {"flash-times", required_argument, NULL, OPT_FLASH_TIMES},
    {"flash-faults", required_argument, NULL, OPT_FLASH_FAULTS},
    {"jumpers", required_argument, NULL, OPT_JUMPERS},
    {"latency", no_argument, NULL, OPT_LATENCY},
    {"realtime", optional_argument, NULL, OPT_REALTIME},
    {"run", required_argument, NULL, OPT_RUN},
    {"stats", optional_argument, NULL, OPT_STATS},
    {"control", required_argument, NULL, OPT_CONTROL},
    {"serial", required_argument, NULL, OPT_SERIAL},
    {"quiet", no_argument, NULL, OPT_QUIET},
    {"help", no_argument, NULL, OPT_HELP},
    {"version", no_argument, NULL, OPT_VERSION},
    {NULL, 0, NULL, 0},
};

/* In lines of a terminal's width. */
static void print_names(const char *const heading, const char *const *names)
{
    const size_t width = 100;
    size_t column = width;
    fputs(heading, stdout);
    for (; *names; names++) {
        const size_t len = strlen(*names) + 1;
        column = column + len > width ? 1 : column;
        printf("%s %s", column == 1 ? "\n " : "", *names);
        column += len;
    }
}

static const char general_help[] =
    "hm2sim: Mesa HostMot2 Ethernet cards, simulated, on UDP\n"
    "\n"
    "usage: hm2sim [OPTION...]\n"
    "\n"
    "  --card TYPE[@ADDRESS[:PORT]]  one more card (default: one 7i96s). Types are at the end\n"
    "  --bind ADDRESS      of cards that give none (127.0.0.1)\n"
    "  --port PORT         of cards that give none (27181; 0 = any free one)\n"
    "  --seed N            of faults and MAC addresses (1)\n"
    "  --faults LIST       loss=, dup=, reorder=, truncate=, foreign= 0..1, delay=US[-US], tail=0..1:US,\n"
    "                      coalesce=US, sleep=US:US, busy=US:US; by commas\n"
    "  --latency           replies take the time that a card takes\n"
    "  --realtime[=PRIO]   SCHED_FIFO (priority 50) and locked memory, where permitted\n"
    "  --run SECONDS       end after this time\n"
    "  --stats[=SECONDS]   print statistics every second (or so), not only at the end\n"
    "  --control PATH      take commands on a Unix datagram socket\n"
    "  --serial REMOTE@PATH  a smart-serial remote in set-up mode on a pseudo-terminal, PATH a link to it\n"
    "  --quiet             print the ready line only\n"
    "  --help, --version\n";

static const char card_help[] =
    "\n"
    "of the card named last, or of every card when before the first --card:\n"
    "  --firmware FILE     image as text, lines of ADDRESS VALUE in hexadecimal\n"
    "  --sources NAME      of its modules where generations differ without the image saying so: 2021 or later\n"
    "  --name NAME         card name that it reports, in place of its type's\n"
    "  --mac XX:XX:XX:XX:XX:XX\n"
    "  --flash FILE        keep the configuration flash in a file\n"
    "  --flash-chip SIZE   2Mb, 4Mb, 8Mb, 16Mb (the usual one), 32Mb, 64Mb\n"
    "  --flash-times NAME  none, m25p16, m25p16-max, w25q16, w25q16-max\n"
    "  --flash-faults LIST cut=OPERATION[:BYTES], stick=OPERATION, bad=ADDRESS:MASK[:TIMES]; by commas\n"
    "  --jumpers N         address jumpers, 0 to 3; with 3 Efinix cards start the fallback image\n"
    "  --wire FROM:TO      connect two I/O pins\n"
    "  --follow ENC:STEPGEN[:NUM/DEN]  the encoder turns with the step generator\n"
    "  --motor ENC:PWMGEN:COUNTS       the encoder turns with a motor, COUNTS a second at full duty\n"
    "  --resolver CH:TURNS[:PWMGEN:SPEED]  a resolver, and a motor that turns it, SPEED turns a second at full "
    "duty\n"
    "  --index ENC:COUNTS  such an encoder has an index, every COUNTS counts\n"
    "  --absolute READER:LIST          an absolute encoder at ssi.N, biss.N or fanuc.N. Keys, by commas: bits=,\n"
    "                      value=HEX, position=AT:WIDTH[g], turns=AT:WIDTH[g], start=, speed=, "
    "with=AXIS[:NUM/DEN],\n"
    "                      delay=NS, idle=NS, processing=CLOCKS\n"
    "  --uart PORT:TARGET  at uart.N or pktuart.N: loop, or the path of a terminal to make\n"
    "  --7i65 PORT         a 7I65 with axes at a buffered SPI port\n"
    "  --7i65-motor ENC:OUTPUT:COUNTS[:MS]  a motor at its output, COUNTS a second at 10 V, with a lag\n"
    "  --ppmc PATH         Pico Systems encoder boards on a socket; they count the step generators' steps\n"
    "  --switch IO:AXIS:POSITION:LEVELS  below the position of stepgen.N or encoder.N one level, then another\n"
    "  --drive IO:LEVELS[:MS]  0, 1, z (floating), h (pulled up), MS milliseconds each\n"
    "  --remote PORT:CHANNEL=CARD  a smart-serial card there. Cards:";

static void print_help(void)
{
    fputs(general_help, stdout);
    fputs(card_help, stdout);
    for (const char *const *card = sim_sserial_cards(); *card; card++)
        printf(" %s", *card);
    fputs(
        "\n"
        "  --servo ENC:PORT:CHANNEL:OUTPUT:COUNTS[:MS]  a motor at a remote's analog output, COUNTS a second at full\n"
        "                      output, with a time constant\n"
        "\n",
        stdout);
    print_names("Remotes for --serial:", remote_names());
    print_names("\n\nTypes of cards:", sim_profiles());
    fputs("\n\n"
          "When all cards listen, one line \"ready CARD@ADDRESS:PORT ...\" is printed. SIGINT and SIGTERM end it.\n",
          stdout);
}

static int take_seconds(struct reading *const r, const char *const option, const char *const value,
                        int64_t *const result_ns)
{
    double seconds;
    if (!whole_real(value, 0.001, MAX_SECONDS, &seconds))
        return refuse(r, option, value, "seconds, 0.001 to 1e6");
    *result_ns = (int64_t)(seconds * NS_PER_S);
    return 0;
}

static int take_realtime(struct reading *const r, const char *const value)
{
    unsigned long priority = DEFAULT_PRIORITY;
    if (value && (!whole_unsigned(value, 99, &priority) || priority == 0))
        return refuse(r, "--realtime", value, "a priority from 1 to 99");
    r->options->realtime = true;
    r->options->realtime_priority = (int)priority;
    return 0;
}

static int take_seed(struct reading *const r, const char *const value)
{
    unsigned long seed;
    if (!whole_unsigned(value, ULONG_MAX, &seed))
        return refuse(r, "--seed", value, "a number");
    r->options->seed = seed;
    return 0;
}

static int take_flash_option(struct reading *const r, const int option, const char *const value)
{
    struct flash_options *const flash = &r->card->flash;
    unsigned long jumpers;
    switch (option) {
    case OPT_FLASH_CHIP:
        return flash_chip_option(value, &flash->id)
                   ? 0
                   : refuse(r, "--flash-chip", value, "2Mb, 4Mb, 8Mb, 16Mb, 32Mb or 64Mb");
    case OPT_FLASH_TIMES:
        flash->times = sim_flash_times_of(value);
        return flash->times ? 0 : refuse(r, "--flash-times", value, "none, m25p16, m25p16-max, w25q16 or w25q16-max");
    case OPT_FLASH_FAULTS:
        return flash_faults_option(value, &flash->faults, &r->diag);
    case OPT_JUMPERS:
        if (!whole_unsigned(value, 3, &jumpers))
            return refuse(r, "--jumpers", value, "0 to 3");
        flash->jumpers = (unsigned)jumpers;
        return 0;
    default:
        flash->file = value;
        return 0;
    }
}

static int set_sources(struct reading *const r, const char *const value)
{
    const bool later = strcmp(value, "later") == 0;
    if (!later && strcmp(value, "2021") != 0)
        return refuse(r, "--sources", value, "2021 or later");
    r->card->sources = later ? SIM_SOURCES_LATER : SIM_SOURCES_2021;
    return 0;
}

static int take_card_option(struct reading *const r, const int option, const char *const value)
{
    switch (option) {
    case OPT_FIRMWARE:
        r->card->firmware = value;
        return 0;
    case OPT_NAME:
        r->card->name = value;
        return 0;
    case OPT_SOURCES:
        return set_sources(r, value);
    case OPT_MAC:
        return set_mac(r, value);
    case OPT_WIRE:
        return add_wire(r, value);
    case OPT_FOLLOW:
        return add_follower(r, value);
    case OPT_MOTOR:
        return add_motor(r, value);
    case OPT_RESOLVER:
        return add_resolver(r, value);
    case OPT_INDEX:
        return add_index(r, value);
    case OPT_ABSOLUTE:
        return add_absolute(r, value);
    case OPT_UART:
        return add_uart(r, value);
    case OPT_SERVO_CARD:
        return set_servo_card(r, value);
    case OPT_SERVO_CARD_MOTOR:
        return add_servo_card_motor(r, value);
    case OPT_PPMC:
        r->card->ppmc = value;
        return 0;
    case OPT_SWITCH:
        return add_switch(r, value);
    case OPT_REMOTE:
        return add_remote(r, value);
    case OPT_SERVO:
        return add_servo(r, value);
    case OPT_DRIVE:
        return add_pattern(r, value);
    default:
        return take_flash_option(r, option, value);
    }
}

static int take(struct reading *const r, const int option, const char *const value)
{
    struct options *const o = r->options;
    switch (option) {
    case OPT_CARD:
        return add_card(r, value);
    case OPT_BIND:
        return set_address(r, value);
    case OPT_PORT:
        return set_port(r, value);
    case OPT_SEED:
        return take_seed(r, value);
    case OPT_SERIAL:
        return add_serial(r, value);
    case OPT_FAULTS:
        return faults_option(value, &o->faults, &r->diag);
    case OPT_LATENCY:
        o->latency = true;
        return 0;
    case OPT_REALTIME:
        return take_realtime(r, value);
    case OPT_RUN:
        return take_seconds(r, "--run", value, &o->run_ns);
    case OPT_STATS:
        return take_seconds(r, "--stats", value ? value : "1", &o->stats_ns);
    case OPT_CONTROL:
        o->control = value;
        return 0;
    case OPT_QUIET:
        o->quiet = true;
        return 0;
    default:
        return take_card_option(r, option, value);
    }
}

/* Cards without an address get the common one; no two may share a socket. */
static int settle_addresses(struct reading *const r)
{
    struct options *const o = r->options;
    if (o->card_count == 0 && o->serial_count == 0 && add_card(r, "7i96s"))
        return HM2_ERR_INVALID;
    for (unsigned i = 0; i < o->card_count; i++) {
        struct card_options *const card = &o->cards[i];
        if (!r->own_address[i]) {
            card->address = r->bind;
            card->port = r->port;
        }
        for (unsigned k = 0; k < i; k++)
            if (o->cards[k].address.s_addr == card->address.s_addr && o->cards[k].port == card->port && card->port)
                return hm2_diag_add(&r->diag, HM2_ERR_INVALID,
                                    "cards %u and %u have the same address and port; give each its own, as in "
                                    "--card 7i96s@127.0.0.1 --card 7i93@127.0.0.2",
                                    k, i);
    }
    return 0;
}

static enum options_result usage(const struct reading *const r)
{
    if (r->diag.len > 0)
        fprintf(stderr, "hm2sim: %s", r->diag.text);
    fputs("hm2sim --help lists the options\n", stderr);
    return OPTIONS_EXIT_USAGE;
}

enum options_result options_read(struct options *const options, const int argc, char **const argv)
{
    static struct reading r; /* large: the diagnostics */
    r = (struct reading){.options = options, .port = LBP16_UDP_PORT, .bind.s_addr = htonl(INADDR_LOOPBACK)};
    r.card = &r.shared;
    *options = (struct options){.seed = 1};
    for (int option; (option = getopt_long(argc, argv, "", long_options, NULL)) != -1;) {
        if (option == OPT_HELP) {
            print_help();
            return OPTIONS_EXIT_OK;
        }
        if (option == OPT_VERSION) {
            puts("hm2sim " HM2_VERSION);
            return OPTIONS_EXIT_OK;
        }
        if (option == '?' || take(&r, option, optarg))
            return usage(&r);
    }
    if (optind < argc) {
        (void)hm2_diag_add(&r.diag, HM2_ERR_INVALID, "\"%s\" is not an option", argv[optind]);
        return usage(&r);
    }
    options->faults.seed = options->seed;
    return settle_addresses(&r) ? usage(&r) : OPTIONS_RUN;
}
