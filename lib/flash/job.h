/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of a job. A job has passes: parts of the flash that are made new one after the other, so that no two images
 * are incomplete at a time. All passes are compared first, which is the plan; then each is erased and written. The
 * first sector of a pass, its key, holds what makes the image valid: it is erased first, and its first page is written
 * last.
 *
 * That costs one more erase when the key itself does not change, and nothing cheaper is known to be safe. The check sum
 * of an image stands at its end, and so does any change of the check sum: while the last sector is erased, an FPGA that
 * found the sync word would load frames and never come to a check, and no source says that its watchdog (flash tool
 * reference 3.8) still acts then. For Trion no check sum is documented at all. Without the sync word both turn to the
 * fallback image.
 */
#ifndef FLASH_JOB_H
#define FLASH_JOB_H

#include "card.h"

#define MAX_PASSES 3u
#define MAX_PAGES  (FLASH_MAX_BYTES / FLASH_PAGE_BYTES)

enum job_kind { JOB_WRITE, JOB_VERIFY, JOB_BACKUP };
/* Steps of a job; the phases that callers see are made of them. */
enum job_state { JOB_COMPARE, JOB_PLANNED, JOB_ERASE, JOB_PROGRAM, JOB_RECHECK, JOB_GUARD, JOB_READ, JOB_END };

struct job_pass {
    struct flash_range range;        /* what may be touched */
    const struct flash_image *image; /* what belongs there, or: */
    const uint8_t *raw;
    uint32_t bytes; /* from range.start on */
};

struct flash_job {
    struct flash_card *card;
    struct flash_options options;
    enum job_kind kind;
    enum job_state state;
    struct flash_plan plan;
    struct flash_difference difference;

    struct job_pass passes[MAX_PASSES];
    unsigned pass_count, pass;
    uint32_t cursor;   /* of the pass: next byte to compare or to read */
    size_t alike;      /* bytes in a row that were found to be right */
    uint32_t key_rest; /* from where on the key is compared, once the other sectors are; 0 = not put off */
    unsigned sector;   /* being written, counted in the chip */
    bool in_sector;    /* some of its pages are written and some are not */

    uint8_t cost[FLASH_MAX_SECTORS]; /* of the attempts that failed */
    uint8_t todo[MAX_PAGES / 8];     /* pages of the chip that must be written */
    bool key_blank[MAX_PASSES];      /* the first page is, so the image is not valid as it is */
    bool proven;                     /* a datagram with several pages did what it should */
    unsigned most_pages;

    uint8_t guard[2][FLASH_HEAD_BYTES]; /* of sector 0 and of the fallback area, before */
    bool guarded[2];
    uint64_t resent_before, resent_mark; /* repeated datagrams at the start, and at the last failed attempt */
    uint64_t foreign_mark, sent_mark;

    struct flash_progress progress;
    uint8_t *dump; /* of a backup */
    uint8_t page_data[FLASH_PAGES_MOST * FLASH_PAGE_BYTES], back[FLASH_PAGES_MOST * FLASH_PAGE_BYTES];
    uint8_t chunk[FLASH_BATCH_READ];
    uint8_t boot_page[FLASH_PAGE_BYTES];
};

/* ---- between the files of the job ---------------------------------------------------------------------------------
 */

uint8_t job_byte(const struct job_pass *pass, uint32_t offset);
bool job_todo(const struct flash_job *job, uint32_t address);
void job_set_todo(struct flash_job *job, uint32_t address, bool todo);
/* Sectors of a pass, counted in the chip: first, and one behind the last that its data touch. */
unsigned job_first_sector(const struct job_pass *pass);
unsigned job_end_sector(const struct job_pass *pass);
/* Comparing what was put off of the key (key_rest). */
bool job_in_key_rest(const struct flash_job *job);
/* Every page of the sector that has data must be written, after an erase. */
void job_plan_erase(struct flash_job *job, const struct job_pass *pass, unsigned sector);
void job_enter(struct flash_job *job, enum job_state state);

/* One step of each state; 0 or an error. */
int HM2_MUST_CHECK job_compare(struct flash_job *job, struct hm2_diag *diag);
int HM2_MUST_CHECK job_erase(struct flash_job *job, struct hm2_diag *diag);
int HM2_MUST_CHECK job_program(struct flash_job *job, struct hm2_diag *diag);
int HM2_MUST_CHECK job_recheck(struct flash_job *job, struct hm2_diag *diag);
int HM2_MUST_CHECK job_check_guards(struct flash_job *job, struct hm2_diag *diag);

#endif
