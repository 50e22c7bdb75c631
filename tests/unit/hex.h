/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Hexadecimal text of the manuals and traces to bytes. */
#ifndef TEST_HEX_H
#define TEST_HEX_H

#include <stddef.h>
#include <stdint.h>

/* Bytes of text (blanks are skipped) into data; fails the test on a bad digit, an odd count or too little room. */
size_t hex_bytes(const char *text, uint8_t *data, size_t capacity);

#endif
