/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The mock link: replies wait in a queue for their virtual time; a handler or an exchange list says what they are. */
#include <hm2/link.h>

#include <stdlib.h>
#include <string.h>

#include "exchange.h"

#define QUEUE_LENGTH 64u

struct queued {
    int64_t arrival_ns;
    uint64_t order; /* of arrival among equal times */
    size_t len;
    uint8_t data[EXCHANGE_MAX_DATAGRAM_BYTES];
};

/* State of a mock that follows an exchange list. */
struct follower {
    struct exchange exchange;
    size_t next;  /* item that the next send must match */
    int failure;  /* the first error, which sticks */
    bool surplus; /* something was sent after the end */
    size_t found_len;
    uint8_t found[EXCHANGE_MAX_DATAGRAM_BYTES]; /* what was sent instead */
};

struct mock {
    struct link base;
    link_mock_handler handler;
    void *context;
    struct follower *follower; /* NULL for a mock with a handler */
    int64_t now_ns;
    uint64_t pushed;
    unsigned waiting;
    struct queued queue[QUEUE_LENGTH];
};

static const struct link_ops mock_ops;

static struct mock *mock_of(struct link *const link)
{
    return link->ops == &mock_ops ? (struct mock *)link : NULL;
}

static int mock_send(struct link *const link, const void *const data, const size_t len)
{
    struct mock *const mock = (struct mock *)link;
    const int err = len > LINK_MAX_DATAGRAM_BYTES ? HM2_ERR_NOSPACE : mock->handler(mock->context, link, data, len);
    if (err)
        link->counters.send_errors++;
    else
        link->counters.sent++;
    return err;
}

/* The datagram that arrives first, or NULL. */
static struct queued *earliest(struct mock *const mock)
{
    struct queued *first = NULL;
    for (unsigned i = 0; i < mock->waiting; i++) {
        struct queued *const entry = &mock->queue[i];
        if (!first || entry->arrival_ns < first->arrival_ns ||
            (entry->arrival_ns == first->arrival_ns && entry->order < first->order))
            first = entry;
    }
    return first;
}

static int mock_recv(struct link *const link, void *const data, const size_t cap, const int64_t deadline_ns,
                     const int64_t clock_ns)
{
    struct mock *const mock = (struct mock *)link;
    struct queued *const entry = earliest(mock);
    const int64_t limit_ns = deadline_ns > mock->now_ns ? deadline_ns : mock->now_ns;
    (void)clock_ns; /* time is virtual */
    if (!entry || entry->arrival_ns > limit_ns) {
        mock->now_ns = limit_ns;
        return HM2_ERR_TIMEOUT;
    }
    if (entry->arrival_ns > mock->now_ns)
        mock->now_ns = entry->arrival_ns;
    const size_t len = entry->len;
    if (len <= cap && len > 0)
        memcpy(data, entry->data, len);
    *entry = mock->queue[--mock->waiting];
    link->counters.received++;
    return len <= cap ? (int)len : HM2_ERR_NOSPACE;
}

static int64_t mock_now(struct link *const link)
{
    return ((struct mock *)link)->now_ns;
}

static void mock_close(struct link *const link)
{
    struct mock *const mock = (struct mock *)link;
    if (mock->follower)
        exchange_free(&mock->follower->exchange);
    free(mock->follower);
    free(mock);
}

static const struct link_ops mock_ops = {
    .send = mock_send,
    .recv = mock_recv,
    .now_ns = mock_now,
    .close = mock_close,
};

int link_mock_open(struct link **const link, const link_mock_handler handler, void *const context)
{
    if (!handler)
        return HM2_ERR_INVALID;
    struct mock *const mock = calloc(1, sizeof *mock);
    if (!mock)
        return HM2_ERR_NOMEM;
    mock->base.ops = &mock_ops;
    mock->handler = handler;
    mock->context = context;
    *link = &mock->base;
    return 0;
}

int link_mock_push(struct link *const link, const struct link_mock_reply *const reply)
{
    struct mock *const mock = mock_of(link);
    if (!mock)
        return HM2_ERR_STATE;
    if (reply->delay_ns < 0 || reply->delay_ns > EXCHANGE_MAX_NS)
        return HM2_ERR_RANGE;
    if (reply->len > EXCHANGE_MAX_DATAGRAM_BYTES || mock->waiting == QUEUE_LENGTH)
        return HM2_ERR_NOSPACE;
    struct queued *const entry = &mock->queue[mock->waiting++];
    entry->arrival_ns = mock->now_ns < INT64_MAX - reply->delay_ns ? mock->now_ns + reply->delay_ns : INT64_MAX;
    entry->order = mock->pushed++;
    entry->len = reply->len;
    if (reply->len > 0)
        memcpy(entry->data, reply->data, reply->len);
    return 0;
}

void link_mock_advance(struct link *const link, const int64_t by_ns)
{
    struct mock *const mock = mock_of(link);
    if (mock && by_ns > 0)
        mock->now_ns = mock->now_ns < INT64_MAX - by_ns ? mock->now_ns + by_ns : INT64_MAX;
}

/* ---- following an exchange list --------------------------------------------------------------------------------- */

