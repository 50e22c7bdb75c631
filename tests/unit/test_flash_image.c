/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Image files, checksum files, boot blocks, and the tables of cards and chips. */
#include "unit.h"

#include "../../lib/flash/image.h"
#include "boot.h"

#include <hm2/flash.h>
#include <hm2/sim_flash.h>

static uint8_t file[SIM_FLASH_FILE_BYTES];

static int parse(const size_t len, struct flash_image *const image, const char *const words)
{
    struct hm2_diag diag = {0};
    const int err = flash_image_parse(file, len, image, &diag);
    if (words && !strstr(diag.text, words))
        fail_msg("%d, without \"%s\": %s", err, words, diag.text);
    return err;
}

static size_t xilinx(void)
{
    return sim_flash_file(&(struct sim_flash_file){.profile = "7i93", .seed = 1}, file, sizeof file);
}

static size_t efinix(void)
{
    return sim_flash_file(&(struct sim_flash_file){.profile = "7i96s", .seed = 1}, file, sizeof file);
}

static void takes_a_bit_file_apart(void **state)
{
    struct flash_image image;
    (void)state;
    const size_t len = xilinx();
    assert_int_equal(parse(len, &image, NULL), 0);
    assert_int_equal(image.family, FLASH_XILINX);
    assert_string_equal(image.part, "6slx9tqg144");
    assert_int_equal(strncmp(image.design, "TopEthernetHostMot2", 19), 0);
    assert_int_equal(image.idcode, 0x04001093);
    assert_int_equal(image.hazards, 0);
    assert_int_equal(image.sync_at, 16);
    assert_ptr_equal(image.payload + image.payload_bytes, file + len);
}

/* Both check sums of bit files that Xilinx's own tool made: the one behind the frames, and that at the end, after six
 * words more. (spiOverJtag of xc6slx9tqg144, -16ftg256, -45csg324, -100fgg484 and -150tfgg484, as in Debian's
 * openfpgaloader 0.10.0; their whole contents give the first ones, too.) */
static void the_check_sum_is_that_of_real_files(void **state)
{
    static const uint32_t sums[][2] = {
        {0x0A727E, 0x1C8B42}, {0x1C667A, 0x13E154}, {0x364AAE, 0x0F617E}, {0x3FAE2F, 0x3255B7}, {0x3DE7C2, 0x210FF5}};
    static const unsigned between[][2] = {{5, 0x0A}, {5, 3}, {5, 0x0A}, {5, 5}, {7, 0xFF}, {6, 0x81}};
    (void)state;
    for (size_t i = 0; i < sizeof sums / sizeof sums[0]; i++) {
        uint32_t crc = sums[i][0], of_the_card = sums[i][0];
        for (size_t j = 0; j < sizeof between / sizeof between[0]; j++) {
            crc = flash_spartan6_crc(crc, between[j][0], between[j][1]);
            of_the_card = sim_spartan6_crc(of_the_card, between[j][0], between[j][1]);
        }
        assert_int_equal(crc, sums[i][1]);
        assert_int_equal(of_the_card, sums[i][1]);
    }
}

/* H18 */
static void finds_one_wrong_bit_anywhere_in_a_bit_file(void **state)
{
    struct flash_image image;
    (void)state;
    const size_t len = xilinx();
    assert_int_equal(parse(len, &image, NULL), 0);
    const size_t packets = (size_t)(image.payload - file) + image.sync_at + 4, end = len - 28; /* no-operations */
    unsigned damaged = 0;
    for (size_t at = packets; at < end; at += at < packets + 80 || at > end - 40 ? 1 : 1009) {
        const size_t even = at - (at - packets) % 2;
        if (file[even] == 0x20 && file[even + 1] == 0)
            continue; /* a no-operation, whatever its other bits are */
        file[at] ^= 0x10;
        assert_int_equal(parse(len, &image, NULL), 0);
        if (image.hazards == 0)
            fail_msg("byte %zu of %zu", at, len);
        damaged += (image.hazards & FLASH_HAZARD_DAMAGED) != 0;
        file[at] ^= 0x10;
    }
    assert_true(damaged > 350);
}

