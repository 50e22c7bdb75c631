/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the plain and the multiplexed encoder module have in common: registers, time stamps, samples, followers. */
#include <stdlib.h>
#include <string.h>

#include "map.h"
#include "sim_qcounter.h"

#define STEP_ONE (1LL << 32) /* of sim_stepgen_motor() */

/* ---- life
 * ------------------------------------------------------------------------------------------------------------- */

int sim_qc_bank_init(struct sim_module *const m, struct sim_qc_bank *const bank)
{
    const bool new_map = sim_map_is_new(sim_idrom(m->card));
    bank->type.error_by_one = new_map;
    bank->type.filter_halved = new_map;
    bank->type.dpll_select = new_map && hm2_idrom_find(sim_idrom(m->card), HM2_GTAG_DPLL);
    bank->count = m->md.instances;
    const size_t n = bank->count ? bank->count : 1;
    bank->counters = calloc(n, sizeof(*bank->counters));
    bank->follows = calloc(n, sizeof(*bank->follows));
    return bank->counters && bank->follows ? 0 : HM2_ERR_NOMEM;
}

void sim_qc_bank_release(struct sim_qc_bank *const bank)
{
    free(bank->counters);
    free(bank->follows);
}

void sim_qc_bank_power_up(struct sim_module *const m, struct sim_qc_bank *const bank)
{
    memset(bank->counters, 0, bank->count * sizeof(*bank->counters));
    for (unsigned i = 0; i < bank->count; i++) {
        bank->counters[i].last_edge = INT64_MIN;
        struct sim_follow *const f = &bank->follows[i];
        f->part = 0;
        f->seen = f->keeps ? f->position(m->card, f->unit) : 0;
        f->seen_clk = m->clk;
    }
    bank->stamps = (struct sim_timestamp){.since = m->clk};
    sim_divider_start(&bank->stamps.divider, m->clk, 0, SIM_TSDIV_TOP_BIT);
    bank->select = 0;
    bank->sampled_stamp = 0;
}

/* ---- registers
 * -------------------------------------------------------------------------------------------------------- */

static bool transparent(const struct sim_qc_bank *const bank)
{
    return !(bank->select & 8u);
}

/* With a DPLL the bus sees registers behind the counters: those of one clock ago, or what the timer sampled (3.5.6). */
static uint32_t seen(const struct sim_qc_bank *const bank, const struct sim_qcounter *const q, const bool control,
                     const int64_t clk)
{
    if (bank->type.dpll_select && !transparent(bank))
        return control ? q->sampled_control : q->sampled_data;
    if (bank->type.dpll_select && q->last_edge == clk - 1)
        return control ? q->before_control : q->before_data;
    return control ? sim_qcounter_control(q) : sim_qcounter_data(q);
}

static uint32_t read_stamp(const struct sim_qc_bank *const bank, const int64_t clk)
{
    if (!bank->type.dpll_select)
        return sim_timestamp_at(&bank->stamps, clk);
    return transparent(bank) ? sim_timestamp_at(&bank->stamps, clk - 1) : bank->sampled_stamp;
}

uint32_t sim_qc_bank_read(struct sim_module *const m, struct sim_qc_bank *const bank, const unsigned page,
                          const unsigned low, uint32_t *const undriven)
{
    const unsigned instance = low / 4;
    *undriven = 0;
    switch (page) {
    case SIM_QC_PAGE_COUNT:
    case SIM_QC_PAGE_CONTROL:
        if (instance >= bank->count)
            break;
        if (page == SIM_QC_PAGE_CONTROL && !bank->type.probe)
            *undriven = SIM_QC_LATCH_ON_PROBE | SIM_QC_PROBE_POL;
        return seen(bank, &bank->counters[instance], page == SIM_QC_PAGE_CONTROL, m->clk);
    case SIM_QC_PAGE_TSDIV:
        *undriven = 0xFFFF0000u;
        return bank->stamps.divisor;
    case SIM_QC_PAGE_TSCOUNT:
        *undriven = 0xFFFF0000u;
        return read_stamp(bank, m->clk);
    case SIM_QC_PAGE_SELECT:
        if (!bank->type.dpll_select)
            break;
        return (uint32_t)bank->select << 12;
    default:
        break;
    }
    *undriven = UINT32_MAX;
    return 0;
}

