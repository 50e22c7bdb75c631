/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <hm2/scurve.h>

#include <math.h>
#include <string.h>

/* Quotients and roots are taken apart here and below, because limits may be far from each other (a / j as infinity is
 * as good as any large number). */
static int reaches_acceleration(const double v, const double a, const double j)
{
    return v / a >= a / j;
}

/* Peak velocity of a move too short to reach max_velocity: the acceleration from rest takes v/a + a/j when a is
 * reached and 2*sqrt(v/j) when not, and a move without cruising covers v times that. */
static double short_move_velocity(const double length, const double a, const double j)
{
    const double ramp = a / j * a;
    const double v = 0.5 * (hypot(ramp, 2.0 * sqrt(a) * sqrt(length)) - ramp);
    if (reaches_acceleration(v, a, j))
        return v;
    const double t = cbrt(length) / cbrt(2.0 * j);
    return j * t * t;
}

static void set_phases(struct hm2_scurve *const move, const double v, const double a, const double j)
{
    move->velocity = v;
    if (reaches_acceleration(v, a, j)) {
        move->jerk_s = a / j;
        move->accel_s = v / a + a / j;
    } else {
        move->jerk_s = sqrt(v) / sqrt(j);
        move->accel_s = 2.0 * move->jerk_s;
    }
    move->acceleration = j * move->jerk_s;
}

static int usable(const double limit)
{
    return isfinite(limit) && limit > 0.0;
}

int hm2_scurve_plan(struct hm2_scurve *const move, const double distance, const double max_velocity,
                    const double max_acceleration, const double max_jerk)
{
    memset(move, 0, sizeof *move);
    if (!isfinite(distance) || !usable(max_velocity) || !usable(max_acceleration) || !usable(max_jerk))
        return HM2_ERR_RANGE;
    const double length = fabs(distance);
    if (!(length > 0.0))
        return HM2_OK;
    move->distance = distance;
    move->jerk = max_jerk;
    set_phases(move, max_velocity, max_acceleration, max_jerk);
    if (length < move->velocity * move->accel_s)
        set_phases(move, short_move_velocity(length, max_acceleration, max_jerk), max_acceleration, max_jerk);
    move->cruise_s = fmax(0.0, length / move->velocity - move->accel_s);
    move->total_s = 2.0 * move->accel_s + move->cruise_s;
    /* Limits at the ends of what a double holds overflow or vanish on the way here. */
    if (isfinite(move->total_s) && isfinite(move->acceleration) && usable(move->velocity))
        return HM2_OK;
    memset(move, 0, sizeof *move);
    return HM2_ERR_RANGE;
}

/* The acceleration phase alone, 0 <= t <= accel_s. */
static void accelerate(const struct hm2_scurve *const move, const double t, double *const s, double *const v)
{
    const double j = move->jerk, tj = move->jerk_s, rest = move->accel_s - t;
    if (t <= tj) {
        *s = j * t * t * t / 6.0;
        *v = 0.5 * j * t * t;
    } else if (rest >= tj) {
        const double u = t - tj;
        *s = j * tj * tj * (tj / 6.0 + 0.5 * u) + 0.5 * move->acceleration * u * u;
        *v = 0.5 * j * tj * tj + move->acceleration * u;
    } else {
        *s = 0.5 * move->velocity * move->accel_s - move->velocity * rest + j * rest * rest * rest / 6.0;
        *v = move->velocity - 0.5 * j * rest * rest;
    }
}

void hm2_scurve_at(const struct hm2_scurve *const move, const double t_s, double *const position,
                   double *const velocity)
{
    const double sign = move->distance < 0.0 ? -1.0 : 1.0;
    double s = 0.0, v = 0.0;

    if (t_s >= move->total_s) {
        *position = move->distance;
        *velocity = 0.0;
        return;
    }
    if (t_s > move->total_s - move->accel_s) {
        accelerate(move, move->total_s - t_s, &s, &v);
        s = fabs(move->distance) - s;
    } else if (t_s > move->accel_s) {
        s = move->velocity * (t_s - 0.5 * move->accel_s);
        v = move->velocity;
    } else if (t_s > 0.0) {
        accelerate(move, t_s, &s, &v);
    }
    /* Rounding must not carry the axis beyond its ends, however odd the limits. */
    *position = sign * fmin(fmax(s, 0.0), fabs(move->distance));
    *velocity = sign * fmin(fmax(v, 0.0), move->velocity);
}
