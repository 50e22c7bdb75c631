/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "outputs.h"

#include "bind.h"

const struct hm2_point hm2_output_points[HM2_OUTPUT_ROWS] = {
    HM2_POINT(struct hm2_output, out, "out-##", HM2_BIT, HM2_PIN_IN, 0, "", "1 = on"),
    HM2_POINT(struct hm2_output, invert, "invert-##", HM2_BIT, HM2_PIN_IN, 0, "", "1 = out is inverted"),
};

/* Numbers of the outputs of a unit that pin descriptors name. */
static uint32_t described(const struct hm2_idrom *const idrom, const uint8_t gtag, const unsigned unit)
{
    uint32_t numbers = 0;
    for (unsigned io = 0; io < idrom->pin_count; io++) {
        const struct hm2_pd *const pd = &idrom->pins[io];
        const unsigned code = pd->secondary_pin & ~HM2_PIN_OUTPUT;
        if (pd->secondary_tag == gtag && (pd->secondary_unit == unit || pd->secondary_unit & HM2_UNIT_GLOBAL) &&
            pd->secondary_pin & HM2_PIN_OUTPUT && code >= 1 && code <= HM2_OUTPUTS)
            numbers |= 1u << (code - 1);
    }
    return numbers;
}

int hm2_outputs_bind(struct hm2_outputs *const outputs, const struct hm2_module *const module,
                     const struct hm2_setup *const setup, const struct hm2_point_group *const group,
                     const unsigned unit, const unsigned last)
{
    const uint32_t numbers =
        described(setup->idrom, module->md->gtag, unit) & (UINT32_MAX >> (HM2_OUTPUTS - 1u - last));
    int err = 0;
    if (numbers == 0)
        return 0;
    const unsigned end = HM2_OUTPUTS - (unsigned)__builtin_clz(numbers);
    outputs->number = (unsigned)__builtin_ctz(numbers);
    outputs->first = &outputs->output[outputs->number];
    outputs->end = outputs->output + end;
    for (unsigned number = outputs->number; err == 0 && number < end; number++) {
        struct hm2_output *const output = &outputs->output[number];
        if (numbers >> number & 1u)
            err = hm2_bind_item(setup, group, output, unit, number);
        else
            output->out = output->invert = &outputs->nothing;
    }
    return err;
}
