/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "job.h"

#include <stdlib.h>
#include <string.h>

#include "checks.h"

#define BUSY_WINDOW 32u /* own datagrams between two looks at those of others */
#define BUSY_FEW    8u

/* ---- progress --------------------------------------------------------------------------------------------------- */

static enum flash_phase phase_of(const struct flash_job *const job)
{
    static const enum flash_phase phases[] = {
        [JOB_COMPARE] = FLASH_COMPARING, [JOB_PLANNED] = FLASH_COMPARING, [JOB_ERASE] = FLASH_ERASING,
        [JOB_PROGRAM] = FLASH_WRITING,   [JOB_RECHECK] = FLASH_VERIFYING, [JOB_GUARD] = FLASH_VERIFYING,
        [JOB_READ] = FLASH_READING,      [JOB_END] = FLASH_DONE,
    };
    return job->state == JOB_COMPARE && job->kind == JOB_VERIFY ? FLASH_VERIFYING : phases[job->state];
}

static unsigned pages_of(const uint32_t bytes)
{
    return (bytes + FLASH_PAGE_BYTES - 1) / FLASH_PAGE_BYTES;
}

static unsigned sectors_to_erase(const struct flash_job *const job)
{
    const struct job_pass *const pass = &job->passes[job->pass];
    unsigned sectors = 0;
    for (unsigned s = job_first_sector(pass); s < job_end_sector(pass); s++)
        sectors += job->plan.state[s] == FLASH_SECTOR_ERASE;
    return sectors;
}

void job_enter(struct flash_job *const job, const enum job_state state)
{
    job->state = state;
    job->progress.phase = phase_of(job);
    if (state == JOB_PLANNED || state == JOB_RECHECK)
        job->pass = 0;
    job->cursor = 0;
    job->progress.done = job->progress.total = 0;
    if (job->pass >= job->pass_count)
        return;
    job->progress.address = job->passes[job->pass].range.start;
    job->sector = job_first_sector(&job->passes[job->pass]);
    if (state == JOB_ERASE)
        job->progress.total = sectors_to_erase(job);
    else if (state == JOB_PROGRAM)
        job->progress.total = job->plan.pages;
}

/* The rest of a key that was put off is compared behind the other sectors. */
static uint32_t done_of_pass(const struct flash_job *const job)
{
    if (job->key_rest == 0)
        return job->cursor;
    const uint32_t bytes = job->passes[job->pass].bytes;
    return job_in_key_rest(job) ? bytes - (FLASH_SECTOR_BYTES - job->cursor)
                                : job->cursor - (FLASH_SECTOR_BYTES - job->key_rest);
}

struct flash_progress flash_job_progress(const struct flash_job *const job)
{
    struct flash_progress progress = job->progress;
    if (job->state == JOB_COMPARE || job->state == JOB_RECHECK || job->state == JOB_READ) {
        uint32_t done = done_of_pass(job), total = 0;
        for (unsigned i = 0; i < job->pass_count; i++) {
            total += job->passes[i].bytes;
            done += i < job->pass ? job->passes[i].bytes : 0;
        }
        progress.done = pages_of(done);
        progress.total = pages_of(total);
    }
    const uint64_t unit = progress.phase == FLASH_ERASING ? FLASH_SECTOR_BYTES : FLASH_PAGE_BYTES;
    progress.bytes_done = progress.done * unit;
    progress.bytes_total = progress.total * unit;
    return progress;
}

const struct flash_plan *flash_job_plan(const struct flash_job *const job)
{
    return &job->plan;
}

struct flash_difference flash_job_difference(const struct flash_job *const job)
{
    return job->difference;
}

bool flash_job_between_sectors(const struct flash_job *const job)
{
    return job->state != JOB_PROGRAM || !job->in_sector;
}

/* ---- making jobs ------------------------------------------------------------------------------------------------ */

static struct flash_job *new_job(struct flash_card *const card, const enum job_kind kind,
                                 const struct flash_options *const options, struct hm2_diag *const diag)
{
    struct flash_job *const job = calloc(1, sizeof *job);
    if (!job) {
        (void)hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for a job");
        return NULL;
    }
    job->card = card;
    job->kind = kind;
    job->options = *options;
    job->most_pages = job->options.pages_per_write;
    if (job->most_pages == 0 || job->most_pages > FLASH_PAGES_MOST)
        job->most_pages = FLASH_PAGES_MOST;
    card->port.counters.pages_per_write = 1;
    job->resent_before = job->resent_mark = card->port.counters.resent;
    job->sent_mark = card->port.counters.sent;
    job->foreign_mark = card->port.counters.foreign;
    card->port.behind = 0;
    return job;
}

