/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Simulated one-shots, alone and under the driver. */
#include "unit.h"

#include "module_rig.h"
#include "module_types.h"
#include "random.h"
#include "sim_card.h"

#define CONTROL 0xB600
#define OUT1    0x83
#define OUT2    0x84

static const struct rig_md modules[] = {
    {HM2_GTAG_DPLL, 0, 1, 1, 0x7000, 7, 0, 0},
    {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0, 0x1F},
    {HM2_GTAG_ONESHOT, 0, 1, 2, 0xB100, 6, 0, 0x3F},
};

/* Pulses of a watched output, in clocks. */
struct pulses {
    int64_t rise, period, width;
    unsigned rises;
};

struct bench {
    struct module_rig *rig;
    struct pulses out[2];
};

static void note_edge(void *context, int64_t clk, unsigned ps, unsigned watch, enum sim_level level)
{
    struct bench *const b = context;
    struct pulses *const p = &b->out[watch];
    (void)ps;
    if (level != SIM_HIGH) {
        p->width = clk - p->rise;
        return;
    }
    p->period = clk - p->rise;
    p->rise = clk;
    p->rises++;
}

static int set_up(void **state)
{
    struct bench *const b = calloc(1, sizeof *b);
    assert_non_null(b);
    const struct hm2_image *const image = rig_image_with(modules, 3, NULL, 0);
    b->rig = rig_new(image, "");
    const struct sim_card_options options = {.profile = "7i96s", .image = image};
    assert_int_equal(sim_card_new(&b->rig->card, &options, NULL), 0);
    b->rig->clk = 1000;
    b->rig->read_clk = 5;
    (void)rig_add(b->rig, &hm2_oneshot_type);
    rig_start(b->rig);
    assert_int_equal(sim_card_watch_output(b->rig->card, HM2_GTAG_ONESHOT, 0, OUT1), 0);
    assert_int_equal(sim_card_watch_output(b->rig->card, HM2_GTAG_ONESHOT, 0, OUT2), 1);
    sim_card_on_edge(b->rig->card, note_edge, b);
    *state = b;
    return 0;
}

static int tear_down(void **state)
{
    struct bench *const b = *state;
    sim_card_free(b->rig->card);
    rig_free(b->rig);
    free(b);
    return 0;
}

static void set(const struct bench *b, const char *pin, double value)
{
    char name[48];
    (void)snprintf(name, sizeof name, "oneshot.00.%s", pin);
    rig_set(b->rig, name, value);
}

static double get(const struct bench *b, const char *pin)
{
    char name[48];
    (void)snprintf(name, sizeof name, "oneshot.00.%s", pin);
    return rig_get(b->rig, name);
}

static void drive(const struct bench *b, int64_t clk, uint8_t pin, enum sim_level level)
{
    assert_int_equal(sim_card_drive_input(b->rig->card, clk, HM2_GTAG_ONESHOT, 0, pin, level), 0);
}

static void wait(struct bench *b, int64_t clk)
{
    b->rig->clk += clk;
    sim_card_advance(b->rig->card, b->rig->clk);
}

static void software_starts_a_pulse_of_the_width_asked_for(void **state)
{
    struct bench *const b = *state;
    set(b, "width1", 5);
    set(b, "trigger_select1", 1);
    set(b, "trigger_on_rise1", 1);
    set(b, "enable1", 1);
    rig_cycle(b->rig);
    wait(b, 1000);
    assert_int_equal(b->out[0].rises, 0);
    set(b, "swtrigger1", 1);
    rig_cycle(b->rig);
    rig_cycle(b->rig);
    assert_true(get(b, "out1") == 1 && get(b, "out2") == 0);
    wait(b, 600000);
    rig_cycle(b->rig);
    assert_true(get(b, "out1") == 0);
    assert_int_equal(b->out[0].rises, 1);
    assert_int_equal(b->out[0].width, 500002);
    set(b, "swtrigger1", 0);
    rig_cycle(b->rig);
    wait(b, 20000);
    assert_int_equal(b->out[0].rises, 1); /* a falling edge is none that was asked for */
    set(b, "swtrigger1", 1);
    set(b, "enable1", 0);
    rig_cycle(b->rig);
    wait(b, 20000);
    assert_int_equal(b->out[0].rises, 1);
}

