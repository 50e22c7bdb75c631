/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "flash_torture.h"

#include <inttypes.h>

#include "unit.h"

#define START_NS INT64_C(1500000000)

static bool efinix(const struct torture *const t)
{
    return strcmp(t->setup.profile, "7i96s") == 0;
}

static uint32_t start_of(const struct torture *const t, const enum sim_area area)
{
    return area == SIM_AREA_USER ? (uint32_t)t->size / 2 : efinix(t) ? 0 : FLASH_SECTOR_BYTES;
}

unsigned torture_factor(void)
{
    const char *const text = getenv("FLASH_TORTURE");
    const long value = text ? strtol(text, NULL, 10) : 1;
    return value < 1 ? 1 : value > 1000 ? 1000 : (unsigned)value;
}

static struct sim_flash_file file_of(const struct torture *const t, const enum sim_area area, const uint64_t seed)
{
    return (struct sim_flash_file){.profile = t->setup.profile,
                                   .area = area,
                                   .seed = t->setup.late_bytes ? 1 : seed,
                                   .late_seed = seed,
                                   .late_bytes = t->setup.late_bytes,
                                   .bytes = t->setup.bytes};
}

static void install(struct torture *const t, const enum sim_area area, const uint64_t seed)
{
    const struct sim_flash_file file = file_of(t, area, seed);
    assert_true(sim_card_install(t->sim, &file) > 0);
}

static bool writes_image(const struct torture *const t)
{
    return t->setup.kind == TORTURE_WRITE || t->setup.kind == TORTURE_WRITE_FALLBACK;
}

#define BEFORE_USER     11u
#define BEFORE_FALLBACK 12u
#define WANTED          22u

/* The image of the command, as a file, and where it goes in the wanted state. */
static void take_image(struct torture *const t)
{
    const enum sim_area area = t->setup.kind == TORTURE_WRITE_FALLBACK ? SIM_AREA_FALLBACK : SIM_AREA_USER;
    const struct sim_flash_file file = file_of(t, area, t->setup.kind == TORTURE_VERIFY ? BEFORE_USER : WANTED);
    const size_t len = sim_flash_file(&file, t->file, SIM_FLASH_FILE_BYTES);
    if (flash_image_parse(t->file, len, &t->image, &t->diag) != 0)
        fail_msg("%s", t->diag.text);
    t->options.area = area == SIM_AREA_USER ? FLASH_USER : FLASH_FALLBACK;
    t->options.file_name = efinix(t) ? "7i96s_fallback.bin" : "7i93_fallback.bit";
    if (area == SIM_AREA_USER)
        t->options.file_name = efinix(t) ? "7i96s.bin" : "7i93.bit";
    if (t->setup.bytes > 0)
        t->options.override = efinix(t) ? "7I96S" : "7I93"; /* no real image has this size */
    if (!writes_image(t))
        return;
    t->filler_at = start_of(t, area) + (uint32_t)t->image.payload_bytes;
    const size_t pages = (t->image.payload_bytes + FLASH_PAGE_BYTES - 1) / FLASH_PAGE_BYTES;
    for (size_t i = 0; i < pages * FLASH_PAGE_BYTES; i++)
        t->wanted[start_of(t, area) + i] = flash_image_byte(&t->image, i);
}

/* What is in the flash before, and what a restore puts there. */
static void fill_flash(struct torture *const t)
{
    install(t, SIM_AREA_USER, WANTED);
    install(t, SIM_AREA_FALLBACK, WANTED);
    memcpy(t->wanted, t->flash, t->size);
    install(t, SIM_AREA_USER, BEFORE_USER);
    install(t, SIM_AREA_FALLBACK, BEFORE_FALLBACK);
    memcpy(t->before, t->flash, t->size);
    if (t->setup.kind == TORTURE_RESTORE)
        return;
    memcpy(t->wanted, t->before, t->size);
    take_image(t);
}

static void note_erase(void *const context, const uint8_t *const data, const size_t len, const bool done)
{
    struct torture *const t = context;
    const struct sim_flash_counts now = sim_card_flash_counts(t->sim);
    (void)data;
    (void)len;
    t->datagrams += done;
    if (done && now.erases > t->erases_seen) {
        assert_true(t->erase_count < TORTURE_ERASES);
        t->erase[t->erase_count++] = (struct torture_erase){now.operations, t->datagrams};
    }
    t->erases_seen = now.erases;
}

void torture_undisturbed(struct torture *const t)
{
    torture_reset(t);
    t->datagrams = 0;
    t->erase_count = 0;
    sim_net_on_taken(t->net, note_erase, t);
    const int err = torture_run(t);
    sim_net_on_taken(t->net, NULL, NULL);
    if (err != t->result)
        fail_msg("undisturbed: %s", t->diag.text);
    t->operations = sim_card_flash_counts(t->sim).operations;
    torture_check_wanted(t, "undisturbed", 0);
}

struct torture *torture_new(const struct torture_setup *const setup)
{
    struct torture *const t = calloc(1, sizeof *t);
    assert_non_null(t);
    t->setup = *setup;
    const struct sim_card_options options = {.profile = setup->profile, .seed = 3, .flash_id = setup->flash_id};
    assert_int_equal(sim_card_new(&t->sim, &options, &t->diag), 0);
    assert_int_equal(sim_net_new(&t->net, t->sim, NULL), 0);
    t->link = sim_net_link(t->net);
    t->flash = sim_card_flash(t->sim, &t->size);
    t->before = malloc(t->size);
    t->wanted = malloc(t->size);
    t->dump = malloc(t->size);
    t->file = malloc(SIM_FLASH_FILE_BYTES);
    assert_true(t->before && t->wanted && t->dump && t->file);
    t->options.confirmed = true;
    fill_flash(t);
    t->result = setup->kind == TORTURE_VERIFY_OTHER ? HM2_ERR_MISMATCH : 0;
    torture_undisturbed(t);
    return t;
}

