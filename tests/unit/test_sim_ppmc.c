/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The simulated PPMC board against the vendor's register page (seed 004), cycle by cycle, and the rules that ppmc.md
 * section 11.3 adds. */
#include "unit.h"

#include <inttypes.h>
#include <math.h>

#include <hm2/sim_ppmc.h>

#define SLOT 2u
#define BASE 0x20u

static struct sim_ppmc *board_of(const uint8_t id, const struct sim_ppmc_options *const options)
{
    struct sim_ppmc *const bus = sim_ppmc_new(options);
    assert_non_null(bus);
    assert_int_equal(sim_ppmc_add(bus, SLOT, id), 0);
    return bus;
}

static void wait_us(struct sim_ppmc *const bus, const int64_t us)
{
    sim_ppmc_set_time(bus, sim_ppmc_now_ns(bus) + us * 1000);
}

static bool address(struct sim_ppmc *const bus, const unsigned value)
{
    uint8_t byte = (uint8_t)value;
    return sim_ppmc_cycle(bus, EPP_ADDRESS_WRITE, &byte);
}

static bool put(struct sim_ppmc *const bus, const unsigned value)
{
    uint8_t byte = (uint8_t)value;
    return sim_ppmc_cycle(bus, EPP_DATA_WRITE, &byte);
}

static unsigned get(struct sim_ppmc *const bus)
{
    uint8_t byte = 0;
    assert_true(sim_ppmc_cycle(bus, EPP_DATA_READ, &byte));
    return byte;
}

static void put_at(struct sim_ppmc *const bus, const unsigned offset, const unsigned value)
{
    assert_true(address(bus, BASE + offset));
    assert_true(put(bus, value));
}

static unsigned get_at(struct sim_ppmc *const bus, const unsigned offset)
{
    assert_true(address(bus, BASE + offset));
    return get(bus);
}

static void latch(struct sim_ppmc *const bus)
{
    put_at(bus, 4, 0x20);
    put_at(bus, 4, 0x20);
    put_at(bus, 4, 0x00);
}

static void load(struct sim_ppmc *const bus, const uint32_t value, const unsigned axes)
{
    for (unsigned i = 0; i < 3; i++)
        put_at(bus, i, value >> 8 * i & 0xFFu);
    put_at(bus, 3, axes << 4);
    wait_us(bus, 3);
    put_at(bus, 3, 0);
}

/* ---- seed 004, table of addresses: what is read ------------------------------------------------------------------ */

static const struct {
    unsigned offset;
    const char *name;
    unsigned want;
} reads[] = {
    {0, "axis 0 low byte", 0x01},
    {1, "axis 0 mid byte", 0x02},
    {2, "axis 0 hi byte", 0x03},
    {3, "axis 1 low byte", 0x11},
    {4, "axis 1 mid byte", 0x12},
    {5, "axis 1 hi byte", 0x13},
    {6, "axis 2 low byte", 0x21},
    {7, "axis 2 mid byte", 0x22},
    {8, "axis 2 hi byte", 0x23},
    {9, "axis 3 low byte", 0x31},
    {10, "axis 3 mid byte", 0x32},
    {11, "axis 3 hi byte", 0x33},
    {12, "index sense register", 0x00},
    {13, "not used", 0x00},
    {14, "not used", 0x00},
    {15, "module ID code", 0x14},
    {16, "axis 0 timestamp low", 0xE9},
    {17, "axis 0 timestamp high", 0x03},
    {18, "axis 1 timestamp low", 0xD1},
    {19, "axis 1 timestamp high", 0x07},
    {20, "axis 2 timestamp low", 0xB9},
    {21, "axis 2 timestamp high", 0x0B},
    {22, "axis 3 timestamp low", 0xA1},
    {23, "axis 3 timestamp high", 0x0F},
    {24, "timestamp counter low", 0x88},
    {25, "timestamp counter high", 0x13},
};

