/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Simulated encoders against the recorded firmware, and computed time against counted time. */
#include "unit.h"

#include <math.h>
#include <stdlib.h>

#include "random.h"
#include "sim_qcounter.h"
#include "trace_folder.h"

#define MAX_COUNTERS 8u

static struct sim_card *new_card(const char *const firmware, const char *const profile)
{
    struct hm2_image image;
    struct hm2_diag diag = {0};
    struct sim_card *card = NULL;
    assert_true(!firmware || replay_firmware(firmware, &image));
    const struct sim_card_options options = {.profile = profile, .image = firmware ? &image : NULL};
    if (sim_card_new(&card, &options, &diag))
        fail_msg("%s", diag.text);
    return card;
}

/* ---- recorded firmware
 * ------------------------------------------------------------------------------------------------- */

static void the_recorded_counters_are_matched_at_every_clock(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("encoder");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 55);
}

static void the_recorded_multiplexed_counters_are_matched_at_every_clock(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("encoder_muxed");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 13);
}

/* ---- computed against counted time
 * --------------------------------------------------------------------------------------- The same logic driven one
 * clock after the other, with real down counters, a real shift register for the select bit, and no edge left out. */

struct counted {
    bool muxed;
    struct sim_qc_type type;
    unsigned count;
    struct sim_qcounter counters[MAX_COUNTERS];
    bool pin[MAX_COUNTERS][3]; /* muxed: of each encoder behind the multiplexer */
    uint16_t rate, rate_count, div_latch, div, stamp;
    unsigned deskew;
    uint8_t select, select_1, select_out;
    bool delayed[16], sample, half_tick;
    int64_t clk;
};

static void demultiplex(struct counted *const c)
{
    const bool sample = c->delayed[c->deskew];
    for (unsigned i = 0; i < c->count; i++) {
        const bool latch = (i & 1u) ? !sample && c->sample : sample && !c->sample;
        for (unsigned input = 0; latch && input < 3; input++)
            c->counters[i].pin[input] = c->pin[i / 2 * 2 + (c->select_out & 1u)][input];
    }
    c->half_tick = !sample && c->sample;
    c->sample = sample;
    c->select_out = c->select_1;
    c->select_1 = c->select;
    memmove(c->delayed + 1, c->delayed, sizeof(c->delayed) - sizeof(c->delayed[0]));
    c->delayed[0] = c->select & 1u;
}

static void counted_edge(struct counted *const c, const unsigned page, const unsigned instance, const uint32_t value)
{
    const bool tick = c->rate_count & 0x800u;
    const bool filters = c->muxed && c->type.filter_halved ? c->half_tick : tick;
    const struct sim_qc_access access = {
        .clear = page == SIM_QC_PAGE_COUNT, .load = page == SIM_QC_PAGE_CONTROL, .value = (uint16_t)value};
    for (unsigned i = 0; i < c->count; i++)
        sim_qcounter_edge(&c->counters[i], &c->type, c->clk, filters, c->stamp, i == instance ? &access : NULL);
    if (c->muxed)
        demultiplex(c);
    if (tick && c->muxed)
        c->select = (c->select + 1u) & 3u;
    c->rate_count = tick ? c->rate : (c->rate_count - 1u) & 0xFFFu;
    if (c->div & 0x8000u) {
        c->div = c->div_latch;
        c->stamp++;
    } else {
        c->div--;
    }
    if (page == SIM_QC_PAGE_RATE) {
        c->rate = value & 0xFFFu;
        c->deskew = value >> 28;
    }
    if (page == SIM_QC_PAGE_TSDIV)
        c->div_latch = (uint16_t)value;
    c->clk++;
}

static void counted_run(struct counted *const c, const int64_t clk)
{
    while (c->clk < clk)
        counted_edge(c, UINT32_MAX, 0, 0);
}

struct bench {
    struct random random;
    struct sim_card *card;
    struct counted counted;
    uint8_t gtag;
    uint16_t base;
    uint32_t quad[MAX_COUNTERS];
    unsigned inputs_changed, writes, reads;
};

