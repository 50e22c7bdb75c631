/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Writing, verifying, backing up and restoring (flash tool reference 1.4.7 to 1.4.9). */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "../common/whole_file.h"
#include "cli.h"

#define IMAGE_MOST (2u * FLASH_MAX_BYTES)

static struct flash_options options_of(const struct cli *const cli, const char *const file)
{
    return (struct flash_options){.area = cli->fallback ? FLASH_FALLBACK : FLASH_USER,
                                  .file_name = file,
                                  .override = cli->override,
                                  .confirmed = cli->confirm_fallback,
                                  .fix_boot_block = cli->fix_boot_block,
                                  .no_verify = cli->no_verify,
                                  .pages_per_write = cli->pages,
                                  .any_traffic = cli->any_traffic};
}

static uint8_t *load(const struct cli *const cli, const char *const path, const char *const what, size_t *const len)
{
    uint8_t *const bytes = whole_file(path, IMAGE_MOST, len);
    if (!bytes && errno == ENOENT)
        (void)complain(cli, REFUSED, "Can't find %s %s", what, path);
    else if (!bytes)
        (void)complain(cli, REFUSED, "Can't open %s %s: %s", what, path, strerror(errno));
    return bytes;
}

static int parse_image(struct cli *const cli, const uint8_t *const bytes, const size_t len,
                       struct flash_image *const image)
{
    say(cli, "Checking file... ");
    const int err = flash_image_parse(bytes, len, image, &cli->diag);
    if (err < 0) {
        say(cli, "Error\n");
        return report(cli, err);
    }
    say(cli, "OK\n  File type: %s\n", image->family == FLASH_XILINX ? "Xilinx bit file" : "Efinix bin file");
    if (cli->verbose)
        print_image(cli, image);
    return DONE;
}

/* H15: a program sees one chip, and not which one. */
static void remind_second_chip(const struct cli *const cli)
{
    const char *const jumper = cli->info->board ? cli->info->board->second_chip : NULL;
    if (jumper)
        (void)complain(cli, 0,
                       "the %s has two flash chips, and this concerns only the one that jumper %s chooses now (up: the "
                       "first, down: the second)",
                       card_name(cli), jumper);
}

static const char whole[] = "whole flash";

static const char *area_text(const struct cli *const cli)
{
    return cli->fallback ? "fallback area" : "user area";
}

/* Which card, which part of it, which file: to be seen before anything happens (H18, H20). */
static void announce(const struct cli *const cli, const uint8_t *const bytes, const size_t len, const char *const part)
{
    const uint8_t *const m = cli->info->mac;
    char hash[SHA256_TEXT];
    sha256_text(bytes, len, hash);
    say(cli, "Board: %s at %s, MAC address %02X:%02X:%02X:%02X:%02X:%02X, %s\nsha256: '%s'\n", card_name(cli),
        cli->address, m[0], m[1], m[2], m[3], m[4], m[5], part, hash);
    remind_second_chip(cli);
}

/* ---- running a job
 * ---------------------------------------------------------------------------------------------------- */

struct outcome {
    double took_s;
    struct flash_counters before, after;
};

static int run(struct cli *const cli, struct flash_job *const job, struct outcome *const outcome)
{
    struct progress progress;
    progress_init(&progress, cli);
    outcome->before = flash_card_counters(cli->card);
    const double start_s = seconds_now();
    const int err = flash_job_run(job, progress_show, &progress, &cli->diag);
    progress_close(&progress);
    outcome->took_s = seconds_now() - start_s;
    outcome->after = flash_card_counters(cli->card);
    return err < 0 ? report(cli, err) : DONE;
}

static int make_plan(struct cli *const cli, struct flash_job *const job)
{
    int more = 1;
    while (more > 0 && flash_job_progress(job).phase == FLASH_COMPARING)
        more = flash_job_step(job, &cli->diag);
    return more < 0 ? report(cli, more) : DONE;
}

