/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The flash programmer on simulated cards, in virtual time: what it writes, what it leaves alone, what it survives. */
#include "flash_rig.h"

#include <hm2/bytes.h>
#include <hm2/lbp16.h>

/* Answers that mesaflash waits for to do the same (flash tool reference 4.2). */
static uint64_t mesaflash_waits(const struct flash_rig *const rig)
{
    const uint64_t pages = (rig->image.payload_bytes + FLASH_PAGE_BYTES - 1) / FLASH_PAGE_BYTES;
    const uint64_t sectors = (rig->image.payload_bytes + RIG_SECTOR - 1) / RIG_SECTOR;
    return 3 + (rig->xilinx ? 2u : 0u) + sectors + 2 * pages;
}

static void writes_an_image_and_its_filler(void **state)
{
    struct flash_rig *const rig = *state;
    const struct flash_counters before = flash_card_counters(rig->card);
    flash_rig_must_write(rig);
    const struct flash_counters after = flash_card_counters(rig->card);
    flash_rig_assert_image(rig, RIG_USER);
    const size_t end = (rig->image.payload_bytes + 255) / 256 * 256;
    for (size_t i = rig->image.payload_bytes; i < end; i++)
        assert_int_equal(rig->flash[RIG_USER + i], rig->image.payload[i - 8192]);
    assert_int_equal(after.erases, 0); /* a blank area needs none */
    assert_true(5 * (after.sent - before.sent) <= mesaflash_waits(rig));
}

static void replaces_an_image(void **state)
{
    struct flash_rig *const rig = *state;
    memset(rig->flash + RIG_USER, 0, (size_t)11 * RIG_SECTOR);
    const struct flash_counters before = flash_card_counters(rig->card);
    flash_rig_must_write(rig);
    const struct flash_counters after = flash_card_counters(rig->card);
    flash_rig_assert_image(rig, RIG_USER);
    assert_int_equal(after.erases, (rig->image.payload_bytes + RIG_SECTOR - 1) / RIG_SECTOR);
    assert_true(5 * (after.sent - before.sent) <= mesaflash_waits(rig));
}

static void leaves_a_right_image_alone(void **state)
{
    struct flash_rig *const rig = *state;
    flash_rig_must_write(rig);
    const struct flash_counters before = flash_card_counters(rig->card);
    flash_rig_must_write(rig);
    const struct flash_counters after = flash_card_counters(rig->card);
    assert_int_equal(after.erases, before.erases);
    assert_int_equal(after.pages, before.pages);
    assert_int_equal(flash_job_plan(rig->job)->to_write, 0);
}

static void erases_only_the_sector_that_changed_and_the_key(void **state)
{
    struct flash_rig *const rig = *state;
    flash_rig_must_write(rig);
    rig->flash[RIG_USER + 3 * RIG_SECTOR + 1234] = (uint8_t)~rig->flash[RIG_USER + 3 * RIG_SECTOR + 1234];
    const struct flash_counters before = flash_card_counters(rig->card);
    flash_rig_must_write(rig);
    const struct flash_counters after = flash_card_counters(rig->card);
    flash_rig_assert_image(rig, RIG_USER);
    assert_int_equal(after.erases - before.erases, 2);
    assert_int_equal(after.pages - before.pages, 512);
}

/* ---- the order of things ------------------------------------------------------------------------------------------
 */

struct trace {
    struct flash_rig *rig;
    unsigned erases, writes;
    uint32_t first_erase, last_write;
    bool bad;
};

/* One datagram: erases carry their address and echo, and no two erases or an erase and a write come together (H1). */
static void note(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    struct trace *const trace = context;
    struct lbp16_parser parser;
    struct lbp16_command command;
    const uint8_t *payload;
    size_t payload_len;
    bool truncated, enabled = false, addressed = false, erased = false, echoed = false;
    uint32_t address = 0;
    if (done)
        return;
    lbp16_parser_init(&parser, data, len);
    while (lbp16_parser_next(&parser, &command, &payload, &payload_len, &truncated) > 0) {
        if (command.space == LBP16_SPACE_CONTROL && command.write && command.address == LBP16_CONTROL_WRITE_ENABLE)
            enabled = true;
        if (command.space != LBP16_SPACE_FLASH || command.info)
            continue;
        if (command.address == LBP16_FLASH_ADDRESS && command.write) {
            address = hm2_get_le32(payload);
            addressed = true;
        } else if (command.address == LBP16_FLASH_ADDRESS) {
            echoed = true;
        } else if (command.address == LBP16_FLASH_ERASE) {
            trace->bad = trace->bad || erased || !addressed || !enabled || address % RIG_SECTOR;
            erased = true;
            if (trace->erases++ == 0)
                trace->first_erase = address;
        } else if (command.address == LBP16_FLASH_DATA && command.write) {
            trace->bad = trace->bad || erased || !addressed || !enabled || command.count != 64;
            trace->writes++;
            trace->last_write = address;
        }
    }
    trace->bad = trace->bad || (erased && !echoed);
}

