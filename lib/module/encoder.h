/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the parts of the encoder driver share: encoder.c (points and set-up, plain and multiplexed), encoder_settings.c
 * (control words and rates), encoder_latch.c (index and probe), encoder_cycle.c (counts, positions and velocity).
 * Registers: register map 3.5; points and behaviour: hal-interface 2.8. Private to lib/module.
 */
#ifndef HM2_MODULE_ENCODER_H
#define HM2_MODULE_ENCODER_H

#include <limits.h>

#include <hm2/module.h>

#include "timer.h"

/* Control word (register map 3.5.1). */
#define ENCODER_A           0x0001u /* R level */
#define ENCODER_B           0x0002u /* R level */
#define ENCODER_INDEX       0x0004u /* R level, after polarity */
#define ENCODER_INDEX_HIGH  0x0008u
#define ENCODER_LATCH_INDEX 0x0010u /* clears itself when it fires, with JUST_ONCE */
#define ENCODER_JUST_ONCE   0x0040u /* reads back as written */
#define ENCODER_MASK_HIGH   0x0100u
#define ENCODER_MASK_USE    0x0200u
#define ENCODER_UP_DOWN     0x0400u
#define ENCODER_FILTER      0x0800u
#define ENCODER_PROBE_HIGH  0x1000u
#define ENCODER_LATCH_PROBE 0x2000u /* clears itself when it fires, with JUST_ONCE */
#define ENCODER_QUAD_ERROR  0x8000u
#define ENCODER_LATCHES     (ENCODER_LATCH_INDEX | ENCODER_LATCH_PROBE)
/* Bits that every firmware reads back as written, whatever happens meanwhile. */
#define ENCODER_READBACK \
    (ENCODER_INDEX_HIGH | ENCODER_JUST_ONCE | ENCODER_MASK_HIGH | ENCODER_MASK_USE | ENCODER_UP_DOWN | ENCODER_FILTER)

#define ENCODER_LOOKS       16u      /* cycles of a round of looks, at least */
#define ENCODER_LOOK_AT_ALL UINT_MAX /* instead of a number */

enum encoder_motion { ENCODER_STOPPED, ENCODER_MOVING };

/* Discarding of quadrature errors from before quad-error-enable: bit 15 is written 1 (clears it in newer firmware),
 * then 0 (clears it in older), and only what is read after both were confirmed is reported. */
enum encoder_quad { ENCODER_QUAD_OFF, ENCODER_QUAD_ONE, ENCODER_QUAD_ZERO, ENCODER_QUAD_REPORT };

/* One counter: pointers to its points, and what is known about it. */
struct encoder {
    hm2_s32_t *rawcounts, *rawlatch, *count, *count_latched;
    hm2_float_t *position, *position_interpolated, *position_latched, *velocity, *velocity_rpm;
    hm2_bit_t *reset, *index_enable, *no_clear_on_index;
    hm2_bit_t *probe_enable, *probe_invert; /* versions with a probe input, else NULL */
    hm2_bit_t *quad_error, *quad_error_enable;
    hm2_bit_t *input_a, *input_b, *input_index;
    hm2_float_t *scale;
    hm2_bit_t *index_invert, *index_mask, *index_mask_invert, *counter_mode, *filter;
    hm2_float_t *vel_timeout;

    const struct hm2_module *module;
    unsigned number; /* of this encoder */

    bool still;            /* stopped, nothing armed or reported: while the card says the same nothing changes */
    uint32_t count_word;   /* count and time stamp as read last */
    int64_t raw;           /* counts since load */
    int64_t zero, latched; /* raw counts at position 0 and at the last event */
    double scale_seen;     /* usable value of the parameter */
    double inverse_scale;  /* units per count */
    double position_now;   /* units */
    double speed;          /* units/s */
    enum encoder_motion motion;
    uint64_t edge_ticks; /* time of the last edge on the card's clock */
    int32_t edge_counts; /* counts since the edge before */

    struct hm2_section control;
    uint32_t word;         /* as handed to the plan last */
    uint32_t seen;         /* control register as read last */
    uint16_t latch_before; /* latch register before arming */
    bool latch_known;      /* nothing but this search can have changed the latch since */
    bool spent;            /* what is armed in word has fired */
    bool busy;             /* word or quad are to be looked at in every cycle */
    enum encoder_quad quad;
};

struct encoder_module {
    hm2_u32_t *sample_frequency; /* plain or muxed */
    hm2_u32_t *skew_ns;          /* muxed version 4 and later, else NULL */
    struct hm2_timer timer;
    hm2_bit_t *hires_timestamp;

    bool muxed, has_probe;
    bool started;
    /* Encoder whose parameters are looked at next, and whose pins are written although it stands still; and length of
     * the round. */
    unsigned look, looks;
    uint32_t clock_hz;
    /* Time stamps. The card's 16-bit counter is extended to 64 bits. */
    bool timebase_known; /* the divisor in use is the one computed with */
    double tick_s;
    uint64_t now_ticks;
    uint16_t stamp;   /* time-stamp counter as read last */
    int64_t stamp_ns; /* when */

    /* settings as seen last */
    uint32_t sample_frequency_seen, skew_seen_ns;
    bool hires_seen;

    struct hm2_window stamp_counter, counts, controls;
    struct hm2_section divisor, filter_rate;
    struct encoder encoder[]; /* module->instances */
};

/* ---- encoder_settings.c --------------------------------------------------------------------------------------------
 */

int HM2_MUST_CHECK encoder_add_settings(struct hm2_module *module, struct hm2_setup *setup);
/* Hand changed parameters to the plan. Realtime safe. */
void encoder_pack(struct hm2_module *module, const struct hm2_cycle *cycle);

/* Filter register for a sample frequency, and what it really gives. Plain arithmetic; clock_hz > 0. */
uint32_t encoder_filter_rate(uint32_t clock_hz, uint32_t wanted_hz, uint32_t *actual_hz);
/* Skew field (0 to 15 clocks) for a delay, and what it really gives. */
uint32_t encoder_skew(uint32_t clock_hz, uint32_t wanted_ns, uint32_t *actual_ns);
/* Time-stamp divisor for a tick frequency, and the tick it gives in seconds. */
uint32_t encoder_divisor(uint32_t clock_hz, uint32_t tick_hz, double *tick_s);

/* ---- encoder_latch.c -----------------------------------------------------------------------------------------------
 */

/* Bits that arm what the pins ask for, as far as it is safe in this cycle. polarity is ENCODER_INDEX_HIGH or 0. */
uint32_t encoder_arm(struct encoder *enc, uint32_t polarity, bool has_probe);
/* See whether a latch that is armed has fired; called with the counts of the same reply already added. */
void encoder_check_latch(struct encoder *enc, uint32_t control);
/* The card lost its state: nothing is armed in it, and what it reads is no event. */
void encoder_forget_latch(struct encoder *enc);

/* ---- encoder_cycle.c -----------------------------------------------------------------------------------------------
 */

void encoder_start(struct hm2_module *module, const struct hm2_cycle *cycle);
void encoder_unpack(struct hm2_module *module, const struct hm2_cycle *cycle);

#endif
