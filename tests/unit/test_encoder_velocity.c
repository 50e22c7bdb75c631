/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Velocity of the encoders: the state machine of hal-interface 2.8, with edges at known times. */
#include <math.h>

#include "encoder_card.h"
#include "module_types.h"
#include "unit.h"

#define TICK_S       0.5e-6
#define PERIOD_TICKS 2000

#define assert_near(a, b, tolerance) assert_true(fabs((a) - (b)) <= (tolerance))

static double get(const struct encoder_card *const card, const char *const suffix)
{
    char name[64];
    (void)snprintf(name, sizeof name, "encoder.00.%s", suffix);
    return rig_get(card->rig, name);
}

static void set(const struct encoder_card *const card, const char *const suffix, const double value)
{
    char name[64];
    (void)snprintf(name, sizeof name, "encoder.00.%s", suffix);
    rig_set(card->rig, name, value);
}

/* Loaded, and the time stamps are trusted. */
static struct encoder_card open_card(void)
{
    struct encoder_card card = encoder_card_open(rig_image_7i96s(), "", &hm2_encoder_type);
    for (unsigned i = 0; i < 3; i++) {
        encoder_card_move(&card, PERIOD_TICKS, 0);
        encoder_card_cycle(&card);
    }
    return card;
}

/* A steady turn: edges every edge_ticks, and a cycle every cycle_ticks. */
struct turn {
    int64_t edge_ticks, cycle_ticks, since_edge;
    int direction;
};

static void turn_for(struct encoder_card *const card, struct turn *const turn, const unsigned cycles)
{
    for (unsigned c = 0; c < cycles; c++) {
        int64_t left = turn->cycle_ticks;
        while (left >= turn->edge_ticks - turn->since_edge) {
            const int64_t until = turn->edge_ticks - turn->since_edge;
            encoder_card_move(card, until, turn->direction);
            left -= until;
            turn->since_edge = 0;
        }
        encoder_card_move(card, left, 0);
        turn->since_edge += left;
        encoder_card_cycle(card);
    }
}

static void a_steady_speed_is_exact(void **state)
{
    (void)state;
    static const int64_t spacings[] = {3, 7, 100, 1999, 2000, 2001, 5000, 30000, 65535, 65536, 65537, 200000, 900000};
    for (size_t i = 0; i < sizeof spacings / sizeof spacings[0]; i++)
        for (int direction = -1; direction <= 1; direction += 2) {
            struct encoder_card card = open_card();
            struct turn turn = {spacings[i], PERIOD_TICKS, 0, direction};
            set(&card, "scale", 400);
            turn_for(&card, &turn, (unsigned)(3 * spacings[i] / PERIOD_TICKS) + 10);
            const double expected = direction / (400 * (double)spacings[i] * TICK_S);
            assert_near(get(&card, "velocity"), expected, fabs(expected) * 1e-9);
            assert_near(get(&card, "velocity-rpm"), 60 * expected, fabs(expected) * 1e-7);
            rig_free(card.rig);
        }
}

static void the_first_edge_gives_no_velocity_yet(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    encoder_card_move(&card, PERIOD_TICKS, 1);
    encoder_card_cycle(&card);
    assert_true(get(&card, "velocity") == 0.0);
    encoder_card_move(&card, PERIOD_TICKS, 1);
    encoder_card_cycle(&card);
    assert_near(get(&card, "velocity"), 1000, 1e-9);
    rig_free(card.rig);
}

static void without_edges_the_velocity_falls_as_one_count_a_time(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    struct turn turn = {100, PERIOD_TICKS, 0, -1};
    set(&card, "scale", 10);
    set(&card, "vel-timeout", 0.02);
    turn_for(&card, &turn, 10);
    assert_near(get(&card, "velocity"), -2000, 1e-6);
    const double position = get(&card, "position");
    for (int i = 1; i < 25; i++) {
        encoder_card_move(&card, PERIOD_TICKS, 0);
        encoder_card_cycle(&card);
        const double expected = i < 20 ? -0.1 / (i * 1e-3) : 0.0;
        assert_near(get(&card, "velocity"), expected, 1e-9);
        assert_near(get(&card, "position-interpolated"), position + (i < 20 ? -0.1 : 0.0), 1e-9);
        assert_true(get(&card, "position") == position);
    }
    rig_free(card.rig);
}

static void the_interpolated_position_runs_between_edges(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    struct turn turn = {20000, PERIOD_TICKS, 0, 1};
    turn_for(&card, &turn, 41);
    for (int i = 0; i < 30; i++) {
        turn_for(&card, &turn, 1);
        const double truth = (double)card.count + (double)turn.since_edge / 20000;
        assert_near(get(&card, "position-interpolated"), truth, 1e-9);
    }
    rig_free(card.rig);
}

static void vibration_on_one_edge_is_no_velocity(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    int direction = 1;
    for (int i = 0; i < 20; i++) {
        encoder_card_move(&card, PERIOD_TICKS, direction);
        encoder_card_cycle(&card);
        if (i > 1)
            assert_true(get(&card, "velocity") == 0.0);
        direction = -direction;
    }
    encoder_card_move(&card, PERIOD_TICKS, direction * 2);
    encoder_card_cycle(&card);
    assert_near(fabs(get(&card, "velocity")), 2000, 1e-6);
    rig_free(card.rig);
}

