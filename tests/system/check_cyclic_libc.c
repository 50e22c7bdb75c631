/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * No allocation, no lock, no formatting in a cycle, whatever happens in it: libc/watch.h counts such calls while the
 * thread that runs the cycle is inside of it. The card is simulated in another
 * thread, on UDP over loopback, with a bad network in front, a reset of its power, and a freeze.
 */
#include <arpa/inet.h>
#include <check.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <hm2/board.h>
#include <hm2/sim.h>

#include "libc/watch.h"
#include "process.h"
#include "suite.h"

/* ---- the card, in a thread of its own -----------------------------------------------------------------------------
 */

enum order { ORDER_NONE, ORDER_FAULTS, ORDER_CALM, ORDER_FREEZE, ORDER_THAW, ORDER_POWER_CYCLE, ORDER_LEAVE };

struct card {
    struct sim_card *card;
    struct sim_net *net;
    struct sockaddr_in at, client;
    int fd;
    _Atomic int order; /* ORDER_NONE = carried out */
    atomic_bool ends;
    pthread_t thread;
};

static int64_t now_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void answer(void *const context, const uint64_t client, const uint8_t *const data, const size_t len,
                   const bool foreign)
{
    const struct card *const c = context;
    (void)client;
    if (!foreign)
        (void)!sendto(c->fd, data, len, MSG_NOSIGNAL, (const struct sockaddr *)&c->client, sizeof c->client);
}

static void listen_here(struct card *const c)
{
    const int one = 1;
    c->fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    (void)setsockopt(c->fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (c->fd < 0 || bind(c->fd, (const struct sockaddr *)&c->at, sizeof c->at) != 0)
        abort();
}

static const struct sim_faults bad = {.seed = 7,
                                      .loss = 0.05,
                                      .duplicate = 0.05,
                                      .reorder = 0.05,
                                      .truncate = 0.03,
                                      .foreign = 0.02,
                                      .delay_max_ns = 400000};

static void obey(struct card *const c)
{
    static const struct sim_faults none = {0};
    switch (atomic_load(&c->order)) {
    case ORDER_FAULTS:
        (void)sim_net_set_faults(c->net, &bad);
        break;
    case ORDER_CALM:
        (void)sim_net_set_faults(c->net, &none);
        break;
    case ORDER_FREEZE:
    case ORDER_THAW:
        sim_net_freeze(c->net, atomic_load(&c->order) == ORDER_FREEZE);
        break;
    case ORDER_POWER_CYCLE:
        sim_card_power_cycle(c->card);
        break;
    case ORDER_LEAVE: /* nobody listens: the kernel refuses packets */
        close(c->fd);
        usleep(50000);
        listen_here(c);
        break;
    default:
        break;
    }
    atomic_store(&c->order, ORDER_NONE);
}

static void *card_main(void *const context)
{
    struct card *const c = context;
    uint8_t data[LINK_MAX_DATAGRAM_BYTES];
    while (!atomic_load(&c->ends)) {
        const int64_t due_ns = sim_net_next_ns(c->net) - now_ns();
        const int64_t wait_ns = due_ns < 0 ? 0 : due_ns < 1000000 ? due_ns : 1000000;
        const struct timespec wait = {.tv_nsec = (long)wait_ns};
        struct pollfd ready = {.fd = c->fd, .events = POLLIN};
        socklen_t size = sizeof c->client;
        if (ppoll(&ready, 1, &wait, NULL) > 0) {
            const ssize_t len = recvfrom(c->fd, data, sizeof data, MSG_DONTWAIT, (struct sockaddr *)&c->client, &size);
            if (len >= 0)
                sim_net_arrive(c->net, now_ns(), 0, data, (size_t)len);
        }
        sim_net_sleep_until(c->net, now_ns());
        obey(c);
    }
    return NULL;
}

static void order(struct card *const c, const enum order what, const bool wait)
{
    atomic_store(&c->order, what);
    while (wait && atomic_load(&c->order) != ORDER_NONE)
        usleep(100);
}

static void start_card(struct card *const c, const char *const profile, const char *const address)
{
    const struct sim_card_options options = {.profile = profile, .seed = 3};
    struct hm2_diag diag = {0};
    c->at = (struct sockaddr_in){.sin_family = AF_INET, .sin_port = htons(27181)};
    ck_assert_int_eq(inet_pton(AF_INET, address, &c->at.sin_addr), 1);
    ck_assert_int_eq(sim_card_new(&c->card, &options, &diag), 0);
    ck_assert_int_eq(sim_net_new(&c->net, c->card, NULL), 0);
    sim_net_on_deliver(c->net, answer, c);
    sim_net_sleep_until(c->net, now_ns());
    sim_card_set_time(c->card, now_ns());
    listen_here(c);
    ck_assert_int_eq(pthread_create(&c->thread, NULL, card_main, c), 0);
}

static void stop_card(struct card *const c)
{
    atomic_store(&c->ends, true);
    pthread_join(c->thread, NULL);
    close(c->fd);
    sim_net_free(c->net);
    sim_card_free(c->card);
}

/* ---- the board ----------------------------------------------------------------------------------------------------
 */

#define PERIOD_NS 1000000

struct host {
    struct hm2_board *board;
    struct hm2_plain_binder *plain;
    unsigned cycles;
    uint64_t random;
    char text[256 * 1024]; /* messages so far */
    size_t len;
};

static double get(const struct host *const h, const char *const name)
{
    char full[128];
    int err;
    snprintf(full, sizeof full, "%s.%s", hm2_board_prefix(h->board), name);
    const double value = hm2_plain_get(h->plain, full, &err);
    ck_assert_msg(err == 0, "no point %s", full);
    return value;
}

static void set(const struct host *const h, const char *const name, const double value)
{
    char full[128];
    snprintf(full, sizeof full, "%s.%s", hm2_board_prefix(h->board), name);
    ck_assert_int_eq(hm2_plain_set(h->plain, full, value), 0);
}

static unsigned below(struct host *const h, const unsigned limit)
{
    h->random = h->random * 6364136223846793005u + 1442695040888963407u;
    return (unsigned)(h->random >> 33) % limit;
}

/* A host may write anything to what it may write, except what this test itself steers by, raw access, which could mean
 * any of that, and the DPLL's rate, at which the simulated card cannot always keep up with real time. */
static bool is_steered_by(const char *const name)
{
    static const char *const parts[] = {".packet-", ".io_error", ".watchdog.", ".raw.", ".dpll."};
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++)
        if (strstr(name, parts[i]))
            return true;
    return false;
}

