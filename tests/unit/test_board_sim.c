/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A board with every module of the library, on a simulated 7I96S. */
#include "servo_rig.h"

#include <hm2/lbp16.h>

/* ---- who allocates? -----------------------------------------------------------------------------------------------
 */

static unsigned long allocations;

/* glibc's own functions stand behind ours; a sanitizer brings its allocator itself and is left alone. */
#if defined __GLIBC__ && !defined __SANITIZE_ADDRESS__ && !defined __SANITIZE_THREAD__ && !defined __clang__
#define COUNTS_ALLOCATIONS 1
extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *memory, size_t size);

void *malloc(const size_t size)
{
    allocations++;
    return __libc_malloc(size);
}

void *calloc(const size_t count, const size_t size)
{
    allocations++;
    return __libc_calloc(count, size);
}

void *realloc(void *const memory, const size_t size)
{
    allocations++;
    return __libc_realloc(memory, size);
}
#else
#define COUNTS_ALLOCATIONS 0
#endif

enum { STEP_IO = 17 }; /* step of stepgen 0 */

/* ---- names --------------------------------------------------------------------------------------------------------
 */

static const char *const type_names[] = {
    [HM2_BIT] = "bit", [HM2_S32] = "s32", [HM2_U32] = "u32", [HM2_FLOAT] = "float"};
static const char *const dir_names[] = {[HM2_PIN_IN] = "pin IN",
                                        [HM2_PIN_OUT] = "pin OUT",
                                        [HM2_PIN_IO] = "pin IO",
                                        [HM2_PARAM_RO] = "param RO",
                                        [HM2_PARAM_RW] = "param RW"};

/* Deliberate differences (hal-interface 8.2): what may be read only there may be written here. */
static bool is_better(const char *const name)
{
    return strcmp(name, PREFIX "packet-error-decrement") == 0;
}

static unsigned check_object(const struct servo_rig *const f, const char *const line)
{
    char kind[16], type[16], dir[16], name[128], found[64], wanted[64];
    double value = 0;
    const int fields = sscanf(line, "%15s %15s %15s %127s %lf", kind, type, dir, name, &value);
    assert_true(fields >= 4);
    const struct hm2_plain_object *const object = hm2_plain_find(f->plain, name);
    if (!object) {
        print_message("missing: %s", line);
        return 1;
    }
    (void)snprintf(wanted, sizeof wanted, "%s %s %s", kind, dir, type);
    (void)snprintf(found, sizeof found, "%s %s", dir_names[object->point->dir], type_names[object->point->type]);
    const bool value_same = fields < 5 || hm2_plain_get(f->plain, name, NULL) == value;
    if ((strcmp(found, wanted) == 0 || is_better(name)) && value_same)
        return 0;
    print_message("%s\n  found %s = %.9g\n", line, found, hm2_plain_get(f->plain, name, NULL));
    return 1;
}

static void every_object_of_the_original_driver_is_there(void **state)
{
    struct servo_rig *const f = *state;
    if (hm2_board_identify(f->board, f->link, &f->diag) != 0 ||
        hm2_board_setup(f->board, 0, hm2_plain_binder(f->plain), NULL, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
    FILE *const file = fopen(TEST_DATA "/hal/7i96s.txt", "r");
    assert_non_null(file);
    char line[256];
    unsigned rows = 0, wrong = 0;
    while (fgets(line, sizeof line, file)) {
        if (line[0] == '#')
            continue;
        rows++;
        wrong += check_object(f, line);
    }
    assert_int_equal(fclose(file), 0);
    assert_int_equal(rows, 488);
    assert_int_equal(wrong, 0);
    for (unsigned i = 0; i < 5; i++) {
        char name[128];
        (void)snprintf(name, sizeof name, PREFIX "stepgen.%02u.direction.is_opendrain", i);
        assert_non_null(hm2_plain_find(f->plain, name));
    }
}

/* ---- outputs ------------------------------------------------------------------------------------------------------
 */

static void outputs_are_inactive_until_the_first_write_and_after_stop(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, NULL);
    servo_set(f, "gpio.034.is_output", 1);
    for (unsigned io = 0; io < 51; io++)
        assert_int_equal(sim_card_pad(f->card, io), SIM_FLOAT);
    hm2_board_read(f->board, PERIOD_NS);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    servo_cycles(f, 2);
    assert_int_not_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    assert_int_equal(sim_card_pad(f->card, 34), SIM_LOW);
    servo_cycles(f, 100);
    assert_true(servo_get(f, "packet-error-total") == 0);
    assert_true(servo_get(f, "watchdog.has_bit") == 0);
    hm2_board_stop(f->board);
    sim_net_sleep_until(f->net, link_now_ns(f->link) + PERIOD_NS);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    assert_int_equal(sim_card_pad(f->card, 34), SIM_FLOAT);
}

static void a_step_generator_arrives_where_it_is_sent(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, NULL);
    servo_set(f, "stepgen.00.position-scale", 1000);
    servo_set(f, "stepgen.00.steplen", 1000);
    servo_set(f, "stepgen.00.stepspace", 1000);
    servo_set(f, "stepgen.00.maxaccel", 100);
    servo_set(f, "stepgen.00.maxvel", 50);
    servo_set(f, "stepgen.00.enable", 1);
    for (unsigned i = 0; i < 2000; i++) {
        servo_set(f, "stepgen.00.position-cmd", i < 1000 ? i * 0.01 : 10.0);
        servo_cycle(f);
    }
    const double position = servo_get(f, "stepgen.00.position-fb");
    if (position < 9.999 || position > 10.001)
        fail_msg("position-fb is %g, expected 10", position);
}

