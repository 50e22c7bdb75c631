/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Smart serial from pin to remote: a board on a simulated 7I96S with a 7I77 at its expansion connector. */
#include "servo_rig.h"

#include <math.h>

#include <hm2/lbp_remote.h>
#include <hm2/sslbp.h>

#include "idrom_files.h"
#include "random.h"
#include "remote_state.h"
#include "sserial.h"

#define FIELD_IO 0u
#define ANALOG   1u

static int set_up_card(void **const state, const struct hm2_image *const image)
{
    return servo_set_up_card(state, &(struct sim_card_options){.profile = "7i96s_7i77d", .seed = 1, .image = image});
}

static int set_up(void **state)
{
    return set_up_card(state, NULL);
}

static int set_up_sserialb(void **state)
{
    struct hm2_image image;
    load_image(TEST_DATA "/firmware/sserialb_51.hex", &image);
    return set_up_card(state, &image);
}

static void plug_card(struct servo_rig *const f, const char *const name)
{
    if (sim_sserial_plug(f->card, 0, FIELD_IO, name, 0x123456, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
}

static void plug(struct servo_rig *const f)
{
    plug_card(f, "7i77");
}

static void run(struct servo_rig *const f)
{
    for (unsigned i = 0; i < 200 && servo_get(f, "sserial.port-0.port_state") != SSLBP_RUNNING; i++)
        servo_cycle(f);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_RUNNING);
    servo_cycles(f, 3);
}

static struct remote *remote(const struct servo_rig *const f, const unsigned channel)
{
    struct remote *const found = sim_sserial_remote(f->card, 0, channel);
    assert_non_null(found);
    return found;
}

static double at_remote(const struct servo_rig *const f, const unsigned channel, const char *const field)
{
    double value;
    assert_int_equal(remote_get(remote(f, channel), field, &value), 0);
    return value;
}

static unsigned parameter(const struct servo_rig *const f, const unsigned channel, const uint16_t address)
{
    struct remote *const r = remote(f, channel);
    remote_set_nv_access(r, address >= REMOTE_AT_NV);
    const unsigned value = remote_read(r, address) | (unsigned)remote_read(r, (uint16_t)(address + 1)) << 8;
    remote_set_nv_access(r, 0);
    return value;
}

/* ---- load ---------------------------------------------------------------------------------------------------------
 */

static void discovery_makes_the_points_of_both_processors(void **state)
{
    struct servo_rig *const f = *state;
    static const struct {
        const char *name;
        enum hm2_point_type type;
        enum hm2_point_dir dir;
        double value;
    } rows[] = {
        {"0.debug", HM2_S32, HM2_PIN_OUT, 0},
        {"sserial.port-0.run", HM2_BIT, HM2_PIN_IN, 1},
        {"sserial.port-0.port_state", HM2_U32, HM2_PIN_OUT, 0},
        {"sserial.port-0.fault-inc", HM2_U32, HM2_PARAM_RW, 10},
        {"sserial.port-0.fault-lim", HM2_U32, HM2_PARAM_RW, 200},
        {"7i77.0.0.input-00", HM2_BIT, HM2_PIN_OUT, 0},
        {"7i77.0.0.input-31-not", HM2_BIT, HM2_PIN_OUT, 0},
        {"7i77.0.0.output-15", HM2_BIT, HM2_PIN_IN, 0},
        {"7i77.0.0.output-15-invert", HM2_BIT, HM2_PARAM_RW, 0},
        {"7i77.0.0.analogin3", HM2_FLOAT, HM2_PIN_OUT, 0},
        {"7i77.0.0.fieldvoltage-scalemax", HM2_FLOAT, HM2_PARAM_RW, 36.299999237060547},
        {"7i77.0.0.enc1.count", HM2_S32, HM2_PIN_OUT, 0},
        {"7i77.0.0.enc1.index-enable", HM2_BIT, HM2_PIN_IO, 0},
        {"7i77.0.0.enc1.counts-per-rev", HM2_U32, HM2_PARAM_RW, 256},
        {"7i77.0.0.enc1.scale", HM2_FLOAT, HM2_PARAM_RW, 1},
        {"7i77.0.0.nvwatchdogtimeout", HM2_U32, HM2_PARAM_RW, 50},
        {"7i77.0.1.analogout0", HM2_FLOAT, HM2_PIN_IN, 0},
        {"7i77.0.1.analogout5-minlim", HM2_FLOAT, HM2_PARAM_RW, -10},
        {"7i77.0.1.analogout5-maxlim", HM2_FLOAT, HM2_PARAM_RW, 10},
        {"7i77.0.1.analogena", HM2_BIT, HM2_PIN_IN, 0},
        {"7i77.0.1.analogena-invert", HM2_BIT, HM2_PARAM_RW, 0},
    };
    plug(f);
    servo_load(f, "sserial_port_0=30xxxxxx");
    assert_string_equal(f->diag.text, "");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char full[128];
        (void)snprintf(full, sizeof full, PREFIX "%s", rows[i].name);
        const struct hm2_plain_object *const object = hm2_plain_find(f->plain, full);
        if (!object || object->point->type != rows[i].type || object->point->dir != rows[i].dir)
            fail_msg("%s: %s", full, object ? "another type or direction" : "missing");
        if (fabs(servo_get(f, rows[i].name) - rows[i].value) > 1e-12)
            fail_msg("%s is %.17g", full, servo_get(f, rows[i].name));
    }
}

