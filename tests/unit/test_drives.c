/* SPDX-License-Identifier: GPL-2.0-or-later */
/* RC servos, one-shots, period meters, galvo interfaces and resolvers: registers from pins, pins from registers. */
#include "unit.h"

#include <math.h>

#include "module_rig.h"
#include "module_types.h"
#include "trace_file.h"

static const struct rig_md modules[] = {
    {HM2_GTAG_DPLL, 0, 1, 1, 0x7000, 7, 0, 0},        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0, 0x1F},
    {HM2_GTAG_RCPWM, 0, 1, 2, 0x9D00, 2, 0, 0x1},     {HM2_GTAG_ONESHOT, 0, 1, 2, 0xB100, 6, 0, 0x3F},
    {HM2_GTAG_PERIODM, 0, 1, 2, 0xB700, 4, 0, 0xF},   {HM2_GTAG_XY2MOD, 0, 1, 2, 0x9200, 11, 0, 0x1FF},
    {HM2_GTAG_RESOLVER, 0, 1, 1, 0x3C00, 5, 0, 0x1F},
};

static struct module_rig *started(const struct hm2_module_type *type, const char *config)
{
    struct module_rig *const rig = rig_new(rig_image_with(modules, 7, NULL, 0), config);
    (void)rig_add(rig, type);
    rig_start(rig);
    return rig;
}

/* ---- RC servos: 100 MHz -------------------------------------------------------------------------------------------
 */

static void pulse_lengths_follow_the_formula(void **state)
{
    (void)state;
    static const struct {
        double width;
        uint32_t value;
    } rows[] = {
        {1.5, 9374}, {0, 0x10000}, {0.00015, 0x10000}, {0.00016, 0}, {100, 65535}, {NAN, 0x10000}, {-1, 0x10000},
    };
    struct module_rig *const rig = started(&hm2_rcpwmgen_type, "");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        rig_set(rig, "rcpwmgen.01.width", rows[i].width);
        rig_cycle(rig);
        assert_int_equal(rig_written(rig, 0x9D04), rows[i].value);
    }
    assert_true(rig_get(rig, "rcpwmgen.01.width") == -1.0); /* it belongs to whoever drives it */
    rig_set(rig, "rcpwmgen.01.offset", 1.5);
    rig_set(rig, "rcpwmgen.01.scale", 90);
    rig_set(rig, "rcpwmgen.01.width", 45);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0x9D04), 12499);
    rig_set(rig, "rcpwmgen.01.scale", 0);
    rig_cycle(rig);
    assert_true(rig_get(rig, "rcpwmgen.01.scale") == 1.0);
    rig_free(rig);
}

static void a_servo_keeps_its_width_while_the_offset_makes_it_impossible(void **state)
{
    (void)state;
    static const struct {
        double offset;
        uint32_t value;
    } rows[] = {{-1, 0x10000}, {20, 65535}, {NAN, 0x10000}, {1, 7499}};
    struct module_rig *const rig = started(&hm2_rcpwmgen_type, "");
    rig_set(rig, "rcpwmgen.00.width", 0.2);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        rig_set(rig, "rcpwmgen.00.offset", rows[i].offset);
        rig_cycles(rig, 3);
        assert_int_equal(rig_written(rig, 0x9D00), rows[i].value);
        assert_true(rig_get(rig, "rcpwmgen.00.width") == 0.2);
    }
    rig_free(rig);
}

static void the_rate_of_servos_stays_within_its_limits(void **state)
{
    (void)state;
    static const struct {
        double wanted, taken;
        uint32_t divisor;
    } rows[] = {{50, 50, 1999998}, {5000, 1000, 99998}, {0, 0.01, 0x7FFFFFFF}, {NAN, 0.01, 0x7FFFFFFF}};
    struct module_rig *const rig = started(&hm2_rcpwmgen_type, "num_rcpwmgens=1");
    assert_false(rig_has(rig, "rcpwmgen.01.width"));
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        rig_set(rig, "rcpwmgen.rate", rows[i].wanted);
        rig_cycle(rig);
        assert_int_equal(rig_written(rig, 0x9E00), rows[i].divisor);
        assert_true(rig_get(rig, "rcpwmgen.rate") == rows[i].taken);
    }
    rig_cycle(rig);
    assert_false(rig_wrote(rig, 0x9E00));
    rig_free(rig);
}

