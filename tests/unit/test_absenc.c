/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Absolute encoders: SSI, BISS, Fanuc. */
#include "unit.h"

#include <math.h>

#include "absenc_format.h"
#include "module_rig.h"
#include "module_types.h"
#include "replay.h"
#include "trace_file.h"

/* Registers in the firmware of the traces. */
enum {
    SSI_DATA0 = 0x6800,
    SSI_CONTROL = 0x6A00,
    SSI_BUSY = 0x6B00,
    BISS_DATA = 0x4900,
    BISS_CONTROL0 = 0x4A00,
    BISS_CONTROL1 = 0x4B00,
    BISS_BUSY = 0x4C00,
    FABS_DATA0 = 0x1500,
    FABS_CONTROL0 = 0x1800,
    FABS_BUSY = 0x1A00,
};

static struct module_rig *new_rig(const char *const firmware, const char *const config)
{
    struct hm2_image image;
    assert_true(replay_firmware(firmware, &image));
    return rig_new(&image, config);
}

static struct module_rig *started(const char *const firmware, const char *const config,
                                  const struct hm2_module_type *const type)
{
    struct module_rig *const rig = new_rig(firmware, config);
    (void)rig_add(rig, type);
    rig_start(rig);
    return rig;
}

/* With a simulated card behind it. */
static struct module_rig *with_card(const char *const firmware, const char *const config,
                                    const struct hm2_module_type *const type, const enum sim_sources sources)
{
    struct hm2_image image;
    assert_true(replay_firmware(firmware, &image));
    struct module_rig *const rig = new_rig(firmware, config);
    const struct sim_card_options options = {.profile = "7i93", .image = &image, .sources = sources};
    assert_int_equal(sim_card_new(&rig->card, &options, NULL), 0);
    rig->clk = 1000;
    rig->read_clk = 20;
    (void)rig_add(rig, type);
    rig_start(rig);
    return rig;
}

static void free_with_card(struct module_rig *const rig)
{
    sim_card_free(rig->card);
    rig_free(rig);
}

static void attach(const struct module_rig *const rig, const uint8_t gtag, const unsigned unit,
                   const struct sim_absolute *const encoder)
{
    assert_int_equal(sim_card_absolute(rig->card, gtag, unit, encoder), 0);
}

/* ---- formats ------------------------------------------------------------------------------------------------------
 */

static void formats_are_counted_and_broken_ones_refused(void **state)
{
    (void)state;
    assert_int_equal(hm2_absenc_format_bits("error%1bposition%24g"), 0); /* a type is missing */
    assert_int_equal(hm2_absenc_format_bits("error%1bposition%24gu"), 25);
    assert_int_equal(hm2_absenc_format_bits("a%32Ub%32Sc%32F"), 96);
    assert_int_equal(hm2_absenc_format_bits("a%32Ub%32Sc%32Fd%1b"), 0);
    assert_int_equal(hm2_absenc_format_bits("a%33u"), 0);
    assert_int_equal(hm2_absenc_format_bits("a%0u"), 0);
    assert_int_equal(hm2_absenc_format_bits("a%4294967297u"), 0);
    assert_int_equal(hm2_absenc_format_bits(""), 0);
    assert_int_equal(hm2_absenc_format_bits("a%8u "), 0);
    assert_int_equal(hm2_absenc_format_bits(hm2_absenc_expand("AA64")), 76);
    assert_int_equal(hm2_absenc_format_bits(hm2_absenc_expand("a%3u")), 3);
}

static void only_configured_channels_have_points_and_pins(void **state)
{
    (void)state;
    struct module_rig *const rig = started("SISS4_4_72", "ssi_chan_1=pos%12u", &hm2_ssi_type);
    assert_true(rig_has(rig, "ssi.01.pos"));
    assert_true(rig_has(rig, "ssi.01.pos-scalemax"));
    assert_false(rig_has(rig, "ssi.00.data-invalid"));
    for (unsigned io = 0; io < rig->idrom.pin_count; io++)
        if (rig->pins[io].pd.secondary_tag == HM2_GTAG_SSI)
            assert_int_equal(rig->pins[io].owner != NULL, rig->pins[io].pd.secondary_unit == 1);
    rig_free(rig);
    struct module_rig *const none = started("SISS4_4_72", "", &hm2_ssi_type);
    rig_cycles(none, 2);
    assert_null(none->modules[0].context);
    rig_free(none);
}