/* Inputs turn most of the time and jump sometimes: quadrature errors are part of it. */
static void change_input(struct bench *const b)
{
    struct random *const r = &b->random;
    const unsigned i = random_below(r, b->counted.count);
    unsigned input = random_below(r, 5);
    bool level = random_below(r, 2);
    if (input < 2 && random_below(r, 8)) {
        const uint32_t from = b->quad[i], to = from + (random_below(r, 4) ? 1u : 3u);
        input = ((to + 1) & 2u) != ((from + 1) & 2u) ? 0 : 1;
        level = input == 0 ? ((to + 1) & 2u) != 0 : (to & 2u) != 0;
        b->quad[i] = to;
    }
    if (input == 4 && (!b->counted.type.probe || b->counted.muxed))
        return;
    const uint8_t pin = (uint8_t)(input + 1 + (b->counted.muxed && input < 3 ? 0x40 : 0));
    assert_int_equal(sim_card_drive_input(b->card, b->counted.clk - 1, b->gtag, i, pin, level ? SIM_HIGH : SIM_LOW), 0);
    if (input == 3)
        b->counted.counters[i].mask = level;
    else if (input == 4)
        for (unsigned n = 0; n < b->counted.count; n++)
            b->counted.counters[n].pin[SIM_QC_PROBE] = level;
    else if (b->counted.muxed)
        b->counted.pin[i][input] = level;
    else
        b->counted.counters[i].pin[input] = level;
    b->inputs_changed++;
}

static uint32_t any_rate(struct random *const r)
{
    static const uint32_t rates[] = {0, 1, 2, 4, 11, 60, 0x7FF, 0x800, 0xFFF};
    return rates[random_below(r, sizeof(rates) / sizeof(rates[0]))] | random_below(r, 16) << 28;
}

static uint32_t any_divider(struct random *const r)
{
    static const uint32_t dividers[] = {0, 1, 8, 98, 0x7FFE, 0x7FFF, 0x8000, 0xFFFF};
    return dividers[random_below(r, sizeof(dividers) / sizeof(dividers[0]))];
}

static void write_something(struct bench *const b)
{
    struct random *const r = &b->random;
    static const unsigned pages[] = {SIM_QC_PAGE_CONTROL, SIM_QC_PAGE_CONTROL, SIM_QC_PAGE_CONTROL,
                                     SIM_QC_PAGE_COUNT,   SIM_QC_PAGE_TSDIV,   SIM_QC_PAGE_RATE};
    const unsigned page = pages[random_below(r, sizeof(pages) / sizeof(pages[0]))];
    const unsigned i = page <= SIM_QC_PAGE_CONTROL ? random_below(r, b->counted.count + 1) : 0;
    uint32_t value = (uint32_t)random_u64(r);
    if (page == SIM_QC_PAGE_RATE)
        value = any_rate(r);
    if (page == SIM_QC_PAGE_TSDIV)
        value = any_divider(r);
    sim_card_write(b->card, b->counted.clk, (uint16_t)(b->base + page * 0x100u + i * 4u), value);
    counted_edge(&b->counted, page, i, value);
    b->writes++;
}

static void compare_all(struct bench *const b, const uint64_t seed)
{
    const struct counted *const c = &b->counted;
    const bool late = c->type.dpll_select;
    for (unsigned i = 0; i < c->count; i++) {
        const struct sim_qcounter *const q = &c->counters[i];
        const uint32_t data = late ? q->before_data : sim_qcounter_data(q);
        const uint32_t control = late ? q->before_control : sim_qcounter_control(q);
        const uint32_t got_data = sim_card_read(b->card, c->clk, (uint16_t)(b->base + 4 * i), NULL);
        uint32_t undriven = 0;
        const uint32_t got_control = sim_card_read(b->card, c->clk, (uint16_t)(b->base + 0x100 + 4 * i), &undriven);
        if (got_data != data || ((got_control ^ control) & ~undriven))
            fail_msg("seed %llu clk %lld counter %u: expected %08X %08X, got %08X %08X", (unsigned long long)seed,
                     (long long)c->clk, i, (unsigned)data, (unsigned)control, (unsigned)got_data,
                     (unsigned)got_control);
    }
    if (!late)
        assert_int_equal(sim_card_read(b->card, c->clk, (uint16_t)(b->base + 0x300), NULL) & 0xFFFFu, c->stamp);
    b->reads++;
}

