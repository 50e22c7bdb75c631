/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The HAL calls as components use them. What is expected is what LinuxCNC 2.9 documents (man 3hal, hal-interface 5)
 * and what its hal_lib was seen to do. Threads really run here; tests count cycles.
 */
#include "unit.h"

#include "hal_rig.h"

#include <errno.h>
#include <limits.h>
#include <stdatomic.h>
#include <time.h>

#include <rtapi_mutex.h>
#include <rtapi_string.h>

#include "state.h"

static int comp(const char *const name)
{
    const int id = hal_init(name);
    assert_true(id > 0);
    return id;
}

static void text_of(const char c, const size_t length, char *const text)
{
    memset(text, c, length);
    text[length] = '\0';
}

/* ---- components and memory -------------------------------------------------------------------------------------- */

static void components_have_distinct_ids_and_names(void **state)
{
    (void)state;
    const int a = comp("a"), b = comp("b");
    assert_int_not_equal(a, b);
    assert_string_equal(hal_comp_name(a), "a");
    assert_null(hal_comp_name(b + 1));
    assert_int_equal(hal_init("a"), -EINVAL);
    assert_non_null(strstr(hal_rig_messages(), "already a component 'a'"));
    assert_int_equal(hal_exit(a), 0);
    assert_int_equal(hal_exit(a), -EINVAL);
    assert_true(hal_init("a") > 0);
}

static void names_have_at_most_47_characters(void **state)
{
    (void)state;
    char longest[64], too_long[64];
    text_of('n', 47, longest);
    text_of('n', 48, too_long);
    const int id = comp(longest);
    hal_s32_t **const pin = hal_malloc(sizeof *pin);
    assert_int_equal(hal_init(too_long), -EINVAL);
    assert_int_equal(hal_init(""), -EINVAL);
    assert_int_equal(hal_init("a b"), -EINVAL);
    assert_int_equal(hal_pin_s32_new(longest, HAL_OUT, pin, id), 0);
    assert_int_equal(hal_pin_s32_new(too_long, HAL_OUT, pin, id), -EINVAL);
    assert_int_equal(hal_pin_s32_newf(HAL_OUT, pin, id, "%s", too_long), -EINVAL);
    assert_int_equal(hal_signal_new(longest, HAL_S32), 0);
    assert_int_equal(hal_signal_new(too_long, HAL_S32), -EINVAL);
    assert_int_equal(hal_pin_alias(longest, too_long), -EINVAL);
}

static void nothing_is_created_after_ready(void **state)
{
    (void)state;
    const int id = comp("a");
    hal_bit_t **const pin = hal_malloc(sizeof *pin);
    hal_s32_t *const value = hal_malloc(sizeof *value);
    assert_int_equal(hal_ready(id), 0);
    assert_int_equal(hal_ready(id), -EINVAL);
    assert_int_equal(hal_pin_bit_new("a.pin", HAL_IN, pin, id), -EINVAL);
    assert_int_equal(hal_param_s32_new("a.param", HAL_RW, value, id), -EINVAL);
    assert_int_equal(hal_set_unready(id), 0);
    assert_int_equal(hal_pin_bit_new("a.pin", HAL_IN, pin, id), 0);
    assert_int_equal(hal_param_s32_new("a.param", HAL_RW, value, id), 0);
    assert_int_equal(hal_pin_bit_new("a.other", HAL_IN, pin, id + 1), -EINVAL);
}

static void memory_is_zeroed_aligned_and_limited(void **state)
{
    (void)state;
    for (long size = 1; size <= 100; size++) {
        const unsigned char *const memory = hal_malloc(size);
        assert_non_null(memory);
        assert_int_equal((uintptr_t)memory % 8, 0);
        for (long i = 0; i < size; i++)
            assert_int_equal(memory[i], 0);
    }
    assert_null(hal_malloc(0));
    assert_null(hal_malloc(-1));
    assert_null(hal_malloc(LONG_MAX));
    assert_null(hal_malloc(1 << 20));
    assert_non_null(strstr(hal_rig_messages(), "HAL memory left"));
}

static void pointers_and_parameters_must_lie_in_hal_memory(void **state)
{
    (void)state;
    const int id = comp("a");
    hal_bit_t *outside = NULL;
    static hal_s32_t value;
    assert_int_equal(hal_pin_bit_new("a.pin", HAL_IN, &outside, id), -EINVAL);
    assert_int_equal(hal_pin_bit_new("a.pin", HAL_IN, NULL, id), -EINVAL);
    assert_int_equal(hal_param_s32_new("a.param", HAL_RW, &value, id), -EINVAL);
    char *const memory = hal_malloc(32);
    assert_int_equal(hal_pin_bit_new("a.pin", HAL_IN, (hal_bit_t **)(void *)(memory + 1), id), -EINVAL);
    assert_int_equal(hal_param_float_new("a.param", HAL_RW, (hal_float_t *)(void *)(memory + 4), id), -EINVAL);
}

