/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "idrom_files.h"
#include "module_rig.h"
#include "module_types.h"
#include "random.h"

#define DATA(port)       (uint16_t)(0x1000 + 4 * (port))
#define DIRECTION(port)  (uint16_t)(0x1100 + 4 * (port))
#define ALT_SOURCE(port) (uint16_t)(0x1200 + 4 * (port))
#define OPEN_DRAIN(port) (uint16_t)(0x1300 + 4 * (port))
#define INVERT(port)     (uint16_t)(0x1400 + 4 * (port))

/* Cycles in which every level is written once, and every parameter looked at: at 3 ports of 17 bits, one a cycle. */
#define ALL_TURNS 51u

/* A module that owns pins like a real one, with or without names. */
static int claim_deferred(struct hm2_module *module, struct hm2_setup *setup)
{
    return hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, false, NULL);
}

static int claim_immediate(struct hm2_module *module, struct hm2_setup *setup)
{
    return hm2_claim_pins(module, setup, HM2_GTAG_NONE, module->instances, true, NULL);
}

static const char *step_name(const struct hm2_pd *pd)
{
    return pd->secondary_pin == 0x81 ? "step" : pd->secondary_pin == 0x82 ? "direction" : NULL;
}

static const struct hm2_module_type stepgen_pins = {
    .name = "stepgen",
    .gtag = HM2_GTAG_STEPGEN,
    .config_count = HM2_CFG_STEPGENS,
    .setup = claim_deferred,
    .output_name = step_name,
};
static const struct hm2_module_type inm_pins = {
    .name = "inm", .gtag = HM2_GTAG_INM, .config_count = HM2_CFG_INMS, .setup = claim_immediate};
static const struct hm2_module_type sserial_pins = {
    .name = "sserial", .gtag = HM2_GTAG_SSERIAL, .config_count = -1, .setup = claim_immediate};

/* A 7I96S with inputs, step generators and (immediate) smart serial in use; the other modules' pins are GPIO. */
static struct module_rig *started(const char *config)
{
    struct module_rig *const rig = rig_new(rig_image_7i96s(), config);
    (void)rig_add(rig, &stepgen_pins);
    (void)rig_add(rig, &inm_pins);
    (void)rig_add(rig, &sserial_pins);
    (void)rig_add(rig, &hm2_ioport_type);
    rig_start(rig);
    return rig;
}

static void which_points_a_pin_has_follows_from_its_owner(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    for (unsigned io = 0; io < 51; io++) {
        const bool input = io < 11 || io == 30;
        const bool module_output = (io >= 17 && io <= 26) || io == 31 || io == 32;
        const struct {
            const char *suffix;
            bool exists;
        } rows[] = {
            {"in", true},
            {"in_not", true},
            {"out", !input && !module_output},
            {"is_output", !input && !module_output},
            {"invert_output", !input},
            {"is_opendrain", !input},
        };
        for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
            char name[64];
            (void)snprintf(name, sizeof name, "gpio.%03u.%s", io, rows[i].suffix);
            if (rig_has(rig, name) != rows[i].exists)
                fail_msg("%s: exists %d, expected %d", name, rig_has(rig, name), rows[i].exists);
        }
    }
    rig_free(rig);
}

static void levels_of_the_pads_show_in_the_same_cycle_with_their_inverse(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    static const uint32_t levels[][3] = {
        {0, 0, 0}, {0x1FFFF, 0x1FFFF, 0x1FFFF}, {0x10001, 0x0A5A5, 0x15A5A}, {1, 2, 4}};
    for (size_t i = 0; i < sizeof levels / sizeof levels[0]; i++) {
        for (unsigned port = 0; port < 3; port++)
            rig_put(rig, DATA(port), levels[i][port] | 0xFFFE0000u);
        rig_read(rig);
        for (unsigned io = 0; io < 51; io++) {
            char name[64];
            const double expected = levels[i][io / 17] >> io % 17 & 1u;
            (void)snprintf(name, sizeof name, "gpio.%03u.in", io);
            assert_true(rig_get(rig, name) == expected);
            (void)snprintf(name, sizeof name, "gpio.%03u.in_not", io);
            assert_true(rig_get(rig, name) == 1.0 - expected);
        }
    }
    rig_free(rig);
}

