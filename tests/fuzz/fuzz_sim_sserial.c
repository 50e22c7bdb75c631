/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Registers of a simulated smart-serial port with remotes behind it, written in any order at any time, while cables are
 * pulled and errors ordered: it stays within its memory, time goes on, and a reset brings the port back. Input: records
 * of a kind and a register byte and four bytes of value. */
#include <stdlib.h>
#include <string.h>

#include <hm2/sim.h>

#include "sserial.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define BASE     0x5B00u
#define PAGES    6u
#define CHANNELS 3u
#define RECORD   6u
#define SETTLE   1000000 /* clocks, 10 ms */

static void require(const bool condition)
{
    if (!condition)
        abort();
}

static void write_register(struct sim_card *const card, const unsigned address, const uint32_t value)
{
    sim_card_write(card, sim_card_clock(card), (uint16_t)address, value);
}

static uint32_t read_register(struct sim_card *const card, const unsigned address)
{
    return sim_card_read(card, sim_card_clock(card), (uint16_t)address, NULL);
}

static void wait(struct sim_card *const card, const int64_t clk)
{
    sim_card_advance(card, sim_card_clock(card) + clk);
}

static void happen(struct sim_card *const card, const uint8_t what, const unsigned channel)
{
    static const char *const errors[] = {"crc", "cookie", "overrun", "timeout", "extra", "break"};
    struct remote *const remote = sim_sserial_remote(card, 0, channel);
    double unused;
    (void)!sim_sserial_cable(card, 0, channel, (enum sim_cable)(what % 3));
    (void)!sim_sserial_error(card, 0, channel, errors[what % 6], what / 32);
    if (what & 0x40)
        (void)!sim_sserial_power_cycle(card, 0, channel);
    require(remote != NULL);
    remote_short(remote, what);
    (void)!remote_get(remote, "Output", &unused);
}

static void play(struct sim_card *const card, const uint8_t record[const RECORD])
{
    const unsigned kind = record[0], where = record[1];
    const uint32_t value = record[2] | (uint32_t)record[3] << 8 | (uint32_t)record[4] << 16 | (uint32_t)record[5] << 24;
    switch (kind & 3u) {
    case 0:
        wait(card, value >> (kind >> 3)); /* up to 43 s */
        break;
    case 1:
        happen(card, record[2], where % CHANNELS);
        break;
    default:
        write_register(card, BASE + where % PAGES * 0x100 + 4 * (kind >> 2 & 7u), value);
        break;
    }
}

static void comes_back(struct sim_card *const card)
{
    write_register(card, BASE, 0x4000);
    write_register(card, BASE, 0x0001);
    wait(card, SETTLE);
    write_register(card, BASE, 0x2003);
    wait(card, SETTLE);
    require(read_register(card, BASE) == 0);
    require(read_register(card, BASE + 0x100) == 43);
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    const struct sim_card_options options = {.profile = "7i96s_7i77d"};
    const struct sim_drive drive = {0, 1, "AnalogOut0", 100000, 0.01};
    struct sim_card *card = NULL;
    require(sim_card_new(&card, &options, NULL) == 0);
    require(sim_sserial_plug(card, 0, 0, "7i77", 1, NULL) == 0);
    require(sim_sserial_plug(card, 0, 2, "7i76", 1, NULL) == 0);
    require(sim_card_drive_motor(card, 0, &drive) == 0);
    write_register(card, 0x1108, 0x2A); /* transmit pins */
    write_register(card, 0x1208, 0x2A);
    for (size_t at = 0; at + RECORD <= size; at += RECORD)
        play(card, data + at);
    comes_back(card);
    sim_card_free(card);
    return 0;
}
