/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A network between a client and a card, with faults drawn from a seed, in virtual time. */
#include <stdlib.h>
#include <string.h>

#include <hm2/sim.h>

#include "prng.h"

#define ON_THE_WAY   64u
#define INBOX        64u
#define MAX_DELAY_NS 1000000000
#define LONG_WORK_NS 200000   /* a full packet takes 150 us: more than this is the flash's doing */
#define HOLD_NS      10000000 /* a datagram held back for the next to overtake goes on after this */

enum direction { TO_CARD, TO_CLIENT };

struct datagram {
    int64_t due_ns;
    uint64_t order; /* of queuing; breaks ties */
    uint64_t number;
    uint64_t client; /* who sent it, or gets it */
    enum direction direction;
    bool copy, held, foreign;
    size_t len;
    uint8_t data[LINK_MAX_DATAGRAM_BYTES];
};

struct sim_net {
    struct link link; /* first: a link is its net */
    struct sim_card *card;
    struct sim_faults faults;
    uint64_t random;
    int64_t now_ns;
    int64_t line_ns;    /* the last datagram was on the line */
    int64_t told_ns[2]; /* when the client's port tells next: the timer runs from told_ns[0] to [1] */
    bool frozen, instant;
    uint64_t client; /* of the datagram that is being carried */
    sim_net_deliver_fn deliver;
    void *deliver_context;
    sim_net_taken_fn taken;
    void *taken_context;

    struct datagram pool[ON_THE_WAY];
    unsigned waiting[ON_THE_WAY]; /* pool indices: the first waiting_count are on their way, the rest free */
    unsigned waiting_count;
    uint64_t queued, number[2], newest[2];

    struct {
        size_t len;
        uint8_t data[LINK_MAX_DATAGRAM_BYTES];
    } inbox[INBOX];
    unsigned inbox_first, inbox_count;

    struct sim_net_truth truth;
};

/* ---- sending ------------------------------------------------------------------------------------------------------
 */

static bool happens(struct sim_net *const net, const double probability)
{
    return sim_prng_unit(&net->random) < probability;
}

static int64_t draw_delay(struct sim_net *const net)
{
    const uint64_t span = (uint64_t)(net->faults.delay_max_ns - net->faults.delay_min_ns) + 1;
    const int64_t delay_ns = net->faults.delay_min_ns + (int64_t)sim_prng_below(&net->random, span);
    /* Without a tail nothing is drawn for it: seeds keep what they give. */
    return net->faults.tail > 0.0 && happens(net, net->faults.tail) ? delay_ns + net->faults.tail_ns : delay_ns;
}

/* Others have the line in one stretch of each busy_every_ns, which follows from the seed and the time alone. */
static int64_t behind_neighbours(const struct sim_net *const net, const int64_t at_ns)
{
    const struct sim_faults *const f = &net->faults;
    if (f->busy_ns == 0)
        return at_ns;
    const int64_t turn = at_ns / f->busy_every_ns;
    uint64_t seed = f->seed + (uint64_t)turn;
    const int64_t from_ns =
        turn * f->busy_every_ns + (int64_t)sim_prng_below(&seed, (uint64_t)(f->busy_every_ns - f->busy_ns) + 1);
    return at_ns >= from_ns && at_ns < from_ns + f->busy_ns ? from_ns + f->busy_ns : at_ns;
}

/* The first datagram that comes starts the timer of the client's port; it and all up to then are told of at its end. */
static int64_t coalesced(struct sim_net *const net, const int64_t at_ns)
{
    if (net->faults.coalesce_ns == 0)
        return at_ns;
    if (at_ns < net->told_ns[0] || at_ns >= net->told_ns[1]) {
        net->told_ns[0] = at_ns;
        net->told_ns[1] = at_ns + net->faults.coalesce_ns;
    }
    return net->told_ns[1];
}

/* When a datagram that is sent at at_ns is there. */
static int64_t arrival(struct sim_net *const net, const enum direction direction, const int64_t at_ns)
{
    const struct sim_faults *const f = &net->faults;
    int64_t ns = at_ns + draw_delay(net);
    if (f->wake_ns > 0 && at_ns - net->line_ns > f->sleep_ns)
        ns += f->wake_ns;
    ns = behind_neighbours(net, ns);
    if (ns > net->line_ns)
        net->line_ns = ns;
    return direction == TO_CLIENT ? coalesced(net, ns) : ns;
}