static void a_pin_that_never_changes_is_still_written_now_and_then(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_put(rig, DATA(2), 1u << 16);
    rig_cycle(rig);
    rig_set(rig, "gpio.050.in", 0); /* as a host does that links the pin to a fresh signal */
    rig_cycles(rig, ALL_TURNS);
    assert_true(rig_get(rig, "gpio.050.in") == 1.0);
    rig_free(rig);
}

static void pins_linked_before_the_first_cycle_show_their_levels_at_once(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    (void)rig_add(rig, &hm2_ioport_type);
    for (unsigned port = 0; port < 3; port++)
        rig_put(rig, DATA(port), 0x1FFFF);
    rig_start(rig);
    for (unsigned io = 0; io < 51; io++) {
        char name[64];
        (void)snprintf(name, sizeof name, "gpio.%03u.in", io);
        assert_true(rig_get(rig, name) == 1.0);
        rig_set(rig, name, 0);
    }
    rig_read(rig);
    for (unsigned io = 0; io < 51; io++) {
        char name[64];
        (void)snprintf(name, sizeof name, "gpio.%03u.in", io);
        assert_true(rig_get(rig, name) == 1.0);
    }
    rig_free(rig);
}

static void module_pins_have_their_source_from_load_on_and_gpio_never(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    assert_int_equal(rig_written(rig, ALT_SOURCE(0)), 0x007FF);
    assert_int_equal(rig_written(rig, ALT_SOURCE(1)), 0x003FF | 0x0E000);
    assert_int_equal(rig_written(rig, ALT_SOURCE(2)), 0);
    rig_free(rig);
}

static void immediate_outputs_drive_from_load_on_and_deferred_ones_from_the_first_write_on(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    assert_int_equal(rig_written(rig, DIRECTION(0)), 0);
    assert_int_equal(rig_written(rig, DIRECTION(1)), 0x0C000);
    assert_int_equal(rig_written(rig, DIRECTION(2)), 0);
    rig_set(rig, "gpio.034.is_output", 1);
    rig_read(rig);
    assert_int_equal(rig_written(rig, DIRECTION(1)), 0x0C000);
    rig_write_out(rig);
    assert_int_equal(rig_written(rig, DIRECTION(0)), 0);
    assert_int_equal(rig_written(rig, DIRECTION(1)), 0x0C3FF);
    assert_int_equal(rig_written(rig, DIRECTION(2)), 0x00001);
    rig_free(rig);
}

static void polarity_set_before_the_first_write_reaches_the_card_before_the_direction(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_set(rig, "gpio.017.invert_output", 1);
    rig_set(rig, "gpio.018.is_opendrain", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, INVERT(1)), 0x00001);
    assert_int_equal(rig_written(rig, OPEN_DRAIN(1)), 0x00002);
    assert_true(rig_position(rig, INVERT(1)) >= 0);
    assert_true(rig_position(rig, INVERT(1)) < rig_position(rig, OPEN_DRAIN(1)));
    assert_true(rig_position(rig, OPEN_DRAIN(1)) < rig_position(rig, DIRECTION(0)));
    assert_true(rig_position(rig, DATA(0)) < rig_position(rig, INVERT(0)));
    rig_free(rig);
}

static void outputs_follow_their_pins_in_every_cycle(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    static const char *const outputs[] = {"gpio.011", "gpio.016", "gpio.033", "gpio.050"};
    for (size_t i = 0; i < sizeof outputs / sizeof outputs[0]; i++) {
        char name[32];
        (void)snprintf(name, sizeof name, "%s.is_output", outputs[i]);
        rig_set(rig, name, 1);
        (void)snprintf(name, sizeof name, "%s.out", outputs[i]);
        rig_set(rig, name, 1);
    }
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 1u << 11 | 1u << 16);
    assert_int_equal(rig_written(rig, DATA(1)), 1u << 16);
    assert_int_equal(rig_written(rig, DATA(2)), 1u << 16);
    rig_set(rig, "gpio.016.out", 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(0)), 1u << 11);
    rig_free(rig);
}