static void makes_the_image_invalid_first_and_valid_last(void **state)
{
    struct flash_rig *const rig = *state;
    struct trace trace = {.rig = rig};
    flash_rig_must_write(rig);
    flash_rig_image(rig, 2, false);
    sim_net_on_taken(rig->net, note, &trace);
    flash_rig_must_write(rig);
    sim_net_on_taken(rig->net, NULL, NULL);
    flash_rig_assert_image(rig, RIG_USER);
    assert_false(trace.bad);
    assert_int_equal(trace.first_erase, RIG_USER);
    assert_int_equal(trace.last_write, RIG_USER);
    assert_true(trace.erases >= 6 && trace.writes >= 1331);
}

/* ---- interruptions --------------------------------------------------------------------------------------------------
 */

struct cut {
    struct flash_rig *rig;
    unsigned left;
};

static void cut_off(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    struct cut *const cut = context;
    (void)data;
    (void)len;
    if (done && cut->left > 0 && --cut->left == 0)
        sim_net_freeze(cut->rig->net, true);
}

/* The network ends somewhere; the fallback image is untouched, and the next run completes the image. */
static void goes_on_after_the_network_was_cut(void **state)
{
    struct flash_rig *const rig = *state;
    static uint8_t lower[RIG_USER];
    flash_rig_must_write(rig);
    memcpy(lower, rig->flash, sizeof lower);
    for (unsigned at = 10; at < 250; at += 31) {
        struct cut cut = {rig, at};
        flash_rig_image(rig, at, false);
        sim_net_on_taken(rig->net, cut_off, &cut);
        assert_int_equal(flash_rig_write(rig), HM2_ERR_TIMEOUT);
        sim_net_on_taken(rig->net, NULL, NULL);
        sim_net_freeze(rig->net, false);
        flash_rig_reopen(rig);
        flash_rig_must_write(rig);
        flash_rig_assert_image(rig, RIG_USER);
        assert_memory_equal(lower, rig->flash, sizeof lower);
    }
}

static void an_incomplete_image_has_no_sync_word(void **state)
{
    struct flash_rig *const rig = *state;
    flash_rig_must_write(rig);
    for (unsigned at = 30; at < 250; at += 43) {
        struct cut cut = {rig, at};
        flash_rig_image(rig, at, false);
        sim_net_on_taken(rig->net, cut_off, &cut);
        assert_int_equal(flash_rig_write(rig), HM2_ERR_TIMEOUT);
        sim_net_on_taken(rig->net, NULL, NULL);
        sim_net_freeze(rig->net, false);
        assert_int_equal(flash_content_of(flash_chip_of_id(0x14), rig->flash + RIG_USER), FLASH_BLANK);
        flash_rig_reopen(rig);
    }
}

static bool stop_in_the_middle(void *const context, const struct flash_progress *const now)
{
    (void)context;
    return now->phase != FLASH_WRITING || now->done < 700;
}

static void stops_between_two_sectors(void **state)
{
    struct flash_rig *const rig = *state;
    memset(rig->flash + RIG_USER, 0, (size_t)11 * RIG_SECTOR);
    assert_int_equal(flash_job_write(&rig->job, rig->card, &rig->image, &rig->options, &rig->diag), 0);
    assert_int_equal(flash_job_run(rig->job, stop_in_the_middle, NULL, &rig->diag), HM2_ERR_IO);
    assert_non_null(strstr(rig->diag.text, "do not switch the card off"));
    for (uint32_t sector = 1; sector <= 3; sector++)
        assert_memory_equal(rig->flash + RIG_USER + sector * RIG_SECTOR, rig->image.payload + sector * RIG_SECTOR,
                            RIG_SECTOR);
    flash_rig_must_write(rig);
    flash_rig_assert_image(rig, RIG_USER);
}

/* ---- bad networks, bad chips
 * ------------------------------------------------------------------------------------------ */

static void survives_a_bad_network(void **state)
{
    struct flash_rig *const rig = *state;
    static uint8_t lower[RIG_USER];
    memcpy(lower, rig->flash, sizeof lower);
    for (uint64_t seed = 1; seed <= 8; seed++) {
        const struct sim_faults faults = {
            .seed = seed, .loss = 0.05, .duplicate = 0.03, .reorder = 0.02, .truncate = 0.01, .delay_max_ns = 2000000};
        flash_rig_image(rig, seed, false);
        assert_int_equal(sim_net_set_faults(rig->net, &faults), 0);
        const int err = flash_rig_write(rig);
        assert_int_equal(sim_net_set_faults(rig->net, &(struct sim_faults){.seed = seed}), 0);
        if (err != 0)
            fail_msg("seed %u: %d: %s", (unsigned)seed, err, rig->diag.text);
        flash_rig_assert_image(rig, RIG_USER);
        assert_memory_equal(lower, rig->flash, sizeof lower);
    }
}

