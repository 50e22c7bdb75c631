/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include <math.h>

#include <hm2/scurve.h>

static const struct {
    const char *name;
    double distance, velocity, acceleration, jerk;
} rows[] = {
    {"cruises", 100.0, 20.0, 100.0, 2000.0},
    {"backwards", -100.0, 20.0, 100.0, 2000.0},
    {"reaches the acceleration but not the velocity", 3.0, 20.0, 100.0, 2000.0},
    {"reaches neither", 0.001, 20.0, 100.0, 2000.0},
    {"velocity reached without the acceleration", 100.0, 1.0, 1000.0, 500.0},
};

static void every_limit_holds_and_the_move_ends_at_its_distance(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct hm2_scurve move;
        assert_int_equal(hm2_scurve_plan(&move, rows[i].distance, rows[i].velocity, rows[i].acceleration, rows[i].jerk),
                         HM2_OK);
        const double dt = move.total_s / 20000.0, tolerance = 1e-6 * fabs(rows[i].distance);
        double s0 = 0.0, v0 = 0.0, a0 = 0.0;
        for (int n = 1; n <= 20000; n++) {
            double s, v;
            hm2_scurve_at(&move, n * dt, &s, &v);
            const double a = (v - v0) / dt;
            assert_true(fabs(v) <= rows[i].velocity * (1 + 1e-9));
            assert_true(fabs(a) <= rows[i].acceleration * (1 + 1e-6) + 1e-6);
            if (n > 1)
                assert_true(fabs(a - a0) / dt <= rows[i].jerk * 1.01);
            assert_true(fabs(s - s0 - 0.5 * (v + v0) * dt) <= tolerance);
            s0 = s, v0 = v, a0 = a;
        }
        hm2_scurve_at(&move, move.total_s + 1.0, &s0, &v0);
        assert_true(s0 - rows[i].distance == 0.0 && v0 == 0.0);
    }
}

static void a_move_starts_at_rest_and_at_zero(void **state)
{
    (void)state;
    struct hm2_scurve move;
    double s = 1.0, v = 1.0;
    assert_int_equal(hm2_scurve_plan(&move, 5.0, 1.0, 1.0, 1.0), HM2_OK);
    hm2_scurve_at(&move, -1.0, &s, &v);
    assert_true(s == 0.0 && v == 0.0);
}

static void impossible_limits_are_refused(void **state)
{
    (void)state;
    const double bad[] = {0.0, -1.0, NAN, INFINITY};
    struct hm2_scurve move;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_int_equal(hm2_scurve_plan(&move, 1.0, bad[i], 1.0, 1.0), HM2_ERR_RANGE);
        assert_int_equal(hm2_scurve_plan(&move, 1.0, 1.0, bad[i], 1.0), HM2_ERR_RANGE);
        assert_int_equal(hm2_scurve_plan(&move, 1.0, 1.0, 1.0, bad[i]), HM2_ERR_RANGE);
    }
    assert_int_equal(hm2_scurve_plan(&move, NAN, 1.0, 1.0, 1.0), HM2_ERR_RANGE);
    assert_true(move.total_s == 0.0);
}

/* Whatever the limits are, a move that is planned stays between its ends, at numbers. */
static void extreme_limits_are_refused_or_harmless(void **state)
{
    (void)state;
    static const double values[] = {5e-324, 1e-300, 1e-100, 1e-12, 1.0, 1e12, 1e100, 1e300, 1.7e308};
    enum { VALUES = sizeof values / sizeof values[0] };
    unsigned planned = 0;
    for (unsigned i = 0; i < VALUES * VALUES * VALUES * VALUES; i++) {
        const double length = values[i % VALUES], max_v = values[i / VALUES % VALUES],
                     max_a = values[i / VALUES / VALUES % VALUES], max_j = values[i / VALUES / VALUES / VALUES];
        struct hm2_scurve move;
        if (hm2_scurve_plan(&move, length, max_v, max_a, max_j) != HM2_OK) {
            assert_true(move.total_s == 0.0 && move.distance == 0.0);
            continue;
        }
        planned++;
        for (unsigned part = 0; part <= 16; part++) {
            double s, v;
            hm2_scurve_at(&move, move.total_s * part / 16.0, &s, &v);
            if (!(s >= -1e-9 * length && s <= length * (1 + 1e-9) && v >= 0.0 && v <= max_v * (1 + 1e-9)))
                fail_msg("distance %g, limits %g %g %g: %g, %g at %u/16 of %g s", length, max_v, max_a, max_j, s, v,
                         part, move.total_s);
        }
    }
    assert_true(planned > VALUES * VALUES);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_limit_holds_and_the_move_ends_at_its_distance),
        cmocka_unit_test(a_move_starts_at_rest_and_at_zero),
        cmocka_unit_test(impossible_limits_are_refused),
        cmocka_unit_test(extreme_limits_are_refused_or_harmless),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