static void a_pin_that_becomes_an_output_drives_its_value_from_the_same_write_on(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_set(rig, "gpio.040.out", 1);
    rig_cycles(rig, ALL_TURNS);
    rig_set(rig, "gpio.040.is_output", 1);
    unsigned cycles = 0;
    for (; cycles < ALL_TURNS && !(rig_written(rig, DIRECTION(2)) & 1u << 6); cycles++)
        rig_cycle(rig);
    assert_true(cycles < ALL_TURNS);
    assert_int_equal(rig_written(rig, DATA(2)), 1u << 6);
    assert_true(rig_position(rig, DATA(2)) < rig_position(rig, DIRECTION(2)));
    /* and follows its pin as long as the card may still drive it */
    rig_set(rig, "gpio.040.is_output", 0);
    rig_set(rig, "gpio.040.out", 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DATA(2)), 0);
    rig_free(rig);
}

static void changed_parameters_are_sent_within_the_turns_and_only_then(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_cycles(rig, 2 * ALL_TURNS);
    assert_false(rig_wrote(rig, DIRECTION(0)));
    for (unsigned io = 34; io < 51; io++) {
        char name[64];
        (void)snprintf(name, sizeof name, "gpio.%03u.is_output", io);
        rig_set(rig, name, 1);
    }
    rig_cycles(rig, ALL_TURNS);
    assert_int_equal(rig_written(rig, DIRECTION(2)), 0x1FFFF);
    rig_cycles(rig, ALL_TURNS);
    assert_false(rig_wrote(rig, DIRECTION(2)));
    rig_free(rig);
}

static void an_input_never_has_open_drain_because_that_drives(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_set(rig, "gpio.040.is_opendrain", 1);
    rig_cycles(rig, ALL_TURNS);
    assert_int_equal(rig_written(rig, OPEN_DRAIN(2)), 0);
    rig_set(rig, "gpio.040.is_output", 1);
    rig_cycles(rig, ALL_TURNS);
    assert_int_equal(rig_written(rig, OPEN_DRAIN(2)), 1u << 6);
    rig_set(rig, "gpio.040.is_output", 0);
    rig_cycles(rig, ALL_TURNS);
    assert_int_equal(rig_written(rig, OPEN_DRAIN(2)), 0);
    assert_int_equal(rig_written(rig, DIRECTION(2)), 0);
    rig_free(rig);
}

static void a_bite_keeps_directions_off_until_it_is_acknowledged(void **state)
{
    (void)state;
    struct module_rig *const rig = started("");
    rig_set(rig, "gpio.034.is_output", 1);
    rig_set(rig, "gpio.035.is_output", 1);
    rig_set(rig, "gpio.035.is_opendrain", 1);
    rig_cycles(rig, ALL_TURNS);
    assert_int_equal(rig_written(rig, DIRECTION(2)), 3);
    rig->cycle.bitten = true;
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DIRECTION(1)), 0);
    assert_int_equal(rig_written(rig, DIRECTION(2)), 0);
    assert_int_equal(rig_written(rig, OPEN_DRAIN(2)), 0);
    rig_set(rig, "gpio.036.is_output", 1);
    rig_cycles(rig, ALL_TURNS);
    assert_int_equal(rig_written(rig, DIRECTION(2)), 0);
    rig->cycle.bitten = false;
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, DIRECTION(1)), 0x0C3FF);
    assert_int_equal(rig_written(rig, DIRECTION(2)), 7);
    assert_int_equal(rig_written(rig, OPEN_DRAIN(2)), 2);
    rig_free(rig);
}

static void outputs_of_named_functions_get_second_names(void **state)
{
    (void)state;
    struct module_rig *const rig = started("num_stepgens=2");
    static const char *const pairs[][2] = {
        {"stepgen.00.step.invert_output", "gpio.017.invert_output"},
        {"stepgen.00.step.is_opendrain", "gpio.017.is_opendrain"},
        {"stepgen.00.direction.invert_output", "gpio.018.invert_output"},
        {"stepgen.01.direction.is_opendrain", "gpio.020.is_opendrain"},
    };
    for (size_t i = 0; i < sizeof pairs / sizeof pairs[0]; i++) {
        assert_true(rig_has(rig, pairs[i][0]));
        assert_ptr_equal(rig_object(rig, pairs[i][0]), rig_object(rig, pairs[i][1]));
    }
    /* no name without the module's help, none for pins that are GPIO again */
    assert_false(rig_has(rig, "stepgen.02.step.invert_output"));
    assert_true(rig_has(rig, "gpio.021.is_output"));
    unsigned aliases = 0;
    for (size_t i = 0; i < hm2_plain_count(rig->plain); i++)
        aliases += hm2_plain_at(rig->plain, i)->alias != NULL;
    assert_int_equal(aliases, 8);
    rig_free(rig);
}