/* ---- watchdog and power -------------------------------------------------------------------------------------------
 */

static void a_held_up_thread_makes_the_watchdog_bite_and_says_so(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, NULL);
    servo_cycles(f, 100);
    assert_int_not_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    sim_net_sleep_until(f->net, link_now_ns(f->link) + 10 * PERIOD_NS);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    servo_cycles(f, 3);
    assert_true(servo_get(f, "watchdog.has_bit") == 1);
    assert_true(servo_message(f, "Reason: late write"));
    servo_cycles(f, 50);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    servo_set(f, "watchdog.has_bit", 0);
    servo_cycles(f, 3);
    assert_int_not_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    servo_cycles(f, 20);
    assert_true(servo_get(f, "watchdog.has_bit") == 0);
}

struct motor {
    struct sim_card *card;
    int step, direction; /* watches */
    int steps;
};

/* A pad that floats is no step: this is what a drive gets. */
static void count_step(void *context, int64_t clk, unsigned ps, unsigned watch, enum sim_level level)
{
    struct motor *const motor = context;
    (void)clk;
    (void)ps;
    if ((int)watch == motor->step && level == SIM_HIGH)
        motor->steps += sim_card_watched(motor->card, (unsigned)motor->direction) == SIM_HIGH ? -1 : 1;
}

static void attach_motor(const struct servo_rig *const f, struct motor *const motor)
{
    *motor = (struct motor){.card = f->card};
    motor->step = sim_card_watch_pad(f->card, STEP_IO);
    motor->direction = sim_card_watch_pad(f->card, STEP_IO + 1);
    assert_true(motor->step >= 0 && motor->direction >= 0);
    sim_card_on_edge(f->card, count_step, motor);
}

/* With the time between bite and next reply the generator counts ten times what the motor did. */
static void after_a_bite_the_position_is_that_of_the_motor_and_it_does_not_go_back(void **state)
{
    struct servo_rig *const f = *state;
    struct motor motor;
    servo_load(f, NULL);
    servo_set(f, "stepgen.00.position-scale", 1000);
    servo_set(f, "stepgen.00.steplen", 1000);
    servo_set(f, "stepgen.00.stepspace", 1000);
    servo_set(f, "stepgen.00.maxaccel", 0);
    servo_set(f, "stepgen.00.enable", 1);
    servo_cycles(f, 10);
    attach_motor(f, &motor);
    for (unsigned i = 0; i < 200; i++) {
        servo_set(f, "stepgen.00.position-cmd", i * 0.02);
        servo_cycle(f);
    }
    sim_net_sleep_until(f->net, link_now_ns(f->link) + 60 * PERIOD_NS);
    servo_cycles(f, 3);
    assert_true(servo_get(f, "watchdog.has_bit") == 1);
    assert_in_range(motor.steps, 4000, 4150); /* 5 ms more */
    const double position = servo_get(f, "stepgen.00.position-fb");
    if (position < motor.steps * 0.001 - 0.025 || position > motor.steps * 0.001 + 0.025)
        fail_msg("position-fb is %g, the motor is at %g", position, motor.steps * 0.001);
    const int steps = motor.steps;
    servo_set(f, "stepgen.00.position-cmd", position);
    servo_set(f, "watchdog.has_bit", 0);
    servo_cycles(f, 100);
    assert_in_range(motor.steps, steps - 1, steps + 1);
    sim_card_on_edge(f->card, NULL, NULL);
}

/* The card needs longer to configure its FPGA than the error level allows: a person clears io_error. */
static void power_cycle(struct servo_rig *const f)
{
    sim_card_power_cycle(f->card);
    servo_cycles(f, 1000);
    assert_true(servo_get(f, "io_error") == 1);
    servo_set(f, "io_error", 0);
}

