/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The EPP bus of simulated PPMC boards: addresses, time-outs and faults (ppmc.md section 11.3, rules 1 to 5, 17). */
#include "ppmc_bus.h"

#include <stdlib.h>

#include "prng.h"

#define DEFAULT_CYCLE_NS   1000
#define DEFAULT_TIMEOUT_NS 10000 /* of a port's EPP watchdog (ppmc.md section 3.3) */
#define REGISTERS_OF_SLOT  16u
#define NO_FAULT           SIM_PPMC_FAULTS

struct sim_ppmc *sim_ppmc_new(const struct sim_ppmc_options *const options)
{
    struct sim_ppmc *const bus = calloc(1, sizeof *bus);
    if (!bus)
        return NULL;
    if (options)
        bus->options = *options;
    if (bus->options.cycle_ns <= 0)
        bus->options.cycle_ns = DEFAULT_CYCLE_NS;
    if (bus->options.timeout_ns <= 0)
        bus->options.timeout_ns = DEFAULT_TIMEOUT_NS;
    for (unsigned i = 0; i < sizeof bus->options.master_ns / sizeof bus->options.master_ns[0]; i++)
        bus->pulses = bus->pulses || bus->options.master_ns[i] > 0;
    bus->random = bus->options.seed;
    return bus;
}

void sim_ppmc_free(struct sim_ppmc *const bus)
{
    free(bus);
}

static void map_boards(struct sim_ppmc *const bus)
{
    bus->powered = false;
    for (unsigned slot = 0; slot < SIM_PPMC_SLOTS; slot++) {
        bus->at[slot] = NULL;
        for (unsigned i = 0; i < SIM_PPMC_SLOTS; i++)
            if (ppmc_board_owns(&bus->boards[i], (uint8_t)(slot * REGISTERS_OF_SLOT)))
                bus->at[slot] = &bus->boards[i];
        bus->powered = bus->powered || bus->at[slot];
    }
}

int sim_ppmc_add(struct sim_ppmc *const bus, const unsigned slot, const uint8_t id)
{
    struct ppmc_board board;
    if (slot >= SIM_PPMC_SLOTS)
        return HM2_ERR_RANGE;
    ppmc_board_init(&board, &bus->options, &bus->stats, slot, id);
    if (board.slots == 2 && slot % 2 != 0)
        return HM2_ERR_RANGE;
    for (unsigned i = slot; i < slot + board.slots; i++)
        if (bus->at[i])
            return HM2_ERR_STATE;
    ppmc_board_advance(&board, bus->now_ns, false);
    bus->boards[slot] = board;
    map_boards(bus);
    return 0;
}

/* ---- time -------------------------------------------------------------------------------------------------------- */

void sim_ppmc_set_time(struct sim_ppmc *const bus, const int64_t now_ns)
{
    if (now_ns > bus->now_ns)
        bus->now_ns = now_ns;
}

int64_t sim_ppmc_now_ns(const struct sim_ppmc *const bus)
{
    return bus->now_ns;
}

static struct ppmc_board *next_master(struct sim_ppmc *const bus)
{
    struct ppmc_board *next = &bus->boards[0];
    for (unsigned i = 1; i < SIM_PPMC_SLOTS; i++)
        if (ppmc_board_pulse_ns(&bus->boards[i]) < ppmc_board_pulse_ns(next))
            next = &bus->boards[i];
    return next;
}

/* The pulses that masters have given by now; they reach all boards (rule 11). */
static void give_pulses(struct sim_ppmc *const bus)
{
    struct ppmc_board *master;
    while (master = next_master(bus), ppmc_board_pulse_ns(master) <= bus->now_ns) {
        const int64_t at_ns = ppmc_board_pulse_ns(master);
        for (unsigned i = 0; i < SIM_PPMC_SLOTS; i++) {
            ppmc_board_advance(&bus->boards[i], at_ns, bus->line);
            ppmc_board_latch(&bus->boards[i]);
        }
        master->pulsed_ns = at_ns;
    }
}

static void bring_up_to_date(struct sim_ppmc *const bus, struct ppmc_board *const board)
{
    if (bus->pulses)
        give_pulses(bus);
    ppmc_board_advance(board, bus->now_ns, bus->line);
}

/* A board may have begun or ended a pulse: until now the line was as it was, for all of them. */
static void look_at_line(struct sim_ppmc *const bus)
{
    bool line = false;
    for (unsigned i = 0; i < SIM_PPMC_SLOTS; i++)
        line = line || ppmc_board_drives_line(&bus->boards[i]);
    if (line == bus->line)
        return;
    for (unsigned i = 0; i < SIM_PPMC_SLOTS; i++)
        bring_up_to_date(bus, &bus->boards[i]);
    bus->line = line;
}

/* ---- cycles ------------------------------------------------------------------------------------------------------ */

static struct ppmc_board *selected(const struct sim_ppmc *const bus)
{
    return bus->at[bus->address / REGISTERS_OF_SLOT];
}

