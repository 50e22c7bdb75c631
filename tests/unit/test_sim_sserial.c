/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Simulated smart-serial ports: what the traces of folder sslbp do not show (they are replayed by test_sim_replay). */
#include "unit.h"

#include <math.h>

#include "idrom_files.h"
#include "sim_card.h"
#include "sserial.h"

#define COMMAND 0x5B00u
#define DATA    0x5C00u
#define CS      0x5D00u
#define USER0   0x5E00u
#define PORTS   3u
#define DDR     0x1100u
#define ALTSRC  0x1200u
#define US      100 /* clocks */
#define MS      (1000 * US)
#define LONG    (100 * MS)

enum { FIELD, ANALOG, SPARE };

struct rig {
    struct sim_card *card;
};

static void put(const struct rig *const rig, const uint32_t address, const uint32_t value)
{
    sim_card_write(rig->card, sim_card_clock(rig->card), (uint16_t)address, value);
}

static uint32_t get(const struct rig *const rig, const uint32_t address)
{
    return sim_card_read(rig->card, sim_card_clock(rig->card), (uint16_t)address, NULL);
}

static void wait(const struct rig *const rig, const int64_t clk)
{
    sim_card_advance(rig->card, sim_card_clock(rig->card) + clk);
}

/* Write a command, wait until it is done, and give the data register. */
static uint32_t command(const struct rig *const rig, const uint32_t value)
{
    const int64_t start = sim_card_clock(rig->card);
    put(rig, COMMAND, value);
    while (get(rig, COMMAND) != 0 && sim_card_clock(rig->card) - start < LONG)
        wait(rig, 10 * US);
    assert_true(get(rig, COMMAND) == 0);
    return get(rig, DATA);
}

static void route(const struct rig *const rig, const uint32_t mask)
{
    for (unsigned port = 0; port < PORTS; port++) {
        put(rig, DDR + 4 * port, mask);
        put(rig, ALTSRC + 4 * port, mask);
    }
}

/* Transmit pins of port 0 (5.5 A) are outputs, everything else is an input. */
#define TRANSMIT 0x2Au

static int set_up(void **const state)
{
    static struct rig rig;
    const struct sim_card_options options = {.profile = "7i96s_7i77d"};
    assert_int_equal(sim_card_new(&rig.card, &options, NULL), 0);
    assert_int_equal(sim_sserial_plug(rig.card, 0, 0, "7i77", 0x1234, NULL), 0);
    route(&rig, TRANSMIT);
    wait(&rig, MS);
    assert_int_equal(command(&rig, 0x0800), 0xAA);
    *state = &rig;
    return 0;
}

static int tear_down(void **const state)
{
    const struct rig *const rig = *state;
    sim_card_free(rig->card);
    return 0;
}

static uint32_t cs(const struct rig *const rig, const unsigned channel)
{
    return get(rig, CS + 4 * channel);
}

static uint32_t user(const struct rig *const rig, const unsigned number, const unsigned channel)
{
    return get(rig, USER0 + 0x100 * number + 4 * channel);
}

static double output(const struct rig *const rig, const unsigned channel, const char *const name)
{
    double value = -1;
    assert_int_equal(remote_get(sim_sserial_remote(rig->card, 0, channel), name, &value), 0);
    return value;
}

static void input(const struct rig *const rig, const char *const name, const double value)
{
    assert_int_equal(remote_set(sim_sserial_remote(rig->card, 0, FIELD), name, value), 0);
}

/* ---- starting and identity ---------------------------------------------------------------------------------------
 */

static void a_start_names_both_processors_of_a_7i77(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0903), 0);
    assert_int_equal(user(rig, 0, FIELD), 0x12001234);
    assert_int_equal(user(rig, 0, ANALOG), 0x11001234);
    assert_int_equal(user(rig, 1, FIELD), 0x37374937); /* "7I77" */
    assert_int_equal(user(rig, 1, ANALOG), 0x37374937);
    assert_int_equal(cs(rig, FIELD), 0x003B0000);
}

static void what_is_started_is_not_started_again_without_a_stop(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0901), 0);
    put(rig, USER0 + 4 * FIELD, 0xF);
    assert_int_equal(command(rig, 0x1001), 0);
    assert_int_equal(command(rig, 0x0903), 0);
    assert_int_equal(cs(rig, FIELD), 0x00420000);
    assert_int_equal(cs(rig, ANALOG), 0x003B0000);
    assert_true(output(rig, FIELD, "Output") == 0xF);
}