static void takes_an_efinix_file_apart(void **state)
{
    struct flash_image image;
    (void)state;
    const size_t len = efinix();
    assert_int_equal(parse(len, &image, NULL), 0);
    assert_int_equal(image.family, FLASH_EFINIX);
    assert_string_equal(image.part, "T20F256");
    assert_string_equal(image.mode, "active");
    assert_ptr_equal(image.payload + image.sync_at, file + 256);
    assert_int_equal(image.payload[0], '\n'); /* the line feeds belong to it */
    assert_false(image.pointers);
    const size_t fallback =
        sim_flash_file(&(struct sim_flash_file){.profile = "7i96s", .area = SIM_AREA_FALLBACK}, file, sizeof file);
    assert_int_equal(parse(fallback, &image, NULL), 0);
    assert_true(image.pointers);
}

/* Every file that ends too early is refused, whatever is missing. */
static void refuses_every_shortened_file(void **state)
{
    struct flash_image image;
    (void)state;
    for (unsigned kind = 0; kind < 2; kind++) {
        const size_t len = kind ? efinix() : xilinx();
        for (size_t cut = 0; cut < (kind ? 336u : 400u); cut++)
            assert_int_not_equal(parse(cut, &image, NULL), 0);
        if (!kind)
            assert_int_equal(parse(len - 1, &image, "it is cut off or damaged"), HM2_ERR_MALFORMED);
    }
}

static void refuses_a_file_with_more_than_it_announces(void **state)
{
    struct flash_image image;
    (void)state;
    const size_t len = xilinx();
    assert_int_equal(parse(len + 1, &image, "it is cut off or damaged"), HM2_ERR_MALFORMED);
}

static void refuses_each_wrong_byte_of_a_header(void **state)
{
    struct flash_image image;
    (void)state;
    const size_t len = xilinx();
    for (size_t i = 0; i < 14; i++) {
        file[i] ^= 0x40;
        assert_int_not_equal(parse(len, &image, NULL), 0);
        file[i] ^= 0x40;
    }
    assert_int_equal(parse(len, &image, NULL), 0);
}

/* H16: the lengths in a header are the file's word only. */
static void refuses_lengths_beyond_the_file_and_cuts_long_texts(void **state)
{
    enum { FIRST_TEXT = 13, LONG = 300 };
    static uint8_t crafted[sizeof file + LONG];
    struct flash_image image;
    (void)state;
    const size_t len = xilinx();
    for (size_t at = FIRST_TEXT, i = 0; i < 4; i++) {
        const size_t text = (size_t)file[at + 1] << 8 | file[at + 2];
        assert_int_equal(file[at], 'a' + i);
        file[at + 1] = 0xFF;
        file[at + 2] = 0xFF;
        assert_int_equal(flash_image_parse(file, at + 3 + text, &image, NULL), HM2_ERR_MALFORMED);
        assert_int_equal(parse(len, &image, "field"), HM2_ERR_MALFORMED);
        file[at + 1] = (uint8_t)(text >> 8);
        file[at + 2] = (uint8_t)text;
        at += 3 + text;
    }
    const size_t text = (size_t)file[FIRST_TEXT + 1] << 8 | file[FIRST_TEXT + 2]; /* now a long one, without an end */
    memcpy(crafted, file, FIRST_TEXT + 3);
    crafted[FIRST_TEXT + 1] = LONG >> 8;
    crafted[FIRST_TEXT + 2] = LONG & 0xFF;
    memset(crafted + FIRST_TEXT + 3, 0xC3, LONG);
    memcpy(crafted + FIRST_TEXT + 3 + LONG, file + FIRST_TEXT + 3 + text, len - FIRST_TEXT - 3 - text);
    assert_int_equal(flash_image_parse(crafted, len - text + LONG, &image, NULL), 0);
    assert_int_equal(strlen(image.design), FLASH_TEXT_BYTES - 1);
    assert_int_equal(strspn(image.design, "?"), FLASH_TEXT_BYTES - 1);
    assert_string_equal(image.part, "6slx9tqg144");
}

