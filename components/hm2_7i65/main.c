/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * hm2_7i65: the octal analog servo card 7I65 behind a buffered SPI port, with the pins and parameters of LinuxCNC's
 * mesa_7i65, whose file it must not replace.
 *
 *     loadrt hm2_7i65 bspi_chans=hm2_7i80.0.bspi.0[,...]
 *
 * It runs within the functions of the card: read() below is called after each reply, and what it stores goes out with
 * the next write. Two quad DACs (AD5754), an ADC with a sequencer (AD7329) and a CPLD hang at the port.
 */
#include <errno.h>
#include <math.h>
#include <stdint.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include <hm2/points.h>

#include "common/component.h"
#include "common/hal_binder.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("Mesa 7I65 octal analog servo card");
MODULE_LICENSE("GPL");

#define MAX_CARDS 16
#define CHANNELS  8u
#define INPUTS    4u

static char *bspi_chans[MAX_CARDS];
RTAPI_MP_ARRAY_STRING(bspi_chans, MAX_CARDS, "buffered SPI port of each 7I65");

/* Of the component that drives the card. */
int hm2_bspi_setup_chan(char *name, int chan, int cs, int bits, double mhz, int delay, int cpol, int cpha, int noclear,
                        int noecho, int samplelate);
int hm2_bspi_set_read_function(char *name, int (*func)(void *subdata), void *subdata);
int hm2_bspi_write_chan(char *name, int chan, uint32_t val);
int hm2_allocate_bspi_tram(char *name);
int hm2_tram_add_bspi_frame(char *name, int chan, uint32_t **wbuff, uint32_t **rbuff);

/* Channels of the port that are used. */
enum { CHAN_DAC1 = 1, CHAN_DAC2 = 2, CHAN_ADC = 3, CHAN_CPLD = 4 };

/* AD5754: register and address above 16 bits of data. */
#define DAC_RANGE 0x0C0004u /* all channels +-10 V */
#define DAC_POWER 0x10000Fu /* all channels on */
#define DAC_NOP   0x180000u
#define DAC_VOLT  3276.799
#define MAX_SCALE 10.0
/* AD7329 */
#define ADC_RANGE_0_3 0xA000u
#define ADC_RANGE_4_7 0xC000u
#define ADC_SEQUENCE  0x9C18u /* inputs in turn from 0 on, internal reference */
#define ADC_VALUE     0x1FFFu
#define ADC_VOLT      409.6
/* CPLD */
#define CPLD_WRITE    0xA00u
#define CPLD_WATCHDOG 0x100u
/* The chips get their settings in the first cycles: one packet may be lost. */
#define SETTING_CYCLES 8u

struct channel {
    hm2_float_t *out, *in, *scale;
    hm2_bit_t *enable, *bipolar;
};

struct servo_card {
    struct channel channel[CHANNELS];
    struct input {
        hm2_bit_t *in;
    } input[INPUTS];
    hm2_bit_t *watchdog;
    unsigned settings; /* cycles in which the chips still get theirs */
    uint32_t *dac[CHANNELS], *cpld_out, *cpld_in, *adc_out[CHANNELS], *adc_in[CHANNELS];
};

static const struct hm2_point channel_points[] = {
    HM2_POINT(struct channel, out, "analogue.#.out", HM2_FLOAT, HM2_PIN_IN, 0, "", "output, -1 to 1 of scale"),
    HM2_POINT(struct channel, in, "analogue.#.in", HM2_FLOAT, HM2_PIN_OUT, 0, "V", "analog input"),
    HM2_POINT(struct channel, enable, "enable.#.out", HM2_BIT, HM2_PIN_IN, 0, "", "enable of the amplifier"),
    HM2_POINT(struct channel, scale, "scale-#", HM2_FLOAT, HM2_PARAM_RW, 10, "V", "output for 1, at most 10"),
    HM2_POINT(struct channel, bipolar, "is-bipolar-#", HM2_BIT, HM2_PARAM_RW, 1, "", "0: no negative output"),
};
static const struct hm2_point input_points[] = {
    HM2_POINT(struct input, in, "digital.#.in", HM2_BIT, HM2_PIN_OUT, 0, "", "digital input"),
};
static const struct hm2_point card_points[] = {
    HM2_POINT(struct servo_card, watchdog, "watchdog.has-bit", HM2_BIT, HM2_PIN_OUT, 0, "", "the 7I65's own watchdog"),
};

static int component_id;
static struct hal_binder hal;

/* ---- cycle ---------------------------------------------------------------------------------------------------------
 */

static uint32_t dac_code(const struct channel *const c)
{
    double scale = *c->scale;
    if (isnan(scale))
        scale = 0.0;
    if (scale > MAX_SCALE || scale < -MAX_SCALE)
        *c->scale = scale = copysign(MAX_SCALE, scale);
    double value = *c->out;
    const double lowest = *c->bipolar ? -1.0 : 0.0;
    if (isnan(value))
        value = 0.0;
    value = fmin(fmax(value, lowest), 1.0);
    return (uint32_t)(int32_t)(value * scale * DAC_VOLT) & 0xFFFFu;
}

/* Instead of values: range, power, and words that do nothing. */
static void set_chips(const struct servo_card *const card)
{
    static const uint32_t words[CHANNELS] = {DAC_RANGE, DAC_POWER, DAC_NOP, DAC_NOP,
                                             DAC_RANGE, DAC_POWER, DAC_NOP, DAC_NOP};
    static const uint32_t adc[CHANNELS] = {0, 0, 0, 0, 0, ADC_RANGE_0_3, ADC_RANGE_4_7, ADC_SEQUENCE};
    for (unsigned i = 0; i < CHANNELS; i++) {
        *card->dac[i] = words[i];
        *card->adc_out[i] = adc[i];
    }
}

