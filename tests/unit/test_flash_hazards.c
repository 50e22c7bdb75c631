/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What the programmer refuses before it changes anything (flash tool reference 5; H1, H5 and H6 are in
 * test_flash_write.c, H4, H7, H14, H18 and H19 also with the program). */
#include "flash_rig.h"

#include <hm2/bytes.h>

/* ---- wrong images (H2, H3, H4, H8, H9) -----------------------------------------------------------------------------
 */

struct wrong {
    const char *why;
    struct sim_flash_file file;
    const char *name; /* of the file; NULL = the right one */
    bool fallback;    /* written with --fallback */
    const char *words;
};

static const struct wrong wrong_7i93[] = {
    {"another part", {.part = "6slx16ftg256"}, NULL, false, "wrong bitfile destination device: 6slx16ftg256"},
    {"an Efinix file", {.profile = "7i96s"}, NULL, false, "wrong bitfile destination device: T20F256"},
    {"another FPGA in its packets", {.idcode = 0x04002093}, NULL, false, "0x04002093"},
    {"a file for another card", {0}, "7i92_svst.bit", false, "for a 7I92, going by its file name"},
    {"a file for a longer name", {0}, "7I92T.bit", false, "for a 7I92T"},
    {"a file that names no card", {0}, "firmware.bit", false, "says what card it is for"},
    {"a design for PCI", {.design = "TopPCIHostMot2.ncd;UserID=0xFFFFFFFF"}, NULL, false, "TopPCIHostMot2"},
    {"multiboot", {.faults = SIM_FILE_MULTIBOOT}, NULL, false, "multiboot features"},
    {"no reset on error", {.faults = SIM_FILE_NO_RESET_ON_ERROR}, NULL, false, "reset_on_error"},
    {"no check sum", {.faults = SIM_FILE_NO_CRC}, NULL, false, "check sum"},
    {"half its size", {.bytes = 170000}, NULL, false, "have about 340884"},
    {"a fallback image", {0}, "7i93_fallback.bit", false, "to the user area"},
    {"a user image", {0}, "7i93_user.bit", true, "to the fallback area"},
};

static const struct wrong wrong_7i96s[] = {
    {"another part", {.part = "T8F81"}, NULL, false, "wrong bitfile destination device: T8F81"},
    {"a Xilinx file", {.profile = "7i93"}, NULL, false, "wrong bitfile destination device: 6slx9tqg144"},
    {"another card's project", {.project = "/a/7i92tdist"}, NULL, false, "for a 7I92T, going by its project"},
    {"another card's file name", {0}, "7i95t.bin", false, "for a 7I95T, going by its file name"},
    {"nobody's project", {.project = "/a/hostmot2"}, "f.bin", false, "says what card it is for"},
    {"a fallback image", {.area = SIM_AREA_FALLBACK}, NULL, false, "this is a fallback image"},
    {"a user image", {0}, NULL, true, "this is a user image"},
    {"half its size", {.bytes = 300000}, NULL, false, "have about 679155"},
    {"one byte too short", {.bytes = 678649}, NULL, false, "678393 bytes from its sync word on"},
    {"a fallback image's, too",
     {.area = SIM_AREA_FALLBACK, .bytes = 678649},
     NULL,
     true,
     "678393 bytes from its sync word on"},
};

static void refuse_all(struct flash_rig *const rig, const struct wrong *const rows, const size_t count)
{
    for (size_t i = 0; i < count; i++) {
        flash_rig_image(rig, 5, rows[i].fallback);
        const char *const right = rig->options.file_name;
        flash_rig_take(rig, &rows[i].file);
        rig->options.file_name = rows[i].name ? rows[i].name : right;
        rig->options.area = rows[i].fallback ? FLASH_FALLBACK : FLASH_USER;
        rig->options.confirmed = rows[i].fallback;
        flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, rows[i].words);
    }
}

