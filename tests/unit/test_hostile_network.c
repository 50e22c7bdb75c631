/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A million cycles on a network that loses, repeats, reorders, delays, cuts and forges, in virtual time. Step
 * generators move, an encoder turns with one of them, and the inputs show another pattern several times in each cycle.
 *
 * What the card has is noted when it takes a request; what the pins show afterwards must be exactly that, or, in a
 * cycle without a good reply, exactly what they showed before. Every datagram that reaches the driver is judged here,
 * too, by its length and numbers alone; the driver's counters must agree, and so must the network's own account.
 *
 * HM2_HOSTILE_SEED and HM2_HOSTILE_CYCLES change what is run; the seed of a failure is printed.
 */
#include "unit.h"

#include <math.h>

#include <hm2/board.h>
#include <hm2/bytes.h>
#include <hm2/sim.h>

#define PERIOD_NS  1000000
#define PATTERN_NS 333333 /* not a divisor of the period */
#define STEPGENS   5u
#define SCALE      1000.0
#define SUBSTEPS   65536.0
#define PREFIX     "hm2_7i96s.0."

enum { FIRST_INPUT = 34, INPUTS = 16 }; /* connector P1, all GPIO */

/* The driver's packets, as hm2/plan.h describes them. */
enum {
    NUMBER_AT = 4,          /* of a request: its number */
    TRAILER_BYTES = 14,     /* of a reply: request number, last write's number, session, packets received */
    REQUEST_SCRATCH = 0x10, /* address of the first command of a request */
    WRITE_SCRATCH = 0x14    /* address of the last command of a write */
};

#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
#define DEFAULT_CYCLES 50000u /* twenty times as slow */
#else
#define DEFAULT_CYCLES 1000000u
#endif

/* What the card had when it took a request; counters before and after, because they go on meanwhile. */
struct truth {
    uint32_t last_write; /* number of the last write that was carried out to its end */
    bool write_known;    /* that write was whole */
    uint32_t pattern;
    int64_t steps[STEPGENS][2]; /* with fraction: 65536 a step */
    int64_t turns[2];
};

#define REMEMBERED 64u /* requests; none is on its way for longer */
#define COPIES     2u  /* that the network may make of one, each with an answer of its own */

struct asked {
    uint32_t number, write; /* of the last write that had been sent */
    unsigned taken;         /* copies that reached the card */
    struct truth truth[COPIES];
    bool answered; /* a whole reply has come */
};

struct faults_seen {
    unsigned long fresh, late, stale, malformed, write_lost, unanswered, received, taken;
};

struct shown {
    uint32_t pattern;
    double steps[STEPGENS];
    int32_t turns;
};

struct scene {
    struct link link; /* the driver's: the network's with a look at what passes */
    struct link *inner;
    struct sim_card *card;
    struct sim_net *net;
    struct hm2_board *board;
    struct hm2_plain_binder *plain;
    struct hm2_diag diag;
    uint64_t seed;
    unsigned long cycle;

    int64_t next_pattern_ns;
    uint32_t pattern;

    const struct hm2_md *stepgen, *encoder;
    int64_t steps[STEPGENS]; /* unwrapped by this test */
    int64_t turns;
    struct asked asked[REMEMBERED];
    uint32_t request, write, carried_out; /* numbers: sent last, and what the card did last */
    bool carried_known;
    uint32_t number_command; /* with which a write ends, before its number */
    size_t reply_bytes;
    struct asked *fresh;  /* the request whose reply came in this cycle, or NULL */
    uint32_t fresh_write; /* last write by that reply */
    struct faults_seen seen;

    struct shown shown; /* by the pins in the last cycle */
    bool watching;      /* the scene is set */
    struct sim_net_truth before;

    hm2_bit_t *in[INPUTS];
    const hm2_float_t *position[STEPGENS];
    const hm2_s32_t *count;
    const hm2_u32_t *age;
};