static void every_register_of_the_seeds_table_reads_what_it_says(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    for (unsigned axis = 0; axis < 4; axis++) {
        sim_ppmc_set_time(bus, 1000000 * (axis + 1));
        sim_ppmc_jump(bus, SLOT, axis, 1); /* counted 1 us later, at the slowest filter rate */
    }
    sim_ppmc_set_time(bus, 4900000);
    for (unsigned axis = 0; axis < 4; axis++)
        sim_ppmc_set_counter(bus, SLOT, axis, 0x030201u + 0x101010u * axis);
    sim_ppmc_set_time(bus, 4997000);
    latch(bus); /* its first 0x20 is seen at 5000 us */
    for (size_t i = 0; i < sizeof reads / sizeof reads[0]; i++)
        if (get_at(bus, reads[i].offset) != reads[i].want)
            fail_msg("%s reads 0x%02X, wanted 0x%02X", reads[i].name, get_at(bus, reads[i].offset), reads[i].want);
    sim_ppmc_free(bus);
}

/* ---- what is written ----------------------------------------------------------------------------------------------
 */

#define FIELD(member) offsetof(struct sim_ppmc_registers, member)

static const struct {
    unsigned offset;
    const char *name;
    size_t field;
    bool wide;
    uint32_t written, want;
} writes[] = {
    {0, "assembly register low byte", FIELD(assembly), true, 0xA5, 0x0000A5},
    {1, "assembly register mid byte", FIELD(assembly), true, 0xB6, 0x00B600},
    {2, "assembly register hi byte", FIELD(assembly), true, 0xC7, 0xC70000},
    {3, "control register", FIELD(control), false, 0xF0, 0xF0},
    {4, "timer config register", FIELD(timer), false, 0x3F, 0x3F},
    {5, "encoder filter rate select", FIELD(filter), false, 0xFE, 0x02},
    {13, "index preset register", FIELD(preset), false, 0xF9, 0x09},
};

static void every_register_of_the_seeds_table_takes_what_it_says(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof writes / sizeof writes[0]; i++) {
        struct sim_ppmc *const bus = board_of(0x14, NULL);
        put_at(bus, writes[i].offset, writes[i].written);
        const struct sim_ppmc_registers all = sim_ppmc_registers(bus, SLOT);
        const uint8_t *const at = (const uint8_t *)&all + writes[i].field;
        uint32_t found = *at;
        if (writes[i].wide)
            memcpy(&found, at, sizeof found);
        if (found != writes[i].want)
            fail_msg("%s is 0x%X, wanted 0x%X", writes[i].name, found, writes[i].want);
        sim_ppmc_free(bus);
    }
}

static void offsets_without_a_register_take_nothing(void **state)
{
    (void)state;
    static const unsigned unused[] = {6, 7, 8, 9, 10, 11, 12, 14, 15, 16, 30};
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    const struct sim_ppmc_registers none = {0};
    for (size_t i = 0; i < sizeof unused / sizeof unused[0]; i++)
        put_at(bus, unused[i], 0xFF);
    const struct sim_ppmc_registers all = sim_ppmc_registers(bus, SLOT);
    assert_memory_equal(&all, &none, sizeof all);
    assert_int_equal(sim_ppmc_stats(bus).undocumented, sizeof unused / sizeof unused[0]);
    sim_ppmc_free(bus);
}

/* seed 004, "Control Register Bits" */
static const struct {
    unsigned bits, loaded;
} control_bits[] = {{0x10, 0x1}, {0x20, 0x2}, {0x40, 0x4}, {0x80, 0x8}, {0xF0, 0xF}, {0x0F, 0x0}};

static void each_load_bit_loads_its_axis(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof control_bits / sizeof control_bits[0]; i++) {
        struct sim_ppmc *const bus = board_of(0x14, NULL);
        put_at(bus, 0, 0x56);
        put_at(bus, 1, 0x34);
        put_at(bus, 2, 0x12);
        put_at(bus, 3, control_bits[i].bits);
        wait_us(bus, 2);
        put_at(bus, 3, 0);
        for (unsigned axis = 0; axis < 4; axis++)
            assert_int_equal(sim_ppmc_truth(bus, SLOT, axis).counter,
                             control_bits[i].loaded >> axis & 1u ? 0x123456 : 0);
        sim_ppmc_free(bus);
    }
}

