/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Every firmware image that was dumped, and every card of the flash tool's table, simulated and loaded by the driver.
 */
#include "unit.h"

#include <strings.h>

#include <hm2/board.h>
#include <hm2/flash.h>
#include <hm2/sim.h>
#include <hm2/terminals.h>

#include "idrom_files.h"

#define PERIOD_NS 1000000

struct bench {
    struct sim_card *card;
    struct sim_net *net;
    struct hm2_board *board;
    struct hm2_plain_binder *plain;
    struct hm2_diag diag;
};

/* The result of the driver's load. */
static int load(struct bench *const b, const struct sim_card_options *const options)
{
    *b = (struct bench){0};
    if (sim_card_new(&b->card, options, &b->diag) != 0)
        fail_msg("%s", b->diag.text);
    assert_int_equal(sim_net_new(&b->net, b->card, NULL), 0);
    b->board = hm2_board_new();
    b->plain = hm2_plain_binder_new();
    assert_non_null(b->board);
    assert_non_null(b->plain);
    int err = hm2_board_identify(b->board, sim_net_link(b->net), &b->diag);
    if (!err)
        err = hm2_board_setup(b->board, 0, hm2_plain_binder(b->plain), "", &b->diag);
    return err ? err : hm2_board_start(b->board, &b->diag);
}

static void release(struct bench *const b)
{
    hm2_board_free(b->board);
    hm2_plain_binder_free(b->plain);
    sim_net_free(b->net);
    sim_card_free(b->card);
}

static void run(struct bench *const b, const unsigned cycles)
{
    for (unsigned i = 0; i < cycles; i++) {
        const int64_t begin_ns = link_now_ns(sim_net_link(b->net));
        hm2_board_read(b->board, PERIOD_NS);
        hm2_board_write(b->board, PERIOD_NS);
        sim_net_sleep_until(b->net, begin_ns + PERIOD_NS);
    }
}

static double point(const struct bench *const b, const char *const name)
{
    char full[128];
    int err;
    (void)snprintf(full, sizeof full, "%s.%s", hm2_board_prefix(b->board), name);
    const double value = hm2_plain_get(b->plain, full, &err);
    if (err)
        fail_msg("no point %s", full);
    return value;
}

/* ---- images -------------------------------------------------------------------------------------------------------
 */

/* A card that has room for such ports; the dumps of other ports are of cards without Ethernet, and of names that the
 * driver does not know. */
static struct sim_card_options card_for(const struct hm2_image *const image)
{
    static const struct {
        unsigned ports, width;
        const char *profile;
    } cards[] = {{2, 17, "7i92"}, {2, 21, "7i94"},      {2, 24, "7i93"},
                 {3, 17, "7i97"}, {4, 17, "7i80db-16"}, {3, 24, "7i80hd-16"}};
    struct sim_card_options options = {.profile = "7i93", .card_name = "other", .image = image};
    for (size_t i = 0; i < sizeof cards / sizeof cards[0]; i++)
        if (image->rom[7] == cards[i].ports && image->rom[9] == cards[i].width)
            options = (struct sim_card_options){.profile = cards[i].profile, .image = image};
    return options;
}

struct image_case {
    const char *file, *sentence;
};

static const char *find(const struct image_case *cases, const char *const file)
{
    for (; cases->file; cases++)
        if (strcmp(cases->file, file) == 0)
            return cases->sentence;
    return NULL;
}

/* What is said about images that contradict themselves, and about modules that nobody drives. All others load without
 * a word but about unknown tags, or that the card is none that is known. */
#define PORTS(module, header, used) \
    "(IOPort): instances is " #module ", expected IOPorts of the header, " #header "; the first " #used " are used"
#define UART_STRIDE \
    "module UART Receive Channel (tag 0x0A): version/registers/instance stride/register mask 0x00/4/4/0xF"
