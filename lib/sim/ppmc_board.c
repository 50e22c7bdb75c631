/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "ppmc_board.h"

#include <string.h>

#define NS_PER_US 1000

/* Registers (seed 004, table of addresses): reads and writes at one offset are of different ones. */
enum {
    READ_COUNTS = 0, /* three bytes an axis */
    READ_INDEX_SENSE = 12,
    READ_ID = 15,
    READ_TIMESTAMPS = 16, /* two bytes an axis */
    READ_TIMEBASE = 24,
    READ_END = 26,

    WRITE_ASSEMBLY = 0,
    WRITE_CONTROL = 3,
    WRITE_TIMER = 4,
    WRITE_FILTER = 5,
    WRITE_INDEX_PRESET = 13,
};

#define CONTROL_LOAD     0xF0u /* seed 004, "Control Register Bits" */
#define TIMER_SOFT_LATCH 0x20u /* seed 004, "Timer Register Bits" */
#define TIMER_MASTER     0x10u
#define TIMER_RATE       0x0Fu
#define STRICT_LOAD_NS   2000 /* ppmc.md section 2.3 */

/* 1, 2.5, 5 and 10 MHz (seed 004, "Encoder Filter Rate Select"). */
static const int64_t filter_ns[] = {1000, 400, 200, 100};

static unsigned version(const struct ppmc_board *const board)
{
    return board->id & 0x0Fu;
}

static bool is_encoder_board(const struct ppmc_board *const board)
{
    return board->id >> 4 == 1;
}

static bool has_filter_register(const struct ppmc_board *const board)
{
    return is_encoder_board(board) && version(board) >= 4;
}

static bool has_timestamps(const struct ppmc_board *const board)
{
    return board->slots == 2 && version(board) >= 4;
}

/* Firmware 0x11 has bits of the control register instead (ppmc.md section 2.9). */
static bool has_preset_register(const struct ppmc_board *const board)
{
    return version(board) >= 2;
}

void ppmc_board_init(struct ppmc_board *const board, const struct sim_ppmc_options *const options,
                     struct sim_ppmc_stats *const stats, const unsigned slot, const uint8_t id)
{
    memset(board, 0, sizeof *board);
    board->options = options;
    board->stats = stats;
    board->present = board->powered = true;
    board->slot = slot;
    board->id = id;
    board->slots = (is_encoder_board(board) && version(board) >= 4) || id >> 4 == 4 || id >> 4 == 5 ? 2 : 1;
    for (unsigned i = 0; i < SIM_PPMC_AXES; i++)
        ppmc_axis_init(&board->axes[i]);
    ppmc_board_reset(board);
}

void ppmc_board_reset(struct ppmc_board *const board)
{
    memset(&board->registers, 0, sizeof board->registers);
    memset(board->held_timestamps, 0, sizeof board->held_timestamps);
    board->held_timebase = 0;
    board->held_high = 0;
    board->line_seen = false;
    board->timebase_ns = board->now_ns;
    for (unsigned i = 0; i < SIM_PPMC_AXES; i++)
        ppmc_axis_reset(&board->axes[i]);
}

bool ppmc_board_owns(const struct ppmc_board *const board, const uint8_t address)
{
    const unsigned slot = address >> 4;
    return board->present && board->powered && slot >= board->slot && slot < board->slot + board->slots;
}

bool ppmc_board_drives_line(const struct ppmc_board *const board)
{
    return board->present && board->powered && (board->registers.timer & TIMER_SOFT_LATCH);
}

struct ppmc_axis_setting ppmc_board_setting(const struct ppmc_board *const board, const unsigned axis)
{
    const bool old = is_encoder_board(board) && !has_preset_register(board);
    return (struct ppmc_axis_setting){
        .filter_ns = filter_ns[board->registers.filter & 3u],
        .timebase_ns = board->timebase_ns,
        .assembly = board->registers.assembly,
        .preset = board->registers.preset >> axis & 1u,
        .index_select = old && (board->registers.control >> axis & 1u),
    };
}

/* ---- time -------------------------------------------------------------------------------------------------------- */

static uint16_t timebase(const struct ppmc_board *const board)
{
    return (uint16_t)((board->now_ns - board->timebase_ns) / NS_PER_US);
}

static void move_axes(struct ppmc_board *const board, const int64_t to_ns)
{
    for (unsigned i = 0; i < SIM_PPMC_AXES; i++) {
        const struct ppmc_axis_setting setting = ppmc_board_setting(board, i);
        ppmc_axis_advance(&board->axes[i], &setting, to_ns);
    }
    board->now_ns = to_ns;
}

void ppmc_board_latch(struct ppmc_board *const board)
{
    if (!board->present || !board->powered)
        return;
    for (unsigned i = 0; i < SIM_PPMC_AXES; i++) {
        struct ppmc_axis *const axis = &board->axes[i];
        if (ppmc_board_setting(board, i).index_select)
            continue;
        axis->holding = axis->counter;
        axis->truth.held_counted = axis->truth.counted;
        board->held_timestamps[i] = axis->timestamp;
    }
    board->held_timebase = timebase(board);
    board->stats->latches++;
}

