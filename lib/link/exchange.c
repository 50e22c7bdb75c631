/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "exchange.h"

#include <stdlib.h>
#include <string.h>

/* Room for `needed` elements of `size` bytes, doubling; both are bounded by the length of the text they come from. */
static void *grown(void *const memory, size_t *const capacity, const size_t needed, const size_t size)
{
    if (needed <= *capacity)
        return memory;
    const size_t room = needed < 64 ? 64 : 2 * needed;
    void *const larger = realloc(memory, room * size);
    if (larger)
        *capacity = room;
    return larger;
}

/* Make room for one item more and its bytes. */
static int make_room(struct exchange *const exchange, const size_t len)
{
    struct exchange_item *const items =
        grown(exchange->items, &exchange->item_capacity, exchange->count + 1, sizeof items[0]);
    if (!items)
        return HM2_ERR_NOMEM;
    exchange->items = items;
    uint8_t *const bytes = grown(exchange->bytes, &exchange->byte_capacity, exchange->used + len + 1, 1);
    if (!bytes)
        return HM2_ERR_NOMEM;
    exchange->bytes = bytes;
    return 0;
}

int exchange_add(struct exchange *const exchange, const struct exchange_item *const item, const uint8_t *const bytes,
                 struct hm2_diag *const diag)
{
    if (exchange->count == EXCHANGE_MAX_ITEMS)
        return hm2_diag_add(diag, HM2_ERR_NOSPACE, "Line %u: more than %zu datagrams.", item->line, EXCHANGE_MAX_ITEMS);
    const int err = make_room(exchange, item->len);
    if (err)
        return hm2_diag_add(diag, err, "Line %u: no memory for %zu datagrams.", item->line, exchange->count + 1);
    if (item->len > 0)
        memcpy(exchange->bytes + exchange->used, bytes, item->len);
    exchange->items[exchange->count] = *item;
    exchange->items[exchange->count].at = exchange->used;
    exchange->count++;
    exchange->used += item->len;
    return 0;
}

void exchange_free(struct exchange *const exchange)
{
    free(exchange->items);
    free(exchange->bytes);
    *exchange = (struct exchange){0};
}
