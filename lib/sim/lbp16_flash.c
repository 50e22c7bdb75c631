/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Space 3: the configuration flash behind an address and a data register (seed 000, "FLASH MEMORY REGISTERS"). The
 * firmware keeps the chip selected from one data access to the next. */
#include "lbp16_engine.h"

#include "profiles.h"

#define WRITE_KEY 0x5A03u

/* The chip's commands, and the clocks that a byte takes through the 25 MHz shift register with its polling. */
enum { PROGRAM = 0x02, READ = 0x03, DISABLE = 0x04, STATUS = 0x05, ENABLE = 0x06, SIGNATURE = 0xAB, ERASE = 0xD8 };
#define BYTE_CLOCKS 53u

static uint8_t shift(struct sim_lbp16 *const e, const uint8_t byte)
{
    sim_lbp16_spend(e, BYTE_CLOCKS);
    return sim_spi_flash_shift(&e->flash, byte, e->now_ns);
}

static void deselect(struct sim_lbp16 *const e)
{
    sim_spi_flash_deselect(&e->flash, e->now_ns);
}

static void shift_address(struct sim_lbp16 *const e)
{
    (void)shift(e, (uint8_t)(e->flash_address >> 16));
    (void)shift(e, (uint8_t)(e->flash_address >> 8));
    (void)shift(e, (uint8_t)e->flash_address);
}

static void one_byte_command(struct sim_lbp16 *const e, const uint8_t command)
{
    sim_spi_flash_select(&e->flash);
    (void)shift(e, command);
    deselect(e);
}

/* A page that was being sent is programmed when the chip is deselected; then the firmware asks until it is done. It
 * asks for ever when the chip never is. */
static void finish(struct sim_lbp16 *const e)
{
    deselect(e);
    sim_spi_flash_select(&e->flash);
    (void)shift(e, STATUS);
    (void)shift(e, 0);
    if (e->flash.dead || e->flash.busy_until_ns == INT64_MAX)
        e->stopped = true;
    else if (e->now_ns < e->flash.busy_until_ns)
        e->now_ns = e->flash.busy_until_ns;
    deselect(e);
    one_byte_command(e, DISABLE);
}

static void commit(struct sim_lbp16 *const e)
{
    if (e->flash_state == SIM_FLASH_WRITING)
        finish(e);
    else
        deselect(e);
    e->flash_state = SIM_FLASH_IDLE;
}

void sim_lbp16_flash_start(struct sim_lbp16 *const e)
{
    deselect(e);
    e->flash_state = SIM_FLASH_IDLE;
    e->flash_address = e->flash_data = 0;
}

uint32_t sim_lbp16_flash_id(struct sim_lbp16 *const e)
{
    sim_spi_flash_select(&e->flash);
    (void)shift(e, SIGNATURE);
    shift_address(e);
    e->flash_data = shift(e, 0);
    deselect(e);
    return e->flash_data;
}

static void read_data(struct sim_lbp16 *const e)
{
    if (e->flash_state == SIM_FLASH_WRITING)
        commit(e);
    if (e->flash_state != SIM_FLASH_READING) {
        e->flash_state = SIM_FLASH_READING;
        sim_spi_flash_select(&e->flash);
        (void)shift(e, READ);
        shift_address(e);
    }
    sim_lbp16_spend(e, 4 * BYTE_CLOCKS);
    e->flash_data = sim_spi_flash_read4(&e->flash, e->now_ns);
    e->flash_address += 4;
}

static void write_data(struct sim_lbp16 *const e, const uint32_t value)
{
    e->flash_data = value;
    if (e->flash_state != SIM_FLASH_WRITING) {
        e->flash_state = SIM_FLASH_WRITING;
        one_byte_command(e, ENABLE);
        sim_spi_flash_select(&e->flash);
        (void)shift(e, PROGRAM);
        shift_address(e);
    }
    for (unsigned i = 0; i < 4; i++)
        (void)shift(e, (uint8_t)(value >> (8 * i)));
    e->flash_address += 4;
}

static void erase(struct sim_lbp16 *const e)
{
    one_byte_command(e, ENABLE);
    sim_spi_flash_select(&e->flash);
    (void)shift(e, ERASE);
    shift_address(e);
    finish(e);
    e->flash_state = SIM_FLASH_IDLE;
}

static enum sim_verdict read_register(struct sim_lbp16 *const e, uint32_t *const value)
{
    switch (e->pointer[LBP16_SPACE_FLASH]) {
    case LBP16_FLASH_ADDRESS:
        commit(e);
        *value = e->flash_address;
        return SIM_DONE;
    case LBP16_FLASH_DATA:
        read_data(e);
        *value = e->flash_data;
        return SIM_DONE;
    case LBP16_FLASH_ID:
        commit(e);
        *value = sim_lbp16_flash_id(e);
        return SIM_DONE;
    default:
        return SIM_MEM_ERROR;
    }
}

static uint32_t get_double(struct sim_lbp16 *const e)
{
    const uint32_t low = sim_lbp16_get(e);
    return low | (uint32_t)sim_lbp16_get(e) << 16;
}

static enum sim_verdict write_register(struct sim_lbp16 *const e)
{
    const bool enabled = e->control[LBP16_CONTROL_WRITE_ENABLE / 2] == WRITE_KEY;
    switch (e->pointer[LBP16_SPACE_FLASH]) {
    case LBP16_FLASH_ADDRESS:
        commit(e);
        e->flash_address = get_double(e);
        return SIM_DONE;
    case LBP16_FLASH_DATA:
        if (!enabled)
            return SIM_WRITE_ERROR;
        write_data(e, get_double(e));
        return SIM_DONE;
    case LBP16_FLASH_ERASE:
        commit(e);
        if (!enabled)
            return SIM_WRITE_ERROR;
        erase(e);
        (void)get_double(e);
        return SIM_DONE;
    default:
        return SIM_MEM_ERROR;
    }
}

/* The address counts by itself; the increment bit does nothing here. */
enum sim_verdict sim_lbp16_flash(struct sim_lbp16 *const e, const struct lbp16_command *const command)
{
    if (command->has_address)
        e->pointer[LBP16_SPACE_FLASH] = sim_lbp16_get(e);
    if (command->size != LBP16_SIZE_32)
        return SIM_PARSE_ERROR;
    for (unsigned i = 0; i < command->count; i++) {
        uint32_t value = 0;
        sim_lbp16_spend(e, 20);
        if (!command->write && e->x >= SIM_TX_LIMIT)
            return SIM_MEM_ERROR;
        const enum sim_verdict verdict = command->write ? write_register(e) : read_register(e, &value);
        if (verdict != SIM_DONE)
            return verdict;
        if (command->write)
            continue;
        sim_lbp16_put(e, (uint16_t)value);
        sim_lbp16_put(e, (uint16_t)(value >> 16));
    }
    return SIM_DONE;
}
