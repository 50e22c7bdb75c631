/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "../../lib/module/module_types.h"
#include "board_private.h"
#include "fake_card.h"
#include "idrom_files.h"

#define PERIOD_NS 1000000
#define PREFIX    "hm2_7i96s.0"

/* ---- a module type that tells what the board does with it -------------------------------------------------------- */

enum { PROBE_READ = 0x2000, PROBE_WRITE = 0x2100, PROBE_SETTING = 0x2200 };

struct probe {
    hm2_u32_t *in, *out, *setting;
    struct hm2_window read, write;
    struct hm2_section section;
    unsigned starts, unpacks, packs, losts;
    uint32_t writes;
    bool bitten;
};

static const struct hm2_point probe_points[] = {
    HM2_POINT(struct probe, in, "in", HM2_U32, HM2_PIN_OUT, 0, "", "register 0x2000"),
    HM2_POINT(struct probe, out, "out", HM2_U32, HM2_PIN_IN, 0, "", "register 0x2100"),
    HM2_POINT(struct probe, setting, "setting", HM2_U32, HM2_PARAM_RW, 77, "", "register 0x2200"),
};

static int probe_setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    struct probe *const p = setup->binder->alloc(setup->binder, sizeof *p);
    assert_non_null(p);
    module->context = p;
    assert_int_equal(hm2_plan_add_read(setup->plan, &p->read, HM2_RANK_NORMAL, PROBE_READ, 1, setup->diag), 0);
    assert_int_equal(hm2_plan_add_write(setup->plan, &p->write, HM2_RANK_NORMAL, PROBE_WRITE, 1, setup->diag), 0);
    assert_int_equal(hm2_plan_add_setup(setup->plan, &p->section, HM2_RANK_NORMAL, PROBE_SETTING, 1, 0, setup->diag),
                     0);
    hm2_section_set(&p->section, 0, 55);
    uint32_t values[2] = {0, 0};
    const uint32_t poked[2] = {0x11111111, 0x22222222};
    assert_int_equal(setup->poke(setup, 0x2300, 2, poked), 0);
    assert_int_equal(setup->peek(setup, 0x2300, 2, values), 0);
    assert_memory_equal(values, poked, sizeof values);
    return hm2_bind_points(setup->binder, probe_points, 3, p, PREFIX ".probe", 0, setup->diag);
}

static void probe_start(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    assert_true(cycle->period_ns > 0);
    ((struct probe *)module->context)->starts++;
}

static void probe_unpack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct probe *const p = module->context;
    assert_int_equal(cycle->period_ns, PERIOD_NS);
    p->unpacks++;
    *p->in = hm2_window_get(&p->read, 0);
}

static void probe_pack(struct hm2_module *const module, const struct hm2_cycle *const cycle)
{
    struct probe *const p = module->context;
    p->packs++;
    p->writes = cycle->writes;
    p->bitten = cycle->bitten;
    hm2_window_set(&p->write, 0, cycle->bitten ? 0 : *p->out);
    hm2_section_set(&p->section, 0, *p->setting);
}

static void probe_lost(struct hm2_module *const module)
{
    ((struct probe *)module->context)->losts++;
}

static const struct hm2_md_variant probe_variants[] = {{0, 1, 4, 0}, {3, 2, 8, 1}};

static const struct hm2_module_type probe_type = {
    .name = "probe",
    .gtag = HM2_GTAG_LED,
    .variants = probe_variants,
    .variant_count = 2,
    .config_count = -1,
    .setup = probe_setup,
    .start = probe_start,
    .unpack = probe_unpack,
    .pack = probe_pack,
    .write_lost = probe_lost,
};

/* Types that only remember how they were set up. */
static int quiet_setup(struct hm2_module *const module, struct hm2_setup *const setup)
{
    module->context = setup;
    return module->md->gtag == HM2_GTAG_STEPGEN
               ? hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL)
               : 0;
}

static const struct hm2_module_type stepgen_type = {
    .name = "stepgen", .gtag = HM2_GTAG_STEPGEN, .config_count = HM2_CFG_STEPGENS, .setup = quiet_setup};
static const struct hm2_module_type encoder_type = {
    .name = "encoder", .gtag = HM2_GTAG_ENCODER, .config_count = HM2_CFG_ENCODERS, .setup = quiet_setup};
static const struct hm2_module_type muxed_type = {
    .name = "encoder", .gtag = HM2_GTAG_MUXED_ENCODER, .config_count = HM2_CFG_ENCODERS, .setup = quiet_setup};

/* Instead of the library's registry. */
const struct hm2_module_type *const hm2_module_types[] = {&hm2_watchdog_type, &stepgen_type, &encoder_type,
                                                          &muxed_type,        &probe_type,   NULL};

/* ---- fixture ------------------------------------------------------------------------------------------------------
 */

struct fixture {
    struct fake_card card;
    struct link *link; /* owned by the board once it was identified */
    struct hm2_board *board;
    struct hm2_plain_binder *plain;
    struct hm2_diag diag;
    struct probe *probe;
};

static int set_up(void **state)
{
    struct fixture *const f = calloc(1, sizeof *f);
    assert_non_null(f);
    struct hm2_image image;
    load_image(IDROM_7I96S, &image);
    fake_card_open(&f->card, "7I96S", &image, &f->link);
    link_mock_advance(f->link, INT64_C(123456789012));
    f->board = hm2_board_new();
    f->plain = hm2_plain_binder_new();
    assert_non_null(f->board);
    assert_non_null(f->plain);
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *const f = *state;
    if (!f->board->link)
        link_close(f->link);
    hm2_board_free(f->board);
    hm2_plain_binder_free(f->plain);
    free(f);
    return 0;
}

static int identify(struct fixture *const f)
{
    return hm2_board_identify(f->board, f->link, &f->diag);
}

static int setup_with(struct fixture *const f, const char *const config)
{
    assert_int_equal(identify(f), 0);
    return hm2_board_setup(f->board, 0, hm2_plain_binder(f->plain), config, &f->diag);
}

static double get(const struct fixture *const f, const char *const name)
{
    char full[128];
    int err;
    (void)snprintf(full, sizeof full, PREFIX ".%s", name);
    const double value = hm2_plain_get(f->plain, full, &err);
    if (err)
        fail_msg("no point %s", full);
    return value;
}

static void set(const struct fixture *const f, const char *const name, const double value)
{
    char full[128];
    (void)snprintf(full, sizeof full, PREFIX ".%s", name);
    assert_int_equal(hm2_plain_set(f->plain, full, value), 0);
}

