/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A 7I65 behind a buffered SPI port: two quad DACs (AD5754, chip selects 1 and 2), an eight-channel ADC with a
 * sequencer (AD7329, chip select 3) and a CPLD with the enables, inputs and a watchdog (chip select 4). Clock idle
 * high, data taken at the falling edge. Only what the analog loop, enables and inputs need is here.
 */
#include <math.h>
#include <stdlib.h>

#include "card_state.h"
#include "motor.h"
#include "sim_qcounter.h"

#define DAC_CHANNELS 4u
#define VOLTS        10.0
#define DAC_CODE     3276.8 /* per volt, ranges of +-10 V */
#define ADC_CODE     409.6
#define ADC_WRITE    (1u << 15)
#define CPLD_WRITE   0xA00u
#define SELECTS      3u

enum { PIN_FRAME, PIN_MOSI, PIN_SCLK, PIN_CS0, PINS = PIN_CS0 + SELECTS };
enum { CS_ECHO, CS_DAC1, CS_DAC2, CS_ADC, CS_CPLD };

struct sim_7i65 {
    struct sim_card *card;
    unsigned unit;
    int watch[PINS];
    bool level[PINS];
    uint32_t in, out; /* of the word under way */
    unsigned bits, length;
    bool powered[2];
    double out_volts[SIM_7I65_CHANNELS], in_volts[SIM_7I65_CHANNELS];
    unsigned channel; /* that the ADC converted for the next word */
    uint8_t enables, inputs;
    bool driven[SIM_7I65_CHANNELS]; /* there is a motor */
    struct sim_motor motor[SIM_7I65_CHANNELS];
};

static unsigned selected(const struct sim_7i65 *const s)
{
    return (unsigned)s->level[PIN_CS0] | (unsigned)s->level[PIN_CS0 + 1] << 1 | (unsigned)s->level[PIN_CS0 + 2] << 2;
}

static void show(struct sim_7i65 *const s, const int64_t clk)
{
    const bool bit = s->bits < s->length && (s->out >> (s->length - 1u - s->bits) & 1u);
    const int err = sim_card_drive_input(s->card, clk, HM2_GTAG_BSPI, s->unit, 0x04, bit ? SIM_HIGH : SIM_LOW);
    (void)err; /* the port was there when it was attached */
}

/* 13 bits, two's complement, behind three bits with the channel. */
static uint32_t adc_word(const struct sim_7i65 *const s)
{
    const double volts = fmin(fmax(s->in_volts[s->channel], -VOLTS), VOLTS - 1.0 / ADC_CODE);
    return s->channel << 13 | ((uint32_t)(int32_t)floor(volts * ADC_CODE + 0.5) & 0x1FFFu);
}

static void start_word(struct sim_7i65 *const s, const int64_t clk)
{
    s->bits = 0;
    s->in = s->out = 0;
    s->length = 32;
    if (selected(s) == CS_ADC) {
        s->length = 16;
        s->out = adc_word(s);
    } else if (selected(s) == CS_CPLD) {
        s->length = 12;
        s->out = s->inputs;
    }
    show(s, clk);
}

/* Until clk the outputs were as they are. */
static void turn(struct sim_7i65 *const s, const int64_t clk)
{
    for (unsigned i = 0; i < SIM_7I65_CHANNELS; i++) {
        const bool enabled = (unsigned)s->enables >> i & 1u;
        if (s->driven[i])
            sim_motor_turn(&s->motor[i], enabled ? s->out_volts[i] / VOLTS : 0.0, clk, sim_clock_low_hz(s->card));
    }
}

static void take_dac(struct sim_7i65 *const s, const unsigned chip)
{
    const unsigned what = s->in >> 19 & 7u, channel = s->in >> 16 & 7u;
    if (s->bits != 24 || s->in >> 23)
        return;
    if (what == 2)
        s->powered[chip] = (s->in & 0xFu) == 0xFu;
    else if (what == 0 && channel < DAC_CHANNELS)
        s->out_volts[DAC_CHANNELS * chip + channel] =
            s->powered[chip] ? (double)(int16_t)(s->in & 0xFFFFu) / DAC_CODE : 0.0;
}