static void check_closed_form(const char *const firmware, const char *const profile, const uint8_t gtag,
                              const struct sim_qc_type type, const uint16_t base, const uint64_t seed)
{
    struct bench b = {.random = {seed}, .card = new_card(firmware, profile), .gtag = gtag, .base = base};
    struct counted *const c = &b.counted;
    c->muxed = gtag == HM2_GTAG_MUXED_ENCODER;
    c->type = type;
    const struct hm2_md *const md = hm2_idrom_find(sim_card_idrom(b.card), gtag);
    assert_non_null(md);
    c->count = md->instances < MAX_COUNTERS ? md->instances : MAX_COUNTERS;
    c->rate = c->muxed ? 11 : 4;
    for (unsigned i = 0; i < c->count; i++)
        for (unsigned pin = 1; pin <= 5; pin++)
            assert_int_equal(
                sim_card_drive_input(b.card, -1, gtag, i, (uint8_t)(pin + (c->muxed && pin < 4 ? 0x40 : 0)), SIM_LOW),
                0);
    for (unsigned op = 0; op < 60; op++) {
        const uint32_t pace = 1u + random_below(&b.random, 4) * 60u;
        counted_run(c, c->clk + random_below(&b.random, pace) + (random_below(&b.random, 20) ? 0 : 5000));
        if (random_below(&b.random, 5))
            change_input(&b);
        else
            write_something(&b);
        if (random_below(&b.random, 3) == 0) {
            counted_run(c, c->clk + 1 + random_below(&b.random, 40));
            compare_all(&b, seed);
        }
    }
    counted_run(c, c->clk + 200);
    compare_all(&b, seed);
    assert_true(b.inputs_changed > 10 && b.reads > 3);
    sim_card_free(b.card);
}

static void jumps_over_quiet_time_change_nothing(void **state)
{
    (void)state;
    const struct sim_qc_type old_type = {0};
    const struct sim_qc_type new_type = {.error_by_one = true, .filter_halved = true, .dpll_select = true};
    for (uint64_t seed = 1; seed <= 400; seed++) {
        check_closed_form("SVST8_4IM2_72", "7i93", HM2_GTAG_ENCODER, old_type, 0x3000, seed);
        check_closed_form("SV6_7I48_48", "7i93", HM2_GTAG_MUXED_ENCODER, old_type, 0x3500, seed);
        check_closed_form(NULL, "7i93", HM2_GTAG_ENCODER, new_type, 0x3000, seed);
    }
}

/* ---- dividers, in closed form and counted
 * ---------------------------------------------------------------------------------- */

static void dividers_tick_as_their_down_counters_do(void **state)
{
    (void)state;
    struct random r = {7};
    for (unsigned round = 0; round < 300; round++) {
        const uint32_t values[] = {0, 1, 2, random_below(&r, 50), 0x7FF, 0x800, 0xFFF};
        struct sim_divider d;
        uint32_t rate = values[random_below(&r, 7)], count = 0;
        sim_divider_start(&d, 0, rate, 0x800);
        int64_t ticks = 0;
        for (int64_t clk = 0; clk < 300; clk++) {
            const bool tick = count & 0x800u;
            assert_int_equal(sim_divider_tick(&d, clk) == clk, tick);
            ticks += tick;
            count = tick ? rate : (count - 1u) & 0xFFFu;
            if (random_below(&r, 40) == 0) {
                rate = values[random_below(&r, 7)];
                sim_divider_write(&d, clk, rate, 0x800);
            }
        }
        assert_true(ticks > 0);
    }
}

/* ---- what the traces do not show
 * ---------------------------------------------------------------------------------------- */

