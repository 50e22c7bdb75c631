/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A list of datagrams that are expected and the replies to them: what scripts and captures have in common. */
#ifndef LINK_EXCHANGE_H
#define LINK_EXCHANGE_H

#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>
#include <hm2/link.h>

/* A mock may answer more than a card can, to show what becomes of it. */
#define EXCHANGE_MAX_DATAGRAM_BYTES 2048u
/* More than any capture that can be read has when its datagrams have some bytes; bounds the memory of a hostile one. */
#define EXCHANGE_MAX_ITEMS ((size_t)1 << 22)
/* Keeps every sum of two times inside 64 bits; 36 years. */
#define EXCHANGE_MAX_NS INT64_C(0x1000000000000000)

enum exchange_kind {
    EXCHANGE_EXPECT, /* the client sends exactly this */
    EXCHANGE_REPLY,  /* follows the last expected datagram by delay_ns */
    EXCHANGE_FAIL,   /* the client's next send fails */
};

struct exchange_item {
    enum exchange_kind kind;
    unsigned line;  /* of the text it came from */
    size_t at, len; /* of its bytes */
    int64_t delay_ns;
};

struct exchange {
    struct exchange_item *items;
    size_t count, item_capacity;
    uint8_t *bytes;
    size_t used, byte_capacity;
};

/* Append an item and its bytes; item->at is set here. HM2_ERR_NOMEM, HM2_ERR_NOSPACE, with a sentence in diag. */
int exchange_add(struct exchange *exchange, const struct exchange_item *item, const uint8_t *bytes,
                 struct hm2_diag *diag);
void exchange_free(struct exchange *exchange);

/* A mock that follows the exchange and frees it in the end; on failure the exchange is freed at once. */
int link_mock_follow(struct link **link, struct exchange *exchange, struct hm2_diag *diag);

#endif
