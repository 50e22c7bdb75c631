/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "whole_file.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

void *whole_file(const char *const path, const size_t most, size_t *const len)
{
    FILE *const file = fopen(path, "rbe");
    char *const text = file ? malloc(most + 1) : NULL;
    int error = text ? 0 : errno;
    if (text) {
        *len = fread(text, 1, most + 1, file);
        if (ferror(file))
            error = errno ? errno : EIO;
        else if (*len > most)
            error = EFBIG;
        else
            text[*len] = '\0';
    }
    if (file)
        (void)fclose(file);
    if (error == 0)
        return text;
    free(text);
    errno = error;
    return NULL;
}
