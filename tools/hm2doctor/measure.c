/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Round trips to the card: one a period, several without a pause, and pairs. Only the card's description is read. */
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include <hm2/idrom.h>
#include <hm2/lbp16.h>

#include "doctor.h"

#define NS_PER_US     1000
#define NS_PER_S      1000000000L
#define LOST_AFTER_NS (10L * 1000 * 1000) /* a reply that takes longer is no use in any servo period */
#define PRIORITY      49
#define BURSTS        200u
#define BURST_ROUNDS  4u
#define PAIRS         200u
#define PAUSE_NS      (2L * 1000 * 1000)
#define WORD_BYTES    4u
#define MAX_WORDS     LBP16_MAX_COUNT

struct meter {
    struct link *link;
    const struct waiting *waiting;
    uint8_t request[64];
    size_t request_len, reply_len;
};

static int make_request(struct meter *const meter, unsigned reply_bytes)
{
    struct lbp16_builder builder;
    size_t offset;
    int err = 0;
    lbp16_builder_init(&builder, meter->request, sizeof meter->request);
    for (unsigned words = reply_bytes / WORD_BYTES; words > 0 && !err;) {
        const unsigned now = words < MAX_WORDS ? words : MAX_WORDS;
        err = lbp16_add_read_hm2(&builder, HM2_ADDR_COOKIE, now, &offset);
        words -= now;
    }
    meter->request_len = builder.used;
    meter->reply_len = reply_bytes / WORD_BYTES * WORD_BYTES;
    return err;
}

static void drop_old_replies(const struct meter *const meter)
{
    uint8_t reply[LINK_MAX_DATAGRAM_BYTES];
    while (link_recv(meter->link, reply, sizeof reply, 0) >= 0) {
    }
}

/* When the next reply came, or a negative value. */
static int64_t next_reply(const struct meter *const meter, const int64_t deadline_ns)
{
    uint8_t reply[LINK_MAX_DATAGRAM_BYTES];
    const int len = link_recv(meter->link, reply, sizeof reply, deadline_ns);
    return len == (int)meter->reply_len ? link_now_ns(meter->link) : -1;
}

/* Nanoseconds, or a negative value when there was no reply. */
static int64_t round_trip(const struct meter *const meter)
{
    const int64_t start = link_now_ns(meter->link);
    if (link_send(meter->link, meter->request, meter->request_len) < 0)
        return -1;
    const int64_t end = next_reply(meter, start + LOST_AFTER_NS);
    return end < 0 ? -1 : end - start;
}

static void wait_until(const struct meter *const meter, const int64_t ns)
{
    meter->waiting->until(meter->waiting->context, ns);
}

static void measure_paced(const struct meter *const meter, const struct measuring *const what,
                          struct rounds *const rounds, const size_t count)
{
    int64_t next = link_now_ns(meter->link);
    for (size_t i = 0; i < count; i++) {
        next += what->period_us * NS_PER_US;
        wait_until(meter, next);
        drop_old_replies(meter);
        const int64_t ns = round_trip(meter);
        if (ns < 0)
            rounds->lost++;
        else
            rounds->paced_ns[rounds->paced++] = ns;
        const int64_t now = link_now_ns(meter->link);
        next = now > next + what->period_us * NS_PER_US ? now : next; /* do not catch up */
    }
}

/* The first of a burst wakes whatever sleeps; it does not count. */
static void measure_bursts(const struct meter *const meter, struct rounds *const rounds)
{
    for (unsigned i = 0; i < BURSTS; i++) {
        wait_until(meter, link_now_ns(meter->link) + PAUSE_NS);
        drop_old_replies(meter);
        for (unsigned k = 0; k < BURST_ROUNDS; k++) {
            const int64_t ns = round_trip(meter);
            if (ns < 0)
                break;
            if (k > 0)
                rounds->burst_ns[rounds->burst++] = ns;
        }
    }
}

static void measure_pairs(const struct meter *const meter, struct rounds *const rounds)
{
    for (unsigned i = 0; i < PAIRS; i++) {
        wait_until(meter, link_now_ns(meter->link) + PAUSE_NS);
        drop_old_replies(meter);
        const int64_t start = link_now_ns(meter->link);
        if (link_send(meter->link, meter->request, meter->request_len) < 0)
            continue;
        const int64_t first = next_reply(meter, start + PAIR_NS);
        wait_until(meter, start + PAIR_NS);
        if (link_send(meter->link, meter->request, meter->request_len) < 0)
            continue;
        const int64_t once = first >= 0 ? first : next_reply(meter, start + LOST_AFTER_NS);
        const int64_t twice = once >= 0 ? next_reply(meter, start + LOST_AFTER_NS) : -1;
        if (twice >= 0)
            rounds->spacing_ns[rounds->spacing++] = twice - once;
    }
}

/* Touched here, not in the midst of a round. */
static int64_t *touched_list(const size_t count)
{
    int64_t *const list = malloc(count * sizeof *list);
    if (list)
        memset(list, 0xFF, count * sizeof *list);
    return list;
}

static int allocate(struct rounds *const rounds, const size_t count)
{
    rounds->paced_ns = touched_list(count);
    rounds->burst_ns = touched_list(BURSTS * BURST_ROUNDS);
    rounds->spacing_ns = touched_list(PAIRS);
    return rounds->paced_ns && rounds->burst_ns && rounds->spacing_ns ? 0 : HM2_ERR_NOMEM;
}

int rounds_measure_by(struct link *const link, const struct waiting *const waiting, const struct measuring *const what,
                      struct rounds *const rounds, struct hm2_diag *const diag)
{
    const long wanted = what->seconds * (1000000L / what->period_us);
    const size_t count = wanted < (long)MAX_ROUNDS ? (size_t)wanted : MAX_ROUNDS;
    struct meter meter = {.link = link, .waiting = waiting};
    int err = make_request(&meter, what->reply_bytes);
    if (!err)
        err = allocate(rounds, count > 0 ? count : 1);
    if (err)
        return hm2_diag_add(diag, err, "no memory for %zu round trips\n", count);
    measure_paced(&meter, what, rounds, count);
    if (rounds->paced > 0) {
        measure_bursts(&meter, rounds);
        measure_pairs(&meter, rounds);
    }
    return 0;
}

/* ---- on this computer ---------------------------------------------------------------------------------------------
 */

/* A sleep ends some tens of microseconds late: what is shorter than that is watched. */
static void sleep_until(void *const link, const int64_t ns)
{
    const struct timespec until = {.tv_sec = (time_t)(ns / NS_PER_S), .tv_nsec = (long)(ns % NS_PER_S)};
    if (ns - link_now_ns(link) > PAIR_NS)
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
    while (link_now_ns(link) < ns) {
    }
}

int rounds_measure(const struct measuring *const what, struct rounds *const rounds, struct hm2_diag *const diag)
{
    const struct link_udp_options options = {.address = what->card};
    const struct sched_param priority = {.sched_priority = PRIORITY};
    struct link *link;
    int err = link_udp_open(&link, &options, diag);
    if (err)
        return err;
    /* As the servo thread would; where it is not permitted, the numbers are those of an ordinary program. */
    const bool locked = mlockall(MCL_CURRENT) == 0;
    const bool realtime = sched_setscheduler(0, SCHED_FIFO, &priority) == 0;
    err = rounds_measure_by(link, &(struct waiting){sleep_until, link}, what, rounds, diag);
    if (realtime)
        (void)sched_setscheduler(0, SCHED_OTHER, &(struct sched_param){.sched_priority = 0});
    if (locked)
        (void)munlockall();
    link_close(link);
    return err;
}
