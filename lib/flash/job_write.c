/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Erasing and writing what the plan says, with everything read back. */
#include <string.h>

#include "job.h"

/* A sector that does not hold what was written costs so much, and may cost that much altogether: three attempts when
 * the network did its part, fifteen when datagrams were repeated, of which one may have come damaged. */
#define COST_CLEAN   5u
#define COST_REPEAT  1u
#define COST_MOST    15u
#define LATE_NS      INT64_C(1200000000) /* a datagram that the network holds back longer is taken for lost */
#define LATE_STEP_NS INT64_C(50000000)

static int worn(const struct flash_job *const job, struct hm2_diag *const diag)
{
    return hm2_diag_add(diag, HM2_ERR_IO,
                        "the flash does not keep what is written: 0x%06X expected 0x%02X but read 0x%02X, again and "
                        "again. Do not switch the card off: what it runs now stays until then. Run the command again; "
                        "if it fails again at this address, the chip is worn",
                        (unsigned)job->difference.address, job->difference.expected, job->difference.read);
}

/* A repeated erase may still be on its way and must not come after the writing that follows: wait until the card's own
 * counter says that it got all copies, or until none can be on its way any more. */
static int await_copies(struct flash_job *const job, struct hm2_diag *const diag)
{
    struct flash_port *const port = &job->card->port;
    const int64_t behind = port->behind;
    for (int64_t waited_ns = 0; port->behind > 0 && waited_ns < LATE_NS; waited_ns += LATE_STEP_NS) {
        flash_port_wait(port, LATE_STEP_NS);
        flash_port_begin(port);
        const int err = flash_port_run(port, FLASH_WORK_READ, FLASH_TRIES);
        if (err < 0)
            return flash_lost(diag, err, "waiting after an erase");
    }
    if (port->behind == behind)
        port->behind = 0; /* lost for good */
    return 0;
}

static int erase_sector(struct flash_job *const job, const unsigned sector, struct hm2_diag *const diag)
{
    const uint64_t resent = job->card->port.counters.resent;
    const int err = flash_erase(job->card, sector * FLASH_SECTOR_BYTES, diag);
    if (err < 0)
        return err;
    return job->card->port.counters.resent != resent ? await_copies(job, diag) : 0;
}

/* Everything was read back when it was written. That is enough unless datagrams were repeated or lost: then one could
 * have come late, behind what was read. */
static bool trustworthy(const struct flash_job *const job)
{
    const struct flash_port *const port = &job->card->port;
    return port->counters.resent == job->resent_before && port->behind == 0;
}

static void next_pass(struct flash_job *const job)
{
    job->pass++;
    if (job->pass < job->pass_count)
        job_enter(job, JOB_ERASE);
    else
        job_enter(job, job->options.no_verify || trustworthy(job) ? JOB_GUARD : JOB_RECHECK);
}

int job_erase(struct flash_job *const job, struct hm2_diag *const diag)
{
    const struct job_pass *const pass = &job->passes[job->pass];
    job->card->writable = pass->range;
    while (job->sector < job_end_sector(pass) && job->plan.state[job->sector] != FLASH_SECTOR_ERASE)
        job->sector++;
    if (job->sector >= job_end_sector(pass)) {
        job_enter(job, JOB_PROGRAM);
        return 0;
    }
    const int err = erase_sector(job, job->sector, diag);
    if (err < 0)
        return err;
    job->progress.address = job->sector * FLASH_SECTOR_BYTES;
    job->progress.done++;
    job->plan.state[job->sector++] = FLASH_SECTOR_WRITE;
    return 0;
}

/* ---- writing ---------------------------------------------------------------------------------------------------- */

/* Next page of a sector to be written, or its end. The first page of a pass makes the image valid and comes last. */
static uint32_t next_page(const struct flash_job *const job, const struct job_pass *const pass, const unsigned sector)
{
    const uint32_t start = sector * FLASH_SECTOR_BYTES, end = start + FLASH_SECTOR_BYTES;
    for (uint32_t at = start; at < end; at += FLASH_PAGE_BYTES)
        if (at != pass->range.start && job_todo(job, at))
            return at;
    return start == pass->range.start && job_todo(job, start) ? start : end;
}