static void a_missing_remote_fails_its_channel_alone(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0907), 1u << SPARE);
    assert_int_equal(cs(rig, SPARE) & 0xFFFF, 0xE188);
    assert_int_equal(command(rig, 0x1003), 0);
    assert_int_equal(cs(rig, FIELD), 0x00420000);
}

static void channels_that_the_firmware_lacks_do_not_start(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0910), 0x10);
}

static void pins_that_are_no_outputs_leave_the_remote_deaf(void **state)
{
    const struct rig *const rig = *state;
    route(rig, 0);
    assert_int_equal(command(rig, 0x0901), 1);
    route(rig, TRANSMIT | 1u << 6); /* nor must the receive pin be driven */
    assert_int_equal(command(rig, 0x0800), 0xAA);
    assert_int_equal(command(rig, 0x0901), 1);
}

static void a_reset_starts_the_firmware_again(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0901), 0);
    put(rig, COMMAND, 0x4000);
    wait(rig, MS);
    assert_int_equal(get(rig, COMMAND), 0x4000);
    assert_int_equal(command(rig, 0x0001), 0xAA);
    assert_int_equal(command(rig, 0x2003), 43);
    assert_int_equal(cs(rig, FIELD), 0x0000C100);
}

static void an_invalid_cookie_is_seen_when_the_port_starts(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(sim_sserial_error(rig->card, 0, FIELD, "cookie", 1), 0);
    assert_int_equal(command(rig, 0x0903), 1u << FIELD);
    assert_int_equal(cs(rig, FIELD) & 0xFF, 0x82);
    assert_int_equal(command(rig, 0x0800), 0xAA);
    assert_int_equal(command(rig, 0x0903), 0);
}

/* ---- process data -------------------------------------------------------------------------------------------------
 */

static void process_data_passes_in_the_order_of_the_tables(void **state)
{
    const struct rig *const rig = *state;
    put(rig, CS + 4 * FIELD, 3u << 24);
    assert_int_equal(command(rig, 0x0903), 0);
    input(rig, "input", 0x80000001);
    input(rig, "AnalogIn1", 36.3);
    input(rig, "FieldVoltage", 12.1);
    input(rig, "Enc1", 261); /* eight bits */
    put(rig, USER0 + 4 * FIELD, 0xFFFF8001);
    put(rig, USER0 + 4 * ANALOG, 4095u | 0x1000u << 13); /* 10 V, and -10 V with its upper bits behind */
    put(rig, USER0 + 0x200 + 4 * ANALOG, 1u << (78 - 64));
    assert_int_equal(command(rig, 0x1003), 0);
    assert_int_equal(user(rig, 0, FIELD), 0x80000001);
    assert_int_equal(user(rig, 1, FIELD), 0xFF00);
    assert_int_equal(user(rig, 2, FIELD), 85u | 5u << 16);
    assert_true(output(rig, FIELD, "Output") == 0x8001);
    assert_true(output(rig, ANALOG, "AnalogOut0") == 10);
    assert_true(output(rig, ANALOG, "AnalogOut1") == -10);
    assert_true(output(rig, ANALOG, "AnalogEna") == 1);
    assert_true(output(rig, ANALOG, "SpinEna") == 0);
}

static void a_mode_that_a_remote_lacks_is_a_fault(void **state)
{
    const struct rig *const rig = *state;
    put(rig, CS + 4 * FIELD, 9u << 24);
    assert_int_equal(command(rig, 0x0901), 1);
    assert_int_equal(cs(rig, FIELD) >> 24, REMOTE_FAULT_ILLEGAL_MODE);
}

static void sourcing_and_sinking_outputs_differ_at_the_terminal_alone(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(sim_sserial_plug(rig->card, 0, SPARE, "7i77d-field", 5, NULL), 0);
    assert_int_equal(command(rig, 0x0905), 0);
    put(rig, USER0 + 4 * FIELD, 2);
    put(rig, USER0 + 4 * SPARE, 2);
    assert_int_equal(command(rig, 0x1005), 0);
    assert_int_equal(remote_terminal(sim_sserial_remote(rig->card, 0, FIELD), 1), SIM_HIGH);
    assert_int_equal(remote_terminal(sim_sserial_remote(rig->card, 0, SPARE), 1), SIM_LOW);
    assert_int_equal(remote_terminal(sim_sserial_remote(rig->card, 0, FIELD), 0), SIM_FLOAT);
    assert_int_equal(remote_terminal(sim_sserial_remote(rig->card, 0, SPARE), 0), SIM_FLOAT);
}

