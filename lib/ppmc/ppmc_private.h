/* SPDX-License-Identifier: LGPL-2.1-or-later */
#ifndef PPMC_PRIVATE_H
#define PPMC_PRIVATE_H

#include <stdatomic.h>

#include <hm2/ppmc.h>

#include "registers.h"

/* One count of an axis, and when it came by the board's clock. */
struct ppmc_stamp {
    bool valid;
    int64_t total, at_us;
};

struct ppmc_encoder {
    hm2_float_t *position, *velocity, *scale, *min_speed_estimate;
    hm2_s32_t *count, *delta;
    hm2_bit_t *index, *index_enable;
    /* Kept apart from the pins: a pin that is linked shows its signal's value. */
    bool known;              /* raw is a reading, not the assumption of the start */
    uint32_t raw;            /* last good reading, 24 bits */
    int64_t total;           /* counts since the start, or since the index that was announced */
    int32_t last_delta;      /* of the last good period */
    int direction;           /* of the last counts: 1, -1, or 0 before the first */
    double speed;            /* in counts a second */
    bool armed;              /* the board presets this axis at its index, or may do so */
    bool may_preset;         /* it may have done so since the last good reading */
    struct ppmc_stamp stamp; /* of the last count that has one */
};

/* What one reading says about an axis. */
struct ppmc_judgement {
    uint32_t raw;
    int32_t value;   /* raw with its sign */
    int32_t moved;   /* since the last good one */
    bool index;      /* the counter was preset: it counts from the index */
    bool impossible; /* it cannot have moved so far */
};

/* A board with encoders. */
struct ppmc_board {
    unsigned slot;
    struct ppmc_board_info info;
    double max_hz;  /* counts a second that the filter lets through */
    uint8_t filter; /* register 5, when it is set */
    bool sets_filter, timestamps, verify;
    struct ppmc_encoder *encoders; /* PPMC_AXES of them, in the binder's memory */
    struct ppmc_board_pins *pins;
    /* Its part of the list of a read. */
    unsigned first, end;
    uint8_t base, stamps_at;
    uint8_t block[PPMC_BLOCK_BYTES], again[PPMC_COUNTS_BYTES];
    uint8_t stamps[PPMC_STAMPS_BYTES], stamps_again[PPMC_STAMPS_BYTES];
    uint8_t sense_at, sense_byte, preset_at, preset;
    /* State. */
    bool retried, failed; /* in this read */
    /* Index bits that were read, and thereby cleared, and are not used yet: those that came before the latch pulse of
     * the present reading, and those of which nobody knows. */
    uint8_t sense, sense_new;
    bool online;
    unsigned bad_periods; /* since the last good one */
    unsigned jumps;       /* of these in succession, those in which only the counts were impossible */
    int64_t good_ns;      /* the last good latch pulse came after this */
    bool clock_known;
    uint16_t timebase;
    int64_t clock_us;                          /* the timebase, extended */
    _Atomic uint32_t outages, returns, losses; /* for messages */
    uint32_t outages_told, returns_told, losses_told;
};

struct ppmc_board_pins {
    hm2_bit_t *online, *position_lost;
    hm2_u32_t *failures;
};

struct ppmc_bus_pins {
    hm2_bit_t *fault;
    hm2_u32_t *timeouts, *io_errors, *bad_data, *retries;
};

#define PPMC_LATCH_STEPS 8u

struct ppmc {
    struct epp *epp;
    unsigned bus;
    bool keep_counts;
    struct ppmc_board_info infos[PPMC_SLOTS];
    unsigned board_count;
    struct ppmc_board boards[PPMC_SLOTS];
    struct ppmc_bus_pins *pins;
    /* The list of a read: latch pulse, then each board. */
    unsigned step_count;
    struct epp_step steps[EPP_MAX_STEPS];
    uint8_t timer_at, pulse, no_pulse;
    bool latch_retried, latch_failed;
    bool line_unknown; /* a latch pulse was cut short: its line may still be up */
    uint32_t timeouts, io_errors, bad_data, retries;
};

/* Lay out the list of a read. */
void ppmc_plan(struct ppmc *ppmc);
/* Write registers of a board in order, retrying each run once. */
struct ppmc_write {
    uint8_t offset, value;
};
int ppmc_write_registers(struct ppmc *ppmc, const struct ppmc_board *board, const struct ppmc_write *writes,
                         size_t count);
/* Set-up registers of a board as they must be while it runs; counters stay as they are. */
int ppmc_restore(struct ppmc *ppmc, struct ppmc_board *board);

/* Account a failed run. */
void ppmc_count_error(struct ppmc *ppmc, int err);

/* ---- one axis (encoder.c) ---------------------------------------------------------------------------------------- */

/* `most` is how far it can have moved; `sense` whether its index was seen. */
struct ppmc_judgement ppmc_judge(const struct ppmc_encoder *encoder, const uint8_t *bytes, bool sense, int64_t most);
struct ppmc_time {
    double period_s;  /* since the last good latch pulse, by the thread's period */
    bool stamped;     /* the board's clock and this axis' timestamp can be used */
    int64_t clock_us; /* at the latch pulse */
    int64_t count_us; /* at its last count */
};
/* Take a good reading. */
void ppmc_encoder_take(struct ppmc_encoder *encoder, const struct ppmc_judgement *judgement, bool sense,
                       const struct ppmc_time *time);
/* The counter is elsewhere and nobody knows how far the shaft moved: go on from there. */
void ppmc_encoder_rebase(struct ppmc_encoder *encoder, const uint8_t *bytes);
/* Show what there is; `good` = it was taken in this period. */
void ppmc_encoder_show(struct ppmc_encoder *encoder, bool good, bool online);

#endif