static void spoil_once(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    struct cut *const cut = context;
    (void)data;
    (void)len;
    if (!done && cut->left > 0 && --cut->left == 0)
        cut->rig->flash[RIG_USER + 2 * RIG_SECTOR + 600] = 0; /* a bit that should stay one */
}

static void mends_a_sector_that_was_spoilt(void **state)
{
    struct flash_rig *const rig = *state;
    struct cut cut = {rig, 150};
    rig->file[rig->image.payload - rig->file + 2 * RIG_SECTOR + 600] = 0xFF;
    sim_net_on_taken(rig->net, spoil_once, &cut);
    flash_rig_must_write(rig);
    sim_net_on_taken(rig->net, NULL, NULL);
    flash_rig_assert_image(rig, RIG_USER);
}

static void spoil_always(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    (void)data;
    (void)len;
    (void)done;
    ((struct flash_rig *)context)->flash[RIG_USER + 2 * RIG_SECTOR + 600] = 0;
}

static void gives_up_on_a_worn_chip(void **state)
{
    struct flash_rig *const rig = *state;
    rig->file[rig->image.payload - rig->file + 2 * RIG_SECTOR + 600] = 0xFF;
    sim_net_on_taken(rig->net, spoil_always, rig);
    assert_int_equal(flash_rig_write(rig), HM2_ERR_IO);
    sim_net_on_taken(rig->net, NULL, NULL);
    assert_non_null(strstr(rig->diag.text, "0x120258 expected 0xFF but read 0x00"));
}

/* ---- reading -------------------------------------------------------------------------------------------------------
 */

static void read_all(struct flash_rig *const rig, uint8_t *const dump)
{
    flash_job_free(rig->job);
    rig->job = NULL;
    int err = flash_job_backup(&rig->job, rig->card, dump, rig->flash_bytes, &rig->options, &rig->diag);
    if (err == 0)
        err = flash_job_run(rig->job, NULL, NULL, &rig->diag);
    if (err != 0)
        fail_msg("%d: %s", err, rig->diag.text);
    assert_memory_equal(dump, rig->flash, rig->flash_bytes);
}

static void reads_with_several_requests_ahead_until_one_is_lost(void **state)
{
    struct flash_rig *const rig = *state;
    const struct sim_faults faults = {.seed = 5, .loss = 0.01};
    uint8_t *const dump = calloc(1, rig->flash_bytes);
    assert_non_null(dump);
    read_all(rig, dump);
    const struct flash_counters before = flash_card_counters(rig->card);
    assert_int_equal(before.requests_ahead, 4);
    assert_int_equal(before.foreign, 0);
    assert_int_equal(before.resent, 0);
    assert_int_equal(sim_net_set_faults(rig->net, &faults), 0);
    memset(dump, 0, rig->flash_bytes);
    read_all(rig, dump);
    const struct flash_counters after = flash_card_counters(rig->card);
    assert_int_equal(after.requests_ahead, 1);
    assert_true(after.resent > 0);
    assert_int_equal(after.foreign, 0); /* what was lost is not taken for another program */
    free(dump);
}

static void answers_may_come_in_any_order_and_twice(void **state)
{
    struct flash_rig *const rig = *state;
    uint8_t *const dump = calloc(1, rig->flash_bytes);
    assert_non_null(dump);
    for (uint64_t seed = 1; seed <= 5; seed++) {
        const struct sim_faults faults = {
            .seed = seed, .duplicate = 0.05, .reorder = 0.05, .truncate = 0.001 * (double)seed, .delay_max_ns = 900000};
        flash_rig_reopen(rig);
        assert_int_equal(sim_net_set_faults(rig->net, &faults), 0);
        memset(dump, 0, rig->flash_bytes);
        read_all(rig, dump);
        assert_int_equal(sim_net_set_faults(rig->net, &(struct sim_faults){.seed = seed}), 0);
    }
    free(dump);
}