static void a_mode_decides_which_points_there_are(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=00xxxxxx");
    assert_non_null(hm2_plain_find(f->plain, PREFIX "7i77.0.0.input-00"));
    assert_null(hm2_plain_find(f->plain, PREFIX "7i77.0.0.analogin0"));
    assert_null(hm2_plain_find(f->plain, PREFIX "7i77.0.0.enc0.count"));
}

static void a_remote_that_is_missing_in_its_mode_is_an_error_with_what_was_seen(void **state)
{
    struct servo_rig *const f = *state;
    assert_int_equal(servo_try_load(f, "sserial_port_0=x2xxxxxx"), HM2_ERR_NOTFOUND);
    assert_non_null(strstr(f->diag.text, "smart-serial port 0, channel 1: config sserial_port_0 expects a remote in "
                                         "mode 2, none found"));
    assert_non_null(strstr(f->diag.text, "no remote answers"));
}

static void an_empty_channel_of_mode_0_is_a_warning_and_its_pins_are_gpio(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, "sserial_port_0=0xxxxxxx");
    assert_non_null(strstr(f->diag.text, "warning: hm2_7i96s.0: smart-serial port 0, channel 0: config sserial_port_0 "
                                         "expects a remote in mode 0, none found"));
    assert_null(hm2_plain_find(f->plain, PREFIX "sserial.port-0.run"));
}

static void channels_that_nobody_asked_for_are_passed_over_in_silence(void **state)
{
    struct servo_rig *const f = *state;
    servo_load(f, "");
    assert_string_equal(f->diag.text, "");
    assert_null(hm2_plain_find(f->plain, PREFIX "sserial.port-0.run"));
}

static void serial_numbers_name_remotes_on_request(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=0xxxxxxx use_serial_numbers");
    assert_non_null(hm2_plain_find(f->plain, "hm2_7i77.3456.input-00"));
}

/* ---- cycle --------------------------------------------------------------------------------------------------------
 */

