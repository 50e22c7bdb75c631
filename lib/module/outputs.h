/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Numbered outputs of SSR and OutM: a value and an inversion for each described pin. Private to lib/module. */
#ifndef HM2_MODULE_OUTPUTS_H
#define HM2_MODULE_OUTPUTS_H

#include <hm2/module.h>

#define HM2_OUTPUTS 32u /* bits of the data register */

struct hm2_output {
    hm2_bit_t *out, *invert;
};

/* Outputs of one instance, from the first that has a pin descriptor to before `end`. */
struct hm2_outputs {
    const struct hm2_output *first, *end;  /* in output */
    unsigned number;                       /* of the first */
    hm2_bit_t nothing;                     /* stays 0: pins of an output between that has no pin descriptor */
    struct hm2_output output[HM2_OUTPUTS]; /* by number */
};

#define HM2_OUTPUT_ROWS 2u
extern const struct hm2_point hm2_output_points[HM2_OUTPUT_ROWS];

/* Find the outputs of an instance among the pin descriptors, up to output number last (0 to 31), and create their pins
 * with the group's prefix ("ssr.##"). */
int HM2_MUST_CHECK hm2_outputs_bind(struct hm2_outputs *outputs, const struct hm2_module *module,
                                    const struct hm2_setup *setup, const struct hm2_point_group *group, unsigned unit,
                                    unsigned last);

/* Data word: out xor invert (hal-interface 2.12). */
static inline uint32_t hm2_outputs_word(const struct hm2_outputs *const outputs)
{
    const struct hm2_output *const first = outputs->first;
    uint32_t out = 0, invert = 0;
    for (const struct hm2_output *at = outputs->end; at > first; at--) {
        out = 2u * out + *at[-1].out;
        invert = 2u * invert + *at[-1].invert;
    }
    return (out ^ invert) << outputs->number;
}

#endif
