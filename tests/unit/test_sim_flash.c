/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The simulated configuration flash: what it holds, how long it takes, how it fails, what starts from it. */
#include <limits.h>
#include <stdio.h>
#include <string.h>

#include <hm2/bytes.h>
#include <hm2/sim_flash.h>

#include "hex.h"
#include "unit.h"

#define MS     INT64_C(1000000)
#define USER   0x100000u
#define SECTOR 65536u
#define FILES  1048576u

static uint8_t file_bytes[FILES];

static struct sim_card *card_with(const struct sim_card_options *const options)
{
    struct sim_card *card = NULL;
    struct hm2_diag diag = {0};
    if (sim_card_new(&card, options, &diag))
        fail_msg("%s", diag.text);
    return card;
}

static struct sim_card *card_of(const char *const profile)
{
    const struct sim_card_options options = {.profile = profile, .seed = 7};
    return card_with(&options);
}

static int64_t now_ns; /* of the exchanges of a test */

/* Request and reply as hex; returns how long the reply took. */
static int64_t exchange(struct sim_card *const card, const char *const request, const char *const expected)
{
    uint8_t bytes[512], want[512], reply[1500];
    int64_t reply_ns = now_ns;
    const size_t len = hex_bytes(request, bytes, sizeof bytes), want_len = hex_bytes(expected, want, sizeof want);
    const size_t got = sim_card_packet(card, now_ns, bytes, len, reply, sizeof reply, &reply_ns);
    if (got != want_len)
        fail_msg("%s: %zu bytes instead of %zu", request, got, want_len);
    assert_memory_equal(reply, want, want_len);
    const int64_t took_ns = reply_ns - now_ns;
    now_ns = reply_ns + MS;
    return took_ns;
}

static int fresh(void **const state)
{
    (void)state;
    now_ns = 0;
    return 0;
}

static void install(struct sim_card *const card, const char *const profile, const enum sim_area area,
                    const uint64_t seed)
{
    const struct sim_flash_file file = {.profile = profile, .area = area, .seed = seed, .bytes = 100000};
    assert_true(sim_card_install(card, &file) > 90000);
}

#define ERASE_USER   "01D91A00035A 01CE000000001000 01CE0C0000000000 014E0000"
#define PROGRAM_USER "01D91A00035A 01CE000000001000 02CE0400 12345678 9ABCDEF0 014E0000"

static const char *const profiles[] = {"7i93", "7i96s"};

/* ---- time, faults, power ---------------------------------------------------------------------------------------- */

static void the_chip_takes_the_times_of_its_data_sheet(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int64_t program_us, erase_us;
    } rows[] = {{"none", 0, 0},
                {"m25p16", 640, 600000},
                {"m25p16-max", 5000, 3000000},
                {"w25q16", 400, 150000},
                {"w25q16-max", 3000, 2000000}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sim_card *const card = card_of("7i96s");
        now_ns = 0;
        const struct sim_flash_times *const times = sim_flash_times_of(rows[i].name);
        assert_non_null(times);
        sim_card_flash_times(card, times);
        const int64_t erase_us = exchange(card, ERASE_USER, "00001000") / 1000;
        const int64_t program_us = exchange(card, PROGRAM_USER, "08001000") / 1000;
        assert_in_range(erase_us, rows[i].erase_us, rows[i].erase_us + 100);
        assert_in_range(program_us, rows[i].program_us, rows[i].program_us + 100);
        sim_card_free(card);
    }
    assert_null(sim_flash_times_of("m25p17"));
}

static void several_pages_of_a_datagram_are_waited_for_one_after_the_other(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    sim_card_flash_times(card, sim_flash_times_of("m25p16"));
    const int64_t took_ns = exchange(card,
                                     "01D91A00035A 01CE000000001000 01CE0400 11111111 01CE000000011000 01CE0400 "
                                     "22222222 014E0000",
                                     "04011000");
    assert_in_range(took_ns / 1000, 1280, 1380);
    exchange(card, "01CE000000001000 014E0400", "11111111");
    exchange(card, "01CE000000011000 014E0400", "22222222");
    sim_card_free(card);
}

static void a_chip_that_never_ends_makes_the_card_deaf_until_it_is_switched_off_and_on(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    const struct sim_flash_faults faults = {.stuck_at = 2};
    sim_card_flash_faults(card, &faults);
    exchange(card, ERASE_USER, "00001000");
    exchange(card, PROGRAM_USER, "");
    exchange(card, "01420001", "");
    assert_int_equal(sim_card_running(card), SIM_BOOT_NOTHING);
    sim_card_power_cycle(card);
    now_ns += 2000 * MS;
    exchange(card, "01420001", "FECAAA55");
    sim_card_free(card);
}