void flash_job_free(struct flash_job *const job)
{
    if (job)
        job->card->writable = (struct flash_range){0, 0};
    free(job);
}

static void add_pass(struct flash_job *const job, const struct job_pass *const pass)
{
    const struct flash_plan *const plan = &job->plan;
    const uint32_t end = pass->range.start + pass->range.bytes;
    const uint32_t start =
        job->pass_count && plan->range.start < pass->range.start ? plan->range.start : pass->range.start;
    const uint32_t old_end = plan->range.start + plan->range.bytes;
    job->plan.range = (struct flash_range){start, (job->pass_count && old_end > end ? old_end : end) - start};
    job->plan.sectors += job_end_sector(pass) - job_first_sector(pass);
    job->passes[job->pass_count++] = *pass;
}

/* Unused lengths are refused before: a job has a pass, and a pass has data. */
static void start(struct flash_job *const job, const enum job_state state)
{
    job->pass = 0;
    job_enter(job, state);
}

/* First of all nobody else may be using the card: reading the flash moves the address register, and the erase of a
 * program that sends address and erase apart would go to where this one reads (H1, H11); and it takes the card so long
 * that a driver's datagram waits (H10). */
static int ask_quiet(struct flash_card *const card, const struct flash_options *const options,
                     struct hm2_diag *const diag)
{
    return options->any_traffic ? 0 : flash_card_quiet(card, diag);
}

static int look_at_flash(struct flash_job *const job, struct flash_survey *const survey, struct hm2_diag *const diag)
{
    struct flash_survey again;
    int err = ask_quiet(job->card, &job->options, diag);
    if (err == 0)
        err = flash_card_survey(job->card, survey, diag);
    if (err == 0)
        err = flash_card_survey(job->card, &again, diag);
    if (err == 0 && memcmp(survey, &again, sizeof again) != 0)
        return hm2_diag_add(diag, HM2_ERR_IO,
                            "the flash reads differently each time; nothing was changed. Check the "
                            "card's supply");
    return err;
}

static int keep_guards(struct flash_job *const job, const bool boot, const bool fallback, struct hm2_diag *const diag)
{
    const struct flash_card_info *const info = &job->card->info;
    const uint32_t starts[2] = {0, flash_area_range(info->board->family, info->chip, FLASH_FALLBACK).start};
    job->guarded[0] = boot;
    job->guarded[1] = fallback && starts[1] != 0;
    for (unsigned i = 0; i < 2; i++) {
        const int err =
            job->guarded[i] ? flash_card_read(job->card, starts[i], job->guard[i], FLASH_HEAD_BYTES, diag) : 0;
        if (err < 0)
            return err;
    }
    return 0;
}

/* The boot block and 192 zeros behind it, as mesaflash writes them (3.8). */
static void add_boot_pass(struct flash_job *const job)
{
    memset(job->boot_page, 0, sizeof job->boot_page);
    flash_boot_block(job->card->info.chip, job->boot_page);
    add_pass(job,
             &(struct job_pass){.range = {0, FLASH_SECTOR_BYTES}, .raw = job->boot_page, .bytes = FLASH_PAGE_BYTES});
    job->plan.boot_block = true;
}

static int prepare_write(struct flash_job *const job, const struct flash_image *const image,
                         struct hm2_diag *const diag)
{
    struct flash_card *const card = job->card;
    const struct flash_card_info *const info = &card->info;
    struct flash_survey survey = {0};
    int err = look_at_flash(job, &survey, diag);
    if (err == 0)
        err = flash_check_content(card, &survey, &job->options, diag);
    if (err < 0)
        return err;
    const bool fallback = job->options.area == FLASH_FALLBACK;
    const bool install = info->board->family == FLASH_XILINX && survey.sector0 != FLASH_BOOT_BLOCK;
    err = keep_guards(job, !install && (!fallback || info->board->family == FLASH_XILINX), !fallback, diag);
    if (install)
        add_boot_pass(job);
    add_pass(job, &(struct job_pass){.range = flash_area_range(info->board->family, info->chip, job->options.area),
                                     .image = image,
                                     .bytes = (uint32_t)image->payload_bytes});
    return err;
}

static int begin(struct flash_job **const job, struct flash_job *const made, const int err, const enum job_state state)
{
    if (err < 0) {
        flash_job_free(made);
        return err;
    }
    start(made, state);
    *job = made;
    return 0;
}

