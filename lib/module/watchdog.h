/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a board asks of its watchdog module. Every function takes NULL (firmware without a watchdog) and then says or
 * does nothing. The cyclic ones are realtime safe.
 */
#ifndef HM2_MODULE_WATCHDOG_H
#define HM2_MODULE_WATCHDOG_H

#include <hm2/module.h>

/* The dog has bitten and has_bit is still 1: for struct hm2_cycle. Ask before the modules are packed: when the user has
 * just cleared has_bit this is false, and the same write brings everything back. */
bool hm2_watchdog_bitten(const struct hm2_module *module);
/* The reply that is about to be unpacked is the first to tell of a bite. */
bool hm2_watchdog_bites(const struct hm2_module *module);
/* Time without a write after which it bites. */
int64_t hm2_watchdog_timeout_ns(const struct hm2_module *module);
/* Treat the card as bitten (it lost its power and came back): has_bit becomes 1. */
void hm2_watchdog_raise(struct hm2_module *module);
/* As if a person had set has_bit to 0. */
void hm2_watchdog_clear(struct hm2_module *module);
/* Address of the timer register; writing 1 there makes the dog bite at once (hal-interface 1.7). 0 without module. */
uint16_t hm2_watchdog_timer_address(const struct hm2_module *module);

#endif