static void more_bits_than_the_module_receives_are_refused(void **state)
{
    (void)state;
    struct module_rig *rig = new_rig("SISS4_4_72", "ssi_chan_0=a%32ub%32uc%1b");
    assert_int_equal(rig_try_add(rig, &hm2_ssi_type), HM2_ERR_INVALID);
    assert_non_null(strstr(rig->diag.text, "channel 0 has 65 bits; 1 to 64 are expected"));
    rig_free(rig);
    rig = new_rig("FA1_72", "fanuc_chan_0=a%32ub%32uc%13u");
    assert_int_equal(rig_try_add(rig, &hm2_fanuc_type), HM2_ERR_INVALID);
    rig_free(rig);
}

/* ---- fields -------------------------------------------------------------------------------------------------------
 */

static void fields_are_numbers_bits_and_booleans(void **state)
{
    (void)state;
    struct module_rig *const rig =
        started("SISS4_4_72", "ssi_chan_0=err%2b%3pnum%8usig%8sbit%3fgray%4gu", &hm2_ssi_type);
    rig_put(rig, SSI_BUSY, 0);
    rig_put(rig, SSI_DATA0, 2u | 51u << 5 | 0x81u << 13 | 5u << 21 | 0xCu << 24);
    rig_set(rig, "ssi.00.num-scalemax", 20);
    rig_set(rig, "ssi.00.sig-scalemax", 10);
    rig_set(rig, "ssi.00.gray-scalemax", 15);
    rig_cycle(rig);
    assert_true(rig_get(rig, "ssi.00.err") == 1 && rig_get(rig, "ssi.00.err-not") == 0);
    assert_true(rig_get(rig, "ssi.00.num") == 4.0);
    assert_true(fabs(rig_get(rig, "ssi.00.sig") + 127.0 / 128.0 * 10.0) < 1e-6);
    assert_true(rig_get(rig, "ssi.00.bit-00") == 1 && rig_get(rig, "ssi.00.bit-00-not") == 0);
    assert_true(rig_get(rig, "ssi.00.bit-01") == 0 && rig_get(rig, "ssi.00.bit-02") == 1);
    assert_true(rig_get(rig, "ssi.00.gray") == 8.0);
    rig_set(rig, "ssi.00.num-scalemax", NAN);
    rig_cycle(rig);
    assert_true(rig_get(rig, "ssi.00.num") == 51.0 / 255.0);
    rig_free(rig);
}

static void an_encoder_counts_on_where_its_field_wraps(void **state)
{
    (void)state;
    struct module_rig *const rig = started("SISS4_4_72", "ssi_chan_0=a%8e ssi_chan_1=b%8me", &hm2_ssi_type);
    static const uint8_t readings[] = {100, 120, 140, 250, 20, 5, 240};
    static const int wrapping[] = {100, 120, 140, 250, 276, 261, 240};
    rig_put(rig, SSI_BUSY, 0);
    for (size_t i = 0; i < sizeof readings; i++) {
        rig_put(rig, SSI_DATA0, readings[i]);
        rig_put(rig, SSI_DATA0 + 4, readings[i]);
        rig_cycle(rig);
        assert_int_equal((int)rig_get(rig, "ssi.00.a.rawcounts"), wrapping[i]);
        assert_int_equal((int)rig_get(rig, "ssi.01.b.rawcounts"), (int8_t)readings[i]);
    }
    rig_set(rig, "ssi.00.a.scale", 10);
    rig_cycle(rig);
    assert_true(rig_get(rig, "ssi.00.a.position") == 24.0);
    rig_free(rig);
}

