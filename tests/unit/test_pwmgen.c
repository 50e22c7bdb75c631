/* SPDX-License-Identifier: GPL-2.0-or-later */
/* PWM generators: frequencies, values, modes, and what the recorded firmware makes of them (tests/data/pwmgen). */
#include "pwmgen.h"

#include <math.h>

#include "idrom_files.h"
#include "module_rig.h"
#include "module_types.h"
#include "unit.h"

enum { VALUE = 0x4100, MODE = 0x4200, PWM_RATE = 0x4300, PDM_RATE = 0x4400, ENABLE = 0x4500 };

#define CLOCK_HIGH_HZ 200000000u

static struct module_rig *open_rig(const struct hm2_image *const image)
{
    struct module_rig *const rig = rig_new(image, "");
    (void)rig_add(rig, &hm2_pwmgen_type);
    rig_start(rig);
    return rig;
}

static const struct hm2_image *image_with_dither(void)
{
    static const struct rig_md modules[] = {
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
        {HM2_GTAG_PWMGEN, 1, 2, 2, VALUE, 5, 0x00, 3},
    };
    return rig_image_with(modules, 2, NULL, 0);
}

static void the_defaults_are_twelve_bits_at_20_khz(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(rig_image_7i96s());
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, PWM_RATE), 0x68DB);
    assert_int_equal(rig_written(rig, PDM_RATE), 6);
    assert_int_equal(rig_written(rig, MODE), 0x23);
    assert_int_equal(rig_written(rig, ENABLE), 0);
    assert_int_equal(rig_written(rig, VALUE), 0);
    assert_int_equal(hm2_plain_count(rig->plain), 2 + 5);
    assert_false(rig_has(rig, "pwmgen.00.dither"));
    rig_free(rig);
}

static void the_finest_resolution_that_is_fast_enough_is_taken(void **state)
{
    (void)state;
    static const struct {
        uint32_t wanted_hz, used_hz, dds;
        unsigned bits;
        bool clamped;
    } cases[] = {
        {20000, 20000, 0x68DB, 12, false},
        {48828, 48828, 65535, 12, false},
        {48829, 48829, 32768, 11, false},
        {97656, 97656, 65535, 11, false},
        {195312, 195312, 65535, 10, false},
        {390619, 390619, 65534, 9, false},
        {1, 1, 1, 12, false},
        {0, 1, 1, 12, true},
        {390625, 390619, 65535, 9, true},
        {UINT32_MAX, 390619, 65535, 9, true},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct pwmgen_rate rate = pwmgen_pwm_rate(CLOCK_HIGH_HZ, cases[i].wanted_hz);
        assert_int_equal(rate.bits, cases[i].bits);
        assert_int_equal(rate.dds, cases[i].dds);
        assert_int_equal(rate.frequency_hz, cases[i].used_hz);
        assert_int_equal(rate.clamped, cases[i].clamped);
    }
    assert_int_equal(pwmgen_pwm_rate(400000000, 1).dds, 1); /* 0 would stand still */
    const struct pwmgen_rate fast = pwmgen_pdm_rate(CLOCK_HIGH_HZ, UINT32_MAX);
    assert_int_equal(fast.dds, 65535);
    assert_int_equal(fast.frequency_hz, 199996948);
    const struct pwmgen_rate slow = pwmgen_pdm_rate(CLOCK_HIGH_HZ, 0);
    assert_int_equal(slow.dds, 1);
    assert_int_equal(pwmgen_pdm_rate(CLOCK_HIGH_HZ, slow.frequency_hz).dds, 1);
    assert_false(pwmgen_pdm_rate(CLOCK_HIGH_HZ, slow.frequency_hz).clamped);
}

static void frequencies_are_clamped_in_place(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(rig_image_7i96s());
    rig_set(rig, "pwmgen.pwm_frequency", 1e6);
    rig_set(rig, "pwmgen.pdm_frequency", 1e9);
    rig_cycle(rig);
    assert_int_equal(rig_get(rig, "pwmgen.pwm_frequency"), 390619);
    assert_int_equal(rig_get(rig, "pwmgen.pdm_frequency"), 199996948);
    assert_int_equal(rig_written(rig, MODE), 0x20);
    assert_int_equal(rig->noticed[0][HM2_NOTICE_VALUE_CLAMPED], 2);
    rig_set(rig, "pwmgen.00.enable", 1);
    rig_set(rig, "pwmgen.00.value", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), 511 << 16);
    rig_free(rig);
}

