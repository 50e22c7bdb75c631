/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The simulated card as a bus with pads: decode, time, watches, wires, images good and bad. */
#include "unit.h"

#include <hm2/idrom.h>
#include <hm2/sim.h>

#include "replay.h"
#include "sim_card.h"

#define PORT_DATA    0x1000u
#define PORT_DDR     0x1100u
#define PORT_ALT     0x1200u
#define STEP_RATE    0x2000u
#define STEP_MODE    0x2200u
#define STEP_LEN     0x2500u
#define STEP_SPACE   0x2600u
#define STEP_BASE    0x2900u
#define IDROM        0x0400u
#define IDROM_ENABLE 0x0800u
#define PIN_STEP     0x81u
#define PIN_DIR      0x82u
#define PWM_VALUE    0x4100u /* new address map */
#define PWM_MODE     0x4200u
#define PWM_RATE     0x4300u
#define PWM_ENABLE   0x4500u
#define EDGES_MAX    4096u

struct edge {
    int64_t clk;
    unsigned ps, watch;
    enum sim_level level;
};

struct edges {
    unsigned count;
    struct edge edge[EDGES_MAX];
};

static void note_edge(void *const context, const int64_t clk, const unsigned ps, const unsigned watch,
                      const enum sim_level level)
{
    struct edges *const edges = context;
    assert_true(edges->count < EDGES_MAX);
    edges->edge[edges->count++] = (struct edge){clk, ps, watch, level};
}

static struct sim_card *card_with(const char *const profile, const struct hm2_image *const image)
{
    const struct sim_card_options options = {.profile = profile, .image = image};
    struct sim_card *card = NULL;
    struct hm2_diag diag = {0};
    if (sim_card_new(&card, &options, &diag))
        fail_msg("%s", diag.text);
    return card;
}

static uint32_t read_now(struct sim_card *const card, const uint16_t address)
{
    return sim_card_read(card, sim_card_clock(card), address, NULL);
}

static void write_now(struct sim_card *const card, const uint16_t address, const uint32_t value)
{
    sim_card_write(card, sim_card_clock(card), address, value);
}

/* ---- decode -------------------------------------------------------------------------------------------------------
 */

static void the_cookie_area_repeats_every_sixteen_bytes(void **state)
{
    (void)state;
    struct sim_card *const card = card_with("7i96s", NULL);
    static const uint32_t words[4] = {HM2_COOKIE, 0x54534F48, 0x32544F4D, 0x00000400};
    for (unsigned address = 0x0100; address < 0x0200; address += 4)
        assert_int_equal(read_now(card, (uint16_t)address), words[address / 4 % 4]);
    sim_card_free(card);
}

/* Register map, annex B. */
static void the_7i96s_image_has_the_words_of_the_shipping_firmware(void **state)
{
    (void)state;
    static const uint32_t header[16] = {3,    0x40, 0x1C0,      0x4153454D, 0x36394937, 0x14, 0x100, 3,
                                        0x33, 0x11, 0x05F5E100, 0x0BEBC200, 4,          0x40, 0x100, 0x100};
    static const uint32_t modules[33] = {
        0x0101001A, 0x00077000, 0,          0x01010002, 0x00030C00, 0,          0x03010003, 0x00051000, 0x0000001F,
        0x0101002D, 0x0001B000, 0x00000001, 0x01020006, 0x00054100, 0x00000003, 0x05010205, 0x000A2000, 0x000001FF,
        0x01010204, 0x00053000, 0x00000003, 0x010100C1, 0x10065B00, 0x0000003C, 0x010100C3, 0x00027D00, 0x00000003,
        0x01010023, 0x00058500, 0x0000001F, 0x01010080, 0x00010200, 0};
    struct sim_card *const card = card_with("7i96s", NULL);
    for (unsigned i = 0; i < 16; i++)
        assert_int_equal(read_now(card, (uint16_t)(IDROM + 4 * i)), header[i]);
    for (unsigned i = 0; i < 33; i++)
        assert_int_equal(read_now(card, (uint16_t)(0x0440 + 4 * i)), modules[i]);
    assert_int_equal(read_now(card, 0x0440 + 4 * 33), 0);
    assert_int_equal(read_now(card, 0x05C0), 0x03002301);
    assert_int_equal(read_now(card, 0x05C0 + 4 * 33), 0x0300C3A0);
    assert_int_equal(read_now(card, 0x05C0 + 4 * 50), 0x03000000);
    assert_int_equal(read_now(card, 0x05C0 + 4 * 51), 0x40000681); /* local I/O behind the last pin */
    assert_int_equal(read_now(card, 0x05C0 + 4 * 52), 0);
    sim_card_free(card);
}

