/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What the files of this component share. */
#ifndef HM2_LBP16_CARDS_H
#define HM2_LBP16_CARDS_H

#include <hm2/board.h>

struct card;

/* The card that a name like "hm2_7i80.0.bspi.1" belongs to, and the number of its port; NULL, with a message, when
 * there is none. kind: "bspi". */
struct card *card_of_port(const char *name, const char *kind, unsigned *unit);
struct hm2_board *card_board(struct card *card);
/* From now on no function of the card touches its board: cycles are left out until card_resume(). */
void card_pause(struct card *card);
void card_resume(struct card *card);

#endif