static void expect(const struct fixture *const f, const char *const name, const double value, const int line)
{
    const double found = get(f, name);
    if (found != value)
        fail_msg("line %d: %s is %g, expected %g", line, name, found, value);
}
#define EXPECT(name, value) expect(f, name, value, __LINE__)

static void start(struct fixture *const f)
{
    if (setup_with(f, NULL) != 0 || hm2_board_start(f->board, &f->diag) != 0)
        fail_msg("%s", f->diag.text);
    f->probe = f->board->modules[f->board->module_count - 1].context;
}

static void cycle(struct fixture *const f)
{
    const int64_t begin_ns = link_now_ns(f->link);
    hm2_board_read(f->board, PERIOD_NS);
    hm2_board_write(f->board, PERIOD_NS);
    link_mock_advance(f->link, begin_ns + PERIOD_NS - link_now_ns(f->link));
}

static void cycles(struct fixture *const f, const unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        cycle(f);
}

static void said(const struct fixture *const f, const char *const words)
{
    if (!strstr(f->diag.text, words))
        fail_msg("\"%s\" is missing in:\n%s", words, f->diag.text);
}

/* Takes messages until one has these words. */
static bool message(const struct fixture *const f, const char *const words, const bool error)
{
    char text[1024];
    bool found_error;
    while (hm2_board_next_message(f->board, text, sizeof text, &found_error) > 0)
        if (strstr(text, words))
            return found_error == error;
    return false;
}

/* ---- identify -----------------------------------------------------------------------------------------------------
 */

static void a_card_is_known_by_its_name_and_idrom(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(identify(f), 0);
    assert_string_equal(hm2_board_card_name(f->board), "7I96S");
    assert_string_equal(hm2_board_type(f->board)->stem, "7i96s");
    assert_int_equal(hm2_board_type(f->board)->leds, 4);
    assert_int_equal(hm2_board_idrom(f->board)->module_count, 11);
    assert_true(f->card.datagrams <= 3);
    assert_int_equal(identify(f), HM2_ERR_STATE);
}

static void lost_and_late_set_up_replies_are_asked_for_again(void **state)
{
    struct fixture *const f = *state;
    f->card.lose_reply = true;
    f->card.delay_ns = BOARD_TRY_NS + FAKE_REPLY_NS; /* the second reply comes while the third is waited for */
    assert_int_equal(identify(f), 0);
    assert_string_equal(hm2_board_card_name(f->board), "7I96S");
    assert_int_equal(f->card.requests, 4);
}

static void a_stale_set_up_reply_is_not_taken_for_a_fresh_one(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(identify(f), 0);
    uint32_t value = 0;
    f->card.registers[0x3000 / 4] = 1;
    f->card.delay_ns = BOARD_TRY_NS + FAKE_REPLY_NS / 2; /* behind the reply to the second request */
    assert_int_equal(board_peek(f->board, 0x3000, 1, &value), 0);
    assert_int_equal(value, 1);
    f->card.registers[0x3000 / 4] = 2; /* the late reply, with 1, is still on its way */
    assert_int_equal(board_peek(f->board, 0x3000, 1, &value), 0);
    assert_int_equal(value, 2);
}

static void a_host_that_refuses_at_first_is_tried_again(void **state)
{
    struct fixture *const f = *state;
    f->card.refuse_send = true;
    assert_int_equal(identify(f), 0);
    assert_string_equal(hm2_board_card_name(f->board), "7I96S");
}

static void a_dead_card_is_given_up_after_about_a_second(void **state)
{
    struct fixture *const f = *state;
    f->card.dead = true;
    const int64_t begin_ns = link_now_ns(f->link);
    assert_int_equal(identify(f), HM2_ERR_TIMEOUT);
    const int64_t took_ns = link_now_ns(f->link) - begin_ns;
    assert_true(took_ns >= 900000000 && took_ns <= 1100000000);
    said(f, "no card answers after 5 requests of 200 ms each: no answer in time");
}

static void firmware_of_another_card_is_refused_with_every_reason(void **state)
{
    struct fixture *const f = *state;
    f->card.image.rom[0x24 / 4] = 24;
    f->card.image.rom[0x28 / 4] = 5;
    assert_int_equal(identify(f), HM2_ERR_MISMATCH);
    said(f, "7I96S: IDROM PortWidth is 24, expected 17 as this card has");
    said(f, "7I96S: IDROM ClockLow is 5 Hz, expected at least 1000000 Hz");
    assert_int_equal(hm2_board_setup(f->board, 0, hm2_plain_binder(f->plain), NULL, &f->diag), HM2_ERR_STATE);
}

static void an_unknown_card_gets_its_name_from_its_first_characters(void **state)
{
    struct fixture *const f = *state;
    memcpy(f->card.name, "LiTe.hm2-abcdefg", 16);
    assert_int_equal(identify(f), 0);
    assert_string_equal(hm2_board_type(f->board)->stem, "lite");
    assert_int_equal(hm2_board_type(f->board)->io_ports, 3);
    assert_int_equal(hm2_board_type(f->board)->leds, 0);
    said(f, "warning: \"LiTe.hm2-abcdefg\" is no card known here");
    assert_int_equal(hm2_board_setup(f->board, 2, hm2_plain_binder(f->plain), NULL, &f->diag), 0);
    assert_string_equal(hm2_board_prefix(f->board), "hm2_lite.2");
}

static void a_card_without_a_name_still_gets_one(void **state)
{
    struct fixture *const f = *state;
    memset(f->card.name, 0, sizeof f->card.name);
    assert_int_equal(identify(f), 0);
    assert_string_equal(hm2_board_type(f->board)->stem, "card");
}

/* ---- set-up -------------------------------------------------------------------------------------------------------
 */

static const struct hm2_module *module_of(const struct fixture *const f, const char *const name)
{
    for (unsigned i = 0; i < f->board->module_count; i++)
        if (strcmp(f->board->modules[i].type->name, name) == 0)
            return &f->board->modules[i];
    fail_msg("no module %s", name);
    return NULL;
}

static void modules_are_set_up_and_unknown_ones_left_alone(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, "num_stepgens=3"), 0);
    assert_string_equal(hm2_board_prefix(f->board), PREFIX);
    assert_int_equal(f->board->module_count, 4);
    assert_int_equal(module_of(f, "stepgen")->instances, 3);
    assert_int_equal(module_of(f, "encoder")->instances, 1);
    assert_ptr_equal(f->board->pins[21].owner, module_of(f, "stepgen"));
    assert_null(f->board->pins[23].owner);
    said(f, "warning: " PREFIX ": module Hostmot2 DPLL (tag 0x1A, version 0x00) has no driver here and is left alone");
    EXPECT("packet-read-timeout", 80);
    EXPECT("packet-error-limit", 10);
    EXPECT("packet-error-increment", 2);
    EXPECT("packet-error-decrement", 1);
    EXPECT("watchdog.has_bit", 0);
}

