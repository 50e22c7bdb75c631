/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Simulated smart-serial remotes under programs that know real ones: Debian's mesaflash lists them, LinuxCNC's own
 * driver makes their pins and runs them, and closes loops over them.
 */
#include <check.h>
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "linuxcnc_peer.h"
#include "simulator.h"
#include "suite.h"

#define MESA_TRIES  10u
#define MESA_MS     20000
#define PEER_MS     60000 /* besides the time that it is to run */
#define CARD        "hm2_7i96s.0"
#define OUTPUTS     "32776" /* outputs 3 and 15 */
#define RUN_SECONDS "10"
#define PID_SECONDS "5"
#define LOAD_ONLY   "1"

static struct process run;

/* ---- mesaflash ----------------------------------------------------------------------------------------------------
 */

static void expect(const char *const *lines)
{
    const char *at = run.text;
    for (; *lines; lines++) {
        at = strstr(at, *lines);
        if (!at)
            process_give_up(&run, *lines); /* not there, or not in its place */
    }
}

/* It waits 2 ms for a card's first answer, once, which on a busy machine can be too short; and it waits for ever for
 * an answer that is lost. */
static void list_remotes(const struct simulator *const sim, const char *const device, const char *const verbose)
{
    const char *const argv[] = {"mesaflash", "--device", device, "--addr", sim->address[0], "--sserial", verbose, NULL};
    for (unsigned try = 0; try < MESA_TRIES; try++) {
        if (process_run(&run, argv, MESA_MS) == 0 && !strstr(run.text, "No "))
            return;
        usleep(100000);
    }
    process_give_up(&run, "mesaflash --sserial failed");
}

static void try_mesaflash(const char *const *const options, const char *const device, const char *const verbose,
                          const char *const *const lines)
{
    static struct simulator sim;
    if (!process_find("mesaflash")) {
        printf("SKIP: mesaflash is not installed\n");
        return;
    }
    simulator_start(&sim, options);
    list_remotes(&sim, device, verbose);
    expect(lines);
    simulator_stop(&sim);
}

START_TEST(mesaflash_lists_a_7i76_as_it_lists_a_real_one)
{
    static const char *const options[] = {"--realtime", "--remote", "0:0=7i76", NULL};
    static const char *const lines[] = {"SSLBP port 0:\n"
                                        "  SSLBP Version: 1.43\n"
                                        "  SSLBP Channels: 1\n"
                                        "  SSLBP Baud Rate: 2500000\n"
                                        "  sserial device at channel 0: 7I76 GPIO+SPINDLE (unit 0x1000",
                                        "    SwRevision = 14\n"
                                        "    HwRevision = 1\n"
                                        "    NVBaudRate = 2.5Mb\n"
                                        "    NVUnitNumber = 0x1000",
                                        "    NVWatchDogTimeout = 50ms\n"
                                        "    SOFTWARE MODE IO_Spin [index 00]\n"
                                        "    SOFTWARE MODE IO_Ana_Spin [index 01]\n",
                                        NULL};
    try_mesaflash(options, "7i96s", NULL, lines);
}
END_TEST

START_TEST(mesaflash_lists_7i77_7i77d_and_7i84_of_one_port)
{
    static const char *const options[] = {
        "--realtime", "--card",   "7i93",     "--firmware", TEST_DATA "/idrom/7I77x2_34.hex",
        "--remote",   "0:0=7i77", "--remote", "0:3=7i77d",  "--remote",
        "0:2=7i84",   NULL};
    static const char *const lines[] = {"SSLBP Channels: 6\n",
                                        "channel 0: 7I77 GPIO (unit 0x1200",
                                        "SOFTWARE MODE IO_Only [index 00]",
                                        "SOFTWARE MODE IO_Enc_Ana_FV [index 03]",
                                        "channel 1: 7I77 ANALOG (unit 0x1100",
                                        "SOFTWARE MODE Analog [index 00]",
                                        "channel 2: 7I84 (unit 0x1300",
                                        "channel 3: 7I77 GPIO (unit 0x1200",
                                        "channel 4: 7I77 ANALOG (unit 0x1100",
                                        NULL};
    try_mesaflash(options, "7i93", NULL, lines);
    if (strstr(run.text, "channel 5"))
        process_give_up(&run, "there is no remote at channel 5");
}
END_TEST

START_TEST(mesaflash_shows_parameters_and_where_they_are)
{
    static const char *const options[] = {"--realtime", "--remote", "0:0=7i76", NULL};
    static const char *const lines[] = {"interface type: 12\n",
                                        "SSLBP Processor Type: d8\n",
                                        "SSLBP Clock: 100 MHz\n",
                                        "UnitNumber = ",
                                        "[32 bits UNSIGNED IO | UNIT: None",
                                        "ADDR: 0680]\n",
                                        NULL};
    try_mesaflash(options, "7i96s", "--verbose", lines);
}
END_TEST

/* ---- LinuxCNC -----------------------------------------------------------------------------------------------------
 */

