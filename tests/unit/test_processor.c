/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Which processor the threads of the HAL host get: on machines of all kinds, none of them this one. */
#include "unit.h"

#include "processor.h"

static void lists_of_the_kernel_are_read(void **state)
{
    (void)state;
    static const struct {
        const char *list;
        unsigned count, lowest, highest;
    } rows[] = {
        {"", 0, 0, 0},
        {"\n", 0, 0, 0},
        {"0\n", 1, 0, 0},
        {"3", 1, 3, 3},
        {"0-3\n", 4, 0, 3},
        {"1,3\n", 2, 1, 3},
        {"0-1,4-5,9\n", 5, 0, 9},
        {"1023", 1, 1023, 1023},
        {"1024-9999", 0, 0, 0},
        {"1000-99999999999999999999", 24, 1000, 1023},
        {"5-3", 0, 0, 0},
        {"2,x", 1, 2, 2},
        {"x", 0, 0, 0},
        {"2-", 0, 0, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        cpu_set_t set;
        hh_processors_read(rows[i].list, &set);
        if ((unsigned)CPU_COUNT(&set) != rows[i].count ||
            (rows[i].count && (!CPU_ISSET(rows[i].lowest, &set) || !CPU_ISSET(rows[i].highest, &set))))
            fail_msg("'%s': %d processors", rows[i].list, CPU_COUNT(&set));
    }
}

static void the_best_processor_is_chosen(void **state)
{
    (void)state;
    static const struct {
        const char *name, *allowed, *isolated;
        unsigned bound[8];
        int best;
    } rows[] = {
        {"none", "", "", {0}, -1},
        {"one", "0", "", {0}, 0},
        {"one, and it is taken", "0", "", {7}, 0},
        {"one, and it is isolated", "0", "0", {1}, 0},
        {"two: the last", "0-1", "", {0}, 1},
        {"two, the last is taken", "0-1", "", {0, 1}, 0},
        {"two, the first is taken", "0-1", "", {1, 0}, 1},
        {"two, both taken", "0-1", "", {1, 1}, 1},
        {"two, both taken, the first less", "0-1", "", {1, 3}, 0},
        {"many: the last free one", "0-7", "", {0, 0, 0, 0, 0, 0, 2, 1}, 5},
        {"confined", "2-3", "", {0, 0, 0, 1}, 2},
        {"confined to taken ones", "2-3", "", {0, 0, 2, 1}, 3},
        {"isolated ones first", "0-7", "1-2", {0}, 2},
        {"isolated ones first, taken or not", "0-7", "2", {0, 0, 4}, 2},
        {"among the isolated a free one", "0-7", "1-2", {0, 0, 1}, 1},
        {"isolated ones that are not allowed", "0-1", "2-3", {0}, 1},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct hh_processors p = {0};
        hh_processors_read(rows[i].allowed, &p.allowed);
        hh_processors_read(rows[i].isolated, &p.isolated);
        memcpy(p.bound, rows[i].bound, sizeof rows[i].bound);
        const int best = hh_processor_best(&p);
        if (best != rows[i].best)
            fail_msg("%s: %d, not %d", rows[i].name, best, rows[i].best);
    }
}

static void isolated_processors_are_asked_for_unless_the_program_is_confined(void **state)
{
    (void)state;
    static const struct {
        const char *name, *allowed, *isolated;
        bool unconfined;
    } rows[] = {
        {"as the kernel starts programs", "0-2", "3", true},
        {"confined", "0-1", "3", false},
        {"confined to isolated ones", "3", "3", false},
        {"has them already", "0-3", "3", false},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct hh_processors p = {0};
        hh_processors_read("0-3", &p.online);
        hh_processors_read(rows[i].allowed, &p.allowed);
        hh_processors_read(rows[i].isolated, &p.isolated);
        if (hh_processors_unconfined(&p) != rows[i].unconfined)
            fail_msg("%s", rows[i].name);
    }
}

static void the_choice_is_allowed_here_and_changes_nothing(void **state)
{
    (void)state;
    cpu_set_t before, after;
    assert_int_equal(sched_getaffinity(0, sizeof before, &before), 0);
    const int cpu = hh_processor_choose();
    assert_int_equal(sched_getaffinity(0, sizeof after, &after), 0);
    assert_true(CPU_EQUAL(&before, &after));
    assert_in_range(cpu, 0, CPU_SETSIZE - 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lists_of_the_kernel_are_read),
        cmocka_unit_test(the_best_processor_is_chosen),
        cmocka_unit_test(isolated_processors_are_asked_for_unless_the_program_is_confined),
        cmocka_unit_test(the_choice_is_allowed_here_and_changes_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