static void print_plan(const struct cli *const cli, const struct flash_job *const job)
{
    static const char *const states[] = {"-", "same", "write", "erase and write"};
    const struct flash_plan *const plan = flash_job_plan(job);
    const unsigned first = plan->range.start / FLASH_SECTOR_BYTES;
    say(cli, "FLASH memory sectors to write: %u, max sectors in area: %u\n", plan->to_write,
        plan->range.bytes / FLASH_SECTOR_BYTES);
    if (!cli->dry_run)
        return;
    for (unsigned s = first; s < FLASH_MAX_SECTORS; s++)
        if (plan->state[s] != FLASH_SECTOR_UNSEEN)
            say(cli, "  0x%06X  %s\n", s * FLASH_SECTOR_BYTES, states[plan->state[s]]);
    say(cli,
        "Dry run: %u sectors would be erased, %u pages written, %u sectors hold the right data already. Nothing was "
        "changed.\n",
        plan->to_erase, plan->pages, plan->same);
}

static void print_outcome(struct cli *const cli, const char *const action, const struct flash_job *const job,
                          const struct outcome *const outcome)
{
    const struct flash_plan *const plan = flash_job_plan(job);
    const struct flash_counters *const a = &outcome->before, *const b = &outcome->after;
    const unsigned long long pages = (unsigned long long)(b->pages - a->pages);
    if (cli->many && !cli->json)
        say(cli, "%s %s: %u sectors the same, %llu erased, %llu pages written, %.1f s\n", card_name(cli), action,
            plan->same, (unsigned long long)(b->erases - a->erases), pages, outcome->took_s);
    if (cli->verbose && !cli->json)
        say(cli,
            "  %llu datagrams, %llu repeated, %llu erases, %llu pages, %u pages a datagram, %llu bytes read, %.2f "
            "seconds\n",
            (unsigned long long)(b->sent - a->sent), (unsigned long long)(b->resent - a->resent),
            (unsigned long long)(b->erases - a->erases), pages, b->pages_per_write, (unsigned long long)b->bytes_read,
            outcome->took_s);
    json_begin(cli);
    json_text(cli, "action", action);
    json_bool(cli, "done", true);
    json_number(cli, "sectors_same", plan->same);
    json_number(cli, "sectors_erased", (double)(b->erases - a->erases));
    json_number(cli, "pages_written", (double)pages);
    json_number(cli, "datagrams", (double)(b->sent - a->sent));
    json_number(cli, "repeated", (double)(b->resent - a->resent));
    json_number(cli, "seconds", outcome->took_s);
    json_end(cli);
}

static void json_plan(const struct cli *const cli, const struct flash_job *const job)
{
    const struct flash_plan *const plan = flash_job_plan(job);
    json_begin(cli);
    json_text(cli, "action", "dry-run");
    json_number(cli, "start", plan->range.start);
    json_number(cli, "sectors_same", plan->same);
    json_number(cli, "sectors_to_erase", plan->to_erase);
    json_number(cli, "pages_to_write", plan->pages);
    json_end(cli);
}

/* The boot block byte by byte where it is not what belongs there, also when that is refused afterwards (H7). */
static int show_boot_difference(struct cli *const cli)
{
    enum { ROW = 16 };
    const struct flash_card_info *const info = cli->info;
    uint8_t found[FLASH_BOOT_BLOCK_BYTES], right[FLASH_BOOT_BLOCK_BYTES];
    if (!info->board || info->board->family != FLASH_XILINX || !info->chip)
        return DONE;
    const int err = flash_card_read(cli->card, 0, found, sizeof found, &cli->diag);
    if (err < 0)
        return report(cli, err);
    flash_boot_block(info->chip, right);
    for (unsigned at = 0; at < sizeof found; at += ROW) {
        char texts[2][3 * ROW + 1];
        if (memcmp(found + at, right + at, ROW) == 0)
            continue;
        for (unsigned i = 0; i < ROW; i++) {
            snprintf(texts[0] + (size_t)3 * i, 4, " %02X", found[at + i]);
            snprintf(texts[1] + (size_t)3 * i, 4, " %02X", right[at + i]);
        }
        (void)complain(cli, 0, "boot block 0x%02X, found:   %s", at, texts[0]);
        (void)complain(cli, 0, "boot block 0x%02X, expected:%s", at, texts[1]);
    }
    return DONE;
}