static struct simulator card; /* for commands to the one that the peer script starts */

static const char *const drivers[] = {"hm2_eth", "hm2_lbp16"};

static bool can_load(const char *const driver)
{
    if (strcmp(driver, "hm2_lbp16") != 0)
        return simulator_suits_linuxcnc();
    return linuxcnc_loads_ours();
}

static void start_peer(const char *const driver, const char *const hal, const char *const config,
                       const char *const seconds, const char *const *options)
{
    static char out[256], file[256];
    const char *argv[64] = {
        TEST_SOURCE "/tests/system/linuxcnc-peer", TEST_BUILD, out, "7i96s_7i77d", file, "--control", card.control};
    unsigned n = 7;
    snprintf(out, sizeof out, "%s/peer-sserial", TEST_BUILD);
    ck_assert(mkdir(out, 0755) == 0 || errno == EEXIST);
    snprintf(file, sizeof file, "%s/tests/system/hal/%s", TEST_SOURCE, hal);
    snprintf(card.control, sizeof card.control, "/tmp/check-sserial-%d", (int)getpid());
    for (; *options; options++)
        argv[n++] = *options;
    linuxcnc_tell("PEER_DRIVER", driver);
    if (strcmp(driver, "hm2_lbp16") == 0)
        linuxcnc_tell("PEER_MODULES", TEST_BUILD "/linuxcnc");
    linuxcnc_tell("PEER_CARD", CARD);
    linuxcnc_tell("PEER_CONFIG", config);
    linuxcnc_tell("PEER_SECONDS", seconds);
    process_start(&run, argv);
}

/* HM2_LONG_SECONDS=60 in the environment makes it longer. */
static const char *run_seconds(void)
{
    const char *const wanted = getenv("HM2_LONG_SECONDS");
    return wanted && *wanted ? wanted : RUN_SECONDS;
}

/* False when this machine cannot run it, which was said then. */
static bool end_peer(void)
{
    if (!process_wait_end(&run, PEER_MS + 1000 * atoi(run_seconds())))
        process_stop(&run, SIGKILL, 0);
    unlink(card.control);
    if (linuxcnc_skipped(&run))
        return false;
    if (run.status != 0)
        process_give_up(&run, "not a good end");
    return true;
}

/* "TYPE DIR VALUE" of a pin or parameter in the lists at the end, in single spaces; "" when there is none. */
static const char *shown(const char *const name)
{
    static char line[128];
    char full[96];
    const int len = snprintf(full, sizeof full, " " CARD ".%s", name);
    const char *at = run.text;
    while ((at = strstr(at, full)) && at[len] != '\n' && at[len] != ' ')
        at++;
    line[0] = '\0';
    if (!at)
        return line;
    const char *start = at;
    while (start > run.text && start[-1] != '\n')
        start--;
    char kind[16], direction[16], value[32];
    if (sscanf(start, " %*u %15s %15s %31s", kind, direction, value) == 3)
        snprintf(line, sizeof line, "%s %s %s", kind, direction, value);
    return line;
}

static void expect_shown(const char *const name, const char *const what)
{
    if (strcmp(shown(name), what) == 0)
        return;
    printf("%s: expected \"%s\", got \"%s\"\n", name, what, shown(name));
    process_give_up(&run, name);
}

struct expected {
    const char *name, *what;
};

/* What every 7I77 has; outputs and parameters as the HAL file sets them. */
static const struct expected every_mode[] = {
    {"sserial.port-0.run", "bit IN TRUE"},
    {"sserial.port-0.port_state", "u32 OUT 0x00000003"},
    {"sserial.port-0.fault-inc", "u32 RW 0x0000000A"},
    {"7i77.0.0.input-00", "bit OUT FALSE"},
    {"7i77.0.0.input-31-not", "bit OUT TRUE"},
    {"7i77.0.0.output-03", "bit IN TRUE"},
    {"7i77.0.0.output-15-invert", "bit RW TRUE"},
    {"7i77.0.0.swrevision", "u32 RO 0x0000000E"},
    {"7i77.0.0.nvbaudrate", "u32 RW 0x00000009"},
    {"7i77.0.0.nvwatchdogtimeout", "u32 RW 0x00000032"},
    {"7i77.0.0.watchdogtimeout", "u32 RW 0x000003E8"},
    {"7i77.0.1.analogena", "bit IN TRUE"},
    {"7i77.0.1.spinena", "bit IN FALSE"},
    {"7i77.0.1.analogout0", "float IN 5"},
    {"7i77.0.1.analogout5", "float IN -10"},
    {"7i77.0.1.analogout5-scalemax", "float RW 10"},
    {"7i77.0.1.analogout5-maxlim", "float RW 10"},
    {"7i77.0.1.analogout5-minlim", "float RW -10"},
};

