/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Resolver, tag C0: excitation, converter and tracking loop for six resolvers (register map 3.14, traces in folder
 * resolver).
 *
 * The signal processor inside is simulated by what it does, not instruction by instruction: its loops take a step every
 * excitation period, with gains measured in the traces, and between two steps a position runs on evenly. The replay of
 * the traces says how near that comes. The serial lines of the converter stand still.
 */
#include <math.h>
#include <string.h>

#include "sim_card.h"

#define UNITS         4u /* address bits 7..6 select the instance (1.1) */
#define CHANNELS      6u
#define INSTANCE_SPAN 0x40u
#define TURN          4294967296.0
#define PI            3.14159265358979323846

/* The program, in clocks from its start or from the moment that is named. */
#define STATUS_CLK     2000 /* first status */
#define READY_CLK      10150
#define STEP_CLK       4372 /* of the loops, behind the falling zero crossing of the excitation */
#define EXCITATION_CLK 7128 /* power-up to its start */
#define RELOAD_CLK     6900 /* a command for the excitation; the frequency changes after */
#define CHANGE_CLK     53
#define WORD_CLK       200  /* a command for a word of its memory, */
#define BUSY_BEFORE    1372 /* unless it works on a step */
#define BUSY_BEHIND    528

#define STOP        0x4000u /* bits of a command */
#define WRITE_WORD  0x8000u
#define EXCITE      0x0800u
#define WORD_MASK   0x03FFu
#define WAITING     0x80000000u
#define ALL_BAD     0x3Fu
#define WORDS       1024u
#define BIT_CLK     4 /* of the excitation */
#define DUTY        0.5
#define DUTY_SINE   0.22
#define LOST        0.045 /* amplitude of a bad signal */
#define SPEED_GAIN  5.55e6
#define TURN_GAIN   92e6
#define SPEED_UNITS 2048 /* the last digit of a velocity */

#define PIN_POWER    0x81u
#define PIN_PLUS     0x82u
#define PIN_MINUS    0x83u
#define PIN_SELECTED 0x87u

enum { PAGE_COMMAND, PAGE_DATA, PAGE_STATUS, PAGE_VELOCITY, PAGE_POSITION, PAGES };

/* Later channels are converted further from the excitation's peak. */
static const double gains[CHANNELS] = {1, 1, 0.995, 1, 0.952, 0.902};

/* The shaft, as the world outside has it. */
struct shaft {
    struct sim_resolver is;
    int64_t seen; /* of the motor */
    int64_t clk;
    double speed; /* turns in a clock, on the way from clk to the present one */
};

struct channel {
    struct shaft shaft;
    double sum, amplitude; /* of the samples of this step */
    bool was_good;
    double velocity;      /* register */
    double position, way; /* at the last step; way in an excitation period from there */
};

/* A sine that changes its frequency without a jump. */
struct sine {
    int64_t clk, period; /* clk: when its phase was known */
    double phase;        /* in periods */
};

struct unit {
    struct sine sine;
    struct sine next; /* from next.clk on */
    double way_phase; /* where the channels' ways began */
    /* What comes, and when: SIM_NEVER = not at all. */
    int64_t excited_clk; /* first edge of the excitation */
    int64_t ready_clk;   /* the program takes no step before */
    int64_t status_clk, sample_clk, step_clk, answer_clk;
    bool stopped, waiting, about_word;
    uint32_t command, value, data, read_data, status;
    uint16_t words[WORDS];
    struct channel channels[CHANNELS];
};

struct resolvers {
    unsigned count;
    struct unit units[UNITS];
};

/* ---- excitation ----------------------------------------------------------------------------------------------------
 */

static double phase_at(const struct sine *const s, const int64_t clk)
{
    return s->phase + (double)(clk - s->clk) / (double)s->period;
}

static int64_t clk_of_phase(const struct sine *const s, const double phase)
{
    return s->clk + (int64_t)ceil((phase - s->phase) * (double)s->period - 1e-6);
}

/* Pulses so far, a fraction included: the excitation is a stream of bits with the density of the sine. */
static double pulses_at(const struct sine *const s, const int64_t bit)
{
    const double clk = (double)(bit * BIT_CLK - s->clk);
    const double swing =
        (double)s->period / (2 * PI) * (cos(2 * PI * s->phase) - cos(2 * PI * phase_at(s, bit * BIT_CLK)));
    return (DUTY * clk + DUTY_SINE * swing) / BIT_CLK;
}