static enum sim_ppmc_fault fault_of_cycle(struct sim_ppmc *const bus)
{
    const uint64_t cycle = bus->stats.cycles - 1;
    for (unsigned i = 0; i < bus->planned_count; i++)
        if (cycle >= bus->planned[i].from && cycle < bus->planned[i].to)
            return bus->planned[i].fault;
    if (bus->fault_every == 0 || sim_prng_below(&bus->random, bus->fault_every) != 0)
        return NO_FAULT;
    enum sim_ppmc_fault fault = (enum sim_ppmc_fault)sim_prng_below(&bus->random, SIM_PPMC_FAULTS);
    while (!(bus->fault_mask >> fault & 1u))
        fault = fault + 1 < SIM_PPMC_FAULTS ? fault + 1 : 0;
    return fault;
}

static bool nobody_answers(struct sim_ppmc *const bus, const bool reads, uint8_t *const byte)
{
    static const uint8_t left[] = {[SIM_PPMC_ONES] = 0xFF, [SIM_PPMC_ZEROS] = 0x00};
    bus->now_ns += bus->options.timeout_ns;
    bus->stats.unanswered++;
    bus->timeout = true;
    if (!reads)
        bus->residue = *byte;
    else
        *byte = bus->options.unanswered == SIM_PPMC_RESIDUE ? bus->residue : left[bus->options.unanswered];
    return false;
}

/* The address counter of the board that is selected (rule 17). */
static void count_address(struct sim_ppmc *const bus, const struct ppmc_board *const board)
{
    const unsigned last = board->slots * REGISTERS_OF_SLOT - 1, base = board->slot * REGISTERS_OF_SLOT;
    const bool ends = bus->address - base == last;
    bus->address = (uint8_t)(ends && !bus->options.runs_on ? base : bus->address + 1u);
    if (ends)
        bus->stats.undocumented++;
}

static void read_byte(struct sim_ppmc *const bus, struct ppmc_board *const board, const enum sim_ppmc_fault fault,
                      uint8_t *const byte)
{
    *byte = ppmc_board_read(board, bus->address - board->slot * REGISTERS_OF_SLOT);
    if (fault == SIM_PPMC_FAULT_ZEROS)
        *byte = 0;
    else if (fault == SIM_PPMC_FAULT_ONES)
        *byte = 0xFF;
    else if (fault == SIM_PPMC_FAULT_RESIDUE)
        *byte = bus->residue;
}

static bool data_cycle(struct sim_ppmc *const bus, const bool reads, const enum sim_ppmc_fault fault,
                       uint8_t *const byte)
{
    struct ppmc_board *const board = selected(bus);
    if (!board)
        return nobody_answers(bus, reads, byte);
    const unsigned offset = bus->address - board->slot * REGISTERS_OF_SLOT;
    const bool timeless = reads ? ppmc_board_is_held(board, offset, bus->line) && !bus->pulses
                                : !ppmc_board_is_changed(board, offset, *byte);
    if (!timeless)
        bring_up_to_date(bus, board);
    if (reads) {
        read_byte(bus, board, fault, byte);
    } else {
        const uint8_t timer = board->registers.timer;
        ppmc_board_write(board, offset, *byte);
        if (timer != board->registers.timer)
            look_at_line(bus);
    }
    bus->residue = *byte;
    if (fault != SIM_PPMC_FAULT_REPEAT)
        count_address(bus, board);
    if (fault == SIM_PPMC_FAULT_SKIP)
        count_address(bus, board);
    return true;
}

static bool address_cycle(struct sim_ppmc *const bus, const bool reads, uint8_t *const byte)
{
    if (!reads) {
        bus->address = bus->residue = *byte;
        return true;
    }
    bus->stats.undocumented++;
    if (!selected(bus))
        return nobody_answers(bus, reads, byte);
    *byte = bus->residue = bus->address;
    return true;
}

bool sim_ppmc_cycle(struct sim_ppmc *const bus, const enum epp_kind kind, uint8_t *const byte)
{
    const bool reads = kind == EPP_ADDRESS_READ || kind == EPP_DATA_READ;
    bus->stats.cycles++;
    bus->now_ns += bus->options.cycle_ns;
    const enum sim_ppmc_fault fault = fault_of_cycle(bus);
    if (fault < SIM_PPMC_FAULTS)
        bus->stats.faults[fault]++;
    /* Any board that has power takes part in an address cycle; with none there is no handshake. */
    if (bus->unplugged || fault == SIM_PPMC_FAULT_TIMEOUT || !bus->powered)
        return nobody_answers(bus, reads, byte);
    return kind == EPP_ADDRESS_WRITE || kind == EPP_ADDRESS_READ ? address_cycle(bus, reads, byte)
                                                                 : data_cycle(bus, reads, fault, byte);
}

/* ---- the world --------------------------------------------------------------------------------------------------- */

static struct ppmc_board *board_now(struct sim_ppmc *const bus, const unsigned slot)
{
    if (slot >= SIM_PPMC_SLOTS || !bus->boards[slot].present)
        return NULL;
    bring_up_to_date(bus, &bus->boards[slot]);
    return &bus->boards[slot];
}