static void the_first_count_back_is_no_velocity(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    static const int moves[] = {4, 4, -1, -1, 1};
    static const double velocities[] = {0, 4000, 0, -1000, 0};
    for (size_t i = 0; i < sizeof moves / sizeof moves[0]; i++) {
        encoder_card_move(&card, PERIOD_TICKS, moves[i]);
        encoder_card_cycle(&card);
        if (i > 0)
            assert_near(get(&card, "velocity"), velocities[i], 1e-6);
    }
    rig_free(card.rig);
}

static void lost_cycles_do_not_spoil_the_velocity(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    struct turn turn = {777, PERIOD_TICKS, 0, 1};
    const double expected = 1 / (777 * TICK_S);
    turn_for(&card, &turn, 10);
    for (unsigned lost = 1; lost < 100; lost += 7) {
        /* Nothing arrives for `lost` periods, up to three turns of the stamp counter. */
        card.rig->cycle.now_ns += (int64_t)lost * card.rig->cycle.period_ns;
        turn.cycle_ticks = (int64_t)(lost + 1) * PERIOD_TICKS;
        turn_for(&card, &turn, 1);
        assert_near(get(&card, "velocity"), expected, expected * 1e-9);
        turn.cycle_ticks = PERIOD_TICKS;
        turn_for(&card, &turn, 3);
        assert_near(get(&card, "velocity"), expected, expected * 1e-9);
    }
    rig_free(card.rig);
}

static void a_slow_thread_with_fine_stamps_is_right(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    rig_set_period(card.rig, 5000000); /* the 10 MHz stamps go round in 6.5 ms */
    rig_set(card.rig, "encoder.hires-timestamp", 1);
    for (unsigned i = 0; i < 3; i++)
        encoder_card_cycle(&card);
    assert_int_equal(rig_written(card.rig, 0x3200), 8);
    struct turn turn = {123457, 50000, 0, 1};
    turn_for(&card, &turn, 20);
    assert_near(get(&card, "velocity"), 1 / (123457 * 1e-7), 1e-6);
    rig_free(card.rig);
}

static void an_edge_just_after_the_stamp_counter_was_read_is_in_order(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    struct turn turn = {1000, PERIOD_TICKS, 0, 1};
    turn_for(&card, &turn, 10);
    for (int i = 0; i < 200; i++) {
        /* An edge comes 10 ticks after the counter was read, and is read with it. */
        turn.since_edge = 990;
        const int64_t ticks = card.ticks += PERIOD_TICKS - 10;
        card.count += i % 2 ? 2 : 4;
        card.edge_ticks = ticks + 10;
        encoder_card_cycle(&card);
        card.ticks += 10;
        assert_near(get(&card, "velocity"), i % 2 ? 2000 : 4000, 1e-6);
    }
    rig_free(card.rig);
}

static void a_change_of_the_stamps_makes_no_spike(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    struct turn turn = {1000, PERIOD_TICKS, 300, 1}; /* the last edge is older than the last reading */
    turn_for(&card, &turn, 10);
    for (int i = 0; i < 10; i++) {
        rig_set(card.rig, "encoder.hires-timestamp", i % 2 == 0);
        for (int k = 0; k < 10; k++) {
            const int64_t cycle_ticks = rig_written(card.rig, 0x3200) == 8 ? 10000 : 2000;
            turn.since_edge = turn.since_edge * cycle_ticks / turn.cycle_ticks;
            turn.cycle_ticks = cycle_ticks;
            turn.edge_ticks = cycle_ticks / 2;
            turn_for(&card, &turn, 1);
            assert_near(get(&card, "velocity"), 2000, 1e-6);
        }
    }
    rig_free(card.rig);
}

static void a_stamp_from_long_ago_makes_no_spike_when_a_search_begins(void **state)
{
    (void)state;
    struct encoder_card card = open_card();
    card.edge_ticks = card.ticks + 2 * PERIOD_TICKS + 1500 - 65536; /* its 16 bits look younger than the clock */
    rig_set(card.rig, "encoder.00.index-enable", 1);
    for (int i = 0; i < 2; i++) {
        encoder_card_move(&card, PERIOD_TICKS, 0);
        encoder_card_cycle(&card);
    }
    encoder_card_move(&card, PERIOD_TICKS, 1);
    encoder_card_cycle(&card);
    assert_true(get(&card, "velocity") > 0.0 && get(&card, "velocity") < 1001.0);
    rig_free(card.rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_steady_speed_is_exact),
        cmocka_unit_test(the_first_edge_gives_no_velocity_yet),
        cmocka_unit_test(without_edges_the_velocity_falls_as_one_count_a_time),
        cmocka_unit_test(the_interpolated_position_runs_between_edges),
        cmocka_unit_test(vibration_on_one_edge_is_no_velocity),
        cmocka_unit_test(the_first_count_back_is_no_velocity),
        cmocka_unit_test(lost_cycles_do_not_spoil_the_velocity),
        cmocka_unit_test(a_slow_thread_with_fine_stamps_is_right),
        cmocka_unit_test(an_edge_just_after_the_stamp_counter_was_read_is_in_order),
        cmocka_unit_test(a_change_of_the_stamps_makes_no_spike),
        cmocka_unit_test(a_stamp_from_long_ago_makes_no_spike_when_a_search_begins),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