/* Sectors behind the key, then the key. */
static bool find_page(struct flash_job *const job, const struct job_pass *const pass, uint32_t *const page)
{
    const unsigned key = job_first_sector(pass), end = job_end_sector(pass);
    for (unsigned i = 0; i < end - key; i++) {
        const unsigned sector = i + 1 < end - key ? key + 1 + i : key;
        *page = next_page(job, pass, sector);
        if (*page < (sector + 1) * FLASH_SECTOR_BYTES) {
            job->sector = sector;
            return true;
        }
    }
    return false;
}

static unsigned run_of_pages(const struct flash_job *const job, const struct job_pass *const pass, const uint32_t page)
{
    const unsigned most = job->card->port.counters.pages_per_write;
    unsigned pages = 1;
    if (page == pass->range.start)
        return 1;
    while (pages < most && (page + pages * FLASH_PAGE_BYTES) % FLASH_SECTOR_BYTES != 0 &&
           job_todo(job, page + pages * FLASH_PAGE_BYTES))
        pages++;
    return pages;
}

static void fill(struct flash_job *const job, const struct job_pass *const pass, const uint32_t page,
                 const unsigned pages)
{
    for (uint32_t i = 0; i < pages * FLASH_PAGE_BYTES; i++)
        job->page_data[i] = job_byte(pass, page - pass->range.start + i);
}

/* What was written and read back: true when every byte is right. *erase: a zero stands where a one belongs. */
static bool compare_back(struct flash_job *const job, const uint32_t page, const unsigned pages, bool *const erase)
{
    bool right = true;
    *erase = false;
    for (uint32_t i = 0; i < pages * FLASH_PAGE_BYTES; i++) {
        const uint8_t want = job->page_data[i], have = job->back[i];
        if (want == have)
            continue;
        if (right)
            job->difference = (struct flash_difference){true, page + i, want, have};
        right = false;
        *erase = *erase || (have & want) != want;
    }
    return right;
}

static void grow(struct flash_job *const job, const unsigned pages)
{
    struct flash_counters *const counters = &job->card->port.counters;
    job->proven = job->proven || pages > 1 || job->most_pages == 1;
    if (counters->pages_per_write < job->most_pages)
        counters->pages_per_write = job->most_pages;
}

static void shrink(struct flash_job *const job)
{
    job->most_pages = 1;
    job->card->port.counters.pages_per_write = 1;
}

/* One more attempt at a sector; an error when there were enough. */
static int attempt(struct flash_job *const job, struct hm2_diag *const diag)
{
    const uint64_t resent = job->card->port.counters.resent;
    uint8_t *const cost = &job->cost[job->sector];
    *cost = (uint8_t)(*cost + (resent == job->resent_mark ? COST_CLEAN : COST_REPEAT));
    job->resent_mark = resent;
    if (!job->proven)
        shrink(job);
    return *cost > COST_MOST ? worn(job, diag) : 0;
}

/* Try again: the pages alone when only zeros are missing, else the whole sector. */
static int mend(struct flash_job *const job, const struct job_pass *const pass, const bool erase,
                struct hm2_diag *const diag)
{
    int err = attempt(job, diag);
    if (err < 0 || !erase)
        return err;
    job_plan_erase(job, pass, job->sector);
    err = erase_sector(job, job->sector, diag);
    job->plan.state[job->sector] = FLASH_SECTOR_WRITE;
    return err;
}

