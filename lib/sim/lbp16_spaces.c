/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The memory spaces but the flash, and the information areas (seed 000, "SUPPORTED MEMORY SPACES"). */
#include "lbp16_engine.h"

#include <string.h>

#include "card_state.h"
#include "profiles.h"

/* Clocks of the firmware's loops, counted in its code: one instruction a clock, a jump that is taken three. */
enum {
    CLOCKS_HM2_WORD = 16,
    CLOCKS_WORD = 15,
    CLOCKS_CONTROL_WORD = 22,
    CLOCKS_TIMER_WORD = 24,
    CLOCKS_CHIP_WORD = 25,
    CLOCKS_EEPROM_READ = 2606, /* 27 us, bit by bit through the Ethernet chip: recorded exchange 62 */
    CLOCKS_EEPROM_WRITE = 4680,
    CLOCKS_TIMER_POLL = 46
};

#define EEPROM_KEY           0x5A02u
#define EEPROM_KEY_ALL       0x3602u /* the factory's: also opens the protected words */
#define EEPROM_RANGE         0xFFC0u
#define INFO_WORDS           8u
#define REGISTERS            16u
#define INDEX_MASK           0xFFFu /* the processor's index registers have 12 bits */
#define CHIP_ADDRESS_ILLEGAL 0x0F00u

/* ---- space 0 ------------------------------------------------------------------------------------------------------
 */

static enum sim_verdict run_hm2(struct sim_lbp16 *const e, const struct lbp16_command *const command)
{
    uint16_t *const pointer = &e->pointer[LBP16_SPACE_HM2];
    if (command->size != LBP16_SIZE_32)
        return SIM_PARSE_ERROR;
    if (command->has_address)
        *pointer = sim_lbp16_get(e);
    uint16_t address = *pointer; /* written back only when the command is through */
    for (unsigned i = 0; i < command->count; i++) {
        const uint16_t at = address & 0xFFFCu;
        sim_lbp16_spend(e, CLOCKS_HM2_WORD);
        const int64_t clk = sim_lbp16_clk(e, e->now_ns);
        if (command->write) {
            const uint32_t low = sim_lbp16_get(e);
            const uint32_t value = low | (uint32_t)sim_lbp16_get(e) << 16;
            if (e->y - 2 >= SIM_RX_LIMIT)
                return SIM_MEM_ERROR;
            sim_card_write(e->card, clk, at, value);
        } else {
            if (e->x >= SIM_TX_LIMIT)
                return SIM_MEM_ERROR;
            const uint32_t value = sim_card_read(e->card, clk, at, NULL);
            sim_lbp16_put(e, (uint16_t)value);
            sim_lbp16_put(e, (uint16_t)(value >> 16));
        }
        if (command->increment)
            address = (uint16_t)(address + 4);
    }
    *pointer = address;
    return SIM_DONE;
}

/* ---- space 1: the Ethernet chip --------------------------------------------------------------------------------- */

static enum sim_verdict chip_access(struct sim_lbp16 *const e, const unsigned index, const bool write,
                                    uint16_t *const value)
{
    if (index & CHIP_ADDRESS_ILLEGAL / 2)
        return SIM_MEM_ERROR;
    sim_lbp16_spend(e, CLOCKS_CHIP_WORD);
    uint16_t *const reg = &e->chip[index % (sizeof e->chip / sizeof e->chip[0])];
    if (write)
        *reg = sim_lbp16_get(e);
    *value = *reg;
    return SIM_DONE;
}

/* ---- space 2: EEPROM -------------------------------------------------------------------------------------------- */

static enum sim_verdict eeprom_access(struct sim_lbp16 *const e, const unsigned index, const bool write,
                                      uint16_t *const value)
{
    const uint16_t key = e->control[LBP16_CONTROL_WRITE_ENABLE / 2];
    if (write && key != EEPROM_KEY_ALL && (key != EEPROM_KEY || index < SIM_EEPROM_PROTECTED_WORDS))
        return SIM_WRITE_ERROR;
    if (index & EEPROM_RANGE)
        return SIM_MEM_ERROR;
    sim_lbp16_spend(e, write ? CLOCKS_EEPROM_WRITE : CLOCKS_EEPROM_READ);
    if (write)
        e->eeprom.words[index] = sim_lbp16_get(e);
    *value = e->eeprom.words[index];
    return SIM_DONE;
}

/* ---- space 4: time stamp, waits, scratch ------------------------------------------------------------------------ */

static void wait_ns(struct sim_lbp16 *const e, const int64_t ns)
{
    e->now_ns += ns;
    e->asked_ns += ns;
}