static void the_newer_firmware_clears_a_quadrature_error_by_writing_one(void **state)
{
    (void)state;
    struct sim_card *const card = new_card(NULL, "7i96s");
    for (uint8_t pin = 1; pin <= 3; pin++)
        assert_int_equal(sim_card_drive_input(card, 10, HM2_GTAG_ENCODER, 0, pin, SIM_LOW), 0);
    sim_card_advance(card, 1000);
    sim_card_write(card, 1000, 0x3100, 0x8000);
    assert_int_equal(sim_card_read(card, 1010, 0x3100, NULL) & 0x8000, 0);
    assert_int_equal(sim_card_drive_input(card, 1020, HM2_GTAG_ENCODER, 0, 1, SIM_HIGH), 0);
    assert_int_equal(sim_card_drive_input(card, 1020, HM2_GTAG_ENCODER, 0, 2, SIM_HIGH), 0);
    assert_int_equal(sim_card_read(card, 1200, 0x3100, NULL) & 0x8000, 0x8000);
    sim_card_write(card, 1210, 0x3100, 0x0000);
    assert_int_equal(sim_card_read(card, 1220, 0x3100, NULL) & 0x8000, 0x8000);
    sim_card_write(card, 1230, 0x3100, 0x8000);
    assert_int_equal(sim_card_read(card, 1240, 0x3100, NULL) & 0x8000, 0);
    sim_card_free(card);
}

static void a_probe_edge_latches_and_disarms(void **state)
{
    (void)state;
    struct hm2_image image;
    assert_true(replay_firmware("SVST8_4IM2_72", &image));
    for (unsigned i = 0; i < 32; i++) /* version 3 counters have the probe input (register map 3.5.8) */
        if ((image.rom[16 + 3 * i] & 0xFFu) == HM2_GTAG_ENCODER)
            image.rom[16 + 3 * i] = (image.rom[16 + 3 * i] & ~0xFF00u) | 0x300u;
    const struct sim_card_options options = {.profile = "7i93", .image = &image};
    struct sim_card *card = NULL;
    assert_int_equal(sim_card_new(&card, &options, NULL), 0);
    for (uint8_t pin = 1; pin <= 5; pin++)
        assert_int_equal(sim_card_drive_input(card, 10, HM2_GTAG_ENCODER, 2, pin, SIM_LOW), 0);
    assert_int_equal(sim_card_drive_input(card, 200, HM2_GTAG_ENCODER, 2, 1, SIM_HIGH), 0);
    sim_card_write(card, 400, 0x3108, 0x3040); /* latch on probe, rising, just once */
    uint32_t undriven = 1;
    assert_int_equal(sim_card_read(card, 410, 0x3108, &undriven) >> 12 & 3u, 3);
    assert_int_equal(undriven, 0);
    assert_int_equal(sim_card_drive_input(card, 420, HM2_GTAG_ENCODER, 0, 5, SIM_HIGH), 0);
    const uint32_t control = sim_card_read(card, 600, 0x3108, NULL);
    assert_int_equal(control >> 16, 1);
    assert_int_equal(control & 0x2000, 0);
    assert_int_equal(control & 0x1040, 0x1040);
    sim_card_free(card);
}

#define PORTS      4u
#define REG_DDR    0x1100u
#define REG_SOURCE 0x1200u
#define REG_INVERT 0x1400u

/* The pads of a port that outputs of modules are behind; inputs stay what they are. */
static uint32_t outputs_of(const struct sim_card *const card, const unsigned port)
{
    const struct hm2_idrom *const idrom = sim_card_idrom(card);
    uint32_t mask = 0;
    for (unsigned bit = 0; bit < idrom->port_width; bit++) {
        const unsigned io = port * idrom->port_width + bit;
        if (io < idrom->pin_count && (idrom->pins[io].secondary_pin & HM2_PIN_OUTPUT))
            mask |= 1u << bit;
    }
    return mask;
}

static void write_ports(struct sim_card *const card, const int64_t clk, const unsigned reg, const bool set)
{
    for (unsigned port = 0; port < PORTS; port++)
        sim_card_write(card, clk + port, (uint16_t)(reg + 4 * port), set ? outputs_of(card, port) : 0);
}

/* The outputs of the modules reach all of the pads that have some, within eight clocks. */
static void drive_pads(struct sim_card *const card, const int64_t clk)
{
    write_ports(card, clk, REG_DDR, true);
    write_ports(card, clk + PORTS, REG_SOURCE, true);
}

static void start_stepgen(struct sim_card *const card, const int64_t clk, const uint32_t rate)
{
    drive_pads(card, clk - 2 * PORTS);
    sim_card_write(card, clk, 0x2900, UINT32_MAX);
    sim_card_write(card, clk + 1, 0x2500, 10);
    sim_card_write(card, clk + 2, 0x2600, 10);
    sim_card_write(card, clk + 3, 0x2000, rate);
}