/* ---- one-shots ----------------------------------------------------------------------------------------------------
 */

static void one_shot_registers_follow_their_pins(void **state)
{
    (void)state;
    struct module_rig *const rig = started(&hm2_oneshot_type, "");
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0xB100), 100000);
    assert_int_equal(rig_written(rig, 0xB204), 100000);
    assert_int_equal(rig_written(rig, 0xB300), 10000);
    assert_int_equal(rig_written(rig, 0xB500), 42949);
    assert_int_equal(rig_written(rig, 0xB600), 0);
    rig_set(rig, "oneshot.00.filter1", 1000); /* clips the filter, not the width as LinuxCNC's driver does */
    rig_set(rig, "oneshot.00.width2", 1e9);
    rig_set(rig, "oneshot.00.width1", NAN);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0xB300), 0xFFFFFF);
    assert_in_range(rig_written(rig, 0xB200), 0x7FFFFFFE, 0x7FFFFFFF);
    assert_int_equal(rig_written(rig, 0xB100), 0);
    assert_true(rig_get(rig, "oneshot.00.filter1") < 168);
    rig_free(rig);
}

static void one_shot_control_is_made_of_bits(void **state)
{
    (void)state;
    static const struct {
        const char *pin;
        uint32_t bits;
    } rows[] = {
        {"trigger_on_rise1", 1u << 3},  {"trigger_on_fall1", 1u << 4}, {"retriggerable1", 1u << 5},
        {"enable1", 1u << 6},           {"reset1", 1u << 7},           {"swtrigger1", 1u << 10},
        {"trigger_select1", 1u},        {"trigger_select2", 1u << 16}, {"trigger_on_rise2", 1u << 19},
        {"trigger_on_fall2", 1u << 20}, {"retriggerable2", 1u << 21},  {"enable2", 1u << 22},
        {"reset2", 1u << 23},           {"swtrigger2", 1u << 26},      {"dpll_timer_number", 1u << 12},
    };
    struct module_rig *const rig = started(&hm2_oneshot_type, "");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char name[48];
        (void)snprintf(name, sizeof name, "oneshot.01.%s", rows[i].pin);
        rig_set(rig, name, 1);
        rig_cycle(rig);
        assert_int_equal(rig_written(rig, 0xB604), rows[i].bits);
        rig_set(rig, name, 0);
    }
    rig_set(rig, "oneshot.01.trigger_select2", 8);
    rig_set(rig, "oneshot.01.dpll_timer_number", 5);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0xB604), 0);
    rig_put(rig, 0xB604, 1u << 8 | 1u << 25);
    rig_cycle(rig);
    assert_true(rig_get(rig, "oneshot.01.out1") == 1 && rig_get(rig, "oneshot.01.exttrigger1") == 0);
    assert_true(rig_get(rig, "oneshot.01.out2") == 0 && rig_get(rig, "oneshot.01.exttrigger2") == 1);
    rig_free(rig);
}

/* ---- period meters ------------------------------------------------------------------------------------------------
 */

static void a_period_is_shown_in_every_unit(void **state)
{
    (void)state;
    struct module_rig *const rig = started(&hm2_periodm_type, "num_periodms=1");
    rig_set(rig, "periodm.00.averages", 4);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0xB700), 100u << 16 | 3u << 4);
    assert_int_equal(rig_written(rig, 0xBA00), 400000000);
    rig_put(rig, 0xB700, 6);
    rig_put(rig, 0xB800, 400000); /* four periods of a millisecond */
    rig_put(rig, 0xB900, 100000);
    rig_set(rig, "periodm.00.duty_cycle_offset", 1);
    rig_cycle(rig);
    assert_true(rig_get(rig, "periodm.00.valid") == 1 && rig_get(rig, "periodm.00.input_status") == 1);
    assert_true(fabs(rig_get(rig, "periodm.00.period_us") - 1000) < 1e-9);
    assert_true(fabs(rig_get(rig, "periodm.00.width_us") - 250) < 1e-9);
    assert_true(fabs(rig_get(rig, "periodm.00.frequency") - 1000) < 1e-9);
    assert_true(fabs(rig_get(rig, "periodm.00.duty_cycle") - 26) < 1e-9);
    rig_put(rig, 0xB800, 0);
    rig_cycle(rig);
    assert_true(fabs(rig_get(rig, "periodm.00.frequency") - 1000) < 1e-9);
    rig_free(rig);
}

