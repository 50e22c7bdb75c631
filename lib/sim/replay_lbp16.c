/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * lbp16 folders: one session of frames and UDP payloads with the card's replies, in order, because pointers, counters
 * and memory carry over. Requests go in as whole frames. Replies are compared byte by byte but for the times of the
 * card's own clock, which depend on the run (README), and the time to the reply within what the card's polling loop
 * leaves open.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/lbp16.h>

#include "replay_trace.h"

#define MAX_FRAME       2048u
#define MIN_FRAME       60u
#define UDP_HEADERS     42u
#define CARD_PORT       27181u
#define SESSION_STEP_NS 2000000 /* from one request to the next; the recording gives no times */
#define TIME_SLACK_US   0.5     /* where in its polling loop the card is when a frame comes */
#define TIME_SLACK      0.02

/* Addresses of the recording (README and ARP exchange). */
static const uint8_t card_mac[6] = {0x00, 0x60, 0x1B, 0x12, 0x34, 0x56};
static const uint8_t client_mac[6] = {0x02, 0x00, 0x00, 0x00, 0x00, 0x01};
static const uint8_t client_ip[4] = {192, 168, 1, 1};

struct exchange {
    const char *number, *kind, *description;
    uint8_t request[MAX_FRAME], reply[MAX_FRAME];
    size_t request_len, reply_len;
    double reply_us;
    bool has_time;
    int64_t reply_port;
};

struct flow {
    unsigned source_port, destination_port;
    uint8_t destination_ip[4];
};

/* ---- rows -----------------------------------------------------------------------------------------------------------
 */

static int hex_nibble(const char c)
{
    const char text[2] = {c, '\0'};
    uint32_t value = 0;
    return replay_hex32(text, &value) ? -1 : (int)value;
}

static int parse_hex(const char *const text, uint8_t *const bytes, size_t *const len)
{
    const size_t digits = strlen(text);
    if (digits % 2 || digits / 2 > MAX_FRAME - UDP_HEADERS)
        return HM2_ERR_MALFORMED;
    for (size_t i = 0; i < digits; i += 2) {
        const int high = hex_nibble(text[i]), low = hex_nibble(text[i + 1]);
        if (high < 0 || low < 0)
            return HM2_ERR_MALFORMED;
        bytes[i / 2] = (uint8_t)(high << 4 | low);
    }
    *len = digits / 2;
    return 0;
}

enum { COLUMN_N, COLUMN_KIND, COLUMN_DESCRIPTION, COLUMN_REQUEST, COLUMN_REPLY, COLUMN_US, COLUMN_PORT, COLUMNS };

static int find_columns(const struct replay_csv *const csv, int columns[COLUMNS], struct hm2_diag *const diag)
{
    static const char *const names[COLUMNS] = {"n",         "kind",     "description",   "request_hex",
                                               "reply_hex", "reply_us", "reply_dst_port"};
    for (unsigned i = 0; i < COLUMNS; i++) {
        columns[i] = replay_csv_need(csv, names[i], diag);
        if (columns[i] < 0)
            return columns[i];
    }
    return 0;
}

static int parse_row(const struct replay_csv *const csv, const int columns[COLUMNS], struct exchange *const x,
                     struct hm2_diag *const diag)
{
    x->number = csv->field[columns[COLUMN_N]];
    x->kind = csv->field[columns[COLUMN_KIND]];
    x->description = csv->field[columns[COLUMN_DESCRIPTION]];
    const char *const us = csv->field[columns[COLUMN_US]];
    const char *const port = csv->field[columns[COLUMN_PORT]];
    char *end = NULL;
    x->reply_us = strtod(us, &end);
    x->has_time = *us != '\0';
    x->reply_port = -1;
    const bool known = strcmp(x->kind, "udp") == 0 || strcmp(x->kind, "arp") == 0 || strcmp(x->kind, "icmp") == 0;
    if (!known || *end || parse_hex(csv->field[columns[COLUMN_REQUEST]], x->request, &x->request_len) ||
        parse_hex(csv->field[columns[COLUMN_REPLY]], x->reply, &x->reply_len) ||
        (*port && replay_decimal(port, 65535, &x->reply_port)))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                            "exchanges.csv line %u: not an exchange (kind udp, arp or icmp; whole bytes in hex, at "
                            "most %u; times and ports as numbers).",
                            csv->line, MAX_FRAME - UDP_HEADERS);
    return 0;
}

/* ---- frames
 * ----------------------------------------------------------------------------------------------------------- */