static void a_power_cut_in_a_page_leaves_the_bytes_before_it_and_none_behind(void **state)
{
    (void)state;
    for (unsigned cut = 0; cut <= 8; cut++) {
        struct sim_card *const card = card_of("7i96s");
        now_ns = 0;
        const struct sim_flash_faults faults = {.cut_at = 1, .cut_bytes = cut, .seed = cut};
        sim_card_flash_faults(card, &faults);
        exchange(card, PROGRAM_USER, "");
        exchange(card, "01420001", "");
        static const uint8_t page[] = {0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE, 0xF0};
        const uint8_t *const flash = sim_card_flash(card, NULL) + USER;
        assert_memory_equal(flash, page, cut);
        for (unsigned i = cut + 1; i < 9; i++)
            assert_int_equal(flash[i], 0xFF);
        if (cut < 8) /* bits are cleared that should be, and no others */
            assert_int_equal(flash[cut] & page[cut], page[cut]);
        sim_card_free(card);
    }
}

static void a_power_cut_in_an_erase_leaves_neither_the_old_nor_a_blank_sector(void **state)
{
    (void)state;
    unsigned fuller = 0, emptier = 0;
    for (unsigned seed = 0; seed < 32; seed++) {
        struct sim_card *const card = card_of("7i96s");
        now_ns = 0;
        uint8_t *const flash = sim_card_flash(card, NULL);
        memset(flash + USER, 0x5A, 2 * (size_t)SECTOR);
        const struct sim_flash_faults faults = {.cut_at = 1, .cut_bytes = 64, .seed = seed};
        sim_card_flash_faults(card, &faults);
        exchange(card, ERASE_USER, "");
        unsigned ones = 0, old = 0;
        for (unsigned i = 0; i < SECTOR; i++) {
            ones += (unsigned)__builtin_popcount(flash[USER + i]);
            old += flash[USER + i] == 0x5A;
        }
        fuller += ones > 4 * SECTOR;
        emptier += ones < 4 * SECTOR;
        assert_true(old < SECTOR / 2);
        assert_int_equal(flash[USER + SECTOR], 0x5A);
        assert_int_equal(flash[USER - 1], 0xFF);
        sim_card_free(card);
    }
    assert_true(fuller > 4);
    assert_true(emptier > 4);
}

static void bad_bits_fail_as_often_as_was_said(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    const struct sim_flash_faults faults = {
        .bad_count = 2, .bad = {{USER, 0x01, 1, 0}, {USER + 1, 0x80, 0, 1}, {USER + SECTOR, 0xFF, UINT_MAX, UINT_MAX}}};
    sim_card_flash_faults(card, &faults);
    exchange(card, "01D91A00035A 01CE000000001000 01CE0400 00000000 014E0000", "04001000");
    exchange(card, "01CE000000001000 014E0400", "01000000");
    exchange(card, "01D91A00035A 01CE000000001000 01CE0400 00000000 014E0000", "04001000");
    exchange(card, "01CE000000001000 014E0400", "00000000");
    exchange(card, ERASE_USER, "00001000");
    exchange(card, "01CE000000001000 014E0400", "FF7FFFFF");
    exchange(card, ERASE_USER, "00001000");
    exchange(card, "01CE000000001000 014E0400", "FFFFFFFF");
    const struct sim_flash_counts counts = sim_card_flash_counts(card);
    assert_int_equal(counts.operations, 4);
    assert_int_equal(counts.erases, 2);
    assert_int_equal(counts.programs, 2);
    assert_int_equal(counts.last_erase, USER);
    assert_int_equal(counts.sector0_erases, 0);
    sim_card_free(card);
}

static void a_card_without_power_is_deaf_and_keeps_its_flash(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i93");
    exchange(card, PROGRAM_USER, "08001000");
    sim_card_power_off(card);
    exchange(card, "01420001", "");
    assert_int_equal(sim_card_running(card), SIM_BOOT_NOTHING);
    assert_int_equal(sim_card_would_boot(card), SIM_BOOT_FALLBACK);
    sim_card_power_cycle(card);
    exchange(card, "01420001", ""); /* still starting */
    now_ns += 2000 * MS;
    exchange(card, "01CE000000001000 014E0400", "12345678");
    sim_card_free(card);
}