static void counts_beyond_the_firmware_are_refused_with_key_value_and_limit(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, "num_encoders=3 num_stepgens=5 num_leds=9 num_dplls=2"), HM2_ERR_INVALID);
    said(f, "config num_encoders=3 found, at most 1 expected: the firmware has no more");
    said(f, "warning: " PREFIX ": config num_dplls=2, but the firmware has 1; using 1");
    assert_null(strstr(f->diag.text, "num_stepgens"));
    assert_null(strstr(f->diag.text, "num_leds"));
    assert_int_equal(hm2_plain_count(f->plain), 0);
}

static void a_channel_beyond_those_of_the_firmware_is_refused(void **state)
{
    struct fixture *const f = *state;
    f->card.image.rom[(0x40 + 12 * 4) / 4] = 0x02010008; /* two channels of SSI instead of PWM */
    assert_int_equal(setup_with(f, "ssi_chan_1=a%4u ssi_chan_2=a%4u"), HM2_ERR_INVALID);
    said(f, "config ssi_chan_2 found, but the firmware has 2 such channels");
    assert_null(strstr(f->diag.text, "ssi_chan_1"));
}

/* As in LinuxCNC, which looks at a count or a channel only when it meets the module. */
static void what_the_firmware_lacks_altogether_has_no_effect(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, "num_resolvers=1 num_3pwmgens=99 ssi_chan_0=a%4u biss_chan_31=b%8u num_uarts=0"), 0);
    said(f, "warning: " PREFIX ": config num_resolvers=1 has no effect: the firmware has none");
    said(f, "warning: " PREFIX ": config num_3pwmgens=99 has no effect: the firmware has none");
    said(f, "warning: " PREFIX ": config ssi_chan_0 has no effect: the firmware has no such channels");
    said(f, "warning: " PREFIX ": config biss_chan_31 has no effect: the firmware has no such channels");
    assert_null(strstr(f->diag.text, "num_uarts"));
}

static void a_smart_serial_port_that_the_firmware_lacks_has_no_effect(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, "sserial_port_1=00000000"), 0);
    said(f, "warning: " PREFIX ": config sserial_port_1 has no effect: the firmware has 1 smart-serial ports");
}

static void a_bad_config_word_is_refused(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, "num_encoders=1 bogus"), HM2_ERR_INVALID);
    said(f, "\"bogus\" is not known");
}

static void descriptors_that_do_not_suit_their_driver_are_all_reported(void **state)
{
    struct fixture *const f = *state;
    f->card.image.rom[(0x40 + 12) / 4] = 0x01010102;     /* watchdog version 1 */
    f->card.image.rom[(0x40 + 12 * 10 + 8) / 4] = 0x10;  /* LED with a register per instance */
    f->card.image.rom[(0x40 + 12 * 4) / 4] = 0x0101020C; /* muxed encoder instead of PWM */
    assert_int_equal(setup_with(f, NULL), HM2_ERR_MISMATCH);
    said(f, "module Watchdog (tag 0x02): version/registers/instance stride/register mask 0x01/3/4/0x0 found, expected "
            "0x00/3/4/0x0");
    said(f, "module LED (tag 0x80): version/registers/instance stride/register mask 0x00/1/4/0x10 found, expected "
            "0x00/1/4/0x0 or 0x03/2/8/0x1");
    said(f, "the firmware has both Encoder and Muxed Encoder, which share the name encoder");
    assert_int_equal(hm2_plain_count(f->plain), 0);
}

static void what_cannot_be_driven_is_left_alone_unless_it_is_asked_for(void **state)
{
    struct fixture *const f = *state;
    f->card.image.rom[(0x40 + 12 * 10 + 8) / 4] = 0x10; /* LED with a register per instance */
    assert_int_equal(setup_with(f, NULL), 0);
    said(f, "warning: hm2_7i96s.0: module LED (tag 0x80): ");
    said(f, "; the firmware does not suit this driver; it is left alone");
    for (unsigned i = 0; i < f->board->module_count; i++)
        assert_string_not_equal(f->board->modules[i].type->name, "led");
}

static void what_is_asked_for_must_be_there(void **state)
{
    struct fixture *const f = *state;
    f->card.image.rom[(0x40 + 12 * 4) / 4] = 0x0101020C; /* muxed encoder instead of PWM */
    assert_int_equal(setup_with(f, "num_encoders=1"), HM2_ERR_MISMATCH);
    said(f, "the firmware has both Encoder and Muxed Encoder, which share the name encoder; only Encoder is used");
}

static void pins_are_listed_with_terminal_and_owner(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, NULL), 0);
    char text[8192];
    const size_t needed = hm2_board_describe_pins(f->board, text, sizeof text);
    assert_int_equal(needed, strlen(text));
    assert_non_null(strstr(text, "IO Pin 017 (TB1-2,3): StepGen #0, pin Step (Output)\n"));
    assert_non_null(strstr(text, "IO Pin 050 (P1-25/DB25-13): IOPort\n"));
    char little[64];
    assert_int_equal(hm2_board_describe_pins(f->board, little, sizeof little), needed);
    assert_memory_equal(little, text, sizeof little - 1);
    assert_int_equal(hm2_board_describe_pins(f->board, NULL, 0), needed);
}

static void a_daughter_board_that_is_named_gives_its_terminals(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, "dbname3=7i76 dbname4=7I77"), 0);
    char text[8192];
    (void)hm2_board_describe_pins(f->board, text, sizeof text);
    assert_non_null(strstr(text, "IO Pin 017 (TB1-2,3): StepGen #0, pin Step (Output)\n"));
    assert_non_null(strstr(text, "IO Pin 034 (P1 -> 7I76 TB2-4,5): IOPort\n"));
    assert_non_null(strstr(text, "IO Pin 050 (P1 -> 7I76 TB3-7,8): IOPort\n"));
    said(f, "config dbname4 has no effect: the card has 3 connectors");
}

/* ---- start and stop -----------------------------------------------------------------------------------------------
 */

static void start_confirms_every_register_before_the_first_read(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, NULL), 0);
    f->card.lose_write = true;
    f->card.lose_reply = true;
    assert_int_equal(hm2_board_start(f->board, &f->diag), 0);
    f->probe = module_of(f, "probe")->context;
    assert_int_equal(f->card.registers[PROBE_SETTING / 4], 55);
    assert_int_equal(f->card.registers[0x0C00 / 4], 0x80000000); /* watchdog disabled until the first write */
    assert_int_equal(f->probe->starts, 1);
    assert_int_equal(f->probe->packs, 0);
    assert_true(hm2_plan_settled(f->board->plan));
    assert_int_equal(hm2_board_start(f->board, &f->diag), HM2_ERR_STATE);
    EXPECT("packet-error-total", 0);
}