static struct datagram *enqueue(struct sim_net *const net, const enum direction direction, const int64_t due_ns,
                                const void *const data, const size_t len)
{
    if (net->waiting_count == ON_THE_WAY) {
        net->truth.overflow[direction]++;
        return NULL;
    }
    struct datagram *const d = &net->pool[net->waiting[net->waiting_count++]];
    d->due_ns = due_ns;
    d->order = net->queued++;
    d->number = net->number[direction];
    d->client = net->client;
    d->direction = direction;
    d->copy = d->held = d->foreign = false;
    d->len = len;
    memcpy(d->data, data, len);
    return d;
}

/* Whoever was held back for this datagram to overtake follows right behind it. */
static void release_held(struct sim_net *const net, const enum direction direction, const int64_t due_ns)
{
    for (unsigned i = 0; i < net->waiting_count; i++) {
        struct datagram *const d = &net->pool[net->waiting[i]];
        if (!d->held || d->direction != direction)
            continue;
        d->held = false;
        if (d->due_ns > due_ns)
            d->due_ns = due_ns + 1;
    }
}

/* A stranger reads the card's IDROM, or sends the client what could be an answer. */
static void send_foreign(struct sim_net *const net, const enum direction direction, const int64_t at_ns)
{
    static const uint8_t request[] = {0x90, 0x42, 0x00, 0x04};
    uint8_t noise[64];
    for (size_t i = 0; i < sizeof noise; i++)
        noise[i] = (uint8_t)sim_prng_next(&net->random);
    const int64_t due_ns = arrival(net, direction, at_ns);
    struct datagram *const d = direction == TO_CARD ? enqueue(net, direction, due_ns, request, sizeof request)
                                                    : enqueue(net, direction, due_ns, noise, sizeof noise);
    if (!d)
        return;
    d->foreign = true;
    net->truth.foreign[direction]++;
}

/* The network takes a datagram over at at_ns and does with it what the faults say. */
static void carry(struct sim_net *const net, const enum direction direction, const int64_t at_ns,
                  const uint8_t *const data, size_t len)
{
    const struct sim_faults *const f = &net->faults;
    net->truth.sent[direction]++;
    net->number[direction]++;
    const bool lost = happens(net, f->loss), twice = happens(net, f->duplicate), late = happens(net, f->reorder);
    const bool cut = happens(net, f->truncate) && len > 0, stranger = happens(net, f->foreign);
    const int64_t due_ns = arrival(net, direction, at_ns);
    if (stranger)
        send_foreign(net, direction, at_ns);
    if (lost) {
        net->truth.lost[direction]++;
        return;
    }
    if (cut) {
        len = (size_t)sim_prng_below(&net->random, len);
        net->truth.truncated[direction]++;
    }
    release_held(net, direction, due_ns);
    struct datagram *const d = enqueue(net, direction, due_ns, data, len);
    if (d && late) {
        d->held = true;
        d->due_ns += HOLD_NS;
    }
    if (!twice)
        return;
    struct datagram *const copy = enqueue(net, direction, arrival(net, direction, at_ns), data, len);
    if (copy) {
        copy->copy = true;
        net->truth.duplicated[direction]++;
    }
}

/* ---- delivery -----------------------------------------------------------------------------------------------------
 */

static void to_client(struct sim_net *const net, const struct datagram *const d)
{
    if (net->deliver) {
        net->truth.delivered[TO_CLIENT] += !d->foreign;
        net->deliver(net->deliver_context, d->client, d->data, d->len, d->foreign);
        return;
    }
    if (d->foreign) {
        net->link.counters.strangers++;
        return;
    }
    if (net->inbox_count == INBOX) {
        net->truth.overflow[TO_CLIENT]++;
        return;
    }
    const unsigned at = (net->inbox_first + net->inbox_count++) % INBOX;
    net->inbox[at].len = d->len;
    memcpy(net->inbox[at].data, d->data, d->len);
    net->truth.delivered[TO_CLIENT]++;
}