/* Time passes until the stamp has counted on by `ticks` from `start` (both 16 bits wide). */
static void wait_ticks(struct sim_lbp16 *const e, const uint16_t start, const uint16_t ticks)
{
    const uint16_t gone = (uint16_t)(sim_lbp16_stamp(e) - start);
    if (gone < ticks) {
        const uint64_t into_tick = ((uint64_t)e->now_ns + e->stamp_zero) % 1000u;
        wait_ns(e, (int64_t)(ticks - gone) * 1000 - (int64_t)into_tick);
    }
    sim_lbp16_spend(e, CLOCKS_TIMER_POLL);
}

/* Wait for a rising edge of a DPLL output, at most until the timeout; returns the microseconds that took. */
static uint16_t wait_for_timer(struct sim_lbp16 *const e, const unsigned timer)
{
    const uint16_t start = sim_lbp16_stamp(e);
    const uint16_t timeout = e->timer[LBP16_TIMER_TIMEOUT_US / 2];
    const int64_t from_clk = sim_lbp16_clk(e, e->now_ns);
    const int64_t rise_clk = timeout > 0 ? sim_dpll_next_rise(e->card, timer, from_clk) : SIM_NEVER;
    const int64_t limit_ns = e->now_ns + (int64_t)timeout * 1000;
    const int64_t limit_clk = sim_lbp16_clk(e, limit_ns);
    if (rise_clk <= limit_clk) {
        const int64_t clock_ns = 1000000000 / (int64_t)sim_clock_low_hz(e->card);
        wait_ns(e, (rise_clk - from_clk) * clock_ns);
        sim_lbp16_spend(e, CLOCKS_TIMER_POLL);
    } else {
        wait_ticks(e, start, timeout);
        sim_lbp16_flag(e, LBP16_ERROR_HM2_TIMEOUT);
    }
    return (uint16_t)(sim_lbp16_stamp(e) - start);
}

static enum sim_verdict timer_access(struct sim_lbp16 *const e, const unsigned index, const bool write,
                                     uint16_t *const value)
{
    enum { STAMP = 0, WAIT = LBP16_TIMER_WAIT_US / 2, FIRST = LBP16_TIMER_WAIT_REF / 2, LAST = LBP16_TIMER_WAIT_4 / 2 };
    if (index >= REGISTERS)
        return SIM_MEM_ERROR;
    if (write)
        e->timer[index] = sim_lbp16_get(e);
    *value = index == STAMP ? sim_lbp16_stamp(e) : e->timer[index];
    if (write && index == WAIT)
        wait_ticks(e, sim_lbp16_stamp(e), e->timer[WAIT]);
    else if (index >= FIRST && index <= LAST)
        *value = wait_for_timer(e, index - FIRST);
    else if (write && index > LAST)
        (void)wait_for_timer(e, LAST - FIRST); /* scratch words fall into the last timer's case: exchange 57 */
    return SIM_DONE;
}

/* ---- space 6: status and control -------------------------------------------------------------------------------- */

static enum sim_verdict control_access(struct sim_lbp16 *const e, const unsigned index, const bool write,
                                       uint16_t *const value)
{
    if (index >= REGISTERS)
        return SIM_MEM_ERROR;
    if (index == LBP16_CONTROL_ICAP / 2) {
        *value = 0;
        if (write)
            sim_icap_write(&e->icap, e->profile->efinix, sim_lbp16_get(e));
        return SIM_DONE;
    }
    if (write)
        e->control[index] = sim_lbp16_get(e);
    *value = e->control[index];
    return SIM_DONE;
}

/* ---- space 7: card information ---------------------------------------------------------------------------------- */

static enum sim_verdict info_access(struct sim_lbp16 *const e, const unsigned index, const bool write,
                                    uint16_t *const value)
{
    if (write)
        return SIM_WRITE_ERROR;
    if (index >= REGISTERS)
        return SIM_MEM_ERROR;
    *value = e->info[index];
    return SIM_DONE;
}

/* ---- what the 16-bit spaces share ------------------------------------------------------------------------------- */

struct space {
    const char *name;
    uint16_t sizes, ranges; /* of the information area; ranges of the flash get the chip's size */
    uint16_t index_mask;
    unsigned clocks; /* per word, beside what the access itself takes */
    unsigned find;   /* clocks until the firmware has found the space or its information area */
    enum sim_verdict (*access)(struct sim_lbp16 *e, unsigned index, bool write, uint16_t *value);
};