static void types_and_directions_are_checked(void **state)
{
    (void)state;
    const int id = comp("a");
    void **const slot = hal_malloc(sizeof *slot);
    void *const value = hal_malloc(8);
    static const struct {
        int type, dir, status;
    } rows[] = {
        {HAL_BIT, HAL_IN, 0},        {HAL_FLOAT, HAL_OUT, 0}, {HAL_S32, HAL_IO, 0},       {HAL_U32, HAL_IN, 0},
        {HAL_PORT, HAL_IN, -EINVAL}, {0, HAL_IN, -EINVAL},    {-1, HAL_IN, -EINVAL},      {99, HAL_IN, -EINVAL},
        {HAL_BIT, 0, -EINVAL},       {HAL_BIT, -1, -EINVAL},  {HAL_BIT, HAL_RW, -EINVAL}, {HAL_BIT, HAL_RO, -EINVAL},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char name[32];
        snprintf(name, sizeof name, "a.pin-%zu", i);
        assert_int_equal(hal_pin_new(name, (hal_type_t)rows[i].type, (hal_pin_dir_t)rows[i].dir, slot, id),
                         rows[i].status);
    }
    assert_int_equal(hal_param_new("a.p1", HAL_U32, HAL_RO, value, id), 0);
    assert_int_equal(hal_param_new("a.p2", HAL_U32, HAL_RW, value, id), 0);
    assert_int_equal(hal_param_new("a.p3", HAL_U32, (hal_param_dir_t)HAL_IN, value, id), -EINVAL);
    assert_int_equal(hal_param_new("a.p4", (hal_type_t)7, HAL_RW, value, id), -EINVAL);
}

static void names_and_aliases_share_one_name_space_for_each_kind(void **state)
{
    (void)state;
    const int id = comp("a");
    hal_u32_t **const pin = hal_malloc(2 * sizeof *pin);
    hal_u32_t *const value = hal_malloc(sizeof *value);
    assert_int_equal(hal_pin_u32_new("x", HAL_IN, &pin[0], id), 0);
    assert_int_equal(hal_pin_u32_new("x", HAL_IN, &pin[1], id), -EINVAL);
    assert_int_equal(hal_param_u32_new("x", HAL_RW, value, id), 0); /* pins and parameters are apart */
    assert_int_equal(hal_pin_alias("x", "y"), 0);
    assert_int_equal(hal_pin_u32_new("y", HAL_IN, &pin[1], id), -EINVAL);
    assert_int_equal(hal_pin_u32_new("x", HAL_IN, &pin[1], id), -EINVAL);
    assert_int_equal(hal_pin_alias("x", "x"), -EINVAL);
    assert_int_equal(hal_pin_alias("y", "z"), 0); /* an alias finds the pin, and is replaced */
    assert_int_equal(hal_pin_alias("y", "w"), -ENOENT);
    assert_int_equal(hal_pin_u32_new("y", HAL_IN, &pin[1], id), 0);
    assert_int_equal(hal_pin_alias("z", NULL), 0);
    assert_int_equal(hal_pin_alias("z", NULL), -ENOENT);
    assert_int_equal(hal_param_alias("x", "alias"), 0);
    assert_int_equal(hal_param_u32_set("alias", 7), 0);
    assert_int_equal(*value, 7);
}

static void parameters_are_set_by_type_and_direction(void **state)
{
    (void)state;
    const int id = comp("a");
    struct {
        hal_bit_t b;
        hal_float_t f;
        hal_s32_t s;
        hal_u32_t u, ro;
    } *const values = hal_malloc(sizeof *values);
    assert_int_equal(hal_param_bit_new("b", HAL_RW, &values->b, id), 0);
    assert_int_equal(hal_param_float_new("f", HAL_RW, &values->f, id), 0);
    assert_int_equal(hal_param_s32_new("s", HAL_RW, &values->s, id), 0);
    assert_int_equal(hal_param_u32_new("u", HAL_RW, &values->u, id), 0);
    assert_int_equal(hal_param_u32_new("ro", HAL_RO, &values->ro, id), 0);
    assert_int_equal(hal_param_bit_set("b", 5), 0);
    assert_int_equal(hal_param_float_set("f", -1.5), 0);
    assert_int_equal(hal_param_s32_set("s", -7), 0);
    assert_int_equal(hal_param_u32_set("u", 0xFFFFFFFFul), 0);
    assert_true(values->b == 1 && values->f == -1.5 && values->s == -7 && values->u == 0xFFFFFFFFu);
    assert_int_equal(hal_param_u32_set("ro", 1), -EPERM);
    assert_int_equal(hal_param_u32_set("s", 1), -EINVAL);
    assert_int_equal(hal_param_u32_set("nothing", 1), -EINVAL);
    hal_float_t half = 0.5;
    assert_int_equal(hal_param_set("f", HAL_FLOAT, (void *)(uintptr_t)&half), 0);
    assert_true(values->f == 0.5);
}

/* ---- links ------------------------------------------------------------------------------------------------------ */

