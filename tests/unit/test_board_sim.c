/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A board with every module of the library, on a simulated 7I96S. */
#include "unit.h"

#include <hm2/board.h>
#include <hm2/lbp16.h>
#include <hm2/sim.h>

#define PERIOD_NS 1000000
#define PREFIX    "hm2_7i96s.0."

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

struct fixture {
    struct sim_card *card;
    struct sim_net *net;
    struct link *link;
    struct hm2_board *board;
    struct hm2_plain_binder *plain;
    struct hm2_diag diag;
};

static int set_up(void **state)
{
    struct fixture *const f = calloc(1, sizeof *f);
    assert_non_null(f);
    const struct sim_card_options options = {.profile = "7i96s", .seed = 1};
    if (sim_card_new(&f->card, &options, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
    assert_int_equal(sim_net_new(&f->net, f->card, NULL), 0);
    f->link = sim_net_link(f->net);
    f->board = hm2_board_new();
    f->plain = hm2_plain_binder_new();
    assert_non_null(f->board);
    assert_non_null(f->plain);
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *const f = *state;
    hm2_board_free(f->board);
    hm2_plain_binder_free(f->plain);
    sim_net_free(f->net);
    sim_card_free(f->card);
    free(f);
    return 0;
}

static void load(struct fixture *const f, const char *const config)
{
    if (hm2_board_identify(f->board, f->link, &f->diag) != 0 ||
        hm2_board_setup(f->board, 0, hm2_plain_binder(f->plain), config, &f->diag) != 0 ||
        hm2_board_start(f->board, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
}

static const char *full_name(char text[128], const char *const name)
{
    (void)snprintf(text, 128, PREFIX "%s", name);
    return text;
}

static double get(const struct fixture *const f, const char *const name)
{
    char full[128];
    int err;
    const double value = hm2_plain_get(f->plain, full_name(full, name), &err);
    if (err)
        fail_msg("no point %s", full);
    return value;
}

static void set(const struct fixture *const f, const char *const name, const double value)
{
    char full[128];
    assert_int_equal(hm2_plain_set(f->plain, full_name(full, name), value), 0);
}

static void cycle(struct fixture *const f)
{
    const int64_t begin_ns = link_now_ns(f->link);
    hm2_board_read(f->board, PERIOD_NS);
    hm2_board_write(f->board, PERIOD_NS);
    sim_net_sleep_until(f->net, begin_ns + PERIOD_NS);
}

static void cycles(struct fixture *const f, const unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        cycle(f);
}

static bool message(const struct fixture *const f, const char *const words)
{
    char text[1024];
    bool error;
    while (hm2_board_next_message(f->board, text, sizeof text, &error) > 0)
        if (strstr(text, words))
            return true;
    return false;
}

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

static unsigned check_object(const struct fixture *const f, const char *const line)
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
    struct fixture *const f = *state;
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
    struct fixture *const f = *state;
    load(f, NULL);
    set(f, "gpio.034.is_output", 1);
    for (unsigned io = 0; io < 51; io++)
        assert_int_equal(sim_card_pad(f->card, io), SIM_FLOAT);
    hm2_board_read(f->board, PERIOD_NS);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    cycles(f, 2);
    assert_int_not_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    assert_int_equal(sim_card_pad(f->card, 34), SIM_LOW);
    cycles(f, 100);
    assert_true(get(f, "packet-error-total") == 0);
    assert_true(get(f, "watchdog.has_bit") == 0);
    hm2_board_stop(f->board);
    sim_net_sleep_until(f->net, link_now_ns(f->link) + PERIOD_NS);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    assert_int_equal(sim_card_pad(f->card, 34), SIM_FLOAT);
}

static void a_step_generator_arrives_where_it_is_sent(void **state)
{
    struct fixture *const f = *state;
    load(f, NULL);
    set(f, "stepgen.00.position-scale", 1000);
    set(f, "stepgen.00.steplen", 1000);
    set(f, "stepgen.00.stepspace", 1000);
    set(f, "stepgen.00.maxaccel", 100);
    set(f, "stepgen.00.maxvel", 50);
    set(f, "stepgen.00.enable", 1);
    for (unsigned i = 0; i < 2000; i++) {
        set(f, "stepgen.00.position-cmd", i < 1000 ? i * 0.01 : 10.0);
        cycle(f);
    }
    const double position = get(f, "stepgen.00.position-fb");
    if (position < 9.999 || position > 10.001)
        fail_msg("position-fb is %g, expected 10", position);
}

/* ---- watchdog and power -------------------------------------------------------------------------------------------
 */

static void a_held_up_thread_makes_the_watchdog_bite_and_says_so(void **state)
{
    struct fixture *const f = *state;
    load(f, NULL);
    cycles(f, 100);
    assert_int_not_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    sim_net_sleep_until(f->net, link_now_ns(f->link) + 10 * PERIOD_NS);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    cycles(f, 3);
    assert_true(get(f, "watchdog.has_bit") == 1);
    assert_true(message(f, "Reason: late write"));
    cycles(f, 50);
    assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    set(f, "watchdog.has_bit", 0);
    cycles(f, 3);
    assert_int_not_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    cycles(f, 20);
    assert_true(get(f, "watchdog.has_bit") == 0);
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

static void attach_motor(const struct fixture *const f, struct motor *const motor)
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
    struct fixture *const f = *state;
    struct motor motor;
    load(f, NULL);
    set(f, "stepgen.00.position-scale", 1000);
    set(f, "stepgen.00.steplen", 1000);
    set(f, "stepgen.00.stepspace", 1000);
    set(f, "stepgen.00.maxaccel", 0);
    set(f, "stepgen.00.enable", 1);
    cycles(f, 10);
    attach_motor(f, &motor);
    for (unsigned i = 0; i < 200; i++) {
        set(f, "stepgen.00.position-cmd", i * 0.02);
        cycle(f);
    }
    sim_net_sleep_until(f->net, link_now_ns(f->link) + 60 * PERIOD_NS);
    cycles(f, 3);
    assert_true(get(f, "watchdog.has_bit") == 1);
    assert_in_range(motor.steps, 4000, 4150); /* 5 ms more */
    const double position = get(f, "stepgen.00.position-fb");
    if (position < motor.steps * 0.001 - 0.025 || position > motor.steps * 0.001 + 0.025)
        fail_msg("position-fb is %g, the motor is at %g", position, motor.steps * 0.001);
    const int steps = motor.steps;
    set(f, "stepgen.00.position-cmd", position);
    set(f, "watchdog.has_bit", 0);
    cycles(f, 100);
    assert_in_range(motor.steps, steps - 1, steps + 1);
    sim_card_on_edge(f->card, NULL, NULL);
}

/* The card needs longer to configure its FPGA than the error level allows: a person clears io_error. */
static void power_cycle(struct fixture *const f)
{
    sim_card_power_cycle(f->card);
    cycles(f, 1000);
    assert_true(get(f, "io_error") == 1);
    set(f, "io_error", 0);
}

static void a_power_cycle_is_survived_with_outputs_off_until_a_person_agrees(void **state)
{
    struct fixture *const f = *state;
    load(f, NULL);
    set(f, "gpio.040.is_output", 1);
    set(f, "gpio.040.out", 1);
    cycles(f, 100);
    assert_int_equal(sim_card_pad(f->card, 40), SIM_HIGH);
    power_cycle(f);
    for (unsigned i = 0; i < 200; i++) {
        cycle(f);
        assert_int_equal(sim_card_pad(f->card, 40), SIM_FLOAT);
        assert_int_equal(sim_card_pad(f->card, STEP_IO), SIM_FLOAT);
    }
    assert_true(get(f, "watchdog.has_bit") == 1);
    assert_true(get(f, "io_error") == 0);
    assert_true(get(f, "packet-error") == 0);
    assert_true(message(f, "has lost its state"));
    assert_true(message(f, "is back with the same firmware"));
    set(f, "watchdog.has_bit", 0);
    cycles(f, 10);
    assert_int_equal(sim_card_pad(f->card, 40), SIM_HIGH);
    assert_true(get(f, "watchdog.has_bit") == 0);
}

static void encoder_positions_do_not_jump_when_the_power_fails(void **state)
{
    struct fixture *const f = *state;
    load(f, NULL);
    assert_int_equal(sim_card_follow(f->card, 0, 0, 4, 1), 0);
    set(f, "stepgen.00.steplen", 1000);
    set(f, "stepgen.00.stepspace", 1000);
    set(f, "stepgen.00.maxaccel", 0);
    set(f, "stepgen.00.control-type", 1);
    set(f, "stepgen.00.velocity-cmd", 10000);
    set(f, "stepgen.00.enable", 1);
    cycles(f, 500);
    const double before = get(f, "encoder.00.count");
    assert_true(before > 15000);
    set(f, "stepgen.00.enable", 0);
    cycles(f, 5);
    const double at_rest = get(f, "encoder.00.count");
    power_cycle(f);
    for (unsigned i = 0; i < 30; i++) {
        cycle(f);
        assert_true(get(f, "encoder.00.count") == at_rest);
    }
    assert_true(get(f, "watchdog.has_bit") == 1);
    assert_true(get(f, "packet-error") == 0);
}

static void a_wait_that_another_program_left_on_the_card_does_not_hold_set_up_up(void **state)
{
    struct fixture *const f = *state;
    uint8_t request[64];
    struct lbp16_builder builder;
    const uint16_t longest = UINT16_MAX; /* us, for each scratch word */
    lbp16_builder_init(&builder, request, sizeof request);
    assert_int_equal(lbp16_add_write16(&builder, LBP16_SPACE_TIMER, LBP16_TIMER_TIMEOUT_US, 1, &longest, NULL), 0);
    assert_int_equal(link_send(f->link, request, builder.used), 0);
    const int64_t begin_ns = link_now_ns(f->link);
    load(f, NULL);
    assert_in_range(link_now_ns(f->link) - begin_ns, 1, 50000000);
}

/* ---- cost of a cycle -----------------------------------------------------------------------------------------------
 */

/* datagrams: that a cycle sends. */
static void count_cost(struct fixture *const f, const char *const config, const unsigned datagrams)
{
    enum { CYCLES = 5000 };
    load(f, config);
    set(f, "stepgen.00.enable", 1);
    set(f, "stepgen.00.maxaccel", 100);
    set(f, "pwmgen.00.enable", 1);
    cycles(f, 600); /* the DPLL sends its set-up for a while, and a pipelined cycle begins */
    const struct link_counters before = f->link->counters;
    const unsigned long allocated = allocations;
    for (unsigned i = 0; i < CYCLES; i++) {
        set(f, "stepgen.00.position-cmd", i * 0.001);
        set(f, "pwmgen.00.value", i * 0.0001);
        cycle(f);
    }
    assert_int_equal(f->link->counters.sent - before.sent, datagrams * CYCLES);
    assert_int_equal(f->link->counters.received - before.received, CYCLES);
    assert_int_equal(allocations, allocated);
    assert_true(!COUNTS_ALLOCATIONS || allocated > 0);
    assert_true(get(f, "packet-error-total") == 0);
}

static void a_cycle_allocates_nothing_and_moves_exactly_its_packets(void **state)
{
    count_cost(*state, NULL, 2);
}

static void so_does_a_pipelined_one(void **state)
{
    count_cost(*state, "pipelined=4", 1);
}

#define TEST(function) cmocka_unit_test_setup_teardown(function, set_up, tear_down)

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