static void values_go_both_ways(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=30xxxxxx");
    run(f);
    servo_set(f, "7i77.0.0.output-03", 1);
    servo_set(f, "7i77.0.0.output-15-invert", 1);
    servo_set(f, "7i77.0.1.analogout0", 5);
    servo_set(f, "7i77.0.1.analogout5", -20); /* beyond its limit */
    servo_set(f, "7i77.0.1.analogena", 1);
    assert_int_equal(remote_set(remote(f, FIELD_IO), "Input", 0x80000005), 0);
    assert_int_equal(remote_set(remote(f, FIELD_IO), "AnalogIn2", 12), 0);
    servo_cycles(f, 4);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 0x8008);
    assert_true(fabs(at_remote(f, ANALOG, "AnalogOut0") - 5) < 0.003);
    assert_true(fabs(at_remote(f, ANALOG, "AnalogOut5") + 10) < 0.003);
    assert_int_equal(at_remote(f, ANALOG, "AnalogEna"), 1);
    assert_int_equal(servo_get(f, "7i77.0.0.input-00"), 1);
    assert_int_equal(servo_get(f, "7i77.0.0.input-01-not"), 1);
    assert_int_equal(servo_get(f, "7i77.0.0.input-31"), 1);
    assert_true(fabs(servo_get(f, "7i77.0.0.analogin2") - 12) < 0.15);
    assert_int_equal(servo_get(f, "7i77.0.0.link-fault"), 0);
    assert_int_equal(servo_get(f, "sserial.port-0.fault"), 0);
    assert_int_equal(servo_get(f, "sserial.port-0.doits-skipped"), 0);
    assert_true(servo_get(f, "sserial.port-0.doit-us") > 100 && servo_get(f, "sserial.port-0.doit-us") < 1000);
}

static void impossible_analog_outputs_are_limited_or_zero(void **state)
{
    static const struct {
        double value, min, max, scale, volts;
    } rows[] = {
        {5, 8, 2, 10, 8},        {1, 8, 2, 10, 8},           {9, 8, 2, 10, 8}, /* crossed limits: the lower one counts
                                                                                */
        {20, -1e9, 1e9, 10, 10}, {-20, -1e9, 1e9, 10, -10},  {3, -10, 10, 0, 0},   {3, -10, 10, NAN, 0},
        {NAN, 2, 10, 10, 0},     {INFINITY, -10, 10, 10, 0}, {3, NAN, NAN, 10, 3}, {5, -10, 10, -10, -5},
    };
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=30xxxxxx");
    run(f);
    servo_set(f, "7i77.0.1.analogena", 1);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        servo_set(f, "7i77.0.1.analogout0-minlim", rows[i].min);
        servo_set(f, "7i77.0.1.analogout0-maxlim", rows[i].max);
        servo_set(f, "7i77.0.1.analogout0-scalemax", rows[i].scale);
        servo_set(f, "7i77.0.1.analogout0", rows[i].value);
        servo_cycles(f, 4);
        assert_true(fabs(at_remote(f, ANALOG, "AnalogOut0") - rows[i].volts) < 0.005);
    }
}

/* A host may link a pin at any time, to a signal that has another level. */
static void inputs_that_never_change_are_written_in_turns(void **state)
{
    struct servo_rig *const f = *state;
    char name[32];
    plug(f);
    servo_load(f, "sserial_port_0=30xxxxxx");
    run(f);
    assert_int_equal(remote_set(remote(f, FIELD_IO), "Input", 0xFFFFFFFF), 0);
    servo_cycles(f, 4);
    for (unsigned input = 0; input < 32; input++) {
        (void)snprintf(name, sizeof name, "7i77.0.0.input-%02u", input);
        assert_int_equal(servo_get(f, name), 1);
        servo_set(f, name, 0);
    }
    servo_cycles(f, 33);
    for (unsigned input = 0; input < 32; input++) {
        (void)snprintf(name, sizeof name, "7i77.0.0.input-%02u", input);
        if (servo_get(f, name) != 1)
            fail_msg("%s was not written", name);
    }
}

