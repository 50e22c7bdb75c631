/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Scripts of the mock link: text to exchange list. */
#include <hm2/link.h>

#include <string.h>

#include "exchange.h"
#include "text.h"

/* What a "!" line announces for the next reply. */
enum fault { FAULT_LOSE, FAULT_DUP, FAULT_DELAY, FAULT_CUT, FAULT_GARBLE, FAULTS };

static const struct {
    const char *name;
    uint64_t max; /* of its number; 0 = it has none */
} fault_forms[FAULTS] = {
    [FAULT_LOSE] = {"lose", 0},
    [FAULT_DUP] = {"dup", 0},
    [FAULT_DELAY] = {"delay", EXCHANGE_MAX_NS},
    [FAULT_CUT] = {"cut", EXCHANGE_MAX_DATAGRAM_BYTES},
    [FAULT_GARBLE] = {"garble", EXCHANGE_MAX_DATAGRAM_BYTES - 1},
};

struct faults {
    struct {
        bool given;
        uint64_t number;
    } of[FAULTS];
    unsigned line; /* of the last one; 0 = none waits */
};

struct script {
    struct text_reader reader;
    struct exchange exchange;
    struct faults faults;
    struct hm2_diag *diag;
    uint8_t bytes[EXCHANGE_MAX_DATAGRAM_BYTES];
};

static int refuse(const struct script *const script, const char *const reason)
{
    return hm2_diag_add(script->diag, HM2_ERR_MALFORMED, "Script line %u: %s.", script->reader.line, reason);
}

static int add(struct script *const script, const enum exchange_kind kind, const size_t len)
{
    const struct exchange_item item = {
        .kind = kind,
        .line = script->reader.line,
        .len = len,
        .delay_ns = kind == EXCHANGE_REPLY ? (int64_t)script->faults.of[FAULT_DELAY].number : 0,
    };
    return exchange_add(&script->exchange, &item, script->bytes, script->diag);
}

static int add_expected(struct script *const script, const size_t len)
{
    if (script->faults.line)
        return hm2_diag_add(script->diag, HM2_ERR_MALFORMED,
                            "Script line %u: a fault, but no reply (\"<\") follows it.", script->faults.line);
    if (len > LINK_MAX_DATAGRAM_BYTES)
        return refuse(script, "a client cannot send more than 1472 bytes");
    return add(script, EXCHANGE_EXPECT, len);
}

static int add_reply(struct script *const script, size_t len)
{
    const struct faults faults = script->faults;
    if (faults.of[FAULT_CUT].given && faults.of[FAULT_CUT].number > len)
        return refuse(script, "\"! cut\" asks for more bytes than this reply has");
    if (faults.of[FAULT_CUT].given)
        len = (size_t)faults.of[FAULT_CUT].number;
    if (faults.of[FAULT_GARBLE].given && faults.of[FAULT_GARBLE].number >= len)
        return refuse(script, "\"! garble\" names a byte behind the end of this reply");
    if (faults.of[FAULT_GARBLE].given)
        script->bytes[faults.of[FAULT_GARBLE].number] ^= 0x10u;
    int err = faults.of[FAULT_LOSE].given ? 0 : add(script, EXCHANGE_REPLY, len);
    if (!err && faults.of[FAULT_DUP].given && !faults.of[FAULT_LOSE].given)
        err = add(script, EXCHANGE_REPLY, len);
    script->faults = (struct faults){0};
    return err;
}

static int add_fault(struct script *const script, struct text_span line)
{
    struct text_span word, number;
    unsigned fault = 0;
    if (!text_next_word(&line, &word))
        return refuse(script, "\"!\" needs the name of a fault: lose, dup, delay, cut, garble or senderr");
    const bool has_number = text_next_word(&line, &number);
    if (has_number && text_next_word(&line, &(struct text_span){0}))
        return refuse(script, "nothing may follow a fault and its number");
    if (text_is(word, "senderr"))
        return has_number ? refuse(script, "senderr takes no number") : add(script, EXCHANGE_FAIL, 0);
    while (fault < FAULTS && !text_is(word, fault_forms[fault].name))
        fault++;
    if (fault == FAULTS)
        return refuse(script, "unknown fault; known are lose, dup, delay, cut, garble and senderr");
    const uint64_t max = fault_forms[fault].max;
    if (has_number != (max > 0))
        return refuse(script, "delay needs nanoseconds, cut and garble a number of bytes, lose and dup nothing");
    if (has_number && !text_number(number, max, &script->faults.of[fault].number))
        return refuse(script, "number out of range (cut up to 2048 bytes, garble up to byte 2047, delay 2^60 ns)");
    script->faults.of[fault].given = true;
    script->faults.line = script->reader.line;
    return 0;
}

static int parse_line(struct script *const script, struct text_span line)
{
    const char kind = *line.at++;
    size_t len;
    if (kind == '!')
        return add_fault(script, line);
    if (kind != '>' && kind != '<')
        return refuse(script, "expected \">\" (sent by the client), \"<\" (reply) or \"!\" (fault)");
    const enum text_hex result = text_hex_bytes(line, script->bytes, sizeof script->bytes, &len);
    if (result != TEXT_HEX_OK)
        return refuse(script, text_hex_reason(result));
    return kind == '>' ? add_expected(script, len) : add_reply(script, len);
}

int link_mock_script(struct link **const link, const char *const text, struct hm2_diag *const diag)
{
    struct script script = {.reader = {.left = {text, text + strlen(text)}}, .diag = diag};
    struct text_span line;
    int err = 0;
    while (!err && text_next_line(&script.reader, &line))
        err = parse_line(&script, line);
    if (!err && script.faults.line)
        err = hm2_diag_add(diag, HM2_ERR_MALFORMED, "Script line %u: a fault, but no reply (\"<\") follows it.",
                           script.faults.line);
    if (err) {
        exchange_free(&script.exchange);
        return err;
    }
    return link_mock_follow(link, &script.exchange, diag);
}