void torture_free(struct torture *const t)
{
    sim_net_free(t->net);
    sim_card_free(t->sim);
    free(t->before);
    free(t->wanted);
    free(t->dump);
    free(t->file);
    free(t);
}

void torture_settle(struct torture *const t)
{
    struct link *const link = sim_net_link(t->net);
    uint8_t late[LINK_MAX_DATAGRAM_BYTES];
    sim_net_sleep_until(t->net, link_now_ns(link) + START_NS);
    while (link_recv(link, late, sizeof late, link_now_ns(link)) >= 0) {
    }
}

void torture_power_up(struct torture *const t)
{
    const struct sim_faults none = {0};
    const struct sim_flash_faults good = {0};
    assert_int_equal(sim_net_set_faults(t->net, &none), 0);
    torture_settle(t);
    sim_card_flash_faults(t->sim, &good);
    sim_card_power_cycle(t->sim);
    torture_settle(t);
}

void torture_reset(struct torture *const t)
{
    memcpy(t->flash, t->before, t->size);
    torture_power_up(t);
}

static int start_job(struct torture *const t, struct flash_card *const card, struct flash_job **const job)
{
    switch (t->setup.kind) {
    case TORTURE_RESTORE:
        return flash_job_restore(job, card, t->wanted, t->size, &t->options, &t->diag);
    case TORTURE_BACKUP:
        memset(t->dump, 0, t->size);
        return flash_job_backup(job, card, t->dump, t->size, &t->options, &t->diag);
    case TORTURE_VERIFY:
    case TORTURE_VERIFY_OTHER:
        return flash_job_verify(job, card, &t->image, &t->options, &t->diag);
    case TORTURE_WRITE:
    case TORTURE_WRITE_FALLBACK:
    default:
        return flash_job_write(job, card, &t->image, &t->options, &t->diag);
    }
}

/* What the command has read is not what it should be. */
static bool mismatch(const struct torture *const t, const struct flash_job *const job)
{
    if (t->setup.kind == TORTURE_BACKUP)
        return memcmp(t->dump, t->before, t->size) != 0;
    return (t->setup.kind == TORTURE_VERIFY || t->setup.kind == TORTURE_VERIFY_OTHER) &&
           flash_job_difference(job).found;
}

int torture_run(struct torture *const t)
{
    struct flash_card *card = NULL;
    struct flash_job *job = NULL;
    t->diag = (struct hm2_diag){0};
    int err = flash_card_new(&card, t->link, &t->diag);
    if (err == 0)
        err = start_job(t, card, &job);
    if (err == 0)
        err = flash_job_run(job, NULL, NULL, &t->diag);
    if (err == 0 && mismatch(t, job))
        err = HM2_ERR_MISMATCH;
    flash_job_free(job);
    flash_card_free(card);
    return err;
}

static bool holds(const struct torture *const t, const uint8_t *const state, const enum sim_area area)
{
    const uint32_t start = start_of(t, area);
    size_t room = t->size / 2 - (area == SIM_AREA_FALLBACK ? start : 0);
    if (t->filler_at > start && t->filler_at - start < room)
        room = t->filler_at - start;
    return memcmp(t->flash + start, state + start, room) == 0;
}

void torture_check_starts(const struct torture *const t, const char *const what, const uint64_t number)
{
    const enum sim_boot boot = sim_card_would_boot(t->sim);
    if (boot != SIM_BOOT_USER && boot != SIM_BOOT_FALLBACK)
        fail_msg("%s, %s %" PRIu64 " of %" PRIu64 ": the card would start %s", t->setup.profile, what, number,
                 t->operations, sim_boot_name(boot));
    const enum sim_area area = boot == SIM_BOOT_USER ? SIM_AREA_USER : SIM_AREA_FALLBACK;
    if (!holds(t, t->before, area) && !holds(t, t->wanted, area))
        fail_msg("%s, %s %" PRIu64 ": the image that starts is neither the old nor the new one", t->setup.profile, what,
                 number);
    if (t->setup.kind == TORTURE_WRITE_FALLBACK && boot != SIM_BOOT_USER)
        fail_msg("%s, %s %" PRIu64 ": writing the fallback image cost the user image", t->setup.profile, what, number);
    if (!efinix(t) && memcmp(t->flash, t->before, FLASH_SECTOR_BYTES) != 0)
        fail_msg("%s, %s %" PRIu64 ": the boot block's sector has changed", t->setup.profile, what, number);
}

void torture_check_wanted(const struct torture *const t, const char *const what, const uint64_t number)
{
    const bool wrong = memcmp(t->flash, t->wanted, t->size) != 0;
    for (size_t i = 0; wrong && i < t->size; i++)
        if (t->flash[i] != t->wanted[i])
            fail_msg("%s, %s %" PRIu64 ": byte 0x%06zX is 0x%02X instead of 0x%02X", t->setup.profile, what, number, i,
                     t->flash[i], t->wanted[i]);
    if (sim_card_would_boot(t->sim) != SIM_BOOT_USER)
        fail_msg("%s, %s %" PRIu64 ": the user image does not start", t->setup.profile, what, number);
}
