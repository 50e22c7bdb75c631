/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The registers of one PPMC board (seed 004; ppmc.md sections 2 and 11.3, rules 3, 4, 7 to 11, 13, 16 and 18). */
#ifndef SIM_PPMC_BOARD_H
#define SIM_PPMC_BOARD_H

#include "ppmc_axis.h"

struct ppmc_board {
    const struct sim_ppmc_options *options;
    struct sim_ppmc_stats *stats;
    bool present, powered;
    unsigned slot, slots; /* address switches, and how many sets of sixteen addresses it takes */
    uint8_t id;
    int64_t now_ns, timebase_ns; /* the timestamp counter was 0 then */
    struct ppmc_axis axes[SIM_PPMC_AXES];
    struct sim_ppmc_registers registers;
    int64_t load_since_ns; /* when the load bits took their present value */
    int64_t pulsed_ns;     /* the last periodic latch pulse, or when the timer register was set */
    bool line_seen;        /* the shared latch line as the last tick of the filter clock found it */
    uint16_t held_timestamps[SIM_PPMC_AXES], held_timebase;
    uint8_t held_high; /* of the 16-bit register whose low byte was read last */
    int64_t held_counted[SIM_PPMC_AXES];
};

void ppmc_board_init(struct ppmc_board *board, const struct sim_ppmc_options *options, struct sim_ppmc_stats *stats,
                     unsigned slot, uint8_t id);
void ppmc_board_reset(struct ppmc_board *board);
/* Does it answer at this address? */
bool ppmc_board_owns(const struct ppmc_board *board, uint8_t address);
/* Does it drive the shared latch line? */
bool ppmc_board_drives_line(const struct ppmc_board *board);
/* Time passes with the latch line at this level. */
void ppmc_board_advance(struct ppmc_board *board, int64_t to_ns, bool line);
/* A latch pulse of another board (rule 10). */
void ppmc_board_latch(struct ppmc_board *board);
/* When it gives its next periodic latch pulse, as a master; INT64_MAX = never (rule 11). */
int64_t ppmc_board_pulse_ns(const struct ppmc_board *board);
/* Does what this register reads not depend on the time? Then the board need not be brought up to it. */
bool ppmc_board_is_held(const struct ppmc_board *board, unsigned offset, bool line);
/* Registers, by offset from the board's base. The board's time must be the present. */
void ppmc_board_write(struct ppmc_board *board, unsigned offset, uint8_t value);
/* Would this write make a difference? If not, the board need not be brought up to date for it. */
bool ppmc_board_is_changed(const struct ppmc_board *board, unsigned offset, uint8_t value);
uint8_t ppmc_board_read(struct ppmc_board *board, unsigned offset);
struct ppmc_axis_setting ppmc_board_setting(const struct ppmc_board *board, unsigned axis);

#endif