/* Whether anything of what rescues the card, fallback image or boot block, is about to change. */
static bool changes_rescue(const struct cli *const cli, const struct flash_plan *const plan)
{
    const unsigned user = cli->info->chip->bytes / 2 / FLASH_SECTOR_BYTES;
    for (unsigned s = 0; s < user; s++)
        if (plan->state[s] > FLASH_SECTOR_SAME)
            return true;
    return false;
}

/* What rescues the card is never written without a copy of what was there (H4): in the current folder, unless the
 * command line names a place. */
static int back_up_before(struct cli *const cli, const struct flash_job *const job)
{
    const struct flash_plan *const plan = flash_job_plan(job);
    const bool allowed = cli->confirm_fallback || cli->fix_boot_block; /* otherwise the job refuses by itself */
    if (plan->to_write == 0 || (!cli->backup_to && !(allowed && changes_rescue(cli, plan))))
        return DONE;
    const int status = backup_to(cli, cli->backup_to ? cli->backup_to : ".");
    return status == DONE ? DONE
                          : complain(cli, status == LOST ? LOST : REFUSED,
                                     "without a backup the flash is not written, and nothing was changed: give a place "
                                     "for it with --backup-to");
}

/* ---- write
 * ------------------------------------------------------------------------------------------------------------ */

static void boot_line(const struct cli *const cli, const struct flash_job *const job)
{
    if (cli->info->board->family != FLASH_XILINX)
        return;
    say(cli, "%s\n", flash_job_plan(job)->boot_block ? "Erasing sector 0 for boot block" : "Boot sector OK");
}

static int write_job(struct cli *const cli, struct flash_job *const job)
{
    struct outcome outcome = {0};
    int status = make_plan(cli, job);
    if (status != DONE)
        return status;
    boot_line(cli, job);
    print_plan(cli, job);
    if (cli->dry_run) {
        json_plan(cli, job);
        return DONE;
    }
    const bool nothing = flash_job_plan(job)->to_write == 0;
    status = back_up_before(cli, job);
    if (status == DONE)
        status = run(cli, job, &outcome);
    if (status != DONE)
        return status;
    if (flash_job_plan(job)->boot_block)
        say(cli, "BootBlock installed\n");
    if (nothing)
        say(cli, "The FLASH memory holds this already: nothing was erased or written.\n");
    else
        say(cli, "Board configuration updated successfully.\n");
    if (!cli->no_verify)
        say(cli, "Board configuration verified successfully.\n");
    print_outcome(cli, cli->no_verify ? "written" : "written and verified", job, &outcome);
    return DONE;
}

static int write_image(struct cli *const cli, const char *const path, const uint8_t *const bytes, const size_t len)
{
    struct flash_image image;
    struct flash_job *job = NULL;
    char known_card[FLASH_TEXT_BYTES];
    int status = check_side_file(cli, path, bytes, len, cli->sha256_check, "Bitfile");
    if (status == DONE)
        status = parse_image(cli, bytes, len, &image);
    if (status == DONE && cli->reload && !cli->dry_run)
        status = check_machine(cli, "Reloading");
    if (status != DONE)
        return status;
    struct flash_options options = options_of(cli, path);
    announce(cli, bytes, len, area_text(cli));
    status = look_up_image(cli, bytes, len, known_card);
    if (status != DONE)
        return status;
    options.known_card = known_card[0] ? known_card : NULL;
    status = check_alone(cli); /* before the flash is read for the first time */
    if (status != DONE)
        return status;
    status = show_boot_difference(cli);
    if (status != DONE)
        return status;
    const int err = flash_job_write(&job, cli->card, &image, &options, &cli->diag);
    if (err < 0)
        return report(cli, err);
    status = write_job(cli, job);
    flash_job_free(job);
    return status;
}