static void every_profile_has_a_valid_image(void **state)
{
    (void)state;
    for (const char *const *profile = sim_profiles(); *profile; profile++) {
        struct sim_card *const card = card_with(*profile, NULL);
        struct hm2_image image;
        static struct hm2_idrom idrom;
        struct hm2_diag diag = {0};
        for (unsigned i = 0; i < 4; i++)
            image.id[i] = read_now(card, (uint16_t)(0x0100 + 4 * i));
        for (unsigned i = 0; i < HM2_IDROM_WORDS; i++)
            image.rom[i] = read_now(card, (uint16_t)(IDROM + 4 * i));
        if (hm2_idrom_parse(&image, NULL, &idrom, &diag))
            fail_msg("%s: %s", *profile, diag.text);
        assert_int_equal(idrom.pin_count, sim_card_idrom(card)->pin_count);
        assert_int_equal(idrom.module_count, sim_card_idrom(card)->module_count);
        assert_memory_equal(idrom.pins, sim_card_idrom(card)->pins, idrom.pin_count * sizeof idrom.pins[0]);
        sim_card_free(card);
    }
}

static void the_idrom_can_be_written_when_that_is_enabled(void **state)
{
    (void)state;
    struct sim_card *const card = card_with("7i96s", NULL);
    write_now(card, IDROM, 0x12345678);
    assert_int_equal(read_now(card, IDROM), 3);
    write_now(card, IDROM_ENABLE, 0xFFFFFFFF);
    assert_int_equal(read_now(card, IDROM_ENABLE), 1);
    write_now(card, IDROM, 0x12345678);
    write_now(card, IDROM_ENABLE, 0xFFFFFFFE);
    write_now(card, IDROM, 0);
    assert_int_equal(read_now(card, IDROM), 0x12345678);
    sim_card_free(card);
}

static void what_nobody_drives_is_told_and_rests_as_the_bus_does(void **state)
{
    (void)state;
    const struct sim_card_options options[] = {
        {.profile = "7i96s"}, {.profile = "7i93"}, {.profile = "7i93", .bus = SIM_BUS_ZEROS}};
    static const uint32_t rest[] = {0, UINT32_MAX, 0};
    for (unsigned i = 0; i < 3; i++) {
        struct sim_card *card = NULL;
        uint32_t undriven = 0;
        assert_int_equal(sim_card_new(&card, &options[i], NULL), 0);
        assert_int_equal(sim_card_read(card, 0, 0x9F00, &undriven), rest[i]);
        assert_int_equal(undriven, UINT32_MAX);
        assert_int_equal(sim_card_read(card, 0, 0x0100, &undriven), HM2_COOKIE);
        assert_int_equal(undriven, 0);
        sim_card_free(card);
    }
}

static void an_unknown_card_is_refused_with_the_known_ones(void **state)
{
    (void)state;
    const struct sim_card_options options = {.profile = "7i99"};
    struct sim_card *card = NULL;
    struct hm2_diag diag = {0};
    assert_int_equal(sim_card_new(&card, &options, &diag), HM2_ERR_NOTFOUND);
    assert_null(card);
    assert_non_null(strstr(diag.text, "7i96s"));
}

/* ---- faulty images ------------------------------------------------------------------------------------------------
 */

static void random_images_make_cards_that_answer(void **state)
{
    (void)state;
    uint32_t random = 12345;
    for (unsigned round = 0; round < 300; round++) {
        struct hm2_image image;
        uint32_t *const words = (uint32_t *)&image;
        for (size_t i = 0; i < sizeof image / sizeof *words; i++) {
            random = random * 1664525u + 1013904223u;
            words[i] = round % 2 ? random : random & 0x1F1F1F1Fu; /* the second kind is full of known tags */
        }
        if (round % 3 == 0)
            image.id[3] = IDROM;
        const struct sim_card_options options = {.profile = "7i93", .image = &image};
        struct sim_card *card = NULL;
        if (sim_card_new(&card, &options, NULL))
            continue; /* a model may refuse its descriptor */
        for (unsigned i = 0; i < 200; i++) {
            random = random * 1664525u + 1013904223u;
            const uint16_t address = (uint16_t)(random >> 16) & 0xFFFCu;
            write_now(card, address, random);
            (void)read_now(card, address);
        }
        assert_int_equal(read_now(card, 0x0100), image.id[0]);
        sim_card_advance(card, sim_card_clock(card) + 100000);
        sim_card_free(card);
    }
}

