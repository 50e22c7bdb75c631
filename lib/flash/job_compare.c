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

bool job_in_key_rest(const struct flash_job *const job)
{
    return job->key_rest > 0 && job->cursor >= job->key_rest && job->cursor < FLASH_SECTOR_BYTES;
}

/* Compare one reading with what belongs there; true when it is the same. */
static bool judge(struct flash_job *const job, const struct job_pass *const pass, const uint32_t offset,
                  const size_t len)
{
    bool same = true;
    for (size_t i = 0; i < len; i++) {
        const uint32_t at = pass->range.start + offset + (uint32_t)i;
        uint8_t *const state = &job->plan.state[at / FLASH_SECTOR_BYTES];
        const uint8_t have = job->chunk[i], want = job_byte(pass, offset + (uint32_t)i);
        if (*state == FLASH_SECTOR_UNSEEN)
            *state = FLASH_SECTOR_SAME;
        same = same && have == want;
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
    return same;
}

static bool first_page_blank(const struct flash_job *const job, const size_t len)
{
    for (size_t i = 0; i < len && i < FLASH_PAGE_BYTES; i++)
        if (job->chunk[i] != FLASH_ERASED)
            return false;
    return len >= FLASH_PAGE_BYTES;
}

static bool changes(const struct flash_job *const job, const struct job_pass *const pass)
{
    for (unsigned s = job_first_sector(pass); s < job_end_sector(pass); s++)
        if (job->plan.state[s] > FLASH_SECTOR_SAME)
            return true;
    return false;
}

/* An image must not look valid while parts of it are missing. */
static void plan_key(struct flash_job *const job, const unsigned index)
{
    const struct job_pass *const pass = &job->passes[index];
    if (changes(job, pass) && !job->key_blank[index])
        job_plan_erase(job, pass, job_first_sector(pass));
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

/* The key comes last, but for its beginning: it is erased anyway when another sector changes, and need not be read. */
static uint32_t put_off_key(struct flash_job *const job, const uint32_t offset, const uint32_t end)
{
    if (job->kind != JOB_WRITE || job->cursor > 0 || offset >= FLASH_SECTOR_BYTES || end <= FLASH_SECTOR_BYTES)
        return offset;
    job->key_rest = offset;
    return FLASH_SECTOR_BYTES;
}

static uint32_t next_offset(struct flash_job *const job, const struct job_pass *const pass, const size_t len)
{
    const uint32_t end = judged_bytes(job, pass), at = job->cursor + (uint32_t)len;
    const bool in_rest = job_in_key_rest(job);
    const uint32_t limit = in_rest ? FLASH_SECTOR_BYTES : end;
    const uint32_t offset = skip_erased(job, pass, put_off_key(job, at, end));
    if (offset < limit)
        return offset;
    const bool rest = job->key_rest > 0 && !in_rest && !(changes(job, pass) && !job->key_blank[job->pass]);
    return rest ? job->key_rest : end;
}

/* Not into the next sector: that may be decided by its own beginning, as this one is. And no more than was the same in
 * a row before: of a sector that is erased anyway the rest is read for nothing. */
static size_t next_length(const struct flash_job *const job, const struct job_pass *const pass)
{
    const size_t in_sector = FLASH_SECTOR_BYTES - (pass->range.start + job->cursor) % FLASH_SECTOR_BYTES;
    const size_t left = judged_bytes(job, pass) - job->cursor, in = left < in_sector ? left : in_sector;
    const size_t ahead = job->alike < FLASH_BATCH_READ ? job->alike : FLASH_BATCH_READ;
    const size_t most = job->kind == JOB_VERIFY ? FLASH_BATCH_READ : ahead > FLASH_READ_MOST ? ahead : FLASH_READ_MOST;
    return in < most ? in : most;
}

int job_compare(struct flash_job *const job, struct hm2_diag *const diag)
{
    const struct job_pass *const pass = &job->passes[job->pass];
    const uint32_t at = pass->range.start + job->cursor, end = judged_bytes(job, pass);
    size_t len = next_length(job, pass);
    const int err = flash_read_ahead(job->card, at, job->chunk, &len, diag);
    if (err < 0)
        return err;
    if (job->cursor == 0)
        job->key_blank[job->pass] = first_page_blank(job, len);
    job->alike = judge(job, pass, job->cursor, len) ? job->alike + len : 0;
    job->cursor = next_offset(job, pass, len);
    job->progress.address = at;
    if (job->kind == JOB_VERIFY && job->difference.found) {
        count(job);
        job_enter(job, JOB_END);
        return 0;
    }
    if (job->cursor < end)
        return 0;
    job->cursor = job->key_rest = 0;
    if (++job->pass == job->pass_count)
        finish_plan(job);
    return 0;
}
