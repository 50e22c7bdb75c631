/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Scanned, filtered inputs: what InM and InMux share. Private to lib/module. */
#ifndef HM2_MODULE_SCANNED_H
#define HM2_MODULE_SCANNED_H

#include <hm2/module.h>

/* Which inputs exist as pins. */
enum hm2_scanned_inputs {
    HM2_SCANNED_BY_WIDTH,         /* those below scan_width */
    HM2_SCANNED_BY_WIDTH_AND_PIN, /* and those that a pin descriptor names (hal-interface 8.2: the union) */
};

/* Rows of the groups that a type lists, in the order of HM2_SCANNED_GROUPS. */
enum {
    HM2_SCANNED_MODULE_ROWS = 4,
    HM2_SCANNED_LEVEL_ROWS = 2,
    HM2_SCANNED_SLOW_ROWS = 1,
    HM2_SCANNED_COUNTER_ROWS = 3
};
extern const struct hm2_point hm2_scanned_points[HM2_SCANNED_MODULE_ROWS];
extern const struct hm2_point hm2_scanned_filtered_points[HM2_SCANNED_LEVEL_ROWS];
extern const struct hm2_point hm2_scanned_raw_points[HM2_SCANNED_LEVEL_ROWS];
extern const struct hm2_point hm2_scanned_slow_points[HM2_SCANNED_SLOW_ROWS];
extern const struct hm2_point hm2_scanned_counter_points[HM2_SCANNED_COUNTER_ROWS];

/* Initialiser of an array of struct hm2_point_group. */
#define HM2_SCANNED_GROUPS(prefix_text, inputs_text)                                                                \
    {                                                                                                               \
        {(prefix_text), hm2_scanned_points, HM2_SCANNED_MODULE_ROWS, NULL},                                         \
            {(prefix_text), hm2_scanned_filtered_points, HM2_SCANNED_LEVEL_ROWS, (inputs_text)},                    \
            {(prefix_text), hm2_scanned_raw_points, HM2_SCANNED_LEVEL_ROWS, (inputs_text)},                         \
            {(prefix_text), hm2_scanned_slow_points, HM2_SCANNED_SLOW_ROWS, (inputs_text)},                         \
            {(prefix_text), hm2_scanned_counter_points, HM2_SCANNED_COUNTER_ROWS, "0 to 3"}, {NULL, NULL, 0, NULL}, \
    }

/* max_bits_per_s limits scan_width * scan_rate (hal-interface 2.13). Pins are claimed as immediate. */
int HM2_MUST_CHECK hm2_scanned_setup(struct hm2_module *module, struct hm2_setup *setup, enum hm2_scanned_inputs inputs,
                                     uint32_t max_bits_per_s);
void hm2_scanned_start(struct hm2_module *module, const struct hm2_cycle *cycle);
void hm2_scanned_unpack(struct hm2_module *module, const struct hm2_cycle *cycle);
void hm2_scanned_pack(struct hm2_module *module, const struct hm2_cycle *cycle);

#endif