int flash_job_write(struct flash_job **const job, struct flash_card *const card, const struct flash_image *const image,
                    const struct flash_options *const options, struct hm2_diag *const diag)
{
    *job = NULL;
    int err = flash_check_card(card, diag);
    if (err == 0)
        err = flash_check_image(card, image, options, diag);
    if (err < 0)
        return err;
    struct flash_job *const made = new_job(card, JOB_WRITE, options, diag);
    return made ? begin(job, made, prepare_write(made, image, diag), JOB_COMPARE) : HM2_ERR_NOMEM;
}

int flash_job_verify(struct flash_job **const job, struct flash_card *const card, const struct flash_image *const image,
                     const struct flash_options *const options, struct hm2_diag *const diag)
{
    const struct flash_card_info *const info = &card->info;
    *job = NULL;
    int err = flash_check_card(card, diag);
    if (err == 0 && strcmp(image->part, info->board->part) != 0)
        err = hm2_diag_add(diag, HM2_ERR_MISMATCH, "Error: wrong bitfile destination device: %s, should be %s",
                           image->part, info->board->part);
    if (err == 0)
        err = flash_check_fits(card, image, options->area, diag);
    if (err == 0)
        err = ask_quiet(card, options, diag);
    if (err < 0)
        return err;
    struct flash_job *const made = new_job(card, JOB_VERIFY, options, diag);
    if (!made)
        return HM2_ERR_NOMEM;
    add_pass(made, &(struct job_pass){.range = flash_area_range(info->board->family, info->chip, options->area),
                                      .image = image,
                                      .bytes = (uint32_t)image->payload_bytes});
    return begin(job, made, 0, JOB_COMPARE);
}

/* ---- whole chips ------------------------------------------------------------------------------------------------ */

/* Compare the chip with `dump`, or read it `into` memory of the caller's. */
static int whole_chip(struct flash_job **const job, struct flash_card *const card, const uint8_t *const dump,
                      uint8_t *const into, const size_t len, const struct flash_options *const options,
                      struct hm2_diag *const diag)
{
    const struct flash_chip *const chip = card->info.chip;
    *job = NULL;
    if (!chip)
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED, "Unknown size FLASH memory on the %s board (chip ID 0x%02X)",
                            card->info.card_name, (unsigned)card->info.flash_id & 0xFFu);
    if (len != chip->bytes)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "%zu bytes, and the chip has %u", len, (unsigned)chip->bytes);
    const int err = ask_quiet(card, options, diag);
    if (err < 0)
        return err;
    struct flash_job *const made = new_job(card, into ? JOB_BACKUP : JOB_VERIFY, options, diag);
    if (!made)
        return HM2_ERR_NOMEM;
    add_pass(made, &(struct job_pass){.range = {0, chip->bytes}, .raw = dump, .bytes = chip->bytes});
    made->dump = into;
    return begin(job, made, 0, into ? JOB_READ : JOB_COMPARE);
}

int flash_job_verify_dump(struct flash_job **const job, struct flash_card *const card, const uint8_t *const dump,
                          const size_t len, const struct flash_options *const options, struct hm2_diag *const diag)
{
    return whole_chip(job, card, dump, NULL, len, options, diag);
}

int flash_job_backup(struct flash_job **const job, struct flash_card *const card, uint8_t *const dump, const size_t len,
                     const struct flash_options *const options, struct hm2_diag *const diag)
{
    return whole_chip(job, card, NULL, dump, len, options, diag);
}

static void add_area(struct flash_job *const job, const uint8_t *const dump, const enum flash_area area)
{
    const struct flash_card_info *const info = &job->card->info;
    const struct flash_range range = flash_area_range(info->board->family, info->chip, area);
    add_pass(job, &(struct job_pass){.range = range, .raw = dump + range.start, .bytes = range.bytes});
}

/* The user area first; but an area that holds no image goes before one that does. */
static int prepare_restore(struct flash_job *const job, const uint8_t *const dump, struct hm2_diag *const diag)
{
    struct flash_survey survey = {0};
    int err = look_at_flash(job, &survey, diag);
    if (err < 0)
        return err;
    const bool fallback_first = flash_can_start(survey.user) && !flash_can_start(survey.fallback);
    add_area(job, dump, fallback_first ? FLASH_FALLBACK : FLASH_USER);
    add_area(job, dump, fallback_first ? FLASH_USER : FLASH_FALLBACK);
    if (job->card->info.board->family == FLASH_XILINX)
        add_pass(job, &(struct job_pass){.range = {0, FLASH_SECTOR_BYTES}, .raw = dump, .bytes = FLASH_SECTOR_BYTES});
    return 0;
}

