/* SPDX-License-Identifier: GPL-2.0-or-later */
/* bench_images CARD FOLDER: image files CARD-old, CARD-new (another build) and CARD-near (differs from old in its last
 * sector); CARD-base and CARD-similar (differ in their last 70,000 bytes). */
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
    static const struct {
        const char *name;
        uint64_t seed, late_seed;
        size_t late_bytes;
    } rows[] = {
        {"old", 1, 1, 2000}, {"near", 1, 2, 2000}, {"new", 2, 0, 0}, {"base", 1, 1, 70000}, {"similar", 1, 2, 70000}};
    if (argc != 3)
        return 2;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct sim_flash_file file = {
            .profile = argv[1], .seed = rows[i].seed, .late_seed = rows[i].late_seed, .late_bytes = rows[i].late_bytes};
        if (make(argv[1], argv[2], rows[i].name, &file) != 0)
            return 1;
    }
    return 0;
}