static void a_counter_accumulates_past_its_width(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=3xxxxxxx");
    run(f);
    for (unsigned i = 1; i <= 1000; i++) {
        assert_int_equal(remote_set(remote(f, FIELD_IO), "Enc0", i % 256u), 0);
        servo_cycle(f);
    }
    servo_cycles(f, 2);
    assert_int_equal(servo_get(f, "7i77.0.0.enc0.count"), 1000);
    servo_set(f, "7i77.0.0.enc0.reset", 1);
    servo_cycle(f);
    servo_set(f, "7i77.0.0.enc0.reset", 0);
    assert_int_equal(servo_get(f, "7i77.0.0.enc0.count"), 0);
    assert_int_equal(servo_get(f, "7i77.0.0.enc0.rawcounts"), 1000);
    servo_set(f, "7i77.0.0.enc0.index-enable", 1);
    for (unsigned i = 1001; i <= 1100; i++) {
        assert_int_equal(remote_set(remote(f, FIELD_IO), "Enc0", i % 256u), 0);
        servo_cycle(f);
    }
    servo_cycles(f, 2);
    assert_int_equal(servo_get(f, "7i77.0.0.enc0.index-enable"), 0);
    assert_int_equal(servo_get(f, "7i77.0.0.enc0.count"), 1100 - 1024);
}

static void run_stops_and_starts_the_port(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=00xxxxxx");
    run(f);
    servo_set(f, "7i77.0.0.output-00", 1);
    servo_cycles(f, 3);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 1);
    servo_set(f, "sserial.port-0.run", 0);
    servo_cycles(f, 100);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_IDLE);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 0);
    servo_set(f, "sserial.port-0.run", 1);
    run(f);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 1);
}

static void a_changed_parameter_is_written_when_the_port_starts_again(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=00xxxxxx");
    run(f);
    servo_set(f, "7i77.0.0.nvwatchdogtimeout", 80);
    servo_set(f, "7i77.0.1.watchdogtimeout", 70);
    servo_cycles(f, 10);
    assert_int_equal(parameter(f, ANALOG, REMOTE_AT_WATCHDOG), 50);
    servo_set(f, "sserial.port-0.run", 0);
    servo_cycles(f, 10);
    servo_set(f, "sserial.port-0.run", 1);
    run(f);
    assert_int_equal(parameter(f, FIELD_IO, REMOTE_AT_NV_WATCHDOG), 80);
    assert_int_equal(parameter(f, ANALOG, REMOTE_AT_WATCHDOG), 70);
    assert_false(servo_message(f, "did not take"));
}

/* ---- other remotes, other firmware ----------------------------------------------------------------------------------
 */

static void fields_of_48_bits_go_both_ways_beside_counters(void **state)
{
    struct servo_rig *const f = *state;
    plug_card(f, "7i69");
    servo_load(f, "sserial_port_0=4xxxxxxx");
    run(f);
    servo_set(f, "7i69.0.0.output-00", 1);
    servo_set(f, "7i69.0.0.output-33", 1);
    servo_set(f, "7i69.0.0.output-47", 1);
    assert_int_equal(remote_set(remote(f, 0), "Input", (double)(UINT64_C(1) << 47 | UINT64_C(1) << 32 | 1)), 0);
    assert_int_equal(remote_set(remote(f, 0), "Enc3", 5), 0);
    servo_cycles(f, 4);
    assert_true(at_remote(f, 0, "Output") == (double)(UINT64_C(1) << 47 | UINT64_C(1) << 33 | 1));
    assert_int_equal(servo_get(f, "7i69.0.0.input-00"), 1);
    assert_int_equal(servo_get(f, "7i69.0.0.input-31"), 0);
    assert_int_equal(servo_get(f, "7i69.0.0.input-32"), 1);
    assert_int_equal(servo_get(f, "7i69.0.0.input-47"), 1);
    assert_int_equal(servo_get(f, "7i69.0.0.enc3.count"), 5);
}

static void halves_of_a_48_bit_card_are_its_first_inputs_and_its_last_outputs(void **state)
{
    struct servo_rig *const f = *state;
    plug_card(f, "7i69");
    servo_load(f, "sserial_port_0=3xxxxxxx");
    run(f);
    assert_null(hm2_plain_find(f->plain, "hm2_7i96s.0.7i69.0.0.input-24"));
    servo_set(f, "7i69.0.0.output-23", 1);
    assert_int_equal(remote_set(remote(f, 0), "Input", 1 << 23), 0);
    servo_cycles(f, 4);
    assert_int_equal(remote_terminal(remote(f, 0), 47), SIM_HIGH);
    assert_int_equal(remote_terminal(remote(f, 0), 23), SIM_FLOAT);
    assert_int_equal(servo_get(f, "7i69.0.0.input-23"), 1);
}

