/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The traps of the packet UART's firmware (register map, Annex D), a test each, with every version of it. */
#include "unit.h"

#include "idrom_files.h"
#include "serial_rig.h"

#define VERSIONS 4u

struct rig {
    unsigned version;
    struct sim_bench *bench;
    struct hm2_serial *port;
    struct hm2_serial_settings settings;
    struct serial_ear ear;
};

static const struct hm2_serial_settings usual = {
    .baud = 115200, .drive = HM2_DRIVE_ON, .frames = true, .tx_gap_bits = 40, .rx_gap_bits = 20};

static void run(const struct rig *rig, const unsigned cycles)
{
    for (unsigned i = 0; i < cycles; i++)
        sim_bench_cycle(rig->bench);
}

static void start(struct rig *rig, const unsigned version, const struct hm2_serial_settings *settings)
{
    struct hm2_image image;
    load_image(TEST_DATA "/hm2_pty/PKTUART_1.hex", &image);
    set_image_version(&image, HM2_GTAG_PKTUART_TX, (uint8_t)version);
    set_image_version(&image, HM2_GTAG_PKTUART_RX, (uint8_t)version);
    const struct sim_card_options options = {.profile = "7i80hd-16", .seed = 1, .image = &image};
    *rig = (struct rig){.version = version, .bench = sim_bench_of(&options, ""), .settings = *settings};
    rig->port = serial_rig_open(rig->bench, HM2_SERIAL_PKTUART, settings);
    serial_rig_listen(rig->bench, &rig->ear);
    run(rig, 5);
}

/* A card with the next version of the firmware, the first one for {0}; false when all had their turn. What a test
 * changes in rig->settings is gone then. */
static bool next_version(struct rig *rig, const struct hm2_serial_settings *settings)
{
    const unsigned version = rig->bench ? rig->version + 1 : 0;
    if (rig->bench)
        sim_bench_free(rig->bench);
    rig->bench = NULL;
    if (version < VERSIONS)
        start(rig, version, settings);
    return version < VERSIONS;
}

static void put(const struct rig *rig, const char *text)
{
    assert_int_equal(hm2_serial_put_frame(rig->port, (const uint8_t *)text, strlen(text)), 0);
}

static void expect_heard(const struct rig *rig, const char *text)
{
    if (rig->ear.heard != strlen(text) || memcmp(rig->ear.byte, text, rig->ear.heard) != 0)
        fail_msg("version %u: the world outside heard \"%.*s\" instead of \"%s\"", rig->version, (int)rig->ear.heard,
                 (const char *)rig->ear.byte, text);
}

static void expect_frame(const struct rig *rig, const char *text)
{
    char got[2048];
    const size_t len = hm2_serial_get_frame(rig->port, (uint8_t *)got, sizeof got);
    if (len != strlen(text) || memcmp(got, text, len) != 0)
        fail_msg("version %u: \"%.*s\" received instead of \"%s\"", rig->version, (int)len, got, text);
}

static void the_first_frame_after_power_up_is_sent(void **state)
{
    (void)state;
    struct rig rig = {0};
    while (next_version(&rig, &usual)) {
        put(&rig, "first");
        run(&rig, 10);
        expect_heard(&rig, "first");
    }
}

static void of_several_frames_none_is_stranded_by_automatic_drive_enable(void **state)
{
    struct hm2_serial_settings settings = usual;
    (void)state;
    settings.drive = HM2_DRIVE_AUTO;
    struct rig rig = {0};
    while (next_version(&rig, &settings)) {
        put(&rig, "one ");
        put(&rig, "two ");
        put(&rig, "three");
        run(&rig, 30);
        expect_heard(&rig, "one two three");
    }
}

static void a_delay_that_would_silence_automatic_drive_enable_is_refused_where_it_does(void **state)
{
    struct hm2_serial_settings settings = usual;
    (void)state;
    settings.drive = HM2_DRIVE_AUTO;
    struct rig rig = {0};
    while (next_version(&rig, &settings)) {
        rig.settings.drive_delay_clk = 15;
        assert_int_equal(hm2_serial_set(rig.port, &rig.settings, &rig.bench->diag),
                         rig.version == 0 ? HM2_ERR_RANGE : 0);
        put(&rig, "heard");
        run(&rig, 10);
        expect_heard(&rig, "heard");
    }
}

static void without_drive_enable_no_count_overwrites_another(void **state)
{
    struct hm2_serial_settings settings = usual;
    (void)state;
    settings.drive = HM2_DRIVE_OFF;
    struct rig rig = {0};
    while (next_version(&rig, &settings)) {
        put(&rig, "one");
        put(&rig, "two");
        run(&rig, 20);
        expect_heard(&rig, "");
        assert_int_equal(hm2_serial_waiting(rig.port), 6);
        assert_int_equal(hm2_serial_counts(rig.port).tx_bytes, 0);
    }
}

static void the_bit_rate_is_right_whatever_the_width_of_its_register(void **state)
{
    static const uint8_t bytes[115]; /* 10 ms */
    (void)state;
    struct rig rig = {0};
    while (next_version(&rig, &usual)) {
        assert_int_equal(hm2_serial_put_frame(rig.port, bytes, sizeof bytes), 0);
        run(&rig, 10);
        if (rig.ear.heard < sizeof bytes - 24u || rig.ear.heard == sizeof bytes)
            fail_msg("version %u: %zu bytes in 10 ms", rig.version, rig.ear.heard);
    }
}