static void a_strict_board_needs_its_load_bits_for_2_us(void **state)
{
    (void)state;
    const struct sim_ppmc_options strict = {.strict = true, .cycle_ns = 100};
    struct sim_ppmc *const bus = board_of(0x14, &strict);
    put_at(bus, 0, 0x56);
    put_at(bus, 3, 0x10);
    wait_us(bus, 1);
    put_at(bus, 3, 0);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 0).counter, 0);
    put_at(bus, 3, 0x10);
    wait_us(bus, 3);
    put_at(bus, 3, 0);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 0).counter, 0x56);
    sim_ppmc_free(bus);
}

/* seed 004, "Timer Register Bits": none, none, soft latch, master, tim3 to tim0. No document tells which rates the
 * latter stand for, so here they stand for those that the options say, and by default for none. */
static const struct {
    const char *name;
    unsigned bits;
    uint64_t latches;
} timer_bits[] = {{"nothing", 0x00, 0}, {"no function", 0xC0, 0}, {"soft latch", 0x20, 1},
                  {"rates", 0x0F, 0},   {"master", 0x1A, 10},     {"all", 0xFF, 1}};

static void each_bit_of_the_timer_register_does_what_it_says(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof timer_bits / sizeof timer_bits[0]; i++) {
        struct sim_ppmc_options options = {.master_ns = {[0xA] = 100000}};
        struct sim_ppmc *const bus = board_of(0x14, &options);
        sim_ppmc_set_rate(bus, SLOT, 2, 100000);
        wait_us(bus, 95);
        put_at(bus, 4, timer_bits[i].bits);
        wait_us(bus, 1050);
        const struct sim_ppmc_truth truth = sim_ppmc_truth(bus, SLOT, 2);
        if (sim_ppmc_stats(bus).latches != timer_bits[i].latches || (truth.holding > 0) != (timer_bits[i].latches > 0))
            fail_msg("%s: %" PRIu64 " latch pulses, holding %u", timer_bits[i].name, sim_ppmc_stats(bus).latches,
                     truth.holding);
        sim_ppmc_free(bus);
    }
}

static void a_masters_pulses_reach_all_boards_at_the_rate_that_it_is_set_to(void **state)
{
    (void)state;
    for (unsigned rate = 0; rate < 16; rate++) {
        struct sim_ppmc_options options = {0};
        for (unsigned i = 0; i < 16; i++)
            options.master_ns[i] = 10000 * (i + 1);
        struct sim_ppmc *const bus = board_of(0x14, &options);
        assert_int_equal(sim_ppmc_add(bus, 6, 0x14), 0);
        sim_ppmc_set_rate(bus, 6, 1, 1000000); /* the counter is the time in us */
        put_at(bus, 4, 0x10 | rate);
        const int64_t start_us = sim_ppmc_now_ns(bus) / 1000;
        wait_us(bus, 100000);
        const int64_t pulses = 100000 / (10 * (rate + 1));
        const uint32_t holding = sim_ppmc_truth(bus, 6, 1).holding;
        assert_int_equal(sim_ppmc_stats(bus).latches, 2 * pulses);
        assert_in_range(holding, start_us + pulses * 10 * (rate + 1) - 2, start_us + pulses * 10 * (rate + 1));
        sim_ppmc_free(bus);
    }
}

/* seed 004, "Index Preset Register Bits" and "Index Sense Register Bits" */
static void an_index_sets_its_sense_bit_and_presets_where_asked(void **state)
{
    (void)state;
    for (unsigned axis = 0; axis < 4; axis++) {
        struct sim_ppmc *const bus = board_of(0x14, NULL);
        sim_ppmc_set_index(bus, SLOT, axis, 1000, 100, 2);
        put_at(bus, 13, 1u << axis);
        sim_ppmc_set_rate(bus, SLOT, axis, 100000);
        wait_us(bus, 1500); /* 150 edges, of which 149 or 150 have passed */
        assert_int_equal(get_at(bus, 12), 1u << axis);
        assert_int_equal(get_at(bus, 12), 0); /* the read has cleared it */
        const struct sim_ppmc_truth truth = sim_ppmc_truth(bus, SLOT, axis);
        assert_int_equal(truth.presets, 1);
        assert_int_equal(truth.preset_at, 100);
        assert_int_equal(truth.counter, truth.counted - 100);
        sim_ppmc_free(bus);
    }
}

