/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Parameters and firmware of a remote over serial LBP: the client at one end of a mock line, a simulated remote at the
 * other. */
#include "unit.h"

#include <hm2/lbp_remote.h>

#include "remote_lbp.h"
#include "remote_state.h"

#define BYTE_NS INT64_C(87000)

static struct remote *simulated;
static struct remote_lbp line;
static struct link *mock;
static struct lbp_client client;
static struct lbp_remote remote;
static struct hm2_diag diag;
static unsigned spoil; /* one answer in so many is spoilt or lost; 0 = none */
static unsigned answers;

/* The other end of the line. */
static int arrive(void *const context, struct link *const link, const uint8_t *const data, const size_t len)
{
    uint8_t answer[LBP_MESSAGE_BYTES];
    (void)context;
    for (size_t i = 0; i < len; i++) {
        const size_t bytes = remote_lbp_take(&line, data[i], link_now_ns(link) + BYTE_NS * (int64_t)i, answer);
        if (bytes == 0)
            continue;
        answers++;
        if (spoil && answers % spoil == 0)
            answer[bytes - 1] ^= 0x10u;
        if (spoil && answers % spoil == spoil / 2)
            return 0;
        const struct link_mock_reply reply = {
            .data = answer, .len = bytes, .delay_ns = BYTE_NS * (int64_t)(len + bytes)};
        return link_mock_push(link, &reply);
    }
    return 0;
}

static void expect_good(const int err)
{
    if (err)
        fail_msg("%s: %s", hm2_strerror(err), diag.text);
}

static void plug(const char *const name, const uint8_t mode)
{
    hm2_diag_clear(&diag);
    expect_good(remote_new(&simulated, name, 5, &diag));
    remote_lbp_init(&line, simulated, LBP_SETUP_BAUD);
    expect_good(link_mock_open(&mock, arrive, NULL));
    link_mock_advance(mock, 1000000000);
    spoil = answers = 0;
    lbp_client_init(&client, mock, "line", LBP_SETUP_BAUD, &diag);
    remote = (struct lbp_remote){.access = lbp_client_access(&client), .name = "line", .diag = &diag};
    expect_good(lbp_client_identify(&client, mode, &remote.identity));
    expect_good(lbp_remote_discover(&remote));
}

static void unplug(void)
{
    link_close(mock);
    remote_free(simulated);
}

static const struct sslbp_field *field(const char *const name)
{
    const struct sslbp_field *found = NULL;
    expect_good(lbp_remote_find(&remote, name, &found));
    return found;
}

static uint64_t get(const char *const name)
{
    uint64_t raw = 0;
    expect_good(lbp_remote_get(&remote, field(name), &raw));
    return raw;
}

/* ---- parameters ---------------------------------------------------------------------------------------------------
 */

static const char *const kinds[] = {"7i77-field", "7i77d-field", "7i77-analog", "7i76", "7i84", "7i84d",
                                    "7i69",       "7i70",        "7i71",        "7i72", "7i73"};

static void every_parameter_of_every_remote_makes_the_round_trip(void **state)
{
    (void)state;
    for (size_t kind = 0; kind < sizeof kinds / sizeof kinds[0]; kind++) {
        const struct sslbp_field *f;
        unsigned written = 0;
        plug(kinds[kind], 0);
        assert_int_equal(lbp_remote_put(&remote, field("watchdogtimeout"), 0), 0);
        for (unsigned i = 0; (f = lbp_remote_field(&remote, i)); i++) {
            uint64_t before = 0, after = 0;
            expect_good(lbp_remote_get(&remote, f, &before));
            if (f->direction == SSLBP_INPUT) {
                assert_int_equal(lbp_remote_put(&remote, f, before), HM2_ERR_STATE);
                continue;
            }
            if (strcmp(f->name, "fault") == 0)
                continue; /* clears what is written, rather than taking it */
            const uint64_t other = before ^ 1u;
            expect_good(lbp_remote_put(&remote, f, other));
            expect_good(lbp_remote_get(&remote, f, &after));
            assert_int_equal(after, other);
            written++;
        }
        assert_true(written >= 5); /* of parameters; a 7I70 has no outputs */
        unplug();
    }
}

static void the_same_on_a_line_full_of_errors(void **state)
{
    (void)state;
    plug("7i77-field", 3);
    spoil = 7;
    for (unsigned i = 0; i < 200; i++) {
        expect_good(lbp_remote_put(&remote, field("nvwatchdog"), i));
        assert_int_equal(get("nvwatchdog"), i);
    }
    assert_true(client.repeated > 100);
    unplug();
}

static void nonvolatile_values_work_from_the_next_power_up_on(void **state)
{
    (void)state;
    plug("7i77-field", 0);
    assert_int_equal(get("NVWATCHDOGTIME"), 50);
    expect_good(lbp_remote_put(&remote, field("NVWATCHDOGTIME"), 100));
    assert_int_equal(get("WATCHDOGTIME"), 50);
    expect_good(lbp_client_set(&client, LBP_RESET, LBP_COOKIE));
    assert_int_equal(get("WATCHDOGTIME"), 100);
    unplug();
}

