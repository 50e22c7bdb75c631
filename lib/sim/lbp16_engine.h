/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The LBP16 firmware of an Ethernet card: one processor that takes a frame, walks over its commands, and sends one
 * frame back. Behaviour and times are those of the public firmware (etherhm2 on a D16W processor at 100 MHz, one
 * instruction a clock), as recorded in tests/data/lbp16; the manuals (seed 000, "LBP16") where that says nothing.
 */
#ifndef SIM_LBP16_ENGINE_H
#define SIM_LBP16_ENGINE_H

#include <hm2/lbp16.h>
#include <hm2/sim.h>

#include "boot.h"
#include "eeprom.h"
#include "icap.h"
#include "spi_flash.h"

#define SIM_SPACES 8u

/* The processor's frame buffers, as word addresses in its data memory. A frame starts on an even word behind two
 * bytes of padding, so that its payload is aligned. */
#define SIM_MEMORY_WORDS    0x800u
#define SIM_RX_FRAME        0x180u
#define SIM_RX_LIMIT        0x4B1u /* 32-bit writes fail from here on */
#define SIM_TX_FRAME        0x4B6u
#define SIM_TX_LIMIT        0x7FBu /* 32-bit reads fail from here on */
#define SIM_HEADER_WORDS    21u    /* Ethernet, IPv4, UDP: 14 + 20 + 8 bytes */
#define SIM_MIN_FRAME_BYTES 60u    /* what Ethernet pads to */

/* How a command ended; errors end the packet and drop its reply. */
enum sim_verdict { SIM_DONE, SIM_PARSE_ERROR, SIM_MEM_ERROR, SIM_WRITE_ERROR };

enum sim_flash_state { SIM_FLASH_IDLE, SIM_FLASH_READING, SIM_FLASH_WRITING };

struct sim_lbp16 {
    struct sim_card *card;
    const struct sim_profile *profile;
    uint8_t mac[6], ip[4];

    bool has_epoch; /* epoch_ns belongs to epoch_clk */
    int64_t epoch_ns, epoch_clk;
    int64_t now_ns;      /* how far the processor has come */
    int64_t asked_ns;    /* of that, what the last packet asked it to wait */
    bool instant;        /* its instructions take no time */
    int64_t ready_ns;    /* hears nothing before */
    uint64_t stamp_zero; /* start of the microsecond counter, in ns */

    uint16_t memory[SIM_MEMORY_WORDS];
    unsigned x, y; /* next word of the reply and of the request */

    uint16_t pointer[SIM_SPACES], info_pointer;
    uint16_t control[16], timer[16], info[16];
    uint16_t chip[128]; /* KSZ8851 registers */
    struct sim_eeprom eeprom;

    struct sim_spi_flash flash;
    enum sim_flash_state flash_state;
    uint32_t flash_address, flash_data;

    struct sim_icap icap;
    unsigned jumpers;
    bool trust;                               /* images without the simulation's check sum */
    bool stopped;                             /* in the midst of a packet: the chip never ends, or the power went */
    enum sim_boot running;                    /* what answers, if anything */
    struct sim_boot_registers boot_registers; /* Xilinx */
};

int HM2_MUST_CHECK sim_lbp16_new(struct sim_lbp16 **engine, struct sim_card *card,
                                 const struct sim_card_options *options, struct hm2_diag *diag);
void sim_lbp16_free(struct sim_lbp16 *engine);
/* The power comes back, or (reload) the image that the ICAP asked for is loaded: deaf until it has started, or for good
 * when nothing does. */
void sim_lbp16_power_up(struct sim_lbp16 *engine);
void sim_lbp16_reload(struct sim_lbp16 *engine);
void sim_lbp16_power_off(struct sim_lbp16 *engine);

/* ---- between the files of the engine ---------------------------------------------------------------------------- */

/* One command of a packet; e->y stands behind the command word. lbp16_spaces.c */
enum sim_verdict sim_lbp16_command(struct sim_lbp16 *e, const struct lbp16_command *command);
/* lbp16_flash.c: space 3 */
enum sim_verdict sim_lbp16_flash(struct sim_lbp16 *e, const struct lbp16_command *command);
void sim_lbp16_flash_start(struct sim_lbp16 *e);
uint32_t sim_lbp16_flash_id(struct sim_lbp16 *e);

/* Instructions that the processor executes: time passes. */
void sim_lbp16_spend(struct sim_lbp16 *e, unsigned clocks);
uint16_t sim_lbp16_stamp(const struct sim_lbp16 *e);
int64_t sim_lbp16_clk(const struct sim_lbp16 *e, int64_t ns);
/* Next word of the request (stale memory behind its end) and of the reply. */
uint16_t sim_lbp16_get(struct sim_lbp16 *e);
void sim_lbp16_put(struct sim_lbp16 *e, uint16_t word);
void sim_lbp16_flag(struct sim_lbp16 *e, uint16_t error_bit);

#endif