/* ---- errors and faults --------------------------------------------------------------------------------------------
 */

static void ordered_errors_come_once_each_and_leave_inputs_as_they_were(void **state)
{
    static const struct {
        const char *name;
        uint32_t bit;
    } errors[] = {{"crc", 0x01}, {"overrun", 0x04}, {"timeout", 0x08}, {"extra", 0x10}, {"break", 0x20}};
    const struct rig *const rig = *state;
    uint32_t seen = 0;
    assert_int_equal(command(rig, 0x0901), 0);
    for (unsigned i = 0; i < sizeof errors / sizeof errors[0]; i++) {
        input(rig, "Input", i);
        assert_int_equal(command(rig, 0x1001), 0);
        assert_int_equal(sim_sserial_error(rig->card, 0, FIELD, errors[i].name, 1), 0);
        input(rig, "Input", 100);
        assert_int_equal(command(rig, 0x1001), 1);
        seen |= errors[i].bit;
        assert_int_equal(cs(rig, FIELD) & 0xFFFF, 0x2000 | seen);
        assert_int_equal(user(rig, 0, FIELD), i);
        assert_int_equal(command(rig, 0x1001), 0);
        assert_int_equal(user(rig, 0, FIELD), 100);
    }
    assert_int_equal(sim_sserial_error(rig->card, 0, FIELD, "boredom", 1), HM2_ERR_INVALID);
    assert_int_equal(sim_sserial_error(rig->card, 0, SPARE, "crc", 1), HM2_ERR_NOTFOUND);
}

static void a_remote_lives_on_zeros_until_the_first_doit_and_bites_50_ms_after_the_last(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0901), 0);
    wait(rig, 500 * MS);
    put(rig, USER0 + 4 * FIELD, 0xF);
    assert_int_equal(command(rig, 0x1001), 0);
    wait(rig, 49 * MS);
    assert_true(output(rig, FIELD, "Output") == 0xF);
    wait(rig, 2 * MS);
    assert_true(output(rig, FIELD, "Output") == 0);
    assert_int_equal(command(rig, 0x1001), 1);
    assert_int_equal(cs(rig, FIELD), 0x01420140);
    assert_true(output(rig, FIELD, "Output") == 0);
    assert_int_equal(command(rig, 0x0800), 0xAA);
    assert_int_equal(command(rig, 0x0901), 0);
    assert_int_equal(command(rig, 0x1001), 0);
    assert_true(output(rig, FIELD, "Output") == 0xF);
}

static void a_stop_ends_what_keeps_a_waiting_remote_alive(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0901), 0);
    wait(rig, 500 * MS);
    assert_int_equal(command(rig, 0x0800), 0xAA);
    wait(rig, 49 * MS);
    assert_int_equal(remote_faults(sim_sserial_remote(rig->card, 0, FIELD)), 0);
    wait(rig, 2 * MS);
    assert_int_equal(remote_faults(sim_sserial_remote(rig->card, 0, FIELD)), REMOTE_FAULT_WATCHDOG);
}

static void a_pulled_cable_times_out_its_channel_alone(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0903), 0);
    assert_int_equal(command(rig, 0x1003), 0);
    assert_int_equal(sim_sserial_cable(rig->card, 0, FIELD, SIM_CABLE_OUT), 0);
    assert_int_equal(command(rig, 0x1003), 1u << FIELD);
    assert_int_equal(cs(rig, FIELD), 0x00422008);
    assert_int_equal(cs(rig, ANALOG), 0x00420000);
    assert_int_equal(sim_sserial_cable(rig->card, 0, FIELD, SIM_CABLE_IN), 0);
    assert_int_equal(command(rig, 0x1003), 0);
}

static void a_short_trips_when_the_output_comes_on(void **state)
{
    const struct rig *const rig = *state;
    struct remote *const remote = sim_sserial_remote(rig->card, 0, FIELD);
    assert_int_equal(command(rig, 0x0901), 0);
    remote_short(remote, 1u << 4);
    put(rig, USER0 + 4 * FIELD, 0x0F);
    assert_int_equal(command(rig, 0x1001), 0);
    put(rig, USER0 + 4 * FIELD, 0x1F);
    assert_int_equal(command(rig, 0x1001), 1);
    assert_int_equal(cs(rig, FIELD) >> 24, REMOTE_FAULT_OVER_CURRENT);
    assert_true(output(rig, FIELD, "Output") == 0);
}