static void neighbours_of_a_field_are_left_alone(void **state)
{
    (void)state;
    plug("7i77-analog", 0);
    expect_good(lbp_remote_put(&remote, field("analogout0"), 0x0123));
    expect_good(lbp_remote_put(&remote, field("analogout1"), 0x1FFF));
    expect_good(lbp_remote_put(&remote, field("analogout2"), 0x0456));
    expect_good(lbp_remote_put(&remote, field("analogout1"), 0));
    assert_int_equal(get("analogout0"), 0x0123);
    assert_int_equal(get("analogout2"), 0x0456);
    unplug();
}

static void names_may_be_shortened_as_long_as_they_are_clear(void **state)
{
    const struct sslbp_field *found;
    (void)state;
    plug("7i77-field", 0);
    assert_string_equal(field("NvB")->name, "nvbaudrate");
    assert_string_equal(field("FAULT")->name, "fault");
    assert_int_equal(lbp_remote_find(&remote, "nv", &found), HM2_ERR_INVALID);
    assert_non_null(strstr(diag.text, "nvbaudrate, nvunitnumber, nvwatchdogtimeout"));
    assert_int_equal(lbp_remote_find(&remote, "speed", &found), HM2_ERR_NOTFOUND);
    assert_int_equal(lbp_remote_find(&remote, "", &found), HM2_ERR_NOTFOUND);
    unplug();
}

/* ---- values -------------------------------------------------------------------------------------------------------
 */

static const struct {
    uint8_t type, bits;
    const char *text;
    bool hex;
    int err;
    uint64_t raw;
} values[] = {
    {SSLBP_UNSIGNED, 8, "255", false, 0, 255},
    {SSLBP_UNSIGNED, 8, "256", false, HM2_ERR_RANGE, 0},
    {SSLBP_UNSIGNED, 8, "FF", true, 0, 255},
    {SSLBP_UNSIGNED, 8, "FF", false, HM2_ERR_INVALID, 0},
    {SSLBP_UNSIGNED, 8, "", false, HM2_ERR_INVALID, 0},
    {SSLBP_UNSIGNED, 8, "-1", false, HM2_ERR_INVALID, 0},
    {SSLBP_UNSIGNED, 8, "0x12", true, HM2_ERR_INVALID, 0},
    {SSLBP_BITS, 48, "AAAAAAAAAAAA", true, 0, 0xAAAAAAAAAAAA},
    {SSLBP_UNSIGNED, 64, "18446744073709551615", false, 0, UINT64_MAX},
    {SSLBP_UNSIGNED, 64, "18446744073709551616", false, HM2_ERR_RANGE, 0},
    {SSLBP_SIGNED, 16, "-32768", false, 0, 0x8000},
    {SSLBP_SIGNED, 16, "-32769", false, HM2_ERR_RANGE, 0},
    {SSLBP_SIGNED, 16, "32767", false, 0, 0x7FFF},
    {SSLBP_SIGNED, 16, "32768", false, HM2_ERR_RANGE, 0},
    {SSLBP_SIGNED, 16, "8000", true, 0, 0x8000},
    {SSLBP_NV_SIGNED, 64, "-9223372036854775808", false, 0, UINT64_C(1) << 63},
    {SSLBP_FLOAT, 32, "1.5", false, 0, 0x3FC00000},
    {SSLBP_FLOAT, 32, "3FC00000", true, 0, 0x3FC00000},
    {SSLBP_FLOAT, 32, "nan", false, HM2_ERR_INVALID, 0},
};

static void values_are_read_as_wide_as_the_field_and_printed_alike(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof values / sizeof values[0]; i++) {
        const struct sslbp_field f = {.bits = values[i].bits, .type = values[i].type, .max = 1.0, .name = "x"};
        const struct lbp_remote any = {.name = "any"};
        char text[LBP_VALUE_TEXT];
        uint64_t raw = 0;
        const int err = lbp_remote_parse(&any, &f, values[i].text, values[i].hex, &raw);
        if (err != values[i].err || (err == 0 && raw != values[i].raw))
            fail_msg("row %zu, %s: %d, 0x%llX", i, values[i].text, err, (unsigned long long)raw);
        if (err)
            continue;
        lbp_value_text(&f, raw, values[i].hex, text);
        assert_string_equal(text, values[i].text);
    }
}

static void the_limits_that_a_remote_gives_hold_for_its_parameters(void **state)
{
    uint64_t raw;
    (void)state;
    plug("7i77-analog", 0);
    expect_good(lbp_remote_parse(&remote, field("nvbaud"), "11", false, &raw));
    assert_int_equal(lbp_remote_parse(&remote, field("nvbaud"), "12", false, &raw), HM2_ERR_RANGE);
    assert_non_null(strstr(diag.text, "0 to 11"));
    expect_good(lbp_remote_parse(&remote, field("nvunit"), "4294967295", false, &raw)); /* its limit is inexact */
    expect_good(lbp_remote_parse(&remote, field("analogout0"), "4095", false, &raw));   /* its limit is in volts */
    unplug();
}