static void the_flash_may_be_the_callers(void **state)
{
    (void)state;
    static uint8_t memory[2 * SECTOR * 2];
    const struct sim_card_options options = {.profile = "7i93", .flash_id = 0x11};
    struct sim_card *const card = card_with(&options);
    size_t size;
    uint8_t *const own = sim_card_flash(card, &size);
    assert_int_equal(size, sizeof memory);
    memcpy(memory, own, size);
    assert_int_equal(sim_card_flash_memory(card, memory, sizeof memory - 1), HM2_ERR_RANGE);
    assert_int_equal(sim_card_flash_memory(card, memory, sizeof memory), 0);
    exchange(card, "014E0800", "11000000");
    exchange(card, "01D91A00035A 01CE000000000200 01CE0400 12345678 014E0000", "04000200");
    assert_int_equal(hm2_get_le32(memory + 2 * SECTOR), 0x78563412);
    assert_int_equal(sim_card_would_boot(card), SIM_BOOT_FALLBACK);
    sim_card_free(card);
}

/* ---- what starts ------------------------------------------------------------------------------------------------- */

static void a_new_card_runs_its_fallback_image_and_a_good_user_image_comes_first(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof profiles / sizeof profiles[0]; i++) {
        struct sim_card *const card = card_of(profiles[i]);
        assert_int_equal(sim_card_running(card), SIM_BOOT_FALLBACK);
        assert_int_equal(sim_card_would_boot(card), SIM_BOOT_FALLBACK);
        install(card, profiles[i], SIM_AREA_USER, 1);
        assert_int_equal(sim_card_running(card), SIM_BOOT_FALLBACK);
        assert_int_equal(sim_card_would_boot(card), SIM_BOOT_USER);
        sim_card_power_cycle(card);
        assert_int_equal(sim_card_running(card), SIM_BOOT_USER);
        sim_card_free(card);
    }
}

static void one_wrong_bit_anywhere_in_the_user_image_starts_the_fallback(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof profiles / sizeof profiles[0]; i++) {
        struct sim_card *const card = card_of(profiles[i]);
        const struct sim_flash_file file = {.profile = profiles[i], .bytes = 20000};
        const size_t len = sim_card_install(card, &file);
        uint8_t *const flash = sim_card_flash(card, NULL) + USER;
        /* From the sync word to the start command: line feeds and dummy words before it, no-operations after. */
        const size_t first = i == 0 ? 16 : strspn((const char *)flash, "\n"), last = i == 0 ? len - 28 : len;
        for (size_t at = first; at < last; at += at < first + 200 || at > last - 60 ? 1 : 997) {
            if (i == 0 && flash[at & ~(size_t)1] == 0x20 && flash[at | 1] == 0)
                continue; /* a no-operation, whatever its other bits are */
            flash[at] ^= 0x10;
            if (sim_card_would_boot(card) != SIM_BOOT_FALLBACK && !(i == 0 && at >= last - 8))
                fail_msg("%s byte %zu of %zu: %s", profiles[i], at, len, sim_boot_name(sim_card_would_boot(card)));
            flash[at] ^= 0x10;
        }
        assert_int_equal(sim_card_would_boot(card), SIM_BOOT_USER);
        sim_card_free(card);
    }
}

static void a_card_without_a_good_image_is_bricked(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof profiles / sizeof profiles[0]; i++) {
        struct sim_card *const card = card_of(profiles[i]);
        uint8_t *const flash = sim_card_flash(card, NULL);
        memset(flash + (i == 0 ? SECTOR : 0), 0xFF, SECTOR);
        assert_int_equal(sim_card_would_boot(card), SIM_BOOT_NOTHING);
        exchange(card, "01420001", "FECAAA55"); /* what runs goes on */
        sim_card_power_cycle(card);
        now_ns += 10000 * MS;
        exchange(card, "01420001", "");
        install(card, profiles[i], SIM_AREA_USER, 1); /* by JTAG */
        sim_card_power_cycle(card);
        now_ns += 2000 * MS;
        exchange(card, "01420001", "FECAAA55");
        sim_card_free(card);
    }
}

static void a_xilinx_card_needs_its_boot_block(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i93");
    install(card, "7i93", SIM_AREA_USER, 1);
    uint8_t *const flash = sim_card_flash(card, NULL);
    static const struct {
        unsigned at;
        enum sim_boot boot;
    } rows[] = {{10, SIM_BOOT_NOTHING},   /* sync word */
                {25, SIM_BOOT_FALLBACK},  /* bank of the user image */
                {33, SIM_BOOT_USER},      /* bank of the fallback, which is not needed */
                {49, SIM_BOOT_FALLBACK}}; /* the command to load again */
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        flash[rows[i].at] ^= 0x01;
        assert_int_equal(sim_card_would_boot(card), rows[i].boot);
        flash[rows[i].at] ^= 0x01;
    }
    memset(flash, 0xFF, SECTOR);
    assert_int_equal(sim_card_would_boot(card), SIM_BOOT_NOTHING);
    sim_card_free(card);
}