#define FAIL(s, ...)                                                                        \
    do {                                                                                    \
        print_message("seed %llu, cycle %lu: ", (unsigned long long)(s)->seed, (s)->cycle); \
        fail_msg(__VA_ARGS__);                                                              \
    } while (0)

/* ---- what the card has --------------------------------------------------------------------------------------------
 */

static uint32_t pattern_of(const int64_t number)
{
    return (uint32_t)number * 40503u & 0xFFFFu; /* odd factor: each number below 65536 has its own */
}

static void drive(struct scene *const s, const uint32_t pattern)
{
    const int64_t clk = sim_card_clock_at(s->card, link_now_ns(s->inner));
    for (unsigned bit = 0; bit < INPUTS; bit++)
        if ((pattern ^ s->pattern) >> bit & 1u)
            assert_int_equal(sim_card_drive(s->card, clk, FIRST_INPUT + bit, pattern >> bit & 1u ? SIM_HIGH : SIM_LOW),
                             0);
    s->pattern = pattern;
}

/* The pattern that belongs to the present time. */
static void change_pattern(struct scene *const s)
{
    drive(s, pattern_of(s->next_pattern_ns / PATTERN_NS));
    s->next_pattern_ns += PATTERN_NS;
}

/* Counters of the card, from its registers: 32 bits with 16 of fraction, and the low 16 bits of an encoder. */
static void look(struct scene *const s)
{
    const int64_t clk = sim_card_clock(s->card);
    for (unsigned i = 0; i < STEPGENS; i++) {
        const uint32_t now = sim_card_read(s->card, clk, hm2_md_address(s->stepgen, 1, i), NULL);
        s->steps[i] += hm2_delta32(now, (uint32_t)s->steps[i]);
    }
    const uint32_t count = sim_card_read(s->card, clk, hm2_md_address(s->encoder, 0, 0), NULL);
    s->turns += (int16_t)(count - (uint32_t)s->turns);
}

static void remember(struct scene *const s, struct asked *const a, const bool done)
{
    if (!done && a->taken < COPIES)
        a->taken++;
    struct truth *const t = &a->truth[a->taken - 1];
    look(s);
    t->pattern = s->pattern;
    t->last_write = s->carried_out;
    t->write_known = s->carried_known;
    for (unsigned i = 0; i < STEPGENS; i++)
        t->steps[i][done] = s->steps[i];
    t->turns[done] = s->turns;
}

/* The card takes a datagram. What it makes of a write that was cut is its own affair (it goes on with zeros). */
static void taken(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    struct scene *const s = context;
    s->seen.taken += done && s->watching;
    if (len >= NUMBER_AT + 4u && hm2_get_le16(data + 2) == REQUEST_SCRATCH) {
        struct asked *const a = &s->asked[hm2_get_le32(data + NUMBER_AT) % REMEMBERED];
        if (a->number == hm2_get_le32(data + NUMBER_AT))
            remember(s, a, done);
    } else if (done) {
        s->carried_known = len >= 8 && hm2_get_le32(data + len - 8) == s->number_command;
        s->carried_out = s->carried_known ? hm2_get_le32(data + len - 4) : 0;
    }
}

/* ---- the driver's link --------------------------------------------------------------------------------------------
 */

static void begin_request(struct scene *const s, const uint32_t number)
{
    struct asked *const a = &s->asked[number % REMEMBERED];
    s->seen.unanswered += a->number != 0 && !a->answered;
    *a = (struct asked){.number = number, .write = s->write};
    s->request = number;
}

static int scene_send(struct link *const link, const void *const data, const size_t len)
{
    struct scene *const s = (struct scene *)link;
    const uint8_t *const bytes = data;
    if (hm2_get_le16(bytes + 2) == REQUEST_SCRATCH) {
        begin_request(s, hm2_get_le32(bytes + NUMBER_AT));
    } else if (hm2_get_le16(bytes + len - 6) == WRITE_SCRATCH) {
        s->write = hm2_get_le32(bytes + len - 4);
        s->number_command = hm2_get_le32(bytes + len - 8);
    }
    return link_send(s->inner, data, len);
}

