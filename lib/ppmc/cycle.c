/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* One servo period on the bus: latch, read, judge, show; arm and disarm (ppmc.md section 6). */
#include <hm2/bytes.h>

#include "ppmc_private.h"

/* A board that gave nothing usable for so many periods in succession is off line. */
#define OFFLINE_PERIODS 3u
/* Counts that are impossible for so many periods in succession are where the counter really is. */
#define JUMP_PERIODS 3u
/* A board that was off line for longer may have lost its power. */
#define POWER_CYCLE_NS 50000000
/* Seen in the reading of another one, an index takes one look more. */
#define INDEX_LOOKS 2u
/* The board's clock, 16 bits of microseconds, tells how long it was for so long only. */
#define CLOCK_GAP_NS 60000000
/* The two readings of the timebase, where the board does not hold it, are closer than this. */
#define TIMEBASE_SLACK_US 200u

/* ---- the list ---------------------------------------------------------------------------------------------------- */

static void add(struct ppmc *const ppmc, const enum epp_kind kind, const unsigned len, uint8_t *const data)
{
    ppmc->steps[ppmc->step_count++] = (struct epp_step){kind, (uint8_t)len, data};
}

static void add_read(struct ppmc *const ppmc, uint8_t *const address, const unsigned len, uint8_t *const data)
{
    add(ppmc, EPP_ADDRESS_WRITE, 1, address);
    add(ppmc, EPP_DATA_READ, len, data);
}

/* Pulse of the soft latch: twice, so that it lasts for 2 us (ppmc.md section 2.4). The first pair ends a pulse that was
 * cut short, and is run only then. */
static void plan_latch(struct ppmc *const ppmc)
{
    uint8_t *const values[] = {&ppmc->no_pulse, &ppmc->pulse, &ppmc->pulse, &ppmc->no_pulse};
    for (unsigned i = 0; i < PPMC_LATCH_STEPS / 2; i++) {
        add(ppmc, EPP_ADDRESS_WRITE, 1, &ppmc->timer_at);
        add(ppmc, EPP_DATA_WRITE, 1, values[i]);
    }
}

static void plan_board(struct ppmc *const ppmc, struct ppmc_board *const board)
{
    board->first = ppmc->step_count;
    add_read(ppmc, &board->base, PPMC_BLOCK_BYTES, board->block);
    if (board->verify)
        add_read(ppmc, &board->base, PPMC_COUNTS_BYTES, board->again);
    if (board->timestamps)
        add_read(ppmc, &board->stamps_at, PPMC_STAMPS_BYTES, board->stamps);
    if (board->timestamps && board->verify)
        add_read(ppmc, &board->stamps_at, PPMC_STAMPS_BYTES, board->stamps_again);
    board->end = ppmc->step_count;
}

void ppmc_plan(struct ppmc *const ppmc)
{
    ppmc->step_count = 0;
    plan_latch(ppmc);
    for (unsigned i = 0; i < ppmc->board_count; i++)
        plan_board(ppmc, &ppmc->boards[i]);
}

_Static_assert(PPMC_LATCH_STEPS + PPMC_SLOTS * 4 + PPMC_SLOTS / 2 * 4 <= EPP_MAX_STEPS, "a full bus fits the list");

/* ---- running it -------------------------------------------------------------------------------------------------- */

void ppmc_count_error(struct ppmc *const ppmc, const int err)
{
    if (err == HM2_ERR_TIMEOUT)
        ppmc->timeouts++;
    else
        ppmc->io_errors++;
}

/* Reading the sense register has cleared it, whatever became of the rest of the block. */
static void keep_sense(struct ppmc_board *const board)
{
    const uint8_t sense = board->block[PPMC_R_SENSE];
    if ((sense & PPMC_SENSE_UNUSED) == 0)
        board->sense_new |= sense;
}

static struct ppmc_board *board_of_step(struct ppmc *const ppmc, const unsigned step)
{
    unsigned i = 0;
    while (step >= ppmc->boards[i].end)
        i++;
    return &ppmc->boards[i];
}

/* Where to go on in the list after a failure: once more with the same part of it, or behind it. */
static unsigned after_failure(struct ppmc *const ppmc, const unsigned step, const size_t bytes)
{
    if (step < PPMC_LATCH_STEPS) {
        const bool again = !ppmc->latch_retried;
        ppmc->latch_retried = true;
        ppmc->latch_failed = !again;
        ppmc->retries += again;
        return again ? 0 : ppmc->step_count; /* what was not latched need not be read */
    }
    struct ppmc_board *const board = board_of_step(ppmc, step);
    if (step > board->first + 1 || (step == board->first + 1 && bytes > PPMC_R_SENSE))
        keep_sense(board);
    const bool again = !board->retried;
    board->retried = true;
    board->failed = !again;
    ppmc->retries += again;
    return again ? board->first : board->end;
}

