/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* PeriodM, tag C8: meters of period and pulse length (register map 3.19). Reading the mode latches both. */
#include "sim_card.h"

#define INSTANCES_MAX 64u
#define POLARITY      0x1u
#define VALID         0x2u
#define LEVEL         0x4u
#define AVERAGES      0xFFFu
#define AVERAGE_SHIFT 4
#define FILTER_SHIFT  16
#define PIN_INPUT     0x01u

enum { PAGE_MODE, PAGE_PERIOD, PAGE_WIDTH, PAGE_LIMIT, PAGES };

struct meter {
    uint32_t mode, limit, period_timer, width_timer, left, filter;
    uint32_t period, width, width_before, period_shown, width_shown;
    bool line, sampled, filtered, before, valid, fast_enough, mode_read;
};

struct periodm {
    unsigned count;
    struct meter meters[INSTANCES_MAX];
};

static void filter_edge(struct meter *const m)
{
    const uint32_t length = m->mode >> FILTER_SHIFT, before = m->filter;
    m->before = m->filtered;
    if (m->sampled && before < length)
        m->filter++;
    else if (!m->sampled && before > 0)
        m->filter--;
    if (before >= length)
        m->filtered = true;
    if (before == 0)
        m->filtered = false;
    m->sampled = m->line != ((m->mode & POLARITY) != 0);
}

static void rise(struct meter *const m, const struct meter *const old)
{
    m->valid = old->fast_enough;
    if (old->left > 0) {
        m->left = old->left - 1u;
        return;
    }
    m->period = old->period_timer;
    m->width = old->width_before;
    m->left = old->mode >> AVERAGE_SHIFT & AVERAGES;
    m->period_timer = m->width_timer = 0;
}

static void edge(struct meter *const m)
{
    const struct meter old = *m;
    if (old.period_timer < old.limit) {
        m->period_timer++;
        m->fast_enough = true;
    } else if (old.period_timer == old.limit) {
        m->fast_enough = m->valid = false;
    }
    m->width_timer += old.filtered;
    if (old.filtered && !old.before)
        rise(m, &old);
    if (!old.filtered && old.before && old.left == 0)
        m->width_before = old.width_timer;
    if (old.mode_read) {
        m->period_shown = old.period;
        m->width_shown = old.width;
        m->mode_read = false;
    }
    filter_edge(m);
}

static bool steady(const struct meter *const m)
{
    const bool level = m->line != ((m->mode & POLARITY) != 0);
    const uint32_t length = m->mode >> FILTER_SHIFT;
    const bool shown = level && length > 0;
    return m->sampled == level && m->filter == (level ? length : 0) && m->filtered == shown && m->before == shown &&
           !m->mode_read;
}

/* Between changes of the input only the timers run. */
static void run(struct meter *const m, int64_t clk)
{
    for (; clk > 0 && !steady(m); clk--)
        edge(m);
    if (clk == 0)
        return;
    const uint32_t room = m->limit > m->period_timer ? m->limit - m->period_timer : 0;
    m->fast_enough = clk <= (int64_t)room || m->period_timer > m->limit;
    if (!m->fast_enough)
        m->valid = false;
    m->period_timer += clk < (int64_t)room ? (uint32_t)clk : room;
    m->width_timer += m->filtered ? (uint32_t)clk : 0;
}

static int init(struct sim_module *const module)
{
    struct periodm *const s = module->state;
    s->count = module->md.instances < INSTANCES_MAX ? module->md.instances : INSTANCES_MAX;
    return 0;
}

static void power_up(struct sim_module *const module)
{
    struct periodm *const s = module->state;
    for (unsigned i = 0; i < s->count; i++)
        s->meters[i] = (struct meter){.line = s->meters[i].line};
}

static void advance(struct sim_module *const module, const int64_t clk)
{
    struct periodm *const s = module->state;
    for (unsigned i = 0; i < s->count; i++)
        run(&s->meters[i], clk - module->clk);
}

static uint32_t read(struct sim_module *const module, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct periodm *const s = module->state;
    if (low / 4 >= s->count || page >= PAGES) {
        *undriven = UINT32_MAX;
        return 0;
    }
    struct meter *const m = &s->meters[low / 4];
    if (page == PAGE_PERIOD)
        return m->period_shown;
    if (page == PAGE_WIDTH)
        return m->width_shown;
    if (page == PAGE_LIMIT)
        return m->limit;
    m->mode_read = true;
    return (m->mode & ~(VALID | LEVEL)) | (m->valid ? VALID : 0) | (m->sampled ? LEVEL : 0);
}

static void write(struct sim_module *const module, const unsigned page, const unsigned low, const uint32_t value)
{
    struct periodm *const s = module->state;
    for (unsigned i = 0; i < s->count; i++)
        edge(&s->meters[i]);
    module->clk++;
    if (low / 4 < s->count && page == PAGE_MODE)
        s->meters[low / 4].mode = value;
    else if (low / 4 < s->count && page == PAGE_LIMIT)
        s->meters[low / 4].limit = value;
}

static void input(struct sim_module *const module, const unsigned unit, const uint8_t pin, const bool level)
{
    struct periodm *const s = module->state;
    if (pin == PIN_INPUT && unit < s->count)
        s->meters[unit].line = level;
}

const struct sim_module_ops sim_periodm_ops = {
    .gtag = HM2_GTAG_PERIODM,
    .name = "PeriodM",
    .pages = PAGES,
    .state_size = sizeof(struct periodm),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .input = input,
};