static void bytes_without_a_pause_are_one_frame_with_the_shortest_gap(void **state)
{
    static const char text[] = "what follows without a pause belongs together";
    struct hm2_serial_settings settings = usual;
    (void)state;
    settings.rx_gap_bits = 11;
    struct rig rig = {0};
    while (next_version(&rig, &settings)) {
        serial_rig_say(rig.bench, text, strlen(text));
        run(&rig, 10);
        expect_frame(&rig, text);
        rig.settings.rx_gap_bits = 10;
        assert_int_equal(hm2_serial_set(rig.port, &rig.settings, &rig.bench->diag), HM2_ERR_RANGE);
    }
}

static void a_gap_of_256_bits_is_the_longest(void **state)
{
    struct hm2_serial_settings settings = usual;
    (void)state;
    settings.baud = 38400; /* 6.7 ms of gap */
    settings.rx_gap_bits = 256;
    struct rig rig = {0};
    while (next_version(&rig, &settings)) {
        serial_rig_say(rig.bench, "one ", 4);
        run(&rig, 5);
        serial_rig_say(rig.bench, "frame", 5);
        run(&rig, 14);
        serial_rig_say(rig.bench, "another", 7);
        run(&rig, 14);
        expect_frame(&rig, "one frame");
        expect_frame(&rig, "another");
        rig.settings.rx_gap_bits = 257;
        assert_int_equal(hm2_serial_set(rig.port, &rig.settings, &rig.bench->diag), HM2_ERR_RANGE);
    }
}

static void what_the_last_word_held_before_is_not_given(void **state)
{
    (void)state;
    struct rig rig = {0};
    while (next_version(&rig, &usual)) {
        serial_rig_say(rig.bench, "abcdefgh", 8);
        run(&rig, 6);
        serial_rig_say(rig.bench, "x", 1);
        run(&rig, 6);
        expect_frame(&rig, "abcdefgh");
        expect_frame(&rig, "x");
        expect_frame(&rig, "");
    }
}

/* The card counts sixteen; one more, and sizes and data no longer match. */
static void more_frames_than_the_card_counts_are_told_and_do_not_mix(void **state)
{
    (void)state;
    struct rig rig = {0};
    while (next_version(&rig, &usual)) {
        for (unsigned i = 0; i < 20; i++) { /* the thread is kept from its work */
            serial_rig_say(rig.bench, "unread", 6);
            rig.bench->now_ns += BENCH_PERIOD_NS;
            sim_net_sleep_until(rig.bench->net, rig.bench->now_ns);
        }
        run(&rig, 20);
        assert_true(hm2_serial_lost(rig.port));
        assert_true(hm2_serial_counts(rig.port).rx_overruns > 0);
        while (hm2_serial_next_frame(rig.port) > 0)
            expect_frame(&rig, "unread");
        serial_rig_say(rig.bench, "cut?", 4); /* the first after a clear may have begun before it */
        run(&rig, 10);
        serial_rig_say(rig.bench, "heard", 5);
        run(&rig, 10);
        expect_frame(&rig, "heard");
    }
}

/* Its size counts from 0 again, and its beginning is overwritten. */
static void a_frame_that_is_too_long_is_told_and_not_taken_for_a_short_one(void **state)
{
    static const uint8_t bytes[1100];
    (void)state;
    struct rig rig = {0};
    while (next_version(&rig, &usual)) {
        serial_rig_say(rig.bench, bytes, sizeof bytes);
        run(&rig, 120);
        assert_int_equal(hm2_serial_next_frame(rig.port), 0);
        assert_true(hm2_serial_lost(rig.port));
        assert_true(hm2_serial_counts(rig.port).rx_uncertain >= sizeof bytes);
        serial_rig_say(rig.bench, "heard", 5);
        run(&rig, 10);
        expect_frame(&rig, "heard");
    }
}

/* With a filter of 0 the receiver sees a low for ever, with one longer than a bit nothing. */
static void the_input_filter_suits_the_fastest_and_the_slowest_line(void **state)
{
    static const uint32_t bauds[] = {5000000, 2400};
    (void)state;
    for (size_t i = 0; i < 2; i++) {
        struct hm2_serial_settings settings = usual;
        struct rig rig = {0};
        settings.baud = bauds[i];
        while (next_version(&rig, &settings)) {
            serial_rig_say(rig.bench, "heard", 5);
            run(&rig, 60);
            expect_frame(&rig, "heard");
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_first_frame_after_power_up_is_sent),
        cmocka_unit_test(of_several_frames_none_is_stranded_by_automatic_drive_enable),
        cmocka_unit_test(a_delay_that_would_silence_automatic_drive_enable_is_refused_where_it_does),
        cmocka_unit_test(without_drive_enable_no_count_overwrites_another),
        cmocka_unit_test(the_bit_rate_is_right_whatever_the_width_of_its_register),
        cmocka_unit_test(bytes_without_a_pause_are_one_frame_with_the_shortest_gap),
        cmocka_unit_test(a_gap_of_256_bits_is_the_longest),
        cmocka_unit_test(what_the_last_word_held_before_is_not_given),
        cmocka_unit_test(more_frames_than_the_card_counts_are_told_and_do_not_mix),
        cmocka_unit_test(a_frame_that_is_too_long_is_told_and_not_taken_for_a_short_one),
        cmocka_unit_test(the_input_filter_suits_the_fastest_and_the_slowest_line),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