static void start_gives_up_on_a_card_that_fell_silent(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, NULL), 0);
    f->card.dead = true;
    const int64_t begin_ns = link_now_ns(f->link);
    assert_int_equal(hm2_board_start(f->board, &f->diag), HM2_ERR_TIMEOUT);
    assert_true(link_now_ns(f->link) - begin_ns < 1200000000);
    said(f, "the card did not confirm its set-up within one second");
}

static void the_first_write_enables_the_watchdog_and_sends_outputs(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "probe.out", 4711);
    cycle(f);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 4711);
    assert_int_equal(f->card.registers[0x0C00 / 4], 0x0007A11F);
    assert_int_equal(f->probe->writes, 0);
    cycle(f);
    assert_int_equal(f->probe->writes, 1);
}

static void stop_makes_the_watchdog_bite_and_ends_the_cycle(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 3);
    hm2_board_stop(f->board);
    assert_int_equal(f->card.registers[0x0C00 / 4], 1);
    const unsigned datagrams = f->card.datagrams;
    cycles(f, 3);
    hm2_board_request(f->board, PERIOD_NS);
    assert_int_equal(f->card.datagrams, datagrams);
}

static void stop_after_a_failed_set_up_bites_too(void **state)
{
    struct fixture *const f = *state;
    assert_int_equal(setup_with(f, "bogus"), HM2_ERR_INVALID);
    f->card.lose_request = true;
    hm2_board_stop(f->board);
    assert_int_equal(f->card.registers[0x0C00 / 4], 1);
}

static void stop_of_a_silent_or_never_identified_card_ends_soon(void **state)
{
    struct fixture *const f = *state;
    hm2_board_stop(f->board);
    assert_int_equal(f->card.datagrams, 0);
    start(f);
    f->card.dead = true;
    const int64_t begin_ns = link_now_ns(f->link);
    hm2_board_stop(f->board);
    assert_true(link_now_ns(f->link) - begin_ns <= 60000000);
}

/* ---- the good cycle -----------------------------------------------------------------------------------------------
 */

static void a_good_cycle_is_one_request_one_reply_one_write(void **state)
{
    struct fixture *const f = *state;
    start(f);
    const unsigned requests = f->card.requests, writes = f->card.writes;
    for (unsigned i = 1; i <= 100; i++) {
        f->card.registers[PROBE_READ / 4] = 1000 + i;
        cycle(f);
        EXPECT("probe.in", 1000 + i);
        EXPECT("packet-error", 0);
        EXPECT("data-age", 0);
    }
    assert_int_equal(f->card.requests - requests, 100);
    assert_int_equal(f->card.writes - writes, 100);
    EXPECT("packet-error-total", 0);
    EXPECT("packet-lost", 0);
    EXPECT("rtt-us", FAKE_REPLY_NS / 1000.0);
    EXPECT("rtt-min-us", FAKE_REPLY_NS / 1000.0);
    EXPECT("rtt-max-us", FAKE_REPLY_NS / 1000.0);
    assert_false(message(f, "", false));
}

static void a_second_request_is_not_sent_before_the_first_was_read(void **state)
{
    struct fixture *const f = *state;
    start(f);
    const unsigned requests = f->card.requests;
    assert_false(hm2_board_request_outstanding(f->board));
    hm2_board_request(f->board, PERIOD_NS);
    hm2_board_request(f->board, PERIOD_NS);
    assert_true(hm2_board_request_outstanding(f->board));
    hm2_board_read(f->board, PERIOD_NS);
    assert_false(hm2_board_request_outstanding(f->board));
    assert_int_equal(f->card.requests - requests, 1);
    EXPECT("packet-error", 0);
}

static void round_trips_are_measured_and_can_be_measured_anew(void **state)
{
    struct fixture *const f = *state;
    start(f);
    f->card.delay_ns = 25000;
    cycle(f);
    cycle(f);
    EXPECT("rtt-max-us", 75);
    EXPECT("rtt-min-us", 50);
    EXPECT("rtt-us", 50);
    set(f, "rtt-reset", 1);
    f->card.delay_ns = 10000;
    cycle(f);
    EXPECT("rtt-reset", 0);
    EXPECT("rtt-max-us", 60);
    EXPECT("rtt-min-us", 60);
}

/* ---- errors (hal-interface 3.4, 3.5) ------------------------------------------------------------------------------
 */

static void the_read_time_out_is_percent_or_nanoseconds(void **state)
{
    (void)state;
    static const struct {
        int32_t setting;
        int64_t period_ns, limit_ns;
    } rows[] = {
        {80, 1000000, 800000},        {0, 1000000, 800000},     {-5, 1000000, 800000},
        {1, 1000000, 100000},         {99, 1000000, 990000},    {100, 1000000, 100000},
        {500000, 1000000, 500000},    {99999, 1000000, 100000}, {100001, 250000, 100001},
        {50, 2000001, 1000000},       {80, 100000, 100000},     {INT32_MAX, 1000000, INT32_MAX},
        {INT32_MIN, 1000000, 800000},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_int_equal(board_read_limit_ns(rows[i].setting, rows[i].period_ns), rows[i].limit_ns);
}

static void the_deadline_counts_from_the_request(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "packet-read-timeout", 500000);
    f->card.delay_ns = 500000; /* arrives 550 us after the request */
    hm2_board_request(f->board, PERIOD_NS);
    const int64_t request_ns = link_now_ns(f->link);
    link_mock_advance(f->link, 300000);
    hm2_board_read(f->board, PERIOD_NS);
    assert_int_equal(link_now_ns(f->link) - request_ns, 500000);
    EXPECT("packet-lost", 1);
    EXPECT("packet-error", 1);
}