static void tell_taken(const struct sim_net *const net, const struct datagram *const d, const bool done)
{
    if (net->taken && !d->foreign)
        net->taken(net->taken_context, d->data, d->len, done);
}

static void to_card(struct sim_net *const net, const struct datagram *const d)
{
    uint8_t reply[LINK_MAX_DATAGRAM_BYTES];
    int64_t reply_ns = net->now_ns;
    if (net->frozen) {
        net->truth.unheard++;
        return;
    }
    if (!d->foreign)
        net->truth.delivered[TO_CARD]++;
    tell_taken(net, d, false);
    const size_t len = sim_card_packet(net->card, net->now_ns, d->data, d->len, reply, sizeof reply, &reply_ns);
    tell_taken(net, d, true);
    const int64_t waited_ns = sim_card_asked_ns(net->card);
    const bool at_once = net->instant && reply_ns - net->now_ns - waited_ns < LONG_WORK_NS;
    net->client = d->client;
    if (len > 0 && !d->foreign)
        carry(net, TO_CLIENT, at_once ? net->now_ns + waited_ns : reply_ns, reply, len);
}

/* Index in waiting[] of the datagram that is due next, waiting_count when there is none. */
static unsigned due_next(const struct sim_net *const net)
{
    unsigned best = net->waiting_count;
    for (unsigned i = 0; i < net->waiting_count; i++) {
        const struct datagram *const d = &net->pool[net->waiting[i]];
        const struct datagram *const b = &net->pool[net->waiting[best < net->waiting_count ? best : i]];
        if (best == net->waiting_count || d->due_ns < b->due_ns || (d->due_ns == b->due_ns && d->order < b->order))
            best = i;
    }
    return best;
}

/* The next datagram arrives, if it is due by limit_ns. */
static bool step(struct sim_net *const net, const int64_t limit_ns)
{
    const unsigned next = due_next(net);
    if (next == net->waiting_count)
        return false;
    const unsigned slot = net->waiting[next];
    const struct datagram *const d = &net->pool[slot];
    if (d->due_ns > limit_ns)
        return false;
    if (d->due_ns > net->now_ns)
        net->now_ns = d->due_ns;
    if (!d->copy && !d->foreign) {
        if (d->number < net->newest[d->direction])
            net->truth.reordered[d->direction]++;
        else
            net->newest[d->direction] = d->number;
    }
    /* The slot is given back last: the card's reply must not be written over the request. */
    if (d->direction == TO_CARD)
        to_card(net, d);
    else
        to_client(net, d);
    net->waiting[next] = net->waiting[--net->waiting_count];
    net->waiting[net->waiting_count] = slot;
    return true;
}

/* ---- the link -----------------------------------------------------------------------------------------------------
 */

static int net_send(struct link *const link, const void *const data, const size_t len)
{
    struct sim_net *const net = (struct sim_net *)link;
    if (len > LINK_MAX_DATAGRAM_BYTES) {
        link->counters.send_errors++;
        return HM2_ERR_NOSPACE;
    }
    link->counters.sent++;
    carry(net, TO_CARD, net->now_ns, data, len);
    return 0;
}

static void settle_card(struct sim_net *const net)
{
    sim_card_advance(net->card, sim_card_clock_at(net->card, net->now_ns));
}

static int net_recv(struct link *const link, void *const data, const size_t cap, const int64_t deadline_ns,
                    const int64_t clock_ns)
{
    struct sim_net *const net = (struct sim_net *)link;
    const int64_t limit_ns = deadline_ns > net->now_ns ? deadline_ns : net->now_ns;
    (void)clock_ns; /* time is virtual */
    while (net->inbox_count == 0 && step(net, limit_ns)) {
    }
    if (net->inbox_count == 0) {
        net->now_ns = limit_ns;
        settle_card(net);
        return HM2_ERR_TIMEOUT;
    }
    const unsigned first = net->inbox_first;
    net->inbox_first = (first + 1) % INBOX;
    net->inbox_count--;
    if (net->inbox[first].len > cap) {
        link->counters.receive_errors++;
        return HM2_ERR_NOSPACE;
    }
    link->counters.received++;
    memcpy(data, net->inbox[first].data, net->inbox[first].len);
    return (int)net->inbox[first].len;
}