static void reset_and_index_move_the_zero(void **state)
{
    (void)state;
    struct module_rig *const rig = started("SISS4_4_72", "ssi_chan_0=a%16e", &hm2_ssi_type);
    rig_put(rig, SSI_BUSY, 0);
    rig_put(rig, SSI_DATA0, 1000);
    rig_cycle(rig);
    rig_set(rig, "ssi.00.a.reset", 1);
    rig_cycle(rig);
    assert_true(rig_get(rig, "ssi.00.a.count") == 0 && rig_get(rig, "ssi.00.a.rawcounts") == 1000);
    rig_set(rig, "ssi.00.a.reset", 0);
    rig_set(rig, "ssi.00.a.counts-per-rev", 400);
    rig_set(rig, "ssi.00.a.index-enable", 1);
    rig_put(rig, SSI_DATA0, 1150);
    rig_cycle(rig);
    assert_true(rig_get(rig, "ssi.00.a.count") == 150 && rig_get(rig, "ssi.00.a.index-enable") == 1);
    rig_put(rig, SSI_DATA0, 1210);
    rig_cycle(rig);
    assert_true(rig_get(rig, "ssi.00.a.count") == 10 && rig_get(rig, "ssi.00.a.index-enable") == 0);
    rig_set(rig, "ssi.00.a.index-enable", 1);
    rig_put(rig, SSI_DATA0, 1190);
    rig_cycle(rig);
    assert_true(rig_get(rig, "ssi.00.a.count") == -10 && rig_get(rig, "ssi.00.a.index-enable") == 0);
    rig_free(rig);
}

/* ---- against recorded data ----------------------------------------------------------------------------------------
 */

static void recorded_words_of_an_aa64_encoder_are_its_fields(void **state)
{
    (void)state;
    struct trace_file trace = trace_load("fabs");
    size_t index = 0;
    struct module_rig *const rig = started("FA1_72", "fanuc_chan_0=AA64", &hm2_fanuc_type);
    rig_put(rig, FABS_BUSY, 0);
    static const char *const names[] = {"data2", "data1", "data0"};
    static const uint16_t addresses[] = {0x1700, 0x1600, 0x1500};
    for (unsigned i = 0; i < 3; i++) {
        const struct trace_event *const event = trace_find(&trace, &index, "basic", 'R', names[i]);
        assert_non_null(event);
        rig_put(rig, addresses[i], event->value);
    }
    trace_free(&trace);
    rig_set(rig, "fanuc.00.comm-scalemax", 1023);
    rig_set(rig, "fanuc.00.crc-scalemax", 31);
    rig_cycle(rig);
    /* ABC_FEDCBA98_89ABCDE5 */
    assert_true(rig_get(rig, "fanuc.00.batt_fail") == 1 && rig_get(rig, "fanuc.00.batt_fail-not") == 0);
    assert_true(rig_get(rig, "fanuc.00.pos_invalid") == 1);
    assert_true(rig_get(rig, "fanuc.00.crc") == 0xABC >> 7);
    assert_true(fabs(rig_get(rig, "fanuc.00.comm") - (0xFEDCBA98 >> 22 & 1023)) < 1e-9);
    const uint64_t low = 0xFEDCBA9889ABCDE5u;
    const uint32_t counts = (uint32_t)(low >> 18 & 0xFFFF), turns = (uint32_t)(low >> 36 & 0xFFFF);
    assert_true(rig_get(rig, "fanuc.00.encoder.rawcounts") == (double)(int32_t)(turns << 16 | counts));
    rig_put(rig, 0x1700, 0x80000000); /* bad cable: nothing moves */
    rig_put(rig, 0x1500, 0);
    rig_cycles(rig, 20);
    assert_true(rig_get(rig, "fanuc.00.batt_fail") == 1);
    assert_true(rig_get(rig, "fanuc.00.data-invalid") == 1);
    rig_free(rig);
}

static void stale_bits_above_the_length_are_not_shown(void **state)
{
    (void)state;
    struct trace_file trace = trace_load("biss");
    size_t index = 0;
    struct module_rig *const rig = started("BI1_72", "biss_chan_0=low%32uhigh%8u", &hm2_biss_type);
    const struct trace_event *event = trace_find(&trace, &index, "bits_40", 'W', "data");
    while (event && event->value != 0x34567800)
        event = trace_find(&trace, &index, "bits_40", 'R', "data");
    assert_non_null(event);
    rig_put(rig, BISS_BUSY, 0);
    rig_put(rig, BISS_DATA, event->value); /* the rig gives it for both words */
    rig_cycle(rig);
    assert_true(rig_get(rig, "biss.00.high") == 0.0);
    assert_int_equal(rig_written(rig, BISS_CONTROL0) & 0x3FF, 40);
    trace_free(&trace);
    rig_free(rig);
}