/* seed 004, "Encoder Filter Rate Select Bits": states shorter than the inverse of the rate are suppressed. */
static const struct {
    unsigned code;
    int32_t limit_hz;
} rates[] = {{0, 1000000}, {1, 2500000}, {2, 5000000}, {3, 10000000}};

static void each_filter_rate_counts_up_to_its_limit_and_nothing_beyond(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof rates / sizeof rates[0]; i++)
        for (int direction = -1; direction <= 1; direction += 2) {
            struct sim_ppmc *const bus = board_of(0x14, NULL);
            put_at(bus, 5, rates[i].code);
            sim_ppmc_set_rate(bus, SLOT, 0, direction * rates[i].limit_hz);
            wait_us(bus, 1000);
            sim_ppmc_set_rate(bus, SLOT, 0, 0);
            wait_us(bus, 10);
            struct sim_ppmc_truth truth = sim_ppmc_truth(bus, SLOT, 0);
            assert_int_equal(truth.counted, truth.shaft);
            assert_int_equal(truth.counter, (uint32_t)truth.shaft & 0xFFFFFF);
            assert_true(truth.shaft * direction >= rates[i].limit_hz / 1000);
            const int64_t before = truth.counted;
            sim_ppmc_set_rate(bus, SLOT, 0, direction * (rates[i].limit_hz + rates[i].limit_hz / 50));
            wait_us(bus, 1000);
            truth = sim_ppmc_truth(bus, SLOT, 0);
            assert_true((truth.counted - before) * direction <= 1);
            sim_ppmc_free(bus);
        }
}

static void a_glitch_shorter_than_the_filter_is_no_count(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    for (unsigned i = 0; i < 100; i++) {
        sim_ppmc_jump(bus, SLOT, 1, 1);
        sim_ppmc_set_time(bus, sim_ppmc_now_ns(bus) + 900);
        sim_ppmc_jump(bus, SLOT, 1, -1);
        wait_us(bus, 5);
    }
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 1).counted, 0);
    sim_ppmc_jump(bus, SLOT, 1, 2);
    wait_us(bus, 5);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 1).counted, 0);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 1).illegal, 1);
    sim_ppmc_free(bus);
}

/* What is computed for a stretch of time must be what single edges give. */
static void steady_motion_counts_as_single_edges_do(void **state)
{
    (void)state;
    static const int32_t speeds[] = {1, 999, 123457, 333333, 999999, 1000000, 1010000, 7000000};
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++) {
        struct sim_ppmc *const whole = board_of(0x14, NULL), *const single = board_of(0x14, NULL);
        sim_ppmc_set_index(whole, SLOT, 0, 50, 7, 3);
        sim_ppmc_set_index(single, SLOT, 0, 50, 7, 3);
        const int64_t start_ns = sim_ppmc_now_ns(whole);
        sim_ppmc_set_rate(whole, SLOT, 0, speeds[i]);
        sim_ppmc_set_rate(single, SLOT, 0, speeds[i]);
        for (int64_t ns = 0; ns <= 3000000; ns += 50) {
            sim_ppmc_set_time(single, start_ns + ns);
            (void)sim_ppmc_truth(single, SLOT, 0);
            if (ns == 1500000) { /* and back */
                sim_ppmc_set_time(whole, start_ns + ns);
                sim_ppmc_set_rate(whole, SLOT, 0, -speeds[i]);
                sim_ppmc_set_rate(single, SLOT, 0, -speeds[i]);
            }
        }
        sim_ppmc_set_time(whole, sim_ppmc_now_ns(single));
        const struct sim_ppmc_truth a = sim_ppmc_truth(whole, SLOT, 0), b = sim_ppmc_truth(single, SLOT, 0);
        if (a.shaft != b.shaft || a.counted != b.counted)
            fail_msg("%d edges/s: %" PRId64 " of %" PRId64 " edges at once, %" PRId64 " of %" PRId64 " one by one",
                     (int)speeds[i], a.counted, a.shaft, b.counted, b.shaft);
        assert_int_equal(a.indices, b.indices);
        assert_int_equal(a.counter, b.counter);
        sim_ppmc_free(whole);
        sim_ppmc_free(single);
    }
}