static void settings_of_a_period_meter_stay_within_their_registers(void **state)
{
    (void)state;
    struct module_rig *const rig = started(&hm2_periodm_type, "");
    rig_set(rig, "periodm.00.averages", 0);
    rig_set(rig, "periodm.00.filtertc_us", 1e6);
    rig_set(rig, "periodm.00.minimum_frequency", 0);
    rig_set(rig, "periodm.00.invert", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0xB700), 0xFFFF0001);
    assert_int_equal(rig_written(rig, 0xBA00), 0xFFFFFFFF);
    assert_true(rig_get(rig, "periodm.00.averages") == 1);
    rig_set(rig, "periodm.00.averages", 5000);
    rig_set(rig, "periodm.00.minimum_frequency", NAN);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0xB700) >> 4 & 0xFFF, 4094);
    rig_free(rig);
}

static struct module_rig *with_card(const struct hm2_module_type *type)
{
    const struct hm2_image *const image = rig_image_with(modules, 7, NULL, 0);
    struct module_rig *const rig = rig_new(image, "");
    const struct sim_card_options options = {.profile = "7i96s", .image = image};
    assert_int_equal(sim_card_new(&rig->card, &options, NULL), 0);
    rig->clk = 1000;
    rig->read_clk = 5;
    (void)rig_add(rig, type);
    rig_start(rig);
    return rig;
}

static void a_simulated_meter_measures_pulses(void **state)
{
    (void)state;
    struct module_rig *const rig = with_card(&hm2_periodm_type);
    rig_set(rig, "periodm.01.averages", 2);
    rig_cycles(rig, 3);
    for (int64_t i = 0; i < 20; i++) {
        const int64_t at = rig->clk + 100 + i * 5000;
        assert_int_equal(sim_card_drive_input(rig->card, at, HM2_GTAG_PERIODM, 1, 1, SIM_HIGH), 0);
        assert_int_equal(sim_card_drive_input(rig->card, at + 1000, HM2_GTAG_PERIODM, 1, 1, SIM_LOW), 0);
    }
    rig_cycle(rig);
    assert_true(rig_get(rig, "periodm.01.valid") == 1);
    assert_true(fabs(rig_get(rig, "periodm.01.period_us") - 50) < 0.02);
    assert_true(fabs(rig_get(rig, "periodm.01.duty_cycle") - 20) < 0.1);
    rig_cycles(rig, 2100); /* slower than a hertz, twice */
    assert_true(rig_get(rig, "periodm.01.valid") == 0);
    sim_card_free(rig->card);
    rig_free(rig);
}

struct pulse {
    int64_t rise, high, period;
};

static void note_pulse(void *context, int64_t clk, unsigned ps, unsigned watch, enum sim_level level)
{
    struct pulse *const p = context;
    (void)ps;
    (void)watch;
    if (level == SIM_HIGH) {
        p->period = clk - p->rise;
        p->rise = clk;
    } else {
        p->high = clk - p->rise;
    }
}

static void a_simulated_servo_gets_its_pulses(void **state)
{
    (void)state;
    struct module_rig *const rig = with_card(&hm2_rcpwmgen_type);
    struct pulse p = {0};
    rig_set(rig, "rcpwmgen.00.width", 1.5);
    rig_set(rig, "rcpwmgen.rate", 100);
    rig_cycle(rig);
    assert_int_equal(sim_card_watch_output(rig->card, HM2_GTAG_RCPWM, 0, 0x81), 0);
    sim_card_on_edge(rig->card, note_pulse, &p);
    rig_cycles(rig, 45);
    assert_int_equal(p.period, 1000000);
    assert_int_equal(p.high, 150000);
    rig_set(rig, "rcpwmgen.00.width", 0);
    rig_cycles(rig, 5);
    p.high = 0;
    rig_cycles(rig, 30);
    assert_int_equal(p.high, 0);
    sim_card_free(rig->card);
    rig_free(rig);
}