/* Pins of every direction on one signal: the n-th link of each row shall have this status. */
static void a_signal_takes_one_writer_and_keeps_types_apart(void **state)
{
    (void)state;
    static const struct {
        const char *first;
        int status;
        const char *second;
        int second_status;
    } rows[] = {
        {"out1", 0, "out2", -EINVAL}, {"out1", 0, "io1", -EINVAL}, {"io1", 0, "out1", -EINVAL}, {"io1", 0, "io2", 0},
        {"in1", 0, "out1", 0},        {"in1", 0, "io1", 0},        {"out1", 0, "in1", 0},       {"in1", 0, "in2", 0},
        {"out1", 0, "out1", 0},       {"bit", -EINVAL, "out1", 0}, {"none", -ENOENT, "in1", 0},
    };
    const int id = comp("a");
    static const struct {
        const char *name;
        hal_type_t type;
        hal_pin_dir_t dir;
    } pins[] = {{"out1", HAL_FLOAT, HAL_OUT}, {"out2", HAL_FLOAT, HAL_OUT}, {"io1", HAL_FLOAT, HAL_IO},
                {"io2", HAL_FLOAT, HAL_IO},   {"in1", HAL_FLOAT, HAL_IN},   {"in2", HAL_FLOAT, HAL_IN},
                {"bit", HAL_BIT, HAL_IN}};
    void **const slots = hal_malloc(sizeof *slots * 7);
    for (size_t i = 0; i < 7; i++)
        assert_int_equal(hal_pin_new(pins[i].name, pins[i].type, pins[i].dir, &slots[i], id), 0);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(hal_signal_new("s", HAL_FLOAT), 0);
        assert_int_equal(hal_link(rows[i].first, "s"), rows[i].status);
        assert_int_equal(hal_link(rows[i].second, "s"), rows[i].second_status);
        assert_int_equal(hal_signal_delete("s"), 0);
    }
    assert_int_equal(hal_link("in1", "nothing"), -ENOENT);
    assert_int_equal(hal_signal_delete("nothing"), -ENOENT);
    assert_int_equal(hal_unlink("nothing"), -ENOENT);
    assert_int_equal(hal_unlink("in1"), 0); /* not linked: nothing to do */
}

static void a_pin_has_one_signal(void **state)
{
    (void)state;
    assert_string_equal(hal_rig_run("loadrt probe\nnewsig s float\nnewsig t float\nlinkps probe.0.in s\n"), "");
    assert_int_equal(hal_link("probe.0.in", "s"), 0);
    assert_int_equal(hal_link("probe.0.in", "t"), -EINVAL);
    assert_non_null(strstr(hal_rig_messages(), "linked to signal 's'"));
    assert_int_equal(hal_unlink("probe.0.in"), 0);
    assert_int_equal(hal_link("probe.0.in", "t"), 0);
}

static void linking_rewrites_pointers_and_carries_values_over(void **state)
{
    (void)state;
    assert_string_equal(hal_rig_run("loadrt probe sets=2\nsetp probe.0.in 9\nsetp probe.1.in 4\nnewsig s float\n"
                                    "sets s 5\nlinkps probe.0.in s\n"),
                        "");
    /* The first pin gives the signal its value, those after it take the signal's. */
    assert_true(*probes[0].in == 9.0);
    hal_float_t *const before = probes[1].in;
    assert_int_equal(hal_link("probe.1.in", "s"), 0);
    assert_true(*probes[1].in == 9.0);
    assert_ptr_equal(probes[0].in, probes[1].in);
    *probes[0].in = 7.0;
    assert_true(*probes[1].in == 7.0);
    /* A pin that is unlinked keeps the value, and is alone again. */
    assert_int_equal(hal_unlink("probe.1.in"), 0);
    assert_ptr_equal(probes[1].in, before);
    assert_true(*probes[1].in == 7.0);
    *probes[0].in = 1.0;
    assert_true(*probes[1].in == 7.0);
    assert_int_equal(hal_signal_delete("s"), 0);
    assert_true(*probes[0].in == 1.0);
    assert_ptr_not_equal(probes[0].in, probes[1].in);
}

static void values_are_found_by_name(void **state)
{
    (void)state;
    assert_string_equal(hal_rig_run("loadrt probe\nnet s probe.0.out\n"), "");
    hal_type_t type;
    hal_data_u *data;
    bool flag;
    *probes[0].out = 3.5;
    assert_int_equal(hal_get_pin_value_by_name("probe.0.out", &type, &data, &flag), 0);
    assert_true(type == HAL_FLOAT && data->f == 3.5 && flag);
    assert_int_equal(hal_get_signal_value_by_name("s", &type, &data, &flag), 0);
    assert_true(type == HAL_FLOAT && data->f == 3.5 && flag);
    assert_int_equal(hal_get_param_value_by_name("probe.0.gain", &type, &data), 0);
    assert_true(type == HAL_FLOAT && data->f == 2.5);
    assert_int_equal(hal_get_pin_value_by_name("x", &type, &data, NULL), -1);
    assert_int_equal(hal_get_signal_value_by_name("x", &type, &data, NULL), -1);
    assert_int_equal(hal_get_param_value_by_name("x", &type, &data), -1);
}

/* ---- functions and threads -------------------------------------------------------------------------------------- */

static void do_nothing(void *const arg, const long period_ns)
{
    (void)arg;
    (void)period_ns;
}

static void functions_come_with_objects_for_their_run_time(void **state)
{
    (void)state;
    const int id = comp("a");
    assert_int_equal(hal_export_funct("a.f", do_nothing, NULL, 0, 0, id), 0);
    assert_int_equal(hal_export_funct("a.f", do_nothing, NULL, 0, 0, id), -EINVAL);
    assert_int_equal(hal_export_funct("a.g", NULL, NULL, 0, 0, id), -EINVAL);
    assert_string_equal(hal_rig_run("list pin\nlist param\nptype a.f.time\nptype a.f.tmax\nptype a.f.tmax-increased\n"),
                        "");
    assert_string_equal(hal_rig_output(), "a.f.time \na.f.tmax a.f.tmax-increased \ns32\ns32\nbit\n");
    assert_int_equal(hal_ready(id), 0);
    assert_int_equal(hal_export_funct("a.h", do_nothing, NULL, 0, 0, id), -EINVAL);
    assert_non_null(strstr(hal_rig_run("setp a.f.tmax-increased 1\n"), "not writable"));
    assert_non_null(strstr(hal_rig_run("setp a.f.time 1\n"), "not writable"));
}

