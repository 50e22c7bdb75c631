/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The UDP link on loopback, with ports that the kernel chooses. Waits are for events; where a deadline itself is the
 * subject only its lower bound is checked, so that a busy machine cannot fail a test. */
#include "unit.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <hm2/link.h>

#define NS_PER_MS INT64_C(1000000)
#define SOON_NS   (10000 * NS_PER_MS) /* far beyond what loopback needs */

/* A card: a socket on 127.0.0.1. */
struct peer {
    int fd;
    char address[32];
    struct sockaddr_in at;
};

static void peer_open(struct peer *const peer)
{
    socklen_t len = sizeof peer->at;
    peer->at = (struct sockaddr_in){.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    peer->fd = socket(AF_INET, SOCK_DGRAM, 0);
    assert_true(peer->fd >= 0);
    assert_int_equal(bind(peer->fd, (const struct sockaddr *)&peer->at, sizeof peer->at), 0);
    assert_int_equal(getsockname(peer->fd, (struct sockaddr *)&peer->at, &len), 0);
    (void)snprintf(peer->address, sizeof peer->address, "127.0.0.1:%u", ntohs(peer->at.sin_port));
}

/* Ways to receive. All tests run with each of them. */
static const struct way {
    const char *name;
    unsigned busy_poll_us;
    bool spin;
} ways[] = {{"wait", 0, false}, {"busy poll", 50, false}, {"spin", 0, true}, {"busy poll and spin", 50, true}};

static const struct way *way = &ways[0];

static struct link *open_link(const struct peer *const peer, const bool watch)
{
    const struct link_udp_options options = {
        .address = peer->address, .busy_poll_us = way->busy_poll_us, .spin = way->spin, .watch_strangers = watch};
    struct hm2_diag diag = {0};
    struct link *link = NULL;
    if (link_udp_open(&link, &options, &diag) != 0)
        fail_msg("%s", diag.text);
    return link;
}

/* Receive at the peer and learn the link's address. */
static size_t peer_receive(const struct peer *const peer, void *const data, const size_t cap, struct sockaddr_in *from)
{
    socklen_t len = sizeof *from;
    struct pollfd ready = {.fd = peer->fd, .events = POLLIN};
    assert_int_equal(poll(&ready, 1, 10000), 1);
    const ssize_t got = recvfrom(peer->fd, data, cap, 0, (struct sockaddr *)from, &len);
    assert_true(got >= 0);
    return (size_t)got;
}

static void send_to(const int fd, const struct sockaddr_in *const to, const void *const data, const size_t len)
{
    assert_int_equal(sendto(fd, data, len, 0, (const struct sockaddr *)to, sizeof *to), (ssize_t)len);
}

static void a_datagram_goes_to_the_card_and_its_reply_comes_back(void **state)
{
    (void)state;
    struct peer card;
    struct sockaddr_in from;
    uint8_t data[64];
    peer_open(&card);
    struct link *const link = open_link(&card, false);
    assert_int_equal(link_send(link, "\x01\x42\x00\x01", 4), 0);
    assert_int_equal(peer_receive(&card, data, sizeof data, &from), 4);
    assert_memory_equal(data, "\x01\x42\x00\x01", 4);
    send_to(card.fd, &from, "\xfe\xca\xaa\x55", 4);
    send_to(card.fd, &from, "", 0);
    send_to(card.fd, &from, "0123456789", 10);
    const int64_t deadline_ns = link_now_ns(link) + SOON_NS;
    assert_int_equal(link_recv(link, data, sizeof data, deadline_ns), 4);
    assert_memory_equal(data, "\xfe\xca\xaa\x55", 4);
    assert_int_equal(link_recv(link, data, sizeof data, deadline_ns), 0);
    assert_int_equal(link_recv(link, data, 9, deadline_ns), HM2_ERR_NOSPACE);
    assert_int_equal(link_recv(link, data, sizeof data, 0), HM2_ERR_TIMEOUT); /* it was consumed */
    assert_int_equal(link->counters.sent, 1);
    assert_int_equal(link->counters.received, 3);
    link_close(link);
    (void)close(card.fd);
}

static void the_deadline_is_honoured_and_a_past_one_takes_what_is_queued(void **state)
{
    (void)state;
    struct peer card;
    struct sockaddr_in from;
    uint8_t data[64];
    peer_open(&card);
    struct link *const link = open_link(&card, false);
    const int64_t deadline_ns = link_now_ns(link) + 5 * NS_PER_MS;
    assert_int_equal(link_recv(link, data, sizeof data, deadline_ns), HM2_ERR_TIMEOUT);
    assert_true(link_now_ns(link) >= deadline_ns);
    assert_int_equal(link_recv(link, data, sizeof data, INT64_MIN), HM2_ERR_TIMEOUT);
    assert_int_equal(link_send(link, "a", 1), 0);
    assert_int_equal(peer_receive(&card, data, sizeof data, &from), 1);
    send_to(card.fd, &from, "b", 1); /* loopback delivers before sendto returns */
    assert_int_equal(link_recv(link, data, sizeof data, 0), 1);
    link_close(link);
    (void)close(card.fd);
}

/* The board reads the clock, sends, and hands the reading on. */
static void the_callers_reading_of_the_clock_serves_as_well(void **state)
{
    (void)state;
    struct peer card;
    struct sockaddr_in from;
    uint8_t data[64];
    peer_open(&card);
    struct link *const link = open_link(&card, false);
    const int64_t begin_ns = link_now_ns(link), deadline_ns = begin_ns + 5 * NS_PER_MS;
    assert_int_equal(link_recv_from(link, data, sizeof data, deadline_ns, begin_ns), HM2_ERR_TIMEOUT);
    assert_true(link_now_ns(link) >= deadline_ns);
    assert_int_equal(link_recv_from(link, data, sizeof data, begin_ns, begin_ns), HM2_ERR_TIMEOUT);
    assert_int_equal(link_send(link, "a", 1), 0);
    assert_int_equal(peer_receive(&card, data, sizeof data, &from), 1);
    send_to(card.fd, &from, "bc", 2);
    send_to(card.fd, &from, "def", 3);
    const int64_t now_ns = link_now_ns(link);
    assert_int_equal(link_recv_from(link, data, sizeof data, now_ns + SOON_NS, now_ns), 2);
    assert_int_equal(link_recv_from(link, data, 2, now_ns + SOON_NS, now_ns), HM2_ERR_NOSPACE);
    assert_int_equal(link->counters.received, 2);
    (void)close(card.fd);
    assert_int_equal(link_send(link, "g", 1), 0); /* answered by ICMP: port unreachable */
    const int64_t then_ns = link_now_ns(link);
    assert_int_equal(link_recv_from(link, data, sizeof data, then_ns + 2 * NS_PER_MS, then_ns), HM2_ERR_TIMEOUT);
    assert_int_equal(link->counters.receive_errors, 1);
    link_close(link);
}

static void busy_polling_receives_and_keeps_the_deadline(void **state)
{
    (void)state;
    static const unsigned busy_us[] = {1, 1000, 1000000};
    struct peer card;
    struct sockaddr_in from;
    uint8_t data[64];
    peer_open(&card);
    for (size_t i = 0; i < sizeof busy_us / sizeof busy_us[0]; i++) {
        const struct link_udp_options options = {.address = card.address, .busy_poll_us = busy_us[i]};
        struct link *link = NULL;
        assert_int_equal(link_udp_open(&link, &options, NULL), 0);
        const int64_t deadline_ns = link_now_ns(link) + 3 * NS_PER_MS;
        assert_int_equal(link_recv(link, data, sizeof data, deadline_ns), HM2_ERR_TIMEOUT);
        assert_true(link_now_ns(link) >= deadline_ns);
        assert_int_equal(link_send(link, "a", 1), 0);
        assert_int_equal(peer_receive(&card, data, sizeof data, &from), 1);
        send_to(card.fd, &from, "b", 1);
        assert_int_equal(link_recv(link, data, sizeof data, link_now_ns(link) + SOON_NS), 1);
        assert_int_equal(link_recv(link, data, sizeof data, INT64_MIN), HM2_ERR_TIMEOUT);
        link_close(link);
    }
    (void)close(card.fd);
}

static void strangers_are_counted_and_never_received(void **state)
{
    (void)state;
    struct peer card, stranger;
    struct sockaddr_in from;
    uint8_t data[64];
    peer_open(&card);
    peer_open(&stranger);
    struct link *const link = open_link(&card, true);
    assert_int_equal(link_send(link, "a", 1), 0);
    assert_int_equal(peer_receive(&card, data, sizeof data, &from), 1);
    for (unsigned i = 0; i < 200; i++)
        send_to(stranger.fd, &from, "evil", 4);
    send_to(card.fd, &from, "b", 1);
    assert_int_equal(link_recv(link, data, sizeof data, link_now_ns(link) + SOON_NS), 1);
    assert_int_equal(data[0], 'b');
    assert_int_equal(link_recv(link, data, sizeof data, 0), HM2_ERR_TIMEOUT);
    for (unsigned i = 0; i < 10000 && link_strangers(link) < 200; i++)
        (void)poll(NULL, 0, 1);
    assert_int_equal(link_strangers(link), 200);
    assert_int_equal(link->counters.received, 1);
    link_close(link);
    (void)close(stranger.fd);
    (void)close(card.fd);
}

static void without_a_watch_strangers_are_not_received_either(void **state)
{
    (void)state;
    struct peer card, stranger;
    struct sockaddr_in from;
    uint8_t data[64];
    peer_open(&card);
    peer_open(&stranger);
    struct link *const link = open_link(&card, false);
    assert_int_equal(link_send(link, "a", 1), 0);
    assert_int_equal(peer_receive(&card, data, sizeof data, &from), 1);
    send_to(stranger.fd, &from, "evil", 4);
    assert_int_equal(link_recv(link, data, sizeof data, 0), HM2_ERR_TIMEOUT);
    link_close(link);
    (void)close(stranger.fd);
    (void)close(card.fd);
}

static void a_card_that_is_away_is_no_error_and_may_come_back(void **state)
{
    (void)state;
    struct peer card;
    struct sockaddr_in from;
    uint8_t data[64];
    peer_open(&card);
    struct link *const link = open_link(&card, false);
    (void)close(card.fd);
    assert_int_equal(link_send(link, "a", 1), 0); /* answered by ICMP: port unreachable */
    assert_int_equal(link_recv(link, data, sizeof data, link_now_ns(link) + 2 * NS_PER_MS), HM2_ERR_TIMEOUT);
    assert_int_equal(link->counters.receive_errors, 1);
    assert_int_equal(link_send(link, "b", 1), 0);
    assert_int_equal(link_send(link, "c", 1), 0); /* this send reports the error that "b" met, and is lost */
    assert_int_equal(link->counters.send_errors, 1);
    assert_int_equal(link->counters.sent, 2);
    assert_int_equal(link_recv(link, data, sizeof data, 0), HM2_ERR_TIMEOUT);

    card.fd = socket(AF_INET, SOCK_DGRAM, 0);
    assert_int_equal(bind(card.fd, (const struct sockaddr *)&card.at, sizeof card.at), 0);
    assert_int_equal(link_send(link, "d", 1), 0);
    assert_int_equal(peer_receive(&card, data, sizeof data, &from), 1);
    assert_int_equal(data[0], 'd');
    send_to(card.fd, &from, "e", 1);
    assert_int_equal(link_recv(link, data, sizeof data, link_now_ns(link) + SOON_NS), 1);
    link_close(link);
    (void)close(card.fd);
}

static void a_datagram_longer_than_the_cards_take_is_refused(void **state)
{
    (void)state;
    static uint8_t data[1473];
    struct peer card;
    struct sockaddr_in from;
    peer_open(&card);
    struct link *const link = open_link(&card, false);
    assert_int_equal(link_send(link, data, 1473), HM2_ERR_NOSPACE);
    assert_int_equal(link_send(link, data, 1472), 0);
    assert_int_equal(peer_receive(&card, data, sizeof data, &from), 1472);
    link_close(link);
    (void)close(card.fd);
}

static void two_links_of_one_host_do_not_hear_each_other(void **state)
{
    (void)state;
    struct peer cards[2];
    struct link *links[2];
    struct sockaddr_in from[2] = {0};
    uint8_t data[8];
    for (unsigned i = 0; i < 2; i++) {
        peer_open(&cards[i]);
        links[i] = open_link(&cards[i], true);
        assert_int_equal(link_send(links[i], "a", 1), 0);
        assert_int_equal(peer_receive(&cards[i], data, sizeof data, &from[i]), 1);
    }
    assert_int_not_equal(from[0].sin_port, from[1].sin_port);
    send_to(cards[1].fd, &from[1], "x", 1);
    assert_int_equal(link_recv(links[0], data, sizeof data, 0), HM2_ERR_TIMEOUT);
    assert_int_equal(link_recv(links[1], data, sizeof data, link_now_ns(links[1]) + SOON_NS), 1);
    for (unsigned i = 0; i < 2; i++) {
        assert_int_equal(link_strangers(links[i]), 0);
        link_close(links[i]);
        (void)close(cards[i].fd);
    }
}

static void an_address_is_parsed_strictly(void **state)
{
    (void)state;
    static const struct {
        const char *address, *says;
    } wrong[] = {
        {"", "four numbers"},
        {NULL, "four numbers"},
        {"192.168.1", "four numbers"},
        {"192.168.1.121.5", "0 to 255"},
        {"192.168.1.256", "0 to 255"},
        {"192.168.1.", "0 to 255"},
        {"192.168..1", "0 to 255"},
        {" 192.168.1.121", "0 to 255"},
        {"192.168.1.121 ", "0 to 255"},
        {"192.168.01.121", "leading zeros"},
        {"0xC0.168.1.121", "0 to 255"},
        {"192.168.1.-1", "0 to 255"},
        {"card", "four numbers"},
        {"192.168.1.121:", "port must be"},
        {"192.168.1.121:0", "port must be"},
        {"192.168.1.121:65536", "port must be"},
        {"192.168.1.121:99999999999999999999", "port must be"},
        {"192.168.1.121:27181x", "port must be"},
        {"0.0.0.0", "group or of nobody"},
        {"224.0.0.1", "group or of nobody"},
        {"255.255.255.255", "group or of nobody"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const struct link_udp_options options = {.address = wrong[i].address};
        struct hm2_diag diag = {0};
        struct link *link = NULL;
        const int err = link_udp_open(&link, &options, &diag);
        if (err != HM2_ERR_INVALID || link || !strstr(diag.text, wrong[i].says))
            fail_msg("row %zu: %d \"%s\"", i, err, diag.text);
    }
    static const char *const right[] = {"127.0.0.1", "127.0.0.1:1", "127.255.0.10:65535"};
    for (size_t i = 0; i < sizeof right / sizeof right[0]; i++) {
        const struct link_udp_options options = {.address = right[i], .busy_poll_us = 50};
        struct hm2_diag diag = {0};
        struct link *link = NULL;
        assert_int_equal(link_udp_open(&link, &options, &diag), 0);
        assert_int_equal(diag.problems, 0);
        link_close(link);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_datagram_goes_to_the_card_and_its_reply_comes_back),
        cmocka_unit_test(the_deadline_is_honoured_and_a_past_one_takes_what_is_queued),
        cmocka_unit_test(the_callers_reading_of_the_clock_serves_as_well),
        cmocka_unit_test(busy_polling_receives_and_keeps_the_deadline),
        cmocka_unit_test(strangers_are_counted_and_never_received),
        cmocka_unit_test(without_a_watch_strangers_are_not_received_either),
        cmocka_unit_test(a_card_that_is_away_is_no_error_and_may_come_back),
        cmocka_unit_test(a_datagram_longer_than_the_cards_take_is_refused),
        cmocka_unit_test(two_links_of_one_host_do_not_hear_each_other),
        cmocka_unit_test(an_address_is_parsed_strictly),
    };
    int failed = 0;
    for (way = ways; way < ways + sizeof ways / sizeof ways[0]; way++) {
        print_message("receive: %s\n", way->name);
        failed += cmocka_run_group_tests(tests, NULL, NULL);
    }
    return failed;
}
