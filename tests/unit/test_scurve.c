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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_limit_holds_and_the_move_ends_at_its_distance),
        cmocka_unit_test(a_move_starts_at_rest_and_at_zero),
        cmocka_unit_test(impossible_limits_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
