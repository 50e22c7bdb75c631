/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Serial ports of a card and the world outside, as bytes. */
#include "card_state.h"
#include "serial_line.h"

/* A peer may answer a byte from within the step in which it was sent: the receiver is as far as that then. */
static struct serial_feed *feed_of(struct sim_card *const card, const uint8_t gtag, const unsigned unit)
{
    const uint8_t receiver = gtag == HM2_GTAG_UART_TX ? HM2_GTAG_UART_RX : HM2_GTAG_PKTUART_RX;
    struct sim_module *const rx = sim_module_of(card, receiver);
    if (rx && !rx->advancing)
        sim_sync(rx);
    return rx && rx->ops->serial_feed && unit < rx->md.instances ? rx->ops->serial_feed(rx, unit) : NULL;
}

int sim_card_serial(struct sim_card *const card, const uint8_t gtag, const unsigned unit, const sim_serial_fn sent,
                    void *const context)
{
    struct sim_module *const tx = sim_find(card, gtag);
    struct serial_feed *const feed = feed_of(card, gtag, unit);
    if (!tx || !tx->ops->serial_attach || unit >= tx->md.instances || !feed)
        return HM2_ERR_NOTFOUND;
    tx->ops->serial_attach(tx, unit, sent, context);
    feed->attached = true;
    return 0;
}

size_t sim_card_serial_put(struct sim_card *const card, const uint8_t gtag, const unsigned unit,
                           const uint8_t *const bytes, const size_t len)
{
    struct serial_feed *const feed = feed_of(card, gtag, unit);
    return feed ? serial_feed_put(feed, bytes, len) : 0;
}