/* Sizes, ranges and names: recorded exchanges 28 to 35. */
static const struct space spaces[SIM_SPACES] = {
    [LBP16_SPACE_HM2] = {"HostMot2", 0x8104, 0x0010, 0, 0, 58, NULL},
    [LBP16_SPACE_ETHERNET] = {"KSZ8851", 0x8102, 0x0008, 0xFFFF, CLOCKS_WORD, 26, chip_access},
    [LBP16_SPACE_EEPROM] = {"EtherEEP", 0x8E02, 0x0007, 0xFFFF, CLOCKS_WORD, 26, eeprom_access},
    [LBP16_SPACE_FLASH] = {"FPGAFlsh", 0x8F04, 0x8200, 0, 0, 26, NULL},
    [LBP16_SPACE_TIMER] = {"Timers", 0x8202, 0x0004, INDEX_MASK, CLOCKS_TIMER_WORD, 0, timer_access},
    [LBP16_SPACE_CONTROL] = {"LBP16RW", 0x8202, 0x0004, INDEX_MASK, CLOCKS_CONTROL_WORD, 55, control_access},
    [LBP16_SPACE_INFO] = {"LBP16RO", 0x0202, 0x0004, INDEX_MASK, CLOCKS_WORD, 55, info_access},
};

/* The firmware halves the byte address with the sign kept. */
static unsigned half(const uint16_t address)
{
    return (uint16_t)(address >> 1 | (address & 0x8000u));
}

static enum sim_verdict run_words(struct sim_lbp16 *const e, const struct lbp16_command *const command)
{
    const struct space *const space = &spaces[command->space];
    uint16_t *const pointer = &e->pointer[command->space];
    if (command->size != LBP16_SIZE_16)
        return SIM_PARSE_ERROR;
    if (command->has_address)
        *pointer = sim_lbp16_get(e);
    unsigned index = half(*pointer);
    /* Space 4 stores consecutive words even without the increment bit (lbp16 traces, "Further runs"). */
    const bool next_word = command->increment || (command->write && command->space == LBP16_SPACE_TIMER);
    for (unsigned i = 0; i < command->count; i++) {
        uint16_t value = 0;
        sim_lbp16_spend(e, space->clocks);
        const enum sim_verdict verdict = space->access(e, index & space->index_mask, command->write, &value);
        if (verdict != SIM_DONE)
            return verdict;
        if (!command->write)
            sim_lbp16_put(e, value);
        if (command->increment)
            *pointer = (uint16_t)(*pointer + 2);
        if (next_word)
            index = (index + 1) & 0xFFFFu;
    }
    return SIM_DONE;
}

/* ---- information areas ------------------------------------------------------------------------------------------ */

static uint16_t info_word(struct sim_lbp16 *const e, const unsigned space, const unsigned index)
{
    const struct space *const s = &spaces[space];
    switch (index) {
    case 0:
        return (uint16_t)(0x5A00u + space);
    case 1:
        return s->sizes;
    case 2:
        return space == LBP16_SPACE_FLASH ? (uint16_t)(s->ranges | (e->flash.id + 4u)) : s->ranges;
    case 3:
        return e->pointer[space];
    default: {
        const size_t at = (index - 4) * 2;
        const size_t len = strnlen(s->name, 8);
        const unsigned low = at < len ? (uint8_t)s->name[at] : 0;
        const unsigned high = at + 1 < len ? (uint8_t)s->name[at + 1] : 0;
        return (uint16_t)(low | high << 8);
    }
    }
}

static enum sim_verdict run_info(struct sim_lbp16 *const e, const struct lbp16_command *const command)
{
    /* In space 3 the shared pointer counts by three (lbp16 traces, exchange 42). */
    const unsigned step = command->space == LBP16_SPACE_FLASH ? 3 : 2;
    if (command->size != LBP16_SIZE_16)
        return SIM_PARSE_ERROR;
    if (command->write)
        return SIM_WRITE_ERROR;
    if (command->has_address)
        e->info_pointer = sim_lbp16_get(e);
    unsigned index = half(e->info_pointer) & INDEX_MASK;
    for (unsigned i = 0; i < command->count; i++) {
        sim_lbp16_spend(e, CLOCKS_WORD);
        if (index >= INFO_WORDS)
            return SIM_MEM_ERROR;
        sim_lbp16_put(e, info_word(e, command->space, index));
        if (!command->increment)
            continue;
        e->info_pointer = (uint16_t)(e->info_pointer + step);
        index++;
    }
    return SIM_DONE;
}

enum sim_verdict sim_lbp16_command(struct sim_lbp16 *const e, const struct lbp16_command *const command)
{
    if (command->space == LBP16_SPACE_UNUSED)
        return SIM_PARSE_ERROR;
    if (command->space == LBP16_SPACE_HM2 && !command->info)
        return run_hm2(e, command);
    sim_lbp16_spend(e, spaces[command->space].find);
    if (command->info)
        return run_info(e, command);
    if (command->space == LBP16_SPACE_FLASH)
        return sim_lbp16_flash(e, command);
    return run_words(e, command);
}
