/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What must be true before anything is erased (flash tool reference 5). Each function adds every violation that it
 * finds to diag and returns 0, or the last one's error. */
#ifndef FLASH_CHECKS_H
#define FLASH_CHECKS_H

#include "card.h"

/* The card itself: known, with a known chip, and what its firmware says of its FPGA agrees. */
int HM2_MUST_CHECK flash_check_card(const struct flash_card *card, struct hm2_diag *diag);
/* File and card: FPGA, board, area, size, settings in the bitstream. */
int HM2_MUST_CHECK flash_check_image(const struct flash_card *card, const struct flash_image *image,
                                     const struct flash_options *options, struct hm2_diag *diag);
/* Size alone: for reading. */
int HM2_MUST_CHECK flash_check_fits(const struct flash_card *card, const struct flash_image *image,
                                    enum flash_area area, struct hm2_diag *diag);
/* A dump of the whole chip. */
int HM2_MUST_CHECK flash_check_dump(const struct flash_card *card, const uint8_t *dump, size_t len,
                                    const struct flash_options *options, struct hm2_diag *diag);
/* What is in the flash now: of the card's family, with a boot block, and another image than the one to be replaced. */
int HM2_MUST_CHECK flash_check_content(const struct flash_card *card, const struct flash_survey *survey,
                                       const struct flash_options *options, struct hm2_diag *diag);

/* The override names this very card; another name is a refusal of its own. */
int HM2_MUST_CHECK flash_check_override(const struct flash_card *card, const struct flash_options *options,
                                        struct hm2_diag *diag);
bool flash_can_start(enum flash_content content);

#endif
