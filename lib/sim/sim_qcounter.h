/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Quadrature counters as the encoder modules contain them, plain and multiplexed: input filters, counter, index and
 * probe logic, time stamps (register map 3.5, traces encoder and encoder_muxed). Time is that of the module: "edge k"
 * is edge k of ClockLow, registers before edge k are what edges below k made.
 */
#ifndef SIM_QCOUNTER_H
#define SIM_QCOUNTER_H

#include "sim_card.h"

/* ---- dividers -------------------------------------------------------------------------------------------------------
 * A down counter that is reloaded when it has run through 0: it ticks every value + 2 clocks, or every clock when its
 * top bit is set. A new value is used from the next reload on. */
struct sim_divider {
    int64_t next;   /* a tick is at this edge, */
    int64_t period; /* and every so many edges from there */
};

/* Counter at 0, first tick at edge clk + 1. */
void sim_divider_start(struct sim_divider *d, int64_t clk, uint32_t value, uint32_t top_bit);
/* First tick at or after edge clk. */
int64_t sim_divider_tick(const struct sim_divider *d, int64_t clk);
/* Ticks in edges [from, to). */
int64_t sim_divider_count(const struct sim_divider *d, int64_t from, int64_t to);
/* The value is written at edge clk. */
void sim_divider_write(struct sim_divider *d, int64_t clk, uint32_t value, uint32_t top_bit);

/* Time stamp counter (registers TSDiv and TSCount). */
struct sim_timestamp {
    struct sim_divider divider;
    uint16_t divisor; /* as written */
    uint16_t base;    /* count before edge since */
    int64_t since;
};

#define SIM_TSDIV_TOP_BIT 0x8000u

/* The divisor is written at edge clk. */
void sim_timestamp_write(struct sim_timestamp *ts, int64_t clk, uint16_t divisor);
uint16_t sim_timestamp_at(const struct sim_timestamp *ts, int64_t clk);

/* ---- one counter ----------------------------------------------------------------------------------------------------
 */

enum { SIM_QC_A, SIM_QC_B, SIM_QC_INDEX, SIM_QC_PROBE, SIM_QC_INPUTS };

/* Control register bits (3.5.1). */
#define SIM_QC_ERROR          (1u << 15)
#define SIM_QC_AB_MASK_POL    (1u << 14)
#define SIM_QC_LATCH_ON_PROBE (1u << 13)
#define SIM_QC_PROBE_POL      (1u << 12)
#define SIM_QC_FILTER         (1u << 11)
#define SIM_QC_UP_DOWN        (1u << 10)
#define SIM_QC_USE_MASK       (1u << 9)
#define SIM_QC_MASK_POL       (1u << 8)
#define SIM_QC_AB_GATE        (1u << 7)
#define SIM_QC_JUST_ONCE      (1u << 6)
#define SIM_QC_CLEAR          (1u << 5)
#define SIM_QC_LATCH          (1u << 4)
#define SIM_QC_INDEX_POL      (1u << 3)

/* What differs between generations of the firmware. */
struct sim_qc_type {
    bool probe;         /* has the probe input, bits 13 and 12, and clears at once */
    bool error_by_one;  /* writing 1 to bit 15 clears it (newer source); else the bit is loaded as written */
    bool dpll_select;   /* has register 5, and reads what a DPLL timer sampled */
    bool filter_halved; /* multiplexed: the filters advance once per two select phases (newer source) */
};

struct sim_qcounter {
    bool pin[SIM_QC_INPUTS]; /* levels now */
    bool mask;
    bool sampled[SIM_QC_INPUTS], filtered[SIM_QC_INPUTS], first[SIM_QC_INPUTS], second[SIM_QC_INPUTS];
    uint8_t filter[SIM_QC_INPUTS];
    bool clearing;
    bool at_rest; /* found neither busy nor unsettled, and no input and no register has changed since */
    uint16_t count, latch, stamp;
    uint16_t control;

    int64_t last_edge; /* the last edge that was worked out one by one, and the registers before it */
    uint32_t before_data, before_control;
    uint32_t sampled_data, sampled_control; /* at the last rise of the DPLL timer */
};