/* Run the list from one step to another. */
static void run(struct ppmc *const ppmc, unsigned at, const unsigned end)
{
    while (at < end) {
        struct epp_done done;
        const int err = epp_run(ppmc->epp, ppmc->steps + at, end - at, &done);
        if (err == 0)
            return;
        ppmc_count_error(ppmc, err);
        at = after_failure(ppmc, at + (unsigned)done.steps, done.bytes);
    }
}

/* ---- judging a board --------------------------------------------------------------------------------------------- */

static bool reads_well(const struct ppmc_board *const board)
{
    return board->block[PPMC_R_ID] == board->info.id && (board->block[PPMC_R_SENSE] & PPMC_SENSE_UNUSED) == 0 &&
           (!board->verify || memcmp(board->block, board->again, PPMC_COUNTS_BYTES) == 0);
}

/* Read once more what does not read well. */
static void check_board(struct ppmc *const ppmc, struct ppmc_board *const board)
{
    while (!board->failed && !reads_well(board)) {
        ppmc->bad_data++;
        if (board->block[PPMC_R_ID] == board->info.id)
            keep_sense(board);
        board->failed = board->retried;
        if (board->failed)
            return;
        board->retried = true;
        ppmc->retries++;
        run(ppmc, board->first, board->end);
    }
    if (!board->failed)
        keep_sense(board);
}

/* Counts that can have come since the last good latch pulse. One pulse may have been lost without a trace, and the
 * clocks of two machines differ. */
static int64_t most_counts(const struct ppmc_board *const board, const int64_t now_ns, const long period_ns)
{
    const double most = board->max_hz * ((double)(now_ns - board->good_ns) + (double)period_ns) * 1e-9 * 1.01 + 8.0;
    return most < 0x1p40 ? (int64_t)most : INT64_C(1) << 40;
}

/* After a reset all counters are at 0, give or take what they move in a period. No shaft stops within a period where it
 * happens to be 0, all four of them. */
static bool looks_reset(const struct ppmc_board *const board, const struct ppmc_judgement *const judgements)
{
    bool jumped = false;
    for (unsigned i = 0; i < PPMC_AXES; i++) {
        const struct ppmc_encoder *const encoder = &board->encoders[i];
        const int64_t pace = encoder->last_delta < 0 ? -(int64_t)encoder->last_delta : encoder->last_delta;
        const int64_t moved = judgements[i].moved, value = judgements[i].value;
        if (value > 4 + 2 * pace || value < -4 - 2 * pace)
            return false;
        jumped = jumped || (encoder->known && !judgements[i].index && (moved > 4 + 4 * pace || moved < -4 - 4 * pace));
    }
    return jumped;
}

static bool is_possible(const struct ppmc_board *const board, struct ppmc_judgement *const judgements,
                        const int64_t most)
{
    bool possible = true;
    for (unsigned i = 0; i < PPMC_AXES; i++) {
        judgements[i] =
            ppmc_judge(&board->encoders[i], board->block + PPMC_COUNT_BYTES * i, board->sense >> i & 1u, most);
        possible = possible && !judgements[i].impossible;
    }
    return possible && !looks_reset(board, judgements);
}

/* ---- taking it --------------------------------------------------------------------------------------------------- */

static void lose_position(struct ppmc_board *const board)
{
    *board->pins->position_lost = true;
    atomic_fetch_add_explicit(&board->losses, 1, memory_order_relaxed);
}

/* The board's own clock at the latch pulse, in 64 bits; false when it does not go on from the last one. */
static bool take_clock(struct ppmc_board *const board, const int64_t gap_ns)
{
    const uint16_t timebase = hm2_get_le16(board->stamps + PPMC_TIMEBASE_AT);
    const uint16_t second = hm2_get_le16(board->stamps_again + PPMC_TIMEBASE_AT);
    const bool good = !board->verify || (uint16_t)(second - timebase) <= TIMEBASE_SLACK_US;
    const bool goes_on = good && board->clock_known && gap_ns < CLOCK_GAP_NS;
    if (goes_on)
        board->clock_us += (uint16_t)(timebase - board->timebase);
    board->timebase = timebase;
    board->clock_known = good;
    return goes_on;
}

static struct ppmc_time time_of(const struct ppmc_board *const board, const unsigned axis, const long period_ns)
{
    const uint8_t *const at = board->stamps + 2 * axis;
    const bool same = !board->verify || memcmp(at, board->stamps_again + 2 * axis, 2) == 0;
    const uint16_t age_us = (uint16_t)(board->timebase - hm2_get_le16(at));
    const double periods = (double)board->bad_periods + 1.0; /* in which it moved as far as it did */
    struct ppmc_time time = {.period_s = (double)period_ns * 1e-9 * periods, .clock_us = -1};
    if (!board->timestamps || !board->clock_known)
        return time;
    time.stamped = same;
    time.clock_us = board->clock_us;
    time.count_us = board->clock_us - age_us;
    return time;
}

