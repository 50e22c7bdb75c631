/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A simulated card as it is delivered (boot block, fallback image, no user image) and an image for it. */
#ifndef FLASH_RIG_H
#define FLASH_RIG_H

#include "unit.h"

#include <hm2/flash.h>
#include <hm2/sim_flash.h>

#define RIG_USER   0x100000u /* start of the user area of a 16 Mbit chip */
#define RIG_SECTOR 65536u

struct flash_rig {
    struct sim_card *sim;
    struct sim_net *net;
    struct flash_card *card;
    struct flash_job *job;
    struct flash_options options;
    struct hm2_diag diag;
    bool xilinx;
    uint8_t *flash; /* of the simulated card */
    size_t flash_bytes;
    uint8_t *file;
    size_t len;
    struct flash_image image; /* in file */
};

/* For cmocka; *state is a struct flash_rig. */
int flash_rig_7i93(void **state);
int flash_rig_7i96s(void **state);
int flash_rig_unknown_chip(void **state); /* a 7I93 */
int flash_rig_free(void **state);
/* A test on one of them, by a name of its own. */
#define ON_7I93(test)  ((struct CMUnitTest){#test " (7I93)", test, flash_rig_7i93, flash_rig_free, NULL})
#define ON_7I96S(test) ((struct CMUnitTest){#test " (7I96S)", test, flash_rig_7i96s, flash_rig_free, NULL})

/* Make another image the one to be written: a good one from a seed, or any. */
void flash_rig_image(struct flash_rig *rig, uint64_t seed, bool fallback);
void flash_rig_take(struct flash_rig *rig, const struct sim_flash_file *file);
/* Plan and run a write; its error. */
int flash_rig_write(struct flash_rig *rig);
/* The same, which must succeed. */
void flash_rig_must_write(struct flash_rig *rig);
/* A new link and card, as another run of a program has them. */
void flash_rig_reopen(struct flash_rig *rig);
void flash_rig_assert_image(const struct flash_rig *rig, uint32_t at);
/* The write is refused with this error and a sentence that has `words` in it, and nothing has been erased or written.
 */
void flash_rig_assert_refused(struct flash_rig *rig, int err, const char *words);

#endif
