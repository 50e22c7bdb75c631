/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The configuration flash of a simulated card: chip, times, faults, and a file that keeps it. */
#ifndef HM2SIM_FLASH_H
#define HM2SIM_FLASH_H

#include <hm2/sim_flash.h>

struct flash_options {
    const char *file; /* NULL = forgotten at the end */
    uint8_t id;       /* 0 = the card's own chip */
    const struct sim_flash_times *times;
    struct sim_flash_faults faults;
    unsigned jumpers;
};

/* The file in memory; all zero = none. */
struct flash_file {
    uint8_t *bytes;
    size_t size;
    int fd;
};

/* "16Mb" and its like. */
bool flash_chip_option(const char *text, uint8_t *id);
/* "cut=9:128,stick=3,bad=100000:01:2", or "none": an error with a sentence in diag. */
int flash_faults_option(const char *text, struct sim_flash_faults *faults, struct hm2_diag *diag);

/* Give a card what the options say. A file that is not there is made with what a new card's flash holds. */
int HM2_MUST_CHECK flash_open(struct flash_file *file, const struct flash_options *options, struct sim_card *card,
                              struct hm2_diag *diag);
/* After the card has gone. */
void flash_close(struct flash_file *file);

#endif