static void take(struct ppmc_board *const board, const struct ppmc_judgement *const judgements, const int64_t gap_ns,
                 const long period_ns)
{
    if (board->timestamps && !take_clock(board, gap_ns))
        for (unsigned i = 0; i < PPMC_AXES; i++)
            board->encoders[i].stamp.valid = false;
    for (unsigned i = 0; i < PPMC_AXES; i++) {
        const struct ppmc_time time = time_of(board, i, period_ns);
        ppmc_encoder_take(&board->encoders[i], &judgements[i], ((unsigned)board->sense | board->sense_new) >> i & 1u,
                          &time);
    }
}

static void take_failure(struct ppmc_board *const board)
{
    (*board->pins->failures)++;
    if (board->bad_periods < UINT32_MAX)
        board->bad_periods++;
    if (board->online && board->bad_periods >= OFFLINE_PERIODS) {
        board->online = false;
        atomic_fetch_add_explicit(&board->outages, 1, memory_order_relaxed);
    }
}

static void rebase(struct ppmc_board *const board)
{
    for (unsigned i = 0; i < PPMC_AXES; i++)
        ppmc_encoder_rebase(&board->encoders[i], board->block + PPMC_COUNT_BYTES * i);
    board->clock_known = false;
}

/* A board that is back, or whose counters were somewhere else all at once, may have lost its registers. */
static bool settle(struct ppmc *const ppmc, struct ppmc_board *const board, const bool jumped, const int64_t gap_ns)
{
    const bool back = !board->online;
    if (!back && !jumped)
        return true;
    if (ppmc_restore(ppmc, board) != 0)
        return false;
    if (jumped || gap_ns > POWER_CYCLE_NS)
        lose_position(board);
    if (back)
        atomic_fetch_add_explicit(&board->returns, 1, memory_order_relaxed);
    board->online = true;
    return true;
}

/* 24 bits tell how far it moved only as long as it cannot have gone half their way round. One that shows no move has
 * made none: it would have to be back at the very count. */
static bool may_have_gone_round(const struct ppmc_board *const board, const struct ppmc_judgement *const judgements,
                                const int64_t most)
{
    bool moved = false;
    for (unsigned i = 0; i < PPMC_AXES; i++)
        moved = moved || (board->encoders[i].known && !judgements[i].index && judgements[i].moved != 0);
    return moved && most >= PPMC_HALF_ROUND;
}

/* True when this period's data of the board is good. */
static bool read_board(struct ppmc *const ppmc, struct ppmc_board *const board, const int64_t before_ns,
                       const long period_ns)
{
    struct ppmc_judgement judgements[PPMC_AXES];
    if (board->failed) {
        board->jumps = 0;
        return false;
    }
    const int64_t gap_ns = before_ns - board->good_ns;
    const int64_t most = most_counts(board, epp_now_ns(ppmc->epp), period_ns);
    const bool possible = is_possible(board, judgements, most);
    board->jumps = possible ? 0 : board->jumps + 1;
    ppmc->bad_data += !possible;
    if ((!possible && board->jumps < JUMP_PERIODS) || !settle(ppmc, board, !possible, gap_ns))
        return false;
    if (possible && may_have_gone_round(board, judgements, most))
        lose_position(board);
    if (possible)
        take(board, judgements, gap_ns, period_ns);
    else
        rebase(board);
    board->sense = 0;
    board->bad_periods = 0;
    board->good_ns = before_ns;
    return true;
}

/* ---- arming and disarming ---------------------------------------------------------------------------------------- */

/* Register 13 as the index-enable pins want it. Before an index is armed the sense register is read, which clears it:
 * an index that came earlier is not the one that is looked for. */
static int run_preset(struct ppmc *const ppmc, struct ppmc_board *const board, const bool arms)
{
    const struct epp_step steps[] = {
        {EPP_ADDRESS_WRITE, 1, &board->sense_at},
        {EPP_DATA_READ, 1, &board->sense_byte},
        {EPP_ADDRESS_WRITE, 1, &board->preset_at},
        {EPP_DATA_WRITE, 1, &board->preset},
    };
    const size_t count = sizeof steps / sizeof steps[0];
    size_t at = arms ? 0 : 2;
    struct epp_done done;
    int err = epp_run(ppmc->epp, steps + at, count - at, &done);
    if (err == 0)
        return 0;
    ppmc_count_error(ppmc, err);
    ppmc->retries++;
    at = at + done.steps < 2 ? 0 : 2;
    err = epp_run(ppmc->epp, steps + at, count - at, &done);
    if (err)
        ppmc_count_error(ppmc, err);
    return err;
}

