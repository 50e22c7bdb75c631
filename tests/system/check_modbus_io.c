/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * modbus_io against servers of libmodbus and pymodbus, over TCP and over a pseudo-terminal, with their faults, and
 * against LinuxCNC's own mb2hal with the same file; hm2_mb2hal against mb2hal under LinuxCNC.
 */
#include <arpa/inet.h>
#include <check.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <modbus/modbus.h>

#include "folder.h"
#include "mb2hal_peer.h"
#include "shared_memory.h"
#include "suite.h"
#include "talk.h"

#define UNIT     17
#define TABLE    64
#define PORT     1502
#define LIMIT_MS 30000

/* ---- the device --------------------------------------------------------------------------------------------------*/

enum fault { NONE, SILENT, SLOW, TRUNCATED, WRONG_CRC };

/* Shared with the server's process. */
struct device {
    uint8_t coils[TABLE], inputs[TABLE];
    uint16_t holding[TABLE], input_registers[TABLE];
    atomic_int fault;
    atomic_uint writes; /* requests that wrote something */
    atomic_uint asked;
};

static struct device *device;
static pid_t server;
static char address[16], folder[64], terminal[64];
static int master = -1, listener = -1, response_ms;
static struct talk hal;

static bool is_write(const int function)
{
    return function == 5 || function == 6 || function == 15 || function == 16;
}

static void pause_ms(const long ms)
{
    const struct timespec t = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000};
    (void)nanosleep(&t, NULL);
}

static void answer(modbus_t *const modbus, const uint8_t *const query, const int length)
{
    modbus_mapping_t mapping = {.nb_bits = TABLE,
                                .nb_input_bits = TABLE,
                                .nb_registers = TABLE,
                                .nb_input_registers = TABLE,
                                .tab_bits = device->coils,
                                .tab_input_bits = device->inputs,
                                .tab_registers = device->holding,
                                .tab_input_registers = device->input_registers};
    static const uint8_t half[] = {0x00, 0x01, 0x00, 0x00, 0x00};
    static const uint8_t spoilt[] = {UNIT, 3, 2, 0, 1, 0xBA, 0xD0};
    const int fault = atomic_load(&device->fault);
    atomic_fetch_add(&device->asked, 1);
    if (fault == SILENT)
        return;
    if (fault == SLOW)
        pause_ms(600);
    if (fault == TRUNCATED)
        (void)!write(modbus_get_socket(modbus), half, sizeof half);
    else if (fault == WRONG_CRC)
        (void)!write(modbus_get_socket(modbus), spoilt, sizeof spoilt);
    else {
        /* Counted before the registers change, which is what the tests wait for. */
        atomic_fetch_add(&device->writes, is_write(query[modbus_get_header_length(modbus)]));
        (void)modbus_reply(modbus, query, length, &mapping);
    }
}

static void serve(modbus_t *const modbus)
{
    uint8_t query[MODBUS_MAX_ADU_LENGTH];
    for (;;) {
        const int length = modbus_receive(modbus, query);
        if (length > 0)
            answer(modbus, query, length);
        else if (length < 0 && master < 0)
            return;
        else if (length < 0)
            (void)modbus_flush(modbus);
    }
}

static void serve_tcp(void)
{
    modbus_t *const modbus = modbus_new_tcp(address, PORT);
    if (listener < 0)
        listener = modbus_tcp_listen(modbus, 1);
    if (listener < 0)
        _exit(3);
    while (modbus_tcp_accept(modbus, &listener) >= 0) {
        if (fork() == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            close(listener);
            serve(modbus);
            _exit(0);
        }
        close(modbus_get_socket(modbus)); /* modbus_close() would end the connection of the other process, too */
    }
    _exit(4);
}

static void serve_terminal(void)
{
    modbus_t *const modbus = modbus_new_rtu(terminal, 19200, 'E', 8, 1);
    modbus_set_socket(modbus, master);
    modbus_set_slave(modbus, UNIT);
    modbus_set_byte_timeout(modbus, 0, 20000);
    serve(modbus);
    _exit(4);
}

static void start_server(void)
{
    fflush(NULL);
    server = fork();
    ck_assert_int_ge(server, 0);
    if (server > 0)
        return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    signal(SIGCHLD, SIG_IGN);
    if (hal.host.pid) { /* else hm2host would never see the end of its input */
        close(hal.host.input);
        close(hal.host.output);
    }
    if (master >= 0)
        serve_terminal();
    serve_tcp();
}