static void change_something(struct host *const h)
{
    static const double values[] = {0, 1, -1, 2, 0.5, 1000, -1000, 1e6, -1e6, 4e9, 1e300, -1e300, NAN, INFINITY};
    const struct hm2_plain_object *const object = hm2_plain_at(h->plain, below(h, (unsigned)hm2_plain_count(h->plain)));
    const enum hm2_point_dir dir = object->point->dir;
    if (dir == HM2_PIN_OUT || dir == HM2_PARAM_RO || is_steered_by(object->name))
        return;
    const unsigned which = below(h, sizeof values / sizeof values[0] + 4);
    const double value = which < sizeof values / sizeof values[0] ? values[which] : object->point->initial;
    hm2_point_store(object->point->type, object->value, value);
}

static void read_messages(struct host *const h)
{
    bool error;
    while (h->len + 1024 < sizeof h->text && hm2_board_next_message(h->board, h->text + h->len, 1024, &error) > 0)
        h->len += strlen(h->text + h->len);
}

/* The watched part is what a servo thread calls. */
static void cycle(struct host *const h, const bool changes)
{
    for (unsigned i = 0; changes && i < 4; i++)
        change_something(h);
    watch_begin();
    if (h->cycles % 2 == 0)
        hm2_board_request(h->board, PERIOD_NS);
    hm2_board_read(h->board, PERIOD_NS);
    hm2_board_write(h->board, PERIOD_NS);
    watch_end();
    h->cycles++;
    if (h->cycles % 64 == 0)
        read_messages(h);
}

static void cycles(struct host *const h, const unsigned count, const bool changes)
{
    for (unsigned i = 0; i < count; i++)
        cycle(h, changes);
    read_messages(h);
}

