/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A drive and its motor at an analog output: its speed follows the output with a first-order lag. In closed form from
 * one change to the next. An encoder on its shaft follows sim_motor_position() (struct sim_follow), which keeps its
 * value when the card loses its power.
 */
#ifndef SIM_MOTOR_H
#define SIM_MOTOR_H

#include <stdbool.h>
#include <stdint.h>

struct sim_motor {
    double time_constant_s;
    double velocity, turned; /* of full speed, and seconds at it */
    int64_t at;              /* clk of both */
};

/* What a time constant may be. */
bool sim_motor_possible(double time_constant_s);
/* Up to clk the output was at `wanted`, -1..1 of full speed. */
void sim_motor_turn(struct sim_motor *motor, double wanted, int64_t clk, uint32_t clock_hz);
/* Seconds at full speed * 2^32. */
int64_t sim_motor_position(const struct sim_motor *motor);

#endif