static void refuses_wrong_images_for_a_xilinx_card(void **state)
{
    refuse_all(*state, wrong_7i93, sizeof wrong_7i93 / sizeof wrong_7i93[0]);
}

static void refuses_wrong_images_for_an_efinix_card(void **state)
{
    refuse_all(*state, wrong_7i96s, sizeof wrong_7i96s / sizeof wrong_7i96s[0]);
}

static void takes_names_in_any_spelling(void **state)
{
    struct flash_rig *const rig = *state;
    static const char *const names[] = {"7i93.bit", "/some/where/7I93_x.bit", "C:\\images\\7i93d.bit"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        rig->options.file_name = names[i];
        flash_rig_must_write(rig);
    }
}

static void a_list_of_known_images_tells_what_names_do_not(void **state)
{
    struct flash_rig *const rig = *state;
    rig->options.known_card = "7I96S";
    flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, "for a 7I96S, going by its entry in the list of known images");
    rig->options.file_name = "firmware.bit";
    rig->options.known_card = "7I93";
    flash_rig_must_write(rig);
}

static void an_override_must_name_the_card(void **state)
{
    struct flash_rig *const rig = *state;
    rig->options.file_name = "firmware.bit";
    rig->options.override = "7I96";
    flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, "the override names \"7I96\", and this card is a \"7I93\"");
    rig->options.override = "7i93";
    flash_rig_must_write(rig);
    flash_rig_take(rig, &(struct sim_flash_file){.part = "6slx16ftg256"});
    flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, "wrong bitfile destination device");
}

static void a_damaged_image_is_refused(void **state)
{
    struct flash_rig *const rig = *state;
    rig->file[rig->len / 2] ^= 0x08;
    assert_int_equal(flash_image_parse(rig->file, rig->len, &rig->image, &rig->diag), 0);
    flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, "the image is damaged: its contents do not fit the check sums");
    rig->options.override = "7I93"; /* the card starts its fallback image then */
    flash_rig_must_write(rig);
    assert_int_equal(sim_card_would_boot(rig->sim), SIM_BOOT_FALLBACK);
}

static void an_image_that_does_not_fit_is_refused(void **state)
{
    struct flash_rig *const rig = *state;
    const struct flash_image right = rig->image;
    rig->options.override = "7I93";
    rig->image.payload_bytes = 16u * RIG_SECTOR + 1;
    flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, "too large to fit");
    rig->options.area = FLASH_FALLBACK;
    rig->options.confirmed = true;
    rig->image.payload_bytes = 15u * RIG_SECTOR + 1;
    flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, "too large to fit");
    rig->image = right;
}

/* ---- the fallback image (H4)
 * ----------------------------------------------------------------------------------------- */

static void the_fallback_area_needs_a_confirmation(void **state)
{
    struct flash_rig *const rig = *state;
    flash_rig_must_write(rig);
    flash_rig_image(rig, 7, true);
    rig->options.area = FLASH_FALLBACK;
    flash_rig_assert_refused(rig, HM2_ERR_STATE, "--confirm fallback");
    rig->options.confirmed = true;
    flash_rig_must_write(rig);
    flash_rig_assert_image(rig, rig->xilinx ? RIG_SECTOR : 0);
}

static void the_only_image_is_not_erased(void **state)
{
    struct flash_rig *const rig = *state;
    flash_rig_image(rig, 7, true);
    rig->options.area = FLASH_FALLBACK;
    rig->options.confirmed = true;
    flash_rig_assert_refused(rig, HM2_ERR_STATE, "holds the only image that the card could start");
}

/* ---- what the card says and holds (H2, H7, H12)
 * ------------------------------------------------------------------------ */

