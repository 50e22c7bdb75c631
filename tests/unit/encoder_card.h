/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * One encoder counter as the card has it, for tests of the encoder driver: count, time stamp, control word with its
 * latches (tests/data/encoder). It works on the register file of a module rig.
 */
#ifndef ENCODER_CARD_H
#define ENCODER_CARD_H

#include "module_rig.h"

struct encoder_card {
    struct module_rig *rig;
    uint16_t base;      /* of the module */
    int64_t count;      /* true counts */
    int64_t ticks;      /* of the time-stamp counter */
    int64_t edge_ticks; /* at the last count */
    uint32_t control;   /* bits 15..3 */
    uint16_t latch;
    bool new_quad_error; /* newer firmware: writing bit 15 as 1 clears it and 0 leaves it */
};

/* A rig with the driver loaded and the card behind it. config as in config=. */
struct encoder_card encoder_card_open(const struct hm2_image *image, const char *config,
                                      const struct hm2_module_type *type);
/* Time passes; then `counts` edges happen (the last of them now). */
void encoder_card_move(struct encoder_card *card, int64_t ticks, int counts);
void encoder_card_index(struct encoder_card *card);
void encoder_card_quad_error(struct encoder_card *card);
/* Read cycle, write cycle, what was written reaches the card unless the rig loses it; a period passes on the host. */
void encoder_card_cycle(struct encoder_card *card);
/* Show the card's state in the registers. */
void encoder_card_show(const struct encoder_card *card);
/* Take over what the last write datagram brought. */
void encoder_card_take(struct encoder_card *card);

#endif