static struct ppmc_axis *axis_now(struct sim_ppmc *const bus, const unsigned slot, const unsigned axis)
{
    struct ppmc_board *const board = board_now(bus, slot);
    return board && axis < SIM_PPMC_AXES ? &board->axes[axis] : NULL;
}

void sim_ppmc_set_rate(struct sim_ppmc *const bus, const unsigned slot, const unsigned axis, const int32_t edges_per_s)
{
    struct ppmc_axis *const a = axis_now(bus, slot, axis);
    if (a)
        ppmc_axis_set_rate(a, edges_per_s);
}

void sim_ppmc_follow(struct sim_ppmc *const bus, const unsigned slot, const unsigned axis,
                     const sim_ppmc_position_fn position, void *const context)
{
    struct ppmc_axis *const a = axis_now(bus, slot, axis);
    if (!a)
        return;
    ppmc_axis_set_rate(a, 0);
    a->position = position;
    a->context = context;
}

void sim_ppmc_jump(struct sim_ppmc *const bus, const unsigned slot, const unsigned axis, const int edges)
{
    struct ppmc_axis *const a = axis_now(bus, slot, axis);
    if (!a)
        return;
    const struct ppmc_axis_setting setting = ppmc_board_setting(&bus->boards[slot], axis);
    ppmc_axis_jump(a, &setting, edges);
}

void sim_ppmc_set_index(struct sim_ppmc *const bus, const unsigned slot, const unsigned axis, const uint32_t counts,
                        const uint32_t offset, const uint32_t width)
{
    struct ppmc_axis *const a = axis_now(bus, slot, axis);
    if (!a || (counts > 0 && (width == 0 || width >= counts)))
        return;
    a->index_counts = counts;
    a->index_offset = offset;
    a->index_width = width;
}

void sim_ppmc_break_wire(struct sim_ppmc *const bus, const unsigned slot, const unsigned axis, const bool broken)
{
    struct ppmc_axis *const a = axis_now(bus, slot, axis);
    if (a)
        ppmc_axis_break_wire(a, broken);
}

void sim_ppmc_set_counter(struct sim_ppmc *const bus, const unsigned slot, const unsigned axis, const uint32_t value)
{
    struct ppmc_axis *const a = axis_now(bus, slot, axis);
    if (a)
        a->counter = value & PPMC_COUNTER_MASK;
}

struct sim_ppmc_truth sim_ppmc_truth(struct sim_ppmc *const bus, const unsigned slot, const unsigned axis)
{
    const struct ppmc_axis *const a = axis_now(bus, slot, axis);
    struct sim_ppmc_truth truth = {0};
    if (a) {
        truth = a->truth;
        truth.shaft = a->shaft;
        truth.counter = a->counter;
        truth.holding = a->holding;
    }
    return truth;
}

struct sim_ppmc_registers sim_ppmc_registers(struct sim_ppmc *const bus, const unsigned slot)
{
    const struct ppmc_board *const board = board_now(bus, slot);
    return board ? board->registers : (struct sim_ppmc_registers){0};
}

void sim_ppmc_set_faults(struct sim_ppmc *const bus, const uint32_t every, const unsigned mask)
{
    bus->fault_mask = mask & ((1u << SIM_PPMC_FAULTS) - 1u);
    bus->fault_every = bus->fault_mask ? every : 0;
}

void sim_ppmc_fault_at(struct sim_ppmc *const bus, const uint64_t n, const uint64_t count,
                       const enum sim_ppmc_fault fault)
{
    const struct ppmc_planned planned = {bus->stats.cycles + n, bus->stats.cycles + n + count, fault};
    bus->planned[bus->planned_count % PPMC_MAX_PLANNED] = planned;
    if (bus->planned_count < PPMC_MAX_PLANNED)
        bus->planned_count++;
}

void sim_ppmc_unplug(struct sim_ppmc *const bus, const bool unplugged)
{
    bus->unplugged = unplugged;
}

void sim_ppmc_power(struct sim_ppmc *const bus, const unsigned slot, const bool on)
{
    struct ppmc_board *const board = board_now(bus, slot);
    if (!board)
        return;
    board->powered = on;
    ppmc_board_reset(board);
    map_boards(bus);
    look_at_line(bus);
}

void sim_ppmc_reset(struct sim_ppmc *const bus)
{
    for (unsigned i = 0; i < SIM_PPMC_SLOTS; i++) {
        struct ppmc_board *const board = board_now(bus, i);
        if (board)
            ppmc_board_reset(board);
    }
    look_at_line(bus);
}

void sim_ppmc_set_id(struct sim_ppmc *const bus, const unsigned slot, const uint8_t id)
{
    struct ppmc_board *const board = board_now(bus, slot);
    if (board)
        board->id = id;
}

struct sim_ppmc_stats sim_ppmc_stats(const struct sim_ppmc *const bus)
{
    return bus->stats;
}
