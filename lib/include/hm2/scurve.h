/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A move from rest to rest with limited velocity, acceleration and jerk: seven phases, evaluated in closed form.
 * Pure arithmetic, realtime safe, no allocation. Units are the caller's (units, units/s, units/s^2, units/s^3).
 */
#ifndef HM2_SCURVE_H
#define HM2_SCURVE_H

#include <hm2/err.h>

struct hm2_scurve {
    double distance;                  /* signed */
    double velocity;                  /* reached at the peak, >= 0 */
    double jerk;                      /* > 0 unless the distance is 0 */
    double acceleration;              /* reached, >= 0 */
    double jerk_s, accel_s, cruise_s; /* one jerk phase; the whole acceleration; constant velocity */
    double total_s;
};

/* Plan a move. Limits must be finite and above 0, distance finite; otherwise HM2_ERR_RANGE and a move of length 0. The
 * same for limits so far apart that their quotients or the time of the move cannot be expressed. */
HM2_API int HM2_MUST_CHECK hm2_scurve_plan(struct hm2_scurve *move, double distance, double max_velocity,
                                           double max_acceleration, double max_jerk);
/* Distance covered and velocity t_s after the start; before it the start, after total_s exactly the distance. */
HM2_API void hm2_scurve_at(const struct hm2_scurve *move, double t_s, double *position, double *velocity);

#endif