/* What a datagram is, by its length and number alone. */
static void judge(struct scene *const s, const uint8_t *const data, const int len)
{
    s->seen.received++;
    if (len < 0 || (size_t)len != s->reply_bytes) {
        s->seen.malformed++;
        return;
    }
    const uint32_t number = hm2_get_le32(data + len - TRAILER_BYTES);
    struct asked *const a = &s->asked[number % REMEMBERED];
    if (a->number != number)
        FAIL(s, "a reply to request %u, which was made long ago or never", (unsigned)number);
    if (a->answered)
        s->seen.stale++;
    else if (number != s->request)
        s->seen.late++;
    else
        s->fresh = a;
    s->fresh_write = hm2_get_le32(data + len - TRAILER_BYTES + 4);
    a->answered = true;
}

static void pass_time(struct scene *const s, const int64_t until_ns)
{
    while (s->next_pattern_ns <= until_ns) {
        sim_net_sleep_until(s->net, s->next_pattern_ns);
        change_pattern(s);
    }
    sim_net_sleep_until(s->net, until_ns);
}

static int scene_recv(struct link *const link, void *const data, const size_t cap, const int64_t deadline_ns,
                      const int64_t clock_ns)
{
    (void)clock_ns; /* time is virtual */
    struct scene *const s = (struct scene *)link;
    int len = HM2_ERR_TIMEOUT;
    while (len == HM2_ERR_TIMEOUT && s->next_pattern_ns <= deadline_ns) {
        len = link_recv(s->inner, data, cap, s->next_pattern_ns);
        if (len == HM2_ERR_TIMEOUT)
            change_pattern(s);
    }
    if (len == HM2_ERR_TIMEOUT)
        len = link_recv(s->inner, data, cap, deadline_ns);
    s->link.counters = s->inner->counters;
    if (len != HM2_ERR_TIMEOUT && s->watching)
        judge(s, data, len);
    return len;
}

static int64_t scene_now(struct link *const link)
{
    return link_now_ns(((const struct scene *)link)->inner);
}

static void scene_close(struct link *const link)
{
    (void)link; /* the net owns what is behind it */
}

static const struct link_ops scene_ops = {
    .send = scene_send, .recv = scene_recv, .now_ns = scene_now, .close = scene_close};

/* ---- what the pins show -------------------------------------------------------------------------------------------
 */

static void *pin(const struct scene *const s, const char *const format, const unsigned number)
{
    char name[64], full[128];
    (void)snprintf(name, sizeof name, format, number);
    (void)snprintf(full, sizeof full, PREFIX "%s", name);
    const struct hm2_plain_object *const object = hm2_plain_find(s->plain, full);
    if (!object)
        fail_msg("no point %s", full);
    return object->value;
}

static double get(const struct scene *const s, const char *const name)
{
    char full[128];
    int err;
    (void)snprintf(full, sizeof full, PREFIX "%s", name);
    const double value = hm2_plain_get(s->plain, full, &err);
    if (err)
        fail_msg("no point %s", full);
    return value;
}

static void set(const struct scene *const s, const char *const name, const double value)
{
    char full[128];
    (void)snprintf(full, sizeof full, PREFIX "%s", name);
    assert_int_equal(hm2_plain_set(s->plain, full, value), 0);
}

static struct shown shown_now(const struct scene *const s)
{
    struct shown shown = {.turns = *s->count};
    for (unsigned bit = 0; bit < INPUTS; bit++)
        shown.pattern |= (uint32_t)*s->in[bit] << bit;
    for (unsigned i = 0; i < STEPGENS; i++)
        shown.steps[i] = *s->position[i] * SCALE * SUBSTEPS;
    return shown;
}

static bool is_between(const double value, const int64_t a, const int64_t b)
{
    return value > fmin((double)a, (double)b) - 0.5 && value < fmax((double)a, (double)b) + 0.5;
}

