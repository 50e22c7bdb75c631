/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Cards with a flash in a file, image files, and Debian's mesaflash beside hm2flash. Failures end the test. */
#ifndef TEST_FLASH_RIG_H
#define TEST_FLASH_RIG_H

#include <hm2/sim_flash.h>

#include "simulator.h"

/* A folder of this test's own, removed by flash_rig_clean(). */
const char *flash_rig_path(const char *name); /* static storage, the last eight calls stay valid */
void flash_rig_clean(void);
/* Make an image file there and return its path. */
const char *flash_rig_image(const char *name, const struct sim_flash_file *file);
/* Whole file; len in *len. Static storage, the last two calls stay valid. */
const uint8_t *flash_rig_read(const char *path, size_t *len);

/* Run a program with these arguments (NULL-terminated) behind "--device DEVICE --addr ADDRESS"; its exit status. What
 * it printed is in *process. mesaflash gives a card 2 ms to answer: when it found none it is started again. */
int flash_rig_run(struct process *process, const char *program, const char *device, const char *address,
                  const char *const *args);

#endif
