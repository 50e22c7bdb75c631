/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "motor.h"

#include <math.h>

#define POSITION_ONE        4294967296.0
#define MAX_TIME_CONSTANT_S 1000.0

bool sim_motor_possible(const double time_constant_s)
{
    return time_constant_s >= 0 && time_constant_s <= MAX_TIME_CONSTANT_S;
}

void sim_motor_turn(struct sim_motor *const motor, const double wanted, const int64_t clk, const uint32_t clock_hz)
{
    if (clk <= motor->at)
        return;
    const double seconds = (double)(clk - motor->at) / clock_hz;
    const double tau = motor->time_constant_s;
    const double rest = tau > 0 ? exp(-seconds / tau) : 0;
    motor->turned += wanted * seconds + (motor->velocity - wanted) * tau * (1 - rest);
    motor->velocity = wanted + (motor->velocity - wanted) * rest;
    motor->at = clk;
}

int64_t sim_motor_position(const struct sim_motor *const motor)
{
    return (int64_t)floor(motor->turned * POSITION_ONE);
}
