/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef TEST_TEXT_FILE_H
#define TEST_TEXT_FILE_H

#include <stddef.h>

/* A whole file of tests/data, NUL terminated, to be freed. Fails the running test when it cannot be read. */
char *text_file(const char *name, size_t *len);

#endif