static void end_word(struct sim_7i65 *const s, const int64_t clk)
{
    const unsigned chip = selected(s);
    turn(s, clk);
    if (chip == CS_DAC1 || chip == CS_DAC2) {
        take_dac(s, chip - CS_DAC1);
    } else if (chip == CS_ADC && s->bits == 16) {
        /* A write of the control register (bits 14..13 zero) starts the sequence anew; its result is the next word. */
        const bool control = (s->in & (ADC_WRITE | 3u << 13)) == ADC_WRITE;
        s->channel = control ? 0 : (s->channel + 1u) % SIM_7I65_CHANNELS;
    } else if (chip == CS_CPLD && s->bits == 12 && (s->in & 0xF00u) == CPLD_WRITE) {
        s->enables = (uint8_t)s->in;
    }
}

static void on_edge(void *const context, const int64_t clk, const unsigned ps, const unsigned watch,
                    const enum sim_level level)
{
    struct sim_7i65 *const s = context;
    (void)ps;
    for (unsigned pin = 0; pin < PINS; pin++) {
        if (s->watch[pin] != (int)watch)
            continue;
        s->level[pin] = level == SIM_HIGH;
        if (pin == PIN_FRAME && level == SIM_LOW) {
            start_word(s, clk);
        } else if (pin == PIN_FRAME) {
            end_word(s, clk);
        } else if (pin == PIN_SCLK && !s->level[PIN_FRAME]) {
            if (level == SIM_LOW)
                s->in = s->in << 1 | s->level[PIN_MOSI];
            else
                s->bits++;
            show(s, clk);
        }
    }
}

int sim_7i65_new(struct sim_7i65 **const made, struct sim_card *const card, const unsigned unit)
{
    static const uint8_t codes[PINS] = {0x81, 0x82, 0x83, 0x85, 0x86, 0x87};
    *made = NULL;
    struct sim_7i65 *const s = calloc(1, sizeof *s);
    if (!s)
        return HM2_ERR_NOMEM;
    s->card = card;
    s->unit = unit;
    for (unsigned pin = 0; pin < PINS; pin++) {
        s->watch[pin] = sim_card_watch_output(card, HM2_GTAG_BSPI, unit, codes[pin]);
        if (s->watch[pin] < 0) {
            const int err = s->watch[pin];
            free(s);
            return err;
        }
        s->level[pin] = sim_card_watched(card, (unsigned)s->watch[pin]) == SIM_HIGH;
    }
    sim_card_on_edge(card, on_edge, s);
    *made = s;
    return 0;
}

void sim_7i65_free(struct sim_7i65 *const s)
{
    if (!s)
        return;
    sim_card_on_edge(s->card, NULL, NULL);
    free(s);
}

double sim_7i65_output_volts(const struct sim_7i65 *const s, const unsigned channel)
{
    return channel < SIM_7I65_CHANNELS ? s->out_volts[channel] : 0.0;
}

void sim_7i65_set_input_volts(struct sim_7i65 *const s, const unsigned channel, const double volts)
{
    if (channel < SIM_7I65_CHANNELS)
        s->in_volts[channel] = volts;
}

void sim_7i65_set_inputs(struct sim_7i65 *const s, const uint8_t inputs)
{
    s->inputs = inputs & 0xFu;
}

uint8_t sim_7i65_enables(const struct sim_7i65 *const s)
{
    return s->enables;
}

/* For sim_follow. The daughter card has the card's edge callback. */
static int64_t position(struct sim_card *const card, const unsigned channel)
{
    struct sim_7i65 *const s = card->on_edge_context;
    turn(s, sim_now(card));
    return sim_motor_position(&s->motor[channel]);
}

int sim_7i65_motor(struct sim_7i65 *const s, const unsigned channel, const unsigned encoder, const int32_t counts_per_s,
                   const double time_constant_s)
{
    if (channel >= SIM_7I65_CHANNELS || s->driven[channel])
        return HM2_ERR_NOTFOUND;
    if (!sim_motor_possible(time_constant_s))
        return HM2_ERR_RANGE;
    s->motor[channel] = (struct sim_motor){.time_constant_s = time_constant_s, .at = sim_now(s->card)};
    const struct sim_follow follow = {position, .unit = channel, .num = counts_per_s, .den = 1, .keeps = true};
    const int err = sim_qc_follow(s->card, encoder, &follow);
    s->driven[channel] = err == 0;
    return err;
}
