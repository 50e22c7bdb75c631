/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "icap.h"

enum { REG_CMD = 5, REG_GENERAL1 = 19, REG_GENERAL2 = 20, CMD_IPROG = 14 };
enum { EFINIX_IMAGE = 0x3, EFINIX_ENABLE = 0x4, EFINIX_START = 0x8 };
#define TYPE_1_WRITE_ONE 0x3001u
#define TYPE_1_MASK      0xF81Fu

static void write_efinix(struct sim_icap *const icap, const uint16_t word)
{
    const unsigned start = EFINIX_ENABLE | EFINIX_START;
    icap->image = word & EFINIX_IMAGE;
    icap->reload = icap->reload || (word & start) == start;
}

static void take_value(struct sim_icap *const icap, const uint16_t word)
{
    if (icap->reg == REG_GENERAL1 || icap->reg == REG_GENERAL2)
        icap->general[icap->reg - REG_GENERAL1] = word;
    if (icap->reg != REG_CMD || word != CMD_IPROG)
        return;
    icap->start = (uint32_t)(icap->general[1] & 0xFFu) << 16 | icap->general[0];
    icap->reload = true;
}

/* Packets of one word each are all that a reload needs. */
static void write_spartan6(struct sim_icap *const icap, const uint16_t word)
{
    static const uint16_t sync[] = {0xAA99, 0x5566};
    if (!icap->synced) {
        icap->sync_step = word == sync[icap->sync_step] ? icap->sync_step + 1 : word == sync[0];
        icap->synced = icap->sync_step == sizeof sync / sizeof sync[0];
        return;
    }
    if (icap->in_register) {
        icap->in_register = false;
        take_value(icap, word);
        return;
    }
    icap->in_register = (word & TYPE_1_MASK) == TYPE_1_WRITE_ONE;
    icap->reg = word >> 5 & 0x3Fu;
}

void sim_icap_write(struct sim_icap *const icap, const bool efinix, const uint16_t word)
{
    if (efinix)
        write_efinix(icap, word);
    else
        write_spartan6(icap, word);
}