static void lost_field_power_is_a_fault_that_a_start_cannot_clear(void **state)
{
    const struct rig *const rig = *state;
    input(rig, "FieldVoltage", 0);
    assert_int_equal(command(rig, 0x0903), 1u << FIELD);
    assert_int_equal(cs(rig, FIELD) >> 24, REMOTE_FAULT_UNDER_VOLTAGE);
    input(rig, "FieldVoltage", 24);
    assert_int_equal(command(rig, 0x0800), 0xAA);
    assert_int_equal(command(rig, 0x0903), 0);
}

/* ---- setup mode ---------------------------------------------------------------------------------------------------
 */

static uint32_t pass(const struct rig *const rig, const uint32_t lbp)
{
    put(rig, CS + 4 * FIELD, lbp);
    assert_int_equal(command(rig, 0x1001), 0);
    return user(rig, 0, FIELD);
}

/* Address of a parameter, by way of the global table. */
static uint32_t find_parameter(const struct rig *const rig, const char *const name)
{
    for (uint32_t at = user(rig, 2, FIELD) >> 16, record; (record = pass(rig, 0x45000000 | at)) != 0; at += 2) {
        uint32_t text = record + 14;
        size_t len = 0;
        if (pass(rig, 0x44000000 | record) != 0xA0)
            continue;
        while (pass(rig, 0x44000000 | text++) != 0) /* the unit */
            continue;
        while (len < strlen(name) && pass(rig, 0x44000000 | text) == (uint8_t)name[len]) {
            text++;
            len++;
        }
        if (len == strlen(name) && pass(rig, 0x44000000 | text) == 0)
            return pass(rig, 0x45000000 | (record + 12));
    }
    fail_msg("no parameter %s", name);
    return 0;
}

static void non_volatile_parameters_work_from_the_next_power_up_on(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0F01), 0);
    put(rig, CS + 4 * FIELD, 0); /* tables first: process data would overwrite the pointers */
    struct remote *const remote = sim_sserial_remote(rig->card, 0, FIELD);
    const uint32_t tables = user(rig, 2, FIELD);
    assert_int_equal(tables, (uint32_t)remote_gtoc(remote) << 16 | remote_ptoc(remote));
    const uint32_t lasting = find_parameter(rig, "NVWatchDogTimeout");
    assert_int_equal(command(rig, 0x0800), 0xAA);
    assert_int_equal(command(rig, 0x0F01), 0);
    const uint32_t working = find_parameter(rig, "WatchDogTimeout");
    put(rig, USER0 + 4 * FIELD, 1);
    (void)pass(rig, 0xEC000000);
    assert_int_equal(pass(rig, 0x45000000 | lasting), 50);
    put(rig, USER0 + 4 * FIELD, 250);
    (void)pass(rig, 0x65000000 | lasting);
    put(rig, USER0 + 4 * FIELD, 0);
    (void)pass(rig, 0xEC000000);
    assert_int_equal(pass(rig, 0x45000000 | working), 50);
    assert_int_equal(sim_sserial_power_cycle(rig->card, 0, FIELD), 0);
    assert_int_equal(pass(rig, 0x45000000 | working), 250);
}

static void another_baud_rate_is_not_understood(void **state)
{
    const struct rig *const rig = *state;
    struct remote *const remote = sim_sserial_remote(rig->card, 0, FIELD);
    assert_int_equal(command(rig, 0x0F01), 0);
    const uint32_t baud = find_parameter(rig, "NVBaudRate");
    remote_set_nv_access(remote, 1);
    assert_true(remote_write(remote, (uint16_t)baud, 4));
    remote_set_nv_access(remote, 0);
    assert_int_equal(sim_sserial_power_cycle(rig->card, 0, FIELD), 0);
    assert_int_equal(remote_baud(remote), 115200);
    assert_int_equal(command(rig, 0x0800), 0xAA);
    assert_int_equal(command(rig, 0x0901), 1);
}

/* ---- commands at the wrong time -----------------------------------------------------------------------------------
 */

static void a_stop_all_during_a_doit_is_never_cleared_and_swallows_the_next_command(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0901), 0);
    assert_int_equal(command(rig, 0x1001), 0);
    put(rig, COMMAND, 0x1001);
    wait(rig, 10 * US);
    put(rig, COMMAND, 0x0800);
    wait(rig, 10 * MS);
    assert_int_equal(get(rig, COMMAND), 0x0800);
    assert_int_equal(command(rig, 0x2003), 0xFC);
    assert_int_equal(command(rig, 0x2003), 43);
    assert_int_equal(cs(rig, FIELD), 0x00420000);
}

