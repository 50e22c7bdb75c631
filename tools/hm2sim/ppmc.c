/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "ppmc.h"

#include <inttypes.h>
#include <stdio.h>

#define BOARD_ID 0x14u

/* In the bus's own time, which is ahead by the cycles of a request, the step generator has not moved on. */
static int64_t position_of(void *const context, const int64_t now_ns)
{
    const struct shaft *const shaft = context;
    int64_t position = 0;
    (void)now_ns;
    (void)!sim_card_turned(shaft->ppmc->card, HM2_GTAG_STEPGEN, shaft->stepgen, &position); /* ppmc_open() has tried */
    return position;
}

static unsigned slot_of(const unsigned axis)
{
    return axis / SIM_PPMC_AXES * 2;
}

static int add_axis(struct ppmc_bus *const ppmc, const unsigned axis)
{
    const int err = axis % SIM_PPMC_AXES == 0 ? sim_ppmc_add(ppmc->bus, slot_of(axis), BOARD_ID) : 0;
    ppmc->shafts[axis] = (struct shaft){ppmc, axis};
    sim_ppmc_follow(ppmc->bus, slot_of(axis), axis % SIM_PPMC_AXES, position_of, &ppmc->shafts[axis]);
    return err;
}

int ppmc_open(struct ppmc_bus *const ppmc, struct sim_card *const card, const char *const path,
              struct hm2_diag *const diag)
{
    int64_t position;
    int err = 0;
    ppmc->card = card;
    ppmc->bus = sim_ppmc_new(NULL);
    if (!ppmc->bus)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for an EPP bus");
    while (!err && ppmc->axis_count < PPMC_MAX_AXES &&
           sim_card_turned(card, HM2_GTAG_STEPGEN, ppmc->axis_count, &position) == 0)
        err = add_axis(ppmc, ppmc->axis_count++);
    if (err || ppmc->axis_count == 0)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "--ppmc: this card has no step generator");
    return sim_ppmc_server_open(&ppmc->server, path, diag);
}

void ppmc_close(struct ppmc_bus *const ppmc)
{
    sim_ppmc_server_close(ppmc->server);
    sim_ppmc_free(ppmc->bus);
}

void ppmc_turn(struct ppmc_bus *const ppmc, const int64_t now_ns)
{
    if (!ppmc->card)
        return;
    sim_card_advance(ppmc->card, sim_card_clock_at(ppmc->card, now_ns));
    sim_ppmc_set_time(ppmc->bus, now_ns);
    for (unsigned slot = 0; slot <= slot_of(ppmc->axis_count - 1); slot += 2)
        (void)sim_ppmc_registers(ppmc->bus, slot); /* a board lives when it is looked at */
}

void ppmc_receive(struct ppmc_bus *const ppmc)
{
    sim_ppmc_server_run(ppmc->server, ppmc->bus);
}

void ppmc_print(struct ppmc_bus *const ppmc, const char *const name)
{
    for (unsigned i = 0; ppmc->card && i < ppmc->axis_count; i++) {
        const struct sim_ppmc_truth t = sim_ppmc_truth(ppmc->bus, slot_of(i), i % SIM_PPMC_AXES);
        printf("%s: ppmc %u.%u counted %" PRId64 " of %" PRId64 " edges, illegal %" PRIu64 "\n", name, slot_of(i),
               i % SIM_PPMC_AXES, t.counted, t.shaft, t.illegal);
    }
}
