/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "flash_rig.h"

#include <check.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define RUN_MS     60000
#define MESA_TRIES 8
#define MAX_ARGS   16
#define FILE_BYTES 4194304u

static void folder(char *const path, const size_t size)
{
    snprintf(path, size, "/tmp/check-flash-%d", (int)getpid());
}

const char *flash_rig_path(const char *const name)
{
    static char paths[8][160];
    static unsigned next;
    char own[64];
    char *const path = paths[next++ % 8];
    folder(own, sizeof own);
    (void)mkdir(own, 0777);
    snprintf(path, sizeof paths[0], "%s/%s", own, name);
    return path;
}

void flash_rig_clean(void)
{
    char own[64];
    folder(own, sizeof own);
    DIR *const dir = opendir(own);
    if (!dir)
        return;
    for (const struct dirent *entry; (entry = readdir(dir)) != NULL;)
        if (entry->d_name[0] != '.')
            unlink(flash_rig_path(entry->d_name));
    closedir(dir);
    rmdir(own);
}

const char *flash_rig_image(const char *const name, const struct sim_flash_file *const file)
{
    static uint8_t bytes[SIM_FLASH_FILE_BYTES];
    const char *const path = flash_rig_path(name);
    const size_t len = sim_flash_file(file, bytes, sizeof bytes);
    ck_assert_uint_gt(len, 0);
    FILE *const out = fopen(path, "wb");
    ck_assert_ptr_nonnull(out);
    ck_assert_uint_eq(fwrite(bytes, 1, len, out), len);
    ck_assert_int_eq(fclose(out), 0);
    return path;
}

const uint8_t *flash_rig_read(const char *const path, size_t *const len)
{
    static uint8_t files[2][FILE_BYTES];
    static unsigned next;
    uint8_t *const bytes = files[next++ % 2];
    FILE *const in = fopen(path, "rb");
    if (!in)
        ck_abort_msg("%s is not there", path);
    *len = fread(bytes, 1, FILE_BYTES, in);
    ck_assert_int_eq(fclose(in), 0);
    return bytes;
}

int flash_rig_run(struct process *const process, const char *const program, const char *const device,
                  const char *const address, const char *const *args)
{
    const char *argv[MAX_ARGS] = {program, "--device", device, "--addr", address};
    unsigned n = 5;
    for (; *args; args++) {
        ck_assert_uint_lt(n + 1, MAX_ARGS);
        argv[n++] = *args;
    }
    argv[n] = NULL;
    int status = -1;
    for (unsigned i = 0; i < MESA_TRIES; i++) {
        status = process_run(process, argv, RUN_MS);
        if (!strstr(process->text, "board found") || strcmp(program, "mesaflash") != 0)
            break;
    }
    return status;
}