static void five_lost_replies_raise_io_error_and_freeze_every_input(void **state)
{
    struct fixture *const f = *state;
    start(f);
    f->card.registers[PROBE_READ / 4] = 5;
    cycle(f);
    f->card.registers[PROBE_READ / 4] = 6;
    for (int i = 1; i <= 5; i++) {
        f->card.lose_reply = true;
        cycle(f);
        EXPECT("packet-error", 1);
        EXPECT("packet-error-total", i);
        EXPECT("packet-error-level", 2 * i);
        EXPECT("packet-error-exceeded", i == 5);
        EXPECT("io_error", i == 5);
        EXPECT("packet-lost", i);
        EXPECT("data-age", i);
        EXPECT("probe.in", 5);
    }
    char text[1024];
    bool error;
    assert_int_equal(hm2_board_next_message(f->board, text, sizeof text, &error), 1);
    assert_non_null(strstr(text, "packet error: 1 failed cycles so far (no reply in time 1,"));
    assert_false(error);
    /* The next three were no news. */
    assert_int_equal(hm2_board_next_message(f->board, text, sizeof text, &error), 1);
    assert_non_null(strstr(text, "error finishing read: 5 failed cycles so far"));
    assert_true(error);
    assert_int_equal(hm2_board_next_message(f->board, text, sizeof text, &error), 0);
}

static void with_io_error_nothing_is_sent_until_a_person_clears_it(void **state)
{
    struct fixture *const f = *state;
    start(f);
    for (int i = 0; i < 5; i++) {
        f->card.lose_reply = true;
        cycle(f);
    }
    const unsigned datagrams = f->card.datagrams;
    cycles(f, 20);
    assert_int_equal(f->card.datagrams, datagrams);
    EXPECT("packet-error-total", 5);
    set(f, "io_error", 0);
    f->card.registers[PROBE_READ / 4] = 99;
    cycle(f);
    EXPECT("probe.in", 99);
    EXPECT("packet-error", 0);
    EXPECT("packet-error-level", 0);
    EXPECT("packet-error-exceeded", 0);
    EXPECT("io_error", 0);
}

static void io_error_set_by_a_person_stops_between_request_and_read(void **state)
{
    struct fixture *const f = *state;
    start(f);
    hm2_board_request(f->board, PERIOD_NS);
    set(f, "io_error", 1);
    const unsigned unpacks = f->probe->unpacks;
    hm2_board_read(f->board, PERIOD_NS);
    assert_int_equal(f->probe->unpacks, unpacks);
    assert_false(hm2_board_request_outstanding(f->board));
    set(f, "io_error", 0);
    link_mock_advance(f->link, PERIOD_NS);
    cycle(f);
    EXPECT("packet-late", 1); /* the reply to the request that was given up */
    EXPECT("packet-error", 0);
}

static void every_third_packet_may_be_lost_but_not_every_second(void **state)
{
    struct fixture *const f = *state;
    start(f);
    for (int i = 0; i < 300; i++) {
        f->card.lose_reply = i % 3 == 0;
        cycle(f);
        f->card.lose_reply = false;
    }
    EXPECT("io_error", 0);
    EXPECT("packet-error-total", 100);
    for (int i = 0; i < 20; i++) {
        f->card.lose_reply = i % 2 == 0;
        cycle(f);
        f->card.lose_reply = false;
    }
    EXPECT("io_error", 1);
}

static void steps_and_limit_of_the_level_follow_their_parameters(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "packet-error-limit", 100);
    set(f, "packet-error-increment", 7);
    set(f, "packet-error-decrement", 3);
    f->card.lose_reply = true;
    cycle(f);
    EXPECT("packet-error-level", 7);
    cycle(f);
    EXPECT("packet-error-level", 4);
    set(f, "packet-error-increment", -3); /* acts as 1 */
    f->card.lose_reply = true;
    cycle(f);
    EXPECT("packet-error-level", 5);
    set(f, "packet-error-decrement", 0); /* acts as 1 */
    cycle(f);
    EXPECT("packet-error-level", 4);
    set(f, "packet-error-increment", INT32_MAX);
    f->card.lose_reply = true;
    cycle(f);
    EXPECT("packet-error-level", 100);
    EXPECT("io_error", 1);
}

static void a_limit_below_one_acts_as_one(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "packet-error-limit", INT32_MIN);
    cycles(f, 3);
    EXPECT("io_error", 0);
    f->card.lose_reply = true;
    cycle(f);
    EXPECT("io_error", 1);
}

static void the_total_may_be_zeroed(void **state)
{
    struct fixture *const f = *state;
    start(f);
    f->card.lose_reply = true;
    cycle(f);
    set(f, "packet-error-total", 0);
    f->card.lose_reply = true;
    cycle(f);
    EXPECT("packet-error-total", 1);
    EXPECT("packet-lost", 2);
}

static void a_late_reply_is_counted_and_never_used(void **state)
{
    struct fixture *const f = *state;
    start(f);
    f->card.registers[PROBE_READ / 4] = 1;
    f->card.delay_ns = 900000; /* behind 80 % of the period, before the next request */
    cycle(f);
    EXPECT("packet-lost", 1);
    EXPECT("packet-error", 1);
    f->card.registers[PROBE_READ / 4] = 2;
    cycle(f);
    EXPECT("packet-late", 1);
    EXPECT("packet-error", 0);
    EXPECT("probe.in", 2);
    EXPECT("packet-stale", 0);
    EXPECT("packet-malformed", 0);
}

static void a_repeated_reply_is_counted_as_stale_and_never_used(void **state)
{
    struct fixture *const f = *state;
    start(f);
    f->card.registers[PROBE_READ / 4] = 1;
    f->card.duplicate = true;
    cycle(f);
    EXPECT("packet-stale", 0);
    f->card.registers[PROBE_READ / 4] = 2;
    cycle(f);
    EXPECT("packet-stale", 1);
    EXPECT("probe.in", 2);
    EXPECT("packet-error-total", 0);
}

static void a_repeated_reply_alone_does_not_make_a_cycle_good(void **state)
{
    struct fixture *const f = *state;
    start(f);
    f->card.registers[PROBE_READ / 4] = 1;
    f->card.duplicate = true;
    cycle(f);
    f->card.registers[PROBE_READ / 4] = 2;
    f->card.lose_reply = true;
    cycle(f);
    EXPECT("packet-error", 1);
    EXPECT("packet-stale", 1);
    EXPECT("packet-lost", 1);
    EXPECT("probe.in", 1);
}

static void short_and_long_replies_are_malformed(void **state)
{
    struct fixture *const f = *state;
    start(f);
    const unsigned unpacks = f->probe->unpacks;
    static const int cuts[] = {1, 4, 10, -1, -4, -60};
    for (int i = 0; i < 6; i++) {
        f->card.cut = cuts[i];
        cycle(f);
        EXPECT("packet-malformed", i + 1);
        EXPECT("packet-error", 1);
        cycles(f, 2);
    }
    assert_int_equal(f->probe->unpacks - unpacks, 12);
    EXPECT("packet-lost", 6);
}