static int64_t swing(void *const context, const int64_t now_ns)
{
    const int64_t *const way = context;
    return (int64_t)((double)*way * sin((double)now_ns * 1e-6)); /* of 6.3 ms */
}

static void a_shaft_that_follows_something_is_counted_where_that_is(void **state)
{
    (void)state;
    int64_t way = 500; /* at most 500000 edges a second */
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    sim_ppmc_follow(bus, SLOT, 1, swing, &way);
    for (unsigned i = 0; i < 2000; i++) {
        wait_us(bus, 50);
        const int64_t at = swing(&way, sim_ppmc_now_ns(bus));
        const struct sim_ppmc_truth truth = sim_ppmc_truth(bus, SLOT, 1);
        assert_int_equal(truth.shaft, at);
        assert_in_range(truth.counted - at + 10, 9, 11); /* the last edge waits in the filter */
    }
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 1).illegal, 0);
    sim_ppmc_set_rate(bus, SLOT, 1, 0); /* it is let go */
    way = 0;
    wait_us(bus, 50);
    assert_true(sim_ppmc_truth(bus, SLOT, 1).shaft != 0);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 1).counted, sim_ppmc_truth(bus, SLOT, 1).shaft);
    sim_ppmc_free(bus);
}

static void a_broken_wire_counts_to_and_fro(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    sim_ppmc_break_wire(bus, SLOT, 0, true);
    sim_ppmc_set_rate(bus, SLOT, 0, 100000);
    wait_us(bus, 10000);
    assert_in_range(sim_ppmc_truth(bus, SLOT, 0).shaft, 999, 1001);
    assert_in_range(sim_ppmc_truth(bus, SLOT, 0).counted + 1, 0, 2);
    sim_ppmc_break_wire(bus, SLOT, 0, false);
    wait_us(bus, 10000);
    assert_in_range(sim_ppmc_truth(bus, SLOT, 0).counted, 998, 1002);
    sim_ppmc_free(bus);
}

/* ppmc.md section 11.3, rules 5, 17 and 18: what no document tells, each way. */
static void an_unanswered_read_leaves_what_the_options_say(void **state)
{
    (void)state;
    static const unsigned wanted[] = {[SIM_PPMC_RESIDUE] = 0x60, [SIM_PPMC_ONES] = 0xFF, [SIM_PPMC_ZEROS] = 0x00};
    for (unsigned how = SIM_PPMC_RESIDUE; how <= SIM_PPMC_ZEROS; how++) {
        const struct sim_ppmc_options options = {.unanswered = (enum sim_ppmc_unanswered)how};
        struct sim_ppmc *const bus = board_of(0x14, &options);
        uint8_t byte = 0x55;
        assert_true(address(bus, 0x60));
        assert_false(sim_ppmc_cycle(bus, EPP_DATA_READ, &byte));
        assert_int_equal(byte, wanted[how]);
        sim_ppmc_free(bus);
    }
}

static void behind_the_last_register_the_address_goes_round_or_runs_on(void **state)
{
    (void)state;
    for (unsigned runs_on = 0; runs_on < 2; runs_on++) {
        const struct sim_ppmc_options options = {.runs_on = runs_on != 0};
        struct sim_ppmc *const bus = board_of(0x14, &options);
        uint8_t byte = 0;
        assert_true(address(bus, BASE + 31));
        (void)get(bus);
        assert_true(sim_ppmc_cycle(bus, EPP_DATA_READ, &byte) != (runs_on != 0)); /* nobody is behind it */
        assert_int_equal(sim_ppmc_stats(bus).undocumented, 1);
        sim_ppmc_free(bus);
    }
}