/* ---- galvo interfaces ---------------------------------------------------------------------------------------------
 */

static void commands_go_out_when_they_change(void **state)
{
    (void)state;
    struct module_rig *const rig = started(&hm2_xy2mod_type, "");
    rig_set(rig, "xy2mod.01.posx-cmd", 0.5);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0x9804), 0x3C9);
    assert_true(rig_get(rig, "xy2mod.01.posx-cmd") == 0.0); /* not enabled */
    rig_set(rig, "xy2mod.01.enable", 1);
    rig_set(rig, "xy2mod.01.posx-cmd", 0.5);
    rig_set(rig, "xy2mod.01.vely-cmd", -2);
    rig_set(rig, "xy2mod.01.accx-cmd", 10000);
    rig_set(rig, "xy2mod.01.18bitmodey", 1);
    rig_set(rig, "xy2mod.01.controly", 0xF);
    rig_set(rig, "xy2mod.01.commandx", 0x12345);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0x9604), 0x3FFFFFFF);
    assert_int_equal(rig_written(rig, 0x9504), (uint32_t)-10995);
    assert_int_equal(rig_written(rig, 0x9204), 2251);
    assert_int_equal(rig_written(rig, 0x9804), 0x800 | 7 << 3 | 1);
    assert_int_equal(rig_written(rig, 0x9904), 0x2345);
    rig_cycle(rig);
    assert_false(rig_wrote(rig, 0x9604));
    rig_set(rig, "xy2mod.01.posx-cmd", 7);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0x9604), 2147418112);
    rig_set(rig, "xy2mod.01.posx-cmd", NAN);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0x9604), 2147418112);
    rig_free(rig);
}

static void feedback_status_and_timers_of_a_galvo(void **state)
{
    (void)state;
    struct module_rig *const rig = started(&hm2_xy2mod_type, "");
    rig_put(rig, 0x9600, 0xC0000001);
    rig_put(rig, 0x9500, 5497);
    rig_put(rig, 0x9800, 0x40 | 0x200);
    rig_put(rig, 0x9A00, 0xFFFABCDE);
    rig_set(rig, "xy2mod.read-timer-number", 2);
    rig_set(rig, "xy2mod.write-timer-number", 5);
    rig_cycle(rig);
    assert_true(fabs(rig_get(rig, "xy2mod.00.posx-fb") + 0.5) < 1e-9);
    assert_true(fabs(rig_get(rig, "xy2mod.00.vely-fb") - 1.0) < 1e-3);
    assert_true(rig_get(rig, "xy2mod.00.posx-overflow") == 1 && rig_get(rig, "xy2mod.00.posy-overflow") == 0);
    assert_true(rig_get(rig, "xy2mod.00.velx-overflow") == 0 && rig_get(rig, "xy2mod.00.vely-overflow") == 1);
    assert_true(rig_get(rig, "xy2mod.00.status") == 0xABCDE);
    assert_int_equal(rig_written(rig, 0x9B00), 0xA000);
    assert_int_equal(rig_written(rig, 0x9C00), 0x8000); /* as for step generators: no such timer is the reference */
    assert_true(rig_get(rig, "xy2mod.write-timer-number") == 0);
    rig_free(rig);
}

static void a_scale_that_divides_by_almost_nothing_is_replaced(void **state)
{
    (void)state;
    static const struct {
        double wanted, taken;
    } rows[] = {{0, 1}, {9e-7, 1}, {-9e-7, -1}, {NAN, 1}, {INFINITY, 1}, {-INFINITY, -1}, {1e-6, 1e-6}, {-2, -2}};
    struct module_rig *const rig = started(&hm2_xy2mod_type, "");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        rig_set(rig, "xy2mod.00.posy-scale", rows[i].wanted);
        rig_cycle(rig);
        assert_true(rig_get(rig, "xy2mod.00.posy-scale") == rows[i].taken);
    }
    rig_free(rig);
}

