/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include "dpll_logic.h"
#include "random.h"
#include "trace_folder.h"

static void every_recorded_read_and_output_is_matched(void **state)
{
    (void)state;
    const struct replay_totals totals = replay_data("hm2dpll");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 10);
}

/* ---- closed form against clock by clock ---------------------------------------------------------------------------
 */

struct pair {
    struct sim_dpll fast, slow;
};

static bool same_state(const struct sim_dpll *const a, const struct sim_dpll *const b)
{
    bool same = a->clk == b->clk && a->accum == b->accum && a->prescale_count == b->prescale_count &&
                a->filter_count == b->filter_count && a->phase_error == b->phase_error && a->bounded == b->bounded &&
                a->filtered == b->filtered && a->integral == b->integral && a->correction == b->correction;
    for (unsigned i = 0; i < SIM_DPLL_TIMERS; i++)
        same = same && a->timer_bit[i] == b->timer_bit[i];
    for (unsigned i = 0; i < SIM_DPLL_OUTPUTS; i++)
        for (unsigned k = 0; k < 2; k++)
            same = same && a->history[i].rise[k] == b->history[i].rise[k] &&
                   a->history[i].fall[k] == b->history[i].fall[k];
    return same;
}

static void assert_same(const struct pair *const p, const unsigned seed)
{
    if (same_state(&p->fast, &p->slow))
        return;
    for (unsigned i = 0; i < SIM_DPLL_OUTPUTS; i++)
        print_error("output %u: rise %lld, clock by clock %lld; fall %lld, %lld\n", i,
                    (long long)p->fast.history[i].rise[0], (long long)p->slow.history[i].rise[0],
                    (long long)p->fast.history[i].fall[0], (long long)p->slow.history[i].fall[0]);
    fail_msg("seed %u at clk %lld: accum %011llX, clock by clock %011llX; filter %d, %d at count %u, %u", seed,
             (long long)p->slow.clk, (unsigned long long)p->fast.accum, (unsigned long long)p->slow.accum,
             p->fast.filtered, p->slow.filtered, p->fast.filter_count, p->slow.filter_count);
}

static void run_both(struct pair *const p, const int64_t edges, const unsigned seed)
{
    const unsigned output = seed % SIM_DPLL_OUTPUTS;
    const bool rise = seed & 8;
    int64_t change = sim_dpll_find_change(&p->slow, output, rise, edges);
    sim_dpll_run(&p->fast, edges);
    for (int64_t i = 0; i < edges; i++) {
        const bool before = sim_dpll_output(&p->slow, output);
        sim_dpll_edge(&p->slow, false);
        const bool changed = before != rise && sim_dpll_output(&p->slow, output) == rise;
        if (changed && change == INT64_MAX)
            fail_msg("seed %u: output %u changed at %lld, nothing was foretold", seed, output,
                     (long long)p->slow.clk - 1);
        if (changed && change != p->slow.clk - 1 && change >= p->slow.clk)
            fail_msg("seed %u: output %u changed at %lld, foretold for %lld", seed, output, (long long)p->slow.clk - 1,
                     (long long)change);
        if (change == p->slow.clk - 1 && !changed)
            fail_msg("seed %u: output %u did not change at %lld", seed, output, (long long)change);
    }
    assert_same(p, seed);
}

static void write_both(struct pair *const p, const enum sim_dpll_reg reg, const uint32_t value, const bool sync)
{
    sim_dpll_write_edge(&p->fast, reg, value, sync);
    sim_dpll_write_edge(&p->slow, reg, value, sync);
}

static uint32_t random_control0(struct random *const r)
{
    const uint32_t prescale = random_below(r, 3) ? 1 + random_below(r, 30) : random_below(r, 256);
    const uint32_t limit = random_below(r, 2) ? 0x400000 : (uint32_t)random_u64(r) >> random_below(r, 24) & 0xFFFFFFu;
    return prescale << 24 | limit;
}