static void a_send_that_fails_is_a_failed_cycle_without_waiting(void **state)
{
    struct fixture *const f = *state;
    start(f);
    f->card.refuse_send = true;
    const int64_t begin_ns = link_now_ns(f->link);
    hm2_board_read(f->board, PERIOD_NS);
    assert_int_equal(link_now_ns(f->link), begin_ns);
    EXPECT("packet-lost", 1);
    EXPECT("packet-error", 1);
    assert_true(message(f, "sends refused 1", false));
}

static void a_lost_write_is_an_error_but_the_inputs_are_used(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 3);
    f->card.lose_write = true;
    set(f, "probe.setting", 42);
    cycle(f);
    assert_int_equal(f->card.registers[PROBE_SETTING / 4], 77);
    f->card.registers[PROBE_READ / 4] = 1234;
    cycle(f);
    EXPECT("probe.in", 1234);
    EXPECT("packet-error", 1);
    EXPECT("packet-error-level", 2);
    EXPECT("packet-error-total", 1);
    EXPECT("write-lost", 1);
    EXPECT("packet-lost", 0);
    assert_int_equal(f->probe->losts, 1);
    assert_int_equal(f->card.registers[PROBE_SETTING / 4], 42); /* sent again */
    cycle(f);
    EXPECT("packet-error", 0);
}

static void a_write_that_cannot_be_sent_is_sent_again(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 3);
    set(f, "probe.setting", 43);
    hm2_board_read(f->board, PERIOD_NS);
    f->card.refuse_send = true;
    hm2_board_write(f->board, PERIOD_NS);
    assert_int_equal(f->card.registers[PROBE_SETTING / 4], 77);
    hm2_board_write(f->board, PERIOD_NS);
    assert_int_equal(f->card.registers[PROBE_SETTING / 4], 43);
}

/* ---- watchdog bites -----------------------------------------------------------------------------------------------
 */

static void bite(struct fixture *const f)
{
    f->card.registers[0x0D00 / 4] = 1;
}

static void a_bite_is_told_with_its_reason(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 3);
    link_mock_advance(f->link, 7000000); /* a late write and a loss long ago did not make it bite */
    f->card.lose_reply = true;
    cycles(f, 20);
    bite(f);
    cycle(f);
    EXPECT("watchdog.has_bit", 1);
    assert_true(f->probe->bitten);
    assert_true(message(f, PREFIX ": the watchdog has bitten. Reason: unknown, no packet was lost", true));
}

static void a_bite_after_a_late_write_says_so(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 20);
    link_mock_advance(f->link, 7000000);
    bite(f);
    cycle(f);
    assert_true(message(f, "Reason: late write, 7950 us between two writes at a period of 1000 us", true));
}

static void a_late_write_is_remembered_until_a_good_reply_was_seen(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 20);
    hm2_board_read(f->board, PERIOD_NS);
    link_mock_advance(f->link, 7000000); /* held up between read and write */
    bite(f);
    hm2_board_write(f->board, PERIOD_NS);
    link_mock_advance(f->link, PERIOD_NS);
    cycle(f);
    assert_true(message(f, "Reason: late write, 8000 us between", true));
}

static void a_bite_after_lost_packets_says_so(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 20);
    f->card.dead = true;
    cycles(f, 4);
    f->card.dead = false;
    bite(f);
    cycle(f);
    assert_true(message(f, "Reason: packets were lost", true));
}

static void a_bite_after_a_lost_write_says_so(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 20);
    f->card.lose_write = true;
    cycle(f);
    bite(f);
    cycle(f);
    assert_true(message(f, "Reason: packets were lost", true));
}

static void clearing_has_bit_brings_outputs_back(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "probe.out", 7);
    cycles(f, 3);
    bite(f);
    cycles(f, 3);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 0);
    set(f, "watchdog.has_bit", 0);
    f->card.registers[PROBE_SETTING / 4] = 0;
    cycle(f);
    assert_int_equal(f->card.registers[0x0D00 / 4], 0);
    assert_int_equal(f->card.registers[PROBE_SETTING / 4], 77); /* everything was sent again */
    cycles(f, 3);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 7);
    EXPECT("watchdog.has_bit", 0);
    EXPECT("packet-error-total", 0);
}

/* ---- power loss and other firmware --------------------------------------------------------------------------------
 */

static void a_card_that_lost_its_power_is_asked_who_it_is_before_anything_is_sent(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "probe.out", 9);
    f->card.registers[PROBE_READ / 4] = 50;
    cycles(f, 10);
    fake_card_power_cycle(&f->card);
    const unsigned writes = f->card.writes;
    cycle(f);
    EXPECT("packet-error", 1);
    EXPECT("probe.in", 50); /* the zero of the card's new life is not shown */
    assert_int_equal(f->card.writes, writes);
    assert_int_equal(f->card.registers[PROBE_SETTING / 4], 0);
    assert_true(message(f, "the card has lost its state", true));
}

static void the_same_firmware_is_restored_with_outputs_off_until_a_person_clears_has_bit(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "probe.out", 9);
    cycles(f, 10);
    fake_card_power_cycle(&f->card);
    f->card.registers[PROBE_READ / 4] = 3;
    cycles(f, 6);
    EXPECT("watchdog.has_bit", 1);
    EXPECT("io_error", 0);
    EXPECT("packet-error", 0);
    EXPECT("probe.in", 3);
    assert_int_equal(f->probe->starts, 2);
    assert_int_equal(f->card.registers[PROBE_SETTING / 4], 77);
    assert_int_equal(f->card.registers[0x0C00 / 4], 0x0007A11F);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 0);
    assert_true(f->probe->bitten);
    assert_true(message(f, "the card is back with the same firmware", true));
    set(f, "watchdog.has_bit", 0);
    cycles(f, 3);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 9);
    EXPECT("watchdog.has_bit", 0);
}

static void a_power_loss_in_the_moment_of_clearing_a_bite_is_noticed(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 10);
    bite(f);
    cycles(f, 3);
    set(f, "watchdog.has_bit", 0);
    cycle(f); /* everything is on its way again */
    fake_card_power_cycle(&f->card);
    cycles(f, 6);
    EXPECT("watchdog.has_bit", 1);
    assert_int_equal(f->probe->starts, 2);
}

static void a_restore_ends_only_when_everything_is_confirmed_whatever_is_lost(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "packet-error-limit", 1000);
    for (uint64_t pattern = 0; pattern < 256; pattern++) {
        const unsigned starts = f->probe->starts;
        cycles(f, 5);
        fake_card_power_cycle(&f->card);
        for (unsigned i = 0; i < 30 && f->probe->starts == starts; i++) {
            f->card.lose_write = pattern >> i & 1u;
            f->card.lose_reply = pattern >> (i + 4) & 1u;
            cycle(f);
            f->card.lose_write = f->card.lose_reply = false;
            assert_int_equal(f->card.registers[PROBE_WRITE / 4], 0);
        }
        assert_int_equal(f->probe->starts, starts + 1);
        assert_int_equal(f->card.registers[PROBE_SETTING / 4], 77);
        assert_true(hm2_plan_settled(f->board->plan));
        EXPECT("watchdog.has_bit", 1);
        set(f, "watchdog.has_bit", 0);
    }
}