/* What modes add, from the first on that has it. */
static const struct {
    unsigned mode;
    const char *name, *what;
} some_modes[] = {
    {1, "7i77.0.0.analogin0", "float OUT 0"},
    {1, "7i77.0.0.analogin3-scalemax", "float RW 36.3"},
    {2, "7i77.0.0.fieldvoltage", "float OUT 24.05765"}, /* 169 of 255 parts of 36.3 V */
    {3, "7i77.0.0.enc0.count", "s32 OUT 0"},
    {3, "7i77.0.0.enc1.position", "float OUT 0"},
    {3, "7i77.0.0.enc1.index-enable", "bit I/O FALSE"},
};

static void check_pins(const unsigned mode)
{
    for (size_t i = 0; i < sizeof every_mode / sizeof every_mode[0]; i++)
        expect_shown(every_mode[i].name, every_mode[i].what);
    for (size_t i = 0; i < sizeof some_modes / sizeof some_modes[0]; i++)
        expect_shown(some_modes[i].name, some_modes[i].mode <= mode ? some_modes[i].what : "");
}

/* Until the port runs; the answer is what arrives at the terminals. */
static void wait_for_outputs(void)
{
    for (unsigned i = 0; i < 300 && !run.ended; i++) {
        if (access(card.control, F_OK) == 0 && strcmp(simulator_ask(&card, "remote 0:0 get Output"), OUTPUTS) == 0)
            return;
        (void)process_wait_end(&run, 100);
    }
    if (!run.ended)
        process_give_up(&run, "the outputs do not come on");
}

static const char *const remote_option[] = {"--remote", "0:0=7i77", NULL};

/* LinuxCNC's own driver, and ours. */
START_TEST(a_driver_runs_a_7i77)
{
    if (!can_load(drivers[_i]))
        return;
    start_peer(drivers[_i], "sserial.hal", "num_encoders=8 num_stepgens=5 sserial_port_0=00xxxxxx", run_seconds(),
               remote_option);
    wait_for_outputs();
    if (!run.ended) {
        ck_assert_str_eq(simulator_ask(&card, "remote 0:1 get AnalogEna"), "1");
        ck_assert_double_eq_tol(strtod(simulator_ask(&card, "remote 0:1 get AnalogOut0"), NULL), 5, 0.005);
        ck_assert_str_eq(simulator_ask(&card, "remote 0:1 get AnalogOut5"), "-10");
    }
    if (end_peer())
        check_pins(0);
}
END_TEST

START_TEST(linuxcncs_own_driver_makes_the_pins_of_each_mode)
{
    char config[64];
    if (!can_load("hm2_eth"))
        return;
    snprintf(config, sizeof config, "num_encoders=8 num_stepgens=5 sserial_port_0=%d0xxxxxx", _i);
    start_peer("hm2_eth", "sserial.hal", config, LOAD_ONLY, remote_option);
    wait_for_outputs();
    if (end_peer())
        check_pins((unsigned)_i);
}
END_TEST

START_TEST(six_loops_close_over_analog_outputs_and_muxed_encoders)
{
    static const char *const options[] = {"--remote", "0:0=7i77",
                                          "--servo",  "0:0:1:AnalogOut0:100000:20",
                                          "--servo",  "1:0:1:AnalogOut1:100000:20",
                                          "--servo",  "2:0:1:AnalogOut2:100000:20",
                                          "--servo",  "3:0:1:AnalogOut3:100000:20",
                                          "--servo",  "4:0:1:AnalogOut4:100000:20",
                                          "--servo",  "5:0:1:AnalogOut5:100000:20",
                                          NULL};
    static const double positions[] = {10, -10, 20, -20, 30, -30};
    if (!can_load(drivers[_i]))
        return;
    start_peer(drivers[_i], "sserial-pid.hal", "num_encoders=8 num_stepgens=5 sserial_port_0=00xxxxxx", PID_SECONDS,
               options);
    if (!end_peer())
        return;
    for (unsigned i = 0; i < sizeof positions / sizeof positions[0]; i++) {
        char name[32], kind[8], direction[8];
        double position = 0;
        snprintf(name, sizeof name, "encoder.%02u.position", i);
        ck_assert_int_eq(sscanf(shown(name), "%7s %7s %lf", kind, direction, &position), 3);
        if (fabs(position - positions[i]) > 0.05)
            process_give_up(&run, name);
    }
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("sserial_peers");
    TCase *const tests = tcase_create("peers");
    tcase_set_timeout(tests, 100 + atoi(run_seconds()));
    tcase_add_test(tests, mesaflash_lists_a_7i76_as_it_lists_a_real_one);
    tcase_add_test(tests, mesaflash_lists_7i77_7i77d_and_7i84_of_one_port);
    tcase_add_test(tests, mesaflash_shows_parameters_and_where_they_are);
    tcase_add_loop_test(tests, a_driver_runs_a_7i77, 0, 2);
    tcase_add_loop_test(tests, linuxcncs_own_driver_makes_the_pins_of_each_mode, 1, 4);
    tcase_add_loop_test(tests, six_loops_close_over_analog_outputs_and_muxed_encoders, 0, 2);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