/* ---- with a simulated card ----------------------------------------------------------------------------------------
 */

static void ssi_reads_an_encoder_of_both_generations(void **state)
{
    (void)state;
    for (unsigned later = 0; later < 2; later++) {
        struct module_rig *const rig = with_card("SISS4_4_72", "ssi_chan_2=low%30epad%4pflag%1bhigh%5u", &hm2_ssi_type,
                                                 later ? SIM_SOURCES_LATER : SIM_SOURCES_2021);
        struct sim_absolute encoder = {.bits = 40, .value = {0x12345678, 0x84}, .delay_ps = 100000};
        attach(rig, HM2_GTAG_SSI, 2, &encoder);
        rig_cycles(rig, 5);
        assert_int_equal((uint32_t)rig_get(rig, "ssi.02.low.rawcounts"), 0x12345678);
        assert_true(rig_get(rig, "ssi.02.flag") == 1);
        assert_true(rig_get(rig, "ssi.02.data-invalid") == 0);
        encoder.value[0] += 1000;
        attach(rig, HM2_GTAG_SSI, 2, &encoder);
        rig_cycles(rig, 2);
        assert_int_equal((uint32_t)rig_get(rig, "ssi.02.low.rawcounts"), 0x12345678 + 1000);
        free_with_card(rig);
    }
}

static void biss_reads_three_words_of_both_generations(void **state)
{
    (void)state;
    for (unsigned later = 0; later < 2; later++) {
        struct module_rig *const rig = with_card("BI1_72", "biss_chan_0=a%32eb%32ec%20u", &hm2_biss_type,
                                                 later ? SIM_SOURCES_LATER : SIM_SOURCES_2021);
        const struct sim_absolute encoder = {
            .bits = 84, .value = {0x23456789, 0x12345678, 0xABCDE}, .delay_ps = 900000, .processing = 12};
        attach(rig, HM2_GTAG_BISS, 0, &encoder);
        rig_set(rig, "biss.00.c-scalemax", 0xFFFFF);
        rig_cycles(rig, 6);
        assert_int_equal((uint32_t)rig_get(rig, "biss.00.a.rawcounts"), 0x23456789);
        assert_int_equal((uint32_t)rig_get(rig, "biss.00.b.rawcounts"), 0x12345678);
        assert_true(rig_get(rig, "biss.00.c") == 0xABCDE);
        free_with_card(rig);
    }
}

static void fanuc_reads_an_encoder_of_both_generations(void **state)
{
    (void)state;
    for (unsigned later = 0; later < 2; later++) {
        struct module_rig *const rig =
            with_card("FA1_72", "fanuc_chan_0=AA64", &hm2_fanuc_type, later ? SIM_SOURCES_LATER : SIM_SOURCES_2021);
        const struct sim_absolute encoder = {.bits = 76, .value = {0x00040005, 0x00000010, 0}, .delay_ps = 3000000};
        attach(rig, HM2_GTAG_FABS, 0, &encoder);
        rig_set(rig, "fanuc.00.filter", 7);
        rig_cycles(rig, 6);
        assert_true(rig_get(rig, "fanuc.00.encoder.rawcounts") == 65537);
        assert_true(rig_get(rig, "fanuc.00.data-invalid") == 0);
        assert_int_equal(sim_card_read(rig->card, rig->clk, 0x1900, NULL) >> 28, 7); /* setup was let through */
        free_with_card(rig);
    }
}