static void streams_are_carried_as_they_are(void **state)
{
    struct servo_rig *const f = *state;
    plug_card(f, "7i73");
    servo_load(f, "sserial_port_0=2xxxxxxx");
    run(f);
    servo_set(f, "7i73.0.0.display", 0xA5);
    servo_set(f, "7i73.0.0.display32", 0xDEADBEEF);
    assert_int_equal(remote_set(remote(f, 0), "KeyCode", 0x81), 0);
    servo_cycles(f, 4);
    assert_int_equal(at_remote(f, 0, "Display"), 0xA5);
    assert_true(at_remote(f, 0, "Display32") == (double)0xDEADBEEF);
    assert_int_equal(servo_get(f, "7i73.0.0.keycode"), 0x81);
}

static void sserialb_drives_the_same_remotes(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=300xxxxx");
    assert_non_null(strstr(f->diag.text, "channel 2: config sserial_port_0 expects a remote in mode 0, none found"));
    run(f);
    servo_set(f, "7i77.0.0.output-15", 1);
    servo_set(f, "7i77.0.1.analogout5", -10);
    assert_int_equal(remote_set(remote(f, FIELD_IO), "Input", 0x80000000), 0);
    assert_int_equal(remote_set(remote(f, FIELD_IO), "Enc1", 7), 0);
    servo_cycles(f, 4);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 0x8000);
    assert_true(fabs(at_remote(f, ANALOG, "AnalogOut5") + 10) < 0.003);
    assert_int_equal(servo_get(f, "7i77.0.0.input-31"), 1);
    assert_int_equal(servo_get(f, "7i77.0.0.enc1.count"), 7);
    assert_int_equal(sim_sserial_cable(f->card, 0, FIELD_IO, SIM_CABLE_OUT), 0);
    servo_cycles(f, 3);
    assert_int_equal(servo_get(f, "7i77.0.0.link-fault"), 1);
    assert_int_equal(servo_get(f, "7i77.0.1.link-fault"), 0);
}

/* ---- disturbances --------------------------------------------------------------------------------------------------
 */

static void a_pulled_cable_stops_its_remote_alone_and_is_reported_within_three_cycles(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=00xxxxxx");
    run(f);
    servo_set(f, "7i77.0.1.analogena", 1);
    servo_set(f, "7i77.0.1.analogout0", 5);
    servo_cycles(f, 3);
    assert_int_equal(sim_sserial_cable(f->card, 0, FIELD_IO, SIM_CABLE_OUT), 0);
    servo_cycles(f, 3);
    assert_int_equal(servo_get(f, "7i77.0.0.link-fault"), 1);
    assert_int_equal(servo_get(f, "7i77.0.1.link-fault"), 0);
    servo_cycles(f, 100);
    assert_true(servo_message(f, "the remote on channel 0 does not answer"));
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_RUNNING);
    assert_int_equal(servo_get(f, "sserial.port-0.fault"), 1);
    assert_true(fabs(at_remote(f, ANALOG, "AnalogOut0") - 5) < 0.003);
    assert_int_equal(servo_get(f, "7i77.0.1.link-errors"), 0);
    /* Back in its socket it stays stopped until a person starts the port. */
    assert_int_equal(sim_sserial_cable(f->card, 0, FIELD_IO, SIM_CABLE_IN), 0);
    servo_set(f, "7i77.0.0.output-00", 1);
    servo_cycles(f, 200);
    assert_int_equal(servo_get(f, "7i77.0.0.link-fault"), 1);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 0);
    servo_set(f, "sserial.port-0.run", 0);
    servo_cycles(f, 3);
    servo_set(f, "sserial.port-0.run", 1);
    run(f);
    assert_int_equal(servo_get(f, "sserial.port-0.fault"), 0);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 1);
}