static void refuses_efinix_files_that_cannot_start_from_flash(void **state)
{
    static const struct {
        struct sim_flash_file file;
        const char *words;
    } rows[] = {
        {{.profile = "7i96s", .mode = "passive"}, "Mode is \"passive\""},
        {{.profile = "7i96s", .series = "Titanium"}, "Family is \"Titanium\""},
        {{.profile = "7i96s", .width = "4"}, "Width is \"4\""},
        {{.profile = "7i96s", .padded_bits = "3"}, "PADDED_BITS is \"3\""},
        {{.profile = "7i96s", .faults = SIM_FILE_NO_SYNC}, "no sync word"},
        {{.profile = "7i93", .faults = SIM_FILE_NO_SYNC}, "sync word AA995566"},
    };
    struct flash_image image;
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_int_equal(parse(sim_flash_file(&rows[i].file, file, sizeof file), &image, rows[i].words),
                         HM2_ERR_MALFORMED);
}

static void refuses_other_kinds_of_files(void **state)
{
    struct flash_image image;
    (void)state;
    memset(file, 0xFF, 64);
    assert_int_equal(parse(64, &image, "raw .bin"), HM2_ERR_UNSUPPORTED);
    memcpy(file, "56\n65\n72\n73\n69\n6F\n6E\n", sizeof "56\n65\n72\n73\n69\n6F\n6E\n");
    assert_int_equal(parse(21, &image, ".hex file"), HM2_ERR_UNSUPPORTED);
    memset(file, 0, 64);
    assert_int_equal(parse(64, &image, "neither a Xilinx .bit nor an Efinix .bin"), HM2_ERR_MALFORMED);
    assert_int_equal(parse(13, &image, "ends after 13 bytes"), HM2_ERR_MALFORMED);
}

static void fills_the_last_page_as_mesaflash_does(void **state)
{
    struct flash_image image;
    (void)state;
    (void)parse(xilinx(), &image, NULL);
    const size_t len = image.payload_bytes;
    assert_int_equal(flash_image_byte(&image, len), image.payload[len - 8192]);
    assert_int_equal(flash_image_byte(&image, len + 100), image.payload[len + 100 - 8192]);
    image.payload_bytes = 100; /* nothing to repeat yet */
    assert_int_equal(flash_image_byte(&image, 100), 0xFF);
}

static void reads_checksum_files(void **state)
{
    static const char digits[] = "0123456789abcdefABCDEF0123456789abcdefABCDEF0123456789abcdefABCD";
    static const struct {
        const char *end;
        int err;
    } rows[] = {{"", 0}, {" *./f.bin\n", 0}, {"\n", 0}, {"  f", 0}, {"0", HM2_ERR_MALFORMED}};
    uint8_t hash[FLASH_SHA256_BYTES];
    char text[96];
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const int len = snprintf(text, sizeof text, "%s%s", digits, rows[i].end);
        assert_int_equal(flash_side_file_parse(text, (size_t)len, hash, NULL), rows[i].err);
    }
    assert_int_equal(hash[1], 0x23);
    assert_int_equal(hash[31], 0xCD);
    struct hm2_diag diag = {0};
    assert_int_equal(flash_side_file_parse(digits, 63, hash, &diag), HM2_ERR_MALFORMED);
    text[9] = 'g';
    assert_int_equal(flash_side_file_parse(text, 64, hash, &diag), HM2_ERR_MALFORMED);
    assert_non_null(strstr(diag.text, "character 10 "));
}

static void looks_images_up_in_a_list(void **state)
{
#define ZEROS "00000000000000000000000000000000000000000000000000000000000000"
    static const char list[] = "# known images\n\n" ZEROS "01 7I92 \r\n" ZEROS "02  7I93\n" ZEROS "03 7I96S";
    static const char *const cards[] = {NULL, "7I92", "7I93", "7I96S"};
    uint8_t hash[FLASH_SHA256_BYTES] = {0};
    char card[FLASH_TEXT_BYTES];
    struct hm2_diag diag = {0};
    (void)state;
    for (unsigned i = 0; i < 4; i++) {
        hash[FLASH_SHA256_BYTES - 1] = (uint8_t)i;
        assert_int_equal(flash_known_image(list, sizeof list - 1, hash, card, &diag), cards[i] ? 1 : 0);
        if (cards[i])
            assert_string_equal(card, cards[i]);
    }
    static const char *const bad[] = {"\n" ZEROS "01\n", "\nabc 7I92\n", "\n" ZEROS "01x\n", "\n" ZEROS "01 7I\0019"};
    for (unsigned i = 0; i < 4; i++) {
        hm2_diag_clear(&diag);
        assert_int_equal(flash_known_image(bad[i], strlen(bad[i]), hash, card, &diag), HM2_ERR_MALFORMED);
        assert_non_null(strstr(diag.text, "line 2 "));
    }
#undef ZEROS
}