static void a_function_on_several_pins_gets_numbered_second_names(void **state)
{
    (void)state;
    static const struct rig_md modules[] = {
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
        {HM2_GTAG_STEPGEN, 2, 1, 2, 0x2000, 10, 0x00, 0x1FF},
    };
    static const uint32_t pins[] = {0x03000581, 0x03000582, 0x03010581, 0x03000581, 0x03000581};
    struct module_rig *const rig = rig_new(rig_image_with(modules, 2, pins, 5), "");
    (void)rig_add(rig, &stepgen_pins);
    (void)rig_add(rig, &hm2_ioport_type);
    assert_ptr_equal(rig_object(rig, "stepgen.00.0.step.invert_output"), rig_object(rig, "gpio.000.invert_output"));
    assert_ptr_equal(rig_object(rig, "stepgen.00.1.step.invert_output"), rig_object(rig, "gpio.003.invert_output"));
    assert_ptr_equal(rig_object(rig, "stepgen.00.2.step.is_opendrain"), rig_object(rig, "gpio.004.is_opendrain"));
    assert_non_null(rig_object(rig, "stepgen.00.direction.invert_output"));
    assert_non_null(rig_object(rig, "stepgen.01.step.invert_output"));
    assert_null(rig_object(rig, "stepgen.00.step.invert_output"));
    rig_free(rig);
}

static void an_alias_that_is_taken_is_a_warning_only(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    static const struct hm2_point taken[] = {{.name = "step.invert_output", .type = HM2_BIT, .dir = HM2_PARAM_RW}};
    void **const slot = rig->setup.binder->alloc(rig->setup.binder, sizeof *slot);
    assert_int_equal(hm2_bind_points(rig->setup.binder, taken, 1, slot, RIG_PREFIX ".stepgen.00", 0, &rig->diag), 0);
    (void)rig_add(rig, &stepgen_pins);
    (void)rig_add(rig, &hm2_ioport_type);
    assert_int_equal(rig->diag.warnings, 1);
    assert_non_null(strstr(rig->diag.text, "hm2_rig.0.gpio.017.invert_output gets no second name"));
    assert_true(rig_has(rig, "gpio.017.invert_output"));
    rig_free(rig);
}

static void a_pin_of_two_modules_is_refused_with_both_names(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    (void)rig_add(rig, &stepgen_pins);
    assert_int_equal(rig_try_add(rig, &stepgen_pins), HM2_ERR_MISMATCH);
    assert_int_equal(rig->diag.problems, 10);
    assert_non_null(strstr(rig->diag.text, "I/O 17 is claimed by stepgen and by stepgen"));
    rig_free(rig);
}

/* For every combination of a pin's settings: what the registers we write make of the pad, by the recorded truth table,
 * is what the settings promise. */
static void settings_and_the_recorded_truth_table_agree(void **state)
{
    (void)state;
    size_t len;
    char *const table = load_text(TEST_DATA "/ioport/truth.csv", &len);
    struct module_rig *const rig = started("");
    unsigned rows = 0;
    for (unsigned combination = 0; combination < 16; combination++) {
        const unsigned output = combination & 1u, out = combination >> 1 & 1u, invert = combination >> 2 & 1u,
                       open_drain = combination >> 3 & 1u;
        rig_set(rig, "gpio.045.is_output", output);
        rig_set(rig, "gpio.045.out", out);
        rig_set(rig, "gpio.045.invert_output", invert);
        rig_set(rig, "gpio.045.is_opendrain", open_drain);
        rig_cycles(rig, ALL_TURNS);
        const unsigned bit = 45 - 34;
        char pattern[32];
        /* altdata does not matter: the row with 0 */
        (void)snprintf(pattern, sizeof pattern, "\n0,%u,%u,%u,%u,%u,", rig_written(rig, ALT_SOURCE(2)) >> bit & 1u,
                       rig_written(rig, INVERT(2)) >> bit & 1u, rig_written(rig, OPEN_DRAIN(2)) >> bit & 1u,
                       rig_written(rig, DIRECTION(2)) >> bit & 1u, rig_written(rig, DATA(2)) >> bit & 1u);
        const char *const row = strstr(table, pattern);
        assert_non_null(row);
        const char pad = row[strlen(pattern)];
        const unsigned driven = out ^ invert;
        const char expected = !output || (open_drain && driven) ? 'H' : driven ? '1' : '0';
        if (pad != expected)
            fail_msg("is_output %u out %u invert %u open drain %u: pad %c, expected %c", output, out, invert,
                     open_drain, pad, expected);
        rows++;
    }
    assert_int_equal(rows, 16);
    rig_free(rig);
    free(table);
}

