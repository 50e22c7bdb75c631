/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "firmware_card.h"
#include "random.h"
#include "sim_card.h"
#include "trace_folder.h"

#define TIME   0x0C00
#define STATUS 0x0D00
#define COOKIE 0x0E00
#define DDR    0x1100
#define DRAIN  0x1300

static void every_recorded_read_and_edge_is_matched(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("watchdog");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 12);
}

/* ---- against the firmware's process, clock by clock ---------------------------------------------------------------
 */

struct reference {
    uint32_t timer, time, ddr;
    bool old_msb, bite, status;
};

enum access { NOTHING, WRITE_TIME, WRITE_STATUS, WRITE_COOKIE, WRITE_DDR };

static void reference_edge(struct reference *const r, const enum access access, const uint32_t value)
{
    const bool msb = r->timer >> 31, bites = msb && !r->old_msb;
    if (access == WRITE_DDR)
        r->ddr = value & 0xFFFFFF;
    if (r->bite)
        r->ddr = 0;
    if (!msb)
        r->timer--;
    if (access == WRITE_TIME)
        r->timer = r->time = value;
    if (access == WRITE_COOKIE && value >> 24 == 0x5A)
        r->timer = r->time;
    if (access == WRITE_STATUS)
        r->status = value & 1;
    if (bites)
        r->status = true;
    r->bite = bites;
    r->old_msb = msb;
}

static uint32_t random_value(struct random *const r, const enum access access)
{
    switch (access) {
    case WRITE_TIME:
        return random_below(r, 5) ? random_below(r, 40) : random_magnitude(r);
    case WRITE_COOKIE:
        return (random_below(r, 4) ? 0x5A000000u : random_below(r, 256) << 24) | random_below(r, 1u << 24);
    case NOTHING:
    case WRITE_STATUS:
    case WRITE_DDR:
        break;
    }
    return (uint32_t)random_u64(r);
}

static void compare(struct sim_card *const card, const struct reference *const reference, const int64_t clk,
                    const unsigned seed)
{
    const uint32_t time = sim_card_read(card, clk, TIME, NULL);
    const uint32_t status = sim_card_read(card, clk, STATUS, NULL);
    const uint32_t ddr = sim_card_read(card, clk, DDR, NULL);
    if (time != reference->timer || status != reference->status || ddr != reference->ddr)
        fail_msg("seed %u clk %lld: time %08X, firmware %08X; status %u, %u; ddr %06X, %06X", seed, (long long)clk,
                 time, reference->timer, status, reference->status, ddr, reference->ddr);
}

static void play_random(struct sim_card *const card, struct reference reference, const unsigned seed)
{
    static const uint16_t address[] = {
        [WRITE_TIME] = TIME, [WRITE_STATUS] = STATUS, [WRITE_COOKIE] = COOKIE, [WRITE_DDR] = DDR};
    struct random r = {seed};
    int64_t clk = 0;
    for (unsigned i = 0; i < 60; i++) {
        for (int64_t wait = random_below(&r, 30) ? random_below(&r, 12) : random_below(&r, 200); wait > 0; wait--) {
            reference_edge(&reference, NOTHING, 0);
            clk++;
        }
        if (random_below(&r, 2))
            compare(card, &reference, clk, seed);
        const enum access access = (enum access)(1 + random_below(&r, WRITE_DDR));
        const uint32_t value = random_value(&r, access);
        sim_card_write(card, clk++, address[access], value);
        reference_edge(&reference, access, value);
    }
    compare(card, &reference, clk, seed);
}

static void any_sequence_of_accesses_reads_as_in_the_firmware(void **state)
{
    (void)state;
    for (unsigned seed = 0; seed < 3000; seed++) {
        struct sim_card *const card = firmware_card("SVST4_4_48");
        play_random(card, (struct reference){.timer = 0x80000000}, seed);
        sim_card_free(card);
    }
}

/* ---- single rules -------------------------------------------------------------------------------------------------
 */

static void newer_firmware_has_not_bitten_at_power_up(void **state)
{
    (void)state;
    struct sim_card *card = firmware_card(NULL);
    assert_int_equal(sim_card_read(card, 10, STATUS, NULL), 0);
    assert_int_equal(sim_card_read(card, 10, TIME, NULL), 0x80000000);
    sim_card_free(card);
    card = firmware_card("SVST4_4_48");
    assert_int_equal(sim_card_read(card, 10, STATUS, NULL), 1);
    sim_card_free(card);
}

static void a_bite_turns_off_open_drain_outputs_at_the_same_clock_as_the_others(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card("SVST4_4_48");
    sim_card_write(card, 10, DDR, 1);
    sim_card_write(card, 11, DRAIN, 2); /* data 0: pulled low whatever DDR says */
    sim_card_write(card, 12, TIME, 100);
    sim_card_advance(card, 12 + 100 + 3);
    assert_int_equal(sim_card_pad(card, 0), SIM_LOW);
    assert_int_equal(sim_card_pad(card, 1), SIM_LOW);
    sim_card_advance(card, 12 + 100 + 4);
    assert_int_equal(sim_card_pad(card, 0), SIM_FLOAT);
    assert_int_equal(sim_card_pad(card, 1), SIM_FLOAT);
    sim_card_free(card);
}

static void switching_a_running_watchdog_off_is_a_bite(void **state)
{
    (void)state;
    struct sim_card *const card = firmware_card("SVST4_4_48");
    sim_card_write(card, 10, STATUS, 0);
    sim_card_write(card, 11, DDR, 0xFFFFFF);
    sim_card_write(card, 12, TIME, 1000);
    sim_card_write(card, 50, TIME, 0x80000000);
    assert_int_equal(sim_card_read(card, 51, STATUS, NULL), 0);
    assert_int_equal(sim_card_read(card, 52, STATUS, NULL), 1);
    assert_int_equal(sim_card_read(card, 52, DDR, NULL), 0xFFFFFF);
    assert_int_equal(sim_card_read(card, 53, DDR, NULL), 0);
    sim_card_free(card);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_read_and_edge_is_matched),
        cmocka_unit_test(any_sequence_of_accesses_reads_as_in_the_firmware),
        cmocka_unit_test(newer_firmware_has_not_bitten_at_power_up),
        cmocka_unit_test(a_bite_turns_off_open_drain_outputs_at_the_same_clock_as_the_others),
        cmocka_unit_test(switching_a_running_watchdog_off_is_a_bite),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