static bool excited(const struct unit *const u, const int64_t clk)
{
    const int64_t bit = clk / BIT_CLK;
    return clk >= u->excited_clk && floor(pulses_at(&u->sine, bit + 1)) > floor(pulses_at(&u->sine, bit));
}

/* ---- the world outside --------------------------------------------------------------------------------------------
 */

static double turns_at(const struct shaft *const s, const int64_t clk)
{
    return s->is.turns + s->speed * (double)(clk - s->clk);
}

/* Where a motor is at `clk`, the card's present one; from where it was it has come evenly. */
static void look_at_motor(struct sim_card *const card, struct shaft *const s, const int64_t clk)
{
    const int64_t position = s->is.turns_per_s != 0 ? sim_pwmgen_position(card, s->is.pwmgen) : 0;
    const double turns = (double)(position - s->seen) / TURN * s->is.turns_per_s;
    s->speed = clk > s->clk ? turns / (double)(clk - s->clk) : 0;
    s->seen = position;
}

static void arrive(struct shaft *const s, const int64_t clk)
{
    s->is.turns = turns_at(s, clk);
    s->clk = clk;
    s->speed = 0;
}

/* ---- tracking loops ------------------------------------------------------------------------------------------------
 */

static double position_at(const struct unit *const u, const struct channel *const c, const int64_t clk)
{
    return c->position + c->way * (phase_at(&u->sine, clk) - u->way_phase);
}

/* Half of what a step knows. */
static void sample(const struct unit *const u, struct channel *const c, const unsigned number, const int64_t clk)
{
    const double error = turns_at(&c->shaft, clk) - position_at(u, c, clk) / TURN;
    c->sum += c->shaft.is.amplitude * gains[number] * sin(2 * PI * error) / 2;
    c->amplitude = c->shaft.is.amplitude;
}

static void step_channel(struct unit *const u, const unsigned number, const int64_t clk)
{
    struct channel *const c = &u->channels[number];
    const uint32_t bit = 1u << number;
    sample(u, c, number, clk);
    c->position = fmod(position_at(u, c, clk), TURN);
    const bool good = c->amplitude > LOST;
    if (good || c->was_good) {
        u->status &= ~bit;
        c->velocity += SPEED_GAIN * c->sum;
        c->way = c->velocity + TURN_GAIN * c->sum;
    } else {
        if (u->status & bit)
            c->velocity = 0;
        u->status |= bit;
        c->way = 0;
    }
    c->was_good = good;
    c->sum = 0;
}

/* The first step after `clk`, and its first sample half a period before. */
static void plan_step(struct unit *const u, const int64_t clk)
{
    const double offset = 0.5 + STEP_CLK / (double)u->sine.period;
    const double now = phase_at(&u->sine, clk > u->ready_clk ? clk : u->ready_clk);
    const double phase = floor(now - offset) + 1 + offset;
    u->step_clk = clk_of_phase(&u->sine, phase);
    u->sample_clk = clk_of_phase(&u->sine, phase - 0.5);
}

static void first_sample(struct unit *const u)
{
    for (unsigned i = 0; i < CHANNELS; i++)
        sample(u, &u->channels[i], i, u->sample_clk);
    u->sample_clk = SIM_NEVER;
}

static void step(struct unit *const u)
{
    const int64_t clk = u->step_clk;
    for (unsigned i = 0; i < CHANNELS; i++)
        step_channel(u, i, clk);
    u->way_phase = phase_at(&u->sine, clk);
    plan_step(u, clk + u->sine.period / 4);
}

/* ---- the processor -------------------------------------------------------------------------------------------------
 */

static void start_program(struct unit *const u, const int64_t clk)
{
    for (unsigned i = 0; i < CHANNELS; i++) {
        const struct shaft shaft = u->channels[i].shaft;
        u->channels[i] = (struct channel){.shaft = shaft};
    }
    u->stopped = false;
    u->value = u->read_data = 0;
    u->status_clk = clk + STATUS_CLK;
    u->ready_clk = clk + READY_CLK;
    plan_step(u, clk);
}

static int64_t word_answer_clk(const struct unit *const u, const int64_t clk)
{
    const int64_t answer = clk + WORD_CLK, last_step = u->step_clk - u->sine.period;
    if (answer < last_step + BUSY_BEHIND)
        return last_step + BUSY_BEHIND + WORD_CLK;
    return answer > u->step_clk - BUSY_BEFORE ? u->step_clk + BUSY_BEHIND + WORD_CLK : answer;
}

