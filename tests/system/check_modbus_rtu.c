/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * modbus_io on a serial line against a device of pymodbus's, with faults on the line, and LinuxCNC's own mb2hal with
 * the same file on the same line.
 */
#include <check.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "folder.h"
#include "mb2hal_peer.h"
#include "serial_pair.h"
#include "suite.h"
#include "talk.h"

#define LIMIT_MS 30000
#define STEP_US  5000

static struct serial_pair pair;
static struct process pymodbus;
static struct talk hal;
static char folder[FOLDER_PATH], config[128];

static void set_up(void)
{
    folder_make(folder, "modbus-rtu");
    snprintf(config, sizeof config, "%s/map.ini", folder);
    serial_pair_open(&pair);
}

static void tear_down(void)
{
    if (pymodbus.pid)
        (void)process_stop(&pymodbus, SIGKILL, LIMIT_MS);
    serial_pair_close(&pair);
    folder_remove(folder);
}

/* False when there is no pymodbus. */
static bool start_pymodbus(void)
{
    const char *const argv[] = {"/usr/bin/python3", TEST_SOURCE "/tests/system/pymodbus-server", pair.device, NULL};
    return process_started_or_skipped(&pymodbus, argv, "starting", LIMIT_MS);
}

static void write_map(const unsigned transactions, const unsigned time_out_ms, const char *const rest)
{
    FILE *const file = fopen(config, "we");
    ck_assert_ptr_nonnull(file);
    fprintf(file,
            "[MB2HAL_INIT]\nVERSION=1.1\nTOTAL_TRANSACTIONS=%u\n[TRANSACTION_00]\nLINK_TYPE=serial\nSERIAL_PORT=%s\n"
            "SERIAL_BAUD=19200\nSERIAL_BITS=8\nSERIAL_PARITY=none\nSERIAL_STOP=1\nSERIAL_DELAY_MS=1\nMB_SLAVE_ID=17\n"
            "MB_RESPONSE_TIMEOUT_MS=%u\nMB_BYTE_TIMEOUT_MS=100\n%s",
            transactions, pair.client, time_out_ms, rest);
    ck_assert_int_eq(fclose(file), 0);
}

static void load(const char *const settings)
{
    talk_start(&hal, NULL);
    talk_do(&hal,
            "loadrt modbus_io config=%s\nloadrt threads name1=servo period1=1000000\naddf mb2hal.update servo\n%sstart",
            config, settings);
}

/* ---- the same file -----------------------------------------------------------------------------------------------*/

static const char all_types[] =
    "MB_TX_CODE=fnct_05_write_single_coil\nFIRST_ELEMENT=3\nNELEMENTS=1\n"
    "[TRANSACTION_01]\nMB_TX_CODE=fnct_15_write_multiple_coils\nFIRST_ELEMENT=4\nNELEMENTS=9\n"
    "[TRANSACTION_02]\nMB_TX_CODE=fnct_01_read_coils\nFIRST_ELEMENT=3\nNELEMENTS=10\n"
    "[TRANSACTION_03]\nMB_TX_CODE=fnct_02_read_discrete_inputs\nFIRST_ELEMENT=1\nNELEMENTS=2\n"
    "[TRANSACTION_04]\nMB_TX_CODE=fnct_06_write_single_register\nFIRST_ELEMENT=10\nNELEMENTS=1\n"
    "[TRANSACTION_05]\nMB_TX_CODE=fnct_16_write_multiple_registers\nFIRST_ELEMENT=11\nPIN_NAMES=x,y\n"
    "[TRANSACTION_06]\nMB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=10\nPIN_NAMES=n,x,y\nHAL_TX_NAME=back\n"
    "[TRANSACTION_07]\nMB_TX_CODE=fnct_04_read_input_registers\nFIRST_ELEMENT=99\nNELEMENTS=1\n";

static const char settings[] = "setp mb2hal.00.00.bit 1\nsetp mb2hal.01.08.bit 1\nsetp mb2hal.04.00.int 77\n"
                               "setp mb2hal.05.x.float -2.7\nsetp mb2hal.05.y.int 9\n";