static void timers_start_transfers_of_both_generations(void **state)
{
    (void)state;
    for (unsigned later = 0; later < 2; later++) {
        struct module_rig *const rig =
            with_card("BI1_72", "biss_chan_0=a%18u", &hm2_biss_type, later ? SIM_SOURCES_LATER : SIM_SOURCES_2021);
        const struct sim_absolute encoder = {.bits = 18, .value = {0x2A5C3}, .processing = 2};
        attach(rig, HM2_GTAG_BISS, 0, &encoder);
        rig_set(rig, "biss.00.a-scalemax", 0x3FFFF);
        rig_set(rig, "biss.00.timer-number", 9);
        rig_cycle(rig);
        assert_true(rig_get(rig, "biss.00.timer-number") == 4);
        assert_false(rig_wrote(rig, BISS_DATA));
        sim_card_write(rig->card, rig->clk + 50, 0x7000, 0x0A7C5AC4); /* 1 ms in a 42-bit accumulator at 100 MHz / 4 */
        sim_card_write(rig->card, rig->clk + 51, 0x7200, 0x04000000);
        rig_cycles(rig, 4);
        assert_false(rig_wrote(rig, BISS_DATA));
        assert_true(rig_get(rig, "biss.00.a") == 0x2A5C3);
        free_with_card(rig);
    }
}

/* ---- hazards ------------------------------------------------------------------------------------------------------
 */

static void no_transfer_is_started_before_the_last_is_over(void **state)
{
    (void)state;
    struct module_rig *const rig = started("FA1_72", "fanuc_chan_0=AA64", &hm2_fanuc_type);
    rig_set_period(rig, 100000); /* an answer takes 226 us with its rest */
    rig_put(rig, FABS_BUSY, 1);
    unsigned starts = 0, last = 0;
    for (unsigned i = 0; i < 60; i++) {
        rig_cycle(rig);
        if (!rig_wrote(rig, FABS_DATA0))
            continue;
        assert_true(starts == 0 || i - last > 4); /* twice the time of a transfer, when nobody answers */
        last = i;
        starts++;
    }
    assert_true(starts >= 8);
    rig_put(rig, FABS_BUSY, 0);
    starts = 0;
    for (unsigned i = 0; i < 60; i++) {
        rig_cycle(rig);
        starts += rig_wrote(rig, FABS_DATA0);
    }
    assert_int_equal(starts, 20); /* every third cycle */
    rig_free(rig);
}

static void the_first_start_waits_until_the_settings_have_arrived(void **state)
{
    (void)state;
    struct module_rig *const rig = new_rig("BI1_72", "biss_chan_0=a%18u");
    (void)rig_add(rig, &hm2_biss_type);
    rig_start(rig);
    rig->lose_writes = true;
    rig_cycles(rig, 3);
    rig->lose_writes = false;
    rig_cycle(rig);
    assert_true(rig_wrote(rig, BISS_CONTROL0));
    assert_false(rig_wrote(rig, BISS_DATA));
    rig_cycle(rig);
    assert_true(rig_wrote(rig, BISS_DATA));
    rig_free(rig);
}

static void a_reading_of_a_start_that_may_have_come_twice_is_not_used(void **state)
{
    (void)state;
    struct module_rig *const rig = started("SISS4_4_72", "ssi_chan_0=a%12u", &hm2_ssi_type);
    struct hm2_module *const ssi = &rig->modules[0];
    rig_put(rig, SSI_BUSY, 1);
    rig_set(rig, "ssi.00.a-scalemax", 4095);
    rig_cycle(rig);
    rig->lose_writes = true;
    rig_cycle(rig); /* the start is lost */
    rig->lose_writes = false;
    ssi->type->write_lost(ssi);
    rig_put(rig, SSI_BUSY, 0);
    rig_put(rig, SSI_DATA0, 1234);
    rig_cycle(rig);
    assert_true(rig_get(rig, "ssi.00.a") == 0.0);
    rig_put(rig, SSI_DATA0, 1235);
    rig_cycle(rig);
    assert_true(rig_get(rig, "ssi.00.a") == 1235.0);
    rig_free(rig);
}

static void unusable_parameters_are_rewritten_and_told(void **state)
{
    (void)state;
    struct module_rig *const rig = started("FA1_72", "fanuc_chan_0=AA64", &hm2_fanuc_type);
    rig_set(rig, "fanuc.00.filter", 0); /* would be a cable error for ever */
    rig_cycle(rig);
    assert_true(rig_get(rig, "fanuc.00.filter") == 1);
    assert_int_equal(rig_written(rig, 0x1900), 0x100029F1);
    static const double khz[] = {NAN, -1, 0, INFINITY, 1e12};
    for (size_t i = 0; i < sizeof khz / sizeof khz[0]; i++) {
        rig_set(rig, "fanuc.00.frequency-khz", khz[i]);
        rig_cycles(rig, 2);
        const uint32_t rate = rig_written(rig, 0x1900) & 0xFFFFF;
        assert_int_equal(rate, khz[i] > 1 ? 0x80000 : 1);
        assert_true(isfinite(rig_get(rig, "fanuc.00.frequency-khz")));
    }
    assert_int_equal(rig->noticed[0][HM2_NOTICE_VALUE_INVALID], 2);
    assert_int_equal(rig->noticed[0][HM2_NOTICE_VALUE_CLAMPED], 1 + 3);
    rig_free(rig);
}