/* ---- firmware -----------------------------------------------------------------------------------------------------
 */

#define BLOCK (1u << REMOTE_BLOCK_LOG2)

static uint8_t image[5 * BLOCK + 100];

/* Block 2 is empty, the last one short. */
static void make_image(void)
{
    for (size_t i = 0; i < sizeof image; i++)
        image[i] = i / BLOCK == 2 ? 0 : (uint8_t)(i * 7 + i / 256);
}

static void count_progress(void *const context, const uint32_t done_bytes, const uint32_t all_bytes)
{
    unsigned *const calls = context;
    (*calls)++;
    assert_true(done_bytes <= all_bytes && all_bytes == sizeof image);
}

static void firmware_is_written_block_by_block_but_for_the_loader(void **state)
{
    struct lbp_flash flash;
    unsigned calls = 0;
    (void)state;
    make_image();
    for (unsigned bad = 0; bad <= 9; bad += 9) {
        plug("7i77-field", 0);
        memset(simulated->flash.bytes, 0x33, sizeof simulated->flash.bytes);
        spoil = bad;
        expect_good(lbp_remote_check_image(&remote, image, sizeof image, &flash));
        assert_int_equal(flash.block_bytes, BLOCK);
        assert_int_equal(flash.page_bytes, 64);
        expect_good(lbp_remote_update(&remote, &flash, image, sizeof image, count_progress, &calls));
        for (size_t i = 0; i < sizeof simulated->flash.bytes; i++) {
            const bool kept = i < BLOCK || i / BLOCK == 2 || i >= 6 * BLOCK;
            const uint8_t wanted = kept ? 0x33 : i < sizeof image ? image[i] : 0;
            if (simulated->flash.bytes[i] != wanted)
                fail_msg("0x%02X at 0x%zX, 0x%02X expected", simulated->flash.bytes[i], i, wanted);
        }
        assert_int_equal(simulated->nv_memory, REMOTE_WORKING);
        unplug();
    }
    assert_int_equal(calls, 10);
}

static void images_that_can_be_no_firmware_are_refused_before_anything_changes(void **state)
{
    static uint8_t large[LBP_IMAGE_MAX + 1];
    struct lbp_flash flash;
    (void)state;
    plug("7i77-field", 0);
    memset(simulated->flash.bytes, 0x33, sizeof simulated->flash.bytes);
    large[0] = large[BLOCK - 1] = 1; /* nothing but a loader */
    assert_int_equal(lbp_remote_check_image(&remote, large, 4 * BLOCK, &flash), HM2_ERR_MISMATCH);
    assert_int_equal(lbp_remote_check_image(&remote, large, BLOCK, &flash), HM2_ERR_MISMATCH);
    assert_int_equal(lbp_remote_check_image(&remote, large, 0, &flash), HM2_ERR_MISMATCH);
    large[BLOCK] = 1;
    expect_good(lbp_remote_check_image(&remote, large, BLOCK + 1, &flash));
    assert_int_equal(lbp_remote_check_image(&remote, large, sizeof large, &flash), HM2_ERR_MISMATCH);
    for (size_t i = 0; i < sizeof simulated->flash.bytes; i++)
        assert_int_equal(simulated->flash.bytes[i], 0x33);
    unplug();
}

static void a_remote_that_refuses_ends_the_update(void **state)
{
    static uint8_t too_long[REMOTE_FLASH_BYTES + BLOCK];
    struct lbp_flash flash;
    (void)state;
    plug("7i77-field", 0);
    memset(too_long, 1, sizeof too_long);
    expect_good(lbp_remote_check_image(&remote, too_long, sizeof too_long, &flash));
    assert_int_equal(lbp_remote_update(&remote, &flash, too_long, sizeof too_long, NULL, NULL), HM2_ERR_IO);
    assert_non_null(strstr(diag.text, "erasing flash at 0x8000"));
    assert_int_equal(simulated->nv_memory, REMOTE_WORKING);
    unplug();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_parameter_of_every_remote_makes_the_round_trip),
        cmocka_unit_test(the_same_on_a_line_full_of_errors),
        cmocka_unit_test(nonvolatile_values_work_from_the_next_power_up_on),
        cmocka_unit_test(neighbours_of_a_field_are_left_alone),
        cmocka_unit_test(names_may_be_shortened_as_long_as_they_are_clear),
        cmocka_unit_test(values_are_read_as_wide_as_the_field_and_printed_alike),
        cmocka_unit_test(the_limits_that_a_remote_gives_hold_for_its_parameters),
        cmocka_unit_test(firmware_is_written_block_by_block_but_for_the_loader),
        cmocka_unit_test(images_that_can_be_no_firmware_are_refused_before_anything_changes),
        cmocka_unit_test(a_remote_that_refuses_ends_the_update),
    };
    return cmocka_run_group_tests_name("lbp_remote", tests, NULL, NULL);
}