/* While a load bit is on, every tick of the filter clock makes the counter the assembly register (rules 7 and 8). */
static void load(struct ppmc_board *const board)
{
    if (board->options->strict && board->now_ns - board->load_since_ns < STRICT_LOAD_NS)
        return;
    for (unsigned i = 0; i < SIM_PPMC_AXES; i++)
        if ((unsigned)board->registers.control >> (4 + i) & 1u)
            board->axes[i].counter = board->registers.assembly;
}

/* Does a tick of the filter clock do more than let edges pass? */
static bool is_tick_of_use(const struct ppmc_board *const board, const bool line)
{
    return line != board->line_seen || (board->registers.control & CONTROL_LOAD);
}

void ppmc_board_advance(struct ppmc_board *const board, const int64_t to_ns, const bool line)
{
    const int64_t tick_ns = filter_ns[board->registers.filter & 3u];
    const int64_t first_tick_ns = (board->now_ns / tick_ns + 1) * tick_ns;
    if (!board->present || to_ns <= board->now_ns)
        return;
    if (first_tick_ns <= to_ns && is_tick_of_use(board, line)) {
        move_axes(board, first_tick_ns);
        load(board);
        if (line && !board->line_seen)
            ppmc_board_latch(board);
        board->line_seen = line;
        move_axes(board, to_ns);
        load(board);
    }
    move_axes(board, to_ns);
}

/* ---- registers --------------------------------------------------------------------------------------------------- */

/* All registers behind a write; false when there is none at this offset. */
static bool written(const struct ppmc_board *const board, const unsigned offset, const uint8_t value,
                    struct sim_ppmc_registers *const after)
{
    *after = board->registers;
    if (offset < WRITE_CONTROL)
        after->assembly = (after->assembly & ~(0xFFu << 8 * offset)) | (uint32_t)value << 8 * offset;
    else if (offset == WRITE_CONTROL)
        after->control = value;
    else if (offset == WRITE_TIMER)
        after->timer = value;
    else if (offset == WRITE_FILTER && has_filter_register(board))
        after->filter = value & 3u;
    else if (offset == WRITE_INDEX_PRESET && has_preset_register(board))
        after->preset = value & 0x0Fu;
    else
        return false;
    return true;
}

bool ppmc_board_is_changed(const struct ppmc_board *const board, const unsigned offset, const uint8_t value)
{
    struct sim_ppmc_registers after;
    return written(board, offset, value, &after) && memcmp(&after, &board->registers, sizeof after) != 0;
}

void ppmc_board_write(struct ppmc_board *const board, const unsigned offset, const uint8_t value)
{
    struct sim_ppmc_registers after;
    if (!written(board, offset, value, &after)) {
        board->stats->undocumented++;
        return;
    }
    if ((board->registers.control ^ after.control) & CONTROL_LOAD)
        board->load_since_ns = board->now_ns;
    if (board->registers.timer != after.timer)
        board->pulsed_ns = board->now_ns;
    board->registers = after;
}

int64_t ppmc_board_pulse_ns(const struct ppmc_board *const board)
{
    if (!board->present || !board->powered || !(board->registers.timer & TIMER_MASTER))
        return INT64_MAX;
    const int64_t period_ns = board->options->master_ns[board->registers.timer & TIMER_RATE];
    return period_ns > 0 ? board->pulsed_ns + period_ns : INT64_MAX;
}

bool ppmc_board_is_held(const struct ppmc_board *const board, const unsigned offset, const bool line)
{
    const bool old = !has_preset_register(board); /* its holding registers may be latched by an index */
    const bool fixed = offset > READ_INDEX_SENSE && offset <= READ_ID;
    return fixed || (offset < READ_INDEX_SENSE && line == board->line_seen && !old);
}

static uint8_t read_sense(struct ppmc_board *const board)
{
    unsigned sense = 0;
    for (unsigned i = 0; i < SIM_PPMC_AXES; i++) {
        sense |= (unsigned)board->axes[i].sense << i;
        board->axes[i].sense = false;
    }
    return (uint8_t)sense;
}

static uint16_t clock_word(const struct ppmc_board *const board, const unsigned offset)
{
    const unsigned axis = (offset - READ_TIMESTAMPS) / 2;
    const bool live = board->options->timestamps_live;
    if (offset >= READ_TIMEBASE)
        return live ? timebase(board) : board->held_timebase;
    return live ? board->axes[axis].timestamp : board->held_timestamps[axis];
}

static uint8_t read_clock(struct ppmc_board *const board, const unsigned offset)
{
    const uint16_t word = clock_word(board, offset);
    if (offset % 2 == 0) {
        board->held_high = (uint8_t)(word >> 8);
        return (uint8_t)word;
    }
    return board->options->timestamps_tear ? (uint8_t)(word >> 8) : board->held_high;
}

uint8_t ppmc_board_read(struct ppmc_board *const board, const unsigned offset)
{
    if (offset < READ_INDEX_SENSE)
        return (uint8_t)(board->axes[offset / 3].holding >> 8 * (offset % 3));
    if (offset == READ_INDEX_SENSE)
        return read_sense(board);
    if (offset == READ_ID)
        return board->id;
    if (offset >= READ_TIMESTAMPS && offset < READ_END && has_timestamps(board))
        return read_clock(board, offset);
    return 0;
}