static void the_rate_starts_pulses_and_the_second_follows_the_first(void **state)
{
    struct bench *const b = *state;
    set(b, "rate", 10000);
    set(b, "width1", 0.02);
    set(b, "trigger_select1", 4);
    set(b, "trigger_on_rise1", 1);
    set(b, "enable1", 1);
    set(b, "width2", 0.01);
    set(b, "trigger_select2", 5);
    set(b, "trigger_on_fall2", 1);
    set(b, "enable2", 1);
    rig_cycle(b->rig);
    wait(b, 1000000);
    assert_in_range(b->out[0].rises, 99, 101);
    assert_in_range(b->out[0].period, 9999, 10001);
    assert_int_equal(b->out[0].width, 2002);
    assert_int_equal(b->out[1].width, 1002);
    assert_in_range(b->out[1].rise - b->out[0].rise, 2003, 2004); /* seen, and started */
    set(b, "reset1", 1);
    rig_cycle(b->rig);
    const unsigned rises = b->out[0].rises;
    wait(b, 100);
    assert_int_equal(sim_card_watched(b->rig->card, 0), SIM_LOW);
    assert_true(b->out[0].rises - rises <= 1);
}

static void an_input_must_be_steady_for_the_filter_time(void **state)
{
    struct bench *const b = *state;
    set(b, "width1", 0.01);
    set(b, "filter1", 0.002); /* 200 clocks */
    set(b, "trigger_select1", 2);
    set(b, "trigger_on_rise1", 1);
    set(b, "trigger_on_fall1", 1);
    set(b, "enable1", 1);
    rig_cycle(b->rig);
    drive(b, b->rig->clk + 100, 1, SIM_HIGH);
    drive(b, b->rig->clk + 250, 1, SIM_LOW);
    wait(b, 2000);
    assert_int_equal(b->out[0].rises, 0);
    const int64_t clk = b->rig->clk + 100;
    drive(b, clk, 1, SIM_HIGH);
    wait(b, 5000);
    rig_cycle(b->rig);
    assert_true(get(b, "exttrigger1") == 1 && get(b, "exttrigger2") == 0);
    assert_int_equal(b->out[0].rises, 1);
    assert_in_range(b->out[0].rise - clk, 201, 204);
    drive(b, b->rig->clk + 10, 1, SIM_LOW);
    wait(b, 5000);
    rig_cycle(b->rig);
    assert_true(get(b, "exttrigger1") == 0);
    assert_int_equal(b->out[0].rises, 2);
}

static void a_retriggerable_pulse_begins_anew(void **state)
{
    struct bench *const b = *state;
    set(b, "rate", 50000); /* 2000 clocks */
    set(b, "width1", 0.03);
    set(b, "trigger_select1", 4);
    set(b, "trigger_on_rise1", 1);
    set(b, "enable1", 1);
    set(b, "width2", 0.03);
    set(b, "trigger_select2", 4);
    set(b, "trigger_on_rise2", 1);
    set(b, "retriggerable2", 1);
    set(b, "enable2", 1);
    rig_cycle(b->rig);
    wait(b, 100000);
    assert_in_range(b->out[0].rises, 24, 26); /* every other trigger finds it running */
    assert_int_equal(b->out[0].width, 3002);
    assert_int_equal(b->out[1].rises, 1);
    assert_int_equal(sim_card_watched(b->rig->card, 1), SIM_HIGH);
}

static void a_timer_of_the_dpll_starts_pulses(void **state)
{
    struct bench *const b = *state;
    set(b, "width1", 0.01);
    set(b, "trigger_select1", 3);
    set(b, "dpll_timer_number", 1);
    set(b, "trigger_on_rise1", 1);
    set(b, "enable1", 1);
    rig_cycle(b->rig);
    sim_card_write(b->rig->card, b->rig->clk, 0x7200, 1u << 24);
    sim_card_write(b->rig->card, b->rig->clk + 1, 0x7400, 0x8000);
    sim_card_write(b->rig->card, b->rig->clk + 2, 0x7000, 43980465); /* 2^42 / 100000 */
    wait(b, 2000000);
    assert_in_range(b->out[0].rises, 19, 21);
    assert_in_range(b->out[0].period, 99990, 100010);
    assert_int_equal(b->out[0].width, 1002);
}