static void knows_all_cards_exactly(void **state)
{
    (void)state;
    assert_int_equal(flash_board_at(20) == NULL && flash_board_at(19) != NULL, true);
    assert_string_equal(flash_board_of_card("7I76E-16")->device, "7I76E");
    assert_null(flash_board_of_card("7I76E"));
    assert_null(flash_board_of_card("7i96s"));
    assert_null(flash_board_of_card("7I96SX"));
    assert_string_equal(flash_board_of_card("LiteHM2")->device, "LITEHM2");
    assert_int_equal(flash_board_of_card("7I92")->family, FLASH_XILINX);
    assert_int_equal(flash_board_of_card("7I92T")->family, FLASH_EFINIX);
    assert_string_equal(flash_board_named("7i92tdist")->device, "7I92T");
    assert_null(flash_board_named("hostmot2"));
}

static void knows_where_the_areas_are(void **state)
{
    const struct flash_chip *const chip = flash_chip_of_id(0x14);
    (void)state;
    assert_null(flash_chip_of_id(0x16));
    assert_int_equal(flash_area_range(FLASH_XILINX, chip, FLASH_USER).start, 0x100000);
    assert_int_equal(flash_area_range(FLASH_XILINX, chip, FLASH_FALLBACK).start, 0x10000);
    assert_int_equal(flash_area_range(FLASH_XILINX, chip, FLASH_FALLBACK).bytes, 15 * 65536);
    assert_int_equal(flash_area_range(FLASH_EFINIX, chip, FLASH_FALLBACK).start, 0);
    assert_int_equal(flash_area_range(FLASH_EFINIX, chip, FLASH_FALLBACK).bytes, 16 * 65536);
}

/* Flash tool reference 3.8: byte 25 is the bank of the user area. */
static void the_boot_block_leads_to_the_user_area(void **state)
{
    static const uint8_t banks[] = {0x01, 0x02, 0x04, 0x08, 0x10, 0x20};
    uint8_t page[2 * FLASH_PAGE_BYTES] = {0};
    (void)state;
    for (unsigned i = 0; i < sizeof banks; i++) {
        const struct flash_chip *const chip = flash_chip_of_id((uint8_t)(0x10 + i));
        flash_boot_block(chip, page);
        assert_int_equal(page[25], banks[i]);
        assert_int_equal(flash_content_of(chip, page), FLASH_BOOT_BLOCK);
        assert_int_equal(flash_content_of(flash_chip_of_id((uint8_t)(0x10 + (i + 1) % 6)), page),
                         FLASH_BOOT_OTHER_SIZE);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(takes_a_bit_file_apart),
        cmocka_unit_test(the_check_sum_is_that_of_real_files),
        cmocka_unit_test(finds_one_wrong_bit_anywhere_in_a_bit_file),
        cmocka_unit_test(takes_an_efinix_file_apart),
        cmocka_unit_test(refuses_every_shortened_file),
        cmocka_unit_test(refuses_a_file_with_more_than_it_announces),
        cmocka_unit_test(refuses_each_wrong_byte_of_a_header),
        cmocka_unit_test(refuses_efinix_files_that_cannot_start_from_flash),
        cmocka_unit_test(refuses_other_kinds_of_files),
        cmocka_unit_test(fills_the_last_page_as_mesaflash_does),
        cmocka_unit_test(reads_checksum_files),
        cmocka_unit_test(looks_images_up_in_a_list),
        cmocka_unit_test(refuses_lengths_beyond_the_file_and_cuts_long_texts),
        cmocka_unit_test(knows_all_cards_exactly),
        cmocka_unit_test(knows_where_the_areas_are),
        cmocka_unit_test(the_boot_block_leads_to_the_user_area),
    };
    return cmocka_run_group_tests_name("flash images", tests, NULL, NULL);
}