static void does_not_read_what_is_erased_anyway(void **state)
{
    struct flash_rig *const rig = *state;
    flash_rig_must_write(rig);
    flash_rig_take(rig, &(struct sim_flash_file){.seed = 1, .late_seed = 7, .late_bytes = 2000});
    const uint64_t read = flash_card_counters(rig->card).bytes_read;
    flash_rig_must_write(rig);
    flash_rig_assert_image(rig, RIG_USER);
    const size_t unchanged = (rig->image.payload_bytes / RIG_SECTOR - 1) * RIG_SECTOR; /* neither key nor last */
    assert_in_range(flash_card_counters(rig->card).bytes_read - read, unchanged, unchanged + RIG_SECTOR);
    const uint64_t again = flash_card_counters(rig->card).bytes_read;
    flash_rig_must_write(rig); /* nothing to do, which only all of it can tell */
    assert_in_range(flash_card_counters(rig->card).bytes_read - again, rig->image.payload_bytes,
                    rig->image.payload_bytes + 8000);
}

/* ---- other jobs ----------------------------------------------------------------------------------------------------
 */

static void verifies_and_finds_the_first_difference(void **state)
{
    struct flash_rig *const rig = *state;
    flash_rig_must_write(rig);
    for (unsigned wrong = 0; wrong < 2; wrong++) {
        rig->flash[RIG_USER + 0x4B] ^= wrong ? 0x0F : 0;
        flash_job_free(rig->job);
        rig->job = NULL;
        assert_int_equal(flash_job_verify(&rig->job, rig->card, &rig->image, &rig->options, &rig->diag), 0);
        assert_int_equal(flash_job_run(rig->job, NULL, NULL, &rig->diag), 0);
        const struct flash_difference difference = flash_job_difference(rig->job);
        assert_int_equal(difference.found, wrong);
        if (wrong)
            assert_int_equal(difference.address, RIG_USER + 0x4B);
    }
}

static void run_restore(struct flash_rig *const rig, const uint8_t *const dump, const int expected)
{
    flash_job_free(rig->job);
    rig->job = NULL;
    int err = flash_job_restore(&rig->job, rig->card, dump, rig->flash_bytes, &rig->options, &rig->diag);
    if (err == 0)
        err = flash_job_run(rig->job, NULL, NULL, &rig->diag);
    if (err != expected)
        fail_msg("%d: %s", err, rig->diag.text);
}

static void backs_up_and_restores_everything(void **state)
{
    struct flash_rig *const rig = *state;
    uint8_t *const dump = malloc(rig->flash_bytes);
    assert_non_null(dump);
    flash_rig_must_write(rig);
    flash_job_free(rig->job);
    rig->job = NULL;
    assert_int_equal(flash_job_backup(&rig->job, rig->card, dump, rig->flash_bytes, &rig->options, &rig->diag), 0);
    assert_int_equal(flash_job_run(rig->job, NULL, NULL, &rig->diag), 0);
    assert_memory_equal(dump, rig->flash, rig->flash_bytes);
    memset(rig->flash + RIG_USER + RIG_SECTOR, 0, RIG_SECTOR);
    run_restore(rig, dump, 0); /* the user area alone needs no confirmation */
    assert_memory_equal(dump, rig->flash, rig->flash_bytes);
    memset(rig->flash + 3 * RIG_SECTOR, 0, RIG_SECTOR);
    run_restore(rig, dump, HM2_ERR_STATE);
    rig->options.confirmed = true;
    run_restore(rig, dump, 0);
    assert_memory_equal(dump, rig->flash, rig->flash_bytes);
    free(dump);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        ON_7I93(writes_an_image_and_its_filler),
        ON_7I96S(writes_an_image_and_its_filler),
        ON_7I93(replaces_an_image),
        ON_7I96S(replaces_an_image),
        ON_7I93(leaves_a_right_image_alone),
        ON_7I96S(leaves_a_right_image_alone),
        ON_7I93(erases_only_the_sector_that_changed_and_the_key),
        ON_7I96S(erases_only_the_sector_that_changed_and_the_key),
        ON_7I93(makes_the_image_invalid_first_and_valid_last),
        ON_7I96S(makes_the_image_invalid_first_and_valid_last),
        ON_7I93(goes_on_after_the_network_was_cut),
        ON_7I96S(goes_on_after_the_network_was_cut),
        ON_7I93(an_incomplete_image_has_no_sync_word),
        ON_7I93(stops_between_two_sectors),
        ON_7I93(survives_a_bad_network),
        ON_7I96S(survives_a_bad_network),
        ON_7I93(mends_a_sector_that_was_spoilt),
        ON_7I93(gives_up_on_a_worn_chip),
        ON_7I93(reads_with_several_requests_ahead_until_one_is_lost),
        ON_7I96S(answers_may_come_in_any_order_and_twice),
        ON_7I93(does_not_read_what_is_erased_anyway),
        ON_7I96S(does_not_read_what_is_erased_anyway),
        ON_7I93(verifies_and_finds_the_first_difference),
        ON_7I93(backs_up_and_restores_everything),
        ON_7I96S(backs_up_and_restores_everything),
    };
    return cmocka_run_group_tests_name("flash write", tests, NULL, NULL);
}
