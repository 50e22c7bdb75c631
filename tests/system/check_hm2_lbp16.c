/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The component hm2_lbp16 in hm2host against simulated cards on real UDP: loading, what a refused load says and leaves
 * behind, several cards, faults of the network and of the card, and unloading. Waits are for conditions; the read
 * time-out is long, because the machine that runs this may be busy.
 */
#include <check.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "relay.h"
#include "simulator.h"
#include "suite.h"
#include "talk.h"

#define COUNT(array) ((int)(sizeof(array) / sizeof((array)[0])))

#define SSR_IO          12 /* 7I96S: output 1 of the solid-state relays */
#define STEP_IO         17 /* step output of step generator 0 */
#define GPIO_IO         34 /* first pin of P1 */
#define WATCHDOG_TIMER  0x0C00u
#define WATCHDOG_STATUS 0x0D00u /* bit 0: it has bitten */
#define BITE_MS         1500    /* less than the time-out of most tests: this bite is not the clock's */
#define ACTIVE_MS       5000

static struct simulator sim;
static struct talk hal;

/* ---- helpers ---------------------------------------------------------------------------------------------------- */

static void load_line(char line[const 512], const unsigned cards, const char *const rest)
{
    int len = snprintf(line, 512, "loadrt hm2_lbp16 board_ip=");
    for (unsigned i = 0; i < cards; i++)
        len += snprintf(line + len, 512 - (size_t)len, "%s%s", i ? "," : "", sim.address[i]);
    (void)snprintf(line + len, 512 - (size_t)len, " %s", rest);
}

static void load(const unsigned cards, const char *const rest)
{
    char line[512];
    load_line(line, cards, rest);
    talk_do(&hal, "%s", line);
}

/* A card of the cycle, with time enough for a busy machine. */
static void schedule(const char *const card)
{
    talk_do(&hal,
            "addf %s.read servo\naddf %s.write servo\nsetp %s.packet-read-timeout 100000000\n"
            "setp %s.watchdog.timeout_ns 4000000000",
            card, card, card, card);
}

/* One 7I96S that runs at 1 kHz and has been written to. */
static void run_a_7i96s(const char *const *const options, const char *const rest)
{
    simulator_start(&sim, options);
    talk_start(&hal, NULL);
    load(1, rest);
    talk_do(&hal, "loadrt threads name1=servo period1=1000000");
    schedule("hm2_7i96s.0");
    talk_do(&hal, "setp hm2_7i96s.0.gpio.034.is_output 1\nstart");
    for (unsigned ms = 0; ms < ACTIVE_MS && simulator_pad(&sim, 0, STEP_IO) == 'z'; ms += 10)
        usleep(10000);
    ck_assert_int_ne(simulator_pad(&sim, 0, STEP_IO), 'z');
}

static double value(const char *const name)
{
    char full[128];
    snprintf(full, sizeof full, "hm2_7i96s.0.%s", name);
    return talk_value(&hal, full);
}

static void wait_for(const char *const name, const double low, const double high)
{
    char full[128];
    snprintf(full, sizeof full, "hm2_7i96s.0.%s", name);
    talk_wait(&hal, full, low, high);
}

static bool exists(const char *const name)
{
    char command[128];
    snprintf(command, sizeof command, "getp %s", name);
    return !strstr(talk_try(&hal, command), "there is no parameter or pin");
}

/* A card whose watchdog has bitten drives nothing, and says so. */
static bool has_bitten(const unsigned card)
{
    return (simulator_read(&sim, card, WATCHDOG_STATUS) & 1u) && simulator_pad(&sim, card, STEP_IO) == 'z';
}

static void wait_for_bite(const unsigned card)
{
    for (unsigned ms = 0; ms < BITE_MS && !has_bitten(card); ms += 10)
        usleep(10000);
    ck_assert_msg(has_bitten(card), "the watchdog of card %u has not bitten: status %08X, timer %08X, step pin %c",
                  card, simulator_read(&sim, card, WATCHDOG_STATUS), simulator_read(&sim, card, WATCHDOG_TIMER),
                  simulator_pad(&sim, card, STEP_IO));
}

/* ---- loading ---------------------------------------------------------------------------------------------------- */

/* What is offered beyond LinuxCNC's driver: cause counters, times, and what later versions added. */
static const char *const additions[] = {"packet-lost",
                                        "packet-late",
                                        "packet-stale",
                                        "packet-malformed",
                                        "packet-strangers",
                                        "write-lost",
                                        "data-age",
                                        "position-lost",
                                        "auto-rearm",
                                        "auto-rearms",
                                        "rtt-min-us",
                                        "rtt-us",
                                        "rtt-max-us",
                                        "rtt-reset",
                                        "encoder.00.position-interpolated",
                                        "encoder.00.no_clear_on_index",
                                        "read.time",
                                        "write.time",
                                        "read-request.time",
                                        "read.tmax",
                                        "write.tmax",
                                        "read-request.tmax",
                                        "read.tmax-increased",
                                        "write.tmax-increased",
                                        "read-request.tmax-increased"};