static void excite(struct unit *const u, const int64_t clk)
{
    static const int64_t periods[4] = {5000, 20000, 10000, 5000};
    u->answer_clk = clk + RELOAD_CLK;
    u->next = (struct sine){.clk = clk + CHANGE_CLK, .period = periods[u->command & 3u]};
}

static void take_command(struct unit *const u, const int64_t clk, const uint32_t command)
{
    u->command = command;
    u->waiting = true;
    u->about_word = false;
    if (command & STOP) {
        u->stopped = true;
        u->answer_clk = SIM_NEVER;
    } else if (u->stopped) {
        start_program(u, clk);
        u->answer_clk = clk + STATUS_CLK;
    } else if (command & EXCITE) {
        excite(u, clk);
    } else {
        u->about_word = true;
        u->answer_clk = word_answer_clk(u, clk);
    }
}

static void answer(struct unit *const u)
{
    uint16_t *const word = &u->words[u->command & WORD_MASK];
    if (u->about_word && u->command & WRITE_WORD)
        *word = (uint16_t)u->data;
    else if (u->about_word)
        u->read_data = *word;
    u->value = u->about_word ? *word : 0;
    u->waiting = false;
    u->answer_clk = SIM_NEVER;
}

/* Positions go on from where they are, at the other frequency. The first sample of the step that comes is lost. */
static void change_frequency(struct unit *const u)
{
    const int64_t clk = u->next.clk;
    u->next.clk = SIM_NEVER;
    if (u->next.period == u->sine.period)
        return;
    for (unsigned i = 0; i < CHANNELS; i++) {
        u->channels[i].position = position_at(u, &u->channels[i], clk);
        u->channels[i].sum = 0;
    }
    u->sine = (struct sine){.clk = clk, .period = u->next.period, .phase = phase_at(&u->sine, clk)};
    u->way_phase = u->sine.phase;
    plan_step(u, clk);
    u->sample_clk = SIM_NEVER;
}

/* ---- time ----------------------------------------------------------------------------------------------------------
 */

static int64_t next_clk(const struct unit *const u)
{
    const int64_t times[] = {u->status_clk, u->next.clk, u->answer_clk, u->stopped ? SIM_NEVER : u->sample_clk,
                             u->stopped ? SIM_NEVER : u->step_clk};
    int64_t first = SIM_NEVER;
    for (size_t i = 0; i < sizeof times / sizeof times[0]; i++)
        first = times[i] < first ? times[i] : first;
    return first;
}

static void happen(struct unit *const u, const int64_t clk)
{
    if (clk == u->status_clk) {
        u->status = ALL_BAD;
        u->status_clk = SIM_NEVER;
    } else if (clk == u->next.clk) {
        change_frequency(u);
    } else if (clk == u->answer_clk) {
        answer(u);
    } else if (clk == u->sample_clk) {
        first_sample(u);
    } else {
        step(u);
    }
}

static void advance(struct sim_module *const m, const int64_t clk)
{
    struct resolvers *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct unit *const u = &s->units[i];
        for (unsigned c = 0; c < CHANNELS; c++)
            look_at_motor(m->card, &u->channels[c].shaft, clk);
        for (int64_t next = next_clk(u); next < clk; next = next_clk(u))
            happen(u, next);
        for (unsigned c = 0; c < CHANNELS; c++)
            arrive(&u->channels[c].shaft, clk);
    }
}

/* ---- the module ----------------------------------------------------------------------------------------------------
 */

static int init(struct sim_module *const m)
{
    struct resolvers *const s = m->state;
    s->count = m->md.instances < UNITS ? m->md.instances : UNITS;
    return 0;
}

static void power_up(struct sim_module *const m)
{
    struct resolvers *const s = m->state;
    for (unsigned i = 0; i < s->count; i++) {
        struct unit *const u = &s->units[i];
        u->excited_clk = m->clk + EXCITATION_CLK;
        u->sine = (struct sine){.clk = u->excited_clk, .period = 5000};
        start_program(u, m->clk);
        u->next.clk = SIM_NEVER;
        u->waiting = false;
        u->command = u->data = u->status = 0;
        u->way_phase = phase_at(&u->sine, m->clk);
        u->answer_clk = SIM_NEVER;
        memset(u->words, 0, sizeof u->words);
        u->words[0] = 0x12; /* the words that the traces show */
        u->words[1] = 0x20;
        u->words[2] = 1;
        for (unsigned c = 0; c < CHANNELS; c++) {
            u->channels[c].shaft.seen = 0; /* what it follows starts at 0, too */
            u->channels[c].shaft.clk = m->clk;
        }
    }
}