static void functions_are_added_at_their_position(void **state)
{
    (void)state;
    static const struct {
        const char *command, *error, *order;
    } rows[] = {
        {"addf f0 t", "", "f0"},
        {"addf f1 t 1", "", "f1 f0"},
        {"addf f2 t -1", "", "f1 f0 f2"},
        {"addf f3 t 2", "", "f1 f3 f0 f2"},
        {"addf f4 t -2", "", "f1 f3 f0 f4 f2"},
        {"addf f5 t 0", "position 0", "f1 f3 f0 f4 f2"},
        {"addf f5 t 7", "position 7", "f1 f3 f0 f4 f2"},
        {"addf f5 t -7", "position -7", "f1 f3 f0 f4 f2"},
        {"addf f5 t x", "not a position", "f1 f3 f0 f4 f2"},
        {"addf f5 t 6", "", "f1 f3 f0 f4 f2 f5"},
        {"addf f6 t -7", "", "f6 f1 f3 f0 f4 f2 f5"},
        {"addf f0 t", "may be in one only", "f6 f1 f3 f0 f4 f2 f5"},
        {"addf twice t\naddf twice t", "", "f6 f1 f3 f0 f4 f2 f5 twice twice"},
        {"delf twice t", "", "f6 f1 f3 f0 f4 f2 f5"},
        {"delf twice t", "is not in thread", "f6 f1 f3 f0 f4 f2 f5"},
        {"delf f0 t", "", "f6 f1 f3 f4 f2 f5"},
        {"addf f0 t", "", "f6 f1 f3 f4 f2 f5 f0"},
        {"addf none t", "no function 'none'", "f6 f1 f3 f4 f2 f5 f0"},
        {"addf f0 none", "no thread 'none'", "f6 f1 f3 f4 f2 f5 f0"},
        {"addf fp plain", "made without", "f6 f1 f3 f4 f2 f5 f0"},
    };
    const int id = comp("a");
    for (int i = 0; i < 7; i++) {
        char name[16];
        snprintf(name, sizeof name, "f%d", i);
        assert_int_equal(hal_export_funct(name, do_nothing, NULL, 0, 0, id), 0);
    }
    assert_int_equal(hal_export_funct("twice", do_nothing, NULL, 0, 1, id), 0);
    assert_int_equal(hal_export_funct("fp", do_nothing, NULL, 1, 0, id), 0);
    assert_string_equal(hal_rig_run("loadrt threads name1=t name2=plain period2=2000000 fp2=0\n"), "");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const char *const error = hal_rig_run(rows[i].command);
        if (rows[i].error[0] ? !strstr(error, rows[i].error) : error[0])
            fail_msg("%s: got '%s', expected '%s'", rows[i].command, error, rows[i].error);
        const struct hh_thread *const thread = hh_thread_find(hh_host(), "t");
        const struct hh_schedule *const schedule = atomic_load(&thread->schedule);
        char order[128] = "";
        for (size_t f = 0; f < schedule->count; f++) {
            const size_t used = strlen(order);
            snprintf(order + used, sizeof order - used, "%s%s", f ? " " : "", schedule->functs[f]->names.name);
        }
        assert_string_equal(order, rows[i].order);
    }
}