struct object {
    char name[64], type[8], dir[8];
    bool known;
};

static struct object objects[1024];
static unsigned object_count;

/* Rows of `show pin` or `show param`: owner, type, direction, value, name. */
static void take_objects(const char *text)
{
    int owner, len;
    for (; *text; text += strcspn(text, "\n"), text += *text == '\n') {
        struct object *const o = &objects[object_count];
        if (sscanf(text, "%d %7s %7s %*s %63s%n", &owner, o->type, o->dir, o->name, &len) == 4 &&
            strncmp(o->name, "hm2_7i96s.0.", 12) == 0) {
            o->known = false;
            if (strcmp(o->dir, "I/O") == 0) /* as halcmd shows it */
                memcpy(o->dir, "IO", sizeof "IO");
            ck_assert_int_lt((int)++object_count, COUNT(objects));
        }
    }
}

static struct object *find_object(const char *const name)
{
    for (unsigned i = 0; i < object_count; i++)
        if (strcmp(objects[i].name, name) == 0)
            return &objects[i];
    return NULL;
}

/* Objects are shown by their aliases: give them their own names. Returns how many there were. */
static unsigned undo_aliases(const char *text)
{
    char alias[64], name[64];
    unsigned count = 0;
    for (; *text; text += strcspn(text, "\n"), text += *text == '\n') {
        if (sscanf(text, " %63s %63s", alias, name) != 2 || strncmp(name, "hm2_", 4) != 0)
            continue;
        struct object *const o = find_object(alias);
        ck_assert_ptr_nonnull(o);
        memcpy(o->name, name, sizeof o->name);
        count++;
    }
    return count;
}

/* A parameter that LinuxCNC has read-only, here to be set: files that are valid there stay valid. */
static bool is_as_listed(const struct object *const o, const char *const type, const char *const dir)
{
    return strcmp(o->type, type) == 0 &&
           (strcmp(o->dir, dir) == 0 || strcmp(o->name, "hm2_7i96s.0.packet-error-decrement") == 0);
}