static void firmware_that_changes_during_a_restore_is_refused_too(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 10);
    fake_card_power_cycle(&f->card);
    cycles(f, 2);
    assert_int_equal(f->board->recovery, BOARD_RESTORES);
    f->card.dead = true;
    cycles(f, 10);
    EXPECT("io_error", 1);
    f->card.dead = false;
    f->card.image.rom[30] ^= 1;
    fake_card_power_cycle(&f->card);
    set(f, "io_error", 0);
    const unsigned writes = f->card.writes;
    cycles(f, 3);
    EXPECT("io_error", 1);
    assert_int_equal(f->card.writes, writes);
    assert_true(message(f, "came back with other firmware", true));
}

static void without_a_watchdog_io_error_holds_the_outputs_after_a_power_loss(void **state)
{
    struct fixture *const f = *state;
    f->card.image.rom[(0x40 + 12) / 4] = 0x0101000B;
    start(f);
    assert_null(f->board->watchdog);
    set(f, "probe.out", 9);
    cycles(f, 10);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 9);
    fake_card_power_cycle(&f->card);
    cycles(f, 10);
    EXPECT("io_error", 1);
    assert_int_equal(f->probe->starts, 2);
    assert_int_equal(f->card.registers[PROBE_SETTING / 4], 77);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 0);
    set(f, "io_error", 0);
    cycles(f, 2);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 9);
    hm2_board_stop(f->board);
}

static void a_long_power_cut_needs_io_error_and_has_bit_cleared(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 10);
    f->card.dead = true;
    cycles(f, 300);
    EXPECT("io_error", 1);
    EXPECT("packet-error-total", 5);
    fake_card_power_cycle(&f->card);
    f->card.dead = false;
    set(f, "io_error", 0);
    cycles(f, 6);
    EXPECT("io_error", 0);
    EXPECT("watchdog.has_bit", 1);
    assert_int_equal(f->probe->starts, 2);
}

static void other_firmware_is_refused_and_nothing_more_is_sent(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 10);
    fake_card_power_cycle(&f->card);
    const struct hm2_image before = f->card.image;
    f->card.image.id[2] = 0x33544F4D;
    f->card.image.rom[4] = 0x33394937;
    cycles(f, 3);
    EXPECT("io_error", 1);
    assert_true(message(f, "config name \"HOSTMOT3\", board \"MESA7I93\"", true));
    const unsigned datagrams = f->card.datagrams;
    cycles(f, 20);
    assert_int_equal(f->card.datagrams, datagrams);
    /* Clearing io_error asks again, and still refuses. */
    set(f, "io_error", 0);
    cycles(f, 3);
    EXPECT("io_error", 1);
    hm2_board_stop(f->board);
    assert_int_equal(f->card.registers[0x0C00 / 4], 0); /* no write to firmware that nobody knows */
    f->card.image = before;
}

static void the_right_firmware_programmed_again_is_restored(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 10);
    fake_card_power_cycle(&f->card);
    f->card.image.rom[20] ^= 1;
    cycles(f, 3);
    EXPECT("io_error", 1);
    f->card.image.rom[20] ^= 1;
    set(f, "io_error", 0);
    cycles(f, 6);
    EXPECT("io_error", 0);
    EXPECT("watchdog.has_bit", 1);
    assert_int_equal(f->probe->starts, 2);
}

/* ---- coming back without a person -----------------------------------------------------------------------------------
 */

static void without_auto_rearm_a_card_that_is_back_waits_for_ever(void **state)
{
    struct fixture *const f = *state;
    start(f);
    cycles(f, 10);
    EXPECT("position-lost", 0);
    bite(f);
    cycles(f, 2);
    EXPECT("position-lost", 1);
    set(f, "position-lost", 0);
    cycles(f, 5000);
    EXPECT("watchdog.has_bit", 1);
    EXPECT("position-lost", 0); /* a person has seen it */
    EXPECT("auto-rearms", 0);
    f->card.dead = true;
    cycles(f, 5000);
    EXPECT("io_error", 1);
}

static void with_auto_rearm_a_bite_is_cleared_after_half_a_second_of_good_cycles(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "auto-rearm", 1);
    set(f, "probe.out", 9);
    cycles(f, 10);
    bite(f);
    cycles(f, 400);
    EXPECT("watchdog.has_bit", 1);
    f->card.lose_reply = true; /* a card that comes and goes has to be there for the whole time */
    cycle(f);
    cycles(f, 400);
    EXPECT("watchdog.has_bit", 1);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 0);
    cycles(f, 110);
    EXPECT("watchdog.has_bit", 0);
    EXPECT("auto-rearms", 1);
    EXPECT("position-lost", 1);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 9);
}

static void with_auto_rearm_a_card_comes_back_after_any_power_cut(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "auto-rearm", 1);
    set(f, "probe.out", 9);
    cycles(f, 10);
    f->card.dead = true;
    cycles(f, 60000);
    EXPECT("packet-error-exceeded", 1);
    EXPECT("auto-rearms", 0);
    f->card.dead = false;
    fake_card_power_cycle(&f->card);
    cycles(f, 400);
    EXPECT("io_error", 0);
    EXPECT("watchdog.has_bit", 1);
    EXPECT("position-lost", 1);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 0);
    cycles(f, 300);
    EXPECT("watchdog.has_bit", 0);
    EXPECT("auto-rearms", 1);
    assert_int_equal(f->card.registers[PROBE_WRITE / 4], 9);
}

static void a_dead_card_is_asked_for_five_cycles_every_tenth_of_a_second(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "auto-rearm", 1);
    f->card.dead = true;
    cycles(f, 1000);
    assert_in_range((unsigned)get(f, "packet-error-total"), 45, 55);
}

static void auto_rearm_leaves_alone_what_a_person_stopped_and_other_firmware(void **state)
{
    struct fixture *const f = *state;
    start(f);
    set(f, "auto-rearm", 1);
    cycles(f, 10);
    set(f, "io_error", 1);
    cycles(f, 1000);
    EXPECT("io_error", 1);
    set(f, "io_error", 0);
    cycles(f, 10);
    f->card.image.id[2] = 0x33544F4D;
    fake_card_power_cycle(&f->card);
    cycles(f, 2000);
    EXPECT("io_error", 1);
    EXPECT("auto-rearms", 0);
}