static void a_card_with_a_bad_cookie_answers_with_it(void **state)
{
    (void)state;
    struct hm2_image image;
    assert_true(replay_firmware("SVST4_4_48", &image));
    image.id[0] = 0xDEADBEEF;
    image.rom[9] = 0; /* port width */
    struct sim_card *const card = card_with("7i93", &image);
    assert_int_equal(read_now(card, 0x0100), 0xDEADBEEF);
    assert_int_equal(read_now(card, 0x0424), 0);
    sim_card_free(card);
}

/* ---- time ---------------------------------------------------------------------------------------------------------
 */

static void time_never_goes_back_and_a_write_takes_its_edge(void **state)
{
    (void)state;
    struct sim_card *const card = card_with("7i96s", NULL);
    sim_card_advance(card, 1000);
    assert_int_equal(sim_card_clock(card), 1000);
    (void)sim_card_read(card, 10, 0x0100, NULL);
    assert_int_equal(sim_card_clock(card), 1000);
    sim_card_write(card, 1010, PORT_DATA, 1);
    assert_int_equal(sim_card_clock(card), 1011);
    sim_card_advance(card, 5);
    assert_int_equal(sim_card_clock(card), 1011);
    sim_card_free(card);
}

static void a_week_without_access_costs_nothing(void **state)
{
    (void)state;
    struct sim_card *const card = card_with("7i96s", NULL);
    for (unsigned i = 0; i < 5; i++) {
        write_now(card, (uint16_t)(STEP_RATE + 4 * i), 0x10000000 + i);
        write_now(card, STEP_BASE, 0xFFFFFFFF);
    }
    sim_card_advance(card, INT64_C(7) * 86400 * 100000000);
    for (unsigned address = 0; address < 0x10000; address += 4)
        (void)read_now(card, (uint16_t)address);
    sim_card_free(card);
}

/* ---- pads ---------------------------------------------------------------------------------------------------------
 */

static void pads_rest_high_and_show_what_drives_them(void **state)
{
    (void)state;
    struct sim_card *const card = card_with("7i96s", NULL);
    assert_int_equal(read_now(card, PORT_DATA + 8), 0x1FFFF);
    assert_int_equal(sim_card_pad(card, 34), SIM_FLOAT);
    assert_int_equal(sim_card_drive(card, sim_card_clock(card), 35, SIM_LOW), 0);
    assert_int_equal(read_now(card, PORT_DATA + 8), 0x1FFFD);
    write_now(card, PORT_DATA + 8, 2);
    write_now(card, PORT_DDR + 8, 3);
    assert_int_equal(sim_card_pad(card, 34), SIM_LOW);
    assert_int_equal(sim_card_pad(card, 35), SIM_HIGH);
    assert_int_equal(read_now(card, PORT_DATA + 8), 0x1FFFE);
    assert_int_equal(sim_card_pad(card, 51), SIM_FLOAT);
    assert_int_equal(sim_card_drive(card, 0, 51, SIM_LOW), HM2_ERR_RANGE);
    sim_card_free(card);
}

static void wires_carry_levels_along_a_chain_and_refuse_rings(void **state)
{
    (void)state;
    struct sim_card *const card = card_with("7i96s", NULL);
    assert_int_equal(sim_card_wire(card, 36, 37), 0); /* laid against the direction of travel */
    assert_int_equal(sim_card_wire(card, 35, 36), 0);
    assert_int_equal(sim_card_wire(card, 34, 35), 0);
    assert_int_equal(sim_card_wire(card, 37, 34), HM2_ERR_STATE);
    assert_int_equal(sim_card_wire(card, 40, 37), HM2_ERR_STATE); /* two sources */
    assert_int_equal(sim_card_wire(card, 40, 40), HM2_ERR_STATE);
    assert_int_equal(sim_card_wire(card, 40, 99), HM2_ERR_RANGE);
    write_now(card, PORT_DDR + 8, 1);
    assert_int_equal(read_now(card, PORT_DATA + 8) & 0xF, 0x0);
    write_now(card, PORT_DATA + 8, 1);
    assert_int_equal(read_now(card, PORT_DATA + 8) & 0xF, 0xF);
    sim_card_free(card);
}