static void registers_read_as_the_firmware_shows_them(void **state)
{
    struct bench *const b = *state;
    uint32_t undriven = 0;
    const int64_t clk = b->rig->clk;
    sim_card_write(b->rig->card, clk, CONTROL, 0xFFFFFFFF);
    assert_int_equal(sim_card_read(b->rig->card, clk + 10, CONTROL, &undriven) & ~0x03000300u, 0x04FFF4FF);
    assert_int_equal(undriven, 0);
    (void)sim_card_read(b->rig->card, clk + 12, 0xB100, &undriven);
    assert_int_equal(undriven, UINT32_MAX);
    (void)sim_card_read(b->rig->card, clk + 14, CONTROL + 8, &undriven);
    assert_int_equal(undriven, UINT32_MAX);
    sim_card_power_cycle(b->rig->card);
    assert_int_equal(sim_card_read(b->rig->card, sim_card_clock(b->rig->card) + 1, CONTROL, NULL), 0);
}

/* ---- leaps against single clocks ----------------------------------------------------------------------------------
 */

static struct sim_card *new_card(void)
{
    struct sim_card *card;
    const struct sim_card_options options = {.profile = "7i96s", .image = rig_image_with(modules, 3, NULL, 0)};
    assert_int_equal(sim_card_new(&card, &options, NULL), 0);
    return card;
}

static void disturb(struct sim_card *const cards[2], struct random *const random, int64_t clk)
{
    const uint16_t address = (uint16_t)(0xB100 + 0x100 * random_below(random, 6));
    const uint32_t small = random_below(random, 300), bits = (uint32_t)random_u64(random);
    const bool input = random_below(random, 3) == 0;
    const uint8_t pin = (uint8_t)(1 + random_below(random, 2));
    for (unsigned i = 0; i < 2; i++) {
        if (input)
            assert_int_equal(sim_card_drive_input(cards[i], clk, HM2_GTAG_ONESHOT, 0, pin, bits & 1u), 0);
        else
            sim_card_write(cards[i], clk, address,
                           address == CONTROL  ? bits & ~(0x00830083u & (bits >> 3))
                           : address == 0xB500 ? bits >> 4
                                               : small);
    }
}

static void a_leap_ends_where_single_clocks_end(void **state)
{
    (void)state;
    struct random random = {1};
    struct sim_card *const cards[2] = {new_card(), new_card()};
    int64_t clk = 10;
    assert_int_equal(sim_card_watch_output(cards[1], HM2_GTAG_ONESHOT, 0, OUT1), 0);
    for (unsigned i = 0; i < 3000; i++) {
        disturb(cards, &random, clk);
        const int64_t end = clk + 3 + (int64_t)random_below(&random, 600);
        for (clk++; clk < end; clk++)
            sim_card_advance(cards[1], clk);
        const uint32_t leapt = sim_card_read(cards[0], clk, CONTROL, NULL);
        const uint32_t walked = sim_card_read(cards[1], clk, CONTROL, NULL);
        if (leapt != walked)
            fail_msg("leap %u to clk %lld: %08X, in single clocks %08X", i, (long long)clk, leapt, walked);
        clk++;
    }
    sim_card_free(cards[0]);
    sim_card_free(cards[1]);
}

int main(void)
{
#define TEST(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(software_starts_a_pulse_of_the_width_asked_for),
        TEST(the_rate_starts_pulses_and_the_second_follows_the_first),
        TEST(an_input_must_be_steady_for_the_filter_time),
        TEST(a_retriggerable_pulse_begins_anew),
        TEST(a_timer_of_the_dpll_starts_pulses),
        cmocka_unit_test(a_leap_ends_where_single_clocks_end),
        TEST(registers_read_as_the_firmware_shows_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
