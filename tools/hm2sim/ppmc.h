/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Encoder boards on an EPP bus whose shafts turn with a card's step generators. */
#ifndef HM2SIM_PPMC_H
#define HM2SIM_PPMC_H

#include <hm2/sim.h>
#include <hm2/sim_ppmc.h>

#define PPMC_MAX_AXES (SIM_PPMC_SLOTS / 2 * SIM_PPMC_AXES)

struct shaft {
    struct ppmc_bus *ppmc;
    unsigned stepgen;
};

struct ppmc_bus {
    struct sim_card *card; /* NULL = the card has no such bus */
    struct sim_ppmc *bus;
    struct sim_ppmc_server *server;
    unsigned axis_count;
    struct shaft shafts[PPMC_MAX_AXES];
};

/* A board at the addresses 0, 2, 4, ... for every four step generators of the card, on a bus behind a socket. On an
 * error diag says why; the caller closes. */
int HM2_MUST_CHECK ppmc_open(struct ppmc_bus *ppmc, struct sim_card *card, const char *path, struct hm2_diag *diag);
void ppmc_close(struct ppmc_bus *ppmc);
/* The shafts turn to where the step generators are now. Nothing without a bus. */
void ppmc_turn(struct ppmc_bus *ppmc, int64_t now_ns);
/* Answer who asks. The shafts must be where they are now. */
void ppmc_receive(struct ppmc_bus *ppmc);
/* Print what the boards have counted, a line an axis; `name` in front. */
void ppmc_print(struct ppmc_bus *ppmc, const char *name);

#endif