static void load(struct host *const h, const char *const address)
{
    const struct link_udp_options options = {.address = address, .watch_strangers = true};
    struct hm2_diag diag = {0};
    struct link *link;
    h->board = hm2_board_new();
    h->plain = hm2_plain_binder_new();
    if (link_udp_open(&link, &options, &diag) || hm2_board_identify(h->board, link, &diag) ||
        hm2_board_setup(h->board, 0, hm2_plain_binder(h->plain), "enable_raw", &diag) ||
        hm2_board_start(h->board, &diag))
        ck_abort_msg("%.1000s", diag.text);
    set(h, "packet-error-limit", 1e9);
    set(h, "packet-read-timeout", 1000000);
    set(h, "watchdog.timeout_ns", 50000000);
}

static void unload(struct host *const h)
{
    hm2_board_stop(h->board);
    hm2_board_free(h->board);
    hm2_plain_binder_free(h->plain);
}

static void clear_bite(struct host *const h)
{
    set(h, "watchdog.has_bit", 0);
    set(h, "io_error", 0);
    cycles(h, 500, true);
    ck_assert(get(h, "watchdog.has_bit") == 0);
}

/* Everything that can happen to a card while it is in use. */
static void live(struct host *const h, struct card *const c)
{
    cycles(h, 3000, true);
    order(c, ORDER_FAULTS, true);
    cycles(h, 4000, true);
    order(c, ORDER_CALM, true);
    ck_assert(get(h, "packet-lost") > 0 && get(h, "packet-late") > 0 && get(h, "packet-stale") > 0);
    ck_assert(get(h, "packet-malformed") > 0 && get(h, "write-lost") > 0);

    set(h, "watchdog.has_bit", 0);
    cycles(h, 500, true);
    usleep(200000); /* no writes for longer than the watchdog's time */
    cycles(h, 500, true);
    ck_assert(get(h, "watchdog.has_bit") == 1);
    clear_bite(h);

    order(c, ORDER_FREEZE, true);
    cycles(h, 100, true);
    order(c, ORDER_THAW, true);
    order(c, ORDER_LEAVE, false); /* and comes back meanwhile */
    cycles(h, 500, true);

    order(c, ORDER_POWER_CYCLE, true);
    for (unsigned i = 0; i < 20000 && !strstr(h->text, "back with the same firmware"); i++) {
        cycle(h, true);
        read_messages(h);
    }
    ck_assert_ptr_nonnull(strstr(h->text, "has lost its state"));
    ck_assert_ptr_nonnull(strstr(h->text, "back with the same firmware"));
    ck_assert(get(h, "watchdog.has_bit") == 1);
    clear_bite(h);
    cycles(h, 1000, true);
}

static const char *const profiles[] = {"7i96s", "7i93"};

START_TEST(no_cycle_allocates_locks_or_formats_whatever_happens)
{
    static struct host host;
    static struct card card;
    char address[16];
#if !WATCH_WORKS
    printf("SKIP: a sanitizer brings its own allocator, so calls cannot be counted\n");
    return;
#endif
    host.random = 1;
    test_address(0, address);
    start_card(&card, profiles[_i], address);
    load(&host, address);
    live(&host, &card);
    unload(&host);
    stop_card(&card);
    ck_assert_uint_gt(host.cycles, 10000);
    for (enum watch_kind kind = 0; kind < WATCH_KINDS; kind++)
        if (watch_calls(kind) > 0)
            ck_abort_msg("%lu calls in %u cycles, the last one of %s", watch_calls(kind), host.cycles,
                         watch_last(kind));
}
END_TEST

/* The counters see what the library does outside its cycle. */
START_TEST(calls_of_the_library_are_seen)
{
#if !WATCH_WORKS
    return;
#else
    pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    struct hm2_diag diag = {0};
    watch_begin();
    hm2_board_free(hm2_board_new());
    hm2_diag_warn(&diag, "%d", 1);
    pthread_mutex_lock(&mutex);
    watch_end();
    pthread_mutex_unlock(&mutex);
    ck_assert_uint_ge(watch_calls(WATCH_ALLOCATION), 2);
    ck_assert_uint_ge(watch_calls(WATCH_FORMATTING), 1);
    ck_assert_uint_ge(watch_calls(WATCH_LOCK), 1);
#endif
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("cyclic path");
    TCase *const tests = tcase_create("calls");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, calls_of_the_library_are_seen);
    tcase_add_loop_test(tests, no_cycle_allocates_locks_or_formats_whatever_happens, 0,
                        (int)(sizeof profiles / sizeof profiles[0]));
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
