/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Step generators against the recorded firmware (tests/data/stepgen): counts are steps, rates are velocities. */
#include <math.h>

#include "module_rig.h"
#include "module_types.h"
#include "trace_file.h"
#include "unit.h"

#define CLOCK_HZ    100000000.0
#define RATE        0x2000
#define ACCUMULATOR 0x2100

#define assert_near(a, b, tolerance) assert_true(fabs((a) - (b)) <= (tolerance))

static struct module_rig *open_rig(void)
{
    struct module_rig *const rig = rig_new(rig_image_7i96s(), "num_stepgens=1");
    (void)rig_add(rig, &hm2_stepgen_type);
    rig_start(rig);
    return rig;
}

/* Does this test record steps that the accumulator explains alone? */
static bool counts_steps(const struct trace_file *const trace, const char *const test)
{
    size_t at = 0;
    const struct trace_event *event;
    while ((event = trace_next(trace, &at, test)) != NULL)
        if (trace_is(event, 'W', "accum") || (trace_is(event, 'W', "mode") && event->value != 0) ||
            (trace_is(event, 'W', "steplen") && (event->value & 0x3FFF) == 0))
            return false;
    return true;
}

static unsigned replay_steps(struct module_rig *const rig, const struct trace_file *const trace, const char *const test)
{
    size_t at = 0;
    unsigned reads = 0;
    int64_t steps = 0;
    bool reverse = false;
    const struct trace_event *event;
    rig_put(rig, ACCUMULATOR, 0);
    rig_set(rig, "stepgen.00.position-reset", 1);
    rig_cycle(rig);
    rig_set(rig, "stepgen.00.position-reset", 0);
    while ((event = trace_next(trace, &at, test)) != NULL) {
        if (trace_is(event, 'E', "dir") && event->text[0] != 'Z')
            reverse = event->text[0] == '1';
        if (trace_is(event, 'E', "step") && event->text[0] == '1')
            steps += reverse ? -1 : 1;
        if (!trace_is(event, 'R', "accum"))
            continue;
        rig_put(rig, ACCUMULATOR, event->value);
        rig_cycle(rig);
        /* The step output rises one clock after the accumulator has crossed an integer. */
        if (!(at < trace->count && trace->events[at].clk <= event->clk))
            assert_int_equal(rig_get(rig, "stepgen.00.counts"), steps);
        reads++;
    }
    return reads;
}

static void counts_are_the_steps_that_the_firmware_made(void **state)
{
    (void)state;
    size_t at = 0;
    struct trace_file trace = trace_load("stepgen");
    struct module_rig *const rig = open_rig();
    char last[32] = "";
    unsigned reads = 0, tests = 0;
    const struct trace_event *event;
    while ((event = trace_next(&trace, &at, NULL)) != NULL) {
        if (strcmp(event->test, last) == 0)
            continue;
        memcpy(last, event->test, sizeof last);
        if (!counts_steps(&trace, last))
            continue;
        tests++;
        reads += replay_steps(rig, &trace, last);
    }
    assert_true(tests >= 19);
    assert_true(reads >= 300);
    trace_free(&trace);
    rig_free(rig);
}

static void commanded_velocities_become_the_rates_of_the_trace(void **state)
{
    (void)state;
    size_t at = 0;
    struct trace_file trace = trace_load("stepgen");
    struct module_rig *const rig = open_rig();
    unsigned rates = 0;
    const struct trace_event *event;
    rig_set(rig, "stepgen.00.steplen", 0);
    rig_set(rig, "stepgen.00.stepspace", 0);
    rig_set(rig, "stepgen.00.maxaccel", 0);
    rig_set(rig, "stepgen.00.control-type", 1);
    rig_set(rig, "stepgen.00.enable", 1);
    while ((event = trace_next(&trace, &at, NULL)) != NULL) {
        if (!trace_is(event, 'W', "rate"))
            continue;
        const double steps_per_s = (int32_t)event->value * CLOCK_HZ / 4294967296.0;
        rig_set(rig, "stepgen.00.velocity-cmd", steps_per_s);
        rig_cycle(rig);
        assert_in_range(rig_written(rig, RATE) - event->value + 1, 0, 2);
        rates++;
    }
    assert_true(rates >= 100);
    trace_free(&trace);
    rig_free(rig);
}

static void the_firmware_moves_at_the_velocity_that_its_rate_stands_for(void **state)
{
    (void)state;
    size_t at = 0;
    struct trace_file trace = trace_load("stepgen");
    struct module_rig *const rig = open_rig();
    const struct trace_event *event, *before = NULL;
    double steps_per_s = 0.0, position = 0.0;
    unsigned intervals = 0;
    while ((event = trace_next(&trace, &at, "fwd_rev")) != NULL) {
        if (trace_is(event, 'W', "rate")) {
            steps_per_s = (int32_t)event->value * CLOCK_HZ / 4294967296.0;
            before = NULL;
        }
        if (!trace_is(event, 'R', "accum"))
            continue;
        rig_put(rig, ACCUMULATOR, event->value);
        rig_cycle(rig);
        if (before) {
            const double moved = rig_get(rig, "stepgen.00.position-fb") - position;
            assert_near(moved, steps_per_s * (double)(event->clk - before->clk) / CLOCK_HZ, 2e-3);
            intervals++;
        }
        before = event;
        position = rig_get(rig, "stepgen.00.position-fb");
    }
    assert_true(intervals >= 20);
    trace_free(&trace);
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(counts_are_the_steps_that_the_firmware_made),
        cmocka_unit_test(commanded_velocities_become_the_rates_of_the_trace),
        cmocka_unit_test(the_firmware_moves_at_the_velocity_that_its_rate_stands_for),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