/* It may be moving by its velocity: an old position sent again would throw it back. */
static void a_galvo_gets_no_old_position_again(void **state)
{
    (void)state;
    struct module_rig *const rig = started(&hm2_xy2mod_type, "");
    rig_set(rig, "xy2mod.00.enable", 1);
    rig_set(rig, "xy2mod.01.enable", 1);
    rig_set(rig, "xy2mod.00.posx-cmd", 0.25);
    rig_set(rig, "xy2mod.01.velx-cmd", 10);
    rig_cycles(rig, 3);
    rig_set(rig, "xy2mod.00.posx-cmd", 0.5);
    rig_cycle(rig);
    assert_true(rig_wrote(rig, 0x9600)); /* its neighbour's */
    assert_false(rig_wrote(rig, 0x9604));
    assert_false(rig_wrote(rig, 0x9404));
    rig_set(rig, "xy2mod.01.posx-scale", 2);
    rig_cycle(rig);
    assert_false(rig_wrote(rig, 0x9604));
    rig_set(rig, "xy2mod.00.enable", 0);
    rig_cycle(rig);
    assert_true(rig_wrote(rig, 0x9600));
    assert_false(rig_wrote(rig, 0x9604));
    rig_set(rig, "xy2mod.01.posx-cmd", 0.5); /* with the new scale */
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, 0x9604), 0x1FFFFFFF);
    rig_free(rig);
}

static void a_simulated_galvo_moves_and_tells_its_limits(void **state)
{
    (void)state;
    struct module_rig *const rig = with_card(&hm2_xy2mod_type);
    rig_set(rig, "xy2mod.00.enable", 1);
    rig_set(rig, "xy2mod.00.velx-cmd", 10);
    rig_cycles(rig, 52);
    assert_true(fabs(rig_get(rig, "xy2mod.00.posx-fb") - 0.5) < 0.02);
    assert_true(fabs(rig_get(rig, "xy2mod.00.velx-fb") - 10) < 0.001);
    assert_true(rig_get(rig, "xy2mod.00.posx-overflow") == 0);
    rig_cycles(rig, 60);
    assert_true(fabs(rig_get(rig, "xy2mod.00.posx-fb") - 1) < 0.001);
    assert_true(rig_get(rig, "xy2mod.00.posx-overflow") == 1 && rig_get(rig, "xy2mod.00.posy-overflow") == 0);
    rig_set(rig, "xy2mod.00.enable", 0);
    rig_cycles(rig, 2);
    assert_true(rig_get(rig, "xy2mod.00.posx-fb") == 0 && rig_get(rig, "xy2mod.00.posx-overflow") == 0);
    rig_set(rig, "xy2mod.00.enable", 1);
    rig_set(rig, "xy2mod.00.accy-cmd", -1000);
    rig_cycles(rig, 31);
    assert_true(fabs(rig_get(rig, "xy2mod.00.posy-fb") + 0.45) < 0.05);
    sim_card_free(rig->card);
    rig_free(rig);
}

/* ---- resolvers ----------------------------------------------------------------------------------------------------
 */

/* The last readings of a recorded test with angles 0, 8192, ... in 1/65536 turn. */
static void recorded_positions_are_the_angles_of_the_bench(void **state)
{
    (void)state;
    static const double angles[] = {0, 8192, 16384, 30000, 45000, 60000};
    struct trace_file trace = trace_load("resolver");
    struct module_rig *const rig = started(&hm2_resolver_type, "");
    const struct trace_event *event;
    for (size_t index = 0; (event = trace_next(&trace, &index, "lock"));) {
        if (event->kind != 'R')
            continue;
        if (strcmp(event->name, "status") == 0)
            rig_put(rig, 0x3E00, event->value);
        else if (strncmp(event->name, "pos", 3) == 0)
            rig_put(rig, (uint16_t)(0x4000 + 4 * (event->name[3] - '0')), event->value);
        else if (strncmp(event->name, "vel", 3) == 0)
            rig_put(rig, (uint16_t)(0x3F00 + 4 * (event->name[3] - '0')), event->value);
    }
    trace_free(&trace);
    rig_cycle(rig);
    for (unsigned i = 0; i < 6; i++) {
        char name[32];
        (void)snprintf(name, sizeof name, "resolver.%02u.angle", i);
        const double off = rig_get(rig, name) - angles[i] / 65536;
        assert_true(fabs(off - round(off)) < 0.001);
        (void)snprintf(name, sizeof name, "resolver.%02u.error", i);
        assert_true(rig_get(rig, name) == 0);
    }
    rig_free(rig);
}