static void put_be16(uint8_t *const p, const size_t value)
{
    p[0] = (uint8_t)(value >> 8);
    p[1] = (uint8_t)value;
}

/* Number behind words of a description; unchanged when they are not there. */
static void number_behind(const char *const description, const char *const words, unsigned *const number)
{
    const char *const at = strstr(description, words);
    if (at)
        (void)!replay_take_number(at + strlen(words), UINT16_MAX, number);
}

static void address_behind(const char *const description, const char *const words, uint8_t address[4])
{
    const char *at = strstr(description, words);
    unsigned part[4];
    if (!at)
        return;
    at += strlen(words);
    for (unsigned i = 0; i < 4; i++) {
        at = replay_take_number(at, UINT8_MAX, &part[i]);
        if (!at || (i < 3 && *at++ != '.'))
            return;
    }
    for (unsigned i = 0; i < 4; i++)
        address[i] = (uint8_t)part[i];
}

/* Ports and address of a payload: the usual ones unless the description names others. */
static struct flow flow_of(const char *const description)
{
    struct flow flow = {CARD_PORT, CARD_PORT, {192, 168, 1, 121}};
    number_behind(description, "source port ", &flow.source_port);
    number_behind(description, "destination port ", &flow.destination_port);
    address_behind(description, "destination IP ", flow.destination_ip);
    return flow;
}

/* Ethernet, IPv4 and UDP headers around a payload; checksums stay 0, the firmware does not see them. */
static size_t udp_frame(const struct exchange *const x, uint8_t frame[MAX_FRAME])
{
    const struct flow flow = flow_of(x->description);
    const size_t len = x->request_len + UDP_HEADERS;
    memset(frame, 0, MAX_FRAME);
    memcpy(frame, card_mac, sizeof(card_mac));
    memcpy(frame + 6, client_mac, sizeof(client_mac));
    put_be16(frame + 12, 0x0800);
    put_be16(frame + 14, 0x4500);
    put_be16(frame + 16, x->request_len + 28);
    put_be16(frame + 22, 0x4011);
    memcpy(frame + 26, client_ip, sizeof(client_ip));
    memcpy(frame + 30, flow.destination_ip, sizeof(flow.destination_ip));
    put_be16(frame + 34, flow.source_port);
    put_be16(frame + 36, flow.destination_port);
    put_be16(frame + 38, x->request_len + 8);
    memcpy(frame + UDP_HEADERS, x->request, x->request_len);
    return len < MIN_FRAME ? MIN_FRAME : len;
}

/* ---- comparison
 * --------------------------------------------------------------------------------------------------------- */

static bool is_time(const struct lbp16_command *const c, const unsigned address)
{
    if (c->info)
        return false;
    if (c->space == LBP16_SPACE_TIMER)
        return address < LBP16_TIMER_WAIT_US || (address >= LBP16_TIMER_WAIT_REF && address < LBP16_TIMER_SCRATCH);
    return c->space == LBP16_SPACE_INFO && address >= LBP16_INFO_RECV_START;
}

/* Clear the words of a reply that are times. */
static void clear_times(const struct exchange *const x, uint8_t *const reply, const size_t len)
{
    struct lbp16_parser parser;
    struct lbp16_command c;
    const uint8_t *data;
    size_t data_len, at = 0;
    bool cut;
    lbp16_parser_init(&parser, x->request, x->request_len);
    while (lbp16_parser_next(&parser, &c, &data, &data_len, &cut) == 1) {
        for (unsigned i = 0; !c.write && i < c.count; i++, at += lbp16_item_bytes(c.size))
            if (at + 2 <= len && is_time(&c, c.address + (c.increment ? 2 * i : 0)))
                memset(reply + at, 0, 2);
    }
}

static void compare_bytes(const struct exchange *const x, const uint8_t *const got, const size_t got_len,
                          char *const difference)
{
    if (got_len != x->reply_len) {
        snprintf(difference, REPLAY_TEXT, "reply expected %zu bytes, got %zu (%.100s)", x->reply_len, got_len,
                 x->description);
        return;
    }
    for (size_t i = 0; i < got_len; i++) {
        if (got[i] == x->reply[i])
            continue;
        snprintf(difference, REPLAY_TEXT, "reply byte %zu expected %02x, got %02x (%.100s)", i, x->reply[i], got[i],
                 x->description);
        return;
    }
}

