/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What becomes of a command when exactly one datagram is lost, comes twice, late, or behind the next, or when the
 * network ends with it: each kind, for requests and for replies, on small images in a small chip with the times of a
 * real one. FLASH_TORTURE=N makes N times as many runs; from 12 on each datagram of a write is disturbed in each
 * way, from 70 on each one of a restore and a backup, too. By default those of erases, and a part of the others.
 */
#include <inttypes.h>

#include "flash_torture.h"
#include "unit.h"
#include "unruly_link.h"

#define IMAGE_BYTES 67000u /* the sector that makes it valid, and a little of another one */
#define LATE_BYTES  1000u
#define CHIP        0x12u /* 4 Mbit */
#define ERASES_MOST 8u
#define RUNS        80u /* of each command, about */

static const struct scenario {
    const char *name;
    struct torture_setup setup;
} scenarios[] = {
    {"write", {TORTURE_WRITE, "7i93", LATE_BYTES, IMAGE_BYTES, CHIP}},
    {"write", {TORTURE_WRITE, "7i96s", LATE_BYTES, IMAGE_BYTES, CHIP}},
    {"fallback write", {TORTURE_WRITE_FALLBACK, "7i93", LATE_BYTES, IMAGE_BYTES, CHIP}},
    {"fallback write", {TORTURE_WRITE_FALLBACK, "7i96s", LATE_BYTES, IMAGE_BYTES, CHIP}},
    {"restore", {TORTURE_RESTORE, "7i93", LATE_BYTES, IMAGE_BYTES, CHIP}},
    {"restore", {TORTURE_RESTORE, "7i96s", LATE_BYTES, IMAGE_BYTES, CHIP}},
    {"verify", {TORTURE_VERIFY, "7i93", LATE_BYTES, IMAGE_BYTES, CHIP}},
    {"verify of another image", {TORTURE_VERIFY_OTHER, "7i96s", LATE_BYTES, IMAGE_BYTES, CHIP}},
    {"backup", {TORTURE_BACKUP, "7i96s", LATE_BYTES, IMAGE_BYTES, CHIP}},
};

struct matrix {
    const struct scenario *scenario;
    struct torture *t;
    struct unruly_link link;
    uint64_t datagrams[2];         /* requests and replies of an undisturbed run */
    uint64_t erasing[ERASES_MOST]; /* numbers of those that erase */
    unsigned erase_count;
    uint64_t erases_seen;
    int wanted; /* result */
    unsigned runs, failed;
    char what[96]; /* is being done */
};

static void fail_run(const struct matrix *const m, const struct unruly_fault *const f, const int err)
{
    fail_msg("%s, %s %" PRIu64 ": %d: %s", m->t->setup.profile, m->what, f->at, err, m->t->diag.text);
}

/* One datagram does not hinder a command; a network that ends makes it say so, and the next run mends what it left. */
static void run_disturbed(struct matrix *const m, const struct unruly_fault *const f)
{
    struct torture *const t = m->t;
    snprintf(m->what, sizeof m->what, "%s, %s %s, number", m->scenario->name, f->reply ? "reply" : "request",
             unruly_name(f->what));
    torture_reset(t);
    unruly_link_set(&m->link, f);
    const int err = torture_run(t);
    unruly_link_release(&m->link);
    torture_settle(t);
    torture_check_starts(t, m->what, f->at);
    if (err != m->wanted && (f->what != UNRULY_GONE || err != HM2_ERR_TIMEOUT))
        fail_run(m, f, err);
    m->runs++;
    if (err == m->wanted) {
        torture_check_wanted(t, m->what, f->at);
        return;
    }
    m->failed++;
    torture_power_up(t);
    torture_check_starts(t, m->what, f->at);
    if (torture_run(t) != m->wanted)
        fail_run(m, f, HM2_ERR_IO);
    torture_check_wanted(t, m->what, f->at);
}

static void note_erase(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    struct matrix *const m = context;
    const uint64_t erases = sim_card_flash_counts(m->t->sim).erases;
    (void)data;
    (void)len;
    if (done && erases > m->erases_seen) {
        assert_true(m->erase_count < ERASES_MOST);
        m->erasing[m->erase_count++] = m->link.seen[0];
    }
    m->erases_seen = erases;
}

static bool erases(const struct matrix *const m, const uint64_t number)
{
    for (unsigned i = 0; i < m->erase_count; i++)
        if (m->erasing[i] == number)
            return true;
    return false;
}

static void run_undisturbed(struct matrix *const m)
{
    unruly_link_init(&m->link, sim_net_link(m->t->net));
    m->t->link = &m->link.link;
    torture_reset(m->t);
    sim_net_on_taken(m->t->net, note_erase, m);
    assert_int_equal(torture_run(m->t), m->wanted);
    sim_net_on_taken(m->t->net, NULL, NULL);
    memcpy(m->datagrams, m->link.seen, sizeof m->datagrams);
}

static void disturb_all(const struct scenario *const scenario)
{
    struct matrix m = {.scenario = scenario, .t = torture_new(&scenario->setup)};
    const uint64_t runs_wanted = (uint64_t)RUNS * torture_factor();
    m.wanted = scenario->setup.kind == TORTURE_VERIFY_OTHER ? HM2_ERR_MISMATCH : 0;
    sim_card_flash_times(m.t->sim, sim_flash_times_of("m25p16"));
    run_undisturbed(&m);
    const uint64_t step = UNRULY_KINDS * (m.datagrams[0] + m.datagrams[1]) / runs_wanted + 1;
    for (unsigned i = 0; i < 2u * UNRULY_KINDS; i++) {
        struct unruly_fault fault = {.what = (enum unruly)(i / 2), .reply = i % 2, .at = 1};
        const uint64_t first = i * step / (2u * UNRULY_KINDS) + 1;
        for (; fault.at <= m.datagrams[fault.reply]; fault.at++)
            if (fault.at % step == first % step || erases(&m, fault.at))
                run_disturbed(&m, &fault);
    }
    printf("%s, %s: %u runs, in each one of %" PRIu64 " requests or %" PRIu64
           " replies disturbed; %u of them failed, as "
           "they should\n",
           scenario->setup.profile, scenario->name, m.runs, m.datagrams[0], m.datagrams[1], m.failed);
    torture_free(m.t);
}

static void any_one_datagram_may_be_disturbed(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof scenarios / sizeof scenarios[0]; i++)
        disturb_all(&scenarios[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_one_datagram_may_be_disturbed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