static void values_are_truncated_fractions_of_full_scale(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(rig_image_7i96s());
    static const struct {
        double value, scale;
        bool offset;
        uint32_t word;
    } cases[] = {
        {0, 1, false, 0},
        {1, 1, false, 0x0FFF0000},
        {-1, 1, false, 0x8FFF0000},
        {5, 10, false, 0x07FF8000},
        {-5, 10, false, 0x87FF8000},
        {5, -10, false, 0x87FF8000},
        {49, 49, false, 0x0FFF0000}, /* 49 * (1 / 49) is less than 1 */
        {1e9, 1, false, 0x0FFF0000},
        {0, 1, true, 0x08000000},
        {1, 1, true, 0x0FFF0000},
        {-1, 1, true, 0x80010000},
        {0.5, 1, true, 0x0BFF8000},
    };
    rig_set(rig, "pwmgen.00.enable", 1);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rig_set(rig, "pwmgen.00.value", cases[i].value);
        rig_set(rig, "pwmgen.00.scale", cases[i].scale);
        rig_set(rig, "pwmgen.00.offset-mode", cases[i].offset);
        rig_cycles(rig, PWMGEN_LOOKS);
        assert_int_equal(rig_written(rig, VALUE), cases[i].word);
    }
    rig_set(rig, "pwmgen.00.enable", 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), 0x08000000);
    rig_set(rig, "pwmgen.00.offset-mode", 0);
    rig_cycles(rig, PWMGEN_LOOKS);
    assert_int_equal(rig_written(rig, VALUE), 0);
    rig_free(rig);
}

static void output_types_become_mode_bits(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(rig_image_7i93());
    static const struct {
        int type;
        uint32_t mode;
    } cases[] = {{2, 0x33}, {3, 0x1B}, {4, 0x2B}, {1, 0x23}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rig_set(rig, "pwmgen.05.output-type", cases[i].type);
        rig_cycles(rig, PWMGEN_LOOKS);
        assert_int_equal(rig_written(rig, MODE + 20), cases[i].mode);
        assert_int_equal(rig_written(rig, MODE), 0x23);
    }
    static const int wrong[] = {0, 5, -1, INT32_MAX, INT32_MIN};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        rig_set(rig, "pwmgen.05.output-type", wrong[i]);
        rig_cycles(rig, PWMGEN_LOOKS);
        assert_int_equal(rig_get(rig, "pwmgen.05.output-type"), 1);
        assert_int_equal(rig_written(rig, MODE + 20), 0x23);
    }
    rig_free(rig);
}

static void pdm_always_has_twelve_bits(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(rig_image_7i96s());
    rig_set(rig, "pwmgen.pwm_frequency", 300000);
    rig_set(rig, "pwmgen.00.output-type", 3);
    rig_set(rig, "pwmgen.00.enable", 1);
    rig_set(rig, "pwmgen.00.value", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), 0x0FFF0000);
    rig_set(rig, "pwmgen.00.output-type", 1);
    rig_cycles(rig, PWMGEN_LOOKS);
    assert_int_equal(rig_written(rig, VALUE), 0x01FF0000);
    rig_free(rig);
}

static void enables_are_one_bit_each(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(rig_image_7i93());
    rig_set(rig, "pwmgen.00.enable", 1);
    rig_set(rig, "pwmgen.07.enable", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, ENABLE), 0x81);
    rig_set(rig, "pwmgen.00.enable", 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, ENABLE), 0x80);
    rig_cycles(rig, 2);
    assert_false(rig_wrote(rig, ENABLE));
    rig_free(rig);
}

static void dithering_exists_on_firmware_that_can(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(image_with_dither());
    rig_set(rig, "pwmgen.01.dither", 1);
    rig_set(rig, "pwmgen.01.enable", 1);
    rig_set(rig, "pwmgen.01.value", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, MODE + 4), 0x63);
    assert_int_equal(rig_written(rig, VALUE + 4), 0x0FFEF000); /* 4096 - 1.0625 */
    rig_set(rig, "pwmgen.01.offset-mode", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE + 4), 0x0FFEF000);
    rig_free(rig);
}

static void impossible_numbers_give_no_output(void **state)
{
    (void)state;
    static const double evil[] = {NAN, INFINITY, -INFINITY};
    struct module_rig *const rig = open_rig(rig_image_7i96s());
    rig_set(rig, "pwmgen.00.enable", 1);
    for (size_t i = 0; i < sizeof evil / sizeof evil[0]; i++) {
        rig_set(rig, "pwmgen.00.value", evil[i]);
        rig_cycle(rig);
        assert_int_equal(rig_written(rig, VALUE), 0);
    }
    assert_int_equal(rig->noticed[0][HM2_NOTICE_VALUE_INVALID], 3);
    rig_set(rig, "pwmgen.00.value", 0.5);
    for (size_t i = 0; i < sizeof evil / sizeof evil[0]; i++) {
        rig_set(rig, "pwmgen.00.scale", evil[i]);
        rig_cycle(rig);
        assert_true(rig_get(rig, "pwmgen.00.scale") == 1.0);
        assert_int_equal(rig_written(rig, VALUE), 0x07FF8000);
    }
    rig_set(rig, "pwmgen.00.scale", 0);
    rig_cycle(rig);
    assert_true(rig_get(rig, "pwmgen.00.scale") == 1.0);
    rig_set(rig, "pwmgen.00.scale", -4.9e-324);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), 0x8FFF0000);
    rig_free(rig);
}