/* What both programs come to, whichever of the transactions is first. */
static const struct mb2hal_pin outcome[] = {{"mb2hal.02.00.bit", "TRUE"},
                                            {"mb2hal.02.09.bit", "TRUE"},
                                            {"mb2hal.03.01.bit", "TRUE"},
                                            {"mb2hal.back.n.int", "77"},
                                            {"mb2hal.back.y.int", "9"},
                                            {"mb2hal.07.00.int", "1099"},
                                            {NULL, NULL}};

static double number_of(const char *const value)
{
    return strcmp(value, "TRUE") == 0 ? 1 : strtod(value, NULL);
}

static void await_outcome(void)
{
    for (const struct mb2hal_pin *pin = outcome; pin->name; pin++)
        talk_wait(&hal, pin->name, number_of(pin->value), number_of(pin->value));
    talk_wait(&hal, "mb2hal.back.x.int", 65534, 65534);
}

START_TEST(pymodbus_gives_back_what_modbus_io_and_mb2hal_write)
{
    static struct process halrun;
    write_map(8, 1000, all_types);
    if (!start_pymodbus())
        return;
    load(settings);
    await_outcome();
    static char ours[PROCESS_OUTPUT_BYTES];
    snprintf(ours, sizeof ours, "%s", talk_try(&hal, "show pin"));
    talk_end(&hal);
    process_stop(&pymodbus, SIGKILL, LIMIT_MS);
    ck_assert(start_pymodbus());
    if (!mb2hal_start(&halrun, folder, "loadusr -W mb2hal", "map.ini", settings, outcome)) {
        printf("%s", halrun.text);
        return;
    }
    mb2hal_finish(&halrun, folder);
    ck_assert_uint_eq(mb2hal_missing(halrun.text, ours), 0);
}
END_TEST

/* ---- faults ------------------------------------------------------------------------------------------------------*/

/* What is written to two registers is read from each by itself: an answer that is taken for another's shows. */
static const char two_reads[] =
    "MB_TX_CODE=fnct_16_write_multiple_registers\nFIRST_ELEMENT=10\nNELEMENTS=2\nHAL_TX_NAME=out\nWRITE_MODE=change\n"
    "[TRANSACTION_01]\nMB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=10\nNELEMENTS=1\nHAL_TX_NAME=a\n"
    "[TRANSACTION_02]\nMB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=11\nNELEMENTS=1\nHAL_TX_NAME=b\n";

/* False when there is no pymodbus. */
static bool load_two_reads(const unsigned time_out_ms)
{
    write_map(3, time_out_ms, two_reads);
    if (!start_pymodbus())
        return false;
    load("setp mb2hal.out.00.int 77\nsetp mb2hal.out.01.int 88\n");
    talk_wait(&hal, "mb2hal.a.00.int", 77, 77);
    talk_wait(&hal, "mb2hal.b.00.int", 88, 88);
    return true;
}

static void expect_values(void)
{
    ck_assert_double_eq(talk_value(&hal, "mb2hal.a.00.int"), 77);
    ck_assert_double_eq(talk_value(&hal, "mb2hal.b.00.int"), 88);
}

static void await_good(void)
{
    talk_wait(&hal, "mb2hal.a.stale", 0, 0);
    talk_wait(&hal, "mb2hal.b.stale", 0, 0);
    talk_wait(&hal, "mb2hal.out.stale", 0, 0);
}

START_TEST(wrong_checksums_short_frames_and_answers_of_other_units_are_not_taken)
{
    static const enum wire_fault faults[] = {WIRE_SPOILT, WIRE_CUT, WIRE_OTHER_UNIT};
    if (!load_two_reads(300))
        return;
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
        pair.wire->fault = (int)faults[i];
        talk_wait(&hal, "mb2hal.a.stale", 1, 1);
        talk_wait(&hal, "mb2hal.b.stale", 1, 1);
        talk_wait(&hal, "mb2hal.b.num_errors", 2, 1e9);
        ck_assert_double_eq(talk_value(&hal, "mb2hal.b.connected"), 0);
        expect_values();
        pair.wire->fault = WIRE_CLEAN;
        await_good();
        expect_values();
    }
    talk_end(&hal);
}
END_TEST

