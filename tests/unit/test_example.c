/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The module of CONTRIBUTING.md: it does what it says, and the page shows the files that do it. */
#include "unit.h"

#include "../example/tally.h"
#include "idrom_files.h"
#include "module_rig.h"
#include "module_types.h"
#include "sim_bench.h"
#include "sim_card.h"

enum { COUNT = 0x6000, LIMIT = 0x6100, INPUT_IO = 0, REACHED_IO = 1 };

/* Instead of the library's tables: the one line in each of them that a module needs. */
const struct hm2_module_type *const hm2_module_types[] = {&hm2_watchdog_type, &hm2_tally_type, &hm2_ioport_type, NULL};

extern const struct sim_module_ops sim_ioport_ops, sim_watchdog_ops, sim_tally_ops;
const struct sim_module_ops *const sim_models[] = {&sim_ioport_ops, &sim_watchdog_ops, &sim_tally_ops, NULL};

static const struct hm2_image *image(void)
{
    static const struct rig_md modules[] = {
        {HM2_GTAG_WATCHDOG, 0, 1, 1, 0x0C00, 3, 0x00, 0},
        {HM2_GTAG_IOPORT, 0, 1, 3, 0x1000, 5, 0x00, 0x1F},
        {GTAG_TALLY, 0, 1, 2, COUNT, 2, 0x00, 0x03},
    };
    static const uint32_t pins[] = {0x0300E001, 0x0300E081, 0x0301E001, 0x0301E081};
    return rig_image_with(modules, 3, pins, 4);
}

/* ---- driver -------------------------------------------------------------------------------------------------------
 */

static void counts_go_on_where_the_register_wraps(void **state)
{
    (void)state;
    struct module_rig *const rig = rig_new(image(), "");
    (void)rig_add(rig, &hm2_tally_type);
    rig_put(rig, COUNT, 0xFFFFFFFE);
    rig_start(rig);
    rig_cycle(rig);
    assert_true(rig_get(rig, "tally.00.count") == 0);
    rig_put(rig, COUNT, 3);
    rig_set(rig, "tally.01.limit", 7);
    rig_cycle(rig);
    assert_true(rig_get(rig, "tally.00.count") == 5);
    assert_int_equal(rig_written(rig, LIMIT + 4), 7);
    rig_free(rig);
}

/* ---- with a simulated card ----------------------------------------------------------------------------------------
 */

static void a_tally_counts_pulses_and_sets_its_output(void **state)
{
    (void)state;
    struct sim_bench *const bench =
        sim_bench_of(&(struct sim_card_options){.profile = "7i96s", .seed = 1, .image = image()}, "");
    sim_bench_set(bench, "tally.00.limit", 3);
    for (unsigned pulses = 0; pulses < 5; pulses++) {
        sim_bench_cycle(bench);
        sim_bench_cycle(bench);
        assert_true(sim_bench_get(bench, "tally.00.count") == pulses);
        assert_true(sim_bench_get(bench, "tally.01.count") == 0);
        /* the register has seen the pull-up at power-up, too */
        assert_int_equal(sim_card_pad(bench->card, REACHED_IO), pulses + 1 >= 3 ? SIM_HIGH : SIM_LOW);
        assert_int_equal(sim_card_drive(bench->card, sim_card_clock(bench->card), INPUT_IO, SIM_LOW), 0);
        assert_int_equal(sim_card_drive(bench->card, sim_card_clock(bench->card), INPUT_IO, SIM_HIGH), 0);
    }
    sim_bench_free(bench);
}

/* ---- the page -----------------------------------------------------------------------------------------------------
 */

/* Blocks of the page begin with "```c tests/example/FILE" and are parts of that file, letter for letter. */
static unsigned compare_blocks(char *const page, const char *const name)
{
    static const char opening[] = "```c tests/example/";
    unsigned found = 0;
    size_t len;
    char path[256];
    (void)snprintf(path, sizeof path, TEST_SOURCE "/tests/example/%s", name);
    char *const file = load_text(path, &len);
    for (char *at = page; (at = strstr(at, opening));) {
        at += strlen(opening);
        char *const code = strchr(at, '\n') + 1, *const end = strstr(code, "```");
        assert_non_null(end);
        if (strncmp(at, name, strlen(name)) != 0 || at[strlen(name)] != '\n')
            continue;
        *end = '\0';
        if (!strstr(file, code))
            fail_msg("CONTRIBUTING.md has what %s has not:\n%s", name, code);
        *end = '`';
        found++;
    }
    free(file);
    return found;
}

static void what_the_page_shows_is_in_the_files(void **state)
{
    (void)state;
    size_t len;
    char *const page = load_text(TEST_SOURCE "/CONTRIBUTING.md", &len);
    assert_in_range(compare_blocks(page, "tally.c"), 3, 10);
    assert_in_range(compare_blocks(page, "sim_tally.c"), 1, 10);
    free(page);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(counts_go_on_where_the_register_wraps),
        cmocka_unit_test(a_tally_counts_pulses_and_sets_its_output),
        cmocka_unit_test(what_the_page_shows_is_in_the_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
