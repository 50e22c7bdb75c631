/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "flash_rig.h"

void flash_rig_take(struct flash_rig *const rig, const struct sim_flash_file *const file)
{
    struct sim_flash_file own = *file;
    if (!own.profile)
        own.profile = rig->xilinx ? "7i93" : "7i96s";
    rig->len = sim_flash_file(&own, rig->file, SIM_FLASH_FILE_BYTES);
    assert_int_not_equal(rig->len, 0);
    if (flash_image_parse(rig->file, rig->len, &rig->image, &rig->diag) != 0)
        fail_msg("%s", rig->diag.text);
}

void flash_rig_image(struct flash_rig *const rig, const uint64_t seed, const bool fallback)
{
    flash_rig_take(rig, &(struct sim_flash_file){.seed = seed, .area = fallback ? SIM_AREA_FALLBACK : SIM_AREA_USER});
    rig->options.file_name = rig->xilinx ? fallback ? "7i93_fallback.bit" : "7i93_test.bit" : "7i96s_test.bin";
}

static int make(void **const state, const char *const profile, const uint8_t flash_id)
{
    struct flash_rig *const rig = calloc(1, sizeof *rig);
    assert_non_null(rig);
    rig->file = malloc(SIM_FLASH_FILE_BYTES);
    assert_non_null(rig->file);
    rig->xilinx = strcmp(profile, "7i96s") != 0;
    const struct sim_card_options options = {.profile = profile, .seed = 1, .flash_id = flash_id};
    if (sim_card_new(&rig->sim, &options, &rig->diag) != 0)
        fail_msg("%s", rig->diag.text);
    assert_int_equal(sim_net_new(&rig->net, rig->sim, NULL), 0);
    rig->flash = sim_card_flash(rig->sim, &rig->flash_bytes);
    flash_rig_image(rig, 1, false);
    flash_rig_reopen(rig);
    *state = rig;
    return 0;
}

int flash_rig_7i93(void **const state)
{
    return make(state, "7i93", 0);
}

int flash_rig_7i96s(void **const state)
{
    return make(state, "7i96s", 0);
}

int flash_rig_unknown_chip(void **const state)
{
    return make(state, "7i93", 0x16);
}

int flash_rig_free(void **const state)
{
    struct flash_rig *const rig = *state;
    flash_job_free(rig->job);
    flash_card_free(rig->card);
    sim_net_free(rig->net);
    sim_card_free(rig->sim);
    free(rig->file);
    free(rig);
    return 0;
}

void flash_rig_reopen(struct flash_rig *const rig)
{
    flash_job_free(rig->job);
    flash_card_free(rig->card);
    rig->job = NULL;
    hm2_diag_clear(&rig->diag);
    if (flash_card_new(&rig->card, sim_net_link(rig->net), &rig->diag) != 0)
        fail_msg("%s", rig->diag.text);
}

int flash_rig_write(struct flash_rig *const rig)
{
    flash_job_free(rig->job);
    rig->job = NULL;
    const int err = flash_job_write(&rig->job, rig->card, &rig->image, &rig->options, &rig->diag);
    return err < 0 ? err : flash_job_run(rig->job, NULL, NULL, &rig->diag);
}

void flash_rig_must_write(struct flash_rig *const rig)
{
    const int err = flash_rig_write(rig);
    if (err != 0)
        fail_msg("%d: %s", err, rig->diag.text);
}

void flash_rig_assert_image(const struct flash_rig *const rig, const uint32_t at)
{
    for (size_t i = 0; i < rig->image.payload_bytes; i++)
        if (rig->flash[at + i] != rig->image.payload[i])
            fail_msg("0x%06zX: expected 0x%02X but found 0x%02X", at + i, rig->image.payload[i], rig->flash[at + i]);
}

void flash_rig_assert_refused(struct flash_rig *const rig, const int err, const char *const words)
{
    const uint64_t before = flash_card_counters(rig->card).erases + flash_card_counters(rig->card).pages;
    uint8_t *const kept = malloc(rig->flash_bytes);
    assert_non_null(kept);
    memcpy(kept, rig->flash, rig->flash_bytes);
    hm2_diag_clear(&rig->diag);
    const int got = flash_rig_write(rig);
    if (got != err || !strstr(rig->diag.text, words))
        fail_msg("%d instead of %d, without \"%s\": %s", got, err, words, rig->diag.text);
    assert_int_equal(flash_card_counters(rig->card).erases + flash_card_counters(rig->card).pages, before);
    assert_memory_equal(kept, rig->flash, rig->flash_bytes);
    free(kept);
}