static void auto_restart_brings_a_remote_back(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=00xxxxxx");
    servo_set(f, "sserial.port-0.auto-restart", 1);
    run(f);
    servo_set(f, "7i77.0.0.output-00", 1);
    assert_int_equal(sim_sserial_cable(f->card, 0, FIELD_IO, SIM_CABLE_OUT), 0);
    servo_cycles(f, 500);
    assert_int_equal(servo_get(f, "sserial.port-0.fault"), 1);
    assert_int_equal(sim_sserial_cable(f->card, 0, FIELD_IO, SIM_CABLE_IN), 0);
    servo_cycles(f, 500);
    assert_int_equal(servo_get(f, "sserial.port-0.fault"), 0);
    assert_int_equal(servo_get(f, "sserial.port-0.restarts"), 1);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 1);
}

static void a_port_without_remotes_left_is_in_error_until_run_changes(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=0xxxxxxx");
    run(f);
    assert_int_equal(sim_sserial_cable(f->card, 0, FIELD_IO, SIM_CABLE_OUT), 0);
    servo_cycles(f, 100);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_ERROR);
    assert_true(servo_message(f, "the port is stopped"));
    assert_int_equal(sim_sserial_cable(f->card, 0, FIELD_IO, SIM_CABLE_IN), 0);
    servo_cycles(f, 1000);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_ERROR);
    servo_set(f, "sserial.port-0.run", 0);
    servo_cycles(f, 3);
    servo_set(f, "sserial.port-0.run", 1);
    run(f);
}

static void a_restarted_card_starts_its_remotes_again(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=00xxxxxx");
    run(f);
    servo_set(f, "7i77.0.0.output-00", 1);
    servo_cycles(f, 3);
    sim_card_power_cycle(f->card);
    for (unsigned i = 0; i < 2000 && servo_get(f, "watchdog.has_bit") == 0.0; i++) {
        servo_cycle(f);
        servo_set(f, "io_error", 0);
    }
    servo_cycles(f, 100);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_IDLE);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 0);
    servo_set(f, "watchdog.has_bit", 0);
    run(f);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 1);
    assert_int_equal(servo_get(f, "sserial.port-0.fault"), 0);
}

static void after_a_bite_of_the_watchdog_the_port_starts_again(void **state)
{
    struct servo_rig *const f = *state;
    plug(f);
    servo_load(f, "sserial_port_0=00xxxxxx");
    run(f);
    servo_set(f, "7i77.0.0.output-00", 1);
    servo_cycles(f, 3);
    sim_net_sleep_until(f->net, link_now_ns(f->link) + INT64_C(200000000));
    servo_cycles(f, 5);
    assert_int_equal(servo_get(f, "watchdog.has_bit"), 1);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 0);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_IDLE);
    servo_set(f, "watchdog.has_bit", 0);
    run(f);
    assert_int_equal(at_remote(f, FIELD_IO, "Output"), 1);
}

/* ---- firmware of a remote -----------------------------------------------------------------------------------------
 */

static void firmware_goes_through_a_card_into_the_flash_of_the_remote(void **state)
{
    struct servo_rig *const f = *state;
    static const uint8_t modes[SSLBP_CHANNELS];
    static uint8_t image[5 << REMOTE_BLOCK_LOG2];
    struct sslbp_port port;
    struct lbp_flash flash;
    unsigned failed = 1;
    struct lbp_port_channel channel = {&port, ANALOG};
    struct lbp_remote at = {.access = lbp_port_access(&channel), .name = "card", .diag = &f->diag};
    for (size_t i = 0; i < sizeof image; i++)
        image[i] = (uint8_t)(i * 7 + i / 256);
    plug(f);
    remote_set_jumper(remote(f, ANALOG), true);
    assert_int_equal(hm2_board_identify(f->board, f->link, &f->diag), 0);
    assert_int_equal(hm2_board_sserial_open(f->board, 0, &port, &f->diag), 0);
    assert_int_equal(sslbp_port_baud(&port, LBP_SETUP_BAUD), 0);
    assert_int_equal(sslbp_port_start(&port, 1u << ANALOG, true, modes, &failed), 0);
    assert_int_equal(failed, 0);
    assert_int_equal(lbp_remote_check_image(&at, image, sizeof image, &flash), 0);
    if (lbp_remote_update(&at, &flash, image, sizeof image, NULL, NULL))
        fail_msg("%s", f->diag.text);
    const uint8_t *const bytes = remote(f, ANALOG)->flash.bytes;
    for (size_t i = 0; i < REMOTE_FLASH_BYTES; i++)
        assert_int_equal(bytes[i], i >= flash.block_bytes && i < sizeof image ? image[i] : 0xFF);
    /* The remote refuses what lies behind the end of its flash. */
    static uint8_t long_image[REMOTE_FLASH_BYTES + 1];
    long_image[REMOTE_FLASH_BYTES] = 1;
    assert_int_equal(lbp_remote_update(&at, &flash, long_image, sizeof long_image, NULL, NULL), HM2_ERR_IO);
    assert_non_null(strstr(f->diag.text, "erasing flash at 0x8000"));
    hm2_board_sserial_close(f->board, &port);
}