#define OLD_INDEX "module StepGen (tag 0x05): version/registers/instance stride/register mask 0x03/10/4/0x1FF found"
static const struct image_case remarks[] = {
    {"7I77E_51.hex", PORTS(4, 3, 3)},
    {"BOSSV.hex", PORTS(2, 3, 2)},
    {"OLDBOSSV.hex", PORTS(2, 3, 2)},
    {"SSSV8_48_96.hex", PORTS(4, 2, 2)},
    {"SVST2_4_7I47_96.hex", PORTS(3, 4, 3)},
    {"MG_72.hex", UART_STRIDE},
    {"STUA8_4_64.hex", UART_STRIDE},
    {"UA12_64.hex", UART_STRIDE},
    {"UASVST2_2_4_7I47_72.hex", UART_STRIDE},
    {"SVST4_4IM2SI_72.hex", OLD_INDEX},
    {"SVST8_4IM2SI_72.hex", OLD_INDEX},
    {"PW64_72.hex", "the firmware has 64 PWM generators; using 32"},
    {"SVST12_12_2X7I48_2X7I47_96.hex", "the firmware has both Encoder and Muxed Encoder"},
    {"SV12_2X7I48_72.hex", "Muxed Encoder version 2 is old firmware"},
    {"SV6_7I48_48__i93like.hex", "Muxed Encoder version 2 is old firmware"},
    {NULL, NULL},
};

static void check_remarks(const char *const file, const struct bench *const b)
{
    const char *const sentence = find(remarks, file);
    if (sentence && !strstr(b->diag.text, sentence))
        fail_msg("%s: \"%s\" is missing in:\n%s", file, sentence, b->diag.text);
    for (const char *line = b->diag.text; *line; line += strcspn(line, "\n") + 1)
        if (!sentence && !strstr(line, "has no driver here and is left alone") &&
            !strstr(line, "is no card known here"))
            fail_msg("%s: %s", file, line);
}

/* Unknown tags are told with their number. */
static void check_unknown(const char *const file, const struct bench *const b)
{
    static const uint8_t unknown[] = {HM2_GTAG_SPI, HM2_GTAG_TRAM, HM2_GTAG_DBSPI, HM2_GTAG_WAVEGEN, 0x15, 0x16, 0x17,
                                      0x1F,         0xC2};
    for (size_t i = 0; i < sizeof unknown; i++) {
        char sentence[64];
        (void)snprintf(sentence, sizeof sentence, "%s (tag 0x%02X, ", hm2_tag_name(unknown[i]), unknown[i]);
        if (!hm2_idrom_find(hm2_board_idrom(b->board), unknown[i]) != !strstr(b->diag.text, sentence))
            fail_msg("%s: tag 0x%02X: %s", file, unknown[i], b->diag.text);
    }
}

static void check_image(const char *const file)
{
    char path[512];
    assert_true(snprintf(path, sizeof path, "%s/idrom/%s", TEST_DATA, file) < (int)sizeof path);
    struct hm2_image image;
    load_image(path, &image);
    const struct sim_card_options options = card_for(&image);
    static struct bench b;
    if (load(&b, &options) != 0)
        fail_msg("%s: %s", file, b.diag.text);
    check_remarks(file, &b);
    check_unknown(file, &b);
    run(&b, 3);
    assert_true(point(&b, "packet-error-total") == 0);
    assert_true(point(&b, "io_error") == 0 && point(&b, "watchdog.has_bit") == 0);
    release(&b);
}

static void every_image_that_was_dumped_loads_and_runs(void **state)
{
    (void)state;
    size_t len;
    char *const text = load_text(TEST_DATA "/idrom/index.csv", &len);
    char *rest = text;
    unsigned images = 0;
    (void)strsep(&rest, "\n");
    for (char *line = strsep(&rest, "\n"); line && *line; line = strsep(&rest, "\n"), images++) {
        line[strcspn(line, ",")] = '\0';
        check_image(line);
    }
    assert_int_equal(images, 218);
    free(text);
}

/* ---- cards --------------------------------------------------------------------------------------------------------
 */

static void check_listing(const struct bench *const b)
{
    static char text[16384];
    const size_t len = hm2_board_describe_pins(b->board, text, sizeof text);
    assert_true(len < sizeof text);
    if (strstr(text, "(??"))
        fail_msg("%s: %s", hm2_board_card_name(b->board), text);
}

/* Every card of the flash tool's table is simulated under the name that its manual gives it, known, and runs. */
static void every_card_loads_and_its_pins_have_names(void **state)
{
    (void)state;
    static struct bench b;
    for (size_t i = 0; flash_board_at(i); i++) {
        const struct flash_board *const board = flash_board_at(i);
        const char *const *profile = sim_profiles();
        while (*profile && strcasecmp(*profile, board->device) != 0)
            profile++;
        const struct sim_card_options options = {.profile = *profile};
        if (load(&b, &options) != 0)
            fail_msg("%s: %s", board->device, b.diag.text);
        assert_string_equal(hm2_board_card_name(b.board), board->card_name);
        assert_null(strstr(b.diag.text, "no card known here"));
        assert_int_equal(hm2_board_type(b.board)->io_ports, board->io_ports);
        assert_int_equal(hm2_board_type(b.board)->port_width, board->port_width);
        check_listing(&b);
        run(&b, 3);
        assert_true(point(&b, "packet-error-total") == 0);
        release(&b);
    }
}

