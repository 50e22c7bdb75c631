/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "relay.h"

#include <arpa/inet.h>
#include <check.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define CARD_PORT   27181
#define HOLD_MS     500
#define POLL_MS     20
#define MAX_PAYLOAD 2048

struct side {
    int driver, card; /* sockets */
    struct sockaddr_in client;
    atomic_uint requests;
    unsigned replies;
    bool held; /* a reply is kept back in bytes[] */
    int64_t held_ms;
    size_t len;
    uint8_t bytes[MAX_PAYLOAD];
};

struct relay {
    unsigned cards;
    pthread_t thread;
    atomic_bool hold, end;
    atomic_uint released;
    struct side sides[RELAY_CARDS];
};

static int64_t now_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static void take_request(struct relay *const relay, struct side *const side)
{
    uint8_t bytes[MAX_PAYLOAD];
    socklen_t client_len = sizeof side->client;
    const ssize_t len =
        recvfrom(side->driver, bytes, sizeof bytes, MSG_DONTWAIT, (struct sockaddr *)&side->client, &client_len);
    if (len < 0)
        return;
    if (atomic_load(&relay->hold))
        atomic_fetch_add(&side->requests, 1);
    (void)!send(side->card, bytes, (size_t)len, MSG_DONTWAIT);
}

static void pass(struct side *const side)
{
    side->held = false;
    (void)!sendto(side->driver, side->bytes, side->len, MSG_DONTWAIT, (const struct sockaddr *)&side->client,
                  sizeof side->client);
}

static void take_reply(struct relay *const relay, struct side *const side)
{
    const ssize_t len = recv(side->card, side->bytes, sizeof side->bytes, MSG_DONTWAIT);
    if (len < 0)
        return;
    side->len = (size_t)len;
    side->held = true;
    side->held_ms = now_ms();
    if (atomic_load(&relay->hold))
        side->replies++;
    else
        pass(side);
}

static bool all_were_asked(const struct relay *const relay, const unsigned times)
{
    for (unsigned i = 0; i < relay->cards; i++)
        if (atomic_load(&relay->sides[i].requests) < times)
            return false;
    return true;
}

static void pass_what_may_go(struct relay *const relay)
{
    for (unsigned i = 0; i < relay->cards; i++) {
        struct side *const side = &relay->sides[i];
        if (!side->held)
            continue;
        const bool in_vain = now_ms() - side->held_ms >= HOLD_MS;
        if (!in_vain && !all_were_asked(relay, side->replies))
            continue;
        if (!all_were_asked(relay, side->replies))
            atomic_fetch_add(&relay->released, 1);
        pass(side);
    }
}

static void *run(void *const context)
{
    struct relay *const relay = context;
    struct pollfd events[2 * RELAY_CARDS];
    for (unsigned i = 0; i < relay->cards; i++) {
        events[2 * i] = (struct pollfd){.fd = relay->sides[i].driver, .events = POLLIN};
        events[2 * i + 1] = (struct pollfd){.fd = relay->sides[i].card, .events = POLLIN};
    }
    while (!atomic_load(&relay->end)) {
        (void)poll(events, 2 * relay->cards, POLL_MS);
        for (unsigned i = 0; i < relay->cards; i++) {
            take_request(relay, &relay->sides[i]);
            if (!relay->sides[i].held)
                take_reply(relay, &relay->sides[i]);
        }
        pass_what_may_go(relay);
    }
    return NULL;
}

static struct sockaddr_in at(const char *const text)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(CARD_PORT)};
    ck_assert_int_eq(inet_pton(AF_INET, text, &address.sin_addr), 1);
    return address;
}

struct relay *relay_start(const unsigned cards, char from[][16], char to[][16])
{
    struct relay *const relay = calloc(1, sizeof *relay);
    ck_assert_ptr_nonnull(relay);
    ck_assert_uint_le(cards, RELAY_CARDS);
    relay->cards = cards;
    for (unsigned i = 0; i < cards; i++) {
        struct side *const side = &relay->sides[i];
        const struct sockaddr_in driver = at(from[i]), card = at(to[i]);
        side->driver = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
        side->card = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
        ck_assert_int_eq(bind(side->driver, (const struct sockaddr *)&driver, sizeof driver), 0);
        ck_assert_int_eq(connect(side->card, (const struct sockaddr *)&card, sizeof card), 0);
    }
    ck_assert_int_eq(pthread_create(&relay->thread, NULL, run, relay), 0);
    return relay;
}

void relay_stop(struct relay *const relay)
{
    atomic_store(&relay->end, true);
    pthread_join(relay->thread, NULL);
    for (unsigned i = 0; i < relay->cards; i++) {
        close(relay->sides[i].driver);
        close(relay->sides[i].card);
    }
    free(relay);
}

void relay_hold(struct relay *const relay, const bool hold)
{
    atomic_store(&relay->hold, hold);
}

unsigned relay_requests(struct relay *const relay, const unsigned card)
{
    return atomic_load(&relay->sides[card].requests);
}

unsigned relay_released(struct relay *const relay)
{
    return atomic_load(&relay->released);
}
