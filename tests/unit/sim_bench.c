/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "replay.h"
#include "sim_bench.h"

#define NAME_SIZE 128u

static void check(const struct sim_bench *const bench, const int err)
{
    if (err < 0)
        fail_msg("%s", bench->diag.text);
}

struct sim_bench *sim_bench_new(const char *const profile, const char *const firmware, const char *const config)
{
    static struct hm2_image image;
    assert_true(!firmware || replay_firmware(firmware, &image));
    return sim_bench_of(&(struct sim_card_options){.profile = profile, .seed = 1, .image = firmware ? &image : NULL},
                        config);
}

struct sim_bench *sim_bench_of(const struct sim_card_options *const options, const char *const config)
{
    struct sim_bench *const bench = calloc(1, sizeof *bench);
    assert_non_null(bench);
    check(bench, sim_card_new(&bench->card, options, &bench->diag));
    assert_int_equal(sim_net_new(&bench->net, bench->card, NULL), 0);
    bench->board = hm2_board_new();
    bench->plain = hm2_plain_binder_new();
    assert_non_null(bench->board);
    assert_non_null(bench->plain);
    check(bench, hm2_board_identify(bench->board, sim_net_link(bench->net), &bench->diag));
    check(bench, hm2_board_setup(bench->board, 0, hm2_plain_binder(bench->plain), config, &bench->diag));
    check(bench, hm2_board_start(bench->board, &bench->diag));
    bench->now_ns = link_now_ns(sim_net_link(bench->net));
    return bench;
}

void sim_bench_free(struct sim_bench *const bench)
{
    hm2_board_free(bench->board);
    hm2_plain_binder_free(bench->plain);
    sim_net_free(bench->net);
    sim_card_free(bench->card);
    free(bench);
}

void sim_bench_cycle(struct sim_bench *const bench)
{
    hm2_board_read(bench->board, BENCH_PERIOD_NS);
    hm2_board_write(bench->board, BENCH_PERIOD_NS);
    bench->now_ns += BENCH_PERIOD_NS;
    sim_net_sleep_until(bench->net, bench->now_ns);
}

static const char *full_name(const struct sim_bench *const bench, const char *const name, char full[const NAME_SIZE])
{
    (void)snprintf(full, NAME_SIZE, "%s.%s", hm2_board_prefix(bench->board), name);
    return full;
}

double sim_bench_get(const struct sim_bench *const bench, const char *const name)
{
    char full[NAME_SIZE];
    int err;
    const double value = hm2_plain_get(bench->plain, full_name(bench, name, full), &err);
    if (err)
        fail_msg("no point %s", full);
    return value;
}

void sim_bench_set(const struct sim_bench *const bench, const char *const name, const double value)
{
    char full[NAME_SIZE];
    if (hm2_plain_set(bench->plain, full_name(bench, name, full), value))
        fail_msg("no point %s that can be set so", full);
}

bool sim_bench_has(const struct sim_bench *const bench, const char *const name)
{
    char full[NAME_SIZE];
    return hm2_plain_find(bench->plain, full_name(bench, name, full)) != NULL;
}
