/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* PWMGen, tag 06: PWM and PDM generators clocked by ClockHigh (register map 3.6, traces in folder pwmgen). */
#include <string.h>

#include "high_clock.h"
#include "pwm_logic.h"
#include "sim_card.h"

#define INSTANCES_MAX 64u  /* address bits 7..2 select the instance (1.1) */
#define DUTY_ONE      4096 /* pwm_duty() */
#define PIN_A         0x81u
#define PIN_B         0x82u
#define PIN_ENABLE    0x83u

enum { PAGE_VALUE, PAGE_MODE, PAGE_PWM_RATE, PAGE_PDM_RATE, PAGE_ENABLE, PAGES };

__extension__ typedef __int128 wide;

struct pwmgens {
    unsigned count;
    uint32_t enable, enable_mask;
    int64_t edges;                                      /* of ClockHigh that have been made */
    int64_t duty[INSTANCES_MAX];                        /* sum of edges * duty while enabled, */
    int64_t seen[INSTANCES_MAX], turned[INSTANCES_MAX]; /* at the last look, and of that what reached the pin */
    unsigned io[INSTANCES_MAX];                         /* of the pulses; SIM_NO_PAD = on none */
    struct pwm_reference reference;
    struct pwm_channel channels[INSTANCES_MAX];
};

/* ---- life
 * --------------------------------------------------------------------------------------------------------------- */

static int init(struct sim_module *const m)
{
    struct pwmgens *const p = m->state;
    if (sim_clock_low_hz(m->card) == 0 || sim_clock_high_hz(m->card) == 0)
        return HM2_ERR_RANGE;
    p->count = m->md.instances < INSTANCES_MAX ? m->md.instances : INSTANCES_MAX;
    for (unsigned i = 0; i < p->count; i++)
        p->io[i] = sim_pad_of(sim_idrom(m->card), HM2_GTAG_PWMGEN, i, PIN_A);
    p->enable_mask = p->count >= 32 ? UINT32_MAX : (1u << p->count) - 1;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct pwmgens *const p = m->state;
    p->enable = 0;
    p->edges = sim_high_edges(m->card, m->clk, false);
    p->reference = (struct pwm_reference){0};
    for (unsigned i = 0; i < p->count; i++)
        p->channels[i] = (struct pwm_channel){0};
    memset(p->duty, 0, sizeof p->duty);
    memset(p->seen, 0, sizeof p->seen);
    memset(p->turned, 0, sizeof p->turned);
}

static void run_channel(struct pwmgens *const p, const unsigned i, const int64_t n)
{
    struct pwm_reference reference = p->reference;
    const bool enabled = (uint64_t)p->enable >> i & 1u;
    for (int64_t done = 0; done < n;) {
        const int32_t duty = enabled ? pwm_duty(&p->channels[i]) : 0;
        const int64_t now = pwm_run_steady(&reference, &p->channels[i], n - done);
        p->duty[i] += now * duty;
        done += now;
    }
}

static void run_to(struct pwmgens *const p, const int64_t edges)
{
    const int64_t n = edges - p->edges;
    if (n <= 0)
        return;
    for (unsigned i = 0; i < p->count; i++)
        run_channel(p, i, n);
    pwm_run(&p->reference, NULL, n);
    p->edges = edges;
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    run_to(m->state, sim_high_edges(m->card, clk, false));
}

/* ---- registers
 * ------------------------------------------------------------------------------------------------------------ */

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct pwmgens *const p = m->state;
    (void)low;
    *undriven = page == PAGE_ENABLE ? 0 : UINT32_MAX;
    return page == PAGE_ENABLE ? p->enable : 0;
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct pwmgens *const p = m->state;
    const unsigned i = low / 4;
    run_to(p, sim_high_edges(m->card, m->clk, true));
    if (page == PAGE_VALUE && i < p->count)
        pwm_value_write(&p->channels[i], value);
    else if (page == PAGE_MODE && i < p->count)
        pwm_mode_write(&p->channels[i], value);
    else if (page == PAGE_PWM_RATE)
        pwm_rate_write(&p->reference.pwm, (uint16_t)value);
    else if (page == PAGE_PDM_RATE)
        pwm_rate_write(&p->reference.pdm, (uint16_t)value);
    else if (page == PAGE_ENABLE)
        p->enable = value & p->enable_mask;
}

/* ---- outputs
 * --------------------------------------------------------------------------------------------------------------- */

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct pwmgens *const p = m->state;
    if (unit >= p->count)
        return SIM_LOW;
    if (pin == PIN_ENABLE) /* the pin is active low, and the register bit is not a gate (3.6) */
        return p->enable >> unit & 1u ? SIM_LOW : SIM_HIGH;
    if (pin != PIN_A && pin != PIN_B)
        return SIM_LOW;
    return pwm_output(&p->channels[unit], pin == PIN_A ? PWM_PIN_A : PWM_PIN_B) ? SIM_HIGH : SIM_LOW;
}

static void trace(struct sim_module *const m, const unsigned unit, const uint8_t pin, const int64_t from,
                  const int64_t to, void (*const report)(void *context, int64_t clk, unsigned ps, enum sim_level level),
                  void *const context)
{
    const struct pwmgens *const p = m->state;
    (void)from;
    if (unit >= p->count || (pin != PIN_A && pin != PIN_B))
        return; /* the enable pins change with a write only */
    const enum pwm_pin which = pin == PIN_A ? PWM_PIN_A : PWM_PIN_B;
    struct pwm_reference reference = p->reference;
    struct pwm_channel channel = p->channels[unit];
    const int64_t end = sim_high_edges(m->card, to, false);
    for (int64_t edge = p->edges; edge < end;) {
        const bool before = pwm_output(&channel, which);
        edge += pwm_run_to_change(&reference, &channel, which, end - edge);
        const bool after = pwm_output(&channel, which);
        unsigned ps = 0;
        const int64_t clk = sim_low_edge(m->card, edge - 1, &ps);
        if (after != before)
            report(context, clk, ps, after ? SIM_HIGH : SIM_LOW);
    }
}

int64_t sim_pwmgen_position(struct sim_card *const card, const unsigned pwmgen)
{
    struct sim_module *const m = sim_find(card, HM2_GTAG_PWMGEN);
    if (!m)
        return 0;
    struct pwmgens *const p = m->state;
    const wide one = (wide)sim_clock_high_hz(card) * DUTY_ONE; /* full duty for a second */
    if (pwmgen >= p->count || one == 0)
        return 0;
    if (p->io[pwmgen] == SIM_NO_PAD || sim_card_pad(card, p->io[pwmgen]) != SIM_FLOAT)
        p->turned[pwmgen] += p->duty[pwmgen] - p->seen[pwmgen];
    p->seen[pwmgen] = p->duty[pwmgen];
    const wide scaled = (wide)p->turned[pwmgen] * (1LL << 32);
    return (int64_t)(scaled / one - (scaled % one < 0));
}

const struct sim_module_ops sim_pwmgen_ops = {
    .gtag = HM2_GTAG_PWMGEN,
    .name = "PWMGen",
    .pages = PAGES,
    .state_size = sizeof(struct pwmgens),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .trace = trace,
};