static void a_card_with_the_other_familys_flash_is_refused(void **state)
{
    struct flash_rig *const rig = *state;
    static const uint8_t sync[] = {0x16, 0x8A, 0x22, 0x36};
    if (rig->xilinx) {
        memset(rig->flash, '\n', FLASH_PAGE_BYTES);
        memcpy(rig->flash + 80, sync, sizeof sync);
        rig->options.fix_boot_block = true;
    } else {
        flash_boot_block(flash_chip_of_id(0x14), rig->flash);
    }
    flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, "but sector 0 of its flash holds");
}

static void only_known_damage_of_the_boot_block_is_repaired(void **state)
{
    struct flash_rig *const rig = *state;
    uint8_t block[FLASH_BOOT_BLOCK_BYTES];
    flash_boot_block(flash_chip_of_id(0x14), block);
    memset(rig->flash, 0xFF, RIG_SECTOR);
    flash_rig_assert_refused(rig, HM2_ERR_STATE, "BootSector is invalid: sector 0 holds blank");
    rig->options.fix_boot_block = true;
    flash_rig_must_write(rig);
    assert_memory_equal(rig->flash, block, sizeof block);
    flash_boot_block(flash_chip_of_id(0x15), rig->flash);
    flash_rig_must_write(rig);
    assert_memory_equal(rig->flash, block, sizeof block);
    rig->flash[13] |= 0x99; /* an erase that was cut off */
    rig->flash[40] |= 0x02;
    flash_rig_must_write(rig);
    assert_memory_equal(rig->flash, block, sizeof block);
    memset(rig->flash, 0x55, FLASH_PAGE_BYTES);
    flash_rig_assert_refused(rig, HM2_ERR_STATE, "holds unknown data");
    rig->options.override = "7I93";
    flash_rig_must_write(rig);
    assert_memory_equal(rig->flash, block, sizeof block);
}

static void a_boot_block_is_never_offered_to_an_efinix_card(void **state)
{
    struct flash_rig *const rig = *state;
    memset(rig->flash, 0x55, FLASH_PAGE_BYTES);
    rig->options.fix_boot_block = true;
    flash_rig_must_write(rig);
    assert_int_equal(rig->flash[0], 0x55);
    assert_false(flash_job_plan(rig->job)->boot_block);
}

/* ---- others on the card (H10, H11)
 * ------------------------------------------------------------------------------------- */

struct neighbour {
    struct link *link; /* what the neighbour sends goes the same way */
    struct flash_rig *rig;
    int64_t next_ns;
};

/* A driver that sends two datagrams a millisecond; the hook is called when datagrams of ours arrive, and lets it catch
 * up. Its datagrams go to the card directly, so the card counts them and nobody gets the replies. */
static void drive(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    struct neighbour *const other = context;
    static const uint8_t request[] = {0x01, 0x42, 0x00, 0x01};
    uint8_t reply[64];
    (void)data;
    (void)len;
    const int64_t now_ns = link_now_ns(other->link);
    for (; !done && other->next_ns < now_ns; other->next_ns += 500000)
        (void)sim_card_packet(other->rig->sim, other->next_ns, request, sizeof request, reply, sizeof reply, NULL);
}

static void a_driver_on_the_same_card_is_noticed(void **state)
{
    struct flash_rig *const rig = *state;
    struct neighbour other = {
        .link = sim_net_link(rig->net), .rig = rig, .next_ns = link_now_ns(sim_net_link(rig->net))};
    const uint64_t read = flash_card_counters(rig->card).bytes_read;
    sim_net_on_taken(rig->net, drive, &other);
    flash_rig_assert_refused(rig, HM2_ERR_STATE, "another program talks to this card");
    assert_int_equal(flash_card_counters(rig->card).bytes_read, read); /* its address register was not moved */
    sim_net_on_taken(rig->net, NULL, NULL);
    flash_rig_must_write(rig);
}

static void scribble(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    static const uint8_t request[] = {0x01, 0xD9, 0x18, 0x00, 0x34, 0x12};
    struct neighbour *const other = context;
    uint8_t reply[64];
    (void)data;
    (void)len;
    if (done)
        (void)sim_card_packet(other->rig->sim, link_now_ns(other->link), request, sizeof request, reply, sizeof reply,
                              NULL);
}

