/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Encoders against the recorded firmware (tests/data/encoder): counts, index positions, velocities. */
#include <math.h>

#include "module_rig.h"
#include "module_types.h"
#include "trace_file.h"
#include "unit.h"

enum { COUNT = 0x3000, CONTROL = 0x3100, STAMP = 0x3300 };

#define JUST_ONCE 0x40u

#define assert_near(a, b, tolerance) assert_true(fabs((a) - (b)) <= (tolerance))

static struct module_rig *open_rig(const struct hm2_image *const image)
{
    struct module_rig *const rig = rig_new(image, "num_encoders=1");
    (void)rig_add(rig, &hm2_encoder_type);
    rig_start(rig);
    rig_set(rig, "encoder.00.filter", 0);
    return rig;
}

/* Counts of an ideal decoder: A leading B counts up (register map 3.5.1). */
struct decoder {
    int a, b, count;
};

static void decode(struct decoder *const decoder, const struct trace_event *const event)
{
    static const int place[2][2] = {{0, 3}, {1, 2}}; /* [a][b], in the order of counting up */
    const int before = place[decoder->a][decoder->b];
    if (trace_is(event, 'I', "A"))
        decoder->a = event->text[0] == '1';
    if (trace_is(event, 'I', "B"))
        decoder->b = event->text[0] == '1';
    const int turned = (place[decoder->a][decoder->b] - before) & 3;
    decoder->count += turned == 1 ? 1 : turned == 3 ? -1 : 0;
}

static void counts_are_the_edges_that_were_made(void **state)
{
    (void)state;
    static const char *const names[] = {"quad_fwd_rev", "quad_fwd_rev_filter", "timestamp"};
    struct trace_file trace = trace_load("encoder");
    unsigned reads = 0;
    for (size_t n = 0; n < sizeof names / sizeof names[0]; n++) {
        struct module_rig *const rig = open_rig(rig_image_7i96s());
        struct decoder decoder = {0};
        size_t at = 0;
        const struct trace_event *event;
        while ((event = trace_next(&trace, &at, names[n])) != NULL) {
            if (event->clk > 8840)
                break; /* there the test clears the count */
            decode(&decoder, event);
            if (!trace_is(event, 'R', "count"))
                continue;
            rig_put(rig, COUNT, event->value);
            rig_cycle(rig);
            assert_int_equal(rig_get(rig, "encoder.00.count"), decoder.count);
            reads++;
        }
        rig_free(rig);
    }
    assert_true(reads > 70);
    trace_free(&trace);
}

/* Replay a search: our control words must be those of the trace, and the driver must find what the firmware latched.
 * The recording leaves "just once" set after the event, where the driver takes it out. */
static unsigned replay_searches(const struct trace_file *const trace, const char *const test, const bool rising)
{
    struct module_rig *const rig = open_rig(rig_image_7i96s());
    const struct trace_event *event;
    size_t at = 0;
    unsigned found = 0;
    bool searching = false;
    uint32_t latch = 0;
    rig_set(rig, "encoder.00.index-invert", rising);
    rig_cycles(rig, 3);
    while ((event = trace_next(trace, &at, test)) != NULL) {
        if (trace_is(event, 'R', "count"))
            rig_put(rig, COUNT, event->value);
        if (trace_is(event, 'W', "control") && event->value & 0x10) {
            rig_set(rig, "encoder.00.index-enable", 1);
            rig_put(rig, CONTROL, latch | rig_written(rig, CONTROL));
            rig_cycles(rig, 2);
            assert_int_equal(rig_written(rig, CONTROL), event->value);
            searching = true;
        }
        if (!trace_is(event, 'R', "control"))
            continue;
        latch = event->value & 0xFFFF0000u;
        const uint32_t once = rig_written(rig, CONTROL) & JUST_ONCE;
        rig_put(rig, CONTROL, (event->value & ~JUST_ONCE) | once);
        rig_cycle(rig);
        const bool done = searching && rig_get(rig, "encoder.00.index-enable") == 0.0;
        assert_int_equal(done, searching && !(event->value & 0x10));
        if (!done)
            continue;
        const int latched = (int16_t)(event->value >> 16);
        assert_int_equal(rig_get(rig, "encoder.00.rawlatch"), latched);
        assert_int_equal(rig_get(rig, "encoder.00.count"), rig_get(rig, "encoder.00.rawcounts") - latched);
        searching = false;
        found++;
    }
    rig_free(rig);
    return found;
}

static void searches_find_what_the_firmware_latched(void **state)
{
    (void)state;
    struct trace_file trace = trace_load("encoder");
    assert_int_equal(replay_searches(&trace, "index_rise_once", true), 2);
    assert_int_equal(replay_searches(&trace, "index_fall_once", false), 1);
    trace_free(&trace);
}

/* The trace "timestamp" was made with a stamp every 100 clocks. Seen as clocks of 5 ns, that is what the driver sets
 * for a clock of 200 MHz: 2 MHz. */
static void velocities_are_those_of_the_edges(void **state)
{
    (void)state;
    size_t at = 0;
    struct trace_file trace = trace_load("encoder");
    struct hm2_image image = *rig_image_7i96s();
    image.rom[10] = 200000000;
    struct module_rig *const rig = open_rig(&image);
    rig_cycles(rig, 3);
    assert_int_equal(rig_written(rig, 0x3200), 98);
    const int64_t start_ns = rig->cycle.now_ns;
    const struct trace_event *event;
    uint16_t last_count = 0, last_stamp = 0;
    unsigned checked = 0;
    while ((event = trace_next(&trace, &at, "timestamp")) != NULL && event->clk < 8840) {
        if (!trace_is(event, 'R', "count") || event->value == 0)
            continue;
        /* The stamp counter at this clock: the trace reads it every second time, always at (clk - 51) / 100 + 4. */
        rig_put(rig, STAMP, (uint16_t)((event->clk + 376) / 100));
        rig_put(rig, COUNT, event->value);
        rig->cycle.now_ns = start_ns + event->clk * 5;
        rig_read(rig);
        const uint16_t now = (uint16_t)event->value, stamp = (uint16_t)(event->value >> 16);
        if (checked > 0 && stamp != last_stamp) {
            const double expected = (now - last_count) / ((stamp - last_stamp) * 0.5e-6);
            assert_near(rig_get(rig, "encoder.00.velocity"), expected, expected * 1e-9);
        }
        last_count = now;
        last_stamp = stamp;
        checked++;
    }
    assert_true(checked >= 10);
    trace_free(&trace);
    rig_free(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(counts_are_the_edges_that_were_made),
        cmocka_unit_test(searches_find_what_the_firmware_latched),
        cmocka_unit_test(velocities_are_those_of_the_edges),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