static void stop_server(void)
{
    if (server <= 0)
        return;
    kill(server, SIGKILL);
    waitpid(server, NULL, 0);
    server = 0;
}

/* ---- the component -----------------------------------------------------------------------------------------------*/

static const char *path(const char *const name)
{
    static char paths[4][128];
    static unsigned next;
    char *const text = paths[next++ % 4];
    snprintf(text, sizeof paths[0], "%s/%s", folder, name);
    return text;
}

static void write_file(const char *const name, const char *const head, const char *const link, const char *const rest)
{
    FILE *const file = fopen(path(name), "we");
    ck_assert_ptr_nonnull(file);
    fprintf(file, "[MB2HAL_INIT]\n%s[TRANSACTION_00]\n%sMB_SLAVE_ID=%d\n%s", head, link, UNIT, rest);
    ck_assert_int_eq(fclose(file), 0);
}

static void set_up(void)
{
    device = shared_memory(sizeof *device);
    for (unsigned i = 0; i < TABLE; i++) {
        device->inputs[i] = i % 3 == 0;
        device->holding[i] = (uint16_t)(1000 + i);
        device->input_registers[i] = (uint16_t)(65535 - i);
    }
    device->coils[3] = 1;
    test_address(0, address);
    folder_make(folder, "modbus");
    master = -1;
    response_ms = 300;
}

static void tear_down(void)
{
    stop_server();
    folder_remove(folder);
    munmap(device, sizeof *device);
}

static const char *tcp_link(void)
{
    static char text[200];
    snprintf(text, sizeof text, "LINK_TYPE=tcp\nTCP_IP=%s\nTCP_PORT=%d\nMB_RESPONSE_TIMEOUT_MS=%d\n", address, PORT,
             response_ms);
    return text;
}

static const char *serial_link(void)
{
    static char text[300];
    snprintf(text, sizeof text,
             "LINK_TYPE=serial\nSERIAL_PORT=%s\nSERIAL_BAUD=19200\nSERIAL_BITS=8\nSERIAL_PARITY=even\nSERIAL_STOP=1\n"
             "SERIAL_DELAY_MS=1\nMB_RESPONSE_TIMEOUT_MS=300\nMB_BYTE_TIMEOUT_MS=100\n",
             terminal);
    return text;
}

/* Both ends stay open here, so that neither process sees the other's end as a hang-up. */
static void open_terminal(void)
{
    struct termios raw;
    master = posix_openpt(O_RDWR | O_NOCTTY);
    ck_assert_int_ge(master, 0);
    ck_assert(grantpt(master) == 0 && unlockpt(master) == 0);
    ck_assert_int_eq(ptsname_r(master, terminal, sizeof terminal), 0);
    const int slave = open(terminal, O_RDWR | O_NOCTTY);
    ck_assert(slave >= 0 && tcgetattr(slave, &raw) == 0);
    cfmakeraw(&raw);
    ck_assert_int_eq(tcsetattr(slave, TCSANOW, &raw), 0);
}

static void load(const char *const file)
{
    talk_start(&hal, NULL);
    talk_do(&hal, "loadrt modbus_io config=%s\nloadrt threads name1=servo period1=1000000\naddf mb2hal.update servo",
            file);
}

static void await_pin(const char *const name, const double least, const double most)
{
    double value = 0.0;
    for (unsigned ms = 0; ms < LIMIT_MS; ms += 20) {
        value = talk_value(&hal, name);
        if (value >= least && value <= most)
            return;
        pause_ms(20);
    }
    ck_abort_msg("%s is %g, expected %g to %g", name, value, least, most);
}

static void await_word(const uint16_t *const word, const uint16_t expected)
{
    for (unsigned ms = 0; ms < LIMIT_MS && *(const volatile uint16_t *)word != expected; ms += 20)
        pause_ms(20);
    ck_assert_uint_eq(*(const volatile uint16_t *)word, expected);
}

static void await_byte(const uint8_t *const byte, const uint8_t expected)
{
    for (unsigned ms = 0; ms < LIMIT_MS && *(const volatile uint8_t *)byte != expected; ms += 20)
        pause_ms(20);
    ck_assert_uint_eq(*(const volatile uint8_t *)byte, expected);
}