static void fanuc_settings_travel_together_and_in_order(void **state)
{
    (void)state;
    struct module_rig *const rig = started("FA1_72", "fanuc_chan_0=AA64", &hm2_fanuc_type);
    rig_cycles(rig, 2);
    assert_false(rig_wrote(rig, 0x1900));
    rig_set(rig, "fanuc.00.frequency-khz", 2048);
    rig_cycle(rig);
    static const struct rig_write expected[] = {
        {FABS_CONTROL0, 0x01000080}, {0x1900, 0xF00053E2}, {0x1700, 0x4CC80000}, {FABS_CONTROL0, 0x100}};
    unsigned at = 0;
    for (unsigned i = 0; i < rig->logged && at < 4; i++)
        at += rig->log[i].address == expected[at].address && rig->log[i].value == expected[at].value;
    assert_int_equal(at, 4);
    rig_free(rig);
}

static void a_silent_encoder_makes_data_invalid_and_is_asked_again(void **state)
{
    (void)state;
    struct module_rig *const rig = with_card("BI1_72", "biss_chan_0=a%18u", &hm2_biss_type, SIM_SOURCES_2021);
    const struct sim_absolute encoder = {.bits = 18, .value = {0x2A5C3}, .processing = 2}, none = {0};
    rig_set(rig, "biss.00.a-scalemax", 0x3FFFF);
    attach(rig, HM2_GTAG_BISS, 0, &encoder);
    rig_cycles(rig, 5);
    assert_true(rig_get(rig, "biss.00.a") == 0x2A5C3 && rig_get(rig, "biss.00.data-invalid") == 0);
    attach(rig, HM2_GTAG_BISS, 0, &none);
    rig_cycles(rig, 9);
    assert_true(rig_get(rig, "biss.00.data-invalid") == 0);
    rig_cycles(rig, 6);
    assert_true(rig_get(rig, "biss.00.data-invalid") == 1);
    assert_true(rig_get(rig, "biss.00.a") == 0x2A5C3);
    attach(rig, HM2_GTAG_BISS, 0, &encoder);
    rig_cycles(rig, 5);
    assert_true(rig_get(rig, "biss.00.data-invalid") == 0);
    free_with_card(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(formats_are_counted_and_broken_ones_refused),
        cmocka_unit_test(only_configured_channels_have_points_and_pins),
        cmocka_unit_test(more_bits_than_the_module_receives_are_refused),
        cmocka_unit_test(fields_are_numbers_bits_and_booleans),
        cmocka_unit_test(an_encoder_counts_on_where_its_field_wraps),
        cmocka_unit_test(reset_and_index_move_the_zero),
        cmocka_unit_test(recorded_words_of_an_aa64_encoder_are_its_fields),
        cmocka_unit_test(stale_bits_above_the_length_are_not_shown),
        cmocka_unit_test(ssi_reads_an_encoder_of_both_generations),
        cmocka_unit_test(biss_reads_three_words_of_both_generations),
        cmocka_unit_test(fanuc_reads_an_encoder_of_both_generations),
        cmocka_unit_test(timers_start_transfers_of_both_generations),
        cmocka_unit_test(no_transfer_is_started_before_the_last_is_over),
        cmocka_unit_test(the_first_start_waits_until_the_settings_have_arrived),
        cmocka_unit_test(a_reading_of_a_start_that_may_have_come_twice_is_not_used),
        cmocka_unit_test(unusable_parameters_are_rewritten_and_told),
        cmocka_unit_test(fanuc_settings_travel_together_and_in_order),
        cmocka_unit_test(a_silent_encoder_makes_data_invalid_and_is_asked_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