static void write_preset(struct ppmc *const ppmc, struct ppmc_board *const board)
{
    unsigned arms = 0;
    board->preset = 0;
    board->sense_byte = 0;
    for (unsigned i = 0; i < PPMC_AXES; i++) {
        struct ppmc_encoder *const encoder = &board->encoders[i];
        const bool wanted = *encoder->index_enable;
        board->preset |= (uint8_t)(wanted << i);
        arms |= (unsigned)(wanted && !encoder->armed) << i;
        encoder->armed = encoder->armed || wanted; /* also when it is only half done */
        encoder->may_preset = encoder->may_preset || encoder->armed;
    }
    const int err = run_preset(ppmc, board, arms != 0);
    if ((board->sense_byte & PPMC_SENSE_UNUSED) == 0)
        board->sense |= board->sense_byte;
    board->sense &= (uint8_t)~arms;
    if (err)
        return; /* it is written anew in the next period */
    for (unsigned i = 0; i < PPMC_AXES; i++)
        board->encoders[i].armed = ((unsigned)board->preset >> i & 1u) != 0;
}

static bool is_index_done(const struct ppmc_board *const board)
{
    for (unsigned i = 0; i < PPMC_AXES; i++)
        if (board->encoders[i].armed && !*board->encoders[i].index_enable)
            return true;
    return false;
}

/* ---- the functions ----------------------------------------------------------------------------------------------- */

static void show_bus(const struct ppmc *const ppmc, const bool fault)
{
    *ppmc->pins->fault = fault;
    *ppmc->pins->timeouts = ppmc->timeouts;
    *ppmc->pins->io_errors = ppmc->io_errors;
    *ppmc->pins->bad_data = ppmc->bad_data;
    *ppmc->pins->retries = ppmc->retries;
}

static void begin(struct ppmc *const ppmc)
{
    ppmc->latch_retried = !ppmc->boards[0].online; /* nothing is tried twice with a board that is not there */
    ppmc->latch_failed = false;
    for (unsigned i = 0; i < ppmc->board_count; i++) {
        struct ppmc_board *const board = &ppmc->boards[i];
        board->retried = !board->online;
        board->failed = false;
        board->sense |= board->sense_new;
        board->sense_new = 0;
    }
}

static void latch_and_read(struct ppmc *const ppmc)
{
    begin(ppmc);
    run(ppmc, ppmc->line_unknown ? 0 : 2, ppmc->step_count);
    ppmc->line_unknown = ppmc->latch_failed;
    for (unsigned i = 0; i < ppmc->board_count; i++) {
        ppmc->boards[i].failed = ppmc->boards[i].failed || ppmc->latch_failed;
        check_board(ppmc, &ppmc->boards[i]);
    }
}

/* An index that is looked for was seen: before the latch pulse or behind it? */
static bool is_index_unclear(const struct ppmc *const ppmc)
{
    for (unsigned i = 0; i < ppmc->board_count; i++)
        for (unsigned k = 0; k < PPMC_AXES; k++)
            if ((ppmc->boards[i].sense_new >> k & 1u) && ppmc->boards[i].encoders[k].armed)
                return true;
    return false;
}

static void show_board(const struct ppmc_board *const board, const bool good)
{
    for (unsigned i = 0; i < PPMC_AXES; i++)
        ppmc_encoder_show(&board->encoders[i], good, board->online);
    *board->pins->online = board->online;
}

void ppmc_read(struct ppmc *const ppmc, const long period_ns)
{
    int64_t before_ns = epp_now_ns(ppmc->epp);
    bool fault = false;
    latch_and_read(ppmc);
    for (unsigned i = 0; i < INDEX_LOOKS && is_index_unclear(ppmc); i++) {
        before_ns = epp_now_ns(ppmc->epp);
        latch_and_read(ppmc); /* now it was before */
    }
    for (unsigned i = 0; i < ppmc->board_count; i++) {
        struct ppmc_board *const board = &ppmc->boards[i];
        const bool good = read_board(ppmc, board, before_ns, period_ns);
        if (!good)
            take_failure(board);
        else if (is_index_done(board))
            write_preset(ppmc, board); /* at once: another index must not preset it again */
        show_board(board, good);
        fault = fault || !good;
    }
    show_bus(ppmc, fault);
}

void ppmc_write(struct ppmc *const ppmc, const long period_ns)
{
    (void)period_ns;
    for (unsigned i = 0; i < ppmc->board_count; i++)
        if (ppmc->boards[i].online && ppmc->boards[i].info.index)
            write_preset(ppmc, &ppmc->boards[i]);
    show_bus(ppmc, *ppmc->pins->fault);
}