static void another_tool_shows_in_the_scratch_register(void **state)
{
    struct flash_rig *const rig = *state;
    struct neighbour other = {.link = sim_net_link(rig->net), .rig = rig};
    sim_net_on_taken(rig->net, scribble, &other);
    flash_rig_assert_refused(rig, HM2_ERR_STATE, "uses the scratch register");
    sim_net_on_taken(rig->net, NULL, NULL);
}

static bool driver_starts(void *const context, const struct flash_progress *const now)
{
    struct neighbour *const other = context;
    if (now->phase == FLASH_WRITING && other->next_ns == 0) {
        other->next_ns = link_now_ns(other->link);
        sim_net_on_taken(other->rig->net, drive, other);
    }
    return true;
}

static void a_card_that_was_quiet_is_asked_again_when_somebody_comes(void **state)
{
    struct flash_rig *const rig = *state;
    struct link *const link = sim_net_link(rig->net);
    struct neighbour other = {.link = link, .rig = rig};
    assert_int_equal(flash_card_quiet(rig->card, &rig->diag), 0);
    const int64_t before_ns = link_now_ns(link);
    assert_int_equal(flash_card_quiet(rig->card, &rig->diag), 0); /* known */
    assert_int_equal(link_now_ns(link), before_ns);
    other.next_ns = before_ns;
    sim_net_on_taken(rig->net, drive, &other);
    uint32_t cookie;
    assert_int_equal(flash_card_read_hm2(rig->card, 0x100, 1, &cookie, &rig->diag), 0);
    sim_net_sleep_until(rig->net, before_ns + 5000000);
    assert_int_equal(flash_card_read_hm2(rig->card, 0x100, 1, &cookie, &rig->diag), 0);
    assert_int_equal(flash_card_quiet(rig->card, &rig->diag), HM2_ERR_STATE);
    sim_net_on_taken(rig->net, NULL, NULL);
}

static void a_driver_that_starts_meanwhile_ends_the_job(void **state)
{
    struct flash_rig *const rig = *state;
    struct neighbour other = {.link = sim_net_link(rig->net), .rig = rig};
    sim_card_flash_times(rig->sim, sim_flash_times_of("m25p16"));
    assert_int_equal(flash_job_write(&rig->job, rig->card, &rig->image, &rig->options, &rig->diag), 0);
    assert_int_equal(flash_job_run(rig->job, driver_starts, &other, &rig->diag), HM2_ERR_IO);
    assert_non_null(strstr(rig->diag.text, "another program has begun to talk"));
    sim_net_on_taken(rig->net, NULL, NULL);
    flash_rig_must_write(rig);
    flash_rig_assert_image(rig, RIG_USER);
}

/* Reading holds the card up as well: about a millisecond a datagram. */
static void a_driver_keeps_readers_away_too(void **state)
{
    struct flash_rig *const rig = *state;
    uint8_t *const dump = malloc(rig->flash_bytes);
    assert_non_null(dump);
    memcpy(dump, rig->flash, rig->flash_bytes);
    struct neighbour other = {
        .link = sim_net_link(rig->net), .rig = rig, .next_ns = link_now_ns(sim_net_link(rig->net))};
    const uint64_t read = flash_card_counters(rig->card).bytes_read;
    sim_net_on_taken(rig->net, drive, &other);
    const int results[] = {
        flash_job_verify(&rig->job, rig->card, &rig->image, &rig->options, &rig->diag),
        flash_job_verify_dump(&rig->job, rig->card, dump, rig->flash_bytes, &rig->options, &rig->diag),
        flash_job_backup(&rig->job, rig->card, dump, rig->flash_bytes, &rig->options, &rig->diag)};
    for (unsigned i = 0; i < sizeof results / sizeof results[0]; i++)
        assert_int_equal(results[i], HM2_ERR_STATE);
    assert_null(rig->job);
    assert_int_equal(flash_card_counters(rig->card).bytes_read, read);
    sim_net_on_taken(rig->net, NULL, NULL);
    free(dump);
}

