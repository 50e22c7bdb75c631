/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Captures, hm2capture(5), to exchange lists. */
#include <hm2/link.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "exchange.h"
#include "text.h"

/* About a minute of a large card at 1 kHz; what is longer is no longer a bug report. */
#define MAX_CAPTURE_BYTES ((size_t)256 << 20)

struct capture {
    struct text_reader reader;
    struct exchange exchange;
    struct hm2_diag *diag;
    uint64_t sent_ns, last_ns; /* last request, last line */
    uint8_t bytes[EXCHANGE_MAX_DATAGRAM_BYTES];
};

static int refuse(const struct capture *const capture, const char *const reason)
{
    return hm2_diag_add(capture->diag, HM2_ERR_MALFORMED, "Capture line %u: %s.", capture->reader.line, reason);
}

static int parse_header(struct capture *const capture)
{
    struct text_span line, word;
    if (!text_next_line(&capture->reader, &line))
        return hm2_diag_add(capture->diag, HM2_ERR_MALFORMED,
                            "The capture is empty; \"hm2capture 1\" is its first line.");
    if (!text_next_word(&line, &word) || !text_is(word, "hm2capture"))
        return refuse(capture, "this is no capture; the first line of one is \"hm2capture 1\"");
    if (!text_next_word(&line, &word) || !text_is(word, "1") || text_next_word(&line, &word))
        return refuse(capture, "this version of the format is not known here; \"hm2capture 1\" is");
    return 0;
}

static int parse_line(struct capture *const capture, struct text_span line)
{
    struct text_span word;
    struct exchange_item item = {.line = capture->reader.line};
    uint64_t time_ns;
    if (!text_next_word(&line, &word) || !text_number(word, EXCHANGE_MAX_NS, &time_ns))
        return refuse(capture, "expected a time in nanoseconds, 0 to 2^60");
    if (time_ns < capture->last_ns)
        return refuse(capture, "this line is earlier than the one before it");
    capture->last_ns = time_ns;
    if (!text_next_word(&line, &word) || !(text_is(word, ">") || text_is(word, "<") || text_is(word, "!")))
        return refuse(capture, "expected \">\" (sent), \"<\" (received) or \"!\" (sending failed) after the time");
    item.kind = *word.at == '>' ? EXCHANGE_EXPECT : *word.at == '<' ? EXCHANGE_REPLY : EXCHANGE_FAIL;
    if (item.kind != EXCHANGE_FAIL) {
        const enum text_hex result = text_hex_bytes(line, capture->bytes, sizeof capture->bytes, &item.len);
        if (result != TEXT_HEX_OK)
            return refuse(capture, text_hex_reason(result));
    }
    if (item.kind == EXCHANGE_EXPECT && item.len > LINK_MAX_DATAGRAM_BYTES)
        return refuse(capture, "a client cannot send more than 1472 bytes");
    if (item.kind == EXCHANGE_REPLY)
        item.delay_ns = (int64_t)(time_ns - capture->sent_ns);
    else
        capture->sent_ns = time_ns;
    return exchange_add(&capture->exchange, &item, capture->bytes, capture->diag);
}

int link_replay_text(struct link **const link, const char *const text, const size_t len, struct hm2_diag *const diag)
{
    struct capture capture = {.reader = {.left = {text, text + len}}, .diag = diag};
    struct text_span line;
    int err = parse_header(&capture);
    while (!err && text_next_line(&capture.reader, &line))
        err = parse_line(&capture, line);
    if (err) {
        exchange_free(&capture.exchange);
        return err;
    }
    return link_mock_follow(link, &capture.exchange, diag);
}

/* The whole file. *text is the caller's to free, also after an error. */
static int read_all(FILE *const file, char **const text, size_t *const len)
{
    size_t capacity = 0;
    for (;;) {
        if (*len == capacity) {
            capacity = capacity ? 2 * capacity : 65536;
            if (capacity > 2 * MAX_CAPTURE_BYTES)
                return HM2_ERR_NOSPACE;
            char *const larger = realloc(*text, capacity);
            if (!larger)
                return HM2_ERR_NOMEM;
            *text = larger;
        }
        const size_t got = fread(*text + *len, 1, capacity - *len, file);
        *len += got;
        if (got == 0)
            return ferror(file) ? HM2_ERR_IO : 0;
    }
}

int link_replay_open(struct link **const link, const char *const path, struct hm2_diag *const diag)
{
    char *text = NULL;
    size_t len = 0;
    FILE *const file = fopen(path, "re");
    if (!file)
        return hm2_diag_add(diag, HM2_ERR_IO, "Capture file %s cannot be opened: %s.", path, strerror(errno));
    int err = read_all(file, &text, &len);
    if (!err && len > MAX_CAPTURE_BYTES)
        err = HM2_ERR_NOSPACE;
    (void)fclose(file);
    if (err == HM2_ERR_NOSPACE)
        (void)hm2_diag_add(diag, err, "Capture file %s is longer than 256 MiB; cut it to the part of interest.", path);
    else if (err)
        (void)hm2_diag_add(diag, err, "Capture file %s cannot be read: %s.", path, hm2_strerror(err));
    else
        err = link_replay_text(link, text, len, diag);
    free(text);
    return err;
}