static bool shows(const struct scene *const s, const struct shown *const shown, const struct truth *const t)
{
    bool same = (s->fresh_write == t->last_write || !t->write_known) && shown->pattern == t->pattern &&
                is_between(shown->turns, t->turns[0], t->turns[1]);
    for (unsigned i = 0; same && i < STEPGENS; i++)
        same = is_between(shown->steps[i], t->steps[i][0], t->steps[i][1]);
    return same;
}

static bool is_same(const struct shown *const a, const struct shown *const b)
{
    bool same = a->pattern == b->pattern && a->turns == b->turns;
    for (unsigned i = 0; same && i < STEPGENS; i++)
        same = !(a->steps[i] < b->steps[i]) && !(a->steps[i] > b->steps[i]);
    return same;
}

static void tell_difference(const struct scene *const s, const struct shown *const shown)
{
    const struct truth *const t = s->fresh ? s->fresh->truth : NULL;
    print_message("pins: write %u, pattern 0x%04X, count %d, steps %.0f; before: 0x%04X, %d, %.0f\n",
                  (unsigned)s->fresh_write, (unsigned)shown->pattern, (int)shown->turns, shown->steps[0],
                  (unsigned)s->shown.pattern, (int)s->shown.turns, s->shown.steps[0]);
    for (unsigned i = 0; t && i < s->fresh->taken; i++)
        print_message("card, request %u, copy %u: write %u, pattern 0x%04X, count %lld to %lld, steps %lld to %lld\n",
                      (unsigned)s->fresh->number, i, (unsigned)t[i].last_write, (unsigned)t[i].pattern,
                      (long long)t[i].turns[0], (long long)t[i].turns[1], (long long)t[i].steps[0][0],
                      (long long)t[i].steps[0][1]);
}

/* After read(): the pins show what the card had when it took this cycle's request, or what they showed before. */
static void check_pins(struct scene *const s)
{
    const struct shown shown = shown_now(s);
    bool right = s->fresh ? false : is_same(&shown, &s->shown);
    for (unsigned i = 0; s->fresh && !right && i < s->fresh->taken; i++)
        right = shows(s, &shown, &s->fresh->truth[i]);
    if (!right) {
        tell_difference(s, &shown);
        FAIL(s, "the pins show what the card did not have");
    }
    if ((*s->age == 0) != (s->fresh != NULL))
        FAIL(s, "data-age is %u", (unsigned)*s->age);
    s->shown = shown;
    s->seen.fresh += s->fresh != NULL;
    s->seen.write_lost += s->fresh && s->fresh_write != s->fresh->write;
}

/* ---- the scene ----------------------------------------------------------------------------------------------------
 */

static uint64_t environment(const char *const name, const uint64_t otherwise)
{
    const char *const text = getenv(name);
    return text && *text ? strtoull(text, NULL, 0) : otherwise;
}

static void find_pins(struct scene *const s)
{
    for (unsigned bit = 0; bit < INPUTS; bit++)
        s->in[bit] = pin(s, "gpio.%03u.in", FIRST_INPUT + bit);
    for (unsigned i = 0; i < STEPGENS; i++)
        s->position[i] = pin(s, "stepgen.%02u.position-fb", i);
    s->count = pin(s, "encoder.%02u.count", 0);
    s->age = pin(s, "data-age", 0);
}

static void configure(const struct scene *const s)
{
    for (unsigned i = 0; i < STEPGENS; i++) {
        *(hm2_float_t *)pin(s, "stepgen.%02u.position-scale", i) = SCALE;
        *(hm2_float_t *)pin(s, "stepgen.%02u.maxaccel", i) = 2000;
        *(hm2_float_t *)pin(s, "stepgen.%02u.maxvel", i) = 100;
        *(hm2_u32_t *)pin(s, "stepgen.%02u.steplen", i) = 1000;
        *(hm2_u32_t *)pin(s, "stepgen.%02u.stepspace", i) = 1000;
        *(hm2_u32_t *)pin(s, "stepgen.%02u.dirsetup", i) = 1000;
        *(hm2_u32_t *)pin(s, "stepgen.%02u.dirhold", i) = 1000;
        *(hm2_bit_t *)pin(s, "stepgen.%02u.enable", i) = true;
    }
    set(s, "packet-error-limit", 1000000000);
    set(s, "watchdog.timeout_ns", 2000000000);
}

