/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Set-up exchanges. Every request writes a new number to the card's scratch registers first and reads it back last, so
 * a stale reply cannot be taken for a fresh one, and a reply proves that the writes before it have happened.
 */
#include <hm2/bytes.h>
#include <hm2/lbp16.h>

#include "board_private.h"

#define SCRATCH_WORDS 2u /* 16 bit each */

void board_exchange_begin(struct hm2_board *const board, struct board_exchange *const exchange)
{
    exchange->nonce = ++board->nonce | BOARD_NONCE_BIT;
    const uint16_t words[SCRATCH_WORDS] = {(uint16_t)exchange->nonce, (uint16_t)(exchange->nonce >> 16)};
    lbp16_builder_init(&exchange->builder, exchange->request, sizeof exchange->request);
    /* A write to a scratch register waits for DPLL timer 4 until HM2Timeout, which another program may have left at
     * anything (tests/data/lbp16/README.md). */
    const uint16_t no_wait = 0;
    (void)lbp16_add_write16(&exchange->builder, LBP16_SPACE_TIMER, LBP16_TIMER_TIMEOUT_US, 1, &no_wait, NULL);
    (void)lbp16_add_write16(&exchange->builder, LBP16_SPACE_TIMER, LBP16_TIMER_SCRATCH, SCRATCH_WORDS, words,
                            &exchange->nonce_at);
}

int board_exchange_seal(struct board_exchange *const exchange)
{
    return lbp16_add_read16(&exchange->builder, LBP16_SPACE_TIMER, LBP16_TIMER_SCRATCH, SCRATCH_WORDS,
                            &exchange->echo_at);
}

bool board_exchange_matches(const struct board_exchange *const exchange, const size_t len)
{
    return len == exchange->builder.reply_bytes && hm2_get_le32(exchange->reply + exchange->echo_at) == exchange->nonce;
}

/* A host that refuses (ICMP "port unreachable") is reported as an error at once; the card, or its simulation, may still
 * be starting, so the time of the try is waited out all the same. */
static int try_once(struct hm2_board *const board, struct board_exchange *const exchange, const int64_t try_ns)
{
    const int64_t deadline_ns = link_now_ns(board->link) + try_ns;
    int err = link_send(board->link, exchange->request, exchange->builder.used);
    for (unsigned i = 0; i < BOARD_MAX_DATAGRAMS; i++) {
        const int len = link_recv(board->link, exchange->reply, sizeof exchange->reply, deadline_ns);
        if (len >= 0 && board_exchange_matches(exchange, (size_t)len))
            return 0;
        if (len == HM2_ERR_TIMEOUT)
            return err < 0 ? err : len;
        if (len == HM2_ERR_IO)
            err = len;
    }
    return err < 0 ? err : HM2_ERR_MALFORMED;
}

int board_exchange_run(struct hm2_board *const board, struct board_exchange *const exchange, const unsigned tries,
                       const int64_t try_ns)
{
    int err = board_exchange_seal(exchange);
    if (err < 0)
        return err;
    err = HM2_ERR_TIMEOUT;
    for (unsigned i = 0; i < tries && err != 0; i++)
        err = try_once(board, exchange, try_ns);
    return err;
}

int board_peek(struct hm2_board *const board, uint16_t address, unsigned words, uint32_t *values)
{
    int err = 0;
    while (words > 0 && err == 0) {
        const unsigned count = words < LBP16_MAX_COUNT ? words : LBP16_MAX_COUNT;
        struct board_exchange exchange;
        size_t at;
        board_exchange_begin(board, &exchange);
        (void)lbp16_add_read_hm2(&exchange.builder, address, count, &at);
        err = board_exchange_run(board, &exchange, BOARD_TRIES, BOARD_TRY_NS);
        for (unsigned i = 0; err == 0 && i < count; i++)
            values[i] = hm2_get_le32(exchange.reply + at + 4u * i);
        address = (uint16_t)(address + 4u * count);
        values += count;
        words -= count;
    }
    return err;
}

int board_poke(struct hm2_board *const board, uint16_t address, unsigned words, const uint32_t *values,
               const unsigned tries, const int64_t try_ns)
{
    int err = 0;
    while (words > 0 && err == 0) {
        const unsigned count = words < LBP16_MAX_COUNT ? words : LBP16_MAX_COUNT;
        struct board_exchange exchange;
        size_t at;
        board_exchange_begin(board, &exchange);
        if (lbp16_add_write_hm2(&exchange.builder, address, count, NULL, &at) == 0)
            for (unsigned i = 0; i < count; i++)
                hm2_put_le32(exchange.request + at + 4u * i, values[i]);
        err = board_exchange_run(board, &exchange, tries, try_ns);
        address = (uint16_t)(address + 4u * count);
        values += count;
        words -= count;
    }
    return err;
}