static int write_pages(struct flash_job *const job, const struct job_pass *const pass, const uint32_t page,
                       const unsigned pages, struct hm2_diag *const diag)
{
    const bool back = !job->options.no_verify || !job->proven;
    bool erase = false;
    fill(job, pass, page, pages);
    const int err = flash_program(job->card, page, job->page_data, pages, back ? job->back : NULL, diag);
    if (err == HM2_ERR_TIMEOUT && pages > 1) {
        shrink(job);
        return 0;
    }
    if (err < 0)
        return err == HM2_ERR_TIMEOUT ? flash_lost(diag, err, "writing") : err;
    if (back && !compare_back(job, page, pages, &erase))
        return mend(job, pass, erase, diag);
    grow(job, pages);
    for (unsigned i = 0; i < pages; i++)
        job_set_todo(job, page + i * FLASH_PAGE_BYTES, false);
    job->progress.done += pages;
    return 0;
}

int job_program(struct flash_job *const job, struct hm2_diag *const diag)
{
    const struct job_pass *const pass = &job->passes[job->pass];
    uint32_t page;
    if (!find_page(job, pass, &page)) {
        next_pass(job);
        return 0;
    }
    job->progress.address = page;
    const unsigned sector = job->sector;
    const int err = write_pages(job, pass, page, run_of_pages(job, pass, page), diag);
    job->in_sector = next_page(job, pass, sector) < (sector + 1) * FLASH_SECTOR_BYTES;
    return err;
}

/* ---- afterwards ------------------------------------------------------------------------------------------------- */

static bool find_written(struct flash_job *const job)
{
    for (; job->pass < job->pass_count; job->pass++, job->cursor = 0) {
        const struct job_pass *const pass = &job->passes[job->pass];
        for (; job->cursor < pass->bytes; job->cursor += FLASH_SECTOR_BYTES - job->cursor % FLASH_SECTOR_BYTES)
            if (job->plan.state[(pass->range.start + job->cursor) / FLASH_SECTOR_BYTES] == FLASH_SECTOR_WRITE)
                return true;
    }
    return false;
}

int job_recheck(struct flash_job *const job, struct hm2_diag *const diag)
{
    if (!find_written(job)) {
        job_enter(job, JOB_GUARD);
        return 0;
    }
    const struct job_pass *const pass = &job->passes[job->pass];
    const uint32_t at = pass->range.start + job->cursor;
    const uint32_t left = FLASH_SECTOR_BYTES - at % FLASH_SECTOR_BYTES;
    size_t len = pass->bytes - job->cursor < left ? pass->bytes - job->cursor : left;
    if (len > sizeof job->chunk)
        len = sizeof job->chunk;
    const int err = flash_read_ahead(job->card, at, job->chunk, &len, diag);
    if (err < 0)
        return err;
    for (uint32_t i = 0; i < len; i++) {
        const uint8_t want = job_byte(pass, job->cursor + i);
        if (job->chunk[i] == want)
            continue;
        job->difference = (struct flash_difference){true, at + i, want, job->chunk[i]};
        job->sector = (at + i) / FLASH_SECTOR_BYTES;
        const int enough = attempt(job, diag);
        if (enough < 0)
            return enough;
        job_plan_erase(job, pass, job->sector);
        job_plan_erase(job, pass, job_first_sector(pass));
        job_enter(job, JOB_ERASE);
        return 0;
    }
    job->cursor += (uint32_t)len;
    job->progress.address = at;
    return 0;
}

/* The boot block, or the beginning of the fallback image, is as it was (H1). */
int job_check_guards(struct flash_job *const job, struct hm2_diag *const diag)
{
    const struct flash_card_info *const info = &job->card->info;
    const uint32_t starts[2] = {0, flash_area_range(info->board->family, info->chip, FLASH_FALLBACK).start};
    for (unsigned i = 0; i < 2; i++) {
        if (!job->guarded[i])
            continue;
        const int err = flash_card_read(job->card, starts[i], job->chunk, FLASH_HEAD_BYTES, diag);
        if (err < 0)
            return err;
        if (memcmp(job->chunk, job->guard[i], FLASH_HEAD_BYTES) != 0)
            return hm2_diag_add(
                diag, HM2_ERR_IO,
                "the flash at 0x%06X, which this job did not touch, has changed meanwhile. Do not switch "
                "the card off: restore its backup, or write boot block and fallback image first",
                (unsigned)starts[i]);
    }
    job_enter(job, JOB_END);
    return 0;
}
