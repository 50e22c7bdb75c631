/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "flash.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#define MAX_PATH 4096

/* ---- options ----------------------------------------------------------------------------------------------------- */

bool flash_chip_option(const char *const text, uint8_t *const id)
{
    static const char *const names[] = {"2Mb", "4Mb", "8Mb", "16Mb", "32Mb", "64Mb"};
    enum { FIRST_ID = 0x11 };
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        if (strcmp(names[i], text) != 0)
            continue;
        *id = (uint8_t)(FIRST_ID + i);
        return true;
    }
    return false;
}

static bool number(const char **const text, const int base, const unsigned long max, unsigned long *const value)
{
    char *end;
    errno = 0;
    *value = strtoul(*text, &end, base);
    if (end == *text || **text == '-' || **text == ' ' || errno || *value > max)
        return false;
    *text = end;
    return true;
}

/* ":" and a number, when there is one. */
static bool further(const char **const text, const unsigned long max, unsigned long *const value)
{
    if (**text != ':')
        return true;
    ++*text;
    return number(text, 10, max, value);
}

/* ADDRESS:MASK[:TIMES], both in hexadecimal */
static bool read_bad(const char **const text, struct sim_flash_faults *const f)
{
    unsigned long address, mask, times = UINT_MAX;
    if (f->bad_count == SIM_FLASH_BAD_BITS || !number(text, 16, UINT32_MAX, &address) || *(*text)++ != ':' ||
        !number(text, 16, UINT8_MAX, &mask) || !further(text, UINT_MAX, &times))
        return false;
    f->bad[f->bad_count++] = (struct sim_flash_bad){(uint32_t)address, (uint8_t)mask, (unsigned)times, (unsigned)times};
    return true;
}

static bool read_fault(const char **const text, struct sim_flash_faults *const f)
{
    static const struct {
        const char *name;
        size_t len;
    } kinds[] = {{"cut=", 4}, {"stick=", 6}, {"bad=", 4}};
    unsigned long at, bytes = 0;
    size_t kind = 0;
    while (kind < 3 && strncmp(*text, kinds[kind].name, kinds[kind].len) != 0)
        kind++;
    if (kind == 3)
        return false;
    *text += kinds[kind].len;
    if (kind == 2)
        return read_bad(text, f);
    if (!number(text, 10, UINT32_MAX, &at) || at == 0)
        return false;
    if (kind == 1) {
        f->stuck_at = at;
        return true;
    }
    f->cut_at = at;
    const bool good = further(text, 256, &bytes);
    f->cut_bytes = (unsigned)bytes;
    return good;
}

int flash_faults_option(const char *text, struct sim_flash_faults *const faults, struct hm2_diag *const diag)
{
    struct sim_flash_faults f = {.seed = 1};
    const char *const all = text;
    bool good = true;
    for (bool more = strcmp(text, "none") != 0; more && good;) {
        good = read_fault(&text, &f) && (*text == '\0' || *text == ',');
        more = *text == ',';
        text += more;
    }
    if (!good)
        return hm2_diag_add(diag, HM2_ERR_INVALID,
                            "flash faults \"%s\": expected cut=OPERATION[:BYTES], stick=OPERATION, "
                            "bad=ADDRESS:MASK[:TIMES], separated by commas, or none",
                            all);
    *faults = f;
    return 0;
}

/* ---- the file ---------------------------------------------------------------------------------------------------- */

static int failed(struct hm2_diag *const diag, const char *const path, const char *const what)
{
    return hm2_diag_add(diag, HM2_ERR_IO, "flash file %s: %s: %s", path, what, strerror(errno));
}

/* Whole or not at all: written under another name, then renamed. */
static int make_file(const char *const path, const uint8_t *const bytes, const size_t size, struct hm2_diag *const diag)
{
    char name[MAX_PATH];
    const int len = snprintf(name, sizeof name, "%s.%ld", path, (long)getpid());
    if (len < 0 || (size_t)len >= sizeof name)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "flash file %s: the path is too long", path);
    const int fd = open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0)
        return failed(diag, name, "cannot be made");
    size_t done = 0;
    ssize_t n = 1;
    while (done < size && n > 0) {
        n = write(fd, bytes + done, size - done);
        done += n > 0 ? (size_t)n : 0;
    }
    const bool good = done == size && fsync(fd) == 0;
    close(fd);
    if (good && rename(name, path) == 0)
        return 0;
    const int err = failed(diag, path, "cannot be written");
    unlink(name);
    return err;
}

static int map_file(struct flash_file *const file, const char *const path, struct hm2_diag *const diag)
{
    struct stat st;
    if (flock(file->fd, LOCK_EX | LOCK_NB))
        return hm2_diag_add(diag, HM2_ERR_STATE, "flash file %s: another hm2sim uses it", path);
    if (fstat(file->fd, &st))
        return failed(diag, path, "cannot be looked at");
    if ((size_t)st.st_size != file->size)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "flash file %s has %lld bytes, the chip has %zu: give --flash-chip",
                            path, (long long)st.st_size, file->size);
    void *const bytes = mmap(NULL, file->size, PROT_READ | PROT_WRITE, MAP_SHARED, file->fd, 0);
    if (bytes == MAP_FAILED)
        return failed(diag, path, "cannot be mapped");
    file->bytes = bytes;
    return 0;
}

/* What the chip does is in the file at once: whenever the program ends, however it does, the file is what a chip would
 * hold when the power went then. */
static int open_file(struct flash_file *const file, const char *const path, struct sim_card *const card,
                     struct hm2_diag *const diag)
{
    const uint8_t *const factory = sim_card_flash(card, &file->size);
    if (access(path, F_OK) != 0) {
        const int err = make_file(path, factory, file->size, diag);
        if (err)
            return err;
    }
    file->fd = open(path, O_RDWR | O_CLOEXEC);
    if (file->fd < 0)
        return failed(diag, path, "cannot be opened");
    int err = map_file(file, path, diag);
    if (!err)
        err = sim_card_flash_memory(card, file->bytes, file->size);
    return err;
}

int flash_open(struct flash_file *const file, const struct flash_options *const options, struct sim_card *const card,
               struct hm2_diag *const diag)
{
    *file = (struct flash_file){.fd = -1};
    sim_card_trust_images(card, true);
    sim_card_jumpers(card, options->jumpers);
    if (options->times)
        sim_card_flash_times(card, options->times);
    sim_card_flash_faults(card, &options->faults);
    return options->file ? open_file(file, options->file, card, diag) : 0;
}

void flash_close(struct flash_file *const file)
{
    if (file->bytes) {
        (void)msync(file->bytes, file->size, MS_SYNC);
        (void)munmap(file->bytes, file->size);
    }
    if (file->fd > 0)
        close(file->fd);
}