/* ---- samples of a DPLL timer
 * ---------------------------------------------------------------------------------------------- */

#define DPLL_PERIOD_CLK 100000

static struct sim_card *card_with_dpll(const bool selected)
{
    struct sim_card *const card = new_card(NULL, "7i96s");
    sim_card_write(card, 10, 0x7000, 0x02AF31DC); /* 2^42 / (base rate / 1) = some 98 thousand clocks */
    sim_card_write(card, 11, 0x7200, 0x01FFFFFF);
    sim_card_write(card, 12, 0x7400, 0x00004000);
    assert_int_equal(sim_card_follow(card, 0, 0, 4, 1), 0);
    start_stepgen(card, 20, 4294967u);                       /* a step per 1000 clocks, a count per 250 */
    sim_card_write(card, 40, 0x3500, selected ? 0x9000 : 0); /* timer 1 */
    return card;
}

static void counts_are_those_of_the_selected_timer_s_last_rise(void **state)
{
    (void)state;
    struct sim_card *const sampled = card_with_dpll(true), *const live = card_with_dpll(false);
    assert_int_equal(sim_card_read(sampled, 50, 0x3500, NULL), 0x9000);
    unsigned rises = 0;
    int64_t last = INT64_MIN;
    for (int64_t clk = 3 * DPLL_PERIOD_CLK; clk < 12 * DPLL_PERIOD_CLK; clk += 33333) {
        sim_card_advance(sampled, clk);
        const int64_t rise = sim_dpll_last_rise(sampled, 1, clk - 1);
        assert_true(rise > 0 && clk - rise < 2 * DPLL_PERIOD_CLK);
        const uint32_t got = sim_card_read(sampled, clk, 0x3000, NULL);
        const uint32_t stamp = sim_card_read(sampled, clk, 0x3300, NULL) & 0xFFFFu;
        if (rise == last)
            continue;
        last = rise;
        rises++;
        const uint32_t expected = sim_card_read(live, rise + 2, 0x3000, NULL); /* live reads are a clock late */
        assert_int_equal(got & 0xFFFFu, expected & 0xFFFFu);
        assert_int_equal(stamp, sim_card_read(live, rise + 2, 0x3300, NULL) & 0xFFFFu);
    }
    assert_true(rises >= 6);
    sim_card_free(sampled);
    sim_card_free(live);
}

/* ---- followers
 * ----------------------------------------------------------------------------------------------------------- */

static int16_t count_of(struct sim_card *const card, const int64_t clk, uint16_t *const stamp)
{
    const uint32_t data = sim_card_read(card, clk, 0x3000, NULL);
    if (stamp)
        *stamp = (uint16_t)(data >> 16);
    return (int16_t)data;
}

static void an_encoder_follows_its_step_generator_with_floor(void **state)
{
    (void)state;
    static const struct {
        int32_t num, den;
    } ratios[] = {{1, 1}, {4, 1}, {-4, 1}, {3, 7}, {-3, 7}, {4096, 200}};
    for (unsigned i = 0; i < sizeof(ratios) / sizeof(ratios[0]); i++) {
        struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
        assert_int_equal(sim_card_follow(card, 0, 1, ratios[i].num, ratios[i].den), 0);
        drive_pads(card, 80);
        sim_card_write(card, 90, 0x2900, UINT32_MAX);
        for (unsigned s = 0; s < 2; s++) {
            sim_card_write(card, 100, (uint16_t)(0x2500 + 4 * s), 10);
            sim_card_write(card, 101, (uint16_t)(0x2600 + 4 * s), 10);
        }
        sim_card_write(card, 110, 0x2004, 42949673u); /* 1 step per 100 clocks */
        int64_t clk = 200;
        for (unsigned n = 0; n < 50; n++, clk += 1777) {
            if (n == 25)
                sim_card_write(card, clk - 10, 0x2004, (uint32_t)-42949673);
            const int16_t count = count_of(card, clk, NULL);
            const int64_t position = (int32_t)sim_card_read(card, clk, 0x2104, NULL); /* 16.16 steps */
            const double exact = (double)position / 65536.0 * ratios[i].num / ratios[i].den;
            assert_true(count <= exact + 1e-9 + (ratios[i].num < 0 ? 0.25 : 0));
            assert_true(count > exact - 1.25);
        }
        sim_card_free(card);
    }
}

