/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the readers of absolute encoders have in common: SSI, BISS and FanucAbs (register map 3.9, hal-interface 2.17).
 * Private to lib/module.
 *
 * A channel exists when the configuration gives it a format. Its transfers are started by a DPLL timer, or by the
 * driver itself with each write: not before the transfer before is over and the encoder had time to rest, because a
 * start in the middle of one gives wrong data without a sign of it (traces fabs, ssi, biss). A reading counts only when
 * the card says that it is complete.
 */
#ifndef HM2_MODULE_ABSENC_H
#define HM2_MODULE_ABSENC_H

#include <hm2/module.h>

#include "absenc_fields.h"

#define HM2_ABSENC_CONTROLS 4u

struct hm2_absenc_channel {
    hm2_bit_t *data_invalid;
    hm2_float_t *frequency_khz;
    hm2_u32_t *timer_number;
    hm2_u32_t *filter; /* FanucAbs, else NULL */

    double for_khz; /* parameters that the registers were computed from */
    uint32_t for_timer, for_filter;

    unsigned number, words;
    struct hm2_absenc_fields fields;
    struct hm2_window data[HM2_ABSENC_WORDS];
    struct hm2_section start, control[HM2_ABSENC_CONTROLS];
    int64_t transfer_ns;          /* with the rest that an encoder needs */
    int64_t started_ns, good_ns;  /* last start of our own, last complete reading */
    bool running, again, suspect; /* again: the start is on its way a second time */
};

struct hm2_absenc_kind {
    unsigned max_bits, busy_register, controls;
    const struct hm2_point_group *group; /* points of a channel */
    /* Windows of the data words and sections of the control registers. */
    int (*add_registers)(struct hm2_absenc_channel *channel, struct hm2_module *module, struct hm2_setup *setup);
    /* Control registers and transfer_ns from the parameters. */
    void (*set_registers)(struct hm2_absenc_channel *channel, const struct hm2_module *module);
    bool (*is_good)(const struct hm2_absenc_channel *channel); /* of a complete reading; may be NULL */
};

struct hm2_absenc {
    const struct hm2_absenc_kind *kind;
    struct hm2_window busy;
    unsigned count;
    struct hm2_absenc_channel channel[];
};

int HM2_MUST_CHECK hm2_absenc_setup(struct hm2_module *module, struct hm2_setup *setup,
                                    const struct hm2_absenc_kind *kind);
void hm2_absenc_start(struct hm2_module *module, const struct hm2_cycle *cycle);
void hm2_absenc_unpack(struct hm2_module *module, const struct hm2_cycle *cycle);
void hm2_absenc_pack(struct hm2_module *module, const struct hm2_cycle *cycle);
void hm2_absenc_write_lost(struct hm2_module *module);

/* ---- for the kinds -------------------------------------------------------------------------------------------------
 */

#define HM2_ABSENC_ROWS(khz)                                                                                      \
    HM2_POINT(struct hm2_absenc_channel, data_invalid, "data-invalid", HM2_BIT, HM2_PIN_OUT, 0, "",               \
              "1 = no complete reading for ten cycles"),                                                          \
        HM2_POINT(struct hm2_absenc_channel, frequency_khz, "frequency-khz", HM2_FLOAT, HM2_PARAM_RW, khz, "kHz", \
                  "bit clock"),                                                                                   \
        HM2_POINT(struct hm2_absenc_channel, timer_number, "timer-number", HM2_U32, HM2_PARAM_RW, 0, "",          \
                  "DPLL timer that starts transfers, 1 to 4; 0 = every write does")

/* Names of the output pins of SSI and BISS; Fanuc's have none. */
const char *hm2_absenc_output_name(const struct hm2_pd *pd);
int HM2_MUST_CHECK hm2_absenc_add_control(struct hm2_absenc_channel *channel, const struct hm2_module *module,
                                          struct hm2_setup *setup, unsigned control, unsigned reg);
/* Rate register for the bit clock, clock * rate / one; a frequency outside 1..max is rewritten. */
uint32_t hm2_absenc_rate(const struct hm2_absenc_channel *channel, const struct hm2_module *module, double one,
                         uint32_t max);
/* The timer's number, 0 to 4; what is more is rewritten. */
uint32_t hm2_absenc_timer(const struct hm2_absenc_channel *channel, const struct hm2_module *module);
/* Time of so many clocks of the bit rate. */
int64_t hm2_absenc_clocks_ns(const struct hm2_absenc_channel *channel, double clocks);

#endif
