/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What is in the flash already, and what that leaves to be done. */
#include "job.h"

uint8_t job_byte(const struct job_pass *const pass, const uint32_t offset)
{
    if (pass->image)
        return flash_image_byte(pass->image, offset);
    return offset < pass->bytes ? pass->raw[offset] : FLASH_ERASED;
}

bool job_todo(const struct flash_job *const job, const uint32_t address)
{
    const uint32_t page = address / FLASH_PAGE_BYTES;
    return job->todo[page / 8] >> page % 8 & 1;
}

void job_set_todo(struct flash_job *const job, const uint32_t address, const bool todo)
{
    const uint32_t page = address / FLASH_PAGE_BYTES;
    if (job_todo(job, address) == todo)
        return;
    job->todo[page / 8] ^= (uint8_t)(1u << page % 8);
    job->plan.pages += todo ? 1u : (unsigned)-1;
}

unsigned job_first_sector(const struct job_pass *const pass)
{
    return pass->range.start / FLASH_SECTOR_BYTES;
}

unsigned job_end_sector(const struct job_pass *const pass)
{
    return (pass->range.start + pass->bytes + FLASH_SECTOR_BYTES - 1) / FLASH_SECTOR_BYTES;
}

void job_plan_erase(struct flash_job *const job, const struct job_pass *const pass, const unsigned sector)
{
    const uint32_t start = sector * FLASH_SECTOR_BYTES, end = pass->range.start + pass->bytes;
    job->plan.state[sector] = FLASH_SECTOR_ERASE;
    for (uint32_t at = start; at < start + FLASH_SECTOR_BYTES && at < end; at += FLASH_PAGE_BYTES)
        job_set_todo(job, at, true);
}

/* Compare one reading with what belongs there. Returns how many bytes could be judged: all, or up to the sector that
 * turned out to need an erase. */
static void judge(struct flash_job *const job, const struct job_pass *const pass, const uint32_t offset,
                  const size_t len)
{
    for (size_t i = 0; i < len; i++) {
        const uint32_t at = pass->range.start + offset + (uint32_t)i;
        uint8_t *const state = &job->plan.state[at / FLASH_SECTOR_BYTES];
        const uint8_t have = job->chunk[i], want = job_byte(pass, offset + (uint32_t)i);
        if (*state == FLASH_SECTOR_UNSEEN)
            *state = FLASH_SECTOR_SAME;
        if (have == want || *state == FLASH_SECTOR_ERASE)
            continue;
        if (!job->difference.found)
            job->difference = (struct flash_difference){true, at, want, have};
        if ((have & want) != want) {
            job_plan_erase(job, pass, at / FLASH_SECTOR_BYTES);
            continue;
        }
        *state = FLASH_SECTOR_WRITE;
        job_set_todo(job, at, true);
    }
}

static bool first_page_blank(const struct flash_job *const job, const size_t len)
{
    for (size_t i = 0; i < len && i < FLASH_PAGE_BYTES; i++)
        if (job->chunk[i] != FLASH_ERASED)
            return false;
    return len >= FLASH_PAGE_BYTES;
}

/* An image must not look valid while parts of it are missing. */
static void plan_key(struct flash_job *const job, const unsigned index)
{
    const struct job_pass *const pass = &job->passes[index];
    const unsigned key = job_first_sector(pass);
    bool changes = false;
    for (unsigned s = key; s < job_end_sector(pass); s++)
        changes = changes || job->plan.state[s] == FLASH_SECTOR_WRITE || job->plan.state[s] == FLASH_SECTOR_ERASE;
    if (changes && !job->key_blank[index])
        job_plan_erase(job, pass, key);
}

static void count(struct flash_job *const job)
{
    struct flash_plan *const plan = &job->plan;
    plan->same = plan->to_write = plan->to_erase = 0;
    for (unsigned i = 0; i < job->pass_count; i++)
        for (unsigned s = job_first_sector(&job->passes[i]); s < job_end_sector(&job->passes[i]); s++) {
            plan->same += plan->state[s] == FLASH_SECTOR_SAME;
            plan->to_write += plan->state[s] == FLASH_SECTOR_WRITE || plan->state[s] == FLASH_SECTOR_ERASE;
            plan->to_erase += plan->state[s] == FLASH_SECTOR_ERASE;
        }
}

static void finish_plan(struct flash_job *const job)
{
    for (unsigned i = 0; i < job->pass_count; i++)
        plan_key(job, i);
    count(job);
    job_enter(job, job->kind == JOB_WRITE ? JOB_PLANNED : JOB_END);
}

/* A write minds the filler of the last page, too: mesaflash compares whole pages. For a verify only the image counts.
 */
static uint32_t judged_bytes(const struct flash_job *const job, const struct job_pass *const pass)
{
    const uint32_t pages = (pass->bytes + FLASH_PAGE_BYTES - 1) / FLASH_PAGE_BYTES;
    return job->kind == JOB_WRITE ? pages * FLASH_PAGE_BYTES : pass->bytes;
}

/* Where the comparison goes on: behind a sector that is erased anyway, which need not be read to its end. */
static uint32_t skip_erased(const struct flash_job *const job, const struct job_pass *const pass, uint32_t offset)
{
    const uint32_t at = pass->range.start + offset, end = judged_bytes(job, pass);
    if (job->kind == JOB_WRITE && offset < end && job->plan.state[at / FLASH_SECTOR_BYTES] == FLASH_SECTOR_ERASE)
        offset = (at / FLASH_SECTOR_BYTES + 1) * FLASH_SECTOR_BYTES - pass->range.start;
    return offset < end ? offset : end;
}

int job_compare(struct flash_job *const job, struct hm2_diag *const diag)
{
    const struct job_pass *const pass = &job->passes[job->pass];
    const uint32_t at = pass->range.start + job->cursor, end = judged_bytes(job, pass);
    size_t len = end - job->cursor;
    if (len > sizeof job->chunk)
        len = sizeof job->chunk;
    /* Not into the next sector: that may be decided by its own beginning, as this one is. */
    const uint32_t left = FLASH_SECTOR_BYTES - at % FLASH_SECTOR_BYTES;
    if (len > left)
        len = left;
    const int err = flash_read_some(job->card, at, job->chunk, &len, diag);
    if (err < 0)
        return err;
    if (job->cursor == 0)
        job->key_blank[job->pass] = first_page_blank(job, len);
    judge(job, pass, job->cursor, len);
    job->cursor = skip_erased(job, pass, job->cursor + (uint32_t)len);
    job->progress.address = at;
    if (job->kind == JOB_VERIFY && job->difference.found) {
        count(job);
        job_enter(job, JOB_END);
        return 0;
    }
    if (job->cursor < end)
        return 0;
    job->cursor = 0;
    if (++job->pass == job->pass_count)
        finish_plan(job);
    return 0;
}