static uint32_t random_control1(struct random *const r)
{
    const uint32_t filter = random_below(r, 4) ? 1 + random_below(r, 40) : (uint32_t)random_u64(r) & 0xFFFFu;
    return filter << 16 | 0x1234;
}

static uint32_t random_base_rate(struct random *const r)
{
    return random_below(r, 3) ? 0xFFFFFFFFu >> random_below(r, 6) : random_magnitude(r);
}

static void random_access(struct pair *const p, struct random *const r)
{
    switch (random_below(r, 9)) {
    case 0:
        write_both(p, SIM_DPLL_BASE_RATE, random_base_rate(r), false);
        break;
    case 1:
        write_both(p, SIM_DPLL_PHASE, (uint32_t)random_u64(r), false);
        break;
    case 2:
        write_both(p, SIM_DPLL_CONTROL0, random_control0(r), false);
        break;
    case 3:
        write_both(p, SIM_DPLL_CONTROL1, random_control1(r), false);
        break;
    case 4:
        write_both(p, random_below(r, 2) ? SIM_DPLL_TIMERS12 : SIM_DPLL_TIMERS34, (uint32_t)random_u64(r), false);
        break;
    case 5:
        p->fast.sync_in = p->slow.sync_in = random_below(r, 2);
        break;
    default:
        write_both(p, random_below(r, 2) ? SIM_DPLL_SYNC : SIM_DPLL_REGS, 0, true);
        break;
    }
}

static void any_run_in_closed_form_equals_the_same_run_clock_by_clock(void **state)
{
    (void)state;
    for (unsigned seed = 0; seed < 3000; seed++) {
        struct random r = {seed};
        struct pair p;
        sim_dpll_power_up(&p.fast, seed & 1, 0);
        p.slow = p.fast;
        write_both(&p, SIM_DPLL_BASE_RATE, random_base_rate(&r), false);
        write_both(&p, SIM_DPLL_CONTROL0, random_control0(&r), false);
        write_both(&p, SIM_DPLL_CONTROL1, random_control1(&r), false);
        write_both(&p, SIM_DPLL_TIMERS12, (uint32_t)random_u64(&r), false);
        if (random_below(&r, 2)) { /* past the first, long turn of the filter's prescaler */
            p.fast.filter_count = p.slow.filter_count = 1;
            p.fast.prescale_count = p.slow.prescale_count = 1;
        }
        for (unsigned i = 0; i < 12; i++) {
            run_both(&p, 1 + random_below(&r, 1u << random_below(&r, 14)), seed);
            random_access(&p, &r);
        }
    }
}

/* ---- cost ---------------------------------------------------------------------------------------------------------
 */

static void an_hour_without_accesses_costs_nearly_nothing(void **state)
{
    (void)state;
    struct sim_dpll d;
    sim_dpll_power_up(&d, true, 0);
    /* What a driver writes for 1 kHz at 100 MHz (register map 3.15). */
    const uint32_t rate = (uint32_t)(1000.0 * 4398046511104.0 * 24.0 / 100e6);
    sim_dpll_write_edge(&d, SIM_DPLL_BASE_RATE, rate, false);
    sim_dpll_write_edge(&d, SIM_DPLL_CONTROL0, 24u << 24 | 0x400000, false);
    sim_dpll_write_edge(&d, SIM_DPLL_CONTROL1, 2000u << 16, false);
    for (int second = 0; second < 3600; second++)
        sim_dpll_run(&d, 100000000);
    const int64_t since = d.clk - d.history[0].rise[0];
    assert_true(since > 0 && since <= 100001);
    const int64_t period = d.history[0].rise[0] - d.history[0].rise[1];
    assert_true(period == 99984 || period == 100008); /* whole ticks of 24 clocks around 100000 */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_recorded_read_and_output_is_matched),
        cmocka_unit_test(any_run_in_closed_form_equals_the_same_run_clock_by_clock),
        cmocka_unit_test(an_hour_without_accesses_costs_nearly_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
