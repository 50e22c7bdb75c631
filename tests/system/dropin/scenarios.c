/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The scripts of tests/system/check_dropin_behaviour.c. */
#include "scenario.h"

#include <math.h>

#include <hm2/idrom.h>

/* Input pins (register map 4.1; lib/sim/sim_inm.c). */
enum {
    TPPWM_FAULT = 0x08,
    ONESHOT_TRIGGER = 0x01,
    ENCODER_PROBE = 0x05,
    STEPGEN_INDEX = 0x09,
    STEPGEN_PROBE = 0x0A,
    INMUX_INPUT = 0x40
};

#define LOCKED 250 /* cycle in which the DPLL has found its phase, whatever the load took */

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))
#define NAMED_SCENARIO(called, script, on, with, length, ...)                                                    \
    {                                                                                                            \
        .name = called, .card = on, .config = with, .cycles = length, .settings = script##_settings,             \
        .setting_count = COUNT(script##_settings), .waves = script##_waves, .wave_count = COUNT(script##_waves), \
        .events = script##_events, .event_count = COUNT(script##_events), __VA_ARGS__                            \
    }
#define SCENARIO(script, on, with, length, ...) NAMED_SCENARIO(#script, script, on, with, length, __VA_ARGS__)
/* The script `settings` for what a card has, or a firmware image. */
#define SETTINGS(of, script, on, with, ...) \
    NAMED_SCENARIO("settings-" of, script, on, with, 2560, .settle = 64, __VA_ARGS__)

#define STEPGEN(n, scale, velocity, acceleration, len, space)                            \
    {0, "stepgen." n ".position-scale", scale}, {0, "stepgen." n ".maxvel", velocity},   \
        {0, "stepgen." n ".maxaccel", acceleration}, {0, "stepgen." n ".steplen", len},  \
        {0, "stepgen." n ".stepspace", space}, {0, "stepgen." n ".dirsetup", 3 * (len)}, \
    {                                                                                    \
        0, "stepgen." n ".dirhold", 2 * (len)                                            \
    }

/* ---- five axes: sines, ramps, reversals, limits, velocity mode, reset, changes of scale and timing on the way */

static const struct setting motion_settings[] = {
    STEPGEN("00", 1000, 200, 10000, 2000, 2000),
    STEPGEN("01", -400, 50, 1000, 5000, 5000),
    STEPGEN("02", 3141.59, 0, 0, 1000, 1000),
    STEPGEN("03", 80, 12.5, 100, 20000, 10000),
    STEPGEN("04", 250, 100, 500, 3000, 4000),
    {0, "watchdog.timeout_ns", 5000000},
    {10, "stepgen.00.enable", 1},
    {10, "stepgen.01.enable", 1},
    {20, "stepgen.02.enable", 1},
    {20, "stepgen.03.enable", 1},
    {5, "stepgen.04.control-type", 1},
    {10, "stepgen.04.enable", 1},
    {700, "stepgen.01.enable", 0},
    {800, "stepgen.01.enable", 1},
    {1200, "stepgen.01.position-scale", 800},
    {1300, "stepgen.00.steplen", 2500},
    {1300, "stepgen.00.stepspace", 1234},
    {1500, "stepgen.02.position-reset", 1},
    {1505, "stepgen.02.position-reset", 0},
    {1800, "stepgen.00.step_type", 1},
    {1850, "stepgen.01.step_type", 2},
    {1900, "stepgen.00.step_type", 0},
    /* While this axis rests (see its wave). */
    {1400, "stepgen.03.dirsetup", 200000}, /* more than the register holds: clamped */
    {1400, "stepgen.03.maxvel", 1e9},      /* more than the step timing permits: clamped */
    {1420, "stepgen.03.maxvel", -30},      /* made positive */
    {1430, "stepgen.03.maxaccel", -400},   /* made positive */
};

static const struct wave motion_waves[] = {
    {"stepgen.00.position-cmd", WAVE_SINE, 10, 0, 1000, 0, 2000},
    {"stepgen.01.position-cmd", WAVE_TRIANGLE, 4, 0, 400, 0, 2000},
    {"stepgen.02.position-cmd", WAVE_SINE, 2.5, 0, 300, 0, 2000},
    {"stepgen.03.position-cmd", WAVE_TRAPEZOID, 5, 0, 1200, 0, 601},
    {"stepgen.03.position-cmd", WAVE_TRAPEZOID, 5, 0, 1200, 1600, 2000},
    {"stepgen.04.velocity-cmd", WAVE_SQUARE, 40, 5, 500, 0, 2000},
};

static const struct event motion_events[] = {
    {1, 0, FOLLOW, 0, 0, 4, 1},
};

/* ---- an encoder: turning both ways, index, reset, scale, filter, quadrature errors, standstill and creeping */

static const struct setting encoder_settings[] = {
    {0, "encoder.00.scale", 100},
    {100, "encoder.00.scale", -250},
    {300, "encoder.00.index-enable", 1},
    {500, "encoder.00.index-invert", 1},
    {520, "encoder.00.index-enable", 1},
    {700, "encoder.00.reset", 1},
    {710, "encoder.00.reset", 0},
    {800, "encoder.00.filter", 0},
    {820, "encoder.sample-frequency", 10000000},
    {850, "encoder.00.quad-error-enable", 1},
    {950, "encoder.00.counter-mode", 1},
    {1000, "encoder.00.counter-mode", 0},
    {1000, "encoder.00.filter", 1},
    {1050, "encoder.hires-timestamp", 1},
    {1300, "encoder.00.vel-timeout", 0.1},
    {1400, "encoder.00.index-mask", 1},
    {1410, "encoder.00.index-mask-invert", 1},
    {1500, "encoder.sample-frequency", 100000000},
    {1600, "encoder.hires-timestamp", 0},
    {1650, "encoder.00.scale", 0}, /* replaced */
};

static const struct wave encoder_waves[] = {
    {"led.CR01", WAVE_SQUARE, 0.5, 0.5, 100, 0, 1800},
};

static const struct event encoder_events[] = {
    {350, 0, INDEX, 0, 1, 0, 0},     {351, 0, INDEX, 0, 0, 0, 0},    {540, 0, INDEX, 0, 1, 0, 0},
    {543, 0, INDEX, 0, 0, 0, 0},     {50, 250, TURN, 0, 7, 0, 0},    {250, 450, TURN, 0, 3, 0, 0},
    {450, 650, TURN, 0, -5, 0, 0},   {650, 780, TURN, 0, 2, 0, 0},   {900, 1000, TURN, 0, 4, 0, 0},
    {1060, 1200, TURN, 0, -9, 0, 0}, {1350, 1390, TURN, 0, 1, 0, 0}, {1420, 1430, TURN, 0, 1, 0, 0},
    {1450, 1455, TURN, 0, 1, 0, 0},  {1700, 1750, TURN, 0, 6, 0, 0},
};

/* ---- outputs and inputs: PWM, SSR, OutM, LEDs, GPIO and filtered inputs */

static const struct setting io_settings[] = {
    {0, "pwmgen.00.scale", 10},
    {10, "pwmgen.00.enable", 1},
    {100, "pwmgen.00.output-type", 2},
    {150, "pwmgen.00.output-type", 3},
    {200, "pwmgen.00.output-type", 4},
    {220, "pwmgen.00.output-type", 7}, /* no such type: replaced */
    {250, "pwmgen.00.offset-mode", 1},
    {300, "pwmgen.pwm_frequency", 100000},
    {320, "pwmgen.pdm_frequency", 6000000},
    {340, "pwmgen.pwm_frequency", 500000}, /* too fast: clamped */
    {360, "pwmgen.pwm_frequency", 0},      /* 1 */
    {380, "pwmgen.00.enable", 0},
    {400, "pwmgen.00.offset-mode", 0},
    {410, "pwmgen.00.enable", 1},
    {420, "pwmgen.pwm_frequency", 20000},
    {100, "ssr.00.rate", 500000},
    {150, "ssr.00.rate", 0},
    {200, "ssr.00.rate", 1},         /* clamped */
    {250, "ssr.00.rate", 100000000}, /* clamped */
    {300, "ssr.00.rate", 1000000},
    {120, "ssr.00.invert-01", 1},
    {130, "ssr.00.invert-02", 1},
    {140, "outm.00.invert-04", 1},
    {50, "gpio.034.is_output", 1},
    {60, "gpio.035.is_output", 1},
    {70, "gpio.035.is_opendrain", 1},
    {80, "gpio.036.is_output", 1},
    {90, "gpio.036.invert_output", 1},
    {200, "gpio.034.is_output", 0},
    {210, "gpio.050.is_output", 1},
    {220, "stepgen.00.step.invert_output", 1},
    {230, "stepgen.00.direction.is_opendrain", 1},
    {100, "inm.00.input-03-slow", 1},
    {250, "inm.00.fast_scans", 20},
    {260, "inm.00.slow_scans", 100},
    {270, "inm.00.fast_scans", 100}, /* clamped */
    {280, "inm.00.scan_rate", 40000},
    {290, "inm.00.slow_scans", 5000},    /* clamped */
    {300, "inm.00.scan_rate", 99999999}, /* clamped */
    {350, "inm.00.enc0_4xmode", 1},
    {500, "inm.00.enc0-reset", 1},
    {510, "inm.00.enc0-reset", 0},
    {10, "raw.read_address", 0x0100},
    {20, "raw.read_address", 0x2000},
    {30, "raw.write_address", 0x2000},
};

static const struct wave io_waves[] = {
    {"pwmgen.00.value", WAVE_SINE, 12, 0, 200, 0, 800},    {"ssr.00.out-00", WAVE_SQUARE, 0.5, 0.5, 14, 0, 800},
    {"ssr.00.out-01", WAVE_SQUARE, 0.5, 0.5, 22, 0, 800},  {"ssr.00.out-03", WAVE_SQUARE, 0.5, 0.5, 6, 0, 800},
    {"outm.00.out-04", WAVE_SQUARE, 0.5, 0.5, 10, 0, 800}, {"outm.00.out-05", WAVE_SQUARE, 0.5, 0.5, 18, 0, 800},
    {"gpio.034.out", WAVE_SQUARE, 0.5, 0.5, 12, 0, 800},   {"gpio.035.out", WAVE_SQUARE, 0.5, 0.5, 16, 0, 800},
    {"gpio.036.out", WAVE_SQUARE, 0.5, 0.5, 20, 0, 800},   {"gpio.050.out", WAVE_SQUARE, 0.5, 0.5, 24, 0, 800},
    {"led.CR02", WAVE_SQUARE, 0.5, 0.5, 30, 0, 800},       {"led.CR04", WAVE_SQUARE, 0.5, 0.5, 50, 0, 800},
};

static const struct event io_events[] = {
    {20, 0, PAD, 0, SIM_LOW, 0, 0},   {40, 0, PAD, 3, SIM_LOW, 0, 0},    {60, 0, PAD, 0, SIM_HIGH, 0, 0},
    {90, 0, PAD, 3, SIM_HIGH, 0, 0},  {110, 0, PAD, 3, SIM_LOW, 0, 0},   {170, 0, PAD, 3, SIM_HIGH, 0, 0},
    {200, 0, PAD, 37, SIM_LOW, 0, 0}, {240, 0, PAD, 37, SIM_HIGH, 0, 0}, {400, 0, PAD, 1, SIM_LOW, 0, 0},
    {420, 0, PAD, 0, SIM_LOW, 0, 0},  {440, 0, PAD, 1, SIM_HIGH, 0, 0},  {460, 0, PAD, 0, SIM_HIGH, 0, 0},
    {480, 0, PAD, 1, SIM_LOW, 0, 0},  {520, 0, PAD, 10, SIM_LOW, 0, 0},  {540, 0, PAD, 0, SIM_LOW, 0, 0},
};

/* ---- the watchdog: writes stop, it bites, recovery once and twice; a time that is too short */

static const struct setting bite_settings[] = {
    STEPGEN("00", 1000, 100, 1000, 2000, 2000),
    {0, "watchdog.timeout_ns", 5000000},
    {0, "gpio.034.is_output", 1},
    {0, "gpio.034.out", 1},
    {0, "gpio.035.is_output", 1},
    {0, "gpio.035.is_opendrain", 1},
    {0, "gpio.036.is_output", 1},
    {0, "gpio.036.invert_output", 1},
    {0, "pwmgen.00.enable", 1},
    {0, "pwmgen.00.value", 0.25},
    {0, "ssr.00.out-02", 1},
    {0, "outm.00.out-05", 1},
    {0, "stepgen.00.enable", 1},
    {0, "encoder.00.scale", 100},
    {200, "watchdog.has_bit", 0},
    {450, "stepgen.00.enable", 0},
    {460, "watchdog.has_bit", 0},
    {500, "stepgen.00.enable", 1},
    {600, "watchdog.timeout_ns", 200000}, /* shorter than a period: bites at once */
    {650, "watchdog.timeout_ns", 20000000},
    {660, "watchdog.has_bit", 0},
    {700, "watchdog.timeout_ns", 4000000000}, /* fits the register */
};

static const struct wave bite_waves[] = {
    {"stepgen.00.position-cmd", WAVE_SINE, 2, 0, 400, 0, 1500},
};

static const struct event bite_events[] = {
    {1, 0, FOLLOW, 0, 0, 4, 1},
    {100, 120, NO_WRITE, 0, 0, 0, 0},
    {400, 410, NO_WRITE, 0, 0, 0, 0},
    {300, 303, NO_WRITE, 0, 0, 0, 0}, /* not long enough to bite */
};

/* ---- lost packets: single ones both ways, some in a row, until the driver gives up; then set going again */

static const struct setting loss_settings[] = {
    STEPGEN("00", 1000, 100, 1000, 2000, 2000),
    STEPGEN("01", 400, 20, 100, 2000, 2000),
    {0, "watchdog.timeout_ns", 30000000},
    {0, "stepgen.00.enable", 1},
    {0, "stepgen.01.control-type", 1},
    {0, "stepgen.01.velocity-cmd", 10},
    {0, "stepgen.01.enable", 1},
    {0, "encoder.00.scale", 4000},
    {0, "pwmgen.00.enable", 1},
    {0, "gpio.034.is_output", 1},
    {700, "packet-error-total", 0},
    {760, "io_error", 0},
    {790, "watchdog.has_bit", 0},
    {900, "packet-error-limit", 4},
    {900, "packet-error-increment", 3},
    {960, "io_error", 0},
    {980, "watchdog.has_bit", 0},
};

static const struct wave loss_waves[] = {
    {"stepgen.00.position-cmd", WAVE_SINE, 2, 0, 400, 0, 1600},
    {"pwmgen.00.value", WAVE_TRIANGLE, 1, 0, 100, 0, 1600},
    {"gpio.034.out", WAVE_SQUARE, 0.5, 0.5, 22, 0, 1600},
};

static const struct event loss_events[] = {
    {1, 0, FOLLOW, 0, 0, 4, 1},
    {100, 101, LOSE_REQUESTS, 0, 0, 0, 0},
    {150, 152, LOSE_REQUESTS, 0, 0, 0, 0},
    {200, 201, LOSE_WRITES, 0, 0, 0, 0},
    {250, 253, LOSE_WRITES, 0, 0, 0, 0},
    {300, 301, LOSE_REQUESTS, 0, 0, 0, 0},
    {302, 303, LOSE_REQUESTS, 0, 0, 0, 0},
    {720, 726, LOSE_REQUESTS, 0, 0, 0, 0},
    {720, 726, LOSE_WRITES, 0, 0, 0, 0},
    {920, 922, LOSE_REQUESTS, 0, 0, 0, 0},
};

/* ---- sampling by the DPLL's timers */

static const struct setting dpll_settings[] = {
    STEPGEN("00", 1000, 100, 1000, 2000, 2000),
    {0, "stepgen.00.enable", 1},
    {0, "encoder.00.scale", 4000},
    {50, "dpll.01.timer-us", -100},
    {60, "stepgen.timer-number", 1},
    {100, "encoder.timer-number", 1},
    {300, "dpll.02.timer-us", 50},
    {310, "dpll.03.timer-us", -7.5},
    {320, "dpll.04.timer-us", 0},
    {400, "stepgen.timer-number", 2},
    {450, "stepgen.timer-number", 9}, /* no such timer: 0 */
    {500, "stepgen.timer-number", -1},
    {510, "encoder.timer-number", 0},
    {600, "dpll.time-const", 4000},
    {610, "dpll.plimit", 0x200000},
    {620, "dpll.base-freq-khz", 2},
    {650, "dpll.base-freq-khz", 1},
};

static const struct wave dpll_waves[] = {
    {"stepgen.00.position-cmd", WAVE_SINE, 3, 0, 400, 0, 800},
};

static const struct event dpll_events[] = {
    {1, 0, FOLLOW, 0, 0, 4, 1},
};

/* ---- a 7I49: six resolvers, three of them on motors; index, reset, scales, excitation, a signal that goes away */

static const struct setting resolver_settings[] = {
    {0, "pwmgen.00.enable", 1},
    {0, "pwmgen.02.enable", 1},
    {0, "pwmgen.05.enable", 1},
    {0, "resolver.02.scale", -3.5},
    {0, "resolver.05.velocity-scale", 60},
    {200, "resolver.00.index-enable", 1},
    {300, "resolver.02.reset", 1},
    {310, "resolver.02.reset", 0},
    {400, "resolver.05.index-divisor", 3},
    {400, "resolver.05.index-enable", 1},
    {600, "resolver.excitation-khz", 5},
    {650, "resolver.03.use-position-file", 1},
    {650, "resolver.04.use-position-file", 1},
    {660, "resolver.03.joint-pos-fb", 7.3},
    {670, "resolver.04.joint-pos-fb", -12.8},
    {800, "resolver.excitation-khz", 2},
    {900, "resolver.excitation-khz", 9},
};

static const struct wave resolver_waves[] = {
    {"pwmgen.00.value", WAVE_SINE, 1, 0, 500, 100, 1200},
    {"pwmgen.02.value", WAVE_TRIANGLE, 0.7, -0.1, 300, 100, 1200},
    {"pwmgen.05.value", WAVE_TRAPEZOID, 0.5, 0.4, 400, 100, 1200},
};

static const struct event resolver_events[] = {
    {1, 0, RESOLVER, 0, 250, 900, 10000}, {1, 0, RESOLVER, 2, 0, 900, -5000}, {1, 0, RESOLVER, 5, -125, 900, 20000},
    {1, 0, RESOLVER, 1, 300, 900, 0},     {400, 0, RESOLVER, 1, 300, 0, 0},   {500, 0, RESOLVER, 1, 350, 900, 0},
    {1, 0, RESOLVER, 4, -450, 500, 0},
};

/* ---- a 7I93: four step generators, each with an encoder, and eight PWM generators */

static const struct setting servo_settings[] = {
    STEPGEN("00", 1000, 100, 2000, 2000, 2000),
    STEPGEN("01", 500, 100, 2000, 2000, 2000),
    STEPGEN("02", -2000, 40, 500, 1000, 1000),
    STEPGEN("03", 100, 50, 200, 3000, 3000),
    {5, "stepgen.00.enable", 1},
    {5, "stepgen.01.enable", 1},
    {5, "stepgen.02.enable", 1},
    {5, "stepgen.03.enable", 1},
    {0, "encoder.00.scale", 4000},
    {0, "encoder.01.scale", -2000},
    {0, "encoder.02.scale", 500},
    {0, "encoder.07.scale", 200},
    {300, "encoder.03.index-enable", 1},
    {300, "encoder.07.index-enable", 1},
    {600, "encoder.06.reset", 1},
    {610, "encoder.06.reset", 0},
    {0, "pwmgen.00.enable", 1},
    {0, "pwmgen.03.enable", 1},
    {0, "pwmgen.03.output-type", 2},
    {0, "pwmgen.05.enable", 1},
    {0, "pwmgen.05.output-type", 3},
    {0, "pwmgen.06.enable", 1},
    {0, "pwmgen.06.output-type", 4},
    {0, "pwmgen.07.enable", 1},
    {0, "pwmgen.07.offset-mode", 1},
    {0, "pwmgen.07.scale", -10},
};

static const struct wave servo_waves[] = {
    {"stepgen.00.position-cmd", WAVE_SINE, 5, 0, 500, 0, 1500},
    {"stepgen.01.position-cmd", WAVE_TRIANGLE, 5, 1, 700, 0, 1500},
    {"stepgen.02.position-cmd", WAVE_TRAPEZOID, 1, 0, 900, 0, 1500},
    {"stepgen.03.position-cmd", WAVE_SINE, 4, -2, 1100, 0, 1500},
    {"pwmgen.00.value", WAVE_SINE, 1.2, 0, 300, 0, 1500},
    {"pwmgen.03.value", WAVE_TRIANGLE, 1, 0, 200, 0, 1500},
    {"pwmgen.05.value", WAVE_SINE, 0.9, 0.1, 170, 0, 1500},
    {"pwmgen.06.value", WAVE_TRAPEZOID, 1, 0, 230, 0, 1500},
    {"pwmgen.07.value", WAVE_SINE, 11, 0, 310, 0, 1500},
};

/* Index pulses come before the edges of their cycle: with them it would be a race which of the two counts first. */
static const struct event servo_events[] = {
    {350, 0, INDEX, 3, 1, 0, 0},   {352, 0, INDEX, 3, 0, 0, 0},   {400, 0, INDEX, 7, 1, 0, 0},
    {401, 0, INDEX, 7, 0, 0, 0},   {1, 0, FOLLOW, 0, 0, 4, 1},    {1, 0, FOLLOW, 1, 1, 4, 1},
    {1, 0, FOLLOW, 2, 2, 1, 1},    {1, 0, FOLLOW, 4, 3, 10, 1},   {100, 700, TURN, 3, 2, 0, 0},
    {100, 500, TURN, 7, -3, 0, 0}, {500, 1500, TURN, 6, 1, 0, 0},
};

/* ---- a 7I65: analog outputs, inputs, enables, and its multiplexed encoders */

#define ANALOG(n, shape, amplitude, offset, period)                                 \
    {                                                                               \
        "mesa-7i65.0.analogue." n ".out", shape, amplitude, offset, period, 0, 1200 \
    }

static const struct setting octal_settings[] = {
    {0, "watchdog.timeout_ns", 20000000}, {0, "encoder.00.scale", 4000},        {0, "encoder.07.scale", -100},
    {20, "mesa-7i65.0.enable.0.out", 1},  {20, "mesa-7i65.0.enable.3.out", 1},  {25, "mesa-7i65.0.enable.7.out", 1},
    {40, "mesa-7i65.0.enable.3.out", 0},  {100, "mesa-7i65.0.scale-1", 5},      {100, "mesa-7i65.0.scale-2", -7.5},
    {100, "mesa-7i65.0.scale-3", 0},      {100, "mesa-7i65.0.scale-4", 12}, /* clamped */
    {100, "mesa-7i65.0.scale-5", -40},                                      /* clamped */
    {200, "mesa-7i65.0.is-bipolar-0", 0}, {200, "mesa-7i65.0.is-bipolar-2", 0}, {300, "mesa-7i65.0.is-bipolar-0", 1},
    {400, "encoder.07.index-enable", 1},  {600, "encoder.15.reset", 1},         {610, "encoder.15.reset", 0},
};

static const struct wave octal_waves[] = {
    ANALOG("0", WAVE_SINE, 1, 0, 200),       ANALOG("1", WAVE_TRIANGLE, 1, 0, 300),
    ANALOG("2", WAVE_SINE, 0.9, 0.05, 170),  ANALOG("3", WAVE_SQUARE, 0.5, 0.1, 50),
    ANALOG("4", WAVE_SINE, 1.5, 0, 250),     ANALOG("5", WAVE_TRAPEZOID, 1, 0, 400),
    ANALOG("6", WAVE_RAMP, 2.5, -1.25, 500), ANALOG("7", WAVE_SQUARE, 1, 0, 14),
};

static const struct event octal_events[] = {
    {50, 0, SERVO_VOLTS, 0, 5000, 0, 0},   {60, 0, SERVO_VOLTS, 1, 9990, 0, 0}, {70, 0, SERVO_VOLTS, 2, 1, 0, 0},
    {80, 0, SERVO_VOLTS, 7, 2500, 0, 0},   {90, 0, SERVO_INPUTS, 0x5, 0, 0, 0}, {150, 0, SERVO_INPUTS, 0xA, 0, 0, 0},
    {300, 0, SERVO_VOLTS, 4, -2500, 0, 0}, {350, 0, SERVO_VOLTS, 4, 0, 0, 0},   {50, 700, TURN, 0, 3, 0, 0},
    {100, 900, TURN, 7, -2, 0, 0},         {420, 0, INDEX, 7, 1, 0, 0},         {422, 0, INDEX, 7, 0, 0, 0},
    {200, 1000, TURN, 15, 1, 0, 0},
};

/* ---- absolute encoders, started by DPLL timers, as LinuxCNC's other start is a function of its own. A high part
 * before its low part ends the process with LinuxCNC's driver. */

static const struct setting absolute_settings[] = {
    {0, "watchdog.timeout_ns", 20000000},
    {0, "dpll.01.timer-us", -300},
    {0, "dpll.02.timer-us", -400},
    {0, "dpll.04.timer-us", -200},
    {0, "ssi.00.timer-number", 1},
    {0, "ssi.01.timer-number", 2},
    {0, "biss.01.timer-number", 1},
    {200, "ssi.01.pos.scale", 400},
    {300, "ssi.00.frequency-khz", 1000},
    {350, "ssi.00.a-scalemax", 10},
    {350, "ssi.00.d-scalemax", 3},
    {400, "ssi.01.pos.counts-per-rev", 1000},
    {450, "biss.01.frequency-khz", 1000},
    {460, "biss.01.turns.scale", -50},
    {500, "ssi.00.timer-number", 9}, /* clamped */
    {550, "ssi.00.timer-number", 1},
    {600, "ssi.01.frequency-khz", 250},
    {650, "ssi.01.pos.reset", 1},
    {660, "ssi.01.pos.reset", 0},
    {700, "biss.01.turns.reset", 1},
    {701, "biss.01.turns.reset", 0},
    {750, "biss.01.turns.counts-per-rev", 10000},
    {760, "biss.01.turns.index-enable", 1},
    {1150, "ssi.01.pos.index-enable", 1},
};

static const struct wave absolute_waves[] = {
    {"led.CR03", WAVE_SQUARE, 0.5, 0.5, 100, 0, 1200},
};

static const struct event absolute_events[] = {
    {0, 800, ABSOLUTE, HM2_GTAG_SSI, 0, 30, 1234567},  {0, 1200, ABSOLUTE_GRAY, HM2_GTAG_SSI, 1, 25, -37},
    {0, 1100, ABSOLUTE, HM2_GTAG_BISS, 1, 30, 4321},   {800, 0, ABSOLUTE, HM2_GTAG_SSI, 0, 0, 0},
    {900, 1200, ABSOLUTE, HM2_GTAG_SSI, 0, 30, 77777}, {1100, 0, ABSOLUTE, HM2_GTAG_BISS, 1, 0, 0},
};

/* ---- the same for Fanuc. LinuxCNC's driver writes the control word over length and rate, which the sources of 2021
 * ignore; those would not start its BISS by a timer. */

static const struct setting fanuc_settings[] = {
    {0, "watchdog.timeout_ns", 20000000},    {0, "dpll.01.timer-us", -300},
    {0, "dpll.02.timer-us", -400},           {0, "fanuc.00.timer-number", 1},
    {0, "fanuc.01.timer-number", 1},         {400, "fanuc.00.timer-number", 2},
    {500, "fanuc.00.encoder.scale", 65536},  {600, "fanuc.01.low-scalemax", 65535},
    {600, "fanuc.01.middle-scalemax", -100}, {700, "fanuc.00.encoder.reset", 1},
    {710, "fanuc.00.encoder.reset", 0},      {720, "fanuc.00.encoder.index-enable", 1},
};

static const struct wave fanuc_waves[] = {
    {"led.CR03", WAVE_SQUARE, 0.5, 0.5, 100, 0, 1000},
};

static const struct event fanuc_events[] = {
    {0, 800, ABSOLUTE, HM2_GTAG_FABS, 0, 76, 10000001},
    {0, 1000, ABSOLUTE, HM2_GTAG_FABS, 1, 76, 1000001},
    {800, 0, ABSOLUTE, HM2_GTAG_FABS, 0, 0, 0},
    {900, 1000, ABSOLUTE, HM2_GTAG_FABS, 0, 76, 10000001},
};

/* ---- three-phase PWM, RC servos and a galvo interface: limits, settings, a fault, enabling and disabling */

static const struct setting drives_settings[] = {
    {0, "watchdog.timeout_ns", 20000000},
    {10, "3pwmgen.00.enable", 1},
    {10, "3pwmgen.01.enable", 1},
    {50, "3pwmgen.00.scale", 24},
    {100, "3pwmgen.00.deadtime", 1500},
    {120, "3pwmgen.00.deadtime", -100},      /* 0 */
    {140, "3pwmgen.00.deadtime", 100000000}, /* clamped */
    {160, "3pwmgen.00.deadtime", 2000},
    {180, "3pwmgen.frequency", 40000},
    {200, "3pwmgen.frequency", 1000000}, /* clamped */
    {220, "3pwmgen.frequency", 20000},
    {240, "3pwmgen.01.sample-time", 0.25},
    {260, "3pwmgen.01.fault-invert", 1},
    {300, "3pwmgen.01.fault-invert", 0},
    {320, "3pwmgen.01.enable", 0},
    {330, "3pwmgen.01.enable", 1},
    {400, "3pwmgen.00.enable", 0},
    {100, "rcpwmgen.01.scale", 2},
    {150, "rcpwmgen.01.offset", 1.5},
    {200, "rcpwmgen.rate", 100},
    {250, "rcpwmgen.rate", 5000}, /* clamped */
    {300, "rcpwmgen.rate", 333},
    {350, "rcpwmgen.00.scale", 0}, /* 1 */
    {20, "xy2mod.00.enable", 1},
    {20, "xy2mod.00.posx-scale", 100},
    {20, "xy2mod.00.posy-scale", -50},
    {200, "xy2mod.00.velx-cmd", 20},
    {220, "xy2mod.00.velx-cmd", -20},
    {240, "xy2mod.00.velx-cmd", 0},
    {300, "xy2mod.00.accy-cmd", 1000},
    {320, "xy2mod.00.accy-cmd", -1000},
    {340, "xy2mod.00.accy-cmd", 0},
    {400, "xy2mod.00.18bitmodex", 1},
    {420, "xy2mod.00.controlx", 9}, /* 1 */
    {440, "xy2mod.00.commandmodey", 1},
    {440, "xy2mod.00.commandy", 0x12345}, /* 0x2345 */
    {500, "xy2mod.00.enable", 0},
    {520, "xy2mod.00.enable", 1},
};

static const struct wave drives_waves[] = {
    {"3pwmgen.00.A-value", WAVE_SINE, 1, 0, 100, 0, 600},
    {"3pwmgen.00.B-value", WAVE_SINE, 0.9, 0, 130, 0, 600},
    {"3pwmgen.00.C-value", WAVE_TRIANGLE, 0.99, 0, 70, 0, 600},
    {"3pwmgen.01.A-value", WAVE_SQUARE, 2, 0, 40, 0, 600},
    {"3pwmgen.01.B-value", WAVE_RAMP, 0.5, 0.1, 90, 0, 600},
    {"rcpwmgen.00.width", WAVE_TRIANGLE, 0.5, 1.5, 200, 0, 340},
    {"rcpwmgen.01.width", WAVE_SINE, 1, 0.5, 300, 0, 600},
    {"xy2mod.00.posx-cmd", WAVE_SINE, 90, 0, 120, 0, 180},
    {"xy2mod.00.posy-cmd", WAVE_TRIANGLE, 40, 0, 90, 0, 280},
};

static const struct event drives_events[] = {
    {340, 0, INPUT, HM2_GTAG_TPPWM, 0, TPPWM_FAULT, 1},
    {360, 0, INPUT, HM2_GTAG_TPPWM, 0, TPPWM_FAULT, 0},
};

/* ---- a 7I77: field inputs and outputs, analog inputs and encoders of one remote, analog outputs of the other. Smart
 * serial is set going by the first cycles; nothing is compared before. */

static const struct setting remote_settings[] = {
    {0, "watchdog.timeout_ns", 20000000},
    {0, "7i77.0.1.analogout0-scalemax", 20},
    {0, "7i77.0.1.analogout0-minlim", -15},
    {0, "7i77.0.1.analogout1-maxlim", 5},
    {70, "7i77.0.1.analogena", 1},
    {75, "7i77.0.1.spinena", 1},
    {300, "7i77.0.0.output-03-invert", 1},
    {350, "7i77.0.1.analogout0-scalemax", 10},
    {400, "7i77.0.0.analogin0-scalemax", 20},
    {400, "7i77.0.0.enc0.scale", -4},
    {450, "7i77.0.0.enc0.reset", 1},
    {460, "7i77.0.0.enc0.reset", 0},
};

static const struct wave remote_waves[] = {
    {"7i77.0.1.analogout0", WAVE_SINE, 22, 0, 200, 0, 600},
    {"7i77.0.1.analogout1", WAVE_TRIANGLE, 9, 1, 130, 0, 600},
    {"7i77.0.1.analogout5", WAVE_SQUARE, 10, 0, 50, 0, 600},
    {"7i77.0.0.output-03", WAVE_SQUARE, 0.5, 0.5, 22, 0, 600},
    {"7i77.0.0.output-15", WAVE_SQUARE, 0.5, 0.5, 34, 0, 600},
};

static const struct event remote_events[] = {
    {100, 0, REMOTE, 0, REMOTE_INPUT, 5000, 0},        {150, 0, REMOTE, 0, REMOTE_INPUT, 0x8000A * 1000, 0},
    {200, 0, REMOTE, 0, REMOTE_ANALOG_IN_0, 12000, 0}, {210, 0, REMOTE, 0, REMOTE_ANALOG_IN_3, 3000, 0},
    {250, 0, REMOTE, 0, REMOTE_ENCODER_0, 40000, 0},   {260, 0, REMOTE, 0, REMOTE_ENCODER_0, 250000, 0},
    {480, 0, REMOTE, 0, REMOTE_ENCODER_0, 30000, 0},
};

/* ---- latching by index and by probe, of step generators and of encoders: both edges, armed and not */

#define LATCH_ENCODER_PROBE(cycle, level)                           \
    {                                                               \
        cycle, 0, INPUT, HM2_GTAG_ENCODER, 0, ENCODER_PROBE, level, \
    }
#define LATCH_STEPGEN(cycle, unit, pin, level)               \
    {                                                        \
        cycle, 0, INPUT, HM2_GTAG_STEPGEN, unit, pin, level, \
    }

static const struct setting latch_settings[] = {
    STEPGEN("00", 1000, 100, 2000, 2000, 2000),
    STEPGEN("01", -500, 100, 2000, 2000, 2000),
    {0, "watchdog.timeout_ns", 20000000},
    {0, "encoder.00.scale", 400},
    {5, "stepgen.00.control-type", 1},
    {5, "stepgen.01.control-type", 1},
    {5, "stepgen.00.velocity-cmd", 7},
    {5, "stepgen.01.velocity-cmd", 3},
    {5, "stepgen.00.enable", 1},
    {5, "stepgen.01.enable", 1},
    {50, "stepgen.00.index-enable", 1},
    {50, "stepgen.01.probe-enable", 1},
    {50, "encoder.00.probe-enable", 1},
    {120, "stepgen.00.index-invert", 1},
    {120, "stepgen.01.probe-invert", 1},
    {120, "encoder.00.probe-invert", 1},
    {150, "stepgen.00.index-enable", 1},
    {150, "stepgen.01.probe-enable", 1},
    {150, "encoder.00.probe-enable", 1},
    {220, "stepgen.00.velocity-cmd", -7},
    {300, "stepgen.00.probe-enable", 1},
    {300, "stepgen.01.index-enable", 1},
    {400, "encoder.00.index-enable", 1},
};

static const struct wave latch_waves[] = {
    {"led.CR03", WAVE_SQUARE, 0.5, 0.5, 100, 0, 500},
};

static const struct event latch_events[] = {
    {1, 500, TURN, 0, 4, 0, 0},
    /* high and low while nothing is armed, then the falling edges, then the rising ones */
    LATCH_STEPGEN(20, 0, STEPGEN_INDEX, 1),
    LATCH_STEPGEN(30, 0, STEPGEN_INDEX, 0),
    LATCH_STEPGEN(40, 0, STEPGEN_INDEX, 1),
    LATCH_STEPGEN(80, 0, STEPGEN_INDEX, 0),
    LATCH_STEPGEN(180, 0, STEPGEN_INDEX, 1),
    LATCH_STEPGEN(190, 0, STEPGEN_INDEX, 0),
    LATCH_STEPGEN(20, 1, STEPGEN_PROBE, 1),
    LATCH_STEPGEN(85, 1, STEPGEN_PROBE, 0),
    LATCH_STEPGEN(185, 1, STEPGEN_PROBE, 1),
    LATCH_STEPGEN(200, 1, STEPGEN_PROBE, 0),
    LATCH_STEPGEN(310, 0, STEPGEN_PROBE, 1),
    LATCH_STEPGEN(330, 0, STEPGEN_PROBE, 0),
    LATCH_STEPGEN(310, 1, STEPGEN_INDEX, 1),
    LATCH_STEPGEN(340, 1, STEPGEN_INDEX, 0),
    LATCH_ENCODER_PROBE(20, 1),
    LATCH_ENCODER_PROBE(90, 0),
    LATCH_ENCODER_PROBE(190, 1),
    LATCH_ENCODER_PROBE(210, 0),
    {420, 0, INDEX, 0, 1, 0, 0},
    {430, 0, INDEX, 0, 0, 0, 0},
};

/* ---- one-shots: every source of a trigger, both edges, filters, pulses that begin anew, reset, and impossible
 * settings. A cycle reads 0.6 ms after it wrote; no pulse ends near that. */

static const struct setting shots_settings[] = {
    {0, "watchdog.timeout_ns", 20000000},
    {5, "oneshot.00.width1", 2.3},
    {5, "oneshot.00.width2", 5.3},
    {5, "oneshot.00.filter1", 0.05},
    {5, "oneshot.00.filter2", 1.55},
    {5, "oneshot.00.trigger_on_rise1", 1},
    {5, "oneshot.00.enable1", 1},
    {10, "oneshot.00.trigger_select1", 1},
    {20, "oneshot.00.swtrigger1", 1},
    {25, "oneshot.00.swtrigger1", 0},
    {30, "oneshot.00.trigger_on_fall1", 1},
    {35, "oneshot.00.swtrigger1", 1},
    {40, "oneshot.00.swtrigger1", 0},
    {50, "oneshot.00.width1", 9.3},
    {60, "oneshot.00.swtrigger1", 1}, /* and ended by a reset */
    {63, "oneshot.00.reset1", 1},
    {64, "oneshot.00.reset1", 0},
    {70, "oneshot.00.retriggerable1", 1},
    {80, "oneshot.00.swtrigger1", 0}, /* begins anew in its middle */
    {85, "oneshot.00.swtrigger1", 1},
    {110, "oneshot.00.trigger_select1", 2},
    {120, "oneshot.00.trigger_select2", 5}, /* the first pulse triggers the second, with its end */
    {120, "oneshot.00.trigger_on_fall2", 1},
    {120, "oneshot.00.enable2", 1},
    {180, "oneshot.00.trigger_select2", 2},
    {220, "oneshot.00.enable1", 0}, /* no trigger is obeyed */
    {220, "oneshot.00.swtrigger1", 1},
    {230, "oneshot.00.enable1", 1},
    {240, "oneshot.00.rate", 500}, /* and a pulse that is longer than the pause between triggers */
    {240, "oneshot.00.trigger_select1", 4},
    {260, "oneshot.00.trigger_select1", 0},
    {270, "oneshot.00.dpll_timer_number", 1},
    {270, "oneshot.00.trigger_select1", 3},
    {290, "oneshot.00.trigger_select1", 0},
    {300, "oneshot.00.dpll_timer_number", 7}, /* no such timer */
    {310, "oneshot.00.trigger_select1", 9},   /* no such source */
    {320, "oneshot.00.width1", -1},
    {320, "oneshot.00.filter1", -1},
    {330, "oneshot.00.width1", 1e9},
    {330, "oneshot.00.filter1", 1e9},
    {340, "oneshot.00.rate", -1},
    {350, "oneshot.00.rate", 1e12},
};

static const struct wave shots_waves[] = {
    {"led.CR03", WAVE_SQUARE, 0.5, 0.5, 100, 0, 400},
};

#define TRIGGER(cycle, shot, level)                                              \
    {                                                                            \
        cycle, 0, INPUT, HM2_GTAG_ONESHOT, 0, ONESHOT_TRIGGER + (shot)-1, level, \
    }

static const struct event shots_events[] = {
    TRIGGER(15, 1, 1),  TRIGGER(18, 1, 0),  TRIGGER(115, 1, 1), TRIGGER(118, 1, 0), TRIGGER(140, 1, 1),
    TRIGGER(160, 1, 0), TRIGGER(190, 2, 1), TRIGGER(191, 2, 0), TRIGGER(200, 2, 1), TRIGGER(210, 2, 0),
};

/* ---- inputs behind multiplexers: levels, filters, slow and fast, a handwheel, settings good and impossible */

#define MUXED(cycle, input, level)                                          \
    {                                                                       \
        cycle, 0, INPUT, HM2_GTAG_INMUX, 0, INMUX_INPUT + (input), !(level) \
    }
/* Inputs are on when low. A turn of four edges at inputs 0 and 1. */
#define HANDWHEEL(cycle) \
    MUXED(cycle, 1, 1), MUXED((cycle) + 5, 0, 1), MUXED((cycle) + 10, 1, 0), MUXED((cycle) + 15, 0, 0)

static const struct setting muxed_settings[] = {
    {0, "watchdog.timeout_ns", 20000000}, {50, "inmux.00.input-05-slow", 1},  {60, "inmux.00.enc0_4xmode", 1},
    {200, "inmux.00.slow_scans", 100},    {210, "inmux.00.fast_scans", 20},   {220, "inmux.00.scan_rate", 40000},
    {300, "inmux.00.fast_scans", 100},    {310, "inmux.00.slow_scans", 5000}, {320, "inmux.00.scan_rate", 99999999},
    {330, "inmux.00.fast_scans", 5},      {330, "inmux.00.slow_scans", 50},   {330, "inmux.00.scan_rate", 20000},
    {400, "inmux.00.enc0-reset", 1},      {410, "inmux.00.enc0-reset", 0},
};

static const struct wave muxed_waves[] = {
    {"led.CR03", WAVE_SQUARE, 0.5, 0.5, 100, 0, 500},
};

static const struct event muxed_events[] = {
    MUXED(5, 0, 0),   MUXED(5, 1, 0),    MUXED(20, 3, 1),  MUXED(30, 15, 1), MUXED(60, 5, 1), MUXED(61, 4, 1),
    MUXED(62, 4, 0),  MUXED(90, 15, 0),  HANDWHEEL(100),   HANDWHEEL(120),   HANDWHEEL(140),  MUXED(230, 5, 0),
    MUXED(240, 7, 1), MUXED(390, 12, 1), MUXED(360, 5, 1), HANDWHEEL(380),   HANDWHEEL(420),
};

/* ---- the same for a card with nothing but ports, whose pads are driven, too */

static const struct setting ports_settings[] = {
    {0, "watchdog.timeout_ns", 100000000},
};

static const struct wave ports_waves[] = {
    {"led.CR03", WAVE_SQUARE, 0.5, 0.5, 100, 0, 1280},
};

static const struct event ports_events[] = {
    {100, 0, PAD, 0, SIM_LOW, 0, 0},  {200, 0, PAD, 23, SIM_LOW, 0, 0}, {300, 0, PAD, 24, SIM_LOW, 0, 0},
    {400, 0, PAD, 71, SIM_LOW, 0, 0}, {500, 0, PAD, 0, SIM_HIGH, 0, 0}, {600, 0, PAD, 71, SIM_HIGH, 0, 0},
};

/* ---- the first axis once more, slower, with a card whose processor takes its time */

static const struct setting paced_settings[] = {
    STEPGEN("00", 1000, 100, 1000, 2000, 2000),
    {0, "stepgen.00.enable", 1},
    {0, "encoder.00.scale", 4000},
};

static const struct wave paced_waves[] = {
    {"stepgen.00.position-cmd", WAVE_SINE, 5, 0, 1500, 0, 2000},
};

static const struct event paced_events[] = {
    {1, 0, FOLLOW, 0, 0, 4, 1},
};

/* ---- every setting there is, with good and with impossible values: what the drivers make of them once they rest */

static const struct setting settings_settings[] = {
    {0, "watchdog.timeout_ns", 100000000},
};

/* No numbers, after the last draw. */
static const struct setting no_numbers_settings[] = {
    {0, "watchdog.timeout_ns", 100000000}, {2500, "pwmgen.00.enable", 1},         {2500, "pwmgen.00.value", NAN},
    {2500, "encoder.00.scale", NAN},       {2500, "encoder.00.vel-timeout", NAN}, {2500, "dpll.01.timer-us", NAN},
    {2500, "dpll.02.timer-us", INFINITY},  {2500, "dpll.03.timer-us", -INFINITY},
};

static const struct wave settings_waves[] = {
    {"led.CR01", WAVE_SQUARE, 0.5, 0.5, 100, 0, 2560},
};

static const struct event settings_events[] = {
    {1, 0, PAD, 3, SIM_LOW, 0, 0},
};

#define no_numbers_waves  settings_waves
#define no_numbers_events settings_events

static const char *const settings_keeps[] = {
    "packet-read-timeout",      /* replies would come too late */
    "packet-error-total",       /* the link's own */
    "packet-error-decrement",   /* LinuxCNC's cannot be set */
    "io_error",                 /* nothing else would be compared */
    "rtt-reset",                /* LinuxCNC has none */
    "watchdog.timeout_ns",      /* it would bite */
    "encoder.sample-frequency", /* LinuxCNC's driver divides by it, and by what it becomes: that ends the process */
    "stepgen.??.step_type",     /* LinuxCNC's driver writes beyond its memory for long tables */
    "stepgen.??.enable",        /* nothing shall move */
    "raw.write_*",              /* no register that either does not know of */
    NULL,
};

/* ---- the same for the settings of other modules, without those that the first cards have shown; what a draw does not
 * bring comes after the last one */

#define others_settings settings_settings

static const struct setting drives_impossible_settings[] = {
    {0, "watchdog.timeout_ns", 100000000}, {2500, "xy2mod.00.enable", 1},
    {2500, "xy2mod.00.posx-scale", 1e-7},  {2500, "xy2mod.00.posy-scale", -1e-7},
    {2500, "xy2mod.00.posx-cmd", 0.5},     {2500, "xy2mod.00.posy-cmd", NAN},
    {2500, "xy2mod.00.velx-cmd", 0},       {2500, "xy2mod.00.vely-cmd", 0},
    {2500, "xy2mod.00.accx-cmd", 0},       {2500, "xy2mod.00.accy-cmd", INFINITY},
    {2500, "xy2mod.read-timer-number", 5}, {2500, "xy2mod.write-timer-number", -2},
    {2500, "rcpwmgen.00.scale", 0},        {2500, "rcpwmgen.01.width", NAN},
    {2550, "3pwmgen.frequency", 0},
};

static const struct wave others_waves[] = {
    {"led.CR03", WAVE_SQUARE, 0.5, 0.5, 100, 0, 2560},
};

#define others_events settings_events

#define drives_impossible_waves  others_waves
#define drives_impossible_events others_events

/* A multiplexed encoder turns, at the full sample frequency. */
static const struct event turning_events[] = {
    {1, 2560, TURN, 0, 3, 0, 0},
};

#define turning_settings others_settings
#define turning_waves    others_waves

static const struct setting sensors_settings[] = {
    {0, "watchdog.timeout_ns", 100000000}, {0, "dpll.01.timer-us", -300},  {0, "dpll.02.timer-us", -400},
    {0, "dpll.03.timer-us", -250},         {0, "dpll.04.timer-us", -200},  {0, "ssi.00.timer-number", 1},
    {0, "ssi.01.timer-number", 2},         {0, "biss.01.timer-number", 1},
};

static const struct event sensors_events[] = {
    {0, 2560, ABSOLUTE, HM2_GTAG_SSI, 0, 30, 1234567},
    {0, 2560, ABSOLUTE_GRAY, HM2_GTAG_SSI, 1, 25, -37},
    {0, 2560, ABSOLUTE, HM2_GTAG_BISS, 1, 30, 4321},
};

#define sensors_waves others_waves

static const struct setting fanucs_settings[] = {
    {0, "watchdog.timeout_ns", 100000000}, {0, "dpll.01.timer-us", -300}, {0, "dpll.02.timer-us", -400},
    {0, "dpll.03.timer-us", -350},         {0, "dpll.04.timer-us", -450}, {0, "fanuc.00.timer-number", 1},
    {0, "fanuc.01.timer-number", 1},
};

static const struct event fanucs_events[] = {
    {0, 2560, ABSOLUTE, HM2_GTAG_FABS, 0, 76, 10000001},
    {0, 2560, ABSOLUTE, HM2_GTAG_FABS, 1, 76, 1000001},
};

#define fanucs_waves others_waves

/* Slow three-phase PWM is simulated clock by clock; LinuxCNC's driver divides by counts-per-rev and by what it makes of
 * frequency-khz. */
#define OTHERS_KEEP                                                                                          \
    "packet-*", "io_error", "rtt-reset", "watchdog.timeout_ns", "dpll.*", "gpio.*", "stepgen.*", "pwmgen.*", \
        "sserial.*", "*.invert_output", "*.is_opendrain", "3pwmgen.??.phase*", "resolver.??.refpdm*",        \
        "3pwmgen.frequency", "*.counts-per-rev", "*.frequency-khz"

static const char *const others_keeps[] = {OTHERS_KEEP, NULL};
static const char *const turning_keeps[] = {OTHERS_KEEP, "encoder.muxed-sample-frequency", "encoder.timer-number",
                                            NULL};

const struct scenario scenarios[] = {
    SCENARIO(motion, "7i96s", "num_stepgens=5", 2000,
             .reached = {{"stepgen.04.counts", 1000}, {"encoder.00.count", 20000}}),
    SCENARIO(encoder, "7i96s", "", 1800, .reached = {{"encoder.00.index-enable", 1}, {"encoder.00.velocity", 100}}),
    SCENARIO(io, "7i96s", "enable_raw num_stepgens=1", 800,
             .reached = {{"inm.00.enc0-count", 1}, {"gpio.037.in_not", 1}}),
    SCENARIO(bite, "7i96s", "", 1500, .reached = {{"watchdog.has_bit", 1}}),
    SCENARIO(loss, "7i96s", "", 1600, .reached = {{"io_error", 1}, {"watchdog.has_bit", 1}, {"packet-error-total", 5}}),
    SCENARIO(dpll, "7i96s", "", 800, .reached = {{"dpll.ddsize", 1}, {"encoder.00.count", 5000}}),
    SCENARIO(resolver, "7i93_sv6_7i49", "", 1200,
             .reached = {{"resolver.01.error", 1}, {"resolver.00.velocity", 5}, {"resolver.05.position", 1}}),
    SCENARIO(servo, "7i93", "num_encoders=8 num_pwmgens=8 num_stepgens=4", 1500,
             .reached = {{"encoder.03.count", 500}, {"encoder.06.count", 500}, {"stepgen.00.counts", 1000}}),
    NAMED_SCENARIO("settings", no_numbers, "7i96s", "enable_raw", 2560, .settle = 64, .keeps = settings_keeps),
    SCENARIO(settings, "7i93", "enable_raw", 2560, .settle = 64, .keeps = settings_keeps),
    SCENARIO(settings, "7i93", "", 2560, .settle = 64, .keeps = settings_keeps,
             .firmware = TEST_DATA "/firmware/latch_48.hex"),
    SCENARIO(settings, "7i93", "", 2560, .settle = 64, .keeps = settings_keeps,
             .firmware = TEST_DATA "/firmware/inmux_48.hex"),
    SETTINGS("drives", drives_impossible, "7i93", "num_resolvers=0 num_oneshots=0", .keeps = others_keeps,
             .firmware = TEST_DATA "/firmware/drives_29_48.hex"),
    SETTINGS("7i65", turning, "7i93_2x7i65", "", .keeps = turning_keeps, .has_7i65 = true),
    SETTINGS("7i48", others, "7i93_sv12im_2x7i48", "", .keeps = others_keeps),
    SETTINGS("shots", others, "7i93", "num_resolvers=0 num_3pwmgens=0 num_rcpwmgens=0 num_xy2mods=0",
             .keeps = others_keeps, .firmware = TEST_DATA "/firmware/drives_29_48.hex"),
    SETTINGS("7i49", others, "7i93_sv6_7i49", "", .keeps = others_keeps),
    SETTINGS("absolute", sensors, "7i93",
             "ssi_chan_0=a%12ub%3fc%1b%2pd%12s ssi_chan_1=pos%25ge biss_chan_1=turns%18lturns%12h",
             .keeps = others_keeps, .firmware = TEST_DATA "/firmware/absolute_48.hex", .from = LOCKED),
    SETTINGS("fanuc", fanucs, "7i93", "fanuc_chan_0=AA64 fanuc_chan_1=low%16umiddle%32shigh%28u", .keeps = others_keeps,
             .firmware = TEST_DATA "/firmware/absolute_48.hex", .sources = SIM_SOURCES_2021, .from = LOCKED),
    SETTINGS("7i77", others, "7i96s_7i77d", "sserial_port_0=30xxxxxx", .keeps = others_keeps, .remote = "7i77",
             .paced = true, .from = 60),
    SCENARIO(ports, "7i80hd-16", "", 1280, .settle = 64, .keeps = settings_keeps, .reached = {{"gpio.071.in", 1}}),
    SCENARIO(octal, "7i93_2x7i65", "", 1200, .has_7i65 = true,
             .reached = {{"7i65.volts.0", 9.99},
                         {"7i65.enables", 0x89},
                         {"encoder.00.count", 1900},
                         {"mesa-7i65.0.digital.3.in", 1}}),
    SCENARIO(absolute, "7i93", "ssi_chan_0=a%12ub%3fc%1b%2pd%12s ssi_chan_1=pos%25ge biss_chan_1=turns%18lturns%12h",
             1200, .firmware = TEST_DATA "/firmware/absolute_48.hex", .from = LOCKED,
             .reached = {{"ssi.00.a", 9.9}, {"biss.01.turns.count", 1000000}, {"ssi.01.pos.count", 1}}),
    SCENARIO(fanuc, "7i93", "fanuc_chan_0=AA64 fanuc_chan_1=low%16umiddle%32shigh%28u", 1000,
             .firmware = TEST_DATA "/firmware/absolute_48.hex", .sources = SIM_SOURCES_2021, .from = LOCKED,
             .reached = {{"fanuc.00.crc", 0.5}, {"fanuc.00.encoder.count", 1000}, {"fanuc.01.low", 65000}}),
    SCENARIO(drives, "7i93", "num_resolvers=0 num_oneshots=0", 600, .firmware = TEST_DATA "/firmware/drives_29_48.hex",
             .reached = {{"3pwmgen.00.fault", 1}, {"xy2mod.00.posx-fb", 0.009}}),
    SCENARIO(shots, "7i93", "num_resolvers=0 num_3pwmgens=0 num_rcpwmgens=0 num_xy2mods=0", 400,
             .firmware = TEST_DATA "/firmware/drives_29_48.hex",
             .reached = {{"oneshot.00.out1", 1}, {"oneshot.00.out2", 1}, {"oneshot.00.exttrigger2", 1}}),
    SCENARIO(remote, "7i96s_7i77d", "sserial_port_0=30xxxxxx", 600, .remote = "7i77", .paced = true, .from = 60,
             .reached = {{"7i77.0.0.input-19", 1}, {"7i77.0.0.input-02", 1}}),
    SCENARIO(latch, "7i93", "", 500, .firmware = TEST_DATA "/firmware/latch_48.hex",
             .reached = {{"stepgen.00.position-latch", 0.1}, {"encoder.00.position-latched", 0.5}}),
    SCENARIO(muxed, "7i93", "", 500, .firmware = TEST_DATA "/firmware/inmux_48.hex",
             .reached = {{"inmux.00.enc0-count", 5}, {"inmux.00.input-12", 1}, {"inmux.00.scan_width", 16}}),
    SCENARIO(paced, "7i96s", "", 2000, .paced = true, .reached = {{"encoder.00.count", 15000}}),
};
const size_t scenario_count = COUNT(scenarios);