static void ignored_commands_may_be_written_at_any_time(void **state)
{
    const struct rig *const rig = *state;
    assert_int_equal(command(rig, 0x0901), 0);
    put(rig, COMMAND, 0x1001);
    put(rig, COMMAND, 0x80001001);
    assert_int_equal(get(rig, COMMAND), 0x1001);
    wait(rig, MS);
    assert_int_equal(get(rig, COMMAND), 0);
    put(rig, COMMAND, 0x80000800);
    assert_int_equal(get(rig, COMMAND), 0);
    assert_int_equal(cs(rig, FIELD), 0x00420000);
}

/* ---- motors -------------------------------------------------------------------------------------------------------
 */

#define FULL_SPEED 100000

static int64_t turned(const struct rig *const rig)
{
    int64_t position = 0;
    assert_int_equal(sim_card_turned(rig->card, HM2_GTAG_ENCODER, 2, &position), 0);
    return position;
}

static void drive_for(const struct rig *const rig, const uint32_t raw, const bool enable, const unsigned ms)
{
    put(rig, USER0 + 4 * ANALOG, raw & 0x1FFF);
    put(rig, USER0 + 0x200 + 4 * ANALOG, enable ? 1u << (78 - 64) : 0);
    for (unsigned i = 0; i < ms; i++) {
        put(rig, COMMAND, 0x1002);
        wait(rig, MS - 1);
    }
}

static void a_motor_turns_by_the_output_with_inertia_while_it_is_enabled(void **state)
{
    const struct rig *const rig = *state;
    const struct sim_drive drive = {0, ANALOG, "AnalogOut0", FULL_SPEED, 0.02};
    assert_int_equal(sim_card_drive_motor(rig->card, 2, &drive), 0);
    assert_int_equal(command(rig, 0x0902), 0);
    drive_for(rig, 4095, false, 100);
    assert_int_equal(turned(rig), 0);
    drive_for(rig, 4095, true, 200); /* t - tau (1 - exp(-t / tau)) of full speed */
    const int64_t there = turned(rig);
    assert_true(llabs(there - 18000) < 300);
    assert_int_equal(get(rig, 0x3600 + 4 * 2) & 0xFFFF, there & 0xFFFF);
    drive_for(rig, 0, true, 200);
    const int64_t rest = turned(rig);
    assert_true(llabs(rest - 20000) < 300);
    drive_for(rig, 0x2000u - 4095, true, 400);
    assert_true(llabs(turned(rig) - (rest - 38000)) < 300);
}

static void a_motor_runs_out_when_the_remote_is_no_longer_fed(void **state)
{
    const struct rig *const rig = *state;
    const struct sim_drive drive = {0, ANALOG, "AnalogOut0", FULL_SPEED, 0};
    assert_int_equal(sim_card_drive_motor(rig->card, 2, &drive), 0);
    assert_int_equal(command(rig, 0x0902), 0);
    drive_for(rig, 4095, true, 100);
    const int64_t there = turned(rig);
    wait(rig, 1000 * MS); /* 50 ms from the last DOIT on */
    assert_true(llabs(turned(rig) - there - 5000) < 200);
}

static void a_motor_stands_where_it_was_when_the_card_lost_its_power(void **state)
{
    const struct rig *const rig = *state;
    const struct sim_drive drive = {0, ANALOG, "AnalogOut0", FULL_SPEED, 0};
    assert_int_equal(sim_card_drive_motor(rig->card, 2, &drive), 0);
    assert_int_equal(command(rig, 0x0902), 0);
    drive_for(rig, 4095, true, 100);
    drive_for(rig, 0, false, 10);
    const int64_t there = turned(rig);
    assert_true(there > 9000);
    sim_card_power_cycle(rig->card);
    wait(rig, 10 * MS);
    assert_int_equal(turned(rig), there);
}

static void motors_need_an_encoder_and_an_output(void **state)
{
    const struct rig *const rig = *state;
    const struct sim_drive good = {0, ANALOG, "AnalogOut0", FULL_SPEED, 0};
    struct sim_drive bad = good;
    assert_int_equal(sim_card_drive_motor(rig->card, 8, &good), HM2_ERR_NOTFOUND);
    bad.output = "AnalogEna";
    assert_int_equal(sim_card_drive_motor(rig->card, 0, &bad), HM2_ERR_NOTFOUND);
    bad = good;
    bad.channel = SPARE;
    assert_int_equal(sim_card_drive_motor(rig->card, 0, &bad), HM2_ERR_NOTFOUND);
    bad = good;
    bad.time_constant_s = NAN;
    assert_int_equal(sim_card_drive_motor(rig->card, 0, &bad), HM2_ERR_RANGE);
}

