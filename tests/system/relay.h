/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A relay between a driver and several cards on UDP, which shows whether the driver asks all cards before it waits for
 * one: it keeps a card's reply back until the other cards have been asked as often. A driver that waits for one
 * reply after the other never gets them in time. Nothing here depends on how fast anything is.
 */
#ifndef TEST_RELAY_H
#define TEST_RELAY_H

#include <stdbool.h>

#define RELAY_CARDS 3u

struct relay;

/* Listen at `from[i]` for the card at `to[i]` (IPv4 addresses, the usual port) in a thread of its own. */
struct relay *relay_start(unsigned cards, char from[][16], char to[][16]);
void relay_stop(struct relay *relay);

/* From now on keep replies back. What passes must be requests that are answered, one datagram each. Off at first. */
void relay_hold(struct relay *relay, bool hold);
/* Requests of a card since relay_hold(). */
unsigned relay_requests(struct relay *relay, unsigned card);
/* Replies that were kept back for half a second in vain, and then passed. */
unsigned relay_released(struct relay *relay);

#endif
