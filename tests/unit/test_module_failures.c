/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Whatever the host or the card refuses during set-up: an error with a sentence, and nothing worse. */
#include "unit.h"

#include "module_rig.h"
#include "module_types.h"

/* A binder, and a way to the card, that fail from the n-th call on. */
struct failing {
    struct hm2_binder binder; /* first: the callbacks get a pointer to it */
    struct hm2_binder *inner;
    int (*peek)(struct hm2_setup *setup, uint16_t address, unsigned words, uint32_t *values);
    unsigned left, calls;
};

/* The rig's set-up has no room for more than its access pointer. */
static struct failing failing;

static bool fails(void)
{
    failing.calls++;
    if (failing.left == 0)
        return true;
    failing.left--;
    return false;
}

static void *failing_alloc(struct hm2_binder *binder, size_t size)
{
    (void)binder;
    return fails() ? NULL : failing.inner->alloc(failing.inner, size);
}

static int failing_create(struct hm2_binder *binder, const char *name, const struct hm2_point *point, void *slot,
                          struct hm2_diag *diag)
{
    (void)binder;
    return fails() ? hm2_diag_add(diag, HM2_ERR_HOST, "%s is refused", name)
                   : failing.inner->create(failing.inner, name, point, slot, diag);
}

static int failing_alias(struct hm2_binder *binder, const char *existing, const char *alias)
{
    (void)binder;
    return fails() ? HM2_ERR_HOST : failing.inner->alias(failing.inner, existing, alias);
}

static int failing_peek(struct hm2_setup *setup, uint16_t address, unsigned words, uint32_t *values)
{
    return fails() ? HM2_ERR_TIMEOUT : failing.peek(setup, address, words, values);
}

/* Set everything up; every failing call is one of them. Returns the first error. */
static int set_all_up(struct module_rig *rig)
{
    int err = 0;
    for (size_t i = 0; hm2_module_types[i]; i++) {
        const uint8_t gtag = hm2_module_types[i]->gtag;
        if (gtag != HM2_GTAG_NONE && !hm2_idrom_find(&rig->idrom, gtag))
            continue;
        const unsigned before = rig->diag.problems;
        const int bad = rig_try_add(rig, hm2_module_types[i]);
        if (bad < 0 && rig->diag.problems == before)
            fail_msg("%s gives no reason for its failure (%s)", hm2_module_types[i]->name, hm2_strerror(bad));
        err = err == 0 ? bad : err;
    }
    return err;
}

/* Load with the n-th call and all later ones failing. Returns whether any call failed. */
static bool load_with_failure(const struct hm2_image *image, const unsigned n)
{
    struct module_rig *const rig = rig_new(image, "enable_raw");
    failing = (struct failing){
        .binder = {.alloc = failing_alloc, .create = failing_create, .alias = failing_alias},
        .inner = rig->setup.binder,
        .peek = rig->setup.peek,
        .left = n,
    };
    rig->setup.binder = &failing.binder;
    rig->setup.peek = failing_peek;
    const int err = set_all_up(rig);
    const bool failed = failing.calls > n;
    /* Only a second name may be missing without an error. */
    if (failed && err == 0)
        assert_true(rig->diag.warnings > 0);
    if (!failed)
        assert_int_equal(err, 0);
    rig_free(rig);
    return failed;
}

static void fail_everywhere(const struct hm2_image *(*image)(void))
{
    unsigned n = 0;
    while (load_with_failure(image(), n))
        n++;
    assert_true(n > 100); /* there was something to fail */
}

static void any_refusal_on_a_7i96s_is_an_error_with_a_reason(void **state)
{
    (void)state;
    fail_everywhere(rig_image_7i96s);
}

static void any_refusal_on_a_7i93_is_an_error_with_a_reason(void **state)
{
    (void)state;
    fail_everywhere(rig_image_7i93);
}

/* A descriptor's count has eight bits; a page of registers has 64 words, and the next page is another register. */
static void more_instances_than_a_page_of_registers_has_are_refused(void **state)
{
    (void)state;
    static const struct hm2_module_type *const types[] = {&hm2_oneshot_type, &hm2_periodm_type, &hm2_rcpwmgen_type,
                                                          &hm2_tppwm_type, &hm2_xy2mod_type};
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++) {
        const struct rig_md modules[] = {
            {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0, 0x1F},
            {types[i]->gtag, 0, 1, 65, 0x9000, 11, 0, 0x1FF},
        };
        struct module_rig *const rig = rig_new(rig_image_with(modules, 2, NULL, 0), "");
        assert_int_equal(rig_try_add(rig, types[i]), HM2_ERR_MISMATCH);
        assert_non_null(strstr(rig->diag.text, "at most 64"));
        rig_free(rig);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_refusal_on_a_7i96s_is_an_error_with_a_reason),
        cmocka_unit_test(any_refusal_on_a_7i93_is_an_error_with_a_reason),
        cmocka_unit_test(more_instances_than_a_page_of_registers_has_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