static bool driver_starts_while_reading(void *const context, const struct flash_progress *const now)
{
    struct neighbour *const other = context;
    if (now->phase == FLASH_READING && other->next_ns == 0) {
        other->next_ns = link_now_ns(other->link);
        sim_net_on_taken(other->rig->net, drive, other);
    }
    return true;
}

static void a_driver_that_starts_meanwhile_ends_a_backup(void **state)
{
    struct flash_rig *const rig = *state;
    uint8_t *const dump = malloc(rig->flash_bytes);
    assert_non_null(dump);
    for (unsigned anyway = 0; anyway < 2; anyway++) {
        struct neighbour other = {.link = sim_net_link(rig->net), .rig = rig};
        rig->options.any_traffic = anyway;
        assert_int_equal(flash_job_backup(&rig->job, rig->card, dump, rig->flash_bytes, &rig->options, &rig->diag), 0);
        assert_int_equal(flash_job_run(rig->job, driver_starts_while_reading, &other, &rig->diag),
                         anyway ? 0 : HM2_ERR_STATE);
        assert_non_null(strstr(rig->diag.text, "has begun to talk to this card"));
        assert_non_null(strstr(rig->diag.text, "Nothing was changed"));
        sim_net_on_taken(rig->net, NULL, NULL);
        flash_job_free(rig->job);
        rig->job = NULL;
    }
    assert_memory_equal(dump, rig->flash, rig->flash_bytes);
    free(dump);
}

/* ---- a chip that nobody knows (H12)
 * ------------------------------------------------------------------------------------------------------- */

static void an_unknown_chip_is_never_written(void **state)
{
    struct flash_rig *const rig = *state;
    struct flash_survey survey;
    uint8_t bytes[64];
    assert_null(flash_card_info(rig->card)->chip);
    flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, "the flash chip's ID is 0x16 and the card gives its size as");
    rig->options.override = "7I93";
    flash_rig_assert_refused(rig, HM2_ERR_MISMATCH, "it can be read and not written");
    assert_int_equal(flash_job_restore(&rig->job, rig->card, rig->flash, rig->flash_bytes, &rig->options, &rig->diag),
                     HM2_ERR_MISMATCH);
    assert_int_equal(flash_job_verify(&rig->job, rig->card, &rig->image, &rig->options, &rig->diag), HM2_ERR_MISMATCH);
    assert_int_equal(flash_job_backup(&rig->job, rig->card, rig->flash, rig->flash_bytes, &rig->options, &rig->diag),
                     HM2_ERR_UNSUPPORTED);
    assert_int_equal(flash_card_survey(rig->card, &survey, &rig->diag), HM2_ERR_UNSUPPORTED);
    assert_int_equal(flash_card_read(rig->card, 0, bytes, sizeof bytes, &rig->diag), 0);
    assert_memory_equal(bytes, rig->flash, sizeof bytes);
}

/* ---- dumps (H13)
 * ------------------------------------------------------------------------------------------------------- */

