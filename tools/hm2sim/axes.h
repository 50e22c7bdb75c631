/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The machine at a simulated card: encoders that turn, and switches that axes press. */
#ifndef HM2SIM_AXES_H
#define HM2SIM_AXES_H

#include "options.h"

struct axes {
    const struct card_options *options;
    struct sim_card *card;
    bool pressed[MAX_WIRES];          /* a switch has set its pad yet */
    enum sim_level levels[MAX_WIRES]; /* to this */
};

/* Couple what the options say, when the peers with motors of their own are connected. On an error diag says which
 * option this card cannot have. */
int HM2_MUST_CHECK axes_connect(struct axes *axes, const struct card_options *options, struct sim_card *card,
                                struct hm2_diag *diag);
/* Set the pads with switches as the axes are now. */
void axes_run(struct axes *axes);
/* Print where axes with an encoder are, a line each; `name` in front. */
void axes_print(const struct axes *axes, const char *name);

#endif