START_TEST(a_7i96s_offers_what_linuxcncs_driver_offers)
{
    char kind[8], type[8], dir[8], name[64], line[256], full[80];
    unsigned rows = 0;
    simulator_start(&sim, NULL);
    talk_start(&hal, NULL);
    load(1, "");
    object_count = 0;
    take_objects(talk_try(&hal, "show pin"));
    take_objects(talk_try(&hal, "show param"));
    ck_assert_uint_eq(undo_aliases(talk_try(&hal, "show alias")), 20);
    FILE *const file = fopen(TEST_DATA "/hal/7i96s.txt", "r");
    ck_assert_ptr_nonnull(file);
    while (fgets(line, sizeof line, file)) {
        if (line[0] == '#')
            continue;
        rows++;
        ck_assert_int_eq(sscanf(line, "%7s %7s %7s %63s", kind, type, dir, name), 4);
        struct object *const o = find_object(name);
        ck_assert_msg(o != NULL, "%s is missing", name);
        ck_assert_msg(is_as_listed(o, type, dir), "%s: %s %s instead of %s %s", name, o->type, o->dir, type, dir);
        o->known = true;
    }
    fclose(file);
    ck_assert_uint_eq(rows, 488);
    for (int i = 0; i < COUNT(additions); i++) {
        snprintf(full, sizeof full, "hm2_7i96s.0.%s", additions[i]);
        struct object *const o = find_object(full);
        ck_assert_msg(o != NULL, "%s is missing", full);
        o->known = true;
    }
    for (unsigned i = 0; i < object_count; i++)
        ck_assert_msg(objects[i].known, "%s is new: tell it here", objects[i].name);
    ck_assert(exists("hm2_7i96s.0.stepgen.04.direction.invert_output")); /* the other name of gpio.026's */
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(several_cards_are_numbered_by_type_and_take_their_own_configuration)
{
    simulator_start(&sim, (const char *const[]){"--card", "7i96s", "--card", "7i93", "--card", "7i96s", NULL});
    talk_start(&hal, NULL);
    load(3, "config=\"num_stepgens=2\",\"num_encoders=3 enable_raw\",\"num_encoders=0\"");
    const char *const functions = talk_try(&hal, "show funct");
    static const char *const names[] = {"hm2_7i96s.0.read-request", "hm2_7i96s.0.read", "hm2_7i96s.0.write",
                                        "hm2_7i96s.1.read",         "hm2_7i93.0.read",  "hm2_7i93.0.write"};
    for (int i = 0; i < COUNT(names); i++)
        ck_assert_msg(strstr(functions, names[i]) != NULL, "no %s: %s", names[i], functions);
    static const struct {
        const char *name;
        bool exists;
    } objects_there[] = {
        {"hm2_7i96s.0.stepgen.01.enable", true}, {"hm2_7i96s.0.stepgen.02.enable", false},
        {"hm2_7i96s.0.gpio.021.out", true},      {"hm2_7i96s.1.stepgen.04.enable", true},
        {"hm2_7i96s.0.encoder.00.count", true},  {"hm2_7i96s.1.encoder.00.count", false},
        {"hm2_7i93.0.encoder.02.count", true},   {"hm2_7i93.0.encoder.03.count", false},
        {"hm2_7i93.0.pwmgen.07.enable", true},   {"hm2_7i93.0.raw.read_address", true},
        {"hm2_7i96s.0.raw.read_address", false}, {"hm2_7i93.1.io_error", false},
    };
    for (int i = 0; i < COUNT(objects_there); i++)
        ck_assert_msg(exists(objects_there[i].name) == objects_there[i].exists, "%s", objects_there[i].name);
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(load_lines_of_linuxcnc_are_accepted)
{
    simulator_start(&sim, NULL);
    talk_start(&hal, NULL);
    load(1, "config=\" num_encoders=1  num_stepgens=0x3 firmware=hm2/7i96s/x.bin sserial_port_0=00xxxxxx\" "
            "board_rtnet=posix firewall=none debug=1 debug_idrom=1 debug_module_descriptors=1 "
            "debug_pin_descriptors=1 debug_modules=1 use_serial_numbers=0 sserial_baudrate=-1");
    ck_assert(strstr(hal.host.text, "IO Pin 017 (TB1-2,3): StepGen #0, pin Step"));
    ck_assert(strstr(hal.host.text, "payload of a cycle: request "));
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

/* ---- loads that fail -------------------------------------------------------------------------------------------- */

/* Nothing of the component may be left in HAL, and the same process can load a card afterwards. */
static void expect_no_trace(void)
{
    static const char *const lists[] = {"list comp", "list pin", "list param", "list funct"};
    for (int i = 0; i < COUNT(lists); i++) {
        const char *const answer = talk_try(&hal, lists[i]);
        ck_assert_msg(!strstr(answer, "hm2_"), "%s: %s", lists[i], answer);
    }
}

static void expect_refusal(const char *const line, const char *const *const sentences)
{
    const char *const answer = talk_try(&hal, line);
    for (const char *const *sentence = sentences; *sentence; sentence++)
        if (!strstr(answer, *sentence))
            ck_abort_msg("%s\nno \"%s\" in: %s", line, *sentence, answer);
    ck_assert_msg(strstr(answer, "component 'hm2_lbp16' refused to load") != NULL, "%s: %s", line, answer);
    expect_no_trace();
}

static const struct {
    const char *parameters;
    const char *sentences[4];
} bad_configs[] = {
    {"config=num_stepgens=6", {"num_stepgens=6 found, at most 5 expected"}},
    {"config=\"num_encoders=3 num_pwmgens=2\"", {"num_encoders=3 found, at most 1", "num_pwmgens=2 found, at most 1"}},
    {"config=num_wheels=1", {"\"num_wheels=1\" is not known", "expected num_"}},
    {"config=num_encoders=-2", {"\"num_encoders=-2\"", "from -1 to"}},
    {"config=num_encoders=1x", {"\"num_encoders=1x\"", "a whole number"}},
    {"config=num_encoders", {"\"num_encoders\"", "a whole number"}},
    {"config=enable_raw=1", {"\"enable_raw=1\": no value is expected"}},
    {"config=stepgen_width=9", {"\"stepgen_width=9\"", "from 1 to 8"}},
    {"config=sserial_port_0=0y", {"\"sserial_port_0=0y\"", "a digit for the mode"}},
    {"config=ssi_chan_0=%%", {"\"ssi_chan_0=%%\"", "name%<length>"}},
};

START_TEST(a_bad_configuration_is_refused_with_the_key_the_value_and_the_limit)
{
    char line[512];
    simulator_start(&sim, NULL);
    talk_start(&hal, NULL);
    for (int i = 0; i < COUNT(bad_configs); i++) {
        load_line(line, 1, bad_configs[i].parameters);
        expect_refusal(line, bad_configs[i].sentences);
    }
    load(1, "config=num_stepgens=5"); /* the limit itself */
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

static const struct {
    const char *addresses;
    const char *sentences[3];
} bad_addresses[] = {
    {"", {"no card given; load with: loadrt hm2_lbp16 board_ip="}},
    {"nowhere", {"Card address \"nowhere\"", "write A.B.C.D"}},
    {"127.0.0.256", {"Card address \"127.0.0.256\"", "0 to 255"}},
    {"127.0.0.1:0", {"the port must be 1 to 65535"}},
    {"224.0.0.1", {"the address of a group or of nobody"}},
    {"127.0.0.9,127.0.0.9:27181", {"cards 0 and 1 both have the address 127.0.0.9"}},
};

START_TEST(a_bad_address_is_refused_with_a_sentence)
{
    char line[512];
    talk_start(&hal, NULL);
    for (int i = 0; i < COUNT(bad_addresses); i++) {
        snprintf(line, sizeof line, "loadrt hm2_lbp16 board_ip=%s", bad_addresses[i].addresses);
        expect_refusal(line, bad_addresses[i].sentences);
    }
    talk_end(&hal);
}
END_TEST

static const struct {
    const char *parameter;
    const char *sentences[2];
} bad_receive_paths[] = {
    {"receive=xdp", {"receive=xdp: expected wait or spin"}},
    {"receive=spinning", {"receive=spinning: expected wait or spin"}},
    {"busy_poll=-1", {"busy_poll=-1: expected 0 to 1000000 microseconds"}},
    {"busy_poll=1000001", {"busy_poll=1000001: expected 0 to 1000000 microseconds"}},
};

START_TEST(a_receive_path_that_does_not_exist_is_refused)
{
    char line[512];
    talk_start(&hal, NULL);
    for (int i = 0; i < COUNT(bad_receive_paths); i++) {
        snprintf(line, sizeof line, "loadrt hm2_lbp16 board_ip=127.0.0.9 %s", bad_receive_paths[i].parameter);
        expect_refusal(line, bad_receive_paths[i].sentences);
    }
    talk_end(&hal);
}
END_TEST

START_TEST(a_card_that_is_not_there_is_said_to_be_not_there)
{
    char line[512], nobody[16];
    talk_start(&hal, NULL);
    test_address(3, nobody);
    snprintf(line, sizeof line, "loadrt hm2_lbp16 board_ip=%s", nobody);
    expect_refusal(line, (const char *const[]){nobody, "no card answers after 5 requests", "Check the card's power",
                                               "not loaded: no answer in time", NULL});
    talk_end(&hal);
}
END_TEST

START_TEST(a_card_that_says_nothing_for_half_a_second_is_loaded_all_the_same)
{
    char line[512];
    simulator_start(&sim, (const char *const[]){"--faults", "loss=1", NULL});
    talk_start(&hal, NULL);
    load_line(line, 1, "");
    talk_say(&hal, line);
    usleep(500000);
    simulator_do(&sim, "faults none");
    talk_do(&hal, "getp hm2_7i96s.0.packet-error-total");
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(when_the_second_card_is_missing_the_first_ones_watchdog_is_bitten)
{
    char line[512];
    simulator_start(&sim, NULL);
    talk_start(&hal, NULL);
    ck_assert(!has_bitten(0));
    load_line(line, 2, "");
    expect_refusal(line, (const char *const[]){sim.address[1], "no card answers", NULL});
    wait_for_bite(0);
    load(1, ""); /* and it can be had again */
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(when_the_configuration_of_the_second_card_is_bad_both_are_bitten)
{
    char line[512];
    simulator_start(&sim, (const char *const[]){"--card", "7i96s", "--card", "7i93", NULL});
    talk_start(&hal, NULL);
    load_line(line, 2, "config=,num_encoders=99");
    expect_refusal(line, (const char *const[]){"hm2_7i93.0: config num_encoders=99 found, at most 8", NULL});
    wait_for_bite(0);
    ck_assert(simulator_read(&sim, 1, WATCHDOG_STATUS) & 1u);
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(what_is_odd_but_harmless_in_a_configuration_is_told)
{
    simulator_start(&sim, NULL);
    talk_start(&hal, NULL);
    load(1, "config=\"num_encoders=1 sserial_port_3=00 num_leds=9 num_dplls=2,num_stepgens=2\"");
    static const char *const warnings[] = {"warning: config: \"num_stepgens=2\" is for card 1, but board_ip has 1",
                                           "warning: hm2_7i96s.0: config sserial_port_3 has no effect",
                                           "num_leds=9, but hm2_7i96s.0 has 4",
                                           "config num_dplls=2, but the firmware has 1"};
    for (int i = 0; i < COUNT(warnings); i++)
        ck_assert_msg(strstr(hal.host.text, warnings[i]) != NULL, "no \"%s\" in: %s", warnings[i], hal.host.text);
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

/* ---- firmware that is refused ----------------------------------------------------------------------------------- */

static const struct {
    const char *word, *sentence[3];
} bad_images[] = {
    {"0100 55AACAFF", {"cookie", "55AACAFF", "55AACAFE"}},
    {"0104 54534F49", {"HOSTMOT2"}},
    {"0400 00000004", {"IDROM type is 4, expected 2 or 3"}},
    {"041C 00000004", {"IDROM IOPorts is 4, expected 3 as this card has", "IOWidth is 51, expected"}},
    {"041C 00000000", {"IDROM IOPorts is 0, expected at least 1"}},
    {"0420 00000034", {"IDROM IOWidth is 52, expected IOPorts * PortWidth = 3 * 17 = 51"}},
    {"0424 00000018", {"IDROM PortWidth is 24, expected 17 as this card has"}},
    {"0424 00000000", {"IDROM PortWidth is 0, expected 1 to 32"}},
    {"0428 000003E8", {"ClockLow", "1000"}},
    {"042C 000003E8", {"ClockHigh", "1000"}},
};

/* The shipping firmware with one word changed. */
static void write_image(const char *const path, const char *const word)
{
    char line[128];
    FILE *const from = fopen(TEST_DATA "/idrom_7i96s/7i96s_d.hex", "r"), *const to = fopen(path, "w");
    ck_assert(from && to);
    while (fgets(line, sizeof line, from))
        fputs(strncmp(line, word, 5) == 0 ? "" : line, to);
    fprintf(to, "%s\n", word);
    fclose(from);
    ck_assert_int_eq(fclose(to), 0);
}

START_TEST(firmware_with_a_fault_is_refused_with_what_was_found_and_expected)
{
    char path[64], line[512];
    snprintf(path, sizeof path, "/tmp/check-image-%d.hex", (int)getpid());
    write_image(path, bad_images[_i].word);
    simulator_start(&sim, (const char *const[]){"--card", "7i96s", "--firmware", path, NULL});
    unlink(path);
    talk_start(&hal, NULL);
    load_line(line, 1, "");
    const char *const sentences[] = {sim.address[0], bad_images[_i].sentence[0],
                                     bad_images[_i].sentence[1] ? bad_images[_i].sentence[1] : "",
                                     bad_images[_i].sentence[2] ? bad_images[_i].sentence[2] : "", NULL};
    expect_refusal(line, sentences);
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

/* ---- several cards in one cycle --------------------------------------------------------------------------------- */

/* Requests of all cards must be on the wire before a reply is waited for: otherwise the relay lets none pass. */
static void try_several(const char *const schedule_lines, const unsigned may_be_alone)
{
    char own[RELAY_CARDS][16];
    for (unsigned i = 0; i < RELAY_CARDS; i++)
        test_address(SIMULATOR_CARDS + i, own[i]);
    simulator_start(&sim, (const char *const[]){"--card", "7i96s", "--card", "7i96s", "--card", "7i93", NULL});
    struct relay *const relay = relay_start(RELAY_CARDS, own, sim.address);
    talk_start(&hal, NULL);
    talk_do(&hal, "loadrt hm2_lbp16 board_ip=%s,%s,%s", own[0], own[1], own[2]);
    talk_do(&hal, "loadrt threads name1=servo period1=1000000");
    talk_do(&hal, "%s", schedule_lines);
    relay_hold(relay, true);
    talk_do(&hal, "start");
    for (unsigned ms = 0; ms < 20000 && relay_requests(relay, 2) < 200; ms += 10)
        usleep(10000);
    talk_do(&hal, "stop");
    for (unsigned i = 0; i < RELAY_CARDS; i++)
        ck_assert_uint_ge(relay_requests(relay, i), 200);
    ck_assert_uint_le(relay_released(relay), may_be_alone);
    ck_assert_double_eq(talk_value(&hal, "hm2_7i96s.1.packet-error-total"), 0);
    relay_hold(relay, false);
    talk_end(&hal);
    relay_stop(relay);
    simulator_stop(&sim);
}

#define LONG_TIMEOUT(card) "setp " card ".packet-read-timeout 2000000000\n"
#define LONG_TIMEOUTS      LONG_TIMEOUT("hm2_7i96s.0") LONG_TIMEOUT("hm2_7i96s.1") LONG_TIMEOUT("hm2_7i93.0")

START_TEST(all_cards_are_asked_before_the_first_reply_is_awaited)
{
    /* In the first cycle it is not known yet which cards the thread reads: two of the three may be waited for. */
    try_several(LONG_TIMEOUTS "addf hm2_7i96s.0.read servo\naddf hm2_7i96s.1.read servo\naddf hm2_7i93.0.read servo",
                2);
}
END_TEST

START_TEST(the_order_of_the_cards_in_the_thread_does_not_matter)
{
    try_several(LONG_TIMEOUTS "addf hm2_7i93.0.read servo\naddf hm2_7i96s.1.read servo\naddf hm2_7i96s.0.read servo",
                2);
}
END_TEST

START_TEST(requests_may_be_scheduled_by_themselves)
{
    try_several(LONG_TIMEOUTS "addf hm2_7i96s.0.read-request servo\naddf hm2_7i96s.1.read-request servo\n"
                              "addf hm2_7i93.0.read-request servo\naddf hm2_7i96s.0.read servo\n"
                              "addf hm2_7i96s.1.read servo\naddf hm2_7i93.0.read servo",
                0);
}
END_TEST

START_TEST(cards_in_different_threads_leave_each_other_alone)
{
    simulator_start(&sim, (const char *const[]){"--card", "7i96s", "--card", "7i96s", NULL});
    talk_start(&hal, NULL);
    load(2, "");
    talk_do(&hal, "loadrt threads name1=servo period1=1000000 name2=slow period2=10000000");
    schedule("hm2_7i96s.0");
    talk_do(&hal, "addf hm2_7i96s.1.read slow\naddf hm2_7i96s.1.write slow\n"
                  "setp hm2_7i96s.1.packet-read-timeout 100000000\nsetp hm2_7i96s.1.watchdog.timeout_ns 4000000000\n"
                  "start\nrun 1\nstop");
    static const char *const quiet[] = {"packet-error-total", "packet-late", "packet-stale", "packet-malformed",
                                        "write-lost"};
    for (int i = 0; i < COUNT(quiet); i++)
        for (unsigned card = 0; card < 2; card++) {
            char name[64];
            snprintf(name, sizeof name, "hm2_7i96s.%u.%s", card, quiet[i]);
            ck_assert_msg(talk_value(&hal, name) == 0, "%s is %g", name, talk_value(&hal, name));
        }
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

/* ---- outputs ---------------------------------------------------------------------------------------------------- */

static void expect_pads(const char level)
{
    static const unsigned ios[] = {SSR_IO, 15, STEP_IO, STEP_IO + 1, GPIO_IO};
    for (int i = 0; i < COUNT(ios); i++)
        ck_assert_msg(simulator_pad(&sim, 0, ios[i]) == level, "pad %u is %c, expected %c", ios[i],
                      simulator_pad(&sim, 0, ios[i]), level);
}

START_TEST(outputs_are_inactive_until_the_first_write_and_after_unloading)
{
    simulator_start(&sim, NULL);
    talk_start(&hal, NULL);
    load(1, "");
    talk_do(&hal, "loadrt threads name1=servo period1=1000000\nsetp hm2_7i96s.0.gpio.034.is_output 1\n"
                  "setp hm2_7i96s.0.gpio.034.out 1\nsetp hm2_7i96s.0.outm.00.out-04 1\n"
                  "setp hm2_7i96s.0.packet-read-timeout 100000000\n"
                  "setp hm2_7i96s.0.watchdog.timeout_ns 4000000000\naddf hm2_7i96s.0.read servo\nstart\nrun 0.1");
    expect_pads('z'); /* reading alone makes nothing active */
    talk_do(&hal, "addf hm2_7i96s.0.write servo\nrun 0.1");
    ck_assert_int_eq(simulator_pad(&sim, 0, GPIO_IO), '1');
    ck_assert_int_eq(simulator_pad(&sim, 0, 15), '1');
    ck_assert_int_eq(simulator_pad(&sim, 0, STEP_IO), '0');
    talk_do(&hal, "unloadrt hm2_lbp16"); /* while the thread runs */
    wait_for_bite(0);
    expect_pads('z');
    expect_no_trace();
    /* the thread goes on, and the card can be had again in the same process */
    load(1, "");
    schedule("hm2_7i96s.0");
    wait_for("watchdog.has_bit", 0, 0);
    talk_do(&hal, "run 0.1");
    ck_assert_double_eq(value("watchdog.has_bit"), 0);
    ck_assert_int_eq(simulator_pad(&sim, 0, STEP_IO), '0');
    talk_end(&hal);
    wait_for_bite(0);
    simulator_stop(&sim);
}
END_TEST

START_TEST(the_card_is_bitten_when_the_host_is_told_to_end)
{
    static const int signals[] = {SIGTERM, SIGINT, SIGHUP};
    run_a_7i96s(NULL, "");
    ck_assert(!has_bitten(0));
    process_say(&hal.host, "run 100\nquit\n");
    usleep(100000);
    const int status = process_stop(&hal.host, signals[_i], 20000);
    ck_assert_msg(status == 0 || status == 128 + signals[_i], "status %d: %s", status, hal.host.text);
    wait_for_bite(0);
    simulator_stop(&sim);
}
END_TEST

START_TEST(a_host_that_is_killed_leaves_it_to_the_watchdog)
{
    run_a_7i96s(NULL, "");
    talk_do(&hal, "setp hm2_7i96s.0.watchdog.timeout_ns 100000000\nrun 0.1");
    process_stop(&hal.host, SIGKILL, 5000);
    wait_for_bite(0);
    simulator_stop(&sim);
}
END_TEST

/* ---- faults ----------------------------------------------------------------------------------------------------- */

START_TEST(faults_are_counted_under_their_causes_and_the_machine_goes_on)
{
    static const struct {
        const char *faults;
        const char *counter; /* that must move */
    } rows[] = {
        {"faults loss=0.02", "packet-lost"},        {"faults loss=0.02", "write-lost"},
        {"faults dup=0.2", "packet-stale"},         {"faults truncate=0.02", "packet-malformed"},
        {"faults foreign=0.2", "packet-strangers"},
    };
    run_a_7i96s(NULL, "");
    talk_do(&hal, "debug 2\nsetp hm2_7i96s.0.packet-read-timeout 20000000\nsetp hm2_7i96s.0.packet-error-limit 1000\n"
                  "setp hm2_7i96s.0.stepgen.00.position-scale 200\nsetp hm2_7i96s.0.stepgen.00.maxaccel 1000\n"
                  "setp hm2_7i96s.0.stepgen.00.steplen 2000\nsetp hm2_7i96s.0.stepgen.00.stepspace 2000\n"
                  "setp hm2_7i96s.0.stepgen.00.enable 1");
    for (int i = 0; i < COUNT(rows); i++) {
        const double before = value(rows[i].counter);
        simulator_do(&sim, rows[i].faults);
        wait_for(rows[i].counter, before + 3, 1e9);
        simulator_do(&sim, "faults none");
    }
    talk_do(&hal, "setp hm2_7i96s.0.stepgen.00.position-cmd 10");
    wait_for("stepgen.00.position-fb", 9.995, 10.005);
    ck_assert_double_eq(value("io_error"), 0);
    ck_assert_double_eq(value("watchdog.has_bit"), 0);
    /* the rest cannot be seen without a fault */
    wait_for("packet-error-level", 0, 0);
    ck_assert_double_eq(value("packet-error"), 0);
    ck_assert_double_gt(value("packet-error-total"), 0);
    talk_wait_text(&hal, "packet error: ");
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(late_replies_are_counted_as_late)
{
    run_a_7i96s(NULL, "");
    talk_do(&hal, "setp hm2_7i96s.0.packet-read-timeout 5000000\nsetp hm2_7i96s.0.packet-error-limit 1000000");
    simulator_do(&sim, "faults delay=0-15000");
    wait_for("packet-late", 3, 1e9);
    ck_assert_double_ge(value("packet-lost"), value("packet-late") - 1);
    simulator_do(&sim, "faults none");
    wait_for("packet-error-level", 0, 0);
    ck_assert_double_eq(value("io_error"), 0);
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(a_frozen_card_raises_io_error_and_is_had_back_by_hand)
{
    run_a_7i96s(NULL, "");
    talk_do(&hal, "setp hm2_7i96s.0.packet-read-timeout 20000000\nsetp hm2_7i96s.0.watchdog.timeout_ns 500000000\n"
                  "setp hm2_7i96s.0.gpio.034.out 1\nrun 0.1");
    simulator_do(&sim, "freeze on");
    wait_for("io_error", 1, 1);
    ck_assert_double_eq(value("packet-error-exceeded"), 1);
    ck_assert_double_eq(value("packet-error-level"), 10);
    ck_assert_double_eq(value("packet-lost"), 5); /* 5 x 2 is the limit */
    talk_wait_text(&hal, "io_error is set");
    simulator_do(&sim, "freeze off");
    wait_for_bite(0);
    const double total = value("packet-error-total");
    talk_do(&hal, "run 0.1");
    ck_assert_double_eq(value("packet-error-total"), total); /* nothing is sent by itself */
    ck_assert_double_eq(value("io_error"), 1);
    talk_do(&hal, "setp hm2_7i96s.0.io_error 0");
    wait_for("watchdog.has_bit", 1, 1);
    talk_wait_text(&hal, "the watchdog has bitten");
    talk_do(&hal, "run 0.1");
    expect_pads('z');
    talk_do(&hal, "setp hm2_7i96s.0.watchdog.has_bit 0\nrun 0.2");
    ck_assert_double_eq(value("watchdog.has_bit"), 0);
    ck_assert_double_eq(value("io_error"), 0);
    ck_assert_double_eq(value("packet-error-exceeded"), 0);
    ck_assert_int_eq(simulator_pad(&sim, 0, GPIO_IO), '1');
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(a_card_that_lost_its_power_comes_back_without_a_restart)
{
    run_a_7i96s(NULL, "");
    talk_do(&hal, "setp hm2_7i96s.0.packet-read-timeout 20000000\nsetp hm2_7i96s.0.packet-error-limit 1000000\n"
                  "setp hm2_7i96s.0.gpio.034.out 1\nsetp hm2_7i96s.0.stepgen.00.steplen 5000\nrun 0.2");
    ck_assert_int_eq(simulator_pad(&sim, 0, GPIO_IO), '1');
    simulator_do(&sim, "power-cycle");
    talk_wait_text(&hal, "the card has lost its state");
    talk_wait_text(&hal, "the card is back with the same firmware");
    wait_for("watchdog.has_bit", 1, 1);
    wait_for("data-age", 0, 0);
    expect_pads('z'); /* nothing is driven until a person has seen it */
    talk_do(&hal, "setp hm2_7i96s.0.watchdog.has_bit 0\nrun 0.2");
    ck_assert_double_eq(value("watchdog.has_bit"), 0);
    ck_assert_int_eq(simulator_pad(&sim, 0, GPIO_IO), '1');
    wait_for("packet-error-level", 0, 1e9);
    ck_assert_double_eq(value("io_error"), 0);
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

START_TEST(a_power_cycle_beyond_the_limit_needs_io_error_cleared_too)
{
    run_a_7i96s(NULL, "");
    talk_do(&hal, "setp hm2_7i96s.0.packet-read-timeout 20000000\nsetp hm2_7i96s.0.gpio.034.out 1");
    simulator_do(&sim, "power-cycle");
    wait_for("io_error", 1, 1);
    sleep(2); /* the card needs a second for its own start */
    talk_do(&hal, "setp hm2_7i96s.0.io_error 0");
    wait_for("watchdog.has_bit", 1, 1);
    talk_wait_text(&hal, "the card is back with the same firmware");
    talk_do(&hal, "setp hm2_7i96s.0.watchdog.has_bit 0\nrun 0.2");
    ck_assert_int_eq(simulator_pad(&sim, 0, GPIO_IO), '1');
    ck_assert_double_eq(value("io_error"), 0);
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

/* A card that dies takes its own cycle down, not the one of its neighbour. */
START_TEST(a_frozen_card_does_not_stop_the_other)
{
    simulator_start(&sim, (const char *const[]){"--card", "7i96s", "--card", "7i96s", NULL});
    talk_start(&hal, NULL);
    load(2, "");
    talk_do(&hal, "loadrt threads name1=servo period1=1000000");
    schedule("hm2_7i96s.0");
    schedule("hm2_7i96s.1");
    talk_do(&hal, "setp hm2_7i96s.1.packet-read-timeout 5000000\nstart\nrun 0.2");
    simulator_do(&sim, "card 1 freeze on");
    talk_wait(&hal, "hm2_7i96s.1.io_error", 1, 1);
    talk_do(&hal, "run 0.2");
    ck_assert_double_eq(talk_value(&hal, "hm2_7i96s.0.packet-error-total"), 0);
    ck_assert_double_eq(talk_value(&hal, "hm2_7i96s.0.watchdog.has_bit"), 0);
    ck_assert_int_eq(simulator_pad(&sim, 0, STEP_IO), '0');
    talk_end(&hal);
    simulator_stop(&sim);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("hm2_lbp16");
    TCase *const tests = tcase_create("component");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, a_7i96s_offers_what_linuxcncs_driver_offers);
    tcase_add_test(tests, several_cards_are_numbered_by_type_and_take_their_own_configuration);
    tcase_add_test(tests, load_lines_of_linuxcnc_are_accepted);
    tcase_add_test(tests, a_bad_configuration_is_refused_with_the_key_the_value_and_the_limit);
    tcase_add_test(tests, a_bad_address_is_refused_with_a_sentence);
    tcase_add_test(tests, a_receive_path_that_does_not_exist_is_refused);
    tcase_add_test(tests, a_card_that_is_not_there_is_said_to_be_not_there);
    tcase_add_test(tests, a_card_that_says_nothing_for_half_a_second_is_loaded_all_the_same);
    tcase_add_test(tests, when_the_second_card_is_missing_the_first_ones_watchdog_is_bitten);
    tcase_add_test(tests, when_the_configuration_of_the_second_card_is_bad_both_are_bitten);
    tcase_add_test(tests, what_is_odd_but_harmless_in_a_configuration_is_told);
    tcase_add_loop_test(tests, firmware_with_a_fault_is_refused_with_what_was_found_and_expected, 0, COUNT(bad_images));
    tcase_add_test(tests, all_cards_are_asked_before_the_first_reply_is_awaited);
    tcase_add_test(tests, the_order_of_the_cards_in_the_thread_does_not_matter);
    tcase_add_test(tests, requests_may_be_scheduled_by_themselves);
    tcase_add_test(tests, cards_in_different_threads_leave_each_other_alone);
    tcase_add_test(tests, outputs_are_inactive_until_the_first_write_and_after_unloading);
    tcase_add_loop_test(tests, the_card_is_bitten_when_the_host_is_told_to_end, 0, 3);
    tcase_add_test(tests, a_host_that_is_killed_leaves_it_to_the_watchdog);
    tcase_add_test(tests, faults_are_counted_under_their_causes_and_the_machine_goes_on);
    tcase_add_test(tests, late_replies_are_counted_as_late);
    tcase_add_test(tests, a_frozen_card_raises_io_error_and_is_had_back_by_hand);
    tcase_add_test(tests, a_card_that_lost_its_power_comes_back_without_a_restart);
    tcase_add_test(tests, a_power_cycle_beyond_the_limit_needs_io_error_cleared_too);
    tcase_add_test(tests, a_frozen_card_does_not_stop_the_other);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