static void a_power_cycle_is_survived_with_outputs_off_until_a_person_agrees(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, NULL);
    servo_set(f, "gpio.040.is_output", 1);
    servo_set(f, "gpio.040.out", 1);
    servo_cycles(f, 100);
    assert_int_equal(sim_card_pad(f->card, 40), SIM_HIGH);
    power_cycle(f);
    for (unsigned i = 0; i < 200; i++) {
        servo_cycle(f);
        assert_int_equal(sim_card_pad(f->card, 40), SIM_FLOAT);
        assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    }
    assert_true(servo_get(f, "watchdog.has_bit") == 1);
    assert_true(servo_get(f, "io_error") == 0);
    assert_true(servo_get(f, "packet-error") == 0);
    assert_true(servo_message(f, "has lost its state"));
    assert_true(servo_message(f, "is back with the same firmware"));
    servo_set(f, "watchdog.has_bit", 0);
    servo_cycles(f, 10);
    assert_int_equal(sim_card_pad(f->card, 40), SIM_HIGH);
    assert_true(servo_get(f, "watchdog.has_bit") == 0);
}

static void encoder_positions_do_not_jump_when_the_power_fails(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, NULL);
    assert_int_equal(sim_card_follow(f->card, 0, 0, 4, 1), 0);
    servo_set(f, "stepgen.00.steplen", 1000);
    servo_set(f, "stepgen.00.stepspace", 1000);
    servo_set(f, "stepgen.00.maxaccel", 0);
    servo_set(f, "stepgen.00.control-type", 1);
    servo_set(f, "stepgen.00.velocity-cmd", 10000);
    servo_set(f, "stepgen.00.enable", 1);
    servo_cycles(f, 500);
    const double before = servo_get(f, "encoder.00.count");
    assert_true(before > 15000);
    servo_set(f, "stepgen.00.enable", 0);
    servo_cycles(f, 5);
    const double at_rest = servo_get(f, "encoder.00.count");
    power_cycle(f);
    for (unsigned i = 0; i < 30; i++) {
        servo_cycle(f);
        assert_true(servo_get(f, "encoder.00.count") == at_rest);
    }
    assert_true(servo_get(f, "watchdog.has_bit") == 1);
    assert_true(servo_get(f, "packet-error") == 0);
}

static void a_wait_that_another_program_left_on_the_card_does_not_hold_set_up_up(void **state)
{
    struct servo_rig *const f = *state;
    uint8_t request[64];
    struct lbp16_builder builder;
    const uint16_t longest = UINT16_MAX; /* us, for each scratch word */
    lbp16_builder_init(&builder, request, sizeof request);
    assert_int_equal(lbp16_add_write16(&builder, LBP16_SPACE_TIMER, LBP16_TIMER_TIMEOUT_US, 1, &longest, NULL), 0);
    assert_int_equal(link_send(f->link, request, builder.used), 0);
    const int64_t begin_ns = link_now_ns(f->link);
    servo_load(f, NULL);
    assert_in_range(link_now_ns(f->link) - begin_ns, 1, 50000000);
}

/* ---- cost of a cycle -----------------------------------------------------------------------------------------------
 */

/* datagrams: that a cycle sends. */
static void count_cost(struct servo_rig *const f, const char *const config, const unsigned datagrams)
{
    enum { CYCLES = 5000 };
    servo_load(f, config);
    servo_set(f, "stepgen.00.enable", 1);
    servo_set(f, "stepgen.00.maxaccel", 100);
    servo_set(f, "pwmgen.00.enable", 1);
    servo_cycles(f, 600); /* the DPLL sends its set-up for a while, and a pipelined cycle begins */
    const struct link_counters before = f->link->counters;
    const unsigned long allocated = allocations;
    for (unsigned i = 0; i < CYCLES; i++) {
        servo_set(f, "stepgen.00.position-cmd", i * 0.001);
        servo_set(f, "pwmgen.00.value", i * 0.0001);
        servo_cycle(f);
    }
    assert_int_equal(f->link->counters.sent - before.sent, datagrams * CYCLES);
    assert_int_equal(f->link->counters.received - before.received, CYCLES);
    assert_int_equal(allocations, allocated);
    assert_true(!COUNTS_ALLOCATIONS || allocated > 0);
    assert_true(servo_get(f, "packet-error-total") == 0);
}

static void a_cycle_allocates_nothing_and_moves_exactly_its_packets(void **state)
{
    count_cost(*state, NULL, 2);
}

static void so_does_a_pipelined_one(void **state)
{
    count_cost(*state, "pipelined=4", 1);
}

#define TEST(function) cmocka_unit_test_setup_teardown(function, servo_set_up, servo_tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(every_object_of_the_original_driver_is_there),
        TEST(outputs_are_inactive_until_the_first_write_and_after_stop),
        TEST(a_step_generator_arrives_where_it_is_sent),
        TEST(a_held_up_thread_makes_the_watchdog_bite_and_says_so),
        TEST(after_a_bite_the_position_is_that_of_the_motor_and_it_does_not_go_back),
        TEST(a_power_cycle_is_survived_with_outputs_off_until_a_person_agrees),
        TEST(encoder_positions_do_not_jump_when_the_power_fails),
        TEST(a_wait_that_another_program_left_on_the_card_does_not_hold_set_up_up),
        TEST(a_cycle_allocates_nothing_and_moves_exactly_its_packets),
        TEST(so_does_a_pipelined_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