static void values_change_at_once_and_what_is_unusable_is_told_in_every_cycle(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(rig_image_7i96s());
    rig_set(rig, "pwmgen.00.value", 0.5);
    rig_cycles(rig, 3);
    assert_int_equal(rig_written(rig, VALUE), 0);
    rig_set(rig, "pwmgen.00.enable", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), 0x07FF8000);
    rig_cycles(rig, 3);
    rig_set(rig, "pwmgen.00.scale", 2);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), 0x03FFC000);
    rig_set(rig, "pwmgen.00.value", 2);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), 0x0FFF0000);
    rig_set(rig, "pwmgen.00.enable", 0);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), 0);
    rig_set(rig, "pwmgen.00.enable", 1);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, VALUE), 0x0FFF0000);
    rig_set(rig, "pwmgen.00.value", INFINITY);
    rig_cycles(rig, 3);
    assert_int_equal(rig_written(rig, VALUE), 0);
    assert_int_equal(rig->noticed[0][HM2_NOTICE_VALUE_INVALID], 3);
    rig_free(rig);
}

static void outputs_are_named_as_in_aliases(void **state)
{
    (void)state;
    const char *(*const name)(const struct hm2_pd *) = hm2_pwmgen_type.output_name;
    assert_string_equal(name(&(struct hm2_pd){.secondary_pin = 0x81}), "out0");
    assert_string_equal(name(&(struct hm2_pd){.secondary_pin = 0x82}), "out1");
    assert_string_equal(name(&(struct hm2_pd){.secondary_pin = 0x83}), "enable");
    assert_null(name(&(struct hm2_pd){.secondary_pin = 0x84}));
    assert_null(name(&(struct hm2_pd){.secondary_pin = 0x01}));
}

static void everything_is_sent_again_after_a_loss_of_power(void **state)
{
    (void)state;
    struct module_rig *const rig = open_rig(rig_image_7i96s());
    rig_set(rig, "pwmgen.00.enable", 1);
    rig_set(rig, "pwmgen.00.output-type", 2);
    rig_cycles(rig, 3);
    memset(rig->written, 0, sizeof rig->written);
    hm2_plan_touch_all(rig->plan);
    rig_cycle(rig);
    assert_int_equal(rig_written(rig, MODE), 0x33);
    assert_int_equal(rig_written(rig, ENABLE), 1);
    assert_int_equal(rig_written(rig, PWM_RATE), 0x68DB);
    assert_int_equal(rig_written(rig, PDM_RATE), 6);
    rig_free(rig);
}

/* ---- recorded firmware --------------------------------------------------------------------------------------------
 */

struct measured {
    char kind[16], state_a[16], state_b[16];
    unsigned mode, bits, symmetric, outmode, value, pwmrate, pdmrate, period_a, high_a, period_b, high_b;
};

/* A row of measure.csv; empty fields are 0, of several values the first is taken. */
static void parse_row(char *row, struct measured *const m)
{
    char *field[16] = {0};
    for (unsigned f = 0; f < 16 && row; f++)
        field[f] = strsep(&row, ",");
    assert_non_null(field[15]);
    *m = (struct measured){
        .mode = (unsigned)strtoul(field[1], NULL, 16),
        .bits = (unsigned)strtoul(field[2], NULL, 10),
        .symmetric = (unsigned)strtoul(field[3], NULL, 10),
        .outmode = (unsigned)strtoul(field[4], NULL, 10),
        .value = (unsigned)strtoul(field[5], NULL, 16),
        .pwmrate = (unsigned)strtoul(field[6], NULL, 16),
        .pdmrate = (unsigned)strtoul(field[7], NULL, 16),
        .period_a = (unsigned)strtoul(field[9], NULL, 10),
        .high_a = (unsigned)strtoul(field[10], NULL, 10),
        .period_b = (unsigned)strtoul(field[13], NULL, 10),
        .high_b = (unsigned)strtoul(field[14], NULL, 10),
    };
    (void)snprintf(m->kind, sizeof m->kind, "%s", field[0]);
    (void)snprintf(m->state_a, sizeof m->state_a, "%s", field[8]);
    (void)snprintf(m->state_b, sizeof m->state_b, "%s", field[12]);
}

