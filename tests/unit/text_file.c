/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "text_file.h"

#include "unit.h"

char *text_file(const char *const name, size_t *const len)
{
    char path[512];
    (void)snprintf(path, sizeof path, "%s/%s", TEST_DATA, name);
    FILE *const file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END) != 0)
        fail_msg("cannot read %s", path);
    const long size = ftell(file);
    char *const text = malloc((size_t)size + 1u);
    assert_non_null(text);
    rewind(file);
    *len = fread(text, 1, (size_t)size, file);
    (void)fclose(file);
    text[*len] = '\0';
    return text;
}
