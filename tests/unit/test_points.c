/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include <math.h>

#include <hm2/number.h>
#include <hm2/points.h>

struct demo {
    hm2_bit_t *enable;
    hm2_s32_t *count;
    hm2_u32_t *width;
    hm2_float_t *scale;
};

static const struct hm2_point demo_points[] = {
    HM2_POINT(struct demo, enable, "enable", HM2_BIT, HM2_PIN_IN, 1, "", "switches it on"),
    HM2_POINT(struct demo, count, "input-##-count", HM2_S32, HM2_PIN_OUT, -7, "counts", "what was counted"),
    HM2_POINT(struct demo, width, "pin.###.width", HM2_U32, HM2_PARAM_RW, 4294967295.0, "bits", "width"),
    HM2_POINT(struct demo, scale, "scale", HM2_FLOAT, HM2_PARAM_RO, 0.5, "", "scale"),
};
#define DEMO_POINTS (sizeof demo_points / sizeof demo_points[0])

static int start(void **state)
{
    *state = hm2_plain_binder_new();
    return *state ? 0 : -1;
}

static int stop(void **state)
{
    hm2_plain_binder_free(*state);
    return 0;
}

static struct demo *bind_demo(struct hm2_plain_binder *plain, const char *prefix, unsigned index)
{
    struct hm2_binder *const binder = hm2_plain_binder(plain);
    struct demo *const demo = binder->alloc(binder, sizeof *demo);
    struct hm2_diag diag = {0};
    assert_non_null(demo);
    assert_int_equal(hm2_bind_points(binder, demo_points, DEMO_POINTS, demo, prefix, index, &diag), 0);
    assert_string_equal(diag.text, "");
    return demo;
}

static void rows_become_objects_with_their_initial_values(void **state)
{
    struct hm2_plain_binder *const plain = *state;
    struct demo *const demo = bind_demo(plain, "hm2_7i96s.0.demo.00", 0);
    assert_int_equal(hm2_plain_count(plain), DEMO_POINTS);
    assert_true(*demo->enable);
    assert_int_equal(*demo->count, -7);
    assert_int_equal(*demo->width, UINT32_MAX);
    assert_true(*demo->scale == 0.5);
    assert_ptr_equal(hm2_plain_find(plain, "hm2_7i96s.0.demo.00.scale")->value, demo->scale);
    assert_ptr_equal(hm2_plain_find(plain, "hm2_7i96s.0.demo.00.scale")->point, &demo_points[3]);
}

static void hashes_become_the_index_with_leading_zeros(void **state)
{
    struct hm2_plain_binder *const plain = *state;
    bind_demo(plain, "b", 4);
    assert_string_equal(hm2_plain_at(plain, 1)->name, "b.input-04-count");
    assert_string_equal(hm2_plain_at(plain, 2)->name, "b.pin.004.width");
    bind_demo(plain, "c", 123);
    assert_non_null(hm2_plain_find(plain, "c.input-123-count"));
    assert_non_null(hm2_plain_find(plain, "c.pin.123.width"));
}

static void hashes_of_a_prefix_are_left_alone(void **state)
{
    bind_demo(*state, "hm2_##x.0", 1);
    assert_non_null(hm2_plain_find(*state, "hm2_##x.0.input-01-count"));
}

static void a_name_that_fits_to_the_last_character_is_taken_and_a_longer_one_refused(void **state)
{
    struct hm2_binder *const binder = hm2_plain_binder(*state);
    struct demo *const demo = binder->alloc(binder, sizeof *demo);
    struct hm2_diag diag = {0};
    char prefix[HM2_NAME_SIZE + 1];
    memset(prefix, 'p', sizeof prefix);
    prefix[HM2_NAME_SIZE - sizeof ".enable"] = '\0';
    assert_int_equal(hm2_bind_points(binder, demo_points, 1, demo, prefix, 0, &diag), 0);
    assert_int_equal(strlen(hm2_plain_at(*state, 0)->name), HM2_NAME_SIZE - 1);
    memset(prefix, 'q', sizeof prefix);
    prefix[HM2_NAME_SIZE - sizeof ".enable" + 1] = '\0';
    assert_int_equal(hm2_bind_points(binder, demo_points, 1, demo, prefix, 0, &diag), HM2_ERR_NOSPACE);
    memset(prefix, 'r', sizeof prefix);
    prefix[HM2_NAME_SIZE] = '\0';
    assert_int_equal(hm2_bind_points(binder, demo_points, 1, demo, prefix, 0, &diag), HM2_ERR_NOSPACE);
    assert_int_equal(diag.problems, 2);
    assert_non_null(strstr(diag.text, "longer than 127 characters"));
    assert_int_equal(hm2_plain_count(*state), 1);
}

static void a_second_object_of_the_same_name_is_refused_by_name(void **state)
{
    struct hm2_binder *const binder = hm2_plain_binder(*state);
    struct demo *const demo = bind_demo(*state, "b", 0);
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_bind_points(binder, demo_points, DEMO_POINTS, demo, "b", 0, &diag), HM2_ERR_HOST);
    assert_string_equal(diag.text, "b.enable exists already\n");
    assert_int_equal(hm2_plain_count(*state), DEMO_POINTS);
}