/* Ask the driver for what the row shows: the duty that its value register stands for. */
static void command(struct module_rig *const rig, const struct measured *const m)
{
    static const int types[] = {1, 4, 2, 3};
    const double full = (double)((1u << m->bits) - 1);
    const double counts = (double)(m->value >> 16 & 0xFFFu);
    rig_set(rig, "pwmgen.00.output-type", types[m->outmode]);
    /* The highest frequency of the row's width; rate FFFF is as near as nothing to every clock. */
    rig_set(rig, "pwmgen.pwm_frequency", CLOCK_HIGH_HZ / (double)(1u << m->bits));
    rig_set(rig, "pwmgen.00.scale", full);
    rig_set(rig, "pwmgen.00.value", m->value >> 31 ? -counts : counts);
    rig_cycles(rig, PWMGEN_LOOKS);
}

/* Hand every measurement to check(), which returns true when it could be compared; returns how many were. */
static unsigned compare_rows(bool (*const check)(struct module_rig *rig, const struct measured *m))
{
    size_t len;
    char *const text = load_text(TEST_DATA "/pwmgen/measure.csv", &len);
    struct module_rig *const rig = open_rig(rig_image_7i96s());
    unsigned rows = 0;
    char *rest = text;
    (void)strsep(&rest, "\n");
    rig_set(rig, "pwmgen.00.enable", 1);
    for (char *row; (row = strsep(&rest, "\n")) && *row;) {
        struct measured m;
        parse_row(row, &m);
        rows += check(rig, &m);
    }
    free(text);
    rig_free(rig);
    return rows;
}

static bool check_pwm(struct module_rig *const rig, const struct measured *const m)
{
    const unsigned counts = m->value >> 16 & 0xFFF;
    const bool is_pwm = strcmp(m->kind, "pwm") == 0 || strcmp(m->kind, "outmode") == 0;
    if (!is_pwm || m->symmetric || counts >= 1u << m->bits || (counts == 0 && m->value >> 31))
        return false;
    command(rig, m);
    assert_int_equal(rig_written(rig, VALUE), m->value);
    assert_int_equal(rig_written(rig, MODE), m->mode | 0x20); /* we add double buffering */
    /* What we asked for is what came out: high time over period, and the period of the frequency. */
    const bool on_b = strcmp(m->state_b, "pulses") == 0;
    assert_int_equal(counts > 0, on_b || strcmp(m->state_a, "pulses") == 0);
    if (counts > 0) {
        const double hz = rig_get(rig, "pwmgen.pwm_frequency");
        assert_int_equal(on_b ? m->high_b : m->high_a, counts);
        assert_true(fabs(CLOCK_HIGH_HZ / hz - (on_b ? m->period_b : m->period_a)) < 1.5);
    }
    return true;
}

static bool check_pdm(struct module_rig *const rig, const struct measured *const m)
{
    if (strcmp(m->kind, "pdm") != 0)
        return false;
    rig_set(rig, "pwmgen.pdm_frequency", floor(CLOCK_HIGH_HZ * (m->pdmrate + 0.5) / 65536.0));
    command(rig, m);
    assert_int_equal(rig_written(rig, VALUE), m->value);
    assert_int_equal(rig_written(rig, MODE), m->mode);
    assert_int_equal(rig_written(rig, PDM_RATE), m->pdmrate);
    return true;
}

static void duties_and_periods_are_those_that_the_firmware_makes(void **state)
{
    (void)state;
    assert_true(compare_rows(check_pwm) >= 30);
}

static void densities_are_those_that_the_firmware_makes(void **state)
{
    (void)state;
    assert_true(compare_rows(check_pdm) >= 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_defaults_are_twelve_bits_at_20_khz),
        cmocka_unit_test(the_finest_resolution_that_is_fast_enough_is_taken),
        cmocka_unit_test(frequencies_are_clamped_in_place),
        cmocka_unit_test(values_are_truncated_fractions_of_full_scale),
        cmocka_unit_test(output_types_become_mode_bits),
        cmocka_unit_test(pdm_always_has_twelve_bits),
        cmocka_unit_test(enables_are_one_bit_each),
        cmocka_unit_test(dithering_exists_on_firmware_that_can),
        cmocka_unit_test(impossible_numbers_give_no_output),
        cmocka_unit_test(values_change_at_once_and_what_is_unusable_is_told_in_every_cycle),
        cmocka_unit_test(outputs_are_named_as_in_aliases),
        cmocka_unit_test(everything_is_sent_again_after_a_loss_of_power),
        cmocka_unit_test(duties_and_periods_are_those_that_the_firmware_makes),
        cmocka_unit_test(densities_are_those_that_the_firmware_makes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
