/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "scenario.h"

#include <check.h>
#include <fnmatch.h>
#include <math.h>

#include <hm2/idrom.h>

#include "sserial.h"
#include "state.h"

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

enum { PIN_A = 0x01, PIN_B = 0x02, PIN_INDEX = 0x03 }; /* of encoders (register map 4.1) */
#define BEHIND_MULTIPLEXER 0x40u                       /* of one encoder of a pair, see lib/sim/sim_muxed_encoder.c */
#define EDGE_NS            5000

static void set_point(const struct driver *const driver, const char *const name, const double value)
{
    const struct driver_point *const point = driver_find(driver, name);
    if (!point)
        ck_abort_msg("no point %s%s", driver->prefix, name);
    driver_set(point, value);
}

/* Place is 0 to 1 in the period; so are the shapes, -1 to 1. */
static double shape(const struct wave *const wave, const double place)
{
    const double triangle = place < 0.25 ? 4 * place : place < 0.75 ? 2 - 4 * place : 4 * place - 4;
    switch (wave->shape) {
    case WAVE_SINE:
        return sin(2 * acos(-1) * place);
    case WAVE_SQUARE:
        return place < 0.5 ? 1 : -1;
    case WAVE_TRAPEZOID:
        return fmax(-1, fmin(1, 2 * triangle));
    case WAVE_RAMP:
        return place;
    case WAVE_TRIANGLE:
    default:
        return triangle;
    }
}

static void apply_waves(const struct scenario *const scenario, const struct driver *const driver)
{
    for (size_t i = 0; i < scenario->wave_count; i++) {
        const struct wave *const wave = &scenario->waves[i];
        if (driver->cycle < wave->from || driver->cycle >= wave->to)
            continue;
        const double place = (double)((driver->cycle - wave->from) % wave->period) / wave->period;
        set_point(driver, wave->point, wave->offset + wave->amplitude * shape(wave, place));
    }
}

static void apply_settings(const struct scenario *const scenario, const struct driver *const driver)
{
    for (size_t i = 0; i < scenario->setting_count; i++)
        if (scenario->settings[i].cycle == driver->cycle)
            set_point(driver, scenario->settings[i].point, scenario->settings[i].value);
}

/* ---- values for everything ----------------------------------------------------------------------------------------
 */

static bool is_kept(const struct scenario *const scenario, const char *const name)
{
    for (const char *const *keep = scenario->keeps; *keep; keep++)
        if (fnmatch(*keep, name, 0) == 0)
            return true;
    return false;
}

/* The same for a name and a round in every run, whatever other points a driver has. */
static uint64_t draw(const char *const name, const unsigned round)
{
    uint64_t state = 0xCBF29CE484222325u + round;
    for (const char *c = name; *c; c++)
        state = (state ^ (uint8_t)*c) * 0x100000001B3u;
    state ^= state >> 31;
    state *= 0x9E3779B97F4A7C15u;
    return state ^ state >> 29;
}

static double draw_value(const int type, const uint64_t random)
{
    static const double s32s[] = {-2147483648.0, -1, 0, 1, 2, 3, 4, 5, 100, 2147483647};
    static const double u32s[] = {0,      1,       2,       3,        5,         16,          50,    63,
                                  64,     500,     1023,    1024,     2000,      9999,        20000, 60000,
                                  250000, 1000000, 6000000, 25000000, 100000000, 4294967295.0};
    static const double floats[] = {-1e9, -1000, -50.5, -1, -0.3, -1e-3, 0,   1e-7,      1e-3,
                                    0.25, 0.5,   1,     2,  17.7, 100,   1e3, 12345.678, 1e9};
    switch (type) {
    case HAL_BIT:
        return (double)(random & 1u);
    case HAL_S32:
        return s32s[random % COUNT(s32s)];
    case HAL_U32:
        return u32s[random % COUNT(u32s)];
    default:
        return floats[random % COUNT(floats)];
    }
}

/* A quarter of all points changes in a round. */
static void set_everything(const struct scenario *const scenario, const struct driver *const driver)
{
    const unsigned round = driver->cycle / scenario->settle;
    for (size_t i = 0; i < driver->point_count; i++) {
        const struct driver_point *const point = &driver->points[i];
        const uint64_t random = draw(point->name, round);
        if (point->settable && random % 4u == 0 && !is_kept(scenario, point->name))
            driver_set(point, draw_value(point->type, random / 4u));
    }
}

bool scenario_compares(const struct scenario *const scenario, const unsigned cycle)
{
    if (cycle < scenario->from)
        return false;
    return scenario->settle == 0 || cycle % scenario->settle == scenario->settle - 1u;
}

/* ---- the world outside --------------------------------------------------------------------------------------------
 */

static void drive_encoder(const struct driver *const driver, const int64_t clk, const int encoder, const uint8_t pin,
                          const bool level)
{
    const bool muxed = !hm2_idrom_find(sim_card_idrom(driver->card), HM2_GTAG_ENCODER);
    ck_assert_int_eq(sim_card_drive_input(driver->card, clk, muxed ? HM2_GTAG_MUXED_ENCODER : HM2_GTAG_ENCODER,
                                          (unsigned)encoder, (uint8_t)(muxed ? pin | BEHIND_MULTIPLEXER : pin),
                                          level ? SIM_HIGH : SIM_LOW),
                     0);
}