static int set_up(void **state)
{
    struct scene *const s = calloc(1, sizeof *s);
    const struct sim_card_options options = {.profile = "7i96s", .seed = 1};
    assert_non_null(s);
    s->seed = environment("HM2_HOSTILE_SEED", 20261122);
    s->board = hm2_board_new();
    s->plain = hm2_plain_binder_new();
    if (sim_card_new(&s->card, &options, &s->diag) != 0 || sim_net_new(&s->net, s->card, NULL) != 0)
        fail_msg("%s", s->diag.text);
    s->inner = sim_net_link(s->net);
    s->link.ops = &scene_ops;
    s->next_pattern_ns = PATTERN_NS;
    sim_net_on_taken(s->net, taken, s);
    assert_int_equal(sim_card_follow(s->card, 0, 0, 4, 1), 0);
    s->stepgen = hm2_idrom_find(sim_card_idrom(s->card), HM2_GTAG_STEPGEN);
    s->encoder = hm2_idrom_find(sim_card_idrom(s->card), HM2_GTAG_ENCODER);
    assert_true(s->stepgen && s->stepgen->instances == STEPGENS && s->encoder);
    if (hm2_board_identify(s->board, &s->link, &s->diag) != 0 ||
        hm2_board_setup(s->board, 0, hm2_plain_binder(s->plain), NULL, &s->diag) != 0 ||
        hm2_board_start(s->board, &s->diag) != 0)
        fail_msg("%s", s->diag.text);
    s->reply_bytes = hm2_board_sizes(s->board).reply_bytes;
    find_pins(s);
    configure(s);
    *state = s;
    return 0;
}

static int tear_down(void **state)
{
    struct scene *const s = *state;
    hm2_board_free(s->board);
    hm2_plain_binder_free(s->plain);
    sim_net_free(s->net);
    sim_card_free(s->card);
    free(s);
    return 0;
}

static void cycle(struct scene *const s)
{
    const int64_t begin_ns = link_now_ns(s->inner);
    s->fresh = NULL;
    hm2_board_read(s->board, PERIOD_NS);
    check_pins(s);
    hm2_board_write(s->board, PERIOD_NS);
    pass_time(s, begin_ns + PERIOD_NS);
    s->cycle++;
}

/* Up to 25 units/s, which is 25 steps a cycle, each axis at another pace. */
static void command(const struct scene *const s, hm2_float_t *const *const commands)
{
    for (unsigned i = 0; i < STEPGENS; i++)
        *commands[i] = 5.0 * sin((double)s->cycle * (0.001 + 0.001 * i));
}

/* The first good reply after load is what the pins are compared with from then on. */
static void begin_to_watch(struct scene *const s)
{
    for (unsigned i = 0; i < 10; i++) {
        hm2_board_read(s->board, PERIOD_NS);
        hm2_board_write(s->board, PERIOD_NS);
        pass_time(s, link_now_ns(s->inner) + PERIOD_NS);
    }
    s->shown = shown_now(s);
    assert_true(get(s, "packet-error-total") == 0);
    memset(s->asked, 0, sizeof s->asked);
    s->watching = true;
    s->before = sim_net_truth(s->net);
}

/* ---- accounts -----------------------------------------------------------------------------------------------------
 */

static void compare(const struct scene *const s, const char *const name, const unsigned long expected)
{
    const double found = get(s, name);
    if (found < (double)expected || found > (double)expected)
        FAIL(s, "%s is %.0f, but there were %lu", name, found, expected);
}