static void set_outputs(const struct servo_card *const card)
{
    for (unsigned i = 0; i < CHANNELS; i++) {
        *card->dac[i] = (i % 4u) << 16 | dac_code(&card->channel[i]);
        *card->adc_out[i] = i == CHANNELS - 1u ? ADC_SEQUENCE : 0;
    }
}

static int read_card(void *const context)
{
    struct servo_card *const card = context;
    uint32_t enables = 0;
    for (unsigned i = 0; i < CHANNELS; i++)
        enables |= *card->channel[i].enable ? 1u << i : 0;
    *card->cpld_out = CPLD_WRITE | enables;
    if (card->settings > 0) {
        card->settings--;
        set_chips(card);
        return 0;
    }
    set_outputs(card);
    for (unsigned i = 0; i < INPUTS; i++)
        *card->input[i].in = (*card->cpld_in >> i & 1u) != 0;
    *card->watchdog = (*card->cpld_in & CPLD_WATCHDOG) != 0;
    for (unsigned i = 0; i < CHANNELS; i++) {
        /* 13 bits, two's complement */
        const uint32_t value = *card->adc_in[i] & ADC_VALUE;
        *card->channel[i].in = ((double)value - (value > ADC_VALUE / 2u ? ADC_VALUE + 1.0 : 0.0)) / ADC_VOLT;
    }
    return 0;
}

/* ---- load -----------------------------------------------------------------------------------------------------------
 */

static int bind(struct servo_card *const card, const unsigned number)
{
    char prefix[HAL_NAME_LEN + 1];
    struct hm2_diag diag;
    hm2_diag_clear(&diag);
    rtapi_snprintf(prefix, sizeof prefix, "mesa-7i65.%u", number);
    int err = hm2_bind_points(&hal.binder, card_points, 1, card, prefix, 0, &diag);
    for (unsigned i = 0; !err && i < INPUTS; i++)
        err = hm2_bind_points(&hal.binder, input_points, 1, &card->input[i], prefix, i, &diag);
    for (unsigned i = 0; !err && i < CHANNELS; i++)
        err = hm2_bind_points(&hal.binder, channel_points, sizeof channel_points / sizeof channel_points[0],
                              &card->channel[i], prefix, i, &diag);
    if (err)
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_7i65: %s\n", diag.text);
    return err;
}

static int set_channels(char *const port)
{
    static const struct {
        int channel, select, bits;
        double mhz;
        int no_echo;
    } rows[] = {
        {CHAN_DAC1, 1, 24, 25, 1},
        {CHAN_DAC2, 2, 24, 25, 1},
        {CHAN_ADC, 3, 16, 6, 0},
        {CHAN_CPLD, 4, 12, 6, 0},
    };
    int err = 0;
    for (size_t i = 0; !err && i < sizeof rows / sizeof rows[0]; i++)
        err = hm2_bspi_setup_chan(port, rows[i].channel, rows[i].select, rows[i].bits, rows[i].mhz, 0, 1, 0, 0,
                                  rows[i].no_echo, 0);
    return err;
}

static int add_frames(struct servo_card *const card, char *const port)
{
    int err = hm2_tram_add_bspi_frame(port, CHAN_CPLD, &card->cpld_out, &card->cpld_in);
    for (unsigned i = 0; !err && i < CHANNELS; i++)
        err = hm2_tram_add_bspi_frame(port, CHAN_ADC, &card->adc_out[i], &card->adc_in[i]);
    for (unsigned i = 0; !err && i < CHANNELS; i++)
        err = hm2_tram_add_bspi_frame(port, i < 4 ? CHAN_DAC1 : CHAN_DAC2, &card->dac[i], NULL);
    return err ? err : hm2_allocate_bspi_tram(port);
}

static int load_card(const unsigned number)
{
    char *const port = bspi_chans[number];
    struct servo_card *const card = hal.binder.alloc(&hal.binder, sizeof *card);
    if (!card)
        return -ENOMEM;
    card->settings = SETTING_CYCLES;
    if (bind(card, number) || set_channels(port) || add_frames(card, port))
        return -EINVAL;
    return hm2_bspi_set_read_function(port, read_card, card) ? -EINVAL : 0;
}

/* Nobody may call us any more. */
static void forget_cards(const unsigned count)
{
    for (unsigned i = 0; i < count; i++)
        (void)hm2_bspi_set_read_function(bspi_chans[i], NULL, NULL);
}

static unsigned card_count;

static int load(void)
{
    hal_binder_init(&hal, component_id);
    int result = bspi_chans[0] && bspi_chans[0][0] ? 0 : -EINVAL;
    if (result)
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_7i65: no port given: loadrt hm2_7i65 bspi_chans=hm2_7i80.0.bspi.0\n");
    for (card_count = 0; !result && card_count < MAX_CARDS && bspi_chans[card_count] && bspi_chans[card_count][0];
         card_count++)
        result = load_card(card_count);
    return result;
}

void rtapi_app_exit(void)
{
    forget_cards(card_count);
    hal_exit(component_id);
}

int rtapi_app_main(void)
{
    return component_load("hm2_7i65", &component_id, load, rtapi_app_exit);
}