static void attach_resolver(const struct driver *const driver, const struct event *const event)
{
    const unsigned channel = (unsigned)event->a;
    const struct sim_resolver resolver = {.turns = event->b / 1000.0,
                                          .amplitude = event->c / 1000.0,
                                          .turns_per_s = event->d / 1000.0,
                                          .pwmgen = channel};
    ck_assert_int_eq(sim_card_resolver(driver->card, channel, &resolver), 0);
}

/* Edges of a disc, after the card's present. The disc's place follows from the cycle: the same in every run. */
static void turn(const struct driver *const driver, const struct event *const event)
{
    const int64_t clk = sim_card_clock(driver->card);
    const int before = (int)(driver->cycle - event->cycle) * event->b, step = event->b < 0 ? -1 : 1;
    for (int i = 1; i <= event->b * step; i++) {
        const unsigned place = (unsigned)(before + i * step) & 3u;
        const int64_t at = clk + (int64_t)i * EDGE_NS / 10;
        drive_encoder(driver, at, event->a, PIN_A, place == 1 || place == 2);
        drive_encoder(driver, at, event->a, PIN_B, place >= 2);
    }
}

/* The bits above the first 64 differ from cycle to cycle, too. */
static void show_absolute(const struct driver *const driver, const struct event *const event)
{
    const uint64_t place = (uint64_t)((int64_t)(driver->cycle - event->cycle) * event->d);
    const uint64_t code = event->action == ABSOLUTE_GRAY ? place ^ place >> 1 : place;
    const struct sim_absolute encoder = {
        .bits = (unsigned)event->c,
        .value = {(uint32_t)code, (uint32_t)(code >> 32), (uint32_t)(driver->cycle * 0x9E3779B9u), driver->cycle},
        .processing = 2};
    ck_assert_int_eq(sim_card_absolute(driver->card, (uint8_t)event->a, (unsigned)event->b, &encoder), 0);
}

static void set_remote_field(const struct driver *const driver, const struct event *const event)
{
    static const char *const fields[] = {[REMOTE_INPUT] = "Input",
                                         [REMOTE_ANALOG_IN_0] = "AnalogIn0",
                                         [REMOTE_ANALOG_IN_3] = "AnalogIn3",
                                         [REMOTE_ENCODER_0] = "Enc0"};
    struct remote *const remote = sim_sserial_remote(driver->card, 0, (unsigned)event->a);
    ck_assert_int_eq(remote_set(remote, fields[event->b], event->c / 1000.0), 0);
}

/* What happens to card and network while an event lasts; true when write() is left out. */
static bool apply_event(const struct event *const event, struct driver *const driver)
{
    const int64_t clk = sim_card_clock(driver->card);
    switch (event->action) {
    case FOLLOW:
        ck_assert_int_eq(sim_card_follow(driver->card, (unsigned)event->a, (unsigned)event->b, event->c, event->d), 0);
        break;
    case INDEX:
        drive_encoder(driver, clk, event->a, PIN_INDEX, event->b);
        break;
    case PAD:
        ck_assert_int_eq(sim_card_drive(driver->card, clk, (unsigned)event->a, (enum sim_level)event->b), 0);
        break;
    case TURN:
        turn(driver, event);
        break;
    case RESOLVER:
        attach_resolver(driver, event);
        break;
    case LOSE_REQUESTS:
        driver->lose_requests = true;
        break;
    case LOSE_WRITES:
        driver->lose_writes = true;
        break;
    case SERVO_VOLTS:
        sim_7i65_set_input_volts(driver->servo, (unsigned)event->a, event->b / 1000.0);
        break;
    case SERVO_INPUTS:
        sim_7i65_set_inputs(driver->servo, (uint8_t)event->a);
        break;
    case ABSOLUTE:
    case ABSOLUTE_GRAY:
        show_absolute(driver, event);
        break;
    case INPUT:
        ck_assert_int_eq(sim_card_drive_input(driver->card, clk, (uint8_t)event->a, (unsigned)event->b,
                                              (uint8_t)event->c, event->d ? SIM_HIGH : SIM_LOW),
                         0);
        break;
    case REMOTE:
        set_remote_field(driver, event);
        break;
    case POWER_CYCLE:
        sim_card_power_cycle(driver->card);
        break;
    case NO_WRITE:
        return true;
    }
    return false;
}

static bool apply_events(const struct scenario *const scenario, struct driver *const driver)
{
    bool no_write = false;
    driver->lose_requests = driver->lose_writes = false;
    for (size_t i = 0; i < scenario->event_count; i++) {
        const struct event *const event = &scenario->events[i];
        const unsigned to = event->to ? event->to : event->cycle + 1;
        if (driver->cycle >= event->cycle && driver->cycle < to)
            no_write |= apply_event(event, driver);
    }
    return no_write;
}

void scenario_cycle(const struct scenario *const scenario, struct driver *const driver)
{
    driver_begin_cycle(driver);
    apply_settings(scenario, driver);
    if (scenario->settle > 0 && driver->cycle > 0 && driver->cycle % scenario->settle == 0)
        set_everything(scenario, driver);
    const bool no_write = apply_events(scenario, driver);
    driver_read(driver);
    apply_waves(scenario, driver);
    if (!no_write)
        driver_write(driver);
    driver->cycle++;
}