static void the_high_byte_of_a_timestamp_is_held_when_the_low_one_is_read_or_not(void **state)
{
    (void)state;
    for (unsigned tears = 0; tears < 2; tears++) {
        const struct sim_ppmc_options options = {.timestamps_live = true, .timestamps_tear = tears != 0};
        struct sim_ppmc *const bus = board_of(0x14, &options);
        sim_ppmc_set_time(bus, 253000); /* two cycles later it is 0x00FF, and 0x0100 with the next */
        assert_int_equal(get_at(bus, 24), 0xFF);
        assert_int_equal(get(bus), tears);
        sim_ppmc_free(bus);
    }
}

/* ppmc.md sections 3.3 and 11.3, rules 6 and 13: the lines of a port's control register, and its mode. */
static void a_port_reaches_the_boards_only_with_all_strobes_released_in_epp_mode(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint8_t control, ecr;
        bool answers, resets;
    } rows[] = {{"all released", 0x04, 0x80, true, false},    {"direction commanded", 0x24, 0x80, true, false},
                {"nStrobe held", 0x05, 0x80, false, false},   {"nAutoFd held", 0x06, 0x80, false, false},
                {"nSelectIn held", 0x0C, 0x80, false, false}, {"SPP mode", 0x04, 0x00, false, false},
                {"byte mode", 0x04, 0x20, false, false},      {"nInit low", 0x00, 0x80, false, true}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sim_ppmc *const bus = board_of(0x14, NULL);
        put_at(bus, 13, 0x0F);
        sim_ppmc_port_out(bus, 0x402, rows[i].ecr);
        sim_ppmc_port_out(bus, 2, rows[i].control);
        sim_ppmc_port_out(bus, 3, BASE + 15);
        const uint8_t byte = sim_ppmc_port_in(bus, 4);
        const bool timeout = sim_ppmc_port_in(bus, 1) & 1u;
        if (timeout == rows[i].answers || (rows[i].answers && byte != 0x14) ||
            (sim_ppmc_registers(bus, SLOT).preset == 0) != rows[i].resets)
            fail_msg("%s: read 0x%02X, time-out %d", rows[i].name, byte, timeout);
        sim_ppmc_free(bus);
    }
}

/* ppmc.md section 5: set-up opens the load path first, and then writes the bytes. */
static void a_counter_follows_the_assembly_register_while_its_load_bit_is_on(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    sim_ppmc_set_counter(bus, SLOT, 3, 0x777777);
    put_at(bus, 3, 0x80);
    put_at(bus, 0, 0x0A);
    put_at(bus, 1, 0x0B);
    put_at(bus, 2, 0x0C);
    wait_us(bus, 2);
    put_at(bus, 3, 0);
    put_at(bus, 0, 0xFF);
    wait_us(bus, 2);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 3).counter, 0x0C0B0A);
    sim_ppmc_free(bus);
}

/* seed 004, "DIP switch paragraphs", and the vector of ppmc.md section 11.8. */
static void a_board_answers_at_its_two_slots_and_nowhere_else(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    for (unsigned slot = 0; slot < 16; slot++) {
        uint8_t byte = 0;
        assert_true(address(bus, slot * 16 + 15));
        const bool answered = sim_ppmc_cycle(bus, EPP_DATA_READ, &byte);
        assert_int_equal(answered, slot == SLOT || slot == SLOT + 1);
        if (!answered)
            assert_int_equal(byte, slot * 16 + 15); /* left on the bus by the address cycle */
    }
    assert_int_equal(sim_ppmc_stats(bus).unanswered, 14);
    assert_int_equal(sim_ppmc_add(bus, 3, 0x14), HM2_ERR_RANGE);
    assert_int_equal(sim_ppmc_add(bus, 3, 0x11), HM2_ERR_STATE);
    assert_int_equal(sim_ppmc_add(bus, 4, 0x11), 0);
    assert_int_equal(sim_ppmc_add(bus, 16, 0x14), HM2_ERR_RANGE);
    sim_ppmc_free(bus);
}