/* ---- what works --------------------------------------------------------------------------------------------------*/

static const char all_types[] =
    "MB_TX_CODE=fnct_01_read_coils\nFIRST_ELEMENT=2\nNELEMENTS=2\n"
    "[TRANSACTION_01]\nMB_TX_CODE=fnct_02_read_discrete_inputs\nFIRST_ELEMENT=5\nPIN_NAMES=a,b\n"
    "HAL_TX_NAME=ins\n"
    "[TRANSACTION_02]\nMB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=7\nNELEMENTS=2\n"
    "[TRANSACTION_03]\nMB_TX_CODE=fnct_04_read_input_registers\nFIRST_ELEMENT=0\nNELEMENTS=1\n"
    "[TRANSACTION_04]\nMB_TX_CODE=fnct_05_write_single_coil\nFIRST_ELEMENT=40\nNELEMENTS=1\n"
    "[TRANSACTION_05]\nMB_TX_CODE=fnct_06_write_single_register\nFIRST_ELEMENT=41\nNELEMENTS=1\n"
    "[TRANSACTION_06]\nMB_TX_CODE=fnct_15_write_multiple_coils\nFIRST_ELEMENT=42\nNELEMENTS=2\n"
    "[TRANSACTION_07]\nMB_TX_CODE=fnct_16_write_multiple_registers\nFIRST_ELEMENT=44\nNELEMENTS=2\n";

static const char settings[] = "setp mb2hal.04.00.bit 1\nsetp mb2hal.05.00.float 1234.9\nsetp mb2hal.05.00.int 5\n"
                               "setp mb2hal.06.01.bit 1\nsetp mb2hal.07.00.float -2\nsetp mb2hal.07.01.int 99\n";

/* All that the settings write has arrived. */
static void await_writes(void)
{
    await_byte(&device->coils[40], 1);
    await_word(&device->holding[41], 1239);
    await_byte(&device->coils[43], 1);
    await_word(&device->holding[44], 0xFFFE);
    await_word(&device->holding[45], 99);
}

static void every_type(const char *const link)
{
    write_file("all.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=8\n", link, all_types);
    start_server();
    load(path("all.ini"));
    talk_do(&hal, "%sstart", settings);
    await_pin("mb2hal.00.01.bit", 1, 1);
    await_pin("mb2hal.00.00.bit-inv", 1, 1);
    await_pin("mb2hal.ins.b.bit", 1, 1);
    await_pin("mb2hal.ins.a.bit-inv", 1, 1);
    await_pin("mb2hal.02.01.float", 1008, 1008);
    await_pin("mb2hal.02.00.int", 1007, 1007);
    await_pin("mb2hal.03.00.float", 65535, 65535);
    await_writes();
    ck_assert_uint_eq(device->coils[42], 0);
    device->holding[8] = 4321;
    await_pin("mb2hal.02.01.int", 4321, 4321);
    await_pin("mb2hal.02.connected", 1, 1);
    await_pin("mb2hal.02.stale", 0, 0);
    talk_end(&hal);
}

START_TEST(every_transaction_type_works_over_tcp)
{
    every_type(tcp_link());
}
END_TEST

START_TEST(every_transaction_type_works_over_a_terminal)
{
    open_terminal();
    every_type(serial_link());
}
END_TEST

START_TEST(types_scales_initial_values_and_enable_pins)
{
    const float speed = 1.5f;
    uint32_t bits;
    memcpy(&bits, &speed, sizeof bits);
    device->holding[0] = (uint16_t)bits;
    device->holding[1] = (uint16_t)(bits >> 16);
    device->holding[2] = 0xFF9C;
    device->holding[3] = 0x8001;
    write_file("typed.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=2\n", tcp_link(),
               "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=0\nPIN_NAMES=speed[*2+1],torque[*0.1],status\n"
               "ELEMENT_TYPES=f32,s16,bits\nWORD_ORDER=low-first\nHAL_TX_NAME=in\nMAX_UPDATE_RATE=100\n"
               "[TRANSACTION_01]\nMB_TX_CODE=fnct_16_write_multiple_registers\nFIRST_ELEMENT=20\nPIN_NAMES=n,word\n"
               "ELEMENT_TYPES=u32,bits\nINITIAL=65538,5\nHAL_TX_NAME=out\nENABLE_PIN=1\n");
    start_server();
    load(path("typed.ini"));
    talk_do(&hal, "start");
    await_pin("mb2hal.in.speed.float", 4, 4);
    await_pin("mb2hal.in.torque.float", -10.0001, -9.9999);
    await_pin("mb2hal.in.torque.int", -100, -100);
    await_pin("mb2hal.in.status.bit-15", 1, 1);
    await_pin("mb2hal.in.status.bit-14", 0, 0);
    await_pin("mb2hal.out.stale", 1, 1);
    ck_assert_uint_eq(device->holding[20], 1020);
    talk_do(&hal, "setp mb2hal.out.enable 1");
    await_word(&device->holding[20], 2);
    await_word(&device->holding[21], 1);
    await_word(&device->holding[22], 5);
    await_pin("mb2hal.out.stale", 0, 0);
    talk_end(&hal);
}
END_TEST