/* ---- other messages -----------------------------------------------------------------------------------------------
 */

static void conditions_of_modules_become_sentences(void **state)
{
    struct fixture *const f = *state;
    start(f);
    const struct hm2_module *const stepgen = module_of(f, "stepgen");
    hm2_notice(stepgen, HM2_NOTICE_VALUE_CLAMPED, 3, 2.5);
    assert_true(message(f, PREFIX ".stepgen.03: the value 2.5 is out of range", true));
    hm2_notice_point(stepgen, HM2_NOTICE_VALUE_CLAMPED, "maxvel", 3, 2.5);
    assert_true(message(f, PREFIX ".stepgen.03.maxvel: the value 2.5 is out of range", true));
    hm2_notice_point(stepgen, HM2_NOTICE_VALUE_CLAMPED, "timer-number", HM2_NO_INSTANCE, 9);
    assert_true(message(f, PREFIX ".stepgen.timer-number: the value 9 is out of range", true));
    hm2_notice(stepgen, HM2_NOTICE_HEADROOM, 1, 100.0);
    assert_true(message(f, PREFIX ".stepgen.01: the command asks for 100, which maxvel or maxaccel", false));
    hm2_notice(stepgen, HM2_NOTICE_DUMP_STATE, 0, 0);
    assert_true(message(f, PREFIX ": 7I96S, 4 modules: watchdog*1 stepgen*5 encoder*1 probe*1", false));
    for (unsigned i = 0; i < NOTICE_RING_SIZE + 3; i++)
        hm2_notice(stepgen, HM2_NOTICE_QUAD_ERROR, i, 0);
    assert_true(message(f, "3 messages were dropped", false));
    assert_false(message(f, "", false));
}

#define TEST(function) cmocka_unit_test_setup_teardown(function, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(a_card_is_known_by_its_name_and_idrom),
        TEST(lost_and_late_set_up_replies_are_asked_for_again),
        TEST(a_stale_set_up_reply_is_not_taken_for_a_fresh_one),
        TEST(a_host_that_refuses_at_first_is_tried_again),
        TEST(a_dead_card_is_given_up_after_about_a_second),
        TEST(firmware_of_another_card_is_refused_with_every_reason),
        TEST(an_unknown_card_gets_its_name_from_its_first_characters),
        TEST(a_card_without_a_name_still_gets_one),
        TEST(modules_are_set_up_and_unknown_ones_left_alone),
        TEST(counts_beyond_the_firmware_are_refused_with_key_value_and_limit),
        TEST(a_channel_beyond_those_of_the_firmware_is_refused),
        TEST(what_the_firmware_lacks_altogether_has_no_effect),
        TEST(a_smart_serial_port_that_the_firmware_lacks_has_no_effect),
        TEST(a_bad_config_word_is_refused),
        TEST(descriptors_that_do_not_suit_their_driver_are_all_reported),
        TEST(what_cannot_be_driven_is_left_alone_unless_it_is_asked_for),
        TEST(what_is_asked_for_must_be_there),
        TEST(pins_are_listed_with_terminal_and_owner),
        TEST(a_daughter_board_that_is_named_gives_its_terminals),
        TEST(start_confirms_every_register_before_the_first_read),
        TEST(start_gives_up_on_a_card_that_fell_silent),
        TEST(the_first_write_enables_the_watchdog_and_sends_outputs),
        TEST(stop_makes_the_watchdog_bite_and_ends_the_cycle),
        TEST(stop_after_a_failed_set_up_bites_too),
        TEST(stop_of_a_silent_or_never_identified_card_ends_soon),
        TEST(a_good_cycle_is_one_request_one_reply_one_write),
        TEST(a_second_request_is_not_sent_before_the_first_was_read),
        TEST(round_trips_are_measured_and_can_be_measured_anew),
        TEST(the_read_time_out_is_percent_or_nanoseconds),
        TEST(the_deadline_counts_from_the_request),
        TEST(five_lost_replies_raise_io_error_and_freeze_every_input),
        TEST(with_io_error_nothing_is_sent_until_a_person_clears_it),
        TEST(io_error_set_by_a_person_stops_between_request_and_read),
        TEST(every_third_packet_may_be_lost_but_not_every_second),
        TEST(steps_and_limit_of_the_level_follow_their_parameters),
        TEST(a_limit_below_one_acts_as_one),
        TEST(the_total_may_be_zeroed),
        TEST(a_late_reply_is_counted_and_never_used),
        TEST(a_repeated_reply_is_counted_as_stale_and_never_used),
        TEST(a_repeated_reply_alone_does_not_make_a_cycle_good),
        TEST(short_and_long_replies_are_malformed),
        TEST(a_send_that_fails_is_a_failed_cycle_without_waiting),
        TEST(a_lost_write_is_an_error_but_the_inputs_are_used),
        TEST(a_write_that_cannot_be_sent_is_sent_again),
        TEST(a_bite_is_told_with_its_reason),
        TEST(a_bite_after_a_late_write_says_so),
        TEST(a_late_write_is_remembered_until_a_good_reply_was_seen),
        TEST(a_bite_after_lost_packets_says_so),
        TEST(a_bite_after_a_lost_write_says_so),
        TEST(clearing_has_bit_brings_outputs_back),
        TEST(a_card_that_lost_its_power_is_asked_who_it_is_before_anything_is_sent),
        TEST(the_same_firmware_is_restored_with_outputs_off_until_a_person_clears_has_bit),
        TEST(a_power_loss_in_the_moment_of_clearing_a_bite_is_noticed),
        TEST(a_restore_ends_only_when_everything_is_confirmed_whatever_is_lost),
        TEST(firmware_that_changes_during_a_restore_is_refused_too),
        TEST(without_a_watchdog_io_error_holds_the_outputs_after_a_power_loss),
        TEST(without_auto_rearm_a_card_that_is_back_waits_for_ever),
        TEST(with_auto_rearm_a_bite_is_cleared_after_half_a_second_of_good_cycles),
        TEST(with_auto_rearm_a_card_comes_back_after_any_power_cut),
        TEST(a_dead_card_is_asked_for_five_cycles_every_tenth_of_a_second),
        TEST(auto_rearm_leaves_alone_what_a_person_stopped_and_other_firmware),
        TEST(a_long_power_cut_needs_io_error_and_has_bit_cleared),
        TEST(other_firmware_is_refused_and_nothing_more_is_sent),
        TEST(the_right_firmware_programmed_again_is_restored),
        TEST(conditions_of_modules_become_sentences),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