static uint32_t velocity(const struct channel *const c)
{
    return (uint32_t)(int64_t)(floor(c->velocity / SPEED_UNITS) * SPEED_UNITS);
}

static uint32_t read(struct sim_module *const m, const unsigned page, const unsigned low, uint32_t *const undriven)
{
    const struct resolvers *const s = m->state;
    const unsigned i = low / INSTANCE_SPAN, c = low % INSTANCE_SPAN / 4;
    if (i >= s->count || page >= PAGES) {
        *undriven = UINT32_MAX;
        return 0;
    }
    const struct unit *const u = &s->units[i];
    if (page == PAGE_COMMAND)
        return u->value | (u->waiting ? WAITING : 0);
    if (page == PAGE_DATA)
        return u->read_data;
    if (page == PAGE_STATUS)
        return u->status;
    if (c >= CHANNELS)
        return 0;
    return page == PAGE_VELOCITY ? velocity(&u->channels[c])
                                 : (uint32_t)(int64_t)floor(position_at(u, &u->channels[c], m->clk));
}

static void write(struct sim_module *const m, const unsigned page, const unsigned low, const uint32_t value)
{
    struct resolvers *const s = m->state;
    const unsigned i = low / INSTANCE_SPAN;
    if (i >= s->count)
        return;
    if (page == PAGE_DATA)
        s->units[i].data = value;
    else if (page == PAGE_COMMAND)
        take_command(&s->units[i], m->clk, value);
}

static enum sim_level output(struct sim_module *const m, const unsigned unit, const uint8_t pin)
{
    const struct resolvers *const s = m->state;
    if (unit >= s->count)
        return SIM_LOW;
    if (pin == PIN_PLUS || pin == PIN_MINUS)
        return excited(&s->units[unit], m->clk) == (pin == PIN_PLUS) ? SIM_HIGH : SIM_LOW;
    return pin == PIN_POWER || pin == PIN_SELECTED ? SIM_HIGH : SIM_LOW;
}

static int64_t next_event(struct sim_module *const m)
{
    return (m->clk / BIT_CLK + 1) * BIT_CLK - 1; /* the edge before the next bit */
}

const struct sim_module_ops sim_resolver_ops = {
    .gtag = HM2_GTAG_RESOLVER,
    .name = "Resolver",
    .pages = PAGES,
    .state_size = sizeof(struct resolvers),
    .init = init,
    .power_up = power_up,
    .advance = advance,
    .read = read,
    .write = write,
    .output = output,
    .next_event = next_event,
};

/* ---- resolvers outside ---------------------------------------------------------------------------------------------
 */

static struct shaft *find_shaft(struct sim_card *const card, const unsigned channel)
{
    struct sim_module *const m = sim_find(card, HM2_GTAG_RESOLVER);
    struct resolvers *const s = m ? m->state : NULL;
    const unsigned i = channel / CHANNELS;
    return s && i < s->count ? &s->units[i].channels[channel % CHANNELS].shaft : NULL;
}

int sim_card_resolver(struct sim_card *const card, const unsigned channel, const struct sim_resolver *const resolver)
{
    const struct hm2_md *const drives = hm2_idrom_find(sim_idrom(card), HM2_GTAG_PWMGEN);
    struct shaft *const s = find_shaft(card, channel);
    if (!s || (resolver->turns_per_s != 0 && (!drives || resolver->pwmgen >= drives->instances)))
        return HM2_ERR_NOTFOUND;
    if (!(resolver->amplitude >= 0 && resolver->amplitude <= 1) || !(fabs(resolver->turns) <= SIM_RESOLVER_TURNS) ||
        !(fabs(resolver->turns_per_s) <= SIM_RESOLVER_TURNS))
        return HM2_ERR_RANGE;
    s->is = *resolver;
    s->clk = sim_now(card);
    s->seen = resolver->turns_per_s != 0 ? sim_pwmgen_position(card, resolver->pwmgen) : 0;
    return 0;
}

int sim_card_resolver_turns(struct sim_card *const card, const unsigned channel, double *const turns)
{
    const struct shaft *const s = find_shaft(card, channel);
    if (!s)
        return HM2_ERR_NOTFOUND;
    *turns = s->is.turns;
    return 0;
}