void sim_qc_bank_write(struct sim_qc_bank *const bank, const int64_t clk, const unsigned page, const uint32_t value)
{
    if (page == SIM_QC_PAGE_TSDIV) {
        sim_timestamp_write(&bank->stamps, clk, (uint16_t)value);
    } else if (page == SIM_QC_PAGE_SELECT && bank->type.dpll_select) {
        bank->select = value >> 12 & 0xFu;
    }
}

/* ---- samples of a DPLL timer
 * -------------------------------------------------------------------------------------------- */

void sim_qc_bank_sample(struct sim_qc_bank *const bank, const int64_t clk)
{
    for (unsigned i = 0; i < bank->count; i++) {
        struct sim_qcounter *const q = &bank->counters[i];
        q->sampled_data = sim_qcounter_data(q);
        q->sampled_control = sim_qcounter_control(q);
    }
    bank->sampled_stamp = sim_timestamp_at(&bank->stamps, clk);
}

/* Selections above 4 see timer 0 (newer source). */
static unsigned timer_of(const struct sim_qc_bank *const bank)
{
    const unsigned timer = bank->select & 7u;
    return timer <= 4 ? timer : 0;
}

int64_t sim_qc_bank_next_sample(struct sim_module *const m, const struct sim_qc_bank *const bank)
{
    if (!bank->type.dpll_select || transparent(bank))
        return SIM_NEVER;
    return sim_dpll_next_rise(m->card, timer_of(bank), m->clk);
}

int64_t sim_qc_bank_sample_edge(struct sim_module *const m, const struct sim_qc_bank *const bank, const int64_t clk)
{
    if (!bank->type.dpll_select || transparent(bank))
        return INT64_MIN;
    /* A timer that is high after edge r is sampled at edge r + 1. */
    const int64_t rise = sim_dpll_last_rise(m->card, timer_of(bank), clk - 1);
    return rise == INT64_MIN ? INT64_MIN : rise + 1;
}

/* ---- followers
 * ---------------------------------------------------------------------------------------------------------- */

/* When the last count came, as if what it follows had run evenly since it was looked at last: the counts lie at
 * multiples of `one`, and the way went from f->part to f->part + way. */
static int64_t last_count_clk(const struct sim_follow *const f, const sim_wide way, const sim_wide counts,
                              const sim_wide one, const int64_t clk)
{
    const sim_wide boundary = (counts > 0 ? counts : counts + 1) * one;
    const double fraction = (double)(boundary - f->part) / (double)way;
    return f->seen_clk + (int64_t)(fraction * (double)(clk - f->seen_clk));
}

/* The smallest multiple of `unit` at or above `position`. */
static int64_t multiple_from(const int64_t position, const int64_t unit)
{
    const int64_t past = position % unit;
    return past > 0 ? position - past + unit : position - past;
}

/* The first index on the way from one position to another, not counting the one it stands on; false when there is none.
 * One that latches and clears always acts at the last one. */
static bool index_on_way(const struct sim_follow *const f, const int64_t from, const int64_t to, const bool first,
                         int64_t *const at)
{
    const int64_t unit = f->index_counts;
    if (unit == 0)
        return false;
    const bool up = to > from;
    const int64_t lowest = multiple_from(up ? from + 1 : to, unit);
    const int64_t highest = -multiple_from(up ? -to : -from + 1, unit);
    *at = first == up ? lowest : highest;
    return lowest <= highest;
}

static void turn(struct sim_follow *const f, struct sim_qcounter *const q, const int64_t counts)
{
    const int64_t from = f->turned, to = from + counts;
    int64_t at = from;
    if (index_on_way(f, from, to, q->control & SIM_QC_JUST_ONCE, &at)) {
        q->count = (uint16_t)(q->count + (uint64_t)(at - from));
        sim_qcounter_index(q);
    } else {
        at = from;
    }
    q->count = (uint16_t)(q->count + (uint64_t)(to - at));
    f->turned = to;
}