/* Queue the replies that stand next in the list. */
static int push_replies(struct follower *const follower, struct link *const link)
{
    const struct exchange *const exchange = &follower->exchange;
    for (; follower->next < exchange->count; follower->next++) {
        const struct exchange_item *const item = &exchange->items[follower->next];
        if (item->kind != EXCHANGE_REPLY)
            break;
        const struct link_mock_reply reply = {exchange->bytes + item->at, item->len, item->delay_ns};
        const int err = link_mock_push(link, &reply);
        if (err)
            return err;
    }
    return 0;
}

static int fail(struct follower *const follower, const int err, const uint8_t *const data, const size_t len)
{
    follower->failure = err;
    follower->surplus = follower->next == follower->exchange.count;
    follower->found_len = len;
    if (len > 0)
        memcpy(follower->found, data, len); /* a send is never longer than LINK_MAX_DATAGRAM_BYTES */
    return err;
}

static int follow(void *const context, struct link *const link, const uint8_t *const data, const size_t len)
{
    struct follower *const follower = context;
    const struct exchange *const exchange = &follower->exchange;
    if (follower->failure)
        return follower->failure;
    if (follower->next == exchange->count)
        return fail(follower, HM2_ERR_MISMATCH, data, len);
    const struct exchange_item *const item = &exchange->items[follower->next];
    if (item->kind == EXCHANGE_EXPECT &&
        (item->len != len || (len > 0 && memcmp(exchange->bytes + item->at, data, len) != 0)))
        return fail(follower, HM2_ERR_MISMATCH, data, len);
    follower->next++;
    const int err = push_replies(follower, link);
    if (err)
        return fail(follower, err, data, len);
    return item->kind == EXCHANGE_FAIL ? HM2_ERR_IO : 0;
}

int link_mock_follow(struct link **const link, struct exchange *const exchange, struct hm2_diag *const diag)
{
    struct follower *const follower = calloc(1, sizeof *follower);
    int err = follower ? link_mock_open(link, follow, follower) : HM2_ERR_NOMEM;
    if (err) {
        free(follower);
        exchange_free(exchange);
        return hm2_diag_add(diag, err, "No memory for a mock link.");
    }
    follower->exchange = *exchange;
    *exchange = (struct exchange){0};
    mock_of(*link)->follower = follower;
    err = push_replies(follower, *link); /* replies before the first request: nobody asked for them */
    if (err) {
        link_close(*link);
        *link = NULL;
        return hm2_diag_add(diag, err, "More than %u replies stand before the first request.", QUEUE_LENGTH);
    }
    return 0;
}

#define SHOWN_BYTES 48u

static const char *hex_text(char text[const 2 * SHOWN_BYTES + 4], const uint8_t *const bytes, const size_t len)
{
    static const char digits[] = "0123456789abcdef";
    const size_t shown = len < SHOWN_BYTES ? len : SHOWN_BYTES;
    size_t at = 0;
    if (len == 0)
        text[at++] = '-';
    for (size_t i = 0; i < shown; i++) {
        text[at++] = digits[bytes[i] >> 4];
        text[at++] = digits[bytes[i] & 15u];
    }
    memcpy(text + at, shown < len ? "..." : "", shown < len ? 4 : 1);
    return text;
}

static int report_mismatch(const struct follower *const follower, const struct exchange_item *const item,
                           struct hm2_diag *const diag)
{
    const uint8_t *const expected = follower->exchange.bytes + item->at;
    char expected_text[2 * SHOWN_BYTES + 4], found_text[2 * SHOWN_BYTES + 4];
    size_t same = 0;
    while (same < item->len && same < follower->found_len && expected[same] == follower->found[same])
        same++;
    return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                        "Line %u: expected %zu bytes %s, but %zu bytes %s were sent; they differ from byte %zu on.",
                        item->line, item->len, hex_text(expected_text, expected, item->len), follower->found_len,
                        hex_text(found_text, follower->found, follower->found_len), same);
}

int link_mock_finish(struct link *const link, struct hm2_diag *const diag)
{
    const struct mock *const mock = mock_of(link);
    if (!mock || !mock->follower)
        return hm2_diag_add(diag, HM2_ERR_STATE, "This link follows no script and no capture.");
    const struct follower *const follower = mock->follower;
    const struct exchange *const exchange = &follower->exchange;
    char text[2 * SHOWN_BYTES + 4];
    if (follower->failure == HM2_ERR_MISMATCH && follower->surplus)
        return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                            "After the last line: %zu bytes %s were sent, nothing was expected.", follower->found_len,
                            hex_text(text, follower->found, follower->found_len));
    if (follower->failure == HM2_ERR_MISMATCH)
        return report_mismatch(follower, &exchange->items[follower->next], diag);
    if (follower->failure)
        return hm2_diag_add(diag, follower->failure, "Line %u: more than %u replies wait to be received.",
                            exchange->items[follower->next].line, QUEUE_LENGTH);
    if (follower->next < exchange->count) {
        const struct exchange_item *const item = &exchange->items[follower->next];
        return hm2_diag_add(diag, HM2_ERR_MISMATCH, "Line %u: expected %zu bytes %s, but nothing more was sent.",
                            item->line, item->len, hex_text(text, exchange->bytes + item->at, item->len));
    }
    return 0;
}