static void a_follower_s_time_stamps_give_its_speed(void **state)
{
    (void)state;
    struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
    assert_int_equal(sim_card_follow(card, 0, 0, 4, 1), 0);
    start_stepgen(card, 100, 429497u); /* 1 step per 10000 clocks: a count each 2500 */
    uint16_t before = 0;
    int64_t clk = 100000;
    int16_t count = count_of(card, clk, &before);
    for (unsigned n = 0; n < 200; n++) {
        uint16_t stamp = 0;
        clk += 10007;
        const int16_t now = count_of(card, clk, &stamp);
        assert_int_equal(now - count >= 4 && now - count <= 5, 1);
        const unsigned ticks = (uint16_t)(stamp - before); /* of two clocks */
        const int expected = (now - count) * 1250;
        assert_true(abs((int)ticks - expected) <= 3);
        before = stamp;
        count = now;
    }
    sim_card_free(card);
}

#define CLK_PER_S 100000000

static int64_t turned(struct sim_card *const card, const int64_t clk)
{
    int64_t position = INT64_MIN;
    sim_card_advance(card, clk);
    assert_int_equal(sim_card_turned(card, HM2_GTAG_ENCODER, 0, &position), 0);
    return position;
}

static void a_motor_turns_its_encoder_at_the_speed_of_the_duty_while_it_is_enabled(void **state)
{
    (void)state;
    static const struct {
        uint32_t mode, value;
        double duty;
    } rows[] = {
        {0x03, 0x08000000, 0.5}, {0x03, 0x88000000, -0.5}, {0x03, 0x0FFF0000, 4095.0 / 4096}, {0x00, 0x00800000, 0.25},
        {0x00, 0x0FFF0000, 1},   {0x18, 0x04000000, 0.25}, {0x27, 0x84000000, -0.25},         {0x03, 0, 0},
    };
    for (unsigned i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
        assert_int_equal(sim_card_motor(card, 0, 3, 80000), 0);
        write_ports(card, 5, REG_DDR, true);
        sim_card_write(card, 10, 0x4200, 0xFFFF);
        sim_card_write(card, 11, 0x410C, rows[i].mode);
        sim_card_write(card, 12, 0x400C, rows[i].value);
        assert_int_equal(turned(card, CLK_PER_S), 0);
        sim_card_write(card, CLK_PER_S, 0x4400, 1u << 3);
        const int64_t end = turned(card, 3 * (int64_t)CLK_PER_S / 2);
        if (fabs((double)end - 40000 * rows[i].duty) > 1)
            fail_msg("row %u: %lld counts", i, (long long)end);
        sim_card_write(card, 3 * (int64_t)CLK_PER_S / 2, 0x4400, ~(1u << 3));
        assert_true(llabs(turned(card, 4 * (int64_t)CLK_PER_S) - end) <= 1);
        assert_int_equal(count_of(card, 4 * (int64_t)CLK_PER_S + 1, NULL), (int16_t)end);
        sim_card_free(card);
    }
}

static void a_motor_rests_when_its_pin_is_no_output_any_more(void **state)
{
    (void)state;
    struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
    assert_int_equal(sim_card_motor(card, 0, 0, 80000), 0);
    sim_card_write(card, 10, 0x4200, 0xFFFF);
    sim_card_write(card, 11, 0x4100, 0x03);
    sim_card_write(card, 12, 0x4000, 0x08000000);
    sim_card_write(card, 13, 0x4400, 1);
    assert_int_equal(turned(card, CLK_PER_S), 0);
    sim_card_write(card, CLK_PER_S, 0x1100, 1u << 7);
    const int64_t end = turned(card, 2 * (int64_t)CLK_PER_S);
    assert_true(llabs(end - 40000) <= 1);
    sim_card_write(card, 2 * (int64_t)CLK_PER_S, 0x1100, 0);
    assert_int_equal(turned(card, 3 * (int64_t)CLK_PER_S), end);
    sim_card_free(card);
}

