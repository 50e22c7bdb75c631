/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * PWM and PDM generator at the clock it runs on, ClockHigh (register map 3.6, traces in folder pwmgen). Every edge can
 * be made singly; quiet stretches are skipped with the same result.
 *
 * Registers come from the other clock: a write raises a request, two flip-flops follow it, the register takes the new
 * value with the third edge of ClockHigh, and the request falls as soon as the second flip-flop is up.
 */
#ifndef SIM_PWM_LOGIC_H
#define SIM_PWM_LOGIC_H

#include <stdbool.h>
#include <stdint.h>

#define PWM_NEVER INT64_MAX

/* Write request and its two followers. */
struct pwm_request {
    bool asked, first, second;
};

/* Rate generator: 17-bit accumulator; a pulse follows each change of its top bit by one edge. */
struct pwm_rate {
    uint32_t accumulator;
    bool old_top;
    uint16_t rate, next_rate;
    struct pwm_request request;
};

/* What all channels share. */
struct pwm_reference {
    struct pwm_rate pwm, pdm;
    uint16_t count; /* 13 bits */
    bool pdm_pulse;
};

struct pwm_channel {
    uint16_t value, next_value; /* 12 bits */
    bool dir, next_dir;
    uint8_t mode, next_mode; /* 6 bits */
    struct pwm_request value_request, mode_request;
    uint16_t ramp; /* 12 bits: the reference count as the comparator sees it, an edge late */
    bool old_toggle;
    bool pwm;
    uint16_t pdm; /* 13 bits; the top bit is the output */
};

enum pwm_pin { PWM_PIN_A, PWM_PIN_B };

/* Writes from the bus. */
void pwm_rate_write(struct pwm_rate *rate, uint16_t value);
void pwm_value_write(struct pwm_channel *channel, uint32_t value);
void pwm_mode_write(struct pwm_channel *channel, uint32_t value);

/* One edge of ClockHigh: of the shared part, and of a channel. The channel goes first: it sees the reference as it was
 * before the edge. */
void pwm_channel_edge(struct pwm_channel *channel, const struct pwm_reference *ref);
void pwm_reference_edge(struct pwm_reference *ref);

/* Make n edges of the reference, and of a channel with it (channel may be NULL). */
void pwm_run(struct pwm_reference *ref, struct pwm_channel *channel, int64_t n);
/* Make edges up to and including the first one that changes an output, but at most n. Returns how many were made. */
int64_t pwm_run_to_change(struct pwm_reference *ref, struct pwm_channel *channel, enum pwm_pin pin, int64_t n);

/* Make edges up to and including the first one after which a channel has another value, direction or mode, but at most
 * n. Returns how many were made. */
int64_t pwm_run_steady(struct pwm_reference *ref, struct pwm_channel *channel, int64_t n);
/* Part of the time that a channel is on, in 1/4096; negative when the direction is up. */
int32_t pwm_duty(const struct pwm_channel *channel);

bool pwm_output(const struct pwm_channel *channel, enum pwm_pin pin);

#endif