static void an_image_for_another_board_loads_and_leaves_the_card_deaf(void **state)
{
    (void)state;
    static const char *const other[] = {"7I92", "7I92T"};
    for (size_t i = 0; i < sizeof profiles / sizeof profiles[0]; i++) {
        struct sim_card *const card = card_of(profiles[i]);
        const struct sim_flash_file file = {.profile = profiles[i], .board = other[i], .bytes = 20000};
        assert_true(sim_card_install(card, &file) > 0);
        assert_int_equal(sim_card_would_boot(card), SIM_BOOT_OTHER_BOARD);
        sim_card_power_cycle(card);
        now_ns += 10000 * MS;
        exchange(card, "01420001", "");
        sim_card_jumpers(card, 3); /* helps Efinix cards alone */
        assert_int_equal(sim_card_would_boot(card), i == 0 ? SIM_BOOT_OTHER_BOARD : SIM_BOOT_FALLBACK);
        sim_card_free(card);
    }
}

static void an_image_for_another_fpga_is_not_loaded(void **state)
{
    (void)state;
    static const char *const other[] = {"7i80hd-16", "7i96s"};
    for (size_t i = 0; i < sizeof profiles / sizeof profiles[0]; i++) {
        struct sim_card *const card = card_of(profiles[i]);
        const struct sim_flash_file file = {.profile = other[i], .part = i == 0 ? NULL : "T120F324", .bytes = 20000};
        assert_true(sim_card_install(card, &file) > 0);
        assert_int_equal(sim_card_would_boot(card), SIM_BOOT_FALLBACK);
        sim_card_free(card);
    }
}

static void real_images_start_when_they_are_trusted(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof profiles / sizeof profiles[0]; i++) {
        struct sim_card *const card = card_of(profiles[i]);
        install(card, profiles[i], SIM_AREA_USER, 1);
        sim_card_flash(card, NULL)[USER + 5000] ^= 1; /* as if by another check sum */
        assert_int_equal(sim_card_would_boot(card), SIM_BOOT_FALLBACK);
        sim_card_trust_images(card, true);
        assert_int_equal(sim_card_would_boot(card), SIM_BOOT_USER);
        memset(sim_card_flash(card, NULL) + USER, 0xFF, SECTOR);
        assert_int_equal(sim_card_would_boot(card), SIM_BOOT_FALLBACK);
        sim_card_free(card);
    }
}

#define XILINX_RELOAD(bank)                                                                                         \
    "01D91E00FFFF 01D91E00FFFF 01D91E0099AA 01D91E006655 01D91E006132 01D91E000000 01D91E008132 01D91E00" bank "0B" \
    "01D91E00A130 01D91E000E00 01D91E000020 01D91E000020 01D91E000020 01D91E000020"

static void a_reload_starts_the_image_that_was_asked_for(void **state)
{
    (void)state;
    static const char *const to_user[] = {XILINX_RELOAD("00"), "01D91E000500 01D91E000D00"};
    static const char *const to_fallback[] = {XILINX_RELOAD("01"), "01D91E000400 01D91E000C00"};
    for (size_t i = 0; i < sizeof profiles / sizeof profiles[0]; i++) {
        struct sim_card *const card = card_of(profiles[i]);
        install(card, profiles[i], SIM_AREA_USER, 1);
        now_ns = 0;
        exchange(card, to_user[i], "");
        exchange(card, "01420001", "");
        now_ns += 2000 * MS;
        exchange(card, "01420001", "FECAAA55");
        assert_int_equal(sim_card_running(card), SIM_BOOT_USER);
        exchange(card, to_fallback[i], "");
        assert_int_equal(sim_card_running(card), SIM_BOOT_FALLBACK);
        now_ns += 2000 * MS;
        sim_card_flash(card, NULL)[USER + 300] ^= 1;
        exchange(card, to_user[i], "");
        assert_int_equal(sim_card_running(card), SIM_BOOT_FALLBACK);
        sim_card_free(card);
    }
}

static void the_jumpers_stand_in_the_information_area(void **state)
{
    (void)state;
    struct sim_card *const card = card_of("7i96s");
    install(card, "7i96s", SIM_AREA_USER, 1);
    sim_card_jumpers(card, 3);
    exchange(card, "015D1400", "0300");
    sim_card_power_cycle(card);
    now_ns += 2000 * MS;
    exchange(card, "015D1400", "0300");
    assert_int_equal(sim_card_running(card), SIM_BOOT_FALLBACK);
    sim_card_free(card);
}