/* The pads are no outputs any more, or those of general-purpose bits; inverted they still carry steps. */
static void a_follower_rests_while_the_steps_do_not_reach_their_pin(void **state)
{
    (void)state;
    static const struct {
        unsigned reg;
        bool steps;
    } rows[] = {{REG_DDR, false}, {REG_SOURCE, false}, {REG_INVERT, true}};
    for (unsigned i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
        assert_int_equal(sim_card_follow(card, 0, 0, 4, 1), 0);
        start_stepgen(card, 100, 4294967u); /* 1 step per 1000 clocks */
        /* Nothing looks at the encoder before and after: what counts is when the pads change. */
        write_ports(card, 1000000, rows[i].reg, rows[i].steps);
        const int64_t rest = turned(card, 2000000);
        assert_true(llabs(rest - (rows[i].steps ? 8000 : 4000)) <= 5);
        assert_int_equal(count_of(card, 2000000, NULL), rest);
        drive_pads(card, 3000000);
        assert_true(llabs(turned(card, 3000020) - (rows[i].steps ? 12000 : rest)) <= 5);
        assert_true(llabs(turned(card, 4000000) - (rows[i].steps ? 16000 : rest + 4000)) <= 5);
        /* The generator itself has run all the time. */
        assert_true(abs((int)(sim_card_read(card, 4000001, 0x2100, NULL) >> 16) - 4000) <= 1);
        sim_card_free(card);
    }
}

static void a_follower_rests_before_its_pads_are_driven_and_after_a_bite(void **state)
{
    (void)state;
    struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
    assert_int_equal(sim_card_follow(card, 0, 0, 4, 1), 0);
    sim_card_write(card, 90, 0x2900, UINT32_MAX);
    sim_card_write(card, 91, 0x2500, 10);
    sim_card_write(card, 92, 0x2600, 10);
    sim_card_write(card, 100, 0x2000, 4294967u);
    assert_int_equal(turned(card, 500000), 0);
    int64_t steps = -1;
    assert_int_equal(sim_card_turned(card, HM2_GTAG_STEPGEN, 0, &steps), 0);
    assert_int_equal(steps, 0);
    drive_pads(card, 500000);
    sim_card_write(card, 600000, 0x0C00, 400000); /* the watchdog's time */
    const int64_t rest = turned(card, 2000000);
    assert_true(llabs(rest - 2000) <= 5);
    assert_int_equal(turned(card, 3000000), rest);
    assert_int_equal(sim_card_turned(card, HM2_GTAG_STEPGEN, 0, &steps), 0);
    assert_true(llabs(steps - rest / 4) <= 1);
    sim_card_free(card);
}

/* How the driver looks for an index: latch and clear, once (register map 3.5.2). */
#define ONCE  0x40u
#define CLEAR 0x20u
#define LATCH 0x10u

static void the_index_of_a_follower_latches_and_clears_where_it_is(void **state)
{
    (void)state;
    static const struct {
        int32_t counts_a_step;
        uint32_t control;
        int16_t count, latch; /* after 8000 counts, an index every 3000 */
        uint32_t left;
    } rows[] = {
        {8, ONCE | CLEAR | LATCH, 5000, 3000, ONCE},
        {-8, ONCE | CLEAR | LATCH, -5000, -3000, ONCE},
        {8, CLEAR | LATCH, 2000, 3000, CLEAR | LATCH}, /* the second index finds 3000, too */
        {8, LATCH, 8000, 6000, LATCH},
        {8, 0, 8000, 0, 0},
    };
    for (unsigned i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
        assert_int_equal(sim_card_index(card, 0, 3000), HM2_ERR_STATE);
        assert_int_equal(sim_card_follow(card, 0, 0, rows[i].counts_a_step, 1), 0);
        assert_int_equal(sim_card_index(card, 0, 3000), 0);
        sim_card_write(card, 50, 0x3100, rows[i].control);
        start_stepgen(card, 100, 4294967u); /* 1 step per 1000 clocks */
        int64_t clk = 1000;
        while (llabs(turned(card, clk)) < 8000)
            clk += 1000;
        const int64_t more = turned(card, clk) - (rows[i].counts_a_step > 0 ? 8000 : -8000);
        const uint32_t control = sim_card_read(card, clk, 0x3100, NULL);
        assert_true(llabs(more) <= 8);
        assert_int_equal(count_of(card, clk, NULL), rows[i].count + more);
        assert_int_equal((int16_t)(control >> 16), rows[i].latch);
        assert_int_equal(control & (ONCE | CLEAR | LATCH), rows[i].left);
        sim_card_free(card);
    }
}

