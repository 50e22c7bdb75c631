/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A bar with rate and remaining time on a terminal; mesaflash's lines of letters elsewhere. */
#include <stdio.h>
#include <time.h>
#include <unistd.h>

#include "cli.h"

#define BAR_CELLS    30u
#define LETTER_BYTES 8192u
#define FIRST_RATE_S 0.05
#define BYTES_PER_KB 1000.0

static const struct {
    const char *verb, *bar;
    char letter;
} phases[] = {
    [FLASH_COMPARING] = {NULL, "comparing", 'C'},      [FLASH_ERASING] = {"Erasing", "erasing", 'E'},
    [FLASH_WRITING] = {"Programming", "writing", 'W'}, [FLASH_VERIFYING] = {"Verifying", "verifying", 'V'},
    [FLASH_READING] = {"Reading", "reading", 'R'},     [FLASH_DONE] = {NULL, "done", ' '},
};

double seconds_now(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec / 1e9;
}

void progress_init(struct progress *const progress, const struct cli *const cli)
{
    *progress = (struct progress){.cli = cli, .phase = -1, .terminal = isatty(STDOUT_FILENO)};
}

void progress_close(struct progress *const progress)
{
    if (progress->line_open)
        fputs(progress->terminal ? "\r\033[K" : "\n", stdout);
    progress->line_open = false;
}

static void draw_bar(struct progress *const progress, const struct flash_progress *const now)
{
    const double took_s = seconds_now() - progress->start_s;
    const double rate = took_s > FIRST_RATE_S ? (double)now->bytes_done / took_s : 0;
    const double left = (double)(now->bytes_total - now->bytes_done);
    const unsigned filled = now->total ? now->done * BAR_CELLS / now->total : 0;
    printf("\r%-9s [", phases[now->phase].bar);
    for (unsigned i = 0; i < BAR_CELLS; i++)
        putchar(i < filled ? '#' : '.');
    printf("] %3u %%", now->total ? now->done * 100 / now->total : 0);
    if (rate > 0)
        printf("  %.0f kB/s  %.0f s left", rate / BYTES_PER_KB, left / rate);
    fputs("\033[K", stdout);
    progress->line_open = true;
    fflush(stdout);
}

static void open_letters(struct progress *const progress, const struct flash_progress *const now)
{
    progress_close(progress);
    progress->shown = 0;
    if (!phases[now->phase].verb || now->total == 0)
        return;
    printf("%s FLASH memory sectors starting from 0x%X...\n  |", phases[now->phase].verb, (unsigned)now->address);
    progress->line_open = true;
}

static void draw_letters(struct progress *const progress, const struct flash_progress *const now)
{
    const uint64_t unit = now->phase == FLASH_ERASING ? FLASH_SECTOR_BYTES : LETTER_BYTES;
    for (; progress->line_open && progress->shown < (now->bytes_done + unit - 1) / unit; progress->shown++)
        putchar(phases[now->phase].letter);
    fflush(stdout);
}

bool progress_show(void *const context, const struct flash_progress *const now)
{
    struct progress *const progress = context;
    if (progress->cli->json || progress->cli->many)
        return !interrupted;
    const bool fresh = (int)now->phase != progress->phase;
    progress->phase = (int)now->phase;
    if (fresh)
        progress->start_s = seconds_now();
    if (progress->terminal) {
        draw_bar(progress, now);
        return !interrupted;
    }
    if (fresh)
        open_letters(progress, now);
    draw_letters(progress, now);
    return !interrupted;
}
