/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Which boards are on a bus (ppmc.md section 4). */
#include <hm2/ppmc.h>

#include "registers.h"

#define LOOKS 3u /* at each ID: one that changes is no ID */

/* By the high half of the ID byte; the low half is the version of the firmware, from which on these things exist
 * (ppmc.md sections 2.9 and 4). */
static const struct {
    uint8_t type;
    const char *name;
    uint8_t encoders;
    uint8_t two_slots_from, index_from, filter_from, timestamps_from;
} types[] = {
#define NEVER 16
    {0x1, "PPMC encoder board", 4, 4, 2, 4, 4},
    {0x2, "PPMC DAC16 board", 0, NEVER, NEVER, NEVER, NEVER},
    {0x3, "PPMC DIO board", 0, NEVER, NEVER, NEVER, NEVER},
    {0x4, "universal stepper controller (USC)", 4, 0, 2, NEVER, NEVER},
    {0x5, "universal PWM controller (UPC)", 4, 0, 2, NEVER, 4},
};

/* Version 15 is no version: a read that nobody answers tends to bring the address of the ID register. */
static bool is_absent(const uint8_t id)
{
    return id == 0x00 || (id & 0x0Fu) == 0x0Fu;
}

bool ppmc_identify(const uint8_t id, struct ppmc_board_info *const info)
{
    const uint8_t version = id & 0x0Fu;
    *info = (struct ppmc_board_info){.id = id, .name = "unknown", .slots = 1};
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++) {
        if (types[i].type != id >> 4 || is_absent(id))
            continue;
        *info = (struct ppmc_board_info){
            .id = id,
            .name = types[i].name,
            .slots = version >= types[i].two_slots_from ? 2 : 1,
            .encoders = types[i].encoders,
            .index = version >= types[i].index_from,
            .filter = version >= types[i].filter_from,
            .timestamps = version >= types[i].timestamps_from,
        };
        return true;
    }
    return false;
}

double ppmc_filter_mhz(const enum ppmc_filter filter)
{
    static const double mhz[PPMC_FILTERS] = {1.0, 2.5, 5.0, 10.0};
    return filter < PPMC_FILTERS ? mhz[filter] : 0.0;
}

static int read_id(struct epp *const epp, const unsigned slot, uint8_t *const id)
{
    uint8_t address = (uint8_t)(slot * PPMC_SLOT_ADDRESSES + PPMC_R_ID);
    const struct epp_step steps[] = {{EPP_ADDRESS_WRITE, 1, &address}, {EPP_DATA_READ, 1, id}};
    struct epp_done done;
    return epp_run(epp, steps, sizeof steps / sizeof steps[0], &done);
}

/* 0 also for an empty slot, whose ID is 0 then. */
static int look(struct epp *const epp, const unsigned slot, struct ppmc_board_info *const info,
                struct hm2_diag *const diag)
{
    uint8_t first = 0, id = 0;
    *info = (struct ppmc_board_info){0};
    for (unsigned i = 0; i < LOOKS; i++) {
        const int err = read_id(epp, slot, &id);
        if (err == HM2_ERR_TIMEOUT && i == 0)
            return 0;
        if (err != 0 && err != HM2_ERR_TIMEOUT)
            return hm2_diag_add(diag, HM2_ERR_IO, "Slot %u: the bus cannot be used: %s.", slot, hm2_strerror(err));
        first = i == 0 ? id : first;
        if (err != 0 || id != first)
            return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                                "Slot %u: its ID reads as 0x%02X, then %s0x%02X. Check the cable, its length, and that "
                                "no two boards have the same address.",
                                slot, first, err ? "nobody answers, " : "", id);
    }
    if (is_absent(id))
        return 0;
    if (!ppmc_identify(id, info)) {
        *info = (struct ppmc_board_info){0};
        return hm2_diag_add(
            diag, HM2_ERR_MISMATCH,
            "Slot %u: the ID 0x%02X is none of a PPMC board (0x1n to 0x5n). Check cable and mode of the "
            "port.",
            slot, id);
    }
    if (info->slots == 2 && slot % 2 != 0) {
        *info = (struct ppmc_board_info){0};
        return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                            "Slot %u: the ID 0x%02X is of a board with two slots, which has an even address.", slot,
                            id);
    }
    return 0;
}

int ppmc_scan(struct epp *const epp, struct ppmc_board_info boards[const PPMC_SLOTS], struct hm2_diag *const diag)
{
    int result = 0;
    for (unsigned slot = 0; slot < PPMC_SLOTS; slot++)
        boards[slot] = (struct ppmc_board_info){0};
    for (unsigned slot = 0; slot < PPMC_SLOTS && result != HM2_ERR_IO; slot++) {
        const int err = look(epp, slot, &boards[slot], diag);
        if (err)
            result = err;
        if (boards[slot].slots == 2)
            slot++; /* it answers there, too */
    }
    return result;
}

int ppmc_set_filter(struct epp *const epp, const unsigned slot, const enum ppmc_filter filter,
                    struct hm2_diag *const diag)
{
    struct ppmc_board_info info;
    if (slot >= PPMC_SLOTS || filter >= PPMC_FILTERS)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "Slot %u: slots are 0 to 15, filter rates 1, 2.5, 5 and 10 MHz.",
                            slot);
    int err = look(epp, slot, &info, diag);
    if (err)
        return err;
    if (info.id == 0)
        return hm2_diag_add(diag, HM2_ERR_NOTFOUND, "Slot %u: no board answers.", slot);
    if (!info.filter)
        return hm2_diag_add(diag, HM2_ERR_UNSUPPORTED,
                            "Slot %u: the %s with ID 0x%02X has no filter rate register (encoder boards have it from "
                            "0x14 on).",
                            slot, info.name, info.id);
    uint8_t address = (uint8_t)(slot * PPMC_SLOT_ADDRESSES + PPMC_W_FILTER), code = (uint8_t)filter;
    const struct epp_step steps[] = {{EPP_ADDRESS_WRITE, 1, &address}, {EPP_DATA_WRITE, 1, &code}};
    struct epp_done done;
    err = epp_run(epp, steps, sizeof steps / sizeof steps[0], &done);
    return err ? hm2_diag_add(diag, err, "Slot %u: the filter rate was not written: %s.", slot, hm2_strerror(err)) : 0;
}

int ppmc_read_registers(struct epp *const epp, const unsigned slot, const unsigned offset, uint8_t *const bytes,
                        const unsigned count, struct hm2_diag *const diag)
{
    const unsigned end = slot % 2 == 0 ? 2 * PPMC_SLOT_ADDRESSES : PPMC_SLOT_ADDRESSES;
    if (slot >= PPMC_SLOTS || offset >= end || count == 0 || count > end - offset)
        return hm2_diag_add(diag, HM2_ERR_RANGE,
                            "Slot %u, registers %u to %u: slots are 0 to 15, registers of this one 0 to %u.", slot,
                            offset, offset + count - 1, end - 1);
    uint8_t address = (uint8_t)(slot * PPMC_SLOT_ADDRESSES + offset);
    const struct epp_step steps[] = {{EPP_ADDRESS_WRITE, 1, &address}, {EPP_DATA_READ, (uint8_t)count, bytes}};
    struct epp_done done;
    const int err = epp_run(epp, steps, sizeof steps / sizeof steps[0], &done);
    return err ? hm2_diag_add(diag, err, "Slot %u, register %u: %s.", slot, offset + (unsigned)done.bytes,
                              hm2_strerror(err))
               : 0;
}
