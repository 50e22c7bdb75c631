/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "idrom_files.h"
#include "unit.h"

#define MD_WORDS 3u

char *load_text(const char *const path, size_t *const len)
{
    FILE *const file = fopen(path, "rb");
    if (!file)
        fail_msg("%s cannot be opened", path);
    const size_t capacity = 1u << 20;
    char *const text = malloc(capacity);
    assert_non_null(text);
    *len = fread(text, 1, capacity - 1, file);
    text[*len] = '\0';
    const int closed = fclose(file);
    assert_int_equal(closed, 0);
    return text;
}

void load_image(const char *const path, struct hm2_image *const image)
{
    size_t len;
    char *const text = load_text(path, &len);
    struct hm2_diag diag = {0};
    if (hm2_image_from_text(text, len, image, &diag) != 0)
        fail_msg("%s: %s", path, diag.text);
    free(text);
}

void set_image_version(struct hm2_image *const image, const uint8_t gtag, const uint8_t version)
{
    for (uint32_t *md = image->rom + image->rom[1] / 4; *md & 0xFFu; md += MD_WORDS) {
        if ((*md & 0xFFu) != gtag)
            continue;
        *md = (*md & 0xFFFF00FFu) | (uint32_t)version << 8;
        return;
    }
    fail_msg("no module 0x%02X", gtag);
}