static void turns_are_counted_and_velocity_follows_the_excitation(void **state)
{
    (void)state;
    struct module_rig *const rig = started(&hm2_resolver_type, "num_resolvers=2");
    assert_true(rig_has(rig, "resolver.01.angle") && !rig_has(rig, "resolver.02.angle"));
    rig_set(rig, "resolver.00.scale", 2);
    for (unsigned i = 1; i <= 10; i++) {
        rig_put(rig, 0x4000, i * 0x40000000u);
        rig_cycle(rig);
    }
    assert_true(rig_get(rig, "resolver.00.position") == 5.0);
    assert_true(rig_get(rig, "resolver.00.angle") == 0.5);
    assert_int_equal((int)rig_get(rig, "resolver.00.rawcounts"), 5 << 23);
    rig_put(rig, 0x3F00, 327680);
    rig_cycle(rig);
    assert_true(fabs(rig_get(rig, "resolver.00.velocity") - 327680 / 4294967296.0 * 20000) < 1e-9);
    rig_set(rig, "resolver.excitation-khz", 4.5);
    rig_cycle(rig);
    assert_true(rig_get(rig, "resolver.excitation-khz") == 5.0);
    assert_int_equal(rig_written(rig, 0x3C00), 0x802);
    rig_cycle(rig);
    assert_false(rig_wrote(rig, 0x3C00));
    assert_true(fabs(rig_get(rig, "resolver.00.velocity") - 327680 / 4294967296.0 * 10000) < 1e-9);
    rig_put(rig, 0x3E00, 2);
    rig_cycle(rig);
    assert_true(rig_get(rig, "resolver.00.error") == 0 && rig_get(rig, "resolver.01.error") == 1);
    rig_free(rig);
}

static void index_and_reset_of_a_resolver(void **state)
{
    (void)state;
    struct module_rig *const rig = started(&hm2_resolver_type, "");
    rig_put(rig, 0x4000, 0xC0000000);
    rig_cycle(rig);
    rig_set(rig, "resolver.00.index-enable", 1);
    rig_cycle(rig);
    assert_true(rig_get(rig, "resolver.00.index-enable") == 1);
    rig_put(rig, 0x4000, 0x20000000); /* through zero, 0.375 turn on */
    rig_cycle(rig);
    assert_true(rig_get(rig, "resolver.00.index-enable") == 0);
    assert_true(rig_get(rig, "resolver.00.position") == 0.125);
    rig_set(rig, "resolver.00.reset", 1);
    rig_cycle(rig);
    assert_true(rig_get(rig, "resolver.00.position") == 0.0);
    rig_free(rig);
}

/* As LinuxCNC does it: joint = position of the file + position of the resolver. */
static void the_position_file_gives_a_joint_its_place_back(void **state)
{
    (void)state;
    static const struct {
        double scale, file, place; /* when LinuxCNC ended, and of the motor now */
    } rows[] = {{1, 7.3, 7.4}, {1, -7.3, -7.4}, {-3.5, 12, 13}, {20, 5, 1},
                {1, 2.9, 3.1}, {1, 0, 0.125},   {0.5, 1e9, 1e9}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct module_rig *const rig = started(&hm2_resolver_type, "");
        const double turns = rows[i].place / rows[i].scale;
        rig_set(rig, "resolver.00.scale", rows[i].scale);
        rig_set(rig, "resolver.00.use-position-file", 1);
        rig_put(rig, 0x4000, (uint32_t)((turns - floor(turns)) * 4294967295.0));
        for (unsigned cycle = 0; cycle < 4900; cycle++)
            rig_cycle(rig);
        assert_true(rig_get(rig, "resolver.00.position") == 0.0);
        assert_true(rig_get(rig, "resolver.00.use-position-file") == 1);
        rig_set(rig, "resolver.00.joint-pos-fb", rows[i].file);
        for (unsigned cycle = 0; cycle < 200; cycle++)
            rig_cycle(rig);
        assert_true(rig_get(rig, "resolver.00.use-position-file") == 0);
        assert_true(fabs(rows[i].file + rig_get(rig, "resolver.00.position") - rows[i].place) < 1e-6);
        rig_free(rig);
    }
}