static void start_steps(struct sim_card *const card, const uint32_t rate)
{
    write_now(card, STEP_LEN, 10);
    write_now(card, STEP_SPACE, 10);
    write_now(card, STEP_BASE, 0xFFFFFFFF);
    write_now(card, STEP_RATE, rate);
}

static void a_watched_pad_shows_the_module_behind_it_only_when_enabled(void **state)
{
    (void)state;
    static struct edges edges;
    edges.count = 0;
    struct sim_card *const card = card_with("7i96s", NULL);
    sim_card_on_edge(card, note_edge, &edges);
    const int pad = sim_card_watch_pad(card, 17); /* StepGen 0, Step */
    const int output = sim_card_watch_output(card, HM2_GTAG_STEPGEN, 0, PIN_STEP);
    assert_int_equal(pad, 0);
    assert_int_equal(output, 1);
    assert_int_equal(sim_card_watched(card, 0), SIM_FLOAT);
    start_steps(card, 1u << 22); /* a step in 1024 clocks */
    sim_card_advance(card, 5000);
    for (unsigned i = 0; i < edges.count; i++)
        assert_int_equal(edges.edge[i].watch, output);
    assert_in_range(edges.count, 8, 10);
    edges.count = 0;
    write_now(card, PORT_DDR + 4, 1);
    write_now(card, PORT_ALT + 4, 1);
    sim_card_advance(card, sim_card_clock(card) + 10240);
    unsigned on_pad = 0, on_output = 0;
    for (unsigned i = 0; i < edges.count; i++) {
        on_pad += edges.edge[i].watch == 0 && edges.edge[i].level == SIM_HIGH;
        on_output += edges.edge[i].watch == 1 && edges.edge[i].level == SIM_HIGH;
        if (edges.edge[i].watch == 1 && edges.edge[i].level == SIM_HIGH)
            assert_int_equal(edges.edge[i].clk, edges.edge[i - 1].clk); /* the pad at the same edge */
    }
    assert_int_equal(on_output, 10);
    assert_int_equal(on_pad, 10);
    sim_card_free(card);
}

static void watching_changes_nothing_but_what_is_told(void **state)
{
    (void)state;
    static struct edges edges;
    edges.count = 0;
    struct sim_card *const plain = card_with("7i96s", NULL), *const watched = card_with("7i96s", NULL);
    sim_card_on_edge(watched, note_edge, &edges);
    assert_int_equal(sim_card_watch_output(watched, HM2_GTAG_STEPGEN, 0, PIN_STEP), 0);
    assert_int_equal(sim_card_watch_output(watched, HM2_GTAG_STEPGEN, 0, PIN_DIR), 1);
    start_steps(plain, 123456789);
    start_steps(watched, 123456789);
    for (int64_t clk = 100; clk < 30000; clk += 977)
        assert_int_equal(sim_card_read(plain, clk, 0x2100, NULL), sim_card_read(watched, clk, 0x2100, NULL));
    assert_true(edges.count > 500);
    sim_card_free(plain);
    sim_card_free(watched);
}

static void steps_over_a_wire_are_counted_as_the_follower_counts(void **state)
{
    (void)state;
    struct sim_card *const wired = card_with("7i96s", NULL);
    /* StepGen 0 in quadrature drives the encoder's A and B over two wires: I/O 17, 18 to 27, 28. */
    assert_int_equal(sim_card_wire(wired, 17, 27), 0);
    assert_int_equal(sim_card_wire(wired, 18, 28), 0);
    write_now(wired, STEP_MODE, 2);
    write_now(wired, PORT_DDR + 4, 3);
    write_now(wired, PORT_ALT + 4, 3);
    start_steps(wired, 1u << 20); /* a cycle, four counts, in 4096 clocks */
    sim_card_advance(wired, 409600);
    const int16_t there = (int16_t)read_now(wired, 0x3000);
    assert_in_range(there < 0 ? -there : there, 396, 402);
    write_now(wired, STEP_RATE, 0u - (1u << 20));
    sim_card_advance(wired, sim_card_clock(wired) + 409600);
    const int16_t back = (int16_t)read_now(wired, 0x3000);
    assert_in_range(back + 5, 0, 10);
    sim_card_free(wired);
}