int flash_job_restore(struct flash_job **const job, struct flash_card *const card, const uint8_t *const dump,
                      const size_t len, const struct flash_options *const options, struct hm2_diag *const diag)
{
    *job = NULL;
    int err = flash_check_card(card, diag);
    if (err == 0)
        err = flash_check_dump(card, dump, len, options, diag);
    if (err < 0)
        return err;
    struct flash_job *const made = new_job(card, JOB_WRITE, options, diag);
    return made ? begin(job, made, prepare_restore(made, dump, diag), JOB_COMPARE) : HM2_ERR_NOMEM;
}

/* ---- running ---------------------------------------------------------------------------------------------------- */

/* Everything outside the user area is what rescues the card. */
static int planned(struct flash_job *const job, struct hm2_diag *const diag)
{
    const unsigned user = job->card->info.chip->bytes / 2 / FLASH_SECTOR_BYTES;
    const bool boot_only = job->plan.boot_block && job->options.fix_boot_block;
    for (unsigned s = boot_only ? 1 : 0; s < user; s++)
        if (job->plan.state[s] > FLASH_SECTOR_SAME && !job->options.confirmed)
            return hm2_diag_add(diag, HM2_ERR_STATE,
                                "this would write to sector %u, which belongs to boot block or fallback image and "
                                "rescues the card; that needs a confirmation: --confirm fallback. Nothing was changed",
                                s);
    job_enter(job, JOB_ERASE);
    return 0;
}

/* Sectors may have been erased. */
static bool was_changing(const struct flash_job *const job)
{
    return job->kind == JOB_WRITE && job->state != JOB_COMPARE && job->state != JOB_PLANNED;
}

/* Another master that turned up meanwhile; seen over a number of datagrams, as the network may repeat some. */
static int check_alone(struct flash_job *const job, struct hm2_diag *const diag)
{
    const struct flash_counters *const counters = &job->card->port.counters;
    const uint64_t sent = counters->sent - job->sent_mark, foreign = counters->foreign - job->foreign_mark;
    if (job->options.any_traffic || sent < BUSY_WINDOW || !flash_job_between_sectors(job))
        return 0;
    job->sent_mark = counters->sent;
    job->foreign_mark = counters->foreign;
    if (foreign <= BUSY_FEW + sent / 4)
        return 0;
    const bool changed = was_changing(job);
    return hm2_diag_add(diag, changed ? HM2_ERR_IO : HM2_ERR_STATE,
                        "another program has begun to talk to this card (%llu datagrams beside our %llu). %s, stop the "
                        "other program and run the command again",
                        (unsigned long long)foreign, (unsigned long long)sent,
                        changed ? "The image is not complete: do not switch the card off" : "Nothing was changed");
}

static int read_on(struct flash_job *const job, struct hm2_diag *const diag)
{
    const uint32_t total = job->passes[0].bytes;
    size_t len = total - job->cursor;
    const int err = flash_read_ahead(job->card, job->cursor, job->dump + job->cursor, &len, diag);
    if (err < 0)
        return err;
    job->progress.address = job->cursor;
    job->cursor += (uint32_t)len;
    if (job->cursor == total)
        job_enter(job, JOB_END);
    return 0;
}

int flash_job_step(struct flash_job *const job, struct hm2_diag *const diag)
{
    static int (*const steps[])(struct flash_job *, struct hm2_diag *) = {
        [JOB_COMPARE] = job_compare, [JOB_PLANNED] = planned,     [JOB_ERASE] = job_erase,
        [JOB_PROGRAM] = job_program, [JOB_RECHECK] = job_recheck, [JOB_GUARD] = job_check_guards,
        [JOB_READ] = read_on,
    };
    if (job->state == JOB_END)
        return 0;
    int err = steps[job->state](job, diag);
    if (err == 0)
        err = check_alone(job, diag);
    if (err < 0)
        return err;
    return job->state != JOB_END;
}

static int stopped(const struct flash_job *const job, struct hm2_diag *const diag)
{
    if (!was_changing(job))
        return hm2_diag_add(diag, HM2_ERR_STATE, "stopped; nothing was changed");
    return hm2_diag_add(diag, HM2_ERR_IO,
                        "stopped. The image is not complete: do not switch the card off, what it runs now stays until "
                        "then; run the command again, it goes on where this one ended");
}

int flash_job_run(struct flash_job *const job, const flash_progress_fn progress, void *const context,
                  struct hm2_diag *const diag)
{
    bool stop = false;
    int more;
    while ((more = flash_job_step(job, diag)) > 0) {
        const struct flash_progress now = flash_job_progress(job);
        stop = stop || (progress && !progress(context, &now));
        if (stop && flash_job_between_sectors(job) && more > 0)
            return stopped(job, diag);
    }
    return more;
}