static void check_accounts(const struct scene *const s, const unsigned long cycles)
{
    const struct sim_net_truth t = sim_net_truth(s->net), *const b = &s->before;
    const struct faults_seen *const seen = &s->seen;
    compare(s, "packet-lost", cycles - seen->fresh);
    compare(s, "packet-late", seen->late);
    compare(s, "packet-stale", seen->stale);
    compare(s, "packet-malformed", seen->malformed);
    compare(s, "packet-strangers", (unsigned long)t.foreign[1]);
    compare(s, "write-lost", seen->write_lost);
    assert_int_equal(seen->fresh + seen->late + seen->stale + seen->malformed, seen->received);
    /* A cycle is lost because its reply came late, or never came whole. */
    assert_int_equal(cycles - seen->fresh, seen->late + seen->unanswered);
    assert_true(seen->unanswered <= t.lost[0] + t.lost[1] + t.truncated[0] + t.truncated[1]);
    /* Nothing vanishes but what the network says it lost, and nothing comes but what was sent or copied. */
    assert_int_equal(t.sent[0] - b->sent[0] + t.duplicated[0], t.lost[0] + seen->taken);
    assert_int_equal(t.sent[1] - b->sent[1] + t.duplicated[1], t.lost[1] + seen->received);
    assert_int_equal(t.overflow[0] + t.overflow[1] + t.unheard, 0);
    /* Every kind of fault was met often. */
    assert_true(seen->late > cycles / 1000 && seen->stale > cycles / 100 && seen->malformed > cycles / 500);
    assert_true(seen->unanswered > cycles / 20 && seen->write_lost > cycles / 40 && t.foreign[1] > cycles / 500);
    assert_true(t.reordered[0] > cycles / 100 && t.reordered[1] > cycles / 1000);
    assert_true(seen->fresh > cycles * 3 / 4);
}

static void check_rest(struct scene *const s)
{
    look(s);
    for (unsigned i = 0; i < STEPGENS; i++) {
        const double steps = *s->position[i] * SCALE * SUBSTEPS;
        if (fabs(steps - (double)s->steps[i]) > 0.5 || fabs(steps) > SUBSTEPS)
            FAIL(s, "stepgen %u is at %.1f 1/65536 steps, the card has %lld, commanded was 0", i, steps,
                 (long long)s->steps[i]);
    }
    assert_int_equal(*s->count, s->turns);
    assert_true(llabs(s->turns - s->steps[0] / 16384) <= 1); /* four counts a step */
}

static void pins_show_only_what_the_card_had_and_every_fault_has_its_cause(void **state)
{
    struct scene *const s = *state;
    const unsigned long cycles = (unsigned long)environment("HM2_HOSTILE_CYCLES", DEFAULT_CYCLES);
    const struct sim_faults faults = {.seed = s->seed,
                                      .loss = 0.05,
                                      .duplicate = 0.02,
                                      .reorder = 0.02,
                                      .truncate = 0.005,
                                      .foreign = 0.01,
                                      .delay_max_ns = 450000};
    const struct sim_faults none = {.seed = 0};
    enum { AT_REST = 3000 };
    hm2_float_t *commands[STEPGENS];
    for (unsigned i = 0; i < STEPGENS; i++)
        commands[i] = pin(s, "stepgen.%02u.position-cmd", i);
    begin_to_watch(s);
    assert_int_equal(sim_net_set_faults(s->net, &faults), 0);
    while (s->cycle < cycles) {
        command(s, commands);
        cycle(s);
    }
    for (unsigned i = 0; i < STEPGENS; i++)
        *commands[i] = 0;
    assert_int_equal(sim_net_set_faults(s->net, &none), 0);
    for (unsigned i = 0; i < AT_REST; i++)
        cycle(s);
    check_rest(s);
    check_accounts(s, s->cycle);
    print_message(
        "seed %llu: %lu cycles: %lu good, %lu late, %lu stale, %lu malformed, %lu unanswered, %lu writes lost\n",
        (unsigned long long)s->seed, s->cycle, s->seen.fresh, s->seen.late, s->seen.stale, s->seen.malformed,
        s->seen.unanswered, s->seen.write_lost);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(pins_show_only_what_the_card_had_and_every_fault_has_its_cause, set_up,
                                        tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