int do_write(struct cli *const cli, const char *const arg)
{
    size_t len;
    uint8_t *const bytes = load(cli, arg, "bitfile", &len);
    if (!bytes)
        return REFUSED;
    const int status = write_image(cli, arg, bytes, len);
    free(bytes);
    if (status != DONE || cli->dry_run)
        return status;
    if (cli->reload)
        return do_reload(cli, NULL);
    say(cli, "\nYou must power cycle the hardware or use the --reload command to load a new firmware.\n");
    return DONE;
}

/* ---- verify
 * ------------------------------------------------------------------------------------------------------------ */

static int verify_job(struct cli *const cli, struct flash_job *const job, const char *const what)
{
    struct outcome outcome = {0};
    const int status = run(cli, job, &outcome);
    if (status != DONE)
        return status;
    const struct flash_difference difference = flash_job_difference(job);
    if (!difference.found) {
        say(cli, "Board %s verified successfully.\n", what);
        print_outcome(cli, "verified", job, &outcome);
        return DONE;
    }
    say(cli, "Error at 0x%X expected: 0x%X but read: 0x%X\n", (unsigned)difference.address, difference.expected,
        difference.read);
    json_begin(cli);
    json_text(cli, "action", "verify");
    json_bool(cli, "done", false);
    json_number(cli, "difference_at", difference.address);
    json_number(cli, "expected", difference.expected);
    json_number(cli, "read", difference.read);
    json_end(cli);
    return complain(cli, FAILED,
                    "the flash holds something else than the file: another build, or a write that was cut "
                    "off. --write the file; --verbose tells what is in the flash");
}

int do_verify(struct cli *const cli, const char *const arg)
{
    struct flash_image image;
    struct flash_job *job = NULL;
    size_t len;
    int err = 0;
    uint8_t *const bytes = load(cli, arg, "file", &len);
    if (!bytes)
        return REFUSED;
    const bool dump = cli->info->chip && len == cli->info->chip->bytes;
    int status = dump ? DONE : parse_image(cli, bytes, len, &image);
    if (status == DONE)
        announce(cli, bytes, len, dump ? whole : area_text(cli));
    const struct flash_options options = options_of(cli, arg);
    if (status == DONE && dump)
        err = flash_job_verify_dump(&job, cli->card, bytes, len, &options, &cli->diag);
    else if (status == DONE)
        err = flash_job_verify(&job, cli->card, &image, &options, &cli->diag);
    if (status == DONE)
        status = err < 0 ? report(cli, err) : verify_job(cli, job, dump ? "FLASH memory" : "configuration");
    flash_job_free(job);
    free(bytes);
    return status;
}

/* ---- backup and restore
 * -------------------------------------------------------------------------------------------------- */

static void name_backup(const struct cli *const cli, const char *const where, char *const path, const size_t size)
{
    struct stat status;
    char stamp[32];
    struct tm local;
    const time_t now = time(NULL);
    if (stat(where, &status) != 0 || !S_ISDIR(status.st_mode)) {
        snprintf(path, size, "%s", where);
        return;
    }
    (void)localtime_r(&now, &local);
    (void)strftime(stamp, sizeof stamp, "%d%m%y_%H%M%S", &local);
    char name[128], which[16] = "";
    const uint8_t *const m = cli->info->mac;
    if (cli->many) /* several of a kind must not meet in one file */
        snprintf(which, sizeof which, "_%02X%02X%02X%02X%02X%02X", m[0], m[1], m[2], m[3], m[4], m[5]);
    snprintf(name, sizeof name, "%s_flash_backup_%s%s.bin", card_name(cli), stamp, which);
    snprintf(path, size, "%s%s%s", where, where[strlen(where) - 1] == '/' ? "" : "/", name);
    say(cli, "Used auto naming backup file: '%s'\n", name);
}

