/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "replay.h"
#include "sim_bench.h"

static void check(const struct sim_bench *const bench, const int err)
{
    if (err < 0)
        fail_msg("%s", bench->diag.text);
}

struct sim_bench *sim_bench_new(const char *const profile, const char *const firmware, const char *const config)
{
    static struct hm2_image image;
    struct sim_bench *const bench = calloc(1, sizeof *bench);
    assert_non_null(bench);
    assert_true(!firmware || replay_firmware(firmware, &image));
    const struct sim_card_options options = {.profile = profile, .seed = 1, .image = firmware ? &image : NULL};
    check(bench, sim_card_new(&bench->card, &options, &bench->diag));
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