static int64_t net_now_ns(struct link *const link)
{
    return ((const struct sim_net *)link)->now_ns;
}

static void net_close(struct link *const link)
{
    (void)link; /* the net owns it */
}

static const struct link_ops net_ops = {
    .send = net_send,
    .recv = net_recv,
    .now_ns = net_now_ns,
    .close = net_close,
};

/* ---- the net ------------------------------------------------------------------------------------------------------
 */

static bool probability(const double p)
{
    return p >= 0.0 && p <= 1.0;
}

static bool delay(const int64_t ns)
{
    return ns >= 0 && ns <= MAX_DELAY_NS;
}

int sim_faults_check(const struct sim_faults *const f)
{
    if (!probability(f->loss) || !probability(f->duplicate) || !probability(f->reorder) || !probability(f->truncate) ||
        !probability(f->foreign) || !probability(f->tail))
        return HM2_ERR_RANGE;
    if (!delay(f->tail_ns) || !delay(f->coalesce_ns) || !delay(f->sleep_ns) || !delay(f->wake_ns) ||
        !delay(f->busy_every_ns) || !delay(f->busy_ns))
        return HM2_ERR_RANGE;
    if (!delay(f->delay_min_ns) || !delay(f->delay_max_ns) || f->delay_min_ns > f->delay_max_ns ||
        f->busy_ns > f->busy_every_ns)
        return HM2_ERR_RANGE;
    return 0;
}

int sim_net_set_faults(struct sim_net *const net, const struct sim_faults *const faults)
{
    const int err = sim_faults_check(faults);
    if (err)
        return err;
    net->faults = *faults;
    net->random = faults->seed;
    return 0;
}

int sim_net_new(struct sim_net **const net, struct sim_card *const card, const struct sim_faults *const faults)
{
    const struct sim_faults none = {0};
    *net = NULL;
    struct sim_net *const made = calloc(1, sizeof *made);
    if (!made)
        return HM2_ERR_NOMEM;
    const int err = sim_net_set_faults(made, faults ? faults : &none);
    if (err) {
        free(made);
        return err;
    }
    made->link.ops = &net_ops;
    made->card = card;
    for (unsigned i = 0; i < ON_THE_WAY; i++)
        made->waiting[i] = i;
    sim_card_set_time(card, 0);
    *net = made;
    return 0;
}

void sim_net_free(struct sim_net *const net)
{
    free(net);
}

struct link *sim_net_link(struct sim_net *const net)
{
    return &net->link;
}

void sim_net_on_deliver(struct sim_net *const net, const sim_net_deliver_fn fn, void *const context)
{
    net->deliver = fn;
    net->deliver_context = context;
}

void sim_net_on_taken(struct sim_net *const net, const sim_net_taken_fn fn, void *const context)
{
    net->taken = fn;
    net->taken_context = context;
}

void sim_net_arrive(struct sim_net *const net, const int64_t now_ns, const uint64_t client, const uint8_t *const data,
                    const size_t len)
{
    sim_net_sleep_until(net, now_ns);
    net->client = client;
    if (len <= LINK_MAX_DATAGRAM_BYTES)
        carry(net, TO_CARD, net->now_ns, data, len);
    sim_net_sleep_until(net, now_ns);
}

int64_t sim_net_next_ns(const struct sim_net *const net)
{
    const unsigned next = due_next(net);
    return next < net->waiting_count ? net->pool[net->waiting[next]].due_ns : INT64_MAX;
}

void sim_net_set_instant(struct sim_net *const net, const bool instant)
{
    net->instant = instant;
}

void sim_net_sleep_until(struct sim_net *const net, const int64_t now_ns)
{
    while (step(net, now_ns)) {
    }
    if (now_ns > net->now_ns)
        net->now_ns = now_ns;
    settle_card(net);
}

void sim_net_freeze(struct sim_net *const net, const bool frozen)
{
    net->frozen = frozen;
}

struct sim_net_truth sim_net_truth(const struct sim_net *const net)
{
    return net->truth;
}