/* The file is there before the chip is read: a place where none can be made is found out at once (H4). */
static FILE *reserve(const struct cli *const cli, const char *const path, int *const status)
{
    FILE *const file = fopen(path, "wbx");
    if (!file && errno == EEXIST)
        *status = complain(cli, REFUSED, "File '%s' already exist. Give another name", path);
    else if (!file)
        *status = complain(cli, FAILED, "Can't create file '%s': %s", path, strerror(errno));
    return file;
}

/* Fill the file, or take it away again when the chip could not be read or the disk is full. */
static int finish_file(const struct cli *const cli, FILE *const file, const char *const path, int status,
                       const uint8_t *const bytes, const size_t len)
{
    const bool written = status == DONE && fwrite(bytes, 1, len, file) == len;
    const bool closed = fclose(file) == 0;
    if (status == DONE && !(written && closed))
        status = complain(cli, FAILED, "Can't create file '%s': %s", path, strerror(errno));
    if (status != DONE)
        (void)remove(path);
    return status;
}

static int read_chip(struct cli *const cli, uint8_t *const dump, const size_t len, struct outcome *const outcome)
{
    struct flash_job *job = NULL;
    const struct flash_options options = options_of(cli, NULL);
    const int err = flash_job_backup(&job, cli->card, dump, len, &options, &cli->diag);
    if (err < 0)
        return report(cli, err);
    const int status = run(cli, job, outcome);
    flash_job_free(job);
    return status;
}

int backup_to(struct cli *const cli, const char *const where)
{
    const struct flash_chip *const chip = cli->info->chip;
    struct outcome outcome = {0};
    char path[4096];
    if (!chip)
        return complain(cli, REFUSED, "Unknown size FLASH memory on the %s board", card_name(cli));
    say(cli, "Creating backup %s FLASH memory on the %s board:\n", chip->name, card_name(cli));
    name_backup(cli, where, path, sizeof path);
    uint8_t *const dump = malloc(chip->bytes);
    if (!dump)
        return complain(cli, FAILED, "no memory for a dump of %u bytes", (unsigned)chip->bytes);
    int status = DONE;
    FILE *const file = reserve(cli, path, &status);
    if (file)
        status = finish_file(cli, file, path, read_chip(cli, dump, chip->bytes, &outcome), dump, chip->bytes);
    if (status == DONE) {
        say(cli, "FLASH memory backup file '%s' created successfully.\n", path);
        status = write_side_files(cli, path, dump, chip->bytes);
    }
    if (status == DONE && cli->verbose)
        say(cli, "  Backup time: %.2f seconds, %llu bytes read\n", outcome.took_s,
            (unsigned long long)(outcome.after.bytes_read - outcome.before.bytes_read));
    free(dump);
    return status;
}

int do_backup(struct cli *const cli, const char *const arg)
{
    remind_second_chip(cli);
    const int status = backup_to(cli, arg);
    if (status == DONE)
        json_result(cli, "backup");
    return status;
}

/* The side file that a backup of ours has beside it: the first line names the card (H13). */
static int check_origin(struct cli *const cli, const char *const path)
{
    enum { MOST = 4096 };
    static const char key[] = "card: ";
    char side[4096];
    size_t len;
    snprintf(side, sizeof side, "%s.card", path);
    uint8_t *const text = whole_file(side, MOST, &len);
    if (!text)
        return DONE; /* mesaflash makes none */
    int status = DONE;
    text[len] = '\0';
    text[strcspn((char *)text, "\r\n")] = '\0';
    if (strncmp((char *)text, key, sizeof key - 1) == 0 && strcmp((char *)text + sizeof key - 1, card_name(cli)) != 0)
        status = complain(cli, REFUSED, "the dump is from a %.32s and this card is a %s", (char *)text + sizeof key - 1,
                          card_name(cli));
    free(text);
    return status;
}