/* The settings of all free pins at random, on the simulated card: pads and levels are what the settings promise. */
static void pads_of_the_simulated_card_are_what_the_settings_promise(void **state)
{
    (void)state;
    static const char *const settings[4] = {"is_output", "out", "invert_output", "is_opendrain"};
    const struct sim_card_options options = {.profile = "7i96s", .seed = 1};
    struct sim_card *card;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    struct random random = {.state = 7};
    assert_int_equal(sim_card_new(&card, &options, &rig->diag), 0);
    rig->card = card;
    (void)rig_add(rig, &hm2_ioport_type);
    rig_start(rig);
    for (unsigned round = 0; round < 50; round++) {
        unsigned chosen[51];
        for (unsigned io = 0; io < 51; io++) {
            chosen[io] = random_below(&random, 16);
            for (unsigned i = 0; i < 4; i++) {
                char name[64];
                (void)snprintf(name, sizeof name, "gpio.%03u.%s", io, settings[i]);
                rig_set(rig, name, chosen[io] >> i & 1u);
            }
        }
        rig_cycles(rig, ALL_TURNS + 1);
        for (unsigned io = 0; io < 51; io++) {
            const unsigned output = chosen[io] & 1u, driven = (chosen[io] >> 1 ^ chosen[io] >> 2) & 1u,
                           released = !output || ((chosen[io] >> 3 & 1u) && driven);
            char name[64];
            (void)snprintf(name, sizeof name, "gpio.%03u.in", io);
            const enum sim_level expected = released ? SIM_FLOAT : driven ? SIM_HIGH : SIM_LOW;
            if (sim_card_pad(card, io) != expected)
                fail_msg("round %u, I/O %u: pad %d, expected %d", round, io, (int)sim_card_pad(card, io),
                         (int)expected);
            assert_true(rig_get(rig, name) == (released || driven ? 1.0 : 0.0));
        }
    }
    rig_free(rig);
    sim_card_free(card);
}

static void ports_that_contradict_the_header_are_refused(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "");
    rig->idrom.io_ports = 4; /* fewer than the module has would be those that are used */
    assert_int_equal(rig_try_add(rig, &hm2_ioport_type), HM2_ERR_MISMATCH);
    assert_non_null(strstr(rig->diag.text, "3 instances"));
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(which_points_a_pin_has_follows_from_its_owner),
        cmocka_unit_test(levels_of_the_pads_show_in_the_same_cycle_with_their_inverse),
        cmocka_unit_test(a_pin_that_never_changes_is_still_written_now_and_then),
        cmocka_unit_test(pins_linked_before_the_first_cycle_show_their_levels_at_once),
        cmocka_unit_test(module_pins_have_their_source_from_load_on_and_gpio_never),
        cmocka_unit_test(immediate_outputs_drive_from_load_on_and_deferred_ones_from_the_first_write_on),
        cmocka_unit_test(polarity_set_before_the_first_write_reaches_the_card_before_the_direction),
        cmocka_unit_test(outputs_follow_their_pins_in_every_cycle),
        cmocka_unit_test(a_pin_that_becomes_an_output_drives_its_value_from_the_same_write_on),
        cmocka_unit_test(changed_parameters_are_sent_within_the_turns_and_only_then),
        cmocka_unit_test(an_input_never_has_open_drain_because_that_drives),
        cmocka_unit_test(a_bite_keeps_directions_off_until_it_is_acknowledged),
        cmocka_unit_test(outputs_of_named_functions_get_second_names),
        cmocka_unit_test(a_function_on_several_pins_gets_numbered_second_names),
        cmocka_unit_test(an_alias_that_is_taken_is_a_warning_only),
        cmocka_unit_test(a_pin_of_two_modules_is_refused_with_both_names),
        cmocka_unit_test(settings_and_the_recorded_truth_table_agree),
        cmocka_unit_test(pads_of_the_simulated_card_are_what_the_settings_promise),
        cmocka_unit_test(ports_that_contradict_the_header_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
