/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Writing registers of a board, at the start and in the cycle. */
#include "ppmc_private.h"

#define TRIES        2u
#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

static int write_register(struct ppmc *const ppmc, const struct ppmc_board *const board,
                          const struct ppmc_write *const write)
{
    uint8_t address = (uint8_t)(board->base + write->offset), value = write->value;
    const struct epp_step steps[] = {{EPP_ADDRESS_WRITE, 1, &address}, {EPP_DATA_WRITE, 1, &value}};
    int err = HM2_ERR_TIMEOUT;
    for (unsigned i = 0; err != 0 && i < TRIES; i++) {
        struct epp_done done;
        err = epp_run(ppmc->epp, steps, COUNT(steps), &done);
        if (err)
            ppmc_count_error(ppmc, err);
    }
    return err;
}

int ppmc_write_registers(struct ppmc *const ppmc, const struct ppmc_board *const board,
                         const struct ppmc_write *const writes, const size_t count)
{
    int err = 0;
    for (size_t i = 0; err == 0 && i < count; i++)
        err = write_register(ppmc, board, &writes[i]);
    return err;
}

int ppmc_restore(struct ppmc *const ppmc, struct ppmc_board *const board)
{
    const struct ppmc_write writes[] = {
        {PPMC_W_CONTROL, 0}, {PPMC_W_ASSEMBLY, 0},           {PPMC_W_ASSEMBLY + 1, 0},       {PPMC_W_ASSEMBLY + 2, 0},
        {PPMC_W_TIMER, 0},   {PPMC_W_PRESET, board->preset}, {PPMC_W_FILTER, board->filter},
    };
    size_t count = COUNT(writes);
    if (!board->sets_filter)
        count--;
    return ppmc_write_registers(ppmc, board, writes, count);
}