static void an_output_of_the_fast_clock_is_told_with_picoseconds(void **state)
{
    (void)state;
    static struct edges edges;
    edges.count = 0;
    struct sim_card *const card = card_with("7i96s", NULL);
    sim_card_on_edge(card, note_edge, &edges);
    assert_int_equal(sim_card_watch_output(card, HM2_GTAG_PWMGEN, 0, PIN_STEP), 0);
    write_now(card, PWM_MODE, 0);
    write_now(card, PWM_ENABLE, 1);
    write_now(card, PWM_RATE, 0xFFFF);
    write_now(card, PWM_VALUE, 101u << 16); /* 101 of 512 counts of 5 ns: half clocks */
    sim_card_advance(card, 100000);
    assert_in_range(edges.count, 2 * 100000 / 257, 2 * 100000 / 255);
    unsigned between = 0;
    for (unsigned i = 1; i < edges.count; i++) {
        const int64_t before_ps = edges.edge[i - 1].clk * 10000 + edges.edge[i - 1].ps;
        const int64_t ps = edges.edge[i].clk * 10000 + edges.edge[i].ps;
        assert_true(ps > before_ps);
        between += edges.edge[i].ps > 0;
        if (i > 2 && i + 1 < edges.count && edges.edge[i].level == SIM_LOW)
            assert_in_range(ps - before_ps, 505000 - 10, 510000 + 10);
    }
    assert_true(between > 0);
    sim_card_free(card);
}

static void a_power_cycle_restores_registers_and_pads(void **state)
{
    (void)state;
    struct sim_card *const card = card_with("7i96s", NULL);
    write_now(card, PORT_DDR, 0x1FFFF);
    write_now(card, IDROM_ENABLE, 1);
    start_steps(card, 1u << 30);
    sim_card_advance(card, 10000);
    const int64_t before = sim_card_clock(card);
    sim_card_power_cycle(card);
    assert_int_equal(sim_card_clock(card), before);
    assert_int_equal(read_now(card, PORT_DDR), 0);
    assert_int_equal(read_now(card, IDROM_ENABLE), 0);
    assert_int_equal(read_now(card, 0x2100), 0);
    assert_int_equal(sim_card_pad(card, 0), SIM_FLOAT);
    sim_card_free(card);
}

static void inputs_and_watches_that_do_not_exist_are_refused(void **state)
{
    (void)state;
    struct sim_card *const card = card_with("7i96s", NULL);
    assert_int_equal(sim_card_watch_pad(card, 51), HM2_ERR_RANGE);
    assert_int_equal(sim_card_watch_output(card, HM2_GTAG_RESOLVER, 0, 0x81), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_watch_output(card, HM2_GTAG_STEPGEN, 0, 0x01), HM2_ERR_INVALID);
    assert_int_equal(sim_card_drive_input(card, 0, HM2_GTAG_RESOLVER, 0, 1, SIM_LOW), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_drive_input(card, 0, HM2_GTAG_ENCODER, 0, 0x81, SIM_LOW), HM2_ERR_INVALID);
    sim_card_free(card);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_cookie_area_repeats_every_sixteen_bytes),
        cmocka_unit_test(the_7i96s_image_has_the_words_of_the_shipping_firmware),
        cmocka_unit_test(every_profile_has_a_valid_image),
        cmocka_unit_test(the_idrom_can_be_written_when_that_is_enabled),
        cmocka_unit_test(what_nobody_drives_is_told_and_rests_as_the_bus_does),
        cmocka_unit_test(an_unknown_card_is_refused_with_the_known_ones),
        cmocka_unit_test(random_images_make_cards_that_answer),
        cmocka_unit_test(a_card_with_a_bad_cookie_answers_with_it),
        cmocka_unit_test(time_never_goes_back_and_a_write_takes_its_edge),
        cmocka_unit_test(a_week_without_access_costs_nothing),
        cmocka_unit_test(pads_rest_high_and_show_what_drives_them),
        cmocka_unit_test(wires_carry_levels_along_a_chain_and_refuse_rings),
        cmocka_unit_test(a_watched_pad_shows_the_module_behind_it_only_when_enabled),
        cmocka_unit_test(watching_changes_nothing_but_what_is_told),
        cmocka_unit_test(steps_over_a_wire_are_counted_as_the_follower_counts),
        cmocka_unit_test(an_output_of_the_fast_clock_is_told_with_picoseconds),
        cmocka_unit_test(a_power_cycle_restores_registers_and_pads),
        cmocka_unit_test(inputs_and_watches_that_do_not_exist_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