/* ---- what fails --------------------------------------------------------------------------------------------------*/

static const char two_ways[] =
    "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=0\nNELEMENTS=1\nHAL_TX_NAME=in\n"
    "[TRANSACTION_01]\nMB_TX_CODE=fnct_06_write_single_register\nFIRST_ELEMENT=30\nNELEMENTS=1\n"
    "HAL_TX_NAME=out\nWRITE_MODE=change\n";

static void load_two_ways(const char *const link, const char *const transactions)
{
    write_file("two.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=2\n", link, transactions);
    start_server();
    load(path("two.ini"));
    talk_do(&hal, "setp mb2hal.out.00.int 7\nstart");
    await_word(&device->holding[30], 7);
    await_pin("mb2hal.in.stale", 0, 0);
}

START_TEST(what_does_not_change_is_written_once)
{
    load_two_ways(tcp_link(), two_ways);
    const unsigned asked = device->asked;
    while (device->asked < asked + 20)
        pause_ms(5);
    ck_assert_uint_eq(device->writes, 1);
    talk_do(&hal, "setp mb2hal.out.00.int 8");
    await_word(&device->holding[30], 8);
    ck_assert_uint_eq(device->writes, 2);
    talk_end(&hal);
}
END_TEST

static double seconds(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

START_TEST(what_does_not_change_is_written_again_after_the_time_that_is_set)
{
    static char refreshed[sizeof two_ways + 16];
    const double start = seconds();
    snprintf(refreshed, sizeof refreshed, "%sREFRESH_S=0.3\n", two_ways);
    load_two_ways(tcp_link(), refreshed);
    while (device->writes < 4)
        pause_ms(5);
    ck_assert(seconds() - start >= 3 * 0.3);
    device->holding[30] = 99; /* the device has forgotten it */
    await_word(&device->holding[30], 7);
    talk_end(&hal);
}
END_TEST

START_TEST(a_server_that_was_killed_and_comes_back_gets_its_outputs_again)
{
    load_two_ways(tcp_link(), two_ways);
    device->fault = SILENT; /* in the middle of a transaction */
    const unsigned asked = device->asked;
    while (device->asked == asked)
        pause_ms(1);
    stop_server();
    await_pin("mb2hal.in.stale", 1, 1);
    await_pin("mb2hal.in.connected", 0, 0);
    await_pin("mb2hal.in.num_errors", 3, 1e9);
    await_pin("mb2hal.out.stale", 1, 1);
    await_pin("mb2hal.in.age", 0.2, 1e9);
    await_pin("mb2hal.in.00.int", 1000, 1000);
    device->fault = NONE;
    device->holding[30] = 0;
    device->holding[0] = 2000;
    start_server();
    await_pin("mb2hal.in.00.int", 2000, 2000);
    await_pin("mb2hal.in.stale", 0, 0);
    await_pin("mb2hal.in.num_errors", 0, 0);
    await_pin("mb2hal.in.errors", 3, 1e9);
    await_word(&device->holding[30], 7);
    talk_end(&hal);
}
END_TEST

/* A device whose queue of connections is full: it answers no more until its server takes them. */
static void make_busy_device(void)
{
    modbus_t *const modbus = modbus_new_tcp(address, PORT);
    listener = modbus_tcp_listen(modbus, 0);
    ck_assert_int_ge(listener, 0);
    ck_assert_int_eq(modbus_connect(modbus), 0); /* all that the queue holds */
    modbus_free(modbus);
}

/* Whether the kernel has asked for a connection to the device more than once, which it does after a second. */
static bool asked_again(void)
{
    char line[256], wanted[16];
    snprintf(wanted, sizeof wanted, "%08X:%04X", (unsigned)inet_addr(address), (unsigned)PORT);
    FILE *const connections = fopen("/proc/net/tcp", "re");
    ck_assert_ptr_nonnull(connections);
    bool found = false;
    while (!found && fgets(line, sizeof line, connections)) {
        char remote[16], tries[16];
        unsigned state;
        found = sscanf(line, " %*s %*s %15s %x %*s %*s %15s", remote, &state, tries) == 3 &&
                strcmp(remote, wanted) == 0 && state == TCP_SYN_SENT && strtoul(tries, NULL, 16) > 0;
    }
    fclose(connections);
    return found;
}

/* The longest time of the link's transactions, whether they run or not. */
START_TEST(a_connection_has_as_long_as_an_answer)
{
    response_ms = 100;
    write_file("slow.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=2\n", tcp_link(),
               "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=0\nNELEMENTS=1\nENABLE_PIN=1\n"
               "[TRANSACTION_01]\nMB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=1\nNELEMENTS=1\n"
               "ENABLE_PIN=0\nMB_RESPONSE_TIMEOUT_MS=25000\n");
    make_busy_device();
    load(path("slow.ini"));
    talk_do(&hal, "start");
    bool again = false;
    for (unsigned ms = 0; ms < LIMIT_MS && !again; ms += 20) {
        pause_ms(20);
        again = asked_again();
    }
    ck_assert(again);
    start_server();
    await_pin("mb2hal.01.00.int", 1001, 1001);
    ck_assert_double_eq(talk_value(&hal, "mb2hal.01.errors"), 0);
    talk_end(&hal);
}
END_TEST

START_TEST(a_connection_that_takes_longer_is_tried_anew)
{
    write_file("busy.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=1\n", tcp_link(),
               "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=1\nNELEMENTS=1\n");
    make_busy_device();
    load(path("busy.ini"));
    talk_do(&hal, "start");
    talk_wait_text(&hal, "cannot be opened: Connection timed out; trying again");
    await_pin("mb2hal.00.errors", 2, 1e9);
    ck_assert_double_eq(talk_value(&hal, "mb2hal.00.connected"), 0);
    start_server();
    await_pin("mb2hal.00.00.int", 1001, 1001);
    talk_end(&hal);
}
END_TEST

/* While the fault lasts nothing it brings is taken for good; afterwards all is as before. */
static void survive(const enum fault fault)
{
    device->fault = fault;
    await_pin("mb2hal.in.stale", 1, 1);
    await_pin("mb2hal.in.connected", 0, 0);
    ck_assert_double_eq(talk_value(&hal, "mb2hal.in.00.int"), 1000);
    device->holding[30] = 0;
    device->fault = NONE;
    await_pin("mb2hal.in.stale", 0, 0);
    await_pin("mb2hal.in.00.int", 1000, 1000);
    await_word(&device->holding[30], 7);
}

START_TEST(silent_slow_and_truncated_answers_over_tcp)
{
    load_two_ways(tcp_link(), two_ways);
    survive(SILENT);
    survive(SLOW);
    survive(TRUNCATED);
    talk_end(&hal);
}
END_TEST

START_TEST(silence_and_wrong_checksums_on_a_terminal)
{
    open_terminal();
    load_two_ways(serial_link(), two_ways);
    survive(SILENT);
    survive(WRONG_CRC);
    survive(TRUNCATED);
    talk_end(&hal);
}
END_TEST

START_TEST(a_port_without_rs485_is_told_with_what_to_do)
{
    open_terminal();
    write_file("rs485.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=1\n", serial_link(),
               "SERIAL_RS485=1\nMB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=1\nNELEMENTS=1\n");
    start_server();
    load(path("rs485.ini"));
    talk_do(&hal, "start");
    talk_wait_text(&hal, "no RS-485 mode. Leave SERIAL_RS485 out");
    await_pin("mb2hal.00.errors", 2, 1e9);
    ck_assert_double_eq(talk_value(&hal, "mb2hal.00.connected"), 0);
    ck_assert_uint_eq(device->asked, 0);
    talk_end(&hal);
}
END_TEST

START_TEST(an_exception_is_an_answer_and_counts_for_its_transaction_alone)
{
    response_ms = 20000; /* a busy machine is no error */
    write_file(
        "exception.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=2\nMB_BYTE_TIMEOUT_MS=20000\n", tcp_link(),
        "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=5000\nNELEMENTS=1\nHAL_TX_NAME=out-of-range\n"
        "[TRANSACTION_01]\nMB_TX_CODE=fnct_04_read_input_registers\nFIRST_ELEMENT=1\nNELEMENTS=1\nHAL_TX_NAME=in\n");
    start_server();
    load(path("exception.ini"));
    talk_do(&hal, "start");
    await_pin("mb2hal.out-of-range.errors", 2, 1e9);
    await_pin("mb2hal.out-of-range.connected", 1, 1);
    await_pin("mb2hal.out-of-range.stale", 1, 1);
    await_pin("mb2hal.in.00.int", 65534, 65534);
    await_pin("mb2hal.in.stale", 0, 0);
    /* Making the connection may have taken longer than it may; that counts for both. */
    const double before = talk_value(&hal, "mb2hal.in.errors");
    await_pin("mb2hal.out-of-range.errors", talk_value(&hal, "mb2hal.out-of-range.errors") + 2, 1e9);
    ck_assert_double_eq(talk_value(&hal, "mb2hal.in.errors"), before);
    talk_end(&hal);
}
END_TEST

START_TEST(a_unit_that_is_not_there_does_not_stop_the_others_on_the_line)
{
    open_terminal();
    write_file(
        "unit.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=2\n", serial_link(),
        "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=1\nNELEMENTS=1\nHAL_TX_NAME=there\nRETRIES=3\n"
        "[TRANSACTION_01]\nMB_SLAVE_ID=9\nMB_TX_CODE=fnct_04_read_input_registers\nFIRST_ELEMENT=1\nNELEMENTS=1\n"
        "HAL_TX_NAME=away\n");
    start_server();
    load(path("unit.ini"));
    talk_do(&hal, "start");
    await_pin("mb2hal.away.errors", 2, 1e9);
    await_pin("mb2hal.away.connected", 0, 0);
    await_pin("mb2hal.there.00.int", 1001, 1001);
    await_pin("mb2hal.there.stale", 0, 0);
    device->holding[1] = 17;
    await_pin("mb2hal.there.00.int", 17, 17);
    talk_end(&hal);
}
END_TEST

START_TEST(a_wrong_file_is_refused_with_its_line_and_files_are_instances)
{
    write_file("wrong.ini", "TOTAL_TRANSACTIONS=1\n", tcp_link(), "MB_TX_CODE=fnct_9\n");
    write_file("a.ini", "TOTAL_TRANSACTIONS=1\nHAL_MODULE_NAME=one\n", tcp_link(),
               "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=5\nNELEMENTS=1\n");
    write_file("b.ini", "TOTAL_TRANSACTIONS=1\nHAL_MODULE_NAME=two\n", tcp_link(),
               "MB_TX_CODE=fnct_02_read_discrete_inputs\nFIRST_ELEMENT=6\nNELEMENTS=1\n");
    start_server();
    talk_start(&hal, NULL);
    ck_assert_ptr_nonnull(strstr(talk_try(&hal, "loadrt modbus_io"), "no file given"));
    char command[300];
    snprintf(command, sizeof command, "loadrt modbus_io config=%s", path("wrong.ini"));
    ck_assert_ptr_nonnull(strstr(talk_try(&hal, command), "wrong.ini:9: MB_TX_CODE: 'fnct_9' is none of"));
    talk_do(&hal,
            "loadrt modbus_io config=%s,%s\nloadrt threads name1=servo period1=1000000\naddf one.update servo\n"
            "addf two.update servo\nstart",
            path("a.ini"), path("b.ini"));
    await_pin("one.00.00.int", 1005, 1005);
    talk_end(&hal);
}
END_TEST

/* ---- peers -------------------------------------------------------------------------------------------------------*/

static const char in_a_thread[] = "loadrt threads name1=servo period1=1000000\naddf mb2hal.update servo\nstart\n";

/* What is loaded under halrun makes of all.ini; false when this machine cannot run it. */
static bool run_peer(struct process *const halrun, const char *const load, const char *const more,
                     struct device *const after)
{
    static const struct mb2hal_pin until[] = {{"mb2hal.02.01.int", "1008"},
                                              {"mb2hal.03.00.int", "65535"},
                                              {"mb2hal.ins.b.bit", "TRUE"},
                                              {"mb2hal.00.01.bit", "TRUE"},
                                              {NULL, NULL}};
    struct device before;
    char commands[1000];
    snprintf(commands, sizeof commands, "%s%s", settings, more);
    memcpy(&before, device, sizeof before);
    if (!mb2hal_start(halrun, folder, load, "all.ini", commands, until)) {
        printf("%s", halrun->text);
        return false;
    }
    await_writes();
    mb2hal_finish(halrun, folder);
    memcpy(after, device, sizeof *after);
    memcpy(device, &before, sizeof before);
    return true;
}

static void expect_same_tables(const struct device *const a, const struct device *const b)
{
    ck_assert_mem_eq(a->coils, b->coils, sizeof a->coils);
    ck_assert_mem_eq(a->holding, b->holding, sizeof a->holding);
}

START_TEST(debians_mb2hal_has_the_same_pins_and_writes_the_same)
{
    static struct process halrun;
    static struct device after_mb2hal;
    write_file("all.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=8\n", tcp_link(), all_types);
    start_server();
    if (!run_peer(&halrun, "loadusr -W mb2hal", "", &after_mb2hal))
        return;
    load(path("all.ini"));
    talk_do(&hal, "%sstart", settings);
    await_writes();
    await_pin("mb2hal.02.01.int", 1008, 1008);
    await_pin("mb2hal.03.00.int", 65535, 65535);
    await_pin("mb2hal.ins.b.bit", 1, 1);
    await_pin("mb2hal.00.01.bit", 1, 1);
    ck_assert_uint_eq(mb2hal_missing(halrun.text, talk_try(&hal, "show pin")), 0);
    expect_same_tables(device, &after_mb2hal);
    talk_end(&hal);
}
END_TEST

/* LinuxCNC's user need not get into the folder that this was built in. */
START_TEST(hm2_mb2hal_is_mb2hal_with_more_pins)
{
    static struct process copy, theirs, ours;
    const char *const argv[] = {"/bin/cp", TEST_BUILD "/linuxcnc/hm2_mb2hal", folder, NULL};
    char load_ours[128];
    static struct device after_theirs, after_ours;
    if (access(TEST_BUILD "/linuxcnc/hm2_mb2hal", X_OK) != 0) {
        printf("SKIP: hm2_mb2hal is not built: LinuxCNC's library for programs is missing (linuxcnc-uspace-dev)\n");
        return;
    }
    write_file("all.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=8\n", tcp_link(), all_types);
    ck_assert_int_eq(process_run(&copy, argv, LIMIT_MS), 0);
    snprintf(load_ours, sizeof load_ours, "loadusr -W %s/hm2_mb2hal", folder);
    start_server();
    if (!run_peer(&theirs, "loadusr -W mb2hal", "", &after_theirs) || !run_peer(&ours, load_ours, "", &after_ours))
        return;
    ck_assert_uint_eq(mb2hal_missing(theirs.text, ours.text), 0);
    expect_same_tables(&after_ours, &after_theirs);
    ck_assert_ptr_nonnull(strstr(ours.text, "mb2hal.02.stale"));
}
END_TEST

START_TEST(modbus_io_in_linuxcnc_has_mb2hals_pins_and_writes_the_same)
{
    static struct process theirs, ours;
    static struct device after_theirs, after_ours;
    if (TEST_SANITIZED) {
        printf("SKIP: a component built with a sanitizer cannot be loaded into LinuxCNC\n");
        return;
    }
    write_file("all.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=8\n", tcp_link(), all_types);
    start_server();
    ck_assert_int_eq(setenv("PEER_MODULES", TEST_BUILD "/linuxcnc", 1), 0);
    if (!run_peer(&theirs, "loadusr -W mb2hal", "", &after_theirs) ||
        !run_peer(&ours, "loadrt modbus_io", in_a_thread, &after_ours))
        return;
    ck_assert_uint_eq(mb2hal_missing(theirs.text, ours.text), 0);
    expect_same_tables(&after_ours, &after_theirs);
}
END_TEST

START_TEST(a_server_of_pymodbus_gives_back_what_is_written)
{
    static struct process pymodbus;
    char port[8];
    snprintf(port, sizeof port, "%d", PORT);
    const char *const argv[] = {"/usr/bin/python3", TEST_SOURCE "/tests/system/pymodbus-server", address, port, NULL};
    if (!process_started_or_skipped(&pymodbus, argv, "starting", LIMIT_MS))
        return;
    write_file("pymodbus.ini", "VERSION=1.1\nTOTAL_TRANSACTIONS=8\n", tcp_link(),
               "MB_TX_CODE=fnct_05_write_single_coil\nFIRST_ELEMENT=3\nNELEMENTS=1\n"
               "[TRANSACTION_01]\nMB_TX_CODE=fnct_15_write_multiple_coils\nFIRST_ELEMENT=4\nNELEMENTS=9\n"
               "[TRANSACTION_02]\nMB_TX_CODE=fnct_01_read_coils\nFIRST_ELEMENT=3\nNELEMENTS=10\n"
               "[TRANSACTION_03]\nMB_TX_CODE=fnct_02_read_discrete_inputs\nFIRST_ELEMENT=1\nNELEMENTS=2\n"
               "[TRANSACTION_04]\nMB_TX_CODE=fnct_06_write_single_register\nFIRST_ELEMENT=10\nNELEMENTS=1\n"
               "[TRANSACTION_05]\nMB_TX_CODE=fnct_16_write_multiple_registers\nFIRST_ELEMENT=11\nPIN_NAMES=x\n"
               "ELEMENT_TYPES=f32\n"
               "[TRANSACTION_06]\nMB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=10\nPIN_NAMES=n,x\n"
               "ELEMENT_TYPES=u16,f32\n"
               "[TRANSACTION_07]\nMB_TX_CODE=fnct_04_read_input_registers\nFIRST_ELEMENT=99\nNELEMENTS=1\n");
    load(path("pymodbus.ini"));
    talk_do(&hal, "setp mb2hal.00.00.bit 1\nsetp mb2hal.01.08.bit 1\nsetp mb2hal.04.00.int 77\n"
                  "setp mb2hal.05.x.float -2.5\nstart");
    await_pin("mb2hal.02.00.bit", 1, 1);
    await_pin("mb2hal.02.09.bit", 1, 1);
    await_pin("mb2hal.02.01.bit", 0, 0);
    await_pin("mb2hal.03.01.bit", 1, 1);
    await_pin("mb2hal.06.n.int", 77, 77);
    await_pin("mb2hal.06.x.float", -2.5, -2.5);
    await_pin("mb2hal.07.00.int", 1099, 1099);
    process_stop(&pymodbus, SIGKILL, LIMIT_MS);
    await_pin("mb2hal.07.stale", 1, 1);
    talk_end(&hal);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("modbus_io");
    TCase *const tests = tcase_create("devices");
    tcase_set_timeout(tests, 120);
    tcase_add_checked_fixture(tests, set_up, tear_down);
    tcase_add_test(tests, every_transaction_type_works_over_tcp);
    tcase_add_test(tests, every_transaction_type_works_over_a_terminal);
    tcase_add_test(tests, types_scales_initial_values_and_enable_pins);
    tcase_add_test(tests, what_does_not_change_is_written_once);
    tcase_add_test(tests, what_does_not_change_is_written_again_after_the_time_that_is_set);
    tcase_add_test(tests, a_server_that_was_killed_and_comes_back_gets_its_outputs_again);
    tcase_add_test(tests, a_connection_has_as_long_as_an_answer);
    tcase_add_test(tests, a_connection_that_takes_longer_is_tried_anew);
    tcase_add_test(tests, silent_slow_and_truncated_answers_over_tcp);
    tcase_add_test(tests, silence_and_wrong_checksums_on_a_terminal);
    tcase_add_test(tests, a_port_without_rs485_is_told_with_what_to_do);
    tcase_add_test(tests, an_exception_is_an_answer_and_counts_for_its_transaction_alone);
    tcase_add_test(tests, a_unit_that_is_not_there_does_not_stop_the_others_on_the_line);
    tcase_add_test(tests, a_wrong_file_is_refused_with_its_line_and_files_are_instances);
    tcase_add_test(tests, debians_mb2hal_has_the_same_pins_and_writes_the_same);
    tcase_add_test(tests, hm2_mb2hal_is_mb2hal_with_more_pins);
    tcase_add_test(tests, modbus_io_in_linuxcnc_has_mb2hals_pins_and_writes_the_same);
    tcase_add_test(tests, a_server_of_pymodbus_gives_back_what_is_written);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