/* seed 004, "DIP switch at SW1": switch 4 counts most, on is 0 and off is 1, and the newer boards take two units. */
static const struct {
    const char *switches; /* 4, 3, 2, 1 */
    uint8_t id;
    int err;
    unsigned first, last;
} switches[] = {
    {"1111", 0x12, 0, 0x00, 0x0F},       {"1110", 0x12, 0, 0x10, 0x1F}, {"1101", 0x12, 0, 0x20, 0x2F},
    {"1011", 0x12, 0, 0x40, 0x4F},       {"0111", 0x12, 0, 0x80, 0x8F}, {"0000", 0x12, 0, 0xF0, 0xFF},
    {"1111", 0x14, 0, 0x00, 0x1F},       {"1101", 0x14, 0, 0x20, 0x3F}, {"1011", 0x14, 0, 0x40, 0x5F},
    {"0111", 0x14, 0, 0x80, 0x9F},       {"0001", 0x14, 0, 0xE0, 0xFF}, {"1110", 0x14, HM2_ERR_RANGE, 0, 0},
    {"0000", 0x14, HM2_ERR_RANGE, 0, 0},
};

static void the_address_switches_choose_the_range(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof switches / sizeof switches[0]; i++) {
        struct sim_ppmc *const bus = sim_ppmc_new(NULL);
        unsigned slot = 0;
        for (unsigned k = 0; k < 4; k++) /* on is 1 in the table, and 0 on the board */
            slot = slot << 1 | (switches[i].switches[k] == '0');
        assert_int_equal(sim_ppmc_add(bus, slot, switches[i].id), switches[i].err);
        for (unsigned at = 0; at < 0x100 && switches[i].err == 0; at++) {
            uint8_t byte = 0;
            assert_true(address(bus, at));
            const bool answers = sim_ppmc_cycle(bus, EPP_DATA_READ, &byte);
            if (answers != (at >= switches[i].first && at <= switches[i].last))
                fail_msg("switches %s, ID 0x%02X: address 0x%02X %s", switches[i].switches, switches[i].id, at,
                         answers ? "answers" : "does not answer");
        }
        sim_ppmc_free(bus);
    }
}

static void the_address_counts_on_after_every_data_byte(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    assert_true(address(bus, BASE));
    assert_true(put(bus, 0x11) && put(bus, 0x22) && put(bus, 0x33));
    assert_int_equal(sim_ppmc_registers(bus, SLOT).assembly, 0x332211);
    load(bus, 0x332211, 0xF);
    latch(bus);
    assert_true(address(bus, BASE));
    for (unsigned i = 0; i < 12; i++)
        assert_int_equal(get(bus), 0x11 * (i % 3 + 1));
    assert_int_equal(get(bus), 0);
    (void)get(bus);
    (void)get(bus);
    assert_int_equal(get(bus), 0x14);
    sim_ppmc_free(bus);
}

static void the_counter_wraps_without_a_flag(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    sim_ppmc_set_counter(bus, SLOT, 0, 0x7FFFFF);
    sim_ppmc_jump(bus, SLOT, 0, 1);
    sim_ppmc_set_counter(bus, SLOT, 1, 0);
    sim_ppmc_jump(bus, SLOT, 1, -1);
    wait_us(bus, 2);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 0).counter, 0x800000);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 1).counter, 0xFFFFFF);
    sim_ppmc_free(bus);
}

static void one_boards_soft_latch_latches_all_boards_once(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    assert_int_equal(sim_ppmc_add(bus, 6, 0x14), 0);
    sim_ppmc_set_rate(bus, 6, 3, 50000);
    wait_us(bus, 1000);
    latch(bus);
    const struct sim_ppmc_truth truth = sim_ppmc_truth(bus, 6, 3);
    assert_in_range(truth.holding, 49, 50);
    wait_us(bus, 5); /* the low line must be seen, too */
    assert_int_equal(sim_ppmc_truth(bus, 6, 3).holding, truth.holding);
    assert_int_equal(sim_ppmc_stats(bus).latches, 2);
    put_at(bus, 4, 0x20);
    wait_us(bus, 100);
    put_at(bus, 4, 0x20); /* no 0 between: no pulse */
    wait_us(bus, 100);
    (void)sim_ppmc_truth(bus, SLOT, 0); /* a board lives when it is looked at */
    (void)sim_ppmc_truth(bus, 6, 0);
    assert_int_equal(sim_ppmc_stats(bus).latches, 4);
    sim_ppmc_free(bus);
}