/* ---- plugging -----------------------------------------------------------------------------------------------------
 */

static void sserialb_has_seven_registers_a_channel_and_works_alike(void **state)
{
    (void)state;
    struct hm2_image image;
    load_image(TEST_DATA "/firmware/sserialb_51.hex", &image);
    struct rig rig;
    const struct sim_card_options options = {.profile = "7i96s_7i77d", .image = &image};
    assert_int_equal(sim_card_new(&rig.card, &options, NULL), 0);
    assert_int_equal(sim_sserial_plug(rig.card, 0, 0, "7i76", 7, NULL), 0);
    route(&rig, TRANSMIT);
    wait(&rig, MS);
    assert_int_equal(command(&rig, 0x0800), 0xAA);
    assert_int_equal(command(&rig, 0x2003), 45);
    assert_int_equal(command(&rig, 0x0901), 0);
    assert_int_equal(user(&rig, 0, 0), 0x10000007);
    uint32_t undriven = 1;
    assert_int_equal(sim_card_read(rig.card, sim_card_clock(rig.card), USER0 + 0x600, &undriven), 0);
    assert_int_equal(undriven, 0);
    sim_card_free(rig.card);
}

static void what_cannot_be_plugged_is_refused_with_a_sentence(void **state)
{
    const struct rig *const rig = *state;
    struct hm2_diag diag = {0};
    assert_int_equal(sim_sserial_plug(rig->card, 0, 4, "7i84", 0, &diag), HM2_ERR_NOTFOUND);
    assert_non_null(strstr(diag.text, "no smart-serial port 0 channel 4"));
    assert_int_equal(sim_sserial_plug(rig->card, 1, 0, "7i84", 0, &diag), HM2_ERR_NOTFOUND);
    assert_int_equal(sim_sserial_plug(rig->card, 0, 1, "7i84", 0, &diag), HM2_ERR_STATE);
    assert_int_equal(sim_sserial_plug(rig->card, 0, 2, "7i99", 0, &diag), HM2_ERR_NOTFOUND);
    assert_null(sim_sserial_remote(rig->card, 0, 2));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
        TEST(a_start_names_both_processors_of_a_7i77),
        TEST(what_is_started_is_not_started_again_without_a_stop),
        TEST(a_missing_remote_fails_its_channel_alone),
        TEST(channels_that_the_firmware_lacks_do_not_start),
        TEST(pins_that_are_no_outputs_leave_the_remote_deaf),
        TEST(a_reset_starts_the_firmware_again),
        TEST(an_invalid_cookie_is_seen_when_the_port_starts),
        TEST(process_data_passes_in_the_order_of_the_tables),
        TEST(a_mode_that_a_remote_lacks_is_a_fault),
        TEST(sourcing_and_sinking_outputs_differ_at_the_terminal_alone),
        TEST(ordered_errors_come_once_each_and_leave_inputs_as_they_were),
        TEST(a_remote_lives_on_zeros_until_the_first_doit_and_bites_50_ms_after_the_last),
        TEST(a_stop_ends_what_keeps_a_waiting_remote_alive),
        TEST(a_pulled_cable_times_out_its_channel_alone),
        TEST(a_short_trips_when_the_output_comes_on),
        TEST(lost_field_power_is_a_fault_that_a_start_cannot_clear),
        TEST(non_volatile_parameters_work_from_the_next_power_up_on),
        TEST(another_baud_rate_is_not_understood),
        TEST(a_stop_all_during_a_doit_is_never_cleared_and_swallows_the_next_command),
        TEST(ignored_commands_may_be_written_at_any_time),
        TEST(a_motor_turns_by_the_output_with_inertia_while_it_is_enabled),
        TEST(a_motor_runs_out_when_the_remote_is_no_longer_fed),
        TEST(a_motor_stands_where_it_was_when_the_card_lost_its_power),
        TEST(motors_need_an_encoder_and_an_output),
        cmocka_unit_test(sserialb_has_seven_registers_a_channel_and_works_alike),
        TEST(what_cannot_be_plugged_is_refused_with_a_sentence),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
