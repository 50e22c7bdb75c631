/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The names that mesaflash prints, which programs compare: not those of the library, which are LinuxCNC's. */
#ifndef HM2FLASH_NAMES_H
#define HM2FLASH_NAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/idrom.h>
#include <hm2/terminals.h>

const char *tag_text(uint8_t tag, bool xml, char *buf, size_t size);
/* Secondary function of a pin, without its direction. */
const char *pin_text(const struct hm2_pd *pd, bool xml, char *buf, size_t size);

#endif