static void an_old_board_has_one_slot_and_latches_by_its_index(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x11, NULL);
    uint8_t byte;
    assert_true(address(bus, BASE + 16));
    assert_false(sim_ppmc_cycle(bus, EPP_DATA_READ, &byte));
    put_at(bus, 5, 3); /* there is no such register */
    put_at(bus, 13, 0xF);
    assert_int_equal(sim_ppmc_registers(bus, SLOT).filter, 0);
    assert_int_equal(sim_ppmc_registers(bus, SLOT).preset, 0);
    sim_ppmc_set_index(bus, SLOT, 0, 1000, 40, 1);
    put_at(bus, 3, 0x01);
    sim_ppmc_set_rate(bus, SLOT, 0, 100000);
    wait_us(bus, 1000);
    latch(bus);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 0).holding, 40);
    sim_ppmc_free(bus);
}

static void power_loss_and_reset_bring_back_reset_values(void **state)
{
    (void)state;
    struct sim_ppmc *const bus = board_of(0x14, NULL);
    uint8_t byte;
    put_at(bus, 5, 3);
    load(bus, 1234, 1);
    sim_ppmc_power(bus, SLOT, false);
    assert_false(address(bus, BASE)); /* nobody on the bus has power */
    sim_ppmc_power(bus, SLOT, true);
    assert_true(address(bus, BASE + 15));
    assert_true(sim_ppmc_cycle(bus, EPP_DATA_READ, &byte));
    assert_int_equal(sim_ppmc_registers(bus, SLOT).filter, 0);
    assert_int_equal(sim_ppmc_truth(bus, SLOT, 0).counter, 0);
    put_at(bus, 13, 5);
    sim_ppmc_reset(bus);
    assert_int_equal(sim_ppmc_registers(bus, SLOT).preset, 0);
    sim_ppmc_free(bus);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_register_of_the_seeds_table_reads_what_it_says),
        cmocka_unit_test(every_register_of_the_seeds_table_takes_what_it_says),
        cmocka_unit_test(offsets_without_a_register_take_nothing),
        cmocka_unit_test(each_load_bit_loads_its_axis),
        cmocka_unit_test(a_strict_board_needs_its_load_bits_for_2_us),
        cmocka_unit_test(each_bit_of_the_timer_register_does_what_it_says),
        cmocka_unit_test(a_masters_pulses_reach_all_boards_at_the_rate_that_it_is_set_to),
        cmocka_unit_test(an_index_sets_its_sense_bit_and_presets_where_asked),
        cmocka_unit_test(each_filter_rate_counts_up_to_its_limit_and_nothing_beyond),
        cmocka_unit_test(a_glitch_shorter_than_the_filter_is_no_count),
        cmocka_unit_test(steady_motion_counts_as_single_edges_do),
        cmocka_unit_test(a_shaft_that_follows_something_is_counted_where_that_is),
        cmocka_unit_test(a_broken_wire_counts_to_and_fro),
        cmocka_unit_test(an_unanswered_read_leaves_what_the_options_say),
        cmocka_unit_test(behind_the_last_register_the_address_goes_round_or_runs_on),
        cmocka_unit_test(the_high_byte_of_a_timestamp_is_held_when_the_low_one_is_read_or_not),
        cmocka_unit_test(a_counter_follows_the_assembly_register_while_its_load_bit_is_on),
        cmocka_unit_test(a_port_reaches_the_boards_only_with_all_strobes_released_in_epp_mode),
        cmocka_unit_test(a_board_answers_at_its_two_slots_and_nowhere_else),
        cmocka_unit_test(the_address_switches_choose_the_range),
        cmocka_unit_test(the_address_counts_on_after_every_data_byte),
        cmocka_unit_test(the_counter_wraps_without_a_flag),
        cmocka_unit_test(one_boards_soft_latch_latches_all_boards_once),
        cmocka_unit_test(an_old_board_has_one_slot_and_latches_by_its_index),
        cmocka_unit_test(power_loss_and_reset_bring_back_reset_values),
    };
    return cmocka_run_group_tests_name("simulated PPMC", tests, NULL, NULL);
}
