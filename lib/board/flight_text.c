/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The flight recorder's file: hm2flight(5). */
#include <hm2/flight.h>

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "../link/text.h"

#define VERSION      1u
#define MAX_START_NS UINT64_C(9000000000000000000)
#define MAX_PERIOD   UINT64_C(1000000000000)

static const char *const causes[HM2_FLIGHT_CAUSES] = {
    [HM2_FLIGHT_BY_REQUEST] = "request", [HM2_FLIGHT_BY_LOSS] = "loss", [HM2_FLIGHT_BY_SLOWNESS] = "slowness"};

static const char *const cause_names[HM2_FLIGHT_CAUSES] = {[HM2_FLIGHT_BY_REQUEST] = "a request",
                                                           [HM2_FLIGHT_BY_LOSS] = "a lost cycle",
                                                           [HM2_FLIGHT_BY_SLOWNESS] = "a slow cycle"};

const char *hm2_flight_cause_name(const enum hm2_flight_cause cause)
{
    return (unsigned)cause < HM2_FLIGHT_CAUSES ? cause_names[cause] : "an unknown cause";
}

static size_t length(const int printed, const size_t size)
{
    return printed < 0 ? 0 : (size_t)printed < size ? (size_t)printed : size - 1;
}

size_t hm2_flight_format_head(const struct hm2_flight_head *const head, char line[2 * HM2_FLIGHT_LINE_SIZE])
{
    const size_t size = 2 * (size_t)HM2_FLIGHT_LINE_SIZE;
    const unsigned cause = (unsigned)head->cause < HM2_FLIGHT_CAUSES ? head->cause : HM2_FLIGHT_BY_REQUEST;
    return length(snprintf(line, size,
                           "hm2flight %u %.31s %" PRId64 " %s %" PRIu32 "\n"
                           "# cycle start sent received decoded write written request reply write-bytes flags bad\n",
                           VERSION, head->card, head->period_ns, causes[cause], head->cause_cycle),
                  size);
}

size_t hm2_flight_format_cycle(const struct hm2_flight_cycle *const c, char line[HM2_FLIGHT_LINE_SIZE])
{
    return length(snprintf(line, HM2_FLIGHT_LINE_SIZE,
                           "%" PRIu32 " %" PRId64 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32
                           " %u %u %u %u %u\n",
                           c->number, c->start_ns, c->sent_ns, c->received_ns, c->decoded_ns, c->write_ns,
                           c->written_ns, c->request_bytes, c->reply_bytes, c->write_bytes, c->flags, c->bad_datagrams),
                  HM2_FLIGHT_LINE_SIZE);
}

/* ---- parsing ------------------------------------------------------------------------------------------------------
 */

static bool next_number(struct text_span *const line, const uint64_t max, uint64_t *const value)
{
    struct text_span word;
    return text_next_word(line, &word) && text_number(word, max, value);
}

static bool parse_cause(const struct text_span word, enum hm2_flight_cause *const cause)
{
    for (unsigned i = 0; i < HM2_FLIGHT_CAUSES; i++)
        if (text_is(word, causes[i])) {
            *cause = (enum hm2_flight_cause)i;
            return true;
        }
    return false;
}

static bool is_printable(const struct text_span word)
{
    for (const char *c = word.at; c < word.end; c++)
        if (*c <= ' ' || *c > '~')
            return false;
    return true;
}

static bool parse_head(struct text_span line, struct hm2_flight_head *const head)
{
    struct text_span word;
    uint64_t version, period, cycle;
    if (!text_next_word(&line, &word) || !text_is(word, "hm2flight") || !next_number(&line, VERSION, &version) ||
        version != VERSION || !text_next_word(&line, &word) || (size_t)(word.end - word.at) >= sizeof head->card ||
        !is_printable(word))
        return false;
    memset(head->card, 0, sizeof head->card);
    memcpy(head->card, word.at, (size_t)(word.end - word.at));
    if (!next_number(&line, MAX_PERIOD, &period) || !text_next_word(&line, &word) || !parse_cause(word, &head->cause) ||
        !next_number(&line, UINT32_MAX, &cycle) || text_next_word(&line, &word))
        return false;
    head->period_ns = (int64_t)period;
    head->cause_cycle = (uint32_t)cycle;
    return true;
}

static bool parse_cycle(struct text_span line, struct hm2_flight_cycle *const cycle)
{
    enum { NUMBER, START, SENT, RECEIVED, DECODED, WRITE, WRITTEN, REQUEST, REPLY, BYTES, FLAGS, BAD, FIELDS };
    static const uint64_t limits[FIELDS] = {
        [NUMBER] = UINT32_MAX,  [START] = MAX_START_NS, [SENT] = UINT32_MAX,    [RECEIVED] = UINT32_MAX,
        [DECODED] = UINT32_MAX, [WRITE] = UINT32_MAX,   [WRITTEN] = UINT32_MAX, [REQUEST] = UINT16_MAX,
        [REPLY] = UINT16_MAX,   [BYTES] = UINT16_MAX,   [FLAGS] = UINT8_MAX,    [BAD] = UINT8_MAX};
    uint64_t field[FIELDS];
    struct text_span word;
    for (unsigned i = 0; i < FIELDS; i++)
        if (!next_number(&line, limits[i], &field[i]))
            return false;
    if (text_next_word(&line, &word))
        return false;
    *cycle = (struct hm2_flight_cycle){
        .number = (uint32_t)field[NUMBER],
        .start_ns = (int64_t)field[START],
        .sent_ns = (uint32_t)field[SENT],
        .received_ns = (uint32_t)field[RECEIVED],
        .decoded_ns = (uint32_t)field[DECODED],
        .write_ns = (uint32_t)field[WRITE],
        .written_ns = (uint32_t)field[WRITTEN],
        .request_bytes = (uint16_t)field[REQUEST],
        .reply_bytes = (uint16_t)field[REPLY],
        .write_bytes = (uint16_t)field[BYTES],
        .flags = (uint8_t)field[FLAGS],
        .bad_datagrams = (uint8_t)field[BAD],
    };
    return true;
}

int hm2_flight_parse(const char *const text, const size_t len, struct hm2_flight_head *const head,
                     void (*const cycle)(void *context, const struct hm2_flight_cycle *cycle), void *const context,
                     struct hm2_diag *const diag)
{
    struct text_reader reader = {.left = {text, text + len}};
    struct text_span line;
    struct hm2_flight_cycle one;
    if (!text_next_line(&reader, &line) || !parse_head(line, head))
        return hm2_diag_add(diag, HM2_ERR_MALFORMED,
                            "line %u: \"hm2flight %u CARD PERIOD CAUSE CYCLE\" expected; this is no file of the flight "
                            "recorder",
                            reader.line, VERSION);
    while (text_next_line(&reader, &line)) {
        if (!parse_cycle(line, &one))
            return hm2_diag_add(diag, HM2_ERR_MALFORMED, "line %u: a cycle is twelve numbers", reader.line);
        cycle(context, &one);
    }
    return 0;
}