/* ---- a long run ---------------------------------------------------------------------------------------------------
 */

/* HM2_LONG_CYCLES=1000000 in the environment makes it long; so many take some seconds. */
#define SHORT_CYCLES 50000u
#define INPUTS       32u
#define OUTPUTS      16u

/* Inputs and outputs carry the number of the cycle in which they were set. */
struct long_run {
    hm2_bit_t *in[INPUTS], *out[OUTPUTS];
    hm2_bit_t *fault;
    hm2_u32_t *data_age;
    hm2_float_t *analog;
    struct remote *field, *analog_part;
    uint32_t shown, driven; /* last seen */
    unsigned fresh, failed;
};

static void *value_of(const struct servo_rig *const f, const char *const name)
{
    const struct hm2_plain_object *const object = hm2_plain_find(f->plain, name);
    if (!object)
        fail_msg("no point %s", name);
    return object->value;
}

static void find_points(const struct servo_rig *const f, struct long_run *const r)
{
    char name[64];
    for (unsigned i = 0; i < INPUTS; i++) {
        (void)snprintf(name, sizeof name, PREFIX "7i77.0.0.input-%02u", i);
        r->in[i] = value_of(f, name);
    }
    for (unsigned i = 0; i < OUTPUTS; i++) {
        (void)snprintf(name, sizeof name, PREFIX "7i77.0.0.output-%02u", i);
        r->out[i] = value_of(f, name);
    }
    r->fault = value_of(f, PREFIX "7i77.0.0.link-fault");
    r->data_age = value_of(f, PREFIX "data-age");
    r->analog = value_of(f, PREFIX "7i77.0.1.analogout3");
    r->field = remote(f, FIELD_IO);
    r->analog_part = remote(f, ANALOG);
}

static uint32_t shown_input(const struct long_run *const r)
{
    uint32_t value = 0;
    for (unsigned i = 0; i < INPUTS; i++)
        value |= (uint32_t)*r->in[i] << i;
    return value;
}

/* Errors of all kinds, seldom more than a few in a row. */
static void disturb(const struct servo_rig *const f, struct random *const random)
{
    static const char *const errors[] = {"crc", "overrun", "timeout", "extra", "break"};
    if (random_below(random, 20) == 0)
        assert_int_equal(sim_sserial_error(f->card, 0, random_below(random, 2), errors[random_below(random, 5)],
                                           1 + random_below(random, 3)),
                         0);
}

static void check_input(struct long_run *const r, const uint32_t number)
{
    const uint32_t value = shown_input(r);
    const bool old = *r->fault || *r->data_age > 0;
    /* What the transfer of the cycle before has brought; otherwise what was there, and never something older. */
    if (old ? value != r->shown : value != number - 1)
        fail_msg("cycle %u: the pins show %u, before %u, link-fault %d", number, value, r->shown, *r->fault);
    r->shown = value;
    r->failed += old;
    r->fresh += !old;
}

