/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef TOOLS_WHOLE_FILE_H
#define TOOLS_WHOLE_FILE_H

#include <stddef.h>

/* A file of at most `most` bytes in memory, with a NUL behind it; free() it. NULL with errno set (EFBIG: longer). */
void *whole_file(const char *path, size_t most, size_t *len);

#endif