static void thread_periods_are_multiples_of_the_first(void **state)
{
    (void)state;
    static const struct {
        const char *arguments, *threads, *error;
    } rows[] = {
        {"", "thread1 1000000", ""},
        {"name1=a", "a 1000000", ""},
        {"name1=a period1=1000000 name2=b period2=2600000", "a 1000000 b 3000000", ""},
        {"name1=a period1=1000000 name2=b period2=2400000", "a 1000000 b 2000000", ""},
        {"name1=a period1=1000000 name2=b period2=1000000 fp1=0 name3=c period3=1400000",
         "a 1000000 b 1000000 c 1000000", ""},
        {"name1=a period1=1000000 name2=b period2=500000", "", "fastest thread must come first"},
        {"name1=a period1=1000000 name2=b", "", "needs a period2"},
        {"name1=a period1=-1", "", "needs a period1"},
        {"name1=a period1=10", "", "not within"},
        {"name1=a period1=3000000000", "", "not within"},
        {"name1=a period1=1000000 name2=a period2=1000000", "", "already a thread 'a'"},
        {"name4=x", "", "no parameter 'name4' (it has name1, period1, fp1, name2"},
        {"name1=abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvw", "", "longer than 47"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char command[256], found[256] = "";
        snprintf(command, sizeof command, "loadrt threads %s\n", rows[i].arguments);
        const char *const error = hal_rig_run(command);
        const struct hh *const host = hh_host();
        const char *const told = strstr(rows[i].error, "no parameter") ? error : hal_rig_messages();
        if (rows[i].error[0] ? !error[0] || !strstr(told, rows[i].error) : error[0] != '\0')
            fail_msg("%s: got '%s' and '%s'", command, error, told);
        for (size_t t = 0; t < host->threads.count; t++) {
            const struct hh_thread *const thread = host->threads.items[t];
            snprintf(found + strlen(found), sizeof found - strlen(found), "%s%s %ld", t ? " " : "", thread->names.name,
                     thread->period_ns);
        }
        assert_string_equal(found, rows[i].threads);
        assert_string_equal(hal_rig_run("unloadrt all\n"), "");
        assert_int_equal(host->threads.count, 0);
        assert_int_equal(host->comps.count, 0);
        assert_int_equal(host->pins.shown.count + host->params.shown.count, 0);
    }
}

/* Let threads run until the first probe has counted so far; the limit is for a machine that is stuck. */
static void wait_for_cycles(const int32_t cycles)
{
    const time_t limit = time(NULL) + 60;
    const struct timespec step = {.tv_nsec = 1000000};
    for (;;) {
        hal_type_t type;
        hal_data_u *data;
        assert_int_equal(hal_get_pin_value_by_name("probe.0.count", &type, &data, NULL), 0);
        if (hh_load(HAL_S32, data).s >= cycles)
            return;
        assert_true(time(NULL) < limit);
        nanosleep(&step, NULL);
    }
}

static _Atomic long period_seen;

static void note_period(struct probe *const probe, const long period_ns)
{
    (void)probe;
    atomic_store(&period_seen, period_ns);
}

static void threads_call_their_functions_and_count(void **state)
{
    (void)state;
    probe_hook = note_period;
    assert_int_equal(rtapi_task_self(), -EINVAL);
    assert_string_equal(
        hal_rig_run("loadrt threads name1=t period1=200000\nloadrt probe\naddf probe.0 t\nsetp probe.0.in 6\nstart\n"),
        "");
    assert_true(halhost_running());
    wait_for_cycles(100);
    assert_string_equal(hal_rig_run("stop\n"), "");
    assert_false(halhost_running());
    const int32_t stopped_at = *probes[0].count;
    const struct hh_thread *const thread = hh_thread_find(hh_host(), "t");
    assert_int_equal(atomic_load(&thread->cycles), stopped_at);
    assert_int_equal(histogram_total(&thread->busy), stopped_at);
    assert_int_equal(histogram_total(&thread->latency), stopped_at);
    assert_int_equal(histogram_total(&thread->interval), stopped_at - 1);
    assert_int_equal(atomic_load(&period_seen), 200000);
    assert_true(*probes[0].out == 6.0);
    assert_true(probes[0].seen >= 0);
    assert_int_equal(rtapi_task_self(), -EINVAL);
    /* Nothing runs while stopped; a second start goes on. */
    assert_string_equal(hal_rig_run("stop\nstart\nstart\n"), "");
    wait_for_cycles(stopped_at + 10);
    assert_string_equal(hal_rig_run("stop\n"), "");
    assert_true(hh_load(HAL_S32, *thread->time).s >= 0);
    assert_true(hh_load(HAL_S32, thread->tmax).s > 0);
}

static void schedules_change_while_threads_run(void **state)
{
    (void)state;
    assert_string_equal(hal_rig_run("loadrt threads name1=t period1=100000\nloadrt probe sets=2\naddf probe.0 t\n"
                                    "net s probe.0.out\nstart\n"),
                        "");
    for (int i = 0; i < 20; i++) {
        assert_string_equal(hal_rig_run("addf probe.1 t 1\nnet s probe.1.in\n"), "");
        assert_string_equal(hal_rig_run("unlinkp probe.1.in\ndelf probe.1 t\n"), "");
        const int32_t count = hh_load(HAL_S32, probes[1].count).s;
        wait_for_cycles(hh_load(HAL_S32, probes[0].count).s + 2);
        /* After delf returned the function is not called any more. */
        assert_int_equal(hh_load(HAL_S32, probes[1].count).s, count);
    }
    /* Even the component itself can go. */
    assert_string_equal(hal_rig_run("unloadrt probe\n"), "");
    assert_int_equal(probe_exits, 1);
    assert_string_equal(hal_rig_run("show thread\nstop\n"), "");
    assert_null(strstr(hal_rig_output(), "probe"));
}

static void print_in_cycle(struct probe *const probe, const long period_ns)
{
    (void)period_ns;
    if (*probe->count <= 20)
        rtapi_print_msg(RTAPI_MSG_ERR, "cycle %d\n", *probe->count);
    rtapi_print_msg(RTAPI_MSG_INFO, "not shown\n");
}

static void realtime_messages_arrive_in_order(void **state)
{
    (void)state;
    probe_hook = print_in_cycle;
    assert_string_equal(hal_rig_run("loadrt threads name1=t period1=200000\nloadrt probe\naddf probe.0 t\nstart\n"),
                        "");
    wait_for_cycles(25);
    assert_string_equal(hal_rig_run("stop\n"), "");
    const char *at = hal_rig_messages();
    for (int i = 1; i <= 20; i++) {
        char line[32];
        snprintf(line, sizeof line, "cycle %d\n", i);
        at = strstr(at, line);
        if (!at)
            fail_msg("no %s", line);
    }
    assert_null(strstr(hal_rig_messages(), "not shown"));
}

static void flood(struct probe *const probe, const long period_ns)
{
    (void)period_ns;
    for (int i = 0; *probe->count == 1 && i < 100000; i++)
        rtapi_print_msg(RTAPI_MSG_ERR, "x\n");
}

static void a_flood_of_messages_is_dropped_and_counted(void **state)
{
    (void)state;
    probe_hook = flood;
    assert_string_equal(hal_rig_run("loadrt threads name1=t\nloadrt probe\naddf probe.0 t\nstart\n"), "");
    wait_for_cycles(3);
    assert_string_equal(hal_rig_run("stop\n"), "");
    /* 200,000 characters do not fit the rig's buffer, so the count is looked for in what is sent next. */
    const char *const messages = hal_rig_messages();
    assert_true(strstr(messages, "messages of realtime threads were dropped") || strlen(messages) > 60000);
}

static _Atomic int status_seen;

static void call_hal(struct probe *const probe, const long period_ns)
{
    (void)probe;
    (void)period_ns;
    atomic_store(&status_seen, hal_init("late"));
    assert_null(hal_malloc(8));
    hal_stop_threads();
}

static void realtime_threads_may_stop_threads_but_change_nothing(void **state)
{
    (void)state;
    probe_hook = call_hal;
    assert_string_equal(hal_rig_run("loadrt threads name1=t\nloadrt probe\naddf probe.0 t\nstart\nrun 60\nstop\n"), "");
    assert_int_equal(atomic_load(&status_seen), -EPERM);
    assert_non_null(strstr(hal_rig_messages(), "called from a realtime thread"));
    assert_int_equal(*probes[0].count, 1);
    probe_hook = NULL;
    assert_string_equal(hal_rig_run("start\n"), "");
    wait_for_cycles(3);
}

/* ---- loading ---------------------------------------------------------------------------------------------------- */

static void module_parameters_are_parsed(void **state)
{
    (void)state;
    assert_string_equal(
        hal_rig_run("loadrt probe sets=0x2 numbers=1,-2,010 wide=5000000000 text=\"a b\" texts=\"x,y z\""), "");
    assert_int_equal(probe_seen.sets, 2);
    assert_int_equal(probe_seen.numbers[0], 1);
    assert_int_equal(probe_seen.numbers[1], -2);
    assert_int_equal(probe_seen.numbers[2], 8);
    assert_true(probe_seen.wide == 5000000000);
    assert_string_equal(probe_texts[0], "a b");
    assert_string_equal(probe_texts[1], "x");
    assert_string_equal(probe_texts[2], "y z");
    assert_string_equal(hal_rig_run("save comp\nunloadrt probe\nloadrt probe text='single' texts=\"a\",\"b\""), "");
    assert_string_equal(probe_texts[0], "single");
    assert_string_equal(probe_texts[1], "a");
    assert_string_equal(probe_texts[2], "b");
}

static void bad_module_parameters_are_refused_before_anything_runs(void **state)
{
    (void)state;
    static const struct {
        const char *argument, *reason;
    } rows[] = {
        {"nothing=1", "has no parameter 'nothing' (it has sets, fail, not_ready, numbers, wide, text, texts)"},
        {"sets", "not of the form name=value"},
        {"=1", "has no parameter ''"},
        {"sets=", "'' is not a whole number"},
        {"sets=x", "'x' is not a whole number"},
        {"sets=1x", "'1x' is not a whole number"},
        {"sets=3000000000", "is too large"},
        {"wide=99999999999999999999", "is too large"},
        {"numbers=1,2,3,4", "at most 3 values"},
        {"numbers=1,,3", "'' is not a whole number"},
        {"texts=a,b,c", "at most 2 values"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char command[128];
        snprintf(command, sizeof command, "loadrt probe %s\n", rows[i].argument);
        const char *const error = hal_rig_run(command);
        if (!strstr(error, rows[i].reason))
            fail_msg("%s: got '%s'", command, error);
    }
    assert_int_equal(probe_mains, 0);
    assert_non_null(strstr(hal_rig_run("loadrt ../probe\n"), "cannot be the name"));
    assert_non_null(strstr(hal_rig_run("loadrt nosuch\n"), "no component 'nosuch'"));
}

static void a_failed_load_leaves_nothing(void **state)
{
    (void)state;
    static const char *const arguments[] = {"fail=-5", "not_ready=1", "sets=100000"};
    const struct hh *const host = hh_host();
    for (size_t i = 0; i < 3; i++) {
        char command[64];
        snprintf(command, sizeof command, "loadrt probe %s\n", arguments[i]);
        assert_string_not_equal(hal_rig_run(command), "");
        assert_int_equal(host->comps.count, 0);
        assert_int_equal(host->modules.count, 0);
        assert_int_equal(host->pins.shown.count, 0);
        assert_int_equal(host->params.shown.count, 0);
        assert_int_equal(host->functs.shown.count, 0);
    }
    assert_non_null(strstr(hal_rig_run("loadrt probe fail=-5\n"), "error -5"));
    assert_string_equal(hal_rig_run("loadrt probe\n"), "");
    assert_non_null(strstr(hal_rig_run("loadrt probe\n"), "loaded already"));
}

static void unloading_frees_pins_links_and_functions(void **state)
{
    (void)state;
    const struct hh *const host = hh_host();
    assert_string_equal(hal_rig_run("loadrt threads name1=t\nloadrt probe sets=3\naddf probe.0 t\nnet s probe.0.out "
                                    "probe.1.in\nalias pin probe.2.in other\nunloadrt probe\n"),
                        "");
    assert_int_equal(probe_exits, 1);
    const struct hh_signal *const signal = hh_table_find(&host->signals, "s");
    assert_int_equal(signal->writers + signal->readers, 0);
    assert_int_equal(host->functs.shown.count, 0);
    assert_null(hh_table_find(&host->pins, "other"));
    assert_string_equal(hal_rig_run("loadrt probe\nnet s probe.0.out\naddf probe.0 t\nunloadrt threads\n"), "");
    assert_string_equal(hal_rig_run("loadrt threads name1=t\naddf probe.0 t\n"), "");
}

static void components_go_in_reverse_order(void **state)
{
    (void)state;
    assert_string_equal(hal_rig_run("loadrt probe\nloadrt tail\nunloadrt all\n"), "");
    assert_string_equal(probe_order, "tp");
    assert_string_equal(hal_rig_run("loadrt tail\nloadrt probe\nloadrt threads name1=t\naddf probe.0 t\nstart\n"), "");
    wait_for_cycles(3);
    /* The same when the host comes down with threads running, as after an error. */
    struct hm2_diag diag = {0};
    assert_int_equal(halhost_close(&diag), 0);
    assert_string_equal(probe_order, "tppt");
    assert_int_equal(diag.problems, 0);
}

/* ---- RTAPI ------------------------------------------------------------------------------------------------------ */

static void texts_are_split_at_blanks(void **state)
{
    (void)state;
    int argc = -1;
    char **argv = rtapi_argv_split(0, "  num_encoders=1 \t sserial_port_0=00xxxx\n x ", &argc);
    assert_int_equal(argc, 3);
    assert_string_equal(argv[0], "num_encoders=1");
    assert_string_equal(argv[1], "sserial_port_0=00xxxx");
    assert_string_equal(argv[2], "x");
    assert_null(argv[3]);
    rtapi_argv_free(argv);
    argv = rtapi_argv_split(0, "", NULL);
    assert_null(argv[0]);
    rtapi_argv_free(argv);
}

static void small_calls_do_what_their_names_say(void **state)
{
    (void)state;
    char *end, text[8];
    assert_int_equal(simple_strtol("0x1Fz", &end, 0), 31);
    assert_string_equal(end, "z");
    assert_int_equal(rtapi_snprintf(text, sizeof text, "%d-%s", 12, "abcdefgh"), 11);
    assert_string_equal(text, "12-abcd");
    assert_int_equal(rtapi_strlcpy(text, "123456789", sizeof text), 9);
    assert_string_equal(text, "1234567");
    const long long before = rtapi_get_time(), clocks = rtapi_get_clocks();
    rtapi_delay(1000000000); /* at most 10 us are honoured; a second would be seen below */
    const long long taken = rtapi_get_time() - before;
    assert_true(taken >= 10000 && taken < 900000000);
    assert_true(rtapi_get_clocks() > clocks);
    rtapi_mutex_t mutex = 0;
    assert_int_equal(rtapi_mutex_try(&mutex), 0);
    assert_int_not_equal(rtapi_mutex_try(&mutex), 0);
    rtapi_mutex_give(&mutex);
    rtapi_mutex_get(&mutex);
    assert_int_equal(rtapi_set_msg_level(6), -EINVAL);
    assert_int_equal(rtapi_set_msg_level(RTAPI_MSG_INFO), 0);
    assert_int_equal(rtapi_get_msg_level(), RTAPI_MSG_INFO);
    rtapi_print_msg(RTAPI_MSG_INFO, "shown now\n");
    assert_non_null(strstr(hal_rig_messages(), "shown now"));
}

static void shared_memory_is_found_by_its_key(void **state)
{
    (void)state;
    const int a = rtapi_shmem_new(42, 1, 100), b = rtapi_shmem_new(42, 2, 50), c = rtapi_shmem_new(43, 1, 8);
    void *memory, *again, *other;
    assert_int_equal(rtapi_shmem_getptr(a, &memory), 0);
    assert_int_equal(rtapi_shmem_getptr(b, &again), 0);
    assert_int_equal(rtapi_shmem_getptr(c, &other), 0);
    assert_ptr_equal(memory, again);
    assert_ptr_not_equal(memory, other);
    assert_int_equal(rtapi_shmem_new(42, 1, 101), -EINVAL);
    assert_int_equal(rtapi_shmem_delete(a, 1), 0);
    assert_int_equal(rtapi_shmem_getptr(b, &again), 0);
    assert_int_equal(rtapi_shmem_delete(b, 2), 0);
    assert_int_equal(rtapi_shmem_getptr(b, &again), -EINVAL);
}

static unsigned handled;

static void on_handled(const msg_level_t level, const char *const format, va_list args)
    __attribute__((format(printf, 2, 0)));
static void on_handled(const msg_level_t level, const char *const format, va_list args)
{
    (void)args;
    handled += level == RTAPI_MSG_ERR && format[0] == 'h';
}

static void a_message_handler_can_be_put_in_front(void **state)
{
    (void)state;
    const rtapi_msg_handler_t original = rtapi_get_msg_handler();
    assert_non_null(original);
    rtapi_set_msg_handler(on_handled);
    handled = 0;
    rtapi_print_msg(RTAPI_MSG_ERR, "hidden\n");
    assert_int_equal(handled, 1);
    rtapi_set_msg_handler(NULL);
    assert_ptr_equal(rtapi_get_msg_handler(), original);
    rtapi_print_msg(RTAPI_MSG_ERR, "seen\n");
    assert_null(strstr(hal_rig_messages(), "hidden"));
    assert_non_null(strstr(hal_rig_messages(), "seen"));
}

static void nothing_works_without_a_host(void **state)
{
    (void)state;
    assert_int_equal(hal_init("a"), -EINVAL);
    assert_null(hal_malloc(8));
    assert_int_equal(hal_start_threads(), -EINVAL);
    assert_int_equal(hal_stop_threads(), -EINVAL);
    assert_int_equal(hal_link("a", "b"), -EINVAL);
    assert_int_equal(rtapi_shmem_new(1, 1, 1), -EINVAL);
    assert_null(hal_comp_name(1));
    rtapi_print_msg(RTAPI_MSG_ERR, "to nobody\n");
    struct hm2_diag diag = {0};
    assert_int_equal(halhost_load("threads", NULL, 0, &diag), HM2_ERR_STATE);
    assert_int_equal(halhost_close(&diag), 0);
}

/* ---- histogram -------------------------------------------------------------------------------------------------- */

static void every_duration_falls_into_its_bucket(void **state)
{
    (void)state;
    static struct histogram histogram;
    static const int64_t durations_ns[] = {0, 1, 63, 64, 65, 127, 128, 1000, 999999, 1000000, 123456789, 68719476735};
    for (size_t i = 0; i < sizeof durations_ns / sizeof durations_ns[0]; i++) {
        histogram_clear(&histogram);
        histogram_add(&histogram, durations_ns[i]);
        assert_int_equal(histogram_total(&histogram), 1);
        size_t bucket = 0;
        while (histogram_count(&histogram, bucket) == 0)
            bucket++;
        assert_true(histogram_low_ns(bucket) <= durations_ns[i]);
        assert_true(durations_ns[i] < histogram_low_ns(bucket + 1));
        assert_true(histogram_low_ns(bucket + 1) - histogram_low_ns(bucket) <= 1 + durations_ns[i] / 31);
        assert_int_equal(histogram_quantile_ns(&histogram, 0.5), durations_ns[i]);
    }
    histogram_clear(&histogram);
    histogram_add(&histogram, -5);
    histogram_add(&histogram, INT64_MAX);
    assert_int_equal(histogram_count(&histogram, 0), 1);
    assert_int_equal(histogram_count(&histogram, HISTOGRAM_BUCKETS - 1), 1);
    for (size_t i = 1; i < HISTOGRAM_BUCKETS; i++)
        assert_true(histogram_low_ns(i) > histogram_low_ns(i - 1));
}

static void quantiles_are_right_to_three_percent(void **state)
{
    (void)state;
    static struct histogram histogram;
    assert_int_equal(histogram_quantile_ns(&histogram, 0.5), 0);
    for (int64_t ns = 1; ns <= 100000; ns++)
        histogram_add(&histogram, ns);
    assert_in_range(histogram_quantile_ns(&histogram, 0.5), 50000, 51600);
    assert_in_range(histogram_quantile_ns(&histogram, 0.999), 99900, 100000);
    assert_int_equal(histogram_max_ns(&histogram), 100000);
    assert_int_equal(histogram_quantile_ns(&histogram, 1.0), 100000);
}

#define RIG(test) cmocka_unit_test_setup_teardown(test, hal_rig_open, hal_rig_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        RIG(components_have_distinct_ids_and_names),
        RIG(names_have_at_most_47_characters),
        RIG(nothing_is_created_after_ready),
        RIG(memory_is_zeroed_aligned_and_limited),
        RIG(pointers_and_parameters_must_lie_in_hal_memory),
        RIG(types_and_directions_are_checked),
        RIG(names_and_aliases_share_one_name_space_for_each_kind),
        RIG(parameters_are_set_by_type_and_direction),
        RIG(a_signal_takes_one_writer_and_keeps_types_apart),
        RIG(a_pin_has_one_signal),
        RIG(linking_rewrites_pointers_and_carries_values_over),
        RIG(values_are_found_by_name),
        RIG(functions_come_with_objects_for_their_run_time),
        RIG(functions_are_added_at_their_position),
        RIG(thread_periods_are_multiples_of_the_first),
        RIG(threads_call_their_functions_and_count),
        RIG(schedules_change_while_threads_run),
        RIG(realtime_messages_arrive_in_order),
        RIG(a_flood_of_messages_is_dropped_and_counted),
        RIG(realtime_threads_may_stop_threads_but_change_nothing),
        RIG(module_parameters_are_parsed),
        RIG(bad_module_parameters_are_refused_before_anything_runs),
        RIG(a_failed_load_leaves_nothing),
        RIG(unloading_frees_pins_links_and_functions),
        RIG(components_go_in_reverse_order),
        RIG(texts_are_split_at_blanks),
        RIG(small_calls_do_what_their_names_say),
        RIG(shared_memory_is_found_by_its_key),
        RIG(a_message_handler_can_be_put_in_front),
        cmocka_unit_test(nothing_works_without_a_host),
        cmocka_unit_test(every_duration_falls_into_its_bucket),
        cmocka_unit_test(quantiles_are_right_to_three_percent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
