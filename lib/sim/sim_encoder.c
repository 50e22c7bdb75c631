/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Encoder, tag 04: quadrature counters with their own input pins (register map 3.5, traces in folder encoder). */
#include "sim_qcounter.h"

#define PIN_A      0x01u /* secondary pins (register map 4.1) */
#define PIN_B      0x02u
#define PIN_INDEX  0x03u
#define PIN_MASK   0x04u
#define PIN_PROBE  0x05u
#define PIN_SHARED 0x06u

#define RATE_TOP_BIT    0x800u
#define RATE_MASK       0xFFFu
#define DEFAULT_RATE_HZ 16000000u /* filter rate after configuration: round(clock / 16 MHz) - 2 (3.5.3) */

struct encoder {
    struct sim_qc_bank bank; /* first: the followers reach it through sim_module.state */
    struct sim_divider rate;
};

static uint32_t default_rate(const struct sim_module *const m)
{
    const uint32_t divider = (sim_clock_low_hz(m->card) + DEFAULT_RATE_HZ / 2) / DEFAULT_RATE_HZ;
    return divider > 2 ? divider - 2 : 0;
}

static int init(struct sim_module *const m)
{
    struct encoder *const e = m->state;
    const int err = sim_qc_bank_init(m, &e->bank);
    e->bank.type.probe = m->md.version >= 3; /* 3.5.8 */
    return err;
}

static void release(struct sim_module *const m)
{
    struct encoder *const e = m->state;
    sim_qc_bank_release(&e->bank);
}

static void power_up(struct sim_module *const m)
{
    struct encoder *const e = m->state;
    sim_qc_bank_power_up(m, &e->bank);
    sim_divider_start(&e->rate, m->clk, default_rate(m), RATE_TOP_BIT);
}

/* All edges of one counter in [from, to): one by one where its registers shift, from tick to tick while its filters
 * move, and none at all after that. At most some 50 edges follow a change of an input, however long it is ago. */
static void run_counter(const struct encoder *const e, struct sim_qcounter *const q, const int64_t from,
                        const int64_t to)
{
    const struct sim_qc_type *const type = &e->bank.type;
    int64_t clk = from;
    while (clk < to) {
        const int64_t tick = sim_divider_tick(&e->rate, clk);
        if (!sim_qcounter_busy(q, type)) {
            q->at_rest = sim_qcounter_settled(q, type);
            if (q->at_rest || tick >= to)
                return;
            clk = tick;
        }
        sim_qcounter_edge(q, type, clk, clk == tick, sim_timestamp_at(&e->bank.stamps, clk), NULL);
        clk++;
    }
}

static void run(const struct encoder *const e, const int64_t from, const int64_t to)
{
    for (unsigned i = 0; i < e->bank.count; i++)
        if (!e->bank.counters[i].at_rest)
            run_counter(e, &e->bank.counters[i], from, to);
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct encoder *const e = m->state;
    int64_t from = m->clk;
    const int64_t sample = sim_qc_bank_sample_edge(m, &e->bank, clk);
    if (sample >= from) {
        run(e, from, sample);
        sim_qc_bank_sample(&e->bank, sample);
        from = sample;
    }
    run(e, from, clk);
    m->clk = clk;
    sim_qc_bank_follow(m, &e->bank, clk);
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    struct encoder *const e = m->state;
    return sim_qc_bank_read(m, &e->bank, page, low, undriven);
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct encoder *const e = m->state;
    const int64_t clk = m->clk;
    const struct sim_qc_access access = {
        .clear = page == SIM_QC_PAGE_COUNT, .load = page == SIM_QC_PAGE_CONTROL, .value = (uint16_t)value};
    const bool to_counter = access.clear || access.load;
    if (sim_qc_bank_sample_edge(m, &e->bank, clk + 1) == clk)
        sim_qc_bank_sample(&e->bank, clk);
    for (unsigned i = 0; i < e->bank.count; i++) {
        struct sim_qcounter *const q = &e->bank.counters[i];
        if (to_counter && i == low / 4)
            sim_qcounter_edge(q, &e->bank.type, clk, sim_divider_tick(&e->rate, clk) == clk,
                              sim_timestamp_at(&e->bank.stamps, clk), &access);
        else if (!q->at_rest)
            run_counter(e, q, clk, clk + 1);
    }
    sim_qc_bank_write(&e->bank, clk, page, value);
    if (page == SIM_QC_PAGE_RATE)
        sim_divider_write(&e->rate, clk, value & RATE_MASK, RATE_TOP_BIT);
    m->clk = clk + 1;
}

static void set_pin(struct sim_qcounter *const q, const uint8_t pin, const bool level)
{
    q->at_rest = false;
    switch (pin) {
    case PIN_A:
    case PIN_B:
    case PIN_INDEX:
        q->pin[pin - PIN_A] = level;
        break;
    case PIN_SHARED: /* one pin for the index of its unit in several modules (3.5.4) */
        q->pin[SIM_QC_INDEX] = level;
        break;
    case PIN_MASK:
        q->mask = level;
        break;
    case PIN_PROBE:
        q->pin[SIM_QC_PROBE] = level;
        break;
    default:
        break;
    }
}

static void input(struct sim_module *const m, const unsigned unit, const uint8_t pin, const bool level)
{
    struct encoder *const e = m->state;
    const bool all = unit >= HM2_UNIT_GLOBAL || pin == PIN_PROBE; /* one probe for all counters (3.5.4) */
    for (unsigned i = 0; i < e->bank.count; i++)
        if (all || i == unit)
            set_pin(&e->bank.counters[i], pin, level);
}

static int64_t next_event(struct sim_module *const m)
{
    const struct encoder *const e = m->state;
    return sim_qc_bank_next_sample(m, &e->bank);
}

const struct sim_module_ops sim_encoder_ops = {
    .gtag = HM2_GTAG_ENCODER,
    .name = "Encoder",
    .pages = SIM_QC_PAGES,
    .state_size = sizeof(struct encoder),
    .init = init,
    .release = release,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .input = input,
    .next_event = next_event,
};