static double all_errors(void)
{
    return talk_value(&hal, "mb2hal.a.errors") + talk_value(&hal, "mb2hal.b.errors") +
           talk_value(&hal, "mb2hal.out.errors");
}

/* Keep an answer until the component has given it up, and pass it on unless the next request has come meanwhile, which
 * a busy machine may bring about, or a component that does not wait. */
static void be_late(void)
{
    const double errors = all_errors();
    pair.wire->fault = WIRE_HELD;
    while (all_errors() <= errors)
        usleep(STEP_US);
    pair.wire->fault = WIRE_CLEAN;
    for (unsigned i = 0; i < 20; i++)
        expect_values();
}

START_TEST(an_answer_that_comes_after_its_time_is_not_taken_for_anothers)
{
    if (!load_two_reads(1000))
        return;
    for (unsigned i = 0; i < 10 && pair.wire->late < 3; i++)
        be_late();
    ck_assert_uint_ge(pair.wire->late, 3);
    await_good();
    expect_values();
    talk_end(&hal);
}
END_TEST

START_TEST(an_exception_of_pymodbus_counts_for_its_transaction_alone)
{
    write_map(2, 300,
              "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=5000\nNELEMENTS=1\nHAL_TX_NAME=beyond\n"
              "[TRANSACTION_01]\nMB_TX_CODE=fnct_04_read_input_registers\nFIRST_ELEMENT=1\nNELEMENTS=1\n");
    if (!start_pymodbus())
        return;
    load("");
    talk_wait(&hal, "mb2hal.beyond.connected", 1, 1);
    talk_wait(&hal, "mb2hal.beyond.stale", 1, 1);
    talk_wait(&hal, "mb2hal.01.00.int", 1001, 1001);
    talk_wait(&hal, "mb2hal.01.stale", 0, 0);
    talk_end(&hal);
}
END_TEST

START_TEST(a_device_that_dies_in_a_transaction_and_comes_back_gets_its_outputs_again)
{
    if (!load_two_reads(300))
        return;
    pair.wire->fault = WIRE_OPEN;
    const unsigned requests = pair.wire->requests;
    while (pair.wire->requests == requests)
        usleep(STEP_US);
    process_stop(&pymodbus, SIGKILL, LIMIT_MS);
    pair.wire->fault = WIRE_CLEAN;
    talk_wait(&hal, "mb2hal.a.stale", 1, 1);
    talk_wait(&hal, "mb2hal.a.connected", 0, 0);
    talk_wait(&hal, "mb2hal.a.age", 0.2, 1e9);
    expect_values();
    talk_do(&hal, "setp mb2hal.out.01.int 99");
    ck_assert(start_pymodbus()); /* all its registers are 0 again */
    talk_wait(&hal, "mb2hal.b.00.int", 99, 99);
    talk_wait(&hal, "mb2hal.a.00.int", 77, 77);
    await_good();
    talk_end(&hal);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("modbus_io, serial");
    TCase *const tests = tcase_create("lines");
    tcase_set_timeout(tests, 120);
    tcase_add_checked_fixture(tests, set_up, tear_down);
    tcase_add_test(tests, pymodbus_gives_back_what_modbus_io_and_mb2hal_write);
    tcase_add_test(tests, wrong_checksums_short_frames_and_answers_of_other_units_are_not_taken);
    tcase_add_test(tests, an_answer_that_comes_after_its_time_is_not_taken_for_anothers);
    tcase_add_test(tests, an_exception_of_pymodbus_counts_for_its_transaction_alone);
    tcase_add_test(tests, a_device_that_dies_in_a_transaction_and_comes_back_gets_its_outputs_again);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