/* ---- files ------------------------------------------------------------------------------------------------------- */

static void files_have_the_length_and_header_of_real_ones(void **state)
{
    (void)state;
    static const uint8_t bit[] = {0x00, 0x09, 0x0F, 0xF0, 0x0F, 0xF0, 0x0F, 0xF0, 0x0F, 0xF0, 0x00, 0x00, 0x01, 'a'};
    struct sim_flash_file file = {.profile = "7i93"};
    size_t len = sim_flash_file(&file, file_bytes, FILES);
    assert_in_range(len, 340604 + 100, 340604 + 110);
    assert_memory_equal(file_bytes, bit, sizeof bit);
    file.profile = "7i80hd-16";
    len = sim_flash_file(&file, file_bytes, FILES);
    assert_in_range(len, 464196 + 100, 464196 + 110);
    file.profile = "7i96s";
    assert_int_equal(sim_flash_file(&file, file_bytes, FILES), 678650);
    assert_memory_equal(file_bytes, "Version: ", 9);
    static const uint8_t sync[] = {0x0A, 0x16, 0x8A, 0x22, 0x36};
    assert_memory_equal(file_bytes + 255, sync, sizeof sync);
    assert_int_equal(hm2_get_le32(file_bytes + 0x148), 0);
    file.area = SIM_AREA_FALLBACK;
    assert_int_equal(sim_flash_file(&file, file_bytes, FILES), 680000);
    assert_int_equal(hm2_get_le32(file_bytes + 0x148), 0x0D00300D);
    assert_int_equal(sim_flash_file(&file, file_bytes, 680000 - 1), 0);
    file.profile = "7i00";
    assert_int_equal(sim_flash_file(&file, file_bytes, FILES), 0);
}

static void late_bytes_change_the_end_of_a_file_alone(void **state)
{
    (void)state;
    static uint8_t other[FILES];
    struct sim_flash_file file = {.profile = "7i93", .late_seed = 1, .late_bytes = 1000};
    const size_t len = sim_flash_file(&file, file_bytes, FILES);
    file.late_seed = 2;
    assert_int_equal(sim_flash_file(&file, other, FILES), len);
    assert_memory_equal(file_bytes, other, len - 1100);
    assert_memory_not_equal(file_bytes + len - 1100, other + len - 1100, 1100);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_chip_takes_the_times_of_its_data_sheet, fresh),
        cmocka_unit_test_setup(several_pages_of_a_datagram_are_waited_for_one_after_the_other, fresh),
        cmocka_unit_test_setup(a_chip_that_never_ends_makes_the_card_deaf_until_it_is_switched_off_and_on, fresh),
        cmocka_unit_test_setup(a_power_cut_in_a_page_leaves_the_bytes_before_it_and_none_behind, fresh),
        cmocka_unit_test_setup(a_power_cut_in_an_erase_leaves_neither_the_old_nor_a_blank_sector, fresh),
        cmocka_unit_test_setup(bad_bits_fail_as_often_as_was_said, fresh),
        cmocka_unit_test_setup(a_card_without_power_is_deaf_and_keeps_its_flash, fresh),
        cmocka_unit_test_setup(the_flash_may_be_the_callers, fresh),
        cmocka_unit_test_setup(a_new_card_runs_its_fallback_image_and_a_good_user_image_comes_first, fresh),
        cmocka_unit_test_setup(one_wrong_bit_anywhere_in_the_user_image_starts_the_fallback, fresh),
        cmocka_unit_test_setup(a_card_without_a_good_image_is_bricked, fresh),
        cmocka_unit_test_setup(a_xilinx_card_needs_its_boot_block, fresh),
        cmocka_unit_test_setup(an_image_for_another_board_loads_and_leaves_the_card_deaf, fresh),
        cmocka_unit_test_setup(an_image_for_another_fpga_is_not_loaded, fresh),
        cmocka_unit_test_setup(real_images_start_when_they_are_trusted, fresh),
        cmocka_unit_test_setup(a_reload_starts_the_image_that_was_asked_for, fresh),
        cmocka_unit_test_setup(the_jumpers_stand_in_the_information_area, fresh),
        cmocka_unit_test_setup(files_have_the_length_and_header_of_real_ones, fresh),
        cmocka_unit_test_setup(late_bytes_change_the_end_of_a_file_alone, fresh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
