/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What becomes of a command when exactly one datagram is lost, comes twice, late, or behind the next, or when the
 * network ends with it: each kind, for requests and for replies, on small images in a small chip with the times of a
 * real one. FLASH_TORTURE=N makes N times as many runs; from 12 on each datagram of a write is disturbed in each
 * way, from 70 on each one of a restore and a backup, too. By default those of erases, and a part of the others.
 */
#include <inttypes.h>

#include <hm2/lbp16.h>

#include "flash_torture.h"
#include "unit.h"
#include "unruly_link.h"

#define IMAGE_BYTES 67000u /* the sector that makes it valid, and a little of another one */
#define LATE_BYTES  1000u
#define CHIP        0x12u /* 4 Mbit */
#define RUNS        80u   /* of each command, about */

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
    uint64_t datagrams[2]; /* requests and replies of an undisturbed run */
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
    if (err != t->result && (f->what != UNRULY_GONE || err != HM2_ERR_TIMEOUT))
        fail_run(m, f, err);
    m->runs++;
    if (err == t->result) {
        torture_check_wanted(t, m->what, f->at);
        return;
    }
    m->failed++;
    torture_power_up(t);
    torture_check_starts(t, m->what, f->at);
    if (torture_run(t) != t->result)
        fail_run(m, f, HM2_ERR_IO);
    torture_check_wanted(t, m->what, f->at);
}

static bool erases(const struct torture *const t, const uint64_t request)
{
    for (unsigned i = 0; i < t->erase_count; i++)
        if (t->erase[i].datagram == request)
            return true;
    return false;
}

/* Through a link that disturbs, with the times of a real chip. */
static void run_undisturbed(struct matrix *const m)
{
    unruly_link_init(&m->link, sim_net_link(m->t->net));
    m->t->link = &m->link.link;
    sim_card_flash_times(m->t->sim, sim_flash_times_of("m25p16"));
    torture_undisturbed(m->t);
    memcpy(m->datagrams, m->link.seen, sizeof m->datagrams);
}

static void disturb_all(const struct scenario *const scenario)
{
    struct matrix m = {.scenario = scenario, .t = torture_new(&scenario->setup)};
    const uint64_t runs_wanted = (uint64_t)RUNS * torture_factor();
    run_undisturbed(&m);
    const uint64_t step = UNRULY_KINDS * (m.datagrams[0] + m.datagrams[1]) / runs_wanted + 1;
    for (unsigned i = 0; i < 2u * UNRULY_KINDS; i++) {
        struct unruly_fault fault = {.what = (enum unruly)(i / 2), .reply = i % 2, .at = 1};
        const uint64_t first = i * step / (2u * UNRULY_KINDS) + 1;
        for (; fault.at <= m.datagrams[fault.reply]; fault.at++)
            if (fault.at % step == first % step || erases(m.t, fault.at))
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

/* ---- settings and registers ---------------------------------------------------------------------------------------
 */

#define PORT_DIRECTIONS 0x1100u /* of the first I/O port */

static int write_setting(struct flash_card *const card, const uint16_t value, struct hm2_diag *const diag)
{
    const uint16_t words[2] = {value, (uint16_t)(value + 1u)};
    return flash_card_write_eeprom(card, LBP16_EEPROM_IP, 2, words, diag);
}

static bool setting_is(struct flash_card *const card, const uint16_t value)
{
    const uint16_t *const words = flash_card_info(card)->eeprom + LBP16_EEPROM_IP / 2;
    return words[0] == value && words[1] == (uint16_t)(value + 1u);
}

static int write_register(struct flash_card *const card, const uint16_t value, struct hm2_diag *const diag)
{
    const uint32_t word = value;
    return flash_card_write_hm2(card, PORT_DIRECTIONS, 1, &word, diag);
}

static bool register_is(struct flash_card *const card, const uint16_t value)
{
    uint32_t word = 0;
    assert_int_equal(flash_card_read_hm2(card, PORT_DIRECTIONS, 1, &word, NULL), 0);
    return word == value;
}

static const struct store {
    const char *name;
    int (*write)(struct flash_card *card, uint16_t value, struct hm2_diag *diag);
    bool (*is)(struct flash_card *card, uint16_t value);
} stores[] = {{"setting", write_setting, setting_is}, {"register", write_register, register_is}};

static int write_value(const struct store *const store, struct link *const link, const uint16_t value)
{
    struct flash_card *card = NULL;
    int err = flash_card_new(&card, link, NULL);
    if (err == 0)
        err = store->write(card, value, NULL);
    flash_card_free(card);
    return err;
}

static bool holds_value(const struct store *const store, struct link *const link, const uint16_t value)
{
    struct flash_card *card = NULL;
    assert_int_equal(flash_card_new(&card, link, NULL), 0);
    const bool right = store->is(card, value);
    flash_card_free(card);
    return right;
}

/* The new value, and success; or a network that ended, and the old or the new one. */
static void store_disturbed(const struct store *const store, struct torture *const t, struct unruly_link *const link,
                            const struct unruly_fault *const f)
{
    enum { OLD = 0x1234, NEW = 0x0F0F };
    struct link *const good = sim_net_link(t->net);
    assert_int_equal(write_value(store, good, OLD), 0);
    unruly_link_set(link, f);
    const int err = write_value(store, &link->link, NEW);
    unruly_link_release(link);
    torture_settle(t);
    const bool is_new = holds_value(store, good, NEW), is_old = holds_value(store, good, OLD);
    const bool ended = f->what == UNRULY_GONE && err == HM2_ERR_TIMEOUT && (is_new || is_old);
    if (!ended && !(err == 0 && is_new))
        fail_msg("%s: %s %" PRIu64 " %s: %d, %s value", store->name, f->reply ? "reply" : "request", f->at,
                 unruly_name(f->what), err,
                 is_new   ? "new"
                 : is_old ? "old"
                          : "neither");
}

static void settings_and_registers_are_stored_whatever_happens_to_one_datagram(void **state)
{
    (void)state;
    struct torture *const t =
        torture_new(&(struct torture_setup){TORTURE_VERIFY, "7i96s", LATE_BYTES, IMAGE_BYTES, CHIP});
    struct unruly_link link;
    unruly_link_init(&link, sim_net_link(t->net));
    for (size_t i = 0; i < sizeof stores / sizeof stores[0]; i++) {
        unruly_link_set(&link, &(struct unruly_fault){.at = 0});
        assert_int_equal(write_value(&stores[i], &link.link, 1), 0);
        const uint64_t requests = link.seen[0];
        assert_in_range(requests, 4, 10);
        for (unsigned k = 0; k < 2u * UNRULY_KINDS; k++)
            for (uint64_t at = 1; at <= requests; at++)
                store_disturbed(&stores[i], t, &link,
                                &(struct unruly_fault){.what = (enum unruly)(k / 2), .reply = k % 2, .at = at});
    }
    torture_free(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(settings_and_registers_are_stored_whatever_happens_to_one_datagram),
        cmocka_unit_test(any_one_datagram_may_be_disturbed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