static int restore_dump(struct cli *const cli, const char *const path, const uint8_t *const dump, const size_t len)
{
    struct flash_job *job = NULL;
    struct outcome outcome = {0};
    int status = check_side_file(cli, path, dump, len, true, "Backup file");
    if (status == DONE)
        status = check_origin(cli, path);
    if (status != DONE)
        return status;
    announce(cli, dump, len, whole);
    const struct flash_options options = options_of(cli, path);
    const int err = flash_job_restore(&job, cli->card, dump, len, &options, &cli->diag);
    if (err < 0)
        return report(cli, err);
    status = make_plan(cli, job);
    if (status == DONE)
        print_plan(cli, job);
    if (status == DONE && cli->dry_run)
        json_plan(cli, job);
    if (status == DONE && !cli->dry_run) {
        status = back_up_before(cli, job);
        if (status == DONE)
            status = run(cli, job, &outcome);
        if (status == DONE) {
            say(cli, "Board FLASH memory writed successfully.\nBoard FLASH memory verified successfully.\n");
            print_outcome(cli, "restored", job, &outcome);
        }
    }
    flash_job_free(job);
    return status;
}

int do_restore(struct cli *const cli, const char *const arg)
{
    size_t len;
    uint8_t *const dump = load(cli, arg, "backup file", &len);
    if (!dump)
        return REFUSED;
    say(cli, "\nRestoring backup %s FLASH memory on the %s board:\n", cli->info->chip ? cli->info->chip->name : "?",
        card_name(cli));
    const int status = restore_dump(cli, arg, dump, len);
    free(dump);
    return status;
}

int do_program(struct cli *const cli, const char *const arg)
{
    (void)arg;
    say(cli, "ERROR: Board %s doesn't support FPGA programming.\n", card_name(cli));
    return complain(cli, REFUSED, "--write FILE --reload does it by way of the flash");
}

/* ---- image files
 * ---------------------------------------------------------------------------------------------------------- */

void print_image(const struct cli *const cli, const struct flash_image *const image)
{
    if (image->family == FLASH_XILINX)
        say(cli, "  Design name: %s\n  Part name: %s\n  Design date: %s\n  Design time: %s\n  Config Length: %zu\n",
            image->design, image->part, image->date, image->time, image->payload_bytes);
    else
        say(cli,
            "  Compiler Version: %s\n  Generated: %s\n  Project: %s\n  Family: %s\n  Device: %s\n  Width: %s\n"
            "  Mode: %s\n  PADDED_BITS: %s\n",
            image->compiler, image->generated, image->project, image->series, image->part, image->width, image->mode,
            image->padded_bits);
}

static void json_image(const struct cli *const cli, const struct flash_image *const image, const char *const hash)
{
    json_begin(cli);
    json_text(cli, "type", image->family == FLASH_XILINX ? "Xilinx bit file" : "Efinix bin file");
    json_text(cli, "part", image->part);
    json_text(cli, "design", image->family == FLASH_XILINX ? image->design : image->project);
    json_text(cli, "made", image->family == FLASH_XILINX ? image->date : image->generated);
    json_number(cli, "bytes", (double)image->payload_bytes);
    json_bool(cli, "fallback", image->pointers);
    json_bool(cli, "damaged", image->hazards & FLASH_HAZARD_DAMAGED);
    json_bool(cli, "safe", image->hazards == 0);
    json_text(cli, "sha256", hash);
    json_end(cli);
}

int do_info(struct cli *const cli, const char *const arg)
{
    struct flash_image image;
    char hash[SHA256_TEXT];
    size_t len;
    uint8_t *const bytes = whole_file(arg, IMAGE_MOST, &len);
    if (!bytes)
        return complain(cli, REFUSED, "Can't open file %s: %s", arg, strerror(errno));
    const bool verbose = cli->verbose;
    cli->verbose = true;
    int status = parse_image(cli, bytes, len, &image);
    cli->verbose = verbose;
    if (status == DONE && image.hazards & FLASH_HAZARD_DAMAGED)
        status =
            complain(cli, FAILED, "the file is damaged: its contents do not fit the check sums in it. Load it again");
    if (status != REFUSED && cli->json) {
        sha256_text(bytes, len, hash);
        json_image(cli, &image, hash);
    }
    free(bytes);
    return status;
}