/* The configurations of the 7I93's manual: the last instance of each module is there and reads. */
static void the_configurations_of_the_7i93_have_their_modules(void **state)
{
    (void)state;
    static const struct {
        const char *profile, *points[4];
        unsigned io; /* a pin of its daughter card, and what it does */
        const char *pin;
    } rows[] = {
        {"7i93", {"encoder.07.count", "pwmgen.07.value", "stepgen.03.counts"}, 6, "PWMGen #1, pin Out0 (PWM or Up)"},
        {"7i93_svst4_8", {"encoder.03.count", "pwmgen.03.value", "stepgen.07.counts"}, 24, "StepGen #0, pin Step"},
        {"7i93_svst8_8im2", {"encoder.07.count", "pwmgen.07.value", "stepgen.07.counts"}, 4, "Encoder #1, pin Index"},
        {"7i93_svst1_4_7i47s", {"encoder.03.count", "pwmgen.00.value", "stepgen.03.counts"}, 0, "StepGen #0, pin Step"},
        {"7i93_2x7i65", {"encoder.15.count"}, 15, "Buffered SPI Interface #0, pin Serial Out"},
        {"7i93_sv12im_2x7i48",
         {"encoder.11.count", "pwmgen.11.value"},
         10,
         "Muxed Encoder Select #0, pin Mux Select 0"},
        {"7i93_sv6_7i49",
         {"resolver.05.count", "resolver.excitation-khz", "pwmgen.05.value"},
         10,
         "Resolver #0, pin REFPDM+"},
    };
    static struct bench b;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[8192], wanted[96];
        const struct sim_card_options options = {.profile = rows[i].profile};
        if (load(&b, &options) != 0)
            fail_msg("%s: %s", rows[i].profile, b.diag.text);
        assert_string_equal(b.diag.text, "");
        run(&b, 3);
        assert_true(point(&b, "packet-error-total") == 0);
        for (const char *const *name = rows[i].points; *name; name++)
            (void)point(&b, *name);
        (void)snprintf(wanted, sizeof wanted, "IO Pin %03u (%s-%02u): %s", rows[i].io, rows[i].io < 24 ? "P2" : "P1",
                       hm2_connector_pin(24, rows[i].io), rows[i].pin);
        (void)hm2_board_describe_pins(b.board, text, sizeof text);
        if (!strstr(text, wanted))
            fail_msg("%s: no \"%s\" in:\n%s", rows[i].profile, wanted, text);
        release(&b);
    }
}

/* Each terminal of the 7I49 stands at the pin that its firmware has the function at. */
static void terminals_of_the_7i49_are_at_the_pins_of_its_firmware(void **state)
{
    (void)state;
    static struct bench b;
    const struct sim_card_options options = {.profile = "7i93_sv6_7i49"};
    const struct hm2_terminals *const terminals = hm2_terminals_find("7i49");
    assert_non_null(terminals);
    assert_int_equal(terminals->count, 24);
    assert_int_equal(load(&b, &options), 0);
    const struct hm2_pd *const pins = sim_card_idrom(b.card)->pins;
    static const char *const outputs[] = {"P4-20:PWM-", "P4-24:PWM-", "P3-20:PWM-",
                                          "P3-24:PWM-", "P2-20:PWM-", "P2-24:PWM-"};
    for (unsigned pin = 0; pin < 24; pin++) {
        char wanted[32] = "Internal-Resolver";
        const unsigned function = pins[pin].secondary_pin & 0x7Fu;
        if (pins[pin].secondary_tag == HM2_GTAG_PWMGEN && function == 3)
            (void)snprintf(wanted, sizeof wanted, "/Enable");
        else if (pins[pin].secondary_tag == HM2_GTAG_PWMGEN)
            (void)snprintf(wanted, sizeof wanted, "%s%s", outputs[pins[pin].secondary_unit],
                           function == 1 ? "Up" : "Dwn");
        assert_string_equal(terminals->terminals[pin], wanted);
    }
    release(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_image_that_was_dumped_loads_and_runs),
        cmocka_unit_test(every_card_loads_and_its_pins_have_names),
        cmocka_unit_test(the_configurations_of_the_7i93_have_their_modules),
        cmocka_unit_test(terminals_of_the_7i49_are_at_the_pins_of_its_firmware),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