static void an_alias_leads_to_the_same_object_and_takes_its_name_away_from_others(void **state)
{
    struct hm2_plain_binder *const plain = *state;
    struct hm2_binder *const binder = hm2_plain_binder(plain);
    bind_demo(plain, "b", 0);
    assert_int_equal(binder->alias(binder, "b.scale", "x.y"), 0);
    assert_ptr_equal(hm2_plain_find(plain, "x.y"), hm2_plain_find(plain, "b.scale"));
    assert_string_equal(hm2_plain_find(plain, "b.scale")->alias, "x.y");
    assert_int_equal(hm2_plain_set(plain, "x.y", 3.0), 0);
    assert_true(hm2_plain_get(plain, "b.scale", NULL) == 3.0);
    assert_int_equal(binder->alias(binder, "b.nothing", "z"), HM2_ERR_HOST);
    assert_int_equal(binder->alias(binder, "b.enable", "x.y"), HM2_ERR_HOST);
    assert_int_equal(binder->alias(binder, "b.enable", "b.scale"), HM2_ERR_HOST);
    assert_int_equal(binder->alias(binder, "b.scale", "another"), HM2_ERR_HOST);
}

static void values_stay_where_they_are_however_many_follow(void **state)
{
    struct hm2_plain_binder *const plain = *state;
    struct demo *const first = bind_demo(plain, "first", 0);
    hm2_float_t *const scale = first->scale;
    *scale = 1.25;
    for (unsigned i = 0; i < 3000; i++) {
        char prefix[32];
        (void)snprintf(prefix, sizeof prefix, "many.%u", i);
        *bind_demo(plain, prefix, i)->count = (int32_t)i;
    }
    assert_int_equal(hm2_plain_count(plain), 3001 * DEMO_POINTS);
    assert_ptr_equal(hm2_plain_find(plain, "first.scale")->value, scale);
    assert_true(*scale == 1.25);
    assert_true(hm2_plain_get(plain, "many.2999.input-2999-count", NULL) == 2999.0);
    assert_true(hm2_plain_get(plain, "many.17.input-17-count", NULL) == 17.0);
    assert_null(hm2_plain_at(plain, hm2_plain_count(plain)));
}

static void memory_of_the_binder_is_zeroed_and_apart(void **state)
{
    struct hm2_binder *const binder = hm2_plain_binder(*state);
    static const size_t sizes[] = {1, 3, 16, 100000, 7, 16384, 16385};
    unsigned char *before = NULL;
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        unsigned char *const memory = binder->alloc(binder, sizes[i]);
        assert_non_null(memory);
        for (size_t k = 0; k < sizes[i]; k++)
            assert_int_equal(memory[k], 0);
        memset(memory, 0xA5, sizes[i]);
        assert_true(!before || *before == 0xA5);
        before = memory;
    }
    assert_null(binder->alloc(binder, SIZE_MAX));
}

static void a_pointer_in_use_is_refused(void **state)
{
    struct hm2_binder *const binder = hm2_plain_binder(*state);
    struct hm2_diag diag = {0};
    struct demo *const demo = bind_demo(*state, "a", 0);
    assert_int_equal(hm2_bind_points(binder, demo_points, DEMO_POINTS, demo, "b", 0, &diag), HM2_ERR_HOST);
    assert_non_null(strstr(diag.text, "b."));
    assert_non_null(strstr(diag.text, "its pointer is in use"));
}

static void unknown_names_are_reported_as_such(void **state)
{
    int err = 0;
    assert_true(hm2_plain_get(*state, "b.enable", &err) == 0.0);
    assert_int_equal(err, HM2_ERR_NOTFOUND);
    assert_int_equal(hm2_plain_set(*state, "b.enable", 1), HM2_ERR_NOTFOUND);
    bind_demo(*state, "b", 0);
    assert_true(hm2_plain_get(*state, "b.enable", &err) == 1.0);
    assert_int_equal(err, 0);
}

static void numbers_outside_a_type_saturate_and_nan_is_zero(void **state)
{
    (void)state;
    static const struct {
        double in;
        int32_t s;
        uint32_t u;
    } rows[] = {
        {0.0, 0, 0},
        {1.99, 1, 1},
        {-1.99, -1, 0},
        {2147483647.0, INT32_MAX, 2147483647u},
        {2147483648.0, INT32_MAX, 2147483648u},
        {-2147483648.0, INT32_MIN, 0},
        {-2147483648.9, INT32_MIN, 0},
        {4294967295.0, INT32_MAX, UINT32_MAX},
        {4294967296.0, INT32_MAX, UINT32_MAX},
        {INFINITY, INT32_MAX, UINT32_MAX},
        {-INFINITY, INT32_MIN, 0},
        {NAN, 0, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(hm2_trunc_s32(rows[i].in), rows[i].s);
        assert_int_equal(hm2_trunc_u32(rows[i].in), rows[i].u);
    }
    assert_true(hm2_finite_or(NAN, 2.0) == 2.0);
    assert_true(hm2_finite_or(INFINITY, 2.0) == 2.0);
    assert_true(hm2_finite_or(-1e300, 2.0) == -1e300);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, start, stop)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(rows_become_objects_with_their_initial_values),
        TEST(hashes_become_the_index_with_leading_zeros),
        TEST(hashes_of_a_prefix_are_left_alone),
        TEST(a_name_that_fits_to_the_last_character_is_taken_and_a_longer_one_refused),
        TEST(a_second_object_of_the_same_name_is_refused_by_name),
        TEST(an_alias_leads_to_the_same_object_and_takes_its_name_away_from_others),
        TEST(values_stay_where_they_are_however_many_follow),
        TEST(memory_of_the_binder_is_zeroed_and_apart),
        TEST(a_pointer_in_use_is_refused),
        TEST(unknown_names_are_reported_as_such),
        TEST(numbers_outside_a_type_saturate_and_nan_is_zero),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