static void follow(struct sim_qc_bank *const bank, const unsigned i, const int64_t position, const int64_t clk)
{
    struct sim_follow *const f = &bank->follows[i];
    struct sim_qcounter *const q = &bank->counters[i];
    const sim_wide one = (sim_wide)f->den * STEP_ONE;
    const sim_wide way = (sim_wide)(int64_t)((uint64_t)position - (uint64_t)f->seen) * f->num;
    const sim_wide end = f->part + way;
    const sim_wide counts = end >= 0 ? end / one : -((one - 1 - end) / one);
    if (counts != 0) {
        q->stamp = sim_timestamp_at(&bank->stamps, last_count_clk(f, way, counts, one, clk));
        turn(f, q, (int64_t)counts);
    }
    f->part = end - counts * one;
    f->seen = position;
    f->seen_clk = clk;
}

void sim_qc_bank_follow(struct sim_module *const m, struct sim_qc_bank *const bank, const int64_t clk)
{
    for (unsigned i = 0; bank->following && i < bank->count; i++)
        if (bank->follows[i].position)
            follow(bank, i, bank->follows[i].position(m->card, bank->follows[i].unit), clk);
}

/* Cards have plain or multiplexed encoders; of one that had both, these are the plain ones. */
static struct sim_module *encoder_module(struct sim_card *const card, const unsigned encoder)
{
    const bool plain = hm2_idrom_find(sim_idrom(card), HM2_GTAG_ENCODER);
    struct sim_module *const m = sim_find(card, plain ? HM2_GTAG_ENCODER : HM2_GTAG_MUXED_ENCODER);
    return m && encoder < m->md.instances ? m : NULL;
}

int sim_qc_follow(struct sim_card *const card, const unsigned encoder, const struct sim_follow *const what)
{
    struct sim_module *const m = encoder_module(card, encoder);
    if (!m)
        return HM2_ERR_NOTFOUND;
    struct sim_qc_bank *const bank = m->state;
    bank->follows[encoder] = *what;
    bank->follows[encoder].seen = what->position(m->card, what->unit);
    bank->follows[encoder].seen_clk = m->clk;
    bank->following = true;
    sim_watch_module(m); /* a DPLL timer that samples it must find it at the position of that moment */
    return 0;
}

int sim_card_follow(struct sim_card *const card, const unsigned encoder, const unsigned stepgen, const int32_t num,
                    const int32_t den)
{
    const struct hm2_md *const steps = hm2_idrom_find(sim_idrom(card), HM2_GTAG_STEPGEN);
    if (!steps || stepgen >= steps->instances)
        return HM2_ERR_NOTFOUND;
    if (den <= 0)
        return HM2_ERR_RANGE;
    return sim_qc_follow(card, encoder,
                         &(struct sim_follow){sim_stepgen_motor, .unit = stepgen, .num = num, .den = den});
}

int sim_card_motor(struct sim_card *const card, const unsigned encoder, const unsigned pwmgen,
                   const int32_t counts_per_s)
{
    const struct hm2_md *const drives = hm2_idrom_find(sim_idrom(card), HM2_GTAG_PWMGEN);
    if (!drives || pwmgen >= drives->instances)
        return HM2_ERR_NOTFOUND;
    return sim_qc_follow(card, encoder,
                         &(struct sim_follow){sim_pwmgen_position, .unit = pwmgen, .num = counts_per_s, .den = 1});
}

int sim_card_index(struct sim_card *const card, const unsigned encoder, const uint32_t counts)
{
    struct sim_module *const m = encoder_module(card, encoder);
    if (!m)
        return HM2_ERR_NOTFOUND;
    struct sim_qc_bank *const bank = m->state;
    if (!bank->follows[encoder].position)
        return HM2_ERR_STATE;
    bank->follows[encoder].index_counts = counts;
    return 0;
}

int sim_card_turned(struct sim_card *const card, const uint8_t gtag, const unsigned unit, int64_t *const position)
{
    const struct sim_module *const m = gtag == HM2_GTAG_ENCODER ? encoder_module(card, unit) : sim_find(card, gtag);
    if (!m || unit >= m->md.instances)
        return HM2_ERR_NOTFOUND;
    if (gtag == HM2_GTAG_STEPGEN) {
        const int64_t steps = sim_stepgen_motor(card, unit);
        *position = steps / STEP_ONE - (steps % STEP_ONE < 0);
        return 0;
    }
    if (gtag != HM2_GTAG_ENCODER)
        return HM2_ERR_NOTFOUND;
    const struct sim_qc_bank *const bank = m->state;
    *position = bank->follows[unit].turned;
    return 0;
}