static void an_impossible_joint_position_is_not_taken(void **state)
{
    (void)state;
    static const double joints[] = {NAN, INFINITY, -INFINITY};
    struct module_rig *const rig = started(&hm2_resolver_type, "");
    rig_set(rig, "resolver.00.use-position-file", 1);
    rig_put(rig, 0x4000, 0x40000000);
    rig_put(rig, 0x3E00, 1);
    for (size_t i = 0; i < sizeof joints / sizeof joints[0]; i++) {
        rig_set(rig, "resolver.00.joint-pos-fb", joints[i]);
        rig_cycle(rig);
        assert_true(rig_get(rig, "resolver.00.position") == 0.0);
        assert_true(rig_get(rig, "resolver.00.use-position-file") == 1);
        assert_true(rig_get(rig, "resolver.00.error") == 1); /* which is told all the same */
    }
    rig_set(rig, "resolver.00.joint-pos-fb", 1e300);
    rig_cycle(rig);
    assert_true(rig_get(rig, "resolver.00.use-position-file") == 0);
    assert_true(fabs(rig_get(rig, "resolver.00.position")) <= 1.0);
    rig_free(rig);
}

/* Turns are counted from that of the start; the index is where the next one begins, and every third from there. */
static void an_index_is_found_every_few_turns(void **state)
{
    (void)state;
    struct module_rig *const rig = started(&hm2_resolver_type, "");
    unsigned quarters = 1;
    rig_put(rig, 0x4000, quarters << 30);
    rig_cycle(rig);
    rig_set(rig, "resolver.00.index-divisor", 3);
    for (unsigned round = 0; round < 3; round++) {
        rig_set(rig, "resolver.00.index-enable", 1);
        while (rig_get(rig, "resolver.00.index-enable") == 1 && quarters < 100) {
            rig_put(rig, 0x4000, ++quarters << 30);
            rig_cycle(rig);
        }
        assert_int_equal(quarters, 4 + 12 * round);
        assert_true(rig_get(rig, "resolver.00.position") == 0.0);
    }
    rig_set(rig, "resolver.00.index-enable", 1); /* and at the same place on the way back */
    while (rig_get(rig, "resolver.00.index-enable") == 1 && quarters > 0) {
        rig_put(rig, 0x4000, --quarters << 30);
        rig_cycle(rig);
    }
    assert_int_equal(quarters, 4 + 12 * 2 - 1);
    assert_true(rig_get(rig, "resolver.00.position") == -0.25);
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pulse_lengths_follow_the_formula),
        cmocka_unit_test(a_servo_keeps_its_width_while_the_offset_makes_it_impossible),
        cmocka_unit_test(the_rate_of_servos_stays_within_its_limits),
        cmocka_unit_test(one_shot_registers_follow_their_pins),
        cmocka_unit_test(one_shot_control_is_made_of_bits),
        cmocka_unit_test(a_period_is_shown_in_every_unit),
        cmocka_unit_test(settings_of_a_period_meter_stay_within_their_registers),
        cmocka_unit_test(a_simulated_meter_measures_pulses),
        cmocka_unit_test(a_simulated_servo_gets_its_pulses),
        cmocka_unit_test(commands_go_out_when_they_change),
        cmocka_unit_test(feedback_status_and_timers_of_a_galvo),
        cmocka_unit_test(a_scale_that_divides_by_almost_nothing_is_replaced),
        cmocka_unit_test(a_galvo_gets_no_old_position_again),
        cmocka_unit_test(a_simulated_galvo_moves_and_tells_its_limits),
        cmocka_unit_test(recorded_positions_are_the_angles_of_the_bench),
        cmocka_unit_test(turns_are_counted_and_velocity_follows_the_excitation),
        cmocka_unit_test(index_and_reset_of_a_resolver),
        cmocka_unit_test(the_position_file_gives_a_joint_its_place_back),
        cmocka_unit_test(an_impossible_joint_position_is_not_taken),
        cmocka_unit_test(an_index_is_found_every_few_turns),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
