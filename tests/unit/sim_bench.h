/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A started board on a simulated card, with the firmware of a recording if wanted, in virtual time. */
#ifndef SIM_BENCH_H
#define SIM_BENCH_H

#include <hm2/board.h>
#include <hm2/sim.h>

#define BENCH_PERIOD_NS 1000000

struct sim_bench {
    struct sim_card *card;
    struct sim_net *net;
    struct hm2_board *board;
    struct hm2_plain_binder *plain;
    struct hm2_diag diag;
    int64_t now_ns;
};

/* firmware: of replay_firmware(), NULL = the profile's. Fails the test when something does not work. */
struct sim_bench *sim_bench_new(const char *profile, const char *firmware, const char *config);
/* The same with any card. */
struct sim_bench *sim_bench_of(const struct sim_card_options *options, const char *config);
void sim_bench_free(struct sim_bench *bench);
/* Read, write, and the rest of the period. */
void sim_bench_cycle(struct sim_bench *bench);
/* Points, by their names without the board's; one that is not there fails the test, but for sim_bench_has(). */
double sim_bench_get(const struct sim_bench *bench, const char *name);
void sim_bench_set(const struct sim_bench *bench, const char *name, double value);
bool sim_bench_has(const struct sim_bench *bench, const char *name);

#endif