static void compare_reply(struct exchange *const x, uint8_t *const frame, const size_t len, const double us,
                          char *const difference)
{
    const bool udp = strcmp(x->kind, "udp") == 0;
    const size_t headers = udp && len > 0 ? UDP_HEADERS : 0;
    if (len < headers) {
        snprintf(difference, REPLAY_TEXT, "reply frame of %zu bytes is shorter than its headers", len);
        return;
    }
    if (udp) {
        clear_times(x, x->reply, x->reply_len);
        clear_times(x, frame + headers, len - headers);
    }
    compare_bytes(x, frame + headers, len - headers, difference);
    if (difference[0] || len == 0)
        return;
    const unsigned port = headers ? (unsigned)frame[36] << 8 | frame[37] : 0;
    if (udp && x->reply_port >= 0 && port != (unsigned)x->reply_port)
        snprintf(difference, REPLAY_TEXT, "reply port expected %lld, got %u", (long long)x->reply_port, port);
    const double slack = TIME_SLACK_US + TIME_SLACK * x->reply_us;
    if (!difference[0] && x->has_time && (us < x->reply_us - slack || us > x->reply_us + slack))
        snprintf(difference, REPLAY_TEXT, "reply expected after %.2f us, got after %.2f us (%.100s)", x->reply_us, us,
                 x->description);
}

static void play_exchange(struct sim_card *const card, struct exchange *const x, const int64_t now_ns,
                          char *const difference)
{
    uint8_t frame[MAX_FRAME] = {0}, answer[MAX_FRAME] = {0};
    size_t len = x->request_len;
    if (strcmp(x->kind, "udp") == 0)
        len = udp_frame(x, frame);
    else
        memcpy(frame, x->request, len);
    int64_t reply_ns = now_ns;
    const size_t got = sim_card_frame(card, now_ns, frame, len, answer, sizeof(answer), &reply_ns);
    compare_reply(x, answer, got, (double)(reply_ns - now_ns) / 1000.0, difference);
}

/* ---- the session
 * ---------------------------------------------------------------------------------------------------------- */

/* The recorded card: its addresses, its flash (a pattern, README) and a bus whose undriven bits show as 0. */
static int recorded_card(const struct replay_kind *const kind, struct sim_card **const card,
                         struct hm2_diag *const diag)
{
    struct hm2_image image;
    struct sim_card_options options = {.profile = kind->profile, .image = &image, .bus = SIM_BUS_ZEROS};
    memcpy(options.mac, card_mac, sizeof(options.mac));
    if (!replay_firmware(kind->firmware, &image))
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "No firmware image %s.", kind->firmware);
    const int err = sim_card_new(card, &options, diag);
    if (err)
        return err;
    size_t size = 0;
    uint8_t *const flash = sim_card_flash(*card, &size);
    for (size_t i = 0; i < size; i++)
        flash[i] = (uint8_t)(i ^ i >> 8);
    return 0;
}

static int play_session(const struct replay_kind *const kind, struct replay_csv *const csv,
                        const struct replay_options *const options, struct replay_totals *const totals,
                        struct hm2_diag *const diag)
{
    int columns[COLUMNS] = {0};
    struct sim_card *card = NULL;
    struct exchange *const x = calloc(1, sizeof(*x));
    int err = x ? find_columns(csv, columns, diag) : HM2_ERR_NOMEM;
    if (!err)
        err = recorded_card(kind, &card, diag);
    for (int64_t now_ns = 0; !err; now_ns += SESSION_STEP_NS) {
        const int got = replay_csv_row(csv, diag);
        if (got <= 0) {
            err = got;
            break;
        }
        err = parse_row(csv, columns, x, diag);
        if (err)
            break;
        char name[40], difference[REPLAY_TEXT] = "";
        snprintf(name, sizeof(name), "exchange_%.20s", x->number);
        play_exchange(card, x, now_ns, difference); /* also one that is not wanted: the next ones rest on it */
        if (replay_wanted(options, name))
            replay_report(options, totals, name, difference);
    }
    sim_card_free(card);
    free(x);
    return err;
}

int replay_lbp16(const struct replay_kind *const kind, const struct replay_files *const files,
                 const struct replay_options *const options, struct replay_totals *const totals,
                 struct hm2_diag *const diag)
{
    char *text = NULL;
    size_t len = 0;
    struct replay_csv csv;
    int err = files->load(files->context, "exchanges.csv", &text, &len, diag);
    if (err == HM2_ERR_NOTFOUND)
        return hm2_diag_add(diag, err, "There is no exchanges.csv in the folder.");
    if (!err)
        err = replay_csv_open(&csv, "exchanges.csv", text, len, diag);
    if (!err)
        err = play_session(kind, &csv, options, totals, diag);
    free(text);
    return err;
}
