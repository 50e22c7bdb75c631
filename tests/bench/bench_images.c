/* SPDX-License-Identifier: GPL-2.0-or-later */
/* bench_images CARD FOLDER: image files CARD-old, CARD-new (another build) and CARD-near (differs in its last sector).
 */
#include <stdio.h>
#include <stdlib.h>

#include <hm2/sim_flash.h>

static int make(const char *const card, const char *const folder, const char *const name,
                const struct sim_flash_file *const file)
{
    static uint8_t bytes[SIM_FLASH_FILE_BYTES];
    char path[512];
    snprintf(path, sizeof path, "%s/%s-%s", folder, card, name);
    const size_t len = sim_flash_file(file, bytes, sizeof bytes);
    FILE *const out = fopen(path, "wb");
    if (!out)
        return 1;
    const bool good = len > 0 && fwrite(bytes, 1, len, out) == len;
    return fclose(out) == 0 && good ? 0 : 1;
}

int main(const int argc, char **const argv)
{
    enum { LATE = 2000 };
    if (argc != 3)
        return 2;
    const struct sim_flash_file old = {.profile = argv[1], .seed = 1, .late_seed = 1, .late_bytes = LATE};
    const struct sim_flash_file near = {.profile = argv[1], .seed = 1, .late_seed = 2, .late_bytes = LATE};
    const struct sim_flash_file new = {.profile = argv[1], .seed = 2};
    return make(argv[1], argv[2], "old", &old) || make(argv[1], argv[2], "near", &near) ||
           make(argv[1], argv[2], "new", &new);
}