/* What the bus does at one edge. */
struct sim_qc_access {
    bool clear;
    bool load;
    uint16_t value;
};

uint32_t sim_qcounter_data(const struct sim_qcounter *q);
uint32_t sim_qcounter_control(const struct sim_qcounter *q);
/* One edge. tick: the filters advance at it. stamp: time stamp counter before it. access may be NULL. */
void sim_qcounter_edge(struct sim_qcounter *q, const struct sim_qc_type *type, int64_t clk, bool tick, uint16_t stamp,
                       const struct sim_qc_access *access);
/* Something changes at the next edge even without a tick. */
bool sim_qcounter_busy(const struct sim_qcounter *q, const struct sim_qc_type *type);
/* Ticks change nothing any more, for ever. */
bool sim_qcounter_settled(const struct sim_qcounter *q, const struct sim_qc_type *type);
/* An index pulse of a follower, at the present count. */
void sim_qcounter_index(struct sim_qcounter *q);

/* ---- a module of counters -------------------------------------------------------------------------------------------
 */

__extension__ typedef __int128 sim_wide;

/* An encoder that turns with a step generator or a motor (sim_card_follow(), sim_card_motor()). */
struct sim_follow {
    int64_t (*position)(struct sim_card *card, unsigned unit); /* of what it follows; NULL = nothing */
    unsigned unit;
    int32_t num, den;
    bool keeps;            /* its position, when the card loses its power; else it starts at 0 again */
    uint32_t index_counts; /* from index to index; 0 = it has none */
    int64_t turned;        /* counts since it follows, over power cycles */
    int64_t seen;          /* position when it was looked at last, */
    int64_t seen_clk;      /* and when that was */
    sim_wide part;         /* of the next count, in units of 1 / (den * 2^32): what floor() has left so far */
};

/* First part of the state of both encoder modules. */
struct sim_qc_bank {
    struct sim_qc_type type;
    unsigned count;
    struct sim_qcounter *counters;
    struct sim_follow *follows;
    bool following; /* some of them are active */
    struct sim_timestamp stamps;
    uint8_t select; /* register 5, bits 15..12 */
    uint16_t sampled_stamp;
};

int sim_qc_bank_init(struct sim_module *m, struct sim_qc_bank *bank);
void sim_qc_bank_release(struct sim_qc_bank *bank);
void sim_qc_bank_power_up(struct sim_module *m, struct sim_qc_bank *bank);
uint32_t sim_qc_bank_read(struct sim_module *m, struct sim_qc_bank *bank, unsigned page, unsigned low,
                          uint32_t *undriven);
/* What a write at edge clk does to the registers that all counters share; the edge itself has been made. */
void sim_qc_bank_write(struct sim_qc_bank *bank, int64_t clk, unsigned page, uint32_t value);
/* An encoder of the card, plain or multiplexed, is to follow something from now on. */
int sim_qc_follow(struct sim_card *card, unsigned encoder, const struct sim_follow *what);
/* Followers catch up with what they follow; m->clk is where the module is now. */
void sim_qc_bank_follow(struct sim_module *m, struct sim_qc_bank *bank, int64_t clk);
/* Registers of every counter, as a DPLL timer samples them just before edge clk. */
void sim_qc_bank_sample(struct sim_qc_bank *bank, int64_t clk);
/* Edge at which the selected timer samples, the last one below clk; INT64_MIN when there is none. */
int64_t sim_qc_bank_sample_edge(struct sim_module *m, const struct sim_qc_bank *bank, int64_t clk);

/* Next edge after which the module must be looked at for the sake of followers that a timer samples. */
int64_t sim_qc_bank_next_sample(struct sim_module *m, const struct sim_qc_bank *bank);

enum {
    SIM_QC_PAGE_COUNT,
    SIM_QC_PAGE_CONTROL,
    SIM_QC_PAGE_TSDIV,
    SIM_QC_PAGE_TSCOUNT,
    SIM_QC_PAGE_RATE,
    SIM_QC_PAGE_SELECT,
    SIM_QC_PAGES
};

#endif
