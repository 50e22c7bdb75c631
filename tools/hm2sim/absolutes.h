/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Absolute encoders at a simulated card's readers (SSI, BISS, Fanuc): what they send, and what turns them. */
#ifndef HM2SIM_ABSOLUTES_H
#define HM2SIM_ABSOLUTES_H

#include <hm2/sim.h>

#define MAX_ABSOLUTES 32u

/* Bits of the data that carry a part of the position. */
struct absolute_field {
    unsigned at, width; /* lowest bit; 0 wide = not there */
    bool gray;
};

struct absolute_encoder {
    uint8_t gtag; /* SSI, BISS or FanucAbs */
    unsigned unit;
    struct sim_absolute data;              /* as it is without the position */
    struct absolute_field position, turns; /* turns: of the position, what is above the first field */
    int64_t start;                         /* position at time 0 and where the axis is at 0 */
    double speed;                          /* a second */
    uint8_t axis_gtag;                     /* step generator or encoder that it turns with; 0 = none */
    unsigned axis;
    int32_t num, den; /* of its position for each of that */
};

/* "ssi.0:KEY=VALUE,..." (hm2sim(1)), or "ssi.0:none". On an error diag says what was expected. */
int HM2_MUST_CHECK absolute_option(const char *text, struct absolute_encoder *encoder, struct hm2_diag *diag);

struct absolutes {
    struct sim_card *card;
    unsigned count;
    struct absolute_encoder encoders[MAX_ABSOLUTES];
};

/* Attach them; also one more, or another one at the same reader, while the card runs. */
int HM2_MUST_CHECK absolutes_connect(struct absolutes *absolutes, struct sim_card *card,
                                     const struct absolute_encoder *encoders, unsigned count, struct hm2_diag *diag);
int HM2_MUST_CHECK absolutes_add(struct absolutes *absolutes, const struct absolute_encoder *encoder, int64_t now_ns,
                                 struct hm2_diag *diag);
/* Time has come to now_ns: those that move are where they are then. */
void absolutes_run(struct absolutes *absolutes, int64_t now_ns);
bool absolutes_move(const struct absolutes *absolutes);

#endif