static void one_look_finds_every_index_on_the_way(void **state)
{
    (void)state;
    static const struct {
        uint32_t control;
        int16_t count, latch;
    } rows[] = {{ONCE | CLEAR | LATCH, 5000, 3000}, {LATCH, 8000, 6000}};
    for (unsigned i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
        assert_int_equal(sim_card_follow(card, 0, 0, 8, 1), 0);
        assert_int_equal(sim_card_index(card, 0, 3000), 0);
        sim_card_write(card, 50, 0x3100, rows[i].control);
        start_stepgen(card, 100, 4294967u);
        const int16_t count = count_of(card, 1000000, NULL); /* some 1000 steps */
        assert_true(abs(count - rows[i].count) < 16);
        assert_int_equal(sim_card_read(card, 1000001, 0x3100, NULL) >> 16, rows[i].latch);
        sim_card_free(card);
    }
}

static void a_power_cycle_clears_the_count_and_not_the_axis(void **state)
{
    (void)state;
    struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
    assert_int_equal(sim_card_follow(card, 0, 0, 4, 1), 0);
    start_stepgen(card, 100, 4294967u);
    const int64_t before = turned(card, 1000000);
    assert_int_equal(count_of(card, 1000000, NULL), before);
    sim_card_power_cycle(card);
    assert_int_equal(turned(card, 1100000), before);
    assert_int_equal(count_of(card, 1100001, NULL), 0);
    start_stepgen(card, 1200000, 4294967u);
    const int64_t after = turned(card, 2200000);
    assert_true(after > before + 3900);
    assert_int_equal(count_of(card, 2200000, NULL), after - before);
    sim_card_free(card);
}

static void following_needs_what_the_card_has(void **state)
{
    (void)state;
    struct sim_card *const card = new_card("SVST8_4IM2_72", "7i93");
    assert_int_equal(sim_card_follow(card, 8, 0, 1, 1), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_follow(card, 0, 4, 1, 1), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_follow(card, 0, 0, 1, 0), HM2_ERR_RANGE);
    assert_int_equal(sim_card_motor(card, 8, 0, 1), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_motor(card, 0, 8, 1), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_index(card, 8, 1), HM2_ERR_NOTFOUND);
    int64_t position;
    assert_int_equal(sim_card_turned(card, HM2_GTAG_ENCODER, 8, &position), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_turned(card, HM2_GTAG_STEPGEN, 4, &position), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_card_turned(card, HM2_GTAG_PWMGEN, 0, &position), HM2_ERR_NOTFOUND);
    sim_card_free(card);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_recorded_counters_are_matched_at_every_clock),
        cmocka_unit_test(the_recorded_multiplexed_counters_are_matched_at_every_clock),
        cmocka_unit_test(jumps_over_quiet_time_change_nothing),
        cmocka_unit_test(dividers_tick_as_their_down_counters_do),
        cmocka_unit_test(the_newer_firmware_clears_a_quadrature_error_by_writing_one),
        cmocka_unit_test(a_probe_edge_latches_and_disarms),
        cmocka_unit_test(counts_are_those_of_the_selected_timer_s_last_rise),
        cmocka_unit_test(an_encoder_follows_its_step_generator_with_floor),
        cmocka_unit_test(a_follower_s_time_stamps_give_its_speed),
        cmocka_unit_test(a_follower_rests_while_the_steps_do_not_reach_their_pin),
        cmocka_unit_test(a_follower_rests_before_its_pads_are_driven_and_after_a_bite),
        cmocka_unit_test(a_motor_turns_its_encoder_at_the_speed_of_the_duty_while_it_is_enabled),
        cmocka_unit_test(a_motor_rests_when_its_pin_is_no_output_any_more),
        cmocka_unit_test(the_index_of_a_follower_latches_and_clears_where_it_is),
        cmocka_unit_test(one_look_finds_every_index_on_the_way),
        cmocka_unit_test(a_power_cycle_clears_the_count_and_not_the_axis),
        cmocka_unit_test(following_needs_what_the_card_has),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