static void a_dump_of_another_card_is_refused(void **state)
{
    struct flash_rig *const rig = *state;
    static uint8_t dump[2 * RIG_USER];
    struct flash_options options = {.confirmed = true};
    memset(dump, 0xFF, sizeof dump);
    if (rig->xilinx)
        memcpy(dump, (const uint8_t[]){0x0A, 0x16, 0x8A, 0x22, 0x36}, 5);
    else
        flash_boot_block(flash_chip_of_id(0x14), dump);
    assert_int_equal(flash_job_restore(&rig->job, rig->card, dump, sizeof dump, &options, &rig->diag),
                     HM2_ERR_MISMATCH);
    assert_int_equal(flash_job_restore(&rig->job, rig->card, dump, RIG_USER, &options, &rig->diag), HM2_ERR_MISMATCH);
    memset(dump, 0xFF, sizeof dump);
    hm2_diag_clear(&rig->diag);
    assert_int_equal(flash_job_restore(&rig->job, rig->card, dump, sizeof dump, &options, &rig->diag),
                     HM2_ERR_MISMATCH);
    assert_non_null(strstr(rig->diag.text, "no fallback image"));
    assert_null(rig->job);
}

/* ---- a chip that nobody sees (H15)
 * ------------------------------------------------------------------------------------------------------- */

static void cards_with_a_second_chip_name_its_jumper(void **state)
{
    (void)state;
    assert_string_equal(flash_board_of_card("7I76E-16")->second_chip, "W9");
    assert_string_equal(flash_board_of_card("7I76EU")->second_chip, "W7");
    unsigned others = 0;
    const struct flash_board *board;
    for (size_t i = 0; (board = flash_board_at(i)) != NULL; i++)
        others += board->second_chip == NULL;
    assert_int_equal(others, 18);
}

/* ---- replies (H17)
 * ------------------------------------------------------------------------------------------------------- */

static void late_and_foreign_replies_change_nothing(void **state)
{
    struct flash_rig *const rig = *state;
    const struct sim_faults faults = {.seed = 3, .duplicate = 0.2, .foreign = 0.1, .delay_max_ns = 40000000};
    assert_int_equal(sim_net_set_faults(rig->net, &faults), 0);
    rig->options.any_traffic = true; /* the stranger of this network sends to the card, too */
    flash_rig_must_write(rig);
    assert_true(flash_card_counters(rig->card).stale > 0);
    flash_rig_assert_image(rig, RIG_USER);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        ON_7I93(refuses_wrong_images_for_a_xilinx_card),
        ON_7I96S(refuses_wrong_images_for_an_efinix_card),
        ON_7I93(takes_names_in_any_spelling),
        ON_7I93(a_list_of_known_images_tells_what_names_do_not),
        ON_7I93(an_override_must_name_the_card),
        ON_7I93(a_damaged_image_is_refused),
        ON_7I93(an_image_that_does_not_fit_is_refused),
        ON_7I93(the_fallback_area_needs_a_confirmation),
        ON_7I96S(the_fallback_area_needs_a_confirmation),
        ON_7I93(the_only_image_is_not_erased),
        ON_7I96S(the_only_image_is_not_erased),
        ON_7I93(a_card_with_the_other_familys_flash_is_refused),
        ON_7I96S(a_card_with_the_other_familys_flash_is_refused),
        ON_7I93(only_known_damage_of_the_boot_block_is_repaired),
        ON_7I96S(a_boot_block_is_never_offered_to_an_efinix_card),
        ON_7I93(a_driver_on_the_same_card_is_noticed),
        ON_7I96S(another_tool_shows_in_the_scratch_register),
        ON_7I93(a_card_that_was_quiet_is_asked_again_when_somebody_comes),
        ON_7I93(a_driver_that_starts_meanwhile_ends_the_job),
        ON_7I93(a_driver_keeps_readers_away_too),
        ON_7I96S(a_driver_that_starts_meanwhile_ends_a_backup),
        cmocka_unit_test_setup_teardown(an_unknown_chip_is_never_written, flash_rig_unknown_chip, flash_rig_free),
        ON_7I93(a_dump_of_another_card_is_refused),
        ON_7I96S(a_dump_of_another_card_is_refused),
        cmocka_unit_test(cards_with_a_second_chip_name_its_jumper),
        ON_7I93(late_and_foreign_replies_change_nothing),
    };
    return cmocka_run_group_tests_name("flash hazards", tests, NULL, NULL);
}
