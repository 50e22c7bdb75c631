/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Firmware images of the test data, and how to change them. */
#ifndef IDROM_FILES_H
#define IDROM_FILES_H

#include <hm2/idrom.h>

#define IDROM_7I96S TEST_DATA "/idrom_7i96s/7i96s_d.hex"

/* Fails the running test when the file cannot be read or is malformed. */
void load_image(const char *path, struct hm2_image *image);
/* Of the first descriptor with this tag in the image's module table. Fails the running test when there is none. */
void set_image_version(struct hm2_image *image, uint8_t gtag, uint8_t version);
/* Whole file, NUL terminated, from malloc. */
char *load_text(const char *path, size_t *len);

#endif