static void check_output(struct long_run *const r, const uint32_t number)
{
    double value, volts;
    assert_int_equal(remote_get(r->field, "Output", &value), 0);
    assert_int_equal(remote_get(r->analog_part, "AnalogOut3", &volts), 0);
    const uint16_t behind = (uint16_t)((uint16_t)number - (uint16_t)value);
    if (behind > 8 || (int16_t)(uint16_t)((uint16_t)value - (uint16_t)r->driven) < 0)
        fail_msg("cycle %u: the remote drives %u, before %u", number, (unsigned)value, r->driven);
    if (fabs(fabs(volts) - 5) > 0.003)
        fail_msg("cycle %u: the remote gives %g V", number, volts);
    r->driven = (uint32_t)value;
}

static void many_cycles_with_errors_on_both_lines_show_nothing_stale_and_drive_no_glitch(void **state)
{
    struct servo_rig *const f = *state;
    struct random random = {1};
    const char *const wanted = getenv("HM2_LONG_CYCLES");
    const uint32_t count = wanted ? (uint32_t)strtoul(wanted, NULL, 10) : SHORT_CYCLES;
    struct long_run r = {.shown = 0};
    plug(f);
    servo_load(f, "sserial_port_0=00xxxxxx");
    servo_set(f, "packet-error-limit", 1000);
    run(f);
    assert_int_equal(sim_net_set_faults(f->net, &(struct sim_faults){.seed = 1, .loss = 0.002, .duplicate = 0.002}), 0);
    find_points(f, &r);
    for (uint32_t number = 0; number < count; number++) {
        const int64_t begin_ns = link_now_ns(f->link);
        hm2_board_read(f->board, PERIOD_NS);
        if (number > 8) {
            check_input(&r, number);
            check_output(&r, number);
        }
        for (unsigned i = 0; i < OUTPUTS; i++)
            *r.out[i] = number >> i & 1u;
        *r.analog = number & 1u ? 5 : -5;
        assert_int_equal(remote_set(r.field, "Input", number), 0);
        disturb(f, &random);
        hm2_board_write(f->board, PERIOD_NS);
        sim_net_sleep_until(f->net, begin_ns + PERIOD_NS);
    }
    assert_true(r.failed > count / 50 && r.fresh > count / 2);
    assert_int_equal(servo_get(f, "sserial.port-0.port_state"), SSLBP_RUNNING);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, servo_tear_down)
    const struct CMUnitTest tests[] = {
        TEST(discovery_makes_the_points_of_both_processors),
        TEST(a_mode_decides_which_points_there_are),
        TEST(a_remote_that_is_missing_in_its_mode_is_an_error_with_what_was_seen),
        TEST(an_empty_channel_of_mode_0_is_a_warning_and_its_pins_are_gpio),
        TEST(channels_that_nobody_asked_for_are_passed_over_in_silence),
        TEST(serial_numbers_name_remotes_on_request),
        TEST(values_go_both_ways),
        TEST(impossible_analog_outputs_are_limited_or_zero),
        TEST(inputs_that_never_change_are_written_in_turns),
        TEST(a_counter_accumulates_past_its_width),
        TEST(run_stops_and_starts_the_port),
        TEST(a_changed_parameter_is_written_when_the_port_starts_again),
        TEST(fields_of_48_bits_go_both_ways_beside_counters),
        TEST(halves_of_a_48_bit_card_are_its_first_inputs_and_its_last_outputs),
        TEST(streams_are_carried_as_they_are),
        cmocka_unit_test_setup_teardown(sserialb_drives_the_same_remotes, set_up_sserialb, servo_tear_down),
        TEST(a_pulled_cable_stops_its_remote_alone_and_is_reported_within_three_cycles),
        TEST(auto_restart_brings_a_remote_back),
        TEST(a_port_without_remotes_left_is_in_error_until_run_changes),
        TEST(a_restarted_card_starts_its_remotes_again),
        TEST(after_a_bite_of_the_watchdog_the_port_starts_again),
        TEST(firmware_goes_through_a_card_into_the_flash_of_the_remote),
        TEST(many_cycles_with_errors_on_both_lines_show_nothing_stale_and_drive_no_glitch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
